//! Trunk and shards as one complex: numbers for all, and one set of pieces for every edge that several shards split.

use super::address::Origin;
use super::shard::{Grown, Store};
use super::{Edge, NONE, Side};
use crate::automaton::topology::Topology;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// Where the numbers of the trunk and of every shard begin.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Numbers(Vec<u32>);

impl Numbers {
    pub(super) fn new(counts: impl Iterator<Item = usize>) -> Self {
        let mut sum = 0;
        Self(
            std::iter::once(0)
                .chain(counts.map(|count| {
                    sum += count as u32;
                    sum
                }))
                .collect(),
        )
    }

    /// The part (the trunk is 0, shard k is k + 1) that a number belongs to, and the place in it.
    #[inline]
    pub(super) fn find(&self, id: u32) -> (usize, usize) {
        let part = if id < self.0[1] { 0 } else { self.0.partition_point(|&start| start <= id) - 1 };
        (part, (id - self.0[part]) as usize)
    }

    /// How many there are.
    pub(super) fn count(&self) -> u32 {
        self.0.last().copied().unwrap_or(0)
    }

    /// The first number of a part.
    #[inline]
    pub(super) fn start(&self, part: usize) -> u32 {
        self.0[part]
    }

    /// Number of those in the trunk.
    #[inline]
    fn base(&self) -> u32 {
        self.0[1]
    }

    /// The number of what a part calls `id`: the trunk's, or its own after these.
    #[inline]
    fn shift(&self, part: usize, id: u32) -> u32 {
        if id < self.base() { id } else { id - self.base() + self.0[part] }
    }
}

/// Origins of a part's vertices and edges, and its nodes.
type Provenance = (Vec<Origin>, Vec<Origin>, Vec<(u32, u32)>);

/// Trunk and shards with common numbers.
pub(super) struct Merged<'a> {
    pub(super) topology: &'a Arc<Topology>,
    /// The trunk's, then every shard's.
    pub(super) stores: Vec<Store>,
    /// What else the shards made; their stores are moved out.
    pub(super) shards: Vec<Grown>,
    pub(super) vertices: Numbers,
    pub(super) edges: Numbers,
    pub(super) nodes: Numbers,
    /// For every part, the number of each of its own vertices.
    vertex_ids: Vec<Vec<u32>>,
    /// For every part, its edges that turned out to be others'. Looked up only.
    dropped: Vec<HashMap<u32, u32>>,
    /// Edges whose pieces are in another part: which, and where.
    adopted: HashMap<u32, (usize, u32)>,
}

impl<'a> Merged<'a> {
    pub(super) fn new(topology: &'a Arc<Topology>, trunk: Store, mut shards: Vec<Grown>) -> Self {
        let mut stores = vec![trunk];
        stores.extend(shards.iter_mut().map(|shard| std::mem::take(&mut shard.own)));
        let vertices = Numbers::new(stores.iter().map(|store| store.vertices.len()));
        let edges = Numbers::new(stores.iter().map(|store| store.edges.len()));
        let nodes = Numbers::new(stores.iter().map(|store| store.nodes.len()));
        let own = |part: usize| (vertices.start(part)..vertices.start(part + 1)).collect();
        let vertex_ids = (0..stores.len()).into_par_iter().map(own).collect();
        let dropped = vec![HashMap::new(); stores.len()];
        let mut merged = Self { topology, stores, shards, vertices, edges, nodes, vertex_ids, dropped, adopted: HashMap::new() };
        for shard in 0..merged.shards.len() {
            for (edge, start) in std::mem::take(&mut merged.shards[shard].split_here) {
                merged.unite(shard + 1, edge, start);
            }
        }
        merged.renumber_origins();
        merged
    }

    /// Edge `id` was split by a part, into the pieces listed from `start` on: they become its pieces, or are those that
    /// it has. Positions of vertices are those of the first part.
    fn unite(&mut self, part: usize, id: u32, start: u32) {
        if self.pieces_of(id).is_none() {
            self.adopted.insert(id, (part, start));
            return;
        }
        let Edge { state, collapsed, .. } = *self.edge(id);
        let split = &self.topology.state(state).split;
        for index in 0..split.pieces.len() {
            let local = self.stores[part].pieces[start as usize + index];
            if index >= split.children.len() {
                // The pieces of a single point are its vertex, which is the trunk's.
                if !collapsed && local >= self.vertices.base() {
                    let vertex = self.piece(id, index);
                    self.vertex_ids[part][(local - self.vertices.base()) as usize] = vertex;
                }
                continue;
            }
            let piece = self.piece(id, index);
            self.dropped[part].insert(local, piece);
            let further = self.stores[part].edges[(local - self.edges.base()) as usize].pieces;
            if further != NONE {
                self.unite(part, piece, further);
            }
        }
    }

    /// The number of an edge of a part.
    #[inline]
    pub(super) fn edge_id(&self, part: usize, local: u32) -> u32 {
        let base = self.edges.base();
        if part > 0
            && local >= base
            && self.stores[part].edges[(local - base) as usize].shared
            && let Some(&other) = self.dropped[part].get(&local)
        {
            return other;
        }
        self.edges.shift(part, local)
    }

    /// The number of a vertex of a part.
    #[inline]
    pub(super) fn vertex_id(&self, part: usize, local: u32) -> u32 {
        let base = self.vertices.base();
        if part == 0 || local < base { local } else { self.vertex_ids[part][(local - base) as usize] }
    }

    /// The number of a node of a part.
    pub(super) fn node(&self, part: usize, local: u32) -> u32 {
        self.nodes.shift(part, local)
    }

    pub(super) fn edge(&self, id: u32) -> &Edge {
        let (part, index) = self.edges.find(id);
        &self.stores[part].edges[index]
    }

    /// The part and the place of an edge's pieces.
    fn pieces_of(&self, id: u32) -> Option<(usize, u32)> {
        let (part, index) = self.edges.find(id);
        let edge = &self.stores[part].edges[index];
        if edge.pieces != NONE {
            return Some((part, edge.pieces));
        }
        if part == 0 || edge.shared { self.adopted.get(&id).copied() } else { None }
    }

    /// The number of a piece of an edge that has pieces.
    fn piece(&self, id: u32, index: usize) -> u32 {
        let Some((part, start)) = self.pieces_of(id) else { return NONE };
        let local = self.stores[part].pieces[start as usize + index];
        if index < self.topology.state(self.edge(id).state).split.children.len() {
            self.edge_id(part, local)
        } else {
            self.vertex_id(part, local)
        }
    }

    /// The vertices of an edge, by its state's closure.
    pub(super) fn vertices_of(&self, id: u32) -> impl Iterator<Item = u32> {
        let (part, index) = self.edges.find(id);
        let store = &self.stores[part];
        let edge = &store.edges[index];
        let count = self.topology.state(edge.state).closure.cells.len();
        store.edge_vertices[edge.vertices as usize..edge.vertices as usize + count].iter().map(move |&local| self.vertex_id(part, local))
    }

    /// Start and end of an edge.
    pub(super) fn ends(&self, side: Side) -> [u32; 2] {
        let (part, index) = self.edges.find(side.edge() as u32);
        self.ends_in(part, index, side.backwards())
    }

    #[inline]
    fn ends_in(&self, part: usize, index: usize, backwards: bool) -> [u32; 2] {
        let store = &self.stores[part];
        let edge = &store.edges[index];
        let [start, end] = self.topology.ends(edge.state).unwrap_or([0, 0]);
        let vertex = |position: usize| self.vertex_id(part, store.edge_vertices[edge.vertices as usize + position]);
        if backwards { [vertex(end), vertex(start)] } else { [vertex(start), vertex(end)] }
    }

    /// The leaf edges of a side as a part knows it, each with the vertex where it starts; see [`Self::leaf_edges`].
    pub(super) fn leaf_edges_in(&self, part: usize, side: Side, out: &mut impl FnMut(Side, u32)) {
        let (local, base) = (side.edge() as u32, self.edges.base());
        if part == 0 || local < base || self.stores[part].edges[(local - base) as usize].shared {
            return self.leaf_edges(Side::new(self.edge_id(part, local), side.backwards()), out);
        }
        // Nobody else knows the edge.
        let index = (local - base) as usize;
        let edge = &self.stores[part].edges[index];
        if edge.collapsed {
            return;
        }
        if edge.pieces == NONE {
            let id = Side::new(self.edges.start(part) + index as u32, side.backwards());
            return out(id, self.ends_in(part, index, side.backwards())[0]);
        }
        let pieces = &self.stores[part].pieces[edge.pieces as usize..];
        self.in_order(edge, side, &mut |child, backwards| self.leaf_edges_in(part, Side::new(pieces[child], backwards), out));
    }

    /// The leaf edges of an edge that is no single point: in order from its start to its end when it is a curve.
    pub(super) fn leaf_edges(&self, side: Side, out: &mut impl FnMut(Side, u32)) {
        let id = side.edge() as u32;
        let edge = *self.edge(id);
        if edge.collapsed {
            return;
        }
        if self.pieces_of(id).is_none() {
            return out(side, self.ends(side)[0]);
        }
        self.in_order(&edge, side, &mut |child, backwards| self.leaf_edges(Side::new(self.piece(id, child), backwards), out));
    }

    /// The children of an edge along it, and whether each is walked backwards.
    fn in_order(&self, edge: &Edge, side: Side, visit: &mut dyn FnMut(usize, bool)) {
        let topology = self.topology.state(edge.state);
        let mut child = |(child, turned): (usize, bool)| visit(child, turned != side.backwards());
        match &topology.chain {
            Some(chain) if side.backwards() => chain.iter().rev().for_each(|&link| child(link)),
            Some(chain) => chain.iter().for_each(|&link| child(link)),
            None => (0..topology.split.children.len()).for_each(|index| child((index, false))),
        }
    }

    /// Makes all numbers in origins and nodes the common ones.
    fn renumber_origins(&mut self) {
        let mut stores = std::mem::take(&mut self.stores);
        let taken: Vec<_> = stores
            .iter_mut()
            .map(|store| {
                (std::mem::take(&mut store.vertex_origins), std::mem::take(&mut store.edge_origins), std::mem::take(&mut store.nodes))
            })
            .collect();
        self.stores = stores;
        let renumber = |(part, (mut vertices, mut edges, mut nodes)): (usize, Provenance)| {
            for origin in vertices.iter_mut().chain(&mut edges) {
                match origin {
                    Origin::Face { node, .. } | Origin::Middle { node } => *node = self.nodes.shift(part, *node),
                    Origin::Edge { edge, .. } => *edge = self.edge_id(part, *edge),
                    Origin::Root { .. } => {}
                }
            }
            for (parent, _) in nodes.iter_mut().filter(|(parent, _)| *parent != NONE) {
                *parent = self.nodes.shift(part, *parent);
            }
            (vertices, edges, nodes)
        };
        let renumbered: Vec<_> = taken.into_par_iter().enumerate().map(renumber).collect();
        for (store, (vertices, edges, nodes)) in self.stores.iter_mut().zip(renumbered) {
            (store.vertex_origins, store.edge_origins, store.nodes) = (vertices, edges, nodes);
        }
    }
}
