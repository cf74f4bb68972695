//! The desk: accepts jobs, knows them all, hands them to workers, stops and forgets them, over either ledger.
//!
//! Methods that may write block, and belong beside the event loop; those that only look are `async`.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use lacuna_fabrication::JobKind;
use lacuna_kernel::budget::Limits;
use tokio::runtime::Handle;
use uuid::Uuid;

use super::batch::{Batch, BatchRecord, Member};
use super::embedded::Embedded;
use super::live::LiveJob;
use super::record::{Ending, Idempotency, JobRecord, JobState, JobView, Output};
use super::refusal;
use super::shared::Shared;
use crate::digest::Digest;
use crate::metrics::Metrics;
use crate::orders::Ordered;
use crate::problem::Problem;
use crate::store::Store;
use crate::traces::Context;

/// A job that was read and found legal.
#[derive(Clone, Debug)]
pub struct Submission {
    /// Whose it is.
    pub owner: String,
    /// What it does.
    pub kind: JobKind,
    /// The job document that a worker will read.
    pub document: Vec<u8>,
    /// Digest of the canonical document, but for its limits.
    pub input_digest: Digest,
    /// What it may use.
    pub limits: Limits,
    /// Idempotency key and body, if a key was given.
    pub idempotency: Option<Idempotency>,
    /// The span of the request, if anybody wants traces.
    pub trace: Option<Context>,
}

impl Submission {
    /// The submission of an owner's order.
    #[must_use]
    pub fn of(owner: &str, order: Ordered, idempotency: Option<Idempotency>, trace: Option<Context>) -> Self {
        Self {
            owner: owner.to_owned(),
            kind: order.kind,
            limits: order.limits(),
            document: order.document.into_bytes(),
            input_digest: order.input_digest,
            idempotency,
            trace,
        }
    }
}

/// A batch that was read and found legal.
#[derive(Clone, Debug)]
pub struct BatchSubmission {
    /// Whose it is.
    pub owner: String,
    /// Its jobs, with what it calls them; none has an idempotency key of its own.
    pub jobs: Vec<(Option<String>, Submission)>,
    /// Idempotency key and body, if a key was given.
    pub idempotency: Option<Idempotency>,
}

/// How many jobs there may be.
#[derive(Clone, Copy, Debug)]
pub struct DeskLimits {
    /// Waiting jobs of all owners.
    pub queued: usize,
    /// Unfinished jobs of one owner.
    pub per_owner: usize,
}

/// What is kept of jobs that have ended, and how long.
#[derive(Clone, Copy, Debug)]
pub struct Retention {
    /// Time for which a job is kept with all that it made.
    pub jobs: Duration,
    /// Time after that for which is kept that there was such a job.
    pub records: Duration,
    /// Most of such records; the oldest go first.
    pub most_records: usize,
}

/// An output that an owner's job made.
#[derive(Clone, Debug)]
pub struct Made {
    /// What is known of it.
    pub output: Output,
    /// Whether all jobs of the owner that made it have expired.
    pub expired: bool,
}

/// Which jobs are listed.
#[derive(Clone, Debug, Default)]
pub struct JobFilter {
    /// Only jobs in this state.
    pub state: Option<JobState>,
    /// Only jobs of this kind.
    pub kind: Option<JobKind>,
    /// Only jobs with smaller ids.
    pub before: Option<String>,
}

impl JobFilter {
    pub(super) fn wants(&self, view: &JobView) -> bool {
        self.state.is_none_or(|state| view.state == state) && self.kind.is_none_or(|kind| view.kind == kind)
    }
}

/// How many jobs there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gauges {
    /// Jobs that wait.
    pub queued: u64,
    /// Jobs that workers are at.
    pub running: u64,
    /// Jobs whose record is kept.
    pub kept: u64,
}

/// The desk.
#[derive(Debug)]
pub struct Desk {
    ledger: Ledger,
    stopping: AtomicBool,
    /// Where documents and results are kept.
    pub store: Arc<Store>,
    /// What is counted.
    pub metrics: Arc<Metrics>,
}

#[derive(Debug)]
enum Ledger {
    Embedded(Box<Embedded>),
    Shared(Arc<Shared>),
}

impl Desk {
    /// Opens the ledger of a data folder and takes up what an earlier process left in it.
    ///
    /// # Errors
    /// When the data folder fails.
    pub fn open(root: &Path, store: Arc<Store>, limits: DeskLimits, metrics: Arc<Metrics>) -> std::io::Result<Self> {
        let ledger = Ledger::Embedded(Box::new(Embedded::open(root, Arc::clone(&store), limits)?));
        Ok(Self { ledger, stopping: AtomicBool::new(false), store, metrics })
    }

    /// Opens the ledger of a database; a worker is given up when nothing was heard of it for the time of its lease.
    ///
    /// # Errors
    /// When the database cannot be reached or used.
    pub async fn open_shared(
        database: &str,
        lease: Duration,
        store: Arc<Store>,
        limits: DeskLimits,
        metrics: Arc<Metrics>,
    ) -> Result<Self, Problem> {
        let ledger = Ledger::Shared(Shared::open(database, lease, Arc::clone(&store), limits, Handle::current()).await?);
        Ok(Self { ledger, stopping: AtomicBool::new(false), store, metrics })
    }

    /// Accepts a job, or hands out the one that the same idempotency key made; tells which of the two.
    ///
    /// # Errors
    /// When too many jobs wait, the service stops, the key was used otherwise, or the ledger or the store fails.
    pub fn submit(&self, submission: Submission) -> Result<(Arc<LiveJob>, bool), Problem> {
        if self.is_stopping() {
            return Err(refusal::stopping());
        }
        let record = self.recorded(vec![submission])?.remove(0);
        let (job, replayed) = match &self.ledger {
            Ledger::Embedded(ledger) => ledger.submit(record),
            Ledger::Shared(ledger) => ledger.submit(record),
        }?;
        if !replayed {
            self.count(&job);
        }
        Ok((job, replayed))
    }

    /// The job that an owner's idempotency key has made of the same body, whatever has become since of what that names. It blocks.
    ///
    /// # Errors
    /// When the key was used with another body, or the ledger fails.
    pub fn made_by(&self, owner: &str, used: &Idempotency) -> Result<Option<Arc<LiveJob>>, Problem> {
        match &self.ledger {
            Ledger::Embedded(ledger) => ledger.made_by(owner, used),
            Ledger::Shared(ledger) => ledger.made_by(owner, used),
        }
    }

    /// The batch that an owner's idempotency key has made of the same body, as [`Desk::made_by`] tells of jobs.
    ///
    /// # Errors
    /// As [`Desk::made_by`].
    pub fn batch_made_by(&self, owner: &str, used: &Idempotency) -> Result<Option<Batch>, Problem> {
        match &self.ledger {
            Ledger::Embedded(ledger) => ledger.batch_made_by(owner, used),
            Ledger::Shared(ledger) => ledger.batch_made_by(owner, used),
        }
    }

    /// The records of new jobs, whose documents are kept.
    fn recorded(&self, submissions: Vec<Submission>) -> Result<Vec<JobRecord>, Problem> {
        let digests = submissions.iter().map(|submission| Digest::of(&submission.document));
        let documents: Vec<(Digest, &[u8])> = digests.zip(submissions.iter().map(|submission| submission.document.as_slice())).collect();
        self.store.keep_documents(&documents).map_err(|error| Problem::io("the job could not be recorded", &error))?;
        let digests: Vec<Digest> = documents.into_iter().map(|(digest, _)| digest).collect();
        Ok(submissions.into_iter().zip(digests).map(|(submission, document)| new_record(submission, document)).collect())
    }

    /// Counts a job that was accepted.
    fn count(&self, job: &LiveJob) {
        self.metrics.accepted();
        if job.with(|record| record.view.reused) {
            self.metrics.reused();
        }
    }

    /// Accepts a batch, all of its jobs or none, or hands out the one that the same idempotency key made; tells which of the two.
    ///
    /// # Errors
    /// As [`Desk::submit`].
    pub fn submit_batch(&self, submission: BatchSubmission) -> Result<(Batch, bool), Problem> {
        if self.is_stopping() {
            return Err(refusal::stopping());
        }
        let BatchSubmission { owner, jobs, idempotency } = submission;
        let id = format!("bat_{}", Uuid::now_v7().simple());
        let (names, jobs): (Vec<_>, Vec<_>) = jobs.into_iter().unzip();
        let mut records = self.recorded(jobs)?;
        let mut members = Vec::with_capacity(records.len());
        for (name, record) in names.into_iter().zip(&mut records) {
            record.view.batch = Some(id.clone());
            let JobView { id: job, kind, input_digest, .. } = record.view.clone();
            members.push(Member { name, job, kind, input_digest });
        }
        let record = BatchRecord { id, owner, created: crate::clock::now(), jobs: members, idempotency };
        let (batch, replayed) = match &self.ledger {
            Ledger::Embedded(ledger) => ledger.submit_batch(record, records),
            Ledger::Shared(ledger) => ledger.submit_batch(record, records),
        }?;
        if !replayed {
            batch.jobs.iter().flatten().for_each(|job| self.count(job));
        }
        Ok((batch, replayed))
    }

    /// An owner's batch.
    ///
    /// # Errors
    /// As [`Desk::find`].
    pub async fn find_batch(&self, owner: &str, id: &str) -> Result<Option<Batch>, Problem> {
        match &self.ledger {
            Ledger::Embedded(ledger) => Ok(ledger.find_batch(owner, id)),
            Ledger::Shared(ledger) => ledger.find_batch(owner, id).await,
        }
    }

    /// Stops the jobs of a batch that have not ended. Those that wait have stopped when this returns.
    ///
    /// # Errors
    /// When the ledger fails; then some may have been stopped, and the same call stops the others.
    pub fn cancel_batch(&self, batch: &Batch) -> Result<(), Problem> {
        // From the end, so that no worker takes up what is about to be stopped.
        let left = batch.jobs.iter().rev().flatten().filter(|job| !job.state().is_final());
        left.into_iter().try_for_each(|job| self.cancel(job).map(drop))
    }

    /// Stops the jobs of a batch and forgets all of it.
    ///
    /// # Errors
    /// When the ledger fails.
    pub fn forget_batch(&self, batch: &Batch) -> Result<(), Problem> {
        self.cancel_batch(batch)?;
        match &self.ledger {
            Ledger::Embedded(ledger) => ledger.forget_batch(batch).map_err(|error| Problem::io("the batch could not be forgotten", &error)),
            Ledger::Shared(ledger) => ledger.forget_batch(batch),
        }
    }

    /// An owner's job.
    ///
    /// # Errors
    /// When the ledger cannot be asked.
    pub async fn find(&self, owner: &str, id: &str) -> Result<Option<Arc<LiveJob>>, Problem> {
        match &self.ledger {
            Ledger::Embedded(ledger) => Ok(ledger.find(owner, id)),
            Ledger::Shared(ledger) => ledger.find(owner, id).await,
        }
    }

    /// An owner's jobs that a filter wants, the newest first.
    ///
    /// # Errors
    /// As [`Desk::find`].
    pub async fn page(&self, owner: &str, filter: &JobFilter, length: usize) -> Result<Vec<JobView>, Problem> {
        match &self.ledger {
            Ledger::Embedded(ledger) => Ok(ledger.page(owner, filter, length)),
            Ledger::Shared(ledger) => ledger.page(owner, filter, length).await,
        }
    }

    /// The output with this digest, if one of the owner's jobs made it; one that is kept goes before those that have expired.
    ///
    /// # Errors
    /// As [`Desk::find`].
    pub async fn find_output(&self, owner: &str, digest: Digest) -> Result<Option<Made>, Problem> {
        match &self.ledger {
            Ledger::Embedded(ledger) => Ok(ledger.find_output(owner, digest)),
            Ledger::Shared(ledger) => ledger.find_output(owner, digest).await,
        }
    }

    /// How many jobs there are.
    ///
    /// # Errors
    /// As [`Desk::find`].
    pub async fn gauges(&self) -> Result<Gauges, Problem> {
        match &self.ledger {
            Ledger::Embedded(ledger) => Ok(ledger.gauges()),
            Ledger::Shared(ledger) => ledger.gauges().await,
        }
    }

    /// Stops a job. One that waits has stopped when this returns; one that runs stops soon.
    ///
    /// # Errors
    /// When the ledger fails.
    pub fn cancel(&self, job: &LiveJob) -> Result<JobView, Problem> {
        match &self.ledger {
            Ledger::Embedded(ledger) => ledger.cancel(job).map_err(|error| Problem::io("the job could not be recorded", &error)),
            Ledger::Shared(ledger) => ledger.cancel(job),
        }
    }

    /// Stops a job if needed and forgets it.
    ///
    /// # Errors
    /// When it belongs to a batch, or the ledger fails.
    pub fn forget(&self, job: &LiveJob) -> Result<(), Problem> {
        if let Some(batch) = job.with(|record| record.view.batch.clone()) {
            return Err(refusal::of_a_batch(&batch));
        }
        match &self.ledger {
            Ledger::Embedded(ledger) => ledger.forget(job).map_err(|error| Problem::io("the job could not be forgotten", &error)),
            Ledger::Shared(ledger) => ledger.forget(job),
        }
    }

    /// Waits for the next job to work on, whose start is recorded; none once the desk is stopped.
    pub fn take(&self) -> Option<Arc<LiveJob>> {
        match &self.ledger {
            Ledger::Embedded(ledger) => ledger.take(),
            Ledger::Shared(ledger) => ledger.take(),
        }
    }

    /// Records how a worker's job ended and tells its state. The work is done: when it cannot be recorded now (a full
    /// disk, a database that is away) this tries until it can, or until the service ends. None if the job is somebody
    /// else's by now.
    pub fn conclude(&self, job: &LiveJob, ending: &Ending) -> Option<JobState> {
        let mut pause = Duration::from_millis(100);
        loop {
            let recorded = match &self.ledger {
                Ledger::Embedded(ledger) => {
                    ledger.conclude(job, ending).map(Some).map_err(|error| Problem::io("the end of a job could not be recorded", &error))
                }
                Ledger::Shared(ledger) => ledger.conclude(job, ending),
            };
            match recorded {
                Ok(state) => return state,
                Err(problem) => {
                    tracing::error!(job = %job.id(), detail = %problem.detail, "the end of a job is not recorded yet");
                    if self.is_stopping() && pause > Duration::from_secs(1) {
                        // The next start, or another worker, does the work again.
                        return None;
                    }
                }
            }
            std::thread::sleep(pause);
            pause = (pause * 2).min(Duration::from_secs(2));
        }
    }

    /// Whether jobs can be accepted now.
    ///
    /// # Errors
    /// When the ledger or the store cannot be used.
    pub fn probe(&self) -> Result<(), Problem> {
        self.store.probe().map_err(|error| Problem::io("documents and results cannot be kept", &error))?;
        match &self.ledger {
            Ledger::Embedded(_) => Ok(()),
            Ledger::Shared(ledger) => ledger.probe(),
        }
    }

    /// Lets jobs expire and forgets expired ones, as old as each may become, then removes files that no job has. Tells how many files went.
    ///
    /// # Errors
    /// When the ledger or the store fails.
    pub fn sweep(&self, retention: Retention) -> Result<usize, Problem> {
        match &self.ledger {
            Ledger::Embedded(ledger) => ledger.sweep(retention).map_err(|error| Problem::io("sweeping", &error)),
            Ledger::Shared(ledger) => ledger.sweep(retention),
        }
    }

    /// Accepts and hands out no more jobs.
    pub fn stop(&self) {
        self.stopping.store(true, Ordering::SeqCst);
        match &self.ledger {
            Ledger::Embedded(ledger) => ledger.close(),
            Ledger::Shared(ledger) => ledger.close(),
        }
    }

    /// Whether the service goes down.
    #[must_use]
    pub fn is_stopping(&self) -> bool {
        self.stopping.load(Ordering::SeqCst)
    }

    /// Stops what runs in this process, so that it is taken up again.
    pub fn interrupt(&self) {
        match &self.ledger {
            Ledger::Embedded(ledger) => ledger.interrupt(),
            Ledger::Shared(ledger) => ledger.interrupt(),
        }
    }
}

/// Under which name finished work is found again: by the work, by the version that did it, and by the limits that decide how it ends. A job with a lower limit of triangles is refused
/// what one with a higher one got, and where searches end early for want of cells or memory they say less. The time is left out: what is done already takes none.
fn work_of(input: Digest, limits: &Limits) -> Digest {
    let Limits { seconds: _, memory_bytes, cells, triangles, depth, output_bytes } = limits;
    Digest::of(format!("{input} {} {memory_bytes} {cells} {triangles} {depth} {output_bytes}", env!("CARGO_PKG_VERSION")).as_bytes())
}

fn new_record(submission: Submission, document: Digest) -> JobRecord {
    let view = JobView {
        id: format!("job_{}", Uuid::now_v7().simple()),
        kind: submission.kind,
        batch: None,
        state: JobState::Queued,
        attempt: 0,
        handed_back: 0,
        created: crate::clock::now(),
        started: None,
        finished: None,
        expired: None,
        progress: None,
        input_digest: submission.input_digest.to_string(),
        reused: false,
        outputs: Vec::new(),
        certificate: None,
        warnings: Vec::new(),
        problem: None,
    };
    let work = work_of(submission.input_digest, &submission.limits);
    JobRecord { view, owner: submission.owner, document, work, idempotency: submission.idempotency, trace: submission.trace }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::problem::ProblemKind;

    fn desk(root: &std::path::Path) -> Desk {
        let store = Arc::new(Store::open(root).unwrap());
        Desk::open(root, store, DeskLimits { queued: 2, per_owner: 10 }, Arc::default()).unwrap()
    }

    fn submission(body: &str, key: Option<&str>) -> Submission {
        Submission {
            owner: "ada".into(),
            kind: JobKind::Measure,
            document: body.as_bytes().to_vec(),
            input_digest: Digest::of(body.as_bytes()),
            limits: Limits::default(),
            trace: None,
            idempotency: key.map(|key| Idempotency { key: Digest::of(key.as_bytes()), body: Digest::of(body.as_bytes()) }),
        }
    }

    fn folder() -> std::path::PathBuf {
        std::env::temp_dir().join(format!("lacuna-desk-{}", Uuid::now_v7()))
    }

    #[test]
    fn a_key_makes_one_job() {
        let root = folder();
        let desk = desk(&root);
        let (first, replayed) = desk.submit(submission("{}", Some("k"))).unwrap();
        assert!(!replayed);
        let (again, replayed) = desk.submit(submission("{}", Some("k"))).unwrap();
        assert!(replayed && Arc::ptr_eq(&first, &again));
        assert_eq!(desk.submit(submission("[]", Some("k"))).unwrap_err().kind, ProblemKind::IdempotencyMismatch);
        desk.submit(submission("{}", None)).unwrap();
        assert_eq!(desk.submit(submission("{}", Some("new"))).unwrap_err().kind, ProblemKind::TooManyJobs);
        // The refusal did not burn the key.
        desk.cancel(&first).unwrap();
        assert!(!desk.submit(submission("{}", Some("new"))).unwrap().1);
        std::fs::remove_dir_all(root).unwrap();
    }

    fn look(desk: &Desk, owner: &str, id: &str) -> Option<Arc<LiveJob>> {
        let Ledger::Embedded(ledger) = &desk.ledger else { panic!("a data folder is embedded") };
        ledger.find(owner, id)
    }

    #[test]
    fn a_restart_takes_jobs_up_again_once() {
        let root = folder();
        let id = {
            let desk = desk(&root);
            let (job, _) = desk.submit(submission("{}", Some("k"))).unwrap();
            assert!(Arc::ptr_eq(&desk.take().unwrap(), &job));
            let view = job.view();
            assert_eq!((view.state, view.attempt), (JobState::Running, 1));
            view.id
        };
        {
            let desk = desk(&root);
            let job = look(&desk, "ada", &id).unwrap();
            assert_eq!(job.state(), JobState::Queued);
            assert!(desk.submit(submission("{}", Some("k"))).unwrap().1, "the key outlives the process");
            assert!(look(&desk, "bob", &id).is_none());
            assert_eq!(desk.take().unwrap().view().attempt, 2);
        }
        let desk = desk(&root);
        let view = look(&desk, "ada", &id).unwrap().view();
        assert_eq!((view.state, view.problem.unwrap().kind), (JobState::Failed, ProblemKind::Interrupted));
        std::fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn a_batch_is_there_as_a_whole_or_not_at_all() {
        let root = folder();
        let batch = |bodies: &[&str]| BatchSubmission {
            owner: "ada".into(),
            jobs: bodies.iter().map(|body| (None, submission(body, None))).collect(),
            idempotency: None,
        };
        let (id, jobs) = {
            let desk = desk(&root);
            assert_eq!(desk.submit_batch(batch(&["1", "2", "3"])).unwrap_err().kind, ProblemKind::TooManyJobs);
            let (batch, _) = desk.submit_batch(batch(&["1", "2"])).unwrap();
            let jobs: Vec<String> = batch.record.jobs.iter().map(|member| member.job.clone()).collect();
            assert_eq!(desk.forget(batch.jobs[0].as_ref().unwrap()).unwrap_err().kind, ProblemKind::StateConflict);
            (batch.record.id.clone(), jobs)
        };
        let found = |desk: &Desk, owner: &str| {
            let Ledger::Embedded(ledger) = &desk.ledger else { panic!("a data folder is embedded") };
            ledger.find_batch(owner, &id).map(|batch| batch.jobs.iter().flatten().count())
        };
        {
            let desk = desk(&root);
            assert_eq!((found(&desk, "ada"), found(&desk, "bob")), (Some(2), None));
        }
        // As if the process had ended just before the batch was on the device.
        std::fs::remove_file(root.join("batches").join(format!("{id}.json"))).unwrap();
        let desk = desk(&root);
        assert_eq!(found(&desk, "ada"), None);
        assert!(jobs.iter().all(|job| look(&desk, "ada", job).is_none()));
        assert_eq!(std::fs::read_dir(root.join("jobs")).unwrap().count(), 0);
        desk.submit_batch(batch(&["1", "2"])).unwrap();
        std::fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn equal_work_is_done_by_one_worker_for_all_who_wait() {
        let root = folder();
        let desk = desk(&root);
        let (first, _) = desk.submit(submission("{}", None)).unwrap();
        let (second, _) = desk.submit(submission("{}", None)).unwrap();
        let taken = desk.take().unwrap();
        assert!(Arc::ptr_eq(&taken, &first));
        let (other, _) = desk.submit(submission("[]", None)).unwrap();
        assert!(Arc::ptr_eq(&desk.take().unwrap(), &other), "the second waits for the first one's answer");
        let answer = super::super::record::Answer { outputs: Vec::new(), certificate: Default::default() };
        assert_eq!(desk.conclude(&taken, &Ending::Done(Box::new(answer))), Some(JobState::Succeeded));
        let view = second.view();
        assert_eq!((view.state, view.reused, view.attempt), (JobState::Succeeded, true, 0));
        // Work that fails is done again by whoever waited for it.
        let (first, _) = desk.submit(submission("1", None)).unwrap();
        let (second, _) = desk.submit(submission("1", None)).unwrap();
        assert!(Arc::ptr_eq(&desk.take().unwrap(), &first));
        desk.conclude(&first, &Ending::Failed(Box::new(Problem::internal("as asked"))));
        assert!(Arc::ptr_eq(&desk.take().unwrap(), &second));
        std::fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn other_limits_than_of_time_are_other_work() {
        let of = |limits| work_of(Digest::of(b"{}"), &limits);
        let usual = Limits::default();
        assert_eq!(of(usual), of(Limits { seconds: 1.0, ..usual }));
        for other in [
            Limits { triangles: 1, ..usual },
            Limits { cells: 1, ..usual },
            Limits { memory_bytes: 1, ..usual },
            Limits { depth: 1, ..usual },
        ] {
            assert_ne!(of(usual), of(other));
        }
        assert_ne!(of(usual), work_of(Digest::of(b"[]"), &usual));
    }

    #[test]
    fn an_owner_has_so_many_jobs_and_no_more() {
        let root = folder();
        let store = Arc::new(Store::open(&root).unwrap());
        let desk = Desk::open(&root, store, DeskLimits { queued: 10, per_owner: 2 }, Arc::default()).unwrap();
        let (first, _) = desk.submit(submission("1", None)).unwrap();
        let (second, _) = desk.submit(submission("2", None)).unwrap();
        assert_eq!(desk.submit(submission("3", None)).unwrap_err().kind, ProblemKind::TooManyJobs);
        desk.cancel(&second).unwrap();
        desk.submit(submission("3", None)).unwrap();
        assert_eq!(desk.submit(submission("4", None)).unwrap_err().kind, ProblemKind::TooManyJobs);
        desk.take().unwrap();
        desk.conclude(&first, &Ending::Failed(Box::new(Problem::internal("as asked"))));
        desk.submit(submission("4", None)).unwrap();
        std::fs::remove_dir_all(root).unwrap();
    }

    fn made(desk: &Desk, owner: &str, digest: Digest) -> Option<bool> {
        let Ledger::Embedded(ledger) = &desk.ledger else { panic!("a data folder is embedded") };
        ledger.find_output(owner, digest).map(|made| made.expired)
    }

    #[test]
    fn what_expires_leaves_a_small_record_for_a_while() {
        let root = folder();
        let desk_of = || desk(&root);
        let desk = desk_of();
        let digest = Digest::of(b"a file");
        let output = Output { name: "obj".into(), file_name: "a.obj".into(), media_type: "model/obj".into(), bytes: 6, digest };
        let answer = super::super::record::Answer { outputs: vec![output.clone()], certificate: Default::default() };
        let finish = |desk: &Desk, body: &str| {
            let (job, replayed) = desk.submit(submission(body, Some("k"))).unwrap();
            assert!(!replayed);
            desk.conclude(&desk.take().unwrap(), &Ending::Done(Box::new(answer.clone())));
            // Times are told to the millisecond, and what is kept for no time at all is older than that.
            std::thread::sleep(Duration::from_millis(3));
            job.id()
        };
        let hour = Duration::from_secs(3600);
        let sweep = |desk: &Desk, jobs, records, most_records| desk.sweep(Retention { jobs, records, most_records }).unwrap();
        let first = finish(&desk, "{}");
        sweep(&desk, hour, hour, 10);
        assert_eq!((look(&desk, "ada", &first).unwrap().state(), made(&desk, "ada", digest)), (JobState::Succeeded, Some(false)));
        sweep(&desk, Duration::ZERO, hour, 10);
        let record = look(&desk, "ada", &first).unwrap().record();
        assert_eq!((record.view.state, &record.view.outputs, record.view.attempt), (JobState::Expired, &vec![output], 1));
        assert!(record.view.finished.is_some() && record.view.expired >= record.view.finished);
        assert!(record.view.certificate.is_none() && record.view.problem.is_none() && record.idempotency.is_none());
        assert_eq!((made(&desk, "ada", digest), made(&desk, "bob", digest)), (Some(true), None));
        // Its key is free, and what is made again is there again.
        let second = finish(&desk, "[]");
        assert_ne!(first, second);
        assert_eq!(made(&desk, "ada", digest), Some(false));
        // It outlives the process, and no more of them than may be are kept, nor for longer.
        drop(desk);
        let desk = desk_of();
        assert_eq!(look(&desk, "ada", &first).unwrap().record(), record);
        sweep(&desk, Duration::ZERO, hour, 1);
        assert!(look(&desk, "ada", &first).is_none());
        assert_eq!(look(&desk, "ada", &second).unwrap().state(), JobState::Expired);
        std::thread::sleep(Duration::from_millis(3));
        sweep(&desk, Duration::ZERO, Duration::ZERO, 1);
        assert!(look(&desk, "ada", &second).is_none() && made(&desk, "ada", digest).is_none());
        assert_eq!(std::fs::read_dir(root.join("jobs")).unwrap().count(), 0);
        std::fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn a_waiting_job_is_cancelled_at_once() {
        let root = folder();
        let desk = desk(&root);
        let (job, _) = desk.submit(submission("{}", None)).unwrap();
        assert_eq!(desk.cancel(&job).unwrap().state, JobState::Cancelled);
        assert_eq!(desk.cancel(&job).unwrap().state, JobState::Cancelled);
        desk.stop();
        assert!(desk.take().is_none());
        std::fs::remove_dir_all(root).unwrap();
    }
}
