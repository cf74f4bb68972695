//! Attractors that are the graph of a continuous function over a convex part of a plane: products of two curves (`curves`), and surfaces of affine maps whose images over the plane are tiles (`tiles`).
//!
//! A *column* is the part of the graph over a smaller polygon: that of a word. Columns of products are split along whichever side is longer, so that they stay about as wide as they are long, whatever the curves' own transitions.

mod curves;
mod outline;
mod tiles;

use super::Attractor;
use super::cell::Point;
use super::enclosure::Enclosure;
use crate::automaton::SubdivisionOperator;
use crate::order::ordered_by;
use std::collections::BinaryHeap;

/// A place in the plane.
type Place = [f64; 2];

/// Coordinates, and parameters, may miss what they should be by this much, relative to all.
const MISS: f64 = 1e-10;
/// How far the polygon may be off, relative to all.
const MOST_OFF: f64 = 1e-6;
/// How often a column is split at most until it is narrow.
const DEEPEST: usize = 400;
/// Corners of a column at most.
const MOST_CORNERS: usize = 4;

/// What columns are made of: a pair of curves, or a state of affine maps.
struct Kind {
    enclosure: Enclosure,
    /// The corners around, each as a point that tells its share of the root's first side, and one that tells that of the second.
    corners: Vec<[Vec<f64>; 2]>,
    /// The parts, for each way to split it: those of curves along the first, and along the second.
    parts: Vec<Vec<Part>>,
}

/// What a transition leads to.
struct Part {
    operator: SubdivisionOperator,
    /// What takes shares of each of the root's sides to those of the part; none where it leaves them.
    along: [Option<SubdivisionOperator>; 2],
    kind: usize,
    /// The columns of its enclosure as points of the whole: what tells its heights; and by how much these may be off, in the sum of coordinates.
    seen: SubdivisionOperator,
    miss: f64,
}

/// The part of a graph over a convex polygon.
#[derive(Clone, Debug)]
pub(crate) struct Column {
    kind: usize,
    /// Heights of the control points, and shares of the root's sides at those of each curve, or at all.
    heights: Vec<f64>,
    shares: [Vec<f64>; 2],
    root: usize,
    /// The polygon's corners around, whichever way.
    corners: [Place; MOST_CORNERS],
    count: usize,
    /// No place of it is higher, or lower.
    pub(crate) high: f64,
    pub(crate) low: f64,
}

impl Column {
    fn corners(&self) -> &[Place] {
        &self.corners[..self.count]
    }

    /// The middle of the polygon's corners.
    pub(crate) fn middle(&self) -> Place {
        [0, 1].map(|axis| self.corners().iter().map(|corner| corner[axis]).sum::<f64>() / self.count as f64)
    }

    /// The same, known to be nowhere higher than a height.
    pub(crate) fn below(self, high: f64) -> Self {
        Self { high: self.high.min(high), ..self }
    }

    /// Whether a place is in it.
    pub(crate) fn has(&self, at: Place) -> bool {
        self.beyond(at) <= 1.0
    }

    /// How far a place is from the middle towards the side that it is farthest out to, in units of how far that is.
    fn beyond(&self, at: Place) -> f64 {
        let (corners, middle) = (self.corners(), self.middle());
        let out = |k: usize| {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            let over = |x: Place| (b[0] - a[0]) * (x[1] - a[1]) - (b[1] - a[1]) * (x[0] - a[0]);
            1.0 - over(at) / over(middle)
        };
        // What is too thin to tell has no place in it.
        (0..corners.len()).map(out).fold(0.0, |most: f64, out| if out.is_nan() { f64::INFINITY } else { most.max(out) })
    }

    /// How far the corners are from the middle, at most.
    pub(crate) fn reach(&self) -> f64 {
        let middle = self.middle();
        self.corners().iter().map(|corner| (corner[0] - middle[0]).hypot(corner[1] - middle[1])).fold(0.0, f64::max)
    }
}

/// A graph over a convex part of a plane.
pub(crate) struct Graph {
    kinds: Vec<Kind>,
    /// The axes of the plane, and the one across it: a right-handed frame.
    pub(crate) axes: [usize; 3],
    /// The corners of the part, counter-clockwise.
    pub(crate) corners: Vec<Place>,
    roots: Vec<Base>,
    /// Whether all roots are products that are smooth along one of their curves.
    pub(crate) has_smooth_curves: bool,
    /// How far places may be from where they are taken to be.
    pub(crate) off: f64,
}

/// Where a root is.
struct Base {
    kind: usize,
    heights: Vec<f64>,
    /// At the points of each curve, or at all: shares of two sides from a corner.
    shares: [Vec<f64>; 2],
    corner: Place,
    sides: [Place; 2],
}

impl Attractor {
    /// What it is the graph of; none where it is none, or not known to be one.
    pub(crate) fn graph(&self) -> Option<Graph> {
        if !self.solids.is_empty() || self.has_own_radii() || !self.trimmed.is_empty() {
            return None;
        }
        let extent =
            self.roots.iter().flat_map(|root| &root.points).flat_map(|point| &point[..3]).fold(0.0_f64, |most, x| most.max(x.abs()));
        curves::graph(self, extent).or_else(|| tiles::graph(self, extent))
    }
}

impl Graph {
    /// Numbers that a column has, at most.
    pub(crate) fn numbers(&self) -> usize {
        self.roots.iter().map(|base| base.heights.len() + base.shares[0].len() + base.shares[1].len()).max().unwrap_or(0)
    }

    /// Parts that a column is split into, at most.
    pub(crate) fn most_parts(&self) -> usize {
        self.kinds.iter().flat_map(|kind| &kind.parts).map(Vec::len).max().unwrap_or(0)
    }

    /// The columns over the roots' polygons, upside down if `sign` is -1.
    pub(crate) fn columns(&self, sign: f64) -> Vec<Column> {
        let column = |(root, base): (usize, &Base)| {
            let heights = base.heights.iter().map(|height| sign * height).collect();
            self.column(root, base.kind, heights, base.shares.clone())
        };
        self.roots.iter().enumerate().map(column).collect()
    }

    fn column(&self, root: usize, kind: usize, heights: Vec<f64>, shares: [Vec<f64>; 2]) -> Column {
        let Base { corner, sides, .. } = &self.roots[root];
        let Kind { corners: own, enclosure, .. } = &self.kinds[kind];
        let mut corners = [[0.0; 2]; MOST_CORNERS];
        for (place, at) in corners.iter_mut().zip(own) {
            let [t, s] = [0, 1].map(|k| dot_of(&shares[k], &at[k]));
            *place = [0, 1].map(|axis| corner[axis] + t * sides[0][axis] + s * sides[1][axis]);
        }
        let [low, high] = range(enclosure, &enclosure.columns, enclosure.miss, &heights);
        Column { kind, heights, shares, root, corners, count: own.len(), high, low }
    }

    /// The parts that a column is split into: across its longer side where there is a choice.
    fn split(&self, column: &Column) -> &[Part] {
        let ways = &self.kinds[column.kind].parts;
        let length = |k: usize| {
            let [a, b] = [column.corners[0], column.corners[k]];
            (b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2)
        };
        &ways[usize::from(ways.len() > 1 && length(3) > length(1))]
    }

    /// A part of a column.
    fn part(&self, column: &Column, number: usize) -> Column {
        let Part { operator, along, kind, .. } = &self.split(column)[number];
        let shares = [0, 1].map(|k| along[k].as_ref().map_or_else(|| column.shares[k].clone(), |own| own.pull_back(&column.shares[k])));
        let mut part = self.column(column.root, *kind, operator.pull_back(&column.heights), shares);
        (part.low, part.high) = (part.low.max(column.low), part.high.min(column.high));
        part
    }

    /// The parts of a column.
    pub(crate) fn parts(&self, column: &Column) -> impl Iterator<Item = Column> {
        (0..self.split(column).len()).map(move |number| self.part(column, number))
    }

    /// A narrow column over a place, given those over the roots: no corner is farther than a width from its middle, nor is the place, and it is no higher than that. None where columns do not become as small.
    pub(crate) fn narrow_at(&self, roots: &[Column], at: Place, width: f64) -> Option<Column> {
        let closest = |columns: Vec<Column>| columns.into_iter().min_by(|a, b| a.beyond(at).total_cmp(&b.beyond(at)));
        let mut column = closest(roots.to_vec())?;
        for _ in 0..DEEPEST {
            if column.reach() <= width && column.high - column.low <= width {
                let middle = column.middle();
                return ((middle[0] - at[0]).hypot(middle[1] - at[1]) <= width).then_some(column);
            }
            column = closest(self.parts(&column).collect())?;
        }
        None
    }

    /// A place as high as any of a column, but for a slack, and a height that no place of it exceeds, which is that of the first one. If to tell it would take too many splits, it is the highest place that was found, which is no higher than the graph, and the bound is higher.
    pub(crate) fn peak(&self, column: &Column, slack: f64, splits: usize) -> (Point, f64) {
        let mut wider: Vec<Column> = Vec::new();
        let mut heap: BinaryHeap<Glimpse> = BinaryHeap::new();
        let mut best = (column.low, None);
        for parent in 0..splits {
            let next = if parent == 0 {
                column.clone()
            } else {
                // What is not split stays among those that the bound is told by.
                let is_told = heap.peek().is_none_or(|top| top.high - best.0 <= slack);
                let Some(Glimpse { parent, number, .. }) = (if is_told { None } else { heap.pop() }) else { break };
                self.part(&wider[parent], number)
            };
            for (number, part) in self.split(&next).iter().enumerate() {
                let [low, high] = range(&self.kinds[part.kind].enclosure, &part.seen, part.miss, &next.heights);
                if low > best.0 {
                    best = (low, Some((parent, number)));
                }
                heap.push(Glimpse { high: high.min(next.high), parent, number });
            }
            wider.push(next);
        }
        let high = heap.peek().map_or(column.high, |top| top.high.max(best.0));
        let [x, y] = match best.1 {
            Some((parent, number)) => self.part(&wider[parent], number).middle(),
            None => column.middle(),
        };
        ([x, y, if high - best.0 <= slack { high } else { best.0 }], high)
    }
}

/// The value of a functional at a point.
fn dot_of(values: &[f64], point: &[f64]) -> f64 {
    values.iter().zip(point).map(|(value, x)| value * x).sum()
}

/// Bounds of the heights of what an enclosure holds, given its columns as points of what has such heights, and by how much these may be off, in the sum of coordinates.
fn range(enclosure: &Enclosure, columns: &SubdivisionOperator, miss: f64, heights: &[f64]) -> [f64; 2] {
    let [low, high] = enclosure.range(columns.pull_back(heights).into_iter());
    let beyond = miss * heights.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    [low - beyond, high + beyond]
}

/// A part of a column that was not looked at yet.
struct Glimpse {
    high: f64,
    /// The column, and the number of the part.
    parent: usize,
    number: usize,
}

ordered_by!(Glimpse, |this, other| this.high.total_cmp(&other.high));

#[cfg(test)]
pub(crate) mod tests {
    use super::tiles::tests::{lowered, takagi, triangle};
    use super::*;
    use crate::model::{ControlNet, CurveScheme, Model, Shape, TensorProduct};
    use crate::split_mix::Random;
    use glam::DVec3;

    fn rough(scaling: &[f64]) -> CurveScheme {
        CurveScheme::Interpolation { vertical_scaling: scaling.to_vec() }
    }

    /// A product over a grid of control points with heights by chance, moved to a place by the map.
    fn product(schemes: [CurveScheme; 2], size: [usize; 2], place: impl Fn(DVec3) -> DVec3) -> Attractor {
        let mut random = Random(3);
        let points =
            (0..size[0] * size[1]).map(|k| place(DVec3::new(3.0 * (k / size[1]) as f64, 2.0 * (k % size[1]) as f64, 6.0 * random.share())));
        let control_points = ControlNet { size: size.to_vec(), points: points.collect(), weights: None };
        let shape = Shape::TensorProduct(TensorProduct { schemes: schemes.to_vec(), control_points, separate: true, trim: None });
        Model { name: None, shape }.lower().unwrap().attractor
    }

    fn cubic() -> CurveScheme {
        CurveScheme::Nurbs { degree: 3, knots: vec![0.0, 0.0, 0.0, 0.0, 0.4, 1.0, 1.0, 1.0, 1.0] }
    }

    /// Rough along one axis, with two roots beside each other; along both, sheared; with other axes in the plane, one of them turned; and of maps, over a square and a triangle.
    pub(crate) fn graphs() -> Vec<Attractor> {
        vec![
            product([rough(&[0.45, -0.5, 0.4, 0.5]), cubic()], [5, 5], |place| place),
            product([rough(&[0.5, -0.4]), rough(&[0.45, 0.5])], [3, 3], |place| DVec3::new(place.x + 0.3 * place.y, place.y, place.z)),
            product([CurveScheme::Bezier, rough(&[0.6, -0.5])], [4, 3], |place| DVec3::new(place.z, place.x, -place.y)),
            lowered(takagi(6.0)),
            lowered(triangle(0.45)),
        ]
    }

    /// Places of a graph in its own frame, at the ends of paths by chance.
    pub(crate) fn places(attractor: &Attractor, graph: &Graph, count: usize) -> Vec<Point> {
        let mut random = Random(17);
        let mut choose = |all: usize| (random.share() * all as f64) as usize;
        let place = |_| {
            let root = &attractor.roots()[choose(attractor.roots().len())];
            let mut rows = graph.axes.map(|axis| root.points.iter().map(|point| point[axis]).collect::<Vec<f64>>());
            let mut state = root.state;
            for _ in 0..50 {
                let transitions = &attractor.automaton().state(state).transitions;
                let step = &transitions[choose(transitions.len())];
                (state, rows) = (step.to, rows.map(|row| step.operator.pull_back(&row)));
            }
            // The cell is a point.
            rows.map(|row| row[0])
        };
        (0..count).map(place).collect()
    }

    /// Bounds of the distance of a place, in the graph's frame, that are no farther apart than a width, from the columns that are close.
    pub(crate) fn away(graph: &Graph, x: &Point, width: f64) -> [f64; 2] {
        let least = |column: &Column| {
            let middle = column.middle();
            let beside = ((middle[0] - x[0]).hypot(middle[1] - x[1]) - column.reach()).max(0.0);
            beside.hypot(x[2] - x[2].clamp(column.low, column.high))
        };
        // Nearest first, what is farther than some that is known not at all.
        let (mut open, mut bounds) = (graph.columns(1.0), [f64::INFINITY; 2]);
        while let Some(column) = open.pop() {
            let (near, size) = (least(&column), 2.0 * column.reach() + column.high - column.low);
            bounds[1] = bounds[1].min(near + size);
            if near >= bounds[0].min(bounds[1]) {
                continue;
            }
            if size <= width {
                bounds[0] = near;
                continue;
            }
            let mut parts: Vec<Column> = graph.parts(&column).collect();
            parts.sort_by(|a, b| least(b).total_cmp(&least(a)));
            open.extend(parts);
        }
        bounds
    }

    /// Columns over a place are nested, have it between their bounds, and become as small as asked.
    #[test]
    fn columns_hold_their_places() {
        for (number, attractor) in graphs().iter().enumerate() {
            let graph = attractor.graph().unwrap();
            let places = places(attractor, &graph, 400);
            for at in &places {
                let mut column = graph.columns(1.0).into_iter().find(|column| column.has([at[0], at[1]])).unwrap();
                while column.reach() > 0.03 {
                    let away = column.middle();
                    assert!((away[0] - at[0]).hypot(away[1] - at[1]) <= column.reach() + 1e-6, "{number}");
                    assert!(column.low <= at[2] + 1e-6 && column.high >= at[2] - 1e-6, "{number}: {column:?} {at:?}");
                    column = graph.parts(&column).min_by(|a, b| a.beyond([at[0], at[1]]).total_cmp(&b.beyond([at[0], at[1]]))).unwrap();
                }
                let narrow = graph.narrow_at(&graph.columns(1.0), [at[0], at[1]], 0.05).unwrap();
                assert!(narrow.reach() <= 0.05 && narrow.high - narrow.low <= 0.05);
                assert!((narrow.low - 0.05..=narrow.high + 0.05).contains(&at[2]), "{number}");
            }
            let lowest = places.iter().map(|place| place[2]).fold(f64::INFINITY, f64::min);
            let upside_down = graph.columns(-1.0).iter().map(|column| column.high).fold(f64::NEG_INFINITY, f64::max);
            assert!(upside_down >= -lowest - 1e-9 && upside_down < -lowest + 10.0, "{number}: {upside_down} {lowest}");
        }
    }

    /// Peaks are places of the graph, and nothing that is known of a column is higher.
    #[test]
    fn peaks_are_the_highest_places() {
        for (number, attractor) in graphs().iter().enumerate() {
            let graph = attractor.graph().unwrap();
            let places = places(attractor, &graph, 40_000);
            let mut open = graph.columns(1.0);
            let mut highest = 0;
            for _ in 0..60 {
                let column = open.remove(0);
                let (peak, high) = graph.peak(&column, 0.05, 400);
                let own: Vec<&Point> = places.iter().filter(|place| column.has([place[0], place[1]])).collect();
                let most = own.iter().map(|place| place[2]).fold(f64::NEG_INFINITY, f64::max);
                assert!(high >= most - 1e-6 && column.has([peak[0], peak[1]]), "{number}: {high} {most}");
                let there = graph.narrow_at(&graph.columns(1.0), [peak[0], peak[1]], 0.01).unwrap();
                assert!(peak[2] <= there.high + 0.051 && peak[2] <= high, "{number}: {peak:?} {there:?}");
                if peak[2] == high {
                    highest += 1;
                    assert!(high <= most + 0.6, "{number}: {high} {most}");
                }
                open.extend(graph.parts(&column));
            }
            assert!(highest > 30, "{number}: {highest}");
        }
    }

    /// With any number of splits, and any slack, the bound holds: what is told to be highest is no lower than what more splits find.
    #[test]
    fn bounds_of_peaks_hold_however_early_a_search_ends() {
        for (number, attractor) in graphs().iter().enumerate() {
            let graph = attractor.graph().unwrap();
            let mut open = graph.columns(-1.0);
            for _ in 0..40 {
                let column = open.remove(0);
                let (found, _) = graph.peak(&column, 1e-6, 4_000);
                for (splits, slack) in [(1, 0.5), (2, 0.5), (3, 1.0), (8, 0.3), (40, 0.1), (400, 0.03)] {
                    let (peak, high) = graph.peak(&column, slack, splits);
                    assert!(high >= found[2] - 1e-6 && high >= peak[2], "{number}: {splits} {slack}: {high} {found:?}");
                }
                open.extend(graph.parts(&column));
            }
        }
    }

    #[test]
    fn what_is_no_graph_is_left() {
        let bent = |place: DVec3| DVec3::new(place.x + 0.1 * place.z, place.y + 0.2 * place.z, place.z);
        let folded = |place: DVec3| DVec3::new(place.x, (place.y - 3.0).abs(), place.z);
        let flat = |place: DVec3| DVec3::new(place.x, place.x, place.z);
        let none = [
            product([rough(&[0.5, -0.5]), cubic()], [3, 5], bent),
            product([rough(&[0.5, -0.5]), cubic()], [3, 5], folded),
            product([rough(&[0.5, -0.5]), cubic()], [3, 5], flat),
            product([rough(&[0.5, -0.5]), rough(&[0.5, -0.4])], [3, 3], |place| DVec3::new(place.x * place.x, place.y, place.z)),
        ];
        for (number, attractor) in none.iter().enumerate() {
            assert!(attractor.graph().is_none(), "{number}");
        }
        // Turned about the axis it is one still.
        let turned = |place: DVec3| DVec3::new(place.x + 0.1 * place.y, place.y - 0.1 * place.x, place.z);
        let graph = product([rough(&[0.5, -0.5]), cubic()], [3, 5], turned).graph().unwrap();
        assert_eq!((graph.axes, graph.corners.len(), graph.roots.len()), ([0, 1, 2], 4, 2));
    }
}
