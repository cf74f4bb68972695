//! The session by curl of `api/README.md`, as it stands there.

use std::process::Command;

use lacuna_tests::support::root;
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::Service;
use serde_json::{Value, json};

/// The lines of the page's session.
fn lines() -> Vec<String> {
    let page = std::fs::read_to_string(root().join("api/README.md")).unwrap();
    let section = page.split("### A session by curl").nth(1).unwrap();
    let block = section.split("```").nth(1).unwrap();
    block.lines().filter_map(|line| line.strip_prefix("$ ")).map(str::to_owned).collect()
}

#[test]
fn the_session_by_curl_runs_as_it_stands_in_the_page() {
    if !Command::new("curl").arg("--version").output().is_ok_and(|output| output.status.success()) {
        eprintln!("the session by curl is left out: there is no curl on this machine");
        return;
    }
    let lines = lines();
    assert!(lines.len() > 10, "{lines:?}");
    let scratch = Scratch::new();
    let service = Service::start(&scratch.join("data"));
    let address = "http://127.0.0.1:7878";
    assert!(lines[0].contains(address));
    let script = lines.join("\n").replace(address, &format!("http://{}", service.address));
    let output = Command::new("bash").args(["-euo", "pipefail", "-c", &script]).current_dir(scratch.path()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");

    let read = |name: &str| -> Value { serde_json::from_slice(&std::fs::read(scratch.join(name)).unwrap()).unwrap() };
    let plate = read("plate.json");
    assert_eq!(
        (&plate["name"], &plate["mesh"]["closed_manifold"], &plate["mesh"]["volume_mm3"]),
        (&json!("plate"), &json!(true), &json!(1600.0))
    );
    let events = std::fs::read_to_string(scratch.join("events.txt")).unwrap();
    assert!(events.contains("event: done"), "{events}");
    let certificate = read("certificate.json");
    assert_eq!(
        (&certificate["genus"], &certificate["components"], &certificate["self_intersections"]),
        (&json!(1), &json!(1), &json!("none"))
    );
    // 20 x 20 x 4 less a hole of radius 3.
    let volume = certificate["mesh_volume_mm3"].as_f64().unwrap();
    assert!((volume - (1600.0 - 36.0 * std::f64::consts::PI)).abs() < 2.0 * 6.0 * std::f64::consts::PI * 4.0 * 0.05, "{volume}");
    let batch = read("batch-certificate.json");
    assert_eq!(
        (&batch["state"], &batch["jobs"][0]["name"], &batch["jobs"][1]["name"]),
        (&json!("succeeded"), &json!("bored plate"), &json!("rod"))
    );
    assert_eq!(batch["jobs"][0]["figures"]["mesh_volume_mm3"], certificate["mesh_volume_mm3"]);
    assert_eq!(std::fs::read_to_string(scratch.join("rows.ndjson")).unwrap().lines().count(), 2);
    let refused = read("refused.json")["errors"].to_string();
    assert!(refused.contains("/params/tolerance_mm"), "{refused}");
    assert_eq!(service.get("/v1/models").json()["items"], json!([]));
}
