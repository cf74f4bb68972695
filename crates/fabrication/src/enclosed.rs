//! What a closed surface that is no mesh encloses, and what triangles that stand for it tell of that.

use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::budget::Budget;
use lacuna_kernel::error::Kind;
use lacuna_kernel::measure::mass::{area, volume};
use lacuna_kernel::measure::{AxisBox, NotEnclosed, Windings, enclosed_volume};
use lacuna_kernel::solid::{Solid, SolidError, TriMesh};
use lacuna_kernel::tolerance::Tolerance;

use crate::Certificate;
use crate::certificate::Interval;
use crate::operand::neighbourhood;
use crate::run::JobError;
use crate::shape_measures::sampled;

/// How a volume was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(rename_all = "snake_case"))]
pub enum VolumeMethod {
    /// From trilinear forms of the control points that solve the subdivision's linear systems: exact but for rounding, which the interval holds.
    TrilinearForms,
}

/// The volume that a closed surface encloses. The surface itself, being a sheet, has none.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct EnclosedStatement {
    /// The volume; where the surface passes through itself, parts are counted as often as it winds around them.
    #[cfg_attr(feature = "wire", schema(schema_with = crate::certificate::interval_schema))]
    pub volume_mm3: Interval,
    /// How it was found.
    pub method: VolumeMethod,
    /// Proven: every point farther than this from the surface is counted once, or not at all. Absent where that is not known; nearer ones are not checked.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub counted_once_beyond_mm: Option<f64>,
    /// Proven: the surface passes through itself, as this point shows.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub counted_otherwise: Option<CountedPoint>,
}

/// A point around which a closed surface winds neither once nor not at all.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct CountedPoint {
    /// The point.
    pub point_mm: [f64; 3],
    /// How often it counts in the volume; below 0 where it is taken away.
    pub times: i64,
}

/// The surface is drawn as finely as this share of its size, or finer.
const FINENESS: f64 = 1.0 / 256.0;
/// By no more leaf cells than these, which take about a second.
const MOST_CELLS: u64 = 200_000;

impl Certificate {
    /// Adds what a closed surface encloses, how often places count in that, and mass, centroid and inertia of it. Nothing of shapes that are no closed surface.
    pub(crate) fn state_enclosed(
        &mut self,
        attractor: &Attractor,
        bounds: &AxisBox,
        tolerance: Tolerance,
        density_g_cm3: Option<f64>,
        budget: &Budget,
    ) -> Result<(), JobError> {
        let volume = match enclosed_volume(attractor, budget) {
            Ok(volume) => volume,
            Err(NotEnclosed::NoSurface | NotEnclosed::Open(_)) => return Ok(()),
            Err(NotEnclosed::Stopped(stopped)) => return Err(stopped.into()),
            Err(reason) => {
                self.warnings.push(format!("the enclosed volume is not known: {reason}"));
                return Ok(());
            }
        };
        let mut stated = EnclosedStatement {
            volume_mm3: [volume.low, volume.high],
            method: VolumeMethod::TrilinearForms,
            counted_once_beyond_mm: None,
            counted_otherwise: None,
        };
        self.state_mass(stated.volume_mm3, density_g_cm3);
        let counts = "the enclosed volume, and a mass, count every place as often as it winds around it";
        let Some((mesh, deviation)) = drawn(attractor, bounds, tolerance, budget)? else {
            self.warnings.push(format!("whether the surface passes through itself is not checked; where it does, {counts}"));
            self.enclosed = Some(stated);
            return Ok(());
        };
        match Windings::of(&mesh, deviation, budget)? {
            Windings::Once => {
                // The surface is as near to the triangles as they are to it: a point farther than twice that from it is farther than once that from them.
                let beyond = (2.0 * deviation).next_up();
                stated.counted_once_beyond_mm = Some(beyond);
                self.warnings.push(format!(
                    "no crossing of the surface was found within {deviation:.3e} mm: places farther than {beyond:.3e} mm from it count once; nearer ones are not checked, and where it passes through itself there, {counts}"
                ));
                // Whatever it winds around and the triangles do not, or the other way around, is within the deviation of the triangles.
                self.state_moments(&mesh, neighbourhood(&mesh, deviation), &bounds.grown(deviation));
            }
            Windings::Repeated { point, winding } => {
                let [x, y, z] = point.to_array();
                stated.counted_otherwise = Some(CountedPoint { point_mm: [x, y, z], times: winding });
                self.warnings.push(format!(
                    "the surface passes through itself: it winds {winding} times around the point {x}, {y}, {z}; {counts}, and no centroid is told"
                ));
            }
            Windings::Unsettled { pairs } => self.warnings.push(format!(
                "the surface may pass through itself: {pairs} pairs of triangles that stand for it within {deviation:.3e} mm meet where they are not joined; where it does, {counts}, and no centroid is told"
            )),
        }
        if self.area_mm2.is_none() {
            self.warnings.push(format!(
                "the area of the surface is not known: bounds are computed of triangles and of Bezier patches; that of the triangles that stand for it within {deviation:.3e} mm, an estimate where it is smooth, is {} mm2",
                area(&mesh)
            ));
        }
        self.enclosed = Some(stated);
        Ok(())
    }
}

/// A closed surface as a mesh that encloses a volume above 0, and how far they are from each other; `None` where limits leave no such mesh.
fn drawn(attractor: &Attractor, bounds: &AxisBox, tolerance: Tolerance, budget: &Budget) -> Result<Option<(TriMesh, f64)>, JobError> {
    let Ok(fine) = Tolerance::new(tolerance.mm().min(FINENESS * bounds.diagonal())) else { return Ok(None) };
    let drawn = match sampled(attractor, fine, MOST_CELLS, budget) {
        Ok(drawn) => drawn,
        Err(error) if error.kind == Kind::Limit => return Ok(None),
        Err(error) => return Err(error),
    };
    let mut mesh = TriMesh { vertices: drawn.vertices, triangles: drawn.triangles };
    if volume(&mesh) < 0.0 {
        mesh.reverse();
    }
    match Solid::new(mesh, budget) {
        Ok(solid) => Ok(Some((solid.into_mesh(), drawn.deviation_mm))),
        Err(SolidError::Stopped(stopped)) => Err(stopped.into()),
        Err(_) => Ok(None),
    }
}
