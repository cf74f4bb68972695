//! Surfaces that turn little from face to face, such as fine meshes of smooth ones: a sheet on each side, as far out as the radius, and strips around their borders that join both.

mod coarse;
mod sheets;
mod skin;
mod ways;

use super::between::Memory;
use super::faces::{Faces, Question};
use super::figure::{self, Figure};
use super::sum::is_embedded;
use super::{BYTES_PER_TRIANGLE, Flat};
use crate::attractor::cell::Point;
use crate::budget::{Budget, Stopped};
use crate::dilation::plan::Setting;
use crate::dilation::surface::BlockSurface;
use crate::groups::Groups;
use crate::solid::half_edges::NONE;
use crate::solid::{Inside, TriMesh};
use coarse::Coarse;
use glam::DVec3;
use rayon::prelude::*;
use sheets::{Shape, Sheets};
use skin::Skin;
use std::cell::Cell;
use std::collections::HashSet;
use ways::Ways;

/// By what share of half the band sheets may be nearer for what the surface turns at corners, and how far off them places may be that they go by.
const TURNED: f64 = 0.3;
const OFF: f64 = 0.75;
/// How far out strips around borders are, and how near their sides and triangles, beyond the radius in units of half the band.
const RIM: f64 = 0.4;
const SIDE: f64 = -0.3;
const FACET: f64 = -0.7;
/// Rounds in which faults are mended.
const ROUNDS: usize = 5;
const IN_A_ROW: usize = 64;

/// The surface around figures that are the triangles of a surface that turns little, with coordinates that are rounded; none where they are not, or the proof does not come out.
///
/// # Errors
/// [`Stopped`].
pub(super) fn surface(
    figures: &[Figure],
    setting: &Setting,
    round: impl Fn(f64) -> f64 + Sync,
    budget: &Budget,
) -> Result<Option<Flat>, Stopped> {
    let Some(triangles) = figure::triangles(figures) else { return Ok(None) };
    let [inner, outer] = [setting.least + setting.slack, setting.outer - setting.slack];
    let half = 0.5 * (outer - inner);
    let radius = inner + half;
    let Some(skin) = Skin::new(&triangles, 1.0 - TURNED * half / radius, setting.slack) else { if std::env::var_os("TELL").is_some() { eprintln!("no skin"); } return Ok(None) };
    if BYTES_PER_TRIANGLE * triangles.len() as f64 > budget.limits.memory_bytes as f64 {
        return Ok(None);
    }
    let clock = std::time::Instant::now(); macro_rules! tell { ($($a:tt)*) => { if std::env::var_os("TELL").is_some() { eprintln!("{:.4} {}", clock.elapsed().as_secs_f64(), format!($($a)*)); } } }
    tell!("skin");
    let faces = Faces::new(skin.faces());
    tell!("faces");
    let ways = Ways { skin: &skin, faces: &faces, inner, outer };
    let out = ways.lead_out(budget)?; tell!("out {out}");
    if !out {
        return Ok(None);
    }
    let at = |share: f64| radius + share * half;
    let row = 2.0 * (at(SIDE) / at(RIM)).acos();
    let column = 2.0 * (at(FACET) / at(SIDE)).acos();
    let mut most = vec![OFF * half; skin.places.len()];
    let mut known: HashSet<[[u64; 3]; 3]> = HashSet::new();
    for round_number in 0..ROUNDS {
        let mut coarse = Coarse::new(&skin, radius, column.cos());
        coarse.run(&most, budget)?;
        let (names, left) = coarse.triangles(); tell!("coarse {} of {}", left.len(), skin.triangles.len());
        let finer = 1.0 / (1.0 + 0.25 * round_number as f64);
        let shape = Shape { radius, rim: at(RIM), row: row * finer, column: column * finer };
        let Some(sheets) = Sheets::new(&skin, &left, &shape, &round) else { return Ok(None) };
        let faults = faults(&sheets, &known, &skin, &faces, [inner, outer], budget)?;
        tell!("sheets {} faults {} rim {}", sheets.triangles.len(), faults.len(), faults.iter().filter(|f| sheets.owners[**f as usize]==NONE).count());
        if std::env::var_os("TELL").is_some() { for &f in faults.iter().take(6) { let c = sheets.triangles[f as usize].map(|c| sheets.vertices[c as usize]); let n = [1, 2].map(|k| crate::attractor::cell::subtract(&c[k], &c[0])); let l = (0..3).map(|k| crate::attractor::cell::distance_squared(&c[k], &c[(k+1)%3]).sqrt()).collect::<Vec<_>>(); let a = crate::attractor::cell::cross(&n[0], &n[1]); let area = crate::attractor::cell::dot(&a, &a).sqrt(); let o = [0; 3].map(|_| skin.around.at(sheets.feet[sheets.triangles[f as usize][0] as usize])[0]); let why = faces.fault_with(|_| None, &Question { triangle: c, owners: o, inner, outer }, &mut Memory::default()); eprintln!("  fault {l:?} height {} held {} {why:?}", area / l.iter().fold(0.0_f64, |a, b| a.max(*b)), sheets.owners[f as usize] == NONE); } }
        if !faults.is_empty() {
            for &fault in &faults {
                let owner = sheets.owners[fault as usize];
                if owner == NONE {
                    let corners = sheets.triangles[fault as usize];
                    corners.iter().for_each(|&corner| most[sheets.feet[corner as usize] as usize] *= 0.5);
                } else {
                    coarse.halve(names[owner as usize], &mut most);
                }
            }
            known = (0..sheets.triangles.len()).map(|triangle| sheets.name(triangle)).collect();
            faults.iter().for_each(|&fault| { known.remove(&sheets.name(fault as usize)); });
            continue;
        }
        let leave = ways.leave(&sheets, budget)?; tell!("leave {leave}");
        if !leave {
            return Ok(None);
        }
        let mut surface = BlockSurface { vertices: sheets.vertices, triangles: sheets.triangles, ..BlockSurface::default() };
        surface.drop_unused();
        let is_shown = is_embedded(&mut surface, budget)?; tell!("embedded {is_shown}"); let is_shown = is_shown && holds(&surface, &skin); tell!("holds {is_shown}");
        return Ok(is_shown.then(|| Flat::Made(Box::new(surface))));
    }
    Ok(None)
}

/// The triangles of sheets that are not between two distances from faces.
fn faults(sheets: &Sheets, known: &HashSet<[[u64; 3]; 3]>, skin: &Skin, faces: &Faces, [inner, outer]: [f64; 2], budget: &Budget) -> Result<Vec<u32>, Stopped> {
    let numbers: Vec<u32> = (0..sheets.triangles.len()).filter(|&triangle| !known.contains(&sheets.name(triangle))).map(|triangle| triangle as u32).collect();
    let look = |row: &[u32]| {
        budget.cancel.check()?;
        let mut memory = Memory::default();
        let is_fault = |&&number: &&u32| {
            let corners = sheets.triangles[number as usize];
            let triangle = corners.map(|corner| sheets.vertices[corner as usize]);
            let owners = corners.map(|corner| skin.around.at(sheets.feet[corner as usize])[0]);
            let question = Question { triangle, owners, inner, outer };
            let last = Cell::new(owners[0]);
            let offer = |place: &Point| {
                last.set(skin.near(last.get(), place));
                Some(last.get())
            };
            faces.fault_with(offer, &question, &mut memory).is_some()
        };
        Ok(row.iter().filter(is_fault).copied().collect())
    };
    let all: Vec<Vec<u32>> = numbers.par_chunks(IN_A_ROW).map(look).collect::<Result<_, Stopped>>()?;
    Ok(all.concat())
}

/// Whether a closed surface holds all of another that it does not meet.
fn holds(surface: &BlockSurface, skin: &Skin) -> bool {
    let vertices = surface.vertices.iter().copied().map(DVec3::from_array).collect();
    let mesh = TriMesh { vertices, triangles: surface.triangles.clone() };
    let inside = Inside::new(&mesh);
    let groups = Groups::of_triangles(skin.places.len(), &skin.triangles).all();
    // A group is called by the least of its vertices.
    let mut firsts = (0..).zip(&groups).filter(|&(vertex, &group)| vertex == group).map(|(vertex, _)| skin.places[vertex as usize]);
    firsts.all(|place| inside.winding(DVec3::from_array(place)) == 1)
}
