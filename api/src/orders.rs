//! What submitted documents come to: jobs as the service keeps them. They are read where questions are answered, because a short document can name a long mesh.

use lacuna_fabrication::{JobKind, Plan};
use lacuna_kernel::budget::Limits;
use lacuna_kernel::error::LimitFacts;
use serde::{Deserialize, Serialize};

use crate::digest::Digest;
use crate::documents::{self, ModelFinder, Order};
use crate::jobs::messages::Most;
use crate::problem::{Problem, ProblemKind};
use crate::production::Engine;
use crate::questions::{self, TIME};

/// Bytes of the jobs' documents, with the stored models that they name, that a batch has at most: all are in memory until the batch is accepted, and a short one can name a long model a
/// hundred times. Eight times the longest body there is by default.
const BATCH_BYTES: usize = 64 << 20;

/// A job that was read and found legal.
#[derive(Debug, Serialize, Deserialize)]
pub struct Ordered {
    /// What it does.
    pub kind: JobKind,
    /// The document that a worker will read.
    pub document: String,
    /// Digest of the canonical document, but for its limits.
    pub input_digest: Digest,
    limits: Most,
    /// The job that it replaces.
    pub supersedes: Option<String>,
    /// What it costs, if that was asked and could be told in time.
    pub plan: Option<Plan>,
}

impl Ordered {
    /// What an order comes to.
    #[must_use]
    pub fn of(order: &Order, plan: Option<Plan>) -> Self {
        Self {
            kind: order.job.kind,
            document: order.document(),
            input_digest: documents::job_digest(&order.job),
            limits: order.job.limits.into(),
            supersedes: order.supersedes.clone(),
            plan,
        }
    }

    /// What it may use.
    #[must_use]
    pub fn limits(&self) -> Limits {
        self.limits.into()
    }
}

/// Reads a job document, and predicts what it costs if that is asked.
///
/// # Errors
/// All findings, as one problem.
pub(crate) fn read_job(document: &[u8], predicted: bool, most: &Limits, find: ModelFinder<'_>, engine: Engine) -> Result<Ordered, Problem> {
    let order = documents::read_order(document, most, find)?;
    let plan = predicted.then(|| questions::predict(engine, &order.job, TIME)).transpose();
    let plan = plan.or_else(|problem| if questions::took_too_much(&problem) { Ok(None) } else { Err(problem) })?;
    Ok(Ordered::of(&order, plan))
}

/// Reads a batch: its jobs, and what it calls them.
///
/// # Errors
/// All findings in all jobs, as one problem.
pub(crate) fn read_batch(document: &[u8], most: &Limits, find: ModelFinder<'_>) -> Result<Vec<(Option<String>, Ordered)>, Problem> {
    let (mut jobs, mut refusal, mut length) = (Vec::new(), None::<Problem>, 0);
    for entry in documents::read_batch(document)? {
        // One at a time: a mesh that many jobs name is never in memory for all of them.
        match documents::complete(entry.job, most, find) {
            Ok(order) => {
                let ordered = Ordered::of(&order, None);
                length += ordered.document.len();
                if length > BATCH_BYTES {
                    return Err(too_long(length));
                }
                jobs.push((entry.name, ordered));
            }
            Err(problem) => match &mut refusal {
                Some(first) => first.errors.extend(problem.errors),
                None => refusal = Some(problem),
            },
        }
    }
    refusal.map_or(Ok(jobs), Err)
}

#[expect(clippy::cast_precision_loss, reason = "lengths are shown, not computed with")]
fn too_long(length: usize) -> Problem {
    let facts = LimitFacts { limit: "batch_bytes", asked: length as f64, allowed: BATCH_BYTES as f64, remedy: None };
    let detail = format!(
        "the jobs' documents, each with the stored models that it names, have more than {BATCH_BYTES} bytes together; send the jobs in smaller batches, or upload their models as mesh files, which stay where they are"
    );
    Problem::new(ProblemKind::Limit, detail).code("limit.batch-bytes").limit(&facts)
}
