//! Numbers of twice the precision, for sums whose terms cancel: an unevaluated sum of two numbers of double precision.
//!
//! With u = 2^-53, a sum is within 3 u^2 of the exact one, a product within 7 u^2 and a quotient within 16 u^2, relative to the result (M. Joldes, J.-M. Muller,
//! V. Popescu, "Tight and rigorous error bounds for basic building blocks of double-word arithmetic", ACM Trans. Math. Softw. 44, 2017, algorithms 6, 10 or better,
//! and 17), where nothing overflows or underflows. What overflows is no number in the end.

use glam::DVec3;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// high + low, with |low| at most half a unit in the last place of high.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Double {
    high: f64,
    low: f64,
}

/// a + b = sum + error (Knuth).
#[inline]
fn two_sum(a: f64, b: f64) -> Double {
    let high = a + b;
    let shifted = high - a;
    Double { high, low: (a - (high - shifted)) + (b - shifted) }
}

/// The same where |a| is not less than |b| (Dekker).
#[inline]
fn fast_two_sum(a: f64, b: f64) -> Double {
    let high = a + b;
    Double { high, low: b - (high - a) }
}

/// The upper 26 digits of a number and the rest (Veltkamp).
#[inline]
fn split(a: f64) -> (f64, f64) {
    let shifted = 134_217_729.0 * a;
    let high = shifted - (shifted - a);
    (high, a - high)
}

/// a b = product + error (Dekker). No fused operation: processors without one would take a hundred times longer.
#[inline]
fn two_product(a: f64, b: f64) -> Double {
    let high = a * b;
    let ((a, below_a), (b, below_b)) = (split(a), split(b));
    Double { high, low: ((a * b - high) + a * below_b + below_a * b) + below_a * below_b }
}

impl Double {
    /// Exactly a - b.
    #[inline]
    pub(super) fn difference(a: f64, b: f64) -> Self {
        two_sum(a, -b)
    }

    /// The nearest number of double precision.
    #[inline]
    pub(super) fn nearest(self) -> f64 {
        self.high
    }
}

impl From<f64> for Double {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl Neg for Double {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }
}

impl Add for Double {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        let (high, low) = (two_sum(self.high, other.high), two_sum(self.low, other.low));
        let sum = fast_two_sum(high.high, high.low + low.high);
        fast_two_sum(sum.high, low.low + sum.low)
    }
}

impl Sub for Double {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Double {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        let product = two_product(self.high, other.high);
        fast_two_sum(product.high, product.low + (self.high * other.low + self.low * other.high))
    }
}

impl Div for Double {
    type Output = Self;

    #[inline]
    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - Self::from(first) * other;
        fast_two_sum(first, rest.high / other.high)
    }
}

/// A vector of numbers of twice the precision, and its length, or a little more.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vector {
    pub(super) at: [Double; 3],
    pub(super) length: f64,
}

impl Vector {
    /// Exactly to - from.
    pub(super) fn between(from: DVec3, to: DVec3) -> Self {
        let at = std::array::from_fn(|axis| Double::difference(to[axis], from[axis]));
        Self { at, length: (to - from).length() * (1.0 + 4.0 * f64::EPSILON) }
    }

    pub(super) fn cross(&self, other: &Self) -> [Double; 3] {
        let (a, b) = (&self.at, &other.at);
        std::array::from_fn(|axis| {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            a[u] * b[v] - a[v] * b[u]
        })
    }

    pub(super) fn dot(&self, other: &[Double; 3]) -> Double {
        self.at[0] * other[0] + self.at[1] * other[1] + self.at[2] * other[2]
    }
}

/// The normal of a triangle, as long as its area twice: (b - a) x (c - a), to the last digits even where the triangle is a needle.
pub(super) fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    DVec3::from_array(Vector::between(a, b).cross(&Vector::between(a, c)).map(Double::nearest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split_mix::Random;

    /// high + low, where both are whole.
    fn whole(x: Double) -> i128 {
        x.high as i128 + x.low as i128
    }

    fn double(x: i64) -> Double {
        let high = x as f64;
        fast_two_sum(high, (i128::from(x) - high as i128) as f64)
    }

    /// Whole numbers of `digits` binary digits and a sign.
    fn numbers(random: &mut Random, digits: u32) -> [i64; 3] {
        std::array::from_fn(|_| random.next() as i64 >> (63 - digits))
    }

    #[test]
    fn what_has_106_digits_is_exact() {
        let mut random = Random(7);
        for _ in 0..100_000 {
            let [a, b, c] = numbers(&mut random, 60);
            assert_eq!(whole(double(a) + double(b) - double(c)), i128::from(a) + i128::from(b) - i128::from(c));
            let [a, b, c] = numbers(&mut random, 34);
            assert_eq!(whole(double(a) * double(b) * double(c)), i128::from(a) * i128::from(b) * i128::from(c), "{a} {b} {c}");
        }
    }

    #[test]
    fn a_quotient_times_its_divisor_is_what_was_divided() {
        let mut random = Random(8);
        for _ in 0..100_000 {
            let [a, b, _] = numbers(&mut random, 62);
            let off = (double(a) / double(b) * double(b) - double(a)).nearest().abs();
            assert!(off <= 32.0 * (0.5 * f64::EPSILON).powi(2) * (a as f64).abs(), "{a} / {b}: {off}");
        }
    }
}
