//! Surfaces that were drawn without the folds that they have where cells become smaller fast.
//!
//! Around an extraordinary vertex the cells of one ring may be a quarter as large as those of the ring before, not half. Then the sides of larger ones, which have the ends of smaller ones on them, bend in the surface, and what fills the gap between a straight side and its parts lies over the larger cell. That is within what a drawing
//! may be off; but where a surface turns back there is no side that sheets could follow. There the side is turned: it then parts the larger cell at the end of the smaller ones.
//!
//! Let the sides ab of triangles abd and bac become cd, and q be the place on ab that is closest to c. The map that takes q to c, is linear on the four triangles that q parts these two into, and keeps a, b, c and d, takes them to dac and dcb, and moves nothing farther than q. So the surface moves by no more than c is from ab, nor,
//! likewise, than d is.

use crate::attractor::cell::{Point, closest_on_segment, cross, distance_squared, dot, subtract, unit};
use crate::solid::TriMesh;
use crate::solid::half_edges::{HalfEdges, NONE, Star, next, previous};
use glam::DVec3;

/// Sides at which triangles turn by more than the angle with this cosine are folds, and the least that the cosines around one must gain.
const FOLDED: f64 = 0.0;
const GAIN: f64 = 0.1;
/// Triangles around a corner at most where a side is turned.
const MOST_AROUND: usize = 64;

/// The surface without folds, as far as sides can be turned so that none of it moves by more than `most`; and by how much some of it did, at most.
pub(super) fn unfolded(mesh: TriMesh, most: f64) -> (TriMesh, f64) {
    let points: Vec<Point> = mesh.vertices.iter().map(|vertex| vertex.to_array()).collect();
    let mut unfolding = Unfolding { mesh: HalfEdges::new(points, &mesh.triangles), moved: vec![0.0; mesh.triangles.len()], most };
    let all = 3 * unfolding.mesh.triangles();
    let mut folds: Vec<u32> = (0..all).filter(|&half| half < unfolding.mesh.twin(half) && unfolding.is_fold(half)).collect();
    if folds.is_empty() {
        return (mesh, 0.0);
    }
    // Each turn gains: a bound on how many there are keeps rounding from undoing some.
    let mut left = all;
    while let Some(half) = folds.pop().filter(|_| left > 0) {
        left -= 1;
        let pair = [half, unfolding.mesh.twin(half)];
        if unfolding.turn(half) {
            folds.extend(pair.into_iter().flat_map(|half| [half, next(half), previous(half)]).filter(|&half| unfolding.is_fold(half)));
        }
    }
    let moved = unfolding.moved.iter().copied().fold(0.0, f64::max);
    let (points, triangles, _) = unfolding.mesh.compact();
    (TriMesh { vertices: points.into_iter().map(DVec3::from_array).collect(), triangles }, moved)
}

/// A surface, and how far it moved, triangle by triangle, at most.
struct Unfolding {
    mesh: HalfEdges,
    moved: Vec<f64>,
    most: f64,
}

impl Unfolding {
    fn at(&self, vertex: u32) -> &Point {
        &self.mesh.points[vertex as usize]
    }

    /// The unit normal of a triangle; 0 of one without area.
    fn normal(&self, corners: [u32; 3]) -> Point {
        let [a, b, c] = corners.map(|corner| self.at(corner));
        unit(&cross(&subtract(b, a), &subtract(c, a)))
    }

    /// That of the one beyond a side; none at the border.
    fn beyond(&self, half: u32) -> Option<Point> {
        let twin = self.mesh.twin(half);
        if twin == NONE { None } else { self.mesh.triangle(twin / 3).map(|corners| self.normal(corners)) }
    }

    /// Whether a surface turns back at a side.
    fn is_fold(&self, half: u32) -> bool {
        let own = self.mesh.triangle(half / 3).map(|corners| self.normal(corners));
        own.zip(self.beyond(half)).is_some_and(|(own, beyond)| dot(&own, &beyond) < FOLDED)
    }

    /// Turns a side where there is a fold, if triangles turn by less around it then.
    fn turn(&mut self, half: u32) -> bool {
        if !self.is_fold(half) {
            return false;
        }
        let twin = self.mesh.twin(half);
        let [b, c, a, d] = [half, next(half), previous(half), next(twin)].map(|half| self.mesh.end(half));
        let off = [c, d].map(|corner| {
            let on = closest_on_segment(self.at(corner), self.at(a), self.at(b));
            distance_squared(self.at(corner), &on).sqrt()
        });
        let triangles = [half, twin].map(|half| (half / 3) as usize);
        let moved = triangles.map(|triangle| self.moved[triangle]).into_iter().fold(0.0, f64::max) + off[0].min(off[1]);
        // That there is no side cd yet is told by either that is not on the border.
        let mut star = Star::default();
        let around = [(c, d), (d, c)].into_iter().find(|&(own, _)| self.mesh.star(own, MOST_AROUND, &mut star));
        if moved > self.most || around.is_none_or(|(_, other)| star.ring.contains(&other)) {
            return false;
        }
        let [old, other] = [[a, b, c], [b, a, d]].map(|corners| self.normal(corners));
        let [of_a, of_b] = [[d, c, a], [c, d, b]].map(|corners| self.normal(corners));
        let [bc, ca, ad, db] = [next(half), previous(half), next(twin), previous(twin)].map(|half| self.beyond(half));
        let least = |pairs: [(&Point, &Option<Point>); 4], between: f64| {
            pairs.iter().filter_map(|(own, beyond)| beyond.as_ref().map(|beyond| dot(own, beyond))).fold(between, f64::min)
        };
        let before = least([(&old, &bc), (&old, &ca), (&other, &ad), (&other, &db)], dot(&old, &other));
        let after = least([(&of_b, &bc), (&of_a, &ca), (&of_a, &ad), (&of_b, &db)], dot(&of_a, &of_b));
        if after < before + GAIN {
            return false;
        }
        self.mesh.flip(half);
        triangles.into_iter().for_each(|triangle| self.moved[triangle] = moved);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::measure::triangle::closest_on_triangle;
    use crate::model::{BoundaryRule, Model, Scheme, Shape, Subdivision};
    use crate::split_mix::Random;
    use crate::tolerance::Tolerance;

    fn mesh(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> TriMesh {
        TriMesh { vertices: vertices.iter().copied().map(DVec3::from_array).collect(), triangles: triangles.to_vec() }
    }

    fn folds(mesh: &TriMesh) -> usize {
        let points = mesh.vertices.iter().map(|vertex| vertex.to_array()).collect();
        let unfolding = Unfolding { mesh: HalfEdges::new(points, &mesh.triangles), moved: Vec::new(), most: 0.0 };
        (0..3 * unfolding.mesh.triangles()).filter(|&half| half < unfolding.mesh.twin(half) && unfolding.is_fold(half)).count()
    }

    /// How far random places of a surface are from another at most.
    fn farthest(from: &TriMesh, to: &TriMesh, random: &mut Random, places: usize) -> f64 {
        let corners = |mesh: &TriMesh, triangle: [u32; 3]| triangle.map(|corner| mesh.vertices[corner as usize].to_array());
        let place = |triangle: usize, random: &mut Random| {
            let [a, b, c] = corners(from, from.triangles[triangle]);
            let (p, q) = (random.share(), random.share());
            let [p, q] = if p + q > 1.0 { [1.0 - p, 1.0 - q] } else { [p, q] };
            std::array::from_fn(|axis| a[axis] + p * (b[axis] - a[axis]) + q * (c[axis] - a[axis]))
        };
        let distance = |x: Point| {
            let squares = to.triangles.iter().map(|&triangle| {
                let [a, b, c] = corners(to, triangle);
                distance_squared(&x, &closest_on_triangle(&x, &a, &b, &c))
            });
            squares.fold(f64::INFINITY, f64::min).sqrt()
        };
        (0..places).map(|index| distance(place(index % from.triangles.len(), random))).fold(0.0, f64::max)
    }

    /// A side ab whose parts ac and cb bend over the triangle beyond it, by `deep`.
    fn bent(deep: f64, heights: [f64; 2]) -> TriMesh {
        let [up, down] = heights;
        mesh(
            &[[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [2.0, -deep, 0.0], [1.9, -3.0, down], [2.1, 3.0, up]],
            &[[0, 3, 1], [0, 1, 2], [0, 2, 4], [2, 1, 4]],
        )
    }

    #[test]
    fn a_side_that_bends_is_turned_if_that_is_near_enough() {
        let mut random = Random(3);
        for _ in 0..50 {
            let deep = 0.02 + 0.5 * random.share();
            let folded = bent(deep, [random.share() - 0.5, random.share() - 0.5]);
            assert_eq!(folds(&folded), 3);
            assert_eq!(unfolded(folded.clone(), 0.99 * deep), (folded.clone(), 0.0));
            let (flat, moved) = unfolded(folded.clone(), 1.01 * deep);
            assert_eq!((folds(&flat), flat.triangles.len()), (0, 4));
            assert!((moved - deep).abs() < 1e-12);
            let off = farthest(&folded, &flat, &mut random, 200).max(farthest(&flat, &folded, &mut random, 200));
            assert!(off <= moved, "{off} {moved}");
        }
    }

    /// Around its corners Loop's limit of a tetrahedron has rings a quarter as large as the ones before.
    #[test]
    fn extraordinary_corners_are_unfolded_within_what_may_be_off() {
        let mut random = Random(5);
        let vertices = [[-1.0, -1.0, 1.0], [1.0, -1.0, -1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, -1.0]].map(DVec3::from_array).to_vec();
        let faces = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]].map(Vec::from).to_vec();
        let (creases, corners, boundary, coefficients) = (Vec::new(), Vec::new(), BoundaryRule::default(), Vec::new());
        let surface = Subdivision { scheme: Scheme::Loop, vertices, faces, creases, corners, boundary, coefficients };
        let attractor = Model { name: None, shape: Shape::Subdivision(surface) }.lower().unwrap().attractor;
        for tolerance in [0.01, 0.003, 0.001] {
            let (drawn, _) = attractor.drawn(Tolerance::new(tolerance).unwrap(), &Budget::default()).unwrap();
            assert!(folds(&drawn) > 0, "{tolerance}");
            let (flat, moved) = unfolded(drawn.clone(), tolerance);
            assert_eq!((folds(&flat), flat.triangles.len()), (0, drawn.triangles.len()), "{tolerance}");
            assert!(moved > 0.0 && moved <= tolerance, "{tolerance}: {moved}");
            let off = farthest(&drawn, &flat, &mut random, 2_000).max(farthest(&flat, &drawn, &mut random, 2_000));
            assert!(off <= moved, "{tolerance}: {off} {moved}");
            // As closed as it was.
            let mut sides: Vec<[u32; 2]> = flat.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
            sides.sort_unstable();
            assert!(sides.windows(2).all(|pair| pair[0] != pair[1]) && sides.iter().all(|[a, b]| sides.binary_search(&[*b, *a]).is_ok()));
        }
    }
}
