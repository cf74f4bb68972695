//! Batches: several jobs that are accepted together, at one process and at several, and by the command line.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use lacuna_tests::support::binary::lacuna;
use lacuna_tests::support::cases::{long_job, model};
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::{Answer, Service, until, view};
use lacuna_tests::support::stage::Stage;
use serde_json::{Value, json};

/// How long anything may take that takes a moment on an idle machine.
const PATIENCE: Duration = Duration::from_secs(90);

const MANY: [(&str, &str); 3] =
    [("LACUNA_SUBMISSIONS_PER_MINUTE", "1000000"), ("LACUNA_QUEUED", "100000"), ("LACUNA_JOBS_PER_KEY", "100000")];

/// A small solid, another one for every number.
fn solid(number: u32) -> Value {
    json!({ "lacuna": 1, "kind": "solidify", "model": model("meshes/segment"), "outputs": ["stl"],
        "params": { "tolerance_mm": 0.05, "radius_mm": 1.0 + f64::from(number) / 64.0 } })
}

/// The work of a moment, another one for every number.
fn small(number: u32) -> Value {
    json!({ "lacuna": 1, "kind": "measure", "model": model("meshes/segment"), "params": { "tolerance_mm": 0.1 + f64::from(number) / 1e6 } })
}

/// A solid that ends with its limit of triangles: a thick one, of a single block, so that it is refused in the same words by any number of threads.
fn beyond() -> Value {
    let mut order = solid(999);
    order["limits"] = json!({ "triangles": 10 });
    order
}

fn batch(jobs: impl IntoIterator<Item = Value>) -> Value {
    let jobs: Vec<Value> = jobs.into_iter().map(|job| json!({ "job": job })).collect();
    json!({ "lacuna": 1, "jobs": jobs })
}

#[track_caller]
fn accepted(answer: &Answer) -> String {
    assert!(matches!(answer.status, 200 | 202), "{}: {}", answer.status, answer.json());
    let id = answer.json()["id"].as_str().unwrap().to_owned();
    assert_eq!(answer.header("location"), format!("/v1/batches/{id}"));
    id
}

#[track_caller]
fn submit(service: &Service, batch: &Value) -> String {
    accepted(&service.post("/v1/batches", batch))
}

fn shown(service: &Service, id: &str) -> Value {
    let answer = service.get(&format!("/v1/batches/{id}"));
    assert_eq!(answer.status, 200, "{}", answer.json());
    answer.json()
}

fn ended(service: &Service, id: &str) -> Value {
    until(PATIENCE, "the end of a batch", || shown(service, id)["finished"].is_string());
    shown(service, id)
}

fn states(view: &Value) -> Vec<&str> {
    view["jobs"].as_array().unwrap().iter().map(|row| row["state"].as_str().unwrap()).collect()
}

fn keyed(service: &Service, key: &str, batch: &Value) -> Answer {
    service.post_with("/v1/batches", &[("idempotency-key", key)], batch.to_string().as_bytes())
}

#[test]
fn some_jobs_may_fail_and_the_certificate_says_what_became_of_each() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let mut order = batch([solid(0), beyond(), solid(0), solid(1)]);
    for (index, name) in ["first", "too many", "the first again"].into_iter().enumerate() {
        order["jobs"][index]["name"] = json!(name);
    }
    let answer = service.post_with("/v1/batches", &[("prefer", "wait=30")], order.to_string().as_bytes());
    let id = accepted(&answer);
    let whole = ended(&service, &id);
    assert_eq!(states(&whole), ["succeeded", "failed", "succeeded", "succeeded"], "{whole}");
    assert_eq!((&whole["state"], &whole["fraction"]), (&json!("partly_succeeded"), &json!(1.0)));
    assert_eq!((&whole["counts"]["succeeded"], &whole["counts"]["failed"]), (&json!(3), &json!(1)));

    let certificate = service.get(&format!("/v1/batches/{id}/certificate"));
    assert_eq!((certificate.status, certificate.header("content-type")), (200, "application/json"));
    assert_eq!(certificate.body, service.get(&format!("/v1/batches/{id}/certificate")).body);
    let parent = certificate.json();
    assert_eq!((&parent["batch"], &parent["state"], &parent["counts"]), (&json!(id), &whole["state"], &whole["counts"]));
    let rows = parent["jobs"].as_array().unwrap();
    let names: Vec<&Value> = rows.iter().map(|row| &row["name"]).collect();
    assert_eq!(names, [&json!("first"), &json!("too many"), &json!("the first again"), &Value::Null]);
    for (index, row) in rows.iter().enumerate() {
        let job = view(&service, row["job"].as_str().unwrap());
        assert_eq!((&row["index"], &row["input_digest"], &job["batch"]), (&json!(index), &job["input_digest"], &json!(id)));
        let outputs: BTreeMap<&str, &Value> =
            job["outputs"].as_array().unwrap().iter().map(|output| (output["name"].as_str().unwrap(), &output["digest"])).collect();
        assert_eq!(row["output_digests"].as_object().map_or(0, serde_json::Map::len), outputs.len());
        for (name, digest) in outputs {
            assert_eq!(&row["output_digests"][name], digest);
            assert_eq!(service.get(&format!("/v1/results/{}", digest.as_str().unwrap())).status, 200);
        }
        if row["state"] == "succeeded" {
            for figure in ["achieved_bound_mm", "triangles", "genus", "mesh_volume_mm3"] {
                assert_eq!(row["figures"][figure], job["certificate"][figure], "{figure}");
            }
        } else {
            assert_eq!((&row["problem"], &row["problem"]["limit"]), (&job["problem"], &json!("triangles")), "{row}");
        }
    }
    // Equal work is done once.
    assert_eq!(rows[0]["output_digests"], rows[2]["output_digests"]);
    let again = accepted(&service.post("/v1/batches", &batch([solid(0), solid(1)])));
    let again = shown(&service, &again);
    assert_eq!((&again["state"], &again["jobs"][1]["output_digests"]), (&json!("succeeded"), &rows[3]["output_digests"]), "{again}");
}

#[test]
fn a_batch_is_refused_as_a_whole_with_the_places_of_all_faults() {
    let scratch = Scratch::new();
    let service = Service::start_with(
        scratch.path(),
        &[("LACUNA_JOBS_PER_KEY", "5"), ("LACUNA_WORKERS", "1"), ("LACUNA_SUBMISSIONS_PER_MINUTE", "40")],
    );
    let mut bad = batch([small(0), small(1), small(2), small(3)]);
    bad["jobs"][1]["job"]["params"]["tolerance_mm"] = json!(-1);
    bad["jobs"][2]["job"]["colour"] = json!("red");
    bad["jobs"][3]["job"]["supersedes"] = json!("job_1");
    let answer = service.post("/v1/batches", &bad);
    let problem = answer.json();
    let places: BTreeSet<&str> = problem["errors"].as_array().unwrap().iter().map(|error| error["pointer"].as_str().unwrap()).collect();
    assert_eq!(answer.status, 422, "{problem}");
    assert_eq!(places, ["/jobs/1/job/params/tolerance_mm", "/jobs/2/job/colour", "/jobs/3/job"].into(), "{problem}");

    // What only the service can tell has its place, too.
    let mut bad = batch([small(0), small(1), small(2)]);
    bad["jobs"][1]["job"] = json!({ "lacuna": 1, "kind": "measure", "model_ref": "mdl_none", "params": { "tolerance_mm": 1 } });
    bad["jobs"][2]["job"]["limits"] = json!({ "seconds": 1e9 });
    let problem = service.post("/v1/batches", &bad).json();
    let places: Vec<&str> = problem["errors"].as_array().unwrap().iter().map(|error| error["pointer"].as_str().unwrap()).collect();
    assert_eq!(places, ["/jobs/1/job/model_ref", "/jobs/2/job/limits/seconds"], "{problem}");

    let none = service.post("/v1/batches", &batch([]));
    let many = service.post("/v1/batches", &batch((0..101).map(small)));
    assert_eq!((none.status, many.status), (422, 422));
    assert!(many.json()["detail"].as_str().unwrap().contains("100"), "{}", many.json());
    let mut twice = batch([small(0), small(1)]);
    (twice["jobs"][0]["name"], twice["jobs"][1]["name"]) = (json!("a"), json!("a"));
    assert_eq!(service.post("/v1/batches", &twice).json()["errors"][0]["pointer"], "/jobs/1/name");

    // As many jobs count as there are: six never pass, four beside two pass later.
    let never = service.post("/v1/batches", &batch((0..6).map(long_job)));
    assert_eq!((never.status, never.header("retry-after")), (429, ""), "{}", never.json());
    let two = submit(&service, &batch((0..2).map(long_job)));
    let later = service.post("/v1/batches", &batch((2..6).map(long_job)));
    assert_eq!((later.status, later.header("retry-after")), (429, "5"), "{}", later.json());
    let ids: BTreeSet<String> = shown(&service, &two)["jobs"].as_array().unwrap().iter().map(|row| row["job"].to_string()).collect();
    let listed = service.get("/v1/jobs").json();
    let listed: BTreeSet<String> = listed["items"].as_array().unwrap().iter().map(|job| job["id"].to_string()).collect();
    assert_eq!(listed, ids, "nothing is left of what was refused");

    // As many submissions count, too.
    let limited = service.post("/v1/batches", &batch((0..41).map(small)));
    assert_eq!((limited.status, limited.json()["code"].as_str()), (429, Some("rate-limited")), "{}", limited.json());
    assert_eq!(limited.header("retry-after"), "", "{}", limited.json());
    assert_eq!(service.post(&format!("/v1/batches/{two}/cancel"), &json!({})).status / 100, 2);
}

#[test]
fn a_short_batch_that_names_a_long_model_a_hundred_times_is_refused() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &MANY);
    let corners: Vec<[u32; 3]> = (0..100_000).map(|place| [place, 7, 9]).collect();
    let faces: Vec<[u32; 2]> = (1..100_000).map(|place| [place - 1, place]).collect();
    let model = json!({ "lacuna": 1, "shape": { "family": "mesh", "vertices": corners, "faces": faces } });
    let stored = service.post("/v1/models", &model).json();
    let length = stored["bytes"].as_u64().unwrap();
    assert!((1 << 20..8 << 20).contains(&length), "{stored}");
    let job =
        |number: u32| json!({ "lacuna": 1, "kind": "measure", "model_ref": stored["id"], "params": { "tolerance_mm": f64::from(number) } });
    let refused = service.post("/v1/batches", &batch((1..=100).map(job)));
    let problem = refused.json();
    assert_eq!(
        (refused.status, &problem["code"], &problem["allowed"]),
        (422, &json!("limit.batch-bytes"), &json!(67_108_864.0)),
        "{problem}"
    );
    assert_eq!(service.get("/v1/jobs").json()["items"], json!([]));
    submit(&service, &batch((1..=5).map(job)));
}

#[test]
fn a_batch_is_stopped_and_forgotten_as_one() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_WORKERS", "1")]);
    let mut order = batch((0..4).map(long_job));
    order["jobs"].as_array_mut().unwrap().insert(0, json!({ "job": small(0) }));
    let id = submit(&service, &order);
    until(PATIENCE, "work", || states(&shown(&service, &id)).get(1) == Some(&"running"));
    assert_eq!(service.get(&format!("/v1/batches/{id}/certificate")).status, 409);
    let answer = service.post(&format!("/v1/batches/{id}/cancel"), &json!({}));
    assert!(matches!(answer.status, 200 | 202), "{}", answer.json());
    let view = ended(&service, &id);
    assert_eq!(states(&view), ["succeeded", "cancelled", "cancelled", "cancelled", "cancelled"], "{view}");
    assert_eq!(view["state"], "partly_succeeded");
    assert_eq!(service.post(&format!("/v1/batches/{id}/cancel"), &json!({})).status, 200, "again is the same");

    let job = view["jobs"][0]["job"].as_str().unwrap();
    let refused = service.delete(&format!("/v1/jobs/{job}"));
    assert_eq!((refused.status, refused.json()["code"].as_str()), (409, Some("job-of-batch")), "{}", refused.json());
    assert_eq!(service.delete(&format!("/v1/batches/{id}")).status, 204);
    assert_eq!((service.get(&format!("/v1/batches/{id}")).status, service.get(&format!("/v1/jobs/{job}")).status), (404, 404));
    assert_eq!(service.get("/v1/jobs").json()["items"], json!([]));
}

#[test]
fn rows_come_as_jobs_end() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_WORKERS", "2")]);
    let id = submit(&service, &batch((0..8).map(solid)));
    let address = format!("/v1/batches/{id}/events");
    let lines = service.get_with(&address, &[("accept", "application/x-ndjson")]);
    assert_eq!(lines.header("content-type"), "application/x-ndjson");
    let text = String::from_utf8(lines.body).unwrap();
    let rows: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let order: BTreeSet<u64> = rows.iter().map(|row| row["index"].as_u64().unwrap()).collect();
    assert_eq!((rows.len(), order.len()), (8, 8), "{text}");
    assert!(rows.iter().all(|row| row["state"] == "succeeded" && row["output_digests"]["stl"].is_string()), "{text}");
    let events = String::from_utf8(service.get(&address).body).unwrap();
    assert_eq!((events.matches("event: row\n").count(), events.matches("event: done\n").count()), (8, 1), "{events}");
    assert_eq!(service.get_with(&address, &[("accept", "image/png")]).status, 406);
}

#[test]
fn a_killed_service_loses_no_batch_and_does_nothing_twice() {
    let scratch = Scratch::new();
    let environment = [("LACUNA_WORKERS", "2"), MANY[0], MANY[1], MANY[2]];
    let service = Service::start_with(scratch.path(), &environment);
    let order = batch((0..100).map(solid));
    let first = keyed(&service, "k", &order);
    let id = accepted(&first);
    until(PATIENCE, "some jobs", || shown(&service, &id)["counts"]["succeeded"].as_u64().unwrap() >= 5);
    let before = shown(&service, &id);
    service.kill();

    let service = Service::start_with(scratch.path(), &environment);
    let again = keyed(&service, "k", &order);
    assert_eq!((accepted(&again), again.header("idempotency-replayed")), (id.clone(), "true"));
    assert_eq!(keyed(&service, "k", &batch([solid(0)])).status, 422);
    let after = ended(&service, &id);
    assert_eq!((&after["state"], &after["counts"]["succeeded"]), (&json!("succeeded"), &json!(100)), "{after}");
    let done = before["jobs"]
        .as_array()
        .unwrap()
        .iter()
        .zip(after["jobs"].as_array().unwrap())
        .filter(|(before, _)| before["state"] == "succeeded");
    let mut kept = 0;
    for (before, after) in done {
        assert_eq!(before, after);
        assert_eq!(view(&service, after["job"].as_str().unwrap())["attempt"], 1);
        kept += 1;
    }
    assert!(kept >= 5, "{kept}");
}

/// Every job that is there belongs to a batch that is there, and of every batch all jobs are there.
fn assert_whole(service: &Service, size: usize) -> usize {
    let mut jobs: BTreeMap<String, usize> = BTreeMap::new();
    let mut address = "/v1/jobs?limit=200".to_owned();
    loop {
        let page = service.get(&address).json();
        for job in page["items"].as_array().unwrap() {
            *jobs.entry(job["batch"].as_str().unwrap().to_owned()).or_default() += 1;
        }
        let Some(next) = page["next"].as_str() else { break };
        address = format!("/v1/jobs?limit=200&cursor={next}");
    }
    for (id, count) in &jobs {
        assert_eq!((*count, states(&shown(service, id)).len()), (size, size), "{id}");
    }
    jobs.len()
}

#[test]
fn a_service_killed_while_it_accepts_has_whole_batches_or_none() {
    const SIZE: u32 = 40;
    let scratch = Scratch::new();
    let environment = [("LACUNA_WORKERS", "1"), MANY[0], MANY[1], MANY[2]];
    let mut accepted = BTreeSet::new();
    for round in 0..6 {
        let service = Service::start_with(scratch.path(), &environment);
        assert!(assert_whole(&service, SIZE as usize) >= accepted.len());
        accepted.iter().for_each(|id: &String| assert_eq!(service.get(&format!("/v1/batches/{id}")).status, 200));
        // What was begun when the last one was killed ends first: a job whose worker goes twice is given up.
        accepted.iter().for_each(|id| drop(ended(&service, id)));
        let count = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            let (service_there, ids, count) = (&service, &mut accepted, &count);
            let sender = scope.spawn(move || {
                for number in 0.. {
                    let order = batch((0..SIZE).map(|job| small(round * 100_000 + number * SIZE + job)));
                    let Some(answer) = service_there.try_post("/v1/batches", &order) else { return };
                    ids.insert(self::accepted(&answer));
                    count.fetch_add(1, Ordering::SeqCst);
                }
            });
            until(PATIENCE, "two batches", || count.load(Ordering::SeqCst) >= 2);
            // Somewhere in the next one.
            std::thread::sleep(Duration::from_millis(u64::from(round) * 13));
            let _ = lacuna_tests::support::service::send_signal(service.id(), "KILL");
            sender.join().unwrap();
        });
        drop(service);
    }
    let service = Service::start_with(scratch.path(), &environment);
    let there = assert_whole(&service, SIZE as usize);
    assert!(there >= accepted.len());
    for id in &accepted {
        let view = ended(&service, id);
        assert_eq!(view["state"], "succeeded", "{view}");
    }
    eprintln!("killed 6 times while it accepted batches of {SIZE}: all {} accepted ones are there and have ended", accepted.len());
    assert!(accepted.len() >= 12, "{} accepted", accepted.len());
}

/// A batch whose jobs are too old to be kept, and then too old to be known.
fn assert_grows_old(start: impl Fn(&[(&str, &str)]) -> Service) {
    let order = batch([small(0), small(1)]);
    let service = start(&[]);
    let id = accepted(&keyed(&service, "k", &order));
    assert_eq!(ended(&service, &id)["state"], "succeeded");
    drop(service);
    let service = start(&[("LACUNA_RETENTION_HOURS", "0")]);
    until(PATIENCE, "expired jobs", || shown(&service, &id)["counts"]["expired"] == 2);
    assert_eq!(shown(&service, &id)["state"], "expired");
    let row = &shown(&service, &id)["jobs"][1];
    assert!(row["state"] == "expired" && row["output_digests"]["certificate.json"].is_string(), "{row}");
    let certificate = service.get(&format!("/v1/batches/{id}/certificate"));
    assert_eq!((certificate.status, certificate.json()["code"].as_str()), (410, Some("result-expired")), "{}", certificate.json());
    // The key is free for another.
    let other = accepted(&keyed(&service, "k", &batch([small(2)])));
    assert_ne!(other, id);
    assert_eq!(ended(&service, &other)["state"], "succeeded");
    drop(service);
    let service = start(&[("LACUNA_RETENTION_HOURS", "0"), ("LACUNA_EXPIRED_HOURS", "0")]);
    until(PATIENCE, "nothing of the batch", || service.get(&format!("/v1/batches/{id}")).status == 404);
}

#[test]
fn a_batch_expires_with_its_jobs() {
    let scratch = Scratch::new();
    assert_grows_old(|environment| Service::start_with(scratch.path(), environment));
    let Some(stage) = Stage::set() else { return };
    assert_grows_old(|environment| stage.start_with("all", "one", environment));
}

#[test]
fn several_processes_share_batches() {
    let Some(stage) = Stage::set() else { return };
    let start = |role: &str, name: &str| stage.start_with(role, name, &[MANY[1], MANY[2]]);
    let (first, second) = (start("front", "first"), start("front", "second"));
    let mut workers = vec![start("worker", "one"), start("worker", "two")];
    let order = batch((0..60).map(solid).chain([beyond(), solid(0)]));
    let id = accepted(&keyed(&first, "k", &order));
    let again = keyed(&second, "k", &order);
    assert_eq!((accepted(&again), again.header("idempotency-replayed")), (id.clone(), "true"));
    assert_eq!(keyed(&second, "k", &batch([solid(0)])).status, 422);
    // The front end that accepted it and a worker that is at it go without a word.
    until(PATIENCE, "some jobs", || shown(&second, &id)["counts"]["succeeded"].as_u64().unwrap() >= 3);
    first.kill();
    workers.remove(0).kill();
    let rows = second.get_with(&format!("/v1/batches/{id}/events"), &[("accept", "application/x-ndjson")]);
    assert_eq!(String::from_utf8(rows.body).unwrap().lines().count(), 62);
    let view = ended(&second, &id);
    assert_eq!((&view["state"], &view["counts"]["succeeded"]), (&json!("partly_succeeded"), &json!(61)), "{view}");
    assert_eq!(view["jobs"][0]["output_digests"], view["jobs"][61]["output_digests"]);
    let first = start("front", "first again");
    let certificate = first.get(&format!("/v1/batches/{id}/certificate"));
    assert_eq!((certificate.status, &certificate.body), (200, &second.get(&format!("/v1/batches/{id}/certificate")).body));

    // The same files as one process makes.
    let alone = Service::start_with(&stage.scratch.join("alone"), &MANY);
    let same = ended(&alone, &submit(&alone, &batch([solid(7)])));
    assert_eq!(same["jobs"][0]["output_digests"], view["jobs"][7]["output_digests"]);

    // Stopped and forgotten from elsewhere; what passes the room of a key is refused as a whole.
    let stopped = submit(&first, &batch((0..3).map(long_job)));
    until(PATIENCE, "work", || states(&shown(&second, &stopped)).contains(&"running"));
    assert_eq!(second.post(&format!("/v1/batches/{stopped}/cancel"), &json!({})).status / 100, 2);
    assert_eq!(ended(&first, &stopped)["state"], "cancelled");
    let small = stage.start_with("front", "small", &[("LACUNA_JOBS_PER_KEY", "2")]);
    assert_eq!(small.post("/v1/batches", &batch((10..13).map(long_job))).status, 429);
    assert_eq!(first.delete(&format!("/v1/batches/{stopped}")).status, 204);
    assert_eq!(second.get(&format!("/v1/batches/{stopped}")).status, 404);
    let listed = second.get("/v1/jobs?limit=200").json();
    assert_eq!(listed["items"].as_array().unwrap().len(), 62, "the first batch alone is left");
}

#[test]
fn a_database_of_the_version_before_is_taken_over_with_its_jobs() {
    let Some(stage) = Stage::set() else { return };
    let id = {
        let service = stage.start("all", "before");
        let job = service.done(&solid(0));
        job["id"].as_str().unwrap().to_owned()
    };
    let _ =
        stage.database.ask("DROP TABLE lacuna_turns; DROP SEQUENCE lacuna_turn; DROP TABLE lacuna_batches; ALTER TABLE lacuna_jobs DROP COLUMN batch; UPDATE lacuna_schema SET version = 1");
    let service = stage.start("all", "after");
    assert_eq!(view(&service, &id)["state"], "succeeded");
    let batch = ended(&service, &submit(&service, &batch([solid(0), solid(1)])));
    assert_eq!(batch["state"], "succeeded", "{batch}");
    assert_eq!(stage.database.ask("SELECT version FROM lacuna_schema").trim(), "3");
}

/// All files below a folder, by their places.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            found.extend(files(&path).into_iter().map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)));
        } else {
            found.insert(name, std::fs::read(path).unwrap());
        }
    }
    found
}

#[test]
fn the_command_line_runs_batches_here_as_at_a_service() {
    let scratch = Scratch::new();
    let service = Service::start(&scratch.join("data"));
    let url = format!("http://{}", service.address);
    let mut order = batch([solid(0), beyond(), small(0)]);
    order["jobs"][0]["name"] = json!("a rod");
    std::fs::write(scratch.join("batch.json"), order.to_string()).unwrap();
    let mut made = Vec::new();
    for (folder, server) in [("here", None), ("there", Some(&url))] {
        let mut command = Command::new(lacuna());
        command.env_remove("LACUNA_SERVER").current_dir(scratch.path());
        command.args(server.into_iter().flat_map(|url| ["--server", url])).args(["run", "batch.json", "-o", folder]);
        let output = command.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("1 of 3 jobs did not succeed: 1: "), "{said}");
        let told: Value = serde_json::from_slice(&output.stdout).unwrap();
        let mut files = files(&scratch.join(folder));
        let mut certificate: Value = serde_json::from_slice(&files.remove("certificate.json").unwrap()).unwrap();
        assert_eq!(told["certificate"], certificate);
        // A service has ids beside that, and knows its own words for where a fault is.
        certificate.as_object_mut().unwrap().remove("batch");
        for row in certificate["jobs"].as_array_mut().unwrap() {
            row.as_object_mut().unwrap().remove("job");
        }
        made.push((files, certificate));
    }
    let [(here, certificate), (there, other)] = <[_; 2]>::try_from(made).unwrap();
    assert_eq!(
        here.keys().map(String::as_str).collect::<Vec<_>>(),
        ["000-a-rod/certificate.json", "000-a-rod/segment.stl", "002/certificate.json"]
    );
    assert!(here == there, "the files differ");
    assert_eq!(certificate, other);

    let whole = batch([small(1), small(2)]);
    std::fs::write(scratch.join("batch.json"), whole.to_string()).unwrap();
    let output = Command::new(lacuna()).current_dir(scratch.path()).args(["run", "batch.json", "-o", "whole"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
