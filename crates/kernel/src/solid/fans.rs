//! Doubling of corners where parts of a solid meet without being joined: along edges with four or more triangles, and at corners with several fans.

use super::contact::{side, turn, view};
use crate::attractor::cell::Point;
use crate::budget::{Budget, Stopped};
use crate::groups::Groups;
use rayon::prelude::*;
use std::cmp::Ordering;

/// A surface whose corners are doubled.
pub(crate) struct Apart {
    /// Of every corner, which one it was before.
    pub(crate) origins: Vec<u32>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// The next half-edge 3 t + k of a triangle.
fn next(half: u32) -> u32 {
    if half % 3 == 2 { half - 2 } else { half + 1 }
}

/// Around an edge with 2 k triangles, those are joined that bound the same wedge of material; every fan of triangles that are joined around a corner then gets
/// a corner of its own. The set of points that the surface bounds stays the same. Signs are exact. Cost: n log n.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn part(position: &impl Fn(u32) -> Point, triangles: &[[u32; 3]], budget: &Budget) -> Result<Apart, Stopped> {
    let corner = |half: u32| triangles[half as usize / 3][half as usize % 3];
    let mut halves: Vec<([u32; 2], u32)> = (0..3 * triangles.len() as u32)
        .into_par_iter()
        .map(|half| {
            let (from, to) = (corner(half), corner(next(half)));
            ([from.min(to), from.max(to)], half)
        })
        .collect();
    budget.cancel.check()?;
    halves.par_sort_unstable();
    let mut corners = Groups::new(3 * triangles.len());
    let mut around = Vec::new();
    for (index, edge) in halves.chunk_by(|a, b| a.0 == b.0).enumerate() {
        if index % 8192 == 0 {
            budget.cancel.check()?;
        }
        around.clear();
        around.extend(edge.iter().map(|(_, half)| *half));
        if around.len() > 2 {
            sort_around(position, triangles, edge[0].0, &mut around);
        }
        let forward = |half: u32| corner(half) == edge[0].0[0];
        let count = around.len();
        for place in 0..count {
            // Counter-clockwise from a triangle that runs backwards lies material, up to the next one, which must run forwards.
            let (one, other) = (around[place], around[(place + 1) % count]);
            if !forward(one) && forward(other) {
                corners.join(one as usize, next(other) as usize);
                corners.join(next(one) as usize, other as usize);
            }
        }
    }
    let mut numbers = vec![u32::MAX; 3 * triangles.len()];
    let mut parted = Apart { origins: Vec::new(), triangles: Vec::with_capacity(triangles.len()) };
    for half in 0..3 * triangles.len() as u32 {
        let group = corners.of(half as usize) as usize;
        if numbers[group] == u32::MAX {
            numbers[group] = parted.origins.len() as u32;
            parted.origins.push(corner(half));
        }
        numbers[half as usize] = numbers[group];
    }
    parted.triangles.extend(numbers.as_chunks::<3>().0);
    Ok(parted)
}

/// Sorts the triangles around an edge counter-clockwise as seen against its direction, from the first one on.
fn sort_around(position: &impl Fn(u32) -> Point, triangles: &[[u32; 3]], [from, to]: [u32; 2], halves: &mut [u32]) {
    let apex = |half: u32| position(triangles[half as usize / 3][next(next(half)) as usize % 3]);
    let (a, b) = (position(from), position(to));
    let first = apex(halves[0]);
    // Positive where d lies counter-clockwise from c: det(b - a, c - a, d - a) > 0.
    let turns = |c: &[f64; 3], d: &[f64; 3]| -side(&a, &b, c, d);
    let axis = view(&[a, b, first]).unwrap_or(0);
    let opposite = |d: &[f64; 3]| (turn(axis, &a, &b, d) > 0.0) != (turn(axis, &a, &b, &first) > 0.0);
    // 0: the first's own half plane; 1: within half a turn of it; 2: opposite; 3: beyond.
    let sector = |d: &[f64; 3]| match turns(&first, d) {
        x if x > 0.0 => 1,
        x if x < 0.0 => 3,
        _ if opposite(d) => 2,
        _ => 0,
    };
    halves.sort_by(|&p, &q| {
        let (p, q) = (apex(p), apex(q));
        sector(&p).cmp(&sector(&q)).then_with(|| turns(&q, &p).partial_cmp(&0.0).unwrap_or(Ordering::Equal))
    });
}
