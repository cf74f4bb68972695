//! Measures of shapes and solids, as intervals that are proven.

pub mod area;
pub mod bounds;
pub mod contact;
mod curve;
pub mod dimension;
mod double;
pub mod enclosed;
mod functional;
pub mod hausdorff;
pub mod mass;
pub mod oriented_box;
pub mod overlaps;
pub mod section;
mod support;
pub mod thickness;
pub mod triangle;
pub mod windings;

pub use area::surface_area;
pub use bounds::{AxisBox, bounding_box, extent_along};
pub use contact::{Contact, ContactError, ContactQuery, Primitive, Verdict, intersect, intersect_primitive, intersect_self};
pub use dimension::{Dimension, DimensionKnowledge, dimension};
pub use enclosed::{NotEnclosed, enclosed_volume};
pub use hausdorff::{Directed, Hausdorff, hausdorff};
pub use oriented_box::{OrientedBox, oriented_box};
pub use overlaps::Overlaps;
pub use thickness::{FOLD, Side, Thickness, ThicknessMap, thickness, thickness_map};
pub use windings::Windings;

/// [low, high]: the exact value lies between. Invariant: low <= high, no NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// The interval between two ends, in either order.
    #[must_use]
    pub fn new(a: f64, b: f64) -> Self {
        Self { low: a.min(b), high: a.max(b) }
    }

    /// high - low.
    #[must_use]
    pub fn width(self) -> f64 {
        self.high - self.low
    }
}
