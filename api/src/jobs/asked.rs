//! Who answers questions: processes of their own, as for jobs, because what a question takes shows only when it is answered.
//!
//! A process for questions has little memory, and little time; it is not behind those of jobs, because somebody waits. One that needs more
//! is ended, alone. As many are kept as answer what comes one after the other; more are started while more is asked at once.

use std::sync::Mutex;

use lacuna_kernel::budget::Limits;

use super::process::{Place, Process, Purpose};
use crate::documents::ModelFinder;
use crate::problem::Problem;
use crate::production::Engine;
use crate::questions::{self, Question};
use crate::store::Store;

/// The most memory that an answer may take, in bytes; less where jobs may have less.
const MEMORY_BYTES: u64 = 1 << 30;

/// Processes that wait for the next question.
const KEPT: usize = 2;

/// Where questions are answered.
#[derive(Debug)]
pub struct Asked {
    engine: Engine,
    idle: Mutex<Vec<Process>>,
}

impl Asked {
    /// Where an engine answers: in this process if it does its jobs there.
    #[must_use]
    pub fn new(engine: Engine) -> Self {
        Self { engine, idle: Mutex::default() }
    }

    /// The answer to a question, see [`questions::answer`]. It blocks.
    ///
    /// # Errors
    /// The answer's own, and that it needs more memory than it may have.
    pub fn ask(&self, question: Question, document: &[u8], most: &Limits, store: &Store, find: ModelFinder<'_>) -> Result<String, Problem> {
        if self.engine.here.is_some() {
            return questions::answer(question, document, most, find, self.engine);
        }
        let mut place = Place::of(Purpose::Questions, crate::locked(&self.idle).pop());
        let memory_bytes = MEMORY_BYTES.min(most.memory_bytes);
        let answer = place.ask(question, document, *most, memory_bytes, store, find, rayon::current_num_threads());
        let mut idle = crate::locked(&self.idle);
        if idle.len() < KEPT {
            idle.extend(place.into_process());
        }
        answer
    }
}
