//! Linear precision: parameters of smooth cells, and errors of second order.
//!
//! Let functionals G_s (d x n, on barycentric points of state s; d = 1 for curves, 2 for faces) satisfy
//! G_s T_e = l G_w + t_e 1^T for all transitions e: s -> w, with one ratio l < 1. Then G_s maps the attractor A_s onto the
//! attractor D_s of the parameter maps p -> l p + t_e. Greville abscissae of B-splines, i/n of Bezier curves, and the
//! linear precision of interpolating schemes are such functionals; fractal cells have none.
//!
//! Let Q be a cell's control points and L any affine map from parameters to space. For x in A_s,
//! Q x = L(G x) + sum_k x_k r_k with r_k = Q_k - L(G e_k), and |x|_1 <= 1 + 2 m, m being the state's margin, so
//! |Q x - L(G x)| <= eta = (1 + 2 m) max_k |r_k|. As G A_s = D_s, the cell and L(D_s) are within eta of each other. A
//! drawing whose vertices are points of the cell, interpolated linearly over a triangulation of D_s by their
//! parameters, is within eta of L(D_s) too, distances being convex: its Hausdorff distance from the cell is at most
//! 2 eta. If L interpolates the ends of a curve, the chord *is* L(D_s), and its distance at most eta.
//! r_k vanishes for control points in linear position, so eta is of second order in the size of smooth cells.
//!
//! Products of curves: if G_A maps the attractor of one onto [0, 1], and G_B that of the other, then x_A x x_B, of which
//! the product's attractor consists, is mapped onto the unit square by (G_A x 1, 1 x G_B), whatever the ratios.
//!
//! The r_k may be those of other points H than the control points if the attractor lies in their hull: Q x = (Q H) y with
//! y >= 0 of sum 1. Bezier points of a spline's span are closer to it than its control points. So are those of a cell's descendants, with their margin, which
//! serve for faces of which no such points are known: every x is T_e T_f y for one of them.
//!
//! G is found by elimination over all states at once. What it misses, |G_s T_e - l G_w - t_e 1^T| <= e entrywise, moves
//! parameters by at most (1 + 2 m) e / (1 - l), which is kept and charged.

use super::cell::MOST_MEASURED;
use super::hull::Hulls;
use super::{Attractor, StateBound};
use crate::automaton::{Automaton, LeafPrimitive, Smooth, StateId, SubdivisionOperator};
use std::cmp::Ordering;

/// Parameters of a state's points.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearPrecision {
    /// Column k is the parameter of control point k, so that the point with barycentric coordinates x has the parameter
    /// sum_k x_k G_k. Curves use the first entry only: 0 at the start, 1 at the end. Faces have their first corner at
    /// (0, 0), their second at (1, 0), their last at (0, 1).
    pub parameters: Vec<[f64; 2]>,
    /// The corners of the domain D, in order: an interval's ends, or a convex polygon.
    pub domain: Vec<[f64; 2]>,
    /// Parameters of the attractor may be this far from D, and D from them.
    pub residual: f64,
    /// The points that measure the deviation from an affine map: images of the control points, in whose hull, with the margin, the
    /// attractor lies; the control points themselves when absent.
    pub(super) hull: Option<SubdivisionOperator>,
    /// m for these points.
    pub(super) margin: f64,
    /// Parameters of these points.
    pub(super) measured: Vec<[f64; 2]>,
    /// Row k: what measuring point k adds to the origin and the two derivatives of the affine map that fits best.
    pub(super) fit: Vec<[f64; 3]>,
}

impl LinearPrecision {
    /// Measures at these points from now on, in whose hull the attractor lies, unless they are too many; `None` if they
    /// allow no fit.
    fn measure_at(&mut self, hull: &SubdivisionOperator) -> Option<()> {
        if hull.columns() > MOST_MEASURED {
            return Some(());
        }
        self.measured = (0..hull.columns()).map(|k| evaluate(&self.parameters, hull.column(k))).collect();
        self.fit = if self.domain.len() == 2 { Vec::new() } else { fit(&self.measured)? };
        self.margin = 0.0;
        self.hull = Some(hull.clone());
        Some(())
    }

    /// Whether a face's control points leave its domain, and nothing closer to it is known.
    fn leaves_domain(&self) -> bool {
        let is_within = |point: &[f64; 2]| {
            (0..2).all(|k| {
                let values = self.domain.iter().map(|corner| corner[k]);
                let [low, high] = [values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max)];
                (low - SAME.sqrt()..=high + SAME.sqrt()).contains(&point[k])
            })
        };
        self.domain.len() > 2 && self.hull.is_none() && !self.measured.iter().all(is_within)
    }

    /// Measures at points of descendants from now on, as far as they are few: those in whose hull children are known to lie, or else control points.
    fn measure_below(&mut self, attractor: &Attractor, index: usize) {
        let automaton = attractor.automaton();
        let state = StateId::new(index);
        let mut parts = vec![(SubdivisionOperator::identity(automaton.state(state).dimension), state)];
        for _ in 0..LEVELS_BELOW {
            let below = |(operator, state): &(SubdivisionOperator, StateId)| {
                let steps = automaton.state(*state).transitions.iter();
                steps.map(|step| (operator.times(&step.operator), step.to)).collect::<Vec<_>>()
            };
            parts = parts.iter().flat_map(below).collect();
            let (mut columns, mut margin, mut miss) = (Vec::new(), 0.0_f64, 0.0_f64);
            for (operator, state) in &parts {
                let hull = attractor.hull(*state).and_then(|hull| Some((hull.points.as_ref()?, hull.miss)));
                let points = hull.map(|(points, off)| {
                    let norm = |k: usize| operator.column(k).iter().map(|entry| entry.abs()).sum::<f64>();
                    miss = miss.max(off * (0..operator.columns()).map(norm).fold(1.0, f64::max));
                    operator.times(points)
                });
                if points.is_none() {
                    margin = margin.max(attractor.bound(*state).margin());
                }
                let points = points.as_ref().unwrap_or(operator);
                // No zero has a sign.
                columns.extend((0..points.columns()).map(|k| points.column(k).iter().map(|entry| entry + 0.0).collect::<Vec<f64>>()));
            }
            // Each once, in an order that tells nothing of how they were found.
            columns.sort_unstable_by(|a, b| {
                a.iter().zip(b).map(|(x, y)| x.total_cmp(y)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
            });
            columns.dedup();
            let measured: Vec<[f64; 2]> = columns.iter().map(|column| evaluate(&self.parameters, column)).collect();
            let Some(fit) = fit(&measured).filter(|_| columns.len() <= MOST_BELOW) else { return };
            let largest = self.parameters.iter().flatten().fold(1.0_f64, |a, x| a.max(x.abs()));
            // What leaves the hull by rounding has another parameter by as much; that its place is another, by as much of the cell's size, is below what evaluations declare as rounding.
            self.residual += std::f64::consts::SQRT_2 * largest * miss;
            self.hull = Some(SubdivisionOperator::exact(self.parameters.len(), columns.concat()));
            (self.measured, self.fit, self.margin) = (measured, fit, margin);
            if miss > 0.0 {
                return;
            }
        }
    }

    /// The parameter of a barycentric point.
    #[must_use]
    pub fn parameter(&self, point: &[f64]) -> [f64; 2] {
        evaluate(&self.parameters, point)
    }
}

/// Levels below a cell whose control points measure it, and how many points there are at most. Of uniform cubic splines those two levels below see parabolas 2.2 times as far off as they are, those of the cell itself 8 times; Bezier points of
/// children see them as far off as they are.
const LEVELS_BELOW: usize = 2;
const MOST_BELOW: usize = 64;
/// Ratios of the parameter maps that are tried.
const RATIOS: [f64; 4] = [0.5, 1.0 / 3.0, 0.25, 0.2];
/// Unknowns beyond which no functionals are sought.
const MOST_UNKNOWNS: usize = 256;
/// Multiplications of one elimination at most.
const MOST_WORK: f64 = 4e7;
/// Equations may miss by this much, relative to functionals of size 1.
pub(super) const MISS: f64 = 1e-10;
/// Where bounds of all that equations miss by come to more than this, in units of the domain, parameters say too little. Residuals count in every bound, so more is safe, too.
const MOST_RESIDUAL: f64 = 1e-8;
/// Lengths of a curve's domain and areas of a face's that rounding may hide, as a share of the whole. A hole of that
/// area is at most its root wide, which is charged.
pub(super) const SAME: f64 = 1e-12;
/// Ratios of parameter maps at most.
const MOST_RATIO: f64 = 0.99;
/// Children of a face whose overlaps are examined.
const MOST_CHILDREN: usize = 64;

/// Functionals of all states of a component: `[state][control point]` for each independent solution.
type Solution = Vec<Vec<f64>>;

/// The precision of every state that has it: curves with proven ends, and faces with corners.
pub(super) fn precisions(automaton: &Automaton, bounds: &[StateBound], hulls: &Hulls) -> Vec<Option<LinearPrecision>> {
    let states = automaton.states();
    let found = super::invariant::precisions(automaton, bounds);
    let mut result: Vec<_> = claimed(automaton, bounds, hulls).into_iter().zip(found).map(|(claimed, found)| claimed.or(found)).collect();
    for component in components(automaton) {
        // What holds for all descendants of a state holds for none that has others.
        if component.iter().any(|&index| result[index].is_some()) {
            continue;
        }
        // A product has what its factors have.
        if component.iter().any(|&index| !automaton.factors(StateId::new(index)).is_empty()) {
            continue;
        }
        let drawn = |&index: &usize| matches!(states[index].leaf, LeafPrimitive::Chord(_) | LeafPrimitive::Polygon(_));
        if component.iter().any(|&index| states[index].frame) || !component.iter().any(drawn) {
            continue;
        }
        for ratio in RATIOS {
            let solutions = solve(automaton, &component, ratio);
            if solutions.is_empty() {
                continue;
            }
            let mut found = false;
            for &index in component.iter().filter(|index| drawn(index)) {
                if result[index].is_none() {
                    result[index] = precision(automaton, bounds, index, ratio, &solutions);
                    found |= result[index].is_some();
                }
            }
            if found {
                break;
            }
        }
    }
    for index in 0..states.len() {
        let factors = automaton.factors(StateId::new(index));
        if let [left, right] = factors {
            result[index] = product(&states[index].leaf, [&result[left.index()], &result[right.index()]], bounds[index].margin());
        }
    }
    result
}

/// The same, measured closer to the surface where control points of faces leave the domain.
pub(super) fn closer(attractor: &Attractor) -> Vec<Option<LinearPrecision>> {
    let closer = |(index, precision): (usize, &Option<LinearPrecision>)| {
        let mut precision = precision.clone()?;
        if precision.leaves_domain() {
            precision.measure_below(attractor, index);
        }
        Some(precision)
    };
    attractor.precisions.iter().enumerate().map(closer).collect()
}

/// The precision of a product of two curves, whose outline is the unit square; see the module's comment.
fn product(leaf: &LeafPrimitive, factors: [&Option<LinearPrecision>; 2], margin: f64) -> Option<LinearPrecision> {
    let [Some(left), Some(right)] = factors else { return None };
    let interval = |factor: &LinearPrecision| factor.domain.len() == 2;
    if !interval(left) || !interval(right) {
        return None;
    }
    let raw: Vec<[f64; 2]> = left.parameters.iter().flat_map(|u| right.parameters.iter().map(move |v| [u[0], v[0]])).collect();
    let domain: Vec<[f64; 2]> = corners(leaf)?.iter().map(|corner| evaluate(&raw, corner)).collect();
    // The four corners of the square, each once, in order around it.
    let apart = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
    let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let off = |first: usize, backwards: bool| {
        let corner = |k: usize| square[(first + if backwards { 4 - k } else { k }) % 4];
        domain.iter().enumerate().map(|(k, place)| apart(place, &corner(k))).fold(0.0, f64::max)
    };
    let least = (0..4).flat_map(|first| [off(first, false), off(first, true)]).fold(f64::INFINITY, f64::min);
    if domain.len() != 4 || least > MISS {
        return None;
    }
    let rounding = (1.0 + 2.0 * margin) * 1e-14 + 2.0 * least;
    let mut precision = scaled(&raw, &domain, left.residual.hypot(right.residual) + rounding, margin)?;
    if left.hull.is_some() || right.hull.is_some() {
        let hull = |factor: &LinearPrecision| factor.hull.clone().unwrap_or_else(|| SubdivisionOperator::identity(factor.parameters.len()));
        precision.measure_at(&SubdivisionOperator::product(vec![hull(left), hull(right)]))?;
        // As for the margins of bounds: see there.
        precision.margin = 0.5 * ((1.0 + 2.0 * left.margin) * (1.0 + 2.0 * right.margin) - 1.0);
    }
    Some(precision)
}

/// What holds of the transitions of a curve's state.
struct Checked {
    miss: f64,
    ratio: f64,
}

/// The precision of curves whose model claims parameters, where the claims hold for them and all their descendants. The
/// ratios of their parameter maps may differ: nothing but their being below 1 matters.
fn claimed(automaton: &Automaton, bounds: &[StateBound], hulls: &Hulls) -> Vec<Option<LinearPrecision>> {
    let (states, claims) = (automaton.states(), automaton.claimed_smooth());
    let mut checked: Vec<Option<Checked>> = (0..states.len()).map(|index| check(automaton, index)).collect();
    let holds = automaton.hereditary(checked.iter().map(Option::is_some).collect());
    checked.iter_mut().zip(&holds).for_each(|(own, &holds)| *own = own.take().filter(|_| holds));
    let known = || checked.iter().flatten();
    let (miss, ratio) = (known().map(|own| own.miss).fold(0.0, f64::max), known().map(|own| own.ratio).fold(0.0, f64::max));
    let margin = (0..states.len()).filter(|&index| checked[index].is_some()).map(|index| bounds[index].margin()).fold(0.0, f64::max);
    let precision = |index: usize| {
        checked[index].as_ref()?;
        let Smooth { parameters, .. } = claims.get(&StateId::new(index))?;
        let raw: Vec<[f64; 2]> = parameters.iter().map(|&u| [u, 0.0]).collect();
        let domain: Vec<[f64; 2]> = corners(&states[index].leaf)?.iter().map(|corner| evaluate(&raw, corner)).collect();
        let residual = (1.0 + 2.0 * margin) * (miss + 1e-15) / (1.0 - ratio);
        let mut precision = scaled(&raw, &domain, residual, bounds[index].margin())?;
        precision.residual += 4.0 * SAME / (1.0 - ratio);
        if let Some(hull) = hulls.claimed(automaton, StateId::new(index)) {
            precision.measure_at(&hull.points)?;
            precision.residual += hulls.miss() * precision.parameters.iter().fold(1.0_f64, |a, u| a.max(u[0].abs()));
        }
        Some(precision)
    };
    (0..states.len()).map(precision).collect()
}

/// Checks what is claimed of a curve's transitions.
fn check(automaton: &Automaton, index: usize) -> Option<Checked> {
    let claims = automaton.claimed_smooth();
    let claim = |id: StateId| {
        let LeafPrimitive::Chord(ends) = &automaton.state(id).leaf else { return None };
        Some((claims.get(&id)?, ends))
    };
    let at = |parameters: &[f64], point: &[f64]| parameters.iter().zip(point).map(|(u, x)| u * x).sum::<f64>();
    let (own, ends) = claim(StateId::new(index))?;
    let parameter = |point: &[f64]| at(&own.parameters, point);
    let [low, high] = [parameter(&ends.start), parameter(&ends.end)];
    let mut checked = Checked { miss: 0.0, ratio: 0.0 };
    let transitions = &automaton.state(StateId::new(index)).transitions;
    for transition in transitions {
        let (child, ends) = claim(transition.to)?;
        let [start, end] = [&ends.start, &ends.end].map(|end| (at(&child.parameters, end), parameter(&transition.operator.apply(end))));
        let ratio = (end.1 - start.1) / (end.0 - start.0);
        let off = |(k, u): (usize, &f64)| (parameter(transition.operator.column(k)) - start.1 - ratio * (u - start.0)).abs();
        checked.miss = child.parameters.iter().enumerate().map(off).fold(checked.miss, f64::max);
        checked.ratio = checked.ratio.max(ratio.abs());
        let slack = SAME * (high - low).abs();
        let inside = |u: f64| u >= low.min(high) - slack && u <= low.max(high) + slack;
        if !(inside(start.1) && inside(end.1)) {
            return None;
        }
    }
    // Written so that what is not a number fails.
    (!transitions.is_empty() && checked.miss <= MISS && checked.ratio <= MOST_RATIO && high != low).then_some(checked)
}

/// States joined by transitions.
fn components(automaton: &Automaton) -> Vec<Vec<usize>> {
    let states = automaton.states();
    let mut neighbours = vec![Vec::new(); states.len()];
    for (index, state) in states.iter().enumerate() {
        for transition in &state.transitions {
            neighbours[index].push(transition.to.index());
            neighbours[transition.to.index()].push(index);
        }
    }
    let mut seen = vec![false; states.len()];
    let mut list = Vec::new();
    for start in 0..states.len() {
        let (mut component, mut stack) = (Vec::new(), vec![start]);
        while let Some(index) = stack.pop() {
            if !std::mem::replace(&mut seen[index], true) {
                component.push(index);
                stack.extend(&neighbours[index]);
            }
        }
        if !component.is_empty() {
            component.sort_unstable();
            list.push(component);
        }
    }
    list
}

/// A basis of the functionals, up to constants: those with value 0 at the first control point of every state.
fn solve(automaton: &Automaton, component: &[usize], ratio: f64) -> Vec<Solution> {
    let states = automaton.states();
    let mut first = vec![0; states.len()];
    let mut unknowns = 0;
    for &index in component {
        first[index] = unknowns;
        unknowns += states[index].dimension - 1;
    }
    let equations: usize = component.iter().flat_map(|&i| &states[i].transitions).map(|t| t.operator.columns() - 1).sum();
    if unknowns > MOST_UNKNOWNS || (equations * unknowns * unknowns) as f64 > MOST_WORK {
        return Vec::new();
    }
    let mut rows = Vec::with_capacity(equations);
    for &index in component {
        for transition in &states[index].transitions {
            for column in 1..transition.operator.columns() {
                let mut row = vec![0.0; unknowns];
                for k in 1..transition.operator.rows() {
                    row[first[index] + k - 1] += transition.operator.entry(k, column) - transition.operator.entry(k, 0);
                }
                row[first[transition.to.index()] + column - 1] -= ratio;
                rows.push(row);
            }
        }
    }
    let spread = |vector: &Vec<f64>| -> Solution {
        let mut solution = vec![Vec::new(); states.len()];
        for &index in component {
            solution[index] =
                std::iter::once(0.0).chain(vector[first[index]..].iter().take(states[index].dimension - 1).copied()).collect();
        }
        solution
    };
    null_space(rows, unknowns).iter().map(spread).collect()
}

/// A basis of the vectors that all rows annihilate, by elimination with full pivoting; entries are at most about 1.
pub(super) fn null_space(mut rows: Vec<Vec<f64>>, unknowns: usize) -> Vec<Vec<f64>> {
    let size = rows.iter().flatten().fold(0.0_f64, |a, x| a.max(x.abs()));
    let mut order: Vec<usize> = (0..unknowns).collect();
    let mut rank = 0;
    while rank < unknowns.min(rows.len()) {
        let candidates = (rank..rows.len()).flat_map(|row| (rank..unknowns).map(move |column| (row, column)));
        let pivot = candidates.max_by(|&(a, b), &(c, d)| rows[a][order[b]].abs().total_cmp(&rows[c][order[d]].abs()));
        let Some((row, column)) = pivot else { break };
        let value = rows[row][order[column]];
        if value.abs() <= 1e-11 * size {
            break;
        }
        rows.swap(rank, row);
        order.swap(rank, column);
        let (above, below) = rows.split_at_mut(rank + 1);
        let source = &above[rank];
        for target in below {
            let factor = target[order[rank]] / value;
            if factor != 0.0 {
                target.iter_mut().zip(source).for_each(|(x, &y)| *x -= factor * y);
            }
        }
        rank += 1;
    }
    (rank..unknowns)
        .map(|free| {
            let mut vector = vec![0.0; unknowns];
            vector[order[free]] = 1.0;
            for step in (0..rank).rev() {
                let sum: f64 = (step + 1..unknowns).map(|k| rows[step][order[k]] * vector[order[k]]).sum();
                vector[order[step]] = -sum / rows[step][order[step]];
            }
            let largest = vector.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
            vector.iter().map(|x| x / largest).collect()
        })
        .collect()
}

pub(super) fn evaluate(parameters: &[[f64; 2]], point: &[f64]) -> [f64; 2] {
    let mut sum = [0.0; 2];
    for (parameter, weight) in parameters.iter().zip(point) {
        sum[0] += weight * parameter[0];
        sum[1] += weight * parameter[1];
    }
    sum
}

/// Corners of the parameter domain that a state's leaf primitive states, in barycentric coordinates.
pub(super) fn corners(leaf: &LeafPrimitive) -> Option<Vec<Vec<f64>>> {
    match leaf {
        LeafPrimitive::Chord(ends) => Some(vec![ends.start.clone(), ends.end.clone()]),
        LeafPrimitive::Polygon(corners) => Some(corners.clone()),
        _ => None,
    }
}

/// Verifies the functionals on everything below a state, and scales them.
fn precision(automaton: &Automaton, bounds: &[StateBound], index: usize, ratio: f64, solutions: &[Solution]) -> Option<LinearPrecision> {
    let states = automaton.states();
    let own = corners(&states[index].leaf)?;
    let curve = own.len() == 2;
    let value = |solution: &Solution, state: usize, point: &[f64]| -> f64 { solution[state].iter().zip(point).map(|(g, x)| g * x).sum() };
    // Two functionals for a face; for a curve the combination that sees its ends best.
    let combined: Vec<Vec<[f64; 2]>> = if curve {
        let shares: Vec<f64> = solutions.iter().map(|s| value(s, index, &own[1]) - value(s, index, &own[0])).collect();
        let entry = |state: usize, k: usize| [solutions.iter().zip(&shares).map(|(s, share)| share * s[state][k]).sum(), 0.0];
        (0..states.len()).map(|state| (0..solutions[0][state].len()).map(|k| entry(state, k)).collect()).collect()
    } else {
        let [first, second] = solutions else { return None };
        (0..states.len()).map(|state| first[state].iter().zip(&second[state]).map(|(&a, &b)| [a, b]).collect()).collect()
    };
    let mut miss = 0.0_f64;
    let below = super::sites::reachable(automaton, StateId::new(index));
    let mut domains: Vec<Option<Vec<[f64; 2]>>> = vec![None; states.len()];
    for &state in &below {
        let corners = corners(&states[state].leaf).filter(|corners| (corners.len() == 2) == curve)?;
        domains[state] = Some(corners.iter().map(|corner| evaluate(&combined[state], corner)).collect());
    }
    for &state in &below {
        let mut children = Vec::new();
        for transition in &states[state].transitions {
            let child = transition.to.index();
            miss = miss.max(missed(&combined[state], &combined[child], &transition.operator, ratio));
            let corners = corners(&states[child].leaf)?;
            let place = |corner: &Vec<f64>| evaluate(&combined[state], &transition.operator.apply(corner));
            children.push(corners.iter().map(place).collect::<Vec<_>>());
        }
        if !fills(domains[state].as_ref()?, &children) {
            return None;
        }
    }
    let margin = below.iter().map(|&state| bounds[state].margin()).fold(0.0, f64::max);
    let residual = (1.0 + 2.0 * margin) * (miss + 1e-15) / (1.0 - ratio);
    let hidden = if curve { SAME } else { SAME.sqrt() } / (1.0 - ratio);
    let mut precision = scaled(&combined[index], domains[index].as_ref()?, residual, bounds[index].margin())?;
    // The domains below are of the size of this one, or the functionals would not fit.
    let largest = |state: usize| domains[state].iter().flatten().flatten().fold(0.0_f64, |a, x| a.max(x.abs()));
    let all = below.iter().map(|&state| largest(state)).fold(0.0, f64::max);
    precision.residual += hidden * all / largest(index).max(f64::MIN_POSITIVE) * 4.0;
    Some(precision)
}

/// The largest entry of G_s T - l G_w - t 1^T, with t from the first column.
fn missed(own: &[[f64; 2]], child: &[[f64; 2]], operator: &SubdivisionOperator, ratio: f64) -> f64 {
    let entry = |column: usize, row: usize| evaluate(own, operator.column(column))[row] - ratio * child[column][row];
    let off = |column: usize| (0..2).map(|row| (entry(column, row) - entry(0, row)).abs()).fold(0.0, f64::max);
    (0..operator.columns()).map(off).fold(0.0, f64::max) * std::f64::consts::SQRT_2
}

fn turn(a: &[f64; 2], b: &[f64; 2], c: &[f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Twice the signed area.
fn area(polygon: &[[f64; 2]]) -> f64 {
    (1..polygon.len().saturating_sub(1)).map(|k| turn(&polygon[0], &polygon[k], &polygon[k + 1])).sum()
}

/// Whether the children's domains lie in the state's and, for faces, cover it: then the domains are invariant under
/// the parameter maps, and by uniqueness of the invariant sets they are G A. For curves connectedness covers: A is a curve
/// between its ends (see `automaton::connection`).
pub(super) fn fills(domain: &[[f64; 2]], children: &[Vec<[f64; 2]>]) -> bool {
    if domain.len() == 2 {
        let (low, high) = (domain[0][0].min(domain[1][0]), domain[0][0].max(domain[1][0]));
        let slack = SAME * (high - low);
        return high > low && children.iter().flatten().all(|x| x[0] >= low - slack && x[0] <= high + slack);
    }
    let whole = area(domain);
    if whole == 0.0 || children.len() > MOST_CHILDREN {
        return false;
    }
    // All polygons counterclockwise and convex.
    let oriented = |polygon: &[[f64; 2]]| -> Vec<[f64; 2]> {
        if area(polygon) < 0.0 { polygon.iter().rev().copied().collect() } else { polygon.to_vec() }
    };
    let slack = SAME * whole.abs();
    let convex = |polygon: &[[f64; 2]]| {
        (0..polygon.len()).all(|k| {
            let at = |j: usize| &polygon[(k + j) % polygon.len()];
            turn(at(0), at(1), at(2)) >= -slack
        })
    };
    let domain = oriented(domain);
    let children: Vec<Vec<[f64; 2]>> = children.iter().map(|child| oriented(child)).collect();
    let side = |k: usize| (&domain[k], &domain[(k + 1) % domain.len()]);
    let inside = |x: &[f64; 2]| (0..domain.len()).all(|k| turn(side(k).0, side(k).1, x) >= -slack);
    let sum: f64 = children.iter().map(|child| area(child)).sum();
    // Inside, of the same total area, and without overlap: no part is left out.
    convex(&domain)
        && children.iter().all(|child| convex(child) && child.iter().all(inside))
        && (sum - whole.abs()).abs() <= slack
        && (0..children.len()).all(|a| (0..a).all(|b| overlap(&children[a], &children[b]) <= slack))
}

/// Twice the area that two convex counterclockwise polygons share (Sutherland and Hodgman's clipping).
fn overlap(subject: &[[f64; 2]], clip: &[[f64; 2]]) -> f64 {
    let mut left = subject.to_vec();
    for k in 0..clip.len() {
        let (a, b) = (&clip[k], &clip[(k + 1) % clip.len()]);
        let mut kept = Vec::with_capacity(left.len() + 1);
        for j in 0..left.len() {
            let (p, q) = (&left[j], &left[(j + 1) % left.len()]);
            let (s, t) = (turn(a, b, p), turn(a, b, q));
            if s >= 0.0 {
                kept.push(*p);
            }
            if (s >= 0.0) != (t >= 0.0) {
                let share = s / (s - t);
                kept.push([p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])]);
            }
        }
        left = kept;
    }
    area(&left)
}

/// Parameters in the state's own unit, with the fit; `None` if the domain is too thin to measure in.
pub(super) fn scaled(raw: &[[f64; 2]], domain: &[[f64; 2]], residual: f64, margin: f64) -> Option<LinearPrecision> {
    let origin = domain[0];
    let to = |corner: &[f64; 2]| [corner[0] - origin[0], corner[1] - origin[1]];
    let (first, last) = (to(&domain[1]), to(&domain[domain.len() - 1]));
    // Inverse of the matrix with columns first, last; curves have one row.
    let inverse = if domain.len() == 2 {
        [[1.0 / first[0], 0.0], [0.0, 0.0]]
    } else {
        let determinant = first[0] * last[1] - last[0] * first[1];
        [[last[1] / determinant, -last[0] / determinant], [-first[1] / determinant, first[0] / determinant]]
    };
    let map = |x: &[f64; 2]| {
        let y = to(x);
        [inverse[0][0] * y[0] + inverse[0][1] * y[1], inverse[1][0] * y[0] + inverse[1][1] * y[1]]
    };
    let norm = inverse.as_flattened().iter().map(|x| x * x).sum::<f64>().sqrt();
    let residual = residual * norm;
    let parameters: Vec<[f64; 2]> = raw.iter().map(map).collect();
    let fit = if domain.len() == 2 { Vec::new() } else { fit(&parameters)? };
    let domain = domain.iter().map(map).collect();
    let measured = parameters.clone();
    (residual <= MOST_RESIDUAL && norm.is_finite()).then(|| LinearPrecision {
        parameters,
        domain,
        residual,
        hull: None,
        margin,
        measured,
        fit,
    })
}

/// The pseudo-inverse of the rows 1, G: least squares of an affine map.
fn fit(parameters: &[[f64; 2]]) -> Option<Vec<[f64; 3]>> {
    let row = |p: &[f64; 2]| [1.0, p[0], p[1]];
    let gram = |i: usize, j: usize| parameters.iter().map(|p| row(p)[i] * row(p)[j]).sum::<f64>();
    let matrix = glam::DMat3::from_cols_array_2d(&std::array::from_fn(|j| std::array::from_fn(|i| gram(i, j))));
    let inverse = matrix.inverse();
    inverse.is_finite().then(|| parameters.iter().map(|p| (inverse * glam::DVec3::from_array(row(p))).to_array()).collect())
}
