//! Bounds of every state, computed once.
//!
//! Two kinds. *Hull*: a cell with control points Q lies within `margin * diam(Q)` of their convex hull.
//! For x in the state's attractor (entries of any sign, sum 1) let m be the sum of the negative parts:
//! x = (1 + m) p - m q with p, q in the simplex, so Q x = Q p + m (Q p - Q q). Non-negative operators
//! give margin 0, the convex-hull property. *Frame*: the four control points are an affine frame, and the
//! attractor lies in the ellipsoid c + {sum_j reach_j x_j, |x| <= 1}; the image of the ellipsoid under a
//! cell's frame has the radius |F reach|, its spectral norm. In both kinds the bound holds for the
//! attractor *and* for the centres, control points and drawings of all descendants, so that it may prune
//! searches over leaves.
//!
//! Products. The points of a product's attractor are the products x_A x x_B of points of the factors' attractors, whose
//! subdivisions are independent, and |x_A x x_B|_1 = |x_A|_1 |x_B|_1. As 1 + 2 m = sup |x|_1, the margins obey
//! 1 + 2 m = (1 + 2 m_A)(1 + 2 m_B), exactly; with products of the factors' centres as centres, these too.

use super::cell::{Point, dot};
use crate::automaton::{Automaton, Contraction, LeafPrimitive, State, StateId};
use crate::order::ordered_by;
use std::collections::BinaryHeap;

/// Bound of a state's attractor in its barycentric space.
#[derive(Clone, Debug, PartialEq)]
pub enum StateBound {
    /// Within `margin * diam(Q)` of the control points' hull.
    Hull {
        /// A point of the space, taken as the centre of cells.
        centre: Vec<f64>,
        /// See the module's comment; not negative.
        margin: f64,
    },
    /// In an ellipsoid of the affine frame.
    Frame {
        /// Its centre, in coordinates of the frame.
        centre: [f64; 3],
        /// Columns of the matrix that maps the unit ball onto it: the adapted norm's ball of `radius`.
        reach: [[f64; 3]; 3],
        /// Its radius in the adapted norm.
        radius: f64,
        /// Whether the frame's unit ball is round and every map a similarity: then the radius of a
        /// child is its parent's times the map's ratio.
        similar: bool,
        /// Ratio of each transition in the adapted norm.
        ratios: Vec<f64>,
        /// Lower ends of the attractor's coordinates in the frame.
        low: [f64; 3],
        /// Upper ends.
        high: [f64; 3],
    },
}

impl StateBound {
    /// How far cells may leave the hull of their control points, as a share of its diameter.
    #[must_use]
    pub fn margin(&self) -> f64 {
        match self {
            Self::Hull { margin, .. } => *margin,
            Self::Frame { .. } => 0.0,
        }
    }

    /// Bounds of values . x over the attractor.
    pub(crate) fn range(&self, values: &[f64]) -> [f64; 2] {
        match self {
            Self::Hull { margin, .. } => {
                let [least, most] = extremes_of(values);
                let beyond = if *margin > 0.0 { margin * (most - least) } else { 0.0 };
                [least - beyond, most + beyond]
            }
            Self::Frame { low, high, centre, reach, .. } => {
                let slopes: Point = std::array::from_fn(|j| values[j + 1] - values[0]);
                let (mut least, mut most) = (values[0], values[0]);
                for j in 0..3 {
                    let (a, b) = (slopes[j] * low[j], slopes[j] * high[j]);
                    least += a.min(b);
                    most += a.max(b);
                }
                // The ellipsoid's support: the image of the unit ball under its matrix.
                let middle = values[0] + dot(&slopes, centre);
                let radius = reach.iter().map(|column| dot(&slopes, column).powi(2)).sum::<f64>().sqrt();
                [least.max(middle - radius), most.min(middle + radius)]
            }
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        match self {
            Self::Hull { centre, margin } => margin.is_finite() && centre.iter().all(|x| x.is_finite()),
            Self::Frame { centre, reach, .. } => centre.iter().chain(reach.as_flattened()).all(|x| x.is_finite()),
        }
    }
}

/// The least and the largest of some values.
pub(crate) fn extremes(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], value| [least.min(value), most.max(value)])
}

/// The same, of four at a time: one alone would wait for every comparison.
fn extremes_of(values: &[f64]) -> [f64; 2] {
    let (parts, rest) = values.as_chunks::<4>();
    let (mut least, mut most) = ([f64::INFINITY; 4], [f64::NEG_INFINITY; 4]);
    for part in parts {
        for k in 0..4 {
            least[k] = if part[k] < least[k] { part[k] } else { least[k] };
            most[k] = if part[k] > most[k] { part[k] } else { most[k] };
        }
    }
    let [low, high] = extremes(rest.iter().copied());
    [least.into_iter().fold(low, f64::min), most.into_iter().fold(high, f64::max)]
}

/// Bounds all states of a convergent automaton.
pub(super) fn bound_states(automaton: &Automaton, contraction: &Contraction) -> Vec<StateBound> {
    let centres = centres(automaton);
    let radii = radii(automaton, contraction, &centres);
    let states = automaton.states();
    let round = |state: usize| is_round(&contraction.unit_ball(StateId::new(state)));
    // A similarity in a round norm: the ratio is attained in every direction.
    let all_similar = (0..states.len())
        .filter(|&state| states[state].frame)
        .all(|state| round(state) && states[state].transitions.iter().all(|transition| is_similarity(&transition.operator)));
    let mut bounds: Vec<StateBound> = (0..states.len())
        .map(|index| {
            let state = &states[index];
            if state.frame {
                return frame_bound(index, contraction, &centres[index], radii[index], all_similar);
            }
            if is_product(automaton, index) {
                // Filled in below.
                return StateBound::Hull { centre: Vec::new(), margin: 0.0 };
            }
            let margin = if hull_holds(automaton, index) { 0.0 } else { margin(automaton, contraction, &centres, &radii, index) };
            // Inside the hull any convex weights will do, and equal ones are closest to the middle.
            let centre = if margin == 0.0 { vec![1.0 / state.dimension as f64; state.dimension] } else { centres[index].clone() };
            StateBound::Hull { centre, margin }
        })
        .collect();
    for index in 0..states.len() {
        let factors = automaton.factors(StateId::new(index));
        if !factors.is_empty() {
            bounds[index] = product_bound(factors, &bounds, &centres);
        }
    }
    shrink_boxes(automaton, &mut bounds);
    bounds
}

/// See the module's comment.
fn product_bound(factors: &[StateId], bounds: &[StateBound], centres: &[Vec<f64>]) -> StateBound {
    let excess = factors.iter().map(|factor| 1.0 + 2.0 * bounds[factor.index()].margin()).product::<f64>() - 1.0;
    let margin = if excess > 0.0 { 0.5 * excess * (1.0 + 1e-9) } else { 0.0 };
    let dimension: usize = factors.iter().map(|factor| centres[factor.index()].len()).product();
    let centre = if margin == 0.0 { vec![1.0 / dimension as f64; dimension] } else { product_point(factors, centres) };
    StateBound::Hull { centre, margin }
}

/// The product of points of the factors.
fn product_point(factors: &[StateId], points: &[Vec<f64>]) -> Vec<f64> {
    factors
        .iter()
        .fold(vec![1.0], |product, factor| product.iter().flat_map(|x| points[factor.index()].iter().map(move |y| x * y)).collect())
}

/// Tightens the coordinate boxes: each is replaced by its intersection with the hull of its children's
/// images, outward by a little for rounding, which is valid at every step.
fn shrink_boxes(automaton: &Automaton, bounds: &mut [StateBound]) {
    for _ in 0..120 {
        let mut change = 0.0_f64;
        for index in (0..bounds.len()).filter(|&index| automaton.states()[index].frame) {
            let mut hull = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
            for transition in &automaton.states()[index].transitions {
                let StateBound::Frame { low, high, .. } = &bounds[transition.to.index()] else { return };
                for axis in 0..3 {
                    let shift = transition.operator.entry(axis + 1, 0);
                    let (mut least, mut most, mut size) = (shift, shift, shift.abs());
                    for j in 0..3 {
                        let entry = transition.operator.entry(axis + 1, j + 1) - shift;
                        let (a, b) = (entry * low[j], entry * high[j]);
                        least += a.min(b);
                        most += a.max(b);
                        size += a.abs().max(b.abs());
                    }
                    hull.0[axis] = hull.0[axis].min(least - 1e-15 * size);
                    hull.1[axis] = hull.1[axis].max(most + 1e-15 * size);
                }
            }
            let StateBound::Frame { low, high, .. } = &mut bounds[index] else { return };
            for axis in 0..3 {
                let (least, most) = (hull.0[axis].max(low[axis]), hull.1[axis].min(high[axis]));
                change = change.max((least - low[axis] + high[axis] - most) / (high[axis] - low[axis]).max(f64::MIN_POSITIVE));
                (low[axis], high[axis]) = (least, most);
            }
        }
        if change < 1e-14 {
            break;
        }
    }
}

fn frame_bound(index: usize, contraction: &Contraction, centre: &[f64], radius: f64, similar: bool) -> StateBound {
    let columns = contraction.unit_ball(StateId::new(index));
    let mut reach = [[0.0; 3]; 3];
    for (column, unit) in reach.iter_mut().zip(&columns) {
        for (entry, &value) in column.iter_mut().zip(unit) {
            *entry = value * radius;
        }
    }
    let centre = [centre[1], centre[2], centre[3]];
    let spread = |axis: usize| reach.iter().map(|column| column[axis] * column[axis]).sum::<f64>().sqrt() * (1.0 + 1e-12);
    let low = std::array::from_fn(|axis| centre[axis] - spread(axis));
    let high = std::array::from_fn(|axis| centre[axis] + spread(axis));
    StateBound::Frame { centre, reach, radius, similar, ratios: contraction.step_norms[index].clone(), low, high }
}

fn is_round(unit_ball: &[Vec<f64>]) -> bool {
    let size = unit_ball[0][0];
    unit_ball.iter().enumerate().all(|(i, column)| {
        column.iter().enumerate().all(|(j, &entry)| (entry - if i == j { size } else { 0.0 }).abs() <= 1e-12 * size.abs())
    })
}

/// Whether the linear part A of a 4 x 4 frame operator satisfies A^T A = s^2 I.
fn is_similarity(operator: &crate::automaton::SubdivisionOperator) -> bool {
    let entry = |i: usize, j: usize| operator.entry(i + 1, j + 1) - operator.entry(i + 1, 0);
    let dot = |a: usize, b: usize| (0..3).map(|i| entry(i, a) * entry(i, b)).sum::<f64>();
    let square = dot(0, 0);
    (0..3).all(|a| (0..3).all(|b| (dot(a, b) - if a == b { square } else { 0.0 }).abs() <= 1e-13 * square))
}

/// Whether a state is the product of others: then its bounds are made of theirs.
fn is_product(automaton: &Automaton, index: usize) -> bool {
    !automaton.factors(StateId::new(index)).is_empty()
}

/// A point near the middle of each state's attractor: the fixed point of averaging over transitions for
/// barycentric states, the middle of the box of a sample for frames; none for products.
fn centres(automaton: &Automaton) -> Vec<Vec<f64>> {
    let states = automaton.states();
    let start = |(index, state): (usize, &State)| {
        if is_product(automaton, index) { Vec::new() } else { vec![1.0 / state.dimension as f64; state.dimension] }
    };
    let mut centres: Vec<Vec<f64>> = states.iter().enumerate().map(start).collect();
    for _ in 0..200 {
        let next: Vec<Vec<f64>> = states
            .iter()
            .zip(&centres)
            .map(|(state, own)| {
                if state.transitions.is_empty() || own.is_empty() {
                    return own.clone();
                }
                let mut mean = vec![0.0; state.dimension];
                for transition in &state.transitions {
                    let image = transition.operator.apply(&centres[transition.to.index()]);
                    mean.iter_mut().zip(image).for_each(|(sum, value)| *sum += value / state.transitions.len() as f64);
                }
                mean
            })
            .collect();
        let change = centres.iter().flatten().zip(next.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        centres = next;
        if change < 1e-12 {
            break;
        }
    }
    let middles: Vec<Option<Vec<f64>>> =
        (0..states.len()).map(|index| states[index].frame.then(|| middle(automaton, &centres, index))).collect();
    centres.into_iter().zip(middles).map(|(mean, middle)| middle.unwrap_or(mean)).collect()
}

/// Number of sampled points that place the centre of a frame's ball.
const SAMPLE: usize = 1500;

/// The middle of the box of a breadth-first sample of images of the centres.
fn middle(automaton: &Automaton, centres: &[Vec<f64>], index: usize) -> Vec<f64> {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let mut level = vec![(StateId::new(index), crate::automaton::SubdivisionOperator::identity(4))];
    for _ in 0..40 {
        if level.len() > SAMPLE {
            break;
        }
        let mut next = Vec::new();
        for (state, word) in &level {
            for transition in &automaton.state(*state).transitions {
                let columns: Vec<f64> = (0..4).flat_map(|column| word.apply(transition.operator.column(column))).collect();
                next.push((transition.to, crate::automaton::SubdivisionOperator::exact(4, columns)));
            }
        }
        if next.is_empty() {
            break;
        }
        level = next;
    }
    for (state, word) in &level {
        let point = word.apply(&centres[state.index()]);
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis + 1]);
            high[axis] = high[axis].max(point[axis + 1]);
        }
    }
    let centre: Vec<f64> = (0..3).map(|axis| 0.5 * (low[axis] + high[axis])).collect();
    vec![1.0 - centre.iter().sum::<f64>(), centre[0], centre[1], centre[2]]
}

/// Radii R_v in the adapted norm: T_e(ball_w) lies in ball_v for every transition when steps contract,
/// else R bounds the sum of all steps of any path. Drawings lie in their balls too. Products have no part in it.
fn radii(automaton: &Automaton, contraction: &Contraction, centres: &[Vec<f64>]) -> Vec<f64> {
    let states = automaton.states();
    let drawn: Vec<f64> = (0..states.len()).map(|index| drawing_radius(&states[index], contraction, &centres[index], index)).collect();
    let steps: Vec<Vec<f64>> = states
        .iter()
        .enumerate()
        .map(|(index, state)| {
            let step = |transition: &crate::automaton::Transition| {
                let image = transition.operator.apply(&centres[transition.to.index()]);
                contraction.distance(StateId::new(index), &centres[index], &image)
            };
            if is_product(automaton, index) { Vec::new() } else { state.transitions.iter().map(step).collect() }
        })
        .collect();
    let alone = |(index, norms): (usize, &'_ Vec<f64>)| {
        if is_product(automaton, index) { 0.0 } else { norms.iter().fold(0.0_f64, |a, &b| a.max(b)) }
    };
    let largest = contraction.step_norms.iter().enumerate().map(alone).fold(0.0_f64, f64::max);
    let longest = steps.iter().flatten().fold(0.0_f64, |a, &b| a.max(b));
    let global = contraction.sum_of_norms() * longest + contraction.transient * drawn.iter().fold(0.0_f64, |a, &b| a.max(b));
    if largest >= 0.999 {
        return vec![global * (1.0 + 1e-9); states.len()];
    }
    // From above, the iteration decreases to the fixed point and every iterate is valid; a last inflation
    // covers rounding.
    let start = longest / (1.0 - largest) + drawn.iter().fold(0.0_f64, |a, &b| a.max(b)) / (1.0 - largest);
    let mut radii = vec![start; states.len()];
    for _ in 0..300 {
        radii = (0..states.len())
            .map(|index| {
                let reach = |(position, transition): (usize, &crate::automaton::Transition)| {
                    steps[index][position] + contraction.step_norms[index][position] * radii[transition.to.index()]
                };
                states[index].transitions.iter().enumerate().take(steps[index].len()).map(reach).fold(drawn[index], f64::max)
            })
            .collect();
    }
    radii.iter().map(|radius| radius * (1.0 + 1e-9)).collect()
}

fn drawing_radius(state: &State, contraction: &Contraction, centre: &[f64], index: usize) -> f64 {
    let LeafPrimitive::Drawn(drawing) = &state.leaf else { return 0.0 };
    let distance = |vertex: &[f64; 3]| {
        let point = [1.0 - vertex.iter().sum::<f64>(), vertex[0], vertex[1], vertex[2]];
        contraction.distance(StateId::new(index), centre, &point)
    };
    drawing.vertices.iter().map(distance).fold(0.0, f64::max)
}

/// Whether all operators on all paths from the state are non-negative.
fn hull_holds(automaton: &Automaton, index: usize) -> bool {
    let mut seen = vec![false; automaton.states().len()];
    let mut stack = vec![index];
    while let Some(current) = stack.pop() {
        if std::mem::replace(&mut seen[current], true) {
            continue;
        }
        for transition in &automaton.states()[current].transitions {
            if !transition.operator.is_nonnegative() {
                return false;
            }
            stack.push(transition.to.index());
        }
    }
    true
}

struct Branch {
    bound: f64,
    state: usize,
    /// Column-major product, n x n_state.
    word: Vec<f64>,
    depth: i32,
}

ordered_by!(Branch, |this, other| this.bound.total_cmp(&other.bound));

/// Work allowed to tighten the margin of one state, in multiplications.
const MARGIN_WORK: f64 = 3e6;

/// m = (sup |x|_1 - 1) / 2 over the attractor and the centres of all descendants, from above, by
/// best-first expansion of words: |T_w x|_1 <= |T_w c|_1 + (norm ratio) |T_w|_V-bound R.
fn margin(automaton: &Automaton, contraction: &Contraction, centres: &[Vec<f64>], radii: &[f64], index: usize) -> f64 {
    let states = automaton.states();
    let n = states[index].dimension;
    let ratios: Vec<f64> = (0..states.len()).map(|state| contraction.sum_norm_ratio(StateId::new(state)) * radii[state]).collect();
    // |T_w y|_1 for zero-sum y with |y|_1 <= s is at most s/2 max |t_j - t_k|_1 over columns.
    let spread = |word: &[f64], columns: usize| {
        let column = |j: usize| &word[j * n..(j + 1) * n];
        let mut largest = 0.0_f64;
        for j in 0..columns {
            for k in 0..j {
                largest = largest.max(column(j).iter().zip(column(k)).map(|(a, b)| (a - b).abs()).sum());
            }
        }
        0.5 * largest
    };
    let evaluate = |word: &[f64], state: usize| {
        let mut point = vec![0.0; n];
        for (column, &weight) in centres[state].iter().enumerate() {
            point.iter_mut().zip(&word[column * n..(column + 1) * n]).for_each(|(sum, &entry)| *sum += entry * weight);
        }
        let size: f64 = point.iter().map(|x| x.abs()).sum();
        (size, size + spread(word, states[state].dimension) * ratios[state])
    };
    let mut heap = BinaryHeap::new();
    let word = crate::automaton::SubdivisionOperator::identity(n).entries().to_vec();
    let (mut reached, bound) = evaluate(&word, index);
    heap.push(Branch { bound, state: index, word, depth: 0 });
    let mut work = 0.0;
    while let Some(branch) = heap.pop() {
        if work > MARGIN_WORK || branch.bound <= reached + 0.01 * (reached - 1.0).max(0.01) || branch.depth > 200 {
            return (0.5 * (branch.bound.max(reached) - 1.0)).max(0.0) * (1.0 + 1e-9);
        }
        for transition in &states[branch.state].transitions {
            let (rows, columns) = (transition.operator.rows(), transition.operator.columns());
            work += (n * rows * columns + n * columns * columns) as f64;
            let mut product = vec![0.0; n * columns];
            for column in 0..columns {
                for (inner, &weight) in transition.operator.column(column).iter().enumerate() {
                    for row in 0..n {
                        product[column * n + row] += branch.word[inner * n + row] * weight;
                    }
                }
            }
            let (size, bound) = evaluate(&product, transition.to.index());
            reached = reached.max(size);
            heap.push(Branch { bound, state: transition.to.index(), word: product, depth: branch.depth + 1 });
        }
    }
    (0.5 * (reached - 1.0)).max(0.0)
}
