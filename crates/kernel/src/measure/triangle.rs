//! The point of a triangle closest to a point of space.

use crate::attractor::cell::{Point, closest_on_segment, cross, distance_squared, dot, subtract};

/// Where on a triangle the closest point lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// In the interior.
    Face,
    /// On the side opposite to corner k.
    Side(u8),
    /// At corner k.
    Corner(u8),
}

/// The closest point of triangle abc to x, whatever its shape: also of needles, and where corners coincide.
#[inline]
#[must_use]
pub fn closest_on_triangle(x: &Point, a: &Point, b: &Point, c: &Point) -> Point {
    closest_feature(x, a, b, c).0
}

/// Triangles with a smaller squared sine at a are needles: barycentric coordinates lose as many digits as its quotient has.
const NEEDLE: f64 = 1e-4;

/// The closest point and where it lies. Voronoi regions of the corners and sides are tested in turn, as
/// in Ericson, "Real-Time Collision Detection" (2005), 5.1.5, but for needles: see `on_needle`.
#[inline]
#[must_use]
pub fn closest_feature(x: &Point, a: &Point, b: &Point, c: &Point) -> (Point, Feature) {
    let (ab, ac, ax) = (subtract(b, a), subtract(c, a), subtract(x, a));
    let (d1, d2) = (dot(&ab, &ax), dot(&ac, &ax));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (*a, Feature::Corner(0));
    }
    let bx = subtract(x, b);
    let (d3, d4) = (dot(&ab, &bx), dot(&ac, &bx));
    if d3 >= 0.0 && d4 <= d3 {
        return (*b, Feature::Corner(1));
    }
    let cx = subtract(x, c);
    let (d5, d6) = (dot(&ab, &cx), dot(&ac, &cx));
    if d6 >= 0.0 && d5 <= d6 {
        return (*c, Feature::Corner(2));
    }
    let normal = cross(&ab, &ac);
    if dot(&normal, &normal) <= NEEDLE * dot(&ab, &ab) * dot(&ac, &ac) {
        return on_needle(x, [a, b, c]);
    }
    let along = |from: &Point, direction: &Point, t: f64| -> Point { std::array::from_fn(|i| from[i] + t * direction[i]) };
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (along(a, &ab, d1 / (d1 - d3)), Feature::Side(2));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (along(a, &ac, d2 / (d2 - d6)), Feature::Side(1));
    }
    let va = d3 * d6 - d5 * d4;
    let (w, v) = (d4 - d3, d5 - d6);
    if va <= 0.0 && w >= 0.0 && v >= 0.0 {
        return (along(b, &subtract(c, b), w / (w + v)), Feature::Side(0));
    }
    let sum = va + vb + vc;
    let (beta, gamma) = (vb / sum, vc / sum);
    (std::array::from_fn(|i| a[i] + beta * ab[i] + gamma * ac[i]), Feature::Face)
}

/// The closest point of a needle, or of a triangle without area.
///
/// Seen from its longest side pq, with u along it, v across it towards the third corner o, and x at (s, t): where t <= 0 the closest point is on pq, as the angles
/// there are acute; else it is (s, t), if that is inside, or on one of the other two sides. Parts across u are taken from what is left of vectors without
/// their parts along u. So v is off by eps |pq| / h for the height h, which moves points of the triangle by eps |pq|, and t by eps |pq| / h of itself, to second order of the distance.
#[cold]
fn on_needle(x: &Point, corners: [&Point; 3]) -> (Point, Feature) {
    let square = |k: usize| distance_squared(corners[(k + 1) % 3], corners[(k + 2) % 3]);
    let longest = (0..3).max_by(|&j, &k| square(j).total_cmp(&square(k))).unwrap_or(0);
    let numbers = [(longest + 1) % 3, (longest + 2) % 3, longest];
    let [p, q, o] = numbers.map(|k| corners[k]);
    let length = square(longest).sqrt();
    if length == 0.0 {
        return (*p, Feature::Corner(numbers[0] as u8));
    }
    let u = subtract(q, p).map(|part| part / length);
    let parts = |point: &Point| {
        let from = subtract(point, p);
        let along = dot(&from, &u);
        (along, std::array::from_fn::<f64, 3, _>(|axis| from[axis] - along * u[axis]))
    };
    let (side, (s, across)) = (numbers.map(|k| Feature::Side(k as u8)), parts(x));
    let (foot, up) = parts(o);
    let height = dot(&up, &up).sqrt();
    let t = if height > 0.0 { dot(&across, &up) / height } else { 0.0 };
    let on = |k: usize, from: &Point, to: &Point| (closest_on_segment(x, from, to), side[k]);
    let on_base = || on(2, p, q);
    if t <= 0.0 {
        return on_base();
    }
    let nearer = |a: (Point, Feature), b: (Point, Feature)| if distance_squared(x, &b.0) < distance_squared(x, &a.0) { b } else { a };
    // Left of po, and right of qo.
    match (foot * t > height * s, (length - foot) * t > height * (length - s)) {
        (true, true) => nearer(on(1, p, o), on(0, q, o)),
        (true, false) => on(1, p, o),
        (false, true) => on(0, q, o),
        (false, false) => {
            let share = t / height;
            (std::array::from_fn(|axis| p[axis] + s * u[axis] + share * up[axis]), Feature::Face)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split_mix::Random;

    /// Against a dense sample of the triangle.
    #[test]
    fn closest_point_beats_a_sample() {
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as f64 / f64::from(1_u32 << 31) * 4.0 - 2.0
        };
        for _ in 0..300 {
            let mut point = || -> Point { [random(), random(), random()] };
            let (x, a, b, c) = (point(), point(), point(), point());
            let found = distance_squared(&x, &closest_on_triangle(&x, &a, &b, &c)).sqrt();
            let mut sampled = f64::INFINITY;
            for i in 0..=60 {
                for j in 0..=60 - i {
                    let (u, v) = (f64::from(i) / 60.0, f64::from(j) / 60.0);
                    let p: Point = std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
                    sampled = sampled.min(distance_squared(&x, &p).sqrt());
                }
            }
            assert!(found <= sampled + 1e-12 && found >= sampled - 0.12, "{found} {sampled}");
        }
    }

    /// Needles of every height, and what has no area, against the least of their sides and of the plane's foot, found in a frame of whole numbers.
    #[test]
    fn closest_points_of_needles() {
        let mut random = Random(5);
        let mut number = |digits: u32| (random.next() as i64 >> (63 - digits)) as f64;
        for round in 0..20_000 {
            // With whole coordinates below 2^13 all that decides is exact.
            let mut point = |digits: u32| -> Point { [number(digits), number(digits), number(digits)] };
            let (a, along, off, x) = (point(8), point(5), point(1), point(12));
            let shares = [[0.0, 0.0], [31.0, 0.0], [17.0, 1.0], [-40.0, 1.0], [64.0, 1.0], [31.0, 1.0], [0.0, 1.0]];
            let corner = |share: [f64; 2]| -> Point { std::array::from_fn(|k| a[k] + share[0] * along[k] + share[1] * off[k]) };
            let [b, c] = [1 + round % 6, 2 + round / 6 % 5].map(|k| corner(shares[k]));
            let (found, feature) = closest_feature(&x, &a, &b, &c);
            let distance = distance_squared(&x, &found).sqrt();
            let sides = [(&b, &c), (&c, &a), (&a, &b)];
            let mut exact =
                sides.iter().map(|(p, q)| distance_squared(&x, &closest_on_segment(&x, p, q))).fold(f64::INFINITY, f64::min).sqrt();
            let normal = cross(&subtract(&b, &a), &subtract(&c, &a));
            let over = sides.iter().all(|(p, q)| dot(&cross(&normal, &subtract(q, p)), &subtract(&x, p)) >= 0.0);
            if over && dot(&normal, &normal) > 0.0 {
                exact = exact.min(dot(&normal, &subtract(&x, &a)).abs() / dot(&normal, &normal).sqrt());
            }
            assert!((distance - exact).abs() <= 1e-11 * (1.0 + exact), "{x:?} from {a:?} {b:?} {c:?}: {distance} {exact} {feature:?}");
        }
    }

    /// Corners that lie on a line but for rounding: no point of the triangle is farther from x than those of its sides.
    #[test]
    fn closest_points_of_what_is_flat_up_to_rounding() {
        let mut random = Random(6);
        let mut number = || random.next() as f64 / 2.0_f64.powi(63) - 1.0;
        for _ in 0..20_000 {
            let mut point = || -> Point { [number(), number(), number()] };
            let (a, along, x, shares) = (point(), point(), point(), point());
            let corner = |share: f64| -> Point { std::array::from_fn(|k| a[k] + share * along[k]) };
            let corners = shares.map(corner);
            for [i, j, k] in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 0, 0]] {
                let (a, b, c) = (&corners[i], &corners[j], &corners[k]);
                let distance = distance_squared(&x, &closest_on_triangle(&x, a, b, c)).sqrt();
                let sides = [(b, c), (c, a), (a, b)].map(|(p, q)| distance_squared(&x, &closest_on_segment(&x, p, q)).sqrt());
                let least = sides.into_iter().fold(f64::INFINITY, f64::min);
                assert!((distance - least).abs() <= 1e-14, "{x:?} from {a:?} {b:?} {c:?}: {distance} {least}");
            }
        }
    }
}
