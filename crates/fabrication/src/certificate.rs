//! The statement of bounds, counts and digests that comes with every result.

use glam::DVec3;
use lacuna_kernel::attractor::{Attractor, CellComplex, Streamed};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::dilation::{Change, CriticalRadius, Dilation, Stability, Verdict};
use lacuna_kernel::error::Kind;
use lacuna_kernel::levels::SolidLevel;
use lacuna_kernel::measure::mass::{
    MassProperties, area, dilated_area, dilated_volume, mass_properties, mesh_measures, volume, volume_within,
};
use lacuna_kernel::measure::{self, AxisBox, Dimension, DimensionKnowledge};
use lacuna_kernel::solid::{Rounded, Solid, SolidError, Topology, TriMesh};
use lacuna_kernel::tessellation::Tessellation;
use lacuna_kernel::tolerance::{LENGTHS_MM, Radius, Tolerance};

use crate::enclosed::EnclosedStatement;
use crate::hull::Hull;
use crate::level::LevelStatement;
use crate::operand::Operand;
use crate::preview::PreviewStatement;
use crate::repair::RepairStatement;
use crate::run::{JobError, not_carried};
use crate::shape_measures::{ExtentStatement, OrientedBoxStatement, ThicknessStatement};
use crate::solidify::{ClosingStatement, WallStatement};
use crate::split::SplitStatement;
use crate::{Operation, Part};

/// A verdict that may not have been sought: what was not checked never reads as a pass.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Checked<T> {
    /// Nobody looked.
    #[default]
    NotChecked,
    /// What was found.
    Found(T),
}

/// How many pairs of triangles intersect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SelfIntersections {
    /// Proven or checked to be none.
    None,
    /// So many pairs.
    Count(u64),
}

/// [lo, hi] with lo <= hi: the exact value lies between.
pub type Interval = [f64; 2];

/// What is proven of a result. Lengths in mm; the same JSON everywhere.
///
/// Members that do not apply to a result (the genus of a wire) are absent.
#[derive(Clone, Debug, PartialEq, Default)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct Certificate {
    /// The Hausdorff bound that was asked.
    pub requested_tolerance_mm: f64,
    /// The Hausdorff bound that is proven, single-precision rounding of the file included; never
    /// above the request.
    pub achieved_bound_mm: f64,
    /// Every point of the exact shape eroded by this much lies in the result:
    /// D(r - inner) is inside the solid.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub inner_bound_mm: Option<f64>,
    /// The solid is inside D(r + outer).
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub outer_bound_mm: Option<f64>,
    /// Every point of D(r - inner) lies in a ball of this diameter inside the solid.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub thickness_min_mm: Option<f64>,
    /// Leaf cells evaluated. A dilation evaluates only cells near its boundary, and one again in every block
    /// of the lattice that needs it.
    pub leaf_cells: u64,
    /// Vertices of the result.
    pub vertices: u64,
    /// Edges of the result.
    pub edges: u64,
    /// Triangles of the result.
    pub triangles: u64,
    /// Connected pieces.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub components: Option<u64>,
    /// Connected boundary surfaces: components and cavities.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub shells: Option<u64>,
    /// Sealed voids.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub cavities: Option<u64>,
    /// Sum of the shells' genera.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub genus: Option<i64>,
    /// vertices - edges + triangles.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub euler: Option<i64>,
    /// Edges with one triangle.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub boundary_edges: Option<u64>,
    /// Closed curves that the edges with one triangle form.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub boundary_loops: Option<u64>,
    /// Edges with three triangles or more.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub nonmanifold_edges: Option<u64>,
    /// Vertices whose triangles form several fans.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub nonmanifold_vertices: Option<u64>,
    /// Pairs of triangles that run along their edge in the same direction.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub flipped_pairs: Option<u64>,
    /// Triangles without area.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub degenerate_triangles: Option<u64>,
    /// `"none"`, a count, or `"not_checked"`.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::count_schema))]
    pub self_intersections: Checked<SelfIntersections>,
    /// `true`, `false` or `"not_checked"`: the same topology at radius r - bound and r + bound.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::flag_schema))]
    pub topology_stable: Checked<bool>,
    /// `true` or `"not_checked"`: proven that the solid has as many components, handles and voids as the exact dilation.
    #[cfg_attr(feature = "wire", serde(default), schema(schema_with = wire::flag_schema))]
    pub topology_exact: Checked<bool>,
    /// That this is a preview, and at which tolerance, where it is one.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub preview: Option<PreviewStatement>,
    /// What was done to each input that is a mesh before anything else, when the job asks for a repair.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Vec::is_empty", default))]
    pub repair: Vec<RepairStatement>,
    /// How the result was combined, when it was: the bounds are then those of a sandwich.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub operation: Option<OperationStatement>,
    /// How gaps were filled, when they were: all that is said of D is then said of its closing.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub closing: Option<ClosingStatement>,
    /// The wall that was made instead of a solid, when one was: `inner_bound_mm` and `outer_bound_mm` are of the solid before.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub wall: Option<WallStatement>,
    /// Where two shapes come together: of an `intersect` without an operation.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub contact: Option<ContactStatement>,
    /// How far two shapes are from being the same: of a `measure` of two.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub hausdorff: Option<HausdorffStatement>,
    /// Which level of a system the result is, when it is one: the bounds are then those of that level.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub level: Option<LevelStatement>,
    /// The parts of the result, when it was split.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub split: Option<SplitStatement>,
    /// The sections of the solid, when it was cut.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub sections: Option<SectionsStatement>,
    /// At which radii the topology changes: when the job asks.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub stability: Option<StabilityStatement>,
    /// `[[x, y, z] of the lower corner, [x, y, z] of the upper corner]`, each number an interval
    /// that contains the exact shape's.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::box_schema))]
    pub bbox_mm: [[Interval; 3]; 2],
    /// Volume of the exact shape.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    #[cfg_attr(feature = "wire", schema(schema_with = wire::interval_schema))]
    pub volume_mm3: Option<Interval>,
    /// How far the exact shape extends along the direction that a `measure` asks for.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub extent: Option<ExtentStatement>,
    /// What a closed surface that is no mesh encloses: of a `measure` alone.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub enclosed: Option<EnclosedStatement>,
    /// Area of the exact shape's boundary, or of one side of a surface; a smooth one counts places as often as it covers them.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    #[cfg_attr(feature = "wire", schema(schema_with = wire::interval_schema))]
    pub area_mm2: Option<Interval>,
    /// Centroid of the exact shape, or of what a closed surface encloses: of a `measure` alone.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    #[cfg_attr(feature = "wire", schema(schema_with = wire::vector_schema))]
    pub centroid_mm: Option<[Interval; 3]>,
    /// Inertia tensor of the same about its centroid, at density 1, row by row: of a `measure` alone.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    #[cfg_attr(feature = "wire", schema(schema_with = wire::matrix_schema))]
    pub inertia_mm5: Option<[[Interval; 3]; 3]>,
    /// Mass of the exact shape, or of the volume that a closed surface encloses, where the job names a density.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    #[cfg_attr(feature = "wire", schema(schema_with = wire::interval_schema))]
    pub mass_g: Option<Interval>,
    /// Fractal dimension of the exact shape: of a `measure` alone.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub dimension: Option<DimensionStatement>,
    /// The smallest box around the exact shape: of a `measure` that asks.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub oriented_box: Option<OrientedBoxStatement>,
    /// Least walls and gaps: of a `measure` that asks.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub thickness: Option<ThicknessStatement>,
    /// Volume that the written mesh encloses.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub mesh_volume_mm3: Option<f64>,
    /// Area of the written mesh.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub mesh_area_mm2: Option<f64>,
    /// Edge of the lattice's cubes, where there was a lattice: points, segments and triangles of which few are near to each other are thickened without.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub lattice_pitch_mm: Option<f64>,
    /// Version of the kernel that made it.
    pub kernel_version: String,
    /// `sha256:` and the digest of the canonical job document; filled in by the service or the command.
    pub input_digest: String,
    /// Digests of the files, by format; filled in after writing.
    pub output_digests: std::collections::BTreeMap<String, String>,
    /// What the user should know, in words.
    pub warnings: Vec<String>,
}

/// What is proven of two shapes, at a place or as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(rename_all = "snake_case"))]
pub enum ContactVerdict {
    /// They have no common point.
    Disjoint,
    /// They are within the upper end of the distance; whether they have a common point is not known.
    Near,
    /// They have a common point.
    Touching,
}

/// Two cells, the first of the first shape.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct CellPairStatement {
    /// Address of the first, as `address` takes it.
    pub first: String,
    /// Address of the second; absent where that is no shape.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub second: Option<String>,
    /// A point of the first: of a given triangle, segment or point the nearest to the second, of any other cell the one that its address leads to.
    pub first_mm: [f64; 3],
    /// A point of the second, likewise; of what is no shape the nearest to the first.
    pub second_mm: [f64; 3],
    /// How far `first_mm` and `second_mm` may be from points of the two shapes: rounding. Absent in certificates of before it was told, whose points are the middles of the cells.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub off_mm: Option<[f64; 2]>,
    /// The distance of the two cells.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::interval_schema))]
    pub distance_mm: Interval,
}

/// A place where shapes come within the tolerance.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct PlaceStatement {
    /// Lower and upper corner of a box that holds all points of the first shape within the tolerance of the second, of this place.
    pub bbox_mm: [[f64; 3]; 2],
    /// What is proven there.
    pub verdict: ContactVerdict,
    /// The distance of the shapes there.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::interval_schema))]
    pub distance_mm: Interval,
    /// Pairs of cells that make up the place.
    pub pairs: u64,
    /// The nearest of them.
    pub nearest: CellPairStatement,
}

/// Which of two shapes holds the other, or a part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(rename_all = "snake_case"))]
pub enum Holder {
    /// The first.
    First,
    /// The second.
    Second,
}

/// A solid that holds another shape, or a part of it, without touching it with its surface.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct InsideStatement {
    /// Which of the two is the solid that holds.
    pub holder: Holder,
    /// A point inside of it that is on the other, or nearer to it than their surfaces are to each other.
    pub point_mm: [f64; 3],
    /// The distance of the surfaces.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::interval_schema))]
    pub surface_distance_mm: Interval,
}

/// How far two shapes are apart, and where they come within the tolerance of each other; or a shape and itself, but for what it joins. A model that stands for a solid has its inside: what lies there is
/// at the distance 0. Places and the nearest pair are those of surfaces.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct ContactStatement {
    /// What is proven.
    pub verdict: ContactVerdict,
    /// The distance of the shapes.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::interval_schema))]
    pub distance_mm: Interval,
    /// Which solid holds the other shape or a part of it, where their surfaces are apart.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub inside: Option<InsideStatement>,
    /// The nearest pair of cells that was looked at.
    pub nearest: CellPairStatement,
    /// The places, a thousand at most.
    pub places: Vec<PlaceStatement>,
    /// Pairs of cells whose distance was bounded: what the search cost.
    pub pairs_looked_at: u64,
    /// Whether there are no other places, and the distance is as narrow as the tolerance allows.
    pub complete: bool,
}

/// How far the points of one shape are from the other, at most.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct DirectedStatement {
    /// The supremum of the distances.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::interval_schema))]
    pub distance_mm: Interval,
    /// Near here is a point that far.
    pub near_mm: [f64; 3],
}

/// The Hausdorff distance of two shapes. A model that stands for a solid is all that it encloses.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct HausdorffStatement {
    /// The larger of the two directed ones.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::interval_schema))]
    pub distance_mm: Interval,
    /// From the first shape to the second.
    pub from_first: DirectedStatement,
    /// From the second shape to the first.
    pub from_second: DirectedStatement,
    /// Whether the intervals are as narrow as the tolerance.
    pub complete: bool,
}

/// Plane sections of the solid that is certified beside them: each lies between those of the solid's inner and outer bounds. A plane at the height of
/// a level face gives the section just above it.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct SectionsStatement {
    /// The planes' unit normal.
    pub normal: [f64; 3],
    /// The direction of first coordinates in the planes.
    pub u: [f64; 3],
    /// The direction of second coordinates.
    pub v: [f64; 3],
    /// The planes, in the order of the files.
    pub planes: Vec<PlaneStatement>,
}

/// One section.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct PlaneStatement {
    /// Where the plane is along the normal.
    pub offset_mm: f64,
    /// Connected pieces; 0 where the plane misses the solid.
    pub polygons: u64,
    /// Holes in them.
    pub holes: u64,
    /// Their area.
    pub area_mm2: f64,
    /// Length of all loops.
    pub perimeter_mm: f64,
}

/// How much is known of a dimension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(rename_all = "snake_case"))]
pub enum DimensionBasis {
    /// The shape consists of points, segments, triangles or bodies.
    Elementary,
    /// The shape consists of similar copies whose convex hulls have no inner point in common, up to 1e-9 of their size: Moran's equation holds.
    Similarities,
    /// The shape consists of similar copies, of which that is not known: Moran's equation bounds from above.
    OverlappingSimilarities,
    /// Bounds from the number of cells and how they contract, from lengths of curves, and from what is connected or parts space.
    Contraction,
}

/// A fractal dimension.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct DimensionStatement {
    /// Hausdorff dimension and upper box dimension lie between these.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::interval_schema))]
    pub bounds: Interval,
    /// How they are known.
    pub basis: DimensionBasis,
}

impl DimensionStatement {
    pub(crate) fn of(dimension: Dimension) -> Self {
        let basis = match dimension.knowledge {
            DimensionKnowledge::Elementary => DimensionBasis::Elementary,
            DimensionKnowledge::Similarities => DimensionBasis::Similarities,
            DimensionKnowledge::OverlappingSimilarities => DimensionBasis::OverlappingSimilarities,
            DimensionKnowledge::Contraction => DimensionBasis::Contraction,
        };
        Self { bounds: [dimension.bounds.low, dimension.bounds.high], basis }
    }
}

/// A solid that was combined from several. `inner_bound_mm` and `outer_bound_mm` say how far inputs are eroded or dilated in the two solids that the result lies
/// between: it contains the operation of the inputs at radius r - inner, and lies in that at radius r + outer, where inputs that are taken away are at
/// r + inner and r - outer. The engine is trusted to combine meshes as it says; that the result is a closed solid is counted.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct OperationStatement {
    /// What was done.
    pub operation: Operation,
    /// By which engine.
    pub engine: String,
    /// The inputs.
    pub operands: Vec<OperandStatement>,
}

/// One input of an operation.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct OperandStatement {
    /// Its name.
    pub name: String,
    /// The radius r of its ball; 0 for the solid itself.
    pub radius_mm: f64,
    /// Its mesh contains D(r - inner).
    pub inner_bound_mm: f64,
    /// Its mesh lies in D(r + outer).
    pub outer_bound_mm: f64,
    /// Triangles of its mesh.
    pub triangles: u64,
    /// Volume that its mesh encloses: the sum over its closed surfaces.
    pub mesh_volume_mm3: f64,
}

/// What happens to the topology when the radius grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(rename_all = "snake_case"))]
pub enum TopologyChange {
    /// Parts join, or a tunnel forms.
    Joins,
    /// A tunnel closes, or a cavity is sealed.
    Closes,
    /// A cavity fills.
    Fills,
    /// Not told.
    Unclear,
}

/// Radii where the topology changes, or may.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct CriticalRadiusStatement {
    /// The radii, in mm.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::interval_schema))]
    pub radius_mm: Interval,
    /// What happens there.
    pub change: TopologyChange,
    /// At how many places.
    pub places: u64,
    /// Whether it is proven that it happens; else it may.
    pub proven: bool,
    /// What it adds to the Euler number of the solid (half of its boundary's), where that is proven.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub euler: Option<i64>,
}

/// How the topology depends on the radius. Between the radii listed it is proven to stay the same.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct StabilityStatement {
    /// All radii between these where the topology may change are listed, in mm.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::interval_schema))]
    pub examined_mm: Interval,
    /// The smallest radius from which on the shape is one piece lies between these, in mm.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::interval_schema))]
    pub one_piece_mm: Interval,
    /// The last radius where the topology may change before those within the bound, in mm.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub below: Option<CriticalRadiusStatement>,
    /// The next one beyond them.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub above: Option<CriticalRadiusStatement>,
    /// All of them, in ascending order.
    pub critical: Vec<CriticalRadiusStatement>,
}

impl From<&CriticalRadius> for CriticalRadiusStatement {
    fn from(critical: &CriticalRadius) -> Self {
        let change = match critical.change {
            Change::Joins => TopologyChange::Joins,
            Change::Closes => TopologyChange::Closes,
            Change::Fills => TopologyChange::Fills,
            Change::Unclear => TopologyChange::Unclear,
        };
        let CriticalRadius { radius_mm, places, proven, euler, .. } = *critical;
        Self { radius_mm, change, places, proven, euler }
    }
}

impl Certificate {
    /// Adds centroid and inertia of the exact shape, which differs from what the mesh encloses by a volume of `difference` at most, within `bounds`.
    ///
    /// With the mesh's centroid as the origin, no point of either is farther than R: first moments differ by R `difference` at most, second ones by R^2 times that.
    pub(crate) fn state_moments(&mut self, mesh: &TriMesh, difference: f64, bounds: &AxisBox) {
        let Some(MassProperties { volume, centroid, inertia }) = mass_properties(mesh) else { return };
        let reach = (0..3)
            .map(|axis| (bounds.high[axis].high - centroid[axis].low).max(centroid[axis].high - bounds.low[axis].low).powi(2))
            .sum::<f64>()
            .sqrt();
        if difference < volume.low {
            let shift = reach * difference / (volume.low - difference);
            let spread = reach * reach * difference + (volume.high + difference) * shift * shift;
            let widened = |x: measure::Interval, by: f64| [x.low - by, x.high + by];
            self.centroid_mm = Some(centroid.map(|x| widened(x, shift * (1.0 + ROUNDING))));
            self.inertia_mm5 = Some(inertia.map(|row| row.map(|x| widened(x, spread * (1.0 + ROUNDING)))));
        }
    }

    /// Adds the mass of a volume, where a density is given.
    pub(crate) fn state_mass(&mut self, volume_mm3: Interval, density_g_cm3: Option<f64>) {
        // 1 cm^3 is 1000 mm^3.
        self.mass_g = density_g_cm3.map(|density| {
            let [low, high] = volume_mm3.map(|volume| volume * 1e-3 * density);
            [low - 2.0 * f64::EPSILON * low.abs(), high + 2.0 * f64::EPSILON * high.abs()]
        });
    }

    /// Adds what was found of the topology at radii nearby, `reached` around the radius.
    pub(crate) fn state_stability(&mut self, found: &Stability, radius: Radius, reached: Tolerance) {
        self.topology_stable = match found.verdict {
            Verdict::Stable => Checked::Found(true),
            Verdict::Unstable => Checked::Found(false),
            Verdict::Unresolved => Checked::NotChecked,
        };
        if found.verdict == Verdict::Unresolved {
            let [low, high] = [radius.mm() - reached.mm(), radius.mm() + reached.mm()];
            self.warnings.push(format!(
                "the topology may change between radii of {low:.6} mm and {high:.6} mm, which is neither proven nor excluded; another radius or a smaller tolerance may tell"
            ));
        }
        let [below, above] = found.neighbours(radius, reached).map(|critical| critical.map(CriticalRadiusStatement::from));
        let critical = found.critical.iter().map(CriticalRadiusStatement::from).collect();
        self.stability =
            Some(StabilityStatement { examined_mm: found.examined_mm, one_piece_mm: found.one_piece_mm, below, above, critical });
    }
}

fn corners(bounds: &AxisBox) -> [[Interval; 3]; 2] {
    [bounds.low, bounds.high].map(|corner| corner.map(|end| [end.low, end.high]))
}

fn start(warnings: Vec<String>, tolerance: Tolerance) -> Certificate {
    Certificate {
        requested_tolerance_mm: tolerance.mm(),
        kernel_version: env!("CARGO_PKG_VERSION").into(),
        warnings,
        ..Certificate::default()
    }
}

/// What is counted on a closed mesh.
fn counted(topology: &Topology, warnings: Vec<String>, tolerance: Tolerance) -> Certificate {
    Certificate {
        vertices: topology.vertices,
        edges: topology.edges,
        triangles: topology.triangles,
        components: Some(topology.components),
        shells: Some(topology.shells),
        cavities: Some(topology.cavities),
        genus: Some(topology.genus),
        euler: Some(topology.euler),
        boundary_edges: Some(topology.boundary_edges),
        nonmanifold_edges: Some(topology.nonmanifold_edges),
        nonmanifold_vertices: Some(topology.nonmanifold_vertices),
        flipped_pairs: Some(topology.flipped_pairs),
        degenerate_triangles: Some(topology.degenerate_triangles),
        ..start(warnings, tolerance)
    }
}

/// What is counted on a solid, after the warnings of what it was made from.
fn of_solid(solid: &Solid, crossings: u64, warnings: Vec<String>, tolerance: Tolerance) -> Certificate {
    let topology = solid.topology();
    let mut certificate = Certificate {
        // Counted exactly on the mesh as it is written.
        self_intersections: Checked::Found(match crossings {
            0 => SelfIntersections::None,
            count => SelfIntersections::Count(count),
        }),
        mesh_volume_mm3: Some(volume(solid.mesh())),
        mesh_area_mm2: Some(area(solid.mesh())),
        ..counted(topology, warnings, tolerance)
    };
    if topology.cavities > 0 {
        certificate.warnings.push(format!("{} sealed voids: resin or wax inside cannot drain", topology.cavities));
    }
    certificate
}

/// As [`of_solid`], for what is made in one piece.
pub(crate) fn of_one_solid(solid: &Solid, crossings: u64, warnings: Vec<String>, tolerance: Tolerance) -> Certificate {
    let mut certificate = of_solid(solid, crossings, warnings, tolerance);
    let components = solid.topology().components;
    if components > 1 {
        certificate.warnings.push(format!("{components} separate pieces: they will not hold together"));
    }
    certificate
}

/// What is proven of a level of a system; a tolerance of 0 is none, and what is reached is then what was asked.
pub(crate) fn of_level(
    attractor: &Attractor,
    found: &SolidLevel,
    statement: LevelStatement,
    tolerance: f64,
) -> Result<Certificate, JobError> {
    let reached = found.moved_mm;
    let requested = Tolerance::new(if tolerance > 0.0 { tolerance } else { reached.max(*LENGTHS_MM.start()) })?;
    if reached > requested.mm() {
        return Err(not_carried(requested, found.bounds.extent(), reached));
    }
    let mut counted = of_one_solid(&found.solid, found.contacts, attractor.warnings().to_vec(), requested);
    if found.doubled_vertices > 0 {
        counted.warnings.push(format!(
            "parts touch along edges or at corners without being joined: {} corners are doubled, and {} pairs of triangles touch; a dilation joins them",
            found.doubled_vertices, found.contacts
        ));
    }
    Ok(Certificate {
        achieved_bound_mm: reached,
        inner_bound_mm: Some(reached),
        outer_bound_mm: Some(reached),
        bbox_mm: corners(&found.bounds),
        volume_mm3: Some([found.volume.low, found.volume.high]),
        area_mm2: Some([found.area.low, found.area.high]),
        level: Some(statement),
        ..counted
    })
}

/// What is proven of a solid in parts: its bounds, and the counts of all parts together.
pub(crate) fn of_split(
    parts: &[Part],
    crossings: u64,
    moved_mm: f64,
    operand: &Operand,
    statement: SplitStatement,
    tolerance: Tolerance,
    budget: &Budget,
) -> Result<Certificate, JobError> {
    let mut all = TriMesh::default();
    for Part { solid, .. } in parts {
        all.append(solid.mesh());
    }
    let all = Solid::new(all, budget).map_err(|error| match error {
        SolidError::Stopped(stopped) => JobError::from(stopped),
        other => JobError::new(Kind::Defect, "internal", format!("parts together are no solid: {other}")),
    })?;
    let counted = of_solid(&all, crossings, operand.warnings.clone(), tolerance);
    let [inner, outer] = [operand.statement.inner_bound_mm, operand.statement.outer_bound_mm].map(|bound| bound + moved_mm);
    Ok(Certificate {
        achieved_bound_mm: inner.max(outer),
        inner_bound_mm: Some(inner),
        outer_bound_mm: Some(outer),
        leaf_cells: operand.leaf_cells,
        bbox_mm: corners(&operand.bounds),
        split: Some(statement),
        ..counted
    })
}

/// What is proven of a dilated shape.
pub(crate) fn of_dilation(attractor: &Attractor, dilation: &Dilation, tolerance: Tolerance) -> Certificate {
    let mut counted = of_one_solid(&dilation.solid, dilation.crossings, attractor.warnings().to_vec(), tolerance);
    let radius = dilation.least_radius_mm;
    let exact = dilated_volume(volume_within(dilation.solid.mesh()), radius, dilation.inner_mm, dilation.outer_mm);
    let exact_area = dilated_area(exact, radius);
    if dilation.crossings > 0 {
        counted
            .warnings
            .push(format!("{} pairs of triangles cross: ask for another tolerance, or for no simplification", dilation.crossings));
    }
    if dilation.uncertain > 0 {
        let remark =
            "places where the radius is so close to a critical one that the topology there is not certain; another radius would do";
        counted.warnings.push(format!("{} {remark}", dilation.uncertain));
    }
    Certificate {
        achieved_bound_mm: dilation.inner_mm.max(dilation.outer_mm),
        inner_bound_mm: Some(dilation.inner_mm),
        outer_bound_mm: Some(dilation.outer_mm),
        thickness_min_mm: Some((2.0 * (radius - dilation.inner_mm)).max(0.0)),
        leaf_cells: dilation.leaf_cells,
        bbox_mm: corners(&dilation.bounds),
        volume_mm3: Some([exact.low, exact.high]),
        area_mm2: Some([exact_area.low, exact_area.high]),
        lattice_pitch_mm: dilation.pitch_mm,
        topology_exact: if dilation.topology_exact { Checked::Found(true) } else { Checked::NotChecked },
        ..counted
    }
}

/// What is proven of shapes that are compared: the box of all.
pub(crate) fn of_shapes(shapes: &[(Attractor, AxisBox)], width: f64, tolerance: Tolerance) -> Certificate {
    let warnings = shapes.iter().flat_map(|(shape, _)| shape.warnings().to_vec()).collect();
    let bbox_mm = box_of_all(shapes.iter().map(|(_, bounds)| bounds));
    Certificate { achieved_bound_mm: width, bbox_mm, ..start(warnings, tolerance) }
}

/// The box of the union of shapes.
fn box_of_all<'b>(boxes: impl Iterator<Item = &'b AxisBox>) -> [[Interval; 3]; 2] {
    let chosen = |a: Interval, b: Interval, choose: fn(f64, f64) -> f64| [choose(a[0], b[0]), choose(a[1], b[1])];
    let whole = boxes.map(corners).reduce(|a, b| {
        let end = |end: usize, choose: fn(f64, f64) -> f64| std::array::from_fn(|axis| chosen(a[end][axis], b[end][axis], choose));
        [end(0, f64::min), end(1, f64::max)]
    });
    whole.unwrap_or_default()
}

/// What is proven of one input as a solid.
pub(crate) fn of_operand(rounded: &Rounded, operand: &Operand, tolerance: Tolerance) -> Certificate {
    let counted = of_one_solid(&rounded.solid, rounded.crossings, operand.warnings.clone(), tolerance);
    let [inner, outer] = [operand.statement.inner_bound_mm, operand.statement.outer_bound_mm].map(|bound| bound + rounded.moved_mm);
    Certificate {
        achieved_bound_mm: inner.max(outer),
        inner_bound_mm: Some(inner),
        outer_bound_mm: Some(outer),
        leaf_cells: operand.leaf_cells,
        bbox_mm: corners(&operand.bounds),
        ..counted
    }
}

/// What is proven of solids that were combined: see [`OperationStatement`].
pub(crate) fn of_operation(
    operation: Operation,
    engine: &str,
    operands: &[Operand],
    rounded: &Rounded,
    hull: Option<&Hull>,
    tolerance: Tolerance,
) -> Certificate {
    let warnings = operands.iter().flat_map(|operand| operand.warnings.clone()).collect();
    let mut counted = of_one_solid(&rounded.solid, rounded.crossings, warnings, tolerance);
    let taken_away = |index: usize| operation == Operation::Difference && index > 0;
    let (mut inner, mut outer) = (0.0_f64, 0.0_f64);
    for (index, Operand { statement, .. }) in operands.iter().enumerate() {
        let (within, beyond) = (statement.inner_bound_mm, statement.outer_bound_mm);
        let (within, beyond) = if taken_away(index) { (beyond, within) } else { (within, beyond) };
        (inner, outer) = (inner.max(within), outer.max(beyond));
    }
    // The hull is measured before it is rounded.
    let of_hull = hull.map(|hull| hull.exact_volume(inner, outer));
    let (inner, outer) = (inner + rounded.moved_mm, outer + rounded.moved_mm);
    // What the operations of two families of sets do not share lies in what the sets do not share.
    let difference = operands.iter().map(|operand| operand.volume_error).sum::<f64>() + swept(rounded.solid.mesh(), rounded.moved_mm);
    let (enclosed, difference) = (volume_within(rounded.solid.mesh()), difference * (1.0 + ROUNDING));
    let exact = [enclosed.low - difference, enclosed.high + difference];
    if rounded.crossings > 0 {
        counted.warnings.push(format!("{} pairs of triangles cross or touch where they are not joined", rounded.crossings));
    }
    Certificate {
        achieved_bound_mm: inner.max(outer),
        inner_bound_mm: Some(inner),
        outer_bound_mm: Some(outer),
        leaf_cells: operands.iter().map(|operand| operand.leaf_cells).sum(),
        bbox_mm: box_of(operation, operands),
        // Hulls of sets differ by more than the sets do.
        volume_mm3: of_hull.or_else(|| exact[1].is_finite().then_some([exact[0].max(0.0), exact[1]])),
        operation: Some(OperationStatement {
            operation,
            engine: engine.to_owned(),
            operands: operands.iter().map(|operand| operand.statement.clone()).collect(),
        }),
        ..counted
    }
}

/// Relative rounding of a sum over all triangles of what they sweep.
const ROUNDING: f64 = 1e-10;

/// The volume that a surface sweeps at most when its points move by `length`: a triangle's edges change by 2 length, so on its way it has no more
/// than this area.
fn swept(mesh: &TriMesh, length: f64) -> f64 {
    let corner = |index: u32| mesh.vertices[index as usize];
    let area = |&[a, b, c]: &[u32; 3]| {
        let (p, q) = (corner(b) - corner(a), corner(c) - corner(a));
        0.5 * p.cross(q).length() + length * (p.length() + q.length()) + 2.0 * length * length
    };
    length * mesh.triangles.iter().map(area).sum::<f64>()
}

/// Intervals of the box of what an operation leaves of the exact solids, when it leaves something.
fn box_of(operation: Operation, operands: &[Operand]) -> [[Interval; 3]; 2] {
    let boxes = || operands.iter().map(|operand| &operand.bounds);
    let same = |ends: [Interval; 3]| [ends, ends];
    match operation {
        Operation::Union | Operation::Hull => box_of_all(boxes()),
        Operation::Intersection => same(std::array::from_fn(|axis| {
            let low = boxes().map(|bounds| bounds.low[axis].low).fold(f64::NEG_INFINITY, f64::max);
            let high = boxes().map(|bounds| bounds.high[axis].high).fold(f64::INFINITY, f64::min);
            [low.min(high), low.max(high)]
        })),
        Operation::Difference | Operation::Trim | Operation::Split => {
            same(std::array::from_fn(|axis| boxes().next().map_or([0.0; 2], |bounds| [bounds.low[axis].low, bounds.high[axis].high])))
        }
    }
}

/// What is proven of an evaluation to points that were handed over.
pub(crate) fn of_points(attractor: &Attractor, points: u64, streamed: Streamed, bounds: &AxisBox, tolerance: Tolerance) -> Certificate {
    Certificate {
        achieved_bound_mm: streamed.deviation_mm + bounds.single_precision(),
        leaf_cells: streamed.leaf_cells,
        vertices: points,
        bbox_mm: corners(bounds),
        ..start(attractor.warnings().to_vec(), tolerance)
    }
}

/// What is proven of an evaluation. Counts of its topology are those of the shape's own cells, when all of it has a
/// B-rep.
pub(crate) fn of_evaluation(attractor: &Attractor, tessellation: &Tessellation, bounds: &AxisBox, tolerance: Tolerance) -> Certificate {
    let whole = |complex: &&CellComplex| complex.drawn_vertices() == tessellation.vertices.len() as u64;
    let complex = tessellation.complex.as_ref().filter(whole);
    Certificate {
        achieved_bound_mm: tessellation.deviation_mm + bounds.single_precision(),
        leaf_cells: tessellation.leaf_cells,
        vertices: tessellation.vertices.len() as u64,
        edges: complex.map_or(tessellation.segments.len() as u64, CellComplex::drawn_edges),
        triangles: tessellation.triangles.len() as u64,
        components: complex.map(|complex| complex.components),
        euler: complex.map(|complex| complex.euler),
        boundary_edges: complex.map(|complex| complex.boundary_edges),
        boundary_loops: complex.map(|complex| complex.boundary_loops),
        bbox_mm: corners(bounds),
        ..start(attractor.warnings().to_vec(), tolerance)
    }
}

/// What is counted of a mesh that was only rounded, by `moved_mm` at most, from the vertices that were given.
pub(crate) fn of_polygons(mesh: &TriMesh, topology: &Topology, given: &[DVec3], moved_mm: f64, tolerance: Tolerance) -> Certificate {
    let closed = topology.is_closed_manifold();
    let mut warnings = Vec::new();
    let enclosed = Some(volume(mesh)).filter(|volume| volume.is_finite());
    if !closed {
        warnings.push("the mesh is no closed 2-manifold: slicers repair it by guessing; the volume means nothing".to_owned());
    } else if enclosed.is_some_and(|volume| volume < 0.0) {
        warnings.push("the faces look inwards: the enclosed volume is negative".to_owned());
    }
    let corner = |choose: fn(DVec3, DVec3) -> DVec3| given.iter().copied().reduce(choose).unwrap_or_default().to_array();
    Certificate {
        achieved_bound_mm: moved_mm,
        leaf_cells: topology.triangles,
        cavities: closed.then_some(topology.cavities),
        genus: closed.then_some(topology.genus),
        mesh_volume_mm3: enclosed,
        mesh_area_mm2: Some(area(mesh)).filter(|area| area.is_finite()),
        bbox_mm: [corner(DVec3::min), corner(DVec3::max)].map(|corner| corner.map(|end| [end, end])),
        ..counted(topology, warnings, tolerance)
    }
}

/// What is proven of a shape itself. Its volume and area are known when it is one mesh.
pub(crate) fn of_shape(attractor: &Attractor, bounds: &AxisBox, tolerance: Tolerance) -> Certificate {
    let widest = bounds.low.iter().chain(&bounds.high).map(|end| end.width()).fold(0.0, f64::max);
    let exact = mesh_measures(attractor);
    Certificate {
        achieved_bound_mm: widest,
        bbox_mm: corners(bounds),
        volume_mm3: exact.map(|(volume, _)| [volume.low, volume.high]),
        area_mm2: exact.map(|(_, area)| [area.low, area.high]),
        ..start(attractor.warnings().to_vec(), tolerance)
    }
}

#[cfg(feature = "wire")]
pub(crate) use wire::interval_schema;

#[cfg(feature = "wire")]
pub(crate) mod wire {
    use super::{Checked, SelfIntersections};
    use serde::de::Error as _;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, OneOfBuilder, Type};
    use utoipa::openapi::{RefOr, Schema};

    const NOT_CHECKED: &str = "not_checked";

    fn words(words: &[&str]) -> ObjectBuilder {
        ObjectBuilder::new().schema_type(Type::String).enum_values(Some(words.to_vec()))
    }

    fn array_of(items: impl Into<RefOr<Schema>>, length: usize) -> ArrayBuilder {
        ArrayBuilder::new().items(items.into()).min_items(Some(length)).max_items(Some(length))
    }

    fn interval() -> ArrayBuilder {
        array_of(ObjectBuilder::new().schema_type(Type::Number), 2)
    }

    pub(crate) fn interval_schema() -> RefOr<Schema> {
        interval().into()
    }

    pub(super) fn vector_schema() -> RefOr<Schema> {
        array_of(interval(), 3).into()
    }

    pub(super) fn matrix_schema() -> RefOr<Schema> {
        array_of(array_of(interval(), 3), 3).into()
    }

    pub(super) fn box_schema() -> RefOr<Schema> {
        array_of(array_of(interval(), 3), 2).into()
    }

    pub(super) fn count_schema() -> RefOr<Schema> {
        OneOfBuilder::new()
            .item(words(&["none", NOT_CHECKED]))
            .item(ObjectBuilder::new().schema_type(Type::Integer).minimum(Some(1.0)))
            .into()
    }

    pub(super) fn flag_schema() -> RefOr<Schema> {
        OneOfBuilder::new().item(words(&[NOT_CHECKED])).item(ObjectBuilder::new().schema_type(Type::Boolean)).into()
    }

    impl Serialize for Checked<bool> {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            match self {
                Self::NotChecked => serializer.serialize_str(NOT_CHECKED),
                Self::Found(verdict) => serializer.serialize_bool(*verdict),
            }
        }
    }

    impl Serialize for Checked<SelfIntersections> {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            match self {
                Self::NotChecked => serializer.serialize_str(NOT_CHECKED),
                Self::Found(SelfIntersections::None) => serializer.serialize_str("none"),
                Self::Found(SelfIntersections::Count(count)) => serializer.serialize_u64(*count),
            }
        }
    }

    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Scalar {
        Flag(bool),
        Count(u64),
        Word(String),
    }

    impl<'de> Deserialize<'de> for Checked<bool> {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            match Scalar::deserialize(deserializer)? {
                Scalar::Flag(verdict) => Ok(Self::Found(verdict)),
                Scalar::Word(word) if word == NOT_CHECKED => Ok(Self::NotChecked),
                _ => Err(D::Error::custom("expected true, false or \"not_checked\"")),
            }
        }
    }

    impl<'de> Deserialize<'de> for Checked<SelfIntersections> {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            match Scalar::deserialize(deserializer)? {
                Scalar::Count(count) => Ok(Self::Found(SelfIntersections::Count(count))),
                Scalar::Word(word) if word == "none" => Ok(Self::Found(SelfIntersections::None)),
                Scalar::Word(word) if word == NOT_CHECKED => Ok(Self::NotChecked),
                _ => Err(D::Error::custom("expected \"none\", a count or \"not_checked\"")),
            }
        }
    }
}
