//! Whether an automaton converges, proven both ways.
//!
//! Operators fix the hyperplane "sum = 1"; what must contract is their restriction L to the zero-sum
//! subspace V, along every infinite path: the path-constrained joint spectral radius must be below 1.
//! Eigenvalues of the single operators do not decide it (corner cutting with a = 0.9, b = -0.85 passes
//! that test and diverges along 0001).
//!
//! Lower bound: the spectral radius of a closed path's product to the power 1 / length. Upper bound: a
//! tree of paths every leaf of which has norm at most upper^length (Gripenberg, "Computing the joint
//! spectral radius", Linear Algebra Appl. 234, 1996), in an ellipsoidal norm per state adapted by the
//! fixed point P_v = I + g^-2 sum_e L_e^T P_w L_e (Blondel and Nesterov's 2-radius).

use super::matrix::Dense;
use super::{Automaton, StateId};

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
    /// Every product along a path of length k has adapted norm at most `transient * upper^k`.
    pub transient: f64,
    norms: Vec<AdaptedNorm>,
    /// Adapted norm of every transition's restriction, by state and transition.
    pub(crate) step_norms: Vec<Vec<f64>>,
}

/// The norm |C y| on V, with y in the coordinates of e_i - e_0.
#[derive(Clone, Debug)]
struct AdaptedNorm {
    factor: Dense,
    inverse: Dense,
}

impl Contraction {
    /// The adapted norm, at a state, of the difference of two barycentric points.
    pub(crate) fn distance(&self, state: StateId, from: &[f64], to: &[f64]) -> f64 {
        let factor = &self.norms[state.index()].factor;
        let mut square = 0.0;
        for row in 0..factor.rows {
            let sum: f64 = (row..factor.columns).map(|column| factor.at(row, column) * (to[column + 1] - from[column + 1])).sum();
            square += sum * sum;
        }
        square.sqrt()
    }

    /// C y for a point y of an affine frame: coordinates in which the adapted norm is the Euclidean one.
    pub(crate) fn rounded(&self, state: StateId, y: &[f64; 3]) -> [f64; 3] {
        let factor = &self.norms[state.index()].factor;
        std::array::from_fn(|row| (row..3).map(|column| factor.at(row, column) * y[column]).sum())
    }

    /// Columns u_j of C^-1: the ellipsoid {sum_j u_j x_j, |x| <= 1} is the unit ball of the norm, in the
    /// coordinates of e_i - e_0.
    pub(crate) fn unit_ball(&self, state: StateId) -> Vec<Vec<f64>> {
        let inverse = &self.norms[state.index()].inverse;
        (0..inverse.columns).map(|column| (0..inverse.rows).map(|row| inverse.at(row, column)).collect()).collect()
    }

    /// A bound of |y|_1 / |y| over V.
    pub(crate) fn sum_norm_ratio(&self, state: StateId) -> f64 {
        let inverse = &self.norms[state.index()].inverse;
        2.0 * (inverse.rows as f64).sqrt() * inverse.norm_bound()
    }
}

/// Work allowed for the search, in multiplications: some tens of milliseconds.
const SEARCH_WORK: f64 = 1.5e7;
/// Longest path examined.
const MAXIMUM_DEPTH: usize = 64;
/// The search stops when the upper bound exceeds the lower by this share of what is left to 1: bounds far
/// from 1 decide, whatever their digits.
const GAP: f64 = 0.02;

struct Step {
    to: usize,
    transition: usize,
    matrix: Dense,
}

struct Path {
    start: usize,
    end: usize,
    word: Vec<usize>,
    product: Dense,
    /// min over prefixes of norm^(1/length).
    rate: f64,
}

/// Bounds the joint spectral radius of the automaton.
#[must_use]
pub fn contraction(automaton: &Automaton) -> Contraction {
    let restricted: Vec<Vec<Step>> = automaton.states().iter().map(restrictions).collect();
    let norms = adapted_norms(automaton, &restricted);
    let steps: Vec<Vec<Step>> = restricted
        .iter()
        .enumerate()
        .map(|(state, steps)| {
            let scaled = |step: &Step| norms[state].factor.times(&step.matrix).times(&norms[step.to].inverse);
            steps.iter().map(|step| Step { to: step.to, transition: step.transition, matrix: scaled(step) }).collect()
        })
        .collect();
    let step_norms = steps.iter().map(|steps| steps.iter().map(|step| step.matrix.norm_bound()).collect()).collect();
    let mut result =
        Contraction { lower: 0.0, upper: 0.0, cycle: (StateId::new(0), Vec::new()), depth: 0, transient: 1.0, norms, step_norms };
    search(&steps, &mut result);
    result
}

/// Restrictions L of a state's operators to V: in the coordinates of `e_i - e_0` the entries are
/// `T[i][j] - T[i][0]`, i and j from 1.
fn restrictions(state: &super::State) -> Vec<Step> {
    state
        .transitions
        .iter()
        .enumerate()
        .map(|(transition, edge)| {
            let operator = &edge.operator;
            let mut matrix = Dense::zero(operator.rows() - 1, operator.columns() - 1);
            for column in 1..operator.columns() {
                for row in 1..operator.rows() {
                    *matrix.at_mut(row - 1, column - 1) = operator.entry(row, column) - operator.entry(row, 0);
                }
            }
            Step { to: edge.to.index(), transition, matrix }
        })
        .collect()
}

/// The Euclidean metric of the state's space, restricted to V: the identity for an affine frame, the
/// Gram matrix I + 1 1^T of the vectors e_i - e_0 for barycentric points.
fn euclidean(state: &super::State) -> Dense {
    let n = state.dimension - 1;
    let mut gram = Dense::identity(n);
    if !state.frame {
        gram.entries.iter_mut().for_each(|entry| *entry += 1.0);
    }
    gram
}

/// Chooses, among a few values of g, the ellipsoidal norms in which the largest step is smallest.
fn adapted_norms(automaton: &Automaton, restricted: &[Vec<Step>]) -> Vec<AdaptedNorm> {
    let start: Vec<Dense> = automaton.states().iter().map(euclidean).collect();
    let pull_back = |metrics: &[Dense]| -> Vec<Dense> {
        restricted
            .iter()
            .enumerate()
            .map(|(state, steps)| {
                let n = start[state].rows;
                let mut sum = Dense::zero(n, n);
                for step in steps {
                    let term = step.matrix.transpose_congruence(&metrics[step.to]);
                    sum.entries.iter_mut().zip(&term.entries).for_each(|(total, &entry)| *total += entry);
                }
                sum
            })
            .collect()
    };
    let mut best: Option<(f64, Vec<AdaptedNorm>)> = None;
    for factor in [f64::INFINITY, 1.02, 1.3, 3.0] {
        let metrics = if factor.is_finite() {
            let g = factor * two_radius(&start, &pull_back);
            if g <= 0.0 {
                continue;
            }
            fixed_point(&start, g, &pull_back)
        } else {
            start.clone()
        };
        let Some(norms) = metrics.iter().map(norm_of).collect::<Option<Vec<_>>>() else { continue };
        let largest = restricted
            .iter()
            .enumerate()
            .flat_map(|(state, steps)| steps.iter().map(move |step| (state, step)))
            .map(|(state, step)| norms[state].factor.times(&step.matrix).times(&norms[step.to].inverse).norm_bound())
            .fold(0.0, f64::max);
        // The Euclidean norm is kept unless another is clearly better: its balls are round.
        if best.as_ref().is_none_or(|(value, _)| largest < 0.98 * value) {
            best = Some((largest, norms));
        }
    }
    best.map(|(_, norms)| norms).unwrap_or_default()
}

fn norm_of(metric: &Dense) -> Option<AdaptedNorm> {
    let factor = metric.cholesky()?;
    let inverse = factor.inverse_upper();
    Some(AdaptedNorm { factor, inverse })
}

/// The 2-radius: growth per step of X -> sum L^T X L, estimated by iteration (any value is safe, it
/// only chooses a norm).
fn two_radius(start: &[Dense], pull_back: &dyn Fn(&[Dense]) -> Vec<Dense>) -> f64 {
    let mut metrics = start.to_vec();
    let mut rate = 0.0;
    for _ in 0..24 {
        metrics = pull_back(&metrics);
        let size = metrics.iter().map(Dense::frobenius).fold(0.0, f64::max);
        if !(size > 0.0 && size.is_finite()) {
            return 0.0;
        }
        rate = size.sqrt();
        metrics.iter_mut().for_each(|metric| metric.entries.iter_mut().for_each(|entry| *entry /= size));
    }
    rate
}

fn fixed_point(start: &[Dense], g: f64, pull_back: &dyn Fn(&[Dense]) -> Vec<Dense>) -> Vec<Dense> {
    let mut metrics = start.to_vec();
    for _ in 0..40 {
        let pulled = pull_back(&metrics);
        for ((metric, base), term) in metrics.iter_mut().zip(start).zip(&pulled) {
            for ((entry, &identity), &added) in metric.entries.iter_mut().zip(&base.entries).zip(&term.entries) {
                *entry = identity + added / (g * g);
            }
        }
    }
    metrics
}

/// Breadth-first search of paths; see the module's comment.
fn search(steps: &[Vec<Step>], result: &mut Contraction) {
    let mut work = 0.0;
    let mut visited: Vec<(f64, usize)> = Vec::new();
    let mut closed_rate = 0.0_f64;
    let mut level: Vec<Path> = Vec::new();
    for (state, outgoing) in steps.iter().enumerate() {
        let size = outgoing.first().map_or(0, |step| step.matrix.rows);
        level.push(Path { start: state, end: state, word: Vec::new(), product: Dense::identity(size), rate: f64::INFINITY });
    }
    for depth in 1..=MAXIMUM_DEPTH {
        let mut next = Vec::new();
        let mut exhausted = false;
        for (position, path) in level.iter().enumerate() {
            if work > SEARCH_WORK {
                // What was not extended keeps the rate it had.
                closed_rate = level[position..].iter().map(|path| path.rate).fold(closed_rate, f64::max);
                exhausted = true;
                break;
            }
            for step in &steps[path.end] {
                let product = path.product.times(&step.matrix);
                let size = product.rows.max(product.columns) as f64;
                work += 10.0 * size * size * size + 100.0;
                let norm = product.norm_bound();
                let mut word = path.word.clone();
                word.push(step.transition);
                if step.to == path.start {
                    let radius = product.spectral_radius().powf(1.0 / depth as f64);
                    work += 40.0 * size * size * size;
                    if radius > result.lower * (1.0 + 1e-12) {
                        result.lower = radius;
                        result.cycle = (StateId::new(path.start), word.clone());
                    }
                }
                visited.push((norm, depth));
                let rate = path.rate.min(norm.powf(1.0 / depth as f64));
                next.push(Path { start: path.start, end: step.to, word, product, rate });
            }
        }
        result.depth = depth;
        // A path whose rate is low enough needs no extension: it ends a leaf of the tree.
        let enough = result.lower + GAP * (1.0 - result.lower).max(1e-6 * result.lower);
        closed_rate = next.iter().filter(|path| path.rate <= enough).map(|path| path.rate).fold(closed_rate, f64::max);
        next.retain(|path| path.rate > enough);
        if exhausted || next.is_empty() || depth == MAXIMUM_DEPTH {
            closed_rate = next.iter().map(|path| path.rate).fold(closed_rate, f64::max);
            break;
        }
        level = next;
    }
    result.upper = closed_rate.max(result.lower);
    let rate = result.upper.max(f64::MIN_POSITIVE);
    result.transient = visited.iter().map(|&(norm, length)| norm / rate.powi(length as i32)).fold(1.0, f64::max);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::automaton::{LeafPrimitive, State, SubdivisionOperator, Transition};

    fn corner_cutting(a: f64, b: f64) -> Automaton {
        let operators = [vec![1.0 - a, a, 0.0, b, 1.0 - b, 0.0, 0.0, 1.0 - a, a], vec![b, 1.0 - b, 0.0, 0.0, 1.0 - a, a, 0.0, b, 1.0 - b]];
        let transitions = operators
            .into_iter()
            .enumerate()
            .map(|(label, columns)| {
                let (operator, _) = SubdivisionOperator::from_columns(3, columns).expect("sums to 1");
                Transition { to: StateId::new(0), operator, label }
            })
            .collect();
        let state = State {
            name: "curve".into(),
            kind: None,
            dimension: 3,
            transitions,
            boundaries: Vec::new(),
            leaf: LeafPrimitive::Centre,
            frame: false,
        };
        Automaton::new(vec![state]).expect("well formed")
    }

    #[test]
    fn chaikin_contracts_by_a_half() {
        let result = contraction(&corner_cutting(0.25, 0.25));
        assert!((result.lower - 0.5).abs() < 1e-9, "{}", result.lower);
        assert!(result.upper < 0.52 && result.upper >= 0.5, "{}", result.upper);
    }

    /// ALGORITHMS: all eigenvalues are inside the unit disc, yet rho(L0 L0 L0 L1) = 2.227.
    #[test]
    fn the_counterexample_is_found_with_its_word() {
        let result = contraction(&corner_cutting(0.9, -0.85));
        assert!(result.lower > 1.22, "{}", result.lower);
        let word = &result.cycle.1;
        assert_eq!(word.len() % 4, 0);
        assert_eq!(word.iter().sum::<usize>(), word.len() / 4, "one 1 among four letters: {word:?}");
    }

    #[test]
    fn every_point_of_gregorys_region_is_accepted() {
        for i in 1..20 {
            for j in 1..20 {
                let (a, b) = (f64::from(i) * 0.05, f64::from(j) * 0.05);
                if 1.0 - 2.0 * a - b > 1e-9 && 1.0 - a - 2.0 * b > 1e-9 {
                    let result = contraction(&corner_cutting(a, b));
                    assert!(result.upper < 1.0, "a {a}, b {b}: {}", result.upper);
                }
            }
        }
    }
}
