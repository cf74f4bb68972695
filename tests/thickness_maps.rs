//! Maps of thickness, from the command and from jobs, read back: by our own reader and, with rays instead of shadows, by trimesh and numpy.

use std::f64::consts::PI;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use lacuna_exchange::format::{ReadLimits, read};
use lacuna_kernel::solid::TriMesh;
use lacuna_tests::support::binary::{run, succeed};
use lacuna_tests::support::python::{Judge, skipped};
use lacuna_tests::support::scratch::Scratch;
use serde_json::{Value, json};

/// A file of a map: its mesh, and wall and gap of every vertex and face.
struct Map {
    mesh: TriMesh,
    vertices: Vec<[f32; 2]>,
    faces: Vec<[f32; 2]>,
}

fn map_of(path: &Path) -> Map {
    let bytes = fs::read(path).unwrap();
    let mesh = read(&bytes, None, &ReadLimits::default()).unwrap().mesh;
    let end = b"end_header\n";
    let body = bytes.windows(end.len()).position(|words| words == end).unwrap() + end.len();
    let pair = |at: usize| [at, at + 4].map(|at| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()));
    // Three coordinates and both thicknesses; a count, three corners, and both.
    let after = body + 20 * mesh.vertices.len();
    assert_eq!(bytes.len(), after + 21 * mesh.triangles.len());
    let vertices = (0..mesh.vertices.len()).map(|k| pair(body + 20 * k + 12)).collect();
    let faces = (0..mesh.triangles.len()).map(|k| pair(after + 21 * k + 13)).collect();
    Map { mesh, vertices, faces }
}

/// Measures a model with a map beside it; further words go before the files.
fn measured(further: &[&str], model: &Path, map: &Path) -> Value {
    let words = ["measure", "--thickness"].iter().chain(further).map(OsStr::new);
    let said = succeed(words.chain([model.as_os_str(), OsStr::new("--map"), map.as_os_str()]));
    serde_json::from_slice(&said).unwrap()
}

fn cuboid() -> Value {
    let corners: Vec<[f64; 3]> = (0..8).map(|k| [3.0 * f64::from(k & 1), 5.0 * f64::from(k >> 1 & 1), 7.5 * f64::from(k >> 2)]).collect();
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    json!({ "family": "mesh", "vertices": corners, "faces": faces })
}

fn write(folder: &Scratch, name: &str, document: &Value) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, document.to_string()).unwrap();
    path
}

/// Lines of an OFF file for a sphere by latitude and longitude, its faces seen from outside or from inside.
fn sphere(radius: f64, outwards: bool, corners: &mut Vec<String>, faces: &mut Vec<String>) {
    const RINGS: usize = 31;
    const SECTORS: usize = 64;
    let first = corners.len();
    let mut corner = |polar: f64, angle: f64| {
        let [x, y, z] = [polar.sin() * angle.cos(), polar.sin() * angle.sin(), polar.cos()].map(|x| radius * x);
        corners.push(format!("{x} {y} {z}"));
    };
    corner(0.0, 0.0);
    corner(PI, 0.0);
    for ring in 1..=RINGS {
        (0..SECTORS).for_each(|sector| corner(PI * ring as f64 / (RINGS + 1) as f64, 2.0 * PI * sector as f64 / SECTORS as f64));
    }
    let at = |ring: usize, sector: usize| first + 2 + ring * SECTORS + sector % SECTORS;
    let mut face = |[a, b, c]: [usize; 3]| faces.push(if outwards { format!("3 {a} {b} {c}") } else { format!("3 {a} {c} {b}") });
    for sector in 0..SECTORS {
        face([first, at(0, sector), at(0, sector + 1)]);
        face([first + 1, at(RINGS - 1, sector + 1), at(RINGS - 1, sector)]);
        for ring in 0..RINGS - 1 {
            face([at(ring, sector), at(ring + 1, sector), at(ring + 1, sector + 1)]);
            face([at(ring, sector), at(ring + 1, sector + 1), at(ring, sector + 1)]);
        }
    }
}

/// A ball of radius 5 with a hollow of radius 4.
fn hollow_ball(folder: &Scratch) -> PathBuf {
    let (mut corners, mut faces) = (Vec::new(), Vec::new());
    sphere(5.0, true, &mut corners, &mut faces);
    sphere(4.0, false, &mut corners, &mut faces);
    let path = folder.join("hollow.off");
    fs::write(&path, format!("OFF\n{} {} 0\n{}\n{}\n", corners.len(), faces.len(), corners.join("\n"), faces.join("\n"))).unwrap();
    path
}

/// By the command and by a job document, the same bytes: faces are as thick as the box is across them, corners as its least edge.
#[test]
fn a_cuboid() {
    let folder = Scratch::new();
    let model = json!({ "lacuna": 1, "shape": cuboid() });
    let (path, file) = (write(&folder, "cuboid.json", &model), folder.join("map.ply"));
    let told = measured(&["--tolerance", "0.01"], &path, &file);
    let found = map_of(&file);
    assert_eq!((found.mesh.vertices.len(), found.mesh.triangles.len()), (8, 12));
    for (corners, &[wall, gap]) in found.mesh.triangles.iter().zip(&found.faces) {
        let [a, b, c] = corners.map(|corner| found.mesh.vertices[corner as usize]);
        let across = (b - a).cross(c - a).normalize().abs().dot(DVec3::new(3.0, 5.0, 7.5));
        assert!((f64::from(wall) - across).abs() < 1e-6 && gap == f32::INFINITY, "{wall} across {across}, {gap}");
    }
    assert!(found.vertices.iter().all(|&[wall, gap]| wall == 3.0 && gap == f32::INFINITY), "{:?}", found.vertices);
    let [low, high] = [0, 1].map(|end| told["thickness"]["wall"]["least_mm"][end].as_f64().unwrap());
    assert!(low <= 3.0 && 3.0 <= high && told["thickness"].get("gap").is_none(), "{}", told["thickness"]);

    let params = json!({ "tolerance_mm": 0.01, "thickness": true });
    let job = json!({ "lacuna": 1, "kind": "measure", "model": model, "params": params, "outputs": ["ply"] });
    let job = write(&folder, "job.json", &job);
    let said = succeed([OsStr::new("run"), job.as_os_str(), OsStr::new("-o"), folder.join("made").as_os_str()]);
    let said: Value = serde_json::from_slice(&said).unwrap();
    assert_eq!(fs::read(folder.join("made/shape.ply")).unwrap(), fs::read(&file).unwrap());
    assert_eq!(said["certificate"]["output_digests"], told["output_digests"]);
    assert!(told["output_digests"]["ply"].as_str().unwrap().starts_with("sha256:"), "{told}");
}

/// The same bytes for one thread and for two, and what others find by rays.
#[test]
fn a_hollow_ball() {
    let folder = Scratch::new();
    let (model, files) = (hollow_ball(&folder), ["1", "2"].map(|threads| (threads, folder.join(&format!("{threads}.ply")))));
    for (threads, file) in &files {
        measured(&["--tolerance", "0.01", "--threads", threads], &model, file);
    }
    assert!(fs::read(&files[0].1).unwrap() == fs::read(&files[1].1).unwrap());
    let found = map_of(&files[0].1);
    // Faces are within their sphere by 1 - cos(pi / 64)^2 of its radius at most; the corners of one of 0.5 by 0.5 are 0.36 from its middle, where the other
    // sphere is farther by 0.36^2 / 8.
    let flat = 1.0 - (PI / 64.0).cos().powi(2);
    let (wall_mm, gap_mm) = (1.0 - 5.0 * flat..=1.0 + 4.0 * flat + 0.017, 8.0 * (1.0 - flat) - 0.04..=8.0);
    for (corners, &[wall, gap]) in found.mesh.triangles.iter().zip(&found.faces) {
        let is_outer = found.mesh.vertices[corners[0] as usize].length() > 4.5;
        assert!(wall_mm.contains(&f64::from(wall)), "{wall}");
        assert!(if is_outer { gap == f32::INFINITY } else { gap_mm.contains(&f64::from(gap)) }, "{gap}");
    }
    if skipped() {
        return;
    }
    let report = Judge::start().report(&files[0].1, false);
    assert_eq!((&report["triangles"], &report["cavities"]), (&json!(found.faces.len()), &json!(1)), "{report}");
    for (name, infinite) in [("wall_mm", 0), ("gap_mm", found.faces.len() / 2)] {
        let field = &report["map"][name];
        assert_eq!(
            (&field["infinite"], &field["above_a_ray"], &field["off_at_vertices"]),
            (&json!(infinite), &json!(0), &json!(0)),
            "{report}"
        );
        // From the middle of a face the other sphere is as far as from any point of it but for what faces are flat.
        assert!(field["below_its_ray_by"].as_f64().unwrap() < 0.06, "{report}");
    }
}

/// Of the dilation of a point the mesh lies between balls of 2 - 0.02 and 2 + 0.02; through a face next to an edge the way across is shorter by what faces turn.
#[test]
fn a_dilation() {
    let folder = Scratch::new();
    let shape = json!({ "family": "mesh", "vertices": [[1, 2, 3]], "faces": [[0]] });
    let (model, file) = (write(&folder, "point.json", &json!({ "lacuna": 1, "shape": shape })), folder.join("map.ply"));
    let told = measured(&["--tolerance", "0.02", "--radius", "2"], &model, &file);
    let found = map_of(&file);
    let least = told["thickness"]["wall"]["least_mm"][1].as_f64().unwrap();
    for &[wall, gap] in found.vertices.iter().chain(&found.faces) {
        assert!((3.9..=4.04).contains(&wall) && f64::from(wall) >= least - 1e-6 && gap == f32::INFINITY, "{wall}, {gap}");
    }
    assert!(found.vertices.iter().any(|&[wall, _]| (f64::from(wall) - least).abs() < 1e-6), "{least}");
}

/// What has no map is refused, with the way out, and leaves no file.
#[test]
fn refusals() {
    let folder = Scratch::new();
    let cuboid = write(&folder, "cuboid.json", &json!({ "lacuna": 1, "shape": cuboid() }));
    let open = json!({ "family": "mesh", "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]] });
    let open = write(&folder, "open.json", &json!({ "lacuna": 1, "shape": open }));
    let [map, other] = ["map.ply", "map.stl"].map(|name| folder.join(name));
    let [cuboid, open, map, other] = [&cuboid, &open, &map, &other].map(|path| path.to_str().unwrap());
    for (words, status, expected) in [
        (&["--thickness", open, "--map", map][..], 3, "only solids have walls"),
        (&["--thickness", cuboid, "--map", map, "--limit-triangles", "11"], 4, "12 triangles; 11 are allowed"),
        (&["--thickness", cuboid, "--map", other], 2, ".ply"),
        (&["--thickness", cuboid, "--map", "-"], 2, "stdout carries the certificate"),
        (&[cuboid, "--map", map], 2, "--thickness"),
        (&["--thickness", cuboid, cuboid, "--map", map], 2, "cannot be used with"),
    ] {
        let output = run(["measure", "--tolerance", "0.01"].iter().chain(words));
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(status) && said.contains(expected), "{words:?}: {:?}, {said}", output.status);
        assert!(output.stdout.is_empty() && !Path::new(map).exists() && !Path::new(other).exists(), "{words:?}");
    }
    for (thickness, outputs) in [(false, json!(["ply"])), (true, json!(["stl"])), (true, json!(["ply", "stl"]))] {
        let params = json!({ "tolerance_mm": 0.01, "thickness": thickness });
        let model = json!({ "lacuna": 1, "shape": self::cuboid() });
        let job = json!({ "lacuna": 1, "kind": "measure", "model": model, "params": params, "outputs": outputs });
        let job = write(&folder, "job.json", &job);
        let made = folder.join("made");
        let output =
            run([OsStr::new("--error-format"), OsStr::new("json"), OsStr::new("run"), job.as_os_str(), OsStr::new("-o"), made.as_os_str()]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(3) && said.contains("document.conflicting-members"), "{outputs}: {said}");
        assert!(!made.exists());
    }
}
