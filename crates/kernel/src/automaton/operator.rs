//! Matrices between barycentric spaces.

/// A matrix T whose columns are points of the parent's barycentric space: column j holds the
/// barycentric coordinates of the child's control point j, so `P T` are the child's control points.
///
/// Shape n x m (parent x child), column-major. Invariant: finite entries, every column sums to 1
/// within [`COLUMN_SUM_CORRECTED`] before construction and exactly (to rounding) after it.
#[derive(Clone, Debug, PartialEq)]
pub struct SubdivisionOperator {
    rows: usize,
    columns: usize,
    entries: Vec<f64>,
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
        let mut operator = Self { rows, columns, entries };
        let mut corrected = 0.0_f64;
        for column in 0..columns {
            let values = &mut operator.entries[column * rows..(column + 1) * rows];
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
        Ok((operator, corrected))
    }

    /// An operator whose columns sum to 1 by construction: from a formula, or a product of operators.
    pub(crate) fn exact(rows: usize, entries: Vec<f64>) -> Self {
        debug_assert_eq!(entries.len() % rows, 0);
        Self { rows, columns: entries.len() / rows, entries }
    }

    /// The identity of size n.
    #[must_use]
    pub fn identity(n: usize) -> Self {
        let mut entries = vec![0.0; n * n];
        (0..n).for_each(|i| entries[i * n + i] = 1.0);
        Self { rows: n, columns: n, entries }
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
        self.entries[column * self.rows + row]
    }

    /// Column j: a point of the parent's barycentric space.
    #[must_use]
    pub fn column(&self, column: usize) -> &[f64] {
        &self.entries[column * self.rows..(column + 1) * self.rows]
    }

    /// All entries, column after column.
    #[must_use]
    pub fn entries(&self) -> &[f64] {
        &self.entries
    }

    /// T x for a point x of the child's space.
    #[must_use]
    pub fn apply(&self, point: &[f64]) -> Vec<f64> {
        let mut image = vec![0.0; self.rows];
        for (column, &weight) in point.iter().enumerate() {
            for (sum, &entry) in image.iter_mut().zip(self.column(column)) {
                *sum += entry * weight;
            }
        }
        image
    }

    /// The product `self * other`, n x the other's columns.
    #[must_use]
    pub fn times(&self, other: &Self) -> Self {
        Self::exact(self.rows, (0..other.columns).flat_map(|column| self.apply(other.column(column))).collect())
    }

    /// Whether no entry is negative (beyond rounding): such operators keep cells in the convex
    /// hull of their control points.
    #[must_use]
    pub fn is_nonnegative(&self) -> bool {
        self.entries.iter().all(|&entry| entry >= -1e-15)
    }
}
