//! `lacuna jobs`: jobs of a service, one step at a time.

use std::fs::{self, OpenOptions};
use std::path::Path;

use lacuna_kernel::budget::CancelToken;
use serde_json::{Value, json};
use ureq::http::Method;
use uuid::Uuid;

use super::server::Server;
use super::{download, file_name, follow};
use crate::cli::args::{FetchArgs, JobsCommand};
use crate::cli::work::Manner;
use crate::cli::{DOCUMENT_BYTES, print, print_json, read_input, stop};
use crate::files::PENDING_ENDING;
use crate::jobs::record::{JobView, Output};
use crate::problem::{Problem, ProblemKind};

/// Does one step.
pub(in super::super) fn jobs(server: &Server, command: &JobsCommand, manner: Manner<'_>) -> Result<(), Problem> {
    match command {
        JobsCommand::Submit { job, idempotency_key } => submit(server, job, idempotency_key.as_deref()),
        JobsCommand::List { state, kind, limit, cursor } => {
            let words = [("state", state), ("kind", kind), ("limit", limit), ("cursor", cursor)];
            let query: Vec<String> =
                words.iter().filter_map(|(name, value)| Some(format!("{name}={}", escaped(value.as_deref()?)))).collect();
            let page: Value = server.json(Method::GET, &format!("/v1/jobs?{}", query.join("&")), &[], b"")?;
            print_json(&page)
        }
        JobsCommand::Show { id } => print_json(&follow::show(server, &escaped(id))?),
        JobsCommand::Watch { id } => watch(server, &escaped(id)),
        JobsCommand::Cancel { id } => {
            let view: JobView = server.json(Method::POST, &format!("/v1/jobs/{}/cancel", escaped(id)), &[], b"")?;
            print_json(&view)
        }
        JobsCommand::Fetch(args) => fetch(server, args, manner),
    }
}

/// A word as part of an address.
fn escaped(word: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.~".contains(&byte);
    word.bytes().map(|byte| if plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") }).collect()
}

fn submit(server: &Server, job: &Path, key: Option<&str>) -> Result<(), Problem> {
    let document = read_input(job, DOCUMENT_BYTES)?;
    let key = key.map_or_else(|| Uuid::now_v7().to_string(), str::to_owned);
    let view: JobView = server.json(Method::POST, "/v1/jobs", &[("idempotency-key", &key)], &document)?;
    print_json(&view)
}

/// Every event as a line, and the exit code of the job's end.
fn watch(server: &Server, id: &str) -> Result<(), Problem> {
    // Whoever only watches does not stop the job.
    stop::on_signals(&CancelToken::new())?;
    let mut refused = None;
    let view = follow::follow(server, id, &mut |event| {
        let data: Value = serde_json::from_str(&event.data).unwrap_or_default();
        let line = format!("{}\n", json!({ "id": event.id, "event": event.name, "data": data }));
        refused = refused.take().or(print(line.as_bytes()).err());
    })?;
    refused.map_or(Ok(()), Err)?;
    follow::succeeded(view).map(drop)
}

fn fetch(server: &Server, args: &FetchArgs, manner: Manner<'_>) -> Result<(), Problem> {
    let view = follow::show(server, &escaped(&args.id))?;
    if !view.state.is_final() {
        let detail = format!("the job {} is {}; `lacuna jobs watch {}` waits for it", view.id, view.state.word(), view.id);
        return Err(Problem::new(ProblemKind::StateConflict, detail));
    }
    let view = follow::succeeded(view)?;
    let wanted: Vec<&Output> = if args.outputs.is_empty() {
        view.outputs.iter().collect()
    } else {
        args.outputs.iter().map(|name| named(&view, name)).collect::<Result<_, _>>()?
    };
    fs::create_dir_all(&args.folder).map_err(|error| Problem::io(args.folder.display(), &error))?;
    let mut written = Vec::with_capacity(wanted.len());
    for output in wanted {
        let path = args.folder.join(file_name(output));
        // Named by the digest: what an earlier call began is taken up only for the same bytes.
        let part = args.folder.join(format!(".{}{PENDING_ENDING}", output.digest.hex()));
        let failed = |error: std::io::Error| Problem::io(part.display(), &error);
        let mut file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&part).map_err(failed)?;
        download::complete(server, output, &mut file)?;
        file.sync_all().and_then(|()| fs::rename(&part, &path)).map_err(|error| Problem::io(path.display(), &error))?;
        written.push(json!({ "file": path, "bytes": output.bytes, "digest": output.digest }));
    }
    if manner.quiet { Ok(()) } else { print_json(&written) }
}

fn named<'v>(view: &'v JobView, name: &str) -> Result<&'v Output, Problem> {
    view.outputs.iter().find(|output| output.name == name || output.file_name == name).ok_or_else(|| {
        let names: Vec<&str> = view.outputs.iter().map(|output| output.name.as_str()).collect();
        Problem::new(ProblemKind::Usage, format!("the job {} has no output {name:?}; it has {}", view.id, names.join(", ")))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_cannot_leave_their_place_in_an_address() {
        assert_eq!(escaped("job_01"), "job_01");
        assert_eq!(escaped("../x?y#z é"), "..%2Fx%3Fy%23z%20%C3%A9");
    }
}
