//! The contract: as JSON and as a page.

use std::sync::OnceLock;

use axum::http::header;
use axum::response::IntoResponse;

use crate::problem::Problem;

/// The OpenAPI description.
#[utoipa::path(
    get, path = "/v1/openapi.json", tag = "operation", security(()),
    responses((status = 200, content_type = "application/json", description = "OpenAPI 3.1"),
        (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn openapi() -> impl IntoResponse {
    static TEXT: OnceLock<String> = OnceLock::new();
    let text = TEXT.get_or_init(crate::openapi::text).as_str();
    ([(header::CONTENT_TYPE, "application/json"), (header::CACHE_CONTROL, "no-cache")], text)
}

/// The description as a page that needs nothing from elsewhere.
#[utoipa::path(
    get, path = "/docs", tag = "operation", security(()),
    responses((status = 200, content_type = "text/html", body = String), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn docs() -> impl IntoResponse {
    const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; connect-src 'self'; base-uri 'none'; form-action 'none'";
    let headers = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    ];
    (headers, include_str!("docs.html"))
}
