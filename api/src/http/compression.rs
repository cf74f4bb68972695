//! Answers in `gzip` for those who take it (RFC 9110, 12.5.3): JSON and text, never files.
//!
//! Whole, not as a stream: what is compressed lies in memory anyway, and an answer keeps its `Content-Length`. Left as they are:
//! * answers with a strong `ETag`. It stands for these very bytes: `If-Match`, `If-Range` and parts are held against it, and `Repr-Digest` is theirs.
//!   A compressed answer would need a tag of its own, and these files are immutable, so that a caller fetches each of them once;
//! * streams of events, which have no length, and results, by their media types: 3MF, GLB and PNG are compressed inside.

use std::io::Write as _;

use axum::body::{Body, Bytes, HttpBody as _};
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::middleware::Next;
use axum::response::Response;
use flate2::Compression;
use flate2::write::GzEncoder;
use http_body_util::BodyExt;

use super::accept::Weighted;

/// Shortest body that is compressed: a shorter one fits into one packet as it is.
const SHORTEST: u64 = 1 << 10;

/// Longest body that is compressed: twice as much memory is needed for a moment. A page of 200 jobs has less than 1 MiB.
const LONGEST: u64 = 16 << 20;

/// Longest body that is compressed on the thread of the event loop: a tenth of a millisecond.
const AT_ONCE: usize = 8 << 10;

/// Half the time of the usual level, for a few per cent more bytes.
const LEVEL: Compression = Compression::new(3);

/// Compresses an answer if its caller takes that, and says that others get it otherwise.
pub async fn compress(request: Request, next: Next) -> Response {
    let wanted = takes_gzip(request.headers());
    let mut response = next.run(request).await;
    if !may_be_compressed(&response) {
        return response;
    }
    response.headers_mut().append(header::VARY, HeaderValue::from_static("Accept-Encoding"));
    if !wanted {
        return response;
    }
    let (mut parts, body) = response.into_parts();
    let Ok(whole) = body.collect().await.map(http_body_util::Collected::to_bytes) else {
        // A body with a length lies in memory and cannot fail; if it does, its connection ends as it would have.
        return Response::from_parts(
            parts,
            Body::from_stream(futures_util::stream::once(async { Err::<Bytes, _>("the answer broke off") })),
        );
    };
    let compressed = if whole.len() > AT_ONCE {
        let whole = whole.clone();
        tokio::task::spawn_blocking(move || gzip(&whole)).await.ok().flatten()
    } else {
        gzip(&whole)
    };
    let Some(compressed) = compressed else { return Response::from_parts(parts, Body::from(whole)) };
    parts.headers.insert(header::CONTENT_ENCODING, HeaderValue::from_static("gzip"));
    // The server counts anew.
    parts.headers.remove(header::CONTENT_LENGTH);
    Response::from_parts(parts, Body::from(compressed))
}

/// The bytes compressed; none if that fails, which it does not in memory.
fn gzip(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::with_capacity(bytes.len() / 4), LEVEL);
    encoder.write_all(bytes).ok()?;
    encoder.finish().ok()
}

fn may_be_compressed(response: &Response) -> bool {
    let headers = response.headers();
    let length = response.body().size_hint().exact();
    let taken = [header::ETAG, header::CONTENT_ENCODING, header::CONTENT_RANGE].iter().any(|name| headers.contains_key(name));
    !taken && length.is_some_and(|length| (SHORTEST..=LONGEST).contains(&length)) && is_text(headers)
}

fn is_text(headers: &HeaderMap) -> bool {
    let media_type = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let media_type = media_type.split(';').next().unwrap_or_default().trim();
    match media_type {
        // A stream: every event would wait for the next.
        "text/event-stream" => false,
        "application/json" | "text/javascript" | "image/svg+xml" => true,
        _ => media_type.starts_with("text/") || media_type.starts_with("application/") && media_type.ends_with("+json"),
    }
}

/// Whether a caller takes `gzip` at least as gladly as the bytes as they are. Without the header nobody asked for it.
fn takes_gzip(headers: &HeaderMap) -> bool {
    let values = headers.get_all(header::ACCEPT_ENCODING).iter().filter_map(|value| value.to_str().ok());
    let (mut gzip, mut identity, mut any) = (None, None, None);
    for item in values.flat_map(|value| value.split(',')) {
        let Weighted { name, quality } = Weighted::read(item);
        // What is no number is no wish.
        let quality = quality.unwrap_or(0);
        match &*name {
            "gzip" | "x-gzip" => gzip = Some(quality),
            "identity" => identity = Some(quality),
            "*" => any = Some(quality),
            _ => {}
        }
    }
    let gzip = gzip.or(any).unwrap_or(0);
    gzip > 0 && gzip >= identity.unwrap_or(0)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn gzip_is_for_those_who_take_it() {
        let takes = |value: &str| takes_gzip(&HeaderMap::from_iter([(header::ACCEPT_ENCODING, value.parse().unwrap())]));
        assert!(!takes_gzip(&HeaderMap::new()));
        for value in
            ["gzip", "GZIP;q=0.5", "br, zstd, gzip", "x-gzip", "*", "deflate, *;q=0.1", "gzip;q=1.0, identity; q=0.5", "identity;q=0, *"]
        {
            assert!(takes(value), "{value}");
        }
        for value in
            ["", "identity", "br", "gzip;q=0", "*;q=0", "gzip;q=0, *", "gzip;q=0.2, identity;q=0.9", "gzip;q=much", "gzip;q=nan", "gzipped"]
        {
            assert!(!takes(value), "{value}");
        }
    }

    #[test]
    fn text_of_some_length_without_a_tag() {
        let eligible = |media_type: &'static str, extra: Option<(&'static str, &'static str)>, length: usize| {
            let mut response = Response::new(Body::from(vec![b'a'; length]));
            response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(media_type));
            if let Some((name, value)) = extra {
                response.headers_mut().insert(name, HeaderValue::from_static(value));
            }
            may_be_compressed(&response)
        };
        for media_type in
            ["application/json", "application/problem+json", "text/html; charset=utf-8", "text/plain", "text/javascript", "image/svg+xml"]
        {
            assert!(eligible(media_type, None, 1024), "{media_type}");
            assert!(!eligible(media_type, None, 1023), "{media_type}");
            for extra in [("etag", "\"a\""), ("content-encoding", "br"), ("content-range", "bytes 0-1023/2048")] {
                assert!(!eligible(media_type, Some(extra), 1024), "{media_type} {extra:?}");
            }
        }
        for media_type in
            ["text/event-stream", "model/stl", "model/3mf", "model/obj", "image/png", "application/octet-stream", "application/zip"]
        {
            assert!(!eligible(media_type, None, 4096), "{media_type}");
        }
        let stream = Body::from_stream(futures_util::stream::iter([Ok::<_, std::io::Error>(Bytes::from(vec![b'a'; 4096]))]));
        let mut response = Response::new(stream);
        response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static("application/json"));
        assert!(!may_be_compressed(&response));
    }
}
