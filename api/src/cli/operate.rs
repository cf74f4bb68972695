//! Commands that run the service and look after it.

use std::io::{Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use clap::CommandFactory;
use tracing_subscriber::filter::LevelFilter;

use super::args::{Cli, ServeArgs};
use super::{print, print_json, stop, work};
use crate::config::{BadSetting, Config, Flags, Told};
use crate::problem::{Problem, ProblemKind};
use crate::{http, traces};

const HEALTH_TIME: Duration = Duration::from_secs(5);

impl From<&ServeArgs> for Flags {
    fn from(args: &ServeArgs) -> Self {
        Self {
            config: args.config.clone(),
            bind: args.bind.clone(),
            data: args.data.clone(),
            workers: args.workers,
            threads: args.threads,
            role: args.role,
            objects: args.objects_url.clone(),
            host_names: args.host_names.clone(),
            log_json: args.log_json.then_some(true),
        }
    }
}

impl From<BadSetting> for Problem {
    fn from(error: BadSetting) -> Self {
        Self::new(ProblemKind::Usage, error.to_string()).code("bad-setting")
    }
}

fn environment(name: &str) -> Option<String> {
    std::env::var(name).ok()
}

fn names() -> impl Iterator<Item = String> {
    std::env::vars_os().filter_map(|(name, _)| name.into_string().ok())
}

/// Variables that are called like settings and are none: misspelt, most likely. They are told and not refused, because not all are the user's.
fn no_settings(names: impl Iterator<Item = String>, told: &[Told]) -> Vec<String> {
    // What clients read, and what an orchestrator sets for a service that it calls `lacuna` (`LACUNA_PORT_7878_TCP_ADDR`).
    let others = |name: &str| {
        matches!(name, "LACUNA_API_KEY" | "LACUNA_SERVER") || name.starts_with("LACUNA_PORT") || name.starts_with("LACUNA_SERVICE_")
    };
    let known = |name: &str| told.iter().any(|told| told.name == name) || others(name);
    let mut unknown: Vec<String> = names.filter(|name| name.starts_with("LACUNA_") && !known(name)).collect();
    unknown.sort_unstable();
    unknown
}

/// `lacuna serve`.
pub(super) fn serve(args: ServeArgs) -> Result<(), Problem> {
    let (mut config, told) = Config::read(&Flags::from(&args), &environment)?;
    start_log(config.log, config.log_json);
    for name in no_settings(names(), &told) {
        tracing::warn!(name, "a variable that is no setting, and has no effect; `lacuna doctor` lists those that there are");
    }
    log_panics();
    config.connections = connections_within(config.connections, allow_files());
    work::use_threads(Some(config.threads))?;
    let failed = |error| Problem::io("the service cannot start", &error);
    config.traces_url.as_deref().map_or(Ok(()), traces::start).map_err(failed)?;
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().thread_name("http").build().map_err(failed)?;
    let told = |address| {
        // The one line that scripts wait for; with port 0 it is the only way to learn the port.
        let _ = print(format!("listening on http://{address}\n").as_bytes());
    };
    let result = runtime.block_on(http::serve::serve(config, told, stop::asked()));
    // Requests that are still read must not hold the exit up.
    runtime.shutdown_timeout(Duration::from_secs(1));
    result
}

/// Files that a process has open beside connections and what those send: the ledger, jobs' pipes and results, the database.
const OTHER_FILES: u64 = 512;

/// As many connections as are wished for, or as the open files allow: a connection may have a file that it sends.
fn connections_within(wished: usize, files: Option<u64>) -> usize {
    let most = files.map_or(u64::MAX, |files| files.saturating_sub(OTHER_FILES).max(files / 4) / 2).max(1);
    let most = usize::try_from(most).unwrap_or(usize::MAX);
    if most < wished {
        tracing::warn!(connections = most, "LACUNA_CONNECTIONS is {wished}, and only so many fit the limit of open files (ulimit -n)");
    }
    wished.min(most)
}

/// Raises the limit of open files as far as a process may, and tells it; none where there is no limit.
fn allow_files() -> Option<u64> {
    #[cfg(unix)]
    {
        use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
        let limit = getrlimit(Resource::Nofile);
        // Where it cannot be raised, what there was stays.
        let _ = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit });
        getrlimit(Resource::Nofile).current
    }
    #[cfg(not(unix))]
    None
}

fn start_log(level: LevelFilter, json: bool) {
    let builder = tracing_subscriber::fmt().with_writer(std::io::stderr).with_max_level(level).with_ansi(false);
    // A second subscriber can only come from an embedding program, which then has its own.
    let _ = if json { builder.json().flatten_event(true).try_init() } else { builder.try_init() };
}

/// A panic ends its job or request; where it happened belongs into the log, in the log's own form.
fn log_panics() {
    std::panic::set_hook(Box::new(|panic| {
        let place = panic.location().map(ToString::to_string).unwrap_or_default();
        let message = panic.payload_as_str().unwrap_or("no message");
        tracing::error!(%place, message, "panic");
    }));
}

/// `lacuna doctor`.
pub(super) fn doctor(args: &ServeArgs) -> Result<(), Problem> {
    let (_, told) = Config::read(&Flags::from(args), &environment)?;
    let unknown = no_settings(names(), &told);
    print_json(&serde_json::json!({ "version": env!("CARGO_PKG_VERSION"), "settings": told, "unknown": unknown }))
}

/// `lacuna completions`.
pub(super) fn completions(shell: clap_complete::Shell) -> Result<(), Problem> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "lacuna", &mut script);
    print(&script)
}

/// `lacuna healthcheck`: one request by hand, so that an image needs no other program.
pub(super) fn healthcheck(url: Option<&str>) -> Result<(), Problem> {
    let address = match url {
        Some(url) => url.trim_start_matches("http://").trim_end_matches('/').to_owned(),
        None => local_address(&Config::read(&Flags::default(), &environment)?.0),
    };
    let unreachable = |error: std::io::Error| Problem::new(ProblemKind::ServiceUnreachable, format!("{address}: {error}"));
    let status = ask_ready(&address).map_err(unreachable)?;
    if status.starts_with("HTTP/1.1 200") {
        return Ok(());
    }
    Err(Problem::new(ProblemKind::ServiceUnreachable, format!("{address} is not ready: {status}")))
}

/// The address of the service that `serve` would start on this machine.
pub(super) fn local_url() -> Result<String, Problem> {
    Ok(format!("http://{}", local_address(&Config::read(&Flags::default(), &environment)?.0)))
}

/// Where the service can be reached from inside its own machine.
fn local_address(config: &Config) -> String {
    let port = config.bind.port();
    if config.bind.ip().is_unspecified() { format!("127.0.0.1:{port}") } else { config.bind.to_string() }
}

fn ask_ready(address: &str) -> std::io::Result<String> {
    let place = address.to_socket_addrs()?.next().ok_or(std::io::ErrorKind::NotFound)?;
    let mut stream = TcpStream::connect_timeout(&place, HEALTH_TIME)?;
    stream.set_read_timeout(Some(HEALTH_TIME))?;
    stream.write_all(format!("GET /readyz HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").as_bytes())?;
    let mut answer = Vec::new();
    stream.take(4096).read_to_end(&mut answer)?;
    Ok(String::from_utf8_lossy(&answer).lines().next().unwrap_or_default().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misspelt_variables_are_told() {
        let (_, told) = Config::read(&Flags::default(), &|_| None).unwrap_or_else(|error| unreachable!("{error}"));
        let names = ["LACUNA_WORKER", "LACUNA_WORKERS", "PATH", "LACUNA_SERVER", "LACUNA_PORT", "LACUNA_SERVICE_HOST", "LACUNA_BNID"];
        assert_eq!(no_settings(names.into_iter().map(str::to_owned), &told), ["LACUNA_BNID", "LACUNA_WORKER"]);
    }

    #[test]
    fn connections_fit_the_open_files() {
        assert_eq!(connections_within(2048, None), 2048);
        assert_eq!(connections_within(2048, Some(1 << 20)), 2048);
        assert_eq!(connections_within(2048, Some(1024)), 256);
        assert_eq!(connections_within(2048, Some(100)), 12);
        assert_eq!(connections_within(2048, Some(1)), 1);
    }
}
