//! The `lacuna` command as users run it.

use std::env::{self, consts::EXE_SUFFIX};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use super::root;

/// Path of the command: what `LACUNA_BIN` names, else the workspace's own, built with the profile of the tests.
///
/// Cargo builds the binary of another package only on demand, so it is asked for here; when nothing has changed that
/// takes a moment.
pub fn lacuna() -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| env::var_os("LACUNA_BIN").map_or_else(build, PathBuf::from))
}

fn build() -> PathBuf {
    // .../target/<profile>/deps/<this test>
    let this = env::current_exe().unwrap();
    let folder = this.parent().and_then(Path::parent).unwrap();
    let profile = match folder.file_name().and_then(OsStr::to_str) {
        Some("debug") | None => "dev",
        Some(name) => name,
    };
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    // The whole workspace, so that features are those that the tests were built with, and little is built twice.
    let mut command = Command::new(cargo);
    command.args(["build", "--quiet", "--locked", "--workspace", "--bin", "lacuna", "--profile", profile, "--target-dir"]);
    // What cargo says of the package under test is nothing to this build; build scripts that ask for such variables, as ring's does, would run anew, and all that depends on them be built again.
    let of_package = |name: &str| name.starts_with("CARGO_PKG_") || name.starts_with("CARGO_MANIFEST_");
    env::vars_os().map(|(name, _)| name).filter(|name| name.to_str().is_some_and(of_package)).for_each(|name| {
        command.env_remove(name);
    });
    let built = command.arg(folder.parent().unwrap()).current_dir(root()).output().unwrap();
    assert!(built.status.success(), "the command could not be built:\n{}", String::from_utf8_lossy(&built.stderr));
    folder.join(format!("lacuna{EXE_SUFFIX}"))
}

/// Runs the command to its end.
pub fn run<I: IntoIterator<Item = S>, S: AsRef<OsStr>>(arguments: I) -> Output {
    Command::new(lacuna()).args(arguments).output().unwrap()
}

/// Runs the command, which must succeed, and gives its standard output.
///
/// # Panics
/// When it does not succeed; the words of the command are in the message.
#[track_caller]
pub fn succeed<I: IntoIterator<Item = S>, S: AsRef<OsStr>>(arguments: I) -> Vec<u8> {
    let arguments: Vec<_> = arguments.into_iter().map(|a| a.as_ref().to_owned()).collect();
    let output = run(&arguments);
    assert!(output.status.success(), "{arguments:?} ended with {}:\n{}{}", output.status, words(&output.stdout), words(&output.stderr));
    output.stdout
}

fn words(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}
