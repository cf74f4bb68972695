//! Who does what a case asks: this process, or a service.

use std::collections::BTreeMap;
use std::time::Duration;

use lacuna_fabrication::{Certificate, Job};
use lacuna_kernel::attractor::Address;
use lacuna_kernel::budget::Budget;
use lacuna_kernel::model::Model;
use serde_json::Value;

use crate::addresses;
use crate::documents::{self, SolveReport};
use crate::jobs::watchdog::Watchdog;
use crate::problem::{Problem, ProblemKind};
use crate::production::{self, SolveProblem};
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

/// Who does what a case asks. Pointers in problems are relative to the model document, or to that of a job with several.
pub trait Performer {
    /// Does a job.
    ///
    /// # Errors
    /// Its refusal.
    fn certificate(&self, job: &Job) -> Result<Certificate, Problem>;

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
