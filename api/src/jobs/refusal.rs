//! Why a submission is refused, in the same words for either ledger.

use crate::problem::{Problem, ProblemKind};

pub(super) fn stopping() -> Problem {
    Problem::new(ProblemKind::ShuttingDown, "The service is going down and accepts no more jobs").retry_after(10)
}

/// Nothing if so many more jobs may wait beside those that there are.
pub(super) fn unless_room(whose: &str, there: usize, more: usize, allowed: usize) -> Result<(), Problem> {
    if more == 0 || there + more <= allowed {
        return Ok(());
    }
    let way_out = match more {
        1 => "wait for one to end".to_owned(),
        _ if more > allowed => format!("the batch has {more} to be done; send smaller ones"),
        _ => format!("there are {there}, and the batch has {more} to be done; wait for some to end"),
    };
    let detail = format!("{allowed} unfinished jobs of {whose} are the most that are accepted; {way_out}");
    let problem = Problem::new(ProblemKind::TooManyJobs, detail);
    // To wait for what never passes would be in vain.
    Err(if more > allowed.max(1) { problem } else { problem.retry_after(5) })
}

pub(super) fn of_a_batch(batch: &str) -> Problem {
    let detail = format!(
        "The job belongs to the batch {batch}, whose certificate tells of it; stop it with cancel, or forget all of the batch with DELETE /v1/batches/{batch}"
    );
    Problem::new(ProblemKind::StateConflict, detail).code("job-of-batch")
}

pub(super) fn key_in_progress() -> Problem {
    let detail = "A request with this Idempotency-Key is being answered; repeat this one afterwards";
    Problem::new(ProblemKind::IdempotencyInProgress, detail).retry_after(1)
}

pub(super) fn key_used_otherwise() -> Problem {
    Problem::new(ProblemKind::IdempotencyMismatch, "This Idempotency-Key was used with another body; a new job needs a new key")
}
