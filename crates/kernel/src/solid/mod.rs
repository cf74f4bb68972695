//! Indexed triangle meshes and proven solids.

pub(crate) mod around;
pub(crate) mod box_tree;
pub(crate) mod contact;
mod crossings;
pub(crate) mod fans;
mod flat;
pub(crate) mod half_edges;
pub(crate) mod inside;
pub(crate) mod mend;
mod normals;
mod repair;
mod shells;
pub(crate) mod topology;

use crate::attractor::cell::Point;
use crate::budget::{Budget, Stopped};
use crate::measure::mass::{volume, volume_within};
pub use crossings::Crossings;
pub use flat::without_flat_shells;
use glam::{BVec3, DVec3};
pub use inside::Inside;
pub use repair::{Repair, RepairError, Repaired, Unfilled, repair};
pub use shells::{MisplacedShell, misplaced_shell};
pub use topology::Topology;

/// Triangles over shared vertices, in mm. Nothing is proven of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Vertex positions in mm.
    pub vertices: Vec<DVec3>,
    /// Vertex indices of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl TriMesh {
    /// Where the corners of a triangle are.
    #[inline]
    pub(crate) fn points_of(&self, triangle: u32) -> [Point; 3] {
        self.triangles[triangle as usize].map(|corner| self.vertices[corner as usize].to_array())
    }

    /// Adds another mesh, with vertices of its own.
    pub fn append(&mut self, other: &Self) {
        let first = self.vertices.len() as u32;
        self.vertices.extend(&other.vertices);
        self.triangles.extend(other.triangles.iter().map(|corners| corners.map(|corner| corner + first)));
    }

    /// For every vertex the first one at the same place, itself where there is none before; coordinates are compared as numbers. Cost: n log n.
    #[must_use]
    pub fn firsts_by_place(&self) -> Vec<u32> {
        // Minus zero is zero.
        let place = |vertex: u32| self.vertices[vertex as usize].to_array().map(|x| (x + 0.0).to_bits());
        let mut order: Vec<u32> = (0..self.vertices.len() as u32).collect();
        order.sort_unstable_by_key(|&vertex| (place(vertex), vertex));
        let mut firsts = vec![0; order.len()];
        for group in order.chunk_by(|&a, &b| place(a) == place(b)) {
            group.iter().for_each(|&vertex| firsts[vertex as usize] = group[0]);
        }
        firsts
    }

    /// A box from one corner to the opposite one, its triangles outwards.
    pub(crate) fn cuboid(low: DVec3, high: DVec3) -> Self {
        let corner = |code: u32| DVec3::select(BVec3::new(code & 1 != 0, code & 2 != 0, code & 4 != 0), high, low);
        let triangles = BOX_FACES.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Self { vertices: (0..8).map(corner).collect(), triangles }
    }

    /// The surface of what is outside of a closed mesh, within a box that is so far away that nothing within a length of one of them is near to the other.
    pub(crate) fn complement(&self, reach: f64) -> Self {
        let far = FAR * reach;
        let low = self.vertices.iter().copied().fold(DVec3::INFINITY, DVec3::min) - far;
        let high = self.vertices.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max) + far;
        let mut other = self.clone();
        other.reverse();
        other.append(&Self::cuboid(low, high));
        other
    }

    /// Turns every triangle around: what was outside is inside.
    pub fn reverse(&mut self) {
        self.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
    }
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

/// How far away a box is, in units of a length within which nothing is near to both it and what is in it.
const FAR: f64 = 2.5;

/// The faces of a box, outwards; bit k of a corner says whether it is at the upper end of axis k.
pub(crate) const BOX_FACES: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// How far a position moves when it becomes a single-precision number: half a unit in the last place along every axis, at coordinates up to `extent`.
pub(crate) fn rounding(extent: f64) -> f64 {
    extent * f64::from(f32::EPSILON) * 0.5 * 3.0_f64.sqrt()
}

/// How far a surface moves at most when it is rounded to single precision and mended, at coordinates up to `extent`, in mm.
#[must_use]
pub fn carried(extent: f64) -> f64 {
    (1.0 + mend::NUDGE) * rounding(extent)
}

/// A solid whose coordinates are single-precision numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Rounded {
    /// The solid.
    pub solid: Solid,
    /// Pairs of triangles that meet elsewhere than where they are joined, mere contacts included.
    pub crossings: u64,
    /// No point of the surface moved farther, in mm.
    pub moved_mm: f64,
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
        if volume_within(&mesh).low <= 0.0 {
            return Err(SolidError::Inward(volume(&mesh)));
        }
        Ok(Self { mesh, topology })
    }

    /// Rounds a closed mesh to single precision, mends what that breaks, and proves that it is a solid. Where parts meet in edges or corners only, these are
    /// doubled. Cost: n log n.
    ///
    /// # Errors
    /// As [`Solid::new`].
    pub fn rounded(mesh: &TriMesh, budget: &Budget) -> Result<Rounded, SolidError> {
        match Self::rounded_as_named(mesh, budget) {
            // Most meshes have no such places: they are not looked for before.
            Err(SolidError::NotManifold(topology)) if topology.nonmanifold_edges + topology.nonmanifold_vertices > 0 => {
                let parted = fans::part(&|vertex| mesh.vertices[vertex as usize].to_array(), &mesh.triangles, budget)?;
                let vertices = parted.origins.iter().map(|&vertex| mesh.vertices[vertex as usize]).collect();
                Self::rounded_as_named(&TriMesh { vertices, triangles: parted.triangles }, budget)
            }
            result => result,
        }
    }

    fn rounded_as_named(mesh: &TriMesh, budget: &Budget) -> Result<Rounded, SolidError> {
        let extent = mesh.vertices.iter().map(|vertex| vertex.abs().max_element()).fold(0.0, f64::max);
        let rounding = rounding(extent);
        let points = mesh.vertices.iter().map(|vertex| vertex.to_array().map(|x| f64::from(x as f32))).collect();
        let mended = mend::mend(points, mesh.triangles.clone(), rounding, budget)?;
        let vertices = mended.points.into_iter().map(DVec3::from_array).collect();
        let solid = Self::new(TriMesh { vertices, triangles: mended.triangles }, budget)?;
        Ok(Rounded { solid, crossings: mended.crossings, moved_mm: carried(extent) })
    }

    /// The mesh; it cannot be changed.
    #[must_use]
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    /// The mesh alone.
    #[must_use]
    pub fn into_mesh(self) -> TriMesh {
        self.mesh
    }

    /// Its counts.
    #[must_use]
    pub fn topology(&self) -> &Topology {
        &self.topology
    }
}
