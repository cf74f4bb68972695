//! Materials and processes as data.

use axum::Json;
use axum::extract::Path;

use crate::problem::Problem;
use crate::trades::{self, MaterialPage, Profile, ProfilePage};

/// Lists materials with their densities.
#[utoipa::path(
    get, path = "/v1/materials", operation_id = "list_materials", tag = "trades",
    responses((status = 200, body = MaterialPage), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn materials() -> Json<MaterialPage> {
    Json(trades::materials())
}

/// Lists the profiles of processes.
#[utoipa::path(
    get, path = "/v1/profiles", operation_id = "list_profiles", tag = "trades",
    responses((status = 200, body = ProfilePage), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn profiles() -> Json<ProfilePage> {
    Json(trades::profiles())
}

/// The numbers of a process: default, range, unit and source of each.
#[utoipa::path(
    get, path = "/v1/profiles/{process}", operation_id = "show_profile", tag = "trades",
    params(("process" = String, Path, description = "`sla`, `cast` or `panels`")),
    responses((status = 200, body = Profile), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn profile(Path(process): Path<String>) -> Result<Json<Profile>, Problem> {
    trades::profile(&process).map(|profile| Json(*profile))
}
