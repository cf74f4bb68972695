//! Thickening: the solid D_r = attractor + closed ball of radius r, by marching tetrahedra on a sparse
//! body-centred lattice of d^2 - r^2, with proven bounds.
//!
//! Guarantee: with rho the largest error of a leaf, the returned solid M satisfies
//! D(r - inner) subset M subset D(r + outer), where `inner` and `outer` contain rho, the lattice's bounds
//! (see `block`), the clamping of vertices and their rounding to single precision. M is a closed, oriented,
//! embedded 2-manifold: one triangle set per tetrahedron of a conforming complex, one vertex per cut edge
//! strictly inside it.
//!
//! Embedded also after rounding: cut every tetrahedron of the lattice along the surface into tetrahedra. Their
//! widths are at least 0.68 t^2 a (t the clamp; `embedding` measures it over all cases), and moving every vertex by
//! less than half of the least width keeps them all positively oriented, so the rounded complex is still a
//! triangulation of space and its triangles still meet only along shared edges and corners. t follows from that,
//! and a pitch is refused that would need too large a t.
//!
//! Papers: Labelle and Shewchuk, "Isosurface stuffing" (2007), for the lattice; Doi and Koide (1991) for
//! marching tetrahedra; the bounds are proven in `block`.

mod block;
#[cfg(test)]
mod embedding;
mod lattice;
mod octree;
mod stability;
mod stitch;
mod tree;

use crate::attractor::sites::{SiteError, SiteRule};
use crate::attractor::{Attractor, RefineError};
use crate::budget::{Budget, Stopped};
use crate::error::{Kind, LimitFacts};
use crate::measure::bounds::{AxisBox, bounding_box};
use crate::solid::{Solid, SolidError};
use crate::tolerance::{Radius, Tolerance};
use lattice::{ENCLOSING, Lattice};
use octree::Pass;
pub use stability::{Change, CriticalRadius, Stability, Verdict, stability};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use tree::Candidates;

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
    /// The box of the attractor, not dilated.
    pub bounds: AxisBox,
}

/// Why there is no solid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DilationError {
    /// Somebody stopped it.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// More triangles than allowed.
    #[error(
        "the tolerance of {tolerance_mm} mm needs about {asked:.0} triangles, and {allowed} are allowed; {reachable_mm:.4} mm would pass"
    )]
    Triangles {
        /// What was asked.
        tolerance_mm: f64,
        /// Triangles predicted or made so far.
        asked: f64,
        /// The limit.
        allowed: u64,
        /// A tolerance that would pass.
        reachable_mm: f64,
    },
    /// More memory than allowed.
    #[error("the tolerance of {tolerance_mm} mm needs about {asked:.0} bytes, and {allowed} are allowed; {reachable_mm:.4} mm would pass")]
    Memory {
        /// What was asked.
        tolerance_mm: f64,
        /// Bytes predicted.
        asked: f64,
        /// The limit.
        allowed: u64,
        /// A tolerance that would pass.
        reachable_mm: f64,
    },
    /// Single precision cannot carry the tolerance at these coordinates.
    #[error(
        "single-precision files cannot carry a tolerance of {tolerance_mm} mm at coordinates up to {extent_mm:.1} mm; {reachable_mm:.6} mm can be carried, or a shape nearer to the origin"
    )]
    Precision {
        /// What was asked.
        tolerance_mm: f64,
        /// Largest coordinate.
        extent_mm: f64,
        /// The finest tolerance that can be carried.
        reachable_mm: f64,
    },
    /// The tolerance cannot be reached with cells of the allowed depth.
    #[error(
        "cells of depth {allowed} are still {reached_mm:.3e} mm large, and the tolerance of {tolerance_mm} mm needs {needed_mm:.3e} mm: the maps contract too slowly"
    )]
    Depth {
        /// The limit.
        allowed: u32,
        /// What was asked.
        tolerance_mm: f64,
        /// Error that leaves must have.
        needed_mm: f64,
        /// Error of a cell at the limit.
        reached_mm: f64,
    },
    /// Cells overlap so much that too many matter at one place.
    #[error(
        "the cells overlap so much that more than {allowed} of them matter at one place; use fewer maps, maps that contract more, or a larger tolerance"
    )]
    Cells {
        /// The limit, from the memory that is allowed.
        allowed: usize,
    },
    /// A closed mesh given as a solid has no well-defined inside.
    #[error(
        "a closed mesh is taken as a solid, and crosses itself or has faces without area, so that its inside is not defined; mend it, or say \"interior\": \"surface\""
    )]
    Inside,
    /// Trimmed surfaces cannot be drawn as finely as their share of the tolerance asks.
    #[error("trimmed surfaces: {0}")]
    Trimmed(RefineError),
    /// The mesh is no closed manifold: our bug.
    #[error("the extracted surface is not a closed manifold: {0}")]
    Defect(SolidError),
}

impl From<SolidError> for DilationError {
    fn from(error: SolidError) -> Self {
        match error {
            SolidError::Stopped(stopped) => Self::Stopped(stopped),
            other => Self::Defect(other),
        }
    }
}

impl DilationError {
    /// How to react.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Stopped(stopped) => stopped.kind(),
            Self::Trimmed(error) => error.kind(),
            Self::Triangles { .. } | Self::Memory { .. } | Self::Depth { .. } | Self::Cells { .. } => Kind::Limit,
            Self::Precision { .. } => Kind::Unreachable,
            Self::Inside => Kind::Invalid,
            Self::Defect(_) => Kind::Defect,
        }
    }

    /// Stable code.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Stopped(stopped) => stopped.code(),
            Self::Trimmed(error) => error.code(),
            Self::Triangles { .. } => "limit-triangles",
            Self::Memory { .. } => "limit-memory",
            Self::Precision { .. } => "tolerance-unreachable",
            Self::Inside => "mesh.inside-undefined",
            Self::Depth { .. } => "limit-depth",
            Self::Cells { .. } => "limit-cells",
            Self::Defect(_) => "nonmanifold",
        }
    }

    /// The limit that was hit.
    #[must_use]
    pub fn limit(&self) -> Option<LimitFacts> {
        let facts = |limit, asked, allowed, reachable| LimitFacts { limit, asked, allowed, remedy: Some(("tolerance_mm", reachable)) };
        match *self {
            Self::Trimmed(ref error) => error.limit().map(|facts| LimitFacts {
                // What was asked of the trimmed surfaces is a share of the tolerance.
                remedy: facts.remedy.map(|(name, value)| (name, if name == "tolerance_mm" { value / TRIM_SHARE } else { value })),
                ..facts
            }),
            Self::Stopped(_) | Self::Defect(_) | Self::Inside => None,
            Self::Cells { allowed } => {
                Some(LimitFacts { limit: "cells", asked: allowed as f64 + 1.0, allowed: allowed as f64, remedy: None })
            }
            Self::Triangles { asked, allowed, reachable_mm, .. } => Some(facts("triangles", asked, allowed as f64, reachable_mm)),
            Self::Memory { asked, allowed, reachable_mm, .. } => Some(facts("memory_bytes", asked, allowed as f64, reachable_mm)),
            Self::Precision { tolerance_mm, reachable_mm, .. } => Some(facts("tolerance_mm", tolerance_mm, reachable_mm, reachable_mm)),
            Self::Depth { allowed, .. } => {
                Some(LimitFacts { limit: "depth", asked: f64::from(allowed) + 1.0, allowed: f64::from(allowed), remedy: None })
            }
        }
    }

    fn triangles(setting: &Setting, asked: f64, allowed: u64) -> Self {
        let reachable_mm = setting.tolerance * (1.1 * asked / allowed as f64).sqrt();
        Self::Triangles { tolerance_mm: setting.tolerance, asked, allowed, reachable_mm }
    }
}

/// Numbers that all blocks of one pass share, in mm or mm^2.
#[derive(Clone, Debug)]
pub(crate) struct Setting {
    lattice: Lattice,
    /// r, and r^2.
    radius: f64,
    square: f64,
    /// Vertices farther from the surface than this outwards, or deeper than `deep`, are on no cut edge.
    band: f64,
    /// r - a, and its square: nearer vertices are deep.
    deep: f64,
    deep_square: f64,
    /// Radius of the closing ball, and (r + gap)^2.
    gap: f64,
    gap_square: f64,
    /// Necks of the outside whose clearance is at least this stay open.
    neck: f64,
    /// sqrt(5)/4 a.
    enclosing: f64,
    /// t.
    clamp: f64,
    /// Rounding of positions and distances: far above what double precision loses, far below everything else.
    slack: f64,
    /// What was asked.
    tolerance: f64,
    /// Largest movement of a vertex by rounding to single precision.
    rounding: f64,
    /// Cells that one cube of space may hold at once; a block, whose cells are smaller, four times as many.
    cells: usize,
}

/// Radius of the closing ball in units of a. Without closing, Koch curves and Sierpinski tetrahedra come out with
/// false tunnels at most pitches, with 0.5 a at few, with 0.55 a and necks of 0.36 a at none of sixteen tried; and
/// up to 0.559 a closing seldom costs anything, the bound a priori being that. This is measured, not proven.
const CLOSING: f64 = 0.55;
/// See [`Setting`], in units of a: the lattice sees such a neck.
const NECK: f64 = 0.36;
/// Vertices keep at least this share t of an edge away from its ends, more when single precision asks.
const LEAST_CLAMP: f64 = 1.0 / 512.0;
/// t is at most this: beyond it the pitch is too fine for single precision.
const MOST_CLAMP: f64 = 1.0 / 16.0;
/// t^2 a must be this many times the movement of a vertex by rounding: 2 / 0.68, see the module's comment.
const CLAMP_ROUNDINGS: f64 = 2.95;
/// A pitch above this share of r would not see the shape.
const COARSEST: f64 = 0.7;
/// Passes from the coarsest pitch that might do to the one that is proven to do.
const PASSES: i32 = 4;
/// Bytes of a cell with its control points, nodes and sites.
const BYTES_PER_CELL: u64 = 400;
/// Bytes held at most for each triangle: block surfaces, the joined mesh and its verification.
const BYTES_PER_TRIANGLE: f64 = 80.0;

impl Setting {
    fn new(radius: f64, tolerance: f64, pitch: f64, fill: bool, cells: usize, bounds: &AxisBox) -> Self {
        let extent = extent(bounds, radius + 2.0 * pitch);
        let margin = radius + 1.5 * pitch;
        // An origin that no model's own planes are likely to meet: ties are legal, but cost clamping.
        let origin = std::array::from_fn(|axis| bounds.low[axis].low - margin - pitch * [0.137, 0.291, 0.413][axis]);
        let gap = if fill { CLOSING * pitch } else { 0.0 };
        let deep = (radius - pitch * 1.000_1).max(0.0);
        Self {
            lattice: Lattice { origin, pitch },
            radius,
            square: radius * radius,
            band: pitch * 1.000_1 + gap,
            deep,
            deep_square: deep * deep,
            gap,
            gap_square: (radius + gap).powi(2),
            neck: NECK * pitch,
            enclosing: ENCLOSING * pitch,
            clamp: (CLAMP_ROUNDINGS * rounding(extent) / pitch).sqrt().clamp(LEAST_CLAMP, MOST_CLAMP),
            slack: 1e-13 * extent,
            tolerance,
            rounding: rounding(extent),
            cells,
        }
    }

    /// Lengths beyond the lattice's own bounds: clamping outwards, rounding to single precision and the
    /// rounding of double precision.
    fn extra(&self) -> f64 {
        self.clamp * self.lattice.pitch + self.rounding + 10.0 * self.slack
    }
}

/// Largest coordinate of the box grown by `margin`.
fn extent(bounds: &AxisBox, margin: f64) -> f64 {
    (0..3).map(|axis| bounds.low[axis].low.abs().max(bounds.high[axis].high.abs()) + margin).fold(0.0, f64::max)
}

/// Half a unit in the last place of single precision, times sqrt(3), at coordinates up to `extent`.
fn rounding(extent: f64) -> f64 {
    extent * f64::from(f32::EPSILON) * 0.5 * 3.0_f64.sqrt()
}

/// Dilates an attractor by the closed ball of radius r, to the tolerance: both bounds of the result are at
/// most `tolerance`.
///
/// Cost follows the area of the result divided by the square of the tolerance (divided by r times the
/// tolerance where the result is smooth), not the number of cells. The result does not depend on the number
/// of threads.
///
/// # Errors
/// [`DilationError`]: a limit, with a value that would pass, or a stop.
pub fn dilate(attractor: &Attractor, radius: Radius, tolerance: Tolerance, budget: &Budget) -> Result<Dilation, DilationError> {
    let Some(Resolved { attractor: resolved, deviation_mm, rest }) = resolve(attractor, radius, tolerance, budget)? else {
        return dilate_cells(attractor, radius, tolerance, budget);
    };
    let dilation = dilate_cells(&resolved, radius, rest, budget)?;
    Ok(Dilation {
        inner_mm: dilation.inner_mm + deviation_mm,
        outer_mm: dilation.outer_mm + deviation_mm,
        bounds: bounding_box(attractor, budget)?,
        ..dilation
    })
}

/// Share of the tolerance that triangles which stand for trimmed surfaces may use.
const TRIM_SHARE: f64 = 0.1;

/// An attractor whose trimmed surfaces are triangles.
struct Resolved {
    attractor: Attractor,
    /// Its Hausdorff distance from the one asked for, at most.
    deviation_mm: f64,
    /// What it leaves of the tolerance: dilations of sets within d of each other, D(r) and D'(r), have D(r - d) in D'(r)
    /// in D(r + d), so that d adds to both bounds.
    rest: Tolerance,
}

/// Draws trimmed surfaces to their share of the tolerance; `None` when there are none.
fn resolve(attractor: &Attractor, radius: Radius, tolerance: Tolerance, budget: &Budget) -> Result<Option<Resolved>, DilationError> {
    if attractor.trimmed().is_empty() {
        return Ok(None);
    }
    let aimed = tolerance.mm().min(0.5 * radius.mm());
    let length = |mm: f64| Tolerance::new(mm).expect("a share of a positive length is positive");
    let share = length((TRIM_SHARE * aimed).max(f64::MIN_POSITIVE));
    let (attractor, deviation_mm) = attractor.resolved(share, budget).map_err(|error| match error {
        RefineError::Stopped(stopped) => DilationError::Stopped(stopped),
        other => DilationError::Trimmed(other),
    })?;
    Ok(Some(Resolved { attractor, deviation_mm, rest: length((aimed - deviation_mm).max(f64::MIN_POSITIVE)) }))
}

fn dilate_cells(attractor: &Attractor, radius: Radius, tolerance: Tolerance, budget: &Budget) -> Result<Dilation, DilationError> {
    let plan = Planned::new(attractor, radius, tolerance, budget)?;
    let first = plan.pass(attractor, plan.coarsest, false, true, budget)?;
    let mut made = first.made;
    if let Some(result) = first.accepted {
        return Ok(result);
    }
    for step in 1..PASSES {
        plan.admit(&made, plan.pitch(step), budget)?;
        let pass = plan.pass(attractor, plan.pitch(step), step < PASSES - 1, true, budget)?;
        if let Some(result) = pass.accepted {
            return Ok(result);
        }
        if pass.made.complete {
            made = pass.made;
        }
    }
    // What closing adds may reach a little beyond the bound a priori: how far, in units of a, differs little
    // from pitch to pitch.
    let mut pitch = plan.finest;
    let mut ratio = made.outer / made.pitch;
    for _ in 0..3 {
        pitch = (0.97 * plan.allowed() / ratio).min(0.97 * pitch);
        if pitch < plan.least {
            break;
        }
        let pass = plan.pass(attractor, pitch, false, true, budget)?;
        if let Some(result) = pass.accepted {
            return Ok(result);
        }
        ratio = ratio.max(pass.made.outer / pitch);
    }
    if let Some(result) = plan.pass(attractor, plan.finest, false, false, budget)?.accepted {
        return Ok(result);
    }
    // Without filling, the finest pass is within its bounds a priori: this is not reached.
    Err(DilationError::Defect(SolidError::Empty))
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

/// Triangles that a prediction may make to be surer.
const PREDICTION_WORK: f64 = 300_000.0;

/// Predicts what [`dilate`] will make, from coarse passes.
///
/// # Errors
/// As [`dilate`], for what shows before the work.
pub fn predict(attractor: &Attractor, radius: Radius, tolerance: Tolerance, budget: &Budget) -> Result<Prediction, DilationError> {
    let resolved = resolve(attractor, radius, tolerance, budget)?;
    let (attractor, tolerance) = resolved.as_ref().map_or((attractor, tolerance), |resolved| (&resolved.attractor, resolved.rest));
    let plan = Planned::new(attractor, radius, tolerance, budget)?;
    let unlimited = Budget {
        limits: crate::budget::Limits { triangles: u64::MAX, memory_bytes: u64::MAX, ..budget.limits },
        progress: None,
        ..budget.clone()
    };
    let prediction = |triangles: f64, pitch_mm: f64| Prediction { triangles, memory_bytes: triangles * BYTES_PER_TRIANGLE, pitch_mm };
    let mut step = 0;
    loop {
        let pass = plan.pass(attractor, plan.pitch(step), false, true, &unlimited)?;
        if let Some(result) = pass.accepted {
            return Ok(prediction(result.solid.topology().triangles as f64, result.pitch_mm));
        }
        step += 1;
        if step == PASSES - 1 || pass.made.triangles_at(plan.pitch(step)) > PREDICTION_WORK {
            return Ok(prediction(pass.made.triangles_at(plan.finest), plan.finest));
        }
    }
}

/// Refuses maps that contract so slowly that leaves would have longer addresses than allowed: the largest root
/// shrinks by the automaton's rate (its proven lower bound) at every step.
fn check_depth(attractor: &Attractor, aimed: f64, tolerance: Tolerance, budget: &Budget) -> Result<(), DilationError> {
    let rate = attractor.contraction().lower;
    let size = (0..attractor.roots().len())
        .filter(|&index| !attractor.automaton().state(attractor.roots()[index].state).transitions.is_empty())
        .map(|index| attractor.root_cell(index).ball.radius)
        .fold(0.0, f64::max);
    let needed_mm = 0.1 * aimed;
    let allowed = budget.limits.depth;
    let reached_mm = size * rate.powf(f64::from(allowed));
    if reached_mm > needed_mm {
        return Err(DilationError::Depth { allowed, tolerance_mm: tolerance.mm(), needed_mm, reached_mm });
    }
    Ok(())
}

/// What a pass made, whether or not it was good enough.
struct Made {
    triangles: f64,
    /// The lattice's outer bound.
    outer: f64,
    pitch: f64,
    complete: bool,
}

impl Made {
    /// Triangles at another pitch: as many to an area, in units of the pitch.
    fn triangles_at(&self, pitch: f64) -> f64 {
        self.triangles * (self.pitch / pitch).powi(2)
    }
}

/// A finished pass.
struct Attempt {
    accepted: Option<Dilation>,
    made: Made,
}

/// Pitches and bounds of a dilation before it begins.
struct Planned<'a> {
    radius: f64,
    /// The tolerance that is aimed at: smaller than asked when the radius is.
    tolerance: f64,
    coarsest: f64,
    finest: f64,
    /// Single precision carries no finer pitch.
    least: f64,
    bounds: AxisBox,
    rule: SiteRule<'a>,
}

impl<'a> Planned<'a> {
    fn new(attractor: &'a Attractor, radius: Radius, tolerance: Tolerance, budget: &Budget) -> Result<Self, DilationError> {
        let bounds = bounding_box(attractor, budget)?;
        let radius = radius.mm();
        // A tolerance of the radius' order would allow an empty result.
        let aimed = tolerance.mm().min(0.5 * radius);
        let rounding = rounding(extent(&bounds, 2.0 * radius));
        let rule = SiteRule::new(attractor, radius, aimed);
        check_depth(attractor, aimed, tolerance, budget)?;
        let allowed = aimed - rule.outer_reserve() - rounding;
        // a (sqrt(5)/4 + t) = allowed, with t = max(least clamp, sqrt(apart / a)).
        let apart = 1.02 * CLAMP_ROUNDINGS * rounding;
        let root = ((apart + 4.0 * ENCLOSING * allowed.max(0.0)).sqrt() - apart.sqrt()) / (2.0 * ENCLOSING);
        let finest = (allowed / (ENCLOSING + 1.01 * LEAST_CLAMP)).min(root * root).min(COARSEST * radius);
        let least = apart / (MOST_CLAMP * MOST_CLAMP);
        if finest < least {
            let reachable_mm = 1.01 * (least * (ENCLOSING + MOST_CLAMP) + rounding) / (1.0 - rule.outer_reserve() / aimed);
            return Err(DilationError::Precision { tolerance_mm: tolerance.mm(), extent_mm: extent(&bounds, radius), reachable_mm });
        }
        // inner = r - sqrt(r^2 - R^2 - R_site^2) with R = 0.559 a: the coarsest pitch that the inner bound allows,
        // with something left for clamping.
        let square = (radius - rule.inner_reserve()).powi(2) - (radius - 0.95 * aimed + rounding).powi(2);
        let coarsest = (square.max(0.0).sqrt() / ENCLOSING).min(COARSEST * radius).max(finest);
        Ok(Self { radius, tolerance: aimed, coarsest, finest, least, bounds, rule })
    }

    /// What the lattice's outer bound may be, rounding apart.
    fn allowed(&self) -> f64 {
        self.tolerance - self.rule.outer_reserve() - rounding(extent(&self.bounds, 2.0 * self.radius)) - LEAST_CLAMP * self.finest
    }

    /// The pitch of a pass: a geometric sequence from the coarsest to the finest.
    fn pitch(&self, step: i32) -> f64 {
        if step == PASSES - 1 || self.coarsest <= self.finest {
            return self.finest;
        }
        self.coarsest * (self.finest / self.coarsest).powf(f64::from(step) / f64::from(PASSES - 1))
    }

    /// Refuses what a coarser pass predicts to be over a limit, before the work.
    fn admit(&self, made: &Made, pitch: f64, budget: &Budget) -> Result<(), DilationError> {
        let asked = made.triangles_at(pitch);
        // Predictions from few triangles are uncertain; the pass itself counts too.
        let sure = 0.7 * asked;
        let reachable = |excess: f64| self.tolerance * (1.2 * excess).sqrt();
        let (triangles, memory) = (budget.limits.triangles, budget.limits.memory_bytes);
        if sure > triangles as f64 {
            let reachable_mm = reachable(asked / triangles as f64);
            return Err(DilationError::Triangles { tolerance_mm: self.tolerance, asked, allowed: triangles, reachable_mm });
        }
        if sure * BYTES_PER_TRIANGLE > memory as f64 {
            let asked = asked * BYTES_PER_TRIANGLE;
            let reachable_mm = reachable(asked / memory as f64);
            return Err(DilationError::Memory { tolerance_mm: self.tolerance, asked, allowed: memory, reachable_mm });
        }
        Ok(())
    }

    /// One pass at a pitch. With `hasty` it is given up at the first block that is not good enough.
    fn pass(&self, attractor: &Attractor, pitch: f64, hasty: bool, fill: bool, budget: &Budget) -> Result<Attempt, DilationError> {
        // The roots are there anyway; what grows beyond them may take a fair share of the memory.
        let cells = (budget.limits.memory_bytes / (8 * BYTES_PER_CELL)).clamp(50_000, 4_000_000) as usize + 2 * attractor.roots().len();
        let setting = Setting::new(self.radius, self.tolerance, pitch, fill, cells, &self.bounds);
        let allowed = self.tolerance - self.rule.outer_reserve() - setting.extra();
        let (blocks, candidates) = self.space(attractor, &setting);
        let pass = Pass {
            attractor,
            rule: &self.rule,
            setting: &setting,
            budget,
            outer_allowed: if hasty { allowed } else { f64::INFINITY },
            too_coarse: AtomicBool::new(false),
            triangles: AtomicU64::new(0),
            done: AtomicU64::new(0),
            space: (blocks as f64).powi(3),
            workshops: Mutex::new(Vec::new()),
        };
        let surfaces = pass.run([0; 3], blocks, &candidates)?;
        let made = Made {
            triangles: pass.triangles.load(Ordering::Relaxed) as f64,
            outer: surfaces.iter().map(|surface| surface.outer).fold(0.0, f64::max),
            pitch,
            complete: !pass.too_coarse.load(Ordering::Relaxed),
        };
        drop(pass);
        if !made.complete {
            return Ok(Attempt { accepted: None, made });
        }
        budget.report("dilate", 1.0, made.triangles as u64);
        let accepted = self.certify(&setting, surfaces, budget)?;
        Ok(Attempt { accepted, made })
    }

    /// The cube of space to refine, and the roots as its candidates.
    fn space(&self, attractor: &Attractor, setting: &Setting) -> (i64, Candidates) {
        let size = (0..3)
            .map(|axis| self.bounds.high[axis].high + self.radius + 1.5 * setting.lattice.pitch - setting.lattice.origin[axis])
            .fold(0.0, f64::max);
        let blocks = (size / (setting.lattice.pitch * block::SIDE as f64)).ceil().max(1.0) as u64;
        let mut candidates = Candidates::default();
        for (index, root) in attractor.roots().iter().enumerate() {
            let cell = attractor.root_cell(index);
            let leaf = self.rule.leaf(&cell, &root.points).is_some();
            candidates.push(cell, &root.points, leaf);
        }
        (blocks.next_power_of_two() as i64, candidates)
    }

    fn certify(&self, setting: &Setting, surfaces: Vec<block::BlockSurface>, budget: &Budget) -> Result<Option<Dilation>, DilationError> {
        let largest = |value: fn(&block::BlockSurface) -> f64| surfaces.iter().map(value).fold(0.0, f64::max);
        let outer_lattice = largest(|surface| surface.outer);
        let inner_square = largest(|surface| surface.inner_square) + setting.enclosing.powi(2);
        let site = surfaces.iter().map(|surface| surface.site_error).fold(SiteError::default(), SiteError::max);
        // x is in the solid if d(x, S)^2 <= r^2 - R^2, and d(x, S)^2 <= (d(x, A) + inner)^2 + inner_square.
        let inner_lattice = self.radius - (setting.square - inner_square - site.inner_square).max(0.0).sqrt();
        let (inner, outer) = (inner_lattice + site.inner + setting.extra(), outer_lattice + site.outer + setting.extra());
        if inner.max(outer) > self.tolerance {
            return Ok(None);
        }
        let leaf_cells = surfaces.iter().map(|surface| surface.leaves).sum();
        let mesh = stitch::join(surfaces, budget)?;
        // Signs from pseudo-normals are right for embedded surfaces only; elsewhere they tear the result.
        let has_solids = !self.rule.attractor().solids().is_empty();
        let solid = Solid::new(mesh, budget).map_err(|error| match error {
            SolidError::NotManifold(_) if has_solids => DilationError::Inside,
            other => other.into(),
        })?;
        Ok(Some(Dilation { solid, inner_mm: inner, outer_mm: outer, pitch_mm: setting.lattice.pitch, leaf_cells, bounds: self.bounds }))
    }
}
