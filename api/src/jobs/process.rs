//! A worker's process: the same program, which does one job after the other on this side's behalf (`apart.rs` is the other side).
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

use lacuna_kernel::budget::StopReason;
use lacuna_kernel::error::LimitFacts;

use super::live::LiveJob;
use super::making::{Files, Task};
use super::memory;
use super::messages::{self, MeshHead, Said, Told};
use crate::documents::Stored;
use crate::files::PendingFile;
use crate::problem::{Problem, ProblemKind};
use crate::production;
use crate::store::Store;

/// Between two looks at the flag that stops a job: a share of the 250 ms within which its worker must be free.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// A process that has more than this resident after a job is not kept, in bytes: several times what it starts with.
const KEPT_BYTES: u64 = 64 << 20;

/// Of what a process writes to stderr the last lines are kept: those that say why it ended.
const WORDS_KEPT: usize = 20;

/// The command of the program that is this process's other side; it is for nobody else, so it is not in the help.
pub const COMMAND: &str = "do-jobs";

/// A process and what it says.
#[derive(Debug)]
pub(super) struct Process {
    child: Child,
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

/// Why a job has no files.
enum Failure {
    /// The process says so, and can do another one.
    Refused(Problem),
    /// It is at an end, or must be brought to one.
    Over(Problem),
}

impl Process {
    /// Starts one that works with so many threads and writes into the store's scratch folder.
    fn start(store: &Store, threads: usize) -> io::Result<Self> {
        let mut command = Command::new(program()?);
        command.args([COMMAND, "--threads", &threads.to_string()]).current_dir(store.scratch());
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
        let process = Self { child, stdin, heard, words: VecDeque::new() };
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
        let mut files = Vec::new();
        let (mut seconds, mut memory_bytes, mut deadline) = (task.most.seconds, task.most.memory_bytes, None);
        loop {
            if let Some(reason) = job.cancel.reason() {
                return Err(Failure::Over(production::stopped(reason, seconds)));
            }
            if deadline.is_some_and(|deadline| Instant::now() >= deadline) {
                job.cancel.fire(StopReason::Deadline);
                continue;
            }
            match self.heard.recv_timeout(LOOK_EVERY) {
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(Failure::Over(self.post_mortem(memory_bytes))),
                Ok(Heard::Words(line)) => self.remember(line),
                Ok(Heard::Garbled(error)) => {
                    let detail = format!("a worker's process cannot be understood: {error}");
                    return Err(Failure::Over(Problem::internal(detail).code("worker-crashed")));
                }
                Ok(Heard::Said(Said::Progress(step))) => job.progress(step),
                Ok(Heard::Said(Said::Begun { seconds: time, memory_bytes: memory })) => {
                    (seconds, memory_bytes) = (time, memory);
                    // A time that the clock cannot count has no end.
                    deadline = Duration::try_from_secs_f64(time.max(0.0)).ok().and_then(|time| Instant::now().checked_add(time));
                }
                Ok(Heard::Said(Said::NeedsMesh(reference))) => match store.referred(&reference) {
                    Some(Stored::Mesh(mesh)) => {
                        let format = mesh.format.facts().ending.to_owned();
                        let head = MeshHead { name: mesh.name, format, bytes: mesh.bytes.len() as u64 };
                        self.tell(&Told::Mesh(Some(head)), &mesh.bytes);
                    }
                    _ => self.tell(&Told::Mesh(None), &[]),
                },
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
            }
        }
    }

    fn remember(&mut self, line: String) {
        tracing::warn!(process = self.child.id(), line, "a worker's process says");
        self.words.push_back(line);
        if self.words.len() > WORDS_KEPT {
            self.words.pop_front();
        }
    }

    /// Why the process has ended in the middle of a job that had so many bytes of memory.
    fn post_mortem(&mut self, memory_bytes: u64) -> Problem {
        match self.child.wait() {
            Ok(status) => death(status, &self.words, memory_bytes),
            Err(error) => Problem::io("a worker's process is lost", &error),
        }
    }

    /// Itself if it still runs: one that waits for its next job may have been killed like any other.
    fn still_there(mut self) -> Option<Self> {
        matches!(self.child.try_wait(), Ok(None)).then_some(self)
    }

    /// Whether it can be kept for another job.
    fn is_small(&self) -> bool {
        memory::of_process(&self.child.id().to_string(), "VmRSS:").is_some_and(|bytes| bytes <= KEPT_BYTES)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A worker's place for a process: started for the first job, and again after one that took it down.
#[derive(Debug, Default)]
pub(super) struct Place(Option<Process>);

impl Place {
    /// Does a job, with so many threads.
    pub(super) fn perform(&mut self, task: &Task, job: &Arc<LiveJob>, store: &Store, threads: usize) -> Result<Files, Problem> {
        let kept = self.0.take().and_then(Process::still_there);
        let started = kept.map_or_else(|| Process::start(store, threads), Ok);
        let mut process = started.map_err(|error| Problem::io("no process to do the job", &error))?;
        let made = process.perform(task, job, store);
        if !matches!(made, Err(Failure::Over(_))) && process.is_small() {
            self.0 = Some(process);
        }
        made.map_err(|failure| match failure {
            Failure::Refused(problem) | Failure::Over(problem) => problem,
        })
    }
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

/// What a death tells.
fn death(status: ExitStatus, words: &VecDeque<String>, memory_bytes: u64) -> Problem {
    /// How Rust's allocation failures begin on stderr, before the process aborts.
    const NO_MEMORY: &str = "memory allocation of ";
    if let Some(line) = words.iter().rev().find(|line| line.contains(NO_MEMORY)) {
        let piece = line.split(NO_MEMORY).nth(1).and_then(|rest| rest.split(' ').next()).unwrap_or("more");
        let detail = format!(
            "The work needs more memory than its limit of {memory_bytes} bytes: the operating system refused it another {piece} bytes; allow more \
             memory_bytes, or ask for a larger tolerance or a smaller model"
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
