//! Polytopes that stand for a ball.

use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

/// Facets at most: as many as a [`super::polytopes::Mask`] has bits.
pub(super) const MOST_FACETS: usize = 512;

/// A simple polytope around the unit ball, whose facets touch it, and symmetric about the plane across its axis, z, unless it is cut. Facets along the axis form its belt, and come first; so the
/// sum with a segment along the axis has the same facets, edges and vertices.
#[derive(Debug)]
pub(super) struct Form {
    /// Unit normals of the facets.
    pub(super) normals: Vec<Point>,
    /// Which end of a segment a facet is at: the second for those above the belt, the first for the others.
    pub(super) ends: Vec<usize>,
    pub(super) structure: Arc<Structure>,
    /// The distance of the farthest vertex.
    pub(super) reach: f64,
    /// The length of the shortest edge.
    pub(super) shortest: f64,
    /// How far the belt's edges are from the axis.
    pub(super) girth: f64,
    /// The facets across the axis, at the ends where it is cut.
    pub(super) flats: [Option<u16>; 2],
}

/// How the facets of a simple polytope hang together.
#[derive(Debug)]
pub(super) struct Structure {
    pub(super) facets: usize,
    pub(super) corners: Vec<Corner>,
    pub(super) edges: Vec<Edge>,
}

impl Structure {
    /// That of a polytope with these facets and corners, given where the corners are.
    pub(super) fn new(normals: &[Point], corners: Vec<Corner>, places: &[Point]) -> Self {
        let edges = edges(normals, &corners, places);
        Self { facets: normals.len(), corners, edges }
    }

    /// Whether it holds to Euler's formula, for a simple polytope: nothing is missing.
    pub(super) fn is_whole(&self) -> bool {
        let Self { facets, corners, edges } = self;
        2 * edges.len() == 3 * corners.len() && corners.len() + facets == edges.len() + 2
    }
}

/// A vertex.
#[derive(Debug)]
pub(super) struct Corner {
    /// The facets that meet there.
    pub(super) facets: [u16; 3],
    /// The end of a segment that it is at.
    pub(super) end: usize,
}

/// An edge.
#[derive(Debug)]
pub(super) struct Edge {
    /// From the first vertex to the second,
    pub(super) corners: [u16; 2],
    /// counter-clockwise on the first facet seen from outside, clockwise on the second.
    pub(super) facets: [u16; 2],
}

/// Facets, times 1 - 1 / reach, of the best polytopes with many (Fejes Toth, 1953): their caps cover a sphere 1.21 times.
const FEWEST: f64 = 2.42;
/// Rows above the belt, beyond a sixth of its facets, facets in them as shares of the belt's density, and how far each is turned from the one below it, in its facets, that are tried.
const ROWS: usize = 6;
const DENSITIES: [f64; 10] = [0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0, 1.05, 1.1, 1.15];
const TURNS: [f64; 2] = [0.5, 0.38];
/// Rounding of unit vectors, far below any edge.
const ROUNDING: f64 = 1e-9;
/// A hole is seen where the farthest facet is by this more than it may be, in its cosine: far above rounding.
const SEEN: f64 = 1e-7;
/// What [`ROUNDING`] makes of the cosine of an angle between facets, at most, with room to spare.
const AROUND: f64 = 1e-6;

impl Form {
    /// The one with the fewest facets, of those that are tried, that lies within the ball with radius `most`.
    pub(super) fn within(most: f64) -> Option<Self> {
        let least = (PI / (1.0 / most).acos()).ceil().max(4.0) as usize;
        let fewest = (FEWEST / (1.0 - 1.0 / most)) as usize;
        let mut patterns: Vec<(usize, Pattern)> = Pattern::all(least).map(|pattern| (pattern.facets(), pattern)).collect();
        patterns.retain(|(facets, _)| (fewest..=MOST_FACETS).contains(facets));
        // The belt's facets along a segment are crossed by more others.
        patterns.sort_by_key(|&(facets, pattern)| facets + 2 * pattern.belt);
        patterns.iter().find_map(|(_, pattern)| Self::new(pattern, most))
    }

    /// The polytope with a pattern of facets, if it is simple, has no vertex on the plane across the axis, and lies within `most`.
    fn new(pattern: &Pattern, most: f64) -> Option<Self> {
        let (normals, ends) = pattern.normals();
        if pattern.leaves_a_hole(&normals, most) {
            return None;
        }
        let count = normals.len();
        // Facets that meet in a vertex within `most` are no farther from each other than this.
        let widest = 2.0 / (most * most) - 1.0 - ROUNDING;
        let (mut places, mut corners) = (Vec::new(), Vec::new());
        for a in 0..count {
            let near: Vec<usize> = (a + 1..count).filter(|&b| dot(&normals[a], &normals[b]) > widest).collect();
            // Whatever reaches a vertex of the facet within `most`, rounding included, is among these.
            let around: Vec<&Point> = normals.iter().filter(|normal| dot(&normals[a], normal) > widest - AROUND).collect();
            for (place, &b) in near.iter().enumerate() {
                for &c in &near[place + 1..] {
                    let vertex = meeting([&normals[a], &normals[b], &normals[c]], [1.0; 3]);
                    let Some(vertex) = vertex else { continue };
                    if around.iter().any(|normal| dot(normal, &vertex) > 1.0 + ROUNDING) {
                        continue;
                    }
                    if dot(&vertex, &vertex) > most * most {
                        if normals.iter().any(|normal| dot(normal, &vertex) > 1.0 + ROUNDING) {
                            continue;
                        }
                        return None;
                    }
                    let on = around.iter().filter(|normal| dot(normal, &vertex) > 1.0 - ROUNDING).count();
                    if on != 3 || vertex[2].abs() < ROUNDING.sqrt() {
                        return None;
                    }
                    corners.push(Corner { facets: [a, b, c].map(|facet| facet as u16), end: usize::from(vertex[2] > 0.0) });
                    places.push(vertex);
                }
            }
        }
        let structure = Structure::new(&normals, corners, &places);
        if !structure.is_whole() {
            return None;
        }
        let reach = places.iter().map(|place| dot(place, place).sqrt()).fold(0.0, f64::max) * (1.0 + ROUNDING);
        let length = |edge: &Edge| distance_squared(&places[usize::from(edge.corners[0])], &places[usize::from(edge.corners[1])]).sqrt();
        let shortest = structure.edges.iter().map(length).fold(f64::INFINITY, f64::min);
        let girth = (PI / belt_of(&normals) as f64).cos().recip() * (1.0 + ROUNDING);
        Some(Self { normals, ends, structure: Arc::new(structure), reach, shortest, girth, flats: [None; 2] })
    }

    /// The same with a facet across the axis in the place of all rows at some ends.
    pub(super) fn cut(&self, at: [bool; 2]) -> Self {
        let belt = belt_of(&self.normals);
        let is_kept = |&facet: &usize| facet < belt || !at[self.ends[facet]];
        let kept: Vec<usize> = (0..self.normals.len()).filter(is_kept).collect();
        let (mut normals, mut ends): (Vec<Point>, Vec<usize>) = kept.iter().map(|&facet| (self.normals[facet], self.ends[facet])).unzip();
        let renamed = |facet: u16| kept.binary_search(&usize::from(facet)).map_or(u16::MAX, |place| place as u16);
        let stays = self.structure.corners.iter().filter(|corner| !at[corner.end]);
        let mut corners: Vec<Corner> = stays.map(|corner| Corner { facets: corner.facets.map(renamed), end: corner.end }).collect();
        let mut flats = [None; 2];
        for end in (0..2).filter(|&end| at[end]) {
            let flat = normals.len() as u16;
            flats[end] = Some(flat);
            normals.push([0.0, 0.0, if end == 1 { 1.0 } else { -1.0 }]);
            ends.push(end);
            corners.extend((0..belt).map(|place| Corner { facets: [place as u16, ((place + 1) % belt) as u16, flat], end }));
        }
        let place = |corner: &Corner| meeting(corner.facets.map(|facet| &normals[usize::from(facet)]), [1.0; 3]).unwrap_or_default();
        let places: Vec<Point> = corners.iter().map(place).collect();
        let structure = Arc::new(Structure::new(&normals, corners, &places));
        Self { normals, ends, structure, reach: self.reach, shortest: self.shortest, girth: self.girth, flats }
    }
}

/// How many facets are in the belt: they come first.
fn belt_of(normals: &[Point]) -> usize {
    normals.iter().take_while(|normal| normal[2] == 0.0).count()
}

/// The edges of a simple polytope: they join corners that have two facets in common.
fn edges(normals: &[Point], corners: &[Corner], places: &[Point]) -> Vec<Edge> {
    let mut edges = Vec::new();
    for (p, one) in corners.iter().enumerate() {
        for (q, other) in corners.iter().enumerate().skip(p + 1) {
            let mut common = one.facets.iter().copied().filter(|facet| other.facets.contains(facet));
            let (Some(first), Some(second)) = (common.next(), common.next()) else { continue };
            let along = subtract(&places[q], &places[p]);
            let left = cross(&normals[usize::from(first)], &along);
            // The facet lies to the left of its edges.
            let facets = if dot(&left, &normals[usize::from(second)]) < 0.0 { [first, second] } else { [second, first] };
            edges.push(Edge { corners: [p as u16, q as u16], facets });
        }
    }
    edges
}

/// A belt of facets, and rows of them above and below it.
#[derive(Clone, Copy)]
struct Pattern {
    /// Facets of the belt.
    belt: usize,
    rows: usize,
    /// Facets along the rows over those along the belt, for the same length.
    density: f64,
    /// Whether the last row is one facet, across the axis.
    is_closed: bool,
    turn: f64,
}

impl Pattern {
    /// Those that are tried, with as many facets in the belt or up to twice as many.
    fn all(least: usize) -> impl Iterator<Item = Self> {
        (least..2 * least).flat_map(|belt| {
            let fewest = (belt / 6).max(1);
            (fewest..fewest + ROWS + belt / 4).flat_map(move |rows| {
                DENSITIES.into_iter().flat_map(move |density| {
                    [true, false].into_iter().flat_map(move |is_closed| TURNS.map(|turn| Self { belt, rows, density, is_closed, turn }))
                })
            })
        })
    }

    /// The sine and cosine of a row's latitude, and its facets.
    fn row(&self, row: usize) -> (f64, f64, usize) {
        let spacing = FRAC_PI_2 / (self.rows as f64 + if self.is_closed { 0.0 } else { 0.5 });
        let (up, out) = (spacing * row as f64).sin_cos();
        let count = if row == self.rows && self.is_closed { 1 } else { ((self.belt as f64 * out * self.density).round() as usize).max(3) };
        (up, out, count)
    }

    fn facets(&self) -> usize {
        self.belt + 2 * (1..=self.rows).map(|row| self.row(row).2).sum::<usize>()
    }

    /// Normals, the belt's first, and the ends they are at.
    fn normals(&self) -> (Vec<Point>, Vec<usize>) {
        let (mut normals, mut ends) = (Vec::new(), Vec::new());
        for place in 0..self.belt {
            let (sine, cosine) = (TAU * place as f64 / self.belt as f64).sin_cos();
            normals.push([cosine, sine, 0.0]);
            ends.push(0);
        }
        for row in 1..=self.rows {
            let (up, out, count) = self.row(row);
            for place in 0..count {
                let (sine, cosine) = (TAU * (place as f64 + self.turn * row as f64) / count as f64).sin_cos();
                for end in [1, 0] {
                    normals.push([cosine * out, sine * out, if end == 1 { up } else { -up }]);
                    ends.push(end);
                }
            }
        }
        (normals, ends)
    }

    /// Whether the polytope surely reaches farther than `most`: in some direction no normal comes within the angle whose cosine is 1 / most. Looked for where two facets of a row meet one of
    /// the next or of the last one, as most patterns that do not serve show.
    fn leaves_a_hole(&self, normals: &[Point], most: f64) -> bool {
        let mut start = self.belt;
        let mut below: Vec<Point> = normals[..self.belt].to_vec();
        for row in 1..=self.rows {
            let count = self.row(row).2;
            let above: Vec<Point> = normals[start..start + 2 * count].iter().step_by(2).copied().collect();
            start += 2 * count;
            if [(&below, &above), (&above, &below)].into_iter().any(|(pairs, thirds)| is_open(pairs, thirds, normals, most)) {
                return true;
            }
            below = above;
        }
        !self.is_closed && below[0][2] < 1.0 / most - SEEN
    }
}

/// Whether a direction in which two neighbours of a ring meet the nearest of another one is far from all normals.
fn is_open(pairs: &[Point], thirds: &[Point], normals: &[Point], most: f64) -> bool {
    if pairs.len() < 2 {
        return false;
    }
    (0..pairs.len()).any(|place| {
        let (a, b) = (&pairs[place], &pairs[(place + 1) % pairs.len()]);
        let middle: Point = std::array::from_fn(|axis| a[axis] + b[axis]);
        let Some(third) = thirds.iter().max_by(|p, q| dot(p, &middle).total_cmp(&dot(q, &middle))) else { return false };
        let Some(vertex) = meeting([a, b, third], [1.0; 3]) else { return false };
        let length = dot(&vertex, &vertex).sqrt();
        length > most && normals.iter().all(|normal| dot(normal, &vertex) < (1.0 / most - SEEN) * length)
    })
}

/// The point on three planes n . x = c, if there is one to speak of.
pub(super) fn meeting(normals: [&Point; 3], offsets: [f64; 3]) -> Option<Point> {
    let [a, b, c] = normals;
    let dual = [cross(b, c), cross(c, a), cross(a, b)];
    let determinant = dot(a, &dual[0]);
    (determinant.abs() > ROUNDING)
        .then(|| std::array::from_fn(|axis| (0..3).map(|k| offsets[k] * dual[k][axis]).sum::<f64>() / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forms_lie_between_the_balls_and_hold_to_eulers_formula() {
        for (most, facets) in [(1.9, 8), (1.22, 24), (1.1, 60), (1.05, 110), (1.02, 320)] {
            let Some(form) = Form::within(most) else { panic!("{most}") };
            assert!(form.reach <= most * (1.0 + 1e-6) && form.normals.len() <= facets, "{most}: {} facets", form.normals.len());
            assert!(form.shortest > 1e-3, "{most}: {}", form.shortest);
            // The belt's edges run along the axis, all others stay at their end.
            for form in [form.cut([true, false]), form.cut([false, true]), form.cut([true; 2]), form] {
                assert!(form.structure.is_whole());
                for edge in &form.structure.edges {
                    let ends = edge.corners.map(|corner| form.structure.corners[usize::from(corner)].end);
                    let is_belt = edge.facets.iter().all(|&facet| form.normals[usize::from(facet)][2] == 0.0);
                    assert_eq!(ends[0] != ends[1], is_belt);
                }
            }
        }
        assert!(Form::within(1.001).is_none());
    }

    /// What is seen to leave a hole reaches farther indeed, and most of what does is seen: patterns for several balls, held against their vertices.
    #[test]
    fn holes_that_are_seen_are_there() {
        let (mut seen, mut missed) = (0, 0);
        for most in [1.5, 1.2, 1.1, 1.06] {
            let least = (PI / (1.0_f64 / most).acos()).ceil() as usize;
            for pattern in Pattern::all(least).step_by(97).filter(|pattern| pattern.facets() <= 110) {
                let (normals, _) = pattern.normals();
                let is_seen = pattern.leaves_a_hole(&normals, most);
                // The farthest vertex, by all triples.
                let mut reach = 0.0_f64;
                for a in 0..normals.len() {
                    let near: Vec<usize> = (a + 1..normals.len()).filter(|&b| dot(&normals[a], &normals[b]) > -0.7).collect();
                    for (place, &b) in near.iter().enumerate() {
                        for &c in &near[place + 1..] {
                            let Some(vertex) = meeting([&normals[a], &normals[b], &normals[c]], [1.0; 3]) else { continue };
                            let length = dot(&vertex, &vertex).sqrt();
                            if length > reach && normals.iter().all(|normal| dot(normal, &vertex) <= 1.0 + ROUNDING) {
                                reach = length;
                            }
                        }
                    }
                }
                assert!(!is_seen || reach > most, "{most}: {} facets reach {reach}", normals.len());
                seen += usize::from(is_seen);
                missed += usize::from(!is_seen && reach > most);
            }
        }
        assert!(seen > 20 && missed * 10 < seen, "{seen} seen, {missed} missed");
    }
}
