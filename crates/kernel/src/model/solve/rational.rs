//! Rational numbers, fast while they are small, and long floating numbers when they outgrow what their inputs mean.

use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{FromPrimitive, ToPrimitive, Zero};
use std::fmt;

/// An exact number p/q in lowest terms, q > 0. When p and q together outgrow 256 bits, which takes dozens of operations
/// on numbers of all digits, it goes on as a floating number of 256 significant bits (a relative error of 1e-77 in
/// each operation): such inputs are rounded themselves, by 1e-16.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Rational(Repr);

/// Invariant: `Small` whenever numerator and denominator fit, so equality is structural.
#[derive(Clone, PartialEq, Eq, Debug)]
enum Repr {
    Small(i64, i64),
    Big(Box<BigRational>),
    /// mantissa * 2^exponent, not 0.
    Float(Box<(BigInt, i64)>),
}

/// Bits of numerator and denominator that stay exact.
const EXACT_BITS: u64 = 256;
/// Significant bits of floating numbers.
const FLOAT_BITS: u64 = 256;

/// Magnitudes for which the interval of half a unit in the last place fits 128 bits.
const SIMPLE: std::ops::Range<f64> = 1e-9..1e9;

impl Rational {
    /// 0.
    pub const ZERO: Self = Self(Repr::Small(0, 1));
    /// 1.
    pub const ONE: Self = Self(Repr::Small(1, 1));

    /// The simplest rational that rounds to `value`: 0.1 is 1/10, 0.333333333333333315 is 1/3. Magnitudes outside
    /// 1e-9 to 1e9 are taken exactly. `None` unless finite.
    #[must_use]
    pub fn simplest(value: f64) -> Option<Self> {
        if value == 0.0 {
            return Some(Self::ZERO);
        }
        if SIMPLE.contains(&value.abs()) {
            // Half a unit in the last place to both sides, and less where that rounds to a neighbour (below a power of
            // two, and at the very ends of the interval).
            for quarters in [2, 1] {
                let (numerator, denominator) = simplest_between(value.abs(), quarters);
                let simple = Self::small(if value < 0.0 { -numerator } else { numerator }, denominator);
                if simple.to_f64() == value {
                    return Some(simple);
                }
            }
        }
        BigRational::from_f64(value).map(Self::big)
    }

    fn small(numerator: i128, denominator: i128) -> Self {
        let divisor = gcd(numerator.unsigned_abs(), denominator.unsigned_abs()).max(1);
        let sign = if denominator < 0 { -1 } else { 1 };
        let divisor = i128::try_from(divisor).unwrap_or(1);
        let (numerator, denominator) = (sign * (numerator / divisor), sign * (denominator / divisor));
        match (i64::try_from(numerator), i64::try_from(denominator)) {
            (Ok(p), Ok(q)) => Self(Repr::Small(p, q)),
            _ => Self(Repr::Big(Box::new(BigRational::new(numerator.into(), denominator.into())))),
        }
    }

    fn big(value: BigRational) -> Self {
        match (value.numer().to_i64(), value.denom().to_i64()) {
            (Some(p), Some(q)) => Self(Repr::Small(p, q)),
            _ if value.numer().bits() + value.denom().bits() > EXACT_BITS => Self::float(divided(&value)),
            _ => Self(Repr::Big(Box::new(value))),
        }
    }

    /// Rounds towards zero.
    fn float((mantissa, exponent): (BigInt, i64)) -> Self {
        if mantissa.is_zero() {
            return Self::ZERO;
        }
        let excess = mantissa.bits().saturating_sub(FLOAT_BITS);
        let cut = if excess > 0 { mantissa / (BigInt::from(1) << excess) } else { mantissa };
        Self(Repr::Float(Box::new((cut, exponent + excess as i64))))
    }

    /// As mantissa and exponent.
    fn floated(&self) -> (BigInt, i64) {
        match &self.0 {
            Repr::Small(p, 1) => (BigInt::from(*p), 0),
            Repr::Small(..) => divided(&self.widened()),
            Repr::Big(value) => divided(value),
            Repr::Float(value) => (**value).clone(),
        }
    }

    fn is_float(&self) -> bool {
        matches!(self.0, Repr::Float(_))
    }

    fn widened(&self) -> BigRational {
        match &self.0 {
            // A small one is in lowest terms with a positive denominator.
            Repr::Small(p, q) => BigRational::new_raw(BigInt::from(*p), BigInt::from(*q)),
            Repr::Big(value) => (**value).clone(),
            Repr::Float(value) => {
                let power = BigInt::from(1) << value.1.unsigned_abs();
                if value.1 >= 0 { BigRational::from_integer(&value.0 * power) } else { BigRational::new(value.0.clone(), power) }
            }
        }
    }

    /// Whether it is 0.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        matches!(self.0, Repr::Small(0, _))
    }

    /// Whether it is 1.
    #[must_use]
    pub fn is_one(&self) -> bool {
        matches!(self.0, Repr::Small(1, 1))
    }

    /// The nearest double.
    #[must_use]
    pub fn to_f64(&self) -> f64 {
        const EXACT: std::ops::RangeInclusive<i64> = -(1 << 53)..=1 << 53;
        match &self.0 {
            Repr::Small(p, q) if EXACT.contains(p) && EXACT.contains(q) => *p as f64 / *q as f64,
            Repr::Float(value) => {
                // The leading 64 bits, scaled in two steps so that neither power overflows.
                let excess = value.0.bits().saturating_sub(64);
                let leading = (&value.0 >> excess).to_f64().unwrap_or(f64::NAN);
                let exponent = (value.1 + excess as i64).clamp(-2200, 2200) as i32;
                leading * 2f64.powi(exponent / 2) * 2f64.powi(exponent - exponent / 2)
            }
            _ => self.widened().to_f64().unwrap_or(f64::NAN),
        }
    }

    /// Digits of 64 bits: the cost of one operation.
    pub(super) fn size(&self) -> u64 {
        match &self.0 {
            Repr::Small(..) => 1,
            Repr::Big(value) => 2 + (value.numer().bits() + value.denom().bits()) / 16,
            Repr::Float(_) => 3,
        }
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        if let (Repr::Small(p, q), Repr::Small(r, s)) = (&self.0, &other.0) {
            if q == s {
                return Self::small(i128::from(*p) + i128::from(*r), i128::from(*q));
            }
            let [p, q, r, s] = [*p, *q, *r, *s].map(i128::from);
            // Each product is below 2^126, so the sum is below 2^127.
            return Self::small(p * s + r * q, q * s);
        }
        if self.is_zero() {
            return other.clone();
        }
        if self.is_float() || other.is_float() {
            let ((a, i), (b, j)) = (self.floated(), other.floated());
            // What lies wholly below the other's last bit does not count.
            if i + a.bits() as i64 + FLOAT_BITS as i64 + 2 < j || b.is_zero() {
                return if b.is_zero() { self.clone() } else { Self::float((b, j)) };
            }
            if j + b.bits() as i64 + FLOAT_BITS as i64 + 2 < i {
                return Self::float((a, i));
            }
            let low = i.min(j);
            return Self::float(((a << (i - low).unsigned_abs()) + (b << (j - low).unsigned_abs()), low));
        }
        Self::big(self.widened() + other.widened())
    }

    pub(super) fn times(&self, other: &Self) -> Self {
        if let (Repr::Small(p, q), Repr::Small(r, s)) = (&self.0, &other.0) {
            return Self::small(i128::from(*p) * i128::from(*r), i128::from(*q) * i128::from(*s));
        }
        if self.is_float() || other.is_float() {
            let ((a, i), (b, j)) = (self.floated(), other.floated());
            return Self::float((a * b, i + j));
        }
        Self::big(self.widened() * other.widened())
    }

    pub(super) fn negated(&self) -> Self {
        match &self.0 {
            Repr::Small(p, q) => Self::small(-i128::from(*p), i128::from(*q)),
            Repr::Big(value) => Self::big(-(**value).clone()),
            Repr::Float(value) => Self(Repr::Float(Box::new((-&value.0, value.1)))),
        }
    }

    /// 1 / self, which must not be 0.
    pub(super) fn inverse(&self) -> Self {
        match &self.0 {
            Repr::Small(p, q) => Self::small(i128::from(*q), i128::from(*p)),
            Repr::Big(value) => Self::big(value.recip()),
            Repr::Float(value) => {
                let shift = 2 * FLOAT_BITS;
                Self::float(((BigInt::from(1) << shift) / &value.0, -value.1 - shift as i64))
            }
        }
    }

    /// |self| as a double; never 0 unless it is 0.
    pub(super) fn magnitude(&self) -> f64 {
        let size = self.to_f64().abs();
        if size == 0.0 && !self.is_zero() { f64::MIN_POSITIVE } else { size }
    }
}

/// A quotient as mantissa and exponent, to 256 bits and more.
fn divided(value: &BigRational) -> (BigInt, i64) {
    let shift = FLOAT_BITS + 1 + value.denom().bits();
    ((value.numer() << shift) / value.denom(), -(shift as i64))
}

impl From<i64> for Rational {
    fn from(value: i64) -> Self {
        Self(Repr::Small(value, 1))
    }
}

/// `p/q`; a decimal where the fraction outgrew its limit.
impl fmt::Display for Rational {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Repr::Small(p, 1) => p.fmt(formatter),
            Repr::Small(p, q) => write!(formatter, "{p}/{q}"),
            Repr::Big(value) => value.fmt(formatter),
            Repr::Float(_) => write!(formatter, "{:e}", self.to_f64()),
        }
    }
}

fn gcd(mut a: u128, mut b: u128) -> u128 {
    // 64-bit division is several times faster, and most operands are small.
    while b > 0 {
        if let (Ok(mut small_a), Ok(mut small_b)) = (u64::try_from(a), u64::try_from(b)) {
            while small_b > 0 {
                (small_a, small_b) = (small_b, small_a % small_b);
            }
            return u128::from(small_a);
        }
        (a, b) = (b, a % b);
    }
    a
}

/// The fraction of smallest denominator within so many quarters of a unit in the last place of a positive double, by
/// the continued fractions of the interval's ends (Stern-Brocot).
fn simplest_between(value: f64, quarters: i128) -> (i128, i128) {
    let bits = value.to_bits();
    let exponent = i32::try_from((bits >> 52) & 0x7ff).unwrap_or(0) - 1075;
    let mantissa = i128::from((bits & ((1 << 52) - 1)) | (1 << 52));
    let scale = |n: i128| if exponent - 2 >= 0 { (n << (exponent - 2), 1) } else { (n, 1_i128 << (2 - exponent)) };
    let (mut low, mut high) = (scale(4 * mantissa - quarters), scale(4 * mantissa + quarters));
    let mut convergents = ((0, 1), (1, 0));
    loop {
        let whole = low.0 / low.1;
        let remainder = low.0 - whole * low.1;
        let fits = remainder == 0 || (whole + 1) * high.1 <= high.0;
        let digit = if remainder == 0 {
            whole
        } else if fits {
            whole + 1
        } else {
            whole
        };
        let next = (digit * convergents.1.0 + convergents.0.0, digit * convergents.1.1 + convergents.0.1);
        if fits {
            return next;
        }
        convergents = (convergents.1, next);
        // Both ends have the same whole part: continue with the reciprocals of what is left, in reverse order.
        (low, high) = ((high.1, high.0 - whole * high.1), (low.1, remainder));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_become_the_fractions_that_were_meant() {
        let cases = [
            (0.1, "1/10"),
            (1.0 / 3.0, "1/3"),
            (-2.0 / 7.0, "-2/7"),
            (0.0, "0"),
            (5.0, "5"),
            (0.5625, "9/16"),
            (1e8 + 0.5, "200000001/2"),
            (1.0, "1"),
            (2.25e-9, "9/4000000000"),
        ];
        for (value, wanted) in cases {
            assert_eq!(Rational::simplest(value).expect("finite").to_string(), wanted);
        }
        assert!(Rational::simplest(f64::NAN).is_none() && Rational::simplest(f64::INFINITY).is_none());
    }

    #[test]
    fn every_double_comes_back() {
        let mut bits = 0x9e37_79b9_7f4a_7c15_u64;
        for _ in 0..20_000 {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            for value in [f64::from_bits(bits), (bits >> 11) as f64 / (1_u64 << 53) as f64, ((bits >> 40) as f64) / 1e6] {
                if value.is_finite() {
                    assert_eq!(Rational::simplest(value).expect("finite").to_f64(), value);
                }
            }
        }
    }

    #[test]
    fn arithmetic_overflows_into_large_numbers_and_back() {
        let large = Rational::from(i64::MAX);
        let square = large.times(&large);
        assert!(matches!(square.0, Repr::Big(_)));
        assert_eq!(square.times(&large.inverse()), large);
        assert_eq!(square.plus(&square.negated()), Rational::ZERO);
        let least = Rational::from(i64::MIN);
        assert_eq!(least.negated().negated(), least);
        assert_eq!(least.inverse().inverse(), least);
    }

    /// (2/3)^600 through floats, and back.
    #[test]
    fn what_outgrows_its_limit_goes_on_with_256_bits() {
        let third = Rational::small(2, 3);
        let mut power = Rational::ONE;
        (0..600).for_each(|_| power = power.times(&third));
        assert!(power.is_float());
        assert!((power.to_f64() / (2.0_f64 / 3.0).powi(600) - 1.0).abs() < 1e-12);
        (0..600).for_each(|_| power = power.times(&third.inverse()));
        let error = power.plus(&Rational::from(-1));
        assert!(error.magnitude() < 1e-70, "{error}");
        let inverse = power.plus(&Rational::ONE).inverse().plus(&Rational::small(-1, 2));
        assert!(inverse.magnitude() < 1e-70, "{inverse}");
        assert_eq!(power.plus(&power.negated()), Rational::ZERO);
        assert_eq!(Rational::ONE.plus(&power.negated()).to_f64(), -error.to_f64());
    }
}
