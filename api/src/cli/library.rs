//! What the binary knows: classics as model documents, and numbers of processes.

use std::path::Path;

use super::args::LibraryArgs;
use super::{print, print_json};
use crate::files;
use crate::problem::{Problem, ProblemKind};
use crate::routes::library::{classic, page};
use crate::trades;

/// Lists the library, or gives a document of it.
pub(super) fn library(args: &LibraryArgs) -> Result<(), Problem> {
    let Some(name) = &args.name else { return print_json(&page()) };
    // On the command line a wrong name is a wrong argument.
    let found = classic(name).map_err(|problem| Problem { kind: ProblemKind::Usage, ..problem })?;
    let document = found.document.as_bytes();
    match &args.output {
        Some(path) if path != Path::new("-") => files::write_whole(path, document).map_err(|error| Problem::io(path.display(), &error)),
        _ => print(document),
    }
}

/// `lacuna profiles`.
pub(super) fn profiles(process: Option<&str>) -> Result<(), Problem> {
    let Some(process) = process else { return print_json(&trades::profiles()) };
    // On the command line a wrong name is a wrong argument.
    print_json(trades::profile(process).map_err(|problem| Problem { kind: ProblemKind::Usage, ..problem })?)
}
