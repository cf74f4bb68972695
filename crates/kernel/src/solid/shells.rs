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

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Cubes from and to these corners; those whose ends are exchanged face inwards.
    pub(in super::super) fn cubes(ends: &[[f64; 2]]) -> TriMesh {
        let mut mesh = TriMesh::default();
        for &[low, high] in ends {
            mesh.append(&TriMesh::cuboid(DVec3::splat(low), DVec3::splat(high)));
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
