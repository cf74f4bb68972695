//! A running `lacuna serve` on a free port, and a client.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::binary::lacuna;

/// How long a service may take to say where it listens.
const START: Duration = Duration::from_secs(20);

/// A service of its own; it is ended when dropped.
#[derive(Debug)]
pub struct Service {
    process: Child,
    said: Arc<Mutex<Vec<String>>>,
    /// Where it listens.
    pub address: SocketAddr,
}

/// An answer.
#[derive(Clone, Debug)]
pub struct Answer {
    /// The HTTP status.
    pub status: u16,
    /// Names in lower case, and values.
    pub headers: Vec<(String, String)>,
    /// The body.
    pub body: Vec<u8>,
}

impl Answer {
    /// A header's value, empty if it is absent.
    #[must_use]
    pub fn header(&self, name: &str) -> &str {
        self.headers.iter().find(|(key, _)| key == name).map_or("", |(_, value)| value)
    }

    /// The body as JSON.
    ///
    /// # Panics
    /// When it is not.
    #[must_use]
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&self.body)))
    }
}

impl Service {
    /// Starts one over a data folder.
    ///
    /// # Panics
    /// When it does not say where it listens.
    #[must_use]
    pub fn start(data: &Path) -> Self {
        Self::start_with(data, &[])
    }

    /// Starts one with variables of the environment.
    ///
    /// # Panics
    /// When it does not say where it listens.
    #[must_use]
    pub fn start_with(data: &Path, environment: &[(&str, &str)]) -> Self {
        Self::start_by(Command::new(lacuna()), data, environment)
    }

    /// Starts one from a shell that first does something to itself.
    ///
    /// # Panics
    /// When it does not say where it listens.
    #[must_use]
    pub fn start_after(preparation: &str, data: &Path, environment: &[(&str, &str)]) -> Self {
        let mut command = Command::new("sh");
        command.args(["-c", &format!("{preparation}; exec \"$0\" \"$@\"")]).arg(lacuna());
        Self::start_by(command, data, environment)
    }

    fn start_by(mut command: Command, data: &Path, environment: &[(&str, &str)]) -> Self {
        command.args(["serve", "--bind", "127.0.0.1:0", "--data"]).arg(data).envs(environment.iter().copied());
        let mut process = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        // Both pipes are read to the end, so that the service never waits for us.
        let (sender, addresses) = channel();
        let pipes: [Box<dyn Read + Send>; 2] = [Box::new(process.stdout.take().unwrap()), Box::new(process.stderr.take().unwrap())];
        let said = Arc::<Mutex<Vec<String>>>::default();
        for pipe in pipes {
            let (sender, said) = (sender.clone(), Arc::clone(&said));
            std::thread::spawn(move || {
                for line in BufReader::new(pipe).lines().map_while(Result::ok) {
                    if let Some(address) = line.strip_prefix("listening on ").and_then(address_in) {
                        let _ = sender.send(address);
                    }
                    said.lock().unwrap().push(line);
                }
            });
        }
        match addresses.recv_timeout(START) {
            Ok(address) => Self { process, said, address },
            Err(_) => {
                let _ = process.kill();
                panic!("the service did not say where it listens: {:?}", process.wait());
            }
        }
    }

    /// Whether a line of the log has all of these words.
    #[must_use]
    pub fn said(&self, words: &[&str]) -> bool {
        self.said.lock().unwrap().iter().any(|line| words.iter().all(|word| line.contains(word)))
    }

    /// How many lines of the log have all of these words.
    #[must_use]
    pub fn count(&self, words: &[&str]) -> usize {
        self.said.lock().unwrap().iter().filter(|line| words.iter().all(|word| line.contains(word))).count()
    }

    /// Sends the process a signal by its name, as `kill` knows it.
    ///
    /// # Panics
    /// When it cannot be sent.
    pub fn signal(&self, name: &str) {
        assert!(send_signal(self.id(), name), "kill -{name} {}", self.id());
    }

    /// Waits for the process to end by itself.
    ///
    /// # Panics
    /// When that takes longer than it may.
    pub fn end(&mut self, patience: Duration) -> std::process::ExitStatus {
        let start = Instant::now();
        loop {
            if let Some(status) = self.process.try_wait().unwrap() {
                return status;
            }
            assert!(start.elapsed() < patience, "the service still runs after {patience:?}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// The number of the process.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// The processes that it has started for jobs and that still run.
    #[must_use]
    pub fn children(&self) -> Vec<u32> {
        self.processes(false)
    }

    /// The processes that it has started for questions and that still run.
    #[must_use]
    pub fn answering(&self) -> Vec<u32> {
        self.processes(true)
    }

    fn processes(&self, for_questions: bool) -> Vec<u32> {
        let entries = std::fs::read_dir("/proc").unwrap().filter_map(|entry| entry.ok()?.file_name().to_str()?.parse::<u32>().ok());
        let own = entries.filter(|&process| parent_of(process) == Some(self.id()));
        // Its command line is there from the moment it is another program than its parent.
        let asked = |process: u32| std::fs::read(format!("/proc/{process}/cmdline")).is_ok_and(|line| line.ends_with(b"\0questions\0"));
        own.filter(|&process| asked(process) == for_questions).collect()
    }

    /// Ends it at once, as a power failure would.
    pub fn kill(mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }

    /// Resident memory in bytes.
    #[must_use]
    pub fn resident_bytes(&self) -> u64 {
        resident_bytes(self.id())
    }

    fn send(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Result<Answer, ureq::Error> {
        let settings = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .max_redirects(0)
            .max_redirects_will_error(false)
            .timeout_global(Some(Duration::from_secs(90)))
            .build();
        let mut request = ureq::http::Request::builder().method(method).uri(format!("http://{}{path}", self.address));
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let mut response = ureq::Agent::new_with_config(settings).run(request.body(body)?)?;
        let headers = response.headers().iter().map(|(name, value)| (name.to_string(), value.to_str().unwrap_or("").to_owned())).collect();
        let status = response.status().as_u16();
        let body = response.body_mut().with_config().limit(1 << 30).read_to_vec()?;
        Ok(Answer { status, headers, body })
    }

    /// `GET`.
    #[must_use]
    pub fn get(&self, path: &str) -> Answer {
        self.send("GET", path, &[], b"").unwrap()
    }

    /// `GET` with headers.
    #[must_use]
    pub fn get_with(&self, path: &str, headers: &[(&str, &str)]) -> Answer {
        self.send("GET", path, headers, b"").unwrap()
    }

    /// `DELETE`.
    #[must_use]
    pub fn delete(&self, path: &str) -> Answer {
        self.send("DELETE", path, &[], b"").unwrap()
    }

    /// Any request, its headers and body as they are.
    ///
    /// # Panics
    /// When there is no answer.
    #[must_use]
    pub fn request(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Answer {
        self.send(method, path, headers, body).unwrap()
    }

    /// `POST` of JSON.
    #[must_use]
    pub fn post(&self, path: &str, body: &Value) -> Answer {
        self.post_with(path, &[], body.to_string().as_bytes())
    }

    /// `POST` of JSON to a service that may be gone.
    #[must_use]
    pub fn try_post(&self, path: &str, body: &Value) -> Option<Answer> {
        self.send("POST", path, &[("content-type", "application/json")], body.to_string().as_bytes()).ok()
    }

    /// `POST` of bytes that are said to be JSON, with headers.
    #[must_use]
    pub fn post_with(&self, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Answer {
        let mut all = vec![("content-type", "application/json")];
        all.extend_from_slice(headers);
        self.send("POST", path, &all, body).unwrap()
    }

    /// Does a job and waits for its end.
    ///
    /// # Panics
    /// When it is not accepted or does not end.
    #[must_use]
    pub fn done(&self, job: &Value) -> Value {
        let answer = self.post_with("/v1/jobs", &[("prefer", "wait=30")], job.to_string().as_bytes());
        assert!(answer.status == 200 || answer.status == 202, "{}: {}", answer.status, answer.json());
        let id = answer.json()["id"].as_str().unwrap().to_owned();
        self.ended(&id)
    }

    /// The job once it has ended.
    ///
    /// # Panics
    /// When that takes minutes.
    #[must_use]
    pub fn ended(&self, id: &str) -> Value {
        let start = Instant::now();
        loop {
            let view = self.get(&format!("/v1/jobs/{id}")).json();
            if matches!(view["state"].as_str(), Some("succeeded" | "failed" | "cancelled")) {
                return view;
            }
            assert!(start.elapsed() < Duration::from_secs(180), "{view}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Sends bytes as they are and gives what comes back until the other side closes or is silent for a while.
    #[must_use]
    pub fn raw(&self, bytes: &[u8], patience: Duration) -> String {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(patience)).unwrap();
        // The service may refuse before it has read everything: then writing fails, and its answer counts.
        let _ = stream.write_all(bytes);
        let _ = stream.shutdown(std::net::Shutdown::Write);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Orders a job, and gives its id.
///
/// # Panics
/// When it is not accepted.
#[track_caller]
#[must_use]
pub fn submit(service: &Service, order: &Value) -> String {
    let answer = service.post("/v1/jobs", order);
    assert!(matches!(answer.status, 200 | 202), "{}: {}", answer.status, answer.json());
    answer.json()["id"].as_str().unwrap().to_owned()
}

/// A job as a service tells of it.
#[must_use]
pub fn view(service: &Service, id: &str) -> Value {
    service.get(&format!("/v1/jobs/{id}")).json()
}

/// Waits until something is so; how long that took.
///
/// # Panics
/// When it is not so in time.
#[track_caller]
pub fn until(patience: Duration, what: &str, mut reached: impl FnMut() -> bool) -> Duration {
    let start = Instant::now();
    while !reached() {
        assert!(start.elapsed() < patience, "not reached: {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
    start.elapsed()
}

/// Sends a process a signal by its name, as `kill` knows it; tells whether it was there.
#[must_use]
pub fn send_signal(process: u32, name: &str) -> bool {
    Command::new("kill").args([format!("-{name}"), process.to_string()]).stderr(Stdio::null()).status().unwrap().success()
}

/// Whether a process runs: one that has ended and that nobody has asked about yet does not.
#[must_use]
pub fn is_alive(process: u32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    status.lines().any(|line| line.starts_with("State:") && !line.contains('Z') && !line.contains('X'))
}

/// Resident memory of a process in bytes; 0 when it has ended.
#[must_use]
pub fn resident_bytes(process: u32) -> u64 {
    status_of(process, "VmRSS:").unwrap_or(0) * 1024
}

fn parent_of(process: u32) -> Option<u32> {
    let parent = status_of(process, "PPid:")?;
    u32::try_from(parent).ok().filter(|_| is_alive(process))
}

/// A number that Linux tells of a process.
fn status_of(process: u32, name: &str) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    status.lines().find_map(|line| line.strip_prefix(name))?.split_whitespace().next()?.parse().ok()
}

/// The first address of this machine in a line.
fn address_in(line: &str) -> Option<SocketAddr> {
    let start = line.find("127.0.0.1:")?;
    let rest = &line[start..];
    let end = rest.find(|c: char| !(c.is_ascii_digit() || c == '.' || c == ':')).unwrap_or(rest.len());
    rest[..end].trim_end_matches([':', '.']).parse().ok().filter(|address: &SocketAddr| address.port() != 0)
}
