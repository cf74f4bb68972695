//! The box of an attractor, to any precision, by best-first expansion of cells per direction: the support
//! function of a graph-directed set is the maximum of its children's.

use crate::attractor::cell::{Cell, ControlPoint, Site, child_points};
use crate::attractor::trim::{TrimmedSurface, Window};
use crate::attractor::{Attractor, StateBound};
use crate::automaton::LeafPrimitive;
use crate::budget::{Budget, Stopped};
use crate::measure::Interval;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// The box of a shape: lower and upper ends per axis, each an interval that contains the exact one, in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisBox {
    /// Lower corner.
    pub low: [Interval; 3],
    /// Upper corner.
    pub high: [Interval; 3],
}

impl AxisBox {
    /// The box grown by `length` on all sides: the exact box of the dilation by a ball of that radius.
    #[must_use]
    pub fn grown(&self, length: f64) -> Self {
        let moved = |interval: Interval, by: f64| Interval::new(interval.low + by, interval.high + by);
        Self { low: self.low.map(|x| moved(x, -length)), high: self.high.map(|x| moved(x, length)) }
    }

    /// Largest absolute coordinate.
    #[must_use]
    pub fn extent(&self) -> f64 {
        (0..3).map(|axis| self.low[axis].low.abs().max(self.high[axis].high.abs())).fold(0.0, f64::max)
    }

    /// Largest movement of a point of the box when its coordinates are rounded to single precision: half a
    /// unit in the last place, times sqrt(3).
    #[must_use]
    pub fn single_precision(&self) -> f64 {
        self.extent() * f64::from(f32::EPSILON) * 0.5 * 3.0_f64.sqrt()
    }

    /// Length of the outer box's diagonal.
    #[must_use]
    pub fn diagonal(&self) -> f64 {
        (0..3).map(|axis| (self.high[axis].high - self.low[axis].low).powi(2)).sum::<f64>().sqrt()
    }
}

struct Branch {
    bound: f64,
    cell: Cell,
    points: Vec<ControlPoint>,
    depth: u32,
    /// Where the cell lies in the parameter plane, if its surface is trimmed.
    window: Option<Window>,
}

impl PartialEq for Branch {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Branch {}
impl PartialOrd for Branch {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Branch {
    fn cmp(&self, other: &Self) -> Ordering {
        // Among equal bounds the smaller cell first: it ends the search sooner.
        self.bound.total_cmp(&other.bound).then(other.cell.ball.radius.total_cmp(&self.cell.ball.radius))
    }
}

/// Expansions allowed per direction: the interval is wider when they do not suffice.
const EXPANSIONS: usize = 20_000;
/// Wanted width, relative to the shape's size.
const RELATIVE_WIDTH: f64 = 1e-10;

/// The box of the attractor; each of its six numbers is an interval, 1e-10 of the shape's size wide unless
/// the shape's extremes are too many to separate.
///
/// # Errors
/// [`Stopped`] when the budget's token was fired.
pub fn bounding_box(attractor: &Attractor, budget: &Budget) -> Result<AxisBox, Stopped> {
    let mut ends = [Interval { low: 0.0, high: 0.0 }; 6];
    for (index, end) in ends.iter_mut().enumerate() {
        let (axis, sign) = (index / 2, if index % 2 == 0 { -1.0 } else { 1.0 });
        let support = support(attractor, axis, sign, budget)?;
        *end = Interval::new(sign * support.low, sign * support.high);
    }
    Ok(AxisBox { low: [ends[0], ends[2], ends[4]], high: [ends[1], ends[3], ends[5]] })
}

/// sup of `sign * x[axis]` over the attractor.
fn support(attractor: &Attractor, axis: usize, sign: f64, budget: &Budget) -> Result<Interval, Stopped> {
    let mut heap = BinaryHeap::new();
    let ends = attractor.trimmed().iter().flat_map(TrimmedSurface::loop_points);
    let mut reached = ends.map(|point| sign * point[axis]).fold(f64::NEG_INFINITY, f64::max);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for (index, root) in attractor.roots().iter().enumerate() {
        if index % 4096 == 0 {
            budget.cancel.check()?;
        }
        let window = attractor.root_window(index);
        if window.as_ref().is_some_and(Window::is_outside) {
            continue;
        }
        let cell = attractor.root_cell(index);
        let (floor, bound) = cell_support(attractor, &cell, &root.points, axis, sign);
        if window.as_ref().is_none_or(Window::is_inside) {
            reached = reached.max(floor);
        }
        low = low.min(cell.ball.centre[axis] - cell.ball.radius);
        high = high.max(cell.ball.centre[axis] + cell.ball.radius);
        // Cells that cannot win are not stored; later ones may still raise `reached`.
        if bound > reached {
            heap.push(Branch { bound, cell, points: root.points.clone(), depth: 0, window });
        }
    }
    let width = RELATIVE_WIDTH * (high - low).max(f64::MIN_POSITIVE);
    let moved = attractor.trimmed().iter().map(TrimmedSurface::moved_mm).fold(0.0, f64::max);
    let rounding = 1e-12 * low.abs().max(high.abs()) + moved;
    let mut expansions = 0;
    let mut bound = reached;
    while let Some(branch) = heap.pop() {
        bound = branch.bound.max(reached);
        expansions += 1;
        if bound - reached <= width || expansions > EXPANSIONS || branch.depth > 400 {
            break;
        }
        if expansions % 256 == 0 {
            budget.cancel.check()?;
        }
        let state = attractor.state_of(&branch.cell);
        for (index, transition) in state.transitions.iter().enumerate() {
            let window = branch.window.as_ref().and_then(|window| attractor.child_window(branch.cell.root as usize, window, index));
            if window.as_ref().is_some_and(Window::is_outside) {
                continue;
            }
            let mut points = vec![[0.0; 4]; transition.operator.columns()];
            child_points(&branch.points, &transition.operator, &mut points);
            let child = attractor.child_cell(&branch.cell, index, &points);
            let (floor, ceiling) = cell_support(attractor, &child, &points, axis, sign);
            match &window {
                Some(window) if !window.is_inside() => {
                    reached = attractor.window_points(&child, window).map(|point| sign * point[axis]).fold(reached, f64::max);
                }
                _ => reached = reached.max(floor),
            }
            if ceiling > reached {
                heap.push(Branch { bound: ceiling.min(branch.bound), cell: child, points, depth: branch.depth + 1, window });
            }
        }
        bound = reached;
    }
    Ok(Interval { low: reached - rounding, high: bound.max(reached) + rounding })
}

/// [attained by some point of the cell, bound of all]: the ball, or the hull of control points when it
/// holds and is lower; simplices are exact, chords attain their ends.
fn cell_support(attractor: &Attractor, cell: &Cell, points: &[ControlPoint], axis: usize, sign: f64) -> (f64, f64) {
    let centre = sign * cell.ball.centre[axis];
    let (mut floor, mut ceiling) = (centre - cell.ball.radius, centre + cell.ball.radius);
    let state = attractor.state_of(cell);
    let mut attain = |site: Site| {
        let corners: &[[f64; 3]] = match &site {
            Site::Point(x) => std::slice::from_ref(x),
            Site::Segment(ends) => ends,
            Site::Triangle(corners) => corners,
        };
        floor = corners.iter().map(|x| sign * x[axis]).fold(floor, f64::max);
    };
    if matches!(state.leaf, LeafPrimitive::Simplex | LeafPrimitive::Chord(_)) {
        attractor.emit(cell, points, &mut attain);
    }
    match attractor.bound(cell.state) {
        StateBound::Hull { margin, .. } if *margin == 0.0 => {
            let rational = attractor.roots()[cell.root as usize].rational;
            let project = |point: &ControlPoint| sign * if rational { point[axis] / point[3] } else { point[axis] };
            ceiling = ceiling.min(points.iter().map(project).fold(f64::NEG_INFINITY, f64::max));
        }
        StateBound::Hull { margin, .. } => {
            // The proof of the margin holds in every coordinate: x lies within margin times their spread of the control
            // points' interval. Flat shapes are exact at once here too.
            if !attractor.roots()[cell.root as usize].rational {
                let (least, most) = points
                    .iter()
                    .map(|point| sign * point[axis])
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), x| (least.min(x), most.max(x)));
                floor = floor.max(least - margin * (most - least));
                ceiling = ceiling.min(most + margin * (most - least));
            }
        }
        StateBound::Frame { low, high, .. } => {
            let (mut least, mut most) = (sign * points[0][axis], sign * points[0][axis]);
            for j in 0..3 {
                let entry = sign * (points[j + 1][axis] - points[0][axis]);
                least += (entry * low[j]).min(entry * high[j]);
                most += (entry * low[j]).max(entry * high[j]);
            }
            // Every point of the cell is at least at `least`: flat shapes are exact at once.
            floor = floor.max(least);
            ceiling = ceiling.min(most);
        }
    }
    (floor, ceiling.max(floor))
}
