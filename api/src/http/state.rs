//! What every handler may see.

use std::sync::Arc;

use tokio::sync::{Semaphore, watch};

use super::auth::{Owner, RateLimiter};
use crate::config::Config;
use crate::documents::Stored;
use crate::jobs::desk::{Desk, DeskLimits};
use crate::metrics::Metrics;
use crate::problem::Problem;
use crate::production::Engine;
use crate::store::Store;

/// The state of the service, shared by all requests.
pub struct AppState {
    /// Its settings.
    pub config: Config,
    /// The desk for jobs.
    pub desk: Arc<Desk>,
    /// The data folder.
    pub store: Arc<Store>,
    /// What is counted.
    pub metrics: Arc<Metrics>,
    /// Turns true when the service goes down; open streams end then.
    pub closing: watch::Sender<bool>,
    /// Who does the jobs.
    pub engine: Engine,
    /// Who submitted how often.
    pub submissions: RateLimiter,
    /// Who called otherwise how often.
    pub calls: RateLimiter,
    /// Places for work on documents beside the event loop.
    blocking: Arc<Semaphore>,
}

/// The state as handlers take it.
pub type Shared = Arc<AppState>;

impl AppState {
    /// Opens the data folder and takes up what is in it. Nothing runs yet: see [`super::serve`].
    ///
    /// # Errors
    /// When the data folder fails.
    pub fn open(config: Config) -> Result<Shared, Problem> {
        Self::with_engine(config, Engine::KERNEL)
    }

    /// As [`AppState::open`], with something else in the kernel's place.
    ///
    /// # Errors
    /// As [`AppState::open`].
    pub fn with_engine(config: Config, engine: Engine) -> Result<Shared, Problem> {
        let failed = |error| Problem::io(format!("the data folder {} cannot be used", config.data.display()), &error);
        let store = Arc::new(Store::open(&config.data).map_err(failed)?);
        let metrics = Arc::new(Metrics::default());
        let limits = DeskLimits { queued: config.queued, per_owner: config.jobs_per_key };
        let desk = Arc::new(Desk::open(Arc::clone(&store), limits, Arc::clone(&metrics)).map_err(failed)?);
        let submissions = RateLimiter::new("submissions", config.submissions_per_minute);
        let calls = RateLimiter::new("calls", config.calls_per_minute);
        // Twice the workers: reading documents is short, but must not take the memory of many at once.
        let blocking = Arc::new(Semaphore::new(config.workers * 2));
        Ok(Arc::new(Self { config, desk, store, metrics, closing: watch::Sender::new(false), engine, submissions, calls, blocking }))
    }

    /// Finds the models and mesh files that an owner has stored.
    pub fn models_of(&self, owner: &Owner) -> impl Fn(&str) -> Option<Stored> {
        let (store, owner) = (Arc::clone(&self.store), owner.0.clone());
        move |id| {
            store.stored(&owner, id).unwrap_or_else(|error| {
                tracing::error!(%error, "a stored model could not be read");
                None
            })
        }
    }

    /// Does what blocks (parsing, disk, planning) beside the event loop.
    ///
    /// # Errors
    /// The work's own, or our defect when it panicked.
    pub async fn beside<T: Send + 'static>(
        self: &Arc<Self>,
        work: impl FnOnce(&AppState) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let place = Arc::clone(&self.blocking).acquire_owned().await.map_err(|error| Problem::internal(error.to_string()))?;
        let state = Arc::clone(self);
        let task = tokio::task::spawn_blocking(move || {
            let result = work(&state);
            drop(place);
            result
        });
        task.await.unwrap_or_else(|error| Err(Problem::internal(format!("a request's work failed: {error}"))))
    }
}
