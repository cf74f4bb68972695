//! The files of a command: all of them are written and verified before the first one takes its place.

use std::io;
use std::path::{Path, PathBuf};

use lacuna_exchange::format::Format;
use lacuna_fabrication::{Geometry, Job, JobKind, Outcome};
use lacuna_kernel::budget::Budget;

use crate::digest::Digest;
use crate::documents;
use crate::files::{Allowance, PendingFile};
use crate::problem::{Problem, ProblemKind};
use crate::production::{self, Label};

/// A file to write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Target {
    /// Where; `-` is stdout.
    pub(super) path: PathBuf,
    /// As what.
    pub(super) format: Format,
    /// Under which name the certificate states its digest; a picture beside the result has none.
    pub(super) name: Option<&'static str>,
}

/// A file that was written.
#[derive(Clone, Debug, serde::Serialize)]
pub(super) struct Written {
    pub(super) file: PathBuf,
    pub(super) bytes: u64,
    pub(super) digest: Digest,
}

/// The format of a file by its ending, or the one named for stdout.
pub(super) fn target(path: &Path, format: Option<&str>) -> Result<Target, Problem> {
    let usage = |detail: String| Problem::new(ProblemKind::Usage, detail);
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    let name = match (format, &ending) {
        (Some(format), _) => format.to_ascii_lowercase(),
        (None, Some(ending)) => ending.clone(),
        (None, None) if path == Path::new("-") => return Err(usage("say with --format what to write to stdout".into())),
        (None, None) => return Err(usage(format!("{} has no ending; the format follows the ending", path.display()))),
    };
    let format = documents::format(&name).map_err(|problem| usage(format!("{}: {}", path.display(), problem.detail)))?;
    Ok(Target { path: path.to_owned(), format, name: Some(format.facts().ending) })
}

/// The files that are named, each in the format of its ending, and stdout in the one that is named for it.
pub(super) fn targets(paths: &[PathBuf], format: Option<&str>) -> Result<Vec<Target>, Problem> {
    let is_stdout = |path: &Path| path == Path::new("-");
    if format.is_some() && !paths.iter().any(|path| is_stdout(path)) {
        let detail = "--format is for stdout; the format of a file follows the ending of its name";
        return Err(Problem::new(ProblemKind::Usage, detail.to_owned()));
    }
    paths.iter().map(|path| target(path, format.filter(|_| is_stdout(path)))).collect()
}

/// Two files in one place would leave one of them.
pub(super) fn check_distinct<'a>(paths: impl Iterator<Item = &'a Path>) -> Result<(), Problem> {
    let mut paths: Vec<&Path> = paths.collect();
    paths.sort();
    match paths.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(Problem::new(ProblemKind::Usage, format!("{} is named for two outputs", pair[0].display()))),
        None => Ok(()),
    }
}

/// Writes all files, completes the certificate with their digests, and puts everything in place.
pub(super) fn deliver(
    outcome: &mut Outcome,
    title: Option<&str>,
    targets: &[Target],
    certificate: Option<&Path>,
    budget: &Budget,
) -> Result<Vec<Written>, Problem> {
    let thumbnail = match &outcome.geometry {
        Geometry::Solid(_) | Geometry::Parts(_) if targets.iter().any(|target| target.format == Format::ThreeMf) => {
            Some(production::picture(outcome)?)
        }
        _ => None,
    };
    let allowance = Allowance::new(budget.limits.output_bytes);
    let mut pending = Vec::with_capacity(targets.len() + 1);
    let mut written = Vec::with_capacity(targets.len() + 1);
    for target in targets {
        check_stop(budget)?;
        budget.report("write", 0.0, outcome.certificate.triangles);
        let mut file = start(&target.path)?;
        let label = Label { title, thumbnail_png: thumbnail.as_deref() };
        let (digest, bytes) = production::write_file(target.format, outcome, &label, &mut file, &allowance, &budget.cancel)?;
        pending.push((file, target.path.clone()));
        written.push(Written { file: target.path.clone(), bytes, digest });
    }
    complete(outcome, targets, certificate, pending, written, budget)
}

/// Evaluates points straight into the one file that is wanted, if it is a PLY file and the shape is points.
pub(super) fn deliver_streamed(
    job: &Job,
    title: Option<&str>,
    targets: &[Target],
    certificate: Option<&Path>,
    budget: &Budget,
) -> Result<Option<(Outcome, Vec<Written>)>, Problem> {
    let [target] = targets else { return Ok(None) };
    if job.kind != JobKind::Evaluate || target.format != Format::Ply {
        return Ok(None);
    }
    let mut file = start(&target.path)?;
    let Some((mut outcome, digest, bytes)) = production::stream_file(job, title, &mut file, budget)? else { return Ok(None) };
    outcome.certificate.input_digest = documents::job_digest(job).to_string();
    let written = vec![Written { file: target.path.clone(), bytes, digest }];
    let written = complete(&mut outcome, targets, certificate, vec![(file, target.path.clone())], written, budget)?;
    Ok(Some((outcome, written)))
}

/// Completes the certificate with the digests, and puts everything in place.
fn complete(
    outcome: &mut Outcome,
    targets: &[Target],
    certificate: Option<&Path>,
    mut pending: Vec<(PendingFile, PathBuf)>,
    mut written: Vec<Written>,
    budget: &Budget,
) -> Result<Vec<Written>, Problem> {
    for (target, written) in targets.iter().zip(&written) {
        if let Some(name) = target.name {
            outcome.certificate.output_digests.insert(name.to_owned(), written.digest.to_string());
        }
    }
    if let Some(path) = certificate {
        let bytes = production::certificate_file(&outcome.certificate)?;
        let mut file = start(path)?;
        io::Write::write_all(&mut file, &bytes).map_err(|error| Problem::io(path.display(), &error))?;
        pending.push((file, path.to_owned()));
        written.push(Written { file: path.to_owned(), bytes: bytes.len() as u64, digest: Digest::of(&bytes) });
    }
    check_stop(budget)?;
    for (file, path) in pending {
        finish(file, &path)?;
    }
    budget.report("write", 1.0, outcome.certificate.triangles);
    Ok(written)
}

fn check_stop(budget: &Budget) -> Result<(), Problem> {
    production::why_stopped(budget).map_or(Ok(()), Err)
}

/// What goes to stdout is written to a file first: formats seek, and a pipe gets everything or nothing.
pub(super) fn start(path: &Path) -> Result<PendingFile, Problem> {
    let file = if path == Path::new("-") { PendingFile::create_in(&std::env::temp_dir()) } else { PendingFile::create_beside(path) };
    file.map_err(|error| Problem::io(path.display(), &error))
}

pub(super) fn finish(mut file: PendingFile, path: &Path) -> Result<(), Problem> {
    let failed = |error| Problem::io(path.display(), &error);
    if path != Path::new("-") {
        return file.commit(path).map_err(failed);
    }
    match io::copy(file.reread().map_err(failed)?, &mut io::stdout().lock()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(failed(error)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn formats_follow_endings() {
        assert_eq!(target(Path::new("a/b.STL"), None).unwrap().format, Format::Stl);
        assert_eq!(target(Path::new("-"), Some("3mf")).unwrap().format, Format::ThreeMf);
        for bad in ["-", "part", "part.dwg"] {
            assert_eq!(target(Path::new(bad), None).unwrap_err().kind.exit_code(), 2, "{bad}");
        }
    }
}
