//! What is wrong with single triangles and with names of vertices, undone: vertices at one place, triangles without area, copies.

use super::super::contact::is_flat;
use super::super::topology::has_no_area;
use crate::groups::Groups;
use glam::DVec3;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

/// The edges of a triangle, each with the lower end first.
pub(super) fn edges([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]].map(|[from, to]| [from.min(to), from.max(to)])
}

/// Gives triangles the lowest vertex at the place of each corner: how many vertices are no longer used. The two zeros are one number. Cost: n log n.
pub(super) fn join(vertices: &[DVec3], triangles: &mut [[u32; 3]]) -> u64 {
    let place = |vertex: u32| vertices[vertex as usize].to_array().map(|x| x + 0.0);
    let compare = |&p: &u32, &q: &u32| {
        let by_place = place(p).iter().zip(place(q)).map(|(x, y)| x.total_cmp(&y)).find(|order| order.is_ne());
        by_place.unwrap_or(Ordering::Equal).then(p.cmp(&q))
    };
    let mut used = vec![false; vertices.len()];
    triangles.iter().flatten().for_each(|&corner| used[corner as usize] = true);
    let mut order: Vec<u32> = (0..vertices.len() as u32).filter(|&vertex| used[vertex as usize]).collect();
    order.par_sort_unstable_by(compare);
    let mut lowest: Vec<u32> = (0..vertices.len() as u32).collect();
    let mut joined = 0;
    for same in order.chunk_by(|&p, &q| place(p) == place(q)) {
        same.iter().for_each(|&vertex| lowest[vertex as usize] = same[0]);
        joined += same.len() as u64 - 1;
    }
    triangles.iter_mut().flatten().for_each(|corner| *corner = lowest[*corner as usize]);
    joined
}

/// Takes away triangles that name a vertex twice: how many.
pub(super) fn remove_collapsed(triangles: &mut Vec<[u32; 3]>) -> u64 {
    let before = triangles.len();
    triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    (before - triangles.len()) as u64
}

/// Rounds of taking away triangles without area, at most: what a round leaves or makes is looked at in the next.
const ROUNDS: usize = 8;

/// Takes away triangles with three corners in a line: how many. There must be no copies. The surface as a set stays: where such a triangle fills the crack between its longest edge and the two
/// others, the triangles across the longest edge are cut at the corner that lies on it. What has only its like across may stay. Cost: n log n where there are
/// any.
pub(super) fn remove_flat(vertices: &[DVec3], triangles: &mut Vec<[u32; 3]>) -> u64 {
    let mut removed = 0;
    let mut waiting: Vec<u32> = (0..triangles.len() as u32).filter(|&t| is_without_area(vertices, triangles[t as usize])).collect();
    if waiting.is_empty() {
        return removed;
    }
    let mut at_edge: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
    for (index, corners) in triangles.iter().enumerate() {
        edges(*corners).iter().for_each(|edge| at_edge.entry(*edge).or_default().push(index as u32));
    }
    let mut gone = vec![false; triangles.len()];
    for _ in 0..ROUNDS {
        for one in std::mem::take(&mut waiting) {
            let (edge, middle) = longest_edge(vertices, triangles[one as usize]);
            let across: Vec<u32> = at_edge[&edge].iter().copied().filter(|&other| other != one).collect();
            // With an even number across, the edge is none of a closed surface, or not without this triangle.
            let cuts = across.len() % 2 == 1;
            if cuts && across.iter().any(|&other| is_without_area(vertices, triangles[other as usize])) {
                waiting.push(one);
                continue;
            }
            let mut name = |index: u32, corners: [u32; 3], is_there: bool| {
                for edge in edges(corners) {
                    let named = at_edge.entry(edge).or_default();
                    if is_there { named.push(index) } else { named.retain(|&other| other != index) }
                }
            };
            name(one, triangles[one as usize], false);
            gone[one as usize] = true;
            removed += 1;
            for other in across.into_iter().filter(|_| cuts) {
                let whole = triangles[other as usize];
                name(other, whole, false);
                // Either half has the middle in the place of one end of the edge.
                let halves = edge.map(|end| whole.map(|corner| if corner == end { middle } else { corner }));
                for (index, half) in [other, triangles.len() as u32].into_iter().zip(halves) {
                    name(index, half, true);
                    if is_without_area(vertices, half) {
                        waiting.push(index);
                    }
                }
                triangles[other as usize] = halves[0];
                triangles.push(halves[1]);
                gone.push(false);
            }
        }
    }
    let mut gone = gone.into_iter();
    triangles.retain(|_| gone.next() == Some(false));
    removed
}

/// Whether a triangle has no area, exactly or in double precision.
pub(super) fn is_without_area(vertices: &[DVec3], corners: [u32; 3]) -> bool {
    let points = corners.map(|corner| vertices[corner as usize]);
    has_no_area(points) || is_flat(&points.map(|point| point.to_array()))
}

/// The longest edge of a triangle without area, and the corner on it: the middle one in the order of coordinates, which along a line is that of the line.
fn longest_edge(vertices: &[DVec3], mut corners: [u32; 3]) -> ([u32; 2], u32) {
    let place = |corner: &u32| vertices[*corner as usize].to_array();
    corners.sort_by(|p, q| place(p).partial_cmp(&place(q)).unwrap_or(Ordering::Equal));
    let [a, middle, b] = corners;
    ([a.min(b), a.max(b)], middle)
}

/// Takes away copies, that is, triangles with the same corners in any order: how many. Of an odd number one stays. Of an even number, which may be one triangle
/// copied or a wall between two pieces that fill the space on both of its sides, one stays unless edges have an even number of triangles without it and an odd
/// number with it: this is decided for all such triangles that hang together by edges. Cost: n log n.
pub(super) fn remove_copies(triangles: &mut Vec<[u32; 3]>) -> u64 {
    let key = |index: u32| {
        let mut corners = triangles[index as usize];
        corners.sort_unstable();
        corners
    };
    let mut order: Vec<([u32; 3], u32)> = (0..triangles.len() as u32).into_par_iter().map(|index| (key(index), index)).collect();
    order.par_sort_unstable();
    let mut stays = vec![true; triangles.len()];
    let mut doubtful = Vec::new();
    for copies in order.chunk_by(|p, q| p.0 == q.0).filter(|copies| copies.len() > 1) {
        copies[1..].iter().for_each(|(_, index)| stays[*index as usize] = false);
        if copies.len().is_multiple_of(2) {
            doubtful.push(copies[0].1);
        }
    }
    drop(order);
    // Of every edge of doubtful triangles: the first of them, how many they are, and how many others there are.
    let mut at_edge: BTreeMap<[u32; 2], (u32, u64, u64)> = BTreeMap::new();
    let mut patches = Groups::new(doubtful.len());
    for (number, &index) in doubtful.iter().enumerate() {
        for edge in edges(triangles[index as usize]) {
            let (first, count, _) = at_edge.entry(edge).or_insert((number as u32, 0, 0));
            patches.join(*first as usize, number);
            *count += 1;
        }
    }
    if !doubtful.is_empty() {
        let is_doubtful: BTreeSet<u32> = doubtful.iter().copied().collect();
        let others = |(index, _): &(usize, &[u32; 3])| stays[*index] && !is_doubtful.contains(&(*index as u32));
        for (_, corners) in triangles.iter().enumerate().filter(others) {
            for edge in edges(*corners) {
                if let Some((_, _, others)) = at_edge.get_mut(&edge) {
                    *others += 1;
                }
            }
        }
    }
    // Whether all edges of a patch are even without it, and with it.
    let mut even = vec![[true; 2]; doubtful.len()];
    for &(first, count, others) in at_edge.values() {
        let patch = &mut even[patches.of(first as usize) as usize];
        patch[0] &= others.is_multiple_of(2);
        patch[1] &= (others + count).is_multiple_of(2);
    }
    for (number, &index) in doubtful.iter().enumerate() {
        stays[index as usize] = even[patches.of(number) as usize] != [true, false];
    }
    let before = triangles.len();
    let mut stays = stays.into_iter();
    triangles.retain(|_| stays.next() == Some(true));
    (before - triangles.len()) as u64
}
