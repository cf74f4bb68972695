//! Refinement of some cells: the trunk's, or a shard's on top of it.

use super::address::Origin;
use super::step::Steps;
use super::{Attractor, Edge, Face, NONE, RefineError, Seen, Side, Start, TangentPlanes};
use crate::attractor::cell::{Cell, ControlPoint, Point};
use crate::automaton::topology::{Source, Topology, View};
use crate::automaton::{LeafPrimitive, StateId};
use crate::budget::Budget;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// What all shards of one evaluation share: the model, limits, and counts.
pub(super) struct Context<'a> {
    attractor: &'a Attractor,
    topology: &'a Arc<Topology>,
    steps: &'a Steps,
    tangents: Option<&'a TangentPlanes>,
    budget: &'a Budget,
    tolerance_mm: f64,
    leaves: AtomicU64,
    bytes: AtomicU64,
}

impl<'a> Context<'a> {
    pub(super) fn new(
        attractor: &'a Attractor,
        topology: &'a Arc<Topology>,
        steps: &'a Steps,
        tangents: Option<&'a TangentPlanes>,
        budget: &'a Budget,
        tolerance_mm: f64,
    ) -> Self {
        Self { attractor, topology, steps, tangents, budget, tolerance_mm, leaves: AtomicU64::new(0), bytes: AtomicU64::new(0) }
    }

    /// Whether what is held fits the limits. Sums only grow: at the end the answer does not depend on the number of threads.
    pub(super) fn check(&self) -> Result<(), RefineError> {
        let allowed = self.budget.limits.cells;
        if self.leaves.load(Ordering::Relaxed) > allowed {
            let tolerance_mm = self.tolerance_mm;
            return Err(RefineError::Cells { allowed, tolerance_mm });
        }
        let allowed_bytes = self.budget.limits.memory_bytes;
        if self.bytes.load(Ordering::Relaxed) <= allowed_bytes {
            return Ok(());
        }
        let (tolerance_mm, leaf_cells) = (self.tolerance_mm, self.leaves.load(Ordering::Relaxed));
        Err(RefineError::Memory { allowed_bytes, tolerance_mm, leaf_cells })
    }
}

/// Vertices, edges and nodes. A shard's numbers go on where the trunk's end.
#[derive(Debug, Default)]
pub(super) struct Store {
    pub(super) vertices: Vec<Point>,
    pub(super) vertex_origins: Vec<Origin>,
    pub(super) edges: Vec<Edge>,
    pub(super) edge_origins: Vec<Origin>,
    pub(super) edge_vertices: Vec<u32>,
    pub(super) pieces: Vec<u32>,
    /// Cells that were subdivided or drawn: the parent (or [`NONE`]) and the transition (or root).
    pub(super) nodes: Vec<(u32, u32)>,
}

/// A cell of the trunk that is left to a shard.
pub(super) struct Pending {
    cell: Cell,
    /// Its control points, unless it is a root.
    points: Option<Vec<ControlPoint>>,
    seen: Vec<Seen>,
    depth: u32,
    node: u32,
}

/// Buffers of one depth.
#[derive(Default)]
struct Frame {
    points: Vec<ControlPoint>,
    all: Vec<ControlPoint>,
    seen: Vec<Seen>,
    fresh: Vec<u32>,
}

/// Cells being refined on top of what is below.
pub(super) struct Shard<'a> {
    context: &'a Context<'a>,
    below: &'a Store,
    own: Store,
    /// Edges from below that were split here, with the places of their pieces.
    split_here: BTreeMap<u32, u32>,
    faces: Vec<Face>,
    /// Sides of the faces, one face after the other.
    outlines: Vec<Side>,
    /// At the corners of every face and in its middle, if asked for.
    normals: Vec<Point>,
    /// Root edges: all their leaves are drawn.
    wires: Vec<u32>,
    /// In the trunk: the depth at which cells are left to shards, and these cells.
    frontier: Option<u32>,
    pending: Vec<Pending>,
    spare: Vec<Frame>,
    leaves: u64,
    /// What is already counted in the context.
    counted: (u64, u64),
    deviation: f64,
}

/// What a shard made.
pub(super) struct Grown {
    pub(super) own: Store,
    pub(super) split_here: BTreeMap<u32, u32>,
    pub(super) faces: Vec<Face>,
    pub(super) outlines: Vec<Side>,
    pub(super) normals: Vec<Point>,
    pub(super) wires: Vec<u32>,
    pub(super) leaves: u64,
    pub(super) deviation: f64,
}

impl<'a> Shard<'a> {
    pub(super) fn new(context: &'a Context<'a>, below: &'a Store) -> Self {
        Self {
            context,
            below,
            own: Store::default(),
            split_here: BTreeMap::new(),
            faces: Vec::new(),
            outlines: Vec::new(),
            normals: Vec::new(),
            wires: Vec::new(),
            frontier: None,
            pending: Vec::new(),
            spare: Vec::new(),
            leaves: 0,
            counted: (0, 0),
            deviation: 0.0,
        }
    }

    /// The trunk: cells down to the frontier.
    pub(super) fn plant(&mut self, start: &Start, roots: &[usize], frontier: u32) -> Result<(), RefineError> {
        self.frontier = Some(frontier);
        let (attractor, topology) = (self.context.attractor, self.context.topology);
        // Cells of the closures become edges and vertices when the first of their roots is met.
        let mut made = vec![NONE; start.cells.len()];
        for (position, &root) in roots.iter().enumerate() {
            if position.is_multiple_of(1024) {
                self.context.budget.cancel.check()?;
            }
            let cells = &topology.state(attractor.roots()[root].state).closure.cells;
            // Vertices first: edges refer to them.
            for dimension in [0, 1] {
                for (cell, seen) in start.roots[root].iter().enumerate() {
                    let sub = &cells[cell];
                    if made[seen.id as usize] != NONE || topology.state(sub.state).dimension != dimension {
                        continue;
                    }
                    let origin = Origin::Root { root: root as u32, cell: cell as u32 };
                    made[seen.id as usize] = if dimension == 0 {
                        let point = self.place(&attractor.roots()[root].points, &sub.point, root as u32);
                        self.vertex(point, origin)
                    } else {
                        // The cell itself is what its first sighting shows.
                        let first = self.own.edge_vertices.len();
                        self.own.edge_vertices.extend(sub.cells.iter().map(|&(inner, _)| made[start.roots[root][inner].id as usize]));
                        self.edge(sub.state, first, origin, start.collapsed[seen.id as usize], false)
                    };
                }
            }
            let seen: Vec<Seen> = start.roots[root].iter().map(|seen| Seen { id: made[seen.id as usize], view: seen.view }).collect();
            let cell = attractor.root_cell(root);
            self.own.nodes.push((NONE, root as u32));
            let node = self.own.nodes.len() as u32 - 1;
            if frontier == 0 || topology.state(cell.state).dimension != 2 {
                self.pending.push(Pending { cell, points: None, seen, depth: 0, node });
            } else {
                let points = &attractor.roots()[root].points;
                self.face(&cell, attractor.leaf_error(&cell, points), points, &seen, 0, node)?;
            }
        }
        Ok(())
    }

    /// What was left to shards, and the trunk.
    pub(super) fn into_trunk(self) -> (Vec<Pending>, Store) {
        (self.pending, self.own)
    }

    /// Refines cells that the trunk left.
    pub(super) fn grow(&mut self, pending: &[Pending]) -> Result<(), RefineError> {
        let attractor = self.context.attractor;
        for Pending { cell, points, seen, depth, node } in pending {
            let points = points.as_ref().unwrap_or(&attractor.roots()[cell.root as usize].points);
            if self.context.topology.state(cell.state).dimension == 2 {
                self.face(cell, attractor.leaf_error(cell, points), points, seen, *depth, *node)?;
                continue;
            }
            let first = self.own.edge_vertices.len();
            self.own.edge_vertices.extend(seen.iter().map(|seen| seen.id));
            let edge = self.edge(cell.state, first, Origin::Root { root: cell.root, cell: NONE }, false, false);
            self.wires.push(edge);
            self.wire(cell, points, edge, *depth)?;
        }
        self.count();
        Ok(())
    }

    pub(super) fn finish(self) -> Grown {
        let Self { own, split_here, faces, outlines, normals, wires, leaves, deviation, .. } = self;
        Grown { own, split_here, faces, outlines, normals, wires, leaves, deviation }
    }

    fn vertex(&mut self, point: Point, origin: Origin) -> u32 {
        self.own.vertices.push(point);
        self.own.vertex_origins.push(origin);
        (self.below.vertices.len() + self.own.vertices.len()) as u32 - 1
    }

    /// An edge whose vertices were put down from `first` on.
    fn edge(&mut self, state: StateId, first: usize, origin: Origin, collapsed: bool, shared: bool) -> u32 {
        self.own.edges.push(Edge { state, vertices: first as u32, pieces: NONE, collapsed, shared });
        self.own.edge_origins.push(origin);
        (self.below.edges.len() + self.own.edges.len()) as u32 - 1
    }

    fn node(&mut self, parent: u32, child: usize) -> u32 {
        self.own.nodes.push((parent, child as u32));
        (self.below.nodes.len() + self.own.nodes.len()) as u32 - 1
    }

    /// An edge of any number, and where its vertices are.
    fn edge_at(&self, id: u32) -> (&Edge, &[u32]) {
        let store = if (id as usize) < self.below.edges.len() { self.below } else { &self.own };
        let index = if std::ptr::eq(store, self.below) { id as usize } else { id as usize - self.below.edges.len() };
        let edge = &store.edges[index];
        (edge, &store.edge_vertices[edge.vertices as usize..])
    }

    /// The pieces of an edge, if it was split.
    fn pieces_of(&self, id: u32) -> Option<&[u32]> {
        let below = self.below.edges.len();
        if id as usize >= below {
            let start = self.own.edges[id as usize - below].pieces;
            return (start != NONE).then(|| &self.own.pieces[start as usize..]);
        }
        match self.below.edges[id as usize].pieces {
            NONE => self.split_here.get(&id).map(|&start| &self.own.pieces[start as usize..]),
            start => Some(&self.below.pieces[start as usize..]),
        }
    }

    fn place(&self, points: &[ControlPoint], weights: &[f64], root: u32) -> Point {
        self.context.attractor.barycentric(points, weights, self.context.attractor.roots()[root as usize].rational)
    }

    /// Notes a leaf; stops when somebody or a limit says so.
    fn leaf(&mut self, error: f64) -> Result<(), RefineError> {
        self.leaves += 1;
        self.deviation = self.deviation.max(error);
        if self.leaves.is_multiple_of(1024) {
            let budget = self.context.budget;
            budget.cancel.check()?;
            self.count();
            budget.report("refine", 0.0, self.context.leaves.load(Ordering::Relaxed));
            self.context.check()?;
        }
        Ok(())
    }

    /// Tells the context what was made. Growing vectors, and what drawing them takes, need about twice what they hold.
    fn count(&mut self) {
        let Store { vertices, edges, pieces, nodes, .. } = &self.own;
        let (vertices, edges, faces) = (vertices.len(), edges.len(), self.faces.len());
        let held = 36 * vertices
            + 32 * edges
            + 4 * pieces.len()
            + 8 * nodes.len()
            + 40 * faces
            + 4 * self.outlines.len()
            + 24 * self.normals.len();
        let drawn = 24 * (vertices + faces) + 28 * faces + 8 * edges;
        let bytes = 2 * (held + drawn) as u64;
        self.context.leaves.fetch_add(self.leaves - self.counted.0, Ordering::Relaxed);
        self.context.bytes.fetch_add(bytes - self.counted.1, Ordering::Relaxed);
        self.counted = (self.leaves, bytes);
    }

    fn check_depth(&self, depth: u32, reached_mm: f64) -> Result<(), RefineError> {
        let allowed = self.context.budget.limits.depth;
        let tolerance_mm = self.context.tolerance_mm;
        if depth < allowed { Ok(()) } else { Err(RefineError::Depth { allowed, tolerance_mm, reached_mm }) }
    }

    fn frame(&mut self, depth: u32) -> Frame {
        while self.spare.len() <= depth as usize {
            self.spare.push(Frame::default());
        }
        std::mem::take(&mut self.spare[depth as usize])
    }

    fn face(&mut self, cell: &Cell, error: f64, points: &[ControlPoint], seen: &[Seen], depth: u32, node: u32) -> Result<(), RefineError> {
        let Context { attractor, topology, steps, .. } = *self.context;
        let own = topology.state(cell.state);
        let is_leaf = error <= self.context.tolerance_mm;
        if self.frontier.is_some_and(|frontier| is_leaf || depth >= frontier) {
            self.pending.push(Pending { cell: *cell, points: Some(points.to_vec()), seen: seen.to_vec(), depth, node });
            return Ok(());
        }
        if is_leaf {
            if let Some(outline) = &own.outline {
                let middle =
                    if own.middle.is_empty() { attractor.centre(cell, points) } else { self.place(points, &own.middle, cell.root) };
                self.faces.push(Face { node, outline: self.outlines.len() as u32, middle, normals: self.normals.len() as u32 });
                self.bend(cell, points, &middle);
                for &(position, backwards) in outline {
                    let Seen { id, view } = seen[position];
                    let side = Side::new(id, backwards != self.turned(id, view));
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
        let mut frame = self.frame(depth);
        self.make_fresh(cell, points, seen, node, &mut frame.fresh);
        steps.take(cell.state.index(), points, &mut frame.all);
        for child in 0..own.split.children.len() {
            frame.seen.clear();
            for source in &own.split.children[child] {
                let resolved = self.resolve(*source, seen, &frame.fresh);
                frame.seen.push(resolved);
            }
            steps.child(cell.state.index(), child, &frame.all, &mut frame.points);
            let (child_cell, error) = attractor.child_with_error(cell, child, &frame.points, self.context.tolerance_mm);
            let child_node = self.node(node, child);
            self.face(&child_cell, error, &frame.points, &frame.seen, depth + 1, child_node)?;
        }
        self.spare[depth as usize] = frame;
        Ok(())
    }

    /// Notes the normals of a leaf face.
    fn bend(&mut self, cell: &Cell, points: &[ControlPoint], middle: &Point) {
        let (attractor, Some(tangents)) = (self.context.attractor, self.context.tangents) else { return };
        let rational = attractor.roots()[cell.root as usize].rational;
        let LeafPrimitive::Polygon(corners) = &attractor.automaton().state(cell.state).leaf else { return };
        let corners: Vec<Point> = corners.iter().map(|corner| attractor.barycentric(points, corner, rational)).collect();
        tangents.normals(cell.state, points, rational, &corners, &mut self.normals);
        self.normals.push(tangents.middle_normal(cell.state, points, rational, middle));
    }

    /// Whether an edge seen by a view runs the other way.
    fn turned(&self, id: u32, view: View) -> bool {
        if view == View::SAME {
            return false;
        }
        let (topology, state) = (self.context.topology, self.edge_at(id).0.state);
        topology.ends(state).is_some_and(|[start, end]| start != end && topology.cell_seen(state, view, start).0 == end)
    }

    /// Creates the cells inside a face.
    fn make_fresh(&mut self, cell: &Cell, points: &[ControlPoint], seen: &[Seen], node: u32, fresh: &mut Vec<u32>) {
        let split = &self.context.topology.state(cell.state).split;
        let children = split.children.len();
        fresh.clear();
        fresh.resize(split.fresh.len(), NONE);
        for pass in [0, 1] {
            for (index, piece) in split.pieces[children..].iter().enumerate() {
                let origin = Origin::Face { node, piece: index as u32 };
                match (pass, piece.point.is_empty()) {
                    (0, false) => fresh[index] = self.vertex(self.place(points, &piece.point, cell.root), origin),
                    (1, true) => {
                        let first = self.own.edge_vertices.len();
                        for &source in &split.fresh[index] {
                            let vertex = self.resolve(source, seen, fresh).id;
                            self.own.edge_vertices.push(vertex);
                        }
                        fresh[index] = self.edge(piece.state, first, origin, false, false);
                    }
                    _ => {}
                }
            }
        }
    }

    /// The edge or vertex that a source means, for a cell that sees its closure as `seen`.
    fn resolve(&self, source: Source, seen: &[Seen], fresh: &[u32]) -> Seen {
        match source {
            Source::Vertex { cell } => seen[cell],
            Source::Fresh { index, view } => Seen { id: fresh[index], view },
            Source::Piece { cell, piece, view } => {
                let (parent, topology) = (seen[cell], self.context.topology);
                let pieces = self.pieces_of(parent.id).unwrap_or_default();
                if parent.view == View::SAME {
                    return Seen { id: pieces[piece], view };
                }
                let state = self.edge_at(parent.id).0.state;
                let (actual, turned) = topology.piece_seen(state, parent.view, piece);
                let piece_state = topology.state(state).split.pieces[actual].state;
                Seen { id: pieces[actual], view: topology.product(piece_state, turned, view) }
            }
        }
    }

    /// Subdivides an edge unless it was; `places` are the limit points of its pieces as seen by `view`, in the
    /// space of `points`.
    fn split_edge(&mut self, id: u32, view: View, points: &[ControlPoint], places: &[Vec<f64>], root: u32) {
        if self.pieces_of(id).is_some() {
            return;
        }
        let topology = self.context.topology;
        let Edge { state, collapsed, shared, .. } = *self.edge_at(id).0;
        let split = &topology.state(state).split;
        let (children, start) = (split.children.len(), self.own.pieces.len());
        if children == 0 {
            return;
        }
        self.own.pieces.resize(start + split.pieces.len(), NONE);
        let below = self.below.edges.len();
        if id as usize >= below {
            self.own.edges[id as usize - below].pieces = start as u32;
        } else {
            self.split_here.insert(id, start as u32);
        }
        let shared = shared || (id as usize) < below;
        for (position, place) in places.iter().enumerate().filter(|(_, place)| !place.is_empty()) {
            let (actual, _) = topology.piece_seen(state, view, position);
            if collapsed {
                self.own.pieces[start + actual] = self.edge_at(id).1[0];
                continue;
            }
            let origin = Origin::Edge { edge: id, piece: actual as u32 };
            let point = self.place(points, place, root);
            self.own.pieces[start + actual] = self.vertex(point, origin);
        }
        for child in 0..children {
            let first = self.own.edge_vertices.len();
            for source in &split.children[child] {
                let vertex = match source {
                    Source::Vertex { cell } => self.edge_at(id).1[*cell],
                    Source::Fresh { index, .. } => self.own.pieces[start + children + index],
                    Source::Piece { .. } => NONE,
                };
                self.own.edge_vertices.push(vertex);
            }
            let origin = Origin::Edge { edge: id, piece: child as u32 };
            self.own.pieces[start + child] = self.edge(split.pieces[child].state, first, origin, collapsed, shared);
        }
    }

    fn wire(&mut self, cell: &Cell, points: &[ControlPoint], edge: u32, depth: u32) -> Result<(), RefineError> {
        let Context { attractor, topology, steps, .. } = *self.context;
        let error = attractor.leaf_error(cell, points);
        if error <= self.context.tolerance_mm {
            return self.leaf(error);
        }
        self.check_depth(depth, error)?;
        let split = &topology.state(cell.state).split;
        self.split_edge(edge, View::SAME, points, &split.limits, cell.root);
        let mut frame = self.frame(depth);
        steps.take(cell.state.index(), points, &mut frame.all);
        for child in 0..split.children.len() {
            steps.child(cell.state.index(), child, &frame.all, &mut frame.points);
            let child_cell = attractor.child_cell(cell, child, &frame.points);
            let id = self.pieces_of(edge).map_or(NONE, |pieces| pieces[child]);
            self.wire(&child_cell, &frame.points, id, depth + 1)?;
        }
        self.spare[depth as usize] = frame;
        Ok(())
    }
}
