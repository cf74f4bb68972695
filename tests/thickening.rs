//! Walls, closing, and radii that vary: closed forms, and what certificates claim against brute-force distances.

use std::f64::consts::PI;

use glam::DVec3;
use lacuna_fabrication::{Certificate, Geometry, Input, Job, JobError, JobKind, Outcome, Params, WallOrder, WallSide, run};
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_kernel::model::{BezierCurve, BoundaryRule, Group, Interior, Model, Part, PartRadius, PolygonMesh, Scheme, Shape, Subdivision};
use lacuna_kernel::solid::TriMesh;
use lacuna_tests::support::inside;
use lacuna_tests::support::random::Random;

fn mesh(vertices: Vec<DVec3>, faces: &[&[u32]]) -> Shape {
    Shape::Mesh(PolygonMesh { vertices, faces: faces.iter().map(|face| face.to_vec()).collect(), interior: Interior::Auto })
}

/// A cube from the origin on, with outward faces.
fn cube(side: f64) -> Shape {
    let corner = |code: usize| DVec3::from_array(std::array::from_fn(|axis| if code >> axis & 1 == 1 { side } else { 0.0 }));
    mesh((0..8).map(corner).collect(), &[&[0, 4, 6, 2], &[1, 3, 7, 5], &[0, 1, 5, 4], &[2, 6, 7, 3], &[0, 2, 3, 1], &[4, 5, 7, 6]])
}

/// An octahedron about the origin.
fn octahedron(reach: f64) -> Shape {
    let corners = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z].map(|corner| reach * corner);
    let faces: [&[u32]; 8] = [&[0, 2, 4], &[2, 1, 4], &[1, 3, 4], &[3, 0, 4], &[2, 0, 5], &[1, 2, 5], &[3, 1, 5], &[0, 3, 5]];
    mesh(corners.to_vec(), &faces)
}

fn solidify(shape: Shape, params: Params) -> Result<Outcome, JobError> {
    let input = Input { name: "shape".into(), model: Model { name: None, shape }, radius_mm: None };
    let job = Job { kind: JobKind::Solidify, inputs: vec![input], params, outputs: Vec::new(), limits: Limits::default() };
    run(&job, &Budget::default())
}

#[track_caller]
fn solid(shape: Shape, params: Params) -> (TriMesh, Certificate) {
    let tolerance = params.tolerance_mm;
    match solidify(shape, params) {
        Ok(Outcome { geometry: Geometry::Solid(solid), certificate }) => {
            assert!(certificate.achieved_bound_mm <= tolerance, "{} > {tolerance}", certificate.achieved_bound_mm);
            assert_eq!(certificate.boundary_edges, Some(0));
            assert_eq!(serde_json::to_value(&certificate).unwrap()["self_intersections"], "none");
            (solid.mesh().clone(), certificate)
        }
        other => panic!("{other:?}"),
    }
}

fn walled(tolerance: f64, thickness_mm: f64, side: WallSide) -> Params {
    Params { wall: Some(WallOrder { thickness_mm, side }), ..Params::new(tolerance) }
}

#[test]
fn a_hollow_cube() {
    let (_, certificate) = solid(cube(10.0), walled(0.01, 1.0, WallSide::Inward));
    let wall = certificate.wall.unwrap();
    let [low, high] = wall.reached_mm;
    assert!(low <= 1.0 && 1.0 <= high);
    // The hollow is a cube: of the sides that the bounds allow.
    let hollow = wall.hollow_volume_mm3.unwrap();
    assert!((10.0 - 2.0 * high).powi(3) <= hollow && hollow <= (10.0 - 2.0 * low).powi(3), "{hollow}");
    assert_eq!((certificate.components, certificate.cavities, certificate.euler), (Some(1), Some(1), Some(4)));
    assert!((certificate.mesh_volume_mm3.unwrap() + hollow - 1000.0).abs() < 1e-9);
}

#[test]
fn a_wall_around_a_cube() {
    let (_, certificate) = solid(cube(10.0), walled(0.01, 1.0, WallSide::Outward));
    // Steiner's formula for what is within w of the cube, less the cube.
    let steiner = |w: f64| 600.0 * w + 30.0 * PI * w * w + 4.0 / 3.0 * PI * w.powi(3);
    let [low, high] = certificate.wall.unwrap().reached_mm;
    let volume = certificate.mesh_volume_mm3.unwrap();
    assert!(steiner(low) <= volume && volume <= steiner(high), "{volume}");
    let [[lower, _, _], [upper, _, _]] = certificate.bbox_mm;
    assert!(lower[0] <= -1.0 && -1.0 <= lower[1] && upper[0] <= 11.0 && 11.0 <= upper[1]);
}

#[test]
fn a_wall_of_a_smooth_surface() {
    // The surface itself closes: Catmull-Clark's cube of side 20, volume 1000 times that of side 2.
    let vertices =
        (0..8).map(|code: usize| DVec3::from_array(std::array::from_fn(|axis| if code >> axis & 1 == 1 { 10.0 } else { -10.0 })));
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let faces = faces.map(|face| face.to_vec()).to_vec();
    let (creases, corners) = (Vec::new(), Vec::new());
    let boundary = BoundaryRule::default();
    let surface = Subdivision {
        scheme: Scheme::CatmullClark,
        vertices: vertices.collect(),
        faces,
        creases,
        corners,
        boundary,
        coefficients: Vec::new(),
    };
    let shape = Shape::Subdivision(surface);
    let (mesh, certificate) = solid(shape, walled(0.05, 1.0, WallSide::Inward));
    let exact = 2_620.419_033;
    // Area 919.76: a change by the tolerance everywhere.
    assert!((certificate.wall.unwrap().solid_volume_mm3 - exact).abs() < 0.05 * 920.0);
    // The centre is hollow, and half a wall below the top there is material.
    assert!(!inside::contains(&mesh.vertices, &mesh.triangles, DVec3::new(0.01, 0.02, 0.03)));
    assert!(inside::contains(&mesh.vertices, &mesh.triangles, DVec3::new(0.01, 0.02, 10.0 * 68.0 / 81.0 - 0.5)));
}

#[test]
fn a_wall_that_leaves_nothing() {
    let error = solidify(cube(10.0), walled(0.05, 6.0, WallSide::Inward)).unwrap_err();
    assert_eq!(error.code, "wall.no-hollow");
    let remedy = error.limit.unwrap().remedy.unwrap();
    assert_eq!(remedy.0, "wall_mm");
    solid(cube(10.0), walled(0.05, remedy.1, WallSide::Inward));
    // The largest ball of this octahedron has the radius 10 / sqrt(3).
    let error = solidify(octahedron(10.0), walled(0.05, 7.0, WallSide::Inward)).unwrap_err();
    let allowed = error.limit.unwrap().allowed;
    assert!((0.95..=1.0).contains(&(allowed * 3.0_f64.sqrt() / 10.0)), "{allowed}");
    // No surface that closes, nothing to hollow.
    let open = mesh(vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[&[0, 1, 2]]);
    assert_eq!(solidify(open, walled(0.05, 1.0, WallSide::Inward)).unwrap_err().code, "job.not-a-solid");
}

#[test]
fn the_wall_of_a_dilation_is_where_the_certificate_says() {
    let mut random = Random(5);
    for case in 0..4 {
        let points: Vec<DVec3> = (0..6).map(|_| random.point(6.0)).collect();
        let shape = mesh(points, &[&[0, 1], &[1, 2], &[3, 4, 5]]);
        let plain = solid(shape.clone(), Params { radius_mm: Some(2.0), ..Params::new(0.05) }).0;
        let params = Params { radius_mm: Some(2.0), ..walled(0.05, 0.7, WallSide::Inward) };
        let (hollow, certificate) = solid(shape, params);
        let [low, high] = certificate.wall.unwrap().reached_mm;
        for _ in 0..300 {
            let p = random.point(11.0) - DVec3::splat(2.5);
            let within = inside::contains(&plain.vertices, &plain.triangles, p);
            let depth = plain.triangles.iter().map(|t| distance(p, &t.map(|k| plain.vertices[k as usize]))).fold(f64::INFINITY, f64::min);
            let made = inside::contains(&hollow.vertices, &hollow.triangles, p);
            if !within || depth > high {
                assert!(!made, "case {case}: {p} at depth {depth} is not in the wall");
            } else if depth < low {
                assert!(made, "case {case}: {p} at depth {depth} is in the wall");
            }
        }
    }
}

/// The distance of a point from a triangle: by alternating searches along its sides and the foot on its plane.
fn distance(p: DVec3, &[a, b, c]: &[DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a);
    let inside = |x: DVec3| [(a, b), (b, c), (c, a)].iter().all(|(from, to)| (*to - *from).cross(x - *from).dot(normal) >= 0.0);
    let foot = p - normal * ((p - a).dot(normal) / normal.length_squared());
    let side = |from: DVec3, to: DVec3| {
        let t = ((p - from).dot(to - from) / (to - from).length_squared()).clamp(0.0, 1.0);
        p.distance(from + t * (to - from))
    };
    let sides = side(a, b).min(side(b, c)).min(side(c, a));
    if normal.length_squared() > 0.0 && inside(foot) { p.distance(foot) } else { sides }
}

#[test]
fn closing_joins_two_rods() {
    let rods = |length: f64| {
        let ends = [[0.0, 0.0], [length, 0.0], [0.0, 3.0], [length, 3.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
        mesh(ends.to_vec(), &[&[0, 1], &[2, 3]])
    };
    let made = |length: f64, closing: f64, tolerance: f64| {
        let params = Params { radius_mm: Some(1.0), closing_mm: Some(closing), ..Params::new(tolerance) };
        solid(rods(length), params).1
    };
    // The gap of 1 stays where balls of 0.9 pass, up to the tolerance, and is bridged where they do not.
    assert_eq!(made(10.0, 0.8, 0.05).components, Some(2));
    assert_eq!(made(10.0, 1.5, 0.05).components, Some(1));
    // Between the rods: a rhombus of the two centres and the centres of the balls that touch both, less the sectors in it.
    let (r, h, d) = (1.0_f64, 0.75_f64, 3.0_f64);
    let height = ((r + h).powi(2) - (0.5 * d).powi(2)).sqrt();
    let alpha = (height / (0.5 * d)).atan();
    let section = 2.0 * PI * r * r + d * height - 2.0 * r * r * alpha - 2.0 * h * h * (0.5 * PI - alpha);
    let tolerance = 0.03;
    let volume = |length: f64| made(length, 1.5, tolerance).mesh_volume_mm3.unwrap();
    let found = (volume(20.0) - volume(10.0)) / 10.0;
    // The section's outline is shorter than those of two circles.
    assert!((found - section).abs() < 2.0 * tolerance * 4.0 * PI, "{found} for {section}");
}

/// The union of balls along a segment, the radius going from p to q.
fn cone(length: f64, p: f64, q: f64) -> f64 {
    let sine = (p - q) / length;
    let cosine = (1.0 - sine * sine).sqrt();
    let (first, second, height) = (p * cosine, q * cosine, length * cosine * cosine);
    let frustum = PI * height / 3.0 * (first * first + first * second + second * second);
    let (x, y) = (p * sine, q * sine);
    let near = PI * (p * p * x - x.powi(3) / 3.0 + 2.0 / 3.0 * p.powi(3));
    let far = PI * (2.0 / 3.0 * q.powi(3) - q * q * y + y.powi(3) / 3.0);
    frustum + near + far
}

fn with_radii(shape: Shape, radius: PartRadius) -> Part {
    Part { name: None, transform: None, shape, radius: Some(radius) }
}

fn grouped(parts: Vec<Part>) -> Shape {
    Shape::Group(Group { parts, joins: Vec::new() })
}

#[test]
fn radii_at_the_ends_of_a_segment() {
    let rod = || mesh(vec![DVec3::ZERO, DVec3::new(10.0, 1.0, 2.0)], &[&[0, 1]]);
    let length = DVec3::new(10.0, 1.0, 2.0).length();
    for (p, q) in [(2.0, 1.0), (0.5, 2.5), (1.0, 1.0)] {
        let shape = grouped(vec![with_radii(rod(), PartRadius::AtPoints(vec![p, q]))]);
        let (_, certificate) = solid(shape, Params { radius_mm: Some(1.0), ..Params::new(0.05) });
        let [low, high] = certificate.volume_mm3.unwrap();
        let exact = cone(length, p, q);
        assert!(low <= exact && exact <= high && high - low < 0.8 * exact, "{exact} is not in [{low}, {high}]");
        let volume = certificate.mesh_volume_mm3.unwrap();
        assert!((volume / exact - 1.0).abs() < 0.06, "{volume} for {exact}");
        let [lower, upper] = certificate.bbox_mm;
        assert!(lower[0][0] <= -p && -p <= lower[0][1] && upper[0][0] <= 10.0 + q && 10.0 + q <= upper[0][1], "{lower:?} {upper:?}");
        assert_eq!((certificate.components, certificate.genus), (Some(1), Some(0)));
    }
}

#[test]
fn parts_with_radii_of_their_own() {
    let point = |x: f64| mesh(vec![DVec3::new(x, 0.0, 0.0)], &[&[0]]);
    let ball = |r: f64| 4.0 / 3.0 * PI * r.powi(3);
    let shape = || {
        grouped(vec![
            with_radii(point(0.0), PartRadius::Constant(4.0)),
            with_radii(point(10.0), PartRadius::Constant(0.5)),
            Part { name: None, transform: None, shape: point(20.0), radius: None },
        ])
    };
    let (_, certificate) = solid(shape(), Params { radius_mm: Some(1.0), ..Params::new(0.02) });
    let exact = ball(4.0) + ball(0.5) + ball(1.0);
    let [low, high] = certificate.volume_mm3.unwrap();
    assert!(low <= exact && exact <= high, "{exact} is not in [{low}, {high}]");
    assert!((certificate.mesh_volume_mm3.unwrap() / exact - 1.0).abs() < 0.02);
    assert_eq!(certificate.components, Some(3));
    assert!(certificate.thickness_min_mm.unwrap() <= 1.0);
    // One radius cannot tell of several.
    let asked = Params { radius_mm: Some(1.0), stability: true, ..Params::new(0.02) };
    assert_eq!(solidify(shape(), asked).unwrap_err().code, "stability.several-radii");
}

/// How far p is inside of the union of balls along segments whose radius is affine; negative outside. The excess of the radius over the distance is
/// concave along a segment.
fn depth(p: DVec3, segments: &[([DVec3; 2], [f64; 2])]) -> f64 {
    let along = |(ends, radii): &([DVec3; 2], [f64; 2])| {
        let at = |t: f64| radii[0] + t * (radii[1] - radii[0]) - p.distance(ends[0] + t * (ends[1] - ends[0]));
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let (first, second) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if at(first) < at(second) { low = first } else { high = second }
        }
        at(0.5 * (low + high)).max(at(0.0)).max(at(1.0))
    };
    segments.iter().map(along).fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn radii_that_vary_hold_their_bounds() {
    let mut random = Random(11);
    for case in 0..12 {
        let count = 3 + case % 4;
        let points: Vec<DVec3> = (0..2 * count).map(|_| random.point(8.0)).collect();
        let radii: Vec<f64> = (0..2 * count).map(|_| 0.3 + 1.7 * random.unit()).collect();
        let faces: Vec<Vec<u32>> = (0..count as u32).map(|k| vec![2 * k, 2 * k + 1]).collect();
        let shape = Shape::Mesh(PolygonMesh { vertices: points.clone(), faces, interior: Interior::Auto });
        let shape = grouped(vec![with_radii(shape, PartRadius::AtPoints(radii.clone()))]);
        let params = Params { radius_mm: Some(1.0), simplify: case % 2 == 0, ..Params::new(0.06) };
        let (mesh, certificate) = solid(shape, params);
        let segments: Vec<_> = (0..count).map(|k| ([points[2 * k], points[2 * k + 1]], [radii[2 * k], radii[2 * k + 1]])).collect();
        let (inner, outer) = (certificate.inner_bound_mm.unwrap(), certificate.outer_bound_mm.unwrap());
        let mut checked = 0;
        for _ in 0..600 {
            let p = random.point(12.0) - DVec3::splat(2.0);
            let depth = depth(p, &segments);
            if depth.abs() > 1.0 {
                continue;
            }
            checked += 1;
            let within = inside::contains(&mesh.vertices, &mesh.triangles, p);
            assert!(within || depth < inner, "case {case}: {p} is {depth} inside, and not in the solid");
            assert!(!within || depth > -outer, "case {case}: {p} is {depth} inside, and in the solid");
        }
        assert!(checked > 20, "{checked}");
        for vertex in &mesh.vertices {
            let depth = self::depth(*vertex, &segments);
            assert!(depth <= inner + 1e-6 && depth >= -outer - 1e-6, "case {case}: a vertex is {depth} inside");
        }
    }
}

#[test]
fn a_spline_whose_radius_is_a_spline() {
    let points = vec![DVec3::ZERO, DVec3::new(5.0, 8.0, 0.0), DVec3::new(10.0, 0.0, 3.0)];
    let radii = [0.5, 2.0, 1.0];
    let curve = BezierCurve { control_points: points.clone(), weights: None };
    let shape = grouped(vec![with_radii(Shape::BezierCurve(curve), PartRadius::AtPoints(radii.to_vec()))]);
    let (mesh, certificate) = solid(shape, Params { radius_mm: Some(1.0), ..Params::new(0.06) });
    let at = |t: f64| {
        let weights = [(1.0 - t).powi(2), 2.0 * t * (1.0 - t), t * t];
        let point: DVec3 = (0..3).map(|k| weights[k] * points[k]).sum();
        (point, (0..3).map(|k| weights[k] * radii[k]).sum::<f64>())
    };
    // Steps of 0.01 mm at most.
    let samples: Vec<_> = (0..=2000).map(|step| at(f64::from(step) / 2000.0)).collect();
    let bound = certificate.achieved_bound_mm + 0.01;
    for vertex in &mesh.vertices {
        let depth = samples.iter().map(|(point, radius)| radius - vertex.distance(*point)).fold(f64::NEG_INFINITY, f64::max);
        assert!(depth.abs() <= bound, "a vertex is {depth} inside");
    }
}

#[test]
fn radii_by_level() {
    let text = std::fs::read_to_string(lacuna_tests::support::root().join("crates/exchange/library/binary_tree.json")).unwrap();
    let model = lacuna_exchange::document::read_model(text.as_bytes(), &lacuna_exchange::document::DocumentLimits::default()).unwrap();
    let radius = PartRadius::ByLevel { first: 4.0, ratio: 0.5, least: 1.0 };
    let (mesh, certificate) = solid(grouped(vec![with_radii(model.shape, radius)]), Params { radius_mm: Some(1.0), ..Params::new(0.4) });
    // The tree by hand: a trunk of 100, two branches of 3/5 of it at 45 degrees, and so on.
    let mut segments = Vec::new();
    grow(DVec3::ZERO, DVec3::new(0.0, 100.0, 0.0), 4.0, 12, &mut segments);
    let (inner, outer) = (certificate.inner_bound_mm.unwrap(), certificate.outer_bound_mm.unwrap());
    // What is left out beyond 12 levels is no larger than 100 (3/5)^13 / (1 - 3/5).
    let rest = 100.0 * 0.6_f64.powi(13) / 0.4;
    for vertex in mesh.vertices.iter().step_by(97) {
        let depth = depth(*vertex, &segments);
        assert!(depth <= inner + 1e-6 && depth >= -outer - rest, "a vertex is {depth} inside");
    }
    assert_eq!(certificate.components, Some(1));
}

fn grow(from: DVec3, along: DVec3, radius: f64, levels: u32, segments: &mut Vec<([DVec3; 2], [f64; 2])>) {
    let to = from + along;
    segments.push(([from, to], [radius.max(1.0); 2]));
    if levels > 0 {
        for turn in [PI / 4.0, -PI / 4.0] {
            let turned = DVec3::new(along.x * turn.cos() - along.y * turn.sin(), along.x * turn.sin() + along.y * turn.cos(), 0.0);
            grow(to, 0.6 * turned, 0.5 * radius, levels - 1, segments);
        }
    }
}

fn dilated(radius: f64, tolerance: f64) -> Params {
    Params { radius_mm: Some(radius), ..Params::new(tolerance) }
}

#[test]
fn a_radius_larger_than_the_shape() {
    let (_, certificate) = solid(cube(1.0), dilated(1000.0, 2.0));
    let [low, high] = certificate.volume_mm3.unwrap();
    let r = 1000.0_f64;
    let exact = 1.0 + 6.0 * r + 3.0 * PI * r * r + 4.0 / 3.0 * PI * r.powi(3);
    assert!(low <= exact && exact <= high, "{exact} is not in [{low}, {high}]");
    assert_eq!((certificate.components, certificate.euler), (Some(1), Some(2)));
}

#[test]
fn what_cannot_be_made_is_refused_with_what_can() {
    // Half a step of single precision at 10 m is 0.0005 mm.
    let far = || mesh(vec![DVec3::splat(10_000.0), DVec3::new(10_010.0, 10_000.0, 10_000.0)], &[&[0, 1]]);
    let error = solidify(far(), dilated(1.0, 1e-5)).unwrap_err();
    assert_eq!(error.code, "tolerance-unreachable");
    let (name, reachable) = error.limit.unwrap().remedy.unwrap();
    assert_eq!(name, "tolerance_mm");
    solid(far(), dilated(1.0, reachable));
    // A radius below what single precision tells apart there.
    assert_eq!(solidify(far(), dilated(1e-4, 1e-5)).unwrap_err().code, "tolerance-unreachable");
    // Some 10^10 triangles, and 10^8 at the largest tolerance: only the limit helps. A smaller cube has a tolerance that would do (`plans.rs` tries such ones).
    let refused = |size: f64| {
        let error = solidify(cube(size), Params { simplify: false, ..dilated(1.0, 2e-3) }).unwrap_err();
        assert_eq!(error.code, "limit-triangles", "{error:?}");
        error.limit.unwrap().remedy.unwrap()
    };
    let (name, enough) = refused(1000.0);
    assert!(name == "triangles" && enough > 1e8, "{name} {enough}");
    let (name, reachable) = refused(60.0);
    assert!(name == "tolerance_mm" && reachable > 2e-3 && reachable < 0.5, "{name} {reachable}");
}

#[test]
fn a_million_sites_at_one_place() {
    let point = vec![0; 1];
    let shape = Shape::Mesh(PolygonMesh { vertices: vec![DVec3::ONE], faces: vec![point; 1_000_000], interior: Interior::Auto });
    let (_, certificate) = solid(shape, dilated(2.0, 0.05));
    let [low, high] = certificate.volume_mm3.unwrap();
    let exact = 4.0 / 3.0 * PI * 8.0;
    assert!(low <= exact && exact <= high);
    assert_eq!((certificate.components, certificate.euler), (Some(1), Some(2)));
}

#[test]
fn radii_that_make_no_sense_are_named() {
    let rod = || mesh(vec![DVec3::ZERO, DVec3::X], &[&[0, 1]]);
    let refused = |shape: Shape, radius: PartRadius| {
        let error = solidify(grouped(vec![with_radii(shape, radius)]), dilated(1.0, 0.1)).unwrap_err();
        (error.code, error.diagnostics[0].pointer.clone())
    };
    assert_eq!(refused(rod(), PartRadius::AtPoints(vec![1.0; 3])), ("radius.count", "/parts/0/radii_mm".into()));
    assert_eq!(refused(rod(), PartRadius::AtPoints(vec![1.0, -1.0])), ("radius.not-positive", "/parts/0/radii_mm/1".into()));
    assert_eq!(refused(rod(), PartRadius::Constant(f64::NAN)), ("radius.not-positive", "/parts/0/radius_mm".into()));
    let levels = PartRadius::ByLevel { first: 1.0, ratio: 1.0, least: 0.1 };
    assert_eq!(refused(rod(), levels), ("radius.ratio", "/parts/0/radius_by_level/ratio".into()));
    assert_eq!(refused(cube(1.0), PartRadius::AtPoints(vec![1.0; 8])).0, "radius.solid");
    assert_eq!(refused(grouped(vec![with_radii(rod(), PartRadius::Constant(1.0))]), PartRadius::AtPoints(vec![1.0])).0, "radius.no-points");
}

/// Balls around the corners of a unit cube join along its edges at r = 1/2, close its faces at sqrt(2) / 2 and its inside at sqrt(3) / 2; wires along its edges close faces at 1/2 and the inside at sqrt(2) / 2.
/// Beside each of these radii, within a fraction of the tolerance, the topology is the exact one, and proven.
#[test]
fn the_topology_is_exact_beside_critical_radii() {
    let corner = |code: u32| DVec3::from_array(std::array::from_fn(|axis| f64::from(code >> axis as u32 & 1)));
    // An angle that no axis of the lattice has.
    let turned = |x: DVec3| glam::DQuat::from_scaled_axis(DVec3::new(0.3, 0.7, 0.2)) * x;
    let vertices: Vec<DVec3> = (0..8).map(corner).map(turned).collect();
    let of = |faces: Vec<Vec<u32>>| Shape::Mesh(PolygonMesh { vertices: vertices.clone(), faces, interior: Interior::Auto });
    let corners = || of((0..8).map(|code| vec![code]).collect());
    let edges =
        || of((0..8).flat_map(|p: u32| [1, 2, 4].into_iter().filter(move |bit| p & bit == 0).map(move |bit| vec![p, p | bit])).collect());
    // Components, handles and voids.
    let found = |shape: Shape, radius: f64| {
        let (_, certificate) = solid(shape, dilated(radius, 0.1 * radius));
        assert_eq!(serde_json::to_value(&certificate).unwrap()["topology_exact"], true, "{radius}: {:?}", certificate.warnings);
        (certificate.components.unwrap(), certificate.genus.unwrap(), certificate.cavities.unwrap())
    };
    let near = 0.003;
    let [half, face, inside] = [0.5, 0.5_f64.sqrt(), 0.75_f64.sqrt()];
    assert_eq!(found(corners(), half - near), (8, 0, 0));
    assert_eq!(found(corners(), half + near), (1, 5, 0));
    assert_eq!(found(corners(), face - near), (1, 5, 0));
    assert_eq!(found(corners(), face + near), (1, 0, 1));
    assert_eq!(found(corners(), inside - near), (1, 0, 1));
    assert_eq!(found(corners(), inside + near), (1, 0, 0));
    assert_eq!(found(edges(), half - near), (1, 5, 0));
    assert_eq!(found(edges(), half + near), (1, 0, 1));
    assert_eq!(found(edges(), face - near), (1, 0, 1));
    assert_eq!(found(edges(), face + near), (1, 0, 0));
}

/// Triangles without area, up to rounding or altogether: the sets are segments, and so are their dilations, whatever corner comes first.
#[test]
fn triangles_without_area() {
    let ball = |radius: f64| 4.0 / 3.0 * PI * radius.powi(3);
    let mut random = Random(11);
    let mut number = || 2.0 * random.unit() - 1.0;
    for round in 0..12 {
        let (from, along) = (DVec3::new(number(), number(), number()), 5.0 * DVec3::new(number(), number(), number()));
        let share = [0.0, 0.3, 1.0][round % 3];
        let mut corners = [from, from + along, from + share * along];
        corners.rotate_left(round / 3 % 3);
        let params = Params { radius_mm: Some(1.0), ..Params::new(0.1) };
        let (_, certificate) = solid(mesh(corners.to_vec(), &[&[0, 1, 2]]), params);
        let [low, high] = certificate.volume_mm3.unwrap();
        let exact = ball(1.0) + PI * along.length();
        assert!(low <= exact && exact <= high, "{exact} is not in [{low}, {high}]: {corners:?}");
        assert_eq!((certificate.components, certificate.genus), (Some(1), Some(0)));
    }
    // A triangle with a whisker, which is a triangle with two corners in one place.
    let places = [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 0.0], [2.0, 0.0], [12.0, 0.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
    for whisker in [[3, 4, 5], [5, 3, 4], [4, 5, 3]] {
        let params = Params { radius_mm: Some(1.0), ..Params::new(0.1) };
        let (mesh, certificate) = solid(mesh(places.to_vec(), &[&[0, 1, 2], &whisker]), params);
        let reach = mesh.vertices.iter().map(|vertex| vertex.x).fold(0.0, f64::max);
        assert!((12.9..13.1).contains(&reach) && certificate.components == Some(1), "{reach}");
    }
}
