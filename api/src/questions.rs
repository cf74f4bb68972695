//! Questions about models and jobs, answered without doing a job: what the service's processes and the command line share.

use std::time::Duration;

use lacuna_fabrication::Plan;
use lacuna_kernel::budget::{Budget, Limits};
use serde::{Deserialize, Serialize};

use crate::addresses;
use crate::documents::{self, ModelFinder, SolveReport};
use crate::jobs::watchdog::Watchdog;
use crate::orders;
use crate::problem::{Finding, Problem, ProblemKind};
use crate::production::{self, Engine, SolveProblem};

/// Longest time that an answer may take: it is asked inside of a request.
pub const TIME: Duration = Duration::from_secs(10);

/// Longest time for reading all that an order names.
const READING_TIME: Duration = Duration::from_secs(40);

/// The most memory that an answer may take, in bytes; less where jobs may have less.
const MEMORY_BYTES: u64 = 1 << 30;

/// The same for reading all that an order names: as much as for a mesh file when it is uploaded.
const READING_BYTES: u64 = 3 << 30;

/// What is asked of a document.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Question {
    /// What is wrong with a model.
    Validate,
    /// The drawing of a model's automaton, as DOT or else as SVG.
    Draw {
        /// As DOT.
        dot: bool,
    },
    /// Where an address leads, or which lead near a point.
    Address,
    /// What a job costs.
    Plan,
    /// What the document of a job comes to, see [`crate::orders::Ordered`].
    Order {
        /// With what the job costs.
        predicted: bool,
    },
    /// What the document of a batch comes to: its jobs, and what it calls them.
    Batch,
    /// The unknown entries of a model.
    Solve,
}

impl Question {
    /// The time and the memory in bytes that its answer may take.
    #[must_use]
    pub fn bounds(self) -> (Duration, u64) {
        match self {
            Self::Order { predicted: false } | Self::Batch => (READING_TIME, READING_BYTES),
            _ => (TIME, MEMORY_BYTES),
        }
    }
}

/// Whether there is no answer because it would have taken too much time or memory.
#[must_use]
pub fn took_too_much(problem: &Problem) -> bool {
    ["limit.seconds", "limit.memory"].contains(&problem.code.as_ref())
}

/// The answer: the text of a JSON document, or of a drawing.
///
/// # Errors
/// All that is wrong with what was asked, a limit, or that the answer takes longer than its [`Question::bounds`].
pub fn answer(question: Question, document: &[u8], most: &Limits, find: ModelFinder<'_>, engine: Engine) -> Result<String, Problem> {
    match question {
        Question::Validate => text(&watched(TIME, |budget| documents::validate(document, budget))?),
        Question::Draw { dot } => {
            let diagram = documents::read_diagram(document)?;
            production::guarded(|| if dot { diagram.dot() } else { diagram.svg() })
        }
        Question::Address => {
            let (model, sought) = documents::read_address_question(document, find)?;
            text(&addresses::answer(&model, &sought, TIME).map_err(Problem::under_model)?)
        }
        Question::Plan => text(&predict(engine, &documents::read_order(document, most, find)?.job, TIME)?),
        Question::Order { predicted } => text(&orders::read_job(document, predicted, most, find, engine)?),
        Question::Batch => text(&orders::read_batch(document, most, find)?),
        Question::Solve => {
            let (model, values) = documents::read_solve(document, find)?;
            let solved = watched(TIME, |budget| production::solve(&model, &values, budget)).map_err(|problem| match problem {
                SolveProblem::Model(problem) => problem.under("/model"),
                SolveProblem::Value { name, code, message } => {
                    let pointer = format!("/values/{}", name.replace('~', "~0").replace('/', "~1"));
                    let finding = Finding { pointer, code: code.to_owned(), message: message.clone(), line: None, column: None };
                    Problem::new(ProblemKind::InvalidModel, message).code(code).errors(vec![finding])
                }
            })?;
            text(&SolveReport::of(solved)?)
        }
    }
}

fn text(answer: &impl Serialize) -> Result<String, Problem> {
    serde_json::to_string(answer).map_err(|error| Problem::internal(error.to_string()))
}

/// Does what looks at its budget within a time.
///
/// # Errors
/// The work's own, or that there is no thread to watch the time.
pub fn watched<T, E: From<Problem>>(time: Duration, work: impl FnOnce(&Budget) -> Result<T, E>) -> Result<T, E> {
    let limits = Limits { seconds: time.as_secs_f64(), ..Limits::default() };
    let budget = Budget { limits, ..Budget::default() };
    let _watchdog = Watchdog::start(&budget.cancel, limits.seconds).map_err(|error| Problem::io("no thread", &error))?;
    work(&budget)
}

/// Predicts within a time.
///
/// # Errors
/// The kernel's refusal, with pointers into the job document.
pub fn predict(engine: Engine, job: &lacuna_fabrication::Job, time: Duration) -> Result<Plan, Problem> {
    let budget = Budget { limits: job.limits, ..Budget::default() };
    let _watchdog = Watchdog::start(&budget.cancel, time.as_secs_f64()).map_err(|error| Problem::io("no thread", &error))?;
    (engine.plan)(job, &budget).map_err(|problem| production::why_stopped(&budget).unwrap_or_else(|| problem.under_model()))
}
