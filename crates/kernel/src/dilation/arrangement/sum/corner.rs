//! What is around a vertex: the boundary of the union of sectors, each thickened by the same ball.
//!
//! A sector C is a convex cone in a plane with the vertex at its tip, and K = C + B (Minkowski sum) is the set of x with n . x <= h(n) for all n that are normals of C's plane, of facets of B below which C is, or of sides of B's shadow along a side of C below which C is. Here h(n) is how far B reaches along n, so that a plane
//! has the same place for all sectors that have it: the facets of several sectors are one, and where they end within one of another nothing is to be seen. All K hold the vertex in their interior. So does their union along every way out: it is a graph over directions.
//!
//! Its edges are on lines where two planes meet. Along one it is known, interval by interval, which K it is inside of, or on one of the planes of, or on both: see [`Kind`].

use super::ball::Ball;
use crate::attractor::cell::{Point, cross, dot, unit};

/// What is one place, in units of the ball's radius; and one direction.
const SAME: f64 = 1e-7;
pub(super) const PARALLEL: f64 = 1e-9;
/// Sectors are cut to this angle at most, if they are wider than the other.
const WIDE: f64 = 2.9;
const NARROWER: f64 = 2.1;
/// Planes at most.
const MOST_PLANES: usize = 256;

/// A part of a plane at a vertex, from one way along it counter-clockwise to another, or all around.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arc {
    pub(super) normal: Point,
    pub(super) from: Point,
    pub(super) angle: f64,
    /// The ways along its sides, as numbers of the vertex's; none all around.
    pub(super) ways: Option<[usize; 2]>,
}

/// A part of a facet's boundary that has its facet to the left: a loop, or from one way out of the vertex to another.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub(super) normal: Point,
    /// Whether an arc is in its plane, less its offset.
    pub(super) arc: Option<usize>,
    /// The way that it comes in along, and the normal of the facet across.
    pub(super) entry: Option<(usize, Point)>,
    pub(super) exit: Option<(usize, Point)>,
    /// The numbers of points.
    pub(super) points: Vec<u32>,
}

/// The boundary around a vertex, which is the origin.
#[derive(Clone, Debug, Default)]
pub(super) struct Patch {
    pub(super) points: Vec<Point>,
    pub(super) chains: Vec<Chain>,
}

/// How a body has part of a line on its boundary, or inside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Inside,
    /// It is on one plane.
    First,
    Second,
    /// It is on both: its own edge.
    Both,
}

/// An end of an edge: a point, or a way out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    Point(u32),
    Out(usize),
}

/// An edge with its facet to the left.
#[derive(Clone, Copy, Debug)]
struct Side {
    across: usize,
    ends: [End; 2],
}

impl Patch {
    /// The boundary around a vertex with some arcs, given unit vectors along all its ways; none where it does not come out as a surface.
    pub(super) fn new(arcs: &[Arc], ways: &[Point], ball: &Ball) -> Option<Self> {
        let mut around = Around { ways, normals: Vec::new(), heights: Vec::new(), bodies: Vec::new(), points: Vec::new(), tiny: 0.0 };
        for arc in arcs {
            let count = if arc.angle > WIDE { (arc.angle / NARROWER).ceil() } else { 1.0 };
            let across = cross(&arc.normal, &arc.from);
            let way = |step: f64| -> Point {
                let (sine, cosine) = (arc.angle * step / count).sin_cos();
                std::array::from_fn(|axis| cosine * arc.from[axis] + sine * across[axis])
            };
            for step in 0..count as usize {
                around.add(&arc.normal, [way(step as f64), way(step as f64 + 1.0)], ball)?;
            }
        }
        around.tiny = SAME * around.heights.iter().copied().fold(f64::INFINITY, f64::min);
        let sides = around.sides()?;
        let arc_of = |normal: &Point| arcs.iter().position(|arc| dot(&arc.normal, normal).abs() > 1.0 - PARALLEL);
        let mut chains = Vec::new();
        for (facet, mut sides) in sides.into_iter().enumerate() {
            let normal = around.normals[facet];
            let of = |across: usize| around.normals[across];
            // Those that come in first: all others are loops.
            while let Some(at) = sides.iter().position(|side| matches!(side.ends[0], End::Out(_))).or_else(|| sides.len().checked_sub(1)) {
                let Side { across, ends: [start, mut end] } = sides.swap_remove(at);
                let entry = if let End::Out(way) = start { Some((way, of(across))) } else { None };
                let mut last = across;
                let mut points = Vec::new();
                while end != start
                    && let End::Point(point) = end
                {
                    points.push(point);
                    let mut after = (0..sides.len()).filter(|&side| sides[side].ends[0] == end);
                    let (Some(next), None) = (after.next(), after.next()) else { return None };
                    let next = sides.swap_remove(next);
                    (last, end) = (next.across, next.ends[1]);
                }
                let exit = match (start, end) {
                    (End::Point(point), _) => {
                        points.push(point);
                        None
                    }
                    (End::Out(_), End::Out(way)) => Some((way, of(last))),
                    (End::Out(_), End::Point(_)) => return None,
                };
                if entry.is_some() != exit.is_some() || (entry.is_none() && points.len() < 3) {
                    return None;
                }
                chains.push(Chain { normal, arc: arc_of(&normal), entry, exit, points });
            }
        }
        Some(Self { points: around.points, chains })
    }
}

struct Around<'a> {
    ways: &'a [Point],
    normals: Vec<Point>,
    heights: Vec<f64>,
    /// The planes of every body.
    bodies: Vec<Vec<usize>>,
    points: Vec<Point>,
    tiny: f64,
}

impl Around<'_> {
    /// Adds the body of a sector.
    fn add(&mut self, up: &Point, sides: [Point; 2], ball: &Ball) -> Option<()> {
        let is_below = |normal: &Point| sides.iter().all(|side| dot(side, normal) <= PARALLEL);
        let of_sides = sides.iter().flat_map(|side| ball.sides(side)).filter(is_below);
        let all: Vec<Point> =
            [*up, up.map(|part| -part)].into_iter().chain(ball.facets.iter().copied().filter(is_below)).chain(of_sides).collect();
        let mut body: Vec<usize> = all.iter().map(|normal| self.plane(normal, ball)).collect();
        body.sort_unstable();
        body.dedup();
        self.bodies.push(body);
        (self.normals.len() <= MOST_PLANES).then_some(())
    }

    /// The number of a plane.
    fn plane(&mut self, normal: &Point, ball: &Ball) -> usize {
        let is_same = |own: &Point| dot(own, normal) > 1.0 - PARALLEL && (0..3).all(|axis| (own[axis] - normal[axis]).abs() < SAME);
        self.normals.iter().position(is_same).unwrap_or_else(|| {
            self.normals.push(*normal);
            self.heights.push(ball.reach(normal));
            self.normals.len() - 1
        })
    }

    /// The sides of every facet.
    fn sides(&mut self) -> Option<Vec<Vec<Side>>> {
        let count = self.normals.len();
        let mut sides: Vec<Vec<Side>> = vec![Vec::new(); count];
        let mut spans = Vec::new();
        for first in 0..count {
            for second in first + 1..count {
                let (n, m) = (self.normals[first], self.normals[second]);
                let cosine = dot(&n, &m);
                let square = 1.0 - cosine * cosine;
                if square < PARALLEL {
                    continue;
                }
                let [a, b] = [first, second].map(|plane| self.heights[plane]);
                let shares = [(a - cosine * b) / square, (b - cosine * a) / square];
                let from: Point = std::array::from_fn(|axis| shares[0] * n[axis] + shares[1] * m[axis]);
                let way = unit(&cross(&n, &m));
                self.spans([first, second], &from, &way, &mut spans);
                for &([low, high], is_ridge) in &spans {
                    let ends = [(low, -1.0), (high, 1.0)];
                    let mut made = [End::Point(0); 2];
                    for (end, (at, sign)) in made.iter_mut().zip(ends) {
                        *end = if at.is_finite() {
                            End::Point(self.point(std::array::from_fn(|axis| from[axis] + at * way[axis])))
                        } else {
                            End::Out(self.ways.iter().position(|own| sign * dot(own, &way) > 1.0 - PARALLEL)?)
                        };
                    }
                    // The first facet is to the left of the line, seen from outside, where that is below the second along a ridge.
                    let is_left = is_ridge;
                    let [low, high] = made;
                    let (along, against) = ([low, high], [high, low]);
                    sides[first].push(Side { across: second, ends: if is_left { along } else { against } });
                    sides[second].push(Side { across: first, ends: if is_left { against } else { along } });
                }
            }
        }
        Some(sides)
    }

    /// The number of a point.
    fn point(&mut self, at: Point) -> u32 {
        let is_same = |own: &Point| (0..3).all(|axis| (own[axis] - at[axis]).abs() < 16.0 * self.tiny);
        self.points.iter().position(is_same).unwrap_or_else(|| {
            self.points.push(at);
            self.points.len() - 1
        }) as u32
    }

    /// Where a line on two planes is an edge of the union, and whether that is a ridge, rather than a valley.
    ///
    /// It is nowhere inside of a body. Bodies with it on one plane each make a valley, and one with it on both makes a ridge, unless there is one with it on one plane only: then that goes on.
    fn spans(&self, planes: [usize; 2], from: &Point, way: &Point, spans: &mut Vec<([f64; 2], bool)>) {
        spans.clear();
        let mut parts: Vec<([f64; 2], Kind)> = Vec::new();
        let mut has_edge = [false; 3];
        for body in &self.bodies {
            let has = planes.map(|plane| body.binary_search(&plane).is_ok());
            let kind = match has {
                [false, false] => Kind::Inside,
                [true, false] => Kind::First,
                [false, true] => Kind::Second,
                [true, true] => Kind::Both,
            };
            let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
            for &plane in body.iter().filter(|plane| !planes.contains(plane)) {
                let normal = &self.normals[plane];
                let (left, slope) = (self.heights[plane] - dot(normal, from), dot(normal, way));
                if slope.abs() < PARALLEL {
                    if left < self.tiny {
                        high = f64::NEG_INFINITY;
                        break;
                    }
                } else if slope > 0.0 {
                    high = high.min(left / slope);
                } else {
                    low = low.max(left / slope);
                }
                if high - low < self.tiny {
                    break;
                }
            }
            if high - low >= self.tiny {
                match kind {
                    Kind::Inside => {}
                    Kind::First => has_edge[0] = true,
                    Kind::Second => has_edge[1] = true,
                    Kind::Both => has_edge[2] = true,
                }
                parts.push(([low, high], kind));
            }
        }
        if !has_edge[2] && !(has_edge[0] && has_edge[1]) {
            return;
        }
        let mut stops: Vec<f64> = parts.iter().flat_map(|(ends, _)| *ends).chain([f64::NEG_INFINITY, f64::INFINITY]).collect();
        stops.sort_unstable_by(f64::total_cmp);
        for pair in stops.windows(2) {
            let [low, high] = [pair[0], pair[1]];
            if high - low < self.tiny || low == high {
                continue;
            }
            let middle = match (low.is_finite(), high.is_finite()) {
                (true, true) => 0.5 * (low + high),
                (true, false) => low + 1.0,
                (false, true) => high - 1.0,
                (false, false) => 0.0,
            };
            let mut has = [false; 4];
            parts.iter().filter(|([low, high], _)| *low < middle && middle < *high).for_each(|(_, kind)| has[*kind as usize] = true);
            let is_valley = has[Kind::First as usize] && has[Kind::Second as usize];
            let is_ridge = has[Kind::Both as usize] && !has[Kind::First as usize] && !has[Kind::Second as usize];
            if has[Kind::Inside as usize] || !(is_valley || is_ridge) {
                continue;
            }
            match spans.last_mut() {
                Some((last, was_ridge)) if *was_ridge == is_ridge && low - last[1] < self.tiny => last[1] = high,
                _ => spans.push(([low, high], is_ridge)),
            }
        }
    }
}
