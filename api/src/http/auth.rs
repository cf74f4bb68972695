//! Who calls, and how often.

use std::collections::HashMap;
use std::sync::Mutex;
use std::time::Instant;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use lacuna_kernel::error::LimitFacts;

use super::state::Shared;
use crate::config::Config;
use crate::config_file::Scope;
use crate::digest::Digest;
use crate::problem::{Problem, ProblemKind};

/// What may be called how often.
pub const RATE_LIMIT_POLICY: HeaderName = HeaderName::from_static("ratelimit-policy");
/// What is left of it.
pub const RATE_LIMIT: HeaderName = HeaderName::from_static("ratelimit");

/// Whose request it is: part of a key's digest, or everybody on this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Owner(pub String);

/// Lets requests with a known key pass and tells the handlers whose they are.
///
/// # Errors
/// 401 without a known key, 403 if it may not, 429 above the rate.
pub async fn require_key(State(state): State<Shared>, mut request: Request, next: Next) -> Result<Response, Problem> {
    let (owner, scope) = identify(&state.config, request.headers())?;
    let needed = match *request.method() {
        _ if request.uri().path() == "/metrics" => Scope::Admin,
        Method::GET | Method::HEAD => Scope::Read,
        _ => Scope::Run,
    };
    if scope < needed {
        let detail = format!("This key has the scope {scope:?}, and {needed:?} is needed; ask whoever gave it to you").to_lowercase();
        return Err(Problem::new(ProblemKind::Forbidden, detail));
    }
    // Without keys everybody is one, and whoever polls would take it from the others: then only submissions are counted.
    let limiter = match *request.method() {
        Method::POST => Some(&state.submissions),
        _ if state.config.keys.is_empty() => None,
        _ => Some(&state.calls),
    };
    let mut response = match limiter.map(|limiter| limiter.draw(&owner, 1)) {
        Some(Err(problem)) => problem.into_response(),
        _ => {
            request.extensions_mut().insert(owner.clone());
            next.run(request).await
        }
    };
    if let Some(limiter) = limiter {
        // Only now: a request may have counted as several.
        limiter.tell(limiter.left(&owner), response.headers_mut());
    }
    Ok(response)
}

fn identify(config: &Config, headers: &HeaderMap) -> Result<(Owner, Scope), Problem> {
    if config.keys.is_empty() {
        return Ok((Owner("local".to_owned()), Scope::Admin));
    }
    let given = headers.get(header::AUTHORIZATION).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let (scheme, key) = given.split_once(' ').unwrap_or_default();
    let digest = Digest::of(key.trim().as_bytes());
    // All keys are compared, so that the time does not tell which one came close.
    let known = config.keys.iter().fold(None, |known, key| if key.digest.same_in_constant_time(&digest) { Some(key.scope) } else { known });
    if let Some(scope) = known.filter(|_| scheme.eq_ignore_ascii_case("bearer")) {
        return Ok((Owner(digest.hex()[..32].to_owned()), scope));
    }
    Err(Problem::new(ProblemKind::Unauthenticated, "Send a key of this service: Authorization: Bearer KEY"))
}

/// What an owner has left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Left {
    /// Calls that would pass now.
    calls: u64,
    /// Seconds after which there is one more.
    seconds: u64,
}

/// A bucket of tokens per owner, filled evenly through the minute.
#[derive(Debug)]
pub struct RateLimiter {
    name: &'static str,
    per_minute: f64,
    buckets: Mutex<HashMap<String, (f64, Instant)>>,
}

impl RateLimiter {
    /// So many calls per minute and owner, under a name that answers tell.
    #[must_use]
    pub fn new(name: &'static str, per_minute: u32) -> Self {
        Self { name, per_minute: f64::from(per_minute), buckets: Mutex::default() }
    }

    /// The policy and what is left of it, as the draft of the header fields `RateLimit` has them.
    fn tell(&self, left: Left, headers: &mut HeaderMap) {
        let policy = format!("\"{}\";q={};w=60", self.name, self.per_minute);
        let state = format!("\"{}\";r={};t={}", self.name, left.calls, left.seconds);
        for (name, value) in [(RATE_LIMIT_POLICY, policy), (RATE_LIMIT, state)] {
            if let Ok(value) = HeaderValue::from_str(&value) {
                headers.insert(name, value);
            }
        }
    }

    /// Counts so many calls of an owner, or none of them.
    ///
    /// # Errors
    /// When there are not so many left; with the seconds after which there will be, if there ever are.
    pub fn draw(&self, owner: &Owner, calls: usize) -> Result<(), Problem> {
        #[expect(clippy::cast_precision_loss, reason = "no request has so many")]
        let calls = calls as f64;
        let tokens = self.with_tokens(owner, |tokens| {
            let there = *tokens;
            if there >= calls {
                *tokens -= calls;
            }
            there
        });
        if tokens >= calls {
            return Ok(());
        }
        let Self { name, per_minute: allowed, .. } = *self;
        let facts = LimitFacts { limit: "per_minute", asked: calls.max(allowed + 1.0), allowed, remedy: None };
        let problem = |more: String| {
            Problem::new(ProblemKind::RateLimited, format!("{allowed} {name} per minute are allowed for a key{more}")).limit(&facts)
        };
        Err(match calls {
            1.0 => problem(String::new()).retry_after(seconds(calls - tokens, allowed)),
            // Its first job was counted before.
            _ if calls + 1.0 > allowed => problem(format!(", and the batch counts as {}; send smaller ones", calls + 1.0)),
            _ => problem(format!(", and {} are left for the batch", whole(tokens) + 1)).retry_after(seconds(calls - tokens + 1.0, allowed)),
        })
    }

    fn left(&self, owner: &Owner) -> Left {
        // The share of a token that is missing comes back at the rate.
        self.with_tokens(owner, |tokens| Left { calls: whole(*tokens), seconds: seconds(1.0 - tokens.fract(), self.per_minute) })
    }

    /// Looks at an owner's tokens as they are now.
    fn with_tokens<T>(&self, owner: &Owner, look: impl FnOnce(&mut f64) -> T) -> T {
        let now = Instant::now();
        let mut buckets = crate::locked(&self.buckets);
        let (tokens, last) = buckets.entry(owner.0.clone()).or_insert((self.per_minute, now));
        let filled = *tokens + now.duration_since(*last).as_secs_f64() * self.per_minute / 60.0;
        (*tokens, *last) = (filled.min(self.per_minute), now);
        look(tokens)
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "tokens are at most the rate")]
fn whole(tokens: f64) -> u64 {
    tokens as u64
}

/// Seconds in which so many tokens come back; a rate of 0 never gives one, and a day says so.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "they are clamped")]
fn seconds(tokens: f64, per_minute: f64) -> u64 {
    (tokens * 60.0 / per_minute).ceil().clamp(1.0, 86_400.0) as u64
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
        let limiter = RateLimiter::new("submissions", 2);
        let (ada, bob) = (Owner("ada".into()), Owner("bob".into()));
        assert!(limiter.draw(&ada, 1).is_ok() && limiter.draw(&ada, 1).is_ok());
        assert_eq!(limiter.draw(&ada, 1).unwrap_err().retry_after, Some(30));
        let left = limiter.left(&ada);
        assert!(left.calls == 0 && (29..=30).contains(&left.seconds), "{left:?}");
        // Several count together, or none of them; more than there ever are never pass.
        assert_eq!(limiter.draw(&bob, 3).unwrap_err().retry_after, None);
        assert!(limiter.draw(&bob, 2).is_ok() && limiter.left(&bob).calls == 0);
        let mut headers = HeaderMap::new();
        limiter.tell(Left { calls: 1, seconds: 30 }, &mut headers);
        assert_eq!(headers[RATE_LIMIT_POLICY], "\"submissions\";q=2;w=60");
        assert_eq!(headers[RATE_LIMIT], "\"submissions\";r=1;t=30");
    }
}
