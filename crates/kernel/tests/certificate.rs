//! What a result certifies, against brute force that shares no code with the kernel.

use crate::oracle::{Oracle, Random, distance, winding};
use glam::{DMat3, DQuat, DVec3};
use lacuna_kernel::attractor::{Attractor, refine};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::dilation::{Dilation, dilate};
use lacuna_kernel::measure::bounding_box;
use lacuna_kernel::measure::mass::{dilated_area, dilated_volume, mesh_measures, volume_within};
use lacuna_kernel::model::{AffineMap, BezierCurve, CornerCutting, Ifs, Interior, Model, PolygonMesh, Shape};
use lacuna_kernel::tolerance::{Radius, Tolerance};

fn attractor(shape: Shape) -> Attractor {
    Model { name: None, shape }.lower().unwrap().attractor
}

fn mesh(vertices: Vec<DVec3>, faces: Vec<Vec<u32>>) -> Attractor {
    attractor(Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Surface }))
}

fn dilated(attractor: &Attractor, radius: f64, tolerance: f64, threads: usize) -> Dilation {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let (radius, tolerance) = (Radius::new(radius).unwrap(), Tolerance::new(tolerance).unwrap());
    pool.install(|| dilate(attractor, radius, tolerance, &Budget::default())).unwrap()
}

/// Everything that a dilation claims of a shape that an oracle knows; returns it.
fn attack_dilation(name: &str, shape: &Attractor, oracle: &Oracle, radius: f64, tolerance: f64, random: &mut Random) -> Dilation {
    let result = dilated(shape, radius, tolerance, 2);
    let again = dilated(shape, radius, tolerance, 1);
    assert_eq!(result.solid, again.solid, "{name}: threads");
    assert_eq!((result.inner_mm, result.outer_mm, result.leaf_cells), (again.inner_mm, again.outer_mm, again.leaf_cells), "{name}");
    assert!(result.inner_mm <= tolerance && result.outer_mm <= tolerance, "{name}: {} {}", result.inner_mm, result.outer_mm);
    let mesh = result.solid.mesh();
    let topology = result.solid.topology();
    assert!(topology.is_closed_manifold(), "{name}");
    let (least, most) = (radius - result.inner_mm - oracle.astray - 1e-9, radius + result.outer_mm + oracle.uncovered + 1e-9);
    let on_surface = |x: DVec3, what: &str| {
        let d = oracle.distance(x);
        assert!(d >= least && d <= most, "{name}: {what} {x} at {d}, not in [{least}, {most}]");
    };
    let stride = mesh.vertices.len().div_ceil(2500);
    for vertex in mesh.vertices.iter().step_by(stride) {
        on_surface(*vertex, "vertex");
    }
    for _ in 0..2500 {
        let triangle = mesh.triangles[(random.unit() * mesh.triangles.len() as f64) as usize];
        let [a, b, c] = triangle.map(|k| mesh.vertices[k as usize]);
        let (mut u, mut v) = (random.unit(), random.unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        on_surface(a + u * (b - a) + v * (c - a), "point of the surface");
    }
    // Points close to the surface and points anywhere.
    let (low, high) = (result.bounds.low.map(|x| x.low - 2.0 * radius), result.bounds.high.map(|x| x.high + 2.0 * radius));
    let (mut inside, mut outside) = (0, 0);
    for index in 0..160 {
        let x = if index % 2 == 0 {
            mesh.vertices[(random.unit() * mesh.vertices.len() as f64) as usize] + random.point(2.0 * tolerance)
        } else {
            DVec3::from_array(std::array::from_fn(|axis| random.between(low[axis], high[axis])))
        };
        let d = oracle.distance(x);
        // d(x, A) is in [d - uncovered, d + astray].
        if d + oracle.astray < radius - result.inner_mm {
            assert!((winding(mesh, x) - 1.0).abs() < 1e-3, "{name}: {x} at {d} is not inside");
            inside += 1;
        } else if d - oracle.uncovered > radius + result.outer_mm {
            assert!(winding(mesh, x).abs() < 1e-3, "{name}: {x} at {d} is not outside");
            outside += 1;
        }
    }
    assert!(inside > 0 && outside > 0, "{name}: {inside} inside, {outside} outside");
    result
}

/// The box and the evaluation of a shape.
fn attack_evaluation(name: &str, shape: &Attractor, oracle: &Oracle, tolerance: f64) {
    let bounds = lacuna_kernel::measure::bounding_box(shape, &Budget::default()).unwrap();
    let corners = || oracle.simplices.iter().flatten();
    for axis in 0..3 {
        let low = corners().map(|x| x[axis]).fold(f64::INFINITY, f64::min);
        let high = corners().map(|x| x[axis]).fold(f64::NEG_INFINITY, f64::max);
        let (below, above) = (bounds.low[axis], bounds.high[axis]);
        let (least, most) = (oracle.uncovered, oracle.astray);
        // The exact end is in [low - uncovered, low + astray], and likewise above.
        assert!(below.low <= low + most + 1e-12 && below.high >= low - least - 1e-12, "{name}: {low} {below:?}");
        assert!(above.high >= high - most - 1e-12 && above.low <= high + least + 1e-12, "{name}: {high} {above:?}");
    }
    let drawn = refine(shape, Tolerance::new(tolerance).unwrap(), &Budget::default()).unwrap();
    assert!(drawn.deviation_mm <= tolerance * (1.0 + 1e-9) + 1e-9, "{name}: {}", drawn.deviation_mm);
    let at = |k: u32| drawn.vertices[k as usize];
    let mut simplices: Vec<Vec<DVec3>> = drawn.points.iter().map(|&a| vec![at(a)]).collect();
    simplices.extend(drawn.segments.iter().map(|ends| ends.map(at).to_vec()));
    simplices.extend(drawn.triangles.iter().map(|corners| corners.map(at).to_vec()));
    let stride = simplices.len().div_ceil(1000);
    for simplex in simplices.iter().step_by(stride) {
        let middle = simplex.iter().sum::<DVec3>() / simplex.len() as f64;
        let d = oracle.distance(middle);
        assert!(d <= drawn.deviation_mm + oracle.uncovered + 1e-9, "{name}: drawn {middle} is {d} off");
    }
    let stride = oracle.simplices.len().div_ceil(1000);
    for corner in oracle.simplices.iter().step_by(stride).flatten() {
        let d = simplices.iter().map(|simplex| distance(*corner, simplex)).fold(f64::INFINITY, f64::min);
        assert!(d <= drawn.deviation_mm + oracle.astray + 1e-9, "{name}: {corner} is {d} from the drawing");
    }
}

#[test]
fn points_polylines_and_triangles() {
    let mut random = Random(11);
    for (round, corners) in [1, 2, 3, 1, 2, 3].into_iter().enumerate() {
        // Far from the origin, small and large balls.
        let (offset, count) = (random.point([0.0, 3000.0][round % 2]), 3 + round * 2);
        let radius = random.between(0.4, 4.0);
        let vertices: Vec<DVec3> = (0..count * corners).map(|_| offset + random.point(5.0)).collect();
        let faces: Vec<Vec<u32>> =
            (0..count).map(|k| (0..corners).map(|j| if corners == 2 { k + j } else { k * corners + j } as u32).collect()).collect();
        let simplices = faces.iter().map(|face| face.iter().map(|&k| vertices[k as usize]).collect()).collect();
        let oracle = Oracle { simplices, uncovered: 0.0, astray: 0.0 };
        let shape = mesh(vertices, faces);
        let name = format!("{count} simplices of {corners} corners, r {radius}");
        attack_evaluation(&name, &shape, &oracle, 0.1);
        attack_dilation(&name, &shape, &oracle, radius, radius * 0.08, &mut random);
    }
}

/// A slow map next to a fast one: addresses are long, and cells hardly shrink from level to level.
#[test]
fn slow_contraction() {
    let ratio = 0.985;
    let scaled = |s: f64, at: DVec3, shift: f64| AffineMap {
        linear: DMat3::from_diagonal(DVec3::splat(s)),
        translation: at * (1.0 - s) + shift * DVec3::X,
    };
    let at = DVec3::new(100.0, 0.0, 0.0);
    let maps = vec![scaled(ratio, at, 0.0), scaled(0.01, at, 0.1)];
    // Points on a segment: within a gap of one another near its far end.
    let far = 0.1 / 0.99;
    let ends = vec![at, at + far * DVec3::X];
    let gap = far * (1.0 - ratio);
    let oracle = Oracle { simplices: vec![ends], uncovered: 1e-9, astray: gap };
    let shape = attractor(Shape::Ifs(Ifs { maps, primitive: None, graph: None }));
    attack_dilation("slow", &shape, &oracle, 5.0, 0.1, &mut Random(5));
}

/// Hardly any contraction: refinement would be deeper than a thread's stack.
#[test]
fn contraction_by_a_hair_is_refused() {
    for ratio in [0.99, 0.9999, 0.999_999] {
        let map = AffineMap { linear: DMat3::from_diagonal(DVec3::splat(ratio)), translation: DVec3::new(1.0 - ratio, 0.0, 0.0) };
        let other = AffineMap { linear: DMat3::from_diagonal(DVec3::splat(0.3)), translation: DVec3::new(50.0, 0.0, 0.0) };
        let shape = attractor(Shape::Ifs(Ifs { maps: vec![map, other], primitive: None, graph: None }));
        let (radius, tolerance) = (Radius::new(1.0).unwrap(), Tolerance::new(0.1).unwrap());
        let error = dilate(&shape, radius, tolerance, &Budget::default()).unwrap_err();
        assert!(["limit-depth", "limit-cells"].contains(&error.code()), "{ratio}: {error}");
    }
}

/// Symmetric shapes: exact ties everywhere, and repeated points.
#[test]
fn ties_and_repeated_points() {
    let mut vertices = Vec::new();
    for k in 0..27 {
        let x = DVec3::new(f64::from(k % 3), f64::from(k / 3 % 3), f64::from(k / 9)) * 2.0;
        vertices.extend(std::iter::repeat_n(x, 40));
    }
    let simplices = vertices.iter().step_by(40).map(|&x| vec![x]).collect();
    let faces: Vec<Vec<u32>> = (0..vertices.len() as u32).map(|k| vec![k]).collect();
    let oracle = Oracle { simplices, uncovered: 0.0, astray: 0.0 };
    for radius in [0.75, 1.0, 1.05] {
        attack_dilation(&format!("grid, r {radius}"), &mesh(vertices.clone(), faces.clone()), &oracle, radius, 0.08, &mut Random(3));
    }
}

/// Balls and capsules, whose volume and area are known.
#[test]
fn volumes_and_areas_of_known_solids() {
    let pi = std::f64::consts::PI;
    for (radius, length, tolerance) in [(1.0, 0.0, 0.1), (3.0, 7.0, 0.05), (0.5, 20.0, 0.1), (40.0, 1e-3, 2.0)] {
        let ends = vec![DVec3::new(5.0, 6.0, 7.0), DVec3::new(5.0, 6.0, 7.0) + DVec3::new(2.0, -1.0, 2.0) / 3.0 * length];
        let faces = vec![if length == 0.0 { vec![0] } else { vec![0, 1] }];
        let result = dilated(&mesh(ends, faces), radius, tolerance, 2);
        let exact = pi * radius * radius * (4.0 / 3.0 * radius + length);
        let found = dilated_volume(volume_within(result.solid.mesh()), radius, result.inner_mm, result.outer_mm);
        assert!(found.low <= exact && exact <= found.high, "{exact} {found:?}");
        let area = dilated_area(found, radius);
        let exact = pi * radius * (4.0 * radius + 2.0 * length);
        assert!(area.low <= exact && exact <= area.high, "{exact} {area:?}");
    }
}

fn de_casteljau(points: &[(DVec3, f64)], t: f64) -> DVec3 {
    let mut level: Vec<(DVec3, f64)> = points.iter().map(|&(x, w)| (x * w, w)).collect();
    while level.len() > 1 {
        level = level.windows(2).map(|pair| (pair[0].0.lerp(pair[1].0, t), pair[0].1 + (pair[1].1 - pair[0].1) * t)).collect();
    }
    level[0].0 / level[0].1
}

#[test]
fn bezier_curves() {
    let mut random = Random(21);
    for round in 0..6 {
        let count = 3 + round;
        let rational = round % 2 == 1;
        let points: Vec<(DVec3, f64)> =
            (0..count).map(|_| (random.point(6.0), if rational { random.between(1.0, 1.6) } else { 1.0 })).collect();
        let pieces = 3000;
        let samples: Vec<DVec3> = (0..=pieces).map(|k| de_casteljau(&points, f64::from(k) / f64::from(pieces))).collect();
        // |C'| <= n (W/w)^2 max |P_i - P_j| (Floater, 1992): no point of the curve is farther along than half a step.
        let diameter = points.iter().flat_map(|p| points.iter().map(|q| p.0.distance(q.0))).fold(0.0, f64::max);
        let step = (count - 1) as f64 * if rational { 1.6 * 1.6 } else { 1.0 } * diameter / f64::from(pieces);
        let simplices = samples.windows(2).map(<[DVec3]>::to_vec).collect();
        let oracle = Oracle { simplices, uncovered: 0.5 * step, astray: 0.5 * step };
        let shape = attractor(Shape::BezierCurve(BezierCurve {
            control_points: points.iter().map(|p| p.0).collect(),
            weights: rational.then(|| points.iter().map(|p| p.1).collect()),
        }));
        let name = format!("Bezier curve {round}");
        attack_evaluation(&name, &shape, &oracle, 0.1);
        attack_dilation(&name, &shape, &oracle, random.between(0.7, 3.0), 0.15, &mut random);
    }
}

/// Operators of both signs: the curve leaves the hull of its control points.
#[test]
fn signed_corner_cutting() {
    let mut random = Random(31);
    for (a, b) in [(0.25, 0.25), (0.55, -0.05), (-0.05, 0.55), (0.5, -0.02), (0.3, 0.15)] {
        let control: Vec<DVec3> = (0..4).map(|_| random.point(6.0)).collect();
        let mut polygon = control.clone();
        for _ in 0..13 {
            polygon = polygon.windows(2).flat_map(|pair| [pair[0].lerp(pair[1], a), pair[1].lerp(pair[0], b)]).collect();
        }
        // Every cell holds the limit point (b P_0 + a P_1) / (a + b): samples lie on the curve. A cell's part of it is
        // within a few of its diameters (at most 1 + 2 m, and m < 3 here).
        let samples: Vec<DVec3> = polygon.windows(2).map(|pair| (b * pair[0] + a * pair[1]) / (a + b)).collect();
        let longest =
            polygon.windows(3).map(|cell| cell[0].distance(cell[1]).max(cell[1].distance(cell[2])).max(cell[0].distance(cell[2])));
        let uncovered = 7.0 * longest.fold(0.0, f64::max);
        let oracle = Oracle { simplices: samples.iter().map(|&x| vec![x]).collect(), uncovered, astray: 0.0 };
        let shape = attractor(Shape::CornerCutting(CornerCutting { control_points: control, a, b, closed: false }));
        let name = format!("corner cutting {a} {b}, uncovered {uncovered}");
        assert!(uncovered < 0.4, "{name}: the oracle must know");
        attack_evaluation(&name, &shape, &oracle, 0.1);
        attack_dilation(&name, &shape, &oracle, 1.5, 0.2, &mut random);
    }
}

fn random_map(random: &mut Random, most: f64, size: f64) -> AffineMap {
    let axis = (random.point(1.0) + DVec3::splat(1e-3)).normalize();
    let turn = DMat3::from_quat(DQuat::from_axis_angle(axis, random.between(0.0, 6.0)));
    let stretch = DVec3::new(random.between(0.2, most), random.between(0.1, most), random.between(-most, most));
    AffineMap { linear: turn * DMat3::from_diagonal(stretch) * turn.transpose() * turn, translation: random.point(size) }
}

/// All words of a length applied to the first map's fixed point: points of the attractor, which is covered up to
/// `most`^length times its diameter.
fn words(maps: &[AffineMap], most: f64, length: i32) -> Oracle {
    let fixed = (DMat3::IDENTITY - maps[0].linear).inverse() * maps[0].translation;
    let radius = maps.iter().map(|map| (map.linear * fixed + map.translation).distance(fixed)).fold(0.0, f64::max) / (1.0 - most);
    let mut samples = vec![fixed];
    for _ in 0..length {
        samples = maps.iter().flat_map(|map| samples.iter().map(|&x| map.linear * x + map.translation)).collect();
    }
    let uncovered = most.powi(length) * radius;
    Oracle { simplices: samples.into_iter().map(|x| vec![x]).collect(), uncovered, astray: 1e-9 }
}

#[test]
fn random_affine_systems() {
    let mut random = Random(41);
    for round in 0..6 {
        let most = 0.45;
        let maps: Vec<AffineMap> = (0..3).map(|_| random_map(&mut random, most, 5.0)).collect();
        let oracle = words(&maps, most, 7);
        let shape = attractor(Shape::Ifs(Ifs { maps, primitive: None, graph: None }));
        let name = format!("affine system {round}, uncovered {}", oracle.uncovered);
        attack_evaluation(&name, &shape, &oracle, 0.2);
        attack_dilation(&name, &shape, &oracle, random.between(0.8, 2.0), 0.15, &mut random);
    }
}

/// Maps halve towards the corners of a tetrahedron whose coordinates are exact: its box is exact, wherever it lies.
#[test]
fn boxes_hold_far_from_the_origin() {
    for place in [0.0, 1e3, 1e5, 1e6] {
        let corners = [[0.0, 0.0, 0.0], [64.0, 64.0, 0.0], [64.0, 0.0, 64.0], [0.0, 64.0, 64.0]];
        let half = DMat3::from_diagonal(DVec3::splat(0.5));
        let towards = |corner: [f64; 3]| AffineMap { linear: half, translation: 0.5 * (DVec3::splat(place) + DVec3::from_array(corner)) };
        let shape = attractor(Shape::Ifs(Ifs { maps: corners.map(towards).to_vec(), primitive: None, graph: None }));
        let bounds = bounding_box(&shape, &Budget::default()).unwrap();
        for axis in 0..3 {
            for (end, exact) in [(bounds.low[axis], place), (bounds.high[axis], place + 64.0)] {
                assert!(end.low <= exact && exact <= end.high, "at {place}: {exact} is not in {end:?}");
                assert!(end.width() <= 1e-8 + 1e-11 * place, "at {place}: {end:?}");
            }
        }
    }
}

/// Two cubes of edge 2^-10, one of them 131072 mm away: terms of the sum are 2^50 times their result.
#[test]
fn volumes_hold_where_terms_cancel() {
    let edge = 1.0 / 1024.0;
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for place in [0.0, 131_072.0] {
        let first = vertices.len() as u32;
        vertices
            .extend((0..8).map(|k| DVec3::splat(place) + edge * DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2))));
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        faces.extend(sides.map(|side| side.map(|corner| corner + first).to_vec()));
    }
    let shape = attractor(Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Solid }));
    let (volume, area) = mesh_measures(&shape).unwrap();
    let (exact, sides) = (2.0 * edge.powi(3), 12.0 * edge * edge);
    assert!(volume.low <= exact && exact <= volume.high, "{exact} is not in {volume:?}");
    assert!(area.low <= sides && sides <= area.high, "{sides} is not in {area:?}");
}

/// 1 / 1e-310 overflows: such weights are refused, with their place.
#[test]
fn weights_that_overflow_are_refused() {
    let control_points = vec![DVec3::new(10.0, 20.0, 0.0), DVec3::ZERO, DVec3::new(30.0, 0.0, 0.0)];
    let shape = Shape::BezierCurve(BezierCurve { control_points, weights: Some(vec![1e-310, 1.0, 1.0]) });
    let findings = Model { name: None, shape }.lower().unwrap_err();
    assert!(findings.iter().any(|finding| finding.pointer == "/weights/0" && finding.code == "bezier.weights"), "{findings:?}");
}

/// Two cubes that cross, in one mesh: it is closed, but inside and outside are not what its normals say.
#[test]
fn solids_that_cross_themselves_are_refused() {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for place in [0.0, 5.0] {
        let first = vertices.len() as u32;
        vertices
            .extend((0..8).map(|k| DVec3::splat(place) + 10.0 * DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2))));
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        faces.extend(sides.map(|side| side.map(|corner| corner + first).to_vec()));
    }
    let shape = attractor(Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Auto }));
    let (radius, tolerance) = (Radius::new(0.5).unwrap(), Tolerance::new(0.1).unwrap());
    let error = dilate(&shape, radius, tolerance, &Budget::default()).unwrap_err();
    assert_eq!(error.code(), "mesh.inside-undefined", "{error}");
}
