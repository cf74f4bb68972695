//! Which of many points is the farthest along a direction, from a short list for each cell of directions.
//!
//! Let p be the farthest point along u. A point x is beyond p along a direction v only if (x - p) . v > 0, hence (p - x) . u <= |v - u| |x - p|. So a triangle of
//! directions within a chord of u needs only the points with that property, and its four parts choose from these. Lists are short where the hull is curved, as parts are
//! small, and where it has corners, as few points are left; many stay only where a flat side is at right angles to a direction of the cell. Cells get no smaller than
//! [`DEEPEST`] allows: then the extreme points at the cell's corners and middle are all of its list, so that what is found there is farthest but for a
//! share of the size that the cell's angle tells.
//!
//! Cells are those of an octahedron, for directions of the set after the map that makes its covariance that of a ball: points that are extreme along some direction
//! stay so under every affine map, and lists of long and flat sets are then as short as those of round ones.

use super::Points;
use crate::budget::{Budget, Stopped};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// A cell with as many points is not divided.
const MOST: usize = 48;
/// How often a cell of the octahedron is halved: then it is smaller than 1e-4.
const DEEPEST: u32 = 14;

/// The points that may be the farthest, by direction.
pub(super) struct Extremes {
    /// Maps directions of the set to those of the rounded one.
    rounded: DMat3,
    octants: Vec<Octant>,
}

/// Cells of one side of the octahedron, the first of which is all of it.
#[derive(Default)]
struct Octant {
    cells: Vec<Cell>,
    lists: Vec<u32>,
}

#[derive(Clone, Copy)]
enum Cell {
    /// Parts: at the three corners, then in the middle.
    Split([u32; 4]),
    /// Where its list begins and ends.
    List(u32, u32),
}

impl Extremes {
    /// Lists for all directions. Cost: about n for each size of cell. The result does not depend on the number of threads.
    pub(super) fn of(points: &Points<'_>, budget: &Budget) -> Result<Self, Stopped> {
        let count = points.points.len() as u32;
        let places = || (0..count).map(|index| points.at(index));
        let mean = places().sum::<DVec3>() / f64::from(count);
        let moments = places().map(|x| x - mean).fold(DMat3::ZERO, |sum, x| sum + DMat3::from_cols(x * x.x, x * x.y, x * x.z));
        let moment = |row: usize, column: usize| moments.col(column)[row] / f64::from(count);
        // Cholesky's factor, lower; sets of no thickness are given a little.
        let least = 1e-12 * points.radius * points.radius + 1e-300;
        let xx = (moment(0, 0) + least).sqrt();
        let (yx, zx) = (moment(1, 0) / xx, moment(2, 0) / xx);
        let yy = (moment(1, 1) - yx * yx).max(least).sqrt();
        let zy = (moment(2, 1) - zx * yx) / yy;
        let zz = (moment(2, 2) - zx * zx - zy * zy).max(least).sqrt();
        let factor = DMat3::from_cols(DVec3::new(xx, yx, zx), DVec3::new(0.0, yy, zy), DVec3::new(0.0, 0.0, zz));
        // x . u = (factor^-1 x) . (transposed factor u).
        let round: Vec<DVec3> = places()
            .map(|x| {
                let first = (x.x - mean.x) / xx;
                let second = (x.y - mean.y - yx * first) / yy;
                DVec3::new(first, second, (x.z - mean.z - zx * first - zy * second) / zz)
            })
            .collect();
        let all: Vec<u32> = (0..count).collect();
        let octant = |code: usize| {
            let mut made = Octant::default();
            made.cells.push(Cell::List(0, 0));
            made.fill(0, corners(code), 0, &all, &round, budget);
            made
        };
        let octants = (0..8_usize).into_par_iter().map(octant).collect();
        budget.cancel.check()?;
        Ok(Self { rounded: factor.transpose(), octants })
    }

    /// The list of a direction: never empty.
    pub(super) fn list(&self, direction: DVec3) -> &[u32] {
        let turned = self.rounded * direction;
        let code = usize::from(turned.x < 0.0) | usize::from(turned.y < 0.0) << 1 | usize::from(turned.z < 0.0) << 2;
        let sizes = turned.abs();
        let mut shares = sizes / sizes.element_sum();
        let octant = &self.octants[code];
        let mut cell = octant.cells[0];
        while let Cell::Split(parts) = cell {
            let corner = (0..3).find(|&k| shares[k] > 0.5).unwrap_or(3);
            shares = if corner == 3 { 1.0 - 2.0 * shares } else { 2.0 * shares - DVec3::AXES[corner] };
            cell = octant.cells[parts[corner] as usize];
        }
        let Cell::List(from, to) = cell else { return &[] };
        &octant.lists[from as usize..to as usize]
    }
}

/// Corners of a side of the octahedron.
fn corners(code: usize) -> [DVec3; 3] {
    std::array::from_fn(|axis| if code >> axis & 1 == 1 { -DVec3::AXES[axis] } else { DVec3::AXES[axis] })
}

impl Octant {
    /// Makes a cell of those of the candidates that may be extreme along its directions.
    fn fill(&mut self, cell: usize, corners: [DVec3; 3], depth: u32, candidates: &[u32], points: &[DVec3], budget: &Budget) {
        if budget.cancel.reason().is_some() {
            return;
        }
        let middle = (corners[0] + corners[1] + corners[2]).normalize();
        let chord = corners.iter().map(|corner| corner.normalize().distance_squared(middle)).fold(0.0, f64::max);
        let farthest = |along: DVec3| {
            let far = |index: &u32| points[*index as usize].dot(along);
            candidates.iter().copied().reduce(|a, b| if far(&b) > far(&a) { b } else { a })
        };
        let Some(first) = farthest(middle) else { return };
        let front = points[first as usize];
        let may_pass = |index: &&u32| {
            let back = front - points[**index as usize];
            let behind = back.dot(middle);
            behind * behind <= chord * back.length_squared()
        };
        let mut left: Vec<u32> = candidates.iter().filter(may_pass).copied().collect();
        if left.len() > MOST && depth < DEEPEST {
            let [a, b, c] = corners;
            let (ab, bc, ca) = (0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a));
            let start = self.cells.len();
            self.cells.resize(start + 4, Cell::List(0, 0));
            self.cells[cell] = Cell::Split(std::array::from_fn(|part| (start + part) as u32));
            // The middle part has its corners opposite to those of the whole.
            for (part, corners) in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]].into_iter().enumerate() {
                self.fill(start + part, corners, depth + 1, &left, points, budget);
            }
            return;
        }
        if left.len() > MOST {
            left = corners.into_iter().chain([middle]).filter_map(farthest).collect();
            left.sort_unstable();
            left.dedup();
        }
        let from = self.lists.len() as u32;
        self.lists.extend(left);
        self.cells[cell] = Cell::List(from, self.lists.len() as u32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Random points on ellipsoids, in boxes and on their sides: the farthest of a list is the farthest of all, up to what the least cells allow.
    #[test]
    fn lists_hold_the_farthest() {
        let mut seed = 3_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as f64 / f64::from(1_u32 << 31) * 2.0 - 1.0
        };
        for round in 0..6 {
            let sizes = [DVec3::ONE, DVec3::new(100.0, 3.0, 1.0), DVec3::new(5.0, 5.0, 0.0)][round % 3];
            let points: Vec<DVec3> = (0..2_000)
                .map(|k| {
                    let x = DVec3::new(random(), random(), random());
                    let on_side = if k % 2 == 0 { x } else { x.with_x(1.0) };
                    sizes * if round < 3 { x.normalize_or(DVec3::X) } else { on_side }
                })
                .collect();
            let seen = Points { points: &points, middle: DVec3::ZERO, radius: sizes.length(), grown: 0.0, slack: 0.0 };
            let extremes = Extremes::of(&seen, &Budget::default()).unwrap_or_else(|_| panic!("stopped"));
            for k in 0..2_000 {
                let direction = if k < 3 { DVec3::AXES[k] } else { DVec3::new(random(), random(), random()).normalize_or(DVec3::X) };
                let far = |index: &u32| points[*index as usize].dot(direction);
                let listed = extremes.list(direction).iter().map(far).fold(f64::NEG_INFINITY, f64::max);
                let exact = points.iter().map(|x| x.dot(direction)).fold(f64::NEG_INFINITY, f64::max);
                assert!(listed >= exact - 1e-4 * sizes.length(), "{round} {direction}: {listed} {exact}");
            }
        }
    }
}
