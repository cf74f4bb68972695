//! De Casteljau's algorithm at 1/2: the halves of a Bezier curve.

use crate::automaton::SubdivisionOperator;

/// The control points of both halves, of those of a curve and the middle of two points.
///
/// # Panics
/// Without points.
pub(crate) fn halves<T: Copy>(points: &[T], middle: impl Fn(T, T) -> T) -> [Vec<T>; 2] {
    let (mut first, mut second) = (Vec::with_capacity(points.len()), points.to_vec());
    for length in (0..points.len()).rev() {
        first.push(second[0]);
        (0..length).for_each(|k| second[k] = middle(second[k], second[k + 1]));
    }
    [first, second]
}

/// The same as operators on n control points: row k is what point k alone becomes.
pub(crate) fn operators(n: usize) -> [SubdivisionOperator; 2] {
    let mut entries = [vec![0.0; n * n], vec![0.0; n * n]];
    for k in 0..n {
        let alone: Vec<f64> = (0..n).map(|j| f64::from(u8::from(j == k))).collect();
        for (entries, row) in entries.iter_mut().zip(halves(&alone, |a, b| 0.5 * (a + b))) {
            row.into_iter().enumerate().for_each(|(j, share)| entries[j * n + k] = share);
        }
    }
    entries.map(|entries| SubdivisionOperator::exact(n, entries))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_of_a_cubic_are_those_of_its_polynomial() {
        // x^3 on [0, 1], and on both halves as polynomials of 2 x and 2 x - 1.
        let [first, second] = halves(&[0.0, 0.0, 0.0, 1.0], |a, b| 0.5 * (a + b));
        assert_eq!(first, [0.0, 0.0, 0.0, 0.125]);
        assert_eq!(second, [0.125, 0.25, 0.5, 1.0]);
    }

    #[test]
    fn columns_are_binomials() {
        let [left, right] = operators(40);
        let mut binomial = 0.5_f64.powi(39);
        for k in 0..40 {
            assert!((left.entry(k, 39) - binomial).abs() <= 1e-14 * binomial);
            assert_eq!(right.entry(39 - k, 0), left.entry(k, 39));
            binomial *= (39 - k) as f64 / (k + 1) as f64;
        }
    }
}
