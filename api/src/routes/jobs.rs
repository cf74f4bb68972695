//! Jobs: submitted, listed, looked at, stopped, forgotten.

use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::Json;
use axum::extract::{Extension, Path, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use lacuna_fabrication::JobKind;
use lacuna_kernel::budget::CancelToken;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use crate::digest::Digest;
use crate::documents;
use crate::http::auth::Owner;
use crate::http::body::JsonBody;
use crate::http::headers::{PREFERENCE_APPLIED, Preference, QueryOf, idempotency_key, page_cursor, page_length};
use crate::http::state::{AppState, Leaving, Shared};
use crate::jobs::desk::{JobFilter, Submission};
use crate::jobs::live::LiveJob;
use crate::jobs::record::{Idempotency, JobState, JobView};
use crate::openapi::Job;
use crate::orders::Ordered;
use crate::problem::{Problem, ProblemKind};
use crate::production;
use crate::questions::{self, Question};
use crate::traces::Context;

/// Seconds after which to look at a job again.
pub(super) const LOOK_AGAIN: u64 = 1;

/// Which page of which jobs.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct JobQuery {
    /// Only jobs in this state.
    state: Option<JobState>,
    /// Only jobs of this kind.
    kind: Option<JobKind>,
    /// Items of the page, 1 to 200; 50 when absent.
    #[param(minimum = 1, maximum = 200)]
    limit: Option<usize>,
    /// `next` of the page before.
    cursor: Option<String>,
}

/// A page of jobs.
#[derive(Debug, Serialize, ToSchema)]
pub struct JobPage {
    /// The jobs, the newest first.
    items: Vec<JobView>,
    /// The cursor of the next page, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    next: Option<String>,
}

/// Submits a job.
///
/// With `Prefer: wait=n` (30 at most) the answer waits up to n seconds for the end: 200 if it came, else 202.
/// The job's own failure is in its `problem`, never in the status. An `Idempotency-Key` makes a repeated
/// submission give the first one's job. Equal work that was finished before is not done again.
#[utoipa::path(
    post, path = "/v1/jobs", operation_id = "submit_job", tag = "jobs", request_body = Job,
    params(("Prefer" = Option<String>, Header, description = "`wait=10`, `respond-async`"),
        ("Idempotency-Key" = Option<String>, Header, description = "1 to 255 characters, the caller's choice")),
    responses((status = 200, body = JobView, description = "It has ended"), (status = 202, body = JobView, description = "It is accepted"),
        (status = "4XX", body = Problem, content_type = "application/problem+json"),
        (status = 503, body = Problem, content_type = "application/problem+json"))
)]
pub async fn submit(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    trace: Option<Extension<Context>>,
    headers: HeaderMap,
    JsonBody(body): JsonBody,
) -> Result<Response, Problem> {
    let orderer = Orderer { owner, trace: trace.map(|Extension(trace)| trace) };
    take(state, orderer, &headers, body.to_vec(), Duration::ZERO).await
}

/// Who orders a job, and the span of the request if anybody wants traces.
pub(super) struct Orderer {
    pub(super) owner: Owner,
    pub(super) trace: Option<Context>,
}

/// Accepts a job and waits for it as long as the caller prefers, or else as long as is usual there.
///
/// # Errors
/// What is wrong with the job, or why none is accepted.
pub(super) async fn take(
    state: Shared,
    orderer: Orderer,
    headers: &HeaderMap,
    body: Vec<u8>,
    usual: Duration,
) -> Result<Response, Problem> {
    let start = Instant::now();
    let key = idempotency_key(headers)?;
    let mut preference = Preference::of(headers);
    let answer_seconds = state.config.answer_seconds;
    let used = key.map(|key| Idempotency { key, body: Digest::of(&body) });
    let (leaving, cancel) = Leaving::new();
    let (job, replayed) = state.beside(Some(orderer.owner.clone()), move |state| accept(state, &orderer, &body, used, &cancel)).await?;
    drop(leaving);
    // Whoever asks for an answer at once gets it, wherever others wait.
    let usual = if preference.respond_async { Duration::ZERO } else { usual };
    // The job is accepted: its id must arrive before the time for an answer is over, of which a tenth is left for sending it.
    let left = Duration::from_secs(answer_seconds).mul_f64(0.9).saturating_sub(start.elapsed());
    preference.wait = preference.wait.map(|wait| wait.min(left));
    let view = job.wait(preference.wait.unwrap_or(usual.min(left))).await;
    let ended = view.state.is_final();
    let mut response = answer(view);
    if let Some(applied) = preference.applied(ended).and_then(|applied| HeaderValue::from_str(&applied).ok()) {
        response.headers_mut().insert(PREFERENCE_APPLIED, applied);
    }
    if replayed {
        response.headers_mut().insert("idempotency-replayed", HeaderValue::from_static("true"));
    }
    Ok(response)
}

/// Reads, predicts and accepts: what is refused here never becomes a job.
fn accept(
    state: &AppState,
    orderer: &Orderer,
    body: &[u8],
    idempotency: Option<Idempotency>,
    cancel: &CancelToken,
) -> Result<(Arc<LiveJob>, bool), Problem> {
    let Orderer { owner, trace } = orderer;
    // Before the body is read: the models that it names may have been forgotten since.
    if let Some(used) = &idempotency
        && let Some(job) = state.desk.made_by(&owner.0, used)?
    {
        return Ok((job, true));
    }
    let ask = |predicted| state.ask(owner, Question::Order { predicted }, body, cancel);
    // A prediction that takes too long, or more memory than an answer may have, is no reason to refuse what may be done.
    let answer = ask(true).or_else(|problem| if questions::took_too_much(&problem) { ask(false) } else { Err(problem) })?;
    let order: Ordered = understood(&answer)?;
    let replaced = order.supersedes.as_deref().map(|id| {
        // Beside the event loop, where waiting is allowed.
        let found = tokio::runtime::Handle::current().block_on(state.desk.find(&owner.0, id))?;
        found.ok_or_else(|| documents::unknown_job(id))
    });
    let replaced = replaced.transpose()?;
    if let Some(excess) = order.plan.as_ref().and_then(|plan| plan.exceeds.clone()) {
        return Err(excess.into());
    }
    unless_left(cancel)?;
    let accepted = state.desk.submit(Submission::of(&owner.0, order, idempotency, *trace))?;
    // Only now: a refusal must not cost the caller what there is. The same work twice is not replaced by itself.
    let id_of = |job: &LiveJob| job.with(|record| record.view.id.clone());
    if let Some(replaced) = replaced.filter(|replaced| id_of(replaced) != id_of(&accepted.0) && !replaced.state().is_final()) {
        state.desk.cancel(&replaced)?;
    }
    Ok(accepted)
}

/// What a process answered.
pub(super) fn understood<T: DeserializeOwned>(answer: &str) -> Result<T, Problem> {
    serde_json::from_str(answer).map_err(|error| Problem::internal(format!("an answer cannot be read: {error}")))
}

/// Nobody would learn the id of what is accepted now for a client that has left, or was told that its time is over.
pub(super) fn unless_left(cancel: &CancelToken) -> Result<(), Problem> {
    cancel.reason().map_or(Ok(()), |reason| Err(production::stopped(reason, 0.0)))
}

fn answer(view: JobView) -> Response {
    let place = format!("/v1/jobs/{}", view.id);
    let status = if view.state.is_final() { StatusCode::OK } else { StatusCode::ACCEPTED };
    let mut response = (status, [(header::LOCATION, place), (header::CACHE_CONTROL, "no-store".to_owned())], Json(view)).into_response();
    if status == StatusCode::ACCEPTED {
        response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(LOOK_AGAIN));
    }
    response
}

/// Lists the caller's jobs.
#[utoipa::path(
    get, path = "/v1/jobs", operation_id = "list_jobs", tag = "jobs", params(JobQuery),
    responses((status = 200, body = JobPage), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn list(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    QueryOf(query): QueryOf<JobQuery>,
) -> Result<Json<JobPage>, Problem> {
    let length = page_length(query.limit)?;
    let before = page_cursor(query.cursor, "job_")?;
    let filter = JobFilter { state: query.state, kind: query.kind, before };
    let mut items = state.desk.page(&owner.0, &filter, length + 1).await?;
    let more = items.len() > length;
    items.truncate(length);
    let next = more.then(|| items.last().map(|view| view.id.clone())).flatten();
    Ok(Json(JobPage { items, next }))
}

/// A job, in every state with 200.
#[utoipa::path(
    get, path = "/v1/jobs/{id}", operation_id = "show_job", tag = "jobs", params(("id" = String, Path, description = "The job's id")),
    responses((status = 200, body = JobView), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn show(State(state): State<Shared>, Extension(owner): Extension<Owner>, Path(id): Path<String>) -> Result<Response, Problem> {
    let view = find(&state, &owner, &id).await?.view();
    let ended = view.state.is_final();
    let mut response = ([(header::CACHE_CONTROL, "no-store")], Json(view)).into_response();
    if !ended {
        response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(LOOK_AGAIN));
    }
    Ok(response)
}

/// Stops a job. 200 if it has ended, 202 while it is stopping.
#[utoipa::path(
    post, path = "/v1/jobs/{id}/cancel", operation_id = "cancel_job", tag = "jobs", params(("id" = String, Path, description = "The job's id")),
    responses((status = 200, body = JobView), (status = 202, body = JobView),
        (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn cancel(State(state): State<Shared>, Extension(owner): Extension<Owner>, Path(id): Path<String>) -> Result<Response, Problem> {
    let job = find(&state, &owner, &id).await?;
    state.at_once(move |state| state.desk.cancel(&job)).await.map(answer)
}

/// Stops a job if needed and forgets it. 409 for a job of a batch, which is forgotten with its batch.
#[utoipa::path(
    delete, path = "/v1/jobs/{id}", operation_id = "forget_job", tag = "jobs", params(("id" = String, Path, description = "The job's id")),
    responses((status = 204), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn forget(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    Path(id): Path<String>,
) -> Result<StatusCode, Problem> {
    let job = find(&state, &owner, &id).await?;
    state.at_once(move |state| state.desk.forget(&job)).await.map(|()| StatusCode::NO_CONTENT)
}

/// The caller's job with an id; another's is as absent as one that never was.
///
/// # Errors
/// 404, or 503 when nobody can tell.
pub async fn find(state: &AppState, owner: &Owner, id: &str) -> Result<Arc<LiveJob>, Problem> {
    let shown: String = id.chars().take(80).collect();
    let found = state.desk.find(&owner.0, id).await?;
    found.ok_or_else(|| Problem::new(ProblemKind::NotFound, format!("there is no job {shown:?}")))
}
