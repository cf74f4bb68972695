//! Points, wires and triangles sampled from an attractor, with the bound they reach.

use crate::attractor::CellComplex;
use glam::DVec3;

/// What an evaluation produced: a set within `deviation_mm` of the shape, in both directions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tessellation {
    /// Positions in mm.
    pub vertices: Vec<DVec3>,
    /// Vertices that stand alone.
    pub points: Vec<u32>,
    /// Segments between vertices.
    pub segments: Vec<[u32; 2]>,
    /// Triangles between vertices.
    pub triangles: Vec<[u32; 3]>,
    /// Normals of the limit surface at the triangles' corners, if they were asked for.
    pub normals: Option<Normals>,
    /// Hausdorff bound reached, in mm.
    pub deviation_mm: f64,
    /// Leaf cells evaluated.
    pub leaf_cells: u64,
    /// The cells behind it, when the shape has a B-rep: its vertices are the first ones here.
    pub complex: Option<CellComplex>,
}

/// Normals of a surface at the corners of its triangles. A vertex has one, but on creases and at corners one for each side.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Normals {
    /// Unit vectors, outward as the triangles run.
    pub vectors: Vec<DVec3>,
    /// Of every triangle of the tessellation, the normals at its corners.
    pub triangles: Vec<[u32; 3]>,
    /// Corners without a tangent plane, where control points coincide: there stands the normal of the triangle.
    pub degenerate: u64,
}
