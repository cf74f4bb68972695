//! The convex polygon that tiles fill.

use super::{MISS, MOST_OFF, Place};
use crate::attractor::cell::{closest_on_segment, distance_squared};
use crate::attractor::extremes;
use std::f64::consts::TAU;

/// A side of a tile: its ends with the tile to the left, and in units.
pub(super) struct Side {
    pub(super) places: [Place; 2],
    ends: [[i64; 2]; 2],
}

/// Places are rounded to this.
fn unit(extent: f64) -> f64 {
    16.0 * MISS * extent
}

/// Whether places are the same, in units that these may be rounded to either side of.
fn are_near(a: [i64; 2], b: [i64; 2]) -> bool {
    (0..2).all(|axis| (a[axis] - b[axis]).abs() <= 1)
}

/// Whether places are the same.
pub(super) fn are_same(a: Place, b: Place, extent: f64) -> bool {
    let in_units = |place: Place| place.map(|x| (x / unit(extent)).round() as i64);
    are_near(in_units(a), in_units(b))
}

/// How wide a tile is at least, and how long its sides are, in units: what is narrower would have sides that are the same, and hide.
const WIDTH: f64 = 64.0;

/// Whether a tile is wider than what places are rounded to, and its sides are longer.
pub(super) fn is_wide(corners: &[Place], extent: f64) -> bool {
    let least = WIDTH * unit(extent);
    let lengths = (0..corners.len()).map(|k| (corners[k], corners[(k + 1) % corners.len()])).map(|(a, b)| (b[0] - a[0]).hypot(b[1] - a[1]));
    let [shortest, longest] = extremes(lengths);
    shortest > least && double_area(corners).abs() > least * longest
}

/// The sides of a tile, given its corners around, whichever way.
pub(super) fn sides(corners: &[Place], extent: f64) -> impl Iterator<Item = Side> {
    let is_turned = double_area(corners) < 0.0;
    (0..corners.len()).map(move |k| {
        let mut places = [corners[k], corners[(k + 1) % corners.len()]];
        if is_turned {
            places.swap(0, 1);
        }
        Side { places, ends: places.map(|place| place.map(|x| (x / unit(extent)).round() as i64)) }
    })
}

/// Which of all sides are the other way round of which, and which are alone.
///
/// Cost: quadratic in those that are open at a time.
pub(super) fn pairs(all: &[Side]) -> (Vec<[usize; 2]>, Vec<usize>) {
    let (mut pairs, mut open): (Vec<[usize; 2]>, Vec<usize>) = (Vec::new(), Vec::new());
    for (number, side) in all.iter().enumerate() {
        let is_other = |&other: &usize| are_near(all[other].ends[0], side.ends[1]) && are_near(all[other].ends[1], side.ends[0]);
        match open.iter().position(is_other) {
            None => open.push(number),
            Some(found) => pairs.push([open.swap_remove(found), number]),
        }
    }
    (pairs, open)
}

/// The corners of the convex polygon around which some sides lead, counter-clockwise, given twice the area of the tiles that have these, and how far it may be off; none where they lead around none, or these do not fill it.
///
/// Wide tiles whose sides cancel but for these cover each place inside as often as the sides wind around it: once, as they turn once and to the left only.
pub(super) fn outline(all: &[Side], mut open: Vec<usize>, area: f64, extent: f64) -> Option<(Vec<Place>, f64)> {
    let unit = unit(extent);
    // One behind the other around.
    let mut ring: Vec<Place> = Vec::new();
    let mut next = 0;
    while !open.is_empty() {
        let side = &all[open.swap_remove(next)];
        ring.push(side.places[0]);
        match open.iter().position(|&other| are_near(all[other].ends[0], side.ends[1])) {
            Some(found) => next = found,
            None => open.is_empty().then_some(())?,
        }
    }
    let count = ring.len();
    ((double_area(&ring) - area).abs() <= 1e-6 * area).then_some(())?;
    let (mut corners, mut turned) = (Vec::new(), 0.0);
    for k in 0..count {
        let [a, b, c] = [k + count - 1, k, k + 1].map(|k| ring[k % count]);
        let (before, after) = ([b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]);
        let turn = before[0] * after[1] - before[1] * after[0];
        let straight = 4.0 * unit * before[0].hypot(before[1]).max(after[0].hypot(after[1]));
        if turn < -straight {
            return None;
        }
        turned += turn.max(0.0).atan2(before[0] * after[0] + before[1] * after[1]);
        if turn > straight {
            corners.push(b);
        }
    }
    // Corners that are left out are off the sides of what is left, and so are sides that turn right by no more than rounding.
    let off = ring.iter().map(|place| from_sides(*place, &corners)).fold(0.0, f64::max) + 8.0 * unit;
    (corners.len() > 2 && turned < 1.5 * TAU && off <= MOST_OFF * extent).then_some((corners, off))
}

/// Twice the area of a polygon, negative if its corners are clockwise.
pub(super) fn double_area(corners: &[Place]) -> f64 {
    (0..corners.len()).map(|k| (corners[k], corners[(k + 1) % corners.len()])).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum()
}

/// How far a place is from the sides of a polygon.
fn from_sides([x, y]: Place, corners: &[Place]) -> f64 {
    let side = |k: usize| {
        let [a, b] = [corners[k], corners[(k + 1) % corners.len()]].map(|[x, y]| [x, y, 0.0]);
        distance_squared(&[x, y, 0.0], &closest_on_segment(&[x, y, 0.0], &a, &b))
    };
    (0..corners.len()).map(side).fold(f64::INFINITY, f64::min).sqrt()
}
