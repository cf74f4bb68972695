//! Shells that are flat: what rounding leaves of faces that solids share, of one face or bent around the edges where two or three of them meet.

use super::TriMesh;
use super::shells::Shells;
use glam::DVec3;

/// The mesh without shells that are flat to `width_mm`, if there are such: where solids share parts of faces, what they have in common is flat, and has no volume but by
/// rounding.
///
/// A shell is flat when each of its triangles lies as a whole in one of up to three slabs of linearly independent normals, which are thin enough. The planes of such
/// slabs part space into wedges that all reach to infinity, so whatever the shell encloses lies in the slabs. For any signs there is a unit direction d that goes along every normal n by d . n = +-s, where
/// s > 0 is the least of what all choices of signs give; from any point of a slab one of them leaves that slab, and every other one that the point is in, within the thickness divided
/// by s, and enters no other. There it is outside the shell. Slabs are thin enough when that length is at most `width_mm`.
///
/// What such a shell encloses therefore holds no ball of a radius above `width_mm`, and lies within that of its surface. So with M the solid and M' what is left, M' holds every point whose ball of
/// radius `width_mm` is in M, and lies within `width_mm` of M. Triangles that share a vertex belong to one shell. Cost: linear.
#[must_use]
pub fn without_flat_shells(mesh: &TriMesh, width_mm: f64) -> Option<TriMesh> {
    let shells = Shells::of(mesh);
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); shells.volumes.len()];
    for (triangle, corners) in (0..).zip(&mesh.triangles) {
        members[shells.with(corners[0])].push(triangle);
    }
    let flat: Vec<bool> = members.iter().map(|triangles| is_flat(mesh, triangles, width_mm)).collect();
    if !flat.contains(&true) {
        return None;
    }
    let mut rest = TriMesh::default();
    let mut numbers = vec![u32::MAX; mesh.vertices.len()];
    for corners in mesh.triangles.iter().filter(|corners| !flat[shells.with(corners[0])]) {
        rest.triangles.push(corners.map(|corner| {
            let number = &mut numbers[corner as usize];
            if *number == u32::MAX {
                *number = rest.vertices.len() as u32;
                rest.vertices.push(mesh.vertices[corner as usize]);
            }
            *number
        }));
    }
    Some(rest)
}

/// Whether the triangles of a shell lie in slabs as [`without_flat_shells`] says. Each slab is that of the largest triangle in none before.
fn is_flat(mesh: &TriMesh, triangles: &[u32], width_mm: f64) -> bool {
    let corners = |triangle: u32| mesh.triangles[triangle as usize].map(|corner| mesh.vertices[corner as usize]);
    let normal = |triangle: u32| {
        let [a, b, c] = corners(triangle);
        (b - a).cross(c - a)
    };
    let (mut rest, mut normals, mut thickness) = (triangles.to_vec(), Vec::with_capacity(3), 0.0_f64);
    while let Some(&largest) = rest.iter().max_by(|a, b| normal(**a).length_squared().total_cmp(&normal(**b).length_squared())) {
        let (across, [foot, ..]) = (normal(largest).normalize_or_zero(), corners(largest));
        if normals.len() == 3 {
            return false;
        }
        let mut span = [0.0_f64; 2];
        rest.retain(|&triangle| {
            let heights = corners(triangle).map(|corner| (corner - foot).dot(across));
            let is_beside = heights.iter().all(|height| height.abs() <= width_mm);
            if is_beside {
                span = heights.iter().fold(span, |[low, high], &height| [low.min(height), high.max(height)]);
            }
            !is_beside
        });
        normals.push(across);
        thickness = thickness.max(span[1] - span[0]);
        if thickness > shared_step(&normals) * width_mm {
            return false;
        }
    }
    true
}

/// The s of [`without_flat_shells`] for up to three unit normals, rounded down; 0 where they are not linearly independent. A direction with d . n_i = sigma_i s is s times the sum
/// of sigma_i m_i with the dual basis m, so s is 1 over the longest of these sums.
fn shared_step(normals: &[DVec3]) -> f64 {
    /// Determinants below it lose the digits of what is divided by them; they belong to slabs that meet at less than a degree.
    const LEAST: f64 = 1e-2;
    let longest = match *normals {
        [n] => n.length(),
        [p, q] => {
            // In the plane of both: the sums have the squared lengths 2 / (1 +- p.q).
            let along = p.dot(q).abs();
            if 1.0 - along < LEAST { return 0.0 } else { (2.0 / (1.0 - along)).sqrt() }
        }
        [p, q, r] => {
            let volume = p.dot(q.cross(r));
            if volume.abs() < LEAST {
                return 0.0;
            }
            let [a, b, c] = [q.cross(r), r.cross(p), p.cross(q)].map(|side| side / volume);
            [a + b + c, a + b - c, a - b + c, a - b - c].map(DVec3::length).into_iter().fold(0.0, f64::max)
        }
        _ => return 0.0,
    };
    if longest > 0.0 { (1.0 - 1e-9) / longest } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::super::shells::tests::cubes;
    use super::*;
    use crate::measure::mass::volume;

    #[test]
    fn flat_shells_are_left_out() {
        let flatten = |mut mesh: TriMesh, from: usize, height: f64| {
            mesh.vertices[from..].iter_mut().for_each(|point| point.z = 3.0 + height * point.z);
            mesh
        };
        // A cube, and one beside it that is pressed to a height of 2e-7.
        let mesh = flatten(cubes(&[[0.0, 1.0], [2.0, 3.0]]), 8, 2e-7);
        assert_eq!(without_flat_shells(&mesh, 1e-7), None);
        let rest = without_flat_shells(&mesh, 3e-7).unwrap_or_default();
        assert_eq!((rest.vertices.len(), rest.triangles.len(), volume(&rest)), (8, 12, 1.0));
        // It alone, and turned inside out; nothing is left.
        for ends in [[2.0, 3.0], [3.0, 2.0]] {
            assert!(without_flat_shells(&flatten(cubes(&[ends]), 0, 0.0), 0.0).is_some_and(|rest| rest.triangles.is_empty()));
        }
    }

    /// A closed shell of the thickness 1e-7 over a sheet of quadrilaterals: the sheet, and its copy turned around and moved by that along (1, 1, 1), joined along the border.
    fn sheet(vertices: &[[f64; 3]], faces: &[[u32; 4]], border: &[u32]) -> TriMesh {
        let count = vertices.len() as u32;
        let mut mesh = TriMesh { vertices: vertices.iter().copied().map(DVec3::from_array).collect(), triangles: Vec::new() };
        mesh.vertices.extend(vertices.iter().map(|&vertex| DVec3::from_array(vertex) + 1e-7));
        let mut add = |[a, b, c, d]: [u32; 4]| mesh.triangles.extend([[a, b, c], [a, c, d]]);
        for &[a, b, c, d] in faces {
            add([a, b, c, d]);
            add([d + count, c + count, b + count, a + count]);
        }
        for (k, &from) in border.iter().enumerate() {
            let to = border[(k + 1) % border.len()];
            add([to, from, from + count, to + count]);
        }
        mesh
    }

    #[test]
    fn shells_bent_around_edges_and_a_corner_are_flat() {
        let corner =
            [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0], [0.0, 4.0, 4.0], [0.0, 0.0, 4.0], [4.0, 0.0, 4.0]];
        // Over z = 0 and x = 0, then over y = 0 besides.
        let two = sheet(&corner[..6], &[[0, 1, 2, 3], [0, 3, 4, 5]], &[0, 1, 2, 3, 4, 5]);
        let three = sheet(&corner, &[[0, 1, 2, 3], [0, 3, 4, 5], [0, 5, 6, 1]], &[1, 2, 3, 4, 5, 6]);
        for mesh in [two, three] {
            assert!(without_flat_shells(&mesh, 4e-7).is_some_and(|rest| rest.triangles.is_empty()), "{mesh:?}");
            assert_eq!(without_flat_shells(&mesh, 1e-8), None);
        }
        // Between six planes there is room, whatever is thin of them.
        assert_eq!(without_flat_shells(&cubes(&[[0.0, 1.0]]), 1e-3), None);
        // Two planes that are nearly one enclose what is between them.
        let mut wedge = sheet(&corner[..4], &[[0, 1, 2, 3]], &[0, 1, 2, 3]);
        wedge.vertices[5].z += 1e-2;
        wedge.vertices[6].z += 1e-2;
        assert_eq!(without_flat_shells(&wedge, 4e-7), None);
    }

    #[test]
    fn steps_out_of_slabs() {
        let steps = [vec![DVec3::X], vec![DVec3::X, DVec3::Y], vec![DVec3::X, DVec3::Y, DVec3::Z], vec![DVec3::X, DVec3::X]];
        let found = steps.map(|normals| shared_step(&normals));
        for (found, exact) in found.into_iter().zip([1.0, 0.5_f64.sqrt(), (1.0_f64 / 3.0).sqrt(), 0.0]) {
            assert!((found - exact).abs() < 1e-8, "{found} {exact}");
        }
    }
}
