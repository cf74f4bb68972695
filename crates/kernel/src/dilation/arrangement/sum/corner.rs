//! What is around a vertex: the boundary of the union of sectors, each thickened by the same ball.
//!
//! A sector C is a convex cone in a plane with the vertex at its tip, and K = C + B (Minkowski sum) is the set of x with n . x <= h(n) for all n that are normals of C's plane, of facets of B below which C is, or of sides of B's shadow along a side of C below which C is. Here h(n) is how far B reaches along n, so that a plane
//! has the same place for all sectors that have it: the facets of several sectors are one, and where they end within one of another nothing is to be seen. All K hold the vertex in their interior. So does their union along every way out: it is a graph over directions.
//!
//! Its edges are on lines where planes meet. Along one it is known, interval by interval, which K hold it, and what the others have of the ways across it: see [`Wedge`].

use super::ball::{Ball, SAME, is_same};
use crate::attractor::cell::{Point, cross, dot, unit};
use std::f64::consts::{FRAC_PI_2 as QUARTER, TAU};

/// Planes whose normals have a smaller sine than this have no line in common to speak of.
const LEAST_SINE: f64 = 1e-3;
/// Parts of lines that are shorter are none, and points closer to each other are one, in units of the radius: what noise makes of points where more than three planes meet.
const TINY: f64 = 1e-4;
const ONE: f64 = 4.0;
/// Sectors are cut to this angle at most, if they are wider than the other.
const WIDE: f64 = 2.9;
const NARROWER: f64 = 2.1;
/// Planes at most.
const MOST_PLANES: usize = 224;

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

/// What a body has of the ways across a line that is on some of its planes: from one angle on, counter-clockwise, to another, and the planes that it ends at.
#[derive(Clone, Copy, Debug)]
struct Wedge {
    angles: [f64; 2],
    planes: [usize; 2],
}

/// A part of a line that is an edge, with the facet that has it on its left, and the one that has it on its right.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Span {
    ends: [f64; 2],
    facets: [usize; 2],
}

/// A line, and what is known of all planes along it: how far below each it begins, and how steeply it goes up to it.
#[derive(Default)]
struct Line {
    from: Point,
    way: Point,
    left: Vec<f64>,
    slopes: Vec<f64>,
    /// The planes that it is on, in ascending order, with the angles of their normals about it, of which the first is 0.
    own: Vec<(usize, f64)>,
    /// What bodies have along it and across it; all across where they hold it.
    parts: Vec<([f64; 2], Option<Wedge>)>,
    stops: Vec<f64>,
    spans: Vec<Span>,
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
    /// The boundary around a vertex with some arcs, given unit vectors along all its ways; none where it does not come out as a surface. Cost: for each pair of planes as much as there are planes of bodies, 0.1 ms for walls along the axes.
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
        around.tiny = TINY * around.heights.iter().copied().fold(f64::INFINITY, f64::min);
        let sides = around.sides()?;
        let arc_of =
            |normal: &Point| arcs.iter().position(|arc| is_same(&arc.normal, normal) || is_same(&arc.normal.map(|part| -part), normal));
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

/// The bodies of a vertex's sectors.
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
        let is_below = |normal: &Point| sides.iter().all(|side| dot(side, normal) <= SAME);
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
        self.normals.iter().position(|own| is_same(own, normal)).unwrap_or_else(|| {
            self.normals.push(*normal);
            self.heights.push(ball.reach(normal));
            self.normals.len() - 1
        })
    }

    /// The sides of every facet; none where more than two facets meet along an edge, or an edge leads far out along no way.
    fn sides(&mut self) -> Option<Vec<Vec<Side>>> {
        let count = self.normals.len();
        let mut sides: Vec<Vec<Side>> = vec![Vec::new(); count];
        let mut line = Line::default();
        for first in 0..count {
            for second in first + 1..count {
                if !self.line([first, second], &mut line) {
                    continue;
                }
                self.spans(&mut line)?;
                for &Span { ends: [low, high], facets: [left, right] } in &line.spans {
                    let end = |at: f64, sign: f64, points: &mut Vec<Point>| {
                        if at.is_finite() {
                            let at: Point = std::array::from_fn(|axis| line.from[axis] + at * line.way[axis]);
                            return Some(End::Point(number(points, at, ONE * self.tiny)));
                        }
                        self.ways.iter().position(|own| is_same(own, &line.way.map(|part| sign * part))).map(End::Out)
                    };
                    let ends = [end(low, -1.0, &mut self.points)?, end(high, 1.0, &mut self.points)?];
                    if ends[0] != ends[1] || matches!(ends[0], End::Out(_)) {
                        sides[left].push(Side { across: right, ends });
                        sides[right].push(Side { across: left, ends: [ends[1], ends[0]] });
                    }
                }
            }
        }
        Some(sides)
    }

    /// The line on two planes; false where there is none, or it was looked at as another two planes' line.
    fn line(&self, [first, second]: [usize; 2], line: &mut Line) -> bool {
        let (n, m) = (&self.normals[first], &self.normals[second]);
        let (across, cosine) = (cross(n, m), dot(n, m));
        let square = dot(&across, &across);
        if square < LEAST_SINE * LEAST_SINE {
            return false;
        }
        let [a, b] = [first, second].map(|plane| self.heights[plane]);
        let shares = [(a - cosine * b) / square, (b - cosine * a) / square];
        line.from = std::array::from_fn(|axis| shares[0] * n[axis] + shares[1] * m[axis]);
        line.way = unit(&across);
        let (from, way) = (&line.from, &line.way);
        line.left.clear();
        line.left.extend(self.normals.iter().zip(&self.heights).map(|(normal, height)| height - dot(normal, from)));
        line.slopes.clear();
        line.slopes.extend(self.normals.iter().map(|normal| dot(normal, way)));
        let ahead = cross(way, n);
        line.own.clear();
        for plane in 0..self.normals.len() {
            if line.slopes[plane].abs() < SAME && line.left[plane].abs() < self.tiny {
                if line.own.len() == 1 && plane < second || line.own.is_empty() && plane < first {
                    return false;
                }
                let normal = &self.normals[plane];
                line.own.push((plane, dot(normal, &ahead).atan2(dot(normal, n))));
            }
        }
        true
    }

    /// The parts of a line that are edges of the union: there no body is all around, and what bodies have across it, together, ends at two planes. None where it ends at more.
    fn spans(&self, line: &mut Line) -> Option<()> {
        let Line { left, slopes, own, parts, stops, spans, .. } = line;
        spans.clear();
        parts.clear();
        for body in &self.bodies {
            let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
            // The least and the largest angle of its planes that the line is on: those between do not matter.
            let mut ends: Option<[(usize, f64); 2]> = None;
            for &plane in body {
                if let Some(&(_, angle)) = own.iter().find(|(number, _)| *number == plane) {
                    let [least, most] = ends.get_or_insert([(plane, angle); 2]);
                    // No wedge is wider than half of all around, and none is nothing: the angles of its planes are within half, too.
                    let angle = angle - TAU * ((angle - least.1) / TAU).round();
                    if angle < least.1 {
                        *least = (plane, angle);
                    }
                    if angle > most.1 {
                        *most = (plane, angle);
                    }
                } else if slopes[plane].abs() < SAME {
                    if left[plane] < 0.0 {
                        high = f64::NEG_INFINITY;
                    }
                } else if slopes[plane] > 0.0 {
                    high = high.min(left[plane] / slopes[plane]);
                } else {
                    low = low.max(left[plane] / slopes[plane]);
                }
                if high - low < self.tiny {
                    break;
                }
            }
            if high - low >= self.tiny {
                let wedge =
                    ends.map(|[least, most]| Wedge { angles: [most.1 + QUARTER, least.1 + 3.0 * QUARTER], planes: [most.0, least.0] });
                parts.push(([low, high], wedge));
            }
        }
        if !parts.iter().any(|(_, wedge)| wedge.is_some()) {
            return Some(());
        }
        stops.clear();
        stops.extend(parts.iter().flat_map(|(ends, _)| *ends).chain([f64::NEG_INFINITY, f64::INFINITY]));
        stops.sort_unstable_by(f64::total_cmp);
        for pair in stops.windows(2) {
            let [low, high] = [pair[0], pair[1]];
            if low == high || high - low < self.tiny {
                continue;
            }
            let middle = match (low.is_finite(), high.is_finite()) {
                (true, true) => 0.5 * (low + high),
                (true, false) => low + self.tiny,
                (false, true) => high - self.tiny,
                (false, false) => 0.0,
            };
            let here = || parts.iter().filter(|([low, high], _)| *low < middle && middle < *high).map(|(_, wedge)| wedge);
            if here().any(Option::is_none) {
                continue;
            }
            let wedges = || here().flatten();
            let is_left_open = |side: usize, wedge: &&Wedge| {
                let at = wedge.angles[side];
                !wedges().any(|other| {
                    let from = (at - other.angles[0]).rem_euclid(TAU);
                    let wide = other.angles[1] - other.angles[0];
                    if side == 0 { SAME < from && from < wide + SAME } else { from < wide - SAME || from > TAU - SAME }
                })
            };
            let mut facets = [None; 2];
            for (side, facet) in facets.iter_mut().enumerate() {
                let mut all = wedges().filter(|wedge| is_left_open(side, wedge)).map(|wedge| wedge.planes[side]);
                *facet = all.next();
                all.all(|other| Some(other) == *facet).then_some(())?;
            }
            if facets[0] == facets[1] {
                continue;
            }
            // Rounding may leave one side open alone.
            let [Some(right), Some(left)] = facets else { return None };
            match spans.last_mut() {
                Some(last) if last.facets == [left, right] && low - last.ends[1] < self.tiny => last.ends[1] = high,
                _ => spans.push(Span { ends: [low, high], facets: [left, right] }),
            }
        }
        Some(())
    }
}

/// The number of a point among others.
fn number(points: &mut Vec<Point>, at: Point, tiny: f64) -> u32 {
    let is_one = |own: &Point| (0..3).all(|axis| (own[axis] - at[axis]).abs() < tiny);
    points.iter().position(is_one).unwrap_or_else(|| {
        points.push(at);
        points.len() - 1
    }) as u32
}
