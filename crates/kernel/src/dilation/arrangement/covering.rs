//! Directions by which a sphere is covered: none is farther from all of them than an angle.

use super::polytopes::meeting;
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Directions, and the triangles between them: the hull of the unit vectors, around the ball with radius 1 / reach. It is symmetric about the plane across its axis, z. Those across the axis form its belt, and come first; no triangle
/// has directions both above it and below.
#[derive(Debug)]
pub(super) struct Covering {
    pub(super) directions: Vec<Point>,
    /// Which end of a segment along the axis a direction is at: the second for those above the belt, the first for the others.
    pub(super) ends: Vec<usize>,
    pub(super) belt: usize,
    /// Counter-clockwise seen from outside.
    pub(super) triangles: Vec<[u16; 3]>,
    pub(super) reach: f64,
    /// Of the polar polytope, whose facets touch the unit ball where the directions are: its shortest edge. Where it is short, two triangles nearly lie in a plane.
    pub(super) shortest: f64,
    /// 1 / girth is how far the lines between neighbours of the belt are from the axis.
    pub(super) girth: f64,
}

/// Directions, times 1 - 1 / reach, of the best coverings with many (Fejes Toth, 1953): their caps cover a sphere 1.21 times.
const FEWEST: f64 = 2.42;
/// Rows above the belt, beyond a sixth of its directions, directions in them as shares of the belt's density, and how far each is turned from the one below it, in its directions, that are tried.
const ROWS: usize = 6;
const DENSITIES: [f64; 10] = [0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0, 1.05, 1.1, 1.15];
const TURNS: [f64; 2] = [0.5, 0.38];
/// Rounding of unit vectors, far below any edge.
const ROUNDING: f64 = 1e-9;
/// A hole is seen where the farthest direction is by this more than it may be, in its cosine: far above rounding.
const SEEN: f64 = 1e-7;
/// What [`ROUNDING`] makes of the cosine of an angle between directions, at most, with room to spare.
const AROUND: f64 = 1e-6;

impl Covering {
    /// The one with the fewest directions, of those that are tried and have no more than `limit`, whose hull is around the ball with radius 1 / `most`.
    pub(super) fn within(most: f64, limit: usize) -> Option<Self> {
        let least = (PI / (1.0 / most).acos()).ceil().max(4.0) as usize;
        let fewest = (FEWEST / (1.0 - 1.0 / most)) as usize;
        let mut patterns: Vec<(usize, Pattern)> = Pattern::all(least).map(|pattern| (pattern.count(), pattern)).collect();
        patterns.retain(|(count, _)| (fewest..=limit).contains(count));
        // Facets along a segment are crossed by more others.
        patterns.sort_by_key(|&(count, pattern)| count + 2 * pattern.belt);
        patterns.iter().find_map(|(_, pattern)| Self::new(pattern, most))
    }

    /// The covering with a pattern, if all facets of its hull are triangles, none of them along the axis, and no nearer than 1 / `most`: of its polar polytope, all corners have three facets, and lie within `most`.
    fn new(pattern: &Pattern, most: f64) -> Option<Self> {
        let (directions, ends) = pattern.directions();
        if pattern.leaves_a_hole(&directions, most) {
            return None;
        }
        let count = directions.len();
        // Facets that meet in a corner within `most` are no farther from each other than this.
        let widest = 2.0 / (most * most) - 1.0 - ROUNDING;
        let (mut corners, mut triangles) = (Vec::new(), Vec::new());
        for a in 0..count {
            let near: Vec<usize> = (a + 1..count).filter(|&b| dot(&directions[a], &directions[b]) > widest).collect();
            // Whatever reaches a corner of the facet within `most`, rounding included, is among these.
            let around: Vec<&Point> = directions.iter().filter(|other| dot(&directions[a], other) > widest - AROUND).collect();
            for (place, &b) in near.iter().enumerate() {
                for &c in &near[place + 1..] {
                    let corner = meeting([&directions[a], &directions[b], &directions[c]], [1.0; 3]);
                    let Some(corner) = corner else { continue };
                    if around.iter().any(|other| dot(other, &corner) > 1.0 + ROUNDING) {
                        continue;
                    }
                    if dot(&corner, &corner) > most * most {
                        if directions.iter().any(|other| dot(other, &corner) > 1.0 + ROUNDING) {
                            continue;
                        }
                        return None;
                    }
                    let on = around.iter().filter(|other| dot(other, &corner) > 1.0 - ROUNDING).count();
                    if on != 3 || corner[2].abs() < ROUNDING.sqrt() {
                        return None;
                    }
                    let turned = cross(&subtract(&directions[b], &directions[a]), &subtract(&directions[c], &directions[a]));
                    let triangle = if dot(&turned, &corner) > 0.0 { [a, b, c] } else { [a, c, b] };
                    triangles.push(triangle.map(|corner| corner as u16));
                    corners.push(corner);
                }
            }
        }
        // All of the sphere.
        if triangles.len() + 4 != 2 * count {
            return None;
        }
        let are_joined = |p: usize, q: usize| triangles[p].iter().filter(|corner| triangles[q].contains(corner)).count() == 2;
        let pairs = (0..triangles.len()).flat_map(|p| (p + 1..triangles.len()).map(move |q| (p, q)));
        let lengths = pairs.filter(|&(p, q)| are_joined(p, q)).map(|(p, q)| distance_squared(&corners[p], &corners[q]));
        let shortest = lengths.fold(f64::INFINITY, f64::min).sqrt();
        let reach = corners.iter().map(|corner| dot(corner, corner).sqrt()).fold(0.0, f64::max) * (1.0 + ROUNDING);
        let girth = (PI / pattern.belt as f64).cos().recip() * (1.0 + ROUNDING);
        Some(Self { directions, ends, belt: pattern.belt, triangles, reach, shortest, girth })
    }
}

/// A belt of directions, and rows of them above and below it.
#[derive(Clone, Copy)]
struct Pattern {
    /// Directions of the belt.
    belt: usize,
    rows: usize,
    /// Directions along the rows over those along the belt, for the same length.
    density: f64,
    /// Whether the last row is one direction, along the axis.
    is_closed: bool,
    turn: f64,
}

impl Pattern {
    /// Those that are tried, with as many directions in the belt or up to twice as many.
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

    /// The sine and cosine of a row's latitude, and its directions.
    fn row(&self, row: usize) -> (f64, f64, usize) {
        let spacing = FRAC_PI_2 / (self.rows as f64 + if self.is_closed { 0.0 } else { 0.5 });
        let (up, out) = (spacing * row as f64).sin_cos();
        let count = if row == self.rows && self.is_closed { 1 } else { ((self.belt as f64 * out * self.density).round() as usize).max(3) };
        (up, out, count)
    }

    fn count(&self) -> usize {
        self.belt + 2 * (1..=self.rows).map(|row| self.row(row).2).sum::<usize>()
    }

    /// Directions, the belt's first, and the ends they are at.
    fn directions(&self) -> (Vec<Point>, Vec<usize>) {
        let (mut directions, mut ends) = (Vec::new(), Vec::new());
        for place in 0..self.belt {
            let (sine, cosine) = (TAU * place as f64 / self.belt as f64).sin_cos();
            directions.push([cosine, sine, 0.0]);
            ends.push(0);
        }
        for row in 1..=self.rows {
            let (up, out, count) = self.row(row);
            for place in 0..count {
                let (sine, cosine) = (TAU * (place as f64 + self.turn * row as f64) / count as f64).sin_cos();
                for end in [1, 0] {
                    directions.push([cosine * out, sine * out, if end == 1 { up } else { -up }]);
                    ends.push(end);
                }
            }
        }
        (directions, ends)
    }

    /// Whether somewhere none surely comes within the angle whose cosine is 1 / most. Looked for between two neighbours of a row and one of the next or of the last one, as most patterns that do not serve show.
    fn leaves_a_hole(&self, directions: &[Point], most: f64) -> bool {
        let mut start = self.belt;
        let mut below: Vec<Point> = directions[..self.belt].to_vec();
        for row in 1..=self.rows {
            let count = self.row(row).2;
            let above: Vec<Point> = directions[start..start + 2 * count].iter().step_by(2).copied().collect();
            start += 2 * count;
            if [(&below, &above), (&above, &below)].into_iter().any(|(pairs, thirds)| is_open(pairs, thirds, directions, most)) {
                return true;
            }
            below = above;
        }
        !self.is_closed && below[0][2] < 1.0 / most - SEEN
    }
}

/// Whether the direction between two neighbours of a ring and the nearest of another one is far from all.
fn is_open(pairs: &[Point], thirds: &[Point], directions: &[Point], most: f64) -> bool {
    if pairs.len() < 2 {
        return false;
    }
    (0..pairs.len()).any(|place| {
        let (a, b) = (&pairs[place], &pairs[(place + 1) % pairs.len()]);
        let middle: Point = std::array::from_fn(|axis| a[axis] + b[axis]);
        let Some(third) = thirds.iter().max_by(|p, q| dot(p, &middle).total_cmp(&dot(q, &middle))) else { return false };
        let Some(vertex) = meeting([a, b, third], [1.0; 3]) else { return false };
        let length = dot(&vertex, &vertex).sqrt();
        length > most && directions.iter().all(|direction| dot(direction, &vertex) < (1.0 / most - SEEN) * length)
    })
}

