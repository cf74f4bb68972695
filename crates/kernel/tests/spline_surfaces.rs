//! Evaluated products of schemes: conforming, closed where they close, within their bounds. Expected values are closed
//! forms and combinatorics.

use crate::agreement::agreed;
use crate::schemes::*;
use glam::DVec3;
use lacuna_kernel::model::{ControlNet, CurveScheme, Shape};
use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

fn nurbs(degree: usize, knots: &[f64]) -> CurveScheme {
    CurveScheme::Nurbs { degree, knots: knots.to_vec() }
}

const CIRCLE: [f64; 12] = [0.0, 0.0, 0.0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1.0, 1.0, 1.0];

/// Nine points of the unit circle with their weights (The NURBS Book, 7.5).
fn circle() -> Vec<(f64, f64, f64)> {
    let square = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)];
    let weight = |k: usize| if k.is_multiple_of(2) { 1.0 } else { FRAC_1_SQRT_2 };
    square.into_iter().enumerate().map(|(k, (x, y))| (f64::from(x), f64::from(y), weight(k))).collect()
}

/// The surface of revolution about z of a profile of (radius, height, weight).
fn revolved(profile: &[(f64, f64, f64)], scheme: CurveScheme) -> Shape {
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for &(radius, z, w) in profile {
        for (x, y, v) in circle() {
            points.push(DVec3::new(radius * x, radius * y, z));
            weights.push(w * v);
        }
    }
    let net = ControlNet { size: vec![profile.len(), 9], points, weights: Some(weights) };
    product(vec![scheme, nurbs(2, &CIRCLE)], net)
}

fn volume(tessellation: &lacuna_kernel::tessellation::Tessellation) -> f64 {
    let corner = |index: u32| tessellation.vertices[index as usize];
    tessellation.triangles.iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2])))).sum::<f64>() / 6.0
}

#[test]
fn a_rational_circle_closes_and_is_exact_to_rounding() {
    let points = circle().iter().map(|&(x, y, _)| DVec3::new(x, y, 0.0)).collect();
    let weights = circle().iter().map(|&(_, _, w)| w).collect();
    let attractor = lower(curve(nurbs(2, &CIRCLE), points, Some(weights))).attractor;
    // Every subdivision averages twice and may round each coordinate by half a unit in the last place.
    for (tolerance, depth) in [(1e-2, 3.0), (1e-4, 7.0), (1e-7, 12.0)] {
        let tessellation = evaluated(&attractor, tolerance);
        let complex = tessellation.complex.as_ref().expect("a B-rep");
        assert_eq!((complex.euler, complex.components), (0, 1));
        let off = tessellation.vertices.iter().map(|vertex| (vertex.length() - 1.0).abs()).fold(0.0, f64::max);
        assert!(off <= 4e-16_f64.max(depth * 1.11e-16), "{} vertices off by {off:e}", tessellation.vertices.len());
    }
    let tessellation = evaluated(&attractor, 1e-7);
    assert!((4000..40_000).contains(&tessellation.vertices.len()), "{} vertices", tessellation.vertices.len());
    // 45 degrees are halfway through the first quarter.
    let eighth = DVec3::new(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0);
    assert!(tessellation.vertices.iter().any(|vertex| vertex.distance(eighth) < 4e-16));
}

#[test]
fn a_sphere_by_revolution_has_two_poles_and_no_seam() {
    let half = [(0.0, -2.0, 1.0), (2.0, -2.0, FRAC_1_SQRT_2), (2.0, 0.0, 1.0), (2.0, 2.0, FRAC_1_SQRT_2), (0.0, 2.0, 1.0)];
    let attractor = lower(revolved(&half, nurbs(2, &[0.0, 0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 1.0]))).attractor;
    for tolerance in [0.3, 0.02] {
        let tessellation = evaluated(&attractor, tolerance);
        assert_eq!(agreed(&tessellation), (2, 0, 1), "tolerance {tolerance}");
        let off = tessellation.vertices.iter().map(|vertex| (vertex.length() - 2.0).abs()).fold(0.0, f64::max);
        assert!(off <= 1e-14, "{off:e}");
        let (exact, area) = (4.0 / 3.0 * PI * 8.0, 16.0 * PI);
        assert!((volume(&tessellation).abs() - exact).abs() <= 1.1 * tolerance * area);
    }
}

#[test]
fn a_torus_by_revolution_closes_both_ways() {
    let tube: Vec<(f64, f64, f64)> = circle().into_iter().map(|(x, y, w)| (3.0 + x, y, w)).collect();
    let attractor = lower(revolved(&tube, nurbs(2, &CIRCLE))).attractor;
    let tessellation = evaluated(&attractor, 0.05);
    assert_eq!(agreed(&tessellation), (0, 0, 1));
    let distance = |p: &DVec3| ((p.x.hypot(p.y) - 3.0).hypot(p.z) - 1.0).abs();
    assert!(tessellation.vertices.iter().map(distance).fold(0.0, f64::max) <= 4e-15);
    assert!((volume(&tessellation).abs() - 59.217_626_406_5).abs() <= 1.1 * 0.05 * 12.0 * PI * PI);
}

/// A net with a bump: cells of many sizes.
fn bumpy(rows: usize, columns: usize) -> ControlNet {
    let height = |i: usize, j: usize| if (i, j) == (1, 2) { 25.0 } else { 0.0 };
    let points =
        (0..rows * columns).map(|k| (k / columns, k % columns)).map(|(i, j)| DVec3::new(10.0 * i as f64, 10.0 * j as f64, height(i, j)));
    ControlNet { size: vec![rows, columns], points: points.collect(), weights: None }
}

#[test]
fn adaptive_patches_of_all_knots_are_discs_without_cracks() {
    let clamped = [0.0, 0.0, 0.0, 0.0, 1.0, 3.0, 3.5, 4.0, 4.0, 4.0, 4.0];
    let generic = [-2.0, -1.1, -0.3, 0.0, 0.7, 2.0, 2.3, 3.9, 4.1, 5.0];
    let doubled = [0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 3.0, 3.0, 3.0];
    let linear = [0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 4.0];
    let split = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0];
    let pairs = [(nurbs(3, &clamped), 7), (nurbs(3, &generic), 6), (nurbs(2, &doubled), 6), (nurbs(1, &linear), 5)];
    for (u, rows) in &pairs {
        for (v, columns) in &pairs {
            let attractor = lower(product(vec![u.clone(), v.clone()], bumpy(*rows, *columns))).attractor;
            assert_eq!(agreed(&evaluated(&attractor, 1.0)), (1, 1, 1), "{u:?} {v:?}");
        }
    }
    // Full multiplicity parts the surface.
    let attractor = lower(product(vec![nurbs(2, &split), nurbs(3, &clamped)], bumpy(6, 7))).attractor;
    assert_eq!(agreed(&evaluated(&attractor, 1.0)), (2, 2, 2));
}

#[test]
fn periodic_directions_close() {
    // A uniform periodic tube: the first three rows are repeated.
    let knots: Vec<f64> = (0..13).map(f64::from).collect();
    let points = (0..9 * 4).map(|k| (k / 4 % 6, k % 4)).map(|(i, j)| {
        let angle = TAU * i as f64 / 6.0;
        DVec3::new(10.0 * angle.cos(), 10.0 * angle.sin(), 8.0 * j as f64)
    });
    let net = ControlNet { size: vec![9, 4], points: points.collect(), weights: None };
    let attractor = lower(product(vec![nurbs(3, &knots), CurveScheme::Bezier], net)).attractor;
    assert_eq!(agreed(&evaluated(&attractor, 0.3)), (0, 2, 1));
}

#[test]
fn every_pair_of_schemes_makes_a_conforming_surface() {
    let schemes = [
        (CurveScheme::Bezier, false),
        (nurbs(2, &[0.0, 1.0, 2.0, 4.0, 5.0, 5.0, 7.0, 8.0, 9.0, 9.5]), false),
        (CurveScheme::CornerCutting { a: 0.3, b: 0.2, closed: true }, true),
        (CurveScheme::CatmullRom { parametrization: Default::default(), closed: false }, false),
        (CurveScheme::BetaSpline { beta1: 1.5, beta2: 3.0, closed: true }, true),
        (CurveScheme::FourPoint { tension: 0.0625, closed: true }, true),
    ];
    for (u, u_closed) in &schemes {
        for (v, v_closed) in &schemes {
            let points = (0..49).map(|k| (k / 7, k % 7)).map(|(i, j)| {
                let (a, b) = (TAU * i as f64 / 7.0, TAU * j as f64 / 7.0);
                DVec3::new((30.0 + 10.0 * b.cos()) * a.cos(), (30.0 + 10.0 * b.cos()) * a.sin(), 10.0 * b.sin() + a)
            });
            let net = ControlNet { size: vec![7, 7], points: points.collect(), weights: None };
            let attractor = lower(product(vec![u.clone(), v.clone()], net)).attractor;
            let expected = match (u_closed, v_closed) {
                (true, true) => (0, 0, 1),
                (false, false) => (1, 1, 1),
                _ => (0, 2, 1),
            };
            assert_eq!(agreed(&evaluated(&attractor, 8.0)), expected, "{u:?} {v:?}");
        }
    }
}
