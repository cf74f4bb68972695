//! Points in whose hull a state's attractor lies, and that subdivide as its cells do.
//!
//! Let every state s have points H_s, the columns of a matrix, and every transition e: s -> w a matrix K_e without negative
//! entries for which T_e H_w = H_s K_e. Columns sum to 1, so T_e conv H_w lies in conv H_s;
//! the hulls are mapped into each other, and hold the attractors. A cell with control points Q lies in the hull of Q H_s,
//! and that of its child is (Q H_s) K_e: a search that starts with Q H_s needs no operator but K_e. Bezier points of a
//! spline's spans are such points, and de Casteljau's algorithm is their K; so are some simplices and boxes (`polytope`); control points are, with K = T, where no
//! operator has negative entries. Ends of a curve among them are points of the attractor too.
//!
//! Products: (T_A x T_B) (H_A x H_B) = (H_A x H_B) (K_A x K_B).

use super::polytope::{Polytope, polytope};
use crate::automaton::{Automaton, Contraction, Hull, LeafPrimitive, StateId, SubdivisionOperator};
use std::collections::BTreeMap;

/// Entries by which hulls may miss their children's: operators are rounded to fractions.
const MISS: f64 = 1e-13;
/// Every step of a path misses by the entries of a column, and what is missed contracts: ten entries of every point of
/// the state, and paths of which the first ten steps count. So it is for splines.
const CHARGE: f64 = 1e3;
/// The same where the steps are counted: ten entries of every point.
const CHARGE_OF_STEP: f64 = 10.0;
/// Points so near, entry by entry, are one.
const SAME: f64 = 1e-14;

/// The points of one state.
#[derive(Clone, Debug)]
pub(crate) struct StateHull {
    /// H; absent where they are the control points.
    pub(crate) points: Option<SubdivisionOperator>,
    /// K of every transition.
    pub(crate) children: Vec<SubdivisionOperator>,
    /// Some points of the attractor, as shares of these points: index and share.
    pub(crate) attained: Vec<Vec<(usize, f64)>>,
    /// Whether H has negative entries: then weights may not stay positive.
    pub(crate) is_signed: bool,
    /// The attractor may be outside by this share of the points' largest distance.
    pub(crate) miss: f64,
}

/// Where the points of a curve's state come from.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Origin {
    /// The model claims them, or they were found, and they are verified.
    Proof,
    /// They are the control points.
    Control,
}

/// The points of all states that are no products.
#[derive(Clone, Debug)]
pub(super) struct Hulls {
    origins: Vec<Option<Origin>>,
    found: BTreeMap<StateId, Polytope>,
    miss: f64,
    found_miss: f64,
}

impl Hulls {
    /// Verifies what models claim, and finds polytopes where they claim nothing.
    ///
    /// Cost: two products of matrices for every transition.
    pub(super) fn new(automaton: &Automaton, contraction: &Contraction) -> Self {
        let states = automaton.states();
        let ids = || (0..states.len()).map(StateId::new);
        let claims = automaton.claimed_smooth();
        let claim = |id: StateId| claims.get(&id)?.hull.as_ref();
        let found: BTreeMap<StateId, Polytope> =
            ids().filter(|&id| claim(id).is_none()).filter_map(|id| Some((id, polytope(automaton, id)?))).collect();
        let hull = |id: StateId| claim(id).or_else(|| found.get(&id).map(|found| &found.hull));
        let offs: Vec<Option<f64>> = ids().map(|id| off(automaton, id, &hull)).collect();
        let claimed = automaton.hereditary(offs.iter().map(Option::is_some).collect());
        let plain = |index: usize| {
            let state = &states[index];
            let id = StateId::new(index);
            !claimed[index]
                && !state.frame
                && automaton.factors(id).is_empty()
                && state.transitions.iter().all(|step| step.operator.is_nonnegative())
        };
        let control = automaton.hereditary((0..states.len()).map(plain).collect());
        let origin = |index: usize| if claimed[index] { Some(Origin::Proof) } else { control[index].then_some(Origin::Control) };
        let largest = |is_found: bool| {
            let own = ids().filter(|id| claimed[id.index()] && found.contains_key(id) == is_found);
            own.filter_map(|id| offs[id.index()]).fold(f64::EPSILON, f64::max)
        };
        let most = found.keys().map(|id| states[id.index()].dimension).max().unwrap_or(0);
        let steps = CHARGE.max(CHARGE_OF_STEP * most as f64 * contraction.sum_of_norms());
        let (miss, found_miss) = (CHARGE * largest(false), steps * largest(true));
        Self { origins: (0..states.len()).map(origin).collect(), found, miss, found_miss }
    }

    /// The points that a curve's state claims, where the claim is true of it and all its descendants.
    pub(super) fn claimed<'a>(&self, automaton: &'a Automaton, id: StateId) -> Option<&'a Hull> {
        let hull = automaton.claimed_smooth().get(&id)?.hull.as_ref();
        hull.filter(|_| self.origins[id.index()] == Some(Origin::Proof))
    }

    /// As [`Self::claimed`], or found.
    fn proven<'a>(&'a self, automaton: &'a Automaton, id: StateId) -> Option<&'a Hull> {
        let found = || self.found.get(&id).filter(|_| self.origins[id.index()] == Some(Origin::Proof));
        self.claimed(automaton, id).or_else(|| found().map(|found| &found.hull))
    }

    /// Bounds, as a share of the points' largest distance, how far an attractor may leave the hull of points that are claimed.
    pub(super) fn miss(&self) -> f64 {
        self.miss
    }

    /// The points of a state, if they are others than its control points or those of a product.
    pub(super) fn of(&self, automaton: &Automaton, id: StateId) -> Option<StateHull> {
        let own = [id];
        let parts = if automaton.factors(id).is_empty() { &own } else { automaton.factors(id) };
        let origins: Vec<Origin> = parts.iter().map(|part| self.origins[part.index()]).collect::<Option<_>>()?;
        if origins == [Origin::Control] {
            return None;
        }
        let (mut points, mut children, mut attained, mut miss) = (Vec::new(), vec![Vec::new()], vec![vec![(0, 1.0)]], 0.0);
        for &part in parts {
            let (own, steps) = self.points_of(automaton, part);
            miss += match self.origins[part.index()] {
                Some(Origin::Proof) if self.found.contains_key(&part) => self.found_miss,
                Some(Origin::Proof) => self.miss,
                _ => 0.0,
            };
            // In lexicographic order, as the product's children are.
            children = children
                .iter()
                .flat_map(|first: &Vec<_>| steps.iter().map(|step| [first.as_slice(), std::slice::from_ref(step)].concat()))
                .collect();
            let ends = self.attained_by(automaton, part, &own);
            let pair = |first: &Vec<(usize, f64)>, end: &Vec<(usize, f64)>| {
                first.iter().flat_map(|(i, x)| end.iter().map(|(j, y)| (i * own.columns() + j, x * y)).collect::<Vec<_>>()).collect()
            };
            attained = attained.iter().flat_map(|first| ends.iter().map(|end| pair(first, end)).collect::<Vec<_>>()).collect();
            points.push(own);
        }
        let is_signed = points.iter().any(|points| !points.is_nonnegative());
        Some(StateHull {
            is_signed,
            points: origins.contains(&Origin::Proof).then(|| SubdivisionOperator::product(points)),
            children: children.into_iter().map(SubdivisionOperator::product).collect(),
            attained,
            miss,
        })
    }

    /// Points of the attractor of a state that is no product: the ends of a curve among its points, and what was found.
    fn attained_by(&self, automaton: &Automaton, id: StateId, points: &SubdivisionOperator) -> Vec<Vec<(usize, f64)>> {
        if self.origins[id.index()] == Some(Origin::Proof)
            && let Some(found) = self.found.get(&id)
        {
            let shares = |point: &Vec<f64>| point.iter().copied().enumerate().filter(|(_, share)| *share != 0.0).collect();
            return found.attained.iter().map(shares).collect();
        }
        let LeafPrimitive::Chord(ends) = &automaton.state(id).leaf else { return Vec::new() };
        let is = |k: usize, end: &[f64]| points.column(k).iter().zip(end).all(|(x, y)| (x - y).abs() <= SAME);
        (0..points.columns()).filter(|&k| is(k, &ends.start) || is(k, &ends.end)).map(|k| vec![(k, 1.0)]).collect()
    }

    /// H and K of a state that is no product.
    fn points_of(&self, automaton: &Automaton, id: StateId) -> (SubdivisionOperator, Vec<SubdivisionOperator>) {
        match self.proven(automaton, id) {
            Some(hull) => (hull.points.clone(), hull.children.clone()),
            None => {
                let state = automaton.state(id);
                let operators = state.transitions.iter().map(|transition| transition.operator.clone());
                (SubdivisionOperator::identity(state.dimension), operators.collect())
            }
        }
    }
}

/// The largest entry of T H' - H K over a state's transitions; `None` where that is too large, or K has negative
/// entries.
fn off<'a>(automaton: &Automaton, id: StateId, hull: &dyn Fn(StateId) -> Option<&'a Hull>) -> Option<f64> {
    let own = hull(id)?;
    let transitions = &automaton.state(id).transitions;
    if transitions.len() != own.children.len() {
        return None;
    }
    let mut largest = 0.0_f64;
    for (transition, inner) in transitions.iter().zip(&own.children) {
        let child = hull(transition.to)?;
        if inner.rows() != own.points.columns() || inner.columns() != child.points.columns() || !inner.is_nonnegative() {
            return None;
        }
        let (left, right) = (transition.operator.times(&child.points), own.points.times(inner));
        largest = left.entries().iter().zip(right.entries()).map(|(a, b)| (a - b).abs()).fold(largest, f64::max);
    }
    // Written so that what is not a number fails.
    (largest <= MISS).then_some(largest)
}
