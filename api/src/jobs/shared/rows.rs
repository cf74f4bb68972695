//! Records as rows: the only file, with the schema, that has SQL for a single job.
//!
//! Statements name the types of what is put into them: then each takes one exchange with the database. Without them it takes two, and on a machine that is
//! busy every exchange waits twice for the processor.

use std::time::Duration;

use tokio_postgres::types::{ToSql, Type};
use tokio_postgres::{Row, Transaction};

use super::pool::Failure;
use crate::jobs::record::{Answer, JobRecord, JobState, JobView, Output, Step};

/// The channel on which changes are told.
pub(super) const CHANNEL: &str = "lacuna";

/// What a row must have for [`read`].
pub(super) const COLUMNS: &str = "record, progress, revision, batch";

/// A record and its revision.
pub(super) fn read(row: &Row) -> Result<(JobRecord, u64), Failure> {
    let mut record: JobRecord = serde_json::from_str(row.try_get("record")?)?;
    let progress: Option<&str> = row.try_get("progress")?;
    if !record.view.state.is_final() {
        record.view.progress = progress.map(serde_json::from_str::<Step>).transpose()?;
    }
    record.view.batch = row.try_get("batch")?;
    let revision: i64 = row.try_get("revision")?;
    Ok((record, u64::try_from(revision).unwrap_or(0)))
}

/// One submission of an owner at a time, until the transaction ends: keys are used once, and shares are counted exactly.
pub(super) async fn lock_owner(transaction: &Transaction<'_>, owner: &str) -> Result<(), Failure> {
    let lock = "SELECT pg_advisory_xact_lock(hashtextextended('lacuna owner ' || $1, 0))::text";
    transaction.query_typed(lock, &[(&owner, Type::TEXT)]).await?;
    Ok(())
}

/// Puts an owner behind all others: first come, first served is for the jobs of one owner, and owners are served by turns.
pub(super) async fn note_turn(transaction: &Transaction<'_>, owner: &str) -> Result<(), Failure> {
    let statement = "INSERT INTO lacuna_turns (owner, turn) VALUES ($1, nextval('lacuna_turn'))
        ON CONFLICT (owner) DO UPDATE SET turn = excluded.turn";
    transaction.execute_typed(statement, &[(&owner, Type::TEXT)]).await?;
    Ok(())
}

/// The record of a job, which stays as it is until the transaction ends.
pub(super) async fn locked(transaction: &Transaction<'_>, id: &str) -> Result<Option<(JobRecord, u64)>, Failure> {
    let question = format!("SELECT {COLUMNS} FROM lacuna_jobs WHERE id = $1 FOR UPDATE");
    transaction.query_typed_opt(&question, &[(&id, Type::TEXT)]).await?.map(|row| read(&row)).transpose()
}

/// Puts a new job into its place and tells of it.
pub(super) async fn insert(transaction: &Transaction<'_>, record: &JobRecord) -> Result<(), Failure> {
    let statement =
        "INSERT INTO lacuna_jobs (id, owner, kind, state, work, document, attempt, record, idempotency_key, results, finished, batch)
        VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, CASE WHEN $11 THEN now() END, $12) RETURNING pg_notify($13, $14)::text";
    let view = &record.view;
    let key = record.idempotency.as_ref().map(|used| used.key.hex());
    let values: [(&(dyn ToSql + Sync), Type); 14] = [
        (&view.id, Type::TEXT),
        (&record.owner, Type::TEXT),
        (&crate::documents::kind_word(view.kind), Type::TEXT),
        (&view.state.word(), Type::TEXT),
        (&record.work.hex(), Type::TEXT),
        (&record.document.hex(), Type::TEXT),
        (&attempt(view), Type::INT4),
        (&serde_json::to_string(record)?, Type::TEXT),
        (&key, Type::TEXT),
        (&results(&view.outputs), Type::TEXT_ARRAY),
        (&view.state.is_final(), Type::BOOL),
        (&view.batch, Type::TEXT),
        (&CHANNEL, Type::TEXT),
        (&told(view), Type::TEXT),
    ];
    transaction.query_typed(statement, &values).await?;
    Ok(())
}

/// Changes a job's record, which is [`locked`], and tells of it; the lease is the time for which a worker has it.
pub(super) async fn update(transaction: &Transaction<'_>, record: &JobRecord, lease: Duration) -> Result<(), Failure> {
    let statement = "UPDATE lacuna_jobs SET state = $2, attempt = $3, record = $4, results = $5, revision = revision + 1, progress = NULL,
        finished = CASE WHEN $6 THEN now() END,
        lease_until = CASE WHEN $7 THEN now() + $8 * interval '1 second' ELSE lease_until END
        WHERE id = $1 RETURNING pg_notify($9, $10)::text";
    let view = &record.view;
    let values: [(&(dyn ToSql + Sync), Type); 10] = [
        (&view.id, Type::TEXT),
        (&view.state.word(), Type::TEXT),
        (&attempt(view), Type::INT4),
        (&serde_json::to_string(record)?, Type::TEXT),
        (&results(&view.outputs), Type::TEXT_ARRAY),
        (&view.state.is_final(), Type::BOOL),
        (&(view.state == JobState::Running), Type::BOOL),
        (&lease.as_secs_f64(), Type::FLOAT8),
        (&CHANNEL, Type::TEXT),
        (&told(view), Type::TEXT),
    ];
    transaction.query_typed(statement, &values).await?;
    Ok(())
}

/// Leaves of a job what [`JobRecord::expire`] says, and tells of it; from then on `finished` is the time of that.
pub(super) async fn expire(transaction: &Transaction<'_>, record: &JobRecord) -> Result<(), Failure> {
    let statement =
        "UPDATE lacuna_jobs SET state = $2, record = $3, idempotency_key = NULL, progress = NULL, revision = revision + 1, finished = now()
        WHERE id = $1 RETURNING pg_notify($4, $5)::text";
    let view = &record.view;
    let values: [(&(dyn ToSql + Sync), Type); 5] = [
        (&view.id, Type::TEXT),
        (&view.state.word(), Type::TEXT),
        (&serde_json::to_string(record)?, Type::TEXT),
        (&CHANNEL, Type::TEXT),
        (&told(view), Type::TEXT),
    ];
    transaction.query_typed(statement, &values).await?;
    Ok(())
}

/// What the same work left.
pub(super) async fn keep_answer(transaction: &Transaction<'_>, record: &JobRecord, answer: &Answer) -> Result<(), Failure> {
    let statement = "INSERT INTO lacuna_answers (work, answer) VALUES ($1, $2)
        ON CONFLICT (work) DO UPDATE SET answer = excluded.answer, made = now()";
    let (work, answer) = (record.work.hex(), serde_json::to_string(answer)?);
    transaction.execute_typed(statement, &[(&work, Type::TEXT), (&answer, Type::TEXT)]).await?;
    Ok(())
}

/// What every process hears when the transaction is committed.
fn told(view: &JobView) -> String {
    format!("{} {}", view.state.word(), view.id)
}

/// The attempt as the database counts it.
pub(super) fn attempt(view: &JobView) -> i32 {
    i32::try_from(view.attempt).unwrap_or(i32::MAX)
}

fn results(outputs: &[Output]) -> Vec<String> {
    outputs.iter().map(|output| output.digest.hex()).collect()
}
