//! Products of curves: what is drawn of them keeps its bound, whatever the factors.

use crate::schemes;
use crate::schemes::{Random, evaluated, lower, product};
use glam::DVec3;
use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::model::{ControlNet, CurveScheme, Parametrization};

fn nurbs(degree: usize, knots: Vec<f64>) -> CurveScheme {
    CurveScheme::Nurbs { degree, knots }
}

fn clamped(degree: usize, count: usize) -> Vec<f64> {
    let inner = count - degree;
    (0..=count + degree).map(|k| (k.clamp(degree, count) - degree) as f64 / inner as f64).collect()
}

/// A scheme of its kind, and a number of control points for it.
fn scheme(kind: usize, random: &mut Random) -> (CurveScheme, usize) {
    match kind {
        0 => (nurbs(3, random.knots(3, 6, 0)), 6),
        1 => (nurbs(9, clamped(9, 11)), 11),
        2 => (CurveScheme::FourPoint { tension: 0.0625, closed: false }, 8),
        3 => (CurveScheme::Interpolation { vertical_scaling: (0..6).map(|_| random.between(-0.4, 0.4)).collect() }, 7),
        4 => (CurveScheme::Interpolation { vertical_scaling: vec![0.5, 0.5] }, 3),
        5 => (CurveScheme::CornerCutting { a: 0.3, b: 0.2, closed: false }, 5),
        6 => (CurveScheme::CatmullRom { parametrization: Parametrization::Uniform, closed: true }, 5),
        _ => (CurveScheme::Bezier, 5),
    }
}

/// Control points of cells at random words of some length, as an independent sample: corners of the cells are points
/// of the surface.
fn sample(attractor: &Attractor, random: &mut Random) -> DVec3 {
    let automaton = attractor.automaton();
    let root = &attractor.roots()[random.below(attractor.roots().len())];
    let (mut state, mut points) = (root.state, root.points.clone());
    let apply = |points: &[[f64; 4]], entries: &[f64]| -> Vec<[f64; 4]> {
        let column = |column: &[f64]| std::array::from_fn(|k| points.iter().zip(column).map(|(p, w)| w * p[k]).sum());
        entries.chunks_exact(points.len()).map(column).collect()
    };
    for _ in 0..9 {
        let transitions = &automaton.state(state).transitions;
        let transition = &transitions[random.below(transitions.len())];
        points = apply(&points, transition.operator.entries());
        state = transition.to;
    }
    while let Some(boundary) = automaton.state(state).boundaries.first() {
        points = apply(&points, boundary.incidence.entries());
        state = boundary.state;
    }
    schemes::project(points[0])
}

fn closest(p: DVec3, triangle: [DVec3; 3]) -> f64 {
    let [a, b, c] = triangle;
    let segment = |a: DVec3, b: DVec3| {
        let along = ((p - a).dot(b - a) / (b - a).length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        p.distance(a + along * (b - a))
    };
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let inside = [(a, b), (b, c), (c, a)].iter().all(|&(x, y)| normal.dot((y - x).cross(p - x)) >= 0.0);
    let edges = segment(a, b).min(segment(b, c)).min(segment(c, a));
    if inside && normal != DVec3::ZERO { edges.min((p - a).dot(normal).abs()) } else { edges }
}

/// Points of the surface, found by dense operators along random words, lie within the stated bound of the drawing.
#[test]
fn drawings_of_products_keep_their_bounds() {
    let mut random = Random(41);
    for round in 0..24 {
        let kinds = [round % 8, (round * 3 + round / 8) % 8];
        let [(u, m), (v, n)] = kinds.map(|kind| scheme(kind, &mut random));
        let points = (0..m * n).map(|k| DVec3::new((k / n) as f64, (k % n) as f64, random.between(-1.0, 1.0))).collect();
        let weights =
            kinds.iter().all(|kind| matches!(kind, 0 | 1 | 5 | 7)).then(|| (0..m * n).map(|_| random.between(0.5, 2.0)).collect());
        let attractor = lower(product(vec![u, v], ControlNet { size: vec![m, n], points, weights })).attractor;
        let drawn = evaluated(&attractor, 0.5);
        assert!(drawn.deviation_mm <= 0.5 && !drawn.triangles.is_empty(), "{kinds:?}");
        let corners: Vec<[DVec3; 3]> = drawn.triangles.iter().map(|t| t.map(|v| drawn.vertices[v as usize])).collect();
        for _ in 0..60 {
            let point = sample(&attractor, &mut random);
            let off = corners.iter().map(|&triangle| closest(point, triangle)).fold(f64::INFINITY, f64::min);
            assert!(off <= drawn.deviation_mm * (1.0 + 1e-9), "{kinds:?}: {off} of {}", drawn.deviation_mm);
        }
    }
}

/// A product converges as its slowest factor, and its bounds are those of the factors.
#[test]
fn products_converge_as_their_factors() {
    let mut random = Random(5);
    for (kinds, rate) in [([3, 0], 0.4_f64), ([4, 1], 0.5), ([2, 2], 0.5)] {
        let [(u, m), (v, n)] = kinds.map(|kind| scheme(kind, &mut random));
        let attractor = lower(product(vec![u, v], ControlNet { size: vec![m, n], points: random.points(m * n), weights: None })).attractor;
        let contraction = attractor.contraction();
        assert!(contraction.lower <= contraction.upper && contraction.upper < 1.0);
        assert!(contraction.upper < rate.max(0.5) + 0.06, "{kinds:?}: {}", contraction.upper);
    }
}

/// 1000 control points to a cell: one operator would have a million entries.
#[test]
fn volumes_of_high_degree_are_evaluated() {
    let mut random = Random(8);
    let count = 10;
    let point = |k: usize| {
        let jitter = DVec3::new(random.between(-0.2, 0.2), random.between(-0.2, 0.2), random.between(-0.2, 0.2));
        DVec3::new((k / 100) as f64, (k / 10 % 10) as f64, (k % 10) as f64) + jitter
    };
    let points = (0..1000).map(point).collect();
    let schemes = vec![nurbs(9, clamped(9, count)); 3];
    let attractor = lower(product(schemes, ControlNet { size: vec![count; 3], points, weights: None })).attractor;
    assert!(attractor.contraction().upper < 0.6);
    let drawn = evaluated(&attractor, 4.0);
    assert!(drawn.deviation_mm <= 4.0 && !drawn.points.is_empty());
}
