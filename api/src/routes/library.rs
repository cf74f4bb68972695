//! Classics as model documents.

use axum::Json;
use axum::extract::Path;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use lacuna_exchange::library::{CLASSICS, Classic, find};
use serde::Serialize;
use utoipa::ToSchema;

use super::models::MEDIA_TYPE;
use crate::digest::Digest;
use crate::http::headers::{is_known, untold};
use crate::openapi::Model;
use crate::problem::{Problem, ProblemKind};

/// A classic of the library.
#[derive(Debug, Serialize, ToSchema)]
pub struct ClassicView {
    /// Its name, for addresses and the command line.
    name: &'static str,
    /// What people call it.
    title: &'static str,
    /// Where it comes from.
    source: &'static str,
}

/// The library.
#[derive(Debug, Serialize, ToSchema)]
pub struct LibraryPage {
    /// The classics, sorted by name.
    items: Vec<ClassicView>,
}

/// What the library holds.
#[must_use]
pub fn page() -> LibraryPage {
    LibraryPage { items: CLASSICS.iter().map(|&Classic { name, title, source, .. }| ClassicView { name, title, source }).collect() }
}

/// The classic of a name.
///
/// # Errors
/// When there is none.
pub fn classic(name: &str) -> Result<&'static Classic, Problem> {
    find(name).ok_or_else(|| {
        let names: Vec<&str> = CLASSICS.iter().map(|classic| classic.name).collect();
        let asked: String = name.chars().take(80).collect();
        Problem::new(ProblemKind::NotFound, format!("the library has no {asked:?}; it has {}", names.join(", "))).code("library.unknown")
    })
}

/// Lists the library of classics.
#[utoipa::path(
    get, path = "/v1/library", operation_id = "list_classics", tag = "models",
    responses((status = 200, body = LibraryPage), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn list() -> Json<LibraryPage> {
    Json(page())
}

/// The model document of a classic. `HEAD` gives its headers.
#[utoipa::path(
    get, path = "/v1/library/{name}", operation_id = "fetch_classic", tag = "models", params(("name" = String, Path, description = "The classic's name")),
    responses((status = 200, body = Model, content_type = "application/vnd.lacuna.model+json;v=1"), (status = 304),
        (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn fetch(Path(name): Path<String>, headers: HeaderMap) -> Result<Response, Problem> {
    let document = classic(&name)?.document;
    let etag = format!("\"{}\"", Digest::of(document.as_bytes()));
    let shared = [(header::ETAG, etag.clone()), (header::CACHE_CONTROL, "private, no-cache".to_owned())];
    if is_known(&headers, &etag) {
        return Ok((StatusCode::NOT_MODIFIED, shared, untold()).into_response());
    }
    Ok((shared, [(header::CONTENT_TYPE, MEDIA_TYPE)], document).into_response())
}
