//! Curves of corner cutting with two parameters.

use glam::DVec3;

/// The limit of the corner-cutting scheme (a, b) on a control polygon; a = b = 1/4 is Chaikin's,
/// the uniform quadratic B-spline.
#[derive(Clone, Debug, PartialEq)]
pub struct CornerCutting {
    /// The control polygon in mm, three points or more.
    pub control_points: Vec<DVec3>,
    /// First parameter.
    pub a: f64,
    /// Second parameter.
    pub b: f64,
    /// Whether the polygon is closed.
    pub closed: bool,
}
