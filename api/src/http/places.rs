//! Places for work beside the event loop: so many in all, and so many of them for one key.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::auth::Owner;
use crate::locked;

/// A place that is taken, until it is dropped.
#[derive(Debug)]
pub(super) struct Place {
    _of_all: OwnedSemaphorePermit,
    _of_owner: Option<OwnedSemaphorePermit>,
}

/// The places. Whoever waits for one is served in order; an owner waits for its own share first, so that the rest is left to others.
#[derive(Debug)]
pub(super) struct Places {
    all: Arc<Semaphore>,
    share: usize,
    /// No more than there are keys.
    of_owners: Mutex<HashMap<String, Arc<Semaphore>>>,
}

impl Places {
    /// So many places, and the most that one owner has at a time.
    pub(super) fn new(count: usize, share: usize) -> Self {
        Self { all: Arc::new(Semaphore::new(count)), share, of_owners: Mutex::default() }
    }

    /// Waits for a place; the service itself, without an owner, waits for others only.
    pub(super) async fn take(&self, owner: Option<&Owner>) -> Place {
        let of_owner = match owner {
            Some(owner) => {
                let share = locked(&self.of_owners).entry(owner.0.clone()).or_insert_with(|| Arc::new(Semaphore::new(self.share))).clone();
                share.acquire_owned().await.ok()
            }
            None => None,
        };
        loop {
            // Nobody closes it.
            if let Ok(of_all) = Arc::clone(&self.all).acquire_owned().await {
                return Place { _of_all: of_all, _of_owner: of_owner };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use futures_util::FutureExt;

    use super::*;

    #[test]
    fn one_owner_leaves_places_to_others() {
        let places = Places::new(4, 2);
        let [ada, ben] = ["ada", "ben"].map(|name| Owner(name.into()));
        let take = |owner: &Owner| places.take(Some(owner)).now_or_never();
        let first = take(&ada).unwrap();
        let _second = take(&ada).unwrap();
        assert!(take(&ada).is_none());
        let _third = take(&ben).unwrap();
        drop(first);
        let _again = take(&ada).unwrap();
        // All are taken now, if ben has his share.
        let last = take(&ben).unwrap();
        assert!(places.take(None).now_or_never().is_none());
        drop(last);
        assert!(places.take(None).now_or_never().is_some());
    }
}
