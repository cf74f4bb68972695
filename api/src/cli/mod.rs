//! The `lacuna` command. stdout carries data only; everything said goes to stderr.

mod args;
mod batch;
mod convert;
mod inspect;
mod library;
mod operate;
mod output;
mod progress;
mod regression;
mod remote;
mod stop;
mod study;
mod work;

use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::process::ExitCode;

use clap::Parser;

use crate::problem::{Problem, ProblemKind};
use args::{Cli, Command, ErrorFormat};
use remote::Server;

/// Runs the command line and gives its exit code.
#[must_use]
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let error_format = cli.error_format;
    // A panic outside of the kernel is our bug too, and has its own exit code.
    let result = crate::production::guarded(|| dispatch(cli)).and_then(|result| result);
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            // With stderr gone there is nobody left to tell.
            let _ = tell(&problem, error_format);
            ExitCode::from(problem.kind.exit_code())
        }
    }
}

fn dispatch(cli: Cli) -> Result<(), Problem> {
    let server = cli.server.filter(|_| !cli.local).map(|url| Server::at(&url)).transpose()?;
    let manner = work::Manner { progress: cli.progress, quiet: cli.quiet, server: server.as_ref() };
    match cli.command {
        Command::Solidify(args) => work::solidify(&args, manner),
        Command::Evaluate(args) => work::evaluate(&args, manner),
        Command::Measure(args) => work::measure(&args, manner),
        Command::Intersect(args) => work::intersect(&args, manner),
        Command::Slice(args) => work::slice(&args, manner),
        Command::Run(args) => work::run(&args, manner),
        Command::Validate { model, draw } => study::validate(&model, draw.as_deref(), manner.server),
        Command::Solve(args) => study::solve(&args, cli.quiet, manner.server),
        Command::Address(args) => study::address(&args, manner.server),
        Command::Plan { job } => study::plan(&job, manner.server),
        Command::Inspect { file } => inspect::inspect(&file),
        Command::Convert(args) => match manner.server {
            Some(server) => work::convert(&args, server, manner),
            None => convert::convert(&args),
        },
        Command::Library(args) => library::library(&args),
        Command::Materials => print_json(&crate::trades::materials()),
        Command::Profiles { process } => library::profiles(process.as_deref()),
        Command::Verify(args) => regression::verify(&args, manner),
        Command::Bless(args) => regression::bless(&args, manner),
        Command::Diff(args) => regression::diff(&args, manner),
        Command::Jobs(command) => match manner.server {
            Some(server) => remote::jobs::jobs(server, &command, manner),
            None => remote::jobs::jobs(&Server::at(&operate::local_url()?)?, &command, manner),
        },
        Command::Serve(args) => operate::serve(args),
        Command::DoJobs { threads, purpose } => {
            // In this order: a thread takes its priority from the one that starts it, and keeps it.
            crate::jobs::apart::take_place(purpose);
            work::use_threads(Some(threads))?;
            crate::jobs::apart::serve()
        }
        Command::Healthcheck { url } => operate::healthcheck(url.as_deref()),
        Command::Openapi => print(crate::openapi::text().as_bytes()),
        Command::Doctor(args) => operate::doctor(&args),
        Command::Completions { shell } => operate::completions(shell),
    }
}

/// Writes data to stdout. A reader that has seen enough is no error.
fn print(bytes: &[u8]) -> Result<(), Problem> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Problem::io("stdout", &error)),
        _ => Ok(()),
    }
}

/// Writes a value as indented JSON to stdout.
fn print_json(value: &impl serde::Serialize) -> Result<(), Problem> {
    let mut bytes = serde_json::to_vec_pretty(value).map_err(|error| Problem::internal(error.to_string()))?;
    bytes.push(b'\n');
    print(&bytes)
}

/// Reads a document from a file, or from stdin for `-`, but not beyond what will be read of it.
fn read_input(path: &Path, most: u64) -> Result<Vec<u8>, Problem> {
    let mut bytes = Vec::new();
    let result = if path == Path::new("-") {
        io::stdin().lock().take(most + 1).read_to_end(&mut bytes)
    } else {
        std::fs::File::open(path).and_then(|file| file.take(most + 1).read_to_end(&mut bytes))
    };
    result.map_err(|error| Problem::io(path.display(), &error))?;
    if bytes.len() as u64 > most {
        let detail = format!("{} is longer than {most} bytes", path.display());
        return Err(Problem::new(ProblemKind::BodyTooLarge, detail));
    }
    Ok(bytes)
}

/// The folder in which a document's files are looked for; none for stdin.
fn folder_of(document: &Path) -> Option<&Path> {
    if document == Path::new("-") {
        return None;
    }
    let folder = document.parent().unwrap_or(Path::new(""));
    Some(if folder.as_os_str().is_empty() { Path::new(".") } else { folder })
}

/// Documents are longer on the command line than over HTTP, but not endless.
const DOCUMENT_BYTES: u64 = 256 << 20;

/// A number as one would write it: counts without a fraction, and no row of zeros.
fn shown(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e15 { format!("{value:.0}") } else { format!("{value:?}") }
}

fn tell(problem: &Problem, format: ErrorFormat) -> io::Result<()> {
    let mut stderr = io::stderr().lock();
    if format == ErrorFormat::Json {
        return writeln!(stderr, "{}", serde_json::to_string(problem)?);
    }
    // A document's first finding is the detail, and says its code already.
    let code = if problem.detail.contains(&format!("[{}]", problem.code)) { String::new() } else { format!(" [{}]", problem.code) };
    writeln!(stderr, "error: {}{code}", problem.detail)?;
    for finding in problem.errors.iter().filter(|finding| problem.errors.len() > 1 || !problem.detail.contains(&finding.message)) {
        let place = if finding.pointer.is_empty() { "the document" } else { finding.pointer.as_str() };
        match (finding.line, finding.column) {
            (Some(line), Some(column)) => writeln!(stderr, "  {place} ({line}:{column}): {} [{}]", finding.message, finding.code)?,
            _ => writeln!(stderr, "  {place}: {} [{}]", finding.message, finding.code)?,
        }
    }
    if let (Some(limit), Some(asked), Some(allowed)) = (&problem.limit, problem.asked, problem.allowed) {
        writeln!(stderr, "  limit {limit}: asked {}, allowed {}", shown(asked), shown(allowed))?;
    }
    for (name, value) in problem.remedy.iter().flatten() {
        writeln!(stderr, "  this would pass: {name} = {}", shown(*value))?;
    }
    Ok(())
}
