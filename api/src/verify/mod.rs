//! Cases with known answers: finds them below a folder, does them, compares, reports.
//!
//! The rules are those of `fixtures/README.md`. Verifying never changes a case; [`bless`] is the one that does.

mod blessing;
mod classes;
mod compare;
pub mod difference;
mod manifest;
mod performer;
mod report;
mod solve;
mod stating;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use lacuna_fabrication::{Certificate, Input, Job, JobKind, Params};
use lacuna_kernel::attractor::Address;
use lacuna_kernel::budget::Limits;

use crate::documents;
use crate::problem::{Problem, ProblemKind};
use blessing::Blessing;
use difference::Difference;
use manifest::{CaseKind, Manifest, Refused};
pub use performer::{Here, Made, Performer, Solution};
pub use report::{CaseReport, Report, Row, Standing};
pub use stating::Wanted;

/// Deepest folder in which cases are looked for.
const DEEPEST: usize = 16;

/// Does every case below a folder whose path contains `filter`.
///
/// # Errors
/// When the folder cannot be read or holds no case. A case that fails is no error of this function.
pub fn verify(folder: &Path, filter: Option<&str>, performer: &dyn Performer) -> Result<Report, Problem> {
    let folders = cases(folder, filter)?;
    let cases = folders.iter().map(|case| verify_case(case, &name_of(case, folder), performer)).collect();
    Ok(Report { cases })
}

/// What became of a case that was to be blessed.
#[derive(Debug, serde::Serialize)]
pub struct Blessed {
    /// Its folder.
    pub case: String,
    /// Why it was not, if it was not; nothing was written then.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
    /// How the certificate differs from the one that was blessed before; absent if there was none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub differences: Option<Vec<Difference>>,
    /// The tables that were written into `expected.toml`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stated: Vec<&'static str>,
}

/// Does every case below a folder whose path contains `filter`, and writes the certificates of those that hold what they state
/// from sources of their own beside them, with the reason, the time and the version; into `expected.toml` only the tables that are wanted.
///
/// # Errors
/// When the reason is empty, the folder cannot be read or holds no case, or a file cannot be written.
pub fn bless(
    folder: &Path,
    filter: Option<&str>,
    reason: &str,
    wanted: &Wanted,
    performer: &dyn Performer,
) -> Result<Vec<Blessed>, Problem> {
    if reason.trim().is_empty() {
        return Err(Problem::new(ProblemKind::Usage, "--reason is empty: whoever reads the case later must learn why its result is right"));
    }
    cases(folder, filter)?.iter().map(|case| bless_case(case, name_of(case, folder), reason.trim(), wanted, performer)).collect()
}

fn bless_case(folder: &Path, case: String, reason: &str, wanted: &Wanted, performer: &dyn Performer) -> Result<Blessed, Problem> {
    let refused = |why: String| Ok(Blessed { case: case.clone(), refused: Some(why), differences: None, stated: Vec::new() });
    let manifest = match Manifest::of(folder, true) {
        Ok(manifest) => manifest,
        Err(error) => return refused(format!("expected.toml: {error}")),
    };
    if manifest.refused.is_some() || manifest.kind == CaseKind::Solve {
        return refused(
            "only results with a certificate are blessed; a refusal and a solution are stated in full in expected.toml".to_owned(),
        );
    }
    let (rows, certificate) = rows_of(folder, &wanted.apart_from(&manifest), performer);
    if let Some(row) = rows.iter().find(|row| row.failed()) {
        return refused(format!(
            "{} is {}, and {} is expected: what a case states itself no blessing changes",
            row.field, row.got, row.expected
        ));
    }
    let Some(certificate) = certificate else { return refused("there is no certificate".to_owned()) };
    // One that cannot be read is replaced like one that is wrong.
    let before = Blessing::of(folder).ok().flatten();
    let blessing = Blessing::now(reason, certificate);
    let differences = before.map(|before| Ok::<_, Problem>(difference::differences(&before.value()?, &blessing.value()?))).transpose()?;
    let stated = wanted.tables();
    if !stated.is_empty() {
        let job = match job_in(folder, &manifest) {
            Ok((_, job)) => job,
            Err(row) => return refused(row.got),
        };
        if let Err(why) = wanted.write(folder, &manifest, &job, reason, performer)? {
            return refused(why);
        }
    }
    blessing.keep(folder)?;
    Ok(Blessed { case, refused: None, differences, stated })
}

/// The folders with cases below a folder.
fn cases(folder: &Path, filter: Option<&str>) -> Result<Vec<PathBuf>, Problem> {
    let mut folders = Vec::new();
    find(folder, DEEPEST, &mut folders).map_err(|error| Problem::io(folder.display(), &error))?;
    folders.retain(|case| filter.is_none_or(|text| case.to_string_lossy().contains(text)));
    folders.sort();
    if folders.is_empty() {
        let detail = format!("{} holds no case (no expected.toml)", folder.display());
        return Err(Problem::new(ProblemKind::Usage, detail).code("verify.no-case"));
    }
    Ok(folders)
}

fn find(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let kind = entry.file_type()?;
        if kind.is_file() && entry.file_name() == "expected.toml" {
            found.push(folder.to_owned());
        } else if kind.is_dir() && depth > 0 {
            // Links are not followed, so a loop of them cannot trap the search.
            find(&entry.path(), depth - 1, found)?;
        }
    }
    Ok(())
}

fn name_of(case: &Path, folder: &Path) -> String {
    let name = case.strip_prefix(folder).unwrap_or(case);
    if name.as_os_str().is_empty() { folder.display().to_string() } else { name.display().to_string() }
}

fn verify_case(folder: &Path, name: &str, performer: &dyn Performer) -> CaseReport {
    let start = Instant::now();
    let blessing = Blessing::of(folder);
    let (about, rows) = match Manifest::of(folder, matches!(blessing, Ok(Some(_)))) {
        Ok(manifest) => {
            let (mut rows, certificate) = rows_of(folder, &manifest, performer);
            rows.extend(blessing_rows(blessing, certificate));
            (manifest.about, rows)
        }
        Err(error) => (String::new(), vec![Row::failure("expected.toml", "a legal case", &error)]),
    };
    CaseReport::new(name.to_owned(), about, rows, start.elapsed())
}

/// The comparisons with what was blessed.
fn blessing_rows(blessing: Result<Option<Blessing>, String>, certificate: Option<Certificate>) -> Vec<Row> {
    let blessing = match blessing {
        Ok(Some(blessing)) => blessing,
        Ok(None) => return Vec::new(),
        Err(error) => return vec![Row::failure(blessing::FILE, "what `lacuna bless` has written", &error)],
    };
    // Without one the failure is told already.
    let Some(certificate) = certificate else { return Vec::new() };
    match (blessing.value(), serde_json::to_value(&certificate)) {
        (Ok(blessed), Ok(got)) => difference::rows(&blessed, &got),
        _ => vec![Row::failure(blessing::FILE, "a certificate", "one that is not fit for JSON")],
    }
}

/// The comparisons of a case with what it states itself, and its certificate if it has one.
fn rows_of(folder: &Path, manifest: &Manifest, performer: &dyn Performer) -> (Vec<Row>, Option<Certificate>) {
    let (document, job) = match document_of(folder, manifest) {
        Ok(document) if manifest.kind == CaseKind::Solve => return (solve::rows(&document, manifest, performer), None),
        Ok(document) => {
            let job = read_job(folder, &document, manifest);
            (document, job)
        }
        Err(row) => return (vec![row], None),
    };
    let mut of_classes = Vec::new();
    let result = job.and_then(|job| done(folder, &job, manifest, performer, &mut of_classes));
    match (&manifest.refused, result) {
        (Some(refused), result) => (vec![compare_refusal(refused, result.map(drop))], None),
        (None, Ok(certificate)) => match serde_json::to_value(&certificate) {
            Ok(got) => {
                let mut rows = compare::rows(manifest, &got);
                rows.extend(point_rows(folder, &document, manifest, performer));
                rows.append(&mut of_classes);
                (rows, Some(certificate))
            }
            Err(error) => (vec![Row::failure("result", "JSON", &error.to_string())], None),
        },
        (None, Err(problem)) => (vec![Row::failure("result", "a certificate", &told(&problem))], None),
    }
}

/// The document of a case: its model, or its whole job.
fn document_of(folder: &Path, manifest: &Manifest) -> Result<Vec<u8>, Row> {
    let name = if manifest.kind == CaseKind::Job { "job.json" } else { "model.json" };
    fs::read(folder.join(name)).map_err(|error| Row::failure(name, "a readable file", &error.to_string()))
}

/// The job of a case that is no `solve`.
fn read_job(folder: &Path, document: &[u8], manifest: &Manifest) -> Result<Job, Problem> {
    match manifest.kind.job() {
        Some(kind) => job_of(folder, document, kind, manifest),
        None => documents::read_job_in(document, &Limits::default(), Some(folder)),
    }
}

/// Both.
fn job_in(folder: &Path, manifest: &Manifest) -> Result<(Vec<u8>, Job), Row> {
    let document = document_of(folder, manifest)?;
    let job = read_job(folder, &document, manifest).map_err(|problem| Row::failure("job", "a job", &told(&problem)))?;
    Ok((document, job))
}

/// The case as a job, as any door would make it.
fn job_of(folder: &Path, document: &[u8], kind: JobKind, manifest: &Manifest) -> Result<Job, Problem> {
    let model = documents::read_model_in(document, Some(folder))?;
    let name = model.name.clone().unwrap_or_else(|| "shape".to_owned());
    Ok(Job {
        kind,
        inputs: vec![Input { name, model, radius_mm: None }],
        params: Params {
            radius_mm: manifest.radius_mm,
            stability: manifest.stability,
            ..Params::new(manifest.tolerance_mm.unwrap_or(f64::NAN))
        },
        outputs: Vec::new(),
        limits: Limits::default(),
    })
}

/// Does a job. Its certificate is that of the work alone, whatever files are made besides; those are looked at where the case has something to say of them.
fn done(folder: &Path, job: &Job, manifest: &Manifest, performer: &dyn Performer, rows: &mut Vec<Row>) -> Result<Certificate, Problem> {
    let classes = manifest.classes();
    let certificate = if classes.is_empty() {
        performer.certificate(job)?
    } else {
        let made = performer.made(&classes.with_outputs(job))?;
        rows.extend(classes.rows(folder, &made, performer));
        made.certificate
    };
    Ok(Certificate { input_digest: documents::job_digest(job).to_string(), output_digests: Default::default(), ..certificate })
}

/// The comparisons of `[point.*]`.
fn point_rows(folder: &Path, document: &[u8], manifest: &Manifest, performer: &dyn Performer) -> Vec<Row> {
    if manifest.point.is_empty() {
        return Vec::new();
    }
    let model = match documents::read_model_in(document, Some(folder)) {
        Ok(model) => model,
        Err(problem) => return vec![Row::failure("points", "a model", &told(&problem))],
    };
    let name = |address: &String| format!("point {address}");
    let parsed: Result<Vec<Address>, String> = manifest.point.keys().map(|text| text.parse().map_err(|_| text.clone())).collect();
    let addresses = match parsed {
        Ok(addresses) => addresses,
        Err(text) => return vec![Row::failure(&name(&text), "an address", &text)],
    };
    match performer.points(&model, &addresses) {
        Ok(found) => {
            manifest.point.iter().zip(&found).map(|((text, expected), got)| compare::point_row(&name(text), expected, got)).collect()
        }
        Err(problem) => vec![Row::failure("points", "points at all addresses", &told(&problem))],
    }
}

fn compare_refusal(refused: &Refused, result: Result<(), Problem>) -> Row {
    let expected = match &refused.pointer {
        Some(pointer) => format!("{} at {pointer:?}", refused.code),
        None => refused.code.clone(),
    };
    match result {
        Ok(()) => Row::failure("refused", &expected, "a result"),
        Err(problem) => {
            let by_finding = problem
                .errors
                .iter()
                .any(|finding| finding.code == refused.code && refused.pointer.as_ref().is_none_or(|pointer| *pointer == finding.pointer));
            let passed = by_finding || refused.pointer.is_none() && problem.code == refused.code;
            Row::verdict("refused", &expected, &told(&problem), passed)
        }
    }
}

fn told(problem: &Problem) -> String {
    let findings: Vec<String> = problem.errors.iter().take(3).map(|f| format!("{} at {:?}", f.code, f.pointer)).collect();
    if findings.is_empty() { problem.to_string() } else { findings.join(", ") }
}
