//! Evaluation of cells that have a B-rep: one cell complex, whose edges and vertices exist once.
//!
//! Neighbouring faces share their edge *cell*. When either of them subdivides, the edge subdivides, once, and
//! its new vertex is computed once; a neighbour that stays coarse finds the finer edge in its outline. So an
//! adaptive refinement has no cracks and no T-junctions by construction, and no positions are ever compared.

mod address;
mod draw;

pub use address::{CellAddress, CellComplex, Step};

use super::cell::{Cell, ControlPoint, Point, child_points};
use super::{Attractor, RefineError};
use crate::automaton::topology::{Conflict, Source, Topology, TopologyError, Union, View};
use crate::automaton::{Automaton, LeafPrimitive, StateId};
use crate::budget::Budget;
use crate::tessellation::Tessellation;
use crate::tolerance::Tolerance;
use address::Origin;
use std::sync::Arc;

/// Boundaries of two root cells that are one.
#[derive(Clone, Debug, PartialEq)]
pub struct Gluing {
    /// Pairs (root cell, boundary of its state).
    pub between: [(usize, usize); 2],
    /// Control point j of the first is control point `permutation[j]` of the second; `None`: the same order.
    pub permutation: Option<Vec<usize>>,
}

/// No index.
const NONE: u32 = u32::MAX;

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

/// Refines the given roots, which have a B-rep, into one complex.
pub(super) fn refine(attractor: &Attractor, roots: &[usize], tolerance: Tolerance, budget: &Budget) -> Result<Tessellation, RefineError> {
    let Some((topology, start)) = attractor.brep.as_ref().filter(|_| !roots.is_empty()) else { return Ok(Tessellation::default()) };
    // What gluing took for equal is part of the error.
    let share = (tolerance.mm() - attractor.seam_mm).max(0.0);
    let mut builder = Builder::new(attractor, topology, budget, share);
    builder.refine(start, roots)?;
    let mut tessellation = builder.draw();
    tessellation.deviation_mm += attractor.seam_mm;
    Ok(tessellation)
}

impl Attractor {
    /// Whether a root's cells are drawn as one complex: curves between two vertices, wires that branch, or a
    /// face that its edges surround, and so all its descendants.
    pub(super) fn has_brep(&self, root: usize) -> bool {
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

/// The complex in the making.
pub(super) struct Builder<'a> {
    attractor: &'a Attractor,
    topology: &'a Arc<Topology>,
    budget: &'a Budget,
    tolerance_mm: f64,
    vertices: Vec<Point>,
    vertex_origins: Vec<Origin>,
    edges: Vec<Edge>,
    edge_origins: Vec<Origin>,
    edge_vertices: Vec<u32>,
    pieces: Vec<u32>,
    /// Cells that were subdivided or drawn: the parent (or [`NONE`]) and the transition (or root).
    nodes: Vec<(u32, u32)>,
    faces: Vec<Face>,
    /// Sides of the faces, one face after the other.
    outlines: Vec<Side>,
    /// Root edges: all their leaves are drawn.
    wires: Vec<u32>,
    /// Buffers by depth.
    spare: Vec<Frame>,
    leaves: u64,
    deviation: f64,
}

#[derive(Default)]
struct Frame {
    points: Vec<ControlPoint>,
    seen: Vec<Seen>,
    fresh: Vec<u32>,
}

impl<'a> Builder<'a> {
    pub(super) fn new(attractor: &'a Attractor, topology: &'a Arc<Topology>, budget: &'a Budget, tolerance_mm: f64) -> Self {
        Self {
            attractor,
            topology,
            budget,
            tolerance_mm,
            vertices: Vec::new(),
            vertex_origins: Vec::new(),
            edges: Vec::new(),
            edge_origins: Vec::new(),
            edge_vertices: Vec::new(),
            pieces: Vec::new(),
            nodes: Vec::new(),
            faces: Vec::new(),
            outlines: Vec::new(),
            wires: Vec::new(),
            spare: Vec::new(),
            leaves: 0,
            deviation: 0.0,
        }
    }

    /// Refines the roots of the given indices.
    pub(super) fn refine(&mut self, start: &Start, roots: &[usize]) -> Result<(), RefineError> {
        // Cells of the closures become edges and vertices when the first of their roots is met.
        let mut made = vec![NONE; start.cells.len()];
        for &root in roots {
            let cells = &self.topology.state(self.attractor.roots()[root].state).closure.cells;
            // Vertices first: edges refer to them.
            for dimension in [0, 1] {
                for (cell, seen) in start.roots[root].iter().enumerate() {
                    let sub = &cells[cell];
                    if made[seen.id as usize] != NONE || self.topology.state(sub.state).dimension != dimension {
                        continue;
                    }
                    let origin = Origin::Root { root: root as u32, cell: cell as u32 };
                    made[seen.id as usize] = if dimension == 0 {
                        let point = self.place(&self.attractor.roots()[root].points, &sub.point, root as u32);
                        self.vertex(point, origin)
                    } else {
                        // The cell itself is what its first sighting shows.
                        let first = self.edge_vertices.len();
                        self.edge_vertices.extend(sub.cells.iter().map(|&(inner, _)| made[start.roots[root][inner].id as usize]));
                        let edge = self.edge(sub.state, first, origin);
                        self.edges[edge as usize].collapsed = start.collapsed[seen.id as usize];
                        edge
                    };
                }
            }
            let seen: Vec<Seen> = start.roots[root].iter().map(|seen| Seen { id: made[seen.id as usize], view: seen.view }).collect();
            self.root(root, &seen)?;
        }
        Ok(())
    }

    fn root(&mut self, index: usize, seen: &[Seen]) -> Result<(), RefineError> {
        let cell = self.attractor.root_cell(index);
        let points = &self.attractor.roots()[index].points;
        self.nodes.push((NONE, index as u32));
        let node = self.nodes.len() as u32 - 1;
        if self.topology.state(cell.state).dimension == 2 {
            return self.face(&cell, points, seen, 0, node);
        }
        let first = self.edge_vertices.len();
        self.edge_vertices.extend(seen.iter().map(|seen| seen.id));
        let edge = self.edge(cell.state, first, Origin::Root { root: index as u32, cell: NONE });
        self.wires.push(edge);
        self.wire(&cell, points, edge, 0)
    }

    fn vertex(&mut self, point: Point, origin: Origin) -> u32 {
        self.vertices.push(point);
        self.vertex_origins.push(origin);
        self.vertices.len() as u32 - 1
    }

    /// An edge whose vertices were put down from `first` on.
    fn edge(&mut self, state: StateId, first: usize, origin: Origin) -> u32 {
        self.edges.push(Edge { state, vertices: first as u32, pieces: NONE, collapsed: false });
        self.edge_origins.push(origin);
        self.edges.len() as u32 - 1
    }

    fn place(&self, points: &[ControlPoint], weights: &[f64], root: u32) -> Point {
        self.attractor.barycentric(points, weights, self.attractor.roots()[root as usize].rational)
    }

    /// Notes a leaf; stops when somebody or a limit says so.
    fn leaf(&mut self, error: f64) -> Result<(), RefineError> {
        self.leaves += 1;
        self.deviation = self.deviation.max(error);
        if self.leaves.is_multiple_of(1024) {
            self.budget.cancel.check()?;
            self.budget.report("refine", 0.0, self.leaves);
            self.check_memory(error)?;
        }
        let allowed = self.budget.limits.cells;
        if self.leaves > allowed {
            let reachable_mm = (2.0 * error).max(2.0 * self.tolerance_mm);
            return Err(RefineError::Cells { allowed, tolerance_mm: self.tolerance_mm, reachable_mm });
        }
        Ok(())
    }

    /// Growing vectors, and what drawing them takes, need about twice what they hold.
    fn check_memory(&self, error: f64) -> Result<(), RefineError> {
        let (vertices, edges, faces) = (self.vertices.len(), self.edges.len(), self.faces.len());
        let held = 36 * vertices + 32 * edges + 4 * self.pieces.len() + 8 * self.nodes.len() + 36 * faces + 4 * self.outlines.len();
        let drawn = 24 * (vertices + faces) + 28 * faces + 8 * edges;
        let allowed_bytes = self.budget.limits.memory_bytes;
        // Beyond 2^31 edges a side has no room for its direction.
        if 2 * (held + drawn) as u64 <= allowed_bytes && edges < 1 << 31 {
            return Ok(());
        }
        let reachable_mm = (2.0 * error).max(2.0 * self.tolerance_mm);
        Err(RefineError::Memory { allowed_bytes, tolerance_mm: self.tolerance_mm, leaf_cells: self.leaves, reachable_mm })
    }

    fn check_depth(&self, depth: u32, reached_mm: f64) -> Result<(), RefineError> {
        let allowed = self.budget.limits.depth;
        if depth < allowed { Ok(()) } else { Err(RefineError::Depth { allowed, tolerance_mm: self.tolerance_mm, reached_mm }) }
    }

    fn frame(&mut self, depth: u32) -> Frame {
        while self.spare.len() <= depth as usize {
            self.spare.push(Frame::default());
        }
        std::mem::take(&mut self.spare[depth as usize])
    }

    fn face(&mut self, cell: &Cell, points: &[ControlPoint], seen: &[Seen], depth: u32, node: u32) -> Result<(), RefineError> {
        let own = self.topology.state(cell.state);
        let error = self.attractor.leaf_error(cell, points);
        if error <= self.tolerance_mm {
            if let Some(outline) = &own.outline {
                let middle = if own.middle.is_empty() { cell.ball.centre } else { self.place(points, &own.middle, cell.root) };
                self.faces.push(Face { node, outline: self.outlines.len() as u32, middle });
                for &(position, backwards) in outline {
                    let Seen { id, view } = seen[position];
                    let side = Side::new(id, backwards != self.turned(self.edges[id as usize].state, view));
                    self.outlines.push(side);
                }
            }
            return self.leaf(error);
        }
        self.check_depth(depth, error)?;
        for (position, &Seen { id, view }) in seen.iter().enumerate() {
            if !own.split.on_boundary[position].is_empty() {
                self.split_edge(id, view, points, &own.split.on_boundary[position], cell.root);
            }
        }
        let transitions = &self.attractor.automaton().state(cell.state).transitions;
        let mut frame = self.frame(depth);
        self.make_fresh(cell, points, seen, node, &mut frame.fresh);
        for (child, transition) in transitions.iter().enumerate() {
            frame.seen.clear();
            for source in &own.split.children[child] {
                let resolved = self.resolve(cell.state, *source, seen, &frame.fresh);
                frame.seen.push(resolved);
            }
            frame.points.resize(transition.operator.columns(), [0.0; 4]);
            child_points(points, &transition.operator, &mut frame.points);
            let child_cell = self.attractor.child_cell(cell, child, &frame.points);
            self.nodes.push((node, child as u32));
            let child_node = self.nodes.len() as u32 - 1;
            self.face(&child_cell, &frame.points, &frame.seen, depth + 1, child_node)?;
        }
        self.spare[depth as usize] = frame;
        Ok(())
    }

    /// Whether an edge seen by a view runs the other way.
    fn turned(&self, state: StateId, view: View) -> bool {
        view != View::SAME
            && self.topology.ends(state).is_some_and(|[start, end]| start != end && self.topology.cell_seen(state, view, start).0 == end)
    }

    /// Creates the cells inside a face.
    fn make_fresh(&mut self, cell: &Cell, points: &[ControlPoint], seen: &[Seen], node: u32, fresh: &mut Vec<u32>) {
        let split = &self.topology.state(cell.state).split;
        let children = split.children.len();
        fresh.clear();
        fresh.resize(split.fresh.len(), NONE);
        for pass in [0, 1] {
            for (index, piece) in split.pieces[children..].iter().enumerate() {
                let origin = Origin::Face { node, piece: index as u32 };
                match (pass, piece.point.is_empty()) {
                    (0, false) => fresh[index] = self.vertex(self.place(points, &piece.point, cell.root), origin),
                    (1, true) => {
                        let first = self.edge_vertices.len();
                        for &source in &split.fresh[index] {
                            let vertex = self.resolve(cell.state, source, seen, fresh).id;
                            self.edge_vertices.push(vertex);
                        }
                        fresh[index] = self.edge(piece.state, first, origin);
                    }
                    _ => {}
                }
            }
        }
    }

    /// The edge or vertex that a source means, for a cell that sees its closure as `seen`.
    fn resolve(&self, state: StateId, source: Source, seen: &[Seen], fresh: &[u32]) -> Seen {
        match source {
            Source::Vertex { cell } => seen[cell],
            Source::Fresh { index, view } => Seen { id: fresh[index], view },
            Source::Piece { cell, piece, view } => {
                let parent = seen[cell];
                let edge = &self.edges[parent.id as usize];
                let (actual, turned) = self.topology.piece_seen(edge.state, parent.view, piece);
                let id = self.pieces[edge.pieces as usize + actual];
                let piece_state = self.topology.state(edge.state).split.pieces[actual].state;
                debug_assert_eq!(edge.state, self.topology.state(state).closure.cells[cell].state);
                Seen { id, view: self.topology.product(piece_state, turned, view) }
            }
        }
    }

    /// Subdivides an edge unless it was; `places` are the limit points of its pieces as seen by `view`, in the
    /// space of `points`.
    fn split_edge(&mut self, id: u32, view: View, points: &[ControlPoint], places: &[Vec<f64>], root: u32) {
        if self.edges[id as usize].pieces != NONE {
            return;
        }
        let Edge { state, collapsed, .. } = self.edges[id as usize];
        let split = &self.topology.state(state).split;
        let (children, start) = (split.children.len(), self.pieces.len());
        if children == 0 {
            return;
        }
        self.pieces.resize(start + split.pieces.len(), NONE);
        self.edges[id as usize].pieces = start as u32;
        for (position, place) in places.iter().enumerate().filter(|(_, place)| !place.is_empty()) {
            let (actual, _) = self.topology.piece_seen(state, view, position);
            if collapsed {
                self.pieces[start + actual] = self.edge_vertices[self.edges[id as usize].vertices as usize];
                continue;
            }
            let origin = Origin::Edge { edge: id, piece: actual as u32 };
            let point = self.place(points, place, root);
            self.pieces[start + actual] = self.vertex(point, origin);
        }
        for child in 0..children {
            let first = self.edge_vertices.len();
            for source in &split.children[child] {
                let vertex = match source {
                    Source::Vertex { cell } => self.edge_vertices[self.edges[id as usize].vertices as usize + cell],
                    Source::Fresh { index, .. } => self.pieces[start + children + index],
                    Source::Piece { .. } => NONE,
                };
                self.edge_vertices.push(vertex);
            }
            let edge = self.edge(split.pieces[child].state, first, Origin::Edge { edge: id, piece: child as u32 });
            self.edges[edge as usize].collapsed = collapsed;
            self.pieces[start + child] = edge;
        }
    }

    fn wire(&mut self, cell: &Cell, points: &[ControlPoint], edge: u32, depth: u32) -> Result<(), RefineError> {
        let error = self.attractor.leaf_error(cell, points);
        if error <= self.tolerance_mm {
            return self.leaf(error);
        }
        self.check_depth(depth, error)?;
        let split = &self.topology.state(cell.state).split;
        self.split_edge(edge, View::SAME, points, &split.limits, cell.root);
        let mut frame = self.frame(depth);
        for (child, transition) in self.attractor.automaton().state(cell.state).transitions.iter().enumerate() {
            frame.points.resize(transition.operator.columns(), [0.0; 4]);
            child_points(points, &transition.operator, &mut frame.points);
            let child_cell = self.attractor.child_cell(cell, child, &frame.points);
            let id = self.pieces[self.edges[edge as usize].pieces as usize + child];
            self.wire(&child_cell, &frame.points, id, depth + 1)?;
        }
        self.spare[depth as usize] = frame;
        Ok(())
    }
}
