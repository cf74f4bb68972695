//! Solids that are trimmed by a plane and split into parts with keys: closed forms, volumes that add up, points that belong to one part.

use std::f64::consts::PI;

use glam::DVec3;
use lacuna_fabrication::{CutPlane, Geometry, Input, Job, JobError, JobKind, Operation, Outcome, Params, Part, Split, SplitKey, run};
use lacuna_kernel::budget::{Budget, CancelToken, Limits, StopReason};
use lacuna_kernel::model::{Interior, Model, PolygonMesh, Shape};
use lacuna_tests::support::random::Random;
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::{binary, inside};

fn cuboid(low: [f64; 3], high: [f64; 3]) -> Shape {
    let vertices =
        (0..8).map(|code| DVec3::from_array(std::array::from_fn(|axis| if code >> axis & 1 == 1 { high[axis] } else { low[axis] })));
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    Shape::Mesh(PolygonMesh { vertices: vertices.collect(), faces: faces.map(|face| face.to_vec()).to_vec(), interior: Interior::Auto })
}

fn done(shape: Shape, params: Params, budget: &Budget) -> Result<Outcome, JobError> {
    let inputs = vec![Input { name: "body".into(), model: Model { name: None, shape }, radius_mm: None }];
    run(&Job { kind: JobKind::Intersect, inputs, params, outputs: Vec::new(), limits: Limits::default() }, budget)
}

fn trimmed(shape: Shape, radius_mm: Option<f64>, normal: DVec3, offset_mm: f64) -> Result<Outcome, JobError> {
    let plane = Some(CutPlane { normal, offset_mm });
    done(shape, Params { operation: Some(Operation::Trim), radius_mm, plane, ..Params::new(0.01) }, &Budget::default())
}

fn split(shape: Shape, split: Split) -> Result<Outcome, JobError> {
    done(shape, Params { operation: Some(Operation::Split), split: Some(split), ..Params::new(0.01) }, &Budget::default())
}

fn parts(outcome: &Outcome) -> &[Part] {
    match &outcome.geometry {
        Geometry::Parts(parts) => parts,
        other => panic!("{other:?}"),
    }
}

#[test]
fn boxes_and_balls_are_trimmed() {
    let whole = || cuboid([0.0; 3], [10.0, 8.0, 6.0]);
    for (normal, offset, volume) in [(DVec3::X, 4.0, 4.0 * 48.0), (-DVec3::X, -4.0, 6.0 * 48.0), (DVec3::new(0.0, 0.0, 9.0), 1.5, 120.0)] {
        let certificate = trimmed(whole(), None, normal, offset).unwrap().certificate;
        let [low, high] = certificate.volume_mm3.unwrap();
        assert!(low <= volume && volume <= high && high - low < 1e-3 * volume, "{volume}: [{low}, {high}]");
        assert_eq!((certificate.euler, certificate.components), (Some(2), Some(1)));
    }
    // A corner cut off along x + y + z = 3: a tetrahedron with legs of 3.
    let corner = trimmed(whole(), None, DVec3::ONE, 3.0 / 3.0_f64.sqrt()).unwrap().certificate;
    let [low, high] = corner.volume_mm3.unwrap();
    assert!(low <= 4.5 && 4.5 <= high && high - low < 1e-3, "[{low}, {high}]");
    // A ball of radius 5 less a cap of height 2: V - pi h^2 (3 r - h) / 3.
    let ball = Shape::Mesh(PolygonMesh { vertices: vec![DVec3::ZERO], faces: vec![vec![0]], interior: Interior::Auto });
    let (r, h) = (5.0_f64, 2.0);
    let exact = 4.0 / 3.0 * PI * r.powi(3) - PI * h * h * (3.0 * r - h) / 3.0;
    let [low, high] = trimmed(ball, Some(r), DVec3::Z, r - h).unwrap().certificate.volume_mm3.unwrap();
    // What is between the dilations by 5 - 0.01 and 5 + 0.01 of a ball may be missing, or be too much.
    let between = ((5.01_f64 / 4.99).powi(3) - 1.0) * 4.0 / 3.0 * PI * 5.0_f64.powi(3);
    assert!(low <= exact && exact <= high && high - low < 2.02 * between, "{exact}: [{low}, {high}]");
    // Beside the solid, and along its face: all or nothing.
    assert_eq!(trimmed(whole(), None, DVec3::X, -1.0).unwrap_err().code, "boolean.empty");
    assert_eq!(trimmed(whole(), None, DVec3::X, 0.0).unwrap_err().code, "boolean.empty");
    for offset in [10.0, 11.0] {
        let [low, high] = trimmed(whole(), None, DVec3::X, offset).unwrap().certificate.volume_mm3.unwrap();
        assert!(low <= 480.0 && 480.0 <= high, "{offset}");
    }
}

/// The volumes add up, and every part fits.
fn check(outcome: &Outcome, whole: f64) {
    let stated = outcome.certificate.split.as_ref().unwrap();
    assert!((stated.whole_volume_mm3 - whole).abs() < 1e-9 * whole, "{} and {whole}", stated.whole_volume_mm3);
    let sum: f64 = stated.parts.iter().map(|part| part.mesh_volume_mm3).sum();
    let expected = whole + stated.keys as f64 * (stated.peg_volume_mm3 - stated.socket_volume_mm3);
    // Vertices are rounded to single precision.
    assert!((sum - expected).abs() < 1e-5 * whole, "{sum} and {expected}");
    assert_eq!(stated.parts.iter().map(|part| part.pegs).sum::<u64>(), stated.keys);
    assert_eq!(stated.parts.iter().map(|part| part.sockets).sum::<u64>(), stated.keys);
    for (part, told) in parts(outcome).iter().zip(&stated.parts) {
        assert_eq!(part.name, told.name);
        if let Some(fits) = stated.volume_mm {
            assert!((0..3).all(|axis| told.bbox_mm[1][axis] - told.bbox_mm[0][axis] <= fits[axis]), "{told:?}");
        }
    }
    assert_eq!(outcome.certificate.boundary_edges, Some(0));
}

#[test]
fn a_block_in_parts_with_keys() {
    let key = SplitKey { width_mm: 6.0, clearance_mm: 0.2 };
    let whole = || cuboid([-3.0, 2.0, 1.0], [97.0, 62.0, 41.0]);
    let outcome = split(whole(), Split { volume_mm: Some([55.0, 40.0, 50.0]), key: Some(key), ..Split::default() }).unwrap();
    check(&outcome, 240_000.0);
    let stated = outcome.certificate.split.as_ref().unwrap();
    // Two parts along x and y: four faces, two keys each. 100 + 6 in two of 53, so the cut is at 47 from the start; 60 + 6 in two of 33.
    assert_eq!((stated.parts.len(), stated.keys), (4, 8));
    assert_eq!(stated.cuts_mm, [vec![44.0], vec![29.0], vec![]]);
    assert_eq!(
        stated.parts.iter().map(|part| part.name.as_str()).collect::<Vec<_>>(),
        ["part-1-1-1", "part-1-2-1", "part-2-1-1", "part-2-2-1"]
    );
    assert_eq!(outcome.certificate.components, Some(4));
    // Where they belong, no point is in two parts, and what is in none lies in a clearance around the cuts.
    let back: Vec<(Vec<DVec3>, &[[u32; 3]])> = parts(&outcome)
        .iter()
        .zip(&stated.parts)
        .map(|(part, told)| {
            let moved = DVec3::from_array(told.moved_mm);
            (part.solid.mesh().vertices.iter().map(|vertex| *vertex - moved).collect(), part.solid.mesh().triangles.as_slice())
        })
        .collect();
    let mut random = Random(7);
    let mut gaps = 0;
    for index in 0..3000 {
        // Every other point near a cut.
        let anywhere = DVec3::new(47.0, 32.0, 21.0) + random.point(1.0) * DVec3::new(99.0, 59.0, 39.0);
        let p = if index % 2 == 0 { anywhere } else { DVec3::new(44.0 + 8.0 * (random.unit() - 0.1), anywhere.y, anywhere.z) };
        let holders = back.iter().filter(|(vertices, triangles)| inside::contains(vertices, triangles, p)).count();
        assert!(holders <= 1, "{p} lies in {holders} parts");
        if holders == 0 {
            gaps += 1;
            let near = |cut: f64, x: f64| (-1e-4..6.2001).contains(&(x - cut));
            assert!(near(44.0, p.x) || near(29.0, p.y), "{p} lies in no part");
        }
    }
    assert!(gaps > 0, "no point met a clearance");
}

#[test]
fn chosen_cuts_and_faces_without_room() {
    // A thin plate has no room for keys: that is said, and it is cut all the same.
    let plate = cuboid([0.0; 3], [100.0, 50.0, 3.0]);
    let key = Some(SplitKey { width_mm: 6.0, clearance_mm: 0.2 });
    let outcome = split(plate, Split { cuts_mm: [vec![70.0, 30.0, 30.0], vec![], vec![]], key, ..Split::default() }).unwrap();
    check(&outcome, 15_000.0);
    assert_eq!(outcome.certificate.split.as_ref().unwrap().cuts_mm[0], [30.0, 70.0]);
    assert!(
        outcome.certificate.warnings.iter().any(|warning| warning.contains("too small for a key")),
        "{:?}",
        outcome.certificate.warnings
    );
    // A plate across the cut: wide faces, but the material behind them is thin.
    let shallow = cuboid([0.0; 3], [50.0, 50.0, 8.0]);
    let outcome = split(shallow, Split { cuts_mm: [vec![], vec![], vec![4.0]], key, ..Split::default() }).unwrap();
    check(&outcome, 20_000.0);
    assert_eq!(outcome.certificate.split.as_ref().unwrap().keys, 0);
    let body = || cuboid([0.0; 3], [100.0, 50.0, 50.0]);
    let wrong = |split_: Split| split(body(), split_).unwrap_err().code;
    assert_eq!(wrong(Split { cuts_mm: [vec![100.0], vec![], vec![]], ..Split::default() }), "split.cut-outside");
    assert_eq!(wrong(Split { volume_mm: Some([5.0, 90.0, 90.0]), key, ..Split::default() }), "split.volume-too-small");
    assert_eq!(
        wrong(Split { volume_mm: Some([40.0, 90.0, 90.0]), cuts_mm: [vec![50.0], vec![], vec![]], ..Split::default() }),
        "split.too-large"
    );
    assert_eq!(wrong(Split { volume_mm: Some([1e-3, 1e-3, 90.0]), ..Split::default() }), "limit.parts");
    // It fits: one part.
    let outcome = split(body(), Split { volume_mm: Some([100.0, 90.0, 90.0]), ..Split::default() }).unwrap();
    check(&outcome, 250_000.0);
    assert_eq!(parts(&outcome).len(), 1);
}

#[test]
fn random_solids_add_up() {
    let mut random = Random(99);
    for _ in 0..6 {
        // Several boxes, joined first by a dilation so that cuts meet curved faces.
        let points: Vec<DVec3> = (0..5).map(|_| random.point(30.0)).collect();
        let faces = (0..4).map(|k| vec![k, k + 1]).collect();
        let shape = Shape::Mesh(PolygonMesh { vertices: points, faces, interior: Interior::Surface });
        let params = Params {
            operation: Some(Operation::Split),
            radius_mm: Some(4.0),
            split: Some(Split {
                volume_mm: Some([20.0, 20.0, 20.0]),
                key: Some(SplitKey { width_mm: 1.5, clearance_mm: 0.1 }),
                ..Split::default()
            }),
            ..Params::new(0.2)
        };
        let outcome = done(shape, params, &Budget::default()).unwrap();
        let whole = outcome.certificate.split.as_ref().unwrap().whole_volume_mm3;
        check(&outcome, whole);
        assert!(outcome.certificate.split.as_ref().unwrap().keys > 0);
    }
}

#[test]
fn a_stopped_split_ends() {
    let cancel = CancelToken::new();
    cancel.fire(StopReason::Cancelled);
    let params = Params {
        operation: Some(Operation::Split),
        split: Some(Split { volume_mm: Some([3.0; 3]), ..Split::default() }),
        ..Params::new(0.01)
    };
    let stopped = done(cuboid([0.0; 3], [10.0; 3]), params, &Budget { cancel, ..Budget::default() });
    assert_eq!(stopped.unwrap_err().code, "cancelled");
}

#[test]
fn parts_are_objects_of_a_file() {
    let folder = Scratch::new();
    let (model, file, other) = (folder.join("block.json"), folder.join("parts.3mf"), folder.join("parts.stl"));
    let corners: Vec<[f64; 3]> =
        (0..8).map(|code| [f64::from(code & 1) * 40.0, f64::from(code >> 1 & 1) * 30.0, f64::from(code >> 2) * 30.0]).collect();
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let shape = serde_json::json!({ "family": "mesh", "vertices": corners, "faces": faces });
    std::fs::write(&model, serde_json::json!({ "lacuna": 1, "shape": shape }).to_string()).unwrap();
    let words =
        ["intersect", "--operation", "split", "--volume", "30x30x30", "--key", "4", "--clearance", "0.15", "--tolerance", "0.01", "-o"];
    let paths = [file.as_os_str(), "-o".as_ref(), other.as_os_str(), model.as_os_str()];
    binary::succeed(words.into_iter().map(std::ffi::OsStr::new).chain(paths));
    let told: serde_json::Value = serde_json::from_slice(&binary::succeed(["inspect".as_ref(), file.as_os_str()])).unwrap();
    assert_eq!(told["components"], 2, "{told}");
    // STL has no objects: the parts are apart in space.
    let told: serde_json::Value = serde_json::from_slice(&binary::succeed(["inspect".as_ref(), other.as_os_str()])).unwrap();
    assert_eq!(told["components"], 2, "{told}");
    let wrong = binary::run(["intersect", "--operation", "split", "--tolerance", "0.01", "-o", "x.stl", model.to_str().unwrap()]);
    assert_eq!(wrong.status.code(), Some(2));
}
