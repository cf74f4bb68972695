//! A job's events as they happen, through broken connections, until its end.

use std::io::{BufRead, BufReader};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use lacuna_kernel::budget::{CancelToken, PHASES, Progress, ProgressSink};
use ureq::http::{Method, StatusCode};

use super::server::Server;
use crate::jobs::record::{JobView, Step};
use crate::problem::{Problem, ProblemKind};

/// How often a stream may break or a service be away in a row before the command gives up; the job goes on.
const TRIES: u32 = 8;

/// An event of a job.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Event {
    pub(super) id: u64,
    pub(super) name: String,
    pub(super) data: String,
}

/// Reads Server-Sent Events, one at a time.
struct Events<R> {
    lines: R,
}

impl<R: BufRead> Events<R> {
    fn next(&mut self) -> std::io::Result<Option<Event>> {
        let (mut event, mut line) = (Event::default(), String::new());
        loop {
            line.clear();
            if self.lines.read_line(&mut line)? == 0 {
                return Ok(None);
            }
            let text = line.trim_end_matches(['\r', '\n']);
            let (field, value) = text.split_once(':').unwrap_or((text, ""));
            let value = value.strip_prefix(' ').unwrap_or(value);
            match field {
                "" if text.is_empty() && !event.data.is_empty() => return Ok(Some(event)),
                "id" => event.id = value.parse().unwrap_or_default(),
                "event" => value.clone_into(&mut event.name),
                "data" => event.data.push_str(value),
                // Comments, which keep the connection open, and when to come back.
                _ => {}
            }
        }
    }
}

/// Follows a job to its end; a broken stream is taken up where it broke.
pub(super) fn follow(server: &Server, id: &str, tell: &mut dyn FnMut(&Event)) -> Result<JobView, Problem> {
    let (mut last, mut failures) = (0_u64, 0_u32);
    loop {
        match listen(server, id, &mut last, tell) {
            Ok(Some(view)) => return Ok(view),
            Ok(None) => failures = 0,
            Err(problem) if problem.kind == ProblemKind::ServiceUnreachable && failures < TRIES => failures += 1,
            Err(problem) if problem.kind == ProblemKind::ServiceUnreachable => {
                let detail = format!("{}; the job {id} goes on: `lacuna jobs watch {id}` follows it again", problem.detail);
                return Err(Problem { detail, ..problem });
            }
            Err(problem) => return Err(problem),
        }
        // The job may have ended while nobody listened.
        if let Ok(view) = show(server, id)
            && view.state.is_final()
        {
            return Ok(view);
        }
        std::thread::sleep(Duration::from_millis(250) * 2_u32.pow(failures.min(5)));
    }
}

/// A job as it stands.
pub(super) fn show(server: &Server, id: &str) -> Result<JobView, Problem> {
    server.json(Method::GET, &format!("/v1/jobs/{id}"), &[], b"")
}

/// Listens until the stream ends; the job if it has ended with it.
fn listen(server: &Server, id: &str, last: &mut u64, tell: &mut dyn FnMut(&Event)) -> Result<Option<JobView>, Problem> {
    let seen = last.to_string();
    let mut answer = server.send(Method::GET, &format!("/v1/jobs/{id}/events"), &[("last-event-id", &seen)], b"")?;
    if answer.status() != StatusCode::OK {
        let problem = server.refusal(&mut answer);
        // A service that goes down or is busy comes back.
        let passing = matches!(problem.kind, ProblemKind::ShuttingDown | ProblemKind::Timeout | ProblemKind::RateLimited);
        return Err(if passing { Problem { kind: ProblemKind::ServiceUnreachable, ..problem } } else { problem });
    }
    let mut events = Events { lines: BufReader::new(answer.body_mut().as_reader()) };
    // A stream that breaks off is the same as one that ends.
    while let Ok(Some(event)) = events.next() {
        *last = event.id.max(*last);
        tell(&event);
        if event.name == "done" {
            return Ok(serde_json::from_str(&event.data).ok());
        }
    }
    Ok(None)
}

/// Passes progress on to the bar.
pub(super) fn report(event: &Event, sink: Option<&ProgressSink>) {
    let (Some(sink), "progress") = (sink, event.name.as_str()) else { return };
    let Ok(step) = serde_json::from_str::<Step>(&event.data) else { return };
    let phase = PHASES.iter().find(|phase| **phase == step.phase).copied().unwrap_or("work");
    sink(&Progress { phase, fraction: step.fraction, count: step.count, bound_mm: step.bound_mm });
}

/// Stops the job at the service once the token is fired.
pub(super) struct Canceller {
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Canceller {
    /// Watches the token for what is at a place, a job or a batch.
    pub(super) fn start(server: &Server, place: &str, token: &CancelToken) -> Result<Self, Problem> {
        let ended = Arc::new(AtomicBool::new(false));
        let (server, path, token, flag) = (server.clone(), format!("{place}/cancel"), token.clone(), Arc::clone(&ended));
        let watch = move || {
            while !flag.load(Ordering::SeqCst) {
                if token.reason().is_some() {
                    // Whether it came through shows in the job's end, which is waited for; a second Ctrl-C waits for nothing.
                    let _ = server.send(Method::POST, &path, &[], b"");
                    return;
                }
                std::thread::sleep(Duration::from_millis(50));
            }
        };
        let thread = std::thread::Builder::new().name("cancel".into()).spawn(watch);
        let thread = thread.map_err(|error| Problem::io("no thread to watch for Ctrl-C", &error))?;
        Ok(Self { ended, thread: Some(thread) })
    }
}

impl Drop for Canceller {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::SeqCst);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// The `done` event's job without a problem, or the problem.
pub(super) fn succeeded(view: JobView) -> Result<JobView, Problem> {
    match view.problem {
        Some(problem) => Err(problem),
        None if view.state.is_final() => Ok(view),
        None => Err(Problem::internal(format!("the job {} is said to have ended and is {}", view.id, view.state.word()))),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn events_as_they_are_sent() {
        let stream = b": ping\n\nid: 3\nevent: progress\nretry: 2000\ndata: {\"a\":\ndata: 1}\n\nid:4\r\nevent:done\r\ndata:x\r\n\r\nid: 5\ndata: half";
        let mut events = Events { lines: &stream[..] };
        let event = |id, name: &str, data: &str| Event { id, name: name.into(), data: data.into() };
        assert_eq!(events.next().unwrap(), Some(event(3, "progress", "{\"a\":1}")));
        assert_eq!(events.next().unwrap(), Some(event(4, "done", "x")));
        assert_eq!(events.next().unwrap(), None, "what was not finished is not told");
    }
}
