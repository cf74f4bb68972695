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
use super::cell::{Point, distance_squared, dot, subtract};
use crate::automaton::{Automaton, Contraction, StateId};

/// Points that stand for a state's attractor, in coordinates of its frame.
#[derive(Clone, Debug, PartialEq)]
pub struct PointCover {
    /// Points of the attractor.
    pub points: Vec<Point>,
    /// Radius of a ball that contains them.
    pub radius: f64,
    /// The attractor is within this distance of their hull.
    pub excess: f64,
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

/// Covers of all states; `None` where maps do not contract at each step in the Euclidean norm.
pub(super) fn covers(automaton: &Automaton, bounds: &[StateBound], contraction: &Contraction) -> Vec<Option<PointCover>> {
    let states = automaton.states();
    let frame = |index: usize| states[index].frame;
    let mut covers: Vec<Option<Vec<Point>>> =
        (0..states.len()).map(|index| frame(index).then(|| extremes(automaton, bounds, StateId::new(index)))).collect();
    let norms: Vec<Vec<f64>> = states.iter().map(|state| state.transitions.iter().map(|t| linear_norm(&t.operator)).collect()).collect();
    let contracts = norms.iter().zip(states).filter(|(_, state)| state.frame).flat_map(|(norms, _)| norms).all(|&norm| norm < 0.99);
    if !contracts || contraction.upper >= 1.0 {
        covers.iter_mut().for_each(|cover| *cover = None);
    }
    // delta_v = max distance of T_e s from conv(S_v); the excess solves excess_v >= delta_v + s_e excess_w.
    let deltas: Vec<f64> = (0..states.len()).map(|index| overhang(automaton, &covers, index)).collect();
    let mut excess = vec![0.0_f64; states.len()];
    // Frames lead to frames: other states have neither covers nor norms that matter.
    let frames = || (0..states.len()).filter(|&index| frame(index));
    let worst = frames().map(|index| deltas[index]).fold(0.0, f64::max);
    let largest = frames().flat_map(|index| &norms[index]).fold(0.0_f64, |a, &b| a.max(b));
    if contracts {
        excess.fill(worst / (1.0 - largest));
        for _ in 0..100 {
            // Decreasing from above: every iterate satisfies the inequality.
            excess = (0..states.len())
                .map(|index| {
                    let children = states[index].transitions.iter().zip(&norms[index]);
                    deltas[index] + children.map(|(t, norm)| norm * excess[t.to.index()]).fold(0.0, f64::max)
                })
                .collect();
        }
    }
    covers
        .into_iter()
        .zip(excess)
        .map(|(points, excess)| {
            let points = points.filter(|points| !points.is_empty())?;
            let radius = enclosing_radius(&points);
            let rounding = 1e-12 * points.iter().flatten().fold(radius, |a, x| a.max(x.abs()));
            Some(PointCover { points, radius, excess: excess * (1.0 + 1e-9) + rounding })
        })
        .collect()
}

/// Norm bound of the linear part of a frame operator.
fn linear_norm(operator: &crate::automaton::SubdivisionOperator) -> f64 {
    let (rows, columns) = (operator.rows(), operator.columns());
    let entry = |i: usize, j: usize| operator.entry(i, j) - operator.entry(i, 0);
    let product = |a: usize, b: usize| (1..columns).map(|j| entry(a, j) * entry(b, j)).sum::<f64>();
    let row_sums = (1..rows).map(|a| (1..rows).map(|b| product(a, b).abs()).sum::<f64>()).fold(0.0, f64::max);
    let frobenius = (1..rows).flat_map(|a| (1..rows).map(move |b| (a, b))).map(|(a, b)| product(a, b).powi(2)).sum::<f64>().sqrt();
    row_sums.min(frobenius).sqrt()
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
fn extremes(automaton: &Automaton, bounds: &[StateBound], id: StateId) -> Vec<Point> {
    let mut points: Vec<Point> = Vec::new();
    let mut size = 0.0_f64;
    for direction in directions() {
        let Some(point) = extreme(automaton, bounds, id, &direction) else { continue };
        size = points.first().map_or(size, |first| size.max(distance_squared(first, &point).sqrt()));
        if points.iter().all(|known| distance_squared(known, &point).sqrt() > 1e-7 * size.max(f64::MIN_POSITIVE)) {
            points.push(point);
        }
        if points.len() > MOST_EXTREMES {
            break;
        }
    }
    prune(points, size)
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
        let best = transitions.iter().map(|transition| {
            let child = image(&frame, &transition.operator);
            (reach(automaton, bounds, transition.to, &child, direction, 2), transition.to, child)
        });
        let (_, next, child) = best.max_by(|p, q| p.0.total_cmp(&q.0))?;
        (state, frame) = (next, child);
    }
    let StateBound::Frame { centre, .. } = &bounds[state.index()] else { return None };
    Some(std::array::from_fn(|i| frame[0][i] + (0..3).map(|j| (frame[j + 1][i] - frame[0][i]) * centre[j]).sum::<f64>()))
}

fn image(frame: &[Point; 4], operator: &crate::automaton::SubdivisionOperator) -> [Point; 4] {
    std::array::from_fn(|column| {
        let weights = operator.column(column);
        std::array::from_fn(|i| (0..4).map(|k| frame[k][i] * weights[k]).sum())
    })
}

/// The box bound of a cell's support, after looking `depth` levels ahead.
fn reach(automaton: &Automaton, bounds: &[StateBound], state: StateId, frame: &[Point; 4], direction: &Point, depth: u32) -> f64 {
    let StateBound::Frame { low, high, .. } = &bounds[state.index()] else { return f64::NEG_INFINITY };
    let transitions = &automaton.state(state).transitions;
    // Looking ahead is bounded in width too.
    if depth > 0 && transitions.len().pow(depth) <= 64 {
        let ahead = transitions.iter().map(|t| reach(automaton, bounds, t.to, &image(frame, &t.operator), direction, depth - 1));
        return ahead.fold(f64::NEG_INFINITY, f64::max);
    }
    let mut sum = dot(&frame[0], direction);
    for j in 0..3 {
        let along = dot(&subtract(&frame[j + 1], &frame[0]), direction);
        sum += (along * low[j]).max(along * high[j]);
    }
    sum
}

/// Chooses points one by one, each time the farthest from the hull of those chosen, until the hull holds all or
/// [`MOST_POINTS`] are chosen: what is left out shows in the excess.
fn prune(mut points: Vec<Point>, size: f64) -> Vec<Point> {
    let mut chosen: Vec<Point> = Vec::new();
    while chosen.len() < MOST_POINTS {
        let distances = points.iter().map(|point| if chosen.is_empty() { f64::MAX } else { distance_to_hull(point, &chosen) });
        let Some((index, farthest)) = distances.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        if farthest <= 1e-9 * size && !chosen.is_empty() {
            break;
        }
        chosen.push(points.swap_remove(index));
    }
    chosen
}

fn overhang(automaton: &Automaton, covers: &[Option<Vec<Point>>], index: usize) -> f64 {
    let Some(points) = &covers[index] else { return f64::INFINITY };
    let mut worst = 0.0_f64;
    for transition in &automaton.states()[index].transitions {
        let Some(child) = &covers[transition.to.index()] else { return f64::INFINITY };
        for point in child {
            let mapped = transition.operator.apply(&[1.0 - point.iter().sum::<f64>(), point[0], point[1], point[2]]);
            worst = worst.max(distance_to_hull(&[mapped[1], mapped[2], mapped[3]], points));
        }
    }
    worst
}

/// An upper bound of the distance from x to the convex hull of points, by pairwise Frank-Wolfe steps: every
/// iterate is a point of the hull, and convergence is linear on polytopes.
fn distance_to_hull(x: &Point, points: &[Point]) -> f64 {
    let relative: Vec<Point> = points.iter().map(|point| subtract(point, x)).collect();
    let Some(start) = (0..relative.len()).min_by(|&a, &b| dot(&relative[a], &relative[a]).total_cmp(&dot(&relative[b], &relative[b])))
    else {
        return f64::INFINITY;
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
    let point: Point = std::array::from_fn(|i| relative.iter().zip(&weights).map(|(p, w)| p[i] * w).sum::<f64>() / total);
    dot(&point, &point).sqrt()
}

/// Radius of a ball around the points, close to the smallest: Badoiu and Clarkson's walk to the farthest.
fn enclosing_radius(points: &[Point]) -> f64 {
    let mut centre: Point = std::array::from_fn(|i| points.iter().map(|p| p[i]).sum::<f64>() / points.len() as f64);
    let farthest = |centre: &Point| {
        let squares = points.iter().map(|p| (distance_squared(p, centre), p));
        squares.max_by(|a, b| a.0.total_cmp(&b.0)).map_or((0.0, *centre), |(square, p)| (square, *p))
    };
    let mut best = farthest(&centre).0;
    for k in 0..400 {
        let (_, point) = farthest(&centre);
        centre = std::array::from_fn(|i| centre[i] + (point[i] - centre[i]) / f64::from(k + 2));
        best = best.min(farthest(&centre).0);
    }
    best.sqrt() * (1.0 + 1e-12)
}
