//! Whether a triangle is between two distances from convex bodies.

use super::super::convex::Convex;
use crate::attractor::cell::{Point, distance_squared, dot, subtract, unit};
use crate::measure::contact::closest_on_segments;
use crate::measure::triangle::closest_on_triangle;

/// How often a triangle is halved at most that no one body is near to, how many parts are looked at, and how much wider than the reach what is that is not asked for.
const DEPTH: u32 = 24;
const MOST_PARTS: u32 = 1 << 18;
const WIDE: f64 = 4.0;
/// What rounding adds to a radius at most, as a share of it.
const ROUNDED: f64 = 1e-12;

/// The hull of a segment's ends, or of a triangle's corners.
pub(super) trait Body: Convex {
    fn corners(&self) -> impl AsRef<[Point]>;

    /// Whether it may be as near to a place as a distance, at a glance.
    #[inline]
    fn may_reach(&self, _: &Point, _: f64) -> bool {
        true
    }

    /// Whether all of a triangle is as near to it as a distance: it is if its corners are, as the distance from a convex body is convex.
    #[inline]
    fn covers(&self, triangle: &[Point; 3], most: f64) -> bool {
        triangle.iter().all(|corner| self.distance_squared(corner) <= most * most)
    }

    /// Whether a plane across a direction parts it from a triangle by a distance.
    #[inline]
    fn is_parted(&self, triangle: &[Point; 3], direction: &Point, least: f64) -> bool {
        lowest(triangle, direction) - self.highest(direction) >= least
    }

    /// Where a triangle is nearer to it than a distance, and what is close to that place, unless a plane parts them by as much: the one across the way between their closest places, which are at a corner of either or on two sides.
    fn too_near(&self, triangle: &[Point; 3], least: f64) -> Option<[Point; 2]> {
        let ([a, b, c], theirs) = (triangle, self.corners());
        let theirs = theirs.as_ref();
        let corners = triangle.iter().map(|corner| [*corner, self.closest(corner)]);
        let of_theirs = theirs.iter().map(|corner| [closest_on_triangle(corner, a, b, c), *corner]);
        let side = |corners: &[Point], k: usize| [corners[k], corners[(k + 1) % corners.len()]];
        let count = if theirs.len() > 2 { theirs.len() } else { 1 };
        let sides = (0..3 * count).map(|k| {
            let (q, p) = closest_on_segments(&side(triangle, k / count), &side(theirs, k % count));
            [q, p]
        });
        let all = corners.chain(of_theirs).chain(sides);
        let [q, p] = all.min_by(|[a, b], [c, d]| distance_squared(a, b).total_cmp(&distance_squared(c, d)))?;
        (!self.is_parted(triangle, &unit(&subtract(&q, &p)), least)).then_some([q, p])
    }
}

pub(super) fn middle(triangle: &[Point; 3]) -> Point {
    std::array::from_fn(|axis| (triangle[0][axis] + triangle[1][axis] + triangle[2][axis]) / 3.0)
}

/// The least value of a triangle along a direction.
pub(super) fn lowest(triangle: &[Point; 3], direction: &Point) -> f64 {
    triangle.iter().map(|corner| dot(direction, corner)).fold(f64::INFINITY, f64::min)
}

/// How far the corners of a triangle are from a place at most.
pub(super) fn radius(triangle: &[Point; 3], centre: &Point) -> f64 {
    triangle.iter().map(|corner| distance_squared(corner, centre)).fold(0.0, f64::max).sqrt() * (1.0 + ROUNDED)
}

/// Both halves of a triangle, parted in the middle of its longest side.
pub(super) fn halves(triangle: &[Point; 3]) -> [[Point; 3]; 2] {
    let long = |k: usize| distance_squared(&triangle[k], &triangle[(k + 1) % 3]);
    let k = (1..3).fold(0, |best, k| if long(k) >= long(best) { k } else { best });
    let (a, b, c) = (triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3]);
    let half: Point = std::array::from_fn(|axis| 0.5 * (a[axis] + b[axis]));
    [[a, half, c], [half, b, c]]
}

/// A place of a triangle that may be farther than a distance from all bodies that are listed; the list is left as it is.
pub(super) fn too_far(bodies: &[impl Body], listed: &mut Vec<u32>, triangle: &[Point; 3], most: f64) -> Option<Point> {
    Cover { bodies, most, left: MOST_PARTS, near: listed }.far(0, triangle, DEPTH)
}

/// Whether bodies are near to all of a triangle.
struct Cover<'a, B> {
    bodies: &'a [B],
    most: f64,
    /// Parts that may be looked at.
    left: u32,
    /// The bodies near to it, and then those near to its parts.
    near: &'a mut Vec<u32>,
}

impl<B: Body> Cover<'_, B> {
    /// A place of a triangle that may be farther from all of the last bodies, given the first of these. The distance grows by no more than the way; and where one body is near to all corners, it is near to all.
    fn far(&mut self, first: usize, triangle: &[Point; 3], depth: u32) -> Option<Point> {
        let (most, end) = (self.most, self.near.len());
        let centre = middle(triangle);
        let wide = radius(triangle, &centre);
        let reach = most + wide;
        let mut least = f64::INFINITY;
        for place in first..end {
            let item = self.near[place];
            let body = &self.bodies[item as usize];
            if body.may_reach(&centre, reach) {
                let square = body.distance_squared(&centre);
                if square <= reach * reach {
                    least = least.min(square.sqrt());
                    self.near.push(item);
                }
            }
        }
        self.left = self.left.saturating_sub(1);
        let covers = |&item: &u32| self.bodies[item as usize].covers(triangle, most);
        let found = if least > most || depth == 0 || self.left == 0 {
            Some(centre)
        } else if least + wide <= most || (wide < WIDE * most && self.near[end..].iter().any(covers)) {
            // Of what is much wider than the reach, nothing covers all.
            None
        } else {
            halves(triangle).iter().find_map(|half| self.far(end, half, depth - 1))
        };
        self.near.truncate(end);
        found
    }
}
