//! Bodies of requests: JSON by its media type, within a length and a time.

use std::io::Write as _;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::{FromRequest, Request};
use axum::http::{HeaderMap, header};
use http_body_util::{BodyExt, LengthLimitError, Limited};

use super::state::Shared;
use crate::files::PendingFile;
use crate::problem::{Problem, ProblemKind};
use lacuna_kernel::error::LimitFacts;

/// The bytes of a JSON body; reading them is the exchange crate's business.
#[derive(Debug)]
pub struct JsonBody(pub Bytes);

impl FromRequest<Shared> for JsonBody {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &Shared) -> Result<Self, Problem> {
        check_media_type(request.headers())?;
        check_coding(request.headers())?;
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

/// Bytes that are collected before they go to the disk.
const PIECE: usize = 1 << 20;

/// Receives a body into a file, piece by piece; between two of them no more time than `idle` may pass.
///
/// # Errors
/// When the body is compressed, longer than allowed, too slow or breaks off, or the device fails.
pub async fn receive(request: Request, mut file: PendingFile, allowed: u64, idle: Duration) -> Result<PendingFile, Problem> {
    check_coding(request.headers())?;
    let announced = request.headers().get(header::CONTENT_LENGTH).and_then(|v| v.to_str().ok()?.parse::<u64>().ok());
    if let Some(announced) = announced.filter(|&announced| announced > allowed) {
        return Err(file_too_large(announced, allowed));
    }
    let (mut body, mut length, mut waiting) = (request.into_body(), 0_u64, Vec::new());
    loop {
        let frame = tokio::time::timeout(idle, body.frame()).await.map_err(|_| {
            let detail = format!("nothing of the file arrived for {} s, after {length} bytes", idle.as_secs());
            Problem::new(ProblemKind::RequestTimeout, detail)
        })?;
        let Some(frame) = frame else { break };
        let frame =
            frame.map_err(|error| Problem::new(ProblemKind::BadRequest, format!("the file broke off after {length} bytes: {error}")))?;
        let Ok(data) = frame.into_data() else { continue };
        length += data.len() as u64;
        if length > allowed {
            return Err(file_too_large(length, allowed));
        }
        waiting.extend_from_slice(&data);
        if waiting.len() >= PIECE {
            file = append(file, std::mem::take(&mut waiting)).await?;
        }
    }
    append(file, waiting).await
}

async fn append(mut file: PendingFile, piece: Vec<u8>) -> Result<PendingFile, Problem> {
    let written = tokio::task::spawn_blocking(move || file.write_all(&piece).map(|()| file)).await;
    let written = written.map_err(|error| Problem::internal(format!("a piece was not written: {error}")))?;
    written.map_err(|error| Problem::io("the file could not be kept", &error))
}

#[expect(clippy::cast_precision_loss, reason = "lengths are shown, not computed with")]
fn file_too_large(asked: u64, allowed: u64) -> Problem {
    let facts = LimitFacts { limit: "upload_bytes", asked: asked as f64, allowed: allowed as f64, remedy: None };
    Problem::new(ProblemKind::BodyTooLarge, format!("mesh files of at most {allowed} bytes are taken")).limit(&facts)
}

#[expect(clippy::cast_precision_loss, reason = "lengths are shown, not computed with")]
fn too_large(announced: Option<usize>, allowed: usize) -> Problem {
    let asked = announced.unwrap_or(allowed + 1);
    let facts = LimitFacts { limit: "body_bytes", asked: asked as f64, allowed: allowed as f64, remedy: None };
    Problem::new(ProblemKind::BodyTooLarge, format!("at most {allowed} bytes of JSON are read")).limit(&facts)
}

/// Whether a body is said to be JSON, by any of its names.
#[must_use]
pub fn is_json(headers: &HeaderMap) -> bool {
    let given = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let media_type = given.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    media_type == "application/json" || media_type.starts_with("application/") && media_type.ends_with("+json")
}

fn check_media_type(headers: &HeaderMap) -> Result<(), Problem> {
    if is_json(headers) {
        return Ok(());
    }
    let given = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let detail = format!("the body is announced as {given:?}; application/json is read here");
    Err(Problem::new(ProblemKind::UnsupportedMedia, detail))
}

/// Bodies are read as they come: what is announced as compressed, for the whole way or for a part of it, would be taken for something else.
fn check_coding(headers: &HeaderMap) -> Result<(), Problem> {
    for (name, plain) in [(header::CONTENT_ENCODING, "identity"), (header::TRANSFER_ENCODING, "chunked")] {
        let mut codings = headers.get_all(&name).iter().map(|value| String::from_utf8_lossy(value.as_bytes()));
        if let Some(coding) = codings.find(|coding| !coding.trim().eq_ignore_ascii_case(plain)) {
            let (given, title) = (coding.chars().take(80).collect::<String>(), if plain == "chunked" { "Transfer" } else { "Content" });
            let detail = format!("the body is announced with {title}-Encoding {given:?}; send it as it is, without that coding");
            return Err(Problem::new(ProblemKind::UnsupportedMedia, detail).code("unsupported-encoding"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn only_what_is_not_compressed_is_read() {
        let check = |name, value: &str| {
            let headers = HeaderMap::from_iter([(name, value.parse().unwrap())]);
            check_coding(&headers).map_err(|problem| problem.code)
        };
        assert!(check_coding(&HeaderMap::new()).is_ok());
        assert!(check(header::CONTENT_ENCODING, "identity").is_ok() && check(header::TRANSFER_ENCODING, "Chunked").is_ok());
        for coding in ["gzip", "br", "identity, gzip", "snappy-9000", ""] {
            assert_eq!(check(header::CONTENT_ENCODING, coding), Err("unsupported-encoding".to_owned()), "{coding}");
        }
        assert_eq!(check(header::TRANSFER_ENCODING, "gzip, chunked"), Err("unsupported-encoding".to_owned()));
    }

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
