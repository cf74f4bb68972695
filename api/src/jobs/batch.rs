//! Batches: several jobs that were accepted together, and what is told of them.
//!
//! What is kept of a batch never changes: which jobs are in it. Where it stands, and its certificate, follow from what is kept of the jobs. So whatever stops
//! a process, at whatever moment, leaves nothing to be mended: jobs are taken up as all others, and nobody coordinates them.

use std::collections::BTreeMap;
use std::sync::Arc;

use lacuna_fabrication::{Certificate, JobKind};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::live::LiveJob;
use super::record::{Idempotency, JobState, JobView, Step};
use crate::digest::Digest;
use crate::problem::Problem;

/// A batch as it is kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BatchRecord {
    /// Its id.
    pub id: String,
    /// Whose it is.
    pub owner: String,
    /// When it was accepted.
    pub created: String,
    /// Its jobs, in the order of its document.
    pub jobs: Vec<Member>,
    /// Idempotency key, if one was given.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub idempotency: Option<Idempotency>,
}

/// What a batch knows of a job, even when nothing else is known of it any more.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Member {
    /// What the batch calls it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub name: Option<String>,
    /// The job's id.
    pub job: String,
    /// What it does.
    pub kind: JobKind,
    /// `sha256:` digest of its canonical document.
    pub input_digest: String,
}

/// A batch and those of its jobs that are still known.
#[derive(Clone, Debug)]
pub struct Batch {
    /// What is kept of it.
    pub record: Arc<BatchRecord>,
    /// Its jobs, each in its place.
    pub jobs: Vec<Option<Arc<LiveJob>>>,
}

/// Where a batch stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum BatchState {
    /// No job has been started yet.
    Queued,
    /// Jobs are to be done.
    Running,
    /// All jobs have succeeded.
    Succeeded,
    /// All jobs have ended, some of them well.
    PartlySucceeded,
    /// All jobs have ended, none of them well.
    Failed,
    /// All jobs have ended, none of them well, and at least one because it was stopped.
    Cancelled,
    /// What some jobs made is no longer kept, nor how they ended.
    Expired,
}

impl BatchState {
    /// Whether all jobs have ended.
    #[must_use]
    pub fn is_final(self) -> bool {
        !matches!(self, Self::Queued | Self::Running)
    }
}

/// How many jobs of a batch stand where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Counts {
    /// Those that wait for a worker.
    pub queued: u32,
    /// Those that workers are at, also those that are stopping.
    pub running: u32,
    /// Those that are done.
    pub succeeded: u32,
    /// Those that ended with a problem.
    pub failed: u32,
    /// Those that were stopped.
    pub cancelled: u32,
    /// Those of which nothing else is kept any more.
    pub expired: u32,
}

impl Counts {
    /// How many of these states there are.
    #[must_use]
    pub fn of(states: impl Iterator<Item = JobState>) -> Self {
        let mut counts = Self::default();
        for state in states {
            *match state {
                JobState::Queued => &mut counts.queued,
                JobState::Running | JobState::Cancelling => &mut counts.running,
                JobState::Succeeded => &mut counts.succeeded,
                JobState::Failed => &mut counts.failed,
                JobState::Cancelled => &mut counts.cancelled,
                JobState::Expired => &mut counts.expired,
            } += 1;
        }
        counts
    }

    fn state(&self) -> BatchState {
        let ended = self.succeeded + self.failed + self.cancelled + self.expired;
        match *self {
            Self { queued: 0, running: 0, expired, .. } if expired > 0 => BatchState::Expired,
            Self { queued: 0, running: 0, failed: 0, cancelled: 0, .. } => BatchState::Succeeded,
            Self { queued: 0, running: 0, succeeded, .. } if succeeded > 0 => BatchState::PartlySucceeded,
            Self { queued: 0, running: 0, cancelled: 0, .. } => BatchState::Failed,
            Self { queued: 0, running: 0, .. } => BatchState::Cancelled,
            Self { running: 0, .. } if ended == 0 => BatchState::Queued,
            _ => BatchState::Running,
        }
    }
}

/// The key figures of a job's certificate, which says what each of them means; all of it is the output `certificate.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Figures {
    /// The bound that was asked.
    pub requested_tolerance_mm: f64,
    /// The bound that is proven.
    pub achieved_bound_mm: f64,
    /// Least thickness that is proven.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub thickness_min_mm: Option<f64>,
    /// Triangles of the result.
    pub triangles: u64,
    /// Connected pieces.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub components: Option<u64>,
    /// Sum of the shells' genera.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub genus: Option<i64>,
    /// Volume that the written mesh encloses.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub mesh_volume_mm3: Option<f64>,
    /// Area of the written mesh.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub mesh_area_mm2: Option<f64>,
}

impl From<&Certificate> for Figures {
    fn from(certificate: &Certificate) -> Self {
        let Certificate { requested_tolerance_mm, achieved_bound_mm, thickness_min_mm, triangles, components, genus, .. } = *certificate;
        let Certificate { mesh_volume_mm3, mesh_area_mm2, .. } = *certificate;
        Self { requested_tolerance_mm, achieved_bound_mm, thickness_min_mm, triangles, components, genus, mesh_volume_mm3, mesh_area_mm2 }
    }
}

/// A job of a batch: what it is called, where it stands, and what came of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BatchRow {
    /// Its place in the batch's document, from 0.
    pub index: u32,
    /// What the batch calls it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub name: Option<String>,
    /// The job's id, where a service did it: all of it is at `/v1/jobs/{id}`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub job: Option<String>,
    /// What it does.
    pub kind: JobKind,
    /// Where it stands.
    pub state: JobState,
    /// `sha256:` digest of its canonical document.
    pub input_digest: String,
    /// How far it has come, while it runs.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub progress: Option<Step>,
    /// Digests of the files that it made, by their names; that of `certificate.json` is among them.
    #[serde(skip_serializing_if = "BTreeMap::is_empty", default)]
    pub output_digests: BTreeMap<String, String>,
    /// What is proven of the result, in short.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub figures: Option<Figures>,
    /// What the owner should know, in words.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub warnings: Vec<String>,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub problem: Option<Problem>,
}

impl BatchRow {
    /// What is told of a job at a place of a batch; without its view it has expired.
    #[must_use]
    pub fn of(index: usize, member: &Member, view: Option<&JobView>) -> Self {
        let of_outputs = |view: &JobView| view.outputs.iter().map(|output| (output.name.clone(), output.digest.to_string())).collect();
        Self {
            index: u32::try_from(index).unwrap_or(u32::MAX),
            name: member.name.clone(),
            job: Some(member.job.clone()),
            kind: member.kind,
            state: view.map_or(JobState::Expired, |view| view.state),
            input_digest: member.input_digest.clone(),
            progress: view.and_then(|view| view.progress.clone()),
            output_digests: view.map(of_outputs).unwrap_or_default(),
            figures: view.and_then(|view| view.certificate.as_ref()).map(Figures::from),
            warnings: view.map(|view| view.warnings.clone()).unwrap_or_default(),
            problem: view.and_then(|view| view.problem.clone()),
        }
    }
}

/// A batch as its owner sees it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BatchView {
    /// Its id.
    pub id: String,
    /// Where it stands.
    pub state: BatchState,
    /// When it was accepted.
    pub created: String,
    /// When the last of its jobs ended.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub finished: Option<String>,
    /// Share of the jobs that have ended, in [0, 1].
    pub fraction: f64,
    /// How many jobs stand where.
    pub counts: Counts,
    /// The jobs, in the order of the batch's document.
    pub jobs: Vec<BatchRow>,
}

/// What is proven of all results of a batch: the parent of its jobs' certificates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BatchCertificate {
    /// The batch's id, where a service did it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub batch: Option<String>,
    /// How it ended.
    pub state: BatchState,
    /// How many of its jobs ended how.
    pub counts: Counts,
    /// `sha256:` digest of the jobs' input digests in their order, each with a line end.
    pub input_digest: String,
    /// The version that did it.
    pub kernel_version: String,
    /// The jobs, in the order of the batch's document.
    pub jobs: Vec<BatchRow>,
}

impl BatchCertificate {
    /// The certificate of a batch whose jobs have all ended.
    #[must_use]
    pub fn of(batch: Option<String>, counts: Counts, jobs: Vec<BatchRow>) -> Self {
        let inputs: String = jobs.iter().map(|row| format!("{}\n", row.input_digest)).collect();
        let input_digest = Digest::of(inputs.as_bytes()).to_string();
        Self { batch, state: counts.state(), counts, input_digest, kernel_version: env!("CARGO_PKG_VERSION").to_owned(), jobs }
    }

    /// The certificate as a file.
    ///
    /// # Errors
    /// When a number in it is not finite, which JSON cannot carry.
    pub fn bytes(&self) -> Result<Vec<u8>, Problem> {
        let mut bytes = serde_json::to_vec_pretty(self).map_err(|error| Problem::internal(error.to_string()))?;
        bytes.push(b'\n');
        Ok(bytes)
    }
}

impl Batch {
    /// The row of a job as it stands.
    #[must_use]
    pub fn row(&self, index: usize) -> BatchRow {
        let view = self.jobs[index].as_ref().map(|job| job.view());
        BatchRow::of(index, &self.record.jobs[index], view.as_ref())
    }

    /// What the owner sees now.
    #[must_use]
    pub fn view(&self) -> BatchView {
        let views: Vec<Option<JobView>> = self.jobs.iter().map(|job| job.as_ref().map(|job| job.view())).collect();
        view_of(&self.record, &views)
    }

    /// Whether all jobs have ended.
    #[must_use]
    pub fn is_final(&self) -> bool {
        self.jobs.iter().flatten().all(|job| job.state().is_final())
    }
}

/// What is told of a batch whose jobs stand as these views say; one without a view has expired.
#[must_use]
pub fn view_of(record: &BatchRecord, views: &[Option<JobView>]) -> BatchView {
    let members = record.jobs.iter().zip(views).enumerate();
    let jobs: Vec<BatchRow> = members.map(|(index, (member, view))| BatchRow::of(index, member, view.as_ref())).collect();
    let counts = Counts::of(jobs.iter().map(|row| row.state));
    let state = counts.state();
    let finished = views.iter().flatten().filter_map(|view| view.finished.clone()).max().filter(|_| state.is_final());
    let ended = jobs.iter().filter(|row| row.state.is_final()).count();
    #[expect(clippy::cast_precision_loss, reason = "a share of a hundred")]
    let fraction = ended as f64 / jobs.len().max(1) as f64;
    BatchView { id: record.id.clone(), state, created: record.created.clone(), finished, fraction, counts, jobs }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_state_follows_from_the_jobs() {
        use JobState::{Cancelled, Cancelling, Expired, Failed, Queued, Running, Succeeded};
        let state = |states: &[JobState]| Counts::of(states.iter().copied()).state();
        assert_eq!(state(&[Queued, Queued]), BatchState::Queued);
        for states in [[Queued, Running], [Queued, Succeeded], [Cancelling, Cancelled], [Running, Failed], [Queued, Expired]] {
            assert_eq!(state(&states), BatchState::Running, "{states:?}");
        }
        assert_eq!(state(&[Succeeded, Succeeded]), BatchState::Succeeded);
        for states in [[Succeeded, Failed], [Cancelled, Succeeded]] {
            assert_eq!(state(&states), BatchState::PartlySucceeded, "{states:?}");
        }
        assert_eq!(state(&[Failed, Failed]), BatchState::Failed);
        assert_eq!(state(&[Failed, Cancelled]), BatchState::Cancelled);
        assert_eq!(state(&[Succeeded, Expired]), BatchState::Expired);
    }
}
