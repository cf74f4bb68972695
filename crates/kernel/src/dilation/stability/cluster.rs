//! Clusters of touching cubes that may hold critical points, and proofs that they do.
//!
//! Let N be a cluster and G(x) the hull of x - a, a the closest points of x. G is upper semicontinuous with convex values, and 0 is in G(x)
//! where x is critical. On the boundary of N it has no zero, so it has a degree there (Cellina's, that of continuous maps close to its graph),
//! which does not change when d is smoothed. By Morse theory the smooth functions' critical points in N of index k count (-1)^k in it, and as much in
//! the change of the Euler number of {d <= s} when s passes their values. Hence the degree is what N adds to the Euler number: if it is
//! not 0, the topology changes between N's values.
//!
//! The degree is that of a map that is linear on the triangles of the boundary and has at vertices v some v - a. On every square of
//! the boundary a half-space n.y > 0 holds all of G ([`separation`]) and the vertices' values, so both maps are homotopic without a zero.

use super::cells::{Cells, Near};
use super::hull::{Simplex, critical_simplices, enclosing_centre, reaches, separation};
use super::search::{Cube, Found, Grid};
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract};
use crate::budget::{Budget, Stopped};
use crate::dilation::lattice::around;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// What happens to the topology at a critical radius, by the sign of its change and the span of the closest points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Change {
    /// Along a line: two parts join, or a tunnel forms.
    Joins,
    /// In a plane: a tunnel closes, or a cavity is sealed.
    Closes,
    /// In space: a cavity fills.
    Fills,
    /// Not told.
    Unclear,
}

/// A cluster.
#[derive(Clone, Debug)]
pub(super) struct Cluster {
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) change: Change,
    /// What it adds to the Euler number, where that is proven.
    pub(super) euler: Option<i64>,
    /// Its cubes.
    pub(super) cubes: Vec<Cube>,
}

/// Squares of the boundary of a cluster, at most.
const MOST_SQUARES: usize = 400_000;
/// Cubes of a cluster that is grown, at most.
const MOST_GROWN: usize = 200_000;
/// Parts of a cube's edge on the boundary, in turn until the degree is proven.
const PARTS: [i64; 3] = [1, 2, 4];

/// The clusters of a search.
pub(super) fn clusters(cells: &Cells<'_>, found: &Found, budget: &Budget) -> Result<Vec<Cluster>, Stopped> {
    let lists = touching(&found.cubes);
    lists
        .into_par_iter()
        .map(|list| {
            budget.cancel.check()?;
            let cubes: Vec<Cube> = list.into_iter().map(|index| found.cubes[index].clone()).collect();
            Ok(cluster(cells, &found.grid, cubes))
        })
        .collect()
}

/// Indices of cubes that hang together by corners at least, in the order of their first ones.
fn touching(cubes: &[Cube]) -> Vec<Vec<usize>> {
    let places: HashMap<[i64; 3], usize> = cubes.iter().enumerate().map(|(index, cube)| (cube.at, index)).collect();
    let mut seen = vec![false; cubes.len()];
    let mut lists = Vec::new();
    for first in 0..cubes.len() {
        if std::mem::replace(&mut seen[first], true) {
            continue;
        }
        let mut list = vec![first];
        let mut next = 0;
        while let Some(&index) = list.get(next) {
            next += 1;
            for at in around(cubes[index].at) {
                if let Some(&other) = places.get(&at)
                    && !std::mem::replace(&mut seen[other], true)
                {
                    list.push(other);
                }
            }
        }
        list.sort_unstable();
        lists.push(list);
    }
    lists
}

fn cluster(cells: &Cells<'_>, grid: &Grid, cubes: Vec<Cube>) -> Cluster {
    let low = cubes.iter().map(|cube| cube.low).fold(f64::INFINITY, f64::min);
    let high = cubes.iter().map(|cube| cube.high).fold(0.0, f64::max);
    let proven = |cubes: &[Cube]| PARTS.into_iter().find_map(|parts| degree(cells, grid, cubes, parts));
    if let Some(size) = only_simplex(cells, grid, &cubes) {
        let (change, euler) = [(Change::Joins, -1), (Change::Closes, 1), (Change::Fills, -1)][size - 2];
        return Cluster { low, high, change, euler: Some(euler), cubes };
    }
    let euler = proven(&cubes).or_else(|| proven(&grown(cells, grid, &cubes)?));
    Cluster { low, high, change: change(cells, grid, &cubes, euler), euler, cubes }
}

/// The number of points of a simplex, if its circumcentre is surely critical, not degenerate, and no other point of the cluster may be critical.
fn only_simplex(cells: &Cells<'_>, grid: &Grid, cubes: &[Cube]) -> Option<usize> {
    let (mut near, mut only): (Vec<Near>, Option<Simplex>) = (Vec::new(), None);
    let mut certain = false;
    for cube in cubes {
        let middle = grid.middle(&cube.at);
        cells.compete(&cube.near, &middle, grid.half_diagonal(), &mut near);
        for mut simplex in critical_simplices(&middle, &near, grid.half_diagonal())? {
            simplex.figures.sort_unstable();
            certain |= simplex.certain;
            if only.get_or_insert_with(|| simplex.clone()).figures != simplex.figures {
                return None;
            }
        }
    }
    only.filter(|_| certain).map(|simplex| simplex.figures.len())
}

/// The cubes and all that touch them: clusters do not touch, so no other cluster's are among them.
fn grown(cells: &Cells<'_>, grid: &Grid, cubes: &[Cube]) -> Option<Vec<Cube>> {
    let own: BTreeSet<[i64; 3]> = cubes.iter().map(|cube| cube.at).collect();
    let all: BTreeSet<[i64; 3]> = cubes.iter().flat_map(|cube| around(cube.at)).collect();
    if all.len() > MOST_GROWN {
        return None;
    }
    let (first, last) = (grid.middle(all.first()?), grid.middle(all.last()?));
    let middle: Point = std::array::from_fn(|axis| 0.5 * (first[axis] + last[axis]));
    let h = grid.half_diagonal();
    let radius = all.iter().map(|at| distance_squared(&grid.middle(at), &middle)).fold(0.0, f64::max).sqrt() + h;
    let roots: Vec<u32> = (0..cells.attractor().roots().len() as u32).collect();
    let list = cells.gather(&roots, &middle, radius);
    let mut found = Vec::new();
    let mut result = cubes.to_vec();
    for at in all.difference(&own) {
        let near = cells.gather(&list, &grid.middle(at), h);
        cells.compete(&near, &grid.middle(at), h, &mut found);
        // Far from the surfaces of solids, so that all of it is outside of them like the cluster.
        if found.first().is_none_or(|near| near.distance - near.error <= 4.0 * h) {
            return None;
        }
        result.push(Cube { at: *at, low: 0.0, high: f64::INFINITY, near, solids: Vec::new() });
    }
    Some(result)
}

/// The kind that the closest points suggest, if the change of the Euler number does not contradict.
fn change(cells: &Cells<'_>, grid: &Grid, cubes: &[Cube], euler: Option<i64>) -> Change {
    let mut near = Vec::new();
    let h = grid.half_diagonal();
    let spans = |cube: &Cube, near: &mut Vec<Near>| {
        let middle = grid.middle(&cube.at);
        cells.compete(&cube.near, &middle, h, near);
        let centre = enclosing_centre(near);
        if distance_squared(&centre, &middle).sqrt() > 2.0 * h {
            return 0;
        }
        let error = near.iter().map(|near| near.error).fold(0.0, f64::max);
        // Patches of closest points around one point are that large.
        let patch = 5.0 * h + 2.0 * (error * (cube.high + error)).sqrt();
        reaches(&centre, near).into_iter().filter(|&reach| reach > patch).count()
    };
    let most = cubes.iter().map(|cube| spans(cube, &mut near)).max().unwrap_or(0);
    match (most, euler) {
        (1, None | Some(..=-1)) => Change::Joins,
        (2 | 3, Some(1..)) | (2, None) => Change::Closes,
        (3, None | Some(-1)) => Change::Fills,
        _ => Change::Unclear,
    }
}

struct Boundary<'a, 'b> {
    cells: &'b Cells<'a>,
    grid: Grid,
    parts: i64,
    /// v - a at vertices met so far.
    gradients: BTreeMap<[i64; 3], Point>,
    near: Vec<Near>,
}

/// The degree on the boundary of a union of cubes, if it is proven with squares of a part of their edge.
fn degree(cells: &Cells<'_>, grid: &Grid, cubes: &[Cube], parts: i64) -> Option<i64> {
    let places: HashMap<[i64; 3], usize> = cubes.iter().enumerate().map(|(index, cube)| (cube.at, index)).collect();
    let mut boundary =
        Boundary { cells, grid: Grid { edge: grid.edge / parts as f64, ..*grid }, parts, gradients: BTreeMap::new(), near: Vec::new() };
    let (mut total, mut squares) = (0.0, 0);
    for cube in cubes {
        for axis in 0..3 {
            for outward in [false, true] {
                let mut across = cube.at;
                across[axis] += if outward { 1 } else { -1 };
                if places.contains_key(&across) {
                    continue;
                }
                squares += parts * parts;
                if squares as usize > MOST_SQUARES {
                    return None;
                }
                for part in 0..parts * parts {
                    total += boundary.square(cube, axis, outward, [part % parts, part / parts])?;
                }
            }
        }
    }
    let turns = total / (4.0 * std::f64::consts::PI);
    ((turns - turns.round()).abs() < 1e-3).then_some(turns.round() as i64)
}

impl Boundary<'_, '_> {
    /// The solid angle of the map on a square of a cube's face.
    fn square(&mut self, cube: &Cube, axis: usize, outward: bool, part: [i64; 2]) -> Option<f64> {
        let (right, up) = ((axis + 1) % 3, (axis + 2) % 3);
        let corner = |step: [i64; 2]| {
            let mut at = cube.at.map(|x| x * self.parts);
            at[axis] += if outward { self.parts } else { 0 };
            at[right] += part[0] + step[0];
            at[up] += part[1] + step[1];
            at
        };
        // Counter-clockwise seen from outside.
        let mut corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(corner);
        if !outward {
            corners.reverse();
        }
        let places = corners.map(|at| self.place(&at));
        let middle: Point = std::array::from_fn(|axis| 0.5 * (places[0][axis] + places[2][axis]));
        let half_diagonal = self.grid.edge * 0.5_f64.sqrt() * (1.0 + 1e-9);
        self.cells.compete(&cube.near, &middle, half_diagonal, &mut self.near);
        let normal = separation(&middle, &self.near, half_diagonal)?;
        let gradients = [0, 1, 2, 3].map(|k| self.gradient(cube, corners[k], &places[k]));
        if gradients.iter().any(|gradient| dot(gradient, &normal) <= 1e-9) {
            return None;
        }
        let [a, b, c, d] = gradients;
        Some(solid_angle(&a, &b, &c) + solid_angle(&a, &c, &d))
    }

    fn place(&self, at: &[i64; 3]) -> Point {
        std::array::from_fn(|axis| self.grid.origin[axis] + self.grid.edge * at[axis] as f64)
    }

    /// The unit vector from a vertex's closest point, the same for all squares there.
    fn gradient(&mut self, cube: &Cube, at: [i64; 3], place: &Point) -> Point {
        if let Some(&known) = self.gradients.get(&at) {
            return known;
        }
        self.cells.compete(&cube.near, place, 0.0, &mut self.near);
        let offset = self.near.first().map_or([0.0; 3], |near| subtract(place, &near.closest));
        let length = dot(&offset, &offset).sqrt();
        let unit = if length > 0.0 { offset.map(|x| x / length) } else { [0.0; 3] };
        self.gradients.insert(at, unit);
        unit
    }
}

/// The signed solid angle of a triangle of unit vectors in an open half-space (van Oosterom and Strackee, 1983).
pub(super) fn solid_angle(a: &Point, b: &Point, c: &Point) -> f64 {
    2.0 * dot(a, &cross(b, c)).atan2(1.0 + dot(a, b) + dot(b, c) + dot(c, a))
}
