use super::super::testing::{
    arranged, arranged_unless_left, assert_bounds, assert_limited, assert_steady, distance_of_triangles, holds_everywhere, is_flat,
    lowered, lowered_as, on_coarse_lattice, place, topology,
};
use super::ball::Ball;
use super::corner::{Arc, Patch};
use crate::attractor::Attractor;
use crate::attractor::cell::{Point, cross, dot, unit};
use crate::model::Interior;
use crate::solid::Inside;
use crate::split_mix::Random;
use glam::{DMat3, DVec3};
use std::collections::HashMap;
use std::f64::consts::PI;

/// Vertices and triangles.
#[derive(Clone, Default)]
struct Walls {
    vertices: Vec<DVec3>,
    faces: Vec<Vec<u32>>,
    numbers: HashMap<[i64; 3], u32>,
}

impl Walls {
    /// Adds a polygon, which is cut from one of its corners.
    fn add(&mut self, corners: &[DVec3], from: usize) {
        let own: Vec<u32> = corners
            .iter()
            .map(|corner| {
                *self.numbers.entry(corner.to_array().map(|x| (x * 1e6).round() as i64)).or_insert_with(|| {
                    self.vertices.push(*corner);
                    self.vertices.len() as u32 - 1
                })
            })
            .collect();
        let at = |k: usize| own[(from + k) % own.len()];
        self.faces.extend((1..own.len() - 1).map(|k| vec![at(0), at(k), at(k + 1)]));
    }

    /// The boundary of cubes of 10 mm.
    fn around(size: i32, is_full: impl Fn([i32; 3]) -> bool, random: &mut Random) -> Self {
        let is_in = |cube: [i32; 3]| cube.iter().all(|k| (0..size).contains(k)) && is_full(cube);
        let mut walls = Self::default();
        for cube in (0..size.pow(3)).map(|k| [k % size, k / size % size, k / size / size]).filter(|&cube| is_in(cube)) {
            for (axis, side) in (0..3).flat_map(|axis| [0, 1].map(|side| (axis, side))) {
                let mut next = cube;
                next[axis] += 2 * side - 1;
                if is_in(next) {
                    continue;
                }
                let mut corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[u, v]| {
                    let mut at = cube;
                    at[axis] += side;
                    at[(axis + 1) % 3] += u;
                    at[(axis + 2) % 3] += v;
                    DVec3::from_array(at.map(|k| 10.0 * f64::from(k)))
                });
                if side == 0 {
                    corners.reverse();
                }
                walls.add(&corners, random.next() as usize % 4);
            }
        }
        walls
    }

    /// Cells of a honeycomb with walls 20 mm high: three meet along each edge.
    fn honeycomb(count: i32) -> Self {
        let mut walls = Self::default();
        for (i, j) in (0..count * count).map(|k| (f64::from(k % count), f64::from(k / count))) {
            let centre = [15.0 * i, 10.0 * 3.0_f64.sqrt() * (j + 0.5 * (i % 2.0))];
            let at = |k: usize, z: f64| {
                let (sine, cosine) = (PI / 3.0 * k as f64).sin_cos();
                DVec3::new(centre[0] + 10.0 * cosine, centre[1] + 10.0 * sine, z)
            };
            // Those of a wall that two cells have are one.
            for k in 0..if i == 0.0 || j == 0.0 { 6 } else { 3 } {
                let mut own = Self { faces: Vec::new(), ..walls.clone() };
                own.add(&[at(k, 0.0), at(k + 1, 0.0), at(k + 1, 20.0), at(k, 20.0)], 0);
                let is_new = own.faces.iter().all(|face| {
                    let sorted = |face: &Vec<u32>| {
                        let mut face = face.clone();
                        face.sort_unstable();
                        face
                    };
                    !walls.faces.iter().any(|other| sorted(other) == sorted(face))
                });
                if is_new && own.vertices.len() <= walls.vertices.len() + 4 {
                    own.faces.splice(0..0, walls.faces.iter().cloned());
                    walls = own;
                }
            }
        }
        walls
    }

    /// Pyramids beside each other.
    fn pyramids(count: i32, height: f64) -> Self {
        let mut walls = Self::default();
        for (i, j) in (0..count * count).map(|k| (f64::from(k % count), f64::from(k / count))) {
            let foot = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[u, v]| DVec3::new(10.0 * (i + u), 10.0 * (j + v), 0.0));
            let top = DVec3::new(10.0 * i + 5.0, 10.0 * j + 5.0, height);
            (0..4).for_each(|k| walls.add(&[foot[k], foot[(k + 1) % 4], top], 0));
        }
        walls
    }

    /// A sheet that is folded along lines side by side.
    fn folded(count: usize, random: &mut Random) -> Self {
        let (mut walls, mut at, mut angle) = (Self::default(), DVec3::ZERO, 0.0_f64);
        for _ in 0..count {
            let to = at + 12.0 * DVec3::new(angle.cos(), 0.0, angle.sin());
            walls.add(&[at, to, to + 15.0 * DVec3::Y, at + 15.0 * DVec3::Y], 0);
            (at, angle) = (to, angle + 1.2 * (random.share() - 0.5));
        }
        walls
    }

    /// The same in another frame, in single precision if wanted.
    fn turned(&self, random: &mut Random, is_rounded: bool) -> Self {
        let [a, b, c] = [0; 3].map(|_| 6.0 * random.share());
        let frame = DMat3::from_rotation_z(a) * DMat3::from_rotation_x(b) * DMat3::from_rotation_y(c);
        let shift = place(random, 50.0);
        let round = |x: f64| if is_rounded { f64::from(x as f32) } else { x };
        let vertices = self.vertices.iter().map(|&vertex| DVec3::from_array((frame * vertex + shift).to_array().map(round))).collect();
        Self { vertices, ..self.clone() }
    }

    fn lowered(&self) -> Attractor {
        lowered(&self.vertices, self.faces.clone())
    }
}

fn menger([x, y, z]: [i32; 3]) -> bool {
    [x, y, z].iter().filter(|&k| k % 3 == 1).count() < 2
}

/// Walls by a number.
fn walls(case: usize, random: &mut Random) -> Walls {
    match case % 7 {
        0 => Walls::around(3, menger, random),
        1 | 2 => {
            let full: Vec<bool> = (0..64).map(|_| random.share() < if case % 7 == 1 { 0.4 } else { 0.75 }).collect();
            Walls::around(4, |[x, y, z]| full[(x + 4 * y + 16 * z) as usize], random)
        }
        3 => Walls::honeycomb(2),
        4 => Walls::pyramids(3, 7.0),
        5 => Walls::folded(3 + random.next() as usize % 6, random),
        // A box without a lid, and a table's corner.
        _ => {
            let mut walls = Walls::around(2, |[_, _, z]| z == 0, random);
            walls.faces.retain(|face| face.iter().any(|&corner| walls.vertices[corner as usize].z < 10.0));
            walls
        }
    }
}

/// What is made keeps its bounds everywhere, and has the topology that a lattice has.
#[test]
fn walls_keep_their_bounds_and_agree_with_the_lattice() {
    let mut random = Random(83);
    let (mut made, mut uncertain) = (0, 0);
    for case in 0..42 {
        let walls = walls(case, &mut random);
        let walls = if case < 14 { walls } else { walls.turned(&mut random, case % 2 == 0) };
        let (radius, share) = ([0.7, 1.5, 2.6, 3.4][case % 4], [0.1, 0.04, 0.2][case % 3]);
        let (shape, tolerance) = (walls.lowered(), share * radius);
        if !is_flat(&shape, radius, tolerance) {
            continue;
        }
        made += 1;
        let dilation = arranged(&shape, radius, tolerance);
        assert!(dilation.topology_exact && dilation.inner_mm <= tolerance && dilation.outer_mm <= tolerance, "{case}");
        let distance = distance_of_triangles(&walls.vertices, &walls.faces);
        assert!(holds_everywhere(&dilation, radius, &distance, &mut random), "{case}");
        let inside = Inside::new(dilation.solid.mesh());
        for _ in 0..300 {
            let face = &walls.faces[random.next() as usize % walls.faces.len()];
            let on = walls.vertices[face[0] as usize].lerp(walls.vertices[face[1] as usize], random.share());
            let on = on.lerp(walls.vertices[face[2] as usize], random.share());
            let away = (place(&mut random, 2.0) - DVec3::ONE).normalize_or_zero();
            let x = on + radius * (0.7 + 0.6 * random.share()) * away;
            assert_bounds(case, &inside, &dilation, radius, x, distance(x));
        }
        let lattice = on_coarse_lattice(&shape, radius, tolerance);
        if lattice.topology_exact {
            assert_eq!(topology(&dilation), topology(&lattice), "{case}");
        } else {
            uncertain += 1;
        }
    }
    assert!(made >= 34 && uncertain < 4, "{made} {uncertain}");
}

/// Walls that come too close to each other without hanging together are left to others, which have the same topology as the lattice.
#[test]
fn walls_that_come_close_are_left_to_others() {
    let mut random = Random(89);
    for (gap, is_made) in [(3.0, true), (2.21, true), (2.0005, false), (1.9, false), (0.5, false)] {
        let mut walls = Walls::default();
        for z in [0.0, gap] {
            walls.add(&[[0.0, 0.0], [20.0, 0.0], [20.0, 10.0], [0.0, 10.0]].map(|[x, y]| DVec3::new(x, y, z)), 0);
        }
        let walls = walls.turned(&mut random, false);
        let shape = walls.lowered();
        assert_eq!(is_flat(&shape, 1.0, 0.1), is_made, "{gap}");
        let dilation = arranged_unless_left(&shape, 1.0, 0.1).unwrap_or_else(|| on_coarse_lattice(&shape, 1.0, 0.1));
        let one = (1, 0, 2);
        assert_eq!(topology(&dilation), if gap > 2.0 { (2, 0, 4) } else { one }, "{gap}");
    }
}

/// Faces are as far out as they are meant to be.
#[test]
fn walls_are_as_thick_as_they_are_meant_to_be() {
    let walls = Walls::around(3, menger, &mut Random(107));
    let dilation = arranged(&walls.lowered(), 2.0, 0.2);
    let on_planes = dilation.solid.mesh().vertices.iter().filter(|x| x.to_array().iter().any(|x| [-2.0, 32.0].contains(x)));
    assert!(on_planes.count() > 32);
}

/// The faces of a solid are thickened outwards only.
#[test]
fn solids_have_no_surface_inside() {
    let mut random = Random(97);
    for case in [0, 1, 2, 7, 8, 9] {
        let walls = walls(case, &mut random);
        let Some(shape) = lowered_as(Interior::Solid, &walls.vertices, walls.faces.clone()) else { continue };
        let dilation = arranged(&shape, 1.5, 0.15);
        assert_eq!(topology(&dilation), topology(&on_coarse_lattice(&shape, 1.5, 0.15)), "{case}");
        let within = Inside::new(dilation.solid.mesh());
        assert!((0..2_000).all(|_| {
            let x = place(&mut random, 40.0);
            let is_within = shape.surfaces().iter().any(|solid| Inside::new(solid).winding(x) != 0);
            !is_within || within.winding(x) == 1
        }));
    }
}

/// Of walls without end that meet at a vertex, the boundary is where the first body ends along every way out.
#[test]
fn patches_are_where_bodies_end() {
    let mut random = Random(101);
    let ball = Ball::between([&[[1.0, 0.0, 0.0], [0.0, 0.6, 0.8]], &[[0.0, 0.0, 1.0]]], 0.1, [1.0, 1.05, 1.2]).expect("few facets");
    let mut made = 0;
    for _ in 0..60 {
        let count = 1 + random.next() as usize % 3;
        let mut way = || unit(&std::array::from_fn(|_| random.share() - 0.5));
        let ways: Vec<Point> = (0..2 * count).map(|_| way()).collect();
        let arcs: Vec<Arc> = (0..count)
            .map(|k| {
                let [from, to] = [ways[2 * k], ways[2 * k + 1]];
                let normal = unit(&cross(&from, &to));
                Arc { normal, from, angle: dot(&normal, &cross(&from, &to)).atan2(dot(&from, &to)), ways: Some([2 * k, 2 * k + 1]) }
            })
            .collect();
        // Sectors that cross each other hang together along a line that is no way.
        let Some(patch) = Patch::new(&arcs, &ways, &ball) else { continue };
        made += 1;
        let reach = |x: &Point| {
            let of = |arc: &Arc| {
                let sides = [ways[arc.ways.unwrap()[0]], ways[arc.ways.unwrap()[1]]];
                let is_below = |normal: &Point| sides.iter().all(|side| dot(side, normal) <= 1e-9);
                let along = sides.iter().flat_map(|side| ball.sides(side)).filter(is_below);
                let both = [arc.normal, arc.normal.map(|part| -part)];
                let all = both.into_iter().chain(ball.facets.iter().copied().filter(is_below)).chain(along);
                all.map(|normal| dot(&normal, x) / ball.reach(&normal)).fold(0.0, f64::max)
            };
            arcs.iter().map(of).fold(f64::INFINITY, f64::min)
        };
        assert!(patch.points.iter().all(|point| (reach(point) - 1.0).abs() < 5e-4));
        for chain in &patch.chains {
            let on = |point: &Point| (dot(&chain.normal, point) - ball.reach(&chain.normal)).abs() < 5e-4;
            assert!(chain.points.iter().all(|&point| on(&patch.points[point as usize])));
        }
    }
    assert!(made > 25, "{made}");
}

#[test]
fn walls_do_not_depend_on_threads_and_can_be_stopped() {
    let shape = Walls::around(3, menger, &mut Random(103)).lowered();
    assert!(is_flat(&shape, 2.0, 0.2));
    assert_steady(&shape, 2.0, 0.2);
}

#[test]
fn limits_hold_for_walls() {
    let shape = Walls::honeycomb(2).lowered();
    assert!(is_flat(&shape, 1.5, 0.05));
    assert_limited(&shape, 1.5, 0.05);
}
