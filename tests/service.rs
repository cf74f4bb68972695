//! The running service, over TCP, as clients meet it.

use std::collections::BTreeSet;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};

use lacuna_tests::support::binary::{run, succeed};
use lacuna_tests::support::cases::{self, long_job, model};
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::{Answer, Service, submit};
use serde_json::{Value, json};

/// A small solid.
fn order() -> Value {
    json!({ "lacuna": 1, "kind": "solidify", "model": model("meshes/segment"), "params": { "tolerance_mm": 0.05, "radius_mm": 1.0 },
        "outputs": ["stl", "3mf"] })
}

/// A problem document of a status, whose words name something, and after which the service still works.
#[track_caller]
fn assert_problem(service: &Service, answer: &Answer, statuses: &[u16], named: &str) {
    assert!(statuses.contains(&answer.status), "{}: {}", answer.status, String::from_utf8_lossy(&answer.body));
    assert_eq!(answer.header("content-type").split(';').next(), Some("application/problem+json"));
    let problem = answer.json();
    assert_eq!(problem["status"], answer.status);
    for member in ["type", "title", "detail", "code"] {
        assert!(problem[member].as_str().is_some_and(|words| !words.is_empty()), "{problem} has no {member}");
    }
    assert!(problem.to_string().contains(named), "{problem} does not name {named:?}");
    assert_eq!(service.get("/readyz").status, 200);
}

#[test]
fn a_job_from_order_to_files() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let answer = service.post_with("/v1/jobs", &[("prefer", "wait=30")], order().to_string().as_bytes());
    assert_eq!(answer.status, 200, "{}", answer.json());
    let view = answer.json();
    let id = view["id"].as_str().unwrap();
    assert_eq!(answer.header("location"), format!("/v1/jobs/{id}"));
    assert_eq!(view["state"], "succeeded", "{view}");
    assert_eq!((&view["certificate"]["components"], &view["certificate"]["genus"]), (&json!(1), &json!(0)));

    let outputs = view["outputs"].as_array().unwrap();
    let names: BTreeSet<&str> = outputs.iter().map(|output| output["name"].as_str().unwrap()).collect();
    assert!(names.is_superset(&["stl", "3mf"].into()), "{names:?}");
    for output in outputs {
        let (name, digest) = (output["name"].as_str().unwrap(), output["digest"].as_str().unwrap());
        let pointer = service.get(&format!("/v1/jobs/{id}/outputs/{name}"));
        assert_eq!((pointer.status, pointer.header("location")), (303, format!("/v1/results/{digest}").as_str()));
        let bytes = service.get(&format!("/v1/results/{digest}"));
        assert_eq!(bytes.status, 200);
        assert_eq!(bytes.body.len() as u64, output["bytes"].as_u64().unwrap());
        assert_eq!(format!("sha256:{}", sha256(&bytes.body)), digest, "{name} is not what its digest says");
        assert_eq!(service.get(&format!("/v1/jobs/{id}/outputs/{name}?redirect=0")).body, bytes.body);
        let part = service.get_with(&format!("/v1/results/{digest}"), &[("range", "bytes=10-19")]);
        assert_eq!((part.status, part.body.as_slice()), (206, &bytes.body[10..20]));
    }
}

/// Digest by the system's own program: the service's is not asked about itself.
fn sha256(bytes: &[u8]) -> String {
    let scratch = Scratch::new();
    let file = scratch.join("bytes");
    std::fs::write(&file, bytes).unwrap();
    let output = std::process::Command::new("sha256sum").arg(&file).output().unwrap();
    String::from_utf8(output.stdout).unwrap().split(' ').next().unwrap().to_owned()
}

#[test]
fn the_service_and_the_command_give_the_same_bytes() {
    let scratch = Scratch::new();
    let service = Service::start(&scratch.join("data"));
    let view = service.done(&order());
    let file = scratch.join("segment.stl");
    let arguments = ["--tolerance", "0.05", "--radius", "1", "-o"];
    let model = cases::named("meshes/segment").model();
    let all = ["solidify".as_ref(), model.as_os_str()].into_iter().chain(arguments.iter().map(AsRef::as_ref)).chain([file.as_os_str()]);
    succeed(all);
    let id = view["id"].as_str().unwrap();
    assert!(service.get(&format!("/v1/jobs/{id}/outputs/stl?redirect=0")).body == std::fs::read(file).unwrap());
}

#[test]
fn equal_orders_share_their_results() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let (first, second) = (service.done(&order()), service.done(&order()));
    assert_ne!(first["id"], second["id"]);
    assert_eq!((&first["outputs"], &first["input_digest"]), (&second["outputs"], &second["input_digest"]));
    assert_eq!(second["reused"], true, "{second}");
}

/// Asks one process for a solid, and others for the same with limits.
pub(crate) fn limits_hold_though_the_work_is_done(first: &Service, others: &Service) {
    let made = first.done(&order());
    let plan = first.post("/v1/plan", &order()).json();
    let limited = |limits: Value| {
        let mut order = order();
        order["limits"] = limits;
        others.ended(&submit(others, &order))
    };
    // Fewer than the lattice has, but not so few that the job is refused by its plan.
    let few = (0.7 * plan["counted_triangles"].as_f64().unwrap()).floor();
    let refused = limited(json!({ "triangles": few as u64 }));
    assert_eq!((&refused["state"], &refused["problem"]["limit"]), (&json!("failed"), &json!("triangles")), "{refused}");
    assert_eq!((&refused["problem"]["allowed"], &refused["reused"], &refused["attempt"]), (&json!(few), &json!(false), &json!(1)));
    // What is done takes no time.
    let soon = limited(json!({ "seconds": 1e-6 }));
    assert_eq!((&soon["state"], &soon["reused"], &soon["outputs"]), (&json!("succeeded"), &json!(true), &made["outputs"]), "{soon}");
    // Whatever the limits: the same is meant, and where there is a result it is the same.
    let enough = limited(json!({ "triangles": 1_000_000 }));
    assert_eq!((&enough["outputs"], &enough["input_digest"]), (&made["outputs"], &made["input_digest"]), "{enough}");
    assert_eq!(refused["input_digest"], made["input_digest"]);
}

#[test]
fn limits_hold_though_the_work_is_done_in_one_process() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    limits_hold_though_the_work_is_done(&service, &service);
}

#[test]
fn an_idempotency_key_makes_a_repeated_order_one_job() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let send = |order: &Value| service.post_with("/v1/jobs", &[("idempotency-key", "order 7")], order.to_string().as_bytes());
    let (first, second) = (send(&order()), send(&order()));
    assert_eq!(first.json()["id"], second.json()["id"]);
    let mut other = order();
    other["params"]["radius_mm"] = json!(2.0);
    assert_problem(&service, &send(&other), &[409, 422], "idempotency");
}

#[test]
fn faults_of_a_document_are_named_all_at_once() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let mut bad = order();
    bad["colour"] = json!("red");
    bad["params"]["tolerance_mm"] = json!(-1);
    bad["model"]["shape"]["faces"] = json!([[0, 7]]);
    let answer = service.post("/v1/jobs", &bad);
    assert_problem(&service, &answer, &[422], "/colour");
    let words = answer.json()["errors"].to_string();
    for pointer in ["/params/tolerance_mm", "/model/shape/faces/0"] {
        assert!(words.contains(pointer), "{words} does not name {pointer}");
    }
}

#[test]
fn values_that_are_no_lengths_are_refused() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    for value in [json!(0), json!(-1), json!("1"), json!(null), json!([1]), json!(5e-324), json!(1e308)] {
        for name in ["tolerance_mm", "radius_mm"] {
            if name == "tolerance_mm" && value == json!(1e308) {
                continue; // a bound that is easily kept
            }
            let mut bad = order();
            bad["params"][name] = value.clone();
            let answer = service.post_with("/v1/jobs", &[("prefer", "wait=10")], bad.to_string().as_bytes());
            assert_problem(&service, &answer, &[422], name);
        }
    }
    let text = order().to_string().replace("0.05", "1e999");
    assert_problem(&service, &service.post_with("/v1/jobs", &[], text.as_bytes()), &[400, 422], "");
}

#[test]
fn what_is_not_json_is_refused() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let deep = "[".repeat(200_000);
    for body in ["", "{", "nonsense", "{\"lacuna\": 1,}", "{\"lacuna\": 1} x", "\u{feff}{}", deep.as_str()] {
        assert_problem(&service, &service.post_with("/v1/jobs", &[], body.as_bytes()), &[400, 422], "");
    }
    assert_problem(&service, &service.post_with("/v1/jobs", &[], b"{\"lacuna\": 1, \"kind\": \"\xff\"}"), &[400, 422], "");
    assert_problem(&service, &service.post_with("/v1/jobs", &[], br#"{"lacuna": 1, "lacuna": 1}"#), &[400, 422], "lacuna");
    for body in ["null", "[]", "7", "{}", "{\"lacuna\": 2}"] {
        assert_problem(&service, &service.post_with("/v1/jobs", &[], body.as_bytes()), &[422], "");
    }
}

#[test]
fn deep_nesting_in_a_document_is_refused() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let mut shape = String::from(r#"{"family": "mesh", "vertices": [[0, 0, 0]], "faces": [[0]]}"#);
    for _ in 0..5000 {
        shape = format!(r#"{{"family": "group", "parts": [{{"shape": {shape}}}]}}"#);
    }
    let body =
        format!(r#"{{"lacuna": 1, "kind": "measure", "model": {{"lacuna": 1, "shape": {shape}}}, "params": {{"tolerance_mm": 1}}}}"#);
    assert_problem(&service, &service.post_with("/v1/jobs", &[], body.as_bytes()), &[400, 422], "");
}

#[test]
fn a_body_of_100_megabytes_is_refused_without_being_kept() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let before = service.resident_bytes();
    let length = 100 << 20;
    let head = format!("POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: {length}\r\n\r\n");
    let mut stream = TcpStream::connect(service.address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    stream.write_all(head.as_bytes()).unwrap();
    let block = vec![b' '; 1 << 20];
    for _ in 0..100 {
        if stream.write_all(&block).is_err() {
            break; // it has answered and closed
        }
    }
    let mut answer = [0u8; 16];
    // A connection reset after the refusal may swallow its words; memory and the next request still count.
    if stream.read(&mut answer).is_ok_and(|count| count == answer.len()) {
        assert!(answer.starts_with(b"HTTP/1.1 413"), "{}", String::from_utf8_lossy(&answer));
    }
    assert_eq!(service.get("/readyz").status, 200);
    let grown = service.resident_bytes().saturating_sub(before);
    assert!(grown < 100 << 20, "the service has grown by {grown} bytes");
}

#[test]
fn a_truncated_upload_ends_without_a_job() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let body = order().to_string();
    let head =
        format!("POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: {}\r\n\r\n", body.len());
    let answer = service.raw((head + &body[..body.len() / 2]).as_bytes(), Duration::from_secs(10));
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 4"), "{answer}");
    assert_eq!(service.get("/v1/jobs").json()["items"], json!([]));
}

#[test]
fn what_is_not_http_does_no_harm() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    for bytes in [&b"\x16\x03\x01\x02\x00\x01\x00"[..], b"GET\r\n\r\n", b"\0\0\0\0", b"GET /v1/jobs HTTP/9.9\r\n\r\n"] {
        let answer = service.raw(bytes, Duration::from_secs(15));
        assert!(!answer.contains(" 200 "), "{answer}");
        assert_eq!(service.get("/readyz").status, 200);
    }
}

#[test]
fn what_is_not_there_is_a_problem_too() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    for path in
        ["/v1/jobs/none", "/v1/jobs/none/outputs/stl", "/v1/results/sha256:00", "/v1/models/none", "/v1/nothing", "/v1/jobs/..%2f..%2fetc"]
    {
        assert_problem(&service, &service.get(path), &[404], "");
    }
    assert_problem(&service, &service.delete("/v1/capabilities"), &[405], "");
    let answer = service.post_with("/v1/jobs", &[("content-type", "text/csv")], b"1,2");
    assert!((400..500).contains(&answer.status), "{}", answer.status);
}

#[test]
fn a_job_can_be_stopped() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let accepted = service.post("/v1/jobs", &long_job(0));
    assert_eq!(accepted.status, 202, "{}", accepted.json());
    let id = accepted.json()["id"].as_str().unwrap().to_owned();
    std::thread::sleep(Duration::from_millis(300));
    let stopped = Instant::now();
    let answer = service.post(&format!("/v1/jobs/{id}/cancel"), &json!({}));
    assert!(answer.status == 200 || answer.status == 202, "{}", answer.status);
    let view = service.ended(&id);
    assert_eq!(view["state"], "cancelled", "{view}");
    assert!(stopped.elapsed() < Duration::from_secs(3), "it took {:?}", stopped.elapsed());
    // Stopping again changes nothing; forgetting forgets.
    assert_eq!(service.post(&format!("/v1/jobs/{id}/cancel"), &json!({})).status, 200);
    assert_eq!(service.delete(&format!("/v1/jobs/{id}")).status, 204);
    assert_eq!(service.get(&format!("/v1/jobs/{id}")).status, 404);
}

#[test]
fn a_time_limit_is_kept() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let mut order = long_job(0);
    order["limits"]["seconds"] = json!(1);
    let start = Instant::now();
    let view = service.done(&order);
    assert_eq!(view["state"], "failed", "{view}");
    assert!(view["problem"]["code"].as_str().unwrap().contains("limit"), "{view}");
    // Unlimited, the job takes minutes; how soon it stops is for a benchmark to say, on a machine of its own.
    assert!(start.elapsed() < Duration::from_secs(60), "it took {:?}", start.elapsed());
}

#[test]
fn results_and_waiting_jobs_outlive_a_power_failure() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_WORKERS", "1")]);
    let done = service.done(&order());
    let running = service.post("/v1/jobs", &long_job(0)).json()["id"].as_str().unwrap().to_owned();
    let mut small = order();
    small["params"]["radius_mm"] = json!(2.0);
    let waiting = service.post("/v1/jobs", &small).json()["id"].as_str().unwrap().to_owned();
    std::thread::sleep(Duration::from_millis(200));
    service.kill();

    let again = Service::start_with(scratch.path(), &[("LACUNA_WORKERS", "1")]);
    let id = done["id"].as_str().unwrap();
    assert_eq!(again.get(&format!("/v1/jobs/{id}")).json()["outputs"], done["outputs"]);
    let digest = done["outputs"][0]["digest"].as_str().unwrap();
    assert_eq!(again.get(&format!("/v1/results/{digest}")).status, 200);
    let found = again.get(&format!("/v1/jobs/{running}")).json();
    assert!(matches!(found["state"].as_str(), Some("queued" | "running" | "failed")), "{found}");
    assert_eq!(again.post(&format!("/v1/jobs/{running}/cancel"), &json!({})).status / 100, 2);
    assert_eq!(again.ended(&waiting)["state"], "succeeded");
}

#[test]
fn keys_separate_their_owners() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_API_KEYS", "first-key,second-key")]);
    let send = |key: &str| service.post_with("/v1/jobs", &[("authorization", &format!("Bearer {key}"))], order().to_string().as_bytes());
    assert_eq!(service.post("/v1/jobs", &order()).status, 401);
    assert_eq!(send("third-key").status, 401);
    let accepted = send("first-key");
    assert_eq!(accepted.status / 100, 2, "{}", accepted.json());
    let path = format!("/v1/jobs/{}", accepted.json()["id"].as_str().unwrap());
    assert_eq!(service.get_with(&path, &[("authorization", "Bearer first-key")]).status, 200);
    assert_eq!(service.get_with(&path, &[("authorization", "Bearer second-key")]).status, 404);
    assert_eq!(service.get("/readyz").status, 200);
}

#[test]
fn a_public_address_without_keys_is_refused() {
    let scratch = Scratch::new();
    let output = run(["serve".as_ref(), "--bind".as_ref(), "0.0.0.0:0".as_ref(), "--data".as_ref(), scratch.path().as_os_str()]);
    assert!(!output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("LACUNA_API_KEYS"));
}

#[test]
fn health_is_told_to_whoever_asks() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let url = format!("http://{}", service.address);
    succeed(["healthcheck", "--url", &url]);
    service.kill();
    assert_eq!(run(["healthcheck", "--url", &url]).status.code(), Some(5));
}

#[test]
fn fifty_orders_at_once_all_end() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let send = |k: u32| {
        let mut order = order();
        // Ten different ones, five times each.
        order["params"]["radius_mm"] = json!(1.0 + f64::from(k % 10) * 0.1);
        let answer = service.post("/v1/jobs", &order);
        (answer.status, answer.json())
    };
    let send_all = |first: u32| (first..first + 10).map(send).collect::<Vec<_>>();
    let answers: Vec<(u16, Value)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..5).map(|t| scope.spawn(move || send_all(10 * t))).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    });
    // A full queue may refuse; then it says so.
    answers.iter().for_each(|(status, body)| assert!(matches!(status, 200 | 202 | 429), "{status} {body}"));
    let accepted = answers.iter().filter(|(status, _)| *status != 429);
    let ids: Vec<&str> = accepted.map(|(_, body)| body["id"].as_str().unwrap()).collect();
    assert!(ids.len() >= 30, "only {} were accepted", ids.len());
    for id in ids {
        assert_eq!(service.ended(id)["state"], "succeeded");
    }
}

#[test]
fn unknown_operators_are_solved_over_http() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let solve = |body: Value| service.post("/v1/solve", &body);
    let answer = solve(json!({ "model": model("bcifs/free_corner_cutting"), "values": { "a": 0.375, "b": 0.125 } }));
    assert_eq!(answer.status, 200, "{}", answer.json());
    let space = answer.json();
    assert_eq!((&space["degrees_of_freedom"], &space["method"]), (&json!(2), &json!("exact")));
    let entry = space["entries"].as_array().unwrap().iter().find(|e| e["pointer"] == "/shape/states/0/transitions/0/operator/1/1").unwrap();
    assert_eq!(entry["constant"], json!({ "exact": "1", "value": 1.0 }));
    assert_eq!(entry["coefficients"], json!({ "b": { "exact": "-1", "value": -1.0 } }));
    assert_eq!(entry["value"], 0.875);
    // what comes out is a model: nothing is unknown, and it can be evaluated
    let report = service.post("/v1/validate", &space["model"]).json();
    assert_eq!((&report["valid"], &report["degrees_of_freedom"]), (&json!(true), &json!(0)), "{report}");
    let evaluated = service.done(&json!({ "lacuna": 1, "kind": "evaluate", "model": space["model"], "params": { "tolerance_mm": 0.1 } }));
    assert_eq!(evaluated["state"], "succeeded");
    // the same of a stored model
    let id = service.post("/v1/models", &model("bcifs/free_corner_cutting")).json()["id"].clone();
    assert_eq!(solve(json!({ "model_ref": id })).json()["degrees_of_freedom"], 2);
}

#[test]
fn what_cannot_be_solved_is_a_problem_that_names_it() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let refused = |body: Value, status: u16, code: &str, pointers: &[&str]| {
        let answer = service.post("/v1/solve", &body);
        assert_problem(&service, &answer, &[status], code);
        let found: Vec<String> =
            answer.json()["errors"].as_array().into_iter().flatten().map(|e| e["pointer"].as_str().unwrap().to_owned()).collect();
        assert_eq!(found, pointers, "{}", answer.json());
    };
    let corner_cutting = || model("bcifs/free_corner_cutting");
    let conflict = ["/model/shape/adjacencies/0", "/model/shape/relations/0", "/model/shape/relations/1"];
    refused(json!({ "model": model("bcifs/free_contradiction") }), 422, "automaton.contradiction", &conflict);
    refused(json!({ "model": corner_cutting(), "values": { "a/b": 1.0 } }), 422, "solve.unknown-name", &["/values/a~1b"]);
    refused(json!({ "model": corner_cutting(), "values": { "a": "0.5" } }), 422, "document.number-as-string", &["/values/a"]);
    refused(json!({ "model": corner_cutting(), "values": null }), 422, "document.wrong-type", &["/values"]);
    refused(json!({ "model": corner_cutting(), "value": {} }), 422, "document.unknown-member", &["/value"]);
    refused(json!({ "values": {} }), 422, "document.missing-member", &[""]);
    refused(json!({ "model_ref": "none" }), 422, "job.unknown-model", &["/model_ref"]);
    refused(json!({ "model": model("meshes/segment") }), 422, "solve.no-operators", &[]);
    let text = json!({ "model": corner_cutting() }).to_string().replacen("null", "NaN", 1);
    assert_problem(&service, &service.post_with("/v1/solve", &[], text.as_bytes()), &[400, 422], "document.");
}

#[test]
fn a_hundred_thousand_unknowns_are_refused_at_once() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let rows = vec![vec![Value::Null; 317]; 317];
    let points: Vec<Value> = (0..317).map(|k| json!([k, 0, 0])).collect();
    let shape = json!({ "family": "bcifs", "cells": [{ "state": "s", "control_points": points }],
        "states": [{ "name": "s", "cell": "edge", "dimension": 317, "transitions": [{ "to": "s", "operator": rows }] }] });
    let start = Instant::now();
    let answer = service.post("/v1/solve", &json!({ "model": { "lacuna": 1, "shape": shape } }));
    assert_problem(&service, &answer, &[422], "limit-solve");
    assert_eq!(answer.json()["asked"], 317.0 * 317.0);
    let report = service.post("/v1/validate", &json!({ "lacuna": 1, "shape": shape }));
    assert_eq!((report.status, &report.json()["valid"]), (200, &json!(false)));
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
}

#[test]
fn every_malformed_document_is_refused_over_http() {
    let folder = cases::folder().join("malformed");
    if !folder.is_dir() {
        return;
    }
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_SUBMISSIONS_PER_MINUTE", "100000")]);
    for case in cases::all().iter().filter(|case| case.expected.refused.is_some()) {
        let body = std::fs::read(case.model()).unwrap();
        let answer = service.post_with("/v1/validate", &[], &body);
        assert!(answer.status < 500, "{}: {}", case.name, answer.status);
        let refused = answer.status >= 400 || answer.json()["valid"] == false || is_job_fault(&case.folder);
        assert!(refused, "{}: {}", case.name, String::from_utf8_lossy(&answer.body));
        assert_eq!(service.get("/readyz").status, 200);
    }
}

/// Whether the fault lies in the order (its tolerance or radius), not in the model.
fn is_job_fault(folder: &Path) -> bool {
    let expected = std::fs::read_to_string(folder.join("expected.toml")).unwrap();
    expected.contains("/params/") || expected.contains("code = \"limit")
}
