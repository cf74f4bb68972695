//! Whether a piece of a surface that changes is a graph, and so cannot come to meet itself: a proof that looks at no pair of triangles.
//!
//! Let a closed surface be embedded, so that its winding number is 0 or 1 everywhere off it, and let another one differ from it within a convex set H only. If all triangles of the new
//! one that meet H have normals n with n . v > 0 for one direction v, then it is embedded as well: suppose that its winding number is 2 or more at a point; the point is in H. Along -v from there
//! every triangle is crossed from its front to its back, which adds 1, so that the number is still 2 or more where the line leaves H: but there it is that of the first surface. A number
//! below 0 is led to the same contradiction along v. So the number is 0 or 1 everywhere, while it takes three values around a place where two triangles cross; and where one touches
//! the other, both faced alike, it takes three values on the way through both. Almost all lines miss edges, so that triangles which have no more of H than a corner or an edge need not face v, whose
//! place they share with new ones by name.
//!
//! Where the first surface meets itself already, as slivers do after rounding, nothing is said: what meets in the end is counted, see `mend`.

use super::box_tree::{Box32, BoxTree};
use crate::attractor::cell::{Point, cross, dot, subtract};
use glam::Vec3A;

/// Below this cosine a normal is not taken to face a direction: far above what single precision loses.
const LEAST_COSINE: f64 = 1e-3;

/// The boxes of the unit normals below the nodes of a tree of triangles.
#[derive(Debug, Default)]
pub(super) struct Normals {
    /// By the tree's number of a node.
    nodes: Vec<Box32>,
}

/// The box of a triangle's unit normal: that of all directions if it has no area.
#[inline]
pub(super) fn normal_box(triangle: &[Point; 3]) -> Box32 {
    let normal = along_normal(triangle);
    let length = dot(&normal, &normal).sqrt();
    if length > 0.0 {
        let unit = Vec3A::from_array(normal.map(|part| (part / length) as f32));
        return Box32 { low: unit, high: unit };
    }
    Box32 { low: Vec3A::NEG_ONE, high: Vec3A::ONE }
}

fn along_normal(triangle: &[Point; 3]) -> Point {
    cross(&subtract(&triangle[1], &triangle[0]), &subtract(&triangle[2], &triangle[0]))
}

/// Whether all vectors of a box have a component along v.
#[inline]
fn faces(normals: &Box32, direction: Vec3A) -> bool {
    (normals.low * direction).min(normals.high * direction).element_sum() > LEAST_COSINE as f32
}

impl Normals {
    /// Makes the boxes for a tree, of the triangles that `normal_of` knows.
    pub(super) fn build(&mut self, tree: &BoxTree, normal_of: impl Fn(u32) -> Option<Box32>) {
        self.nodes.clear();
        self.nodes.resize(2 * tree.leaves(), Box32::EMPTY);
        for leaf in 0..tree.leaves() {
            let own = tree.items(leaf).iter().filter_map(|&item| normal_of(item));
            self.nodes[tree.leaves() + leaf] = own.fold(Box32::EMPTY, |all, one| all.union(&one));
        }
        for node in (1..tree.leaves()).rev() {
            self.nodes[node] = self.nodes[2 * node].union(&self.nodes[2 * node + 1]);
        }
    }

    /// Adds the normal that an item has now to those that it had.
    #[inline]
    pub(super) fn add(&mut self, tree: &BoxTree, item: u32, normal: &Box32) {
        let mut node = tree.leaves() + tree.leaf_with(item);
        while node > 0 {
            let grown = self.nodes[node].union(normal);
            if grown == self.nodes[node] {
                return;
            }
            self.nodes[node] = grown;
            node /= 2;
        }
    }

    /// Whether all triangles of the tree that meet the hull of some points, and a few others whose normals have the boxes `own`, surely face one direction. `triangle_at` tells where a triangle of
    /// the tree is, unless it does not count; `is_beside`, whether it has nothing of the hull but corners or an edge.
    pub(super) fn face_one_way(
        &self,
        tree: &BoxTree,
        points: impl Iterator<Item = Point> + Clone,
        own: &[Box32],
        triangle_at: impl Fn(u32) -> Option<[Point; 3]>,
        is_beside: impl Fn(u32, &[Point; 3]) -> bool,
    ) -> bool {
        let all = own.iter().fold(Box32::EMPTY, |all, one| all.union(one));
        let direction = (all.low + all.high).normalize_or_zero();
        if !own.iter().all(|one| faces(one, direction)) {
            return false;
        }
        let exact = direction.to_array().map(f64::from);
        // The hull lies in this box, and between two planes across the direction. What is on the other side of a wire lies below, what is across a gap above.
        let (mut bounds, mut lowest, mut highest) = (Box32::EMPTY, f64::INFINITY, f64::NEG_INFINITY);
        for point in points {
            let along = dot(&point, &exact);
            (lowest, highest) = (lowest.min(along), highest.max(along));
            bounds = bounds.union(&Box32::of(&[point]));
        }
        let is_apart = |triangle: &[Point; 3]| {
            let along = triangle.map(|corner| dot(&corner, &exact));
            along.iter().all(|&x| x < lowest) || along.iter().all(|&x| x > highest)
        };
        let is_facing = |triangle: &[Point; 3]| {
            let normal = along_normal(triangle);
            let along = dot(&normal, &exact);
            along > 0.0 && along * along > LEAST_COSINE * LEAST_COSINE * dot(&normal, &normal)
        };
        let mut facing = true;
        tree.query_unless(
            &bounds,
            0,
            |node| faces(&self.nodes[node], direction),
            |leaf| {
                let near = tree.items(leaf).iter().zip(tree.boxes(leaf)).filter(|(_, own)| own.meets(&bounds));
                facing = near
                    .filter_map(|(&item, _)| Some((item, triangle_at(item)?)))
                    .all(|(item, triangle)| is_facing(&triangle) || is_apart(&triangle) || is_beside(item, &triangle));
                facing
            },
        );
        facing
    }
}
