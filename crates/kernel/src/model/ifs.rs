//! Iterated function systems of affine maps of space.

use glam::{DMat3, DVec3};

/// The affine map x -> A x + t of space, t in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AffineMap {
    /// A.
    pub linear: DMat3,
    /// t, in mm.
    pub translation: DVec3,
}

/// The compact drawn at the leaves of an [`Ifs`], in mm.
#[derive(Clone, Debug, PartialEq)]
pub enum Primitive {
    /// Points.
    Points(Vec<DVec3>),
    /// An open or closed polyline.
    Polyline {
        /// The corners in order.
        points: Vec<DVec3>,
        /// Whether the last corner is joined to the first.
        closed: bool,
    },
    /// A polygon mesh, taken as a surface.
    Mesh {
        /// Corner points.
        vertices: Vec<DVec3>,
        /// Corner indices of each face.
        faces: Vec<Vec<u32>>,
    },
    /// A closed, outward polygon mesh, taken with its interior.
    Solid {
        /// Corner points.
        vertices: Vec<DVec3>,
        /// Corner indices of each face.
        faces: Vec<Vec<u32>>,
    },
}

/// An iterated function system: maps T_i, and the attractor A = union of T_i A.
#[derive(Clone, Debug, PartialEq)]
pub struct Ifs {
    /// The maps.
    pub maps: Vec<AffineMap>,
    /// What is drawn at the leaves; a point of each leaf cell when absent.
    pub primitive: Option<Primitive>,
    /// `graph[i]` lists the maps that may follow map i in an address (a graph-directed system);
    /// all when absent.
    pub graph: Option<Vec<Vec<usize>>>,
}
