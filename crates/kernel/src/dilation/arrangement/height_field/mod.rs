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
//! *Rays.* Others may stand for S (see `peaks`). Let H be all that is not above S, and E_t the upper ends of what D_t(S) has over each place, which are those of D_t(H). Let R be a union of rays that lead down, in D_(t' - t)(H), and D_s'(H) be in D_s(R), with s' < s < t < t'. A sheet with s <= d <= t from R
//! is in D_t'(H), and not in the inside of D_s(R), which has all that is below a place of it: so it is between E_s' and E_t'. With rays that lead up, the lower one is between the lower ends. So D_s'(S) is in what is between both sheets, and that is in D_t'(S), which has one interval over each place.
//! Sheets do not meet over places where the dilations of both kinds of rays by s do, to which their border belongs, nor do the sides of the strip beyond.
//!
//! Where that does not come out, or few parts are near to each other, polytopes, or a lattice, do the work.

mod check;
mod field;
mod ground;
mod pair;
mod parts;
mod samples;
mod sheet;
#[cfg(test)]
mod tests;

use super::Flat;
use super::faces::{Faces, Question};
use super::figure::{self, Figure};
use crate::attractor::cell::Point;
use crate::budget::{Budget, Stopped};
use crate::dilation::setting::Setting;
use field::Field;
use ground::{Base, Ground};
use pair::{BYTES_PER_FACE, Pair};
use parts::{parts, tips};
use sheet::Sheet;

/// A place in the plane.
type Place = [f64; 2];

/// Parts near to a triangle at least, as a mean: where there are fewer, polytopes around them have fewer triangles.
const LEAST_NEAR: f64 = 20.0;
/// How far segments that stand for rays go on below all, in units of the outer distance.
const BELOW: f64 = 4.0;

/// Between which distances from the graph the surface may be, and how coordinates are rounded.
struct Limits<'a> {
    inner: f64,
    outer: f64,
    /// Sheets end before they are farther than this from the part of the plane: there is some of what they may not enter over each place of theirs.
    border: f64,
    /// What is no farther than this from the part of the plane is nearer than `outer` to what faces stand for.
    rim: f64,
    rounding: f64,
    round: &'a (dyn Fn(f64) -> f64 + Sync),
}

impl<'a> Limits<'a> {
    fn new(setting: &Setting, round: &'a (dyn Fn(f64) -> f64 + Sync)) -> Self {
        let [inner, outer] = [setting.least + setting.slack, setting.outer - setting.slack];
        Self { inner, outer, border: inner, rim: outer, rounding: setting.rounding, round }
    }

    /// A coordinate of a vertex.
    fn rounded(&self, x: f64) -> f64 {
        // Zeros have two signs: places that are the same have the same bits.
        (self.round)(x) + 0.0
    }

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
    let limits = Limits::new(setting, round);
    if BYTES_PER_FACE * ground.len() as f64 > budget.limits.memory_bytes as f64 {
        return Ok(None);
    }
    let faces = Faces::of(ground, 1.0);
    if faces.crowding(ground, setting.slack, limits.outer) < LEAST_NEAR {
        return Ok(None);
    }
    budget.cancel.check()?;
    let sheet = |faces: Faces| {
        let distances = [limits.inner, limits.outer];
        let field = Field::new(parts(&ground.mesh, &faces, distances), ground.len(), distances)?;
        Some(Sheet::new(&ground.base, field, faces, f64::NEG_INFINITY))
    };
    let (Some(above), Some(below)) = rayon::join(|| sheet(faces), || sheet(Faces::of(ground, -1.0))) else { return Ok(None) };
    let made = Pair::new([above, below], &limits).run(budget)?;
    Ok(made.map(|made| turned(made, frame)))
}

/// What was made in a frame, in space.
fn turned(mut made: Flat, frame: [usize; 3]) -> Flat {
    if let Flat::Made(surface) = &mut made {
        for vertex in &mut surface.vertices {
            let own = *vertex;
            (0..3).for_each(|axis| vertex[frame[axis]] = own[axis] + 0.0);
        }
    }
    made
}

/// Rays that stand for a graph over a convex part of a plane: see the head of the module.
pub(in crate::dilation) struct Rays {
    /// The axes of the plane, and the one across it, a right-handed frame.
    pub(in crate::dilation) axes: [usize; 3],
    /// The corners of the part of the plane, counter-clockwise.
    pub(in crate::dilation) corners: Vec<Place>,
    /// The upper ends of rays that lead down, and, seen upside down, those of rays that lead up.
    pub(in crate::dilation) peaks: [Vec<Point>; 2],
    /// How far from the part of the plane sheets end at most: over each place that is nearer, what is as near to rays that lead down as the inner distance is higher than what is so to rays that lead up is low.
    pub(in crate::dilation) border: f64,
    /// How far from it they are joined at most: all that is nearer, and between ends of rays, is nearer than the outer distance to both kinds.
    pub(in crate::dilation) rim: f64,
}

/// The surface around a graph that rays stand for; none where the proof does not come out, or there is no room for what is known of them.
///
/// # Errors
/// [`Stopped`].
pub(in crate::dilation) fn between_rays(rays: Rays, setting: &Setting, budget: &Budget) -> Result<Option<Flat>, Stopped> {
    let Rays { axes, corners, peaks, border, rim } = rays;
    let round = |x: f64| f64::from(x as f32);
    let limits = Limits { border, rim, ..Limits::new(setting, &round) };
    if BYTES_PER_FACE * peaks[0].len().max(peaks[1].len()) as f64 > budget.limits.memory_bytes as f64 {
        return Ok(None);
    }
    let base = Base { corners };
    let sheet = |side: usize| {
        // Segments stand for rays. They end below all that is asked of them.
        let lowest =
            peaks[side].iter().map(|peak| peak[2]).chain(peaks[1 - side].iter().map(|peak| -peak[2])).fold(f64::INFINITY, f64::min);
        let floor = lowest - BELOW * limits.outer;
        let distances = [limits.inner, limits.outer];
        let faces = Faces::new(peaks[side].iter().map(|&[x, y, z]| [[x, y, z], [x, y, floor], [x, y, floor]]));
        let field = Field::new(tips(&peaks[side], distances), peaks[side].len(), distances)?;
        Some(Sheet::new(&base, field, faces, floor))
    };
    let (Some(above), Some(below)) = rayon::join(|| sheet(0), || sheet(1)) else { return Ok(None) };
    let made = Pair::new([above, below], &limits).run(budget)?;
    Ok(made.map(|made| turned(made, axes)))
}
