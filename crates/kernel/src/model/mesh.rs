//! Polygon meshes as shapes.

use glam::DVec3;

/// Whether a mesh stands for its surface or for the solid it bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Interior {
    /// The solid when the mesh is closed and outward, else the surface.
    #[default]
    Auto,
    /// The solid; an error when the mesh is not closed.
    Solid,
    /// The surface.
    Surface,
}

/// A polygon mesh, with planar or nearly planar faces that are fanned into triangles from their
/// first corner.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct PolygonMesh {
    /// Corner points in mm.
    pub vertices: Vec<DVec3>,
    /// Corner indices of each face: one (a point), two (a segment), three or more (a polygon).
    pub faces: Vec<Vec<u32>>,
    /// Surface or solid.
    pub interior: Interior,
}
