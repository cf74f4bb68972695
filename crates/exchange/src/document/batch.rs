//! Reads batches: several jobs that are accepted together.

use std::collections::HashSet;

use super::grammar::{BATCH, BATCH_ENTRY, MOST_JOBS};
use super::job::{JobDocument, job};
use super::model::version;
use super::node::{Place, quoted};
use super::walk::{Walker, length};
use crate::diagnostic::code;

/// A job of a batch.
#[derive(Clone, Debug, PartialEq)]
pub struct BatchEntry {
    /// What the batch calls it, if it does; no two are called the same.
    pub name: Option<String>,
    /// The job.
    pub job: JobDocument,
}

/// The jobs of a batch, in their order.
pub(super) fn batch(walker: &mut Walker<'_>, place: Place<'_>) -> Option<Vec<BatchEntry>> {
    let members = walker.object(place, &BATCH)?;
    if let Some(place) = members.get("lacuna") {
        version(walker, place);
    }
    let jobs = members.get("jobs")?;
    let expected = format!("an array of 1 to {MOST_JOBS} jobs");
    if let Some(found) = length(jobs.node).filter(|&found| found > MOST_JOBS) {
        // Before any is read: a list without end is not looked through.
        return walker.wrong_length(&jobs, found, &format!("{expected}; send the others as another batch"));
    }
    let mut names = HashSet::new();
    walker.each_of(jobs, 1, &expected, |walker, place| entry(walker, place, &mut names))
}

fn entry(walker: &mut Walker<'_>, place: Place<'_>, names: &mut HashSet<String>) -> Option<BatchEntry> {
    let members = walker.object(place, &BATCH_ENTRY)?;
    let name = match members.get("name") {
        None => Some(None),
        Some(place) => walker.name(place, "the name of a job").and_then(|name| {
            if names.insert(name.clone()) {
                return Some(Some(name));
            }
            walker.fault(&place, code::DUPLICATE_NAME, || format!("another job is called {} already", quoted(&name)));
            None
        }),
    };
    let place = members.get("job")?;
    let job = job(walker, place)?;
    if job.supersedes.is_some() {
        let message =
            || "a job of a batch replaces no other; remove \"supersedes\", and cancel the other job once the batch is accepted".into();
        walker.fault(&place, code::CONFLICTING_MEMBERS, message);
        return None;
    }
    Some(BatchEntry { name: name?, job })
}
