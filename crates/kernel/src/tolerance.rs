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
#[error("{name} must be a length from {} to {} mm, and is {value}", LENGTHS_MM.start(), LENGTHS_MM.end())]
pub struct NotPositive {
    /// The parameter's name, for example `tolerance_mm`.
    pub name: &'static str,
    /// What was given.
    pub value: f64,
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
