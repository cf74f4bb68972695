//! Who reads mesh files that were uploaded: a process of its own for each, because what a file takes to read shows only when it is read.
//!
//! A reader has a limit of memory and one of time, and is ended when nobody waits for it any more. Few read at the same time, so that the
//! machine's memory is enough for all of them, and each owner has one file read after the other: many files of one key hold up that key alone.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use lacuna_exchange::format::Format;
use lacuna_kernel::budget::{CancelToken, Limits};
use lacuna_kernel::error::LimitFacts;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::process::{Bounds, Place, Purpose};
use crate::files::PendingFile;
use crate::inspection::{self, Examined};
use crate::problem::{Problem, ProblemKind};
use crate::production::Engine;
use crate::store::Store;

/// Files that are read at the same time.
const READERS: usize = 2;

/// The most memory that reading a file may take, in bytes; less where jobs may have less. The 20 million triangles that an upload may have
/// need about as much.
const MEMORY_BYTES: u64 = 3 << 30;

/// Longest time that reading a file may take; less where jobs may have less.
const TIME: Duration = Duration::from_secs(120);

/// What helps a file that needs more memory or time.
const SEND_LESS: &str = "send a smaller file, or one of fewer triangles";

/// Where mesh files are read.
#[derive(Debug)]
pub struct Readers {
    engine: Engine,
    places: Arc<Semaphore>,
    /// A place for each owner, of whom there are as many as keys.
    owners: Mutex<HashMap<String, Arc<Semaphore>>>,
}

/// A place to read a file; another file is read there when it is dropped.
#[derive(Debug)]
pub struct ReadersPlace(#[expect(dead_code, reason = "held, not looked at")] [OwnedSemaphorePermit; 2]);

impl Readers {
    /// Where an engine's files are read: in this process if it does its jobs there.
    #[must_use]
    pub fn new(engine: Engine) -> Self {
        Self { engine, places: Arc::new(Semaphore::new(READERS)), owners: Mutex::default() }
    }

    /// Waits for a place to read a file of an owner.
    ///
    /// # Errors
    /// None but a defect.
    pub async fn place(&self, owner: &str) -> Result<ReadersPlace, Problem> {
        let own = Arc::clone(crate::locked(&self.owners).entry(owner.to_owned()).or_insert_with(|| Arc::new(Semaphore::new(1))));
        let closed = |error: tokio::sync::AcquireError| Problem::internal(error.to_string());
        // First the owner's: whoever waits for that holds nothing that others wait for.
        let own = own.acquire_owned().await.map_err(closed)?;
        let shared = Arc::clone(&self.places).acquire_owned().await.map_err(closed)?;
        Ok(ReadersPlace([own, shared]))
    }

    /// Reads and examines a file that lies in the store's scratch folder. It blocks, until the token is fired at most.
    ///
    /// # Errors
    /// What is wrong with the file, that it needs more memory or time than there is, or that nobody waits for it any more.
    pub fn examine(
        &self,
        pending: &PendingFile,
        format: Option<Format>,
        upload_bytes: u64,
        most: &Limits,
        store: &Store,
        cancel: &CancelToken,
    ) -> Result<Examined, Problem> {
        let name = pending.name();
        if self.engine.here.is_some() {
            return inspection::examine(&store.scratch().join(name), format, upload_bytes);
        }
        let memory_bytes = MEMORY_BYTES.min(most.memory_bytes);
        let time = Duration::try_from_secs_f64(most.seconds).map_or(TIME, |seconds| TIME.min(seconds));
        let bounds = Bounds { memory_bytes, time, grace: Duration::ZERO, advice: SEND_LESS, cancel };
        let mut place = Place::of(Purpose::Questions, None);
        let answer = place.examine(name, format, upload_bytes, &bounds, store, rayon::current_num_threads());
        let answer = answer.map_err(|problem| match problem.code.as_str() {
            "limit.seconds" => {
                let detail = format!("The file was not read within {} s; {SEND_LESS}", time.as_secs_f64());
                Problem { detail, ..problem }
            }
            "format.out-of-memory" => no_memory(&problem.detail, memory_bytes),
            _ => problem,
        })?;
        serde_json::from_str(&answer).map_err(|error| Problem::internal(format!("a report on a mesh cannot be read: {error}")))
    }
}

/// A reader that asks before it takes memory says where there was none; a process that ends tells the same in [`super::process`].
fn no_memory(said: &str, memory_bytes: u64) -> Problem {
    // How much would have been enough is not known.
    #[expect(clippy::cast_precision_loss, reason = "limits are shown, not computed with")]
    let facts = LimitFacts { limit: "memory_bytes", asked: f64::INFINITY, allowed: memory_bytes as f64, remedy: None };
    let detail = format!("Reading the file needs more memory than its limit of {memory_bytes} bytes: {said}; {SEND_LESS}");
    Problem::new(ProblemKind::Limit, detail).code("limit.memory").limit(&facts)
}
