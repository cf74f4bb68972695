//! A job in memory: its record, its events and the flag that stops it.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use lacuna_kernel::budget::{CancelToken, Progress};

use super::events::EventLog;
use super::record::{JobRecord, JobState, JobView, Step};

/// Shortest time between two progress events of a phase: enough for a smooth bar.
const PROGRESS_EVERY: Duration = Duration::from_millis(100);

/// A job of the desk.
#[derive(Debug)]
pub struct LiveJob {
    record: Mutex<JobRecord>,
    last_progress: Mutex<Option<Instant>>,
    /// Stops the computation.
    pub cancel: CancelToken,
    /// What happened, for listeners.
    pub events: EventLog,
}

impl LiveJob {
    /// A job with its record and no listener.
    #[must_use]
    pub fn new(record: JobRecord) -> Self {
        let view = record.view.clone();
        let job =
            Self { record: Mutex::new(record), last_progress: Mutex::default(), cancel: CancelToken::new(), events: EventLog::default() };
        // Whoever listens first learns where the job stands, even if it ended in another process.
        job.announce(&view);
        job
    }

    /// What the owner sees now.
    #[must_use]
    pub fn view(&self) -> JobView {
        crate::locked(&self.record).view.clone()
    }

    /// What is kept of it now.
    #[must_use]
    pub fn record(&self) -> JobRecord {
        crate::locked(&self.record).clone()
    }

    /// Looks at the record without a copy.
    pub fn with<T>(&self, look: impl FnOnce(&JobRecord) -> T) -> T {
        look(&crate::locked(&self.record))
    }

    /// Changes the record and tells listeners if the state changed by it.
    pub fn update<T>(&self, change: impl FnOnce(&mut JobRecord) -> T) -> T {
        let mut record = crate::locked(&self.record);
        let before = record.view.state;
        let result = change(&mut record);
        let view = record.view.clone();
        drop(record);
        if view.state != before {
            self.announce(&view);
        }
        result
    }

    /// Takes what the kernel tells of its progress.
    pub fn progress(&self, progress: &Progress) {
        let now = Instant::now();
        let mut last = crate::locked(&self.last_progress);
        let mut record = crate::locked(&self.record);
        let same_phase = record.view.progress.as_ref().is_some_and(|step| step.phase == progress.phase);
        if same_phase && last.is_some_and(|last| now.duration_since(last) < PROGRESS_EVERY) {
            return;
        }
        let step = Step { phase: progress.phase.to_owned(), fraction: progress.fraction, count: progress.count };
        *last = Some(now);
        record.view.progress = Some(step.clone());
        drop(record);
        self.events.push("progress", &step);
    }

    fn announce(&self, view: &JobView) {
        if !view.state.is_final() {
            self.events.push("state", &serde_json::json!({ "state": view.state, "attempt": view.attempt }));
            return;
        }
        for warning in &view.warnings {
            self.events.push("warning", &serde_json::json!({ "message": warning }));
        }
        for output in &view.outputs {
            self.events.push("output", output);
        }
        self.events.push("done", view);
    }

    /// Waits until the job has ended, but not longer than the time given.
    pub async fn wait(&self, time: Duration) -> JobView {
        let mut latest = self.events.subscribe();
        let ended = async {
            // The sender lives in `self`, so a change can always be waited for.
            while !self.with(|record| record.view.state.is_final()) && latest.changed().await.is_ok() {}
        };
        let _ = tokio::time::timeout(time, ended).await;
        self.view()
    }

    /// Whether it waits, runs or is done.
    #[must_use]
    pub fn state(&self) -> JobState {
        self.with(|record| record.view.state)
    }
}
