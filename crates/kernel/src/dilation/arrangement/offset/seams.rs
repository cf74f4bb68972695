//! Sides at which a surface turns much: it is taken apart there, so that what is left turns little, and each part has normals of its own.

use super::coarse::lifted;
use super::skin::{Edge, Sides, Skin};
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract, unit};
use crate::dilation::arrangement::faces::Faces;
use crate::dilation::convex::Convex;
use crate::dilation::surface::NameMap;
use crate::groups::Groups;
use std::collections::{BTreeMap, VecDeque};

/// Steps towards the place that is as far from all parts at a seam.
const STEPS: usize = 4;
/// How far that is from the seam at most, in units of the radius: else parts are too near to each other.
const MOST_FAR: f64 = 4.0;
/// Directions are the same with a cosine of more than this.
const ALIKE: f64 = 0.98;
/// How far from seams it is asked what is hidden, in units of how far it is to a corner; and how much farther out, and nearer by what share of half the band, what parts hide of each other is asked for.
const WIDE: f64 = 2.0;
const FARTHER: f64 = 1.12;
const NEARER: f64 = 0.25;

/// A side that two parts of a surface have: which triangle of each, with the ends as it has them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seam {
    pub(super) ends: [[u32; 2]; 2],
    pub(super) triangles: [u32; 2],
    /// Unit vectors across the side that lead over the triangles.
    pub(super) inwards: [Point; 2],
}

/// A vertex on one side of a surface: whether its normal is on that side.
pub(super) type Corner = (u32, bool);

/// What is on one side of a surface around a place of seams: the corners of the parts there, one after the other. On the border there are two parts.
#[derive(Clone, Debug)]
pub(super) struct Ring {
    pub(super) corners: Vec<Corner>,
    pub(super) is_border: bool,
    /// Whether parts hide what is over others, from seam to seam; else there is room between them.
    pub(super) is_hollow: bool,
}

/// All of a surface.
#[derive(Clone, Debug, Default)]
pub(super) struct Seams {
    pub(super) all: Vec<Seam>,
    /// Of each vertex the first one at its place; none where there are no seams.
    firsts: Vec<u32>,
    /// By the first one, all of them where there are more.
    pub(super) places: BTreeMap<u32, Vec<u32>>,
    /// Rings, and which one a vertex has on a side.
    pub(super) rings: Vec<Ring>,
    pub(super) ring_of: NameMap<Corner, usize>,
}

/// The vertices that must not be left, as other parts hide what is over them: on which sides these are hidden, below and above, and all of them, those first that are close to seams.
pub(super) struct Hidden {
    is_hidden: Vec<[bool; 2]>,
    pub(super) all: Vec<u32>,
}

/// Where the sheets of parts meet that hide each other: by ring, a vector from the seam.
pub(super) type Valleys = Vec<Option<Point>>;

impl Seams {
    /// Takes triangles apart at some sides, given by both: vertices become several.
    pub(super) fn part(
        places: &mut Vec<Point>,
        triangles: &mut [[u32; 3]],
        sharp: &[[Edge; 2]],
        inwards: &[[Point; 2]],
        smooth: &[[Edge; 2]],
    ) -> Self {
        if sharp.is_empty() {
            return Self::default();
        }
        let mut is_split = vec![false; places.len()];
        sharp.iter().flat_map(|edges| edges[0].ends).for_each(|end| is_split[end as usize] = true);
        // Corners of triangles at one vertex belong together where the triangles have a smooth side there.
        let mut groups = Groups::new(3 * triangles.len());
        let corner = |edge: &Edge, end: u32| {
            let own = &triangles[edge.triangle as usize];
            3 * edge.triangle as usize + (0..3).find(|&k| own[k] == end).unwrap_or_default()
        };
        for [one, other] in smooth {
            for end in one.ends {
                if is_split[end as usize] {
                    groups.join(corner(one, end), corner(other, end));
                }
            }
        }
        let groups = groups.all();
        let mut firsts: Vec<u32> = (0..places.len() as u32).collect();
        let mut numbers: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let mut all: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for (triangle, corners) in triangles.iter_mut().enumerate() {
            for (k, corner) in corners.iter_mut().enumerate().filter(|(_, corner)| is_split[**corner as usize]) {
                let first = *corner;
                let copies = all.entry(first).or_default();
                *corner = *numbers.entry((first, groups[3 * triangle + k])).or_insert_with(|| {
                    let number = if copies.is_empty() { first } else { places.len() as u32 };
                    if number != first {
                        places.push(places[first as usize]);
                        firsts.push(first);
                    }
                    copies.push(number);
                    number
                });
            }
        }
        let seam = |(edges, &inwards): (&[Edge; 2], &[Point; 2])| Seam {
            ends: edges.each_ref().map(|edge| edge.of(triangles)),
            triangles: edges.each_ref().map(|edge| edge.triangle),
            inwards,
        };
        let seams = sharp.iter().zip(inwards).map(seam).collect();
        Self { all: seams, firsts, places: all, ..Self::default() }
    }

    /// The first vertex where one is.
    pub(super) fn first(&self, vertex: u32) -> u32 {
        self.firsts.get(vertex as usize).copied().unwrap_or(vertex)
    }

    /// All vertices where one is.
    pub(super) fn copies(&self, vertex: u32) -> Option<&[u32]> {
        self.places.get(&self.first(vertex)).map(Vec::as_slice)
    }

    /// Finds what is around the places of seams on some sides, given normals of triangles and vertices; false where it is not closed, or hollow and not.
    pub(super) fn find_rings(&mut self, normals: &[Point], ups: &[Point], sides: Sides) -> bool {
        let mut next: BTreeMap<Corner, Vec<(Corner, bool)>> = BTreeMap::new();
        for Seam { ends: [own, other], triangles, inwards } in &self.all {
            let [normal, other_normal] = triangles.map(|triangle| &normals[triangle as usize]);
            let is_aligned = self.first(own[0]) != self.first(other[0]);
            let is_hollow = dot(normal, &inwards[1]) > 0.0;
            for k in 0..2 {
                let (a, b) = (own[k], other[if is_aligned { 1 - k } else { k }]);
                let [up, other_up] = [(normal, a), (other_normal, b)].map(|(normal, vertex)| dot(normal, &ups[vertex as usize]) > 0.0);
                for is_above in sides.iter().map(|&side| side > 0.0) {
                    let [one, another] = across([a, b], [up, other_up], is_aligned, is_above);
                    next.entry(one).or_default().push((another, is_hollow == is_above));
                    next.entry(another).or_default().push((one, is_hollow == is_above));
                }
            }
        }
        for (&corner, around) in &next {
            if self.ring_of.contains_key(&corner) {
                continue;
            }
            let (is_hollow, is_border) = (around[0].1, around.len() == 1);
            let (mut corners, mut last, mut here) = (Vec::new(), None, corner);
            loop {
                corners.push(here);
                self.ring_of.insert(here, self.rings.len());
                let ways = &next[&here];
                if ways.len() != 2 - usize::from(is_border) || ways.iter().any(|way| way.1 != is_hollow) {
                    return false;
                }
                let ahead = if last == Some(ways[0].0) { ways[ways.len() - 1].0 } else { ways[0].0 };
                if ahead == corner || (is_border && last.is_some()) {
                    break;
                }
                if self.ring_of.contains_key(&ahead) {
                    return false;
                }
                (last, here) = (Some(here), ahead);
            }
            self.rings.push(Ring { corners, is_border, is_hollow });
        }
        // All parts at a place are in one ring on each side.
        self.rings.iter().all(|ring| self.copies(ring.corners[0].0).is_some_and(|copies| copies.len() == ring.corners.len()))
    }

    /// Where sheets as far out as a radius meet at hollow rings; none where parts there are too near to each other.
    pub(super) fn valleys(&self, skin: &Skin, radius: f64) -> Option<Valleys> {
        let valley = |ring: &Ring| {
            if !ring.is_hollow || ring.corners.len() < 2 {
                return Some(None);
            }
            let at = &skin.places[ring.corners[0].0 as usize];
            let ups: Vec<Point> = ring.corners.iter().map(|&corner| skin.up(corner)).collect();
            let x = moved(at, &ups, &vec![radius; ups.len()])?;
            let way = subtract(&skin.apart(ring, x, radius)?, at);
            (dot(&way, &way) < (MOST_FAR * radius).powi(2)).then_some(Some(way))
        };
        self.rings.iter().map(valley).collect()
    }
}

impl Skin {
    /// The normal of a vertex on a side.
    pub(super) fn up(&self, (vertex, is_up): Corner) -> Point {
        let up = self.ups[vertex as usize];
        if is_up { up } else { up.map(|part| -part) }
    }

    /// The place near to another that is as far as a distance from all parts at a ring; none where they are too near to each other.
    pub(super) fn apart(&self, ring: &Ring, mut x: Point, distance: f64) -> Option<Point> {
        let mut owners: Vec<u32> = ring.corners.iter().map(|(vertex, _)| self.around.at(*vertex)[0]).collect();
        for _ in 0..STEPS {
            let (mut ways, mut lengths) = (Vec::with_capacity(owners.len()), Vec::with_capacity(owners.len()));
            for owner in &mut owners {
                *owner = self.near(*owner, &x);
                let way = subtract(&x, &self.closest(*owner, &x));
                ways.push(unit(&way));
                lengths.push(distance - dot(&way, &way).sqrt());
            }
            // What is as far from the first in the same direction is as far from all.
            if ways.iter().all(|way| dot(way, &ways[0]) > ALIKE) {
                ways.truncate(1);
                lengths.truncate(1);
            }
            x = moved(&x, &ways, &lengths)?;
        }
        Some(x)
    }

    /// What other parts hide, as far out as the radius, from one of the sides. Cost: some microseconds for each vertex near to seams.
    pub(super) fn hidden(&self, valleys: &Valleys, faces: &Faces, radius: f64, half: f64) -> Hidden {
        let mut hidden = Hidden { is_hidden: vec![[false; 2]; self.places.len()], all: Vec::new() };
        let is_near = |x: &Point, least: f64| {
            let mut found = false;
            faces.around(std::slice::from_ref(x), least, |face| {
                found = faces.all[face as usize].distance_squared(x) < least * least;
                !found
            });
            found
        };
        // From all seams at the same time: vertices, from where, and how far away they may be, squared.
        let mut open = VecDeque::new();
        let mut is_seen = vec![false; if self.seams.all.is_empty() { 0 } else { self.places.len() }];
        for (ring, valley) in self.seams.rings.iter().zip(valleys) {
            let Some(valley) = valley else { continue };
            let at = self.places[ring.corners[0].0 as usize];
            let is_hidden = is_near(&lifted(&at, valley, 1.0), radius - NEARER * half);
            for &(vertex, is_up) in &ring.corners {
                is_seen[vertex as usize] = true;
                if is_hidden {
                    hidden.add((vertex, is_up));
                }
                let beside = subtract(valley, &self.up((vertex, is_up)).map(|part| radius * part));
                open.push_back((vertex, at, WIDE * WIDE * dot(&beside, &beside)));
            }
        }
        let far = FARTHER * radius;
        while let Some((here, at, wide)) = open.pop_front() {
            for other in self.around.at(here).iter().flat_map(|&triangle| self.triangles[triangle as usize]) {
                let place = &self.places[other as usize];
                if is_seen[other as usize] || self.seams.copies(other).is_some() || distance_squared(place, &at) > wide {
                    continue;
                }
                is_seen[other as usize] = true;
                for corner in self.sides.iter().map(|&side| (other, side > 0.0)) {
                    if is_near(&lifted(place, &self.up(corner), far), far - NEARER * half) {
                        hidden.add(corner);
                    }
                }
                open.push_back((other, at, wide));
            }
        }
        hidden
    }
}

impl Hidden {
    fn add(&mut self, (vertex, is_up): Corner) {
        if !self.is_so(vertex) {
            self.all.push(vertex);
        }
        self.is_hidden[vertex as usize][usize::from(is_up)] = true;
    }

    /// Whether a vertex is hidden on a side.
    pub(super) fn is_so(&self, vertex: u32) -> bool {
        self.is_hidden[vertex as usize].contains(&true)
    }

    /// Whether one is on this side.
    pub(super) fn is_over(&self, (vertex, is_up): Corner) -> bool {
        self.is_hidden[vertex as usize][usize::from(is_up)]
    }
}

/// The corners of both parts at an end of a seam that are on the side of the first one's triangle where its normal is, or on the other one: given whether the triangles' normals are up there, and whether they are on one side.
pub(super) fn across([one, other]: [u32; 2], [up, other_up]: [bool; 2], is_aligned: bool, is_above: bool) -> [Corner; 2] {
    [(one, up == is_above), (other, (other_up == is_above) == is_aligned)]
}

/// A place moved the least way that leads up to three directions by some lengths; none where these are nearly dependent.
fn moved(x: &Point, ways: &[Point], lengths: &[f64]) -> Option<Point> {
    let by: Point = match (ways, lengths) {
        ([a], [p]) => a.map(|part| p * part),
        ([a, b], [p, q]) => {
            let c = dot(a, b);
            let square = 1.0 - c * c;
            let [s, t] = [(p - c * q) / square, (q - c * p) / square];
            std::array::from_fn(|axis| s * a[axis] + t * b[axis])
        }
        ([a, b, c], [p, q, r]) => {
            let volume = dot(a, &cross(b, c));
            let all = [(cross(b, c), p), (cross(c, a), q), (cross(a, b), r)];
            std::array::from_fn(|axis| all.iter().map(|(way, length)| *length * way[axis]).sum::<f64>() / volume)
        }
        _ => return None,
    };
    by.iter().all(|part| part.is_finite()).then(|| lifted(x, &by, 1.0))
}
