//! A surface with one height over each place of a convex part of a plane across an axis, such as a terrain: what is around it is between a sheet above and a sheet below.
//!
//! Let S be the graph of f over a convex part P of the plane. Over each place x, D(r) is the union of the intervals around f(u) of half-length sqrt(r^2 - |x - u|^2), for all u of P as near as r: these are a convex set, and f is continuous, so that D(r) has one interval over each place of P's dilation and nothing
//! elsewhere. It is a ball for every r. So all that has to be shown of two sheets and the strip around them that joins them (`pair`), with s < r < t:
//!
//! * All of their triangles have s <= d <= t (`check`).
//! * Seen from above, each sheet with its side of the strip covers the inside of the rim once: so neither crosses itself.
//! * The border of each sheet, and so all of it, is nearer to P than s, as P is convex: there is some of D(s) over each place of a sheet. It does not meet that, and these places hang together, as the strip around them is a ring. So it is above all of D(s), if one of its vertices is higher than all of S; and the lower one is below. So they do not
//!   meet each other, nor do the sides of the strip, which have the same edges seen from above, and the same rim.
//!
//! Then the surface is a sphere, and what it bounds holds D(s). It is in D(t), as over each place both of its ends are, and D(t) has one interval there.
//!
//! Where that does not come out, or few parts are near to each other, polytopes, or a lattice, do the work.

mod check;
mod field;
mod ground;
mod pair;
mod parts;
mod samples;
mod sheet;
mod squares;
#[cfg(test)]
mod tests;

use super::Flat;
use super::faces::{Faces, Question};
use super::figure::{self, Figure};
use crate::attractor::cell::Point;
use crate::budget::{Budget, Stopped};
use crate::dilation::plan::Setting;
use ground::Ground;
use pair::{BYTES_PER_FACE, Pair};

/// A place in the plane.
type Place = [f64; 2];

/// Parts near to a triangle at least, as a mean: where there are fewer, polytopes around them have fewer triangles.
const LEAST_NEAR: f64 = 20.0;

/// Between which distances from the graph the surface may be, and how coordinates are rounded.
struct Limits<'a> {
    inner: f64,
    outer: f64,
    rounding: f64,
    round: &'a (dyn Fn(f64) -> f64 + Sync),
}

impl Limits<'_> {
    /// The distance that is so far out in the band.
    fn at(&self, share: f64) -> f64 {
        self.inner + share * (self.outer - self.inner)
    }

    fn question(&self, triangle: [Point; 3], owners: [u32; 3]) -> Question {
        Question { triangle, feet: None, owners, inner: self.inner, outer: self.outer }
    }
}

/// The surface around figures that are the triangles of a graph over a convex part of a plane, with coordinates that are rounded; none where they are not, few are near to each other, or the proof does not come out.
///
/// # Errors
/// [`Stopped`].
pub(super) fn surface(
    figures: &[Figure],
    setting: &Setting,
    round: &(dyn Fn(f64) -> f64 + Sync),
    budget: &Budget,
) -> Result<Option<Flat>, Stopped> {
    let Some(triangles) = figure::triangles(figures) else { return Ok(None) };
    // So that the axis is up where the others are right and ahead.
    for frame in [2, 1, 0].map(|axis| [(axis + 1) % 3, (axis + 2) % 3, axis]) {
        budget.cancel.check()?;
        let seen = triangles.iter().map(|triangle| triangle.map(|corner| frame.map(|axis| corner[axis])));
        if let Some(ground) = Ground::new(seen) {
            return around(&ground, frame, setting, round, budget);
        }
    }
    Ok(None)
}

/// The surface around a graph that is seen in a frame, likewise.
fn around(
    ground: &Ground,
    frame: [usize; 3],
    setting: &Setting,
    round: &(dyn Fn(f64) -> f64 + Sync),
    budget: &Budget,
) -> Result<Option<Flat>, Stopped> {
    // Zeros have two signs: places that are the same have the same bits.
    let limits = Limits {
        inner: setting.least + setting.slack,
        outer: setting.outer - setting.slack,
        rounding: setting.rounding,
        round: &|x| round(x) + 0.0,
    };
    if BYTES_PER_FACE * ground.len() as f64 > budget.limits.memory_bytes as f64 {
        return Ok(None);
    }
    let faces = Faces::of(ground, 1.0);
    if faces.crowding(ground, setting.slack, limits.outer) < LEAST_NEAR {
        return Ok(None);
    }
    budget.cancel.check()?;
    let Some(pair) = Pair::new(ground, faces, &limits) else { return Ok(None) };
    let mut made = pair.run(budget)?;
    if let Some(Flat::Made(surface)) = &mut made {
        for vertex in &mut surface.vertices {
            let own = *vertex;
            (0..3).for_each(|axis| vertex[frame[axis]] = own[axis] + 0.0);
        }
    }
    Ok(made)
}
