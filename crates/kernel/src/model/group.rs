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
    /// The radius of the ball that dilates it, where that is not the one asked for; what is in it may have another one yet.
    pub radius: Option<PartRadius>,
}

/// The radius of the ball that dilates a part, in mm.
#[derive(Clone, Debug, PartialEq)]
pub enum PartRadius {
    /// The same for all points.
    Constant(f64),
    /// One for every control point or vertex of the part's shape, in their order; between them what the shape makes of numbers there, and nowhere less than the least.
    AtPoints(Vec<f64>),
    /// r_k = max(least, first ratio^k) for what leaves the recursion of the part's root cells at level k, and the least for their limit sets.
    ByLevel {
        /// At level 0.
        first: f64,
        /// From one level to the next: between 0 and 1.
        ratio: f64,
        /// Nowhere less.
        least: f64,
    },
}

/// The union of parts.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Group {
    /// The parts.
    pub parts: Vec<Part>,
    /// Borders of parts that are one, or that a strip joins.
    pub joins: Vec<Join>,
}
