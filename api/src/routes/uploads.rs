//! Mesh files as bodies: which format they are said to be in, how they are called, and what is found in them.

use std::time::Duration;

use axum::extract::Request;
use axum::http::{HeaderMap, header};
use lacuna_exchange::format::{FORMATS, Format};
use lacuna_kernel::budget::CancelToken;
use lacuna_kernel::error::LimitFacts;
use serde::Deserialize;
use utoipa::{IntoParams, ToSchema};

use crate::digest::Digest;
use crate::files::PendingFile;
use crate::http::auth::Owner;
use crate::http::body;
use crate::http::state::{AppState, Leaving, Shared};
use crate::inspection::Examined;
use crate::problem::{Problem, ProblemKind};
use crate::store::ModelView;

/// The bytes of a mesh file.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
pub struct MeshFile(pub Vec<u8>);

/// How a mesh file is to be read and called, where its headers do not say so.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct UploadQuery {
    /// For mesh files: `stl`, `3mf`, `obj`, `ply`, `off` or `wrl`; found in the headers or in the file when absent.
    format: Option<String>,
    /// For mesh files: what to call the mesh; the file name of `Content-Disposition` without its ending when absent.
    name: Option<String>,
}

/// Names of media types beside those in the table of formats.
const MORE_MEDIA_TYPES: [(&str, Format); 6] = [
    ("application/sla", Format::Stl),
    ("application/vnd.ms-pki.stl", Format::Stl),
    ("model/ply", Format::Ply),
    ("model/off", Format::Off),
    ("model/x3d-vrml", Format::Vrml),
    ("x-world/x-vrml", Format::Vrml),
];

/// What the headers and the query say of a mesh file.
#[derive(Debug, PartialEq)]
struct Told {
    format: Option<Format>,
    name: Option<String>,
}

impl Told {
    fn of(headers: &HeaderMap, query: &UploadQuery) -> Result<Self, Problem> {
        let file = file_name(headers);
        let (stem, ending) = match file.as_deref().map(|file| file.rsplit_once('.').unwrap_or((file, ""))) {
            Some((stem, ending)) => (Some(stem.to_owned()), Some(ending.to_owned())),
            None => (None, None),
        };
        let format = match &query.format {
            Some(word) => Some(readable(word).ok_or_else(|| unknown(&format!("?format={}", shown(word))))?),
            None => by_media_type(headers)?.or_else(|| ending.as_deref().and_then(readable)),
        };
        let name = query.name.clone().or(stem).map(|name| name.chars().filter(|c| !c.is_control()).take(200).collect::<String>());
        Ok(Self { format, name: name.filter(|name| !name.trim().is_empty()) })
    }
}

fn readable(word: &str) -> Option<Format> {
    Format::from_name(word).filter(|format| format.facts().reads)
}

/// The format that the media type names; `None` for bytes of no type, whose format is found in them.
fn by_media_type(headers: &HeaderMap) -> Result<Option<Format>, Problem> {
    let given = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let media_type = given.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    if media_type.is_empty() || media_type == "application/octet-stream" {
        return Ok(None);
    }
    let more = MORE_MEDIA_TYPES.iter().find(|(name, _)| *name == media_type).map(|(_, format)| *format);
    // Endings are no media types, though the table would take them.
    let named = readable(&media_type).filter(|_| media_type.contains('/'));
    named.or(more).map(Some).ok_or_else(|| unknown(&format!("the body is announced as {}", shown(given))))
}

fn unknown(what: &str) -> Problem {
    let read = FORMATS.iter().filter(|row| row.reads).map(|row| format!("{} ({})", row.media_type, row.ending)).collect::<Vec<_>>();
    let detail = format!(
        "{what}; a model is application/json, a mesh file one of {}, or application/octet-stream with ?format= and an ending",
        read.join(", ")
    );
    Problem::new(ProblemKind::UnsupportedMedia, detail)
}

fn shown(text: &str) -> String {
    format!("{:?}", text.chars().take(80).collect::<String>())
}

/// The file name of `Content-Disposition`, without folders.
fn file_name(headers: &HeaderMap) -> Option<String> {
    let value = headers.get(header::CONTENT_DISPOSITION)?.to_str().ok()?;
    let rest = value.split(';').find_map(|part| part.trim().strip_prefix("filename="))?;
    let name = rest.trim().trim_matches('"').rsplit(['/', '\\']).next()?.trim();
    (!name.is_empty()).then(|| name.to_owned())
}

/// Receives, reads, examines and keeps a mesh file; tells what is kept and whether it is new.
///
/// # Errors
/// When it is no mesh file that is read here, is too long or too slow, or asks for more than is allowed.
pub async fn receive(state: &Shared, owner: Owner, query: UploadQuery, request: Request) -> Result<(ModelView, bool), Problem> {
    let told = Told::of(request.headers(), &query)?;
    let failed = |error: std::io::Error| Problem::io("the file could not be kept", &error);
    let pending = state.beside(Some(owner.clone()), move |state| state.store.new_upload().map_err(failed)).await?;
    let idle = Duration::from_secs(state.config.body_seconds);
    let pending = body::receive(request, pending, state.config.upload_bytes, idle).await?;
    let place = state.readers.place(&owner.0).await?;
    let (_leaving, cancel) = Leaving::new();
    state
        .at_once(move |state| {
            let kept = keep(state, &owner, told, pending, &cancel);
            drop(place);
            kept
        })
        .await
}

fn keep(state: &AppState, owner: &Owner, told: Told, mut pending: PendingFile, cancel: &CancelToken) -> Result<(ModelView, bool), Problem> {
    let config = &state.config;
    let examined = state.readers.examine(&pending, told.format, config.upload_bytes, &config.job_limits, &state.store, cancel)?;
    let Examined { digest, report } = examined;
    check_share(state, owner, digest, report.bytes)?;
    let kept = state.store.keep_upload(&owner.0, told.name, &mut pending, digest, report);
    kept.map_err(|error| Problem::io("the file could not be kept", &error))
}

/// A key that never forgets anything must not fill the disk for all.
///
/// # Errors
/// When with so many bytes of this digest the key would keep more than its share.
pub(super) fn check_share(state: &AppState, owner: &Owner, digest: Digest, bytes: u64) -> Result<(), Problem> {
    let kept = state.store.list_models(&owner.0).map_err(|error| Problem::io("the models could not be counted", &error))?;
    let others: u64 = kept.iter().filter(|view| view.digest != digest).map(|view| view.bytes).sum();
    let (asked, allowed) = (others.saturating_add(bytes), state.config.stored_bytes);
    if asked <= allowed {
        return Ok(());
    }
    #[expect(clippy::cast_precision_loss, reason = "lengths are shown, not computed with")]
    let facts = LimitFacts { limit: "stored_bytes", asked: asked as f64, allowed: allowed as f64, remedy: None };
    let detail = format!(
        "the models and mesh files of this key would have {asked} bytes, and {allowed} may be kept; DELETE /v1/models/ID forgets one"
    );
    Err(Problem::new(ProblemKind::Limit, detail).code("limit.stored-bytes").limit(&facts))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn told(content_type: &str, disposition: &str, query: UploadQuery) -> Result<Told, Problem> {
        let mut headers = HeaderMap::new();
        if !content_type.is_empty() {
            headers.insert(header::CONTENT_TYPE, content_type.parse().unwrap());
        }
        if !disposition.is_empty() {
            headers.insert(header::CONTENT_DISPOSITION, disposition.parse().unwrap());
        }
        Told::of(&headers, &query)
    }

    #[test]
    fn formats_and_names_as_clients_tell_them() {
        let plain = |content_type: &str, disposition: &str| told(content_type, disposition, UploadQuery::default()).unwrap();
        assert_eq!(plain("model/stl", "").format, Some(Format::Stl));
        assert_eq!(plain("application/vnd.ms-package.3dmanufacturing-3dmodel+xml", "").format, Some(Format::ThreeMf));
        assert_eq!(plain("Model/OBJ; charset=utf-8", "").format, Some(Format::Obj));
        let named = plain("application/octet-stream", "attachment; filename=\"C:\\parts\\lid.v2.PLY\"");
        assert_eq!((named.format, named.name.as_deref()), (Some(Format::Ply), Some("lid.v2")));
        assert_eq!(plain("", ""), Told { format: None, name: None });
        // An ending that says nothing is no fault: the contents tell.
        assert_eq!(plain("application/octet-stream", "attachment; filename=part").format, None);
        let asked = UploadQuery { format: Some("wrl".into()), name: Some("a\u{7}b".into()) };
        assert_eq!(told("", "", asked).unwrap(), Told { format: Some(Format::Vrml), name: Some("ab".into()) });
    }

    #[test]
    fn what_is_not_read_is_refused_with_what_is() {
        let dwg = UploadQuery { format: Some("dwg".into()), name: None };
        let glb = UploadQuery { format: Some("glb".into()), name: None };
        for refused in
            [told("image/png", "", UploadQuery::default()), told("stl", "", UploadQuery::default()), told("", "", dwg), told("", "", glb)]
        {
            let problem = refused.unwrap_err();
            assert_eq!(problem.kind, ProblemKind::UnsupportedMedia);
            assert!(problem.detail.contains("model/stl"), "{problem}");
        }
    }
}
