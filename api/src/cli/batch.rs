//! `lacuna run` of a batch: its jobs one after the other, each into a folder of its own, and the certificate of all.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use lacuna_kernel::budget::{CancelToken, Limits, StopReason};
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::json;

use super::args::RunArgs;
use super::output::Written;
use super::work::{self, Manner};
use super::{folder_of, print_json, remote, stop};
use crate::documents;
use crate::files;
use crate::jobs::batch::{BatchCertificate, BatchRow, Counts, Figures};
use crate::jobs::record::JobState;
use crate::problem::{Problem, ProblemKind};

/// Name of the file with the certificate of all.
pub(super) const CERTIFICATE: &str = "certificate.json";

/// Whether a document is one of a batch: of all documents they alone have jobs.
pub(super) fn is_one(document: &[u8]) -> bool {
    #[derive(Deserialize)]
    struct Members {
        #[serde(rename = "jobs")]
        _jobs: IgnoredAny,
    }
    serde_json::from_slice::<Members>(document).is_ok()
}

/// The folder of a job: its place and its name, so that no two are the same.
pub(super) fn folder_of_job(folder: &Path, index: usize, name: Option<&str>) -> PathBuf {
    folder.join(name.map_or_else(|| format!("{index:03}"), |name| format!("{index:03}-{}", files::safe_stem(name))))
}

/// Does all jobs of a batch; one that does not succeed keeps no other from it.
pub(super) fn run(bytes: Vec<u8>, args: &RunArgs, manner: Manner<'_>) -> Result<(), Problem> {
    if let Some(server) = manner.server {
        let document = remote::self_contained(bytes, |bytes| documents::whole_batch(bytes, folder_of(&args.job)));
        let (certificate, written) = remote::run_batch(server, document, &args.folder, &args.limits, manner)?;
        return tell(&certificate, &written);
    }
    let most = Limits::MOST;
    let jobs = documents::read_batch_in(&bytes, &most, folder_of(&args.job))?;
    drop(bytes);
    work::use_threads(args.limits.threads)?;
    // Every job has its own time and so its own token: the signal goes to the one whose turn it is.
    let current = Arc::new(Mutex::new(CancelToken::new()));
    let stopped = Arc::clone(&current);
    stop::on_signals_do(move || crate::locked(&stopped).fire(StopReason::Cancelled))?;
    let (mut rows, mut written) = (Vec::with_capacity(jobs.len()), Vec::new());
    for (index, (name, mut job)) in jobs.into_iter().enumerate() {
        let token = CancelToken::new();
        let before = std::mem::replace(&mut *crate::locked(&current), token.clone());
        if before.reason() == Some(StopReason::Cancelled) {
            return Err(Problem::new(
                ProblemKind::Cancelled,
                format!("stopped before the job {index} of the batch; those before it are done"),
            ));
        }
        let (kind, input_digest) = (job.kind, documents::job_digest(&job).to_string());
        job.limits = work::limits(job.limits, &args.limits);
        let folder = folder_of_job(&args.folder, index, name.as_deref());
        let done = work::make_in(&job, &folder, &token, manner);
        if token.reason() == Some(StopReason::Cancelled) {
            return Err(done.err().unwrap_or_else(|| Problem::new(ProblemKind::Cancelled, "stopped by the caller")));
        }
        let mut row = BatchRow {
            index: u32::try_from(index).unwrap_or(u32::MAX),
            name,
            job: None,
            kind,
            state: JobState::Succeeded,
            input_digest,
            progress: None,
            output_digests: std::collections::BTreeMap::new(),
            figures: None,
            warnings: Vec::new(),
            problem: None,
        };
        match done {
            Ok((certificate, files)) => {
                row.figures = Some(Figures::from(&certificate));
                let of_certificate = files.iter().find(|written| written.file.ends_with(CERTIFICATE));
                row.output_digests = certificate.output_digests.clone();
                row.output_digests.extend(of_certificate.map(|written| (CERTIFICATE.to_owned(), written.digest.to_string())));
                row.warnings = certificate.warnings;
                written.extend(files);
            }
            Err(problem) => {
                // Only if it is empty: nothing was made.
                let _ = std::fs::remove_dir(&folder);
                row.state = JobState::Failed;
                row.problem = Some(problem);
            }
        }
        rows.push(row);
    }
    let counts = Counts::of(rows.iter().map(|row| row.state));
    let certificate = BatchCertificate::of(None, counts, rows);
    written.push(work::write(&args.folder.join(CERTIFICATE), &certificate.bytes()?)?);
    tell(&certificate, &written)
}

/// Prints what was made; a problem if not all of it was.
fn tell(certificate: &BatchCertificate, written: &[Written]) -> Result<(), Problem> {
    print_json(&json!({ "outputs": written, "certificate": certificate }))?;
    let missing: Vec<String> = certificate.jobs.iter().filter(|row| row.state != JobState::Succeeded).map(missed).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let detail = format!("{} of {} jobs did not succeed: {}", missing.len(), certificate.jobs.len(), missing.join("; "));
    Err(Problem::new(ProblemKind::CheckFailed, detail).code("batch.incomplete"))
}

fn missed(row: &BatchRow) -> String {
    let name = row.name.clone().unwrap_or_else(|| row.index.to_string());
    let why = row.problem.as_ref().map_or_else(|| row.state.word().to_owned(), |problem| format!("{} [{}]", problem.detail, problem.code));
    format!("{name}: {why}")
}
