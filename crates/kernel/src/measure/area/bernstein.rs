//! Polynomials on the unit square, by their Bernstein coefficients.
//!
//! B_i^m B_j^n = C(m, i) C(n, j) / C(m + n, i + j) B_(i+j)^(m+n): with coefficients that are multiplied by their binomials, products are those of sequences. Coefficients of a product are
//! averages of products of coefficients, sum over i + j = k of C(m, i) C(n, j) being C(m + n, k): none is larger than the largest of the one times the largest of the other, and
//! errors of the factors' coefficients, and roundings, are averaged with the same weights.

/// C(n, k).
pub(super) struct Binomials(Vec<Vec<f64>>);

impl Binomials {
    /// Those of n up to `most`.
    pub(super) fn new(most: usize) -> Self {
        let mut rows = vec![vec![1.0]];
        for n in 1..=most {
            let above: &Vec<f64> = &rows[n - 1];
            let inner = above.windows(2).map(|pair| pair[0] + pair[1]);
            rows.push(std::iter::once(1.0).chain(inner).chain(std::iter::once(1.0)).collect());
        }
        Self(rows)
    }

    fn of(&self, n: usize) -> &[f64] {
        &self.0[n]
    }
}

/// A polynomial with values of N numbers.
#[derive(Clone)]
pub(super) struct Bernstein<const N: usize> {
    pub(super) degrees: [usize; 2],
    /// Coefficients times binomials, the second index fastest.
    scaled: Vec<[f64; N]>,
}

impl<const N: usize> Bernstein<N> {
    /// The polynomial with these coefficients.
    pub(super) fn new([m, n]: [usize; 2], coefficients: impl Iterator<Item = [f64; N]>, binomials: &Binomials) -> Self {
        let (rows, columns) = (binomials.of(m), binomials.of(n));
        let factors = rows.iter().flat_map(|row| columns.iter().map(move |column| row * column));
        Self { degrees: [m, n], scaled: coefficients.zip(factors).map(|(values, factor)| values.map(|x| x * factor)).collect() }
    }

    /// Its coefficients.
    pub(super) fn coefficients(&self, binomials: &Binomials) -> Vec<[f64; N]> {
        let (rows, columns) = (binomials.of(self.degrees[0]), binomials.of(self.degrees[1]));
        let factors = rows.iter().flat_map(|row| columns.iter().map(move |column| row * column));
        self.scaled.iter().zip(factors).map(|(values, factor)| values.map(|x| x / factor)).collect()
    }

    /// The product with another, their values being multiplied by a bilinear map.
    pub(super) fn times<const M: usize, const L: usize>(
        &self,
        other: &Bernstein<M>,
        multiply: impl Fn(&[f64; N], &[f64; M]) -> [f64; L],
    ) -> Bernstein<L> {
        let ([m, n], [k, l]) = (self.degrees, other.degrees);
        let width = n + l + 1;
        let mut scaled = vec![[0.0; L]; (m + k + 1) * width];
        for (row, left) in self.scaled.chunks_exact(n + 1).enumerate() {
            for (below, right) in other.scaled.chunks_exact(l + 1).enumerate() {
                let target = &mut scaled[(row + below) * width..(row + below + 1) * width];
                for (column, a) in left.iter().enumerate() {
                    for (sum, b) in target[column..].iter_mut().zip(right) {
                        sum.iter_mut().zip(multiply(a, b)).for_each(|(sum, x)| *sum += x);
                    }
                }
            }
        }
        Bernstein { degrees: [m + k, n + l], scaled }
    }

    /// The sum of `share` times another of the same degrees and itself.
    pub(super) fn plus(mut self, share: f64, other: &Self) -> Self {
        for (sum, values) in self.scaled.iter_mut().zip(&other.scaled) {
            sum.iter_mut().zip(values).for_each(|(sum, x)| *sum += share * x);
        }
        self
    }

    /// The integral of its squared length over the square: the mean of the coefficients of its square.
    pub(super) fn mean_square(&self, binomials: &Binomials) -> f64 {
        let [m, n] = self.degrees;
        let (rows, columns) = (binomials.of(2 * m), binomials.of(2 * n));
        let mut sum = 0.0;
        let mut weighted = vec![[0.0; N]; n + 1];
        for below in 0..=m {
            weighted.fill([0.0; N]);
            for (row, values) in self.scaled.chunks_exact(n + 1).enumerate() {
                let share = 1.0 / rows[row + below];
                for (total, values) in weighted.iter_mut().zip(values) {
                    total.iter_mut().zip(values).for_each(|(total, x)| *total += share * x);
                }
            }
            let own = &self.scaled[below * (n + 1)..(below + 1) * (n + 1)];
            for (column, values) in weighted.iter().enumerate() {
                for (other, own) in own.iter().enumerate() {
                    sum += values.iter().zip(own).map(|(a, b)| a * b).sum::<f64>() / columns[column + other];
                }
            }
        }
        sum / ((2 * m + 1) * (2 * n + 1)) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_and_integrals_of_powers() {
        let binomials = Binomials::new(16);
        // u^2 v and 1 - u + 2 v, in Bernstein form; their product at (1/2, 1/2) by the mean of its coefficients' binomial weights.
        let square = Bernstein::new([2, 1], [0.0, 0.0, 0.0, 0.0, 0.0, 1.0].map(|x| [x]).into_iter(), &binomials);
        let plane = Bernstein::new([1, 1], [1.0, 3.0, 0.0, 2.0].map(|x| [x]).into_iter(), &binomials);
        let product = square.times(&plane, |a, b| [a[0] * b[0]]);
        assert_eq!(product.degrees, [3, 2]);
        let mean = |polynomial: &Bernstein<1>| {
            let coefficients = polynomial.coefficients(&binomials);
            coefficients.iter().map(|x| x[0]).sum::<f64>() / coefficients.len() as f64
        };
        // The integral of u^2 v (1 - u + 2 v): 1/6 - 1/8 + 2/9, and that of u^4 v^2.
        assert!((mean(&product) - (1.0 / 6.0 - 1.0 / 8.0 + 2.0 / 9.0)).abs() < 1e-15);
        assert!((square.mean_square(&binomials) - 1.0 / 15.0).abs() < 1e-16);
        assert!((plane.clone().plus(-1.0, &plane).mean_square(&binomials)).abs() < 1e-300);
    }
}
