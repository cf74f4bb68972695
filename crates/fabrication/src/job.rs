//! What is ordered.

use lacuna_kernel::budget::Limits;
use lacuna_kernel::model::Model;

/// What a job does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(rename_all = "snake_case"))]
pub enum JobKind {
    /// Points, wires or surface to a tolerance.
    Evaluate,
    /// A printable solid: the shape dilated by a ball.
    Solidify,
    /// Box, area and volume as intervals.
    Measure,
}

/// Settings of a job. What a kind does not use must be absent.
#[derive(Clone, Debug, PartialEq)]
pub struct Params {
    /// Hausdorff bound on the result, in mm.
    pub tolerance_mm: f64,
    /// Radius of the dilating ball, in mm: required by `solidify`, optional for `measure` (without
    /// it the shape itself is measured).
    pub radius_mm: Option<f64>,
    /// Whether an evaluation carries the normals of the limit surface into formats that have room for them.
    pub normals: bool,
    /// Whether the topology of a solid is examined at radii nearby.
    pub stability: bool,
}

/// A model with the name that the job gives it.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// The name; the model's own, or `shape`, when the job gives none.
    pub name: String,
    /// The model.
    pub model: Model,
}

/// A valid order: nothing in it needs to be checked again except what only the kernel can know.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// What to do.
    pub kind: JobKind,
    /// With what: one input today.
    pub inputs: Vec<Input>,
    /// How.
    pub params: Params,
    /// Names of the formats wanted, for example `3mf` and `stl`; the exchange crate knows them.
    pub outputs: Vec<String>,
    /// What may be used.
    pub limits: Limits,
}
