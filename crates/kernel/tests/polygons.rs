//! Polygons cut into triangles: against whole numbers on small grids, and on shapes with many corners.

use glam::{DVec2, DVec3};
use lacuna_kernel::model::polygon::{MOST_CORNERS, PolygonFault, PolygonRun, cut};

struct Random(u64);

impl Random {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) % bound
    }
}

/// Twice the area of a triangle with its sign: exact, as all coordinates are small whole numbers.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

fn is_between(a: DVec2, b: DVec2, c: DVec2) -> bool {
    turn(a, b, c) == 0.0 && (a - c).dot(b - c) <= 0.0
}

fn cross(a: DVec2, b: DVec2, c: DVec2, d: DVec2) -> bool {
    turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0
}

fn meet(a: DVec2, b: DVec2, c: DVec2, d: DVec2) -> bool {
    cross(a, b, c, d) || is_between(a, b, c) || is_between(a, b, d) || is_between(c, d, a) || is_between(c, d, b)
}

/// How a ring is, told by comparing every pair of edges: simple, crossing somewhere, or neither.
#[derive(PartialEq, Debug)]
enum Ring {
    Simple,
    Crossing,
    Touching,
}

fn kind(ring: &[DVec2]) -> Ring {
    let n = ring.len();
    let edge = |k: usize| (ring[k % n], ring[(k + 1) % n]);
    let mut kind = Ring::Simple;
    for i in 0..n {
        for j in i + 1..n {
            let ((a, b), (c, d)) = (edge(i), edge(j));
            let touches = if j == i + 1 {
                is_between(a, b, d) || is_between(c, d, a)
            } else if (j + 1) % n == i {
                is_between(a, b, c) || is_between(c, d, b)
            } else {
                meet(a, b, c, d)
            };
            if cross(a, b, c, d) {
                return Ring::Crossing;
            }
            if touches {
                kind = Ring::Touching;
            }
        }
    }
    kind
}

/// Twice the area with its sign.
fn area(ring: &[DVec2]) -> f64 {
    (0..ring.len()).map(|k| ring[k].perp_dot(ring[(k + 1) % ring.len()])).sum()
}

/// What every set of triangles of a ring must be: two less than corners, none turned, as much as the ring encloses, and its edges the ring's.
fn assert_fills(ring: &[DVec2], corners: &[u32], triangles: &[[u32; 3]]) {
    assert_eq!(triangles.len(), ring.len() - 2, "{ring:?}");
    let whole = area(ring);
    let turns = triangles.iter().map(|&[a, b, c]| {
        let [a, b, c] = [a, b, c].map(|corner| ring[corner as usize]);
        turn(a, b, c) * whole.signum()
    });
    let turns: Vec<f64> = turns.collect();
    assert!(turns.iter().all(|&turn| turn >= 0.0), "{ring:?}: {triangles:?}");
    assert_eq!(turns.iter().sum::<f64>(), whole.abs(), "{ring:?}");
    let mut back = Vec::new();
    PolygonRun { first: 0, count: triangles.len() as u32 }.corners(triangles, &mut back);
    assert_eq!(back, corners, "{ring:?}: {triangles:?}");
}

/// Places of a plane of whole numbers in space.
fn placed(ring: &[DVec2], origin: DVec3, across: DVec3, up: DVec3) -> Vec<DVec3> {
    ring.iter().map(|point| origin + across * point.x + up * point.y).collect()
}

#[test]
fn rings_on_small_grids_are_filled_if_and_only_if_they_do_not_cross() {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let mut seen = [0_u32; 3];
    for round in 0..60_000 {
        let (n, side) = (4 + random.below(6) as usize, 3 + random.below(4));
        let ring: Vec<DVec2> = (0..n).map(|_| DVec2::new(random.below(side) as f64, random.below(side) as f64)).collect();
        let mut direction = || DVec3::from_array(std::array::from_fn(|_| random.below(9) as f64 - 4.0));
        let (origin, across, up) = (direction() * 16.0, direction(), direction());
        if across.cross(up) == DVec3::ZERO {
            continue;
        }
        // Numbers that are exact at every size.
        let size = [1.0, 2.0_f64.powi(-300), 2.0_f64.powi(300)][round % 3];
        let vertices = placed(&ring, origin * size, across * size, up * size);
        let corners: Vec<u32> = (0..n as u32).collect();
        let mut triangles = vec![[7, 7, 7]];
        let found = cut(&vertices, &corners, &mut triangles);
        let kind = kind(&ring);
        match (&kind, found) {
            (Ring::Simple, Err(fault)) => panic!("{ring:?} is simple: {fault}"),
            // All that runs along one line may be anything without area.
            (Ring::Crossing, Ok(())) => panic!("{ring:?} crosses itself: {:?}", &triangles[1..]),
            (_, Ok(())) if area(&ring) != 0.0 => assert_fills(&ring, &corners, &triangles[1..]),
            (_, Ok(())) => assert_eq!(triangles.len(), n - 1),
            (_, Err(_)) => assert_eq!(triangles, [[7, 7, 7]], "nothing is left of what failed"),
        }
        seen[kind as usize] += 1;
    }
    assert!(seen.iter().all(|&count| count > 1000), "{seen:?}");
}

/// A comb, a spiral and a star of many corners, from every corner on.
#[test]
fn long_polygons_from_every_corner_on() {
    let comb: Vec<DVec2> = (0..40)
        .map(f64::from)
        .flat_map(|k| [DVec2::new(2.0 * k, 0.0), DVec2::new(2.0 * k + 1.0, 50.0)])
        .chain([DVec2::new(80.0, -1.0), DVec2::new(-1.0, -1.0)])
        .collect();
    let spiral: Vec<DVec2> = {
        let corner = |k: u32, reach: f64| DVec2::from([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)][k as usize % 4]) * reach;
        (4..40).map(|k| corner(k, f64::from(10 * k))).chain((4..40).rev().map(|k| corner(k, f64::from(10 * k + 5)))).collect()
    };
    let star: Vec<DVec2> = (0..64)
        .map(|k| {
            let (reach, angle) = (if k % 2 == 0 { 4000.0 } else { 300.0 }, f64::from(k) * std::f64::consts::TAU / 64.0);
            DVec2::new((reach * f64::cos(angle)).round(), (reach * f64::sin(angle)).round())
        })
        .collect();
    for ring in [comb, spiral, star] {
        let ring = if kind(&ring) == Ring::Simple { ring } else { panic!("not simple: {ring:?}") };
        for turned_over in [false, true] {
            for first in 0..ring.len() {
                let mut ring = ring.clone();
                ring.rotate_left(first);
                if turned_over {
                    ring.reverse();
                }
                // Nothing lies exactly in the plane.
                let (across, up) = (DVec3::new(0.36, 0.48, -0.8), DVec3::new(0.8, -0.6, 0.0));
                let vertices = placed(&ring, DVec3::new(1e3, -2e3, 5e2), across, up);
                let corners: Vec<u32> = (0..ring.len() as u32).collect();
                let mut triangles = Vec::new();
                cut(&vertices, &corners, &mut triangles).unwrap();
                assert_fills(&ring, &corners, &triangles);
            }
        }
    }
}

#[test]
fn what_has_no_inside_is_refused_with_its_place() {
    let fault = |points: &[[f64; 3]]| {
        let vertices: Vec<DVec3> = points.iter().copied().map(DVec3::from_array).collect();
        let corners: Vec<u32> = (0..points.len() as u32).collect();
        cut(&vertices, &corners, &mut Vec::new()).unwrap_err()
    };
    let crossed = fault(&[[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0], [2.0, 3.0, 0.0]]);
    assert!(matches!(crossed, PolygonFault::Crossing { .. }), "{crossed}");
    // A bow whose halves cancel.
    assert_eq!(fault(&[[0.0, 0.0, 0.0], [2.0, 2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]]), PolygonFault::NoPlane);
    // A corner on an edge, and one on another corner.
    let on_edge = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [2.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    assert_eq!(fault(&on_edge), PolygonFault::Touching { vertex: 3 });
    let on_corner = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [2.0, 1.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0], [2.0, 1.0, 0.0]];
    assert!(matches!(fault(&on_corner), PolygonFault::Touching { .. }));
    // More corners than are cut, if they need it.
    let long = (0..=MOST_CORNERS).map(|k| [k as f64, (k % 2) as f64, 0.0]).chain([[0.0, -1.0, 0.0]]).collect::<Vec<_>>();
    assert_eq!(fault(&long), PolygonFault::TooLong { corners: MOST_CORNERS + 2 });
}

/// Numbers at the ends of what doubles carry give an answer or a fault, and never a panic.
#[test]
fn no_numbers_are_too_much() {
    let mut random = Random(88_172_645_463_325_252);
    let values = [0.0, 1.0, -1.0, f64::MIN_POSITIVE, 5e-324, -5e-324, 1e-160, 1e160, f64::MAX, f64::MIN, 1.0 + f64::EPSILON, 1e16];
    for _ in 0..60_000 {
        let n = 4 + random.below(5) as usize;
        let vertices: Vec<DVec3> =
            (0..n).map(|_| DVec3::from_array(std::array::from_fn(|_| values[random.below(values.len() as u64) as usize]))).collect();
        let corners: Vec<u32> = (0..n as u32).collect();
        let mut triangles = Vec::new();
        match cut(&vertices, &corners, &mut triangles) {
            Ok(()) => {
                let mut back = Vec::new();
                PolygonRun { first: 0, count: triangles.len() as u32 }.corners(&triangles, &mut back);
                assert_eq!(back, corners, "{vertices:?}: {triangles:?}");
            }
            Err(_) => assert!(triangles.is_empty()),
        }
    }
}
