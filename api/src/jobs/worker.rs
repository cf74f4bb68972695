//! The workers: threads that take jobs, have them done, each in a process of its own, and see to it that the end is recorded.

use std::cell::RefCell;
use std::io;
use std::sync::{Arc, Mutex, mpsc};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use lacuna_kernel::budget::{Budget, CancelToken, Limits, Progress, StopReason};

use super::desk::Desk;
use super::live::{LiveJob, Phase};
use super::making::{self, Files, Task, Workshop};
use super::process::Place;
use super::record::{Answer, Ending, JobState, Step};
use super::watchdog::Watchdog;
use crate::documents::{self, Stored};
use crate::files::PendingFile;
use crate::problem::{Problem, ProblemKind};
use crate::production::{self, Engine};
use crate::store::Store;
use crate::traces::{self, Context, Span, SpanKind};

/// Between two tries to reach an object store that is away.
const AWAY_PAUSE: Duration = Duration::from_millis(500);

/// Threads that record what the workers made: they wait for the device or the network, and one wait of the device serves
/// several of them.
const RECORDERS: usize = 8;

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
        threads.push(std::thread::Builder::new().name(format!("worker-{number}")).spawn(move || {
            let mut place = Place::default();
            while let Some(job) = desk.take() {
                let done = work(&desk, job, &most, engine, &mut place);
                if done.job.cancel.reason() == Some(StopReason::Cancelled) {
                    // Nothing is to be kept of it, and it does not stand behind what is.
                    record(&desk, done);
                } else if made.send(done).is_err() {
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

/// Does a job that was taken, up to files that are written and verified.
fn work(desk: &Desk, job: Arc<LiveJob>, most: &Limits, engine: Engine, place: &mut Place) -> Made {
    let (kind, attempt) = job.with(|record| (record.view.kind, record.view.attempt));
    tracing::info!(job = %job.id(), kind = documents::kind_word(kind), attempt, "job started");
    let since = Instant::now();
    // The kernel's panics are caught where it is called; this catches our own, so that a worker never dies.
    let result = production::guarded(|| perform(desk, &job, most, engine, place)).and_then(|result| result);
    Made { job, since, result }
}

/// Keeps what a job made, and records its end.
fn record(desk: &Desk, made: Made) {
    let Made { job, since, result } = made;
    let ending = match result.and_then(|files| keep(desk, &job, files)) {
        Ok(answer) => {
            desk.metrics.made(answer.certificate.triangles, answer.outputs.iter().map(|output| output.bytes).sum());
            Ending::Done(Box::new(answer))
        }
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
    let (phases, end) = (job.take_phases(), Instant::now());
    let ends = phases.iter().skip(1).map(|phase| phase.began).chain([end]);
    for (phase, end) in phases.iter().zip(ends) {
        desk.metrics.phase(kind, &phase.name, end.duration_since(phase.began));
    }
    trace(&job, kind, state, time, phases);
    tracing::info!(job = %job.id(), kind, state = state.word(), milliseconds = time.as_millis(), "job ended");
}

/// Tells of an attempt and of its phases, each of which lasts until the next one begins.
fn trace(job: &LiveJob, kind: &str, state: JobState, time: Duration, phases: Vec<Phase>) {
    if !traces::wanted() {
        return;
    }
    let end = SystemTime::now();
    let parent = job.with(|record| record.trace);
    let context = parent.map_or_else(Context::new, Context::child);
    let span = |name: String, kind, context, parent, start, end, attributes| {
        traces::tell(Span { name, kind, context, parent, start, end, attributes, failed: state == JobState::Failed });
    };
    let ends: Vec<SystemTime> = phases.iter().skip(1).map(|phase| phase.since).chain([end]).collect();
    for (phase, ended) in phases.into_iter().zip(ends) {
        let computed = vec![("lacuna.process.pid", phase.process.into())];
        span(phase.name, SpanKind::Internal, context.child(), Some(context), phase.since, ended, computed);
    }
    let (id, attempt) = job.with(|record| (record.view.id.clone(), record.view.attempt));
    let attributes = vec![
        ("lacuna.job.id", id.into()),
        ("lacuna.job.kind", kind.into()),
        ("lacuna.job.state", state.word().into()),
        ("lacuna.job.attempt", attempt.into()),
    ];
    span(format!("job {kind}"), SpanKind::Consumer, context, parent, end.checked_sub(time).unwrap_or(end), end, attributes);
}

fn perform(desk: &Desk, job: &Arc<LiveJob>, most: &Limits, engine: Engine, place: &mut Place) -> Result<Files, Problem> {
    if job.cancel.reason().is_some() {
        return Err(Problem::new(ProblemKind::Cancelled, "stopped before the start"));
    }
    let (document, input_digest) = job.with(|record| (record.document, record.view.input_digest.clone()));
    let failed = |error| Problem::io("the job document could not be read", &error);
    let document = while_away(&job.cancel, || desk.store.document(document)).map_err(failed)?;
    let task = Task { document, most: *most, input_digest };
    match engine.here {
        None => place.perform(&task, job, &desk.store, rayon::current_num_threads()),
        Some(compute) => making::make(&task, compute, &Here { job, store: &desk.store, watchdog: RefCell::default() }),
    }
}

/// The service's own process as the place of work.
struct Here<'a> {
    job: &'a Arc<LiveJob>,
    store: &'a Store,
    watchdog: RefCell<Option<Watchdog>>,
}

impl Workshop for Here<'_> {
    fn stored(&self, reference: &str) -> Option<Stored> {
        self.store.referred(reference)
    }

    fn begin(&self, limits: Limits) -> Result<Budget, Problem> {
        let failed = |error| Problem::io("no thread to watch the time", &error);
        *self.watchdog.borrow_mut() = Some(Watchdog::start(&self.job.cancel, limits.seconds).map_err(failed)?);
        let listener = Arc::clone(self.job);
        let sink = move |progress: &Progress| listener.progress(Step::from(progress), std::process::id());
        Ok(Budget { limits, cancel: self.job.cancel.clone(), progress: Some(Arc::new(sink)), ..Budget::default() })
    }

    fn new_file(&self) -> io::Result<PendingFile> {
        self.store.new_result()
    }
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
