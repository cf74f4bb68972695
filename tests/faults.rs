//! What one process over its data folder loses when it is killed, when its disk is full, when its clients misbehave:
//! nothing that it had accepted.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use lacuna_tests::support::cases::{long_job, model, search_job};
use lacuna_tests::support::python::system_python;
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::{Service, submit, until};
use serde_json::{Value, json};

/// Limits out of the way of tests that send much at once.
const MUCH: [(&str, &str); 3] =
    [("LACUNA_SUBMISSIONS_PER_MINUTE", "1000000"), ("LACUNA_QUEUED", "100000"), ("LACUNA_JOBS_PER_KEY", "100000")];

/// How long anything may take that takes a moment on an idle machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// The work of a moment, another one for every number.
fn small(number: usize) -> Value {
    #[expect(clippy::cast_precision_loss, reason = "numbers are small")]
    let tolerance = 0.1 + number as f64 / 1e6;
    json!({ "lacuna": 1, "kind": "measure", "model": model("meshes/segment"), "params": { "tolerance_mm": tolerance } })
}

/// A file of some megabytes.
fn large() -> Value {
    json!({ "lacuna": 1, "kind": "evaluate", "model": model("ifs/sierpinski_tetrahedron"), "outputs": ["obj"],
        "params": { "tolerance_mm": 0.2 } })
}

fn state(service: &Service, id: &str) -> String {
    service.get(&format!("/v1/jobs/{id}")).json()["state"].as_str().unwrap_or("absent").to_owned()
}

#[test]
fn a_service_killed_again_and_again_loses_nothing_that_it_accepted() {
    let scratch = Scratch::new();
    let accepted = Mutex::new(Vec::<String>::new());
    let mut killed_while_busy = 0;
    for round in 0..6_u32 {
        let service = Service::start_with(scratch.path(), &MUCH);
        std::thread::scope(|scope| {
            for sender in 0..3 {
                let (service, accepted) = (&service, &accepted);
                scope.spawn(move || {
                    for number in 0.. {
                        let order = small(round as usize * 100_000 + sender * 10_000 + number);
                        let Some(answer) = service.try_post("/v1/jobs", &order) else { return };
                        if matches!(answer.status, 200 | 202) {
                            accepted.lock().unwrap().push(answer.json()["id"].as_str().unwrap().to_owned());
                        }
                    }
                });
            }
            // Another moment in every round, without a clock's say in it.
            std::thread::sleep(Duration::from_millis(u64::from(round.wrapping_mul(2_654_435_761) % 300) + 30));
            service.signal("KILL");
        });
        killed_while_busy += u32::from(!accepted.lock().unwrap().is_empty());
    }
    let ids = accepted.into_inner().unwrap();
    let service = Service::start_with(scratch.path(), &MUCH);
    for id in &ids {
        let job = service.ended(id);
        assert!(job["state"] == "succeeded" || job["problem"]["code"] == "interrupted", "{job}");
    }
    eprintln!("killed 6 times with kill -9 during a burst; all {} accepted jobs are there and have ended", ids.len());
    assert!(ids.len() > 20 && killed_while_busy > 3, "{} accepted", ids.len());
}

#[test]
fn equal_orders_at_once_are_one_work() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let order = large();
    let jobs: Vec<Value> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..8).map(|_| scope.spawn(|| service.done(&order))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert!(jobs.iter().all(|job| job["state"] == "succeeded" && job["outputs"] == jobs[0]["outputs"]));
    let worked = jobs.iter().filter(|job| job["attempt"] == 1 && job["reused"] == false).count();
    assert_eq!((worked, jobs.iter().filter(|job| job["reused"] == true).count()), (1, 7));
}

#[test]
fn a_storm_of_jobs_that_are_stopped_at_once_leaves_the_workers_free() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &MUCH);
    let longest = Mutex::new(Duration::ZERO);
    std::thread::scope(|scope| {
        for sender in 0..8 {
            let (service, longest) = (&service, &longest);
            scope.spawn(move || {
                for number in 0..30 {
                    let id = submit(service, &search_job(sender * 1000 + number));
                    if number % 3 == 0 {
                        std::thread::sleep(Duration::from_millis(20));
                    }
                    let wished = Instant::now();
                    assert_eq!(service.post(&format!("/v1/jobs/{id}/cancel"), &json!({})).status / 100, 2);
                    until(PATIENCE, "cancelled", || state(service, &id) == "cancelled");
                    let mut longest = longest.lock().unwrap();
                    *longest = longest.max(wished.elapsed());
                }
            });
        }
    });
    let longest = longest.into_inner().unwrap();
    eprintln!("240 jobs submitted and stopped by 8 clients; longest from the wish to `cancelled`: {longest:?}");
    assert!(longest < Duration::from_secs(10), "{longest:?}");
    assert_eq!(service.done(&small(0))["state"], "succeeded");
    // A job's end is told a moment before its worker is counted as free.
    for gauge in ["lacuna_jobs_queued 0", "lacuna_jobs_running 0"] {
        until(PATIENCE, gauge, || String::from_utf8(service.get("/metrics").body).unwrap().lines().any(|line| line == gauge));
    }
}

/// A small file system, or a limit on the length of files that stands for one.
struct FullDisk {
    folder: PathBuf,
    mounted: bool,
    _scratch: Scratch,
}

impl FullDisk {
    fn new() -> Self {
        let scratch = Scratch::new();
        let folder = scratch.join("disk");
        fs::create_dir(&folder).unwrap();
        let mount = Command::new("mount").args(["-t", "tmpfs", "-o", "size=3m", "tmpfs"]).arg(&folder).stderr(Stdio::null()).status();
        Self { folder, mounted: mount.is_ok_and(|status| status.success()), _scratch: scratch }
    }
}

impl Drop for FullDisk {
    fn drop(&mut self) {
        if self.mounted {
            let _ = Command::new("umount").arg("--lazy").arg(&self.folder).status();
        }
    }
}

#[test]
fn a_full_disk_is_told_and_harms_nothing_that_was_accepted() {
    let disk = FullDisk::new();
    if !disk.mounted {
        return files_that_cannot_grow();
    }
    eprintln!("a full disk: a tmpfs of 3 MiB");
    let data = disk.folder.join("data");
    let service = Service::start_with(&data, &MUCH);
    let before = submit(&service, &small(0));
    assert_eq!(service.ended(&before)["state"], "succeeded");
    let waits = submit(&service, &large());
    // All of the rest, while a job is at work whose file will not fit.
    let ballast = disk.folder.join("ballast");
    let mut file = fs::File::create(&ballast).unwrap();
    while file.write_all(&[0; 4096]).is_ok() {}
    drop(file);
    let refused = service.post("/v1/jobs", &small(1));
    assert_eq!((refused.status, &refused.json()["code"]), (503, &json!("storage-full")), "{}", refused.json());
    assert!(!refused.header("retry-after").is_empty());
    assert_eq!(service.get("/readyz").status, 503);
    assert_eq!(state(&service, &before), "succeeded");

    fs::remove_file(&ballast).unwrap();
    until(PATIENCE, "ready", || service.get("/readyz").status == 200);
    let job = service.ended(&waits);
    assert_eq!((&job["state"], &job["problem"]["code"]), (&json!("failed"), &json!("storage-full")), "{job}");
    assert_eq!(service.done(&small(1))["state"], "succeeded");
    service.kill();
    let again = Service::start_with(&data, &MUCH);
    assert_eq!((state(&again, &before).as_str(), state(&again, &waits).as_str()), ("succeeded", "failed"));
}

/// Where no file system may be mounted: no file can become longer than 64 KiB.
fn files_that_cannot_grow() {
    eprintln!("a full disk: no file system may be mounted here; `ulimit -f` stands for it, files end at 64 KiB");
    let scratch = Scratch::new();
    let service = Service::start_after("trap '' XFSZ; ulimit -f 128", scratch.path(), &MUCH);
    let job = service.done(&large());
    assert_eq!((&job["state"], &job["problem"]["code"]), (&json!("failed"), &json!("storage-full")), "{job}");
    assert_eq!(service.done(&small(0))["state"], "succeeded");
    let results: Vec<_> = fs::read_dir(scratch.join("results")).unwrap().collect();
    assert_eq!(results.len(), 1, "nothing half written is left: {results:?}");
}

#[test]
fn a_result_deleted_under_a_download_is_delivered_and_then_made_again() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let job = service.done(&large());
    let (digest, bytes) = (job["outputs"][0]["digest"].as_str().unwrap(), job["outputs"][0]["bytes"].as_u64().unwrap());
    assert!(bytes > 8 << 20, "{bytes} bytes would fit into the buffers of a socket");
    let mut stream = TcpStream::connect(service.address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    write!(stream, "GET /v1/results/{digest} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n").unwrap();
    let mut first = [0; 1024];
    stream.read_exact(&mut first).unwrap();
    fs::remove_file(scratch.join("results").join(digest.trim_start_matches("sha256:"))).unwrap();
    let mut rest = Vec::new();
    stream.read_to_end(&mut rest).unwrap();
    let head = first.windows(4).position(|four| four == b"\r\n\r\n").unwrap() + 4;
    assert_eq!((first.len() - head + rest.len()) as u64, bytes);
    // Gone is told as gone, and equal work is not answered with what is no longer there.
    let gone = service.get(&format!("/v1/results/{digest}"));
    assert_eq!((gone.status, gone.header("content-type")), (410, "application/problem+json"));
    assert_eq!((&gone.json()["type"], &gone.json()["code"]), (&json!("/problems/result-expired"), &json!("result-expired")));
    let pointed = format!("/v1/jobs/{}/outputs/{}?redirect=0", job["id"].as_str().unwrap(), job["outputs"][0]["name"].as_str().unwrap());
    assert_eq!(service.get(&pointed).status, 410);
    // What nobody made was never there.
    assert_eq!(service.get(&format!("/v1/results/sha256:{}", "0".repeat(64))).status, 404);
    let again = service.done(&large());
    assert_eq!((&again["reused"], &again["outputs"]), (&json!(false), &job["outputs"]));
    assert_eq!(service.get(&format!("/v1/results/{digest}")).body.len() as u64, bytes);
}

#[test]
fn slow_clients_are_sent_away_and_keep_nobody_waiting() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_HEADER_SECONDS", "2"), ("LACUNA_BODY_SECONDS", "2")]);
    let open = |words: &str| {
        let mut stream = TcpStream::connect(service.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(40))).unwrap();
        stream.write_all(words.as_bytes()).unwrap();
        stream
    };
    let half_head = "POST /v1/jobs HTTP/1.1\r\nhost: lac";
    let half_body = "POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: 1000\r\n\r\n{\"lac";
    let mut slow: Vec<(bool, TcpStream)> = (0..100).map(|k| (k % 2 == 0, open(if k % 2 == 0 { half_body } else { half_head }))).collect();
    let start = Instant::now();
    for number in 0..20 {
        assert_eq!(service.done(&small(number))["state"], "succeeded");
    }
    eprintln!("20 jobs beside 100 stalled clients: {:?}", start.elapsed());
    for (body, stream) in &mut slow {
        let mut answer = String::new();
        // A reset is a closed connection, too.
        let _ = stream.read_to_string(&mut answer);
        assert_eq!(answer.starts_with("HTTP/1.1 408 "), *body || !answer.is_empty(), "{answer}");
        assert!(!*body || answer.contains("request-timeout"), "{answer}");
    }
    assert_eq!(service.get("/v1/jobs").json()["items"].as_array().unwrap().len(), 20);
}

#[test]
fn who_does_not_read_keeps_no_connection() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_BODY_SECONDS", "2"), ("LACUNA_CONNECTIONS", "8")]);
    let job = service.done(&large());
    let (digest, bytes) = (job["outputs"][0]["digest"].as_str().unwrap(), job["outputs"][0]["bytes"].as_u64().unwrap());
    // More than sockets hold, asked for by all connections that there are; nobody reads.
    let request = format!("GET /v1/results/{digest} HTTP/1.1\r\nhost: localhost\r\n\r\n");
    let times = usize::try_from((64 << 20) / bytes + 1).unwrap();
    let mut deaf: Vec<TcpStream> = (0..8).map(|_| TcpStream::connect(service.address).unwrap()).collect();
    for stream in &mut deaf {
        stream.write_all(request.repeat(times).as_bytes()).unwrap();
    }
    let start = Instant::now();
    until(PATIENCE, "an answer beside all deaf clients", || {
        service.try_post("/v1/jobs", &small(0)).is_some_and(|answer| answer.status / 100 == 2)
    });
    eprintln!("8 clients that do not read took all 8 connections; the next client was answered after {:?}", start.elapsed());
    // Only when others have all 8 places at once are all of these gone: the first was let go a moment before the last.
    let mut others = Vec::new();
    until(PATIENCE, "all places again", || {
        let mut stream = TcpStream::connect(service.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.write_all(b"GET /livez HTTP/1.1\r\nhost: localhost\r\n\r\n").unwrap();
        let mut status = [0; 12];
        others.extend(stream.read_exact(&mut status).ok().filter(|()| status.ends_with(b" 200")).map(|()| stream));
        others.len() == 8
    });
    for mut stream in deaf {
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let mut rest = Vec::new();
        // A reset is a closed connection, too.
        let _ = stream.read_to_end(&mut rest);
        assert!((rest.len() as u64) < bytes * times as u64, "nobody was waited for");
    }
    assert!(service.said(&["all connections are taken"]));
}

#[test]
fn an_answer_given_early_arrives_at_who_is_still_sending() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_API_KEYS", "ada"), ("LACUNA_BODY_BYTES", "1000000")]);
    for (path, headers, status) in [
        ("/v1/jobs", "content-type: application/json", "401"),
        ("/v1/jobs", "content-type: application/json\r\nauthorization: Bearer ada", "413"),
        ("/v1/jobs", "content-type: text/plain\r\nauthorization: Bearer ada", "415"),
        ("/v1/nothing", "authorization: Bearer ada", "404"),
    ] {
        let mut stream = TcpStream::connect(service.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let body = vec![b' '; 40 << 20];
        write!(stream, "POST {path} HTTP/1.1\r\nhost: localhost\r\n{headers}\r\ncontent-length: {}\r\n\r\n", body.len()).unwrap();
        // As simple clients do: all is sent before anything is read.
        stream.write_all(&body).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with(&format!("HTTP/1.1 {status} ")), "{status}: {answer}");
    }
}

#[test]
fn a_thousand_idle_listeners_cost_little_and_leave_in_order() {
    const LISTENERS: usize = 1000;
    let scratch = Scratch::new();
    let mut service = Service::start_after("ulimit -n 4096", scratch.path(), &[("LACUNA_DRAIN_SECONDS", "1")]);
    let id = submit(&service, &long_job(0));
    let before = service.resident_bytes();
    // Another process holds them: this one may not have so many files open.
    let script = "import resource, socket, sys
resource.setrlimit(resource.RLIMIT_NOFILE, (4096, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
port, path, count = int(sys.argv[1]), sys.argv[2], int(sys.argv[3])
streams = [socket.create_connection(('127.0.0.1', port)) for _ in range(count)]
for stream in streams:
    stream.sendall(f'GET {path} HTTP/1.1\\r\\nhost: localhost\\r\\n\\r\\n'.encode())
begun = sum(stream.recv(16).startswith(b'HTTP/1.1 200') for stream in streams)
print(begun, flush=True)
ended = 0
for stream in streams:
    stream.settimeout(60)
    while stream.recv(65536):
        pass
    ended += 1
print(ended, flush=True)
";
    let port = service.address.port().to_string();
    let arguments = ["-c", script, &port, &format!("/v1/jobs/{id}/events"), &LISTENERS.to_string()];
    let mut listeners = system_python().args(arguments).stdout(Stdio::piped()).spawn().unwrap();
    let mut told = std::io::BufReader::new(listeners.stdout.take().unwrap());
    let mut line = String::new();
    std::io::BufRead::read_line(&mut told, &mut line).unwrap();
    assert_eq!(line.trim(), LISTENERS.to_string(), "streams that have begun");
    let start = Instant::now();
    for _ in 0..100 {
        assert_eq!(service.get(&format!("/v1/jobs/{id}")).status, 200);
    }
    let grown = service.resident_bytes().saturating_sub(before);
    eprintln!("{LISTENERS} idle listeners: {} KiB each; a status takes {:?}", grown / 1024 / LISTENERS as u64, start.elapsed() / 100);
    assert!(grown < 200 << 20, "{grown} bytes");
    // Open streams do not hold the service up when it goes down.
    service.signal("TERM");
    let start = Instant::now();
    let status = service.end(Duration::from_secs(30));
    eprintln!("down {:?} after SIGTERM", start.elapsed());
    assert!(status.success(), "{status}");
    line.clear();
    std::io::BufRead::read_line(&mut told, &mut line).unwrap();
    assert_eq!(line.trim(), LISTENERS.to_string(), "streams that have ended");
    assert!(listeners.wait().unwrap().success());
}

#[test]
fn a_service_that_is_asked_to_end_drains_and_its_jobs_go_on_at_the_next_start() {
    let scratch = Scratch::new();
    let one = [("LACUNA_WORKERS", "1"), ("LACUNA_DRAIN_SECONDS", "4")];
    let mut service = Service::start_with(scratch.path(), &one);
    let running = submit(&service, &long_job(0));
    until(PATIENCE, "running", || state(&service, &running) == "running");
    let waiting = submit(&service, &small(0));
    // An answer that is under way is still given.
    let address = service.address;
    let mut waiter = TcpStream::connect(address).unwrap();
    let body = small(1).to_string();
    let head = "POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\nprefer: wait=1\r\ncontent-type: application/json";
    write!(waiter, "{head}\r\ncontent-length: {}\r\n\r\n{body}", body.len()).unwrap();
    until(PATIENCE, "the third job", || service.get("/v1/jobs").json()["items"].as_array().unwrap().len() == 3);
    service.signal("TERM");
    // Not ready comes first, and is told to whoever asks anew while a job still runs; so is how the job is.
    until(PATIENCE, "not ready", || service.get("/readyz").status == 503);
    assert_eq!(state(&service, &running), "running");
    let refused = service.post("/v1/jobs", &small(2));
    assert_eq!((refused.status, &refused.json()["code"]), (503, &json!("shutting-down")));
    assert!(service.end(Duration::from_secs(30)).success());
    let mut answer = String::new();
    waiter.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 202 "), "{answer}");

    let again = Service::start_with(scratch.path(), &one);
    until(PATIENCE, "a second attempt", || again.get(&format!("/v1/jobs/{running}")).json()["attempt"] == 2);
    assert_eq!(again.post(&format!("/v1/jobs/{running}/cancel"), &json!({})).status / 100, 2);
    assert_eq!(again.ended(&waiting)["state"], "succeeded");
    assert_eq!(again.get("/v1/jobs").json()["items"].as_array().unwrap().len(), 3);
}

#[test]
fn a_clock_that_jumps_changes_nothing() {
    let library = ["x86_64-linux-gnu", "aarch64-linux-gnu"].map(|machine| format!("/usr/lib/{machine}/faketime/libfaketimeMT.so.1"));
    let Some(library) = library.iter().find(|path| Path::new(path).exists()) else {
        eprintln!("left out: libfaketime is not installed (Debian: apt-get install libfaketime); no clock jumps under the service");
        return;
    };
    let scratch = Scratch::new();
    let clock = scratch.join("clock");
    fs::write(&clock, "+0d").unwrap();
    let environment = [
        ("LD_PRELOAD", library.as_str()),
        ("FAKETIME_TIMESTAMP_FILE", clock.to_str().unwrap()),
        ("FAKETIME_NO_CACHE", "1"),
        // The clock on the wall jumps; the one that only counts does not.
        ("FAKETIME_DONT_FAKE_MONOTONIC", "1"),
    ];
    let service = Service::start_with(&scratch.join("data"), &environment);
    let running = submit(&service, &long_job(0));
    let mut limited = long_job(1);
    limited["limits"]["seconds"] = json!(3600);
    let limited = submit(&service, &limited);
    let year = |view: &Value| view["created"].as_str().unwrap()[..4].parse::<i32>().unwrap();
    let mut years = Vec::new();
    for (number, jump) in ["-400d", "+800d", "+0d"].iter().enumerate() {
        fs::write(&clock, jump).unwrap();
        let id = submit(&service, &small(number));
        // Workers are busy; what waits is stopped, and everybody is where they were.
        years.push(year(&service.get(&format!("/v1/jobs/{id}")).json()));
        assert_eq!(service.post(&format!("/v1/jobs/{id}/cancel"), &json!({})).json()["state"], "cancelled");
        for id in [&running, &limited] {
            assert_eq!(state(&service, id), "running", "after {jump}");
        }
    }
    assert!(years[0] < years[1] && years[2] < years[1], "the clock did not jump: {years:?}");
    for id in [&running, &limited] {
        assert_eq!(service.post(&format!("/v1/jobs/{id}/cancel"), &json!({})).status / 100, 2);
        assert_eq!(service.ended(id)["state"], "cancelled");
    }
    assert_eq!(service.done(&small(9))["state"], "succeeded");
}
