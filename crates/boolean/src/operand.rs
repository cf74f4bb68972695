//! What is checked of an operand before any engine sees it.
//!
//! An engine's own import says less (which triangle, which edge) or nothing at all: a closed mesh that faces
//! inwards is taken for its complement, and a count that is no multiple of three may end the process in others.

use std::collections::HashSet;

use lacuna_kernel::solid::TriMesh;

use crate::{BooleanError, Fault};

/// Corners that an engine with signed 32-bit indices can number.
const CORNERS: usize = i32::MAX as usize;

/// Checks everything but self-intersections, which the engine can find much faster. A mesh without triangles is
/// the empty solid.
pub(crate) fn check(operand: usize, mesh: &TriMesh) -> Result<(), BooleanError> {
    let count = mesh.triangles.len().saturating_mul(3);
    if count > CORNERS {
        return Err(BooleanError::TooLarge { operand, count });
    }
    fault(mesh).map_or(Ok(()), |fault| Err(BooleanError::NotASolid { operand, fault }))
}

fn fault(mesh: &TriMesh) -> Option<Fault> {
    if let Some(vertex) = mesh.vertices.iter().position(|p| !p.is_finite()) {
        return Some(Fault::NotFinite { vertex });
    }
    let bad = |&[a, b, c]: &[u32; 3]| a == b || b == c || c == a || a.max(b).max(c) as usize >= mesh.vertices.len();
    if let Some(triangle) = mesh.triangles.iter().position(bad) {
        return Some(Fault::Index { triangle });
    }
    open_edge(mesh).or_else(|| (!mesh.triangles.is_empty() && six_volumes(mesh) <= 0.0).then_some(Fault::InsideOut))
}

/// A directed edge that occurs twice, or whose opposite does not occur.
fn open_edge(mesh: &TriMesh) -> Option<Fault> {
    let directed = || mesh.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
    let mut seen = HashSet::with_capacity(3 * mesh.triangles.len());
    let doubled = directed().find(|edge| !seen.insert(*edge));
    let unmatched = || directed().find(|&(from, to)| !seen.contains(&(to, from)));
    doubled.or_else(unmatched).map(|(from, to)| Fault::NotClosed { from, to })
}

/// Six times the enclosed volume, seen from a vertex of the mesh so that a place far from the origin costs no digits.
fn six_volumes(mesh: &TriMesh) -> f64 {
    let origin = mesh.vertices[mesh.triangles[0][0] as usize];
    let corner = |index: u32| mesh.vertices[index as usize] - origin;
    mesh.triangles.iter().map(|&[a, b, c]| corner(a).dot(corner(b).cross(corner(c)))).sum()
}
