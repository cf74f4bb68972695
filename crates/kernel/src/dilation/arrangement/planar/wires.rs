//! Points and segments in a plane, as a graph: what is next around its vertices, and which of it is near to each other.

use super::super::between;
use super::Place;
use super::contour::STRAIGHT;
use crate::attractor::cell::Point;
use crate::budget::{Budget, Stopped};
use crate::dilation::convex::Convex;
use crate::dilation::surface::NameMap;
use crate::groups::Groups;
use crate::solid::box_tree::{Box32, BoxTree};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Bodies near to each other at least, as a mean over all: where there are fewer, polytopes around them have fewer triangles.
const LEAST_NEAR: f64 = 3.0;
/// Bodies near to each other at most, as a mean over all: segments, and points, of which most are covered by a few others; and in any case.
const MOST_NEAR: usize = 200;
const MOST_NEAR_TO_POINTS: usize = 1_000;
const FEW_NEAR: usize = 100_000;
/// One of so many bytes may hold an entry of a list.
const BYTES_PER_NEAR: u64 = 64;
/// Near to one of them at most: what is asked of a body grows with the square.
const MOST_OF_ONE: usize = 4_096;
/// Places that are close to each other along an axis, of those that one is held against.
const MOST_CLOSE: usize = 64;
/// No number.
pub(super) const NONE: u32 = u32::MAX;

/// A segment, or a point that no segment has for an end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    pub(super) ends: [u32; 2],
    /// Where the first end is.
    pub(super) from: Place,
    /// The unit vector to the second, and how far it is; 0 of a point.
    pub(super) along: Place,
    pub(super) length: f64,
}

/// The graph. Half-edge 2 e goes along segment e, half-edge 2 e + 1 back; on its right is the outside of the contour that follows it.
pub(super) struct Wires {
    pub(super) places: Vec<Place>,
    /// Segments, then points.
    pub(super) bodies: Vec<Body>,
    pub(super) segments: usize,
    /// Of every half-edge, the one that begins where it ends, the next counter-clockwise from its way back, and by how much the contour turns left from one to the other: within -pi and pi.
    pub(super) next: Vec<u32>,
    pub(super) turns: Vec<f64>,
    /// Of every vertex, the half-edge that ends there before the contour turns left by more than the least turn; there is one at most.
    pub(super) convex: Vec<u32>,
    /// Of every vertex, a body that has it.
    pub(super) owner: Vec<u32>,
    /// Of every body those that are near, the nearest first, with how far they are or less, and where the lists begin.
    near: Vec<(f32, u32)>,
    starts: Vec<u32>,
    /// The boxes of what is within half the reach of each body.
    pub(super) tree: BoxTree,
}

#[inline]
pub(super) fn dot(a: Place, b: Place) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

#[inline]
pub(super) fn cross(a: Place, b: Place) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

#[inline]
pub(super) fn minus(a: Place, b: Place) -> Place {
    [a[0] - b[0], a[1] - b[1]]
}

/// a + s b.
#[inline]
pub(super) fn plus(a: Place, s: f64, b: Place) -> Place {
    [a[0] + s * b[0], a[1] + s * b[1]]
}

#[inline]
pub(super) fn length(a: Place) -> f64 {
    dot(a, a).sqrt()
}

/// Segments by the numbers of their ends, with places closer than a margin as one, and parted where they pass other ends within two: what is moved is so by three margins at most. None where such places are a chain, or very many.
fn parted(places: &[Place], pairs: Vec<[u32; 2]>, margin: f64, budget: &Budget) -> Result<Option<Vec<[u32; 2]>>, Stopped> {
    // Along the first axis.
    let mut order: Vec<u32> = (0..places.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| places[a as usize][0].total_cmp(&places[b as usize][0]).then(a.cmp(&b)));
    let mut groups = Groups::new(places.len());
    for (rank, &first) in order.iter().enumerate() {
        let own = places[first as usize];
        let near = order[rank + 1..].iter().take(MOST_CLOSE).take_while(|&&other| places[other as usize][0] <= own[0] + margin);
        for &other in near {
            if length(minus(places[other as usize], own)) <= margin {
                groups.join(first as usize, other as usize);
            }
        }
    }
    let is_far = |vertex: usize, groups: &mut Groups| length(minus(places[groups.of(vertex) as usize], places[vertex])) > margin;
    if (0..places.len()).any(|vertex| is_far(vertex, &mut groups)) {
        return Ok(None);
    }
    let pairs: Vec<[u32; 2]> = pairs.iter().map(|pair| pair.map(|end| groups.of(end as usize))).collect();
    let bodies: Vec<Body> = pairs.iter().map(|&pair| Body::new(pair, places)).collect();
    let mut tree = BoxTree::default();
    tree.build(bodies.len(), |index| Some(bodies[index as usize].box_within(2.0 * margin)), false);
    let mut stops: Vec<(u32, f64, u32)> = Vec::new();
    for vertex in (0..places.len() as u32).filter(|&vertex| groups.of(vertex as usize) == vertex) {
        if vertex.is_multiple_of(256) {
            budget.cancel.check()?;
        }
        let own = places[vertex as usize];
        tree.query(&Box32::of(&[[own[0], own[1], 0.0]]), 0, |leaf| {
            for &item in tree.items(leaf) {
                let body = &bodies[item as usize];
                if !body.ends.contains(&vertex) && body.square(own) <= 4.0 * margin * margin {
                    stops.push((item, dot(minus(own, body.from), body.along), vertex));
                }
            }
            stops.len() <= MOST_NEAR * bodies.len()
        });
    }
    if stops.len() > MOST_NEAR * bodies.len() {
        return Ok(None);
    }
    stops.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
    let mut parts = Vec::with_capacity(pairs.len() + stops.len());
    let mut rest = &stops[..];
    for (item, &[from, to]) in (0..).zip(&pairs) {
        let (own, later) = rest.split_at(rest.partition_point(|stop| stop.0 <= item));
        rest = later;
        let mut last = from;
        for &(_, _, vertex) in own {
            parts.push([last, vertex]);
            last = vertex;
        }
        parts.push([last, to]);
    }
    Ok(Some(parts))
}

impl Body {
    fn new(ends: [u32; 2], places: &[Place]) -> Self {
        let [from, to] = ends.map(|end| places[end as usize]);
        let way = minus(to, from);
        let length = length(way);
        let along = if length > 0.0 { way.map(|x| x / length) } else { [0.0; 2] };
        Self { ends, from, along, length }
    }

    /// The place of the body that is closest to x.
    #[inline]
    pub(super) fn closest(&self, x: Place) -> Place {
        let at = dot(minus(x, self.from), self.along).clamp(0.0, self.length);
        plus(self.from, at, self.along)
    }

    /// The squared distance of x.
    #[inline]
    pub(super) fn square(&self, x: Place) -> f64 {
        let way = minus(x, self.closest(x));
        dot(way, way)
    }

    /// Where its second end is.
    pub(super) fn to(&self) -> Place {
        plus(self.from, self.length, self.along)
    }

    /// Whether it has an end in common with another.
    #[inline]
    pub(super) fn is_joined(&self, other: &Self) -> bool {
        self.ends.iter().any(|end| other.ends.contains(end))
    }

    /// Whether two segments cross.
    fn crosses(&self, other: &Self) -> bool {
        let side = |body: &Self, x: Place| cross(body.along, minus(x, body.from));
        side(self, other.from) * side(self, other.to()) < 0.0 && side(other, self.from) * side(other, self.to()) < 0.0
    }

    /// The square of how far two bodies are apart, and of how far an end of one is from the other.
    fn squares(&self, other: &Self) -> [f64; 2] {
        let of_ends = [self.square(other.from), self.square(other.to()), other.square(self.from), other.square(self.to())];
        let least = of_ends.into_iter().fold(f64::INFINITY, f64::min);
        [if self.crosses(other) { 0.0 } else { least }, least]
    }

    fn box_within(&self, distance: f64) -> Box32 {
        let at = |x: Place, by: f64| -> Point { [x[0] + by, x[1] + by, 0.0] };
        let (from, to) = (self.from, self.to());
        Box32::of(&[at(from, -distance), at(from, distance), at(to, -distance), at(to, distance)])
    }
}

impl Convex for Body {
    fn deficit(&self) -> f64 {
        0.0
    }

    #[inline]
    fn closest(&self, x: &Point) -> Point {
        let [x, y] = self.closest([x[0], x[1]]);
        [x, y, 0.0]
    }

    #[inline]
    fn highest(&self, direction: &Point) -> f64 {
        let across = [direction[0], direction[1]];
        dot(across, self.from) + (self.length * dot(across, self.along)).max(0.0)
    }
}

impl between::Body for Body {
    fn corners(&self) -> impl AsRef<[Point]> {
        [self.from, self.to()].map(|[x, y]| [x, y, 0.0])
    }
}

impl Wires {
    /// The graph of segments with their ends, and points as segments without a length; what is within `reach` of each other is near. What is about as close as `margin` is moved, by three of these at most, so that it has ends in common. None where it still does not, or where very much is near.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn new(segments: &[[Place; 2]], reach: f64, margin: f64, budget: &Budget) -> Result<Option<Self>, Stopped> {
        let mut places: Vec<Place> = Vec::with_capacity(2 * segments.len());
        let mut numbers: NameMap<[u64; 2], u32> = NameMap::default();
        let mut number = |at: Place| {
            *numbers.entry(at.map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
                places.push(at);
                places.len() as u32 - 1
            })
        };
        let pairs: Vec<[u32; 2]> = segments.iter().map(|ends| ends.map(&mut number)).collect();
        let Some(mut pairs) = parted(&places, pairs, margin, budget)? else { return Ok(None) };
        pairs.iter_mut().for_each(|pair| pair.sort_unstable());
        pairs.sort_unstable();
        pairs.dedup();
        let mut owner = vec![NONE; places.len()];
        let mut is_used = vec![false; places.len()];
        pairs.iter().flatten().for_each(|&end| is_used[end as usize] = true);
        let mut bodies: Vec<Body> = Vec::with_capacity(pairs.len());
        for pair in pairs.iter().filter(|pair| pair[0] != pair[1]) {
            pair.iter().for_each(|&end| owner[end as usize] = bodies.len() as u32);
            bodies.push(Body::new(*pair, &places));
        }
        let segments = bodies.len();
        for end in 0..places.len() as u32 {
            if owner[end as usize] == NONE && is_used[end as usize] {
                owner[end as usize] = bodies.len() as u32;
                bodies.push(Body::new([end; 2], &places));
            }
        }
        let none = || vec![NONE; 2 * segments];
        let mut wires = Self {
            convex: vec![NONE; places.len()],
            places,
            bodies,
            segments,
            next: none(),
            turns: vec![0.0; 2 * segments],
            owner,
            near: Vec::new(),
            starts: Vec::new(),
            tree: BoxTree::default(),
        };
        let is_plain = wires.turn() && wires.find_near(reach, margin, budget)?;
        Ok(is_plain.then_some(wires))
    }

    /// The half-edge along which a half-edge's segment goes, its direction and its right.
    #[inline]
    pub(super) fn way(&self, half: u32) -> (Place, Place) {
        let body = &self.bodies[(half / 2) as usize];
        let along = if half.is_multiple_of(2) { body.along } else { body.along.map(|x| -x) };
        (along, [along[1], -along[0]])
    }

    /// Where a half-edge begins and ends.
    #[inline]
    pub(super) fn ends(&self, half: u32) -> [u32; 2] {
        let [from, to] = self.bodies[(half / 2) as usize].ends;
        if half.is_multiple_of(2) { [from, to] } else { [to, from] }
    }

    /// Whether many bodies are near to each other.
    pub(super) fn are_crowded(&self) -> bool {
        self.near.len() as f64 > LEAST_NEAR * self.bodies.len() as f64
    }

    /// The bodies near to a body, the nearest first, as far as a distance.
    #[inline]
    pub(super) fn near(&self, body: u32, distance: f64) -> impl Iterator<Item = u32> {
        let all = &self.near[self.starts[body as usize] as usize..self.starts[body as usize + 1] as usize];
        all.iter().take_while(move |(far, _)| f64::from(*far) <= distance).map(|&(_, other)| other)
    }

    /// The square of how far a place is from the bodies that are near to one, or from itself.
    pub(super) fn square(&self, body: u32, x: Place) -> f64 {
        let own = self.bodies[body as usize].square(x);
        // What is closer to x is no farther from the body than that and itself.
        self.near(body, 2.0 * own.sqrt()).map(|other| self.bodies[other as usize].square(x)).fold(own, f64::min)
    }

    /// The body closest to a place, and the way from that, where one is within half the reach.
    pub(super) fn closest(&self, at: Place) -> Option<(u32, Place)> {
        let within = Box32::of(&[[at[0], at[1], 0.0]]);
        let (mut least, mut closest) = (f64::INFINITY, None);
        self.tree.query(&within, 0, |leaf| {
            for &item in self.tree.items(leaf) {
                let way = minus(at, self.bodies[item as usize].closest(at));
                let square = dot(way, way);
                if square < least {
                    (least, closest) = (square, Some((item, way)));
                }
            }
            true
        });
        closest
    }

    /// How far a place is from the body closest to it, and the unit vector away from that, likewise.
    pub(super) fn away(&self, at: Place) -> Option<(f64, Place)> {
        let (_, way) = self.closest(at)?;
        let distance = length(way);
        (distance > 0.0).then(|| (distance, way.map(|part| part / distance)))
    }

    /// Finds what is next around vertices; false where segments lie on each other.
    fn turn(&mut self) -> bool {
        let mut around: Vec<(u32, f64, u32)> = (0..2 * self.segments as u32)
            .map(|half| {
                let (along, _) = self.way(half);
                (self.ends(half)[0], along[1].atan2(along[0]), half)
            })
            .collect();
        around.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        for own in around.chunk_by(|a, b| a.0 == b.0) {
            for (place, &(vertex, angle, half)) in own.iter().enumerate() {
                let (_, after, next) = own[(place + 1) % own.len()];
                let wide = if own.len() == 1 { TAU } else { (after - angle).rem_euclid(TAU) };
                if wide < STRAIGHT || (own.len() > 1 && wide > TAU - STRAIGHT) {
                    return false;
                }
                let back = half ^ 1;
                (self.next[back as usize], self.turns[back as usize]) = (next, wide - PI);
                if wide - PI > STRAIGHT {
                    self.convex[vertex as usize] = back;
                }
            }
        }
        true
    }

    fn find_near(&mut self, reach: f64, margin: f64, budget: &Budget) -> Result<bool, Stopped> {
        let bodies = &self.bodies;
        let mut tree = BoxTree::default();
        tree.build(bodies.len(), |index| Some(bodies[index as usize].box_within(0.5 * reach)), false);
        let of = |index: usize| -> Result<Option<Vec<(f32, u32)>>, Stopped> {
            if index.is_multiple_of(64) {
                budget.cancel.check()?;
            }
            let (own, mut found, mut is_plain) = (&bodies[index], Vec::new(), true);
            let within = own.box_within(0.5 * reach);
            tree.query(&within, 0, |leaf| {
                for (&item, theirs) in tree.items(leaf).iter().zip(tree.boxes(leaf)) {
                    if item as usize == index || !within.meets(theirs) {
                        continue;
                    }
                    let other = &bodies[item as usize];
                    let [square, of_ends] = own.squares(other);
                    is_plain &= of_ends > 0.25 * margin * margin || own.is_joined(other);
                    if square < reach * reach {
                        found.push(((square.sqrt() as f32).next_down(), item));
                    }
                }
                is_plain && found.len() <= MOST_OF_ONE
            });
            is_plain &= found.len() <= MOST_OF_ONE;
            found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            Ok(is_plain.then_some(found))
        };
        let each = if self.segments == 0 { MOST_NEAR_TO_POINTS } else { MOST_NEAR };
        let room = usize::try_from(budget.limits.memory_bytes / BYTES_PER_NEAR).unwrap_or(usize::MAX);
        let most = (each * bodies.len() + FEW_NEAR).min(room).min(u32::MAX as usize);
        let (mut near, mut starts): (Vec<(f32, u32)>, Vec<u32>) = (Vec::new(), vec![0]);
        let numbers: Vec<usize> = (0..bodies.len()).collect();
        for some in numbers.chunks(1 << 12) {
            for list in some.par_iter().map(|&index| of(index)).collect::<Result<Vec<_>, Stopped>>()? {
                let Some(list) = list else { return Ok(false) };
                near.extend(list);
                starts.push(near.len() as u32);
            }
            if near.len() > most {
                return Ok(false);
            }
        }
        (self.near, self.starts, self.tree) = (near, starts, tree);
        Ok(true)
    }
}
