//! Commands that say something about a document, a job or a set of cases.

use std::path::Path;
use std::time::Duration;

use lacuna_kernel::budget::Limits;

use super::args::VerifyArgs;
use super::{DOCUMENT_BYTES, print, print_json, read_input};
use crate::documents::{self, Remark, Severity, ValidationReport};
use crate::files;
use crate::problem::{Problem, ProblemKind};
use crate::production::Engine;
use crate::verify;

/// Longest time for a prediction on the command line, where nobody else waits for it.
const PLAN_TIME: Duration = Duration::from_secs(300);

/// `lacuna validate`.
pub(super) fn validate(model: &Path) -> Result<(), Problem> {
    let bytes = read_input(model, DOCUMENT_BYTES)?;
    let report = match documents::validate(&bytes) {
        // What is no JSON is an invalid model as well, to whoever reads the report.
        Err(problem) if problem.kind == ProblemKind::MalformedJson => unreadable(&problem),
        other => other?,
    };
    print_json(&report)?;
    if report.valid {
        return Ok(());
    }
    let errors = report.diagnostics.iter().filter(|remark| remark.severity == Severity::Error).count();
    Err(Problem::new(ProblemKind::InvalidModel, format!("{} is not a valid model: {errors} errors, listed on stdout", model.display())))
}

fn unreadable(problem: &Problem) -> ValidationReport {
    let diagnostics = problem.errors.iter().map(|finding| Remark {
        pointer: finding.pointer.clone(),
        code: finding.code.clone(),
        message: finding.message.clone(),
        severity: Severity::Error,
        line: finding.line,
        column: finding.column,
    });
    ValidationReport {
        valid: false,
        diagnostics: diagnostics.collect(),
        states: None,
        degrees_of_freedom: None,
        constraint_residual: None,
        spectral_radius: None,
    }
}

/// `lacuna plan`.
pub(super) fn plan(job: &Path) -> Result<(), Problem> {
    let bytes = read_input(job, DOCUMENT_BYTES)?;
    let most = Limits { seconds: f64::MAX, memory_bytes: u64::MAX, cells: u64::MAX, triangles: u64::MAX, depth: u32::MAX };
    let job = documents::read_job(&bytes, &most, &|_| None)?;
    print_json(&crate::routes::studies::predict(Engine::KERNEL, &job, PLAN_TIME)?)
}

/// `lacuna verify`.
pub(super) fn verify(args: &VerifyArgs, quiet: bool) -> Result<(), Problem> {
    let report = verify::verify(&args.folder, args.filter.as_deref())?;
    if let Some(path) = &args.junit {
        files::write_whole(path, report.junit().as_bytes()).map_err(|error| Problem::io(path.display(), &error))?;
    }
    if args.json {
        print_json(&report)?;
    } else {
        print(report.table(quiet).as_bytes())?;
    }
    let failed = report.cases.iter().filter(|case| !case.passed).count();
    if failed == 0 {
        Ok(())
    } else {
        Err(Problem::new(ProblemKind::CheckFailed, format!("{failed} of {} cases failed", report.cases.len())))
    }
}
