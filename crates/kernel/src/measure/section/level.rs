//! Planes at the height of faces that are level but for rounding.

use super::PlaneFrame;
use crate::solid::TriMesh;

/// Planes that lie in nearly level faces: which of their points are above is a matter of rounding, and so is the section there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grazed {
    /// How many planes.
    pub planes: u64,
    /// The offset of the first of them as they are given.
    pub first_mm: f64,
}

/// Faces steeper than this are cut across, however small they are: the cosine of 45 degrees.
const LEVEL: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// The planes from which all corners of a face that is not steep are within `within_mm`, while not all are exactly in the plane: a plane exactly in a level face gives the section
/// just above it, which is well defined. `None` if there is none. Cost: n log m for n triangles and m planes, and the pairs that are found.
#[must_use]
pub fn grazed(mesh: &TriMesh, frame: &PlaneFrame, offsets_mm: &[f64], within_mm: f64) -> Option<Grazed> {
    let mut order: Vec<u32> = (0..offsets_mm.len() as u32).collect();
    let offset = |index: u32| offsets_mm[index as usize];
    order.sort_unstable_by(|&a, &b| offset(a).total_cmp(&offset(b)).then(a.cmp(&b)));
    let mut is_grazed = vec![false; offsets_mm.len()];
    for corners in &mesh.triangles {
        let corners = corners.map(|corner| mesh.vertices[corner as usize]);
        let heights = corners.map(|corner| frame.offset(corner));
        let [low, high] =
            [heights.iter().copied().fold(f64::INFINITY, f64::min), heights.iter().copied().fold(f64::NEG_INFINITY, f64::max)];
        let first = order.partition_point(|&index| offset(index) < high - within_mm);
        let near = order[first..].iter().take_while(|&&index| offset(index) <= low + within_mm);
        for &index in near.filter(|&&index| low < high || offset(index) != low) {
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
            is_grazed[index as usize] |= normal.dot(frame.normal()).abs() >= LEVEL;
        }
    }
    let first = is_grazed.iter().position(|&grazed| grazed)?;
    Some(Grazed { planes: is_grazed.iter().filter(|&&grazed| grazed).count() as u64, first_mm: offsets_mm[first] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn faces_that_are_level_but_for_rounding() {
        let tilted = |by: f64| TriMesh {
            vertices: vec![DVec3::Z, DVec3::new(4.0, 0.0, 1.0), DVec3::new(0.0, 4.0, 1.0 + by), DVec3::new(0.0, 0.0, -9.0)],
            triangles: vec![[0, 1, 2], [0, 3, 1]],
        };
        let found = |by: f64, offsets: &[f64]| grazed(&tilted(by), &PlaneFrame::HORIZONTAL, offsets, 1e-6);
        // Level exactly: only planes beside it are in doubt.
        assert_eq!(found(0.0, &[1.0, 0.0, 1.1]), None);
        assert_eq!(found(0.0, &[1.0, 1.0 + 2e-7]), Some(Grazed { planes: 1, first_mm: 1.0 + 2e-7 }));
        assert_eq!(found(2e-7, &[3.0, 1.0, -1.0, 1.0]), Some(Grazed { planes: 2, first_mm: 1.0 }));
        // Tilted by more than rounding, the face is cut as any other.
        assert_eq!(found(1e-3, &[1.0, 1.0 + 5e-4]), None);
    }
}
