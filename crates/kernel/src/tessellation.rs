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
    pub normals: Option<Box<Normals>>,
    /// Hausdorff bound reached, in mm.
    pub deviation_mm: f64,
    /// Leaf cells evaluated.
    pub leaf_cells: u64,
    /// The cells behind it, when the shape has a B-rep: its vertices are the first ones here.
    pub complex: Option<CellComplex>,
}

impl Tessellation {
    /// Adds what another evaluation made of another part of the shape, the complex of which goes behind this one's.
    /// Neither has vertices beyond its complex.
    pub(crate) fn append(&mut self, other: Self) {
        let offset = self.vertices.len() as u32;
        self.vertices.extend(other.vertices);
        self.points.extend(other.points.into_iter().map(|point| point + offset));
        self.segments.extend(other.segments.into_iter().map(|ends| ends.map(|end| end + offset)));
        self.triangles.extend(other.triangles.into_iter().map(|corners| corners.map(|corner| corner + offset)));
        self.deviation_mm = self.deviation_mm.max(other.deviation_mm);
        self.leaf_cells += other.leaf_cells;
        match (&mut self.complex, other.complex) {
            (Some(own), Some(other)) => own.append(other),
            (own @ None, other) => *own = other,
            (Some(_), None) => {}
        }
    }
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
