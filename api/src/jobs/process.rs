//! A worker's process: the same program, which does one job, answers one question, or reads one upload after the other on this side's behalf (`apart.rs` is the
//! other side).
//!
//! What a job does to its process (memory that runs out, a crash of native code, a stack that overflows) it does to nobody else. A
//! job that is to stop is not asked to: its process is killed, wherever it is, and its memory is free. A process is kept for the
//! next job as long as it is small; one that has grown goes, with what its allocator would have kept.

use std::collections::VecDeque;
use std::io::{self, BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

use lacuna_exchange::format::Format;
use lacuna_kernel::budget::{CancelToken, Limits, StopReason};
use lacuna_kernel::error::LimitFacts;

use super::live::LiveJob;
use super::making::{Files, Task};
use super::memory;
use super::messages::{self, MeshHead, Said, Told};
use crate::documents::{ModelFinder, Stored};
use crate::files::PendingFile;
use crate::problem::{Problem, ProblemKind};
use crate::production;
use crate::questions::Question;
use crate::store::Store;

/// Between two looks at the flag that stops a job: a share of the 250 ms within which its worker must be free.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// A process that has more than this resident after a job is not kept, in bytes: several times what it starts with.
const KEPT_BYTES: u64 = 64 << 20;

/// Of what a process writes to stderr the last lines are kept: those that say why it ended.
const WORDS_KEPT: usize = 20;

/// The command of the program that is this process's other side; it is for nobody else, so it is not in the help.
pub const COMMAND: &str = "do-jobs";

/// How much longer than its time an answer is waited for: a process that looks at the clock says itself that it was not enough.
pub(super) const GRACE: Duration = Duration::from_secs(2);

/// What a process is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Purpose {
    /// It does jobs, whenever nobody else needs the processor.
    #[default]
    Jobs,
    /// It answers questions, or reads uploads, that somebody waits for.
    Questions,
}

/// A process and what it says.
#[derive(Debug)]
pub(super) struct Process {
    /// Its number.
    id: u32,
    /// There until this side has no more to do with it.
    child: Option<Child>,
    stdin: ChildStdin,
    heard: Receiver<Heard>,
    words: VecDeque<String>,
}

#[derive(Debug)]
enum Heard {
    Said(Said),
    /// A line of stderr.
    Words(String),
    /// No message.
    Garbled(io::Error),
}

/// What an answer may take.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds<'a> {
    /// Memory in bytes.
    pub(super) memory_bytes: u64,
    /// Time.
    pub(super) time: Duration,
    /// How much longer it is waited for, because the process looks at the clock itself.
    pub(super) grace: Duration,
    /// What helps if the memory is not enough.
    pub(super) advice: &'static str,
    /// Fired when nobody waits for the answer any more.
    pub(super) cancel: &'a CancelToken,
}

/// Why a job has no files.
enum Failure {
    /// The process says so, and can do another one.
    Refused(Problem),
    /// It is at an end, or must be brought to one.
    Over(Problem),
    /// It had come to its end before it said a word of this.
    Silent(Problem),
}

impl Process {
    /// Starts one that works with so many threads and writes into the store's scratch folder.
    fn start(purpose: Purpose, store: &Store, threads: usize) -> io::Result<Self> {
        let mut command = Command::new(program()?);
        command.args([COMMAND, "--threads", &threads.to_string()]).current_dir(store.scratch());
        if purpose == Purpose::Questions {
            command.args(["--purpose", "questions"]);
        }
        // Keys and passwords of the service are in its environment, and nothing that geometry needs.
        command.env_clear().stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        #[cfg(unix)]
        {
            use std::os::unix::process::CommandExt as _;
            // Ctrl-C in a terminal is for the service, which lets its jobs end.
            command.arg0("lacuna").process_group(0);
        }
        let mut child = command.spawn()?;
        let (Some(stdin), Some(stdout), Some(stderr)) = (child.stdin.take(), child.stdout.take(), child.stderr.take()) else {
            return Err(io::ErrorKind::BrokenPipe.into());
        };
        let (sender, heard) = mpsc::channel();
        let process = Self { id: child.id(), child: Some(child), stdin, heard, words: VecDeque::new() };
        let words = sender.clone();
        std::thread::Builder::new().name("process-said".into()).spawn(move || hear(stdout, &sender))?;
        std::thread::Builder::new().name("process-words".into()).spawn(move || overhear(stderr, &words))?;
        Ok(process)
    }

    fn tell(&mut self, told: &Told, bytes: &[u8]) {
        // If nobody reads, the process has ended: the end of what it says tells more than the failure to write.
        if let Err(error) = messages::send(&mut self.stdin, told, bytes) {
            tracing::debug!(%error, "a worker's process does not listen");
        }
    }

    fn perform(&mut self, task: &Task, job: &LiveJob, store: &Store) -> Result<Files, Failure> {
        let most = task.most.into();
        self.tell(&Told::Job { bytes: task.document.len() as u64, most, input_digest: task.input_digest.clone() }, &task.document);
        let (mut files, mut silent) = (Vec::new(), true);
        let (mut seconds, mut memory_bytes, mut deadline) = (task.most.seconds, task.most.memory_bytes, None);
        loop {
            if let Some(reason) = job.cancel.reason() {
                return Err(Failure::Over(production::stopped(reason, seconds)));
            }
            if deadline.is_some_and(|deadline| Instant::now() >= deadline) {
                job.cancel.fire(StopReason::Deadline);
                continue;
            }
            let heard = self.heard.recv_timeout(LOOK_EVERY);
            silent &= !matches!(heard, Ok(Heard::Said(_)));
            match heard {
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(self.dead(memory_bytes, ALLOW_MORE, silent)),
                Ok(Heard::Words(line)) => self.remember(line),
                Ok(Heard::Garbled(error)) => return Err(garbled(&error)),
                Ok(Heard::Said(Said::Progress(step))) => job.progress(step, self.id),
                Ok(Heard::Said(Said::Begun { seconds: time, memory_bytes: memory })) => {
                    (seconds, memory_bytes) = (time, memory);
                    // A time that the clock cannot count has no end.
                    deadline = Duration::try_from_secs_f64(time.max(0.0)).ok().and_then(|time| Instant::now().checked_add(time));
                }
                Ok(Heard::Said(Said::NeedsStored(reference))) => self.lend(store.referred(&reference)),
                Ok(Heard::Said(Said::NeedsFile)) => {
                    let failed = |error| Failure::Over(Problem::io("the result could not be written", &error));
                    let file = store.new_result().map_err(failed)?;
                    self.tell(&Told::File(file.name()), &[]);
                    files.push(file);
                }
                Ok(Heard::Said(Said::Done { outputs, certificate })) => {
                    let files: Vec<(PendingFile, _)> = files.into_iter().zip(outputs).collect();
                    return Ok(Files { files, certificate: *certificate });
                }
                Ok(Heard::Said(Said::Failed(problem))) => return Err(Failure::Refused(*problem)),
                Ok(Heard::Said(Said::Answer(_))) => return Err(garbled(&io::ErrorKind::InvalidData.into())),
            }
        }
    }

    /// The answer to a question, or what is in an upload.
    fn ask(&mut self, told: &Told, document: &[u8], bounds: &Bounds<'_>, find: ModelFinder<'_>) -> Result<String, Failure> {
        self.tell(told, document);
        let (deadline, mut silent) = (Instant::now() + bounds.time + bounds.grace, true);
        loop {
            let late = (Instant::now() >= deadline).then_some(StopReason::Deadline);
            if let Some(reason) = bounds.cancel.reason().or(late) {
                return Err(Failure::Over(production::stopped(reason, bounds.time.as_secs_f64())));
            }
            let heard = self.heard.recv_timeout(LOOK_EVERY);
            silent &= !matches!(heard, Ok(Heard::Said(_)));
            match heard {
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(self.dead(bounds.memory_bytes, bounds.advice, silent)),
                Ok(Heard::Words(line)) => self.remember(line),
                Ok(Heard::Garbled(error)) => return Err(garbled(&error)),
                Ok(Heard::Said(Said::NeedsStored(word))) => self.lend(find(&word)),
                Ok(Heard::Said(Said::Answer(text))) => return Ok(text),
                Ok(Heard::Said(Said::Failed(problem))) => return Err(Failure::Refused(*problem)),
                Ok(Heard::Said(_)) => return Err(garbled(&io::ErrorKind::InvalidData.into())),
            }
        }
    }

    fn lend(&mut self, stored: Option<Stored>) {
        match stored {
            Some(Stored::Mesh(mesh)) => {
                let format = mesh.format.facts().ending.to_owned();
                let head = MeshHead { name: mesh.name, format, reference: mesh.reference, bytes: mesh.bytes.len() as u64 };
                self.tell(&Told::Mesh(Some(head)), &mesh.bytes);
            }
            Some(Stored::Document(document)) => self.tell(&Told::Model(document.len() as u64), &document),
            None => self.tell(&Told::Mesh(None), &[]),
        }
    }

    fn remember(&mut self, line: String) {
        tracing::warn!(process = self.id, line, "a worker's process says");
        self.words.push_back(line);
        if self.words.len() > WORDS_KEPT {
            self.words.pop_front();
        }
    }

    fn dead(&mut self, memory_bytes: u64, advice: &str, silent: bool) -> Failure {
        let problem = self.post_mortem(memory_bytes, advice);
        if silent { Failure::Silent(problem) } else { Failure::Over(problem) }
    }

    /// Why the process has ended in the middle of what had so many bytes of memory.
    fn post_mortem(&mut self, memory_bytes: u64, advice: &str) -> Problem {
        match self.child.as_mut().map_or_else(|| Err(io::ErrorKind::NotFound.into()), Child::wait) {
            Ok(status) => death(status, &self.words, memory_bytes, advice),
            Err(error) => Problem::io("a worker's process is lost", &error),
        }
    }

    /// Itself if it still runs: one that waits for its next job may have been killed like any other.
    fn still_there(mut self) -> Option<Self> {
        matches!(self.child.as_mut().map(Child::try_wait), Some(Ok(None))).then_some(self)
    }

    /// Whether it can be kept for another job.
    fn is_small(&self) -> bool {
        memory::of_process(&self.id.to_string(), "VmRSS:").is_some_and(|bytes| bytes <= KEPT_BYTES)
    }
}

impl Drop for Process {
    /// Ends it. That is not waited for: it has the least priority, and where others need the processor it may be long before it has the moment
    /// that it takes to end. Whoever wished to stop its job hears before.
    fn drop(&mut self) {
        let Some(mut child) = self.child.take() else { return };
        // It may have ended already.
        let _ = child.kill();
        // Without a thread it stays in the system's table until this process ends, and does nothing there.
        let _ = std::thread::Builder::new().name("undertaker".into()).spawn(move || child.wait());
    }
}

/// A place for a process: started for the first job or question, and again after one that took it down.
#[derive(Debug, Default)]
pub(super) struct Place {
    purpose: Purpose,
    process: Option<Process>,
}

impl Place {
    /// A place with a process that was kept, perhaps.
    pub(super) fn of(purpose: Purpose, process: Option<Process>) -> Self {
        Self { purpose, process }
    }

    /// The process that is kept.
    pub(super) fn into_process(self) -> Option<Process> {
        self.process
    }

    /// Does a job, with so many threads.
    pub(super) fn perform(&mut self, task: &Task, job: &Arc<LiveJob>, store: &Store, threads: usize) -> Result<Files, Problem> {
        self.with_process(store, threads, |process| process.perform(task, job, store))
    }

    /// Answers a question within so many bytes of memory, with so many threads.
    #[expect(clippy::too_many_arguments, reason = "what a question is made of")]
    pub(super) fn ask(
        &mut self,
        question: Question,
        document: &[u8],
        most: Limits,
        bounds: &Bounds<'_>,
        store: &Store,
        find: ModelFinder<'_>,
        threads: usize,
    ) -> Result<String, Problem> {
        let told = Told::Question { question, bytes: document.len() as u64, most: most.into(), memory_bytes: bounds.memory_bytes };
        self.with_process(store, threads, |process| process.ask(&told, document, bounds, find))
    }

    /// Examines a mesh file of the store's scratch folder, with so many threads.
    pub(super) fn examine(
        &mut self,
        name: String,
        format: Option<Format>,
        upload_bytes: u64,
        bounds: &Bounds<'_>,
        store: &Store,
        threads: usize,
    ) -> Result<String, Problem> {
        let format = format.map(|format| format.facts().ending.to_owned());
        let told = Told::Upload { name, format, upload_bytes, memory_bytes: bounds.memory_bytes };
        self.with_process(store, threads, |process| process.ask(&told, &[], bounds, &|_| None))
    }

    fn with_process<T>(
        &mut self,
        store: &Store,
        threads: usize,
        mut work: impl FnMut(&mut Process) -> Result<T, Failure>,
    ) -> Result<T, Problem> {
        let start = || Process::start(self.purpose, store, threads).map_err(|error| Problem::io("no process to do the work", &error));
        let kept = self.process.take().and_then(Process::still_there);
        let (was_kept, mut process) = (kept.is_some(), kept.map_or_else(start, Ok)?);
        let mut made = work(&mut process);
        if was_kept && matches!(made, Err(Failure::Silent(_))) {
            // Killed while it waited, and not quite gone when it was looked at: what was to be done it never saw.
            process = start()?;
            made = work(&mut process);
        }
        if matches!(made, Ok(_) | Err(Failure::Refused(_))) && process.is_small() {
            self.process = Some(process);
        }
        made.map_err(|failure| match failure {
            Failure::Refused(problem) | Failure::Over(problem) | Failure::Silent(problem) => problem,
        })
    }
}

fn garbled(error: &io::Error) -> Failure {
    Failure::Over(Problem::internal(format!("a worker's process cannot be understood: {error}")).code("worker-crashed"))
}

/// This program, even if its file has been replaced since it was started.
fn program() -> io::Result<PathBuf> {
    let running = PathBuf::from("/proc/self/exe");
    if running.exists() { Ok(running) } else { std::env::current_exe() }
}

fn hear(stdout: impl Read, sender: &Sender<Heard>) {
    let mut stdout = BufReader::new(stdout);
    loop {
        let heard = match messages::receive(&mut stdout) {
            Ok(Some(said)) => Heard::Said(said),
            Ok(None) => return,
            Err(error) => Heard::Garbled(error),
        };
        let last = matches!(heard, Heard::Garbled(_));
        if sender.send(heard).is_err() || last {
            return;
        }
    }
}

fn overhear(stderr: impl Read, sender: &Sender<Heard>) {
    for line in BufReader::new(stderr).lines().map_while(Result::ok) {
        if sender.send(Heard::Words(line)).is_err() {
            return;
        }
    }
}

/// What helps a job that needs more memory than it has.
const ALLOW_MORE: &str = "allow more memory_bytes, or ask for a larger tolerance or a smaller model";

/// What helps a question that does.
pub(super) const ASK_FOR_LESS: &str = "ask about a smaller model or a larger tolerance; a job may have more memory than an answer";

/// What a death tells.
fn death(status: ExitStatus, words: &VecDeque<String>, memory_bytes: u64, advice: &str) -> Problem {
    /// How Rust's allocation failures begin on stderr, before the process aborts.
    const NO_MEMORY: &str = "memory allocation of ";
    if let Some(line) = words.iter().rev().find(|line| line.contains(NO_MEMORY)) {
        let piece = line.split(NO_MEMORY).nth(1).and_then(|rest| rest.split(' ').next()).unwrap_or("more");
        let detail = format!(
            "The work needs more memory than its limit of {memory_bytes} bytes: the operating system refused it another {piece} bytes; {advice}"
        );
        // How much would have been enough is not known.
        #[expect(clippy::cast_precision_loss, reason = "limits are shown, not computed with")]
        let facts = LimitFacts { limit: "memory_bytes", asked: f64::INFINITY, allowed: memory_bytes as f64, remedy: None };
        return Problem::new(ProblemKind::Limit, detail).code("limit.memory").limit(&facts);
    }
    if is_killed(status) {
        let detail = "The process that did the work was killed from outside, as an operating system does when a machine runs out of memory; try \
                      again later, or with a smaller memory_bytes, which is refused in time";
        return Problem::new(ProblemKind::Unavailable, detail).code("worker-killed").retry_after(60);
    }
    let last = words.back().map_or("nothing", String::as_str);
    Problem::internal(format!("a worker's process ended with {status}; its last words: {last}")).code("worker-crashed")
}

/// Whether somebody else ended the process: nothing in it can raise this signal by mistake.
fn is_killed(status: ExitStatus) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::process::ExitStatusExt as _;
        status.signal() == Some(rustix::process::Signal::KILL.as_raw())
    }
    #[cfg(not(unix))]
    {
        let _ = status;
        false
    }
}
