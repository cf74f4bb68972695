//! The piece of surface in one block of the lattice, and how it follows a lattice that is refined: what belongs to leaves that are no more, or that have
//! other neighbours now, is dropped, and made anew; all else stays.

use super::lattice::Cube;
use super::octree::Changed;
use super::tree::Weighted;
use crate::attractor::cell::Point;
use crate::attractor::sites::SiteError;
use crate::split_mix::mix;
use std::collections::{BTreeMap, HashMap};
use std::hash::{BuildHasherDefault, Hasher};
use std::sync::Mutex;

/// The surface in one block, ready to be joined with its neighbours.
#[derive(Debug, Default)]
pub(super) struct BlockSurface {
    /// Index of the block's first cube.
    pub(super) first_cube: [i64; 3],
    /// Vertices in mm.
    pub(super) vertices: Vec<Point>,
    /// Corners.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The triangles' unit normals, which say the facet exactly where a triangle is a sliver; empty among dense sites, and with `names`.
    pub(super) normals: Vec<[f32; 3]>,
    /// Whether a vertex was tried by the simplification with all of its star; empty before.
    pub(super) settled: Vec<bool>,
    /// Names of vertices that other blocks may have too.
    pub(super) shared: Vec<(VertexName, u32)>,
    /// Names of all vertices, [`UNNAMED`] for those inside a tetrahedron; empty once the lattice is as fine as it will be.
    pub(super) names: Vec<VertexName>,
    /// The leaves whose tetrahedra have some of the surface, in the triangles' order, and the first triangle of each; empty with `names`.
    pub(super) pieces: Vec<(Cube, u32)>,
    /// Leaf cells met.
    pub(super) leaves: u64,
    /// What the searches for sites looked at: see [`super::tree::Tree::looked`].
    pub(super) looked: u64,
    /// Sites that were found near points, see [`super::tree::Tree::found`].
    pub(super) found: u64,
    /// Largest errors of leaves met.
    pub(super) site_error: SiteError,
    /// Cubes to subdivide: the distance may have a critical point on the wrong side there, or, among dense sites, what would be filled is not near a site.
    pub(super) critical: Vec<Cube>,
    /// Vertices whose triangles here do not follow the distance by themselves: those of other blocks have to be known, too.
    pub(super) seams: Vec<Seam>,
    /// The sites near them.
    pub(super) seam_sites: Vec<Weighted>,
    /// Places where no level tells it.
    pub(super) uncertain: Vec<Cube>,
}

/// A vertex that several blocks may have, and the sites near its star in all of them, as indices of the block's.
#[derive(Debug)]
pub(super) struct Seam {
    pub(super) name: VertexName,
    pub(super) sites: Box<[u32]>,
}

/// Surfaces by the index of the block.
pub(super) type Blocks = BTreeMap<[i64; 3], Mutex<BlockSurface>>;

impl BlockSurface {
    /// Where the corners of a triangle are.
    pub(super) fn corners(&self, triangle: u32) -> [Point; 3] {
        self.triangles[triangle as usize].map(|corner| self.vertices[corner as usize])
    }

    /// Gives back what lists have grown beyond their length: all blocks are held at once.
    pub(super) fn shrink(&mut self) {
        self.vertices.shrink_to_fit();
        self.triangles.shrink_to_fit();
        self.normals.shrink_to_fit();
        self.seams.shrink_to_fit();
        self.seam_sites.shrink_to_fit();
        self.shared.shrink_to_fit();
        self.names.shrink_to_fit();
        self.pieces.shrink_to_fit();
    }

    /// The same without what only a lattice needs.
    pub(super) fn alone(&self) -> Self {
        let (vertices, triangles) = (self.vertices.clone(), self.triangles.clone());
        Self { vertices, triangles, leaves: self.leaves, site_error: self.site_error, ..Self::default() }
    }

    /// The number of a vertex that other blocks may have, by its name; `shared` is sorted.
    pub(super) fn number_of(&self, name: VertexName) -> Option<u32> {
        let at = self.shared.partition_point(|&(other, _)| other < name);
        self.shared.get(at).filter(|&&(other, _)| other == name).map(|&(_, number)| number)
    }

    /// Of every vertex, whether other blocks may have it.
    pub(super) fn list_shared(&self, is_shared: &mut Vec<bool>) {
        is_shared.clear();
        is_shared.resize(self.vertices.len(), false);
        self.shared.iter().for_each(|&(_, number)| is_shared[number as usize] = true);
    }

    /// Drops what only a lattice that is refined further needs.
    pub(super) fn drop_lattice(&mut self) {
        (self.names, self.pieces, self.normals) = (Vec::new(), Vec::new(), Vec::new());
        (self.seams, self.seam_sites) = (Vec::new(), Vec::new());
    }

    /// Drops the triangles of leaves whose tetrahedra are others now.
    pub(super) fn drop_changed(&mut self, changed: &Changed) {
        let mut kept = Vec::with_capacity(self.triangles.len());
        let mut normals = Vec::with_capacity(self.normals.len());
        let mut pieces = Vec::with_capacity(self.pieces.len());
        let mut ends = self.pieces.iter().skip(1).map(|&(_, first)| first as usize).chain([self.triangles.len()]);
        for &(leaf, first) in &self.pieces {
            let end = ends.next().unwrap_or(self.triangles.len());
            if !changed.is_new(leaf) {
                pieces.push((leaf, kept.len() as u32));
                kept.extend_from_slice(&self.triangles[first as usize..end]);
                normals.extend_from_slice(self.normals.get(first as usize..end).unwrap_or_default());
            }
        }
        (self.triangles, self.normals, self.pieces) = (kept, normals, pieces);
        self.drop_unused();
    }

    /// Drops the vertices that no triangle has; the others are numbered as triangles meet them.
    pub(super) fn drop_unused(&mut self) {
        let mut numbers = vec![NONE; self.vertices.len()];
        let mut used = Vec::with_capacity(self.vertices.len());
        for corner in self.triangles.iter_mut().flatten() {
            let number = &mut numbers[*corner as usize];
            if *number == NONE {
                *number = used.len() as u32;
                used.push(*corner as usize);
            }
            *corner = *number;
        }
        self.vertices = used.iter().map(|&old| self.vertices[old]).collect();
        if !self.names.is_empty() {
            self.names = used.iter().map(|&old| self.names[old]).collect();
        }
        self.shared.iter_mut().for_each(|(_, number)| *number = numbers[*number as usize]);
        self.shared.retain(|&(_, number)| number != NONE);
    }
}

/// No vertex.
const NONE: u32 = u32::MAX;

/// What a vertex on an edge or a face of the lattice is called by every tetrahedron there.
pub(super) type VertexName = u128;

/// What vertices inside a tetrahedron are called, which no other has.
pub(super) const UNNAMED: VertexName = 0;

/// Mixes names, and coordinates of vertices and cubes, which nobody can choose to collide.
#[derive(Clone, Debug, Default)]
pub(super) struct NameHasher(u64);

/// A hash map by names or coordinates.
pub(super) type NameMap<K, V> = HashMap<K, V, BuildHasherDefault<NameHasher>>;

impl Hasher for NameHasher {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        for part in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..part.len()].copy_from_slice(part);
            self.write_u64(u64::from_le_bytes(word));
        }
    }
    fn write_u128(&mut self, name: u128) {
        self.0 = mix(self.0 ^ name as u64 ^ mix((name >> 64) as u64));
    }
    fn write_u64(&mut self, part: u64) {
        self.0 = mix(self.0.rotate_left(21) ^ part);
    }
    fn write_i64(&mut self, part: i64) {
        self.write_u64(part as u64);
    }
    fn write_u32(&mut self, part: u32) {
        self.write_u64(u64::from(part));
    }
    fn write_i32(&mut self, part: i32) {
        self.write_u64(u64::from(part as u32));
    }
    fn write_usize(&mut self, length: usize) {
        self.write_u64(length as u64);
    }
}
