//! The parts of a graph that are closest to some place above it: triangles, ridges and tips.

use super::Place;
use super::ground::{Ground, NONE, sides};
use crate::attractor::cell::{Point, cross, dot, subtract, unit};

/// How far beyond its ends a part counts, as a share of it: rounding leaves no gap between parts.
const BEYOND: f64 = 1e-9;
/// How far the corner beyond an edge is below the plane of a triangle, in units of the edge, so that it is a ridge.
const RIDGE: f64 = 1e-12;
/// How far beyond its sides a tip's cone may be, as a sine.
const WIDER: f64 = 1e-9;
/// Ridges that meet in a tip at least, but at the border.
const RIDGES: u32 = 3;

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
    /// A triangle that has it.
    owner: u32,
    ridges: u32,
    is_border: bool,
}

/// The parts of a graph that are closest to some place above it, between two distances from it. Cost: about a microsecond for each triangle.
pub(super) fn parts(ground: &Ground, distances: [f64; 2]) -> Vec<Part> {
    let Ground { places, triangles, across, .. } = ground;
    let mut maker = Maker { distances, parts: Vec::with_capacity(3 * triangles.len()) };
    let normal = |triangle: usize| {
        let [a, b, c] = ground.points(triangle);
        unit(&cross(&subtract(&b, &a), &subtract(&c, &a)))
    };
    let normals: Vec<Point> = (0..triangles.len()).map(normal).collect();
    let mut ends = vec![End { owner: NONE, ridges: 0, is_border: false }; places.len()];
    for (number, (triangle, across)) in (0_u32..).zip(triangles.iter().zip(across)) {
        let corners = ground.points(number as usize);
        let normal = normals[number as usize];
        let [a, b, c] = &corners;
        let (ab, ac) = (subtract(b, a), subtract(c, a));
        let area = ab[0] * ac[1] - ab[1] * ac[0];
        let shares = [[ac[1] / area, -ac[0] / area], [-ab[1] / area, ab[0] / area]];
        let face = Shape::Face { normal, level: dot(&normal, a), corner: [a[0], a[1]], shares };
        maker.add(face, number, &corners, &[normal]);
        // Every edge once.
        let edges = sides(triangle).into_iter().zip(across).filter(|(_, other)| **other == NONE || **other > number);
        for ([from, to], &other) in edges {
            let [p, q] = [from, to].map(|corner| places[corner as usize]);
            let way = subtract(&q, &p);
            let length = dot(&way, &way).sqrt();
            let is_border = other == NONE;
            let is_ridge = is_border || {
                let beyond = triangles[other as usize].into_iter().find(|corner| ![from, to].contains(corner)).unwrap_or(from);
                dot(&normal, &subtract(&places[beyond as usize], &p)) < -RIDGE * length
            };
            for end in [from, to] {
                let end = &mut ends[end as usize];
                *end = End { owner: number, ridges: end.ridges + u32::from(is_ridge), is_border: end.is_border || is_border };
            }
            if is_ridge {
                let ridge = Shape::Ridge { from: p, along: way.map(|x| x / length), length };
                let both = [Some(normal), normals.get(other as usize).copied()];
                let directions: Vec<Point> = if is_border { Vec::new() } else { both.into_iter().flatten().collect() };
                maker.add(ridge, number, &[p, q], &directions);
            }
        }
    }
    let ways = Ways::new(ground);
    let mut cone = Vec::new();
    for (corner, (end, &place)) in ends.iter().zip(places).enumerate() {
        if end.is_border {
            maker.add(Shape::Tip(place), end.owner, &[place], &[]);
        } else if end.ridges >= RIDGES {
            ways.cone(corner, &mut cone);
            if !cone.is_empty() {
                maker.add(Shape::Tip(place), end.owner, &[place], &cone);
            }
        }
    }
    maker.parts
}

/// The unit vectors from corners to those next to them.
struct Ways {
    starts: Vec<u32>,
    all: Vec<Point>,
}

impl Ways {
    fn new(ground: &Ground) -> Self {
        let mut starts = vec![0_u32; ground.places.len() + 1];
        ground.triangles.iter().flatten().for_each(|&corner| starts[corner as usize + 1] += 1);
        for corner in 0..ground.places.len() {
            starts[corner + 1] += starts[corner];
        }
        let (mut ends, mut all) = (starts.clone(), vec![[0.0; 3]; 3 * ground.triangles.len()]);
        for [from, to] in ground.triangles.iter().flat_map(sides) {
            let end = &mut ends[from as usize];
            all[*end as usize] = unit(&subtract(&ground.places[to as usize], &ground.places[from as usize]));
            *end += 1;
        }
        Self { starts, all }
    }

    /// The sides of the cone of directions in which nothing next to a corner is above it: each is across two of the ways.
    fn cone(&self, corner: usize, sides: &mut Vec<Point>) {
        sides.clear();
        let own = &self.all[self.starts[corner] as usize..self.starts[corner + 1] as usize];
        for (k, a) in own.iter().enumerate() {
            for b in &own[k + 1..] {
                let normal = unit(&cross(a, b));
                let up = if normal[2] < 0.0 { normal.map(|x| -x) } else { normal };
                if own.iter().all(|way| dot(way, &up) <= WIDER) {
                    sides.push(up);
                }
            }
        }
    }
}
