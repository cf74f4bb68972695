//! The subdivision of a state as a cell complex: for every boundary cell of every child, whether it lies on the
//! parent's boundary, is shared with a sibling, or stands alone.

use super::closure::matching;
use super::union::{Conflict, Union};
use super::{Declared, MOST_COMPARED, Place, Topology, TopologyError, View, same};
use crate::automaton::{Automaton, StateId, SubdivisionOperator};

/// Where a cell of a child's closure comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// A vertex of the parent's closure.
    Vertex { cell: usize },
    /// A piece of a cell of the parent's closure, as the parent sees it.
    Piece { cell: usize, piece: usize, view: View },
    /// A cell created by the subdivision, by its position in [`Split::fresh`].
    Fresh { index: usize, view: View },
}

impl Source {
    /// Whether both mean the same cell, however viewed.
    pub(crate) fn is_cell_of(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Vertex { cell: a }, Self::Vertex { cell: b }) => a == b,
            (Self::Piece { cell: a, piece: p, .. }, Self::Piece { cell: b, piece: q, .. }) => (a, p) == (b, q),
            (Self::Fresh { index: a, .. }, Self::Fresh { index: b, .. }) => a == b,
            _ => false,
        }
    }
}

/// A cell that appears in a subdivision: a child, or a cell created inside.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Piece {
    pub(crate) state: StateId,
    /// Its control points in the parent's barycentric space.
    pub(crate) embedding: SubdivisionOperator,
    /// The limit point of a vertex; empty for other kinds.
    pub(crate) point: Vec<f64>,
}

/// See the module's comment.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Split {
    /// For every child, its closure's sources.
    pub(crate) children: Vec<Vec<Source>>,
    /// Sources of the closures of the cells created inside.
    pub(crate) fresh: Vec<Vec<Source>>,
    /// The children, then the cells created inside.
    pub(crate) pieces: Vec<Piece>,
    /// The limit points of the pieces that are vertices; empty for others.
    pub(crate) limits: Vec<Vec<f64>>,
    /// For every fresh cell: the child and the cell of its closure that it was first met as.
    pub(crate) origins: Vec<(usize, usize)>,
    /// For every cell of the parent's closure that is not a vertex: the limit points, in the parent's barycentric
    /// space, of the vertices among its pieces (empty for other pieces), as the parent sees them.
    pub(crate) on_boundary: Vec<Vec<Vec<f64>>>,
}

/// Where a cell was met.
#[derive(Clone, Copy, PartialEq)]
enum Met {
    /// A vertex of the parent's closure.
    Vertex { cell: usize },
    /// A piece of a cell of the parent's closure.
    Piece { cell: usize, piece: usize },
    /// A cell of a child's closure.
    Child { child: usize, cell: usize },
}

struct Builder<'a> {
    id: StateId,
    union: Union<'a>,
    /// For every cell of the union: what it is, and where it was met.
    met: Vec<(Piece, Met)>,
    /// First cell of every closure cell of the parent, and of every child.
    parent: Vec<usize>,
    children: Vec<usize>,
}

impl Topology {
    pub(super) fn build_split(&mut self, automaton: &Automaton, id: StateId, declared: &Declared) -> Result<Split, TopologyError> {
        let union = Union::new(self, automaton);
        let mut builder = Builder { id, union, met: Vec::new(), parent: Vec::new(), children: Vec::new() };
        builder.collect()?;
        builder.declared(declared)?;
        builder.found()?;
        builder.into_split()
    }
}

impl Builder<'_> {
    fn topology(&self) -> &Topology {
        self.union.topology
    }

    fn push(&mut self, piece: Piece, met: Met, cells: Vec<(usize, View)>) {
        self.union.push(piece.state, cells);
        self.met.push((piece, met));
    }

    /// All boundary cells of the subdivision: pieces of the parent's, then the children's.
    fn collect(&mut self) -> Result<(), TopologyError> {
        let own = self.topology().state(self.id).closure.clone();
        for (cell, sub) in own.cells.iter().enumerate() {
            self.parent.push(self.met.len());
            if self.topology().state(sub.state).dimension == 0 {
                let piece = Piece { state: sub.state, embedding: sub.embedding.clone(), point: sub.point.clone() };
                self.push(piece, Met::Vertex { cell }, Vec::new());
                continue;
            }
            for (index, piece) in self.topology().state(sub.state).split.pieces.clone().into_iter().enumerate() {
                let point = if piece.point.is_empty() { Vec::new() } else { sub.embedding.apply(&piece.point) };
                let embedding = sub.embedding.times(&piece.embedding);
                self.push(Piece { state: piece.state, embedding, point }, Met::Piece { cell, piece: index }, Vec::new());
            }
        }
        for index in 0..self.met.len() {
            if let Met::Piece { cell, piece } = self.met[index].1 {
                self.union.list[index].cells = self.cells_of_piece(cell, piece)?;
            }
        }
        for (child, transition) in self.union.automaton.state(self.id).transitions.iter().enumerate() {
            let first = self.met.len();
            self.children.push(first);
            for (cell, sub) in self.topology().state(transition.to).closure.cells.clone().into_iter().enumerate() {
                let point = if sub.point.is_empty() { Vec::new() } else { transition.operator.apply(&sub.point) };
                let piece = Piece { state: sub.state, embedding: transition.operator.times(&sub.embedding), point };
                let cells = sub.cells.iter().map(|&(cell, view)| (first + cell, view)).collect();
                self.push(piece, Met::Child { child, cell }, cells);
            }
        }
        Ok(())
    }

    /// The closure of a piece of the parent's boundary.
    fn cells_of_piece(&mut self, cell: usize, piece: usize) -> Result<Vec<(usize, View)>, TopologyError> {
        let sub = self.topology().state(self.id).closure.cells[cell].clone();
        let split = &self.topology().state(sub.state).split;
        let children = split.children.len();
        let sources = if piece < children { split.children[piece].clone() } else { split.fresh[piece - children].clone() };
        let mut cells = Vec::with_capacity(sources.len());
        for source in sources {
            cells.push(match source {
                Source::Vertex { cell: inner } => (self.parent[sub.cells[inner].0], View::SAME),
                Source::Fresh { index, view } => (self.parent[cell] + children + index, view),
                Source::Piece { cell: inner, piece, view } => {
                    // The boundary cell sees its own boundary cell viewed: find the piece that is meant.
                    let (place, seen) = sub.cells[inner];
                    let state = self.topology().state(self.id).closure.cells[place].state;
                    let (actual, turned) = self.topology().piece_seen(state, seen, piece);
                    let piece_state = self.topology().state(state).split.pieces[actual].state;
                    (self.parent[place] + actual, self.union.compose(piece_state, turned, view)?)
                }
            });
        }
        Ok(cells)
    }

    /// Boundary m of child i, and how it is viewed.
    fn boundary_of_child(&self, (child, boundary): Place) -> Option<(usize, View)> {
        let transition = self.union.automaton.state(self.id).transitions.get(child)?;
        let &(cell, view) = self.topology().state(transition.to).closure.boundaries.get(boundary)?;
        Some((self.children[child] + cell, view))
    }

    fn unite(&mut self, left: (usize, View), right: (usize, View)) -> Result<(), TopologyError> {
        self.union.unite(left, right).map_err(|conflict| match conflict {
            Conflict::Topology(error) => error,
            Conflict::Twisted(cell) => {
                let child = if let Met::Child { child, .. } = self.met[cell].1 { child } else { 0 };
                TopologyError::Twisted { state: self.union.automaton.state(self.id).name.clone(), child }
            }
        })
    }

    fn declared(&mut self, declared: &Declared) -> Result<(), TopologyError> {
        for (boundary, places) in &declared.incidences {
            let Some(&(cell, view)) = self.topology().state(self.id).closure.boundaries.get(*boundary) else { continue };
            let state = self.topology().state(self.id).closure.cells[cell].state;
            let vertex = self.topology().state(state).dimension == 0;
            let pieces = if vertex { 1 } else { self.topology().state(state).split.children.len() };
            for (position, &place) in places.iter().enumerate().take(pieces) {
                let Some(seen) = self.boundary_of_child(place) else { continue };
                let (piece, turned) = if vertex { (0, View::SAME) } else { self.topology().piece_seen(state, view, position) };
                self.unite((self.parent[cell] + piece, turned), seen)?;
            }
        }
        for shared in &declared.adjacencies {
            let [first, second] = shared.between.map(|place| self.boundary_of_child(place));
            let (Some(first), Some(second)) = (first, second) else { continue };
            let state = self.met[first.0].0.state;
            // first[j] = second[permutation[j]]: the first is the second viewed by the permutation.
            let turn = match &shared.permutation {
                Some(order) => self.union.topology.intern(self.union.automaton, state, order.clone())?,
                None => View::SAME,
            };
            let turned = self.union.compose(state, second.1, turn)?;
            self.unite(first, (second.0, turned))?;
        }
        Ok(())
    }

    /// Unites cells whose embeddings are equal, in this or another order of control points.
    fn found(&mut self) -> Result<(), TopologyError> {
        if self.met.len() > MOST_COMPARED {
            return Ok(());
        }
        for right in 0..self.met.len() {
            for left in 0..right {
                if self.met[left].0.state != self.met[right].0.state || self.union.find(left)?.0 == self.union.find(right)?.0 {
                    continue;
                }
                let (a, b) = (&self.met[left].0, &self.met[right].0);
                if !a.point.is_empty() {
                    if same(&a.point, &b.point) {
                        self.unite((left, View::SAME), (right, View::SAME))?;
                    }
                } else if let Some(order) = matching(&b.embedding, &a.embedding, None) {
                    // right[c] = left[order[c]]. Where the boundary does not subdivide alike, they are two cells.
                    let state = a.state;
                    if let Ok(view) = self.union.topology.intern(self.union.automaton, state, order) {
                        self.unite((left, view), (right, View::SAME))?;
                    }
                }
            }
        }
        Ok(())
    }

    fn source(&mut self, fresh: &[usize], cell: usize, view: View) -> Result<Source, TopologyError> {
        let (top, own) = self.union.find(cell)?;
        let view = self.union.compose(self.met[top].0.state, own, view)?;
        Ok(match self.met[top].1 {
            Met::Vertex { cell } => Source::Vertex { cell },
            Met::Piece { cell, piece } => Source::Piece { cell, piece, view },
            Met::Child { .. } => {
                let index = fresh.binary_search(&top).expect("every first sighting in a child is listed");
                Source::Fresh { index, view }
            }
        })
    }

    fn into_split(mut self) -> Result<Split, TopologyError> {
        let mut fresh = Vec::new();
        for cell in 0..self.met.len() {
            if matches!(self.met[cell].1, Met::Child { .. }) && self.union.find(cell)?.0 == cell {
                fresh.push(cell);
            }
        }
        let mut split = Split::default();
        for (child, transition) in self.union.automaton.state(self.id).transitions.iter().enumerate() {
            let count = self.topology().state(transition.to).closure.cells.len();
            let first = self.children[child];
            let sources = (first..first + count).map(|cell| self.source(&fresh, cell, View::SAME)).collect::<Result<_, _>>()?;
            split.children.push(sources);
            split.pieces.push(Piece { state: transition.to, embedding: transition.operator.clone(), point: Vec::new() });
        }
        for &cell in &fresh {
            if let Met::Child { child, cell } = self.met[cell].1 {
                split.origins.push((child, cell));
            }
            let inner = self.union.list[cell].cells.clone();
            let sources = inner.into_iter().map(|(cell, view)| self.source(&fresh, cell, view)).collect::<Result<_, _>>()?;
            split.fresh.push(sources);
            split.pieces.push(self.met[cell].0.clone());
        }
        split.limits = split.pieces.iter().map(|piece| piece.point.clone()).collect();
        split.on_boundary = vec![Vec::new(); self.parent.len()];
        for (piece, met) in &self.met {
            if let Met::Piece { cell, .. } = met {
                split.on_boundary[*cell].push(piece.point.clone());
            }
        }
        Ok(split)
    }
}
