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
//!
//! *Rounding.* What is computed of operators is not exact: T_e H_w = H_s K_e + E_e with small E_e. Sums of columns are 1, exactly, if what they are off is
//! taken from the first row of T and H, and from the largest entry of each column of K; then columns of E sum to 0. Let x' = H_w p + y be a point of a child
//! with p in the simplex and y of adapted norm at most n_w. Then T_e x' = H_s (K_e p) + E_e p + T_e y: the parent's y has a norm of at most that of the longest
//! column of E_e, and n_w times that of the step T_e. So if n_s is at least the largest of these sums over the transitions of s, for every s, all that
//! begins with points of hulls stays within n_s of them, at any depth, and so does the attractor in the end. Such n are found from below, enlarged a little, and
//! tested. Where single steps do not contract there are none, and a path's errors sum to at most the longest one times `Contraction::sum_of_norms`.
//! `Contraction::sum_norm_ratio` makes sums of coordinates of either.

use super::Attractor;
use super::polytope::{Polytope, polytope};
use crate::automaton::{Automaton, Contraction, Hull, LeafPrimitive, StateId, SubdivisionOperator};
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// Entries by which hulls may miss their children's: operators are rounded to fractions. Beyond it a claim is false.
const MISS: f64 = 1e-13;
/// Steps after which what is missed no longer grows where maps halve, and the factor by which it is enlarged then.
const ROUNDS: usize = 60;
const ENLARGED: f64 = 1.01;
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
    /// Points of the attractor are within this of some in the hull, in the sum of coordinates.
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
    /// Of every state, whether what the model claims is true of it and all its descendants; and how far those attractors may leave these hulls.
    claimed: Vec<bool>,
    miss: f64,
    /// Of every state, what its claim is off, and how far its attractor may leave the hull.
    offs: Vec<Option<f64>>,
    misses: Vec<f64>,
    /// Sought when first asked for: only boxes ask.
    found: OnceLock<Found>,
}

/// What is known of all states.
#[derive(Clone, Debug)]
struct Found {
    polytopes: BTreeMap<StateId, Polytope>,
    origins: Vec<Option<Origin>>,
    /// Of every state with a proof.
    misses: Vec<f64>,
}

impl Hulls {
    /// Verifies what models claim.
    ///
    /// Cost: two products of matrices for every transition that has a claim.
    pub(super) fn new(automaton: &Automaton, contraction: &Contraction) -> Self {
        let claims = automaton.claimed_smooth();
        let ids = (0..automaton.states().len()).map(StateId::new);
        let offs: Vec<Option<f64>> = ids.map(|id| off(automaton, id, &|id| claims.get(&id)?.hull.as_ref())).collect();
        let (claimed, misses) = verified(automaton, contraction, &offs);
        Self { claimed, miss: misses.iter().copied().fold(0.0, f64::max), offs, misses, found: OnceLock::new() }
    }

    /// Finds polytopes where models claim nothing.
    fn found(&self, attractor: &Attractor) -> &Found {
        self.found.get_or_init(|| {
            let automaton = attractor.automaton();
            let states = automaton.states();
            let ids = || (0..states.len()).map(StateId::new);
            let claims = automaton.claimed_smooth();
            let claim = |id: StateId| claims.get(&id)?.hull.as_ref();
            let parameters = |id: StateId| attractor.precision(id).map(|precision| precision.parameters.as_slice());
            let polytopes: BTreeMap<StateId, Polytope> =
                ids().filter(|&id| claim(id).is_none()).filter_map(|id| Some((id, polytope(automaton, id, parameters(id))?))).collect();
            let hull = |id: StateId| claim(id).or_else(|| polytopes.get(&id).map(|found| &found.hull));
            // Where nothing is found, what is known of claims is all.
            let (proven, misses) = if polytopes.is_empty() {
                (self.claimed.clone(), self.misses.clone())
            } else {
                let offs: Vec<Option<f64>> = ids().zip(&self.offs).map(|(id, known)| known.or_else(|| off(automaton, id, &hull))).collect();
                verified(automaton, attractor.contraction(), &offs)
            };
            let plain = |index: usize| {
                let state = &states[index];
                !proven[index]
                    && !state.frame
                    && automaton.factors(StateId::new(index)).is_empty()
                    && state.transitions.iter().all(|step| step.operator.is_nonnegative())
            };
            let control = automaton.hereditary((0..states.len()).map(plain).collect());
            let origin = |index: usize| if proven[index] { Some(Origin::Proof) } else { control[index].then_some(Origin::Control) };
            let origins = (0..states.len()).map(origin).collect();
            Found { polytopes, origins, misses }
        })
    }

    /// The points that a curve's state claims, where the claim is true of it and all its descendants.
    pub(super) fn claimed<'a>(&self, automaton: &'a Automaton, id: StateId) -> Option<&'a Hull> {
        let hull = automaton.claimed_smooth().get(&id)?.hull.as_ref();
        hull.filter(|_| self.claimed[id.index()])
    }

    /// Bounds, in the sum of coordinates, how far an attractor may leave the hull of points that are claimed.
    pub(super) fn miss(&self) -> f64 {
        self.miss
    }

    /// The points of a state, if they are others than its control points or those of a product.
    pub(super) fn of(&self, attractor: &Attractor, id: StateId) -> Option<StateHull> {
        let (automaton, found) = (attractor.automaton(), self.found(attractor));
        let own = [id];
        let parts = if automaton.factors(id).is_empty() { &own } else { automaton.factors(id) };
        let origins: Vec<Origin> = parts.iter().map(|part| found.origins[part.index()]).collect::<Option<_>>()?;
        if origins == [Origin::Control] {
            return None;
        }
        let (mut points, mut children, mut attained) = (Vec::new(), vec![Vec::new()], vec![vec![(0, 1.0)]]);
        // With points p of the factors' hulls and y that are added to them, products of p + y differ from those of p by at most prod (|p| + |y|) - prod |p|.
        let mut sizes = [1.0; 2];
        for &part in parts {
            let (own, steps) = found.points_of(automaton, part);
            let size = (0..own.columns()).map(|k| own.column(k).iter().map(|x| x.abs()).sum()).fold(1.0, f64::max);
            sizes = [sizes[0] * size, sizes[1] * (size + found.misses[part.index()])];
            // In lexicographic order, as the product's children are.
            children = children
                .iter()
                .flat_map(|first: &Vec<_>| steps.iter().map(|step| [first.as_slice(), std::slice::from_ref(step)].concat()))
                .collect();
            let ends = found.attained_by(automaton, part, &own);
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
            miss: sizes[1] - sizes[0],
        })
    }
}

impl Found {
    /// Points of the attractor of a state that is no product: the ends of a curve among its points, and what was found.
    fn attained_by(&self, automaton: &Automaton, id: StateId, points: &SubdivisionOperator) -> Vec<Vec<(usize, f64)>> {
        if self.origins[id.index()] == Some(Origin::Proof)
            && let Some(found) = self.polytopes.get(&id)
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
        let claims = automaton.claimed_smooth();
        let proven = claims.get(&id).and_then(|claim| claim.hull.as_ref()).or_else(|| self.polytopes.get(&id).map(|found| &found.hull));
        match proven.filter(|_| self.origins[id.index()] == Some(Origin::Proof)) {
            Some(hull) => (hull.points.clone(), hull.children.clone()),
            None => {
                let state = automaton.state(id);
                let operators = state.transitions.iter().map(|transition| transition.operator.clone());
                (SubdivisionOperator::identity(state.dimension), operators.collect())
            }
        }
    }
}

/// For which states the hulls are proven, with those of all their descendants, and how far the attractors may leave them, in the sum of coordinates.
fn verified(automaton: &Automaton, contraction: &Contraction, offs: &[Option<f64>]) -> (Vec<bool>, Vec<f64>) {
    let ids = || (0..automaton.states().len()).map(StateId::new);
    let proven = automaton.hereditary(offs.iter().map(Option::is_some).collect());
    let is = |id: &StateId| proven[id.index()];
    let norms: Vec<f64> =
        ids().map(|id| if is(&id) { offs[id.index()].map_or(0.0, |off| off * contraction.norm_of_sum(id)) } else { 0.0 }).collect();
    let longest = norms.iter().copied().fold(0.0, f64::max);
    // What a state's points miss by if those of its children miss by that much.
    let through = |children: &[f64], id: StateId| {
        let steps = automaton.state(id).transitions.iter().zip(&contraction.step_norms[id.index()]);
        steps.map(|(step, norm)| norms[id.index()] + norm * children[step.to.index()]).fold(norms[id.index()], f64::max)
    };
    let mut within = norms.clone();
    for _ in 0..ROUNDS {
        let next: Vec<f64> = ids().map(|id| if is(&id) { through(&within, id) } else { 0.0 }).collect();
        if std::mem::replace(&mut within, next) == within {
            break;
        }
    }
    within.iter_mut().for_each(|norm| *norm *= ENLARGED);
    let holds = ids().filter(is).all(|id| through(&within, id) <= within[id.index()]);
    let along = longest * contraction.sum_of_norms();
    let norm = |id: StateId| if holds { along.min(within[id.index()]) } else { along };
    let misses = ids().map(|id| if is(&id) { norm(id) * contraction.sum_norm_ratio(id) } else { 0.0 }).collect();
    (proven, misses)
}

/// Bounds the sum of coordinates of a column of E, over a state's transitions; `None` where T H' - H K has an entry that is too large, or K negative ones.
///
/// Entries of E other than the first are those of T H' - H K, as far as these are computed, and what the sums of columns of H' and K are off: the first adds
/// to entry k of E at most |T_k0|, the second |H_kj| times as much. The first entry of E is minus the sum of the others.
fn off<'a>(automaton: &Automaton, id: StateId, hull: &dyn Fn(StateId) -> Option<&'a Hull>) -> Option<f64> {
    let own = hull(id)?;
    let transitions = &automaton.state(id).transitions;
    if transitions.len() != own.children.len() {
        return None;
    }
    let size = |row: &[f64]| row.iter().map(|x| x.abs()).sum::<f64>();
    let largest = |k: usize| (0..own.points.columns()).map(|i| own.points.entry(k, i).abs()).fold(0.0, f64::max);
    let largest: Vec<f64> = (0..own.points.rows()).map(largest).collect();
    let mut most = 0.0_f64;
    for (transition, inner) in transitions.iter().zip(&own.children) {
        let child = hull(transition.to)?;
        if inner.rows() != own.points.columns() || inner.columns() != child.points.columns() || !inner.is_nonnegative() {
            return None;
        }
        let operator = &transition.operator;
        let (left, right) = (operator.times(&child.points), own.points.times(inner));
        for j in 0..child.points.columns() {
            let (points, shares) = (child.points.column(j), inner.column(j));
            // A sum of m products has m roundings of each at most, by half of `f64::EPSILON`; what comes of two such sums has one more.
            let roundings = 0.5 * (points.len().max(shares.len()) + 2) as f64 * f64::EPSILON;
            let off_points = (points.iter().sum::<f64>() - 1.0).abs() + roundings * size(points);
            let negative: f64 = shares.iter().map(|share| (-share).max(0.0)).sum();
            let off_shares = (shares.iter().sum::<f64>() - 1.0).abs() + roundings * size(shares) + 2.0 * negative;
            let mut sum = 0.0;
            for (k, largest) in largest.iter().enumerate() {
                let difference = (left.entry(k, j) - right.entry(k, j)).abs();
                if difference.is_nan() || difference > MISS {
                    return None;
                }
                if k == 0 {
                    continue;
                }
                let terms = points.iter().enumerate().map(|(i, x)| (operator.entry(k, i) * x).abs()).sum::<f64>()
                    + shares.iter().enumerate().map(|(i, x)| (own.points.entry(k, i) * x).abs()).sum::<f64>();
                sum += difference + roundings * terms + operator.entry(k, 0).abs() * off_points + largest * off_shares;
            }
            most = most.max(2.0 * sum);
        }
    }
    Some(most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::automaton::convergence::contraction;
    use crate::automaton::{Smooth, State, Transition};
    use crate::split_mix::Random;

    /// De Casteljau's halves of a curve, as operators on points that are other than its Bezier points, with errors that are added to them.
    fn curve(errors: f64, random: &mut Random) -> (Automaton, Hull) {
        let halves = crate::de_casteljau::operators(4);
        // Uniform cubic splines: H and its inverse.
        let sixth = 1.0 / 6.0;
        let points = [[1.0, 4.0, 1.0, 0.0], [0.0, 4.0, 2.0, 0.0], [0.0, 2.0, 4.0, 0.0], [0.0, 1.0, 4.0, 1.0]].concat();
        let points = SubdivisionOperator::exact(4, points.iter().map(|x| x * sixth).collect());
        let inverse = [[6.0, -7.0, 2.0, 0.0], [0.0, 2.0, -1.0, 0.0], [0.0, -1.0, 2.0, 0.0], [0.0, 2.0, -7.0, 6.0]].concat();
        let inverse = SubdivisionOperator::exact(4, inverse);
        // The same direction for all columns: errors of all steps add up.
        let mut direction: Vec<f64> = (0..4).map(|_| random.next() as f64 / u64::MAX as f64 - 0.5).collect();
        let mean = direction.iter().sum::<f64>() / 4.0;
        direction.iter_mut().for_each(|x| *x = errors * (*x - mean));
        let operator = |half: &SubdivisionOperator| {
            let exact = points.times(half).times(&inverse);
            let entries = exact.entries().iter().enumerate().map(|(index, entry)| entry + direction[index % 4]);
            SubdivisionOperator::exact(4, entries.collect())
        };
        let own = StateId::new(0);
        let transitions = halves.iter().enumerate().map(|(label, half)| Transition { to: own, operator: operator(half), label }).collect();
        let state = State {
            name: String::new(),
            kind: None,
            dimension: 4,
            transitions,
            boundaries: Vec::new(),
            leaf: LeafPrimitive::Centre,
            frame: false,
        };
        let hull = Hull { points, children: halves.to_vec() };
        let mut automaton = Automaton::new(vec![state]).unwrap();
        let claim = Smooth { parameters: vec![-1.0, 0.0, 1.0, 2.0], hull: Some(hull.clone()) };
        automaton.claim_smooth(BTreeMap::from([(own, claim)]));
        (automaton, hull)
    }

    #[test]
    fn errors_of_operators_add_up_to_no_more_than_the_miss() {
        let mut random = Random(7);
        let mut closest = 0.0_f64;
        for round in 0..200 {
            let errors = [1e-13, 1e-14, 3e-15][round % 3];
            let (automaton, hull) = curve(errors, &mut random);
            let hulls = Hulls::new(&automaton, &contraction(&automaton));
            assert!(hulls.claimed[0], "{errors:e}");
            // Both ends, and paths at random: T_1 .. T_k H against H K_1 .. K_k.
            for path in 0..6 {
                let steps: Vec<usize> = (0..60).map(|_| if path < 2 { path } else { (random.next() >> 60) as usize & 1 }).collect();
                let own = &automaton.state(StateId::new(0)).transitions;
                let deep = steps.iter().rev().fold(hull.points.clone(), |points, &step| own[step].operator.times(&points));
                let shares = steps.iter().rev().fold(SubdivisionOperator::identity(4), |shares, &step| hull.children[step].times(&shares));
                let seen = hull.points.times(&shares);
                for k in 0..4 {
                    let off: f64 = deep.column(k).iter().zip(seen.column(k)).map(|(x, y)| (x - y).abs()).sum();
                    assert!(off <= hulls.miss(), "{off:e} is more than {:e}", hulls.miss());
                    closest = closest.max(off / hulls.miss());
                }
            }
        }
        // A bound that says nothing would pass too.
        assert!(closest > 0.02, "{closest}");
    }

    #[test]
    fn claims_that_are_farther_off_are_false() {
        let (automaton, _) = curve(1e-12, &mut Random(7));
        assert!(!Hulls::new(&automaton, &contraction(&automaton)).claimed[0]);
    }
}
