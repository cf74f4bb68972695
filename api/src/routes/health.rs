//! Probes, version and metrics.

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

use crate::http::state::Shared;
use crate::problem::{Problem, ProblemKind};

/// What a probe learns.
#[derive(Debug, Serialize, ToSchema)]
pub struct Health {
    /// `ok`.
    status: &'static str,
}

/// Which program answers.
#[derive(Debug, Serialize, ToSchema)]
pub struct Version {
    /// `lacuna`.
    name: &'static str,
    /// The version of the service and of the kernel in it.
    version: &'static str,
    /// The version of the contract, the `v` of the addresses.
    api: &'static str,
}

/// Whether the process answers.
#[utoipa::path(get, path = "/livez", tag = "operation", security(()), responses((status = 200, body = Health)))]
pub async fn livez() -> Json<Health> {
    Json(Health { status: "ok" })
}

/// Whether the service takes work: not while it goes down, nor while its data folder, or the database and the object
/// store that it shares with others, cannot be used.
#[utoipa::path(
    get, path = "/readyz", tag = "operation", security(()),
    responses((status = 200, body = Health), (status = 503, body = Problem, content_type = "application/problem+json"))
)]
pub async fn readyz(State(state): State<Shared>) -> Result<Json<Health>, Problem> {
    if state.desk.is_stopping() {
        return Err(Problem::new(ProblemKind::ShuttingDown, "the service is going down").retry_after(10));
    }
    state.at_once(|state| state.desk.probe()).await.map_err(|problem| {
        tracing::error!(code = %problem.code, detail = %problem.detail, "not ready");
        let detail = "what the service keeps its jobs in cannot be used; the log has the cause";
        Problem::new(ProblemKind::Unavailable, detail).code("not-ready").retry_after(10)
    })?;
    Ok(Json(Health { status: "ok" }))
}

/// The program's version.
#[utoipa::path(get, path = "/version", tag = "operation", security(()),
    responses((status = 200, body = Version), (status = "4XX", body = Problem, content_type = "application/problem+json")))]
pub async fn version() -> Json<Version> {
    Json(Version { name: "lacuna", version: env!("CARGO_PKG_VERSION"), api: "v1" })
}

/// Counters in the text format of Prometheus.
#[utoipa::path(
    get, path = "/metrics", tag = "operation",
    responses((status = 200, content_type = "text/plain", body = String), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn metrics(State(state): State<Shared>) -> Response {
    let workers = if state.config.role.works() { state.config.workers as u64 } else { 0 };
    let mut gauges = vec![("lacuna_workers", "workers of this process", workers)];
    // Without the database the process still tells of itself.
    if let Ok(jobs) = state.desk.gauges().await {
        gauges.push(("lacuna_jobs_queued", "jobs that wait", jobs.queued));
        gauges.push(("lacuna_jobs_running", "jobs that workers are at", jobs.running));
        gauges.push(("lacuna_jobs_kept", "jobs whose record is kept", jobs.kept));
    }
    ([(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")], state.metrics.render(&gauges)).into_response()
}
