//! Mesh files that are no solids: refused, or repaired where that is asked for and told, through the command and the service alike.

use std::ffi::{OsStr, OsString};
use std::path::Path;
use std::process::Output;

use lacuna_tests::support::binary::{run, succeed};
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::Service;
use serde_json::{Value, json};

/// Corners of the triangles of a box, outward.
fn cuboid(low: [f64; 3], high: [f64; 3]) -> Vec<[[f64; 3]; 3]> {
    let corner = |code: usize| -> [f64; 3] { std::array::from_fn(|axis| if code >> axis & 1 == 1 { high[axis] } else { low[axis] }) };
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).map(|corners: [usize; 3]| corners.map(corner)).collect()
}

/// A box of side 4 with two triangles turned, one copied, one without area, and a hollow of side 2 that looks outward.
fn broken() -> Vec<[[f64; 3]; 3]> {
    let mut triangles = cuboid([0.0; 3], [4.0; 3]);
    triangles[3].swap(0, 1);
    triangles[8].swap(1, 2);
    triangles.push(triangles[5]);
    triangles.push([[0.0; 3], [0.0; 3], [4.0, 0.0, 0.0]]);
    triangles.extend(cuboid([1.0; 3], [3.0; 3]));
    triangles
}

/// Triangles as OBJ, each with corners of its own.
fn obj(triangles: &[[[f64; 3]; 3]]) -> String {
    let vertices: String = triangles.iter().flatten().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    vertices + &(0..triangles.len()).map(|t| format!("f {} {} {}\n", 3 * t + 1, 3 * t + 2, 3 * t + 3)).collect::<String>()
}

fn stl(triangles: &[[[f64; 3]; 3]]) -> String {
    let corner = |[x, y, z]: &[f64; 3]| format!("vertex {x} {y} {z}\n");
    let facet = |corners: &[[f64; 3]; 3]| {
        format!("facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n", corners.iter().map(corner).collect::<String>())
    };
    format!("solid box\n{}endsolid box\n", triangles.iter().map(facet).collect::<String>())
}

fn words<'a>(command: &'a str, files: &[&'a Path]) -> Vec<OsString> {
    let mut files = files.iter();
    command.split(' ').map(|word| if word == "FILE" { files.next().unwrap().as_os_str() } else { OsStr::new(word) }.to_owned()).collect()
}

fn json_of(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// The statement that all readers of the broken box come to; an STL file's corners are joined by reading it.
fn done(input: &str, joined: u64) -> Value {
    json!([{ "input": input, "changed": true, "joined_vertices": joined, "removed_flat_triangles": 1, "removed_copies": 1, "closed_holes": 0, "closing_triangles": 0,
        "longest_hole_edges": 0, "parted_edges": 0, "doubled_vertices": 0, "turned_triangles": 14, "shells_made_voids": 1, "crossings": 0 }])
}

#[track_caller]
fn refused(output: &Output, named: &[&str]) {
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{told}");
    named.iter().for_each(|name| assert!(told.contains(name), "{told} does not name {name:?}"));
}

#[track_caller]
fn holds(interval: &Value, exact: f64) {
    let [low, high] = [0, 1].map(|end| interval[end].as_f64().unwrap());
    assert!(low <= exact && exact <= high && high - low < 0.01, "{exact} is not in [{low}, {high}]");
}

#[test]
fn every_command_repairs_only_when_asked() {
    let scratch = Scratch::new();
    let (file, text, other) = (scratch.join("box.obj"), scratch.join("box.stl"), scratch.join("other.obj"));
    std::fs::write(&file, obj(&broken())).unwrap();
    std::fs::write(&text, stl(&broken())).unwrap();
    std::fs::write(&other, obj(&cuboid([3.5, 0.0, 0.0], [6.0, 4.0, 4.0]))).unwrap();
    let (out, told) = (scratch.join("out.stl"), scratch.join("certificate.json"));

    // 26 triangles with three vertices each, and twice 8 places.
    for (path, joined) in [(&file, 62), (&text, 0)] {
        let measured: Value = serde_json::from_slice(&succeed(words("measure FILE --tolerance 0.01 --repair", &[path]))).unwrap();
        assert_eq!(measured["repair"], done("box", joined));
        holds(&measured["volume_mm3"], 56.0);
        assert!(measured["warnings"][0].as_str().unwrap().starts_with("input 'box' was repaired: "));
        let said = measured["warnings"][1].as_str().unwrap();
        assert!(said.starts_with("1 shells of input 'box'") && said.contains("\"operation\": \"union\""), "{said}");
    }
    let sliced = "slice FILE --tolerance 0.01 --at 2 -o FILE --certificate FILE --repair";
    let drawing = scratch.join("out.svg");
    succeed(words(sliced, &[&file, &drawing, &told]));
    let section = &json_of(&told)["sections"]["planes"][0];
    assert_eq!((&section["area_mm2"], &section["holes"]), (&json!(12.0), &json!(1)));
    succeed(words(
        "intersect FILE FILE --operation union --tolerance 0.01 -o FILE --certificate FILE --repair",
        &[&text, &other, &out, &told],
    ));
    let certificate = json_of(&told);
    assert_eq!(certificate["repair"][0], done("box", 0)[0]);
    assert_eq!((&certificate["repair"][1]["joined_vertices"], &certificate["repair"][1]["turned_triangles"]), (&json!(28), &json!(0)));
    holds(&certificate["volume_mm3"], 56.0 + 32.0);
    succeed(words("solidify FILE --wall 0.5 --side outward --tolerance 0.1 -o FILE --certificate FILE --repair", &[&text, &out, &told]));
    let certificate = json_of(&told);
    assert_eq!((&certificate["repair"], &certificate["wall"]["solid_volume_mm3"]), (&done("box", 0), &json!(56.0)));
    let converted = run(words("convert FILE FILE --repair", &[&text, &out]));
    let words_of = String::from_utf8_lossy(&converted.stderr).into_owned();
    assert!(converted.status.success() && words_of.contains("14 triangles turned"), "{words_of}");
    let found: Value = serde_json::from_slice(&succeed(words("inspect FILE", &[&out]))).unwrap();
    assert_eq!((&found["closed_manifold"], &found["volume_mm3"], &found["triangles"]), (&json!(true), &json!(56.0), &json!(24)));

    // Nobody asked.
    refused(&run(words("slice FILE --tolerance 0.01 --at 2 -o FILE", &[&text, &drawing])), &["face 13: vertex 0 occurs twice", "--repair"]);
    let union = "intersect FILE FILE --operation union --tolerance 0.01 -o FILE";
    refused(&run(words(union, &[&other, &other, &out])), &["ask for a repair", "--repair"]);
}

/// Files that were not written to their ends are told as such, and not as bad documents.
#[test]
fn files_that_are_cut_off_are_named() {
    let scratch = Scratch::new();
    let (whole, cut, empty, out) = (scratch.join("whole.stl"), scratch.join("cut.stl"), scratch.join("empty.stl"), scratch.join("out.stl"));
    let source = scratch.join("box.obj");
    std::fs::write(&source, obj(&cuboid([0.0; 3], [4.0; 3]))).unwrap();
    succeed(words("convert FILE FILE", &[&source, &whole]));
    let bytes = std::fs::read(&whole).unwrap();
    std::fs::write(&cut, &bytes[..bytes.len() - 3]).unwrap();
    std::fs::write(&empty, "").unwrap();
    for command in ["measure FILE --tolerance 0.01", "inspect FILE"] {
        refused(&run(words(command, &[&cut])), &["binary STL", "12 triangles", "684 bytes, and it has 681"]);
        refused(&run(words(command, &[&empty])), &["the file is empty"]);
    }
    // Two files in one place would leave one.
    let twice = run(words("convert FILE FILE FILE", &[&whole, &out, &out]));
    assert!(twice.status.code() == Some(2) && String::from_utf8_lossy(&twice.stderr).contains("is named for two outputs"));
    assert!(!out.exists());
    // What would be passed over is refused.
    let cases = [
        ("convert FILE FILE --format obj", "--format is for stdout"),
        ("slice FILE --tolerance 0.01 -o FILE", "<--at <MM>|--step <MM>>"),
        ("slice FILE --tolerance 0.01 --at 1,nan -o FILE", "a number is expected"),
        ("intersect FILE FILE --operation hull --tolerance 0.01 -o x.stl --preview x.jpg", "name end in .png"),
    ];
    for (command, named) in cases {
        let refused = run(words(command, &[&whole, &out]));
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(refused.status.code() == Some(2) && said.contains(named), "{command}: {said}");
        assert!(!out.exists());
    }
}

#[test]
fn what_cannot_be_repaired_is_refused_with_its_place() {
    let scratch = Scratch::new();
    let (open, out) = (scratch.join("open.stl"), scratch.join("out.stl"));
    std::fs::write(&open, stl(&cuboid([0.0; 3], [4.0; 3])[..8])).unwrap();
    let named = &[
        "the hole of 4 edges at [0, 0, 0] is not closed",
        "would have 0.500",
        "and may have 0.25",
        "leave out the repair and give a radius_mm",
    ];
    refused(&run(words("measure FILE --tolerance 0.01 --repair", &[&open])), named);
    refused(&run(words("convert FILE FILE --repair", &[&open, &out])), named);
    refused(&run(words("slice FILE --tolerance 0.01 --step 1 -o FILE --repair", &[&open, &scratch.join("out.svg")])), named);
    assert_eq!(std::fs::read_dir(scratch.path()).unwrap().count(), 1, "half a file is left");
    // What it names helps.
    succeed(words("solidify FILE --radius 1 --tolerance 0.2 -o FILE", &[&open, &out]));

    let curve = scratch.join("curve.json");
    let shape = json!({ "family": "corner_cutting", "a": 0.25, "b": 0.25, "control_points": [[0, 0, 0], [1, 0, 0], [0, 1, 0]] });
    std::fs::write(&curve, json!({ "lacuna": 1, "shape": shape }).to_string()).unwrap();
    refused(&run(words("measure FILE --tolerance 0.01 --repair", &[&curve])), &["no input is one"]);
}

#[test]
fn what_is_fine_stays_as_it_is() {
    let scratch = Scratch::new();
    let (file, told) = (scratch.join("box.off"), scratch.join("certificate.json"));
    let quads = "4 0 4 6 2\n4 1 3 7 5\n4 0 1 5 4\n4 2 6 7 3\n4 0 2 3 1\n4 4 5 7 6\n";
    std::fs::write(&file, format!("OFF\n8 6 0\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 0 1\n1 0 1\n0 1 1\n1 1 1\n{quads}")).unwrap();
    let bytes = |command: &str, ending: &str| {
        let out = scratch.join(&format!("out.{ending}"));
        succeed(words(command, &[&file, &out, &told]));
        std::fs::read(out).unwrap()
    };
    // Its polygons are whole.
    assert!(bytes("convert FILE FILE --repair", "obj") == bytes("convert FILE FILE", "obj"));
    let trimmed = "intersect FILE --operation trim --plane 1,0,0,0.5 --tolerance 0.01 -o FILE --certificate FILE";
    assert!(bytes(&format!("{trimmed} --repair"), "stl") == bytes(trimmed, "stl"));
    assert!(json_of(&told).get("repair").is_none());
    bytes(&format!("{trimmed} --repair"), "stl");
    let certificate = json_of(&told);
    assert_eq!((&certificate["repair"][0]["changed"], &certificate["warnings"]), (&json!(false), &json!([])));
}

#[test]
fn the_service_repairs_uploads_as_the_command_does_files() {
    let scratch = Scratch::new();
    let service = Service::start(&scratch.join("data"));
    // Two boxes that share an edge, one of them inside out, in one file.
    let mut boxes = cuboid([0.0; 3], [1.0; 3]);
    boxes.extend(cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 1.0]).into_iter().map(|[a, b, c]| [a, c, b]));
    let file = scratch.join("boxes.stl");
    std::fs::write(&file, stl(&boxes)).unwrap();
    let disposition = ("content-disposition", "attachment; filename=\"boxes.stl\"");
    let upload = service.request("POST", "/v1/models", &[("content-type", "model/stl"), disposition], &std::fs::read(&file).unwrap());
    assert_eq!(upload.status, 201, "{}", upload.json());
    let order = |kind: &str, params: Value, outputs: Value| {
        let inputs = json!([{ "name": "boxes", "model_ref": upload.json()["id"] }]);
        json!({ "lacuna": 1, "kind": kind, "inputs": inputs, "params": params, "outputs": outputs })
    };
    let params = |repair: bool| json!({ "tolerance_mm": 0.01, "operation": "trim", "plane": [0, 0, 1, 0.5], "repair": repair });
    let refusal = service.post("/v1/jobs", &order("intersect", params(false), json!(["stl"])));
    assert_eq!((refusal.status, &refusal.json()["code"]), (422, &json!("job.not-a-solid")), "{}", refusal.json());
    let view = service.done(&order("intersect", params(true), json!(["stl"])));
    assert_eq!(view["state"], "succeeded", "{view}");
    let certificate = &view["certificate"];
    let statement = json!([{ "input": "boxes", "changed": true, "joined_vertices": 0, "removed_flat_triangles": 0, "removed_copies": 0,
        "closed_holes": 0, "closing_triangles": 0, "longest_hole_edges": 0, "parted_edges": 1, "doubled_vertices": 2, "turned_triangles": 12, "shells_made_voids": 0, "crossings": 0 }]);
    assert_eq!((&certificate["repair"], &certificate["components"]), (&statement, &json!(2)));
    holds(&certificate["volume_mm3"], 1.0);

    let (out, told) = (scratch.join("out.stl"), scratch.join("certificate.json"));
    let here = "intersect FILE --operation trim --plane 0,0,1,0.5 --tolerance 0.01 -o FILE --certificate FILE --repair";
    succeed(words(here, &[&file, &out, &told]));
    let there = |name: &str| service.get(&format!("/v1/jobs/{}/outputs/{name}?redirect=0", view["id"].as_str().unwrap())).body;
    assert!(there("stl") == std::fs::read(&out).unwrap() && there("certificate.json") == std::fs::read(&told).unwrap());

    let url = format!("http://{}", service.address);
    let converted = scratch.join("converted.stl");
    let remote = run([words(&format!("--server {url}"), &[]), words("convert FILE FILE --repair", &[&file, &converted])].concat());
    let remarks = String::from_utf8_lossy(&remote.stderr).into_owned();
    assert!(remote.status.success() && remarks.contains("12 triangles turned"), "{remarks}");
    let converted_there = std::fs::read(&converted).unwrap();
    succeed(words("convert FILE FILE --repair", &[&file, &converted]));
    assert!(converted_there == std::fs::read(&converted).unwrap());

    let evaluated = service.post("/v1/jobs", &order("evaluate", json!({ "tolerance_mm": 0.1, "repair": true }), json!(["obj"])));
    assert_eq!((evaluated.status, &evaluated.json()["errors"][0]["pointer"]), (422, &json!("/params/repair")));
}

/// Cubes that share an edge have corners of their own there once they are repaired: each is 1 thick, and no gap is between faces that look past each other.
#[test]
fn walls_of_solids_whose_corners_a_repair_doubled() {
    let scratch = Scratch::new();
    let (file, map) = (scratch.join("cubes.stl"), scratch.join("map.ply"));
    let mut boxes = cuboid([0.0; 3], [1.0; 3]);
    boxes.extend(cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 1.0]));
    std::fs::write(&file, stl(&boxes)).unwrap();
    let command = "measure FILE --tolerance 0.01 --repair --thickness --map FILE";
    let told: Value = serde_json::from_slice(&succeed(words(command, &[&file, &map]))).unwrap();
    assert_eq!(told["repair"][0]["doubled_vertices"], 2);
    holds(&told["thickness"]["wall"]["least_mm"], 1.0);
    assert_eq!(told["thickness"]["gap"], Value::Null, "{told}");
    assert!(std::fs::read(&map).unwrap().starts_with(b"ply"));
    // Solids that do cross have no walls, repaired or not.
    let mut crossing = cuboid([0.0; 3], [2.0; 3]);
    crossing.extend(cuboid([1.0; 3], [3.0; 3]));
    std::fs::write(&file, stl(&crossing)).unwrap();
    let output = run(words("measure FILE --tolerance 0.01 --repair --thickness", &[&file]));
    assert!(!output.status.success() && String::from_utf8_lossy(&output.stderr).contains("walls have no thickness there"), "{output:?}");
}

#[test]
fn small_holes_are_closed_and_told() {
    let scratch = Scratch::new();
    let open = scratch.join("open.stl");
    std::fs::write(&open, stl(&cuboid([0.0; 3], [4.0; 3])[..10])).unwrap();
    let measured: Value = serde_json::from_slice(&succeed(words("measure FILE --tolerance 0.01 --repair", &[&open]))).unwrap();
    let told = &measured["repair"][0];
    assert_eq!([&told["closed_holes"], &told["closing_triangles"], &told["longest_hole_edges"]], [&json!(1), &json!(2), &json!(4)]);
    holds(&measured["volume_mm3"], 64.0);
    assert!(measured["warnings"][0].as_str().unwrap().contains("1 holes closed, 2 triangles added to close them"), "{measured}");
}
