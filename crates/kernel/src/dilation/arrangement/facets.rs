//! From the edges of a union of polytopes to its boundary: the pieces around every facet are joined to loops, and what these bound is cut into triangles.

use super::pieces::{Name, Piece};
use super::polytopes::{Polytopes, frame, normal};
use super::triangulate::{Planar, triangulate};
use crate::attractor::cell::{Point, dot};
use crate::budget::{Budget, Stopped};
use crate::dilation::surface::NameMap;
use rayon::prelude::*;

/// The boundary of a union of polytopes.
#[derive(Debug, Default)]
pub(super) struct Boundary {
    pub(super) points: Vec<Point>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// An edge with a facet to its left.
#[derive(Clone, Copy, Debug)]
struct Edge {
    facet: u32,
    ends: [u32; 2],
}

/// The boundary with these edges; `None` where they do not close, which rounding may bring about.
///
/// # Errors
/// [`Stopped`].
pub(super) fn boundary(polytopes: &Polytopes, parts: Vec<Vec<Piece>>, budget: &Budget) -> Result<Option<Boundary>, Stopped> {
    let count: usize = parts.iter().map(Vec::len).sum();
    let mut numbers: NameMap<Name, u32> = NameMap::with_capacity_and_hasher(2 * count / 3, Default::default());
    let mut points: Vec<Point> = Vec::with_capacity(2 * count / 3);
    let mut edges: Vec<Edge> = Vec::with_capacity(2 * count);
    for (index, part) in parts.into_iter().enumerate() {
        if index % 1024 == 0 {
            budget.cancel.check()?;
        }
        for Piece { facets: [left, right], ends, places } in part {
            let number = |end: usize| {
                *numbers.entry(ends[end]).or_insert_with(|| {
                    points.push(places[end]);
                    points.len() as u32 - 1
                })
            };
            let [from, to] = [0, 1].map(number);
            edges.extend([Edge { facet: left, ends: [from, to] }, Edge { facet: right, ends: [to, from] }]);
        }
    }
    drop(numbers);
    edges.par_sort_unstable_by_key(|edge| (edge.facet, edge.ends));
    budget.cancel.check()?;
    let starts: Vec<usize> = (0..edges.len()).filter(|&at| at == 0 || edges[at - 1].facet != edges[at].facet).collect();
    let ends: Vec<usize> = starts.iter().skip(1).copied().chain([edges.len()]).collect();
    let cut = |planar: &mut Planar, (&start, &end): (&usize, &usize)| {
        budget.cancel.check()?;
        let own = &edges[start..end];
        let [u, v, _] = frame(&normal(polytopes.plane(own[0].facet)));
        let flat = |vertex: u32| [&u, &v].map(|axis| dot(axis, &points[vertex as usize]));
        let mut triangles = Vec::new();
        Ok((loops(own, &mut planar.loops) && triangulate(planar, flat, &mut triangles)).then_some(triangles))
    };
    let cut: Vec<Option<Vec<[u32; 3]>>> = starts.par_iter().zip(&ends).map_init(Planar::default, cut).collect::<Result<_, Stopped>>()?;
    if cut.iter().any(Option::is_none) {
        return Ok(None);
    }
    let triangles = cut.into_iter().flatten().flatten().collect();
    Ok(Some(Boundary { points, triangles }))
}

/// Joins a facet's edges, which are ordered by their first ends, to loops; whether they close, and meet in no vertex twice.
fn loops(edges: &[Edge], loops: &mut Vec<Vec<u32>>) -> bool {
    loops.clear();
    let mut is_used = vec![false; edges.len()];
    if edges.windows(2).any(|pair| pair[0].ends[0] == pair[1].ends[0]) {
        return false;
    }
    for start in 0..edges.len() {
        if is_used[start] {
            continue;
        }
        let (mut vertices, mut at) = (Vec::new(), start);
        while !std::mem::replace(&mut is_used[at], true) {
            vertices.push(edges[at].ends[0]);
            let Ok(next) = edges.binary_search_by_key(&edges[at].ends[1], |edge| edge.ends[0]) else { return false };
            at = next;
        }
        if at != start || vertices.len() < 3 {
            return false;
        }
        loops.push(vertices);
    }
    true
}
