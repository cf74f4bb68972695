//! What a mesh file really contains, and what a slicer will make of it.

use std::collections::BTreeMap;
use std::path::Path;

use lacuna_exchange::format::{self, Format, MeshFile, ReadLimits, Unit};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::measure::mass;
use lacuna_kernel::model::HalfEdgeMesh;
use lacuna_kernel::model::polygon::PolygonFault;
use lacuna_kernel::solid::{Topology, TriMesh};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::digest::Digest;
use crate::problem::{Finding, Problem, ProblemKind};
use crate::production::{self, format_problem};

/// Slicers of the PrusaSlicer line ask whether an object of less volume was saved in inches.
const INCH_PROMPT_MM3: f64 = 8.0;
/// ... and whether one of less volume than this was saved in metres.
const METRE_PROMPT_MM3: f64 = 0.008;
/// Above so many triangles slicers become slow.
const MANY_TRIANGLES: usize = 1_000_000;

/// What a mesh file holds. Nothing of it was repaired.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MeshReport {
    /// The format it was read as.
    pub format: String,
    /// `binary`, `binary big-endian`, `ascii` or `xml`.
    pub encoding: String,
    /// Length of the file.
    pub bytes: u64,
    /// The unit that the file names, or that it names none.
    pub unit: String,
    /// Names of objects.
    pub objects: Vec<String>,
    /// Polygons of four corners or more.
    pub polygons_fanned: u64,
    /// What holds no polygons and was left out, by kind: shapes, and segments and points beside faces.
    pub left_out: BTreeMap<String, u64>,
    /// The faces as a cage for subdivision.
    pub cage: Cage,
    /// Vertices.
    pub vertices: u64,
    /// Triangles.
    pub triangles: u64,
    /// Segments, of a file without faces.
    #[serde(default)]
    pub segments: u64,
    /// Points, of a file without faces: of a PLY file that has vertices alone, all of them.
    #[serde(default)]
    pub points: u64,
    /// Edges.
    pub edges: u64,
    /// Connected pieces of material: shells that do not look inwards.
    pub components: u64,
    /// Connected pieces of surface.
    pub shells: u64,
    /// Shells that look inwards: sealed voids.
    pub cavities: u64,
    /// Handles of all pieces, if the mesh is a closed 2-manifold.
    pub genus: Option<i64>,
    /// Vertices less edges plus triangles.
    pub euler: i64,
    /// Edges of one triangle.
    pub boundary_edges: u64,
    /// Edges of three triangles or more.
    pub nonmanifold_edges: u64,
    /// Vertices whose triangles are no single fan.
    pub nonmanifold_vertices: u64,
    /// Pairs of neighbours that disagree about the outside.
    pub flipped_pairs: u64,
    /// Triangles without area.
    pub degenerate_triangles: u64,
    /// Whether the mesh is closed, oriented and manifold.
    pub closed_manifold: bool,
    /// Lower and upper corner.
    pub bbox_mm: Option<[[f64; 3]; 2]>,
    /// What the faces enclose; means nothing unless the mesh is closed.
    pub volume_mm3: Option<f64>,
    /// Area of all faces.
    pub area_mm2: Option<f64>,
    /// What a slicer will ask or suffer from, with the way out.
    pub prompts: Vec<Prompt>,
}

/// The faces as a cage for subdivision: a 2-manifold with boundary, or the first reasons why it is none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Cage {
    /// Whether it is one.
    pub manifold: bool,
    /// Faces.
    pub faces: u64,
    /// Faces by their number of corners.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub faces_by_corners: Option<BTreeMap<String, u64>>,
    /// Edges.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub edges: Option<u64>,
    /// Vertices less edges plus faces.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub euler: Option<i64>,
    /// Loops of edges with one face.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub boundary_loops: Option<u64>,
    /// Why it is none.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub faults: Vec<Finding>,
}

/// What a slicer will ask or suffer from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Prompt {
    /// Stable code.
    pub code: String,
    /// What, in words, with the way out.
    pub message: String,
}

/// Reads a mesh file; its format is detected unless it is given.
///
/// # Errors
/// When the file cannot be read within the limits.
pub fn read(bytes: &[u8], format: Option<Format>, limits: &ReadLimits) -> Result<MeshFile, Problem> {
    production::guarded(|| format::read(bytes, format, limits))?.map_err(|error| format_problem(&error))
}

/// What may be built of an upload; its length is a setting.
fn limits_of_uploads(upload_bytes: u64) -> ReadLimits {
    ReadLimits { file_bytes: upload_bytes, vertices: 20_000_000, triangles: 20_000_000, ..ReadLimits::default() }
}

/// What was found in a mesh file that was uploaded.
#[derive(Debug, Serialize, Deserialize)]
pub struct Examined {
    /// The digest of the file.
    pub digest: Digest,
    /// What it holds.
    pub report: MeshReport,
}

/// Reads and examines a mesh file that was uploaded.
///
/// # Errors
/// When it cannot be read within the limits, or holds nothing.
pub fn examine(path: &Path, format: Option<Format>, upload_bytes: u64) -> Result<Examined, Problem> {
    let bytes = std::fs::read(path).map_err(|error| Problem::io("the file that arrived cannot be read", &error))?;
    let file = read(&bytes, format, &limits_of_uploads(upload_bytes))?;
    let (digest, length) = (Digest::of(&bytes), bytes.len() as u64);
    // The report takes memory of its own.
    drop(bytes);
    if file.is_empty() {
        let format = file.facts.format;
        let detail = format!("the {format} file holds no polygons, segments or points; a mesh or wires are expected");
        return Err(Problem::new(ProblemKind::InvalidFile, detail).code("upload.empty"));
    }
    Ok(Examined { digest, report: report(&file, length)? })
}

/// What can be counted in a mesh.
///
/// # Errors
/// When it is so large that counting it has no memory.
pub fn topology(file: &MeshFile) -> Result<Topology, Problem> {
    let topology = production::guarded(|| Topology::of(&file.mesh, &Budget::default()))?;
    topology.map_err(|error| Problem::new(ProblemKind::InvalidFile, error.to_string()).code("inspect.topology"))
}

/// Tells what is in a mesh file of a length.
///
/// # Errors
/// As [`topology`].
pub fn report(file: &MeshFile, bytes: u64) -> Result<MeshReport, Problem> {
    let topology = topology(file)?;
    let (mesh, facts) = (&file.mesh, &file.facts);
    let (volume, area) = (mass::volume(mesh), mass::area(mesh));
    // Of faces that have no inside there is nothing to count.
    let finite = |value: f64| (value.is_finite() && file.unfilled.is_empty()).then_some(value);
    Ok(MeshReport {
        format: facts.format.facts().ending.to_owned(),
        encoding: facts.encoding.to_owned(),
        bytes,
        unit: facts.unit.map_or("none, taken for mm", unit_word).to_owned(),
        objects: facts.object_names.clone(),
        polygons_fanned: file.polygons.len() as u64,
        left_out: facts.left_out.iter().map(|(word, count)| ((*word).to_owned(), *count)).collect(),
        cage: cage(file),
        vertices: mesh.vertices.len() as u64,
        triangles: mesh.triangles.len() as u64,
        segments: file.segments.len() as u64,
        points: file.points.len() as u64,
        edges: topology.edges,
        components: topology.components,
        shells: topology.shells,
        cavities: topology.cavities,
        genus: topology.is_closed_manifold().then_some(topology.genus),
        euler: topology.euler,
        boundary_edges: topology.boundary_edges,
        nonmanifold_edges: topology.nonmanifold_edges,
        nonmanifold_vertices: topology.nonmanifold_vertices,
        flipped_pairs: topology.flipped_pairs,
        degenerate_triangles: topology.degenerate_triangles,
        closed_manifold: topology.is_closed_manifold(),
        bbox_mm: bounding_box(mesh),
        volume_mm3: finite(volume),
        area_mm2: finite(area),
        prompts: prompts(file, volume, &topology),
    })
}

/// Polygons that no triangles fill, as findings.
#[must_use]
pub fn unfilled(file: &MeshFile) -> Vec<Finding> {
    let finding = |(face, fault): &(u64, PolygonFault)| Finding {
        pointer: format!("/faces/{face}"),
        code: fault.code().to_owned(),
        message: format!("face {face}: {fault}"),
        line: None,
        column: None,
    };
    file.unfilled.iter().map(finding).collect()
}

fn cage(file: &MeshFile) -> Cage {
    // Segments and points are no faces of a cage.
    let faces = if file.mesh.triangles.is_empty() { Vec::new() } else { file.faces() };
    let count = faces.len() as u64;
    match HalfEdgeMesh::new(file.mesh.vertices.len(), &faces) {
        Ok(mesh) => {
            let mut sizes = BTreeMap::<String, u64>::new();
            faces.iter().for_each(|face| *sizes.entry(face.len().to_string()).or_default() += 1);
            Cage {
                manifold: true,
                faces: mesh.face_count() as u64,
                faces_by_corners: Some(sizes),
                edges: Some(mesh.edge_count() as u64),
                euler: Some(mesh.euler()),
                boundary_loops: Some(mesh.boundary_loops().len() as u64),
                faults: Vec::new(),
            }
        }
        Err(faults) => {
            let faults = faults.iter().map(|fault| Finding {
                pointer: fault.pointer(),
                code: fault.code().to_owned(),
                message: fault.to_string(),
                line: None,
                column: None,
            });
            let faults = faults.collect();
            Cage { manifold: false, faces: count, faces_by_corners: None, edges: None, euler: None, boundary_loops: None, faults }
        }
    }
}

fn unit_word(unit: Unit) -> &'static str {
    match unit {
        Unit::Micron => "um",
        Unit::Millimetre => "mm",
        Unit::Centimetre => "cm",
        Unit::Inch => "in",
        Unit::Foot => "ft",
        Unit::Metre => "m",
    }
}

fn bounding_box(mesh: &TriMesh) -> Option<[[f64; 3]; 2]> {
    let first = *mesh.vertices.first()?;
    let (low, high) = mesh.vertices.iter().fold((first, first), |(low, high), &vertex| (low.min(vertex), high.max(vertex)));
    Some([low.to_array(), high.to_array()])
}

/// What a slicer will ask or suffer from, with the way out.
fn prompts(file: &MeshFile, volume: f64, topology: &Topology) -> Vec<Prompt> {
    let mut prompts = Vec::new();
    let mut prompt = |code: &str, message: String| prompts.push(Prompt { code: code.to_owned(), message });
    let size = volume.abs();
    if size > 0.0 && size < METRE_PROMPT_MM3 {
        prompt(
            "slicer.unit-metres",
            format!("{size} mm3 is below {METRE_PROMPT_MM3} mm3: slicers ask whether the file is in metres; answer no"),
        );
    } else if size > 0.0 && size < INCH_PROMPT_MM3 {
        prompt(
            "slicer.unit-inches",
            format!("{size} mm3 is below {INCH_PROMPT_MM3} mm3: slicers ask whether the file is in inches; answer no"),
        );
    }
    if file.facts.unit.is_none() {
        prompt("file.no-unit", "the file names no unit; programs take its numbers for mm".to_owned());
    }
    for (word, count) in &file.facts.left_out {
        prompt("file.left-out", format!("{count} shapes of the kind {word} hold no polygons and were left out"));
    }
    let wires = file.segments.len() + file.points.len();
    if wires > 0 {
        prompt(
            "file.wires",
            format!(
                "the file holds {} segments, {} points and no faces: nothing to print before they are thickened (lacuna solidify --radius)",
                file.segments.len(),
                file.points.len()
            ),
        );
    }
    if let Some((face, fault)) = file.unfilled.first() {
        prompt(
            fault.code(),
            format!(
                "{} faces have no inside, so that area and volume mean nothing; the first is face {face}: {fault}",
                file.unfilled.len()
            ),
        );
    }
    if wires == 0 && !topology.is_closed_manifold() {
        prompt("mesh.not-manifold", "the mesh is no closed 2-manifold: slicers repair it by guessing; the volume means nothing; lacuna convert --repair mends what leaves no doubt".to_owned());
    } else if volume < 0.0 {
        prompt("mesh.inside-out", format!("the enclosed volume is {volume} mm3: the faces look inwards"));
    }
    if file.mesh.triangles.len() > MANY_TRIANGLES {
        prompt("slicer.many-triangles", format!("{} triangles; above {MANY_TRIANGLES} slicers become slow", file.mesh.triangles.len()));
    }
    prompts
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const TETRAHEDRON: &[u8] = b"OFF\n4 4 0\n0 0 0\n3 0 0\n0 3 0\n0 0 3\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";

    #[test]
    fn a_tetrahedron_is_told_as_it_is() {
        let file = read(TETRAHEDRON, None, &ReadLimits::default()).unwrap();
        let report = report(&file, TETRAHEDRON.len() as u64).unwrap();
        assert_eq!((report.closed_manifold, report.genus, report.edges), (true, Some(0), 6));
        assert!((report.volume_mm3.unwrap() - 4.5).abs() < 1e-12);
        assert_eq!(report.bbox_mm, Some([[0.0, 0.0, 0.0], [3.0, 3.0, 3.0]]));
        let codes: Vec<_> = report.prompts.iter().map(|prompt| prompt.code.as_str()).collect();
        assert_eq!(codes, ["slicer.unit-inches", "file.no-unit"]);
    }
}
