//! Batches in the ledger of one process.

use std::io;
use std::sync::Arc;

use super::{Book, Embedded};
use crate::digest::Digest;
use crate::jobs::batch::{Batch, BatchRecord};
use crate::jobs::record::{Idempotency, JobRecord, JobState};
use crate::jobs::refusal;
use crate::problem::Problem;

impl Book {
    fn batch(&self, record: &Arc<BatchRecord>) -> Batch {
        let jobs = record.jobs.iter().map(|member| self.jobs.get(&member.job).cloned()).collect();
        Batch { record: Arc::clone(record), jobs }
    }

    /// The batch that an owner's idempotency key was used for; once its jobs have expired the key is free for another.
    fn batch_of_key(&self, owner: &str, key: Digest) -> Option<Batch> {
        let used = |record: &&Arc<BatchRecord>| record.owner == owner && record.idempotency.as_ref().is_some_and(|used| used.key == key);
        let mut batches = self.batches.values().filter(used).map(|record| self.batch(record));
        batches.find(|batch| batch.jobs.iter().flatten().any(|job| job.state() != JobState::Expired))
    }
}

impl Embedded {
    pub(in crate::jobs) fn submit_batch(&self, batch: BatchRecord, records: Vec<JobRecord>) -> Result<(Batch, bool), Problem> {
        // One batch at a time: a key that is in use is waited for.
        let _alone = crate::locked(&self.batching);
        if let Some(used) = &batch.idempotency
            && let Some(first) = self.batch_made_by(&batch.owner, used)?
        {
            return Ok((first, true));
        }
        let record = Arc::new(batch);
        let jobs = self.accept(records, Some(&record))?.into_iter().map(Some).collect();
        Ok((Batch { record, jobs }, false))
    }

    /// The batch that an owner's idempotency key made, if it did.
    pub(in crate::jobs) fn batch_made_by(&self, owner: &str, used: &Idempotency) -> Result<Option<Batch>, Problem> {
        let Some(first) = self.book().batch_of_key(owner, used.key) else { return Ok(None) };
        let same = first.record.idempotency.as_ref().is_some_and(|first| first.body == used.body);
        if same { Ok(Some(first)) } else { Err(refusal::key_used_otherwise()) }
    }

    pub(in crate::jobs) fn find_batch(&self, owner: &str, id: &str) -> Option<Batch> {
        let book = self.book();
        book.batches.get(id).filter(|record| record.owner == owner).map(|record| book.batch(record))
    }

    pub(in crate::jobs) fn forget_batch(&self, batch: &Batch) -> io::Result<()> {
        // The batch first: jobs that are left without it when the process ends here go at the next start.
        self.journal.forget_batch(&batch.record.id)?;
        self.book().batches.remove(&batch.record.id);
        batch.jobs.iter().flatten().try_for_each(|job| self.forget(job))
    }

    /// Forgets batches of which no job is left.
    pub(super) fn sweep_batches(&self) -> io::Result<()> {
        let book = self.book();
        let left = |record: &BatchRecord| record.jobs.iter().any(|member| book.jobs.contains_key(&member.job));
        let empty: Vec<String> = book.batches.values().filter(|record| !left(record)).map(|record| record.id.clone()).collect();
        drop(book);
        for id in empty {
            self.journal.forget_batch(&id)?;
            self.book().batches.remove(&id);
        }
        Ok(())
    }
}
