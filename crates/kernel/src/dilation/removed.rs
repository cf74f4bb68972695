//! Vertices that are removed from a mesh, and which of the triangles that are left stands for each.

use crate::solid::half_edges::{NONE, Star, kept};

/// What triangles stand for, and what of it is around the vertex that is looked at.
pub(super) struct Removed {
    /// The first vertex that a triangle stands for, and the next one of each.
    first: Vec<u32>,
    next: Vec<u32>,
    /// The vertex of a star, and those that its triangles stand for; and which of the triangles that come to be will stand for each.
    pub(super) around: Vec<u32>,
    pub(super) owners: Vec<usize>,
}

impl Removed {
    /// Nothing, of so many triangles and vertices.
    pub(super) fn new(triangles: usize, vertices: usize) -> Self {
        Self { first: vec![NONE; triangles], next: vec![NONE; vertices], around: Vec::new(), owners: Vec::new() }
    }

    /// Finds what is around a vertex.
    pub(super) fn look(&mut self, vertex: u32, star: &Star) {
        let mut around = std::mem::take(&mut self.around);
        around.clear();
        around.push(vertex);
        star.halves.iter().for_each(|half| self.each(half / 3, |own| around.push(own)));
        self.around = around;
    }

    /// Gives all that is around the star's vertex, which has moved to ring m, to its owners.
    pub(super) fn remove(&mut self, star: &Star, m: usize) {
        let Self { first, next, around, owners } = self;
        star.halves.iter().for_each(|half| first[(half / 3) as usize] = NONE);
        let fresh: Vec<usize> = kept(Some(m), star.halves.len()).map(|k| (star.halves[k] / 3) as usize).collect();
        for (&own, &owner) in around.iter().zip(&*owners) {
            let first = &mut first[fresh[owner]];
            next[own as usize] = *first;
            *first = own;
        }
    }

    /// Calls `visit` with the vertices that a triangle stands for.
    pub(super) fn each(&self, triangle: u32, mut visit: impl FnMut(u32)) {
        let mut own = self.first[triangle as usize];
        while own != NONE {
            visit(own);
            own = self.next[own as usize];
        }
    }
}
