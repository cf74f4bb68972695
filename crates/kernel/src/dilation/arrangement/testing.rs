//! What tests of arrangements have in common.

use super::Arrangement;
use crate::attractor::Attractor;
use crate::attractor::cell::{Cell, ControlPoint, Point, distance_squared, dot, subtract};
use crate::budget::{Budget, Limits, StopReason};
use crate::dilation::plan::{Balls, Plan};
use crate::dilation::{Dilation, DilationError, dilate};
use crate::measure::triangle::closest_on_triangle;
use crate::model::{AffineMap, Ifs, Interior, Model, PolygonMesh, Shape};
use crate::solid::{Inside, mend};
use crate::split_mix::Random;
use crate::tolerance::{Radius, Tolerance};
use glam::{DMat3, DVec3};
use std::fmt::Display;

pub(super) fn number(random: &mut Random) -> f64 {
    random.share()
}

pub(super) fn place(random: &mut Random, size: f64) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| size * number(random)))
}

pub(super) fn lowered(vertices: &[DVec3], faces: Vec<Vec<u32>>) -> Attractor {
    lowered_as(Interior::Surface, vertices, faces).unwrap()
}

/// None where a solid is asked for and there is none.
pub(super) fn lowered_as(interior: Interior, vertices: &[DVec3], faces: Vec<Vec<u32>>) -> Option<Attractor> {
    let shape = Shape::Mesh(PolygonMesh { vertices: vertices.to_vec(), faces, interior });
    Model { name: None, shape }.lower().ok().map(|lowered| lowered.attractor)
}

pub(in crate::dilation) fn points(vertices: &[DVec3]) -> Attractor {
    lowered(vertices, (0..vertices.len() as u32).map(|k| vec![k]).collect())
}

pub(in crate::dilation) fn wires(segments: &[[DVec3; 2]]) -> Attractor {
    let vertices: Vec<DVec3> = segments.iter().flatten().copied().collect();
    lowered(&vertices, (0..segments.len() as u32).map(|k| vec![2 * k, 2 * k + 1]).collect())
}

pub(in crate::dilation) fn system(maps: Vec<AffineMap>) -> Attractor {
    Model { name: None, shape: Shape::Ifs(Ifs { maps, primitive: None, graph: None }) }.lower().unwrap().attractor
}

/// Some copies of space, by about a half, turned anyhow, to some places.
pub(in crate::dilation) fn copies_in_space(random: &mut Random, count: usize) -> Attractor {
    let map = |random: &mut Random| {
        let turned = DMat3::from_axis_angle((place(random, 2.0) - DVec3::ONE).normalize_or(DVec3::X), 3.0 * random.share());
        AffineMap { linear: (0.3 + 0.25 * random.share()) * turned, translation: place(random, 40.0) }
    };
    system((0..count).map(|_| map(random)).collect())
}

/// Centres of balls, none larger than told, around cells of which a shape is the union; none where there are more than `most`.
pub(in crate::dilation) fn centres(shape: &Attractor, small: f64, most: usize) -> Option<Vec<DVec3>> {
    let roots = shape.roots().iter().enumerate();
    let mut open: Vec<(Cell, Vec<ControlPoint>)> = roots.map(|(index, root)| (shape.root_cell(index), root.points.clone())).collect();
    let mut centres = Vec::new();
    while let Some((cell, points)) = open.pop() {
        if cell.ball.radius <= small {
            centres.push(DVec3::from_array(cell.ball.centre));
        } else {
            open.extend(shape.children(&cell, &points));
        }
        if centres.len() + open.len() > most {
            return None;
        }
    }
    Some(centres)
}

pub(super) fn plan(attractor: &Attractor, radius: f64, tolerance: f64) -> Plan<'_> {
    plan_with(attractor, radius, tolerance, true)
}

fn plan_with(attractor: &Attractor, radius: f64, tolerance: f64, simplify: bool) -> Plan<'_> {
    let balls = Balls { least: Radius::new(radius).unwrap().mm(), most: radius };
    Plan::new(attractor, balls, Tolerance::new(tolerance).unwrap(), simplify, 1.0, &Budget::default()).unwrap()
}

pub(super) fn arranged_unless_left(attractor: &Attractor, radius: f64, tolerance: f64) -> Option<Dilation> {
    plan(attractor, radius, tolerance).run_arranged(&Budget::default()).unwrap()
}

pub(super) fn arranged(attractor: &Attractor, radius: f64, tolerance: f64) -> Dilation {
    arranged_unless_left(attractor, radius, tolerance).expect("there are few sites near each other")
}

pub(in crate::dilation) fn on_lattice(attractor: &Attractor, radius: f64, tolerance: f64) -> Dilation {
    run_on_lattice(&plan(attractor, radius, tolerance))
}

/// The same for its topology alone: that is exact, or not told, however coarse it is, and whether it is simplified or not.
pub(in crate::dilation) fn on_coarse_lattice(attractor: &Attractor, radius: f64, tolerance: f64) -> Dilation {
    run_on_lattice(&plan_with(attractor, radius, tolerance.max(0.1 * radius), false))
}

fn run_on_lattice(plan: &Plan<'_>) -> Dilation {
    let budget = Budget::default();
    let setting = plan.setting(plan.pitch(), &budget);
    plan.on_lattice(&setting, &plan.space(&setting), &budget).unwrap()
}

/// Components, cavities and the Euler number.
pub(in crate::dilation) fn topology(dilation: &Dilation) -> (u64, u64, i64) {
    let topology = dilation.solid.topology();
    (topology.components, topology.cavities, topology.euler)
}

/// Whether the surface is one over a plane.
pub(super) fn is_flat(shape: &Attractor, radius: f64, tolerance: f64) -> bool {
    let (plan, budget) = (plan(shape, radius, tolerance), Budget::default());
    let setting = plan.setting(plan.pitch(), &budget);
    let arrangement = Arrangement::new(&setting, plan.rule(), plan.space(&setting).candidates(), &budget).unwrap();
    arrangement.is_some_and(|arrangement| arrangement.flat.is_some())
}

/// Whether no triangle has a place whose distance from what was dilated is below or above the bounds, or meets another.
pub(super) fn holds_everywhere(dilation: &Dilation, radius: f64, distance: impl Fn(DVec3) -> f64, random: &mut Random) -> bool {
    let mesh = dilation.solid.mesh();
    let holds = |x: DVec3| (radius - dilation.inner_mm..=radius + dilation.outer_mm).contains(&distance(x));
    let is_within = mesh.triangles.iter().all(|triangle| {
        let [a, b, c] = triangle.map(|corner| mesh.vertices[corner as usize]);
        let shares = [random.share(), random.share()];
        let [s, t] = if shares[0] + shares[1] > 1.0 { shares.map(|share| 1.0 - share) } else { shares };
        [a, a.midpoint(b), b.midpoint(c), c.midpoint(a), (a + b + c) / 3.0, a + s * (b - a) + t * (c - a)].into_iter().all(&holds)
    });
    let points = mesh.vertices.iter().map(|vertex| vertex.to_array()).collect();
    let made = mend::mend(points, mesh.triangles.clone(), 1e-6, &Budget::default()).unwrap();
    is_within && made.crossings == 0
}

/// Asserts that an arrangement's dilation is the same for any number of threads, and that one which is cancelled is stopped.
pub(super) fn assert_steady(shape: &Attractor, radius: f64, tolerance: f64) {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| arranged(shape, radius, tolerance))
    };
    let one = with(1);
    for threads in [2, 5] {
        assert_eq!(one.solid.mesh(), with(threads).solid.mesh());
    }
    let budget = Budget::default();
    budget.cancel.fire(StopReason::Cancelled);
    let stopped = dilate(shape, Radius::new(radius).unwrap(), Tolerance::new(tolerance).unwrap(), &budget);
    assert!(matches!(stopped, Err(DilationError::Stopped(_))), "{stopped:?}");
}

/// Asserts that as many triangles as there are may be, and that fewer are refused.
pub(super) fn assert_limited(shape: &Attractor, radius: f64, tolerance: f64) {
    let with = |triangles: u64| {
        let budget = Budget { limits: Limits { triangles, ..Limits::default() }, ..Budget::default() };
        dilate(shape, Radius::new(radius).unwrap(), Tolerance::new(tolerance).unwrap(), &budget)
    };
    let made = with(Limits::default().triangles).unwrap().solid.mesh().triangles.len() as u64;
    assert!(with(made).is_ok());
    for triangles in [made - 1, made / 3, made / 50, 7] {
        assert!(matches!(with(triangles), Err(DilationError::Triangles { .. })), "{triangles}");
    }
}

/// Asserts that a place is inside if it is deeper than the bounds, and not if it is beyond; d is its distance from what was dilated.
pub(super) fn assert_bounds(case: impl Display, inside: &Inside<'_>, dilation: &Dilation, radius: f64, x: DVec3, d: f64) {
    if d < radius - dilation.inner_mm {
        assert_eq!(inside.winding(x), 1, "{case}: {x} is {d} from the sites");
    } else if d > radius + dilation.outer_mm {
        assert_eq!(inside.winding(x), 0, "{case}: {x} is {d} from the sites");
    }
}

/// How far places are from triangles: from each of those in a row that is not farther all together than the best so far, as its box tells.
pub(super) fn distance_of_triangles(vertices: &[DVec3], faces: &[Vec<u32>]) -> impl Fn(DVec3) -> f64 {
    let corners = |face: &Vec<u32>| [0, 1, 2].map(|k| vertices[face[k] as usize]);
    let row = |row: &[Vec<u32>]| -> (DVec3, DVec3, Vec<[DVec3; 3]>) {
        let all: Vec<[DVec3; 3]> = row.iter().map(corners).collect();
        let [low, high] = [DVec3::min, DVec3::max].map(|most| all.iter().flatten().copied().reduce(most).unwrap_or_default());
        (low, high, all)
    };
    let rows: Vec<(DVec3, DVec3, Vec<[DVec3; 3]>)> = faces.chunks(16).map(row).collect();
    move |x| {
        let beyond = |low: DVec3, high: DVec3| x.distance(x.clamp(low, high));
        let nearest = rows.iter().min_by(|a, b| beyond(a.0, a.1).total_cmp(&beyond(b.0, b.1)));
        nearest.into_iter().chain(&rows).fold(f64::INFINITY, |best, (low, high, all)| {
            if beyond(*low, *high) > best {
                return best;
            }
            let of = |[a, b, c]: &[DVec3; 3]| closest_on_triangle(&x.to_array(), &a.to_array(), &b.to_array(), &c.to_array());
            all.iter().map(|corners| x.distance(DVec3::from_array(of(corners)))).fold(best, f64::min)
        })
    }
}

/// What is told of a shape's arrangement, which there is.
pub(super) fn with_arrangement<T>(shape: &Attractor, radius: f64, tolerance: f64, told: impl FnOnce(&mut Arrangement) -> T) -> T {
    let (plan, budget) = (plan(shape, radius, tolerance), Budget::default());
    let setting = plan.setting(plan.pitch(), &budget);
    told(&mut Arrangement::new(&setting, plan.rule(), plan.space(&setting).candidates(), &budget).unwrap().unwrap())
}

/// The distance of a place from segments.
pub(super) fn distance_of_segments(x: DVec3, segments: &[[DVec3; 2]]) -> f64 {
    let of = |[a, b]: &[DVec3; 2]| {
        let along = *b - *a;
        let share = if along.length_squared() > 0.0 { ((x - *a).dot(along) / along.length_squared()).clamp(0.0, 1.0) } else { 0.0 };
        x.distance(*a + share * along)
    };
    segments.iter().map(of).fold(f64::INFINITY, f64::min)
}

/// Whether all places deeper than the bounds are inside and all beyond are not.
pub(super) fn keeps_its_bounds(dilation: &Dilation, segments: &[[DVec3; 2]], radius: f64, size: f64, random: &mut Random) {
    let inside = Inside::new(dilation.solid.mesh());
    for _ in 0..400 {
        // Half of them near a segment's surface.
        let x = if random.next().is_multiple_of(2) {
            let [a, b] = segments[(random.next() % segments.len() as u64) as usize];
            let away = place(random, 2.0) - DVec3::ONE;
            a.lerp(b, number(random)) + away.normalize_or_zero() * radius * (0.8 + 0.4 * number(random))
        } else {
            place(random, size)
        };
        assert_bounds("segments", &inside, dilation, radius, x, distance_of_segments(x, segments));
    }
}

/// The place in the plane, or on the line, of some points from which all are as far, the deficits included, if it is in the inside of their hull.
fn middle(points: &[(Point, f64)]) -> Option<Point> {
    let (origin, first) = points[0];
    let ways: Vec<Point> = points[1..].iter().map(|(at, _)| subtract(at, &origin)).collect();
    // 2 (x - p) . (q - p) = |q - p|^2 + deficits' difference, for x - p a sum of the ways.
    let count = ways.len();
    let mut rows: Vec<Vec<f64>> = (0..count)
        .map(|i| {
            let mut row: Vec<f64> = ways.iter().map(|way| 2.0 * dot(way, &ways[i])).collect();
            row.push(dot(&ways[i], &ways[i]) + points[i + 1].1 - first);
            row
        })
        .collect();
    for k in 0..count {
        let pivot = (k..count).max_by(|&a, &b| rows[a][k].abs().total_cmp(&rows[b][k].abs()))?;
        rows.swap(k, pivot);
        if rows[k][k].abs() < 1e-9 {
            return None;
        }
        for i in (0..count).filter(|&i| i != k) {
            let (share, pivot) = (rows[i][k] / rows[k][k], rows[k].clone());
            rows[i].iter_mut().zip(pivot).for_each(|(x, by)| *x -= share * by);
        }
    }
    let weights: Vec<f64> = (0..count).map(|k| rows[k][count] / rows[k][k]).collect();
    let is_within = weights.iter().all(|&weight| weight > 0.0) && weights.iter().sum::<f64>() < 1.0;
    let sum = weights.iter().zip(&ways).fold(origin, |sum, (weight, way)| std::array::from_fn(|axis| sum[axis] + weight * way[axis]));
    is_within.then_some(sum)
}

/// The critical values of the distance from points, and how many these are: at places that are in the hull of all points that are closest to them.
pub(in crate::dilation) fn critical_values(points: &[(Point, f64)]) -> Vec<(f64, u32)> {
    let mut found = Vec::new();
    for set in 3..1_u32 << points.len() {
        if !(2..=4).contains(&set.count_ones()) {
            continue;
        }
        let own: Vec<(Point, f64)> = (0..points.len()).filter(|k| set >> k & 1 == 1).map(|k| points[k]).collect();
        let Some(x) = middle(&own) else { continue };
        let square = |(at, deficit): &(Point, f64)| distance_squared(at, &x) + deficit;
        let value = square(&own[0]);
        if points.iter().all(|other| square(other) > value - 1e-12) {
            found.push((value.sqrt(), set.count_ones()));
        }
    }
    found
}
