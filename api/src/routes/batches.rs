//! Batches: several jobs that are accepted together, followed, stopped and certified as one.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::Json;
use axum::body::{Body, Bytes};
use axum::extract::{Extension, Path, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::sse::{Event as Sent, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::future::BoxFuture;
use futures_util::stream::{self, FuturesUnordered, Stream, StreamExt};
use lacuna_kernel::budget::CancelToken;
use tokio::sync::watch;

use super::events::{PING, RETRY};
use super::jobs::{LOOK_AGAIN, Orderer, understood, unless_left};
use crate::digest::Digest;
use crate::http::accept::Accept;
use crate::http::auth::Owner;
use crate::http::body::JsonBody;
use crate::http::headers::{PREFERENCE_APPLIED, Preference, idempotency_key};
use crate::http::state::{AppState, Leaving, Shared};
use crate::jobs::batch::{Batch, BatchCertificate, BatchRow, BatchState, BatchView};
use crate::jobs::desk::{BatchSubmission, Submission};
use crate::jobs::record::Idempotency;
use crate::openapi::Batch as BatchDocument;
use crate::orders::Ordered;
use crate::problem::{Problem, ProblemKind};
use crate::questions::Question;
use crate::traces::Context;

const EVENT_STREAM: &str = "text/event-stream";
const LINES: &str = "application/x-ndjson";

/// Submits up to 100 jobs at once.
///
/// All are accepted, or none: faults of any of the documents refuse the batch, with their places. Then every job ends for itself, well or not. They count as so many
/// submissions and so many unfinished jobs; those whose work was done before are answered at once and count as submissions alone. What only computing shows, a limit that
/// is passed too, is the problem of that job. With `Prefer: wait=n` (30 at most) the answer waits up to n seconds for the end of all.
#[utoipa::path(
    post, path = "/v1/batches", operation_id = "submit_batch", tag = "jobs", request_body = BatchDocument,
    params(("Prefer" = Option<String>, Header, description = "`wait=10`, `respond-async`"),
        ("Idempotency-Key" = Option<String>, Header, description = "1 to 255 characters, the caller's choice")),
    responses((status = 200, body = BatchView, description = "All of its jobs have ended"), (status = 202, body = BatchView, description = "It is accepted"),
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
    let start = Instant::now();
    let orderer = Orderer { owner, trace: trace.map(|Extension(trace)| trace) };
    let used = idempotency_key(&headers)?.map(|key| Idempotency { key, body: Digest::of(&body) });
    let preference = Preference::of(&headers);
    let answer_seconds = state.config.answer_seconds;
    let (leaving, cancel) = Leaving::new();
    let (batch, replayed) = state.beside(Some(orderer.owner.clone()), move |state| accept(state, &orderer, &body, used, &cancel)).await?;
    drop(leaving);
    // As for a job: its id must arrive before the time for an answer is over.
    let left = Duration::from_secs(answer_seconds).mul_f64(0.9).saturating_sub(start.elapsed());
    let wait = preference.wait.map_or(Duration::ZERO, |wait| wait.min(left));
    let all = async {
        for job in batch.jobs.iter().flatten() {
            job.wait(Duration::MAX).await;
        }
    };
    let _ = tokio::time::timeout(wait, all).await;
    let view = batch.view();
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

/// Reads all jobs, with the faults of all as one problem, and accepts them together.
fn accept(
    state: &AppState,
    orderer: &Orderer,
    body: &[u8],
    idempotency: Option<Idempotency>,
    cancel: &CancelToken,
) -> Result<(Batch, bool), Problem> {
    let Orderer { owner, trace } = orderer;
    // Before the body is read, as for a job.
    if let Some(used) = &idempotency
        && let Some(batch) = state.desk.batch_made_by(&owner.0, used)?
    {
        return Ok((batch, true));
    }
    let answer = state.ask(owner, Question::Batch, body, cancel)?;
    let jobs: Vec<(Option<String>, Ordered)> = understood(&answer)?;
    // The request itself has been counted as one.
    state.submissions.draw(owner, jobs.len() - 1)?;
    unless_left(cancel)?;
    let jobs = jobs.into_iter().map(|(name, order)| (name, Submission::of(&owner.0, order, None, *trace))).collect();
    state.desk.submit_batch(BatchSubmission { owner: owner.0.clone(), jobs, idempotency })
}

fn answer(view: BatchView) -> Response {
    let place = format!("/v1/batches/{}", view.id);
    let status = if view.state.is_final() { StatusCode::OK } else { StatusCode::ACCEPTED };
    let mut response = (status, [(header::LOCATION, place), (header::CACHE_CONTROL, "no-store".to_owned())], Json(view)).into_response();
    if status == StatusCode::ACCEPTED {
        response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(LOOK_AGAIN));
    }
    response
}

/// A batch, in every state with 200: how many of its jobs stand where, and a row for each.
#[utoipa::path(
    get, path = "/v1/batches/{id}", operation_id = "show_batch", tag = "jobs", params(("id" = String, Path, description = "The batch's id")),
    responses((status = 200, body = BatchView), (status = "4XX", body = Problem, content_type = "application/problem+json"))
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

/// What is proven of all results of a batch: for every job how it ended, the digests of its files, and its key figures or its problem.
///
/// 409 until all of its jobs have ended; 410 once they have expired. Until then its bytes stay the same.
#[utoipa::path(
    get, path = "/v1/batches/{id}/certificate", operation_id = "batch_certificate", tag = "jobs",
    params(("id" = String, Path, description = "The batch's id")),
    responses((status = 200, body = BatchCertificate), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn certificate(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    Path(id): Path<String>,
) -> Result<Response, Problem> {
    let view = find(&state, &owner, &id).await?.view();
    if !view.state.is_final() {
        let left = view.counts.queued + view.counts.running;
        let detail = format!("{left} of {} jobs have not ended; the certificate is there when all have", view.jobs.len());
        return Err(Problem::new(ProblemKind::StateConflict, detail).retry_after(LOOK_AGAIN));
    }
    if view.state == BatchState::Expired {
        let detail =
            "the certificate is no longer kept; submit the batch again (POST /v1/batches with the same document), and it is made again";
        return Err(Problem::new(ProblemKind::ResultExpired, detail));
    }
    let bytes = BatchCertificate::of(Some(view.id), view.counts, view.jobs).bytes()?;
    let tag = format!("\"{}\"", Digest::of(&bytes));
    let headers =
        [(header::CONTENT_TYPE, "application/json".to_owned()), (header::CACHE_CONTROL, "no-store".to_owned()), (header::ETAG, tag)];
    Ok((headers, bytes).into_response())
}

/// Stops all jobs of a batch that have not ended. 200 if all have ended, 202 while some are stopping.
#[utoipa::path(
    post, path = "/v1/batches/{id}/cancel", operation_id = "cancel_batch", tag = "jobs", params(("id" = String, Path, description = "The batch's id")),
    responses((status = 200, body = BatchView), (status = 202, body = BatchView),
        (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn cancel(State(state): State<Shared>, Extension(owner): Extension<Owner>, Path(id): Path<String>) -> Result<Response, Problem> {
    let batch = find(&state, &owner, &id).await?;
    state.at_once(move |state| state.desk.cancel_batch(&batch).map(|()| answer(batch.view()))).await
}

/// Stops a batch if needed and forgets it with all of its jobs.
#[utoipa::path(
    delete, path = "/v1/batches/{id}", operation_id = "forget_batch", tag = "jobs", params(("id" = String, Path, description = "The batch's id")),
    responses((status = 204), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn forget(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    Path(id): Path<String>,
) -> Result<StatusCode, Problem> {
    let batch = find(&state, &owner, &id).await?;
    state.at_once(move |state| state.desk.forget_batch(&batch)).await.map(|()| StatusCode::NO_CONTENT)
}

/// The rows of a batch's jobs as they end.
///
/// Server-Sent Events: `row` for every job that has ended or ends, then `done` with the batch; or with `Accept: application/x-ndjson` the rows alone, one a line. A stream
/// that is opened again begins again; how far a single job has come is told by its own events.
#[utoipa::path(
    get, path = "/v1/batches/{id}/events", operation_id = "batch_events", tag = "jobs",
    params(("id" = String, Path, description = "The batch's id")),
    responses((status = 200, description = "One row after the other", content((String = "text/event-stream"), (String = "application/x-ndjson"))),
        (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn events(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let there = [EVENT_STREAM, LINES];
    let media_type = Accept::of(&headers)?.preferred(there, |name| name).ok_or_else(|| {
        let detail = format!("rows come as {}, and Accept refuses both", there.join(" or "));
        Problem::new(ProblemKind::NotAcceptable, detail)
    })?;
    let told = follow(find(&state, &owner, &id).await?, state.closing.subscribe());
    let mut response = if media_type == LINES {
        let lines = told.filter_map(|told| async move {
            let Told::Row(row) = told else { return None };
            let mut line = serde_json::to_vec(&*row).unwrap_or_default();
            line.push(b'\n');
            Some(Ok::<_, Infallible>(Bytes::from(line)))
        });
        ([(header::CONTENT_TYPE, LINES)], Body::from_stream(lines)).into_response()
    } else {
        let sent = told.map(|told| {
            let event = match told {
                Told::Row(row) => Sent::default().event("row").data(serde_json::to_string(&*row).unwrap_or_default()),
                Told::Done(view) => Sent::default().event("done").data(serde_json::to_string(&*view).unwrap_or_default()),
                Told::Closing => Sent::default().comment("the service is going down"),
            };
            Ok::<_, Infallible>(event.retry(RETRY))
        });
        Sse::new(sent).keep_alive(KeepAlive::new().interval(PING).text("ping")).into_response()
    };
    // Proxies that collect an answer before they send it on would hold the rows back.
    let told = [(header::CACHE_CONTROL, "no-store"), (HeaderName::from_static("x-accel-buffering"), "no"), (header::VARY, "Accept")];
    response.headers_mut().extend(told.map(|(name, value)| (name, HeaderValue::from_static(value))));
    Ok(response)
}

enum Told {
    Row(Box<BatchRow>),
    Done(Box<BatchView>),
    Closing,
}

struct Listener {
    batch: Batch,
    /// Places of jobs that had ended before anybody listened.
    ended: VecDeque<usize>,
    /// The places of the others, once they end.
    ending: FuturesUnordered<BoxFuture<'static, usize>>,
    closing: watch::Receiver<bool>,
    over: bool,
}

fn follow(batch: Batch, closing: watch::Receiver<bool>) -> impl Stream<Item = Told> {
    let (mut ended, ending) = (VecDeque::new(), FuturesUnordered::<BoxFuture<'static, usize>>::new());
    for (index, job) in batch.jobs.iter().enumerate() {
        match job {
            Some(job) if !job.state().is_final() => {
                let job = Arc::clone(job);
                ending.push(Box::pin(async move {
                    job.wait(Duration::MAX).await;
                    index
                }));
            }
            _ => ended.push_back(index),
        }
    }
    let listener = Listener { batch, ended, ending, closing, over: false };
    stream::unfold(listener, |mut listener| async move { listener.next().await.map(|told| (told, listener)) })
}

impl Listener {
    async fn next(&mut self) -> Option<Told> {
        if self.over {
            return None;
        }
        if let Some(index) = self.ended.pop_front() {
            return Some(Told::Row(Box::new(self.batch.row(index))));
        }
        tokio::select! {
            next = self.ending.next() => match next {
                Some(index) => Some(Told::Row(Box::new(self.batch.row(index)))),
                None => {
                    self.over = true;
                    Some(Told::Done(Box::new(self.batch.view())))
                }
            },
            _ = self.closing.wait_for(|closing| *closing) => {
                // An open stream would hold the shutdown up; the client comes back to the next process.
                self.over = true;
                Some(Told::Closing)
            }
        }
    }
}

/// The caller's batch with an id; another's is as absent as one that never was.
async fn find(state: &AppState, owner: &Owner, id: &str) -> Result<Batch, Problem> {
    let shown: String = id.chars().take(80).collect();
    let found = state.desk.find_batch(&owner.0, id).await?;
    found.ok_or_else(|| Problem::new(ProblemKind::NotFound, format!("there is no batch {shown:?}")))
}
