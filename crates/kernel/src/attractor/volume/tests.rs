//! Volumes against what is known of them: volumes in closed form, points, and maps that fold.

use super::*;
use crate::model::{ControlNet, Curve, CurveScheme, Group, Model, Part, PartRadius, Shape, TensorProduct};
use crate::split_mix::Random;

fn bezier(degree: usize) -> CurveScheme {
    CurveScheme::Nurbs { degree, knots: [vec![0.0; degree + 1], vec![1.0; degree + 1]].concat() }
}

fn volume_of(schemes: [CurveScheme; 3], size: [usize; 3], points: Vec<DVec3>, weights: Option<Vec<f64>>) -> Attractor {
    let control_points = ControlNet { size: size.to_vec(), points, weights };
    let shape = Shape::TensorProduct(TensorProduct { schemes: schemes.to_vec(), control_points, separate: false, trim: None });
    Model { name: None, shape }.lower().unwrap().attractor
}

fn place([x, y, z]: [usize; 3]) -> DVec3 {
    DVec3::new(x as f64, y as f64, z as f64)
}

fn grid(size: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..size.iter().product()).map(move |index| [index / (size[1] * size[2]), index / size[2] % size[1], index % size[2]])
}

/// Arcs of a circle, a quarter each: control points of radius 1, and weights.
fn arcs(quarters: usize) -> (CurveScheme, Vec<(DVec3, f64)>) {
    let root = 0.5_f64.sqrt();
    let point = |k: usize| {
        let (sine, cosine) = (k as f64 * std::f64::consts::FRAC_PI_4).sin_cos();
        let weight = if k.is_multiple_of(2) { 1.0 } else { root };
        // Exactly where they are, so that ends of full circles meet.
        let snap = |x: f64| if x.abs() < 1e-9 { 0.0 } else { x };
        (DVec3::new(snap(cosine), snap(sine), 0.0) / weight, weight)
    };
    let mut knots = vec![0.0; 3];
    (1..quarters).for_each(|k| knots.extend([k as f64; 2]));
    knots.extend([quarters as f64; 3]);
    (CurveScheme::Nurbs { degree: 2, knots }, (0..=2 * quarters).map(point).collect())
}

/// A wedge of a pipe around the z axis, between two radii.
fn pipe(quarters: usize, radii: [f64; 2], height: f64) -> Attractor {
    let (scheme, arcs) = arcs(quarters);
    let size = [arcs.len(), 2, 2];
    let at = |[k, side, up]: [usize; 3]| (radii[side] * arcs[k].0 + up as f64 * height * DVec3::Z, arcs[k].1);
    let (points, weights) = grid(size).map(at).unzip();
    volume_of([scheme, bezier(1), bezier(1)], size, points, Some(weights))
}

fn filled(attractor: &Attractor, tolerance: f64) -> Option<(TriMesh, f64)> {
    let filled = attractor.filled(Tolerance::new(tolerance).unwrap(), &Budget::default()).unwrap();
    filled.map(|(filled, deviation)| {
        let mut mesh = TriMesh::default();
        filled.surfaces().iter().for_each(|surface| mesh.append(surface));
        (mesh, deviation)
    })
}

fn topology(mesh: &TriMesh) -> (u64, u64, i64) {
    let solid = Solid::new(mesh.clone(), &Budget::default()).unwrap();
    (solid.topology().components, solid.topology().cavities, solid.topology().euler)
}

/// Cylinders and wedges, whose axis is no face; pipes that close; a tube in two pieces by hand.
#[test]
fn named_volumes_are_filled() {
    use std::f64::consts::PI;
    let shapes = [
        (pipe(4, [0.0, 5.0], 3.0), PI * 25.0 * 3.0, (1, 0, 2)),
        (pipe(2, [0.0, 5.0], 3.0), PI * 12.5 * 3.0, (1, 0, 2)),
        (pipe(1, [0.0, 5.0], 3.0), PI * 6.25 * 3.0, (1, 0, 2)),
        (pipe(4, [2.0, 5.0], 3.0), PI * 21.0 * 3.0, (1, 0, 0)),
        (pipe(3, [2.0, 5.0], 3.0), PI * 21.0 * 0.75 * 3.0, (1, 0, 2)),
        // Inside out.
        (pipe(4, [5.0, 2.0], 3.0), PI * 21.0 * 3.0, (1, 0, 0)),
    ];
    for (case, (attractor, expected, counts)) in shapes.iter().enumerate() {
        let (mesh, deviation) = filled(attractor, 0.01).unwrap();
        assert!(deviation <= 0.01, "{case}");
        let off = (volume(&mesh) - expected).abs();
        assert!(off <= 1.1 * deviation * crate::measure::mass::area(&mesh), "{case}: {off}");
        assert_eq!(topology(&mesh), *counts, "{case}");
    }
}

/// A ball by longitude, latitude and radius has an axis that is a face, and its middle; half of it, too. Between two radii there is a cavity: that is left as it is.
#[test]
fn balls_are_filled() {
    use std::f64::consts::PI;
    let ball = |quarters: usize, radii: [f64; 2]| {
        let ((round, around), (up, above)) = (arcs(quarters), arcs(2));
        let size = [around.len(), above.len(), 2];
        let at = |[k, j, side]: [usize; 3]| {
            let ((a, u), (b, v)) = (around[k], above[j]);
            // The second arc leads from pole to pole.
            (radii[side] * DVec3::new(a.x * b.y, a.y * b.y, -b.x), u * v)
        };
        let (points, weights) = grid(size).map(at).unzip();
        volume_of([round, up, bezier(1)], size, points, Some(weights))
    };
    let cases = [(ball(4, [0.0, 5.0]), 4.0 / 3.0 * PI * 125.0, (1, 0, 2)), (ball(2, [0.0, 5.0]), 2.0 / 3.0 * PI * 125.0, (1, 0, 2))];
    for (case, (attractor, expected, counts)) in cases.iter().enumerate() {
        let (mesh, deviation) = filled(attractor, 0.02).unwrap();
        let off = (volume(&mesh) - expected).abs();
        assert!(off <= 1.1 * deviation * crate::measure::mass::area(&mesh), "{case}: {off}");
        assert_eq!(topology(&mesh), *counts, "{case}");
    }
    assert!(filled(&ball(4, [2.0, 5.0]), 0.02).is_none());
}

/// Of volumes by chance all places are in the solid or as near to it as is told, and most are in it.
#[test]
fn places_are_where_the_volume_is() {
    let mut random = Random(17);
    let knots = vec![0.0, 0.0, 0.0, 1.0, 2.0, 2.0, 2.0];
    let mut made = 0;
    for case in 0..12 {
        let size = [4, 4, 2];
        let schemes = [bezier(3), CurveScheme::Nurbs { degree: 2, knots: knots.clone() }, bezier(1)];
        let shaken = [0.5, 1.0][case % 2];
        let points = grid(size).map(|own| {
            let by = DVec3::new(random.share(), random.share(), random.share()) - 0.5;
            place(own) * DVec3::new(4.0, 4.0, 10.0) + 4.0 * shaken * by
        });
        let points: Vec<DVec3> = points.collect();
        let weights = (case % 3 == 0).then(|| (0..points.len()).map(|_| 0.7 + 0.6 * random.share()).collect());
        let attractor = volume_of(schemes, size, points, weights);
        let Some((mesh, deviation)) = filled(&attractor, 0.05) else { continue };
        made += 1;
        let (inside, mut deep, mut all) = (Inside::new(&mesh), 0_u32, 0_u32);
        for _ in 0..2_000 {
            // A cell so deep that it is a place.
            let root = &attractor.roots()[random.next() as usize % attractor.roots().len()];
            let (mut state, mut points) = (root.state, root.points.clone());
            for _ in 0..24 {
                let transitions = &attractor.automaton().state(state).transitions;
                let step = &transitions[random.next() as usize % transitions.len()];
                let mut next = vec![[0.0; 4]; step.operator.columns()];
                super::super::cell::child_points(&points, &step.operator, &mut next);
                (state, points) = (step.to, next);
            }
            let [x, y, z, w] = points[0];
            let x = DVec3::new(x, y, z) / w;
            assert!(inside.distance(x) <= deviation + 1e-6, "{case}: {x}");
            all += 1;
            deep += u32::from(inside.winding(x) > 0);
        }
        assert!(deep > all * 9 / 10, "{case}: {deep}");
    }
    assert!(made >= 8, "{made}");
}

/// What is folded, or overlaps itself, or is no spline, is left as it is; what is beside a volume stays.
#[test]
fn what_is_not_proven_stays() {
    let size = [2, 2, 2];
    let cube = || grid(size).map(|own| 5.0 * place(own)).collect::<Vec<DVec3>>();
    let unit = || [bezier(1), bezier(1), bezier(1)];
    assert!(filled(&volume_of(unit(), size, cube(), None), 0.1).is_some());
    // A corner is pushed in so far that the cube turns over there.
    let mut folded = cube();
    folded[7] = DVec3::new(0.5, 0.5, 0.5);
    assert!(filled(&volume_of(unit(), size, folded, None), 0.1).is_none());
    // Flat, of no volume.
    let flat = grid(size).map(|[x, y, _]| 5.0 * place([x, y, 0])).collect();
    assert!(filled(&volume_of(unit(), size, flat, None), 0.1).is_none());
    // A wedge whose axis has other weights on one side than on the other: that face is no line, as places along it run apart.
    let (scheme, around) = arcs(1);
    let wedge = |skewed: f64| {
        let size = [around.len(), 2, 2];
        let at = |[k, side, up]: [usize; 3]| {
            let weight = if side == 0 && up == 1 && k == 2 { skewed } else { 1.0 };
            (around[k].0 * (5.0 * side as f64) + 3.0 * up as f64 * DVec3::Z, around[k].1 * weight)
        };
        let (points, weights) = grid(size).map(at).unzip();
        volume_of([scheme.clone(), bezier(1), bezier(1)], size, points, Some(weights))
    };
    assert!(filled(&wedge(1.0), 0.05).is_some());
    assert!(filled(&wedge(9.0), 0.05).is_none());
    // A spiral staircase of one turn and a half that meets itself.
    let (scheme, around) = arcs(6);
    let size = [around.len(), 2, 2];
    let stair = |[k, side, up]: [usize; 3]| (around[k].0 * (2.0 + 3.0 * side as f64) + up as f64 * DVec3::Z, around[k].1);
    let (points, weights) = grid(size).map(stair).unzip();
    assert!(filled(&volume_of([scheme, bezier(1), bezier(1)], size, points, Some(weights)), 0.1).is_none());
}

/// A volume beside other shapes, with a radius of its own; two volumes are two solids.
#[test]
fn others_stay_beside_volumes() {
    let size = [2, 2, 2];
    let cube = |at: DVec3| {
        let points = grid(size).map(|own| at + 5.0 * place(own)).collect();
        let control_points = ControlNet { size: size.to_vec(), points, weights: None };
        let schemes = vec![bezier(1), bezier(1), bezier(1)];
        Shape::TensorProduct(TensorProduct { schemes, control_points, separate: false, trim: None })
    };
    let points = [0.0, 1.0, 2.0].map(|x| DVec3::new(8.0, x, x * x)).to_vec();
    let wire = Shape::Curve(Curve { scheme: CurveScheme::Bezier, control_points: ControlNet { size: vec![3], points, weights: None } });
    let part = |shape: Shape, radius: Option<f64>| Part { name: None, transform: None, shape, radius: radius.map(PartRadius::Constant) };
    let parts = vec![part(cube(DVec3::ZERO), None), part(wire, Some(0.25)), part(cube(DVec3::new(20.0, 0.0, 0.0)), Some(2.0))];
    let attractor = Model { name: None, shape: Shape::Group(Group { parts, joins: Vec::new() }) }.lower().unwrap().attractor;
    let (filled, deviation) = attractor.filled(Tolerance::new(0.1).unwrap(), &Budget::default()).unwrap().unwrap();
    assert!(filled.solids().len() == 2 && deviation < 1e-8, "{deviation}");
    assert_eq!(filled.roots().iter().filter(|root| root.solid.is_none()).count(), 1);
    let volumes: Vec<f64> = filled.surfaces().iter().map(volume).collect();
    assert!(volumes.iter().all(|volume| (volume - 125.0).abs() < 1e-9), "{volumes:?}");
    let radius_of = |solid: Option<u32>| {
        let root = filled.roots().iter().position(|root| root.solid == solid).unwrap();
        filled.own_radius(root).cloned()
    };
    assert_eq!([None, Some(0), Some(1)].map(radius_of), [Some(0.25), None, Some(2.0)].map(|own| own.map(OwnRadius::Constant)));
}
