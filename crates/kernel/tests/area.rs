//! Areas of smooth surfaces: closed forms, quadrature of high order, and finer and finer polyhedra.

use crate::cages;
use glam::{DQuat, DVec3};
use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::budget::{Budget, CancelToken, Limits, StopReason};
use lacuna_kernel::measure::{Interval, surface_area};
use lacuna_kernel::model::{BoundaryRule, ControlNet, Crease, CurveScheme, Model, Scheme, Shape, TensorProduct};
use std::f64::consts::{FRAC_1_SQRT_2, PI};

fn area(attractor: &Attractor) -> Interval {
    surface_area(attractor, &Budget::default()).unwrap().unwrap()
}

#[track_caller]
fn assert_holds(found: Interval, exact: f64, width: f64) {
    assert!(found.low <= exact * (1.0 + 1e-15) && exact * (1.0 - 1e-15) <= found.high, "{exact} is not in {found:?}");
    assert!(found.width() <= width * exact, "{found:?} is {:e} wide", found.width() / exact);
}

fn product(schemes: [CurveScheme; 2], size: [usize; 2], points: Vec<DVec3>, weights: Option<Vec<f64>>) -> Attractor {
    let control_points = ControlNet { size: size.to_vec(), points, weights };
    let product = TensorProduct { schemes: schemes.to_vec(), control_points, separate: false, trim: None };
    Model { name: None, shape: Shape::TensorProduct(product) }.lower().unwrap_or_else(|findings| panic!("{findings:?}")).attractor
}

fn bezier(degrees: [usize; 2], points: Vec<DVec3>, weights: Option<Vec<f64>>) -> Attractor {
    product([CurveScheme::Bezier, CurveScheme::Bezier], degrees.map(|degree| degree + 1), points, weights)
}

/// Points, weights and knots of so many quarters of the unit circle.
fn circle(quarters: usize) -> (Vec<[f64; 2]>, Vec<f64>, CurveScheme) {
    let corner = [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [-1.0, 1.0], [-1.0, 0.0], [-1.0, -1.0], [0.0, -1.0], [1.0, -1.0]];
    let count = 2 * quarters + 1;
    let points = (0..count).map(|k| corner[k % 8]).collect();
    let weights = (0..count).map(|k| if k % 2 == 0 { 1.0 } else { FRAC_1_SQRT_2 }).collect();
    let mut knots = vec![0.0];
    (0..=quarters).for_each(|knot| knots.extend([knot as f64; 2]));
    knots.push(quarters as f64);
    (points, weights, CurveScheme::Nurbs { degree: 2, knots })
}

/// A curve (radius, height) turned about the third axis.
fn turned(profile: &[[f64; 2]], weights: &[f64], scheme: CurveScheme) -> Attractor {
    let (round, round_weights, circle) = circle(4);
    let net = profile.iter().flat_map(|[r, z]| round.iter().map(move |[x, y]| DVec3::new(r * x, r * y, *z)));
    let weights = weights.iter().flat_map(|a| round_weights.iter().map(move |b| a * b)).collect();
    product([scheme, circle], [profile.len(), round.len()], net.collect(), Some(weights))
}

#[test]
fn surfaces_of_revolution() {
    let (points, weights, scheme) = circle(4);
    let tube: Vec<[f64; 2]> = points.iter().map(|[x, y]| [10.0 + 3.0 * x, 3.0 * y]).collect();
    assert_holds(area(&turned(&tube, &weights, scheme)), 4.0 * PI * PI * 30.0, 1.1e-5);
    // From pole to pole.
    let (points, weights, scheme) = circle(2);
    let half: Vec<[f64; 2]> = points.iter().map(|[x, y]| [2.0 * y, -2.0 * x]).collect();
    assert_holds(area(&turned(&half, &weights, scheme)), 16.0 * PI, 1.1e-5);
    let line = || CurveScheme::Nurbs { degree: 1, knots: vec![0.0, 0.0, 1.0, 1.0] };
    assert_holds(area(&turned(&[[2.0, 0.0], [2.0, 5.0]], &[1.0, 1.0], line())), 20.0 * PI, 1.1e-5);
    // A cone to its tip, and a disc.
    assert_holds(area(&turned(&[[3.0, 0.0], [0.0, 4.0]], &[1.0, 1.0], line())), 15.0 * PI, 1.1e-5);
    assert_holds(area(&turned(&[[3.0, 1.0], [0.0, 1.0]], &[1.0, 1.0], line())), 9.0 * PI, 1.1e-5);
}

/// In a plane with one orientation all normals point the same way: both bounds are the area, but for rounding. Points of the inside may lie anywhere.
#[test]
fn flat_patches_are_exact() {
    let turn = DQuat::from_rotation_x(1.0) * DQuat::from_rotation_y(0.5);
    let (columns, rows) = ([0.0, 0.2, 0.25, 1.0], [0.0, 0.9, 1.0]);
    let place = |k: usize| {
        let inner = if k == 4 || k == 7 { DVec3::new(0.1, -0.2, 0.0) } else { DVec3::ZERO };
        turn * (DVec3::new(columns[k / 3], rows[k % 3], 0.0) + inner) * 7.0 + DVec3::new(100.0, -200.0, 50.0)
    };
    assert_holds(area(&bezier([3, 2], (0..12).map(place).collect(), None)), 49.0, 1e-11);
    // Weights move points along the square, which stays the same.
    let weights = [1.0, 2.0, 3.0].iter().flat_map(|a| [0.5, 1.0, 0.75].map(|b| a * b)).collect();
    let points = (0..9).map(|k| DVec3::new((k / 3) as f64, (k % 3) as f64, 1e3)).collect();
    assert_holds(area(&bezier([2, 2], points, Some(weights))), 4.0, 1.1e-5);
}

/// Nodes and weights on [0, 1], by Newton's method on Legendre's polynomial.
fn gauss(count: usize) -> Vec<(f64, f64)> {
    let legendre = |x: f64| {
        let (mut before, mut value) = (1.0, x);
        for n in 2..=count {
            (before, value) = (value, ((2 * n - 1) as f64 * x * value - (n - 1) as f64 * before) / n as f64);
        }
        (value, count as f64 * (x * value - before) / (x * x - 1.0))
    };
    let node = |k: usize| {
        let mut x = (PI * (k as f64 + 0.75) / (count as f64 + 0.5)).cos();
        for _ in 0..20 {
            let (value, slope) = legendre(x);
            x -= value / slope;
        }
        let slope = legendre(x).1;
        (0.5 + 0.5 * x, 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..count).map(node).collect()
}

/// The integral over the unit square, by so many panels in each direction.
fn integral(panels: usize, nodes: &[(f64, f64)], f: &dyn Fn(f64, f64) -> f64) -> f64 {
    let step = 1.0 / panels as f64;
    let line = || (0..panels).flat_map(|panel| nodes.iter().map(move |&(x, w)| ((panel as f64 + x) * step, w * step)));
    line().map(|(u, a)| line().map(|(v, b)| a * b * f(u, v)).sum::<f64>()).sum()
}

#[test]
fn saddles() {
    let corners = |a: f64, b: f64, h: f64| vec![DVec3::ZERO, DVec3::new(0.0, b, 0.0), DVec3::new(a, 0.0, 0.0), DVec3::new(a, b, h)];
    let nodes = gauss(20);
    for [a, b, h] in [[1.0_f64, 1.0, 1.0], [2.0, 1.0, 5.0], [1.0, 3.0, -0.25]] {
        // (a u, b v, h u v).
        let density = |u: f64, v: f64| ((a * b).powi(2) + (h * b * v).powi(2) + (h * a * u).powi(2)).sqrt();
        assert_holds(area(&bezier([1, 1], corners(a, b, h), None)), integral(4, &nodes, &density), 1.1e-5);
    }
    // z = x y over the unit square: 4/3 ln((1 + sqrt 3) / sqrt 2) + sqrt 3 / 3 - pi / 18, the potential of a square plate at one of its corners, a unit above it, twice integrated.
    let closed = 4.0 / 3.0 * ((1.0 + 3.0_f64.sqrt()) / 2.0_f64.sqrt()).ln() + 3.0_f64.sqrt() / 3.0 - PI / 18.0;
    assert_holds(area(&bezier([1, 1], corners(1.0, 1.0, 1.0), None)), closed, 1.1e-5);
}

/// Numbers in [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Bernstein polynomials of a degree, and their derivatives.
fn bernstein(degree: usize, x: f64) -> Vec<(f64, f64)> {
    let all = |degree: usize| {
        let mut values = vec![1.0];
        for _ in 0..degree {
            let from = |k: usize| values.get(k).copied().unwrap_or(0.0);
            let next = (0..=values.len()).map(|k| (1.0 - x) * from(k) + if k > 0 { x * from(k - 1) } else { 0.0 }).collect();
            values = next;
        }
        values
    };
    let (values, below) = (all(degree), all(degree - 1));
    let slope = |k: usize| {
        let at = |k: Option<usize>| k.and_then(|k| below.get(k)).copied().unwrap_or(0.0);
        degree as f64 * (at(k.checked_sub(1)) - at(Some(k)))
    };
    (0..=degree).map(|k| (values[k], slope(k))).collect()
}

/// |S_u x S_v|.
fn density([p, q]: [usize; 2], points: &[DVec3], weights: &[f64], u: f64, v: f64) -> f64 {
    let (along, across) = (bernstein(p, u), bernstein(q, v));
    let (mut place, mut weight) = ([DVec3::ZERO; 3], [0.0; 3]);
    for (i, a) in along.iter().enumerate() {
        for (j, b) in across.iter().enumerate() {
            let (point, w) = (points[i * (q + 1) + j], weights[i * (q + 1) + j]);
            for (k, share) in [a.0 * b.0, a.1 * b.0, a.0 * b.1].into_iter().enumerate() {
                place[k] += w * share * point;
                weight[k] += w * share;
            }
        }
    }
    let slope = |k: usize| (place[k] - place[0] * (weight[k] / weight[0])) / weight[0];
    slope(1).cross(slope(2)).length()
}

/// Random patches, flat and wild ones, against quadrature, whose error two numbers of panels tell.
#[test]
fn random_patches_against_quadrature() {
    let (mut random, nodes) = (Random(5), gauss(8));
    let (mut narrow, mut count) = (0, 0);
    for round in 0..72 {
        let degrees = [1 + round % 3, 1 + round / 3 % 3];
        let size = (degrees[0] + 1) * (degrees[1] + 1);
        let spread = [0.05, 0.4, 3.0][round / 9 % 3];
        let shift = DVec3::splat([0.0, 1e4][round / 2 % 2]);
        let points: Vec<DVec3> = (0..size)
            .map(|k| {
                let (i, j) = (k / (degrees[1] + 1), k % (degrees[1] + 1));
                let noise = DVec3::new(random.next(), random.next(), random.next()) - 0.5;
                DVec3::new(i as f64, j as f64, 0.0) + spread * noise + shift
            })
            .collect();
        let rational = round % 2 == 1;
        let weights: Vec<f64> = (0..size).map(|_| if rational { 0.25 * 16.0_f64.powf(random.next()) } else { 1.0 }).collect();
        let patch = bezier(degrees, points.clone(), rational.then(|| weights.clone()));
        let budget = Budget { limits: Limits { cells: 4000, ..Limits::default() }, ..Budget::default() };
        let found = surface_area(&patch, &budget).unwrap().unwrap();
        let near: Vec<DVec3> = points.iter().map(|point| *point - shift).collect();
        let f = |u: f64, v: f64| density(degrees, &near, &weights, u, v);
        let (coarse, fine) = (integral(12, &nodes, &f), integral(24, &nodes, &f));
        let off = (fine - coarse).abs() + 1e-11 * fine;
        assert!(found.low - off <= fine && fine <= found.high + off, "{round}: {fine} +- {off:e} is not in {found:?}");
        assert!(found.width() <= 2e-3 * fine, "{round}: {found:?}");
        narrow += usize::from(off + found.width() <= 1e-4 * fine);
        count += 1;
    }
    // A bound that says nothing would pass, and so would an oracle that knows nothing.
    assert!(3 * narrow >= 2 * count, "{narrow} of {count}");
}

/// Areas of polyhedra of triangles at the corners of all patches, extrapolated from three depths.
fn extrapolated(attractor: &Attractor, depth: usize) -> f64 {
    let at = |depth: usize| -> f64 {
        let triangle = |a: DVec3, b: DVec3, c: DVec3| 0.5 * (b - a).cross(c - a).length();
        let patch = |p: &Vec<DVec3>| match p.as_slice() {
            [a, b, c, d] => 0.5 * (triangle(*a, *b, *c) + triangle(*a, *c, *d) + triangle(*a, *b, *d) + triangle(*b, *c, *d)),
            _ => panic!("quads"),
        };
        cages::patches(attractor, depth).iter().map(patch).sum()
    };
    let (a, b, c) = (at(depth - 2), at(depth - 1), at(depth));
    let (d, e) = ((4.0 * b - a) / 3.0, (4.0 * c - b) / 3.0);
    (16.0 * e - d) / 15.0
}

#[test]
fn subdivision_surfaces_against_polyhedra() {
    let mut sharp = cages::grid(Scheme::CatmullClark, 3, 4, |x, y| (x * y).sin());
    sharp.boundary = BoundaryRule::SharpCorners;
    let mut creased = cages::cube(Scheme::CatmullClark);
    creased.creases = vec![Crease { edge: [0, 1], sharpness: 1.5 }, Crease { edge: [1, 3], sharpness: 10.0 }];
    let cases = [
        cages::cube(Scheme::CatmullClark),
        cages::torus(Scheme::CatmullClark, 6, 7),
        cages::torus(Scheme::DooSabin, 5, 6),
        cages::cube(Scheme::DooSabin),
        cages::grid(Scheme::CatmullClark, 3, 2, |x, y| x * y),
        sharp,
        creased,
    ];
    for (index, surface) in cases.into_iter().enumerate() {
        let attractor = cages::attractor(surface);
        let found = surface_area(&attractor, &Budget::default()).unwrap().unwrap_or_else(|| panic!("case {index}"));
        assert!(found.width() <= 1.1e-5 * found.high, "{index}: {found:?}");
        let [coarse, fine] = [5, 6].map(|depth| extrapolated(&attractor, depth));
        let off = 2.0 * (fine - coarse).abs() + 1e-9 * fine;
        assert!(found.low - off <= fine && fine <= found.high + off, "{index}: {fine} +- {off:e} is not in {found:?}");
        assert!(off <= 1e-4 * fine, "{index}: {off:e} of {fine}");
    }
}

/// As a product of closed curves, and as a mesh.
#[test]
fn a_torus_of_splines_is_one_however_it_is_written() {
    let points = cages::torus(Scheme::DooSabin, 5, 6).vertices;
    let chaikin = || CurveScheme::CornerCutting { a: 0.25, b: 0.25, closed: true };
    let (product, mesh) =
        (area(&product([chaikin(), chaikin()], [5, 6], points, None)), area(&cages::attractor(cages::torus(Scheme::DooSabin, 5, 6))));
    assert!(product.low <= mesh.high && mesh.low <= product.high, "{product:?} {mesh:?}");
}

#[test]
fn what_has_no_bezier_points_has_no_area_here() {
    let none = |attractor: &Attractor| surface_area(attractor, &Budget::default()).unwrap().is_none();
    assert!(none(&cages::attractor(cages::cube(Scheme::Loop))));
    let points: Vec<DVec3> = cages::torus(Scheme::DooSabin, 5, 6).vertices;
    let rough = CurveScheme::CornerCutting { a: 0.35, b: 0.1, closed: true };
    let smooth = CurveScheme::CornerCutting { a: 0.25, b: 0.25, closed: true };
    assert!(none(&product([rough, smooth], [5, 6], points, None)));
}

#[test]
fn limits_and_threads() {
    let attractor = cages::attractor(cages::head());
    let cancel = CancelToken::new();
    cancel.fire(StopReason::Cancelled);
    assert!(surface_area(&attractor, &Budget { cancel, ..Budget::default() }).is_err());
    let all = area(&attractor);
    let few = Budget { limits: Limits { cells: 500, ..Limits::default() }, ..Budget::default() };
    let few = surface_area(&attractor, &few).unwrap().unwrap();
    assert!(few.low <= all.low && all.high <= few.high && few.width() > 10.0 * all.width(), "{few:?} {all:?}");
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let three = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    assert_eq!(alone.install(|| area(&attractor)), three.install(|| area(&attractor)));
}
