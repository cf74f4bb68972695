//! Measures of a shape that are made when they are asked for: its smallest box, and the thickness of walls and gaps.

use glam::DVec3;
use lacuna_kernel::attractor::{Attractor, RefineError, refine};
use lacuna_kernel::budget::{Budget, Limits, Stopped};
use lacuna_kernel::error::{Kind, LimitFacts};
use lacuna_kernel::measure::mass::mesh_of;
use lacuna_kernel::measure::section::{NoDirection, PlaneFrame};
use lacuna_kernel::measure::{FOLD, Side, Thickness, ThicknessMap, extent_along, oriented_box, thickness, thickness_map};
use lacuna_kernel::solid::{Crossings, TriMesh};
use lacuna_kernel::tessellation::Tessellation;
use lacuna_kernel::tolerance::Tolerance;

use crate::certificate::Interval;
use crate::operand::is_solid;
use crate::run::{Geometry, JobError};

/// The smallest box around the exact shape, whatever way it is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct OrientedBoxStatement {
    /// Unit vectors along the edges of a box that holds the shape.
    pub axes: [[f64; 3]; 3],
    /// Its middle.
    pub centre_mm: [f64; 3],
    /// Its edges.
    pub sizes_mm: [f64; 3],
    /// The volume of the smallest box lies between; the upper end is the volume of this one.
    #[cfg_attr(feature = "wire", schema(schema_with = crate::certificate::interval_schema))]
    pub volume_mm3: Interval,
    /// Whether the bounds are within a thousandth of each other, and what the tolerance takes.
    pub complete: bool,
}

/// How far a shape extends along a direction: between two planes across it that touch the shape.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct ExtentStatement {
    /// The direction, of length 1.
    pub direction: [f64; 3],
    /// The least x . direction of points x of the shape.
    #[cfg_attr(feature = "wire", schema(schema_with = crate::certificate::interval_schema))]
    pub from_mm: Interval,
    /// The largest.
    #[cfg_attr(feature = "wire", schema(schema_with = crate::certificate::interval_schema))]
    pub to_mm: Interval,
    /// Their difference: the width of the shape along the direction.
    #[cfg_attr(feature = "wire", schema(schema_with = crate::certificate::interval_schema))]
    pub width_mm: Interval,
}

/// A least thickness, and where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct LeastThicknessStatement {
    /// The thickness.
    #[cfg_attr(feature = "wire", schema(schema_with = crate::certificate::interval_schema))]
    pub least_mm: Interval,
    /// A point of a face, and the one across.
    pub between_mm: [[f64; 3]; 2],
}

/// Least thickness along the normals of the mesh that is measured, between faces that look at each other, whose normals are opposite within 45 degrees and that have no corner in common: beside
/// edges sharper than a right angle every wall ends in nothing. For a dilation the mesh is the one that would be written, without simplification, faces lower than twice its
/// bound tell no direction, and those nearer to each other than thrice the bound are taken for folds of one surface.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct ThicknessStatement {
    /// Of walls, through the material; absent where no face lies across another.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub wall: Option<LeastThicknessStatement>,
    /// Of gaps, through the air.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub gap: Option<LeastThicknessStatement>,
}

impl ThicknessStatement {
    /// What is thinner than what may be folds of a mesh that stands for another shape within a tolerance, if anything is.
    pub(crate) fn folds(&self, tolerance: Tolerance) -> Option<String> {
        let fold = FOLD * tolerance.mm();
        let thin = |(name, found): (&str, &Option<LeastThicknessStatement>)| {
            found.as_ref().filter(|found| found.least_mm[0] < fold).map(|found| format!("{name} of {:e} mm", found.least_mm[0]))
        };
        let thin: Vec<String> = [("a wall", &self.wall), ("a gap", &self.gap)].into_iter().filter_map(thin).collect();
        let thin = (!thin.is_empty()).then(|| thin.join(" and "))?;
        Some(format!(
            "the mesh has {thin}, less than {fold:e} mm: if it stands for another shape within the tolerance of {:e} mm, that may be a fold of one surface; measure that shape itself with \"radius_mm\", or \
             give the mesh's own tolerance",
            tolerance.mm()
        ))
    }
}

/// A solid's mesh with the thickness of its walls and gaps, which is measured as that of a [`ThicknessStatement`].
#[derive(Clone, Debug, PartialEq)]
pub struct MappedThickness {
    /// The mesh that was measured, in double precision.
    pub mesh: TriMesh,
    /// Through the material.
    pub wall: ThicknessMap,
    /// Through the air.
    pub gap: ThicknessMap,
}

/// Bounds of the smallest box differ by this share of it.
const RELATIVE: f64 = 1e-3;
/// Leaf cells that the points of a smallest box are taken from at most; with more, a larger tolerance is taken, which the bounds tell.
const MOST_CELLS: u64 = 30_000;

/// How far a shape, dilated by a radius between two, extends along a direction.
pub(crate) fn extent(attractor: &Attractor, direction: DVec3, radii_mm: [f64; 2], budget: &Budget) -> Result<ExtentStatement, JobError> {
    let no_direction = |error: NoDirection| JobError::new(Kind::Invalid, "bad-parameter", error.to_string());
    let direction = PlaneFrame::new(direction).map_err(no_direction)?.normal();
    let [least, largest] = extent_along(attractor, direction, budget)?;
    let [from, to] = [[least.low - radii_mm[1], least.high - radii_mm[0]], [largest.low + radii_mm[0], largest.high + radii_mm[1]]];
    let width_mm = [(to[0] - from[1]).next_down().max(0.0), (to[1] - from[0]).next_up()];
    Ok(ExtentStatement { direction: direction.to_array(), from_mm: from, to_mm: to, width_mm })
}

/// The smallest box of a shape dilated by a radius, 0 for the shape itself.
pub(crate) fn smallest_box(
    attractor: &Attractor,
    radius_mm: f64,
    tolerance: Tolerance,
    budget: &Budget,
) -> Result<Option<OrientedBoxStatement>, JobError> {
    let (points, slack) = match mesh_of(attractor) {
        // Corners once, and not once for every triangle.
        _ if is_solid(attractor) => (attractor.surfaces().into_iter().flat_map(|surface| surface.vertices).collect(), 0.0),
        Some((mesh, _)) => (mesh.vertices, 0.0),
        None => {
            let sample = sampled(attractor, tolerance, MOST_CELLS, budget)?;
            (sample.vertices, sample.deviation_mm)
        }
    };
    let found = oriented_box(&points, 2.0 * radius_mm, slack, RELATIVE, budget)?;
    Ok(found.map(|found| OrientedBoxStatement {
        axes: found.axes.map(|axis| axis.to_array()),
        centre_mm: found.centre.to_array(),
        sizes_mm: found.sizes,
        volume_mm3: [found.volume.low, found.volume.high],
        complete: found.complete,
    }))
}

/// A shape as coarse as its leaf cells are few enough.
pub(crate) fn sampled(attractor: &Attractor, tolerance: Tolerance, most_cells: u64, budget: &Budget) -> Result<Tessellation, JobError> {
    let limits = Limits { cells: most_cells.min(budget.limits.cells), ..budget.limits };
    let few = Budget { limits, progress: None, ..budget.clone() };
    let mut coarse = tolerance.mm();
    loop {
        match refine(attractor, Tolerance::new(coarse)?, &few) {
            Ok(sample) => return Ok(sample),
            Err(RefineError::Cells { .. } | RefineError::Memory { .. }) => coarse *= 2.0,
            Err(error) => return Err(error.into()),
        }
    }
}

/// Least walls and gaps of a closed mesh that stands for a shape within `error_mm`, and their map if it is wanted.
pub(crate) fn walls_and_gaps(
    mesh: &TriMesh,
    error_mm: f64,
    mapped: bool,
    budget: &Budget,
) -> Result<(ThicknessStatement, Geometry), JobError> {
    let count = mesh.triangles.len() as u64;
    if mapped && count > budget.limits.triangles {
        #[expect(clippy::cast_precision_loss, reason = "limits are shown, not computed with")]
        let (asked, allowed) = (count as f64, budget.limits.triangles as f64);
        let message = format!("the map of thickness has the solid's {count} triangles; {allowed} are allowed");
        let limit = Some(LimitFacts { limit: "triangles", asked, allowed, remedy: None });
        return Err(JobError { limit, ..JobError::new(Kind::Limit, "thickness.triangles", message) });
    }
    // Parts that touch have corners of their own there, as a repair leaves them; they are no wall and no gap, and do not cross.
    let (firsts, mut joined) = (mesh.firsts_by_place(), mesh.clone());
    joined.triangles.iter_mut().flatten().for_each(|corner| *corner = firsts[*corner as usize]);
    let crossings = Crossings::of(&joined, budget)?.count;
    if crossings > 0 {
        let message = format!("{crossings} pairs of faces of the solid meet where they are not joined: its walls have no thickness there");
        return Err(JobError::new(Kind::Unreachable, "thickness.crossings", message));
    }
    let stated = |found: Option<Thickness>| {
        found.map(|found| LeastThicknessStatement {
            least_mm: [found.least.low, found.least.high],
            between_mm: found.between.map(|point| point.to_array()),
        })
    };
    if !mapped {
        let [wall, gap] = [thickness(&joined, Side::Wall, error_mm, budget)?, thickness(&joined, Side::Gap, error_mm, budget)?];
        return Ok((ThicknessStatement { wall: stated(wall), gap: stated(gap) }, Geometry::None));
    }
    // The map tells the least as well.
    let mapped = |side: Side| -> Result<ThicknessMap, Stopped> {
        let map = thickness_map(&joined, side, error_mm, budget)?;
        let vertices = firsts.iter().map(|&first| map.vertices[first as usize]).collect();
        Ok(ThicknessMap { vertices, ..map })
    };
    let [wall, gap] = [mapped(Side::Wall)?, mapped(Side::Gap)?];
    let least = ThicknessStatement { wall: stated(wall.least), gap: stated(gap.least) };
    Ok((least, Geometry::Thickness(Box::new(MappedThickness { mesh: mesh.clone(), wall, gap }))))
}

/// The shape has no walls.
pub(crate) fn no_solid() -> JobError {
    let message = "only solids have walls and gaps: the shape is not one closed surface; give \"radius_mm\", and its dilation is measured";
    JobError::new(Kind::Invalid, "job.not-a-solid", message.into())
}
