//! The shells of a closed mesh, and whether they nest as those of a solid do.

use super::TriMesh;
use super::inside::Inside;
use crate::groups::Groups;
use glam::DVec3;

/// Parts of a mesh whose triangles hang together; those that share a vertex do.
pub(crate) struct Shells {
    /// The shell of every vertex; `u32::MAX` for those without triangles.
    numbers: Vec<u32>,
    /// A vertex of each.
    firsts: Vec<u32>,
    /// Six times the volume that each encloses, negative for those that face inwards.
    pub(crate) volumes: Vec<f64>,
    /// What these may be off by, in units of rounding: the terms' sizes.
    sizes: Vec<f64>,
}

impl Shells {
    pub(crate) fn of(mesh: &TriMesh) -> Self {
        let mut groups = Groups::of_triangles(mesh.vertices.len(), &mesh.triangles);
        let mut shells = Self { numbers: vec![u32::MAX; mesh.vertices.len()], firsts: Vec::new(), volumes: Vec::new(), sizes: Vec::new() };
        for &[a, b, c] in &mesh.triangles {
            // The root's entry names its shell.
            let root = groups.of(a as usize) as usize;
            if shells.numbers[root] == u32::MAX {
                shells.numbers[root] = shells.firsts.len() as u32;
                shells.firsts.push(a);
                shells.volumes.push(0.0);
                shells.sizes.push(0.0);
            }
            let shell = shells.numbers[root];
            for corner in [a, b, c] {
                shells.numbers[corner as usize] = shell;
            }
            let origin = mesh.vertices[shells.firsts[shell as usize] as usize];
            let [a, b, c] = [a, b, c].map(|corner| mesh.vertices[corner as usize] - origin);
            shells.volumes[shell as usize] += a.dot(b.cross(c));
            shells.sizes[shell as usize] += a.length() * b.length() * c.length();
        }
        shells
    }

    /// The shell that a vertex of a triangle belongs to.
    pub(crate) fn with(&self, vertex: u32) -> usize {
        self.numbers[vertex as usize] as usize
    }
}

/// A shell of a closed mesh on one side of which the mesh winds around space neither once nor not at all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MisplacedShell {
    /// A vertex of it.
    pub at: DVec3,
    /// How often the mesh winds around what lies there.
    pub winding: i64,
}

impl std::fmt::Display for MisplacedShell {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let DVec3 { x, y, z } = self.at;
        let fault =
            if self.winding < 0 { "faces inwards, and nothing is around it" } else { "lies inside of another, and faces outwards too" };
        write!(f, "the shell at {x}, {y}, {z} {fault}: space beside it counts {} times", self.winding)
    }
}

/// The first shell that is not nested as those of a solid are: outward ones outside of all others, inward ones in one. Of a closed mesh that does not meet itself; triangles
/// that share a vertex belong to one shell. A shell then lies on one side of every other, so that how often the others wind around one of its vertices tells of all
/// of it. Cost: n log n, and a column of triangles for every shell.
#[must_use]
pub fn misplaced_shell(mesh: &TriMesh) -> Option<MisplacedShell> {
    let shells = Shells::of(mesh);
    // One that faces inwards is seen by its volume; two and more may hide it.
    if shells.firsts.len() < 2 {
        return None;
    }
    let inside = Inside::new(mesh);
    // A term has fewer than 16 roundings, their sum one for each.
    let rounding = (16 + mesh.triangles.len()) as f64 * f64::EPSILON;
    (0..shells.firsts.len()).find_map(|shell| {
        let (first, volume) = (shells.firsts[shell], shells.volumes[shell]);
        // Of flat shells it is not known which way they face.
        if volume.abs() <= rounding * shells.sizes[shell] {
            return None;
        }
        let at = mesh.vertices[first as usize];
        let others = inside.winding_of(at, |triangle| shells.with(mesh.triangles[triangle as usize][0]) != shell);
        let sides = [others, if volume > 0.0 { others + 1 } else { others - 1 }];
        sides.into_iter().find(|winding| !(0..=1).contains(winding)).map(|winding| MisplacedShell { at, winding })
    })
}

/// The mesh without shells that lie between two planes as far apart as `width_mm`, if there are such: where solids share parts of faces, what they have in common is flat, and has no volume but by
/// rounding.
///
/// What such a shell encloses holds no ball with a diameter above `width_mm`, and lies within that of its surface. So with M the solid and M' what is left, M' holds every point whose ball of
/// radius `width_mm` is in M, and lies within `width_mm` of M. Triangles that share a vertex belong to one shell. Cost: linear.
#[must_use]
pub fn without_flat_shells(mesh: &TriMesh, width_mm: f64) -> Option<TriMesh> {
    let shells = Shells::of(mesh);
    // Each one's direction across: the normal of its largest triangle.
    let mut across = vec![DVec3::ZERO; shells.firsts.len()];
    for corners in &mesh.triangles {
        let [a, b, c] = corners.map(|corner| mesh.vertices[corner as usize]);
        let normal = (b - a).cross(c - a);
        let largest = &mut across[shells.with(corners[0])];
        if normal.length_squared() > largest.length_squared() {
            *largest = normal;
        }
    }
    let across: Vec<DVec3> = across.into_iter().map(DVec3::normalize_or_zero).collect();
    let mut spans = vec![[f64::INFINITY, f64::NEG_INFINITY]; across.len()];
    for &corner in mesh.triangles.iter().flatten() {
        let shell = shells.with(corner);
        let height = (mesh.vertices[corner as usize] - mesh.vertices[shells.firsts[shell] as usize]).dot(across[shell]);
        spans[shell] = [spans[shell][0].min(height), spans[shell][1].max(height)];
    }
    let is_flat = |shell: usize| spans[shell][1] - spans[shell][0] <= width_mm;
    if !(0..across.len()).any(is_flat) {
        return None;
    }
    let mut rest = TriMesh::default();
    let mut numbers = vec![u32::MAX; mesh.vertices.len()];
    for corners in mesh.triangles.iter().filter(|corners| !is_flat(shells.with(corners[0]))) {
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

#[cfg(test)]
mod tests {
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

    /// Cubes from and to these corners; those whose ends are exchanged face inwards.
    fn cubes(ends: &[[f64; 2]]) -> TriMesh {
        let mut mesh = TriMesh::default();
        for &[low, high] in ends {
            let start = mesh.vertices.len() as u32;
            let end = |code: usize, axis: usize| if code >> axis & 1 == 0 { low } else { high };
            mesh.vertices.extend((0..8).map(|code| DVec3::new(end(code, 0), end(code, 1), end(code, 2))));
            let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
            mesh.triangles.extend(faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).map(|corners| corners.map(|k| start + k)));
        }
        mesh
    }

    #[test]
    fn shells_of_solids_are_nested_in_turns() {
        // One cube; two apart; a hollow one; one within the hollow.
        for solid in [&[[0.0, 1.0]][..], &[[0.0, 1.0], [2.0, 3.0]], &[[0.0, 9.0], [8.0, 1.0]], &[[0.0, 9.0], [8.0, 1.0], [2.0, 3.0]]] {
            assert_eq!(misplaced_shell(&cubes(solid)), None, "{solid:?}");
        }
        let winding = |ends: &[[f64; 2]]| misplaced_shell(&cubes(ends)).map(|found| found.winding);
        assert_eq!(winding(&[[0.0, 9.0], [1.0, 8.0]]), Some(2));
        assert_eq!(winding(&[[0.0, 9.0], [1.0, 8.0], [2.0, 7.0]]), Some(2));
        assert_eq!(winding(&[[0.0, 9.0], [11.0, 10.0]]), Some(-1), "a cube beside that faces inwards");
        assert_eq!(winding(&[[0.0, 9.0], [8.0, 1.0], [7.0, 2.0]]), Some(-1), "a hollow in a hollow");
    }
}
