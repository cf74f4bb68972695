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
