//! From shapes to one automaton: every family adds states and roots to a [`Draft`], which becomes an
//! [`Attractor`] once.

use super::join::{self, Borders};
use super::radius::Before;
use super::{AffineMap, CellKind, Model, Shape};
use crate::attractor::trim::TrimmedSurface;
use crate::attractor::{Attractor, AttractorError, Gluing, OwnRadius, Root, SolidSurface};
use crate::automaton::topology::{Declared, Topology, TopologyError};
use crate::automaton::{Automaton, Boundary, LeafPrimitive, Smooth, State, StateId, SubdivisionOperator};
use std::collections::BTreeMap;

/// Something about a model that its author should know: an error, or a warning.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Where: a JSON pointer relative to the model's shape, for example `/maps/3/linear`.
    pub pointer: String,
    /// Stable code.
    pub code: &'static str,
    /// What, in words, with values and the way out.
    pub message: String,
    /// Whether the model can be used all the same.
    pub warning: bool,
}

/// A model that can be evaluated.
#[derive(Clone, Debug)]
pub struct Lowered {
    /// The attractor.
    pub attractor: Attractor,
    /// Warnings.
    pub findings: Vec<Finding>,
    /// Largest violation of a stated constraint.
    pub constraint_residual: f64,
}

/// States, roots and findings in the making.
#[derive(Default)]
pub(super) struct Draft {
    pub(super) states: Vec<State>,
    pub(super) roots: Vec<Root>,
    pub(super) solids: Vec<SolidSurface>,
    /// Radii of the roots' own; may be shorter than the roots.
    pub(super) radii: Vec<Option<OwnRadius>>,
    /// Surfaces that loops cut.
    pub(super) trimmed: Vec<TrimmedSurface>,
    pub(super) findings: Vec<Finding>,
    pub(super) constraint_residual: f64,
    /// What the model says of the states' subdivision, by state; may be shorter than the states.
    pub(super) declared: Vec<Declared>,
    /// Boundaries of roots that are one.
    pub(super) gluings: Vec<Gluing>,
    /// Boundaries of roots that are single points in space: (root, boundary).
    pub(super) collapsed: Vec<(usize, usize)>,
    /// What the shape that was lowered last says of its borders.
    pub(super) borders: Borders,
    /// Largest distance between control points of glued boundaries.
    pub(super) seam_mm: f64,
    /// States whose names tell their content, by name.
    shared: BTreeMap<String, StateId>,
    /// What is claimed of curves; see [`Automaton::claim_smooth`].
    pub(super) smooth: BTreeMap<StateId, Smooth>,
    /// States that are products of others; see [`Automaton::claim_products`].
    pub(super) products: BTreeMap<StateId, Vec<StateId>>,
    /// Where every state's transitions are listed in the model.
    origins: Vec<String>,
    /// Where the family that is being lowered stands in the model.
    pub(super) place: String,
}

/// Name of the state of single points.
const POINT: &str = "point";

impl Draft {
    /// Notes an error at `pointer` below the current place.
    pub(super) fn error(&mut self, pointer: &str, code: &'static str, message: String) {
        let pointer = format!("{}{pointer}", self.place);
        self.findings.push(Finding { pointer, code, message, warning: false });
    }

    /// Notes a warning.
    pub(super) fn warn(&mut self, pointer: &str, code: &'static str, message: String) {
        let pointer = format!("{}{pointer}", self.place);
        self.findings.push(Finding { pointer, code, message, warning: true });
    }

    /// Adds a state whose transitions the model does not list, and returns its id.
    pub(super) fn state(&mut self, state: State) -> StateId {
        self.states.push(state);
        self.origins.push(String::new());
        StateId::new(self.states.len() - 1)
    }

    /// The state of single points: a vertex of one control point. Shared by all that need it.
    pub(super) fn point_state(&mut self) -> StateId {
        let known = self.states.iter().position(|state| state.name == POINT && state.leaf == LeafPrimitive::Simplex);
        known.map_or_else(
            || {
                self.state(State {
                    name: POINT.into(),
                    kind: Some(CellKind::Vertex),
                    dimension: 1,
                    transitions: Vec::new(),
                    boundaries: Vec::new(),
                    leaf: LeafPrimitive::Simplex,
                    frame: false,
                })
            },
            StateId::new,
        )
    }

    /// The boundary of a state that is one point of its barycentric space.
    pub(super) fn end_point(&mut self, point: Vec<f64>) -> Boundary {
        let state = self.point_state();
        Boundary { state, incidence: SubdivisionOperator::exact(point.len(), point) }
    }

    /// The state of this name and number of control points, and whether it is new: then its content is to be filled in.
    /// Names of shared states tell their content.
    pub(super) fn shared_state(&mut self, name: &str, dimension: usize) -> (StateId, bool) {
        if let Some(&id) = self.shared.get(name) {
            return (id, false);
        }
        let (transitions, boundaries) = (Vec::new(), Vec::new());
        let leaf = LeafPrimitive::Centre;
        let id = self.state(State { name: name.into(), kind: None, dimension, transitions, boundaries, leaf, frame: false });
        self.shared.insert(name.into(), id);
        (id, true)
    }

    /// Adds a state whose transitions are listed at `pointer` below the current place.
    pub(super) fn state_from(&mut self, state: State, pointer: &str) -> StateId {
        self.states.push(state);
        self.origins.push(format!("{}{pointer}", self.place));
        StateId::new(self.states.len() - 1)
    }

    pub(super) fn has_errors(&self) -> bool {
        self.findings.iter().any(|finding| !finding.warning)
    }

    pub(super) fn shape(&mut self, shape: &Shape) {
        match shape {
            Shape::Ifs(ifs) => ifs.lower(self),
            Shape::Bcifs(bcifs) => bcifs.lower(self),
            Shape::BezierCurve(curve) => curve.lower(self),
            Shape::CornerCutting(curve) => curve.lower(self),
            Shape::Subdivision(surface) => surface.lower(self),
            Shape::Curve(curve) => curve.lower(self),
            Shape::TensorProduct(product) => product.lower(self),
            Shape::Sum(sum) => sum.lower(self),
            Shape::Mesh(mesh) => mesh.lower(self),
            Shape::Terrain(terrain) => terrain.lower(self),
            Shape::Group(group) => self.group(group),
        }
    }

    fn group(&mut self, group: &super::Group) {
        if group.parts.is_empty() {
            self.error("/parts", "automaton.empty", "the group has no part".into());
        }
        let place = self.place.clone();
        let mut borders = Vec::with_capacity(group.parts.len());
        for (index, part) in group.parts.iter().enumerate() {
            self.place = format!("{place}/parts/{index}");
            if part.transform.as_ref().is_some_and(|map| !(map.linear.is_finite() && map.translation.is_finite())) {
                self.error("/transform", "model.not-finite", "the transform has an entry that is not finite".into());
                borders.push(Borders::None);
                continue;
            }
            self.place = format!("{place}/parts/{index}/shape");
            let (first_root, first_solid, first_trimmed) = (self.roots.len(), self.solids.len(), self.trimmed.len());
            self.borders = Borders::None;
            self.shape(&part.shape);
            borders.push(std::mem::take(&mut self.borders));
            if let Some(map) = &part.transform {
                self.place = format!("{place}/parts/{index}");
                self.trimmed[first_trimmed..].iter_mut().for_each(|surface| surface.transform(|point| moved(map, point)));
                self.transform(map, first_root, first_solid);
            }
            if let Some(radius) = &part.radius {
                self.place = format!("{place}/parts/{index}");
                let before = Before { roots: first_root, solids: first_solid, trimmed: first_trimmed };
                radius.lower(&part.shape, before, self);
            }
        }
        self.place = place;
        if !group.joins.is_empty() && !self.has_errors() {
            join::lower(&group.joins, &borders, self);
        }
    }

    fn transform(&mut self, map: &AffineMap, first_root: usize, first_solid: usize) {
        for root in &mut self.roots[first_root..] {
            for point in &mut root.points {
                *point = moved(map, point);
            }
        }
        let determinant = map.linear.determinant();
        if self.solids.len() > first_solid && determinant <= 0.0 {
            self.error(
                "/transform",
                "model.reflected-solid",
                format!("the transform has determinant {determinant}: it would turn the solid inside out; use a positive one"),
            );
            return;
        }
        // Normals of a transformed surface are recomputed from its corners.
        for surface in &mut self.solids[first_solid..] {
            *surface = std::mem::take(surface).with_normals(&self.roots);
        }
    }
}

/// The image of a homogeneous point.
fn moved(map: &AffineMap, point: &[f64; 4]) -> [f64; 4] {
    let weight = point[3];
    let moved = map.linear * glam::DVec3::new(point[0], point[1], point[2]) + weight * map.translation;
    [moved.x, moved.y, moved.z, weight]
}

impl Model {
    /// Lowers the shape to an automaton with control points, proves that it converges and bounds it.
    ///
    /// # Errors
    /// All findings, at least one of which is an error.
    pub fn lower(&self) -> Result<Lowered, Vec<Finding>> {
        let mut draft = Draft::default();
        draft.shape(&self.shape);
        if draft.has_errors() {
            return Err(draft.findings);
        }
        if draft.radii.iter().any(Option::is_some) {
            draft.radii.resize(draft.roots.len(), None);
            // Sites of cells whose radius varies become roots.
            (1..=3).for_each(|corners| {
                super::mesh::simplex(&mut draft, corners);
            });
        }
        let origins = std::mem::take(&mut draft.origins);
        let fail = |mut findings: Vec<Finding>, error: &AttractorError| {
            // One map that does not contract is named; a longer cycle is everybody's fault.
            let pointer = match error {
                AttractorError::NotContractive { first, labels, .. } if labels.len() == 1 && !origins[*first].is_empty() => {
                    format!("{}/{}", origins[*first], labels[0])
                }
                _ => String::new(),
            };
            findings.push(Finding { pointer, code: error.code(), message: error.to_string(), warning: false });
            findings
        };
        let mut automaton = match Automaton::new(std::mem::take(&mut draft.states)) {
            Ok(automaton) => automaton,
            Err(error) => return Err(fail(draft.findings, &error.into())),
        };
        automaton.claim_products(&std::mem::take(&mut draft.products));
        let topology = match Topology::new(&automaton, &draft.declared) {
            Ok(topology) => topology,
            Err(error) => return Err(incoherent(draft.findings, &error)),
        };
        automaton.connect(&topology);
        automaton.claim_smooth(std::mem::take(&mut draft.smooth));
        let warnings = draft.findings.iter().map(|finding| finding.message.clone()).collect();
        let attractor = match Attractor::new(automaton, draft.roots, draft.solids, warnings) {
            Ok(attractor) => attractor,
            Err(error) => return Err(fail(draft.findings, &error)),
        };
        match attractor.with_topology(topology, &draft.gluings, &draft.collapsed, draft.seam_mm) {
            Ok(attractor) => Ok(Lowered {
                attractor: attractor.with_trimmed(draft.trimmed).with_radii(draft.radii),
                findings: draft.findings,
                constraint_residual: draft.constraint_residual,
            }),
            Err(error) => Err(incoherent(draft.findings, &error)),
        }
    }
}

/// A B-rep that contradicts itself.
fn incoherent(mut findings: Vec<Finding>, error: &TopologyError) -> Vec<Finding> {
    findings.push(Finding { pointer: String::new(), code: error.code(), message: error.to_string(), warning: false });
    findings
}
