//! Stored models.

use axum::Json;
use axum::extract::{Extension, Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use crate::documents;
use crate::http::auth::Owner;
use crate::http::body::JsonBody;
use crate::http::headers::{QueryOf, is_known, page_length};
use crate::http::state::Shared;
use crate::openapi::Model;
use crate::problem::{Problem, ProblemKind};
use crate::store::ModelView;

/// The media type of model documents.
pub(super) const MEDIA_TYPE: &str = "application/vnd.lacuna.model+json;v=1";

/// Which page of models.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct ModelQuery {
    /// Items of the page, 1 to 200; 50 when absent.
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

/// Stores a model in its canonical form. The same shape and name give the same id.
#[utoipa::path(
    post, path = "/v1/models", tag = "models", request_body = Model,
    responses((status = 201, body = ModelView), (status = 200, body = ModelView, description = "It was stored before"),
        (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn store(State(state): State<Shared>, Extension(owner): Extension<Owner>, JsonBody(body): JsonBody) -> Result<Response, Problem> {
    let kept = state.beside(move |state| {
        let model = documents::read_model(&body)?;
        let document = documents::model_document(&model);
        let kept = state.store.keep_model(&owner.0, model.name.as_deref(), document.as_bytes());
        kept.map_err(|error| Problem::io("the model could not be stored", &error))
    });
    let (view, new) = kept.await?;
    let status = if new { StatusCode::CREATED } else { StatusCode::OK };
    let headers = [(header::LOCATION, format!("/v1/models/{}", view.id)), (header::ETAG, format!("\"{}\"", view.digest))];
    Ok((status, headers, Json(view)).into_response())
}

/// Lists the caller's models.
#[utoipa::path(
    get, path = "/v1/models", tag = "models", params(ModelQuery),
    responses((status = 200, body = ModelPage), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn list(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    QueryOf(query): QueryOf<ModelQuery>,
) -> Result<Json<ModelPage>, Problem> {
    let length = page_length(query.limit)?;
    let list = move |state: &crate::http::state::AppState| state.store.list_models(&owner.0).map_err(|error| Problem::io("models", &error));
    let all = state.beside(list).await?;
    let after = query.cursor.unwrap_or_default();
    let mut items: Vec<ModelView> = all.into_iter().filter(|view| view.id > after).take(length + 1).collect();
    let more = items.len() > length;
    items.truncate(length);
    let next = more.then(|| items.last().map(|view| view.id.clone())).flatten();
    Ok(Json(ModelPage { items, next }))
}

/// The canonical document of a model. `HEAD` gives its headers.
#[utoipa::path(
    get, path = "/v1/models/{id}", tag = "models", params(("id" = String, Path, description = "The model's id")),
    responses((status = 200, body = Model, content_type = "application/vnd.lacuna.model+json;v=1"), (status = 304),
        (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn fetch(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let found = state.beside(move |state| {
        let failed = |error| Problem::io("the model could not be read", &error);
        let view = state.store.model(&owner.0, &id).map_err(failed)?;
        let document = state.store.model_document(&owner.0, &id).map_err(failed)?;
        view.zip(document).ok_or_else(|| absent(&id))
    });
    let (view, document) = found.await?;
    let etag = format!("\"{}\"", view.digest);
    let shared = [(header::ETAG, etag.clone()), (header::CACHE_CONTROL, "private, no-cache".to_owned())];
    if is_known(&headers, &etag) {
        return Ok((StatusCode::NOT_MODIFIED, shared).into_response());
    }
    Ok((shared, [(header::CONTENT_TYPE, MEDIA_TYPE)], document).into_response())
}

/// Forgets a model. Jobs that used it keep what they made.
#[utoipa::path(
    delete, path = "/v1/models/{id}", tag = "models", params(("id" = String, Path, description = "The model's id")),
    responses((status = 204), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn forget(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    Path(id): Path<String>,
) -> Result<StatusCode, Problem> {
    let forgotten = state.beside(move |state| {
        let known = state.store.forget_model(&owner.0, &id).map_err(|error| Problem::io("the model could not be forgotten", &error))?;
        if known { Ok(StatusCode::NO_CONTENT) } else { Err(absent(&id)) }
    });
    forgotten.await
}

fn absent(id: &str) -> Problem {
    Problem::new(ProblemKind::NotFound, format!("no model is stored as {:?}", id.chars().take(80).collect::<String>()))
}
