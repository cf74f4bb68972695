//! What the house asks of a boolean engine.

use glam::DVec3;
use lacuna_kernel::budget::CancelToken;
use lacuna_kernel::measure::section::PlaneFrame;
use lacuna_kernel::solid::TriMesh;

use crate::{BooleanError, Operand};

/// How solids are combined. All operations are regularised: a face, an edge or a point that two solids merely
/// share leaves nothing behind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operation {
    /// What lies in any operand.
    Union,
    /// What lies in all operands.
    Intersection,
    /// What lies in the first operand and in none of the others.
    Difference,
    /// The convex hull of all operands.
    Hull,
}

/// Combines closed, outward triangle meshes.
///
/// An engine must give the same bytes for the same operands, must not print, and must be done with every
/// operand and every thread when it returns. A closed result is promised, possibly of several shells, and without
/// triangles when nothing is left: an empty result is an answer and not an error.
pub trait BooleanEngine: Send + Sync {
    /// Stable name, for certificates and logs.
    fn name(&self) -> &'static str;

    /// Combines the operands, all at once: the cost of many is that of a balanced tree, not of a chain.
    ///
    /// # Errors
    /// [`BooleanError`] when an operand is not a solid, when the token is fired, or when the engine fails.
    fn combine(&self, operation: Operation, operands: &[Operand<'_>], cancel: &CancelToken) -> Result<TriMesh, BooleanError>;

    /// What lies in any of the solids.
    ///
    /// # Errors
    /// As [`Self::combine`].
    fn union(&self, solids: &[&TriMesh], cancel: &CancelToken) -> Result<TriMesh, BooleanError> {
        self.combine(Operation::Union, &unproven(solids), cancel)
    }

    /// What lies in all of the solids.
    ///
    /// # Errors
    /// As [`Self::combine`].
    fn intersection(&self, solids: &[&TriMesh], cancel: &CancelToken) -> Result<TriMesh, BooleanError> {
        self.combine(Operation::Intersection, &unproven(solids), cancel)
    }

    /// What lies in `solid` and in none of `tools`.
    ///
    /// # Errors
    /// As [`Self::combine`]; operand 0 is `solid`.
    fn difference(&self, solid: &TriMesh, tools: &[&TriMesh], cancel: &CancelToken) -> Result<TriMesh, BooleanError> {
        let operands: Vec<Operand<'_>> = std::iter::once(solid).chain(tools.iter().copied()).map(Operand::from).collect();
        self.combine(Operation::Difference, &operands, cancel)
    }

    /// What of the solid lies behind the plane `normal` . x = `offset`, where the normal does not point to, and what beyond; `offset` is in units of the
    /// normal's direction, in mm, whatever its length. Planes across coordinate axes cut exactly there.
    ///
    /// # Errors
    /// As [`Self::combine`]; a normal without direction is [`BooleanError::NoPlane`].
    fn cut(&self, solid: &TriMesh, normal: DVec3, offset: f64, cancel: &CancelToken) -> Result<[TriMesh; 2], BooleanError> {
        let Some(half_space) = half_space(solid, normal, offset)? else { return Ok([solid.clone(), TriMesh::default()]) };
        let behind = self.difference(solid, &[&half_space], cancel)?;
        let beyond = self.intersection(&[solid, &half_space], cancel)?;
        Ok([behind, beyond])
    }
}

fn unproven<'a>(solids: &[&'a TriMesh]) -> Vec<Operand<'a>> {
    solids.iter().copied().map(Operand::from).collect()
}

/// A box that holds all of a solid that lies beyond a plane, and ends at the plane; `None` if nothing lies there.
fn half_space(solid: &TriMesh, normal: DVec3, offset: f64) -> Result<Option<TriMesh>, BooleanError> {
    let frame = PlaneFrame::new(normal).map_err(|_| BooleanError::NoPlane)?;
    if !offset.is_finite() {
        return Err(BooleanError::NoPlane);
    }
    let Some([low, high]) = frame.bounds(&solid.vertices).filter(|[_, high]| high.z > offset) else { return Ok(None) };
    let room = (high - low).max_element();
    let ends = [DVec3::new(low.x - room, low.y - room, offset), high + room];
    let corner = |code: usize| {
        let [u, v, n] = std::array::from_fn(|axis| ends[code >> axis & 1][axis]);
        frame.u() * u + frame.v() * v + frame.normal() * n
    };
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Ok(Some(TriMesh { vertices: (0..8).map(corner).collect(), triangles }))
}
