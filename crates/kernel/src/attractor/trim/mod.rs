//! Trimmed surfaces: products of two splines, cut along closed loops of curves in the parameter plane.
//!
//! Let S be the surface on its domain, Omega the closed region that the loops bound, and Omega' the region that the
//! polygons of their chords bound. Drawn is T(Omega'), where T takes the surface's points at the corners of a
//! triangulation of Omega' that keeps to the leaf cells, and is affine between them.
//!
//! *Inside a leaf* |S - T| is at most the leaf's error: with the notation of `precision`, S(p) is within eta of L(p) for
//! every parameter p, so T, which is L displaced by at most eta at corners, is within eta of L(p) too: 2 eta in all. Where
//! the error is the diameter of the cell's ball, S(p) and T(p) are both in the ball.
//!
//! *At the rim*: let |dS/du| <= L_u and |dS/dv| <= L_v on the domain and measure the plane in (L_u u, L_v v). Two points of
//! the domain at the distance s there are at most sqrt(2) s apart on the surface, along a path parallel to the axes. Let all
//! control points of an arc be within h of its chord. The hull of the arc is, distances being convex. A point is around the
//! polygon as often as around the loop unless it is in the hull of an arc, since the homotopy from arc to chord stays there.
//! So points of Omega beyond Omega' are within h of a chord, which belongs to Omega'. Points of Omega' beyond Omega are within
//! h of a chord, and chords within h of their arc: the perpendicular through any point of the chord parts the ends of the arc,
//! and so meets the arc, in the hull. Arcs belong to Omega. Together: S(Omega) and S(Omega') are within 2 sqrt(2) h of each
//! other, and the Hausdorff distance of S(Omega) and T(Omega') is at most the largest leaf error + 2 sqrt(2) h, and what
//! closing gaps moved: sqrt(2) (L_u du + L_v dv) or less.
//!
//! The topology of Omega' is that of Omega (`region`), and T identifies parameters exactly where the surface's sides are
//! glued or collapsed.

mod arc;
mod draw;
mod fill;
mod pairs;
mod rays;
mod region;
mod rim;
mod window;

pub(crate) use arc::Arc;
pub(crate) use draw::refine;
pub(crate) use region::{CurvePlace, GAP, Region, RegionFault};
pub(crate) use rim::Rim;
pub(crate) use window::Window;

use super::cell::Point;
use arc::Parameter;

/// A trimmed surface: what the automaton does not know of it.
#[derive(Clone, Debug)]
pub(crate) struct TrimmedSurface {
    /// Parameter intervals of the spans in u and in v.
    pub(crate) intervals: [Vec<[f64; 2]>; 2],
    /// Whether the end of a direction is its start.
    pub(crate) closed: [bool; 2],
    /// The cells, one for every pair of spans, v fastest.
    pub(crate) cells: Vec<SpanCell>,
    /// d + 1 in u and in v.
    pub(crate) orders: [usize; 2],
    /// What is kept.
    pub(crate) region: Region,
}

/// The surface on a pair of spans.
#[derive(Clone, Debug)]
pub(crate) struct SpanCell {
    /// Its root; `None` if it is a single point.
    pub(crate) root: Option<usize>,
    /// Bezier points (w x, w y, w z, w), v fastest.
    pub(crate) points: Vec<[f64; 4]>,
    /// Whether its sides at the start and end of u, and at the start and end of v, are single points.
    pub(crate) collapsed: [bool; 4],
}

impl TrimmedSurface {
    fn cell(&self, spans: [usize; 2]) -> &SpanCell {
        &self.cells[spans[0] * self.intervals[1].len() + spans[1]]
    }

    /// The surface's point at a parameter of a pair of spans, by de Casteljau's algorithm.
    fn point(&self, spans: [usize; 2], parameter: Parameter) -> Point {
        let cell = self.cell(spans);
        let local: [f64; 2] = std::array::from_fn(|k| {
            let [low, high] = self.intervals[k][spans[k]];
            ((parameter[k] - low) / (high - low)).clamp(0.0, 1.0)
        });
        let rows: Vec<[f64; 4]> = cell.points.chunks(self.orders[1]).map(|row| casteljau(row, local[1])).collect();
        let [x, y, z, w] = casteljau(&rows, local[0]);
        [x / w, y / w, z / w]
    }

    /// Bounds (L_u, L_v) of the derivatives. On a span of length l, with N and w the polynomials of the homogeneous points
    /// seen from o: S - o = N / w, so dS = (dN - (S - o) dw) / w, and a derivative is degree / l times a convex combination
    /// of differences of neighbouring control points; |S - o| is at most the largest distance of a control point.
    fn derivatives(&self) -> [f64; 2] {
        let [nu, nv] = self.orders;
        let mut bounds = [0.0_f64; 2];
        for (index, cell) in self.cells.iter().enumerate() {
            let spans = [index / self.intervals[1].len(), index % self.intervals[1].len()];
            let place = |p: &[f64; 4]| -> Point { std::array::from_fn(|i| p[i] / p[3]) };
            let origin = place(&cell.points[(nu / 2) * nv + nv / 2]);
            let seen = |p: &[f64; 4]| -> Point { std::array::from_fn(|i| p[i] - origin[i] * p[3]) };
            let length = |x: &Point| super::cell::dot(x, x).sqrt();
            let least = cell.points.iter().map(|p| p[3]).fold(f64::INFINITY, f64::min);
            let reach = cell.points.iter().map(|p| length(&seen(p)) / p[3]).fold(0.0, f64::max);
            for (direction, stride) in [(0, nv), (1, 1)] {
                let [low, high] = self.intervals[direction][spans[direction]];
                let last = |position: usize| if direction == 0 { position / nv + 1 == nu } else { position % nv + 1 == nv };
                let (mut numerator, mut weight) = (0.0_f64, 0.0_f64);
                for position in (0..cell.points.len()).filter(|&position| !last(position)) {
                    let (a, b) = (&cell.points[position], &cell.points[position + stride]);
                    let (p, q) = (seen(a), seen(b));
                    numerator = numerator.max(length(&std::array::from_fn(|i| q[i] - p[i])));
                    weight = weight.max((b[3] - a[3]).abs());
                }
                let degree = (self.orders[direction] - 1) as f64;
                bounds[direction] = bounds[direction].max(degree / (high - low) * (numerator + reach * weight) / least);
            }
        }
        bounds
    }

    /// Bounds the way on the surface between parameters that differ by no more than this.
    fn length_of(&self, difference: [f64; 2]) -> f64 {
        if difference == [0.0; 2] {
            return 0.0;
        }
        let scale = self.derivatives();
        2.0_f64.sqrt() * (scale[0] * difference[0] + scale[1] * difference[1])
    }

    /// Bounds how far closing gaps and snapping to the border moved points of the surface.
    pub(crate) fn moved_mm(&self) -> f64 {
        self.length_of(self.region.moved)
    }

    /// Maps the surface by x -> map(x w, w), homogeneous points to homogeneous points.
    pub(crate) fn transform(&mut self, map: impl Fn(&[f64; 4]) -> [f64; 4]) {
        self.cells.iter_mut().flat_map(|cell| &mut cell.points).for_each(|point| *point = map(point));
    }

    /// The halves of a parameter rectangle that child `index` of its cell is.
    fn child_box(rectangle: &[Parameter; 2], index: usize) -> [Parameter; 2] {
        let [low, high] = rectangle;
        let mut child = *rectangle;
        for (k, half) in [index / 2, index % 2].into_iter().enumerate() {
            child[1 - half][k] = 0.5 * (low[k] + high[k]);
        }
        child
    }

    /// The spans of a root, roots being in the order of their cells.
    fn spans_of(&self, root: usize) -> Option<[usize; 2]> {
        let first = self.cells.iter().find_map(|cell| cell.root)?;
        // Only cells that are points have no root: look on from where the cell would be without any.
        let index = (root.checked_sub(first)?..self.cells.len()).find(|&index| self.cells[index].root == Some(root))?;
        Some([index / self.intervals[1].len(), index % self.intervals[1].len()])
    }

    /// The parameter rectangle of all spans.
    fn domain(&self) -> [Parameter; 2] {
        let [first, last] = [[0; 2], [0, 1].map(|k| self.intervals[k].len() - 1)].map(|spans| self.span_box(spans));
        [first[0], last[1]]
    }

    /// Of u and v, whether the sides of a pair of spans are in the domain's inside.
    fn inner_sides(&self, spans: [usize; 2]) -> [[bool; 2]; 2] {
        [0, 1].map(|k| [spans[k] > 0, spans[k] + 1 < self.intervals[k].len()])
    }

    /// The parameter rectangle of a pair of spans.
    fn span_box(&self, spans: [usize; 2]) -> [Parameter; 2] {
        let end = |side: usize| std::array::from_fn(|k| self.intervals[k][spans[k]][side]);
        [end(0), end(1)]
    }
}

fn casteljau(points: &[[f64; 4]], t: f64) -> [f64; 4] {
    let mut row = [[0.0; 4]; 64];
    let row = &mut row[..points.len()];
    row.copy_from_slice(points);
    for length in (1..points.len()).rev() {
        for k in 0..length {
            row[k] = std::array::from_fn(|i| (1.0 - t) * row[k][i] + t * row[k + 1][i]);
        }
    }
    row[0]
}
