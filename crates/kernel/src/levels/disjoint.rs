//! Proof that copies have no inner point in common, in integers.

use super::LevelError;
use super::growth::Surface;
use super::lattice::{Lattice, Point};
use crate::budget::{Budget, Stopped};
use crate::solid::BOX_FACES;
use std::collections::BTreeSet;

/// A convex body that holds the primitive and its own images.
pub(super) struct Body {
    /// Numerators over D.
    pub(super) corners: Vec<Point>,
    /// Three corners of every face.
    faces: Vec<[u32; 3]>,
    /// Directions of edges.
    edges: Vec<[u32; 2]>,
}

type Wide = [i128; 3];

fn difference(a: &Point, b: &Point) -> Wide {
    std::array::from_fn(|k| i128::from(a[k]) - i128::from(b[k]))
}

fn cross(a: &Wide, b: &Wide) -> Wide {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: &Wide, b: &Point) -> i128 {
    (0..3).map(|k| a[k] * i128::from(b[k])).sum()
}

/// Coordinates below this leave room for the products of a separating direction in 127 bits.
const MOST_COORDINATE: i64 = 1 << 30;
/// Pairs of edges that are tried for one pair of copies.
const MOST_EDGE_PAIRS: usize = 4096;

/// Finds a body and proves that its images are in it and pairwise apart: the primitive itself if it is convex, else its box in the frame.
pub(super) fn prove(lattice: &Lattice, surface: &Surface, sets: &[Vec<usize>], budget: &Budget) -> Result<Body, LevelError> {
    let whole = Body::of(&surface.points, surface.loops());
    let refusal = if whole.is_convex(budget)? {
        match whole.holds_apart(lattice, sets, budget) {
            Ok(()) => return Ok(whole),
            Err(refusal) => Some(refusal),
        }
    } else {
        None
    };
    budget.cancel.check()?;
    let boxed = Body::box_of(&surface.points);
    // Where neither does, the primitive's own refusal says more.
    match boxed.holds_apart(lattice, sets, budget) {
        Ok(()) => Ok(boxed),
        Err(other) => Err(refusal.unwrap_or(other)),
    }
}

impl Body {
    fn of<'s>(points: &[Point], loops: impl Iterator<Item = &'s [u32]>) -> Self {
        let (mut faces, mut edges, mut seen) = (Vec::new(), Vec::new(), BTreeSet::new());
        for corners in loops {
            faces.push([corners[0], corners[1], corners[2]]);
            for (k, &from) in corners.iter().enumerate() {
                let to = corners[(k + 1) % corners.len()];
                if seen.insert(direction(&points[from as usize], &points[to as usize])) {
                    edges.push([from, to]);
                }
            }
        }
        Self { corners: points.to_vec(), faces, edges }
    }

    fn box_of(points: &[Point]) -> Self {
        let end = |axis: usize, upper: usize| {
            let all = points.iter().map(|point| point[axis]);
            if upper == 1 { all.max() } else { all.min() }.unwrap_or(0)
        };
        let corners: Vec<Point> = (0..8_usize).map(|code| std::array::from_fn(|axis| end(axis, code >> axis & 1))).collect();
        Self::of(&corners, BOX_FACES.iter().map(|face| face.as_slice()))
    }

    fn normal(&self, corners: &[Point], face: &[u32; 3]) -> Wide {
        let [a, b, c] = face.map(|corner| &corners[corner as usize]);
        cross(&difference(b, a), &difference(c, a))
    }

    fn is_convex(&self, budget: &Budget) -> Result<bool, Stopped> {
        for face in &self.faces {
            budget.cancel.check()?;
            let normal = self.normal(&self.corners, face);
            let height = dot(&normal, &self.corners[face[0] as usize]);
            if self.corners.iter().any(|corner| dot(&normal, corner) > height) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Whether every image lies within the body, and images that occur together have a plane between them.
    fn holds_apart(&self, lattice: &Lattice, sets: &[Vec<usize>], budget: &Budget) -> Result<(), LevelError> {
        let images: Vec<Vec<Point>> =
            lattice.maps.iter().map(|map| self.corners.iter().map(|corner| Lattice::image(map, corner, lattice.ratio)).collect()).collect();
        if let Some(map) = images.iter().position(|image| image.as_flattened().iter().any(|x| x.abs() > MOST_COORDINATE)) {
            return Err(LevelError::NoLattice { map });
        }
        for face in &self.faces {
            budget.cancel.check()?;
            let normal = self.normal(&self.corners, face);
            let height = dot(&normal, &self.corners[face[0] as usize]) * i128::from(lattice.ratio);
            if let Some(map) = images.iter().position(|image| image.iter().any(|corner| dot(&normal, corner) > height)) {
                return Err(LevelError::Leaves { map });
            }
        }
        let mut proven = BTreeSet::new();
        for set in sets {
            for (place, &first) in set.iter().enumerate() {
                for &second in &set[place + 1..] {
                    budget.cancel.check()?;
                    if proven.insert((first, second)) && !self.are_apart(&images[first], &images[second]) {
                        return Err(LevelError::Overlaps { first, second });
                    }
                }
            }
        }
        Ok(())
    }

    /// Convex polyhedra are apart if and only if a plane along a face of one, or along an edge of each, lies between them.
    fn are_apart(&self, first: &[Point], second: &[Point]) -> bool {
        let between = |direction: &Wide| {
            let range = |corners: &[Point]| {
                let heights = corners.iter().map(|corner| dot(direction, corner));
                heights.fold((i128::MAX, i128::MIN), |(low, high), height| (low.min(height), high.max(height)))
            };
            let ((a, b), (c, d)) = (range(first), range(second));
            *direction != [0; 3] && (b <= c || d <= a)
        };
        let edge = |corners: &[Point], [from, to]: &[u32; 2]| difference(&corners[*to as usize], &corners[*from as usize]);
        let faces = [first, second].into_iter().any(|corners| self.faces.iter().any(|face| between(&self.normal(corners, face))));
        faces
            || self.edges.len().pow(2) <= MOST_EDGE_PAIRS
                && self.edges.iter().any(|a| self.edges.iter().any(|b| between(&cross(&edge(first, a), &edge(second, b)))))
    }
}

/// The direction of an edge, the same for parallel ones.
fn direction(from: &Point, to: &Point) -> Point {
    let vector: Point = std::array::from_fn(|k| to[k] - from[k]);
    let divisor = vector.iter().fold(0_i64, |mut a, &b| {
        let mut b = b.abs();
        while b != 0 {
            (a, b) = (b, a % b);
        }
        a
    });
    let sign = vector.iter().find(|x| **x != 0).map_or(1, |x| x.signum());
    vector.map(|x| if divisor == 0 { 0 } else { x / divisor * sign })
}

/// Whether all copies of every level are cells of one grid: the primitive is the unit cube of the frame, every map turns the frame's axes into each other, and
/// takes the cube to a cell of the division of the cube by a whole number, the same for all maps.
///
/// Then a map takes the cells of any such division, along its axes, to cells of the next one; by induction faces of copies are faces of cells, which are
/// the same or have no inner point in common.
pub(super) fn is_grid(lattice: &Lattice, surface: &Surface) -> bool {
    let whole = lattice.denominator;
    let is_cube = surface.points.len() == 8
        && surface.loops().count() == 6
        && surface.points.as_flattened().iter().all(|&x| x == 0 || x == whole)
        && surface.loops().all(|corners| corners.len() == 4);
    let Some(step) = lattice.maps.first().and_then(|map| map.linear.as_flattened().iter().map(|x| x.abs()).max()) else { return false };
    let is_cell = |map: &super::lattice::LatticeMap| {
        let axes = |line: [i64; 3]| line.iter().filter(|x| **x != 0).count() == 1 && line.iter().all(|x| *x == 0 || x.abs() == step);
        let columns: [[i64; 3]; 3] = std::array::from_fn(|column| std::array::from_fn(|row| map.linear[row][column]));
        // A corner of the cell at a multiple of its edge: shift / D in steps of step / q.
        let placed = map.shift.iter().all(|&x| (x * lattice.ratio) % (step * whole) == 0);
        map.linear.into_iter().chain(columns).all(axes) && placed
    };
    is_cube && lattice.ratio % step == 0 && lattice.maps.iter().all(is_cell)
}
