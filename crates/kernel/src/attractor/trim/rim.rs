//! The loops in space: rational Bezier curves.
//!
//! On a pair of spans the surface is sum_ij P_ij B_i(u) B_j(v), with homogeneous P_ij. Let (U, V, W) be an arc of degree p in
//! the spans' rectangle, A = (U - u_0 W) / (u_1 - u_0) and A' = W - A its parameter u from either side, likewise for v. Then a
//! step of de Casteljau's algorithm along the arc, P_i -> A' P_i + A P_i+1, is one of polynomials, and the arc's image is a
//! Bezier curve of degree p (d_u + d_v). A and A' have no negative coefficients, so that weights stay positive, and points
//! are means of the P_ij: nothing cancels (DeRose, Goldman, Hagen and Mann, "Functional composition algorithms via
//! blossoming", ACM Transactions on Graphics 12(2), 1993).

use super::TrimmedSurface;
use super::arc::{Arc, Parameter};
use crate::attractor::Attractor;
use crate::attractor::cell::ControlPoint;

/// Degree of a curve at most: binomials beyond it overflow.
const MOST_DEGREE: usize = 1000;
/// Rounding of parameters, relative to the domain's largest: arcs may leave a rectangle by as much.
const ROUNDING: f64 = 1e-14;

/// The loops of all trimmed surfaces.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rim {
    /// Homogeneous Bezier points of curves, each with a root of its surface.
    pub(crate) curves: Vec<(u32, Vec<ControlPoint>)>,
    /// Of every trimmed surface, whether all its loops are among them.
    pub(crate) is_whole: Vec<bool>,
    /// Bounds the distance of the curves from the loops.
    pub(crate) moved_mm: f64,
}

impl Rim {
    /// The loops of an attractor's trimmed surfaces.
    ///
    /// Cost: of every arc, about (n_u n_v)^2 p^2 multiplications for n_u x n_v Bezier points.
    pub(crate) fn of(attractor: &Attractor) -> Self {
        let mut rim = Self::default();
        for surface in attractor.trimmed() {
            let mut moved = [0.0; 2];
            let mut whole = true;
            let first = surface.cells.iter().find_map(|cell| cell.root);
            for u in 0..surface.intervals[0].len() {
                for v in 0..surface.intervals[1].len() {
                    // Cells that are single points have no root, but what is kept may lie in them alone.
                    let Some(root) = surface.cell([u, v]).root.or(first) else { continue };
                    for arc in surface.arcs_in([u, v], &mut moved) {
                        match surface.image([u, v], &arc) {
                            Some(points) => rim.curves.push((root as u32, points)),
                            None => whole = false,
                        }
                    }
                }
            }
            rim.is_whole.push(whole);
            rim.moved_mm = rim.moved_mm.max(surface.length_of(moved));
        }
        rim
    }
}

impl TrimmedSurface {
    /// The parts of the loops' arcs in the rectangle of a pair of spans; notes how far they were moved into it. What is
    /// beyond the domain's border is meant to lie on it (see `region`).
    fn arcs_in(&self, spans: [usize; 2], moved: &mut [f64; 2]) -> Vec<Arc> {
        let rectangle = self.span_box(spans);
        let (inner, domain) = (self.inner_sides(spans), self.domain());
        let near = [0, 1].map(|k| ROUNDING * domain[0][k].abs().max(domain[1][k].abs()));
        // Arcs may be beyond these sides, by any length.
        let side = |end: usize, k: usize| if inner[k][end] { rectangle[end][k] } else { [f64::NEG_INFINITY, f64::INFINITY][end] };
        let mut pieces = Vec::new();
        let mut stack: Vec<Arc> = self.region.arcs_near(rectangle).collect();
        while let Some(mut arc) = stack.pop() {
            let [low, high] = arc.bounds();
            // What only touches a side from without belongs to the neighbour.
            if (0..2).any(|k| (low[k] >= side(1, k) && high[k] > side(1, k)) || (high[k] <= side(0, k) && low[k] < side(0, k))) {
                continue;
            }
            let beyond = [0, 1].map(|k| (side(0, k) - low[k]).max(high[k] - side(1, k)).max(0.0));
            if (0..2).all(|k| beyond[k] <= near[k]) {
                (0..2).for_each(|k| moved[k] = moved[k].max(beyond[k]));
                arc.map(|p: Parameter| std::array::from_fn(|k| p[k].clamp(rectangle[0][k], rectangle[1][k])));
                pieces.push(arc);
            } else {
                stack.extend(arc.halves());
            }
        }
        pieces
    }

    /// The image of an arc in the rectangle of a pair of spans; `None` if its degree is too high.
    fn image(&self, spans: [usize; 2], arc: &Arc) -> Option<Vec<ControlPoint>> {
        let points = arc.homogeneous();
        let degree = points.len() - 1;
        let order = degree * (self.orders[0] + self.orders[1] - 2);
        if order > MOST_DEGREE {
            return None;
        }
        let [low, high] = self.span_box(spans);
        let own = binomials(degree);
        // A' and A of a direction, their coefficients times binomials: products are convolutions.
        let sides = |k: usize| -> [Vec<f64>; 2] {
            let along = |p: &[f64; 3]| ((p[k] - low[k] * p[2]) / (high[k] - low[k])).clamp(0.0, p[2]);
            let scaled = |value: &dyn Fn(&[f64; 3]) -> f64| points.iter().zip(&own).map(|(p, c)| c * value(p)).collect();
            [scaled(&|p| p[2] - along(p)), scaled(&along)]
        };
        let [across, along] = [sides(0), sides(1)];
        let rows = self.cell(spans).points.chunks(self.orders[1]);
        let columns = rows.map(|row| reduced(row.iter().map(|&point| vec![point]).collect(), &along)).collect();
        let mut image = reduced(columns, &across);
        image.iter_mut().zip(binomials(order)).for_each(|(point, c)| *point = point.map(|x| x / c));
        Some(image)
    }
}

/// De Casteljau's algorithm for polynomials.
fn reduced(mut row: Vec<Vec<ControlPoint>>, [left, right]: &[Vec<f64>; 2]) -> Vec<ControlPoint> {
    while row.len() > 1 {
        row = row
            .windows(2)
            .map(|pair| {
                let mut sum = vec![[0.0; 4]; pair[0].len() + left.len() - 1];
                for (points, factor) in pair.iter().zip([left, right]) {
                    for (i, point) in points.iter().enumerate() {
                        for (j, share) in factor.iter().enumerate() {
                            (0..4).for_each(|k| sum[i + j][k] += share * point[k]);
                        }
                    }
                }
                sum
            })
            .collect();
    }
    row.swap_remove(0)
}

/// The binomial coefficients of a degree.
fn binomials(degree: usize) -> Vec<f64> {
    let next = |value: &mut f64, k: usize| {
        let own = *value;
        *value *= (degree - k) as f64 / (k + 1) as f64;
        Some(own)
    };
    (0..=degree).scan(1.0, next).collect()
}
