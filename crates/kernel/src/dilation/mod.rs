//! Thickening: the solid D_r = attractor + closed ball of radius r, on a sparse body-centred lattice, with proven bounds.
//!
//! In every tetrahedron of the lattice the solid is a union of half-spaces, one for every site near: where the affine
//! function with the values of the site's squared distance at the four vertices is below theta. Creases between sites are
//! cut where those functions meet; so, with R a tetrahedron's circumradius, D(sqrt(theta - R^2)) subset solid subset D(sqrt(theta))
//! for the sites (see `block`). theta = r^2, and R^2 = r^2 - (r - e)^2 is a pitch of sqrt(r e), whatever the shape.
//!
//! Where the solid leaves out a critical point of the distance below r, the lattice is refined until it does not: by Morse
//! theory the solid then has all of D(r)'s topology (see `block`). Where no level is fine enough, that is counted as uncertain.
//!
//! The mesh is a closed, oriented 2-manifold by construction: see `block` and `outside`.

mod assemble;
mod block;
mod certificate;
mod error;
mod half_edges;
mod lattice;
mod octree;
mod outside;
mod plan;
mod simplify;
mod stitch;
mod tree;

use crate::attractor::Attractor;
use crate::budget::Budget;
use crate::measure::bounds::AxisBox;
use crate::solid::Solid;
use crate::tolerance::{Radius, Tolerance};
pub use error::DilationError;
use plan::Plan;

/// A dilated shape with what is proven of it. Lengths in mm.
#[derive(Clone, Debug)]
pub struct Dilation {
    /// The solid; its coordinates are single-precision numbers.
    pub solid: Solid,
    /// D(r - inner) is inside the solid.
    pub inner_mm: f64,
    /// The solid is inside D(r + outer).
    pub outer_mm: f64,
    /// a.
    pub pitch_mm: f64,
    /// Leaf cells met, each once in every block of the lattice that needed it.
    pub leaf_cells: u64,
    /// Pairs of triangles that meet elsewhere than where they are joined.
    pub crossings: u64,
    /// The box of the attractor, not dilated.
    pub bounds: AxisBox,
    /// Cubes of the lattice where the distance may have a critical point so close to r that the topology there is not certain.
    pub uncertain: u64,
}

/// Dilates an attractor by the closed ball of radius r, to the tolerance: both bounds of the result are at
/// most `tolerance`.
///
/// Cost follows the area of the result divided by r times the tolerance, not the number of cells. The result does not
/// depend on the number of threads.
///
/// # Errors
/// [`DilationError`]: a limit, with a value that would pass, or a stop.
pub fn dilate(attractor: &Attractor, radius: Radius, tolerance: Tolerance, budget: &Budget) -> Result<Dilation, DilationError> {
    let plan = Plan::new(attractor, radius, tolerance, budget)?;
    plan.run(attractor, budget)
}

/// As [`dilate`], with the triangles of the lattice: only those that have no area are removed.
///
/// # Errors
/// As [`dilate`].
pub fn dilate_unsimplified(attractor: &Attractor, radius: Radius, tolerance: Tolerance, budget: &Budget) -> Result<Dilation, DilationError> {
    Plan::new(attractor, radius, tolerance, budget)?.unsimplified().run(attractor, budget)
}

/// What a dilation is predicted to cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Triangles of the result.
    pub triangles: f64,
    /// Peak memory in bytes.
    pub memory_bytes: f64,
    /// a, in mm.
    pub pitch_mm: f64,
}


/// Predicts what [`dilate`] will make, from a coarse lattice.
///
/// # Errors
/// As [`dilate`], for what shows before the work.
pub fn predict(attractor: &Attractor, radius: Radius, tolerance: Tolerance, budget: &Budget) -> Result<Prediction, DilationError> {
    Plan::new(attractor, radius, tolerance, budget)?.predict(attractor, budget)
}
