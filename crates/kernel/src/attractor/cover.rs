//! Few points of an attractor whose convex hull contains it: the sites that stand for a cell in a
//! dilation.
//!
//! Let S be points of A with A in conv(S) + B_excess and S in a ball of radius R. For x with nearest point a
//! of A there is a' in conv(S) with |a - a'| <= excess, a' = sum w_k s_k, and
//! sum w_k |x - s_k|^2 = |x - a'|^2 + sum w_k |s_k - a'|^2 <= |x - a'|^2 + R^2, so
//! d(x, S)^2 <= (d(x, A) + excess)^2 + R^2: the error of replacing A by S is of *second* order in the
//! cell's size when it is seen from the distance r, R^2 / 2r, and it is one-sided since S is in A. A cell may
//! thus be of size sqrt(r e), where its Hausdorff distance from S would ask for size e.

use super::StateBound;
use super::cell::{Point, distance_squared, dot, matrix_norm, subtract, times};
use crate::automaton::{Automaton, Contraction, StateId, SubdivisionOperator, Transition};

/// Points that stand for a state's attractor, in coordinates of its frame.
#[derive(Clone, Debug, PartialEq)]
pub struct PointCover {
    /// Points of the attractor.
    pub points: Vec<Point>,
    /// Centre of a ball that contains them.
    pub centre: Point,
    /// Radius of that ball.
    pub radius: f64,
    /// The attractor lies in the sum of the points' hull and this.
    pub halo: Halo,
}

/// A neighbourhood of the origin, {sum_j h_j x_j} with the columns h_j.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Halo {
    /// h_j.
    pub columns: [Point; 3],
    /// An ellipsoid, |x| <= 1, if set; else a box, |x_j| <= 1.
    pub round: bool,
}

impl Halo {
    /// Its image under a linear map with the given columns.
    #[inline]
    pub(super) fn image(&self, columns: &[Point; 3]) -> Self {
        Self { columns: self.columns.map(|column| times(columns, &column)), round: self.round }
    }

    /// How far it extends along the vector, times the vector's length.
    #[inline]
    pub(super) fn along(&self, vector: &Point) -> f64 {
        let [a, b, c] = self.columns.map(|column| dot(&column, vector));
        if self.round { (a * a + b * b + c * c).sqrt() } else { a.abs() + b.abs() + c.abs() }
    }

    /// A bound of its points' distance from the origin.
    #[inline]
    pub(super) fn radius(&self) -> f64 {
        if self.round { matrix_norm(&self.columns) } else { self.columns.iter().map(|column| dot(column, column).sqrt()).sum() }
    }
}

/// More points than this cost more than larger cells save.
const MOST_POINTS: usize = 16;
/// Extreme points looked at.
const MOST_EXTREMES: usize = 96;
/// Steps of a descent that look for the farthest child; then the first child is taken, until cells are smaller than
/// double precision resolves: whatever the maps' ratios, a descent ends at a point of the attractor.
const DESCENT: usize = 200;
/// Steps of a descent at most: maps that contract by 0.99 need 4200.
const LONGEST_DESCENT: usize = 5000;

/// Steps contract by this much at least, or there are no covers.
const LEAST_CONTRACTION: f64 = 0.99;

/// Covers of all states; `None` where maps do not contract at each step in the adapted norm.
pub(super) fn covers(automaton: &Automaton, bounds: &[StateBound], contraction: &Contraction) -> Vec<Option<PointCover>> {
    let states = automaton.states();
    let norms = &contraction.step_norms;
    // Frames lead to frames: other states have neither covers nor norms that matter.
    let frames = || (0..states.len()).filter(|&index| states[index].frame);
    let contracts = frames().flat_map(|index| &norms[index]).all(|&norm| norm < LEAST_CONTRACTION);
    if !contracts {
        return vec![None; states.len()];
    }
    let extreme = |index: usize| states[index].frame.then(|| extremes(automaton, bounds, contraction, StateId::new(index)));
    let covers: Vec<Option<Vec<Point>>> = (0..states.len()).map(extreme).collect();
    // delta_v = max distance of T_e s from conv(S_v); the excess solves excess_v >= delta_v + s_e excess_w. All in
    // adapted norms.
    let deltas: Vec<f64> = (0..states.len()).map(|index| overhang(automaton, contraction, &covers, index)).collect();
    let worst = frames().map(|index| deltas[index]).fold(0.0, f64::max);
    let largest = frames().flat_map(|index| &norms[index]).fold(0.0_f64, |a, &b| a.max(b));
    let mut excess = vec![worst / (1.0 - largest); states.len()];
    for _ in 0..100 {
        // Decreasing from above: every iterate satisfies the inequality.
        excess = (0..states.len())
            .map(|index| {
                let children = states[index].transitions.iter().zip(&norms[index]);
                deltas[index] + children.map(|(t, norm)| norm * excess[t.to.index()]).fold(0.0, f64::max)
            })
            .collect();
    }
    let round: Vec<Halo> = (0..states.len()).map(|index| round_halo(contraction, index, excess[index])).collect();
    let boxes = boxes(automaton, &covers, &round);
    covers
        .into_iter()
        .enumerate()
        .map(|(index, points)| {
            let points = points.filter(|points| !points.is_empty())?;
            let (centre, radius) = enclosing_ball(&points);
            let narrow = boxes.as_ref().map(|boxes| boxes[index]).filter(|halo| halo.radius() < round[index].radius());
            let mut halo = narrow.unwrap_or(round[index]);
            let rounding = 1e-12 * points.iter().flatten().fold(radius, |a, x| a.max(x.abs()));
            (0..3).for_each(|j| halo.columns[j][j] += rounding.copysign(halo.columns[j][j]));
            Some(PointCover { points, centre, radius, halo })
        })
        .collect()
}

fn round_halo(contraction: &Contraction, index: usize, excess: f64) -> Halo {
    let unit = contraction.unit_ball(StateId::new(index));
    // States that are not frames have other dimensions, and no cover.
    let entry = |i: usize, j: usize| unit.get(j).and_then(|column| column.get(i)).copied().unwrap_or(0.0);
    Halo { columns: std::array::from_fn(|j| std::array::from_fn(|i| entry(i, j) * excess * (1.0 + 1e-9))), round: true }
}

/// Halos along the frame's axes, for attractors whose hulls are round in some directions only: boxes of half
/// extents e_v. If T_e s lies in conv(S_v) plus the box delta_v for all points s of children, and
/// delta_v + |L_e| e_w <= e_v with the absolute values of the linear parts, then T_e maps conv(S_w) plus the box e_w into
/// conv(S_v) plus the box e_v, and the attractors lie in these sets. `None` where no such boxes are found.
fn boxes(automaton: &Automaton, covers: &[Option<Vec<Point>>], round: &[Halo]) -> Option<Vec<Halo>> {
    let states = automaton.states();
    let extent =
        |halo: &Halo| -> Point { std::array::from_fn(|i| halo.columns.iter().map(|column| column[i].powi(2)).sum::<f64>().sqrt()) };
    let mut extents: Vec<Point> = round.iter().map(extent).collect();
    for _ in 0..BOX_ROUNDS {
        // Offsets are measured in units of the extents so far: where hulls are exact along an axis, they stay so.
        let offsets: Vec<Point> = (0..states.len()).map(|index| box_overhang(automaton, covers, index, &extents[index])).collect();
        let step = |extents: &[Point]| -> Vec<Point> {
            let through = |index: usize, axis: usize| {
                let child = |t: &Transition| -> f64 {
                    let entry = |j: usize| (t.operator.entry(axis + 1, j + 1) - t.operator.entry(axis + 1, 0)).abs();
                    (0..3).map(|j| entry(j) * extents[t.to.index()][j]).sum()
                };
                offsets[index][axis] + states[index].transitions.iter().map(child).fold(0.0, f64::max)
            };
            let frame = |index: usize| if states[index].frame { std::array::from_fn(|axis| through(index, axis)) } else { [0.0; 3] };
            (0..states.len()).map(frame).collect()
        };
        let mut solution = vec![[0.0; 3]; states.len()];
        for _ in 0..400 {
            solution = step(&solution);
        }
        let size = solution.iter().flatten().fold(0.0_f64, |a, &x| a.max(x));
        solution.iter_mut().flatten().for_each(|x| *x = *x * (1.0 + 1e-9) + 1e-12 * size);
        let holds = step(&solution).iter().flatten().zip(solution.iter().flatten()).all(|(next, own)| next <= own || *own == 0.0);
        if !holds || !size.is_finite() {
            return None;
        }
        extents = solution;
    }
    let halo = |extent: &Point| Halo {
        columns: std::array::from_fn(|j| std::array::from_fn(|i| if i == j { extent[j] } else { 0.0 })),
        round: false,
    };
    Some(extents.iter().map(halo).collect())
}

/// Rounds in which boxes adapt to the offsets that they hold.
const BOX_ROUNDS: usize = 4;

/// Largest offsets along the axes of children's points from points of the hull, near in units of the extents.
fn box_overhang(automaton: &Automaton, covers: &[Option<Vec<Point>>], index: usize, extents: &Point) -> Point {
    let Some(points) = &covers[index] else { return [0.0; 3] };
    let largest = extents.iter().fold(f64::MIN_POSITIVE, |a, &x| a.max(x));
    let unit = extents.map(|x| x.max(1e-4 * largest));
    let scaled = |point: &Point| -> Point { std::array::from_fn(|i| point[i] / unit[i]) };
    let hull: Vec<Point> = points.iter().map(scaled).collect();
    let mut worst = [0.0_f64; 3];
    for transition in &automaton.states()[index].transitions {
        let Some(child) = &covers[transition.to.index()] else { continue };
        for point in child {
            let mapped = transition.operator.apply(&[1.0 - point.iter().sum::<f64>(), point[0], point[1], point[2]]);
            let offset = offset_from_hull(&scaled(&[mapped[1], mapped[2], mapped[3]]), &hull);
            (0..3).for_each(|i| worst[i] = worst[i].max((offset[i] * unit[i]).abs()));
        }
    }
    worst
}

/// Directions in which extreme points are sought: axes, diagonals of faces and of the cube, and points
/// spread over the sphere, so that polytopes with few corners show all of them.
fn directions() -> Vec<Point> {
    let mut list = Vec::new();
    for code in 0..27 {
        let direction = [code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1].map(f64::from);
        if direction != [0.0; 3] {
            list.push(direction);
        }
    }
    let count = 120;
    for k in 0..count {
        let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
        let angle = f64::from(k) * 2.399_963_229_728_653;
        let ring = (1.0 - z * z).sqrt();
        list.push([ring * angle.cos(), ring * angle.sin(), z]);
    }
    list
}

/// Extreme points of a state's attractor, each computed along an address to the last digit.
fn extremes(automaton: &Automaton, bounds: &[StateBound], contraction: &Contraction, id: StateId) -> Vec<Point> {
    let mut points: Vec<Point> = Vec::new();
    let mut size = 0.0_f64;
    // Spread over the sphere in coordinates in which the attractor is about as long as wide.
    let columns: [Point; 3] = std::array::from_fn(|j| contraction.rounded(id, &std::array::from_fn(|i| if i == j { 1.0 } else { 0.0 })));
    let covector = |direction: &Point| -> Point { std::array::from_fn(|j| dot(&columns[j], direction)) };
    for direction in directions().iter().map(covector) {
        let Some(point) = extreme(automaton, bounds, id, &direction) else { continue };
        size = points.first().map_or(size, |first| size.max(distance_squared(first, &point).sqrt()));
        if points.iter().all(|known| distance_squared(known, &point).sqrt() > 1e-7 * size.max(f64::MIN_POSITIVE)) {
            points.push(point);
        }
        if points.len() > MOST_EXTREMES {
            break;
        }
    }
    prune(points, &|point| contraction.rounded(id, point))
}

/// Follows, at every level, the child that reaches farthest along the direction, looking a few levels
/// ahead, down to a point of the attractor.
fn extreme(automaton: &Automaton, bounds: &[StateBound], id: StateId, direction: &Point) -> Option<Point> {
    let mut frame = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut state = id;
    for step in 0..LONGEST_DESCENT {
        let size: f64 = (1..4).map(|j| distance_squared(&frame[j], &frame[0])).sum();
        if size < 1e-36 {
            break;
        }
        let transitions = &automaton.state(state).transitions;
        if step >= DESCENT {
            let first = transitions.first()?;
            (state, frame) = (first.to, image(&frame, &first.operator));
            continue;
        }
        let heights = frame.map(|point| dot(&point, direction));
        let reached = |transition: &Transition| reach(automaton, bounds, transition.to, &lifted(&heights, &transition.operator), 2);
        let (_, best) = transitions.iter().map(|transition| (reached(transition), transition)).max_by(|p, q| p.0.total_cmp(&q.0))?;
        (state, frame) = (best.to, image(&frame, &best.operator));
    }
    let StateBound::Frame { centre, .. } = &bounds[state.index()] else { return None };
    Some(std::array::from_fn(|i| frame[0][i] + (0..3).map(|j| (frame[j + 1][i] - frame[0][i]) * centre[j]).sum::<f64>()))
}

fn image(frame: &[Point; 4], operator: &SubdivisionOperator) -> [Point; 4] {
    std::array::from_fn(|column| {
        let weights = operator.column(column);
        std::array::from_fn(|i| (0..4).map(|k| frame[k][i] * weights[k]).sum())
    })
}

/// Heights of a child's frame, from those of its parent's.
#[inline]
fn lifted(heights: &[f64; 4], operator: &SubdivisionOperator) -> [f64; 4] {
    std::array::from_fn(|column| heights.iter().zip(operator.column(column)).map(|(height, weight)| height * weight).sum())
}

/// The box bound of how high a cell reaches, from the heights of its frame, after looking `depth` levels ahead.
fn reach(automaton: &Automaton, bounds: &[StateBound], state: StateId, heights: &[f64; 4], depth: u32) -> f64 {
    let StateBound::Frame { low, high, .. } = &bounds[state.index()] else { return f64::NEG_INFINITY };
    let transitions = &automaton.state(state).transitions;
    // Looking ahead is bounded in width too.
    if depth > 0 && transitions.len().pow(depth) <= 64 {
        let ahead = transitions.iter().map(|t| reach(automaton, bounds, t.to, &lifted(heights, &t.operator), depth - 1));
        return ahead.fold(f64::NEG_INFINITY, f64::max);
    }
    let mut sum = heights[0];
    for j in 0..3 {
        let along = heights[j + 1] - heights[0];
        sum += (along * low[j]).max(along * high[j]);
    }
    sum
}

/// Chooses points one by one, each time the farthest from the hull of those chosen, until the hull holds all or
/// [`MOST_POINTS`] are chosen: what is left out shows in the excess.
fn prune(points: Vec<Point>, rounded: &dyn Fn(&Point) -> Point) -> Vec<Point> {
    let mut left: Vec<(Point, Point)> = points.into_iter().map(|point| (point, rounded(&point))).collect();
    let (mut chosen, mut hull): (Vec<Point>, Vec<Point>) = (Vec::new(), Vec::new());
    let mut size = 0.0_f64;
    while chosen.len() < MOST_POINTS {
        let distances = left.iter().map(|(_, point)| if hull.is_empty() { f64::MAX } else { distance_to_hull(point, &hull) });
        let Some((index, farthest)) = distances.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        if farthest <= 1e-9 * size && !hull.is_empty() {
            break;
        }
        let (point, round) = left.swap_remove(index);
        size = hull.first().map_or(size, |first| size.max(distance_squared(first, &round).sqrt()));
        chosen.push(point);
        hull.push(round);
    }
    chosen
}

/// The largest distance, in the adapted norm, of a child's point from the hull of the state's points.
fn overhang(automaton: &Automaton, contraction: &Contraction, covers: &[Option<Vec<Point>>], index: usize) -> f64 {
    let Some(points) = &covers[index] else { return f64::INFINITY };
    let rounded = |point: &Point| contraction.rounded(StateId::new(index), point);
    let hull: Vec<Point> = points.iter().map(rounded).collect();
    let mut worst = 0.0_f64;
    for transition in &automaton.states()[index].transitions {
        let Some(child) = &covers[transition.to.index()] else { return f64::INFINITY };
        for point in child {
            let mapped = transition.operator.apply(&[1.0 - point.iter().sum::<f64>(), point[0], point[1], point[2]]);
            worst = worst.max(distance_to_hull(&rounded(&[mapped[1], mapped[2], mapped[3]]), &hull));
        }
    }
    worst
}

/// An upper bound of the distance from x to the convex hull of points.
fn distance_to_hull(x: &Point, points: &[Point]) -> f64 {
    let offset = offset_from_hull(x, points);
    dot(&offset, &offset).sqrt()
}

/// A point of the convex hull close to x, minus x, by pairwise Frank-Wolfe steps: every iterate is a point of the
/// hull, and convergence is linear on polytopes.
fn offset_from_hull(x: &Point, points: &[Point]) -> Point {
    let relative: Vec<Point> = points.iter().map(|point| subtract(point, x)).collect();
    let Some(start) = (0..relative.len()).min_by(|&a, &b| dot(&relative[a], &relative[a]).total_cmp(&dot(&relative[b], &relative[b])))
    else {
        return [f64::INFINITY; 3];
    };
    let mut weights = vec![0.0; relative.len()];
    weights[start] = 1.0;
    let mut current = relative[start];
    for _ in 0..400 {
        let along = |k: &usize| dot(&relative[*k], &current);
        let toward = (0..relative.len()).min_by(|a, b| along(a).total_cmp(&along(b))).unwrap_or(start);
        let away = (0..relative.len()).filter(|&k| weights[k] > 0.0).max_by(|a, b| along(a).total_cmp(&along(b))).unwrap_or(start);
        let direction = subtract(&relative[toward], &relative[away]);
        let length = dot(&direction, &direction);
        let step = if length > 0.0 { (-dot(&current, &direction) / length).clamp(0.0, weights[away]) } else { 0.0 };
        if step == 0.0 {
            break;
        }
        weights[toward] += step;
        weights[away] -= step;
        if weights[away] < 1e-16 {
            weights[away] = 0.0;
        }
        current = std::array::from_fn(|i| current[i] + step * direction[i]);
    }
    // The iterate itself, from its weights: what was accumulated may have drifted.
    let total: f64 = weights.iter().sum();
    std::array::from_fn(|i| relative.iter().zip(&weights).map(|(p, w)| p[i] * w).sum::<f64>() / total)
}

/// A ball around the points, close to the smallest: Badoiu and Clarkson's walk to the farthest.
fn enclosing_ball(points: &[Point]) -> (Point, f64) {
    let mut centre: Point = std::array::from_fn(|i| points.iter().map(|p| p[i]).sum::<f64>() / points.len() as f64);
    let farthest = |centre: &Point| {
        let squares = points.iter().map(|p| (distance_squared(p, centre), p));
        squares.max_by(|a, b| a.0.total_cmp(&b.0)).map_or((0.0, *centre), |(square, p)| (square, *p))
    };
    let mut best = (centre, farthest(&centre).0);
    for k in 0..400 {
        let (_, point) = farthest(&centre);
        centre = std::array::from_fn(|i| centre[i] + (point[i] - centre[i]) / f64::from(k + 2));
        let square = farthest(&centre).0;
        if square < best.1 {
            best = (centre, square);
        }
    }
    (best.0, best.1.sqrt() * (1.0 + 1e-12))
}
