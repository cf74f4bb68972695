//! What a certificate asks of sites: each of them is a convex set, and those near a place are found.

use super::tree::{NodeId, SiteId, in_space};
use crate::attractor::cell::{Point, distance_squared, dot, subtract};
use crate::attractor::sites::SiteError;

/// A convex set, with its deficit.
pub(super) trait Convex {
    /// See [`crate::attractor::sites::SiteRule::deficit`].
    fn deficit(&self) -> f64;

    /// The point of the set that is closest to x.
    fn closest(&self, x: &Point) -> Point;

    /// The largest value of its points along a direction.
    fn highest(&self, direction: &Point) -> f64;

    /// The squared distance of x, the deficit included.
    #[inline]
    fn distance_squared(&self, x: &Point) -> f64 {
        distance_squared(x, &self.closest(x)) + self.deficit()
    }

    /// The distance in space where that with the deficit is `distance`.
    #[inline]
    fn in_space(&self, distance: f64) -> f64 {
        in_space(distance, self.deficit())
    }
}

impl<C: Convex> Convex for &C {
    #[inline]
    fn deficit(&self) -> f64 {
        (**self).deficit()
    }

    #[inline]
    fn closest(&self, x: &Point) -> Point {
        (**self).closest(x)
    }

    #[inline]
    fn highest(&self, direction: &Point) -> f64 {
        (**self).highest(direction)
    }
}

/// A ball that holds sites, with the least of their deficits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    pub(super) centre: Point,
    pub(super) radius: f64,
    pub(super) deficit: f64,
}

impl Convex for Ball {
    #[inline]
    fn deficit(&self) -> f64 {
        self.deficit
    }

    #[inline]
    fn closest(&self, x: &Point) -> Point {
        let way = subtract(x, &self.centre);
        let length = dot(&way, &way).sqrt();
        if length > self.radius { std::array::from_fn(|axis| self.centre[axis] + self.radius / length * way[axis]) } else { *x }
    }

    /// Of a unit vector.
    #[inline]
    fn highest(&self, direction: &Point) -> f64 {
        dot(&self.centre, direction) + self.radius
    }
}

/// Convex sites and nodes above them, all by their numbers.
pub(super) trait SiteSearch {
    type Site<'b>: Convex
    where
        Self: 'b;

    /// What a search in a part of space begins with.
    type Candidates: ?Sized;

    /// Begins in another part of space; returns the nodes that all searches there may begin with.
    fn reset(&mut self, candidates: &Self::Candidates) -> Vec<NodeId>;

    /// A site by its number.
    fn site(&self, id: SiteId) -> Self::Site<'_>;

    /// Calls `visit` with all sites below `starts` that are within `reach` of x, their closest points and squared distances. Of all below a node whose ball is smaller than `size` it gives one, with the node, if any may be so near.
    fn visit_near(&mut self, x: &Point, starts: &[NodeId], reach: f64, size: f64, visit: impl FnMut(SiteId, &Point, f64, Option<NodeId>));

    /// The ball around what is below a node.
    fn ball(&self, node: NodeId) -> Ball;

    /// Adds the nodes and the sites that are directly below a node.
    fn add_below(&mut self, node: NodeId, nodes: &mut Vec<NodeId>, sites: &mut Vec<SiteId>);

    /// Nodes below `starts` that may hold a site within `reach` of x: as small as possible without becoming many.
    fn gather(&mut self, x: &Point, starts: &[NodeId], reach: f64, found: &mut Vec<NodeId>);

    /// How far sites may be from what they stand for, beyond [`SiteSearch::largest_error`].
    fn deviation(&self) -> f64;

    /// Largest errors of the sites that were met.
    fn largest_error(&self) -> SiteError;

    /// Whether sites are missing, as there are too many: answers are then worthless.
    fn is_exhausted(&self) -> bool;

    /// Bytes of what it has of its own.
    fn bytes(&self) -> usize;
}
