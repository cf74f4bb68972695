//! The frame of a family of parallel planes.

use glam::{DVec2, DVec3};

/// Parallel planes n . x = offset, with axes to measure in them: a unit normal n and unit axes u, v with u x v = n.
///
/// A point x of space has the coordinates (x . u, x . v) in its plane, in mm, as seen from where n points to. Invariant: unit and
/// orthogonal up to rounding, and exactly so for normals along coordinate axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneFrame {
    normal: DVec3,
    u: DVec3,
    v: DVec3,
}

/// A vector has no direction.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the normal of a plane must be finite and not zero, and is {}, {}, {}", .0.x, .0.y, .0.z)]
pub struct NoDirection(pub DVec3);

impl PlaneFrame {
    /// The planes z = offset, measured along x and y.
    pub const HORIZONTAL: Self = Self { normal: DVec3::Z, u: DVec3::X, v: DVec3::Y };

    /// The planes across a vector of any length. Z is up in them: u = Z x n is level and v rises, so X gives (u, v) = (Y, Z) and -Y
    /// gives (X, Z); along Z, where nothing is up, u = X, so Z gives (X, Y) and -Z gives (X, -Y).
    ///
    /// # Errors
    /// [`NoDirection`] when the vector is zero or not finite.
    pub fn new(normal: DVec3) -> Result<Self, NoDirection> {
        let normal = unit(normal).ok_or(NoDirection(normal))?;
        let u = unit(DVec3::new(-normal.y, normal.x, 0.0)).unwrap_or(DVec3::X);
        Ok(Self { normal, u, v: normal.cross(u) + DVec3::ZERO })
    }

    /// Where offsets grow.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// The axis of first coordinates.
    #[must_use]
    pub fn u(&self) -> DVec3 {
        self.u
    }

    /// The axis of second coordinates.
    #[must_use]
    pub fn v(&self) -> DVec3 {
        self.v
    }

    /// The coordinates of a point in its plane.
    #[must_use]
    pub fn project(&self, point: DVec3) -> DVec2 {
        DVec2::new(point.dot(self.u), point.dot(self.v))
    }

    /// The offset of a point's plane.
    #[must_use]
    pub fn offset(&self, point: DVec3) -> f64 {
        point.dot(self.normal)
    }

    /// The point of space with these coordinates in the plane of an offset.
    #[must_use]
    pub fn point(&self, [u, v]: [f64; 2], offset: f64) -> DVec3 {
        self.u * u + self.v * v + self.normal * offset
    }

    /// Least and greatest coordinates (u, v, offset) of points: every section of a mesh lies between those of its vertices, up to
    /// rounding. `None` without points.
    #[must_use]
    pub fn bounds(&self, points: &[DVec3]) -> Option<[DVec3; 2]> {
        let placed = points.iter().map(|&point| self.project(point).extend(self.offset(point)));
        placed.map(|point| [point, point]).reduce(|[low, high], [point, _]| [low.min(point), high.max(point)])
    }
}

/// The direction of a vector. Divided by its largest coordinate first: no square of it leaves the range of numbers, and a vector
/// along an axis gives exactly the axis.
fn unit(vector: DVec3) -> Option<DVec3> {
    let largest = vector.abs().max_element();
    // The sum turns negative zeros into zeros.
    (vector.is_finite() && largest > 0.0).then(|| (vector / largest).normalize() + DVec3::ZERO)
}
