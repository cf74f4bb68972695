//! Curves of the user's own automata, as factors of products.

use super::Faults;
use super::factor::{Factor, Piece, Span};
use crate::automaton::{State, StateId, SubdivisionOperator};
use crate::model::lower::Draft;
use crate::model::{AffineMap, Bcifs, BcifsState, CellKind, RootCell};
use glam::{DMat3, DVec3, DVec4};

/// The end of a curve may miss that of its first or last child by this much in barycentric coordinates: operators printed
/// with few digits leave 1e-6.
const ENDS: f64 = 1e-4;
/// Steps by which the limit of a vertex is taken.
const STEPS: usize = 256;

/// The edge state `start` of some states, with `count` control points. Every state that it reaches by transitions is an
/// edge between two vertices.
pub(super) fn bcifs(states: &[BcifsState], start: &str, count: usize, faults: &mut Faults<'_>) -> Option<Factor> {
    let Some(position) = states.iter().position(|state| state.name == start) else {
        faults.add("/start", "tensor.start", format!("there is no state '{start}'"));
        return None;
    };
    let dimension = states[position].dimension;
    if count != dimension {
        faults.add_points("tensor.points", format!("{count} control points: state '{start}' has {dimension}"));
        return None;
    }
    // Read as a model of its own, with some control points: the operators are checked and unknown ones solved.
    let cell = RootCell { state: start.into(), control_points: vec![Some(DVec4::W); dimension] };
    let mut draft = Draft::default();
    Bcifs { states: states.to_vec(), cells: vec![cell], ..Bcifs::default() }.lower(&mut draft);
    for finding in draft.findings.iter().filter(|finding| !finding.warning) {
        faults.add(&finding.pointer, finding.code, finding.message.clone());
    }
    if draft.findings.iter().any(|finding| !finding.warning) {
        return None;
    }
    let mut order = vec![draft.roots.first()?.state];
    let mut pieces = Vec::new();
    while let Some(&id) = order.get(pieces.len()) {
        let place = format!("/states/{}", id.index());
        let piece = piece(&draft.states, id, &mut order, &place, faults)?;
        pieces.push(piece);
    }
    for piece in &pieces {
        if let Some(end) = (0..2).find(|&end| !begins_in_a_child(&pieces, piece, end)) {
            let message = format!("{}: boundary {end} is the end of no child, so that the product has no sides", piece.name);
            faults.add("/states", "tensor.ends", message);
            return None;
        }
    }
    let content = format!("{:?}", pieces.iter().map(|piece| (&piece.children, &piece.ends)).collect::<Vec<_>>());
    for (index, piece) in pieces.iter_mut().enumerate() {
        piece.name = format!("curve {index} of {content}");
    }
    Some(alone(pieces, count))
}

/// A state as a piece; the states of its children join `order`.
fn piece(states: &[State], id: StateId, order: &mut Vec<StateId>, place: &str, faults: &mut Faults<'_>) -> Option<Piece> {
    let state = &states[id.index()];
    let [first, last] = state.boundaries.as_slice() else {
        let found = state.boundaries.len();
        let message = format!("state '{}' has {found} boundaries: a curve in a product has two, its ends", state.name);
        faults.add(&format!("{place}/boundaries"), "tensor.ends", message);
        return None;
    };
    let edge = state.kind == Some(CellKind::Edge) && !state.transitions.is_empty();
    if !edge || [first, last].iter().any(|boundary| states[boundary.state.index()].kind != Some(CellKind::Vertex)) {
        let message = format!("state '{}': curves of products are edges between vertices, and subdivide", state.name);
        faults.add(place, "tensor.scheme", message);
        return None;
    }
    let mut index = |to: StateId| {
        order.iter().position(|&known| known == to).unwrap_or_else(|| {
            order.push(to);
            order.len() - 1
        })
    };
    let children = state.transitions.iter().map(|transition| (index(transition.to), transition.operator.clone())).collect();
    let ends = [first, last].map(|boundary| boundary.incidence.apply(&limit(states, boundary.state)));
    Some(Piece { name: format!("state '{}'", state.name), dimension: state.dimension, children, ends, parameters: Vec::new(), hull: None })
}

/// The point that a vertex is.
fn limit(states: &[State], vertex: StateId) -> Vec<f64> {
    let mut operators = Vec::new();
    let mut current = &states[vertex.index()];
    while let (true, Some(next)) = (operators.len() < STEPS && current.dimension > 1, current.transitions.first()) {
        operators.push(&next.operator);
        current = &states[next.to.index()];
    }
    let middle = vec![1.0 / current.dimension as f64; current.dimension];
    operators.iter().rev().fold(middle, |point, operator| operator.apply(&point))
}

fn begins_in_a_child(pieces: &[Piece], piece: &Piece, end: usize) -> bool {
    piece.children.iter().any(|(child, operator)| {
        pieces[*child].ends.iter().any(|other| operator.apply(other).iter().zip(&piece.ends[end]).all(|(a, b)| (a - b).abs() <= ENDS))
    })
}

/// The curve of affine maps whose images follow each other: the first begins where the curve does, the last ends there.
/// Its control points are an affine frame (o, o + e_1, o + e_2, o + e_3).
pub(super) fn ifs(maps: &[AffineMap], count: usize, faults: &mut Faults<'_>) -> Option<Factor> {
    if count != 4 {
        let message = format!("{count} control points: maps need 4 in their direction, an affine frame o, o + x, o + y, o + z");
        faults.add_points("tensor.points", message);
        return None;
    }
    let [first, .., last] = maps else {
        faults.add("/maps", "tensor.scheme", format!("{} maps: a curve has two or more", maps.len()));
        return None;
    };
    if let Some(index) = maps.iter().position(|map| !(map.linear.is_finite() && map.translation.is_finite())) {
        faults.add(&format!("/maps/{index}"), "model.not-finite", "the map has an entry that is not finite".into());
        return None;
    }
    // The fixed points are the curve's ends.
    let fixed = |map: &AffineMap| (DMat3::IDENTITY - map.linear).inverse() * map.translation;
    let ends = [fixed(first), fixed(last)];
    let size = 1.0 + ends.iter().map(|end| end.abs().max_element()).fold(0.0, f64::max);
    for (index, pair) in maps.windows(2).enumerate() {
        let image = |map: &AffineMap, end: usize| map.linear * ends[end] + map.translation;
        let gap = (0..4).map(|k| image(&pair[0], k / 2).distance(image(&pair[1], k % 2))).fold(f64::INFINITY, f64::min);
        // Written so that what is not a number is refused.
        if !matches!(gap.partial_cmp(&(ENDS * size)), Some(std::cmp::Ordering::Less)) {
            let message = format!("the images of maps {index} and {} have no end in common: a product needs a curve", index + 1);
            faults.add(&format!("/maps/{}", index + 1), "tensor.ends", message);
            return None;
        }
    }
    let barycentric = |p: DVec3| [1.0 - p.x - p.y - p.z, p.x, p.y, p.z];
    let child = |map: &AffineMap| {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let columns = corners.iter().flat_map(|&corner| barycentric(map.linear * corner + map.translation)).collect();
        (0, SubdivisionOperator::exact(4, columns))
    };
    let numbers: Vec<f64> = maps.iter().flat_map(|map| map.linear.to_cols_array().into_iter().chain(map.translation.to_array())).collect();
    let piece = Piece {
        name: format!("curve of the maps {numbers:?}"),
        dimension: 4,
        children: maps.iter().map(child).collect(),
        ends: ends.map(|end| barycentric(end).to_vec()),
        parameters: Vec::new(),
        hull: None,
    };
    Some(alone(vec![piece], 4))
}

/// One span of the first piece.
fn alone(pieces: Vec<Piece>, count: usize) -> Factor {
    let controls = (0..count).map(|point| vec![(point, 1.0)]).collect();
    Factor { pieces, spans: vec![Span { piece: 0, controls }], joints: Vec::new() }
}
