//! The control graph of a BC-IFS: kinds of cells, how they subdivide, and what is drawn of them.

mod connection;
pub mod convergence;
pub(crate) mod matrix;
pub mod operator;
pub mod topology;

pub use connection::Ends;
pub use convergence::Contraction;
pub(crate) use operator::PullBack;
pub use operator::{OperatorError, SubdivisionOperator};

use crate::model::CellKind;
use std::collections::BTreeMap;

/// Index of a [`State`] in its [`Automaton`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct StateId(u32);

impl StateId {
    /// The state of position `index`.
    ///
    /// # Panics
    /// When there are 2^32 states: the document's limits are far below.
    #[must_use]
    pub fn new(index: usize) -> Self {
        Self(u32::try_from(index).expect("fewer than 2^32 states"))
    }

    /// Its position.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// state -> child state, labelled by the operator that gives the child's control points.
#[derive(Clone, Debug, PartialEq)]
pub struct Transition {
    /// The child's state.
    pub to: StateId,
    /// T, n x n_child.
    pub operator: SubdivisionOperator,
    /// Its position in the model's own list of maps or transitions, for messages.
    pub label: usize,
}

/// A boundary of a state: a state of lower dimension and its embedding b, n x n_boundary.
#[derive(Clone, Debug, PartialEq)]
pub struct Boundary {
    /// The boundary's state.
    pub state: StateId,
    /// b.
    pub incidence: SubdivisionOperator,
}

/// What stands for a leaf cell in an approximation, and how its error is bounded.
#[derive(Clone, Debug, PartialEq)]
pub enum LeafPrimitive {
    /// The centre of the cell's bounding ball: its radius is the error.
    Centre,
    /// The cell is the convex hull of its one, two or three control points: no error.
    Simplex,
    /// The segment between the two ends of a cell that is a curve from one to the other: the error is
    /// the largest distance of a control point from the segment.
    Chord(Ends),
    /// Segments from the first of some points of the attractor to the others, for a connected cell that branches; one
    /// point alone is a point.
    Star(Vec<Vec<f64>>),
    /// The polygon of a face's corners (barycentric points), in order around the face.
    Polygon(Vec<Vec<f64>>),
    /// A compact drawn in the affine frame (o, o+e1, o+e2, o+e3) that the four control points hold.
    Drawn(Drawing),
}

/// Points, segments and triangles in coordinates of an affine frame, with their distance from the
/// attractor of the state.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Drawing {
    /// Corner positions in the frame.
    pub vertices: Vec<[f64; 3]>,
    /// Corners that stand alone.
    pub points: Vec<u32>,
    /// Segments.
    pub segments: Vec<[u32; 2]>,
    /// Triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Hausdorff distance between the drawing and the state's attractor, in the frame's unit: a
    /// proven upper bound. Filled in by the attractor's analysis.
    pub defect: f64,
}

/// A kind of cell.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Its name in the model.
    pub name: String,
    /// Its topological kind, when the model states one.
    pub kind: Option<CellKind>,
    /// n, the number of control points, which is the dimension of its barycentric space plus one.
    pub dimension: usize,
    /// How it subdivides; empty only for [`LeafPrimitive::Simplex`].
    pub transitions: Vec<Transition>,
    /// Its boundary cells.
    pub boundaries: Vec<Boundary>,
    /// What stands for a leaf cell.
    pub leaf: LeafPrimitive,
    /// Whether its four control points are an affine frame (o, o+e1, o+e2, o+e3) rather than points
    /// near the shape: then it is bounded by balls, else by the hull of its control points.
    pub frame: bool,
}

impl State {
    /// The state of points, segments or triangles, by the number of their corners: they are what stands for them.
    pub(crate) fn simplex(corners: usize) -> Self {
        let (name, kind) = match corners {
            1 => ("point", CellKind::Vertex),
            2 => ("segment", CellKind::Edge),
            _ => ("triangle", CellKind::Face),
        };
        Self {
            name: name.into(),
            kind: Some(kind),
            dimension: corners,
            transitions: Vec::new(),
            boundaries: Vec::new(),
            leaf: LeafPrimitive::Simplex,
            frame: false,
        }
    }
}

/// What a model claims of the cells of a curve.
#[derive(Clone, Debug, PartialEq, Default)]
pub(crate) struct Smooth {
    /// Parameters of its control points with which it has linear precision: those of a child are an affine image.
    pub(crate) parameters: Vec<f64>,
    /// Points in whose hull its attractor lies, if that is smaller than the control points'.
    pub(crate) hull: Option<Hull>,
}

/// Points H of a state, and for every transition the matrix K without negative entries for which T H' = H K, H' being
/// the child's points: so the hull of H contains those of the children, and with them the attractor.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Hull {
    pub(crate) points: SubdivisionOperator,
    pub(crate) children: Vec<SubdivisionOperator>,
}

/// States and transitions. Invariant: operators fit their states, and every transition and boundary
/// names a state of the automaton.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Automaton {
    states: Vec<State>,
    /// What models claim of their curves; see [`Self::claim_smooth`].
    claims: BTreeMap<StateId, Smooth>,
    /// The factors of every state that is a product; empty for others. See [`Self::claim_products`].
    products: Vec<Vec<StateId>>,
}

/// Why states do not form an automaton.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AutomatonError {
    /// An operator's size does not fit.
    #[error("state '{state}', {what}: the operator is {rows} x {columns}, and must be {expected_rows} x {expected_columns}")]
    Dimension {
        /// The state.
        state: String,
        /// Which transition or boundary.
        what: String,
        /// Rows found.
        rows: usize,
        /// Columns found.
        columns: usize,
        /// n of the state.
        expected_rows: usize,
        /// n of the child or boundary.
        expected_columns: usize,
    },
    /// A state neither subdivides nor is a simplex.
    #[error("state '{state}' has no transition, so it has no attractor")]
    NoTransition {
        /// The state.
        state: String,
    },
}

impl Automaton {
    /// # Errors
    /// [`AutomatonError`] for the first operator that does not fit or the first state without
    /// transition.
    pub fn new(states: Vec<State>) -> Result<Self, AutomatonError> {
        for state in &states {
            let dimension = |to: StateId| states[to.index()].dimension;
            let check = |what: String, to: StateId, operator: &SubdivisionOperator| {
                if operator.rows() == state.dimension && operator.columns() == dimension(to) {
                    return Ok(());
                }
                Err(AutomatonError::Dimension {
                    state: state.name.clone(),
                    what,
                    rows: operator.rows(),
                    columns: operator.columns(),
                    expected_rows: state.dimension,
                    expected_columns: dimension(to),
                })
            };
            if state.transitions.is_empty() && state.leaf != LeafPrimitive::Simplex {
                return Err(AutomatonError::NoTransition { state: state.name.clone() });
            }
            for (index, transition) in state.transitions.iter().enumerate() {
                check(format!("transition {index}"), transition.to, &transition.operator)?;
            }
            for (index, boundary) in state.boundaries.iter().enumerate() {
                check(format!("boundary {index}"), boundary.state, &boundary.incidence)?;
            }
        }
        let products = vec![Vec::new(); states.len()];
        Ok(Self { states, claims: BTreeMap::new(), products })
    }

    /// The state of points, segments or triangles, by the number of their corners.
    pub(crate) fn simplex(&self, corners: usize) -> Option<StateId> {
        let is_it = |state: &State| state.leaf == LeafPrimitive::Simplex && state.dimension == corners;
        self.states.iter().position(is_it).map(StateId::new)
    }

    /// The automaton with such a state, and which that is.
    pub(crate) fn with_simplex(&self, corners: usize) -> (Self, StateId) {
        let mut own = self.clone();
        let state = own.simplex(corners).unwrap_or_else(|| {
            own.states.push(State::simplex(corners));
            own.products.push(Vec::new());
            StateId::new(own.states.len() - 1)
        });
        (own, state)
    }

    /// The states, in order of their ids.
    #[must_use]
    pub fn states(&self) -> &[State] {
        &self.states
    }

    /// One state.
    #[must_use]
    pub fn state(&self, id: StateId) -> &State {
        &self.states[id.index()]
    }

    /// Notes what some curves are like. Claims are verified before use, and save a search.
    pub(crate) fn claim_smooth(&mut self, claims: BTreeMap<StateId, Smooth>) {
        self.claims = claims;
    }

    pub(crate) fn claimed_smooth(&self) -> &BTreeMap<StateId, Smooth> {
        &self.claims
    }

    /// Notes which states are products of others: all their children are products of one child of every factor, in
    /// lexicographic order, through the Kronecker products of the factors' operators. What is proven of the factors then
    /// holds for the product. Claims that do not hold are dropped.
    pub(crate) fn claim_products(&mut self, claims: &BTreeMap<StateId, Vec<StateId>>) {
        let holds: Vec<bool> = (0..self.states.len()).map(|index| self.is_product(StateId::new(index), claims)).collect();
        let holds = self.hereditary(holds);
        // Factors are no products themselves, and nothing else leads to one.
        let stray = self
            .states
            .iter()
            .enumerate()
            .filter(|(index, _)| !holds[*index])
            .any(|(_, state)| state.transitions.iter().any(|transition| holds[transition.to.index()]));
        let nested = claims.iter().filter(|(id, _)| holds[id.index()]).flat_map(|(_, factors)| factors).any(|id| holds[id.index()]);
        if stray || nested {
            return;
        }
        for (id, factors) in claims.iter().filter(|(id, _)| holds[id.index()]) {
            self.products[id.index()].clone_from(factors);
        }
    }

    /// The factors of a state that is a product, as `claim_products` says; none for others.
    #[must_use]
    pub fn factors(&self, id: StateId) -> &[StateId] {
        &self.products[id.index()]
    }

    /// The automaton of these states alone, which lead to no others, without boundaries.
    fn restricted_to(&self, kept: &[StateId]) -> Self {
        let mut place = vec![None; self.states.len()];
        kept.iter().enumerate().for_each(|(position, id)| place[id.index()] = Some(StateId::new(position)));
        let states: Vec<State> = kept
            .iter()
            .map(|&id| {
                let state = self.state(id);
                let follow = |transition: &Transition| Some(Transition { to: place[transition.to.index()]?, ..transition.clone() });
                State { transitions: state.transitions.iter().filter_map(follow).collect(), boundaries: Vec::new(), ..state.clone() }
            })
            .collect();
        let products = vec![Vec::new(); states.len()];
        Self { states, claims: BTreeMap::new(), products }
    }

    fn is_product(&self, id: StateId, claims: &BTreeMap<StateId, Vec<StateId>>) -> bool {
        let Some(factors) = claims.get(&id).filter(|factors| factors.len() > 1) else { return false };
        if factors.iter().any(|factor| factor.index() >= self.states.len()) {
            return false;
        }
        let own = self.state(id);
        let parts: Vec<&State> = factors.iter().map(|&factor| self.state(factor)).collect();
        let children: usize = parts.iter().map(|part| part.transitions.len()).product();
        let dimension: usize = parts.iter().map(|part| part.dimension).product();
        if own.frame
            || parts.iter().any(|part| part.frame)
            || own.dimension != dimension
            || own.transitions.len() != children
            || children == 0
        {
            return false;
        }
        own.transitions.iter().enumerate().all(|(index, transition)| {
            let mut rest = index;
            let mut chosen: Vec<&Transition> = Vec::with_capacity(parts.len());
            for part in parts.iter().rev() {
                chosen.push(&part.transitions[rest % part.transitions.len()]);
                rest /= part.transitions.len();
            }
            chosen.reverse();
            let targets = claims.get(&transition.to);
            targets.is_some_and(|targets| chosen.iter().map(|step| step.to).eq(targets.iter().copied()))
                && transition.operator.factors().iter().eq(chosen.iter().map(|step| &step.operator))
        })
    }

    /// Chooses chords for edges that are proven to be curves, and polygons for faces whose sides close.
    pub(crate) fn connect(&mut self, topology: &topology::Topology) {
        connection::connect(self, topology);
    }

    /// What holds for a state and, as far as they are reached, for all its descendants: states with a child for which
    /// it does not hold are struck out, until none is left.
    pub(crate) fn hereditary(&self, mut holds: Vec<bool>) -> Vec<bool> {
        loop {
            let mut changed = false;
            for (index, state) in self.states.iter().enumerate() {
                if holds[index] && state.transitions.iter().any(|transition| !holds[transition.to.index()]) {
                    holds[index] = false;
                    changed = true;
                }
            }
            if !changed {
                return holds;
            }
        }
    }

    /// Replaces what stands for a leaf cell of a state.
    pub(crate) fn set_leaf(&mut self, id: StateId, leaf: LeafPrimitive) {
        self.states[id.index()].leaf = leaf;
    }
}
