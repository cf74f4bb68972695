//! The address function: from words of transitions to cells and points of the attractor.
//!
//! phi(s) = lim P T_s1 ... T_sn x. A finite word leads to a cell, an eventually periodic one to a point: the
//! fixed point of the period's product, pushed through the prefix.
//!
//! Points are computed in the coordinates y = (x_1, ..., x_{n-1}) of a state's barycentric space, x_0 being what is
//! left to 1, from the end of the word to its beginning, so that an error made at a step is multiplied by the
//! operators before it only. Those contract: in the adapted norms |C y| of [`crate::automaton::convergence`] a
//! product of k operators has a norm of at most min(product of the steps' norms, transient upper^k) = g_k, and with
//! the edges D = (P_j - P_0) of the root an error e at step k moves the point by at most |D C^-1| g_k |C e|. No
//! interval is carried from step to step, hence nothing wraps, whatever the signs and rotations.

use super::Attractor;
use super::cell::{Ball, ControlPoint, Point, child_points};
use crate::automaton::{StateId, SubdivisionOperator};
use crate::budget::{Budget, Stopped};
use crate::error::{Kind, LimitFacts};
use crate::tolerance::NotPositive;
use std::fmt;
use std::str::FromStr;

/// A word of transitions from a root cell, by the indices that they have in the model. Written `0: 1 2 (0 3)`: root,
/// prefix, and in parentheses the period, if the word is infinite.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Address {
    /// Index of the root cell.
    pub root: usize,
    /// The first transitions.
    pub prefix: Vec<usize>,
    /// What is repeated without end after them; empty for the address of a cell.
    pub period: Vec<usize>,
}

/// Letters that an address may have, its period unrolled over the states it passes through.
pub const MOST_LETTERS: usize = 4096;

/// Where an address leads.
#[derive(Clone, Debug, PartialEq)]
pub struct Location {
    /// The address of `point`: the one asked for, and for that of a cell, continued by the first transition of every
    /// state until it repeats.
    pub address: Address,
    /// A point of the attractor in mm: the limit point, or for the address of a cell its anchor.
    pub point: Point,
    /// The exact point of the automaton is no farther from `point` than this, in mm.
    pub bound_mm: f64,
    /// The state of the cell at the end of the prefix.
    pub state: StateId,
    /// A ball that contains that cell.
    pub cell: Ball,
}

/// Why an address leads nowhere, or the addresses near a point were not found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AddressError {
    /// The text is no address.
    #[error("'{found}' at character {column} of the address: {expected}; an address is written 0: 1 2 (0 3)")]
    Syntax {
        /// Where, from 1.
        column: usize,
        /// What stands there.
        found: String,
        /// What may stand there.
        expected: &'static str,
    },
    /// Cells of trimmed surfaces are not searched.
    #[error("the model has a trimmed surface, whose cells cannot be searched; remove \"trim\" to ask about the whole surface")]
    Trimmed,
    /// There is no such root.
    #[error("root cell {root} does not exist: root cells are numbered 0 to {}", .roots - 1)]
    Root {
        /// What was asked.
        root: usize,
        /// How many there are.
        roots: usize,
    },
    /// The word does not fit the automaton.
    #[error("letter {position} of the address is {letter}, but state '{state}', to which the letters before it lead, has {allowed}")]
    Letter {
        /// Its position in the address, from 1.
        position: usize,
        /// The transition that was asked.
        letter: usize,
        /// The state that does not have it.
        state: String,
        /// What it has.
        allowed: String,
    },
    /// The period does not fit the state to which it leads.
    #[error(
        "the period leads from state '{first}' to state '{last}' and cannot be repeated there: letter {position} of the period is {letter}, but state '{state}' has {allowed}"
    )]
    Period {
        /// Where the period begins.
        first: String,
        /// Where it ends.
        last: String,
        /// Position of the letter in the period, from 1.
        position: usize,
        /// The letter.
        letter: usize,
        /// The state that does not have it.
        state: String,
        /// What it has.
        allowed: String,
    },
    /// The address is too long.
    #[error("the address has {letters} letters, its period repeated until its state does; at most {MOST_LETTERS} are possible")]
    TooLong {
        /// Its letters so far.
        letters: usize,
    },
    /// Weights so different that the point's own weight is lost in rounding.
    #[error("the weights of root cell {root} differ so much that the point cannot be located; make them more alike")]
    Weights {
        /// The root cell.
        root: usize,
    },
    /// A coordinate or distance of a search is not usable.
    #[error("{name} is {value}, and must be {expected}")]
    Query {
        /// Which.
        name: &'static str,
        /// What was given.
        value: f64,
        /// What it may be.
        expected: &'static str,
    },
    /// The resolution is no length.
    #[error(transparent)]
    Resolution(#[from] NotPositive),
    /// Too many cells to look at.
    #[error("more than {allowed} cells lie so near to the point that all must be looked at, at a resolution of {resolution_mm} mm")]
    Cells {
        /// The limit.
        allowed: u64,
        /// What was asked.
        resolution_mm: f64,
        /// A resolution that passes.
        reachable_mm: f64,
    },
    /// An address longer than allowed.
    #[error(
        "cells of {resolution_mm} mm have addresses of more than {allowed} letters here; those of that length are within {reached_mm} mm"
    )]
    Depth {
        /// The limit.
        allowed: u32,
        /// What was asked.
        resolution_mm: f64,
        /// Radius of the cell at the limit.
        reached_mm: f64,
    },
    /// Somebody stopped the search.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

impl AddressError {
    /// How to react.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Stopped(stopped) => stopped.kind(),
            Self::Cells { .. } | Self::Depth { .. } | Self::TooLong { .. } => Kind::Limit,
            Self::Weights { .. } => Kind::Unreachable,
            _ => Kind::Invalid,
        }
    }

    /// Stable code.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Syntax { .. } => "address.syntax",
            Self::Trimmed => "address.trimmed",
            Self::Root { .. } => "address.unknown-root",
            Self::Letter { .. } => "address.no-such-transition",
            Self::Period { .. } => "address.period",
            Self::TooLong { .. } => "limit-letters",
            Self::Weights { .. } => "address.weights",
            Self::Query { .. } => "address.query",
            Self::Resolution(_) => "params.not-a-length",
            Self::Cells { .. } => "limit-cells",
            Self::Depth { .. } => "limit-depth",
            Self::Stopped(stopped) => stopped.code(),
        }
    }

    /// The limit that was hit.
    #[must_use]
    pub fn limit(&self) -> Option<LimitFacts> {
        let facts = |limit, asked, allowed, remedy| Some(LimitFacts { limit, asked, allowed, remedy });
        match self {
            Self::Cells { allowed, reachable_mm, .. } => {
                facts("cells", *allowed as f64 + 1.0, *allowed as f64, Some(("tolerance_mm", *reachable_mm)))
            }
            Self::Depth { allowed, reached_mm, .. } => {
                facts("depth", f64::from(*allowed) + 1.0, f64::from(*allowed), Some(("tolerance_mm", *reached_mm)))
            }
            Self::TooLong { letters } => facts("letters", *letters as f64, MOST_LETTERS as f64, None),
            _ => None,
        }
    }
}

/// Indices as people write them: `0..3, 7`, and after some pieces how many more there are.
#[must_use]
pub fn ranges(indices: &[usize]) -> String {
    const PIECES: usize = 8;
    let mut sorted = indices.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    let pieces: Vec<&[usize]> = sorted.chunk_by(|a, b| a + 1 == *b).collect();
    let mut words: Vec<String> = Vec::new();
    for piece in pieces.iter().take(PIECES) {
        match piece {
            [only] => words.push(only.to_string()),
            [first, second] => words.extend([first.to_string(), second.to_string()]),
            _ => words.push(format!("{}..{}", piece[0], piece[piece.len() - 1])),
        }
    }
    let hidden: usize = pieces.iter().skip(PIECES).map(|piece| piece.len()).sum();
    if hidden > 0 {
        words.push(format!("{hidden} more"));
    }
    words.join(", ")
}

impl fmt::Display for Address {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:", self.root)?;
        self.prefix.iter().try_for_each(|letter| write!(formatter, " {letter}"))?;
        if let Some((first, rest)) = self.period.split_first() {
            write!(formatter, " ({first}")?;
            rest.iter().try_for_each(|letter| write!(formatter, " {letter}"))?;
            write!(formatter, ")")?;
        }
        Ok(())
    }
}

impl FromStr for Address {
    type Err = AddressError;

    /// Reads `0: 1 2 (0 3)`. The root may be left out when it is 0; letters are separated by spaces.
    fn from_str(text: &str) -> Result<Self, AddressError> {
        let mut address = Self::default();
        let (mut bracket, mut closed, mut letters) = (false, false, 0);
        for (column, word) in words(text) {
            let fault = |expected| AddressError::Syntax { column, found: word.chars().take(20).collect(), expected };
            match word {
                _ if closed => return Err(fault("nothing may follow the period")),
                ":" if letters == 1 && !bracket && text.matches(':').count() == 1 => {
                    address.root = address.prefix.remove(0);
                    letters = 0;
                }
                ":" => return Err(fault("one number, the root cell, stands before the colon")),
                "(" if !bracket => bracket = true,
                "(" => return Err(fault("a period holds no other")),
                ")" if bracket && !address.period.is_empty() => closed = true,
                ")" => return Err(fault("a period is closed after its first letter")),
                digits => {
                    let letter = digits.parse().map_err(|_| fault("transitions are whole numbers from 0"))?;
                    letters += 1;
                    if letters > MOST_LETTERS {
                        return Err(AddressError::TooLong { letters });
                    }
                    if bracket { address.period.push(letter) } else { address.prefix.push(letter) }
                }
            }
        }
        if bracket && !closed {
            let column = text.chars().count() + 1;
            return Err(AddressError::Syntax { column, found: "the end".into(), expected: "the period must be closed with )" });
        }
        Ok(address)
    }
}

/// Words and marks of an address, with their columns from 1.
fn words(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mark = |c: char| matches!(c, ':' | '(' | ')');
    let mut rest = text;
    let mut column = 1;
    std::iter::from_fn(move || {
        let trimmed = rest.trim_start();
        column += rest.chars().count() - trimmed.chars().count();
        let first = trimmed.chars().next()?;
        let length = if mark(first) { 1 } else { trimmed.find(|c: char| mark(c) || c.is_whitespace()).unwrap_or(trimmed.len()) };
        let (word, after) = trimmed.split_at(length);
        let place = column;
        column += word.chars().count();
        rest = after;
        Some((place, word))
    })
}

/// One step of a word: a state, and the position of the transition in its list.
type Step = (StateId, usize);

/// A word on the automaton: steps to the end of the prefix, and the steps of a cycle.
struct Route {
    steps: Vec<Step>,
    cycle: Vec<Step>,
    /// The state at the end of the steps.
    end: StateId,
}

/// The point that an address leads to, with a proven bound of its error.
///
/// For the address of a cell the anchor: its point whose address goes on with the first transition of every state. A
/// period may lead through several states if it can be repeated from each.
///
/// Cost: letters times n^2, and n times that for the period, n control points.
///
/// # Errors
/// [`AddressError`] when the address does not fit the automaton.
pub fn point_at(attractor: &Attractor, address: &Address, budget: &Budget) -> Result<Location, AddressError> {
    let roots = attractor.roots().len();
    let root = attractor.roots().get(address.root).ok_or(AddressError::Root { root: address.root, roots })?;
    let letters = address.prefix.len() + address.period.len();
    if letters > MOST_LETTERS {
        return Err(AddressError::TooLong { letters });
    }
    let mut steps = Vec::new();
    let state = walk(attractor, root.state, &address.prefix, &mut steps)
        .map_err(|(position, state)| letter_error(attractor, position, address.prefix[position], state))?;
    let cell = cell_of(attractor, address.root, &steps);
    let (route, asked) = if address.period.is_empty() {
        let route = anchored(attractor, Route { steps, cycle: Vec::new(), end: state });
        let asked = address_of(attractor, address.root, &route);
        (route, asked)
    } else {
        (unrolled(attractor, address, Route { steps, cycle: Vec::new(), end: state })?, address.clone())
    };
    let (point, bound_mm) = Locator::new(attractor, address.root).locate(&route, budget)?;
    Ok(Location { address: asked, point, bound_mm, state, cell })
}

/// Follows letters from a state; on failure, the position of the letter that does not fit and the state there.
fn walk(attractor: &Attractor, from: StateId, letters: &[usize], steps: &mut Vec<Step>) -> Result<StateId, (usize, StateId)> {
    let mut state = from;
    for (position, &letter) in letters.iter().enumerate() {
        let transitions = &attractor.automaton().state(state).transitions;
        let index = transitions.iter().position(|transition| transition.label == letter).ok_or((position, state))?;
        steps.push((state, index));
        state = transitions[index].to;
    }
    Ok(state)
}

fn letter_error(attractor: &Attractor, position: usize, letter: usize, state: StateId) -> AddressError {
    let (name, allowed) = described(attractor, state);
    AddressError::Letter { position: position + 1, letter, state: name, allowed }
}

/// A state's name and its transitions, in words.
fn described(attractor: &Attractor, state: StateId) -> (String, String) {
    let state = attractor.automaton().state(state);
    let labels: Vec<usize> = state.transitions.iter().map(|transition| transition.label).collect();
    let allowed = match labels.as_slice() {
        [] => "no transition: its cells do not subdivide, and addresses end there".to_owned(),
        [only] => format!("only transition {only}"),
        _ => format!("the transitions {}", ranges(&labels)),
    };
    (state.name.clone(), allowed)
}

/// Repeats the period until its state repeats: the states that it passes through are finitely many.
fn unrolled(attractor: &Attractor, address: &Address, mut route: Route) -> Result<Route, AddressError> {
    let (first, length) = (route.end, route.steps.len());
    let mut begins = vec![first];
    loop {
        let from = begins[begins.len() - 1];
        let end = walk(attractor, from, &address.period, &mut route.steps).map_err(|(position, state)| {
            let letter = address.period[position];
            if begins.len() == 1 {
                return letter_error(attractor, address.prefix.len() + position, letter, state);
            }
            let (name, allowed) = described(attractor, state);
            let named = |id: StateId| attractor.automaton().state(id).name.clone();
            AddressError::Period { first: named(first), last: named(from), position: position + 1, letter, state: name, allowed }
        })?;
        if let Some(known) = begins.iter().position(|&state| state == end) {
            let cycle = route.steps.split_off(length + known * address.period.len());
            return Ok(Route { steps: route.steps, cycle, end });
        }
        begins.push(end);
        if route.steps.len() > MOST_LETTERS {
            return Err(AddressError::TooLong { letters: route.steps.len() });
        }
    }
}

/// Continues by the first transition of every state until a state repeats, or to a simplex.
fn anchored(attractor: &Attractor, mut route: Route) -> Route {
    let length = route.steps.len();
    let mut visited = vec![route.end];
    while let Some(first) = attractor.automaton().state(route.end).transitions.first() {
        route.steps.push((route.end, 0));
        route.end = first.to;
        if let Some(known) = visited.iter().position(|&state| state == route.end) {
            route.cycle = route.steps.split_off(length + known);
            break;
        }
        visited.push(route.end);
    }
    route
}

fn address_of(attractor: &Attractor, root: usize, route: &Route) -> Address {
    let label = |&(state, index): &Step| attractor.automaton().state(state).transitions[index].label;
    Address { root, prefix: route.steps.iter().map(label).collect(), period: route.cycle.iter().map(label).collect() }
}

/// The ball of the cell at the end of a word, rounding included.
fn cell_of(attractor: &Attractor, root: usize, steps: &[Step]) -> Ball {
    let mut cell = attractor.root_cell(root);
    let mut points = attractor.roots()[root].points.clone();
    let slack = rounding(&cell.ball);
    for &(state, index) in steps {
        let operator = &attractor.automaton().state(state).transitions[index].operator;
        let mut child = vec![[0.0; 4]; operator.columns()];
        child_points(&points, operator, &mut child);
        cell = attractor.child_cell(&cell, index, &child);
        points = child;
    }
    Ball { radius: cell.ball.radius + slack, ..cell.ball }
}

/// What rounding may add to the distances of cells below a root, as in evaluations: products of depth 60 lose less
/// than 1e-12 of the largest coordinate.
pub(crate) fn rounding(root: &Ball) -> f64 {
    1e-12 * (root.radius + root.centre.iter().fold(0.0_f64, |most, x| most.max(x.abs())))
}

/// Evaluates words below one root.
struct Locator<'a> {
    attractor: &'a Attractor,
    root: usize,
    /// |C e_j| for every state, once needed.
    columns: Vec<Option<Vec<f64>>>,
}

/// Rounding errors of a sum of n products of doubles, relative to the sum of their sizes, twice over: the second
/// unit covers what multiplies errors with errors.
fn sum_rounding(terms: usize) -> f64 {
    (terms as f64 + 4.0) * f64::EPSILON
}

impl<'a> Locator<'a> {
    fn new(attractor: &'a Attractor, root: usize) -> Self {
        Self { attractor, root, columns: vec![None; attractor.automaton().states().len()] }
    }

    fn operator(&self, (state, index): Step) -> &'a SubdivisionOperator {
        &self.attractor.automaton().state(state).transitions[index].operator
    }

    /// A bound of |C e| over |e_j| <= error_j.
    fn size(&mut self, state: StateId, error: &[f64]) -> f64 {
        let contraction = self.attractor.contraction();
        let columns = self.columns[state.index()].get_or_insert_with(|| {
            let zero = vec![0.0; error.len() + 1];
            let mut unit = zero.clone();
            let column = |j: usize| {
                unit[j + 1] = 1.0;
                let size = contraction.distance(state, &zero, &unit);
                unit[j + 1] = 0.0;
                size
            };
            (0..error.len()).map(column).collect()
        });
        columns.iter().zip(error).map(|(column, error)| column * error).sum()
    }

    /// Maps y through the steps, last one first. The error is in the adapted norm of the first step's state: the sum
    /// of the steps' own, each through the operators before it.
    fn pull(&mut self, steps: &[Step], y: &[f64]) -> (Vec<f64>, f64) {
        let norms = self.norms(steps);
        let (mut current, mut total) = (y.to_vec(), 0.0);
        for (position, &step) in steps.iter().enumerate().rev() {
            let (image, error) = image(self.operator(step), &current);
            total += norms[position] * self.size(step.0, &error);
            current = image;
        }
        (current, total)
    }

    /// g_k for k = 0 to the number of steps: bounds of the norms of the products of the first k operators.
    fn norms(&self, steps: &[Step]) -> Vec<f64> {
        let contraction = self.attractor.contraction();
        let (mut product, mut power) = (1.0, contraction.transient);
        let mut norms = vec![1.0];
        for &(state, index) in steps {
            product *= contraction.step_norms[state.index()][index];
            power *= contraction.rate();
            norms.push(f64::min(product, power));
        }
        norms
    }

    /// The fixed point of a cycle, with a bound of its error in the adapted norm: for the residual r = f(y) - y the
    /// error is sum L^k r, so at most |C r| / (1 - g_p), or |C r| transient / (1 - rate^p).
    fn fixed_point(&mut self, cycle: &[Step], budget: &Budget) -> Result<(Vec<f64>, f64), AddressError> {
        let state = cycle[0].0;
        let dimension = self.attractor.automaton().state(state).dimension - 1;
        let mut y = vec![0.0; dimension];
        let (start, _) = self.pull(cycle, &y);
        // Column j of I - L, by the images of the corners; the residuals below correct what rounding spoils here.
        let mut matrix = Vec::with_capacity(dimension);
        for j in 0..dimension {
            budget.cancel.check()?;
            y[j] = 1.0;
            let (corner, _) = self.pull(cycle, &y);
            y[j] = 0.0;
            matrix.push((0..dimension).map(|i| f64::from(u8::from(i == j)) - (corner[i] - start[i])).collect());
        }
        let factors = Factors::of(matrix);
        let contraction = self.attractor.contraction();
        let norm = self.norms(cycle)[cycle.len()];
        let power = contraction.rate().powf(cycle.len() as f64);
        let geometric = (contraction.transient / (1.0 - power)).min(if norm < 1.0 { 1.0 / (1.0 - norm) } else { f64::INFINITY });
        let mut best = (y.clone(), f64::INFINITY);
        let mut residual: Vec<f64> = start;
        for _ in 0..5 {
            factors.solve(&mut residual);
            y.iter_mut().zip(&residual).for_each(|(value, step)| *value += step);
            let (image, error) = self.pull(cycle, &y);
            residual = image.iter().zip(&y).map(|(new, old)| new - old).collect();
            let sizes: Vec<f64> = residual.iter().zip(&y).map(|(r, old)| r.abs() + f64::EPSILON * (r.abs() + old.abs())).collect();
            let bound = (self.size(state, &sizes) + error) * geometric;
            // A singular matrix cannot be: the spectral radius is below 1. Anything not finite is not taken.
            if bound < best.1 {
                best = (y.clone(), bound);
            }
        }
        Ok(best)
    }

    fn locate(&mut self, route: &Route, budget: &Budget) -> Result<(Point, f64), AddressError> {
        let dimension = self.attractor.automaton().state(route.end).dimension;
        let (end, end_error) = match route.cycle.as_slice() {
            // A simplex: its middle belongs to it.
            [] => (vec![1.0 / dimension as f64; dimension - 1], 0.0),
            cycle => self.fixed_point(cycle, budget)?,
        };
        let (y, error) = self.pull(&route.steps, &end);
        let norm = self.norms(&route.steps)[route.steps.len()];
        self.project(&y, error + norm * end_error)
    }

    /// The point P_0 + sum y_j (P_j - P_0), whose y is known up to `error` in the root's adapted norm.
    fn project(&self, y: &[f64], error: f64) -> Result<(Point, f64), AddressError> {
        let root = &self.attractor.roots()[self.root];
        let unit_ball = self.attractor.contraction().unit_ball(root.state);
        let edge = |j: usize, axis: usize| root.points[j + 1][axis] - root.points[0][axis];
        // |D C^-1| for one row of D, a coordinate.
        let row_norm = |axis: usize| {
            unit_ball.iter().map(|column| column.iter().enumerate().map(|(j, &u)| u * edge(j, axis)).sum::<f64>().powi(2)).sum::<f64>()
        };
        let mut value: ControlPoint = root.points[0];
        let mut errors = [0.0; 4];
        for axis in 0..4 {
            value[axis] += y.iter().enumerate().map(|(j, &weight)| weight * edge(j, axis)).sum::<f64>();
            let base = root.points[0][axis].abs();
            let sizes = base + y.iter().enumerate().map(|(j, &weight)| weight.abs() * (root.points[j + 1][axis].abs() + base)).sum::<f64>();
            errors[axis] = row_norm(axis).sqrt() * error + sum_rounding(y.len()) * sizes;
        }
        let offset = errors[..3].iter().map(|error| error * error).sum::<f64>().sqrt() * (1.0 + 1e-9);
        if !root.rational {
            return Ok(([value[0], value[1], value[2]], offset));
        }
        // |X/w - X'/w'| <= (|X - X'| + |X'/w'| |w - w'|) / w.
        let point = [value[0] / value[3], value[1] / value[3], value[2] / value[3]];
        let reach = point.iter().map(|x| x * x).sum::<f64>().sqrt();
        let least = value[3] - errors[3];
        let bound = (offset + reach * errors[3]) / least + 4.0 * f64::EPSILON * reach;
        if least > 0.0 && bound.is_finite() { Ok((point, bound * (1.0 + 1e-9))) } else { Err(AddressError::Weights { root: self.root }) }
    }
}

/// The image of a point under an operator, in the coordinates without the first, and bounds of its rounding.
fn image(operator: &SubdivisionOperator, y: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let first = 1.0 - y.iter().sum::<f64>();
    let first_error = sum_rounding(y.len()) * (1.0 + y.iter().map(|x| x.abs()).sum::<f64>());
    let rounding = sum_rounding(y.len() + 1);
    let component = |row: usize| {
        let base = operator.entry(row, 0);
        let (mut sum, mut size) = (base * first, (base * first).abs());
        for (column, &weight) in y.iter().enumerate() {
            let term = operator.entry(row, column + 1) * weight;
            sum += term;
            size += term.abs();
        }
        (sum, rounding * size + base.abs() * first_error)
    };
    (1..operator.rows()).map(component).unzip()
}

/// A square matrix in triangular factors, rows exchanged for the largest pivots.
struct Factors {
    /// Columns; below the diagonal the multipliers.
    columns: Vec<Vec<f64>>,
    /// Which row was exchanged with the k-th.
    exchanged: Vec<usize>,
}

impl Factors {
    fn of(mut columns: Vec<Vec<f64>>) -> Self {
        let n = columns.len();
        let mut exchanged = Vec::with_capacity(n);
        for k in 0..n {
            let pivot = (k..n).max_by(|&a, &b| columns[k][a].abs().total_cmp(&columns[k][b].abs())).unwrap_or(k);
            exchanged.push(pivot);
            columns.iter_mut().for_each(|column| column.swap(k, pivot));
            let (done, rest) = columns.split_at_mut(k + 1);
            let own = &mut done[k];
            let diagonal = own[k];
            own[k + 1..].iter_mut().for_each(|entry| *entry /= diagonal);
            for column in rest {
                let top = column[k];
                column[k + 1..].iter_mut().zip(&own[k + 1..]).for_each(|(entry, factor)| *entry -= factor * top);
            }
        }
        Self { columns, exchanged }
    }

    fn solve(&self, right: &mut [f64]) {
        let n = self.columns.len();
        for (k, &pivot) in self.exchanged.iter().enumerate() {
            right.swap(k, pivot);
        }
        for k in 0..n {
            let value = right[k];
            right[k + 1..].iter_mut().zip(&self.columns[k][k + 1..]).for_each(|(entry, factor)| *entry -= factor * value);
        }
        for k in (0..n).rev() {
            right[k] /= self.columns[k][k];
            let value = right[k];
            right[..k].iter_mut().zip(&self.columns[k][..k]).for_each(|(entry, factor)| *entry -= factor * value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_written_as_they_are_read() {
        for text in ["0:", "3: 1 2", "0: 1 2 (0 3)", "12: (7)"] {
            assert_eq!(text.parse::<Address>().map(|address| address.to_string()), Ok(text.to_owned()));
        }
        let tight: Address = "2:1  0( 3 4)".parse().expect("spaces beside marks do not matter");
        assert_eq!(tight, Address { root: 2, prefix: vec![1, 0], period: vec![3, 4] });
        assert_eq!("(0 1)".parse(), Ok(Address { root: 0, prefix: vec![], period: vec![0, 1] }));
        assert_eq!("".parse(), Ok(Address::default()));
    }

    #[test]
    fn what_is_no_address_is_told_with_its_place() {
        let cases = [
            ("0: 1 x", 6),
            ("0: 1 -2", 6),
            ("0: 1,2", 4),
            ("0: (", 5),
            ("0: ()", 5),
            ("0: (1) 2", 8),
            ("1: 2: 3", 2),
            (": 1", 1),
            ("((1))", 2),
            ("99999999999999999999", 1),
        ];
        for (text, place) in cases {
            match text.parse::<Address>() {
                Err(AddressError::Syntax { column, .. }) => assert_eq!(column, place, "{text}"),
                other => panic!("{text}: {other:?}"),
            }
        }
        let long = "1 ".repeat(MOST_LETTERS + 1);
        assert_eq!(long.parse::<Address>(), Err(AddressError::TooLong { letters: MOST_LETTERS + 1 }));
    }

    #[test]
    fn indices_in_ranges() {
        assert_eq!(ranges(&[3, 0, 1, 2, 7, 9, 10, 7]), "0..3, 7, 9, 10");
        let many: Vec<usize> = (0..100).map(|k| 2 * k).collect();
        assert_eq!(ranges(&many), "0, 2, 4, 6, 8, 10, 12, 14, 92 more");
    }

    #[test]
    fn factors_solve() {
        let columns = vec![vec![0.0, 2.0, 1.0], vec![1.0, -1.0, 4.0], vec![3.0, 0.5, 0.25]];
        let mut right: Vec<f64> = (0..3).map(|i| columns[0][i] + 2.0 * columns[1][i] - columns[2][i]).collect();
        Factors::of(columns).solve(&mut right);
        assert!(right.iter().zip([1.0, 2.0, -1.0]).all(|(x, expected)| (x - expected).abs() < 1e-14), "{right:?}");
    }
}
