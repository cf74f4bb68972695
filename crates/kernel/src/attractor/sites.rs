//! What stands for cells in a dilation: for every state the kind of site that allows the largest cells.

use super::cell::{Cell, ControlPoint, Point, Site, frame_columns, matrix_norm, times};
use super::{Attractor, PointCover};
use crate::automaton::{LeafPrimitive, StateId};

/// Errors of replacing a cell of A by its sites S, in mm: d(x, A) <= d(x, S) + outer, and
/// d(x, S)^2 <= (d(x, A) + inner)^2 + inner_square.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SiteError {
    /// See above, mm^2: the squared radius of a cover.
    pub(crate) inner_square: f64,
    /// See above: how far the cell may be from the sites or their hull.
    pub(crate) inner: f64,
    /// See above: how far sites may be from the cell.
    pub(crate) outer: f64,
}

impl SiteError {
    /// The larger of each.
    pub(crate) fn max(self, other: Self) -> Self {
        Self {
            inner_square: self.inner_square.max(other.inner_square),
            inner: self.inner.max(other.inner),
            outer: self.outer.max(other.outer),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Choice {
    /// The centre of the ball.
    Centre,
    /// What the model draws.
    Drawn,
    /// The points of the state's cover.
    Cover,
}

/// How large cells may be, and what stands for them.
#[derive(Clone, Debug)]
pub(crate) struct SiteRule<'a> {
    attractor: &'a Attractor,
    radius: f64,
    /// Allowed errors, inner and outer.
    inner: f64,
    outer: f64,
    choices: Vec<Choice>,
}

/// Shares of a dilation's tolerance that sites may use, inner and outer: the outer share is taken from the
/// lattice, whose error is outer and of first order, so it is spent only on sites that need it.
const INNER_SHARE: f64 = 0.4;
const OUTER_SHARE: f64 = 0.15;

impl<'a> SiteRule<'a> {
    /// The rule for a dilation by `radius` to `tolerance`, both in mm.
    pub(crate) fn new(attractor: &'a Attractor, radius: f64, tolerance: f64) -> Self {
        let (inner, outer) = (INNER_SHARE * tolerance, OUTER_SHARE * tolerance);
        let choices =
            (0..attractor.automaton().states().len()).map(|index| choose(attractor, StateId::new(index), radius, inner, outer)).collect();
        Self { attractor, radius, inner, outer, choices }
    }

    /// The share of the tolerance that must be kept from the lattice's outer error.
    pub(crate) fn outer_reserve(&self) -> f64 {
        let exact = |(index, choice): (usize, &Choice)| {
            *choice == Choice::Cover || self.attractor.automaton().states()[index].leaf == LeafPrimitive::Simplex
        };
        if self.choices.iter().enumerate().all(exact) { 0.0 } else { self.outer }
    }

    /// The share that must be kept from the lattice's inner error.
    pub(crate) fn inner_reserve(&self) -> f64 {
        if self.attractor.automaton().states().iter().all(|state| state.leaf == LeafPrimitive::Simplex) { 0.0 } else { self.inner }
    }

    /// The errors of a cell if it is small enough to be replaced.
    #[inline]
    pub(crate) fn leaf(&self, cell: &Cell, points: &[ControlPoint]) -> Option<SiteError> {
        let error = match self.choices[cell.state.index()] {
            Choice::Centre => both(cell.ball.radius),
            Choice::Drawn => both(self.attractor.leaf_error(cell, points)),
            Choice::Cover => {
                let cover = self.attractor.cover(cell.state)?;
                let norm = matrix_norm(&frame_columns(points));
                let (radius, excess) = (norm * cover.radius, norm * cover.excess);
                SiteError { inner_square: radius * radius, inner: excess, outer: 0.0 }
            }
        };
        let rest = self.radius * self.radius - error.inner_square;
        let inner = if rest > 0.0 { self.radius - rest.sqrt() + error.inner } else { f64::INFINITY };
        (inner <= self.inner && error.outer <= self.outer).then_some(error)
    }

    /// Emits the sites of a leaf.
    #[inline]
    pub(crate) fn emit(&self, cell: &Cell, points: &[ControlPoint], sink: &mut impl FnMut(Site)) {
        match self.choices[cell.state.index()] {
            Choice::Centre => sink(Site::Point(cell.ball.centre)),
            Choice::Drawn => self.attractor.emit(cell, points, sink),
            Choice::Cover => {
                let Some(cover) = self.attractor.cover(cell.state) else { return };
                let columns = frame_columns(points);
                for point in &cover.points {
                    let offset = times(&columns, point);
                    sink(Site::Point([points[0][0] + offset[0], points[0][1] + offset[1], points[0][2] + offset[2]]));
                }
            }
        }
    }

    /// The attractor.
    pub(crate) fn attractor(&self) -> &'a Attractor {
        self.attractor
    }

    /// Distance of x from the sites of a leaf, squared, with the closest point.
    pub(crate) fn nearest(&self, x: &Point, cell: &Cell, points: &[ControlPoint]) -> f64 {
        let mut nearest = f64::INFINITY;
        self.emit(cell, points, &mut |site| nearest = nearest.min(site.distance_squared(x)));
        nearest
    }
}

fn both(error: f64) -> SiteError {
    SiteError { inner_square: 0.0, inner: error, outer: error }
}

/// The kind of site with the least expected work: cells of a surface cost the inverse square of their size,
/// times the sites of each.
fn choose(attractor: &Attractor, state: StateId, radius: f64, inner: f64, outer: f64) -> Choice {
    let leaf = &attractor.automaton().state(state).leaf;
    if matches!(leaf, LeafPrimitive::Chord(_) | LeafPrimitive::Simplex) {
        return Choice::Drawn;
    }
    let work = |stretch: f64, sites: usize| sites as f64 / (stretch * stretch);
    let mut best = (work(outer / attractor.ball_radius(state), 1), Choice::Centre);
    if let LeafPrimitive::Drawn(drawing) = leaf {
        // Points are cheaper than segments, and those than triangles.
        let sites = drawing.points.len() + 2 * drawing.segments.len() + 4 * drawing.triangles.len();
        let drawn = work(outer / drawing.defect, sites);
        if drawn < best.0 {
            best = (drawn, Choice::Drawn);
        }
    }
    if let Some(cover) = attractor.cover(state)
        && work(largest_stretch(cover, radius, inner), cover.points.len()) < best.0
    {
        return Choice::Cover;
    }
    best.1
}

/// The largest stretch n of a frame that a cover may have: r - sqrt(r^2 - n^2 R^2) + n excess <= inner.
fn largest_stretch(cover: &PointCover, radius: f64, inner: f64) -> f64 {
    let error = |n: f64| radius - (radius * radius - (n * cover.radius).powi(2)).max(0.0).sqrt() + n * cover.excess;
    let (mut low, mut high) = (0.0, radius / cover.radius.max(f64::MIN_POSITIVE));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if error(middle) <= inner { low = middle } else { high = middle }
    }
    low
}
