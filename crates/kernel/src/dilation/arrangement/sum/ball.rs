//! A polytope between two balls, whose facets go on smoothly along the faces and edges that it is moved along.

use super::super::polytopes;
use crate::attractor::cell::{Point, between, dot, unit};
use std::f64::consts::TAU;

/// Facets at most.
const MOST_FACETS: usize = 192;
/// Directions that differ by less are one: noise of single precision is less, and so is what it makes of distances.
pub(super) const SAME: f64 = 1e-5;
/// Corners that differ by less are one, in units of the radius.
const TINY: f64 = 1e-6;
/// What is beyond all of a ball, in units of its offsets.
const WIDE: f64 = 4.0;

/// A convex polytope around the origin.
#[derive(Clone, Debug, Default)]
pub(super) struct Ball {
    /// The unit normals of its facets.
    pub(super) facets: Vec<Point>,
    offsets: Vec<f64>,
    corners: Vec<Point>,
    /// Its edges by the facets on both sides.
    edges: Vec<[usize; 2]>,
}

/// Whether two directions are one.
pub(super) fn is_same(a: &Point, b: &Point) -> bool {
    (0..3).all(|axis| (a[axis] - b[axis]).abs() < SAME)
}

impl Ball {
    /// How many corners it has.
    pub(super) fn corners(&self) -> usize {
        self.corners.len()
    }

    /// By how much facets side by side may turn that touch an inner ball and have their edge in an outer one; none where so many would go around as are too many in all.
    pub(super) fn widest(inner: f64, outer: f64) -> Option<f64> {
        let widest = 2.0 * (inner / outer).min(1.0).acos();
        (widest * MOST_FACETS as f64 > TAU).then_some(widest)
    }

    /// One around the ball with the inner radius, and within that with the outer one, that has facets with the first normals as far out as `middle`, with the others as far as they turn from all before by an angle, and few corners besides; none where that takes too many facets.
    ///
    /// All but the first touch the inner ball. Corners that are too far out are cut off, the farthest ones first, as far down as the next ones that are not, or as the inner ball: whichever leaves fewer.
    pub(super) fn between(normals: [&[Point]; 2], least: f64, [inner, middle, outer]: [f64; 3]) -> Option<Self> {
        let mut first = Self::default();
        normals[0].iter().for_each(|normal| first.add(*normal, middle));
        for normal in normals[1] {
            let is_apart = |own: &Point| dot(own, normal) < least.cos();
            if first.facets.iter().all(is_apart) {
                first.add(*normal, inner);
            }
        }
        let made = [true, false].map(|is_shallow| first.clone().cut(inner, outer, is_shallow));
        made.into_iter().flatten().min_by_key(|own| own.corners.len())
    }

    /// The same with corners cut off until none is too far out.
    fn cut(mut self, inner: f64, outer: f64, is_shallow: bool) -> Option<Self> {
        while self.facets.len() <= MOST_FACETS {
            self.close();
            let square = |corner: &Point| dot(corner, corner);
            let farthest = self.corners.iter().map(square).fold(0.0, f64::max);
            if farthest <= outer * outer {
                return Some(self);
            }
            let near: Vec<Point> = self.corners.iter().filter(|corner| is_shallow && square(corner) <= outer * outer).copied().collect();
            let far: Vec<Point> = self.corners.iter().filter(|corner| square(corner) >= farthest * (1.0 - SAME)).map(unit).collect();
            let count = self.facets.len();
            for normal in far {
                let next = near.iter().map(|corner| dot(corner, &normal)).fold(inner, f64::max);
                self.add(normal, next);
            }
            // Facets with the normals of all of these are there, and do not bring them in.
            if self.facets.len() == count {
                return None;
            }
        }
        None
    }

    /// Adds a facet, unless there is one with the same normal.
    fn add(&mut self, normal: Point, offset: f64) {
        if !self.facets.iter().any(|own| is_same(own, &normal)) {
            self.facets.push(normal);
            self.offsets.push(offset);
        }
    }

    /// Finds corners, each of which is on three planes or more, and edges: what is left of every plane by the others.
    fn close(&mut self) {
        let Self { facets, offsets, corners, edges } = self;
        corners.clear();
        edges.clear();
        let farthest = offsets.iter().copied().fold(0.0, f64::max);
        let (tiny, far) = (TINY * farthest, WIDE * farthest);
        let is_one = |a: &Point, b: &Point| (0..3).all(|axis| (a[axis] - b[axis]).abs() < tiny);
        for (own, (normal, offset)) in facets.iter().zip(offsets.iter()).enumerate() {
            let [u, v, _] = polytopes::frame(normal);
            // Corners, each with the facet that is across the side after it.
            let corner = |(x, y): (f64, f64)| -> Point { std::array::from_fn(|axis| offset * normal[axis] + x * u[axis] + y * v[axis]) };
            let mut outline: Vec<(Point, usize)> =
                [(far, far), (-far, far), (-far, -far), (far, -far)].map(|at| (corner(at), own)).to_vec();
            for (other, (normal, offset)) in facets.iter().zip(offsets.iter()).enumerate().filter(|(other, _)| *other != own) {
                let above: Vec<f64> = outline.iter().map(|(at, _)| dot(normal, at) - offset).collect();
                if above.iter().all(|&above| above <= tiny) {
                    continue;
                }
                let mut left = Vec::with_capacity(outline.len() + 1);
                for (k, &(at, across)) in outline.iter().enumerate() {
                    let next = (k + 1) % outline.len();
                    let crossing = || between(&at, &outline[next].0, above[k] / (above[k] - above[next]));
                    match (above[k] <= tiny, above[next] <= tiny) {
                        (true, true) => left.push((at, across)),
                        (true, false) => left.extend([(at, across), (if above[k] < -tiny { crossing() } else { at }, other)]),
                        (false, true) => left.push((if above[next] < -tiny { crossing() } else { outline[next].0 }, across)),
                        (false, false) => {}
                    }
                }
                outline = left;
            }
            let count = outline.len();
            outline = (0..count).filter(|&k| !is_one(&outline[k].0, &outline[(k + 1) % count].0)).map(|k| outline[k]).collect();
            for (at, across) in outline {
                if own < across {
                    edges.push([own, across]);
                }
                if !corners.iter().any(|corner| is_one(corner, &at)) {
                    corners.push(at);
                }
            }
        }
    }

    /// How far it reaches along a direction: the largest n . x.
    pub(super) fn reach(&self, normal: &Point) -> f64 {
        self.corners.iter().map(|corner| dot(corner, normal)).fold(0.0, f64::max)
    }

    /// How far its farthest corner is.
    pub(super) fn outer(&self) -> f64 {
        self.corners.iter().map(|corner| dot(corner, corner)).fold(0.0, f64::max).sqrt()
    }

    /// The normals of the sides of its shadow along a direction.
    pub(super) fn sides(&self, direction: &Point) -> impl Iterator<Item = Point> {
        let belt = self.facets.iter().filter(move |normal| dot(normal, direction).abs() < SAME).copied();
        let between = self.edges.iter().filter_map(move |edge| {
            let [a, b] = edge.map(|facet| &self.facets[facet]);
            let (over, under) = (dot(a, direction), dot(b, direction));
            let is_between = over.abs() >= SAME && under.abs() >= SAME && over * under < 0.0;
            is_between.then(|| unit(&std::array::from_fn(|axis| under.abs() * a[axis] + over.abs() * b[axis])))
        });
        belt.chain(between)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::cell::cross;
    use crate::split_mix::Random;

    #[test]
    fn balls_are_between_the_radii() {
        let mut random = Random(5);
        for (round, outer) in [1.7, 1.3, 1.2, 1.178, 1.051, 1.1, 1.04].into_iter().enumerate() {
            let mut any = || unit(&std::array::from_fn(|_| random.share() - 0.5));
            let frame = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let normals: Vec<Point> = if round % 2 == 0 { frame.to_vec() } else { (0..3).map(|_| any()).collect() };
            let both = normals.iter().flat_map(|normal| [*normal, normal.map(|part| -part)]);
            let ball =
                Ball::between([&both.collect::<Vec<Point>>(), &[]], 0.1, [1.0, 1.0 + 0.3 * (outer - 1.0), outer]).expect("few facets");
            assert_eq!(ball.facets.len() + ball.corners.len(), ball.edges.len() + 2);
            for direction in (0..100).map(|_| any()).chain(frame) {
                let reach = ball.reach(&direction);
                assert!((1.0 - 1e-9..=outer).contains(&reach));
                // The shadow is what its sides leave of the plane across the direction.
                let sides: Vec<Point> = ball.sides(&direction).collect();
                assert!(sides.iter().all(|side| dot(side, &direction).abs() < 1e-9));
                let across = unit(&cross(&direction, &sides[0]));
                let corners: Vec<Point> = (0..sides.len())
                    .flat_map(|k| (0..k).map(move |other| (k, other)))
                    .filter_map(|(k, other)| {
                        let pair = [&sides[k], &sides[other], &direction];
                        polytopes::meeting(pair, [ball.reach(pair[0]), ball.reach(pair[1]), 0.0])
                    })
                    .filter(|corner| sides.iter().all(|side| dot(side, corner) <= ball.reach(side) + 1e-9))
                    .collect();
                for step in 0..40 {
                    let (sine, cosine) = (0.157 * f64::from(step)).sin_cos();
                    let way: Point = std::array::from_fn(|axis| cosine * sides[0][axis] + sine * across[axis]);
                    let reach = corners.iter().map(|corner| dot(corner, &way)).fold(0.0, f64::max);
                    assert!((reach - ball.reach(&way)).abs() < 1e-6, "{outer}: {reach} {}", ball.reach(&way));
                }
            }
        }
    }
}
