//! Whether triangles are nowhere farther from others than a distance, which may be far smaller than they are.
//!
//! A triangle is cut into convex pieces until each has a triangle of the others that is as near to all of its corners: the distance from a convex set is convex, so that is as near to all of the piece. What is closest to the middle of a piece tells where to cut: across the sides of that one, a little beyond them.

use crate::attractor::cell::{Point, between, cross, distance_squared, dot, subtract, unit};
use crate::budget::{Budget, Stopped};
use crate::dilation::arrangement::{Face, Faces};
use crate::dilation::convex::Convex;
use crate::solid::TriMesh;
use rayon::prelude::*;

/// How far beyond its sides the piece goes that a triangle is near to, in units of the distance.
const MARGIN: f64 = 0.25;
/// Pieces of a triangle at most, in any case and for each of the faces near to it, of which a few are enough where it is near to all of it with some room; and corners of a piece.
const FEW_PIECES: usize = 1 << 12;
const PIECES_OF_A_FACE: usize = 64;
const MOST_CORNERS: usize = 16;
/// What rounding may take of the distance, as a share of it, and in roundings of coordinates.
const ROUNDED: f64 = 1e-9;
const ROUNDINGS: f64 = 16.0;
/// Triangles, and pieces of one, that are looked at one after the other.
const IN_A_ROW: usize = 64;

/// The triangles of a mesh of which it is not shown that no place is farther from some faces than a distance.
///
/// Cost: some microseconds for each triangle, and for each of the faces that is near to one.
///
/// # Errors
/// [`Stopped`].
pub(super) fn uncovered(mesh: &TriMesh, faces: &Faces, most: f64, budget: &Budget) -> Result<Vec<u32>, Stopped> {
    let all: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
    let extent = mesh.vertices.iter().map(|vertex| vertex.abs().max_element()).fold(0.0, f64::max);
    let most = most * (1.0 - ROUNDED) - ROUNDINGS * f64::EPSILON * extent;
    let look = |row: &[u32]| {
        let (mut cover, mut found) = (Cover { faces, most, near: Vec::new(), open: Vec::new(), listed: Vec::new() }, Vec::new());
        for &triangle in row {
            if !cover.is_whole(&mesh.points_of(triangle), budget)? {
                found.push(triangle);
            }
        }
        Ok(found)
    };
    let all: Vec<Vec<u32>> = all.par_chunks(IN_A_ROW).map(look).collect::<Result<_, Stopped>>()?;
    Ok(all.concat())
}

/// Looks at triangles one after the other.
struct Cover<'a> {
    faces: &'a Faces,
    most: f64,
    /// The faces that are near to a triangle.
    near: Vec<Near<'a>>,
    /// What of it is open.
    open: Vec<Piece>,
    /// By their places in `near`, those that may be near to the piece that is looked at, after those of the pieces that it is a part of: among long thin faces most are near to little of a triangle.
    listed: Vec<u32>,
}

impl Cover<'_> {
    /// Whether faces are near to all of a triangle.
    fn is_whole(&mut self, triangle: &[Point; 3], budget: &Budget) -> Result<bool, Stopped> {
        let Self { faces, most, near, open, listed } = self;
        let (faces, most) = (*faces, *most);
        near.clear();
        faces.around(triangle, most, |face| {
            near.extend(Some(Near::of(&faces.all[face as usize])).filter(|near| near.may_reach(triangle, most)));
            true
        });
        listed.clear();
        listed.extend(0..near.len() as u32);
        open.clear();
        open.push(Piece::new(triangle, [0, listed.len()]));
        for number in 0..FEW_PIECES + PIECES_OF_A_FACE * near.len() {
            if number % IN_A_ROW == 0 {
                budget.cancel.check()?;
            }
            let Some(mut piece) = open.pop() else { return Ok(true) };
            let [first, end] = piece.listed;
            listed.truncate(end);
            for place in first..end {
                let own = listed[place];
                if near[own as usize].may_reach(piece.corners(), most) {
                    listed.push(own);
                }
            }
            if listed.len() - end < end - first {
                piece.listed = [end, listed.len()];
            } else {
                listed.truncate(end);
            }
            let [first, end] = piece.listed;
            let middle = piece.middle();
            let (mut closest, mut square) = (None, most * most);
            for near in listed[first..end].iter().map(|&own| &near[own as usize]) {
                if near.square(&middle) <= square {
                    let distance = near.face.distance_squared(&middle);
                    if distance <= square {
                        (closest, square) = (Some(near), distance);
                    }
                }
            }
            let Some(closest) = closest else { return Ok(false) };
            piece.part(closest, most, open);
        }
        Ok(false)
    }
}

/// A face, its plane, and the planes across that through its sides: unit vectors, outwards, and heights along them.
struct Near<'a> {
    face: &'a Face,
    plane: (Point, f64),
    sides: [(Point, f64); 3],
}

impl<'a> Near<'a> {
    fn of(face: &'a Face) -> Self {
        let side = |k: usize| {
            let (a, b) = (&face.corners[k], &face.corners[(k + 1) % 3]);
            let out = unit(&cross(&subtract(b, a), &face.normal));
            (out, dot(&out, a))
        };
        Self { face, plane: (face.normal, dot(&face.normal, &face.corners[0])), sides: [0, 1, 2].map(side) }
    }

    /// Whether it may be within a distance of the hull of some corners, as far as its planes tell.
    fn may_reach(&self, corners: &[Point], distance: f64) -> bool {
        let beyond = |(out, height): &(Point, f64)| corners.iter().all(|corner| dot(out, corner) - height > distance);
        let (up, height) = self.plane;
        !beyond(&self.plane) && !beyond(&(up.map(|part| -part), -height)) && !self.sides.iter().any(beyond)
    }

    /// The square of how far a place is from it, or less.
    fn square(&self, x: &Point) -> f64 {
        let (up, height) = &self.plane;
        let aside = self.sides.iter().map(|(out, height)| dot(out, x) - height).fold(0.0, f64::max);
        (dot(up, x) - height).powi(2) + aside * aside
    }
}

/// A convex polygon, and where those are listed that may be near to what it is a part of.
#[derive(Clone, Copy)]
struct Piece {
    corners: [Point; MOST_CORNERS],
    count: usize,
    listed: [usize; 2],
}

impl Piece {
    fn new(corners: &[Point], listed: [usize; 2]) -> Self {
        let mut own = Self { corners: [[0.0; 3]; MOST_CORNERS], count: corners.len(), listed };
        own.corners[..corners.len()].copy_from_slice(corners);
        own
    }

    fn corners(&self) -> &[Point] {
        &self.corners[..self.count]
    }

    fn middle(&self) -> Point {
        std::array::from_fn(|axis| self.corners().iter().map(|corner| corner[axis]).sum::<f64>() / self.count as f64)
    }

    /// Adds what of it a face is not shown to be near to, in parts.
    fn part(mut self, Near { face, sides, .. }: &Near<'_>, most: f64, open: &mut Vec<Self>) {
        let is_near = |own: &Self| own.corners().iter().all(|corner| face.distance_squared(corner) <= most * most);
        if is_near(&self) {
            return;
        }
        let (whole, first) = (self, open.len());
        for (out, height) in sides {
            let [inside, outside] = self.cut(out, height + MARGIN * most);
            open.extend(outside);
            match inside {
                Some(inside) => self = inside,
                None => {
                    // Nothing of it is over the face that is closest to its middle.
                    open.truncate(first);
                    open.extend(whole.halves());
                    return;
                }
            }
        }
        if !is_near(&self) {
            open.extend(self.halves());
        }
    }

    /// What of it is lower along a direction, and what is higher.
    fn cut(&self, along: &Point, height: f64) -> [Option<Self>; 2] {
        let mut parts = [Self { count: 0, ..*self }; 2];
        let mut add = |part: usize, corner: Point| {
            let own = &mut parts[part];
            if own.count < MOST_CORNERS {
                own.corners[own.count] = corner;
            }
            own.count += 1;
        };
        let beyond = |corner: &Point| dot(along, corner) - height;
        let (mut is_low, mut is_high) = (false, false);
        for (k, a) in self.corners().iter().enumerate() {
            let b = &self.corners[(k + 1) % self.count];
            let [own, next] = [beyond(a), beyond(b)];
            (is_low, is_high) = (is_low || own < 0.0, is_high || own > 0.0);
            add(usize::from(own > 0.0), *a);
            if (own > 0.0) != (next > 0.0) {
                let cut = between(a, b, own / (own - next));
                add(0, cut);
                add(1, cut);
            }
        }
        if !is_high || parts.iter().any(|part| part.count > MOST_CORNERS) {
            return [Some(*self), None];
        }
        if !is_low {
            return [None, Some(*self)];
        }
        parts.map(Some)
    }

    /// Its parts on both sides of a plane across its longest way from corner to corner.
    fn halves(self) -> impl Iterator<Item = Self> {
        let all = self.corners();
        let pairs = (0..all.len()).flat_map(|k| (0..k).map(move |j| [j, k]));
        let [j, k] = pairs
            .max_by(|a, b| {
                let [a, b] = [a, b].map(|pair| distance_squared(&all[pair[0]], &all[pair[1]]));
                a.total_cmp(&b)
            })
            .unwrap_or_default();
        let along = unit(&subtract(&all[k], &all[j]));
        self.cut(&along, dot(&along, &between(&all[j], &all[k], 0.5))).into_iter().flatten()
    }
}
