//! Polygon meshes with labels, as half-edges: a whole cage, or the small mesh of a stencil.

use std::collections::BTreeMap;

/// No half-edge.
pub(super) const NONE: u32 = u32::MAX;

/// How sharp an edge or vertex is: 0 smooth, infinite for ever, between them for so many steps.
pub(super) type Sharpness = f64;

/// The sharpness one subdivision later (OpenSubdiv's uniform rule).
pub(super) fn decayed(sharpness: Sharpness) -> Sharpness {
    (sharpness - 1.0).max(0.0)
}

/// An oriented edge between two vertices, with a half-edge of it if a face has one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Side {
    pub(super) from: u32,
    pub(super) to: u32,
    /// From `from` to `to` or back; [`NONE`] for a wire.
    pub(super) half_edge: u32,
}

impl Side {
    /// The same edge from its other end.
    pub(super) fn reversed(self) -> Self {
        Self { from: self.to, to: self.from, half_edge: self.half_edge }
    }
}

/// A mesh of polygons: half-edge h runs from `origin[h]` along face `face[h]`; the half-edges of a face are
/// consecutive. A mesh of a stencil may have edges without a face (wires): curves that depend on nothing else.
#[derive(Clone, Debug, Default)]
pub(super) struct Host {
    pub(super) vertices: usize,
    /// First half-edge of every face, and the number of half-edges.
    pub(super) first: Vec<u32>,
    /// Region of every face.
    pub(super) region: Vec<u32>,
    pub(super) origin: Vec<u32>,
    pub(super) face: Vec<u32>,
    pub(super) twin: Vec<u32>,
    /// By half-edge.
    pub(super) sharpness: Vec<Sharpness>,
    /// Edges without a face; all are infinitely sharp.
    pub(super) wires: Vec<[u32; 2]>,
    /// By vertex.
    pub(super) corner: Vec<Sharpness>,
    /// A half-edge that leaves each vertex: the last one against the clock where the faces do not close.
    pub(super) out: Vec<u32>,
    /// Number of infinitely sharp edges at every vertex, and whether others are sharp for a while.
    sharp: Vec<(u32, bool)>,
    /// The other ends of the first two infinitely sharp edges.
    creases: Vec<[u32; 2]>,
}

impl Host {
    /// The mesh of these faces; two half-edges of opposite direction are twins. Every directed edge occurs once.
    pub(super) fn new(vertices: usize, faces: &[Vec<u32>], region: Vec<u32>) -> Self {
        let mut host = Self { vertices, region, corner: vec![0.0; vertices], ..Self::default() };
        for (index, face) in faces.iter().enumerate() {
            host.first.push(host.origin.len() as u32);
            host.origin.extend(face);
            host.face.resize(host.origin.len(), index as u32);
        }
        host.first.push(host.origin.len() as u32);
        let count = host.origin.len();
        host.twin = vec![NONE; count];
        host.sharpness = vec![0.0; count];
        let mut keys: Vec<(u32, u32, u32)> = (0..count as u32)
            .map(|h| {
                let (a, b) = (host.origin[h as usize], host.destination(h));
                (a.min(b), a.max(b), h)
            })
            .collect();
        keys.sort_unstable();
        for pair in keys.windows(2) {
            let ((a, b, g), (c, d, h)) = (pair[0], pair[1]);
            if (a, b) == (c, d) && host.origin[g as usize] != host.origin[h as usize] {
                host.twin[g as usize] = h;
                host.twin[h as usize] = g;
            }
        }
        host
    }

    /// The half-edges of a face.
    pub(super) fn half_edges(&self, face: u32) -> std::ops::Range<u32> {
        self.first[face as usize]..self.first[face as usize + 1]
    }

    /// Number of sides of a face.
    pub(super) fn sides(&self, face: u32) -> usize {
        self.half_edges(face).len()
    }

    /// Number of faces.
    pub(super) fn faces(&self) -> usize {
        self.first.len().saturating_sub(1)
    }

    pub(super) fn next(&self, h: u32) -> u32 {
        let range = self.half_edges(self.face[h as usize]);
        if h + 1 == range.end { range.start } else { h + 1 }
    }

    pub(super) fn previous(&self, h: u32) -> u32 {
        let range = self.half_edges(self.face[h as usize]);
        if h == range.start { range.end - 1 } else { h - 1 }
    }

    pub(super) fn destination(&self, h: u32) -> u32 {
        self.origin[self.next(h) as usize]
    }

    /// The next half-edge counterclockwise around its origin, or [`NONE`] at the end of the faces.
    pub(super) fn counterclockwise(&self, h: u32) -> u32 {
        self.twin[self.previous(h) as usize]
    }

    /// The next half-edge clockwise around its origin, or [`NONE`] at the end of the faces.
    pub(super) fn clockwise(&self, h: u32) -> u32 {
        match self.twin[h as usize] {
            NONE => NONE,
            twin => self.next(twin),
        }
    }

    /// The edge of a half-edge.
    pub(super) fn side(&self, h: u32) -> Side {
        Side { from: self.origin[h as usize], to: self.destination(h), half_edge: h }
    }

    /// The edge between two vertices, if there is one. Linear in the mesh.
    pub(super) fn side_between(&self, from: u32, to: u32) -> Option<Side> {
        let matches = |&h: &u32| {
            let (a, b) = (self.origin[h as usize], self.destination(h));
            (a, b) == (from, to) || (b, a) == (from, to)
        };
        let half_edge = (0..self.origin.len() as u32).find(matches);
        let wire = || self.wires.iter().any(|wire| *wire == [from, to] || *wire == [to, from]).then_some(NONE);
        half_edge.or_else(wire).map(|half_edge| Side { from, to, half_edge })
    }

    pub(super) fn side_sharpness(&self, side: &Side) -> Sharpness {
        if side.half_edge == NONE { f64::INFINITY } else { self.sharpness[side.half_edge as usize] }
    }

    /// Makes an edge this sharp, seen from both faces.
    pub(super) fn sharpen(&mut self, h: u32, sharpness: Sharpness) {
        self.sharpness[h as usize] = sharpness;
        if self.twin[h as usize] != NONE {
            let twin = self.twin[h as usize];
            self.sharpness[twin as usize] = sharpness;
        }
    }

    /// Works out what is derived from faces and labels; to be called when these are final.
    pub(super) fn complete(mut self) -> Self {
        self.sharp = vec![(0, false); self.vertices];
        self.creases = vec![[NONE; 2]; self.vertices];
        let edges = (0..self.origin.len() as u32).filter(|&h| h < self.twin[h as usize]).map(|h| {
            let side = self.side(h);
            (side.from, side.to, self.sharpness[h as usize])
        });
        let sharp: Vec<_> = edges.filter(|edge| edge.2 > 0.0).collect();
        for (a, b, sharpness) in sharp.into_iter().chain(self.wires.clone().into_iter().map(|[a, b]| (a, b, f64::INFINITY))) {
            for (vertex, other) in [(a, b), (b, a)] {
                let (count, passing) = &mut self.sharp[vertex as usize];
                if sharpness.is_finite() {
                    *passing = true;
                } else {
                    if let Some(place) = self.creases[vertex as usize].get_mut(*count as usize) {
                        *place = other;
                    }
                    *count += 1;
                }
            }
        }
        self.out = vec![NONE; self.vertices];
        for h in 0..self.origin.len() as u32 {
            let vertex = self.origin[h as usize] as usize;
            // Where the faces end clockwise, the walk counterclockwise begins.
            if self.out[vertex] == NONE || self.twin[h as usize] == NONE {
                self.out[vertex] = h;
            }
        }
        self
    }

    /// Number of infinitely sharp edges at a vertex.
    pub(super) fn infinite_edges(&self, vertex: u32) -> u32 {
        self.sharp[vertex as usize].0
    }

    /// Whether the vertex stays where it is.
    pub(super) fn is_corner(&self, vertex: u32) -> bool {
        self.corner[vertex as usize].is_infinite()
    }

    /// The two neighbours on which a vertex of a crease depends for ever, and on nothing else.
    pub(super) fn crease(&self, vertex: u32) -> Option<[u32; 2]> {
        let alone = self.corner[vertex as usize] == 0.0 && self.sharp[vertex as usize] == (2, false);
        alone.then(|| self.creases[vertex as usize])
    }

    /// Whether faces on different sides of infinitely sharp edges at this vertex do not depend on each other.
    pub(super) fn is_cut(&self, vertex: u32) -> bool {
        self.is_corner(vertex) || self.crease(vertex).is_some()
    }

    /// The faces around a vertex from half-edge `start` that leaves it: the half-edges counterclockwise from it,
    /// then those clockwise, and whether the faces close. Sharp edges end the walk when `cut`.
    pub(super) fn fan(&self, start: u32, cut: bool, ahead: &mut Vec<u32>, behind: &mut Vec<u32>) -> bool {
        let ends = |edge: u32| cut && self.sharpness[edge as usize].is_infinite();
        ahead.clear();
        behind.clear();
        ahead.push(start);
        let mut h = start;
        // No fan is longer than the mesh.
        while !ends(self.previous(h)) && ahead.len() <= self.origin.len() {
            h = self.counterclockwise(h);
            if h == start {
                return true;
            }
            if h == NONE {
                break;
            }
            ahead.push(h);
        }
        h = start;
        while !ends(h) && behind.len() <= self.origin.len() {
            h = self.clockwise(h);
            if h == NONE {
                break;
            }
            behind.push(h);
        }
        false
    }
}

/// Vertices by number, for looking up edges of a whole cage.
pub(super) fn edge_index(host: &Host) -> BTreeMap<(u32, u32), u32> {
    (0..host.origin.len() as u32)
        .map(|h| {
            let side = host.side(h);
            ((side.from.min(side.to), side.from.max(side.to)), h)
        })
        .collect()
}
