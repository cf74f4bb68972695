//! The Python environment of the independent checks: made on demand in `.venv` at the top of the repository.

use std::env;
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use super::root;

/// Tells why the independent checks are left out, if the environment says so.
#[must_use]
pub fn skipped() -> bool {
    let skipped = env::var_os("LACUNA_SKIP_INDEPENDENT").is_some_and(|value| value == "1");
    if skipped {
        eprintln!("independent checks are left out: LACUNA_SKIP_INDEPENDENT is 1; files are not read back by other people's libraries");
    }
    skipped
}

/// The interpreter that people have.
#[must_use]
pub fn system_python() -> Command {
    Command::new(env::var_os("PYTHON").unwrap_or_else(|| "python3".into()))
}

/// The environment's interpreter; the first call makes the environment.
///
/// # Panics
/// When it cannot be made: a suite that silently leaves its judge out is worth nothing.
pub(super) fn interpreter() -> PathBuf {
    let script = root().join("tests/independent/environment.py");
    let made = system_python().arg(script).arg(root().join(".venv")).output();
    let hint = "they need Python 3.11 or newer, and the package index once; LACUNA_SKIP_INDEPENDENT=1 leaves them out";
    let output = made.unwrap_or_else(|error| panic!("python3 cannot be started ({error}): the independent checks cannot run; {hint}"));
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "the environment of the independent checks cannot be made; {hint}\n{words}");
    PathBuf::from(String::from_utf8(output.stdout).unwrap().trim())
}

/// A program of the environment; the first call makes the environment.
///
/// # Panics
/// As when the environment cannot be made.
#[must_use]
pub fn tool(name: &str) -> Command {
    Command::new(interpreter().with_file_name(name))
}

/// A running `check.py`: one request, one report.
#[derive(Debug)]
pub struct Judge {
    process: Child,
    questions: ChildStdin,
    reports: BufReader<ChildStdout>,
}

impl Judge {
    /// Starts it.
    #[must_use]
    pub fn start() -> Self {
        let script = root().join("tests/independent/check.py");
        let mut process =
            Command::new(interpreter()).arg(script).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::inherit()).spawn().unwrap();
        let (questions, reports) = (process.stdin.take().unwrap(), BufReader::new(process.stdout.take().unwrap()));
        Self { process, questions, reports }
    }

    /// The report on a file, with the opinions of trimesh, Manifold and CGAL if asked.
    ///
    /// # Panics
    /// When the judge has ended.
    pub fn report(&mut self, file: &std::path::Path, opinions: bool) -> serde_json::Value {
        self.ask(&serde_json::json!({ "file": file, "opinions": opinions }))
    }

    /// The report on a file whose sections across Z at some heights are drawn in another, beside those that trimesh cuts.
    ///
    /// # Panics
    /// When the judge has ended.
    pub fn sections(&mut self, file: &std::path::Path, heights: &[f64], drawing: &std::path::Path) -> serde_json::Value {
        self.ask(&serde_json::json!({ "file": file, "heights": heights, "sections": drawing }))
    }

    fn ask(&mut self, request: &serde_json::Value) -> serde_json::Value {
        writeln!(self.questions, "{request}").unwrap();
        let mut line = String::new();
        self.reports.read_line(&mut line).unwrap();
        assert!(!line.is_empty(), "check.py ended at {request}");
        serde_json::from_str(&line).unwrap()
    }
}

impl Drop for Judge {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
