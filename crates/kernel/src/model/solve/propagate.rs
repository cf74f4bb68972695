//! Elimination, substitution of what it determines, and again, until nothing is new.

use super::SolveError;
use super::linear::{Echelon, Inserted, Row, Support};
use super::polynomial::Polynomial;
use super::rational::Rational;
use super::system::System;
use crate::budget::CancelToken;

/// An equation that is not linear yet.
#[derive(Clone, Debug)]
pub(super) struct Pending {
    pub(super) equation: Polynomial,
    pub(super) support: Support,
    pub(super) tolerance: f64,
}

/// What is known of the unknowns.
#[derive(Clone, Debug)]
pub(super) struct Knowledge {
    pub(super) echelon: Echelon,
    /// Equations between products of unknowns.
    pub(super) pending: Vec<Pending>,
}

/// Affine images of this many terms are substituted into products.
const IMAGE_TERMS: usize = 4;

impl Knowledge {
    /// What the constraints with these indices tell, or those of them that contradict each other.
    pub(super) fn of(system: &System, constraints: &[usize], cancel: &CancelToken) -> Result<Result<Self, Support>, SolveError> {
        let mut knowledge = Self { echelon: Echelon::new(system.unknowns.len(), system.rounding), pending: Vec::new() };
        let mut linear = Vec::new();
        let mut work = 0;
        for &index in constraints {
            cancel.check()?;
            let constraint = &system.constraints[index];
            for equation in system.equations(constraint, &mut work)? {
                if equation.degree() > 1 {
                    knowledge.pending.push(Pending { equation, support: Support::of(index), tolerance: constraint.tolerance });
                } else if equation.terms() > 0 {
                    linear.push((equation, index, constraint.tolerance));
                }
            }
        }
        // Short equations first: less fill-in.
        linear.sort_by_key(|(equation, ..)| equation.terms());
        for (equation, index, tolerance) in linear {
            if let Inserted::Contradiction(support) =
                knowledge.echelon.insert(Row::new(&equation, Support::of(index)), tolerance, cancel)?
            {
                return Ok(Err(support));
            }
        }
        Ok(knowledge.advance(cancel)?.map_or(Ok(knowledge), Err))
    }

    /// Adds "unknown = value", known as constraint `index`. Tells whether it was free; a contradiction as its support.
    pub(super) fn assign(
        &mut self,
        unknown: u32,
        value: &Rational,
        index: usize,
        cancel: &CancelToken,
    ) -> Result<Result<bool, Support>, SolveError> {
        let row = Row { terms: vec![(unknown, Rational::ONE)], constant: value.negated(), support: Support::of(index) };
        Ok(match self.echelon.insert(row, VALUE_ALLOWED * value.magnitude().max(1.0), cancel)? {
            Inserted::Contradiction(support) => Err(support),
            Inserted::Redundant => Ok(false),
            Inserted::Pivot => Ok(true),
        })
    }

    /// Substitutes until nothing is new; constraints that contradict each other, if so.
    pub(super) fn advance(&mut self, cancel: &CancelToken) -> Result<Option<Support>, SolveError> {
        loop {
            self.echelon.reduce(cancel)?;
            let images: Vec<Option<Polynomial>> = (0..self.echelon.unknowns()).map(|unknown| self.image(unknown as u32)).collect();
            let mut progress = false;
            for mut pending in std::mem::take(&mut self.pending) {
                self.echelon.charge(pending.equation.terms() as u64, cancel)?;
                let known: Vec<u32> = pending.equation.unknowns().filter(|&unknown| images[unknown as usize].is_some()).collect();
                if !known.is_empty() {
                    let most = 64 + 4 * pending.equation.terms();
                    if let Some(equation) = pending.equation.substitute(&|unknown| images[unknown as usize].as_ref(), most) {
                        pending.equation = equation;
                        known.iter().filter_map(|&unknown| self.echelon.row(unknown)).for_each(|row| pending.support.unite(&row.support));
                    }
                }
                if pending.equation.degree() > 1 {
                    self.pending.push(pending);
                    continue;
                }
                match self.echelon.insert(Row::new(&pending.equation, pending.support), pending.tolerance, cancel)? {
                    Inserted::Contradiction(support) => return Ok(Some(support)),
                    Inserted::Pivot => progress = true,
                    Inserted::Redundant => {}
                }
            }
            if !progress {
                return Ok(None);
            }
        }
    }

    /// The unknown as an affine function of a few others.
    fn image(&self, unknown: u32) -> Option<Polynomial> {
        let row = self.echelon.row(unknown).filter(|row| row.terms.len() <= IMAGE_TERMS)?;
        let mut image = Polynomial::constant(row.constant.negated());
        for (other, coefficient) in &row.terms[..row.terms.len() - 1] {
            image.add(vec![*other], &coefficient.negated());
        }
        Some(image)
    }
}

/// A chosen value may differ from the one that the constraints determine by this.
pub(super) const VALUE_ALLOWED: f64 = 1e-9;
