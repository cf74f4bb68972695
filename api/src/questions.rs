//! Questions about models and jobs, answered without doing a job: what the service's processes and the command line share.

use std::time::Duration;

use lacuna_fabrication::Plan;
use lacuna_kernel::budget::{Budget, CancelToken, Limits};
use serde::{Deserialize, Serialize};

use crate::addresses;
use crate::documents::{self, ModelFinder, SolveReport};
use crate::jobs::watchdog::Watchdog;
use crate::problem::{Finding, Problem, ProblemKind};
use crate::production::{self, Engine, SolveProblem};

/// Longest time that an answer may take: it is asked inside of a request.
pub const TIME: Duration = Duration::from_secs(10);

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
    /// The unknown entries of a model.
    Solve,
}

/// The answer: the text of a JSON document, or of a drawing.
///
/// # Errors
/// All that is wrong with what was asked, a limit, or that the answer takes longer than [`TIME`].
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
    let budget = Budget { limits, cancel: CancelToken::new(), progress: None };
    let _watchdog = Watchdog::start(&budget.cancel, limits.seconds).map_err(|error| Problem::io("no thread", &error))?;
    work(&budget)
}

/// Predicts within a time.
///
/// # Errors
/// The kernel's refusal, with pointers into the job document.
pub fn predict(engine: Engine, job: &lacuna_fabrication::Job, time: Duration) -> Result<Plan, Problem> {
    let budget = Budget { limits: job.limits, cancel: CancelToken::new(), progress: None };
    let _watchdog = Watchdog::start(&budget.cancel, time.as_secs_f64()).map_err(|error| Problem::io("no thread", &error))?;
    (engine.plan)(job, &budget).map_err(|problem| production::why_stopped(&budget).unwrap_or_else(|| problem.under_model()))
}
