//! The ledger of one process: all jobs in memory, every lasting change on the device before anybody sees it.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::io;
use std::path::Path;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

use lacuna_kernel::budget::StopReason;

use super::batch::BatchRecord;
use super::desk::{DeskLimits, Gauges, JobFilter, Made, Retention};
use super::journal::Journal;
use super::live::LiveJob;
use super::record::{Ending, Idempotency, JobRecord, JobState, JobView};
use super::refusal;
use crate::digest::Digest;
use crate::problem::Problem;
use crate::store::Store;

mod batches;
mod queue;

use queue::{Queue, Waiting};

/// The ledger.
#[derive(Debug)]
pub(super) struct Embedded {
    book: Mutex<Book>,
    /// Something waits, or nothing more is handed out.
    arrived: Condvar,
    /// Held while a batch is accepted.
    batching: Mutex<()>,
    limits: DeskLimits,
    journal: Journal,
    store: Arc<Store>,
}

/// What is known of all jobs.
#[derive(Debug, Default)]
struct Book {
    jobs: BTreeMap<String, Arc<LiveJob>>,
    batches: BTreeMap<String, Arc<BatchRecord>>,
    /// What idempotency keys were used for; nothing yet while the first submission is accepted.
    keys: HashMap<(String, Digest), Option<String>>,
    /// Jobs that wait.
    waiting: Queue,
    /// Work that workers are at.
    at_work: HashSet<Digest>,
    /// Jobs that have not ended, by owner, those that are being accepted included.
    unfinished: HashMap<String, usize>,
    /// Jobs that are being accepted.
    arriving: usize,
    /// Which jobs have a result.
    makers: HashMap<Digest, BTreeSet<String>>,
    closed: bool,
}

impl Book {
    fn insert(&mut self, job: &Arc<LiveJob>) {
        let id = job.with(|record| {
            for output in &record.view.outputs {
                self.makers.entry(output.digest).or_default().insert(record.view.id.clone());
            }
            record.view.id.clone()
        });
        self.jobs.insert(id, Arc::clone(job));
    }

    fn leave(&mut self, owner: &str) {
        if let Some(count) = self.unfinished.get_mut(owner) {
            *count -= 1;
            if *count == 0 {
                self.unfinished.remove(owner);
            }
        }
    }

    /// Takes note of a job that is just ending.
    fn ended(&mut self, record: &JobRecord) {
        self.leave(&record.owner);
        // A job that was forgotten while it ran has nothing to show.
        for output in record.view.outputs.iter().filter(|_| self.jobs.contains_key(&record.view.id)) {
            self.makers.entry(output.digest).or_default().insert(record.view.id.clone());
        }
    }

    fn stop_waiting(&mut self, id: &str) -> bool {
        !self.waiting.take_all(|job| job.id == id).is_empty()
    }
}

impl Embedded {
    /// Opens the ledger and takes up what an earlier process left: jobs that waited wait again, jobs that ran run once
    /// more, and those that had been started twice have failed.
    pub(super) fn open(root: &Path, store: Arc<Store>, limits: DeskLimits) -> io::Result<Self> {
        let journal = Journal::open(root)?;
        // Events of what an earlier process left have later ids than any that it gave: listeners that come back hear them all.
        let started = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        let batches = journal.batches()?.into_iter().map(|batch| (batch.id.clone(), Arc::new(batch)));
        let mut book = Book { batches: batches.collect(), ..Book::default() };
        for mut record in journal.jobs()? {
            if record.view.batch.as_ref().is_some_and(|batch| !book.batches.contains_key(batch)) {
                // The process ended while the batch was being accepted, or forgotten.
                journal.forget(&record.view.id)?;
                journal.forget_start(&record.view.id)?;
                continue;
            }
            if matches!(record.view.state, JobState::Running | JobState::Cancelling) {
                record.view.take_up();
                journal.keep(&record)?;
            }
            journal.forget_start(&record.view.id)?;
            if let Some(used) = &record.idempotency {
                book.keys.insert((record.owner.clone(), used.key), Some(record.view.id.clone()));
            }
            if record.view.state == JobState::Queued {
                // Accepted before: it is not refused now.
                book.waiting.add(waiting(&record));
                *book.unfinished.entry(record.owner.clone()).or_default() += 1;
            }
            book.insert(&Arc::new(LiveJob::at(record, started)));
        }
        Ok(Self { book: Mutex::new(book), arrived: Condvar::new(), batching: Mutex::default(), limits, journal, store })
    }

    fn book(&self) -> std::sync::MutexGuard<'_, Book> {
        crate::locked(&self.book)
    }

    pub(super) fn submit(&self, record: JobRecord) -> Result<(Arc<LiveJob>, bool), Problem> {
        let Some(used) = record.idempotency.clone() else {
            return self.accept_one(record).map(|job| (job, false));
        };
        let place = (record.owner.clone(), used.key);
        if let Some(known) = self.reserve(&place, &used)? {
            return Ok((known, true));
        }
        let accepted = self.accept_one(record);
        let mut book = self.book();
        match &accepted {
            Ok(job) => book.keys.insert(place, Some(job.with(|record| record.view.id.clone()))),
            // A refusal is not an answer to keep: the same request may pass later.
            Err(_) => book.keys.remove(&place),
        };
        accepted.map(|job| (job, false))
    }

    /// The job that an owner's idempotency key made, if it did; a key that is being used now has made none yet.
    pub(super) fn made_by(&self, owner: &str, used: &Idempotency) -> Result<Option<Arc<LiveJob>>, Problem> {
        let book = self.book();
        let id = book.keys.get(&(owner.to_owned(), used.key)).cloned().flatten();
        id.and_then(|id| book.jobs.get(&id).cloned()).map(|job| same_body(job, used)).transpose()
    }

    fn reserve(&self, place: &(String, Digest), used: &Idempotency) -> Result<Option<Arc<LiveJob>>, Problem> {
        let mut book = self.book();
        match book.keys.get(place) {
            Some(None) => Err(refusal::key_in_progress()),
            Some(Some(id)) => match book.jobs.get(id).cloned() {
                Some(job) => same_body(job, used).map(Some),
                None => {
                    book.keys.insert(place.clone(), None);
                    Ok(None)
                }
            },
            None => {
                book.keys.insert(place.clone(), None);
                Ok(None)
            }
        }
    }

    fn accept_one(&self, record: JobRecord) -> Result<Arc<LiveJob>, Problem> {
        let jobs = self.accept(vec![record], None)?;
        jobs.into_iter().next().ok_or_else(|| Problem::internal("a job was accepted and is not there"))
    }

    /// Accepts jobs, all or none: one, or those of a batch.
    fn accept(&self, mut records: Vec<JobRecord>, batch: Option<&Arc<BatchRecord>>) -> Result<Vec<Arc<LiveJob>>, Problem> {
        for record in &mut records {
            if let Some(answer) = self.answer(record) {
                record.view.finish(answer, true);
            }
        }
        let owner = records.first().map(|record| record.owner.clone()).unwrap_or_default();
        let waits = |record: &JobRecord| !record.view.state.is_final();
        let more = records.iter().filter(|record| waits(record)).count();
        if more > 0 {
            let mut book = self.book();
            let theirs = book.unfinished.get(&owner).copied().unwrap_or(0);
            refusal::unless_room("this key", theirs, more, self.limits.per_owner)?;
            refusal::unless_room("all callers", book.waiting.len() + book.arriving, more, self.limits.queued)?;
            *book.unfinished.entry(owner.clone()).or_default() += more;
            book.arriving += more;
        }
        // On the device before they are answered or started: an accepted job is never lost. The batch comes last: without it its jobs were not accepted.
        let kept = self.journal.keep_all(&records);
        let kept = kept.and_then(|()| batch.map_or(Ok(()), |batch| self.journal.keep_batch(batch)));
        let mut book = self.book();
        book.arriving -= more;
        if let Err(error) = kept {
            (0..more).for_each(|_| book.leave(&owner));
            drop(book);
            for record in &records {
                if let Err(error) = self.journal.forget(&record.view.id) {
                    tracing::warn!(job = %record.view.id, %error, "the record of a job that was refused is left");
                }
            }
            return Err(Problem::io("the job could not be recorded", &error));
        }
        let mut jobs = Vec::with_capacity(records.len());
        for record in records {
            if waits(&record) {
                book.waiting.add(waiting(&record));
            }
            let job = Arc::new(LiveJob::new(record));
            book.insert(&job);
            jobs.push(job);
        }
        if let Some(batch) = batch {
            book.batches.insert(batch.id.clone(), Arc::clone(batch));
        }
        drop(book);
        if more > 0 {
            self.arrived.notify_all();
        }
        Ok(jobs)
    }

    /// What the same work left earlier, if all of it is still there.
    fn answer(&self, record: &JobRecord) -> Option<super::record::Answer> {
        let found = self.journal.answer(record.work).and_then(|answer| {
            let Some(answer) = answer else { return Ok(None) };
            for output in &answer.outputs {
                if !self.store.holds_result(output.digest)? {
                    return Ok(None);
                }
            }
            Ok(Some(answer))
        });
        found.unwrap_or_else(|error| {
            tracing::warn!(%error, "unreadable answer, the work is done again");
            None
        })
    }

    pub(super) fn find(&self, owner: &str, id: &str) -> Option<Arc<LiveJob>> {
        let job = self.book().jobs.get(id).cloned();
        job.filter(|job| job.with(|record| record.owner == owner))
    }

    pub(super) fn page(&self, owner: &str, filter: &JobFilter, length: usize) -> Vec<JobView> {
        // Only the handles are copied under the lock.
        let jobs: Vec<Arc<LiveJob>> = match &filter.before {
            Some(before) => self.book().jobs.range(..before.clone()).rev().map(|(_, job)| Arc::clone(job)).collect(),
            None => self.book().jobs.values().rev().cloned().collect(),
        };
        let theirs = jobs.iter().filter(|job| job.with(|record| record.owner == owner && filter.wants(&record.view)));
        theirs.take(length).map(|job| job.view()).collect()
    }

    pub(super) fn find_output(&self, owner: &str, digest: Digest) -> Option<Made> {
        let book = self.book();
        let all = book.makers.get(&digest)?.iter().rev().filter_map(|id| {
            book.jobs.get(id)?.with(|record| {
                let outputs = (record.owner == owner).then_some(&record.view.outputs)?;
                let output = outputs.iter().find(|output| output.digest == digest)?.clone();
                Some(Made { output, expired: record.view.state == JobState::Expired })
            })
        });
        let mut expired = None;
        for made in all {
            if !made.expired {
                return Some(made);
            }
            expired.get_or_insert(made);
        }
        expired
    }

    pub(super) fn cancel(&self, job: &LiveJob) -> io::Result<JobView> {
        let id = job.with(|record| record.view.id.clone());
        let waited = self.book().stop_waiting(&id);
        let stop = |record: &mut JobRecord| {
            match record.view.state {
                JobState::Queued if waited => record.view.end_cancelled(),
                JobState::Queued | JobState::Running => record.view.state = JobState::Cancelling,
                _ => {}
            }
            // The flag falls before the device is asked: stopping must not wait for it.
            job.stop();
        };
        let stopped = job.change(stop, |record| self.settle(record));
        if waited && stopped.is_err() {
            self.book().waiting.put_back(job.with(waiting));
        }
        stopped.map(|()| job.view())
    }

    pub(super) fn forget(&self, job: &LiveJob) -> io::Result<()> {
        self.cancel(job)?;
        let (id, place) = job.with(|r| (r.view.id.clone(), r.idempotency.as_ref().map(|used| (r.owner.clone(), used.key))));
        let mut book = self.book();
        book.jobs.remove(&id);
        if let Some(place) = place {
            book.keys.remove(&place);
        }
        job.with(|record| {
            for output in &record.view.outputs {
                if let Some(makers) = book.makers.get_mut(&output.digest) {
                    makers.remove(&id);
                    if makers.is_empty() {
                        book.makers.remove(&output.digest);
                    }
                }
            }
        });
        drop(book);
        self.journal.forget(&id)
    }

    /// Waits for the next job whose work nobody is at; none once the ledger is closed, whatever waits.
    pub(super) fn take(&self) -> Option<Arc<LiveJob>> {
        let mut book = self.book();
        loop {
            if book.closed {
                return None;
            }
            let Book { waiting, at_work, jobs, .. } = &mut *book;
            if let Some(next) = waiting.take(|job| !at_work.contains(&job.work)) {
                // Its owner has just forgotten it.
                let Some(job) = jobs.get(&next.id).cloned() else { continue };
                at_work.insert(next.work);
                drop(book);
                self.start(&job);
                return Some(job);
            }
            book = self.arrived.wait(book).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Noted before the work begins.
    fn start(&self, job: &LiveJob) {
        let note = |record: &JobRecord| {
            if let Err(error) = self.journal.note_start(&record.view.id, record.view.attempt) {
                tracing::error!(job = %record.view.id, %error, "the start of a job was not noted");
            }
            Ok::<_, std::convert::Infallible>(())
        };
        let _ = job.change(
            |record| {
                if record.view.state == JobState::Queued {
                    record.view.start();
                }
            },
            note,
        );
    }

    /// Records how a job ended, and ends the jobs with it that wait for the same work.
    pub(super) fn conclude(&self, job: &LiveJob, ending: &Ending) -> io::Result<JobState> {
        let work = job.with(|record| record.work);
        if let Ending::Done(answer) = ending
            && let Err(error) = self.journal.note_answer(work, answer)
        {
            tracing::warn!(%error, "finished work cannot be found again");
        }
        job.change(|record| record.view.conclude(ending.clone()), |record| self.settle(record))?;
        let (state, id) = job.with(|record| (record.view.state, record.view.id.clone()));
        if let Err(error) = self.journal.forget_start(&id) {
            tracing::warn!(job = %id, %error, "the note of a start is left");
        }
        let mut book = self.book();
        book.at_work.remove(&work);
        if state == JobState::Queued {
            book.waiting.put_back(job.with(waiting));
        }
        let followers = match ending {
            Ending::Done(_) => self.followers(&mut book, work),
            _ => Vec::new(),
        };
        // Whoever waited for this work may be taken now.
        self.arrived.notify_all();
        drop(book);
        if let Ending::Done(answer) = ending {
            for follower in followers {
                self.answer_follower(&follower, answer);
            }
        }
        Ok(state)
    }

    fn followers(&self, book: &mut Book, work: Digest) -> Vec<Arc<LiveJob>> {
        let equal = book.waiting.take_all(|job| job.work == work);
        equal.iter().filter_map(|job| book.jobs.get(&job.id).cloned()).collect()
    }

    fn answer_follower(&self, job: &Arc<LiveJob>, answer: &super::record::Answer) {
        if let Err(error) = job.change(|record| record.view.finish(answer.clone(), true), |record| self.settle(record)) {
            tracing::error!(%error, "a job that has its answer could not be recorded; it waits on");
            self.book().waiting.add(job.with(waiting));
            self.arrived.notify_one();
        }
    }

    /// Puts a changed record on the device, and what follows from it into the book, before anybody hears of the change:
    /// who is told of an end may ask for the results at once, and submit the next job.
    fn settle(&self, record: &JobRecord) -> io::Result<()> {
        let known = self.book().jobs.contains_key(&record.view.id);
        if known {
            self.journal.keep(record)?;
        }
        if record.view.state.is_final() {
            self.book().ended(record);
        }
        Ok(())
    }

    /// Lets jobs expire, forgets expired ones, then removes answers and files that no other job has.
    pub(super) fn sweep(&self, retention: Retention) -> io::Result<usize> {
        let oldest = crate::clock::ago(retention.jobs);
        let (jobs, _) = self.by_expiry();
        for job in &jobs {
            if job.with(|record| record.view.finished.as_ref().is_some_and(|finished| *finished < oldest)) {
                self.expire(job)?;
            }
        }
        let oldest = crate::clock::ago(retention.records);
        let (_, expired) = self.by_expiry();
        let surplus = expired.len().saturating_sub(retention.most_records);
        for (place, job) in expired.iter().enumerate() {
            if place < surplus || job.with(|record| record.view.expired.as_ref().is_none_or(|expired| *expired <= oldest)) {
                self.forget(job)?;
            }
        }
        self.sweep_batches()?;
        let needed: HashSet<Digest> = self.by_expiry().0.iter().map(|job| job.with(|record| record.work)).collect();
        self.journal.sweep(|work| needed.contains(&work))?;
        self.store.sweep(|| {
            let of = |job: &Arc<LiveJob>| job.with(|r| r.view.outputs.iter().map(|o| o.digest).chain([r.document]).collect::<Vec<_>>());
            Ok(self.by_expiry().0.iter().flat_map(of).collect())
        })
    }

    /// Jobs that have not expired, and those that have, the oldest first.
    fn by_expiry(&self) -> (Vec<Arc<LiveJob>>, Vec<Arc<LiveJob>>) {
        self.book().jobs.values().cloned().partition(|job| job.state() != JobState::Expired)
    }

    /// Leaves of a job that has ended what [`JobRecord::expire`] says. Its events go with the old object.
    fn expire(&self, job: &LiveJob) -> io::Result<()> {
        let mut record = job.record();
        let (id, key) = (record.view.id.clone(), record.idempotency.as_ref().map(|used| (record.owner.clone(), used.key)));
        record.expire();
        self.journal.keep(&record)?;
        let mut book = self.book();
        let Some(place) = book.jobs.get_mut(&id) else {
            // Its owner has just forgotten it.
            drop(book);
            return self.journal.forget(&id);
        };
        *place = Arc::new(LiveJob::new(record));
        if let Some(key) = key {
            book.keys.remove(&key);
        }
        Ok(())
    }

    pub(super) fn gauges(&self) -> Gauges {
        let book = self.book();
        let running = book.at_work.len() as u64;
        Gauges { queued: book.waiting.len() as u64, running, kept: book.jobs.len() as u64 }
    }

    /// Hands out no more jobs. What waits stays for the next start.
    pub(super) fn close(&self) {
        self.book().closed = true;
        self.arrived.notify_all();
    }

    /// Stops what runs, so that it is taken up again at the next start.
    pub(super) fn interrupt(&self) {
        let jobs: Vec<Arc<LiveJob>> = self.book().jobs.values().cloned().collect();
        for job in jobs.iter().filter(|job| job.state() == JobState::Running) {
            job.cancel.fire(StopReason::Cancelled);
        }
    }
}

/// A job as it waits.
fn waiting(record: &JobRecord) -> Waiting {
    Waiting { id: record.view.id.clone(), owner: record.owner.clone(), work: record.work }
}

/// The job that a key made, if it was for the same body.
fn same_body(job: Arc<LiveJob>, used: &Idempotency) -> Result<Arc<LiveJob>, Problem> {
    let first = job.with(|record| record.idempotency.as_ref().map(|first| first.body));
    if first == Some(used.body) { Ok(job) } else { Err(refusal::key_used_otherwise()) }
}
