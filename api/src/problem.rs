//! What went wrong, for clients: RFC 9457 problems. The only file with HTTP status codes and exit codes.

use std::collections::BTreeMap;
use std::io::ErrorKind;

use axum::body::Body;
use axum::http::{HeaderValue, Response, StatusCode, header};
use axum::response::IntoResponse;
use lacuna_fabrication::{Excess, JobError};
use lacuna_kernel::error::{Kind, LimitFacts};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The kinds of problem, one per `/problems/` address.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
pub enum ProblemKind {
    /// The body is not JSON.
    #[serde(rename = "/problems/malformed-json")]
    MalformedJson,
    /// A header or a query parameter cannot be understood.
    #[serde(rename = "/problems/bad-request")]
    BadRequest,
    /// No key, or one that is not known.
    #[serde(rename = "/problems/unauthenticated")]
    Unauthenticated,
    /// The key is known and may not do this.
    #[serde(rename = "/problems/forbidden")]
    Forbidden,
    /// There is no such thing, or it belongs to another key.
    #[serde(rename = "/problems/not-found")]
    NotFound,
    /// The address does not have this method.
    #[serde(rename = "/problems/method-not-allowed")]
    MethodNotAllowed,
    /// Nothing of what is here is in a media type that the caller accepts.
    #[serde(rename = "/problems/not-acceptable")]
    NotAcceptable,
    /// The request was not finished in time.
    #[serde(rename = "/problems/request-timeout")]
    RequestTimeout,
    /// The idempotency key is in use by a request that has not been answered yet.
    #[serde(rename = "/problems/idempotency-in-progress")]
    IdempotencyInProgress,
    /// The resource's state does not allow the action.
    #[serde(rename = "/problems/state-conflict")]
    StateConflict,
    /// The job that made the result is known, and the result is no longer kept.
    #[serde(rename = "/problems/result-expired")]
    ResultExpired,
    /// The body is longer than is read.
    #[serde(rename = "/problems/body-too-large")]
    BodyTooLarge,
    /// The media type is not read here.
    #[serde(rename = "/problems/unsupported-media")]
    UnsupportedMedia,
    /// The range lies outside of the file.
    #[serde(rename = "/problems/range")]
    Range,
    /// The document is JSON but not a legal model or job, or the kernel refuses the model.
    #[serde(rename = "/problems/invalid-model")]
    InvalidModel,
    /// A mesh file cannot be read.
    #[serde(rename = "/problems/invalid-file")]
    InvalidFile,
    /// The idempotency key was used with another body.
    #[serde(rename = "/problems/idempotency-mismatch")]
    IdempotencyMismatch,
    /// What is here is not what `If-Match` names.
    #[serde(rename = "/problems/precondition-failed")]
    PreconditionFailed,
    /// What was asked cannot be reached.
    #[serde(rename = "/problems/unreachable")]
    Unreachable,
    /// A limit of the caller or of the service would be passed, or was.
    #[serde(rename = "/problems/limit")]
    Limit,
    /// The queue is full.
    #[serde(rename = "/problems/too-many-jobs")]
    TooManyJobs,
    /// More requests per minute than allowed.
    #[serde(rename = "/problems/rate-limited")]
    RateLimited,
    /// The job was stopped by its caller.
    #[serde(rename = "/problems/cancelled")]
    Cancelled,
    /// The service stopped while the job was running, twice.
    #[serde(rename = "/problems/interrupted")]
    Interrupted,
    /// Our bug.
    #[serde(rename = "/problems/internal")]
    Internal,
    /// A file or a device failed.
    #[serde(rename = "/problems/input-output")]
    InputOutput,
    /// What the service needs is away or full for now.
    #[serde(rename = "/problems/unavailable")]
    Unavailable,
    /// The request names a host that this service does not answer for.
    #[serde(rename = "/problems/misdirected")]
    Misdirected,
    /// The service is going down.
    #[serde(rename = "/problems/shutting-down")]
    ShuttingDown,
    /// The service took too long to answer.
    #[serde(rename = "/problems/timeout")]
    Timeout,
    /// The command line is wrong.
    #[serde(rename = "/problems/usage")]
    Usage,
    /// A check or a verification failed.
    #[serde(rename = "/problems/check-failed")]
    CheckFailed,
    /// The service cannot be reached.
    #[serde(rename = "/problems/service-unreachable")]
    ServiceUnreachable,
}

impl ProblemKind {
    /// HTTP status, exit code of the command line, default code and title.
    fn facts(self) -> (u16, u8, &'static str, &'static str) {
        match self {
            Self::MalformedJson => (400, 3, "malformed-json", "The body is not JSON"),
            Self::BadRequest => (400, 2, "bad-request", "A header or parameter cannot be understood"),
            Self::Unauthenticated => (401, 5, "unauthenticated", "A valid key is needed"),
            Self::Forbidden => (403, 5, "forbidden", "The key does not allow this"),
            Self::NotFound => (404, 6, "not-found", "There is no such resource"),
            Self::MethodNotAllowed => (405, 2, "method-not-allowed", "The resource does not have this method"),
            Self::NotAcceptable => (406, 2, "not-acceptable", "It is here in other media types alone"),
            Self::RequestTimeout => (408, 5, "request-timeout", "The request was not finished in time"),
            Self::IdempotencyInProgress => (409, 5, "idempotency-in-progress", "The key's first request is not answered yet"),
            Self::StateConflict => (409, 5, "state-conflict", "The resource's state does not allow this"),
            Self::ResultExpired => (410, 6, "result-expired", "The result is no longer kept"),
            Self::BodyTooLarge => (413, 4, "body-too-large", "The body is too large"),
            Self::UnsupportedMedia => (415, 3, "unsupported-media", "The media type is not read here"),
            Self::Range => (416, 2, "range", "The range lies outside of the file"),
            Self::Misdirected => (421, 5, "misdirected", "The service does not answer for this host"),
            Self::InvalidModel => (422, 3, "invalid-model", "The document is not a legal model or job"),
            Self::InvalidFile => (422, 3, "invalid-file", "The file cannot be read"),
            Self::IdempotencyMismatch => (422, 2, "idempotency-mismatch", "The key was used with another body"),
            Self::PreconditionFailed => (412, 5, "precondition-failed", "What is here is another version"),
            Self::Unreachable => (422, 4, "unreachable", "What was asked cannot be reached"),
            Self::Limit => (422, 4, "limit", "A limit was hit"),
            Self::TooManyJobs => (429, 5, "too-many-jobs", "The queue is full"),
            Self::RateLimited => (429, 5, "rate-limited", "Too many requests"),
            Self::Cancelled => (409, 130, "cancelled", "Stopped by the caller"),
            Self::Interrupted => (503, 5, "interrupted", "The service stopped during the work"),
            Self::Internal => (500, 70, "internal", "A defect of lacuna"),
            Self::InputOutput => (500, 6, "input-output", "A file or device failed"),
            Self::Unavailable => (503, 6, "unavailable", "Something that the service needs is away for now"),
            Self::ShuttingDown => (503, 5, "shutting-down", "The service is going down"),
            Self::Timeout => (504, 5, "timeout", "The answer took too long"),
            Self::Usage => (400, 2, "usage", "The command line is wrong"),
            Self::CheckFailed => (422, 1, "check-failed", "A check failed"),
            Self::ServiceUnreachable => (503, 5, "service-unreachable", "The service cannot be reached"),
        }
    }

    /// All kinds.
    pub const ALL: [Self; 33] = [
        Self::MalformedJson,
        Self::BadRequest,
        Self::Unauthenticated,
        Self::Forbidden,
        Self::NotFound,
        Self::MethodNotAllowed,
        Self::NotAcceptable,
        Self::RequestTimeout,
        Self::IdempotencyInProgress,
        Self::StateConflict,
        Self::ResultExpired,
        Self::BodyTooLarge,
        Self::UnsupportedMedia,
        Self::Range,
        Self::InvalidModel,
        Self::InvalidFile,
        Self::IdempotencyMismatch,
        Self::PreconditionFailed,
        Self::Unreachable,
        Self::Limit,
        Self::TooManyJobs,
        Self::RateLimited,
        Self::Cancelled,
        Self::Interrupted,
        Self::Internal,
        Self::InputOutput,
        Self::Unavailable,
        Self::Misdirected,
        Self::ShuttingDown,
        Self::Timeout,
        Self::Usage,
        Self::CheckFailed,
        Self::ServiceUnreachable,
    ];

    /// The kind whose address ends with a word.
    #[must_use]
    pub fn of_code(code: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.facts().2 == code)
    }

    /// The kind in words.
    #[must_use]
    pub fn title(self) -> &'static str {
        self.facts().3
    }

    /// The exit code of a command that ends with this problem.
    #[must_use]
    pub fn exit_code(self) -> u8 {
        self.facts().1
    }
}

/// One finding with its place.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Finding {
    /// JSON pointer into the request's document.
    pub pointer: String,
    /// Stable code, for example `ifs.not-contractive`.
    pub code: String,
    /// What, in words, with the values.
    pub message: String,
    /// Line of the value in the document, from 1.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub line: Option<u64>,
    /// Column of the value in its line, from 1.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub column: Option<u64>,
}

/// A problem (RFC 9457): the body of every error answer, the `problem` of a failed job, and what
/// `--error-format json` prints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Problem {
    /// Address of the kind of problem.
    #[serde(rename = "type")]
    pub kind: ProblemKind,
    /// The kind in words.
    pub title: String,
    /// The HTTP status.
    pub status: u16,
    /// This occurrence in words.
    pub detail: String,
    /// Stable code, at least as exact as `type`.
    pub code: String,
    /// The request's id, as in the log and in `X-Request-Id`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub request_id: Option<String>,
    /// All findings with their places.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub errors: Vec<Finding>,
    /// Name of the limit that was hit; its ending is the unit.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub limit: Option<String>,
    /// The value that the request needs.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub asked: Option<f64>,
    /// The value that is allowed.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub allowed: Option<f64>,
    /// A parameter and a value of it that would pass.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub remedy: Option<BTreeMap<String, f64>>,
    /// Seconds after which to try again.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub retry_after: Option<u64>,
}

impl Problem {
    /// A problem with the default code of its kind.
    #[must_use]
    pub fn new(kind: ProblemKind, detail: impl Into<String>) -> Self {
        let (status, _, code, title) = kind.facts();
        Self {
            kind,
            title: title.to_owned(),
            status,
            detail: detail.into(),
            code: code.to_owned(),
            request_id: None,
            errors: Vec::new(),
            limit: None,
            asked: None,
            allowed: None,
            remedy: None,
            retry_after: None,
        }
    }

    /// What a library answered in our place, in our form.
    #[must_use]
    pub fn from_status(status: u16) -> Self {
        let kind = match status {
            403 => ProblemKind::Forbidden,
            404 => ProblemKind::NotFound,
            405 => ProblemKind::MethodNotAllowed,
            406 => ProblemKind::NotAcceptable,
            408 => ProblemKind::RequestTimeout,
            413 => ProblemKind::BodyTooLarge,
            415 => ProblemKind::UnsupportedMedia,
            416 => ProblemKind::Range,
            421 => ProblemKind::Misdirected,
            504 => ProblemKind::Timeout,
            400..500 => ProblemKind::BadRequest,
            _ => ProblemKind::Internal,
        };
        Self::new(kind, kind.facts().3)
    }

    /// A failure of a file or of a device; `what` says what was being done, in words for the caller.
    #[must_use]
    pub fn io(what: impl std::fmt::Display, error: &std::io::Error) -> Self {
        let detail = format!("{what}: {error}");
        match error.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
                Self::new(ProblemKind::Unavailable, detail).code("storage-full").retry_after(30)
            }
            ErrorKind::NetworkUnreachable => Self::new(ProblemKind::Unavailable, detail).code("objects-unreachable").retry_after(5),
            _ => Self::new(ProblemKind::InputOutput, detail),
        }
    }

    /// Our own defect. The detail is for the log and for the command line; the service does not send it.
    #[must_use]
    pub fn internal(detail: impl Into<String>) -> Self {
        Self::new(ProblemKind::Internal, detail)
    }

    /// With a more exact code.
    #[must_use]
    pub fn code(mut self, code: impl Into<String>) -> Self {
        self.code = code.into();
        self
    }

    /// With the findings.
    #[must_use]
    pub fn errors(mut self, errors: Vec<Finding>) -> Self {
        self.errors = errors;
        self
    }

    /// With the time after which to try again.
    #[must_use]
    pub fn retry_after(mut self, seconds: u64) -> Self {
        self.retry_after = Some(seconds);
        self
    }

    /// With the facts of a limit.
    #[must_use]
    pub fn limit(mut self, facts: &LimitFacts) -> Self {
        // JSON has no infinity: a value that is none says nothing that a caller could use.
        let finite = |value: &f64| value.is_finite();
        self.limit = Some(facts.limit.to_owned());
        self.asked = Some(facts.asked).filter(finite);
        self.allowed = Some(facts.allowed).filter(finite);
        let remedy = facts.remedy.filter(|(_, value)| value.is_finite());
        self.remedy = remedy.map(|(name, value)| BTreeMap::from([(name.to_owned(), value)]));
        self
    }

    /// As strangers may see it: the cause of a defect is for the log, and they get an id to quote.
    #[must_use]
    pub fn in_public(&self) -> Self {
        let mut shown = self.clone();
        if self.is_defect() {
            "A defect of the service; the id of this request or job finds its cause in the log".clone_into(&mut shown.detail);
        }
        shown
    }

    /// Whether the cause is ours, and nothing that the caller could mend.
    #[must_use]
    pub fn is_defect(&self) -> bool {
        matches!(self.kind, ProblemKind::Internal | ProblemKind::InputOutput)
    }

    /// With the model's place in a document where it stands as the member `model`: what is found in its shape gets it.
    #[must_use]
    pub fn under_model(mut self) -> Self {
        for finding in self.errors.iter_mut().filter(|finding| finding.pointer.starts_with("/shape")) {
            finding.pointer.insert_str(0, "/model");
        }
        self
    }

    /// With the place of the member `model` taken from the front of every pointer: the opposite of [`Problem::under_model`].
    #[must_use]
    pub fn of_model(mut self) -> Self {
        for finding in &mut self.errors {
            if finding.pointer.starts_with("/model/") {
                finding.pointer.replace_range(.."/model".len(), "");
            }
        }
        self
    }

    /// With the place at which the model stands in the caller's document put before every pointer.
    #[must_use]
    pub fn under(mut self, prefix: &str) -> Self {
        for finding in &mut self.errors {
            finding.pointer.insert_str(0, prefix);
        }
        self
    }
}

impl From<Kind> for ProblemKind {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Invalid => Self::InvalidModel,
            Kind::Unreachable => Self::Unreachable,
            Kind::Limit => Self::Limit,
            Kind::Cancelled => Self::Cancelled,
            Kind::Defect => Self::Internal,
        }
    }
}

impl From<JobError> for Problem {
    /// Pointers become relative to the model document, or to the job where it has several.
    fn from(error: JobError) -> Self {
        let model = error.input.map(|index| format!("/inputs/{index}/model")).unwrap_or_default();
        let findings = error.diagnostics.into_iter().map(|d| Finding {
            pointer: format!("{model}/shape{}", d.pointer),
            code: d.code.to_owned(),
            message: d.message,
            line: None,
            column: None,
        });
        let problem = Self::new(error.kind.into(), error.message).code(error.code).errors(findings.collect());
        match &error.limit {
            Some(facts) => problem.limit(facts),
            None => problem,
        }
    }
}

impl From<Excess> for Problem {
    /// A job that its plan refuses.
    fn from(excess: Excess) -> Self {
        let Excess { limit, asked, allowed, remedy } = excess;
        let way_out: Vec<String> = remedy.iter().map(|(name, value)| format!("; {name} = {value} would pass")).collect();
        let detail = format!("The plan asks for about {asked:.0} {limit}, and {allowed:.0} are allowed{}", way_out.concat());
        let problem = Self::new(ProblemKind::Limit, detail).code("plan-exceeds-limit");
        let remedy = Some(remedy).filter(|remedy| !remedy.is_empty());
        Self { limit: Some(limit), asked: Some(asked), allowed: Some(allowed), remedy, ..problem }
    }
}

impl IntoResponse for Problem {
    /// The body is fit for strangers; the problem itself goes along for the outermost layer, which logs it
    /// and adds the request's id.
    fn into_response(self) -> Response<Body> {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let mut response = Response::new(Body::from(serde_json::to_vec(&self.in_public()).unwrap_or_default()));
        *response.status_mut() = status;
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        if let Some(seconds) = self.retry_after {
            headers.insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        if self.kind == ProblemKind::NotAcceptable {
            headers.insert(header::VARY, HeaderValue::from_static("Accept"));
        }
        if self.kind == ProblemKind::Unauthenticated {
            headers.insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        response.extensions_mut().insert(self);
        response
    }
}

impl std::fmt::Display for Problem {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{} [{}]", self.detail, self.code)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn every_kernel_kind_has_its_status_and_exit_code() {
        for (kind, status, exit) in [
            (Kind::Invalid, 422, 3),
            (Kind::Unreachable, 422, 4),
            (Kind::Limit, 422, 4),
            (Kind::Cancelled, 409, 130),
            (Kind::Defect, 500, 70),
        ] {
            let kind = ProblemKind::from(kind);
            assert_eq!((kind.facts().0, kind.exit_code()), (status, exit));
        }
    }

    #[test]
    fn every_kind_has_an_address_of_its_own() {
        for kind in ProblemKind::ALL {
            let address = serde_json::to_value(kind).unwrap();
            assert_eq!(address, format!("/problems/{}", kind.facts().2));
            assert_eq!(ProblemKind::of_code(kind.facts().2), Some(kind));
        }
    }

    #[test]
    fn a_limit_says_what_would_pass() {
        let facts = LimitFacts { limit: "triangles", asked: 7e6, allowed: 5e6, remedy: Some(("tolerance_mm", 0.08)) };
        let error = JobError {
            kind: Kind::Limit,
            code: "triangles",
            message: "too many".into(),
            limit: Some(facts),
            input: None,
            diagnostics: vec![],
        };
        let json = serde_json::to_value(Problem::from(error)).unwrap();
        assert_eq!(json["limit"], "triangles");
        assert_eq!(json["remedy"]["tolerance_mm"], 0.08);
        assert_eq!(json["type"], "/problems/limit");
    }

    #[test]
    fn an_internal_cause_stays_inside() {
        let response = Problem::internal("index 7 of 3").into_response();
        assert_eq!(response.status(), 500);
        let text = serde_json::to_string(&Problem::internal("index 7 of 3").in_public()).unwrap();
        assert!(!text.contains("index"));
        assert_eq!(response.extensions().get::<Problem>().unwrap().detail, "index 7 of 3");
    }

    #[test]
    fn problems_survive_the_journal() {
        let problem = Problem::new(ProblemKind::TooManyJobs, "full").retry_after(5);
        let text = serde_json::to_string(&problem).unwrap();
        assert_eq!(serde_json::from_str::<Problem>(&text).unwrap(), problem);
    }
}
