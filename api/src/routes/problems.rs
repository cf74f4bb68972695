//! What the addresses in `type` of problems lead to.

use axum::Json;
use axum::extract::Path;
use serde::Serialize;
use utoipa::ToSchema;

use crate::problem::{Problem, ProblemKind};

/// A kind of problem.
#[derive(Debug, Serialize, ToSchema)]
pub struct ProblemPage {
    /// Its address, as in `type`.
    #[serde(rename = "type")]
    kind: ProblemKind,
    /// The kind in words.
    title: &'static str,
    /// The HTTP status of answers with it.
    status: u16,
    /// The exit code of commands that end with it.
    exit_code: u8,
}

/// Tells a kind of problem.
#[utoipa::path(
    get, path = "/problems/{code}", operation_id = "show_problem", tag = "operation", security(()),
    params(("code" = String, Path, description = "The last part of a problem's `type`")),
    responses((status = 200, body = ProblemPage), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn problem(Path(code): Path<String>) -> Result<Json<ProblemPage>, Problem> {
    let found = ProblemKind::of_code(&code).ok_or_else(|| {
        let shown: String = code.chars().take(80).collect();
        Problem::new(ProblemKind::NotFound, format!("there is no kind of problem {shown:?}; the type of a problem is its address"))
    })?;
    let plain = Problem::new(found, "");
    Ok(Json(ProblemPage { kind: found, title: found.title(), status: plain.status, exit_code: found.exit_code() }))
}
