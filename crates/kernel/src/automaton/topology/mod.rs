//! The B-rep of every state and how it continues through a subdivision, worked out once in barycentric
//! coordinates: which boundary cells the children share, which lie on the parent's own boundary, and which are
//! created inside. Two cells are one because the model declares it, or because their embeddings are equal for
//! *all* control points; positions in space are never compared.
//!
//! Terms. The *closure* of a state lists its boundary cells, those cells' boundaries and so on, each once. A
//! cell may be *viewed* with its control points in another order ([`View`]), as two neighbours see their
//! common edge from opposite sides. The *split* of a state says, for every cell of every child's closure, where
//! it comes from.

mod closure;
mod split;
mod symmetry;
mod union;

pub(crate) use closure::Closure;
pub(crate) use split::{Source, Split};
pub use symmetry::View;
pub(crate) use union::{Conflict, Union};

use super::{Automaton, State, StateId};
use crate::model::CellKind;
use symmetry::Symmetry;

/// What a model says of a state's subdivision; lists may be empty or incomplete.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Declared {
    /// Boundary k and its children's places: the j-th child of boundary k is boundary m of child i.
    pub incidences: Vec<(usize, Vec<Place>)>,
    /// Boundaries that two children share.
    pub adjacencies: Vec<Shared>,
}

/// Boundary m of child i: (i, m).
pub type Place = (usize, usize);

/// Two boundaries that are one cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Shared {
    /// Where it is seen.
    pub between: [Place; 2],
    /// Control point j of the first is control point `permutation[j]` of the second; `None`: the same order.
    pub permutation: Option<Vec<usize>>,
}

/// Why states have no coherent B-rep.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TopologyError {
    /// A boundary is seen in another order, in which it subdivides otherwise.
    #[error(
        "state '{state}' is shared with its control points in the order {permutation:?}, but it does not subdivide alike in that order: the two sides would come apart at the next level"
    )]
    Asymmetric {
        /// The boundary's state.
        state: String,
        /// The order.
        permutation: Vec<usize>,
    },
    /// One cell is seen in two ways that contradict each other.
    #[error("state '{state}': a boundary of child {child} is identified with itself turned round")]
    Twisted {
        /// The state that subdivides.
        state: String,
        /// A child that sees the boundary.
        child: usize,
    },
    /// A boundary is not of lower dimension.
    #[error("state '{state}' is bounded by state '{boundary}', which is not of lower dimension")]
    Dimension {
        /// The state.
        state: String,
        /// Its boundary.
        boundary: String,
    },
    /// A vertex must have one child and no boundary.
    #[error("state '{state}' is a vertex and has {children} children: a vertex subdivides into one vertex")]
    Vertex {
        /// The state.
        state: String,
        /// Its number of transitions.
        children: usize,
    },
}

impl TopologyError {
    /// Stable code.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Asymmetric { .. } => "automaton.asymmetric-boundary",
            Self::Twisted { .. } => "automaton.twisted-boundary",
            Self::Dimension { .. } => "automaton.boundary-dimension",
            Self::Vertex { .. } => "automaton.vertex-children",
        }
    }
}

/// The B-rep of all states that have one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Topology {
    states: Vec<StateTopology>,
}

/// Closure, split and symmetries of one state.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct StateTopology {
    /// 0 vertex, 1 edge, 2 face, 3 volume.
    pub(crate) dimension: usize,
    pub(crate) closure: Closure,
    pub(crate) split: Split,
    /// The limit point of a vertex in its barycentric space; empty for other kinds.
    pub(crate) limit: Vec<f64>,
    /// For a curve from boundary 0 to boundary 1: its children in order, each with whether it runs backwards.
    pub(crate) chain: Option<Vec<(usize, bool)>>,
    /// Whether the children hang together through cells that they share, and so do theirs: then the attractor is
    /// connected.
    pub(crate) connected: bool,
    /// For such a face: a point of its attractor away from its edges, in its barycentric space.
    pub(crate) middle: Vec<f64>,
    /// For a face that its edges surround: the closure's edges in order, each with whether it runs backwards.
    pub(crate) outline: Option<Vec<(usize, bool)>>,
    symmetries: Vec<Symmetry>,
    /// Permutations that are no symmetries.
    refused: Vec<Vec<usize>>,
    /// Index of the product of two views; see [`View`].
    products: Vec<Vec<View>>,
}

/// Coordinates may differ by this much, relatively, and be equal: operators printed with few digits satisfy
/// their constraints to 1e-6, and distinct cells one subdivision apart differ by far more.
const SAME: f64 = 1e-4;

pub(crate) fn same(left: &[f64], right: &[f64]) -> bool {
    left.len() == right.len() && left.iter().zip(right).all(|(a, b)| (a - b).abs() <= SAME * (1.0 + a.abs()))
}

/// More nodes of one subdivision than this are not compared with each other: then only what is declared counts.
const MOST_COMPARED: usize = 1500;

impl Topology {
    /// Works out the B-rep of all states; `declared` is by state.
    ///
    /// Cost: for each state, quadratic in the boundary cells of its children up to 1,500 of them, linear beyond.
    ///
    /// # Errors
    /// [`TopologyError`] for what contradicts itself.
    pub fn new(automaton: &Automaton, declared: &[Declared]) -> Result<Self, TopologyError> {
        let mut topology = Self { states: vec![StateTopology::default(); automaton.states().len()] };
        for (index, state) in automaton.states().iter().enumerate() {
            topology.states[index].dimension = dimension(state.kind);
            check_boundaries(automaton, state)?;
        }
        let of = |dimension: usize, topology: &Self| -> Vec<StateId> {
            let with = topology.states.iter().enumerate().filter(|(_, state)| state.dimension == dimension);
            with.map(|(index, _)| StateId::new(index)).collect()
        };
        for id in of(0, &topology) {
            topology.states[id.index()].limit = vertex_limit(automaton, id)?;
            topology.states[id.index()].connected = true;
        }
        for dimension in 1..=3 {
            let states = of(dimension, &topology);
            for &id in &states {
                let closure = topology.build_closure(automaton, id)?;
                topology.states[id.index()].closure = closure;
            }
            for &id in &states {
                let nothing = Declared::default();
                let split = topology.build_split(automaton, id, declared.get(id.index()).unwrap_or(&nothing))?;
                topology.states[id.index()].split = split;
            }
            for &id in &states {
                let (chain, outline) = (topology.build_chain(id), topology.build_outline(id));
                topology.states[id.index()].chain = chain;
                topology.states[id.index()].outline = outline;
            }
            topology.keep_true_curves(automaton);
            topology.find_connected(automaton, &states);
            for &id in &states {
                topology.states[id.index()].middle = topology.build_middle(automaton, id);
            }
        }
        Ok(topology)
    }

    /// One state's.
    pub(crate) fn state(&self, id: StateId) -> &StateTopology {
        &self.states[id.index()]
    }

    /// The view of a boundary state that a permutation of its control points gives: used for root cells that
    /// share a boundary. Products of views are tabulated by [`Self::tabulate`].
    pub(crate) fn view(&mut self, automaton: &Automaton, id: StateId, permutation: &[usize]) -> Result<View, TopologyError> {
        self.intern(automaton, id, permutation.to_vec())
    }

    /// Edges are chains only if all their descendants are.
    fn keep_true_curves(&mut self, automaton: &Automaton) {
        let curves = self.states.iter().map(|state| state.chain.is_some()).collect();
        for (state, curve) in self.states.iter_mut().zip(automaton.hereditary(curves)) {
            state.chain = state.chain.take().filter(|_| curve);
        }
    }

    /// Marks the states whose children form a connected graph of connected cells (Hata 1985).
    fn find_connected(&mut self, automaton: &Automaton, states: &[StateId]) {
        for &id in states {
            let split = &self.state(id).split;
            let mut group: Vec<usize> = (0..split.children.len()).collect();
            // A shared cell has its limit set, which is not empty, in both children.
            for left in 0..split.children.len() {
                for right in left + 1..split.children.len() {
                    let shared = |source: &Source| split.children[right].iter().any(|other| other.is_cell_of(source));
                    if group[left] != group[right] && split.children[left].iter().any(shared) {
                        let (from, to) = (group[right], group[left]);
                        group.iter_mut().filter(|own| **own == from).for_each(|own| *own = to);
                    }
                }
            }
            self.states[id.index()].connected = group.iter().all(|&own| own == group[0]);
        }
        let connected = self.states.iter().map(|state| state.connected).collect();
        for (state, connected) in self.states.iter_mut().zip(automaton.hereditary(connected)) {
            state.connected = connected;
        }
    }

    /// The two end vertices of an edge, as indices of its closure.
    pub(crate) fn ends(&self, id: StateId) -> Option<[usize; 2]> {
        let own = self.state(id);
        match own.closure.boundaries.as_slice() {
            [(start, _), (end, _)] if own.dimension == 1 => Some([*start, *end]),
            _ => None,
        }
    }

    /// The vertex one or two subdivisions down that is closest to the mean of a face's corners: it stands in the
    /// middle of a fan of triangles.
    fn build_middle(&self, automaton: &Automaton, id: StateId) -> Vec<f64> {
        let own = self.state(id);
        if own.outline.is_none() {
            return Vec::new();
        }
        let corners: Vec<&Vec<f64>> = own.closure.cells.iter().map(|cell| &cell.point).filter(|point| !point.is_empty()).collect();
        let mean: Vec<f64> = (0..automaton.state(id).dimension)
            .map(|k| corners.iter().map(|corner| corner[k]).sum::<f64>() / corners.len() as f64)
            .collect();
        let mut candidates: Vec<Vec<f64>> = own.split.pieces.iter().map(|piece| piece.point.clone()).collect();
        for transition in &automaton.state(id).transitions {
            let inner = self.state(transition.to).split.pieces.iter().filter(|piece| !piece.point.is_empty());
            candidates.extend(inner.map(|piece| transition.operator.apply(&piece.point)));
        }
        let square = |point: &Vec<f64>| point.iter().zip(&mean).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let known = candidates.into_iter().filter(|point| !point.is_empty());
        known.min_by(|a, b| square(a).total_cmp(&square(b))).unwrap_or_default()
    }

    /// Whether the children of an edge form a chain from its start to its end.
    fn build_chain(&self, id: StateId) -> Option<Vec<(usize, bool)>> {
        let [start, end] = self.ends(id)?;
        let own = self.state(id);
        let mut current = Source::Vertex { cell: start };
        let mut chain = Vec::new();
        for (child, sources) in own.split.children.iter().enumerate() {
            let [first, last] = self.ends(own.split.pieces[child].state)?;
            if sources[first] == current {
                chain.push((child, false));
                current = sources[last];
            } else if sources[last] == current {
                chain.push((child, true));
                current = sources[first];
            } else {
                return None;
            }
        }
        // An edge that does not subdivide is a segment.
        (chain.is_empty() || current == Source::Vertex { cell: end }).then_some(chain)
    }

    /// The edges around a face, if they are curves and form one cycle.
    fn build_outline(&self, id: StateId) -> Option<Vec<(usize, bool)>> {
        let own = self.state(id);
        if own.dimension != 2 || own.closure.boundaries.is_empty() {
            return None;
        }
        let mut sides: Vec<(usize, usize, usize)> = Vec::new();
        for &(cell, _) in &own.closure.boundaries {
            let edge = &own.closure.cells[cell];
            self.state(edge.state).chain.as_ref()?;
            let [start, end] = self.ends(edge.state)?;
            if sides.iter().any(|side| side.0 == cell) {
                return None;
            }
            sides.push((cell, edge.cells[start].0, edge.cells[end].0));
        }
        let (first, mut begin, mut current) = sides.remove(0);
        // The order in which the boundaries are listed says which way round the face is seen from outside.
        let backwards = sides.first().is_some_and(|&(_, a, b)| (a == begin || b == begin) && a != current && b != current);
        if backwards {
            std::mem::swap(&mut begin, &mut current);
        }
        let mut outline = vec![(first, backwards)];
        while !sides.is_empty() {
            let next = sides.iter().position(|&(_, a, b)| a == current || b == current)?;
            let (cell, start, end) = sides.remove(next);
            outline.push((cell, start != current));
            current = if start == current { end } else { start };
        }
        (current == begin).then_some(outline)
    }
}

fn dimension(kind: Option<CellKind>) -> usize {
    match kind {
        Some(CellKind::Vertex) => 0,
        Some(CellKind::Edge) => 1,
        Some(CellKind::Face) => 2,
        Some(CellKind::Volume) => 3,
        // A state without a kind has no B-rep: beyond all dimensions.
        None => 4,
    }
}

fn check_boundaries(automaton: &Automaton, state: &State) -> Result<(), TopologyError> {
    for boundary in &state.boundaries {
        let other = automaton.state(boundary.state);
        if dimension(other.kind) >= dimension(state.kind) {
            return Err(TopologyError::Dimension { state: state.name.clone(), boundary: other.name.clone() });
        }
    }
    Ok(())
}

/// The point that a vertex state is: the limit of its cycle, T^256 x.
fn vertex_limit(automaton: &Automaton, id: StateId) -> Result<Vec<f64>, TopologyError> {
    let mut chain = Vec::new();
    let mut current = id;
    for _ in 0..256 {
        let state = automaton.state(current);
        if state.dimension == 1 {
            break;
        }
        let [transition] = state.transitions.as_slice() else {
            return Err(TopologyError::Vertex { state: state.name.clone(), children: state.transitions.len() });
        };
        chain.push(&transition.operator);
        current = transition.to;
    }
    let dimension = automaton.state(current).dimension;
    let start = vec![1.0 / dimension as f64; dimension];
    Ok(chain.iter().rev().fold(start, |point, operator| operator.apply(&point)))
}
