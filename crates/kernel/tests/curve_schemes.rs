//! Schemes of curves against their defining properties, and what they refuse. Expected values are closed forms.

use crate::agreement::agreed;
use crate::schemes::*;
use glam::{DMat3, DVec3};
use lacuna_kernel::model::{AffineMap, ControlNet, Curve, CurveScheme, Model, Parametrization, Shape, Sum};

fn near(scheme: CurveScheme, points: Vec<DVec3>, tolerance: f64) -> Vec<DVec3> {
    evaluated(&lower(curve(scheme, points, None)).attractor, tolerance).vertices
}

fn distance(vertices: &[DVec3], point: DVec3) -> f64 {
    vertices.iter().map(|vertex| vertex.distance(point)).fold(f64::INFINITY, f64::min)
}

#[test]
fn catmull_rom_goes_through_its_points_and_follows_its_matrix() {
    let points = Random(3).points(9);
    for parametrization in [Parametrization::Uniform, Parametrization::Centripetal, Parametrization::Chordal] {
        let open = near(CurveScheme::CatmullRom { parametrization, closed: false }, points.clone(), 0.1);
        assert!(points[1..8].iter().all(|&point| distance(&open, point) < 1e-14));
        let closed = near(CurveScheme::CatmullRom { parametrization, closed: true }, points.clone(), 0.1);
        assert!(points.iter().all(|&point| distance(&closed, point) < 1e-14));
    }
    // The middle of a uniform span is (-P_0 + 9 P_1 + 9 P_2 - P_3) / 16.
    let middle = (9.0 * (points[3] + points[4]) - points[2] - points[5]) / 16.0;
    let uniform = CurveScheme::CatmullRom { parametrization: Parametrization::Uniform, closed: false };
    assert!(distance(&near(uniform, points.clone(), 0.1), middle) < 1e-14);
}

#[test]
fn a_beta_spline_without_bias_and_tension_is_the_uniform_b_spline() {
    let points = Random(5).points(8);
    let knots: Vec<f64> = (0..12).map(f64::from).collect();
    let beta = near(CurveScheme::BetaSpline { beta1: 1.0, beta2: 0.0, closed: false }, points.clone(), 0.05);
    for k in 0..=40 {
        let exact = de_boor(3, &knots, &points, None, 3.0 + f64::from(k) / 8.0);
        assert!(distance(&beta, exact) < 1e-14);
    }
    // With bias 2 the first span starts at (16 P_0 + 24 P_1 + 2 P_2) / 42.
    let start = (16.0 * points[0] + 24.0 * points[1] + 2.0 * points[2]) / 42.0;
    assert!(distance(&near(CurveScheme::BetaSpline { beta1: 2.0, beta2: 0.0, closed: false }, points.clone(), 0.05), start) < 1e-14);
}

#[test]
fn the_four_point_scheme_interpolates_reproduces_cubics_and_has_its_cardinal_function() {
    let cubic = (-4..=4).map(|k| DVec3::new(f64::from(k), f64::from(k * k * k), 0.0)).collect();
    for vertex in near(CurveScheme::FourPoint { tension: 0.0625, closed: false }, cubic, 0.02) {
        assert!((vertex.y - vertex.x.powi(3)).abs() < 1e-13);
    }
    let cardinal = (-6..=6).map(|k| DVec3::new(f64::from(k), f64::from(u8::from(k == 0)), 0.0)).collect();
    let vertices = near(CurveScheme::FourPoint { tension: 0.0625, closed: false }, cardinal, 0.01);
    for (x, y) in [(0.0, 1.0), (0.5, 9.0 / 16.0), (1.5, -1.0 / 16.0), (1.0, 0.0), (-0.5, 9.0 / 16.0)] {
        assert!(distance(&vertices, DVec3::new(x, y, 0.0)) < 1e-15, "{x}");
    }
    let square: Vec<DVec3> = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)].map(|(x, y)| DVec3::new(x, y, 0.0)).to_vec();
    let polygon = near(CurveScheme::FourPoint { tension: 0.0, closed: true }, square, 0.01);
    let off = |p: &DVec3| [p.x, p.x - 4.0, p.y, p.y - 4.0].map(f64::abs).into_iter().fold(f64::INFINITY, f64::min);
    assert!(polygon.iter().map(off).fold(0.0, f64::max) < 1e-14);
}

/// With d = 1/4 on halves, the function through (0, 0), (1/2, 1), (1, 0) is the parabola 4 x (1 - x) (Archimedes).
#[test]
fn fractal_interpolation_makes_the_parabola() {
    let points = vec![DVec3::ZERO, DVec3::new(0.5, 1.0, 0.0), DVec3::X];
    let maps = [(0.0, 1.0), (0.5, -1.0)].map(|(x, slope)| AffineMap {
        linear: DMat3::from_cols(DVec3::new(0.5, slope, 0.0), DVec3::Y * 0.25, DVec3::Z * 0.25),
        translation: DVec3::new(x, if x > 0.0 { 1.0 } else { 0.0 }, 0.0),
    });
    let own = CurveScheme::Interpolation { vertical_scaling: vec![0.25, 0.25] };
    for scheme in [own, CurveScheme::AffineInterpolation { maps: maps.to_vec() }] {
        let vertices = near(scheme, points.clone(), 0.01);
        assert!(vertices.len() > 8);
        assert!(vertices.iter().all(|vertex| (vertex.y - 4.0 * vertex.x * (1.0 - vertex.x)).abs() < 1e-14));
    }
    // Many points: cells are affine frames.
    let mut random = Random(9);
    let points: Vec<DVec3> = (0..40).map(|k| DVec3::new(f64::from(k), random.between(-2.0, 2.0), 0.0)).collect();
    let scaling = (0..39).map(|_| random.between(-0.3, 0.3)).collect();
    let vertices = near(CurveScheme::Interpolation { vertical_scaling: scaling }, points.clone(), 0.5);
    assert!(points.iter().all(|&point| distance(&vertices, point) < 1e-12));
}

#[test]
fn sums_are_translations_and_weights_multiply() {
    let arc = vec![DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
    let weights = Some(vec![1.0, std::f64::consts::FRAC_1_SQRT_2, 1.0]);
    let u = Curve { scheme: CurveScheme::Bezier, control_points: ControlNet { weights, ..ControlNet::line(arc) } };
    let line = vec![DVec3::ZERO, DVec3::new(0.0, 0.0, 2.0), DVec3::new(0.0, 0.0, 5.0)];
    let v = Curve { scheme: CurveScheme::Bezier, control_points: ControlNet::line(line) };
    let tessellation = evaluated(&lower(Shape::Sum(Sum { u, v })).attractor, 0.01);
    assert_eq!(agreed(&tessellation), (1, 1, 1));
    assert!(tessellation.vertices.iter().all(|p| (p.x.hypot(p.y) - 1.0).abs() < 1e-14 && (-1e-14..=5.0 + 1e-14).contains(&p.z)));
}

#[test]
fn a_product_of_beziers_is_the_bezier_surface_and_directions_may_be_exchanged() {
    let points = Random(4).points(12);
    let net = ControlNet { size: vec![3, 4], points: points.clone(), weights: None };
    let turned = ControlNet { size: vec![4, 3], points: (0..12).map(|k| points[k % 3 * 4 + k / 3]).collect(), weights: None };
    let surface = |net| evaluated(&lower(product(vec![CurveScheme::Bezier; 2], net)).attractor, 0.5).vertices;
    let (straight, other) = (surface(net), surface(turned));
    assert_eq!(straight.len(), other.len());
    assert!(straight.iter().all(|&point| distance(&other, point) < 1e-13));
}

#[test]
fn what_is_illegal_is_refused_with_its_place() {
    let nurbs = |degree: usize, knots: &[f64], count: usize| {
        let points = (0..count).map(|k| DVec3::X * k as f64).collect();
        curve(CurveScheme::Nurbs { degree, knots: knots.to_vec() }, points, None)
    };
    let four = |scheme| curve(scheme, Random(1).points(4), None);
    let weighted = |weight| curve(CurveScheme::Bezier, Random(1).points(2), Some(vec![1.0, weight]));
    let beta = |beta1, beta2| four(CurveScheme::BetaSpline { beta1, beta2, closed: true });
    let cases = [
        (nurbs(2, &[0.0, 1.0, 0.5, 3.0, 4.0, 5.0], 3), "nurbs.knots-decrease", "/knots/2"),
        (nurbs(2, &[0.0, 1.0, 2.0, 3.0, 4.0], 3), "nurbs.knot-count", "/knots"),
        (nurbs(1, &[0.0, 0.0, 0.0, 1.0, 1.0], 3), "nurbs.multiplicity", "/knots/2"),
        (nurbs(2, &[0.0, 1.0, f64::NAN, 3.0, 4.0, 5.0], 3), "model.not-finite", "/knots/2"),
        (nurbs(2, &[0.0, 1.0, 2.0, 2.0, 2.0, 5.0], 3), "nurbs.empty-domain", "/knots"),
        (nurbs(1, &[-1.7e308, 0.0, 1.0, 1.7e308], 2), "nurbs.knot-range", "/knots"),
        (nurbs(0, &[0.0, 1.0], 1), "nurbs.degree", "/degree"),
        (nurbs(50, &[0.0; 60], 9), "nurbs.degree", "/degree"),
        (nurbs(3, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 3), "nurbs.points", "/control_points"),
        (weighted(0.0), "net.weights", "/weights/1"),
        (weighted(-1.0), "net.weights", "/weights/1"),
        (weighted(f64::NAN), "net.weights", "/weights/1"),
        (curve(CurveScheme::Bezier, vec![DVec3::X], None), "bezier.degree", "/control_points"),
        (curve(CurveScheme::Bezier, vec![DVec3::X, DVec3::NAN], None), "model.not-finite", "/control_points/1"),
        (beta(0.0, 0.0), "beta-spline.shape", "/beta1"),
        (beta(1.0, -12.0), "beta-spline.shape", "/beta2"),
        (beta(1.0, f64::INFINITY), "model.not-finite", "/beta2"),
        (four(CurveScheme::FourPoint { tension: 0.1, closed: false }), "four-point.points", "/control_points"),
        (four(CurveScheme::FourPoint { tension: f64::NAN, closed: true }), "model.not-finite", "/w"),
        (four(CurveScheme::FourPoint { tension: 1.0, closed: true }), "automaton.not-contractive", ""),
        (four(CurveScheme::Interpolation { vertical_scaling: vec![0.5; 2] }), "interpolation.order", "/points"),
    ];
    for (shape, code, pointer) in cases {
        let findings = refused(shape.clone());
        assert!(findings.iter().any(|f| f.code == code && f.pointer == pointer), "{shape:?}: {findings:?}");
    }
    // In a product every scheme has its own place.
    let bad = CurveScheme::Nurbs { degree: 2, knots: vec![0.0, 1.0, 0.5, 3.0, 4.0, 5.0] };
    for (separate, pointer) in [(true, "/v/knots/2"), (false, "/knots/1/2")] {
        let mut shape =
            product(vec![CurveScheme::Bezier, bad.clone()], ControlNet { size: vec![2, 3], points: Random(1).points(6), weights: None });
        if let Shape::TensorProduct(product) = &mut shape {
            product.separate = separate;
        }
        let findings = Model { name: None, shape }.lower().expect_err("refused");
        assert!(findings.iter().any(|f| f.pointer == pointer), "{findings:?}");
    }
}
