//! Commands whose work a service does: the same files, certificate, progress and exit codes as here.

mod download;
mod follow;
pub(super) mod jobs;
pub(super) mod questions;
mod server;

use std::path::{Path, PathBuf};

use lacuna_fabrication::{Certificate, Plan};
use lacuna_kernel::budget::{CancelToken, ProgressSink};
use ureq::http::Method;
use uuid::Uuid;

use super::args::LimitArgs;
use super::batch;
use super::output::{Target, Written, finish, start};
use super::progress::Reporter;
use super::stop;
use super::work::{self, Manner};
use crate::documents::{self, Order, ValidationReport};
use crate::files::{self, PendingFile};
use crate::jobs::batch::{BatchCertificate, BatchView};
use crate::jobs::record::{JobState, JobView, Output};
use crate::problem::{Problem, ProblemKind};
use follow::Canceller;
pub(super) use server::Server;

/// Name of the certificate among a job's outputs.
const CERTIFICATE: &str = "certificate.json";

/// The job document for an order, with the limits that the command line states and no others: those of the service hold else.
fn posted(order: &Order, outputs: &[String], limits: &LimitArgs) -> Result<Vec<u8>, Problem> {
    let unfit = |error: serde_json::Error| Problem::internal(format!("an order is no JSON: {error}"));
    let mut document: serde_json::Value = serde_json::from_str(&order.document()).map_err(unfit)?;
    document["outputs"] = outputs.into();
    document["limits"] = serde_json::json!({});
    limited(&mut document, limits)?;
    serde_json::to_vec(&document).map_err(unfit)
}

fn limited(document: &mut serde_json::Value, args: &LimitArgs) -> Result<(), Problem> {
    if args.threads.is_some() {
        let detail = "--threads is for work on this machine; how many a service uses is its own setting";
        return Err(Problem::new(ProblemKind::Usage, detail));
    }
    let limits = [
        ("seconds", args.limit_seconds.map(serde_json::Value::from)),
        ("memory_bytes", args.limit_memory.map(serde_json::Value::from)),
        ("triangles", args.limit_triangles.map(serde_json::Value::from)),
        ("output_bytes", args.limit_output.map(serde_json::Value::from)),
    ];
    let jobs: Vec<&mut serde_json::Value> = match document.get("jobs") {
        Some(_) => document["jobs"].as_array_mut().into_iter().flatten().filter_map(|entry| entry.get_mut("job")).collect(),
        None => vec![document],
    };
    for job in jobs.into_iter().filter(|job| job.is_object()) {
        for (name, value) in &limits {
            if let Some(value) = value {
                job["limits"][*name] = value.clone();
            }
        }
    }
    Ok(())
}

/// Submits a job and follows it to its end; Ctrl-C stops it there first.
fn done(server: &Server, document: &[u8], manner: Manner<'_>) -> Result<JobView, Problem> {
    let token = CancelToken::new();
    stop::on_signals(&token)?;
    let reporter = Reporter::new(manner.progress, manner.quiet);
    followed(server, document, &token, reporter.sink().as_ref())
}

/// Submits a job and follows it to its end; it is stopped there when the token is fired.
fn followed(server: &Server, document: &[u8], token: &CancelToken, sink: Option<&ProgressSink>) -> Result<JobView, Problem> {
    // A submission whose answer is lost may be sent again: it is the same job.
    let key = Uuid::now_v7().to_string();
    let submit = || server.json::<JobView>(Method::POST, "/v1/jobs", &[("idempotency-key", &key)], document);
    let view = submit().or_else(|problem| if problem.kind == ProblemKind::ServiceUnreachable { submit() } else { Err(problem) })?;
    if view.state.is_final() {
        return follow::succeeded(view);
    }
    let _canceller = Canceller::start(server, &format!("/v1/jobs/{}", view.id), token)?;
    let ended = follow::follow(server, &view.id, &mut |event| follow::report(event, sink))?;
    follow::succeeded(ended)
}

/// Does a job and puts its files in their places, all of them or none.
pub(super) fn make(
    server: &Server,
    order: &Order,
    targets: &[Target],
    certificate: Option<&Path>,
    limits: &LimitArgs,
    manner: Manner<'_>,
) -> Result<(Certificate, Vec<Written>), Problem> {
    let mut outputs = order.job.outputs.clone();
    for target in targets {
        // A picture beside the result is an output of its own over there.
        let name = target.format.facts().ending;
        if !outputs.iter().any(|output| output == name) {
            outputs.push(name.to_owned());
        }
    }
    let view = done(server, &posted(order, &outputs, limits)?, manner)?;
    let wanted = targets.iter().map(|target| (target.format.facts().ending, target.path.as_path()));
    let wanted = wanted.chain(certificate.map(|path| (CERTIFICATE, path)));
    let named: Vec<(Output, PathBuf)> =
        wanted.map(|(name, path)| Ok((output(&view, name)?.clone(), path.to_owned()))).collect::<Result<_, Problem>>()?;
    let written = deliver(server, &named)?;
    Ok((certified(view)?, written))
}

/// Does the job of a document and puts its files into a folder.
pub(super) fn run(
    server: &Server,
    document: Vec<u8>,
    folder: &Path,
    limits: &LimitArgs,
    manner: Manner<'_>,
) -> Result<(Certificate, Vec<Written>), Problem> {
    let view = done(server, &with_limits(document, limits)?, manner)?;
    let written = files_in(server, &view, folder)?;
    Ok((certified(view)?, written))
}

/// Does the jobs of a batch and puts the files of each that succeeds into a folder of its own; Ctrl-C stops all of them there first.
pub(super) fn run_batch(
    server: &Server,
    document: Vec<u8>,
    folder: &Path,
    limits: &LimitArgs,
    manner: Manner<'_>,
) -> Result<(BatchCertificate, Vec<Written>), Problem> {
    let document = with_limits(document, limits)?;
    let token = CancelToken::new();
    stop::on_signals(&token)?;
    let reporter = Reporter::new(manner.progress, manner.quiet);
    let sink = reporter.sink();
    // A submission whose answer is lost may be sent again: it is the same batch.
    let key = Uuid::now_v7().to_string();
    let submit = || server.json::<BatchView>(Method::POST, "/v1/batches", &[("idempotency-key", &key)], &document);
    let view = submit().or_else(|problem| if problem.kind == ProblemKind::ServiceUnreachable { submit() } else { Err(problem) })?;
    let place = format!("/v1/batches/{}", view.id);
    let _canceller = Canceller::start(server, &place, &token)?;
    let mut written = Vec::new();
    for row in &view.jobs {
        let id = row.job.as_deref().unwrap_or_default();
        let ended = if row.state.is_final() {
            follow::show(server, id)?
        } else {
            follow::follow(server, id, &mut |event| follow::report(event, sink.as_ref()))?
        };
        if ended.state == JobState::Succeeded {
            let folder = batch::folder_of_job(folder, row.index as usize, row.name.as_deref());
            written.extend(files_in(server, &ended, &folder)?);
        }
    }
    if token.reason().is_some() {
        return Err(Problem::new(ProblemKind::Cancelled, format!("stopped by the caller; {place} tells which jobs were done")));
    }
    let certificate: BatchCertificate = server.json(Method::GET, &format!("{place}/certificate"), &[], b"")?;
    std::fs::create_dir_all(folder).map_err(|error| Problem::io(folder.display(), &error))?;
    written.push(work::write(&folder.join(CERTIFICATE), &certificate.bytes()?)?);
    Ok((certificate, written))
}

/// Puts all files of a job into a folder, which is made if needed.
fn files_in(server: &Server, view: &JobView, folder: &Path) -> Result<Vec<Written>, Problem> {
    std::fs::create_dir_all(folder).map_err(|error| Problem::io(folder.display(), &error))?;
    let named: Vec<(Output, PathBuf)> = view.outputs.iter().map(|output| (output.clone(), folder.join(file_name(output)))).collect();
    deliver(server, &named)
}

/// A document as it is, unless the command line states limits.
fn with_limits(document: Vec<u8>, args: &LimitArgs) -> Result<Vec<u8>, Problem> {
    let LimitArgs { limit_triangles, limit_memory, limit_output, limit_seconds, threads } = args;
    let counts = [limit_triangles, limit_memory, limit_output];
    let stated = counts.iter().any(|limit| limit.is_some()) || limit_seconds.is_some() || threads.is_some();
    let Some(mut value) = stated.then(|| serde_json::from_slice::<serde_json::Value>(&document).ok()).flatten() else {
        // What cannot be read is refused by the service, with its place.
        return Ok(document);
    };
    limited(&mut value, args)?;
    serde_json::to_vec(&value).map_err(|error| Problem::internal(error.to_string()))
}

/// `lacuna plan`.
pub(super) fn plan(server: &Server, document: &[u8]) -> Result<Plan, Problem> {
    server.json(Method::POST, "/v1/plan", &[], document)
}

/// `lacuna validate`.
pub(super) fn validate(server: &Server, document: &[u8]) -> Result<ValidationReport, Problem> {
    server.json(Method::POST, "/v1/validate", &[], document)
}

/// A document that a service can read: mesh files that it names are put into it, everything else stays as it is.
pub(super) fn self_contained(bytes: Vec<u8>, whole: impl FnOnce(&[u8]) -> Result<String, Problem>) -> Vec<u8> {
    let names_files = bytes.windows(6).any(|word| word == b"\"file\"");
    // What cannot be read here is refused there, with its place in the document that the user has.
    let whole = if names_files { whole(&bytes).ok() } else { None };
    whole.map_or(bytes, String::into_bytes)
}

fn output<'v>(view: &'v JobView, name: &str) -> Result<&'v Output, Problem> {
    let found = view.outputs.iter().find(|output| output.name == name);
    found.ok_or_else(|| Problem::internal(format!("the job {} has succeeded without its output {name}", view.id)))
}

/// A service's name for a file, fit for a folder whatever it says.
fn file_name(output: &Output) -> String {
    let (stem, ending) = output.file_name.rsplit_once('.').unwrap_or((&output.file_name, ""));
    let (stem, ending) = (files::safe_stem(stem), files::safe_stem(ending));
    if ending.is_empty() { stem } else { format!("{stem}.{ending}") }
}

fn certified(view: JobView) -> Result<Certificate, Problem> {
    let id = view.id;
    view.certificate.ok_or_else(|| Problem::internal(format!("the job {id} has succeeded without a certificate")))
}

/// Fetches all files before the first one takes its place.
fn deliver(server: &Server, named: &[(Output, PathBuf)]) -> Result<Vec<Written>, Problem> {
    let mut pending: Vec<(PendingFile, &Path)> = Vec::with_capacity(named.len());
    let mut written = Vec::with_capacity(named.len());
    for (output, path) in named {
        let mut part = start(path)?;
        let file = part.reread().map_err(|error| Problem::io(path.display(), &error))?;
        download::complete(server, output, file)?;
        pending.push((part, path));
        written.push(Written { file: path.clone(), bytes: output.bytes, digest: output.digest });
    }
    pending.into_iter().try_for_each(|(part, path)| finish(part, path))?;
    Ok(written)
}

/// The bytes of a file.
fn fetched(server: &Server, output: &Output) -> Result<Vec<u8>, Problem> {
    let failed = |error: std::io::Error| Problem::io(&output.file_name, &error);
    let mut part = PendingFile::create_in(&std::env::temp_dir()).map_err(failed)?;
    let file = part.reread().map_err(failed)?;
    download::complete(server, output, file)?;
    let mut bytes = Vec::new();
    part.reread().and_then(|file| std::io::Read::read_to_end(file, &mut bytes)).map_err(failed)?;
    Ok(bytes)
}

/// The document of a model whose mesh files are in it.
pub(super) fn whole_model(bytes: &[u8], folder: Option<&Path>) -> Result<String, Problem> {
    documents::read_model_in(bytes, folder).map(|model| documents::model_document(&model))
}
