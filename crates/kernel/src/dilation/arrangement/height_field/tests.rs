use super::super::between::Memory;
use super::super::faces::{Faces, Fault, Question};
use super::super::testing::{
    arranged, assert_bounds, assert_limited, assert_steady, distance_of_triangles, holds_everywhere, is_flat, lowered, topology,
};
use super::field::Field;
use super::ground::Ground;
use super::pair::{is_plane, rim};
use super::parts::parts;
use super::sheet::Sheet;
use super::{Limits, Place};
use crate::attractor::cell::{Point, distance_squared};
use crate::budget::{self, Budget};
use crate::dilation::convex::Convex as _;
use crate::dilation::dilate;
use crate::dilation::squares::Squares;
use crate::solid::Inside;
use crate::split_mix::Random;
use crate::tolerance::{Radius, Tolerance};
use glam::DVec3;
use std::f64::consts::TAU;

/// A triangulated part of the plane, some 10 mm wide.
#[derive(Clone, Debug)]
struct Part {
    places: Vec<Place>,
    triangles: Vec<[u32; 3]>,
}

impl Part {
    /// A rectangle in cells, whose diagonals go either way and whose inner corners are off a lattice.
    fn rectangle(count: u32, random: &mut Random) -> Self {
        let width = 10.0 / f64::from(count);
        let mut places = Vec::new();
        for j in 0..=count {
            for i in 0..=count {
                let is_inner = i % count > 0 && j % count > 0;
                let off = [random.share(), random.share()].map(|share| if is_inner { 0.4 * (share - 0.5) } else { 0.0 });
                places.push([width * (f64::from(i) + off[0]), width * (f64::from(j) + off[1])]);
            }
        }
        let mut triangles = Vec::new();
        for (i, j) in (0..count).flat_map(|j| (0..count).map(move |i| (i, j))) {
            let [a, b, c, d] = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| j * (count + 1) + i);
            triangles.extend(if random.share() < 0.5 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
        }
        Self { places, triangles }
    }

    /// A polygon with so many corners, in rings.
    fn disc(corners: u32, rings: u32) -> Self {
        let mut places = vec![[5.0, 5.0]];
        for ring in 1..=rings {
            places.extend((0..corners).map(|k| {
                let (sine, cosine) = (TAU * f64::from(k) / f64::from(corners)).sin_cos();
                let far = 5.0 * f64::from(ring) / f64::from(rings);
                [5.0 + far * cosine, 5.0 + far * sine]
            }));
        }
        let at = |ring: u32, k: u32| if ring == 0 { 0 } else { 1 + (ring - 1) * corners + k % corners };
        let mut triangles: Vec<[u32; 3]> = (0..corners).map(|k| [0, at(1, k), at(1, k + 1)]).collect();
        for (ring, k) in (1..rings).flat_map(|ring| (0..corners).map(move |k| (ring, k))) {
            let [a, b, c, d] = [at(ring, k), at(ring + 1, k), at(ring + 1, k + 1), at(ring, k + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
        Self { places, triangles }
    }

    /// A triangle, with so many parts of its sides.
    fn triangle(count: u32) -> Self {
        let at = |i: u32, j: u32| j * (count + 1) - j * j.saturating_sub(1) / 2 + i;
        let (mut places, mut triangles) = (Vec::new(), Vec::new());
        for (i, j) in (0..=count).flat_map(|j| (0..=count - j).map(move |i| (i, j))) {
            // Sums of eighths, so that the sides are straight.
            places.push([0.625 * f64::from(i) + 0.25 * f64::from(j), 0.5 * f64::from(j)]);
            if i + j < count {
                triangles.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
            }
            if i + j + 1 < count {
                triangles.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        Self { places, triangles }
    }

    /// The corners of its triangles, with heights.
    fn graph(&self, height: impl Fn(usize, Place) -> f64) -> Vec<[Point; 3]> {
        let corner = |corner: u32| {
            let at = self.places[corner as usize];
            [at[0], at[1], height(corner as usize, at)]
        };
        self.triangles.iter().map(|triangle| triangle.map(corner)).collect()
    }
}

/// Heights of several kinds.
fn height(kind: usize, random: &mut Random) -> impl Fn(usize, Place) -> f64 + use<> {
    let rough: Vec<f64> = (0..1_000).map(|_| random.share()).collect();
    move |corner: usize, [x, y]: Place| match kind {
        0 => (0.9 * x).sin() * (0.7 * y).cos(),
        // Takagi's function, of both coordinates.
        1 => (0..4)
            .map(|k| f64::from(1 << k))
            .map(|k| ((x * k / 5.0).fract() - 0.5).abs() / k + ((y * k / 5.0).fract() - 0.5).abs() / k)
            .sum(),
        2 => 1.5 * rough[corner % rough.len()],
        // A cone.
        _ => 1.5 * (x - 5.0).hypot(y - 5.0),
    }
}

/// The part of the plane and the heights of a round.
fn graph(round: usize, random: &mut Random) -> Vec<[Point; 3]> {
    let part = match round % 3 {
        0 => Part::rectangle(14, random),
        1 => Part::disc(19, 9),
        _ => Part::triangle(16),
    };
    part.graph(height(round / 3 % 4, random))
}

/// Triangles as a surface, and its vertices and faces, with an axis up.
fn surface(triangles: &[[Point; 3]], axis: usize) -> (Vec<DVec3>, Vec<Vec<u32>>) {
    let place = |at: &Point| DVec3::from_array(std::array::from_fn(|k| at[(k + 2 - axis) % 3]));
    let vertices = triangles.iter().flatten().map(place).collect();
    (vertices, (0..triangles.len() as u32).map(|k| vec![3 * k, 3 * k + 1, 3 * k + 2]).collect())
}

fn ground(triangles: &[[Point; 3]]) -> Option<Ground> {
    Ground::new(triangles.iter().copied())
}

fn field(ground: &Ground, faces: &Faces, distances: [f64; 2]) -> Field {
    Field::new(parts(&ground.mesh, faces, distances), ground.len(), distances).unwrap()
}

fn limits(inner: f64, outer: f64) -> Limits<'static> {
    Limits { inner, outer, border: inner, rim: outer, rounding: 0.0, round: &|x| x }
}

#[test]
fn graphs_keep_their_bounds_and_are_balls() {
    let mut random = Random(13);
    let mut made = 0;
    for round in 0..24 {
        let triangles = graph(round, &mut random);
        let (vertices, faces) = surface(&triangles, round / 2 % 3);
        let (radius, tolerance) = ([1.7, 2.6, 5.3][round / 5 % 3], [0.1, 0.04][round % 2]);
        let (shape, tolerance) = (lowered(&vertices, faces.clone()), tolerance * radius);
        if !is_flat(&shape, radius, tolerance) {
            continue;
        }
        made += 1;
        let dilation = arranged(&shape, radius, tolerance);
        assert!(dilation.topology_exact && dilation.inner_mm <= tolerance && dilation.outer_mm <= tolerance, "{round}");
        assert_eq!(topology(&dilation), (1, 0, 2), "{round}");
        let distance = distance_of_triangles(&vertices, &faces);
        assert!(holds_everywhere(&dilation, radius, &distance, &mut random), "{round}");
        let inside = Inside::new(dilation.solid.mesh());
        for _ in 0..200 {
            let x = DVec3::from_array(std::array::from_fn(|_| 22.0 * random.share() - 6.0));
            assert_bounds(round, &inside, &dilation, radius, x, distance(x));
        }
    }
    assert!(made >= 20, "{made}");
}

/// Random triangles against the distances of many of their places: those that are accepted have none out of bounds, those that are not have one, but for what is about at a bound.
#[test]
fn triangles_are_held_against_their_bounds() {
    let mut random = Random(3);
    let triangles = Part::rectangle(8, &mut random).graph(height(2, &mut random));
    let ground = ground(&triangles).unwrap();
    let faces = Faces::of(&ground, 1.0);
    let (inner, outer) = (1.1, 1.4);
    let field = field(&ground, &faces, [inner, outer]);
    let distance = |x: &Point| faces.all.iter().map(|face| face.distance_squared(x)).fold(f64::INFINITY, f64::min).sqrt();
    let (mut counts, mut memory) = ([0; 3], Memory::default());
    for _ in 0..3_000 {
        let (x, y) = (12.0 * random.share() - 1.0, 12.0 * random.share() - 1.0);
        let Some(top) = field.top([x, y], inner + (outer - inner) * (1.8 * random.share() - 0.4)) else { continue };
        let wide = 1.5 * random.share().powi(2);
        let triangle: [Point; 3] = std::array::from_fn(|_| [x, y, top.height].map(|x| x + wide * (random.share() - 0.5)));
        let mut found = [f64::INFINITY, 0.0_f64];
        for (i, j) in (0..=16).flat_map(|i| (0..=16 - i).map(move |j| (i, j))) {
            let shares = [i, j, 16 - i - j].map(|share| f64::from(share) / 16.0);
            let at = std::array::from_fn(|axis| (0..3).map(|k| shares[k] * triangle[k][axis]).sum());
            let distance = distance(&at);
            found = [found[0].min(distance), found[1].max(distance)];
        }
        let close = 0.06 * wide + 1e-9;
        let question = Question { triangle, feet: None, owners: [top.owner; 3], inner, outer };
        match faces.fault(&field, &question, &mut memory) {
            None => {
                assert!(found[0] >= inner - 1e-9 && found[1] <= outer + 1e-9, "{triangle:?}: {found:?}");
                counts[0] += 1;
            }
            Some(Fault::Near(x, on)) => {
                assert!(found[0] <= inner + close && distance_squared(&x, &on).sqrt() < inner + 1e-9 && distance(&on) < 1e-9, "{found:?}");
                counts[1] += 1;
            }
            Some(Fault::Far(x)) => {
                assert!(found[1] >= outer - close && distance(&x) > outer - close, "{triangle:?}: {found:?}");
                counts[2] += 1;
            }
        }
    }
    assert!(counts.iter().all(|&count| count > 200), "{counts:?}");
}

#[test]
fn what_is_above_a_graph_is_as_far_from_it_as_is_asked() {
    let mut random = Random(29);
    for round in 0..13 {
        // The last has more around its middle than is looked at pair by pair.
        let triangles = if round < 12 { graph(round, &mut random) } else { Part::disc(400, 1).graph(height(2, &mut random)) };
        let ground = ground(&triangles).unwrap();
        for sign in [1.0, -1.0] {
            let faces = Faces::of(&ground, sign);
            let field = field(&ground, &faces, [1.2, 1.5]);
            for _ in 0..200 {
                let at = [13.0 * random.share() - 1.5, 13.0 * random.share() - 1.5];
                let asked = 1.2 + 0.3 * random.share();
                // Nothing is over what is farther from the part.
                assert_eq!(field.top(at, asked).is_some(), ground.base.away(at).0 <= asked, "{round} {at:?}");
                let Some(top) = field.top(at, asked) else { continue };
                let x = [at[0], at[1], top.height];
                let squares = faces.all.iter().map(|face| face.distance_squared(&x));
                let distance = squares.fold(f64::INFINITY, f64::min).sqrt();
                assert!((distance - asked).abs() < 1e-7, "{round} {at:?}: {distance} for {asked}");
                // Higher up it only grows.
                let higher = [at[0], at[1], top.height + 0.01];
                assert!(faces.all.iter().all(|face| face.distance_squared(&higher).sqrt() > asked), "{round} {at:?}");
            }
        }
    }
}

/// A sheet with a coarse border: whatever is added to it, it is known only if each of its triangles would be found right.
#[test]
fn sheets_are_known_only_where_all_triangles_are_right() {
    let mut random = Random(37);
    let triangles = Part::rectangle(10, &mut random).graph(height(0, &mut random));
    let (ground, limits) = (ground(&triangles).unwrap(), limits(1.1, 1.4));
    let faces = Faces::of(&ground, 1.0);
    let field = field(&ground, &faces, [limits.inner, limits.outer]);
    let mut sheet = Sheet::new(&ground.base, field, faces, f64::NEG_INFINITY);
    let corners = (0..40).map(|k| f64::from(k % 10) * 1.15).map(|x| x - 0.75).zip(0..);
    let border = corners.map(|(x, k)| [[x, -0.75], [10.75, x], [10.0 - x, 10.75], [-0.75, 10.0 - x]][k / 10]);
    let posts: Vec<u32> = (0..).zip(border).map(|(k, at)| sheet.raise_post(at, k, &limits).unwrap()).collect();
    let next: Vec<u32> = (0..40).map(|k| (k + 1) % 40).collect();
    assert!((0..40).all(|k| sheet.join(posts[k], posts[next[k] as usize])));
    let (mut memory, mut known) = (Memory::default(), 0);
    for round in 0..200 {
        // Triangles that were not mended are left, and something else is new.
        let found = sheet.check(&next, round % 3 == 0, &limits, &Budget::default()).unwrap();
        let base = sheet.base().unwrap();
        let is_right = |triangle: &[u32; 3]| {
            let question = limits.question(triangle.map(|corner| sheet.point(corner)), [u32::MAX; 3]);
            sheet.faces.fault(&sheet.field, &question, &mut memory).is_none()
        };
        let are_right = base.iter().all(is_right);
        assert!(are_right || sheet.known_base().is_none(), "{round}");
        known += u32::from(sheet.known_base().is_some());
        if round % 3 == 0 && found.is_done {
            assert!(are_right && sheet.known_base().is_some(), "{round}");
            break;
        }
        let at = [10.0 * random.share(), 10.0 * random.share()];
        sheet.raise(at, 0.5, None, &limits);
    }
    assert!(known > 0);
}

#[test]
fn lists_of_squares_have_no_more_than_they_may() {
    let squares = Squares::new([[0.0; 2], [10.0; 2]], 1.0, 1e6);
    let boxes = [(7, [[0.5, 0.5], [2.5, 1.5]]), (8, [[9.5, 9.5], [30.0, 30.0]])];
    let (starts, items) = squares.lists(10, boxes.into_iter()).unwrap();
    assert_eq!((starts[0], starts[1], items.len()), (0, 1, 10));
    assert_eq!(items.iter().filter(|&&item| item == 7).count(), 6);
    assert!(squares.lists(9, boxes.into_iter()).is_none());
}

#[test]
fn what_is_no_graph_over_a_convex_part_is_none() {
    let mut random = Random(41);
    let part = Part::rectangle(4, &mut random);
    let is_graph = |triangles: &[[Point; 3]]| ground(triangles).is_some();
    let flat = part.graph(|_, _| 0.0);
    assert!(is_graph(&flat));
    // Which way triangles turn is of no matter, nor in which order they are.
    let turned: Vec<[Point; 3]> =
        flat.iter().rev().enumerate().map(|(k, &[a, b, c])| if k % 3 == 0 { [c, b, a] } else { [b, c, a] }).collect();
    assert!(is_graph(&turned));
    // Nor is the sign of a zero.
    let signed: Vec<[Point; 3]> = (0..)
        .zip(&flat)
        .map(|(k, own)| if k % 2 == 0 { *own } else { own.map(|at| at.map(|x| if x == 0.0 { -0.0 } else { x })) })
        .collect();
    assert!(is_graph(&signed));
    let with = |more: [Point; 3]| [&flat[..], &[more]].concat();
    let without =
        |gone: &dyn Fn(usize) -> bool| flat.iter().enumerate().filter(|(k, _)| !gone(*k)).map(|(_, own)| *own).collect::<Vec<_>>();
    let refused = [
        Vec::new(),
        // One twice, what is over others, what is beside the rest, upright, without area, and at two heights.
        with(flat[5]),
        with([[1.0, 1.0, 1.0], [2.0, 1.0, 1.0], [1.0, 2.0, 1.0]]),
        with([[20.0, 0.0, 0.0], [21.0, 0.0, 0.0], [20.0, 1.0, 0.0]]),
        with([[10.0, 2.5, 0.0], [10.0, 5.0, 0.0], [10.0, 2.5, 3.0]]),
        with([[10.0, 0.0, 0.0], [11.0, 0.0, 0.0], [12.0, 0.0, 0.0]]),
        with([[10.0, 2.5, 0.0], [11.0, 4.0, 0.0], [10.0, 5.0, 1.0]]),
        // A corner of another's side, as the border turns right; and a corner on a side of another.
        with([[10.0, 2.5, 0.0], [11.0, 4.0, 0.0], [10.0, 5.0, 0.0]]),
        with([[10.0, 1.0, 0.0], [11.0, 4.0, 0.0], [10.0, 5.0, 0.0]]),
        // A bay, a hole, and what hangs together in a corner alone.
        without(&|k| k < 2),
        without(&|k| k == 12),
        without(&|k| k != 0 && k != 31),
        [part.graph(|_, _| 0.0), part.graph(|_, _| 1.0)].concat(),
    ];
    for (case, triangles) in refused.iter().enumerate() {
        assert!(!is_graph(triangles), "{case}");
    }
    // A strip around a place, twice: the border winds around it as often.
    let around = |k: u32| {
        let (sine, cosine) = (TAU * f64::from(k % 10) / 5.0).sin_cos();
        let far = 5.0 + 0.01 * f64::from(k % 10);
        [far * cosine, far * sine, 0.0]
    };
    let twice: Vec<[Point; 3]> = (0..10).map(|k| [[0.0; 3], around(k), around(k + 1)]).collect();
    assert!(!is_graph(&twice));
    // A corner of a border that goes straight on does not count.
    assert_eq!(ground(&flat).unwrap().base.corners.len(), 4);
}

#[test]
fn only_sheets_that_cover_the_inside_of_a_rim_once_are_planes() {
    let place = |x: f64, y: f64| [x, y, (x * y).sin()];
    let rim = [place(0.0, 0.0), place(4.0, 0.0), place(4.0, 4.0), place(0.0, 4.0)];
    let of = |inner: &[Point], triangles: &[[u32; 3]]| is_plane(&[&rim, inner].concat(), triangles, &rim);
    let fan = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    assert!(of(&[place(1.0, 2.0)], &fan) && of(&[], &[[0, 1, 2], [0, 2, 3]]));
    // The inner vertex is outside, or on an edge.
    assert!(!of(&[place(5.0, 2.0)], &fan) && !of(&[place(4.0, 2.0)], &fan));
    // A triangle is missing, twice there, or turned around.
    assert!(!of(&[place(1.0, 2.0)], &fan[1..]) && !of(&[place(1.0, 2.0)], &[&fan[..], &fan[..1]].concat()));
    assert!(!of(&[place(1.0, 2.0)], &[[1, 0, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]));
    // Two triangles cover the rest twice; the rim the other way around; one that is joined to nothing.
    assert!(!of(&[], &[[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]]));
    let turned: Vec<Point> = rim.iter().rev().copied().collect();
    assert!(!is_plane(&turned, &[[0, 1, 2], [0, 2, 3]], &turned));
    assert!(!of(&[place(9.0, 9.0), place(9.5, 9.0), place(9.0, 9.5)], &[[0, 1, 2], [0, 2, 3], [4, 5, 6]]));
    // Around a place twice.
    let twice: Vec<Point> = (0..10)
        .map(|k| (TAU * f64::from(k) / 5.0).sin_cos())
        .zip(1..)
        .map(|((y, x), k)| [f64::from(k) * x, f64::from(k) * y, 0.0])
        .collect();
    let inner: Vec<[u32; 3]> = (0..10).map(|k| [k, (k + 1) % 10, 10]).collect();
    assert!(!is_plane(&[&twice[..], &[[0.0; 3]]].concat(), &inner, &twice));
}

#[test]
fn rims_are_between_their_distances_from_convex_polygons() {
    let limits = limits(1.0, 1.2);
    for count in [3, 4, 7, 60] {
        let part = Part::disc(count, 1);
        let triangles = part.graph(|_, _| 0.0);
        let ground = ground(&triangles).unwrap();
        let rim = rim(&ground.base.corners, &limits).unwrap();
        for (k, from) in rim.iter().enumerate() {
            let to = rim[(k + 1) % rim.len()];
            for share in 0..=20 {
                let at = [0, 1].map(|axis| from[axis] + f64::from(share) / 20.0 * (to[axis] - from[axis]));
                let (distance, _) = ground.base.away(at);
                assert!(distance > limits.inner && distance < limits.outer, "{count}: {distance}");
            }
        }
    }
}

#[test]
fn few_planes_near_to_each_other_are_left_to_others() {
    let mut random = Random(53);
    let part = Part::rectangle(14, &mut random);
    let is_made = |triangles: &[[Point; 3]], radius: f64| {
        let (vertices, faces) = surface(triangles, 2);
        is_flat(&lowered(&vertices, faces), radius, 0.05 * radius)
    };
    let rough = part.graph(height(2, &mut random));
    assert!(is_made(&rough, 2.0) && !is_made(&rough, 0.3));
    // Of planes four corners are made, see `sum`.
    for plane in [part.graph(|_, _| 1.0), part.graph(|_, [x, y]| 0.5 * x - 0.25 * y)] {
        let (vertices, faces) = surface(&plane, 2);
        assert!(arranged(&lowered(&vertices, faces), 2.0, 0.1).solid.mesh().triangles.len() < 400);
    }
    // With a wire, or a part at another place, there is more than a graph.
    let (mut vertices, mut faces) = surface(&rough, 2);
    faces.push(vec![0, vertices.len() as u32]);
    vertices.push(DVec3::splat(12.0));
    assert!(!is_flat(&lowered(&vertices, faces), 2.0, 0.1));
}

#[test]
fn height_fields_do_not_depend_on_threads_and_can_be_stopped() {
    let (vertices, faces) = surface(&graph(6, &mut Random(61)), 1);
    let shape = lowered(&vertices, faces);
    assert!(is_flat(&shape, 2.1, 0.08));
    assert_steady(&shape, 2.1, 0.08);
}

#[test]
fn limits_hold_for_height_fields() {
    let (vertices, faces) = surface(&graph(6, &mut Random(67)), 2);
    let shape = lowered(&vertices, faces);
    assert!(is_flat(&shape, 2.1, 0.08));
    assert_limited(&shape, 2.1, 0.08);
}

/// What there is no room for polytopes around: 600 bytes for each of 24 triangles of one.
#[test]
fn graphs_of_more_triangles_than_polytopes_are_made() {
    let triangles = graph(6, &mut Random(73));
    let (vertices, faces) = surface(&triangles, 2);
    let shape = lowered(&vertices, faces);
    let with = |bytes_per_triangle: u64| {
        let memory_bytes = bytes_per_triangle * triangles.len() as u64;
        let budget = Budget { limits: budget::Limits { memory_bytes, ..budget::Limits::default() }, ..Budget::default() };
        dilate(&shape, Radius::new(2.1).unwrap(), Tolerance::new(0.08).unwrap(), &budget)
    };
    let [most, some] = [100_000, 4_000].map(|bytes| with(bytes).unwrap());
    assert!(most.pitch_mm.is_none() && some.pitch_mm.is_none());
    assert_eq!(most.solid.mesh(), some.solid.mesh());
    // Nor for what is known of the graph.
    assert!(with(1_500).is_ok_and(|made| made.pitch_mm.is_some()));
}

#[test]
fn graphs_anywhere_are_made_and_copies_are_put() {
    let mut random = Random(71);
    let triangles = graph(6, &mut random);
    let moved = |by: Point| triangles.iter().map(|own| own.map(|at| [0, 1, 2].map(|k| at[k] + by[k]))).collect::<Vec<[Point; 3]>>();
    let made = |triangles: &[[Point; 3]]| {
        let (vertices, faces) = surface(triangles, 2);
        let shape = lowered(&vertices, faces.clone());
        assert!(is_flat(&shape, 2.1, 0.2));
        let made = arranged(&shape, 2.1, 0.2);
        assert!(made.topology_exact && holds_everywhere(&made, 2.1, distance_of_triangles(&vertices, &faces), &mut Random(1)));
        topology(&made)
    };
    // About all axes, where zeros have signs, and far from them.
    assert_eq!(made(&moved([-5.0, -5.0, 0.0])), (1, 0, 2));
    assert_eq!(made(&moved([3_000.0, -7_000.25, 50.0])), (1, 0, 2));
    // Of what is there three times one is made.
    let three = [[0.0; 3], [32.0, 0.0, 8.0], [0.0, 32.0, -8.0]].map(moved).concat();
    assert_eq!(made(&three), (3, 0, 6));
}
