//! What surrounds every request: id, log line, metrics, problems in one form, time limit, panics, CORS.

use std::panic::AssertUnwindSafe;
use std::time::{Duration, Instant, SystemTime};

use axum::body::Body;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use futures_util::FutureExt;
use uuid::Uuid;

use super::auth::{RATE_LIMIT, RATE_LIMIT_POLICY};
use super::state::Shared;
use crate::problem::{Problem, ProblemKind};
use crate::traces::{self, Context, Span, SpanKind};

/// The header with a request's id.
pub const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

const EXPOSED: &str = "Location, ETag, Retry-After, X-Request-Id, Repr-Digest, Content-Disposition, Preference-Applied, Content-Range, Accept-Ranges, Allow, Idempotency-Replayed, Link, RateLimit, RateLimit-Policy";

/// Gives a request its id, tells the log and the metrics of it, and every error its form.
pub async fn observe(State(state): State<Shared>, mut request: Request, next: Next) -> Response {
    let start = Instant::now();
    let traced = traced(&mut request);
    let id = request_id(request.headers());
    let method = request.method().clone();
    // Only routes we know become labels: an address of a stranger's making would grow the set forever.
    let route = request.extensions().get::<MatchedPath>().map_or("unmatched", MatchedPath::as_str).to_owned();
    let mut response = guard(&state, request, next).await;
    if response.status().is_client_error() || response.status().is_server_error() {
        response = as_problem(response, &id).await;
    }
    if let Ok(value) = HeaderValue::from_str(&id) {
        response.headers_mut().insert(REQUEST_ID, value);
    }
    // What says nothing else is true now: a cache that guesses would tell of jobs as they were.
    response.headers_mut().entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
    let (status, time) = (response.status().as_u16(), start.elapsed());
    state.metrics.request(known_method(&method), &route, status, time);
    tracing::info!(request_id = %id, %method, %route, status, milliseconds = time.as_millis(), "request");
    if let Some((context, parent)) = traced {
        let end = SystemTime::now();
        let attributes = vec![
            ("http.request.method", known_method(&method).into()),
            ("http.route", route.as_str().into()),
            ("http.response.status_code", status.into()),
            ("lacuna.request.id", id.into()),
        ];
        let name = format!("{} {route}", known_method(&method));
        let start = end.checked_sub(time).unwrap_or(end);
        traces::tell(Span { name, kind: SpanKind::Server, context, parent, start, end, attributes, failed: status >= 500 });
    }
    response
}

/// The span of a request and that of its caller, if anybody wants traces; handlers find the first in the request.
fn traced(request: &mut Request) -> Option<(Context, Option<Context>)> {
    if !traces::wanted() {
        return None;
    }
    let parent = request.headers().get("traceparent").and_then(|value| value.to_str().ok()).and_then(Context::of_header);
    let context = parent.map_or_else(Context::new, Context::child);
    request.extensions_mut().insert(context);
    Some((context, parent))
}

/// Runs the request within its time; a panic becomes our problem.
async fn guard(state: &Shared, request: Request, next: Next) -> Response {
    let time = Duration::from_secs(time_of(state, &request));
    let work = AssertUnwindSafe(next.run(request)).catch_unwind();
    match tokio::time::timeout(time, work).await {
        Ok(Ok(response)) => response,
        Ok(Err(_)) => Problem::internal("a handler panicked").into_response(),
        Err(_) => Problem::new(ProblemKind::Timeout, format!("no answer within {} s", time.as_secs())).into_response(),
    }
}

/// Seconds for an answer: a large file may take long to arrive.
fn time_of(state: &Shared, request: &Request) -> u64 {
    let route = request.extensions().get::<MatchedPath>().map(MatchedPath::as_str);
    let uploads = request.method() == Method::POST && route == Some("/v1/models");
    if uploads { state.config.upload_seconds.max(state.config.answer_seconds) } else { state.config.answer_seconds }
}

/// Characters of what a library says in our place: a sentence, not a page.
const SAID: usize = 500;

async fn as_problem(mut response: Response, id: &str) -> Response {
    let mut problem = match response.extensions_mut().remove::<Problem>() {
        Some(problem) => problem,
        None => said_by_library(&mut response).await,
    };
    if problem.is_defect() {
        tracing::error!(request_id = %id, code = %problem.code, detail = %problem.detail, "defect");
    }
    problem.request_id = Some(id.to_owned());
    let kept = [header::ALLOW, header::CONTENT_RANGE, RATE_LIMIT, RATE_LIMIT_POLICY]
        .map(|name| (name.clone(), response.headers().get(&name).cloned()));
    let mut answer = problem.into_response();
    for (name, value) in kept {
        if let Some(value) = value {
            answer.headers_mut().insert(name, value);
        }
    }
    answer
}

/// What a library refuses in our place, with its own words on what the caller may mend.
async fn said_by_library(response: &mut Response) -> Problem {
    let mut problem = Problem::from_status(response.status().as_u16());
    if !problem.is_defect() {
        let body = std::mem::take(response.body_mut());
        let said = axum::body::to_bytes(body, 4 * SAID).await.unwrap_or_default();
        let said: String = String::from_utf8_lossy(&said).chars().take(SAID).collect();
        if !said.trim().is_empty() {
            problem.detail = said;
        }
    }
    problem
}

/// The caller's id if it is harmless in a log, else a new one.
fn request_id(headers: &HeaderMap) -> String {
    let given = headers.get(REQUEST_ID).and_then(|value| value.to_str().ok());
    let harmless =
        |id: &&str| (1..=128).contains(&id.len()) && id.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_.:".contains(&byte));
    given.filter(harmless).map_or_else(|| Uuid::now_v7().to_string(), str::to_owned)
}

/// Anybody can invent methods; they must not become labels.
fn known_method(method: &Method) -> &'static str {
    match *method {
        Method::GET => "GET",
        Method::HEAD => "HEAD",
        Method::POST => "POST",
        Method::DELETE => "DELETE",
        Method::OPTIONS => "OPTIONS",
        _ => "other",
    }
}

/// Lets the pages of listed origins read every answer, errors included: it is the outermost layer.
pub async fn cors(State(state): State<Shared>, request: Request, next: Next) -> Response {
    let origin = request.headers().get(header::ORIGIN).cloned();
    let allowed = origin.filter(|origin| state.config.cors_origins.iter().any(|known| known.as_bytes() == origin.as_bytes()));
    let preflight = request.method() == Method::OPTIONS && request.headers().contains_key(header::ACCESS_CONTROL_REQUEST_METHOD);
    let mut response = if preflight && allowed.is_some() { preflight_answer() } else { next.run(request).await };
    if let Some(origin) = allowed {
        let headers = response.headers_mut();
        headers.insert(header::ACCESS_CONTROL_ALLOW_ORIGIN, origin);
        headers.insert(header::ACCESS_CONTROL_EXPOSE_HEADERS, HeaderValue::from_static(EXPOSED));
    }
    if !state.config.cors_origins.is_empty() {
        response.headers_mut().append(header::VARY, HeaderValue::from_static("Origin"));
    }
    response
}

fn preflight_answer() -> Response {
    let mut response = Response::new(Body::empty());
    *response.status_mut() = StatusCode::NO_CONTENT;
    let headers = response.headers_mut();
    headers.insert(header::ACCESS_CONTROL_ALLOW_METHODS, HeaderValue::from_static("GET, HEAD, POST, DELETE"));
    headers.insert(
        header::ACCESS_CONTROL_ALLOW_HEADERS,
        HeaderValue::from_static(
            "Authorization, Content-Type, Content-Disposition, Idempotency-Key, Prefer, Range, If-Match, If-None-Match, If-Range, Last-Event-ID, Traceparent, X-Request-Id",
        ),
    );
    headers.insert(header::ACCESS_CONTROL_MAX_AGE, HeaderValue::from_static("600"));
    response
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn ids_are_kept_if_harmless() {
        let with = |value: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(REQUEST_ID, value.parse().unwrap());
            request_id(&headers)
        };
        assert_eq!(with("build-7:42"), "build-7:42");
        assert_ne!(with("a b"), "a b");
        assert_ne!(with(&"x".repeat(129)), "x".repeat(129));
        assert_eq!(request_id(&HeaderMap::new()).len(), 36);
    }
}
