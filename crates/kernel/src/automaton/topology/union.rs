//! Cells that turn out to be one: union-find whose links carry views, closed under taking boundaries.

use super::{Topology, TopologyError, View};
use crate::automaton::{Automaton, StateId};
use std::collections::VecDeque;

/// A cell met somewhere.
pub(crate) struct Met {
    /// Its kind.
    pub(crate) state: StateId,
    /// The cells of its closure, as cells of the same list.
    pub(crate) cells: Vec<(usize, View)>,
    /// This cell is `link.0` viewed by `link.1`.
    link: (usize, View),
}

/// The cells met so far.
pub(crate) struct Union<'a> {
    pub(crate) topology: &'a mut Topology,
    pub(crate) automaton: &'a Automaton,
    pub(crate) list: Vec<Met>,
}

/// Two sightings that should be of one cell would turn it onto itself.
pub(crate) enum Conflict {
    /// The cell, by its position.
    Twisted(usize),
    /// A view that is no symmetry.
    Topology(TopologyError),
}

impl From<TopologyError> for Conflict {
    fn from(error: TopologyError) -> Self {
        Self::Topology(error)
    }
}

impl<'a> Union<'a> {
    pub(crate) fn new(topology: &'a mut Topology, automaton: &'a Automaton) -> Self {
        Self { topology, automaton, list: Vec::new() }
    }

    /// Adds a cell whose closure is known by position.
    pub(crate) fn push(&mut self, state: StateId, cells: Vec<(usize, View)>) -> usize {
        let index = self.list.len();
        self.list.push(Met { state, cells, link: (index, View::SAME) });
        index
    }

    /// A cell viewed by `first`, and what is seen viewed by `second`.
    pub(crate) fn compose(&mut self, state: StateId, first: View, second: View) -> Result<View, TopologyError> {
        self.topology.compose(self.automaton, state, first, second)
    }

    /// The first sighting of a cell, and how this one views it.
    pub(crate) fn find(&mut self, met: usize) -> Result<(usize, View), TopologyError> {
        let (up, view) = self.list[met].link;
        if up == met {
            return Ok((met, View::SAME));
        }
        let (top, above) = self.find(up)?;
        let whole = self.compose(self.list[met].state, above, view)?;
        self.list[met].link = (top, whole);
        Ok((top, whole))
    }

    /// Makes `left.0` viewed by `left.1` and `right.0` viewed by `right.1` one, and their boundary cells with them.
    /// Cells of different kinds stay apart.
    pub(crate) fn unite(&mut self, left: (usize, View), right: (usize, View)) -> Result<(), Conflict> {
        let mut queue = VecDeque::from([(left, right)]);
        while let Some((left, right)) = queue.pop_front() {
            let state = self.list[left.0].state;
            if self.list[right.0].state != state {
                continue;
            }
            let (a, b) = (self.find(left.0)?, self.find(right.0)?);
            // a.0 viewed by a.1, then by left.1, is b.0 viewed by b.1, then by right.1.
            let a_view = self.compose(state, a.1, left.1)?;
            let b_view = self.compose(state, b.1, right.1)?;
            if a.0 == b.0 {
                if a_view != b_view {
                    return Err(Conflict::Twisted(left.0.max(right.0)));
                }
                continue;
            }
            // The earlier sighting leads.
            let (top, top_view, low, low_view) = if a.0 < b.0 { (a.0, a_view, b.0, b_view) } else { (b.0, b_view, a.0, a_view) };
            let back = self.topology.inverse(self.automaton, state, low_view)?;
            self.list[low].link = (top, self.compose(state, top_view, back)?);
            for position in 0..self.topology.state(state).closure.cells.len() {
                queue.push_back((self.seen(left, position)?, self.seen(right, position)?));
            }
        }
        Ok(())
    }

    /// What a viewed cell shows at a position of its closure.
    fn seen(&mut self, (met, view): (usize, View), position: usize) -> Result<(usize, View), TopologyError> {
        let (cell, turned) = self.topology.cell_seen(self.list[met].state, view, position);
        let (inner, own) = self.list[met].cells[cell];
        Ok((inner, self.compose(self.list[inner].state, own, turned)?))
    }
}
