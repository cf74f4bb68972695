//! Intersections and Hausdorff distances against closed forms, brute force and fine samples.

use crate::oracle::Random;
use glam::{DMat3, DVec3};
use lacuna_kernel::attractor::{Address, Attractor, point_at};
use lacuna_kernel::budget::{Budget, StopReason};
use lacuna_kernel::measure::{
    Contact, ContactError, ContactQuery, Hausdorff, Interval, Primitive, Verdict, hausdorff, intersect, intersect_primitive,
};
use lacuna_kernel::model::{AffineMap, BezierCurve, Ifs, Interior, Model, PolygonMesh, Shape};
use lacuna_kernel::tolerance::Tolerance;

fn attractor(shape: Shape) -> Attractor {
    Model { name: None, shape }.lower().unwrap().attractor
}

fn ifs(maps: Vec<AffineMap>) -> Attractor {
    attractor(Shape::Ifs(Ifs { maps, primitive: None, graph: None }))
}

/// Copies scaled by `ratio`, moved by `ratio` times the corners, all moved by `at`: with the corners at 0 and 1 / ratio - 1,
/// for example, the shape reaches from `at` as far as the whole.
fn scaled(ratio: f64, corners: &[DVec3], at: DVec3) -> Attractor {
    let map = |corner: &DVec3| AffineMap { linear: DMat3::from_diagonal(DVec3::splat(ratio)), translation: *corner + (1.0 - ratio) * at };
    ifs(corners.iter().map(map).collect())
}

const HEIGHT: f64 = 0.866_025_403_784_438_6;

fn sierpinski(side: f64, at: DVec3) -> Attractor {
    scaled(0.5, &[DVec3::ZERO, DVec3::new(0.5 * side, 0.0, 0.0), DVec3::new(0.25 * side, 0.5 * HEIGHT * side, 0.0)], at)
}

/// Four corners of a square, a quarter of its size each.
fn dust(side: f64, at: DVec3) -> Attractor {
    let far = 0.75 * side;
    scaled(0.25, &[DVec3::ZERO, DVec3::new(far, 0.0, 0.0), DVec3::new(0.0, far, 0.0), DVec3::new(far, far, 0.0)], at)
}

fn cantor(side: f64) -> Attractor {
    scaled(1.0 / 3.0, &[DVec3::ZERO, DVec3::new(2.0 / 3.0 * side, 0.0, 0.0)], DVec3::ZERO)
}

fn menger(side: f64) -> Attractor {
    let corners: Vec<DVec3> = (0..27)
        .map(|k| DVec3::new(f64::from(k % 3), f64::from(k / 3 % 3), f64::from(k / 9)))
        .filter(|c| [c.x, c.y, c.z].iter().filter(|x| **x == 1.0).count() < 2)
        .map(|c| side / 3.0 * c)
        .collect();
    scaled(1.0 / 3.0, &corners, DVec3::ZERO)
}

fn koch(size: f64) -> Attractor {
    let map = |turn: f64, x: f64, y: f64| AffineMap {
        linear: DMat3::from_rotation_z(turn) * (1.0 / 3.0),
        translation: size * DVec3::new(x, y, 0.0),
    };
    let third = std::f64::consts::FRAC_PI_3;
    ifs(vec![map(0.0, 0.0, 0.0), map(third, 1.0 / 3.0, 0.0), map(-third, 0.5, HEIGHT / 3.0), map(0.0, 2.0 / 3.0, 0.0)])
}

fn mesh(vertices: Vec<DVec3>, faces: Vec<Vec<u32>>) -> Attractor {
    attractor(Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Surface }))
}

fn cloud(points: &[DVec3]) -> Attractor {
    mesh(points.to_vec(), (0..points.len() as u32).map(|k| vec![k]).collect())
}

fn bezier(points: &[[f64; 3]]) -> Attractor {
    attractor(Shape::BezierCurve(BezierCurve { control_points: points.iter().copied().map(DVec3::from_array).collect(), weights: None }))
}

fn query(resolution: f64) -> ContactQuery {
    ContactQuery { resolution: Tolerance::new(resolution).unwrap(), most: 100_000 }
}

fn between(a: &Attractor, b: &Attractor, resolution: f64) -> Contact {
    let found = intersect(a, b, &query(resolution), &Budget::default()).unwrap();
    assert!(found.complete && found.distance_mm.width() <= 5.0 * resolution, "{:?}", found.distance_mm);
    found
}

fn with(a: &Attractor, primitive: Primitive, resolution: f64) -> Contact {
    let found = intersect_primitive(a, &primitive, &query(resolution), &Budget::default()).unwrap();
    assert!(found.complete && found.distance_mm.width() <= 5.0 * resolution, "{primitive:?} {:?}", found.distance_mm);
    found
}

fn holds(interval: Interval, exact: f64) {
    assert!(interval.low <= exact && exact <= interval.high, "{exact} is not in {interval:?}");
}

/// Apart by the distance, and no place.
fn apart(found: &Contact, exact: f64) {
    holds(found.distance_mm, exact);
    assert_eq!(found.verdict(), Verdict::Disjoint);
    assert!(found.places.is_empty());
}

/// One place, which holds the point.
fn touches_at(found: &Contact, point: DVec3, verdict: Verdict) {
    assert_eq!((found.places.len(), found.verdict()), (1, verdict), "{found:?}");
    holds(found.distance_mm, 0.0);
    let place = &found.places[0];
    let (low, high) = (DVec3::from_array(place.low), DVec3::from_array(place.high));
    assert!(point.cmpge(low - 1e-9).all() && point.cmple(high + 1e-9).all(), "{point} is not in {place:?}");
    assert_eq!(place.verdict(), verdict);
}

#[test]
fn dusts_and_triangles_at_known_distances() {
    let first = dust(100.0, DVec3::ZERO);
    // The cells reach from 45 to 70 and from 120 on: 5 short of those at 75.
    apart(&between(&first, &dust(100.0, DVec3::new(45.0, 0.0, 0.0)), 0.01), 5.0);
    apart(&between(&first, &dust(100.0, DVec3::new(45.0, 0.0, 12.0)), 0.01), 13.0);
    apart(&between(&first, &dust(100.0, DVec3::new(103.0, 104.0, 0.0)), 0.01), 5.0);
    // At 50 the cells' ends meet at x = 75, in each of the rows: y in a dust of the line.
    let found = between(&first, &dust(100.0, DVec3::new(50.0, 100.0, 0.0)), 0.01);
    touches_at(&found, DVec3::new(75.0, 100.0, 0.0), Verdict::Near);

    let triangle = sierpinski(40.0, DVec3::ZERO);
    touches_at(&between(&triangle, &sierpinski(40.0, DVec3::new(40.0, 0.0, 0.0)), 0.004), DVec3::new(40.0, 0.0, 0.0), Verdict::Near);
    let top = DVec3::new(20.0, 40.0 * HEIGHT, 0.0);
    let line = |origin: DVec3| Primitive::Line { origin: origin.to_array(), direction: [-3.0, 0.0, 0.0] };
    let found = with(&triangle, line(top), 0.004);
    touches_at(&found, top, Verdict::Near);
    assert!(found.places[0].pair.first.prefix.iter().all(|&letter| letter == 2));
    apart(&with(&triangle, line(top + DVec3::new(1e6, 0.3, 0.4)), 0.004), 0.5);
    apart(&with(&triangle, Primitive::Ray { origin: [50.0, 0.0, 0.0], direction: [1.0, 7.0, 0.0] }, 0.004), 10.0);
    // A line across the middle hole, at the height of its lower corner... passes through both flanks.
    let found = with(&triangle, line(DVec3::new(0.0, 10.0 * HEIGHT, 0.0)), 0.004);
    assert!(found.places.len() > 1 && found.verdict() == Verdict::Near);
    // The middle of the hole: its inscribed circle.
    apart(&with(&triangle, Primitive::Point([20.0, 40.0 * HEIGHT / 3.0, 0.0]), 0.004), 40.0 * HEIGHT / 6.0);
}

#[test]
fn koch_under_a_plane_and_menger_around_a_ball() {
    let curve = koch(100.0);
    let top = 100.0 * HEIGHT / 3.0;
    let plane = |offset_mm: f64| Primitive::Plane { normal: [0.0, 2e-200, 0.0], offset_mm };
    touches_at(&with(&curve, plane(top), 0.01), DVec3::new(50.0, top, 0.0), Verdict::Near);
    apart(&with(&curve, plane(top + 1.0), 0.01), 1.0);
    apart(&with(&curve, Primitive::Line { origin: [0.0, top, 3.0], direction: [1.0, 0.0, 0.0] }, 0.01), 3.0);
    assert!(with(&curve, plane(0.5 * top), 0.01).places.len() > 1);

    let sponge = menger(27.0);
    let middle = [13.5; 3];
    let edge = 4.5 * 2.0_f64.sqrt();
    apart(&with(&sponge, Primitive::Ball { centre: middle, radius_mm: 2.0 }, 0.0027), edge - 2.0);
    apart(&with(&sponge, Primitive::Point(middle), 0.0027), edge);
    // A box in the hole is as far from its edges along both axes.
    apart(&with(&sponge, Primitive::AxisBox { low: [12.5; 3], high: [14.5; 3] }, 0.0027), 3.5 * 2.0_f64.sqrt());
    // A line through the tunnel along x.
    apart(&with(&sponge, Primitive::Line { origin: [0.0, 13.5, 12.5], direction: [1.0, 0.0, 0.0] }, 0.0027), 3.5);
    // Everything is within; nothing is refined.
    let found = with(&sponge, Primitive::Ball { centre: middle, radius_mm: 30.0 }, 0.0027);
    assert_eq!((found.verdict(), found.places.len(), found.places[0].pairs), (Verdict::Touching, 1, 1));
    let found = with(&sponge, Primitive::AxisBox { low: [-1.0; 3], high: [28.0; 3] }, 0.0027);
    assert_eq!((found.verdict(), found.places[0].pairs), (Verdict::Touching, 1));
    assert_eq!(found.places[0].low.map(f64::round), [0.0; 3]);
}

#[test]
fn contact_of_curves_and_meshes_is_proven() {
    // y = x (2 - x) / 2 for x in [0, 2], and the plane x = 1/2.
    let parabola = bezier(&[[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [2.0, 0.0, 0.0]]);
    let found = with(&parabola, Primitive::Plane { normal: [5.0, 0.0, 0.0], offset_mm: 0.5 }, 1e-4);
    touches_at(&found, DVec3::new(0.5, 0.375, 0.0), Verdict::Touching);
    // At 0.36 on both flanks, inside of cells.
    let found = with(&parabola, Primitive::Plane { normal: [0.0, 1.0, 0.0], offset_mm: 0.36 }, 1e-4);
    assert!(found.places.len() == 2 && found.places.iter().all(|place| place.verdict() == Verdict::Touching), "{found:?}");
    // Its top, at 1/2, on a plane: no more is proven than that they are near.
    let found = with(&parabola, Primitive::Plane { normal: [0.0, 1.0, 0.0], offset_mm: 0.5 }, 1e-4);
    touches_at(&found, DVec3::new(1.0, 0.5, 0.0), Verdict::Near);
    apart(&with(&parabola, Primitive::Plane { normal: [0.0, 1.0, 0.0], offset_mm: 0.5 + 1e-3 }, 1e-4), 1e-3);
    // The same above: 3 - x (2 - x) / 2, from which the tops are 2 apart.
    let above = bezier(&[[0.0, 3.0, 0.0], [1.0, 2.0, 0.0], [2.0, 3.0, 0.0]]);
    apart(&between(&parabola, &above, 1e-4), 2.0);
    let across = bezier(&[[1.5, -1.0, 0.0], [1.5, 0.0, 0.0], [1.5, 1.0, 0.0]]);
    touches_at(&between(&parabola, &across, 1e-4), DVec3::new(1.5, 0.375, 0.0), Verdict::Near);

    let square = |at: DVec3, tilt: f64| {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, tilt), DVec3::new(0.0, 1.0, tilt)];
        mesh(corners.map(|x| x + at).into(), vec![vec![0, 1, 2], vec![0, 2, 3]])
    };
    let floor = square(DVec3::ZERO, 0.0);
    assert_eq!(between(&floor, &square(DVec3::new(0.25, 1.0, 0.0), 1.0), 0.01).verdict(), Verdict::Touching, "along an edge");
    apart(&between(&floor, &square(DVec3::new(0.25, 1.5, 0.0), 1.0), 0.01), 0.5);
    assert_eq!(between(&floor, &square(DVec3::new(0.25, 0.5, -0.25), 1.0), 0.01).verdict(), Verdict::Touching, "across");
    let needle = |z: f64| Primitive::Segment([[0.25, 0.5, z], [0.25, 0.5, 9.0]]);
    assert_eq!(with(&floor, needle(-1.0), 0.01).verdict(), Verdict::Touching);
    apart(&with(&floor, needle(0.125), 0.01), 0.125);
    assert_eq!(with(&floor, Primitive::Plane { normal: [1.0, 1.0, 1.0], offset_mm: 0.5 }, 0.01).verdict(), Verdict::Touching);
    apart(&with(&floor, Primitive::AxisBox { low: [0.2; 3], high: [0.4; 3] }, 0.01), 0.2);
    let found = with(&floor, Primitive::AxisBox { low: [-0.5, -0.5, -0.1], high: [0.4, 0.4, 0.1] }, 0.01);
    assert_eq!(found.verdict(), Verdict::Touching, "a corner is within");
}

type Distance = Box<dyn Fn(DVec3) -> f64>;

#[test]
fn clouds_against_brute_force() {
    let mut random = Random(11);
    for round in 0..40 {
        let points: Vec<DVec3> = (0..60).map(|_| random.point(10.0) + DVec3::splat(f64::from(round % 4) * 8.0)).collect();
        let shape = cloud(&points);
        let (p, q) = (random.point(14.0), random.point(14.0));
        let along = (q - p).normalize();
        let (low, high) = (p.min(q), p.max(q));
        let to_ray = move |x: DVec3, least: f64, most: f64| x.distance(p + along * (x - p).dot(along).clamp(least, most));
        let cases: Vec<(Primitive, Distance)> = vec![
            (Primitive::Point(p.to_array()), Box::new(move |x| x.distance(p))),
            (Primitive::Segment([p.to_array(), q.to_array()]), Box::new(move |x| to_ray(x, 0.0, p.distance(q)))),
            (Primitive::Ray { origin: p.to_array(), direction: (q - p).to_array() }, Box::new(move |x| to_ray(x, 0.0, f64::INFINITY))),
            (
                Primitive::Line { origin: p.to_array(), direction: (p - q).to_array() },
                Box::new(move |x| to_ray(x, f64::NEG_INFINITY, f64::INFINITY)),
            ),
            (Primitive::Plane { normal: (q - p).to_array(), offset_mm: 3.0 }, Box::new(move |x| (x.dot(along) - 3.0).abs())),
            (Primitive::AxisBox { low: low.to_array(), high: high.to_array() }, Box::new(move |x| x.distance(x.clamp(low, high)))),
            (Primitive::Ball { centre: p.to_array(), radius_mm: 2.5 }, Box::new(move |x| (x.distance(p) - 2.5).max(0.0))),
        ];
        for (primitive, distance) in cases {
            let exact = points.iter().map(|x| distance(*x)).fold(f64::INFINITY, f64::min);
            let found = with(&shape, primitive, 1e-3);
            assert!((found.distance_mm.low - exact).abs() < 1e-9 && (found.distance_mm.high - exact).abs() < 1e-9, "{primitive:?} {exact}");
            if exact == 0.0 {
                assert_eq!(found.verdict(), Verdict::Touching);
            }
            let near = points.iter().filter(|x| distance(**x) <= 1e-3).count();
            assert_eq!(found.places.iter().map(|place| place.pairs).sum::<usize>(), near);
            let nearest = points[found.nearest.first.root];
            assert!((distance(nearest) - exact).abs() < 1e-9);
        }
        let other: Vec<DVec3> = (0..50).map(|_| random.point(12.0)).collect();
        let exact = points.iter().flat_map(|x| other.iter().map(move |y| x.distance(*y))).fold(f64::INFINITY, f64::min);
        let found = between(&shape, &cloud(&other), 1e-3);
        assert!((found.distance_mm.low - exact).abs() < 1e-9 && (found.distance_mm.high - exact).abs() < 1e-9);
    }
}

/// Points of a shape, one for each word of this length: exact points up to rounding.
fn sample(shape: &Attractor, maps: usize, length: u32) -> Vec<DVec3> {
    (0..maps.pow(length))
        .map(|code| {
            let prefix = (0..length).map(|k| code / maps.pow(k) % maps).collect();
            let address = Address { root: 0, prefix, period: vec![0] };
            DVec3::from_array(point_at(shape, &address, &Budget::default()).unwrap().point)
        })
        .collect()
}

fn affine(random: &mut Random, at: DVec3) -> Attractor {
    let map = |random: &mut Random| {
        let turn = DMat3::from_axis_angle(random.point(1.0).normalize_or(DVec3::Z), random.between(0.0, 6.0));
        let stretch = DMat3::from_diagonal(DVec3::new(random.between(0.2, 0.6), random.between(0.1, 0.6), random.between(0.05, 0.5)));
        AffineMap { linear: turn * stretch, translation: random.point(10.0) + at }
    };
    ifs((0..3).map(|_| map(random)).collect())
}

#[test]
fn random_shapes_against_fine_samples() {
    let mut random = Random(3);
    for round in 0..24 {
        let place = random.point(f64::from(round));
        let (a, b) = (affine(&mut random, DVec3::ZERO), affine(&mut random, place));
        let (points, others) = (sample(&a, 3, 6), sample(&b, 3, 6));
        let least = |x: &DVec3, set: &[DVec3]| set.iter().map(|y| x.distance(*y)).fold(f64::INFINITY, f64::min);
        let sampled = points.iter().map(|x| least(x, &others)).fold(f64::INFINITY, f64::min);
        let found = between(&a, &b, 0.02);
        assert!(found.distance_mm.low <= sampled + 1e-9, "{:?} {sampled}", found.distance_mm);
        // Words of length 6 leave less than 0.6^6 of the size, on both shapes.
        let error = 0.6_f64.powi(6) * (a.root_cell(0).ball.radius + b.root_cell(0).ball.radius);
        assert!(found.distance_mm.high >= sampled - 2.0 * error);
        let [low, high] = [found.nearest.distance_mm.low, found.nearest.distance_mm.high];
        let second = found.nearest.second.clone().unwrap();
        let ends =
            [(&a, &found.nearest.first), (&b, &second)].map(|(shape, address)| point_at(shape, address, &Budget::default()).unwrap().point);
        let anchors = DVec3::from_array(ends[0]).distance(DVec3::from_array(ends[1]));
        assert!(low <= anchors + 1e-9 && anchors <= high + 2.0 * (found.nearest.first_cell.radius + found.nearest.second_cell.radius));
        // Every point that a sample proves near lies in a place.
        for x in points.iter().filter(|x| least(x, &others) <= 0.02) {
            let inside = |low: [f64; 3], high: [f64; 3]| {
                x.cmpge(DVec3::from_array(low) - 1e-9).all() && x.cmple(DVec3::from_array(high) + 1e-9).all()
            };
            assert!(found.places.iter().any(|place| inside(place.low, place.high)), "{x}");
        }
        let both = far(&a, &b, 0.2);
        let directed = |from: &[DVec3], to: &[DVec3]| from.iter().map(|x| least(x, to)).fold(0.0, f64::max);
        for (interval, sampled) in [(both.from_first, directed(&points, &others)), (both.from_second, directed(&others, &points))] {
            let Interval { low, high } = interval.distance_mm;
            assert!(low <= sampled + 4.0 * error && high >= sampled - 4.0 * error, "{low} {high} {sampled} {error}");
        }
    }
}

#[test]
fn coincident_shapes_meet_everywhere() {
    let (first, second) = (sierpinski(40.0, DVec3::ZERO), sierpinski(40.0, DVec3::ZERO));
    let found = between(&first, &second, 0.2);
    assert_eq!((found.places.len(), found.verdict()), (1, Verdict::Near));
    assert!(found.places[0].pairs >= 3_usize.pow(7), "{}", found.places[0].pairs);
    for corner in sample(&first, 3, 4) {
        assert!(corner.cmpge(DVec3::from_array(found.places[0].low)).all() && corner.cmple(DVec3::from_array(found.places[0].high)).all());
    }
    // A dust is as many places as it has cells.
    let found = between(&dust(100.0, DVec3::ZERO), &dust(100.0, DVec3::ZERO), 1.2);
    assert_eq!(found.places.len(), 4_usize.pow(3));
}

fn far(a: &Attractor, b: &Attractor, tolerance: f64) -> Hausdorff {
    let found = hausdorff(a, b, Tolerance::new(tolerance).unwrap(), &Budget::default()).unwrap();
    for directed in [found.from_first, found.from_second] {
        assert!(directed.distance_mm.width() <= tolerance, "{directed:?}");
    }
    assert!(found.complete);
    let swapped = hausdorff(b, a, Tolerance::new(tolerance).unwrap(), &Budget::default()).unwrap();
    assert_eq!((swapped.from_first, swapped.from_second), (found.from_second, found.from_first));
    found
}

#[test]
fn hausdorff_distances_of_known_shapes() {
    let segment = |to: f64| mesh(vec![DVec3::ZERO, DVec3::new(to, 0.0, 0.0)], vec![vec![0, 1]]);
    // A segment and its end; a Cantor set's largest hole is a third.
    let found = far(&segment(30.0), &cloud(&[DVec3::ZERO]), 1e-3);
    holds(found.from_first.distance_mm, 30.0);
    holds(found.from_second.distance_mm, 0.0);
    assert!((found.from_first.place.centre[0] - 30.0).abs() <= 1e-3);
    let found = far(&segment(60.0), &cantor(60.0), 1e-3);
    holds(found.from_first.distance_mm, 10.0);
    holds(found.from_second.distance_mm, 0.0);
    holds(found.distance_mm(), 10.0);
    // The largest hole of a Sierpinski triangle, by its inscribed circle.
    let corners = vec![DVec3::ZERO, DVec3::new(40.0, 0.0, 0.0), DVec3::new(20.0, 40.0 * HEIGHT, 0.0)];
    let found = far(&mesh(corners, vec![vec![0, 1, 2]]), &sierpinski(40.0, DVec3::ZERO), 0.02);
    holds(found.from_first.distance_mm, 40.0 * HEIGHT / 6.0);
    holds(found.from_second.distance_mm, 0.0);
    assert!((found.from_first.place.centre[0] - 20.0).abs() < 0.1);
    // A translate: corners are the farthest, and no point is farther than the shift.
    let found = far(&dust(100.0, DVec3::ZERO), &dust(100.0, DVec3::new(-3.0, 0.0, 4.0)), 0.05);
    holds(found.distance_mm(), 5.0);
    holds(far(&sierpinski(40.0, DVec3::ZERO), &sierpinski(40.0, DVec3::ZERO), 0.5).distance_mm(), 0.0);
    // A parabola's chord: its top is 1/2 above.
    let parabola = bezier(&[[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [2.0, 0.0, 0.0]]);
    let found = far(&parabola, &segment(2.0), 1e-5);
    holds(found.from_first.distance_mm, 0.5);
}

/// Solids are what they enclose: cubes about the origin, hollow ones, and surfaces that enclose nothing.
#[test]
fn hausdorff_distances_of_solids() {
    let quads = [[0_u32, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let corners = |half: f64, at: DVec3| {
        (0..8).map(move |k| at + half * (DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)) * 2.0 - 1.0))
    };
    let faces = |first: u32, inward: bool| {
        quads.map(|quad| {
            let quad = quad.map(|corner| corner + first);
            if inward { quad.into_iter().rev().collect() } else { quad.to_vec() }
        })
    };
    let made = |vertices: Vec<DVec3>, faces: Vec<Vec<u32>>, interior: Interior| {
        Model { name: None, shape: Shape::Mesh(PolygonMesh { vertices, faces, interior }) }.lower().unwrap().attractor
    };
    let cube = |half: f64, at: DVec3| made(corners(half, at).collect(), faces(0, false).to_vec(), Interior::Auto);
    let (large, small) = (cube(10.0, DVec3::ZERO), cube(5.0, DVec3::ZERO));
    // The small one lies in the large one, whose corners are the farthest.
    let found = far(&large, &small, 0.25);
    holds(found.from_first.distance_mm, 5.0 * 3.0_f64.sqrt());
    holds(found.from_second.distance_mm, 0.0);
    // The middle of the solid is the farthest from its surface.
    let surface = made(corners(10.0, DVec3::ZERO).collect(), faces(0, false).to_vec(), Interior::Surface);
    let found = far(&large, &surface, 0.25);
    holds(found.from_first.distance_mm, 10.0);
    holds(found.from_second.distance_mm, 0.0);
    assert!(DVec3::from_array(found.from_first.place.centre).length() <= 0.25);
    // A solid with a void: the middle of the void is the farthest.
    let vertices: Vec<DVec3> = corners(10.0, DVec3::ZERO).chain(corners(4.0, DVec3::new(1.0, 0.0, -2.0))).collect();
    let hollow = made(vertices, [faces(0, false), faces(8, true)].concat(), Interior::Auto);
    let found = far(&large, &hollow, 0.25);
    holds(found.from_first.distance_mm, 4.0);
    holds(found.from_second.distance_mm, 0.0);
    // Apart, and a point within.
    holds(far(&small, &cube(5.0, DVec3::new(30.0, 0.0, 0.0)), 0.25).distance_mm(), 30.0);
    let found = far(&cloud(&[DVec3::new(1.0, 2.0, 3.0)]), &small, 0.25);
    holds(found.from_first.distance_mm, 0.0);
    holds(found.from_second.distance_mm, DVec3::new(6.0, 7.0, 8.0).length());
}

#[test]
fn hostile_queries_are_refused() {
    let shape = sierpinski(40.0, DVec3::ZERO);
    let ask = |primitive: Primitive| intersect_primitive(&shape, &primitive, &query(0.1), &Budget::default());
    let (nan, far) = (f64::NAN, 1e200);
    for primitive in [
        Primitive::Point([nan, 0.0, 0.0]),
        Primitive::Point([0.0, f64::INFINITY, 0.0]),
        Primitive::Segment([[0.0; 3], [0.0, far, 0.0]]),
        Primitive::Ray { origin: [0.0; 3], direction: [0.0; 3] },
        Primitive::Line { origin: [0.0; 3], direction: [nan, 1.0, 0.0] },
        Primitive::Line { origin: [-far, 0.0, 0.0], direction: [1.0; 3] },
        Primitive::Plane { normal: [0.0, -0.0, 0.0], offset_mm: 1.0 },
        Primitive::Plane { normal: [f64::INFINITY, 0.0, 0.0], offset_mm: 1.0 },
        Primitive::Plane { normal: [1.0, 0.0, 0.0], offset_mm: nan },
        Primitive::AxisBox { low: [0.0; 3], high: [1.0, -1.0, 1.0] },
        Primitive::Ball { centre: [0.0; 3], radius_mm: -1.0 },
        Primitive::Ball { centre: [0.0; 3], radius_mm: nan },
    ] {
        assert!(matches!(ask(primitive), Err(ContactError::Query { .. })), "{primitive:?}");
    }
    assert!(Tolerance::new(0.0).is_err() && Tolerance::new(f64::NAN).is_err());
    let none = ContactQuery { most: 0, ..query(0.1) };
    assert!(matches!(intersect(&shape, &shape, &none, &Budget::default()), Err(ContactError::Query { name: "most", .. })));
    // Enormous and tiny numbers that are possible give answers that hold.
    for primitive in [
        Primitive::Point([1e149; 3]),
        Primitive::Line { origin: [1e140, -1e149, 0.0], direction: [5e-324, 0.0, 0.0] },
        Primitive::Line { origin: [0.0, 0.0, 1.0], direction: [1e308, 1e308, 0.0] },
        Primitive::Plane { normal: [1e308, -1e308, 1e308], offset_mm: -1e149 },
        Primitive::AxisBox { low: [-1e149; 3], high: [1e149; 3] },
        Primitive::Ball { centre: [0.0; 3], radius_mm: 1e149 },
        Primitive::Segment([[1.0; 3], [1.0; 3]]),
        Primitive::AxisBox { low: [5.0; 3], high: [5.0; 3] },
    ] {
        let found = ask(primitive).unwrap();
        assert!(found.distance_mm.low >= 0.0 && found.distance_mm.low <= found.distance_mm.high && found.distance_mm.high.is_finite());
    }
}

#[test]
fn limits_and_cancellation() {
    let (first, second) = (menger(27.0), menger(27.0));
    let mut budget = Budget::default();
    budget.limits.cells = 5000;
    let found = intersect(&first, &second, &query(0.01), &budget).unwrap();
    assert!(!found.complete);
    holds(found.distance_mm, 0.0);
    let few = ContactQuery { most: 7, ..query(0.5) };
    let found = intersect(&first, &second, &few, &Budget::default()).unwrap();
    assert!(!found.complete && found.places.iter().map(|place| place.pairs).sum::<usize>() <= 7);
    holds(found.distance_mm, 0.0);
    let found = hausdorff(&first, &sierpinski(40.0, DVec3::ZERO), Tolerance::new(1e-6).unwrap(), &budget).unwrap();
    let better = hausdorff(&first, &sierpinski(40.0, DVec3::ZERO), Tolerance::new(0.1).unwrap(), &Budget::default()).unwrap();
    assert!(!found.complete && better.complete);
    for (loose, tight) in [(found.from_first, better.from_first), (found.from_second, better.from_second)] {
        assert!(loose.distance_mm.low <= tight.distance_mm.high && tight.distance_mm.low <= loose.distance_mm.high);
    }
    let mut shallow = Budget::default();
    shallow.limits.depth = 2;
    let found = intersect(&first, &second, &query(0.01), &shallow).unwrap();
    assert!(!found.complete);
    holds(found.distance_mm, 0.0);
    budget.cancel.fire(StopReason::Cancelled);
    assert!(matches!(intersect(&first, &second, &query(0.01), &budget), Err(ContactError::Stopped(_))));
    let tolerance = Tolerance::new(0.1).unwrap();
    assert!(matches!(hausdorff(&first, &second, tolerance, &budget), Err(ContactError::Stopped(_))));
}

#[test]
fn the_answer_is_the_same_every_time_and_grows_with_the_contact() {
    let (first, second) = (koch(100.0), sierpinski(100.0, DVec3::new(0.0, -40.0, 0.0)));
    assert_eq!(between(&first, &second, 0.01), between(&first, &second, 0.01));
    // A single point of contact is as many pairs at every resolution.
    let (left, right) = (sierpinski(40.0, DVec3::ZERO), sierpinski(40.0, DVec3::new(40.0, 0.0, 0.0)));
    for resolution in [1e-1, 1e-3, 1e-5] {
        assert!(between(&left, &right, resolution).places[0].pairs < 100);
    }
}
