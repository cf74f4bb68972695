//! `lacuna inspect`: what a mesh file really contains, and what a slicer will make of it.

use std::path::Path;

use lacuna_exchange::format::{self, MeshFile, ReadLimits, Unit};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::measure::mass;
use lacuna_kernel::model::HalfEdgeMesh;
use lacuna_kernel::solid::{Topology, TriMesh};
use serde_json::{Value, json};

use super::{print_json, read_input};
use crate::problem::{Problem, ProblemKind};
use crate::production::{self, format_problem};

/// Slicers of the PrusaSlicer line ask whether an object of less volume was saved in inches.
const INCH_PROMPT_MM3: f64 = 8.0;
/// ... and whether one of less volume than this was saved in metres.
const METRE_PROMPT_MM3: f64 = 0.008;
/// Above so many triangles slicers become slow.
const MANY_TRIANGLES: usize = 1_000_000;

/// Reads a mesh file and tells what is in it as JSON.
pub(super) fn inspect(path: &Path) -> Result<(), Problem> {
    let (file, bytes) = mesh_file(path)?;
    print_json(&report(&file, bytes, &topology(path, &file)?))
}

/// Reads a mesh file; gives its length too.
pub(super) fn mesh_file(path: &Path) -> Result<(MeshFile, usize), Problem> {
    let limits = ReadLimits::default();
    let bytes = read_input(path, limits.file_bytes)?;
    let file = production::guarded(|| format::read(&bytes, None, &limits))?.map_err(|error| format_problem(&error))?;
    Ok((file, bytes.len()))
}

/// What can be counted in a mesh file.
pub(super) fn topology(path: &Path, file: &MeshFile) -> Result<Topology, Problem> {
    let topology = production::guarded(|| Topology::of(&file.mesh, &Budget::default()))?;
    topology.map_err(|error| Problem::new(ProblemKind::InvalidFile, format!("{}: {error}", path.display())).code("inspect.topology"))
}

fn report(file: &MeshFile, bytes: usize, topology: &Topology) -> Value {
    let (mesh, facts) = (&file.mesh, &file.facts);
    let (volume, area) = (mass::volume(mesh), mass::area(mesh));
    json!({
        "format": facts.format.facts().ending,
        "encoding": facts.encoding,
        "bytes": bytes,
        "unit": facts.unit.map_or("none, taken for mm", unit_word),
        "objects": facts.object_names,
        "polygons_fanned": file.fans.len(),
        "left_out": facts.left_out.iter().map(|(word, count)| ((*word).to_owned(), json!(count))).collect::<serde_json::Map<_, _>>(),
        "cage": cage(file),
        "vertices": mesh.vertices.len(),
        "triangles": mesh.triangles.len(),
        "edges": topology.edges,
        "components": topology.components,
        "shells": topology.shells,
        "cavities": topology.cavities,
        "genus": topology.is_closed_manifold().then_some(topology.genus),
        "euler": topology.euler,
        "boundary_edges": topology.boundary_edges,
        "nonmanifold_edges": topology.nonmanifold_edges,
        "nonmanifold_vertices": topology.nonmanifold_vertices,
        "flipped_pairs": topology.flipped_pairs,
        "degenerate_triangles": topology.degenerate_triangles,
        "closed_manifold": topology.is_closed_manifold(),
        "bbox_mm": bounding_box(mesh),
        "volume_mm3": volume,
        "area_mm2": area,
        "prompts": prompts(file, volume, topology),
    })
}

/// The faces as a cage for subdivision: a 2-manifold with boundary, or the first reasons why it is none.
fn cage(file: &MeshFile) -> Value {
    let faces = file.faces();
    match HalfEdgeMesh::new(file.mesh.vertices.len(), &faces) {
        Ok(mesh) => {
            let mut sizes = std::collections::BTreeMap::<usize, u64>::new();
            faces.iter().for_each(|face| *sizes.entry(face.len()).or_default() += 1);
            json!({
                "manifold": true,
                "faces": mesh.face_count(),
                "faces_by_corners": sizes.iter().map(|(corners, count)| (corners.to_string(), json!(count))).collect::<serde_json::Map<_, _>>(),
                "edges": mesh.edge_count(),
                "euler": mesh.euler(),
                "boundary_loops": mesh.boundary_loops().len(),
            })
        }
        Err(faults) => {
            let faults =
                faults.iter().map(|fault| json!({ "pointer": fault.pointer(), "code": fault.code(), "message": fault.to_string() }));
            json!({ "manifold": false, "faces": faces.len(), "faults": faults.collect::<Vec<_>>() })
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
fn prompts(file: &MeshFile, volume: f64, topology: &Topology) -> Vec<Value> {
    let mut prompts = Vec::new();
    let mut prompt = |code: &str, message: String| prompts.push(json!({ "code": code, "message": message }));
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
    if !topology.is_closed_manifold() {
        prompt("mesh.not-manifold", "the mesh is no closed 2-manifold: slicers repair it by guessing; the volume means nothing".to_owned());
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
        let file = format::read(TETRAHEDRON, None, &ReadLimits::default()).unwrap();
        let topology = Topology::of(&file.mesh, &Budget::default()).unwrap();
        let report = report(&file, TETRAHEDRON.len(), &topology);
        assert_eq!((&report["closed_manifold"], &report["genus"], &report["edges"]), (&json!(true), &json!(0), &json!(6)));
        assert!((report["volume_mm3"].as_f64().unwrap() - 4.5).abs() < 1e-12);
        assert_eq!(report["bbox_mm"], json!([[0.0, 0.0, 0.0], [3.0, 3.0, 3.0]]));
        let codes: Vec<_> = report["prompts"].as_array().unwrap().iter().map(|p| p["code"].as_str().unwrap()).collect();
        assert_eq!(codes, ["slicer.unit-inches", "file.no-unit"]);
    }
}
