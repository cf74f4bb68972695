//! Previews: something of a result, soon, that says what it is and is never taken for the result.

use std::f64::consts::PI;
use std::process::Command;
use std::time::Duration;

use lacuna_tests::support::binary::{lacuna, succeed};
use lacuna_tests::support::cases::model;
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::{Service, until, view};
use serde_json::{Value, json};

fn preview(kind: &str, path: &str, tolerance: f64, radius: Option<f64>) -> Value {
    let mut params = json!({ "tolerance_mm": tolerance, "preview": true });
    if let Some(radius) = radius {
        params["radius_mm"] = json!(radius);
    }
    json!({ "lacuna": 1, "kind": kind, "model": model(path), "params": params })
}

/// What a preview leaves: its certificate, and the bytes of its one file beside that.
fn seen(order: &Value) -> (Value, Vec<u8>) {
    let scratch = Scratch::new();
    let (file, made) = (scratch.join("job.json"), scratch.join("made"));
    std::fs::write(&file, order.to_string()).unwrap();
    let told = succeed(["run".as_ref(), file.as_os_str(), "-o".as_ref(), made.as_os_str(), "--quiet".as_ref()]);
    let done: Value = serde_json::from_slice(&told).unwrap();
    let outputs = done["outputs"].as_array().unwrap();
    let path = outputs[0]["file"].as_str().unwrap();
    assert!(outputs.len() == 2 && path.ends_with("-preview.glb"), "{outputs:?}");
    (done["certificate"].clone(), std::fs::read(path).unwrap())
}

#[test]
fn a_solid_is_as_coarse_as_its_ball_allows_and_keeps_its_bounds() {
    // A segment of 10 mm; its dilation has a closed form.
    let (certificate, glb) = seen(&preview("solidify", "meshes/segment", 1e-4, Some(1.0)));
    assert_eq!(certificate["preview"], json!({ "final_tolerance_mm": 1e-4, "tolerance_mm": 0.5, "without_ball": false }));
    assert_eq!(certificate["requested_tolerance_mm"], 0.5);
    let bound = |name: &str| certificate[name].as_f64().unwrap();
    let length = 10.0;
    let capsule = |radius: f64| PI * radius * radius * length + 4.0 / 3.0 * PI * radius.powi(3);
    let volume = bound("mesh_volume_mm3");
    assert!(capsule(1.0 - bound("inner_bound_mm")) <= volume && volume <= capsule(1.0 + bound("outer_bound_mm")), "{volume}");
    assert!(bound("inner_bound_mm").max(bound("outer_bound_mm")) <= 0.5, "{certificate}");
    assert!(certificate["warnings"][0].as_str().unwrap().starts_with("a preview:"), "{certificate}");
    // The file itself says so, too: whoever finds it is not deceived.
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let document: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    assert_eq!(document["asset"]["extras"]["certificate"]["preview"], certificate["preview"]);
}

#[test]
fn a_tolerance_that_is_coarse_enough_stays() {
    let (certificate, _) = seen(&preview("solidify", "meshes/segment", 0.75, Some(1.0)));
    assert_eq!(certificate["preview"]["tolerance_mm"], 0.75);
    let (certificate, _) = seen(&preview("evaluate", "curves/circle", 0.1, None));
    assert_eq!(certificate["preview"], json!({ "final_tolerance_mm": 0.1, "tolerance_mm": 0.1, "without_ball": false }));
}

#[test]
fn a_shape_has_no_more_cells_than_can_be_shown() {
    let (certificate, glb) = seen(&preview("evaluate", "ifs/sierpinski_tetrahedron", 1e-4, None));
    let tolerance = certificate["preview"]["tolerance_mm"].as_f64().unwrap();
    // Copies are halves: four times as many with every doubling. So the next finer tolerance has more than the hundred thousand, and this one a quarter of that at least.
    let cells = certificate["leaf_cells"].as_u64().unwrap();
    assert!((25_000..=100_000).contains(&cells) && certificate["achieved_bound_mm"].as_f64().unwrap() <= tolerance, "{certificate}");
    assert!(glb.len() < 8 << 20, "{}", glb.len());
}

#[test]
fn a_thin_ball_on_a_large_fractal_is_left_out() {
    let (certificate, _) = seen(&preview("solidify", "ifs/barnsley_fern", 0.01, Some(0.02)));
    assert_eq!(certificate["preview"]["without_ball"], true, "{certificate}");
    // Nothing is said of a solid.
    assert!(certificate["triangles"] == 0 && certificate.get("genus").is_none() && certificate.get("thickness_min_mm").is_none());
}

#[test]
fn a_limit_of_its_own_refuses_a_preview_as_any_other_job() {
    let scratch = Scratch::new();
    let file = scratch.join("job.json");
    let mut order = preview("solidify", "meshes/segment", 0.01, Some(1.0));
    order["limits"] = json!({ "triangles": 100 });
    std::fs::write(&file, order.to_string()).unwrap();
    let mut run = Command::new(lacuna());
    run.arg("run").arg(&file).arg("-o").arg(scratch.path()).args(["--quiet", "--error-format", "json"]);
    let refused: Value = serde_json::from_slice(&run.output().unwrap().stderr).unwrap();
    assert_eq!((&refused["limit"], &refused["allowed"]), (&json!("triangles"), &json!(100.0)), "{refused}");
}

#[test]
fn a_preview_is_the_same_for_any_number_of_threads() {
    let scratch = Scratch::new();
    for (number, order) in
        [preview("solidify", "ifs/sierpinski_tetrahedron", 0.01, Some(2.0)), preview("solidify", "ifs/barnsley_fern", 0.01, Some(0.1))]
            .iter()
            .enumerate()
    {
        let file = scratch.join(&format!("{number}.json"));
        std::fs::write(&file, order.to_string()).unwrap();
        let told = |threads: &str| {
            let made = scratch.join(&format!("made-{number}-{threads}"));
            let run = Command::new(lacuna()).arg("run").arg(&file).arg("-o").arg(&made).args(["--quiet", "--threads", threads]).output();
            let done: Value = serde_json::from_slice(&run.unwrap().stdout).unwrap();
            done["certificate"].clone()
        };
        // The certificate has the digest of the file.
        assert_eq!(told("1"), told("2"));
    }
}

#[test]
fn a_service_never_hands_a_preview_out_as_the_result() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let ended = |order: &Value| {
        let answer = service.post("/v1/jobs", order);
        assert!(matches!(answer.status, 200 | 202), "{}", answer.json());
        let id = answer.json()["id"].as_str().unwrap().to_owned();
        until(Duration::from_secs(60), "the end of a job", || view(&service, &id)["finished"].is_string());
        let ended = view(&service, &id);
        assert_eq!(ended["state"], "succeeded", "{ended}");
        ended
    };
    let soon = preview("solidify", "meshes/segment", 0.05, Some(1.0));
    let mut whole = soon.clone();
    whole["params"].as_object_mut().unwrap().remove("preview");
    whole["outputs"] = json!(["glb"]);
    let first = ended(&soon);
    let result = ended(&whole);
    let again = ended(&soon);
    assert_ne!(first["input_digest"], result["input_digest"]);
    assert_eq!((&result["reused"], &result["certificate"]["requested_tolerance_mm"]), (&json!(false), &json!(0.05)), "{result}");
    assert!(result["certificate"].get("preview").is_none());
    assert_eq!((&again["reused"], &again["certificate"]), (&json!(true), &first["certificate"]));
    let names = |job: &Value| job["outputs"][0]["file_name"].as_str().unwrap().to_owned();
    assert!(names(&first).ends_with("-preview.glb") && !names(&result).contains("preview"), "{} {}", names(&first), names(&result));
    let id = first["id"].as_str().unwrap();
    let file = service.get(&format!("/v1/jobs/{id}/outputs/glb?redirect=0"));
    assert_eq!((file.status, file.header("content-type"), &file.body[..4]), (200, "model/gltf-binary", &b"glTF"[..]));
    // Nothing is planned of it, and it does not wait for a plan of what it stands for.
    let mut vast = preview("solidify", "ifs/sierpinski_tetrahedron", 1e-5, Some(2.0));
    vast["limits"] = json!({ "triangles": 300_000 });
    ended(&vast);
}
