//! Hausdorff distances of shapes that share surface: closed forms within few nodes, and random sets against fine samples.

use crate::oracle::Random;
use glam::DVec3;
use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_kernel::measure::triangle::closest_on_triangle;
use lacuna_kernel::measure::{Directed, Hausdorff, Interval, hausdorff};
use lacuna_kernel::model::{Interior, Model, PolygonMesh, Shape};
use lacuna_kernel::tolerance::Tolerance;

type Triangle = [DVec3; 3];

fn mesh(triangles: &[Triangle], interior: Interior) -> Attractor {
    let mut vertices: Vec<DVec3> = Vec::new();
    let mut number = |x: DVec3| {
        vertices.iter().position(|known| *known == x).unwrap_or_else(|| {
            vertices.push(x);
            vertices.len() - 1
        }) as u32
    };
    let faces = triangles.iter().map(|corners| corners.map(&mut number).to_vec()).collect();
    Model { name: None, shape: Shape::Mesh(PolygonMesh { vertices, faces, interior }) }.lower().unwrap().attractor
}

/// A box from `low` on, each face in `cells` times `cells` rectangles, cut along one diagonal or the other. Outward.
fn block(low: DVec3, size: DVec3, cells: u32, other_diagonal: bool) -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [0, cells] {
            for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
                let at = |di: u32, dj: u32| {
                    let mut place = [0; 3];
                    (place[axis], place[u], place[v]) = (side, i + di, j + dj);
                    low + size * DVec3::from_array(place.map(|k| f64::from(k) / f64::from(cells)))
                };
                let (a, b, c, d) = (at(0, 0), at(1, 0), at(1, 1), at(0, 1));
                let two = if other_diagonal { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] };
                triangles.extend(two.map(|[p, q, r]| if side == 0 { [p, r, q] } else { [p, q, r] }));
            }
        }
    }
    triangles
}

/// Both ways, as narrow as the tolerance, with no more nodes looked at than said.
fn far(a: &Attractor, b: &Attractor, tolerance: f64, nodes: u64) -> Hausdorff {
    let budget = Budget { limits: Limits { cells: nodes, ..Limits::default() }, ..Budget::default() };
    let found = hausdorff(a, b, Tolerance::new(tolerance).unwrap(), &budget).unwrap();
    assert!(found.complete, "{nodes} {tolerance} {found:?}");
    for directed in [found.from_first, found.from_second] {
        assert!(directed.distance_mm.width() <= tolerance, "{directed:?}");
    }
    found
}

fn holds(found: Directed, exact: f64) {
    assert!(found.distance_mm.low <= exact + 1e-12 && exact <= found.distance_mm.high, "{exact} {found:?}");
}

#[test]
fn a_cube_and_itself_are_done_at_once() {
    for interior in [Interior::Solid, Interior::Surface] {
        let cube = |cells, diagonal| mesh(&block(DVec3::ZERO, DVec3::splat(20.0), cells, diagonal), interior);
        let (coarse, turned, fine, finer) = (cube(1, false), cube(1, true), cube(6, true), cube(7, false));
        for (a, b, nodes) in [
            (&coarse, &coarse, 20_000),
            (&coarse, &turned, 20_000),
            (&fine, &fine, 400_000),
            (&fine, &coarse, 400_000),
            (&fine, &finer, 4_000_000),
        ] {
            for tolerance in [0.05, 1e-4] {
                let found = far(a, b, tolerance, nodes);
                holds(found.from_first, 0.0);
                holds(found.from_second, 0.0);
            }
        }
    }
}

/// Translates of a convex body, and their surfaces, are as far as they were moved.
#[test]
fn translated_cubes_and_nested_ones() {
    for interior in [Interior::Solid, Interior::Surface] {
        let cube = |low: DVec3, size: f64, cells, diagonal| mesh(&block(low, DVec3::splat(size), cells, diagonal), interior);
        let here = cube(DVec3::ZERO, 20.0, 3, false);
        for (shift, distance) in [(DVec3::X, 1.0), (DVec3::new(0.0, 3.0, -4.0), 5.0), (DVec3::new(1.0, 2.0, 2.0), 3.0)] {
            let found = far(&here, &cube(shift, 20.0, 2, true), 0.05, 400_000);
            holds(found.from_first, distance);
            holds(found.from_second, distance);
        }
        // Half a cube is a part of it, whose far side is 10 away.
        let half = mesh(&block(DVec3::ZERO, DVec3::new(10.0, 20.0, 20.0), 2, true), interior);
        let found = far(&here, &half, 0.05, 400_000);
        holds(found.from_first, 10.0);
        // The middle of the half's end is 10 from the other surface.
        holds(found.from_second, if interior == Interior::Solid { 0.0 } else { 10.0 });
    }
    // The nested cube's corner is 5 sqrt 3 away, at any tolerance.
    let cube = |low: f64, size: f64| mesh(&block(DVec3::splat(low), DVec3::splat(size), 2, false), Interior::Solid);
    let found = far(&cube(0.0, 20.0), &cube(5.0, 10.0), 1e-6, 400_000);
    holds(found.from_first, 5.0 * 3.0_f64.sqrt());
    holds(found.from_second, 0.0);
}

/// A solid against itself with a slot: the deepest point of the slot is half its width from the walls, at the open end and everywhere; and against itself with a
/// void, whose middle is the farthest.
#[test]
fn maxima_of_the_inside_are_found() {
    let solid = |triangles: &[Triangle]| mesh(triangles, Interior::Solid);
    let outer = block(DVec3::ZERO, DVec3::splat(20.0), 2, false);
    let void = block(DVec3::new(4.0, 5.0, 6.0), DVec3::new(2.0, 8.0, 9.0), 1, true).into_iter().map(|[a, b, c]| [a, c, b]);
    let hollow: Vec<Triangle> = outer.iter().copied().chain(void).collect();
    let found = far(&solid(&outer), &solid(&hollow), 0.05, 2_000_000);
    holds(found.from_first, 1.0);
    holds(found.from_second, 0.0);
    // The wall between the voids of two hollow boxes, thin and aslant to none: each is full where the other is not.
    let shifted = block(DVec3::new(4.0, 5.0, 8.0), DVec3::new(2.0, 8.0, 9.0), 1, true).into_iter().map(|[a, b, c]| [a, c, b]);
    let other: Vec<Triangle> = outer.iter().copied().chain(shifted).collect();
    let found = far(&solid(&hollow), &solid(&other), 0.05, 2_000_000);
    // What is material of the first in the second's void: 2 at its upper end, where the middle is 1 from three sides.
    holds(found.from_first, 1.0);
    holds(found.from_second, 1.0);
}

fn distance(x: DVec3, triangles: &[Triangle]) -> f64 {
    let to = |[a, b, c]: &Triangle| {
        DVec3::from_array(closest_on_triangle(&x.to_array(), &a.to_array(), &b.to_array(), &c.to_array())).distance(x)
    };
    triangles.iter().map(to).fold(f64::INFINITY, f64::min)
}

/// The largest distance over a sample of triangles, and how far their points are from it at most.
fn sampled(from: &[Triangle], to: impl Fn(DVec3) -> f64) -> (f64, f64) {
    let steps = 24;
    let points = |[a, b, c]: Triangle| {
        (0..=steps).flat_map(move |i| {
            (0..=steps - i).map(move |j| a + (b - a) * (f64::from(i) / f64::from(steps)) + (c - a) * (f64::from(j) / f64::from(steps)))
        })
    };
    let size = from.iter().flat_map(|[a, b, c]| [a.distance(*b), b.distance(*c), c.distance(*a)]).fold(0.0, f64::max);
    (from.iter().copied().flat_map(points).map(to).fold(0.0, f64::max), size / f64::from(steps))
}

/// Random triangles; and triangles in the planes of others, which share parts with them.
#[test]
fn random_triangles_against_fine_samples() {
    let mut random = Random(17);
    for round in 0..60 {
        let first: Vec<Triangle> = (0..1 + round % 4).map(|_| std::array::from_fn(|_| random.point(10.0))).collect();
        let mut second: Vec<Triangle> = (0..1 + round % 3).map(|_| std::array::from_fn(|_| random.point(10.0))).collect();
        if round % 2 == 0 {
            for [a, b, c] in &first {
                let mut within = || *a + (*b - *a) * random.between(-0.5, 1.0) + (*c - *a) * random.between(-0.5, 1.0);
                second.push([within(), within(), within()]);
                second.push([*a, *b, within()]);
            }
        }
        let found = far(&mesh(&first, Interior::Surface), &mesh(&second, Interior::Surface), 0.05, 2_000_000);
        for (directed, from, to) in [(found.from_first, &first, &second), (found.from_second, &second, &first)] {
            let (least, error) = sampled(from, |x| distance(x, to));
            assert!(directed.distance_mm.high >= least - 1e-9 && directed.distance_mm.low <= least + error, "{round} {directed:?} {least}");
            let at = DVec3::from_array(directed.place.centre);
            assert!(distance(at, to) >= directed.distance_mm.low - 1e-6 && distance(at, from) <= directed.place.radius + 1e-6);
        }
    }
}

/// Solid tetrahedra, among them ones that share a face or an edge, against samples of what they enclose.
#[test]
fn random_solids_against_fine_samples() {
    let mut random = Random(23);
    let faces = |p: [DVec3; 4]| {
        let [a, b, c, d] = p;
        let outward = (b - a).cross(c - a).dot(d - a) < 0.0;
        let all = [[a, b, c], [a, d, b], [b, d, c], [c, d, a]];
        if outward { all } else { all.map(|[a, b, c]| [a, c, b]) }
    };
    for round in 0..40 {
        let p: [DVec3; 4] = std::array::from_fn(|_| random.point(10.0));
        let mut q: [DVec3; 4] = std::array::from_fn(|_| random.point(10.0));
        let shared = round % 5;
        q[..shared.min(3)].copy_from_slice(&p[..shared.min(3)]);
        if shared == 4 {
            // One of them along the faces of the other, from the same corner.
            let t: [f64; 3] = std::array::from_fn(|_| random.between(0.3, 1.7));
            q = [p[0], p[0] + (p[1] - p[0]) * t[0], p[0] + (p[2] - p[0]) * t[1], p[0] + (p[3] - p[0]) * t[2]];
        }
        let within = |x: DVec3, faces: &[Triangle]| faces.iter().all(|[a, b, c]| (*b - *a).cross(*c - *a).dot(x - *a) <= 0.0);
        let sets = [faces(p), faces(q)];
        let solids = sets.each_ref().map(|set| mesh(set, Interior::Solid));
        let found = far(&solids[0], &solids[1], 0.1, 4_000_000);
        for (directed, from, to) in [(found.from_first, p, &sets[1]), (found.from_second, q, &sets[0])] {
            let steps = 24;
            let mut least = 0.0_f64;
            for (i, j, k) in (0..=steps).flat_map(|i| (0..=steps - i).flat_map(move |j| (0..=steps - i - j).map(move |k| (i, j, k)))) {
                let share = |k: i32| f64::from(k) / f64::from(steps);
                let x = from[0] + (from[1] - from[0]) * share(i) + (from[2] - from[0]) * share(j) + (from[3] - from[0]) * share(k);
                least = least.max(if within(x, to) { 0.0 } else { distance(x, to) });
            }
            // A tetrahedron is convex: corners are the farthest from a convex solid.
            assert!(directed.distance_mm.low <= least + 1e-9 && least <= directed.distance_mm.high + 1e-9, "{round} {directed:?} {least}");
        }
    }
}

#[test]
fn what_both_have_costs_nothing() {
    let fine = block(DVec3::ZERO, DVec3::splat(20.0), 24, true);
    for interior in [Interior::Solid, Interior::Surface] {
        // Also where the triangles come in another order, and begin with another corner.
        let turned: Vec<Triangle> = fine.iter().rev().map(|&[a, b, c]| [b, c, a]).collect();
        let (first, second) = (mesh(&fine, interior), mesh(&turned, interior));
        for (a, b) in [(&first, &first), (&first, &second), (&second, &first)] {
            let found = far(a, b, 1e-5, 1);
            assert_eq!((found.distance_mm().low, found.distance_mm().high), (0.0, 0.0));
        }
        // Turned over they are not known to be the same, and are searched: a surface is where it was.
        if interior == Interior::Surface {
            let over: Vec<Triangle> = block(DVec3::ZERO, DVec3::splat(20.0), 4, true).iter().map(|&[a, b, c]| [a, c, b]).collect();
            let found = far(&mesh(&block(DVec3::ZERO, DVec3::splat(20.0), 4, true), interior), &mesh(&over, interior), 1e-3, 1_000_000);
            assert!(found.distance_mm().low == 0.0);
        }
        // A second block beside the first, lower by 1 in the other. The solids differ, so that the inside is searched.
        let coarse = block(DVec3::ZERO, DVec3::splat(20.0), 2, true);
        let beside = |z: f64| [coarse.clone(), block(DVec3::new(40.0, 0.0, z), DVec3::splat(5.0), 1, true)].concat();
        let (level, lower) = (mesh(&beside(0.0), interior), mesh(&beside(-1.0), interior));
        let found = far(&level, &lower, 0.05, 4_000_000);
        holds(found.from_first, 1.0);
        holds(found.from_second, 1.0);
        // A solid that holds the other: only the surface is shared.
        let found = far(&level, &mesh(&coarse, interior), 0.05, 4_000_000);
        holds(found.from_first, 25.0);
        holds(found.from_second, 0.0);
    }
}

/// The graph of a function over a square of side 2, in `cells` times `cells` rectangles of uneven sizes.
fn graph(cells: u32, other_diagonal: bool, height: impl Fn(f64, f64) -> f64) -> Vec<Triangle> {
    // Values of a cubic at even steps: hardly any edges of two graphs lie along each other.
    let step = |k: u32| {
        let t = 2.0 * f64::from(k) / f64::from(cells) - 1.0;
        0.5 * (t + t.powi(3))
    };
    let at = |i: u32, j: u32| DVec3::new(step(i), step(j), height(step(i), step(j)));
    let corners = |i: u32, j: u32| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
    let two = |[a, b, c, d]: [DVec3; 4]| if other_diagonal { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] };
    (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))).flat_map(|(i, j)| two(corners(i, j))).collect()
}

#[test]
fn near_copies_are_laid_over_each_other_once() {
    // A paraboloid of two triangulations: everywhere as far as chords are from it, so that nothing but the cuts keeps pieces large.
    let bowl = |x: f64, y: f64| 0.3 * (x * x + y * y);
    let (coarse, fine) = (graph(24, false, bowl), graph(61, true, bowl));
    let [a, b] = [&coarse, &fine].map(|triangles| mesh(triangles, Interior::Surface));
    let tolerance = 2e-5;
    let found = far(&a, &b, tolerance, 3_000_000);
    // Corners and middles are a sample. No triangle is farther from the bowl than 0.3 times the square of the circle's radius that its rectangle has.
    let sample = |from: &[Triangle], to: &[Triangle]| {
        let points = from.iter().flat_map(|[a, b, c]| [*a, *b, *c, (*a + *b + *c) / 3.0]);
        points.map(|x| distance(x, to)).fold(0.0, f64::max)
    };
    let off = |triangles: &[Triangle]| {
        let sides = triangles.iter().flat_map(|[a, b, c]| [*b - *a, *c - *b, *a - *c]);
        0.3 * sides.map(|side| 0.25 * side.truncate().length_squared()).fold(0.0, f64::max)
    };
    let most = off(&coarse) + off(&fine);
    for (directed, least) in [(found.from_first, sample(&coarse, &fine)), (found.from_second, sample(&fine, &coarse))] {
        let Interval { low, high } = directed.distance_mm;
        assert!(high >= least && low <= most && least > 50.0 * tolerance, "{directed:?} {least} {most}");
    }
}

#[test]
fn rough_near_copies_against_fine_samples() {
    let mut random = Random(77);
    for round in 0..12 {
        // Folds, holes and steep places: what lies over nothing, or over the wrong triangle, is searched as before.
        let rough = 0.02 + 0.3 * random.unit();
        let mut noisy = |cells: u32, other: bool| {
            let mut triangles = graph(cells, other, |x, y| 0.3 * x * y);
            for corner in triangles.iter_mut().flatten() {
                // The same corner moves the same way, wherever it is met.
                let turn = 1e4 * (corner.x * 12.9898 + corner.y * 78.233 + f64::from(round)).sin();
                corner.z += rough * (turn - turn.floor() - 0.5);
            }
            triangles.retain(|_| random.unit() < 0.95);
            triangles
        };
        let (first, second) = (noisy(7, false), noisy(9, true));
        let [a, b] = [&first, &second].map(|triangles| mesh(triangles, Interior::Surface));
        let found = far(&a, &b, 0.005, u64::MAX);
        for (directed, from, to) in [(found.from_first, &first, &second), (found.from_second, &second, &first)] {
            let (least, error) = sampled(from, |x| distance(x, to));
            assert!(directed.distance_mm.high >= least - 1e-9 && directed.distance_mm.low <= least + error, "{round} {directed:?} {least}");
        }
    }
}
