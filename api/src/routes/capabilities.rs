//! What this service can do and how much of it it allows.

use axum::Json;
use axum::extract::State;
use lacuna_exchange::format::FORMATS;
use lacuna_exchange::library::CLASSICS;
use lacuna_fabrication::JobKind;
use serde::Serialize;
use utoipa::ToSchema;

use crate::http::state::Shared;
use crate::problem::Problem;
use crate::trades::PROFILES;

/// What the service can do.
#[derive(Debug, Serialize, ToSchema)]
pub struct Capabilities {
    /// Kinds of jobs.
    kinds: Vec<JobKind>,
    /// Output formats.
    formats: Vec<FormatCapability>,
    /// Limits.
    limits: LimitCapability,
    /// Classics of the library.
    library: Vec<&'static str>,
    /// Processes with a profile.
    profiles: Vec<&'static str>,
    /// The kernel's version: the same input and version give the same bytes.
    kernel_version: &'static str,
    /// `sha256:` digest of the program that answers: services that tell the same run the same build. Absent where the system does not let it be read.
    #[serde(skip_serializing_if = "Option::is_none")]
    build: Option<String>,
}

/// An output format.
#[derive(Debug, Serialize, ToSchema)]
pub struct FormatCapability {
    /// Its name in `outputs`.
    name: &'static str,
    /// Its media type.
    media_type: &'static str,
    /// Whether files of it can be uploaded.
    reads: bool,
    /// What it has room for: `solid`, `surface`, `wires`, `points`.
    carries: Vec<&'static str>,
}

/// The limits of a request and of a job.
#[derive(Debug, Serialize, ToSchema)]
pub struct LimitCapability {
    /// Bytes of a JSON body.
    body_bytes: usize,
    /// Bytes of an uploaded mesh file.
    upload_bytes: u64,
    /// Bytes of all models and mesh files that one key may keep.
    stored_bytes: u64,
    /// Seconds that `Prefer: wait` may ask.
    wait_seconds: u64,
    /// Most wall time of a job, in seconds.
    seconds: f64,
    /// Most accounted memory of a job, in bytes.
    memory_bytes: u64,
    /// Most leaf cells that a job may expand.
    cells: u64,
    /// Most triangles of a result.
    triangles: u64,
    /// Longest address.
    depth: u32,
    /// Most bytes of all files of a result.
    output_bytes: u64,
    /// Jobs that may wait.
    queued_jobs: usize,
    /// Unfinished jobs that one key may have.
    jobs_per_key: usize,
    /// Jobs that a batch may have.
    batch_jobs: usize,
    /// Submissions per minute and key.
    submissions_per_minute: u32,
    /// Other calls per minute and key.
    calls_per_minute: u32,
    /// Hours after which ended jobs expire: what they made is given up.
    retention_hours: u64,
    /// Hours after that for which an expired job is still known.
    expired_hours: u64,
}

/// Kinds of jobs, formats and limits of this service.
#[utoipa::path(get, path = "/v1/capabilities", tag = "operation",
    responses((status = 200, body = Capabilities), (status = "4XX", body = Problem, content_type = "application/problem+json"))
)]
pub async fn capabilities(State(state): State<Shared>) -> Json<Capabilities> {
    let config = &state.config;
    // The first who asks waits for it, and nobody else.
    let build = tokio::task::spawn_blocking(crate::program::digest).await.ok().flatten().map(|digest| digest.to_string());
    let formats = FORMATS.iter().map(|row| {
        let carries =
            [(row.carries.solid, "solid"), (row.carries.surface, "surface"), (row.carries.wires, "wires"), (row.carries.points, "points")];
        let carries = carries.into_iter().filter_map(|(carried, word)| carried.then_some(word)).collect();
        FormatCapability { name: row.ending, media_type: row.media_type, reads: row.reads, carries }
    });
    Json(Capabilities {
        kinds: vec![JobKind::Evaluate, JobKind::Solidify, JobKind::Measure, JobKind::Intersect, JobKind::Slice, JobKind::Convert],
        formats: formats.collect(),
        limits: LimitCapability {
            body_bytes: config.body_bytes,
            upload_bytes: config.upload_bytes,
            stored_bytes: config.stored_bytes,
            wait_seconds: crate::http::headers::LONGEST_WAIT.as_secs(),
            seconds: config.job_limits.seconds,
            memory_bytes: config.job_limits.memory_bytes,
            cells: config.job_limits.cells,
            triangles: config.job_limits.triangles,
            depth: config.job_limits.depth,
            output_bytes: config.job_limits.output_bytes,
            queued_jobs: config.queued,
            jobs_per_key: config.jobs_per_key,
            batch_jobs: lacuna_exchange::document::MOST_JOBS,
            submissions_per_minute: config.submissions_per_minute,
            calls_per_minute: config.calls_per_minute,
            retention_hours: config.retention_hours,
            expired_hours: config.expired_hours,
        },
        library: CLASSICS.iter().map(|classic| classic.name).collect(),
        profiles: PROFILES.iter().map(|profile| profile.name).collect(),
        kernel_version: env!("CARGO_PKG_VERSION"),
        build,
    })
}
