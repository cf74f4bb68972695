//! Triangles that lie along triangles of another shape: how far they are from the nearest single one, and where to cut them
//! so that each part lies along one alone.
//!
//! The distance of x from a convex set S is a convex function of x: if y and y' are points of S closest to x and x', then
//! (1 - t) y + t y' belongs to S and is within (1 - t) |x - y| + t |x' - y'| of (1 - t) x + t x'. So the largest distance from
//! S over a triangle is at one of its corners. A shape B that holds S is no farther: the least, over sites S of B, of what
//! the farthest corner has bounds d(., B) on the whole triangle, whatever its size. Only a triangle that needs
//! several sites, as it lies across an edge of theirs or is nearest to several, is larger than its bound is good.
//!
//! Two triangulations of one face agree nowhere along their edges. There a triangle is cut by the plane that passes through
//! an edge of the other's and is at right angles to it. Either part is on one side, so no edge cuts the same part twice, and
//! what lies over one triangle is bounded by it without an error.

use crate::attractor::cell::{Point, Site, cross, distance_squared, dot, subtract};
use crate::measure::contact::corners;

/// How far the farthest point of a site is from another site: at one of its corners, which is told.
pub(super) fn farthest(of: &Site, from: &Site) -> (f64, Point) {
    let squared = corners(of).iter().map(|corner| (from.distance_squared(corner), *corner));
    let (square, corner) = squared.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, corners(of)[0]));
    (square.sqrt(), corner)
}

/// Parts of half the size: two of a segment, four of a triangle, none of a point.
pub(super) fn halves(site: &Site) -> Vec<Site> {
    match site {
        Site::Point(_) => Vec::new(),
        Site::Segment([a, b]) => vec![Site::Segment([*a, between(a, b, 0.5)]), Site::Segment([between(a, b, 0.5), *b])],
        Site::Triangle([a, b, c]) => {
            let (ab, bc, ca) = (between(a, b, 0.5), between(b, c, 0.5), between(c, a, 0.5));
            [[*a, ab, ca], [ab, *b, bc], [ca, bc, *c], [ab, bc, ca]].map(Site::Triangle).into()
        }
    }
}

/// Parts of a triangle on the two sides of an edge of another one, if it is within `thin` of that one's plane, and reaches
/// beyond the edge by more than that on both sides. Edges that are short against the triangle are not cut along, as the parts would be slivers.
pub(super) fn cut(triangle: &[Point; 3], along: &[Point; 3], thin: f64) -> Option<Vec<Site>> {
    let [a, b, c] = along;
    let normal = unit(&cross(&subtract(b, a), &subtract(c, a)))?;
    if triangle.iter().any(|x| dot(&normal, &subtract(x, a)).abs() > thin) {
        return None;
    }
    let length = |p: &Point, q: &Point| distance_squared(p, q).sqrt();
    let size = (0..3).map(|k| length(&triangle[k], &triangle[(k + 1) % 3])).fold(0.0, f64::max);
    (0..3).find_map(|k| {
        let (from, to) = (&along[k], &along[(k + 1) % 3]);
        let inward = unit(&cross(&normal, &subtract(to, from)))?;
        let heights = triangle.map(|x| dot(&inward, &subtract(&x, from)));
        let divides = heights.iter().any(|h| *h > thin) && heights.iter().any(|h| *h < -thin);
        (divides && 2.0 * length(from, to) >= size).then(|| parts(triangle, &heights, thin))
    })
}

/// The parts of a triangle where a linear function, given at its corners, is positive and where it is negative: values within
/// `thin` of 0 count as 0, and there are larger ones of both signs.
fn parts(triangle: &[Point; 3], heights: &[f64; 3], thin: f64) -> Vec<Site> {
    let zero = |k: usize, l: usize| between(&triangle[k], &triangle[l], heights[k] / (heights[k] - heights[l]));
    if let Some(on) = (0..3).find(|&k| heights[k].abs() <= thin) {
        let (next, last) = ((on + 1) % 3, (on + 2) % 3);
        let across = zero(next, last);
        return [[triangle[on], triangle[next], across], [triangle[on], across, triangle[last]]].map(Site::Triangle).into();
    }
    // One corner is alone on its side.
    let alone = (0..3).find(|&k| (0..3).filter(|&l| (heights[l] > 0.0) == (heights[k] > 0.0)).count() == 1).unwrap_or(0);
    let (next, last) = ((alone + 1) % 3, (alone + 2) % 3);
    let (u, v) = (zero(alone, next), zero(alone, last));
    let (p, q) = (triangle[next], triangle[last]);
    // The shorter diagonal of the quadrilateral u p q v.
    let [second, third] = if distance_squared(&u, &q) < distance_squared(&p, &v) { [[u, p, q], [u, q, v]] } else { [[u, p, v], [p, q, v]] };
    [[triangle[alone], u, v], second, third].map(Site::Triangle).into()
}

fn between(a: &Point, b: &Point, share: f64) -> Point {
    std::array::from_fn(|axis| (1.0 - share) * a[axis] + share * b[axis])
}

/// The vector at length 1; `None` of one without length.
pub(super) fn unit(vector: &Point) -> Option<Point> {
    let length = dot(vector, vector).sqrt();
    (length > f64::MIN_POSITIVE).then(|| vector.map(|x| x / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area([a, b, c]: &[Point; 3]) -> f64 {
        let normal = cross(&subtract(b, a), &subtract(c, a));
        0.5 * dot(&normal, &normal).sqrt()
    }

    /// Parts fill the triangle and keep to their sides of the edge.
    #[test]
    fn cuts_keep_the_area_and_part_at_the_edge() {
        let mut seed = 9_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as f64 / f64::from(1_u32 << 31) * 4.0 - 2.0
        };
        let mut count = 0;
        for _ in 0..2000 {
            let mut point = || -> Point {
                let (x, y) = (random(), random());
                [x, y, 0.25 * x - 0.5 * y]
            };
            let (triangle, along) = ([point(), point(), point()], [point(), point(), point()]);
            let Some(parts) = cut(&triangle, &along, 1e-9) else { continue };
            count += 1;
            let triangles: Vec<[Point; 3]> =
                parts.iter().map(|part| if let Site::Triangle(corners) = part { *corners } else { panic!("{part:?}") }).collect();
            assert!((triangles.iter().map(area).sum::<f64>() - area(&triangle)).abs() < 1e-12);
            let normal = cross(&subtract(&along[1], &along[0]), &subtract(&along[2], &along[0]));
            let parted = (0..3).any(|k| {
                let inward = cross(&normal, &subtract(&along[(k + 1) % 3], &along[k]));
                triangles.iter().all(|part| {
                    let heights = part.map(|x| dot(&inward, &subtract(&x, &along[k])));
                    heights.iter().all(|h| *h >= -1e-9) || heights.iter().all(|h| *h <= 1e-9)
                })
            });
            assert!(parted, "{triangle:?} {along:?}");
        }
        assert!(count > 500, "{count}");
    }

    /// The farthest corner against a fine sample.
    #[test]
    fn no_point_of_a_triangle_is_farther_than_its_corners() {
        let mut seed = 4_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as f64 / f64::from(1_u32 << 31) * 4.0 - 2.0
        };
        for _ in 0..300 {
            let mut triangle = || -> [Point; 3] { std::array::from_fn(|_| std::array::from_fn(|_| random())) };
            let (p, q) = (triangle(), Site::Triangle(triangle()));
            let (most, corner) = farthest(&Site::Triangle(p), &q);
            assert_eq!(q.distance_squared(&corner).sqrt(), most);
            for (i, j) in (0..=20).flat_map(|i| (0..=20 - i).map(move |j| (f64::from(i) / 20.0, f64::from(j) / 20.0))) {
                let x: Point = std::array::from_fn(|k| p[0][k] + i * (p[1][k] - p[0][k]) + j * (p[2][k] - p[0][k]));
                assert!(q.distance_squared(&x).sqrt() <= most + 1e-12);
            }
        }
    }
}
