//! Batches in the ledger of several processes.
//!
//! A batch and its jobs are put into their places, and taken out of them, by one transaction: there is never a part of one.

use std::collections::HashMap;
use std::sync::Arc;

use tokio_postgres::Row;
use tokio_postgres::types::Type;

use super::Shared;
use super::pool::Failure;
use super::rows;
use crate::jobs::batch::{Batch, BatchRecord};
use crate::jobs::live::LiveJob;
use crate::jobs::record::{Idempotency, JobRecord};
use crate::jobs::refusal;
use crate::problem::Problem;

/// The batch that an owner's idempotency key made. Once its jobs have expired the key is free for another.
const OF_KEY: &str = "SELECT record FROM lacuna_batches WHERE owner = $1 AND idempotency_key = $2
    AND EXISTS (SELECT FROM lacuna_jobs WHERE batch = lacuna_batches.id AND state <> 'expired')";

fn first_of_key(row: &Row, used: &Idempotency) -> Result<BatchRecord, Failure> {
    let first: BatchRecord = serde_json::from_str(row.try_get(0)?)?;
    let same = first.idempotency.as_ref().is_some_and(|first| first.body == used.body);
    if same { Ok(first) } else { Err(refusal::key_used_otherwise().into()) }
}

impl Shared {
    pub(in crate::jobs) fn batch_made_by(&self, owner: &str, used: &Idempotency) -> Result<Option<Batch>, Problem> {
        let asked = async {
            let client = self.pool.get().await?;
            let row = client.query_typed_opt(OF_KEY, &[(&owner, Type::TEXT), (&used.key.hex(), Type::TEXT)]).await?;
            client.done();
            let Some(row) = row else { return Ok(None) };
            let first = first_of_key(&row, used)?;
            let jobs = self.jobs_of(&first.id).await?;
            Ok(Some((first, jobs)))
        };
        Ok(self.runtime.block_on(self.within(asked))?.map(|(first, jobs)| self.gathered(first, jobs)))
    }

    pub(in crate::jobs) fn submit_batch(&self, batch: BatchRecord, records: Vec<JobRecord>) -> Result<(Batch, bool), Problem> {
        let known = self.known_answers(&records)?;
        let accepted = async {
            let mut client = self.pool.get().await?;
            let transaction = client.transaction().await?;
            rows::lock_owner(&transaction, &batch.owner).await?;
            if let Some(used) = &batch.idempotency {
                let values = [(&batch.owner as _, Type::TEXT), (&used.key.hex() as _, Type::TEXT)];
                if let Some(row) = transaction.query_typed_opt(OF_KEY, &values).await? {
                    let first = first_of_key(&row, used)?;
                    drop(transaction);
                    client.done();
                    return Ok((first, None));
                }
            }
            let records = self.admit(&transaction, records, known).await?;
            let statement = "INSERT INTO lacuna_batches (id, owner, record, idempotency_key) VALUES ($1, $2, $3, $4)";
            let (record, key) = (serde_json::to_string(&batch)?, batch.idempotency.as_ref().map(|used| used.key.hex()));
            let values =
                [(&batch.id as _, Type::TEXT), (&batch.owner as _, Type::TEXT), (&record as _, Type::TEXT), (&key as _, Type::TEXT)];
            transaction.execute_typed(statement, &values).await?;
            transaction.commit().await?;
            client.done();
            Ok((batch, Some(records)))
        };
        match self.runtime.block_on(self.within(accepted))? {
            (batch, Some(records)) => {
                let jobs = records.into_iter().map(|record| Some(self.mirror(record, 1))).collect();
                Ok((Batch { record: Arc::new(batch), jobs }, false))
            }
            (first, None) => {
                let jobs = self.runtime.block_on(self.within(self.jobs_of(&first.id)))?;
                Ok((self.gathered(first, jobs), true))
            }
        }
    }

    pub(in crate::jobs) async fn find_batch(&self, owner: &str, id: &str) -> Result<Option<Batch>, Problem> {
        let asked = async {
            let client = self.pool.get().await?;
            let question = "SELECT record FROM lacuna_batches WHERE id = $1 AND owner = $2";
            let row = client.query_typed_opt(question, &[(&id, Type::TEXT), (&owner, Type::TEXT)]).await?;
            client.done();
            let Some(row) = row else { return Ok(None) };
            let record: BatchRecord = serde_json::from_str(row.try_get(0)?)?;
            Ok(Some((record, self.jobs_of(id).await?)))
        };
        Ok(self.within(asked).await?.map(|(record, jobs)| self.gathered(record, jobs)))
    }

    async fn jobs_of(&self, batch: &str) -> Result<Vec<(JobRecord, u64)>, Failure> {
        let client = self.pool.get().await?;
        let question = format!("SELECT {} FROM lacuna_jobs WHERE batch = $1", rows::COLUMNS);
        let found = client.query_typed(&question, &[(&batch, Type::TEXT)]).await?;
        client.done();
        found.iter().map(rows::read).collect()
    }

    fn gathered(&self, record: BatchRecord, found: Vec<(JobRecord, u64)>) -> Batch {
        let mirrored = found.into_iter().map(|(job, revision)| (job.view.id.clone(), self.mirror(job, revision)));
        let mut known: HashMap<String, Arc<LiveJob>> = mirrored.collect();
        let jobs = record.jobs.iter().map(|member| known.remove(&member.job)).collect();
        Batch { record: Arc::new(record), jobs }
    }

    pub(in crate::jobs) fn forget_batch(&self, batch: &Batch) -> Result<(), Problem> {
        let asked = async {
            let client = self.pool.get().await?;
            let statement =
                "WITH batch AS (DELETE FROM lacuna_batches WHERE id = $1), gone AS (DELETE FROM lacuna_jobs WHERE batch = $1 RETURNING id)
                SELECT pg_notify($2, 'gone ' || id)::text FROM gone";
            client.query_typed(statement, &[(&batch.record.id, Type::TEXT), (&rows::CHANNEL, Type::TEXT)]).await?;
            client.done();
            Ok(())
        };
        self.runtime.block_on(self.within(asked))
    }
}
