//! Headers and queries with a meaning of their own: `Prefer`, `Idempotency-Key`, `If-None-Match`, pages.

use std::convert::Infallible;
use std::time::Duration;

use axum::body::{Body, Bytes};
use axum::extract::{FromRequestParts, Query};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName, header};
use serde::de::DeserializeOwned;

use crate::digest::Digest;
use crate::problem::{Problem, ProblemKind};

/// The longest time that an answer waits for its job: below what proxies allow.
pub const LONGEST_WAIT: Duration = Duration::from_secs(30);

/// What `Prefer` (RFC 7240) asks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Preference {
    /// How long the answer may wait for the job to end.
    pub wait: Option<Duration>,
    /// Whether an answer before the end is welcome.
    pub respond_async: bool,
}

impl Preference {
    /// Reads the header; what is not known in it is passed over, as RFC 7240 asks.
    #[must_use]
    pub fn of(headers: &HeaderMap) -> Self {
        let mut preference = Self::default();
        let values = headers.get_all("prefer").iter().filter_map(|value| value.to_str().ok());
        for item in values.flat_map(|value| value.split(',')) {
            let mut halves = item.split(';').next().unwrap_or_default().splitn(2, '=').map(str::trim);
            match (halves.next().map(str::to_ascii_lowercase).as_deref(), halves.next()) {
                (Some("respond-async"), _) => preference.respond_async = true,
                (Some("wait"), Some(seconds)) => {
                    let wait = seconds.trim_matches('"').parse().map(Duration::from_secs).ok();
                    preference.wait = preference.wait.or(wait.map(|wait| wait.min(LONGEST_WAIT)));
                }
                _ => {}
            }
        }
        preference
    }

    /// The value of `Preference-Applied`, if anything was applied.
    #[must_use]
    pub fn applied(&self, ended: bool) -> Option<String> {
        let wait = self.wait.map(|wait| format!("wait={}", wait.as_secs()));
        let respond_async = (self.respond_async && !ended).then(|| "respond-async".to_owned());
        let applied: Vec<String> = respond_async.into_iter().chain(wait).collect();
        (!applied.is_empty()).then(|| applied.join(", "))
    }
}

/// The digest of the `Idempotency-Key`, if there is one.
///
/// # Errors
/// When the key is empty or longer than 255 characters, or there are several.
pub fn idempotency_key(headers: &HeaderMap) -> Result<Option<Digest>, Problem> {
    let refused = |detail: String| Err(Problem::new(ProblemKind::BadRequest, detail).code("bad-header"));
    let mut values = headers.get_all("idempotency-key").iter();
    let Some(value) = values.next() else { return Ok(None) };
    let more = values.count();
    if more > 0 {
        // Which one a proxy or a retry keeps is nobody's guess.
        return refused(format!("there are {} headers Idempotency-Key; send one", more + 1));
    }
    if value.is_empty() || value.len() > 255 {
        return refused(format!("the Idempotency-Key has {} characters; it has 1 to 255", value.len()));
    }
    Ok(Some(Digest::of(value.as_bytes())))
}

/// No body, and nothing about its length: the length of what is not sent is not 0, and an empty body of known length would be announced so to a `HEAD`.
pub fn untold() -> Body {
    Body::from_stream(futures_util::stream::empty::<Result<Bytes, Infallible>>())
}

/// Whether the client has this already (`If-None-Match`).
#[must_use]
pub fn is_known(headers: &HeaderMap, etag: &str) -> bool {
    let values = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    values.flat_map(|value| value.split(',')).map(str::trim).any(|tag| tag == "*" || tag.trim_start_matches("W/") == etag)
}

/// Holds what is there against `If-Match`: with another tag than those that are named, nothing is done.
///
/// # Errors
/// 412 when it is none of them.
pub fn check_match(headers: &HeaderMap, etag: &str) -> Result<(), Problem> {
    let mut values = headers.get_all(header::IF_MATCH).iter().peekable();
    let unconditional = values.peek().is_none();
    // Strong comparison: a weak tag matches nothing (RFC 9110, 13.1.1).
    let matches = values.filter_map(|value| value.to_str().ok()).flat_map(|value| value.split(',')).map(str::trim);
    if unconditional || matches.into_iter().any(|tag| tag == "*" || tag == etag) {
        return Ok(());
    }
    let detail = format!("If-Match names another version; what is here has the tag {etag}: leave If-Match out, or send that tag");
    Err(Problem::new(ProblemKind::PreconditionFailed, detail))
}

/// `Preference-Applied`.
pub const PREFERENCE_APPLIED: HeaderName = HeaderName::from_static("preference-applied");

/// A query, with our problem when it cannot be read.
#[derive(Debug)]
pub struct QueryOf<T>(pub T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for QueryOf<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _state: &S) -> Result<Self, Problem> {
        let query = Query::<T>::try_from_uri(&parts.uri);
        query.map(|Query(value)| Self(value)).map_err(|error| {
            let source = std::error::Error::source(&error).map_or_else(|| error.to_string(), ToString::to_string);
            let given: String = parts.uri.query().unwrap_or_default().chars().take(200).collect();
            Problem::new(ProblemKind::BadRequest, format!("the query {given:?} cannot be read: {source}"))
        })
    }
}

/// How many items a page has.
///
/// # Errors
/// When more than 200 or none are asked.
pub fn page_length(limit: Option<usize>) -> Result<usize, Problem> {
    match limit.unwrap_or(50) {
        limit @ 1..=200 => Ok(limit),
        limit => Err(Problem::new(ProblemKind::BadRequest, format!("limit is {limit}; a page has 1 to 200 items"))),
    }
}

/// Where a page begins: behind an item that may be gone by now, so only its form can be held against what we make.
///
/// # Errors
/// When it is nothing that a page has told.
pub fn page_cursor(cursor: Option<String>, prefix: &str) -> Result<Option<String>, Problem> {
    let ours = |cursor: &String| {
        let id = cursor.strip_prefix(prefix).unwrap_or_default();
        id.len() == 32 && id.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
    };
    match cursor {
        Some(cursor) if !ours(&cursor) => {
            let given: String = cursor.chars().take(80).collect();
            let detail = format!("the cursor is {given:?}; it is what \"next\" of the page before says, or left out for the first page");
            Err(Problem::new(ProblemKind::BadRequest, detail).code("bad-cursor"))
        }
        cursor => Ok(cursor),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn headers(name: &'static str, values: &[&str]) -> HeaderMap {
        let mut headers = HeaderMap::new();
        for value in values {
            headers.append(name, value.parse().unwrap());
        }
        headers
    }

    #[test]
    fn preferences_as_clients_write_them() {
        let of = |values: &[&str]| Preference::of(&headers("prefer", values));
        assert_eq!(of(&["wait=10"]).wait, Some(Duration::from_secs(10)));
        assert_eq!(of(&["respond-async, wait=100"]).wait, Some(LONGEST_WAIT));
        assert_eq!(of(&["Wait=\"5\"; x=y", "respond-async"]), Preference { wait: Some(Duration::from_secs(5)), respond_async: true });
        assert_eq!(of(&["wait=soon", "handling=strict"]), Preference::default());
        assert_eq!(of(&["respond-async,wait=3"]).applied(false).unwrap(), "respond-async, wait=3");
        assert_eq!(of(&["respond-async"]).applied(true), None);
    }

    #[test]
    fn tags_match_in_lists_and_weakly() {
        let known = |value: &str| is_known(&headers("if-none-match", &[value]), "\"a\"");
        assert!(known("\"a\"") && known("\"b\", W/\"a\"") && known("*"));
        assert!(!known("\"b\"") && !known("a"));
    }

    #[test]
    fn what_is_meant_by_its_tag_is_that_or_refused() {
        let passes = |values: &[&str]| check_match(&headers("if-match", values), "\"a\"").is_ok();
        assert!(passes(&[]) && passes(&["*"]) && passes(&["\"b\", \"a\""]) && passes(&["\"b\"", "\"a\""]));
        assert!(!passes(&["\"b\""]) && !passes(&["W/\"a\""]) && !passes(&[""]));
    }

    #[test]
    fn cursors_are_those_of_pages() {
        let id = format!("job_{}", "0a".repeat(16));
        assert_eq!(page_cursor(Some(id.clone()), "job_").unwrap(), Some(id.clone()));
        assert_eq!(page_cursor(None, "job_").unwrap(), None);
        for other in ["", "job_", "../../x", &id.to_uppercase(), &format!("{id}0"), &id.replace("job", "mdl")] {
            assert_eq!(page_cursor(Some(other.to_owned()), "job_").unwrap_err().code, "bad-cursor", "{other}");
        }
    }

    #[test]
    fn keys_have_a_length() {
        assert!(idempotency_key(&HeaderMap::new()).unwrap().is_none());
        assert!(idempotency_key(&headers("idempotency-key", &[&"k".repeat(256)])).is_err());
        assert!(idempotency_key(&headers("idempotency-key", &["k"])).unwrap().is_some());
        assert!(idempotency_key(&headers("idempotency-key", &["k", "k"])).is_err());
    }
}
