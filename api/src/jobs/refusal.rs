//! Why a submission is refused, in the same words for either ledger.

use crate::problem::{Problem, ProblemKind};

pub(super) fn stopping() -> Problem {
    Problem::new(ProblemKind::ShuttingDown, "The service is going down and accepts no more jobs").retry_after(10)
}

pub(super) fn too_many(whose: &str, allowed: usize) -> Problem {
    let detail = format!("{allowed} unfinished jobs of {whose} are the most that are accepted; wait for one to end");
    Problem::new(ProblemKind::TooManyJobs, detail).retry_after(5)
}

pub(super) fn key_in_progress() -> Problem {
    let detail = "A request with this Idempotency-Key is being answered; repeat this one afterwards";
    Problem::new(ProblemKind::IdempotencyInProgress, detail).retry_after(1)
}

pub(super) fn key_used_otherwise() -> Problem {
    Problem::new(ProblemKind::IdempotencyMismatch, "This Idempotency-Key was used with another body; a new job needs a new key")
}
