//! The lengths that a caller gives: the tolerance of the result and the radius of the ball.
//!
//! Hausdorff distances add along a chain of approximations, and dilation by the same ball does not increase
//! them, so one tolerance is split among the stages; the dilation says which share goes where.

/// Asked Hausdorff bound on the final shape, in mm: within [`LENGTHS_MM`].
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Tolerance(f64);

/// Lengths of tolerances and radii, in mm: from an atom's size to a thousand kilometres.
pub const LENGTHS_MM: std::ops::RangeInclusive<f64> = 1e-7..=1e9;

/// A length that must be positive and of a possible size was not.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{name} must be a length from {} to {} mm, and is {}", LENGTHS_MM.start(), LENGTHS_MM.end(), shown(*.value))]
pub struct NotPositive {
    /// The parameter's name, for example `tolerance_mm`.
    pub name: &'static str,
    /// What was given.
    pub value: f64,
}

/// Few digits: a number that is far from any length has up to three hundred of them when it is written out.
fn shown(value: f64) -> String {
    let usual = value == 0.0 || !value.is_finite() || LENGTHS_MM.contains(&value.abs());
    if usual { value.to_string() } else { format!("{value:e}") }
}

impl Tolerance {
    /// # Errors
    /// [`NotPositive`] when `mm` is zero, negative, not a number, or outside [`LENGTHS_MM`].
    pub fn new(mm: f64) -> Result<Self, NotPositive> {
        positive("tolerance_mm", mm).map(Self)
    }

    /// The bound in mm.
    #[must_use]
    pub fn mm(self) -> f64 {
        self.0
    }
}

/// Radius of the dilating ball, in mm: within [`LENGTHS_MM`].
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Radius(f64);

impl Radius {
    /// # Errors
    /// [`NotPositive`] when `mm` is zero, negative, not a number, or outside [`LENGTHS_MM`].
    pub fn new(mm: f64) -> Result<Self, NotPositive> {
        positive("radius_mm", mm).map(Self)
    }

    /// The radius in mm.
    #[must_use]
    pub fn mm(self) -> f64 {
        self.0
    }
}

fn positive(name: &'static str, value: f64) -> Result<f64, NotPositive> {
    if LENGTHS_MM.contains(&value) { Ok(value) } else { Err(NotPositive { name, value }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_are_short_whatever_the_number() {
        for (value, told) in [
            (0.0, "0"),
            (-1.5, "-1.5"),
            (1e300, "1e300"),
            (-1e300, "-1e300"),
            (f64::MIN_POSITIVE, "2.2250738585072014e-308"),
            (1.25e9, "1.25e9"),
            (9e-8, "9e-8"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
        ] {
            let error = Tolerance::new(value).map(Tolerance::mm).map_err(|error| error.to_string());
            assert_eq!(error, Err(format!("tolerance_mm must be a length from 0.0000001 to 1000000000 mm, and is {told}")));
        }
    }
}
