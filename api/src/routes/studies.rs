//! What can be said of a model or a job without doing it.

use std::sync::OnceLock;
use std::time::Duration;

use axum::Json;
use axum::extract::{Extension, State};
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use lacuna_fabrication::Plan;
use lacuna_kernel::budget::{Budget, CancelToken, Limits};
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::addresses::{self, AddressAnswer};
use crate::documents::{self, SolveReport, ValidationReport};
use crate::http::auth::Owner;
use crate::http::body::JsonBody;
use crate::http::state::Shared;
use crate::jobs::watchdog::Watchdog;
use crate::openapi::{AddressQuestion, Job, Model, SolveRequest};
use crate::problem::{Finding, Problem, ProblemKind};
use crate::production::{self, Engine, SolveProblem};

/// Longest time that a prediction may take: it is asked inside of a request.
pub const PLAN_TIME: Duration = Duration::from_secs(10);

/// Says what is wrong with a model.
///
/// 200 for every JSON text: `valid` and `diagnostics` tell.
#[utoipa::path(
    post, path = "/v1/validate", tag = "studies", request_body = Model,
    responses((status = 200, body = ValidationReport), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn validate(State(state): State<Shared>, JsonBody(body): JsonBody) -> Result<Json<ValidationReport>, Problem> {
    state.beside(move |_| watched(PLAN_TIME, |budget| documents::validate(&body, budget))).await.map(Json)
}

/// Draws the automaton of a model: states as nodes, transitions and boundaries as two kinds of arrows.
///
/// An SVG picture, or DOT text when `Accept` prefers `text/vnd.graphviz`. A model that is a legal document is drawn
/// even if it cannot be evaluated, with what is wrong in red.
#[utoipa::path(
    post, path = "/v1/automaton", tag = "studies", request_body = Model,
    responses((status = 200, description = "The drawing", content((String = "image/svg+xml"), (String = "text/vnd.graphviz"))),
        (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn automaton(State(state): State<Shared>, headers: HeaderMap, JsonBody(body): JsonBody) -> Result<Response, Problem> {
    let dot = prefers_dot(&headers);
    let drawn = state.beside(move |_| {
        let diagram = documents::read_diagram(&body)?;
        production::guarded(|| if dot { diagram.dot() } else { diagram.svg() })
    });
    let media_type = if dot { "text/vnd.graphviz; charset=utf-8" } else { "image/svg+xml" };
    // The picture needs nothing from anywhere, whatever a browser is told to do with it.
    let policy = (header::CONTENT_SECURITY_POLICY, "default-src 'none'; style-src 'unsafe-inline'");
    Ok(([(header::CONTENT_TYPE, media_type), (header::VARY, "accept"), policy], drawn.await?).into_response())
}

/// Whether `Accept` names DOT, and not a picture before it.
fn prefers_dot(headers: &HeaderMap) -> bool {
    let values = headers.get_all(header::ACCEPT).iter().filter_map(|value| value.to_str().ok());
    let mut types = values.flat_map(|value| value.split(',')).map(|item| item.split(';').next().unwrap_or_default().trim());
    types.find(|name| matches!(*name, "text/vnd.graphviz" | "image/svg+xml" | "image/*" | "*/*")) == Some("text/vnd.graphviz")
}

/// Tells where an address leads, or which addresses lead near a point.
#[utoipa::path(
    post, path = "/v1/address", operation_id = "locate", tag = "studies", request_body = AddressQuestion,
    responses((status = 200, body = AddressAnswer), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn address(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    JsonBody(body): JsonBody,
) -> Result<Json<AddressAnswer>, Problem> {
    let answer = state.beside(move |state| {
        let (model, sought) = documents::read_address_question(&body, &state.models_of(&owner))?;
        aside(|| addresses::answer(&model, &sought, PLAN_TIME))?.map_err(|problem| problem.under_model())
    });
    answer.await.map(Json)
}

/// Predicts what a job costs, without doing it.
///
/// A job that would pass a limit is refused with the limit and a value that passes.
#[utoipa::path(
    post, path = "/v1/plan", tag = "studies", request_body = Job,
    responses((status = 200, body = Plan), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn plan(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    JsonBody(body): JsonBody,
) -> Result<Json<Plan>, Problem> {
    let plan = state.beside(move |state| {
        let order = documents::read_order(&body, &state.config.job_limits, &state.models_of(&owner))?;
        predict(state.engine, &order.job, PLAN_TIME)
    });
    plan.await.map(Json)
}

/// Solves the unknown entries of a model.
///
/// 200 with all solutions, and the model for the chosen values in `model`. Constraints that contradict each other are
/// refused with 422: `errors` are the fewest of them that already do.
#[utoipa::path(
    post, path = "/v1/solve", tag = "studies", request_body = SolveRequest,
    responses((status = 200, body = SolveReport), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn solve(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    JsonBody(body): JsonBody,
) -> Result<Json<SolveReport>, Problem> {
    let report = state.beside(move |state| {
        let (model, values) = documents::read_solve(&body, &state.models_of(&owner))?;
        let solved = watched(PLAN_TIME, |budget| production::solve(&model, &values, budget)).map_err(|problem| match problem {
            SolveProblem::Model(problem) => problem.under("/model"),
            SolveProblem::Value { name, code, message } => {
                let pointer = format!("/values/{}", name.replace('~', "~0").replace('/', "~1"));
                let finding = Finding { pointer, code: code.to_owned(), message: message.clone(), line: None, column: None };
                Problem::new(ProblemKind::InvalidModel, message).code(code).errors(vec![finding])
            }
        })?;
        SolveReport::of(solved)
    });
    report.await.map(Json)
}

/// Does what looks at its budget within a time.
///
/// # Errors
/// The work's own, or that there is no thread to watch the time.
pub fn watched<T: Send, E: From<Problem> + Send>(time: Duration, work: impl FnOnce(&Budget) -> Result<T, E> + Send) -> Result<T, E> {
    let limits = Limits { seconds: time.as_secs_f64(), ..Limits::default() };
    let budget = Budget { limits, cancel: CancelToken::new(), progress: None };
    let _watchdog = Watchdog::start(&budget.cancel, limits.seconds).map_err(|error| Problem::io("no thread", &error))?;
    aside(|| work(&budget))?
}

/// Works with threads of its own: in the pool that jobs share, a question that somebody waits for would stand behind all
/// that a large job has queued there, for minutes.
fn aside<T: Send>(work: impl FnOnce() -> T + Send) -> Result<T, Problem> {
    static POOL: OnceLock<Option<ThreadPool>> = OnceLock::new();
    let pool = POOL.get_or_init(|| ThreadPoolBuilder::new().thread_name(|number| format!("study-{number}")).build().ok());
    let pool = pool.as_ref().ok_or_else(|| Problem::internal("no threads for studies"))?;
    Ok(pool.install(work))
}

/// Predicts within a time.
///
/// # Errors
/// The kernel's refusal, with pointers into the job document.
pub fn predict(engine: Engine, job: &lacuna_fabrication::Job, time: Duration) -> Result<Plan, Problem> {
    let budget = Budget { limits: job.limits, cancel: CancelToken::new(), progress: None };
    let _watchdog = Watchdog::start(&budget.cancel, time.as_secs_f64()).map_err(|error| Problem::io("no thread", &error))?;
    aside(|| (engine.plan)(job, &budget))?.map_err(|problem| production::why_stopped(&budget).unwrap_or_else(|| problem.under_model()))
}
