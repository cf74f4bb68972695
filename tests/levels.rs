//! Levels of iterated function systems through the command and as job documents.

use std::ffi::OsStr;
use std::path::Path;

use lacuna_exchange::document::{DocumentLimits, read_job};
use lacuna_exchange::library;
use lacuna_fabrication::{Job, run};
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_tests::support::binary;
use lacuna_tests::support::scratch::Scratch;
use serde_json::{Value, json};

fn solidify(model: &Path, words: &[&str], files: &[&Path]) -> std::process::Output {
    let files = files.iter().flat_map(|path| [OsStr::new("-o"), path.as_os_str()]);
    binary::run([OsStr::new("solidify"), model.as_os_str()].into_iter().chain(words.iter().map(OsStr::new)).chain(files))
}

fn sponge(folder: &Scratch) -> std::path::PathBuf {
    let path = folder.join("menger.json");
    std::fs::write(&path, library::find("menger_sponge").unwrap().document).unwrap();
    path
}

#[track_caller]
fn assert_within(interval: &Value, exact: f64) {
    let [low, high] = [0, 1].map(|k| interval[k].as_f64().unwrap());
    assert!(low <= exact && exact <= high && high - low <= 1e-9 * exact, "{exact} and {interval}");
}

#[test]
fn the_sponge_as_the_library_has_it() {
    let folder = Scratch::new();
    let (model, part, told) = (sponge(&folder), folder.join("sponge.3mf"), folder.join("told.json"));
    let output = solidify(&model, &["--level", "3", "--certificate", told.to_str().unwrap()], &[&part]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let certificate: Value = serde_json::from_slice(&std::fs::read(&told).unwrap()).unwrap();
    assert_eq!(
        (&certificate["genus"], &certificate["components"], &certificate["self_intersections"]),
        (&json!(1409), &json!(1), &json!("none"))
    );
    // The library's sponge is 100 mm wide.
    assert_within(&certificate["volume_mm3"], 1e6 * (20.0_f64 / 27.0).powi(3));
    assert_within(&certificate["area_mm2"], 1e4 * (2.0 * (20.0_f64 / 9.0).powi(3) + 4.0 * (8.0_f64 / 9.0).powi(3)));
    assert_eq!(certificate["level"]["copies"], json!(8000.0));
    assert_eq!(certificate["level"]["primitive"], "stated");
    for axis in 0..3 {
        assert_within(&certificate["bbox_mm"][1][axis], 100.0);
    }
    assert!(std::fs::read(&part).unwrap().starts_with(b"PK"));
}

#[test]
fn a_level_that_is_too_high_names_one_that_passes() {
    let folder = Scratch::new();
    let model = sponge(&folder);
    let output = solidify(&model, &["--level", "8", "--error-format", "json"], &[&folder.join("sponge.stl")]);
    assert_eq!(output.status.code(), Some(4));
    let problem: Value = serde_json::from_slice(&output.stderr).unwrap();
    assert_eq!((&problem["code"], &problem["remedy"]["level"]), (&json!("limit.triangles"), &json!(4.0)), "{problem}");
    assert!(!folder.join("sponge.stl").exists());
    // A curve has no copies to join.
    let curve = folder.join("curve.json");
    std::fs::write(
        &curve,
        json!({ "lacuna": 1, "shape": { "family": "bezier_curve", "control_points": [[0, 0, 0], [1, 1, 1]] } }).to_string(),
    )
    .unwrap();
    let output = solidify(&curve, &["--level", "1", "--error-format", "json"], &[&folder.join("curve.stl")]);
    assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
    // Neither radius nor level: usage.
    assert_eq!(solidify(&model, &["--tolerance", "0.1"], &[&folder.join("x.stl")]).status.code(), Some(2));
}

fn job(params: &Value) -> Result<Job, String> {
    let model: Value = serde_json::from_str(library::find("menger_sponge").unwrap().document).unwrap();
    let document = json!({ "lacuna": 1, "kind": "solidify", "model": model, "params": params }).to_string();
    let read = read_job(document.as_bytes(), &DocumentLimits::default()).map_err(|error| format!("{error:?}"))?;
    read.resolve(&Limits::default(), &Limits::default(), |_| None).map_err(|error| format!("{error:?}"))
}

#[test]
fn documents_state_a_level_or_a_radius() {
    let done = run(&job(&json!({ "level": 1 })).unwrap(), &Budget::default()).unwrap();
    assert_eq!(done.certificate.genus, Some(5));
    assert!(done.certificate.requested_tolerance_mm >= done.certificate.achieved_bound_mm);
    let done = run(&job(&json!({ "level": 2, "tolerance_mm": 0.01 })).unwrap(), &Budget::default()).unwrap();
    assert_eq!((done.certificate.genus, done.certificate.requested_tolerance_mm), (Some(81), 0.01));
    // Coarser than what single precision takes at 1 mm.
    let fine = run(&job(&json!({ "level": 1, "tolerance_mm": 1e-7 })).unwrap(), &Budget::default());
    assert_eq!(fine.unwrap_err().code, "tolerance-unreachable");
    for wrong in [
        json!({ "level": 1, "radius_mm": 0.1 }),
        json!({ "level": -1 }),
        json!({ "level": 1.5 }),
        json!({ "level": 1000 }),
        json!({ "level": 1, "stability": true }),
        json!({}),
        json!({ "radius_mm": 0.1 }),
    ] {
        assert!(job(&wrong).is_err(), "{wrong}");
    }
}
