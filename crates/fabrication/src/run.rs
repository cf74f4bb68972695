//! One entry for every door: `run` does a job, `validate` tells what is wrong with a model.

use lacuna_kernel::attractor::{Attractor, RefineError, refine, refine_with_normals, stream};
use lacuna_kernel::budget::{Budget, Stopped};
use lacuna_kernel::dilation::DilationError;
use lacuna_kernel::error::{Kind, LimitFacts};
use lacuna_kernel::measure::{AxisBox, bounding_box};
use lacuna_kernel::model::{CutMesh, Finding, Lowered, Model};
use lacuna_kernel::solid::Solid;
use lacuna_kernel::tessellation::Tessellation;
use lacuna_kernel::tolerance::{NotPositive, Radius, Tolerance};

use crate::plan::with_remedy;
use crate::repair::repaired;
use crate::shape_measures::MappedThickness;
use crate::solve::freedom;
use crate::{
    Certificate, Job, JobKind, Operation, Split, Stack, boolean, certificate, contact, convert, level, measure, preview, slice, solidify,
    split,
};

/// The geometry of a result.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// A printable solid.
    Solid(Solid),
    /// Printable solids that lie apart.
    Parts(Vec<Part>),
    /// An evaluation.
    Tessellation(Tessellation),
    /// A mesh with its polygons, in single-precision numbers.
    Polygons {
        /// The mesh, and which of its triangles are polygons.
        mesh: CutMesh,
        /// Whether it was counted to be a closed 2-manifold.
        closed: bool,
    },
    /// A solid and planes that cut it.
    Sections(Box<Stack>),
    /// A solid with the thickness of its walls and gaps all over it.
    Thickness(Box<MappedThickness>),
    /// Numbers only.
    None,
}

/// A solid and its name in files.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Its name.
    pub name: String,
    /// Itself.
    pub solid: Solid,
}

/// What a job made.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// What was made; vertex coordinates of a solid are single-precision numbers.
    pub geometry: Geometry,
    /// What is proven of it. `input_digest` and `output_digests` are the caller's to fill in.
    pub certificate: Certificate,
}

/// What `validate` says of a model whose document was legal.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Validation {
    /// Whether it can be evaluated.
    pub valid: bool,
    /// What is wrong (errors) and what is odd (warnings).
    pub diagnostics: Vec<ModelDiagnostic>,
    /// Number of states of the automaton.
    pub states: u64,
    /// Degrees of freedom of the unknown operators: 0 when none is unknown, absent when they could not be found.
    pub degrees_of_freedom: Option<u64>,
    /// Largest violation of a constraint.
    pub constraint_residual: f64,
    /// [lower, upper] bounds of the joint spectral radius on the zero-sum subspaces, when the model is sound
    /// enough to have one.
    pub spectral_radius: Option<[f64; 2]>,
}

/// One finding about a model.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelDiagnostic {
    /// Where: a JSON pointer relative to the model's `shape`, for example `/maps/3/linear`.
    pub pointer: String,
    /// Stable code, for example `ifs.not-contractive`.
    pub code: &'static str,
    /// What, in words, with the values.
    pub message: String,
    /// Whether it only deserves attention.
    pub warning: bool,
}

/// Why a job has no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct JobError {
    /// How to react.
    pub kind: Kind,
    /// Stable code.
    pub code: &'static str,
    /// What happened, in words.
    pub message: String,
    /// The limit that was hit.
    pub limit: Option<LimitFacts>,
    /// Findings with places, when the model is at fault.
    pub diagnostics: Vec<ModelDiagnostic>,
    /// Which of several inputs is at fault, by its index.
    pub input: Option<usize>,
}

impl From<Finding> for ModelDiagnostic {
    fn from(finding: Finding) -> Self {
        let Finding { pointer, code, message, warning } = finding;
        Self { pointer, code, message, warning }
    }
}

impl JobError {
    pub(crate) fn new(kind: Kind, code: &'static str, message: String) -> Self {
        Self { kind, code, message, limit: None, diagnostics: Vec::new(), input: None }
    }

    /// An error of one input: it is named where there are several.
    pub(crate) fn of_input(self, job: &Job, index: usize) -> Self {
        if job.inputs.len() < 2 {
            return self;
        }
        Self { message: format!("input '{}': {}", job.inputs[index].name, self.message), input: Some(index), ..self }
    }

    /// The first error speaks for all; every finding is listed.
    #[must_use]
    pub fn model(findings: Vec<Finding>) -> Self {
        let first = findings.iter().find(|finding| !finding.warning).cloned();
        let (code, message) = first.map_or(("invalid-model", String::new()), |finding| (finding.code, finding.message));
        let kind = if code == "automaton.convergence-undecided" { Kind::Unreachable } else { Kind::Invalid };
        Self { diagnostics: findings.into_iter().map(ModelDiagnostic::from).collect(), ..Self::new(kind, code, message) }
    }
}

impl From<NotPositive> for JobError {
    fn from(error: NotPositive) -> Self {
        Self::new(Kind::Invalid, "bad-parameter", error.to_string())
    }
}

impl From<Stopped> for JobError {
    fn from(error: Stopped) -> Self {
        Self::new(error.kind(), error.code(), error.to_string())
    }
}

impl From<RefineError> for JobError {
    fn from(error: RefineError) -> Self {
        Self { limit: error.limit(), ..Self::new(error.kind(), error.code(), error.to_string()) }
    }
}

impl From<DilationError> for JobError {
    fn from(error: DilationError) -> Self {
        Self { limit: error.limit(), ..Self::new(error.kind(), error.code(), error.to_string()) }
    }
}

/// The models of a job, lowered.
pub(crate) fn lower_all(job: &Job, budget: &Budget) -> Result<Vec<Lowered>, JobError> {
    let count = job.inputs.len();
    let mut lowered = Vec::with_capacity(count);
    for (index, input) in job.inputs.iter().enumerate() {
        budget.cancel.check()?;
        budget.report("validate", index as f64 / count as f64, index as u64);
        lowered.push(input.model.lower().map_err(|findings| JobError::model(findings).of_input(job, index))?);
    }
    let states = lowered.iter().map(|lowered| lowered.attractor.automaton().states().len() as u64).sum();
    budget.report("validate", 1.0, states);
    Ok(lowered)
}

/// The one model of a job, lowered.
pub(crate) fn lower(job: &Job, budget: &Budget) -> Result<Lowered, JobError> {
    let one = || wrong_inputs(job, "this kind takes one");
    if job.inputs.len() == 1 { lower_all(job, budget)?.pop().ok_or_else(one) } else { Err(one()) }
}

/// A job has too few or too many inputs.
pub(crate) fn wrong_inputs(job: &Job, expected: &str) -> JobError {
    JobError::new(Kind::Invalid, "job.inputs", format!("the job has {} inputs, and {expected}", job.inputs.len()))
}

/// What single precision takes from a tolerance leaves nothing.
pub(crate) fn not_carried(tolerance: Tolerance, extent_mm: f64, reachable: f64) -> JobError {
    let message = format!(
        "single-precision files cannot carry a tolerance of {} mm at coordinates up to {extent_mm:.1} mm; {reachable:.3e} mm can be carried",
        tolerance.mm()
    );
    let limit = LimitFacts { limit: "tolerance_mm", asked: tolerance.mm(), allowed: reachable, remedy: Some(("tolerance_mm", reachable)) };
    JobError { limit: Some(limit), ..JobError::new(Kind::Unreachable, "tolerance-unreachable", message) }
}

pub(crate) fn radius(job: &Job) -> Result<Option<Radius>, JobError> {
    Ok(job.params.radius_mm.map(Radius::new).transpose()?)
}

/// Does the job.
///
/// # Errors
/// [`JobError`] with its kind: an invalid model, an unreachable tolerance, a limit, or a stop.
pub fn run(job: &Job, budget: &Budget) -> Result<Outcome, JobError> {
    let (job, repairs) = repaired(job, budget)?;
    let mut outcome = made(&job, budget).map_err(|error| with_remedy(&job, error, budget))?;
    outcome.certificate.state_repairs(repairs);
    certified(&outcome.certificate, budget);
    Ok(outcome)
}

/// Tells, last of all, what the certificate says.
fn certified(certificate: &Certificate, budget: &Budget) {
    budget.prove(certificate.achieved_bound_mm);
    budget.report("certify", 1.0, certificate.triangles);
}

/// Does a job whose meshes are as they shall be.
fn made(job: &Job, budget: &Budget) -> Result<Outcome, JobError> {
    if let (JobKind::Solidify, Some(level)) = (job.kind, job.params.level) {
        return level::solidify(job, level, budget);
    }
    let tolerance = Tolerance::new(job.params.tolerance_mm)?;
    if job.params.preview {
        return preview::preview(job, tolerance, budget);
    }
    match job.kind {
        JobKind::Evaluate => evaluate(&lower(job, budget)?.attractor, tolerance, job.params.normals, budget),
        JobKind::Solidify => solidify::solidify(job, tolerance, budget),
        JobKind::Measure if job.inputs.len() > 1 => contact::compare(job, tolerance, budget),
        JobKind::Measure => measure::measure(job, tolerance, budget),
        JobKind::Intersect => match job.params.operation {
            Some(Operation::Split) => split::split(job, &split_of(job)?, tolerance, budget),
            Some(operation) => boolean::combine(job, operation, tolerance, budget),
            None => contact::contact(job, tolerance, budget),
        },
        JobKind::Slice => slice::slice(job, tolerance, budget),
        JobKind::Convert => match convert::polygons(job) {
            Some(mesh) => convert::convert(mesh, tolerance, budget),
            None => evaluate(&lower(job, budget)?.attractor, tolerance, false, budget),
        },
    }
}

/// How a job splits its input.
pub(crate) fn split_of(job: &Job) -> Result<Split, JobError> {
    let missing =
        || JobError::new(Kind::Invalid, "bad-parameter", "split needs volume_mm, the size that parts must fit, or cuts_mm".into());
    job.params.split.clone().ok_or_else(missing)
}

/// The box, and the share of the tolerance that single precision leaves.
fn share_of(attractor: &Attractor, tolerance: Tolerance, budget: &Budget) -> Result<(AxisBox, Tolerance), JobError> {
    let bounds = bounding_box(attractor, budget)?;
    let rounding = bounds.single_precision();
    let share = tolerance.mm() - rounding;
    // Coordinates travel in single precision: what it takes from the tolerance must leave something.
    if share < rounding {
        return Err(not_carried(tolerance, bounds.extent(), 2.0 * rounding));
    }
    Ok((bounds, Tolerance::new(share)?))
}

pub(crate) fn evaluate(attractor: &Attractor, tolerance: Tolerance, normals: bool, budget: &Budget) -> Result<Outcome, JobError> {
    let (bounds, share) = share_of(attractor, tolerance, budget)?;
    let mut remarks = Vec::new();
    let planes = normals.then(|| attractor.tangent_planes());
    let tessellation = match &planes {
        Some(Ok(planes)) => refine_with_normals(attractor, planes, share, budget)?,
        _ => refine(attractor, share, budget)?,
    };
    match (&planes, &tessellation.normals) {
        (Some(Err(reason)), _) => remarks.push(format!("no normals: {reason}")),
        (Some(Ok(planes)), Some(normals)) if normals.degenerate > 0 => {
            let reason = planes.exception().map_or_else(|| "control points coincide".to_owned(), ToString::to_string);
            remarks.push(format!("{} corners of triangles have the triangle's normal: {reason}", normals.degenerate));
        }
        (Some(Ok(_)), None) => remarks.push("no normals: parts of the shape are no surface that is evaluated as one complex".to_owned()),
        _ => {}
    }
    let mut certificate = certificate::of_evaluation(attractor, &tessellation, &bounds, tolerance);
    certificate.warnings.extend(remarks);
    Ok(Outcome { geometry: Geometry::Tessellation(tessellation), certificate })
}

/// Why a streamed evaluation ended early.
#[derive(Debug)]
pub enum StreamError<E> {
    /// The job has no result.
    Job(JobError),
    /// Whoever takes the points failed.
    Sink(E),
    /// Something other than points stands for a cell; some points may have been handed over.
    NotPoints,
}

impl<E> From<RefineError> for StreamError<E> {
    fn from(error: RefineError) -> Self {
        Self::Job(error.into())
    }
}

impl<E> From<JobError> for StreamError<E> {
    fn from(error: JobError) -> Self {
        Self::Job(error)
    }
}

/// Evaluates a shape that is drawn as points, and hands them over in address order without holding them: memory
/// does not grow with their number. The certificate is that of [`run`].
///
/// # Errors
/// As [`run`]; what `sink` returns; [`StreamError::NotPoints`] for every other shape, as a rule before any work.
pub fn stream_points<E>(
    job: &Job,
    budget: &Budget,
    sink: &mut dyn FnMut(&Tessellation) -> Result<(), E>,
) -> Result<Certificate, StreamError<E>> {
    let tolerance = Tolerance::new(job.params.tolerance_mm).map_err(JobError::from)?;
    let lowered = lower(job, budget)?;
    let attractor = &lowered.attractor;
    if !attractor.is_drawn_as_points() {
        return Err(StreamError::NotPoints);
    }
    let (bounds, share) = share_of(attractor, tolerance, budget)?;
    let mut points = 0;
    let streamed = stream(attractor, share, budget, &mut |piece| {
        if piece.vertices.len() != piece.points.len() {
            return Err(StreamError::NotPoints);
        }
        points += piece.vertices.len() as u64;
        sink(&piece).map_err(StreamError::Sink)
    })?;
    let certificate = certificate::of_points(attractor, points, streamed, &bounds, tolerance);
    certified(&certificate, budget);
    Ok(certificate)
}

/// Says what is wrong with a model, and what its unknown operators leave open.
#[must_use]
pub fn validate(model: &Model, budget: &Budget) -> Validation {
    match model.lower() {
        Ok(lowered) => {
            let contraction = lowered.attractor.contraction();
            Validation {
                valid: true,
                diagnostics: lowered.findings.into_iter().map(ModelDiagnostic::from).collect(),
                states: lowered.attractor.automaton().states().len() as u64,
                degrees_of_freedom: Some(0),
                constraint_residual: lowered.constraint_residual,
                spectral_radius: Some([contraction.lower, contraction.upper]),
            }
        }
        Err(findings) => {
            let diagnostics: Vec<ModelDiagnostic> = findings.into_iter().map(ModelDiagnostic::from).collect();
            match freedom(&model.shape, budget) {
                None => Validation { diagnostics, degrees_of_freedom: Some(0), ..Validation::default() },
                Some(freedom) => Validation {
                    diagnostics: diagnostics.into_iter().chain(freedom.conflicts).collect(),
                    states: freedom.states,
                    degrees_of_freedom: freedom.degrees,
                    ..Validation::default()
                },
            }
        }
    }
}
