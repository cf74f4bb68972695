//! Subdivision surfaces: dimensions of states, limit points, volumes, boundaries, creases, and evaluation without
//! cracks. Expected values: closed forms and CASES E (Stam 1998, Hakenberg and Reif 2014, OpenSubdiv's shapes).

use crate::agreement::agreed;
use crate::cages;
use crate::cages::{attractor, cube, evaluated, grid, model, tetrahedron, torus, volume};
use glam::DVec3;
use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::model::{BoundaryRule, CellKind, Coefficients, Corner, Crease, Scheme, Subdivision};
use lacuna_kernel::tessellation::Tessellation;

fn has_point(tessellation: &Tessellation, point: DVec3) -> bool {
    tessellation.vertices.iter().any(|vertex| vertex.distance(point) < 1e-9)
}

/// Dimensions of all states of a kind, each once.
fn dimensions(attractor: &Attractor, kind: CellKind) -> Vec<usize> {
    let mut all: Vec<usize> = attractor.automaton().states().iter().filter(|s| s.kind == Some(kind)).map(|s| s.dimension).collect();
    all.sort_unstable();
    all.dedup();
    all
}

#[test]
fn regular_dimensions_are_those_of_the_box_splines() {
    for (scheme, face, edge, vertex) in [(Scheme::CatmullClark, 16, 12, 9), (Scheme::DooSabin, 9, 6, 4), (Scheme::Loop, 12, 10, 7)] {
        let attractor = attractor(torus(scheme, 6, 6));
        assert_eq!(dimensions(&attractor, CellKind::Face), [face], "{scheme:?}");
        assert_eq!(dimensions(&attractor, CellKind::Edge), [edge], "{scheme:?}");
        assert_eq!(dimensions(&attractor, CellKind::Vertex), [vertex], "{scheme:?}");
        assert_eq!(agreed(&evaluated(&attractor, 1.0)), (0, 0, 1), "{scheme:?}");
    }
}

#[test]
fn catmull_clark_cube() {
    let attractor = attractor(cube(Scheme::CatmullClark));
    eprintln!("{} states", attractor.automaton().states().len());
    let coarse = evaluated(&attractor, 0.1);
    assert_eq!(agreed(&coarse), (2, 0, 1));
    assert!(has_point(&coarse, DVec3::splat(0.5)));
    assert!(has_point(&coarse, DVec3::new(395.0 / 648.0, -395.0 / 648.0, 0.0)));
    assert!(has_point(&coarse, DVec3::new(0.0, 68.0 / 81.0, 0.0)));
    let v = volume(&attractor, 6);
    assert!((v - 2.620_419_033).abs() < 1e-7, "{v}");
}

#[test]
fn loop_tetrahedron() {
    let attractor = attractor(tetrahedron(Scheme::Loop));
    let tessellation = evaluated(&attractor, 0.05);
    assert_eq!(agreed(&tessellation), (2, 0, 1));
    assert!(has_point(&tessellation, DVec3::new(-0.2, -0.2, 0.2)));
    let v = volume(&attractor, 7);
    assert!((v - 0.102_993_11).abs() < 1e-7, "{v}");
}

#[test]
fn doo_sabin_cube() {
    let attractor = attractor(cube(Scheme::DooSabin));
    let tessellation = evaluated(&attractor, 0.1);
    assert_eq!(agreed(&tessellation), (2, 0, 1));
    for point in [DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.75, 0.75, 0.0), DVec3::splat(2.0 / 3.0)] {
        assert!(has_point(&tessellation, point), "{point}");
    }
    let v = volume(&attractor, 7);
    assert!((v - 8.0 * 6241.0 / 9920.0).abs() < 1e-6, "{v}");
}

#[test]
fn a_cage_of_a_hundred_thousand_faces_converts_in_seconds() {
    let surface = cages::inset_torus(300, 330, 790);
    let faces = surface.faces.len();
    let clock = std::time::Instant::now();
    let attractor = attractor(surface);
    let states = attractor.automaton().states().len();
    eprintln!("{faces} faces: {states} states in {:.2} s", clock.elapsed().as_secs_f64());
    // Regular faces, and those with one vertex of valence 3 or 5: 2 k + 8.
    let faces = dimensions(&attractor, CellKind::Face);
    assert!([14, 16, 18].iter().all(|n| faces.contains(n)), "{faces:?}");
    assert!(states <= 20, "{states}");
}

#[test]
fn grids_are_bicubic_b_splines() {
    // Case 53: heights i^2 give i^2 + 1/3 at the vertices that are not on the boundary.
    let tessellation = evaluated(&attractor(grid(Scheme::CatmullClark, 5, 4, |x, _| x * x)), 0.5);
    assert_eq!(agreed(&tessellation), (1, 1, 1));
    for x in 1..5 {
        assert!(has_point(&tessellation, DVec3::new(f64::from(x), 2.0, f64::from(x * x) + 1.0 / 3.0)), "{x}");
    }
    for scheme in [Scheme::CatmullClark, Scheme::Loop, Scheme::DooSabin] {
        for boundary in [BoundaryRule::Smooth, BoundaryRule::SharpCorners] {
            let flat = Subdivision { boundary, ..grid(scheme, 3, 2, |x, y| 2.0 * x - y) };
            let tessellation = evaluated(&attractor(flat), 0.2);
            assert_eq!(agreed(&tessellation), (1, 1, 1));
            assert!(tessellation.vertices.iter().all(|v| (v.z - 2.0 * v.x + v.y).abs() < 1e-12), "flat stays flat");
            // The triangulated grid has one face alone at (3, 0), and two at the origin.
            let corner = has_point(&tessellation, DVec3::new(3.0, 0.0, 6.0));
            assert_eq!(corner, boundary == BoundaryRule::SharpCorners, "{scheme:?}");
            // The boundary stays on its straight sides.
            let bounds = tessellation.vertices.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v.x), b.max(v.x)));
            assert!(bounds.0.abs() < 1e-12 && (bounds.1 - 3.0).abs() < 1e-12, "{scheme:?} {bounds:?}");
        }
    }
}

#[test]
fn vertices_of_any_valence_have_the_known_limit() {
    // Case 52: (n^2 V + 4 sum E + sum F) / (n (n + 5)), Halstead, Kass and DeRose 1993. Two poles over rings of 2 n.
    for n in [3_u32, 5, 8, 17, 40] {
        let ring = |k: u32, r: f64, z: f64| {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(2 * n);
            DVec3::new(r * angle.cos(), r * angle.sin() + 0.1 * f64::from(k % 3), z)
        };
        let mut vertices: Vec<DVec3> = (0..2 * n).map(|k| ring(k, 3.0, f64::from(k % 2))).collect();
        vertices.extend((0..2 * n).map(|k| ring(k, 2.0, -1.0)));
        vertices.extend([DVec3::new(0.1, 0.2, 3.0), DVec3::new(0.0, 0.0, -2.0)]);
        let (at, below) = (|k: u32| k % (2 * n), |k: u32| 2 * n + k % (2 * n));
        let mut faces = Vec::new();
        for k in 0..n {
            faces.push(vec![4 * n, at(2 * k), at(2 * k + 1), at(2 * k + 2)]);
            faces.push(vec![4 * n + 1, below(2 * k + 2), below(2 * k + 1), below(2 * k)]);
            faces.extend([2 * k, 2 * k + 1].map(|k| vec![at(k + 1), at(k), below(k), below(k + 1)]));
        }
        let sum = |odd: u32| (0..n).map(|k| vertices[(2 * k + odd) as usize]).sum::<DVec3>();
        let m = f64::from(n);
        let limit = (m * m * vertices[4 * n as usize] + 4.0 * sum(0) + sum(1)) / (m * (m + 5.0));
        let tessellation = evaluated(&attractor(cages::cage(Scheme::CatmullClark, vertices, faces)), 1.0);
        assert_eq!(agreed(&tessellation), (2, 0, 1), "{n}");
        assert!(has_point(&tessellation, limit), "{n}");
    }
}

#[test]
fn a_cube_is_smooth_here_and_rough_there() {
    // MATH 5: Doo-Sabin with {.49, .21, .21, .09}, the weight .09 opposite to the corner.
    let rough = vec![vec![0.49, 0.21, 0.09, 0.21]];
    for faces in [Some(vec![0, 2]), None] {
        let surface = Subdivision { coefficients: vec![Coefficients { faces, weights: rough.clone() }], ..cube(Scheme::DooSabin) };
        let tessellation = evaluated(&attractor(surface), 0.15);
        assert_eq!(agreed(&tessellation), (2, 0, 1));
    }
    // The scheme's own weights, given in full, change nothing.
    let own = vec![vec![9.0 / 16.0, 3.0 / 16.0, 1.0 / 16.0, 3.0 / 16.0]];
    let surface = Subdivision { coefficients: vec![Coefficients { faces: None, weights: own }], ..cube(Scheme::DooSabin) };
    let v = volume(&attractor(surface), 6);
    assert!((v - 8.0 * 6241.0 / 9920.0).abs() < 1e-5, "{v}");
}

/// Codes and places of what is wrong.
fn faults(surface: Subdivision) -> Vec<(&'static str, String)> {
    let findings = model(surface).lower().expect_err("refused");
    findings.into_iter().map(|finding| (finding.code, finding.pointer)).collect()
}

#[test]
fn bad_cages_are_refused_by_name_and_place() {
    let good = || cube(Scheme::CatmullClark);
    let with = |change: &dyn Fn(&mut Subdivision)| {
        let mut surface = good();
        change(&mut surface);
        faults(surface)
    };
    let fault = |code, place: &str| vec![(code, place.to_string())];
    assert_eq!(with(&|s| s.faces[3].reverse())[0].0, "mesh.orientation");
    assert_eq!(with(&|s| s.faces.push(vec![0, 1, 5, 4]))[0], ("mesh.nonmanifold-edge", "/mesh/faces/6".into()));
    assert_eq!(with(&|s| s.vertices.push(DVec3::ZERO)), fault("mesh.isolated-vertex", "/mesh/vertices/8"));
    assert_eq!(with(&|s| s.faces[1][2] = 4), fault("mesh.repeated-vertex", "/mesh/faces/1"));
    assert_eq!(with(&|s| s.faces[1][2] = 99), fault("mesh.index", "/mesh/faces/1"));
    assert_eq!(with(&|s| s.faces[1].truncate(2)), fault("subdivision.face-size", "/mesh/faces/1"));
    assert_eq!(with(&|s| s.vertices[2].x = f64::NAN), fault("model.not-finite", "/mesh/vertices/2"));
    assert_eq!(with(&|s| s.faces.clear()), fault("subdivision.empty", "/mesh/faces"));
    let crease = |edge, sharpness| Crease { edge, sharpness };
    assert_eq!(with(&|s| s.creases.push(crease([0, 7], 1.0))), fault("subdivision.no-edge", "/creases/0/edge"));
    assert_eq!(with(&|s| s.creases.push(crease([0, 1], -1.0))), fault("subdivision.sharpness", "/creases/0/sharpness"));
    assert_eq!(with(&|s| s.creases.push(crease([0, 1], f64::NAN))), fault("subdivision.sharpness", "/creases/0/sharpness"));
    assert_eq!(with(&|s| s.corners.push(Corner { vertex: 8, sharpness: 1.0 })), fault("mesh.index", "/corners/0/vertex"));
    assert_eq!(with(&|s| s.scheme = Scheme::Loop).len(), 6);
    let mut bow_tie = tetrahedron(Scheme::Loop);
    bow_tie.vertices.extend([DVec3::new(3.0, 3.0, 3.0), DVec3::new(3.0, 2.0, 3.0), DVec3::new(2.0, 3.0, 3.0)]);
    bow_tie.faces.extend([vec![2, 4, 5], vec![2, 5, 6], vec![2, 6, 4], vec![4, 6, 5]]);
    assert_eq!(faults(bow_tie), fault("mesh.bow-tie", "/mesh/vertices/2"));
    let mut dual = cube(Scheme::DooSabin);
    dual.creases.push(crease([0, 1], 1.0));
    assert_eq!(faults(dual), fault("subdivision.no-creases", "/creases"));
}

#[test]
fn vertices_of_two_faces() {
    // Two squares, back to back.
    let pillow = |scheme: Scheme| {
        let mut pillow = cages::cage(scheme, grid(scheme, 1, 1, |x, y| x * y).vertices, vec![vec![0, 2, 3, 1]]);
        let mut back = pillow.faces[0].clone();
        back.reverse();
        pillow.faces.push(back);
        pillow
    };
    assert_eq!(agreed(&evaluated(&attractor(pillow(Scheme::CatmullClark)), 0.05)), (2, 0, 1));
    assert_eq!(faults(pillow(Scheme::DooSabin)).len(), 4);
    let mut triangles = pillow(Scheme::Loop);
    triangles.faces = vec![vec![0, 1, 2], vec![2, 1, 0]];
    triangles.vertices.truncate(3);
    assert_eq!(faults(triangles).len(), 3);
}
