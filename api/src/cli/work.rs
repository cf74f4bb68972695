//! Commands that compute: one job each, as the service does them.

use std::path::Path;

use lacuna_fabrication::{Input, Job, JobKind, Outcome, Params};
use lacuna_kernel::budget::{Budget, CancelToken, Limits};

use super::args::{EvaluateArgs, LimitArgs, MeasureArgs, OutputArgs, ProgressMode, RunArgs, SolidifyArgs};
use super::output::{Target, Written, deliver, deliver_streamed, target};
use super::progress::Reporter;
use super::{DOCUMENT_BYTES, folder_of, print_json, read_input, stop};
use crate::jobs::watchdog::Watchdog;
use crate::problem::{Problem, ProblemKind};
use crate::{documents, files, production};

/// How a command behaves towards its user.
#[derive(Clone, Copy, Debug)]
pub(super) struct Manner {
    pub(super) progress: ProgressMode,
    pub(super) quiet: bool,
}

/// `lacuna solidify`.
pub(super) fn solidify(args: &SolidifyArgs, manner: Manner) -> Result<(), Problem> {
    let params = Params { tolerance_mm: args.tolerance, radius_mm: Some(args.radius), normals: false, stability: args.stability };
    make(JobKind::Solidify, &args.model, params, &args.output, &args.limits, manner)
}

/// `lacuna evaluate`.
pub(super) fn evaluate(args: &EvaluateArgs, manner: Manner) -> Result<(), Problem> {
    let params = Params { tolerance_mm: args.tolerance, radius_mm: None, normals: args.normals, stability: false };
    make(JobKind::Evaluate, &args.model, params, &args.output, &args.limits, manner)
}

/// `lacuna measure`.
pub(super) fn measure(args: &MeasureArgs, manner: Manner) -> Result<(), Problem> {
    let params = Params { tolerance_mm: args.tolerance, radius_mm: args.radius, normals: false, stability: false };
    let job = job_of(JobKind::Measure, &args.model, params, &[], &args.limits)?;
    let (outcome, _) = perform(&job, &args.limits, manner, |_, _| Ok(Vec::new()))?;
    print_json(&outcome.certificate)
}

/// `lacuna run`.
pub(super) fn run(args: &RunArgs, manner: Manner) -> Result<(), Problem> {
    let bytes = read_input(&args.job, DOCUMENT_BYTES)?;
    // Whoever sits at the machine may ask for as much of it as there is.
    let most = Limits { seconds: f64::MAX, memory_bytes: u64::MAX, cells: u64::MAX, triangles: u64::MAX, depth: u32::MAX };
    let mut job = documents::read_job_in(&bytes, &most, folder_of(&args.job))?;
    job.limits = limits(job.limits, &args.limits);
    std::fs::create_dir_all(&args.folder).map_err(|error| Problem::io(args.folder.display(), &error))?;
    let title = job.inputs.first().map(|input| input.name.clone());
    let stem = files::safe_stem(title.as_deref().unwrap_or("result"));
    let targets: Result<Vec<Target>, Problem> =
        job.outputs.iter().map(|name| target(&args.folder.join(format!("{stem}.{name}")), Some(name))).collect();
    let (targets, certificate) = (targets?, args.folder.join("certificate.json"));
    let done =
        perform(&job, &args.limits, manner, |outcome, budget| deliver(outcome, title.as_deref(), &targets, Some(&certificate), budget));
    let (outcome, written) = done.map_err(|problem| problem.under("/model"))?;
    print_json(&serde_json::json!({ "outputs": written, "certificate": outcome.certificate }))
}

fn make(kind: JobKind, model: &Path, params: Params, output: &OutputArgs, limit_args: &LimitArgs, manner: Manner) -> Result<(), Problem> {
    let mut targets: Vec<Target> = output
        .outputs
        .iter()
        .map(|path| target(path, output.format.as_deref().filter(|_| path == Path::new("-"))))
        .collect::<Result<_, _>>()?;
    check_distinct(&targets, output)?;
    let names: Vec<&str> = targets.iter().filter_map(|target| target.name).collect();
    let job = job_of(kind, model, params, &names, limit_args)?;
    if let Some(path) = &output.preview {
        targets.push(Target { name: None, ..target(path, Some("png"))? });
    }
    let title = job.inputs.first().map(|input| input.name.clone());
    let certificate = output.certificate.as_deref();
    let (outcome, written) = watched(&job, limit_args, manner, |budget| {
        // Points need not be held to be written.
        if let Some(done) = deliver_streamed(&job, title.as_deref(), &targets, certificate, budget)? {
            return Ok(done);
        }
        computed(&job, budget, |outcome, budget| deliver(outcome, title.as_deref(), &targets, certificate, budget))
    })?;
    if !manner.quiet {
        summarize(&outcome, &written);
    }
    Ok(())
}

/// Two files in one place would leave one of them.
fn check_distinct(targets: &[Target], output: &OutputArgs) -> Result<(), Problem> {
    let others = output.certificate.iter().chain(&output.preview);
    let mut paths: Vec<&Path> = targets.iter().map(|target| target.path.as_path()).chain(others.map(|path| path.as_path())).collect();
    paths.sort();
    match paths.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(Problem::new(ProblemKind::Usage, format!("{} is named for two outputs", pair[0].display()))),
        None => Ok(()),
    }
}

fn job_of(kind: JobKind, model: &Path, params: Params, outputs: &[&str], limit_args: &LimitArgs) -> Result<Job, Problem> {
    let model = documents::read_model_in(&read_input(model, DOCUMENT_BYTES)?, folder_of(model))?;
    let name = model.name.clone().unwrap_or_else(|| "shape".to_owned());
    let mut names: Vec<String> = Vec::new();
    for output in outputs {
        if !names.iter().any(|name| name == output) {
            names.push((*output).to_owned());
        }
    }
    Ok(Job { kind, inputs: vec![Input { name, model }], params, outputs: names, limits: limits(Limits::default(), limit_args) })
}

fn limits(asked: Limits, args: &LimitArgs) -> Limits {
    Limits {
        seconds: args.limit_seconds.unwrap_or(asked.seconds),
        memory_bytes: args.limit_memory.unwrap_or(asked.memory_bytes),
        triangles: args.limit_triangles.unwrap_or(asked.triangles),
        ..asked
    }
}

/// Computes and delivers under the eyes of the clock and of the user.
fn perform(
    job: &Job,
    limit_args: &LimitArgs,
    manner: Manner,
    deliver: impl FnOnce(&mut Outcome, &Budget) -> Result<Vec<Written>, Problem>,
) -> Result<(Outcome, Vec<Written>), Problem> {
    watched(job, limit_args, manner, |budget| computed(job, budget, deliver))
}

fn computed(
    job: &Job,
    budget: &Budget,
    deliver: impl FnOnce(&mut Outcome, &Budget) -> Result<Vec<Written>, Problem>,
) -> Result<(Outcome, Vec<Written>), Problem> {
    let mut outcome = production::compute(job, budget)?;
    outcome.certificate.input_digest = documents::job_digest(job).to_string();
    let written = deliver(&mut outcome, budget)?;
    Ok((outcome, written))
}

/// Works under the eyes of the clock and of the user.
fn watched<T>(job: &Job, limit_args: &LimitArgs, manner: Manner, work: impl FnOnce(&Budget) -> Result<T, Problem>) -> Result<T, Problem> {
    use_threads(limit_args.threads)?;
    let reporter = Reporter::new(manner.progress, manner.quiet);
    let budget = Budget { limits: job.limits, cancel: CancelToken::new(), progress: reporter.sink() };
    stop::on_signals(&budget.cancel)?;
    let _watchdog =
        Watchdog::start(&budget.cancel, job.limits.seconds).map_err(|error| Problem::io("no thread to watch the time", &error))?;
    work(&budget).map_err(|problem| production::why_stopped(&budget).unwrap_or(problem))
}

/// Sets the number of threads of this process's computations.
pub(super) fn use_threads(threads: Option<usize>) -> Result<(), Problem> {
    let Some(threads) = threads.filter(|&threads| threads > 0) else { return Ok(()) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    pool.map_err(|error| Problem::internal(format!("no pool of {threads} threads: {error}")))
}

fn summarize(outcome: &Outcome, written: &[Written]) {
    use std::io::Write;
    let certificate = &outcome.certificate;
    let mut stderr = std::io::stderr().lock();
    for file in written {
        let _ = writeln!(stderr, "{}: {} bytes", file.file.display(), file.bytes);
    }
    let _ = writeln!(
        stderr,
        "{} triangles, {} vertices, within {} mm (asked {} mm)",
        certificate.triangles, certificate.vertices, certificate.achieved_bound_mm, certificate.requested_tolerance_mm
    );
    for warning in &certificate.warnings {
        let _ = writeln!(stderr, "warning: {warning}");
    }
}
