//! Small dense matrices: just what the convergence test needs.

/// A dense matrix, column-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Dense {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Entries, column after column.
    pub entries: Vec<f64>,
}

impl Dense {
    /// All zero.
    pub fn zero(rows: usize, columns: usize) -> Self {
        Self { rows, columns, entries: vec![0.0; rows * columns] }
    }

    /// The identity.
    pub fn identity(n: usize) -> Self {
        let mut matrix = Self::zero(n, n);
        (0..n).for_each(|i| *matrix.at_mut(i, i) = 1.0);
        matrix
    }

    /// Entry (i, j).
    pub fn at(&self, row: usize, column: usize) -> f64 {
        self.entries[column * self.rows + row]
    }

    /// Entry (i, j), to change.
    pub fn at_mut(&mut self, row: usize, column: usize) -> &mut f64 {
        &mut self.entries[column * self.rows + row]
    }

    /// The product `self * other`.
    pub fn times(&self, other: &Self) -> Self {
        let mut product = Self::zero(self.rows, other.columns);
        for column in 0..other.columns {
            for inner in 0..self.columns {
                let weight = other.at(inner, column);
                if weight != 0.0 {
                    let source = &self.entries[inner * self.rows..(inner + 1) * self.rows];
                    let target = &mut product.entries[column * self.rows..(column + 1) * self.rows];
                    target.iter_mut().zip(source).for_each(|(sum, &entry)| *sum += entry * weight);
                }
            }
        }
        product
    }

    /// The transpose.
    pub fn transpose(&self) -> Self {
        let mut result = Self::zero(self.columns, self.rows);
        for column in 0..self.columns {
            for row in 0..self.rows {
                *result.at_mut(column, row) = self.at(row, column);
            }
        }
        result
    }

    /// `self^T metric self`.
    pub fn transpose_congruence(&self, metric: &Self) -> Self {
        self.transpose().times(&metric.times(self))
    }

    /// The Frobenius norm.
    pub fn frobenius(&self) -> f64 {
        self.entries.iter().map(|entry| entry * entry).sum::<f64>().sqrt()
    }

    fn scale(&mut self, factor: f64) {
        self.entries.iter_mut().for_each(|entry| *entry *= factor);
    }

    /// An upper bound of the spectral norm, tight to 2 %: with N = A^T A (or A A^T, the smaller),
    /// |A|^2 = rho(N) is at most N's largest absolute row sum (exact for similarities) and at most
    /// |N^(2^k)|_F^(1/2^k), whose excess is at most n^(1/2^(k+1)).
    pub fn norm_bound(&self) -> f64 {
        let transposed = self.transpose();
        let mut power = if self.columns <= self.rows { transposed.times(self) } else { self.times(&transposed) };
        let row_sum = (0..power.rows).map(|row| (0..power.rows).map(|c| power.at(row, c).abs()).sum::<f64>()).fold(0.0, f64::max);
        let (mut log_scale, mut exponent) = (0.0_f64, 1.0_f64);
        for _ in 0..6 {
            let size = power.frobenius();
            if size == 0.0 {
                return 0.0;
            }
            power.scale(1.0 / size);
            log_scale += size.ln() / exponent;
            power = power.times(&power);
            exponent *= 2.0;
        }
        let log_norm = log_scale + power.frobenius().ln() / exponent;
        (0.5 * log_norm).exp().min(row_sum.sqrt()) * (1.0 + 1e-12)
    }

    /// The spectral radius of a square matrix, to about 1e-10 relative: |A^(2^40)|^(1/2^40) by
    /// repeated squaring with the scale kept apart. The error of |A^k|^(1/k) is at most
    /// (C k^n)^(1/k) - 1, far below rounding for k = 2^40.
    pub fn spectral_radius(&self) -> f64 {
        let mut power = self.clone();
        let (mut log_scale, mut exponent) = (0.0_f64, 1.0_f64);
        for _ in 0..40 {
            let size = power.frobenius();
            if !(size > 0.0 && size.is_finite()) {
                return if size == 0.0 { 0.0 } else { f64::INFINITY };
            }
            power.scale(1.0 / size);
            log_scale += size.ln() / exponent;
            power = power.times(&power);
            exponent *= 2.0;
        }
        match power.frobenius() {
            0.0 => 0.0,
            size => (log_scale + size.ln() / exponent).exp(),
        }
    }

    /// The upper triangular Cholesky factor C with `self = C^T C`, when positive definite.
    pub fn cholesky(&self) -> Option<Self> {
        let n = self.rows;
        let mut factor = Self::zero(n, n);
        for i in 0..n {
            let diagonal = self.at(i, i) - (0..i).map(|k| factor.at(k, i).powi(2)).sum::<f64>();
            if diagonal <= 0.0 || !diagonal.is_finite() {
                return None;
            }
            *factor.at_mut(i, i) = diagonal.sqrt();
            for j in i + 1..n {
                let sum = self.at(i, j) - (0..i).map(|k| factor.at(k, i) * factor.at(k, j)).sum::<f64>();
                *factor.at_mut(i, j) = sum / factor.at(i, i);
            }
        }
        Some(factor)
    }

    /// The inverse of an upper triangular matrix with a non-zero diagonal.
    pub fn inverse_upper(&self) -> Self {
        let n = self.rows;
        let mut inverse = Self::zero(n, n);
        for column in 0..n {
            *inverse.at_mut(column, column) = 1.0 / self.at(column, column);
            for row in (0..column).rev() {
                let sum: f64 = (row + 1..=column).map(|k| self.at(row, k) * inverse.at(k, column)).sum();
                *inverse.at_mut(row, column) = -sum / self.at(row, row);
            }
        }
        inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Dense {
        Dense { rows: 3, columns: 3, entries: vec![0.5, 0.1, -0.2, 0.3, 0.4, 0.7, -0.6, 0.2, 0.9] }
    }

    #[test]
    fn spectral_radius_of_a_rotation_and_a_nilpotent() {
        let (sin, cos) = 0.7_f64.sin_cos();
        let rotation = Dense { rows: 2, columns: 2, entries: vec![0.5 * cos, 0.5 * sin, -0.5 * sin, 0.5 * cos] };
        assert!((rotation.spectral_radius() - 0.5).abs() < 1e-10);
        let nilpotent = Dense { rows: 2, columns: 2, entries: vec![0.0, 0.0, 1.0, 0.0] };
        assert_eq!(nilpotent.spectral_radius(), 0.0);
        let shear = Dense { rows: 2, columns: 2, entries: vec![0.5, 0.0, 1.0, 0.5] };
        assert!((shear.spectral_radius() - 0.5).abs() < 1e-9);
    }

    #[test]
    fn norm_bound_is_above_every_image_and_tight() {
        let matrix = example();
        let bound = matrix.norm_bound();
        let mut largest = 0.0_f64;
        for i in 0..60 {
            for j in 0..60 {
                let (theta, phi) = (f64::from(i) * 0.0525, f64::from(j) * 0.1048);
                let x = [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()];
                let image: f64 = (0..3).map(|row| (0..3).map(|c| matrix.at(row, c) * x[c]).sum::<f64>().powi(2)).sum();
                largest = largest.max(image.sqrt());
            }
        }
        assert!(bound >= largest && bound <= 1.03 * largest, "{bound} {largest}");
    }

    #[test]
    fn cholesky_and_inverse() {
        let square = example().transpose().times(&example());
        let factor = square.cholesky().expect("positive definite");
        let again = factor.transpose().times(&factor);
        let product = factor.times(&factor.inverse_upper());
        for i in 0..9 {
            assert!((again.entries[i] - square.entries[i]).abs() < 1e-12);
            assert!((product.entries[i] - Dense::identity(3).entries[i]).abs() < 1e-12);
        }
    }
}
