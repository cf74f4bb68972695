//! A process that does jobs, answers questions or reads uploads for the service, one after the other: the other end of `process.rs`.
//!
//! It is asked on stdin, answers on stdout, and knows neither the store nor the network. When stdin closes, because the
//! service has gone, however it went, this process ends at once.

use std::io::{self, BufReader};
use std::path::Path;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use lacuna_exchange::format::Format;
use lacuna_kernel::budget::{Budget, Limits, Progress};

use super::making::{self, Task, Workshop};
use super::memory;
use super::messages::{self, Said, Told};
use super::process::Purpose;
use super::record::Step;
use crate::documents::{Stored, StoredMesh};
use crate::files::PendingFile;
use crate::inspection;
use crate::problem::Problem;
use crate::production::{self, Engine};
use crate::questions::{self, Question};

/// Shortest time between two words on the progress of a phase; the service tells its listeners less often.
const PROGRESS_EVERY: Duration = Duration::from_millis(50);

/// Takes its place behind the service, before there is a second thread in this process.
pub fn take_place(purpose: Purpose) {
    if purpose == Purpose::Jobs {
        memory::give_way();
    }
    memory::go_first();
}

/// Does jobs until nobody asks for more.
///
/// # Errors
/// When stdin or stdout fails, or what comes in is not understood.
pub fn serve() -> Result<(), Problem> {
    let (sender, heard) = mpsc::sync_channel(1);
    let listener = std::thread::Builder::new().name("listener".into()).spawn(move || listen(&sender));
    listener.map_err(|error| Problem::io("no thread to listen", &error))?;
    let desk = Desk { heard, said: Arc::default() };
    while let Some(heard) = desk.next() {
        let said = match heard {
            Heard::Job(task) => production::guarded(|| desk.perform(&task)),
            Heard::Question(asked) => production::guarded(|| desk.answer(&asked)),
            Heard::Upload(upload) => production::guarded(|| examine(&upload)),
            _ => return Err(Problem::internal("an answer without a question")),
        };
        let said = said.and_then(|said| said).unwrap_or_else(|problem| Said::Failed(Box::new(problem)));
        desk.say(&said).map_err(|error| Problem::io("stdout", &error))?;
    }
    Ok(())
}

/// What came in, with its bytes.
enum Heard {
    Job(Box<Task>),
    Question(Box<Asked>),
    Upload(Upload),
    Stored(Option<Stored>),
    File(String),
}

/// A question.
struct Asked {
    question: Question,
    document: Vec<u8>,
    most: Limits,
    memory_bytes: u64,
}

/// A mesh file to examine.
struct Upload {
    name: String,
    format: Option<Format>,
    upload_bytes: u64,
    memory_bytes: u64,
}

/// Listens for the whole life of the process, whatever it computes.
fn listen(sender: &SyncSender<Heard>) {
    let mut stdin = BufReader::new(io::stdin());
    while let Ok(Some(heard)) = hear(&mut stdin) {
        if sender.send(heard).is_err() {
            break;
        }
    }
    // Nobody is there any more who could want a result.
    std::process::exit(0);
}

fn hear(stdin: &mut BufReader<io::Stdin>) -> io::Result<Option<Heard>> {
    let Some(told) = messages::receive(stdin)? else { return Ok(None) };
    Ok(Some(match told {
        Told::Job { bytes, most, input_digest } => {
            let document = messages::announced(stdin, bytes)?;
            Heard::Job(Box::new(Task { document, most: most.into(), input_digest }))
        }
        Told::Question { question, bytes, most, memory_bytes } => {
            let document = messages::announced(stdin, bytes)?;
            Heard::Question(Box::new(Asked { question, document, most: most.into(), memory_bytes }))
        }
        Told::Upload { name, format, upload_bytes, memory_bytes } => {
            let format = format.map(|format| Format::from_name(&format).ok_or(io::ErrorKind::InvalidData)).transpose()?;
            Heard::Upload(Upload { name, format, upload_bytes, memory_bytes })
        }
        Told::Mesh(None) => Heard::Stored(None),
        Told::Model(bytes) => Heard::Stored(Some(Stored::Document(messages::announced(stdin, bytes)?))),
        Told::Mesh(Some(head)) => {
            let bytes = messages::announced(stdin, head.bytes)?;
            let format = Format::from_name(&head.format).ok_or(io::ErrorKind::InvalidData)?;
            // By which word it is found again is the service's business.
            Heard::Stored(Some(Stored::Mesh(StoredMesh { name: head.name, format, bytes, reference: head.reference })))
        }
        Told::File(name) => Heard::File(name),
    }))
}

/// Where the process hears and speaks.
struct Desk {
    heard: Receiver<Heard>,
    /// When it last told of its progress, and in which phase; who holds it speaks.
    said: Arc<Mutex<Option<(Instant, String)>>>,
}

impl Desk {
    fn next(&self) -> Option<Heard> {
        self.heard.recv().ok()
    }

    fn perform(&self, task: &Task) -> Result<Said, Problem> {
        memory::limit(task.most.memory_bytes)?;
        // Every job tells of its first step, however shortly before the last one told of a step in a phase of the same name.
        *crate::locked(&self.said) = None;
        let made = making::make(task, production::compute, self)?;
        // The files stay: they are the service's.
        let outputs = made.files.into_iter().map(|(_, output)| output).collect();
        Ok(Said::Done { outputs, certificate: Box::new(made.certificate) })
    }

    fn answer(&self, asked: &Asked) -> Result<Said, Problem> {
        memory::limit(asked.memory_bytes)?;
        let find = |word: &str| self.stored(word);
        questions::answer(asked.question, &asked.document, &asked.most, &find, Engine::KERNEL).map(Said::Answer)
    }

    fn say(&self, said: &Said) -> io::Result<()> {
        let _alone = crate::locked(&self.said);
        messages::send(&mut io::stdout().lock(), said, &[])
    }
}

/// Reads a mesh file and tells what is in it.
fn examine(upload: &Upload) -> Result<Said, Problem> {
    memory::limit(upload.memory_bytes)?;
    let examined = inspection::examine(Path::new(&upload.name), upload.format, upload.upload_bytes)?;
    serde_json::to_string(&examined).map(Said::Answer).map_err(|error| Problem::internal(error.to_string()))
}

impl Workshop for Desk {
    fn stored(&self, reference: &str) -> Option<Stored> {
        self.say(&Said::NeedsStored(reference.to_owned())).ok()?;
        match self.next() {
            Some(Heard::Stored(stored)) => stored,
            _ => None,
        }
    }

    fn begin(&self, limits: Limits) -> Result<Budget, Problem> {
        memory::limit(limits.memory_bytes)?;
        let begun = Said::Begun { seconds: limits.seconds, memory_bytes: limits.memory_bytes };
        self.say(&begun).map_err(|error| Problem::io("stdout", &error))?;
        let said = Arc::clone(&self.said);
        let sink = move |progress: &Progress| tell(&said, progress);
        Ok(Budget { limits, progress: Some(Arc::new(sink)), ..Budget::default() })
    }

    fn new_file(&self) -> io::Result<PendingFile> {
        self.say(&Said::NeedsFile)?;
        match self.next() {
            Some(Heard::File(name)) => PendingFile::lent(Path::new(&name)),
            _ => Err(io::ErrorKind::UnexpectedEof.into()),
        }
    }
}

fn tell(said: &Mutex<Option<(Instant, String)>>, progress: &Progress) {
    let mut last = crate::locked(said);
    if last.as_ref().is_some_and(|(time, phase)| phase == progress.phase && time.elapsed() < PROGRESS_EVERY) {
        return;
    }
    *last = Some((Instant::now(), progress.phase.to_owned()));
    // A service that does not listen has gone, and stdin says so.
    let _ = messages::send(&mut io::stdout().lock(), &Said::Progress(Step::from(progress)), &[]);
}
