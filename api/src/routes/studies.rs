//! What can be said of a model or a job without doing it.

use axum::extract::{Extension, State};
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use lacuna_fabrication::Plan;

use crate::addresses::AddressAnswer;
use crate::documents::{SolveReport, ValidationReport};
use crate::http::accept::Accept;
use crate::http::auth::Owner;
use crate::http::body::JsonBody;
use crate::http::state::{Leaving, Shared};
use crate::openapi::{AddressQuestion, Job, Model, SolveRequest};
use crate::problem::{Problem, ProblemKind};
use crate::questions::Question;

/// The answer to a question, as it was written.
async fn json(state: &Shared, owner: Owner, question: Question, body: JsonBody) -> Result<Response, Problem> {
    let (_leaving, cancel) = Leaving::new();
    let answer = state.beside(Some(owner.clone()), move |state| state.ask(&owner, question, &body.0, &cancel)).await?;
    Ok(([(header::CONTENT_TYPE, "application/json")], answer).into_response())
}

/// Says what is wrong with a model.
///
/// 200 for every JSON text: `valid` and `diagnostics` tell.
#[utoipa::path(
    post, path = "/v1/validate", tag = "studies", request_body = Model,
    responses((status = 200, body = ValidationReport), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn validate(State(state): State<Shared>, Extension(owner): Extension<Owner>, body: JsonBody) -> Result<Response, Problem> {
    json(&state, owner, Question::Validate, body).await
}

const SVG: &str = "image/svg+xml";
const DOT: &str = "text/vnd.graphviz";

/// Draws the automaton of a model: states as nodes, transitions and boundaries as two kinds of arrows.
///
/// An SVG picture, or DOT text when `Accept` prefers `text/vnd.graphviz`; 406 when it refuses both. A model that is a legal document is drawn
/// even if it cannot be evaluated, with what is wrong in red.
#[utoipa::path(
    post, path = "/v1/automaton", tag = "studies", request_body = Model,
    responses((status = 200, description = "The drawing", content((String = "image/svg+xml"), (String = "text/vnd.graphviz"))),
        (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn automaton(
    State(state): State<Shared>,
    Extension(owner): Extension<Owner>,
    headers: HeaderMap,
    JsonBody(body): JsonBody,
) -> Result<Response, Problem> {
    let there = [SVG, DOT];
    let media_type = Accept::of(&headers)?.preferred(there, |name| name).ok_or_else(|| {
        let detail = format!("a drawing is {}, and Accept refuses both", there.join(" or "));
        Problem::new(ProblemKind::NotAcceptable, detail)
    })?;
    let dot = media_type == DOT;
    let (_leaving, cancel) = Leaving::new();
    let drawn = state.beside(Some(owner.clone()), move |state| state.ask(&owner, Question::Draw { dot }, &body, &cancel));
    let media_type = if dot { format!("{DOT}; charset=utf-8") } else { SVG.to_owned() };
    // The picture needs nothing from anywhere, whatever a browser is told to do with it.
    let policy = (header::CONTENT_SECURITY_POLICY, "default-src 'none'; style-src 'unsafe-inline'".to_owned());
    Ok(([(header::CONTENT_TYPE, media_type), (header::VARY, "Accept".to_owned()), policy], drawn.await?).into_response())
}

/// Tells where an address leads, or which addresses lead near a point.
#[utoipa::path(
    post, path = "/v1/address", operation_id = "locate", tag = "studies", request_body = AddressQuestion,
    responses((status = 200, body = AddressAnswer), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn address(State(state): State<Shared>, Extension(owner): Extension<Owner>, body: JsonBody) -> Result<Response, Problem> {
    json(&state, owner, Question::Address, body).await
}

/// Predicts what a job costs, without doing it.
///
/// A job that would pass a limit is refused with the limit and a value that passes.
#[utoipa::path(
    post, path = "/v1/plan", tag = "studies", request_body = Job,
    responses((status = 200, body = Plan), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn plan(State(state): State<Shared>, Extension(owner): Extension<Owner>, body: JsonBody) -> Result<Response, Problem> {
    json(&state, owner, Question::Plan, body).await
}

/// Solves the unknown entries of a model.
///
/// 200 with all solutions, and the model for the chosen values in `model`. Constraints that contradict each other are
/// refused with 422: `errors` are the fewest of them that already do.
#[utoipa::path(
    post, path = "/v1/solve", tag = "studies", request_body = SolveRequest,
    responses((status = 200, body = SolveReport), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn solve(State(state): State<Shared>, Extension(owner): Extension<Owner>, body: JsonBody) -> Result<Response, Problem> {
    json(&state, owner, Question::Solve, body).await
}
