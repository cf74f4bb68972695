//! The events of one job: a bounded log that late listeners can catch up with.

use std::collections::VecDeque;
use std::sync::Mutex;

use serde::Serialize;
use tokio::sync::watch;

/// How many events are kept. Only progress repeats, and a listener that missed some needs the latest alone.
const KEPT: usize = 256;

/// Binary digits of the number of events that one revision of a record can have: its warnings and outputs.
const EVENTS_OF_A_REVISION: u32 = 12;

/// An event of a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// Grows by one from event to event of a job.
    pub id: u64,
    /// `state`, `progress`, `warning`, `output` or `done`.
    pub name: &'static str,
    /// JSON.
    pub data: String,
}

/// The log. Cheap to write to when nobody listens.
#[derive(Debug)]
pub struct EventLog {
    events: Mutex<VecDeque<Event>>,
    latest: watch::Sender<u64>,
}

impl Default for EventLog {
    fn default() -> Self {
        Self { events: Mutex::default(), latest: watch::Sender::new(0) }
    }
}

impl EventLog {
    /// Leaves room in the ids for the events of earlier revisions of a record that is changed elsewhere: events get
    /// the same ids in every process that follows it. Tells whether the revision is a later one.
    pub fn advance(&self, revision: u64) -> bool {
        let events = crate::locked(&self.events);
        let first = revision << EVENTS_OF_A_REVISION;
        let later = first > *self.latest.borrow();
        if later {
            self.latest.send_if_modified(|latest| {
                *latest = first;
                false
            });
        }
        drop(events);
        later
    }

    /// Adds an event.
    pub fn push(&self, name: &'static str, data: &impl Serialize) {
        let data = serde_json::to_string(data).unwrap_or_default();
        let mut events = crate::locked(&self.events);
        let id = *self.latest.borrow() + 1;
        if name == "progress" && events.back().is_some_and(|last| last.name == "progress") {
            // Progress replaces progress, so a long job does not push its other events out.
            events.pop_back();
        }
        if events.len() == KEPT {
            events.pop_front();
        }
        events.push_back(Event { id, name, data });
        // Still under the lock: the next event's id comes from this.
        self.latest.send_replace(id);
    }

    /// The events after an id.
    #[must_use]
    pub fn after(&self, id: u64) -> Vec<Event> {
        crate::locked(&self.events).iter().filter(|event| event.id > id).cloned().collect()
    }

    /// Changes whenever an event is added.
    #[must_use]
    pub fn subscribe(&self) -> watch::Receiver<u64> {
        self.latest.subscribe()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn listeners_catch_up_from_the_last_id() {
        let log = EventLog::default();
        log.push("state", &"running");
        for step in 0..1000 {
            log.push("progress", &step);
        }
        log.push("done", &"succeeded");
        let all: Vec<_> = log.after(0).into_iter().map(|e| (e.id, e.name)).collect();
        assert_eq!(all, [(1, "state"), (1001, "progress"), (1002, "done")]);
        assert_eq!(log.after(1001).len(), 1);
        assert!(log.after(1002).is_empty());
    }
}
