//! What the house asks of a boolean engine.

use lacuna_kernel::budget::CancelToken;
use lacuna_kernel::solid::TriMesh;

use crate::BooleanError;

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
    fn combine(&self, operation: Operation, operands: &[&TriMesh], cancel: &CancelToken) -> Result<TriMesh, BooleanError>;

    /// What lies in any of the solids.
    ///
    /// # Errors
    /// As [`Self::combine`].
    fn union(&self, solids: &[&TriMesh], cancel: &CancelToken) -> Result<TriMesh, BooleanError> {
        self.combine(Operation::Union, solids, cancel)
    }

    /// What lies in all of the solids.
    ///
    /// # Errors
    /// As [`Self::combine`].
    fn intersection(&self, solids: &[&TriMesh], cancel: &CancelToken) -> Result<TriMesh, BooleanError> {
        self.combine(Operation::Intersection, solids, cancel)
    }

    /// What lies in `solid` and in none of `tools`.
    ///
    /// # Errors
    /// As [`Self::combine`]; operand 0 is `solid`.
    fn difference(&self, solid: &TriMesh, tools: &[&TriMesh], cancel: &CancelToken) -> Result<TriMesh, BooleanError> {
        let operands: Vec<&TriMesh> = std::iter::once(solid).chain(tools.iter().copied()).collect();
        self.combine(Operation::Difference, &operands, cancel)
    }
}
