//! Documents: JSON in, models and jobs out, with every fault at once.
//!
//! A document is read in three steps. Its bytes become text within the limits; the text becomes a tree
//! that keeps order, repeated names and places (`parse`); the tree becomes a typed model or
//! job (`model`, `job`), and whatever is wrong on the way is noted with its JSON pointer instead of ending
//! the reading. After that nothing about the document needs to be looked at again, except what only the
//! mathematics can tell: the kernel's business.

mod address;
mod batch;
mod bcifs;
mod constraint;
mod curve;
mod grammar;
mod ifs;
mod job;
mod join;
mod mesh;
mod model;
mod node;
mod parse;
mod report;
mod schema;
mod scheme;
mod solve;
mod subdivision;
mod terrain;
mod transform;
mod trim;
mod units;
mod walk;
pub mod with;
mod write;

#[cfg(test)]
mod tests;

pub use address::{AddressQuestion, CELLS_LISTED, MOST_CELLS_LISTED, Sought};
pub use batch::BatchEntry;
pub use grammar::MOST_JOBS;
pub use job::{InputDocument, JobDocument, ModelSource, RequestedLimits};
pub use schema::{job_schema, model_schema, schemas};
pub use solve::SolveDocument;
pub use write::{model_value, write_job, write_job_to, write_model, write_model_indented, write_order};

use lacuna_kernel::model::Model;

use crate::diagnostic::{Diagnostic, code};
use crate::format::MeshFile;
use node::Place;
use report::{Report, single};
use walk::{Walker, root};

/// How large a document may be. The bytes bound time and memory; the rest bounds what is built of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DocumentLimits {
    /// Bytes of the document; a larger one is refused before any of it is read.
    pub bytes: usize,
    /// Nesting of arrays and objects; never above 256, whatever is set here.
    pub nesting: usize,
    /// JSON values, numbers in arrays of numbers not counted: memory is about 60 bytes for each.
    pub values: usize,
    /// States of a model.
    pub states: usize,
    /// Transitions of a model, the maps and the graph of an `ifs` included.
    pub transitions: usize,
    /// Faults that are listed; the others are counted.
    pub diagnostics: usize,
}

impl Default for DocumentLimits {
    /// 8 MiB, 64 levels, 8 million values, 4096 states, 65536 transitions, 100 diagnostics.
    fn default() -> Self {
        Self { bytes: 8 << 20, nesting: 64, values: 8_000_000, states: 4096, transitions: 65_536, diagnostics: 100 }
    }
}

/// Gives the mesh in a file of the document's folder, or says why there is none.
///
/// The name is a path with `/` between its parts, none of them empty, `.` or `..`; links are the finder's business.
pub type MeshFinder<'a> = &'a dyn Fn(&str) -> Result<MeshFile, String>;

/// Reads a model document. Lengths come out in mm.
///
/// Linear in the document's length.
///
/// # Errors
/// Every fault that can be found without mathematics, in the order of the text, and at least one.
pub fn read_model(bytes: &[u8], limits: &DocumentLimits) -> Result<Model, Vec<Diagnostic>> {
    read(bytes, limits, None, |walker, place| model::model(walker, place, false))
}

/// Reads a model document that comes from a folder: meshes that it names as files are taken from `files`. For
/// [`read_model`] such names are faults ([`code::FILE_NOT_AVAILABLE`]).
///
/// # Errors
/// As [`read_model`].
pub fn read_model_beside(bytes: &[u8], limits: &DocumentLimits, files: MeshFinder<'_>) -> Result<Model, Vec<Diagnostic>> {
    read(bytes, limits, Some(files), |walker, place| model::model(walker, place, false))
}

/// Reads a job document; [`JobDocument::resolve`] makes a job of it.
///
/// # Errors
/// As [`read_model`], and what the kind of job needs or cannot have.
pub fn read_job(bytes: &[u8], limits: &DocumentLimits) -> Result<JobDocument, Vec<Diagnostic>> {
    read(bytes, limits, None, job::job)
}

/// Reads a job document that comes from a folder, as [`read_model_beside`] does a model.
///
/// # Errors
/// As [`read_job`].
pub fn read_job_beside(bytes: &[u8], limits: &DocumentLimits, files: MeshFinder<'_>) -> Result<JobDocument, Vec<Diagnostic>> {
    read(bytes, limits, Some(files), job::job)
}

/// Reads a batch of jobs; [`JobDocument::resolve`] makes a job of each, with places in the batch's document.
///
/// # Errors
/// As [`read_job`], for all of its jobs together.
pub fn read_batch(bytes: &[u8], limits: &DocumentLimits) -> Result<Vec<BatchEntry>, Vec<Diagnostic>> {
    read(bytes, limits, None, batch::batch)
}

/// Reads a batch that comes from a folder, as [`read_model_beside`] does a model.
///
/// # Errors
/// As [`read_batch`].
pub fn read_batch_beside(bytes: &[u8], limits: &DocumentLimits, files: MeshFinder<'_>) -> Result<Vec<BatchEntry>, Vec<Diagnostic>> {
    read(bytes, limits, Some(files), batch::batch)
}

/// Reads a request to solve a model.
///
/// # Errors
/// As [`read_model`].
pub fn read_solve(bytes: &[u8], limits: &DocumentLimits) -> Result<SolveDocument, Vec<Diagnostic>> {
    read(bytes, limits, None, solve::solve)
}

/// Reads a question about addresses.
///
/// # Errors
/// As [`read_model`], and an address that cannot be read.
pub fn read_address_question(bytes: &[u8], limits: &DocumentLimits) -> Result<AddressQuestion, Vec<Diagnostic>> {
    read(bytes, limits, None, address::question)
}

fn read<T>(
    bytes: &[u8],
    limits: &DocumentLimits,
    files: Option<MeshFinder<'_>>,
    take: impl FnOnce(&mut Walker<'_>, Place<'_>) -> Option<T>,
) -> Result<T, Vec<Diagnostic>> {
    let text = text(bytes, limits)?;
    let mut report = Report::new(limits.diagnostics);
    let Some(node) = parse::parse(text, limits, &mut report) else {
        return Err(report.into_diagnostics(text));
    };
    let mut walker = Walker { files, ..Walker::new(limits, report) };
    match take(&mut walker, root(&node)) {
        Some(value) if walker.report.is_clean() => Ok(value),
        _ => {
            assert!(!walker.report.is_clean(), "a document that is refused has a reason");
            Err(walker.report.into_diagnostics(text))
        }
    }
}

/// The document as text: not too large, UTF-8, without a byte order mark.
fn text<'b>(bytes: &'b [u8], limits: &DocumentLimits) -> Result<&'b str, Vec<Diagnostic>> {
    if bytes.len() > limits.bytes {
        let (found, allowed) = (bytes.len(), limits.bytes);
        return Err(single(&[], code::TOO_LARGE, format!("the document has {found} bytes; {allowed} are allowed")));
    }
    let marks: [(&[u8], &str); 3] = [(b"\xEF\xBB\xBF", "UTF-8"), (b"\xFF\xFE", "UTF-16"), (b"\xFE\xFF", "UTF-16")];
    if let Some((_, encoding)) = marks.iter().find(|(mark, _)| bytes.starts_with(mark)) {
        let message = format!("the document starts with a byte order mark ({encoding}); save it as UTF-8 without one");
        return Err(single(&[], code::BYTE_ORDER_MARK, message));
    }
    std::str::from_utf8(bytes).map_err(|error| {
        let before = bytes.get(..error.valid_up_to()).unwrap_or_default();
        match error.error_len() {
            None => single(before, code::TRUNCATED, "the document ends in the middle of a character; was it sent completely?".into()),
            Some(_) => {
                single(before, code::NOT_UTF8, format!("byte {} does not belong to UTF-8 text; save the document as UTF-8", before.len()))
            }
        }
    })
}
