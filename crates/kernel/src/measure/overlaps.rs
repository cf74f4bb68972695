//! Triangles that lie on each other, exactly: what they share is counted twice by the sum of their areas.

use crate::attractor::cell::Point;
use crate::budget::{Budget, Stopped};
use crate::solid::TriMesh;
use crate::solid::box_tree::{Box32, BoxTree};
use crate::solid::contact::{is_flat, side, turn, view};
use glam::DVec3;
use rayon::prelude::*;

/// Pairs of triangles that have more than points and segments in common.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overlaps {
    /// How many pairs.
    pub pairs: u64,
    /// What all pairs share has no more area than this, in mm^2.
    pub most_mm2: f64,
}

/// Leaves handled together.
const CHUNK: usize = 256;
/// Relative rounding of sums of up to 2^32 areas.
const ROUNDING: f64 = 1e-6;

impl Overlaps {
    /// Looks at all pairs of triangles whose boxes meet, whether or not they share vertices. With a the area of all triangles together, what they cover has one between a -
    /// `most_mm2` and a: a place that k of them cover counts k - 1 times too often, and belongs to at least as many pairs. The result does not depend on the number of threads.
    /// Cost: n log n, and the pairs.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn of(mesh: &TriMesh, budget: &Budget) -> Result<Self, Stopped> {
        let corners = |triangle: u32| mesh.points_of(triangle);
        let mut tree = BoxTree::default();
        if mesh.triangles.is_empty() {
            return Ok(Self::default());
        }
        tree.build(mesh.triangles.len(), |triangle| Some(Box32::of(&corners(triangle))), true);
        budget.cancel.check()?;
        let chunks: Vec<Self> = (0..tree.leaves().div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| {
                let mut found = Self::default();
                for leaf in chunk * CHUNK..((chunk + 1) * CHUNK).min(tree.leaves()) {
                    tree.query(tree.leaf_box(leaf), leaf, |other| {
                        found.add(&tree, [leaf, other], &corners);
                        budget.cancel.check().is_ok()
                    });
                }
                found
            })
            .collect();
        budget.cancel.check()?;
        let all = chunks
            .into_iter()
            .fold(Self::default(), |all, part| Self { pairs: all.pairs + part.pairs, most_mm2: all.most_mm2 + part.most_mm2 });
        Ok(Self { most_mm2: all.most_mm2 * (1.0 + ROUNDING), ..all })
    }

    /// Adds the pairs of two leaves, the second not before the first.
    fn add(&mut self, tree: &BoxTree, [leaf, other]: [usize; 2], corners: &impl Fn(u32) -> [Point; 3]) {
        if other < leaf {
            return;
        }
        for (place, (&a, own_box)) in tree.items(leaf).iter().zip(tree.boxes(leaf)).enumerate() {
            let first = if other == leaf { place + 1 } else { 0 };
            for (&b, its_box) in tree.items(other).iter().zip(tree.boxes(other)).skip(first) {
                let (p, q) = (corners(a), corners(b));
                if own_box.meets(its_box) && lie_on_each_other(&p, &q) {
                    self.pairs += 1;
                    self.most_mm2 += area(&p).min(area(&q));
                }
            }
        }
    }
}

/// The area of a triangle, at most: differences, products and the root lose fewer than 16 roundings of the product of its sides.
fn area(corners: &[Point; 3]) -> f64 {
    let [a, b, c] = corners.map(DVec3::from_array);
    let (p, q) = (b - a, c - a);
    0.5 * p.cross(q).length() + 8.0 * f64::EPSILON * p.length() * q.length()
}

/// Whether two triangles share a piece of a plane: all corners lie in one, and no line through a side has the triangles on different sides of it. Of two convex
/// polygons without a common inner point one has such a side.
fn lie_on_each_other(p: &[Point; 3], q: &[Point; 3]) -> bool {
    let Some(axis) = view(p).filter(|_| !is_flat(q)) else { return false };
    if q.iter().any(|corner| side(&p[0], &p[1], &p[2], corner) != 0.0) {
        return false;
    }
    let parts = |one: &[Point; 3], other: &[Point; 3]| {
        (0..3).any(|k| {
            let turned = |x: &Point| turn(axis, &one[k], &one[(k + 1) % 3], x);
            let own = turned(&one[(k + 2) % 3]);
            // Signs alone: products of small numbers might vanish.
            other.iter().all(|corner| {
                let its = turned(corner);
                its == 0.0 || (its > 0.0) != (own > 0.0)
            })
        })
    };
    !parts(p, q) && !parts(q, p)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Triangles with corners of their own.
    fn found(triangles: &[[[f64; 3]; 3]]) -> Overlaps {
        let vertices = triangles.iter().flatten().copied().map(DVec3::from_array).collect();
        let triangles = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        Overlaps::of(&TriMesh { vertices, triangles }, &Budget::default()).unwrap()
    }

    #[test]
    fn triangles_of_one_plane() {
        let moved = |by: [f64; 3]| [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]].map(|x| std::array::from_fn(|k| x[k] + by[k]));
        let here = moved([0.0; 3]);
        // Beside it along a side, at a corner, above it, across it.
        let across = [[0.5, 0.5, -1.0], [0.5, 0.5, 1.0], [0.5, 0.0, 0.0]];
        let beside = [[2.0, 0.0, 0.0], [2.0, 2.0, 0.0], [0.0, 2.0, 0.0]];
        for other in [beside, moved([2.0, 0.0, 0.0]), moved([0.0, 0.0, 1e-300]), across, moved([1.0, 1.0, 0.0])] {
            assert_eq!(found(&[here, other]).pairs, 0, "{other:?}");
        }
        for other in [here, moved([0.1, 0.0, 0.0]), moved([-1.0, 1.5, 0.0]), [[0.1, 0.1, 0.0], [0.2, 0.3, 0.0], [0.3, 0.1, 0.0]]] {
            let found = found(&[here, other]);
            assert_eq!(found.pairs, 1, "{other:?}");
            assert!((found.most_mm2 - area(&other)).abs() <= 1e-5, "{found:?}");
        }
        assert_eq!(found(&[here, here, here]).pairs, 3);
    }
}
