//! Working memories that tasks take, and give back for the next.

use std::sync::Mutex;

/// As many as tasks ran at once. What a task does must not depend on which it takes.
#[derive(Debug)]
pub(super) struct Pool<T>(Mutex<Vec<T>>);

impl<T> Default for Pool<T> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<T> Pool<T> {
    /// Does some work with a memory that no other task has now, a new one where there is none.
    pub(super) fn with<R>(&self, new: impl FnOnce() -> T, work: impl FnOnce(&mut T) -> R) -> R {
        let idle = self.0.lock().map(|mut idle| idle.pop()).unwrap_or_default();
        let mut memory = idle.unwrap_or_else(new);
        let result = work(&mut memory);
        if let Ok(mut idle) = self.0.lock() {
            idle.push(memory);
        }
        result
    }
}
