//! The support function of an attractor, h(u) = sup x . u, as an interval.
//!
//! Of a cell with control points P only the functional c = u^T P on its state's barycentric space is kept: h is the supremum of c . x over the state's
//! attractor, and that of a child with operator T is the supremum of c^T T over its own. A box needs no more of space than these numbers, and cells that
//! are far apart but equally high become equal.
//!
//! *Bounds.* With the state's bound (see `attractor::bound`), applied to numbers instead of points: most + margin (most - least) of the values c_j for
//! hulls, and the coordinate box and the ellipsoid for frames; likewise from below. Where a shape is smooth its functional is flat at its highest point,
//! so that both bounds close in with the square of the cell's size.
//!
//! *Rounds.* All cells that may still attain the supremum are kept. Each round splits those that may exceed what is reached by at least half as much as
//! any may: cells that turn out equally high are split together, and those that are just high enough wait for what is reached to rise above them.
//!
//! *Dominance.* Let two cells of one state have functionals c and d, and let d - c >= -e on the state's attractor, by the bounds above. Then h(c) <=
//! h(d) + e, so the first may go if the second takes over its slack: every kept cell i carries s_i, and always h <= max(reached, max_i (h(c_i) + s_i)).
//! A cell only goes for another that stays, so no argument is circular. Extremes along a line, a face or a Cantor set then cost as much as one point; so
//! do smooth ones under schemes with negative weights, whose bounds shrink with the first power of the size only.
//!
//! *Hulls.* Where a state has points in whose hull its attractor lies (`attractor::hull`), functionals are kept by their values at these, and pulled back
//! to those of children. Splines are searched as Bezier patches: their corners are attained, and sides that are level stay so.
//!
//! *Boxes.* In longer searches, functionals of states with negative entries are seen by boxes of their coordinates too (`attractor::enclosure`), whose bounds
//! are several times closer than those by margins.
//!
//! *Loops.* Let f = x . u be a function of the parameters of a trimmed surface, and x where it is largest in the closed region that is kept. If x is on a
//! loop, one of the curves that the loops are in space attains f(x): these are searched too, each as a Bezier curve. Otherwise x is in the region's inside.
//! If f rises towards a side on a whole cell, x is on that side, as f would rise on within the surface's span; and not even there unless the side is on
//! the span's border: otherwise, f being smooth, it rises beyond. At the border of the domain x would be on a loop. So cells that loops cross are let go
//! when f rises towards any side that is not on another span's border. Near a loop all are, but for those where f is level; there bounds are good.

use super::functional::Functional;
use crate::attractor::cell::{Cell, ControlPoint, Point, dot};
use crate::attractor::trim::{Rim, TrimmedSurface, Window};
use crate::attractor::{Attractor, Enclosure, OwnRadius, StateBound};
use crate::automaton::{LeafPrimitive, PullBack, StateId};
use crate::budget::{Budget, Stopped};
use crate::measure::Interval;

/// Cells that are split at most, per direction: the interval is wider when they do not suffice.
const SPLITS: usize = 20_000;
/// Rounds at most.
const ROUNDS: usize = 1000;
/// Splits after which points of the attractor are worked out, so that what is reached rises sooner: most searches are done before.
const LONG: usize = 64;
/// Splits after which signed cells are bounded by boxes of their coordinates: level and planar shapes need none.
const SIGNED: usize = 12;
/// Wanted width, relative to the shape's size.
const RELATIVE_WIDTH: f64 = 1e-11;
/// Slack that one cell may add to another's, and most slack of a cell, as shares of the wanted width.
const SLACK_ADDED: f64 = 1e-3;
const SLACK: f64 = 0.25;
/// Rounding of a support, relative to the largest terms of its sums.
const ROUNDING: f64 = 1e-12;
/// Kept cells of the same state that a cell is compared with at most: half of them the highest ones, half those next to it in height, which equal ones are.
const COMPARISONS: usize = 32;

/// A box that contains a shape, in mm: how large and how far away it is.
#[derive(Clone, Copy)]
pub(super) struct Extent {
    low: Point,
    high: Point,
}

impl Extent {
    const NONE: Self = Self { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3] };

    fn with(self, cell: &Cell) -> Self {
        let ball = &cell.ball;
        Self {
            low: std::array::from_fn(|axis| self.low[axis].min(ball.centre[axis] - ball.radius)),
            high: std::array::from_fn(|axis| self.high[axis].max(ball.centre[axis] + ball.radius)),
        }
    }

    pub(super) fn of_cell(cell: &Cell) -> Self {
        Self::NONE.with(cell)
    }

    /// That of an attractor.
    pub(super) fn of(attractor: &Attractor) -> Self {
        (0..attractor.roots().len()).fold(Self::NONE, |extent, root| extent.with(&attractor.root_cell(root)))
    }

    /// Its size along a direction.
    fn along(&self, direction: &Point) -> f64 {
        (0..3).map(|axis| direction[axis].abs() * (self.high[axis] - self.low[axis]).max(0.0)).sum()
    }

    /// What rounding is relative to: products that a sum may cancel.
    fn largest_term(&self, direction: &Point) -> f64 {
        (0..3).map(|axis| direction[axis].abs() * self.low[axis].abs().max(self.high[axis].abs())).filter(|term| term.is_finite()).sum()
    }
}

/// The bound of functionals that are kept by their values at points in whose hull an attractor lies.
static IN_HULL: StateBound = StateBound::Hull { centre: Vec::new(), margin: 0.0 };

/// A cell, or a curve of a loop, that may attain the supremum.
struct Candidate {
    root: u32,
    /// Absent for curves.
    state: Option<StateId>,
    functional: Functional,
    /// Its values at the columns of the state's enclosure, once that is used.
    seen: Vec<f64>,
    /// Bounds its supremum, without regard to loops that cut the cell.
    bound: f64,
    /// s of the module's comment.
    slack: f64,
    /// Where it lies in the parameter plane, if its surface is trimmed.
    window: Option<Box<Window>>,
}

impl Candidate {
    fn ceiling(&self) -> f64 {
        self.bound + self.slack
    }

    fn is_cut(&self) -> bool {
        self.window.as_ref().is_some_and(|window| !window.is_inside())
    }
}

/// The ratio of the largest and the least of positive weights.
fn spread(weights: &[f64]) -> f64 {
    let ends = weights.iter().fold([f64::INFINITY, 0.0_f64], |[least, most], &weight| [least.min(weight), most.max(weight)]);
    ends[1] / ends[0]
}

/// The search for the supremum of x . direction.
pub(super) struct Search<'a> {
    attractor: &'a Attractor,
    rim: &'a Rim,
    direction: Point,
    /// Wanted width of the interval.
    width: f64,
    rounding: f64,
    /// The largest terms of sums, and the share of them by which the hulls that were met miss the attractors at most.
    largest: f64,
    missed: f64,
    /// Some point of the shape attains this, or more.
    reached: f64,
    /// What was left alone, because its supremum is higher by less than the width, has none above this.
    left: f64,
    candidates: Vec<Candidate>,
    splits: usize,
}

impl<'a> Search<'a> {
    /// The search through cells in that extent, and through the loops of trimmed surfaces.
    pub(super) fn new(attractor: &'a Attractor, extent: &Extent, rim: &'a Rim, direction: &Point) -> Self {
        let moved = attractor.trimmed().iter().map(TrimmedSurface::moved_mm).fold(0.0, f64::max);
        let largest = extent.largest_term(direction);
        Self {
            attractor,
            rim,
            direction: *direction,
            // Functionals are not known better than to their rounding.
            width: RELATIVE_WIDTH * extent.along(direction) + 0.1 * ROUNDING * largest,
            largest,
            missed: 0.0,
            rounding: ROUNDING * largest + moved + rim.moved_mm,
            reached: f64::NEG_INFINITY,
            left: f64::NEG_INFINITY,
            candidates: Vec::new(),
            splits: 0,
        }
    }

    /// Begins with all roots, each dilated by the ball of its own constant radius if `dilated`.
    pub(super) fn with_roots(mut self, dilated: bool, budget: &Budget) -> Result<Self, Stopped> {
        let attractor = self.attractor;
        let offset = |root: usize| match attractor.own_radius(root) {
            Some(OwnRadius::Constant(radius)) if dilated => *radius,
            _ => 0.0,
        };
        for (index, (root, points)) in self.rim.curves.iter().enumerate() {
            if index % 4096 == 0 {
                budget.cancel.check()?;
            }
            let functional = Functional::of(points, true, &self.direction, offset(*root as usize));
            self.consider(Candidate {
                root: *root,
                state: None,
                functional,
                bound: f64::INFINITY,
                slack: 0.0,
                seen: Vec::new(),
                window: None,
            });
        }
        for (index, root) in attractor.roots().iter().enumerate() {
            if index % 4096 == 0 {
                budget.cancel.check()?;
            }
            self.begin(index as u32, root.state, &root.points, offset(index), attractor.root_window(index));
        }
        Ok(self)
    }

    /// Begins with one cell that is not cut along loops.
    pub(super) fn with_cell(mut self, cell: &Cell, points: &[ControlPoint]) -> Self {
        self.begin(cell.root, cell.state, points, 0.0, None);
        self
    }

    fn begin(&mut self, root: u32, state: StateId, points: &[ControlPoint], offset: f64, window: Option<Window>) {
        if window.as_ref().is_some_and(Window::is_outside) {
            return;
        }
        let rational = self.attractor.roots()[root as usize].rational;
        if window.is_none() && self.attractor.automaton().state(state).leaf == LeafPrimitive::Simplex {
            // The hull of its control points, whatever their weights: a large mesh needs no more than this of its triangles.
            let along = |point: &ControlPoint| {
                let along = dot(&self.direction, &[point[0], point[1], point[2]]);
                (if rational { along / point[3] } else { along }) + offset
            };
            self.reached = points.iter().map(along).fold(self.reached, f64::max);
            return;
        }
        let functional = self.at_hull(state, Functional::of(points, rational, &self.direction, offset));
        self.consider(Candidate {
            root,
            state: Some(state),
            functional,
            bound: f64::INFINITY,
            slack: 0.0,
            seen: Vec::new(),
            window: window.map(Box::new),
        });
    }

    /// The functional by its values at the points in whose hull the state's attractor lies.
    fn at_hull(&mut self, state: StateId, functional: Functional) -> Functional {
        let Some(hull) = self.attractor.hull(state) else { return functional };
        // Let y be what a point x of the hull misses by, and v the value at x. Without weights c . y is at most half of |y|_1 times what the values differ by,
        // which is at most twice their largest term; with weights the value moves by (values - v weights) . y / (weights . (x + y)).
        self.missed = self.missed.max(
            hull.miss * functional.weights.as_ref().map_or(1.0, |weights| 2.0 * spread(weights) / (1.0 - hull.miss * spread(weights))),
        );
        match &hull.points {
            Some(points) => functional.pulled_back(points),
            None => functional,
        }
    }

    /// Bounds functionals of a state as they are kept.
    fn bound_of(&self, state: StateId) -> &'a StateBound {
        if self.attractor.hull(state).is_some() { &IN_HULL } else { self.attractor.bound(state) }
    }

    /// What holds the attractor of a state closer than its bound, in searches that are long enough.
    fn enclosure(&self, state: StateId) -> Option<&'a Enclosure> {
        if self.splits < SIGNED || self.attractor.hull(state).is_some() {
            return None;
        }
        self.attractor.enclosure(state)
    }

    /// Keeps a candidate, bounded here and by its parent, if it may be higher than what is reached.
    fn consider(&mut self, mut candidate: Candidate) {
        let enclosure = candidate.state.and_then(|state| self.enclosure(state));
        let [floor, bound] = match enclosure {
            Some(enclosure) => {
                if candidate.seen.is_empty() {
                    candidate.seen = enclosure.columns.pull_back(&candidate.functional.values);
                }
                self.missed = self.missed.max(enclosure.miss);
                enclosure.range(candidate.seen.iter().copied())
            }
            None => candidate.functional.range(candidate.state.map_or(&IN_HULL, |state| self.bound_of(state))),
        };
        candidate.bound = bound.min(candidate.bound);
        if candidate.ceiling() <= self.reached {
            return;
        }
        if !candidate.is_cut() {
            self.reached = self.reached.max(floor).max(self.attained_by(&candidate));
        }
        if candidate.ceiling() > self.reached && !self.is_beside_highest(&candidate) {
            self.candidates.push(candidate);
        }
    }

    /// What points of a candidate attain that are known to be on the shape; it is not cut.
    fn attained_by(&self, candidate: &Candidate) -> f64 {
        let functional = &candidate.functional;
        let Some(state) = candidate.state else {
            return functional.at_shares(&[(0, 1.0)]).max(functional.at_shares(&[(functional.values.len() - 1, 1.0)]));
        };
        let most = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::NEG_INFINITY, f64::max);
        if let Some(hull) = self.attractor.hull(state) {
            return most(&mut hull.attained.iter().map(|shares| functional.at_shares(shares)));
        }
        match &self.attractor.automaton().state(state).leaf {
            // The hull of its control points.
            LeafPrimitive::Simplex => candidate.bound,
            LeafPrimitive::Chord(ends) => functional.at(&ends.start).max(functional.at(&ends.end)),
            LeafPrimitive::Polygon(corners) => most(&mut corners.iter().map(|corner| functional.at(corner))),
            _ if self.splits >= LONG => most(&mut self.attractor.attained(state).iter().map(|near| functional.near(near))),
            _ => f64::NEG_INFINITY,
        }
    }

    /// Whether a cell that loops cross is lower than they are, or than its neighbours; see the module's comment.
    fn is_beside_highest(&self, candidate: &Candidate) -> bool {
        let (Some(window), Some(state)) = (&candidate.window, candidate.state) else { return false };
        let root = candidate.root as usize;
        let known = self.attractor.trim_of(root).is_some_and(|surface| self.rim.is_whole.get(surface) == Some(&true));
        if window.is_inside() || !known || !self.reached.is_finite() || self.attractor.hull(state).is_none() {
            return false;
        }
        let Some((orders, on_border)) = self.attractor.window_sides(root, window) else { return false };
        let rises = candidate.functional.rises(orders, [self.reached, candidate.bound], self.rounding);
        rises.as_flattened().iter().zip(on_border.as_flattened()).any(|(rises, on_border)| *rises && !on_border)
    }

    /// The supremum.
    pub(super) fn run(mut self, budget: &Budget) -> Result<Interval, Stopped> {
        let mut rounds = 0;
        loop {
            budget.cancel.check()?;
            self.leave();
            self.merge();
            if self.candidates.is_empty() || rounds == ROUNDS || self.splits >= SPLITS {
                break;
            }
            rounds += 1;
            let highest = self.candidates.iter().map(Candidate::ceiling).fold(f64::NEG_INFINITY, f64::max);
            // While nothing is reached, all.
            let least = if self.reached.is_finite() { self.reached + 0.5 * (highest - self.reached) } else { f64::NEG_INFINITY };
            for cell in std::mem::take(&mut self.candidates) {
                if cell.ceiling() < least || self.splits >= SPLITS {
                    self.candidates.push(cell);
                    continue;
                }
                self.splits += 1;
                if self.splits.is_multiple_of(256) {
                    budget.cancel.check()?;
                }
                self.split(&cell);
            }
        }
        let high = self.candidates.iter().map(Candidate::ceiling).fold(self.left.max(self.reached), f64::max);
        let rounding = self.rounding + self.missed * self.largest;
        Ok(Interval { low: self.reached - rounding, high: high + rounding })
    }

    /// Considers the children instead of a candidate.
    fn split(&mut self, candidate: &Candidate) {
        let &Candidate { root, state, ref functional, bound, slack, ref window, .. } = candidate;
        let attractor = self.attractor;
        let Some(state) = state else {
            for functional in functional.halves() {
                self.consider(Candidate { root, state: None, functional, bound, slack, seen: Vec::new(), window: None });
            }
            return;
        };
        let mut functionals = functional.for_children();
        // A child's bound needs no functional: most children go before they have one.
        let mut seen_by_children = PullBack::new(&functional.values);
        let enclosed = if self.enclosure(state).is_some() { attractor.enclosed_children(state) } else { &[] };
        for (index, transition) in attractor.automaton().state(state).transitions.iter().enumerate() {
            let window = window.as_ref().and_then(|window| attractor.child_window(root as usize, window, index));
            if window.as_ref().is_some_and(Window::is_outside) {
                continue;
            }
            let mut seen = Vec::new();
            if let (Some(Some(columns)), Some(enclosure)) = (enclosed.get(index), self.enclosure(transition.to)) {
                seen = seen_by_children.by(columns);
                self.missed = self.missed.max(enclosure.miss);
                if enclosure.range(seen.iter().copied())[1].min(bound) + slack <= self.reached {
                    continue;
                }
            }
            let functional = match attractor.hull(state) {
                Some(hull) => functionals.pulled_back(&hull.children[index]),
                None => self.at_hull(transition.to, functionals.pulled_back(&transition.operator)),
            };
            self.consider(Candidate { root, state: Some(transition.to), functional, bound, slack, seen, window: window.map(Box::new) });
        }
    }

    /// Lets go of cells that cannot be higher than what is reached by more than the width.
    fn leave(&mut self) {
        let (reached, width) = (self.reached, self.width);
        let mut left = self.left;
        self.candidates.retain(|cell| {
            let stays = cell.ceiling() > reached + width;
            if !stays {
                left = left.max(cell.ceiling());
            }
            stays
        });
        self.left = left;
    }

    /// Lets go of cells that others dominate.
    fn merge(&mut self) {
        if self.candidates.len() < 2 {
            return;
        }
        let attractor = self.attractor;
        let allowed = SLACK_ADDED * self.width;
        let most = SLACK * self.width;
        let mut cells = std::mem::take(&mut self.candidates);
        // The order is stable: what stays does not depend on chance.
        cells.sort_by(|a, b| b.bound.total_cmp(&a.bound));
        // By state, the kept cells that may dominate others: those that are whole.
        let mut kept: Vec<Vec<usize>> = vec![Vec::new(); attractor.automaton().states().len()];
        let mut difference = Vec::new();
        for cell in cells {
            let Some(state) = cell.state else {
                self.candidates.push(cell);
                continue;
            };
            let own = &mut kept[state.index()];
            let (first, rest) = own.split_at(own.len().min(COMPARISONS / 2));
            let near = rest.len().saturating_sub(COMPARISONS / 2);
            let found = rest[near..].iter().rev().chain(first).find_map(|&index| {
                let (other, bound) = (&self.candidates[index].functional, self.bound_of(state));
                let seen = &self.candidates[index].seen;
                let slack = match attractor.enclosure(state).filter(|_| !seen.is_empty() && !cell.seen.is_empty()) {
                    Some(enclosure) => {
                        // At the first point, a middle, the difference is no less than its lower bound.
                        (seen[0] - cell.seen[0] >= -allowed).then_some(())?;
                        let lower = enclosure.range(seen.iter().zip(&cell.seen).map(|(other, own)| other - own))[0];
                        (lower >= -allowed).then_some((-lower).max(0.0))?
                    }
                    None => cell.functional.slack_under(other, bound, self.reached, cell.bound, allowed, &mut difference)?,
                };
                let slack = cell.slack + slack;
                (slack <= most).then_some((index, slack))
            });
            if let Some((index, slack)) = found {
                let other = &mut self.candidates[index];
                other.slack = other.slack.max(slack);
                self.left = self.left.max(self.reached + cell.slack);
                continue;
            }
            // Cells that are cut do not attain what they would whole.
            if !cell.is_cut() {
                own.push(self.candidates.len());
            }
            self.candidates.push(cell);
        }
    }
}
