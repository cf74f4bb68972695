//! Evaluation of cells that have a B-rep: one cell complex, whose edges and vertices exist once.
//!
//! Neighbouring faces share their edge *cell*. When either of them subdivides, the edge subdivides, once, and
//! its new vertex is computed once; a neighbour that stays coarse finds the finer edge in its outline. So an
//! adaptive refinement has no cracks and no T-junctions by construction, and no positions are ever compared.
//!
//! In parallel: a *trunk* of few cells is refined first, then *shards* of its leaves, each by itself (`shard`). Shards
//! that split the same edge of the trunk have each its pieces; these are made one, in the order of the shards (`merge`),
//! which do not depend on the number of threads. What is drawn is worked out shard by shard too, but for what touches the
//! trunk's edges (`draw`).

mod address;
mod draw;
mod merge;
mod normals;
mod shard;
mod step;
mod tally;

pub use address::{CellAddress, CellComplex, Step};

use super::cell::Point;
use super::{Attractor, RefineError, TangentPlanes};
use crate::automaton::topology::{Conflict, Topology, TopologyError, Union, View};
use crate::automaton::{Automaton, LeafPrimitive, StateId};
use crate::budget::Budget;
use crate::tessellation::Tessellation;
use crate::tolerance::Tolerance;
pub(super) use draw::fill;
use merge::Merged;
use rayon::prelude::*;
use shard::{Context, Shard, Store};
use step::Steps;

/// Boundaries of two root cells that are one.
#[derive(Clone, Debug, PartialEq)]
pub struct Gluing {
    /// Pairs (root cell, boundary of its state).
    pub between: [(usize, usize); 2],
    /// Control point j of the first is control point `permutation[j]` of the second; `None`: the same order.
    pub permutation: Option<Vec<usize>>,
}

/// No index.
pub(super) const NONE: u32 = u32::MAX;

/// An edge or vertex of the complex, as a face sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Seen {
    id: u32,
    view: View,
}

#[derive(Clone, Copy, Debug)]
struct Edge {
    state: StateId,
    /// Where its vertices begin, in the order of its state's closure.
    vertices: u32,
    /// Where its pieces begin: children (edges), then fresh vertices. [`NONE`] while it is whole.
    pieces: u32,
    /// Whether it is a single point in space, and all its vertices one: then it is no side of a face.
    collapsed: bool,
    /// Whether it is a piece of an edge of the trunk, which several shards may see.
    shared: bool,
}

/// An edge walked along, forwards or backwards.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Side(u32);

impl Side {
    fn new(edge: u32, backwards: bool) -> Self {
        Self(edge << 1 | u32::from(backwards))
    }

    fn edge(self) -> usize {
        (self.0 >> 1) as usize
    }

    fn backwards(self) -> bool {
        self.0 & 1 == 1
    }
}

/// A face of the final complex.
#[derive(Clone, Copy, Debug)]
struct Face {
    node: u32,
    /// Where its sides begin.
    outline: u32,
    middle: Point,
    /// Where the normals of its corners begin, and that of its middle follows.
    normals: u32,
}

/// Where the complex begins, worked out once: the cells of every root's closure, glued.
#[derive(Clone, Debug, Default)]
pub(crate) struct Start {
    /// For every root: its closure's cells, as indices into `cells`; empty for roots without B-rep.
    roots: Vec<Vec<Seen>>,
    /// The first root and closure cell that show each cell.
    cells: Vec<(usize, usize)>,
    /// Of every cell, whether it is an edge that is a single point in space.
    collapsed: Vec<bool>,
    /// For every state, whether its cells are drawn as part of the complex.
    drawn: Vec<bool>,
}

impl Start {
    /// Whether cells of a state are drawn as part of the complex.
    pub(super) fn is_drawn(&self, state: StateId) -> bool {
        self.drawn[state.index()]
    }

    /// How many cells the roots' boundaries are.
    pub(crate) fn count(&self) -> usize {
        self.cells.len()
    }

    /// Which cell of the complex a root shows at a position of its closure, and how it views it.
    pub(crate) fn cell_of(&self, root: usize, cell: usize) -> (u32, View) {
        let seen = self.roots[root][cell];
        (seen.id, seen.view)
    }

    /// Whether a cell is an edge that is a single point in space.
    pub(crate) fn is_collapsed(&self, cell: u32) -> bool {
        self.collapsed[cell as usize]
    }

    /// Glues roots along the given boundaries, makes the ends of collapsed edges one, and tabulates the topology's views.
    pub(super) fn new(
        topology: &mut Topology,
        automaton: &Automaton,
        roots: &[super::Root],
        gluings: &[Gluing],
        collapsed: &[(usize, usize)],
    ) -> Result<Self, TopologyError> {
        let mut union = Union::new(topology, automaton);
        let mut first = Vec::with_capacity(roots.len());
        let mut places = Vec::new();
        for (index, root) in roots.iter().enumerate() {
            let start = union.list.len();
            first.push(start);
            for (cell, sub) in union.topology.state(root.state).closure.cells.clone().into_iter().enumerate() {
                union.push(sub.state, sub.cells.iter().map(|&(inner, view)| (start + inner, view)).collect());
                places.push((index, cell));
            }
        }
        for gluing in gluings {
            let sides = gluing.between.map(|(root, boundary)| {
                let state = roots.get(root)?.state;
                let &(cell, view) = union.topology.state(state).closure.boundaries.get(boundary)?;
                Some((first[root] + cell, view))
            });
            let [Some(left), Some(right)] = sides else { continue };
            let state = union.list[left.0].state;
            let turn = match &gluing.permutation {
                Some(order) => union.topology.view(automaton, state, order)?,
                None => View::SAME,
            };
            let turned = union.compose(state, right.1, turn)?;
            union.unite(left, (right.0, turned)).map_err(|conflict| match conflict {
                Conflict::Topology(error) => error,
                Conflict::Twisted(cell) => {
                    let (root, _) = places[cell];
                    TopologyError::Twisted { state: automaton.state(roots[root].state).name.clone(), child: root }
                }
            })?;
        }
        let mut points = Vec::new();
        for &(root, boundary) in collapsed {
            let Some(&(cell, _)) = union.topology.state(roots[root].state).closure.boundaries.get(boundary) else { continue };
            let edge = first[root] + cell;
            points.push(edge);
            // All vertices are of the state of single points, which has one view.
            let ends: Vec<usize> = union.list[edge].cells.iter().map(|&(end, _)| end).collect();
            for pair in ends.windows(2) {
                let united = union.unite((pair[0], View::SAME), (pair[1], View::SAME));
                debug_assert!(united.is_ok(), "single points are never twisted");
            }
        }
        let mut whole = Self::default();
        let mut index = vec![NONE; union.list.len()];
        let mut next = 0;
        for (root, &start) in first.iter().enumerate() {
            let count = union.topology.state(roots[root].state).closure.cells.len();
            let mut seen = Vec::with_capacity(count);
            for cell in start..start + count {
                let (top, view) = union.find(cell)?;
                if top == cell {
                    index[cell] = next;
                    next += 1;
                    whole.cells.push(places[cell]);
                }
                seen.push(Seen { id: index[top], view });
            }
            whole.roots.push(seen);
        }
        whole.collapsed = vec![false; whole.cells.len()];
        for edge in points {
            let (top, _) = union.find(edge)?;
            whole.collapsed[index[top] as usize] = true;
        }
        topology.tabulate(automaton)?;
        whole.drawn = drawn(topology, automaton);
        Ok(whole)
    }
}

/// Leaves of the trunk that are aimed at: enough for any number of threads.
const TRUNK_LEAVES: usize = 64;
/// Shards at most.
const MOST_SHARDS: usize = 128;

/// Refines the given roots, which have a B-rep, into one complex.
pub(super) fn refine(
    attractor: &Attractor,
    roots: &[usize],
    tangents: Option<&TangentPlanes>,
    tolerance: Tolerance,
    budget: &Budget,
) -> Result<Tessellation, RefineError> {
    let Some((topology, start)) = attractor.brep.as_ref().filter(|_| !roots.is_empty()) else { return Ok(Tessellation::default()) };
    // What gluing took for equal is part of the error.
    let share = (tolerance.mm() - attractor.seam_mm).max(0.0);
    let steps = Steps::new(attractor.automaton());
    let context = Context::new(attractor, topology, &steps, tangents, budget, share);
    let nothing = Store::default();
    let mut trunk = Shard::new(&context, &nothing);
    trunk.plant(start, roots, frontier(attractor, roots))?;
    let (pending, trunk) = trunk.into_trunk();
    let chunk = pending.len().div_ceil(MOST_SHARDS).max(1);
    let grow = |pending: &[shard::Pending]| {
        let mut shard = Shard::new(&context, &trunk);
        shard.grow(pending)?;
        Ok::<_, RefineError>(shard.finish())
    };
    let shards: Vec<_> = pending.par_chunks(chunk).map(grow).collect();
    let shards = shards.into_iter().collect::<Result<Vec<_>, _>>()?;
    context.check()?;
    let mut tessellation = Merged::new(topology, trunk, shards).draw(attractor, tangents);
    tessellation.deviation_mm += attractor.seam_mm;
    Ok(tessellation)
}

/// The depth at which cells are left to the shards. It depends on the model alone.
fn frontier(attractor: &Attractor, roots: &[usize]) -> u32 {
    let children = |&root: &usize| attractor.automaton().state(attractor.roots()[root].state).transitions.len();
    let most = roots.iter().map(children).max().unwrap_or(0).max(2);
    let (mut depth, mut cells) = (0, roots.len());
    while cells < TRUNK_LEAVES {
        (depth, cells) = (depth + 1, cells * most);
    }
    depth
}

impl Attractor {
    /// Whether a root's cells are drawn as one complex: curves between two vertices, wires that branch, or a
    /// face that its edges surround, and so all its descendants.
    #[must_use]
    pub fn has_brep(&self, root: usize) -> bool {
        self.brep.as_ref().is_some_and(|(_, start)| start.drawn[self.roots[root].state.index()])
    }
}

/// For every state, whether cells of it and of all its descendants are drawn; see [`Attractor::has_brep`].
fn drawn(topology: &Topology, automaton: &Automaton) -> Vec<bool> {
    let alone = automaton.states().iter().enumerate().map(|(index, state)| {
        let own = topology.state(StateId::new(index));
        match own.dimension {
            1 => own.chain.is_some() || matches!(state.leaf, LeafPrimitive::Star(_)),
            2 => own.outline.is_some(),
            _ => false,
        }
    });
    automaton.hereditary(alone.collect())
}
