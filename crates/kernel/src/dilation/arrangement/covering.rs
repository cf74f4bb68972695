//! Directions by which a sphere is covered: none is farther from all of them than an angle.
//!
//! They lie in rows across an axis. Between two rows there is a strip of triangles, none of whose circles may be larger than that angle: so row after row is as far from the last one as that allows, and what is searched for is
//! how many directions each has. The best coverings with many directions have FEWEST / (1 - cos angle) of them; rows that change their number take a tenth more.

use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract, unit};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Directions, and the triangles between them: the hull of the unit vectors, around the ball with radius 1 / reach. It is symmetric about the plane across its axis, z. Those across the axis form its belt, and come first; no triangle
/// has directions both above it and below.
#[derive(Debug)]
pub(super) struct Covering {
    pub(super) directions: Vec<Point>,
    /// Which end of a segment along the axis a direction is at: the second for those above the belt, the first for the others.
    pub(super) ends: Vec<usize>,
    /// How many are across the axis: they come first, counter-clockwise from that of x on, all with the same angle between them.
    pub(super) belt: usize,
    /// Counter-clockwise seen from outside.
    pub(super) triangles: Vec<[u16; 3]>,
    pub(super) reach: f64,
    /// Of the polar polytope, whose facets touch the unit ball where the directions are: its shortest edge. Where it is short, two triangles nearly lie in a plane.
    pub(super) shortest: f64,
    /// 1 / girth is how far the lines between neighbours of the belt are from the axis.
    pub(super) girth: f64,
}

/// Directions, times 1 - cos angle, of the best coverings with many (Fejes Toth, 1953): their caps cover a sphere 1.21 times.
const FEWEST: f64 = 2.42;
/// Belts that are tried have up to so many directions more than they must.
const WIDER: usize = 3;
/// Beginnings of a covering that are gone on with, of all that have as many rows.
const BEGINNINGS: usize = 3;
/// How many directions more or less than in proportion to its length the next row has.
const SPREAD: usize = 2;
/// Steps, and halvings of one, by which the farthest next row is looked for.
const STEPS: usize = 24;
const HALVINGS: usize = 14;
/// How a row is turned against the one before, as a share of the turn by which both look the same again: no two triangles lie in a plane.
const TURNS: [f64; 4] = [0.11, 0.36, 0.61, 0.86];
/// How far a fourth direction is from the plane of three at least.
const LEAST_HEIGHT: f64 = 1e-5;
/// Rounding of unit vectors.
const ROUNDING: f64 = 1e-9;

/// About as many directions as any covering has whose hull is around the ball with radius 1 / `most`.
fn fewest(most: f64) -> f64 {
    FEWEST / (1.0 - 1.0 / most)
}

impl Covering {
    /// One with few directions, no more than `limit`, whose hull is around the ball with radius 1 / `most`; those of the belt count `belt_weight` times more, and are a multiple of `belt_step`.
    pub(super) fn within(most: f64, limit: usize, belt_weight: usize, belt_step: usize) -> Option<Self> {
        let least = (PI / (1.0 / most).acos()).ceil().max(4.0) as usize;
        // Also where no number would do.
        if !(most > 1.0 && fewest(most) <= limit as f64 && least <= limit) {
            return None;
        }
        let mut found: Vec<Rows> = (least..=least + WIDER)
            .filter(|belt| belt.is_multiple_of(belt_step))
            .filter_map(|belt| Rows::around(belt, most, limit))
            .collect();
        found.sort_by_key(|rows| rows.count + belt_weight * rows.list[0].count);
        // Rows were only held against the next ones.
        found.iter().find_map(|rows| Self::of(rows, most))
    }

    fn of(rows: &Rows, most: f64) -> Option<Self> {
        let belt = rows.list[0].count;
        let mut directions = rows.list[0].directions();
        let mut ends = vec![0; belt];
        // Where the directions of every row start: the one above first, then its mirror image.
        let mut starts = vec![[0; 2]];
        for row in &rows.list[1..] {
            starts.push([directions.len(), directions.len() + row.count]);
            for end in [1, 0] {
                directions.extend(row.directions().into_iter().map(|[x, y, z]| [x, y, if end == 1 { z } else { -z }]));
                ends.extend(vec![end; row.count]);
            }
        }
        let mut triangles: Vec<[u16; 3]> = Vec::new();
        let mut add = |corners: [[usize; 2]; 3]| {
            let [upper, lower] = [0, 1].map(|side| corners.map(|[row, place]| (starts[row][side] + place) as u16));
            triangles.extend([upper, [lower[0], lower[2], lower[1]]]);
        };
        for (number, pair) in rows.list.windows(2).enumerate() {
            strip(&pair[0].directions(), &pair[1].directions(), most, |corners| add(corners.map(|(row, place)| [number + row, place])));
        }
        if rows.list.last().is_some_and(|row| row.count == 3) {
            add([0, 1, 2].map(|place| [rows.list.len() - 1, place]));
        }
        let normals: Vec<(Point, f64)> =
            triangles.iter().map(|corners| plane(corners.map(|corner| &directions[usize::from(corner)]))).collect();
        let is_hull = normals.iter().zip(&triangles).all(|((normal, offset), corners)| {
            (0..).zip(&directions).all(|(number, direction)| corners.contains(&number) || dot(normal, direction) < offset - ROUNDING)
        });
        let nearest = normals.iter().map(|&(_, offset)| offset).fold(f64::INFINITY, f64::min);
        if !is_hull || triangles.len() + 4 != 2 * directions.len() || nearest * most < 1.0 - ROUNDING {
            return None;
        }
        let polar: Vec<Point> = normals.iter().map(|(normal, offset)| normal.map(|x| x / offset)).collect();
        let are_joined = |p: usize, q: usize| triangles[p].iter().filter(|corner| triangles[q].contains(corner)).count() == 2;
        let pairs = (0..triangles.len()).flat_map(|p| (p + 1..triangles.len()).map(move |q| (p, q)));
        let lengths = pairs.filter(|&(p, q)| are_joined(p, q)).map(|(p, q)| distance_squared(&polar[p], &polar[q]));
        let shortest = lengths.fold(f64::INFINITY, f64::min).sqrt();
        let [reach, girth] = [nearest, (PI / belt as f64).cos()].map(|distance| (1.0 + ROUNDING) / distance);
        Some(Self { directions, ends, belt, triangles, reach, shortest, girth })
    }
}

/// Directions across the axis by one angle.
#[derive(Clone, Copy, Debug)]
struct Row {
    /// How far above the belt, in radians.
    latitude: f64,
    count: usize,
    /// Where its first direction is, in radians.
    turn: f64,
}

impl Row {
    fn directions(&self) -> Vec<Point> {
        if self.count == 1 {
            return vec![[0.0, 0.0, 1.0]];
        }
        let (up, out) = self.latitude.sin_cos();
        let direction = |place: usize| {
            let (sine, cosine) = (self.turn + TAU * place as f64 / self.count as f64).sin_cos();
            [cosine * out, sine * out, up]
        };
        (0..self.count).map(direction).collect()
    }
}

/// Rows from the belt upwards.
#[derive(Clone, Debug)]
struct Rows {
    list: Vec<Row>,
    /// Directions, those of the mirror image included.
    count: usize,
}

impl Rows {
    /// Those with the fewest directions that were found for a belt, from the belt to the pole.
    fn around(belt: usize, most: f64, limit: usize) -> Option<Self> {
        let mut open = vec![Self { list: vec![Row { latitude: 0.0, count: belt, turn: 0.0 }], count: belt }];
        let mut best: Option<Self> = None;
        // Directions that a row may be thought to need above it.
        let rest = |rows: &Self| fewest(most) * (1.0 - rows.last().latitude.sin());
        while !open.is_empty() {
            let below = best.as_ref().map_or(limit + 1, |best| best.count);
            let next = open.iter().flat_map(|rows| rows.longer(most)).filter(|rows| rows.count < below);
            let (closed, mut longer): (Vec<Self>, Vec<Self>) = next.partition(|rows| rows.is_closed(most));
            best = best.into_iter().chain(closed).min_by_key(|rows| rows.count);
            longer.sort_by(|a, b| (a.count as f64 + rest(a)).total_cmp(&(b.count as f64 + rest(b))));
            longer.truncate(BEGINNINGS);
            open = longer;
        }
        best
    }

    fn last(&self) -> &Row {
        &self.list[self.list.len() - 1]
    }

    /// Whether nothing is left above the last row.
    fn is_closed(&self, most: f64) -> bool {
        let Row { latitude, count, .. } = *self.last();
        count == 1 || (count == 3 && latitude.sin() * most >= 1.0)
    }

    /// The same with one row more, as far up as may be, for several numbers of its directions.
    fn longer(&self, most: f64) -> Vec<Self> {
        let from = *self.last();
        let with = |row: Row| {
            let mut longer = self.clone();
            longer.list.push(row);
            longer.count += 2 * row.count;
            longer
        };
        let below = from.directions();
        let pole = Row { latitude: FRAC_PI_2, count: 1, turn: 0.0 };
        if strip(&below, &pole.directions(), most, |_| {}) {
            return vec![with(pole)];
        }
        let angle = (1.0 / most).acos();
        let share = (from.latitude + 1.5 * angle).min(FRAC_PI_2).cos() / from.latitude.cos();
        let usual = (from.count as f64 * share).round() as usize;
        let counts = usual.saturating_sub(SPREAD).max(3)..=(usual + 2 * SPREAD).min(from.count + 1);
        let rows = counts.flat_map(|count| {
            let again = TAU * greatest_divisor(from.count, count) as f64 / (from.count * count) as f64;
            TURNS.map(|turn| Row { latitude: 0.0, count, turn: from.turn + turn * again })
        });
        let farthest = |row: Row| {
            let at = |step: f64| Row { latitude: from.latitude + (FRAC_PI_2 - from.latitude).min(2.0 * angle) * step, ..row };
            let may = |step: f64| strip(&below, &at(step).directions(), most, |_| {});
            let first = (1..STEPS).rev().map(|step| step as f64 / STEPS as f64).find(|&step| may(step))?;
            let (mut low, mut high) = (first, first + 1.0 / STEPS as f64);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                if may(middle) { low = middle } else { high = middle }
            }
            Some(with(at(low)))
        };
        rows.filter_map(farthest).collect()
    }
}

fn greatest_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { greatest_divisor(b, a % b) }
}

/// The unit normal of the plane through three points, and its distance from the origin.
fn plane([a, b, c]: [&Point; 3]) -> (Point, f64) {
    let normal = unit(&cross(&subtract(b, a), &subtract(c, a)));
    (normal, dot(&normal, a))
}

/// The triangles between two rows, of no four of which the circles of three have the fourth inside, counter-clockwise seen from outside: of every corner, which row it is in, and its place. False, and not all of them, where one is too large, or two of them lie nearly in a plane.
fn strip(lower: &[Point], upper: &[Point], most: f64, mut visit: impl FnMut([(usize, usize); 3])) -> bool {
    let nearest = |&a: &usize, &b: &usize| distance_squared(&upper[a], &lower[0]).total_cmp(&distance_squared(&upper[b], &lower[0]));
    let begin = (0..upper.len()).min_by(nearest).unwrap_or_default();
    let rises = if upper.len() == 1 { 0 } else { upper.len() };
    let (mut low, mut high) = (0, 0);
    while low < lower.len() || high < rises {
        let [from, after] = [low, low + 1].map(|place| place % lower.len());
        let [to, above] = [begin + high, begin + high + 1].map(|place| place % upper.len());
        let (normal, offset) = plane([&lower[from], &lower[after], &upper[to]]);
        let height = dot(&normal, &upper[above]) - offset;
        if low < lower.len() && high < rises && height.abs() < LEAST_HEIGHT {
            return false;
        }
        let is_low = high == rises || (low < lower.len() && height < 0.0);
        let offset = if is_low { offset } else { plane([&lower[from], &upper[above], &upper[to]]).1 };
        if offset * most < 1.0 {
            return false;
        }
        visit([(0, from), if is_low { (0, after) } else { (1, above) }, (1, to)]);
        if is_low {
            low += 1;
        } else {
            high += 1;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coverings_leave_no_hole_and_have_few_directions() {
        let mut random = crate::split_mix::Random(5);
        let many = (0..240).map(|step| (1.02 + 0.012 * f64::from(step), [0, 2][step as usize % 2]));
        // Where the one with the fewest directions is no hull.
        let some = [1.4753, 1.48, 1.4848, 1.4882].into_iter().flat_map(|most| [(most, 0), (most, 2)]);
        for (most, weight) in many.chain(some).chain([(1.01, 2), (1.006, 0)]) {
            let Some(covering) = Covering::within(most, 1000, weight, 1) else { panic!("{most}") };
            let count = covering.directions.len();
            assert!(covering.reach <= most * (1.0 + 1e-6) && covering.girth <= covering.reach, "{most}");
            assert!((count as f64) < 1.35 * fewest(most) + 4.0, "{most}: {count} directions");
            assert!(covering.shortest > 1e-4, "{most}: {}", covering.shortest);
            // Whatever looks in between is near to one.
            for _ in 0..400 {
                let any = unit(&std::array::from_fn(|_| random.share() + random.share() + random.share() - 1.5));
                let nearest = covering.directions.iter().map(|direction| dot(direction, &any)).fold(-1.0, f64::max);
                assert!(nearest * most > 1.0 - 1e-6, "{most}: {any:?}");
            }
        }
        // What asks for too many is told at once, also where no number would do.
        assert!([1.01, 1.0 + 1e-12, 1.0, 0.9, f64::NAN].into_iter().all(|most| Covering::within(most, 100, 0, 1).is_none()));
    }
}
