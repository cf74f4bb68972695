//! Equations between products of unknowns: a solution near one of a few deterministic starts, and how many unknowns
//! are free near it.

use super::SolveError;
use super::choose::{self, Form, Point};
use super::propagate::Knowledge;
use super::system::System;
use crate::automaton::matrix::Dense;
use crate::budget::CancelToken;
use crate::model::bcifs::Bcifs;
use std::collections::{BTreeMap, BTreeSet};

/// A solution.
pub(super) struct Found {
    pub(super) point: Point,
    /// Starts tried.
    pub(super) starts: usize,
}

/// Starts tried.
const STARTS: usize = 12;
/// Steps from every start.
const STEPS: usize = 200;
/// Unknowns that products may join: the work of a step grows with the cube.
const COUPLED: usize = 400;
/// Work allowed for all starts, in multiplications: seconds.
const WORK: f64 = 5e9;
/// An equation holds if it leaves no more than this share of its largest term (at least 1).
const SOLVED: f64 = 1e-12;
/// A column of the Jacobian depends on others if it leaves no more than this share of the largest.
const DEPENDENT: f64 = 1e-7;

/// The nonlinear equations in doubles, over the free unknowns that they join.
struct Problem {
    /// Per equation: coefficient and factors of every term, scaled so that the largest coefficient is 1.
    equations: Vec<Vec<(f64, Vec<u32>)>>,
    forms: Vec<Form>,
    /// Free unknowns that occur, ascending.
    coupled: Vec<u32>,
}

impl Problem {
    fn new(knowledge: &Knowledge) -> Result<Self, SolveError> {
        let forms = choose::forms(knowledge);
        let mut coupled = BTreeSet::new();
        let mut equations = Vec::new();
        for pending in &knowledge.pending {
            let largest = pending.equation.0.values().map(super::Rational::magnitude).fold(0.0, f64::max);
            let term = |(factors, coefficient): (&Vec<u32>, &super::Rational)| (coefficient.to_f64() / largest, factors.clone());
            equations.push(pending.equation.0.iter().map(term).collect());
            coupled.extend(pending.equation.unknowns().flat_map(|unknown| forms[unknown as usize].terms.iter().map(|&(free, _)| free)));
        }
        if coupled.len() > COUPLED {
            return Err(SolveError::Limit { what: "unknowns joined by products", asked: coupled.len() as u64, allowed: COUPLED as u64 });
        }
        Ok(Self { equations, forms, coupled: coupled.into_iter().collect() })
    }

    /// Left sides divided by their largest term, or by 1 if that is smaller.
    fn residuals(&self, values: &[f64]) -> Vec<f64> {
        let value = |equation: &Vec<(f64, Vec<u32>)>| {
            let terms = equation.iter().map(|(c, factors)| factors.iter().fold(*c, |product, &f| product * values[f as usize]));
            let (sum, largest) = terms.fold((0.0, 1.0_f64), |(sum, largest), term| (sum + term, largest.max(term.abs())));
            sum / largest
        };
        self.equations.iter().map(value).collect()
    }

    /// Rows of the Jacobian with respect to the coupled unknowns, sparse: (column, derivative).
    fn jacobian(&self, values: &[f64]) -> Vec<Vec<(usize, f64)>> {
        let row = |equation: &Vec<(f64, Vec<u32>)>| {
            let mut derivatives: BTreeMap<u32, f64> = BTreeMap::new();
            for (coefficient, factors) in equation {
                for position in 0..factors.len() {
                    let others = factors.iter().enumerate().filter(|(other, _)| *other != position);
                    *derivatives.entry(factors[position]).or_default() += others.fold(*coefficient, |p, (_, &f)| p * values[f as usize]);
                }
            }
            let mut row: BTreeMap<usize, f64> = BTreeMap::new();
            for (unknown, derivative) in derivatives {
                for &(free, coefficient) in &self.forms[unknown as usize].terms {
                    let column = self.coupled.binary_search(&free).expect("every free unknown of an equation is coupled");
                    *row.entry(column).or_default() += derivative * coefficient;
                }
            }
            row.into_iter().collect()
        };
        self.equations.iter().map(row).collect()
    }

    /// Levenberg's method with the damping |F|^2, which keeps quadratic convergence where the solutions are not isolated
    /// (Yamashita and Fukushima, "On the rate of convergence of the Levenberg-Marquardt method", Computing Suppl. 15,
    /// 2001). Returns the largest residual that is left.
    fn descend(&self, values: &mut Vec<f64>, work: &mut f64, cancel: &CancelToken) -> Result<f64, SolveError> {
        let square = |residuals: &[f64]| residuals.iter().map(|value| value * value).sum::<f64>();
        let mut residuals = self.residuals(values);
        let mut factor = 1.0;
        for _ in 0..STEPS {
            cancel.check()?;
            let error = square(&residuals);
            let largest = residuals.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
            *work += self.step_work();
            // Beyond the tolerance, until rounding stops it.
            if *work > WORK || largest <= 1e-3 * SOLVED || !error.is_finite() {
                break;
            }
            let Some(step) = self.step(values, &residuals, factor * error.min(1.0)) else {
                factor *= 10.0;
                continue;
            };
            let mut next = values.clone();
            self.coupled.iter().zip(&step).for_each(|(&unknown, change)| next[unknown as usize] += change);
            choose::complete(&self.forms, &mut next);
            let changed = self.residuals(&next);
            if square(&changed) < error {
                *values = next;
                residuals = changed;
                factor = (factor * 0.3).max(1e-6);
            } else if largest <= SOLVED || factor > 1e12 {
                break;
            } else {
                factor *= 5.0;
            }
        }
        Ok(residuals.iter().fold(0.0, |largest, value| if value.is_finite() { value.abs().max(largest) } else { f64::INFINITY }))
    }

    /// Multiplications of a step, about: the factorisation, and derivatives of all terms.
    fn step_work(&self) -> f64 {
        let terms: usize = self.equations.iter().map(Vec::len).sum();
        (self.coupled.len() as f64).powi(3) / 3.0 + 50.0 * terms as f64
    }

    /// -(J^T J + damping)^-1 J^T F.
    fn step(&self, values: &[f64], residuals: &[f64], damping: f64) -> Option<Vec<f64>> {
        let n = self.coupled.len();
        let mut normal = Dense::zero(n, n);
        let mut right = vec![0.0; n];
        for (row, residual) in self.jacobian(values).iter().zip(residuals) {
            for &(i, a) in row {
                right[i] -= a * residual;
                row.iter().for_each(|&(j, b)| *normal.at_mut(i, j) += a * b);
            }
        }
        let trace = (0..n).map(|i| normal.at(i, i)).sum::<f64>();
        (0..n).for_each(|i| *normal.at_mut(i, i) += damping + 1e-15 * trace);
        let factor = normal.cholesky()?;
        // normal = C^T C: forward, then backward.
        for i in 0..n {
            let known: f64 = (0..i).map(|k| factor.at(k, i) * right[k]).sum();
            right[i] = (right[i] - known) / factor.at(i, i);
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| factor.at(i, k) * right[k]).sum();
            right[i] = (right[i] - known) / factor.at(i, i);
        }
        right.iter().all(|value| value.is_finite()).then_some(right)
    }
}

/// A solution of what `knowledge` leaves: the first that contracts, else the first. Free unknowns begin at their `fixed`
/// values, and keep them unless products join them.
pub(super) fn find(
    model: &Bcifs,
    system: &System,
    knowledge: &Knowledge,
    fixed: &BTreeMap<u32, f64>,
    cancel: &CancelToken,
) -> Result<Found, SolveError> {
    let problem = Problem::new(knowledge)?;
    let centre = choose::smallest(system, &problem.forms, fixed, cancel)?;
    let mut first: Option<Found> = None;
    let (mut best, mut work, mut starts) = (f64::INFINITY, 0.0, 0);
    while starts < STARTS && work <= WORK {
        let start = starts;
        starts += 1;
        let mut values = centre.clone();
        // Spread evenly by multiples of irrational numbers, wider from start to start.
        let spread = 0.25 * start as f64;
        for (position, &unknown) in problem.coupled.iter().enumerate() {
            let turn = ((position + 1) as f64 * 0.618_033_988_749_895 + (start * start) as f64 * 0.414_213_562_373_095).fract();
            values[unknown as usize] += spread * (2.0 * turn - 1.0);
        }
        choose::complete(&problem.forms, &mut values);
        let residual = problem.descend(&mut values, &mut work, cancel)?;
        best = best.min(residual);
        if residual <= SOLVED {
            let mut held = fixed.clone();
            held.extend(problem.coupled.iter().map(|&unknown| (unknown, values[unknown as usize])));
            let point = choose::point(model, system, &problem.forms, &held, cancel)?;
            let enough = point.contraction.is_none() || point.contracts();
            if enough || first.is_none() {
                first = Some(Found { point, starts });
            }
            if enough {
                break;
            }
        }
    }
    first.ok_or(SolveError::NotFound { best_residual: best, starts })
}

/// Local structure of the solutions.
pub(super) struct Structure {
    /// Free unknowns that the equations join.
    pub(super) unknowns: usize,
    /// Equations.
    pub(super) equations: usize,
    /// Those of the unknowns that depend on the others near the point, one for each rank of the Jacobian.
    pub(super) dependent: BTreeSet<u32>,
}

/// Which unknowns depend on others near a solution: columns of the Jacobian in order, those that should least stay free
/// first, each that is independent of those before (Gram-Schmidt, twice for rounding).
pub(super) fn structure(knowledge: &Knowledge, values: &[f64], cancel: &CancelToken) -> Result<Structure, SolveError> {
    let problem = Problem::new(knowledge)?;
    let mut columns = vec![vec![0.0; problem.equations.len()]; problem.coupled.len()];
    for (index, row) in problem.jacobian(values).into_iter().enumerate() {
        row.into_iter().for_each(|(column, derivative)| columns[column][index] = derivative);
    }
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let largest = columns.iter().map(|column| dot(column, column).sqrt()).fold(0.0, f64::max);
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let mut dependent = BTreeSet::new();
    for (&unknown, mut column) in problem.coupled.iter().zip(columns).rev() {
        cancel.check()?;
        for _ in 0..2 {
            for direction in &basis {
                let share = dot(direction, &column);
                column.iter_mut().zip(direction).for_each(|(value, along)| *value -= share * along);
            }
        }
        let size = dot(&column, &column).sqrt();
        if size > DEPENDENT * largest {
            column.iter_mut().for_each(|value| *value /= size);
            basis.push(column);
            dependent.insert(unknown);
        }
    }
    Ok(Structure { unknowns: problem.coupled.len(), equations: problem.equations.len(), dependent })
}
