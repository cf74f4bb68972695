//! Laws of dilation, through `fabrication::run`, on random sets whose distance is known by brute force.
//!
//! The certificate promises D(r - inner) inside the solid inside D(r + outer), for the file as written. So every point
//! of the solid's surface is at a distance in [r - inner, r + outer] from the set, every point nearer than that is
//! inside, and every point further away is outside. Nothing here has a width of its own.

use glam::{DMat3, DVec3};
use lacuna_fabrication::{Certificate, Geometry, Input, Job, JobKind, Outcome, Params, run};
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_kernel::model::{AffineMap, Ifs, Interior, Model, PolygonMesh, Shape};
use lacuna_kernel::solid::TriMesh;
use lacuna_tests::support::inside;
use lacuna_tests::support::random::{Pieces, Random};

/// Rounding of the brute-force distance itself, at coordinates of tens of mm.
const ROUNDING: f64 = 1e-11;

/// Random sets of one kind that are tried.
const TRIALS: u64 = 6;

/// A set as a model.
pub(crate) fn shape(pieces: &Pieces) -> Shape {
    let mut mesh = PolygonMesh { interior: Interior::Surface, ..PolygonMesh::default() };
    for piece in &pieces.0 {
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(piece);
        mesh.faces.push((first..first + piece.len() as u32).collect());
    }
    Shape::Mesh(mesh)
}

fn job(shape: Shape, kind: JobKind, tolerance_mm: f64, radius_mm: Option<f64>) -> Job {
    Job {
        kind,
        inputs: vec![Input { name: "shape".into(), model: Model { name: None, shape }, radius_mm: None }],
        params: Params { radius_mm, ..Params::new(tolerance_mm) },
        outputs: Vec::new(),
        limits: Limits::default(),
    }
}

/// The dilated shape and its certificate.
#[track_caller]
fn solidify(shape: Shape, tolerance: f64, radius: f64) -> (TriMesh, Certificate) {
    let job = job(shape, JobKind::Solidify, tolerance, Some(radius));
    match run(&job, &Budget::default()) {
        Ok(Outcome { geometry: Geometry::Solid(solid), certificate }) => {
            assert!(certificate.achieved_bound_mm <= tolerance, "{} > {tolerance}", certificate.achieved_bound_mm);
            (solid.mesh().clone(), certificate)
        }
        other => panic!("{other:?}"),
    }
}

fn bounds(certificate: &Certificate) -> (f64, f64) {
    (certificate.inner_bound_mm.unwrap(), certificate.outer_bound_mm.unwrap())
}

fn corners(mesh: &TriMesh, triangle: &[u32; 3]) -> [DVec3; 3] {
    triangle.map(|index| mesh.vertices[index as usize])
}

/// Signed volume, from the mesh alone.
fn volume(mesh: &TriMesh) -> f64 {
    mesh.triangles.iter().map(|t| corners(mesh, t)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

fn contains(mesh: &TriMesh, p: DVec3) -> bool {
    inside::contains(&mesh.vertices, &mesh.triangles, p)
}

/// The sandwich, on the mesh's surface and around it.
#[track_caller]
fn assert_sandwich(pieces: &Pieces, mesh: &TriMesh, certificate: &Certificate, radius: f64, seed: u64) {
    let (inner, outer) = bounds(certificate);
    let held = |p: DVec3, what: &str| {
        let d = pieces.distance(p);
        let within = radius - inner - ROUNDING <= d && d <= radius + outer + ROUNDING;
        assert!(within, "{what} {p} is at {d}, not in [{}, {}]", radius - inner, radius + outer);
    };
    for p in &mesh.vertices {
        held(*p, "vertex");
    }
    for triangle in &mesh.triangles {
        let [a, b, c] = corners(mesh, triangle);
        for (u, v) in [(1. / 3., 1. / 3.), (0.5, 0.5), (0.5, 0.0), (0.0, 0.5)] {
            held(a + (b - a) * u + (c - a) * v, "surface point");
        }
    }
    let mut random = Random(seed);
    let (mut inside, mut outside) = (0, 0);
    while inside < 40 || outside < 40 {
        // Near the surface, where a mistake would be.
        let from = pieces.sample(&mut random);
        let Some(direction) = random.point(2.0).try_normalize() else { continue };
        let p = from + direction * radius * (0.7 + 0.6 * random.unit());
        let d = pieces.distance(p);
        if d < radius - inner - ROUNDING {
            assert!(contains(mesh, p), "{p}, at {d} of the set, is not in the solid");
            inside += 1;
        } else if d > radius + outer + ROUNDING {
            assert!(!contains(mesh, p), "{p}, at {d} of the set, is in the solid");
            outside += 1;
        }
    }
}

fn sandwich(count: usize, piece_corners: usize) {
    for seed in 0..TRIALS {
        let pieces = Pieces::random(seed, count, piece_corners, 20.0);
        let (radius, tolerance) = (2.0, 0.3);
        let (mesh, certificate) = solidify(shape(&pieces), tolerance, radius);
        assert_sandwich(&pieces, &mesh, &certificate, radius, seed);
    }
}

#[test]
fn dilated_points_lie_between_their_bounds() {
    sandwich(12, 1);
}

#[test]
fn dilated_segments_lie_between_their_bounds() {
    sandwich(6, 2);
}

#[test]
fn dilated_triangles_lie_between_their_bounds() {
    sandwich(4, 3);
}

#[test]
fn thin_dilations_lie_between_their_bounds() {
    let pieces = Pieces::random(77, 3, 2, 10.0);
    let (mesh, certificate) = solidify(shape(&pieces), 0.02, 0.15);
    assert_sandwich(&pieces, &mesh, &certificate, 0.15, 77);
}

#[test]
fn every_point_of_the_exact_surface_is_near_the_mesh() {
    let pieces = Pieces::random(3, 8, 1, 14.0);
    let (radius, tolerance) = (2.0, 0.3);
    let (mesh, certificate) = solidify(shape(&pieces), tolerance, radius);
    let surface = Pieces(mesh.triangles.iter().map(|t| corners(&mesh, t).to_vec()).collect());
    let (inner, outer) = bounds(&certificate);
    let mut random = Random(3);
    let mut tried = 0;
    while tried < 60 {
        let Some(direction) = random.point(2.0).try_normalize() else { continue };
        let p = pieces.sample(&mut random) + direction * radius;
        if pieces.distance(p) < radius - ROUNDING {
            continue; // within another ball: not on the surface
        }
        // Towards its centre the point enters the solid after `inner` at most. Outwards it is out after `outer`, if no
        // other ball is near; both ends of that segment decide.
        let (below, above) = (p - direction * (inner + 1e-9), p + direction * (outer + 1e-9));
        assert!(contains(&mesh, below), "{below} is not in the solid");
        if pieces.distance(above) > radius + outer + ROUNDING {
            let d = surface.distance(p);
            assert!(d <= inner.max(outer) + 1e-9, "{p} is {d} away from the mesh");
            tried += 1;
        }
    }
}

#[test]
fn the_solid_contains_its_input() {
    for corner_count in 1..=3 {
        let pieces = Pieces::random(11, 5, corner_count, 20.0);
        let (mesh, _) = solidify(shape(&pieces), 0.25, 1.5);
        let mut random = Random(11);
        for _ in 0..100 {
            let p = pieces.sample(&mut random);
            assert!(contains(&mesh, p), "{p} of the input is not in the solid");
        }
    }
}

#[test]
fn a_larger_radius_gives_a_larger_solid() {
    let pieces = Pieces::random(5, 5, 2, 20.0);
    let tolerance = 0.25;
    let made: Vec<_> = [1.5, 2.1, 3.0].map(|radius| solidify(shape(&pieces), tolerance, radius)).into();
    for pair in made.windows(2) {
        let ((small, _), (large, _)) = (&pair[0], &pair[1]);
        assert!(volume(small) < volume(large));
        // 0.6 apart, each 0.25 off at most.
        for p in small.vertices.iter().step_by(small.vertices.len() / 150 + 1) {
            assert!(contains(large, *p), "{p} of the smaller solid is not in the larger");
        }
    }
}

/// One radian about (1, 2, 3).
fn turn() -> DMat3 {
    DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 1.0)
}

#[track_caller]
fn assert_overlap(a: [f64; 2], b: [f64; 2], factor: f64) {
    assert!(a[0] <= a[1] && b[0] <= b[1]);
    assert!(a[0] * factor <= b[1] && b[0] <= a[1] * factor, "{a:?} times {factor} and {b:?} hold no common value");
}

#[test]
fn turning_the_input_turns_the_solid() {
    let pieces = Pieces::random(21, 5, 3, 16.0);
    let turned = pieces.map(|p| turn() * p);
    let ((_, straight), (mesh, certificate)) = (solidify(shape(&pieces), 0.3, 2.0), solidify(shape(&turned), 0.3, 2.0));
    assert_sandwich(&turned, &mesh, &certificate, 2.0, 21);
    assert_overlap(straight.volume_mm3.unwrap(), certificate.volume_mm3.unwrap(), 1.0);
}

#[test]
fn scaling_everything_scales_the_solid() {
    let pieces = Pieces::random(22, 5, 2, 16.0);
    let small = solidify(shape(&pieces), 0.3, 2.0).1;
    let large = solidify(shape(&pieces.map(|p| p * 10.0)), 3.0, 20.0).1;
    assert_overlap(small.volume_mm3.unwrap(), large.volume_mm3.unwrap(), 1000.0);
    assert_eq!((small.euler, small.shells, small.components), (large.euler, large.shells, large.components));
}

#[test]
fn the_order_of_the_pieces_does_not_matter() {
    let pieces = Pieces::random(23, 9, 2, 16.0);
    let mut turned = pieces.clone();
    turned.0.reverse();
    turned.0.iter_mut().for_each(|piece| piece.reverse());
    let (a, b) = (solidify(shape(&pieces), 0.3, 2.0), solidify(shape(&turned), 0.3, 2.0));
    assert_overlap(a.1.volume_mm3.unwrap(), b.1.volume_mm3.unwrap(), 1.0);
    assert_eq!((a.1.euler, a.1.shells, a.1.components), (b.1.euler, b.1.shells, b.1.components));
}

#[test]
fn dilating_twice_is_dilating_once_by_the_sum() {
    // A segment of length 10 by 0.4 and then by 0.6.
    let (length, tolerance) = (10.0, 0.05);
    let pieces = Pieces(vec![vec![DVec3::ZERO, DVec3::X * length]]);
    let (first, certificate) = solidify(shape(&pieces), tolerance, 0.4);
    let solid = PolygonMesh {
        vertices: first.vertices.clone(),
        faces: first.triangles.iter().map(|t| t.to_vec()).collect(),
        interior: Interior::Solid,
    };
    let (second, again) = solidify(Shape::Mesh(solid), tolerance, 0.6);
    let capsule = |r: f64| std::f64::consts::PI * r * r * (length + 4.0 / 3.0 * r);
    let ((inner, outer), (inner_again, outer_again)) = (bounds(&certificate), bounds(&again));
    let (low, high) = (capsule(1.0 - inner - inner_again), capsule(1.0 + outer + outer_again));
    let got = volume(&second);
    assert!(low <= got && got <= high, "{got} is not in [{low}, {high}]");
    assert_eq!((again.components, again.cavities, again.genus), (Some(1), Some(0), Some(0)));
}

#[test]
fn balls_that_touch_are_two_pieces_or_refused() {
    let pieces = Pieces(vec![vec![DVec3::ZERO], vec![DVec3::X * 4.0]]);
    let job = job(shape(&pieces), JobKind::Solidify, 0.2, Some(2.0));
    // Either answer is right at the very radius where the topology changes, a vertex with two fans never.
    if let Ok(outcome) = run(&job, &Budget::default()) {
        let certificate = outcome.certificate;
        assert_eq!(certificate.nonmanifold_vertices, Some(0));
        assert_eq!(certificate.nonmanifold_edges, Some(0));
        assert!(matches!(certificate.components, Some(1 | 2)), "{:?}", certificate.components);
    }
}

/// The Sierpinski tetrahedron of edge 40, and its vertices.
fn tetrahedron(map: impl Fn(DVec3) -> DVec3) -> (Ifs, [DVec3; 4]) {
    let (depth, height) = (20.0 * 3f64.sqrt(), 40.0 * (2.0 / 3.0f64).sqrt());
    let points = [[0.0; 3], [40.0, 0.0, 0.0], [20.0, depth, 0.0], [20.0, depth / 3.0, height]].map(|p| map(DVec3::from_array(p)));
    let maps = points.map(|p| AffineMap { linear: DMat3::from_diagonal(DVec3::splat(0.5)), translation: p * 0.5 });
    (Ifs { maps: maps.to_vec(), primitive: None, graph: None }, points)
}

#[test]
fn computed_boxes_turn_with_the_attractor() {
    // The box of a Sierpinski tetrahedron is that of its four vertices, in any direction.
    for turned in [false, true] {
        let (ifs, points) = tetrahedron(|p| if turned { turn() * p } else { p });
        let outcome = run(&job(Shape::Ifs(ifs), JobKind::Measure, 0.05, None), &Budget::default()).unwrap();
        let low = points.iter().fold(DVec3::INFINITY, |a, p| a.min(*p)).to_array();
        let high = points.iter().fold(DVec3::NEG_INFINITY, |a, p| a.max(*p)).to_array();
        for (corner, exact) in [low, high].iter().enumerate() {
            for ([lo, hi], exact) in outcome.certificate.bbox_mm[corner].iter().zip(exact) {
                assert!(lo - ROUNDING <= *exact && *exact <= hi + ROUNDING, "{exact} is not in [{lo}, {hi}]");
                assert!(hi - lo <= 0.05, "[{lo}, {hi}] is wider than the tolerance");
            }
        }
    }
}

#[test]
fn fractal_solids_lie_between_their_bounds() {
    // Brute force on the 4^5 leaves: every leaf is within 40 / 32 of the set, so the sandwich widens by that much.
    let (ifs, points) = tetrahedron(|p| p);
    let (radius, tolerance) = (3.0, 0.5);
    let (mesh, certificate) = solidify(Shape::Ifs(ifs), tolerance, radius);
    let mut corners: Vec<DVec3> = points.to_vec();
    for _ in 0..5 {
        corners = corners.iter().flat_map(|p| points.map(|q| (*p + q) * 0.5)).collect();
    }
    let set = Pieces(corners.into_iter().map(|p| vec![p]).collect());
    let spread = 40.0 / 32.0;
    let (inner, outer) = bounds(&certificate);
    for p in mesh.vertices.iter().step_by(mesh.vertices.len() / 2000 + 1) {
        let d = set.distance(*p);
        assert!(radius - inner <= d + ROUNDING && d <= radius + outer + spread, "{p} is at {d}");
    }
}

#[test]
fn impossible_radii_and_tolerances_are_refused() {
    for (tolerance, radius) in [(0.0, 1.0), (-1.0, 1.0), (f64::NAN, 1.0), (0.1, 0.0), (0.1, -1.0), (0.1, f64::INFINITY), (2.0, 1.0)] {
        let pieces = Pieces(vec![vec![DVec3::ZERO]]);
        let result = run(&job(shape(&pieces), JobKind::Solidify, tolerance, Some(radius)), &Budget::default());
        match result {
            Err(error) => assert_ne!(error.kind, lacuna_kernel::error::Kind::Defect, "{error}"),
            // A tolerance above the radius may still be kept.
            Ok(outcome) => assert!(tolerance > radius && outcome.certificate.achieved_bound_mm <= tolerance),
        }
    }
}
