//! Who calls, and how often.

use std::collections::HashMap;
use std::sync::Mutex;
use std::time::Instant;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, Method, header};
use axum::middleware::Next;
use axum::response::Response;

use super::state::Shared;
use crate::config::Config;
use crate::digest::Digest;
use crate::problem::{Problem, ProblemKind};

/// Whose request it is: part of a key's digest, or everybody on this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Owner(pub String);

/// Lets requests with a known key pass and tells the handlers whose they are.
///
/// # Errors
/// 401 without a known key, 429 above the rate.
pub async fn require_key(State(state): State<Shared>, mut request: Request, next: Next) -> Result<Response, Problem> {
    let owner = identify(&state.config, request.headers())?;
    if request.method() == Method::POST {
        state.limiter.admit(&owner)?;
    }
    request.extensions_mut().insert(owner);
    Ok(next.run(request).await)
}

fn identify(config: &Config, headers: &HeaderMap) -> Result<Owner, Problem> {
    if config.keys.is_empty() {
        return Ok(Owner("local".to_owned()));
    }
    let given = headers.get(header::AUTHORIZATION).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let (scheme, key) = given.split_once(' ').unwrap_or_default();
    let digest = Digest::of(key.trim().as_bytes());
    // All keys are compared, so that the time does not tell which one came close.
    let known = config.keys.iter().fold(false, |known, key| key.same_in_constant_time(&digest) | known);
    if known && scheme.eq_ignore_ascii_case("bearer") {
        return Ok(Owner(digest.hex()[..32].to_owned()));
    }
    Err(Problem::new(ProblemKind::Unauthenticated, "Send a key of this service: Authorization: Bearer KEY"))
}

/// A bucket of tokens per owner, filled evenly through the minute.
#[derive(Debug)]
pub struct RateLimiter {
    per_minute: f64,
    buckets: Mutex<HashMap<String, (f64, Instant)>>,
}

impl RateLimiter {
    /// So many calls per minute and owner.
    #[must_use]
    pub fn new(per_minute: u32) -> Self {
        Self { per_minute: f64::from(per_minute), buckets: Mutex::default() }
    }

    fn admit(&self, owner: &Owner) -> Result<(), Problem> {
        let now = Instant::now();
        let mut buckets = crate::locked(&self.buckets);
        let (tokens, last) = buckets.entry(owner.0.clone()).or_insert((self.per_minute, now));
        let filled = *tokens + now.duration_since(*last).as_secs_f64() * self.per_minute / 60.0;
        (*tokens, *last) = (filled.min(self.per_minute), now);
        if *tokens < 1.0 {
            let detail = format!("{} submissions per minute are allowed", self.per_minute);
            // A token comes back after 60 / rate seconds, which is under a second for any rate above 60.
            return Err(Problem::new(ProblemKind::RateLimited, detail).retry_after(1 + u64::from(self.per_minute < 60.0) * 59));
        }
        *tokens -= 1.0;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::config::Flags;

    #[test]
    fn only_known_bearers_pass() {
        let keys = |name: &str| (name == "LACUNA_API_KEYS").then(|| "first,second".to_owned());
        let (config, _) = Config::read(&Flags::default(), &keys).unwrap();
        let with = |value: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(header::AUTHORIZATION, value.parse().unwrap());
            identify(&config, &headers)
        };
        let (first, second) = (with("Bearer first").unwrap(), with("bearer second").unwrap());
        assert_ne!(first, second);
        for bad in ["Bearer third", "Basic first", "Bearer", ""] {
            assert_eq!(with(bad).unwrap_err().kind, ProblemKind::Unauthenticated, "{bad}");
        }
        assert!(identify(&config, &HeaderMap::new()).is_err());
    }

    #[test]
    fn a_bucket_runs_dry_for_its_owner_alone() {
        let limiter = RateLimiter::new(2);
        let (ada, bob) = (Owner("ada".into()), Owner("bob".into()));
        assert!(limiter.admit(&ada).is_ok() && limiter.admit(&ada).is_ok());
        assert_eq!(limiter.admit(&ada).unwrap_err().kind, ProblemKind::RateLimited);
        assert!(limiter.admit(&bob).is_ok());
    }
}
