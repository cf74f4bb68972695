//! A parallel projection: lengths keep their ratio, so a scale bar is true everywhere.

use super::{PreviewOptions, SAMPLES};
use glam::{DVec3, Vec3};
use std::f64::consts::FRAC_PI_2;

/// Directions of the eye and the map from millimetres to samples.
pub(super) struct Camera {
    right: DVec3,
    up: DVec3,
    /// Towards the eye.
    toward: DVec3,
    centre: DVec3,
    /// Where the centre is seen, in samples.
    seen_centre: [f64; 2],
    /// Samples to a millimetre.
    pub(super) scale: f64,
    /// Least and greatest z of the box, in samples.
    pub(super) depths: [f32; 2],
}

/// Shares of the picture's side that stay free at the left, right, top and bottom: labels stand
/// beside the box, the scale bar below it.
const MARGINS: [f64; 4] = [0.165, 0.075, 0.06, 0.14];
const PLAIN_MARGINS: [f64; 4] = [0.04; 4];

impl Camera {
    /// Fits the box from `low` to `high`.
    pub(super) fn new(options: &PreviewOptions, low: DVec3, high: DVec3) -> Self {
        let size = high - low;
        let [azimuth_rad, elevation_rad] = chosen_view(size);
        let (sin, cos) = options.azimuth_rad.unwrap_or(azimuth_rad).sin_cos();
        let (sin_up, cos_up) = options.elevation_rad.unwrap_or(elevation_rad).sin_cos();
        let toward = DVec3::new(cos * cos_up, sin * cos_up, sin_up);
        let right = DVec3::new(-sin, cos, 0.0);
        let up = toward.cross(right);
        // Half the box's extent along a direction of the picture.
        let half = |direction: DVec3| 0.5 * direction.abs().dot(size);
        let [left_margin, right_margin, top_margin, bottom_margin] = if options.annotated { MARGINS } else { PLAIN_MARGINS };
        let side = f64::from(options.pixels) * SAMPLES as f64;
        let free = [side * (1.0 - left_margin - right_margin), side * (1.0 - top_margin - bottom_margin)];
        let fit = (0.5 * free[0] / half(right)).min(0.5 * free[1] / half(up));
        // A single point has no extent: any scale shows it.
        let scale = if fit.is_finite() { fit } else { 1.0 };
        let seen_centre = [side * left_margin + 0.5 * free[0], side * top_margin + 0.5 * free[1]];
        let depth = (half(toward) * scale) as f32;
        Self { right, up, toward, centre: 0.5 * (low + high), seen_centre, scale, depths: [-depth, depth] }
    }

    /// x to the right and y down in samples, z towards the eye in the same unit.
    pub(super) fn project(&self, position: DVec3) -> Vec3 {
        let from_centre = (position - self.centre) * self.scale;
        Vec3::new(
            (self.seen_centre[0] + from_centre.dot(self.right)) as f32,
            (self.seen_centre[1] - from_centre.dot(self.up)) as f32,
            from_centre.dot(self.toward) as f32,
        )
    }

    /// A direction of space in the picture's axes: right, up, towards the eye.
    pub(super) fn direction(&self, direction: DVec3) -> Vec3 {
        DVec3::new(direction.dot(self.right), direction.dot(self.up), direction.dot(self.toward)).as_vec3()
    }
}

/// Azimuth and elevation that show a box of this size best: near the isometric view, and straight
/// on for what is flat.
fn chosen_view(size: DVec3) -> [f64; 2] {
    /// Thinner than this share of the largest side is flat.
    const FLAT: f64 = 1e-3;
    let flat = |axis: usize| size[axis] <= FLAT * size.max_element();
    match [flat(0), flat(1), flat(2)] {
        // A plan has X to the right and Y up; so does a line along either.
        [_, _, true] => [-FRAC_PI_2, FRAC_PI_2],
        [_, true, false] => [-FRAC_PI_2, 0.0],
        [true, false, false] => [0.0, 0.0],
        // A little off the diagonal, so that edges of a cube do not coincide.
        [false, false, false] => [-1.05, 0.5],
    }
}
