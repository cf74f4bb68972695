//! Who answers questions: processes of their own, as for jobs, because what a question takes shows only when it is answered.
//!
//! A process for questions has little memory, and little time; it is not behind those of jobs, because somebody waits. One that needs more
//! is ended, alone. To start one costs more than most answers, so those that a burst of questions asked for are kept for the next one, and go when they were not needed for a while.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use lacuna_kernel::budget::{CancelToken, Limits};

use super::process::{ASK_FOR_LESS, Bounds, GRACE, Place, Process, Purpose};
use crate::documents::ModelFinder;
use crate::problem::Problem;
use crate::production::Engine;
use crate::questions::{self, Question};
use crate::store::Store;

/// Processes that wait for the next question, however long.
const KEPT: usize = 2;

/// How long others wait.
const PATIENCE: Duration = Duration::from_secs(5);

/// Where questions are answered.
#[derive(Debug)]
pub struct Asked {
    engine: Engine,
    /// Those that wait, and since when: the last that answered is asked first, and so the first have waited longest.
    idle: Mutex<VecDeque<(Instant, Process)>>,
}

impl Asked {
    /// Where an engine answers: in this process if it does its jobs there.
    #[must_use]
    pub fn new(engine: Engine) -> Self {
        Self { engine, idle: Mutex::default() }
    }

    /// The answer to a question, see [`questions::answer`], unless nobody wants it any more. It blocks.
    ///
    /// # Errors
    /// The answer's own, and that it needs more time or memory than it may have.
    pub fn ask(
        &self,
        question: Question,
        document: &[u8],
        most: &Limits,
        store: &Store,
        find: ModelFinder<'_>,
        cancel: &CancelToken,
    ) -> Result<String, Problem> {
        if self.engine.here.is_some() {
            return questions::answer(question, document, most, find, self.engine);
        }
        let mut place = Place::of(Purpose::Questions, crate::locked(&self.idle).pop_back().map(|(_, process)| process));
        let (time, memory_bytes) = question.bounds();
        let bounds = Bounds { memory_bytes: memory_bytes.min(most.memory_bytes), time, grace: GRACE, advice: ASK_FOR_LESS, cancel };
        let answer = place.ask(question, document, *most, &bounds, store, find, rayon::current_num_threads());
        let now = Instant::now();
        let mut idle = crate::locked(&self.idle);
        idle.extend(place.into_process().map(|process| (now, process)));
        let mut going = Vec::new();
        while idle.len() > KEPT && idle.front().is_some_and(|(since, _)| now - *since > PATIENCE) {
            going.extend(idle.pop_front());
        }
        drop(idle);
        drop(going);
        answer
    }
}
