//! Plane sections of a solid: layers, templates and drawings.

use glam::DVec3;
use lacuna_kernel::budget::Budget;
use lacuna_kernel::error::{Kind, LimitFacts};
use lacuna_kernel::measure::section::{Grazed, PlaneFrame, Section, SectionError, grazed, sections};
use lacuna_kernel::solid::{Solid, TriMesh};
use lacuna_kernel::tessellation::Tessellation;
use lacuna_kernel::tolerance::Tolerance;

use crate::certificate::{self, PlaneStatement, SectionsStatement};
use crate::job::Planes;
use crate::operand::{Source, miscounted, solid_of};
use crate::plan::Plan;
use crate::run::{JobError, Outcome, StreamError};
use crate::{Geometry, Job};

/// A solid and the planes that cut it. Sections are made when they are asked for: a stack of any height takes no memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Stack {
    /// The solid.
    pub solid: Solid,
    /// The planes' axes.
    pub frame: PlaneFrame,
    /// Where the planes are along the normal, in mm.
    pub offsets_mm: Vec<f64>,
}

/// Planes that a job may have: each has a line in the certificate.
const MOST_PLANES: usize = 100_000;

impl Stack {
    /// Hands over the sections in the order of the offsets.
    ///
    /// # Errors
    /// A stop, or what `sink` returns.
    pub fn each<E>(&self, budget: &Budget, sink: &mut dyn FnMut(&Section) -> Result<(), E>) -> Result<(), StreamError<E>> {
        sections(&self.solid, &self.frame, &self.offsets_mm, budget, &mut |section| sink(&section).map_err(StreamError::Sink))
    }

    /// All sections where they are in space, as wires to look at.
    ///
    /// # Errors
    /// A stop.
    pub fn wires(&self, budget: &Budget) -> Result<Tessellation, JobError> {
        let mut wires = Tessellation::default();
        let each = self.each::<JobError>(budget, &mut |section| {
            for points in section.loops() {
                let (first, count) = (wires.vertices.len() as u32, points.len() as u32);
                wires.vertices.extend(points.iter().map(|point| self.frame.point(point.to_array(), section.offset_mm)));
                wires.segments.extend((0..count).map(|k| [first + k, first + (k + 1) % count]));
            }
            Ok(())
        });
        each.map_err(JobError::from)?;
        Ok(wires)
    }
}

impl<E> From<SectionError> for StreamError<E> {
    fn from(error: SectionError) -> Self {
        Self::Job(error.into())
    }
}

impl From<StreamError<Self>> for JobError {
    fn from(error: StreamError<Self>) -> Self {
        match error {
            StreamError::Job(error) | StreamError::Sink(error) => error,
            StreamError::NotPoints => Self::new(Kind::Defect, "internal", "sections are no points".into()),
        }
    }
}

impl From<SectionError> for JobError {
    fn from(error: SectionError) -> Self {
        Self::new(error.kind(), error.code(), error.to_string())
    }
}

/// Does a job of kind `slice`.
pub(crate) fn slice(job: &Job, tolerance: Tolerance, budget: &Budget) -> Result<Outcome, JobError> {
    let (planes, frame) = planes(job)?;
    let source = Source::only(job, budget)?;
    let (rounded, operand) = solid_of(&source, tolerance, budget)?;
    let mut certificate = certificate::of_operand(&rounded, &operand, tolerance);
    certificate.warnings.extend(miscounted(rounded.solid.mesh(), rounded.crossings));
    let offsets_mm = offsets(planes, &rounded.solid.mesh().vertices, &frame)?;
    let stack = Stack { solid: rounded.solid, frame, offsets_mm };
    if let Some(Grazed { planes, first_mm }) = grazed(stack.solid.mesh(), &stack.frame, &stack.offsets_mm, rounded.moved_mm) {
        let (count, moved) = (stack.offsets_mm.len(), rounded.moved_mm);
        certificate.warnings.push(format!(
            "{planes} of {count} planes, the first at {first_mm} mm, lie in faces that are level but for rounding, by {moved:.1e} mm at most: what of these is cut there means nothing; a plane {:.1e} mm higher or lower cuts the solid above or below such a face",
            2.0 * moved
        ));
    }
    let mut told = Vec::with_capacity(stack.offsets_mm.len());
    let each = stack.each::<JobError>(budget, &mut |section| {
        told.push(PlaneStatement {
            offset_mm: section.offset_mm,
            polygons: section.polygons.len() as u64,
            holes: section.polygons.iter().map(|polygon| polygon.holes.len() as u64).sum(),
            // An empty sum is a negative zero.
            area_mm2: section.area_mm2() + 0.0,
            perimeter_mm: section.perimeter_mm() + 0.0,
        });
        Ok(())
    });
    each.map_err(JobError::from)?;
    if told.is_empty() {
        let words = "no sections: the middle of the first layer is beyond the solid; take a smaller step";
        certificate.warnings.push(words.into());
    }
    let empty = told.iter().filter(|plane| plane.polygons == 0).count();
    if empty > 0 {
        certificate.warnings.push(format!("{empty} of {} sections are empty: their planes miss the solid, or only touch it", told.len()));
    }
    let [normal, u, v] = [frame.normal(), frame.u(), frame.v()].map(|axis| axis.to_array());
    certificate.sections = Some(SectionsStatement { normal, u, v, planes: told });
    Ok(Outcome { geometry: Geometry::Sections(Box::new(stack)), certificate })
}

/// What the job says of its planes.
fn planes(job: &Job) -> Result<(&Planes, PlaneFrame), JobError> {
    let bad = |message: String| JobError::new(Kind::Invalid, "bad-parameter", message);
    let missing = || bad("slice needs its planes: offsets_mm or step_mm".into());
    let planes = job.params.planes.as_ref().ok_or_else(missing)?;
    let frame = PlaneFrame::new(planes.normal).map_err(|error| bad(error.to_string()))?;
    Ok((planes, frame))
}

/// The offsets asked for; with a step, those in the middles of layers from the bottom of the solid to its top.
fn offsets(planes: &Planes, vertices: &[DVec3], frame: &PlaneFrame) -> Result<Vec<f64>, JobError> {
    let too_many = |asked: f64, remedy: Option<(&'static str, f64)>| {
        let message =
            format!("the job has {asked:.0} planes, and at most {MOST_PLANES} are possible; take fewer at a time, or a larger step");
        let limit = LimitFacts { limit: "planes", asked, allowed: MOST_PLANES as f64, remedy };
        JobError { limit: Some(limit), ..JobError::new(Kind::Limit, "limit.planes", message) }
    };
    let Some(step) = planes.step_mm else {
        let count = planes.offsets_mm.len();
        return if count <= MOST_PLANES { Ok(planes.offsets_mm.clone()) } else { Err(too_many(count as f64, None)) };
    };
    let ends = ends(vertices.iter().map(|&vertex| frame.offset(vertex)));
    let count = ((ends.1 - ends.0) / step).ceil().max(1.0);
    if count > MOST_PLANES as f64 {
        return Err(too_many(count, Some(("step_mm", (ends.1 - ends.0) / MOST_PLANES as f64 * (1.0 + 1e-9)))));
    }
    let layers = (0..count as u32).map(|layer| ends.0 + (f64::from(layer) + 0.5) * step);
    Ok(layers.filter(|offset| *offset < ends.1).collect())
}

/// The least and the largest of some heights.
fn ends(heights: impl Iterator<Item = f64>) -> (f64, f64) {
    heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

/// Bytes of a point in a drawing: two numbers of up to 17 digits, signs, points and a letter, or two codes and line ends in DXF. Found on spheres and waves of 14,000 to a million triangles, as is
/// the next.
const SVG_BYTES_PER_POINT: f64 = 38.0;
const DXF_BYTES_PER_POINT: f64 = 46.0;
/// Bytes that a process holds for each triangle of a solid that is cut.
const BYTES_PER_TRIANGLE: f64 = 700.0;

/// Predicts the cost: that of the solid, and of the points where planes cut it. Of what is thickened first, no more than that is known before there is a mesh.
pub(crate) fn plan(job: &Job, tolerance: Tolerance, budget: &Budget) -> Result<Plan, JobError> {
    let (planes, frame) = planes(job)?;
    let source = Source::only(job, budget)?;
    let plan = Plan { cpu_seconds: None, ..crate::operand::predicted(std::slice::from_ref(&source), tolerance, budget)? };
    let Some(meshes) = source.meshes() else { return Ok(Plan { output_bytes: None, ..plan }) };
    let of_drawing = |name: &String| if name == "dxf" { DXF_BYTES_PER_POINT } else { SVG_BYTES_PER_POINT };
    let bytes_per_point = if job.outputs.is_empty() { SVG_BYTES_PER_POINT } else { job.outputs.iter().map(of_drawing).sum() };
    let output_bytes = Some(bytes_per_point * points(planes, &frame, &meshes)?);
    Ok(Plan { output_bytes, memory_bytes: plan.memory_bytes + BYTES_PER_TRIANGLE * plan.triangles, ..plan })
}

/// How many points the sections of some meshes have: a plane has one for each triangle that it cuts. Cost: n log m for n triangles and m planes.
fn points(planes: &Planes, frame: &PlaneFrame, meshes: &[TriMesh]) -> Result<f64, JobError> {
    let vertices: Vec<DVec3> = meshes.iter().flat_map(|mesh| &mesh.vertices).copied().collect();
    let mut heights = offsets(planes, &vertices, frame)?;
    heights.sort_unstable_by(f64::total_cmp);
    let below = |x: f64| heights.partition_point(|&height| height < x);
    let of_mesh = |mesh: &TriMesh| {
        let cut = |triangle: &[u32; 3]| {
            let (low, high) = ends(triangle.iter().map(|&corner| frame.offset(mesh.vertices[corner as usize])));
            (below(high) - below(low)) as f64
        };
        mesh.triangles.iter().map(cut).sum::<f64>()
    };
    Ok(meshes.iter().map(of_mesh).sum())
}
