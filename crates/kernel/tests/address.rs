//! The address function both ways, against closed forms and against itself.

use crate::oracle::Random;
use glam::{DMat3, DVec2, DVec3};
use lacuna_kernel::attractor::{Address, AddressError, Attractor, Location, NearQuery, Neighbourhood, addresses_near, point_at};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::model::{AffineMap, BezierCurve, CornerCutting, Ifs, Interior, Model, PolygonMesh, Shape};
use lacuna_kernel::tolerance::Tolerance;

fn attractor(shape: Shape) -> Attractor {
    Model { name: None, shape }.lower().unwrap().attractor
}

/// Plane maps ((a, b), (c, d)) x + (e, f), lengths in units of `size` mm.
fn plane(size: f64, maps: &[[f64; 6]], graph: Option<Vec<Vec<usize>>>) -> Attractor {
    let map = |m: &[f64; 6]| AffineMap {
        linear: DMat3::from_cols(DVec3::new(m[0], m[2], 0.0), DVec3::new(m[1], m[3], 0.0), DVec3::ZERO),
        translation: size * DVec3::new(m[4], m[5], 0.0),
    };
    attractor(Shape::Ifs(Ifs { maps: maps.iter().map(map).collect(), primitive: None, graph }))
}

/// The complex map z -> (a + bi) z + (c + di).
fn complex(a: f64, b: f64, c: f64, d: f64) -> [f64; 6] {
    [a, -b, b, a, c, d]
}

fn koch(size: f64) -> Attractor {
    let (third, height) = (1.0 / 3.0, 3.0_f64.sqrt() / 6.0);
    plane(
        size,
        &[
            complex(third, 0.0, 0.0, 0.0),
            complex(third / 2.0, height, third, 0.0),
            complex(third / 2.0, -height, 0.5, height),
            complex(third, 0.0, 2.0 * third, 0.0),
        ],
        None,
    )
}

fn takagi(size: f64) -> Attractor {
    plane(size, &[[0.5, 0.0, 0.5, 0.5, 0.0, 0.0], [0.5, 0.0, -0.5, 0.5, 0.5, 0.5]], None)
}

fn at(attractor: &Attractor, text: &str) -> Result<Location, AddressError> {
    point_at(attractor, &text.parse()?, &Budget::default())
}

/// The exact point lies within the bound of the one that is told, and the bound is small.
fn check(attractor: &Attractor, size: f64, text: &str, exact: DVec2) {
    let found = at(attractor, text).unwrap();
    let off = DVec3::from_array(found.point).distance(exact.extend(0.0));
    // The closed form is rounded too, and so are the maps' entries: a few units in the last place.
    assert!(
        off <= found.bound_mm + 8.0 * f64::EPSILON * size,
        "{text}: {:?} is {off:e} from {exact}, bound {:e}",
        found.point,
        found.bound_mm
    );
    assert!(found.bound_mm <= 1e-12 * size, "{text}: bound {:e}", found.bound_mm);
    assert_eq!(found.address.to_string(), text);
}

#[test]
fn corners_of_koch_takagi_and_dragon() {
    let curve = koch(100.0);
    let height = 100.0 * 3.0_f64.sqrt() / 6.0;
    // Ends of the base; both halves meet at the top; the period 0 3 is z = z/9 + 2/9.
    check(&curve, 100.0, "0: (0)", DVec2::ZERO);
    check(&curve, 100.0, "0: (3)", DVec2::new(100.0, 0.0));
    check(&curve, 100.0, "0: 1 (3)", DVec2::new(50.0, height));
    check(&curve, 100.0, "0: 2 (0)", DVec2::new(50.0, height));
    check(&curve, 100.0, "0: (0 3)", DVec2::new(25.0, 0.0));
    // The fixed point of map 1: (1/3) / (1 - e^(i pi/3)/3).
    let denominator = DVec2::new(1.0 - 1.0 / 6.0, -3.0_f64.sqrt() / 6.0);
    let fixed = DVec2::new(denominator.x, -denominator.y) / denominator.length_squared() * (100.0 / 3.0);
    check(&curve, 100.0, "0: (1)", fixed);

    // Takagi's function at 1/3, 1/2 and 1/5 is 2/3, 1/2 and 8/15: its series is geometric there.
    let curve = takagi(30.0);
    check(&curve, 30.0, "0: (0 1)", DVec2::new(10.0, 20.0));
    check(&curve, 30.0, "0: 0 (1)", DVec2::new(15.0, 15.0));
    check(&curve, 30.0, "0: 1 (0)", DVec2::new(15.0, 15.0));
    check(&curve, 30.0, "0: (0 0 1 1)", DVec2::new(6.0, 16.0));

    // Heighway's dragon: the fixed points 0, 2/(3 - i), and (1 + i)/3 of the product of both maps.
    let dragon = plane(60.0, &[complex(0.5, 0.5, 0.0, 0.0), complex(-0.5, 0.5, 1.0, 0.0)], None);
    check(&dragon, 60.0, "0: (0)", DVec2::ZERO);
    check(&dragon, 60.0, "0: 1 (0)", DVec2::new(60.0, 0.0));
    check(&dragon, 60.0, "0: (1)", DVec2::new(36.0, 12.0));
    check(&dragon, 60.0, "0: (0 1)", DVec2::new(20.0, 20.0));
}

/// Letters of t = count / (2^length - 1) in binary: the period of t under t/2, (t+1)/2.
fn binary(count: u64, length: usize) -> String {
    let digits: Vec<String> = (0..length).rev().map(|k| (count >> k & 1).to_string()).collect();
    format!("({})", digits.join(" "))
}

#[test]
fn parameters_of_curves_are_addresses() {
    let points = [DVec3::ZERO, DVec3::new(1.0, 2.0, 0.0), DVec3::new(2.0, 0.0, 0.0)];
    let parabola = attractor(Shape::BezierCurve(BezierCurve { control_points: points.to_vec(), weights: None }));
    check(&parabola, 2.0, "0: (0 1)", DVec2::new(2.0 / 3.0, 8.0 / 9.0));
    check(&parabola, 2.0, "0: 0 (1)", DVec2::new(1.0, 1.0));

    // A rational quarter of a circle of radius 30, by the Bernstein form.
    let weights = vec![1.0, std::f64::consts::FRAC_1_SQRT_2, 1.0];
    let quarter = vec![DVec3::new(30.0, 0.0, 0.0), DVec3::new(30.0, 30.0, 0.0), DVec3::new(0.0, 30.0, 0.0)];
    let arc = attractor(Shape::BezierCurve(BezierCurve { control_points: quarter.clone(), weights: Some(weights.clone()) }));
    for (count, length) in [(1, 2), (1, 3), (5, 3), (11, 5), (12345, 17), (1, 40)] {
        let t = count as f64 / ((1_u64 << length) - 1) as f64;
        let basis = [(1.0 - t).powi(2) * weights[0], 2.0 * t * (1.0 - t) * weights[1], t * t * weights[2]];
        let exact = (0..3).map(|k| basis[k] * quarter[k]).sum::<DVec3>() / basis.iter().sum::<f64>();
        check(&arc, 30.0, &format!("0: {}", binary(count, length)), exact.truncate());
        let found = at(&arc, &binary(count, length)).unwrap();
        assert!((DVec3::from_array(found.point).length() - 30.0).abs() <= found.bound_mm + 1e-14 * 30.0);
    }
}

#[test]
fn signed_operators_and_long_words() {
    // The curve of three points runs from (b P0 + a P1)/(a + b) to (b P1 + a P2)/(a + b).
    let (a, b) = (-0.1, 0.4);
    let points = [DVec3::new(0.0, 0.0, 0.0), DVec3::new(10.0, 0.0, 0.0), DVec3::new(10.0, 10.0, 0.0)];
    let curve = attractor(Shape::CornerCutting(CornerCutting { control_points: points.to_vec(), a, b, closed: false }));
    check(&curve, 10.0, "0: (0)", ((b * points[0] + a * points[1]) / (a + b)).truncate());
    check(&curve, 10.0, "0: (1)", ((b * points[1] + a * points[2]) / (a + b)).truncate());
    // Two children meet at the end of the first.
    check(&curve, 10.0, "0: 0 (1)", DVec3::from_array(at(&curve, "1 (0)").unwrap().point).truncate());
    // Words of the greatest length do not lose digits.
    let long = format!("0:{} (1)", " 0 1".repeat(2047));
    let short = at(&curve, "(0 1)").unwrap();
    check(&curve, 10.0, &long, DVec3::from_array(short.point).truncate());
}

#[test]
fn an_infinite_word_has_one_point_however_it_is_written() {
    let mut random = Random(7);
    for round in 0..24 {
        // Maps of norm up to 1.2 in a sheared frame, whose spectral radii are below 0.8.
        let count = 2 + round % 3;
        let shear = DMat3::from_cols(DVec3::new(1.0, 0.0, 0.0), DVec3::new(random.between(-1.0, 1.0), 1.0, 0.0), DVec3::new(0.3, 0.2, 0.7));
        let map = |random: &mut Random| {
            let axis = random.point(1.0).normalize_or(DVec3::Z);
            let turn = DMat3::from_axis_angle(axis, random.between(0.0, 6.0));
            AffineMap { linear: shear * (random.between(0.1, 0.8) * turn) * shear.inverse(), translation: random.point(20.0) }
        };
        let maps = (0..count).map(|_| map(&mut random)).collect();
        let shape = attractor(Shape::Ifs(Ifs { maps, primitive: None, graph: None }));
        let size = shape.root_cell(0).ball.radius;
        let letters =
            |random: &mut Random, length: usize| -> Vec<usize> { (0..length).map(|_| (random.unit() * count as f64) as usize).collect() };
        let (prefix_length, period_length) = ((random.unit() * 6.0) as usize, 1 + (random.unit() * 7.0) as usize);
        let (prefix, period) = (letters(&mut random, prefix_length), letters(&mut random, period_length));
        let address = Address { root: 0, prefix: prefix.clone(), period: period.clone() };
        let rotated = Address {
            root: 0,
            prefix: prefix.iter().chain(&period[..1]).copied().collect(),
            period: period[1..].iter().chain(&period[..1]).copied().collect(),
        };
        let twice = Address { root: 0, prefix, period: period.repeat(3) };
        let points: Vec<Location> =
            [&address, &rotated, &twice].map(|address| point_at(&shape, address, &Budget::default()).unwrap()).into();
        for other in &points[1..] {
            let off = DVec3::from_array(points[0].point).distance(DVec3::from_array(other.point));
            assert!(off <= points[0].bound_mm + other.bound_mm, "{address}: {off:e} {:e} {:e}", points[0].bound_mm, other.bound_mm);
            assert!(other.bound_mm <= 1e-12 * size, "{address}: {:e} of {size}", other.bound_mm);
        }
        // The cell of every prefix holds the point, and the way back finds it.
        let target = DVec3::from_array(points[0].point);
        let resolution = size * 0.02;
        let query =
            NearQuery { point: points[0].point, within_mm: Some(0.0), resolution: Tolerance::new(resolution).unwrap(), most: 10_000 };
        let found = addresses_near(&shape, &query, &Budget::default()).unwrap();
        assert!(found.complete && found.nearest.distance_mm[0] <= points[0].bound_mm && found.nearest.distance_mm[1] <= 2.1 * resolution);
        let word: Vec<usize> = address.prefix.iter().chain(address.period.iter().cycle().take(4000)).copied().collect();
        assert!(found.cells.iter().any(|cell| word.starts_with(&cell.address.prefix)), "{address} is not among {:?}", found.cells);
        for cell in &found.cells {
            let again = point_at(&shape, &cell.address, &Budget::default()).unwrap();
            let distance = DVec3::from_array(cell.cell.centre).distance(target);
            assert!(distance <= cell.cell.radius && cell.cell.radius <= 1.001 * resolution);
            assert!(DVec3::from_array(again.point).distance(DVec3::from_array(cell.cell.centre)) <= cell.cell.radius + again.bound_mm);
        }
    }
}

#[test]
fn graphs_allow_what_they_allow() {
    // A = A/2 u (B/2 + 1/2), B = A/2: the largest point is 2/3, by the period 1 2.
    let graph = Some(vec![vec![0, 1], vec![2], vec![0, 1]]);
    let maps = [[0.5, 0.0, 0.0, 0.5, 0.0, 0.0], [0.5, 0.0, 0.0, 0.5, 0.5, 0.0], [0.5, 0.0, 0.0, 0.4, 0.0, 0.0]];
    let shape = plane(1.0, &maps, graph);
    // The root's state lets every map begin, so the period returns to its state at the second time only.
    check(&shape, 1.0, "0: (1 2)", DVec2::new(2.0 / 3.0, 0.0));
    check(&shape, 1.0, "0: 2 (1 2)", DVec2::new(1.0 / 3.0, 0.0));
    let words = |text: &str| at(&shape, text).unwrap_err();
    assert!(matches!(words("1 1"), AddressError::Letter { position: 2, letter: 1, .. }), "{}", words("1 1"));
    assert!(matches!(words("(1)"), AddressError::Period { position: 1, letter: 1, .. }), "{}", words("(1)"));
    assert!(matches!(words("2 (0 1)"), AddressError::Period { position: 1, letter: 0, .. }), "{}", words("2 (0 1)"));
    assert!(matches!(words("7"), AddressError::Letter { position: 1, letter: 7, .. }));
    assert!(matches!(words("1: 0"), AddressError::Root { root: 1, roots: 1 }));
    assert!(words("1 1").to_string().contains("only transition 2"), "{}", words("1 1"));
    // A cell's anchor goes on as it can.
    assert_eq!(at(&shape, "0: 1").unwrap().address.to_string(), "0: 1 2 (0)");
}

fn near(shape: &Attractor, point: DVec3, within_mm: Option<f64>, resolution: f64) -> Result<Neighbourhood, AddressError> {
    let query = NearQuery { point: point.to_array(), within_mm, resolution: Tolerance::new(resolution).unwrap(), most: 1000 };
    addresses_near(shape, &query, &Budget::default())
}

#[test]
fn distances_of_known_shapes() {
    let holds = |found: &Neighbourhood, distance: f64| {
        let [low, high] = found.nearest.distance_mm;
        assert!(low <= distance && distance <= high && high - low <= 0.03, "{distance} in {:?}", found.nearest);
    };
    // Koch's curve from the left, and from above its top.
    let curve = koch(100.0);
    let found = near(&curve, DVec3::new(-10.0, 0.0, 0.0), None, 0.01).unwrap();
    holds(&found, 10.0);
    assert!(found.cells[0].address.prefix.iter().all(|&letter| letter == 0), "{:?}", found.cells[0]);
    let top = 100.0 * 3.0_f64.sqrt() / 6.0;
    let found = near(&curve, DVec3::new(50.0, top + 3.0, 4.0), None, 0.01).unwrap();
    holds(&found, 5.0);
    let begins: Vec<usize> = found.cells.iter().map(|cell| cell.address.prefix[0]).collect();
    assert!(begins.contains(&1) && begins.contains(&2), "the top belongs to both halves: {begins:?}");

    // The middle of a Sierpinski triangle's hole is as far as the inscribed circle's radius: s sqrt3/12.
    let corner = 3.0_f64.sqrt() / 4.0;
    let maps = [[0.5, 0.0, 0.0, 0.5, 0.0, 0.0], [0.5, 0.0, 0.0, 0.5, 0.5, 0.0], [0.5, 0.0, 0.0, 0.5, 0.25, corner]];
    let triangle = plane(40.0, &maps, None);
    holds(&near(&triangle, DVec3::new(20.0, 40.0 * 3.0_f64.sqrt() / 6.0, 0.0), None, 0.01).unwrap(), 40.0 * 3.0_f64.sqrt() / 12.0);

    // A triangle of a mesh is a simplex: exact, whatever the resolution.
    let vertices = vec![DVec3::ZERO, DVec3::new(3.0, 0.0, 0.0), DVec3::new(0.0, 3.0, 0.0)];
    let mesh = attractor(Shape::Mesh(PolygonMesh { vertices, faces: vec![vec![0, 1, 2]], interior: Interior::Surface }));
    let found = near(&mesh, DVec3::new(1.0, 1.0, 2.0), None, 50.0).unwrap();
    assert!((found.nearest.point[0] - 1.0).abs() < 1e-15 && found.nearest.distance_mm[1] - found.nearest.distance_mm[0] < 1e-10);
    holds(&found, 2.0);
    assert!(matches!(at(&mesh, "0: (0)"), Err(AddressError::Letter { .. })));
    assert_eq!(at(&mesh, "0:").unwrap().address.to_string(), "0:");
}

#[test]
fn every_cell_of_a_neighbourhood_is_listed() {
    // Against all words of Koch's curve to depth 6: a corner within the distance has its cell in the list.
    let (curve, centre, within) = (koch(100.0), DVec3::new(31.0, 7.0, 0.0), 9.0);
    let found = near(&curve, centre, Some(within), 0.2).unwrap();
    assert!(
        found.complete && found.cells.len() > 10 && found.cells.windows(2).all(|pair| pair[0].distance_mm[0] <= pair[1].distance_mm[0])
    );
    let mut seen = 0;
    for code in 0..4_usize.pow(6) {
        let word: Vec<usize> = (0..6).map(|k| code >> (2 * k) & 3).collect();
        let point = point_at(&curve, &Address { root: 0, prefix: word.clone(), period: vec![0] }, &Budget::default()).unwrap().point;
        if DVec3::from_array(point).distance(centre) < within {
            seen += 1;
            let endless: Vec<usize> = word.iter().copied().chain([0; 20]).collect();
            assert!(found.cells.iter().any(|cell| endless.starts_with(&cell.address.prefix)), "{word:?}");
        }
    }
    assert!(seen > 100);
    let few = NearQuery { point: centre.to_array(), within_mm: Some(within), resolution: Tolerance::new(0.2).unwrap(), most: 5 };
    let few = addresses_near(&curve, &few, &Budget::default()).unwrap();
    assert!(!few.complete && few.cells.len() == 5 && few.cells[..] == found.cells[..5]);
}

#[test]
fn searches_are_bounded_and_say_what_passes() {
    // All points of a circle are as far from its centre: every cell must be looked at.
    let arc = BezierCurve {
        control_points: vec![DVec3::new(30.0, 0.0, 0.0), DVec3::new(30.0, 30.0, 0.0), DVec3::new(0.0, 30.0, 0.0)],
        weights: Some(vec![1.0, std::f64::consts::FRAC_1_SQRT_2, 1.0]),
    };
    let arc = attractor(Shape::BezierCurve(arc));
    let mut budget = Budget::default();
    budget.limits.cells = 2000;
    let ask = |resolution: f64| {
        let query = NearQuery { point: [0.0; 3], within_mm: None, resolution: Tolerance::new(resolution).unwrap(), most: 100_000 };
        addresses_near(&arc, &query, &budget)
    };
    let Err(error @ AddressError::Cells { reachable_mm, .. }) = ask(1e-6) else { panic!("2000 cells are not enough") };
    assert!(error.limit().is_some_and(|facts| facts.remedy == Some(("tolerance_mm", reachable_mm))));
    let found = ask(reachable_mm).unwrap();
    assert!(found.nearest.distance_mm[0] <= 30.0 && found.nearest.distance_mm[1] >= 30.0);
    let depth = near(&takagi(1e9), DVec3::ZERO, None, 1e-7);
    assert!(depth.is_ok(), "{depth:?}");
    assert!(matches!(near(&arc, DVec3::new(f64::NAN, 0.0, 0.0), None, 1.0), Err(AddressError::Query { .. })));
    assert!(matches!(near(&arc, DVec3::ZERO, Some(-1.0), 1.0), Err(AddressError::Query { name: "within_mm", .. })));
    budget.cancel.fire(lacuna_kernel::budget::StopReason::Cancelled);
    let query = NearQuery { point: [0.0; 3], within_mm: None, resolution: Tolerance::new(0.1).unwrap(), most: 10 };
    assert!(matches!(addresses_near(&arc, &query, &budget), Err(AddressError::Stopped(_))));
}
