//! Points that attractors attain: limits of periodic paths.
//!
//! Along a path of transitions e_1 ... e_k from state v to state w, T_e1 ... T_ek c_w comes ever closer to a point x of the attractor of v, c being any
//! point of each state's space, here the middle. For subdivided curves and faces whose path always takes the first transition, or always the last, x is
//! an end or a corner. With s the largest adapted norm of a step c_w' - T_e c_w, the rest of the path adds at most s times the sum over j >= k of
//! transient rate^j, since products of j transitions have at most these norms.

use crate::automaton::{Automaton, Contraction, StateId};

/// Choices of transitions: surfaces that are split in four have their corners.
const CHOICES: usize = 4;
/// Wanted distance from the attractor, in the sum of absolute coordinates: that of rounding.
const NEAR: f64 = 1e-15;
/// Steps at most: about 60 where maps halve.
const STEPS: i32 = 500;

/// A point of a barycentric space near one of the state's attractor.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AttainedPoint {
    /// Its coordinates.
    pub(crate) point: Vec<f64>,
    /// Bounds the sum of absolute differences from coordinates of a point of the attractor.
    pub(crate) off: f64,
}

/// At most four points of a state's attractor; none where steps contract too slowly, or for a state that does not subdivide.
///
/// Cost: about sixty applications of operators each where maps halve.
pub(super) fn attained(automaton: &Automaton, contraction: &Contraction, state: StateId) -> Vec<AttainedPoint> {
    let mut found: Vec<AttainedPoint> = Vec::new();
    for attained in (0..CHOICES).filter_map(|choice| limit(automaton, contraction, state, choice)) {
        let apart = |other: &AttainedPoint| other.point.iter().zip(&attained.point).any(|(a, b)| (a - b).abs() > 1e3 * NEAR);
        if found.iter().all(apart) {
            found.push(attained);
        }
    }
    found
}

/// The limit of the path that takes transition `choice` of four that are spread evenly over those of each state: the first, the last, and two between.
fn limit(automaton: &Automaton, contraction: &Contraction, start: StateId, choice: usize) -> Option<AttainedPoint> {
    let middle = |state: StateId| {
        let dimension = automaton.state(state).dimension;
        vec![1.0 / dimension as f64; dimension]
    };
    let next = |state: StateId| {
        let transitions = &automaton.state(state).transitions;
        transitions.get(choice * transitions.len().saturating_sub(1) / (CHOICES - 1))
    };
    // Every state of the path is met within as many steps as there are states.
    let (mut state, mut longest) = (start, 0.0_f64);
    let mut seen = vec![false; automaton.states().len()];
    while !std::mem::replace(&mut seen[state.index()], true) {
        let transition = next(state)?;
        let image = transition.operator.apply(&middle(transition.to));
        longest = longest.max(contraction.distance(state, &middle(state), &image));
        state = transition.to;
    }
    let still = longest * contraction.sum_of_norms() * contraction.sum_norm_ratio(start);
    let steps = (0..=STEPS).find(|&steps| still * contraction.rate().powi(steps) <= NEAR)?;
    let (mut path, mut state) = (Vec::new(), start);
    for _ in 0..steps {
        let transition = next(state)?;
        path.push(transition);
        state = transition.to;
    }
    let point = path.iter().rev().fold(middle(state), |point, transition| transition.operator.apply(&point));
    Some(AttainedPoint { point, off: 2.0 * NEAR })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::automaton::convergence::contraction;
    use crate::automaton::{LeafPrimitive, State, SubdivisionOperator, Transition};

    #[test]
    fn ends_of_a_quadratic_curve_are_found() {
        let halves = [[1.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.25, 0.5, 0.25], [0.25, 0.5, 0.25, 0.0, 0.5, 0.5, 0.0, 0.0, 1.0]];
        let transition = |(label, entries): (usize, &[f64; 9])| Transition {
            to: StateId::new(0),
            operator: SubdivisionOperator::from_columns(3, entries.to_vec()).unwrap().0,
            label,
        };
        let state = State {
            name: "curve".into(),
            kind: None,
            dimension: 3,
            transitions: halves.iter().enumerate().map(transition).collect(),
            boundaries: Vec::new(),
            leaf: LeafPrimitive::Centre,
            frame: false,
        };
        let automaton = Automaton::new(vec![state]).unwrap();
        let found = attained(&automaton, &contraction(&automaton), StateId::new(0));
        assert_eq!(found.len(), 2);
        for (attained, exact) in found.iter().zip([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) {
            let off: f64 = attained.point.iter().zip(exact).map(|(x, y)| (x - y).abs()).sum();
            assert!(off <= attained.off, "{attained:?}");
        }
    }
}
