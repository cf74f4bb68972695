//! What a cell of the surface depends on: a small labelled mesh, in a canonical order.
//!
//! The limit of a vertex depends on the faces around it (its star), that of an edge or face on the stars of its
//! vertices. Where two infinitely sharp edges meet, or more, or at a corner, the sectors between them do not depend
//! on each other, and the edges themselves on nothing but the curve they form. A patch of Doo-Sabin belongs to a
//! vertex and depends on the faces around it, its edge on two faces, its corner on one.
//!
//! The canonical form is the least of the words that a walk writes down from each possible start: the walk visits
//! the cell's vertices in order, and around each the faces in their cyclic order, and numbers vertices as they are
//! met. Two cells get the same word if and only if their stencils are alike, labels included, since the mesh can be
//! built again from the word ([`Stencil::host`]).

use super::Scheme;
use super::host::{Host, NONE, Sharpness, Side};

/// A cell of the limit surface, by the element of the mesh that it belongs to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Cell {
    /// A patch: a face of the mesh, or a vertex (Doo-Sabin), from a half-edge of the face or of those that leave it.
    Patch(u32),
    /// A curve between two patches.
    Curve(Side),
    /// A point where patches meet: a vertex of the mesh, or a face (Doo-Sabin), by its number.
    Point(u32),
}

/// The canonical form of a cell's stencil.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Stencil {
    /// The word; see [`Walk::word`].
    word: Vec<u64>,
}

/// A cell as seen: its canonical stencil, and the mesh's vertices in the order of the stencil.
#[derive(Clone, Debug, Default)]
pub(super) struct Seen {
    pub(super) stencil: Stencil,
    pub(super) vertices: Vec<u32>,
    /// Of the possible starts, the position of the chosen one.
    pub(super) start: usize,
}

/// The kinds of cell, as they begin a word.
const PATCH: u64 = 0;
const CURVE: u64 = 1;
const POINT: u64 = 2;

/// Walks around cells of one mesh; holds buffers.
pub(super) struct Walker<'a> {
    scheme: &'a Scheme,
    host: &'a Host,
    walk: Walk,
    ahead: Vec<u32>,
    behind: Vec<u32>,
}

/// What one walk has met.
#[derive(Clone, Debug, Default)]
struct Walk {
    /// The mesh's vertices in order of their numbers.
    vertices: Vec<u32>,
    /// Faces met, by the half-edge at which each was entered.
    entries: Vec<u32>,
    faces: Vec<u32>,
    /// Edges that are sharp, by numbers of their ends.
    edges: Vec<(u32, u32, Sharpness)>,
    /// Sharpness of the cell's own vertices.
    corners: Vec<Sharpness>,
}

impl Walk {
    fn clear(&mut self) {
        self.vertices.clear();
        self.entries.clear();
        self.faces.clear();
        self.edges.clear();
        self.corners.clear();
    }

    fn number(&mut self, vertex: u32) -> u32 {
        let known = self.vertices.iter().position(|&known| known == vertex);
        known.unwrap_or_else(|| {
            self.vertices.push(vertex);
            self.vertices.len() - 1
        }) as u32
    }

    /// Numbers the vertices of a face from the origin of half-edge h on.
    fn face(&mut self, host: &Host, h: u32) {
        let face = host.face[h as usize];
        if self.faces.contains(&face) {
            return;
        }
        self.faces.push(face);
        self.entries.push(h);
        let range = host.half_edges(face);
        for corner in (h..range.end).chain(range.start..h) {
            self.number(host.origin[corner as usize]);
        }
    }

    fn edge(&mut self, from: u32, to: u32, sharpness: Sharpness) {
        if sharpness > 0.0 {
            let (a, b) = (self.number(from), self.number(to));
            let key = (a.min(b), a.max(b));
            if !self.edges.iter().any(|edge| (edge.0, edge.1) == key) {
                self.edges.push((key.0, key.1, sharpness));
            }
        }
    }

    /// kind, number of own vertices, their sharpness; number of vertices; number of faces, and of each its region,
    /// size and vertices; of each sharp edge its ends and sharpness.
    fn word(&mut self, host: &Host, kind: u64, word: &mut Vec<u64>) {
        word.clear();
        word.extend([kind, self.corners.len() as u64]);
        word.extend(self.corners.iter().map(|sharpness| sharpness.to_bits()));
        word.extend([self.vertices.len() as u64, self.faces.len() as u64]);
        for position in 0..self.faces.len() {
            let (face, h) = (self.faces[position], self.entries[position]);
            let range = host.half_edges(face);
            word.extend([u64::from(host.region[face as usize]), range.len() as u64]);
            for corner in (h..range.end).chain(range.start..h) {
                word.push(u64::from(self.number(host.origin[corner as usize])));
            }
        }
        word.extend(self.edges.iter().flat_map(|&(a, b, sharpness)| [u64::from(a), u64::from(b), sharpness.to_bits()]));
    }
}

/// Where a walk begins.
#[derive(Clone, Copy, Debug)]
enum Start {
    /// The face of a half-edge from its origin on, with the stars of its corners.
    FaceAndStars(u32),
    /// The face of a half-edge from its origin on, alone.
    Face(u32),
    /// The star of the origin of a half-edge, from its face on.
    Star(u32),
    /// An edge and the stars of its ends.
    EdgeAndStars(Side),
    /// The two faces of an edge.
    TwoFaces(Side),
    /// A vertex of a crease and its neighbours on it.
    Crease(u32, [u32; 2]),
    /// A vertex that stays.
    Corner(u32),
}

impl<'a> Walker<'a> {
    pub(super) fn new(scheme: &'a Scheme, host: &'a Host) -> Self {
        Self { scheme, host, walk: Walk::default(), ahead: Vec::new(), behind: Vec::new() }
    }

    /// The canonical form of a cell. Cost: the number of starts times the size of the stencil.
    pub(super) fn see(&mut self, cell: Cell) -> Seen {
        let kind = match cell {
            Cell::Patch(_) => PATCH,
            Cell::Curve(_) => CURVE,
            Cell::Point(_) => POINT,
        };
        let mut best = Seen::default();
        let mut word = Vec::new();
        for (position, start) in self.starts(cell).into_iter().enumerate() {
            self.walk.clear();
            self.run(start);
            self.walk.word(self.host, kind, &mut word);
            if position == 0 || word < best.stencil.word {
                std::mem::swap(&mut best.stencil.word, &mut word);
                best.vertices.clone_from(&self.walk.vertices);
                best.start = position;
            }
        }
        best
    }

    /// The half-edges of a patch in the order of its sides: around a face, or leaving a vertex (Doo-Sabin).
    pub(super) fn sides(&mut self, h: u32) -> Vec<u32> {
        if *self.scheme == Scheme::DooSabin {
            self.host.fan(h, false, &mut self.ahead, &mut self.behind);
            return self.ahead.clone();
        }
        let range = self.host.half_edges(self.host.face[h as usize]);
        (h..range.end).chain(range.start..h).collect()
    }

    fn starts(&mut self, cell: Cell) -> Vec<Start> {
        let dual = *self.scheme == Scheme::DooSabin;
        match cell {
            Cell::Patch(h) => self.sides(h).into_iter().map(if dual { Start::Star } else { Start::FaceAndStars }).collect(),
            Cell::Curve(side) => [side, side.reversed()].map(if dual { Start::TwoFaces } else { Start::EdgeAndStars }).to_vec(),
            Cell::Point(face) if dual => self.host.half_edges(face).map(Start::Face).collect(),
            Cell::Point(vertex) if self.host.is_corner(vertex) => vec![Start::Corner(vertex)],
            Cell::Point(vertex) => match self.host.crease(vertex) {
                Some([a, b]) => vec![Start::Crease(vertex, [a, b]), Start::Crease(vertex, [b, a])],
                None => {
                    let closed = self.host.fan(self.host.out[vertex as usize], false, &mut self.ahead, &mut self.behind);
                    let count = if closed { self.ahead.len() } else { 1 };
                    self.ahead[..count].iter().copied().map(Start::Star).collect()
                }
            },
        }
    }

    fn run(&mut self, start: Start) {
        let host = self.host;
        match start {
            Start::FaceAndStars(h) => {
                self.walk.face(host, h);
                let range = host.half_edges(host.face[h as usize]);
                for corner in (h..range.end).chain(range.start..h) {
                    self.star(corner);
                }
            }
            Start::Face(h) => self.walk.face(host, h),
            Start::Star(h) => {
                self.walk.number(host.origin[h as usize]);
                self.star(h);
            }
            Start::EdgeAndStars(side) => self.edge_and_stars(side),
            Start::TwoFaces(side) => {
                let h = self.leaving(side);
                self.walk.face(host, h);
                self.walk.face(host, host.twin[h as usize]);
            }
            Start::Crease(vertex, ends) => {
                self.walk.number(vertex);
                self.walk.corners.push(0.0);
                ends.iter().for_each(|&end| self.walk.edge(vertex, end, f64::INFINITY));
            }
            Start::Corner(vertex) => {
                self.walk.number(vertex);
                self.walk.corners.push(f64::INFINITY);
            }
        }
    }

    /// The star of a half-edge's origin, or its sector where the vertex is cut.
    fn star(&mut self, h: u32) {
        let host = self.host;
        let vertex = host.origin[h as usize];
        let dual = *self.scheme == Scheme::DooSabin;
        let closed = host.fan(h, !dual && host.is_cut(vertex), &mut self.ahead, &mut self.behind);
        if !dual {
            self.walk.corners.push(host.corner[vertex as usize]);
        }
        for &leaving in self.ahead.iter().chain(&self.behind) {
            self.walk.face(host, leaving);
            self.walk.edge(vertex, host.destination(leaving), host.sharpness[leaving as usize]);
        }
        if !closed {
            let last = host.previous(self.ahead[self.ahead.len() - 1]);
            self.walk.edge(vertex, host.origin[last as usize], host.sharpness[last as usize]);
        }
    }

    fn edge_and_stars(&mut self, side: Side) {
        let host = self.host;
        self.walk.number(side.from);
        self.walk.number(side.to);
        let sharpness = host.side_sharpness(&side);
        self.walk.edge(side.from, side.to, sharpness);
        for side in [side, side.reversed()] {
            let vertex = side.from;
            if sharpness.is_infinite() && host.is_cut(vertex) {
                // The curve alone.
                self.walk.corners.push(host.corner[vertex as usize]);
                for end in host.crease(vertex).into_iter().flatten() {
                    self.walk.edge(vertex, end, f64::INFINITY);
                }
                continue;
            }
            match self.leaving(side) {
                NONE => self.star(host.next(side.half_edge)),
                h => self.star(h),
            }
        }
    }

    /// The half-edge of a side that leaves its start, if there is one.
    fn leaving(&self, side: Side) -> u32 {
        let h = side.half_edge;
        if self.host.origin[h as usize] == side.from { h } else { self.host.twin[h as usize] }
    }
}

impl Stencil {
    /// Number of vertices: the dimension of the cell's state.
    pub(super) fn vertices(&self) -> usize {
        self.word[2 + self.word[1] as usize] as usize
    }

    /// The stencil as a mesh of its own, and the cell in it: its vertices are in canonical order.
    pub(super) fn host(&self, scheme: &Scheme) -> (Host, Cell) {
        let mut word = self.word.iter().copied();
        let mut next = || word.next().unwrap_or(0);
        let (kind, own) = (next(), next() as usize);
        let corners: Vec<f64> = (0..own).map(|_| f64::from_bits(next())).collect();
        let (vertices, count) = (next() as usize, next() as usize);
        let (mut faces, mut region) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for _ in 0..count {
            region.push(next() as u32);
            let size = next();
            faces.push((0..size).map(|_| next() as u32).collect::<Vec<u32>>());
        }
        let edges: Vec<u64> = word.collect();
        let mut host = Host::new(vertices, &faces, region);
        host.corner[..own].copy_from_slice(&corners);
        for edge in edges.chunks_exact(3) {
            let (from, to) = (edge[0] as u32, edge[1] as u32);
            match host.side_between(from, to) {
                Some(side) => host.sharpen(side.half_edge, f64::from_bits(edge[2])),
                None => host.wires.push([from, to]),
            }
        }
        let host = host.complete();
        let cell = match kind {
            PATCH => Cell::Patch(0),
            CURVE => Cell::Curve(host.side_between(0, 1).expect("a curve's stencil holds its edge")),
            _ => Cell::Point(0),
        };
        debug_assert!(*scheme != Scheme::DooSabin || own == 0);
        (host, cell)
    }
}
