//! Commands that compute: one job each, as the service does them.

use std::path::{Path, PathBuf};

use lacuna_exchange::format::{self, Format, ReadLimits};
use lacuna_fabrication::{
    Certificate, CutPlane, Input, Job, JobKind, Operation, Outcome, Params, Plan, Planes, Split, SplitKey, WallOrder, WallSide,
};
use lacuna_kernel::budget::{Budget, CancelToken, Limits};
use lacuna_kernel::model::{Model, PolygonMesh, Shape};

use super::args::{
    ConvertArgs, EvaluateArgs, IntersectArgs, LimitArgs, MeasureArgs, OperationName, OutputArgs, ProgressMode, RunArgs, SideName,
    SliceArgs, SolidifyArgs,
};
use super::batch;
use super::convert::title;
use super::output::{Target, Written, check_distinct, deliver, deliver_streamed, finish, start, target, targets};
use super::progress::Reporter;
use super::remote::{self, Server};
use super::{DOCUMENT_BYTES, folder_of, print_json, read_input, stop};
use crate::digest::Digest;
use crate::documents::Order;
use crate::jobs::watchdog::Watchdog;
use crate::problem::{Problem, ProblemKind};
use crate::{documents, production};

/// How a command behaves towards its user, and who does its work.
#[derive(Clone, Copy, Debug)]
pub(super) struct Manner<'s> {
    pub(super) progress: ProgressMode,
    pub(super) quiet: bool,
    /// The service that does it; this process without one.
    pub(super) server: Option<&'s Server>,
}

/// An input, and the id under which a service has it if it was uploaded.
struct Given {
    input: Input,
    reference: Option<String>,
}

/// `lacuna solidify`.
pub(super) fn solidify(args: &SolidifyArgs, manner: Manner<'_>) -> Result<(), Problem> {
    let side = match args.side {
        SideName::Inward => WallSide::Inward,
        SideName::Outward => WallSide::Outward,
    };
    let params = Params {
        level: args.level,
        repair: args.repair,
        radius_mm: args.radius,
        closing_mm: args.closing,
        wall: args.wall.map(|thickness_mm| WallOrder { thickness_mm, side }),
        simplify: !args.no_simplify,
        stability: args.stability,
        ..Params::new(args.tolerance.unwrap_or(0.0))
    };
    make(JobKind::Solidify, vec![input_of(&args.model, manner)?], params, &args.output, &args.limits, manner)
}

/// `lacuna evaluate`.
pub(super) fn evaluate(args: &EvaluateArgs, manner: Manner<'_>) -> Result<(), Problem> {
    let params = Params { normals: args.normals, ..Params::new(args.tolerance) };
    make(JobKind::Evaluate, vec![input_of(&args.model, manner)?], params, &args.output, &args.limits, manner)
}

/// `lacuna measure`.
pub(super) fn measure(args: &MeasureArgs, manner: Manner<'_>) -> Result<(), Problem> {
    let params = Params {
        repair: args.repair,
        radius_mm: args.radius,
        direction: args.direction.map(Into::into),
        oriented_box: args.oriented_box,
        thickness: args.thickness,
        density_g_cm3: args.density,
        ..Params::new(args.tolerance)
    };
    let inputs = std::iter::once(&args.model).chain(&args.other).map(|path| input_of(path, manner)).collect::<Result<_, _>>()?;
    let map = args.map.as_deref().map(map_target).transpose()?;
    tell(JobKind::Measure, inputs, params, map.as_slice(), &args.limits, manner)
}

/// The file of a map of thickness: beside the certificate on stdout, and in the one format that has room for it.
fn map_target(path: &Path) -> Result<Target, Problem> {
    let usage = |detail: &str| Problem::new(ProblemKind::Usage, detail.to_owned());
    if path == Path::new("-") {
        return Err(usage("--map needs the name of a file: stdout carries the certificate"));
    }
    let target = target(path, None)?;
    if target.format == Format::Ply { Ok(target) } else { Err(usage("--map writes a PLY file; let its name end in .ply")) }
}

/// Does a job that makes numbers, and the files beside them if any, and prints its certificate.
fn tell(
    kind: JobKind,
    inputs: Vec<Given>,
    params: Params,
    targets: &[Target],
    limit_args: &LimitArgs,
    manner: Manner<'_>,
) -> Result<(), Problem> {
    let names: Vec<&str> = targets.iter().filter_map(|target| target.name).collect();
    let order = order_of(kind, inputs, params, &names, limit_args);
    if let Some(server) = manner.server {
        let (certificate, _) = remote::make(server, &order, targets, None, limit_args, manner)?;
        return print_json(&certificate);
    }
    let job = &order.job;
    let title = job.inputs.first().map(|input| input.name.as_str());
    let (outcome, _) = perform(job, limit_args, manner, |outcome, budget| deliver(outcome, title, targets, None, budget))?;
    print_json(&outcome.certificate)
}

/// `lacuna intersect`.
pub(super) fn intersect(args: &IntersectArgs, manner: Manner<'_>) -> Result<(), Problem> {
    let operation = args.operation.map(|operation| match operation {
        OperationName::Union => Operation::Union,
        OperationName::Intersection => Operation::Intersection,
        OperationName::Difference => Operation::Difference,
        OperationName::Hull => Operation::Hull,
        OperationName::Trim => Operation::Trim,
        OperationName::Split => Operation::Split,
    });
    let mut inputs: Vec<Given> = args.models.iter().map(|path| input_of(path, manner)).collect::<Result<_, _>>()?;
    match args.radius.as_slice() {
        [] => {}
        [one] => inputs.iter_mut().for_each(|given| given.input.radius_mm = Some(*one)),
        each if each.len() == inputs.len() => {
            inputs.iter_mut().zip(each).for_each(|(given, radius)| given.input.radius_mm = Some(*radius));
        }
        each => {
            let detail = format!("{} radii are given for {} models; give one for all, or one for each", each.len(), inputs.len());
            return Err(Problem::new(ProblemKind::Usage, detail));
        }
    }
    let (plane, split) = cutting(args)?;
    let params = Params { operation, repair: args.repair, with: args.with, plane, split, ..Params::new(args.tolerance) };
    if operation.is_none() {
        let wanted = if args.with.is_some() { 1 } else { 2 };
        if inputs.len() != wanted {
            let detail = format!("number of models that are given: {}; name two, one and --with, or an --operation", inputs.len());
            return Err(Problem::new(ProblemKind::Usage, detail));
        }
        return tell(JobKind::Intersect, inputs, params, &[], &args.limits, manner);
    }
    let IntersectArgs { outputs, format, certificate, preview, .. } = args;
    let output =
        OutputArgs { outputs: outputs.clone(), format: format.clone(), certificate: certificate.clone(), preview: preview.clone() };
    make(JobKind::Intersect, inputs, params, &output, &args.limits, manner)
}

/// What an intersect cuts with: of its operation alone.
fn cutting(args: &IntersectArgs) -> Result<(Option<CutPlane>, Option<Split>), Problem> {
    let usage = |detail: &str| Err(Problem::new(ProblemKind::Usage, detail.to_owned()));
    let (trims, splits) = (args.operation == Some(OperationName::Trim), args.operation == Some(OperationName::Split));
    let of_split = args.volume.is_some() || !args.cuts.is_empty() || args.key.is_some();
    if args.plane.is_some() != trims {
        return usage("--operation trim and --plane go together");
    }
    if of_split && !splits {
        return usage("--volume, --cut and --key belong to --operation split");
    }
    if splits && args.volume.is_none() && args.cuts.is_empty() {
        return usage("--operation split needs --volume or --cut");
    }
    let plane = args.plane.map(|[x, y, z, offset_mm]| CutPlane { normal: [x, y, z].into(), offset_mm });
    let mut cuts_mm: [Vec<f64>; 3] = Default::default();
    for &(axis, offset) in &args.cuts {
        cuts_mm[axis].push(offset);
    }
    let key = args.key.zip(args.clearance).map(|(width_mm, clearance_mm)| SplitKey { width_mm, clearance_mm });
    Ok((plane, splits.then_some(Split { volume_mm: args.volume, cuts_mm, key })))
}

/// `lacuna slice`.
pub(super) fn slice(args: &SliceArgs, manner: Manner<'_>) -> Result<(), Problem> {
    let planes = Planes { normal: args.normal.into(), offsets_mm: args.at.clone(), step_mm: args.step };
    let params = Params { repair: args.repair, radius_mm: args.radius, planes: Some(planes), ..Params::new(args.tolerance) };
    make(JobKind::Slice, vec![input_of(&args.model, manner)?], params, &args.output, &args.limits, manner)
}

/// `lacuna convert` at a service: as a job, with the tolerance that single precision carries at the mesh's size.
pub(super) fn convert(args: &ConvertArgs, server: &Server, manner: Manner<'_>) -> Result<(), Problem> {
    let bytes = read_input(&args.file, ReadLimits::default().file_bytes)?;
    let view = server.upload(&bytes)?;
    let corners = view.mesh.as_ref().and_then(|mesh| mesh.bbox_mm).unwrap_or_default();
    let extent = corners.as_flattened().iter().map(|end| end.abs()).fold(f64::MIN_POSITIVE / f64::EPSILON, f64::max);
    let name = title(&args.file, view.mesh.as_ref().map(|mesh| mesh.objects.as_slice()).unwrap_or_default());
    let model = Model { name: None, shape: Shape::Mesh(PolygonMesh::default()) };
    let given = Given { input: Input { name, model, radius_mm: None }, reference: Some(view.id) };
    let output = OutputArgs { outputs: args.outputs.clone(), format: args.format.clone(), certificate: None, preview: None };
    let limits = LimitArgs::default();
    // Two units in the last place: rounding takes less.
    let params = Params { repair: args.repair, ..Params::new(2.0 * f64::from(f32::EPSILON) * extent) };
    make(JobKind::Convert, vec![given], params, &output, &limits, manner)
}

/// `lacuna run`.
pub(super) fn run(args: &RunArgs, manner: Manner<'_>) -> Result<(), Problem> {
    let bytes = read_input(&args.job, DOCUMENT_BYTES)?;
    if batch::is_one(&bytes) {
        return batch::run(bytes, args, manner);
    }
    if let Some(server) = manner.server {
        let document = remote::self_contained(bytes, |bytes| whole_job(bytes, folder_of(&args.job)));
        let (certificate, written) = remote::run(server, document, &args.folder, &args.limits, manner)?;
        return print_json(&serde_json::json!({ "outputs": written, "certificate": certificate }));
    }
    // Whoever sits at the machine may ask for as much of it as there is.
    let most = Limits::MOST;
    let mut job = documents::read_job_in(&bytes, &most, folder_of(&args.job))?;
    job.limits = limits(job.limits, &args.limits);
    use_threads(args.limits.threads)?;
    let token = CancelToken::new();
    stop::on_signals(&token)?;
    limited(&job, &token, manner, |budget| refuse_by_plan(&job, budget)).map_err(Problem::under_model)?;
    let (certificate, written) = make_in(&job, &args.folder, &token, manner)?;
    print_json(&serde_json::json!({ "outputs": written, "certificate": certificate }))
}

/// Does a job, without a plan beforehand, and puts its files and its certificate into a folder, which is made if needed.
pub(super) fn make_in(job: &Job, folder: &Path, token: &CancelToken, manner: Manner<'_>) -> Result<(Certificate, Vec<Written>), Problem> {
    std::fs::create_dir_all(folder).map_err(|error| Problem::io(folder.display(), &error))?;
    let title = job.inputs.first().map(|input| input.name.clone());
    let stem = documents::file_stem(job);
    let targets: Result<Vec<Target>, Problem> =
        job.outputs.iter().map(|name| target(&folder.join(format!("{stem}.{name}")), Some(name))).collect();
    let (targets, certificate) = (targets?, folder.join(batch::CERTIFICATE));
    let done = limited(job, token, manner, |budget| {
        computed(job, budget, |outcome, budget| deliver(outcome, title.as_deref(), &targets, Some(&certificate), budget))
    });
    let (outcome, written) = done.map_err(Problem::under_model)?;
    Ok((outcome.certificate, written))
}

/// Writes a file in full, or not at all.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<Written, Problem> {
    let mut file = start(path)?;
    std::io::Write::write_all(&mut file, bytes).map_err(|error| Problem::io(path.display(), &error))?;
    finish(file, path)?;
    Ok(Written { file: path.to_owned(), bytes: bytes.len() as u64, digest: Digest::of(bytes) })
}

/// The document of a job whose mesh files are in it.
pub(super) fn whole_job(bytes: &[u8], folder: Option<&Path>) -> Result<String, Problem> {
    let most = Limits::MOST;
    documents::read_job_in(bytes, &most, folder).map(|job| Order::new(job, Vec::new()).document())
}

fn make(
    kind: JobKind,
    inputs: Vec<Given>,
    params: Params,
    output: &OutputArgs,
    limit_args: &LimitArgs,
    manner: Manner<'_>,
) -> Result<(), Problem> {
    let mut targets = targets(&output.outputs, output.format.as_deref())?;
    let others = output.certificate.iter().chain(&output.preview).map(PathBuf::as_path);
    check_distinct(targets.iter().map(|target| target.path.as_path()).chain(others))?;
    let names: Vec<&str> = targets.iter().filter_map(|target| target.name).collect();
    let order = order_of(kind, inputs, params, &names, limit_args);
    if let Some(path) = &output.preview {
        targets.push(Target { name: None, ..target(path, Some("png"))? });
    }
    let certificate = output.certificate.as_deref();
    if let Some(server) = manner.server {
        let (certificate, written) = remote::make(server, &order, &targets, certificate, limit_args, manner)?;
        if !manner.quiet {
            summarize(&certificate, &written);
        }
        return Ok(());
    }
    let job = order.job;
    let title = job.inputs.first().map(|input| input.name.clone());
    let (outcome, written) = watched(&job, limit_args, manner, |budget| {
        // Points need not be held to be written.
        if let Some(done) = deliver_streamed(&job, title.as_deref(), &targets, certificate, budget)? {
            return Ok(done);
        }
        computed(&job, budget, |outcome, budget| deliver(outcome, title.as_deref(), &targets, certificate, budget))
    })?;
    if !manner.quiet {
        summarize(&outcome.certificate, &written);
    }
    Ok(())
}

fn order_of(kind: JobKind, inputs: Vec<Given>, params: Params, outputs: &[&str], limit_args: &LimitArgs) -> Order {
    let mut names: Vec<String> = Vec::new();
    for output in outputs {
        if !names.iter().any(|name| name == output) {
            names.push((*output).to_owned());
        }
    }
    let (inputs, references) = inputs.into_iter().map(|given| (given.input, given.reference)).unzip();
    Order::new(Job { kind, inputs, params, outputs: names, limits: limits(Limits::default(), limit_args) }, references)
}

/// Whether a file is, or by its ending shall be, a mesh file and no document.
pub(super) fn is_mesh_file(path: &Path, bytes: &[u8]) -> bool {
    let first = bytes.iter().find(|byte| !byte.is_ascii_whitespace());
    let ending = path.extension().and_then(|ending| Format::from_name(&ending.to_string_lossy()));
    first != Some(&b'{') && (format::detect(bytes).is_some() || ending.is_some_and(|format| format.facts().reads))
}

/// An argument as an input: a model document, or a mesh file, which is called by its name. A service gets the file.
fn input_of(path: &Path, manner: Manner<'_>) -> Result<Given, Problem> {
    let reading = ReadLimits::default();
    let bytes = read_input(path, DOCUMENT_BYTES.max(reading.file_bytes))?;
    if !is_mesh_file(path, &bytes) {
        let model = documents::read_model_in(&bytes, folder_of(path))?;
        let input = Input { name: model.name.clone().unwrap_or_else(|| "shape".to_owned()), model, radius_mm: None };
        return Ok(Given { input, reference: None });
    }
    let name = path.file_stem().map_or_else(|| "mesh".to_owned(), |stem| stem.to_string_lossy().into_owned());
    if let Some(server) = manner.server {
        let reference = Some(server.upload(&bytes)?.id);
        let model = Model { name: None, shape: Shape::Mesh(PolygonMesh::default()) };
        return Ok(Given { input: Input { name, model, radius_mm: None }, reference });
    }
    let model = documents::mesh_model(&bytes, None, &reading)?;
    Ok(Given { input: Input { model, name, radius_mm: None }, reference: None })
}

pub(super) fn limits(asked: Limits, args: &LimitArgs) -> Limits {
    Limits {
        seconds: args.limit_seconds.unwrap_or(asked.seconds),
        memory_bytes: args.limit_memory.unwrap_or(asked.memory_bytes),
        triangles: args.limit_triangles.unwrap_or(asked.triangles),
        output_bytes: args.limit_output.unwrap_or(asked.output_bytes),
        ..asked
    }
}

/// Computes and delivers under the eyes of the clock and of the user.
fn perform(
    job: &Job,
    limit_args: &LimitArgs,
    manner: Manner<'_>,
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
fn watched<T>(
    job: &Job,
    limit_args: &LimitArgs,
    manner: Manner<'_>,
    work: impl FnOnce(&Budget) -> Result<T, Problem>,
) -> Result<T, Problem> {
    use_threads(limit_args.threads)?;
    let token = CancelToken::new();
    stop::on_signals(&token)?;
    limited(job, &token, manner, |budget| refuse_by_plan(job, budget).and_then(|()| work(budget)))
}

/// Works within the limits of a job, until its token is fired.
fn limited<T>(job: &Job, token: &CancelToken, manner: Manner<'_>, work: impl FnOnce(&Budget) -> Result<T, Problem>) -> Result<T, Problem> {
    let reporter = Reporter::new(manner.progress, manner.quiet);
    let budget = Budget { limits: job.limits, cancel: token.clone(), progress: reporter.sink(), ..Budget::default() };
    let _watchdog =
        Watchdog::start(&budget.cancel, job.limits.seconds).map_err(|error| Problem::io("no thread to watch the time", &error))?;
    work(&budget).map_err(|problem| production::why_stopped(&budget).unwrap_or(problem))
}

/// Refuses, as a service does, what exceeds a limit for certain, before the work begins.
///
/// A plan takes 0.65 of the seconds of its job in the median of the fixtures that take 20 ms or more, 0.03 to 0.45 of those that take more than a second. So it is made only where somebody has set a
/// limit below the usual one, which is there to be met soon. The usual ones are so far away that most jobs would pay for nothing; whoever meets one is told what would pass when the work ends.
fn refuse_by_plan(job: &Job, budget: &Budget) -> Result<(), Problem> {
    let (asked, usual) = (&job.limits, Limits::default());
    let is_usual = asked.triangles >= usual.triangles && asked.memory_bytes >= usual.memory_bytes && asked.cells >= usual.cells;
    if is_usual && asked.output_bytes >= usual.output_bytes {
        return Ok(());
    }
    match production::plan(job, &Budget { progress: None, ..budget.clone() }) {
        Ok(Plan { exceeds: Some(excess), .. }) => Err(excess.into()),
        // What else is wrong the work says in its place.
        Ok(_) | Err(_) => Ok(()),
    }
}

/// Sets the number of threads of this process's computations.
pub(super) fn use_threads(threads: Option<usize>) -> Result<(), Problem> {
    let Some(threads) = threads.filter(|&threads| threads > 0) else { return Ok(()) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    pool.map_err(|error| Problem::internal(format!("no pool of {threads} threads: {error}")))
}

fn summarize(certificate: &Certificate, written: &[Written]) {
    use std::io::Write;
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
