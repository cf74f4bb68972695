//! A PostgreSQL server of its own, with an empty database.

use std::ffi::OsStr;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use super::scratch::Scratch;

/// The user under whom the server runs when the tests run as root, which it refuses.
const USER: &str = "nobody";

/// A server; it is ended when dropped.
#[derive(Debug)]
pub struct Postgres {
    programs: PathBuf,
    scratch: Scratch,
    port: u16,
}

impl Postgres {
    /// Starts one. None, with a line that says so, where PostgreSQL is not installed.
    ///
    /// # Panics
    /// When it is installed and does not start.
    #[must_use]
    pub fn start() -> Option<Self> {
        let Some(programs) = programs() else {
            eprintln!("left out: PostgreSQL is not installed (Debian: apt-get install postgresql); the distributed mode is not tested");
            return None;
        };
        let server = Self { programs, scratch: Scratch::new(), port: free_port() };
        if is_root() {
            assert!(run("chown", [USER.as_ref(), server.scratch.path().as_os_str()]).status.success());
        }
        let data = server.scratch.join("data");
        server.program("initdb", ["-D".as_ref(), data.as_os_str(), "-U".as_ref(), "lacuna".as_ref(), "-A".as_ref(), "trust".as_ref()]);
        server.resume();
        server.program("createdb", ["-h", "127.0.0.1", "-p", &server.port.to_string(), "-U", "lacuna", "lacuna"]);
        Some(server)
    }

    /// The address of the database.
    #[must_use]
    pub fn url(&self) -> String {
        format!("postgres://lacuna:not-asked-for@127.0.0.1:{}/lacuna", self.port)
    }

    /// Ends it at once, as a power failure would.
    pub fn stop(&self) {
        self.control(&["-m", "immediate", "stop"]);
    }

    /// Starts it again over the same data.
    pub fn resume(&self) {
        let folder = self.scratch.path().display();
        let options = format!("-p {} -k {folder} -c listen_addresses=127.0.0.1", self.port);
        let log = self.scratch.join("log").display().to_string();
        self.control(&["-w", "-l", &log, "-o", &options, "start"]);
    }

    /// The answer to a question, as `psql` prints it: one row to a line.
    #[must_use]
    pub fn ask(&self, question: &str) -> String {
        let port = self.port.to_string();
        let output = self.program("psql", ["-h", "127.0.0.1", "-p", &port, "-U", "lacuna", "-Atc", question, "lacuna"]);
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    }

    fn control(&self, arguments: &[&str]) {
        let data = self.scratch.join("data");
        let all = ["-D".as_ref(), data.as_os_str()].into_iter().chain(arguments.iter().map(OsStr::new));
        self.program("pg_ctl", all);
    }

    #[track_caller]
    fn program<S: AsRef<OsStr>>(&self, name: &str, arguments: impl IntoIterator<Item = S>) -> Output {
        let mut command = if is_root() { Command::new("runuser") } else { Command::new(self.programs.join(name)) };
        if is_root() {
            command.args(["-u", USER, "--"]).arg(self.programs.join(name));
        }
        // The server is a child of pg_ctl and keeps its pipes: so its words go to a file.
        let words = self.scratch.join(&format!("{name}.out"));
        let file = std::fs::File::create(&words).unwrap();
        let errors = file.try_clone().unwrap();
        let status = command.args(arguments).current_dir("/").stdout(file).stderr(errors).status().unwrap();
        let stdout = std::fs::read(&words).unwrap();
        assert!(status.success(), "{name} ended with {status}:\n{}", String::from_utf8_lossy(&stdout));
        Output { status, stdout, stderr: Vec::new() }
    }
}

impl Drop for Postgres {
    fn drop(&mut self) {
        let data = self.scratch.join("data");
        if data.join("postmaster.pid").exists() && !std::thread::panicking() {
            self.stop();
        } else if let Ok(text) = std::fs::read_to_string(data.join("postmaster.pid")) {
            // While a test fails, a second failure would hide the first.
            let _ = run("kill", ["-QUIT", text.lines().next().unwrap_or_default()]);
        }
    }
}

fn is_root() -> bool {
    use std::os::unix::fs::MetadataExt;
    std::fs::metadata("/proc/self").is_ok_and(|facts| facts.uid() == 0)
}

fn run<S: AsRef<OsStr>>(program: &str, arguments: impl IntoIterator<Item = S>) -> Output {
    Command::new(program).args(arguments).output().unwrap()
}

/// Where the server's programs are: Debian keeps them off the path.
fn programs() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let debian = std::fs::read_dir("/usr/lib/postgresql").into_iter().flatten().flatten().map(|entry| entry.path().join("bin"));
    let mut all: Vec<PathBuf> = debian.chain(std::env::split_paths(&path)).collect();
    let whole = |folder: &Path| ["initdb", "pg_ctl", "postgres", "psql", "createdb"].iter().all(|name| folder.join(name).exists());
    all.retain(|folder| whole(folder));
    all.into_iter().next()
}

/// A port that is free now.
#[must_use]
pub fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}
