//! The ledger of several processes, in a PostgreSQL database.
//!
//! A job is a row, and every change of it is one transaction, so that whoever is answered is answered from what is
//! committed. A worker holds a job by a lease that it renews; the number of the attempt is the token with which it
//! writes, and whoever lost the lease has an old one. Changes are told with `NOTIFY`; what a process missed while it was
//! not listening it finds by looking again.

use std::collections::{HashMap, HashSet};
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, Weak};
use std::time::Duration;

use futures_util::future::try_join_all;
use tokio::runtime::Handle;
use tokio::sync::Notify;
use tokio_postgres::error::SqlState;
use tokio_postgres::types::{ToSql, Type};
use tokio_postgres::{Row, Transaction};

use super::desk::{DeskLimits, Gauges, JobFilter, Made, Retention};
use super::live::LiveJob;
use super::record::{Answer, Ending, Idempotency, JobRecord, JobState, JobView};
use super::refusal;
use crate::digest::Digest;
use crate::documents::kind_word;
use crate::problem::Problem;
use crate::store::Store;
use pool::{Failure, Pool};

mod batches;
mod pool;
mod rows;
mod upkeep;

/// How long one question, with all its statements, may take.
const PATIENCE: Duration = Duration::from_secs(6);

/// Between two looks at the queue when nothing is told.
const LOOK_AGAIN: Duration = Duration::from_secs(1);

/// What makes the tables, step by step: the version of a database is the number of steps that it has behind it.
const STEPS: [&str; 3] = [include_str!("schema.sql"), include_str!("batches.sql"), include_str!("turns.sql")];

/// The ledger.
#[derive(Debug)]
pub(super) struct Shared {
    pool: Pool,
    limits: DeskLimits,
    lease: Duration,
    store: Arc<Store>,
    runtime: Handle,
    /// Jobs that somebody in this process looks at.
    mirrors: Mutex<HashMap<String, Weak<LiveJob>>>,
    /// Jobs that workers of this process are at.
    held: Mutex<HashMap<String, Arc<LiveJob>>>,
    /// Something may wait.
    arrived: Notify,
    closed: AtomicBool,
    /// Whether changes are heard as they happen.
    listening: AtomicBool,
}

impl Shared {
    /// Opens the ledger, makes its tables if they are not there, and starts to listen and to look after leases.
    pub(super) async fn open(
        database: &str,
        lease: Duration,
        store: Arc<Store>,
        limits: DeskLimits,
        runtime: Handle,
    ) -> Result<Arc<Self>, Problem> {
        let ledger = Arc::new(Self {
            pool: Pool::new(database)?,
            limits,
            lease,
            store,
            runtime,
            mirrors: Mutex::default(),
            held: Mutex::default(),
            arrived: Notify::new(),
            closed: AtomicBool::new(false),
            listening: AtomicBool::new(false),
        });
        ledger.within(ledger.prepare()).await?;
        upkeep::start(&ledger);
        Ok(ledger)
    }

    /// Makes the tables. Several processes may start at once: one makes them, the others wait for it.
    async fn prepare(&self) -> Result<(), Failure> {
        let mut client = self.pool.get().await?;
        let transaction = client.transaction().await?;
        transaction.execute("SELECT pg_advisory_xact_lock(hashtextextended('lacuna schema', 0))", &[]).await?;
        transaction.batch_execute("CREATE TABLE IF NOT EXISTS lacuna_schema (version integer NOT NULL)").await?;
        let found: Option<i32> = transaction.query_opt("SELECT version FROM lacuna_schema", &[]).await?.map(|row| row.get(0));
        if found.is_none() {
            transaction.execute("INSERT INTO lacuna_schema (version) VALUES (0)", &[]).await?;
        }
        let version = found.unwrap_or(0);
        let Some(left) = usize::try_from(version).ok().and_then(|version| STEPS.get(version..)) else {
            let detail = format!("The database has tables of version {version}; this program reads versions up to {}", STEPS.len());
            return Err(Problem::new(crate::problem::ProblemKind::Usage, detail).code("database-version").into());
        };
        for step in left {
            transaction.batch_execute(step).await?;
            transaction.execute("UPDATE lacuna_schema SET version = version + 1", &[]).await?;
        }
        transaction.commit().await?;
        client.done();
        Ok(())
    }

    /// Asks the database, but not for longer than it may take.
    async fn within<T>(&self, question: impl Future<Output = Result<T, Failure>>) -> Result<T, Problem> {
        match tokio::time::timeout(PATIENCE, question).await {
            Ok(answer) => answer.map_err(Problem::from),
            Err(_) => Err(pool::away()),
        }
    }

    pub(super) fn submit(&self, record: JobRecord) -> Result<(Arc<LiveJob>, bool), Problem> {
        let known = self.known_answers(std::slice::from_ref(&record))?;
        let (record, revision, replayed) = self.runtime.block_on(self.within(self.accept(record, known)))?;
        Ok((self.mirror(record, revision), replayed))
    }

    /// The job that an owner's idempotency key made, if it did.
    pub(super) fn made_by(&self, owner: &str, used: &Idempotency) -> Result<Option<Arc<LiveJob>>, Problem> {
        let asked = async {
            let client = self.pool.get().await?;
            let row = client.query_typed_opt(&of_key(), &[(&owner, Type::TEXT), (&used.key.hex(), Type::TEXT)]).await?;
            client.done();
            row.map(|row| first_of_key(&row, used)).transpose()
        };
        Ok(self.runtime.block_on(self.within(asked))?.map(|(record, revision)| self.mirror(record, revision)))
    }

    /// What the same work as that of these jobs left earlier, where all of it is still there.
    fn known_answers(&self, records: &[JobRecord]) -> Result<HashMap<Digest, Answer>, Problem> {
        let asked = async {
            let client = self.pool.get().await?;
            let question = "SELECT work, answer FROM lacuna_answers WHERE work = ANY($1)";
            let found = client.query_typed(question, &[(&works(records), Type::TEXT_ARRAY)]).await?;
            client.done();
            let read = |row: &Row| Ok((digest(row.try_get(0)?), serde_json::from_str(row.try_get(1)?)?));
            found.iter().map(read).collect::<Result<Vec<(Option<Digest>, Answer)>, Failure>>()
        };
        let found = self.runtime.block_on(self.within(asked))?;
        // The store is asked outside of the transaction, which others wait for.
        let whole = |answer: &Answer| answer.outputs.iter().try_fold(true, |all, o| Ok(all && self.store.holds_result(o.digest)?));
        let mut known = HashMap::new();
        for (work, answer) in found {
            let whole = whole(&answer).map_err(|error: io::Error| Problem::io("earlier results could not be looked for", &error))?;
            known.extend(work.filter(|_| whole).map(|work| (work, answer)));
        }
        Ok(known)
    }

    async fn accept(&self, record: JobRecord, known: HashMap<Digest, Answer>) -> Result<(JobRecord, u64, bool), Failure> {
        let mut client = self.pool.get().await?;
        let transaction = client.transaction().await?;
        rows::lock_owner(&transaction, &record.owner).await?;
        if let Some(used) = &record.idempotency {
            let values = [(&record.owner as _, Type::TEXT), (&used.key.hex() as _, Type::TEXT)];
            if let Some(row) = transaction.query_typed_opt(&of_key(), &values).await? {
                let (first, revision) = first_of_key(&row, used)?;
                drop(transaction);
                client.done();
                return Ok((first, revision, true));
            }
        }
        let record = self.admit(&transaction, vec![record], known).await?.remove(0);
        transaction.commit().await?;
        client.done();
        Ok((record, 1, false))
    }

    /// Puts the jobs of an owner, who is locked, into their places, all or none, if there is room for those that have no answer yet.
    async fn admit(
        &self,
        transaction: &Transaction<'_>,
        mut records: Vec<JobRecord>,
        known: HashMap<Digest, Answer>,
    ) -> Result<Vec<JobRecord>, Failure> {
        // Nobody sweeps the answers' files before these jobs, which name them, are committed.
        let question = "SELECT work FROM lacuna_answers WHERE work = ANY($1) ORDER BY work FOR KEY SHARE";
        let kept = transaction.query_typed(question, &[(&works(&records), Type::TEXT_ARRAY)]).await?;
        let kept: HashSet<Digest> = kept.iter().filter_map(|row| digest(row.get(0))).collect();
        for record in &mut records {
            if let Some(answer) = known.get(&record.work).filter(|_| kept.contains(&record.work)) {
                record.view.finish(answer.clone(), true);
            }
        }
        let more = records.iter().filter(|record| !record.view.state.is_final()).count();
        if more > 0 {
            let owner = &records[0].owner;
            let question = "SELECT count(*) FILTER (WHERE owner = $1), count(*) FILTER (WHERE state = 'queued')
                FROM lacuna_jobs WHERE state IN ('queued', 'running', 'cancelling')";
            let row = transaction.query_typed_one(question, &[(owner, Type::TEXT)]).await?;
            let count = |place: usize| usize::try_from(row.get::<_, i64>(place)).unwrap_or(usize::MAX);
            refusal::unless_room("this key", count(0), more, self.limits.per_owner)?;
            refusal::unless_room("all callers", count(1), more, self.limits.queued)?;
        }
        // All are on their way before the first answer comes.
        try_join_all(records.iter().map(|record| rows::insert(transaction, record))).await?;
        Ok(records)
    }

    /// The job as this process shows it: one object, however many look at it.
    fn mirror(&self, record: JobRecord, revision: u64) -> Arc<LiveJob> {
        let mut mirrors = crate::locked(&self.mirrors);
        if let Some(job) = mirrors.get(&record.view.id).and_then(Weak::upgrade) {
            drop(mirrors);
            job.refresh(record, revision);
            return job;
        }
        let id = record.view.id.clone();
        let job = Arc::new(LiveJob::at(record, revision));
        mirrors.insert(id, Arc::downgrade(&job));
        job
    }

    pub(super) async fn find(&self, owner: &str, id: &str) -> Result<Option<Arc<LiveJob>>, Problem> {
        let asked = async {
            let client = self.pool.get().await?;
            let question = format!("SELECT {} FROM lacuna_jobs WHERE id = $1 AND owner = $2", rows::COLUMNS);
            let row = client.query_typed_opt(&question, &[(&id, Type::TEXT), (&owner, Type::TEXT)]).await?;
            client.done();
            row.map(|row| rows::read(&row)).transpose()
        };
        Ok(self.within(asked).await?.map(|(record, revision)| self.mirror(record, revision)))
    }

    pub(super) async fn page(&self, owner: &str, filter: &JobFilter, length: usize) -> Result<Vec<JobView>, Problem> {
        let asked = async {
            let client = self.pool.get().await?;
            let question = format!(
                "SELECT {} FROM lacuna_jobs WHERE owner = $1 AND ($2::text IS NULL OR state = $2) AND ($3::text IS NULL OR kind = $3)
                AND ($4::text IS NULL OR id < $4) ORDER BY id DESC LIMIT $5",
                rows::COLUMNS
            );
            let (state, kind) = (filter.state.map(JobState::word), filter.kind.map(kind_word));
            let length = i64::try_from(length).unwrap_or(i64::MAX);
            let values: [(&(dyn ToSql + Sync), Type); 5] =
                [(&owner, Type::TEXT), (&state, Type::TEXT), (&kind, Type::TEXT), (&filter.before, Type::TEXT), (&length, Type::INT8)];
            let rows = client.query_typed(&question, &values).await?;
            client.done();
            rows.iter().map(|row| rows::read(row).map(|(record, _)| record.view)).collect()
        };
        self.within(asked).await
    }

    pub(super) async fn find_output(&self, owner: &str, digest: Digest) -> Result<Option<Made>, Problem> {
        let asked = async {
            let client = self.pool.get().await?;
            let question = format!(
                "SELECT {} FROM lacuna_jobs WHERE owner = $1 AND results @> ARRAY[$2::text]
                ORDER BY state = 'expired', id DESC LIMIT 1",
                rows::COLUMNS
            );
            let row = client.query_typed_opt(&question, &[(&owner, Type::TEXT), (&digest.hex(), Type::TEXT)]).await?;
            client.done();
            row.map(|row| rows::read(&row)).transpose()
        };
        let found = self.within(asked).await?;
        Ok(found.and_then(|(record, _)| {
            let expired = record.view.state == JobState::Expired;
            let output = record.view.outputs.into_iter().find(|output| output.digest == digest)?;
            Some(Made { output, expired })
        }))
    }

    pub(super) async fn gauges(&self) -> Result<Gauges, Problem> {
        let asked = async {
            let client = self.pool.get().await?;
            let question = "SELECT count(*) FILTER (WHERE state = 'queued'), count(*) FILTER (WHERE state IN ('running', 'cancelling')),
                count(*) FROM lacuna_jobs";
            let row = client.query_typed_one(question, &[]).await?;
            client.done();
            let count = |place: usize| u64::try_from(row.get::<_, i64>(place)).unwrap_or(0);
            Ok(Gauges { queued: count(0), running: count(1), kept: count(2) })
        };
        self.within(asked).await
    }

    pub(super) fn cancel(&self, job: &LiveJob) -> Result<JobView, Problem> {
        let id = job.id();
        let asked = async {
            let mut client = self.pool.get().await?;
            let transaction = client.transaction().await?;
            let Some((mut record, mut revision)) = rows::locked(&transaction, &id).await? else { return Ok(None) };
            let before = record.view.state;
            match before {
                JobState::Queued => record.view.end_cancelled(),
                JobState::Running => record.view.state = JobState::Cancelling,
                _ => {}
            }
            if record.view.state != before {
                rows::update(&transaction, &record, self.lease).await?;
                revision += 1;
            }
            transaction.commit().await?;
            client.done();
            Ok(Some((record, revision)))
        };
        if let Some((record, revision)) = self.runtime.block_on(self.within(asked))? {
            job.refresh(record, revision);
        }
        Ok(job.view())
    }

    pub(super) fn forget(&self, job: &LiveJob) -> Result<(), Problem> {
        self.cancel(job)?;
        let id = job.id();
        let asked = async {
            let client = self.pool.get().await?;
            let statement = "WITH gone AS (DELETE FROM lacuna_jobs WHERE id = $1 RETURNING id)
                SELECT pg_notify($2, 'gone ' || id)::text FROM gone";
            client.query_typed(statement, &[(&id, Type::TEXT), (&rows::CHANNEL, Type::TEXT)]).await?;
            client.done();
            Ok(())
        };
        self.runtime.block_on(self.within(asked))
    }

    /// Waits for the next job whose work nobody is at; none once the ledger is closed.
    pub(super) fn take(self: &Arc<Self>) -> Option<Arc<LiveJob>> {
        self.runtime.block_on(async {
            loop {
                let arrived = self.arrived.notified();
                if self.closed.load(Ordering::SeqCst) {
                    return None;
                }
                match self.within(self.take_one()).await {
                    Ok(Some(job)) => {
                        crate::locked(&self.held).insert(job.id(), Arc::clone(&job));
                        upkeep::keep_alive(self, &job);
                        if self.closed.load(Ordering::SeqCst) {
                            // Taken while this process began to go: who stops what runs may have looked before.
                            job.cancel.fire(lacuna_kernel::budget::StopReason::Cancelled);
                        }
                        return Some(job);
                    }
                    Ok(None) => {}
                    Err(problem) => tracing::warn!(detail = %problem.detail, "the queue cannot be looked at"),
                }
                let _ = tokio::time::timeout(LOOK_AGAIN, arrived).await;
            }
        })
    }

    async fn take_one(&self) -> Result<Option<Arc<LiveJob>>, Failure> {
        loop {
            let mut client = self.pool.get().await?;
            let transaction = client.transaction().await?;
            let question = format!(
                "SELECT {} FROM lacuna_jobs job LEFT JOIN lacuna_turns last ON last.owner = job.owner WHERE state = 'queued' AND NOT EXISTS
                (SELECT FROM lacuna_jobs other WHERE other.work = job.work AND other.state IN ('running', 'cancelling'))
                ORDER BY coalesce(last.turn, 0), number LIMIT 1 FOR UPDATE OF job SKIP LOCKED",
                rows::COLUMNS
            );
            let Some(row) = transaction.query_typed_opt(&question, &[]).await? else {
                drop(transaction);
                client.done();
                return Ok(None);
            };
            let (mut record, revision) = rows::read(&row)?;
            record.view.start();
            match rows::update(&transaction, &record, self.lease).await {
                Ok(()) => {}
                // Another worker has just started equal work: this job waits for its answer.
                Err(Failure::Database(error)) if error.code() == Some(&SqlState::UNIQUE_VIOLATION) => continue,
                Err(error) => return Err(error),
            }
            rows::note_turn(&transaction, &record.owner).await?;
            transaction.commit().await?;
            client.done();
            return Ok(Some(Arc::new(LiveJob::at(record, revision + 1))));
        }
    }

    /// Records how a job ended, and ends the jobs with it that wait for the same work; none if it is another's by now.
    pub(super) fn conclude(&self, job: &LiveJob, ending: &Ending) -> Result<Option<JobState>, Problem> {
        let state = self.runtime.block_on(self.within(self.record_end(job, ending)))?;
        crate::locked(&self.held).remove(&job.id());
        Ok(state)
    }

    async fn record_end(&self, job: &LiveJob, ending: &Ending) -> Result<Option<JobState>, Failure> {
        let (id, attempt) = job.with(|record| (record.view.id.clone(), record.view.attempt));
        let mut client = self.pool.get().await?;
        let transaction = client.transaction().await?;
        let kept = rows::locked(&transaction, &id).await?;
        // The fence: a later attempt, or an end, was recorded by somebody else.
        let Some((mut record, _)) = kept.filter(|(record, _)| record.view.attempt == attempt && !record.view.state.is_final()) else {
            return Ok(None);
        };
        record.view.conclude(ending.clone());
        rows::update(&transaction, &record, self.lease).await?;
        if let Ending::Done(answer) = ending {
            rows::keep_answer(&transaction, &record, answer).await?;
            let question = format!("SELECT {} FROM lacuna_jobs WHERE state = 'queued' AND work = $1 FOR UPDATE SKIP LOCKED", rows::COLUMNS);
            for row in transaction.query_typed(&question, &[(&record.work.hex(), Type::TEXT)]).await? {
                let (mut follower, _) = rows::read(&row)?;
                follower.view.finish((**answer).clone(), true);
                rows::update(&transaction, &follower, self.lease).await?;
            }
        }
        transaction.commit().await?;
        client.done();
        Ok(Some(record.view.state))
    }

    pub(super) fn probe(&self) -> Result<(), Problem> {
        let asked = async {
            let client = self.pool.get().await?;
            client.query_typed_one("SELECT 1", &[]).await?;
            client.done();
            Ok(())
        };
        self.runtime.block_on(self.within(asked))
    }

    /// Lets jobs expire, forgets expired ones, then the answers and files that no other job has.
    pub(super) fn sweep(&self, retention: Retention) -> Result<usize, Problem> {
        while self.runtime.block_on(self.within(self.expire_some(retention.jobs)))? > 0 {}
        let forgotten = async {
            let client = self.pool.get().await?;
            let most = i64::try_from(retention.most_records).unwrap_or(i64::MAX);
            let statement = "DELETE FROM lacuna_jobs WHERE state = 'expired' AND (finished <= now() - $1 * interval '1 second'
                OR id IN (SELECT id FROM lacuna_jobs WHERE state = 'expired' ORDER BY id DESC OFFSET $2))";
            client.execute_typed(statement, &[(&retention.records.as_secs_f64(), Type::FLOAT8), (&most, Type::INT8)]).await?;
            let statement = "DELETE FROM lacuna_answers WHERE made < now() - $1 * interval '1 second' AND NOT EXISTS
                (SELECT FROM lacuna_jobs WHERE lacuna_jobs.work = lacuna_answers.work AND state <> 'expired')";
            client.execute_typed(statement, &[(&retention.jobs.as_secs_f64(), Type::FLOAT8)]).await?;
            let statement = "DELETE FROM lacuna_batches WHERE NOT EXISTS (SELECT FROM lacuna_jobs WHERE batch = lacuna_batches.id)";
            client.execute_typed(statement, &[]).await?;
            client.done();
            Ok(())
        };
        self.runtime.block_on(self.within(forgotten))?;
        // After the answers have gone nobody can begin to need their files.
        let needed = || {
            let asked = self.runtime.block_on(self.within(self.needed()));
            asked.map_err(|problem| io::Error::new(io::ErrorKind::NetworkUnreachable, problem.detail))
        };
        self.store.sweep(needed).map_err(|error| Problem::io("sweeping", &error))
    }

    /// Lets some jobs expire that ended longer ago than `age`, no more than are done well within the time for a question; tells how many.
    async fn expire_some(&self, age: Duration) -> Result<usize, Failure> {
        let mut client = self.pool.get().await?;
        let transaction = client.transaction().await?;
        let question = format!(
            "SELECT id, {} FROM lacuna_jobs WHERE finished < now() - $1 * interval '1 second' AND state <> 'expired'
            ORDER BY finished LIMIT 100 FOR UPDATE SKIP LOCKED",
            rows::COLUMNS
        );
        let old = transaction.query_typed(&question, &[(&age.as_secs_f64(), Type::FLOAT8)]).await?;
        for row in &old {
            match rows::read(row) {
                Ok((mut record, _)) => {
                    record.expire();
                    rows::expire(&transaction, &record).await?;
                }
                Err(_) => {
                    let id: &str = row.get("id");
                    tracing::error!(job = %id, "a record that cannot be read is forgotten: it is too old to be kept");
                    transaction.execute_typed("DELETE FROM lacuna_jobs WHERE id = $1", &[(&id, Type::TEXT)]).await?;
                }
            }
        }
        transaction.commit().await?;
        client.done();
        Ok(old.len())
    }

    async fn needed(&self) -> Result<HashSet<Digest>, Failure> {
        let client = self.pool.get().await?;
        let mut needed = HashSet::new();
        for row in client.query("SELECT document, results FROM lacuna_jobs WHERE state <> 'expired'", &[]).await? {
            needed.extend(digest(row.get(0)));
            needed.extend(row.get::<_, Vec<&str>>(1).into_iter().filter_map(digest));
        }
        for row in client.query("SELECT answer FROM lacuna_answers", &[]).await? {
            let answer: Answer = serde_json::from_str(row.get(0))?;
            needed.extend(answer.outputs.iter().map(|output| output.digest));
        }
        client.done();
        Ok(needed)
    }

    /// Hands out no more jobs.
    pub(super) fn close(&self) {
        self.closed.store(true, Ordering::SeqCst);
        self.arrived.notify_waiters();
    }

    /// Stops what runs here, so that another process takes it up.
    pub(super) fn interrupt(&self) {
        for job in crate::locked(&self.held).values() {
            job.cancel.fire(lacuna_kernel::budget::StopReason::Cancelled);
        }
    }
}

/// The digest that a column holds in hex digits.
fn digest(hex: &str) -> Option<Digest> {
    format!("sha256:{hex}").parse().ok()
}

/// The work of some jobs as a column holds it.
fn works(records: &[JobRecord]) -> Vec<String> {
    records.iter().map(|record| record.work.hex()).collect()
}

/// Asks for the job that an owner's idempotency key made.
fn of_key() -> String {
    format!("SELECT {} FROM lacuna_jobs WHERE owner = $1 AND idempotency_key = $2", rows::COLUMNS)
}

fn first_of_key(row: &Row, used: &Idempotency) -> Result<(JobRecord, u64), Failure> {
    let (first, revision) = rows::read(row)?;
    let same = first.idempotency.as_ref().is_some_and(|first| first.body == used.body);
    if same { Ok((first, revision)) } else { Err(refusal::key_used_otherwise().into()) }
}
