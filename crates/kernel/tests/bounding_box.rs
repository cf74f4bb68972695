//! Boxes of shapes: against closed forms whose extremes are attained along lines, faces and Cantor sets, and against fine samples of random systems.

use crate::schemes::{Random, curve, lower, product, project, size};
use glam::{DMat3, DVec3};
use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::budget::Budget;
use lacuna_kernel::measure::{Interval, bounding_box, extent_along};
use lacuna_kernel::model::{AffineMap, ControlNet, CurveScheme, Ifs, Parametrization, Shape};

fn ifs(maps: Vec<AffineMap>) -> Attractor {
    lower(Shape::Ifs(Ifs { maps, primitive: None, graph: None })).attractor
}

/// The supremum of x . direction.
fn support(attractor: &Attractor, direction: DVec3) -> Interval {
    extent_along(attractor, direction, &Budget::default()).unwrap()[1]
}

fn assert_is(found: Interval, exact: f64, size: f64) {
    assert!(found.low <= exact && exact <= found.high, "{exact} is not in {found:?}");
    assert!(found.width() <= 1e-10 * size, "{found:?} is wide");
}

/// A pair of maps of a line, x -> r x + t; its attractor's ends are the fixed points' when ratios are positive.
fn line(random: &mut Random) -> Vec<[f64; 2]> {
    let ratio = random.between(0.2, 0.5);
    vec![[ratio, random.between(-5.0, 0.0)], [ratio, random.between(1.0, 5.0)]]
}

fn ends(line: &[[f64; 2]]) -> [f64; 2] {
    let fixed = |[r, t]: &[f64; 2]| t / (1.0 - r);
    [line.iter().map(fixed).fold(f64::INFINITY, f64::min), line.iter().map(fixed).fold(f64::NEG_INFINITY, f64::max)]
}

#[test]
fn products_of_cantor_sets_have_the_product_of_their_boxes() {
    // A face of the box holds 2^k x 2^k cells of size ratio^k: all of them are equally high.
    let mut random = Random(11);
    for _ in 0..20 {
        let lines = [line(&mut random), line(&mut random), line(&mut random)];
        let mut maps = Vec::new();
        for x in &lines[0] {
            for y in &lines[1] {
                for z in &lines[2] {
                    let linear = DMat3::from_diagonal(DVec3::new(x[0], y[0], z[0]));
                    maps.push(AffineMap { linear, translation: DVec3::new(x[1], y[1], z[1]) });
                }
            }
        }
        let attractor = ifs(maps);
        let found = bounding_box(&attractor, &Budget::default()).unwrap();
        for (axis, line) in lines.iter().enumerate() {
            let [low, high] = ends(line);
            assert_is(found.low[axis], low, found.extent());
            assert_is(found.high[axis], high, found.extent());
        }
        // The supremum of a product along any direction is the sum of the factors'.
        let direction = random.points(1)[0].normalize();
        let exact =
            (0..3).map(|axis| ends(&lines[axis]).map(|end| end * direction[axis]).into_iter().fold(f64::NEG_INFINITY, f64::max)).sum();
        assert_is(support(&attractor, direction), exact, 2.0 * found.extent());
    }
}

#[test]
fn homotheties_towards_points_have_their_hull() {
    // Sierpinski triangles and tetrahedra, squares, the Menger sponge: turned, a face or an edge is square to the direction or nearly so.
    let mut random = Random(5);
    let grid = |keep: &dyn Fn([i32; 3]) -> bool, side: i32| -> Vec<DVec3> {
        let all = (0..side * side * side).map(|k| [k % side, k / side % side, k / side / side]);
        all.filter(|&place| keep(place)).map(|place| DVec3::from_array(place.map(f64::from))).collect()
    };
    let square = grid(&|[_, _, z]| z == 0, 2);
    let menger = grid(&|place| place.iter().filter(|&&k| k == 1).count() < 2, 3);
    let tetrahedron = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    for (points, ratio) in
        [(square, 0.5), (menger, 1.0 / 3.0), (tetrahedron.clone(), 0.5), (tetrahedron[..3].to_vec(), 0.5), (tetrahedron, 0.7)]
    {
        for step in 0..12 {
            let axis = random.points(1)[0].normalize();
            // Also within rounding, and within the wanted width, of square.
            let angle = [0.0, 1e-15, 1e-12, 1e-10, 1e-8, 1e-5, 1e-3, 0.1, 0.5, 1.0, 2.0, 3.0][step];
            let turn = DMat3::from_axis_angle(axis, angle);
            let place = random.points(1)[0];
            let turned: Vec<DVec3> = points.iter().map(|p| turn * (30.0 * *p) + place).collect();
            let maps =
                turned.iter().map(|p| AffineMap { linear: DMat3::from_diagonal(DVec3::splat(ratio)), translation: *p * (1.0 - ratio) });
            let attractor = ifs(maps.collect());
            for direction in [DVec3::X, DVec3::Y, DVec3::Z, turn * DVec3::Z, turn * DVec3::ONE.normalize()] {
                for direction in [direction, -direction] {
                    let exact = turned.iter().map(|p| p.dot(direction)).fold(f64::NEG_INFINITY, f64::max);
                    assert_is(support(&attractor, direction), exact, 200.0);
                }
            }
        }
    }
}

/// The support of all cells of a level of a system of maps of norm at most `ratio`, whose fixed points lie within `reach` of the origin as does the whole
/// set: a lower bound by points of the set, and an upper bound.
fn by_brute_force(maps: &[AffineMap], reach: f64, ratio: f64, direction: DVec3, levels: i32) -> [f64; 2] {
    let fixed = (DMat3::IDENTITY - maps[0].linear).inverse() * maps[0].translation;
    let mut points = vec![fixed];
    for _ in 0..levels {
        points = maps.iter().flat_map(|map| points.iter().map(|p| map.linear * *p + map.translation)).collect();
    }
    let reached = points.iter().map(|p| p.dot(direction)).fold(f64::NEG_INFINITY, f64::max);
    [reached, reached + 2.0 * reach * ratio.powi(levels)]
}

#[test]
fn random_systems_are_bounded_from_both_sides() {
    let mut random = Random(77);
    for round in 0..60 {
        let count = 2 + random.below(3);
        let ratio = random.between(0.2, 0.55);
        let maps: Vec<AffineMap> = (0..count)
            .map(|_| {
                let mut linear = DMat3::from_axis_angle(random.points(1)[0].normalize(), random.between(0.0, 6.0)) * ratio;
                if round % 3 == 1 {
                    // Shears and flips: no similarity.
                    linear *=
                        DMat3::from_diagonal(DVec3::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(-1.0, 1.0)));
                }
                if round % 3 == 2 {
                    // Quarter turns about one axis: directions come back, so that many cells are equally high.
                    linear = DMat3::from_rotation_z(random.below(4) as f64 * std::f64::consts::FRAC_PI_2) * ratio;
                }
                AffineMap { linear, translation: random.points(1)[0] }
            })
            .collect();
        let reach = size(&maps.iter().map(|map| map.translation).collect::<Vec<_>>()) / (1.0 - ratio);
        let attractor = ifs(maps.clone());
        let levels = (60_000_f64.ln() / (count as f64).ln()) as i32;
        for direction in [DVec3::X, -DVec3::Y, DVec3::Z, random.points(1)[0].normalize()] {
            let found = support(&attractor, direction);
            let [least, most] = by_brute_force(&maps, reach, ratio, direction, levels);
            assert!(found.high >= least - 1e-12 * reach && found.low <= most, "round {round}: {found:?} and [{least}, {most}]");
            assert!(found.width() <= 1e-9 * reach, "round {round}: {found:?} is wide");
        }
    }
}

#[test]
fn the_dragon_and_levy_curves_have_their_known_boxes() {
    let turned =
        |angle: f64, scale: f64, translation: DVec3| AffineMap { linear: DMat3::from_rotation_z(angle.to_radians()) * scale, translation };
    let half = 0.5_f64.sqrt();
    // From (0, 0) to (1, 0): the exact boxes that are published, as in the fixtures.
    let dragon = ifs(vec![turned(45.0, half, DVec3::ZERO), turned(135.0, half, DVec3::X)]);
    let levy = ifs(vec![turned(45.0, half, DVec3::ZERO), turned(-45.0, half, DVec3::new(0.5, 0.5, 0.0))]);
    for (attractor, low, high) in [(dragon, [-1.0 / 3.0, -1.0 / 3.0], [7.0 / 6.0, 2.0 / 3.0]), (levy, [-0.5, -0.25], [1.5, 1.0])] {
        let found = bounding_box(&attractor, &Budget::default()).unwrap();
        for axis in 0..2 {
            assert_is(found.low[axis], low[axis], 1.5);
            assert_is(found.high[axis], high[axis], 1.5);
        }
    }
}

/// What some point of the shape reaches along a direction: of every level the cells whose control points reach farthest, down to cells of no size.
fn reached_by_beam(attractor: &Attractor, direction: DVec3) -> f64 {
    const WIDTH: usize = 100;
    let automaton = attractor.automaton();
    let score = |points: &[[f64; 4]]| points.iter().map(|p| project(*p).dot(direction)).fold(f64::NEG_INFINITY, f64::max);
    let mut level: Vec<_> = attractor.roots().iter().map(|root| (score(&root.points), root.state, root.points.clone())).collect();
    for _ in 0..60 {
        let mut next = Vec::new();
        for (_, state, points) in &level {
            for transition in &automaton.state(*state).transitions {
                let combined = |column: &[f64]| std::array::from_fn(|k| points.iter().zip(column).map(|(p, w)| w * p[k]).sum());
                let points: Vec<[f64; 4]> = transition.operator.entries().chunks_exact(points.len()).map(combined).collect();
                next.push((score(&points), transition.to, points));
            }
        }
        next.sort_by(|a, b| b.0.total_cmp(&a.0));
        next.truncate(WIDTH);
        level = next;
    }
    level.iter().map(|(_, _, points)| project(points[0]).dot(direction)).fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn splines_and_products_reach_as_far_as_a_simple_search_finds() {
    let mut random = Random(2024);
    let clamped = |degree: usize, count: usize| -> Vec<f64> {
        let inner = count - degree;
        (0..=count + degree).map(|k| (k.clamp(degree, count) - degree) as f64 / inner as f64).collect()
    };
    // Koch's curve with another angle: signed operators, and a box that is flat in space.
    let koch = |degrees: f64| {
        let angle = f64::to_radians(degrees);
        let ratio = 0.5 / (1.0 + angle.cos());
        let map =
            |angle: f64, x: f64, y: f64| AffineMap { linear: DMat3::from_rotation_z(angle) * ratio, translation: DVec3::new(x, y, 0.0) };
        let top = [ratio * (1.0 + angle.cos()), ratio * angle.sin()];
        vec![map(0.0, 0.0, 0.0), map(angle, ratio, 0.0), map(-angle, top[0], top[1]), map(0.0, 1.0 - ratio, 0.0)]
    };
    let schemes: Vec<(CurveScheme, usize)> = vec![
        (CurveScheme::Nurbs { degree: 2, knots: clamped(2, 5) }, 5),
        (CurveScheme::Nurbs { degree: 3, knots: clamped(3, 6) }, 6),
        (CurveScheme::FourPoint { tension: 0.0625, closed: false }, 6),
        (CurveScheme::FourPoint { tension: 0.09, closed: true }, 6),
        (CurveScheme::CatmullRom { parametrization: Parametrization::Uniform, closed: true }, 5),
        (CurveScheme::CornerCutting { a: 0.3, b: 0.2, closed: false }, 5),
        (CurveScheme::Interpolation { vertical_scaling: vec![0.5, 0.3] }, 3),
        (CurveScheme::Ifs { maps: koch(60.0) }, 4),
        (CurveScheme::Ifs { maps: koch(37.0) }, 4),
    ];
    for round in 0..48 {
        // The last ones are no curves alone, or the graphs of functions, which ask for increasing x.
        let (u, rows) = schemes[random.below(schemes.len() - if round % 2 == 0 { 3 } else { 0 })].clone();
        let shape = if round % 2 == 0 {
            let weights = matches!(u, CurveScheme::Nurbs { .. }).then(|| (0..rows).map(|_| random.between(0.3, 3.0)).collect());
            let points = random.points(rows);
            curve(u, points, weights)
        } else {
            let (v, columns) = schemes[random.below(schemes.len())].clone();
            let rational = matches!((&u, &v), (CurveScheme::Nurbs { .. }, CurveScheme::Nurbs { .. }));
            let weights = rational.then(|| (0..rows * columns).map(|_| random.between(0.3, 3.0)).collect());
            let mut points = random.points(rows * columns);
            if round % 4 == 1 {
                // Equally high along lines of the first parameter.
                for i in 0..rows {
                    for j in 0..columns {
                        points[i * columns + j].z = points[j].z;
                    }
                }
            }
            product(vec![u, v], ControlNet { size: vec![rows, columns], points, weights })
        };
        let attractor = lower(shape).attractor;
        let found = bounding_box(&attractor, &Budget::default()).unwrap();
        for (axis, direction) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
            for (end, direction) in [(found.high[axis], direction), (found.low[axis], -direction)] {
                let reached = reached_by_beam(&attractor, direction) * direction[axis];
                assert!(end.low - 1e-8 <= reached && reached <= end.high + 1e-8, "round {round}, axis {axis}: {reached}, {end:?}");
                assert!(end.width() <= 1e-8, "round {round}, axis {axis}: {end:?} is wide");
            }
        }
    }
}
