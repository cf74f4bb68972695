//! Whether two triangles of a mesh meet elsewhere than where they are joined: exactly, by signs of determinants
//! (Shewchuk, "Adaptive precision floating-point arithmetic and fast robust geometric predicates", 1997).

use crate::attractor::cell::Point;
use robust::{Coord, Coord3D, orient2d, orient3d};

/// The sign of the volume of (a, b, c, d), as a number.
#[inline]
pub(crate) fn side(a: &Point, b: &Point, c: &Point, d: &Point) -> f64 {
    let coordinates = |p: &Point| Coord3D { x: p[0], y: p[1], z: p[2] };
    orient3d(coordinates(a), coordinates(b), coordinates(c), coordinates(d))
}

/// The sign of the area of (a, b, c) seen along an axis.
#[inline]
pub(crate) fn turn(axis: usize, a: &Point, b: &Point, c: &Point) -> f64 {
    let coordinates = |p: &Point| Coord { x: p[(axis + 1) % 3], y: p[(axis + 2) % 3] };
    orient2d(coordinates(a), coordinates(b), coordinates(c))
}

/// An axis along which a triangle is seen with area: projecting its plane along it loses nothing. `None` for a triangle without area.
pub(crate) fn view(triangle: &[Point; 3]) -> Option<usize> {
    (0..3).find(|&axis| turn(axis, &triangle[0], &triangle[1], &triangle[2]) != 0.0)
}

/// Whether a triangle has no area, exactly.
pub(crate) fn is_flat(triangle: &[Point; 3]) -> bool {
    view(triangle).is_none()
}

/// Whether two triangles meet elsewhere than in corners and edges that they share by name. Contacts count, and a triangle without area
/// meets whatever may touch its plane.
pub(crate) fn meet(names: [&[u32; 3]; 2], triangles: [&[Point; 3]; 2]) -> bool {
    let place = |corner: u32| names[1].iter().position(|&other| other == corner);
    let places = names[0].map(place);
    match places.iter().flatten().count() {
        0 => meet_apart(triangles[0], triangles[1]),
        1 => {
            let k = places.iter().position(Option::is_some).unwrap_or(0);
            let l = places[k].unwrap_or(0);
            meet_at_corner(&turned(triangles[0], k), &turned(triangles[1], l))
        }
        2 => {
            let k = places.iter().position(Option::is_none).unwrap_or(0);
            let l = (0..3).find(|&l| !places.contains(&Some(l))).unwrap_or(0);
            meet_at_edge(&turned(triangles[0], k), &triangles[1][l])
        }
        _ => true,
    }
}

/// The triangle with corner k first.
fn turned(triangle: &[Point; 3], k: usize) -> [Point; 3] {
    [triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3]]
}

/// The edge bc is shared: they overlap when both lie in a plane, on one side of bc.
fn meet_at_edge(triangle: &[Point; 3], other: &Point) -> bool {
    let [a, b, c] = triangle;
    if side(b, c, a, other) != 0.0 {
        return false;
    }
    let Some(axis) = view(triangle) else { return true };
    let there = turn(axis, b, c, other);
    there == 0.0 || (turn(axis, b, c, a) > 0.0) == (there > 0.0)
}

/// The first corners are shared. A common point beside the corner spans with it a segment that leaves one of the triangles through the opposite edge.
fn meet_at_corner(p: &[Point; 3], q: &[Point; 3]) -> bool {
    let sides = [side(&q[0], &q[1], &q[2], &p[1]), side(&q[0], &q[1], &q[2], &p[2])];
    if sides[0] * sides[1] > 0.0 {
        return false;
    }
    let others = [side(&p[0], &p[1], &p[2], &q[1]), side(&p[0], &p[1], &p[2], &q[2])];
    if others[0] * others[1] > 0.0 {
        return false;
    }
    crosses([&p[1], &p[2]], sides, q) || crosses([&q[1], &q[2]], others, p)
}

fn meet_apart(p: &[Point; 3], q: &[Point; 3]) -> bool {
    let sides: [f64; 3] = std::array::from_fn(|k| side(&q[0], &q[1], &q[2], &p[k]));
    let apart = |sides: &[f64; 3]| sides.iter().all(|&side| side > 0.0) || sides.iter().all(|&side| side < 0.0);
    if apart(&sides) {
        return false;
    }
    let others: [f64; 3] = std::array::from_fn(|k| side(&p[0], &p[1], &p[2], &q[k]));
    if apart(&others) {
        return false;
    }
    (0..3).any(|k| {
        let l = (k + 1) % 3;
        crosses([&p[k], &p[l]], [sides[k], sides[l]], q) || crosses([&q[k], &q[l]], [others[k], others[l]], p)
    })
}

/// Whether a segment meets a triangle, given on which sides of its plane the ends are.
fn crosses(ends: [&Point; 2], sides: [f64; 2], triangle: &[Point; 3]) -> bool {
    if (sides[0] > 0.0 && sides[1] > 0.0) || (sides[0] < 0.0 && sides[1] < 0.0) {
        return false;
    }
    if sides[0] == 0.0 || sides[1] == 0.0 {
        let Some(axis) = view(triangle) else { return true };
        let within = |k: usize| sides[k] == 0.0 && contains(axis, triangle, ends[k]);
        let all_flat = sides[0] == 0.0 && sides[1] == 0.0;
        return within(0) || within(1) || (all_flat && (0..3).any(|k| cross(axis, ends, [&triangle[k], &triangle[(k + 1) % 3]])));
    }
    let [a, b, c] = triangle;
    let turns = [side(ends[0], ends[1], a, b), side(ends[0], ends[1], b, c), side(ends[0], ends[1], c, a)];
    turns.iter().all(|&turn| turn >= 0.0) || turns.iter().all(|&turn| turn <= 0.0)
}

/// Whether a point of a triangle's plane lies in it.
fn contains(axis: usize, triangle: &[Point; 3], x: &Point) -> bool {
    let turns: [f64; 3] = std::array::from_fn(|k| turn(axis, &triangle[k], &triangle[(k + 1) % 3], x));
    turns.iter().all(|&turn| turn >= 0.0) || turns.iter().all(|&turn| turn <= 0.0)
}

/// Whether two segments of a plane cross in their insides. (Where one's end touches the other, both triangles' corners tell.)
fn cross(axis: usize, p: [&Point; 2], q: [&Point; 2]) -> bool {
    let opposite = |a: f64, b: f64| (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0);
    opposite(turn(axis, p[0], p[1], q[0]), turn(axis, p[0], p[1], q[1]))
        && opposite(turn(axis, q[0], q[1], p[0]), turn(axis, q[0], q[1], p[1]))
}
