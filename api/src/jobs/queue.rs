//! The bounded queue between the desk and the workers.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, PoisonError};

/// Why a job was not queued.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// As many jobs wait as may wait.
    Full,
    /// No more jobs are handed out.
    Closed,
}

#[derive(Debug, Default)]
struct Inner {
    waiting: VecDeque<String>,
    closed: bool,
}

/// Ids of jobs that wait, first come first served.
#[derive(Debug)]
pub struct Queue {
    inner: Mutex<Inner>,
    arrived: Condvar,
    capacity: usize,
}

impl Queue {
    /// A queue in which at most so many jobs wait.
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        Self { inner: Mutex::default(), arrived: Condvar::new(), capacity }
    }

    /// Adds a job at the end.
    ///
    /// # Errors
    /// [`Refusal`] when the queue is full or closed.
    pub fn push(&self, id: String) -> Result<(), Refusal> {
        let mut inner = crate::locked(&self.inner);
        if inner.closed {
            return Err(Refusal::Closed);
        }
        if inner.waiting.len() >= self.capacity {
            return Err(Refusal::Full);
        }
        inner.waiting.push_back(id);
        self.arrived.notify_one();
        Ok(())
    }

    /// Adds a job that had been accepted before the service stopped: it is not refused again.
    pub fn restore(&self, id: String) {
        crate::locked(&self.inner).waiting.push_back(id);
        self.arrived.notify_one();
    }

    /// Waits for the next job; none once the queue is closed, whatever waits in it.
    pub fn take(&self) -> Option<String> {
        let mut inner = crate::locked(&self.inner);
        loop {
            if inner.closed {
                return None;
            }
            if let Some(id) = inner.waiting.pop_front() {
                return Some(id);
            }
            inner = self.arrived.wait(inner).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Takes a job out; tells whether it was still waiting.
    pub fn remove(&self, id: &str) -> bool {
        let mut inner = crate::locked(&self.inner);
        let before = inner.waiting.len();
        inner.waiting.retain(|waiting| waiting != id);
        inner.waiting.len() < before
    }

    /// How many jobs wait.
    #[must_use]
    pub fn len(&self) -> usize {
        crate::locked(&self.inner).waiting.len()
    }

    /// Whether no job waits.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Hands out no more jobs. What waits stays in the journal for the next start.
    pub fn close(&self) {
        crate::locked(&self.inner).closed = true;
        self.arrived.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounded_and_in_order() {
        let queue = Queue::new(2);
        assert_eq!(queue.push("a".into()), Ok(()));
        assert_eq!(queue.push("b".into()), Ok(()));
        assert_eq!(queue.push("c".into()), Err(Refusal::Full));
        queue.restore("c".into());
        assert!(queue.remove("b") && !queue.remove("b"));
        assert_eq!((queue.take().as_deref(), queue.take().as_deref()), (Some("a"), Some("c")));
        queue.restore("d".into());
        queue.close();
        assert_eq!(queue.take(), None);
        assert_eq!(queue.push("e".into()), Err(Refusal::Closed));
    }
}
