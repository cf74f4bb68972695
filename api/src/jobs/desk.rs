//! The desk: accepts jobs, knows them all, stops and forgets them, and takes them up again after a restart.

use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use lacuna_fabrication::{Certificate, JobKind};
use lacuna_kernel::budget::StopReason;
use uuid::Uuid;

use super::live::LiveJob;
use super::queue::{Queue, Refusal};
use super::record::{Idempotency, JobRecord, JobState, JobView, Output};
use crate::digest::Digest;
use crate::metrics::Metrics;
use crate::problem::{Problem, ProblemKind};
use crate::store::Store;

/// How often a job is started before it counts as the one that brings the service down.
pub const ATTEMPTS: u32 = 2;

/// A job that was read and found legal.
#[derive(Clone, Debug)]
pub struct Submission {
    /// Whose it is.
    pub owner: String,
    /// What it does.
    pub kind: JobKind,
    /// The job document that a worker will read.
    pub document: Vec<u8>,
    /// Digest of the canonical document: equal for equal work.
    pub input_digest: Digest,
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

/// The desk.
#[derive(Debug)]
pub struct Desk {
    jobs: Mutex<BTreeMap<String, Arc<LiveJob>>>,
    keys: Mutex<HashMap<(String, Digest), Option<String>>>,
    limits: DeskLimits,
    stopping: AtomicBool,
    /// Where things are kept.
    pub store: Arc<Store>,
    /// What waits.
    pub queue: Queue,
    /// What is counted.
    pub metrics: Arc<Metrics>,
}

impl Desk {
    /// Opens the desk and takes up what an earlier process left: jobs that waited wait again, jobs that ran
    /// run once more, and those that had been started twice have failed.
    ///
    /// # Errors
    /// When the data folder fails.
    pub fn open(store: Arc<Store>, limits: DeskLimits, metrics: Arc<Metrics>) -> std::io::Result<Self> {
        let mut records = store.jobs()?;
        records.sort_by(|a, b| a.view.id.cmp(&b.view.id));
        let desk = Self {
            jobs: Mutex::default(),
            keys: Mutex::default(),
            limits,
            stopping: AtomicBool::new(false),
            store,
            queue: Queue::new(limits.queued),
            metrics,
        };
        for mut record in records {
            take_up(&mut record);
            let (id, state) = (record.view.id.clone(), record.view.state);
            desk.store.keep_job(&record)?;
            if let Some(used) = &record.idempotency {
                crate::locked(&desk.keys).insert((record.owner.clone(), used.key), Some(id.clone()));
            }
            crate::locked(&desk.jobs).insert(id.clone(), Arc::new(LiveJob::new(record)));
            if state == JobState::Queued {
                desk.queue.restore(id);
            }
        }
        Ok(desk)
    }

    /// Accepts a job, or hands out the one that the same idempotency key made; tells which of the two.
    ///
    /// # Errors
    /// When the queue is full, the service stops, the key was used otherwise, or the data folder fails.
    pub fn submit(&self, submission: Submission) -> Result<(Arc<LiveJob>, bool), Problem> {
        if let Some(used) = submission.idempotency.clone() {
            if let Some(known) = self.reserve(&submission.owner, &used)? {
                return Ok((known, true));
            }
            let accepted = self.accept(submission.clone());
            let place = (submission.owner, used.key);
            let mut keys = crate::locked(&self.keys);
            match &accepted {
                Ok(job) => keys.insert(place, Some(job.with(|record| record.view.id.clone()))),
                // A refusal is not an answer to keep: the same request may pass later.
                Err(_) => keys.remove(&place),
            };
            return accepted.map(|job| (job, false));
        }
        self.accept(submission).map(|job| (job, false))
    }

    fn reserve(&self, owner: &str, used: &Idempotency) -> Result<Option<Arc<LiveJob>>, Problem> {
        let mut keys = crate::locked(&self.keys);
        match keys.get(&(owner.to_owned(), used.key)) {
            None => {
                keys.insert((owner.to_owned(), used.key), None);
                Ok(None)
            }
            Some(None) => Err(Problem::new(
                ProblemKind::IdempotencyInProgress,
                "A request with this Idempotency-Key is being answered; repeat this one afterwards",
            )
            .retry_after(1)),
            Some(Some(id)) => {
                let Some(job) = crate::locked(&self.jobs).get(id).cloned() else {
                    keys.insert((owner.to_owned(), used.key), None);
                    return Ok(None);
                };
                if job.with(|record| record.idempotency.as_ref().map(|first| first.body)) == Some(used.body) {
                    return Ok(Some(job));
                }
                Err(Problem::new(
                    ProblemKind::IdempotencyMismatch,
                    "This Idempotency-Key was used with another body; a new job needs a new key",
                ))
            }
        }
    }

    fn accept(&self, submission: Submission) -> Result<Arc<LiveJob>, Problem> {
        if self.is_stopping() {
            return Err(stopping());
        }
        self.check_share(&submission.owner)?;
        let failed = |error| Problem::io("the job could not be recorded", &error);
        let document = Digest::of(&submission.document);
        let answer = self.store.answer(answer_key(submission.input_digest)).unwrap_or_else(|error| {
            tracing::warn!(%error, "unreadable answer, the work is done again");
            None
        });
        self.store.keep_document(document, &submission.document).map_err(failed)?;
        let mut record = new_record(submission, document);
        if let Some(answer) = answer {
            finish(&mut record.view, answer.outputs, answer.certificate, true);
            self.metrics.reused();
        }
        let waits = record.view.state == JobState::Queued;
        let id = record.view.id.clone();
        // On the device before it is answered or started: an accepted job is never lost.
        self.store.keep_job(&record).map_err(failed)?;
        let job = Arc::new(LiveJob::new(record));
        crate::locked(&self.jobs).insert(id.clone(), Arc::clone(&job));
        if waits && let Err(refusal) = self.queue.push(id.clone()) {
            crate::locked(&self.jobs).remove(&id);
            let _ = self.store.forget_job(&id);
            return Err(match refusal {
                Refusal::Closed => stopping(),
                Refusal::Full => too_many("all callers", self.limits.queued),
            });
        }
        self.metrics.accepted();
        Ok(job)
    }

    fn check_share(&self, owner: &str) -> Result<(), Problem> {
        let theirs = self.all().iter().filter(|job| job.with(|r| r.owner == owner && !r.view.state.is_final())).count();
        if theirs >= self.limits.per_owner { Err(too_many("this key", self.limits.per_owner)) } else { Ok(()) }
    }

    /// An owner's job.
    #[must_use]
    pub fn find(&self, owner: &str, id: &str) -> Option<Arc<LiveJob>> {
        self.get(id).filter(|job| job.with(|record| record.owner == owner))
    }

    /// A job, whoever owns it.
    #[must_use]
    pub fn get(&self, id: &str) -> Option<Arc<LiveJob>> {
        crate::locked(&self.jobs).get(id).cloned()
    }

    /// All jobs, the oldest first.
    #[must_use]
    pub fn all(&self) -> Vec<Arc<LiveJob>> {
        crate::locked(&self.jobs).values().cloned().collect()
    }

    /// The output with this digest, if one of the owner's jobs made it.
    #[must_use]
    pub fn find_output(&self, owner: &str, digest: Digest) -> Option<Output> {
        self.all().iter().rev().find_map(|job| {
            job.with(|record| {
                let outputs = (record.owner == owner).then_some(&record.view.outputs)?;
                outputs.iter().find(|output| output.digest == digest).cloned()
            })
        })
    }

    /// Stops a job. One that waits has stopped when this returns; one that runs stops soon.
    ///
    /// # Errors
    /// When the data folder fails.
    pub fn cancel(&self, job: &LiveJob) -> std::io::Result<JobView> {
        let id = job.with(|record| record.view.id.clone());
        let waited = self.queue.remove(&id);
        job.update(|record| match record.view.state {
            JobState::Queued if waited => end_cancelled(&mut record.view),
            JobState::Queued | JobState::Running => record.view.state = JobState::Cancelling,
            _ => {}
        });
        job.cancel.fire(StopReason::Cancelled);
        self.store.keep_job(&job.record())?;
        Ok(job.view())
    }

    /// Stops a job if needed and forgets it.
    ///
    /// # Errors
    /// When the data folder fails.
    pub fn forget(&self, job: &LiveJob) -> std::io::Result<()> {
        self.cancel(job)?;
        let (id, owner, used) = job.with(|r| (r.view.id.clone(), r.owner.clone(), r.idempotency.clone()));
        crate::locked(&self.jobs).remove(&id);
        if let Some(used) = used {
            crate::locked(&self.keys).remove(&(owner, used.key));
        }
        self.store.forget_job(&id)
    }

    /// Keeps a job's present record, unless its owner had it forgotten meanwhile.
    pub fn keep(&self, job: &LiveJob) {
        let record = job.record();
        if self.get(&record.view.id).is_none() {
            return;
        }
        if let Err(error) = self.store.keep_job(&record) {
            tracing::error!(job = %record.view.id, %error, "job record not kept");
        }
    }

    /// Forgets jobs that ended longer ago than `age`, then removes results that no job has.
    ///
    /// # Errors
    /// When the data folder fails.
    pub fn sweep(&self, age: Duration) -> std::io::Result<()> {
        let oldest = crate::clock::ago(age);
        for job in self.all() {
            if job.with(|record| record.view.finished.as_ref().is_some_and(|finished| *finished < oldest)) {
                self.forget(&job)?;
            }
        }
        let needed: std::collections::HashSet<Digest> =
            self.all().iter().flat_map(|job| job.view().outputs.into_iter().map(|output| output.digest)).collect();
        // A running job's results are kept before its record names them: sweep only when none runs.
        if self.all().iter().all(|job| job.state().is_final()) {
            let removed = self.store.sweep_results(|digest| needed.contains(&digest))?;
            tracing::info!(removed, "results swept");
        }
        Ok(())
    }

    /// Accepts and hands out no more jobs.
    pub fn stop(&self) {
        self.stopping.store(true, Ordering::SeqCst);
        self.queue.close();
    }

    /// Whether the service goes down.
    #[must_use]
    pub fn is_stopping(&self) -> bool {
        self.stopping.load(Ordering::SeqCst)
    }

    /// Stops what runs, so that it is taken up again at the next start.
    pub fn interrupt(&self) {
        for job in self.all() {
            if job.state() == JobState::Running {
                job.cancel.fire(StopReason::Cancelled);
            }
        }
    }
}

/// Under which name finished work is found again: by the work and by the version that did it.
#[must_use]
pub fn answer_key(input: Digest) -> Digest {
    Digest::of(format!("{input} {}", env!("CARGO_PKG_VERSION")).as_bytes())
}

/// Ends a job well.
pub fn finish(view: &mut JobView, outputs: Vec<Output>, certificate: Certificate, reused: bool) {
    view.state = JobState::Succeeded;
    view.finished = Some(crate::clock::now());
    view.progress = None;
    view.warnings.clone_from(&certificate.warnings);
    view.outputs = outputs;
    view.certificate = Some(certificate);
    view.reused = reused;
}

/// Ends a job on its owner's wish.
pub fn end_cancelled(view: &mut JobView) {
    view.state = JobState::Cancelled;
    view.finished = Some(crate::clock::now());
    view.progress = None;
    view.problem = Some(Problem::new(ProblemKind::Cancelled, "The job was stopped by its owner"));
}

/// Ends a job with a problem.
pub fn fail(view: &mut JobView, problem: Problem) {
    view.state = JobState::Failed;
    view.finished = Some(crate::clock::now());
    view.progress = None;
    view.problem = Some(problem);
}

fn take_up(record: &mut JobRecord) {
    let view = &mut record.view;
    view.progress = None;
    match view.state {
        JobState::Cancelling => end_cancelled(view),
        JobState::Running if view.attempt >= ATTEMPTS => {
            let detail = format!("The service stopped during the work, {ATTEMPTS} times");
            fail(view, Problem::new(ProblemKind::Interrupted, detail));
        }
        JobState::Running => view.state = JobState::Queued,
        _ => {}
    }
}

fn new_record(submission: Submission, document: Digest) -> JobRecord {
    let view = JobView {
        id: format!("job_{}", Uuid::now_v7().simple()),
        kind: submission.kind,
        state: JobState::Queued,
        attempt: 0,
        created: crate::clock::now(),
        started: None,
        finished: None,
        progress: None,
        input_digest: submission.input_digest.to_string(),
        reused: false,
        outputs: Vec::new(),
        certificate: None,
        warnings: Vec::new(),
        problem: None,
    };
    JobRecord { view, owner: submission.owner, document, idempotency: submission.idempotency }
}

fn stopping() -> Problem {
    Problem::new(ProblemKind::ShuttingDown, "The service is going down and accepts no more jobs").retry_after(10)
}

fn too_many(whose: &str, allowed: usize) -> Problem {
    let detail = format!("{allowed} unfinished jobs of {whose} are the most that are accepted; wait for one to end");
    Problem::new(ProblemKind::TooManyJobs, detail).retry_after(5)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn desk(root: &std::path::Path) -> Desk {
        let store = Arc::new(Store::open(root).unwrap());
        Desk::open(store, DeskLimits { queued: 2, per_owner: 10 }, Arc::default()).unwrap()
    }

    fn submission(body: &str, key: Option<&str>) -> Submission {
        Submission {
            owner: "ada".into(),
            kind: JobKind::Measure,
            document: body.as_bytes().to_vec(),
            input_digest: Digest::of(body.as_bytes()),
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

    #[test]
    fn a_restart_takes_jobs_up_again_once() {
        let root = folder();
        let id = {
            let desk = desk(&root);
            let (job, _) = desk.submit(submission("{}", Some("k"))).unwrap();
            job.update(|record| (record.view.state, record.view.attempt) = (JobState::Running, 1));
            desk.keep(&job);
            job.view().id
        };
        {
            let desk = desk(&root);
            let job = desk.find("ada", &id).unwrap();
            assert_eq!((job.state(), desk.queue.len()), (JobState::Queued, 1));
            assert!(desk.submit(submission("{}", Some("k"))).unwrap().1, "the key outlives the process");
            assert!(desk.find("bob", &id).is_none());
            job.update(|record| (record.view.state, record.view.attempt) = (JobState::Running, 2));
            desk.keep(&job);
        }
        let desk = desk(&root);
        let view = desk.find("ada", &id).unwrap().view();
        assert_eq!((view.state, view.problem.unwrap().kind), (JobState::Failed, ProblemKind::Interrupted));
        std::fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn a_waiting_job_is_cancelled_at_once() {
        let root = folder();
        let desk = desk(&root);
        let (job, _) = desk.submit(submission("{}", None)).unwrap();
        assert_eq!(desk.cancel(&job).unwrap().state, JobState::Cancelled);
        assert_eq!(desk.cancel(&job).unwrap().state, JobState::Cancelled);
        assert!(desk.queue.is_empty());
        std::fs::remove_dir_all(root).unwrap();
    }
}
