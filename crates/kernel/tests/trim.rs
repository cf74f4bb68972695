//! Trimmed surfaces against closed forms: areas, topology, Hausdorff bounds, and loops that are refused.

use glam::{DVec2, DVec3};
use lacuna_kernel::attractor::refine;
use lacuna_kernel::budget::Budget;
use lacuna_kernel::model::{ControlNet, CurveScheme, Finding, Group, Model, Part, Shape, TensorProduct, Trim, TrimCurve};
use lacuna_kernel::tessellation::Tessellation;
use lacuna_kernel::tolerance::Tolerance;
use std::f64::consts::{PI, SQRT_2};

const CIRCLE: [(f64, f64); 9] =
    [(1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (-1.0, 1.0), (-1.0, 0.0), (-1.0, -1.0), (0.0, -1.0), (1.0, -1.0), (1.0, 0.0)];

fn quarters() -> Vec<f64> {
    vec![0.0, 0.0, 0.0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1.0, 1.0, 1.0]
}

fn weights() -> Vec<f64> {
    (0..9).map(|k| if k % 2 == 0 { 1.0 } else { 0.5_f64.sqrt() }).collect()
}

/// A circle of nine points.
fn circle(centre: [f64; 2], radius: [f64; 2]) -> Vec<TrimCurve> {
    let control_points = CIRCLE.iter().map(|(x, y)| DVec2::new(centre[0] + radius[0] * x, centre[1] + radius[1] * y)).collect();
    vec![TrimCurve::Spline { scheme: CurveScheme::Nurbs { degree: 2, knots: quarters() }, control_points, weights: Some(weights()) }]
}

fn polygon(points: &[[f64; 2]]) -> Vec<TrimCurve> {
    let mut list: Vec<DVec2> = points.iter().map(|&p| p.into()).collect();
    list.push(list[0]);
    vec![TrimCurve::Polyline(list)]
}

fn bezier(size: [usize; 2], points: Vec<DVec3>, trim: Trim) -> Shape {
    Shape::TensorProduct(TensorProduct {
        schemes: vec![CurveScheme::Bezier; 2],
        control_points: ControlNet { size: size.to_vec(), points, weights: None },
        separate: false,
        trim: Some(trim),
    })
}

/// The square [0, side]^2 of the plane z = 0.
fn plane(side: f64, trim: Trim) -> Shape {
    let points = [[0.0, 0.0], [0.0, side], [side, 0.0], [side, side]].map(|[x, y]| DVec3::new(x, y, 0.0));
    bezier([2, 2], points.to_vec(), trim)
}

/// A profile (distance, height) turned about the z axis: u along the profile, v around.
fn revolved(profile: &[(f64, f64)], profile_weights: &[f64], knots: Vec<f64>, degree: usize, trim: Option<Trim>) -> Shape {
    let points = profile.iter().flat_map(|&(d, h)| CIRCLE.map(|(x, y)| DVec3::new(x * d, y * d, h))).collect();
    let own = weights();
    let all = profile_weights.iter().flat_map(|a| own.iter().map(move |b| a * b)).collect();
    Shape::TensorProduct(TensorProduct {
        schemes: vec![CurveScheme::Nurbs { degree, knots }, CurveScheme::Nurbs { degree: 2, knots: quarters() }],
        control_points: ControlNet { size: vec![profile.len(), 9], points, weights: Some(all) },
        separate: false,
        trim,
    })
}

fn cylinder(radius: f64, height: f64, trim: Option<Trim>) -> Shape {
    revolved(&[(radius, 0.0), (radius, height)], &[1.0, 1.0], vec![0.0, 0.0, 1.0, 1.0], 1, trim)
}

fn sphere(radius: f64, trim: Option<Trim>) -> Shape {
    let half = [(0.0, -1.0), (1.0, -1.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(d, h)| (radius * d, radius * h));
    revolved(&half, &weights()[..5], vec![0.0, 0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 1.0], 2, trim)
}

fn lower(shape: Shape) -> Result<lacuna_kernel::model::Lowered, Vec<Finding>> {
    Model { name: None, shape }.lower()
}

fn drawn(shape: Shape, tolerance: f64) -> Tessellation {
    let lowered = lower(shape).unwrap_or_else(|findings| panic!("{findings:?}"));
    let tessellation = refine(&lowered.attractor, Tolerance::new(tolerance).unwrap(), &Budget::default()).unwrap();
    assert!(tessellation.deviation_mm <= tolerance * (1.0 + 1e-9), "{} > {tolerance}", tessellation.deviation_mm);
    tessellation
}

fn area(mesh: &Tessellation) -> f64 {
    let corner = |k: u32| mesh.vertices[k as usize];
    mesh.triangles.iter().map(|&[a, b, c]| 0.5 * (corner(b) - corner(a)).cross(corner(c) - corner(a)).length()).sum()
}

/// (euler, boundary loops, components), which are those of the mesh's own half edges; every vertex is used, no edge has
/// three triangles, and neighbours have one orientation.
fn topology(mesh: &Tessellation) -> (i64, u64, u64) {
    let complex = mesh.complex.as_ref().expect("a complex");
    let mut directed = std::collections::BTreeSet::new();
    for corners in &mesh.triangles {
        for k in 0..3 {
            let arm = (corners[k], corners[(k + 1) % 3]);
            assert!(arm.0 != arm.1 && directed.insert(arm), "the half edge {arm:?} is there twice");
        }
    }
    let rim: Vec<(u32, u32)> = directed.iter().copied().filter(|&(a, b)| !directed.contains(&(b, a))).collect();
    assert_eq!(rim.len() as u64, complex.boundary_edges);
    let edges = (directed.len() + rim.len()) / 2;
    let used: std::collections::BTreeSet<u32> = mesh.triangles.iter().flatten().copied().collect();
    assert_eq!(used.len(), mesh.vertices.len());
    assert_eq!(complex.euler, used.len() as i64 - edges as i64 + mesh.triangles.len() as i64);
    // Every rim vertex has one way out: loops do not touch.
    let ways: std::collections::BTreeMap<u32, u32> = rim.iter().copied().collect();
    assert_eq!(ways.len(), rim.len());
    assert!(rim.iter().all(|(_, end)| ways.contains_key(end)));
    (complex.euler, complex.boundary_loops, complex.components)
}

#[test]
fn an_annulus_in_the_plane_has_its_area_and_two_rims() {
    for tolerance in [1.0, 0.1, 1e-3, 1e-5] {
        let trim = Trim { outer: Some(circle([0.5, 0.5], [0.4, 0.4])), inner: vec![circle([0.45, 0.55], [0.2, 0.2])] };
        let mesh = drawn(plane(100.0, trim), tolerance);
        assert_eq!(topology(&mesh), (0, 2, 1), "{tolerance}");
        // An annulus whose rims move by at most the tolerance.
        let exact = PI * (40.0_f64.powi(2) - 20.0_f64.powi(2));
        let bound = 2.0 * PI * 60.0 * mesh.deviation_mm;
        assert!((area(&mesh) - exact).abs() <= bound, "{tolerance}: {} is not {exact}", area(&mesh));
        let radii = mesh.vertices.iter().map(|x| (DVec3::new(50.0, 50.0, 0.0).distance(*x), DVec3::new(45.0, 55.0, 0.0).distance(*x)));
        assert!(radii.clone().all(|(outer, inner)| outer <= 40.0 + 1e-9 && inner >= 20.0 - mesh.deviation_mm));
        assert!(radii.clone().any(|(outer, _)| (outer - 40.0).abs() < 1e-9));
    }
}

#[test]
fn without_an_outer_loop_the_border_is_kept() {
    let trim = Trim { outer: None, inner: vec![circle([0.3, 0.3], [0.1, 0.2]), polygon(&[[0.6, 0.6], [0.9, 0.6], [0.6, 0.9]])] };
    let mesh = drawn(plane(10.0, trim), 0.001);
    assert_eq!(topology(&mesh), (-1, 3, 1));
    assert!((area(&mesh) - (100.0 - PI * 2.0 - 4.5)).abs() < 0.05);
    // Nothing is cut: the surface as it is.
    let mesh = drawn(plane(10.0, Trim::default()), 0.001);
    assert_eq!((topology(&mesh), mesh.triangles.len()), ((1, 1, 1), 2));
}

#[test]
fn zones_of_the_sphere_have_archimedes_area() {
    // u runs along a half circle of two quarters from the south pole: u = 1/4 at 45 degrees south.
    for (low, high, exact, euler, loops) in [
        (0.0, 0.25, 2.0 * PI * 10.0 * (10.0 - 10.0 / SQRT_2), 1, 1),
        (0.25, 0.75, 2.0 * PI * 10.0 * 20.0 / SQRT_2, 0, 2),
        (0.25, 1.0, 2.0 * PI * 10.0 * (10.0 + 10.0 / SQRT_2), 1, 1),
        (0.0, 1.0, 4.0 * PI * 100.0, 2, 0),
    ] {
        let trim = Trim { outer: Some(polygon(&[[low, 0.0], [high, 0.0], [high, 1.0], [low, 1.0]])), inner: Vec::new() };
        for tolerance in [0.3, 0.01] {
            let mesh = drawn(sphere(10.0, Some(trim.clone())), tolerance);
            assert_eq!(topology(&mesh), (euler, loops, 1), "{low} {high} {tolerance}");
            // A mesh inscribed to the tolerance: its facets are chords of the sphere, of relative area 1 - O(tolerance / R).
            assert!((area(&mesh) / exact - 1.0).abs() < 1.5 * tolerance / 10.0, "{low} {high}: {} is not {exact}", area(&mesh));
            assert!(mesh.vertices.iter().all(|x| (x.length() - 10.0).abs() < 1e-9));
        }
    }
}

#[test]
fn a_cylinder_with_windows_is_closed_along_its_seam() {
    let round = cylinder(5.0, 20.0, Some(Trim { outer: None, inner: vec![circle([0.5, 0.5], [0.2, 0.2])] }));
    let mesh = drawn(round, 0.01);
    assert_eq!(topology(&mesh), (-1, 3, 1));
    assert!(mesh.vertices.iter().all(|x| (x.truncate().length() - 5.0).abs() < 1e-9));
    // A window across the seam: a notch in both sides of the domain.
    let notched = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.9], [0.4, 0.9], [0.6, 0.9], [1.0, 0.9]];
    assert!(lower(cylinder(5.0, 20.0, Some(Trim { outer: Some(polygon(&notched)), inner: Vec::new() }))).is_err());
    let notched = [
        [0.0, 0.0],
        [0.3, 0.0],
        [0.3, 0.1],
        [0.7, 0.1],
        [0.7, 0.0],
        [1.0, 0.0],
        [1.0, 1.0],
        [0.7, 1.0],
        [0.7, 0.87],
        [0.3, 0.87],
        [0.3, 1.0],
        [0.0, 1.0],
    ];
    let mesh = drawn(cylinder(5.0, 20.0, Some(Trim { outer: Some(polygon(&notched)), inner: Vec::new() })), 0.01);
    assert_eq!(topology(&mesh), (-1, 3, 1));
    let whole = drawn(cylinder(5.0, 20.0, Some(Trim::default())), 0.01);
    assert_eq!(topology(&whole), (0, 2, 1));
    assert!((area(&whole) - 2.0 * PI * 5.0 * 20.0).abs() < 1.0);
}

/// A small generator of uniform numbers in [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// The point of a bicubic Bezier patch.
fn bicubic(points: &[DVec3], u: f64, v: f64) -> DVec3 {
    let b = |t: f64| [(1.0 - t).powi(3), 3.0 * t * (1.0 - t).powi(2), 3.0 * t * t * (1.0 - t), t.powi(3)];
    (0..16).map(|k| b(u)[k / 4] * b(v)[k % 4] * points[k]).sum()
}

fn distance(mesh: &Tessellation, x: DVec3) -> f64 {
    let corner = |k: u32| mesh.vertices[k as usize].to_array();
    let to = |[a, b, c]: &[u32; 3]| {
        let near = lacuna_kernel::measure::triangle::closest_on_triangle(&x.to_array(), &corner(*a), &corner(*b), &corner(*c));
        x.distance(near.into())
    };
    mesh.triangles.iter().map(to).fold(f64::INFINITY, f64::min)
}

#[test]
fn random_patches_with_random_loops_are_within_their_bound_on_both_sides() {
    let mut random = Random(7);
    for round in 0..12 {
        let points: Vec<DVec3> =
            (0..16).map(|k| DVec3::new((k / 4) as f64 + random.next(), (k % 4) as f64 + random.next(), 2.0 * random.next())).collect();
        // An ellipse and a hole of an ellipse in it, in a random place.
        let outer = ([0.45 + 0.1 * random.next(), 0.45 + 0.1 * random.next()], [0.3 + 0.1 * random.next(), 0.25 + 0.15 * random.next()]);
        let inner = ([outer.0[0] + 0.1 * random.next(), outer.0[1]], [0.1 * random.next() + 0.01, 0.1]);
        let trim = Trim { outer: Some(circle(outer.0, outer.1)), inner: vec![circle(inner.0, inner.1)] };
        let tolerance = [0.3, 0.1, 0.03][round % 3];
        let mesh = drawn(bezier([4, 4], points.clone(), trim.clone()), tolerance);
        assert_eq!(topology(&mesh), (0, 2, 1), "{round}");
        let within = |u: f64, v: f64, (c, r): ([f64; 2], [f64; 2])| ((u - c[0]) / r[0]).powi(2) + ((v - c[1]) / r[1]).powi(2) <= 1.0;
        // Points of the surface are near the mesh.
        let mut seen = Vec::new();
        for _ in 0..400 {
            let (u, v) = (random.next(), random.next());
            if within(u, v, outer) && !within(u, v, inner) {
                let x = bicubic(&points, u, v);
                seen.push(x);
                let off = distance(&mesh, x);
                assert!(
                    off <= mesh.deviation_mm * (1.0 + 1e-9),
                    "{round}: ({u}, {v}) is {off} away, and the bound is {}",
                    mesh.deviation_mm
                );
            }
        }
        assert!(seen.len() > 50);
        // Points of the mesh are near the surface: dense samples, refined near the best.
        let corner = |k: u32| mesh.vertices[k as usize];
        for k in 0..60 {
            let [a, b, c] = mesh.triangles[(random.next() * mesh.triangles.len() as f64) as usize].map(corner);
            let (s, t) = (random.next(), random.next());
            let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
            let x = a + s * (b - a) + t * (c - a);
            let (mut best, mut at, mut step) = (f64::INFINITY, (0.5, 0.5), 1.0 / 64.0);
            for level in 0..6 {
                let centre = at;
                for i in -32..=32 {
                    for j in -32..=32 {
                        let (u, v) = (centre.0 + f64::from(i) * step, centre.1 + f64::from(j) * step);
                        if within(u, v, outer) && (!within(u, v, inner)) {
                            let off = bicubic(&points, u, v).distance(x);
                            if off < best {
                                (best, at) = (off, (u, v));
                            }
                        }
                    }
                }
                step *= if level == 0 { 0.125 } else { 0.25 };
            }
            assert!(best <= mesh.deviation_mm + 0.001, "{round} {k}: {best} away, and the bound is {}", mesh.deviation_mm);
        }
    }
}

fn faults(shape: Shape) -> Vec<(String, &'static str)> {
    match lower(shape) {
        Ok(_) => Vec::new(),
        Err(findings) => findings.into_iter().map(|finding| (finding.pointer, finding.code)).collect(),
    }
}

#[test]
fn loops_that_bound_nothing_are_refused_by_name() {
    let line = |points: &[[f64; 2]]| vec![TrimCurve::Polyline(points.iter().map(|&p| p.into()).collect())];
    let square = [[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9]];
    let with = |outer: Vec<TrimCurve>| Trim { outer: Some(outer), inner: Vec::new() };
    let hole = |inner: Vec<TrimCurve>| Trim { outer: Some(polygon(&square)), inner: vec![inner] };
    let spline = |points: &[[f64; 2]], weights: Option<Vec<f64>>| TrimCurve::Spline {
        scheme: CurveScheme::Bezier,
        control_points: points.iter().map(|&p| p.into()).collect(),
        weights,
    };
    let cases: Vec<(Trim, &str, &str)> = vec![
        (with(line(&square)), "/trim/outer/0", "trim.open"),
        (with(line(&[[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.1 + 2e-6]])), "/trim/outer/0", "trim.open"),
        (with(Vec::new()), "/trim/outer", "trim.empty"),
        (with(line(&[[0.5, 0.5], [0.5, 0.5]])), "/trim/outer", "trim.empty"),
        (with(line(&[[0.5, 0.5]])), "/trim/outer/0/points", "trim.points"),
        (with(line(&[[0.1, 0.1], [0.9, 0.1], [0.1, 0.1]])), "/trim/outer/0", "trim.cusp"),
        (with(line(&[[0.1, 0.1], [f64::NAN, 0.1], [0.5, 0.5], [0.1, 0.1]])), "/trim/outer/0/points/1", "model.not-finite"),
        (with(line(&[[0.1, 0.1], [1e300, 0.1], [0.5, 0.5], [0.1, 0.1]])), "/trim/outer/0/points/1", "model.not-finite"),
        (with(polygon(&[[0.1, 0.1], [1.1, 0.1], [0.5, 0.5]])), "/trim/outer/0", "trim.outside"),
        (with(circle([0.5, 0.5], [0.51, 0.4])), "/trim/outer/0", "trim.outside"),
        // A figure of eight, one that only touches itself, and a curl of one Bezier curve.
        (with(polygon(&[[0.1, 0.1], [0.9, 0.9], [0.9, 0.1], [0.1, 0.9]])), "/trim/outer/0", "trim.crossing"),
        (with(polygon(&[[0.1, 0.1], [0.5, 0.5], [0.9, 0.1], [0.9, 0.9], [0.5, 0.5], [0.1, 0.9]])), "/trim/outer/0", "trim.crossing"),
        (
            with(vec![
                spline(&[[0.1, 0.1], [1.5, 0.9], [-0.5, 0.9], [0.9, 0.1]], None),
                TrimCurve::Polyline(vec![DVec2::new(0.9, 0.1), DVec2::new(0.1, 0.1)]),
            ]),
            "/trim/outer/0",
            "trim.crossing",
        ),
        (hole(circle([0.5, 0.85], [0.1, 0.1])), "/trim/inner/0/0", "trim.crossing"),
        // Touching from inside, in one point and along a line.
        (hole(circle([0.5, 0.5], [0.4, 0.2])), "/trim/inner/0/0", "trim.crossing"),
        (hole(polygon(&[[0.1, 0.3], [0.5, 0.3], [0.5, 0.6], [0.1, 0.6]])), "/trim/inner/0/0", "trim.crossing"),
        (Trim { outer: None, inner: vec![polygon(&[[0.0, 0.3], [0.5, 0.3], [0.5, 0.6]])] }, "/trim/inner/0/0", "trim.crossing"),
        (
            Trim { outer: Some(circle([0.3, 0.3], [0.2, 0.2])), inner: vec![circle([0.7, 0.7], [0.1, 0.1])] },
            "/trim/inner/0",
            "trim.nesting",
        ),
        (
            Trim { outer: None, inner: vec![circle([0.5, 0.5], [0.3, 0.3]), circle([0.5, 0.5], [0.1, 0.1])] },
            "/trim/inner/1",
            "trim.nesting",
        ),
        (with(vec![spline(&[[0.1, 0.1], [0.9, 0.1], [0.1, 0.1]], Some(vec![1.0, 0.0, 1.0]))]), "/trim/outer/0/weights/1", "net.weights"),
        (with(vec![spline(&[[0.1, 0.1], [0.9, 0.1], [0.1, 0.1]], Some(vec![1.0]))]), "/trim/outer/0/weights", "net.weights"),
    ];
    for (trim, pointer, code) in cases {
        let found = faults(plane(1.0, trim.clone()));
        assert!(found.iter().any(|fault| fault == &(pointer.to_owned(), code)), "{trim:?}: {found:?} is not {pointer} {code}");
    }
}

#[test]
fn the_same_curve_twice_ends_in_a_refusal() {
    let wave = |shift: f64| {
        let points = [[0.1, 0.5 + shift], [0.3, 1.0], [0.6, 0.0], [0.9, 0.5 + shift]];
        TrimCurve::Spline { scheme: CurveScheme::Bezier, control_points: points.map(DVec2::from).to_vec(), weights: None }
    };
    let mut back = wave(0.0);
    if let TrimCurve::Spline { control_points, .. } = &mut back {
        control_points.reverse();
    }
    let found = faults(plane(1.0, Trim { outer: Some(vec![wave(0.0), back]), inner: Vec::new() }));
    assert!(found.iter().any(|(_, code)| ["trim.cusp", "trim.crossing"].contains(code)), "{found:?}");
}

#[test]
fn loops_may_touch_the_border_and_be_thinner_than_the_tolerance() {
    // A circle tangent to the border from inside, on a square and on a curved patch.
    let mesh = drawn(plane(10.0, Trim { outer: Some(circle([0.5, 0.5], [0.5, 0.5])), inner: Vec::new() }), 0.01);
    assert_eq!(topology(&mesh), (1, 1, 1));
    assert!((area(&mesh) - PI * 25.0).abs() < 0.3);
    // A slit of 1e-7 in a square of 10 mm, at a tolerance of 0.1 mm.
    let slit = polygon(&[[0.2, 0.2], [0.8, 0.7], [0.8, 0.7 + 1e-8], [0.2, 0.2 + 1e-8]]);
    let mesh = drawn(plane(10.0, Trim { outer: None, inner: vec![slit] }), 0.1);
    assert_eq!(topology(&mesh), (0, 2, 1));
    // What is left is thinner than the tolerance.
    let sliver = polygon(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1e-7], [0.0, 1e-7]]);
    let mesh = drawn(sphere(10.0, Some(Trim { outer: Some(sliver), inner: Vec::new() })), 0.5);
    assert_eq!(topology(&mesh), (1, 1, 1));
    // Gaps below the stated one are closed, and charged.
    let gap = vec![TrimCurve::Polyline([[0.1, 0.1], [0.9, 0.1], [0.5, 0.9], [0.1, 0.1 + 5e-7]].map(DVec2::from).to_vec())];
    let mesh = drawn(plane(10.0, Trim { outer: Some(gap), inner: Vec::new() }), 0.1);
    assert!(topology(&mesh) == (1, 1, 1) && mesh.deviation_mm >= 5e-6);
}

#[test]
fn a_hundred_thousand_trim_curves_are_drawn_in_time() {
    let count = 100_000;
    let tooth = |k: usize| {
        let angle = 2.0 * PI * k as f64 / f64::from(count);
        let radius = if k.is_multiple_of(2) { 0.45 } else { 0.449 };
        DVec2::new(0.5 + radius * angle.cos(), 0.5 + radius * angle.sin())
    };
    let curves = (0..count as usize).map(|k| TrimCurve::Polyline(vec![tooth(k), tooth((k + 1) % count as usize)])).collect();
    let mesh = drawn(sphere(10.0, Some(Trim { outer: Some(curves), inner: Vec::new() })), 0.1);
    assert_eq!(topology(&mesh), (1, 1, 1));
    assert!(mesh.complex.unwrap().boundary_edges >= u64::from(count as u32));
    // A thousand holes.
    let holes = (0..1000).map(|k| circle([0.02 + 0.03 * f64::from(k % 32), 0.02 + 0.03 * f64::from(k / 32)], [0.01, 0.012])).collect();
    let mesh = drawn(cylinder(5.0, 20.0, Some(Trim { outer: None, inner: holes })), 0.05);
    assert_eq!(topology(&mesh), (-1000, 1002, 1));
}

#[test]
fn a_trimmed_part_moves_with_its_group_and_stands_beside_others() {
    let trim = Trim { outer: None, inner: vec![circle([0.5, 0.5], [0.2, 0.2])] };
    let moved = lacuna_kernel::model::AffineMap { linear: glam::DMat3::from_rotation_x(1.0), translation: DVec3::new(0.0, 0.0, 50.0) };
    let part = |shape: Shape, transform| Part { name: None, transform, shape, radius: None };
    let group = Shape::Group(Group { parts: vec![part(sphere(3.0, None), None), part(plane(10.0, trim), Some(moved))], joins: Vec::new() });
    let mesh = drawn(group, 0.01);
    let complex = mesh.complex.as_ref().unwrap();
    assert_eq!((complex.euler, complex.boundary_loops, complex.components), (2, 2, 2));
    assert_eq!(complex.drawn_vertices(), mesh.vertices.len() as u64);
    let normal = moved.linear * DVec3::Z;
    let far = mesh.vertices.iter().filter(|x| x.length() > 4.0);
    assert!(far.clone().count() > 8 && far.clone().all(|x| (*x - moved.translation).dot(normal).abs() < 1e-9));
    // Every vertex and triangle has an address.
    assert!((0..mesh.vertices.len()).all(|vertex| complex.vertex_address(vertex).is_some()));
    assert!((0..mesh.triangles.len()).all(|triangle| complex.triangle_address(triangle).is_some()));
}

#[test]
fn the_box_is_that_of_what_is_kept() {
    let bounds = |shape: Shape| lacuna_kernel::measure::bounding_box(&lower(shape).unwrap().attractor, &Budget::default()).unwrap();
    let trim = Trim { outer: Some(circle([0.5, 0.4], [0.3, 0.2])), inner: vec![circle([0.5, 0.4], [0.1, 0.1])] };
    let found = bounds(plane(10.0, trim));
    for (interval, exact) in [(found.low[0], 2.0), (found.high[0], 8.0), (found.low[1], 2.0), (found.high[1], 6.0)] {
        assert!(interval.low <= exact + 1e-12 && exact - 1e-12 <= interval.high && interval.width() < 1e-9, "{interval:?} {exact}");
    }
    let cap = Trim { outer: Some(polygon(&[[0.0, 0.0], [0.25, 0.0], [0.25, 1.0], [0.0, 1.0]])), inner: Vec::new() };
    let found = bounds(sphere(10.0, Some(cap)));
    let rim = 10.0 / SQRT_2;
    // The whole rim is the highest place.
    for (interval, exact) in [(found.low[0], -rim), (found.high[1], rim), (found.low[2], -10.0), (found.high[2], -rim)] {
        assert!(interval.low <= exact + 1e-9 && exact - 1e-9 <= interval.high && interval.width() < 1e-9, "{interval:?} {exact}");
    }
}

#[test]
fn a_thick_annulus_has_its_volume() {
    use lacuna_kernel::tolerance::Radius;
    let trim = Trim { outer: Some(circle([0.5, 0.5], [0.4, 0.4])), inner: vec![circle([0.5, 0.5], [0.2, 0.2])] };
    let lowered = lower(plane(20.0, trim)).unwrap();
    let (radius, tolerance) = (Radius::new(1.0).unwrap(), Tolerance::new(0.1).unwrap());
    let dilation = lacuna_kernel::dilation::dilate(&lowered.attractor, radius, tolerance, &Budget::default()).unwrap();
    assert!(dilation.inner_mm.max(dilation.outer_mm) <= 0.1);
    // Steiner: the annulus of radii 4 and 8, and Pappus: half discs of radius r around both rims, with their centroids
    // 4 r / (3 pi) outside the rim circles.
    let volume = |r: f64| {
        let slab = 2.0 * r * PI * (64.0 - 16.0);
        let half = PI * r * r / 2.0;
        let centroid = 4.0 * r / (3.0 * PI);
        slab + half * 2.0 * PI * (8.0 + centroid) + half * 2.0 * PI * (4.0 - centroid)
    };
    let mesh = dilation.solid.mesh();
    let corner = |k: u32| mesh.vertices[k as usize];
    let found: f64 = mesh.triangles.iter().map(|&[a, b, c]| corner(a).dot(corner(b).cross(corner(c))) / 6.0).sum();
    assert!(volume(1.0 - dilation.inner_mm) <= found && found <= volume(1.0 + dilation.outer_mm), "{found} {}", volume(1.0));
    let topology = dilation.solid.topology();
    assert_eq!(topology.euler, 0, "a torus");
}

#[test]
fn nothing_trimmed_is_the_surface_itself_on_any_knots() {
    let mut random = Random(11);
    let mut knots = |degree: usize, count: usize| {
        let mut x = -3.0;
        let mut list = Vec::new();
        while list.len() < count + degree + 1 {
            // Simple and double knots at random distances.
            x += 0.2 + random.next();
            list.push(x);
            if degree > 1 && random.next() < 0.3 {
                list.push(x);
            }
        }
        list.truncate(count + degree + 1);
        list
    };
    for (degree, count) in [([3, 2], [6, 5]), ([2, 4], [4, 7]), ([1, 3], [3, 5])] {
        let schemes = [0, 1].map(|k| CurveScheme::Nurbs { degree: degree[k], knots: knots(degree[k], count[k]) });
        let mut random = Random(5);
        let points = (0..count[0] * count[1]).map(|k| DVec3::new((k / count[1]) as f64, (k % count[1]) as f64, random.next())).collect();
        let weights = Some((0..count[0] * count[1]).map(|_| 0.5 + random.next()).collect());
        let surface = |trim| {
            let control_points = ControlNet { size: count.to_vec(), points, weights };
            Shape::TensorProduct(TensorProduct { schemes: schemes.to_vec(), control_points, separate: false, trim })
        };
        let (whole, own) = {
            let shape = surface(Some(Trim::default()));
            let Shape::TensorProduct(product) = &shape else { panic!("a product") };
            let plain = Shape::TensorProduct(TensorProduct { trim: None, ..product.clone() });
            (drawn(plain, 0.02), drawn(shape, 0.02))
        };
        assert_eq!(topology(&own), (1, 1, 1), "{degree:?}");
        let bound = whole.deviation_mm + own.deviation_mm;
        assert!(own.vertices.iter().step_by(7).all(|&x| distance(&whole, x) <= bound), "{degree:?}");
        assert!(whole.vertices.iter().step_by(7).all(|&x| distance(&own, x) <= bound), "{degree:?}");
    }
}
