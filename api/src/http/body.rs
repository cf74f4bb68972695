//! Bodies of requests: JSON by its media type, within a length and a time.

use std::time::Duration;

use axum::body::Bytes;
use axum::extract::{FromRequest, Request};
use axum::http::{HeaderMap, header};
use http_body_util::{BodyExt, LengthLimitError, Limited};

use super::state::Shared;
use crate::problem::{Problem, ProblemKind};
use lacuna_kernel::error::LimitFacts;

/// The bytes of a JSON body; reading them is the exchange crate's business.
#[derive(Debug)]
pub struct JsonBody(pub Bytes);

impl FromRequest<Shared> for JsonBody {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &Shared) -> Result<Self, Problem> {
        check_media_type(request.headers())?;
        read(request, state).await.map(Self)
    }
}

/// The bytes of a body that may be empty and is not looked into.
async fn read(request: Request, state: &Shared) -> Result<Bytes, Problem> {
    let allowed = state.config.body_bytes;
    let announced = request.headers().get(header::CONTENT_LENGTH).and_then(|v| v.to_str().ok()?.parse::<usize>().ok());
    if let Some(announced) = announced.filter(|&announced| announced > allowed) {
        return Err(too_large(Some(announced), allowed));
    }
    let time = Duration::from_secs(state.config.body_seconds);
    let collected = tokio::time::timeout(time, Limited::new(request.into_body(), allowed).collect()).await;
    match collected {
        Err(_) => Err(Problem::new(ProblemKind::RequestTimeout, format!("the body did not arrive within {} s", time.as_secs()))),
        Ok(Ok(body)) => Ok(body.to_bytes()),
        Ok(Err(error)) if error.is::<LengthLimitError>() => Err(too_large(None, allowed)),
        Ok(Err(error)) => Err(Problem::new(ProblemKind::BadRequest, format!("the body broke off: {error}"))),
    }
}

#[expect(clippy::cast_precision_loss, reason = "lengths are shown, not computed with")]
fn too_large(announced: Option<usize>, allowed: usize) -> Problem {
    let asked = announced.unwrap_or(allowed + 1);
    let facts = LimitFacts { limit: "body_bytes", asked: asked as f64, allowed: allowed as f64, remedy: None };
    Problem::new(ProblemKind::BodyTooLarge, format!("at most {allowed} bytes of JSON are read")).limit(&facts)
}

fn check_media_type(headers: &HeaderMap) -> Result<(), Problem> {
    let given = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let media_type = given.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    if media_type == "application/json" || media_type.starts_with("application/") && media_type.ends_with("+json") {
        return Ok(());
    }
    let detail = format!("the body is announced as {given:?}; application/json is read here");
    Err(Problem::new(ProblemKind::UnsupportedMedia, detail))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn json_by_any_of_its_names() {
        let check = |value: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(header::CONTENT_TYPE, value.parse().unwrap());
            check_media_type(&headers).is_ok()
        };
        assert!(check("application/json") && check("Application/JSON; charset=utf-8"));
        assert!(check("application/vnd.lacuna.model+json;v=1"));
        assert!(!check("text/plain") && !check("multipart/form-data") && !check("image/svg+json"));
        assert!(check_media_type(&HeaderMap::new()).is_err());
    }
}
