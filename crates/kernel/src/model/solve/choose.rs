//! One point of an affine space of solutions: as small as possible, and contracting if such a point is found.

use super::SolveError;
use super::propagate::Knowledge;
use super::system::{Place, System};
use crate::automaton::{Automaton, convergence};
use crate::budget::CancelToken;
use crate::model::bcifs::{Bcifs, Entry};
use crate::model::lower::Draft;
use glam::DVec4;
use std::collections::BTreeMap;

/// constant + sum of terms (free unknown, coefficient).
#[derive(Clone, Debug, Default)]
pub(super) struct Form {
    pub(super) constant: f64,
    pub(super) terms: Vec<(u32, f64)>,
}

impl Form {
    fn at(&self, values: &[f64]) -> f64 {
        self.terms.iter().fold(self.constant, |sum, &(unknown, coefficient)| sum + coefficient * values[unknown as usize])
    }
}

/// Every unknown as a function of those that are free.
pub(super) fn forms(knowledge: &Knowledge) -> Vec<Form> {
    (0..knowledge.echelon.unknowns() as u32)
        .map(|unknown| match knowledge.echelon.row(unknown) {
            None => Form { constant: 0.0, terms: vec![(unknown, 1.0)] },
            Some(row) => Form {
                constant: row.constant.negated().to_f64(),
                terms: row.terms[..row.terms.len() - 1].iter().map(|(other, coefficient)| (*other, -coefficient.to_f64())).collect(),
            },
        })
        .collect()
}

/// Values of all unknowns from those of the free ones in `values`.
pub(super) fn complete(forms: &[Form], values: &mut [f64]) {
    let all: Vec<f64> = forms.iter().map(|form| form.at(values) + 0.0).collect();
    values.copy_from_slice(&all);
}

/// The point in which `fixed` free unknowns have their values and the sum of squares of all unknowns is least.
pub(super) fn smallest(system: &System, forms: &[Form], fixed: &BTreeMap<u32, f64>, cancel: &CancelToken) -> Result<Vec<f64>, SolveError> {
    let goals: Vec<(Form, f64)> = forms.iter().cloned().zip(system.unknowns.iter().map(|unknown| unknown.near)).collect();
    least_squares(forms, &goals, fixed, cancel)
}

/// The point in which the columns of every operator differ least from their mean: a contracting one if any is likely.
fn tightest(system: &System, forms: &[Form], fixed: &BTreeMap<u32, f64>, cancel: &CancelToken) -> Result<Vec<f64>, SolveError> {
    // A small weight on the entries themselves makes the choice unique.
    const WEIGHT: f64 = 1e-3;
    let scaled = |form: &Form| Form {
        constant: WEIGHT * form.constant,
        terms: form.terms.iter().map(|&(unknown, coefficient)| (unknown, WEIGHT * coefficient)).collect(),
    };
    let mut goals: Vec<(Form, f64)> =
        forms.iter().zip(&system.unknowns).map(|(form, unknown)| (scaled(form), WEIGHT * unknown.near)).collect();
    for array in system.arrays.iter().filter(|array| matches!(array.place, Place::Operator(..))) {
        for row in 0..array.rows {
            let mut mean = (0.0, BTreeMap::new());
            for column in 0..array.columns {
                add(&mut mean, &array.form(row, column, forms), 1.0 / array.columns as f64);
            }
            for column in 0..array.columns {
                let mut difference = mean.clone();
                add(&mut difference, &array.form(row, column, forms), -1.0);
                let (constant, terms) = difference;
                goals.push((Form { constant, terms: terms.into_iter().filter(|&(_, c)| c != 0.0).collect() }, 0.0));
            }
        }
    }
    least_squares(forms, &goals, fixed, cancel)
}

fn add(sum: &mut (f64, BTreeMap<u32, f64>), form: &Form, factor: f64) {
    sum.0 += factor * form.constant;
    for &(unknown, coefficient) in &form.terms {
        *sum.1.entry(unknown).or_default() += factor * coefficient;
    }
}

/// Conjugate gradients on the normal equations (Hestenes and Stiefel 1952): the forms are sparse, and every free
/// unknown is a form itself, so the normal matrix is well conditioned.
fn least_squares(forms: &[Form], goals: &[(Form, f64)], fixed: &BTreeMap<u32, f64>, cancel: &CancelToken) -> Result<Vec<f64>, SolveError> {
    let mut values = vec![0.0; forms.len()];
    fixed.iter().for_each(|(&unknown, &value)| values[unknown as usize] = value);
    let open: Vec<bool> = (0..forms.len() as u32)
        .map(|unknown| matches!(forms[unknown as usize].terms[..], [(own, _)] if own == unknown) && !fixed.contains_key(&unknown))
        .collect();
    let transposed = |residual: &[f64]| {
        let mut gradient = vec![0.0; forms.len()];
        for ((form, _), &value) in goals.iter().zip(residual) {
            for &(unknown, coefficient) in form.terms.iter().filter(|(unknown, _)| open[*unknown as usize]) {
                gradient[unknown as usize] += coefficient * value;
            }
        }
        gradient
    };
    let mut residual: Vec<f64> = goals.iter().map(|(form, goal)| goal - form.at(&values)).collect();
    let mut gradient = transposed(&residual);
    let mut direction = gradient.clone();
    let square = |vector: &[f64]| vector.iter().map(|value| value * value).sum::<f64>();
    let mut size = square(&gradient);
    let enough = 1e-30 * size;
    for _ in 0..2 * forms.len().min(500) {
        cancel.check()?;
        if size <= enough || size == 0.0 {
            break;
        }
        let image: Vec<f64> = goals
            .iter()
            .map(|(form, _)| form.terms.iter().map(|&(unknown, coefficient)| coefficient * direction[unknown as usize]).sum())
            .collect();
        let step = size / square(&image);
        if !step.is_finite() {
            break;
        }
        values.iter_mut().zip(&direction).for_each(|(value, along)| *value += step * along);
        residual.iter_mut().zip(&image).for_each(|(value, along)| *value -= step * along);
        gradient = transposed(&residual);
        let next = square(&gradient);
        direction.iter_mut().zip(&gradient).for_each(|(along, down)| *along = down + next / size * *along);
        size = next;
    }
    complete(forms, &mut values);
    Ok(values)
}

/// A point of the affine space, and the bounds of the joint spectral radius of the model with it.
pub(super) struct Point {
    pub(super) values: Vec<f64>,
    pub(super) contraction: Option<[f64; 2]>,
}

impl Point {
    pub(super) fn new(model: &Bcifs, system: &System, values: Vec<f64>) -> Self {
        let contraction = contraction(&fill(model, system, &values));
        Self { values, contraction }
    }

    fn upper(&self) -> f64 {
        self.contraction.map_or(f64::INFINITY, |[_, upper]| upper)
    }

    pub(super) fn contracts(&self) -> bool {
        self.upper() < 1.0
    }
}

/// The smallest point if it contracts, else the tightest, else the one between; else the best of these.
pub(super) fn point(
    model: &Bcifs,
    system: &System,
    forms: &[Form],
    fixed: &BTreeMap<u32, f64>,
    cancel: &CancelToken,
) -> Result<Point, SolveError> {
    let smallest = Point::new(model, system, smallest(system, forms, fixed, cancel)?);
    if smallest.contraction.is_none_or(|[_, upper]| upper < 1.0) {
        return Ok(smallest);
    }
    let tightest = Point::new(model, system, tightest(system, forms, fixed, cancel)?);
    let between = smallest.values.iter().zip(&tightest.values).map(|(a, b)| 0.5 * (a + b)).collect();
    let mut best = smallest;
    for next in [Point::new(model, system, between), tightest] {
        if next.upper() < best.upper() {
            best = next;
        }
        if best.contracts() {
            break;
        }
    }
    Ok(best)
}

fn contraction(filled: &Bcifs) -> Option<[f64; 2]> {
    let mut draft = Draft::default();
    filled.lower(&mut draft);
    if draft.findings.iter().any(|finding| !finding.warning) {
        return None;
    }
    let bounds = convergence::contraction(&Automaton::new(draft.states).ok()?);
    Some([bounds.lower, bounds.upper])
}

/// The model with every unknown replaced by its value.
pub(super) fn fill(model: &Bcifs, system: &System, values: &[f64]) -> Bcifs {
    let mut filled = model.clone();
    for unknown in system.unknowns.iter().zip(values).filter(|(unknown, _)| unknown.declared.is_some()) {
        if let Some((_, value)) = filled.parameters.iter_mut().find(|(name, _)| *name == unknown.0.name) {
            *value = *unknown.1;
        }
    }
    for array in &system.arrays {
        let matrix = match array.place {
            Place::Operator(s, t) => &mut filled.states[s].transitions[t].operator,
            Place::Embedding(s, b) => &mut filled.states[s].boundaries[b].incidence,
            Place::Points(c) => {
                for (p, point) in filled.cells[c].control_points.iter_mut().enumerate().filter(|(_, point)| point.is_none()) {
                    let at = |row: usize| array.value(row, p, values);
                    let weight = if array.rows == 4 { at(3) } else { 1.0 };
                    *point = Some(DVec4::new(at(0) / weight, at(1) / weight, at(2) / weight, weight));
                }
                continue;
            }
        };
        for (i, row) in matrix.rows.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate().filter(|(_, entry)| **entry == Entry::Unknown) {
                *entry = Entry::Number(array.value(i, j, values));
            }
        }
    }
    filled
}
