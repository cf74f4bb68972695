//! An object store of its own with the interface of S3: moto's server, from the Python environment of the tests.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::postgres::free_port;
use super::python;

/// A server with one empty bucket; it is ended when dropped.
#[derive(Debug)]
pub struct Objects {
    process: Child,
    port: u16,
}

impl Objects {
    /// Starts one. None, with a line that says so, where the environment leaves Python's packages out.
    ///
    /// # Panics
    /// When it does not start.
    #[must_use]
    pub fn start() -> Option<Self> {
        if python::skipped() {
            return None;
        }
        let port = free_port();
        let mut command = Command::new(python::interpreter());
        command.args(["-m", "moto.server", "-H", "127.0.0.1", "-p", &port.to_string()]);
        let process = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let server = Self { process, port };
        let start = Instant::now();
        while ureq::put(format!("{}/parts", server.endpoint())).send_empty().is_err() {
            assert!(start.elapsed() < Duration::from_secs(60), "moto's server does not answer");
            std::thread::sleep(Duration::from_millis(50));
        }
        Some(server)
    }

    /// What `AWS_ENDPOINT_URL` is to say.
    #[must_use]
    pub fn endpoint(&self) -> String {
        format!("http://127.0.0.1:{}", self.port)
    }

    /// Stops answering, or goes on: `STOP` and `CONT`.
    pub fn signal(&self, name: &str) {
        let _ = Command::new("kill").args([format!("-{name}"), self.process.id().to_string()]).status();
    }
}

impl Drop for Objects {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
