//! What is written: one view on solids, parts and evaluations that every encoder shares.

use super::error::{FormatError, Place};
use super::read::{each_face, face_count};
use super::{Carries, text};
use glam::DVec3;
use lacuna_kernel::model::polygon::PolygonRun;
use lacuna_kernel::solid::{Solid, TriMesh};
use lacuna_kernel::tessellation::{Normals, Tessellation};

/// A mesh and the name under which a file shows it.
#[derive(Clone, Copy, Debug)]
pub struct NamedMesh<'a> {
    /// Its name, in any characters.
    pub name: &'a str,
    /// Its closed mesh, in mm.
    pub mesh: &'a TriMesh,
}

/// Something to write.
#[derive(Clone, Copy, Debug)]
pub enum Geometry<'a> {
    /// One closed mesh, with as many components and cavities as it has, as one object. Its
    /// coordinates must be single-precision numbers.
    Solid(&'a TriMesh),
    /// Closed meshes that stay apart where the format has objects (3MF, GLB, OBJ). Their
    /// coordinates must be single-precision numbers.
    Parts(&'a [NamedMesh<'a>]),
    /// Triangles, segments and points of an evaluation; coordinates are rounded to single
    /// precision, 6e-8 of their size.
    Sample(&'a Tessellation),
    /// A mesh with its polygons, as it was read; they stay polygons where the format has them (OBJ, PLY, OFF, VRML).
    Polygons {
        /// The mesh; coordinates are rounded to single precision.
        mesh: &'a TriMesh,
        /// Which of its triangles are polygons.
        polygons: &'a [PolygonRun],
        /// Whether it is proven to be a closed 2-manifold.
        closed: bool,
    },
}

impl<'a> From<&'a TriMesh> for Geometry<'a> {
    fn from(mesh: &'a TriMesh) -> Self {
        Self::Solid(mesh)
    }
}

impl<'a> From<&'a Solid> for Geometry<'a> {
    fn from(solid: &'a Solid) -> Self {
        Self::Solid(solid.mesh())
    }
}

impl<'a> From<&'a Tessellation> for Geometry<'a> {
    fn from(tessellation: &'a Tessellation) -> Self {
        Self::Sample(tessellation)
    }
}

impl<'a> From<&'a [NamedMesh<'a>]> for Geometry<'a> {
    fn from(parts: &'a [NamedMesh<'a>]) -> Self {
        Self::Parts(parts)
    }
}

/// A run of vertices and what is strung over them.
#[derive(Clone, Copy)]
pub(crate) struct Piece<'a> {
    pub(crate) name: Option<&'a str>,
    pub(crate) vertices: &'a [DVec3],
    pub(crate) triangles: &'a [[u32; 3]],
    /// Which triangles are polygons.
    polygons: &'a [PolygonRun],
    pub(crate) segments: &'a [[u32; 2]],
    pub(crate) points: &'a [u32],
    /// At the corners of the triangles.
    pub(crate) normals: Option<&'a Normals>,
    /// Whether the coordinates must be single-precision numbers already.
    exact: bool,
}

impl<'a> Piece<'a> {
    fn closed(name: Option<&'a str>, mesh: &'a TriMesh) -> Self {
        Self {
            name,
            vertices: &mesh.vertices,
            triangles: &mesh.triangles,
            polygons: &[],
            segments: &[],
            points: &[],
            normals: None,
            exact: true,
        }
    }
}

impl Piece<'_> {
    /// Hands over the corners of every face in turn, polygons whole.
    pub(crate) fn each_face(&self, take: impl FnMut(&[u32]) -> Result<(), FormatError>) -> Result<(), FormatError> {
        each_face(self.triangles, self.polygons, take)
    }

    /// The most corners that a face has; 3 without faces.
    pub(crate) fn most_corners(&self) -> u32 {
        self.polygons.iter().map(|polygon| polygon.count).max().unwrap_or(1) + 2
    }

    /// Whether the mesh bounds material, so that only its outside need be seen.
    pub(crate) fn is_closed(&self) -> bool {
        self.exact
    }
}

impl<'a> Geometry<'a> {
    /// The kinds of content that it holds.
    #[must_use]
    pub fn content(&self) -> Carries {
        match self {
            Self::Solid(mesh) => Carries { solid: !mesh.triangles.is_empty(), ..Carries::default() },
            Self::Parts(parts) => Carries { solid: parts.iter().any(|part| !part.mesh.triangles.is_empty()), ..Carries::default() },
            Self::Sample(sample) => Carries {
                solid: false,
                surface: !sample.triangles.is_empty(),
                wires: !sample.segments.is_empty(),
                points: !sample.points.is_empty(),
            },
            Self::Polygons { mesh, closed, .. } => {
                let filled = !mesh.triangles.is_empty();
                Carries { solid: filled && *closed, surface: filled && !*closed, ..Carries::default() }
            }
        }
    }

    /// Its pieces in order; parts without triangles are left out, because a 3MF object without
    /// any is not legal.
    pub(crate) fn pieces(&self) -> Vec<Piece<'a>> {
        match self {
            Self::Solid(mesh) => vec![Piece::closed(None, mesh)],
            Self::Parts(parts) => {
                let filled = parts.iter().filter(|part| !part.mesh.triangles.is_empty());
                filled.map(|part| Piece::closed(Some(part.name), part.mesh)).collect()
            }
            Self::Sample(sample) => vec![Piece {
                name: None,
                vertices: &sample.vertices,
                triangles: &sample.triangles,
                polygons: &[],
                segments: &sample.segments,
                points: &sample.points,
                normals: sample.normals.as_deref(),
                exact: false,
            }],
            Self::Polygons { mesh, polygons, .. } => vec![Piece { polygons, exact: false, ..Piece::closed(None, mesh) }],
        }
    }
}

/// A piece with one normal for each vertex: vertices on creases occur once for every side.
pub(crate) struct Split {
    /// Vertices added at the end: of which each is a copy.
    pub(crate) copies: Vec<u32>,
    /// Of the piece's vertices, then of the copies.
    pub(crate) normals: Vec<DVec3>,
    /// The triangles over all of them.
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Split {
    /// `None` for pieces without normals. Linear, but for vertices with many normals.
    pub(crate) fn of(piece: &Piece<'_>) -> Option<Self> {
        const NONE: u32 = u32::MAX;
        let given = piece.normals?;
        let count = piece.vertices.len();
        // The normal of every vertex, and its next copy.
        let (mut normal, mut next) = (vec![NONE; count], vec![NONE; count]);
        let mut copies = Vec::new();
        let mut place = |vertex: u32, wanted: u32| {
            let mut current = vertex as usize;
            loop {
                if normal[current] == NONE || normal[current] == wanted {
                    normal[current] = wanted;
                    return current as u32;
                }
                if next[current] == NONE {
                    next[current] = normal.len() as u32;
                    copies.push(vertex);
                    normal.push(wanted);
                    next.push(NONE);
                    return normal.len() as u32 - 1;
                }
                current = next[current] as usize;
            }
        };
        let triangles = piece.triangles.iter().zip(&given.triangles);
        let triangles = triangles.map(|(corners, normals)| std::array::from_fn(|k| place(corners[k], normals[k]))).collect();
        // Vertices of no triangle have none; formats want unit vectors.
        let normals = normal.into_iter().map(|index| given.vectors.get(index as usize).copied().unwrap_or(DVec3::Z)).collect();
        Some(Self { copies, normals, triangles })
    }
}

/// How many elements the pieces have together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) vertices: u64,
    pub(crate) triangles: u64,
    /// Triangles and polygons.
    pub(crate) faces: u64,
    pub(crate) segments: u64,
    pub(crate) points: u64,
}

pub(crate) fn counts(pieces: &[Piece<'_>]) -> Counts {
    pieces.iter().fold(Counts::default(), |sum, piece| Counts {
        vertices: sum.vertices + piece.vertices.len() as u64,
        triangles: sum.triangles + piece.triangles.len() as u64,
        faces: sum.faces + face_count(piece.triangles, piece.polygons),
        segments: sum.segments + piece.segments.len() as u64,
        points: sum.points + piece.points.len() as u64,
    })
}

/// Refuses coordinates and indices that no file should hold. One pass, before the first byte, so
/// that a refusal leaves the sink untouched.
pub(crate) fn check(pieces: &[Piece<'_>]) -> Result<(), FormatError> {
    let mut before = Counts::default();
    for piece in pieces {
        for (vertex, position) in (before.vertices..).zip(piece.vertices) {
            check_position(position, vertex, piece.exact)?;
        }
        let vertices = piece.vertices.len() as u64;
        let out_of_range = |place, index: u32| FormatError::IndexOutOfRange { place, index: i64::from(index), vertices };
        let beyond = |index: &&u32| u64::from(**index) >= vertices;
        for (triangle, corners) in (before.triangles..).zip(piece.triangles) {
            if let Some(&index) = corners.iter().find(beyond) {
                return Err(out_of_range(Place::Triangle(triangle), index));
            }
        }
        if let Some(&index) = piece.segments.as_flattened().iter().chain(piece.points).find(beyond) {
            return Err(out_of_range(Place::File, index));
        }
        before.vertices += vertices;
        before.triangles += piece.triangles.len() as u64;
    }
    Ok(())
}

fn check_position(position: &DVec3, vertex: u64, exact: bool) -> Result<(), FormatError> {
    for value in position.to_array() {
        let rounded = f64::from(text::single(value));
        if !rounded.is_finite() {
            return Err(FormatError::NotFinite { place: Place::Vertex(vertex), value });
        }
        #[expect(clippy::float_cmp, reason = "the question is whether the rounding changed anything")]
        if exact && rounded != value {
            return Err(FormatError::NotSinglePrecision { vertex, value_mm: value });
        }
    }
    Ok(())
}
