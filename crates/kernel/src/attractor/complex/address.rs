//! Where every vertex, edge and face of an evaluation comes from.

use super::merge::Numbers;
use super::tally::count_complex;
use crate::attractor::Attractor;
use crate::automaton::StateId;
use crate::automaton::topology::Topology;
use std::fmt;
use std::sync::Arc;

/// One step from a cell to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Step {
    /// To child i.
    Child(usize),
    /// To boundary m.
    Boundary(usize),
}

/// How a cell is reached from a root. Text: the root, a colon, children as numbers and boundaries as `/m`:
/// `0: 2 1 /3 0 /1` is boundary 1 of child 0 of boundary 3 of the root's descendant 2 1.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CellAddress {
    /// The root.
    pub root: usize,
    /// The way.
    pub steps: Vec<Step>,
}

impl fmt::Display for CellAddress {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:", self.root)?;
        for step in &self.steps {
            match step {
                Step::Child(index) => write!(formatter, " {index}")?,
                Step::Boundary(index) => write!(formatter, " /{index}")?,
            }
        }
        Ok(())
    }
}

/// Where a cell was made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Origin {
    /// A cell of a root's closure, or the root itself.
    Root { root: u32, cell: u32 },
    /// Inside a face: which fresh cell of its split.
    Face { node: u32, piece: u32 },
    /// Inside an edge: which piece of its split.
    Edge { edge: u32, piece: u32 },
    /// Inside a face, or on the rim that trimming gives it.
    Middle { node: u32 },
}

/// What one part of the evaluation made: its nodes (the parent, or `NONE`, and the child or root) and where its edges come
/// from.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Part {
    pub(super) nodes: Vec<(u32, u32)>,
    pub(super) edges: Vec<Origin>,
}

/// The cell complex behind a tessellation: counts, and the address of every vertex, edge and face.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellComplex {
    /// Leaf faces.
    pub faces: u64,
    /// Leaf edges, of faces and wires.
    pub edges: u64,
    /// Vertices of leaf edges.
    pub vertices: u64,
    /// Pieces connected through vertices.
    pub components: u64,
    /// Leaf edges with one face.
    pub boundary_edges: u64,
    /// Closed curves that these form.
    pub boundary_loops: u64,
    /// vertices - edges + faces.
    pub euler: i64,
    /// The B-rep of the states, and the state of every root.
    pub(super) topology: Arc<Topology>,
    pub(super) root_states: Vec<StateId>,
    pub(super) vertex_origins: Vec<Origin>,
    /// Nodes and edges, part by part.
    pub(super) parts: Vec<Part>,
    pub(super) node_numbers: Numbers,
    pub(super) edge_numbers: Numbers,
    /// The node of every triangle.
    pub(super) triangle_nodes: Vec<u32>,
    /// The edge of every segment.
    pub(super) segment_edges: Vec<u32>,
}

impl CellComplex {
    /// The complex of triangles that fill faces: `nodes` are the faces' (the parent, or `NONE`, and the child or root),
    /// `vertex_nodes` and `triangle_nodes` say to which the vertices and triangles belong.
    pub(in crate::attractor) fn of_triangles(
        attractor: &Attractor,
        nodes: Vec<(u32, u32)>,
        vertex_nodes: &[u32],
        triangles: &[[u32; 3]],
        triangle_nodes: Vec<u32>,
    ) -> Self {
        Self {
            topology: attractor.brep.as_ref().map(|(topology, _)| Arc::clone(topology)).unwrap_or_default(),
            root_states: attractor.roots().iter().map(|root| root.state).collect(),
            vertex_origins: vertex_nodes.iter().map(|&node| Origin::Middle { node }).collect(),
            node_numbers: Numbers::new([nodes.len()].into_iter()),
            edge_numbers: Numbers::new([0].into_iter()),
            parts: vec![Part { nodes, edges: Vec::new() }],
            triangle_nodes,
            ..count_complex(vertex_nodes.len(), triangles)
        }
    }

    /// Adds the complex of other roots of the same automaton.
    pub(crate) fn append(&mut self, other: Self) {
        let (nodes, edges) = (self.node_numbers.count(), self.edge_numbers.count());
        let node = |node: u32| if node == super::NONE { node } else { node + nodes };
        let origin = |origin: Origin| match origin {
            Origin::Root { .. } => origin,
            Origin::Face { node, piece } => Origin::Face { node: node + nodes, piece },
            Origin::Edge { edge, piece } => Origin::Edge { edge: edge + edges, piece },
            Origin::Middle { node } => Origin::Middle { node: node + nodes },
        };
        self.faces += other.faces;
        self.edges += other.edges;
        self.vertices += other.vertices;
        self.components += other.components;
        self.boundary_edges += other.boundary_edges;
        self.boundary_loops += other.boundary_loops;
        self.euler += other.euler;
        self.vertex_origins.extend(other.vertex_origins.into_iter().map(origin));
        self.parts.extend(other.parts.into_iter().map(|part| Part {
            nodes: part.nodes.into_iter().map(|(parent, child)| (node(parent), child)).collect(),
            edges: part.edges.into_iter().map(origin).collect(),
        }));
        self.node_numbers = Numbers::new(self.parts.iter().map(|part| part.nodes.len()));
        self.edge_numbers = Numbers::new(self.parts.iter().map(|part| part.edges.len()));
        self.triangle_nodes.extend(other.triangle_nodes.into_iter().map(node));
        self.segment_edges.extend(other.segment_edges.into_iter().map(|edge| edge + edges));
    }

    /// Vertices of the tessellation that belong to the complex.
    #[must_use]
    pub fn drawn_vertices(&self) -> u64 {
        self.vertex_origins.len() as u64
    }

    /// Edges of the tessellation: those of the cells, and those that fill faces which are not triangles.
    #[must_use]
    pub fn drawn_edges(&self) -> u64 {
        // Filling a face changes no Euler number.
        (self.vertex_origins.len() as i64 + self.triangle_nodes.len() as i64 - self.euler).unsigned_abs()
    }

    /// The address of a vertex of the tessellation; `None` beyond the complex.
    #[must_use]
    pub fn vertex_address(&self, vertex: usize) -> Option<CellAddress> {
        self.origin_address(*self.vertex_origins.get(vertex)?)
    }

    /// The address of the edge that a segment of the tessellation stands for.
    #[must_use]
    pub fn segment_address(&self, segment: usize) -> Option<CellAddress> {
        self.origin_address(self.edge_origin(*self.segment_edges.get(segment)?))
    }

    /// The address of the face that a triangle of the tessellation belongs to.
    #[must_use]
    pub fn triangle_address(&self, triangle: usize) -> Option<CellAddress> {
        Some(self.node_address(*self.triangle_nodes.get(triangle)?))
    }

    fn node(&self, node: u32) -> (u32, u32) {
        let (part, index) = self.node_numbers.find(node);
        self.parts[part].nodes[index]
    }

    fn edge_origin(&self, edge: u32) -> Origin {
        let (part, index) = self.edge_numbers.find(edge);
        self.parts[part].edges[index]
    }

    fn node_address(&self, node: u32) -> CellAddress {
        let mut steps = Vec::new();
        let mut current = self.node(node);
        while current.0 != super::NONE {
            steps.push(Step::Child(current.1 as usize));
            current = self.node(current.0);
        }
        steps.reverse();
        CellAddress { root: current.1 as usize, steps }
    }

    fn origin_address(&self, origin: Origin) -> Option<CellAddress> {
        let topology = &self.topology;
        let child_of = |state: StateId, child: usize| topology.state(state).split.pieces[child].state;
        let mut pieces = Vec::new();
        let mut current = origin;
        while let Origin::Edge { edge, piece } = current {
            pieces.push(piece as usize);
            current = self.edge_origin(edge);
        }
        let boundary = |path: &[usize]| path.iter().map(|&index| Step::Boundary(index)).collect::<Vec<_>>();
        let (mut address, mut state) = match current {
            Origin::Middle { node } => return Some(self.node_address(node)),
            Origin::Root { root, cell } => {
                let state = self.root_states[root as usize];
                let sub = topology.state(state).closure.cells.get(cell as usize);
                let steps = sub.map_or_else(Vec::new, |sub| boundary(&sub.path));
                (CellAddress { root: root as usize, steps }, sub.map_or(state, |sub| sub.state))
            }
            Origin::Face { node, piece } => {
                let mut address = self.node_address(node);
                let mut state = self.root_states[address.root];
                for step in &address.steps {
                    if let Step::Child(index) = step {
                        state = child_of(state, *index);
                    }
                }
                let (child, cell) = topology.state(state).split.origins[piece as usize];
                let sub = &topology.state(child_of(state, child)).closure.cells[cell];
                address.steps.push(Step::Child(child));
                address.steps.extend(boundary(&sub.path));
                (address, sub.state)
            }
            Origin::Edge { .. } => return None,
        };
        for piece in pieces.into_iter().rev() {
            let split = &topology.state(state).split;
            let (child, cell) = match piece.checked_sub(split.children.len()) {
                None => (piece, None),
                Some(fresh) => (split.origins[fresh].0, Some(split.origins[fresh].1)),
            };
            address.steps.push(Step::Child(child));
            state = child_of(state, child);
            if let Some(cell) = cell {
                let sub = &topology.state(state).closure.cells[cell];
                address.steps.extend(boundary(&sub.path));
                state = sub.state;
            }
        }
        Some(address)
    }
}
