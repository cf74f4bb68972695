//! Surfaces that turn little from face to face but at seams, such as fine meshes of smooth ones with sharp edges: a sheet on each side, as far out as the radius, and strips around their borders that join both.
//!
//! At seams the surface is taken apart (`seams`). On the side where there is room between the sheets of both parts, strips as around borders join them; where they would cross each other, what the parts hide of each other is left out, and the sheets have their corners in common there.
//!
//! Let S be the union of the faces, and d the distance from it, with s < r < t the ends of the band and the radius. Fewer triangles T stand for S (`coarse`). Their corners, moved by r along the normals there to either side, are the corners of two sheets; corners on the border
//! are moved in all directions away from S, too (`sheets`). Where noise turns normals so that sheets fold there, these are evened. What comes out bounds a solid M. Nothing of how it was made is taken on trust. Shown are:
//!
//! * All of its triangles have s <= d <= t, and so has each way from a place of one of these to the place with the same shares in the feet of its corners d <= t (`faces`). These ways fill the cells between the triangles and the T, or the border, whose boundaries add up to that of M: where no cell is, the boundary winds around nothing. So M is in D_t(S).
//! * It is closed, meets itself nowhere, and winds once around a place of each connected part of S. It does not meet the inside of D_s(S), so that is in M.
//! * Wherever s <= d(x) <= t there is a direction w with w . (x - c) > 0 for all places c of S that are closest to x; and at places of the boundary of M there is one that leaves it through all facets there, too (`ways`).
//!
//! So M has the topology of D_r(S): see [`critical`](crate::dilation::critical) for the same of lattices. Where the faces stand for another shape S', no place of either farther than e from the other one, and s <= r - e and r + 2 e <= t, there also is a w wherever r - e <= d(x) <= r + e such that w . (x - c) > e for
//! all places c of S no farther from x than d(x) + 2 e: then D_r(S') has the topology of D_r(S), see `steady`. Where that does not come out, as where parts of S come so near to each other that their dilations touch, polytopes, or a lattice, do the work.

mod coarse;
mod seams;
mod sheets;
mod skin;
#[cfg(test)]
mod tests;
mod ways;

use super::between::Memory;
use super::faces::{Faces, Question, without_lines};
use super::figure::{self, Figure};
use super::sum::is_embedded;
use super::{BYTES_PER_TRIANGLE, Flat};
use crate::attractor::cell::Point;
use crate::budget::{Budget, Stopped};
use crate::dilation::setting::Setting;
use crate::dilation::surface::BlockSurface;
use crate::groups::Groups;
use crate::solid::half_edges::NONE;
use crate::solid::{Inside, TriMesh};
use coarse::Coarse;
use glam::DVec3;
use rayon::prelude::*;
use sheets::{Name, Shape, Sheets};
use skin::Skin;
use std::cell::Cell;
use std::collections::{BTreeSet, HashSet};
use ways::Ways;

/// By how many times the angle that a normal may be off its corner's a surface turns at seams at least. Neighbours that both turn as much as may be from the corner between them turn by twice that; with less, seams may end in the midst of what turns about as much along a side.
const SEAMS: [f64; 2] = [2.0, 1.2];
/// Shares of half the band: by which sheets may be nearer where the surface turns at corners, how far off them places may be that they go by, and both together.
const TURNED: f64 = 0.75;
const OFF: f64 = 0.75;
const BOTH: f64 = 0.95;
/// How far out strips around borders are, their sides across these, and their triangles around corners, beyond the radius in units of half the band.
const RIM: f64 = 0.4;
const SIDE: f64 = -0.3;
const FACET: f64 = -0.7;
/// Rounds in which faults are mended, and by what share of the first more strips have rows and columns in each.
const ROUNDS: u32 = 6;
const FINER: f64 = 0.25;
/// Rounds in which normals are evened where sheets fold.
const EVENINGS: usize = 8;
/// Triangles one after the other.
const IN_A_ROW: usize = 64;

/// The surface around figures that are the faces of a surface that turns little, with coordinates that are rounded; none where they are not, or the proof does not come out.
///
/// # Errors
/// [`Stopped`].
pub(super) fn surface(
    figures: &[Figure],
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
    let (radius, half) = (0.5 * (inner + outer), 0.5 * (outer - inner));
    let mut last = None;
    for share in SEAMS {
        let Some(skin) = Skin::new(&triangles, radius, TURNED * half, share, setting.slack) else {
            continue;
        };
        // With as many seams as before there are the same.
        if last.replace(skin.seams.all.len()) == Some(skin.seams.all.len()) {
            continue;
        }
        budget.cancel.check()?;
        let made = along(&Around { skin: &skin, faces: &Faces::new(skin.faces()), inner, outer }, setting, &round, budget)?;
        if made.is_some() {
            return Ok(made);
        }
    }
    Ok(None)
}

/// The same, given the surface with its seams.
fn along(around: &Around<'_>, setting: &Setting, round: &(impl Fn(f64) -> f64 + Sync), budget: &Budget) -> Result<Option<Flat>, Stopped> {
    let Around { skin, faces, inner, outer } = *around;
    let (radius, half) = (0.5 * (inner + outer), 0.5 * (outer - inner));
    budget.cancel.check()?;
    let ways = Ways::new(skin, faces, [inner, outer]);
    let (off, reach) = (setting.off + setting.slack, setting.reach);
    let is_steady = setting.off > 0.0 && inner <= reach - off && reach + 2.0 * off <= outer && ways.lead_out(off, budget)?;
    if !is_steady && !ways.lead_out(0.0, budget)? {
        return Ok(None);
    }
    let at = |share: f64| radius + share * half;
    let Some(valleys) = skin.seams.valleys(skin, radius) else {
        return Ok(None);
    };
    let hidden = skin.hidden(&valleys, faces, radius, half);
    let [row, column] = [[SIDE, RIM], [FACET, SIDE]].map(|[near, far]| 2.0 * (at(near) / at(far)).acos());
    let fold = 2.0 * (at(-TURNED) / radius).acos();
    let may_be_off = |skin: &Skin| skin.lost.iter().map(|lost| (BOTH * half - lost).min(OFF * half)).collect::<Vec<f64>>();
    let first = may_be_off(skin);
    let (mut most, mut good) = (first.clone(), HashSet::new());
    // With other normals, if these are needed: what is shown of the surface does not know them.
    let mut evened: Option<Skin> = None;
    let (mut round_number, mut evenings) = (0, 0);
    while round_number < ROUNDS {
        let own = evened.as_ref().unwrap_or(skin);
        let mut coarse = Coarse::new(own, &hidden, radius, column.cos());
        if !coarse.run(&first, &most, budget)? {
            return Ok(None);
        }
        let (names, left) = coarse.triangles();
        let share = 1.0 + FINER * f64::from(round_number);
        let shape = Shape { radius, rim: at(RIM), row: row / share, column: column / share, fold };
        let expected = shape.triangles(own, &left);
        if expected > 2.0 * budget.limits.triangles as f64 {
            return Ok(Some(Flat::Beyond(expected)));
        }
        if BYTES_PER_TRIANGLE * expected > budget.limits.memory_bytes as f64 {
            return Ok(None);
        }
        let Some(sheets) = Sheets::new(own, &valleys, &left, &shape, round) else {
            return Ok(None);
        };
        let faults = around.faults(&sheets, &good, budget)?;
        let names_of_all = || (0..sheets.triangles.len() as u32).map(|triangle| sheets.name(triangle)).collect::<HashSet<Name>>();
        if faults.is_empty() {
            let not_left = ways.not_left(&sheets, budget)?;
            if !not_left.is_empty() {
                let (feet, evened) = (around.feet(&sheets, &not_left), evened.get_or_insert_with(|| skin.clone()));
                if evenings == EVENINGS || !evened.even(&feet, radius, TURNED * half) {
                    return Ok(None);
                }
                evenings += 1;
                most.iter_mut().zip(may_be_off(evened)).for_each(|(most, other)| *most = most.min(other));
                good = names_of_all();
                continue;
            }
            let mut surface = BlockSurface { vertices: sheets.vertices, triangles: sheets.triangles, ..BlockSurface::default() };
            let is_shown = is_embedded(&mut surface, budget)? && holds(&surface, skin);
            return Ok(is_shown.then(|| if is_steady { Flat::Steady(Box::new(surface)) } else { Flat::Made(Box::new(surface)) }));
        }
        good = names_of_all();
        for fault in faults {
            good.remove(&sheets.name(fault));
            let owner = sheets.owners[fault as usize];
            if owner == NONE {
                let corners = sheets.triangles[fault as usize];
                corners.iter().for_each(|&corner| most[sheets.feet[corner as usize] as usize] *= 0.5);
            } else {
                coarse.halve(names[owner as usize], &mut most);
            }
        }
        round_number += 1;
    }
    Ok(None)
}

/// A surface, and the distances from it that sheets are between.
struct Around<'a> {
    skin: &'a Skin,
    faces: &'a Faces,
    inner: f64,
    outer: f64,
}

impl Around<'_> {
    /// The triangles of sheets that are nearer or farther, or whose ways to their feet are, but for those that are known to be good.
    fn faults(&self, sheets: &Sheets, good: &HashSet<Name>, budget: &Budget) -> Result<Vec<u32>, Stopped> {
        let open: Vec<u32> = (0..sheets.triangles.len() as u32).filter(|&triangle| !good.contains(&sheets.name(triangle))).collect();
        let look = |row: &[u32]| {
            budget.cancel.check()?;
            let mut memory = Memory::default();
            Ok(row.iter().copied().filter(|&triangle| self.is_fault(sheets, triangle, &mut memory)).collect())
        };
        let all: Vec<Vec<u32>> = open.par_chunks(IN_A_ROW).map(look).collect::<Result<_, Stopped>>()?;
        Ok(all.concat())
    }

    /// The vertices of the surface that corners of some triangles of sheets are out from, and those around these.
    fn feet(&self, sheets: &Sheets, triangles: &[u32]) -> Vec<u32> {
        let corners = triangles.iter().flat_map(|&triangle| sheets.triangles[triangle as usize]);
        let feet: BTreeSet<u32> = corners.map(|corner| sheets.feet[corner as usize]).collect();
        let near = feet.into_iter().flat_map(|foot| self.skin.around.at(foot)).flat_map(|&triangle| self.skin.triangles[triangle as usize]);
        let all: BTreeSet<u32> = near.collect();
        all.into_iter().collect()
    }

    fn is_fault(&self, sheets: &Sheets, triangle: u32, memory: &mut Memory) -> bool {
        let Self { skin, faces, inner, outer } = *self;
        let corners = sheets.triangles[triangle as usize];
        let feet = corners.map(|corner| sheets.feet[corner as usize]);
        let owners = feet.map(|foot| skin.around.at(foot)[0]);
        let last = Cell::new(owners[0]);
        let offer = |place: &Point| {
            last.set(skin.near(last.get(), place));
            Some(last.get())
        };
        let (triangle, feet) = (corners.map(|corner| sheets.vertices[corner as usize]), feet.map(|foot| skin.places[foot as usize]));
        faces.fault_with(offer, &Question { triangle, feet: Some(feet), owners, inner, outer }, memory).is_some()
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
