//! Self-intersections of a triangle mesh, exactly.

use super::TriMesh;
use super::box_tree::{Box32, BoxTree};
use super::contact;
use super::mend::Facet;
use crate::attractor::cell::Point;
use crate::budget::{Budget, CancelToken, Stopped};
use rayon::prelude::*;
use std::collections::HashSet;
use std::ops::Range;

/// Pairs of triangles that meet elsewhere than in corners and edges they share.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Crossings {
    /// How many pairs.
    pub count: u64,
    /// The first of them, each with the smaller index first, about in their order along a space-filling curve; a triangle without area is paired with itself.
    pub first: Vec<[u32; 2]>,
}

/// Pairs that are kept.
const KEPT: usize = 16;
/// Leaves handled together: by a thread, and with what is near to them.
const CHUNK: usize = 256;
const BLOCK: usize = 8;
/// Others near to these that are looked at at once.
const MOST_NEAR: usize = 4_096;

impl Crossings {
    /// Looks at all pairs of triangles whose boxes meet: overlaps in a plane and mere contacts count, and so do vertices of different
    /// numbers at the same place. Cost: n log n, 0.7 us a triangle or so. All corners must name vertices. The result does not depend on
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
        let mut tree = BoxTree::default();
        tree.build(mesh.triangles.len(), |triangle| Some(Box32::of(&mesh.points_of(triangle))), true);
        budget.cancel.check()?;
        if mesh.triangles.is_empty() {
            return Ok(Self::default());
        }
        let chunks: Vec<Self> = (0..tree.leaves().div_ceil(CHUNK))
            .into_par_iter()
            .map_init(Near::default, |near, chunk| {
                let mut found = Self::default();
                for first in (chunk * CHUNK..((chunk + 1) * CHUNK).min(tree.leaves())).step_by(BLOCK) {
                    near.compare(mesh, &tree, first..(first + BLOCK).min(tree.leaves()), kept, &mut found, &budget.cancel);
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

/// Triangles of some leaves, and then others that they may meet, one after the other: most are near to several of the leaves.
#[derive(Default)]
struct Near {
    triangles: Vec<u32>,
    boxes: Vec<Box32>,
    corners: Vec<([u32; 3], [Point; 3])>,
    /// Those near to a leaf.
    met: Vec<usize>,
}

impl Near {
    /// Adds the crossings of some leaves' triangles with those of these and all later leaves, until it is stopped.
    fn compare(&mut self, mesh: &TriMesh, tree: &BoxTree, leaves: Range<usize>, kept: usize, found: &mut Crossings, cancel: &CancelToken) {
        let whole = leaves.clone().fold(Box32::EMPTY, |all, leaf| all.union(tree.leaf_box(leaf)));
        self.keep(0);
        let mut own: Vec<Range<usize>> = Vec::with_capacity(BLOCK);
        for leaf in leaves.clone() {
            let first = self.triangles.len();
            tree.items(leaf).iter().zip(tree.boxes(leaf)).for_each(|(&triangle, bounds)| self.add(mesh, triangle, bounds));
            own.push(first..self.triangles.len());
        }
        let (count, mut from) = (self.triangles.len(), 0);
        let mut is_stopped = false;
        tree.query(&whole, leaves.end, |leaf| {
            if leaf >= leaves.end {
                let near = tree.items(leaf).iter().zip(tree.boxes(leaf)).filter(|(_, bounds)| whole.meets(bounds));
                near.for_each(|(&triangle, bounds)| self.add(mesh, triangle, bounds));
            }
            // Where everything overlaps, some leaves have as many others as there are.
            if self.triangles.len() >= count + MOST_NEAR {
                is_stopped = cancel.check().is_err();
                self.look(tree, leaves.start, &own, from, kept, found);
                self.keep(count);
                from = count;
            }
            !is_stopped
        });
        if !is_stopped && cancel.check().is_ok() {
            self.look(tree, leaves.start, &own, from, kept, found);
        }
    }

    /// Forgets all but some.
    fn keep(&mut self, count: usize) {
        self.triangles.truncate(count);
        self.boxes.truncate(count);
        self.corners.truncate(count);
    }

    fn add(&mut self, mesh: &TriMesh, triangle: u32, bounds: &Box32) {
        self.triangles.push(triangle);
        self.boxes.push(*bounds);
        self.corners.push((mesh.triangles[triangle as usize], mesh.points_of(triangle)));
    }

    /// Adds the crossings of the leaves' own triangles, leaf by leaf, with later ones that are there from some place on.
    fn look(&mut self, tree: &BoxTree, first: usize, own: &[Range<usize>], from: usize, kept: usize, found: &mut Crossings) {
        let Self { triangles, boxes, corners, met } = self;
        let mut note = |a: usize, b: usize| {
            found.count += 1;
            if found.first.len() < kept {
                let pair = [triangles[a], triangles[b]];
                found.first.push([pair[0].min(pair[1]), pair[0].max(pair[1])]);
            }
        };
        for (leaf, own) in (first..).zip(own) {
            let whole = tree.leaf_box(leaf);
            met.clear();
            met.extend((from.max(own.start)..triangles.len()).filter(|&other| whole.meets(&boxes[other])));
            for a in own.clone() {
                if from == 0 && contact::is_flat(&corners[a].1) {
                    note(a, a);
                }
                // Most pairs are neighbours that a plane parts, which is found faster than the signs of determinants.
                let facet = Facet::new(corners[a].0, corners[a].1);
                for &b in met.iter().filter(|&&b| b > a && boxes[a].meets(&boxes[b])) {
                    let (names, points) = &corners[b];
                    let is_copy = names.iter().all(|corner| corners[a].0.contains(corner));
                    if is_copy || (!facet.parts(names, points) && contact::meet([&corners[a].0, names], [&corners[a].1, points])) {
                        note(a, b);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split_mix::Random;
    use glam::DVec3;

    /// Needles all over each other, more than are looked at at once, some of them without area, with common corners, or twice there: the pairs that exact predicates tell one by one, for any number of threads. (Which ones those without area meet is not told exactly.)
    #[test]
    fn more_than_are_looked_at_at_once_are_all_compared() {
        let mut random = Random(3);
        let mut place = |size: f64| DVec3::from_array(std::array::from_fn(|_| f64::from((size * (random.share() - 0.5)) as f32)));
        let mut mesh = TriMesh::default();
        for number in 0..MOST_NEAR as u32 + 2_000 {
            let (from, first) = (place(1.0), mesh.vertices.len() as u32);
            let shared = if number % 5 == 1 { 0 } else { first };
            mesh.vertices.extend([from, from + place(4.0), from + if number % 97 == 0 { DVec3::ZERO } else { place(0.01) }]);
            mesh.triangles.push([shared, first + 1, first + 2]);
        }
        mesh.triangles.extend_from_within(7..12);
        let corners: Vec<[Point; 3]> = (0..mesh.triangles.len() as u32).map(|triangle| mesh.points_of(triangle)).collect();
        let meet = |a: usize, b: usize| {
            if a == b {
                contact::is_flat(&corners[a])
            } else {
                contact::meet([&mesh.triangles[a], &mesh.triangles[b]], [&corners[a], &corners[b]])
            }
        };
        let count = corners.len();
        let is_told = |[a, b]: &[u32; 2]| a == b || ![a, b].iter().any(|&&triangle| contact::is_flat(&corners[triangle as usize]));
        let boxes: Vec<Box32> = corners.iter().map(|corners| Box32::of(corners)).collect();
        let boxes_meet = |a: usize, b: usize| boxes[a].meets(&boxes[b]);
        let expected: HashSet<[u32; 2]> = (0..count)
            .into_par_iter()
            .flat_map_iter(|a| {
                let own: Vec<[u32; 2]> =
                    (a..count).filter(|&b| boxes_meet(a, b) && meet(a, b)).map(|b| [a as u32, b as u32]).filter(is_told).collect();
                own
            })
            .collect();
        assert!(expected.len() > 10_000);
        for threads in [1, 4] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let found = pool.install(|| Crossings::among(&mesh, 2 * expected.len(), &Budget::default())).unwrap();
            let first: HashSet<[u32; 2]> = found.first.iter().copied().filter(is_told).collect();
            assert_eq!((found.count as usize, first.len()), (found.first.len(), found.first.iter().filter(|pair| is_told(pair)).count()));
            assert!(first == expected, "{threads}: {} of {}", first.len(), expected.len());
        }
    }
}
