//! Booleans of solids: every input becomes a solid of its own, all are combined at once, and what is proven of the inputs bounds the result from both sides.
//!
//! Let M_i be the solids of the inputs A_i, with D(r_i - inner_i) in M_i in D(r_i + outer_i). Union and intersection grow with each of their operands, a
//! difference with its first and against the others; so the same operation of the inner solids lies in that of the M_i, and that in the one of the outer solids
//! (for operands that are taken away, inner and outer change places). Moving the surface by d, as rounding does, adds d to each of these lengths.

use lacuna_boolean::{BooleanEngine, ManifoldRust};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::error::{Kind, LimitFacts};
use lacuna_kernel::solid::{TriMesh, carried, without_flat_shells};
use lacuna_kernel::tolerance::Tolerance;

use crate::hull::Hull;
use crate::operand::{Operand, at_fault, operand, predicted, rounded, share, sources};
use crate::plan::{Plan, stl_bytes};
use crate::run::{JobError, Outcome, wrong_inputs};
use crate::{Geometry, Job, Operation, certificate};

/// Does a job of kind `intersect` with an operation.
pub(crate) fn combine(job: &Job, operation: Operation, tolerance: Tolerance, budget: &Budget) -> Result<Outcome, JobError> {
    match (operation, job.inputs.len()) {
        (Operation::Hull, _) | (Operation::Trim, 1) => {}
        (Operation::Trim, _) => return Err(wrong_inputs(job, "trim takes one")),
        (_, count) if count < 2 => return Err(wrong_inputs(job, "an operation takes two or more")),
        _ => {}
    }
    let sources = sources(job, budget)?;
    let share = share(&sources, tolerance)?;
    let mut operands = Vec::with_capacity(sources.len());
    let mut reached_mm = 0.0_f64;
    for (index, source) in sources.iter().enumerate() {
        let made = operand(source, share, &budget.aside()).map_err(|error| error.of_input(job, index))?;
        // That of the solids made so far, in double precision.
        reached_mm = reached_mm.max(made.statement.inner_bound_mm).max(made.statement.outer_bound_mm);
        budget.prove(reached_mm);
        operands.push(made);
    }
    drop(sources);
    budget.report("combine", 0.0, 0);
    let combined =
        if operation == Operation::Trim { trim(job, &mut operands, budget)? } else { evaluate(operation, &mut operands, budget)? };
    // What surfaces that touch leave between them is no thicker than what single precision moves, and no part of the result.
    let flat_mm = carried(combined.vertices.iter().map(|vertex| vertex.abs().max_element()).fold(0.0, f64::max));
    let without_flat = without_flat_shells(&combined, flat_mm);
    let left_out_mm = if without_flat.is_some() { flat_mm } else { 0.0 };
    let combined = without_flat.unwrap_or(combined);
    if combined.triangles.is_empty() {
        let message = match operation {
            Operation::Union | Operation::Hull => "the inputs have no volume",
            Operation::Intersection => {
                "the result is empty: no point lies inside of all inputs, but for what is as thin as rounding, though surfaces may touch"
            }
            Operation::Trim | Operation::Split => "nothing of the solid lies behind the plane: turn its normal, or move it",
            Operation::Difference => "the result is empty: the other inputs cover all of the first, but for what is as thin as rounding",
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
    let hull = match operation {
        Operation::Hull => Some(Hull::of(&combined, operands.iter().flat_map(|operand| &operand.meshes), budget)?),
        _ => None,
    };
    let mut rounded = rounded(&combined, budget)?;
    rounded.moved_mm += left_out_mm;
    budget.report("combine", 1.0, rounded.solid.mesh().triangles.len() as u64);
    let certificate = certificate::of_operation(operation, ManifoldRust.name(), &operands, &rounded, hull.as_ref(), tolerance);
    Ok(Outcome { geometry: Geometry::Solid(rounded.solid), certificate })
}

/// What lies behind the job's plane, where its normal does not point to.
fn trim(job: &Job, operands: &mut [Operand], budget: &Budget) -> Result<TriMesh, JobError> {
    let missing = || JobError::new(Kind::Invalid, "bad-parameter", "trim needs plane, the plane that cuts".into());
    let (plane, operand) = (job.params.plane.ok_or_else(missing)?, operands.first_mut().ok_or_else(missing)?);
    operand.join(budget)?;
    let empty = TriMesh::default();
    let whole = operand.meshes.first().unwrap_or(&empty);
    let cut = ManifoldRust.cut(whole, plane.normal, plane.offset_mm, &budget.cancel);
    let [behind, _] = cut.map_err(|error| at_fault(error, |_| &operand.statement.name))?;
    Ok(behind)
}

/// Combines the inputs: an input of several surfaces is what lies in any of them.
fn evaluate(operation: Operation, operands: &mut [Operand], budget: &Budget) -> Result<TriMesh, JobError> {
    let engine_operation = match operation {
        Operation::Union => lacuna_boolean::Operation::Union,
        Operation::Intersection => lacuna_boolean::Operation::Intersection,
        // One input is trimmed or split by planes, elsewhere.
        Operation::Difference | Operation::Trim | Operation::Split => lacuna_boolean::Operation::Difference,
        Operation::Hull => lacuna_boolean::Operation::Hull,
    };
    // An input of several surfaces is joined first where that is not what the operation does with it anyway.
    for (index, operand) in operands.iter_mut().enumerate() {
        if operation == Operation::Intersection || (operation == Operation::Difference && index == 0) {
            operand.join(budget)?;
        }
    }
    let (mut meshes, mut owners) = (Vec::new(), Vec::new());
    for operand in operands.iter() {
        meshes.extend(operand.meshes.iter().map(|mesh| lacuna_boolean::Operand { mesh, is_proven: operand.is_proven }));
        owners.resize(meshes.len(), operand.statement.name.as_str());
    }
    let combined = ManifoldRust.combine(engine_operation, &meshes, &budget.cancel);
    combined.map_err(|error| at_fault(error, |operand| owners.get(operand).copied().unwrap_or_default()))
}

/// Predicts the cost of a job of kind `intersect`: that of its inputs, and of what the engine holds beside them. What remains of the inputs is known when the
/// operation is done; so it is done, as `rehearse` does, with a tolerance at which that is soon.
pub(crate) fn plan(
    job: &Job,
    tolerance: Tolerance,
    budget: &Budget,
    rehearse: impl Fn(Tolerance, &Budget) -> Result<Outcome, JobError>,
) -> Result<Plan, JobError> {
    let plan = predicted(&sources(job, budget)?, tolerance, budget)?;
    let memory_bytes = plan.memory_bytes + ENGINE_BYTES_PER_TRIANGLE * plan.triangles;
    let quiet = Budget { progress: None, ..budget.clone() };
    let at = |factor: f64| -> Result<Option<f64>, JobError> {
        match rehearse(Tolerance::new(factor * tolerance.mm())?, &quiet) {
            Ok(outcome) => Ok(Some(outcome.certificate.triangles as f64)),
            // Whoever is to stop does not go on; any other refusal may be that of the larger tolerance.
            Err(error) => budget.cancel.check().map(|()| None).map_err(|_| error),
        }
    };
    // The number of triangles goes with the inverse of the tolerance, or less.
    let halvings = (plan.counted_triangles.max(plan.triangles) / REHEARSED).log2().ceil().max(0.0);
    let found = if halvings == 0.0 {
        at(1.0)?
    } else if plan.counted_triangles > 0.0 {
        let (near, far) = (at(halvings.exp2())?, at((halvings + 1.0).exp2())?);
        near.zip(far).map(|(near, far)| near * (near / far).clamp(1.0, 2.0).powf(halvings))
    } else {
        None
    };
    let triangles = found.unwrap_or(plan.triangles);
    Ok(Plan { triangles, output_bytes: Some(stl_bytes(triangles)), memory_bytes, ..plan })
}

/// Triangles of the operands that an operation is done with in some tens of milliseconds.
const REHEARSED: f64 = 4_000.0;

/// Bytes that the engine holds for each triangle of its operands.
const ENGINE_BYTES_PER_TRIANGLE: f64 = 500.0;
