//! Polygon meshes as shapes.

use super::lower::{Draft, Finding};
use super::polygon::{self, PolygonRun};
use crate::attractor::{Root, SolidSurface};
use crate::automaton::{State, StateId};
use crate::measure::mass::enclosed_by;
use crate::solid::TriMesh;
use glam::DVec3;

/// Whether a mesh stands for its surface or for the solid it bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Interior {
    /// The solid when the mesh is closed and outward, else the surface.
    #[default]
    Auto,
    /// The solid; an error when the mesh is not closed.
    Solid,
    /// The surface.
    Surface,
}

/// A polygon mesh, with planar or nearly planar faces, which may be concave; see [`polygon::cut`] for the triangles that they become.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct PolygonMesh {
    /// Corner points in mm.
    pub vertices: Vec<DVec3>,
    /// Corner indices of each face: one (a point), two (a segment), three or more (a polygon).
    pub faces: Vec<Vec<u32>>,
    /// Surface or solid.
    pub interior: Interior,
}

/// A polygon mesh as triangles over the same vertices.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct CutMesh {
    /// The triangles, in the order of the faces.
    pub mesh: TriMesh,
    /// Which of them are polygons of four corners or more, in order.
    pub polygons: Vec<PolygonRun>,
}

/// Faces by number of corners, polygons cut into triangles.
#[derive(Default)]
pub(super) struct Elements {
    pub(super) points: Vec<u32>,
    pub(super) segments: Vec<[u32; 2]>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Findings of one kind are listed up to this number.
const MOST_FINDINGS: usize = 20;

/// Sorts faces by kind and cuts polygons. `None` after an error.
pub(super) fn elements(vertices: &[DVec3], faces: &[Vec<u32>], draft: &mut Draft) -> Option<Elements> {
    let mut elements = Elements::default();
    let mut errors = 0;
    for (index, face) in faces.iter().enumerate() {
        let fault = corner_fault(vertices, face).or_else(|| repetition(face)).or_else(|| match face.as_slice() {
            [point] => {
                elements.points.push(*point);
                None
            }
            [start, end] => {
                elements.segments.push([*start, *end]);
                None
            }
            corners => cut_fault(vertices, corners, &mut elements.triangles),
        });
        if let Some((code, message)) = fault {
            errors += 1;
            if errors <= MOST_FINDINGS {
                draft.error(&format!("/faces/{index}"), code, format!("face {index}: {message}"));
            }
        }
    }
    (errors == 0).then_some(elements)
}

/// Adds the triangles of a polygon to others, or says why it has none.
fn cut_fault(vertices: &[DVec3], corners: &[u32], triangles: &mut Vec<[u32; 3]>) -> Option<(&'static str, String)> {
    polygon::cut(vertices, corners, triangles).err().map(|fault| (fault.code(), fault.to_string()))
}

fn corner_fault(vertices: &[DVec3], face: &[u32]) -> Option<(&'static str, String)> {
    if face.is_empty() {
        return Some(("mesh.face-empty", "it has no corner, and needs at least one".into()));
    }
    if let Some(&corner) = face.iter().find(|&&corner| corner as usize >= vertices.len()) {
        return Some(("mesh.index", format!("vertex {corner} does not exist: there are {}", vertices.len())));
    }
    let endless = face.iter().find(|&&corner| !vertices[corner as usize].is_finite());
    endless.map(|corner| ("model.not-finite", format!("vertex {corner} is not finite")))
}

fn repetition(face: &[u32]) -> Option<(&'static str, String)> {
    polygon::repeated(face).map(|vertex| {
        ("mesh.repeated-vertex", format!("vertex {vertex} occurs twice; a repair (--repair, \"repair\": true) takes such faces away"))
    })
}

impl PolygonMesh {
    /// The polygons as triangles, with the same vertices; a face that is star-shaped from its first corner may name a vertex twice. Cost: that of
    /// [`polygon::cut`].
    ///
    /// # Errors
    /// Findings of faces that are points or segments, name what is no place, or meet themselves in their plane.
    pub fn cut(&self) -> Result<CutMesh, Vec<Finding>> {
        let (mut triangles, mut polygons) = (Vec::with_capacity(self.faces.len()), Vec::new());
        let mut findings = Vec::new();
        for (index, face) in self.faces.iter().enumerate() {
            let first = triangles.len();
            let fault = corner_fault(&self.vertices, face).or_else(|| {
                let few = || ("mesh.no-polygon", format!("it has {} corners, and bounds nothing; leave it out", face.len()));
                if face.len() < 3 { Some(few()) } else { cut_fault(&self.vertices, face, &mut triangles) }
            });
            if let Some((code, message)) = fault {
                let (pointer, message) = (format!("/faces/{index}"), format!("face {index}: {message}"));
                findings.push(Finding { pointer, code, message, warning: false });
                if findings.len() == MOST_FINDINGS {
                    break;
                }
            }
            if face.len() > 3 {
                polygons.push(PolygonRun { first: first as u32, count: (triangles.len() - first) as u32 });
            }
        }
        if !findings.is_empty() {
            return Err(findings);
        }
        Ok(CutMesh { mesh: TriMesh { vertices: self.vertices.clone(), triangles }, polygons })
    }

    pub(super) fn lower(&self, draft: &mut Draft) {
        if self.faces.is_empty() {
            return draft.error(
                "/faces",
                "automaton.empty",
                "the mesh has no face; a face may have one corner (a point), two (a segment) or more".into(),
            );
        }
        let Some(elements) = elements(&self.vertices, &self.faces, draft) else { return };
        let corner = |index: u32| {
            let p = self.vertices[index as usize];
            [p.x, p.y, p.z, 1.0]
        };
        let mut simplices = |corners: usize, lists: &mut dyn Iterator<Item = Vec<u32>>, solid: Option<u32>| {
            let mut state = None;
            for list in lists {
                let state = *state.get_or_insert_with(|| simplex(draft, corners));
                draft.roots.push(Root { state, points: list.iter().map(|&index| corner(index)).collect(), rational: false, solid });
            }
        };
        simplices(1, &mut elements.points.iter().map(|&a| vec![a]), None);
        simplices(2, &mut elements.segments.iter().map(|ends| ends.to_vec()), None);
        let first_root = draft.roots.len();
        let Some(solid) = self.solid(&elements, draft) else { return };
        let index = solid.then_some(draft.solids.len() as u32);
        let state = simplex(draft, 3);
        draft.roots.extend(elements.triangles.iter().map(|corners| Root {
            state,
            points: corners.iter().map(|&index| corner(index)).collect(),
            rational: false,
            solid: index,
        }));
        if solid {
            let surface = SolidSurface { first_root, triangles: elements.triangles, normals: Vec::new() };
            let surface = surface.with_normals(&draft.roots);
            draft.solids.push(surface);
        }
    }

    /// Whether the triangles stand for the solid they bound; `None` after an error.
    fn solid(&self, elements: &Elements, draft: &mut Draft) -> Option<bool> {
        if self.interior == Interior::Surface || elements.triangles.is_empty() {
            return Some(false);
        }
        let fault = closed_fault(&elements.triangles).or_else(|| {
            let volume = enclosed_by(&self.vertices, &elements.triangles);
            let how = if volume.high < 0.0 { "its faces look inwards" } else { "it encloses nothing" };
            let signed = 0.5 * (volume.low + volume.high);
            (volume.low <= 0.0).then(|| format!("{how} (signed volume {signed} mm3)"))
        });
        match (fault, self.interior) {
            (None, _) => Some(true),
            (Some(fault), Interior::Solid) => {
                let message = format!("the mesh does not bound a solid: {fault}; mend it, or say \"interior\": \"surface\"");
                draft.error("/interior", "mesh.not-closed", message);
                None
            }
            (Some(fault), _) => {
                // An open surface is one; who closes a mesh means a solid.
                if has_no_border(&elements.triangles) {
                    let way_out = "ask for a repair, which turns faces, or say \"interior\": \"surface\"";
                    let message = format!("the mesh closes, but is taken as a surface, which has no volume: {fault}; {way_out}");
                    draft.warn("/interior", "mesh.not-oriented", message);
                }
                Some(false)
            }
        }
    }
}

/// Why triangles are no closed, oriented surface, naming the edge.
fn closed_fault(triangles: &[[u32; 3]]) -> Option<String> {
    let mut edges: Vec<(u32, u32)> = triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
    edges.sort_unstable();
    if let Some(pair) = edges.windows(2).find(|pair| pair[0] == pair[1]) {
        return Some(format!("two faces run along the edge {} - {} in the same direction", pair[0].0, pair[0].1));
    }
    let open = edges.iter().find(|&&(a, b)| edges.binary_search(&(b, a)).is_err());
    open.map(|&(a, b)| format!("the edge {a} - {b} has one face only"))
}

/// Whether every edge has an even number of faces, as those of bodies have, whichever way they run.
fn has_no_border(triangles: &[[u32; 3]]) -> bool {
    let edges = triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
    let mut edges: Vec<(u32, u32)> = edges.map(|(a, b)| (a.min(b), a.max(b))).collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).all(|faces| faces.len() % 2 == 0)
}

/// A new state of points, segments or triangles.
pub(super) fn simplex(draft: &mut Draft, corners: usize) -> StateId {
    draft.state(State::simplex(corners))
}
