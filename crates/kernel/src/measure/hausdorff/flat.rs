//! Triangles that lie along triangles of another shape: how far they are from the nearest single one, and where to cut them
//! so that each part lies along one alone.
//!
//! The distance of x from a convex set S is a convex function of x: if y and y' are points of S closest to x and x', then
//! (1 - t) y + t y' belongs to S and is within (1 - t) |x - y| + t |x' - y'| of (1 - t) x + t x'. So the largest distance from
//! S over a triangle is at one of its corners. A shape B that holds S is no farther: the least, over sites S of B, of what
//! the farthest corner has bounds d(., B) on the whole triangle, whatever its size. Only a triangle that needs
//! several sites, as it lies across an edge of theirs or is nearest to several, is larger than its bound is good.
//!
//! Two triangulations of one face, or of two that are close, agree nowhere along their edges. So a triangle is laid over those of the other shape near it: planes at
//! right angles to it through their edges cut it into convex polygons, each over one of them or over none. The planes of two triangles at one edge are the same, however
//! they are bent, so that a polygon over one of them is bounded by it almost without an error. The bound holds whatever the cuts are, as the polygons fill the triangle.

use crate::attractor::cell::{Point, Site, between, cross, dot, subtract};
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

/// Cosine of the angle between triangles that do not lie along each other any more.
const ALONG: f64 = 0.7;
/// Polygons of a triangle, at most.
const MOST_POLYGONS: usize = 256;

/// A triangle of the other shape, and how far it stands from what it stands for, at most.
pub(super) struct Below {
    pub(super) corners: [Point; 3],
    pub(super) error: f64,
}

/// A triangle laid over others.
#[derive(Default)]
pub(super) struct Overlay {
    /// How far the polygons are that are no farther than is good enough.
    pub(super) settled: f64,
    /// All others, and what lies over none, in triangles.
    pub(super) rest: Vec<Site>,
}

/// Lays a triangle over others, of which the first that reach below a part are taken for it. Parts within `thin` of an edge may stay on either side of it.
/// Nothing if that makes too many polygons, or the triangle has no area. Cost: the product of both numbers.
pub(super) fn over(triangle: &[Point; 3], others: &[Below], thin: f64, good: f64) -> Option<Overlay> {
    let normal = |[a, b, c]: &[Point; 3]| unit(&cross(&subtract(b, a), &subtract(c, a)));
    let upright = normal(triangle)?;
    let mut overlay = Overlay::default();
    let (mut open, mut left) = (vec![triangle.to_vec()], Vec::new());
    for Below { corners, error } in others {
        let Some(cosine) = normal(corners).map(|other| dot(&upright, &other)).filter(|cosine| cosine.abs() >= ALONG) else { continue };
        // The height of a point over an edge, inwards: the third corner's is positive.
        let inward =
            |k: usize| unit(&cross(&upright, &subtract(&corners[(k + 1) % 3], &corners[k]))).map(|n| n.map(|x| x * cosine.signum()));
        let (Some(first), Some(second), Some(third)) = (inward(0), inward(1), inward(2)) else { continue };
        let planes = [(corners[0], first), (corners[1], second), (corners[2], third)];
        for polygon in open.drain(..) {
            let is_beside = |(from, inward): &(Point, Point)| polygon.iter().all(|x| dot(inward, &subtract(x, from)) <= thin);
            if planes.iter().any(is_beside) {
                left.push(polygon);
                continue;
            }
            let mut inside = polygon;
            for (from, inward) in &planes {
                if inside.iter().any(|x| dot(inward, &subtract(x, from)) < -thin) {
                    let (within, beyond) = divided(&inside, from, inward, thin);
                    left.push(beyond);
                    inside = within;
                }
            }
            // What the planes together leave beside the other triangle, though none does alone.
            if inside.len() < 3 {
                continue;
            }
            let other = Site::Triangle(*corners);
            let high = inside.iter().map(|x| other.distance_squared(x)).fold(0.0, f64::max).sqrt() + error;
            if high <= good { overlay.settled = overlay.settled.max(high) } else { overlay.rest.extend(fan(&inside)) }
        }
        std::mem::swap(&mut open, &mut left);
        if open.is_empty() {
            break;
        }
        if open.len() + overlay.rest.len() > MOST_POLYGONS {
            return None;
        }
    }
    overlay.rest.extend(open.iter().flat_map(|polygon| fan(polygon)));
    Some(overlay)
}

/// The parts of a convex polygon on both sides of a plane; corners within `thin` of it belong to both.
fn divided(polygon: &[Point], from: &Point, inward: &Point, thin: f64) -> (Vec<Point>, Vec<Point>) {
    let height = |x: &Point| Some(dot(inward, &subtract(x, from))).filter(|height| height.abs() > thin).unwrap_or(0.0);
    let (mut within, mut beyond) = (Vec::with_capacity(polygon.len() + 1), Vec::with_capacity(polygon.len() + 1));
    let mut last = polygon[polygon.len() - 1];
    let mut last_height = height(&last);
    for x in polygon {
        let own = height(x);
        if own * last_height < 0.0 {
            let across = between(&last, x, last_height / (last_height - own));
            within.push(across);
            beyond.push(across);
        }
        if own >= 0.0 {
            within.push(*x);
        }
        if own <= 0.0 {
            beyond.push(*x);
        }
        (last, last_height) = (*x, own);
    }
    (within, beyond)
}

/// A convex polygon as triangles.
fn fan(polygon: &[Point]) -> impl Iterator<Item = Site> {
    let (first, others) = polygon.split_at(polygon.len().min(1));
    others.windows(2).map(|pair| Site::Triangle([first[0], pair[0], pair[1]]))
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

    /// Polygons fill the triangle, and each is over one of the others alone, or over none.
    #[test]
    fn overlays_keep_the_area_and_part_at_the_edges() {
        let mut seed = 9_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as f64 / f64::from(1_u32 << 31) * 4.0 - 2.0
        };
        let mut count = 0;
        for _ in 0..2000 {
            let mut point = |lift: f64| -> Point {
                let (x, y) = (random(), random());
                [x, y, 0.25 * x - 0.5 * y + lift * random()]
            };
            let triangle = [point(0.0), point(0.0), point(0.0)];
            let others: Vec<Below> = (0..3).map(|_| Below { corners: [point(0.1), point(0.1), point(0.1)], error: 0.0 }).collect();
            // Nothing is good enough, so that all is told.
            let Some(Overlay { rest, .. }) = over(&triangle, &others, 1e-9, -1.0) else { continue };
            let parts: Vec<[Point; 3]> =
                rest.iter().map(|part| if let Site::Triangle(corners) = part { *corners } else { panic!("{part:?}") }).collect();
            count += usize::from(parts.len() > 3);
            assert!((parts.iter().map(area).sum::<f64>() - area(&triangle)).abs() < 1e-9);
            let upright = cross(&subtract(&triangle[1], &triangle[0]), &subtract(&triangle[2], &triangle[0]));
            let other = &others[0].corners;
            let normal = cross(&subtract(&other[1], &other[0]), &subtract(&other[2], &other[0]));
            if dot(&upright, &normal).abs() < ALONG * (dot(&upright, &upright) * dot(&normal, &normal)).sqrt() {
                continue;
            }
            // No part reaches from within the first to beyond one of its edges.
            for part in &parts {
                let heights: [[f64; 3]; 3] = std::array::from_fn(|k| {
                    let inward = cross(&upright, &subtract(&other[(k + 1) % 3], &other[k])).map(|x| x * dot(&upright, &normal).signum());
                    part.map(|x| dot(&inward, &subtract(&x, &other[k])))
                });
                let within = heights.iter().flatten().all(|height| *height >= -1e-6);
                let beyond = heights.iter().any(|edge| edge.iter().all(|height| *height <= 1e-6));
                assert!(within || beyond, "{triangle:?} {other:?} {part:?}");
            }
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
