//! Planes between a convex set and the origin.

use crate::attractor::cell::{Point, cross, dot, subtract};
use crate::measure::triangle::{Feature, closest_feature};

/// Steps of the search: most end after three.
const STEPS: usize = 12;

/// A vector that `parts` accepts, given the lowest point of a convex set along it; `None` when the set is no farther than `distance` from the origin, or when the search
/// gives up. `start` is a point of the set, `lowest` finds the lowest one along a vector.
///
/// Tried are the shortest vectors of simplices in the set: each becomes shorter with a point below the last one's plane, and the corners that it does not need are left out
/// (Gilbert, Johnson and Keerthi, 1988). Without simplices, with one new point at a time (Gilbert, 1966), a search does not come near the inside of a triangle in a hundred steps.
pub(super) fn parting(
    start: Point,
    distance: f64,
    lowest: impl Fn(&Point) -> Point,
    parts: impl Fn(&Point, &Point) -> bool,
) -> Option<Point> {
    let mut simplex = Simplex { corners: [start; 4], count: 1 };
    let mut shortest = start;
    for _ in 0..STEPS {
        let point = lowest(&shortest);
        if parts(&shortest, &point) {
            return Some(shortest);
        }
        if dot(&shortest, &shortest) <= distance * distance {
            return None;
        }
        simplex.add(point);
        shortest = simplex.shortest()?;
    }
    None
}

/// Whether the hull of a convex set and some vectors is surely farther than `distance` from the origin. `lowest` finds the set's lowest point along a direction, which it has
/// backwards, too; `start` is in the hull.
pub(super) fn avoids_origin(start: Point, lowest: impl Fn(&Point, &Point) -> Point, vectors: &[Point], distance: f64) -> bool {
    let lowest = |direction: &Point| {
        let backwards = direction.map(|part| -part);
        let point = lowest(direction, &backwards);
        let vector = farthest(vectors, &backwards).filter(|vector| dot(vector, direction) < dot(&point, direction));
        vector.copied().unwrap_or(point)
    };
    parting(start, distance, lowest, |direction, lowest| is_above(direction, lowest, distance)).is_some()
}

/// Whether a point is surely higher than `distance` along a direction.
fn is_above(direction: &Point, point: &Point, distance: f64) -> bool {
    let square = dot(direction, direction);
    dot(direction, point) > (distance * square.sqrt()).max(1e-9 * square)
}

/// The point that is farthest along a direction.
pub(super) fn farthest<'a>(points: &'a [Point], direction: &Point) -> Option<&'a Point> {
    points.iter().max_by(|a, b| dot(direction, a).total_cmp(&dot(direction, b)))
}

/// Up to four points.
struct Simplex {
    corners: [Point; 4],
    count: usize,
}

impl Simplex {
    fn add(&mut self, corner: Point) {
        self.corners[self.count] = corner;
        self.count += 1;
    }

    /// The shortest vector in their hull, `None` where that has the origin inside. Only the corners of the face that it ends on are kept: three at most.
    fn shortest(&mut self) -> Option<Point> {
        let [a, b, c, d] = self.corners;
        let on_faces = match self.count {
            // A corner that is there twice makes a face of the others.
            0..=2 => [[a, b, b]; 4],
            3 => [[a, b, c]; 4],
            _ => {
                let faces = [[a, b, c], [a, b, d], [a, c, d], [b, c, d]];
                let side = |face: &[Point; 3], x: &Point| {
                    let normal = cross(&subtract(&face[1], &face[0]), &subtract(&face[2], &face[0]));
                    dot(&normal, &subtract(x, &face[0]))
                };
                let others = [d, c, b, a];
                if (0..4).all(|k| side(&faces[k], &[0.0; 3]) * side(&faces[k], &others[k]) > 0.0) {
                    return None;
                }
                faces
            }
        };
        let nearest = |face: [Point; 3]| (face, closest_feature(&[0.0; 3], &face[0], &face[1], &face[2]));
        let length = |found: &([Point; 3], (Point, Feature))| dot(&found.1.0, &found.1.0);
        let (face, (shortest, feature)) = on_faces.into_iter().map(nearest).min_by(|p, q| length(p).total_cmp(&length(q)))?;
        self.count = match feature {
            Feature::Corner(k) => {
                self.corners[0] = face[usize::from(k)];
                1
            }
            Feature::Side(k) => {
                (self.corners[0], self.corners[1]) = (face[(usize::from(k) + 1) % 3], face[(usize::from(k) + 2) % 3]);
                2
            }
            Feature::Face => {
                self.corners[..3].copy_from_slice(&face);
                3
            }
        };
        Some(shortest)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::split_mix;

    /// The distance of the origin from the hull of points: from the nearest of their triangles, unless it is in one of their tetrahedra.
    pub(in crate::dilation) fn distance_from_hull(points: &[Point]) -> f64 {
        let count = points.len();
        let mut least = f64::INFINITY;
        for i in 0..count {
            for j in i..count {
                for k in j..count {
                    let (a, b, c) = (points[i], points[j], points[k]);
                    let nearest = closest_feature(&[0.0; 3], &a, &b, &c).0;
                    least = least.min(dot(&nearest, &nearest).sqrt());
                    for d in &points[k..] {
                        let volume =
                            |p: &Point, q: &Point, r: &Point, s: &Point| dot(&subtract(q, p), &cross(&subtract(r, p), &subtract(s, p)));
                        let all = volume(&a, &b, &c, d);
                        let zero = [0.0; 3];
                        let parts =
                            [volume(&zero, &b, &c, d), volume(&a, &zero, &c, d), volume(&a, &b, &zero, d), volume(&a, &b, &c, &zero)];
                        if all.abs() > 1e-12 && parts.iter().all(|part| part * all > 0.0) {
                            return 0.0;
                        }
                    }
                }
            }
        }
        least
    }

    #[test]
    fn hulls_are_apart_where_all_their_simplices_are() {
        let mut seed = 11_u64;
        let mut next = || {
            seed = seed.wrapping_add(split_mix::STEP);
            (split_mix::number(seed) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let (mut apart, mut missed) = (0, 0);
        for round in 0..20_000_u32 {
            let count = 1 + round as usize % 7;
            // About the origin or beside it, as a cloud, nearly in a plane, or nearly on a line.
            let (flat, thin) = ([1.0, 1e-3][round as usize / 7 % 2], [1.0, 1e-2][round as usize / 14 % 2]);
            let offset = 1.2 * next();
            let points: Vec<Point> = (0..count).map(|_| [next() + offset, thin * next() + 0.3 * offset, flat * next()]).collect();
            let (true_distance, distance) = (distance_from_hull(&points), 0.4 * next().abs());
            // One of them as the set.
            let found = avoids_origin(points[0], |_, _| points[0], &points[1..], distance);
            assert!(!found || true_distance > distance * (1.0 - 1e-9), "{points:?}: {true_distance} {distance}");
            if true_distance > 1.001 * distance + 1e-6 {
                apart += 1;
                missed += usize::from(!found);
            }
        }
        assert!(apart > 5_000 && missed * 1_000 < apart, "{missed} of {apart}");
    }
}
