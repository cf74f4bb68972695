//! From a legal job to finished files: what the service's workers and the command line share.

use std::collections::BTreeMap;
use std::io::{BufReader, BufWriter, Seek, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};

use lacuna_exchange::format::sections::SectionFile;
use lacuna_exchange::format::{self, Format, FormatError, Metadata, NamedMesh, PointFile, ScalarField};
use lacuna_fabrication::shape_measures::MappedThickness;
use lacuna_fabrication::{Certificate, Geometry, Job, Outcome, Plan, SolveRefusal, Solved, Stack, StreamError, Validation};
use lacuna_kernel::budget::{Budget, CancelToken, StopReason};
use lacuna_kernel::error::{Kind, LimitFacts};
use lacuna_kernel::model::Model;

use crate::digest::Digest;
use crate::files::{Allowance, Metered, PendingFile, Stoppable};
use crate::problem::{Problem, ProblemKind};

/// What is written into a file besides the geometry.
pub struct Label<'a> {
    /// The model's name.
    pub title: Option<&'a str>,
    /// A picture for file managers.
    pub thumbnail_png: Option<&'a [u8]>,
}

/// Does a job: [`compute`], or what stands for it in a test of the service.
pub type Compute = fn(&Job, &Budget) -> Result<Outcome, Problem>;

/// Who does jobs: the kernel, or what stands for it in a test of the service.
#[derive(Clone, Copy, Debug)]
pub struct Engine {
    /// Who does them in the service's own process; without anybody every worker has a process of its own, with the kernel.
    pub here: Option<Compute>,
    /// Predicts what a job costs.
    pub plan: fn(&Job, &Budget) -> Result<Plan, Problem>,
}

impl Engine {
    /// The kernel of this build.
    pub const KERNEL: Self = Self { here: None, plan };
}

/// Does a job. A panic of the kernel ends the job, not the process.
///
/// # Errors
/// The kernel's refusal, with pointers into the model document, or the defect.
pub fn compute(job: &Job, budget: &Budget) -> Result<Outcome, Problem> {
    let outcome = guarded(|| lacuna_fabrication::run(job, budget))?.map_err(Problem::from)?;
    check_certificate(&outcome.certificate)?;
    Ok(outcome)
}

/// A statement with an infinity or a NaN in it proves nothing, and JSON cannot carry it.
fn check_certificate(certificate: &Certificate) -> Result<(), Problem> {
    let written = serde_json::to_vec(certificate).and_then(|bytes| serde_json::from_slice::<Certificate>(&bytes));
    match written {
        Ok(read) if read == *certificate => Ok(()),
        Ok(_) => Err(Problem::internal("the certificate changes on its way through JSON")),
        Err(error) => Err(Problem::internal(format!("the certificate is not fit for JSON: {error}"))),
    }
}

/// Predicts what a job costs.
///
/// # Errors
/// As [`compute`].
pub fn plan(job: &Job, budget: &Budget) -> Result<Plan, Problem> {
    guarded(|| lacuna_fabrication::plan(job, budget))?.map_err(Problem::from)
}

/// Says what is wrong with a model.
///
/// # Errors
/// When the kernel has a defect.
pub fn validate(model: &Model, budget: &Budget) -> Result<Validation, Problem> {
    guarded(|| lacuna_fabrication::validate(model, budget))
}

/// Solves the unknown entries of a model for chosen values.
///
/// # Errors
/// The kernel's refusal, with pointers into the model document, or into the request for a chosen value.
pub fn solve(model: &Model, values: &BTreeMap<String, f64>, budget: &Budget) -> Result<Solved, SolveProblem> {
    let solved = guarded(|| lacuna_fabrication::solve(model, values, budget))?;
    solved.map_err(|refusal| match refusal {
        SolveRefusal::Model(error) => SolveProblem::Model(why_stopped(budget).unwrap_or_else(|| error.into())),
        SolveRefusal::Value { name, code, message } => SolveProblem::Value { name, code, message },
    })
}

/// Why a model is not solved: which of the two that were sent is at fault.
#[derive(Debug)]
pub enum SolveProblem {
    /// The model, with pointers into its document; or neither.
    Model(Problem),
    /// The value that was chosen under a name.
    Value {
        /// The name.
        name: String,
        /// Stable code.
        code: &'static str,
        /// What is wrong.
        message: String,
    },
}

impl From<Problem> for SolveProblem {
    fn from(problem: Problem) -> Self {
        Self::Model(problem)
    }
}

/// Why the budget's token was fired, if it was.
#[must_use]
pub fn why_stopped(budget: &Budget) -> Option<Problem> {
    budget.cancel.reason().map(|reason| stopped(reason, budget.limits.seconds))
}

/// A stop as a problem; `seconds` is the limit of time.
#[must_use]
pub fn stopped(reason: StopReason, seconds: f64) -> Problem {
    match reason {
        StopReason::Cancelled => Problem::new(ProblemKind::Cancelled, "Stopped by the caller"),
        StopReason::Deadline => {
            // How long it would have taken is not known; only that the limit was not enough.
            let facts = LimitFacts { limit: "seconds", asked: seconds, allowed: seconds, remedy: None };
            let detail =
                format!("The work was not done within {seconds} s; allow more seconds, a larger tolerance, or ask `plan` for the cost");
            Problem::new(ProblemKind::Limit, detail).code("limit.seconds").limit(&facts)
        }
    }
}

/// Runs what may have a defect and turns a panic into a problem.
///
/// # Errors
/// When it panicked.
pub fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, Problem> {
    // The job's data is dropped with the panic, so nothing half changed is seen afterwards.
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let said = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
        Problem::internal(format!("a computation panicked: {}", said.unwrap_or("no message")))
    })
}

/// Writes a result in a format and reads it back: what is proven of the mesh is proven of the file. Its bytes are taken from the allowance.
///
/// # Errors
/// When the format has no room for the geometry, the allowance or the device has none for the file, or the file differs from the mesh.
pub fn write_file(
    format: Format,
    outcome: &Outcome,
    label: &Label<'_>,
    pending: &mut PendingFile,
    allowance: &Allowance,
    token: &CancelToken,
) -> Result<(Digest, u64), Problem> {
    written(format, outcome, label, pending, allowance, token).map_err(|problem| too_long(allowance).unwrap_or(problem))
}

/// The refusal of files that do not fit into their allowance.
#[expect(clippy::cast_precision_loss, reason = "lengths are shown, not computed with")]
fn too_long(allowance: &Allowance) -> Option<Problem> {
    let (allowed, asked) = allowance.exceeded()?;
    let facts = LimitFacts { limit: "output_bytes", asked: asked as f64, allowed: allowed as f64, remedy: None };
    let detail = format!(
        "The files of the result have {asked} bytes and more, and {allowed} are allowed; ask for fewer formats or planes or a larger tolerance, or allow more output_bytes"
    );
    Some(Problem::new(ProblemKind::Limit, detail).code("limit.output-bytes").limit(&facts))
}

fn written(
    format: Format,
    outcome: &Outcome,
    label: &Label<'_>,
    pending: &mut PendingFile,
    allowance: &Allowance,
    token: &CancelToken,
) -> Result<(Digest, u64), Problem> {
    let metadata =
        Metadata { title: label.title, certificate: Some(&outcome.certificate), thumbnail_png: label.thumbnail_png, ..Metadata::default() };
    let failed = |error| Problem::io("the file could not be written", &error);
    let metered = Metered { stream: &mut *pending, allowance };
    let mut sink = BufWriter::with_capacity(1 << 16, Stoppable { stream: metered, token });
    let apart = match &outcome.geometry {
        Geometry::Sections(stack) => Some(guarded(|| draw(format, stack, &metadata, &mut sink, token))??),
        Geometry::Thickness(map) => Some(guarded(|| write_map(format, map, &metadata, &mut sink))??),
        _ => None,
    };
    if let Some(()) = apart {
        sink.flush().map_err(failed)?;
        drop(sink);
        return Digest::of_stream(pending.reread().map_err(failed)?).map_err(failed);
    }
    let parts = parts(&outcome.geometry);
    let geometry = match &outcome.geometry {
        Geometry::Polygons { mesh, closed } => format::Geometry::Polygons { mesh: &mesh.mesh, polygons: &mesh.polygons, closed: *closed },
        other => view(other, &parts).ok_or_else(|| no_geometry(format))?,
    };
    guarded(|| format::write(format, geometry, &metadata, &mut sink))?.map_err(|error| format_problem(&error))?;
    sink.flush().map_err(failed)?;
    drop(sink);
    if matches!(outcome.geometry, Geometry::Solid(_) | Geometry::Parts(_)) && format != Format::Png {
        let stream = pending.reread().map_err(failed)?;
        let mut source = BufReader::with_capacity(1 << 16, Stoppable { stream, token });
        guarded(|| format::verify_written(format, &mut source, geometry))?.map_err(|error| format_problem(&error))?;
    }
    Digest::of_stream(pending.reread().map_err(failed)?).map_err(failed)
}

/// Draws plane sections, one at a time; a picture shows them all where they are in space.
fn draw(
    format: Format,
    stack: &Stack,
    metadata: &Metadata<'_>,
    sink: &mut (impl Write + Seek),
    token: &CancelToken,
) -> Result<(), Problem> {
    let budget = Budget { cancel: token.clone(), ..Budget::default() };
    if format == Format::Png {
        let wires = stack.wires(&budget)?;
        return format::write(format, &wires, metadata, sink).map_err(|error| format_problem(&error));
    }
    let bounds = stack.frame.bounds(&stack.solid.mesh().vertices).unwrap_or_default();
    let mut file = SectionFile::start(format, sink, bounds, &stack.offsets_mm, metadata).map_err(|error| format_problem(&error))?;
    let drawn = stack.each(&budget, &mut |section| file.push(section));
    drawn.map_err(|error| match error {
        StreamError::Job(error) => error.into(),
        StreamError::Sink(error) => format_problem(&error),
        StreamError::NotPoints => Problem::internal("sections are no points"),
    })?;
    file.finish().map_err(|error| format_problem(&error))
}

/// Writes a map of thickness: wall_mm and gap_mm at every vertex and face.
fn write_map(format: Format, map: &MappedThickness, metadata: &Metadata<'_>, sink: &mut impl Write) -> Result<(), Problem> {
    if format != Format::Ply {
        return Err(no_geometry(format));
    }
    let fields = [
        (
            "wall_mm",
            "least thickness in mm along the normals, inwards, over a face or the faces around a vertex; inf where no face lies across",
            &map.wall,
        ),
        ("gap_mm", "likewise outwards", &map.gap),
    ];
    let fields = fields.map(|(name, about, of)| ScalarField { name, about, vertices: &of.vertices, triangles: &of.faces });
    format::write_fields(&map.mesh, &fields, metadata, sink).map_err(|error| format_problem(&error))
}

/// Evaluates a shape that is drawn as points straight into a PLY file, whatever their number; for every other shape
/// there is no answer, and what the file holds is of no use. The geometry of the outcome is in the file alone.
///
/// # Errors
/// As [`compute`] and [`write_file`].
pub fn stream_file(
    job: &Job,
    title: Option<&str>,
    pending: &mut PendingFile,
    budget: &Budget,
) -> Result<Option<(Outcome, Digest, u64)>, Problem> {
    let metadata = Metadata { title, ..Metadata::default() };
    let failed = |error| Problem::io("the file could not be written", &error);
    let allowance = Allowance::new(budget.limits.output_bytes);
    let metered = Metered { stream: &mut *pending, allowance: &allowance };
    let sink = BufWriter::with_capacity(1 << 16, Stoppable { stream: metered, token: &budget.cancel });
    let streamed = guarded(|| {
        let mut file = PointFile::start(sink, &metadata).map_err(StreamError::Sink)?;
        let certificate = lacuna_fabrication::stream_points(job, budget, &mut |piece| file.push(&piece.vertices))?;
        file.finish().map_err(StreamError::Sink)?;
        Ok(certificate)
    })?;
    let certificate = match streamed {
        Ok(certificate) => certificate,
        Err(StreamError::NotPoints) => return Ok(None),
        Err(StreamError::Job(error)) => return Err(error.into()),
        Err(StreamError::Sink(error)) => return Err(too_long(&allowance).unwrap_or_else(|| format_problem(&error))),
    };
    check_certificate(&certificate)?;
    let (digest, bytes) = Digest::of_stream(pending.reread().map_err(failed)?).map_err(failed)?;
    Ok(Some((Outcome { geometry: Geometry::None, certificate }, digest, bytes)))
}

/// A picture of a result as PNG.
///
/// # Errors
/// When there is nothing to see.
pub fn picture(outcome: &Outcome) -> Result<Vec<u8>, Problem> {
    let parts = parts(&outcome.geometry);
    let geometry = view(&outcome.geometry, &parts).ok_or_else(|| no_geometry(Format::Png))?;
    let mut sink = std::io::Cursor::new(Vec::new());
    guarded(|| format::write(Format::Png, geometry, &Metadata::default(), &mut sink))?.map_err(|error| format_problem(&error))?;
    Ok(sink.into_inner())
}

/// The certificate as a file: indented JSON with a line end.
///
/// # Errors
/// When a number in it is not finite, which is a defect.
pub fn certificate_file(certificate: &Certificate) -> Result<Vec<u8>, Problem> {
    let mut bytes = serde_json::to_vec_pretty(certificate).map_err(|error| Problem::internal(error.to_string()))?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// The parts of a geometry, by their names.
fn parts(geometry: &Geometry) -> Vec<NamedMesh<'_>> {
    match geometry {
        Geometry::Parts(parts) => parts.iter().map(|part| NamedMesh { name: &part.name, mesh: part.solid.mesh() }).collect(),
        _ => Vec::new(),
    }
}

/// A geometry as it is written; `parts` are its own.
fn view<'g>(geometry: &'g Geometry, parts: &'g [NamedMesh<'g>]) -> Option<format::Geometry<'g>> {
    match geometry {
        Geometry::Solid(solid) => Some(solid.into()),
        Geometry::Parts(_) => Some(parts.into()),
        Geometry::Tessellation(tessellation) => Some(tessellation.into()),
        Geometry::Polygons { .. } | Geometry::Sections(_) | Geometry::Thickness(_) | Geometry::None => None,
    }
}

fn no_geometry(format: Format) -> Problem {
    Problem::new(ProblemKind::InvalidModel, format!("this job makes no {format} file; ask for no outputs")).code("job.no-geometry")
}

/// A format's refusal as a problem; the chain of causes becomes one sentence.
#[must_use]
pub fn format_problem(error: &FormatError) -> Problem {
    let mut detail = error.to_string();
    let mut source = std::error::Error::source(error);
    while let Some(cause) = source {
        detail = format!("{detail}: {cause}");
        source = cause.source();
    }
    if let FormatError::Stream(cause) = error {
        let problem = Problem::io("the file could not be written", cause);
        // A full disk is nobody's defect, and says when to come back.
        return if problem.is_defect() { problem.code(error.code()) } else { problem };
    }
    let kind = match (error, error.kind()) {
        (FormatError::CannotCarry { .. } | FormatError::Empty, _) => ProblemKind::InvalidModel,
        (_, Kind::Invalid) => ProblemKind::InvalidFile,
        (_, kind) => kind.into(),
    };
    let problem = Problem::new(kind, detail).code(error.code());
    match error.limit_facts() {
        Some(facts) => problem.limit(facts),
        None => problem,
    }
}
