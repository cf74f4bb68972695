//! The arrows of a diagram: every arrow tries some bends and takes the one that meets least; every label tries some
//! places along its arrow. Greedy, in the order of the arrows, so the same diagram gives the same picture.

use super::layout::{Box, LINE, Rect, Side, TEXT_SIZE, width_of};
use super::{Bond, Diagram};
use lacuna_kernel::attractor::ranges;

/// A point of the picture.
type Point = [f64; 2];

/// An arrow as drawn: the corners of its path, and its label.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Route {
    /// Start, one or two control points, end of a Bezier curve.
    pub(super) curve: Vec<Point>,
    pub(super) label: String,
    /// Where the label stands.
    pub(super) place: Rect,
    pub(super) bond: Bond,
}

/// Bends that are tried: how far the control point is from the middle, to one side and the other.
const BENDS: [f64; 19] = [
    0.0, 36.0, -36.0, 72.0, -72.0, 120.0, -120.0, 180.0, -180.0, 250.0, -250.0, 330.0, -330.0, 430.0, -430.0, 560.0, -560.0, 720.0, -720.0,
];
/// Places of a label along its arrow that are tried.
const PLACES: [f64; 11] = [0.5, 0.42, 0.58, 0.34, 0.66, 0.26, 0.74, 0.18, 0.82, 0.12, 0.88];
/// Points of a curve that are looked at.
const SAMPLES: usize = 32;

/// A point of a Bezier curve of any degree.
fn at(curve: &[Point], t: f64) -> Point {
    let mut points = curve.to_vec();
    while points.len() > 1 {
        points = points.windows(2).map(|pair| [0, 1].map(|axis| (1.0 - t) * pair[0][axis] + t * pair[1][axis])).collect();
    }
    points[0]
}

/// Points of a curve from its start to its end.
pub(super) fn samples(curve: &[Point]) -> Vec<Point> {
    (0..=SAMPLES).map(|k| at(curve, k as f64 / SAMPLES as f64)).collect()
}

/// The box around points, of some size even if they stand in line.
fn around(points: &[Point]) -> Rect {
    let low = [0, 1].map(|axis| points.iter().map(|point| point[axis]).fold(f64::INFINITY, f64::min));
    let high = [0, 1].map(|axis| points.iter().map(|point| point[axis]).fold(f64::NEG_INFINITY, f64::max));
    Rect { left: low[0] - 0.5, top: low[1] - 0.5, width: high[0] - low[0] + 1.0, height: high[1] - low[1] + 1.0 }
}

/// The piece of a quadratic curve between two parameters.
fn piece(curve: &[Point; 3], from: f64, to: f64) -> [Point; 3] {
    let (start, end) = (at(curve, from), at(curve, to));
    // The control point of a piece is the curve's blossom at its ends.
    let blend = |t: f64, a: Point, b: Point| [0, 1].map(|axis| (1.0 - t) * a[axis] + t * b[axis]);
    let control = blend(to, blend(from, curve[0], curve[1]), blend(from, curve[1], curve[2]));
    [start, control, end]
}

/// What has been drawn so far.
struct Board<'a> {
    boxes: &'a [Box],
    /// Loops, with their labels.
    loops: Vec<(usize, Rect)>,
    labels: Vec<Rect>,
    /// With the boxes around them.
    curves: Vec<(Rect, Vec<Point>)>,
}

/// Draws all arrows between boxes, in the order of the diagram.
pub(super) fn routes(diagram: &Diagram, boxes: &[Box]) -> Vec<Route> {
    let mut board = Board { boxes, loops: Vec::new(), labels: Vec::new(), curves: Vec::new() };
    let mut routes: Vec<Option<Route>> = vec![None; diagram.arrows.len()];
    for (index, arrow) in diagram.arrows.iter().enumerate().filter(|(_, arrow)| arrow.from == arrow.to) {
        routes[index] = Some(board.turn(arrow.from, arrow.bond, &ranges(&arrow.indices)));
    }
    for (index, arrow) in diagram.arrows.iter().enumerate().filter(|(_, arrow)| arrow.from != arrow.to) {
        let paired = diagram
            .arrows
            .iter()
            .enumerate()
            .any(|(other, b)| other != index && ((b.from, b.to) == (arrow.to, arrow.from) || (b.from, b.to) == (arrow.from, arrow.to)));
        routes[index] = Some(board.join(arrow.from, arrow.to, arrow.bond, &ranges(&arrow.indices), paired));
    }
    routes.into_iter().flatten().collect()
}

impl Board<'_> {
    /// A loop at a side of its box, its label beyond.
    fn turn(&mut self, node: usize, bond: Bond, label: &str) -> Route {
        let Box { rect, side, .. } = &self.boxes[node];
        let side = match (bond, side) {
            (Bond::Transition, side) => *side,
            (Bond::Boundary, Side::Above) => Side::Below,
            (Bond::Boundary, Side::Below) => Side::Above,
            (Bond::Boundary, Side::Left) => Side::Right,
            (Bond::Boundary, Side::Right) => Side::Left,
        };
        let (normal, half): (Point, f64) = match side {
            Side::Above => ([0.0, -1.0], 0.5 * rect.height),
            Side::Below => ([0.0, 1.0], 0.5 * rect.height),
            Side::Left => ([-1.0, 0.0], 0.5 * rect.width),
            Side::Right => ([1.0, 0.0], 0.5 * rect.width),
        };
        let along = [normal[1].abs(), normal[0].abs()];
        let centre = rect.centre();
        let point = |out: f64, aside: f64| [0, 1].map(|axis| centre[axis] + normal[axis] * (half + out) + along[axis] * aside);
        let curve = vec![point(0.0, -12.0), point(46.0, -30.0), point(46.0, 30.0), point(0.0, 12.0)];
        let width = width_of(label, TEXT_SIZE) + 6.0;
        let beyond = 36.0 + 0.5 * (normal[0].abs() * width + normal[1].abs() * LINE);
        let place = Rect::around(point(beyond, 0.0), width, LINE);
        self.loops.push((node, Rect::around(point(18.0, 0.0), 40.0, 40.0)));
        self.labels.push(place);
        Route { curve, label: label.to_owned(), place, bond }
    }

    /// An arrow from box to box.
    fn join(&mut self, from: usize, to: usize, bond: Bond, label: &str, paired: bool) -> Route {
        let (start, end) = (self.boxes[from].rect.centre(), self.boxes[to].rect.centre());
        let along = [end[0] - start[0], end[1] - start[1]];
        let length = along[0].hypot(along[1]).max(1.0);
        let normal = [-along[1] / length, along[0] / length];
        let bent = |bend: f64| {
            let control = [0, 1].map(|axis| 0.5 * (start[axis] + end[axis]) + bend * normal[axis]);
            self.clipped([start, control, end], from, to)
        };
        // Arrows with a partner leave the middle to nobody.
        let cost = |bend: f64, curve: &[Point]| {
            self.cost(&samples(curve), from, to) + 0.06 * bend.abs() + if paired && bend == 0.0 { 6.0 } else { 0.0 }
        };
        let width = width_of(label, TEXT_SIZE) + 6.0;
        let tried = BENDS.iter().flat_map(|&bend| {
            let curve = bent(bend);
            let cost = cost(bend, &curve);
            PLACES.map(|t| {
                let place = Rect::around(at(&curve, t), width, LINE);
                (cost + self.crowd(&place) + 2.0 * (t - 0.5).abs(), curve, place)
            })
        });
        let best = tried.min_by(|a, b| a.0.total_cmp(&b.0));
        let (_, curve, place) = best.unwrap_or_else(|| (0.0, bent(0.0), Rect::around(end, width, LINE)));
        let points = samples(&curve);
        self.curves.push((around(&points), points));
        self.labels.push(place);
        Route { curve: curve.to_vec(), label: label.to_owned(), place, bond }
    }

    /// The part of a curve that lies outside of both boxes.
    fn clipped(&self, curve: [Point; 3], from: usize, to: usize) -> [Point; 3] {
        let (first, last) = (self.boxes[from].rect, self.boxes[to].rect.grown(2.0));
        let steps = 8 * SAMPLES;
        let t = |k: usize| k as f64 / steps as f64;
        let leaves = (0..=steps).find(|&k| !first.holds(at(&curve, t(k)))).map_or(0.0, t);
        let enters = (0..=steps).rev().find(|&k| !last.holds(at(&curve, t(k)))).map_or(1.0, t);
        if leaves < enters { piece(&curve, leaves, enters) } else { curve }
    }

    /// How much a curve meets.
    fn cost(&self, curve: &[Point], from: usize, to: usize) -> f64 {
        let mut cost = 0.0;
        for point in curve {
            let others = self.boxes.iter().enumerate().filter(|(index, _)| *index != from && *index != to);
            cost += 60.0 * others.filter(|(_, other)| other.rect.grown(8.0).holds(*point)).count() as f64;
            cost += 12.0 * self.loops.iter().filter(|(_, rect)| rect.holds(*point)).count() as f64;
            cost += 12.0 * self.labels.iter().filter(|label| label.grown(2.0).holds(*point)).count() as f64;
        }
        // A crossing is near at a few points; what runs alongside is near at many. Boxes tell most curves apart.
        let own = around(curve).grown(9.0);
        let near = |other: &[Point]| curve.iter().filter(|p| other.iter().any(|q| (p[0] - q[0]).hypot(p[1] - q[1]) < 9.0)).count();
        cost + self.curves.iter().filter(|(rect, _)| rect.meets(&own)).map(|(_, other)| near(other) as f64).sum::<f64>()
    }

    /// How much a label would hide.
    fn crowd(&self, label: &Rect) -> f64 {
        let boxes = self.boxes.iter().filter(|other| other.rect.meets(label)).count();
        let loops = self.loops.iter().filter(|(_, rect)| rect.meets(label)).count();
        let labels = self.labels.iter().filter(|other| other.grown(1.0).meets(label)).count();
        let curves = self.curves.iter().filter(|(rect, curve)| rect.meets(label) && curve.iter().any(|point| label.holds(*point))).count();
        60.0 * boxes as f64 + 8.0 * loops as f64 + 60.0 * labels as f64 + 4.0 * curves as f64
    }
}
