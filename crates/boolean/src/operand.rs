//! What an engine combines, and what is checked of it.
//!
//! An engine's own import says less (which triangle, which edge) or nothing at all: a closed mesh that faces
//! inwards is taken for its complement, one that crosses itself is counted twice where it overlaps, and a count that is no multiple of three
//! may end the process in others.

use lacuna_kernel::budget::{Budget, CancelToken, Stopped};
use lacuna_kernel::solid::{Crossings, TriMesh, misplaced_shell};

use crate::{BooleanError, Fault};

/// A solid that is to be combined.
#[derive(Clone, Copy, Debug)]
pub struct Operand<'a> {
    /// Its mesh.
    pub mesh: &'a TriMesh,
    /// Whether it is proven already to be closed, to look outwards and not to meet itself: then nothing is checked again.
    pub is_proven: bool,
}

impl<'a> From<&'a TriMesh> for Operand<'a> {
    /// A mesh of which nothing is known.
    fn from(mesh: &'a TriMesh) -> Self {
        Self { mesh, is_proven: false }
    }
}

/// Corners that an engine with signed 32-bit indices can number.
const CORNERS: usize = i32::MAX as usize;

/// Checks all operands that are not proven. A mesh without triangles is the empty solid. `overlaps` decides of a mesh that meets itself whether it does so elsewhere
/// than in points and edges, which is allowed. Cost: n log n, on all threads.
pub(crate) fn check(
    operands: &[Operand<'_>],
    cancel: &CancelToken,
    overlaps: impl Fn(usize, &TriMesh) -> Result<bool, BooleanError>,
) -> Result<(), BooleanError> {
    for (operand, Operand { mesh, .. }) in operands.iter().enumerate().filter(|(_, operand)| !operand.is_proven) {
        let count = mesh.triangles.len().saturating_mul(3);
        if count > CORNERS {
            return Err(BooleanError::TooLarge { operand, count });
        }
        let refused = |fault| Err(BooleanError::NotASolid { operand, fault });
        if let Some(fault) = fault(mesh) {
            return refused(fault);
        }
        if meets_itself(mesh, cancel)? {
            if overlaps(operand, mesh)? {
                return refused(Fault::SelfIntersecting);
            }
        } else if let Some(shell) = misplaced_shell(mesh) {
            // Where shells touch it is not told on which sides of each other they lie.
            return refused(Fault::MisplacedShell(shell));
        }
    }
    Ok(())
}

fn meets_itself(mesh: &TriMesh, cancel: &CancelToken) -> Result<bool, Stopped> {
    let budget = Budget { cancel: cancel.clone(), ..Budget::default() };
    Ok(Crossings::of(mesh, &budget)?.count > 0)
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

/// The first directed edge that occurs twice; or else, of all that have no opposite and of the opposites they lack, the first.
fn open_edge(mesh: &TriMesh) -> Option<Fault> {
    let edges = &Edges::of(mesh);
    let vertices = || 0..mesh.vertices.len() as u32;
    let doubled = vertices().find_map(|from| Some((from, edges.from(from).windows(2).find(|pair| pair[0] == pair[1])?[0])));
    let open = || {
        let lacking =
            |from: u32| edges.from(from).iter().filter(move |&&to| edges.from(to).binary_search(&from).is_err()).map(move |&to| (from, to));
        vertices().flat_map(lacking).map(|(from, to)| (from.min(to), from.max(to))).min()
    };
    doubled.or_else(open).map(|(from, to)| Fault::NotClosed { from, to })
}

/// Where the directed edges lead that begin at a vertex, in ascending order.
struct Edges {
    starts: Vec<u32>,
    ends: Vec<u32>,
}

impl Edges {
    /// Counted by vertex, which is faster than to sort them all: few edges share one.
    fn of(mesh: &TriMesh) -> Self {
        let edges = || mesh.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        let mut starts = vec![0_u32; mesh.vertices.len() + 1];
        edges().for_each(|(from, _)| starts[from as usize] += 1);
        let mut sum = 0;
        for start in &mut starts {
            sum += *start;
            *start = sum;
        }
        // Filled from behind, so that what were the ends of vertices become their starts.
        let mut ends = vec![0; sum as usize];
        for (from, to) in edges() {
            let place = &mut starts[from as usize];
            *place -= 1;
            ends[*place as usize] = to;
        }
        starts.windows(2).for_each(|own| ends[own[0] as usize..own[1] as usize].sort_unstable());
        Self { starts, ends }
    }

    fn from(&self, vertex: u32) -> &[u32] {
        let start = |vertex: u32| self.starts[vertex as usize] as usize;
        &self.ends[start(vertex)..start(vertex + 1)]
    }
}

/// Six times the enclosed volume, seen from a vertex of the mesh so that a place far from the origin costs no digits.
fn six_volumes(mesh: &TriMesh) -> f64 {
    let origin = mesh.vertices[mesh.triangles[0][0] as usize];
    let corner = |index: u32| mesh.vertices[index as usize] - origin;
    mesh.triangles.iter().map(|&[a, b, c]| corner(a).dot(corner(b).cross(corner(c)))).sum()
}
