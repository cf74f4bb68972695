//! A job in memory: its record, its events and the flag that stops it.

use std::sync::Mutex;
use std::time::{Duration, Instant, SystemTime};

use lacuna_kernel::budget::{CancelToken, StopReason};

use super::events::EventLog;
use super::record::{JobRecord, JobState, JobView, Step};

/// Shortest time between two progress events of a phase: enough for a smooth bar.
const PROGRESS_EVERY: Duration = Duration::from_millis(100);

/// A phase of an attempt.
#[derive(Debug)]
pub struct Phase {
    /// Its name.
    pub name: String,
    /// When it began.
    pub since: SystemTime,
    /// When it began, by the clock that does not jump.
    pub began: Instant,
    /// The number of the process that computes.
    pub process: u32,
}

/// A job of the desk.
#[derive(Debug)]
pub struct LiveJob {
    record: Mutex<JobRecord>,
    last_progress: Mutex<Option<Instant>>,
    /// The phases of the attempt that is done here.
    phases: Mutex<Vec<Phase>>,
    /// Held by whoever makes a lasting change, from reading the record to telling of the change.
    changing: Mutex<()>,
    stopped: Mutex<Option<Instant>>,
    /// Stops the computation.
    pub cancel: CancelToken,
    /// What happened, for listeners.
    pub events: EventLog,
}

impl LiveJob {
    /// A job with its record and no listener.
    #[must_use]
    pub fn new(record: JobRecord) -> Self {
        Self::at(record, 0)
    }

    /// A job as it stands at a revision of its record in another process.
    #[must_use]
    pub fn at(record: JobRecord, revision: u64) -> Self {
        let view = record.view.clone();
        let job = Self {
            record: Mutex::new(record),
            last_progress: Mutex::default(),
            phases: Mutex::default(),
            changing: Mutex::default(),
            stopped: Mutex::default(),
            cancel: CancelToken::new(),
            events: EventLog::default(),
        };
        // Whoever listens first learns where the job stands, even if it ended in another process.
        job.events.advance(revision);
        job.announce(&view);
        job.announce_progress(&view);
        job
    }

    /// Takes over what another process has made of the job, unless a later revision is known.
    pub fn refresh(&self, record: JobRecord, revision: u64) {
        let _alone = crate::locked(&self.changing);
        if !self.events.advance(revision) {
            return;
        }
        let view = record.view.clone();
        let before = std::mem::replace(&mut *crate::locked(&self.record), record).view;
        if (view.state, view.attempt) != (before.state, before.attempt) {
            self.announce(&view);
        }
        if view.progress != before.progress {
            self.announce_progress(&view);
        }
    }

    /// Makes a change that lasts: `keep` puts the changed record in its place before anybody sees it.
    ///
    /// # Errors
    /// When `keep` fails; then nothing has changed.
    pub fn change<T, E>(&self, change: impl FnOnce(&mut JobRecord) -> T, keep: impl FnOnce(&JobRecord) -> Result<(), E>) -> Result<T, E> {
        let _alone = crate::locked(&self.changing);
        let before = self.record();
        let mut after = before.clone();
        let result = change(&mut after);
        if after != before {
            keep(&after)?;
            let mut record = crate::locked(&self.record);
            if !after.view.state.is_final() {
                // The kernel may have told of its progress meanwhile.
                after.view.progress.clone_from(&record.view.progress);
            }
            let view = after.view.clone();
            *record = after;
            drop(record);
            if view.state != before.view.state {
                self.announce(&view);
            }
        }
        Ok(result)
    }

    /// What the owner sees now.
    #[must_use]
    pub fn view(&self) -> JobView {
        crate::locked(&self.record).view.clone()
    }

    /// Its id.
    #[must_use]
    pub fn id(&self) -> String {
        self.with(|record| record.view.id.clone())
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

    /// Takes what the kernel tells of its progress, in a process with this number.
    pub fn progress(&self, step: Step, process: u32) {
        let now = Instant::now();
        let mut last = crate::locked(&self.last_progress);
        let mut record = crate::locked(&self.record);
        let same_phase = record.view.progress.as_ref().is_some_and(|known| known.phase == step.phase);
        let first_bound = step.bound_mm.is_some() && record.view.progress.as_ref().is_none_or(|known| known.bound_mm.is_none());
        if same_phase && !first_bound && last.is_some_and(|last| now.duration_since(last) < PROGRESS_EVERY) {
            return;
        }
        *last = Some(now);
        if !same_phase {
            crate::locked(&self.phases).push(Phase { name: step.phase.clone(), since: SystemTime::now(), began: Instant::now(), process });
        }
        record.view.progress = Some(step.clone());
        drop(record);
        self.events.push("progress", &step);
    }

    /// The phases that began since this was last asked.
    pub fn take_phases(&self) -> Vec<Phase> {
        std::mem::take(&mut *crate::locked(&self.phases))
    }

    fn announce_progress(&self, view: &JobView) {
        if let Some(step) = &view.progress {
            self.events.push("progress", step);
        }
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

    /// Asks the computation to stop, and notes when.
    pub fn stop(&self) {
        crate::locked(&self.stopped).get_or_insert_with(Instant::now);
        self.cancel.fire(StopReason::Cancelled);
    }

    /// How long ago the computation was first asked to stop.
    #[must_use]
    pub fn stopped_for(&self) -> Option<Duration> {
        crate::locked(&self.stopped).map(|since| since.elapsed())
    }

    /// Takes note that the record is gone: listeners hear of an end.
    pub fn vanish(&self) {
        let mut record = self.record();
        if !record.view.state.is_final() {
            record.view.end_cancelled();
            self.refresh(record, u64::from(u32::MAX));
        }
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
