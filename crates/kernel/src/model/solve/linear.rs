//! Exact sparse elimination, one equation at a time.
//!
//! Unknowns are ordered by how much they should stay free; the pivot of a row is the one of it that should least. The
//! set of pivots of a linear system is then unique (the greedy basis of a matroid), whatever the order of the rows.

use super::SolveError;
use super::polynomial::Polynomial;
use super::rational::Rational;
use crate::budget::CancelToken;

/// A set of constraints, one bit each.
#[derive(Clone, Debug, PartialEq, Default)]
pub(super) struct Support(Vec<u64>);

impl Support {
    pub(super) fn of(constraint: usize) -> Self {
        let mut words = vec![0; constraint / 64 + 1];
        words[constraint / 64] = 1 << (constraint % 64);
        Self(words)
    }

    pub(super) fn unite(&mut self, other: &Self) {
        if self.0.len() < other.0.len() {
            self.0.resize(other.0.len(), 0);
        }
        self.0.iter_mut().zip(&other.0).for_each(|(word, more)| *word |= more);
    }

    /// The constraints, ascending.
    pub(super) fn members(&self) -> Vec<usize> {
        (0..self.0.len() * 64).filter(|index| self.0[index / 64] >> (index % 64) & 1 == 1).collect()
    }
}

/// sum of terms + constant = 0.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// Ascending by unknown; no coefficient is 0. The last is the pivot, with coefficient 1 once the row is inserted.
    pub(super) terms: Vec<(u32, Rational)>,
    pub(super) constant: Rational,
    /// The constraints from which it follows (perhaps more than necessary).
    pub(super) support: Support,
}

impl Row {
    /// From a polynomial of degree at most 1.
    pub(super) fn new(polynomial: &Polynomial, support: Support) -> Self {
        let mut row = Self { terms: Vec::with_capacity(polynomial.terms()), constant: Rational::ZERO, support };
        for (monomial, coefficient) in &polynomial.0 {
            match monomial.first() {
                None => row.constant = coefficient.clone(),
                Some(&unknown) => row.terms.push((unknown, coefficient.clone())),
            }
        }
        row
    }

    /// self -= factor * other. What cancels but for a share of `rounding` is dropped.
    fn subtract(&mut self, factor: &Rational, other: &Self, rounding: f64) {
        let factor = factor.negated();
        let mut terms = Vec::with_capacity(self.terms.len() + other.terms.len());
        let mut own = std::mem::take(&mut self.terms).into_iter().peekable();
        for (unknown, coefficient) in &other.terms {
            while own.peek().is_some_and(|(index, _)| index < unknown) {
                terms.extend(own.next());
            }
            let added = coefficient.times(&factor);
            match own.next_if(|(index, _)| index == unknown) {
                Some((_, present)) => {
                    let sum = present.plus(&added);
                    if !sum.is_zero() && sum.magnitude() > rounding * present.magnitude() {
                        terms.push((*unknown, sum));
                    }
                }
                None => terms.push((*unknown, added)),
            }
        }
        terms.extend(own);
        self.terms = terms;
        self.constant = self.constant.plus(&other.constant.times(&factor));
        self.support.unite(&other.support);
    }

    fn size(&self) -> u64 {
        self.terms.iter().map(|(_, coefficient)| coefficient.size()).sum::<u64>() + self.constant.size()
    }
}

/// What became of an equation.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Inserted {
    /// It determines one more unknown in terms of others.
    Pivot,
    /// It follows from the others.
    Redundant,
    /// It contradicts those of the set.
    Contradiction(Support),
}

/// Rows in echelon form, by pivot.
#[derive(Clone, Debug)]
pub(super) struct Echelon {
    rows: Vec<Option<Row>>,
    /// Share of a coefficient that counts as nothing when the rest cancels.
    rounding: f64,
    work: u64,
}

/// Work allowed, in operations on 64-bit numbers: some seconds.
const WORK: u64 = 60_000_000;
/// Cancellation of numbers that are printed in full leaves a share of 1e-16.
const ROUNDING: f64 = 1e-12;

impl Echelon {
    /// For `unknowns` unknowns and given numbers that are off by `rounding`.
    pub(super) fn new(unknowns: usize, rounding: f64) -> Self {
        Self { rows: vec![None; unknowns], rounding: ROUNDING.max(10.0 * rounding), work: 0 }
    }

    /// How many unknowns there are.
    pub(super) fn unknowns(&self) -> usize {
        self.rows.len()
    }

    /// The row whose pivot is the unknown.
    pub(super) fn row(&self, unknown: u32) -> Option<&Row> {
        self.rows[unknown as usize].as_ref()
    }

    /// Adds an equation; a remainder of up to `tolerance` where all unknowns have vanished is rounding.
    pub(super) fn insert(&mut self, mut row: Row, tolerance: f64, cancel: &CancelToken) -> Result<Inserted, SolveError> {
        while let Some((unknown, factor)) = row.terms.last().cloned() {
            let Some(pivot) = &self.rows[unknown as usize] else { break };
            let work = (pivot.size() + row.terms.len() as u64) * factor.size();
            row.subtract(&factor, pivot, self.rounding);
            self.charge(work, cancel)?;
        }
        let Some((unknown, factor)) = row.terms.last().cloned() else {
            return Ok(match row.constant.magnitude() {
                0.0 => Inserted::Redundant,
                remainder if remainder <= tolerance => Inserted::Redundant,
                _ => Inserted::Contradiction(row.support),
            });
        };
        if !factor.is_one() {
            let inverse = factor.inverse();
            row.terms.iter_mut().for_each(|(_, coefficient)| *coefficient = coefficient.times(&inverse));
            row.constant = row.constant.times(&inverse);
        }
        self.rows[unknown as usize] = Some(row);
        Ok(Inserted::Pivot)
    }

    /// Eliminates every pivot from the other rows.
    pub(super) fn reduce(&mut self, cancel: &CancelToken) -> Result<(), SolveError> {
        for index in 0..self.rows.len() {
            let Some(mut row) = self.rows[index].take() else { continue };
            // Rows of smaller pivots are reduced already: what they add are free unknowns.
            let replaced: Vec<(u32, Rational)> =
                row.terms[..row.terms.len() - 1].iter().filter(|(unknown, _)| self.rows[*unknown as usize].is_some()).cloned().collect();
            for (unknown, factor) in replaced {
                if let Some(pivot) = &self.rows[unknown as usize] {
                    self.work += (pivot.size() + row.terms.len() as u64) * factor.size();
                    row.subtract(&factor, pivot, self.rounding);
                }
            }
            self.rows[index] = Some(row);
            self.charge(1, cancel)?;
        }
        Ok(())
    }

    /// Counts work.
    pub(super) fn charge(&mut self, work: u64, cancel: &CancelToken) -> Result<(), SolveError> {
        self.work += work;
        cancel.check()?;
        if self.work > WORK {
            return Err(SolveError::Limit { what: "operations of the elimination", asked: self.work, allowed: WORK });
        }
        Ok(())
    }
}
