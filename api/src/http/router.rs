//! The table of contents of the HTTP contract.

use axum::Router;
use axum::middleware::{from_fn, from_fn_with_state};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::state::Shared;
use super::{auth, compression, hosts, layers};
use crate::problem::{Problem, ProblemKind};
use crate::routes::{batches, capabilities, docs, events, health, jobs, library, models, problems, results, shortcuts, studies, trades};

/// Every address with its description; the public ones apart, because the others need a key.
fn tables() -> (OpenApiRouter<Shared>, OpenApiRouter<Shared>) {
    let public = OpenApiRouter::new()
        .routes(routes!(health::livez))
        .routes(routes!(health::readyz))
        .routes(routes!(health::version))
        .routes(routes!(problems::problem))
        .routes(routes!(docs::openapi))
        .routes(routes!(docs::docs));
    let private = OpenApiRouter::new()
        .routes(routes!(models::store, models::list))
        .routes(routes!(models::fetch, models::forget))
        .routes(routes!(library::list))
        .routes(routes!(library::fetch))
        .routes(routes!(studies::validate))
        .routes(routes!(studies::plan))
        .routes(routes!(studies::solve))
        .routes(routes!(studies::automaton))
        .routes(routes!(studies::address))
        .routes(routes!(shortcuts::measure))
        .routes(routes!(shortcuts::evaluate))
        .routes(routes!(jobs::submit, jobs::list))
        .routes(routes!(jobs::show, jobs::forget))
        .routes(routes!(jobs::cancel))
        .routes(routes!(events::events))
        .routes(routes!(batches::submit))
        .routes(routes!(batches::show, batches::forget))
        .routes(routes!(batches::certificate))
        .routes(routes!(batches::cancel))
        .routes(routes!(batches::events))
        .routes(routes!(results::output))
        .routes(routes!(results::result))
        .routes(routes!(trades::materials))
        .routes(routes!(trades::profiles))
        .routes(routes!(trades::profile))
        .routes(routes!(capabilities::capabilities))
        .routes(routes!(health::metrics));
    (public, private)
}

/// The description of every address.
#[must_use]
pub fn description() -> utoipa::openapi::OpenApi {
    let (public, private) = tables();
    let mut all = public.into_openapi();
    all.merge(private.into_openapi());
    all
}

/// The service as a router: addresses and layers over a state.
pub fn router(state: Shared) -> Router {
    let (public, private) = tables();
    layered(state, public, Some(private), true)
}

/// What a worker without a front end answers: how it is.
pub fn probes(state: Shared) -> Router {
    let public = OpenApiRouter::new().routes(routes!(health::livez)).routes(routes!(health::readyz)).routes(routes!(health::version));
    layered(state, public, Some(OpenApiRouter::new().routes(routes!(health::metrics))), true)
}

/// What an address of its own answers to whoever looks after the service, without a key.
pub fn operation(state: Shared) -> Router {
    let public = OpenApiRouter::new()
        .routes(routes!(health::livez))
        .routes(routes!(health::readyz))
        .routes(routes!(health::version))
        .routes(routes!(health::metrics));
    // A collector of metrics comes by whatever name it has for the place, and is told nothing of anybody's.
    layered(state, public, None, false)
}

fn layered(state: Shared, public: OpenApiRouter<Shared>, private: Option<OpenApiRouter<Shared>>, by_name: bool) -> Router {
    let keyed = |private| Router::from(private).route_layer(from_fn_with_state(state.clone(), auth::require_key));
    let all = Router::from(public).merge(private.map(keyed).unwrap_or_default()).fallback(absent).method_not_allowed_fallback(not_allowed);
    let named = if by_name { all.layer(from_fn_with_state(state.clone(), hosts::require_own_name)) } else { all };
    named
        .layer(from_fn_with_state(state.clone(), layers::observe))
        // Around the layer that gives problems their form: they are compressed, too.
        .layer(from_fn(compression::compress))
        .layer(from_fn_with_state(state.clone(), layers::cors))
        .with_state(state)
}

async fn absent() -> Problem {
    Problem::new(ProblemKind::NotFound, "there is nothing at this address; /docs lists what there is")
}

async fn not_allowed() -> Problem {
    Problem::new(ProblemKind::MethodNotAllowed, "the address does not have this method; the header Allow lists those it has")
}
