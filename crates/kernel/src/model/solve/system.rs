//! The equations of a model: matrices whose entries are numbers or unknowns, and constraints between their products.

use super::choose::Form;
use super::polynomial::Polynomial;
use super::rational::Rational;
use super::{ConflictingConstraint, SolveError};
use std::collections::BTreeMap;

/// An entry of a matrix.
#[derive(Clone, Debug)]
pub(super) enum Cell {
    Number(Rational),
    /// Index into [`System::unknowns`].
    Unknown(u32),
}

/// An operator, an embedding, or the control points of a root cell (rows x, y, z and, if rational, w).
#[derive(Clone, Debug)]
pub(super) struct Array {
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Row after row.
    pub(super) cells: Vec<Cell>,
    /// Where it stands in the model.
    pub(super) place: Place,
}

/// Which matrix of the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// Of (state, transition).
    Operator(usize, usize),
    /// Of (state, boundary).
    Embedding(usize, usize),
    /// Of a root cell.
    Points(usize),
}

impl Place {
    /// The entry's pointer below the shape.
    pub(super) fn pointer(self, row: usize, column: usize) -> String {
        match self {
            Self::Operator(s, t) => format!("/states/{s}/transitions/{t}/operator/{row}/{column}"),
            Self::Embedding(s, b) => format!("/states/{s}/boundaries/{b}/incidence/{row}/{column}"),
            // Points are listed one after the other: a column of the array is a row of the document.
            Self::Points(c) => format!("/cells/{c}/control_points/{column}/{row}"),
        }
    }
}

/// Something to be found.
#[derive(Clone, Debug)]
pub(super) struct Unknown {
    pub(super) name: String,
    pub(super) pointer: String,
    /// The document's value of a declared parameter.
    pub(super) declared: Option<f64>,
    /// The value that the caller chooses.
    pub(super) chosen: Option<f64>,
    /// What it should be near to if nothing determines it: 0, for coordinates the centre of the given points.
    pub(super) near: f64,
}

/// What a constraint says.
#[derive(Clone, Debug)]
pub(super) enum Equations {
    /// Every column of the array sums to 1.
    ColumnSums(usize),
    /// Two products of arrays are equal, column j of the first to column `permutation[j]` of the second.
    Equal { left: Vec<usize>, right: Vec<usize>, permutation: Option<Vec<usize>> },
    /// An unknown has a value.
    Value(u32, Rational),
}

/// A constraint of the model.
#[derive(Clone, Debug)]
pub(super) struct Constraint {
    pub(super) named: ConflictingConstraint,
    pub(super) equations: Equations,
    /// Differences up to this are rounding of the given numbers.
    pub(super) tolerance: f64,
    /// What differences are divided by to be relative: 1, or the size of the model for points.
    pub(super) scale: f64,
}

/// All of it.
#[derive(Clone, Debug, Default)]
pub(super) struct System {
    pub(super) arrays: Vec<Array>,
    /// In the order in which they would rather stay free.
    pub(super) unknowns: Vec<Unknown>,
    pub(super) constraints: Vec<Constraint>,
    /// Largest excess of the column sums of given matrices: how far their numbers are rounded.
    pub(super) rounding: f64,
}

/// Multiplications of terms that the equations may take together: seconds.
const PRODUCTS: u64 = 20_000_000;

impl System {
    /// The scalar equations "polynomial = 0" of a constraint; `work` counts what all constraints need.
    pub(super) fn equations(&self, constraint: &Constraint, work: &mut u64) -> Result<Vec<Polynomial>, SolveError> {
        match &constraint.equations {
            Equations::Value(unknown, value) => {
                let mut equation = Polynomial::unknown(*unknown);
                equation.add_scaled(&Polynomial::constant(value.clone()), &Rational::from(-1));
                Ok(vec![equation])
            }
            Equations::ColumnSums(array) => {
                let array = &self.arrays[*array];
                let sum = |column| {
                    let mut sum = Polynomial::constant(Rational::from(-1));
                    (0..array.rows).for_each(|row| sum.add_scaled(&array.entry(row, column), &Rational::ONE));
                    sum
                };
                Ok((0..array.columns).map(sum).collect())
            }
            Equations::Equal { left, right, permutation } => {
                let (left, right) = (self.product(left, work)?, self.product(right, work)?);
                let mut equations = Vec::with_capacity(left.entries.len());
                for row in 0..left.rows {
                    for column in 0..left.columns {
                        let other = permutation.as_ref().map_or(column, |permutation| permutation[column]);
                        let mut difference = left.entries[row * left.columns + column].clone();
                        difference.add_scaled(&right.entries[row * right.columns + other], &Rational::from(-1));
                        equations.push(difference);
                    }
                }
                Ok(equations)
            }
        }
    }

    /// From the right: the last factor has the fewest columns.
    fn product(&self, factors: &[usize], work: &mut u64) -> Result<Product, SolveError> {
        let array = |index: usize| &self.arrays[factors[index]];
        let last = array(factors.len() - 1);
        let entries = (0..last.rows).flat_map(|row| (0..last.columns).map(move |column| last.entry(row, column))).collect();
        let mut product = Product { rows: last.rows, columns: last.columns, entries };
        for index in (0..factors.len() - 1).rev() {
            let factor = array(index);
            let mut entries = Vec::with_capacity(factor.rows * product.columns);
            for row in 0..factor.rows {
                for column in 0..product.columns {
                    let mut sum = Polynomial::default();
                    *work += factor.columns as u64 / 16;
                    for inner in 0..factor.columns {
                        let right = &product.entries[inner * product.columns + column];
                        if right.terms() > 0 {
                            *work += right.terms() as u64;
                            match &factor.cells[row * factor.columns + inner] {
                                Cell::Number(value) if value.is_zero() => *work -= right.terms() as u64,
                                Cell::Number(value) => sum.add_scaled(right, value),
                                Cell::Unknown(unknown) => sum.add_product(&Polynomial::unknown(*unknown), right),
                            }
                        }
                    }
                    if *work > PRODUCTS {
                        return Err(SolveError::Limit { what: "multiplications of the constraints", asked: *work, allowed: PRODUCTS });
                    }
                    entries.push(sum);
                }
            }
            product = Product { rows: factor.rows, columns: product.columns, entries };
        }
        Ok(product)
    }

    /// Largest difference between the two sides of a constraint for values of the unknowns, relative to its scale.
    pub(super) fn residual(&self, constraint: &Constraint, values: &[f64]) -> f64 {
        let largest = match &constraint.equations {
            Equations::Value(unknown, value) => (values[*unknown as usize] - value.to_f64()).abs(),
            Equations::ColumnSums(array) => {
                let array = &self.arrays[*array];
                let sum = |column| (0..array.rows).map(|row| array.value(row, column, values)).sum::<f64>() - 1.0;
                (0..array.columns).map(|column| sum(column).abs()).fold(0.0, f64::max)
            }
            Equations::Equal { left, right, permutation } => {
                let columns = self.arrays[left[left.len() - 1]].columns;
                let mut largest = 0.0_f64;
                for column in 0..columns {
                    let other = permutation.as_ref().map_or(column, |permutation| permutation[column]);
                    let (a, b) = (self.image(left, column, values), self.image(right, other, values));
                    largest = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(largest, f64::max);
                }
                largest
            }
        };
        largest / constraint.scale
    }

    /// A column of a product.
    fn image(&self, factors: &[usize], column: usize, values: &[f64]) -> Vec<f64> {
        let (last, rest) = factors.split_last().expect("a product has a factor");
        let last = &self.arrays[*last];
        let mut vector: Vec<f64> = (0..last.rows).map(|row| last.value(row, column, values)).collect();
        for &factor in rest.iter().rev() {
            let array = &self.arrays[factor];
            vector = (0..array.rows).map(|row| (0..array.columns).map(|c| array.value(row, c, values) * vector[c]).sum()).collect();
        }
        vector
    }

    pub(super) fn index(&self) -> BTreeMap<&str, u32> {
        // Of two of one name the first wins: a declared parameter before an entry.
        self.unknowns.iter().enumerate().rev().map(|(index, unknown)| (unknown.name.as_str(), index as u32)).collect()
    }
}

struct Product {
    rows: usize,
    columns: usize,
    entries: Vec<Polynomial>,
}

impl Array {
    fn entry(&self, row: usize, column: usize) -> Polynomial {
        match &self.cells[row * self.columns + column] {
            Cell::Number(value) => Polynomial::constant(value.clone()),
            Cell::Unknown(index) => Polynomial::unknown(*index),
        }
    }

    /// The entry as a function of the free unknowns.
    pub(super) fn form(&self, row: usize, column: usize, forms: &[Form]) -> Form {
        match &self.cells[row * self.columns + column] {
            Cell::Number(value) => Form { constant: value.to_f64(), terms: Vec::new() },
            Cell::Unknown(index) => forms[*index as usize].clone(),
        }
    }

    pub(super) fn value(&self, row: usize, column: usize, values: &[f64]) -> f64 {
        match &self.cells[row * self.columns + column] {
            Cell::Number(value) => value.to_f64(),
            Cell::Unknown(index) => values[*index as usize],
        }
    }
}
