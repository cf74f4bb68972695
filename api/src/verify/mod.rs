//! Cases with known answers: finds them below a folder, does them, compares, reports.
//!
//! The rules are those of `fixtures/README.md`. Nothing here ever changes a case.

mod compare;
mod manifest;
mod report;
mod solve;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use lacuna_fabrication::{Input, Job, JobKind, Params};
use lacuna_kernel::attractor::Address;
use lacuna_kernel::budget::{Budget, CancelToken, Limits};

use crate::addresses;
use crate::jobs::watchdog::Watchdog;
use crate::problem::{Problem, ProblemKind};
use crate::{documents, production};
use manifest::{CaseKind, Manifest, Refused};
pub use report::{CaseReport, Report, Row};

/// Deepest folder in which cases are looked for.
const DEEPEST: usize = 16;
/// Time for the points of a case.
const POINTS_TIME: Duration = Duration::from_secs(60);

/// Does every case below a folder whose path contains `filter`.
///
/// # Errors
/// When the folder cannot be read or holds no case. A case that fails is no error of this function.
pub fn verify(folder: &Path, filter: Option<&str>) -> Result<Report, Problem> {
    let mut folders = Vec::new();
    find(folder, DEEPEST, &mut folders).map_err(|error| Problem::io(folder.display(), &error))?;
    folders.retain(|case| filter.is_none_or(|text| case.to_string_lossy().contains(text)));
    folders.sort();
    if folders.is_empty() {
        let detail = format!("{} holds no case (no expected.toml)", folder.display());
        return Err(Problem::new(ProblemKind::Usage, detail).code("verify.no-case"));
    }
    let cases = folders.iter().map(|case| verify_case(case, case.strip_prefix(folder).unwrap_or(case))).collect();
    Ok(Report { cases })
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

fn verify_case(folder: &Path, name: &Path) -> CaseReport {
    let start = Instant::now();
    let name = if name.as_os_str().is_empty() { folder } else { name };
    let (about, rows) = match read_manifest(folder) {
        Ok(manifest) => {
            let rows = rows_of(folder, &manifest);
            (manifest.about, rows)
        }
        Err(row) => (String::new(), vec![row]),
    };
    CaseReport::new(name.display().to_string(), about, rows, start.elapsed())
}

fn read_manifest(folder: &Path) -> Result<Manifest, Row> {
    let text = fs::read_to_string(folder.join("expected.toml"));
    let text = text.map_err(|error| Row::failure("expected.toml", "a readable file", &error.to_string()))?;
    Manifest::read(&text).map_err(|error| Row::failure("expected.toml", "a legal case", &error))
}

fn rows_of(folder: &Path, manifest: &Manifest) -> Vec<Row> {
    let name = if manifest.kind == CaseKind::Job { "job.json" } else { "model.json" };
    let document = match fs::read(folder.join(name)) {
        Ok(document) => document,
        Err(error) => return vec![Row::failure(name, "a readable file", &error.to_string())],
    };
    let result = match (manifest.kind, manifest.kind.job()) {
        (CaseKind::Job, _) => job_of(folder, &document).and_then(|job| done(&job)),
        (_, Some(kind)) => perform(folder, &document, kind, manifest),
        (_, None) => return solve::rows(&document, manifest),
    };
    match (&manifest.refused, result) {
        (Some(refused), result) => vec![compare_refusal(refused, result)],
        (None, Ok(certificate)) => {
            let mut rows = compare::rows(manifest, &certificate);
            rows.extend(point_rows(folder, &document, manifest));
            rows
        }
        (None, Err(problem)) => vec![Row::failure("result", "a certificate", &told(&problem))],
    }
}

/// The job of a case that states one in full.
fn job_of(folder: &Path, document: &[u8]) -> Result<Job, Problem> {
    documents::read_job_in(document, &Limits::default(), Some(folder))
}

/// Does the case as any door would, and gives its certificate as JSON.
fn perform(folder: &Path, document: &[u8], kind: JobKind, manifest: &Manifest) -> Result<serde_json::Value, Problem> {
    let model = documents::read_model_in(document, Some(folder))?;
    let name = model.name.clone().unwrap_or_else(|| "shape".to_owned());
    let job = Job {
        kind,
        inputs: vec![Input { name, model, radius_mm: None }],
        params: Params {
            radius_mm: manifest.radius_mm,
            stability: manifest.stability,
            ..Params::new(manifest.tolerance_mm.unwrap_or(f64::NAN))
        },
        outputs: Vec::new(),
        limits: Limits::default(),
    };
    done(&job)
}

/// Does a job, and gives its certificate as JSON.
fn done(job: &Job) -> Result<serde_json::Value, Problem> {
    let budget = Budget { limits: job.limits, cancel: CancelToken::new(), progress: None };
    let _watchdog = Watchdog::start(&budget.cancel, job.limits.seconds).map_err(|error| Problem::io("no thread", &error))?;
    let outcome = production::compute(job, &budget).map_err(|problem| production::why_stopped(&budget).unwrap_or(problem))?;
    serde_json::to_value(&outcome.certificate).map_err(|error| Problem::internal(error.to_string()))
}

/// The comparisons of `[point.*]`.
fn point_rows(folder: &Path, document: &[u8], manifest: &Manifest) -> Vec<Row> {
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
    match addresses::points(&model, &addresses, POINTS_TIME) {
        Ok(found) => {
            manifest.point.iter().zip(&found).map(|((text, expected), got)| compare::point_row(&name(text), expected, got)).collect()
        }
        Err(problem) => vec![Row::failure("points", "points at all addresses", &told(&problem))],
    }
}

fn compare_refusal(refused: &Refused, result: Result<serde_json::Value, Problem>) -> Row {
    let expected = match &refused.pointer {
        Some(pointer) => format!("{} at {pointer:?}", refused.code),
        None => refused.code.clone(),
    };
    match result {
        Ok(_) => Row::failure("refused", &expected, "a result"),
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
