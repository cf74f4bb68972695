//! Points and segments in one plane, many of them near to each other: the surface around them is a sheet over the plane, and its mirror image.
//!
//! The distance d from a place at height z over the plane to the bodies has d^2 = z^2 + d_0^2, with d_0 that from its foot. So what is below a height z of {d <= r} is over the plane's {d_0 <= sqrt(r^2 - z^2)}, whose boundary is known (`contour`): sheets are led along it at several heights by polygons with few
//! corners (`rings`), and along the creases between (`valleys`).
//!
//! Of a sheet with its mirror image it is proven (`sheet`) that it crosses nothing, that all its triangles have s <= d <= t, s < r < t, and that all bodies are within. Then the solid holds D(s), which hangs together around each body and does not meet the surface, and it is in D(t), as what is between a place of the
//! surface and its foot is no farther from the bodies. It shrinks into its base, and D(r) into the plane's {d_0 <= r}, which the contour at r bounds: where both have as many components and holes, the solid has as many components and handles as D(r). Neither has voids.
//!
//! Where any of it does not come out, polytopes, or a lattice, do the work.

mod contour;
mod rings;
mod sheet;
#[cfg(test)]
mod tests;
mod thin;
mod valleys;
mod wires;

use super::figure::{Figure, Outline};
use super::{BYTES_PER_TRIANGLE, Flat};
use crate::attractor::cell::Point;
use crate::budget::{Budget, Stopped};
use crate::dilation::setting::Setting;
use crate::dilation::surface::BlockSurface;
use contour::{Contour, contour};
use rings::{Band, Corner, Ring, rings};
use sheet::{Sheet, sheet};
use std::f64::consts::PI;
pub(super) use thin::{Thinned, Thinning};
use valleys::Lines;
use wires::Wires;

/// A place in the plane.
type Place = [f64; 2];

/// The least gap that is told apart, in units of the slack.
const GAP: f64 = 16.0;
/// By how much what is closer is moved at most, in units of that gap; and two bodies together, with room for what that turns.
const MOVED: f64 = 3.0;
const PERTURBED: f64 = 2.0 * MOVED + 2.0;
/// Levels at most.
const MOST_LEVELS: usize = 64;
/// Rings may be anywhere between the ends of the band but for these shares of it.
const SPARE: [f64; 2] = [0.01, 0.02];
/// The share of the band that polygons may use across the plane at least: chords from level to level take the rest.
const ACROSS: f64 = 0.6;
/// Where contours are between the ends of their bands: of the rim, and above. Farther out they have fewer creases.
const RIM: [f64; 3] = [0.8, 0.6, 0.9];
const ABOVE: [f64; 3] = [0.7, 0.6, 0.8];
/// How much narrower the band is than what may be, in units of rounding: the plane, and the heights above and below it, are rounded. No height above the rim is less than this, either.
const ROUNDINGS: f64 = 3.0;
/// Triangles of a sheet and its mirror image for each corner of a ring, about.
const PER_CORNER: f64 = 4.0;

/// Between which distances from the bodies the surface may be, and how coordinates are rounded.
struct Limits<F> {
    inner: f64,
    outer: f64,
    /// Where the plane is.
    base: f64,
    /// The least height above the rim.
    lowest: f64,
    round: F,
}

impl<F: Fn(f64) -> f64> Limits<F> {
    /// A height that leads to a rounded coordinate, above the plane, and no higher than what nothing is too near to.
    fn height(&self, height: f64) -> f64 {
        (self.round)(self.base + height.min(self.top()).max(self.lowest)) - self.base
    }

    /// The height over a place of the plane, as far from the bodies as that, of what is so far out in the band; where the place is farther itself, halfway to what may be. None over what is beyond the band.
    fn over(&self, distance: f64, out: f64) -> Option<f64> {
        let wanted = (self.inner + out * (self.outer - self.inner)).max(0.5 * (distance + self.outer));
        let square = wanted * wanted - distance * distance;
        (square > 0.0).then(|| self.height(square.sqrt()))
    }

    /// A height at which nothing is too near.
    fn top(&self) -> f64 {
        self.inner + SPARE[0] * (self.outer - self.inner)
    }
}

/// A level of the sheet: its height, and how far its contour may be from the bodies.
#[derive(Clone, Copy, Debug)]
struct Level {
    height: f64,
    band: Band,
}

/// As few levels as leave room for polygons: corners of a profile between two circles, from the plane up to where it is flat.
fn levels(inner: f64, outer: f64, top: f64) -> Option<Vec<Level>> {
    (1..=MOST_LEVELS).find_map(|count| {
        let step = PI / (2 * count + 1) as f64;
        // Chords from level to level are inside of the circle with its corners by this factor.
        let least = inner / (0.5 * step).cos();
        if outer - least < ACROSS * (outer - inner) {
            return None;
        }
        let mut all: Vec<Level> = Vec::with_capacity(count + 1);
        for level in 0..=count {
            let is_last = level == count;
            let height = if is_last { top } else { least * (level as f64 * step).sin() };
            let far = (outer * outer - height * height).max(0.0).sqrt();
            let near = if is_last {
                // The chord from the level below touches the inner circle.
                let Band { inner: x, .. } = all.last()?.band;
                let z = all.last()?.height;
                inner * (0.5 * (x.atan2(z) - (inner / x.hypot(z)).min(1.0).acos())).max(0.0).tan()
            } else {
                (least * least - height * height).max(0.0).sqrt()
            };
            if near >= far || all.last().is_some_and(|below| below.band.inner < far) {
                return None;
            }
            all.push(Level { height, band: Band { inner: near, outer: far } });
        }
        Some(all)
    })
}

/// The surface around figures that are points and segments with one coordinate in common, with coordinates that are rounded; none where they are not, few are near to each other, or the proof does not come out.
///
/// # Errors
/// [`Stopped`].
pub(super) fn surface(
    figures: &[Figure],
    setting: &Setting,
    round: impl Fn(f64) -> f64 + Sync,
    budget: &Budget,
) -> Result<Option<Flat>, Stopped> {
    let Some((axis, base)) = plane(figures) else { return Ok(None) };
    // So that the axis is up where these are right and ahead.
    let axes = [(axis + 1) % 3, (axis + 2) % 3];
    let flat = |at: &Point| axes.map(|axis| at[axis]);
    let ends = |figure: &Figure| figure.corners().first().zip(figure.corners().last()).map(|(from, to)| [flat(from), flat(to)]);
    let segments: Vec<[Place; 2]> = figures.iter().filter_map(ends).collect();
    let gap = GAP * setting.slack;
    let spare = ROUNDINGS * setting.rounding + MOVED * gap + setting.slack;
    // Zeros have two signs: places that are the same have the same bits.
    let round = |x: f64| round(x) + 0.0;
    let limits = Limits {
        inner: setting.least + spare,
        outer: setting.outer - spare,
        base: round(base),
        lowest: ROUNDINGS * setting.rounding,
        round,
    };
    let Some(wires) = Wires::new(&segments, 2.0 * setting.outer, gap, budget)? else { return Ok(None) };
    // There are no polytopes around points that stand for cells.
    if !setting.dense && !wires.are_crowded() {
        return Ok(None);
    }
    let Some(exact) = contour(&wires, setting.reach, PERTURBED * gap, budget)? else { return Ok(None) };
    let Some(Rings { all, distances }) = all_rings(&wires, &exact, &limits, PERTURBED * gap, budget)? else { return Ok(None) };
    let corners: usize = all.iter().map(|ring| ring.corners.len()).sum();
    let triangles = PER_CORNER * corners as f64;
    if triangles > 2.0 * budget.limits.triangles as f64 {
        return Ok(Some(Flat::Beyond(triangles)));
    }
    if triangles * BYTES_PER_TRIANGLE > budget.limits.memory_bytes as f64 {
        return Ok(None);
    }
    let lines = Lines::new(&wires, &all, &distances, &limits, budget)?;
    let made =
        sheet(&wires, &all, &lines, &limits, budget)?.filter(|made| made.components == exact.components && made.holes == exact.holes);
    Ok(made.map(|made| {
        let surface = mirrored(made, |at, height| {
            let mut point = [0.0; 3];
            (point[axes[0]], point[axes[1]], point[axis]) = (at[0], at[1], (limits.round)(limits.base + height));
            point
        });
        Flat::Made(Box::new(surface))
    }))
}

/// The rings of all levels from the rim up, and how far the contours are that they are led along.
struct Rings {
    all: Vec<Ring>,
    distances: Vec<f64>,
}

/// The rings of all levels; none where the rim's is not like the exact one.
fn all_rings(
    wires: &Wires,
    exact: &Contour,
    limits: &Limits<impl Fn(f64) -> f64>,
    gap: f64,
    budget: &Budget,
) -> Result<Option<Rings>, Stopped> {
    let band = limits.outer - limits.inner;
    let Some(levels) = levels(limits.inner + SPARE[0] * band, limits.outer - SPARE[1] * band, limits.top()) else { return Ok(None) };
    let (mut all, mut distances) = (Vec::new(), Vec::new());
    for (number, level) in levels.iter().enumerate() {
        let Band { inner, outer } = level.band;
        let is_like = |made: &Contour| number > 0 || (made.components == exact.components && made.holes == exact.holes);
        let mut found = None;
        for share in if number == 0 { RIM } else { ABOVE } {
            found = contour(wires, inner + share * (outer - inner), gap, budget)?.filter(is_like);
            if found.is_some() {
                break;
            }
        }
        let Some(found) = found.as_ref().or((number == 0).then_some(exact)) else { return Ok(None) };
        distances.push(found.radius);
        let height = if number == 0 { 0.0 } else { limits.height(level.height) };
        for mut corners in rings(wires, found, level.band, budget)? {
            corners.iter_mut().for_each(|corner: &mut Corner| corner.at = corner.at.map(&limits.round));
            corners.dedup_by_key(|corner| corner.at);
            if corners.len() >= 3 {
                all.push(Ring { level: number, height, corners });
            }
        }
    }
    Ok(Some(Rings { all, distances }))
}

/// The surface of a sheet and its mirror image, without vertices that nothing has.
fn mirrored(Sheet { vertices, triangles, .. }: Sheet, place: impl Fn(Place, f64) -> Point) -> BlockSurface {
    let mut numbers = vec![[u32::MAX; 2]; vertices.len()];
    let mut surface = BlockSurface::default();
    for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
        for triangle in &triangles {
            let mut corners = triangle.map(|vertex| {
                let (own, vertex) = (&mut numbers[vertex as usize], &vertices[vertex as usize]);
                if own[side] == u32::MAX {
                    own[side] = surface.vertices.len() as u32;
                    surface.vertices.push(place(vertex.at, sign * vertex.height));
                    if vertex.height == 0.0 {
                        // They share the rim.
                        own[1] = own[side];
                    }
                }
                own[side]
            });
            if side == 1 {
                corners.swap(1, 2);
            }
            surface.triangles.push(corners);
        }
    }
    surface
}

/// The axis and the coordinate that all figures have in common, if they are points and segments as thick as each other.
fn plane(figures: &[Figure]) -> Option<(usize, f64)> {
    let first = figures.first()?.corners().first()?;
    let is_plain = |figure: &Figure| figure.deficit == 0.0 && matches!(figure.outline, Outline::Point(_) | Outline::Segment(_));
    if !figures.iter().all(is_plain) {
        return None;
    }
    let is_common = |&axis: &usize| figures.iter().flat_map(Figure::corners).all(|corner| corner[axis] == first[axis]);
    (0..3).find(is_common).map(|axis| (axis, first[axis]))
}
