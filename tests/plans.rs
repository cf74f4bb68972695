//! Plans beside what jobs take: near the truth, and the same for any number of threads.

use std::process::Command;

use lacuna_tests::support::binary::{lacuna, succeed};
use lacuna_tests::support::cases;
use lacuna_tests::support::root;
use lacuna_tests::support::scratch::Scratch;
use serde_json::{Value, json};

/// The job of a solid without simplification: its lattice is what a plan predicts.
fn order(name: &str, tolerance: f64, radius: f64) -> Value {
    let model: Value = serde_json::from_slice(&std::fs::read(cases::named(name).model()).unwrap()).unwrap();
    let params = json!({ "tolerance_mm": tolerance, "radius_mm": radius, "simplify": false });
    json!({ "lacuna": 1, "kind": "solidify", "model": model, "params": params, "outputs": ["stl"] })
}

fn near(planned: &Value, truth: &Value, what: &str) {
    let (planned, truth) = (planned.as_f64().unwrap(), truth.as_f64().unwrap());
    assert!(planned <= 2.0 * truth && truth <= 2.0 * planned, "{what}: {planned} planned, and {truth} made");
}

#[test]
fn triangles_and_bytes_are_within_a_factor_of_two() {
    let scratch = Scratch::new();
    let file = scratch.join("job.json");
    // Not those of the fixtures: fewer blocks than a sample and more, refined much and cleaned much, thin and thick.
    let solids = [
        order("ifs/cantor_dust", 0.5, 1.5),
        order("ifs/koch_curve", 0.15, 0.8),
        order("ifs/sierpinski_tetrahedron", 0.6, 2.5),
        order("curves/circle", 0.02, 0.3),
        order("meshes/cube_open", 0.11, 1.3),
        order("meshes/icosahedron", 0.07, 0.9),
    ];
    let parts = ["lens", "ball_trimmed", "box_split", "boxes_intersection"].map(|name| {
        let mut job: Value =
            serde_json::from_slice(&std::fs::read(root().join(format!("fixtures/jobs/{name}/job.json"))).unwrap()).unwrap();
        job["outputs"] = json!(["stl"]);
        // Nothing of a plan depends on it but that it is another job than that of the fixture.
        job["params"]["tolerance_mm"] = json!(0.7 * job["params"]["tolerance_mm"].as_f64().unwrap());
        job
    });
    for job in solids.iter().chain(&parts) {
        std::fs::write(&file, job.to_string()).unwrap();
        let plan: Value = serde_json::from_slice(&succeed(["plan".as_ref(), file.as_os_str()])).unwrap();
        let told = succeed(["run".as_ref(), file.as_os_str(), "-o".as_ref(), scratch.join("made").as_os_str(), "--quiet".as_ref()]);
        let done: Value = serde_json::from_slice(&told).unwrap();
        let (name, output) = (&job["model"]["name"], &done["outputs"][0]);
        near(&plan["triangles"], &done["certificate"]["triangles"], &format!("triangles of {name}, {}", job["params"]));
        near(&plan["output_bytes"], &output["bytes"], &format!("bytes of {name}, {}", job["params"]));
    }
}

#[test]
fn a_plan_is_the_same_for_any_number_of_threads() {
    let scratch = Scratch::new();
    let file = scratch.join("job.json");
    std::fs::write(&file, order("ifs/sierpinski_tetrahedron", 0.33, 2.0).to_string()).unwrap();
    let plan = |threads: &str| Command::new(lacuna()).arg("plan").arg(&file).env("RAYON_NUM_THREADS", threads).output().unwrap().stdout;
    let one = plan("1");
    assert!(!one.is_empty() && one == plan("2") && one == plan("5"), "{}", String::from_utf8_lossy(&one));
}
