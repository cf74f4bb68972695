//! Distances, contacts and comparisons of shapes through the command and as job documents, against closed forms.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3Swizzles};
use lacuna_exchange::document::{DocumentLimits, read_job};
use lacuna_exchange::library;
use lacuna_tests::support::binary;
use lacuna_tests::support::scratch::Scratch;
use serde_json::{Value, json};

fn write(folder: &Scratch, name: &str, shape: &Value) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, json!({ "lacuna": 1, "shape": shape }).to_string()).unwrap();
    path
}

fn told(words: &[&str], paths: &[&Path]) -> Value {
    let arguments = words.iter().map(OsStr::new).chain(paths.iter().map(|path| path.as_os_str()));
    serde_json::from_slice(&binary::succeed(arguments)).unwrap()
}

#[track_caller]
fn assert_within(interval: &Value, exact: f64, width: f64) {
    let [low, high] = [0, 1].map(|k| interval[k].as_f64().unwrap());
    assert!(low <= exact && exact <= high && high - low <= width, "{exact} and {interval}");
}

#[test]
fn segments_that_pass_each_other() {
    let folder = Scratch::new();
    let first = write(&folder, "a.json", &json!({ "family": "mesh", "vertices": [[-5, 0, 0], [5, 0, 0]], "faces": [[0, 1]] }));
    let second = write(&folder, "b.json", &json!({ "family": "mesh", "vertices": [[0, -5, 3], [0, 5, 3]], "faces": [[0, 1]] }));
    let found = told(&["intersect", "--tolerance", "0.01"], &[&first, &second]);
    assert_eq!((&found["contact"]["verdict"], &found["contact"]["complete"]), (&json!("disjoint"), &json!(true)));
    assert_within(&found["contact"]["distance_mm"], 3.0, 0.05);
    assert_eq!(found["contact"]["places"], json!([]));
    // They cross when the second is lifted to the first.
    let third = write(&folder, "c.json", &json!({ "family": "mesh", "vertices": [[0, -5, 0], [0, 5, 0]], "faces": [[0, 1]] }));
    let found = told(&["intersect", "--tolerance", "0.01"], &[&first, &third]);
    // That curves in one plane meet is not proven; how near they come is.
    assert_eq!((&found["contact"]["verdict"], found["contact"]["places"].as_array().unwrap().len()), (&json!("near"), 1));
    assert_within(&found["contact"]["distance_mm"], 0.0, 1e-9);
    // Each end is 5 from the other segment.
    let found = told(&["measure", "--tolerance", "0.01"], &[&first, &third]);
    assert_within(&found["hausdorff"]["distance_mm"], 5.0, 0.01);
}

#[test]
fn a_fractal_and_what_lies_beside_it() {
    let folder = Scratch::new();
    let path = folder.join("koch.json");
    std::fs::write(&path, library::find("koch_curve").unwrap().document).unwrap();
    // 100 mm long, its top at sqrt(3) / 6 of that; nothing of it below the base line.
    let top = 100.0 * 3.0_f64.sqrt() / 6.0;
    let plane = |height: f64| told(&["intersect", "--tolerance", "0.01", "--with", &format!("plane:0,1,0,{height}")], &[&path]);
    assert_within(&plane(top + 2.0)["contact"]["distance_mm"], 2.0, 0.05);
    assert_eq!(plane(top / 2.0)["contact"]["verdict"], "touching");
    let point = told(&["intersect", "--tolerance", "0.01", "--with", &format!("point:50,{top},0")], &[&path]);
    assert_eq!((&point["contact"]["verdict"], point["contact"]["places"].as_array().unwrap().len()), (&json!("near"), 1));
    let ball = told(&["intersect", "--tolerance", "0.01", "--with", "ball:50,-4,0,1"], &[&path]);
    assert_eq!(ball["contact"]["verdict"], "disjoint");
}

/// Solids and mesh files against each other: what they enclose counts.
#[test]
fn how_far_solids_are_from_each_other() {
    let folder = Scratch::new();
    let outer = write(&folder, "outer.json", &cube(-10.0, 10.0));
    let file = folder.join("inner.off");
    let corners: String = (0..8).map(|k| format!("{} {} {}\n", 4 * (k & 1), 4 * (k >> 1 & 1), 4 * (k >> 2))).collect();
    let faces = "4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n";
    std::fs::write(&file, format!("OFF\n8 6 0\n{corners}{faces}")).unwrap();
    let found = told(&["measure", "--tolerance", "0.2"], &[&outer, &file])["hausdorff"].clone();
    // From the corner (-10, -10, -10) to (0, 0, 0); no point of the inner one is beyond the outer.
    assert_within(&found["from_first"]["distance_mm"], 300.0_f64.sqrt(), 0.2);
    assert_within(&found["from_second"]["distance_mm"], 0.0, 0.2);
    // A sphere's worth of surface around nothing: its middle is far from it.
    let mut hollow = cube(-10.0, 10.0);
    hollow["interior"] = json!("surface");
    let hollow = write(&folder, "hollow.json", &hollow);
    let found = told(&["measure", "--tolerance", "0.2"], &[&outer, &hollow])["hausdorff"].clone();
    assert_within(&found["from_first"]["distance_mm"], 10.0, 0.2);
    assert_eq!(found["complete"], true);
}

/// Koch's curve as maps touches itself where its parts meet; as a curve whose parts share their ends it does not.
#[test]
fn a_shape_and_itself() {
    let folder = Scratch::new();
    let turned = |angle: f64, x: f64, y: f64| json!({ "scale": 1.0 / 3.0, "angle_deg": angle, "translation": [x, y, 0.0] });
    let four = [turned(0.0, 0.0, 0.0), turned(60.0, 30.0, 0.0), turned(-60.0, 45.0, 25.98076211353316), turned(0.0, 60.0, 0.0)];
    let maps = write(&folder, "maps.json", &json!({ "family": "ifs", "maps": four }));
    let itself = |path: &Path| told(&["intersect", "--tolerance", "0.5", "--with", "self"], &[path])["contact"].clone();
    let found = itself(&maps);
    let places = found["places"].as_array().unwrap();
    // 90 mm long: cells of 90, 30 and 10 mm are cut in four, and nothing is declared to join the 64 pieces.
    assert_eq!((&found["verdict"], places.len(), &found["complete"]), (&json!("near"), 63, &json!(true)));
    assert!(places.iter().all(|place| place["nearest"]["first"] != place["nearest"]["second"] && place["nearest"]["second"].is_string()));
    let curve = write(
        &folder,
        "curve.json",
        &json!({
            "family": "interpolation",
            "points": [[0, 0, 0], [30, 0, 0], [45, 25.98076211353316, 0], [60, 0, 0], [90, 0, 0]],
            "maps": four
        }),
    );
    let found = itself(&curve);
    assert_eq!((&found["verdict"], &found["places"], &found["complete"]), (&json!("disjoint"), &json!([]), &json!(true)));
    assert!(found["distance_mm"][0].as_f64().unwrap() > 0.5);
    // The same as a job.
    let model: Value = serde_json::from_slice(&std::fs::read(&curve).unwrap()).unwrap();
    let job = |with: Value| json!({ "lacuna": 1, "kind": "intersect", "model": { "shape": model["shape"] }, "params": { "tolerance_mm": 0.5, "with": with } });
    let path = folder.join("job.json");
    std::fs::write(&path, job(json!({ "self": true })).to_string()).unwrap();
    assert_eq!(told(&["run", "--output"], &[&folder.join("made"), &path])["certificate"]["contact"], found);
    for (with, place) in
        [(json!({ "self": false }), "/params/with/self"), (json!({ "self": true, "point": [0, 0, 0] }), "/params/with/self")]
    {
        let faults = read_job(job(with).to_string().as_bytes(), &DocumentLimits::default()).unwrap_err();
        assert!(faults.iter().any(|fault| fault.pointer == place), "{faults:?}");
    }
    // A triangle alone has nothing that could touch it.
    let alone =
        write(&folder, "alone.json", &json!({ "family": "mesh", "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]] }));
    let words = ["intersect", "--tolerance", "0.5", "--with", "self"];
    let output = binary::run(words.iter().map(OsStr::new).chain([alone.as_os_str()]));
    assert_eq!(output.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&output.stderr).contains("a smaller tolerance looks closer"));
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let folder = Scratch::new();
    let path = write(&folder, "a.json", &json!({ "family": "mesh", "vertices": [[0, 0, 0]], "faces": [[0]] }));
    for words in [
        vec!["intersect", "--tolerance", "0.1"],
        vec!["intersect", "--tolerance", "0.1", "--with", "plane:0,0,1"],
        vec!["intersect", "--tolerance", "0.1", "--with", "cone:0,0,1"],
        vec!["intersect", "--tolerance", "0.1", "--with", "point:0,0,0", "--operation", "union", "-o", "a.stl"],
        vec!["intersect", "--tolerance", "0.1", "--operation", "union"],
        vec!["measure", "--tolerance", "0.1", "--direction", "0,0,0"],
        vec!["measure", "--tolerance", "0.1", "--direction", "1,2"],
    ] {
        let output = binary::run(words.iter().map(OsStr::new).chain([path.as_os_str()]));
        assert_eq!(output.status.code(), Some(2), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
    let output =
        binary::run(["intersect", "--tolerance", "0.1", "--with", "plane:0,0,0,1"].iter().map(OsStr::new).chain([path.as_os_str()]));
    assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
    let model = json!({ "shape": { "family": "mesh", "vertices": [[0, 0, 0]], "faces": [[0]] } });
    let input = |name: &str| json!({ "name": name, "model": model });
    let job = |inputs: Value, params: Value| json!({ "lacuna": 1, "kind": "intersect", "inputs": inputs, "params": params }).to_string();
    let tolerance = json!({ "tolerance_mm": 0.1 });
    let with = json!({ "tolerance_mm": 0.1, "with": { "point": [0, 0, 0] } });
    let both = json!({ "tolerance_mm": 0.1, "with": { "point": [0, 0, 0], "ball": [0, 0, 0, 1] } });
    let short = json!({ "tolerance_mm": 0.1, "with": { "plane": [0, 0, 1] } });
    let union = json!({ "tolerance_mm": 0.1, "operation": "union" });
    let dilated = json!({ "tolerance_mm": 0.1, "radius_mm": 1 });
    for (document, place) in [
        (job(json!([input("a")]), tolerance.clone()), "/inputs"),
        (job(json!([input("a"), input("b"), input("c")]), tolerance.clone()), "/inputs"),
        (job(json!([input("a"), input("b")]), with.clone()), "/inputs"),
        (job(json!([input("a")]), union), "/inputs"),
        (job(json!([input("a"), input("b")]), dilated), "/params"),
        (job(json!([input("a")]), both), "/params/with/ball"),
        (job(json!([input("a")]), short), "/params/with/plane"),
    ] {
        let faults = read_job(document.as_bytes(), &DocumentLimits::default()).unwrap_err();
        assert!(faults.iter().any(|fault| fault.pointer == place), "{document}: {faults:?}");
    }
    for document in [job(json!([input("a"), input("b")]), tolerance), job(json!([input("a")]), with)] {
        assert!(read_job(document.as_bytes(), &DocumentLimits::default()).is_ok(), "{document}");
    }
}

/// A cube as a solid.
fn cube(low: f64, high: f64) -> Value {
    let corners: Vec<[f64; 3]> = (0..8).map(|code| [0, 1, 2].map(|axis| if code >> axis & 1 == 1 { high } else { low })).collect();
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    json!({ "family": "mesh", "vertices": corners, "faces": faces })
}

#[test]
fn what_lies_inside_a_solid_is_not_apart_from_it() {
    let folder = Scratch::new();
    let (outer, inner) = (write(&folder, "outer.json", &cube(-10.0, 10.0)), write(&folder, "inner.json", &cube(-1.0, 1.0)));
    let contact =
        |words: &[&str], paths: &[&Path]| told(&[&["intersect", "--tolerance", "0.01"], words].concat(), paths)["contact"].clone();
    for (paths, holder) in [([outer.as_path(), inner.as_path()], "first"), ([inner.as_path(), outer.as_path()], "second")] {
        let found = contact(&[], &paths);
        assert_eq!(
            (&found["verdict"], &found["distance_mm"], &found["inside"]["holder"]),
            (&json!("touching"), &json!([0.0, 0.0]), &json!(holder))
        );
        assert_within(&found["inside"]["surface_distance_mm"], 9.0, 0.05);
    }
    // Also where it is a part among others, which enclose nothing.
    let wire = json!({ "family": "mesh", "vertices": [[50, 0, 0], [60, 0, 0]], "faces": [[0, 1]] });
    let mixed = write(&folder, "mixed.json", &json!({ "family": "group", "parts": [cube(-10.0, 10.0), wire] }));
    let found = contact(&["--with", "point:5,5,5"], &[&mixed]);
    assert_eq!(
        (&found["verdict"], &found["distance_mm"], &found["inside"]["holder"]),
        (&json!("touching"), &json!([0.0, 0.0]), &json!("first"))
    );
    // Beside each other they are apart, and neither holds the other.
    let beside = write(&folder, "beside.json", &cube(13.0, 15.0));
    let found = contact(&[], &[&outer, &beside]);
    assert_eq!((&found["verdict"], &found["inside"]), (&json!("disjoint"), &Value::Null));
    assert_within(&found["distance_mm"], 27.0_f64.sqrt(), 0.05);
    // Points of both, as far apart as they are told to be: corners of the cubes; of a ball and a plane the nearest to the cube.
    let points = |found: &Value| {
        ["first_mm", "second_mm"].map(|name| DVec3::from_array(serde_json::from_value(found["nearest"][name].clone()).unwrap()))
    };
    let [first, second] = points(&found);
    assert!(first.distance(DVec3::splat(10.0)) < 1e-9 && second.distance(DVec3::splat(13.0)) < 1e-9, "{found}");
    for (with, exact) in [("ball:16,3,2,1", [15.0, 3.0, 2.0]), ("box:12,1,1,14,3,3", [12.0, 1.0, 1.0]), ("point:11,2,3", [11.0, 2.0, 3.0])]
    {
        let [first, second] = points(&contact(&["--with", with], &[&outer]));
        // Of a side that faces a side any point is as near.
        assert!(
            (second.x - exact[0]).abs() < 1e-9 && (first.x - 10.0).abs() < 1e-9 && (first - second).yz().length() < 1e-9,
            "{with}: {first} {second}"
        );
    }
    let [first, second] = points(&contact(&["--with", "plane:0,0,1,12"], &[&outer]));
    assert!((second.z - 12.0).abs() < 1e-9 && (first.z - 10.0).abs() < 1e-9, "{first} {second}");
    // Cells of a smooth curve, the circle of 5 about the origin: the points lie on it.
    let weight = 0.5_f64.sqrt();
    let arc = json!({ "family": "bezier_curve", "control_points": [[5, 0, 0], [5, 5, 0], [0, 5, 0]], "weights": [1, weight, 1] });
    let found = contact(&["--with", "ball:8,8,0,1"], &[&write(&folder, "arc.json", &arc)]);
    let [first, second] = points(&found);
    let off: [f64; 2] = serde_json::from_value(found["nearest"]["off_mm"].clone()).unwrap();
    assert!((first.length() - 5.0).abs() <= off[0] + 1e-12 && off[0] < 1e-9, "{found}");
    assert!((second.distance(DVec3::new(8.0, 8.0, 0.0)) - 1.0).abs() < 1e-9, "{found}");
    // Dust of which one piece lies within: Cantor's set from 0 to 33 along x, its halves from 0 to 11 and from 22 on.
    let dust = json!({ "family": "ifs", "maps": [
        { "scale": 0.3333333333333333, "translation": [0, 0, 0] }, { "scale": 0.3333333333333333, "translation": [22, 0, 0] }
    ] });
    let dust = write(&folder, "dust.json", &dust);
    let wide = write(&folder, "wide.json", &cube(-15.0, 15.0));
    let found = contact(&[], &[&dust, &wide]);
    assert_eq!((&found["verdict"], &found["inside"]["holder"]), (&json!("touching"), &json!("second")), "{found}");
    assert_within(&found["inside"]["surface_distance_mm"], 4.0, 0.05);
    // Primitives: bounded ones may lie within, lines never do.
    for (with, verdict, exact) in
        [("point:1,2,3", "touching", 7.0), ("segment:0,0,0,4,0,0", "touching", 6.0), ("ball:0,0,0,2", "touching", 8.0)]
    {
        let found = contact(&["--with", with], &[&outer]);
        assert_eq!(found["verdict"], verdict, "{with}: {found}");
        assert_within(&found["inside"]["surface_distance_mm"], exact, 0.05);
    }
    for (with, exact) in [("point:1,2,13", 3.0), ("line:0,0,14,1,0,0", 4.0), ("plane:0,0,1,12", 2.0)] {
        let found = contact(&["--with", with], &[&outer]);
        assert_eq!((&found["verdict"], &found["inside"]), (&json!("disjoint"), &Value::Null), "{with}: {found}");
        assert_within(&found["distance_mm"], exact, 0.05);
    }
    // A surface that is open holds nothing.
    let sheet = write(
        &folder,
        "sheet.json",
        &json!({ "family": "mesh", "vertices": [[-9, -9, 5], [9, -9, 5], [9, 9, 5], [-9, 9, 5]], "faces": [[0, 1, 2, 3]] }),
    );
    assert_eq!(contact(&["--with", "point:0,0,0"], &[&sheet])["verdict"], "disjoint");
}
