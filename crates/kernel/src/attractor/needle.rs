//! Needles: a long thin connected cell, and the segment that stands for it.
//!
//! Let C be a cell, u a unit vector, and the *axis* a line along u with every point of C within w of it. Heights are
//! offsets along u. Let C have points at the heights a and b, and lie between the heights a' <= a and b' >= b. If C is
//! connected, the plane across the axis at any height of [a, b] meets C, so the axis at that height is within w of C. Let
//! S be the axis between heights s and t, with s in [a', a] and t in [b, b']. Points of S beyond b are within
//! sqrt(w^2 + (t - b)^2) of C's point at height b; a point of C is within sqrt(w^2 + (b' - t)^2) of S; likewise at the
//! other end. So S and C are within sqrt(w^2 + o^2) of each other, o being the largest of t - b, b' - t, a - s, s - a'. A
//! gap g of C (see `connected`) adds g: a height that no point of C has is within g of one that a point has.
//!
//! The second singular extent of the cell takes the place of the first, so cells of self-affine surfaces are
//! counted across, not along.
//!
//! Here the axis is the image of a diameter of the state's ellipsoid, and S is a part of that image, hence within
//! everything that bounds the cell and the cells above it. Known points of C and the halo around their hull come from the
//! state's [`super::PointCover`]; where the halo is too wide for o, the ends are sought among descendants.

use super::cell::{Cell, ControlPoint, Point, dot, frame_columns, matrix_norm, times};
use super::{Attractor, Halo, StateBound};
use crate::automaton::{StateId, SubdivisionOperator};

/// What stands for a needle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Needle {
    /// The ends of the segment in mm.
    pub(super) ends: [Point; 2],
    /// A bound of its Hausdorff distance from the cell in mm.
    pub(super) error: f64,
}

/// Cells opened at most in search of one end.
const MOST_OPENED: u32 = 24;

#[inline]
fn across(vector: &Point, along: &Point) -> Point {
    let height = dot(vector, along);
    std::array::from_fn(|i| vector[i] - height * along[i])
}

#[inline]
fn length(vector: &Point) -> f64 {
    dot(vector, vector).sqrt()
}

/// A unit vector close to the one that the matrix stretches most: the largest column of (M^T M)^32.
fn longest_input(columns: &[Point; 3]) -> Point {
    let mut power: [Point; 3] = std::array::from_fn(|i| std::array::from_fn(|j| dot(&columns[i], &columns[j])));
    for _ in 0..6 {
        let trace = power[0][0] + power[1][1] + power[2][2];
        if trace <= 0.0 {
            return [1.0, 0.0, 0.0];
        }
        let scaled = power.map(|column| column.map(|x| x / trace));
        power = std::array::from_fn(|i| std::array::from_fn(|j| dot(&scaled[i], &scaled[j])));
    }
    let largest = (0..3).max_by(|&a, &b| power[a][a].total_cmp(&power[b][b])).unwrap_or(0);
    let size = length(&power[largest]);
    power[largest].map(|x| x / size)
}

impl Attractor {
    /// The needle of a cell whose state is proven connected. Any axis is valid; the choice decides the error alone.
    pub(super) fn needle(&self, cell: &Cell, points: &[ControlPoint]) -> Option<Needle> {
        let gap = self.connected[cell.state.index()]?;
        let StateBound::Frame { centre, reach, similar: false, .. } = self.bound(cell.state) else { return None };
        let cover = self.cover(cell.state)?;
        let columns = frame_columns(points);
        let image = [times(&columns, &reach[0]), times(&columns, &reach[1]), times(&columns, &reach[2])];
        let axis = times(&image, &longest_input(&image));
        let half = length(&axis);
        if half <= 0.0 || !half.is_finite() {
            return None;
        }
        let along = axis.map(|x| x / half);
        let halo = cover.halo.image(&columns);
        let (mut width, mut low, mut high) = (0.0_f64, f64::INFINITY, f64::NEG_INFINITY);
        for point in &cover.points {
            let offset = times(&columns, &[point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]]);
            let height = dot(&offset, &along);
            (low, high) = (low.min(height), high.max(height));
            let beside = across(&offset, &along);
            width = width.max(dot(&beside, &beside));
        }
        let width = width.sqrt() + Halo { columns: halo.columns.map(|column| across(&column, &along)), round: halo.round }.radius();
        let beyond = halo.along(&along);
        let (mut ends, mut reached) = ([low - beyond, high + beyond], [low, high]);
        if beyond > width {
            // Heights as functions of the frame's coordinates.
            let slope: Point = std::array::from_fn(|j| dot(&columns[j], &along));
            let start = -dot(&slope, centre);
            for (side, sign) in [(0, -1.0), (1, 1.0)] {
                let goal = Height { slope: slope.map(|x| sign * x), start: sign * start };
                let (least, most) = self.support(cell.state, goal, width);
                (reached[side], ends[side]) = (sign * least, sign * most);
            }
        }
        let segment: [f64; 2] = std::array::from_fn(|side| (0.5 * (ends[side] + reached[side])).clamp(-half, half));
        let over = (0..2).map(|side| (ends[side] - segment[side]).abs().max((segment[side] - reached[side]).abs())).fold(0.0, f64::max);
        let error = width.hypot(over) + gap * matrix_norm(&image);
        let middle = times(&columns, centre);
        let place = |height: f64| std::array::from_fn(|i| points[0][i] + middle[i] + height * along[i]);
        Some(Needle { ends: [place(segment[0]), place(segment[1])], error })
    }

    /// Bounds of the largest height of a state's attractor, no farther apart than `enough` unless that takes too
    /// many cells; the lower one is the height of one of its points.
    fn support(&self, state: StateId, goal: Height, enough: f64) -> (f64, f64) {
        let mut search = Search { reached: f64::NEG_INFINITY, bound: f64::NEG_INFINITY, opened: 0, enough };
        let Some((highest, bound)) = self.highest(state, &goal) else { return (search.reached, f64::INFINITY) };
        search.reached = highest;
        self.climb(state, &goal, bound, &mut search);
        (search.reached, search.bound.max(search.reached))
    }

    /// The largest height of a known point, and a bound of all heights.
    fn highest(&self, state: StateId, goal: &Height) -> Option<(f64, f64)> {
        let cover = self.cover(state)?;
        let highest = cover.points.iter().map(|point| dot(point, &goal.slope)).fold(f64::NEG_INFINITY, f64::max) + goal.start;
        Some((highest, highest + cover.halo.along(&goal.slope)))
    }

    fn climb(&self, state: StateId, goal: &Height, bound: f64, search: &mut Search) {
        if bound <= search.bound.max(search.reached + search.enough) || search.opened >= MOST_OPENED {
            search.bound = search.bound.max(bound);
            return;
        }
        search.opened += 1;
        let transitions = &self.automaton().state(state).transitions;
        let mut bounds = [f64::INFINITY; MOST_SORTED];
        let mut order: [usize; MOST_SORTED] = std::array::from_fn(|index| index);
        for (index, transition) in transitions.iter().enumerate().take(MOST_SORTED) {
            if let Some((highest, bound)) = self.highest(transition.to, &goal.before(&transition.operator)) {
                search.reached = search.reached.max(highest);
                bounds[index] = bound;
            }
        }
        // The most promising children first: the others are then seldom opened.
        let sorted = transitions.len().min(MOST_SORTED);
        order[..sorted].sort_unstable_by(|&a, &b| bounds[b].total_cmp(&bounds[a]));
        for &index in &order[..sorted] {
            self.climb(transitions[index].to, &goal.before(&transitions[index].operator), bounds[index], search);
        }
        for transition in transitions.iter().skip(MOST_SORTED) {
            let goal = goal.before(&transition.operator);
            let bound = self.highest(transition.to, &goal).map_or(f64::INFINITY, |(_, bound)| bound);
            self.climb(transition.to, &goal, bound, search);
        }
    }
}

/// Children of a cell that are opened in the order of their bounds.
const MOST_SORTED: usize = 16;

/// The affine function start + slope . x of a frame's coordinates x.
struct Height {
    slope: Point,
    start: f64,
}

impl Height {
    /// The function of a child's coordinates.
    fn before(&self, operator: &SubdivisionOperator) -> Self {
        let at = |column: usize| -> Point { std::array::from_fn(|i| operator.entry(i + 1, column)) };
        let origin = dot(&at(0), &self.slope);
        Self { slope: std::array::from_fn(|j| dot(&at(j + 1), &self.slope) - origin), start: self.start + origin }
    }
}

struct Search {
    /// Largest height of a point so far.
    reached: f64,
    /// Largest bound of a cell that was not opened.
    bound: f64,
    opened: u32,
    enough: f64,
}
