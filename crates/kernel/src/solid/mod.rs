//! Indexed triangle meshes and proven solids.

use glam::DVec3;

/// Triangles over shared vertices, in mm. Nothing is proven of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Vertex positions in mm.
    pub vertices: Vec<DVec3>,
    /// Vertex indices of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// Counts of a triangle mesh's topology.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Topology {
    /// Vertices that triangles use.
    pub vertices: u64,
    /// Edges.
    pub edges: u64,
    /// Triangles.
    pub triangles: u64,
    /// Connected surfaces.
    pub shells: u64,
    /// Shells that face inwards: sealed voids.
    pub cavities: u64,
    /// Connected pieces of material: shells that face outwards.
    pub components: u64,
    /// Sum of the shells' genera: shells - euler / 2.
    pub genus: i64,
    /// vertices - edges + triangles.
    pub euler: i64,
    /// Edges with one triangle.
    pub boundary_edges: u64,
    /// Edges with three triangles or more.
    pub nonmanifold_edges: u64,
    /// Vertices whose triangles form several fans.
    pub nonmanifold_vertices: u64,
    /// Pairs of triangles that run along their edge in the same direction.
    pub flipped_pairs: u64,
    /// Triangles with a repeated or coincident corner, or no area.
    pub degenerate_triangles: u64,
}

/// A closed, oriented 2-manifold triangle mesh with outward normals.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    mesh: TriMesh,
    topology: Topology,
}

impl Solid {
    /// The mesh; it cannot be changed.
    #[must_use]
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    /// Its counts.
    #[must_use]
    pub fn topology(&self) -> &Topology {
        &self.topology
    }
}
