//! The files that jobs made.

use axum::body::Body;
use axum::extract::{Extension, Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use utoipa::IntoParams;

use super::jobs::find;
use crate::digest::Digest;
use crate::http::auth::Owner;
use crate::http::headers::QueryOf;
use crate::http::range;
use crate::http::state::Shared;
use crate::problem::{Problem, ProblemKind};
use crate::store::File;

/// How an output is handed out.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct OutputQuery {
    /// 0: the bytes at once instead of their address.
    redirect: Option<u8>,
}

/// A job's output: 303 to its bytes, or the bytes with `?redirect=0`. `HEAD` gives the headers.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/outputs/{name}", operation_id = "job_output", tag = "results",
    params(("id" = String, Path, description = "The job's id"), ("name" = String, Path, description = "`stl`, `3mf`, ..., `certificate.json`"),
        OutputQuery),
    responses((status = 303, description = "`Location` is the address of the bytes"),
        (status = 200, content_type = "application/octet-stream", description = "The bytes, with the output's own media type"), (status = 206), (status = 304),
        (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn output(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    Path((id, name)): Path<(String, String)>,
    QueryOf(query): QueryOf<OutputQuery>,
    headers: HeaderMap,
) -> Result<Response<Body>, Problem> {
    let view = find(&state, &owner, &id).await?.view();
    if !view.state.is_final() {
        let detail = format!("the job is {}; its outputs are there when it has ended", view.state.word());
        return Err(Problem::new(ProblemKind::StateConflict, detail).retry_after(1));
    }
    let output = view.outputs.iter().find(|output| output.name == name || output.file_name == name).ok_or_else(|| {
        let names: Vec<&str> = view.outputs.iter().map(|output| output.name.as_str()).collect();
        Problem::new(
            ProblemKind::NotFound,
            format!("the job has no such output; it has {}", if names.is_empty() { "none".into() } else { names.join(", ") }),
        )
    })?;
    if query.redirect == Some(0) {
        return range::answer(&headers, &state.store, File::Result(output.digest), output).await;
    }
    let place = [(header::LOCATION, format!("/v1/results/{}", output.digest)), (header::CACHE_CONTROL, "no-store".to_owned())];
    Ok((StatusCode::SEE_OTHER, place).into_response())
}

/// The bytes with a digest, if one of the caller's jobs made them. They never change. `HEAD` gives the headers.
#[utoipa::path(
    get, path = "/v1/results/{digest}", operation_id = "fetch_result", tag = "results",
    params(("digest" = String, Path, description = "`sha256:` and 64 hex digits"),
        ("Range" = Option<String>, Header, description = "One range of bytes")),
    responses((status = 200, content_type = "application/octet-stream", description = "The bytes, with their own media type"),
        (status = 206, description = "The range"), (status = 304), (status = 416, body = Problem, content_type = "application/problem+json"),
        (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn result(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    Path(digest): Path<String>,
    headers: HeaderMap,
) -> Result<Response<Body>, Problem> {
    let absent = || Problem::new(ProblemKind::NotFound, "no job of yours made such a result, or it is no longer kept");
    let digest: Digest = digest.parse().map_err(|_| absent())?;
    // A digest is not a permission: only who owns a job that made the bytes may read them.
    let output = state.desk.find_output(&owner.0, digest).await?.ok_or_else(absent)?;
    range::answer(&headers, &state.store, File::Result(output.digest), &output).await
}
