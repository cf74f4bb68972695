//! Small holes closed: borders that are one loop each, by triangles between their corners.
//!
//! Of all ways to triangulate a loop the one of least area is taken, found for runs of its corners from short ones to the whole (Barequet and Sharir, "Filling gaps in
//! the boundary of a polyhedron", 1995). What would spoil the surface is left out and another way sought: triangles without area or with the corners of one that is
//! there, edges that are there already, and triangles that meet others elsewhere than in common corners and edges, by exact signs. So a filling adds no crossing, and
//! every edge of it has two triangles. A hole is no more than small: of at most [`MOST_EDGES`] edges, all fillings together of at most [`MOST_AREA`] of the area there
//! is. Nothing tells a larger one from the open side of a bowl.

use super::super::box_tree::{Box32, BoxTree};
use super::super::contact::meet;
use super::clean::{edges, is_without_area};
use super::{RepairError, Unfilled};
use crate::budget::Budget;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// Edges of a loop, at most.
const MOST_EDGES: usize = 64;
/// Area of all fillings against that of the surface, at most.
const MOST_AREA: f64 = 0.25;
/// Ways to fill a loop that are tried.
const MOST_WAYS: usize = 256;

/// What was filled.
#[derive(Default)]
pub(super) struct Filled {
    pub(super) holes: u64,
    pub(super) triangles: u64,
    /// Edges of the longest loop.
    pub(super) longest: u64,
}

/// Fills all holes, or none and tells the first that cannot be. A border that is no loop, as it passes a corner twice, is left, and so are all where an edge has three triangles
/// or more of an odd number. Cost: n log n, and for a loop of m edges m^3 for every way that is tried.
pub(super) fn fill(vertices: &[DVec3], triangles: &mut Vec<[u32; 3]>, budget: &Budget) -> Result<Filled, RepairError> {
    let Some(loops) = loops(triangles) else { return Ok(Filled::default()) };
    let mut filled = Filled::default();
    if loops.is_empty() {
        return Ok(filled);
    }
    let at = |corner: u32| vertices[corner as usize];
    let unfilled = |border: &[u32], reason: Unfilled| RepairError::Hole { edges: border.len() as u64, at: at(border[0]), reason };
    let mut surface = Surface::new(vertices, triangles);
    for border in &loops {
        if border.len() > MOST_EDGES {
            return Err(unfilled(border, Unfilled::Long { most: MOST_EDGES as u64 }));
        }
        let made = surface.filling(border, budget)?.ok_or_else(|| unfilled(border, Unfilled::Crossing))?;
        filled.holes += 1;
        filled.triangles += made.len() as u64;
        filled.longest = filled.longest.max(border.len() as u64);
        surface.new.extend(made);
    }
    let area = |triangles: &[[u32; 3]]| triangles.iter().map(|corners| area(corners.map(at))).sum::<f64>();
    let (new, given) = (area(&surface.new), area(surface.triangles));
    if new > MOST_AREA * given {
        let longest = loops.iter().rev().max_by_key(|border| border.len()).unwrap_or(&loops[0]);
        return Err(unfilled(longest, Unfilled::Large { share: new / given, most: MOST_AREA }));
    }
    let new = surface.new;
    triangles.extend(new);
    Ok(filled)
}

fn area([a, b, c]: [DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

/// The loops of edges with one triangle, against its direction: each from its lowest corner, in the order of these. `None` where a corner has more than two such
/// edges, or another edge has an odd number of triangles.
fn loops(triangles: &[[u32; 3]]) -> Option<Vec<Vec<u32>>> {
    let mut halves: Vec<([u32; 2], [u32; 2])> = triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|[from, to]| ([from.min(to), from.max(to)], [from, to]))
        .collect();
    halves.sort_unstable();
    // Of every corner those before and after it.
    let mut beside: BTreeMap<u32, Vec<(u32, bool)>> = BTreeMap::new();
    for edge in halves.chunk_by(|p, q| p.0 == q.0) {
        match edge {
            [(_, [from, to])] => {
                beside.entry(*to).or_default().push((*from, true));
                beside.entry(*from).or_default().push((*to, false));
            }
            _ if edge.len().is_multiple_of(2) => {}
            _ => return None,
        }
    }
    if beside.values().any(|beside| beside.len() != 2) {
        return None;
    }
    let (mut met, mut loops) = (BTreeSet::new(), Vec::new());
    for (&start, first) in &beside {
        if met.contains(&start) {
            continue;
        }
        let (mut border, mut last) = (vec![start], start);
        // Triangles that run in different directions leave the choice open.
        let mut next = first.iter().find(|(_, forward)| *forward).unwrap_or(&first[0]).0;
        while next != start {
            border.push(next);
            let after = &beside[&next];
            let onward = if after[0].0 == last { after[1].0 } else { after[0].0 };
            (last, next) = (next, onward);
        }
        met.extend(border.iter().copied());
        loops.push(border);
    }
    Some(loops)
}

/// The surface that is there, and the fillings so far.
struct Surface<'m> {
    vertices: &'m [DVec3],
    triangles: &'m [[u32; 3]],
    edges: Vec<[u32; 2]>,
    tree: BoxTree,
    new: Vec<[u32; 3]>,
}

impl<'m> Surface<'m> {
    fn new(vertices: &'m [DVec3], triangles: &'m [[u32; 3]]) -> Self {
        let mut tree = BoxTree::default();
        let places = |triangle: u32| triangles[triangle as usize].map(|corner| vertices[corner as usize].to_array());
        tree.build(triangles.len(), |triangle| Some(Box32::of(&places(triangle))), true);
        let mut known: Vec<[u32; 2]> = triangles.iter().copied().flat_map(edges).collect();
        known.sort_unstable();
        Self { vertices, triangles, edges: known, tree, new: Vec::new() }
    }

    /// Triangles that fill a loop and meet nothing else; `None` where none were found.
    fn filling(&self, border: &[u32], budget: &Budget) -> Result<Option<Vec<[u32; 3]>>, RepairError> {
        let mut banned = BTreeSet::new();
        for _ in 0..MOST_WAYS {
            budget.cancel.check()?;
            let Some(made) = self.least(border, &banned) else { return Ok(None) };
            let before = banned.len();
            for (index, own) in made.iter().enumerate() {
                if self.meets(own) || made[..index].iter().chain(&self.new).any(|other| self.meet(own, other)) {
                    banned.insert(*own);
                }
            }
            if banned.len() == before {
                return Ok(Some(made));
            }
        }
        Ok(None)
    }

    fn places(&self, corners: &[u32; 3]) -> [[f64; 3]; 3] {
        corners.map(|corner| self.vertices[corner as usize].to_array())
    }

    fn meet(&self, a: &[u32; 3], b: &[u32; 3]) -> bool {
        meet([a, b], [&self.places(a), &self.places(b)])
    }

    /// Whether a triangle meets one of the surface elsewhere than in common corners and edges, or is one of them.
    fn meets(&self, own: &[u32; 3]) -> bool {
        let wanted = Box32::of(&self.places(own));
        let mut found = false;
        self.tree.query(&wanted, 0, |leaf| {
            for (&other, around) in self.tree.items(leaf).iter().zip(self.tree.boxes(leaf)) {
                let corners = &self.triangles[other as usize];
                found |= around.meets(&wanted) && (corners.iter().all(|corner| own.contains(corner)) || self.meet(own, corners));
            }
            !found
        });
        found
    }

    /// The triangulation of least area without what is banned: for every run of corners, from one to another, the corner between that its last edge makes a triangle with.
    fn least(&self, border: &[u32], banned: &BTreeSet<[u32; 3]>) -> Option<Vec<[u32; 3]>> {
        let count = border.len();
        let mut best = vec![vec![(f64::INFINITY, 0); count]; count];
        (0..count - 1).for_each(|k| best[k][k + 1].0 = 0.0);
        for length in 2..count {
            for from in 0..count - length {
                let to = from + length;
                let ends = [border[from].min(border[to]), border[from].max(border[to])];
                // The last run is closed by the loop's own edge.
                if length < count - 1 && self.edges.binary_search(&ends).is_ok() {
                    continue;
                }
                for between in from + 1..to {
                    let corners = [border[from], border[between], border[to]];
                    let rest = best[from][between].0 + best[between][to].0;
                    if rest == f64::INFINITY || banned.contains(&corners) || is_without_area(self.vertices, corners) {
                        continue;
                    }
                    let whole = rest + area(corners.map(|corner| self.vertices[corner as usize]));
                    if whole < best[from][to].0 {
                        best[from][to] = (whole, between);
                    }
                }
            }
        }
        (best[0][count - 1].0 < f64::INFINITY).then(|| {
            let (mut made, mut runs) = (Vec::new(), vec![[0, count - 1]]);
            while let Some([from, to]) = runs.pop() {
                if to - from >= 2 {
                    let between = best[from][to].1;
                    made.push([border[from], border[between], border[to]]);
                    runs.extend([[between, to], [from, between]]);
                }
            }
            made
        })
    }
}
