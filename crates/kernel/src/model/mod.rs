//! Shapes as people describe them: one plain struct per family, each of which lowers to an
//! automaton with control points. Lengths are mm; nothing here is checked yet.

mod bcifs;
mod bezier;
mod corner_cutting;
mod group;
mod half_edge;
mod ifs;
mod join;
mod lower;
mod mesh;
pub mod polygon;
mod radius;
mod scheme;
pub mod solve;
mod subdivision;
mod terrain;

pub use bcifs::{
    Adjacency, Bcifs, BcifsState, BoundarySpec, CellKind, Entry, Glue, Incidence, Matrix, Relation, RootCell, Side, TransitionSpec,
};
pub use bezier::BezierCurve;
pub use corner_cutting::CornerCutting;
pub use group::{Group, Part, PartRadius};
pub use half_edge::{HalfEdge, HalfEdgeMesh, MeshFault};
pub use ifs::{AffineMap, Ifs, Primitive};
pub use join::{Border, BorderPath, Join};
pub use lower::{Finding, Lowered};
pub use mesh::{CutMesh, Interior, PolygonMesh};
pub use scheme::{ControlNet, Curve, CurveScheme, Parametrization, Sum, TensorProduct, Trim, TrimCurve};
pub use subdivision::{BoundaryRule, Coefficients, Corner, Crease, INFINITE_SHARPNESS, Scheme, Subdivision};
pub use terrain::{Terrain, TerrainBase};

/// Weights of control points that double precision can project without overflow.
pub const WEIGHTS: std::ops::RangeInclusive<f64> = 1e-100..=1e100;

/// A model: a name and a shape in mm.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// What the author calls it.
    pub name: Option<String>,
    /// What it is.
    pub shape: Shape,
}

/// A shape of one of the families.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Affine maps of space, with an optional graph.
    Ifs(Ifs),
    /// States, operators and boundaries stated in full.
    Bcifs(Bcifs),
    /// A polynomial or rational Bezier curve.
    BezierCurve(BezierCurve),
    /// The curve of a corner-cutting scheme.
    CornerCutting(CornerCutting),
    /// The limit surface of a subdivision scheme.
    Subdivision(Subdivision),
    /// A curve of one of the schemes.
    Curve(Curve),
    /// A product of two or three schemes.
    TensorProduct(TensorProduct),
    /// The sum of two curves.
    Sum(Sum),
    /// A polygon mesh.
    Mesh(PolygonMesh),
    /// A surface of random midpoint displacement.
    Terrain(Terrain),
    /// Several shapes.
    Group(Group),
}
