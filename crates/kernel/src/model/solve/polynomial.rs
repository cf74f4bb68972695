//! Polynomials with rational coefficients in the unknowns: one per scalar equation.

use super::rational::Rational;
use std::collections::BTreeMap;

/// A product of unknowns: their indices, ascending, with repetition; empty for the constant.
pub(super) type Monomial = Vec<u32>;

/// A sum of monomials; no coefficient is 0.
#[derive(Clone, Debug, PartialEq, Default)]
pub(super) struct Polynomial(pub(super) BTreeMap<Monomial, Rational>);

impl Polynomial {
    pub(super) fn constant(value: Rational) -> Self {
        let mut sum = Self::default();
        sum.add(Monomial::new(), &value);
        sum
    }

    pub(super) fn unknown(index: u32) -> Self {
        Self([(vec![index], Rational::ONE)].into())
    }

    pub(super) fn add(&mut self, monomial: Monomial, coefficient: &Rational) {
        if coefficient.is_zero() {
            return;
        }
        match self.0.entry(monomial) {
            std::collections::btree_map::Entry::Vacant(place) => {
                place.insert(coefficient.clone());
            }
            std::collections::btree_map::Entry::Occupied(mut place) => {
                let sum = place.get().plus(coefficient);
                if sum.is_zero() {
                    place.remove();
                } else {
                    *place.get_mut() = sum;
                }
            }
        }
    }

    /// self += factor * other.
    pub(super) fn add_scaled(&mut self, other: &Self, factor: &Rational) {
        for (monomial, coefficient) in &other.0 {
            self.add(monomial.clone(), &coefficient.times(factor));
        }
    }

    /// self += left * right.
    pub(super) fn add_product(&mut self, left: &Self, right: &Self) {
        for (first, a) in &left.0 {
            for (second, b) in &right.0 {
                let mut monomial: Monomial = first.iter().chain(second).copied().collect();
                monomial.sort_unstable();
                self.add(monomial, &a.times(b));
            }
        }
    }

    /// Largest number of factors of a monomial.
    pub(super) fn degree(&self) -> usize {
        self.0.keys().map(Vec::len).max().unwrap_or(0)
    }

    pub(super) fn terms(&self) -> usize {
        self.0.len()
    }

    /// The unknowns that occur, with repetition.
    pub(super) fn unknowns(&self) -> impl Iterator<Item = u32> + '_ {
        self.0.keys().flatten().copied()
    }

    /// Replaces unknowns by what `image` knows of them. `None` if the result would have more than `most` terms.
    pub(super) fn substitute<'a>(&self, image: &dyn Fn(u32) -> Option<&'a Self>, most: usize) -> Option<Self> {
        let mut sum = Self::default();
        for (monomial, coefficient) in &self.0 {
            let kept: Monomial = monomial.iter().copied().filter(|&index| image(index).is_none()).collect();
            let mut product = Self([(kept, coefficient.clone())].into());
            for replaced in monomial.iter().filter_map(|&index| image(index)) {
                let mut next = Self::default();
                next.add_product(&product, replaced);
                product = next;
                if product.terms() > most {
                    return None;
                }
            }
            sum.add_scaled(&product, &Rational::ONE);
            if sum.terms() > most {
                return None;
            }
        }
        Some(sum)
    }
}
