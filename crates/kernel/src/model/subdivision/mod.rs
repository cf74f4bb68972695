//! Subdivision surfaces on polygon meshes.
//!
//! One converter for all schemes. A state is a canonical stencil (`stencil`): a small labelled mesh on which a
//! patch, a curve between patches or a point depends. One step of the scheme (`refine`) is run once on every stencil
//! in symbols, as rows of affine weights; the stencils of the children are states again, until nothing new comes up
//! (`convert`). So valences, several extraordinary vertices in a patch, boundaries and creases are no special cases:
//! their stencils differ, and the number of states is the number of different stencils.

mod cage;
mod convert;
mod host;
mod refine;
mod stencil;

use super::lower::Draft;
use glam::DVec3;

/// A subdivision scheme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// Catmull and Clark's: bicubic B-splines where the mesh is regular, cubic B-splines along boundaries and
    /// creases.
    CatmullClark,
    /// Doo and Sabin's: biquadratic B-splines where the mesh is regular. Boundaries follow the quadratic B-spline of
    /// the boundary polygon.
    DooSabin,
    /// Loop's with his own weights, on triangles: quartic box splines where the mesh is regular.
    Loop,
}

impl Scheme {
    /// Its name in documents.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::CatmullClark => "catmull_clark",
            Self::DooSabin => "doo_sabin",
            Self::Loop => "loop",
        }
    }
}

/// What happens to vertices of the boundary that belong to one face alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum BoundaryRule {
    /// The boundary curve is smooth there.
    #[default]
    Smooth,
    /// The surface passes through them.
    SharpCorners,
}

/// A crease: an edge that is sharp for some steps, or for ever.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crease {
    /// The edge's vertices.
    pub edge: [u32; 2],
    /// Number of steps during which the edge is sharp, fractions mixed; 10 and more is for ever, as in OpenSubdiv.
    pub sharpness: f64,
}

/// A vertex that is sharp for some steps, or for ever.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// The vertex.
    pub vertex: u32,
    /// As of a [`Crease`].
    pub sharpness: f64,
}

/// The limit surface of a scheme on a polygon mesh that is a manifold, with or without boundary.
#[derive(Clone, Debug, PartialEq)]
pub struct Subdivision {
    /// The scheme.
    pub scheme: Scheme,
    /// The mesh's vertices in mm.
    pub vertices: Vec<DVec3>,
    /// Vertices of every face, in order around it; neighbours run along their common edge in opposite directions.
    pub faces: Vec<Vec<u32>>,
    /// Sharp edges; none with [`Scheme::DooSabin`].
    pub creases: Vec<Crease>,
    /// Sharp vertices; none with [`Scheme::DooSabin`].
    pub corners: Vec<Corner>,
    /// The boundary's corners.
    pub boundary: BoundaryRule,
    /// Masks of one's own, by region; none but with [`Scheme::DooSabin`]. Faces in no region have the scheme's.
    pub coefficients: Vec<Coefficients>,
}

/// Masks of faces: a geometric texture. The surface stays closed whatever they are, since every mask belongs to one
/// face; a face that arises between faces of one region belongs to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Coefficients {
    /// The region; the whole mesh when absent.
    pub faces: Option<Vec<u32>>,
    /// For faces of n sides a list of n weights that sum to 1: of the corner itself, of the next vertex, and so on.
    /// Faces with other numbers of sides have the scheme's.
    pub weights: Vec<Vec<f64>>,
}

/// Sharpness of this size lasts for ever (OpenSubdiv's `SHARPNESS_INFINITE`); it bounds the chains of states.
pub const INFINITE_SHARPNESS: f64 = 10.0;

impl Subdivision {
    pub(super) fn lower(&self, draft: &mut Draft) {
        if let Some(cage) = cage::Cage::new(self, draft) {
            let rules = refine::Rules { scheme: self.scheme, coefficients: self.coefficients.clone() };
            convert::convert(&rules, cage, draft);
        }
    }
}
