//! Joining block surfaces into one: vertices that several blocks made are found by their names, never by their position.

use super::surface::{BlockSurface, VertexName};
use crate::budget::{Budget, Stopped};
use rayon::prelude::*;

/// Joins the surfaces; vertices and triangles keep the blocks' order, a shared vertex belongs to the first block that has it and is settled if it is everywhere.
pub(super) fn join(mut surfaces: Vec<BlockSurface>, budget: &Budget) -> Result<BlockSurface, Stopped> {
    if surfaces.len() == 1 {
        return Ok(surfaces.remove(0));
    }
    let mut shared: Vec<(VertexName, u32, u32)> = surfaces
        .iter()
        .enumerate()
        .flat_map(|(index, surface)| surface.shared.iter().map(move |&(name, number)| (name, index as u32, number)))
        .collect();
    shared.par_sort_unstable();
    budget.cancel.check()?;
    // Where a vertex of a surface that is not its own is to be found: surface and number.
    let mut elsewhere: Vec<Vec<(u32, u32, u32)>> = vec![Vec::new(); surfaces.len()];
    for same in shared.chunk_by(|a, b| a.0 == b.0) {
        let (_, owner, original) = same[0];
        for &(_, surface, number) in &same[1..] {
            elsewhere[surface as usize].push((number, owner, original));
        }
    }
    let vertices: usize = surfaces.iter().zip(&elsewhere).map(|(surface, elsewhere)| surface.vertices.len() - elsewhere.len()).sum();
    let triangles = surfaces.iter().map(|surface| surface.triangles.len()).sum();
    let mut joined = BlockSurface {
        first_cube: surfaces.first().map_or([0; 3], |surface| surface.first_cube),
        vertices: Vec::with_capacity(vertices),
        triangles: Vec::with_capacity(triangles),
        settled: Vec::with_capacity(vertices),
        ..BlockSurface::default()
    };
    let mut places: Vec<Vec<u32>> = Vec::with_capacity(surfaces.len());
    for (surface, mut elsewhere) in surfaces.iter_mut().zip(elsewhere) {
        budget.cancel.check()?;
        elsewhere.sort_unstable();
        let mut next = elsewhere.into_iter().peekable();
        let mut own = Vec::with_capacity(surface.vertices.len());
        for (number, vertex) in surface.vertices.iter().enumerate() {
            if let Some((_, owner, original)) = next.next_if(|&(foreign, ..)| foreign as usize == number) {
                own.push(places[owner as usize][original as usize]);
            } else {
                own.push(joined.vertices.len() as u32);
                joined.vertices.push(*vertex);
                joined.settled.push(surface.settled.get(number).copied().unwrap_or(false));
            }
        }
        joined.triangles.extend(surface.triangles.iter().map(|triangle| triangle.map(|corner| own[corner as usize])));
        joined.leaves += surface.leaves;
        joined.site_error = joined.site_error.max(surface.site_error);
        // Memory is given back block by block while the mesh grows.
        *surface = BlockSurface::default();
        places.push(own);
    }
    joined.shared.extend(shared.chunk_by(|a, b| a.0 == b.0).map(|same| (same[0].0, places[same[0].1 as usize][same[0].2 as usize])));
    Ok(joined)
}
