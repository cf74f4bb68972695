//! Bezier curves.

use glam::DVec3;

/// A polynomial or rational Bezier curve of degree n - 1, n control points.
#[derive(Clone, Debug, PartialEq)]
pub struct BezierCurve {
    /// The control points in mm.
    pub control_points: Vec<DVec3>,
    /// Positive weights, one per control point; polynomial when absent.
    pub weights: Option<Vec<f64>>,
}
