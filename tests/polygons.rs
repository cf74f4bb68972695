//! Mesh files with concave polygons: cut into triangles that fill them, whole where the format has polygons, and refused where they have no inside.

use std::ffi::OsStr;
use std::path::Path;

use lacuna_tests::support::binary::{run, succeed};
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::Service;
use serde_json::{Value, json};

/// A prism of height 2 over a polygon, as OBJ: two faces of as many corners, and quads.
fn prism(floor: &[[f64; 2]]) -> String {
    let n = floor.len();
    let vertices: String = [0, 2].iter().flat_map(|z| floor.iter().map(move |[x, y]| format!("v {x} {y} {z}\n"))).collect();
    let face =
        |corners: &mut dyn Iterator<Item = usize>| format!("f{}\n", corners.map(|corner| format!(" {}", corner + 1)).collect::<String>());
    let sides: String = (0..n).map(|k| face(&mut [k, (k + 1) % n, n + (k + 1) % n, n + k].into_iter())).collect();
    vertices + &face(&mut (0..n).rev()) + &face(&mut (n..2 * n)) + &sides
}

/// A comb with three teeth, that no corner sees as a whole: area 5 + 3, circumference 18.
fn comb() -> String {
    prism(&[
        [1.0, 1.0],
        [1.0, 2.0],
        [0.0, 2.0],
        [0.0, 0.0],
        [5.0, 0.0],
        [5.0, 2.0],
        [4.0, 2.0],
        [4.0, 1.0],
        [3.0, 1.0],
        [3.0, 2.0],
        [2.0, 2.0],
        [2.0, 1.0],
    ])
}

fn json_of(arguments: &[&OsStr]) -> Value {
    serde_json::from_slice(&succeed(arguments)).unwrap()
}

fn inspected(file: &Path) -> Value {
    json_of(&["inspect".as_ref(), file.as_os_str()])
}

#[test]
fn concave_polygons_are_cut_where_they_must_be() {
    let scratch = Scratch::new();
    let file = scratch.join("comb.obj");
    std::fs::write(&file, comb()).unwrap();
    let exact = |told: &Value| {
        let (volume, area) = (told["volume_mm3"].as_f64().unwrap(), told["area_mm2"].as_f64().unwrap());
        assert!((volume - 16.0).abs() < 1e-12 && (area - 52.0).abs() < 1e-12, "{volume} mm3, {area} mm2");
        assert_eq!(
            (&told["closed_manifold"], &told["triangles"], &told["prompts"].as_array().unwrap().len()),
            (&json!(true), &json!(44), &0),
            "{told}"
        );
    };
    let told = inspected(&file);
    assert_eq!((&told["cage"]["faces"], &told["cage"]["faces_by_corners"]), (&json!(14), &json!({ "4": 12, "12": 2 })));
    let mut told = told;
    // What an OBJ file says of its unit, and slicers of its size, is not at stake.
    told["prompts"] = json!([]);
    exact(&told);
    for ending in ["stl", "off", "obj", "ply"] {
        let out = scratch.join(&format!("out.{ending}"));
        succeed(["convert".as_ref(), file.as_os_str(), out.as_os_str()]);
        let mut told = inspected(&out);
        told["prompts"] = json!([]);
        exact(&told);
        let faces = if ending == "stl" { 44 } else { 14 };
        assert_eq!(told["cage"]["faces"], json!(faces), "{ending}");
    }
    // The whole kernel takes it: measured, and cut by a plane.
    let measured = json_of(&["measure".as_ref(), file.as_os_str(), "--tolerance".as_ref(), "0.01".as_ref()]);
    let volume = &measured["volume_mm3"];
    let [low, high] = [0, 1].map(|end| volume[end].as_f64().unwrap());
    assert!(low <= 16.0 && 16.0 <= high && high - low < 1e-9, "{volume}");

    // And the service, whose files are those of the command.
    let service = Service::start(&scratch.join("data"));
    let disposition = ("content-disposition", "attachment; filename=\"comb.obj\"");
    let upload = service.request("POST", "/v1/models", &[("content-type", "model/obj"), disposition], comb().as_bytes());
    assert_eq!((upload.status, &upload.json()["mesh"]["area_mm2"]), (201, &json!(52.0)), "{}", upload.json());
    let inputs = json!([{ "name": "comb", "model_ref": upload.json()["id"] }]);
    let view = service
        .done(&json!({ "lacuna": 1, "kind": "convert", "inputs": inputs, "params": { "tolerance_mm": 0.01 }, "outputs": ["stl", "off"] }));
    assert_eq!(view["state"], "succeeded", "{view}");
    for (ending, faces) in [("stl", 44), ("off", 14)] {
        let out = scratch.join(&format!("served.{ending}"));
        let path = format!("/v1/jobs/{}/outputs/{ending}?redirect=0", view["id"].as_str().unwrap());
        std::fs::write(&out, service.get(&path).body).unwrap();
        let mut told = inspected(&out);
        assert_eq!(told["cage"]["faces"], json!(faces), "{ending}");
        told["prompts"] = json!([]);
        exact(&told);
    }
}

#[test]
fn polygons_without_an_inside_are_told_and_not_written() {
    let scratch = Scratch::new();
    let service = Service::start(&scratch.join("data"));
    for (name, floor, words) in [
        ("crossed", [[0.0, 0.0], [3.0, 0.0], [0.0, 2.0], [2.0, 3.0]], "crosses itself"),
        ("bow", [[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]], "as much on one side as on the other"),
    ] {
        let file = scratch.join(&format!("{name}.obj"));
        std::fs::write(&file, prism(&floor)).unwrap();
        let told = inspected(&file);
        assert_eq!((told.get("volume_mm3"), told.get("area_mm2")), (Some(&Value::Null), Some(&Value::Null)), "{told}");
        let prompt = told["prompts"].as_array().unwrap().iter().find(|prompt| prompt["code"] == "mesh.crossing-face").unwrap();
        let message = prompt["message"].as_str().unwrap();
        assert!(message.contains("face 0") && message.contains(words), "{message}");
        for ending in ["stl", "obj"] {
            let out = scratch.join(&format!("out.{ending}"));
            let refused = run(["convert".as_ref(), file.as_os_str(), out.as_os_str()]);
            let said = String::from_utf8_lossy(&refused.stderr).into_owned();
            assert!(refused.status.code() == Some(3) && said.contains("face 0") && said.contains(words), "{:?}: {said}", refused.status);
            assert!(!out.exists());
        }
        let disposition = ("content-disposition", "attachment; filename=\"faces.obj\"");
        let upload = service.request("POST", "/v1/models", &[("content-type", "model/obj"), disposition], prism(&floor).as_bytes());
        let inputs = json!([{ "name": "faces", "model_ref": upload.json()["id"] }]);
        let job = json!({ "lacuna": 1, "kind": "convert", "inputs": inputs, "params": { "tolerance_mm": 0.01 }, "outputs": ["stl"] });
        let problem = service.done(&job)["problem"].to_string();
        assert!(problem.contains("mesh.crossing-face") && problem.contains(words), "{problem}");
    }
}
