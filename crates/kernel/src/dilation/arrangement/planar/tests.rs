use super::super::testing::{
    arranged, arranged_unless_left, assert_limited, assert_steady, distance_of_segments, holds_everywhere, is_flat, keeps_its_bounds,
    topology, wires as lowered,
};
use super::contour::contour;
use super::wires::Wires;
use super::{Place, levels};
use crate::budget::Budget;
use crate::split_mix::Random;
use glam::{DMat3, DVec3};

/// A shape's segments, over the plane.
type Drawing = Vec<[Place; 2]>;

/// Drawings of several kinds, some 20 mm wide.
fn drawing(kind: usize, random: &mut Random) -> Drawing {
    let mut at = |size: f64| -> Place { [size * random.share(), size * random.share()] };
    let polyline = |places: Vec<Place>| -> Drawing { places.windows(2).map(|pair| [pair[0], pair[1]]).collect() };
    match kind {
        // Loose segments, some of which cross, and points.
        0 => (0..30)
            .map(|k| {
                let (from, way) = (at(20.0), at(6.0));
                [from, if k % 5 == 0 { from } else { [from[0] + way[0] - 3.0, from[1] + way[1] - 3.0] }]
            })
            .collect(),
        // A lattice without some of its edges, and with places that are off theirs.
        1 => {
            let places: Vec<Place> =
                (0..49).map(|k| (k, at(0.8))).map(|(k, by)| [3.0 * f64::from(k % 7) + by[0], 3.0 * f64::from(k / 7) + by[1]]).collect();
            let edges = (0..49).flat_map(|k| [(k, k + 1, k % 7 < 6), (k, k + 7, k < 42)]).filter(|edge| edge.2);
            edges.filter(|_| at(1.0)[0] < 0.8).map(|(a, b, _)| [places[a], places[b]]).collect()
        }
        // A smooth curve that crosses itself.
        2 => {
            let turns = 2.0 + (4.0 * at(1.0)[0]).floor();
            let place = |k: i32| {
                let angle = std::f64::consts::TAU * f64::from(k) / 300.0;
                let far = 6.0 + 4.0 * (turns * angle).sin();
                [10.0 + far * (2.0 * angle).cos(), 10.0 + far * (2.0 * angle).sin()]
            };
            polyline((0..=300).map(place).collect())
        }
        // A tree.
        3 => {
            let mut places = vec![[10.0, 10.0]];
            (0..80)
                .map(|_| {
                    let [which, turn] = at(1.0);
                    let from: Place = places[(which * places.len() as f64) as usize];
                    let (sine, cosine) = (std::f64::consts::TAU * turn).sin_cos();
                    places.push([from[0] + 1.7 * cosine, from[1] + 1.7 * sine]);
                    [from, places[places.len() - 1]]
                })
                .collect()
        }
        // A path on a lattice: right angles, what goes straight on, what meets itself.
        4 => {
            let mut place = [10.0, 10.0];
            let walk = (0..60).map(|_| {
                let [axis, sign] = at(2.0);
                place[axis as usize] += if sign < 1.0 { 1.6 } else { -1.6 };
                place
            });
            polyline(walk.collect())
        }
        // Segments that end on another.
        _ => {
            let ends = (0..9).map(|_| at(1.0)).map(|[along, long]| [[20.0 * along, 0.0], [20.0 * along + 2.0 * long, 2.0 + 6.0 * long]]);
            ends.chain([[[0.0, 0.0], [20.0, 0.0]]]).collect()
        }
    }
}

/// A drawing across one of the axes, as high as that.
fn raised(drawing: &Drawing, axis: usize, height: f64) -> Vec<[DVec3; 2]> {
    let place = |[x, y]: Place| {
        let mut place = DVec3::splat(height);
        (place[(axis + 1) % 3], place[(axis + 2) % 3]) = (x, y);
        place
    };
    drawing.iter().map(|ends| ends.map(place)).collect()
}

#[test]
fn sheets_keep_their_bounds_and_have_the_topology_of_what_is_turned_out_of_its_plane() {
    let mut random = Random(11);
    let turn = DMat3::from_rotation_z(0.3) * DMat3::from_rotation_x(0.7);
    let (mut sheets, mut compared) = (0, 0);
    for round in 0..72 {
        let drawing = drawing(round % 6, &mut random);
        let segments = raised(&drawing, round % 3, [0.0, 0.1, -40.3][round / 3 % 3]);
        let (radius, tolerance) = ([0.5, 0.93, 1.51][round / 6 % 3], [0.1, 0.025][round % 2]);
        let shape = lowered(&segments);
        let tolerance = tolerance * radius;
        if !is_flat(&shape, radius, tolerance) {
            continue;
        }
        sheets += 1;
        let made = arranged(&shape, radius, tolerance);
        assert!(made.topology_exact && made.inner_mm <= tolerance && made.outer_mm <= tolerance, "{round}");
        assert!(holds_everywhere(&made, radius, |x| distance_of_segments(x, &segments), &mut random), "{round}");
        keeps_its_bounds(&made, &segments, radius, 20.0, &mut random);
        let turned: Vec<[DVec3; 2]> = segments.iter().map(|ends| ends.map(|end| turn * end)).collect();
        if let Some(other) = arranged_unless_left(&lowered(&turned), radius, tolerance).filter(|other| other.topology_exact) {
            assert_eq!(topology(&made), topology(&other), "{round}");
            compared += 1;
        }
    }
    assert!(sheets >= 55 && compared >= 50, "{sheets} sheets, {compared} compared");
}

/// The contour's components and holes at a distance.
fn counted(drawing: &Drawing, radius: f64) -> Option<[u64; 2]> {
    let budget = Budget::default();
    let wires = Wires::new(drawing, 2.2 * radius, 1e-10, &budget).unwrap()?;
    contour(&wires, radius, 1e-9, &budget).unwrap().map(|made| [made.components, made.holes])
}

/// Places around bodies, to which no other is nearer by a thousandth, are on the contour, and all of that are as far from the nearest body as they have to be: most curves of crowded drawings are buried.
#[test]
fn contours_are_all_that_is_open() {
    let (mut random, budget, mut counts) = (Random(17), Budget::default(), [0; 2]);
    for round in 0..24 {
        let radius = [0.7, 1.5, 2.6][round / 6 % 3];
        let drawing = drawing(round % 6, &mut random);
        // None of these is in doubt.
        let wires = Wires::new(&drawing, 2.2 * radius, 1e-10, &budget).unwrap().unwrap();
        let made = contour(&wires, radius, 1e-9, &budget).unwrap().unwrap();
        let far = |x: Place| wires.bodies.iter().map(|body| body.square(x)).fold(f64::INFINITY, f64::min).sqrt();
        let mut places = Vec::new();
        for piece in made.loops.iter().flatten().map(|&number| &made.pieces[number as usize]) {
            let steps = ((piece.to - piece.from) * radius.max(1.0) / STEP).ceil();
            places.extend(
                (0..=steps as u32).map(|k| made.place(&wires, piece, piece.from + (piece.to - piece.from) * f64::from(k) / steps).0),
            );
        }
        assert!(places.iter().all(|&place| (far(place) - radius).abs() < 1e-6), "{round}");
        for body in &wires.bodies {
            let around = (0..90).map(|k| {
                let (sine, cosine) = (std::f64::consts::TAU * f64::from(k) / 90.0).sin_cos();
                let end = if k % 2 == 0 { body.from } else { body.to() };
                [end[0] + radius * cosine, end[1] + radius * sine]
            });
            let beside = (0..20).map(|k| {
                let (along, side) = (body.length * (f64::from(k / 2) + 0.5) / 10.0, if k % 2 == 0 { radius } else { -radius });
                let [x, y] = body.along;
                [body.from[0] + along * x - side * y, body.from[1] + along * y + side * x]
            });
            for x in around.chain(beside) {
                let is_open = far(x) > 0.999 * radius;
                counts[usize::from(is_open)] += 1;
                if !is_open {
                    continue;
                }
                let near = |place: &Place| (place[0] - x[0]).hypot(place[1] - x[1]);
                let least = places.iter().map(near).fold(f64::INFINITY, f64::min);
                // Where bodies meet at a flat angle the contour is somewhat farther away.
                assert!(least < STEP + 0.05 * radius, "{round}: {least}");
            }
        }
    }
    assert!(counts[1] > 1_000 && counts[0] > 5 * counts[1], "{counts:?}");
}

/// How far apart places of a contour are that are asked for.
const STEP: f64 = 0.03;

/// A square lattice of so many places a side, 1 mm apart.
fn lattice(count: i32) -> Drawing {
    let place = |x: i32, y: i32| [f64::from(x), f64::from(y)];
    let along = (0..count).flat_map(|y| (0..count - 1).map(move |x| [place(x, y), place(x + 1, y)]));
    let across = (0..count).flat_map(|x| (0..count - 1).map(move |y| [place(x, y), place(x, y + 1)]));
    along.chain(across).collect()
}

#[test]
fn contours_have_as_many_components_and_holes_as_formulas_say() {
    // Each square leaves a hole until half of its side, where all of them are in doubt.
    for count in [2, 3, 9] {
        let drawing = lattice(count);
        let squares = (count as u64 - 1).pow(2);
        for radius in [0.01, 0.3, 0.499_99] {
            assert_eq!(counted(&drawing, radius), Some([1, squares]), "{count} {radius}");
        }
        assert_eq!(counted(&drawing, 0.5), None);
        for radius in [0.500_01, 0.7, 1.3] {
            assert_eq!(counted(&drawing, radius), Some([1, 0]), "{count} {radius}");
        }
    }
    // Places of a lattice hang together from half their distance on, and leave holes up to half a diagonal.
    let places: Drawing = (0..25).map(|k| [[f64::from(k % 5), f64::from(k / 5)]; 2]).collect();
    for (radius, expected) in [(0.49, Some([25, 0])), (0.5, None), (0.51, Some([1, 16])), (0.707, Some([1, 16])), (0.708, Some([1, 0]))] {
        assert_eq!(counted(&places, radius), expected, "{radius}");
    }
    // A regular polygon's hole ends at its inscribed circle.
    for sides in [3, 5, 12, 100] {
        let place = |k: i32| {
            let (sine, cosine) = (std::f64::consts::TAU * f64::from(k) / f64::from(sides)).sin_cos();
            [cosine, sine]
        };
        let drawing: Drawing = (0..sides).map(|k| [place(k), place(k + 1)]).collect();
        let inscribed = (std::f64::consts::PI / f64::from(sides)).cos();
        assert_eq!(counted(&drawing, inscribed - 1e-4), Some([1, 1]), "{sides}");
        assert_eq!(counted(&drawing, inscribed + 1e-4), Some([1, 0]), "{sides}");
    }
}

#[test]
fn what_is_stated_twice_or_ends_on_another_is_as_if_it_were_not() {
    let place = |x: f64, y: f64| [x, y];
    let row = (0..9).map(|k| [place(f64::from(k), 3.0), place(f64::from(k) + 1.0, 3.2)]);
    let mut plain: Drawing =
        vec![[place(0.0, 0.0), place(5.0, 0.0)], [place(5.0, 0.0), place(10.0, 0.0)], [place(5.0, 0.0), place(6.0, 4.0)]];
    plain.extend(row.clone());
    // One segment with another's end on it, itself again, a part of it, the other way around, and an end that is off by rounding.
    let mut stated: Drawing =
        vec![[place(0.0, 0.0), place(10.0, 0.0)], [place(5.0, 0.0), place(6.0, 4.0)], [place(0.0, 0.0), place(10.0, 0.0)]];
    stated.extend(row);
    stated.extend([[place(7.0, 0.0), place(2.0, 0.0)], [place(6.0, 4.0), place(5.0, 1e-13)], [place(3.0, 0.0); 2]]);
    for (radius, tolerance) in [(2.0, 0.2), (2.6, 0.05)] {
        let [one, other] = [&plain, &stated].map(|drawing| lowered(&raised(drawing, 2, 1.0)));
        assert!(is_flat(&one, radius, tolerance) && is_flat(&other, radius, tolerance));
        let [one, other] = [one, other].map(|shape| arranged(&shape, radius, tolerance));
        assert_eq!(topology(&one), topology(&other));
        assert!(other.topology_exact);
    }
}

#[test]
fn what_does_not_lie_in_a_plane_or_apart_is_left() {
    let mut random = Random(5);
    let mut segments = raised(&drawing(3, &mut random), 2, 0.0);
    assert!(is_flat(&lowered(&segments), 0.9, 0.09));
    segments[7][1].z += 1e-3;
    assert!(!is_flat(&lowered(&segments), 0.9, 0.09));
    let apart: Drawing = (0..5).map(|k| [[10.0 * f64::from(k), 0.0], [10.0 * f64::from(k), 0.1 * f64::from(k * k)]]).collect();
    assert!(!is_flat(&lowered(&raised(&apart, 2, 0.0)), 0.9, 0.09));
}

#[test]
fn profiles_are_between_their_circles() {
    for outer in [1.000_2, 1.002, 1.02, 1.1, 1.2, 1.4] {
        let levels = levels(1.0, outer, 1.0 + 1e-6).unwrap_or_else(|| panic!("none for {outer}"));
        let ends = levels.iter().map(|level| [level.band.inner, level.band.outer].map(|x| [x, level.height]));
        for [[a, _], [b, _]] in ends.clone().zip(ends.skip(1)).map(|(below, above)| [below, above]) {
            // From the inner end to the inner one above: where the chord is nearest to the centre.
            let way = [b[0] - a[0], b[1] - a[1]];
            let share = (-(a[0] * way[0] + a[1] * way[1]) / (way[0] * way[0] + way[1] * way[1])).clamp(0.0, 1.0);
            assert!((a[0] + share * way[0]).hypot(a[1] + share * way[1]) > 1.0 - 1e-9, "{outer}");
        }
        assert!(levels.iter().all(|level| level.band.outer.hypot(level.height) < outer * (1.0 + 1e-12)));
    }
}

#[test]
fn sheets_do_not_depend_on_threads_and_can_be_stopped() {
    let mut random = Random(23);
    let shape = lowered(&raised(&drawing(1, &mut random), 1, 3.0));
    assert!(is_flat(&shape, 0.9, 0.02));
    assert_steady(&shape, 0.9, 0.02);
}

#[test]
fn drawings_anywhere_are_sheets_and_copies_are_put() {
    let mut random = Random(31);
    let drawing = drawing(1, &mut random);
    let moved = |x: f64, y: f64| -> Drawing { drawing.iter().map(|ends| ends.map(|at| [at[0] + x, at[1] + y])).collect() };
    let made = |drawing: &Drawing, height: f64| {
        let segments = raised(drawing, 2, height);
        let shape = lowered(&segments);
        assert!(is_flat(&shape, 0.9, 0.09));
        let made = arranged(&shape, 0.9, 0.09);
        assert!(made.topology_exact && holds_everywhere(&made, 0.9, |x| distance_of_segments(x, &segments), &mut Random(1)));
        topology(&made)
    };
    let one = made(&drawing, 0.0);
    // About an axis, where zeros have signs; and far from all of them.
    assert_eq!(made(&moved(-10.0, -10.0), 0.0), one);
    assert_eq!(made(&moved(3_000.0, -7_000.3), 1.0 / 3.0), one);
    // Of what is there four times, also in another plane, one is made.
    let mut segments: Vec<[DVec3; 2]> = Vec::new();
    for (x, y, height) in [(0.0, 0.0, 0.0), (40.0, 0.0, 0.0), (40.0, 30.0, 5.0), (0.0, 30.0, -8.0)] {
        segments.extend(raised(&moved(x, y), 2, height));
    }
    let shape = lowered(&segments);
    assert!(is_flat(&shape, 0.9, 0.09));
    let four = arranged(&shape, 0.9, 0.09);
    assert_eq!(topology(&four), (4 * one.0, one.1, 4 * one.2));
    assert!(four.topology_exact && holds_everywhere(&four, 0.9, |x| distance_of_segments(x, &segments), &mut random));
}

#[test]
fn limits_hold_for_sheets_and_long_bodies_with_very_many_near_are_left() {
    let shape = lowered(&raised(&lattice(12), 2, 0.0));
    assert!(is_flat(&shape, 0.4, 0.02));
    assert_limited(&shape, 0.4, 0.02);
    // All cross one of them.
    let mut drawing: Drawing = (0..6_000).map(|k| f64::from(k) * 0.01).map(|x| [[x, -0.1], [x + 0.001, 0.1]]).collect();
    drawing.push([[-1.0, 0.0], [61.0, 0.0]]);
    assert!(Wires::new(&drawing, 0.1, 1e-12, &Budget::default()).unwrap().is_none());
}
