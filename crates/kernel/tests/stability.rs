//! Critical radii against closed forms, an alpha complex by brute force, and Euler numbers of dilated meshes.

use crate::oracle::Random;
use glam::{DMat3, DQuat, DVec3};
use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::budget::{Budget, CancelToken, StopReason};
use lacuna_kernel::dilation::{Change, CriticalRadius, DilationError, Stability, Verdict, dilate, stability};
use lacuna_kernel::model::{AffineMap, Ifs, Interior, Model, PolygonMesh, Shape};
use lacuna_kernel::tolerance::{Radius, Tolerance};

fn attractor(shape: Shape) -> Attractor {
    Model { name: None, shape }.lower().unwrap().attractor
}

fn mesh(vertices: Vec<DVec3>, faces: Vec<Vec<u32>>, interior: Interior) -> Attractor {
    attractor(Shape::Mesh(PolygonMesh { vertices, faces, interior }))
}

fn points(vertices: &[DVec3]) -> Attractor {
    mesh(vertices.to_vec(), (0..vertices.len() as u32).map(|k| vec![k]).collect(), Interior::Surface)
}

/// An iterated function system of maps with one ratio, by their fixed points.
fn similar(ratio: f64, fixed: &[DVec3]) -> Attractor {
    let map = |at: &DVec3| AffineMap { linear: DMat3::from_diagonal(DVec3::splat(ratio)), translation: *at * (1.0 - ratio) };
    attractor(Shape::Ifs(Ifs { maps: fixed.iter().map(map).collect(), primitive: None, graph: None }))
}

fn examined(shape: &Attractor, radius: f64, tolerance: f64, window: [f64; 2]) -> Stability {
    stability(shape, Radius::new(radius).unwrap(), Tolerance::new(tolerance).unwrap(), window, &Budget::default()).unwrap()
}

/// What is known of a critical radius: where, what, how often, and what it adds to the Euler number.
type Known = (f64, Change, u64, i64);

/// Everything that is known is found and proven, and nothing else is.
fn expect(name: &str, found: &Stability, known: &[Known], tolerance: f64) {
    assert_eq!(found.critical.len(), known.len(), "{name}: {found:#?}");
    for (critical, &(radius, change, places, euler)) in found.critical.iter().zip(known) {
        let [low, high] = critical.radius_mm;
        assert!(low <= radius && radius <= high && high - low <= tolerance, "{name}: {radius} in {critical:?}");
        assert_eq!((critical.change, critical.places, critical.euler), (change, places, Some(euler)), "{name} at {radius}");
        assert!(critical.proven, "{name} at {radius}");
    }
}

fn cube(half: f64) -> (Vec<DVec3>, Vec<Vec<u32>>) {
    let corner = |k: u32| half * DVec3::new(f64::from(2 * (k & 1)) - 1.0, f64::from(2 * (k >> 1 & 1)) - 1.0, f64::from(2 * (k >> 2)) - 1.0);
    let faces = vec![vec![0, 2, 3, 1], vec![4, 5, 7, 6], vec![0, 1, 5, 4], vec![2, 6, 7, 3], vec![0, 4, 6, 2], vec![1, 3, 7, 5]];
    ((0..8).map(corner).collect(), faces)
}

fn tetrahedron(edge: f64) -> Vec<DVec3> {
    let scale = edge / 8.0_f64.sqrt();
    [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].map(|x| scale * DVec3::from_array(x)).to_vec()
}

#[test]
fn regular_point_sets() {
    use Change::{Closes, Fills, Joins};
    let third = 3.0_f64.sqrt();
    let (e, window) = (0.02, [0.3, 3.0]);
    let turned = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.4);
    for (round, turn) in [DQuat::IDENTITY, turned].into_iter().enumerate() {
        let moved =
            |list: Vec<DVec3>| -> Vec<DVec3> { list.into_iter().map(|x| turn * x + round as f64 * DVec3::new(3.0, 50.0, -7.0)).collect() };
        let cases: Vec<(&str, Vec<DVec3>, f64, Vec<Known>)> = vec![
            ("two points", vec![DVec3::ZERO, 2.0 * DVec3::X], 1.0, vec![(1.0, Joins, 1, -1)]),
            (
                "equilateral triangle",
                vec![DVec3::ZERO, 2.0 * DVec3::X, DVec3::new(1.0, third, 0.0)],
                1.0,
                vec![(1.0, Joins, 3, -3), (2.0 / third, Closes, 1, 1)],
            ),
            (
                "square",
                vec![DVec3::ZERO, 2.0 * DVec3::X, DVec3::new(2.0, 2.0, 0.0), 2.0 * DVec3::Y],
                1.0,
                vec![(1.0, Joins, 4, -4), (2.0_f64.sqrt(), Closes, 1, 1)],
            ),
            (
                "regular tetrahedron",
                tetrahedron(2.0),
                1.0,
                vec![(1.0, Joins, 6, -6), (2.0 / third, Closes, 4, 4), (6.0_f64.sqrt() / 2.0, Fills, 1, -1)],
            ),
            ("corners of a cube", cube(1.0).0, 1.0, vec![(1.0, Joins, 12, -12), (2.0_f64.sqrt(), Closes, 6, 6), (third, Fills, 1, -1)]),
        ];
        for (name, list, join, known) in cases {
            let found = examined(&points(&moved(list)), 0.8, e, window);
            expect(name, &found, &known, e);
            assert_eq!(found.verdict, Verdict::Stable, "{name}");
            assert_eq!(found.examined_mm, [0.3, found.examined_mm[1]], "{name}");
            assert!(found.one_piece_mm[0] <= join && join <= found.one_piece_mm[1], "{name}");
            assert!(found.one_piece_mm[1] - found.one_piece_mm[0] <= e, "{name}");
        }
    }
}

#[test]
fn verdicts_and_neighbours() {
    let shape = points(&[DVec3::ZERO, 2.0 * DVec3::X, DVec3::new(1.0, 3.0_f64.sqrt(), 0.0)]);
    let verdict = |radius: f64, e: f64| examined(&shape, radius, e, [0.5 * radius, 2.0 * radius]).verdict;
    assert_eq!(verdict(0.9, 0.05), Verdict::Stable);
    assert_eq!(verdict(1.0, 0.05), Verdict::Unstable);
    assert_eq!(verdict(1.07, 0.05), Verdict::Stable);
    assert_eq!(verdict(1.15, 0.05), Verdict::Unstable);
    assert_eq!(verdict(1.3, 0.05), Verdict::Stable);
    // A join and a closing together leave the Euler number, not the number of pieces.
    let (radius, tolerance) = (Radius::new(1.07).unwrap(), Tolerance::new(0.02).unwrap());
    let found = stability(&shape, radius, tolerance, [0.5, 2.0], &Budget::default()).unwrap();
    let [below, above] = found.neighbours(radius, tolerance);
    assert!((below.unwrap().radius_mm[0] - 1.0).abs() < 0.02 && below.unwrap().change == Change::Joins);
    assert!((above.unwrap().radius_mm[0] - 2.0 / 3.0_f64.sqrt()).abs() < 0.02 && above.unwrap().change == Change::Closes);
}

#[test]
fn wires_and_surfaces() {
    use Change::{Closes, Fills, Joins};
    let e = 0.02;
    // Two parallel segments: a whole segment of critical points.
    let ends = vec![DVec3::ZERO, 3.0 * DVec3::X, 2.0 * DVec3::Y, DVec3::new(3.0, 2.0, 0.0)];
    let found = examined(&mesh(ends, vec![vec![0, 1], vec![2, 3]], Interior::Surface), 0.8, e, [0.4, 1.6]);
    expect("parallel segments", &found, &[(1.0, Joins, 1, -1)], e);
    assert!(found.one_piece_mm[0] <= 1.0 && 1.0 <= found.one_piece_mm[1]);
    // A polygon of 24 sides around a circle of radius 1.
    let count = 24;
    let corner = |k: u32| {
        let angle = std::f64::consts::TAU * f64::from(k) / f64::from(count);
        DVec3::new(angle.cos(), angle.sin(), 0.0) / (std::f64::consts::PI / f64::from(count)).cos()
    };
    let sides = (0..count).map(|k| vec![k, (k + 1) % count]).collect();
    let found = examined(&mesh((0..count).map(corner).collect(), sides, Interior::Surface), 0.8, e, [0.4, 1.6]);
    expect("ring", &found, &[(1.0, Closes, 1, 1)], e);
    assert!(found.one_piece_mm[0] == 0.0 && found.one_piece_mm[1] < e);
    // The surface of a cube, and the cube.
    let (vertices, faces) = cube(1.0);
    let found = examined(&mesh(vertices.clone(), faces.clone(), Interior::Surface), 0.8, e, [0.4, 1.6]);
    expect("hollow cube", &found, &[(1.0, Fills, 1, -1)], e);
    let found = examined(&mesh(vertices, faces, Interior::Solid), 0.8, e, [0.4, 1.6]);
    expect("cube", &found, &[], e);
    assert_eq!((found.verdict, found.one_piece_mm[0]), (Verdict::Stable, 0.0));
}

/// Two cubes as solids, one piece from half their gap on, and a point inside of one, which is no piece.
#[test]
fn solids() {
    let (mut vertices, mut faces) = cube(1.0);
    let (others, more) = cube(1.0);
    vertices.extend(others.into_iter().map(|x| x + DVec3::new(3.0, 0.0, 0.0)));
    faces.extend(more.into_iter().map(|face| face.into_iter().map(|k| k + 8).collect::<Vec<u32>>()));
    let pair = mesh(vertices, faces, Interior::Solid);
    let found = examined(&pair, 0.4, 0.02, [0.2, 1.0]);
    expect("two cubes", &found, &[(0.5, Change::Joins, 1, -1)], 0.02);
    assert!(found.one_piece_mm[0] <= 0.5 && 0.5 <= found.one_piece_mm[1] && found.one_piece_mm[0] > 0.49);
}

#[test]
fn holes_of_fractals() {
    // Holes of the Sierpinski triangle: 3^(k - 1) triangles of edge L / 2^k, closed at their inradius edge / (2 sqrt 3).
    let corners: Vec<DVec3> = [0.0, 1.0, 2.0]
        .map(|k: f64| DVec3::new((k * std::f64::consts::TAU / 3.0).cos(), (k * std::f64::consts::TAU / 3.0).sin(), 0.0))
        .to_vec();
    let edge = 3.0_f64.sqrt();
    let inradius = |k: i32| edge / f64::from(1 << k) / (2.0 * 3.0_f64.sqrt());
    let found = examined(&similar(0.5, &corners), 0.1, 0.004, [0.05, 0.4]);
    expect(
        "Sierpinski triangle",
        &found,
        &[(inradius(3), Change::Closes, 9, 9), (inradius(2), Change::Closes, 3, 3), (inradius(1), Change::Closes, 1, 1)],
        0.004,
    );
    assert!(found.one_piece_mm[0] == 0.0 && found.one_piece_mm[1] < 0.004, "{found:?}");
    // Cantor dust on a line, with ratio 1/4: gaps of 1/2, and of 1/8 twice.
    let found = examined(&similar(0.25, &[DVec3::ZERO, DVec3::X]), 0.1, 0.004, [0.05, 0.4]);
    expect("Cantor dust", &found, &[(1.0 / 16.0, Change::Joins, 2, -2), (0.25, Change::Joins, 1, -1)], 0.004);
    assert!(found.one_piece_mm[0] <= 0.25 && 0.25 <= found.one_piece_mm[1] && found.one_piece_mm[1] - found.one_piece_mm[0] < 0.004);
}

/// The determinant's rule for up to three unknowns is enough here: weights of the circumcentre, by Gaussian elimination without tricks.
fn circumcentre(corners: &[DVec3]) -> Option<(DVec3, Vec<f64>)> {
    let sides: Vec<DVec3> = corners[1..].iter().map(|x| *x - corners[0]).collect();
    let n = sides.len();
    let mut rows: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| sides[i].dot(sides[j])).chain([0.5 * sides[i].length_squared()]).collect()).collect();
    for k in 0..n {
        let pivot = rows[k].clone();
        if pivot[k].abs() < 1e-12 {
            return None;
        }
        for (i, row) in rows.iter_mut().enumerate().filter(|(i, _)| *i != k) {
            let factor = row[k] / pivot[k];
            assert!(i < n);
            row.iter_mut().zip(&pivot).for_each(|(a, b)| *a -= factor * b);
        }
    }
    let weights: Vec<f64> = (0..n).map(|k| rows[k][n] / rows[k][k]).collect();
    let centre = corners[0] + sides.iter().zip(&weights).map(|(side, weight)| *side * *weight).sum::<DVec3>();
    let first = 1.0 - weights.iter().sum::<f64>();
    Some((centre, [vec![first], weights].concat()))
}

/// Critical values of the distance to points in general position, with their indices: circumradii of the simplices of the alpha complex
/// that hold their circumcentres (Edelsbrunner's critical simplices). All subsets are tried.
fn critical_values(list: &[DVec3]) -> Vec<(f64, usize)> {
    let mut values = Vec::new();
    for subset in 1_u32..1 << list.len() {
        if !(2..=4).contains(&subset.count_ones()) {
            continue;
        }
        let corners: Vec<DVec3> = (0..list.len()).filter(|k| subset >> k & 1 == 1).map(|k| list[k]).collect();
        let Some((centre, weights)) = circumcentre(&corners) else { continue };
        let radius = centre.distance(corners[0]);
        let is_empty = (0..list.len()).filter(|k| subset >> k & 1 == 0).all(|k| list[k].distance(centre) > radius);
        if is_empty && weights.iter().all(|&weight| weight > 0.0) {
            values.push((radius, corners.len() - 1));
        }
    }
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    values
}

fn sign(index: usize) -> i64 {
    if index.is_multiple_of(2) { 1 } else { -1 }
}

#[test]
fn random_points_against_the_alpha_complex() {
    let mut random = Random(2024);
    let (mut met, mut unproven, mut entries, mut fills) = (0, 0, 0, 0);
    for round in 0..40 {
        let list: Vec<DVec3> = (0..4 + round % 7).map(|_| random.point(1.0)).collect();
        let (radius, e, window) = (0.5, 0.02, [0.15, 2.0]);
        let found = examined(&points(&list), radius, e, window);
        let known = critical_values(&list);
        assert_eq!(found.examined_mm[0], window[0]);
        let holds = |interval: &[f64; 2], value: f64| interval[0] <= value && value <= interval[1];
        for &(value, index) in known.iter().filter(|(value, _)| holds(&found.examined_mm, *value)) {
            assert!(found.critical.iter().any(|critical| holds(&critical.radius_mm, value)), "round {round}: {value} of index {index}");
            met += 1;
            fills += usize::from(index == 3);
        }
        // Values outside of the window may be in intervals that end in it.
        for critical in &found.critical {
            entries += 1;
            unproven += usize::from(!critical.proven);
            let inside: Vec<_> = known.iter().filter(|(value, _)| holds(&critical.radius_mm, *value)).collect();
            if critical.proven {
                assert!(!inside.is_empty(), "round {round}: {critical:?} {known:?}");
                let index = match critical.change {
                    Change::Joins => 1,
                    Change::Closes => 2,
                    Change::Fills => 3,
                    Change::Unclear => continue,
                };
                assert!(inside.iter().any(|known| known.1 == index), "round {round}: {critical:?} {inside:?}");
            }
        }
        let within: i64 = known.iter().filter(|(value, _)| holds(&window, *value)).map(|known| sign(known.1)).sum();
        let is_cut = |critical: &CriticalRadius| critical.radius_mm[0] < window[0] || critical.radius_mm[1] > window[1];
        if found.critical.iter().all(|critical| critical.euler.is_some() && !is_cut(critical)) {
            let sum: i64 = found.critical.iter().filter_map(|critical| critical.euler).sum();
            assert_eq!(sum, within, "round {round}: {found:?} {known:?}");
        }
        // The verdict.
        let changes: Vec<_> = known.iter().filter(|(value, _)| (value - radius).abs() < e).collect();
        match found.verdict {
            Verdict::Stable => assert!(changes.is_empty(), "round {round}: {changes:?}"),
            Verdict::Unstable => assert!(!changes.is_empty(), "round {round}"),
            Verdict::Unresolved => {}
        }
        // Prim's tree.
        let mut nearest: Vec<f64> = list.iter().map(|x| x.distance(list[0])).collect();
        let (mut done, mut longest) = (vec![0], 0.0_f64);
        while done.len() < list.len() {
            let next = (0..list.len()).filter(|k| !done.contains(k)).min_by(|&a, &b| nearest[a].total_cmp(&nearest[b])).unwrap();
            longest = longest.max(nearest[next]);
            done.push(next);
            nearest.iter_mut().zip(&list).for_each(|(least, x)| *least = least.min(x.distance(list[next])));
        }
        assert!(holds(&found.one_piece_mm, 0.5 * longest) && found.one_piece_mm[1] - found.one_piece_mm[0] < e, "round {round}");
    }
    assert!(met > 300 && fills > 10, "{met} {fills}");
    assert!(unproven * 20 <= entries, "{unproven} of {entries} are not proven");
}

/// Half of the Euler number of the boundary is that of the solid.
fn euler_of_dilation(shape: &Attractor, radius: f64) -> i64 {
    let tolerance = Tolerance::new(0.03 * radius).unwrap();
    let result = dilate(shape, Radius::new(radius).unwrap(), tolerance, &Budget::default()).unwrap();
    let mesh = result.solid.mesh();
    let used: std::collections::BTreeSet<u32> = mesh.triangles.iter().flatten().copied().collect();
    (used.len() as i64 - mesh.triangles.len() as i64 / 2) / 2
}

/// The Euler numbers of meshes at two radii differ by what is proven to happen between them.
#[test]
fn random_wires_and_triangles_against_meshes() {
    let mut random = Random(77);
    let (mut compared, mut changed) = (0, 0);
    for round in 0..16 {
        let (mut vertices, mut faces) = (Vec::new(), Vec::new());
        for part in 0..4 {
            let (first, size) = (vertices.len() as u32, 1 + (part + round) % 3);
            let at = random.point(1.0);
            vertices.extend((0..size).map(|_| at + random.point(0.7)));
            faces.push((first..first + size).collect::<Vec<u32>>());
        }
        let shape = mesh(vertices, faces, Interior::Surface);
        let ends = [0.25, 0.6];
        let found = examined(&shape, 0.4, 0.02, [ends[0] - 0.03, ends[1] + 0.03]);
        // The mesh has the topology of some dilation within its tolerance: no radius there may be critical.
        let apart = |radius: f64| {
            let clear = |critical: &CriticalRadius| critical.radius_mm[1] < radius - 0.02 || critical.radius_mm[0] > radius + 0.02;
            found.critical.iter().all(clear)
        };
        if !ends.into_iter().all(apart) {
            continue;
        }
        let between = found.critical.iter().filter(|critical| critical.radius_mm[0] > ends[0] && critical.radius_mm[1] < ends[1]);
        let Some(change) = between.map(|critical| critical.euler).sum::<Option<i64>>() else { continue };
        let [before, after] = ends.map(|radius| euler_of_dilation(&shape, radius));
        assert_eq!(after - before, change, "round {round}: {found:?}");
        compared += 1;
        changed += usize::from(change != 0);
    }
    assert!(compared >= 8 && changed >= 4, "{compared} compared, {changed} changed");
}

#[test]
fn equivariance_threads_and_stop() {
    let mut random = Random(5);
    let list: Vec<DVec3> = (0..9).map(|_| random.point(1.0)).collect();
    let faces: Vec<Vec<u32>> = vec![vec![0, 1, 2], vec![3, 4], vec![5], vec![6, 7, 8]];
    let lowered = |list: &[DVec3]| mesh(list.to_vec(), faces.clone(), Interior::Surface);
    let base = examined(&lowered(&list), 0.4, 0.02, [0.2, 0.8]);
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -0.2, 2.0);
    let scale = 37.0;
    let moved: Vec<DVec3> = list.iter().map(|x| scale * (turn * *x) + DVec3::new(100.0, -40.0, 7.0)).collect();
    let other = examined(&lowered(&moved), 0.4 * scale, 0.02 * scale, [0.2 * scale, 0.8 * scale]);
    let proven =
        |found: &Stability| found.critical.iter().filter(|critical| critical.proven).map(|c| (c.radius_mm, c.change)).collect::<Vec<_>>();
    for (from, to, factor) in [(&base, &other, scale), (&other, &base, 1.0 / scale)] {
        for (interval, _) in proven(from) {
            let scaled = interval.map(|x| x * factor);
            let meets = |critical: &CriticalRadius| critical.radius_mm[0] <= scaled[1] && scaled[0] <= critical.radius_mm[1];
            assert!(to.critical.iter().any(meets), "{interval:?} {to:?}");
        }
    }
    assert!(!proven(&base).is_empty());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(pool.install(|| examined(&lowered(&list), 0.4, 0.02, [0.2, 0.8])), base);
    let cancel = CancelToken::new();
    cancel.fire(StopReason::Cancelled);
    let budget = Budget { cancel, ..Budget::default() };
    let stopped = stability(&lowered(&list), Radius::new(0.4).unwrap(), Tolerance::new(0.02).unwrap(), [0.2, 0.8], &budget);
    assert!(matches!(stopped, Err(DilationError::Stopped(_))));
}
