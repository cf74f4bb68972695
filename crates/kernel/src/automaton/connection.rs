//! Which cells are curves from one end to the other, and where corners are: read from the declared
//! boundaries and verified on the operators.
//!
//! A state is a curve between its ends when its children form a chain: the first starts at its start,
//! each starts where the one before ends, the last ends at its end, and every child is itself such a
//! curve. Its attractor is then the limit of connected chains, hence connected and containing both ends
//! (Hata, "On the structure of self-similar sets", Japan J. Appl. Math. 2, 1985, for one state).

use super::{Automaton, Boundary, LeafPrimitive, State, StateId, Transition};
use crate::model::CellKind;

/// The two ends of a curve, in its state's barycentric space. Both belong to the attractor.
#[derive(Clone, Debug, PartialEq)]
pub struct Ends {
    /// Where it starts.
    pub start: Vec<f64>,
    /// Where it ends.
    pub end: Vec<f64>,
}

/// Ends that should be one point may differ by this much in barycentric coordinates.
const SAME_POINT: f64 = 1e-9;

fn same(left: &[f64], right: &[f64]) -> bool {
    left.iter().zip(right).all(|(a, b)| (a - b).abs() <= SAME_POINT * (1.0 + a.abs()))
}

/// The point that a vertex state is: the fixed point of its cycle.
fn vertex_point(states: &[State], id: StateId) -> Option<Vec<f64>> {
    let state = &states[id.index()];
    if state.dimension == 1 {
        return Some(vec![1.0]);
    }
    // T^128 x for the only transition of each state on the way: a vertex has one child.
    let mut chain = Vec::new();
    let mut current = id;
    for _ in 0..128 {
        let [transition] = states[current.index()].transitions.as_slice() else { return None };
        chain.push(&transition.operator);
        current = transition.to;
    }
    let dimension = states[current.index()].dimension;
    let mut point = vec![1.0 / dimension as f64; dimension];
    for operator in chain.iter().rev() {
        point = operator.apply(&point);
    }
    Some(point)
}

fn boundary_point(states: &[State], boundary: &Boundary) -> Option<Vec<f64>> {
    (states[boundary.state.index()].kind == Some(CellKind::Vertex))
        .then(|| vertex_point(states, boundary.state).map(|point| boundary.incidence.apply(&point)))
        .flatten()
}

fn declared_ends(states: &[State], state: &State) -> Option<Ends> {
    match (&state.leaf, state.boundaries.as_slice()) {
        (LeafPrimitive::Chord(ends), _) => Some(ends.clone()),
        (_, [first, second]) if state.kind == Some(CellKind::Edge) => {
            Some(Ends { start: boundary_point(states, first)?, end: boundary_point(states, second)? })
        }
        _ => None,
    }
}

/// Whether the children of a state form a chain from its start to its end; children may run backwards.
fn is_chain(transitions: &[Transition], ends: &[Option<Ends>], own: &Ends) -> bool {
    let mut current = own.start.clone();
    for transition in transitions {
        let Some(child) = &ends[transition.to.index()] else { return false };
        let (start, end) = (transition.operator.apply(&child.start), transition.operator.apply(&child.end));
        if same(&start, &current) {
            current = end;
        } else if same(&end, &current) {
            current = start;
        } else {
            return false;
        }
    }
    !transitions.is_empty() && same(&current, &own.end)
}

/// The corners of a face in order around it, from its boundary edges.
fn corners(states: &[State], ends: &[Option<Ends>], state: &State) -> Option<Vec<Vec<f64>>> {
    let mut sides = Vec::new();
    for boundary in &state.boundaries {
        let edge = ends[boundary.state.index()].clone().or_else(|| declared_ends(states, &states[boundary.state.index()]))?;
        sides.push((boundary.incidence.apply(&edge.start), boundary.incidence.apply(&edge.end)));
    }
    let (first, mut current) = sides.first()?.clone();
    let mut corners = vec![first.clone()];
    let mut left: Vec<_> = sides.drain(..).skip(1).collect();
    while !left.is_empty() {
        corners.push(current.clone());
        let next = left.iter().position(|(a, b)| same(a, &current) || same(b, &current))?;
        let (a, b) = left.swap_remove(next);
        current = if same(&a, &current) { b } else { a };
    }
    (same(&current, &first) && corners.len() >= 3).then_some(corners)
}

/// Sets the leaf primitives of edges that are proven to be curves and of faces whose sides close.
pub(super) fn connect(automaton: &mut Automaton) {
    let states = automaton.states();
    let mut ends: Vec<Option<Ends>> = states.iter().map(|state| declared_ends(states, state)).collect();
    loop {
        let broken: Vec<usize> = (0..states.len())
            .filter(|&index| {
                let simplex = states[index].leaf == LeafPrimitive::Simplex;
                ends[index].as_ref().is_some_and(|own| !simplex && !is_chain(&states[index].transitions, &ends, own))
            })
            .collect();
        if broken.is_empty() {
            break;
        }
        broken.into_iter().for_each(|index| ends[index] = None);
    }
    let leaves: Vec<Option<LeafPrimitive>> = states
        .iter()
        .zip(&ends)
        .map(|(state, own)| match (&state.leaf, own) {
            (LeafPrimitive::Centre, Some(own)) => Some(LeafPrimitive::Chord(own.clone())),
            (LeafPrimitive::Chord(_), None) => Some(LeafPrimitive::Centre),
            (LeafPrimitive::Centre, None) if state.kind == Some(CellKind::Face) => {
                corners(states, &ends, state).map(LeafPrimitive::Polygon)
            }
            _ => None,
        })
        .collect();
    for (index, leaf) in leaves.into_iter().enumerate() {
        if let Some(leaf) = leaf {
            automaton.set_leaf(StateId::new(index), leaf);
        }
    }
}
