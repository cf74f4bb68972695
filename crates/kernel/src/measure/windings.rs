//! How often a closed surface winds around places, told by triangles that stand for it.
//!
//! Let the straight way from every point of the surface to one of the triangles, by which one becomes the other, stay within d of the triangles. Around a point
//! farther than d from all triangles both then wind equally often. Triangles of one closed surface that do not meet but where they are joined part space in two,
//! and wind around one side only, and once. Where they do meet, the surface itself may not; that it winds around some place neither once nor not at all proves that it
//! passes through itself, since a surface that does not parts space in two likewise.

use crate::attractor::cell::{Point, distance_squared};
use crate::budget::{Budget, Stopped};
use crate::measure::triangle::closest_on_triangle;
use crate::solid::{Crossings, Inside, TriMesh};
use glam::DVec3;
use rayon::prelude::*;

/// What the triangles tell of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Windings {
    /// Around every point farther than d from the triangles it winds once, or not at all.
    Once,
    /// It passes through itself: it winds so often around a point farther than d from the triangles.
    Repeated {
        /// The point, in mm.
        point: DVec3,
        /// How often: neither 0 nor 1.
        winding: i64,
    },
    /// So many pairs of triangles meet where they are not joined, and no such point was found: the surface may pass through itself, or come near to itself.
    Unsettled {
        /// Pairs of triangles.
        pairs: u64,
    },
}

impl Windings {
    /// Of a surface that the triangles of a closed mesh, whose volume is above 0, stand for within `deviation_mm`, the d above.
    ///
    /// Where triangles cross, space has four sides nearby. A point of each is tried at lengths from 2 d on, each twice the last, so that a lens of any thickness
    /// beyond some d is found near its rim. Cost: n log n, and n for every point around which the triangles wind neither once nor not at all.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn of(mesh: &TriMesh, deviation_mm: f64, budget: &Budget) -> Result<Self, Stopped> {
        let crossings = Crossings::of(mesh, budget)?;
        if crossings.count == 0 {
            return Ok(Self::Once);
        }
        let inside = Inside::new(mesh);
        let far = |point: DVec3| is_beyond(mesh, point, deviation_mm);
        for &pair in &crossings.first {
            for point in beside(mesh, pair, deviation_mm) {
                budget.cancel.check()?;
                let winding = inside.winding(point);
                if !(0..=1).contains(&winding) && far(point) {
                    return Ok(Self::Repeated { point, winding });
                }
            }
        }
        Ok(Self::Unsettled { pairs: crossings.count })
    }
}

/// Doublings of the least length that is tried.
const DOUBLINGS: i32 = 24;

/// Points on all four sides of two triangles that meet, near to them first.
fn beside(mesh: &TriMesh, pair: [u32; 2], deviation_mm: f64) -> impl Iterator<Item = DVec3> {
    let corners = pair.map(|triangle| mesh.triangles[triangle as usize].map(|corner| mesh.vertices[corner as usize]));
    let middle = corners.iter().flatten().sum::<DVec3>() / 6.0;
    let [m, n] = corners.map(|[a, b, c]| (b - a).cross(c - a).normalize_or_zero());
    let sides = [m + n, -m - n, m - n, n - m].map(DVec3::normalize_or_zero);
    // With a deviation of 0, of triangles that are the surface itself, their size is where to begin.
    let size = corners.iter().flatten().map(|corner| corner.distance(middle)).fold(0.0, f64::max);
    let least = (2.0 * deviation_mm).max(size / 16.0);
    (0..DOUBLINGS).flat_map(move |doubling| sides.map(|side| middle + side * least * f64::from(doubling).exp2()))
}

/// Whether a point is surely farther than `length` from all triangles; the distance is off by a few roundings of the largest difference of coordinates.
fn is_beyond(mesh: &TriMesh, point: DVec3, length: f64) -> bool {
    let x = point.to_array();
    mesh.triangles.par_iter().all(|corners| {
        let [a, b, c]: [Point; 3] = corners.map(|corner| mesh.vertices[corner as usize].to_array());
        let reach = [&a, &b, &c].map(|corner| distance_squared(&x, corner)).into_iter().fold(0.0, f64::max).sqrt();
        distance_squared(&x, &closest_on_triangle(&x, &a, &b, &c)).sqrt() > length + 1e-12 * (reach + point.length())
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// A closed tube of eight corners around every point of a closed curve in the plane z = 0, of radius 1.
    fn tube(count: u32, curve: impl Fn(f64) -> DVec3) -> TriMesh {
        let (mut mesh, around) = (TriMesh::default(), 8);
        for step in 0..count {
            let at = |step: u32| curve(f64::from(step) / f64::from(count) * std::f64::consts::TAU);
            let along = (at(step + 1) - at(step + count - 1)).normalize();
            let across = DVec3::Z.cross(along);
            mesh.vertices.extend((0..around).map(|k| {
                let (sine, cosine) = (f64::from(k) / f64::from(around) * std::f64::consts::TAU).sin_cos();
                at(step) + across * cosine + DVec3::Z * sine
            }));
            for k in 0..around {
                let corner = |step: u32, k: u32| step % count * around + k % around;
                let [a, b, c, d] = [corner(step, k), corner(step + 1, k), corner(step + 1, k + 1), corner(step, k + 1)];
                mesh.triangles.extend([[a, c, b], [a, d, c]]);
            }
        }
        mesh
    }

    #[test]
    fn tubes_around_circles_and_eights() {
        let circle = tube(40, |t| 5.0 * DVec3::new(t.cos(), t.sin(), 0.0));
        assert_eq!(Windings::of(&circle, 0.1, &Budget::default()).unwrap(), Windings::Once);
        // An eight whose tube meets itself around the origin: twice inside of it there.
        let eight = tube(64, |t| DVec3::new(8.0 * t.sin(), 4.0 * (2.0 * t).sin(), 0.0));
        let found = Windings::of(&eight, 0.05, &Budget::default()).unwrap();
        assert!(matches!(found, Windings::Repeated { point, winding: 2 } if point.length() < 2.0), "{found:?}");
        // Known to 2 mm only, no place is far enough from its triangles.
        assert!(matches!(Windings::of(&eight, 2.0, &Budget::default()).unwrap(), Windings::Unsettled { pairs } if pairs > 0));
    }
}
