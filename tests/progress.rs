//! The error bound that is told with the progress: in the process, by the command line, by the events of a service and by asking it.

use std::ffi::OsStr;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use lacuna_exchange::document::{DocumentLimits, read_job};
use lacuna_fabrication::run;
use lacuna_kernel::budget::{Budget, Limits, Progress};
use lacuna_tests::support::binary::lacuna;
use lacuna_tests::support::cases::{model, named};
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::{Service, submit, until};
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(60);

/// A job of every kind, and of every way to do it.
fn jobs() -> Vec<(&'static str, Value)> {
    let input = |name: &str, case: &str| json!({ "name": name, "model": model(case), "radius_mm": 1 });
    let order = |kind: &str, case: &str, params: Value| json!({ "lacuna": 1, "kind": kind, "model": model(case), "params": params });
    let pair = |kind: &str, params: Value| json!({ "lacuna": 1, "kind": kind, "inputs": [input("a", "meshes/segment"), input("b", "meshes/right_angle")], "params": params });
    let bare = |kind: &str, params: Value| {
        let input = |name: &str, case: &str| json!({ "name": name, "model": model(case) });
        json!({ "lacuna": 1, "kind": kind, "inputs": [input("a", "meshes/segment"), input("b", "meshes/right_angle")], "params": params })
    };
    vec![
        ("evaluate", order("evaluate", "curves/four_point", json!({ "tolerance_mm": 0.01 }))),
        ("solidify", order("solidify", "meshes/right_angle", json!({ "tolerance_mm": 0.1, "radius_mm": 1 }))),
        ("lattice", order("solidify", "meshes/rectangle", json!({ "tolerance_mm": 0.1, "radius_mm": 1 }))),
        ("closing", order("solidify", "meshes/right_angle", json!({ "tolerance_mm": 0.1, "radius_mm": 1, "closing_mm": 1 }))),
        ("wall", order("solidify", "meshes/cube", json!({ "tolerance_mm": 0.1, "wall_mm": 1 }))),
        ("preview", order("solidify", "meshes/rectangle", json!({ "tolerance_mm": 0.1, "radius_mm": 1, "preview": true }))),
        ("stability", order("solidify", "meshes/right_angle", json!({ "tolerance_mm": 0.1, "radius_mm": 1, "stability": true }))),
        ("measure", order("measure", "meshes/right_angle", json!({ "tolerance_mm": 0.1 }))),
        ("thick", order("measure", "meshes/right_angle", json!({ "tolerance_mm": 0.1, "radius_mm": 1 }))),
        ("compare", bare("measure", json!({ "tolerance_mm": 0.01 }))),
        ("contact", bare("intersect", json!({ "tolerance_mm": 0.01 }))),
        ("union", pair("intersect", json!({ "tolerance_mm": 0.1, "operation": "union" }))),
        ("convert", order("convert", "meshes/cube", json!({ "tolerance_mm": 0.01 }))),
        ("level", serde_json::from_slice(&std::fs::read(named("jobs/menger_level_1").model()).unwrap()).unwrap()),
        ("split", serde_json::from_slice(&std::fs::read(named("jobs/box_split").model()).unwrap()).unwrap()),
        ("slice", serde_json::from_slice(&std::fs::read(named("jobs/cube_sections").model()).unwrap()).unwrap()),
    ]
}

#[test]
fn every_kind_of_job_ends_with_the_bound_of_its_certificate() {
    for (name, order) in jobs() {
        let read = read_job(order.to_string().as_bytes(), &DocumentLimits::default()).unwrap_or_else(|faults| panic!("{name}: {faults:?}"));
        let job = read.resolve(&Limits::default(), &Limits::default(), |_| None).unwrap_or_else(|faults| panic!("{name}: {faults:?}"));
        let heard: Arc<Mutex<Vec<Progress>>> = Arc::default();
        let listener = Arc::clone(&heard);
        let sink = move |progress: &Progress| listener.lock().unwrap().push(progress.clone());
        let outcome =
            run(&job, &Budget { progress: Some(Arc::new(sink)), ..Budget::default() }).unwrap_or_else(|error| panic!("{name}: {error}"));
        let heard = heard.lock().unwrap();
        let last = heard.last().unwrap();
        assert_eq!((last.phase, last.bound_mm), ("certify", Some(outcome.certificate.achieved_bound_mm)), "{name}");
        assert_eq!(heard.first().unwrap().bound_mm, None, "{name}");
        let known: Vec<bool> = heard.iter().map(|told| told.bound_mm.is_some()).collect();
        assert!(known.is_sorted(), "{name}: once told it stays known: {heard:?}");
    }
}

/// The progress events of a stream.
fn steps(events: &str) -> Vec<Value> {
    let blocks = events.split("\n\n").filter(|block| block.contains("event: progress"));
    blocks.map(|block| serde_json::from_str(block.split_once("data: ").unwrap().1.lines().next().unwrap()).unwrap()).collect()
}

#[test]
fn a_finished_job_has_told_its_bound_by_events() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let mut order = jobs().swap_remove(2).1;
    order["outputs"] = json!(["stl"]);
    let id = submit(&service, &order);
    let ended = service.ended(&id);
    assert_eq!(ended["state"], "succeeded", "{ended}");
    // A late listener hears the last step.
    let events = String::from_utf8(service.get(&format!("/v1/jobs/{id}/events")).body).unwrap();
    let last = steps(&events).pop().unwrap_or_else(|| panic!("{events}"));
    assert_eq!(last["phase"], "write");
    assert_eq!(last["bound_mm"], ended["certificate"]["achieved_bound_mm"]);
    assert!(last["bound_mm"].as_f64().unwrap() > 0.0);
}

#[test]
fn a_running_job_tells_its_bound_to_who_asks_and_to_who_listens() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_WORKERS", "1")]);
    // The comparison takes minutes, and its interval is the narrower the longer it takes.
    let input = |name: &str, path: &str| json!({ "name": name, "model": model(path) });
    let order = json!({ "lacuna": 1, "kind": "measure", "params": { "tolerance_mm": 1e-7 },
        "inputs": [input("a", "ifs/sierpinski_tetrahedron"), input("b", "ifs/menger_sponge")] });
    let id = submit(&service, &order);
    let polled = || service.get(&format!("/v1/jobs/{id}")).json()["progress"].clone();
    until(PATIENCE, "a bound", || polled()["bound_mm"].is_number());
    let first = polled();
    assert_eq!(first["phase"], "compare");
    assert!(first["bound_mm"].as_f64().unwrap() > 1e-7, "not the tolerance that was asked: {first}");
    until(PATIENCE, "a narrower one", || polled()["bound_mm"].as_f64().unwrap() < first["bound_mm"].as_f64().unwrap());
    assert_eq!(service.post(&format!("/v1/jobs/{id}/cancel"), &json!({})).status / 100, 2);
    assert_eq!(service.ended(&id)["state"], "cancelled");
    let events = String::from_utf8(service.get(&format!("/v1/jobs/{id}/events")).body).unwrap();
    let last = steps(&events).pop().unwrap_or_else(|| panic!("{events}"));
    assert!(last["bound_mm"].as_f64().unwrap() < first["bound_mm"].as_f64().unwrap(), "{last}");
}

#[test]
fn the_command_line_tells_it_here_and_at_a_service() {
    let scratch = Scratch::new();
    let service = Service::start(&scratch.join("data"));
    let (file, certificate) = (scratch.join("part.stl"), scratch.join("part.json"));
    let server = format!("http://{}", service.address);
    for place in [vec!["--local"], vec!["--server", &server]] {
        let model = named("meshes/rectangle").model();
        let words = ["solidify", "--progress", "json", "--tolerance", "0.1", "--radius", "1", "-o"].map(OsStr::new);
        let mut command = std::process::Command::new(lacuna());
        command.args(place).args(words).arg(&file).arg("--certificate").arg(&certificate).arg(model);
        let output = command.output().unwrap();
        let told = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{told}");
        let steps: Vec<Value> = told.lines().filter(|line| line.starts_with('{')).map(|line| serde_json::from_str(line).unwrap()).collect();
        let reached = serde_json::from_slice::<Value>(&std::fs::read(&certificate).unwrap()).unwrap()["achieved_bound_mm"].clone();
        let bounds: Vec<&Value> = steps.iter().filter_map(|step| step.get("bound_mm")).collect();
        assert_eq!(bounds.last(), Some(&&reached), "{told}");
    }
}
