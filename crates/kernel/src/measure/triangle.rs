//! The point of a triangle closest to a point of space.

use crate::attractor::cell::{Point, closest_on_segment, distance_squared, dot, subtract};

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

/// The closest point of triangle abc to x. Degenerate triangles are treated as their longest side.
#[inline]
#[must_use]
pub fn closest_on_triangle(x: &Point, a: &Point, b: &Point, c: &Point) -> Point {
    closest_feature(x, a, b, c).0
}

/// The closest point and where it lies. Voronoi regions of the corners and sides are tested in turn, as
/// in Ericson, "Real-Time Collision Detection" (2005), 5.1.5.
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
    if sum > 0.0 {
        let (beta, gamma) = (vb / sum, vc / sum);
        return (std::array::from_fn(|i| a[i] + beta * ab[i] + gamma * ac[i]), Feature::Face);
    }
    // No area: the closest point of the three sides.
    let sides = [(closest_on_segment(x, b, c), 0), (closest_on_segment(x, a, c), 1), (closest_on_segment(x, a, b), 2)];
    let nearest = sides.into_iter().min_by(|p, q| distance_squared(x, &p.0).total_cmp(&distance_squared(x, &q.0)));
    nearest.map_or((*a, Feature::Corner(0)), |(point, side)| (point, Feature::Side(side)))
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
