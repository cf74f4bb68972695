//! Plans beside what jobs take: near the truth, and the same for any number of threads.

use std::f64::consts::PI;
use std::process::Command;

use lacuna_tests::support::binary::{lacuna, run, succeed};
use lacuna_tests::support::cases;
use lacuna_tests::support::root;
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::Service;
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
        assert!(plan["cpu_seconds"].as_f64().unwrap() > 0.0, "{plan}");
        // A boolean may leave features as thin as it likes.
        let thin = (plan["smallest_feature_mm"].as_f64(), done["certificate"]["thickness_min_mm"].as_f64());
        match (job["kind"] == "solidify", thin) {
            (true, (Some(promised), Some(proven))) => assert!(0.0 < promised && promised <= proven * (1.0 + 1e-9), "{thin:?}"),
            (dilated, thin) => assert!(!dilated && thin.0.is_none(), "{name}: {thin:?}"),
        }
    }
}

fn planned(scratch: &Scratch, job: &Value) -> Value {
    let file = scratch.join("planned.json");
    std::fs::write(&file, job.to_string()).unwrap();
    serde_json::from_slice(&succeed(["plan".as_ref(), file.as_os_str()])).unwrap()
}

#[test]
fn seconds_follow_the_work_and_are_left_out_where_they_are_not_known() {
    let scratch = Scratch::new();
    let seconds = |job: &Value| planned(&scratch, job)["cpu_seconds"].as_f64();
    let of = |tolerance: f64| seconds(&order("curves/circle", tolerance, 0.5)).unwrap();
    // The number of triangles goes with the inverse of the tolerance.
    assert!(of(0.01) > 1.5 * of(0.02), "{} and {}", of(0.01), of(0.02));
    // The simplification of a lattice's surface takes longer than the lattice; wires and smooth surfaces that are simplified have none.
    let costs_more = [("nurbs/trimmed_cylinder", 0.1, 1.0, true), ("nurbs/torus", 0.1, 1.0, false), ("curves/circle", 0.02, 0.5, false)];
    for (name, tolerance, radius, costs_more) in costs_more {
        let mut job = order(name, tolerance, radius);
        let bare = seconds(&job).unwrap();
        job["params"]["simplify"] = json!(true);
        assert_eq!(seconds(&job).unwrap() > bare, costs_more, "{name}");
    }
    let mut job = order("curves/circle", 0.02, 0.5);
    job["params"]["simplify"] = json!(true);
    for (name, value) in [("stability", json!(true)), ("closing_mm", json!(0.2))] {
        let mut job = job.clone();
        job["params"][name] = value;
        assert_eq!(seconds(&job), None, "{name}");
    }
    let model = json!({ "shape": { "family": "mesh", "interior": "surface", "vertices": [[0, 0, 0], [9, 0, 0], [0, 9, 0]], "faces": [[0, 1, 2]] } });
    let measure = json!({ "lacuna": 1, "kind": "measure", "model": model, "params": { "tolerance_mm": 0.1 } });
    assert_eq!(seconds(&measure), None);
}

#[test]
fn the_smallest_feature_is_proven_before_the_work() {
    let scratch = Scratch::new();
    let smallest = |job: &Value| planned(&scratch, job)["smallest_feature_mm"].as_f64();
    assert_eq!(smallest(&order("curves/circle", 0.02, 0.5)), Some(2.0 * (0.5 - 0.02)));
    // A tolerance beyond half the radius is taken for that.
    assert_eq!(smallest(&order("curves/circle", 2.0, 0.5)), Some(0.5));
    let segment = |x: f64, radius: f64| json!({ "radius_mm": radius, "shape": { "family": "mesh", "vertices": [[x, 0, 0], [x, 9, 0]], "faces": [[0, 1]] } });
    let mut job = order("curves/circle", 0.05, 1.0);
    job["model"] = json!({ "lacuna": 1, "shape": { "family": "group", "parts": [segment(0.0, 2.0), segment(5.0, 0.6)] } });
    let least = smallest(&job).unwrap();
    // Of the thinner of the two.
    assert!((2.0 * (0.6 - 0.05)..2.0 * 0.6).contains(&least), "{least}");
    job["params"]["closing_mm"] = json!(0.2);
    assert_eq!(smallest(&job), None);
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

/// A job with a limit, and the name of what its refusal offers.
fn limited(kind: &str, model: &str, params: &Value, limits: &Value, remedy: &'static str) -> (Value, &'static str) {
    let model: Value = serde_json::from_slice(&std::fs::read(cases::named(model).model()).unwrap()).unwrap();
    (json!({ "lacuna": 1, "kind": kind, "model": model, "params": params, "limits": limits, "outputs": ["obj"] }), remedy)
}

/// Jobs that exceed a limit far; some so far that no tolerance helps, but only the limit: half the radius and more is the same to a dilation.
fn beyond() -> Vec<(Value, &'static str)> {
    let triangles = |allowed: u32| json!({ "triangles": allowed });
    let plain = |tolerance: f64, radius: f64| json!({ "tolerance_mm": tolerance, "radius_mm": radius });
    let lattice = json!({ "tolerance_mm": 0.01, "radius_mm": 2.0, "simplify": false });
    let evaluated = |tolerance: f64| json!({ "tolerance_mm": tolerance });
    vec![
        limited("solidify", "curves/circle", &plain(0.002, 1.0), &triangles(10_000), "tolerance_mm"),
        limited("solidify", "ifs/koch_curve", &plain(0.9, 0.6), &triangles(3000), "triangles"),
        limited("solidify", "curves/circle", &plain(0.02, 0.5), &triangles(1000), "triangles"),
        limited("solidify", "meshes/cube_open", &lattice, &triangles(40_000), "tolerance_mm"),
        limited("evaluate", "nurbs/torus", &evaluated(0.0005), &json!({ "cells": 20_000 }), "tolerance_mm"),
        limited("evaluate", "ifs/sierpinski_tetrahedron", &evaluated(0.05), &json!({ "cells": 5000 }), "tolerance_mm"),
        limited("solidify", "ifs/sierpinski_tetrahedron", &plain(0.33, 2.0), &json!({ "cells": 10 }), "cells"),
        limited("solidify", "curves/circle", &plain(0.002, 1.0), &json!({ "cells": 300 }), "tolerance_mm"),
        limited("evaluate", "nurbs/torus", &evaluated(0.0002), &json!({ "memory_bytes": 4_000_000 }), "tolerance_mm"),
    ]
}

/// The job with what a refusal offers.
fn mended(job: &Value, remedy: &Value, name: &str) -> Value {
    let mut job = job.clone();
    assert_eq!(remedy.as_object().map(|offered| offered.keys().map(String::as_str).collect()), Some(vec![name]), "{remedy}");
    let value = remedy[name].as_f64().unwrap();
    if name == "tolerance_mm" {
        assert!(value > job["params"][name].as_f64().unwrap(), "{value}");
        job["params"][name] = json!(value);
    } else {
        job["limits"][name] = json!(value.ceil() as u64);
    }
    job
}

#[test]
fn what_a_plan_offers_passes() {
    let scratch = Scratch::new();
    let file = scratch.join("job.json");
    for (job, name) in beyond() {
        std::fs::write(&file, job.to_string()).unwrap();
        let plan: Value = serde_json::from_slice(&succeed(["plan".as_ref(), file.as_os_str()])).unwrap();
        let excess = &plan["exceeds"];
        let limit = job["limits"].as_object().unwrap().keys().next().unwrap();
        assert_eq!((&excess["limit"], &excess["allowed"]), (&json!(limit), &json!(job["limits"][limit].as_f64())), "{plan}");
        assert!(excess["asked"].as_f64() > excess["allowed"].as_f64().map(|allowed| 2.0 * allowed), "{excess}");
        std::fs::write(&file, mended(&job, &excess["remedy"], name).to_string()).unwrap();
        let plan: Value = serde_json::from_slice(&succeed(["plan".as_ref(), file.as_os_str()])).unwrap();
        assert!(plan.get("exceeds").is_none(), "{plan}");
        succeed(["run".as_ref(), file.as_os_str(), "-o".as_ref(), scratch.join("made").as_os_str(), "--quiet".as_ref()]);
    }
}

#[test]
fn the_command_line_refuses_what_a_plan_says_is_beyond_the_limits() {
    let scratch = Scratch::new();
    refused_and_mended(&scratch, beyond(), true);
    // Limits that are given as options count as those in the document.
    let circle = cases::named("curves/circle").model();
    let options = ["--tolerance", "0.002", "--radius", "1", "--limit-triangles", "10000", "-o"];
    let all = ["solidify".as_ref(), circle.as_os_str()].into_iter().chain(options.iter().map(std::ffi::OsStr::new));
    let file = scratch.join("refused.stl");
    let ended = run(all.chain([file.as_os_str()]));
    let said = String::from_utf8(ended.stderr).unwrap();
    assert!(ended.status.code() == Some(4) && said.contains("[plan-exceeds-limit]") && !file.exists(), "{said}");
}

#[test]
fn the_command_line_names_what_passes_when_a_limit_ends_the_work() {
    let scratch = Scratch::new();
    // What a plan is not certain of.
    let narrowly = |kind: &str, model: &str, tolerance: f64, limit: &str, counted: &str| {
        let mut params = json!({ "tolerance_mm": tolerance });
        if kind == "solidify" {
            params["radius_mm"] = json!(0.5);
        }
        let (mut job, name) = limited(kind, model, &params, &json!({}), "tolerance_mm");
        let asked = planned(&scratch, &job)[counted].as_f64().unwrap();
        job["limits"] = json!({ limit: (asked / 1.5) as u64 });
        (job, name)
    };
    let jobs = vec![
        narrowly("solidify", "curves/circle", 0.002, "triangles", "counted_triangles"),
        narrowly("evaluate", "nurbs/torus", 0.005, "cells", "leaf_cells"),
    ];
    refused_and_mended(&scratch, jobs, false);
}

/// Runs jobs that exceed a limit, by their plan or by what the work finds, and then each with what the command line offers.
fn refused_and_mended(scratch: &Scratch, jobs: Vec<(Value, &'static str)>, by_plan: bool) {
    let file = scratch.join("job.json");
    for (number, (job, name)) in jobs.into_iter().enumerate() {
        std::fs::write(&file, job.to_string()).unwrap();
        let made = scratch.join(&format!("made-{number}"));
        let refused = |threads: &str| {
            let ended = run([
                "run".as_ref(),
                file.as_os_str(),
                "-o".as_ref(),
                made.as_os_str(),
                "--quiet".as_ref(),
                "--threads".as_ref(),
                threads.as_ref(),
            ]);
            let said = String::from_utf8(ended.stderr).unwrap();
            assert_eq!(ended.status.code(), Some(4), "{said}");
            said
        };
        let said = refused("2");
        // Whatever threads had made when the limit was hit.
        assert_eq!((refused("2"), refused("1")), (said.clone(), said.clone()));
        assert_eq!(said.contains("[plan-exceeds-limit]"), by_plan, "{said}");
        // Refused by its plan, a job does not even make its folder; one that the work ends leaves nothing in it.
        let left = std::fs::read_dir(&made).map(|folder| folder.count()).ok();
        assert_eq!(left, (!by_plan).then_some(0), "{said}");
        let offer = format!("this would pass: {name} = ");
        let value: f64 =
            said.lines().find_map(|line| line.trim().strip_prefix(&offer)).unwrap_or_else(|| panic!("{said}")).parse().unwrap();
        std::fs::write(&file, mended(&job, &json!({ name: value }), name).to_string()).unwrap();
        succeed(["run".as_ref(), file.as_os_str(), "-o".as_ref(), made.as_os_str(), "--quiet".as_ref()]);
    }
}

#[test]
fn the_service_refuses_what_a_plan_says_is_beyond_the_limits() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    for (job, name) in beyond() {
        let answer = service.post("/v1/jobs", &job);
        let problem = answer.json();
        assert_eq!(
            (answer.status, &problem["code"], &problem["type"]),
            (422, &json!("plan-exceeds-limit"), &json!("/problems/limit")),
            "{problem}"
        );
        assert!(problem["detail"].as_str().unwrap().contains(name), "{problem}");
        let listed = service.get("/v1/jobs").json();
        let before = listed["items"].as_array().unwrap().len();
        let ended = service.done(&mended(&job, &problem["remedy"], name));
        assert_eq!(ended["state"], "succeeded", "{ended}");
        // What was refused is no job.
        assert_eq!(service.get("/v1/jobs").json()["items"].as_array().unwrap().len(), before + 1);
    }
}

/// A ball of radius 30 about the origin as a closed mesh, in so many rings.
fn ball(rings: u32) -> Value {
    let around = 2 * rings;
    let at = |ring: u32, step: u32| {
        let (polar, turn) = (f64::from(ring) / f64::from(rings) * PI, f64::from(step) / f64::from(around) * 2.0 * PI);
        [30.0 * polar.sin() * turn.cos(), 30.0 * polar.sin() * turn.sin(), 30.0 * polar.cos()]
    };
    let mut vertices = vec![[0.0, 0.0, 30.0]];
    vertices.extend((1..rings).flat_map(|ring| (0..around).map(move |step| at(ring, step))));
    vertices.push([0.0, 0.0, -30.0]);
    let number = |ring: u32, step: u32| match ring {
        0 => 0,
        ring if ring == rings => 1 + (rings - 1) * around,
        ring => 1 + (ring - 1) * around + step % around,
    };
    let corners = |ring: u32, step: u32| [number(ring, step), number(ring + 1, step), number(ring + 1, step + 1), number(ring, step + 1)];
    let mut faces: Vec<Vec<u32>> = (0..rings).flat_map(|ring| (0..around).map(move |step| corners(ring, step).to_vec())).collect();
    for face in &mut faces {
        face.dedup();
        if face.first() == face.last() {
            face.pop();
        }
    }
    json!({ "lacuna": 1, "name": "ball", "shape": { "family": "mesh", "vertices": vertices, "faces": faces } })
}

/// A stack of sections of a ball.
fn stack(step: f64, formats: &[&str], limits: &Value) -> Value {
    let params = json!({ "tolerance_mm": 0.05, "step_mm": step, "normal": [1, 2, 3] });
    json!({ "lacuna": 1, "kind": "slice", "model": ball(40), "params": params, "outputs": formats, "limits": limits })
}

#[test]
fn the_bytes_of_sections_are_planned_from_what_planes_meet() {
    let scratch = Scratch::new();
    let file = scratch.join("job.json");
    for (step, formats) in [(0.37, &["svg"][..]), (0.011, &["dxf"]), (0.05, &["dxf", "svg"])] {
        let job = stack(step, formats, &json!({}));
        let plan = planned(&scratch, &job);
        std::fs::write(&file, job.to_string()).unwrap();
        let told = succeed(["run".as_ref(), file.as_os_str(), "-o".as_ref(), scratch.join("made").as_os_str(), "--quiet".as_ref()]);
        let done: Value = serde_json::from_slice(&told).unwrap();
        let bytes: u64 = done["outputs"].as_array().unwrap().iter().map(|output| output["bytes"].as_u64().unwrap()).sum();
        near(&plan["output_bytes"], &json!(bytes), &format!("bytes of {formats:?} with a step of {step}"));
        assert!(plan["memory_bytes"].as_f64() > Some(18e6), "{plan}");
    }
    // Before there is a mesh nobody knows what planes meet.
    let mut thickened = stack(0.37, &["svg"], &json!({}));
    thickened["params"]["radius_mm"] = json!(1.0);
    assert_eq!(planned(&scratch, &thickened)["output_bytes"], Value::Null);
}

#[test]
fn a_stack_with_more_bytes_than_allowed_is_refused_by_its_plan_or_ends_alone() {
    let scratch = Scratch::new();
    let (folder, kept) = (scratch.join("data"), json!({ "output_bytes": 200_000 }));
    let service = Service::start_with(&folder, &[("LACUNA_LIMIT_OUTPUT_BYTES", "30000000")]);
    // By far: refused before the work, with what would pass.
    let job = stack(0.05, &["svg"], &kept);
    let problem = service.post("/v1/jobs", &job).json();
    assert_eq!(
        (&problem["code"], &problem["limit"], &problem["allowed"]),
        (&json!("plan-exceeds-limit"), &json!("output_bytes"), &json!(200_000.0)),
        "{problem}"
    );
    let passes = problem["remedy"]["output_bytes"].as_f64().unwrap() as u64;
    let file = service.done(&stack(0.05, &["svg"], &json!({ "output_bytes": passes })))["outputs"][0]["bytes"].as_u64().unwrap();
    assert!(200_000 < file && file <= passes, "{file}");
    // By a byte: the job ends with what is allowed, beside another one, and its file is gone.
    let narrow = |bytes: u64| service.done(&stack(0.05, &["svg"], &json!({ "output_bytes": bytes })));
    let refused = narrow(file - 1);
    let problem = &refused["problem"];
    assert_eq!(
        (&refused["state"], &problem["code"], &problem["allowed"]),
        (&json!("failed"), &json!("limit.output-bytes"), &json!((file - 1) as f64)),
        "{refused}"
    );
    assert!(problem["detail"].as_str().unwrap().contains("allow more output_bytes"), "{problem}");
    assert_eq!(narrow(file)["state"], "succeeded");
    let results = std::fs::read_dir(folder.join("results")).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    assert_eq!(results.filter(|name| name.ends_with(".lacuna-part")).collect::<Vec<_>>(), Vec::<String>::new(), "of a job that failed");
    // More than the service allows at all.
    let problem = service.post("/v1/jobs", &stack(0.37, &["svg"], &json!({ "output_bytes": 30_000_001 }))).json();
    assert_eq!(problem["errors"][0]["pointer"], "/limits/output_bytes", "{problem}");
    assert_eq!(service.get("/v1/capabilities").json()["limits"]["output_bytes"], 30_000_000);
}

#[test]
fn the_command_line_leaves_no_file_that_is_too_long() {
    let scratch = Scratch::new();
    let circle = cases::named("curves/circle").model();
    let made = |limit: &str| {
        let options = ["--tolerance", "0.02", "--radius", "1", "--limit-output", limit, "-o"];
        let all = ["solidify".as_ref(), circle.as_os_str()].into_iter().chain(options.iter().map(std::ffi::OsStr::new));
        let (stl, obj) = (scratch.join("circle.stl"), scratch.join("circle.obj"));
        let ended = run(all.chain([stl.as_os_str(), "-o".as_ref(), obj.as_os_str()]));
        (ended.status.code(), String::from_utf8(ended.stderr).unwrap(), stl, obj)
    };
    let (code, said, stl, obj) = made("1G");
    assert_eq!(code, Some(0), "{said}");
    let lengths = [stl, obj].map(|file| {
        let length = std::fs::metadata(&file).unwrap().len();
        std::fs::remove_file(&file).unwrap();
        length
    });
    let (code, said, stl, obj) = made(&(lengths[0] + lengths[1] - 1).to_string());
    assert!(code == Some(4) && said.contains("[limit.output-bytes]") && !stl.exists() && !obj.exists(), "{said}");
    assert_eq!(made(&(lengths[0] + lengths[1]).to_string()).0, Some(0));
}

#[test]
fn a_mesh_with_more_faces_than_are_counted_is_planned() {
    const SIDE: usize = 460;
    let scratch = Scratch::new();
    let faces = 2 * (SIDE - 1) * (SIDE - 1);
    let mut mesh = format!("OFF\n{} {faces} 0\n", SIDE * SIDE);
    (0..SIDE * SIDE).for_each(|k| mesh.push_str(&format!("{} {} 0\n", k / SIDE, k % SIDE)));
    for (i, j) in (0..SIDE - 1).flat_map(|i| (0..SIDE - 1).map(move |j| (i, j))) {
        let [a, b, c, d] = [i * SIDE + j, i * SIDE + j + 1, (i + 1) * SIDE + j + 1, (i + 1) * SIDE + j];
        mesh.push_str(&format!("3 {a} {b} {c}\n3 {a} {c} {d}\n"));
    }
    std::fs::write(scratch.join("mesh.off"), mesh).unwrap();
    let model = json!({ "lacuna": 1, "shape": { "family": "mesh", "file": "mesh.off", "interior": "surface" } });
    let job = json!({ "lacuna": 1, "kind": "evaluate", "model": model, "params": { "tolerance_mm": 0.1 }, "outputs": ["obj"] });
    let file = scratch.join("job.json");
    std::fs::write(&file, job.to_string()).unwrap();
    let plan: Value = serde_json::from_slice(&succeed(["plan".as_ref(), file.as_os_str()])).unwrap();
    assert_eq!((&plan["leaf_cells"], plan.get("exceeds")), (&json!(faces as f64), None), "{plan}");
}
