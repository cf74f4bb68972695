//! The box of an attractor, to any precision, by best-first expansion of cells per direction: the support
//! function of a graph-directed set is the maximum of its children's.

use crate::attractor::cell::{Cell, ControlPoint, Point, Site, child_points, dot};
use crate::attractor::trim::{TrimmedSurface, Window};
use crate::attractor::{Attractor, OwnRadius, StateBound};
use crate::automaton::{Automaton, LeafPrimitive, StateId, SubdivisionOperator};
use crate::budget::{Budget, Stopped};
use crate::measure::Interval;
use crate::order::ordered_by;
use glam::DVec3;
use std::collections::BinaryHeap;
use std::sync::Arc;

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

    /// The box whose intervals are wider by `length` at both ends.
    #[must_use]
    pub(crate) fn widened(&self, length: f64) -> Self {
        let wider = |interval: Interval| Interval::new(interval.low - length, interval.high + length);
        Self { low: self.low.map(wider), high: self.high.map(wider) }
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

fn length(direction: &Point) -> f64 {
    dot(direction, direction).sqrt()
}

struct Branch {
    bound: f64,
    cell: Cell,
    points: Points,
    depth: u32,
    /// Where the cell lies in the parameter plane, if its surface is trimmed.
    window: Option<Box<Window>>,
}

/// Control points of a cell that waits. Most never have their turn, and where a smooth shape is flat tens of thousands wait: each has those of its
/// parent, which all its siblings share, and its own are worked out when it is its turn.
enum Points {
    Own(Vec<ControlPoint>),
    /// Of the parent, with its state and the number of the transition.
    Parents(Arc<[ControlPoint]>, StateId, u32),
}

impl Points {
    /// The control points themselves.
    fn get(self, automaton: &Automaton) -> Vec<ControlPoint> {
        match self {
            Self::Own(points) => points,
            Self::Parents(points, state, number) => child(&points, &automaton.state(state).transitions[number as usize].operator),
        }
    }
}

fn child(points: &[ControlPoint], operator: &SubdivisionOperator) -> Vec<ControlPoint> {
    let mut own = vec![[0.0; 4]; operator.columns()];
    child_points(points, operator, &mut own);
    own
}

// Among equal bounds the smaller cell first: it ends the search sooner.
ordered_by!(Branch, |this, other| this.bound.total_cmp(&other.bound).then(other.cell.ball.radius.total_cmp(&this.cell.ball.radius)));

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
    Ok(searched_box(attractor, budget)?.0)
}

/// Bytes that [`bounding_box`] holds at most: shapes that are nearly flat where they reach farthest keep many cells. Cost: that of the box.
///
/// # Errors
/// As [`bounding_box`].
pub fn bounding_box_memory(attractor: &Attractor, budget: &Budget) -> Result<u64, Stopped> {
    Ok(searched_box(attractor, budget)?.1)
}

/// The box, and the most bytes that a search held.
pub(crate) fn searched_box(attractor: &Attractor, budget: &Budget) -> Result<(AxisBox, u64), Stopped> {
    let (mut ends, mut most) = ([Interval { low: 0.0, high: 0.0 }; 6], 0);
    for (index, end) in ends.iter_mut().enumerate() {
        let (axis, sign) = (index / 2, if index % 2 == 0 { -1.0 } else { 1.0 });
        let direction = std::array::from_fn(|other| if other == axis { sign } else { 0.0 });
        let (support, bytes) = support(attractor, &direction, budget)?;
        *end = Interval::new(sign * support.low, sign * support.high);
        most = most.max(bytes);
    }
    Ok((AxisBox { low: [ends[0], ends[2], ends[4]], high: [ends[1], ends[3], ends[5]] }, most))
}

/// The box of the union of all roots' cells, each dilated by the ball of its own constant radius.
///
/// # Errors
/// [`Stopped`] when the budget's token was fired.
pub(crate) fn dilated_box(attractor: &Attractor, budget: &Budget) -> Result<AxisBox, Stopped> {
    let mut ends = [Interval { low: f64::NEG_INFINITY, high: f64::NEG_INFINITY }; 6];
    for (index, root) in attractor.roots().iter().enumerate() {
        let radius = match attractor.own_radius(index) {
            Some(OwnRadius::Constant(radius)) => *radius,
            _ => 0.0,
        };
        for (end, best) in ends.iter_mut().enumerate() {
            let direction = std::array::from_fn(|axis| {
                if axis != end / 2 {
                    0.0
                } else if end % 2 == 0 {
                    -1.0
                } else {
                    1.0
                }
            });
            let cell = attractor.root_cell(index);
            // What cannot be the farthest is not looked at.
            if dot(&direction, &cell.ball.centre) + cell.ball.radius + radius <= best.low {
                continue;
            }
            let found = support_of_cell(attractor, cell, root.points.clone(), &direction, budget)?;
            *best = Interval { low: best.low.max(found.low + radius), high: best.high.max(found.high + radius) };
        }
    }
    let lower = |end: Interval| Interval { low: -end.high, high: -end.low };
    Ok(AxisBox { low: [0, 2, 4].map(|end| lower(ends[end])), high: [1, 3, 5].map(|end| ends[end]) })
}

/// [least, largest] of x . direction over the attractor, each an interval that contains it, in mm for a direction of length 1.
///
/// # Errors
/// [`Stopped`] when the budget's token was fired.
pub fn extent_along(attractor: &Attractor, direction: DVec3, budget: &Budget) -> Result<[Interval; 2], Stopped> {
    let least = support(attractor, &(-direction).to_array(), budget)?.0;
    let largest = support(attractor, &direction.to_array(), budget)?.0;
    Ok([Interval::new(-least.high, -least.low), largest])
}

/// sup of x . direction over the attractor.
fn support(attractor: &Attractor, direction: &Point, budget: &Budget) -> Result<(Interval, u64), Stopped> {
    let mut search = Search::new(attractor, direction);
    let ends = attractor.trimmed().iter().flat_map(TrimmedSurface::loop_points);
    search.reached = ends.map(|point| dot(direction, &point)).fold(f64::NEG_INFINITY, f64::max);
    for (index, root) in attractor.roots().iter().enumerate() {
        if index % 4096 == 0 {
            budget.cancel.check()?;
        }
        let window = attractor.root_window(index);
        if window.as_ref().is_some_and(Window::is_outside) {
            continue;
        }
        search.start(attractor.root_cell(index), root.points.clone(), window);
    }
    search.run(budget)
}

/// sup of x . direction over a cell that is not cut along loops.
pub(super) fn support_of_cell(
    attractor: &Attractor,
    cell: Cell,
    points: Vec<ControlPoint>,
    direction: &Point,
    budget: &Budget,
) -> Result<Interval, Stopped> {
    let mut search = Search::new(attractor, direction);
    search.start(cell, points, None);
    Ok(search.run(budget)?.0)
}

/// Best first through the cells that may attain the supremum.
struct Search<'a> {
    attractor: &'a Attractor,
    direction: &'a Point,
    heap: BinaryHeap<Branch>,
    /// Some point of the shape attains this.
    reached: f64,
    low: f64,
    high: f64,
    /// What rounding is relative to: products that a sum may cancel.
    largest_term: f64,
}

impl<'a> Search<'a> {
    fn new(attractor: &'a Attractor, direction: &'a Point) -> Self {
        Self {
            attractor,
            direction,
            heap: BinaryHeap::new(),
            reached: f64::NEG_INFINITY,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            largest_term: 0.0,
        }
    }

    fn start(&mut self, cell: Cell, points: Vec<ControlPoint>, window: Option<Window>) {
        let (floor, bound) = cell_support(self.attractor, &cell, &points, self.direction);
        if window.as_ref().is_none_or(Window::is_inside) {
            self.reached = self.reached.max(floor);
        }
        let (centre, radius) = (dot(self.direction, &cell.ball.centre), cell.ball.radius * length(self.direction));
        self.low = self.low.min(centre - radius);
        self.high = self.high.max(centre + radius);
        let terms = (0..3).map(|axis| self.direction[axis].abs() * (cell.ball.centre[axis].abs() + cell.ball.radius));
        self.largest_term = self.largest_term.max(terms.sum());
        // Cells that cannot win are not stored; later ones may still raise `reached`.
        if bound > self.reached {
            self.heap.push(Branch { bound, cell, points: Points::Own(points), depth: 0, window: window.map(Box::new) });
        }
    }

    fn run(self, budget: &Budget) -> Result<(Interval, u64), Stopped> {
        let Self { attractor, direction, mut heap, mut reached, low, high, largest_term } = self;
        let width = RELATIVE_WIDTH * (high - low).max(f64::MIN_POSITIVE);
        let moved = attractor.trimmed().iter().map(TrimmedSurface::moved_mm).fold(0.0, f64::max);
        let rounding = 1e-12 * largest_term + moved;
        let (mut expansions, mut own_bytes) = (0, 0);
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
            let own: Arc<[ControlPoint]> = branch.points.get(attractor.automaton()).into();
            own_bytes += size_of_val(&*own);
            for (index, transition) in state.transitions.iter().enumerate() {
                let window = branch.window.as_ref().and_then(|window| attractor.child_window(branch.cell.root as usize, window, index));
                if window.as_ref().is_some_and(Window::is_outside) {
                    continue;
                }
                let points = child(&own, &transition.operator);
                let child = attractor.child_cell(&branch.cell, index, &points);
                let (floor, ceiling) = cell_support(attractor, &child, &points, direction);
                match &window {
                    Some(window) if !window.is_inside() => {
                        reached = attractor.window_points(&child, window).map(|point| dot(direction, &point)).fold(reached, f64::max);
                    }
                    _ => reached = reached.max(floor),
                }
                if ceiling > reached {
                    let points = Points::Parents(Arc::clone(&own), branch.cell.state, index as u32);
                    let (bound, window) = (ceiling.min(branch.bound), window.map(Box::new));
                    heap.push(Branch { bound, cell: child, points, depth: branch.depth + 1, window });
                }
            }
            bound = reached;
        }
        let held = heap.capacity() * size_of::<Branch>() + own_bytes;
        Ok((Interval { low: reached - rounding, high: bound.max(reached) + rounding }, held as u64))
    }
}

/// [attained by some point of the cell, bound of all]: the ball, or the hull of control points when it
/// holds and is lower; simplices are exact, chords attain their ends.
fn cell_support(attractor: &Attractor, cell: &Cell, points: &[ControlPoint], direction: &Point) -> (f64, f64) {
    let (centre, radius) = (dot(direction, &cell.ball.centre), cell.ball.radius * length(direction));
    let along = |point: &ControlPoint| dot(direction, &[point[0], point[1], point[2]]);
    let (mut floor, mut ceiling) = (centre - radius, centre + radius);
    let state = attractor.state_of(cell);
    let mut attain = |site: Site| {
        let corners: &[[f64; 3]] = match &site {
            Site::Point(x) => std::slice::from_ref(x),
            Site::Segment(ends) => ends,
            Site::Triangle(corners) => corners,
        };
        floor = corners.iter().map(|x| dot(direction, x)).fold(floor, f64::max);
    };
    if matches!(state.leaf, LeafPrimitive::Simplex | LeafPrimitive::Chord(_)) {
        attractor.emit(cell, points, &mut attain);
    }
    match attractor.bound(cell.state) {
        StateBound::Hull { margin, .. } if *margin == 0.0 => {
            let rational = attractor.roots()[cell.root as usize].rational;
            let project = |point: &ControlPoint| if rational { along(point) / point[3] } else { along(point) };
            ceiling = ceiling.min(points.iter().map(project).fold(f64::NEG_INFINITY, f64::max));
        }
        StateBound::Hull { margin, .. } => {
            // The proof of the margin holds in every coordinate: x lies within margin times their spread of the control
            // points' interval. Flat shapes are exact at once here too.
            if !attractor.roots()[cell.root as usize].rational {
                let (least, most) =
                    points.iter().map(along).fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), x| (least.min(x), most.max(x)));
                floor = floor.max(least - margin * (most - least));
                ceiling = ceiling.min(most + margin * (most - least));
            }
        }
        StateBound::Frame { low, high, .. } => {
            let (mut least, mut most) = (along(&points[0]), along(&points[0]));
            for j in 0..3 {
                let edge: Point = std::array::from_fn(|axis| points[j + 1][axis] - points[0][axis]);
                let entry = dot(direction, &edge);
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
