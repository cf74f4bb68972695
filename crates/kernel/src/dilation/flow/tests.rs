//! What is shown of dilations against what is known of them: closed forms, lattices, and finer points and segments.

use super::super::arrangement::testing::{centres, copies_in_space, critical_values, on_coarse_lattice, points, topology, wires};
use super::super::{dilate, dilate_unsimplified};
use super::*;
use crate::attractor::cell::{cross, unit};
use crate::model::{ControlNet, Curve, CurveScheme, Interior, Model, PolygonMesh, Shape};
use crate::split_mix::Random;
use crate::tolerance::{Radius, Tolerance};
use glam::DVec3;

fn is_shown(attractor: &Attractor, radius: f64, others: &[DVec3]) -> bool {
    is_shown_of(attractor, radius, &figures(others))
}

fn figures(points: &[DVec3]) -> Vec<Figure> {
    Figure::of_points(&points.iter().map(DVec3::to_array).collect::<Vec<Point>>())
}

/// The figures of a shape of points, segments and triangles.
fn figures_of(shape: &Attractor) -> Vec<Figure> {
    let mut figures = Vec::new();
    for (index, root) in shape.roots().iter().enumerate() {
        shape.emit(&shape.root_cell(index), &root.points, &mut |site| figures.push(Weighted { site, deficit: 0.0 }.into()));
    }
    figures
}

fn is_shown_of(shape: &Attractor, radius: f64, figures: &[Figure]) -> bool {
    let candidates = Candidates::of_roots(shape);
    let flow = Flow { attractor: shape, candidates: &candidates, radius, slack: 1e-12, plane: None };
    flow.is_that_of(figures, &Budget::default()).unwrap()
}

fn triangles(corners: &[[DVec3; 3]]) -> Attractor {
    let faces = (0..corners.len() as u32).map(|k| (3 * k..3 * k + 3).collect()).collect();
    let shape = Shape::Mesh(PolygonMesh { vertices: corners.concat(), faces, interior: Interior::Surface });
    Model { name: None, shape }.lower().unwrap().attractor
}

fn curve(scheme: CurveScheme, points: Vec<DVec3>, weights: Option<Vec<f64>>) -> Attractor {
    let control_points = ControlNet { size: vec![points.len()], points, weights };
    Model { name: None, shape: Shape::Curve(Curve { scheme, control_points }) }.lower().unwrap().attractor
}

fn vector(random: &mut Random) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| 2.0 * random.share() - 1.0))
}

/// Two points, the corners of a triangle and of a tetrahedron, regular ones: parts join, a handle and a void close, where the radius is half a side, or that of the circle or sphere around them.
#[test]
fn nothing_is_shown_where_topologies_differ() {
    let triangle = [DVec3::X, DVec3::new(-0.5, 0.75_f64.sqrt(), 0.0), DVec3::new(-0.5, -(0.75_f64.sqrt()), 0.0)];
    let tetrahedron = [DVec3::ONE, DVec3::new(1.0, -1.0, -1.0), DVec3::new(-1.0, 1.0, -1.0), DVec3::new(-1.0, -1.0, 1.0)];
    let sets = [vec![-DVec3::X, DVec3::X], triangle.to_vec(), tetrahedron.map(DVec3::normalize).to_vec()];
    let at = |set: &[DVec3], share: f64| set.iter().map(|x| DVec3::new(3.0, -2.0, 5.0) + share * *x).collect::<Vec<DVec3>>();
    for set in &sets {
        for moved in [1e-6, 1e-3, 0.05] {
            let (wider, narrower) = (at(set, 1.0 + moved), at(set, 1.0 - moved));
            assert!(!is_shown(&points(&wider), 1.0, &narrower) && !is_shown(&points(&narrower), 1.0, &wider), "{set:?}, {moved}");
            let [far, farther] = [0.1, 0.12].map(|share| at(set, 1.0 + share));
            let [near, nearer] = [0.1, 0.12].map(|share| at(set, 1.0 - share));
            assert!(is_shown(&points(&far), 1.0, &farther) && is_shown(&points(&nearer), 1.0, &near), "{set:?}");
        }
    }
    // What only one of both has.
    assert!(!is_shown(&points(&sets[0]), 0.5, &sets[0][..1]) && !is_shown(&points(&sets[0][..1]), 0.5, &sets[0]));
}

/// Points in a plane, of which one critical value, known from closed forms, is above the radius, and the same points closer to each other, so that it is below: in no plane.
#[test]
fn nothing_is_shown_in_a_plane_across_a_critical_value() {
    let mut random = Random(29);
    let (mut across, mut shown, mut clear) = (0, 0, 0);
    for round in 0..1_500 {
        let axis = round % 3;
        let mut set: Vec<(Point, f64)> = (0..2 + round % 7).map(|_| ((1.8 * vector(&mut random)).to_array(), 0.0)).collect();
        set.iter_mut().for_each(|(at, _)| at[axis] = 0.0);
        let values: Vec<f64> = critical_values(&set).into_iter().map(|(value, _)| value).collect();
        let Some(&value) = values.get((random.next() % 6) as usize).filter(|&&value| value > 0.3) else { continue };
        let moved = [1e-6, 1e-3, 1e-2][round / 3 % 3];
        let at = |share: f64| -> Vec<DVec3> {
            let place = |(at, _): &(Point, f64)| {
                let mut at = at.map(|x| x * share);
                at[axis] = 0.7;
                DVec3::from_array(at)
            };
            set.iter().map(place).collect()
        };
        let told = |one: f64, other: f64| {
            let attractor = points(&at(one));
            let candidates = Candidates::of_roots(&attractor);
            let flow = Flow { attractor: &attractor, candidates: &candidates, radius: 1.0, slack: 1e-12, plane: Some((axis, 0.7)) };
            flow.is_that_of(&figures(&at(other)), &Budget::default()).unwrap()
        };
        across += 1;
        assert!(!told((1.0 + moved) / value, (1.0 - moved) / value), "{round}: {values:?}, {moved}");
        // All values of the one are as far on the same side of the radius as those of the other, and none is near.
        let share = 1.05 / value;
        if values.iter().all(|value| (share * value - 1.0).abs() > 0.04) {
            clear += 1;
            shown += usize::from(told(share, share * (1.0 + moved)));
        }
    }
    assert!(across > 500 && clear > 200 && 20 * shown > 19 * clear, "{across} across one, {shown} of {clear} shown");
}

/// Of random points and others beside them: never where their dilations have other topologies.
#[test]
fn random_points_have_the_topology_that_is_shown() {
    let mut random = Random(11);
    let (mut shown, mut compared, mut differ) = (0, 0, 0);
    for round in 0..240 {
        let set: Vec<DVec3> = (0..4 + round % 9).map(|_| 1.6 * vector(&mut random)).collect();
        let moved = [0.003, 0.03, 0.1][round % 3];
        let others: Vec<DVec3> = set.iter().map(|x| *x + moved * vector(&mut random)).collect();
        let made = |points: &Attractor| {
            dilate_unsimplified(points, Radius::new(1.0).unwrap(), Tolerance::new(0.25).unwrap(), &Budget::default()).unwrap()
        };
        let told = is_shown(&points(&set), 1.0, &others);
        shown += usize::from(told);
        let [one, other] = [&set, &others].map(|set| made(&points(set)));
        if one.topology_exact && other.topology_exact {
            let is_same = topology(&one) == topology(&other);
            assert!(!told || is_same, "{round}");
            (compared, differ) = (compared + 1, differ + usize::from(!is_same));
        }
    }
    assert!(shown >= 120 && compared >= 200 && differ >= 5, "{shown} shown, {compared} compared, {differ} differ");
}

/// The points that are found for random systems of maps tell as much as the centres of all small balls around their cells.
#[test]
fn random_systems_have_the_topology_of_small_balls() {
    let mut random = Random(5);
    let (mut shown, mut compared) = (0, 0);
    for round in 0..16 {
        let shape = copies_in_space(&mut random, 3 + round % 2);
        let radius = [6.0, 9.0, 14.0][round % 3];
        let candidates = Candidates::of_roots(&shape);
        let flow = Flow { attractor: &shape, candidates: &candidates, radius, slack: 1e-10, plane: None };
        let told = [0.5, 0.2].into_iter().find_map(|wide| {
            let found = flow.points(wide * radius, 20_000, &Budget::default()).unwrap()?;
            flow.is_that_of(&Figure::of_points(&found), &Budget::default()).unwrap().then_some(found)
        });
        let Some(found) = told else { continue };
        shown += 1;
        let small = 0.02 * radius;
        let Some(balls) = centres(&shape, small, 30_000) else { continue };
        let found: Vec<DVec3> = found.iter().map(|&at| DVec3::from_array(at)).collect();
        // The attractor's dilation is between those of all centres by less and by more.
        let made = |set: &[DVec3], radius: f64| on_coarse_lattice(&points(set), radius, 0.25 * radius);
        let all = [made(&found, radius), made(&balls, radius - small), made(&balls, radius + small)];
        let [own, less, more] = [0, 1, 2].map(|k| topology(&all[k]));
        if all.iter().all(|made| made.topology_exact) && less == more {
            assert_eq!(own, less, "{round}");
            compared += 1;
        }
    }
    assert!(shown >= 5 && compared >= 4, "{shown} shown, {compared} compared");
}

/// Parallel segments, segments across each other, and parallel triangles, each pair as far apart as twice the radius and a little more or less: both parts join there.
#[test]
fn nothing_is_shown_of_figures_where_topologies_differ() {
    let turned = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.7, 1.1);
    let at = |x: f64, y: f64, z: f64| turned * DVec3::new(x, y, z) + DVec3::new(2.0, -1.0, 0.5);
    let parallel = |gap: f64| [[[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0]], [[-1.5, 0.0, gap], [2.5, 0.0, gap]]];
    let across = |gap: f64| [[[-2.0, 0.1, 0.0], [2.0, 0.0, 0.0]], [[0.2, -1.0, gap], [0.0, 2.0, gap]]];
    let place = |[x, y, z]: [f64; 3]| at(x, y, z);
    let pairs = |shape: usize, gap: f64| match shape {
        0 => wires(&parallel(gap).map(|ends| ends.map(place))),
        1 => wires(&across(gap).map(|ends| ends.map(place))),
        _ => triangles(&[0.0, gap].map(|z| [[-2.0, -1.0, z], [2.0, -1.0, z], [0.3, 2.0, z]].map(place))),
    };
    for shape in 0..3 {
        let told = |one: f64, other: f64| is_shown_of(&pairs(shape, 2.0 * one), 1.0, &figures_of(&pairs(shape, 2.0 * other)));
        for moved in [1e-6, 1e-3, 0.05] {
            assert!(!told(1.0 + moved, 1.0 - moved) && !told(1.0 - moved, 1.0 + moved), "{shape}, {moved}");
        }
        assert!(told(1.1, 1.12) && told(0.9, 0.88), "{shape}");
    }
}

/// Of random segments and triangles and others beside them: never where their dilations have other topologies.
#[test]
fn random_figures_have_the_topology_that_is_shown() {
    let mut random = Random(17);
    let (mut shown, mut compared, mut differ) = (0, 0, 0);
    for round in 0..160 {
        let (count, corners) = (3 + round % 5, 2 + round / 2 % 2);
        let moved = [0.003, 0.03, 0.1][round % 3];
        let set: Vec<Vec<DVec3>> = (0..count)
            .map(|_| {
                let middle = 1.6 * vector(&mut random);
                (0..corners).map(|_| middle + vector(&mut random)).collect()
            })
            .collect();
        let others: Vec<Vec<DVec3>> = set.iter().map(|all| all.iter().map(|x| *x + moved * vector(&mut random)).collect()).collect();
        let made = |set: &[Vec<DVec3>]| match corners {
            2 => wires(&set.iter().map(|all| [all[0], all[1]]).collect::<Vec<_>>()),
            _ => triangles(&set.iter().map(|all| [all[0], all[1], all[2]]).collect::<Vec<_>>()),
        };
        let [one, other] = [&set, &others].map(|set| made(set));
        let told = is_shown_of(&one, 0.6, &figures_of(&other));
        shown += usize::from(told);
        let dilated = |shape: &Attractor| {
            dilate_unsimplified(shape, Radius::new(0.6).unwrap(), Tolerance::new(0.1).unwrap(), &Budget::default()).unwrap()
        };
        let [one, other] = [one, other].map(|shape| dilated(&shape));
        if one.topology_exact && other.topology_exact {
            let is_same = topology(&one) == topology(&other);
            assert!(!told || is_same, "{round}");
            (compared, differ) = (compared + 1, differ + usize::from(!is_same));
        }
    }
    assert!(shown >= 80 && compared >= 120 && differ >= 5, "{shown} shown, {compared} compared, {differ} differ");
}

/// Random curves and few segments along them, against many: never where their dilations have other topologies.
#[test]
fn random_curves_have_the_topology_that_is_shown_of_segments() {
    let mut random = Random(23);
    let (mut shown, mut compared, mut differ) = (0, 0, 0);
    for round in 0..90 {
        let points: Vec<DVec3> = (0..9 + round % 4).map(|_| 4.0 * vector(&mut random)).collect();
        let along = |share: f64| {
            let mut left = points.clone();
            while left.len() > 1 {
                left = left.windows(2).map(|pair| pair[0].lerp(pair[1], share)).collect();
            }
            left[0]
        };
        let segments = |count: usize| {
            let place = |k: usize| along(k as f64 / count as f64);
            wires(&(0..count).map(|k| [place(k), place(k + 1)]).collect::<Vec<_>>())
        };
        let radius = [0.2, 0.35, 0.5][round % 3];
        let few = segments([5, 9, 16][round / 3 % 3]);
        let told = is_shown_of(&curve(CurveScheme::Bezier, points.clone(), None), radius, &figures_of(&few));
        shown += usize::from(told);
        let dilated = |shape: &Attractor| {
            let (radius, tolerance) = (Radius::new(radius).unwrap(), Tolerance::new(0.2 * radius).unwrap());
            dilate_unsimplified(shape, radius, tolerance, &Budget::default()).unwrap()
        };
        let [own, reference] = [dilated(&few), dilated(&segments(400))];
        if own.topology_exact && reference.topology_exact {
            let is_same = topology(&own) == topology(&reference);
            assert!(!told || is_same, "{round}");
            (compared, differ) = (compared + 1, differ + usize::from(!is_same));
        }
    }
    assert!(shown >= 30 && compared >= 80 && differ >= 5, "{shown} shown, {compared} compared, {differ} differ");
}

/// The hole of a circle's dilation closes where the radius is the circle's.
#[test]
fn holes_of_circles_are_told_near_to_where_they_close() {
    let root = 0.5_f64.sqrt();
    let corner = |k: usize| {
        let (x, y) = [(1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (-1.0, 1.0), (-1.0, 0.0), (-1.0, -1.0), (0.0, -1.0), (1.0, -1.0), (1.0, 0.0)][k];
        DVec3::new(10.0 * x, 10.0 * y, 0.0)
    };
    // In no plane across an axis: no way of its own serves.
    let turned = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 0.2, -0.3);
    let points: Vec<DVec3> = (0..9).map(|k| turned * corner(k)).collect();
    let weights = (0..9).map(|k| if k % 2 == 0 { 1.0 } else { root }).collect();
    let knots = vec![0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0, 4.0];
    let circle = curve(CurveScheme::Nurbs { degree: 2, knots }, points, Some(weights));
    for (radius, genus) in [(9.0, 1), (9.8, 1), (9.9, 1), (10.01, 0), (10.1, 0)] {
        let made = dilate(&circle, Radius::new(radius).unwrap(), Tolerance::new(1.0).unwrap(), &Budget::default()).unwrap();
        assert!(
            made.topology_exact && made.solid.topology().genus == genus,
            "{radius}: {}, {:?}",
            made.topology_exact,
            made.solid.topology()
        );
    }
}

/// Points, segments, triangles and needles that are as far from a place as the radius, in directions around it: no direction leads away from all, whichever cube the place is in.
#[test]
fn no_direction_serves_a_cube_around_a_critical_place() {
    let mut random = Random(31);
    let attractor = points(&[DVec3::ZERO]);
    let candidates = Candidates::of_roots(&attractor);
    let flow = Flow { attractor: &attractor, candidates: &candidates, radius: 1.0, slack: 1e-12, plane: None };
    let budget = Budget::default();
    let place = DVec3::new(3.0, -2.0, 5.0);
    for round in 0..40_000 {
        // Ways nearly across a direction, the last one the others' sum, turned back: 0 is a mean of all.
        let wanted = if round % 2 == 0 { DVec3::AXES[round / 2 % 3] } else { vector(&mut random).normalize() };
        let across = |random: &mut Random| (vector(random).reject_from(wanted) + 0.1 * random.share() * wanted).normalize();
        let mut ways: Vec<DVec3> = (0..1 + round % 3).map(|_| across(&mut random)).collect();
        ways.push(-ways.iter().sum::<DVec3>().normalize());
        let mut figures = Vec::new();
        for way in &ways {
            let foot = place - *way;
            let [one, other]: [DVec3; 2] = std::array::from_fn(|_| vector(&mut random).reject_from(*way));
            figures.extend(match random.next() % 4 {
                0 => self::figures(&[foot]),
                1 => figures_of(&wires(&[[foot - one, foot + one]])),
                2 => figures_of(&triangles(&[[foot + one, foot + other, foot - one - other]])),
                // Corners on a line, but for rounding: its normal is noise.
                _ => figures_of(&triangles(&[[foot + one, foot - one, foot + 0.3 * one]])),
            });
        }
        let search = flow.search(&figures, usize::MAX, &budget);
        let half = [0.55, 0.3, 0.1, 0.01][round % 4];
        let offset =
            DVec3::from_array(std::array::from_fn(|_| if random.next().is_multiple_of(2) { 0.999 } else { -0.999 * random.share() }));
        let cube = Cube { centre: (place + half * offset).to_array(), half };
        let mut work = Work::default();
        work.lists.others.extend(0..figures.len() as u32);
        let ranges = Ranges { cells: 0..0, others: 0..figures.len() };
        let [low, high] = search.see_others(&mut work, &cube, &ranges);
        assert!(low <= 1.0 && 1.0 <= high && work.others.len() == figures.len(), "{round}");
        let wanted = wanted.to_array();
        let reach = [flow.half(&cube), flow.half_along(&cube, &wanted)];
        assert!(!work.others.iter().all(|view| search.is_left(&cube, view, &wanted, reach)), "{round}: {figures:?}, {cube:?}");
        assert!(!search.have_direction(&work, &cube), "{round}: {figures:?}, {cube:?}");
    }
}

/// Of triangles that are nearly lines rounding tells the normal: what they differ along is no less than their longest side tells.
#[test]
fn spans_of_needles_hold_them() {
    let mut random = Random(37);
    for round in 0..20_000 {
        let (from, way) = (vector(&mut random), vector(&mut random).normalize());
        let high = [0.0, 1e-16, 1e-13, 1e-9, 1e-6, 1e-3][round % 6] * vector(&mut random);
        let figures = figures_of(&triangles(&[[from, from + way, from + random.share() * way + high]]));
        let [a, b, c] = figures[0].corners().try_into().unwrap();
        let across = unit(&cross(&subtract(&b, &a), &subtract(&c, &b)));
        let own = unit(&subtract(&b, &a));
        for direction in [across, unit(&vector(&mut random).to_array())] {
            assert!(figures[0].span().along(&direction) >= dot(&direction, &own).abs(), "{round} {figures:?}");
        }
    }
}
