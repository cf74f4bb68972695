//! Several shapes as one.

use super::{AffineMap, Join, Shape};

/// A part of a [`Group`].
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// What the author calls it.
    pub name: Option<String>,
    /// Where it is put; the identity when absent.
    pub transform: Option<AffineMap>,
    /// What it is.
    pub shape: Shape,
}

/// The union of parts.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Group {
    /// The parts.
    pub parts: Vec<Part>,
    /// Borders of parts that are one, or that a strip joins.
    pub joins: Vec<Join>,
}
