//! The one number a caller gives, what a result reached, and how the first is shared among stages.
//!
//! Hausdorff distances add along a chain of approximations, and dilation by the same ball does not
//! increase them, so a tolerance is split once ([`Shares`]) and every stage receives its part.

/// Asked Hausdorff bound on the final shape, in mm: positive and finite.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Tolerance(f64);

/// A length that must be positive and finite was not.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{name} must be a positive finite length in mm, and is {value}")]
pub struct NotPositive {
    /// The parameter's name, for example `tolerance_mm`.
    pub name: &'static str,
    /// What was given.
    pub value: f64,
}

impl Tolerance {
    /// # Errors
    /// [`NotPositive`] when `mm` is zero, negative, infinite or not a number.
    pub fn new(mm: f64) -> Result<Self, NotPositive> {
        positive("tolerance_mm", mm).map(Self)
    }

    /// The bound in mm.
    #[must_use]
    pub fn mm(self) -> f64 {
        self.0
    }
}

/// Radius of the dilating ball, in mm: positive and finite.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Radius(f64);

impl Radius {
    /// # Errors
    /// [`NotPositive`] when `mm` is zero, negative, infinite or not a number.
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
    if value.is_finite() && value > 0.0 { Ok(value) } else { Err(NotPositive { name, value }) }
}
