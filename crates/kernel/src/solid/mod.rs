//! Indexed triangle meshes and proven solids.

pub(crate) mod box_tree;
pub(crate) mod contact;
mod crossings;
pub(crate) mod topology;

use crate::budget::{Budget, Stopped};
use crate::measure::mass::volume;
pub use crossings::Crossings;
use glam::DVec3;
pub use topology::Topology;

/// Triangles over shared vertices, in mm. Nothing is proven of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Vertex positions in mm.
    pub vertices: Vec<DVec3>,
    /// Vertex indices of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// A closed, oriented 2-manifold triangle mesh with outward normals, in mm.
///
/// Invariant, proven by [`Solid::new`]: every directed edge has exactly one opposite, the triangles around
/// every vertex form one fan, no triangle has a repeated corner, and the enclosed volume is positive.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    mesh: TriMesh,
    topology: Topology,
}

/// Why a mesh is no solid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolidError {
    /// There is no triangle.
    #[error("the mesh has no triangle")]
    Empty,
    /// A corner names no vertex.
    #[error("triangle {triangle} names vertex {vertex}, and there are {vertices}")]
    Index {
        /// The triangle.
        triangle: usize,
        /// The missing vertex.
        vertex: u32,
        /// How many there are.
        vertices: usize,
    },
    /// Some edge or vertex is not manifold.
    #[error("{} open, {} non-manifold edges, {} flipped pairs, {} non-manifold vertices, {} degenerate triangles", .0.boundary_edges, .0.nonmanifold_edges, .0.flipped_pairs, .0.nonmanifold_vertices, .0.degenerate_triangles)]
    NotManifold(Box<Topology>),
    /// The mesh encloses no positive volume.
    #[error("the mesh encloses {0} mm3: its triangles look inwards")]
    Inward(f64),
    /// Somebody stopped the check.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

impl Solid {
    /// Proves that the mesh is a solid. Cost: linear.
    ///
    /// # Errors
    /// [`SolidError`] with the counts that were found.
    pub fn new(mesh: TriMesh, budget: &Budget) -> Result<Self, SolidError> {
        if mesh.triangles.is_empty() {
            return Err(SolidError::Empty);
        }
        let topology = Topology::of(&mesh, budget)?;
        if !topology.is_closed_manifold() {
            return Err(SolidError::NotManifold(Box::new(topology)));
        }
        let volume = volume(&mesh);
        if volume <= 0.0 {
            return Err(SolidError::Inward(volume));
        }
        Ok(Self { mesh, topology })
    }

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
