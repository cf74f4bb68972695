//! What is kept of a job, and what its owner sees of it.

use lacuna_fabrication::{Certificate, JobKind};
use lacuna_kernel::budget::Progress;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::digest::Digest;
use crate::problem::{Problem, ProblemKind};
use crate::traces::Context;

/// How often a job is started before it counts as the one that brings its worker down.
pub const ATTEMPTS: u32 = 2;

/// Where a job stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Accepted and waiting for a worker.
    Queued,
    /// A worker is at it.
    Running,
    /// Asked to stop; the worker has not stopped yet.
    Cancelling,
    /// Done; the outputs are there.
    Succeeded,
    /// Ended with a problem.
    Failed,
    /// Stopped by its owner.
    Cancelled,
    /// Ended so long ago that nothing but this record is kept of it.
    Expired,
}

impl JobState {
    /// All states, in the order of a job's life.
    pub const ALL: [Self; 7] =
        [Self::Queued, Self::Running, Self::Cancelling, Self::Succeeded, Self::Failed, Self::Cancelled, Self::Expired];

    /// Whether the work is over.
    #[must_use]
    pub fn is_final(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled | Self::Expired)
    }

    /// The state of a word in documents.
    #[must_use]
    pub fn of_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.word() == word)
    }

    /// The word in documents.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Cancelling => "cancelling",
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
            Self::Expired => "expired",
        }
    }
}

/// A file that a job made.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Output {
    /// The format's name, or `certificate.json`.
    pub name: String,
    /// What to call the file.
    pub file_name: String,
    /// Its media type.
    pub media_type: String,
    /// Its length.
    pub bytes: u64,
    /// `sha256:` and 64 hex digits; also its address under `/v1/results/`.
    #[schema(value_type = String)]
    pub digest: Digest,
}

/// How far a running job has come.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Step {
    /// `validate`, `refine`, `dilate`, `stitch`, `verify`, `combine`, `intersect`, `compare`, `section`, `stability`, `certify` or `write`.
    pub phase: String,
    /// Share of the phase that is done, in [0, 1].
    pub fraction: f64,
    /// Triangles or cells made so far, by phase.
    pub count: u64,
    /// The error bound, in mm, that is proven of what has been made so far; absent as long as none is. At the end it is the certificate's `achieved_bound_mm`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub bound_mm: Option<f64>,
}

impl From<&Progress> for Step {
    fn from(progress: &Progress) -> Self {
        Self { phase: progress.phase.to_owned(), fraction: progress.fraction, count: progress.count, bound_mm: progress.bound_mm }
    }
}

/// A job as its owner sees it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct JobView {
    /// Its id.
    pub id: String,
    /// What it does.
    pub kind: JobKind,
    /// The id of the batch that it belongs to, if it does.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub batch: Option<String>,
    /// Where it stands.
    pub state: JobState,
    /// How often it was started; 2 after the service stopped during the first time.
    pub attempt: u32,
    /// How often a worker gave it back because it was told to end; those starts are not counted against the job.
    #[serde(skip_serializing_if = "is_zero", default)]
    pub handed_back: u32,
    /// When it was accepted.
    pub created: String,
    /// When a worker took it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub started: Option<String>,
    /// When it ended.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub finished: Option<String>,
    /// When what it made was given up, after the time for which ended jobs are kept; the digests of its outputs are still told.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub expired: Option<String>,
    /// How far it has come, while it runs.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub progress: Option<Step>,
    /// `sha256:` digest of the canonical job document.
    pub input_digest: String,
    /// Whether the same work had been done before and its results are handed out again.
    pub reused: bool,
    /// The files it made.
    pub outputs: Vec<Output>,
    /// What is proven of the result.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub certificate: Option<Certificate>,
    /// What the owner should know, in words.
    pub warnings: Vec<String>,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub problem: Option<Problem>,
}

impl JobView {
    /// Starts it once more.
    pub fn start(&mut self) {
        self.state = JobState::Running;
        self.attempt += 1;
        self.started = Some(crate::clock::now());
    }

    /// Ends it well.
    pub fn finish(&mut self, answer: Answer, reused: bool) {
        self.end(JobState::Succeeded);
        self.warnings.clone_from(&answer.certificate.warnings);
        self.outputs = answer.outputs;
        self.certificate = Some(answer.certificate);
        self.reused = reused;
    }

    /// Ends it on its owner's wish.
    pub fn end_cancelled(&mut self) {
        self.end(JobState::Cancelled);
        self.problem = Some(Problem::new(ProblemKind::Cancelled, "The job was stopped by its owner"));
    }

    /// Ends it with a problem.
    pub fn fail(&mut self, problem: Problem) {
        self.end(JobState::Failed);
        self.problem = Some(problem);
    }

    /// Takes it up again after the worker that was at it has gone: it waits once more, or has been started often enough.
    pub fn take_up(&mut self) {
        self.progress = None;
        match self.state {
            JobState::Cancelling => self.end_cancelled(),
            JobState::Running if self.attempt.saturating_sub(self.handed_back) >= ATTEMPTS => {
                let detail = format!("The work was started {ATTEMPTS} times, and each time its worker stopped before the end");
                self.fail(Problem::new(ProblemKind::Interrupted, detail));
            }
            JobState::Running => self.state = JobState::Queued,
            _ => {}
        }
    }

    /// Takes over what a worker says of the end of its work.
    pub fn conclude(&mut self, ending: Ending) {
        match ending {
            // What was finished in time is handed out even if somebody wished to stop it meanwhile.
            Ending::Done(answer) => self.finish(*answer, false),
            Ending::Failed(problem) => self.fail(*problem),
            Ending::Stopped if self.state == JobState::Cancelling => self.end_cancelled(),
            // The service goes down: somebody else takes the job up again.
            Ending::Stopped => {
                self.handed_back += 1;
                self.take_up();
            }
        }
    }

    fn end(&mut self, state: JobState) {
        self.state = state;
        self.finished = Some(crate::clock::now());
        self.progress = None;
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks like this")]
fn is_zero(count: &u32) -> bool {
    *count == 0
}

/// How a worker's work on a job ended.
#[derive(Clone, Debug)]
pub enum Ending {
    /// With results.
    Done(Box<Answer>),
    /// With a problem.
    Failed(Box<Problem>),
    /// Because the job's flag was fired.
    Stopped,
}

/// The idempotency key of a submission and what it was used with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Idempotency {
    /// Digest of the key.
    pub key: Digest,
    /// Digest of the body.
    pub body: Digest,
}

/// A job as it is kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JobRecord {
    /// What the owner sees.
    pub view: JobView,
    /// Whose it is.
    pub owner: String,
    /// Digest under which the job document is kept.
    pub document: Digest,
    /// Digest of the work and of the version that does it: equal work has the same answer.
    pub work: Digest,
    /// Idempotency key, if one was given.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub idempotency: Option<Idempotency>,
    /// The span of the request that ordered it, if anybody wants traces.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub trace: Option<Context>,
}

impl JobRecord {
    /// Leaves of it that there was such a job, when, and what it had made: document, certificate and files are given up, and its idempotency key
    /// is free for another.
    pub fn expire(&mut self) {
        self.view.state = JobState::Expired;
        self.view.expired = Some(crate::clock::now());
        self.view.progress = None;
        self.view.certificate = None;
        self.view.warnings = Vec::new();
        self.view.problem = None;
        self.idempotency = None;
        self.trace = None;
    }
}

/// What finished work left, so that the same work need not be done again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The files.
    pub outputs: Vec<Output>,
    /// What is proven of them.
    pub certificate: Certificate,
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn steps_of_earlier_versions_are_read_and_bounds_come_through() {
        let before = r#"{"phase":"dilate","fraction":0.5,"count":3}"#;
        let read: Step = serde_json::from_str(before).unwrap();
        assert_eq!(read.bound_mm, None);
        assert_eq!(serde_json::to_string(&read).unwrap(), before, "what is not known is not told");
        let told = Step::from(&Progress { phase: "certify", fraction: 1.0, count: 3, bound_mm: Some(0.1) });
        assert_eq!(serde_json::from_str::<Step>(&serde_json::to_string(&told).unwrap()).unwrap(), told);
    }
}
