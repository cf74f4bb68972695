//! Shapes that stand for others: triangles for trimmed and for smooth surfaces and around volumes, fewer of them for fine meshes, and roots with one radius each.

use super::DilationError;
use super::arrangement::without_lines;
use super::decimation::{decimated, is_finer};
use super::plan::{Balls, Meant, Plan};
use super::unfold::unfolded;
use crate::attractor::{Attractor, RefineError};
use crate::budget::{Budget, Limits};
use crate::groups::Groups;
use crate::measure::bounds::{AxisBox, bounding_box, dilated_box};
use crate::solid::TriMesh;
use crate::tolerance::{Radius, Tolerance};
use std::borrow::Cow;

/// Share of the tolerance that triangles which stand for trimmed surfaces, or around volumes, may use.
const TRIM_SHARE: f64 = 0.1;

/// Share of the tolerance by which radii may be off where they vary.
const GRADE_SHARE: f64 = 0.4;

/// Share of the tolerance that triangles which stand for smooth surfaces may use.
const SMOOTH_SHARE: f64 = 0.2;

/// Share of it by which they may move where they turn back.
const UNFOLDED_SHARE: f64 = 0.2;

/// Shares of the tolerance that fewer triangles may use which stand for a mesh: of at least so many, and of fewer, such as turned parts with long thin triangles, as they are tried. The nearer to it they are, the more often the topology of either is shown to be that of the other one; where that of few is not, all of them are asked.
const MANY_TRIANGLES: usize = 20_000;
const SHARE_OF_MANY: f64 = 0.2;
const FEW_TRIANGLES: usize = 500;
pub(super) const SHARES_OF_FEW: [f64; 3] = [0.0125, 0.05, 0.2];
/// Of so many triangles one has to be left at most for it to be worth while. Of many not all can be asked where those that are left do not tell the topology.
const WORTH_OF_MANY: usize = 8;
pub(super) const WORTH_OF_FEW: usize = 3;
/// Bytes that it takes for each of these at most to find them.
const BYTES_PER_TRIANGLE: u64 = 1_000;

/// How far from its surface a solid may be another one then, as a share of how far dilations within the tolerance reach at least.
const NEAR_SURFACE: f64 = 0.9;

/// Cells of a smooth surface at most: in any case, and for each square of the radius times the tolerance in half of the box around. With no radius of curvature below that of the ball a cell that is off by a fifth of the tolerance has about one such square; rough surfaces have more.
const FEW_CELLS: f64 = 10_000.0;
const CELLS_PER_SQUARE: f64 = 20.0;

/// Bytes that sheets along a cell take at most.
const BYTES_PER_CELL: u64 = 4_000;

/// An attractor that stands for another one.
pub(super) struct Drawn<'a> {
    pub(super) attractor: Attractor,
    balls: Balls,
    pub(super) meant: Meant<'a>,
    /// What it leaves of the tolerance: dilations of sets within d of each other, D(r) and D'(r), have D(r - d) in D'(r)
    /// in D(r + d), so that d adds to both bounds.
    rest: Tolerance,
}

impl<'a> Drawn<'a> {
    /// Draws trimmed surfaces and the faces of volumes to their share of the tolerance, times `coarseness`, and splits roots whose radius varies; `None` when there are none, or no volumes that are proven to be solids.
    pub(super) fn resolved(
        attractor: &'a Attractor,
        radius: Radius,
        tolerance: Tolerance,
        coarseness: f64,
        budget: &Budget,
    ) -> Result<Option<Self>, DilationError> {
        let is_trimmed = !attractor.trimmed().is_empty();
        if !is_trimmed && !attractor.has_own_radii() && !attractor.has_volumes() {
            return Ok(None);
        }
        let length = |mm: f64| Tolerance::new(mm).unwrap_or(tolerance);
        let [least, most] = attractor.radii(radius.mm());
        let balls = Balls { least, most };
        let aimed = tolerance.mm().min(0.5 * balls.least);
        let share = coarseness * TRIM_SHARE;
        let (mut changed, mut deviation_mm) = (Cow::Borrowed(attractor), 0.0);
        if is_trimmed {
            let (resolved, off) = attractor.resolved(length(share * aimed), budget).map_err(|error| refused(error, share))?;
            (changed, deviation_mm) = (Cow::Owned(resolved), off);
        } else if let Some((filled, off)) =
            unless_stopped(attractor.filled(length(share * aimed), budget).map_err(|error| refused(error, share)))?
        {
            (changed, deviation_mm) = (Cow::Owned(filled), off);
        } else if !attractor.has_own_radii() {
            return Ok(None);
        }
        if attractor.has_own_radii() {
            let graded = changed.graded(radius.mm(), GRADE_SHARE * aimed, budget).map_err(|error| refused(error, GRADE_SHARE))?;
            deviation_mm += graded.deviation_mm;
            let least = graded.radii.iter().copied().fold(f64::INFINITY, f64::min);
            let most = graded.radii.iter().copied().fold(0.0, f64::max);
            let (balls, rest) = (Balls { least, most }, length(aimed - deviation_mm));
            let off = if deviation_mm > 0.0 { f64::INFINITY } else { 0.0 };
            let bounds = dilated_box(&graded.attractor, budget)?.widened(deviation_mm);
            return Ok(Some(Self { attractor: graded.attractor, balls, meant: Meant { off, deviation_mm, bounds, shape: None }, rest }));
        }
        let bounds = bounding_box(attractor, budget)?.grown(radius.mm());
        let meant = Meant { off: deviation_mm, deviation_mm, bounds, shape: None };
        Ok(Some(Self { attractor: changed.into_owned(), balls, meant, rest: length(aimed - deviation_mm) }))
    }

    /// Draws a surface with a B-rep, or what volumes are bounded by, to its share of the tolerance; `None` where it is no such shape, or has more cells than one that is smooth for balls of this radius: another way may do with fewer.
    pub(super) fn smooth(
        attractor: &'a Attractor,
        radius: Radius,
        tolerance: Tolerance,
        budget: &Budget,
    ) -> Result<Option<Self>, DilationError> {
        let is_surface = attractor.is_surface();
        if !is_surface && (!attractor.has_volumes() || attractor.has_own_radii()) {
            return Ok(None);
        }
        let radius = radius.mm();
        let aimed = tolerance.mm().min(0.5 * radius);
        let Ok(share) = Tolerance::new(SMOOTH_SHARE * aimed) else { return Ok(None) };
        let bounds = bounding_box(attractor, budget)?;
        let [x, y, z] = std::array::from_fn(|axis| bounds.high[axis].high - bounds.low[axis].low);
        let cells = (FEW_CELLS + CELLS_PER_SQUARE * (x * y + y * z + z * x) / (radius * aimed)) as u64;
        let limits = Limits { cells: cells.min(budget.limits.memory_bytes / BYTES_PER_CELL).min(budget.limits.cells), ..budget.limits };
        let few = Budget { limits, ..budget.clone() };
        let came = |error| refused(error, SMOOTH_SHARE);
        if !is_surface {
            let filled = unless_stopped(attractor.filled(share, &few).map_err(came))?;
            return Ok(filled.and_then(|(filled, deviation_mm)| Self::near(None, filled, &bounds, radius, [aimed, deviation_mm])));
        }
        let Some((mesh, deviation_mm)) = unless_stopped(attractor.drawn(share, &few).map(Some).map_err(came))? else { return Ok(None) };
        let (mesh, moved) = unfolded(mesh, UNFOLDED_SHARE * aimed);
        let deviation_mm = deviation_mm + moved;
        Ok(Attractor::of_triangles(&mesh, false)
            .and_then(|drawn| Self::near(Some(attractor), drawn, &bounds, radius, [aimed, deviation_mm])))
    }

    /// What stands for a shape in a box, no place of either farther from the other one than told, with one radius; none where that leaves nothing of what is aimed at.
    fn near(
        shape: Option<&'a Attractor>,
        attractor: Attractor,
        bounds: &AxisBox,
        radius: f64,
        [aimed, deviation_mm]: [f64; 2],
    ) -> Option<Self> {
        let rest = Tolerance::new(aimed - deviation_mm).ok()?;
        let meant = Meant { off: deviation_mm, deviation_mm, bounds: bounds.grown(radius), shape };
        Some(Self { attractor, balls: Balls { least: radius, most: radius }, meant, rest })
    }

    /// Fewer triangles for a mesh that is finer than needed, within a share of the tolerance; `None` where it is no such.
    pub(super) fn decimated(
        finer: &Finer,
        attractor: &'a Attractor,
        radius: Radius,
        tolerance: Tolerance,
        share: f64,
        budget: &Budget,
    ) -> Result<Option<Self>, DilationError> {
        let Finer { mesh, is_solid } = finer;
        let radius = radius.mm();
        let aimed = tolerance.mm().min(0.5 * radius);
        // Whatever is farther from the surface than this is in both solids, or in none.
        let farthest = if *is_solid { NEAR_SURFACE * (radius - aimed) } else { f64::INFINITY };
        let most = share * aimed;
        let Some(fewer) = decimated(mesh, most, farthest, finer.worth(), budget)? else { return Ok(None) };
        let (bounds, drawn) = (bounding_box(attractor, budget)?, Attractor::of_triangles(&fewer, *is_solid));
        Ok(drawn.and_then(|drawn| Self::near(Some(attractor), drawn, &bounds, radius, [aimed, most])))
    }

    /// The plan of its dilation, as that of the other one.
    pub(super) fn plan(&self, simplify: bool, coarseness: f64, budget: &Budget) -> Result<Plan<'_>, DilationError> {
        let plan = Plan::new(&self.attractor, self.balls, self.rest, simplify, coarseness, budget)?;
        Ok(plan.standing_for(self.meant))
    }
}

/// A mesh in one piece of triangles that are finer than needed, and whether it bounds a solid.
pub(super) struct Finer {
    mesh: TriMesh,
    is_solid: bool,
}

impl Finer {
    /// None where it is something else: parts that are alike are made once, as they are.
    pub(super) fn of(attractor: &Attractor, radius: Radius, tolerance: Tolerance, budget: &Budget) -> Option<Self> {
        let count = attractor.roots().len();
        if count < FEW_TRIANGLES || count as u64 > budget.limits.memory_bytes / BYTES_PER_TRIANGLE {
            return None;
        }
        let (mut mesh, is_solid) = attractor.triangles()?;
        mesh.triangles = without_lines(mesh.triangles)?;
        let is_whole = Groups::of_triangles(mesh.vertices.len(), &mesh.triangles).all().iter().all(|&group| group == 0);
        let finer = Self { mesh, is_solid };
        let most = finer.most_share() * tolerance.mm().min(0.5 * radius.mm());
        (is_whole && is_finer(&finer.mesh, most, finer.worth())).then_some(finer)
    }

    /// Whether it has so few triangles that all of them may be asked where fewer do not tell the topology.
    pub(super) fn has_few(&self) -> bool {
        self.mesh.triangles.len() < MANY_TRIANGLES
    }

    /// The largest share of the tolerance that fewer triangles may use.
    pub(super) fn most_share(&self) -> f64 {
        if self.has_few() { SHARES_OF_FEW.into_iter().fold(0.0, f64::max) } else { SHARE_OF_MANY }
    }

    /// Of so many triangles one has to be left at most.
    fn worth(&self) -> usize {
        if self.has_few() { WORTH_OF_FEW } else { WORTH_OF_MANY }
    }
}

/// What came of a way that is one of several: refusals are no reason to refuse the others.
///
/// # Errors
/// A stop.
pub(super) fn unless_stopped<T>(came: Result<Option<T>, DilationError>) -> Result<Option<T>, DilationError> {
    match came {
        Err(DilationError::Stopped(stopped)) => Err(DilationError::Stopped(stopped)),
        Err(_) => Ok(None),
        Ok(came) => Ok(came),
    }
}

/// The error of a stage that draws within a share of the tolerance.
fn refused(error: RefineError, share: f64) -> DilationError {
    match error {
        RefineError::Stopped(stopped) => DilationError::Stopped(stopped),
        error => DilationError::Drawn { error, share },
    }
}
