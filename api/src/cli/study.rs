//! Commands that say something about a document or a job.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::time::Duration;

use lacuna_exchange::document::{CELLS_LISTED, Sought};
use lacuna_fabrication::SolutionSpace;
use lacuna_kernel::budget::Limits;
use lacuna_kernel::model::Model;

use super::args::{AddressArgs, SolveArgs};
use super::remote::{self, Server, questions};
use super::{DOCUMENT_BYTES, folder_of, print, print_json, read_input, stop};
use crate::addresses;
use crate::documents::{self, Remark, Severity, SolveReport, ValidationReport};
use crate::files;
use crate::problem::{Problem, ProblemKind};
use crate::production::{self, Engine, SolveProblem};

/// Longest time for a prediction on the command line, where nobody else waits for it.
const PLAN_TIME: Duration = Duration::from_secs(300);

/// `lacuna validate`.
pub(super) fn validate(model: &Path, draw: Option<&Path>, server: Option<&Server>) -> Result<(), Problem> {
    let drawing = draw.map(Drawing::of).transpose()?;
    let bytes = read_input(model, DOCUMENT_BYTES)?;
    let examined = match server {
        Some(server) => {
            let document = remote::self_contained(bytes.clone(), |bytes| remote::whole_model(bytes, folder_of(model)));
            remote::validate(server, &document)
        }
        None => crate::questions::watched(PLAN_TIME, |budget| documents::validate_in(&bytes, folder_of(model), budget)),
    };
    let report = match examined {
        // What is no JSON is an invalid model as well, to whoever reads the report.
        Err(problem) if problem.kind == ProblemKind::MalformedJson => unreadable(&problem),
        other => other?,
    };
    print_json(&report)?;
    // Only a legal document has states to draw.
    let drawn = drawing.filter(|_| report.states.is_some());
    if let Some(drawing) = drawn {
        drawing.write(&bytes)?;
    }
    if report.valid {
        return Ok(());
    }
    let errors = report.diagnostics.iter().filter(|remark| remark.severity == Severity::Error).count();
    let count = if errors == 1 { "1 error, told".to_owned() } else { format!("{errors} errors, listed") };
    let left_out = if draw.is_some() && drawn.is_none() { "; nothing is drawn of a document that cannot be read" } else { "" };
    Err(Problem::new(ProblemKind::InvalidModel, format!("{} is not a valid model: {count} on stdout{left_out}", model.display())))
}

/// A drawing to be made.
#[derive(Clone, Copy)]
struct Drawing<'a> {
    path: &'a Path,
    dot: bool,
}

impl<'a> Drawing<'a> {
    fn of(path: &'a Path) -> Result<Self, Problem> {
        match path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("svg") => Ok(Self { path, dot: false }),
            Some("dot" | "gv") => Ok(Self { path, dot: true }),
            _ => Err(Problem::new(ProblemKind::Usage, format!("{} is to be drawn, and ends with neither .svg nor .dot", path.display()))),
        }
    }

    fn write(self, document: &[u8]) -> Result<(), Problem> {
        let diagram = documents::read_diagram(document)?;
        let text = if self.dot { diagram.dot() } else { diagram.svg() };
        files::write_whole(self.path, text.as_bytes()).map_err(|error| Problem::io(self.path.display(), &error))
    }
}

/// `lacuna address`.
pub(super) fn address(args: &AddressArgs, server: Option<&Server>) -> Result<(), Problem> {
    let model = documents::read_model_in(&read_input(&args.model, DOCUMENT_BYTES)?, folder_of(&args.model))?;
    let sought = match (&args.at, args.near) {
        (Some(address), _) => Sought::At(address.clone()),
        (None, Some(point_mm)) => Sought::Near {
            point_mm,
            within_mm: args.within,
            tolerance_mm: args.tolerance,
            most: args.most.and_then(|most| usize::try_from(most).ok()).unwrap_or(CELLS_LISTED),
        },
        (None, None) => return Err(Problem::new(ProblemKind::Usage, "say what to tell: --at ADDRESS or --near X,Y,Z")),
    };
    match server {
        Some(server) => print_json(&questions::address(server, &model, &sought)?),
        None => print_json(&addresses::answer(&model, &sought, PLAN_TIME)?),
    }
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

/// `lacuna solve`.
pub(super) fn solve(args: &SolveArgs, quiet: bool, server: Option<&Server>) -> Result<(), Problem> {
    let usage = |detail: String| Problem::new(ProblemKind::Usage, detail);
    let to_stdout = args.output.as_deref() == Some(Path::new("-"));
    if to_stdout && args.json {
        return Err(usage("--json prints the model too; name a file with -o, or leave one of them out".into()));
    }
    let mut values = BTreeMap::new();
    for (name, value) in &args.values {
        if values.insert(name.clone(), *value).is_some() {
            return Err(usage(format!("--set gives two values to {name:?}")));
        }
    }
    let model = documents::read_model_in(&read_input(&args.model, DOCUMENT_BYTES)?, folder_of(&args.model))?;
    let report = match server {
        Some(server) => questions::solve(server, &model, &values)?,
        None => solve_here(&model, &values, args.limit_seconds)?,
    };
    let text = documents::model_file(&report.model);
    if to_stdout {
        print(text.as_bytes())?;
    } else {
        if let Some(path) = &args.output {
            files::write_whole(path, text.as_bytes()).map_err(|error| Problem::io(path.display(), &error))?;
        }
        if args.json { print_json(&report)? } else { print_json(&report.space)? }
    }
    if to_stdout && !quiet {
        sum_up(&report.space);
    }
    Ok(())
}

fn solve_here(model: &Model, values: &BTreeMap<String, f64>, seconds: f64) -> Result<SolveReport, Problem> {
    let time = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
    let solved = crate::questions::watched(time, |budget| {
        stop::on_signals(&budget.cancel)?;
        production::solve(model, values, budget)
    });
    SolveReport::of(solved.map_err(|problem| match problem {
        SolveProblem::Model(problem) => problem,
        SolveProblem::Value { code, message, .. } => Problem::new(ProblemKind::Usage, message).code(code),
    })?)
}

/// The solutions in a line on stderr, when the model takes stdout.
fn sum_up(space: &SolutionSpace) {
    const LISTED: usize = 8;
    let listed: Vec<String> = space.parameters.iter().take(LISTED).map(|p| format!("{} = {}", p.name, p.value)).collect();
    let more = if space.parameters.len() > LISTED { ", ..." } else { "" };
    let parameters = if listed.is_empty() { String::new() } else { format!(": {}{more}", listed.join(", ")) };
    let mut stderr = std::io::stderr().lock();
    // With stderr gone there is nobody left to tell.
    let _ = writeln!(stderr, "{} degrees of freedom{parameters}; residual {:e}", space.degrees_of_freedom, space.residual);
}

/// `lacuna plan`.
pub(super) fn plan(job: &Path, server: Option<&Server>) -> Result<(), Problem> {
    let bytes = read_input(job, DOCUMENT_BYTES)?;
    if let Some(server) = server {
        let document = remote::self_contained(bytes, |bytes| super::work::whole_job(bytes, folder_of(job)));
        return print_json(&remote::plan(server, &document)?);
    }
    let most = Limits::MOST;
    let job = documents::read_job_in(&bytes, &most, folder_of(job))?;
    print_json(&crate::questions::predict(Engine::KERNEL, &job, PLAN_TIME)?)
}
