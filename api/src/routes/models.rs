//! Stored models.

use axum::Json;
use axum::extract::{Extension, FromRequest, Path, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use lacuna_exchange::format::Format;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use super::uploads::{self, MeshFile, UploadQuery};
use crate::digest::Digest;
use crate::documents;
use crate::files;
use crate::http::auth::Owner;
use crate::http::body::{JsonBody, is_json};
use crate::http::headers::{QueryOf, check_match, is_known, page_cursor, page_length, untold};
use crate::http::range;
use crate::http::state::{AppState, Shared};
use crate::jobs::record::Output;
use crate::openapi::Model;
use crate::problem::{Problem, ProblemKind};
use crate::store::{File, ModelView};

/// The media type of model documents.
pub(super) const MEDIA_TYPE: &str = "application/vnd.lacuna.model+json;v=1";

/// Which page of models.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct ModelQuery {
    /// Items of the page, 1 to 200; 50 when absent.
    #[param(minimum = 1, maximum = 200)]
    limit: Option<usize>,
    /// `next` of the page before.
    cursor: Option<String>,
}

/// A page of models.
#[derive(Debug, Serialize, ToSchema)]
pub struct ModelPage {
    /// The models, sorted by id.
    items: Vec<ModelView>,
    /// The cursor of the next page, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    next: Option<String>,
}

/// Stores a model document in its canonical form, or a mesh file as it is.
///
/// The same shape and name, or the same file, give the same id. A mesh file is received piece by piece, read within
/// limits and examined: `mesh` tells what it holds, and nothing of it is repaired. `model_ref` in a job names either.
#[utoipa::path(
    post, path = "/v1/models", operation_id = "store_model", tag = "models", params(UploadQuery),
    request_body(content((Model = "application/json"), (MeshFile = "model/stl"), (MeshFile = "model/3mf"), (MeshFile = "model/obj"),
        (MeshFile = "model/vrml"), (MeshFile = "application/octet-stream"))),
    responses((status = 201, body = ModelView), (status = 200, body = ModelView, description = "It was stored before"),
        (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn store(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    QueryOf(query): QueryOf<UploadQuery>,
    request: Request,
) -> Result<Response, Problem> {
    let (view, new) = if is_json(request.headers()) {
        let JsonBody(body) = JsonBody::from_request(request, &state).await?;
        let kept = state.beside(Some(owner.clone()), move |state| {
            let model = documents::read_model(&body)?;
            let document = documents::model_document(&model);
            uploads::check_share(state, &owner, Digest::of(document.as_bytes()), document.len() as u64)?;
            let kept = state.store.keep_model(&owner.0, model.name.as_deref(), document.as_bytes());
            kept.map_err(|error| Problem::io("the model could not be stored", &error))
        });
        kept.await?
    } else {
        uploads::receive(&state, owner, query, request).await?
    };
    let status = if new { StatusCode::CREATED } else { StatusCode::OK };
    let headers = [(header::LOCATION, format!("/v1/models/{}", view.id)), (header::ETAG, format!("\"{}\"", view.digest))];
    Ok((status, headers, Json(view)).into_response())
}

/// Lists the caller's models.
#[utoipa::path(
    get, path = "/v1/models", operation_id = "list_models", tag = "models", params(ModelQuery),
    responses((status = 200, body = ModelPage), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn list(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    QueryOf(query): QueryOf<ModelQuery>,
) -> Result<Json<ModelPage>, Problem> {
    let length = page_length(query.limit)?;
    let after = page_cursor(query.cursor, "mdl_")?;
    let asker = owner.clone();
    let list = move |state: &AppState| state.store.list_models(&owner.0).map_err(|error| Problem::io("models", &error));
    let all = state.beside(Some(asker), list).await?;
    let after = after.unwrap_or_default();
    let mut items: Vec<ModelView> = all.into_iter().filter(|view| view.id > after).take(length + 1).collect();
    let more = items.len() > length;
    items.truncate(length);
    let next = more.then(|| items.last().map(|view| view.id.clone())).flatten();
    Ok(Json(ModelPage { items, next }))
}

/// The canonical document of a model, or a mesh file as it was uploaded. `HEAD` gives the headers.
#[utoipa::path(
    get, path = "/v1/models/{id}", operation_id = "fetch_model", tag = "models", params(("id" = String, Path, description = "The model's id")),
    responses((status = 200, description = "The document, or the file with its own media type",
            content((Model = "application/vnd.lacuna.model+json;v=1"), (MeshFile = "model/stl"), (MeshFile = "model/3mf"),
                (MeshFile = "model/obj"), (MeshFile = "model/vrml"), (MeshFile = "application/octet-stream"))),
        (status = 206, description = "A range of a mesh file"), (status = 304),
        (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn fetch(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let found = state.beside(Some(owner.clone()), move |state| {
        let failed = |error| Problem::io("the model could not be read", &error);
        let view = state.store.model(&owner.0, &id).map_err(failed)?.ok_or_else(|| absent(&id))?;
        let document = state.store.model_document(&owner.0, &id).map_err(failed)?;
        if document.is_none() && view.mesh.is_none() { Err(absent(&id)) } else { Ok((view, document)) }
    });
    let (view, document) = found.await?;
    let Some(document) = document else {
        return range::answer(&headers, &state.store, File::Upload(view.digest), &file_of(&view)).await;
    };
    let etag = format!("\"{}\"", view.digest);
    check_match(&headers, &etag)?;
    let shared = [(header::ETAG, etag.clone()), (header::CACHE_CONTROL, "private, no-cache".to_owned())];
    if is_known(&headers, &etag) {
        return Ok((StatusCode::NOT_MODIFIED, shared, untold()).into_response());
    }
    Ok((shared, [(header::CONTENT_TYPE, MEDIA_TYPE)], document).into_response())
}

/// Forgets a model, with `If-Match` only if it has that tag. Jobs that used it keep what they made.
#[utoipa::path(
    delete, path = "/v1/models/{id}", operation_id = "forget_model", tag = "models", params(("id" = String, Path, description = "The model's id")),
    responses((status = 204), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn forget(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<StatusCode, Problem> {
    let forgotten = state.beside(Some(owner.clone()), move |state| {
        let failed = |error| Problem::io("the model could not be read", &error);
        let view = state.store.model(&owner.0, &id).map_err(failed)?.ok_or_else(|| absent(&id))?;
        check_match(&headers, &format!("\"{}\"", view.digest))?;
        let known = state.store.forget_model(&owner.0, &id).map_err(|error| Problem::io("the model could not be forgotten", &error))?;
        if known { Ok(StatusCode::NO_CONTENT) } else { Err(absent(&id)) }
    });
    forgotten.await
}

/// An uploaded mesh file as something to hand out.
fn file_of(view: &ModelView) -> Output {
    let facts = view.mesh.as_ref().and_then(|mesh| Format::from_name(&mesh.format)).unwrap_or(Format::Stl).facts();
    let stem = files::safe_stem(view.name.as_deref().unwrap_or("mesh"));
    let (name, file_name) = (facts.ending.to_owned(), format!("{stem}.{}", facts.ending));
    Output { name, file_name, media_type: facts.media_type.to_owned(), bytes: view.bytes, digest: view.digest }
}

fn absent(id: &str) -> Problem {
    Problem::new(ProblemKind::NotFound, format!("no model is stored as {:?}", id.chars().take(80).collect::<String>()))
}
