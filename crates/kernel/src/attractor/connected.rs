//! Which states of affine maps have connected attractors, proven on their operators.
//!
//! The children of a state are the nodes of a graph, with an edge where two of them share a point. If that graph is
//! connected for a state and for all states below it, the attractors are connected (Hata, "On the structure of
//! self-similar sets", Japan J. Appl. Math. 2, 1985, for one state). Here points are compared in double precision, so
//! what is proven is a little less: *no gap is wider than g*. Let shared points of children of any state be at most g
//! apart in the state's adapted norm, in which every map shrinks by r < 1 or more. Any two points of an attractor are
//! joined by a chain of its points with links of at most max(g, r^k diameter), for every k: for k = 0 by the points
//! themselves; for k + 1 by chains through children, each of which has links of at most
//! r max(g, r^k diameter), and by links of at most g from child to child. With k so large that
//! r^k diameter <= g (or, if g = 0, any k) links are at most g. Hence the heights of an attractor along any
//! direction leave no gap wider than those of g.

use super::StateBound;
use super::cell::Point;
use crate::automaton::{Automaton, Contraction, State, StateId, SubdivisionOperator};
use crate::groups::Groups;
use std::collections::BTreeMap;

/// Children of a state beyond which nothing is proven.
const MOST_CHILDREN: usize = 512;
/// Known points of a state.
const MOST_POINTS: usize = 128;
/// Longest cycle whose fixed point is computed.
const LONGEST_CYCLE: usize = 3;
/// Cycles that are followed from a state.
const MOST_WORDS: usize = 4096;
/// Points this close, as a share of the state's size, are taken for one; how far they are apart is kept.
const SAME_POINT: f64 = 1e-9;

/// For every frame state that is proven connected, the widest gap as a share of the radius of its ellipsoid, in the adapted
/// norm.
pub(super) fn connected(automaton: &Automaton, bounds: &[StateBound], contraction: &Contraction) -> Vec<Option<f64>> {
    let states = automaton.states();
    let contracts = |index: usize| contraction.step_norms[index].iter().all(|&norm| norm < 0.999);
    let points: Vec<Vec<Point>> = (0..states.len())
        .map(|index| if states[index].frame && contracts(index) { known_points(automaton, StateId::new(index)) } else { Vec::new() })
        .collect();
    let points = with_images(automaton, points);
    let mut gaps: Vec<Option<f64>> = (0..states.len()).map(|index| gap(automaton, bounds, contraction, &points, index)).collect();
    loop {
        let broken: Vec<usize> = (0..states.len())
            .filter(|&index| gaps[index].is_some() && states[index].transitions.iter().any(|t| gaps[t.to.index()].is_none()))
            .collect();
        if broken.is_empty() {
            break;
        }
        broken.into_iter().for_each(|index| gaps[index] = None);
    }
    let widest = gaps.iter().flatten().fold(0.0_f64, |a, &b| a.max(b));
    let share = |index: usize| match &bounds[index] {
        StateBound::Frame { radius, .. } if *radius > 0.0 => Some(widest / radius),
        _ => None,
    };
    gaps.iter().enumerate().map(|(index, gap)| gap.and_then(|_| share(index))).collect()
}

fn barycentric(point: &Point) -> [f64; 4] {
    [1.0 - point.iter().sum::<f64>(), point[0], point[1], point[2]]
}

fn image(operator: &SubdivisionOperator, point: &Point) -> Point {
    let image = operator.apply(&barycentric(point));
    [image[1], image[2], image[3]]
}

/// Fixed points of the shortest cycles through a state: points of its attractor.
fn known_points(automaton: &Automaton, id: StateId) -> Vec<Point> {
    let mut points = Vec::new();
    let mut level = vec![(id, SubdivisionOperator::identity(4))];
    for _ in 0..LONGEST_CYCLE {
        let mut next = Vec::new();
        for (state, word) in &level {
            for transition in &automaton.state(*state).transitions {
                let columns: Vec<f64> = (0..4).flat_map(|column| word.apply(transition.operator.column(column))).collect();
                let longer = SubdivisionOperator::exact(4, columns);
                if transition.to == id && points.len() < MOST_POINTS {
                    points.extend(fixed_point(&longer));
                }
                next.push((transition.to, longer));
            }
        }
        if points.len() >= MOST_POINTS || next.len() > MOST_WORDS {
            break;
        }
        level = next;
    }
    points
}

/// The fixed point of a map that contracts: its 2^40-th iterate, by squaring.
fn fixed_point(operator: &SubdivisionOperator) -> Option<Point> {
    let mut power = operator.clone();
    for _ in 0..40 {
        let columns: Vec<f64> = (0..4).flat_map(|column| power.apply(power.column(column))).collect();
        // Rounding moves the columns' sums a little: the powers of 1 + 1e-16 must not grow.
        let columns: Vec<f64> = columns.chunks(4).flat_map(|c| [1.0 - (c[1] + c[2] + c[3]), c[1], c[2], c[3]]).collect();
        power = SubdivisionOperator::exact(4, columns);
    }
    let point: Point = std::array::from_fn(|i| power.entry(i + 1, 0));
    // Points that are not known to the last digits prove nothing.
    let again = image(operator, &point);
    let size = point.iter().fold(1.0_f64, |a, x| a.max(x.abs()));
    let exact = point.iter().zip(&again).all(|(a, b)| (a - b).abs() <= 1e-13 * size);
    exact.then_some(point)
}

/// Adds images of known points of children: points with eventually periodic addresses.
fn with_images(automaton: &Automaton, points: Vec<Vec<Point>>) -> Vec<Vec<Point>> {
    let images = |index: usize, state: &State| {
        let mut list = points[index].clone();
        for transition in &state.transitions {
            let room = MOST_POINTS.saturating_sub(list.len());
            list.extend(points[transition.to.index()].iter().take(room).map(|point| image(&transition.operator, point)));
        }
        list
    };
    automaton.states().iter().enumerate().map(|(index, state)| if state.frame { images(index, state) } else { Vec::new() }).collect()
}

/// Joins children that share a known point; the widest gap between points that joined, in the adapted norm, if that
/// connects all of them.
fn gap(automaton: &Automaton, bounds: &[StateBound], contraction: &Contraction, points: &[Vec<Point>], index: usize) -> Option<f64> {
    let state = &automaton.states()[index];
    let StateBound::Frame { reach, .. } = &bounds[index] else { return None };
    if points[index].is_empty() || state.transitions.len() > MOST_CHILDREN {
        return None;
    }
    let size = reach.as_flattened().iter().fold(0.0_f64, |a, x| a.max(x.abs()));
    let same = SAME_POINT * size;
    let mut groups = Groups::new(state.transitions.len());
    let mut met: BTreeMap<[i64; 3], (usize, Point)> = BTreeMap::new();
    let mut widest = 0.0_f64;
    for (child, transition) in state.transitions.iter().enumerate() {
        for point in &points[transition.to.index()] {
            let point = image(&transition.operator, point);
            // A point within `same` of this one lies in one of the cells of its corners.
            for corner in 0..8 {
                let key = std::array::from_fn(|axis| ((point[axis] / same + f64::from(corner >> axis & 1) - 0.5) * 0.5).floor() as i64);
                let (other, there) = *met.entry(key).or_insert((child, point));
                if groups.of(other) == groups.of(child) {
                    continue;
                }
                let apart = contraction.distance(StateId::new(index), &barycentric(&there), &barycentric(&point));
                if (0..3).all(|axis| (there[axis] - point[axis]).abs() <= same) {
                    groups.join(other, child);
                    widest = widest.max(apart);
                }
            }
        }
    }
    // Points themselves are known up to rounding.
    groups.all().into_iter().all(|group| group == 0).then_some(widest + 1e-12 * size)
}
