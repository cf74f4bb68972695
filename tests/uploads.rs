//! Mesh files over HTTP: taken, examined, used in jobs, converted, and refused when they are not what they say.

use std::f64::consts::PI;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use lacuna_tests::support::binary::succeed;
use lacuna_tests::support::cases::model;
use lacuna_tests::support::python::system_python;
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::{Answer, Service, is_alive, send_signal, until};
use serde_json::{Value, json};

/// A cube of quads with a side, in the form of OBJ.
fn cube(low: f64, high: f64) -> String {
    let mut text = String::new();
    for corner in 0..8 {
        let at = |bit: i32| if corner >> bit & 1 == 1 { high } else { low };
        text += &format!("v {} {} {}\n", at(0), at(1), at(2));
    }
    text + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
}

fn upload(service: &Service, headers: &[(&str, &str)], body: &[u8]) -> Answer {
    service.request("POST", "/v1/models", headers, body)
}

fn uploaded(service: &Service, name: &str, body: &[u8]) -> Value {
    let disposition = format!("attachment; filename=\"{name}\"");
    let answer = upload(service, &[("content-type", "application/octet-stream"), ("content-disposition", &disposition)], body);
    assert!(matches!(answer.status, 200 | 201), "{}: {}", answer.status, answer.json());
    answer.json()
}

/// Files that uploads have left.
fn kept(data: &Path) -> usize {
    std::fs::read_dir(data.join("uploads")).unwrap().count()
}

#[track_caller]
fn refused(answer: &Answer, status: u16, named: &str) {
    assert_eq!(answer.status, status, "{}", String::from_utf8_lossy(&answer.body));
    assert_eq!(answer.header("content-type"), "application/problem+json");
    let words = answer.json().to_string();
    assert!(words.contains(named), "{words} does not name {named:?}");
}

/// A segment of length 10 in every format that has segments, and a point in those that have points, binary PLY among them.
fn wires_and_points() -> [Vec<(&'static str, Vec<u8>)>; 2] {
    let ends = "0 0 0\n6 8 0\n";
    let coordinates = "property float x\nproperty float y\nproperty float z\n";
    let edges = format!(
        "ply\nformat ascii 1.0\nelement vertex 2\n{coordinates}element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n{ends}0 1\n"
    );
    let mut binary = format!("ply\nformat binary_little_endian 1.0\nelement vertex 1\n{coordinates}end_header\n").into_bytes();
    [1.0_f32, 2.0, 3.0].into_iter().for_each(|x| binary.extend(x.to_le_bytes()));
    let cloud = format!(
        "ply\nformat ascii 1.0\nelement vertex 1\n{coordinates}element face 0\nproperty list uchar int vertex_indices\nend_header\n1 2 3\n"
    );
    let segments = vec![
        ("wire.obj", b"v 0 0 0\nv 6 8 0\nv 3 4 0\nl 1/1 -1 2\n".to_vec()),
        ("wire.off", format!("OFF\n2 1 0\n{ends}2 0 1\n").into_bytes()),
        ("wire.ply", edges.into_bytes()),
    ];
    let points = vec![
        ("point.obj", b"v 1 2 3\np 1\n".to_vec()),
        ("point.off", b"OFF\n1 1 0\n1 2 3\n1 0\n".to_vec()),
        ("point.ply", binary),
        ("cloud.ply", cloud.into_bytes()),
    ];
    [segments, points]
}

#[test]
fn wires_and_points_of_files_are_thickened() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let ball = 4.0 / 3.0 * PI;
    let kinds = wires_and_points().into_iter().zip([("segments", ball + 10.0 * PI), ("points", ball)]);
    for (name, bytes, (kind, volume)) in kinds.flat_map(|(files, kind)| files.into_iter().map(move |(name, bytes)| (name, bytes, kind))) {
        // By the command, and told by it.
        let path = scratch.join(name);
        std::fs::write(&path, &bytes).unwrap();
        let inspected: Value = serde_json::from_slice(&succeed(["inspect".as_ref(), path.as_os_str()])).unwrap();
        let expected = if name == "wire.obj" { 2 } else { 1 };
        assert_eq!(
            (&inspected[kind], &inspected["triangles"], &inspected["left_out"]),
            (&json!(expected), &json!(0), &json!({})),
            "{name}"
        );
        let certificate = scratch.join("certificate.json");
        let options = ["--tolerance", "0.05", "--radius", "1", "--quiet", "--certificate"].map(std::ffi::OsStr::new);
        let solid = scratch.join("solid.stl");
        let words = ["solidify".as_ref(), path.as_os_str(), "-o".as_ref(), solid.as_os_str()];
        succeed(words.into_iter().chain(options).chain([certificate.as_os_str()]));
        let told: Value = serde_json::from_slice(&std::fs::read(&certificate).unwrap()).unwrap();
        let between = told["volume_mm3"].as_array().unwrap();
        assert!(between[0].as_f64().unwrap() <= volume && volume <= between[1].as_f64().unwrap(), "{name}: {between:?} and {volume}");
        // The same by the service.
        let view = uploaded(&service, name, &bytes);
        assert_eq!(view["mesh"][kind], expected, "{view}");
        let params = json!({ "tolerance_mm": 0.05, "radius_mm": 1 });
        let order = json!({ "lacuna": 1, "kind": "solidify", "model_ref": view["id"], "params": params, "outputs": ["stl"] });
        let done = service.done(&order);
        assert_eq!(done["outputs"][0]["digest"], told["output_digests"]["stl"], "{done}");
        // Other formats have them, too.
        let converted = scratch.join("converted.obj");
        succeed(["convert".as_ref(), path.as_os_str(), converted.as_os_str()]);
        let words = std::fs::read_to_string(&converted).unwrap();
        assert_eq!(
            words.lines().filter(|line| line.starts_with(if kind == "segments" { "l " } else { "p " })).count(),
            expected,
            "{words}"
        );
    }
}

#[test]
fn lines_beside_faces_are_left_out_and_told() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let body = cube(0.0, 10.0) + "l 1 2 4 3 1\np 5\n";
    let view = uploaded(&service, "box.obj", body.as_bytes());
    let mesh = &view["mesh"];
    assert_eq!((&mesh["left_out"], &mesh["closed_manifold"]), (&json!({ "segments": 4, "points": 1 }), &json!(true)), "{view}");
    assert!(mesh["prompts"].as_array().unwrap().iter().any(|prompt| prompt["code"] == "file.left-out"), "{view}");
}

#[test]
fn a_mesh_file_is_examined_kept_and_handed_back() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let body = cube(0.0, 10.0);
    let answer =
        upload(&service, &[("content-type", "model/obj"), ("content-disposition", "attachment; filename=\"box.obj\"")], body.as_bytes());
    assert_eq!(answer.status, 201, "{}", answer.json());
    let view = answer.json();
    let (id, digest) = (view["id"].as_str().unwrap(), view["digest"].as_str().unwrap());
    assert_eq!((answer.header("location"), answer.header("etag")), (format!("/v1/models/{id}").as_str(), format!("\"{digest}\"").as_str()));
    assert_eq!((&view["name"], &view["bytes"]), (&json!("box"), &json!(body.len())));
    let mesh = &view["mesh"];
    for (member, expected) in [
        ("format", json!("obj")),
        ("unit", json!("none, taken for mm")),
        ("vertices", json!(8)),
        ("triangles", json!(12)),
        ("polygons_fanned", json!(6)),
        ("closed_manifold", json!(true)),
        ("genus", json!(0)),
        ("volume_mm3", json!(1000.0)),
        ("bbox_mm", json!([[0.0, 0.0, 0.0], [10.0, 10.0, 10.0]])),
    ] {
        assert_eq!(mesh[member], expected, "{member}");
    }
    // The command finds the same in the file.
    let file = scratch.join("box.obj");
    std::fs::write(&file, &body).unwrap();
    assert_eq!(&serde_json::from_slice::<Value>(&succeed(["inspect".as_ref(), file.as_os_str()])).unwrap(), mesh);

    let again = upload(&service, &[("content-type", "model/obj")], body.as_bytes());
    assert_eq!((again.status, again.json()), (200, view.clone()));
    assert_eq!(service.get("/v1/models").json()["items"], json!([view]));
    let path = format!("/v1/models/{id}");
    let whole = service.get(&path);
    assert_eq!((whole.header("content-type"), whole.body.as_slice()), ("model/obj", body.as_bytes()));
    let part = service.get_with(&path, &[("range", "bytes=2-5")]);
    assert_eq!((part.status, part.body.as_slice()), (206, &body.as_bytes()[2..6]));
    assert_eq!(service.get_with(&path, &[("if-none-match", whole.header("etag"))]).status, 304);
    assert_eq!((service.delete(&path).status, service.get(&path).status), (204, 404));
}

#[test]
fn a_job_on_an_uploaded_mesh_is_the_command_on_the_file() {
    let scratch = Scratch::new();
    let service = Service::start(&scratch.join("data"));
    let (plate, stamp) = (scratch.join("plate.obj"), scratch.join("stamp.off"));
    std::fs::write(&plate, cube(0.0, 10.0)).unwrap();
    std::fs::write(&stamp, "OFF\n4 4 0\n1 1 -1\n9 1 -1\n1 9 -1\n1 1 20\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n").unwrap();
    let id = |path: &Path, name: &str| uploaded(&service, name, &std::fs::read(path).unwrap())["id"].clone();
    let inputs =
        json!([{ "name": "plate", "model_ref": id(&plate, "plate.obj") }, { "name": "stamp", "model_ref": id(&stamp, "other.off") }]);
    let job = json!({ "lacuna": 1, "kind": "intersect", "inputs": inputs, "params": { "tolerance_mm": 0.01, "operation": "difference" },
        "outputs": ["stl", "3mf"] });
    let view = service.done(&job);
    assert_eq!(view["state"], "succeeded", "{view}");

    let (stl, threemf, certificate) = (scratch.join("bored.stl"), scratch.join("bored.3mf"), scratch.join("certificate.json"));
    let words = ["intersect", "--operation", "difference", "--tolerance", "0.01"].map(std::ffi::OsString::from);
    let files = [plate.as_os_str(), stamp.as_os_str(), "-o".as_ref(), stl.as_os_str(), "-o".as_ref(), threemf.as_os_str()];
    let told = ["--certificate".as_ref(), certificate.as_os_str()];
    succeed(words.iter().map(AsRef::as_ref).chain(files).chain(told));
    let job_id = view["id"].as_str().unwrap();
    for (name, file) in [("stl", stl), ("3mf", threemf), ("certificate.json", certificate)] {
        let bytes = service.get(&format!("/v1/jobs/{job_id}/outputs/{name}?redirect=0")).body;
        assert!(bytes == std::fs::read(file).unwrap(), "{name} differs from the command's");
    }
    // The work is known by the contents: the same meshes under other ids and names of files are the same work.
    assert_eq!(service.done(&job)["reused"], true);

    let unknown = json!({ "lacuna": 1, "kind": "convert", "model_ref": "mdl_none", "params": { "tolerance_mm": 0.01 } });
    refused(&service.post("/v1/jobs", &unknown), 422, "/model_ref");
    // What a worker calls the file is no name for callers.
    let inside = format!("{}.obj", view["certificate"]["input_digest"].as_str().unwrap());
    let inside = json!({ "lacuna": 1, "kind": "convert", "model_ref": inside, "params": { "tolerance_mm": 0.01 } });
    refused(&service.post("/v1/jobs", &inside), 422, "job.unknown-model");
}

#[test]
fn a_mesh_is_converted_as_it_is_and_counted() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let id = uploaded(&service, "box.obj", cube(0.0, 10.0).as_bytes())["id"].clone();
    let convert = |source: Value, outputs: Value| {
        let mut job = json!({ "lacuna": 1, "kind": "convert", "params": { "tolerance_mm": 1e-4 }, "outputs": outputs });
        job.as_object_mut().unwrap().extend(source.as_object().unwrap().clone());
        service.done(&job)
    };
    let view = convert(json!({ "model_ref": id }), json!(["obj", "stl", "3mf", "ply"]));
    assert_eq!(view["state"], "succeeded", "{view}");
    let certificate = &view["certificate"];
    for (member, expected) in [
        ("achieved_bound_mm", json!(0.0)),
        ("vertices", json!(8)),
        ("triangles", json!(12)),
        ("edges", json!(18)),
        ("euler", json!(2)),
        ("genus", json!(0)),
        ("components", json!(1)),
        ("boundary_edges", json!(0)),
        ("self_intersections", json!("not_checked")),
        ("mesh_volume_mm3", json!(1000.0)),
        ("warnings", json!([])),
    ] {
        assert_eq!(certificate[member], expected, "{member}");
    }
    let path = format!("/v1/jobs/{}/outputs/obj?redirect=0", view["id"].as_str().unwrap());
    let text = String::from_utf8(service.get(&path).body).unwrap();
    let quads = text.lines().filter(|line| line.starts_with("f ")).map(|line| line.split(' ').count() - 1).collect::<Vec<_>>();
    assert_eq!(quads, [4; 6], "polygons stay polygons");

    // An open mesh has no place in a 3MF file, and a shape that is no mesh is evaluated.
    let open = uploaded(&service, "open.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")["id"].clone();
    let failed = convert(json!({ "model_ref": open }), json!(["3mf"]));
    assert_eq!((&failed["state"], &failed["problem"]["code"]), (&json!("failed"), &json!("format.cannot-carry")), "{failed}");
    let counted = convert(json!({ "model_ref": open }), json!(["ply"]));
    assert_eq!((&counted["certificate"]["boundary_edges"], counted["warnings"].as_array().unwrap().len()), (&json!(3), 1), "{counted}");
    let curve = json!({ "lacuna": 1, "shape": { "family": "corner_cutting", "a": 0.25, "b": 0.25, "control_points": [[0, 0, 0], [1, 1, 0], [2, 0, 0]] } });
    let evaluated = convert(json!({ "model": curve }), json!(["obj"]));
    assert_eq!(evaluated["state"], "succeeded", "{evaluated}");
    assert!(evaluated["certificate"]["achieved_bound_mm"].as_f64().unwrap() > 0.0);
    // A solid is needed, and there is none: the remedy is named.
    let slice = json!({ "lacuna": 1, "kind": "slice", "model_ref": open, "params": { "tolerance_mm": 0.01, "step_mm": 1 } });
    refused(&service.post("/v1/jobs", &slice), 422, "radius_mm");
}

#[test]
fn meshes_belong_to_their_keys() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_API_KEYS", "first-key,second-key")]);
    let body = cube(0.0, 1.0);
    let send = |key: &str| upload(&service, &[("authorization", key), ("content-type", "model/obj")], body.as_bytes());
    assert_eq!(upload(&service, &[("content-type", "model/obj")], body.as_bytes()).status, 401);
    let path = format!("/v1/models/{}", send("Bearer first-key").json()["id"].as_str().unwrap());
    assert_eq!(service.get_with(&path, &[("authorization", "Bearer first-key")]).status, 200);
    assert_eq!(service.get_with(&path, &[("authorization", "Bearer second-key")]).status, 404);
    let job =
        json!({ "lacuna": 1, "kind": "convert", "model_ref": path.trim_start_matches("/v1/models/"), "params": { "tolerance_mm": 0.01 } });
    let foreign = service.post_with("/v1/jobs", &[("authorization", "Bearer second-key")], job.to_string().as_bytes());
    refused(&foreign, 422, "job.unknown-model");
    // The same file under another key is that key's own from then on, and on the disk only once.
    assert_eq!(send("Bearer second-key").status, 201);
    assert_eq!(kept(scratch.path()), 1);
}

/// Archives that no reader should follow.
const ARCHIVES: &str = r#"
import sys, zipfile
def archive(name, entries):
    with zipfile.ZipFile(f"{sys.argv[1]}/{name}", "w", zipfile.ZIP_DEFLATED) as file:
        for entry, content in entries:
            file.writestr(entry, content)
types = ("[Content_Types].xml", '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"><Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>')
def relations(target):
    return ("_rels/.rels", f'<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Target="{target}" Id="a" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>')
model = '<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>{}</resources><build/></model>'
archive("bomb.3mf", [types, relations("/3D/3dmodel.model"), ("3D/3dmodel.model", model.format('<object id="1"><mesh><vertices>' + '<vertex x="0" y="0" z="0"/>' * (4 << 20) + "</vertices></mesh></object>"))])
archive("dtd.3mf", [types, relations("/3D/3dmodel.model"), ("3D/3dmodel.model", '<!DOCTYPE m [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>' + model.format("&b;"))])
archive("traversal.3mf", [types, relations("/../../../../etc/passwd"), ("../../../../etc/passwd", model.format(""))])
archive("entries.3mf", [types, relations("/3D/3dmodel.model")] + [(f"x/{k}", b"") for k in range(1500)])
"#;

#[test]
fn files_that_lie_are_refused_and_leave_nothing() {
    let scratch = Scratch::new();
    let data = scratch.join("data");
    let environment = [("LACUNA_UPLOAD_BYTES", "1000000"), ("LACUNA_BODY_SECONDS", "1")];
    let service = Service::start_with(&data, &environment);
    let made = Command::new(system_python().get_program()).arg("-c").arg(ARCHIVES).arg(scratch.path()).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let before = service.resident_bytes();
    for (name, named) in
        [("bomb.3mf", "inflated_bytes"), ("dtd.3mf", "3D/3dmodel.model"), ("traversal.3mf", "passwd"), ("entries.3mf", "archive_entries")]
    {
        let body = std::fs::read(scratch.join(name)).unwrap();
        refused(&upload(&service, &[("content-type", "model/3mf")], &body), 422, named);
    }
    let grown = service.resident_bytes().saturating_sub(before);
    assert!(grown < 150 << 20, "the service has grown by {grown} bytes");

    let mut stl = vec![0_u8; 84 + 50];
    stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    refused(&upload(&service, &[("content-type", "model/stl")], &stl), 422, "format.");
    let ply = "ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n";
    refused(&upload(&service, &[("content-type", "application/octet-stream")], ply.as_bytes()), 422, "12000000000");
    refused(&upload(&service, &[("content-type", "model/obj")], b"v 0 0 0\nf 1 2 9\n"), 422, "line 2");
    refused(&upload(&service, &[("content-type", "model/obj")], b""), 422, "");
    refused(&upload(&service, &[("content-type", "model/obj")], b"v 0 0 0\n"), 422, "upload.empty");
    refused(&upload(&service, &[("content-type", "model/obj")], b"v 0 0 0\nv 1 0 0\nl 1 3\n"), 422, "line 3");
    let edge = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nelement edge 1\nproperty int vertex1\nend_header\n0 0 0\n0\n";
    refused(&upload(&service, &[("content-type", "application/octet-stream")], edge.as_bytes()), 422, "vertex1 and vertex2");
    refused(&upload(&service, &[("content-type", "application/octet-stream")], b"nothing that is known"), 422, "format.unknown");
    refused(&upload(&service, &[("content-type", "image/png")], b"\x89PNG"), 415, "model/stl");
    refused(&service.request("POST", "/v1/models?format=dwg", &[("content-type", "application/octet-stream")], b"x"), 415, "dwg");
    refused(&service.request("POST", "/v1/models?colour=red", &[("content-type", "model/stl")], b"x"), 400, "colour");

    // Too long, said beforehand or not; and too slow.
    let announced = "POST /v1/models HTTP/1.1\r\nhost: localhost\r\ncontent-type: model/stl\r\ncontent-length: 1000001\r\n\r\n";
    let answer = service.raw(announced.as_bytes(), Duration::from_secs(10));
    assert!(answer.starts_with("HTTP/1.1 413") && answer.contains("upload_bytes"), "{answer}");
    let mut chunked =
        b"POST /v1/models HTTP/1.1\r\nhost: localhost\r\ncontent-type: model/stl\r\ntransfer-encoding: chunked\r\n\r\n".to_vec();
    for _ in 0..11 {
        chunked.extend_from_slice(b"186a0\r\n");
        chunked.extend(std::iter::repeat_n(b' ', 100_000));
        chunked.extend_from_slice(b"\r\n");
    }
    let answer = service.raw(&chunked, Duration::from_secs(10));
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 413"), "{answer}");
    let mut slow = TcpStream::connect(service.address).unwrap();
    slow.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    slow.write_all(b"POST /v1/models HTTP/1.1\r\nhost: localhost\r\ncontent-type: model/stl\r\ncontent-length: 1000\r\n\r\nsolid").unwrap();
    let mut answer = [0_u8; 12];
    slow.read_exact(&mut answer).unwrap();
    assert_eq!(&answer, b"HTTP/1.1 408");
    drop(slow);

    assert_eq!(service.get("/readyz").status, 200);
    assert_eq!(kept(&data), 0, "refused uploads leave no file");
    assert_eq!(service.get("/v1/models").json()["items"], json!([]));
}

#[test]
fn a_key_keeps_no_more_than_its_share() {
    let scratch = Scratch::new();
    let (first, second) = (cube(0.0, 1.0), cube(0.0, 2.0));
    let share = (first.len() + second.len() - 1).to_string();
    let service = Service::start_with(scratch.path(), &[("LACUNA_STORED_BYTES_PER_KEY", &share)]);
    let id = uploaded(&service, "a.obj", first.as_bytes())["id"].as_str().unwrap().to_owned();
    let headers = [("content-type", "model/obj")];
    refused(&upload(&service, &headers, second.as_bytes()), 422, "limit.stored-bytes");
    // The same again is no more; and what is forgotten makes room.
    assert_eq!(upload(&service, &headers, first.as_bytes()).status, 200);
    assert_eq!(service.delete(&format!("/v1/models/{id}")).status, 204);
    assert_eq!(upload(&service, &headers, second.as_bytes()).status, 201);
    // Model documents count as mesh files do.
    refused(&service.post("/v1/models", &model("ifs/sierpinski_tetrahedron")), 422, "limit.stored-bytes");
}

#[test]
fn a_job_cannot_name_a_mesh_until_memory_ends() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_LIMIT_TRIANGLES", "100")]);
    let id = uploaded(&service, "box.obj", cube(0.0, 1.0).as_bytes())["id"].clone();
    let inputs: Vec<Value> = (0..20).map(|k| json!({ "name": format!("box {k}"), "model_ref": id })).collect();
    let job = json!({ "lacuna": 1, "kind": "intersect", "inputs": inputs, "params": { "tolerance_mm": 0.01, "operation": "union" } });
    refused(&service.post("/v1/jobs", &job), 422, "limit.referenced-faces");
}

/// One face that goes round its three corners so many times: a file of little more than six bytes for each time.
fn long_face(rounds: usize) -> Vec<u8> {
    format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf{}\n", " 1 2 3".repeat(rounds)).into_bytes()
}

#[test]
fn files_are_read_apart_from_the_service_while_somebody_waits() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_API_KEYS", "first-key,second-key")]);
    let file = long_face(2_000_000);
    let head = format!(
        "POST /v1/models HTTP/1.1\r\nhost: localhost\r\nauthorization: Bearer first-key\r\ncontent-type: model/obj\r\ncontent-length: {}\r\n\r\n",
        file.len()
    );
    let client = || {
        let mut client = TcpStream::connect(service.address).unwrap();
        client.write_all(head.as_bytes()).unwrap();
        client.write_all(&file).unwrap();
        client
    };
    let first = client();
    until(Duration::from_secs(20), "a reader", || !service.answering().is_empty());
    // It will take as long as it likes.
    let reader = service.answering()[0];
    assert!(send_signal(reader, "STOP"));
    let others: Vec<TcpStream> = (0..9).map(|_| client()).collect();

    // Ten files of one key wait for it, and nobody else.
    let second = ("authorization", "Bearer second-key");
    assert_eq!(service.get_with("/v1/models", &[second]).status, 200);
    let cube = upload(&service, &[second, ("content-type", "model/obj")], cube(0.0, 1.0).as_bytes());
    assert_eq!(cube.status, 201, "{}", cube.json());
    let job = json!({ "lacuna": 1, "kind": "convert", "model_ref": cube.json()["id"], "params": { "tolerance_mm": 0.01 } });
    assert_eq!(service.post_with("/v1/jobs", &[second], job.to_string().as_bytes()).status, 202);
    assert!(is_alive(reader));

    drop((first, others));
    until(Duration::from_secs(20), "the end of what nobody waits for", || !service.answering().contains(&reader));
    assert_eq!(service.get_with("/v1/models", &[("authorization", "Bearer first-key")]).json()["items"], json!([]));
}

#[test]
fn a_file_that_takes_too_much_is_refused_with_the_way_out() {
    for (setting, value, code) in
        [("LACUNA_LIMIT_MEMORY_BYTES", "30000000", "limit.memory"), ("LACUNA_LIMIT_SECONDS", "0.02", "limit.seconds")]
    {
        let scratch = Scratch::new();
        let service = Service::start_with(scratch.path(), &[(setting, value)]);
        let answer = upload(&service, &[("content-type", "model/obj")], &long_face(1_000_000));
        refused(&answer, 422, code);
        let detail = answer.json()["detail"].to_string();
        assert!(detail.contains(value) && detail.contains("fewer triangles"), "{detail}");
        assert_eq!(kept(scratch.path()), 0);
    }
}

#[test]
fn an_order_is_repeated_though_its_model_has_been_forgotten() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let id = uploaded(&service, "box.obj", cube(0.0, 1.0).as_bytes())["id"].clone();
    let job = json!({ "lacuna": 1, "kind": "convert", "model_ref": id, "params": { "tolerance_mm": 0.01 } });
    let batch = json!({ "lacuna": 1, "jobs": [{ "job": job }] });
    let send = |path: &str, document: &Value| service.post_with(path, &[("idempotency-key", "once")], document.to_string().as_bytes());
    let first = (send("/v1/jobs", &job), send("/v1/batches", &batch));
    assert!(first.0.status < 300 && first.1.status < 300, "{} {}", first.0.json(), first.1.json());
    assert_eq!(service.delete(&format!("/v1/models/{}", id.as_str().unwrap())).status, 204);
    let again = (send("/v1/jobs", &job), send("/v1/batches", &batch));
    for (first, again) in [(first.0, again.0), (first.1, again.1)] {
        assert_eq!((again.header("idempotency-replayed"), &again.json()["id"]), ("true", &first.json()["id"]), "{}", again.json());
    }
    // Another body is another order, whatever it names; and without the key the model is missed.
    let mut other = job.clone();
    other["params"]["tolerance_mm"] = json!(0.02);
    refused(&send("/v1/jobs", &other), 422, "idempotency-mismatch");
    refused(&service.post("/v1/jobs", &job), 422, "job.unknown-model");
}
