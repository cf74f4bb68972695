//! A job's events as they happen (Server-Sent Events).

use std::collections::VecDeque;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::{Extension, Path, State};
use axum::http::{HeaderMap, header};
use axum::response::IntoResponse;
use axum::response::sse::{Event as Sent, KeepAlive, Sse};
use futures_util::stream::{self, Stream};
use tokio::sync::watch;

use super::jobs::find;
use crate::http::auth::Owner;
use crate::http::state::Shared;
use crate::jobs::events::Event;
use crate::jobs::live::LiveJob;
use crate::problem::Problem;

/// Between two comments that keep the connection open: below the idle times of proxies.
pub(super) const PING: Duration = Duration::from_secs(15);

/// When a client should come back after the stream broke.
pub(super) const RETRY: Duration = Duration::from_secs(2);

/// A job's events: `state`, `progress`, `warning`, `output`, `done`; the last ends the stream.
///
/// A client that lost the stream sends `Last-Event-ID` and gets what it missed; all there is, if the service was started again in between.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/events", operation_id = "job_events", tag = "jobs",
    params(("id" = String, Path, description = "The job's id"),
        ("Last-Event-ID" = Option<u64>, Header, description = "The last event that arrived")),
    responses((status = 200, content_type = "text/event-stream", description = "One event after the other, with id and name; the data of each is JSON"),
        (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn events(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<impl IntoResponse, Problem> {
    let job = find(&state, &owner, &id).await?;
    let last = headers.get("last-event-id").and_then(|value| value.to_str().ok()?.parse().ok()).unwrap_or(0);
    let stream = follow(job, last, state.closing.subscribe());
    let sse = Sse::new(stream).keep_alive(KeepAlive::new().interval(PING).text("ping"));
    // Proxies that collect an answer before they send it on would hold the events back.
    Ok(([(header::CACHE_CONTROL, "no-store"), (header::HeaderName::from_static("x-accel-buffering"), "no")], sse))
}

struct Listener {
    job: Arc<LiveJob>,
    latest: watch::Receiver<u64>,
    closing: watch::Receiver<bool>,
    waiting: VecDeque<Event>,
    last: u64,
    over: bool,
}

fn follow(job: Arc<LiveJob>, last: u64, closing: watch::Receiver<bool>) -> impl Stream<Item = Result<Sent, Infallible>> {
    let latest = job.events.subscribe();
    // An id that was never given here is of an earlier process: the log begins anew.
    let last = if last > *latest.borrow() { 0 } else { last };
    let listener = Listener { job, latest, closing, waiting: VecDeque::new(), last, over: false };
    stream::unfold(listener, |mut listener| async move { listener.next().await.map(|event| (Ok(event), listener)) })
}

impl Listener {
    async fn next(&mut self) -> Option<Sent> {
        loop {
            if self.over {
                return None;
            }
            self.latest.mark_unchanged();
            if self.waiting.is_empty() {
                self.waiting = self.job.events.after(self.last).into();
            }
            if let Some(event) = self.waiting.pop_front() {
                self.last = event.id;
                self.over = event.name == "done";
                return Some(Sent::default().id(event.id.to_string()).event(event.name).retry(RETRY).data(event.data));
            }
            // The state is final a moment before its last events are there: only `done` is the end.
            if self.job.state().is_final()
                && self.job.events.after(0).last().is_some_and(|last| last.name == "done" && last.id <= self.last)
            {
                return None;
            }
            tokio::select! {
                changed = self.latest.changed() => changed.ok()?,
                _ = self.closing.wait_for(|closing| *closing) => {
                    // An open stream would hold the shutdown up; the client comes back to the next process.
                    self.over = true;
                    return Some(Sent::default().comment("the service is going down").retry(RETRY));
                }
            }
        }
    }
}
