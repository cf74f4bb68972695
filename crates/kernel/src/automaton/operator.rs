//! Matrices between barycentric spaces.

use std::borrow::Cow;
use std::sync::OnceLock;

/// A matrix T whose columns are points of the parent's barycentric space: column j holds the
/// barycentric coordinates of the child's control point j, so `P T` are the child's control points.
///
/// Shape n x m (parent x child), column-major. Invariant: finite entries, every column sums to 1
/// within [`COLUMN_SUM_CORRECTED`] before construction and exactly (to rounding) after it.
///
/// A Kronecker product is kept as its factors: it is applied direction by direction, and its entries are formed when
/// somebody asks for them.
#[derive(Clone, Debug)]
pub struct SubdivisionOperator {
    rows: usize,
    columns: usize,
    form: Form,
}

#[derive(Clone, Debug)]
enum Form {
    Dense(Vec<f64>),
    Product {
        /// Two or more, none a product itself; the first one's index is slowest.
        factors: Vec<SubdivisionOperator>,
        /// The entries, once they were asked for.
        formed: OnceLock<Vec<f64>>,
    },
}

impl PartialEq for SubdivisionOperator {
    fn eq(&self, other: &Self) -> bool {
        if (self.rows, self.columns) != (other.rows, other.columns) {
            return false;
        }
        let alike = !self.factors().is_empty() && self.factors() == other.factors();
        alike || self.entries() == other.entries()
    }
}

/// Column sums off 1 by no more than this are rounding: corrected without a word.
pub const COLUMN_SUM_EXACT: f64 = 1e-12;
/// Column sums off 1 by no more than this come from exports printed with few digits (six digits
/// leave 2e-6, some programs 1e-4): corrected and reported. More is an error.
pub const COLUMN_SUM_CORRECTED: f64 = 5e-4;

/// Why a matrix is not an operator.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OperatorError {
    /// A column does not sum to 1.
    #[error("column {column} sums to {sum}, and must sum to 1 (off by at most {COLUMN_SUM_CORRECTED})")]
    ColumnSum {
        /// Which.
        column: usize,
        /// Its sum.
        sum: f64,
    },
    /// An entry is infinite or not a number.
    #[error("row {row}, column {column} is {value}, and must be finite")]
    NotFinite {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// The entry.
        value: f64,
    },
}

impl SubdivisionOperator {
    /// Builds from column-major entries, n x m with n = `rows`. The excess of a column's sum is
    /// spread evenly over the column; the largest excess that deserves a report is returned too.
    ///
    /// # Errors
    /// [`OperatorError`] for an entry that is not finite or a sum too far from 1.
    pub fn from_columns(rows: usize, entries: Vec<f64>) -> Result<(Self, f64), OperatorError> {
        let columns = entries.len() / rows;
        let mut entries = entries;
        let mut corrected = 0.0_f64;
        for column in 0..columns {
            let values = &mut entries[column * rows..(column + 1) * rows];
            if let Some(row) = values.iter().position(|value| !value.is_finite()) {
                return Err(OperatorError::NotFinite { row, column, value: values[row] });
            }
            let sum: f64 = values.iter().sum();
            // Entries of size 1e6 round their sum by 1e-10 without any fault of the author.
            let rounding = COLUMN_SUM_EXACT * values.iter().map(|value| value.abs()).sum::<f64>().max(1.0);
            let excess = sum - 1.0;
            if excess.abs() > COLUMN_SUM_CORRECTED.max(rounding) {
                return Err(OperatorError::ColumnSum { column, sum });
            }
            if excess.abs() > rounding {
                corrected = corrected.max(excess.abs());
                let share = excess / rows as f64;
                values.iter_mut().for_each(|value| *value -= share);
            }
        }
        Ok((Self { rows, columns, form: Form::Dense(entries) }, corrected))
    }

    /// An operator whose columns sum to 1 by construction: from a formula, or a product of operators.
    pub(crate) fn exact(rows: usize, entries: Vec<f64>) -> Self {
        debug_assert_eq!(entries.len() % rows, 0);
        Self { rows, columns: entries.len() / rows, form: Form::Dense(entries) }
    }

    /// The Kronecker product of operators, the first one's index slowest. Its columns sum to 1 as theirs do.
    ///
    /// # Panics
    /// Without factors.
    #[must_use]
    pub fn product(factors: Vec<Self>) -> Self {
        let mut list = Vec::with_capacity(factors.len());
        for factor in factors {
            match factor.form {
                Form::Product { factors, .. } => list.extend(factors),
                Form::Dense(_) => list.push(factor),
            }
        }
        if list.len() == 1 {
            return list.remove(0);
        }
        assert!(!list.is_empty(), "a product has a factor");
        let rows = list.iter().map(|factor| factor.rows).product();
        let columns = list.iter().map(|factor| factor.columns).product();
        Self { rows, columns, form: Form::Product { factors: list, formed: OnceLock::new() } }
    }

    /// The factors of a Kronecker product; none for other operators.
    #[must_use]
    pub fn factors(&self) -> &[Self] {
        match &self.form {
            Form::Dense(_) => &[],
            Form::Product { factors, .. } => factors,
        }
    }

    /// The identity of size n.
    #[must_use]
    pub fn identity(n: usize) -> Self {
        let mut entries = vec![0.0; n * n];
        (0..n).for_each(|i| entries[i * n + i] = 1.0);
        Self::exact(n, entries)
    }

    /// n, the parent's dimension.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// m, the child's dimension.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Entry (i, j).
    #[must_use]
    pub fn entry(&self, row: usize, column: usize) -> f64 {
        self.entries()[column * self.rows + row]
    }

    /// Column j: a point of the parent's barycentric space.
    #[must_use]
    pub fn column(&self, column: usize) -> &[f64] {
        &self.entries()[column * self.rows..(column + 1) * self.rows]
    }

    /// All entries, column after column. Those of a Kronecker product are formed at the first call, at the cost of
    /// as many multiplications.
    #[must_use]
    pub fn entries(&self) -> &[f64] {
        match &self.form {
            Form::Dense(entries) => entries,
            Form::Product { factors, formed } => formed.get_or_init(|| kronecker(factors)),
        }
    }

    /// T x for a point x of the child's space.
    ///
    /// Cost: as many multiplications as the operator has entries; for a Kronecker product of n_u x n_u and n_v x n_v,
    /// n_u n_v (n_u + n_v).
    #[must_use]
    pub fn apply(&self, point: &[f64]) -> Vec<f64> {
        if let Form::Product { factors, .. } = &self.form {
            return through_factors(factors, point, 1, false);
        }
        let mut image = vec![0.0; self.rows];
        for (column, &weight) in point.iter().enumerate() {
            for (sum, &entry) in image.iter_mut().zip(self.column(column)) {
                *sum += entry * weight;
            }
        }
        image
    }

    /// c^T T for a functional c on the parent's space: the functional on the child's whose value at x is that of c at T x.
    ///
    /// Cost: that of [`Self::apply`].
    #[must_use]
    pub fn pull_back(&self, functional: &[f64]) -> Vec<f64> {
        if let Form::Product { factors, .. } = &self.form {
            return through_factors(factors, functional, 1, true);
        }
        self.entries().chunks_exact(self.rows).map(|column| product_sum(column, functional)).collect()
    }

    /// The product `self * other`, n x the other's columns: factor by factor where both are Kronecker products whose
    /// factors fit.
    #[must_use]
    pub fn times(&self, other: &Self) -> Self {
        if let Some(product) = self.times_factors(other) {
            return product;
        }
        Self::exact(self.rows, (0..other.columns).flat_map(|column| self.apply(other.column(column))).collect())
    }

    /// (A x B)(C x D) = AC x BD. A factor of one column, which the end of a curve is, meets no factor of the other.
    fn times_factors(&self, other: &Self) -> Option<Self> {
        let Form::Product { factors, .. } = &self.form else { return None };
        let single = std::slice::from_ref(other);
        let mut rest = if other.factors().is_empty() { single } else { other.factors() }.iter().peekable();
        let mut product = Vec::with_capacity(factors.len());
        for factor in factors {
            match rest.next_if(|next| next.rows == factor.columns) {
                Some(next) => product.push(factor.times(next)),
                None if factor.columns == 1 => product.push(factor.clone()),
                None => return None,
            }
        }
        rest.next().is_none().then(|| Self::product(product))
    }

    /// Whether no entry is negative (beyond rounding): such operators keep cells in the convex
    /// hull of their control points.
    #[must_use]
    pub fn is_nonnegative(&self) -> bool {
        match &self.form {
            Form::Dense(entries) => entries.iter().all(|&entry| entry >= -1e-15),
            Form::Product { factors, .. } => factors.iter().all(Self::is_nonnegative),
        }
    }
}

/// The entries of a Kronecker product.
fn kronecker(factors: &[SubdivisionOperator]) -> Vec<f64> {
    let start = SubdivisionOperator::identity(1);
    let product = factors.iter().fold(start, |a, b| {
        let mut entries = Vec::with_capacity(a.entries().len() * b.entries().len());
        for i in 0..a.columns {
            for j in 0..b.columns {
                for x in a.column(i) {
                    entries.extend(b.column(j).iter().map(|y| x * y));
                }
            }
        }
        SubdivisionOperator::exact(a.rows * b.rows, entries)
    });
    product.entries().to_vec()
}

/// (T_u x T_v) x, direction after direction; or `back`, x^T (T_u x T_v). Values are so many blocks, each of which is x.
fn through_factors(factors: &[SubdivisionOperator], values: &[f64], mut outer: usize, back: bool) -> Vec<f64> {
    let mut current = Cow::Borrowed(values);
    for factor in factors {
        current = Cow::Owned(through_factor(factor, &current, outer, back));
        outer *= if back { factor.columns } else { factor.rows };
    }
    current.into_owned()
}

/// The same in one direction.
fn through_factor(factor: &SubdivisionOperator, values: &[f64], outer: usize, back: bool) -> Vec<f64> {
    let (from, to) = if back { (factor.rows, factor.columns) } else { (factor.columns, factor.rows) };
    let (entries, inner) = (factor.entries(), values.len() / (outer * from));
    let mut image = Vec::with_capacity(outer * to * inner);
    if back && from == 4 && (inner == 1 || inner == 4) {
        fours_through_factor(entries, values, inner, &mut image);
        return image;
    }
    for block in values.chunks_exact(from * inner) {
        if back && inner == 1 {
            // The last direction: values to be combined stand side by side, as entries of a column do.
            image.extend(entries.chunks_exact(from).map(|column| product_sum(column, block)));
            continue;
        }
        for target in 0..to {
            let start = image.len();
            image.resize(start + inner, 0.0);
            for (source, part) in block.chunks_exact(inner).enumerate() {
                let entry = if back { entries[target * from + source] } else { entries[source * to + target] };
                if entry != 0.0 {
                    image[start..].iter_mut().zip(part).for_each(|(sum, &x)| *sum += entry * x);
                }
            }
        }
    }
    image
}

/// The same backwards for factors of four rows, as cubic curves and curves through four points have, and single values or four side by side: to the last bit
/// what the general case finds but for the signs of zeros, in registers.
fn fours_through_factor(entries: &[f64], values: &[f64], inner: usize, image: &mut Vec<f64>) {
    let (columns, rows) = (entries.as_chunks::<4>().0, values.as_chunks::<4>().0);
    if inner == 1 {
        for row in rows {
            image.extend(columns.iter().map(|column| {
                let products: [f64; 4] = std::array::from_fn(|k| column[k] * row[k]);
                products[0] + products[1] + (products[2] + products[3])
            }));
        }
        return;
    }
    for block in rows.as_chunks::<4>().0 {
        for column in columns {
            let mut sums = [0.0; 4];
            for (entry, row) in column.iter().zip(block) {
                for k in 0..4 {
                    sums[k] += entry * row[k];
                }
            }
            image.extend(sums);
        }
    }
}

/// A functional on the parent's space that is pulled back by the operators of several children. What those of a product have in common, the first factor
/// of neighbours in lexicographic order, is applied once.
pub(crate) struct PullBack<'a> {
    functional: &'a [f64],
    first: Option<(&'a SubdivisionOperator, Vec<f64>)>,
}

impl<'a> PullBack<'a> {
    pub(crate) fn new(functional: &'a [f64]) -> Self {
        Self { functional, first: None }
    }

    /// As [`SubdivisionOperator::pull_back`], to the last bit.
    pub(crate) fn by(&mut self, operator: &'a SubdivisionOperator) -> Vec<f64> {
        let [first, rest @ ..] = operator.factors() else { return operator.pull_back(self.functional) };
        let image = match self.first.take() {
            Some((known, image)) if known == first => image,
            _ => through_factor(first, self.functional, 1, true),
        };
        let pulled_back = through_factors(rest, &image, first.columns, true);
        self.first = Some((first, image));
        pulled_back
    }
}

/// The sum of products, in four sums side by side: one alone would wait for every addition.
#[inline]
fn product_sum(left: &[f64], right: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (left_parts, right_parts) = (left.chunks_exact(4), right.chunks_exact(4));
    let rest: f64 = left_parts.remainder().iter().zip(right_parts.remainder()).map(|(x, y)| x * y).sum();
    for (left, right) in left_parts.zip(right_parts) {
        for k in 0..4 {
            sums[k] += left[k] * right[k];
        }
    }
    sums[0] + sums[1] + (sums[2] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn operator(rows: usize, columns: usize, seed: f64) -> SubdivisionOperator {
        let entry = |index: usize| ((index as f64 + 1.0) * seed).sin();
        SubdivisionOperator::exact(rows, (0..rows * columns).map(entry).collect())
    }

    #[test]
    fn products_are_applied_and_multiplied_by_their_factors() {
        let left = [operator(3, 2, 1.1), operator(4, 4, 0.7), operator(2, 1, 2.3)];
        let right = [operator(2, 2, 0.3), operator(4, 3, 1.9)];
        let (a, b) = (SubdivisionOperator::product(left.to_vec()), SubdivisionOperator::product(right.to_vec()));
        assert_eq!((a.rows(), a.columns(), b.columns()), (24, 8, 6));
        let dense = |operator: &SubdivisionOperator| SubdivisionOperator::exact(operator.rows(), operator.entries().to_vec());
        let product = a.times(&b);
        assert_eq!(product.factors().len(), 3, "the factor of one column stays");
        let expected = dense(&a).times(&dense(&b));
        let off = product.entries().iter().zip(expected.entries()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        assert!(off < 1e-14, "{off}");
        let point: Vec<f64> = (0..8).map(|k| f64::from(k).cos()).collect();
        let off = a.apply(&point).iter().zip(dense(&a).apply(&point)).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        assert!(off < 1e-14, "{off}");
        // Factors of four rows go a way of their own.
        let fours = [operator(4, 4, 1.3), operator(4, 3, 0.9)];
        for (first, second) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let product = SubdivisionOperator::product(vec![fours[first].clone(), fours[second].clone()]);
            let functional: Vec<f64> = (0..16).map(|k| f64::from(k).cos()).collect();
            let (found, expected) = (product.pull_back(&functional), dense(&product).pull_back(&functional));
            assert!(found.iter().zip(expected).all(|(x, y)| (x - y).abs() < 1e-14));
        }
        // c (T x) = (c T) x, formed or not.
        let functional: Vec<f64> = (0..24).map(|k| f64::from(k).sin()).collect();
        let value = |functional: &[f64], point: &[f64]| functional.iter().zip(point).map(|(c, x)| c * x).sum::<f64>();
        for operator in [&a, &dense(&a)] {
            let off = value(&operator.pull_back(&functional), &point) - value(&functional, &a.apply(&point));
            assert!(off.abs() < 1e-14, "{off}");
        }
    }

    #[test]
    fn what_children_share_changes_no_bit() {
        let (first, second) = ([operator(3, 3, 1.1), operator(3, 2, 0.7)], [operator(4, 4, 2.3), operator(4, 3, 0.3)]);
        let pair = |u: usize, v: usize| SubdivisionOperator::product(vec![first[u].clone(), second[v].clone()]);
        let children = [pair(0, 0), pair(0, 1), pair(1, 0), pair(1, 1), operator(12, 5, 1.7), pair(0, 1)];
        let functional: Vec<f64> = (0..12).map(|k| f64::from(k).sin()).collect();
        let mut shared = PullBack::new(&functional);
        for child in &children {
            assert_eq!(shared.by(child), child.pull_back(&functional));
        }
    }
}
