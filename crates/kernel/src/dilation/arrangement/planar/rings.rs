//! Polygons with few corners near to a contour: between two distances from the bodies.
//!
//! The contour has gates across it, from the one distance to the other. Edges go as far as they pass all gates on their way (Imai, Iri, "Polygonal approximations of a curve - formulations and algorithms", 1988), and end there at the one of some places from which the next reaches farthest.

use super::Place;
use super::contour::{Contour, Curve};
use super::wires::{Wires, cross, dot, length, minus, plus};
use crate::budget::{Budget, Stopped};

/// Gates along an arc, in units of the angle of the longest chord within the band; beside a segment, in units of the radius, and how many at most.
const ARC_STEP: f64 = 0.25;
const SIDE_STEP: f64 = 0.25;
const MOST_GATES: f64 = 64.0;
/// Places of a gate that edges may end at, as shares of what is seen, from without.
const SHARES: [f64; 3] = [0.0, 0.5, 1.0];
/// Normals at a corner that are parted by more than this cosine have no direction in common; by less than the other one, they are as good as one.
const LEAST_COSINE: f64 = -0.9;
const SMOOTH_COSINE: f64 = 0.45;
/// Half the width of a gate at a crease, in units of the radius.
const NARROW: f64 = 1e-7;

/// The distances between which a polygon may be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Band {
    pub(super) inner: f64,
    pub(super) outer: f64,
}

/// A way across a contour, from without.
#[derive(Clone, Copy, Debug)]
struct Gate {
    outer: Place,
    inner: Place,
}

impl Gate {
    fn at(&self, share: f64) -> Place {
        plus(self.outer, share, minus(self.inner, self.outer))
    }
}

/// A corner of a ring, and the bodies of the crease that it is on, if it is on one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub(super) at: Place,
    pub(super) crease: Option<[u32; 2]>,
}

/// A polygon over the plane, at a height.
pub(super) struct Ring {
    /// 0 for the rim.
    pub(super) level: usize,
    pub(super) height: f64,
    pub(super) corners: Vec<Corner>,
}

/// The gates of a loop. Those at creases are no wider than rounding, and no edge passes them.
#[derive(Default)]
struct Gates {
    all: Vec<Gate>,
    creases: Vec<Option<[u32; 2]>>,
    /// Of every gate, the next that is at a crease, from it on; gates are counted on beyond the last.
    next: Vec<usize>,
}

/// The rings along a contour's loops.
///
/// # Errors
/// [`Stopped`].
pub(super) fn rings(wires: &Wires, contour: &Contour, band: Band, budget: &Budget) -> Result<Vec<Vec<Corner>>, Stopped> {
    let mut gates = Gates::default();
    let ring = |own: &Vec<u32>| {
        gates.fill(wires, contour, band, own, budget)?;
        let corners = Walk { gates: &gates.all, next: &gates.next }.ring();
        Ok(corners.into_iter().map(|(gate, at)| Corner { at, crease: gates.creases[gate] }).collect())
    };
    contour.loops.iter().map(ring).collect()
}

impl Gates {
    /// Makes the gates of a loop.
    fn fill(&mut self, wires: &Wires, contour: &Contour, band: Band, own: &[u32], budget: &Budget) -> Result<(), Stopped> {
        let chord = 2.0 * (band.inner / band.outer).clamp(0.0, 1.0).acos();
        self.all.clear();
        self.creases.clear();
        let piece = |number: usize| &contour.pieces[own[number % own.len()] as usize];
        // The way across at the corner where a piece ends, from which its distance from both sides grows by 1, and whether that is at a crease.
        let corner = |number: usize| -> Option<(Place, Place, bool)> {
            let (before, after) = (piece(number), piece(number + 1));
            let ((_, first), (at, second)) = (contour.place(wires, before, before.to), contour.place(wires, after, after.from));
            let (middle, cosine) = (plus(first, 1.0, second), dot(first, second));
            let is_corner = !before.is_smooth_after() && cosine > LEAST_COSINE;
            is_corner.then(|| (at, middle.map(|part| 2.0 * part / dot(middle, middle)), cosine < SMOOTH_COSINE))
        };
        let mut is_after_corner = corner(own.len() - 1).is_some();
        for number in 0..own.len() {
            if number.is_multiple_of(64) {
                budget.cancel.check()?;
            }
            let after = piece(number + 1);
            let piece = piece(number);
            let body = contour.body(wires, piece);
            let wide = piece.to - piece.from;
            let steps = match piece.curve {
                Curve::Side(_) => (wide / (SIDE_STEP * contour.radius)).ceil().clamp(1.0, MOST_GATES),
                Curve::Arc { .. } => (wide / (ARC_STEP * chord)).ceil().max(1.0),
            } as u32;
            let corner = corner(number);
            for step in u32::from(is_after_corner)..=steps - u32::from(corner.is_some()) {
                let (at, out) = contour.place(wires, piece, piece.from + wide * f64::from(step) / f64::from(steps));
                self.all.push(gate(wires, contour, body, at, out, band));
                self.creases.push(None);
            }
            is_after_corner = corner.is_some();
            if let Some((at, way, is_crease)) = corner {
                let narrow = NARROW * contour.radius;
                let other = contour.body(wires, after);
                self.all.push(if is_crease {
                    Gate { outer: plus(at, narrow, way), inner: plus(at, -narrow, way) }
                } else {
                    gate(wires, contour, body, at, way, band)
                });
                self.creases.push(is_crease.then_some([body.min(other), body.max(other)]));
            }
        }
        let count = self.all.len();
        self.next.clear();
        self.next.resize(count, usize::MAX);
        if let Some(first) = self.creases.iter().position(Option::is_some) {
            let mut next = first + count;
            for gate in (0..count).rev() {
                if self.creases[gate].is_some() {
                    next = gate;
                }
                self.next[gate] = next;
            }
        }
        Ok(())
    }
}

/// The way across at a place, along `way`, which leads away from a body.
fn gate(wires: &Wires, contour: &Contour, body: u32, at: Place, way: Place, band: Band) -> Gate {
    let inner = plus(at, band.inner - contour.radius, way);
    let most = band.outer - contour.radius;
    // Not across a crease, nor, where the way leads along one between arcs, too far.
    let fits = |by: f64| {
        let there = wires.square(body, plus(at, by, way)).sqrt();
        there >= contour.radius + by * (1.0 - 1e-6) && there <= band.outer * (1.0 + 1e-9)
    };
    let by =
        if most > 0.0 { [1.0, 0.8, 0.6, 0.4, 0.2].map(|share| share * most).into_iter().find(|&by| fits(by)).unwrap_or(0.0) } else { most };
    Gate { outer: plus(at, by, way), inner }
}

struct Walk<'a> {
    gates: &'a [Gate],
    next: &'a [usize],
}

/// How far is seen from a place: the last gate, and the shares of it between which it is seen.
#[derive(Clone, Copy, Debug)]
struct Seen {
    gate: usize,
    shares: [f64; 2],
}

impl Walk<'_> {
    fn gate(&self, number: usize) -> &Gate {
        &self.gates[number % self.gates.len()]
    }

    /// The next gate after one that no edge passes.
    fn limit(&self, gate: usize) -> usize {
        let count = self.gates.len();
        let at = (gate + 1) % count;
        self.next[at].saturating_add(gate + 1 - at)
    }

    /// What is seen from a place through the gates after one, as far as another.
    fn look(&self, from: Place, gate: usize, last: usize) -> Option<Seen> {
        let mut seen: Option<Seen> = None;
        let (mut left, mut right) = ([0.0; 2], [0.0; 2]);
        for number in gate + 1..=last.min(self.limit(gate)) {
            let next = self.gate(number);
            let (inner, outer) = (minus(next.inner, from), minus(next.outer, from));
            if cross(outer, inner) <= 0.0 {
                break;
            }
            let mut shares = [0.0, 1.0];
            if seen.is_some() {
                let of = |ray: Place| {
                    let (at_outer, at_inner) = (cross(ray, outer), cross(ray, inner));
                    at_outer / (at_outer - at_inner)
                };
                if cross(right, outer) < 0.0 {
                    shares[0] = of(right);
                }
                if cross(left, inner) > 0.0 {
                    shares[1] = of(left);
                }
                let is_ahead = dot(plus(outer, 1.0, inner), plus(left, 1.0, right)) > 0.0;
                if !(0.0 <= shares[0] && shares[0] < shares[1] && shares[1] <= 1.0 && is_ahead) {
                    break;
                }
            }
            right = plus(outer, shares[0], minus(inner, outer));
            left = plus(outer, shares[1], minus(inner, outer));
            seen = Some(Seen { gate: number, shares });
        }
        seen
    }

    /// Places of what is seen of a gate, a little within its ends.
    fn places(&self, Seen { gate, shares: [from, to] }: &Seen) -> [Place; 3] {
        SHARES.map(|share| self.gate(*gate).at(from + share.clamp(1e-3, 1.0 - 1e-3) * (to - from)))
    }

    /// Where an edge from a place ends best.
    fn step(&self, from: Place, gate: usize, last: usize) -> Option<(usize, Place)> {
        let seen = self.look(from, gate, last)?;
        let reach = |at: &Place| self.look(*at, seen.gate, seen.gate + self.gates.len()).map_or(0, |next| next.gate);
        // The first of those that reach as far.
        let best = self.places(&seen).into_iter().rev().max_by_key(reach)?;
        best.iter().all(|x| x.is_finite()).then_some((seen.gate, best))
    }

    /// The corners of a ring, each on a gate.
    fn ring(&self) -> Vec<(usize, Place)> {
        let count = self.gates.len();
        let start = (0, self.gate(0).at(0.5));
        let first = match self.next[0] {
            usize::MAX => self.step(start.1, start.0, count).map_or(start, |(gate, at)| (gate % count, at)),
            gate => (gate % count, self.gate(gate).at(0.5)),
        };
        let mut corners = vec![first];
        let end = first.0 + count;
        let closes = |from: Place, gate: usize| -> bool {
            self.look(from, gate, end).is_some_and(|seen| {
                let share = dot(minus(first.1, self.gate(end).outer), minus(self.gate(end).inner, self.gate(end).outer))
                    / length(minus(self.gate(end).inner, self.gate(end).outer)).powi(2);
                seen.gate == end && seen.shares[0] <= share && share <= seen.shares[1]
            })
        };
        let (mut gate, mut at) = first;
        while !closes(at, gate) {
            let (reached, place) = self.step(at, gate, end - 1).unwrap_or_else(|| (gate + 1, self.gate(gate + 1).at(0.5)));
            if reached >= end {
                break;
            }
            if reached == end - 1 {
                // The last corner is where the first is seen from.
                let between = (gate + 1..end).rev().find_map(|number| {
                    let seen = self.look(at, gate, number).filter(|seen| seen.gate == number)?;
                    self.places(&seen).into_iter().find(|&place| closes(place, number)).map(|place| (number, place))
                });
                corners.extend(between.or(Some((reached, place))).map(|(number, place)| (number % count, place)));
                break;
            }
            (gate, at) = (reached, place);
            corners.push((gate % count, at));
        }
        if corners.len() < 3 {
            // It goes around something small.
            corners = (0..3).map(|third| third * count / 3).map(|gate| (gate, self.gate(gate).at(0.5))).collect();
        }
        corners.dedup_by_key(|corner| corner.1);
        corners
    }
}
