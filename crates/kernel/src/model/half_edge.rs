//! Polygon meshes as half-edges: who is beside whom.
//!
//! Every side of every face is a half-edge, directed as its face runs; the half-edges of a face stand in a row, so
//! next and previous need no memory, and the one table that matters says which half-edge runs the other way along the
//! same edge. Source: K. Weiler, Edge-based data structures for solid modeling in curved-surface environments, IEEE
//! CG&A 5(1), 1985; in rows as in M. Campagna, L. Kobbelt, H.-P. Seidel, Directed edges, J. Graphics Tools 3(4), 1998.

use std::fmt;

/// A side of a face, directed from its origin to its target with the face on its left.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct HalfEdge(u32);

impl HalfEdge {
    /// Its number, from 0: the sides of face 0 first.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// An oriented polygon mesh that is a 2-manifold with or without boundary, known by its connections alone.
///
/// Invariants, proven by [`HalfEdgeMesh::new`]: every face has three corners or more, all different; every edge has
/// one face, or two that run along it in opposite directions; the faces at every vertex form one fan, closed or open;
/// every vertex has a face. Memory: 16 bytes per half-edge and 4 per vertex.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HalfEdgeMesh {
    /// Half-edges of face f are `first[f]..first[f + 1]`.
    first: Vec<u32>,
    origin: Vec<u32>,
    face: Vec<u32>,
    /// [`NONE`] on the boundary.
    twin: Vec<u32>,
    /// A half-edge that leaves each vertex; the boundary's where there is one, so that fans are walked whole.
    outgoing: Vec<u32>,
}

const NONE: u32 = u32::MAX;

/// Faults of one mesh are listed up to this number.
const MOST_FAULTS: usize = 20;

/// Why polygons are no oriented 2-manifold, with the place. Numbers of faces, corners and vertices count from 0.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MeshFault {
    /// There is no face.
    Empty,
    /// More corners than 32-bit indices can count.
    TooLarge {
        /// The corners of all faces together.
        corners: usize,
    },
    /// A face has fewer than three corners.
    FewCorners {
        /// The face.
        face: usize,
        /// How many it has.
        corners: usize,
    },
    /// A face names a vertex that does not exist.
    NoSuchVertex {
        /// The face.
        face: usize,
        /// The vertex.
        vertex: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A face visits a vertex twice.
    RepeatedVertex {
        /// The face.
        face: usize,
        /// The vertex.
        vertex: u32,
    },
    /// An edge has more than two faces.
    NonManifoldEdge {
        /// Its vertices.
        edge: [u32; 2],
        /// How many faces it has.
        count: usize,
        /// The first three of them.
        faces: [usize; 3],
    },
    /// Two faces run along an edge in the same direction.
    Orientation {
        /// The edge, from its origin to its target.
        edge: [u32; 2],
        /// The faces.
        faces: [usize; 2],
    },
    /// The faces at a vertex form more than one fan (a bow-tie).
    BowTie {
        /// The vertex.
        vertex: u32,
        /// Faces of two fans that meet there only.
        faces: [usize; 2],
    },
    /// A vertex has no face.
    IsolatedVertex {
        /// The vertex.
        vertex: u32,
    },
}

impl MeshFault {
    /// A stable code for programs.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Empty => "mesh.empty",
            Self::TooLarge { .. } => "mesh.too-large",
            Self::FewCorners { .. } => "mesh.face-corners",
            Self::NoSuchVertex { .. } => "mesh.index",
            Self::RepeatedVertex { .. } => "mesh.repeated-vertex",
            Self::NonManifoldEdge { .. } => "mesh.non-manifold-edge",
            Self::Orientation { .. } => "mesh.inconsistent-orientation",
            Self::BowTie { .. } => "mesh.bow-tie",
            Self::IsolatedVertex { .. } => "mesh.isolated-vertex",
        }
    }

    /// Where, as a JSON pointer relative to an object with `vertices` and `faces`.
    #[must_use]
    pub fn pointer(&self) -> String {
        match self {
            Self::Empty | Self::TooLarge { .. } => "/faces".to_owned(),
            Self::FewCorners { face, .. } | Self::NoSuchVertex { face, .. } | Self::RepeatedVertex { face, .. } => format!("/faces/{face}"),
            Self::NonManifoldEdge { faces: [.., last], .. } | Self::Orientation { faces: [_, last], .. } => format!("/faces/{last}"),
            Self::BowTie { vertex, .. } | Self::IsolatedVertex { vertex } => format!("/vertices/{vertex}"),
        }
    }
}

impl fmt::Display for MeshFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => f.write_str("the mesh has no face"),
            Self::TooLarge { corners } => write!(f, "the faces have {corners} corners together; {} are allowed", NONE - 1),
            Self::FewCorners { face, corners } => write!(f, "face {face} has {corners} corners, and needs three or more"),
            Self::NoSuchVertex { face, vertex, vertices } => {
                write!(f, "face {face} names vertex {vertex}, which does not exist: there are {vertices}")
            }
            Self::RepeatedVertex { face, vertex } => write!(f, "face {face} visits vertex {vertex} twice; split it there"),
            Self::NonManifoldEdge { edge: [a, b], count, faces } => write!(
                f,
                "the edge {a} - {b} has {count} faces, {} and {} and {} first; an edge has one or two",
                faces[0], faces[1], faces[2]
            ),
            Self::Orientation { edge: [a, b], faces: [first, second] } => {
                write!(f, "faces {first} and {second} both run from {a} to {b} along the edge they share; reverse one of them")
            }
            Self::BowTie { vertex, faces: [first, second] } => {
                write!(f, "faces {first} and {second} meet in vertex {vertex} only (a bow-tie); give each fan a vertex of its own")
            }
            Self::IsolatedVertex { vertex } => write!(f, "vertex {vertex} belongs to no face; remove it"),
        }
    }
}

impl HalfEdgeMesh {
    /// Connects the faces of a mesh; each lists its corners counter-clockwise seen from outside.
    ///
    /// Sorts the sides: O(n log n) for n corners, whatever the valences.
    ///
    /// # Errors
    /// Faults with their places, at most 20 and at least one: of single faces first; of edges if every face is
    /// legal; of vertices if every edge is.
    pub fn new(vertices: usize, faces: &[Vec<u32>]) -> Result<Self, Vec<MeshFault>> {
        let corners: usize = faces.iter().map(Vec::len).sum();
        if faces.is_empty() {
            return Err(vec![MeshFault::Empty]);
        }
        if corners.max(vertices) >= NONE as usize {
            return Err(vec![MeshFault::TooLarge { corners }]);
        }
        listed(faces.iter().enumerate().filter_map(|(index, face)| face_fault(index, face, vertices)))?;
        let mut first = Vec::with_capacity(faces.len() + 1);
        let (mut origin, mut face_of) = (Vec::with_capacity(corners), Vec::with_capacity(corners));
        for (index, face) in faces.iter().enumerate() {
            first.push(origin.len() as u32);
            origin.extend_from_slice(face);
            face_of.resize(origin.len(), index as u32);
        }
        first.push(origin.len() as u32);
        let mut mesh = Self { first, origin, face: face_of, twin: vec![NONE; corners], outgoing: vec![NONE; vertices] };
        mesh.pair()?;
        mesh.fans()?;
        Ok(mesh)
    }

    /// Finds every half-edge's twin.
    fn pair(&mut self) -> Result<(), Vec<MeshFault>> {
        let mut sides: Vec<(u32, u32, HalfEdge)> = self
            .half_edges()
            .map(|half_edge| {
                let (a, b) = (self.origin(half_edge), self.target(half_edge));
                (a.min(b), a.max(b), half_edge)
            })
            .collect();
        sides.sort_unstable();
        let mut faults = Vec::new();
        for edge in sides.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            match *edge {
                [_] => {}
                [(_, _, one), (_, _, other)] if self.origin(one) != self.origin(other) => {
                    self.twin[one.index()] = other.0;
                    self.twin[other.index()] = one.0;
                }
                [(_, _, one), (_, _, other)] => faults
                    .push(MeshFault::Orientation { edge: [self.origin(one), self.target(one)], faces: [self.face(one), self.face(other)] }),
                [(a, b, one), (_, _, second), (_, _, third), ..] => faults.push(MeshFault::NonManifoldEdge {
                    edge: [a, b],
                    count: edge.len(),
                    faces: [self.face(one), self.face(second), self.face(third)],
                }),
                [] => {}
            }
            if faults.len() == MOST_FAULTS {
                break;
            }
        }
        if faults.is_empty() { Ok(()) } else { Err(faults) }
    }

    /// Finds where every vertex's fan begins, and proves that it has one.
    fn fans(&mut self) -> Result<(), Vec<MeshFault>> {
        let mut leaving = vec![0_u32; self.outgoing.len()];
        for half_edge in 0..self.origin.len() {
            let vertex = self.origin[half_edge] as usize;
            leaving[vertex] += 1;
            if self.outgoing[vertex] == NONE || self.twin[half_edge] == NONE {
                self.outgoing[vertex] = half_edge as u32;
            }
        }
        listed((0..self.outgoing.len() as u32).filter_map(|vertex| {
            if self.outgoing[vertex as usize] == NONE {
                return Some(MeshFault::IsolatedVertex { vertex });
            }
            // The step to the next half-edge is injective, so the walk meets no half-edge twice: it ends at the
            // boundary or where it began, and one fan is all of them exactly if it has their number.
            (self.around(vertex).count() as u32 != leaving[vertex as usize]).then(|| self.bow_tie(vertex))
        }))
    }

    fn bow_tie(&self, vertex: u32) -> MeshFault {
        let mut fan: Vec<usize> = self.around(vertex).map(|half_edge| self.face(half_edge)).collect();
        let known = fan[0];
        // It may be as large as the mesh.
        fan.sort_unstable();
        let mut at_vertex = self.half_edges().filter(|&half_edge| self.origin(half_edge) == vertex).map(|half_edge| self.face(half_edge));
        let other = at_vertex.find(|face| fan.binary_search(face).is_err()).expect("a fan that is not all faces leaves one out");
        MeshFault::BowTie { vertex, faces: [known.min(other), known.max(other)] }
    }

    /// The number of vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.outgoing.len()
    }

    /// The number of faces.
    #[must_use]
    pub fn face_count(&self) -> usize {
        self.first.len() - 1
    }

    /// The number of edges: one for every pair of half-edges, one for every half-edge of the boundary.
    #[must_use]
    pub fn edge_count(&self) -> usize {
        let boundary = self.twin.iter().filter(|&&twin| twin == NONE).count();
        (self.twin.len() + boundary) / 2
    }

    /// Vertices - edges + faces.
    #[must_use]
    pub fn euler(&self) -> i64 {
        self.vertex_count() as i64 - self.edge_count() as i64 + self.face_count() as i64
    }

    /// All half-edges, face by face.
    pub fn half_edges(&self) -> impl ExactSizeIterator<Item = HalfEdge> + use<> {
        (0..self.origin.len() as u32).map(HalfEdge)
    }

    /// The corners of a face, as it was given.
    #[must_use]
    pub fn corners(&self, face: usize) -> &[u32] {
        &self.origin[self.first[face] as usize..self.first[face + 1] as usize]
    }

    /// The half-edges of a face, in order; the k-th leaves its k-th corner.
    pub fn sides(&self, face: usize) -> impl ExactSizeIterator<Item = HalfEdge> + use<> {
        (self.first[face]..self.first[face + 1]).map(HalfEdge)
    }

    /// The face on the left of a half-edge.
    #[must_use]
    pub fn face(&self, half_edge: HalfEdge) -> usize {
        self.face[half_edge.index()] as usize
    }

    /// The vertex that a half-edge leaves.
    #[must_use]
    pub fn origin(&self, half_edge: HalfEdge) -> u32 {
        self.origin[half_edge.index()]
    }

    /// The vertex that a half-edge leads to.
    #[must_use]
    pub fn target(&self, half_edge: HalfEdge) -> u32 {
        self.origin(self.next(half_edge))
    }

    /// The half-edge that follows on the same face.
    #[must_use]
    pub fn next(&self, half_edge: HalfEdge) -> HalfEdge {
        let face = self.face(half_edge);
        let next = half_edge.0 + 1;
        HalfEdge(if next == self.first[face + 1] { self.first[face] } else { next })
    }

    /// The half-edge that comes before on the same face.
    #[must_use]
    pub fn previous(&self, half_edge: HalfEdge) -> HalfEdge {
        let face = self.face(half_edge);
        HalfEdge(if half_edge.0 == self.first[face] { self.first[face + 1] - 1 } else { half_edge.0 - 1 })
    }

    /// The half-edge that runs the other way along the same edge; `None` on the boundary.
    #[must_use]
    pub fn twin(&self, half_edge: HalfEdge) -> Option<HalfEdge> {
        Some(self.twin[half_edge.index()]).filter(|&twin| twin != NONE).map(HalfEdge)
    }

    /// The face across a half-edge; `None` on the boundary.
    #[must_use]
    pub fn neighbour(&self, half_edge: HalfEdge) -> Option<usize> {
        self.twin(half_edge).map(|twin| self.face(twin))
    }

    /// The half-edges that leave a vertex, counter-clockwise, one for each of its faces; at the boundary the first is
    /// the boundary's, and the last face's other side ends the fan.
    pub fn around(&self, vertex: u32) -> impl Iterator<Item = HalfEdge> + '_ {
        let start = HalfEdge(self.outgoing[vertex as usize]);
        std::iter::successors(Some(start), move |&half_edge| self.twin(self.previous(half_edge)).filter(|&next| next != start))
    }

    /// The vertices that an edge joins with this one, counter-clockwise; at the boundary from its next vertex to its last.
    pub fn neighbours(&self, vertex: u32) -> impl Iterator<Item = u32> + '_ {
        let last = self.around(vertex).last().map(|half_edge| self.previous(half_edge));
        let open = last.filter(|&half_edge| self.twin(half_edge).is_none()).map(|half_edge| self.origin(half_edge));
        self.around(vertex).map(|half_edge| self.target(half_edge)).chain(open)
    }

    /// The number of edges at a vertex.
    #[must_use]
    pub fn valence(&self, vertex: u32) -> usize {
        self.around(vertex).count() + usize::from(self.is_boundary(vertex))
    }

    /// Whether a vertex is on the boundary.
    #[must_use]
    pub fn is_boundary(&self, vertex: u32) -> bool {
        self.twin[self.outgoing[vertex as usize] as usize] == NONE
    }

    /// The half-edge from one vertex to another, if a face has it. Linear in the valence.
    #[must_use]
    pub fn find(&self, from: u32, to: u32) -> Option<HalfEdge> {
        self.around(from).find(|&half_edge| self.target(half_edge) == to)
    }

    /// The boundary as closed loops of half-edges, the mesh on their left, each begun at its lowest half-edge.
    #[must_use]
    pub fn boundary_loops(&self) -> Vec<Vec<HalfEdge>> {
        let mut seen = vec![false; self.origin.len()];
        let mut loops = Vec::new();
        for start in self.half_edges().filter(|&half_edge| self.twin(half_edge).is_none()) {
            let mut one = Vec::new();
            let mut here = start;
            // A boundary vertex has one fan, so one boundary half-edge leaves it: the walk is a permutation's cycle.
            while !std::mem::replace(&mut seen[here.index()], true) {
                one.push(here);
                here = HalfEdge(self.outgoing[self.target(here) as usize]);
            }
            if !one.is_empty() {
                loops.push(one);
            }
        }
        loops
    }
}

/// The first faults of many, if there are any.
fn listed(faults: impl Iterator<Item = MeshFault>) -> Result<(), Vec<MeshFault>> {
    let faults: Vec<MeshFault> = faults.take(MOST_FAULTS).collect();
    if faults.is_empty() { Ok(()) } else { Err(faults) }
}

fn face_fault(index: usize, face: &[u32], vertices: usize) -> Option<MeshFault> {
    if face.len() < 3 {
        return Some(MeshFault::FewCorners { face: index, corners: face.len() });
    }
    if let Some(&vertex) = face.iter().find(|&&vertex| vertex as usize >= vertices) {
        return Some(MeshFault::NoSuchVertex { face: index, vertex, vertices });
    }
    let mut sorted = face.to_vec();
    sorted.sort_unstable();
    let pair = sorted.windows(2).find(|pair| pair[0] == pair[1])?;
    Some(MeshFault::RepeatedVertex { face: index, vertex: pair[0] })
}
