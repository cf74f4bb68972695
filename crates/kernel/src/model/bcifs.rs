//! Boundary controlled iterated function systems, stated in full.

use glam::DVec4;

/// Topological kind of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CellKind {
    /// Dimension 0.
    Vertex,
    /// Dimension 1.
    Edge,
    /// Dimension 2.
    Face,
    /// Dimension 3.
    Volume,
}

/// One entry of a matrix.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A given number.
    Number(f64),
    /// To be solved (`null` in a document).
    Unknown,
    /// The value of one of the model's parameters.
    Parameter(String),
}

/// A matrix as an array of rows.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Matrix {
    /// The rows, all of one length in a legal document.
    pub rows: Vec<Vec<Entry>>,
}

/// A transition of a state: the child's state and the operator whose columns are the child's
/// control points in the parent's barycentric space.
#[derive(Clone, Debug, PartialEq)]
pub struct TransitionSpec {
    /// Name of the child's state.
    pub to: String,
    /// T, of size n x n_child.
    pub operator: Matrix,
}

/// A boundary of a state: its state and its embedding.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundarySpec {
    /// Name of the boundary's state.
    pub state: String,
    /// b, of size n x n_boundary.
    pub incidence: Matrix,
}

/// A kind of cell.
#[derive(Clone, Debug, PartialEq)]
pub struct BcifsState {
    /// Its name, unique in the model.
    pub name: String,
    /// Its topological kind.
    pub cell: CellKind,
    /// n, the number of control points.
    pub dimension: usize,
    /// How it subdivides.
    pub transitions: Vec<TransitionSpec>,
    /// Its boundary cells, in order.
    pub boundaries: Vec<BoundarySpec>,
}

/// The j-th child of boundary `boundary` is boundary m of child i, (i, m) = `children[j]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Incidence {
    /// Name of the state.
    pub state: String,
    /// Index of the boundary.
    pub boundary: usize,
    /// Pairs (child, boundary of that child).
    pub children: Vec<(usize, usize)>,
}

/// Two children share a boundary.
#[derive(Clone, Debug, PartialEq)]
pub struct Adjacency {
    /// Name of the state.
    pub state: String,
    /// Pairs (child, boundary of that child).
    pub between: [(usize, usize); 2],
    /// Whether the second is seen from its other end.
    pub reversed: bool,
}

/// A root cell: its state and its control points (x, y, z, w), w = 1 unless rational.
#[derive(Clone, Debug, PartialEq)]
pub struct RootCell {
    /// Name of the state.
    pub state: String,
    /// Points in mm with their weight: (x, y, z, w), not yet multiplied by w.
    pub control_points: Vec<DVec4>,
}

/// Two boundaries of root cells that are one.
#[derive(Clone, Debug, PartialEq)]
pub struct Glue {
    /// Pairs (root cell, boundary of its state).
    pub between: [(usize, usize); 2],
    /// Whether the second is seen from its other end.
    pub reversed: bool,
}

/// A BC-IFS with its control points.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Bcifs {
    /// The kinds of cells.
    pub states: Vec<BcifsState>,
    /// Incidence constraints.
    pub incidences: Vec<Incidence>,
    /// Adjacency constraints.
    pub adjacencies: Vec<Adjacency>,
    /// The root cells.
    pub cells: Vec<RootCell>,
    /// Root boundaries that are one.
    pub glue: Vec<Glue>,
    /// Named values used as entries, in the document's order.
    pub parameters: Vec<(String, f64)>,
}
