//! The limit set of an automaton and control points: bounded once per state, so that every cell is
//! bounded by a few multiplications, whatever the signs of its operators.

mod address;
mod attained;
mod bound;
pub mod cell;
mod complex;
mod connected;
mod cover;
mod defect;
mod deviation;
mod early;
mod enclosure;
mod framed;
pub(crate) mod graph;
mod hull;
mod invariant;
mod near;
mod needle;
mod patch;
mod polytope;
mod precision;
mod product;
mod radii;
mod refine;
pub(crate) mod sites;
mod tangent;
pub(crate) mod trim;
mod volume;
mod walk;

use crate::automaton::topology::{Topology, TopologyError};
use crate::automaton::{Automaton, AutomatonError, Contraction, LeafPrimitive, State, StateId, SubdivisionOperator, convergence};
use crate::budget::Budget;
use crate::error::Kind;
use crate::solid::TriMesh;
use crate::tessellation::Tessellation;
use crate::tolerance::Tolerance;
pub(crate) use address::rounding;
pub use address::{Address, AddressError, Location, MOST_LETTERS, point_at, ranges};
pub(crate) use attained::AttainedPoint;
pub use bound::StateBound;
pub(crate) use bound::extremes;
pub use complex::{CellAddress, CellComplex, Gluing, Step};
pub use cover::{Halo, PointCover};
use deviation::Deviation;
pub(crate) use enclosure::Enclosure;
use glam::DVec3;
pub(crate) use graph::{Column, Graph};
use hull::Hulls;
pub(crate) use hull::StateHull;
pub use near::{NearQuery, Nearby, Nearest, Neighbourhood, addresses_near};
pub(crate) use patch::BezierPatch;
pub use precision::LinearPrecision;
pub use radii::OwnRadius;
pub use refine::{RefineError, Streamed, count_cells, refine, refine_with_normals, stream};
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, OnceLock};
pub use tangent::{NoTangentPlane, TangentPlanes};
use trim::TrimmedSurface;

/// Where a shape begins: a state and its control points.
#[derive(Clone, Debug, PartialEq)]
pub struct Root {
    /// Its state.
    pub state: StateId,
    /// Homogeneous control points (w x, w y, w z, w); w = 1 unless `rational`.
    pub points: Vec<[f64; 4]>,
    /// Whether points are projected (divided by w) when emitted.
    pub rational: bool,
    /// The solid whose surface the cell belongs to, as an index into [`Attractor::solids`].
    pub solid: Option<u32>,
}

/// A closed, outward triangle surface that stands for the solid it bounds. Its triangles are
/// consecutive roots.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct SolidSurface {
    /// Index of the root of its first triangle.
    pub first_root: usize,
    /// Corner indices of the triangles: which of them are neighbours.
    pub triangles: Vec<[u32; 3]>,
    /// Outward pseudo-normals of every triangle: the face's, the edges' (opposite to corner 0, 1, 2: the
    /// sum of the two faces'), the corners' (angle-weighted sums). The sign of the offset from the
    /// closest point along its pseudo-normal tells inside from outside (Baerentzen and Aanaes, "Signed
    /// distance computation using the angle weighted pseudonormal", IEEE TVCG 11(3), 2005).
    pub normals: Vec<[glam::DVec3; 7]>,
}

impl SolidSurface {
    /// Computes the pseudo-normals from the corners that the roots hold.
    #[must_use]
    pub(crate) fn with_normals(mut self, roots: &[Root]) -> Self {
        let corners: Vec<[DVec3; 3]> = roots[self.first_root..self.first_root + self.triangles.len()]
            .iter()
            .map(|root| std::array::from_fn(|k| DVec3::new(root.points[k][0], root.points[k][1], root.points[k][2])))
            .collect();
        let count = self.triangles.iter().flatten().max().map_or(0, |&index| index as usize + 1);
        let mut at_corner = vec![DVec3::ZERO; count];
        let mut at_side: BTreeMap<(u32, u32), DVec3> = BTreeMap::new();
        let normal = |[a, b, c]: &[DVec3; 3]| (b - a).cross(c - a).normalize_or_zero();
        for (triangle, points) in self.triangles.iter().zip(&corners) {
            let face = normal(points);
            for k in 0..3 {
                let (here, next, last) = (points[k], points[(k + 1) % 3], points[(k + 2) % 3]);
                let angle = (next - here).angle_between(last - here);
                at_corner[triangle[k] as usize] += if angle.is_finite() { angle * face } else { DVec3::ZERO };
                let (a, b) = (triangle[(k + 1) % 3], triangle[(k + 2) % 3]);
                *at_side.entry((a.min(b), a.max(b))).or_insert(DVec3::ZERO) += face;
            }
        }
        self.normals = self
            .triangles
            .iter()
            .zip(&corners)
            .map(|(triangle, points)| {
                let side = |k: usize| {
                    let (a, b) = (triangle[(k + 1) % 3], triangle[(k + 2) % 3]);
                    at_side[&(a.min(b), a.max(b))]
                };
                let at = |k: usize| at_corner[triangle[k] as usize];
                [normal(points), side(0), side(1), side(2), at(0), at(1), at(2)]
            })
            .collect();
        self
    }
}

/// The limit set of an automaton and control points. Owns bounds, never points.
///
/// Invariant: the automaton converges (its joint spectral radius is below 1), and every state that a
/// root reaches is bounded.
#[derive(Clone, Debug)]
pub struct Attractor {
    automaton: Automaton,
    roots: Vec<Root>,
    solids: Vec<SolidSurface>,
    bounds: Vec<StateBound>,
    /// Worked out when first asked for: measures and comparisons do without, and it is most of what lowering takes.
    covers: OnceLock<Vec<Option<PointCover>>>,
    /// Of every state, when first asked for.
    attained: Vec<OnceLock<Vec<AttainedPoint>>>,
    hulls: Hulls,
    /// Of every state, when first asked for.
    state_hulls: Vec<OnceLock<Option<StateHull>>>,
    /// Of every state, when first asked for.
    enclosures: Vec<OnceLock<Option<Enclosure>>>,
    /// Of every state, when first asked for.
    enclosed_children: Vec<OnceLock<Vec<Option<SubdivisionOperator>>>>,
    /// Of every state, when first asked for.
    deviations: Vec<OnceLock<Option<Deviation>>>,
    /// Widest gap of every frame state that is proven connected; see `connected`.
    connected: Vec<Option<f64>>,
    precisions: Vec<Option<LinearPrecision>>,
    contraction: Contraction,
    warnings: Vec<String>,
    /// The B-rep and where it begins, when the states have one.
    brep: Option<(Arc<Topology>, complex::Start)>,
    /// Largest distance between control points of glued boundaries, in mm.
    seam_mm: f64,
    /// Surfaces that are cut along loops, and for every root which of them it belongs to.
    trimmed: Vec<TrimmedSurface>,
    trims: Vec<Option<u32>>,
    /// Of every root, the radius of its own; empty where none has one.
    radii: Vec<Option<OwnRadius>>,
}

/// Why an automaton has no attractor that can be evaluated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AttractorError {
    /// The states do not fit together.
    #[error(transparent)]
    Automaton(#[from] AutomatonError),
    /// A cycle does not contract.
    #[error(
        "the maps do not contract, or too little to be proven: along the cycle {} from state '{state}' lengths are multiplied by {rate} at each step, and must shrink",
        joined(.labels)
    )]
    NotContractive {
        /// First state of the cycle.
        state: String,
        /// Its index in the automaton.
        first: usize,
        /// Labels of the cycle's transitions: their indices in the model's lists.
        labels: Vec<usize>,
        /// Spectral radius of the cycle's product to the power 1 / length.
        rate: f64,
    },
    /// Neither proven nor refuted within the search's work.
    #[error("convergence is undecided at depth {depth}: the joint spectral radius lies in [{lower:.6}, {upper:.6}], and must be below 1")]
    Undecided {
        /// Proven lower bound.
        lower: f64,
        /// Proven upper bound.
        upper: f64,
        /// Longest path examined.
        depth: usize,
    },
    /// Rational cells are bounded by the hull of their control points, which needs non-negative operators.
    #[error(
        "state '{state}' has operators with negative entries and control points with weights: such cells cannot be bounded; give all weights the value 1 or use operators without negative entries"
    )]
    SignedRational {
        /// The state.
        state: String,
    },
    /// Coordinates overflow.
    #[error("the shape's bounds overflow double precision; move or scale the model below 1e150 mm")]
    Overflow,
    /// Nothing to evaluate.
    #[error("the model is empty: it has no cell, no map and no face")]
    Empty,
}

impl AttractorError {
    /// How to react.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Undecided { .. } => Kind::Unreachable,
            _ => Kind::Invalid,
        }
    }

    /// Stable code.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Automaton(AutomatonError::Dimension { .. }) => "automaton.dimension-mismatch",
            Self::Automaton(AutomatonError::NoTransition { .. }) => "automaton.empty",
            Self::NotContractive { .. } => "automaton.not-contractive",
            Self::Undecided { .. } => "automaton.convergence-undecided",
            Self::SignedRational { .. } => "automaton.signed-rational",
            Self::Overflow => "automaton.overflow",
            Self::Empty => "automaton.empty",
        }
    }
}

/// Roots for triangles, given their state.
fn roots_of(vertices: &[DVec3], triangles: &[[u32; 3]], state: StateId) -> impl Iterator<Item = Root> {
    let corner = |&index: &u32| vertices[index as usize].extend(1.0).to_array();
    triangles.iter().map(move |corners| Root { state, points: corners.iter().map(corner).collect(), rational: false, solid: None })
}

/// How far what was drawn is from the shape, rounding included, in mm.
fn deviation_of(drawn: &Tessellation) -> f64 {
    drawn.deviation_mm + refine::rounding_mm(refine::largest_coordinate(&drawn.vertices))
}

/// The transitions of the contraction's cycle, by their labels in the model.
fn labels(automaton: &Automaton, contraction: &Contraction) -> Vec<usize> {
    let mut state = contraction.cycle.0;
    let mut words = Vec::new();
    for &index in &contraction.cycle.1 {
        let transition = &automaton.state(state).transitions[index];
        words.push(transition.label);
        state = transition.to;
    }
    words
}

fn joined(labels: &[usize]) -> String {
    labels.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")
}

/// A cycle whose rate is this close to 1 does not contract beyond rounding.
const RATE_ONE: f64 = 1.0 - 1e-9;

impl Attractor {
    /// Proves convergence and bounds every state.
    ///
    /// # Errors
    /// [`AttractorError`]; see its variants.
    pub fn new(
        mut automaton: Automaton,
        roots: Vec<Root>,
        solids: Vec<SolidSurface>,
        warnings: Vec<String>,
    ) -> Result<Self, AttractorError> {
        if roots.is_empty() {
            return Err(AttractorError::Empty);
        }
        let contraction = convergence::contraction(&automaton);
        if contraction.lower >= RATE_ONE {
            let first = contraction.cycle.0;
            return Err(AttractorError::NotContractive {
                state: automaton.state(first).name.clone(),
                first: first.index(),
                labels: labels(&automaton, &contraction),
                rate: contraction.lower,
            });
        }
        if contraction.upper >= 1.0 {
            return Err(AttractorError::Undecided { lower: contraction.lower, upper: contraction.upper, depth: contraction.depth });
        }
        let bounds = bound::bound_states(&automaton, &contraction);
        if bounds.iter().any(|bound| !bound.is_finite()) {
            return Err(AttractorError::Overflow);
        }
        defect::measure_drawings(&mut automaton, &bounds);
        let connected = connected::connected(&automaton, &bounds, &contraction);
        let hulls = Hulls::new(&automaton, &contraction);
        let precisions = precision::precisions(&automaton, &bounds, &hulls);
        let count = automaton.states().len();
        let mut attractor = Self {
            automaton,
            roots,
            solids,
            bounds,
            covers: OnceLock::new(),
            attained: vec![OnceLock::new(); count],
            hulls,
            state_hulls: vec![OnceLock::new(); count],
            enclosures: vec![OnceLock::new(); count],
            enclosed_children: vec![OnceLock::new(); count],
            deviations: vec![OnceLock::new(); count],
            connected,
            precisions,
            contraction,
            warnings,
            brep: None,
            seam_mm: 0.0,
            trimmed: Vec::new(),
            trims: Vec::new(),
            radii: Vec::new(),
        };
        attractor.check_roots()?;
        attractor.precisions = precision::closer(&attractor);
        Ok(attractor)
    }

    /// Gives the attractor its B-rep: the topology of its states, which boundaries of roots are one, and which edges
    /// among them (root, boundary) are single points in space. `seam_mm` bounds the distance between control points
    /// that gluing takes for equal.
    ///
    /// # Errors
    /// [`TopologyError`] when a gluing contradicts the boundaries' subdivision.
    pub fn with_topology(
        mut self,
        mut topology: Topology,
        gluings: &[Gluing],
        collapsed: &[(usize, usize)],
        seam_mm: f64,
    ) -> Result<Self, TopologyError> {
        let start = complex::Start::new(&mut topology, &self.automaton, &self.roots, gluings, collapsed)?;
        self.brep = Some((Arc::new(topology), start));
        self.seam_mm = seam_mm;
        Ok(self)
    }

    /// The B-rep and where it begins, when the states have one.
    pub(crate) fn brep(&self) -> Option<(&Topology, &complex::Start)> {
        self.brep.as_ref().map(|(topology, start)| (topology.as_ref(), start))
    }

    /// Largest distance between control points of boundaries that were glued, in mm.
    pub(crate) fn seam_mm(&self) -> f64 {
        self.seam_mm
    }

    /// Cuts surfaces along loops: those of their roots are drawn that are inside.
    #[must_use]
    pub(crate) fn with_trimmed(mut self, trimmed: Vec<TrimmedSurface>) -> Self {
        self.trims = vec![None; self.roots.len()];
        for (index, surface) in trimmed.iter().enumerate() {
            surface.cells.iter().filter_map(|cell| cell.root).for_each(|root| self.trims[root] = Some(index as u32));
        }
        self.trimmed = trimmed;
        self
    }

    /// Surfaces that are cut along loops.
    pub(crate) fn trimmed(&self) -> &[TrimmedSurface] {
        &self.trimmed
    }

    /// The attractor whose trimmed surfaces are triangles, and its Hausdorff distance from this one, at most.
    ///
    /// # Errors
    /// [`RefineError`], of drawing them.
    pub(crate) fn resolved(&self, tolerance: Tolerance, budget: &Budget) -> Result<(Self, f64), RefineError> {
        let drawn = trim::refine(self, tolerance, budget)?;
        let uncut: Vec<usize> = (0..self.roots.len()).filter(|&root| self.trim_of(root).is_none()).collect();
        let mut roots: Vec<Root> = uncut.iter().map(|&root| self.roots[root].clone()).collect();
        roots.extend(self.automaton.simplex(3).into_iter().flat_map(|state| roots_of(&drawn.vertices, &drawn.triangles, state)));
        let deviation = deviation_of(&drawn);
        let mut solids = self.solids.clone();
        for solid in &mut solids {
            solid.first_root -= (0..solid.first_root).filter(|&root| self.trim_of(root).is_some()).count();
        }
        let trims = vec![None; roots.len()];
        // Cut surfaces have the radius that is asked for: the lowering sees to it.
        let radii = (0..roots.len()).map(|root| uncut.get(root).and_then(|&root| self.own_radius(root)).cloned()).collect();
        let resolved = Self { roots, solids, brep: None, trimmed: Vec::new(), trims, radii: Vec::new(), ..self.clone() };
        Ok((resolved.with_radii(radii), deviation))
    }

    /// Whether all of it is surfaces with a B-rep, none of them trimmed, that bound no solids and have no radii of their own.
    pub(crate) fn is_surface(&self) -> bool {
        let is_face = |root: &Root| self.brep().is_some_and(|(topology, _)| topology.state(root.state).dimension == 2);
        let are_whole = || (0..self.roots.len()).all(|root| self.has_brep(root) && self.trim_of(root).is_none());
        self.solids.is_empty() && !self.has_own_radii() && self.roots.iter().all(is_face) && are_whole()
    }

    /// Such a surface as triangles that have their corners in common where cells have, with its Hausdorff distance from this one, at most.
    ///
    /// # Errors
    /// [`RefineError`], of drawing them.
    pub(crate) fn drawn(&self, tolerance: Tolerance, budget: &Budget) -> Result<(TriMesh, f64), RefineError> {
        let drawn = complex::refine(self, &(0..self.roots.len()).collect::<Vec<usize>>(), None, tolerance, budget)?;
        let deviation_mm = deviation_of(&drawn);
        Ok((TriMesh { vertices: drawn.vertices, triangles: drawn.triangles }, deviation_mm))
    }

    /// Points as an attractor; none where there are none.
    pub(crate) fn of_points(points: &[cell::Point]) -> Option<Self> {
        let automaton = Automaton::new(vec![State::simplex(1)]).ok()?;
        let root = |&[x, y, z]: &cell::Point| Root { state: StateId::new(0), points: vec![[x, y, z, 1.0]], rational: false, solid: None };
        Self::new(automaton, points.iter().map(root).collect(), Vec::new(), Vec::new()).ok()
    }

    /// Triangles as an attractor, or the solid that they bound; none where they are no such.
    pub(crate) fn of_triangles(mesh: &TriMesh, is_solid: bool) -> Option<Self> {
        let automaton = Automaton::new(vec![State::simplex(3)]).ok()?;
        let mut roots: Vec<Root> = roots_of(&mesh.vertices, &mesh.triangles, StateId::new(0)).collect();
        let mut solids = Vec::new();
        if is_solid {
            roots.iter_mut().for_each(|root| root.solid = Some(0));
            let surface = SolidSurface { first_root: 0, triangles: mesh.triangles.clone(), normals: Vec::new() };
            solids.push(surface.with_normals(&roots));
        }
        Self::new(automaton, roots, solids, Vec::new()).ok()
    }

    /// The triangles that it is, with common corners, and whether they bound a solid; none where it is something else, or has radii of its own.
    pub(crate) fn triangles(&self) -> Option<(TriMesh, bool)> {
        let is_triangle = |root: &Root| {
            let state = self.automaton.state(root.state);
            state.leaf == LeafPrimitive::Simplex && state.transitions.is_empty() && root.points.len() == 3 && !root.rational
        };
        let is_solid = self.solids.len() == 1;
        let is_whole = |root: &Root| root.solid.is_some() == is_solid && is_triangle(root);
        if self.solids.len() > 1 || self.has_own_radii() || !self.trimmed.is_empty() || !self.roots.iter().all(is_whole) {
            return None;
        }
        let (mut mesh, mut numbers) = (TriMesh::default(), HashMap::new());
        for root in &self.roots {
            let corners: [u32; 3] = std::array::from_fn(|k| {
                let [x, y, z, _] = root.points[k];
                // 0 and -0 are one place.
                *numbers.entry([x, y, z].map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
                    mesh.vertices.push(DVec3::new(x, y, z));
                    mesh.vertices.len() as u32 - 1
                })
            });
            mesh.triangles.push(corners);
        }
        Some((mesh, is_solid))
    }

    /// The trimmed surface that a root belongs to.
    pub(crate) fn trim_of(&self, root: usize) -> Option<usize> {
        self.trims.get(root).copied().flatten().map(|index| index as usize)
    }

    fn check_roots(&self) -> Result<(), AttractorError> {
        for (index, root) in self.roots.iter().enumerate() {
            if root.rational && self.bounds[root.state.index()].margin() > 0.0 {
                return Err(AttractorError::SignedRational { state: self.automaton.state(root.state).name.clone() });
            }
            let ball = self.root_cell(index).ball;
            if !ball.is_finite() || ball.radius > 1e150 || ball.centre.iter().any(|x| x.abs() > 1e150) {
                return Err(AttractorError::Overflow);
            }
        }
        Ok(())
    }

    /// The control graph.
    #[must_use]
    pub fn automaton(&self) -> &Automaton {
        &self.automaton
    }

    /// Where the shape begins.
    #[must_use]
    pub fn roots(&self) -> &[Root] {
        &self.roots
    }

    /// Whether every leaf is drawn as points, cell by cell.
    #[must_use]
    pub fn is_drawn_as_points(&self) -> bool {
        let apart = (0..self.roots.len()).all(|root| !self.has_brep(root));
        apart
            && self.automaton.states().iter().enumerate().all(|(index, state)| match &state.leaf {
                LeafPrimitive::Centre => !self.has_needles(StateId::new(index)),
                LeafPrimitive::Drawn(drawing) => drawing.segments.is_empty() && drawing.triangles.is_empty(),
                LeafPrimitive::Simplex => state.dimension == 1,
                LeafPrimitive::Chord(_) | LeafPrimitive::Star(_) | LeafPrimitive::Polygon(_) => false,
            })
    }

    /// Surfaces that stand for solids.
    #[must_use]
    pub fn solids(&self) -> &[SolidSurface] {
        &self.solids
    }

    /// The same as meshes, their vertices joined as the model has them.
    #[must_use]
    pub fn surfaces(&self) -> Vec<TriMesh> {
        let mesh_of = |surface: &SolidSurface| {
            let (mut mesh, mut numbers) = (TriMesh::default(), HashMap::new());
            for (index, corners) in surface.triangles.iter().enumerate() {
                let points = &self.roots[surface.first_root + index].points;
                let mut number = |k: usize| {
                    *numbers.entry(corners[k]).or_insert_with(|| {
                        mesh.vertices.push(DVec3::new(points[k][0], points[k][1], points[k][2]));
                        mesh.vertices.len() as u32 - 1
                    })
                };
                let triangle = [number(0), number(1), number(2)];
                mesh.triangles.push(triangle);
            }
            mesh
        };
        self.solids.iter().map(mesh_of).collect()
    }

    /// Proven bounds of the joint spectral radius.
    #[must_use]
    pub fn contraction(&self) -> &Contraction {
        &self.contraction
    }

    /// What the lowering corrected or found odd.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The points that stand for a state, where they are known.
    pub(crate) fn cover(&self, state: StateId) -> Option<&PointCover> {
        let covers = self.covers.get_or_init(|| cover::covers(&self.automaton, &self.bounds, &self.contraction));
        covers[state.index()].as_ref()
    }

    /// Some points of a state's attractor.
    pub(crate) fn attained(&self, state: StateId) -> &[AttainedPoint] {
        self.attained[state.index()].get_or_init(|| attained::attained(&self.automaton, &self.contraction, state))
    }

    /// Points in whose hull a state's attractor lies, other than its control points; those of children have them too.
    pub(crate) fn hull(&self, state: StateId) -> Option<&StateHull> {
        // Weights have to be positive at the points, too.
        let fits = |hull: &StateHull| !hull.is_signed || self.roots.iter().all(|root| !root.rational);
        self.state_hulls[state.index()].get_or_init(|| self.hulls.of(self, state).filter(fits)).as_ref()
    }

    /// A box of coordinates that holds the attractor of a state whose operators have negative entries, or a product of such.
    pub(crate) fn enclosure(&self, state: StateId) -> Option<&Enclosure> {
        self.enclosures[state.index()].get_or_init(|| enclosure::enclosure(self, state)).as_ref()
    }

    /// Of every child of a state, its operator times the columns of its own enclosure: what sees a functional of the parent as the child's enclosure does.
    pub(crate) fn enclosed_children(&self, state: StateId) -> &[Option<SubdivisionOperator>] {
        self.enclosed_children[state.index()].get_or_init(|| {
            let transitions = &self.automaton.state(state).transitions;
            transitions.iter().map(|transition| Some(transition.operator.times(&self.enclosure(transition.to)?.columns))).collect()
        })
    }

    /// What is known of the parts of a product with rough factors.
    fn deviation(&self, state: StateId) -> Option<&Deviation> {
        self.deviations[state.index()].get_or_init(|| deviation::deviation(self, state)).as_ref()
    }

    /// Parameters of a state's points, where its curves or faces are proven to have linear precision.
    #[must_use]
    pub fn precision(&self, state: StateId) -> Option<&LinearPrecision> {
        self.precisions[state.index()].as_ref()
    }

    /// The widest gap that the attractor of a state may have where points are compared in double precision, as a share of its size, when it is proven to have no wider
    /// one: see `connected`.
    pub(crate) fn widest_gap(&self, state: StateId) -> Option<f64> {
        self.connected[state.index()]
    }

    /// Whether cells of a state may be needles: it is proven connected, and its cells are of different proportions.
    pub(crate) fn has_needles(&self, state: StateId) -> bool {
        let varies = matches!(self.bound(state), StateBound::Frame { similar: false, .. });
        varies && self.connected[state.index()].is_some() && self.cover(state).is_some()
    }

    /// The bound of a state.
    #[must_use]
    pub(crate) fn bound(&self, state: StateId) -> &StateBound {
        &self.bounds[state.index()]
    }
}
