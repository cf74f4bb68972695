//! What can be said of a model or a job without doing it.

use std::time::Duration;

use axum::Json;
use axum::extract::{Extension, State};
use lacuna_fabrication::Plan;
use lacuna_kernel::budget::{Budget, CancelToken};

use crate::documents::{self, ValidationReport};
use crate::http::auth::Owner;
use crate::http::body::JsonBody;
use crate::http::state::Shared;
use crate::jobs::watchdog::Watchdog;
use crate::openapi::{Job, Model};
use crate::problem::Problem;
use crate::production::{self, Engine};

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
    state.beside(move |_| documents::validate(&body)).await.map(Json)
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
        let job = documents::read_job(&body, &state.config.job_limits, &state.models_of(&owner))?;
        predict(state.engine, &job, PLAN_TIME)
    });
    plan.await.map(Json)
}

/// Predicts within a time.
///
/// # Errors
/// The kernel's refusal, with pointers into the job document.
pub fn predict(engine: Engine, job: &lacuna_fabrication::Job, time: Duration) -> Result<Plan, Problem> {
    let budget = Budget { limits: job.limits, cancel: CancelToken::new(), progress: None };
    let _watchdog = Watchdog::start(&budget.cancel, time.as_secs_f64()).map_err(|error| Problem::io("no thread", &error))?;
    (engine.plan)(job, &budget).map_err(|problem| production::why_stopped(&budget).unwrap_or_else(|| problem.under("/model")))
}
