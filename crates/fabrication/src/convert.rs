//! Meshes as they are, for other formats: nothing is computed but the rounding to single precision and what can be counted.

use glam::DVec3;
use lacuna_kernel::budget::Budget;
use lacuna_kernel::error::{Kind, LimitFacts};
use lacuna_kernel::model::{PolygonMesh, Shape};
use lacuna_kernel::solid::{SolidError, Topology, TriMesh};
use lacuna_kernel::tolerance::Tolerance;

use crate::plan::{Plan, stl_bytes};
use crate::run::{Geometry, JobError, Outcome, not_carried};
use crate::{Job, certificate, effort};

/// The polygons of a job whose one input is nothing but polygons: everything else is evaluated.
pub(crate) fn polygons(job: &Job) -> Option<&PolygonMesh> {
    match job.inputs.as_slice() {
        [input] => match &input.model.shape {
            Shape::Mesh(mesh) if !mesh.faces.is_empty() && mesh.faces.iter().all(|face| face.len() > 2) => Some(mesh),
            _ => None,
        },
        _ => None,
    }
}

/// Triangles that the polygons become.
fn triangles(mesh: &PolygonMesh) -> u64 {
    mesh.faces.iter().map(|face| face.len() as u64 - 2).sum()
}

/// Cuts the polygons, rounds the mesh to single precision and counts. Cost: linear, but for faces that are not star-shaped from their first corner.
pub(crate) fn convert(mesh: &PolygonMesh, tolerance: Tolerance, budget: &Budget) -> Result<Outcome, JobError> {
    let count = triangles(mesh);
    if count > budget.limits.triangles {
        #[expect(clippy::cast_precision_loss, reason = "limits are shown, not computed with")]
        let (asked, allowed) = (count as f64, budget.limits.triangles as f64);
        let message = format!("the mesh has {count} triangles; {} are allowed", budget.limits.triangles);
        let limit = Some(LimitFacts { limit: "triangles", asked, allowed, remedy: None });
        return Err(JobError { limit, ..JobError::new(Kind::Limit, "convert.triangles", message) });
    }
    let vertices: Vec<DVec3> = mesh.vertices.iter().map(|vertex| vertex.as_vec3().as_dvec3()).collect();
    let moved = vertices.iter().zip(&mesh.vertices).map(|(rounded, given)| rounded.distance(*given)).fold(0.0, f64::max);
    // What the sums and the root of the distance lose; a coordinate beyond single precision is infinitely far.
    let moved_mm = if moved.is_finite() { moved * (1.0 + 8.0 * f64::EPSILON) } else { f64::INFINITY };
    if moved_mm > tolerance.mm() {
        let extent = mesh.vertices.iter().map(|vertex| vertex.abs().max_element()).fold(0.0, f64::max);
        return Err(not_carried(tolerance, extent, moved_mm));
    }
    budget.cancel.check()?;
    // As given: rounding may fold what is thinner than itself.
    let mut cut = mesh.cut().map_err(JobError::model)?;
    cut.mesh.vertices = vertices;
    let topology = Topology::of(&cut.mesh, budget).map_err(|error| match error {
        SolidError::Stopped(stopped) => stopped.into(),
        other => JobError::new(Kind::Invalid, "convert.mesh", other.to_string()),
    })?;
    let mut certificate = certificate::of_polygons(&cut.mesh, &topology, &mesh.vertices, moved_mm, tolerance);
    let collapsed = collapsed(&cut.mesh, &mesh.vertices);
    if collapsed > 0 {
        certificate.warnings.push(format!(
            "{collapsed} triangles have corners that are one place in single precision; a shape nearer to the origin keeps them, or a repair takes them away (--repair, \"repair\": true)"
        ));
    }
    Ok(Outcome { geometry: Geometry::Polygons { mesh: cut, closed: topology.is_closed_manifold() }, certificate })
}

/// Triangles with corners that were at different places and are not any more.
fn collapsed(rounded: &TriMesh, given: &[DVec3]) -> usize {
    let is_one = |a: u32, b: u32| {
        let [a, b] = [a, b].map(|corner| corner as usize);
        rounded.vertices[a] == rounded.vertices[b] && given[a] != given[b]
    };
    rounded.triangles.iter().filter(|&&[a, b, c]| is_one(a, b) || is_one(b, c) || is_one(c, a)).count()
}

/// What is known of it beforehand.
pub(crate) fn plan(mesh: &PolygonMesh) -> Plan {
    #[expect(clippy::cast_precision_loss, reason = "predictions are real numbers")]
    let (count, vertices) = (triangles(mesh) as f64, mesh.vertices.len() as f64);
    // Coordinates twice, triangles, and the edges that are counted.
    let memory_bytes = 48.0 * vertices + 36.0 * count;
    let cpu_seconds = Some(effort::of_conversion(count));
    Plan { leaf_cells: count, triangles: count, memory_bytes, output_bytes: Some(stl_bytes(count)), cpu_seconds, ..Plan::default() }
}
