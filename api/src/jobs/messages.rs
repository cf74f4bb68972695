//! What a worker and its process say to each other: one JSON text a line, and behind some lines the bytes that they announce.

use std::io::{self, BufRead, Read, Write};

use lacuna_fabrication::Certificate;
use lacuna_kernel::budget::Limits;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::record::{Output, Step};
use crate::problem::Problem;
use crate::questions::Question;

/// What the worker tells its process.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Told {
    /// A job to do; its document follows.
    Job {
        /// Bytes of the document.
        bytes: u64,
        /// The most that it may ask for.
        most: Most,
        /// The digest of what was meant.
        input_digest: String,
    },
    /// A question about a document, which follows.
    Question {
        /// What is asked.
        question: Question,
        /// Bytes of the document.
        bytes: u64,
        /// The most that a job may ask for.
        most: Most,
        /// The memory that the answer may take, in bytes.
        memory_bytes: u64,
    },
    /// A mesh file to examine, which lies in the process's folder.
    Upload {
        /// Its name there.
        name: String,
        /// As what to read it, by the ending of the format; that is found in the file when absent.
        format: Option<String>,
        /// The most bytes that it may have.
        upload_bytes: u64,
        /// The memory that reading it may take, in bytes.
        memory_bytes: u64,
    },
    /// The mesh file that was asked for, which follows; without a head there is none.
    Mesh(Option<MeshHead>),
    /// The model document that was asked for, which follows, with so many bytes.
    Model(u64),
    /// The name of an empty file in the process's folder.
    File(String),
}

/// What is told of a mesh file before its bytes.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct MeshHead {
    /// What to call it.
    pub(super) name: Option<String>,
    /// As what to read it: the ending of its format.
    pub(super) format: String,
    /// The word by which a worker finds it again.
    pub(super) reference: String,
    /// How long it is.
    pub(super) bytes: u64,
}

/// What the process says to its worker.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Said {
    /// The document was read; the job has so much time and memory.
    Begun {
        /// Seconds.
        seconds: f64,
        /// Bytes.
        memory_bytes: u64,
    },
    /// How far it has come.
    Progress(Step),
    /// It needs what is stored under this word.
    NeedsStored(String),
    /// It needs an empty file.
    NeedsFile,
    /// It is done: what is told of each file, in the order in which they were asked for.
    Done {
        /// The files.
        outputs: Vec<Output>,
        /// What is proven of them.
        certificate: Box<Certificate>,
    },
    /// The answer to a question, or what was found in a mesh file.
    Answer(String),
    /// There is no result.
    Failed(Box<Problem>),
}

/// [`Limits`] as they travel.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Most {
    seconds: f64,
    memory_bytes: u64,
    cells: u64,
    triangles: u64,
    depth: u32,
    output_bytes: u64,
}

impl From<Limits> for Most {
    fn from(limits: Limits) -> Self {
        let Limits { seconds, memory_bytes, cells, triangles, depth, output_bytes } = limits;
        Self { seconds, memory_bytes, cells, triangles, depth, output_bytes }
    }
}

impl From<Most> for Limits {
    fn from(most: Most) -> Self {
        let Most { seconds, memory_bytes, cells, triangles, depth, output_bytes } = most;
        Self { seconds, memory_bytes, cells, triangles, depth, output_bytes }
    }
}

/// Sends a message, and the bytes that it announces.
pub(super) fn send(stream: &mut impl Write, message: &impl Serialize, bytes: &[u8]) -> io::Result<()> {
    let mut line = serde_json::to_vec(message)?;
    line.push(b'\n');
    stream.write_all(&line)?;
    stream.write_all(bytes)?;
    stream.flush()
}

/// The next message; none when the other side has closed.
pub(super) fn receive<M: DeserializeOwned>(stream: &mut impl BufRead) -> io::Result<Option<M>> {
    let mut line = Vec::new();
    if stream.read_until(b'\n', &mut line)? == 0 {
        return Ok(None);
    }
    Ok(Some(serde_json::from_slice(&line)?))
}

/// Bytes that a message has announced.
pub(super) fn announced(stream: &mut impl Read, bytes: u64) -> io::Result<Vec<u8>> {
    let mut found = Vec::new();
    if stream.take(bytes).read_to_end(&mut found)? as u64 == bytes { Ok(found) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
}
