//! Booleans of solids: every input becomes a solid of its own, all are combined at once, and what is proven of the inputs bounds the result from both sides.
//!
//! Let M_i be the solids of the inputs A_i, with D(r_i - inner_i) in M_i in D(r_i + outer_i). Union and intersection grow with each of their operands, a
//! difference with its first and against the others; so the same operation of the inner solids lies in that of the M_i, and that in the one of the outer solids
//! (for operands that are taken away, inner and outer change places). Moving the surface by d, as rounding does, adds d to each of these lengths.

use glam::DVec3;
use lacuna_boolean::{BooleanEngine, BooleanError, ManifoldRust};
use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::budget::Budget;
use lacuna_kernel::dilation::{dilate, predict};
use lacuna_kernel::error::{Kind, LimitFacts};
use lacuna_kernel::measure::mass::{dilated_difference, volume};
use lacuna_kernel::measure::{AxisBox, bounding_box};
use lacuna_kernel::solid::{Solid, SolidError, TriMesh, carried};
use lacuna_kernel::tolerance::{Radius, Tolerance};
use std::collections::HashMap;

use crate::certificate::{self, OperandStatement};
use crate::job::Input;
use crate::run::{JobError, Outcome, Plan, stl_bytes};
use crate::{Geometry, Job, Operation};

/// An input as a solid.
pub(crate) struct Operand {
    /// What is told of it.
    pub(crate) statement: OperandStatement,
    /// The box of the exact solid.
    pub(crate) bounds: AxisBox,
    /// The volume between the exact solid and its mesh is at most this, in mm^3.
    pub(crate) volume_error: f64,
    pub(crate) leaf_cells: u64,
    pub(crate) warnings: Vec<String>,
    meshes: Vec<TriMesh>,
}

/// An input before it is a solid: its shape, its radius (0 for the solid itself) and its box.
struct Source<'a> {
    input: &'a Input,
    attractor: Attractor,
    radius_mm: f64,
    bounds: AxisBox,
}

fn sources<'a>(job: &'a Job, budget: &Budget) -> Result<Vec<Source<'a>>, JobError> {
    let mut sources = Vec::with_capacity(job.inputs.len());
    for (index, input) in job.inputs.iter().enumerate() {
        budget.cancel.check()?;
        budget.report("validate", index as f64 / job.inputs.len() as f64, index as u64);
        let attractor = input.model.lower().map_err(|findings| JobError::model(findings).of_input(&input.name, index))?.attractor;
        let radius_mm = input.radius_mm.or(job.params.radius_mm).unwrap_or(0.0);
        if radius_mm == 0.0 && !is_solid(&attractor) {
            let message = format!(
                "input '{}' encloses nothing: it is no closed surface; give it a \"radius_mm\", and it is dilated by a ball of that radius",
                input.name
            );
            return Err(JobError::new(Kind::Invalid, "job.not-a-solid", message));
        }
        let bounds = bounding_box(&attractor, budget)?.grown(radius_mm);
        sources.push(Source { input, attractor, radius_mm, bounds });
    }
    Ok(sources)
}

/// Whether closed surfaces are all that there is.
fn is_solid(attractor: &Attractor) -> bool {
    attractor.roots().iter().all(|root| root.solid.is_some()) && !attractor.solids().is_empty()
}

/// The tolerance that single precision leaves.
fn share(sources: &[Source<'_>], tolerance: Tolerance) -> Result<Tolerance, JobError> {
    let extent = sources.iter().map(|source| source.bounds.extent()).fold(0.0, f64::max);
    let taken = carried(extent);
    if tolerance.mm() < 2.0 * taken {
        let reachable = 2.0 * taken;
        let message = format!(
            "single-precision files cannot carry a tolerance of {} mm at coordinates up to {extent:.1} mm; {reachable:.3e} mm can be carried",
            tolerance.mm()
        );
        let limit =
            LimitFacts { limit: "tolerance_mm", asked: tolerance.mm(), allowed: reachable, remedy: Some(("tolerance_mm", reachable)) };
        return Err(JobError { limit: Some(limit), ..JobError::new(Kind::Unreachable, "tolerance-unreachable", message) });
    }
    Ok(Tolerance::new(tolerance.mm() - taken)?)
}

/// Does a job of kind `intersect` with an operation.
pub(crate) fn combine(job: &Job, tolerance: Tolerance, budget: &Budget) -> Result<Outcome, JobError> {
    let Some(operation) = job.params.operation else {
        return Err(JobError::new(
            Kind::Invalid,
            "bad-parameter",
            "intersect needs an operation: union, intersection or difference".into(),
        ));
    };
    if job.inputs.len() < 2 {
        let message = format!("the job has {} inputs, and an operation takes two or more", job.inputs.len());
        return Err(JobError::new(Kind::Invalid, "job.inputs", message));
    }
    let sources = sources(job, budget)?;
    let share = share(&sources, tolerance)?;
    let mut operands = Vec::with_capacity(sources.len());
    for (index, source) in sources.iter().enumerate() {
        operands.push(operand(source, share, budget).map_err(|error| error.of_input(&source.input.name, index))?);
    }
    drop(sources);
    budget.report("combine", 0.0, 0);
    let combined = evaluate(operation, &operands, job, budget)?;
    if combined.triangles.is_empty() {
        let message = match operation {
            Operation::Union => "the inputs have no volume",
            Operation::Intersection => "the result is empty: no point lies inside of all inputs, though surfaces may touch",
            Operation::Difference => "the result is empty: the other inputs cover all of the first",
        };
        return Err(JobError::new(Kind::Unreachable, "boolean.empty", message.into()));
    }
    let count = combined.triangles.len() as u64;
    if count > budget.limits.triangles {
        let (asked, allowed) = (count as f64, budget.limits.triangles as f64);
        let message = format!("the result has {count} triangles, and {allowed} are allowed; allow more, or ask for a larger tolerance");
        let limit = LimitFacts { limit: "triangles", asked, allowed, remedy: Some(("triangles", asked)) };
        return Err(JobError { limit: Some(limit), ..JobError::new(Kind::Limit, "limit.triangles", message) });
    }
    let rounded = Solid::rounded(&combined, budget).map_err(|error| match error {
        SolidError::Stopped(stopped) => stopped.into(),
        other => JobError::new(
            Kind::Unreachable,
            "boolean.rounding",
            format!("the result is no solid any more in single precision ({other}); a larger radius or a smaller shape may do"),
        ),
    })?;
    budget.report("combine", 1.0, rounded.solid.mesh().triangles.len() as u64);
    let certificate = certificate::of_operation(operation, ManifoldRust.name(), &operands, &rounded, tolerance);
    Ok(Outcome { geometry: Geometry::Solid(rounded.solid), certificate })
}

/// One input as a solid, within a tolerance.
fn operand(source: &Source<'_>, tolerance: Tolerance, budget: &Budget) -> Result<Operand, JobError> {
    let Source { input, attractor, radius_mm, bounds } = source;
    let mut warnings = attractor.warnings().to_vec();
    let (meshes, inner, outer, leaf_cells) = if *radius_mm > 0.0 {
        let dilation = dilate(attractor, Radius::new(*radius_mm)?, tolerance, budget)?;
        if dilation.crossings > 0 {
            warnings.push(format!("{} pairs of triangles of input '{}' cross", dilation.crossings, input.name));
        }
        (vec![dilation.solid.mesh().clone()], dilation.inner_mm, dilation.outer_mm, dilation.leaf_cells)
    } else {
        (surfaces(attractor), 0.0, 0.0, attractor.roots().len() as u64)
    };
    let volume: f64 = meshes.iter().map(volume).sum();
    let volume_error = if *radius_mm > 0.0 { dilated_difference(volume, *radius_mm, inner, outer) } else { 0.0 };
    let statement = OperandStatement {
        name: input.name.clone(),
        radius_mm: *radius_mm,
        inner_bound_mm: inner,
        outer_bound_mm: outer,
        triangles: meshes.iter().map(|mesh| mesh.triangles.len() as u64).sum(),
        mesh_volume_mm3: volume,
    };
    Ok(Operand { statement, bounds: *bounds, volume_error, leaf_cells, warnings, meshes })
}

/// The closed surfaces of a shape. Corners at one place were one vertex of the model: placing it moved them alike.
fn surfaces(attractor: &Attractor) -> Vec<TriMesh> {
    let mut meshes = Vec::with_capacity(attractor.solids().len());
    for surface in attractor.solids() {
        let (mut mesh, mut numbers) = (TriMesh::default(), HashMap::new());
        for (index, corners) in surface.triangles.iter().enumerate() {
            let points = &attractor.roots()[surface.first_root + index].points;
            let mut number = |k: usize| {
                *numbers.entry(corners[k]).or_insert_with(|| {
                    mesh.vertices.push(DVec3::new(points[k][0], points[k][1], points[k][2]));
                    mesh.vertices.len() as u32 - 1
                })
            };
            let triangle = [number(0), number(1), number(2)];
            mesh.triangles.push(triangle);
        }
        meshes.push(mesh);
    }
    meshes
}

/// Combines the inputs: an input of several surfaces is what lies in any of them.
fn evaluate(operation: Operation, operands: &[Operand], job: &Job, budget: &Budget) -> Result<TriMesh, JobError> {
    let engine_operation = match operation {
        Operation::Union => lacuna_boolean::Operation::Union,
        Operation::Intersection => lacuna_boolean::Operation::Intersection,
        Operation::Difference => lacuna_boolean::Operation::Difference,
    };
    let named = |error: BooleanError, first: &[usize]| match error {
        BooleanError::NotASolid { operand, fault } => {
            let input = first.get(operand).copied().unwrap_or_default();
            let message = format!("input '{}' is no solid: {fault}; mend the mesh, or give it a \"radius_mm\"", job.inputs[input].name);
            JobError::new(Kind::Invalid, BooleanError::NotASolid { operand, fault }.code(), message)
        }
        BooleanError::Stopped(stopped) => stopped.into(),
        other => JobError::new(other.kind(), other.code(), other.to_string()),
    };
    // An input of several surfaces is joined first where that is not what the operation does with it anyway.
    let mut joined: Vec<Option<TriMesh>> = Vec::with_capacity(operands.len());
    for (index, operand) in operands.iter().enumerate() {
        let alike = operation == Operation::Union || (operation == Operation::Difference && index > 0);
        let whole = (!alike && operand.meshes.len() > 1).then(|| {
            let meshes: Vec<&TriMesh> = operand.meshes.iter().collect();
            ManifoldRust.union(&meshes, &budget.cancel).map_err(|error| named(error, &vec![index; meshes.len()]))
        });
        joined.push(whole.transpose()?);
    }
    let (mut meshes, mut owners) = (Vec::new(), Vec::new());
    for (index, (operand, joined)) in operands.iter().zip(&joined).enumerate() {
        let own: Vec<&TriMesh> = joined.as_ref().map_or_else(|| operand.meshes.iter().collect(), |mesh| vec![mesh]);
        owners.resize(owners.len() + own.len(), index);
        meshes.extend(own);
    }
    ManifoldRust.combine(engine_operation, &meshes, &budget.cancel).map_err(|error| named(error, &owners))
}

/// Predicts the cost of a job of kind `intersect`: that of its inputs.
pub(crate) fn plan(job: &Job, tolerance: Tolerance, budget: &Budget) -> Result<Plan, JobError> {
    let sources = sources(job, budget)?;
    let share = share(&sources, tolerance)?;
    let mut plan = Plan { leaf_cells: 0.0, triangles: 0.0, memory_bytes: 0.0, output_bytes: 0.0, lattice_pitch_mm: None };
    for source in &sources {
        if source.radius_mm > 0.0 {
            let prediction = predict(&source.attractor, Radius::new(source.radius_mm)?, share, budget)?;
            plan.triangles += prediction.triangles;
            plan.memory_bytes += prediction.memory_bytes;
        } else {
            plan.triangles += source.attractor.roots().len() as f64;
        }
    }
    // The engine holds its operands and the result beside those of the kernel.
    plan.memory_bytes += ENGINE_BYTES_PER_TRIANGLE * plan.triangles;
    plan.output_bytes = stl_bytes(plan.triangles);
    Ok(plan)
}

/// Bytes that the engine holds for each triangle of its operands.
const ENGINE_BYTES_PER_TRIANGLE: f64 = 500.0;
