//! Files over HTTP: whole, one range of them, or "you have it".

use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, Response, StatusCode, header};
use axum::response::IntoResponse;

use super::headers::{check_match, is_known, untold};
use crate::jobs::record::Output;
use crate::problem::{Problem, ProblemKind};
use crate::store::{File, Store};

/// What a `Range` header asks of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// All of it: no range, one that is not understood, or several, which a server may ignore (RFC 9110).
    Whole,
    /// The bytes from the first to the last, both included.
    Range(u64, u64),
    /// Bytes that the file does not have.
    Outside,
}

/// Reads a `Range` header against a file's length.
#[must_use]
pub fn part(range: Option<&str>, length: u64) -> Part {
    let Some((first, last)) = range.and_then(|range| range.trim().strip_prefix("bytes=")?.split_once('-')) else {
        return Part::Whole;
    };
    match (first.trim(), last.trim()) {
        ("", suffix) => match position(suffix) {
            None => Part::Whole,
            Some(suffix) if suffix == 0 || length == 0 => Part::Outside,
            Some(suffix) => Part::Range(length - suffix.min(length), length - 1),
        },
        (first, last) => match (position(first), if last.is_empty() { Some(u64::MAX) } else { position(last) }) {
            (Some(first), Some(last)) if first > last => Part::Whole,
            (Some(first), Some(last)) if first < length => Part::Range(first, last.min(length - 1)),
            (Some(_), Some(_)) => Part::Outside,
            _ => Part::Whole,
        },
    }
}

/// A place in a file: digits only. One that no number of ours holds lies behind the end of every file, as the greatest one does.
fn position(digits: &str) -> Option<u64> {
    let all_digits = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
    all_digits.then(|| digits.parse().unwrap_or(u64::MAX))
}

/// Answers with a file that never changes.
///
/// # Errors
/// When the file is gone or fails.
pub async fn answer(request: &HeaderMap, store: &Store, file: File, output: &Output) -> Result<Response<Body>, Problem> {
    let etag = format!("\"{}\"", output.digest);
    check_match(request, &etag)?;
    let mut response = Response::new(Body::empty());
    immutable_headers(response.headers_mut(), output, &etag)?;
    if is_known(request, &etag) {
        *response.status_mut() = StatusCode::NOT_MODIFIED;
        *response.body_mut() = untold();
        return Ok(response);
    }
    // A range of another version must not be glued to this one.
    let same_version = request.get_all(header::IF_RANGE).iter().all(|tag| tag == etag.as_str());
    let mut ranges = request.get_all(header::RANGE).iter();
    // Of several none is the one that is meant.
    let range = ranges.next().filter(|_| same_version && ranges.next().is_none()).and_then(|value| value.to_str().ok());
    let (first, length) = match part(range, output.bytes) {
        Part::Whole => (0, output.bytes),
        Part::Outside => return outside(output.bytes),
        Part::Range(first, last) => {
            *response.status_mut() = StatusCode::PARTIAL_CONTENT;
            let value = format!("bytes {first}-{last}/{}", output.bytes);
            response.headers_mut().insert(header::CONTENT_RANGE, header_value(&value)?);
            (first, last - first + 1)
        }
    };
    response.headers_mut().insert(header::CONTENT_LENGTH, HeaderValue::from(length));
    *response.body_mut() = store.part(file, first, length).await.map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => gone(file, output),
        _ => Problem::io("the result could not be read", &error),
    })?;
    Ok(response)
}

/// What is known by its record and is not there. Our own sweep takes a result with the last job that has it; a rule of a
/// bucket, or somebody who makes room, need not.
fn gone(file: File, output: &Output) -> Problem {
    let name = &output.file_name;
    match file {
        File::Result(_) => expired(name),
        File::Upload(_) => Problem::new(ProblemKind::NotFound, format!("{name} is no longer kept; send it again")),
    }
}

/// What a job made that is no longer kept, with the way to it.
#[must_use]
pub fn expired(name: &str) -> Problem {
    let detail = format!("{name} is no longer kept; submit its job again (POST /v1/jobs with the same document), and it is made again");
    Problem::new(ProblemKind::ResultExpired, detail)
}

fn immutable_headers(headers: &mut HeaderMap, output: &Output, etag: &str) -> Result<(), Problem> {
    headers.insert(header::CONTENT_TYPE, header_value(&output.media_type)?);
    headers.insert(header::ETAG, header_value(etag)?);
    headers.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("private, max-age=31536000, immutable"));
    headers.insert("repr-digest", header_value(&format!("sha-256=:{}:", output.digest.base64()))?);
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    let disposition = format!("attachment; filename=\"{}\"", output.file_name);
    headers.insert(header::CONTENT_DISPOSITION, header_value(&disposition)?);
    Ok(())
}

fn outside(length: u64) -> Result<Response<Body>, Problem> {
    let problem = Problem::new(ProblemKind::Range, format!("the file has {length} bytes, numbered from 0"));
    let mut response = problem.into_response();
    response.headers_mut().insert(header::CONTENT_RANGE, header_value(&format!("bytes */{length}"))?);
    Ok(response)
}

fn header_value(text: &str) -> Result<HeaderValue, Problem> {
    HeaderValue::from_str(text).map_err(|error| Problem::internal(format!("a header's value: {error}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_ten_bytes() {
        for (range, expected) in [
            (None, Part::Whole),
            (Some("bytes=0-0"), Part::Range(0, 0)),
            (Some("bytes=2-5"), Part::Range(2, 5)),
            (Some("bytes=2-"), Part::Range(2, 9)),
            (Some("bytes=8-100"), Part::Range(8, 9)),
            (Some("bytes=-3"), Part::Range(7, 9)),
            (Some("bytes=-30"), Part::Range(0, 9)),
            (Some("bytes=10-"), Part::Outside),
            (Some("bytes=10-12"), Part::Outside),
            (Some("bytes=-0"), Part::Outside),
            (Some("bytes=5-2"), Part::Whole),
            (Some("bytes=0-1,3-4"), Part::Whole),
            (Some("lines=1-2"), Part::Whole),
            (Some("bytes=a-b"), Part::Whole),
            (Some("bytes=+1-+5"), Part::Whole),
            (Some("bytes=-"), Part::Whole),
            // Numbers beyond 64 bits.
            (Some("bytes=2-18446744073709551616"), Part::Range(2, 9)),
            (Some("bytes=18446744073709551616-"), Part::Outside),
            (Some("bytes=18446744073709551616-18446744073709551617"), Part::Outside),
            (Some("bytes=-18446744073709551616"), Part::Range(0, 9)),
        ] {
            assert_eq!(part(range, 10), expected, "{range:?}");
        }
        assert_eq!(part(Some("bytes=0-"), 0), Part::Outside);
        assert_eq!(part(Some("bytes=-1"), 0), Part::Outside);
    }
}
