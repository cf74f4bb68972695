//! Parameters of smooth faces, from the invariant subspaces of their operators.
//!
//! A face state s has linear precision (see `precision`) when functionals G_s (2 x n) exist with
//! G_s T_e = M_e G_w + t_e 1^T for all transitions e: s -> w, that is, when the spans W_s of the rows 1 and G_s satisfy
//! W_s T_e in W_w. The maps p -> M_e p + t_e may turn the plane, since faces of a mesh see their children from any corner.
//! W is found component by component of the control graph, children first. On a cycle of s with product T, W_s is an
//! invariant subspace of row vectors, W_s T = W_s; for smooth surfaces it belongs to the three largest eigenvalues, to
//! which orthogonal iteration converges, and W_s T_e gives the other states of the component. A state on no cycle (a
//! crease that fades) has for W_s all rows x with x T_e in W_w for all e: a null space. What is found is verified on
//! every transition, so that a wrong guess costs an opportunity, never a bound. Extraordinary states fail: the maps of
//! their regular children span another plane. Being one cell in a ring of every level, they need no second order.
//!
//! Bounds: in coordinates in which every domain D_s has its first corner at 0, the second at (1, 0), the last at (0, 1),
//! let |M_e| <= l < 1 for all transitions below s, and |G_s T_e - M_e G_w - t_e 1^T| <= e columnwise. If the polygons
//! satisfy D_s = union of M_e D_w + t_e, they are the attractors of the parameter maps, these being contractions. For x
//! in A_s, x = T_e y with y in A_w, G_s x is within (1 + 2 m) e of M_e G_w y + t_e, so the distance d of G A from D obeys
//! d <= l d + (1 + 2 m) e, and so does that of D from G A: d <= (1 + 2 m) e / (1 - l).

use super::precision::{LinearPrecision, MISS, SAME, corners, evaluate, fills, null_space, scaled};
use super::{StateBound, sites};
use crate::automaton::{Automaton, LeafPrimitive, StateId, SubdivisionOperator};

/// States of more control points are not examined: they surround vertices or faces of high valence.
const MOST_POINTS: usize = 40;
/// Steps of orthogonal iteration: eigenvalues of ratio 2/3 are told apart to 1e-17.
const STEPS: usize = 100;
/// The parameter maps must contract by this, or better.
const MOST_RATIO: f64 = 0.95;

/// Three orthonormal rows that span W: the first is constant.
pub(super) type Rows = [Vec<f64>; 3];

/// The precision of every face state that has it.
pub(super) fn precisions(automaton: &Automaton, bounds: &[StateBound]) -> Vec<Option<LinearPrecision>> {
    let rows = rows(automaton);
    let unit: Vec<Option<LinearPrecision>> =
        rows.iter().enumerate().map(|(index, rows)| unit(automaton, bounds, index, rows.as_ref()?)).collect();
    let checks: Vec<Option<Check>> = (0..unit.len()).map(|index| check(automaton, &unit, index)).collect();
    let holds = automaton.hereditary(checks.iter().map(Option::is_some).collect());
    let precision = |index: usize| {
        let mut precision = unit[index].clone().filter(|_| holds[index])?;
        let below = sites::reachable(automaton, StateId::new(index));
        let checks = || below.iter().filter_map(|&state| checks[state].as_ref());
        let (miss, ratio) = checks().fold((0.0_f64, 0.0_f64), |(miss, ratio), check| (miss.max(check.miss), ratio.max(check.ratio)));
        let margin = below.iter().map(|&state| bounds[state].margin()).fold(0.0, f64::max);
        precision.residual = ((1.0 + 2.0 * margin) * (miss + 1e-15) + 4.0 * SAME.sqrt()) / (1.0 - ratio);
        (precision.residual <= 1e3 * SAME.sqrt()).then_some(precision)
    };
    (0..unit.len()).map(precision).collect()
}

/// Parameters of a state's points in its own unit, their residual left open.
fn unit(automaton: &Automaton, bounds: &[StateBound], index: usize, rows: &Rows) -> Option<LinearPrecision> {
    let raw: Vec<[f64; 2]> = rows[1].iter().zip(&rows[2]).map(|(&a, &b)| [a, b]).collect();
    let domain: Vec<[f64; 2]> = corners(&automaton.states()[index].leaf)?.iter().map(|corner| evaluate(&raw, corner)).collect();
    scaled(&raw, &domain, 0.0, bounds[index].margin())
}

/// How well the functionals of a state fit those of its children.
struct Check {
    miss: f64,
    /// The largest norm of a parameter map.
    ratio: f64,
}

fn check(automaton: &Automaton, unit: &[Option<LinearPrecision>], index: usize) -> Option<Check> {
    let own = unit[index].as_ref()?;
    let mut check = Check { miss: 0.0, ratio: 0.0 };
    let mut children = Vec::new();
    for transition in &automaton.states()[index].transitions {
        let child = unit[transition.to.index()].as_ref()?;
        let image = |column: usize| evaluate(&own.parameters, transition.operator.column(column));
        // The affine map from the child's parameters to ours that fits best: its columns are t, M.
        let mut map = [[0.0; 2]; 3];
        for (column, fit) in child.fit.iter().enumerate() {
            let at = image(column);
            map.iter_mut().zip(fit).for_each(|(sum, weight)| (0..2).for_each(|i| sum[i] += weight * at[i]));
        }
        for (column, p) in child.parameters.iter().enumerate() {
            let at = image(column);
            let off = |i: usize| at[i] - (map[0][i] + map[1][i] * p[0] + map[2][i] * p[1]);
            check.miss = check.miss.max(off(0).hypot(off(1)));
        }
        check.ratio = check.ratio.max(norm(&map[1], &map[2]));
        let corners = corners(&automaton.states()[transition.to.index()].leaf)?;
        children.push(corners.iter().map(|corner| evaluate(&own.parameters, &transition.operator.apply(corner))).collect::<Vec<_>>());
    }
    (check.miss <= MISS && check.ratio <= MOST_RATIO && fills(&own.domain, &children)).then_some(check)
}

/// The spectral norm of the 2 x 2 matrix with these columns.
fn norm(a: &[f64; 2], b: &[f64; 2]) -> f64 {
    let (aa, bb, ab) = (a[0] * a[0] + a[1] * a[1], b[0] * b[0] + b[1] * b[1], a[0] * b[0] + a[1] * b[1]);
    let half = 0.5 * (aa + bb);
    (half + (0.25 * (aa - bb) * (aa - bb) + ab * ab).sqrt()).sqrt()
}

/// W of every face state for which one is found.
fn rows(automaton: &Automaton) -> Vec<Option<Rows>> {
    let states = automaton.states();
    let face = |index: usize| {
        let state = &states[index];
        let corners = if let LeafPrimitive::Polygon(corners) = &state.leaf { corners.len() } else { 0 };
        // Products have what their factors have, and their operators stay factors.
        let product = !automaton.factors(StateId::new(index)).is_empty();
        corners >= 3 && !product && state.dimension >= 3 && state.dimension <= MOST_POINTS && !state.frame && !state.transitions.is_empty()
    };
    let mut rows: Vec<Option<Rows>> = vec![None; states.len()];
    for component in components(automaton) {
        let inside = |index: usize| component.binary_search(&index).is_ok();
        let below = component.iter().flat_map(|&index| &states[index].transitions).map(|transition| transition.to.index());
        if !component.iter().all(|&index| face(index)) || below.clone().any(|index| !inside(index) && rows[index].is_none()) {
            continue;
        }
        let first = component[0];
        match cycle(automaton, &component) {
            None => rows[first] = above(automaton, first, &rows),
            Some(product) => rows[first] = dominant(&product),
        }
        let mut stack = vec![first];
        while let Some(own) = stack.pop().and_then(|index| rows[index].clone().map(|rows| (index, rows))) {
            for transition in &states[own.0].transitions {
                let child = transition.to.index();
                if inside(child) && rows[child].is_none() {
                    rows[child] = orthonormal([1, 2].map(|k| times(&own.1[k], &transition.operator)));
                    stack.push(child);
                }
            }
        }
    }
    rows
}

/// x T.
fn times(row: &[f64], operator: &SubdivisionOperator) -> Vec<f64> {
    (0..operator.columns()).map(|column| operator.column(column).iter().zip(row).map(|(a, b)| a * b).sum()).collect()
}

/// The constant and two more, made orthonormal; `None` if they are dependent.
fn orthonormal(more: [Vec<f64>; 2]) -> Option<Rows> {
    let n = more[0].len();
    let mut rows = [vec![1.0 / (n as f64).sqrt(); n], Vec::new(), Vec::new()];
    for (k, mut row) in more.into_iter().enumerate() {
        let before = row.iter().map(|x| x * x).sum::<f64>().sqrt();
        // Twice is enough.
        for _ in 0..2 {
            for other in &rows[..=k] {
                let share: f64 = row.iter().zip(other).map(|(a, b)| a * b).sum();
                row.iter_mut().zip(other).for_each(|(x, y)| *x -= share * y);
            }
        }
        let size = row.iter().map(|x| x * x).sum::<f64>().sqrt();
        if size <= 1e-9 * before {
            return None;
        }
        rows[k + 1] = row.iter().map(|x| x / size).collect();
    }
    Some(rows)
}

/// The invariant subspace of the largest eigenvalues that holds the constant row.
pub(super) fn dominant(product: &SubdivisionOperator) -> Option<Rows> {
    let n = product.rows();
    // Any start that is in no special position.
    let start = |seed: f64| (0..n).map(|k| (seed * (k + 1) as f64).sin()).collect::<Vec<f64>>();
    let mut rows = orthonormal([start(1.3), start(2.9)])?;
    for _ in 0..STEPS {
        rows = orthonormal([1, 2].map(|k| times(&rows[k], product)))?;
    }
    Some(rows)
}

/// All rows that the operators of a state take into its children's subspaces, if they are three.
fn above(automaton: &Automaton, index: usize, rows: &[Option<Rows>]) -> Option<Rows> {
    let state = &automaton.states()[index];
    let mut equations = Vec::new();
    for transition in &state.transitions {
        let own = rows[transition.to.index()].as_ref()?;
        let columns = transition.operator.columns();
        for k in 0..columns {
            // Column k of the projection onto the complement of W.
            let project = |j: usize| f64::from(u8::from(j == k)) - own.iter().map(|row| row[j] * row[k]).sum::<f64>();
            equations.push(transition.operator.apply(&(0..columns).map(project).collect::<Vec<f64>>()));
        }
    }
    let solutions = null_space(equations, state.dimension);
    if solutions.len() != 3 {
        return None;
    }
    // One of three rows depends on the constant and the other two.
    let pairs = [[0, 1], [0, 2], [1, 2]].map(|pair| orthonormal(pair.map(|k| solutions[k].clone())));
    pairs.into_iter().flatten().next()
}

/// The product of operators along a shortest cycle from the first state of a component.
fn cycle(automaton: &Automaton, component: &[usize]) -> Option<SubdivisionOperator> {
    let states = automaton.states();
    let first = component[0];
    let mut reached: Vec<(usize, SubdivisionOperator)> = vec![(first, SubdivisionOperator::identity(states[first].dimension))];
    let mut next = 0;
    while next < reached.len() {
        let (index, word) = reached[next].clone();
        next += 1;
        for transition in &states[index].transitions {
            let child = transition.to.index();
            if child == first {
                return Some(word.times(&transition.operator));
            }
            if component.binary_search(&child).is_ok() && reached.iter().all(|(other, _)| *other != child) {
                reached.push((child, word.times(&transition.operator)));
            }
        }
    }
    None
}

/// Strongly connected components of the control graph, each sorted, children first (Tarjan 1972).
fn components(automaton: &Automaton) -> Vec<Vec<usize>> {
    const UNSEEN: usize = usize::MAX;
    let states = automaton.states();
    let (mut number, mut low) = (vec![UNSEEN; states.len()], vec![0; states.len()]);
    let (mut open, mut is_open) = (Vec::new(), vec![false; states.len()]);
    let (mut count, mut list) = (0, Vec::new());
    for start in 0..states.len() {
        // States on the path with their next transition.
        let mut path: Vec<(usize, usize)> = if number[start] == UNSEEN { vec![(start, 0)] } else { Vec::new() };
        while let Some(&mut (index, ref mut next)) = path.last_mut() {
            if *next == 0 {
                (number[index], low[index]) = (count, count);
                count += 1;
                open.push(index);
                is_open[index] = true;
            }
            if let Some(transition) = states[index].transitions.get(*next) {
                let child = transition.to.index();
                *next += 1;
                if number[child] == UNSEEN {
                    path.push((child, 0));
                } else if is_open[child] {
                    low[index] = low[index].min(number[child]);
                }
                continue;
            }
            path.pop();
            if let Some(&(parent, _)) = path.last() {
                low[parent] = low[parent].min(low[index]);
            }
            if low[index] == number[index] {
                let from = open.iter().rposition(|&other| other == index).unwrap_or(0);
                let mut component = open.split_off(from);
                component.iter().for_each(|&member| is_open[member] = false);
                component.sort_unstable();
                list.push(component);
            }
        }
    }
    list
}
