//! The workers: threads of their own, because geometry blocks and would starve the service's event loop.

use std::io;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use lacuna_exchange::format::Format;
use lacuna_fabrication::{Geometry, Job, Outcome};
use lacuna_kernel::budget::{Budget, CancelToken, Limits, Progress, StopReason};

use super::desk::Desk;
use super::live::LiveJob;
use super::record::{Answer, Ending, JobState, Output};
use super::watchdog::Watchdog;
use crate::digest::Digest;
use crate::problem::{Problem, ProblemKind};
use crate::production::{self, Engine, Label};
use crate::{documents, files};

/// Between two tries to reach an object store that is away.
const AWAY_PAUSE: Duration = Duration::from_millis(500);

/// Name of the certificate among a job's outputs.
const CERTIFICATE: &str = "certificate.json";

/// Starts the workers; they end when the desk is stopped.
///
/// # Errors
/// When the system has no thread to spare.
pub fn start(desk: &Arc<Desk>, count: usize, most: Limits, engine: Engine) -> std::io::Result<Vec<JoinHandle<()>>> {
    (0..count)
        .map(|number| {
            let desk = Arc::clone(desk);
            std::thread::Builder::new().name(format!("worker-{number}")).spawn(move || {
                while let Some(job) = desk.take() {
                    work(&desk, &job, &most, engine);
                }
            })
        })
        .collect()
}

/// Does a job that was taken, up to the record of its end.
fn work(desk: &Desk, job: &Arc<LiveJob>, most: &Limits, engine: Engine) {
    let (kind, attempt) = job.with(|record| (record.view.kind, record.view.attempt));
    tracing::info!(job = %job.id(), kind = documents::kind_word(kind), attempt, "job started");
    let start = Instant::now();
    // The kernel's panics are caught where it is called; this catches our own, so that a worker never dies.
    let result = production::guarded(|| perform(desk, job, most, engine)).and_then(|result| result);
    let ending = match result {
        Ok(answer) => Ending::Done(Box::new(answer)),
        Err(_) if job.cancel.reason() == Some(StopReason::Cancelled) => Ending::Stopped,
        Err(problem) => {
            if problem.is_defect() {
                tracing::error!(job = %job.id(), code = %problem.code, detail = %problem.detail, "defect");
            }
            Ending::Failed(Box::new(problem.in_public()))
        }
    };
    let Some(state) = desk.conclude(job, &ending) else {
        tracing::warn!(job = %job.id(), "the job is no longer this worker's");
        return;
    };
    if let (JobState::Cancelled, Some(time)) = (state, job.stopped_for()) {
        desk.metrics.stopped_after(time);
    }
    let time = start.elapsed();
    desk.metrics.ended(documents::kind_word(kind), state, time);
    tracing::info!(job = %job.id(), kind = documents::kind_word(kind), state = state.word(), milliseconds = time.as_millis(), "job ended");
}

fn perform(desk: &Desk, job: &Arc<LiveJob>, most: &Limits, engine: Engine) -> Result<Answer, Problem> {
    if job.cancel.reason().is_some() {
        return Err(Problem::new(ProblemKind::Cancelled, "stopped before the start"));
    }
    let (document, input) = job.with(|record| (record.document, record.view.input_digest.clone()));
    let bytes = while_away(&job.cancel, || desk.store.document(document))
        .map_err(|error| Problem::io("the job document could not be read", &error))?;
    let order = documents::read_order(&bytes, most, &|reference| desk.store.referred(reference))?.job;
    let budget = budget(job, order.limits);
    let _watchdog =
        Watchdog::start(&job.cancel, order.limits.seconds).map_err(|error| Problem::io("no thread to watch the time", &error))?;
    let made = (engine.compute)(&order, &budget).map_err(|problem| problem.under_model()).and_then(|mut outcome| {
        outcome.certificate.input_digest = input;
        keep_files(desk, &order, outcome, &budget)
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

/// Writes, verifies and keeps every output, the certificate last because it names the others' digests.
fn keep_files(desk: &Desk, order: &Job, mut outcome: Outcome, budget: &Budget) -> Result<Answer, Problem> {
    let model = order.inputs.first();
    let title = model.map(|input| input.name.as_str());
    let stem = files::safe_stem(title.unwrap_or("result"));
    let formats: Vec<Format> = order.outputs.iter().map(|name| documents::format(name)).collect::<Result<_, _>>()?;
    let thumbnail = match (&outcome.geometry, formats.contains(&Format::ThreeMf)) {
        (Geometry::Solid(_) | Geometry::Parts(_), true) => Some(production::picture(&outcome)?),
        _ => None,
    };
    let mut outputs = Vec::with_capacity(formats.len() + 1);
    let failed = |error| Problem::io("the result could not be kept", &error);
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
        while_away(&budget.cancel, || desk.store.keep_result(&mut pending, digest)).map_err(failed)?;
        let file_name = format!("{stem}.{}", facts.ending);
        outputs.push(Output { name: facts.ending.to_owned(), file_name, media_type: facts.media_type.to_owned(), bytes, digest });
    }
    for output in &outputs {
        outcome.certificate.output_digests.insert(output.name.clone(), output.digest.to_string());
    }
    outputs.push(keep_certificate(desk, &outcome, budget)?);
    desk.metrics.made(outcome.certificate.triangles, outputs.iter().map(|output| output.bytes).sum());
    Ok(Answer { outputs, certificate: outcome.certificate })
}

fn keep_certificate(desk: &Desk, outcome: &Outcome, budget: &Budget) -> Result<Output, Problem> {
    use std::io::Write as _;
    let bytes = production::certificate_file(&outcome.certificate)?;
    let digest = Digest::of(&bytes);
    let failed = |error| Problem::io("the certificate could not be kept", &error);
    let mut pending = desk.store.new_result().map_err(failed)?;
    pending.write_all(&bytes).map_err(failed)?;
    while_away(&budget.cancel, || desk.store.keep_result(&mut pending, digest)).map_err(failed)?;
    let name = CERTIFICATE.to_owned();
    Ok(Output { file_name: name.clone(), name, media_type: "application/json".to_owned(), bytes: bytes.len() as u64, digest })
}
