//! The pieces of a shape that is held against itself, and which of them the model joins; [`super::intersect_self`] says what
//! both are.
//!
//! The cells of the B-rep are named as evaluation names them, and no positions are compared: the cells of the roots'
//! boundaries as gluings leave them, then the pieces of every cell and the cells created inside, by the split of their state.
//! Pieces of different depth share a cell when one has the whole of it and the other a cell that was cut from it.

use super::ContactError;
use super::body::{Body, Nature, corners};
use super::tree::{NodeId, Tree};
use crate::attractor::Attractor;
use crate::attractor::cell::{Point, Site, distance_squared};
use crate::automaton::StateId;
use crate::automaton::topology::{Source, Topology, View};
use crate::budget::Budget;
use crate::solid::contact::{is_flat, meet, side, turn, view};
use std::collections::HashMap;
use std::ops::Range;

/// Radius of the pieces, at most, in resolutions.
const PIECE: f64 = 4.0;
/// Radius of the ball in which chains lie, in resolutions.
const CHAIN: f64 = 16.0;

/// No index.
const NONE: u32 = u32::MAX;

/// A boundary cell as a cell of the shape sees it.
type Seen = (u32, View);

/// What two nodes are to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Relation {
    /// They are pieces that are joined.
    Joined,
    /// They are triangles, or segments, that have more in common than the corners that they share.
    Crossing,
    /// They are pieces that are not joined, or no pieces.
    Apart,
}

/// See the module's comment.
pub(super) struct Pieces {
    /// For every node that was made before the search, which piece it is; [`NONE`] of those above. Later ones are below.
    of_node: Vec<u32>,
    /// The node of every piece.
    nodes: Vec<NodeId>,
    /// The boundary cells of every piece.
    cells: Vec<Vec<u32>>,
    /// The cell that each was cut from.
    cut_from: Vec<u32>,
    /// For every cell, the pieces that have it.
    whole: Vec<Vec<u32>>,
    /// For every cell that a piece has, the pieces that have a cell cut from it.
    partial: Vec<Vec<u32>>,
    /// Whether every piece is as small as it should be.
    complete: bool,
    /// Radius of the ball in which chains lie.
    reach: f64,
    /// When a piece, and a cell's lists, were last visited.
    visited: Vec<u32>,
    listed: Vec<[u32; 2]>,
    visit: u32,
}

impl Pieces {
    /// Cuts a shape, and finds who shares what.
    ///
    /// Cost: proportional to the cells as large as the pieces or larger, and their boundary cells by their depth.
    ///
    /// # Errors
    /// [`ContactError::Stopped`] when the budget's token was fired, [`ContactError::Unsettled`] when there are more than the limits
    /// allow. Where addresses would be longer than allowed, pieces stay larger.
    pub(super) fn new(
        tree: &mut Tree<'_>,
        resolution_mm: f64,
        most_cells: u64,
        most_bytes: u64,
        budget: &Budget,
    ) -> Result<Self, ContactError> {
        let attractor = tree.attractor();
        let mut names = Names::new(attractor);
        let mut pieces = Self {
            of_node: Vec::new(),
            nodes: Vec::new(),
            cells: Vec::new(),
            cut_from: Vec::new(),
            whole: Vec::new(),
            partial: Vec::new(),
            complete: true,
            reach: CHAIN * resolution_mm,
            visited: Vec::new(),
            listed: Vec::new(),
            visit: 0,
        };
        let mut above: Vec<(NodeId, Vec<Seen>)> = vec![(0, names.of_root(tree, 0))];
        while let Some((id, seen)) = above.pop() {
            budget.cancel.check()?;
            let node = tree.node(id);
            let large = node.is_group() || (tree.subdivides(id) && node.body.ball.radius > PIECE * resolution_mm);
            if pieces.nodes.len() as u64 > most_cells || tree.bytes + names.bytes() > most_bytes {
                return Err(ContactError::Unsettled { resolution_mm });
            }
            if large && tree.is_splittable(id) {
                let children = tree.children(id);
                let states = names.of_children(tree, id, children.clone(), &seen);
                above.extend(children.zip(states).rev());
                continue;
            }
            pieces.complete &= !large;
            let piece = pieces.nodes.len() as u32;
            let at = id as usize;
            pieces.of_node.resize(pieces.of_node.len().max(at + 1), NONE);
            pieces.of_node[at] = piece;
            pieces.nodes.push(id);
            let mut cells: Vec<u32> = seen.into_iter().map(|(cell, _)| cell).collect();
            cells.sort_unstable();
            cells.dedup();
            pieces.cells.push(cells);
        }
        pieces.cut_from = names.cut_from;
        pieces.list();
        Ok(pieces)
    }

    fn list(&mut self) {
        let count = self.cut_from.len();
        (self.whole, self.partial) = (vec![Vec::new(); count], vec![Vec::new(); count]);
        for (piece, cells) in (0..).zip(&self.cells) {
            cells.iter().for_each(|&cell| self.whole[cell as usize].push(piece));
        }
        for (piece, cells) in (0..).zip(&self.cells) {
            for cell in cells.iter().flat_map(|&cell| origins(&self.cut_from, cell)) {
                let list = &mut self.partial[cell as usize];
                if !self.whole[cell as usize].is_empty() && list.last() != Some(&piece) {
                    list.push(piece);
                }
            }
        }
        (self.visited, self.listed) = (vec![0; self.nodes.len()], vec![[0; 2]; count]);
    }

    /// Whether every piece is as small as it should be.
    pub(super) fn complete(&self) -> bool {
        self.complete
    }

    /// Whether the shape declares boundaries.
    pub(super) fn may_be_joined(&self) -> bool {
        !self.cut_from.is_empty()
    }

    /// The node of a piece, and those of all others.
    pub(super) fn some_against_all(&self) -> (NodeId, Vec<NodeId>) {
        (self.nodes[0], self.nodes[1..].to_vec())
    }

    /// Whether a node is more than one piece.
    pub(super) fn is_above(&self, node: NodeId) -> bool {
        self.of_node.get(node as usize) == Some(&NONE)
    }

    /// Whether no piece of one node is joined with one of the other, but for what [`Self::relation`] says of the two themselves.
    pub(super) fn are_all_apart(&self, nodes: [NodeId; 2]) -> bool {
        !self.may_be_joined() || !nodes.iter().any(|&node| self.is_above(node))
    }

    /// What two different nodes are to each other, whose distance lies in [low, high].
    pub(super) fn relation(&mut self, tree: &Tree<'_>, nodes: [NodeId; 2], low: f64, high: f64) -> Relation {
        let piece = |node: NodeId| self.of_node.get(node as usize).copied().filter(|&piece| piece != NONE);
        let (Some(first), Some(second)) = (piece(nodes[0]), piece(nodes[1])) else { return Relation::Apart };
        let [a, b] = nodes.map(|node| &tree.node(node).body);
        if self.share(first, second) {
            return if cross(a, b) { Relation::Crossing } else { Relation::Joined };
        }
        // The two ends of a chain are cells of the ball.
        let joined = high > 0.0 && low <= 2.0 * self.reach && self.are_chained(tree, [first, second], &a.middle(b));
        if joined { Relation::Joined } else { Relation::Apart }
    }

    /// Whether two pieces share a boundary cell, or one has a cell that is cut from one of the other's.
    fn share(&self, first: u32, second: u32) -> bool {
        let [mine, its] = [first, second].map(|piece| &self.cells[piece as usize]);
        let has = |cells: &Vec<u32>, cell: u32| cells.binary_search(&cell).is_ok();
        let meets = |cells: &Vec<u32>, others: &Vec<u32>| {
            cells.iter().any(|&cell| has(others, cell) || origins(&self.cut_from, cell).any(|cell| has(others, cell)))
        };
        meets(mine, its) || meets(its, mine)
    }

    /// Whether a chain joins two pieces near a point.
    fn are_chained(&mut self, tree: &Tree<'_>, [first, last]: [u32; 2], middle: &Point) -> bool {
        self.visit += 1;
        let visit = self.visit;
        let mut waiting = vec![first];
        self.visited[first as usize] = visit;
        while let Some(piece) = waiting.pop() {
            for &cell in &self.cells[piece as usize] {
                // Those that have the whole of it or a part of it, then those that have the whole of what it was cut from.
                let around = std::iter::once((cell, 1)).chain(origins(&self.cut_from, cell).map(|cell| (cell, 0)));
                for (cell, part) in around {
                    for (kind, lists) in [&self.whole, &self.partial].into_iter().enumerate().take(part + 1) {
                        if std::mem::replace(&mut self.listed[cell as usize][kind], visit) == visit {
                            continue;
                        }
                        for &other in &lists[cell as usize] {
                            if other == last {
                                return true;
                            }
                            if std::mem::replace(&mut self.visited[other as usize], visit) == visit {
                                continue;
                            }
                            let ball = &tree.node(self.nodes[other as usize]).body.ball;
                            if distance_squared(&ball.centre, middle).sqrt() + ball.radius <= self.reach {
                                waiting.push(other);
                            }
                        }
                    }
                }
            }
        }
        false
    }
}

/// What a cell was cut from, and what that was cut from, and so on.
fn origins(cut_from: &[u32], cell: u32) -> impl Iterator<Item = u32> {
    let origin = |cell: &u32| Some(cut_from[*cell as usize]).filter(|&origin| origin != NONE);
    std::iter::successors(origin(&cell), move |cell| origin(cell))
}

/// Whether two exact triangles have more in common than the corners that they share, and the edge between these, two exact segments more than an end, or
/// an exact segment and triangle more than a corner.
fn cross(a: &Body, b: &Body) -> bool {
    if let (Nature::Exact, Nature::Exact, [Site::Segment(first)], [Site::Segment(second)]) =
        (a.nature, b.nature, a.sites.as_slice(), b.sites.as_slice())
    {
        return overlap(first, second);
    }
    for (segment, triangle) in [(a, b), (b, a)] {
        if let (Nature::Exact, [Site::Segment(ends)], Some(corners)) = (segment.nature, segment.sites.as_slice(), triangle.exact_triangle())
        {
            return runs_along(ends, corners);
        }
    }
    let (Some(first), Some(second)) = (a.exact_triangle(), b.exact_triangle()) else { return false };
    let name = |k: usize| first.iter().position(|corner| *corner == second[k]).unwrap_or(3 + k) as u32;
    meet([&[0, 1, 2], &[0, 1, 2].map(name)], [first, second])
}

/// Whether two segments that share an end run on together from it: all three ends are in a line, exactly, and the others on one side of the shared one.
fn overlap(first: &[Point; 2], second: &[Point; 2]) -> bool {
    let from = |[shared, to]: [&Point; 2], other: &Point| {
        let same_side = |axis: usize| (to[axis] > shared[axis]) == (other[axis] > shared[axis]);
        let apart = (0..3).find(|&axis| to[axis] != shared[axis]);
        is_flat(&[*shared, *to, *other]) && apart.is_some_and(|axis| other[axis] != shared[axis] && same_side(axis))
    };
    let [a, b] = first;
    let [c, d] = second;
    (a == c && from([a, b], d)) || (a == d && from([a, b], c)) || (b == c && from([b, a], d)) || (b == d && from([b, a], c))
}

/// Whether a segment that shares one end with a triangle with area runs along it from there: the other end is in the triangle's plane, exactly, and in its
/// angle at that corner, sides included. Any other segment from a corner leaves the triangle at once; one that shares both ends is a side.
fn runs_along(segment: &[Point; 2], triangle: &[Point; 3]) -> bool {
    let place = |end: &Point| triangle.iter().position(|corner| corner == end);
    let (k, other) = match segment.each_ref().map(place) {
        [Some(k), None] => (k, &segment[1]),
        [None, Some(k)] => (k, &segment[0]),
        _ => return false,
    };
    let [corner, next, last] = [0, 1, 2].map(|step| &triangle[(k + step) % 3]);
    let Some(axis) = view(triangle).filter(|_| side(corner, next, last, other) == 0.0) else { return false };
    let angle = turn(axis, corner, next, last);
    let turns = [turn(axis, corner, next, other), turn(axis, corner, other, last)];
    // Signs alone: a product of small numbers might vanish.
    turns.iter().all(|&turn| turn == 0.0 || (turn > 0.0) == (angle > 0.0))
}

/// Names of boundary cells, handed out on the way down.
struct Names<'a> {
    attractor: Option<&'a Attractor>,
    /// The cell that each was cut from.
    cut_from: Vec<u32>,
    /// Pieces of cells, by the cell and their place in its split.
    cut: HashMap<(u32, usize), u32>,
    /// Corners of given simplices, by their coordinates.
    corners: HashMap<[u64; 3], u32>,
}

impl<'a> Names<'a> {
    fn new(attractor: Option<&'a Attractor>) -> Self {
        let count = attractor.and_then(Attractor::brep).map_or(0, |(_, start)| start.count());
        Self { attractor, cut_from: vec![NONE; count], cut: HashMap::new(), corners: HashMap::new() }
    }

    fn bytes(&self) -> u64 {
        // Entries of maps with room to spare, and the lists of pieces to come.
        (64 * (self.cut.len() + self.corners.len()) + 96 * self.cut_from.len()) as u64
    }

    fn brep(&self) -> Option<&'a Topology> {
        self.attractor.and_then(Attractor::brep).map(|(topology, _)| topology)
    }

    fn fresh(cut_from: &mut Vec<u32>, origin: u32) -> u32 {
        cut_from.push(origin);
        (cut_from.len() - 1) as u32
    }

    /// The boundary cells of a root; none of a group.
    fn of_root(&mut self, tree: &Tree<'_>, id: NodeId) -> Vec<Seen> {
        let Some(cell) = tree.cell(id) else { return Vec::new() };
        let body = &tree.node(id).body;
        if body.nature == Nature::Exact {
            let named = corners(&body.sites[0]).iter().map(|corner| {
                // Minus zero is zero.
                let key = corner.map(|x| (x + 0.0).to_bits());
                (*self.corners.entry(key).or_insert_with(|| Self::fresh(&mut self.cut_from, NONE)), View::SAME)
            });
            return named.collect();
        }
        let Some((topology, start)) = self.attractor.and_then(Attractor::brep) else { return Vec::new() };
        (0..topology.state(cell.state).closure.cells.len()).map(|position| start.cell_of(cell.root as usize, position)).collect()
    }

    /// The boundary cells of every child of a node whose own are `seen`.
    fn of_children(&mut self, tree: &Tree<'_>, id: NodeId, children: Range<NodeId>, seen: &[Seen]) -> Vec<Vec<Seen>> {
        let (Some(cell), Some(topology)) = (tree.cell(id), self.brep()) else {
            return children.map(|child| self.of_root(tree, child)).collect();
        };
        let split = &topology.state(cell.state).split;
        if split.children.is_empty() {
            return vec![Vec::new(); children.len()];
        }
        let fresh: Vec<u32> = split.fresh.iter().map(|_| Self::fresh(&mut self.cut_from, NONE)).collect();
        let resolved = |names: &mut Self, source: &Source| match *source {
            Source::Vertex { cell } => seen[cell],
            Source::Fresh { index, view } => (fresh[index], view),
            Source::Piece { cell: position, piece, view } => {
                let state = topology.state(cell.state).closure.cells[position].state;
                names.piece(topology, state, seen[position], piece, view)
            }
        };
        split.children.iter().map(|sources| sources.iter().map(|source| resolved(self, source)).collect()).collect()
    }

    /// A piece of a boundary cell of a state, as a child views it.
    fn piece(&mut self, topology: &Topology, state: StateId, (origin, seen): Seen, piece: usize, view: View) -> Seen {
        let (actual, turned) = topology.piece_seen(state, seen, piece);
        let to = topology.state(state).split.pieces[actual].state;
        let name = *self.cut.entry((origin, actual)).or_insert_with(|| Self::fresh(&mut self.cut_from, origin));
        (name, topology.product(to, turned, view))
    }
}
