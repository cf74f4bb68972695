//! Fires a token when its time has passed: the kernel has no clock.

use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use lacuna_kernel::budget::{CancelToken, StopReason};

/// Watches one computation until it is dropped.
#[derive(Debug)]
pub struct Watchdog {
    over: Arc<(Mutex<bool>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

impl Watchdog {
    /// Fires the token with [`StopReason::Deadline`] after so many seconds.
    ///
    /// # Errors
    /// When the system has no thread to spare.
    pub fn start(token: &CancelToken, seconds: f64) -> std::io::Result<Self> {
        let over = Arc::new((Mutex::new(false), Condvar::new()));
        let time = Duration::try_from_secs_f64(seconds.max(0.0)).unwrap_or(Duration::MAX);
        let (shared, token) = (Arc::clone(&over), token.clone());
        let thread = std::thread::Builder::new().name("watchdog".into()).spawn(move || {
            if wait_until_over(&shared, time) {
                token.fire(StopReason::Deadline);
            }
        })?;
        Ok(Self { over, thread: Some(thread) })
    }
}

/// Whether the time passed first.
fn wait_until_over((over, changed): &(Mutex<bool>, Condvar), time: Duration) -> bool {
    let start = Instant::now();
    let mut done = crate::locked(over);
    while !*done {
        let left = time.saturating_sub(start.elapsed());
        if left.is_zero() {
            return true;
        }
        done = changed.wait_timeout(done, left).unwrap_or_else(PoisonError::into_inner).0;
    }
    false
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        *crate::locked(&self.over.0) = true;
        self.over.1.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn fires_in_time_and_not_after_the_end() {
        let late = CancelToken::new();
        let watchdog = Watchdog::start(&late, 0.02).unwrap();
        std::thread::sleep(Duration::from_millis(200));
        assert_eq!(late.reason(), Some(StopReason::Deadline));
        drop(watchdog);

        let early = CancelToken::new();
        drop(Watchdog::start(&early, 3600.0).unwrap());
        assert_eq!(early.reason(), None);
    }
}
