//! Boundary controlled iterated function systems, stated in full.

use super::join::Borders;
use super::lower::Draft;
use super::solve::{GLUE_ALLOWED, SolveError, permutation_of};
use crate::attractor::{Gluing, Root};
use crate::automaton::topology::{Declared, Shared};
use crate::automaton::{Boundary, LeafPrimitive, OperatorError, State, StateId, SubdivisionOperator, Transition};
use crate::budget::CancelToken;
use glam::DVec4;
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

/// Topological kind of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CellKind {
    /// Dimension 0.
    Vertex,
    /// Dimension 1.
    Edge,
    /// Dimension 2.
    Face,
    /// Dimension 3.
    Volume,
}

/// One entry of a matrix.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A given number.
    Number(f64),
    /// To be solved (`null` in a document).
    Unknown,
    /// The value of one of the model's parameters.
    Parameter(String),
}

/// A matrix as an array of rows.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Matrix {
    /// The rows, all of one length in a legal document.
    pub rows: Vec<Vec<Entry>>,
}

/// A transition of a state: the child's state and the operator whose columns are the child's
/// control points in the parent's barycentric space.
#[derive(Clone, Debug, PartialEq)]
pub struct TransitionSpec {
    /// Name of the child's state.
    pub to: String,
    /// T, of size n x n_child.
    pub operator: Matrix,
}

/// A boundary of a state: its state and its embedding.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundarySpec {
    /// Name of the boundary's state.
    pub state: String,
    /// b, of size n x n_boundary.
    pub incidence: Matrix,
}

/// A kind of cell.
#[derive(Clone, Debug, PartialEq)]
pub struct BcifsState {
    /// Its name, unique in the model.
    pub name: String,
    /// Its topological kind.
    pub cell: CellKind,
    /// n, the number of control points.
    pub dimension: usize,
    /// How it subdivides.
    pub transitions: Vec<TransitionSpec>,
    /// Its boundary cells, in order.
    pub boundaries: Vec<BoundarySpec>,
}

/// The j-th child of boundary `boundary` is boundary m of child i, (i, m) = `children[j]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Incidence {
    /// Name of the state.
    pub state: String,
    /// Index of the boundary.
    pub boundary: usize,
    /// Pairs (child, boundary of that child).
    pub children: Vec<(usize, usize)>,
}

/// Two children share a boundary. Without `reversed` or `permutation` the control points agree in order.
#[derive(Clone, Debug, PartialEq)]
pub struct Adjacency {
    /// Name of the state.
    pub state: String,
    /// Pairs (child, boundary of that child).
    pub between: [(usize, usize); 2],
    /// Whether the second is seen from its other end.
    pub reversed: bool,
    /// Control point j of the first boundary is control point `permutation[j]` of the second; `reversed` is the
    /// permutation that reverses the order, and not both may be given.
    pub permutation: Option<Vec<usize>>,
}

/// One side of a [`Relation`]: T_i T_j ... b_m b_p ..., the nested boundary of a descendant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Side {
    /// Word i j ... of transitions from the relation's state.
    pub path: Vec<usize>,
    /// Word m p ... of boundaries from the descendant.
    pub boundary: Vec<usize>,
}

/// Two products of operators and embeddings are equal: constraints over several levels, delays, coherence
/// of nested boundaries.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Relation {
    /// Name of the state where both sides begin.
    pub state: String,
    /// The two sides, which end in states of one dimension.
    pub equal: [Side; 2],
}

/// A root cell: its state and its control points (x, y, z, w), w = 1 unless rational.
#[derive(Clone, Debug, PartialEq)]
pub struct RootCell {
    /// Name of the state.
    pub state: String,
    /// Points in mm with their weight: (x, y, z, w), not yet multiplied by w; `None` is to be placed.
    pub control_points: Vec<Option<DVec4>>,
}

/// Two boundaries of root cells that are one.
#[derive(Clone, Debug, PartialEq)]
pub struct Glue {
    /// Pairs (root cell, boundary of its state).
    pub between: [(usize, usize); 2],
    /// Whether the second is seen from its other end.
    pub reversed: bool,
    /// Control point j of the first boundary is control point `permutation[j]` of the second; `reversed` is the
    /// permutation that reverses the order, and not both may be given.
    pub permutation: Option<Vec<usize>>,
}

/// A BC-IFS with its control points.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Bcifs {
    /// The kinds of cells.
    pub states: Vec<BcifsState>,
    /// Incidence constraints.
    pub incidences: Vec<Incidence>,
    /// Adjacency constraints.
    pub adjacencies: Vec<Adjacency>,
    /// Longer constraints.
    pub relations: Vec<Relation>,
    /// The root cells.
    pub cells: Vec<RootCell>,
    /// Root boundaries that are one.
    pub glue: Vec<Glue>,
    /// Named values used as entries, in the document's order.
    pub parameters: Vec<(String, f64)>,
}

/// Constraints may be violated by this much in barycentric coordinates: operators printed with few digits
/// leave 1e-6.
pub(super) const RESIDUAL_ALLOWED: f64 = 1e-4;

impl Bcifs {
    pub(super) fn lower(&self, draft: &mut Draft) {
        if self.states.is_empty() {
            return draft.error("/states", "automaton.empty", "the model has no state".into());
        }
        if self.cells.is_empty() {
            return draft.error("/cells", "automaton.empty", "the model has no root cell".into());
        }
        if self.has_unknowns() {
            // What is filled in has no unknown, so this happens once.
            if let Some(filled) = self.determined(draft) {
                filled.lower(draft);
            }
            return;
        }
        let reader = Reader { model: self, offset: draft.states.len(), reachable: self.reachable(), index: self.index() };
        let errors_before = draft.findings.iter().filter(|finding| !finding.warning).count();
        let states: Vec<State> = (0..self.states.len()).map(|index| reader.state(index, draft)).collect();
        let first_root = draft.roots.len();
        reader.roots(draft);
        draft.borders = Borders::Cells { first: first_root, count: draft.roots.len() - first_root };
        if draft.findings.iter().filter(|finding| !finding.warning).count() == errors_before {
            reader.constraints(&states, draft);
            reader.seams(&states, first_root, draft);
        }
        draft.declared.resize(draft.states.len(), Declared::default());
        draft.declared.extend(reader.declared());
        reader.glue(&states, draft);
        for (index, state) in states.into_iter().enumerate() {
            draft.state_from(state, &format!("/states/{index}/transitions"));
        }
    }

    /// Whether something that matters is to be solved.
    fn has_unknowns(&self) -> bool {
        let unknown = |matrix: &Matrix| matrix.rows.iter().flatten().any(|entry| *entry == Entry::Unknown);
        let of = |state: &BcifsState| {
            state.transitions.iter().any(|t| unknown(&t.operator)) || state.boundaries.iter().any(|b| unknown(&b.incidence))
        };
        self.cells.iter().any(|cell| cell.control_points.contains(&None))
            || self.states.iter().zip(self.reachable()).any(|(state, reached)| reached && of(state))
    }

    /// The model with its unknowns filled in, if the constraints leave one way and the declared parameters are kept.
    fn determined(&self, draft: &mut Draft) -> Option<Self> {
        let values: BTreeMap<String, f64> = self.used_parameters().into_iter().collect();
        let solution = match self.solve(&values, &CancelToken::new()) {
            Ok(solution) => solution,
            Err(SolveError::Invalid(findings)) => {
                findings.into_iter().for_each(|finding| draft.error(&finding.pointer, finding.code, finding.message));
                return None;
            }
            Err(error) => {
                let place = match &error {
                    SolveError::Contradiction { constraints } => constraints.first().map_or("", |constraint| &constraint.pointer),
                    _ => "/states",
                };
                draft.error(place, error.code(), error.to_string());
                return None;
            }
        };
        let ignored: Vec<String> =
            self.reachable().iter().enumerate().filter(|(_, reached)| !**reached).map(|(s, _)| format!("/states/{s}/")).collect();
        let free: Vec<_> = solution
            .parameters
            .iter()
            .filter(|parameter| !parameter.declared && !ignored.iter().any(|place| parameter.pointer.starts_with(place)))
            .collect();
        let Some(first) = free.first() else { return Some(solution.model) };
        let names = free.iter().take(8).map(|parameter| parameter.name.as_str()).collect::<Vec<_>>().join(", ");
        let more = if free.len() > 8 { ", ..." } else { "" };
        let message = format!(
            "the constraints leave {} degrees of freedom: {names}{more}. Give these entries values, or let `lacuna solve` choose them",
            free.len()
        );
        draft.error(&first.pointer, "automaton.underdetermined", message);
        None
    }

    /// Declared parameters that entries name.
    fn used_parameters(&self) -> Vec<(String, f64)> {
        let matrices = self.states.iter().flat_map(|state| {
            state.transitions.iter().map(|t| &t.operator).chain(state.boundaries.iter().map(|boundary| &boundary.incidence))
        });
        let used: BTreeSet<&str> = matrices
            .flat_map(|matrix| matrix.rows.iter().flatten())
            .filter_map(|entry| if let Entry::Parameter(name) = entry { Some(name.as_str()) } else { None })
            .collect();
        self.parameters.iter().filter(|(name, _)| used.contains(name.as_str())).cloned().collect()
    }

    pub(super) fn index(&self) -> BTreeMap<&str, usize> {
        self.states.iter().enumerate().map(|(index, state)| (state.name.as_str(), index)).collect()
    }

    /// States that a root cell reaches by transitions and boundaries.
    pub(super) fn reachable(&self) -> Vec<bool> {
        let index = self.index();
        let mut reached = vec![false; self.states.len()];
        let mut stack: Vec<usize> = self.cells.iter().filter_map(|cell| index.get(cell.state.as_str()).copied()).collect();
        while let Some(current) = stack.pop() {
            if !std::mem::replace(&mut reached[current], true) {
                let state = &self.states[current];
                let names = state.transitions.iter().map(|t| &t.to).chain(state.boundaries.iter().map(|b| &b.state));
                stack.extend(names.filter_map(|name| index.get(name.as_str()).copied()));
            }
        }
        reached
    }
}

struct Reader<'a> {
    model: &'a Bcifs,
    offset: usize,
    reachable: Vec<bool>,
    index: BTreeMap<&'a str, usize>,
}

impl Reader<'_> {
    /// What is wrong in a state that nothing reaches is a warning.
    fn fault(&self, draft: &mut Draft, state: usize, pointer: &str, code: &'static str, message: String) {
        if self.reachable[state] { draft.error(pointer, code, message) } else { draft.warn(pointer, code, message) }
    }

    fn state(&self, index: usize, draft: &mut Draft) -> State {
        let spec = &self.model.states[index];
        let place = format!("/states/{index}");
        if !self.reachable[index] {
            draft.warn(&place, "automaton.unreachable-state", format!("no root cell reaches state '{}'; it is ignored", spec.name));
        }
        // One control point is its own attractor; anything else needs to subdivide.
        let terminal = spec.transitions.is_empty() && spec.dimension == 1;
        if spec.transitions.is_empty() && !terminal {
            let message =
                format!("state '{}' has {} control points and no transition, so its attractor is empty", spec.name, spec.dimension);
            self.fault(draft, index, &place, "automaton.empty", message);
        }
        let mut transitions = Vec::new();
        for (label, transition) in spec.transitions.iter().enumerate() {
            let place = format!("{place}/transitions/{label}");
            if let Some((to, operator)) = self.link(index, &transition.to, &transition.operator, &place, "operator", draft) {
                transitions.push(Transition { to, operator, label });
            }
        }
        let mut boundaries = Vec::new();
        for (label, boundary) in spec.boundaries.iter().enumerate() {
            let place = format!("{place}/boundaries/{label}");
            if let Some((state, incidence)) = self.link(index, &boundary.state, &boundary.incidence, &place, "incidence", draft) {
                boundaries.push(Boundary { state, incidence });
            }
        }
        let unusable = !self.reachable[index];
        State {
            name: spec.name.clone(),
            kind: Some(spec.cell),
            // A state that is ignored must not break the automaton: it becomes a point.
            dimension: if unusable { 1 } else { spec.dimension },
            transitions: if unusable { Vec::new() } else { transitions },
            boundaries: if unusable { Vec::new() } else { boundaries },
            leaf: if unusable || terminal { LeafPrimitive::Simplex } else { LeafPrimitive::Centre },
            frame: false,
        }
    }

    fn link(
        &self,
        state: usize,
        to: &str,
        matrix: &Matrix,
        place: &str,
        member: &str,
        draft: &mut Draft,
    ) -> Option<(StateId, SubdivisionOperator)> {
        let Some(target) = self.index.get(to).copied() else {
            self.fault(draft, state, place, "automaton.unknown-state", format!("state '{to}' does not exist"));
            return None;
        };
        let place = format!("{place}/{member}");
        let (rows, columns) = (self.model.states[state].dimension, self.model.states[target].dimension);
        let found = matrix.rows.first().map_or(0, Vec::len);
        if matrix.rows.len() != rows || matrix.rows.iter().any(|row| row.len() != columns) {
            let message = format!(
                "the matrix is {} x {found}, and must be {rows} x {columns}: state '{}' has {rows} control points, '{to}' has {columns}",
                matrix.rows.len(),
                self.model.states[state].name
            );
            self.fault(draft, state, &place, "automaton.dimension-mismatch", message);
            return None;
        }
        let mut entries = vec![0.0; rows * columns];
        for (i, row) in matrix.rows.iter().enumerate() {
            for (j, entry) in row.iter().enumerate() {
                entries[j * rows + i] = match self.value(entry) {
                    Ok(value) => value,
                    Err((code, message)) => {
                        self.fault(draft, state, &format!("{place}/{i}/{j}"), code, message);
                        return None;
                    }
                };
            }
        }
        match SubdivisionOperator::from_columns(rows, entries) {
            Ok((operator, corrected)) => {
                if corrected > 0.0 {
                    let message =
                        format!("column sums were off 1 by up to {corrected:.1e}, as in exports with few digits; they were corrected");
                    draft.warn(&place, "automaton.column-sum-corrected", message);
                }
                Some((StateId::new(self.offset + target), operator))
            }
            Err(error) => {
                let code = match error {
                    OperatorError::ColumnSum { .. } => "automaton.column-sum",
                    OperatorError::NotFinite { .. } => "model.not-finite",
                };
                self.fault(draft, state, &place, code, error.to_string());
                None
            }
        }
    }

    fn value(&self, entry: &Entry) -> Result<f64, (&'static str, String)> {
        match entry {
            Entry::Number(value) => Ok(*value),
            Entry::Unknown => Err(("automaton.unknown-entry", "the entry is unknown (null); give it a value".into())),
            Entry::Parameter(name) => {
                let found = self.model.parameters.iter().find(|(known, _)| known == name);
                found.map(|(_, value)| *value).ok_or_else(|| ("automaton.unknown-parameter", format!("parameter '{name}' does not exist")))
            }
        }
    }

    fn roots(&self, draft: &mut Draft) {
        for (index, cell) in self.model.cells.iter().enumerate() {
            let place = format!("/cells/{index}");
            let Some(state) = self.index.get(cell.state.as_str()).copied() else {
                draft.error(&format!("{place}/state"), "automaton.unknown-state", format!("state '{}' does not exist", cell.state));
                continue;
            };
            let (found, wanted) = (cell.control_points.len(), self.model.states[state].dimension);
            if found != wanted {
                let message = format!("{found} control points, and state '{}' has {wanted}", cell.state);
                draft.error(&format!("{place}/control_points"), "automaton.dimension-mismatch", message);
                continue;
            }
            // Unknown points are solved before, so none is left here.
            let control_points: Vec<DVec4> = cell.control_points.iter().copied().flatten().collect();
            for (k, point) in
                control_points.iter().enumerate().filter(|(_, point)| !point.is_finite() || !super::WEIGHTS.contains(&point.w))
            {
                let message = format!("control point {k} is {point}: coordinates must be finite and the weight positive");
                draft.error(&format!("{place}/control_points/{k}"), "model.not-finite", message);
            }
            let rational = control_points.iter().any(|point| point.w != control_points[0].w);
            let homogeneous = |p: &glam::DVec4| {
                let w = if rational { p.w } else { 1.0 };
                [w * p.x, w * p.y, w * p.z, w]
            };
            let points = control_points.iter().map(homogeneous).collect();
            draft.roots.push(Root { state: StateId::new(self.offset + state), points, rational, solid: None });
        }
    }

    /// Whether the state of that name exists and nothing reaches it.
    fn ignores(&self, state: &str) -> bool {
        self.index.get(state).is_some_and(|&index| !self.reachable[index])
    }

    /// What the model says of every state's subdivision.
    fn declared(&self) -> Vec<Declared> {
        let mut declared = vec![Declared::default(); self.model.states.len()];
        for incidence in &self.model.incidences {
            if let Some(&state) = self.index.get(incidence.state.as_str()) {
                declared[state].incidences.push((incidence.boundary, incidence.children.clone()));
            }
        }
        for adjacency in &self.model.adjacencies {
            if let Some(&state) = self.index.get(adjacency.state.as_str()) {
                let permutation = self.order(state, adjacency);
                declared[state].adjacencies.push(Shared { between: adjacency.between, permutation });
            }
        }
        declared
    }

    /// Control point j of the first boundary is control point `order[j]` of the second; `None` for the same order (or where
    /// the constraint does not fit, which its check reports).
    fn order(&self, state: usize, adjacency: &Adjacency) -> Option<Vec<usize>> {
        let (child, boundary) = adjacency.between[0];
        let target = *self.index.get(self.model.states[state].transitions.get(child)?.to.as_str())?;
        self.order_of(target, boundary, adjacency.reversed, adjacency.permutation.as_deref())
    }

    fn order_of(&self, state: usize, boundary: usize, reversed: bool, permutation: Option<&[usize]>) -> Option<Vec<usize>> {
        let edge = *self.index.get(self.model.states[state].boundaries.get(boundary)?.state.as_str())?;
        permutation_of(reversed, permutation, self.model.states[edge].dimension).ok().flatten()
    }

    /// Which boundaries of root cells are one.
    fn glue(&self, states: &[State], draft: &mut Draft) {
        let first = draft.roots.len() - self.model.cells.len().min(draft.roots.len());
        for glue in &self.model.glue {
            let root = |(cell, _): (usize, usize)| self.model.cells.get(cell).and_then(|cell| self.index.get(cell.state.as_str()));
            let permutation = root(glue.between[0])
                .and_then(|&state| self.order_of(state, glue.between[0].1, glue.reversed, glue.permutation.as_deref()));
            let between = glue.between.map(|(cell, boundary)| (first + cell, boundary));
            let side = |(cell, boundary): (usize, usize)| {
                let root: &Root = draft.roots.get(cell)?;
                let state = states.get(root.state.index() - self.offset)?;
                let incidence = &state.boundaries.get(boundary)?.incidence;
                Some((0..incidence.columns()).map(|column| placed(root, incidence.column(column))).collect::<Vec<_>>())
            };
            if let (Some(left), Some(right)) = (side(between[0]), side(between[1])) {
                let matched = |(j, point): (usize, &glam::DVec3)| {
                    let other = permutation.as_ref().map_or(j, |order| order[j]);
                    right.get(other).map_or(f64::INFINITY, |other| point.distance(*other))
                };
                let apart = left.iter().enumerate().map(matched).fold(0.0, f64::max);
                draft.seam_mm = draft.seam_mm.max(apart);
            }
            draft.gluings.push(Gluing { between, permutation });
        }
    }

    /// Checks the stated incidences, adjacencies and relations; the residual is the largest difference of entries.
    fn constraints(&self, states: &[State], draft: &mut Draft) {
        for (index, incidence) in self.model.incidences.iter().enumerate().filter(|(_, incidence)| !self.ignores(&incidence.state)) {
            let place = format!("/incidences/{index}");
            let sides = self.incidence(incidence, states);
            self.judge(draft, &place, "automaton.incidence-mismatch", sides);
        }
        for (index, adjacency) in self.model.adjacencies.iter().enumerate().filter(|(_, adjacency)| !self.ignores(&adjacency.state)) {
            let place = format!("/adjacencies/{index}");
            let sides = self.adjacency(adjacency, states);
            self.judge(draft, &place, "automaton.adjacency-mismatch", sides);
        }
        for (index, relation) in self.model.relations.iter().enumerate().filter(|(_, relation)| !self.ignores(&relation.state)) {
            let sides = self.relation(relation, states);
            self.judge(draft, &format!("/relations/{index}"), "automaton.relation-mismatch", sides);
        }
    }

    /// The product along a side, column after column, and the state where it ends.
    fn product<'s>(&self, states: &'s [State], state: &'s State, side: &Side) -> Result<(Columns, &'s State), String> {
        let mut factors = Vec::new();
        let mut current = state;
        for &child in &side.path {
            let found = current.transitions.get(child).ok_or_else(|| format!("state '{}' has no child {child}", current.name))?;
            factors.push(&found.operator);
            current = self.local(states, found.to);
        }
        for &boundary in &side.boundary {
            let found = current.boundaries.get(boundary).ok_or_else(|| format!("state '{}' has no boundary {boundary}", current.name))?;
            factors.push(&found.incidence);
            current = self.local(states, found.state);
        }
        let (last, rest) = factors.split_last().ok_or("a side names neither a child nor a boundary")?;
        let image = |j| rest.iter().rev().fold(last.column(j).to_vec(), |column, factor| factor.apply(&column));
        Ok(((0..last.columns()).map(image).collect(), current))
    }

    fn relation(&self, relation: &Relation, states: &[State]) -> Result<Vec<(String, Columns, Columns)>, String> {
        let state = self.find(states, &relation.state)?;
        let [(left, _), (right, _)] = [self.product(states, state, &relation.equal[0])?, self.product(states, state, &relation.equal[1])?];
        let [first, second] = &relation.equal;
        let words = |side: &Side| format!("(child {:?}, boundary {:?})", side.path, side.boundary);
        Ok(vec![(format!("{} and {} of state '{}'", words(first), words(second), state.name), left, right)])
    }

    /// Checks that glued boundaries have the same control points: P_a b_m = P_b b_n, homogeneous.
    fn seams(&self, states: &[State], first_root: usize, draft: &mut Draft) {
        let size = extent(&draft.roots[first_root..]);
        for (index, glue) in self.model.glue.iter().enumerate() {
            let place = format!("/glue/{index}");
            let [(c, m), (d, n)] = glue.between;
            let words = format!("boundary {m} of root cell {c} and boundary {n} of root cell {d}");
            let roots = &draft.roots[first_root..];
            let sides = self.glued(states, roots, (c, m)).and_then(|(left, first)| {
                let (right, second) = self.glued(states, roots, (d, n))?;
                if first.name != second.name {
                    return Err(format!("{words} are of different states, '{}' and '{}'", first.name, second.name));
                }
                let permutation = permutation_of(glue.reversed, glue.permutation.as_deref(), left.len())?;
                Ok((left, permuted(right, permutation)))
            });
            let (left, right) = match sides {
                Ok(sides) => sides,
                Err(message) => {
                    draft.error(&place, "automaton.glue-mismatch", message);
                    continue;
                }
            };
            let residual = left.iter().flatten().zip(right.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            draft.constraint_residual = draft.constraint_residual.max(residual / size);
            let allowed = GLUE_ALLOWED * size;
            // Written so that a residual that is not a number is refused.
            if !matches!(residual.partial_cmp(&allowed), Some(Ordering::Less | Ordering::Equal)) {
                let message = format!("{words} are {residual:.3e} mm apart, and may be {allowed:.1e} mm apart (1e-6 of the model's size)");
                draft.error(&place, "automaton.glue-mismatch", message);
            }
        }
    }

    /// P b and the boundary's state.
    fn glued<'s>(&self, states: &'s [State], roots: &[Root], (cell, boundary): (usize, usize)) -> Result<(Columns, &'s State), String> {
        let root = roots.get(cell).ok_or_else(|| format!("there is no root cell {cell}"))?;
        let state = self.local(states, root.state);
        let found = state.boundaries.get(boundary).ok_or_else(|| format!("state '{}' has no boundary {boundary}", state.name))?;
        let point = |j: usize| -> Vec<f64> {
            let weights = found.incidence.column(j);
            (0..4).map(|axis| weights.iter().zip(&root.points).map(|(weight, point)| weight * point[axis]).sum()).collect()
        };
        Ok(((0..found.incidence.columns()).map(point).collect(), self.local(states, found.state)))
    }

    fn judge(&self, draft: &mut Draft, place: &str, code: &'static str, sides: Result<Vec<(String, Columns, Columns)>, String>) {
        match sides {
            Err(message) => draft.error(place, code, message),
            Ok(sides) => {
                for (paths, left, right) in sides {
                    if left.len() != right.len() || left.iter().zip(&right).any(|(a, b)| a.len() != b.len()) {
                        draft.error(place, code, format!("{paths}: the two sides have different sizes"));
                        continue;
                    }
                    let residual = left.iter().flatten().zip(right.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    draft.constraint_residual = draft.constraint_residual.max(residual);
                    if residual > RESIDUAL_ALLOWED {
                        let message = format!(
                            "{paths} differ by {residual:.3e}, and may differ by {RESIDUAL_ALLOWED:.0e}; correct the operators there, or write null for entries that solve is to find"
                        );
                        draft.error(place, code, message);
                    }
                }
            }
        }
    }

    fn local<'s>(&self, states: &'s [State], id: StateId) -> &'s State {
        &states[id.index() - self.offset]
    }

    fn child_boundary(&self, states: &[State], state: &State, (child, boundary): (usize, usize)) -> Result<(Columns, StateId), String> {
        let transition = state.transitions.get(child).ok_or_else(|| format!("state '{}' has no child {child}", state.name))?;
        let target = self.local(states, transition.to);
        let missing = || format!("state '{}' has no boundary {boundary}", target.name);
        let inner = target.boundaries.get(boundary).ok_or_else(missing)?;
        let columns = (0..inner.incidence.columns()).map(|j| transition.operator.apply(inner.incidence.column(j))).collect();
        Ok((columns, inner.state))
    }

    fn find<'s>(&self, states: &'s [State], name: &str) -> Result<&'s State, String> {
        self.index.get(name).map(|&index| &states[index]).ok_or_else(|| format!("state '{name}' does not exist"))
    }

    /// b_k T^bd_j = T_i b_m for every j, `(i, m) = children[j]`.
    fn incidence(&self, incidence: &Incidence, states: &[State]) -> Result<Vec<(String, Columns, Columns)>, String> {
        let state = self.find(states, &incidence.state)?;
        let missing = || format!("state '{}' has no boundary {}", state.name, incidence.boundary);
        let boundary = state.boundaries.get(incidence.boundary).ok_or_else(missing)?;
        let edge = self.local(states, boundary.state);
        if edge.transitions.len() != incidence.children.len() {
            return Err(format!(
                "{} children are listed, and state '{}' has {}",
                incidence.children.len(),
                edge.name,
                edge.transitions.len()
            ));
        }
        let mut sides = Vec::new();
        for (j, (transition, &(i, m))) in edge.transitions.iter().zip(&incidence.children).enumerate() {
            let left = (0..transition.operator.columns()).map(|c| boundary.incidence.apply(transition.operator.column(c))).collect();
            let (right, inner) = self.child_boundary(states, state, (i, m))?;
            if inner != transition.to {
                return Err(format!("child {j} of boundary {} and boundary {m} of child {i} are of different states", incidence.boundary));
            }
            let paths = format!("child {j} of boundary {} and boundary {m} of child {i} of state '{}'", incidence.boundary, state.name);
            sides.push((paths, left, right));
        }
        Ok(sides)
    }

    /// T_i b_m = T_j b_m2, the second side's control points in the stated order.
    fn adjacency(&self, adjacency: &Adjacency, states: &[State]) -> Result<Vec<(String, Columns, Columns)>, String> {
        let state = self.find(states, &adjacency.state)?;
        let [first, second] = adjacency.between;
        let (left, left_state) = self.child_boundary(states, state, first)?;
        let (right, right_state) = self.child_boundary(states, state, second)?;
        if left_state != right_state {
            return Err(format!(
                "boundary {} of child {} and boundary {} of child {} are of different states",
                first.1, first.0, second.1, second.0
            ));
        }
        let right = permuted(right, permutation_of(adjacency.reversed, adjacency.permutation.as_deref(), left.len())?);
        let paths =
            format!("boundary {} of child {} and boundary {} of child {} of state '{}'", first.1, first.0, second.1, second.0, state.name);
        Ok(vec![(paths, left, right)])
    }
}

/// Column j becomes column `permutation[j]`.
fn permuted(columns: Columns, permutation: Option<Vec<usize>>) -> Columns {
    match permutation {
        None => columns,
        Some(permutation) => permutation.into_iter().map(|j| columns[j].clone()).collect(),
    }
}

/// The largest extent of the control points, 1 if there is none.
pub(super) fn extent(roots: &[Root]) -> f64 {
    let range = |axis: usize| {
        let values = roots.iter().flat_map(|root| root.points.iter().map(move |point| point[axis] / point[3]));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        high - low
    };
    let size = (0..3).map(range).fold(0.0, f64::max);
    if size > 0.0 && size.is_finite() { size } else { 1.0 }
}

/// The point of space with these barycentric coordinates in a root.
fn placed(root: &Root, weights: &[f64]) -> glam::DVec3 {
    let sum = root.points.iter().zip(weights).map(|(point, &weight)| weight * DVec4::from_array(*point)).sum::<DVec4>();
    sum.truncate() / sum.w
}

/// The columns of a product of operators.
type Columns = Vec<Vec<f64>>;
