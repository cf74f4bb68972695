//! Branch and bound for critical points of the distance d to a compact set A, over cubes of space and cells of A together.
//!
//! A point x off A is critical when it lies in the convex hull of its closest points a_i: x = sum l_i a_i, all |x - a_i| = v = d(x). Let a cube
//! lie within h of its middle m, f_i and p_i be the distances and closest points of m for the figures that compete in that ball. Then
//! (see [`Near::wander`]) |a_i - p_i| <= w, and the cube holds no critical point if some plane parts the p_i from m by more than
//! h + w ([`separation`]). Critical points that it holds have values between bounds of second order in h: for any point c
//!
//! v^2 + |c - x|^2 = sum l_i |c - a_i|^2.
//!
//! From below, |c - a_i| >= f_i(c) - error_i, hence v^2 >= min (f_i(c) - error_i)^2 - |c - x|^2. From above, with D the largest error,
//! v <= |x - p_i| + error_i, so (v - D)^2 <= sum l_i |x - p_i|^2 = |x - m|^2 + 2 (x - m).(m - q) + sum l_i f_i^2 where q = sum l_i p_i is within
//! h + w of m; and sum l_i f_i^2 = sum l_i |c - p_i|^2 + 2 (m - q).(m - c) - |m - c|^2. Both are good where c is the centre of the smallest ball
//! around the p_i: that is the critical point itself, in the limit. Also v <= max |c - a_i| <= max |c - p_i| + w, which is all that points need.

use super::cells::{Cells, Near};
use super::hull::{critical_simplices, enclosing_centre, separation};
use crate::attractor::cell::{Point, distance_squared};
use crate::budget::{Budget, Stopped};
use crate::dilation::block::signed_side;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// A cube of space that may hold critical points.
#[derive(Clone, Debug)]
pub(super) struct Cube {
    pub(super) at: [i64; 3],
    /// Values of critical points in it lie between these.
    pub(super) low: f64,
    pub(super) high: f64,
    /// Nodes that may hold closest points of its points.
    pub(super) near: Vec<u32>,
    /// Solids whose boundary may cross it, with the nodes that may hold the nearest points of it.
    pub(super) solids: Vec<(u32, Vec<u32>)>,
}

/// What a search left: all critical points with values in the window are in the cubes.
#[derive(Clone, Debug)]
pub(super) struct Found {
    pub(super) grid: Grid,
    pub(super) cubes: Vec<Cube>,
    pub(super) window: [f64; 2],
}

/// Where the cubes of a level are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    pub(super) origin: Point,
    pub(super) edge: f64,
}

impl Grid {
    pub(super) fn middle(&self, at: &[i64; 3]) -> Point {
        std::array::from_fn(|axis| self.origin[axis] + self.edge * (at[axis] as f64 + 0.5))
    }

    fn finer(self) -> Self {
        Self { edge: 0.5 * self.edge, ..self }
    }

    /// Half a diagonal of a cube.
    pub(super) fn half_diagonal(&self) -> f64 {
        self.edge * 0.5 * 3.0_f64.sqrt() * (1.0 + 1e-9)
    }
}

/// What a search may use.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// Cubes of a level.
    pub(super) cubes: usize,
    /// Nodes in the lists of a level.
    pub(super) entries: usize,
}

/// Radii between which critical values are sought: `whole` at first, never less than `core`; values are to be known to `resolution`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Aim {
    pub(super) whole: [f64; 2],
    pub(super) core: [f64; 2],
    pub(super) resolution: f64,
}

/// Levels at most.
const LEVELS: u32 = 48;
/// Cells are expanded until their errors are below this share of h.
const CELL_SHARE: f64 = 0.35;
/// The share of the window that stays when there is too much to look at.
const NARROWER: f64 = 0.6;

struct Search<'a, 'b> {
    cells: &'b Cells<'a>,
    grid: Grid,
    window: [f64; 2],
}

enum Look {
    Gone,
    /// The cube, and nodes to expand before it is told more.
    Open(Cube, Vec<u32>),
}

/// Searches the cube of space at `low` with edge `edge`.
pub(super) fn search(cells: &mut Cells<'_>, low: Point, edge: f64, aim: &Aim, effort: &Effort, budget: &Budget) -> Result<Found, Stopped> {
    let roots: Vec<u32> = (0..cells.attractor().roots().len() as u32).collect();
    let solid_of = |&node: &u32| cells.attractor().roots()[cells.root_of(node) as usize].solid;
    let solids = (0..cells.attractor().solids().len() as u32)
        .map(|solid| (solid, roots.iter().copied().filter(|node| solid_of(node) == Some(solid)).collect()))
        .collect();
    let mut pending = vec![Cube { at: [0; 3], low: 0.0, high: f64::INFINITY, near: roots, solids }];
    let (mut grid, mut window) = (Grid { origin: low, edge }, aim.whole);
    let mut level = 0;
    loop {
        let mut cubes = look_at(cells, grid, window, pending, budget)?;
        let is_done = |cube: &Cube| cube.high - cube.low <= aim.resolution;
        if level == LEVELS || cubes.iter().all(is_done) {
            return Ok(Found { grid, cubes, window });
        }
        while is_too_much(&cubes, effort) {
            if window == aim.core {
                return Ok(Found { grid, cubes, window });
            }
            let narrowed = |end: usize| {
                let reach = NARROWER * (window[end] - aim.core[end]);
                // The last step goes all the way.
                if reach.abs() < aim.resolution { aim.core[end] } else { aim.core[end] + reach }
            };
            window = [narrowed(0), narrowed(1)];
            cubes.retain(|cube| cube.high >= window[0] && cube.low <= window[1]);
        }
        (level, grid) = (level + 1, grid.finer());
        pending = cubes.iter().flat_map(children).collect();
        budget.report("stability", f64::from(level) / f64::from(LEVELS), pending.len() as u64);
    }
}

/// What is left of some cubes on the next level, if that is not too much to look at.
pub(super) fn refined(cells: &mut Cells<'_>, found: &Found, effort: &Effort, budget: &Budget) -> Result<Option<Found>, Stopped> {
    if is_too_much(&found.cubes, effort) {
        return Ok(None);
    }
    let grid = found.grid.finer();
    let cubes = look_at(cells, grid, found.window, found.cubes.iter().flat_map(children).collect(), budget)?;
    Ok(Some(Found { grid, cubes, window: found.window }))
}

fn is_too_much(cubes: &[Cube], effort: &Effort) -> bool {
    let entries: usize = cubes.iter().map(|cube| cube.near.len() + cube.solids.iter().map(|solid| solid.1.len()).sum::<usize>()).sum();
    8 * cubes.len() > effort.cubes || 8 * entries > effort.entries
}

fn children(cube: &Cube) -> impl Iterator<Item = Cube> + '_ {
    (0..8).map(|octant| Cube { at: std::array::from_fn(|axis| 2 * cube.at[axis] + (octant >> axis & 1)), ..cube.clone() })
}

/// Looks at cubes until their cells are small enough for their size; those that may hold critical points in the window.
fn look_at(cells: &mut Cells<'_>, grid: Grid, window: [f64; 2], mut pending: Vec<Cube>, budget: &Budget) -> Result<Vec<Cube>, Stopped> {
    let mut open = Vec::new();
    while !pending.is_empty() {
        let search = Search { cells, grid, window };
        let looks: Vec<Look> = pending
            .into_par_iter()
            .map_init(Vec::new, |found, cube| {
                budget.cancel.check()?;
                Ok(search.look(cube, found))
            })
            .collect::<Result<_, Stopped>>()?;
        let mut wanted = BTreeSet::new();
        let mut waiting = Vec::new();
        for look in looks {
            match look {
                Look::Gone => {}
                Look::Open(cube, nodes) if nodes.is_empty() => open.push(cube),
                Look::Open(cube, nodes) => {
                    wanted.extend(nodes);
                    waiting.push(cube);
                }
            }
        }
        let mut grown = false;
        for node in wanted {
            grown |= cells.expand(node);
        }
        if !grown {
            open.extend(waiting);
            break;
        }
        for cube in &mut waiting {
            cube.near = cells.replaced(&cube.near);
        }
        pending = waiting;
    }
    open.sort_unstable_by_key(|cube| cube.at);
    Ok(open)
}

impl Search<'_, '_> {
    fn look(&self, mut cube: Cube, found: &mut Vec<Near>) -> Look {
        let (middle, h) = (self.grid.middle(&cube.at), self.grid.half_diagonal());
        if self.is_inside_solids(&mut cube, &middle, h) {
            return Look::Gone;
        }
        self.cells.compete(&cube.near, &middle, h, found);
        let bounds = value_bounds(self.cells, found, &middle, h);
        (cube.low, cube.high) = (cube.low.max(bounds[0]), cube.high.min(bounds[1]));
        if cube.high < self.window[0] || cube.low > self.window[1] || cube.low > cube.high || separation(&middle, found, h).is_some() {
            return Look::Gone;
        }
        if critical_simplices(&middle, found, h).is_some_and(|simplices| simplices.is_empty()) {
            return Look::Gone;
        }
        let mut nodes: Vec<u32> = found.iter().map(|near| near.node).collect();
        nodes.sort_unstable();
        nodes.dedup();
        cube.near = nodes;
        let is_coarse = |near: &&Near| near.error + roughness(near, h) > CELL_SHARE * h && self.cells.is_closed(near.node);
        let mut wanted: Vec<u32> = found.iter().filter(is_coarse).map(|near| near.node).collect();
        wanted.dedup();
        Look::Open(cube, wanted)
    }

    /// Whether the cube lies inside a solid, where there is no critical point. Keeps those solids whose boundary may cross it.
    fn is_inside_solids(&self, cube: &mut Cube, middle: &Point, h: f64) -> bool {
        let mut inside = false;
        for (solid, nodes) in &mut cube.solids {
            let distances: Vec<f64> = nodes.iter().map(|&node| self.cells.distance(node, middle)).collect();
            let (index, least) = distances.iter().copied().enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, f64::INFINITY));
            if least > h {
                inside |= nodes
                    .get(index)
                    .is_some_and(|&node| signed_side(self.cells.attractor(), *solid, self.cells.root_of(node), middle) < 0.0);
                nodes.clear();
                continue;
            }
            let mut distance = distances.iter();
            nodes.retain(|_| distance.next().is_some_and(|&distance| distance <= least + 2.0 * h));
        }
        cube.solids.retain(|solid| !solid.1.is_empty());
        inside
    }
}

/// What `wander` has beyond what the cube's size makes it.
fn roughness(near: &Near, h: f64) -> f64 {
    (near.wander - near.error - h).max(0.0)
}

/// Bounds of the values of critical points in a ball; see above.
fn value_bounds(cells: &Cells<'_>, near: &[Near], middle: &Point, h: f64) -> [f64; 2] {
    let above = |square: f64| square.max(0.0).sqrt();
    let least = near.iter().map(|near| near.distance - near.error).fold(f64::INFINITY, f64::min).max(0.0);
    let upper = near.iter().map(|near| near.distance + near.error).fold(f64::INFINITY, f64::min);
    let centre = enclosing_centre(near);
    let shift = distance_squared(&centre, middle).sqrt();
    let from_centre = |near: &Near| cells.figure(near.figure).site.distance_squared(&centre).sqrt() - near.error;
    let nearest = near.iter().map(from_centre).fold(f64::INFINITY, f64::min).max(0.0);
    let low = above(least * least - h * h).max(above(nearest * nearest - (shift + h).powi(2)));
    let (error, wander) = near.iter().fold((0.0_f64, 0.0_f64), |most, near| (most.0.max(near.error), most.1.max(near.wander)));
    let around = near.iter().map(|near| distance_squared(&centre, &near.closest)).fold(0.0, f64::max);
    let off = h + wander;
    let square = around + h * h + 2.0 * h * off + 2.0 * off * shift - shift * shift;
    let high = (upper + h).min(error + above(square)).min(wander + above(around));
    [low * (1.0 - 1e-12), high * (1.0 + 1e-12)]
}
