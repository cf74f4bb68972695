//! Dimensions, centroids and inertia against closed forms.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use glam::{DMat3, DVec3};
use lacuna_exchange::document::{DocumentLimits, read_model};
use lacuna_exchange::library;
use lacuna_fabrication::certificate::DimensionBasis;
use lacuna_fabrication::enclosed::VolumeMethod;
use lacuna_fabrication::{Certificate, Input, Job, JobKind, Params, run};
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_kernel::model::{AffineMap, Ifs, Interior, Model, PolygonMesh, Shape};
use lacuna_tests::support::{binary, cases};
use serde_json::{Value, json};

fn measured(model: Model, params: Params) -> Certificate {
    let inputs = vec![Input { name: "shape".into(), model, radius_mm: None }];
    let job = Job { kind: JobKind::Measure, inputs, params, outputs: Vec::new(), limits: Limits::default() };
    run(&job, &Budget::default()).unwrap().certificate
}

fn dimension(shape: Shape) -> ([f64; 2], DimensionBasis) {
    let found = measured(Model { name: None, shape }, Params::new(0.01)).dimension.unwrap();
    (found.bounds, found.basis)
}

fn document(text: &str) -> Shape {
    read_model(text.as_bytes(), &DocumentLimits::default()).unwrap().shape
}

fn classic(name: &str) -> Shape {
    document(library::find(name).unwrap().document)
}

#[track_caller]
fn assert_exact(found: ([f64; 2], DimensionBasis), exact: f64) {
    let ([low, high], basis) = found;
    assert_eq!(basis, DimensionBasis::Similarities, "[{low}, {high}]");
    assert!(low <= exact + 1e-15 && exact <= high + 1e-15 && high - low <= 1e-12, "{exact} is not in [{low}, {high}]");
}

fn similarities(maps: &[(f64, [f64; 3])]) -> Shape {
    let maps =
        maps.iter().map(|&(scale, at)| AffineMap { linear: DMat3::from_diagonal(DVec3::splat(scale)), translation: DVec3::from(at) });
    Shape::Ifs(Ifs { maps: maps.collect(), primitive: None, graph: None })
}

#[test]
fn dimensions_of_moran() {
    let third = 1.0 / 3.0;
    // Cantor's set; ratios 1/2 and 1/4 (the golden ratio solves x + x^2 = 1); 1/2, 1/3, 1/6 fill the interval.
    assert_exact(dimension(similarities(&[(third, [0.0; 3]), (third, [2.0 * third, 0.0, 0.0])])), 2.0_f64.ln() / 3.0_f64.ln());
    let golden = f64::midpoint(1.0, 5.0_f64.sqrt());
    assert_exact(dimension(similarities(&[(0.5, [0.0; 3]), (0.25, [0.75, 0.0, 0.0])])), golden.log2());
    assert_exact(dimension(similarities(&[(0.5, [0.0; 3]), (third, [0.5, 0.0, 0.0]), (third / 2.0, [5.0 / 6.0, 0.0, 0.0])])), 1.0);
    for (name, exact) in [
        ("koch_curve", 4.0_f64.ln() / 3.0_f64.ln()),
        ("sierpinski_triangle", 3.0_f64.log2()),
        ("sierpinski_carpet", 8.0_f64.ln() / 3.0_f64.ln()),
        ("menger_sponge", 20.0_f64.ln() / 3.0_f64.ln()),
        ("sierpinski_tetrahedron", 2.0),
    ] {
        assert_exact(dimension(classic(name)), exact);
    }
}

/// A = A / 2 u (B / 2 + 1 / 2), B = A / 2: log2 of the golden ratio (Mauldin and Williams).
#[test]
fn dimension_of_a_graph() {
    let system = r#"{"lacuna": 1, "shape": {"family": "bcifs", "states": [
        {"name": "A", "cell": "edge", "dimension": 2, "transitions": [
            {"to": "A", "operator": [[1, 0.5], [0, 0.5]]}, {"to": "B", "operator": [[0.5, 0], [0.5, 1]]}]},
        {"name": "B", "cell": "edge", "dimension": 2, "transitions": [{"to": "A", "operator": [[1, 0.5], [0, 0.5]]}]}],
        "cells": [{"state": "A", "control_points": [[0, 0, 0], [3, 4, 0]]}]}}"#;
    assert_exact(dimension(document(system)), f64::midpoint(1.0, 5.0_f64.sqrt()).log2());
}

#[test]
fn dimensions_that_are_bounded() {
    // Two maps with one fixed point: Moran's equation says the golden ratio's logarithm, and the space that holds it that it is a point.
    assert_eq!(dimension(similarities(&[(0.5, [0.0; 3]), (0.25, [0.0; 3])])), ([0.0; 2], DimensionBasis::Elementary));
    // Levy's curve: similar copies whose hulls overlap; the equation says 2.
    let ([low, high], basis) = dimension(classic("levy_curve"));
    assert_eq!(basis, DimensionBasis::OverlappingSimilarities);
    assert!(low <= high && (2.0..2.0 + 1e-9).contains(&high), "[{low}, {high}]");
    // Maps about points on a line, in an oblique plane and in space, far more than fill these: the equation says log(n) / log(10 / 7), 1.9 to 3.9.
    let at = [[30.0, 0.0, 0.0], [0.0, 30.0, 0.0], [0.0, 0.0, 30.0], [30.0, 30.0, 30.0]];
    for (count, high) in [(2, 1.0), (3, 2.0), (4, 3.0)] {
        assert_eq!(dimension(similarities(&at[..count].iter().map(|&at| (0.7, at)).collect::<Vec<_>>())).0[1], high);
    }
    // Turned in the plane, which the first coordinates' maps leave as it is.
    let turned = |scale: f64, degrees: f64, at: [f64; 3]| {
        let turn = DMat3::from_axis_angle(DVec3::ONE.normalize(), degrees.to_radians());
        AffineMap { linear: scale * turn, translation: DVec3::from(at) - scale * (turn * DVec3::from(at)) }
    };
    let maps = vec![turned(0.8, 20.0, at[0]), turned(0.7, 100.0, at[1]), turned(0.75, 200.0, at[2])];
    let ([_, high], basis) = dimension(Shape::Ifs(Ifs { maps, primitive: None, graph: None }));
    assert_eq!((high, basis), (2.0, DimensionBasis::OverlappingSimilarities));
    // The fern: affine maps, whose contraction alone says nothing below the dimension of space.
    let ([low, high], basis) = dimension(classic("barnsley_fern"));
    assert_eq!(basis, DimensionBasis::Contraction);
    assert!(low <= high && high <= 2.0, "[{low}, {high}]");
    let bezier = r#"{"lacuna": 1, "shape": {"family": "bezier_curve", "control_points": [[0,0,0],[1,2,0],[3,1,1],[4,0,0]]}}"#;
    // A smooth curve: 1, which the bound exceeds as far as that of the contraction, 1/2, is not sharp.
    let ([low, high], _) = dimension(document(bezier));
    assert!(low <= 1.0 && (1.0..1.05).contains(&high), "[{low}, {high}]");
}

#[test]
fn dimensions_of_meshes() {
    let mesh = |faces: Vec<Vec<u32>>| {
        let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Auto })
    };
    let tetrahedron = vec![vec![0, 2, 1], vec![0, 1, 3], vec![1, 2, 3], vec![2, 0, 3]];
    for (faces, exact) in [(vec![vec![0], vec![1]], 0.0), (vec![vec![0, 1]], 1.0), (vec![vec![0, 1, 2], vec![3]], 2.0), (tetrahedron, 3.0)]
    {
        assert_eq!(dimension(mesh(faces)), ([exact; 2], DimensionBasis::Elementary));
    }
}

/// What was told of these as proven was wrong: a needle was a solid or a segment, and tolerances stood for what is known.
#[test]
fn dimensions_that_a_tolerance_would_miss() {
    // A triangle 100 mm long and 1 nm high, turned.
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 1.0);
    for number in 0..20 {
        let vertices = [DVec3::ZERO, DVec3::X * 100.0, DVec3::new(37.0 + f64::from(number), 1e-6, 0.0)].map(|p| turn * p).to_vec();
        let needle = Shape::Mesh(PolygonMesh { vertices, faces: vec![vec![0, 1, 2]], interior: Interior::Auto });
        assert_eq!(dimension(needle), ([2.0; 2], DimensionBasis::Elementary));
    }
    let pair = |scale: DVec3, at: f64| {
        let map = |x: f64| AffineMap { linear: DMat3::from_diagonal(scale), translation: DVec3::X * x };
        Shape::Ifs(Ifs { maps: vec![map(0.0), map(at)], primitive: None, graph: None })
    };
    // Cantor's set on the axis: the maps are similar up to 4e-10 only.
    let third = 1.0 / 3.0;
    let ([low, high], _) = dimension(pair(third * DVec3::new(1.0, 1.0 - 4e-10, 1.0 - 4e-10), 2.0 * third));
    let exact = 2.0_f64.ln() / 3.0_f64.ln();
    assert!(low <= exact && exact <= high, "{exact} is not in [{low}, {high}]");
    // With gaps of 2e-10 it is as unconnected as any.
    let ([low, high], _) = dimension(pair(DVec3::new(0.5 - 1e-10, 0.3, 0.3), 0.5 + 1e-10));
    let exact = 2.0_f64.ln() / -(0.5_f64 - 1e-10).ln();
    assert!(low <= exact && exact <= high, "{exact} is not in [{low}, {high}]");
}

/// The graph of a function that takes itself on both halves of its domain, scaled by d and sheared by h: of box dimension 1 + log_2 2d where d is above 1/2, else 1
/// (M. Barnsley, "Fractal functions and interpolation", Constr. Approx. 2, 1986, theorem 4).
fn interpolation(d: f64, h: f64) -> Shape {
    let operators =
        [[[1.0, 0.5 - h, 1.0 - d], [0.0, 0.5, 0.0], [0.0, h, d]], [[0.5 - h, 0.0, 0.5 - h - d], [0.5, 1.0, 0.5], [h, 0.0, h + d]]];
    let transitions: Vec<Value> = operators.iter().map(|operator| json!({ "to": "curve", "operator": operator })).collect();
    let boundaries = json!([{ "state": "end", "incidence": [[1], [0], [0]] }, { "state": "end", "incidence": [[0], [1], [0]] }]);
    let states = json!([
        { "name": "curve", "cell": "edge", "dimension": 3, "transitions": transitions, "boundaries": boundaries },
        { "name": "end", "cell": "vertex", "dimension": 1, "transitions": [{ "to": "end", "operator": [[1]] }] },
    ]);
    let cells = json!([{ "state": "curve", "control_points": [[0, 0, 0], [80, 0, 0], [0, 80, 0]] }]);
    document(&json!({ "lacuna": 1, "shape": { "family": "bcifs", "states": states, "cells": cells } }).to_string())
}

/// Curves have dimension 1 at least, and as much as their polygons' lengths grow at most; surfaces that enclose a volume 2 at least.
#[test]
fn dimensions_of_curves_and_surfaces() {
    let case = |name: &str| document(&std::fs::read_to_string(cases::named(name).model()).unwrap());
    for curve in [
        "curves/bezier_parabola",
        "curves/circle",
        "curves/corner_cutting_third",
        "curves/catmull_rom_uniform",
        "curves/beta_spline",
        "bcifs/rational_arc",
    ] {
        let ([low, high], _) = dimension(case(curve));
        assert!(low == 1.0 && (1.0..=1.0 + 1e-12).contains(&high), "{curve}: [{low}, {high}]");
    }
    for curve in ["heighway_dragon", "levy_curve", "terdragon", "gosper_curve"] {
        assert_eq!(dimension(classic(curve)), ([1.0, 2.0], DimensionBasis::OverlappingSimilarities), "{curve}");
    }
    // It holds segments.
    assert_eq!(dimension(classic("binary_tree")).0[0], 1.0);
    // Copies that share points known to rounding alone.
    assert_eq!(dimension(case("ifs/heighway_dragon")).0, [1.0, 2.0]);
    for (d, h) in [(0.2, 0.0), (0.3, 0.4), (0.5, 0.5), (0.55, 0.1), (0.7, 0.3), (0.9, -0.2)] {
        let ([low, high], basis) = dimension(interpolation(d, h));
        let exact = 1.0 + f64::max(0.0, f64::log2(2.0 * d));
        assert!(
            low == 1.0 && exact <= high && high <= 2.0 && basis == DimensionBasis::Contraction,
            "{d}, {h}: {exact} is not in [{low}, {high}]"
        );
    }
    for (surface, least) in [
        ("nurbs/sphere", 1.0),
        ("nurbs/torus", 1.0),
        ("bcifs/surface_torus", 2.0),
        ("subdivision/catmull_clark_cube", 2.0),
        ("subdivision/doo_sabin_cube", 2.0),
    ] {
        let ([low, high], _) = dimension(case(surface));
        assert!(low == least && (2.0..2.12).contains(&high), "{surface}: [{low}, {high}]");
    }
}

#[track_caller]
fn assert_within(interval: [f64; 2], exact: f64, width: f64) {
    assert!(interval[0] <= exact && exact <= interval[1], "{exact} is not in {interval:?}");
    assert!(interval[1] - interval[0] <= width, "{interval:?} is wider than {width}");
}

#[test]
fn mass_of_a_box_far_from_the_origin() {
    let (low, size) = (DVec3::new(100.0, -50.0, 20.0), DVec3::new(2.0, 3.0, 5.0));
    let vertices = (0..8).map(|code| low + DVec3::from_array(std::array::from_fn(|k| if code >> k & 1 == 1 { size[k] } else { 0.0 })));
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let shape =
        Shape::Mesh(PolygonMesh { vertices: vertices.collect(), faces: faces.map(|f| f.to_vec()).to_vec(), interior: Interior::Auto });
    let found = measured(Model { name: None, shape }, Params { density_g_cm3: Some(2.7), ..Params::new(0.01) });
    let centroid = found.centroid_mm.unwrap();
    let inertia = found.inertia_mm5.unwrap();
    let mass = size.x * size.y * size.z;
    for axis in 0..3 {
        assert_within(centroid[axis], (low + size / 2.0)[axis], 1e-6);
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        assert_within(inertia[axis][axis], mass * (size[u].powi(2) + size[v].powi(2)) / 12.0, 1e-5);
        assert_within(inertia[axis][u], 0.0, 1e-5);
    }
    assert_within(found.mass_g.unwrap(), mass * 2.7e-3, 1e-6);
}

#[test]
fn mass_of_a_ball_and_of_a_capsule() {
    let points = |vertices: Vec<DVec3>| {
        let faces = vec![(0..vertices.len() as u32).collect()];
        Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Surface })
    };
    let (radius, at) = (2.0_f64, DVec3::new(1.0, 2.0, 3.0));
    let params = || Params { radius_mm: Some(radius), ..Params::new(0.01) };
    let found = measured(Model { name: None, shape: points(vec![at]) }, params());
    let volume = 4.0 / 3.0 * PI * radius.powi(3);
    for axis in 0..3 {
        assert_within(found.centroid_mm.unwrap()[axis], at[axis], 0.3);
        assert_within(found.inertia_mm5.unwrap()[axis][axis], 0.4 * volume * radius * radius, 0.2 * volume * radius * radius);
    }
    // A cylinder of length h between two half balls, along x.
    let h = 6.0;
    let found = measured(Model { name: None, shape: points(vec![at, at + h * DVec3::X]) }, params());
    let (cylinder, ball) = (PI * radius * radius * h, volume);
    let along = 0.5 * cylinder * radius * radius + 0.4 * ball * radius * radius;
    assert_within(found.inertia_mm5.unwrap()[0][0], along, 1.5 * along);
    assert_within(found.centroid_mm.unwrap()[0], at.x + h / 2.0, 0.5);
    assert_eq!(found.dimension.unwrap().bounds, [3.0, 3.0]);
}

#[test]
fn walls_gaps_and_the_smallest_box_of_two_balls() {
    let vertices = vec![DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 2.0, 3.0) + 10.0 * DVec3::new(0.6, 0.64, 0.48)];
    let shape = || Shape::Mesh(PolygonMesh { vertices: vertices.clone(), faces: vec![vec![0], vec![1]], interior: Interior::Surface });
    let model = || Model { name: None, shape: shape() };
    let found = measured(model(), Params { radius_mm: Some(2.0), oriented_box: true, thickness: true, ..Params::new(0.02) });
    let thickness = found.thickness.unwrap();
    // The mesh lies between balls of 2 - 0.02 and 2 + 0.02, 10 apart: through the middle of one it is 4, between them 6.
    let [low, high] = thickness.wall.unwrap().least_mm;
    assert!(3.9 <= low && high <= 4.04, "[{low}, {high}]");
    let [low, high] = thickness.gap.unwrap().least_mm;
    assert!(5.96 <= low && high <= 6.2, "[{low}, {high}]");
    // The smallest box is that of the capsule around both.
    let smallest = found.oriented_box.unwrap();
    let [low, high] = smallest.volume_mm3;
    assert!(low <= 224.0 && 224.0 <= high * (1.0 + 1e-9) && high - low <= 0.3, "[{low}, {high}]");
    assert!(smallest.complete);
    // Points themselves have no walls.
    let inputs = vec![Input { name: "points".into(), model: model(), radius_mm: None }];
    let params = Params { thickness: true, ..Params::new(0.02) };
    let job = Job { kind: JobKind::Measure, inputs, params, outputs: Vec::new(), limits: Limits::default() };
    assert_eq!(run(&job, &Budget::default()).unwrap_err().code, "job.not-a-solid");
}

/// A lattice's surface has needles and folds within its tolerance; they are no walls and no gaps. Its mesh alone does not tell that, and a warning does.
#[test]
fn folds_are_no_walls() {
    let shape = document(
        r#"{"lacuna": 1, "shape": {"family": "bezier_surface", "control_points":
        [[[0,0,0],[0,10,10],[0,20,0]], [[10,0,-10],[10,10,0],[10,20,-10]], [[20,0,0],[20,10,10],[20,20,0]]]}}"#,
    );
    let (radius, tolerance) = (1.0, 0.05);
    let found = measured(Model { name: None, shape }, Params { radius_mm: Some(radius), thickness: true, ..Params::new(tolerance) });
    let [low, high] = found.thickness.unwrap().wall.unwrap().least_mm;
    assert!(2.0 * (radius - tolerance) * FRAC_1_SQRT_2 <= low && high <= 2.0 * (radius + tolerance), "[{low}, {high}]");
    // Two sheets as near to each other as the tolerance.
    let slab = |height: f64| {
        let corners: Vec<[f64; 3]> = (0..8).map(|k| [f64::from(k & 1), f64::from(k >> 1 & 1), height * f64::from(k >> 2)]).collect();
        document(&format!(
            r#"{{"lacuna": 1, "shape": {{"family": "mesh", "vertices": {corners:?},
            "faces": [[0,2,3,1],[4,5,7,6],[0,1,5,4],[2,6,7,3],[0,4,6,2],[1,3,7,5]]}}}}"#
        ))
    };
    for (height, warns) in [(0.05, true), (0.25, false)] {
        let found = measured(Model { name: None, shape: slab(height) }, Params { thickness: true, ..Params::new(tolerance) });
        assert_within(found.thickness.unwrap().wall.unwrap().least_mm, height, 1e-12);
        assert_eq!(found.warnings.iter().any(|warning| warning.contains("a fold of one surface")), warns, "{:?}", found.warnings);
    }
}

/// Hakenberg, Reif, Schaefer, Warren 2014: Doo and Sabin's surface of the unit cube encloses 6241/9920. The surface itself has no volume.
#[test]
fn what_a_smooth_surface_encloses() {
    let cage = |scheme: &str, more: &str| {
        document(&format!(
            r#"{{"lacuna": 1, "shape": {{"family": "subdivision", "scheme": "{scheme}"{more}, "mesh": {{
            "vertices": [[0,0,0],[1,0,0],[0,1,0],[1,1,0],[0,0,1],[1,0,1],[0,1,1],[1,1,1]],
            "faces": [[0,2,3,1],[4,5,7,6],[0,1,5,4],[2,6,7,3],[0,4,6,2],[1,3,7,5]]}}}}}}"#
        ))
    };
    let found = measured(Model { name: None, shape: cage("doo_sabin", "") }, Params::new(0.01));
    let enclosed = found.enclosed.unwrap();
    assert_eq!((enclosed.method, found.volume_mm3), (VolumeMethod::TrilinearForms, None));
    assert_within(enclosed.volume_mm3, 6241.0 / 9920.0, 1e-12);
    // Faces that hardly shrink: no number, and the reason.
    let wild = r#", "coefficients": [{"weights": [[0.85, 0.05, 0.05, 0.05]]}]"#;
    let found = measured(Model { name: None, shape: cage("doo_sabin", wild) }, Params::new(0.01));
    assert!(
        found.enclosed.is_none() && found.warnings.iter().any(|warning| warning.contains("not proven to converge")),
        "{:?}",
        found.warnings
    );
    // An open surface encloses nothing, and a warning would say nothing new.
    let bezier = r#"{"lacuna": 1, "shape": {"family": "bezier_surface", "control_points": [[[0,0,0],[0,1,0]],[[1,0,0],[1,1,1]]]}}"#;
    let found = measured(Model { name: None, shape: document(bezier) }, Params::new(0.01));
    assert!(found.enclosed.is_none() && found.warnings.is_empty(), "{:?}", found.warnings);
}

/// The cage of a tube of four sides, of half widths 1, around a closed curve in the plane z = 0.
fn tube(scheme: &str, steps: u32, curve: impl Fn(f64) -> DVec3) -> Shape {
    let at = |step: u32| curve(f64::from(step) / f64::from(steps) * 2.0 * PI);
    let ring = |step: u32| {
        let across = DVec3::Z.cross((at(step + 1) - at(step + steps - 1)).normalize());
        [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(|(u, v)| (at(step) + u * across + v * DVec3::Z).to_array())
    };
    let corner = |step: u32, k: u32| step % steps * 4 + k % 4;
    let face = |step: u32, k: u32| [corner(step, k), corner(step, k + 1), corner(step + 1, k + 1), corner(step + 1, k)];
    let faces: Vec<[u32; 4]> = (0..steps).flat_map(|step| (0..4).map(move |k| face(step, k))).collect();
    let vertices: Vec<[f64; 3]> = (0..steps).flat_map(ring).collect();
    let mesh = json!({ "vertices": vertices, "faces": faces });
    document(&json!({ "lacuna": 1, "shape": { "family": "subdivision", "scheme": scheme, "mesh": mesh } }).to_string())
}

/// A ring is counted once; an eight whose strands pass through each other twice where they do, which its volume tells to nobody who is not warned.
#[test]
fn a_surface_that_passes_through_itself_says_so() {
    for scheme in ["catmull_clark", "doo_sabin"] {
        let params = || Params { density_g_cm3: Some(1.0), ..Params::new(0.01) };
        let ring = measured(Model { name: None, shape: tube(scheme, 12, |t| 8.0 * DVec3::new(t.cos(), t.sin(), 0.0)) }, params());
        let enclosed = ring.enclosed.unwrap();
        assert!(enclosed.counted_once_beyond_mm.unwrap() <= 0.02 + 1e-9 && enclosed.counted_otherwise.is_none(), "{enclosed:?}");
        assert!(ring.warnings[0].contains("no crossing of the surface was found") && ring.warnings[0].contains("not checked"));
        for axis in ring.centroid_mm.unwrap() {
            assert_within(axis, 0.0, 2.0);
        }
        let eight = |t: f64| DVec3::new(12.0 * t.sin(), 6.0 * (2.0 * t).sin(), 0.0);
        let found = measured(Model { name: None, shape: tube(scheme, 32, eight) }, params());
        let enclosed = found.enclosed.unwrap();
        let counted = enclosed.counted_otherwise.unwrap();
        // Strands of width 2 at most cross at the origin alone.
        assert!(counted.times == 2 && DVec3::from(counted.point_mm).length() < 3.0, "{counted:?}");
        assert!(enclosed.counted_once_beyond_mm.is_none() && found.centroid_mm.is_none());
        assert!(found.warnings[0].contains("passes through itself: it winds 2 times around the point"), "{:?}", found.warnings);
        assert_within(found.mass_g.unwrap(), enclosed.volume_mm3[0] * 1e-3, 1e-12);
    }
}

/// Doo and Sabin's surface of the unit cube: its volume by the density, its middle by symmetry, of which the interval is as narrow as the triangles are near.
#[test]
fn mass_and_centroid_of_what_a_smooth_surface_encloses() {
    let shape = document(
        r#"{"lacuna": 1, "shape": {"family": "subdivision", "scheme": "doo_sabin", "mesh": {
        "vertices": [[0,0,0],[1,0,0],[0,1,0],[1,1,0],[0,0,1],[1,0,1],[0,1,1],[1,1,1]],
        "faces": [[0,2,3,1],[4,5,7,6],[0,1,5,4],[2,6,7,3],[0,4,6,2],[1,3,7,5]]}}}"#,
    );
    let found = measured(Model { name: None, shape }, Params { density_g_cm3: Some(8.0), ..Params::new(0.001) });
    assert_within(found.mass_g.unwrap(), 6241.0 / 9920.0 * 8e-3, 1e-14);
    for axis in found.centroid_mm.unwrap() {
        assert_within(axis, 0.5, 0.05);
    }
    assert!(found.area_mm2.is_some() && !found.warnings.iter().any(|words| words.contains("the area of the surface is not known")));
    // Loop's surfaces are no Bezier patches on squares.
    let found = measured(
        Model { name: None, shape: document(&std::fs::read_to_string(cases::named("subdivision/loop_tetrahedron").model()).unwrap()) },
        Params::new(0.01),
    );
    assert!(found.area_mm2.is_none() && found.warnings.iter().any(|words| words.contains("the area of the surface is not known")));
    // A sheet has no volume, and a mass that is not told is no silence.
    let sheet = PolygonMesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y], faces: vec![vec![0, 1, 2]], interior: Interior::Auto };
    let found = measured(Model { name: None, shape: Shape::Mesh(sheet) }, Params { density_g_cm3: Some(8.0), ..Params::new(0.001) });
    assert!(found.mass_g.is_none() && found.warnings[0].contains("no mass is told"), "{:?}", found.warnings);
}

/// 4 pi^2 R r of a torus and 4 pi r^2 of a sphere, 2400 of a cube all whose edges are sharp, and 400 times the integral of sqrt(1 + x^2 + y^2) over the unit square of a saddle,
/// through the command.
#[test]
fn areas_of_smooth_surfaces() {
    let told = |case: &str| -> Value {
        let model = cases::named(case).model();
        let words = ["measure", model.to_str().unwrap(), "--tolerance", "0.05", "--quiet"];
        serde_json::from_slice(&binary::succeed(words)).unwrap()
    };
    let area = |case: &str| -> [f64; 2] { serde_json::from_value(told(case)["area_mm2"].clone()).unwrap() };
    assert_within(area("nurbs/torus"), 4.0 * PI * PI * 30.0, 1e-3 * 1184.0);
    assert_within(area("nurbs/sphere"), 400.0 * PI, 1e-3 * 1256.0);
    assert_within(area("subdivision/catmull_clark_sharp"), 2400.0, 1e-6);
    let saddle = 4.0 / 3.0 * ((1.0 + 3.0_f64.sqrt()) / 2.0_f64.sqrt()).ln() + 3.0_f64.sqrt() / 3.0 - PI / 18.0;
    assert_within(area("nurbs/bezier_saddle"), 400.0 * saddle, 1e-2);
    assert!(told("nurbs/trimmed_sphere").get("area_mm2").is_none_or(Value::is_null));
}

/// Solids of a group: sums where they are apart, bounds that hold the union where they are not.
#[test]
fn groups_of_solids_have_volume_area_and_mass() {
    let outward = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let told = |boxes: &[[[f64; 3]; 2]]| {
        let solid = |ends: &[[f64; 3]; 2]| {
            let vertices: Vec<[f64; 3]> = (0..8).map(|code| [0, 1, 2].map(|axis| ends[code >> axis & 1][axis])).collect();
            json!({ "shape": { "family": "mesh", "vertices": vertices, "faces": outward } })
        };
        let parts: Vec<Value> = boxes.iter().map(solid).collect();
        let shape = document(&json!({ "lacuna": 1, "shape": { "family": "group", "parts": parts } }).to_string());
        measured(Model { name: None, shape }, Params { density_g_cm3: Some(1000.0), ..Params::new(0.01) })
    };
    let unit = [[0.0; 3], [1.0; 3]];
    let apart = told(&[unit, [[3.0, 0.0, 0.0], [5.0, 2.0, 2.0]]]);
    assert_within(apart.volume_mm3.unwrap(), 9.0, 1e-12);
    assert_within(apart.area_mm2.unwrap(), 30.0, 1e-11);
    assert_within(apart.mass_g.unwrap(), 9.0, 1e-12);
    // (1 * 0.5 + 8 * 4) / 9.
    assert_within(apart.centroid_mm.unwrap()[0], 32.5 / 9.0, 1e-12);
    assert!(apart.warnings.is_empty(), "{:?}", apart.warnings);
    // Side by side: 2 of volume, and 10 of area about it.
    let touching = told(&[unit, [[1.0, 0.0, 0.0], [2.0, 1.0, 1.0]]]);
    assert_within(touching.volume_mm3.unwrap(), 2.0, 1e-12);
    assert_within(touching.centroid_mm.unwrap()[0], 1.0, 1e-12);
    let [low, high] = touching.area_mm2.unwrap();
    assert!(low <= 10.0 && 10.0 <= high && touching.warnings[0].contains("touch"), "[{low}, {high}] {:?}", touching.warnings);
    // Cubes of 2 that share one of 1: 15; one in the other: 8; the same twice: 8.
    for (other, volume, area) in [([1.0, 3.0], 15.0, 42.0), ([0.5, 1.0], 8.0, 24.0), ([0.0, 2.0], 8.0, 24.0)] {
        let found = told(&[[[0.0; 3], [2.0; 3]], other.map(|end| [end; 3])]);
        let within = |[low, high]: [f64; 2], exact: f64| low <= exact * (1.0 + 1e-12) && exact <= high;
        assert!(within(found.volume_mm3.unwrap(), volume) && within(found.area_mm2.unwrap(), area), "{found:?}");
        assert!(within(found.mass_g.unwrap(), volume) && found.centroid_mm.is_none(), "{found:?}");
        assert!(found.warnings[0].contains("touch or overlap, or lie in each other"), "{:?}", found.warnings);
    }
}

/// Squares of 2 by 2 that share half of each cover 6; the sum of their areas is 8.
#[test]
fn sheets_that_lie_on_each_other_say_so() {
    let sheets = |shifts: &[[f64; 2]]| {
        let corner = |[x, z]: [f64; 2], [u, v]: [f64; 2]| DVec3::new(x + 2.0 * u, 2.0 * v, z);
        let square = |&shift: &[f64; 2]| [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|at| corner(shift, at));
        let faces = (0..shifts.len() as u32).map(|k| (4 * k..4 * k + 4).collect()).collect();
        let vertices = shifts.iter().flat_map(square).collect();
        let mesh = PolygonMesh { vertices, faces, interior: Interior::Surface };
        let found = measured(Model { name: None, shape: Shape::Mesh(mesh) }, Params::new(0.01));
        (found.area_mm2.unwrap(), found.warnings)
    };
    let ([low, high], warnings) = sheets(&[[0.0, 0.0], [1.0, 0.0]]);
    assert!(low <= 6.0 && 6.0 <= high && low < 7.0, "[{low}, {high}]");
    assert!(warnings[0].contains("lie on each other") && warnings[0].contains("counts what they share twice"), "{warnings:?}");
    // The same square twice; one beside the other, and one above.
    let (area, warnings) = sheets(&[[0.0, 0.0], [0.0, 0.0]]);
    assert!(area[0] <= 4.0 && 4.0 <= area[1] && warnings.len() == 1, "{area:?} {warnings:?}");
    for other in [[2.0, 0.0], [0.5, 1e-9]] {
        let (area, warnings) = sheets(&[[0.0, 0.0], other]);
        assert_within(area, 8.0, 1e-12);
        assert!(warnings.is_empty(), "{other:?}: {warnings:?}");
    }
}

/// A cube of edge 2 across its diagonal, Koch's curve across its base, and a ball whatever way it is seen.
#[test]
fn extents_along_a_direction() {
    let corners = (0..8).map(|k| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)) * 2.0);
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let cube = PolygonMesh { vertices: corners.collect(), faces: faces.map(|f| f.to_vec()).to_vec(), interior: Interior::Auto };
    let along = |shape: Shape, direction: DVec3, radius_mm: Option<f64>| {
        let params = Params { direction: Some(direction), radius_mm, ..Params::new(0.1) };
        measured(Model { name: None, shape }, params).extent.unwrap()
    };
    let found = along(Shape::Mesh(cube.clone()), DVec3::splat(1e-200), None);
    assert_within(found.width_mm, 12.0_f64.sqrt(), 1e-9);
    assert_within(found.from_mm, 0.0, 1e-9);
    let found = along(Shape::Mesh(cube), DVec3::new(3.0, 4.0, 0.0), Some(0.5));
    assert_within(found.width_mm, 2.8 + 1.0, 1e-9);
    assert_within(found.from_mm, -0.5, 1e-9);
    let found = along(classic("koch_curve"), -DVec3::Y, None);
    assert_within(found.width_mm, 100.0 * 3.0_f64.sqrt() / 6.0, 1e-6);
    assert_within(found.to_mm, 0.0, 1e-6);
}

/// Cubes as one mesh, from and to these corners of their diagonals; those whose ends are exchanged face inwards.
fn cubes(ends: &[[f64; 2]]) -> Model {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for &[low, high] in ends {
        let end = |code: usize, axis: usize| if code >> axis & 1 == 1 { high } else { low };
        let outward: [[usize; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        faces.extend(outward.map(|face| face.map(|corner| (vertices.len() + corner) as u32).to_vec()));
        vertices.extend((0..8).map(|code| DVec3::new(end(code, 0), end(code, 1), end(code, 2))));
    }
    Model { name: None, shape: Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Auto }) }
}

/// Sums over the triangles of a mesh count a place as often as it winds around it: that is no volume where it is not 0 or 1.
#[test]
fn volumes_that_count_a_place_twice_say_so() {
    let told = |ends: &[[f64; 2]]| measured(cubes(ends), Params::new(0.01));
    for (solid, volume) in [(&[[0.0, 1.0]][..], 1.0), (&[[0.0, 4.0], [3.0, 1.0]], 56.0), (&[[0.0, 1.0], [2.0, 4.0]], 9.0)] {
        let found = told(solid);
        assert_within(found.volume_mm3.unwrap(), volume, 1e-9);
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    }
    let crossing = told(&[[0.0, 2.0], [1.0, 3.0]]);
    assert!(crossing.warnings[0].contains("counts twice"), "{:?}", crossing.warnings);
    let nested = told(&[[0.0, 4.0], [1.0, 3.0]]);
    assert!(nested.warnings[0].contains("the shell at 1, 1, 1 lies inside of another"), "{:?}", nested.warnings);
    assert!(nested.warnings[0].contains("counts 2 times"), "{:?}", nested.warnings);
    let beside = told(&[[0.0, 4.0], [6.0, 5.0]]);
    assert!(beside.warnings[0].contains("counts -1 times"), "{:?}", beside.warnings);
}

/// A mesh that closes and yet bounds no solid has the volume of a surface, which is none: that is told, and an open mesh is what it says.
#[test]
fn a_mesh_that_closes_without_a_solid_says_so() {
    let Model { shape: Shape::Mesh(outward), .. } = cubes(&[[0.0, 1.0]]) else { unreachable!("a mesh") };
    let told = |change: &dyn Fn(&mut PolygonMesh)| {
        let mut mesh = outward.clone();
        change(&mut mesh);
        let found = measured(Model { name: None, shape: Shape::Mesh(mesh) }, Params::new(0.01));
        assert_within(found.volume_mm3.unwrap(), 0.0, 0.0);
        found.warnings
    };
    let inward = told(&|mesh| mesh.faces.iter_mut().for_each(|face| face.reverse()));
    assert!(inward[0].contains("its faces look inwards (signed volume -1 mm3); ask for a repair"), "{inward:?}");
    let flipped = told(&|mesh| mesh.faces[2].reverse());
    assert!(flipped[0].contains("is taken as a surface") && flipped[0].contains("in the same direction"), "{flipped:?}");
    let said = told(&|mesh| {
        mesh.faces[2].reverse();
        mesh.interior = Interior::Surface;
    });
    let open = told(&|mesh| drop(mesh.faces.pop()));
    assert!(said.is_empty() && open.is_empty(), "{said:?} {open:?}");
}

/// Volumes and moments beyond the range of numbers are refused: they were once an internal error, or no more than their rounding.
#[test]
fn shapes_too_large_or_too_small_for_numbers_are_refused() {
    for (size, code) in [(1e150, "measure.too-large"), (1e-120, "measure.too-small")] {
        let inputs = vec![Input { name: "shape".into(), model: cubes(&[[0.0, size]]), radius_mm: None }];
        let job = Job { kind: JobKind::Measure, inputs, params: Params::new(0.01), outputs: Vec::new(), limits: Limits::default() };
        assert_eq!(run(&job, &Budget::default()).unwrap_err().code, code);
    }
    let found = measured(cubes(&[[0.0, 1e-40]]), Params::new(0.01));
    assert_within(found.volume_mm3.unwrap().map(|volume| volume * 1e120), 1.0, 1e-9);
    assert_eq!(found.dimension.unwrap().bounds, [3.0; 2]);
    // A point at the origin has no size, and is measured.
    let point = Shape::Mesh(PolygonMesh { vertices: vec![DVec3::ZERO], faces: vec![vec![0]], interior: Interior::Auto });
    assert_eq!(dimension(point), ([0.0; 2], DimensionBasis::Elementary));
    let found = measured(cubes(&[[0.0, 1e40]]), Params::new(0.01));
    assert_within(found.volume_mm3.unwrap().map(|volume| volume / 1e120), 1.0, 1e-9);
    assert_within(found.inertia_mm5.unwrap()[2][2].map(|moment| moment / 1e200), 1.0 / 6.0, 1e-5);
}
