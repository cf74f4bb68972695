//! One entry for every door: `plan` predicts, `run` does, `validate` tells what is wrong.

use lacuna_kernel::budget::Budget;
use lacuna_kernel::error::{Kind, LimitFacts};
use lacuna_kernel::model::Model;
use lacuna_kernel::solid::Solid;
use lacuna_kernel::tessellation::Tessellation;

use crate::{Certificate, Job};

/// The geometry of a result.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// A printable solid.
    Solid(Solid),
    /// An evaluation.
    Tessellation(Tessellation),
    /// Numbers only.
    None,
}

/// What a job made.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// What was made; vertex coordinates of a solid are single-precision numbers.
    pub geometry: Geometry,
    /// What is proven of it. `input_digest` and `output_digests` are the caller's to fill in.
    pub certificate: Certificate,
}

/// What a job is predicted to cost.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
pub struct Plan {
    /// Leaf cells of the whole shape at its share of the tolerance; `solidify` expands only those that
    /// the boundary of the result needs.
    pub leaf_cells: f64,
    /// Triangles of the result.
    pub triangles: f64,
    /// Peak memory in bytes.
    pub memory_bytes: f64,
    /// Binary STL bytes.
    pub output_bytes: f64,
    /// Edge of the lattice's cubes.
    pub lattice_pitch_mm: Option<f64>,
}

/// What `validate` says of a model whose document was legal.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Validation {
    /// Whether it can be evaluated.
    pub valid: bool,
    /// What is wrong (errors) and what is odd (warnings).
    pub diagnostics: Vec<ModelDiagnostic>,
    /// Number of states of the automaton.
    pub states: u64,
    /// Degrees of freedom of the unknown operators; 0 when none is unknown.
    pub degrees_of_freedom: u64,
    /// Largest violation of a constraint.
    pub constraint_residual: f64,
    /// [lower, upper] bounds of the joint spectral radius on the zero-sum subspaces.
    pub spectral_radius: [f64; 2],
}

/// One finding about a model.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelDiagnostic {
    /// Where: a JSON pointer relative to the model's `shape`, for example `/maps/3/linear`.
    pub pointer: String,
    /// Stable code, for example `ifs.not-contractive`.
    pub code: &'static str,
    /// What, in words, with the values.
    pub message: String,
    /// Whether it only deserves attention.
    pub warning: bool,
}

/// Why a job has no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct JobError {
    /// How to react.
    pub kind: Kind,
    /// Stable code.
    pub code: &'static str,
    /// What happened, in words.
    pub message: String,
    /// The limit that was hit.
    pub limit: Option<LimitFacts>,
    /// Findings with places, when the model is at fault.
    pub diagnostics: Vec<ModelDiagnostic>,
}

/// Does the job.
///
/// # Errors
/// [`JobError`] with its kind: an invalid model, an unreachable tolerance, a limit, or a stop.
pub fn run(_job: &Job, _budget: &Budget) -> Result<Outcome, JobError> {
    Err(unfinished())
}

/// Predicts the cost of the job.
///
/// # Errors
/// As [`run`], for what shows before the work.
pub fn plan(_job: &Job, _budget: &Budget) -> Result<Plan, JobError> {
    Err(unfinished())
}

/// Says what is wrong with a model.
#[must_use]
pub fn validate(_model: &Model) -> Validation {
    Validation::default()
}

fn unfinished() -> JobError {
    JobError { kind: Kind::Defect, code: "unfinished", message: "the kernel is being written".into(), limit: None, diagnostics: Vec::new() }
}
