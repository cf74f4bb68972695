//! Ellipsoidal norms, one per state, in which single steps contract as well as can be arranged.
//!
//! An operator L of a transition v -> w maps V_w to V_v, so that its norm is at most g when L^T P_v L <= g^2 P_w.
//! The fixed point P_w = I + g^-2 sum_e L_e^T P_v L_e (over the transitions that lead to w) has that property,
//! and exists when g exceeds the 2-radius (Blondel and Nesterov, "Computationally efficient approximations of the
//! joint spectral radius", SIAM J. Matrix Anal. Appl. 27, 2005). That radius is up to the square root of the
//! number of maps above the joint spectral radius; weights on the transitions, raised where steps contract
//! least, close most of the gap. Whatever matrices come out are norms, and what is proven with them holds.

use super::super::matrix::Dense;
use super::super::{Automaton, State};
use super::Restriction;

/// The norm |C y| on V, with y in the coordinates of e_i - e_0.
#[derive(Clone, Debug)]
pub(super) struct AdaptedNorm {
    /// C, upper triangular.
    pub(super) factor: Dense,
    /// Its inverse, as computed.
    pub(super) inverse: Dense,
    /// Bounds |C inverse - I| in the spectral norm.
    pub(super) inverse_error: f64,
}

/// A step in adapted norms: C_v L C_w^-1 as computed, a bound of its distance from the exact matrix, and a
/// bound of the exact one's norm, all spectral.
pub(super) struct Scaled {
    pub(super) matrix: Dense,
    pub(super) error: f64,
    pub(super) norm: f64,
}

impl AdaptedNorm {
    fn of(metric: &Dense) -> Option<Self> {
        let factor = metric.cholesky()?;
        let inverse = factor.inverse_upper();
        let mut residual = factor.times(&inverse);
        (0..residual.rows).for_each(|i| *residual.at_mut(i, i) -= 1.0);
        let rounding = rounding(&factor, &inverse) + f64::EPSILON * residual.rows as f64;
        let inverse_error = residual.frobenius() * (1.0 + 1e-9) + rounding;
        (inverse_error < 0.01).then_some(Self { factor, inverse, inverse_error })
    }

    /// |C y|.
    pub(super) fn length(&self, y: &[f64]) -> f64 {
        let factor = &self.factor;
        let row = |row: usize| -> f64 { (row..factor.columns).map(|column| factor.at(row, column) * y[column]).sum() };
        (0..factor.rows).map(|i| row(i).powi(2)).sum::<f64>().sqrt()
    }

    /// A bound of |y|_1 / |y| over V: |y|_1 is at most twice the sum of the coordinates' sizes.
    pub(super) fn sum_ratio(&self) -> f64 {
        2.0 * (self.inverse.rows as f64).sqrt() * self.inverse.norm_bound() * (1.0 + 2.0 * self.inverse_error)
    }

    /// The largest |y| / |y|_1 over V: attained at a corner (e_j - e_k) / 2 of the 1-norm's unit ball.
    pub(super) fn corner(&self) -> f64 {
        let n = self.factor.columns;
        let mut largest = 0.0_f64;
        for j in 0..n {
            for k in 0..=j {
                let mut y = vec![0.0; n];
                y[j] = 0.5;
                if k < j {
                    y[k] = -0.5;
                }
                largest = largest.max(self.length(&y));
            }
        }
        largest * (1.0 + 1e-12)
    }

    /// C L C_w^-1. With J the computed inverse of C_w and D = C_w J - I, the exact inverse is J (I + D)^-1, so
    /// the exact step is C L J (I + D)^-1, within |C L J| |D| / (1 - |D|) of C L J; the rest is rounding.
    pub(super) fn scaled(&self, restriction: &Restriction, child: &Self) -> Scaled {
        let half = self.factor.times(&restriction.matrix);
        let matrix = half.times(&child.inverse);
        let inverse_size = child.inverse.frobenius();
        let product_rounding = rounding(&self.factor, &restriction.matrix) * inverse_size + rounding(&half, &child.inverse);
        let entry_rounding = self.factor.frobenius() * restriction.error * inverse_size;
        let arithmetic = (product_rounding + entry_rounding) * (1.0 + 1e-9);
        let computed = matrix.norm_bound();
        let error = (arithmetic + (computed + arithmetic) * child.inverse_error / (1.0 - child.inverse_error)) * (1.0 + 1e-9);
        Scaled { norm: computed + error, matrix, error }
    }
}

/// Bounds |fl(A B) - A B|_F: n u |A|_F |B|_F, and as much again for second order and the bound's own rounding.
pub(super) fn rounding(left: &Dense, right: &Dense) -> f64 {
    left.columns as f64 * f64::EPSILON * left.frobenius() * right.frobenius()
}

/// Work allowed for choosing norms, in multiplications: some ten milliseconds.
const NORM_WORK: f64 = 1.6e7;
/// Iterations of the fixed point, and of the power method for the 2-radius.
const ITERATIONS: f64 = 40.0;
/// The Euclidean norm is kept unless another is this much better: its balls are round.
const CLEARLY_BETTER: f64 = 0.98;
/// Weights are adapted while steps contract by less than this.
const HARD: f64 = 0.95;
/// Rounds of adapting weights.
const ROUNDS: usize = 6;

/// Chooses the norms in which the largest step is smallest.
pub(super) fn adapted_norms(automaton: &Automaton, restricted: &[Vec<Restriction>]) -> Vec<AdaptedNorm> {
    let start: Vec<Dense> = automaton.states().iter().map(euclidean).collect();
    let cost: f64 = restricted
        .iter()
        .flatten()
        .map(|step| {
            let (n, m) = (step.matrix.rows as f64, step.matrix.columns as f64);
            n * m * (n + m) + 20.0
        })
        .sum();
    let mut chooser = Chooser { restricted, start: &start, best: None, norms: Vec::new() };
    let steps = chooser.consider(&start);
    let iterations = (NORM_WORK / cost / 6.0).min(ITERATIONS) as usize;
    if iterations < 4 || steps.is_none() {
        return chooser.norms;
    }
    let mut weights: Vec<Vec<f64>> = restricted.iter().map(|steps| vec![1.0; steps.len()]).collect();
    let radius = two_radius(&start, &weights, restricted, iterations);
    for factor in [1.02, 1.3, 3.0] {
        if radius > 0.0 {
            chooser.consider(&fixed_point(&start, factor * radius, &weights, restricted, iterations));
        }
    }
    let mut spent = cost * (4 * iterations) as f64;
    for _ in 0..ROUNDS {
        if radius <= 0.0 || chooser.best.is_none_or(|largest| largest < HARD) || spent > NORM_WORK {
            break;
        }
        let radius = two_radius(&start, &weights, restricted, iterations);
        let Some(steps) = chooser.consider(&fixed_point(&start, 1.02 * radius, &weights, restricted, iterations)) else { break };
        let largest = steps.iter().flatten().fold(0.0_f64, |a, &b| a.max(b));
        for (weight, norm) in weights.iter_mut().flatten().zip(steps.iter().flatten()) {
            *weight = (*weight * (norm / largest).powi(2)).max(1e-6);
        }
        spent += cost * (2 * iterations) as f64;
    }
    chooser.norms
}

struct Chooser<'a> {
    restricted: &'a [Vec<Restriction>],
    start: &'a [Dense],
    /// The largest step in `norms`.
    best: Option<f64>,
    norms: Vec<AdaptedNorm>,
}

impl Chooser<'_> {
    /// Keeps the metrics' norms if they are better than what is kept; returns the steps' norms in them.
    fn consider(&mut self, metrics: &[Dense]) -> Option<Vec<Vec<f64>>> {
        let norms: Vec<AdaptedNorm> = metrics.iter().map(AdaptedNorm::of).collect::<Option<_>>()?;
        let measure = |(state, steps): (usize, &Vec<Restriction>)| -> Vec<f64> {
            steps.iter().map(|step| norms[state].scaled(step, &norms[step.to]).norm).collect()
        };
        let steps: Vec<Vec<f64>> = self.restricted.iter().enumerate().map(measure).collect();
        let largest = steps.iter().flatten().fold(0.0_f64, |a, &b| a.max(b));
        let euclidean = std::ptr::eq(metrics, self.start);
        if self.best.is_none_or(|best| largest < CLEARLY_BETTER * best) || euclidean {
            (self.best, self.norms) = (Some(largest), norms);
        }
        Some(steps)
    }
}

/// The Euclidean metric of the state's space, restricted to V: the identity for an affine frame, the
/// Gram matrix I + 1 1^T of the vectors e_i - e_0 for barycentric points.
fn euclidean(state: &State) -> Dense {
    let mut gram = Dense::identity(state.dimension - 1);
    if !state.frame {
        gram.entries.iter_mut().for_each(|entry| *entry += 1.0);
    }
    gram
}

/// For every state w, the weighted sum of L^T P_v L over the transitions v -> w.
fn pull_back(metrics: &[Dense], weights: &[Vec<f64>], restricted: &[Vec<Restriction>]) -> Vec<Dense> {
    let mut sums: Vec<Dense> = metrics.iter().map(|metric| Dense::zero(metric.rows, metric.rows)).collect();
    for ((metric, steps), weights) in metrics.iter().zip(restricted).zip(weights) {
        for (step, &weight) in steps.iter().zip(weights) {
            let term = step.matrix.transpose_congruence(metric);
            sums[step.to].entries.iter_mut().zip(&term.entries).for_each(|(total, &entry)| *total += weight * entry);
        }
    }
    sums
}

/// The 2-radius: growth per step of X -> sum L^T X L, estimated by iteration (any value is safe, it
/// only chooses a norm).
fn two_radius(start: &[Dense], weights: &[Vec<f64>], restricted: &[Vec<Restriction>], iterations: usize) -> f64 {
    let mut metrics = start.to_vec();
    let mut rate = 0.0;
    for _ in 0..iterations.min(24) {
        metrics = pull_back(&metrics, weights, restricted);
        let size = metrics.iter().map(Dense::frobenius).fold(0.0, f64::max);
        if !(size > 0.0 && size.is_finite()) {
            return 0.0;
        }
        rate = size.sqrt();
        metrics.iter_mut().for_each(|metric| metric.entries.iter_mut().for_each(|entry| *entry /= size));
    }
    rate
}

fn fixed_point(start: &[Dense], g: f64, weights: &[Vec<f64>], restricted: &[Vec<Restriction>], iterations: usize) -> Vec<Dense> {
    let mut metrics = start.to_vec();
    for _ in 0..iterations {
        let pulled = pull_back(&metrics, weights, restricted);
        for ((metric, base), term) in metrics.iter_mut().zip(start).zip(&pulled) {
            for ((entry, &identity), &added) in metric.entries.iter_mut().zip(&base.entries).zip(&term.entries) {
                *entry = identity + added / (g * g);
            }
        }
    }
    metrics
}
