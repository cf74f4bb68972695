//! Triangles as the graph of a function over a convex part of a plane.

use super::Place;
use crate::attractor::cell::Point;
use crate::dilation::surface::NameMap;
use crate::solid::box_tree::{Box32, BoxTree};
use crate::solid::contact::turn;
use crate::solid::half_edges::{HalfEdges, NONE, next};
use std::f64::consts::TAU;

/// Corners at most of the part of the plane: what is asked of all of them is asked of each place.
const MOST_CORNERS: usize = 2_048;

/// A surface with one height over each place of a convex part of the plane, with the third axis up.
pub(super) struct Ground {
    /// The triangles, counter-clockwise from above.
    pub(super) mesh: HalfEdges,
    pub(super) base: Base,
}

/// A convex part of the plane: its corners, counter-clockwise, but for those at which it goes straight on.
pub(super) struct Base {
    pub(super) corners: Vec<Place>,
}

impl Ground {
    /// The graph of triangles seen from above; none where they are none, or rounding bends a side of the part inward. Cost: about a microsecond for each.
    ///
    /// No two corners are over each other, all triangles turn the same way, and the sides that one alone has are a convex polygon: so its inside is covered once (a map of a surface that keeps directions covers a place as often as its border winds around it).
    pub(super) fn new(faces: impl ExactSizeIterator<Item = [Point; 3]>) -> Option<Self> {
        let mut numbers: NameMap<[u64; 2], u32> = NameMap::default();
        numbers.reserve(faces.len());
        let mut places: Vec<Point> = Vec::new();
        let mut triangles: Vec<[u32; 3]> = Vec::with_capacity(faces.len());
        for face in faces {
            let mut triangle = [0; 3];
            for (number, corner) in triangle.iter_mut().zip(face) {
                let at = corner.map(|x| x + 0.0);
                *number = *numbers.entry([at[0].to_bits(), at[1].to_bits()]).or_insert_with(|| {
                    places.push(at);
                    places.len() as u32 - 1
                });
                if places[*number as usize][2] != at[2] {
                    return None;
                }
            }
            let [a, b, c] = triangle.map(|corner| &places[corner as usize]);
            let area = turn(2, a, b, c);
            if area == 0.0 {
                return None;
            }
            if area < 0.0 {
                triangle.swap(1, 2);
            }
            triangles.push(triangle);
        }
        let mesh = HalfEdges::new(places, &triangles);
        let border = border(&mesh)?;
        let corners = convex(&border.into_iter().map(|corner| mesh.points[corner as usize]).collect::<Vec<_>>())?;
        (corners.len() <= MOST_CORNERS).then_some(())?;
        // What is near to each other is close in memory, too.
        let places = mesh.points;
        let mut tree = BoxTree::default();
        let of = |triangle: u32| triangles[triangle as usize].map(|corner| places[corner as usize]);
        tree.build(triangles.len(), |triangle| Some(Box32::of(&of(triangle))), false);
        let sorted: Vec<[u32; 3]> =
            (0..tree.leaves()).flat_map(|leaf| tree.items(leaf)).map(|&triangle| triangles[triangle as usize]).collect();
        Some(Self { mesh: HalfEdges::new(places, &sorted), base: Base { corners } })
    }

    /// The number of its triangles.
    pub(super) fn len(&self) -> usize {
        self.mesh.triangles() as usize
    }

    /// Where the corners of its triangles are, in their order.
    pub(super) fn triangles(&self) -> impl Iterator<Item = [Point; 3]> {
        let triangles = (0..self.mesh.triangles()).filter_map(|triangle| self.mesh.triangle(triangle));
        triangles.map(|corners| corners.map(|corner| self.mesh.points[corner as usize]))
    }
}

impl Base {
    /// A place, or one between it and the closest of the part, no farther from that than a distance.
    pub(super) fn inward(&self, at: Place, most: f64) -> Place {
        let (distance, foot) = self.away(at);
        let share = most / distance;
        if share < 1.0 { [0, 1].map(|axis| foot[axis] + share * (at[axis] - foot[axis])) } else { at }
    }

    /// How far a place is from the part, and the closest place of that.
    pub(super) fn away(&self, at: Place) -> (f64, Place) {
        let count = self.corners.len();
        let (mut best, mut is_inside) = ((f64::INFINITY, at), true);
        for k in 0..count {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % count]);
            let (way, own) = ([b[0] - a[0], b[1] - a[1]], [at[0] - a[0], at[1] - a[1]]);
            is_inside &= way[0] * own[1] - way[1] * own[0] >= 0.0;
            let share = ((way[0] * own[0] + way[1] * own[1]) / (way[0] * way[0] + way[1] * way[1])).clamp(0.0, 1.0);
            let closest = [a[0] + share * way[0], a[1] + share * way[1]];
            let square = (at[0] - closest[0]).powi(2) + (at[1] - closest[1]).powi(2);
            if square < best.0 {
                best = (square, closest);
            }
        }
        if is_inside { (0.0, at) } else { (best.0.sqrt(), best.1) }
    }
}

/// The corners along the one border of triangles, of which two have each other edge, in opposite directions; none where that is not so, or there are several borders.
pub(super) fn border(mesh: &HalfEdges) -> Option<Vec<u32>> {
    let halves = 3 * mesh.triangles();
    let is_border = |half: u32| mesh.twin(half) == NONE;
    if (0..halves).any(|half| !is_border(half) && mesh.twin(mesh.twin(half)) != half) {
        return None;
    }
    let first = (0..halves).find(|&half| is_border(half))?;
    let (mut all, mut half) = (Vec::new(), first);
    loop {
        all.push(mesh.end(half));
        // Around the corner. No half-edge is met twice, as each is met from one other.
        half = next(half);
        while !is_border(half) {
            half = next(mesh.twin(half));
        }
        if half == first {
            return (all.len() == (0..halves).filter(|&half| is_border(half)).count()).then_some(all);
        }
    }
}

/// By how much a way turns left from one vector to another, if it does not turn right.
pub(super) fn turned_left([ax, ay]: Place, [bx, by]: Place) -> f64 {
    // What is exactly straight on, or a little to the left, may be rounded to the right.
    (ax * by - ay * bx).max(0.0).atan2(ax * bx + ay * by)
}

/// The corners of a polygon at which it does not go straight on; none where it is not convex, counter-clockwise from above.
fn convex(polygon: &[Point]) -> Option<Vec<Place>> {
    let count = polygon.len();
    let (mut corners, mut turned) = (Vec::new(), 0.0);
    for k in 0..count {
        let [a, b, c] = [k + count - 1, k, k + 1].map(|k| &polygon[k % count]);
        let sign = turn(2, a, b, c);
        let (before, after) = ([b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]);
        if sign < 0.0 || (sign == 0.0 && before[0] * after[0] + before[1] * after[1] < 0.0) {
            return None;
        }
        if sign > 0.0 {
            turned += turned_left(before, after);
            corners.push([b[0], b[1]]);
        }
    }
    (turned < 1.5 * TAU).then_some(corners)
}
