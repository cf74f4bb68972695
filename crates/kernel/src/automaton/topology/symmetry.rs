//! Cells seen with their control points in another order.

use super::closure::matching;
use super::{Topology, TopologyError, same};
use crate::automaton::{Automaton, StateId, SubdivisionOperator};

/// A way to look at a cell of a state: control point j as seen is control point `permutation[j]` of the cell.
/// [`View::SAME`] is the cell itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct View(u32);

impl View {
    /// The cell itself.
    pub const SAME: Self = Self(0);

    /// Its position among the views of its state.
    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }
}

/// A view of a state under which it subdivides like itself. Every list says what is seen at a position: which one
/// of the cell itself, and how viewed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Symmetry {
    permutation: Vec<usize>,
    /// Of the closure's cells.
    pub(crate) cells: Vec<(usize, View)>,
    /// Of the split's pieces: children, then fresh cells.
    pub(crate) pieces: Vec<(usize, View)>,
}

/// A face of k sides has 2k views; more than this are a mistake.
const MOST_VIEWS: usize = 256;

impl Topology {
    /// The view of a state with this permutation, checked to be a symmetry of its subdivision.
    pub(super) fn intern(&mut self, automaton: &Automaton, id: StateId, permutation: Vec<usize>) -> Result<View, TopologyError> {
        // A vertex is a point, from wherever it is seen.
        if self.state(id).dimension == 0 || permutation.iter().enumerate().all(|(j, &p)| j == p) {
            return Ok(View::SAME);
        }
        if self.states[id.index()].symmetries.is_empty() {
            self.states[id.index()].symmetries.push(Symmetry { permutation: Vec::new(), cells: Vec::new(), pieces: Vec::new() });
        }
        if let Some(index) = self.state(id).symmetries.iter().position(|symmetry| symmetry.permutation == permutation) {
            return Ok(View(index as u32));
        }
        let asymmetric = || TopologyError::Asymmetric { state: automaton.state(id).name.clone(), permutation: permutation.clone() };
        if self.state(id).refused.contains(&permutation) {
            return Err(asymmetric());
        }
        // Views lean on each other: if one of them fails, all that were met on the way are forgotten.
        let before: Vec<usize> = self.states.iter().map(|state| state.symmetries.len()).collect();
        match self.examine(automaton, id, &permutation) {
            Ok(Some(view)) => Ok(view),
            failure => {
                self.states.iter_mut().zip(before).for_each(|(state, count)| state.symmetries.truncate(count));
                self.states[id.index()].refused.push(permutation.clone());
                failure.and_then(|_| Err(asymmetric()))
            }
        }
    }

    /// Enters a new view, and checks that the state's closure and pieces are the same seen by it.
    fn examine(&mut self, automaton: &Automaton, id: StateId, permutation: &[usize]) -> Result<Option<View>, TopologyError> {
        let view = View(self.state(id).symmetries.len() as u32);
        if view.index() > MOST_VIEWS {
            return Ok(None);
        }
        self.states[id.index()].symmetries.push(Symmetry { permutation: permutation.to_vec(), cells: Vec::new(), pieces: Vec::new() });
        let closure: Vec<Item> = self.state(id).closure.cells.iter().map(|c| (c.state, c.embedding.clone(), c.point.clone())).collect();
        let pieces: Vec<Item> = self.state(id).split.pieces.iter().map(|p| (p.state, p.embedding.clone(), p.point.clone())).collect();
        let Some(cells) = self.permuted(automaton, &closure, permutation)? else { return Ok(None) };
        let Some(pieces) = self.permuted(automaton, &pieces, permutation)? else { return Ok(None) };
        let own = &mut self.states[id.index()].symmetries[view.index()];
        (own.cells, own.pieces) = (cells, pieces);
        Ok(Some(view))
    }

    /// For every item as seen in the given order of rows: which item it is, and how viewed.
    fn permuted(&mut self, automaton: &Automaton, items: &[Item], rows: &[usize]) -> Result<Option<Vec<(usize, View)>>, TopologyError> {
        let mut used = vec![false; items.len()];
        let mut result = Vec::with_capacity(items.len());
        for (state, embedding, point) in items {
            let mut seen_point = vec![0.0; point.len()];
            point.iter().zip(rows).for_each(|(&x, &row)| seen_point[row] = x);
            let mut found = None;
            for (index, (other_state, other_embedding, other_point)) in items.iter().enumerate() {
                if used[index] || other_state != state {
                    continue;
                }
                if point.is_empty() {
                    if let Some(order) = matching(embedding, other_embedding, Some(rows)) {
                        found = Some((index, self.intern(automaton, *state, order)?));
                        break;
                    }
                } else if same(other_point, &seen_point) {
                    found = Some((index, View::SAME));
                    break;
                }
            }
            let Some((index, view)) = found else { return Ok(None) };
            used[index] = true;
            result.push((index, view));
        }
        Ok(Some(result))
    }

    fn permutation(&self, id: StateId, view: View) -> Option<&[usize]> {
        (view != View::SAME).then(|| self.state(id).symmetries[view.index()].permutation.as_slice())
    }

    /// A cell viewed by `first`, and what is seen viewed by `second`.
    pub(super) fn compose(&mut self, automaton: &Automaton, id: StateId, first: View, second: View) -> Result<View, TopologyError> {
        match (self.permutation(id, first), self.permutation(id, second)) {
            (None, _) => Ok(second),
            (_, None) => Ok(first),
            (Some(a), Some(b)) => {
                let order = b.iter().map(|&j| a[j]).collect();
                self.intern(automaton, id, order)
            }
        }
    }

    /// The view that undoes another.
    pub(super) fn inverse(&mut self, automaton: &Automaton, id: StateId, view: View) -> Result<View, TopologyError> {
        let Some(permutation) = self.permutation(id, view) else { return Ok(View::SAME) };
        let mut order = vec![0; permutation.len()];
        permutation.iter().enumerate().for_each(|(j, &p)| order[p] = j);
        self.intern(automaton, id, order)
    }

    /// Closes the views of every state under products and tabulates them, so that [`Self::product`] needs no
    /// change. To be called when all views are known.
    ///
    /// # Errors
    /// [`TopologyError::Asymmetric`] when the views do not close to a small group.
    pub(crate) fn tabulate(&mut self, automaton: &Automaton) -> Result<(), TopologyError> {
        // A product of views of one state may bring views of another.
        for _ in 0..MOST_VIEWS {
            let before: usize = self.states.iter().map(|state| state.symmetries.len()).sum();
            for index in 0..self.states.len() {
                let id = StateId::new(index);
                let count = self.states[index].symmetries.len();
                let mut products = vec![vec![View::SAME; count]; count];
                for (a, row) in products.iter_mut().enumerate() {
                    for (b, product) in row.iter_mut().enumerate() {
                        *product = self.compose(automaton, id, View(a as u32), View(b as u32))?;
                    }
                }
                self.states[index].products = products;
            }
            if self.states.iter().map(|state| state.symmetries.len()).sum::<usize>() == before {
                break;
            }
        }
        Ok(())
    }

    /// A cell viewed by `first`, and what is seen viewed by `second`; after [`Self::tabulate`].
    pub(crate) fn product(&self, id: StateId, first: View, second: View) -> View {
        match (first, second) {
            (View::SAME, other) | (other, View::SAME) => other,
            _ => self.state(id).products[first.index()][second.index()],
        }
    }

    /// Which cell of its closure a viewed cell shows at a position.
    pub(crate) fn cell_seen(&self, id: StateId, view: View, cell: usize) -> (usize, View) {
        if view == View::SAME { (cell, View::SAME) } else { self.state(id).symmetries[view.index()].cells[cell] }
    }

    /// Which piece of its split a viewed cell shows at a position.
    pub(crate) fn piece_seen(&self, id: StateId, view: View, piece: usize) -> (usize, View) {
        if view == View::SAME { (piece, View::SAME) } else { self.state(id).symmetries[view.index()].pieces[piece] }
    }
}

/// State, embedding and, for vertices, limit point.
type Item = (StateId, SubdivisionOperator, Vec<f64>);
