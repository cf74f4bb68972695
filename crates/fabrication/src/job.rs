//! What is ordered.

use lacuna_kernel::budget::Limits;
use lacuna_kernel::measure::contact::Primitive;
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
    /// A printable solid: what an operation leaves of several. Without an operation: where two shapes, or a shape and a primitive, come together.
    Intersect,
    /// Plane sections of a solid.
    Slice,
    /// A mesh as it is, in other formats; any other model is evaluated.
    Convert,
}

/// Parallel planes that cut a solid.
#[derive(Clone, Debug, PartialEq)]
pub struct Planes {
    /// What they are perpendicular to, of any length.
    pub normal: glam::DVec3,
    /// Where they are along the normal, in mm, unless there is a step.
    pub offsets_mm: Vec<f64>,
    /// The height of layers, in mm, the planes being in their middles from the bottom of the solid on.
    pub step_mm: Option<f64>,
}

/// How solids are combined. All operations are regularised: a face, an edge or a point that two solids merely share leaves nothing behind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(rename_all = "snake_case"))]
pub enum Operation {
    /// What lies in any input.
    Union,
    /// What lies in all inputs.
    Intersection,
    /// What lies in the first input and in none of the others.
    Difference,
    /// The convex hull of all inputs.
    Hull,
}

/// Settings of a job. What a kind does not use must be absent.
#[derive(Clone, Debug, PartialEq)]
pub struct Params {
    /// Hausdorff bound on the result, in mm.
    pub tolerance_mm: f64,
    /// Radius of the dilating ball, in mm: required by `solidify`, optional for `measure` (without
    /// it the shape itself is measured), for `intersect` and for `slice` (without it the inputs are solids themselves).
    pub radius_mm: Option<f64>,
    /// What an `intersect` leaves of its inputs.
    pub operation: Option<Operation>,
    /// What an `intersect` without an operation holds its one input against.
    pub with: Option<Primitive>,
    /// The planes of a `slice`.
    pub planes: Option<Planes>,
    /// Density in g/cm^3, for the mass in a `measure`.
    pub density_g_cm3: Option<f64>,
    /// Whether an evaluation carries the normals of the limit surface into formats that have room for them.
    pub normals: bool,
    /// Whether a solid has no more triangles than its bound needs: else it has all of the lattice.
    pub simplify: bool,
    /// Whether the topology of a solid is examined at radii nearby.
    pub stability: bool,
}

impl Params {
    /// A tolerance, and everything else as where a document says nothing.
    #[must_use]
    pub fn new(tolerance_mm: f64) -> Self {
        Self {
            tolerance_mm,
            radius_mm: None,
            operation: None,
            with: None,
            planes: None,
            density_g_cm3: None,
            normals: false,
            simplify: true,
            stability: false,
        }
    }
}

/// A model with the name that the job gives it.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// The name; the model's own, or `shape`, when the job gives none.
    pub name: String,
    /// The model.
    pub model: Model,
    /// Radius of this input's ball in mm, where it is not the job's; 0 for the solid itself.
    pub radius_mm: Option<f64>,
}

/// A valid order: nothing in it needs to be checked again except what only the kernel can know.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// What to do.
    pub kind: JobKind,
    /// With what: one input; two to compare for `measure`, two or more for `intersect`.
    pub inputs: Vec<Input>,
    /// How.
    pub params: Params,
    /// Names of the formats wanted, for example `3mf` and `stl`; the exchange crate knows them.
    pub outputs: Vec<String>,
    /// What may be used.
    pub limits: Limits,
}
