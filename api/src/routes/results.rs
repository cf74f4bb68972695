//! The files that jobs made.

use axum::body::Body;
use axum::extract::{Extension, Path, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use lacuna_exchange::format::Format;
use serde::Deserialize;
use utoipa::IntoParams;

use super::jobs::find;
use crate::digest::Digest;
use crate::documents;
use crate::http::accept::Accept;
use crate::http::auth::Owner;
use crate::http::headers::QueryOf;
use crate::http::range;
use crate::http::state::Shared;
use crate::jobs::record::{JobState, Output};
use crate::problem::{Problem, ProblemKind};
use crate::store::File;

/// How an output is handed out.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct OutputQuery {
    /// 0: the bytes at once instead of their address.
    redirect: Option<u8>,
    /// The format that is wanted: `stl`, `3mf`, ... It goes before `Accept`.
    format: Option<String>,
}

/// A job's output: 303 to its bytes, or the bytes with `?redirect=0`. `HEAD` gives the headers.
///
/// A file name without its ending stands for all files of that name: `format`, or else `Accept`, says which of them.
/// `application/octet-stream` accepts every file. 406 where none is acceptable: nothing is converted here.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/outputs/{name}", operation_id = "job_output", tag = "results",
    params(("id" = String, Path, description = "The job's id"), ("name" = String, Path, description = "`stl`, `3mf`, ..., `certificate.json`; a file's name, with its ending or without"),
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
    let there = named(&view.outputs, &name)?;
    if view.state == JobState::Expired {
        return Err(range::expired(&name));
    }
    let output = choose(&there, query.format.as_deref(), &headers)?;
    let mut response = if query.redirect == Some(0) {
        range::answer(&headers, &state.store, File::Result(output.digest), output).await?
    } else {
        let place = [(header::LOCATION, format!("/v1/results/{}", output.digest)), (header::CACHE_CONTROL, "no-store".to_owned())];
        (StatusCode::SEE_OTHER, place).into_response()
    };
    response.headers_mut().insert(header::VARY, HeaderValue::from_static("Accept"));
    Ok(response)
}

/// The outputs that a name stands for: the one that is called so, or else all files with that name before their endings.
fn named<'o>(outputs: &'o [Output], name: &str) -> Result<Vec<&'o Output>, Problem> {
    if let Some(output) = outputs.iter().find(|output| output.name == name || output.file_name == name) {
        return Ok(vec![output]);
    }
    let stem = |output: &Output| output.file_name.rsplit_once('.').is_some_and(|(stem, _)| stem == name);
    let found: Vec<&Output> = outputs.iter().filter(|output| stem(output)).collect();
    if found.is_empty() {
        let names: Vec<&str> = outputs.iter().map(|output| output.name.as_str()).collect();
        let there = if names.is_empty() { "none".into() } else { names.join(", ") };
        return Err(Problem::new(ProblemKind::NotFound, format!("the job has no such output; it has {there}")));
    }
    Ok(found)
}

/// The one of some outputs that the caller prefers.
fn choose<'o>(there: &[&'o Output], format: Option<&str>, headers: &HeaderMap) -> Result<&'o Output, Problem> {
    let chosen = match format {
        Some(format) => {
            let format = documents::format(format)
                .map_err(|problem| Problem::new(ProblemKind::BadRequest, problem.detail).code("unknown-format"))?;
            there.iter().copied().find(|output| of_format(output, format))
        }
        None => Accept::of(headers)?.preferred(there.iter().copied(), |output| output.media_type.as_str()),
    };
    chosen.ok_or_else(|| {
        let there: Vec<String> = there.iter().map(|output| format!("{} ({})", output.media_type, output.file_name)).collect();
        let detail = format!(
            "the job made {}, and the request accepts none of it; a job of kind `convert`, or this one again, makes the formats that its `outputs` name",
            there.join(", ")
        );
        Problem::new(ProblemKind::NotAcceptable, detail)
    })
}

fn of_format(output: &Output, format: Format) -> bool {
    output.name == format.facts().ending
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
    let made = state.desk.find_output(&owner.0, digest).await?.ok_or_else(absent)?;
    if made.expired {
        return Err(range::expired(&made.output.file_name));
    }
    let output = made.output;
    range::answer(&headers, &state.store, File::Result(output.digest), &output).await
}
