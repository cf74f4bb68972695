//! Levels of iterated function systems as exact solids.

use lacuna_kernel::budget::Budget;
use lacuna_kernel::error::Kind;
use lacuna_kernel::levels::{LevelError, LevelPrimitive, predict, solid_level};
use lacuna_kernel::measure::bounding_box;
use lacuna_kernel::model::{Ifs, Shape};

use crate::plan::{Plan, stl_bytes};
use crate::run::{JobError, Outcome, lower};
use crate::{Geometry, Job, certificate, effort};

/// What was copied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(rename_all = "snake_case"))]
pub enum CopiedPrimitive {
    /// The model's own solid.
    Stated,
    /// The model has none: the box of its attractor.
    Box,
}

/// A level of a system as a solid. Its copies have no inner point in common, proven in integers; faces of theirs that coincide are gone, by integers as well. The
/// box, the volume and the area beside it are those of the exact level, not of the attractor.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct LevelStatement {
    /// The level: the length of the addresses of the copies.
    pub level: u32,
    /// What was copied.
    pub primitive: CopiedPrimitive,
    /// Copies that were joined.
    pub copies: f64,
    /// Faces that cancelled in the last step from level to level.
    pub cancelled_faces: u64,
    /// Corners that were doubled, because parts of the solid meet there, or along edges there, without being joined.
    pub doubled_vertices: u64,
}

impl From<LevelError> for JobError {
    fn from(error: LevelError) -> Self {
        Self { limit: error.limit(), ..Self::new(error.kind(), error.code(), error.to_string()) }
    }
}

/// The system of the job's one input.
fn system(job: &Job) -> Result<&Ifs, JobError> {
    match job.inputs.first().map(|input| &input.model.shape) {
        Some(Shape::Ifs(ifs)) => Ok(ifs),
        _ => Err(JobError::new(
            Kind::Invalid,
            "level.not-an-ifs",
            "only models of the family ifs have levels of copies; give a radius instead of a level".into(),
        )),
    }
}

/// Does a job of kind `solidify` with a level.
pub(crate) fn solidify(job: &Job, level: u32, budget: &Budget) -> Result<Outcome, JobError> {
    let ifs = system(job)?;
    let attractor = lower(job, budget)?.attractor;
    let bounds = bounding_box(&attractor, budget)?;
    let found = solid_level(ifs, &bounds, level, budget)?;
    let statement = LevelStatement {
        level,
        primitive: match found.primitive {
            LevelPrimitive::Stated => CopiedPrimitive::Stated,
            LevelPrimitive::Box => CopiedPrimitive::Box,
        },
        copies: found.copies,
        cancelled_faces: found.cancelled_faces,
        doubled_vertices: found.doubled_vertices,
    };
    let certificate = certificate::of_level(&attractor, &found, statement, job.params.tolerance_mm)?;
    Ok(Outcome { geometry: Geometry::Solid(found.solid), certificate })
}

/// Predicts the cost.
pub(crate) fn plan(job: &Job, level: u32, budget: &Budget) -> Result<Plan, JobError> {
    let ifs = system(job)?;
    let bounds = bounding_box(&lower(job, budget)?.attractor, budget)?;
    let predicted = predict(ifs, &bounds, level, budget)?;
    let (triangles, memory_bytes) = (predicted.triangles, predicted.memory_bytes);
    let cpu_seconds = Some(effort::of_level(triangles));
    Ok(Plan {
        triangles,
        counted_triangles: triangles,
        memory_bytes,
        output_bytes: Some(stl_bytes(triangles)),
        cpu_seconds,
        ..Plan::default()
    })
}
