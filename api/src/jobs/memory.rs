//! What a process that does jobs asks of the operating system for itself: little priority, and a limit of memory.

use std::fs;

use crate::problem::Problem;

/// The threads of such a process get of a core what those that answer leave: the least priority of the usual kind.
#[cfg(unix)]
const NICENESS: i32 = 19;

/// What an allocator takes beside what it hands out, in bytes: it rounds up, and keeps an arena for every thread.
const ROUNDING_BYTES: u64 = 32 << 20;

/// Geometry takes all cores for minutes, and an answer takes one for a moment: the answer goes first. Where that is not allowed,
/// they share. On Linux this is the priority of the calling thread, and of those that it starts from then on.
pub(super) fn give_way() {
    #[cfg(unix)]
    if let Err(error) = rustix::process::nice(NICENESS) {
        tracing::debug!(%error, "a worker keeps its priority");
    }
}

/// When the machine's memory runs out, the system ends a process: rather this one than the service.
pub(super) fn go_first() {
    // Only Linux knows this file; elsewhere the choice is the system's.
    let _ = fs::write("/proc/self/oom_score_adj", "1000");
}

/// From now on the process gets so many bytes more than it has, and ends when it asks for another one. Only Unix systems hold it
/// to that; Linux counts all memory that can be written and is the process's own (`RLIMIT_DATA`).
pub(super) fn limit(bytes: u64) -> Result<(), Problem> {
    #[cfg(unix)]
    {
        use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
        let maximum = getrlimit(Resource::Data).maximum;
        let wanted = bytes.saturating_add(ROUNDING_BYTES).saturating_add(of_process("self", "VmData:").unwrap_or(0));
        let current = Some(maximum.map_or(wanted, |maximum| wanted.min(maximum)));
        setrlimit(Resource::Data, Rlimit { current, maximum }).map_err(|error| Problem::io("memory cannot be limited", &error.into()))?;
    }
    #[cfg(not(unix))]
    let _ = bytes;
    Ok(())
}

/// A count of bytes that Linux keeps of a process; none elsewhere.
pub(super) fn of_process(id: &str, name: &str) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{id}/status")).ok()?;
    let words = status.lines().find_map(|line| line.strip_prefix(name))?;
    words.split_whitespace().next()?.parse::<u64>().ok().map(|kibibytes| kibibytes * 1024)
}
