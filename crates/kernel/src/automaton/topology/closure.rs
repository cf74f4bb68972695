//! The closure of a state: its boundary cells, their boundaries and so on, each once.

use super::{StateTopology, Topology, TopologyError, View, same};
use crate::automaton::{Automaton, StateId, SubdivisionOperator};

/// All cells on the boundary of a state.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Closure {
    /// The cells.
    pub(crate) cells: Vec<SubCell>,
    /// For every declared boundary: which cell it is, and how it is viewed.
    pub(crate) boundaries: Vec<(usize, View)>,
}

/// A cell of a closure.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SubCell {
    pub(crate) state: StateId,
    /// How it is reached: boundary m, boundary p of that, and so on.
    pub(crate) path: Vec<usize>,
    /// Its control points in the state's barycentric space, n x n of the cell.
    pub(crate) embedding: SubdivisionOperator,
    /// The limit point of a vertex; empty for other kinds.
    pub(crate) point: Vec<f64>,
    /// The cells of its own closure, as cells of this one.
    pub(crate) cells: Vec<(usize, View)>,
}

impl Topology {
    pub(super) fn build_closure(&mut self, automaton: &Automaton, id: StateId) -> Result<Closure, TopologyError> {
        let mut closure = Closure::default();
        for (index, boundary) in automaton.state(id).boundaries.iter().enumerate() {
            let place = self.add_to(automaton, &mut closure, boundary.state, &boundary.incidence, vec![index])?;
            closure.boundaries.push(place);
        }
        Ok(closure)
    }

    /// The cell of a closure that has this state and embedding: a known one, perhaps viewed in another order, or a
    /// new one.
    fn add_to(
        &mut self,
        automaton: &Automaton,
        closure: &mut Closure,
        state: StateId,
        embedding: &SubdivisionOperator,
        path: Vec<usize>,
    ) -> Result<(usize, View), TopologyError> {
        let StateTopology { dimension, limit, .. } = self.state(state);
        let point = if *dimension == 0 { embedding.apply(limit) } else { Vec::new() };
        for (index, known) in closure.cells.iter().enumerate().filter(|(_, known)| known.state == state) {
            if *dimension == 0 {
                if same(&known.point, &point) {
                    return Ok((index, View::SAME));
                }
            } else if let Some(order) = matching(embedding, &known.embedding, None) {
                return Ok((index, self.intern(automaton, state, order)?));
            }
        }
        let index = closure.cells.len();
        closure.cells.push(SubCell { state, path: path.clone(), embedding: embedding.clone(), point, cells: Vec::new() });
        for cell in self.state(state).closure.cells.clone() {
            let inner = [path.as_slice(), &cell.path].concat();
            let place = self.add_to(automaton, closure, cell.state, &embedding.times(&cell.embedding), inner)?;
            closure.cells[index].cells.push(place);
        }
        Ok((index, View::SAME))
    }
}

/// The order in which the columns of `known` are those of `seen`: `seen[k, c] = known[rows[k], order[c]]`, with
/// `rows` the identity when absent.
pub(super) fn matching(seen: &SubdivisionOperator, known: &SubdivisionOperator, rows: Option<&[usize]>) -> Option<Vec<usize>> {
    if seen.columns() != known.columns() || seen.rows() != known.rows() {
        return None;
    }
    let mut used = vec![false; known.columns()];
    let mut order = Vec::with_capacity(seen.columns());
    let mut wanted = vec![0.0; seen.rows()];
    for column in 0..seen.columns() {
        for (row, &entry) in seen.column(column).iter().enumerate() {
            wanted[rows.map_or(row, |rows| rows[row])] = entry;
        }
        // The same position first: equal columns keep their order.
        let candidates = std::iter::once(column).chain((0..known.columns()).filter(|&other| other != column));
        let found = candidates.into_iter().find(|&other| !used[other] && same(known.column(other), &wanted))?;
        used[found] = true;
        order.push(found);
    }
    Some(order)
}
