//! The workers: threads of their own, because geometry blocks and would starve the service's event loop.

use std::io::{self, Write as _};
use std::sync::{Arc, Mutex, mpsc};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use lacuna_exchange::format::Format;
use lacuna_fabrication::{Certificate, Geometry, Job, Outcome};
use lacuna_kernel::budget::{Budget, CancelToken, Limits, Progress, StopReason};

use super::desk::Desk;
use super::live::LiveJob;
use super::record::{Answer, Ending, JobState, Output};
use super::watchdog::Watchdog;
use crate::digest::Digest;
use crate::documents;
use crate::files::{self, PendingFile};
use crate::problem::{Problem, ProblemKind};
use crate::production::{self, Engine, Label};

/// Between two tries to reach an object store that is away.
const AWAY_PAUSE: Duration = Duration::from_millis(500);

/// Name of the certificate among a job's outputs.
const CERTIFICATE: &str = "certificate.json";

/// Threads that record what the workers made: they wait for the device or the network, and one wait of the device serves
/// several of them.
const RECORDERS: usize = 8;

/// The workers' threads get of a core what those that answer leave: the least priority of the usual kind.
#[cfg(unix)]
const NICENESS: i32 = 19;

/// Starts the workers, and the recorders behind them; all end when the desk is stopped.
///
/// # Errors
/// When the system has no thread to spare.
pub fn start(desk: &Arc<Desk>, count: usize, most: Limits, engine: Engine) -> io::Result<Vec<JoinHandle<()>>> {
    // Few may wait here: a worker that is much faster than the device has to wait for it.
    let (made, waiting) = mpsc::sync_channel::<Made>(RECORDERS);
    let waiting = Arc::new(Mutex::new(waiting));
    let mut threads = Vec::new();
    for number in 0..count {
        let (desk, made) = (Arc::clone(desk), made.clone());
        // Each has threads of its own: in a common pool the pieces of a small job would wait behind those of a large one.
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(rayon::current_num_threads())
            .thread_name(move |thread| format!("worker-{number}-{thread}"))
            .start_handler(|_| give_way())
            .build()
            .map_err(io::Error::other)?;
        threads.push(std::thread::Builder::new().name(format!("worker-{number}")).spawn(move || {
            while let Some(job) = desk.take() {
                if made.send(pool.install(|| work(&desk, job, &most, engine))).is_err() {
                    return;
                }
            }
        })?);
    }
    for number in 0..if count == 0 { 0 } else { RECORDERS } {
        let (desk, waiting) = (Arc::clone(desk), Arc::clone(&waiting));
        threads.push(std::thread::Builder::new().name(format!("recorder-{number}")).spawn(move || {
            while let Some(made) = next(&waiting) {
                record(&desk, made);
            }
        })?);
    }
    Ok(threads)
}

/// Geometry takes all cores for minutes, and an answer takes one for a moment: the answer goes first. Where that is not allowed, they share.
fn give_way() {
    #[cfg(unix)]
    if let Err(error) = rustix::process::nice(NICENESS) {
        tracing::debug!(%error, "a worker's thread keeps its priority");
    }
}

/// What comes next; none once all workers have ended. One recorder at a time waits here, the others behind it.
fn next(waiting: &Mutex<mpsc::Receiver<Made>>) -> Option<Made> {
    crate::locked(waiting).recv().ok()
}

/// What a worker made of a job.
struct Made {
    job: Arc<LiveJob>,
    since: Instant,
    result: Result<Files, Problem>,
}

/// The files of a job that has been done, not kept yet.
struct Files {
    files: Vec<(PendingFile, Output)>,
    certificate: Certificate,
}

/// Does a job that was taken, up to files that are written and verified.
fn work(desk: &Desk, job: Arc<LiveJob>, most: &Limits, engine: Engine) -> Made {
    let (kind, attempt) = job.with(|record| (record.view.kind, record.view.attempt));
    tracing::info!(job = %job.id(), kind = documents::kind_word(kind), attempt, "job started");
    let since = Instant::now();
    // The kernel's panics are caught where it is called; this catches our own, so that a worker never dies.
    let result = production::guarded(|| perform(desk, &job, most, engine)).and_then(|result| result);
    Made { job, since, result }
}

/// Keeps what a job made, and records its end.
fn record(desk: &Desk, made: Made) {
    let Made { job, since, result } = made;
    let ending = match result.and_then(|files| keep(desk, &job, files)) {
        Ok(answer) => Ending::Done(Box::new(answer)),
        Err(_) if job.cancel.reason() == Some(StopReason::Cancelled) => Ending::Stopped,
        Err(problem) => {
            if problem.is_defect() {
                tracing::error!(job = %job.id(), code = %problem.code, detail = %problem.detail, "defect");
            }
            Ending::Failed(Box::new(problem.in_public()))
        }
    };
    let Some(state) = desk.conclude(&job, &ending) else {
        tracing::warn!(job = %job.id(), "the job is no longer this worker's");
        return;
    };
    if let (JobState::Cancelled, Some(time)) = (state, job.stopped_for()) {
        desk.metrics.stopped_after(time);
    }
    let (kind, time) = (documents::kind_word(job.with(|record| record.view.kind)), since.elapsed());
    desk.metrics.ended(kind, state, time);
    tracing::info!(job = %job.id(), kind, state = state.word(), milliseconds = time.as_millis(), "job ended");
}

fn perform(desk: &Desk, job: &Arc<LiveJob>, most: &Limits, engine: Engine) -> Result<Files, Problem> {
    if job.cancel.reason().is_some() {
        return Err(Problem::new(ProblemKind::Cancelled, "stopped before the start"));
    }
    let (document, input) = job.with(|record| (record.document, record.view.input_digest.clone()));
    let failed = |error| Problem::io("the job document could not be read", &error);
    let bytes = while_away(&job.cancel, || desk.store.document(document)).map_err(failed)?;
    let order = documents::read_order(&bytes, most, &|reference| desk.store.referred(reference))?.job;
    let budget = budget(job, order.limits);
    let _watchdog =
        Watchdog::start(&job.cancel, order.limits.seconds).map_err(|error| Problem::io("no thread to watch the time", &error))?;
    let made = (engine.compute)(&order, &budget).map_err(|problem| problem.under_model()).and_then(|mut outcome| {
        outcome.certificate.input_digest = input;
        write_files(desk, &order, outcome, &budget)
    });
    made.map_err(|problem| production::why_stopped(&budget).unwrap_or(problem))
}

/// Tries until the object store is back, or the job is stopped: work that is done is not thrown away.
fn while_away<T>(token: &CancelToken, mut attempt: impl FnMut() -> io::Result<T>) -> io::Result<T> {
    loop {
        match attempt() {
            Err(error) if error.kind() == io::ErrorKind::NetworkUnreachable && token.reason().is_none() => {
                std::thread::sleep(AWAY_PAUSE);
            }
            done => return done,
        }
    }
}

fn budget(job: &Arc<LiveJob>, limits: Limits) -> Budget {
    let listener = Arc::clone(job);
    let sink = move |progress: &Progress| listener.progress(progress);
    Budget { limits, cancel: job.cancel.clone(), progress: Some(Arc::new(sink)) }
}

/// Writes and verifies every output, the certificate last because it names the others' digests.
fn write_files(desk: &Desk, order: &Job, mut outcome: Outcome, budget: &Budget) -> Result<Files, Problem> {
    let model = order.inputs.first();
    let title = model.map(|input| input.name.as_str());
    let stem = files::safe_stem(title.unwrap_or("result"));
    let formats: Vec<Format> = order.outputs.iter().map(|name| documents::format(name)).collect::<Result<_, _>>()?;
    let thumbnail = match (&outcome.geometry, formats.contains(&Format::ThreeMf)) {
        (Geometry::Solid(_) | Geometry::Parts(_), true) => Some(production::picture(&outcome)?),
        _ => None,
    };
    let mut files = Vec::with_capacity(formats.len() + 1);
    let failed = |error| Problem::io("the result could not be written", &error);
    for (done, &format) in formats.iter().enumerate() {
        if let Some(stopped) = production::why_stopped(budget) {
            return Err(stopped);
        }
        #[expect(clippy::cast_precision_loss, reason = "a share of a handful of files")]
        budget.report("write", done as f64 / formats.len() as f64, outcome.certificate.triangles);
        let facts = format.facts();
        let mut pending = desk.store.new_result().map_err(failed)?;
        let label = Label { title, thumbnail_png: thumbnail.as_deref() };
        let (digest, bytes) = production::write_file(format, &outcome, &label, &mut pending, &budget.cancel)?;
        let file_name = format!("{stem}.{}", facts.ending);
        let output = Output { name: facts.ending.to_owned(), file_name, media_type: facts.media_type.to_owned(), bytes, digest };
        files.push((pending, output));
    }
    // Only now: a file holds what was known before any was written, whatever is written beside it.
    for (_, output) in &files {
        outcome.certificate.output_digests.insert(output.name.clone(), output.digest.to_string());
    }
    let bytes = production::certificate_file(&outcome.certificate)?;
    let mut pending = desk.store.new_result().map_err(failed)?;
    pending.write_all(&bytes).map_err(failed)?;
    let output = Output {
        name: CERTIFICATE.to_owned(),
        file_name: CERTIFICATE.to_owned(),
        media_type: "application/json".to_owned(),
        bytes: bytes.len() as u64,
        digest: Digest::of(&bytes),
    };
    files.push((pending, output));
    desk.metrics.made(outcome.certificate.triangles, files.iter().map(|(_, output)| output.bytes).sum());
    Ok(Files { files, certificate: outcome.certificate })
}

/// Puts the files into their places. Whatever is recorded afterwards is there.
fn keep(desk: &Desk, job: &LiveJob, made: Files) -> Result<Answer, Problem> {
    let mut outputs = Vec::with_capacity(made.files.len());
    for (mut pending, output) in made.files {
        let kept = while_away(&job.cancel, || desk.store.keep_result(&mut pending, output.digest));
        kept.map_err(|error| Problem::io("the result could not be kept", &error))?;
        outputs.push(output);
    }
    Ok(Answer { outputs, certificate: made.certificate })
}
