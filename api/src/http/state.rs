//! What every handler may see.

use std::sync::Arc;
use std::time::Duration;

use lacuna_kernel::budget::{CancelToken, StopReason};
use tokio::runtime::Handle;
use tokio::sync::{Semaphore, watch};

use super::auth::{Owner, RateLimiter};
use super::places::Places;
use crate::config::Config;
use crate::documents::Stored;
use crate::jobs::asked::Asked;
use crate::jobs::desk::{Desk, DeskLimits};
use crate::jobs::readers::Readers;
use crate::metrics::Metrics;
use crate::problem::Problem;
use crate::production::Engine;
use crate::questions::Question;
use crate::store::Store;

/// The state of the service, shared by all requests.
pub struct AppState {
    /// Its settings.
    pub config: Config,
    /// The desk for jobs.
    pub desk: Arc<Desk>,
    /// Where documents and results are kept.
    pub store: Arc<Store>,
    /// What is counted.
    pub metrics: Arc<Metrics>,
    /// Turns true when the service goes down; open streams end then.
    pub closing: watch::Sender<bool>,
    /// Who does the jobs.
    pub engine: Engine,
    /// Who answers questions.
    asked: Asked,
    /// Who reads mesh files that are uploaded.
    pub readers: Readers,
    /// Who submitted how often.
    pub submissions: RateLimiter,
    /// Who called otherwise how often.
    pub calls: RateLimiter,
    /// Places for connections.
    pub connections: Arc<Semaphore>,
    /// Places for work on documents beside the event loop.
    blocking: Places,
}

/// Held while a request is answered: when its client leaves, or its time is over, what works for it is told.
pub struct Leaving(CancelToken);

impl Leaving {
    /// What to hold, and the flag that falls when it is dropped.
    #[must_use]
    pub fn new() -> (Self, CancelToken) {
        let cancel = CancelToken::new();
        (Self(cancel.clone()), cancel)
    }
}

impl Drop for Leaving {
    fn drop(&mut self) {
        self.0.fire(StopReason::Cancelled);
    }
}

/// The state as handlers take it.
pub type Shared = Arc<AppState>;

impl AppState {
    /// Opens what the settings name, the data folder or the database and the object store, and takes up what is in it.
    /// Nothing runs yet: see [`super::serve`].
    ///
    /// # Errors
    /// When it cannot be used.
    pub async fn open(config: Config) -> Result<Shared, Problem> {
        let Some(places) = &config.shared else {
            return Self::with_engine(config, Engine::KERNEL);
        };
        let failed = |error| Problem::io("the object store of LACUNA_OBJECTS_URL cannot be used", &error);
        let root = config.data.clone();
        // One provider of cryptography for both; a second call finds the first one's.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let store = Arc::new(Store::open_bucket(&places.objects, &root, Handle::current()).map_err(failed)?);
        let metrics = Arc::new(Metrics::default());
        let lease = Duration::from_secs(config.lease_seconds);
        let desk = Desk::open_shared(&places.database.0, lease, Arc::clone(&store), limits(&config), Arc::clone(&metrics)).await?;
        Ok(Self::over(config, Engine::KERNEL, desk))
    }

    /// One process over its data folder, with somebody to do the jobs.
    ///
    /// # Errors
    /// When the data folder fails.
    pub fn with_engine(config: Config, engine: Engine) -> Result<Shared, Problem> {
        let failed = |error| Problem::io(format!("the data folder {} cannot be used", config.data.display()), &error);
        let store = Arc::new(Store::open(&config.data).map_err(failed)?);
        let desk = Desk::open(&config.data, store, limits(&config), Arc::default()).map_err(failed)?;
        Ok(Self::over(config, engine, desk))
    }

    fn over(config: Config, engine: Engine, desk: Desk) -> Shared {
        let (store, metrics) = (Arc::clone(&desk.store), Arc::clone(&desk.metrics));
        let submissions = RateLimiter::new("submissions", config.submissions_per_minute);
        let calls = RateLimiter::new("calls", config.calls_per_minute);
        // Reading documents is short, but must not take the memory of many at once; several wait for the device at a time.
        let places = (config.workers * 2).max(8);
        // Without keys there is one owner, who need not leave any to others.
        let blocking = Places::new(places, if config.keys.is_empty() { places } else { places / 2 });
        let connections = Arc::new(Semaphore::new(config.connections));
        Arc::new(Self {
            config,
            desk: Arc::new(desk),
            store,
            metrics,
            closing: watch::Sender::new(false),
            engine,
            asked: Asked::new(engine),
            readers: Readers::new(engine),
            submissions,
            calls,
            connections,
            blocking,
        })
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

    /// The answer to an owner's question about a document: in another process, with a limit of its memory, for as long as anybody waits. It blocks.
    ///
    /// # Errors
    /// The answer's own.
    pub fn ask(&self, owner: &Owner, question: Question, document: &[u8], cancel: &CancelToken) -> Result<String, Problem> {
        self.asked.ask(question, document, &self.config.job_limits, &self.store, &self.models_of(owner), cancel)
    }

    /// Does what blocks (parsing, disk, waiting for another process) beside the event loop, for an owner or for the service itself.
    ///
    /// # Errors
    /// The work's own, or our defect when it panicked.
    pub async fn beside<T: Send + 'static>(
        self: &Arc<Self>,
        owner: Option<Owner>,
        work: impl FnOnce(&AppState) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let place = self.blocking.take(owner.as_ref()).await;
        self.at_once(move |state| {
            let result = work(state);
            drop(place);
            result
        })
        .await
    }

    /// Does what blocks for a moment only, and has no memory to speak of, beside the event loop and without waiting for a place: who wants to stop a
    /// job, or to know how the service is, does not stand behind documents that are being read.
    ///
    /// # Errors
    /// As [`AppState::beside`].
    pub async fn at_once<T: Send + 'static>(
        self: &Arc<Self>,
        work: impl FnOnce(&AppState) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let state = Arc::clone(self);
        let task = tokio::task::spawn_blocking(move || work(&state));
        task.await.unwrap_or_else(|error| Err(Problem::internal(format!("a request's work failed: {error}"))))
    }
}

fn limits(config: &Config) -> DeskLimits {
    DeskLimits { queued: config.queued, per_owner: config.jobs_per_key }
}
