//! Stars that have triangles in several blocks, looked at when all blocks are there.

use super::lattice::{Cube, Grading, around};
use super::setting::Setting;
use super::star::{Incident, Star, note};
use super::surface::{BlockSurface, Blocks, Seam};
use crate::budget::{Budget, Stopped};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// A block's surface, and its triangles around the vertices that others may have.
struct Part<'a> {
    surface: &'a BlockSurface,
    incident: Incident,
}

impl<'a> Part<'a> {
    fn new(surface: &'a BlockSurface) -> Self {
        let mut is_shared = Vec::new();
        surface.list_shared(&mut is_shared);
        let mut incident = Incident::default();
        incident.list(&surface.triangles, &is_shared);
        Self { surface, incident }
    }
}

/// What has to be subdivided, and what no level tells, at the seams between blocks of which one was made anew.
pub(super) fn noted(
    setting: &Setting,
    grading: &Grading,
    blocks: &mut Blocks,
    made: &BTreeSet<[i64; 3]>,
    budget: &Budget,
) -> Result<[Vec<Cube>; 2], Stopped> {
    let surfaces: BTreeMap<[i64; 3], &BlockSurface> =
        blocks.iter_mut().filter_map(|(&block, surface)| Some((block, &*surface.get_mut().ok()?))).collect();
    let touched = |block: &[i64; 3]| around(*block).any(|near| made.contains(&near));
    let mut seams: Vec<([i64; 3], &Seam)> = surfaces
        .iter()
        .filter(|(block, surface)| !surface.seams.is_empty() && touched(block))
        .flat_map(|(&block, surface)| surface.seams.iter().map(move |seam| (block, seam)))
        .collect();
    // What several blocks have noted is asked once.
    seams.sort_unstable_by_key(|&(block, seam)| (seam.name, block));
    seams.dedup_by_key(|&mut (_, seam)| seam.name);
    seams.sort_unstable_by_key(|&(block, seam)| (block, seam.name));
    let needed: BTreeSet<[i64; 3]> = seams.iter().flat_map(|&(block, _)| around(block)).collect();
    let parts: BTreeMap<[i64; 3], Part<'_>> =
        surfaces.par_iter().filter(|(block, _)| needed.contains(*block)).map(|(&block, &surface)| (block, Part::new(surface))).collect();
    let look = |own: &[([i64; 3], &Seam)]| -> Result<[Vec<Cube>; 2], Stopped> {
        budget.cancel.check()?;
        let (mut star, mut critical, mut uncertain) = (Star::default(), Vec::new(), Vec::new());
        let Some(&(block, _)) = own.first() else { return Ok([critical, uncertain]) };
        let near: Vec<&Part<'_>> = around(block).filter_map(|near| parts.get(&near)).collect();
        let sites = surfaces.get(&block).map_or(&[][..], |surface| &surface.seam_sites);
        for &(_, seam) in own {
            let mut is_begun = false;
            for part in &near {
                let Part { surface, incident } = part;
                let Some(vertex) = surface.number_of(seam.name) else { continue };
                if !is_begun {
                    star.reset(setting, surface.vertices[vertex as usize]);
                    star.sites.extend(seam.sites.iter().map(|&site| sites[site as usize]));
                    is_begun = true;
                }
                for &triangle in incident.of(vertex) {
                    let corners = surface.triangles[triangle as usize].map(|corner| surface.vertices[corner as usize]);
                    star.add(setting, corners, surface.normals[triangle as usize]);
                }
            }
            if is_begun && !star.grows(setting) {
                note(setting, grading, &star.centre, &mut critical, &mut uncertain);
            }
        }
        Ok([critical, uncertain])
    };
    let by_block: Vec<&[([i64; 3], &Seam)]> = seams.chunk_by(|a, b| a.0 == b.0).collect();
    let noted: Vec<[Vec<Cube>; 2]> = by_block.into_par_iter().map(look).collect::<Result<_, _>>()?;
    Ok([0, 1].map(|kind| noted.iter().flat_map(|own| &own[kind]).copied().collect()))
}
