//! Cubes in which the distance from a solid has no local maximum.
//!
//! Let x be a point outside of B where d(., B) > 0 has a local maximum, and Y the points of B closest to it. No direction u has u . (x - y) > 0 for all y in Y:
//! the one-sided derivative of d(., B) along u is the least u . (x - y) / |x - y| (Danskin), and would be positive.
//!
//! Let y be a point of Y on the surface of a solid B with outward faces, and K the cone that B is near y. Then x - y = w has w . k <= 0 for all k in K, since
//! no point of B is closer than y. Let n be the normals of the faces of K. If u . n <= 0 for all of them, u points into B or along it at every face, so a ray along
//! u that starts in K never leaves it, u is in the closure of K, and w . u <= 0. By Farkas' lemma w is therefore a sum of the n with weights that are
//! not negative, one of them positive. The faces of K lie on triangles of B that hold y.
//!
//! So where the triangles that may hold points closest to those of a cube have u . n > 0 for one u, all of them, there is no such x in the cube. What holds of B
//! alone holds of the union of several solids as well: every face of the union is one of theirs, and normals of faces within others only forbid more.

use super::flat::unit;
use super::{NodeId, Search, Which};
use crate::attractor::cell::{Point, cross, dot, subtract};

/// Triangles that may be nearest, at most.
const MOST_FACES: usize = 256;
/// A common direction is looked for when so many are known, and whenever they have become twice as many: most cubes with many have none.
const FIRST_FACES: usize = 8;
/// A normal is known if the sides' product is this share of the product of their lengths: then it is right to 1e-9.
const FLATTEST: f64 = 1e-6;
/// Least u . n, far above what the normals are wrong by.
const LEAST_COSINE: f64 = 1e-2;
/// Steps towards a common direction.
const STEPS: usize = 32;

impl Search<'_> {
    /// Whether the distance from the second shape surely has no local maximum in a ball: what may hold points closest to its own is among
    /// `near`, no farther than `reach` from the centre.
    pub(super) fn has_no_maximum(&mut self, centre: &Point, reach: f64, near: Vec<NodeId>) -> bool {
        let mut normals: Vec<Point> = Vec::new();
        let mut waiting = near;
        let mut looked = 0;
        while let Some(id) = waiting.pop() {
            looked += 1;
            if looked > 4 * MOST_FACES {
                return false;
            }
            if self.apart(Which::Second, centre, id).low > reach {
                continue;
            }
            if self.second.node(id).is_group() {
                waiting.extend(self.second.children(id));
                continue;
            }
            let Some([a, b, c]) = self.second.solid_triangle(id) else { return false };
            let (ab, ac) = (subtract(&b, &a), subtract(&c, &a));
            let product = cross(&ab, &ac);
            if dot(&product, &product) <= FLATTEST * FLATTEST * dot(&ab, &ab) * dot(&ac, &ac) || normals.len() == MOST_FACES {
                return false;
            }
            let Some(normal) = unit(&product) else { return false };
            normals.push(normal);
            if normals.len() >= FIRST_FACES && normals.len().is_power_of_two() && !has_common_direction(&normals) {
                return false;
            }
        }
        has_common_direction(&normals)
    }
}

/// Whether some direction has a positive product with all of these unit vectors. The perceptron: the vector with the least product is added until none is low.
fn has_common_direction(normals: &[Point]) -> bool {
    let sum = |a: &Point, b: &Point| -> Point { std::array::from_fn(|axis| a[axis] + b[axis]) };
    let mut direction = normals.iter().fold([0.0; 3], |total, normal| sum(&total, normal));
    for _ in 0..STEPS {
        let Some(along) = unit(&direction) else { return false };
        let Some(least) = normals.iter().min_by(|a, b| dot(a, &along).total_cmp(&dot(b, &along))) else { return false };
        if dot(least, &along) >= LEAST_COSINE {
            return true;
        }
        direction = sum(&along, &least.map(|x| 0.5 * x));
    }
    false
}
