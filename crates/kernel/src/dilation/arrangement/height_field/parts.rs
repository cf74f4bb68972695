//! The parts of a graph that are closest to some place above it: triangles, ridges and tips.

use super::super::faces::{Face, Faces};
use super::Place;
use crate::attractor::cell::{Point, cross, dot, subtract, unit};
use crate::solid::half_edges::{HalfEdges, NONE, Star, next, previous};

/// How far beyond its ends a part counts, as a share of it: rounding leaves no gap between parts.
const BEYOND: f64 = 1e-9;
/// How far the corner beyond an edge is below the plane of a triangle, in units of the edge, so that it is a ridge.
const RIDGE: f64 = 1e-12;
/// How far beyond its sides a tip's cone may be, as a sine.
const WIDER: f64 = 1e-9;
/// Ridges that meet in a tip, unless it is at the border, at least; and how many of them are looked at, pair by pair.
const RIDGES: u32 = 3;
const MOST_RIDGES: usize = 24;
/// Triangles around a corner at most of which more is asked.
const MOST_AROUND: usize = 256;

/// A part, and what of it is where.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    shape: Shape,
    /// A triangle that has it.
    pub(super) owner: u32,
    /// Its largest height.
    pub(super) highest: f64,
    /// Of the places over which something is that it is closest to, the box.
    pub(super) bounds: [Place; 2],
}

#[derive(Clone, Copy, Debug)]
enum Shape {
    /// A triangle: its normal and how far its plane is, a corner, and two vectors that lead to shares of its sides.
    Face {
        normal: Point,
        level: f64,
        corner: Place,
        shares: [Place; 2],
    },
    /// An edge from a corner along a unit vector.
    Ridge {
        from: Point,
        along: Point,
        length: f64,
    },
    Tip(Point),
}

/// What is over a place: how high, and the unit vector there from what is closest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Top {
    pub(super) height: f64,
    pub(super) out: Point,
    /// A triangle that has what is closest.
    pub(super) owner: u32,
}

impl Part {
    /// What is as far from it as a distance over a place, if it is closest to that.
    #[inline]
    pub(super) fn top(&self, at: Place, distance: f64) -> Option<Top> {
        let owner = self.owner;
        match &self.shape {
            Shape::Face { normal, level, corner, shares } => {
                let foot = [at[0] - distance * normal[0] - corner[0], at[1] - distance * normal[1] - corner[1]];
                let [s, t] = [0, 1].map(|k| shares[k][0] * foot[0] + shares[k][1] * foot[1]);
                let height = (level + distance - normal[0] * at[0] - normal[1] * at[1]) / normal[2];
                (s >= -BEYOND && t >= -BEYOND && s + t <= 1.0 + BEYOND).then_some(Top { height, out: *normal, owner })
            }
            Shape::Ridge { from, along, length } => {
                // |x|^2 - (x along)^2 = distance^2, for the height of x above the ridge's first end.
                let x = [at[0] - from[0], at[1] - from[1]];
                let (across, flat) = (1.0 - along[2] * along[2], x[0] * along[0] + x[1] * along[1]);
                let half = flat * along[2];
                let root = half * half - across * (x[0] * x[0] + x[1] * x[1] - flat * flat - distance * distance);
                if root < 0.0 {
                    return None;
                }
                let up = (half + root.sqrt()) / across;
                let foot = flat + up * along[2];
                let way = [x[0] - foot * along[0], x[1] - foot * along[1], up - foot * along[2]];
                let is_over = foot >= -BEYOND * length && foot <= (1.0 + BEYOND) * length;
                is_over.then(|| Top { height: from[2] + up, out: way.map(|part| part / distance), owner })
            }
            Shape::Tip(tip) => {
                let x = [at[0] - tip[0], at[1] - tip[1]];
                let up = (distance * distance - x[0] * x[0] - x[1] * x[1]).sqrt();
                (up >= 0.0).then(|| Top { height: tip[2] + up, out: [x[0], x[1], up].map(|part| part / distance), owner })
            }
        }
    }
}

/// Makes parts with their boxes, for what is between two distances from them.
struct Maker {
    distances: [f64; 2],
    parts: Vec<Part>,
}

impl Maker {
    /// A part is closest to what is beyond its corners, in some directions and in those between.
    fn add(&mut self, shape: Shape, owner: u32, corners: &[Point], directions: &[Point]) {
        let narrowest = directions.iter().flat_map(|a| directions.iter().map(move |b| dot(a, b))).fold(1.0, f64::min);
        // How far arcs between these are off their chords.
        let around = if directions.is_empty() { 1.0 } else { 1.0 - (0.5 * (1.0 + narrowest)).max(0.0).sqrt() } * self.distances[1];
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for direction in if directions.is_empty() { &[[0.0; 3]] } else { directions } {
            for (corner, distance) in corners.iter().flat_map(|corner| self.distances.map(|distance| (corner, distance))) {
                let at = [0, 1].map(|axis| corner[axis] + distance * direction[axis]);
                low = [0, 1].map(|axis| low[axis].min(at[axis] - around));
                high = [0, 1].map(|axis| high[axis].max(at[axis] + around));
            }
        }
        let highest = corners.iter().map(|corner| corner[2]).fold(f64::NEG_INFINITY, f64::max);
        self.parts.push(Part { shape, owner, highest, bounds: [low, high] });
    }
}

/// What is known of a corner.
#[derive(Clone, Copy, Debug)]
struct End {
    at: Point,
    /// A triangle that has it.
    owner: u32,
    ridges: u32,
    is_border: bool,
}

/// The parts of a graph that are closest to some place above it, between two distances from it; given its faces. Cost: about a microsecond for each triangle.
pub(super) fn parts(mesh: &HalfEdges, faces: &Faces, distances: [f64; 2]) -> Vec<Part> {
    let mut maker = Maker { distances, parts: Vec::with_capacity(3 * faces.all.len()) };
    let mut ends = vec![End { at: [0.0; 3], owner: NONE, ridges: 0, is_border: false }; mesh.points.len()];
    for (number, Face { corners, normal, .. }) in (0..).zip(&faces.all) {
        let [a, b, c] = corners;
        let (ab, ac) = (subtract(b, a), subtract(c, a));
        let area = ab[0] * ac[1] - ab[1] * ac[0];
        let shares = [[ac[1] / area, -ac[0] / area], [-ab[1] / area, ab[0] / area]];
        let face = Shape::Face { normal: *normal, level: dot(normal, a), corner: [a[0], a[1]], shares };
        maker.add(face, number, corners, &[*normal]);
        for k in 0..3 {
            let (half, [from, to]) = (3 * number + k, [k, k + 1].map(|k| corners[(k % 3) as usize]));
            let twin = mesh.twin(half);
            let is_border = twin == NONE;
            // Every edge once.
            if !is_border && twin < half {
                continue;
            }
            let way = subtract(&to, &from);
            let length = dot(&way, &way).sqrt();
            let is_ridge = is_border || faces.above(half, twin) < -RIDGE * length;
            for (end, at) in [(mesh.end(previous(half)), from), (mesh.end(half), to)] {
                let End { ridges, is_border: was_border, .. } = ends[end as usize];
                ends[end as usize] = End { at, owner: number, ridges: ridges + u32::from(is_ridge), is_border: was_border || is_border };
            }
            if is_ridge {
                let ridge = Shape::Ridge { from, along: way.map(|x| x / length), length };
                let both = [half, if is_border { half } else { twin }].map(|half| faces.all[(half / 3) as usize].normal);
                maker.add(ridge, number, &[from, to], if is_border { &[] } else { &both });
            }
        }
    }
    let (mut star, mut cone) = (Star::default(), Cone::default());
    for (corner, End { at, owner, ridges, is_border }) in (0..).zip(ends) {
        if !is_border && ridges < RIDGES {
            continue;
        }
        // Where the cone is not known, all directions may be in it.
        let is_known = !is_border && mesh.star(corner, MOST_AROUND, &mut star) && cone.find(&star, mesh, faces);
        let directions = if is_known { &cone.sides[..] } else { &[] };
        if !is_known || !directions.is_empty() {
            maker.add(Shape::Tip(at), owner, &[at], directions);
        }
    }
    maker.parts
}

/// The directions in which nothing next to a corner is above it.
#[derive(Default)]
struct Cone {
    /// The unit vectors from the corner to those next to it, and those along ridges.
    ways: Vec<Point>,
    ridges: Vec<Point>,
    /// The sides of the cone.
    sides: Vec<Point>,
}

impl Cone {
    /// Finds the sides around a corner, each of which is across two ridges, or that there are none; false where there are too many ridges.
    fn find(&mut self, star: &Star, mesh: &HalfEdges, faces: &Faces) -> bool {
        let Self { ways, ridges, sides } = self;
        ways.clear();
        ridges.clear();
        sides.clear();
        for &half in &star.halves {
            let [from, to] = [half, next(half)].map(|half| &faces.all[(half / 3) as usize].corners[(half % 3) as usize]);
            let (way, twin) = (unit(&subtract(to, from)), mesh.twin(half));
            ways.push(way);
            if twin != NONE && faces.above(half, twin) < 0.0 {
                ridges.push(way);
            }
        }
        if ridges.len() > MOST_RIDGES {
            return false;
        }
        for (k, a) in ridges.iter().enumerate() {
            for b in &ridges[k + 1..] {
                let across = cross(a, b);
                let normal = unit(&if across[2] < 0.0 { across.map(|x| -x) } else { across });
                if normal != [0.0; 3] && ways.iter().all(|way| dot(way, &normal) <= WIDER) {
                    sides.push(normal);
                }
            }
        }
        true
    }
}

/// Tips alone, each of which has a triangle with its number.
pub(super) fn tips(all: &[Point], distances: [f64; 2]) -> Vec<Part> {
    let mut maker = Maker { distances, parts: Vec::with_capacity(all.len()) };
    for (number, tip) in (0..).zip(all) {
        maker.add(Shape::Tip(*tip), number, &[*tip], &[]);
    }
    maker.parts
}
