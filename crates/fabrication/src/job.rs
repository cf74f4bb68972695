//! What is ordered.

use lacuna_kernel::budget::Limits;
use lacuna_kernel::dilation::Side;
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

/// A plane normal . x = offset, which cuts a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutPlane {
    /// What it is perpendicular to, of any length: it points to what is taken away.
    pub normal: glam::DVec3,
    /// Where it is along the normal's direction, in mm.
    pub offset_mm: f64,
}

/// How a solid is split into parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Split {
    /// What every part must fit, in mm along the axes.
    pub volume_mm: Option<[f64; 3]>,
    /// Where to cut across x, y and z, in mm; where none is stated, as the volume asks.
    pub cuts_mm: [Vec<f64>; 3],
    /// Keys that hold the parts together; none when absent.
    pub key: Option<SplitKey>,
}

/// Pegs and sockets between parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplitKey {
    /// Width and length of a peg, in mm; walls are half of that.
    pub width_mm: f64,
    /// Distance between the faces of a peg and of its socket, in mm.
    pub clearance_mm: f64,
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
    /// What of one input lies on one side of a plane.
    Trim,
    /// One input in parts along planes.
    Split,
}

/// On which side of a closed surface its wall is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(rename_all = "snake_case"))]
pub enum WallSide {
    /// Inside: the solid becomes hollow.
    Inward,
    /// Outside: what the surface bounds becomes the hollow.
    Outward,
}

impl From<WallSide> for Side {
    fn from(side: WallSide) -> Self {
        match side {
            WallSide::Inward => Self::Inward,
            WallSide::Outward => Self::Outward,
        }
    }
}

/// A wall along the surface of a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallOrder {
    /// How thick, in mm.
    pub thickness_mm: f64,
    /// On which side.
    pub side: WallSide,
}

/// What one shape is held against.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum With {
    /// A point, a line and the like.
    Primitive(Primitive),
    /// The shape: where it comes near itself although nothing declares it.
    Itself,
}

/// Settings of a job. What a kind does not use must be absent.
#[derive(Clone, Debug, PartialEq)]
pub struct Params {
    /// Hausdorff bound on the result, in mm; 0 for a level without one, which is exact but for single precision.
    pub tolerance_mm: f64,
    /// Whether something of the result is enough that is there soon: of an `evaluate`, or of a `solidify` with a ball and nothing besides.
    pub preview: bool,
    /// The level of a `solidify` that joins copies of a system's primitive instead of dilating its attractor.
    pub level: Option<u32>,
    /// Whether inputs that are meshes are repaired first, so that each is a solid; `evaluate` alone has no use for it.
    pub repair: bool,
    /// Radius of the dilating ball, in mm: required by `solidify` unless there is a wall or a level, optional for `measure` (without
    /// it the shape itself is measured), for `intersect` and for `slice` (without it the inputs are solids themselves).
    pub radius_mm: Option<f64>,
    /// Of a `solidify`: gaps narrower than this are filled, in mm: the solid is closed with a ball of half the size.
    pub closing_mm: Option<f64>,
    /// Of a `solidify`: the wall that is made instead of the solid.
    pub wall: Option<WallOrder>,
    /// What an `intersect` leaves of its inputs.
    pub operation: Option<Operation>,
    /// What an `intersect` without an operation holds its one input against.
    pub with: Option<With>,
    /// Where an `intersect` trims its input.
    pub plane: Option<CutPlane>,
    /// How an `intersect` splits its input.
    pub split: Option<Split>,
    /// The planes of a `slice`.
    pub planes: Option<Planes>,
    /// Along which a `measure` tells how far the shape extends, of any length.
    pub direction: Option<glam::DVec3>,
    /// Whether a `measure` finds the smallest box, whatever way it is turned.
    pub oriented_box: bool,
    /// Whether a `measure` finds the least walls and gaps.
    pub thickness: bool,
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
            preview: false,
            level: None,
            repair: false,
            radius_mm: None,
            closing_mm: None,
            wall: None,
            operation: None,
            with: None,
            plane: None,
            split: None,
            planes: None,
            direction: None,
            oriented_box: false,
            thickness: false,
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
