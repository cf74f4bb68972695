//! Self-intersections of a triangle mesh, exactly.

use super::TriMesh;
use super::box_tree::{Box32, BoxTree, LEAF};
use super::contact;
use super::mend::Facet;
use crate::attractor::cell::Point;
use crate::budget::{Budget, CancelToken, Stopped};
use rayon::prelude::*;
use std::collections::HashSet;

/// Pairs of triangles that meet elsewhere than in corners and edges they share.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Crossings {
    /// How many pairs.
    pub count: u64,
    /// The first of them, each with the smaller index first, in ascending order along a space-filling curve; a triangle without area is paired with itself.
    pub first: Vec<[u32; 2]>,
}

/// Pairs that are kept.
const KEPT: usize = 16;
/// Leaves handled together.
const CHUNK: usize = 256;

impl Crossings {
    /// Looks at all pairs of triangles whose boxes meet: overlaps in a plane and mere contacts count, and so do vertices of different
    /// numbers at the same place. Cost: n log n, about 1 us a triangle. All corners must name vertices. The result does not depend on
    /// the number of threads.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn of(mesh: &TriMesh, budget: &Budget) -> Result<Self, Stopped> {
        Self::among(mesh, usize::MAX, budget)
    }

    /// The corners of those that were kept.
    pub(super) fn corners(&self, triangles: &[[u32; 3]]) -> HashSet<u32> {
        self.first.iter().flatten().flat_map(|&triangle| triangles[triangle as usize]).collect()
    }

    /// As [`Crossings::of`], keeping up to `most` pairs.
    pub(crate) fn among(mesh: &TriMesh, most: usize, budget: &Budget) -> Result<Self, Stopped> {
        let kept = if most == usize::MAX { KEPT } else { most };
        let corners = |triangle: u32| mesh.triangles[triangle as usize].map(|corner| mesh.vertices[corner as usize].to_array());
        let mut tree = BoxTree::default();
        tree.build(mesh.triangles.len(), |triangle| Some(Box32::of(&corners(triangle))), true);
        budget.cancel.check()?;
        if mesh.triangles.is_empty() {
            return Ok(Self::default());
        }
        let chunks: Vec<Self> = (0..tree.leaves().div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| {
                let mut found = Self::default();
                for leaf in chunk * CHUNK..((chunk + 1) * CHUNK).min(tree.leaves()) {
                    of_leaf(mesh, &tree, leaf, kept, &corners, &mut found, &budget.cancel);
                }
                found
            })
            .collect();
        budget.cancel.check()?;
        let mut result = Self::default();
        for chunk in chunks {
            result.count += chunk.count;
            result.first.extend(chunk.first);
        }
        result.first.truncate(kept);
        Ok(result)
    }
}

/// Adds the crossings of a leaf's triangles with those of this and all later leaves, until it is stopped.
fn of_leaf(
    mesh: &TriMesh,
    tree: &BoxTree,
    leaf: usize,
    kept: usize,
    corners: &impl Fn(u32) -> [Point; 3],
    found: &mut Crossings,
    cancel: &CancelToken,
) {
    if cancel.check().is_err() {
        return;
    }
    let mut note = |a: u32, b: u32| {
        found.count += 1;
        if found.first.len() < kept {
            found.first.push([a.min(b), a.max(b)]);
        }
    };
    for &triangle in tree.items(leaf) {
        if contact::is_flat(&corners(triangle)) {
            note(triangle, triangle);
        }
    }
    // Most pairs are neighbours that a plane parts, which is found faster than the signs of determinants.
    let facets: [Option<Facet>; LEAF] =
        std::array::from_fn(|k| tree.items(leaf).get(k).map(|&own| Facet::new(mesh.triangles[own as usize], corners(own))));
    tree.query(tree.leaf_box(leaf), leaf, |other| {
        if other < leaf {
            return true;
        }
        for (place, ((&a, own_box), facet)) in tree.items(leaf).iter().zip(tree.boxes(leaf)).zip(facets.iter().flatten()).enumerate() {
            let first = if other == leaf { place + 1 } else { 0 };
            for (&b, b_box) in tree.items(other).iter().zip(tree.boxes(other)).skip(first) {
                if !own_box.meets(b_box) {
                    continue;
                }
                let (names, points) = ([&mesh.triangles[a as usize], &mesh.triangles[b as usize]], corners(b));
                let is_copy = names[1].iter().all(|corner| names[0].contains(corner));
                if is_copy || (!facet.parts(names[1], &points) && contact::meet(names, [&corners(a), &points])) {
                    note(a, b);
                }
            }
        }
        // Where everything overlaps, a leaf alone has as many others as there are.
        cancel.check().is_ok()
    });
}
