//! What goes on beside the questions: hearing of changes, renewing leases, taking up what a dead worker left.

use std::sync::atomic::Ordering;
use std::sync::{Arc, Weak};
use std::time::Duration;

use tokio::time::Instant;
use tokio_postgres::types::{ToSql, Type};

use super::Shared;
use super::pool::Failure;
use super::rows::{self, CHANNEL};
use crate::jobs::live::LiveJob;
use crate::jobs::record::{JobState, JobView};

/// Between two looks at what a worker's progress has to tell: enough for a smooth bar.
const PROGRESS_EVERY: Duration = Duration::from_millis(250);

/// Longest time between two renewals of a lease; each also tells whether the job is to stop.
const BEAT_EVERY: Duration = Duration::from_secs(1);

/// Between two looks for leases that have run out.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Before the next try to listen.
const LISTEN_AGAIN: Duration = Duration::from_millis(500);

/// Starts what lives as long as the ledger.
pub(super) fn start(ledger: &Arc<Shared>) {
    tokio::spawn(listen(Arc::downgrade(ledger)));
    tokio::spawn(look_after(Arc::downgrade(ledger)));
}

/// Hears of changes, over one connection after the other.
async fn listen(ledger: Weak<Shared>) {
    while let Some(shared) = ledger.upgrade() {
        let began = || {
            shared.listening.store(true, Ordering::SeqCst);
            // What happened while nobody listened.
            shared.arrived.notify_waiters();
            tokio::spawn(refresh_all(Arc::clone(&shared)));
        };
        let hear = |payload: &str| {
            if let Some((word, id)) = payload.split_once(' ') {
                heard(&shared, word, id);
            }
        };
        if shared.pool.listen(CHANNEL, began, hear).await.is_err() {
            tracing::debug!("changes of jobs are not heard; they are looked for");
        }
        shared.listening.store(false, Ordering::SeqCst);
        drop(shared);
        tokio::time::sleep(LISTEN_AGAIN).await;
    }
}

/// A job has come to a state, has made progress, or is gone.
fn heard(shared: &Arc<Shared>, word: &str, id: &str) {
    if word != "progress" {
        // A new job, or the end of work that others wait for.
        shared.arrived.notify_waiters();
    }
    if matches!(word, "cancelling" | "gone")
        && let Some(job) = crate::locked(&shared.held).get(id)
    {
        job.stop();
    }
    let watched = crate::locked(&shared.mirrors).get(id).and_then(Weak::upgrade);
    if let Some(job) = watched {
        tokio::spawn(refresh(Arc::clone(shared), job));
    }
}

/// Looks at the present record of a job that somebody watches.
async fn refresh(shared: Arc<Shared>, job: Arc<LiveJob>) {
    let asked = async {
        let client = shared.pool.get().await?;
        let question = format!("SELECT {} FROM lacuna_jobs WHERE id = $1", rows::COLUMNS);
        let row = client.query_typed_opt(&question, &[(&job.id(), Type::TEXT)]).await?;
        client.done();
        row.map(|row| rows::read(&row)).transpose()
    };
    match shared.within(asked).await {
        Ok(Some((record, revision))) => job.refresh(record, revision),
        Ok(None) => job.vanish(),
        Err(problem) => tracing::debug!(detail = %problem.detail, "a job could not be looked at"),
    }
}

async fn refresh_all(shared: Arc<Shared>) {
    let watched: Vec<Arc<LiveJob>> = crate::locked(&shared.mirrors).values().filter_map(Weak::upgrade).collect();
    for job in watched.into_iter().filter(|job| !job.state().is_final()) {
        refresh(Arc::clone(&shared), job).await;
    }
}

/// Takes up the jobs of workers that were not heard of for the time of their lease.
///
/// While the database was away no worker could renew its lease, nor while the machine stood still. So only who has
/// reached the database all through the time of two leases, and was not held up itself, judges others by theirs: in the
/// first of them every worker finds its way back.
async fn look_after(ledger: Weak<Shared>) {
    let mut reached_since = Instant::now();
    loop {
        let rest = Instant::now();
        tokio::time::sleep(LOOK_EVERY).await;
        let Some(shared) = ledger.upgrade() else { return };
        if rest.elapsed() > LOOK_EVERY + shared.lease / 2 {
            reached_since = Instant::now();
        }
        crate::locked(&shared.mirrors).retain(|_, job| job.strong_count() > 0);
        if let Err(problem) = shared.within(take_up(&shared, &mut reached_since)).await {
            tracing::warn!(detail = %problem.detail, "leases cannot be looked at");
            reached_since = Instant::now();
        }
        if !shared.listening.load(Ordering::SeqCst) {
            refresh_all(shared).await;
        }
    }
}

async fn take_up(shared: &Shared, reached_since: &mut Instant) -> Result<(), Failure> {
    let asked = Instant::now();
    let mut client = shared.pool.get().await?;
    let transaction = client.transaction().await?;
    // Who waited so long for an answer was not the only one.
    if asked.elapsed() > shared.lease / 2 {
        *reached_since = Instant::now();
    }
    let judges = reached_since.elapsed() > 2 * shared.lease;
    let question = format!(
        "SELECT {} FROM lacuna_jobs WHERE state IN ('running', 'cancelling') AND lease_until < now() AND $1
        ORDER BY number LIMIT 32 FOR UPDATE SKIP LOCKED",
        rows::COLUMNS
    );
    for row in transaction.query_typed(&question, &[(&judges, Type::BOOL)]).await? {
        let (mut record, _) = rows::read(&row)?;
        record.view.take_up();
        tracing::warn!(job = %record.view.id, attempt = record.view.attempt, state = record.view.state.word(), "a worker was lost");
        rows::update(&transaction, &record, shared.lease).await?;
    }
    transaction.commit().await?;
    client.done();
    Ok(())
}

/// Renews the lease of a job that a worker of this process is at, tells of its progress, and stops it when it is to
/// stop or is another's.
///
/// It runs on the runtime's threads, not on the worker's: geometry cannot keep it from its beat.
pub(super) fn keep_alive(shared: &Arc<Shared>, job: &Arc<LiveJob>) {
    let (shared, job) = (Arc::clone(shared), Arc::clone(job));
    tokio::spawn(async move {
        let id = job.id();
        let every = BEAT_EVERY.min(shared.lease / 4);
        let (mut told, mut last) = (None, Instant::now());
        loop {
            tokio::time::sleep(PROGRESS_EVERY).await;
            if !crate::locked(&shared.held).get(&id).is_some_and(|held| Arc::ptr_eq(held, &job)) {
                return;
            }
            let view = job.view();
            let listening = shared.listening.load(Ordering::SeqCst);
            let news = view.progress != told;
            if !news && listening && last.elapsed() < every {
                continue;
            }
            match shared.within(beat(&shared, &view, news)).await {
                Ok(Some(JobState::Cancelling)) => job.stop(),
                Ok(Some(_)) => {}
                Ok(None) => {
                    tracing::warn!(job = %id, "the lease is lost");
                    job.stop();
                    return;
                }
                Err(problem) => {
                    // The work goes on: nobody is given up by those who cannot look either.
                    tracing::warn!(job = %id, detail = %problem.detail, "the lease is not renewed");
                    continue;
                }
            }
            (told, last) = (view.progress, Instant::now());
        }
    });
}

/// The job's state, if it is still this attempt's.
async fn beat(shared: &Shared, view: &JobView, news: bool) -> Result<Option<JobState>, Failure> {
    let statement = "WITH beat AS (
            UPDATE lacuna_jobs SET lease_until = now() + $3 * interval '1 second',
                progress = CASE WHEN $4 THEN $5 ELSE progress END, revision = revision + CASE WHEN $4 THEN 1 ELSE 0 END
            WHERE id = $1 AND attempt = $2 AND state IN ('running', 'cancelling') RETURNING state)
        SELECT state, CASE WHEN $4 THEN pg_notify($6, 'progress ' || $1)::text END FROM beat";
    let progress = view.progress.as_ref().map(serde_json::to_string).transpose()?;
    let client = shared.pool.get().await?;
    let lease = shared.lease.as_secs_f64();
    let values: [(&(dyn ToSql + Sync), Type); 6] = [
        (&view.id, Type::TEXT),
        (&rows::attempt(view), Type::INT4),
        (&lease, Type::FLOAT8),
        (&news, Type::BOOL),
        (&progress, Type::TEXT),
        (&CHANNEL, Type::TEXT),
    ];
    let row = client.query_typed_opt(statement, &values).await?;
    client.done();
    Ok(row.and_then(|row| JobState::of_word(row.get(0))))
}
