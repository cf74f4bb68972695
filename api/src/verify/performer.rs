//! Who does what a case asks: this process, or a service.

use std::collections::BTreeMap;
use std::io::Read as _;
use std::time::{Duration, Instant};

use lacuna_exchange::format::Format;
use lacuna_fabrication::{Certificate, Geometry, Job, Outcome};
use lacuna_kernel::attractor::Address;
use lacuna_kernel::budget::Budget;
use lacuna_kernel::model::Model;
use serde_json::Value;

use crate::addresses;
use crate::documents::{self, SolveReport};
use crate::files::{Allowance, PendingFile};
use crate::jobs::watchdog::Watchdog;
use crate::problem::{Problem, ProblemKind};
use crate::production::{self, Label, SolveProblem};
use crate::questions::{TIME, watched};

/// Time for the points of a case.
const POINTS_TIME: Duration = Duration::from_secs(60);

/// A solution: what is told of all of them, and the document of the model for the chosen values.
pub struct Solution {
    /// All solutions, as `lacuna solve` prints them.
    pub space: Value,
    /// The model document.
    pub model: String,
}

/// What a job made, with its files.
#[derive(Debug)]
pub struct Made {
    /// What is proven of it.
    pub certificate: Certificate,
    /// The bytes of its outputs, by name.
    pub files: BTreeMap<String, Vec<u8>>,
    /// Seconds that the work took, the files included; absent where somebody had done it before.
    pub seconds: Option<f64>,
}

/// Who does what a case asks. Pointers in problems are relative to the model document, or to that of a job with several.
pub trait Performer {
    /// Does a job.
    ///
    /// # Errors
    /// Its refusal.
    fn certificate(&self, job: &Job) -> Result<Certificate, Problem>;

    /// Does a job and hands over the files that it names.
    ///
    /// # Errors
    /// Its refusal, or that of a format.
    fn made(&self, job: &Job) -> Result<Made, Problem>;

    /// Solves a model for chosen values.
    ///
    /// # Errors
    /// Its refusal.
    fn solution(&self, model: &Model, values: &BTreeMap<String, f64>) -> Result<Solution, Problem>;

    /// The points at addresses.
    ///
    /// # Errors
    /// When one of them leads nowhere.
    fn points(&self, model: &Model, addresses: &[Address]) -> Result<Vec<[f64; 3]>, Problem>;
}

/// This process.
#[derive(Clone, Copy, Debug)]
pub struct Here;

impl Performer for Here {
    fn certificate(&self, job: &Job) -> Result<Certificate, Problem> {
        let budget = Budget { limits: job.limits, ..Budget::default() };
        let _watchdog = Watchdog::start(&budget.cancel, job.limits.seconds).map_err(|error| Problem::io("no thread", &error))?;
        let outcome = production::compute(job, &budget).map_err(|problem| production::why_stopped(&budget).unwrap_or(problem))?;
        Ok(outcome.certificate)
    }

    fn made(&self, job: &Job) -> Result<Made, Problem> {
        let start = Instant::now();
        let budget = Budget { limits: job.limits, ..Budget::default() };
        let _watchdog = Watchdog::start(&budget.cancel, job.limits.seconds).map_err(|error| Problem::io("no thread", &error))?;
        let made = production::compute(job, &budget).and_then(|mut outcome| {
            outcome.certificate.input_digest = documents::job_digest(job).to_string();
            let files = files_of(job, &outcome, &budget)?;
            Ok(Made { certificate: outcome.certificate, files, seconds: Some(start.elapsed().as_secs_f64()) })
        });
        made.map_err(|problem| production::why_stopped(&budget).unwrap_or(problem))
    }

    fn solution(&self, model: &Model, values: &BTreeMap<String, f64>) -> Result<Solution, Problem> {
        let solved = watched(TIME, |budget| production::solve(model, values, budget)).map_err(|problem| match problem {
            SolveProblem::Model(problem) => problem,
            SolveProblem::Value { code, message, .. } => Problem::new(ProblemKind::InvalidModel, message).code(code),
        })?;
        let report = SolveReport::of(solved)?;
        let space = serde_json::to_value(&report.space).map_err(|error| Problem::internal(error.to_string()))?;
        Ok(Solution { space, model: documents::model_file(&report.model) })
    }

    fn points(&self, model: &Model, addresses: &[Address]) -> Result<Vec<[f64; 3]>, Problem> {
        addresses::points(model, addresses, POINTS_TIME)
    }
}

/// The files that a job names, as a service writes them.
fn files_of(job: &Job, outcome: &Outcome, budget: &Budget) -> Result<BTreeMap<String, Vec<u8>>, Problem> {
    let formats: Vec<Format> = job.outputs.iter().map(|name| documents::format(name)).collect::<Result<_, _>>()?;
    let thumbnail = match (&outcome.geometry, formats.contains(&Format::ThreeMf)) {
        (Geometry::Solid(_) | Geometry::Parts(_), true) => Some(production::picture(outcome)?),
        _ => None,
    };
    let title = job.inputs.first().map(|input| input.name.as_str());
    let failed = |error| Problem::io("the result could not be written", &error);
    let allowance = Allowance::new(budget.limits.output_bytes);
    let mut files = BTreeMap::new();
    for format in formats {
        let mut pending = PendingFile::create_in(&std::env::temp_dir()).map_err(failed)?;
        let label = Label { title, thumbnail_png: thumbnail.as_deref() };
        production::write_file(format, outcome, &label, &mut pending, &allowance, &budget.cancel)?;
        let mut bytes = Vec::new();
        pending.reread().and_then(|file| file.read_to_end(&mut bytes)).map_err(failed)?;
        files.insert(format.facts().ending.to_owned(), bytes);
    }
    Ok(files)
}
