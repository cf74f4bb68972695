//! Leaf errors of subdivision surfaces: sound against much finer evaluations, and of second order away from
//! extraordinary vertices, so that faces go with 1 / tolerance.

use crate::cages;
use crate::cages::{attractor, cube, evaluated, grid, tetrahedron, torus};
use crate::oracle::{Oracle, Random};
use glam::DVec3;
use lacuna_kernel::attractor::refine_with_normals;
use lacuna_kernel::automaton::StateId;
use lacuna_kernel::budget::Budget;
use lacuna_kernel::model::{BoundaryRule, CellKind, Corner, Crease, Scheme, Subdivision};
use lacuna_kernel::tolerance::Tolerance;

/// Faces with proven linear precision, and all.
fn precise(surface: Subdivision) -> (usize, usize) {
    let attractor = attractor(surface);
    let faces = attractor.automaton().states().iter().enumerate().filter(|(_, state)| state.kind == Some(CellKind::Face));
    let all: Vec<bool> = faces.map(|(index, _)| attractor.precision(StateId::new(index)).is_some()).collect();
    (all.iter().filter(|&&precise| precise).count(), all.len())
}

#[test]
fn regular_stencils_have_linear_precision_whatever_corner_they_are_seen_from() {
    for scheme in [Scheme::CatmullClark, Scheme::Loop, Scheme::DooSabin] {
        assert_eq!(precise(torus(scheme, 6, 6)), (1, 1), "{scheme:?}");
    }
    // Inside, at the boundary and its sharp corners, beside creases that last and that fade.
    let mut creased = Subdivision { boundary: BoundaryRule::SharpCorners, ..grid(Scheme::CatmullClark, 6, 6, |x, y| x * y) };
    creased.creases.extend((0..6).map(|k| Crease { edge: [7 * k + 3, 7 * k + 10], sharpness: f64::INFINITY }));
    let (with, all) = precise(creased.clone());
    assert_eq!(with, all);
    // A lone corner in the middle is none.
    creased.creases.iter_mut().for_each(|crease| crease.sharpness = 2.5);
    creased.corners.push(Corner { vertex: 8, sharpness: f64::INFINITY });
    let (with, all) = precise(creased);
    assert!(with >= 10 && with < all, "{with} of {all}");
    let (with, all) = precise(cube(Scheme::CatmullClark));
    assert!(with == 1 && all > 1, "{with} of {all}");
}

/// The number of leaf faces at a tolerance.
fn faces(surface: &Subdivision, tolerance: f64) -> f64 {
    evaluated(&attractor(surface.clone()), tolerance).complex.expect("a B-rep").faces as f64
}

#[test]
fn faces_go_with_the_inverse_of_the_tolerance() {
    for (surface, name) in
        [(cube(Scheme::CatmullClark), "Catmull-Clark"), (tetrahedron(Scheme::Loop), "Loop"), (cube(Scheme::DooSabin), "Doo-Sabin")]
    {
        let counts: Vec<f64> = [0.02, 0.002, 0.0002].map(|tolerance| faces(&surface, tolerance)).to_vec();
        eprintln!("{name}: {counts:?} faces");
        // 10 per step in the mean; levels are powers of 4.
        assert!(counts[2] / counts[0] < 160.0 && counts[1] / counts[0] < 40.0 && counts[2] / counts[1] < 40.0, "{name}: {counts:?}");
    }
}

/// Control points of the cells themselves see splines many times as far off as they are: measured at those the cube had 35 040 faces, and the tetrahedron 16 480.
#[test]
fn regular_faces_are_measured_close_to_the_surface() {
    for (surface, most) in [(cube(Scheme::CatmullClark), 8_000.0), (tetrahedron(Scheme::Loop), 4_500.0)] {
        let found = faces(&surface, 0.002);
        assert!(found < most, "{found}");
    }
}

/// The Hausdorff distance from a finer evaluation is at most the sum of the deviations.
fn attack(surface: &Subdivision, tolerance: f64, finer: f64, random: &mut Random) {
    let attractor = attractor(surface.clone());
    let [coarse, fine] = [tolerance, tolerance / finer].map(|tolerance| evaluated(&attractor, tolerance));
    let simplices = |index: usize| -> Vec<Vec<DVec3>> {
        let drawn = [&coarse, &fine][index];
        drawn.triangles.iter().map(|corners| corners.map(|k| drawn.vertices[k as usize]).to_vec()).collect()
    };
    let allowed = coarse.deviation_mm + fine.deviation_mm;
    assert!(coarse.deviation_mm <= tolerance * (1.0 + 1e-9), "{}", coarse.deviation_mm);
    for (from, to) in [(0, 1), (1, 0)] {
        let from = simplices(from);
        let to = Oracle { simplices: simplices(to), uncovered: 0.0, astray: 0.0 };
        for _ in 0..150 {
            let simplex = &from[(random.unit() * from.len() as f64) as usize];
            let shares = [random.unit(), random.unit(), random.unit()];
            let x = simplex.iter().zip(shares).map(|(corner, share)| *corner * share).sum::<DVec3>() / shares.iter().sum::<f64>();
            let d = to.distance(x);
            assert!(d <= allowed * (1.0 + 1e-9), "{x} is {d} off, {allowed} allowed: {surface:?}");
        }
    }
}

#[test]
fn errors_hold_against_finer_evaluations() {
    let mut random = Random(5);
    for round in 0..24 {
        let scheme = [Scheme::CatmullClark, Scheme::Loop, Scheme::DooSabin][round % 3];
        let mut surface = match round / 3 % 4 {
            0 => cube(scheme),
            1 => grid(scheme, 3, 2, |x, y| x * y),
            2 => tetrahedron(scheme),
            _ => torus(scheme, 4, 3),
        };
        let scale = surface.vertices.iter().map(|v| v.length()).fold(0.0, f64::max);
        surface.vertices.iter_mut().for_each(|v| *v += 0.3 * scale * DVec3::new(random.unit(), random.unit(), random.unit()));
        if scheme != Scheme::DooSabin && round % 2 == 1 {
            let face = surface.faces[0].clone();
            let sharpness = [0.5, 1.75, f64::INFINITY];
            surface.creases.extend((0..2).map(|k| Crease { edge: [face[k], face[k + 1]], sharpness: sharpness[round % 3] }));
        }
        attack(&surface, 0.02 * scale, 12.0, &mut random);
    }
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let mut random = Random(3);
    for scheme in [Scheme::CatmullClark, Scheme::Loop, Scheme::DooSabin] {
        for mut surface in [cube(scheme), torus(scheme, 12, 9), grid(scheme, 3, 2, |x, y| x * y)] {
            surface.vertices.iter_mut().for_each(|v| *v += 0.2 * DVec3::new(random.unit(), random.unit(), random.unit()));
            let attractor = attractor(surface);
            let planes = attractor.tangent_planes().expect("smooth");
            let run = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                pool.install(|| {
                    refine_with_normals(&attractor, &planes, Tolerance::new(0.01).expect("positive"), &Budget::default()).expect("refines")
                })
            };
            let one = run(1);
            assert!(run(2) == one && run(5) == one, "{scheme:?}");
        }
    }
}

#[test]
fn a_cage_of_a_million_faces_is_taken_or_refused_with_its_limit() {
    // Four million face corners are allowed.
    for (surface, taken) in [(torus(Scheme::CatmullClark, 1000, 1000), true), (torus(Scheme::CatmullClark, 1100, 1000), false)] {
        let clock = std::time::Instant::now();
        let result = cages::model(surface).lower();
        eprintln!("lowered in {:.1} s", clock.elapsed().as_secs_f64());
        match result {
            Ok(lowered) => assert!(taken && lowered.attractor.automaton().states().len() < 10),
            Err(findings) => assert!(!taken && findings[0].code == "subdivision.too-large", "{}", findings[0].code),
        }
    }
}
