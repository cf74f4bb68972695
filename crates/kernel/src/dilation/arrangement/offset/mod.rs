//! Surfaces that turn little from face to face but at seams, such as fine meshes of smooth ones with sharp edges: a sheet on each side, as far out as the radius, and strips around their borders that join both.
//!
//! Around solids that do not meet themselves there is the sheet outside alone, and all that is said here of places is said of those outside, unless that one does not come out; closed surfaces whose seams leave no triangles for both sides are made of two such, one around what is outside of them. At seams the surface is taken apart (`seams`). On the side where there is room between the sheets of both parts, strips as around borders join them; where they would cross each other, what the parts hide of each other is left out, and the sheets have their corners in common there.
//!
//! Let S be the union of the faces, and d the distance from it, with s < r < t the ends of the band and the radius. Fewer triangles T stand for S (`coarse`). Their corners, moved by r along the normals there to either side, are the corners of two sheets; corners on the border
//! are moved in all directions away from S, too (`sheets`). Where noise turns normals so that sheets fold there, these are evened; where the surface bends by more than the radius they do so anyway, and what they hide of themselves is cut away. What cuts leave of folds is closed by moving vertices to neighbours, or made anew with finer triangles. What is left bounds a solid M. Nothing of how it was made is taken on trust. Shown are:
//!
//! * Each way from a place of the sheets to the place with the same shares in the feet of its corners has d <= t - m (`faces`). These ways fill the cells between the triangles and the T, or the border, whose boundaries add up to that of the sheets: where no cell is, these wind around nothing. A sheet outside alone winds there as the T do (`inward`). Where sheets cross each other they are cut (`crossed`), and M is what they wind around once or more: so M is in D_t(S), as what cuts, mending and rounding move is moved by less than m.
//!   So is what else is added: closed parts that are filled, and lids (`lids`) over places where sheets are too near, look back, or touch, each with a place inside such that what is between that and the lid has d <= t - m; and what is between slivers, or folds, and what they become (`tidy`).
//! * All triangles of its boundary have s <= d <= t. It is closed, meets itself nowhere, and winds once around a place of each connected part of S. It does not meet the inside of D_s(S), so that is in M.
//! * Wherever s <= d(x) <= t there is a direction w with w . (x - c) > 0 for all places c of S that are closest to x; and at places of the boundary of M there is one that leaves it through all facets there, too (`ways`).
//!
//! So M has the topology of D_r(S): see [`critical`](crate::dilation::critical) for the same of lattices. Where the faces stand for another shape S', no place of either farther than e from the other one, and s <= r - e and r + 2 e <= t, there also is a w wherever r - e <= d(x) <= r + e such that w . (x - c) > e for
//! all places c of S no farther from x than d(x) + 2 e: then D_r(S') has the topology of D_r(S), see `steady`. Where that does not come out, as where parts of S come so near to each other that their dilations touch, polytopes, or a lattice, do the work.

mod coarse;
mod crossed;
mod inward;
mod lids;
mod outcome;
mod rounds;
mod seams;
mod sheets;
mod skin;
#[cfg(test)]
mod tests;
mod tidy;
mod ways;

use super::between::{Memory, middle, radius};
use super::faces::{Faces, Fault, Question, numbered, without_lines};
use super::figure::{self, Figure};
use super::solids::keep;
use super::{BYTES_PER_TRIANGLE, Flat};
use crate::attractor::cell::{Point, cross, dot, subtract, unit};
use crate::budget::{Budget, Stopped};
use crate::dilation::convex::Convex;
use crate::dilation::setting::Setting;
use crate::dilation::surface::{BlockSurface, NameMap};
use crate::groups::Groups;
use crate::solid::half_edges::NONE;
use crate::solid::{Crossings, Inside, Solid, SolidError, TriMesh, misplaced_shell, repair};
use crossed::Pieces;
use glam::DVec3;
use rayon::prelude::*;
use rounds::{Told, along};
use sheets::{Name, Sheets};
use skin::{BOTH_SIDES, OUTER, Sides, Skin, edges, upright};
use std::cell::Cell;
use std::collections::{BTreeSet, HashSet};

/// By how many times the angle that a normal may be off its corner's a surface turns at seams at least. Neighbours that both turn as much as may be from the corner between them turn by twice that; with less, seams may end in the midst of what turns about as much along a side.
const SEAMS: [f64; 2] = [2.0, 1.2];
/// By what share of half the band sheets may be nearer where the surface turns at corners.
const TURNED: f64 = 0.75;
/// What is cut, mended and rounded is off by so many roundings at most, all in all.
const MOVED: f64 = 128.0;
/// Triangles one after the other.
const IN_A_ROW: usize = 64;
/// Within how many times the outer distance what is closest is sought.
const AWAY: f64 = 1.5;
/// Directions across which the width of what may be filled is asked, besides the axes.
const MOST_NORMALS: usize = 32;

/// The surface around figures that are the faces of a surface that turns little, with coordinates that are rounded; none where they are not, or the proof does not come out. Around what bounds solids, of those that are given, it may be outside of these alone.
///
/// # Errors
/// [`Stopped`].
pub(super) fn surface(
    figures: &[Figure],
    solids: &[TriMesh],
    setting: &Setting,
    round: impl Fn(f64) -> f64 + Sync,
    budget: &Budget,
) -> Result<Option<Flat>, Stopped> {
    let bits = |corners: &[Point; 3]| corners.map(|corner| corner.map(|x| (x + 0.0).to_bits()));
    let triangles = figure::triangles(figures).and_then(|triangles| without_lines(triangles.iter().map(bits).collect()));
    let Some(triangles) = triangles else { return Ok(None) };
    let triangles: Vec<[Point; 3]> = triangles.into_iter().map(|corners| corners.map(|corner| corner.map(f64::from_bits))).collect();
    if BYTES_PER_TRIANGLE * triangles.len() as f64 > budget.limits.memory_bytes as f64 {
        return Ok(None);
    }
    let [inner, outer] = [setting.least + setting.slack, setting.outer - setting.slack];
    let along = |triangles: &[[Point; 3]], sides: Sides| with_seams(triangles, sides, [inner, outer], setting, &round, budget);
    if let Some(outward) = outward(&triangles, solids)
        && solid_of(&outward, budget)?.is_some()
        && let (made, false) = along(&outward, OUTER)?
    {
        return Ok(made);
    }
    match along(&triangles, BOTH_SIDES)? {
        (None, true) if solids.is_empty() => side_by_side(&triangles, outer, along, budget),
        (made, _) => Ok(made),
    }
}

/// Outward triangles as a mesh that bounds a solid and does not meet itself; none where they do not.
fn solid_of(triangles: &[[Point; 3]], budget: &Budget) -> Result<Option<TriMesh>, Stopped> {
    let (places, triangles) = numbered(triangles);
    let mesh = TriMesh { vertices: places.into_iter().map(DVec3::from_array).collect(), triangles };
    let mesh = match Solid::new(mesh, budget) {
        Ok(solid) => solid.into_mesh(),
        Err(SolidError::Stopped(stopped)) => return Err(stopped),
        Err(_) => return Ok(None),
    };
    Ok((Crossings::of(&mesh, budget)?.count == 0 && misplaced_shell(&mesh).is_none()).then_some(mesh))
}

/// The surface around what closed surfaces bound, and the one around what is outside of these, of which the part inside is kept: each side has triangles of its own then, so that what has to go at the hollow side of seams is not in the way of the other one. None where they are no such surfaces, meet themselves, or one of both does not come out.
fn side_by_side(
    triangles: &[[Point; 3]],
    outer: f64,
    along: impl Fn(&[[Point; 3]], Sides) -> Result<(Option<Flat>, bool), Stopped>,
    budget: &Budget,
) -> Result<Option<Flat>, Stopped> {
    let (places, corners) = numbered(triangles);
    if edges(&corners).chunk_by(|a, b| a.ends == b.ends).any(|edge| edge.len() != 2) {
        return Ok(None);
    }
    let mesh = TriMesh { vertices: places.into_iter().map(DVec3::from_array).collect(), triangles: corners };
    let Ok(repaired) = repair(&mesh, budget) else { return budget.cancel.check().map(|()| None) };
    let mesh = repaired.solid.map_or(mesh, Solid::into_mesh);
    if mesh.triangles.len() != triangles.len() {
        return Ok(None);
    }
    let faces = |mesh: &TriMesh| (0..mesh.triangles.len() as u32).map(|triangle| mesh.points_of(triangle)).collect::<Vec<[Point; 3]>>();
    let Some(mesh) = solid_of(&faces(&mesh), budget)? else { return Ok(None) };
    let (inside, mut surface, mut are_steady) = (Inside::new(&mesh), BlockSurface::default(), true);
    for (solid, winding) in [(&mesh, 0), (&mesh.complement(outer), 1)] {
        let mut own = match along(&faces(solid), OUTER)?.0 {
            Some(Flat::Made(own)) => {
                are_steady = false;
                own
            }
            Some(Flat::Steady(own)) => own,
            other => return Ok(other),
        };
        keep(&mut own, |x| Some(inside.winding(x) == winding));
        let first = surface.vertices.len() as u32;
        surface.vertices.append(&mut own.vertices);
        surface.triangles.extend(own.triangles.iter().map(|corners| corners.map(|corner| corner + first)));
    }
    Ok(Some(if are_steady { Flat::Steady(Box::new(surface)) } else { Flat::Made(Box::new(surface)) }))
}

/// Triangles as solids have them; none where some are of none, or of two.
fn outward(triangles: &[[Point; 3]], solids: &[TriMesh]) -> Option<Vec<[Point; 3]>> {
    if solids.is_empty() {
        return None;
    }
    let name = |corners: &[Point; 3]| {
        let mut name = corners.map(|corner| corner.map(|x| (x + 0.0).to_bits()));
        name.sort_unstable();
        name
    };
    let mut all: NameMap<[[u64; 3]; 3], Option<[Point; 3]>> = NameMap::default();
    for corners in solids.iter().flat_map(|solid| (0..solid.triangles.len() as u32).map(|triangle| solid.points_of(triangle))) {
        all.entry(name(&corners)).and_modify(|own| *own = None).or_insert(Some(corners));
    }
    triangles.iter().map(|corners| all.get(&name(corners)).copied().flatten()).collect()
}

/// The surface around triangles, with seams or others, and whether other triangles, or those for both sides, may serve where none comes out: at seams, or where those on one side do not tell enough.
fn with_seams(
    triangles: &[[Point; 3]],
    sides: Sides,
    [inner, outer]: [f64; 2],
    setting: &Setting,
    round: &(impl Fn(f64) -> f64 + Sync),
    budget: &Budget,
) -> Result<(Option<Flat>, bool), Stopped> {
    let (radius, half) = (0.5 * (inner + outer), 0.5 * (outer - inner));
    let (mut last, mut is_open) = (None, false);
    for share in SEAMS {
        let Some(skin) = Skin::new(triangles, sides, radius, TURNED * half, share, setting.slack) else {
            continue;
        };
        // With as many seams as before there are the same.
        if last.replace(skin.seams.all.len()) == Some(skin.seams.all.len()) {
            continue;
        }
        budget.cancel.check()?;
        let around = Around { skin: &skin, faces: &Faces::new(skin.faces()), inner, outer, moved: MOVED * setting.rounding };
        match along(&around, setting, round, budget)? {
            Told::Made(made) => return Ok((Some(made), false)),
            Told::Nothing => return Ok((None, last > Some(0))),
            Told::OtherSeams => is_open = true,
        }
    }
    Ok((None, last > Some(0) || (is_open && sides == OUTER)))
}

/// A surface, and the distances from it that sheets are between.
struct Around<'a> {
    skin: &'a Skin,
    faces: &'a Faces,
    inner: f64,
    outer: f64,
    /// How far what is cut may be from where it is said to be.
    moved: f64,
}

impl Around<'_> {
    fn radius(&self) -> f64 {
        0.5 * (self.inner + self.outer)
    }

    /// Half the width of the band.
    fn half(&self) -> f64 {
        0.5 * (self.outer - self.inner)
    }

    /// The triangles of sheets that are nearer or farther, or whose ways to their feet are, but for those that are known to be good, and whether each is too near alone: of those that are cut what is left of them, and of what is not left only whether ways are farther.
    fn faults(
        &self,
        sheets: &Sheets,
        pieces: &Pieces,
        good: &HashSet<(Name, bool)>,
        outer: f64,
        budget: &Budget,
    ) -> Result<Vec<(u32, bool)>, Stopped> {
        let whole = pieces.whole(sheets);
        let is_open = |&triangle: &u32| !good.contains(&(sheets.name(triangle), whole[triangle as usize]));
        let mut open: Vec<(u32, Option<u32>)> =
            (0..sheets.triangles.len() as u32).filter(is_open).map(|triangle| (triangle, None)).collect();
        let is_cut = |own: &(u32, Option<u32>)| !whole[own.0 as usize];
        open.extend((0..).zip(&pieces.owners).map(|(piece, &owner)| (owner, Some(piece))).filter(is_cut));
        let look = |row: &[(u32, Option<u32>)]| {
            budget.cancel.check()?;
            let mut memory = Memory::default();
            let mut fault = |&(triangle, piece): &(u32, Option<u32>)| {
                let corners = piece.map(|piece| pieces.corners(piece));
                let mut is_so = |inner: f64| self.fault(sheets, triangle, corners, [inner, outer], &mut memory);
                let inner = if piece.is_some() || whole[triangle as usize] { self.inner } else { f64::NEG_INFINITY };
                let is_near = matches!(is_so(inner)?, Fault::Near(..));
                // What is too near may have ways that are too far, too.
                Some((triangle, is_near && is_so(f64::NEG_INFINITY).is_none()))
            };
            Ok(row.iter().filter_map(&mut fault).collect())
        };
        let all: Vec<Vec<(u32, bool)>> = open.par_chunks(IN_A_ROW).map(look).collect::<Result<_, Stopped>>()?;
        // Those that are too far first.
        let mut all = all.concat();
        all.sort_unstable();
        all.dedup_by_key(|fault| fault.0);
        Ok(all)
    }

    /// Where a triangle of sheets is nearer or farther, or its ways to its feet are; or a piece of it.
    fn fault(
        &self,
        sheets: &Sheets,
        triangle: u32,
        piece: Option<[Point; 3]>,
        [inner, outer]: [f64; 2],
        memory: &mut Memory,
    ) -> Option<Fault> {
        let skin = self.skin;
        let corners = sheets.triangles[triangle as usize];
        let feet = corners.map(|corner| sheets.feet[corner as usize]);
        let owners = feet.map(|foot| skin.around.at(foot)[0]);
        let last = Cell::new(owners[0]);
        let offer = |place: &Point| {
            last.set(skin.near(last.get(), place));
            Some(last.get())
        };
        let places = feet.map(|foot| skin.places[foot as usize]);
        let feet = if piece.is_none() { Some(places) } else { None };
        let triangle = piece.unwrap_or_else(|| corners.map(|corner| sheets.vertices[corner as usize]));
        self.faces.fault_with(offer, &Question { triangle, feet, owners, inner, outer }, memory)
    }

    /// Some vertices of the surface, and those around these.
    fn feet(&self, feet: BTreeSet<u32>) -> Vec<u32> {
        let near = feet.into_iter().flat_map(|foot| self.skin.around.at(foot)).flat_map(|&triangle| self.skin.triangles[triangle as usize]);
        let all: BTreeSet<u32> = near.collect();
        all.into_iter().collect()
    }

    /// The face that is closest to a place, and the way from there to the place; none where none is near.
    fn closest(&self, x: &Point) -> Option<(u32, Point)> {
        let (mut least, mut found) = (f64::INFINITY, None);
        self.faces.around(&[*x], AWAY * self.outer, |number| {
            let face = &self.faces.all[number as usize];
            if face.may_be_nearer(x, least) {
                let way = subtract(x, &face.closest(x));
                let square = dot(&way, &way);
                if square < least {
                    (least, found) = (square, Some((number, way)));
                }
            }
            true
        });
        found
    }

    /// Whether a triangle, and what is between it and its feet if there are such, is between distances.
    fn is_between(&self, triangle: [Point; 3], feet: Option<[Point; 3]>, [inner, outer]: [f64; 2], memory: &mut Memory) -> bool {
        let offer = |x: &Point| self.closest(x).map(|own| own.0);
        self.faces.fault_with(offer, &Question { triangle, feet, owners: [NONE; 3], inner, outer }, memory).is_none()
    }

    /// How far a triangle looks along the way to its middle from what is closest: a cosine.
    fn leads(&self, triangle: &[Point; 3]) -> f64 {
        let [a, b, c] = triangle;
        let normal = unit(&cross(&subtract(b, a), &subtract(c, a)));
        self.closest(&middle(triangle)).map_or(-1.0, |(_, way)| dot(&normal, &unit(&way)))
    }

    /// Whether all that a closed surface bounds, given by its triangles, is shown to be nearer than the outer distance by what may move: what is inside is no farther from it than half of what it is wide.
    fn is_filled(&self, triangles: &[[Point; 3]], budget: &Budget) -> Result<bool, Stopped> {
        let width = |along: &Point| {
            let all = triangles.iter().flatten().map(|corner| dot(corner, along));
            all.clone().fold(f64::NEG_INFINITY, f64::max) - all.fold(f64::INFINITY, f64::min)
        };
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let normals = triangles.iter().filter_map(upright).take(MOST_NORMALS);
        let half_width = 0.5 * axes.into_iter().chain(normals).map(|along| width(&along)).fold(f64::INFINITY, f64::min);
        let most = self.outer - self.moved - half_width;
        let mut memory = Memory::default();
        let mut is_near = |triangle: &[Point; 3]| {
            let centre = middle(triangle);
            self.closest(&centre).is_some_and(|(_, way)| dot(&way, &way).sqrt() + radius(triangle, &centre) <= most)
                || self.is_between(*triangle, None, [f64::NEG_INFINITY, most], &mut memory)
        };
        for triangle in triangles {
            budget.cancel.check()?;
            if most <= 0.0 || !is_near(triangle) {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// Whether a closed surface winds once around a place of each connected part of another.
fn holds(surface: &BlockSurface, skin: &Skin) -> bool {
    let vertices = surface.vertices.iter().copied().map(DVec3::from_array).collect();
    let mesh = TriMesh { vertices, triangles: surface.triangles.clone() };
    let inside = Inside::new(&mesh);
    let groups = Groups::of_triangles(skin.places.len(), &skin.triangles).all();
    // A group is called by the least of its vertices.
    let mut firsts = (0..).zip(&groups).filter(|&(vertex, &group)| vertex == group).map(|(vertex, _)| vertex as usize);
    firsts.all(|first| inside.winding(DVec3::from_array(skin.places[first])) == 1)
}
