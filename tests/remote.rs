//! The command line at a service: the same files, certificates, words and exit codes as on this machine.

use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use lacuna_tests::support::binary::{lacuna, succeed};
use lacuna_tests::support::cases;
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::Service;
use serde_json::{Value, json};

fn command<I: IntoIterator<Item = S>, S: AsRef<OsStr>>(server: Option<&Service>, arguments: I) -> Command {
    let mut command = Command::new(lacuna());
    command.env_remove("LACUNA_SERVER").env_remove("LACUNA_API_KEY").args(arguments);
    if let Some(service) = server {
        command.env("LACUNA_SERVER", format!("http://{}", service.address));
    }
    command
}

fn run<I: IntoIterator<Item = S>, S: AsRef<OsStr>>(server: Option<&Service>, arguments: I) -> Output {
    command(server, arguments).output().unwrap()
}

fn words(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

const CUBE: &str = "OFF\n8 6 0\n0 0 0\n4 0 0\n0 4 0\n4 4 0\n0 0 4\n4 0 4\n0 4 4\n4 4 4\n4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n";

/// A command with files by their names: here, and at a service, each in a folder of its own; both must leave the same.
#[track_caller]
fn same(service: &Service, inputs: &[(&str, &[u8])], arguments: &[&str]) {
    let folders = [Scratch::new(), Scratch::new()];
    let mut outputs = Vec::new();
    for (folder, server) in folders.iter().zip([None, Some(service)]) {
        for (name, bytes) in inputs {
            std::fs::write(folder.join(name), bytes).unwrap();
        }
        let output = command(server, arguments).current_dir(folder.path()).output().unwrap();
        assert!(output.status.success(), "{arguments:?} ended with {}:\n{}", output.status, words(&output.stderr));
        outputs.push(output);
    }
    assert_eq!(words(&outputs[0].stdout), words(&outputs[1].stdout), "{arguments:?} says something else");
    assert_eq!(words(&outputs[0].stderr), words(&outputs[1].stderr), "{arguments:?}");
    let [here, there] = folders.each_ref().map(|folder| listing(folder.path()));
    assert_eq!(here.keys().collect::<Vec<_>>(), there.keys().collect::<Vec<_>>(), "{arguments:?}");
    for (name, bytes) in &here {
        assert!(bytes == &there[name], "{arguments:?}: {name} differs");
    }
}

/// A command that is refused, here as at a service, in the same words.
#[track_caller]
fn same_refusal(inputs: &[(&str, &[u8])], service: &Service, arguments: &[&str]) {
    let folder = Scratch::new();
    for (name, bytes) in inputs {
        std::fs::write(folder.join(name), bytes).unwrap();
    }
    let [here, there] = [None, Some(service)].map(|server| command(server, arguments).current_dir(folder.path()).output().unwrap());
    assert!(!here.status.success(), "{arguments:?}");
    assert_eq!((here.status.code(), words(&here.stderr)), (there.status.code(), words(&there.stderr)), "{arguments:?}");
}

fn listing(folder: &Path) -> std::collections::BTreeMap<String, Vec<u8>> {
    let mut files = std::collections::BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            files.extend(listing(&path).into_iter().map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)));
        } else {
            files.insert(name, std::fs::read(path).unwrap());
        }
    }
    files
}

#[test]
fn every_kind_of_work_is_the_same_at_a_service() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let segment = std::fs::read(cases::named("meshes/segment").model()).unwrap();
    let model: Value = serde_json::from_slice(&segment).unwrap();
    let segment = &[("segment.json", segment.as_slice())];
    let solidify =
        ["solidify", "segment.json", "--tolerance", "0.05", "--radius", "1", "-o", "a.3mf", "-o", "b.stl", "--certificate", "c.json"];
    same(&service, segment, &solidify);
    same(&service, segment, &["evaluate", "segment.json", "--tolerance", "0.05", "-o", "a.obj", "--certificate", "c.json"]);
    same(&service, segment, &["measure", "segment.json", "--tolerance", "0.05", "--radius", "1", "--density", "8.9"]);
    same(&service, segment, &["validate", "segment.json"]);
    let classic = succeed(["library", "koch_curve"]);
    let koch: &[(&str, &[u8])] = &[("koch.json", &classic)];
    same(&service, koch, &["address", "koch.json", "--at", "0: 1 (0 1)"]);
    same(&service, koch, &["address", "koch.json", "--near", "10,5,0", "--within", "2", "--tolerance", "0.1", "--most", "7"]);
    let open = std::fs::read(cases::named("bcifs/free_corner_cutting").model()).unwrap();
    let open: &[(&str, &[u8])] = &[("open.json", &open)];
    same(&service, open, &["solve", "open.json", "--set", "a=0.375", "-o", "filled.json"]);
    same(&service, open, &["solve", "open.json", "--json"]);
    for (model, arguments) in [(open, &["solve", "open.json", "--set", "nobody=1"][..]), (koch, &["address", "koch.json", "--at", "7:"])] {
        same_refusal(model, &service, arguments);
    }

    let meshes: &[(&str, &[u8])] = &[("cube.off", CUBE.as_bytes()), segment[0]];
    let bore =
        ["intersect", "cube.off", "segment.json", "--operation", "difference", "--radius", "0", "--radius", "1", "--tolerance", "0.05"];
    same(&service, meshes, &[&bore[..], &["-o", "bored.3mf", "--certificate", "c.json"]].concat());
    same(&service, meshes, &["intersect", "cube.off", "--with", "point:9,0,0", "--tolerance", "0.01"]);
    same(&service, meshes, &["slice", "cube.off", "--tolerance", "0.01", "--step", "1", "-o", "a.svg", "-o", "a.dxf"]);
    same(&service, meshes, &["convert", "--quiet", "cube.off", "a.stl"]);
    same(&service, meshes, &["measure", "cube.off", "--tolerance", "0.01", "--thickness", "--map", "a.ply"]);

    // A job document, one that names a mesh file of its folder, and a limit from the command line.
    let job = json!({ "lacuna": 1, "kind": "solidify", "model": model, "params": { "tolerance_mm": 0.05, "radius_mm": 1.0 }, "outputs": ["stl"] });
    let job = job.to_string();
    same(&service, &[("job.json", job.as_bytes())], &["plan", "job.json"]);
    let shape = json!({ "lacuna": 1, "name": "from a file", "shape": { "family": "mesh", "file": "cube.off" } });
    let filed =
        json!({ "lacuna": 1, "kind": "evaluate", "model": shape, "params": { "tolerance_mm": 0.05 }, "outputs": ["ply"] }).to_string();
    let (shape, files) = (shape.to_string(), [("cube.off", CUBE.as_bytes())]);
    same(&service, &[files[0], ("shape.json", shape.as_bytes())], &["validate", "shape.json"]);
    for (inputs, limits) in
        [(vec![("job.json", job.as_bytes())], vec![]), (vec![files[0], ("job.json", filed.as_bytes())], vec!["--limit-seconds", "60"])]
    {
        same(&service, &inputs, &[&["run", "job.json", "-o", "made"][..], &limits].concat());
    }
}

#[test]
fn progress_is_told_as_on_this_machine() {
    let scratch = Scratch::new();
    let service = Service::start(&scratch.join("data"));
    let model = cases::named("ifs/sierpinski_tetrahedron").model();
    let file = scratch.join("part.stl");
    let words = ["solidify", "--progress", "json", "--tolerance", "0.33", "--radius", "2", "-o"].map(OsStr::new);
    let output = run(Some(&service), words.into_iter().chain([file.as_os_str(), model.as_os_str()]));
    assert!(output.status.success(), "{}", self::words(&output.stderr));
    let told = self::words(&output.stderr);
    let steps: Vec<Value> = told.lines().filter(|line| line.starts_with('{')).map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(steps.iter().any(|step| step["phase"] == "dilate"), "{told}");
    assert!(file.exists());
}

#[test]
fn refusals_have_the_exit_codes_of_this_machine() {
    let scratch = Scratch::new();
    let service = Service::start_with(&scratch.join("data"), &[("LACUNA_API_KEYS", "the-key")]);
    let model = cases::named("meshes/segment").model();
    let (out, bad, job) = (scratch.join("part.obj"), scratch.join("bad.json"), scratch.join("job.json"));
    std::fs::write(&bad, r#"{"lacuna": 1, "shape": {"family": "mesh", "vertices": [[0, 0, 0]], "faces": [[0, 3]]}}"#).unwrap();
    let order = json!({ "lacuna": 1, "kind": "solidify", "model": { "lacuna": 1, "shape": { "family": "mesh", "vertices": [[0, 0, 0]], "faces": [[0]] } },
        "params": { "tolerance_mm": 0.1 } });
    std::fs::write(&job, order.to_string()).unwrap();
    let (model, out, bad, job) = (model.to_str().unwrap(), out.to_str().unwrap(), bad.to_str().unwrap(), job.to_str().unwrap());
    let made = scratch.join("made");
    let evaluate = ["evaluate", model, "--tolerance", "0.1", "-o", out];
    let solidify = ["solidify", model, "--tolerance", "0.001", "--radius", "1", "--limit-triangles", "10", "-o", out];
    for (code, key, arguments, named) in [
        (5, "", &evaluate[..], "Authorization"),
        (5, "another", &evaluate, "key"),
        (4, "the-key", &solidify, "triangles"),
        (3, "the-key", &["evaluate", bad, "--tolerance", "0.1", "-o", out], "faces"),
        (3, "the-key", &["run", job, "-o", made.to_str().unwrap()], "radius_mm"),
        (3, "the-key", &["validate", bad], "not a valid model"),
        (2, "the-key", &["evaluate", model, "--tolerance", "0.1", "--threads", "2", "-o", out], "--threads"),
        (2, "the-key", &["--server", "ftp://127.0.0.1:1", "evaluate", model, "--tolerance", "0.1", "-o", out], "no address of a service"),
        (5, "the-key", &["--server", "http://127.0.0.1:9", "evaluate", model, "--tolerance", "0.1", "-o", out], "127.0.0.1:9"),
        (6, "the-key", &["jobs", "show", "job_none"], "job_none"),
        (3, "the-key", &["jobs", "submit", bad], "kind"),
    ] {
        let output = command(Some(&service), arguments).env("LACUNA_API_KEY", key).output().unwrap();
        let said = words(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
        assert!(said.contains(named), "{arguments:?}: {said} does not name {named:?}");
        assert!(!Path::new(out).exists() && !made.exists(), "{arguments:?} left something");
    }
    let output = command(Some(&service), evaluate).env("LACUNA_API_KEY", "the-key").output().unwrap();
    assert!(output.status.success(), "{}", words(&output.stderr));
    // --local works here, whatever the environment says.
    assert!(run(Some(&service), ["--local", "evaluate", model, "--tolerance", "0.1", "-o", out]).status.success());
}

/// A file with a job for minutes.
fn long(scratch: &Scratch) -> std::path::PathBuf {
    let path = scratch.join("long.json");
    std::fs::write(&path, cases::long_job(0).to_string()).unwrap();
    path
}

#[test]
#[cfg(unix)]
fn ctrl_c_stops_the_job_first() {
    let scratch = Scratch::new();
    let service = Service::start(&scratch.join("data"));
    let (job, made) = (long(&scratch), scratch.join("made"));
    let mut process = command(Some(&service), ["run".as_ref(), job.as_os_str(), "-o".as_ref(), made.as_os_str()])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let start = Instant::now();
    let jobs = || service.get("/v1/jobs").json()["items"].as_array().unwrap().clone();
    while jobs().first().is_none_or(|job| job["state"] != "running") {
        assert!(start.elapsed() < Duration::from_secs(60), "no job runs");
        std::thread::sleep(Duration::from_millis(20));
    }
    // A moment for the command to hear of its job.
    std::thread::sleep(Duration::from_millis(500));
    let sent = Command::new("kill").args(["-INT", &process.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let ended = process.wait().unwrap();
    assert_eq!(ended.code(), Some(130));
    assert_eq!(jobs()[0]["state"], "cancelled");
    assert!(!made.exists());
}

/// A terminal that is closed stops what runs in it, and nothing half written stays; what shall outlive it does.
#[test]
#[cfg(target_os = "linux")]
fn a_closed_terminal_stops_a_command() {
    let scratch = Scratch::new();
    let job = long(&scratch);
    // Whoever runs the tests may have them ignore the signal, which processes inherit.
    for (outlives, hearing) in [(false, "--default-signal=HUP"), (true, "--ignore-signal=HUP")] {
        let made = scratch.join("made");
        let mut command = Command::new("env");
        command.arg(hearing).arg(lacuna()).arg("run").arg(&job).arg("-o").arg(&made);
        let mut process = command.stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(1500));
        assert!(process.try_wait().unwrap().is_none(), "the job is too short for this test");
        let send = |signal: &str| assert!(Command::new("kill").args([signal, &process.id().to_string()]).status().unwrap().success());
        send("-HUP");
        if outlives {
            std::thread::sleep(Duration::from_millis(1500));
            assert!(process.try_wait().unwrap().is_none(), "it was to outlive its terminal");
            assert!(Command::new("kill").args(["-TERM", &process.id().to_string()]).status().unwrap().success());
        }
        assert_eq!(process.wait().unwrap().code(), Some(130));
        assert!(std::fs::read_dir(&made).map_or(0, |left| left.count()) == 0, "half a file is left");
    }
}

#[test]
fn jobs_one_step_at_a_time() {
    let scratch = Scratch::new();
    let service = Service::start(&scratch.join("data"));
    let json_of = |arguments: &[&str]| -> Value {
        let output = run(Some(&service), arguments);
        assert!(output.status.success(), "{arguments:?}: {}", words(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let long = long(&scratch);
    let long = json_of(&["jobs", "submit", long.to_str().unwrap(), "--idempotency-key", "one"]);
    let long = long["id"].as_str().unwrap();
    let model: Value = serde_json::from_slice(&std::fs::read(cases::named("meshes/segment").model()).unwrap()).unwrap();
    let job = json!({ "lacuna": 1, "kind": "solidify", "model": model, "params": { "tolerance_mm": 0.05, "radius_mm": 1.0 }, "outputs": ["stl"] });
    let file = scratch.join("job.json");
    std::fs::write(&file, job.to_string()).unwrap();
    let view = json_of(&["jobs", "submit", file.to_str().unwrap()]);
    let id = view["id"].as_str().unwrap();

    let watched = run(Some(&service), ["jobs", "watch", id]);
    assert!(watched.status.success(), "{}", words(&watched.stderr));
    let events: Vec<Value> = words(&watched.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(events.last().unwrap()["event"], "done");
    assert!(events.iter().any(|event| event["event"] == "output" && event["data"]["name"] == "stl"), "{events:?}");
    assert_eq!(json_of(&["jobs", "show", id])["state"], "succeeded");
    let listed = json_of(&["jobs", "list", "--kind", "solidify", "--limit", "1"]);
    assert_eq!((&listed["items"][0]["id"], listed["next"].is_string()), (&json!(id), true), "{listed}");

    let not_yet = run(Some(&service), ["jobs", "fetch", long, "-o", scratch.join("none").to_str().unwrap()]);
    assert_eq!(not_yet.status.code(), Some(5), "{}", words(&not_yet.stderr));
    let cancelled = json_of(&["jobs", "cancel", long]);
    assert!(matches!(cancelled["state"].as_str(), Some("cancelling" | "cancelled")), "{cancelled}");
    assert_eq!(run(Some(&service), ["jobs", "watch", long]).status.code(), Some(130));

    // A fetch that broke off is taken up; what does not belong there shows by its digest, and the next call begins again.
    let stl = &json_of(&["jobs", "show", id])["outputs"][0];
    let bytes = service.get(&format!("/v1/results/{}", stl["digest"].as_str().unwrap())).body;
    let folder = scratch.join("files");
    std::fs::create_dir(&folder).unwrap();
    let part = folder.join(format!(".{}.lacuna-part", stl["digest"].as_str().unwrap().trim_start_matches("sha256:")));
    let fetch = ["jobs", "fetch", id, "--only", "stl", "-o", folder.to_str().unwrap()];
    std::fs::write(&part, &bytes[..bytes.len() / 2]).unwrap();
    let fetched = json_of(&fetch);
    assert_eq!((fetched.as_array().unwrap().len(), &fetched[0]["digest"]), (1, &stl["digest"]));
    let target = folder.join(stl["file_name"].as_str().unwrap());
    assert!(std::fs::read(&target).unwrap() == bytes && !part.exists());
    std::fs::write(&part, vec![7; 100]).unwrap();
    std::fs::remove_file(&target).unwrap();
    let damaged = run(Some(&service), fetch);
    assert_eq!(damaged.status.code(), Some(6), "{}", words(&damaged.stderr));
    assert!(words(&damaged.stderr).contains("download.digest") && !target.exists());
    json_of(&fetch);
    assert!(std::fs::read(&target).unwrap() == bytes);
    // Everything, the certificate among it.
    assert_eq!(json_of(&["jobs", "fetch", id, "-o", folder.to_str().unwrap()]).as_array().unwrap().len(), 2);
}
