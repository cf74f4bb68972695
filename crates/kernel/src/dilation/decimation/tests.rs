use super::cover::uncovered;
use super::{Decimation, SHORT, decimated, is_finer};
use crate::attractor::Attractor;
use crate::attractor::cell::Point;
use crate::budget::{Budget, StopReason};
use crate::dilation::arrangement::{Faces, without_lines};
use crate::dilation::drawn::WORTH_OF_FEW;
use crate::dilation::{dilate, predict};
use crate::measure::triangle::closest_on_triangle;
use crate::solid::{Inside, TriMesh};
use crate::split_mix::Random;
use crate::tolerance::{Radius, Tolerance};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Of so many triangles one has to be left at most, if nothing else is said.
const WORTH: usize = 8;

/// A grid of squares halved over the unit square, which is closed to rings where asked.
fn grid(along: u32, across: u32, is_ring: bool, at: impl Fn(f64, f64) -> DVec3) -> TriMesh {
    let [columns, rows] = [along, across].map(|count| if is_ring { count } else { count + 1 });
    let number = |i: u32, j: u32| (i % columns) * rows + j % rows;
    let places = (0..columns).flat_map(|i| (0..rows).map(move |j| [i, j]));
    let vertices = places.map(|[i, j]| at(f64::from(i) / f64::from(along), f64::from(j) / f64::from(across))).collect();
    let squares =
        (0..along).flat_map(|i| (0..across).map(move |j| [number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)]));
    TriMesh { vertices, triangles: squares.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect() }
}

/// A bumpy ring, with some noise.
fn ring(along: u32, across: u32, noise: f64) -> TriMesh {
    let mut random = Random(181);
    let mut mesh = grid(along, across, true, |u, v| {
        let (u, v) = (TAU * u, TAU * v);
        let (ring, height) = (20.0 + (8.0 + (3.0 * u).sin()) * v.cos(), (8.0 + (2.0 * u).cos()) * v.sin());
        DVec3::new(ring * u.cos(), ring * u.sin(), height)
    });
    mesh.vertices.iter_mut().for_each(|x| *x *= 1.0 + noise * (random.share() - 0.5));
    mesh
}

/// The base's radius and the height of a cylinder.
const BASE: f64 = 20.0;
const HIGH: f64 = 30.0;

/// A cylinder along the third axis, with as many sides as told.
fn cylinder(sides: u32) -> TriMesh {
    let at = |number: u32| {
        let (sine, cosine) = (TAU * f64::from(number % sides) / f64::from(sides)).sin_cos();
        DVec3::new(BASE * cosine, BASE * sine, if number < sides { 0.0 } else { HIGH })
    };
    let middles = [0.0, HIGH].map(|z| DVec3::new(0.0, 0.0, z));
    let vertices = (0..2 * sides).map(at).chain(middles).collect();
    let triangles = (0..sides).flat_map(|a| {
        let (b, up) = ((a + 1) % sides, sides);
        [[2 * up, b, a], [2 * up + 1, a + up, b + up], [a, b, b + up], [a, b + up, a + up]]
    });
    TriMesh { vertices, triangles: triangles.collect() }
}

/// The radius of a bore along a block.
const BORE: f64 = 1.0;

/// What is turned about the third axis, with as many sides as told: a closed profile, by its distances from the axis and its heights, clockwise. Each side is two triangles from a corner of it to the next.
fn turned(profile: &[[f64; 2]], sides: u32) -> TriMesh {
    let at = |corner: &[f64; 2], number: u32| {
        let (sine, cosine) = (TAU * f64::from(number) / f64::from(sides)).sin_cos();
        DVec3::new(corner[0] * cosine, corner[0] * sine, corner[1])
    };
    let vertices = profile.iter().flat_map(|corner| (0..sides).map(move |number| at(corner, number))).collect();
    let count = profile.len() as u32;
    let squares = (0..count).flat_map(|from| (0..sides).map(move |k| (from, (from + 1) % count, k, (k + 1) % sides)));
    let triangles = squares.flat_map(|(from, to, k, next)| {
        let [a, b, c, d] = [from * sides + k, from * sides + next, to * sides + next, to * sides + k];
        [[a, c, b], [a, d, c]]
    });
    TriMesh { vertices, triangles: triangles.collect() }
}

fn bored(sides: u32) -> TriMesh {
    turned(&[[BORE, 0.0], [BORE, HIGH], [BASE, HIGH], [BASE, 0.0]], sides)
}

fn saddle(noise: f64) -> TriMesh {
    let mut random = Random(191);
    let mut mesh = grid(120, 120, false, |u, v| DVec3::new(40.0 * u, 40.0 * v, 12.0 * (u - 0.5) * (v - 0.5)));
    mesh.vertices.iter_mut().for_each(|x| x.z += noise * (random.share() - 0.5));
    mesh
}

fn distance(mesh: &TriMesh, x: &Point) -> f64 {
    let square = |triangle: u32| {
        let [a, b, c] = mesh.points_of(triangle);
        DVec3::from_array(closest_on_triangle(x, &a, &b, &c)).distance_squared(DVec3::from_array(*x))
    };
    (0..mesh.triangles.len() as u32).map(square).fold(f64::INFINITY, f64::min).sqrt()
}

/// A place of a mesh.
fn place(mesh: &TriMesh, random: &mut Random) -> Point {
    let [a, b, c] = mesh.points_of(random.next() as u32 % mesh.triangles.len() as u32).map(DVec3::from_array);
    let (s, t) = (random.share().sqrt(), random.share());
    a.lerp(b.lerp(c, t), s).to_array()
}

/// Nearly all of what may be off is used, and no more, at places of both meshes whose distances are looked for one by one.
#[test]
fn fewer_triangles_are_within_the_bound() {
    let mut random = Random(193);
    let budget = Budget::default();
    for (mesh, most) in [(ring(240, 120, 0.0), 0.1), (ring(200, 100, 5e-4), 0.2), (saddle(0.0), 0.05), (saddle(0.01), 0.1)] {
        let fewer = decimated(&mesh, most, f64::INFINITY, WORTH, &budget).unwrap().unwrap();
        assert!(is_finer(&mesh, most, WORTH));
        assert!(WORTH * fewer.triangles.len() <= mesh.triangles.len());
        let mut farthest = 0.0_f64;
        for _ in 0..1_500 {
            farthest = farthest.max(distance(&fewer, &place(&mesh, &mut random))).max(distance(&mesh, &place(&fewer, &mut random)));
        }
        assert!(farthest <= most && farthest > 0.4 * most, "{farthest} of {most}");
    }
}

/// Closed meshes stay closed and embedded, and have the same windings around all that is farther from them than they are from each other, also where triangles are long and thin.
#[test]
fn solids_stay_what_they_are() {
    let (mut random, budget) = (Random(197), Budget::default());
    let cases =
        [(ring(240, 120, 0.0), 0.1, 2.4), (ring(200, 100, 5e-4), 0.2, 2.1), (ring(60, 900, 0.0), 0.4, 2.0), (cylinder(3_000), 0.02, 1.0)];
    for (mesh, most, farthest) in cases {
        let fewer = decimated(&mesh, most, farthest, WORTH, &budget).unwrap().unwrap();
        assert!(WORTH * fewer.triangles.len() <= mesh.triangles.len());
        let sides = fewer.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let all: std::collections::HashSet<[u32; 2]> = sides.collect();
        assert!(all.len() == 3 * fewer.triangles.len() && all.iter().all(|[a, b]| all.contains(&[*b, *a])));
        let solids = [Inside::new(&mesh), Inside::new(&fewer)];
        for _ in 0..2_000 {
            let x = 60.0 * (DVec3::from_array(std::array::from_fn(|_| random.share())) - 0.5);
            let [own, other] = [solids[0].winding(x), solids[1].winding(x)];
            assert!(own == other || solids[0].distance(x) <= most, "{x}");
        }
    }
    // Where vertices may move no farther than to a neighbour, hardly anything goes.
    assert!(decimated(&ring(240, 120, 0.0), 0.1, 0.6, WORTH, &budget).unwrap().is_none());
}

/// Each vertex is no farther from what it became than told, by the rings that tell what became one: the way there, step by step, may be longer.
#[test]
fn vertices_stay_near_to_what_they_become() {
    for (mesh, most, farthest) in [(ring(120, 60, 0.0), 0.4, 1.5), (ring(30, 450, 0.0), 1.5, 1.0), (cylinder(700), 0.1, 0.92)] {
        let faces = Faces::of_mesh(&mesh);
        let mut made = Decimation::new(&mesh, &faces, farthest);
        for (share, short) in [(0.75, SHORT), (0.4, 1.0), (0.75, 1.0)] {
            made.sweep(&vec![most; mesh.vertices.len()], share, short, &Budget::default()).unwrap();
        }
        let (mut seen, mut far, mut gone) = (vec![false; mesh.vertices.len()], 0.0_f64, 0);
        for vertex in (0..made.beyond).filter(|&vertex| made.mesh.is_used(vertex)) {
            let mut other = vertex;
            loop {
                assert!(!std::mem::replace(&mut seen[other as usize], true), "in two rings");
                far = far.max(mesh.vertices[other as usize].distance(mesh.vertices[vertex as usize]));
                other = made.next_of[other as usize];
                if other == vertex {
                    break;
                }
                assert!(!made.mesh.is_used(other), "two that are left in one ring");
                gone += 1;
            }
        }
        assert!(seen.iter().all(|&seen| seen) && gone > mesh.vertices.len() / 2, "{gone}");
        assert!(far <= farthest && far > 0.9 * farthest, "{far} of {farthest}");
    }
}

/// Ends of fans, with a triangle for each side, and long thin triangles between them.
#[test]
fn fans_of_cylinders_are_made_of_few_triangles() {
    let mesh = cylinder(4_000);
    let (radius, tolerance) = (0.6, 0.06);
    for is_solid in [true, false] {
        let attractor = Attractor::of_triangles(&mesh, is_solid).unwrap();
        let made = dilate(&attractor, Radius::new(radius).unwrap(), Tolerance::new(tolerance).unwrap(), &Budget::default()).unwrap();
        // Without a lattice.
        assert!(made.topology_exact && made.pitch_mm.is_none() && made.inner_mm <= tolerance && made.outer_mm <= tolerance);
        let topology = made.solid.topology();
        assert_eq!((topology.shells, topology.genus), if is_solid { (1, 0) } else { (2, 0) });
        assert!(made.solid.mesh().triangles.len() < 3_000, "{}", made.solid.mesh().triangles.len());
        // Steiner's formula, and what is inside of the walls: the volume is between those of the ends of the band, but for less than a hundred-thousandth of it, as sides are straight.
        let around =
            |r: f64| PI * (BASE * BASE * HIGH + 2.0 * BASE * (BASE + HIGH) * r + (HIGH + PI * BASE) * r * r + 4.0 / 3.0 * r * r * r);
        let within = |r: f64| if is_solid { 0.0 } else { PI * (BASE - r).powi(2) * (HIGH - 2.0 * r) };
        let of = |r: f64| around(r) - within(r);
        let volume = crate::measure::mass::volume(made.solid.mesh());
        assert!((1.0 - 1e-5) * of(radius - made.inner_mm) <= volume && volume <= of(radius + made.outer_mm), "{volume}");
    }
}

/// Around a bore what is gone lies in the ends, wherever sides cut into these: the walls are as near as all else, and needles from the bore to the rim are no reason to leave the bore as it is.
#[test]
fn bores_are_made_of_few_triangles() {
    let (mesh, budget, mut random) = (bored(600), Budget::default(), Random(229));
    for (most, farthest) in [(0.004, f64::INFINITY), (0.02, f64::INFINITY), (0.02, 0.5)] {
        let fewer = decimated(&mesh, most, farthest, WORTH_OF_FEW, &budget).unwrap().unwrap();
        let is_at_bore = |vertex: &DVec3| vertex.truncate().length() < 0.5 * BASE;
        let around = fewer.vertices.iter().filter(|vertex| is_at_bore(vertex)).count();
        // Sides of a circle that are off by no more than this are at least half as many as those that are off by a quarter of it, at either end.
        let least = PI / (1.0 - most / BORE).acos();
        assert!(around as f64 > 2.0 * least && (around as f64) < 8.0 * least, "{around} for {least} and {most}");
        let mut farthest = 0.0_f64;
        for _ in 0..1_000 {
            farthest = farthest.max(distance(&fewer, &place(&mesh, &mut random))).max(distance(&mesh, &place(&fewer, &mut random)));
        }
        assert!(farthest <= most, "{farthest} of {most}");
    }
    // By Pappus: what is turned is a rectangle with round corners.
    let (radius, tolerance) = (0.6, 0.06);
    let attractor = Attractor::of_triangles(&mesh, true).unwrap();
    let made = dilate(&attractor, Radius::new(radius).unwrap(), Tolerance::new(tolerance).unwrap(), &Budget::default()).unwrap();
    assert!(made.topology_exact && made.pitch_mm.is_none() && made.inner_mm <= tolerance && made.outer_mm <= tolerance);
    assert_eq!((made.solid.topology().shells, made.solid.topology().genus), (1, 1));
    // Of fewer triangles, as is predicted.
    let prediction = predict(&attractor, Radius::new(radius).unwrap(), Tolerance::new(tolerance).unwrap(), true, &budget).unwrap();
    assert_eq!((prediction.pitch_mm, prediction.leaf_cells), (None, made.leaf_cells as f64));
    assert!(made.leaf_cells * WORTH_OF_FEW as u64 <= mesh.triangles.len() as u64, "{}", made.leaf_cells);
    let of = |r: f64| PI * (BASE + BORE) * ((BASE - BORE + 2.0 * r) * (HIGH + 2.0 * r) - (4.0 - PI) * r * r);
    let volume = crate::measure::mass::volume(made.solid.mesh());
    assert!((1.0 - 1e-4) * of(radius - made.inner_mm) <= volume && volume <= (1.0 + 1e-4) * of(radius + made.outer_mm), "{volume}");
}

/// The walls of a groove are left apart by far less than fewer triangles tell, or hardly meet: all of them tell.
#[test]
fn grooves_that_hardly_close_are_made_of_all_triangles() {
    let (radius, tolerance) = (0.4, 0.04);
    let groove = 2.0 * radius * 1.0001;
    let [from, to] = [4.0, 4.0 + groove];
    let mesh = turned(&[[2.0, 0.0], [2.0, 9.0], [BASE, 9.0], [BASE, to], [16.0, to], [16.0, from], [BASE, from], [BASE, 0.0]], 400);
    let attractor = Attractor::of_triangles(&mesh, true).unwrap();
    let (radius, tolerance) = (Radius::new(radius).unwrap(), Tolerance::new(tolerance).unwrap());
    let made = dilate(&attractor, radius, tolerance, &Budget::default()).unwrap();
    assert_eq!(made.leaf_cells, mesh.triangles.len() as u64);
    assert!(made.topology_exact && made.inner_mm <= 0.04 && made.outer_mm <= 0.04, "{:?}", made.pitch_mm);
    assert_eq!((made.solid.topology().shells, made.solid.topology().genus), (1, 1));
    let prediction = predict(&attractor, radius, tolerance, true, &Budget::default()).unwrap();
    assert_eq!((prediction.pitch_mm, prediction.leaf_cells), (None, made.leaf_cells as f64));
}

/// Three triangles at a side, two fans at a corner, triangles of no area and border corners are left, or stay within the bound.
#[test]
fn odd_meshes_are_no_harm() {
    let (mut random, budget) = (Random(199), Budget::default());
    let mut mesh = saddle(0.0);
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend([DVec3::new(10.0, 10.0, 5.0), DVec3::new(20.0, 5.0, 30.0), DVec3::new(22.0, 5.0, 30.0), mesh.vertices[500]]);
    mesh.triangles.extend([[300, 301, first], [7_000, first + 1, first + 2], [500, 501, first + 3]]);
    let fewer = decimated(&mesh, 0.05, f64::INFINITY, WORTH, &budget).unwrap().unwrap();
    let all = (0..800).map(|_| distance(&fewer, &place(&mesh, &mut random)).max(distance(&mesh, &place(&fewer, &mut random))));
    assert!(all.fold(0.0, f64::max) <= 0.05);
    let corners = [0, 120, 120 * 121, 121 * 121 - 1].map(|corner: usize| mesh.vertices[corner].to_array());
    assert!(corners.iter().all(|corner| distance(&fewer, corner) <= 0.05));
}

/// Fins on sides, faces that are there twice, or back to back: their neighbours are in any order.
#[test]
fn sides_of_many_triangles_stay() {
    let (mut random, budget) = (Random(227), Budget::default());
    for round in 0..24 {
        let mut mesh = saddle(0.0);
        for _ in 0..40 {
            let [a, b, c] = mesh.triangles[random.next() as usize % mesh.triangles.len()];
            let fin = mesh.vertices.len() as u32;
            mesh.vertices.push(mesh.vertices[a as usize] + DVec3::new(random.share(), random.share(), 1.0));
            match round % 4 {
                0 => mesh.triangles.push([a, b, fin]),
                1 => mesh.triangles.extend([[a, b, fin], [b, a, fin]]),
                2 => mesh.triangles.push([a, b, c]),
                _ => mesh.triangles.push([b, a, c]),
            }
        }
        for k in (1..mesh.triangles.len()).rev().filter(|_| round % 8 > 3) {
            mesh.triangles.swap(k, random.next() as usize % (k + 1));
        }
        let Some(fewer) = decimated(&mesh, 0.1, f64::INFINITY, WORTH, &budget).unwrap() else { continue };
        let all = (0..100).map(|_| distance(&fewer, &place(&mesh, &mut random)).max(distance(&mesh, &place(&fewer, &mut random))));
        assert!(all.fold(0.0, f64::max) <= 0.1, "{round}");
    }
}

/// Lines that are no sides of other triangles are no harm.
#[test]
fn lines_are_left_out_only_where_they_are_sides() {
    let kept = [[0, 1, 2], [1, 2, 3]];
    let with = |more: &[[u32; 3]]| without_lines([&kept, more].concat()).map(|all| all.len());
    assert_eq!([with(&[]), with(&[[0, 0, 1], [2, 1, 2], [3, 3, 3]])], [Some(2); 2]);
    assert_eq!([with(&[[0, 3, 3]]), with(&[[4, 4, 4]]), with(&[[1, 2, 1], [4, 0, 4]])], [None; 3]);
    // A chord across a ring, and a place beside it.
    for chord in [[0, 0, 15_000], [28_800, 28_800, 28_800]] {
        let mut mesh = ring(240, 120, 0.0);
        mesh.vertices.push(DVec3::new(100.0, 0.0, 0.0));
        mesh.triangles.push(chord);
        let attractor = Attractor::of_triangles(&mesh, false).unwrap();
        let made = dilate(&attractor, Radius::new(3.0).unwrap(), Tolerance::new(0.6).unwrap(), &Budget::default()).unwrap();
        let at = chord.map(|corner| mesh.vertices[corner as usize]);
        let inside = Inside::new(made.solid.mesh());
        assert!((0..=20).all(|k| inside.winding(at[0].lerp(at[2], f64::from(k) / 20.0)) == 1), "{chord:?}");
    }
}

#[test]
fn meshes_that_are_coarse_or_rough_are_left() {
    let budget = Budget::default();
    for (mesh, most) in [(ring(60, 30, 0.0), 0.05), (ring(200, 100, 0.02), 0.1), (saddle(0.5), 0.05)] {
        assert!(!is_finer(&mesh, most, WORTH) && decimated(&mesh, most, f64::INFINITY, WORTH, &budget).unwrap().is_none());
    }
}

/// A triangle over a grid of small ones is within what is told of them if it is, as places of it tell.
#[test]
fn what_is_uncovered_is_found() {
    let (mut random, budget, mut counts) = (Random(211), Budget::default(), [0; 2]);
    // Beside one face, from whose sides pieces are cut off before there is nothing left over it.
    let one = |corners: [[f64; 3]; 3]| TriMesh { vertices: corners.map(DVec3::from_array).to_vec(), triangles: vec![[0, 1, 2]] };
    let face = Faces::of_mesh(&one([[2.0, 3.0, 0.0], [0.0; 3], [3.0, -4.0, 0.0]]));
    let beside = one([[0.0, -1.0, 0.0], [2.0, -5.0, 0.0], [-6.0, 6.0, 0.0]]);
    assert!((0..40).all(|k| !uncovered(&beside, &face, 1.0 + 0.05 * f64::from(k), &budget).unwrap().is_empty()));
    // Beyond the border, and around a corner of three squares.
    let (mut at_corner, mut covered) = (Random(233), 0);
    for round in 0..2_000 {
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let at = |u: f64, v: f64| std::array::from_fn(|k| [0.0, u, v][(k + 3 - axis) % 3]);
            grid(1, 1, false, |u, v| DVec3::from_array(at(3.0 * u, 3.0 * v)))
        });
        let all = [x, y, z].iter().flat_map(|own| (0..2).map(|triangle| own.points_of(triangle))).collect::<Vec<_>>();
        let corner = TriMesh {
            vertices: all.iter().flatten().map(|at| DVec3::from_array(*at)).collect(),
            triangles: (0..6).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect(),
        };
        let own = one([(); 3].map(|()| std::array::from_fn(|_| 6.0 * at_corner.share() - 1.5)));
        let farthest = (0..200).map(|_| distance(&corner, &place(&own, &mut at_corner))).fold(0.0, f64::max);
        let most = farthest * (0.7 + 0.4 * at_corner.share());
        let is_covered = uncovered(&own, &Faces::of_mesh(&corner), most, &budget).unwrap().is_empty();
        assert!(!is_covered || farthest <= most, "{round}: {farthest} of {most}");
        covered += usize::from(is_covered);
    }
    assert!(covered > 100, "{covered}");
    for round in 0..300 {
        let height = [0.3, 0.03][round % 2];
        let ground = grid(12, 12, false, |u, v| DVec3::new(6.0 * u, 6.0 * v, height * (5.0 * u).sin() * (4.0 * v).cos()));
        let corner =
            |random: &mut Random| DVec3::new(1.0 + 4.0 * random.share(), 1.0 + 4.0 * random.share(), height * (random.share() - 0.5));
        let own = TriMesh { vertices: (0..3).map(|_| corner(&mut random)).collect(), triangles: vec![[0, 1, 2]] };
        let farthest = (0..400).map(|_| distance(&ground, &place(&own, &mut random))).fold(0.0, f64::max);
        let most = farthest * (0.8 + 0.4 * random.share());
        let is_covered = uncovered(&own, &Faces::of_mesh(&ground), most, &budget).unwrap().is_empty();
        assert!(!is_covered || farthest <= most, "{round}");
        // Places miss the farthest one by a little.
        assert!(is_covered || farthest > 0.9 * most, "{round}: {farthest} of {most}");
        counts[usize::from(is_covered)] += 1;
    }
    assert!(counts.iter().all(|&count| count > 80), "{counts:?}");
}

/// Dilations of fine meshes and of the solids that they bound keep their bounds to these, are made of few triangles, and do not depend on threads.
#[test]
fn dilations_of_fine_meshes_keep_their_bounds() {
    let mut random = Random(223);
    let mesh = ring(260, 130, 1e-4);
    let (radius, tolerance) = (Radius::new(3.0).unwrap(), Tolerance::new(0.6).unwrap());
    for is_solid in [false, true] {
        let attractor = Attractor::of_triangles(&mesh, is_solid).unwrap();
        let made = dilate(&attractor, radius, tolerance, &Budget::default()).unwrap();
        let count = made.solid.mesh().triangles.len();
        assert!(made.topology_exact && 4 * count < mesh.triangles.len(), "{count} {:?} {}", made.pitch_mm, made.topology_exact);
        let topology = made.solid.topology();
        assert_eq!((topology.shells, topology.genus), if is_solid { (1, 1) } else { (2, 2) });
        assert!(made.inner_mm <= 0.6 && made.outer_mm <= 0.6);
        let (around, within) = (Inside::new(made.solid.mesh()), Inside::new(&mesh));
        for _ in 0..800 {
            let x = DVec3::from_array(place(&mesh, &mut random)) + 5.0 * (DVec3::from_array(std::array::from_fn(|_| random.share())) - 0.5);
            let own = distance(&mesh, &x.to_array());
            let is_filled = is_solid && within.winding(x) > 0;
            let is_in = around.winding(x) > 0;
            assert!(is_in || (own > 3.0 - made.inner_mm && !is_filled), "{x} {own}");
            assert!(!is_in || own <= 3.0 + made.outer_mm || is_filled, "{x} {own}");
        }
        let again = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let again = again.install(|| dilate(&attractor, radius, tolerance, &Budget::default()).unwrap());
        assert!(again.solid.mesh() == made.solid.mesh());
    }
}

#[test]
fn decimation_can_be_stopped() {
    let budget = Budget::default();
    budget.cancel.fire(StopReason::Cancelled);
    assert!(decimated(&ring(240, 120, 0.0), 0.1, f64::INFINITY, WORTH, &budget).is_err());
}
