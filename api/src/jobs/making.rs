//! From a job's document to files that are written and verified, in whatever process that is done.

use std::io::{self, Write as _};

use lacuna_exchange::format::Format;
use lacuna_fabrication::{Certificate, Geometry, Job, Outcome};
use lacuna_kernel::budget::{Budget, Limits};

use super::record::Output;
use crate::digest::Digest;
use crate::documents::{self, Stored};
use crate::files::{Allowance, PendingFile};
use crate::problem::Problem;
use crate::production::{self, Compute, Label};

/// Name of the certificate among a job's outputs.
const CERTIFICATE: &str = "certificate.json";

/// What whoever does a job works with.
pub(super) trait Workshop {
    /// A mesh file that the job names.
    fn stored(&self, reference: &str) -> Option<Stored>;
    /// The limits are known: from now on they hold.
    fn begin(&self, limits: Limits) -> Result<Budget, Problem>;
    /// An empty file.
    fn new_file(&self) -> io::Result<PendingFile>;
}

/// A job as a worker gets it.
pub(super) struct Task {
    /// Its document.
    pub(super) document: Vec<u8>,
    /// The most that it may ask for.
    pub(super) most: Limits,
    /// The digest of what was meant, for the certificate.
    pub(super) input_digest: String,
}

/// The files of a job that has been done, not kept yet.
pub(super) struct Files {
    /// Each with what is told of it.
    pub(super) files: Vec<(PendingFile, Output)>,
    /// What is proven of them.
    pub(super) certificate: Certificate,
}

/// Does a job, up to files that are written and verified.
pub(super) fn make(task: &Task, compute: Compute, workshop: &impl Workshop) -> Result<Files, Problem> {
    let order = documents::read_order(&task.document, &task.most, &|reference| workshop.stored(reference))?.job;
    let budget = workshop.begin(order.limits)?;
    let made = compute(&order, &budget).map_err(Problem::under_model).and_then(|mut outcome| {
        outcome.certificate.input_digest.clone_from(&task.input_digest);
        write_files(&order, outcome, &budget, workshop)
    });
    made.map_err(|problem| production::why_stopped(&budget).unwrap_or(problem))
}

/// Writes and verifies every output, the certificate last because it names the others' digests.
fn write_files(order: &Job, mut outcome: Outcome, budget: &Budget, workshop: &impl Workshop) -> Result<Files, Problem> {
    let title = order.inputs.first().map(|input| input.name.as_str());
    let stem = documents::file_stem(order);
    let formats: Vec<Format> = order.outputs.iter().map(|name| documents::format(name)).collect::<Result<_, _>>()?;
    let thumbnail = match (&outcome.geometry, formats.contains(&Format::ThreeMf)) {
        (Geometry::Solid(_) | Geometry::Parts(_), true) => Some(production::picture(&outcome)?),
        _ => None,
    };
    let mut files = Vec::with_capacity(formats.len() + 1);
    let allowance = Allowance::new(budget.limits.output_bytes);
    let failed = |error| Problem::io("the result could not be written", &error);
    for (done, &format) in formats.iter().enumerate() {
        if let Some(stopped) = production::why_stopped(budget) {
            return Err(stopped);
        }
        #[expect(clippy::cast_precision_loss, reason = "a share of a handful of files")]
        budget.report("write", done as f64 / formats.len() as f64, outcome.certificate.triangles);
        let facts = format.facts();
        let mut pending = workshop.new_file().map_err(failed)?;
        let label = Label { title, thumbnail_png: thumbnail.as_deref() };
        let (digest, bytes) = production::write_file(format, &outcome, &label, &mut pending, &allowance, &budget.cancel)?;
        let file_name = format!("{stem}.{}", facts.ending);
        let output = Output { name: facts.ending.to_owned(), file_name, media_type: facts.media_type.to_owned(), bytes, digest };
        files.push((pending, output));
    }
    // Only now: a file holds what was known before any was written, whatever is written beside it.
    for (_, output) in &files {
        outcome.certificate.output_digests.insert(output.name.clone(), output.digest.to_string());
    }
    let bytes = production::certificate_file(&outcome.certificate)?;
    let mut pending = workshop.new_file().map_err(failed)?;
    pending.write_all(&bytes).map_err(failed)?;
    let output = Output {
        name: CERTIFICATE.to_owned(),
        file_name: CERTIFICATE.to_owned(),
        media_type: "application/json".to_owned(),
        bytes: bytes.len() as u64,
        digest: Digest::of(&bytes),
    };
    files.push((pending, output));
    Ok(Files { files, certificate: outcome.certificate })
}
