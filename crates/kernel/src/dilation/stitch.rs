//! Joining block surfaces into one mesh: vertices on shared edges are found by the edge's number, never
//! by their position.

use super::block::{BlockSurface, ForeignVertex, SIDE};
use crate::budget::{Budget, Stopped};
use crate::solid::TriMesh;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// An edge, by the first cube of the block that owns it and its key there.
type EdgeName = ([i64; 3], u32);

/// Joins the surfaces; vertices and triangles keep the blocks' order. Vertices on edges whose owner has no
/// tetrahedron at them (edges on its lower sides) come last, in the order of the edges' names.
pub(super) fn join(mut surfaces: Vec<BlockSurface>, budget: &Budget) -> Result<TriMesh, Stopped> {
    budget.report("stitch", 0.0, 0);
    let places: BTreeMap<[i64; 3], usize> = surfaces.iter().enumerate().map(|(index, surface)| (surface.first_cube, index)).collect();
    let mut offsets = Vec::with_capacity(surfaces.len());
    let mut total = 0_u32;
    for surface in &surfaces {
        offsets.push(total);
        total += surface.vertices.len() as u32;
    }
    let owned = |name: &EdgeName| -> Option<u32> {
        let index = *places.get(&name.0)?;
        let shared = &surfaces[index].shared;
        shared.binary_search_by_key(&name.1, |&(key, _)| key).ok().map(|at| offsets[index] + shared[at].1)
    };
    let found: Vec<Vec<Option<u32>>> =
        surfaces.par_iter().map(|surface| surface.foreign.iter().map(|vertex| owned(&name(surface, vertex))).collect()).collect();
    budget.cancel.check()?;
    let mut orphans: Vec<(EdgeName, [f32; 3])> = surfaces
        .iter()
        .zip(&found)
        .flat_map(|(surface, found)| {
            surface
                .foreign
                .iter()
                .zip(found)
                .filter(|(_, found)| found.is_none())
                .map(|(vertex, _)| (name(surface, vertex), vertex.position))
        })
        .collect();
    orphans.par_sort_unstable_by_key(|orphan| orphan.0);
    orphans.dedup_by_key(|orphan| orphan.0);
    budget.cancel.check()?;
    let vertices = total as usize + orphans.len();
    let triangles = surfaces.iter().map(|surface| surface.triangles.len()).sum();
    let mut mesh = TriMesh { vertices: Vec::with_capacity(vertices), triangles: Vec::with_capacity(triangles) };
    let position = |vertex: &[f32; 3]| DVec3::from_array(vertex.map(f64::from));
    for ((surface, found), &offset) in surfaces.iter_mut().zip(&found).zip(&offsets) {
        budget.cancel.check()?;
        let foreign: Vec<u32> = surface
            .foreign
            .iter()
            .zip(found)
            .map(|(vertex, found)| {
                let orphan = |name: EdgeName| total + orphans.binary_search_by_key(&name, |orphan| orphan.0).unwrap_or(0) as u32;
                found.unwrap_or_else(|| orphan(name(surface, vertex)))
            })
            .collect();
        let own = surface.vertices.len() as u32;
        let place = |corner: u32| if corner < own { offset + corner } else { foreign[(corner - own) as usize] };
        mesh.vertices.extend(surface.vertices.iter().map(position));
        mesh.triangles.extend(surface.triangles.iter().map(|triangle| triangle.map(place)));
        // Memory is given back block by block while the mesh grows.
        *surface = BlockSurface::default();
    }
    mesh.vertices.extend(orphans.iter().map(|(_, vertex)| position(vertex)));
    budget.report("stitch", 1.0, mesh.triangles.len() as u64);
    Ok(mesh)
}

fn name(surface: &BlockSurface, vertex: &ForeignVertex) -> EdgeName {
    let owner = std::array::from_fn(|axis| surface.first_cube[axis] + SIDE as i64 * i64::from(vertex.block >> axis & 1));
    (owner, vertex.key)
}
