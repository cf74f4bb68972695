//! Where the distance from some bodies is no longer smooth: the lines that are as far from two of them, followed from contour to contour, to where a third one is as close.

use super::rings::Ring;
use super::sheet::Vertex;
use super::wires::{Wires, cross, dot, length, minus, plus};
use super::{Limits, Place};
use crate::budget::{Budget, Stopped};
use crate::dilation::surface::NameMap;

/// Steps of Newton's method.
const STEPS: usize = 12;
/// Steps from one contour to the next.
const STRIDES: usize = 4;
/// Halvings that look for where a third body is as close.
const HALVINGS: usize = 40;
/// Third bodies on the way from one contour to the next at most.
const MOST_JOINTS: usize = 16;
/// What counts as equally far, in units of the distance.
const EQUAL: f64 = 1e-9;

/// How near places are that are one, in units of the band's inner end, and of how many joints before that is asked.
const NEAR: f64 = 1e-5;
const LAST: usize = 64;
/// How far out in the band joints are.
const OUT: f64 = 0.4;
/// Halvings on the way to a crease.
const HALVINGS_ACROSS: usize = 24;

/// Lines along creases, between corners of rings and joints.
#[derive(Default)]
pub(super) struct Lines {
    pub(super) joints: Vec<Vertex>,
    pub(super) all: Vec<[Place; 2]>,
}

impl Lines {
    /// The lines from all rings to those one level below, whose contours are at given distances.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn new(
        wires: &Wires,
        rings: &[Ring],
        distances: &[f64],
        limits: &Limits<impl Fn(f64) -> f64>,
        budget: &Budget,
    ) -> Result<Self, Stopped> {
        let mut lines = Self::default();
        let mut corners: NameMap<[u32; 3], Vec<Place>> = NameMap::default();
        let mut taken: NameMap<[u64; 2], ()> = NameMap::default();
        for (ring, corner) in rings.iter().flat_map(|ring| ring.corners.iter().map(move |corner| (ring, corner))) {
            taken.insert(corner.at.map(f64::to_bits), ());
            if let Some([a, b]) = corner.crease {
                corners.entry([ring.level as u32, a, b]).or_default().push(corner.at);
            }
        }
        let is_like = |a: &Place, b: &Place| length(minus(*a, *b)) < NEAR * limits.inner;
        for (ring, corner) in rings.iter().flat_map(|ring| ring.corners.iter().map(move |corner| (ring, corner))) {
            let (Some(bodies), Some(below)) = (corner.crease, ring.level.checked_sub(1)) else { continue };
            budget.cancel.check()?;
            let mut last = corner.at;
            for stop in wires.follow(Ridge { at: corner.at, distance: distances[ring.level], bodies }, distances[below]) {
                let next = match stop {
                    // What comes from several sides is one place.
                    Stop::Joint(ridge) => {
                        let known = lines.joints.iter().rev().take(LAST).map(|joint| joint.at).find(|other| is_like(other, &ridge.at));
                        known.or_else(|| {
                            let (at, height) = (ridge.at.map(&limits.round), limits.over(ridge.distance, OUT)?);
                            taken.insert(at.map(f64::to_bits), ()).is_none().then(|| {
                                lines.joints.push(Vertex { at, height });
                                at
                            })
                        })
                    }
                    Stop::End(Ridge { at, bodies: [a, b], .. }) => {
                        let all = corners.get(&[below as u32, a.min(b), a.max(b)]);
                        all.and_then(|all| all.iter().copied().find(|other| is_like(other, &at)))
                    }
                };
                let Some(next) = next else { break };
                lines.all.push([last, next]);
                last = next;
            }
        }
        Ok(lines)
    }
}

/// A place as far from two bodies.
#[derive(Clone, Copy, Debug)]
struct Ridge {
    at: Place,
    distance: f64,
    bodies: [u32; 2],
}

/// A place on the way.
#[derive(Clone, Copy, Debug)]
enum Stop {
    /// A third body is as close, or nothing is farther anywhere near.
    Joint(Ridge),
    /// The end of the way.
    End(Ridge),
}

impl Wires {
    /// How far a place is from a body, and the unit vector away from it.
    fn off(&self, body: u32, x: Place) -> (f64, Place) {
        let way = minus(x, self.bodies[body as usize].closest(x));
        let far = length(way);
        (far, way.map(|part| part / far))
    }

    /// The place near x as far from two bodies as a distance.
    fn equal(&self, bodies: [u32; 2], mut x: Place, distance: f64) -> Option<Place> {
        for _ in 0..STEPS {
            let [(a, u), (b, v)] = bodies.map(|body| self.off(body, x));
            let (e, f) = (distance - a, distance - b);
            if e.abs().max(f.abs()) < 1e-2 * EQUAL * distance {
                return Some(x);
            }
            let determinant = cross(u, v);
            let by = [(e * v[1] - f * u[1]) / determinant, (u[0] * f - v[0] * e) / determinant];
            // They may be parallel there.
            if !length(by).is_finite() || length(by) > distance {
                return None;
            }
            x = plus(x, 1.0, by);
        }
        None
    }

    /// The body that is closest to a place of those near to one, but for two.
    fn third(&self, bodies: [u32; 2], x: Place) -> (f64, u32) {
        let distance = self.bodies[bodies[0] as usize].square(x).sqrt();
        let others = self.near(bodies[0], 2.0 * distance).filter(|&other| other != bodies[1]);
        others
            .map(|other| (self.bodies[other as usize].square(x), other))
            .fold((f64::INFINITY, u32::MAX), |best, own| if own.0 < best.0 { own } else { best })
    }

    /// The place on the way on from the body closest to a place where another body is as close, if that is so within a distance from it.
    pub(super) fn crease(&self, at: Place, most: f64) -> Option<Place> {
        let (distance, away) = self.away(at)?;
        let (mut low, mut high) = (0.0, most - distance);
        let is_first = |by: f64| self.away(plus(at, by, away)).is_some_and(|(there, _)| there >= distance + by - EQUAL * most);
        if high <= 0.0 || is_first(high) {
            return None;
        }
        for _ in 0..HALVINGS_ACROSS {
            let middle = 0.5 * (low + high);
            if is_first(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(plus(at, low, away))
    }

    /// Follows a line away from its bodies to a distance: the places where others are as close, and its end there, if it gets there without parting.
    fn follow(&self, mut ridge: Ridge, to: f64) -> Vec<Stop> {
        let mut stops = Vec::new();
        let mut left = None;
        for _ in 0..MOST_JOINTS {
            let Some((next, met)) = self.advance(&ridge, to, left) else { return stops };
            let Some(third) = met else {
                stops.push(Stop::End(next));
                return stops;
            };
            stops.push(Stop::Joint(next));
            // Of the lines that begin there, the one on which the distance grows.
            let [a, b] = ridge.bodies;
            let rises = |pair: [u32; 2], other: u32| {
                let [(_, u), (_, v), (_, w)] = [pair[0], pair[1], other].map(|body| self.off(body, next.at));
                let way = plus(u, 1.0, v);
                dot(way, u) > 0.0 && dot(way, w) > dot(way, u)
            };
            let onward: Vec<([u32; 2], u32)> =
                [([a, third], b), ([third, b], a)].into_iter().filter(|&(pair, other)| rises(pair, other)).collect();
            let &[(bodies, other)] = &onward[..] else { return stops };
            ridge = Ridge { bodies, ..next };
            left = Some(other);
        }
        stops
    }

    /// The next place where a third body is as close, or the end of the way; the body that was left last does not count at once.
    fn advance(&self, from: &Ridge, to: f64, left: Option<u32>) -> Option<(Ridge, Option<u32>)> {
        let bodies = from.bodies;
        let (mut low, mut at) = (from.distance, from.at);
        for stride in 1..=STRIDES {
            let distance = from.distance + (to - from.distance) * stride as f64 / STRIDES as f64;
            let Some(x) = self.equal(bodies, at, distance) else {
                // It ends where it goes no farther out.
                return None;
            };
            let (square, third) = self.third(bodies, x);
            if square.sqrt() < distance * (1.0 - EQUAL) {
                // Some body gets close on the way: the first of them.
                let (mut high, mut met) = (distance, third);
                for _ in 0..HALVINGS {
                    let middle = 0.5 * (low + high);
                    let x = self.equal(bodies, at, middle)?;
                    let (square, third) = self.third(bodies, x);
                    if square.sqrt() < middle * (1.0 - EQUAL) && !(left == Some(third) && middle - from.distance < EQUAL * middle) {
                        (high, met) = (middle, third);
                    } else {
                        (low, at) = (middle, x);
                    }
                }
                return Some((Ridge { at, distance: low, bodies }, Some(met)));
            }
            (low, at) = (distance, x);
        }
        Some((Ridge { at, distance: to, bodies }, None))
    }
}
