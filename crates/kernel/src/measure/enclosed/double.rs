//! Numbers of twice the digits of a double: sums of two doubles that are not carried out (Dekker, "A floating-point technique for extending
//! the available precision", Numer. Math. 18, 1971). Sums and products are off by a few 2^-104 of their terms.

use std::ops::{Add, Mul};

/// high + low, with |low| at most half a unit in the last place of high.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Double {
    pub(super) high: f64,
    pub(super) low: f64,
}

/// Relative rounding of one operation, generously.
pub(super) const UNIT: f64 = 1e-30;

/// a + b exactly, for any a and b.
fn exact_sum(a: f64, b: f64) -> Double {
    let high = a + b;
    let part = high - a;
    Double { high, low: (a - (high - part)) + (b - part) }
}

/// a b exactly: both are split into halves of 26 bits.
fn exact_product(a: f64, b: f64) -> Double {
    let split = |x: f64| {
        let scaled = 134_217_729.0 * x;
        let high = scaled - (scaled - x);
        (high, x - high)
    };
    let high = a * b;
    let ((a1, a2), (b1, b2)) = (split(a), split(b));
    Double { high, low: ((a1 * b1 - high) + a1 * b2 + a2 * b1) + a2 * b2 }
}

impl Double {
    /// a / b.
    pub(super) fn quotient(a: f64, b: f64) -> Self {
        let high = a / b;
        let product = exact_product(high, b);
        exact_sum(high, ((a - product.high) - product.low) / b)
    }
}

impl From<f64> for Double {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl Add for Double {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let (high, low) = (exact_sum(self.high, other.high), exact_sum(self.low, other.low));
        let sum = exact_sum(high.high, high.low + low.high);
        exact_sum(sum.high, sum.low + low.low)
    }
}

impl Mul for Double {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let product = exact_product(self.high, other.high);
        exact_sum(product.high, product.low + (self.high * other.low + self.low * other.high))
    }
}

/// What forms are computed in: doubles to find them, [`Double`] to say how far off they are.
pub(super) trait Number: Copy + Default + Add<Output = Self> + Mul<Output = Self> {
    /// The nearest number of this kind.
    fn of(value: Double) -> Self;
}

impl Number for f64 {
    fn of(value: Double) -> Self {
        value.high
    }
}

impl Number for Double {
    fn of(value: Double) -> Self {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_beyond_a_double() {
        let zero = Double::from(3.0) * Double::quotient(1.0, 3.0) + Double::from(-1.0);
        assert!(zero.high.abs() < UNIT, "{zero:?}");
        // (1 + 2^-60)^2 - 1 - 2^-59 = 2^-120.
        let tiny = Double { high: 1.0, low: 2f64.powi(-60) };
        let rest = tiny * tiny + Double::from(-1.0) + Double::from(-(2f64.powi(-59)));
        assert!((rest.high - 2f64.powi(-120)).abs() < UNIT, "{rest:?}");
    }
}
