//! Whether points lie inside a solid: by the solid angle under which its surface is seen.

use crate::budget::{Budget, Stopped};
use crate::solid::TriMesh;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// What is known of some points and a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Inside {
    /// All of them are outside.
    None,
    /// The first one of those that are inside.
    Point(DVec3),
    /// A point is so close to the surface that rounding decides.
    Undecided,
}

/// Points handled together.
const CHUNK: usize = 64;

/// How often the surface goes around a point: the sum of its triangles' solid angles over 4 pi (van Oosterom and Strackee, "The solid angle of a plane
/// triangle", 1983), a whole number away from the surface.
#[must_use]
pub fn winding(mesh: &TriMesh, point: DVec3) -> f64 {
    let angle = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|corner| mesh.vertices[corner as usize] - point);
        let (p, q, r) = (a.length(), b.length(), c.length());
        let volume = a.dot(b.cross(c));
        if volume == 0.0 {
            // In the triangle's plane: seen from neither side, so that points of the triangle count half.
            return 0.0;
        }
        volume.atan2(p * q * r + a.dot(b) * r + b.dot(c) * p + c.dot(a) * q)
    };
    // Half angles.
    mesh.triangles.iter().map(angle).sum::<f64>() / (2.0 * PI)
}

/// The first of the points that lies inside a closed outward mesh. Cost: points times triangles; points beyond the mesh's box cost nothing.
///
/// # Errors
/// [`Stopped`].
pub fn first_inside(mesh: &TriMesh, points: &[DVec3], budget: &Budget) -> Result<Inside, Stopped> {
    let Some(low) = mesh.vertices.iter().copied().reduce(DVec3::min) else { return Ok(Inside::None) };
    let high = mesh.vertices.iter().copied().fold(low, DVec3::max);
    let of = |point: &DVec3| {
        if point.cmplt(low).any() || point.cmpgt(high).any() {
            return Inside::None;
        }
        let turns = winding(mesh, *point);
        // Whole numbers but for rounding; halves on the surface.
        match (turns - turns.round()).abs() < 0.25 {
            true if turns > 0.5 => Inside::Point(*point),
            true => Inside::None,
            false => Inside::Undecided,
        }
    };
    let found = points.par_chunks(CHUNK).find_map_first(|chunk| {
        let until_stopped = chunk.iter().take_while(|_| budget.cancel.reason().is_none());
        until_stopped.map(of).find(|found| *found != Inside::None)
    });
    budget.cancel.check()?;
    Ok(found.unwrap_or(Inside::None))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn corners_of_a_tetrahedron() {
        let vertices = vec![DVec3::ZERO, 3.0 * DVec3::X, 3.0 * DVec3::Y, 3.0 * DVec3::Z];
        let mesh = TriMesh { vertices, triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]] };
        let found = |points: &[DVec3]| first_inside(&mesh, points, &Budget::default()).unwrap();
        assert_eq!(found(&[DVec3::splat(5.0), DVec3::splat(1.5)]), Inside::None);
        assert_eq!(found(&[DVec3::splat(5.0), DVec3::splat(0.9)]), Inside::Point(DVec3::splat(0.9)));
        assert_eq!(found(&[DVec3::splat(1.0)]), Inside::Undecided);
        assert!((winding(&mesh, DVec3::splat(0.5)) - 1.0).abs() < 1e-14 && winding(&mesh, DVec3::splat(2.0)).abs() < 1e-14);
    }
}
