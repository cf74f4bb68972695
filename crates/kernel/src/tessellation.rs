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
    /// Hausdorff bound reached, in mm.
    pub deviation_mm: f64,
    /// Leaf cells evaluated.
    pub leaf_cells: u64,
    /// The cells behind it, when the shape has a B-rep: its vertices are the first ones here.
    pub complex: Option<CellComplex>,
}
