//! The polytopes of figures: what stands for their dilations by a ball.

use super::figure::{Figure, Outline};
use super::form::{Corner, Form, MOST_FACETS, Structure, meeting};
use crate::attractor::cell::{Point, cross, dot, subtract};
use crate::split_mix;
use std::cmp::Ordering;
use std::sync::Arc;

/// A set of a polytope's facets: those that a point is beyond.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Mask([u64; WORDS]);

const WORDS: usize = MOST_FACETS / 64;

impl Mask {
    #[inline]
    pub(super) fn add(&mut self, facet: usize) {
        self.0[facet / 64] |= 1 << (facet % 64);
    }

    #[inline]
    pub(super) fn has(&self, facet: usize) -> bool {
        self.0[facet / 64] >> (facet % 64) & 1 == 1
    }

    #[inline]
    pub(super) fn is_empty(&self) -> bool {
        self.0 == [0; WORDS]
    }

    #[inline]
    pub(super) fn meets(&self, other: &Self) -> bool {
        (0..WORDS).any(|word| self.0[word] & other.0[word] != 0)
    }

    /// The facets of either, in their order.
    #[inline]
    pub(super) fn either(&self, other: &Self) -> impl Iterator<Item = usize> + use<> {
        let words: [u64; WORDS] = std::array::from_fn(|word| self.0[word] | other.0[word]);
        (0..WORDS).flat_map(move |word| {
            let mut rest = words[word];
            std::iter::from_fn(move || {
                let bit = rest.trailing_zeros() as usize;
                (rest != 0).then(|| {
                    rest &= rest - 1;
                    64 * word + bit
                })
            })
        })
    }
}

/// The half-space n . x <= c.
pub(super) type Plane = [f64; 4];

/// How high a point is above a plane.
#[inline]
pub(super) fn height(plane: &Plane, x: &Point) -> f64 {
    plane[0] * x[0] + plane[1] * x[1] + plane[2] * x[2] - plane[3]
}

#[inline]
pub(super) fn normal(plane: &Plane) -> Point {
    [plane[0], plane[1], plane[2]]
}

/// Bits of a facet's number within its polytope, and of an edge's or a vertex's: a simple polytope with f facets has 3 f - 6 edges.
const FACET_BITS: u32 = MOST_FACETS.trailing_zeros();
const EDGE_BITS: u32 = FACET_BITS + 2;
/// Polytopes at most, so that 32 bits number all edges.
pub(super) const MOST_POLYTOPES: usize = 1 << (32 - EDGE_BITS);

/// The number of a polytope's facet among all.
#[inline]
pub(super) fn facet_number(index: u32, facet: usize) -> u32 {
    index << FACET_BITS | facet as u32
}

/// The number of a polytope's edge, or vertex, among all.
#[inline]
pub(super) fn edge_number(index: u32, edge: usize) -> u32 {
    index << EDGE_BITS | edge as u32
}

/// The polytope that has a facet, and the facet's number within it.
#[inline]
pub(super) fn owner(facet: u32) -> (u32, usize) {
    (facet >> FACET_BITS, facet as usize & (MOST_FACETS - 1))
}

/// What stands for the dilation of a figure.
#[derive(Debug)]
pub(super) struct Polytope {
    pub(super) structure: Arc<Structure>,
    pub(super) planes: Box<[Plane]>,
    /// Those that its dilation is cut by, too: see `joints` and `hinges`.
    pub(super) cuts: Box<[Plane]>,
    pub(super) corners: Box<[Point]>,
    /// Its box.
    low: Point,
    high: Point,
}

/// The polytopes of all figures.
#[derive(Debug, Default)]
pub(super) struct Polytopes {
    pub(super) all: Vec<Polytope>,
}

/// The radii of balls around a figure that its polytope lies between.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shell {
    pub(super) inner: f64,
    pub(super) outer: f64,
}

impl Shell {
    /// What a form may reach so that facets can be shifted.
    pub(super) fn reach(self) -> f64 {
        1.0 + (self.outer / self.inner - 1.0) * (1.0 - SHIFT)
    }
}

/// How far beyond its ends a polytope is cut, and how far its corners there may be from them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cut {
    pub(super) beyond: [f64; 2],
    pub(super) most: f64,
}

/// The ends of a point, both the same, or of a segment, in an order that does not depend on how it is stated.
pub(super) fn ordered(figure: &Figure) -> [Point; 2] {
    match figure.outline {
        Outline::Segment([a, b]) if b.partial_cmp(&a) == Some(Ordering::Less) => [b, a],
        Outline::Segment(ends) => ends,
        _ => [figure.corners()[0]; 2],
    }
}

/// Whether the facets of a polytope hang together as its corners say: each of these is deeper than `least` below all planes but its own.
pub(super) fn hang_together(corners: &[Corner], places: &[Point], planes: &[Plane], least: f64) -> bool {
    corners.iter().zip(places).all(|(corner, place)| {
        let mut others = planes.iter().enumerate().filter(|&(facet, _)| !corner.facets.contains(&(facet as u16)));
        others.all(|(_, plane)| height(plane, place) < -least)
    })
}

/// A number in [0, 1) that looks random: the seed's, with an index below 1024.
pub(super) fn share(seed: u64, index: u64) -> f64 {
    split_mix::share(split_mix::number(seed.wrapping_mul(1024).wrapping_add(index)))
}

/// The share of the room between the balls that is left to shift facets.
pub(super) const SHIFT: f64 = 0.08;
/// The share of it by which facets of one polytope differ; all of them have the rest.
pub(super) const OWN_SHIFT: f64 = 0.1;
/// Facets are shifted against each other by this share of the shortest edge at most: the form stays what it is.
const LEAST_EDGE: f64 = 0.1;
/// Shifts that are tried, each a quarter of the one before: where edges are short beside the angle of their facets, the first may be too large.
const SHIFTS: i32 = 4;

impl Polytope {
    /// The polytope of a point or a segment, with a form that lies in its shell; none where facets are too small to be shifted.
    ///
    /// Facets are shifted outwards by numbers that look random, so that no four planes meet in a point but by chance: each polytope as a whole, so that facets
    /// of neighbours which would coincide lie one above the other, and its facets against each other a little. Those where it is cut are as far beyond its ends as is said, and no
    /// corner is farther than `most`.
    pub(super) fn new(figure: &Figure, shape: &Form, shell: Shell, cut: Cut, seed: u64) -> Option<Self> {
        let ends = ordered(figure);
        let frame = frame(&subtract(&ends[1], &ends[0]));
        let flat = |facet: usize| (0..2).find(|&end| shape.flats[end].map(usize::from) == Some(facet));
        let mut room = (shell.outer / shape.reach - shell.inner).max(0.0);
        for end in (0..2).filter(|&end| shape.flats[end].is_some()) {
            room = room.min((cut.most.powi(2) - cut.beyond[end].powi(2)).max(0.0).sqrt() / shape.girth - shell.inner);
        }
        if room < 0.0 {
            return None;
        }
        let share = |index: u64| share(seed, index);
        let all = shell.inner + (1.0 - OWN_SHIFT) * room * share(0);
        let own = (OWN_SHIFT * room).min(LEAST_EDGE * shape.shortest * shell.inner);
        let turned = |x: &Point| -> Point { std::array::from_fn(|axis| (0..3).map(|k| x[k] * frame[k][axis]).sum()) };
        let shifted = |own: f64| {
            let offset = |facet: usize| flat(facet).map_or_else(|| all + own * share(1 + facet as u64), |end| cut.beyond[end]);
            let plane = |(facet, (normal, &end)): (usize, (&Point, &usize))| {
                let normal = turned(normal);
                [normal[0], normal[1], normal[2], offset(facet) + dot(&normal, &ends[end])]
            };
            let planes: Box<[Plane]> = shape.normals.iter().zip(&shape.ends).enumerate().map(plane).collect();
            let corner = |corner: &Corner| {
                let facets = corner.facets.map(usize::from);
                let at = turned(&meeting(facets.map(|facet| &shape.normals[facet]), facets.map(offset))?);
                Some(std::array::from_fn(|axis| ends[corner.end][axis] + at[axis]))
            };
            let corners: Box<[Point]> = shape.structure.corners.iter().map(corner).collect::<Option<_>>()?;
            hang_together(&shape.structure.corners, &corners, &planes, 0.0).then_some((planes, corners))
        };
        let (planes, corners) = (0..SHIFTS).find_map(|number| shifted(own * 0.25_f64.powi(number)))?;
        let cuts = shape.flats.iter().flatten().map(|&facet| planes[usize::from(facet)]).collect();
        Some(Self::with(Arc::clone(&shape.structure), planes, cuts, corners))
    }

    /// One with these facets and corners.
    pub(super) fn with(structure: Arc<Structure>, planes: Box<[Plane]>, cuts: Box<[Plane]>, corners: Box<[Point]>) -> Self {
        let low = std::array::from_fn(|axis| corners.iter().map(|corner| corner[axis]).fold(f64::INFINITY, f64::min));
        let high = std::array::from_fn(|axis| corners.iter().map(|corner| corner[axis]).fold(f64::NEG_INFINITY, f64::max));
        Self { structure, planes, cuts, corners, low, high }
    }

    /// Its box.
    pub(super) fn bounds(&self) -> [Point; 2] {
        [self.low, self.high]
    }

    /// Whether its box meets that of two points.
    #[inline]
    pub(super) fn may_meet(&self, p: &Point, q: &Point) -> bool {
        (0..3).all(|axis| p[axis].max(q[axis]) >= self.low[axis] && p[axis].min(q[axis]) <= self.high[axis])
    }

    /// The facets that a point is beyond.
    #[inline]
    pub(super) fn beyond(&self, x: &Point) -> Mask {
        let mut mask = Mask::default();
        for (facet, plane) in self.planes.iter().enumerate() {
            if height(plane, x) > 0.0 {
                mask.add(facet);
            }
        }
        mask
    }

    #[inline]
    pub(super) fn contains(&self, x: &Point) -> bool {
        self.planes.iter().all(|plane| height(plane, x) <= 0.0)
    }
}

impl Polytopes {
    pub(super) fn count(&self) -> u32 {
        self.all.len() as u32
    }

    #[inline]
    pub(super) fn of(&self, index: u32) -> &Polytope {
        &self.all[index as usize]
    }

    #[inline]
    pub(super) fn structure(&self, index: u32) -> &Structure {
        &self.of(index).structure
    }

    /// The plane of a facet.
    #[inline]
    pub(super) fn plane(&self, facet: u32) -> &Plane {
        let (index, facet) = owner(facet);
        &self.of(index).planes[facet]
    }
}

/// An orthonormal frame whose last vector is along a direction. No plane that a model is likely to have holds another of them.
pub(super) fn frame(direction: &Point) -> [Point; 3] {
    let length = dot(direction, direction).sqrt();
    let z = if length > 0.0 { direction.map(|part| part / length) } else { [0.0, 0.0, 1.0] };
    let axis = (0..3).min_by(|&a, &b| z[a].abs().total_cmp(&z[b].abs())).unwrap_or(0);
    let across = cross(&std::array::from_fn(|other| f64::from(u8::from(other == axis))), &z);
    let length = dot(&across, &across).sqrt();
    let x = across.map(|part| part / length);
    let y = cross(&z, &x);
    let (sine, cosine) = TURN.sin_cos();
    [std::array::from_fn(|k| cosine * x[k] + sine * y[k]), std::array::from_fn(|k| cosine * y[k] - sine * x[k]), z]
}

/// See [`frame`], in radians.
const TURN: f64 = 0.377;
