//! Whether an automaton converges, proven both ways.
//!
//! Operators fix the hyperplane "sum = 1"; what must contract is their restriction L to the zero-sum
//! subspace V, along every infinite path: the path-constrained joint spectral radius must be below 1.
//! Eigenvalues of the single operators do not decide it (corner cutting with a = 0.9, b = -0.85 passes
//! that test and diverges along 0001).
//!
//! Lower bound: the spectral radius of a closed path's product to the power 1 / length. Upper bound: a tree of
//! paths whose leaves contract (`paths`), in ellipsoidal norms adapted to the automaton (`ellipsoid`) and, when
//! those leave the interval across 1, in the 1-norm, which is exact on V by a formula: half the largest distance
//! of two columns. Operators without negative entries never expand it. Only transitions within a strongly
//! connected component are on cycles, so only these are searched. States that are products of others are left out: what
//! holds for them follows from their factors (`product`).

mod ellipsoid;
mod paths;
mod product;
#[cfg(test)]
mod tests;

use super::matrix::Dense;
use super::{Automaton, State, StateId};
use ellipsoid::{AdaptedNorm, Scaled, adapted_norms};
use paths::{Lower, Norm, Step, Upper, components, search};
use product::StateNorm;

/// Bounds of the joint spectral radius, and the norm in which they were proven.
#[derive(Clone, Debug)]
pub struct Contraction {
    /// The radius is at least this.
    pub lower: f64,
    /// The radius is at most this.
    pub upper: f64,
    /// The closed path that attains the lower bound: its first state and the transitions' indices.
    pub cycle: (StateId, Vec<usize>),
    /// Length of the longest path examined.
    pub depth: usize,
    /// Every product along a path of length k has adapted norm at most `transient * rate^k`, with the rate
    /// `upper`, but 1/2 at least.
    pub transient: f64,
    norms: Vec<StateNorm>,
    /// Adapted norm of every transition's restriction, by state and transition.
    pub(crate) step_norms: Vec<Vec<f64>>,
}

impl Contraction {
    /// The adapted norm, at a state, of the difference of two barycentric points.
    pub(crate) fn distance(&self, state: StateId, from: &[f64], to: &[f64]) -> f64 {
        let difference: Vec<f64> = from.iter().zip(to).map(|(from, to)| to - from).collect();
        self.norms[state.index()].length(&difference)
    }

    /// C y for a point y of an affine frame: coordinates in which the adapted norm is the Euclidean one.
    ///
    /// # Panics
    /// For a product, which is no frame.
    pub(crate) fn rounded(&self, state: StateId, y: &[f64; 3]) -> [f64; 3] {
        let factor = &self.norms[state.index()].ellipsoid().expect("frames are no products").factor;
        std::array::from_fn(|row| (row..3).map(|column| factor.at(row, column) * y[column]).sum())
    }

    /// Columns u_j of C^-1: the ellipsoid {sum_j u_j x_j, |x| <= 1} is the unit ball of the norm, in the
    /// coordinates of e_i - e_0.
    pub(crate) fn unit_ball(&self, state: StateId) -> Vec<Vec<f64>> {
        self.norms[state.index()].unit_ball()
    }

    /// A bound of |y|_1 / |y| over V.
    pub(crate) fn sum_norm_ratio(&self, state: StateId) -> f64 {
        self.norms[state.index()].sum_ratio()
    }

    /// A bound of |y| / |y|_1 over V, for a state that is no product; no bound for others.
    pub(crate) fn norm_of_sum(&self, state: StateId) -> f64 {
        self.norms[state.index()].ellipsoid().map_or(f64::INFINITY, AdaptedNorm::corner)
    }

    /// The rate that goes with [`Self::transient`].
    pub(crate) fn rate(&self) -> f64 {
        self.upper.max(LEAST_RATE)
    }

    /// Bounds the sum over k of the norms of all products of one infinite path.
    pub(crate) fn sum_of_norms(&self) -> f64 {
        self.transient / (1.0 - self.rate())
    }
}

/// See [`Contraction::transient`].
const LEAST_RATE: f64 = 0.5;
/// Work allowed for a first search and, when it leaves the interval across 1, for a last one, in multiplications.
const FIRST_WORK: f64 = 1e7;
const LAST_WORK: f64 = 3e7;

/// A transition's operator restricted to V, in the coordinates of `e_i - e_0`.
struct Restriction {
    to: usize,
    matrix: Dense,
    /// Bounds the distance from the exact matrix, in the Frobenius norm.
    error: f64,
}

/// Bounds the joint spectral radius of the automaton.
///
/// Cost: a few tens of milliseconds at most, and a few passes over the automaton when that is larger.
#[must_use]
pub fn contraction(automaton: &Automaton) -> Contraction {
    let own: Vec<StateId> = (0..automaton.states().len()).map(StateId::new).filter(|&id| automaton.factors(id).is_empty()).collect();
    if own.len() == automaton.states().len() {
        return searched(automaton);
    }
    product::extended(automaton, &own, searched(&automaton.restricted_to(&own)))
}

/// As [`contraction`], for an automaton without products.
fn searched(automaton: &Automaton) -> Contraction {
    let restricted: Vec<Vec<Restriction>> = automaton.states().iter().map(restrictions).collect();
    let successors: Vec<Vec<usize>> = restricted.iter().map(|steps| steps.iter().map(|step| step.to).collect()).collect();
    let component = components(&successors);
    let norms = adapted_norms(automaton, &restricted);
    let scaled: Vec<Vec<Scaled>> = restricted
        .iter()
        .enumerate()
        .map(|(state, steps)| steps.iter().map(|step| norms[state].scaled(step, &norms[step.to])).collect())
        .collect();
    drop(restricted);
    let step_norms = scaled.iter().map(|steps| steps.iter().map(|step| step.norm).collect()).collect();
    let inner = |state: usize, to: usize| component[state] == component[to];
    let steps: Vec<Vec<Step>> = scaled
        .into_iter()
        .enumerate()
        .map(|(state, steps)| {
            let step = |(transition, step): (usize, Scaled)| {
                let to = successors[state][transition];
                inner(state, to).then_some(Step { to, transition, matrix: step.matrix, error: step.error, norm: step.norm })
            };
            steps.into_iter().enumerate().filter_map(step).collect()
        })
        .collect();
    let mut lower = Lower::default();
    let upper = bounds(automaton, &norms, &steps, &mut lower, &inner);
    // A bound of norms is proven under rounding; a radius is computed, and gives way to it.
    let rate = upper.rate.max(lower.rate.min(if upper.rate < 1.0 { upper.rate } else { f64::INFINITY }));
    let cycle = lower.cycle.map_or((StateId::new(0), Vec::new()), |(state, word)| (StateId::new(state), word));
    let norms = norms.into_iter().map(StateNorm::Ellipsoid).collect();
    let mut result = Contraction { lower: lower.rate.min(rate), upper: rate, cycle, depth: upper.depth, transient: 1.0, norms, step_norms };
    result.transient = transient(&result, &upper, &successors, &component);
    result
}

/// Searches in one norm after the other until the interval leaves 1 to one side.
fn bounds(
    automaton: &Automaton,
    norms: &[AdaptedNorm],
    steps: &[Vec<Step>],
    lower: &mut Lower,
    inner: &dyn Fn(usize, usize) -> bool,
) -> Upper {
    let first = search(steps, Norm::Spectral, lower, FIRST_WORK);
    if first.rate < 1.0 || lower.rate >= 1.0 {
        return first;
    }
    // |y| <= widest |y|_1 and |y|_1 <= narrowest |y| carry norms of products over.
    let operators: Vec<Vec<Step>> = automaton.states().iter().enumerate().map(|(index, state)| operators(state, index, inner)).collect();
    let mut second = search(&operators, Norm::ColumnDifference, lower, FIRST_WORK);
    if second.rate < 1.0 {
        let change =
            norms.iter().map(AdaptedNorm::sum_ratio).fold(0.0, f64::max) * norms.iter().map(AdaptedNorm::corner).fold(0.0, f64::max);
        second.largest.iter_mut().for_each(|norm| *norm *= change);
        return second;
    }
    drop(operators);
    search(steps, Norm::Spectral, lower, LAST_WORK)
}

/// Restrictions L of a state's operators to V: in the coordinates of `e_i - e_0` the entries are
/// `T[i][j] - T[i][0]`, i and j from 1.
fn restrictions(state: &State) -> Vec<Restriction> {
    state
        .transitions
        .iter()
        .map(|edge| {
            let operator = &edge.operator;
            let mut matrix = Dense::zero(operator.rows() - 1, operator.columns() - 1);
            for column in 1..operator.columns() {
                for row in 1..operator.rows() {
                    *matrix.at_mut(row - 1, column - 1) = operator.entry(row, column) - operator.entry(row, 0);
                }
            }
            let error = f64::EPSILON * matrix.frobenius();
            Restriction { to: edge.to.index(), matrix, error }
        })
        .collect()
}

/// The transitions of a state within its component, as they are. The exact operator is the one whose first row
/// makes the columns sum to 1: it differs by what the sums are off.
fn operators(state: &State, index: usize, inner: &dyn Fn(usize, usize) -> bool) -> Vec<Step> {
    let mut steps = Vec::new();
    for (transition, edge) in state.transitions.iter().enumerate().filter(|(_, edge)| inner(index, edge.to.index())) {
        let (rows, columns) = (edge.operator.rows(), edge.operator.columns());
        let matrix = Dense { rows, columns, entries: edge.operator.entries().to_vec() };
        let off = |column: usize| (edge.operator.column(column).iter().sum::<f64>() - 1.0).abs();
        let error = (0..columns).map(off).fold(0.0, f64::max) + rows as f64 * f64::EPSILON * matrix.column_sum();
        steps.push(Step { to: edge.to.index(), transition, norm: Norm::ColumnDifference.of(&matrix) + error, matrix, error });
    }
    steps
}

/// The factor t with |product| <= t rate^k. Within a component a path is cut into leaves of the tree, which obey
/// the rate, and the beginning of one, which is a path that the search met. From one component to the next the
/// factors multiply.
fn transient(result: &Contraction, upper: &Upper, successors: &[Vec<usize>], component: &[usize]) -> f64 {
    let rate = result.upper.max(LEAST_RATE);
    if rate >= 1.0 {
        return f64::INFINITY;
    }
    let within = (1..).zip(&upper.largest).map(|(length, norm)| norm / rate.powi(length)).fold(1.0, f64::max);
    // Components are numbered so that transitions lead to smaller numbers.
    let mut states: Vec<usize> = (0..component.len()).collect();
    states.sort_by_key(|&state| component[state]);
    let mut factors = vec![within; component.len()];
    for &state in &states {
        for (&to, &norm) in successors[state].iter().zip(&result.step_norms[state]) {
            if component[to] != component[state] {
                let through = within * norm / rate * factors[component[to]];
                factors[component[state]] = factors[component[state]].max(through);
            }
        }
    }
    factors.iter().fold(1.0_f64, |a, &b| a.max(b)) * (1.0 + 1e-9)
}
