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

    /// An upper bound of the spectral norm, nearly always tight to 1e-6: with N = A^T A (or A A^T, the
    /// smaller), |A|^2 = rho(N) is at most N's largest absolute row sum (exact for similarities), and at most
    /// s when s I - N is positive semidefinite, which a Cholesky factorisation decides.
    ///
    /// Sound under rounding. With u = 2^-53, the computed N is within 2 n u |A|_F^2 of the exact one, and a
    /// Cholesky factorisation of M that runs to its end proves M >= -2 (n + 2) u trace(|M|) (Rump, "Verification
    /// of positive definiteness", BIT 46, 2006); both are added to s. Entries are scaled by a power of two, so
    /// that no square underflows.
    pub fn norm_bound(&self) -> f64 {
        let largest = self.entries.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        if !(largest > 0.0 && largest.is_finite()) || self.entries.iter().any(|x| x.is_nan()) {
            return if largest == 0.0 && self.entries.iter().all(|x| *x == 0.0) { 0.0 } else { f64::INFINITY };
        }
        let unit = largest.log2().floor().clamp(-1000.0, 1000.0).exp2();
        let mut scaled = self.clone();
        scaled.scale(1.0 / unit);
        let transposed = scaled.transpose();
        let gram = if self.columns <= self.rows { transposed.times(&scaled) } else { scaled.times(&transposed) };
        let n = gram.rows;
        let trace: f64 = (0..n).map(|i| gram.at(i, i)).sum();
        let slack = 8.0 * (self.rows.max(self.columns) + 4) as f64 * f64::EPSILON * trace;
        let row_sum = (0..n).map(|row| (0..n).map(|c| gram.at(row, c).abs()).sum::<f64>()).fold(0.0, f64::max);
        let ceiling = row_sum.min(trace);
        let guess = gram.largest_eigenvalue();
        let square = [1e-13, 1e-10, 1e-7, 1e-5, 1e-3, 1e-2, 3e-2, 0.1, 0.3]
            .iter()
            .map(|excess| guess * (1.0 + excess))
            .take_while(|&square| square < ceiling)
            .find(|&square| gram.is_below(square))
            // What the test itself may lose: 2 (n + 2) u times the trace of |s I - N|.
            .map_or(ceiling, |square| square + 4.0 * (n + 2) as f64 * f64::EPSILON * (n as f64 * square + trace));
        (square + slack).sqrt() * (1.0 + 4.0 * f64::EPSILON) * unit
    }

    /// A guess, from below, of the largest eigenvalue of a positive semidefinite matrix: 64 steps of the power
    /// method, three squarings of them at once.
    fn largest_eigenvalue(&self) -> f64 {
        let n = self.rows;
        let mut power = self.clone();
        for _ in 0..3 {
            let size = power.frobenius();
            power.scale(1.0 / size);
            power = power.times(&power);
        }
        let apply = |matrix: &Self, x: &[f64]| -> Vec<f64> {
            let mut image = vec![0.0; n];
            for (column, &weight) in matrix.entries.chunks_exact(n).zip(x) {
                image.iter_mut().zip(column).for_each(|(sum, &entry)| *sum += entry * weight);
            }
            image
        };
        let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
        // The longest column of the power is already near the leading eigenvector.
        let start = power.entries.chunks_exact(n).max_by(|a, b| norm(a).total_cmp(&norm(b))).map(<[f64]>::to_vec);
        let Some(mut x) = start else { return 0.0 };
        for _ in 0..8 {
            let size = norm(&x);
            if size <= 0.0 {
                return 0.0;
            }
            x.iter_mut().for_each(|x| *x /= size);
            x = apply(&power, &x);
        }
        let (size, image) = (norm(&x), apply(self, &x));
        if size > 0.0 { norm(&image) / size } else { 0.0 }
    }

    /// Whether a Cholesky factorisation of `level I - self` runs to its end.
    fn is_below(&self, level: f64) -> bool {
        let mut shifted = self.clone();
        shifted.entries.iter_mut().for_each(|entry| *entry = -*entry);
        (0..self.rows).for_each(|i| *shifted.at_mut(i, i) += level);
        shifted.cholesky().is_some()
    }

    /// The norm of the operator on the zero-sum subspace, for the 1-norm: half the largest distance of two
    /// columns, because the unit ball there has the corners (e_j - e_k) / 2. Rounded upward.
    pub fn column_difference(&self) -> f64 {
        let column = |j: usize| &self.entries[j * self.rows..(j + 1) * self.rows];
        let mut largest = 0.0_f64;
        for j in 0..self.columns {
            for k in 0..j {
                largest = largest.max(column(j).iter().zip(column(k)).map(|(a, b)| (a - b).abs()).sum());
            }
        }
        // Each difference and each of at most n additions rounds by half a unit.
        0.5 * largest * (1.0 + (self.rows + 2) as f64 * f64::EPSILON)
    }

    /// The largest 1-norm of a column, rounded upward.
    pub fn column_sum(&self) -> f64 {
        let largest = self.entries.chunks_exact(self.rows.max(1)).map(|column| column.iter().map(|x| x.abs()).sum()).fold(0.0, f64::max);
        largest * (1.0 + (self.rows + 2) as f64 * f64::EPSILON)
    }

    /// The spectral radius of a square matrix when it exceeds `floor`, to about 1e-10 relative: |A^(2^40)|^(1/2^40)
    /// by repeated squaring with the scale kept apart, given up as soon as |A^(2^k)|^(1/2^k), which is never below
    /// the radius, is at most `floor`. The error of |A^k|^(1/k) is at most (C k^n)^(1/k) - 1, far below rounding for
    /// k = 2^40. Rounding perturbs A by a few units in the last place of its norm: the number is the radius of a
    /// matrix that near, which for a defective eigenvalue may be further off than 1e-10.
    pub fn spectral_radius_above(&self, floor: f64) -> Option<f64> {
        let mut power = self.clone();
        let (mut log_scale, mut exponent) = (0.0_f64, 1.0_f64);
        for _ in 0..40 {
            let size = power.frobenius();
            if !(size > 0.0 && size.is_finite()) {
                return (size != 0.0).then_some(f64::INFINITY);
            }
            power.scale(1.0 / size);
            log_scale += size.ln() / exponent;
            if log_scale.exp() <= floor {
                return None;
            }
            power = power.times(&power);
            exponent *= 2.0;
        }
        let size = power.frobenius();
        let radius = if size > 0.0 { (log_scale + size.ln() / exponent).exp() } else { 0.0 };
        (radius > floor).then_some(radius)
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
        assert!((rotation.spectral_radius_above(0.0).expect("positive") - 0.5).abs() < 1e-10);
        assert_eq!(rotation.spectral_radius_above(0.51), None);
        let nilpotent = Dense { rows: 2, columns: 2, entries: vec![0.0, 0.0, 1.0, 0.0] };
        assert_eq!(nilpotent.spectral_radius_above(0.0), None);
        let shear = Dense { rows: 2, columns: 2, entries: vec![0.5, 0.0, 1.0, 0.5] };
        assert!((shear.spectral_radius_above(0.4).expect("above") - 0.5).abs() < 1e-9);
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
