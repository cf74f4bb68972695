//! A polytope between two balls, whose facets go on smoothly along three axes at right angles.

use super::super::polytopes::meeting;
use crate::attractor::cell::{Point, dot, unit};
use std::f64::consts::FRAC_PI_2;

/// Facets at most.
const MOST_FACETS: usize = 128;
/// Rounds in which corners are cut off at most.
const ROUNDS: usize = 8;
/// What is one place, one plane, or across something, in units of the inner radius.
const SAME: f64 = 1e-9;

/// A convex polytope around the origin.
#[derive(Debug, Default)]
pub(super) struct Ball {
    /// The unit normals of its facets.
    pub(super) facets: Vec<Point>,
    offsets: Vec<f64>,
    corners: Vec<Point>,
    /// Its edges by the facets on both sides.
    edges: Vec<[usize; 2]>,
}

impl Ball {
    /// One around the ball with the inner radius, and within that with the outer one, with few facets; none where that takes too many.
    ///
    /// Across every axis it begins as a prism over a regular polygon with 4 k sides, all of which touch the inner ball. Corners that are too far out are cut off, as far down as the next ones that are not.
    pub(super) fn between(frame: &[Point; 3], inner: f64, outer: f64) -> Option<Self> {
        let least = (1..=MOST_FACETS / 12).find(|&count| inner < outer * (0.5 * FRAC_PI_2 / count as f64).cos())?;
        (least..=MOST_FACETS / 12).find_map(|count| Self::of_prisms(frame, count, inner, outer))
    }

    fn of_prisms(frame: &[Point; 3], count: usize, inner: f64, outer: f64) -> Option<Self> {
        let mut own = Self::default();
        for axis in 0..3 {
            let [u, v] = [(axis + 1) % 3, (axis + 2) % 3].map(|axis| &frame[axis]);
            for step in 0..4 * count {
                let (sine, cosine) = (FRAC_PI_2 * step as f64 / count as f64).sin_cos();
                own.add(std::array::from_fn(|axis| cosine * u[axis] + sine * v[axis]), inner);
            }
        }
        for _ in 0..ROUNDS {
            own.close();
            let (far, near): (Vec<Point>, Vec<Point>) = own.corners.iter().partition(|corner| dot(corner, corner) > outer * outer);
            if far.is_empty() {
                return Some(own);
            }
            for normal in far.iter().map(unit) {
                let next = near.iter().map(|corner| dot(corner, &normal)).fold(inner, f64::max);
                own.add(normal, next);
            }
            if own.facets.len() > MOST_FACETS {
                return None;
            }
        }
        None
    }

    /// Adds a facet, unless there is one with the same normal.
    fn add(&mut self, normal: Point, offset: f64) {
        if self.facets.iter().all(|own| dot(own, &normal) < 1.0 - SAME) {
            self.facets.push(normal);
            self.offsets.push(offset);
        }
    }

    /// Finds corners, each of which is on three planes or more, and edges, both ends of which are on two.
    fn close(&mut self) {
        let Self { facets, offsets, corners, edges } = self;
        corners.clear();
        edges.clear();
        let count = facets.len();
        let spare = SAME * offsets.iter().copied().fold(f64::INFINITY, f64::min);
        let is_same = |a: &Point, b: &Point| (0..3).all(|axis| (a[axis] - b[axis]).abs() < 4.0 * spare);
        for a in 0..count {
            for b in a + 1..count {
                let before = corners.len();
                let mut ends: Vec<Point> = Vec::new();
                for c in (0..count).filter(|&c| c != a && c != b) {
                    let Some(x) = meeting([a, b, c].map(|facet| &facets[facet]), [a, b, c].map(|facet| offsets[facet])) else { continue };
                    let is_inside = facets.iter().zip(offsets.iter()).all(|(normal, offset)| dot(normal, &x) <= offset + spare);
                    if is_inside && !ends.iter().any(|end| is_same(end, &x)) {
                        ends.push(x);
                    }
                }
                if ends.len() > 1 {
                    edges.push([a, b]);
                }
                for end in ends {
                    if !corners[..before].iter().any(|corner| is_same(corner, &end)) {
                        corners.push(end);
                    }
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
        for (round, outer) in [1.7, 1.3, 1.2, 1.178, 1.1, 1.051, 1.03].into_iter().enumerate() {
            let mut any = || unit(&std::array::from_fn(|_| random.share() - 0.5));
            let z = any();
            let x = unit(&cross(&z, &any()));
            let frame = if round % 2 == 0 { [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] } else { [x, cross(&z, &x), z] };
            let ball = Ball::between(&frame, 1.0, outer).expect("few facets");
            println!("{outer}: {} facets {} corners {} edges", ball.facets.len(), ball.corners.len(), ball.edges.len());
            assert_eq!(ball.facets.len() + ball.corners.len(), ball.edges.len() + 2);
            for direction in (0..500).map(|_| any()).chain(frame) {
                let reach = ball.reach(&direction);
                assert!((1.0 - 1e-9..=outer).contains(&reach));
                let sides: Vec<Point> = ball.sides(&direction).collect();
                assert!(sides.len() >= 3 && sides.iter().all(|side| dot(side, &direction).abs() < 1e-9));
                let half = sides.iter().map(|side| side.map(|part| ball.reach(side) * part));
                let sum = half.fold([0.0; 3], |sum: Point, part| std::array::from_fn(|axis| sum[axis] + part[axis]));
                assert!(dot(&sum, &sum) < 0.1, "{sum:?}");
            }
        }
    }
}
