//! Shortcuts: a job of one kind that is usually waited for.

use std::time::Duration;

use axum::extract::{Extension, State};
use axum::http::HeaderMap;
use axum::response::Response;
use lacuna_fabrication::JobKind;

use super::jobs::{Orderer, take};
use crate::documents::of_kind;
use crate::http::auth::Owner;
use crate::http::body::JsonBody;
use crate::http::state::Shared;
use crate::jobs::record::JobView;
use crate::openapi::ShortOrder;
use crate::problem::Problem;
use crate::traces::Context;

/// How long a shortcut waits unless `Prefer` says otherwise: below what proxies allow.
const WAIT: Duration = Duration::from_secs(10);

/// Measures: a job of the kind `measure`, waited for 10 s.
///
/// 200 if it has ended by then, else 202 with its `Location`: nothing is lost, and `Prefer: wait=n` chooses another time.
#[utoipa::path(
    post, path = "/v1/measure", operation_id = "measure", tag = "jobs", request_body = ShortOrder,
    params(("Prefer" = Option<String>, Header, description = "`wait=10`, `respond-async`"),
        ("Idempotency-Key" = Option<String>, Header, description = "1 to 255 characters, the caller's choice")),
    responses((status = 200, body = JobView, description = "It has ended"), (status = 202, body = JobView, description = "It is accepted"),
        (status = "4XX", body = Problem, content_type = "application/problem+json"),
        (status = 503, body = Problem, content_type = "application/problem+json"))
)]
pub async fn measure(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    trace: Option<Extension<Context>>,
    headers: HeaderMap,
    JsonBody(body): JsonBody,
) -> Result<Response, Problem> {
    let orderer = Orderer { owner, trace: trace.map(|Extension(trace)| trace) };
    take(state, orderer, &headers, of_kind(&body, JobKind::Measure), WAIT).await
}

/// Evaluates: a job of the kind `evaluate`, waited for 10 s.
///
/// 200 if it has ended by then, else 202 with its `Location`: nothing is lost, and `Prefer: wait=n` chooses another time.
#[utoipa::path(
    post, path = "/v1/evaluate", operation_id = "evaluate", tag = "jobs", request_body = ShortOrder,
    params(("Prefer" = Option<String>, Header, description = "`wait=10`, `respond-async`"),
        ("Idempotency-Key" = Option<String>, Header, description = "1 to 255 characters, the caller's choice")),
    responses((status = 200, body = JobView, description = "It has ended"), (status = 202, body = JobView, description = "It is accepted"),
        (status = "4XX", body = Problem, content_type = "application/problem+json"),
        (status = 503, body = Problem, content_type = "application/problem+json"))
)]
pub async fn evaluate(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    trace: Option<Extension<Context>>,
    headers: HeaderMap,
    JsonBody(body): JsonBody,
) -> Result<Response, Problem> {
    let orderer = Orderer { owner, trace: trace.map(|Extension(trace)| trace) };
    take(state, orderer, &headers, of_kind(&body, JobKind::Evaluate), WAIT).await
}
