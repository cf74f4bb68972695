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

use crate::attractor::cell::{Cell, ControlPoint, Point, dot};
use crate::attractor::trim::{TrimmedSurface, Window};
use crate::attractor::{AttainedPoint, Attractor, OwnRadius, StateBound};
use crate::automaton::{LeafPrimitive, StateId, SubdivisionOperator};
use crate::budget::{Budget, Stopped};
use crate::measure::Interval;

/// Cells that are split at most, per direction: the interval is wider when they do not suffice.
const SPLITS: usize = 20_000;
/// Rounds at most.
const ROUNDS: usize = 1000;
/// Splits after which points of the attractor are worked out, so that what is reached rises sooner: most searches are done before.
const LONG: usize = 64;
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

/// x -> (values . x) / (weights . x) on a barycentric space; without weights, values . x.
#[derive(Clone)]
struct Functional {
    values: Vec<f64>,
    weights: Option<Vec<f64>>,
}

impl Functional {
    /// x . direction + offset, as seen from a cell with these control points.
    fn of(points: &[ControlPoint], rational: bool, direction: &Point, offset: f64) -> Self {
        let value = |point: &ControlPoint| {
            let weight = if rational { point[3] } else { 1.0 };
            dot(direction, &[point[0], point[1], point[2]]) + offset * weight
        };
        Self { values: points.iter().map(value).collect(), weights: rational.then(|| points.iter().map(|point| point[3]).collect()) }
    }

    /// As seen from the child with this operator.
    fn pulled_back(&self, operator: &SubdivisionOperator) -> Self {
        Self { values: operator.pull_back(&self.values), weights: self.weights.as_ref().map(|weights| operator.pull_back(weights)) }
    }

    fn at(&self, point: &[f64]) -> f64 {
        let sum = |factors: &[f64]| factors.iter().zip(point).map(|(factor, x)| factor * x).sum::<f64>();
        self.weights.as_ref().map_or(sum(&self.values), |weights| sum(&self.values) / sum(weights))
    }

    /// What it is at least at a point of the attractor that is so near: let y be that point and v the value at x. Then that at y is
    /// v + (values - v weights) . (y - x) / (weights . y), and y - x sums to 0.
    fn near(&self, near: &AttainedPoint) -> f64 {
        let value = self.at(&near.point);
        let ([least, most], weight) = match &self.weights {
            None => (extremes(self.values.iter().copied()), 1.0),
            Some(weights) => {
                let differences = self.values.iter().zip(weights).map(|(own, weight)| own - value * weight);
                (extremes(differences), extremes(weights.iter().copied())[0])
            }
        };
        value - 0.5 * near.off * (most - least) / weight
    }

    /// Whether this one's supremum h on a state's attractor is at most max(reached, that of `other` + slack): the slack, if it is within what is allowed.
    fn slack_under(
        &self,
        other: &Self,
        bound: &StateBound,
        reached: f64,
        ceiling: f64,
        allowed: f64,
        difference: &mut Vec<f64>,
    ) -> Option<f64> {
        difference.clear();
        match (&self.weights, &other.weights) {
            (None, None) => {
                difference.extend(other.values.iter().zip(&self.values).map(|(other, own)| other - own));
                let lower = range(bound, difference)[0];
                (lower >= -allowed).then_some((-lower).max(0.0))
            }
            // With t = max(reached, h(other) + e) for e = `allowed`, suppose h > t, which is between `reached` and `ceiling`: somewhere
            // (values - t weights) . x > 0. If this is at most a positive multiple of the other's (values - (t - e) weights) . x, then h(other) > t - e,
            // which it is not. Both are linear in t, so that the ends of t tell; barycentric coordinates are not negative here, so that each tells.
            (Some(own_weights), Some(other_weights)) if reached.is_finite() => {
                let scale = own_weights.iter().sum::<f64>() / other_weights.iter().sum::<f64>();
                let holds = |t: f64| {
                    let mut all = self.values.iter().zip(own_weights).zip(other.values.iter().zip(other_weights));
                    all.all(|((value, weight), (other, other_weight))| value - t * weight <= scale * (other - (t - allowed) * other_weight))
                };
                (holds(reached) && holds(ceiling)).then_some(allowed)
            }
            _ => None,
        }
    }

    /// Bounds of its values on a state's attractor.
    fn range(&self, bound: &StateBound) -> [f64; 2] {
        match &self.weights {
            None => range(bound, &self.values),
            // Operators without negative entries, and positive weights: a mean of the control points' quotients.
            Some(weights) => extremes(self.values.iter().zip(weights).map(|(value, weight)| value / weight)),
        }
    }
}

fn extremes(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], value| [least.min(value), most.max(value)])
}

/// Bounds of values . x over the attractor of a state with that bound.
fn range(bound: &StateBound, values: &[f64]) -> [f64; 2] {
    match bound {
        StateBound::Hull { margin, .. } => {
            let [least, most] = extremes(values.iter().copied());
            let beyond = if *margin > 0.0 { margin * (most - least) } else { 0.0 };
            [least - beyond, most + beyond]
        }
        StateBound::Frame { low, high, centre, reach, .. } => {
            let slopes: Point = std::array::from_fn(|j| values[j + 1] - values[0]);
            let (mut least, mut most) = (values[0], values[0]);
            for j in 0..3 {
                let (a, b) = (slopes[j] * low[j], slopes[j] * high[j]);
                least += a.min(b);
                most += a.max(b);
            }
            // The ellipsoid's support: the image of the unit ball under its matrix.
            let middle = values[0] + dot(&slopes, centre);
            let radius = reach.iter().map(|column| dot(&slopes, column).powi(2)).sum::<f64>().sqrt();
            [least.max(middle - radius), most.min(middle + radius)]
        }
    }
}

/// A cell that may attain the supremum.
struct Candidate {
    root: u32,
    state: StateId,
    functional: Functional,
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

    fn bytes(&self) -> usize {
        size_of::<Self>() + size_of::<f64>() * self.functional.values.len() * (1 + usize::from(self.functional.weights.is_some()))
    }
}

/// The search for the supremum of x . direction.
pub(super) struct Search<'a> {
    attractor: &'a Attractor,
    direction: Point,
    /// Wanted width of the interval.
    width: f64,
    rounding: f64,
    /// Some point of the shape attains this, or more.
    reached: f64,
    /// What was left alone, because its supremum is higher by less than the width, has none above this.
    left: f64,
    candidates: Vec<Candidate>,
    splits: usize,
    bytes: usize,
}

impl<'a> Search<'a> {
    /// The search through cells in that extent.
    pub(super) fn new(attractor: &'a Attractor, extent: &Extent, direction: &Point) -> Self {
        let moved = attractor.trimmed().iter().map(TrimmedSurface::moved_mm).fold(0.0, f64::max);
        let rounding = ROUNDING * extent.largest_term(direction);
        Self {
            attractor,
            direction: *direction,
            // Functionals are not known better than to their rounding.
            width: RELATIVE_WIDTH * extent.along(direction) + 0.1 * rounding,
            rounding: rounding + moved,
            reached: f64::NEG_INFINITY,
            left: f64::NEG_INFINITY,
            candidates: Vec::new(),
            splits: 0,
            bytes: 0,
        }
    }

    /// Begins with all roots, each dilated by the ball of its own constant radius if `dilated`.
    pub(super) fn with_roots(mut self, dilated: bool, budget: &Budget) -> Result<Self, Stopped> {
        let ends = self.attractor.trimmed().iter().flat_map(TrimmedSurface::loop_points);
        self.reached = ends.map(|point| dot(&self.direction, &point)).fold(f64::NEG_INFINITY, f64::max);
        for (index, root) in self.attractor.roots().iter().enumerate() {
            if index % 4096 == 0 {
                budget.cancel.check()?;
            }
            let offset = match self.attractor.own_radius(index) {
                Some(OwnRadius::Constant(radius)) if dilated => *radius,
                _ => 0.0,
            };
            self.begin(index as u32, root.state, &root.points, offset, self.attractor.root_window(index));
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
        let functional = Functional::of(points, rational, &self.direction, offset);
        self.consider(Candidate { root, state, functional, bound: f64::INFINITY, slack: 0.0, window: window.map(Box::new) });
    }

    /// Keeps a cell, bounded here and by its parent, if it may be higher than what is reached.
    fn consider(&mut self, mut cell: Candidate) {
        let attractor = self.attractor;
        let [floor, bound] = cell.functional.range(attractor.bound(cell.state));
        cell.bound = bound.min(cell.bound);
        self.reached = match &cell.window {
            Some(window) if !window.is_inside() => {
                let points = attractor.window_points(cell.root as usize, window);
                points.map(|point| dot(&self.direction, &point)).fold(self.reached, f64::max)
            }
            _ => match &attractor.automaton().state(cell.state).leaf {
                // The hull of its control points.
                LeafPrimitive::Simplex => self.reached.max(cell.bound),
                LeafPrimitive::Chord(ends) => {
                    self.reached.max(floor).max(cell.functional.at(&ends.start)).max(cell.functional.at(&ends.end))
                }
                _ if self.splits >= LONG && cell.bound > self.reached => {
                    let points = attractor.attained(cell.state).iter();
                    points.map(|near| cell.functional.near(near)).fold(self.reached.max(floor), f64::max)
                }
                _ => self.reached.max(floor),
            },
        };
        if cell.ceiling() > self.reached {
            self.candidates.push(cell);
        }
    }

    /// The supremum, and the bytes that the search held.
    pub(super) fn run(mut self, budget: &Budget) -> Result<(Interval, u64), Stopped> {
        let mut rounds = 0;
        loop {
            let bytes = self.candidates.iter().map(Candidate::bytes).sum();
            self.bytes = self.bytes.max(bytes);
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
        Ok((Interval { low: self.reached - self.rounding, high: high + self.rounding }, self.bytes as u64))
    }

    /// Considers the children instead of a cell.
    fn split(&mut self, cell: &Candidate) {
        let attractor = self.attractor;
        for (index, transition) in attractor.automaton().state(cell.state).transitions.iter().enumerate() {
            let window = cell.window.as_ref().and_then(|window| attractor.child_window(cell.root as usize, window, index));
            if window.as_ref().is_some_and(Window::is_outside) {
                continue;
            }
            let functional = cell.functional.pulled_back(&transition.operator);
            let window = window.map(Box::new);
            self.consider(Candidate { root: cell.root, state: transition.to, functional, bound: cell.bound, slack: cell.slack, window });
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
            let own = &mut kept[cell.state.index()];
            let (first, rest) = own.split_at(own.len().min(COMPARISONS / 2));
            let near = rest.len().saturating_sub(COMPARISONS / 2);
            let found = rest[near..].iter().rev().chain(first).find_map(|&index| {
                let (other, bound) = (&self.candidates[index].functional, attractor.bound(cell.state));
                let slack = cell.functional.slack_under(other, bound, self.reached, cell.bound, allowed, &mut difference)?;
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
