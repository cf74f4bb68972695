//! The polytopes of figures: what stands for their dilations by a ball.

use super::cells::{Seam, Seams};
use super::covering::Covering;
use super::figure::{Figure, Outline, box_of};
use super::form::{Form, Kind, Spot};
use super::structure::{CutOff, Structure};
use super::tubes::Rod;
use crate::attractor::cell::{Point, between, cross, dot, subtract, unit};
use crate::split_mix;
use std::cmp::Ordering;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Facets at most.
pub(super) const MOST_FACETS: usize = 1024;

/// A set of a polytope's facets.
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

/// The half-space across a unit normal that ends so far beyond a place.
pub(super) fn beyond_place(normal: Point, at: &Point, beyond: f64) -> Plane {
    [normal[0], normal[1], normal[2], dot(&normal, at) + beyond]
}

/// Bits of a facet's number within its polytope, and of an edge's or a corner's: a polytope with f facets has 3 f - 6 edges at most.
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
    /// Of a cell, what it has in common with others: see `cells`.
    pub(super) seams: Option<Box<Seams>>,
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
    /// What a form may reach so that facets, or corners, can be shifted.
    pub(super) fn reach(self) -> f64 {
        1.0 + (self.outer / self.inner - 1.0) * (1.0 - SHIFT)
    }
}

/// How far beyond its ends a polytope is cut, and how far its corners there may be from them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cut {
    pub(super) beyond: [Option<f64>; 2],
    pub(super) most: f64,
}

/// What form stands for a point or a segment; a ball's, which is of no use, for others.
pub(super) fn kind(figure: &Figure) -> Kind {
    let [first, second] = ordered(figure);
    if first == second { Kind::Ball } else { Kind::Rod }
}

/// The ends of a point, both the same, or of a segment, in an order that does not depend on how it is stated.
pub(super) fn ordered(figure: &Figure) -> [Point; 2] {
    match figure.outline {
        Outline::Segment([a, b]) if b.partial_cmp(&a) == Some(Ordering::Less) => [b, a],
        Outline::Segment(ends) => ends,
        _ => [figure.corners()[0]; 2],
    }
}

/// A number in [0, 1) that looks random: the seed's, below 2^54, with an index below 1024.
pub(super) fn share(seed: u64, index: u64) -> f64 {
    split_mix::share(bits(seed, index))
}

fn bits(seed: u64, index: u64) -> u64 {
    split_mix::number(seed.wrapping_mul(1024).wrapping_add(index))
}

/// A way that looks random, of length 1 at most, across a direction.
fn way_across(direction: &Point, bits: u64) -> Point {
    let turned = [split_mix::mix(bits), split_mix::mix(!bits), split_mix::mix(bits.rotate_left(32))];
    let any = turned.map(|bits| split_mix::share(bits) - 0.5);
    let along = dot(&any, direction);
    std::array::from_fn(|axis| any[axis] - along * direction[axis])
}

/// The share of the room between the balls that is left to shift facets, or corners.
pub(super) const SHIFT: f64 = 0.08;
/// The share of it by which facets, or corners, of one polytope differ, at most.
pub(super) const OWN_SHIFT: f64 = 0.1;
/// The share of the rest by which polytopes differ as a whole: all of them are as far out as that allows, and so are chords between their corners.
pub(super) const ALL_SHIFT: f64 = 0.25;
/// Corners are shifted against each other by this share of what is the shortest edge of the polar polytope at most: the form stays what it is.
const LEAST_EDGE: f64 = 0.1;
/// Shifts that are tried, each a quarter of the one before: where two facets nearly lie in a plane, the first may be too large.
const SHIFTS: i32 = 4;

impl Polytope {
    /// The polytope of a point or a segment, with a form that lies in its shell; none where that leaves no room to shift corners.
    ///
    /// Corners are shifted by numbers that look random, so that no four planes, and no edges, of different polytopes meet in a point but by chance: each polytope as a whole outwards, so that facets
    /// of neighbours which would coincide lie one above the other, and its corners against each other a little, out of all planes that forms have in common. Facets where it is cut are as far beyond its ends as is said. Strips of a segment in a tube are the tube's.
    pub(super) fn new(figure: &Figure, form: &Form, shell: Shell, cut: Cut, tube: Option<&Rod>, seed: u64) -> Option<Self> {
        let ends = ordered(figure);
        let frame = tube.map_or_else(|| frame(&subtract(&ends[1], &ends[0])), |rod| rod.frame);
        let is_cut = cut.beyond.map(|beyond| beyond.is_some());
        let (covering, shape) = (&form.covering, form.shape(is_cut));
        // Where there are no caps, it is around the inner ball if its strips are.
        let low = shell.inner * if is_cut == [true; 2] { covering.girth } else { covering.reach };
        let of_ring = |beyond: &f64| (cut.most.powi(2) - beyond.powi(2)).max(0.0).sqrt();
        let room = cut.beyond.iter().flatten().map(of_ring).fold(shell.outer, f64::min) - low;
        if room <= 0.0 {
            return None;
        }
        let share = |index: usize| share(seed, index as u64);
        let all = |room: f64| low + (OWN_SHIFT + (1.0 - 2.0 * OWN_SHIFT) * (1.0 - ALL_SHIFT * share(0))) * room;
        let (all, own) = tube.map_or_else(|| (all(room), covering.own_shift(room, shell)), |rod| (rod.reach, rod.own));
        let turned = |x: &Point| -> Point { std::array::from_fn(|axis| (0..3).map(|k| x[k] * frame[k][axis]).sum()) };
        let belt = if ends[0] == ends[1] { 0 } else { covering.belt };
        let across = |strip: usize| -> Point {
            let (sine, cosine) = (TAU * (strip as f64 + 0.5) / belt as f64).sin_cos();
            [cosine, sine, 0.0]
        };
        let shifted = |own: f64| {
            let of_strip = |strip: usize| tube.map_or_else(|| all / covering.girth + own * share(1 + strip), |rod| rod.strips[strip]);
            // From the end that they are at.
            let corner = |(corner, spot): (usize, &Spot)| {
                let bits = bits(seed, (1 + belt + corner) as u64);
                let shift = own * split_mix::share(bits);
                if corner >= 2 * belt {
                    let direction = &covering.directions[spot.direction];
                    let across = way_across(direction, bits);
                    return Some(turned(&std::array::from_fn(|axis| (all + shift) * direction[axis] + own * across[axis])));
                }
                let (before, after, out) = ((spot.direction + belt - 1) % belt, spot.direction, [-1.0, 1.0][spot.end]);
                let offsets = [of_strip(before), of_strip(after), cut.beyond[spot.end].unwrap_or(shift)];
                Some(turned(&meeting([&across(before), &across(after), &[0.0, 0.0, out]], offsets)?))
            };
            let from_ends: Vec<Point> = shape.corners.iter().enumerate().map(corner).collect::<Option<_>>()?;
            // No corner is farther out than it may be, and so nothing is.
            let farthest = cut.beyond.map(|beyond| if beyond.is_some() { cut.most } else { shell.outer });
            if shape.corners.iter().zip(&from_ends).any(|(spot, from)| dot(from, from) > farthest[spot.end].powi(2)) {
                return None;
            }
            let plane = |facet: usize| {
                let end = shape.ends[facet];
                let is_flat = shape.flats[end] == Some(facet);
                let (normal, offset) = if facet < belt {
                    (turned(&across(facet)), of_strip(facet))
                } else if is_flat {
                    (turned(&[0.0, 0.0, [-1.0, 1.0][end]]), cut.beyond[end]?)
                } else {
                    let [a, b, c] = [0, 1, 2].map(|place| &from_ends[usize::from(shape.facets[facet][place])]);
                    let normal = unit(&cross(&subtract(b, a), &subtract(c, a)));
                    (normal, dot(&normal, a))
                };
                // Within the dilation by the inner radius nothing is cut off but by flats.
                let is_around = is_flat || offset + dot(&normal, &subtract(&ends[end], &ends[1 - end])).min(0.0) >= shell.inner;
                is_around.then(|| [normal[0], normal[1], normal[2], offset + dot(&normal, &ends[end])])
            };
            let planes: Box<[Plane]> = (0..shape.facets.len()).map(plane).collect::<Option<_>>()?;
            let at = |(spot, from): (&Spot, &Point)| std::array::from_fn(|axis| ends[spot.end][axis] + from[axis]);
            let corners: Box<[Point]> = shape.corners.iter().zip(&from_ends).map(at).collect();
            shape.structure.is_convex(&planes, &corners, 0.0).then_some((planes, corners))
        };
        let (planes, corners) = (0..SHIFTS).find_map(|number| shifted(own * 0.25_f64.powi(number)))?;
        let cuts = shape.flats.iter().flatten().map(|&facet| planes[facet]).collect();
        Some(Self::with(Arc::clone(&shape.structure), planes, cuts, corners))
    }

    /// One with these facets and corners.
    pub(super) fn with(structure: Arc<Structure>, planes: Box<[Plane]>, cuts: Box<[Plane]>, corners: Box<[Point]>) -> Self {
        let [low, high] = box_of(&corners);
        Self { structure, planes, cuts, corners, low, high, seams: None }
    }

    /// What is left of it below a plane; none where that is all, or nothing, or where a corner is too near to the plane to tell, or there would be too many facets.
    pub(super) fn below(&self, plane: &Plane, noise: f64) -> Option<Self> {
        let CutOff { structure, facets, corners, made } = self.structure.cut(plane, &self.corners, noise)?;
        if structure.facets > MOST_FACETS {
            return None;
        }
        let planes: Box<[Plane]> = facets.iter().map(|&facet| self.planes[usize::from(facet)]).chain([*plane]).collect();
        let at = |&(ends, share): &([u16; 2], f64)| {
            let [from, to] = ends.map(|corner| &self.corners[usize::from(corner)]);
            between(from, to, share)
        };
        let corners: Box<[Point]> = corners.iter().map(|&corner| self.corners[corner]).chain(made.iter().map(at)).collect();
        structure.is_convex(&planes, &corners, noise).then(|| Self::with(Arc::new(structure), planes, self.cuts.clone(), corners))
    }

    /// Whether its box meets that of two points.
    #[inline]
    pub(super) fn may_meet(&self, p: &Point, q: &Point) -> bool {
        (0..3).all(|axis| p[axis].max(q[axis]) >= self.low[axis] && p[axis].min(q[axis]) <= self.high[axis])
    }
}

impl Covering {
    /// By how much corners, or strips, of a polytope with some room in its shell may differ: corners of the belt do by more than their strips, and the others across their directions, too.
    pub(super) fn own_shift(&self, room: f64, shell: Shell) -> f64 {
        (0.8 / self.girth * OWN_SHIFT * room).min(LEAST_EDGE * self.shortest * shell.inner)
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

    /// Exchanges some for others.
    pub(super) fn exchange(&mut self, others: &mut [(u32, Polytope)]) {
        for (index, other) in others {
            std::mem::swap(other, &mut self.all[*index as usize]);
        }
    }

    /// The name of a corner, and an edge's with its facets: those of other cells' where they have them in common.
    #[inline]
    pub(super) fn corner_name(&self, index: u32, corner: usize) -> u32 {
        self.of(index).seams.as_ref().map_or_else(|| edge_number(index, corner), |seams| seams.corners[corner])
    }

    #[inline]
    pub(super) fn seam(&self, index: u32, edge: usize) -> Seam {
        let own = || {
            let facets = self.structure(index).edges[edge].facets.map(|facet| facet_number(index, usize::from(facet)));
            Seam { name: edge_number(index, edge), facets: Some(facets) }
        };
        self.of(index).seams.as_ref().map_or_else(own, |seams| seams.edges[edge])
    }

    /// Whether two facets are such that cells have in common, of cells that have facets in common.
    pub(super) fn are_inside(&self, facets: [u32; 2]) -> bool {
        let is_inside = |&facet: &u32| {
            let (index, facet) = owner(facet);
            self.of(index).seams.as_ref().is_some_and(|seams| seams.inside.contains(&(facet as u16)))
        };
        let [one, other] = facets.map(|facet| owner(facet).0);
        facets.iter().all(is_inside) && self.joined(one).contains(&other)
    }

    /// The cells that one has facets in common with.
    #[inline]
    pub(super) fn joined(&self, index: u32) -> &[u32] {
        self.of(index).seams.as_ref().map_or(&[], |seams| &seams.beside)
    }

    /// The plane of a facet.
    #[inline]
    pub(super) fn plane(&self, facet: u32) -> &Plane {
        let (index, facet) = owner(facet);
        &self.of(index).planes[facet]
    }
}

/// The point on three planes n . x = c, if there is one to speak of.
pub(super) fn meeting(normals: [&Point; 3], offsets: [f64; 3]) -> Option<Point> {
    let [a, b, c] = normals;
    let dual = [cross(b, c), cross(c, a), cross(a, b)];
    let determinant = dot(a, &dual[0]);
    (determinant.abs() > LEAST_DETERMINANT)
        .then(|| std::array::from_fn(|axis| (0..3).map(|k| offsets[k] * dual[k][axis]).sum::<f64>() / determinant))
}

/// See [`meeting`].
const LEAST_DETERMINANT: f64 = 1e-9;

/// An orthonormal frame whose last vector is along a direction. No plane that a model is likely to have holds another of them.
pub(super) fn frame(direction: &Point) -> [Point; 3] {
    let length = dot(direction, direction).sqrt();
    let z = if length > 0.0 { direction.map(|part| part / length) } else { [0.0, 0.0, 1.0] };
    let axis = (0..3).min_by(|&a, &b| z[a].abs().total_cmp(&z[b].abs())).unwrap_or(0);
    let across = cross(&std::array::from_fn(|other| f64::from(u8::from(other == axis))), &z);
    let x = unit(&across);
    let y = cross(&z, &x);
    let (sine, cosine) = TURN.sin_cos();
    [std::array::from_fn(|k| cosine * x[k] + sine * y[k]), std::array::from_fn(|k| cosine * y[k] - sine * x[k]), z]
}

/// See [`frame`], in radians.
const TURN: f64 = 0.3819;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::cell::{Site, distance_squared};
    use crate::dilation::convex::Convex;
    use crate::dilation::tree::Weighted;
    use crate::split_mix::Random;

    /// Points and segments of all lengths, cut at no end, at one, or at both: polytopes lie between the dilations by both ends of the band, but for what is cut off.
    #[test]
    fn polytopes_lie_within_their_band() {
        let mut random = Random(13);
        for shell in [Shell { inner: 0.9, outer: 1.1 }, Shell { inner: 0.99, outer: 1.01 }, Shell { inner: 0.6, outer: 1.5 }] {
            let forms = [Kind::Ball, Kind::Rod].map(|kind| Form::within(shell.reach(), kind).expect("coarse enough"));
            for round in 0..60 {
                let mut vector = || -> Point { std::array::from_fn(|_| 2.0 * random.share() - 1.0) };
                let (from, way) = (vector().map(|x| 50.0 * x), vector());
                let length = [0.0, 1e-9, 1e-3, 0.3, 1.0, 20.0][round % 6];
                let to = std::array::from_fn(|axis| from[axis] + length * way[axis]);
                let figure: Figure = Weighted { site: Site::Segment([from, to]), deficit: 0.0 }.into();
                let form = &forms[usize::from(kind(&figure) == Kind::Rod)];
                let is_cut = if length == 0.0 { [false; 2] } else { [round / 6 % 2 == 1, round / 12 % 2 == 1] };
                let beyond = is_cut.map(|is_cut| is_cut.then_some(0.02 * (shell.outer - shell.inner)));
                let polytope =
                    Polytope::new(&figure, form, shell, Cut { beyond, most: shell.outer }, None, round as u64).expect("there is room");
                assert_eq!(polytope.cuts.len(), is_cut.iter().filter(|&&is_cut| is_cut).count());
                for corner in &polytope.corners {
                    assert!(distance_squared(corner, &figure.closest(corner)).sqrt() <= shell.outer * (1.0 + 1e-12), "{round}");
                }
                for _ in 0..100 {
                    let along = length * random.share();
                    let on: Point = std::array::from_fn(|axis| from[axis] + along * way[axis]);
                    let direction = unit(&std::array::from_fn(|_| 2.0 * random.share() - 1.0));
                    let x: Point = std::array::from_fn(|axis| on[axis] + shell.inner * direction[axis]);
                    assert!(
                        polytope.planes.iter().all(|plane| height(plane, &x) <= 0.0)
                            || polytope.cuts.iter().any(|cut| height(cut, &x) > 0.0),
                        "{round}: {x:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn seeds_of_all_trials_differ() {
        let seeds = (0..3).flat_map(|trial: u64| (0..3).map(move |engine: u64| (engine << 8 | 7) << 32 | 5 ^ trial << 48));
        let mut shares: Vec<u64> = seeds.map(|seed| share(seed, 3).to_bits()).collect();
        shares.sort_unstable();
        shares.dedup();
        assert_eq!(shares.len(), 9);
    }
}
