//! Under which names a service without keys answers.
//!
//! Without keys it listens on this machine alone, and whoever reaches it is its one user. A page in that user's browser reaches it too, once the
//! name of the page's own server is made to lead here (DNS rebinding): to the browser both are one origin, so nothing keeps the page from reading the
//! answers. What gives it away is the name, which the browser sends as `Host`; so only names that can mean nothing but this machine are
//! answered, and those that the settings list. With keys a page has none to send, and any name will do.
//!
//! A page need not read answers to do harm: a browser lets it send forms anywhere. Then it says in `Origin` whose page it is, and what changes anything is
//! refused to pages that are neither this service's own nor named in the settings.

use std::net::IpAddr;

use axum::extract::{Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, header};
use axum::middleware::Next;
use axum::response::Response;

use super::state::Shared;
use crate::config::Config;
use crate::problem::{Problem, ProblemKind};

/// Lets requests pass that name this service.
///
/// # Errors
/// When the service has no keys: 421 if the request names another host, 403 if a page from elsewhere would change something.
pub async fn require_own_name(State(state): State<Shared>, request: Request, next: Next) -> Result<Response, Problem> {
    // Probes tell nothing of anybody's, and come by whatever name an orchestrator has for the place.
    let probe = matches!(request.uri().path(), "/livez" | "/readyz");
    if state.config.keys.is_empty() && !probe {
        // Both, should a request have both: a browser sends what it means in each. One without any is no browser's.
        let fields = request.headers().get_all(header::HOST).iter().map(|value| String::from_utf8_lossy(value.as_bytes()).into_owned());
        let target = request.uri().authority().map(|authority| authority.as_str().to_owned());
        if let Some(other) = fields.chain(target).find(|host| !is_own(&state.config, host)) {
            return Err(misdirected(&state.config, &other));
        }
        if !request.method().is_safe()
            && let Some(origin) = foreign_origin(&state.config, request.headers())
        {
            return Err(foreign(&origin));
        }
    }
    Ok(next.run(request).await)
}

/// Whether a host, with a port or without one, is this machine or a name of the settings.
fn is_own(config: &Config, host: &str) -> bool {
    let Some(authority) = host.parse::<Authority>().ok().filter(|_| !host.contains('@')) else { return false };
    let name = authority.host().trim_end_matches('.').to_ascii_lowercase();
    let address = name.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>().ok();
    let of_machine = address.is_some_and(|address| address.is_loopback() || address == config.bind.ip());
    // Names below localhost lead to this machine alone (RFC 6761, 6.3).
    of_machine || name == "localhost" || name.ends_with(".localhost") || config.host_names.contains(&name)
}

/// The origin of the page that a request comes from, if it is neither the service's own nor one of the settings.
fn foreign_origin(config: &Config, headers: &HeaderMap) -> Option<String> {
    let host = headers.get(header::HOST).map(|host| host.as_bytes().to_ascii_lowercase());
    let own = |origin: &str| {
        let authority = origin.split_once("://").map(|(_, authority)| authority.to_ascii_lowercase().into_bytes());
        // Whatever the scheme: a proxy may have taken TLS off.
        authority.is_some() && authority == host || config.cors_origins.iter().any(|listed| listed == origin)
    };
    let origins = headers.get_all(header::ORIGIN).iter().map(|origin| String::from_utf8_lossy(origin.as_bytes()).into_owned());
    origins.into_iter().find(|origin| !own(origin))
}

fn foreign(origin: &str) -> Problem {
    let given: String = origin.chars().take(80).collect();
    let detail = format!(
        "The request comes from a page of {given:?}; without keys this service lets only its own pages change anything: list the origin in \
         LACUNA_CORS_ORIGINS, or set LACUNA_API_KEYS"
    );
    Problem::new(ProblemKind::Forbidden, detail).code("foreign-origin")
}

fn misdirected(config: &Config, host: &str) -> Problem {
    let given: String = host.chars().take(80).collect();
    let listed: String = config.host_names.iter().map(|name| format!(", {name}")).collect();
    let detail = format!(
        "The request is for the host {given:?}; without keys this service answers as localhost, names that end in .localhost, loopback addresses{listed}: \
         call it by one of them, list the name in LACUNA_HOST_NAMES (--host-names), or set LACUNA_API_KEYS"
    );
    Problem::new(ProblemKind::Misdirected, detail)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::config::Flags;

    #[test]
    fn pages_of_others_are_known_by_their_origin() {
        let listed = |name: &str| (name == "LACUNA_CORS_ORIGINS").then(|| "https://cad.example".to_owned());
        let (config, _) = Config::read(&Flags::default(), &listed).unwrap();
        let foreign = |host: &str, origin: Option<&str>| {
            let mut headers = HeaderMap::new();
            headers.insert(header::HOST, host.parse().unwrap());
            origin.map(|origin| headers.insert(header::ORIGIN, origin.parse().unwrap()));
            foreign_origin(&config, &headers)
        };
        for (host, origin) in [
            ("localhost:7878", None),
            ("localhost:7878", Some("http://localhost:7878")),
            ("LocalHost:7878", Some("http://localhost:7878")),
            ("localhost", Some("https://localhost")),
            ("localhost:7878", Some("https://cad.example")),
        ] {
            assert_eq!(foreign(host, origin), None, "{host} {origin:?}");
        }
        for origin in ["https://evil.example", "http://localhost:3000", "null", "", "https://cad.example.evil.example", "localhost:7878"] {
            assert_eq!(foreign("localhost:7878", Some(origin)).as_deref(), Some(origin));
        }
    }

    #[test]
    fn names_of_this_machine_and_of_the_settings() {
        let flags = Flags { host_names: vec!["CAD.example".into()], bind: Some("127.0.0.1:0".into()), ..Flags::default() };
        let (config, _) = Config::read(&flags, &|_| None).unwrap();
        for host in [
            "localhost",
            "LocalHost:80",
            "localhost.",
            "a.localhost:7878",
            "127.0.0.1",
            "127.9.8.7:1",
            "[::1]",
            "[::1]:7878",
            "cad.example",
            "Cad.Example:443",
            "cad.example.",
        ] {
            assert!(is_own(&config, host), "{host}");
        }
        for host in [
            "",
            "evil.example",
            "localhost.evil.example",
            "notlocalhost",
            "127.0.0.1.evil.example",
            "localhost@evil.example",
            "evil.example@localhost",
            "0.0.0.0:7878",
            "128.0.0.1",
            "[::2]",
            "a.cad.example",
            "127.1",
            "localhost:x y",
        ] {
            assert!(!is_own(&config, host), "{host}");
        }
    }
}
