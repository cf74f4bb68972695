//! Inputs as solids: dilated by a ball, or what their closed surfaces bound.

use glam::DVec3;
use lacuna_boolean::{BooleanEngine, BooleanError, Fault, ManifoldRust};
use lacuna_kernel::attractor::{Attractor, refine};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::dilation::{dilate, predict};
use lacuna_kernel::error::Kind;
use lacuna_kernel::measure::mass::{area_within, dilated_difference, volume, volume_within};
use lacuna_kernel::measure::{AxisBox, bounding_box};
use lacuna_kernel::model::CellKind;
use lacuna_kernel::solid::{Rounded, Solid, SolidError, TriMesh, carried, misplaced_shell};
use lacuna_kernel::tessellation::Tessellation;
use lacuna_kernel::tolerance::{Radius, Tolerance};
use std::f64::consts::PI;

use crate::certificate::OperandStatement;
use crate::job::Input;
use crate::plan::{Plan, held_bytes, stl_bytes};
use crate::run::{JobError, lower_all, not_carried, wrong_inputs};
use crate::{Job, effort};

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
    pub(crate) meshes: Vec<TriMesh>,
    /// Whether every mesh is proven to be a solid that does not meet itself.
    pub(crate) is_proven: bool,
}

/// An input before it is a solid: its shape, its radius (0 for the solid itself) and its box.
pub(crate) struct Source<'a> {
    pub(crate) input: &'a Input,
    attractor: Attractor,
    radius_mm: f64,
    bounds: AxisBox,
}

impl<'a> Source<'a> {
    /// The one input of a job.
    pub(crate) fn only(job: &'a Job, budget: &Budget) -> Result<Self, JobError> {
        let one = || wrong_inputs(job, "this kind takes one");
        if job.inputs.len() == 1 { sources(job, budget)?.pop().ok_or_else(one) } else { Err(one()) }
    }

    /// Its surfaces, where it is a solid as it is.
    pub(crate) fn meshes(&self) -> Option<Vec<TriMesh>> {
        (self.radius_mm == 0.0 && is_solid(&self.attractor)).then(|| self.attractor.surfaces())
    }
}

/// All inputs of a job.
pub(crate) fn sources<'a>(job: &'a Job, budget: &Budget) -> Result<Vec<Source<'a>>, JobError> {
    let mut sources = Vec::with_capacity(job.inputs.len());
    for (input, lowered) in job.inputs.iter().zip(lower_all(job, budget)?) {
        let attractor = lowered.attractor;
        let radius_mm = input.radius_mm.or(job.params.radius_mm).unwrap_or(0.0);
        if radius_mm == 0.0 && !may_be_solid(&attractor) {
            let fault = attractor.warnings().iter().find(|warning| warning.contains("is taken as a surface"));
            return Err(not_a_solid(&input.name, fault.map_or("it is no closed surface", String::as_str)));
        }
        let largest = if radius_mm > 0.0 { attractor.radii(radius_mm)[1] } else { 0.0 };
        let bounds = bounding_box(&attractor, budget)?.grown(largest);
        sources.push(Source { input, attractor, radius_mm, bounds });
    }
    Ok(sources)
}

/// The refusal of an input that bounds nothing.
fn not_a_solid(name: &str, fault: &str) -> JobError {
    let message = format!(
        "input '{name}' encloses nothing: {fault}; give it a \"radius_mm\", and it is dilated by a ball of that radius, or ask for a repair if it is a mesh (--repair, \"repair\": true): it joins corners, turns triangles and closes small holes"
    );
    JobError::new(Kind::Invalid, "job.not-a-solid", message)
}

/// Whether a shape may bound something: it is all surface, and not only triangles, of which it is known already whether they close.
fn may_be_solid(attractor: &Attractor) -> bool {
    let states = || attractor.roots().iter().map(|root| attractor.automaton().state(root.state));
    let closed_meshes = is_solid(attractor);
    let surface = states().all(|state| state.kind == Some(CellKind::Face));
    closed_meshes || (surface && states().any(|state| !state.transitions.is_empty()))
}

/// Whether closed surfaces are all that there is.
pub(crate) fn is_solid(attractor: &Attractor) -> bool {
    attractor.roots().iter().all(|root| root.solid.is_some()) && !attractor.solids().is_empty()
}

/// The tolerance that single precision leaves.
pub(crate) fn share(sources: &[Source<'_>], tolerance: Tolerance) -> Result<Tolerance, JobError> {
    let exact = sources.iter().map(|source| source.bounds.extent()).fold(0.0, f64::max);
    // A solid may reach beyond the exact one by the tolerance.
    let taken_of = |tolerance_mm: f64| carried(exact + tolerance_mm);
    let taken = taken_of(tolerance.mm());
    if tolerance.mm() < 2.0 * taken {
        // With the one that is offered the solid reaches farther still, by a share that is nearly nothing.
        let offered = 2.0 * taken_of(2.0 * taken) * (1.0 + 1e-6);
        return Err(not_carried(tolerance, exact + tolerance.mm(), offered));
    }
    Ok(Tolerance::new(tolerance.mm() - taken)?)
}

/// One input as a solid, within a tolerance.
pub(crate) fn operand(source: &Source<'_>, tolerance: Tolerance, budget: &Budget) -> Result<Operand, JobError> {
    let Source { input, attractor, radius_mm, bounds } = source;
    let (mut warnings, mut bounds) = (attractor.warnings().to_vec(), *bounds);
    let mut is_proven = false;
    let (meshes, inner, outer, leaf_cells) = if *radius_mm > 0.0 {
        let dilation = dilate(attractor, Radius::new(*radius_mm)?, tolerance, budget)?;
        if dilation.crossings > 0 {
            warnings.push(format!("{} pairs of triangles of input '{}' cross", dilation.crossings, input.name));
        }
        bounds = dilation.bounds;
        is_proven = dilation.crossings == 0;
        (vec![dilation.solid.into_mesh()], dilation.inner_mm, dilation.outer_mm, dilation.leaf_cells)
    } else if is_solid(attractor) {
        (attractor.surfaces(), 0.0, 0.0, attractor.roots().len() as u64)
    } else {
        let (mesh, deviation, leaf_cells) = closed_surface(&input.name, attractor, tolerance, budget)?;
        (vec![mesh], deviation, deviation, leaf_cells)
    };
    let volume_error = match (*radius_mm > 0.0, inner > 0.0) {
        (true, _) => {
            let least = attractor.radii(*radius_mm)[0];
            meshes.iter().map(|mesh| dilated_difference(volume_within(mesh), least, inner, outer)).sum()
        }
        (false, true) => meshes.iter().map(|mesh| neighbourhood(mesh, inner)).sum(),
        (false, false) => 0.0,
    };
    let statement = OperandStatement {
        name: input.name.clone(),
        radius_mm: *radius_mm,
        inner_bound_mm: inner,
        outer_bound_mm: outer,
        triangles: meshes.iter().map(|mesh| mesh.triangles.len() as u64).sum(),
        mesh_volume_mm3: meshes.iter().map(volume).sum(),
    };
    Ok(Operand { statement, bounds, volume_error, leaf_cells, warnings, meshes, is_proven })
}

/// A closed surface of any family as a mesh, with its deviation and its cells.
///
/// The mesh bounds what the surface does but for points within the deviation d of the mesh: a cell and its triangle lie in a convex set within d of the triangle, so that the
/// straight way from the surface to the mesh, on which no winding number changes where it does not pass, stays within d of the mesh.
fn closed_surface(name: &str, attractor: &Attractor, tolerance: Tolerance, budget: &Budget) -> Result<(TriMesh, f64, u64), JobError> {
    let Tessellation { vertices, points, segments, triangles, deviation_mm, leaf_cells, .. } = refine(attractor, tolerance, budget)?;
    if !(points.is_empty() && segments.is_empty()) {
        return Err(not_a_solid(name, "some of it is no surface"));
    }
    let mut mesh = TriMesh { vertices, triangles };
    if volume(&mesh) < 0.0 {
        mesh.reverse();
    }
    match Solid::new(mesh, budget) {
        Ok(solid) => Ok((solid.into_mesh(), deviation_mm, leaf_cells)),
        Err(SolidError::Stopped(stopped)) => Err(stopped.into()),
        Err(other) => Err(not_a_solid(name, &format!("its surface does not close ({other})"))),
    }
}

/// The volume within d of a mesh's triangles is at most this. Of such a point the nearest one of the mesh is in a triangle, on whose normal the point lies; or on an edge of two triangles, across
/// which the point is in the sector between their normals, where it is no nearer to either; or it is a vertex. Edges of one triangle, of more, and of thin ones have all directions.
pub(crate) fn neighbourhood(mesh: &TriMesh, d: f64) -> f64 {
    let corner = |index: u32| mesh.vertices[index as usize];
    let mut sides: Vec<([u32; 2], DVec3)> = Vec::with_capacity(3 * mesh.triangles.len());
    for &[a, b, c] in &mesh.triangles {
        let (p, q) = (corner(b) - corner(a), corner(c) - corner(a));
        // Of a thinner triangle rounding leaves no direction.
        let normal = Some(p.cross(q)).filter(|normal| normal.length() > THIN * p.length() * q.length()).unwrap_or_default();
        sides.extend([[a, b], [b, c], [c, a]].map(|[from, to]| ([from.min(to), from.max(to)], normal)));
    }
    sides.sort_by_key(|(ends, _)| *ends);
    let sectors = sides.chunk_by(|a, b| a.0 == b.0).map(|edge| {
        let angle = match edge {
            [(_, m), (_, n)] if m.length_squared() > 0.0 && n.length_squared() > 0.0 => m.cross(*n).length().atan2(m.dot(*n)) + THIN,
            _ => 2.0 * PI,
        };
        angle * corner(edge[0].0[0]).distance(corner(edge[0].0[1]))
    });
    let (sectors, balls) = (sectors.sum::<f64>(), mesh.vertices.len() as f64 * 4.0 / 3.0 * PI * d.powi(3));
    (2.0 * d * area_within(mesh).high + 0.5 * d * d * sectors + balls) * (1.0 + NEIGHBOURHOOD_ROUNDING)
}

/// Relative rounding of [`neighbourhood`], a sum of up to 2^32 terms.
const NEIGHBOURHOOD_ROUNDING: f64 = 1e-6;
/// The sine of a corner below which a triangle's normal is not asked: above it the normal is off by some 1e-9, and angles by less than this.
const THIN: f64 = 1e-6;

impl Operand {
    /// Makes one mesh of several: what lies in any of them.
    pub(crate) fn join(&mut self, budget: &Budget) -> Result<(), JobError> {
        if self.meshes.len() > 1 {
            let meshes: Vec<&TriMesh> = self.meshes.iter().collect();
            let joined = ManifoldRust.union(&meshes, &budget.cancel).map_err(|error| at_fault(error, |_| &self.statement.name))?;
            (self.meshes, self.is_proven) = (vec![joined], false);
        }
        Ok(())
    }
}

/// The engine's error, by the name of the input that its operand belongs to.
pub(crate) fn at_fault<'n>(error: BooleanError, owner: impl Fn(usize) -> &'n str) -> JobError {
    let (kind, code) = (error.kind(), error.code());
    match error {
        BooleanError::NotASolid { operand, fault } => {
            let way_out = match fault {
                Fault::MisplacedShell(shell) if shell.winding > 1 => {
                    "give each shell as an input of its own to an operation \"union\" first"
                }
                Fault::MisplacedShell(_) | Fault::InsideOut => "ask for a repair, which turns it (--repair, \"repair\": true)",
                _ => "mend the mesh, or give it a \"radius_mm\"",
            };
            let message = format!("input '{}' is no solid: {fault}; {way_out}", owner(operand));
            JobError::new(kind, code, message)
        }
        BooleanError::Stopped(stopped) => stopped.into(),
        other => JobError::new(kind, code, other.to_string()),
    }
}

/// One input as one solid in single precision: several closed surfaces are joined.
pub(crate) fn solid_of(source: &Source<'_>, tolerance: Tolerance, budget: &Budget) -> Result<(Rounded, Operand), JobError> {
    let mut operand = operand(source, share(std::slice::from_ref(source), tolerance)?, budget)?;
    operand.join(budget)?;
    let mesh = operand.meshes.pop().unwrap_or_default();
    let rounded = rounded(&mesh, budget)?;
    budget.prove(operand.statement.inner_bound_mm.max(operand.statement.outer_bound_mm) + rounded.moved_mm);
    Ok((rounded, operand))
}

/// What is counted twice, or taken away, of what a closed mesh bounds, so many pairs of whose triangles meet; nothing of a solid.
pub(crate) fn miscounted(mesh: &TriMesh, crossings: u64) -> Option<String> {
    if crossings > 0 {
        let words =
            "triangles of the mesh meet where they are not joined: what its surface winds around twice counts twice in areas and volumes";
        return Some(format!("{crossings} pairs of {words}"));
    }
    misplaced_shell(mesh).map(|shell| format!("{shell} in areas and volumes"))
}

/// A mesh as a solid in single precision.
pub(crate) fn rounded(mesh: &TriMesh, budget: &Budget) -> Result<Rounded, JobError> {
    Solid::rounded(mesh, budget).map_err(|error| match error {
        SolidError::Stopped(stopped) => stopped.into(),
        other => JobError::new(
            Kind::Unreachable,
            "boolean.rounding",
            format!("the result is no solid any more in single precision ({other}); a larger radius or a smaller shape may do"),
        ),
    })
}

/// Predicts the cost of making solids of the inputs.
pub(crate) fn predicted(sources: &[Source<'_>], tolerance: Tolerance, budget: &Budget) -> Result<Plan, JobError> {
    let share = share(sources, tolerance)?;
    let (mut plan, mut seconds) = (Plan::default(), 0.0);
    for source in sources {
        if source.radius_mm > 0.0 {
            let prediction = predict(&source.attractor, Radius::new(source.radius_mm)?, share, true, budget)?;
            plan.triangles += prediction.triangles;
            plan.counted_triangles += prediction.counted_triangles;
            plan.counted_cells = plan.counted_cells.max(prediction.leaf_cells);
            seconds += effort::of_dilated_operand(&prediction);
            // One is made after the other.
            plan.memory_bytes = plan.memory_bytes.max(held_bytes(&prediction, true));
        } else {
            let triangles = source.attractor.roots().len() as f64;
            plan.triangles += triangles;
            seconds += effort::of_operand(triangles);
        }
    }
    plan.output_bytes = Some(stl_bytes(plan.triangles));
    plan.cpu_seconds = Some(seconds);
    Ok(plan)
}
