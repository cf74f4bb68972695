//! How long the things take that a plan counts, in seconds of one core.
//!
//! Measured, not proven: a release build did every case of `fixtures/` on one of two shared cores of a virtual machine (AMD EPYC at 2.6 GHz), with simplification and without. The constants of
//! dilations are those for which the sixth powers of the logarithms of the ratios to the seconds of the processor were least, rounded; the others are quotients of single jobs. Another machine, or another build, has others; on
//! several cores less time passes. What is counted is the same on every run, and so is the estimate. `fixtures/estimates.py` measures again, and `fixtures/ESTIMATES.md` shows how well it does.

use lacuna_kernel::dilation::Prediction;

/// For each triangle of a lattice's surface: made, cleaned, joined, verified, written and read back.
const TRIANGLE: f64 = 3.3e-6;
/// For each leaf cell that a block of the lattice meets: what is near to the block is sorted out.
const MET_CELL: f64 = 1.7e-6;
/// For each node or site that the searches for the nearest site of a place look at.
const SEARCHED: f64 = 6.1e-9;
/// For each site that is found near a place: it is held against the others there, so that cells that overlap take long.
const FOUND: f64 = 2.9e-7;
/// For each byte that the simplification looks at: the sites near a corner, all of which every trial to remove it asks.
const LOOKED_AT_BYTE: f64 = 2.9e-9;
/// For each triangle of the polytopes around points and wires: made, simplified, verified, written and read back.
const OF_POLYTOPE: f64 = 6.0e-6;
/// For each site there: most of what sheets along a fine surface take, which have far fewer triangles than it (0.24 s for 34 000 sites of a NURBS torus, 0.14 s for 16 000 of a mesh).
const OF_SITE: f64 = 7.0e-6;
/// For each leaf cell that is drawn by itself, and for each that becomes part of a conforming complex.
const CELL: f64 = 5.0e-7;
const FACE: f64 = 1.5e-6;
/// For each triangle of the operands of a boolean: what the engine does, and the check of the result. Measured from 1e-5 (half a million triangles trimmed by a plane) over 2e-5 (a union of 4000
/// cubes) to 7e-5 (one of 10 000 that overlap more): how much they overlap is not predicted.
const COMBINED: f64 = 2.0e-5;
/// What simplification leaves of an operand's triangles, at most.
const LEFT: f64 = 0.1;
/// For each triangle of a level's solid.
const COPIED: f64 = 5.0e-7;
/// For each triangle of a mesh that is only converted.
const CONVERTED: f64 = 1.0e-6;

/// Of a dilation.
pub(crate) fn of_dilation(prediction: &Prediction, simplify: bool) -> f64 {
    let triangles = prediction.triangles.max(prediction.counted_triangles);
    if prediction.pitch_mm.is_none() {
        return triangles * OF_POLYTOPE + prediction.leaf_cells * OF_SITE;
    }
    let simplifying = if simplify { prediction.looked_at_bytes * LOOKED_AT_BYTE } else { 0.0 };
    triangles * TRIANGLE + prediction.leaf_cells * MET_CELL + prediction.searched * SEARCHED + prediction.found * FOUND + simplifying
}

/// Of an evaluation with so many leaf cells.
pub(crate) fn of_cells(leaf_cells: f64, joined: bool) -> f64 {
    leaf_cells * if joined { FACE } else { CELL }
}

/// Of an operand of a boolean that is a mesh with so many triangles, the boolean's share included.
pub(crate) fn of_operand(triangles: f64) -> f64 {
    triangles * COMBINED
}

/// Of one that is a dilation.
pub(crate) fn of_dilated_operand(prediction: &Prediction) -> f64 {
    of_dilation(prediction, true) + of_operand(LEFT * prediction.triangles)
}

/// Of a level's solid with so many triangles.
pub(crate) fn of_level(triangles: f64) -> f64 {
    triangles * COPIED
}

/// Of a conversion of so many triangles.
pub(crate) fn of_conversion(triangles: f64) -> f64 {
    triangles * CONVERTED
}
