use super::bodies::{Common, Hub, Kind, Near};
use super::cubes::{ANY, Cube, MOST_BODIES, PRESENT, Search, is_covered};
use super::ellipsoid::Place;
use super::engine::Engine;
use super::hidden::Hidden;
use super::nerve::{Change, Doubt, Sets};
use super::polytopes::height;
use super::testing::*;
use crate::budget::Budget;
use crate::dilation::convex::Convex;
use crate::dilation::dilate;
use crate::model::Interior;
use crate::solid::Inside;
use crate::split_mix::Random;
use crate::tolerance::{Radius, Tolerance};
use glam::{DMat3, DVec3};

/// Whether a place is in the dilation of a body by 1, and in its polytope.
fn is_in(engine: &Engine<'_>, body: u32, x: DVec3) -> [bool; 2] {
    let (x, polytope) = (x.to_array(), engine.polytopes.of(body));
    let is_kept = polytope.cuts.iter().all(|plane| height(plane, &x) <= 0.0);
    [
        engine.sites[body as usize].distance_squared(&x).sqrt() <= 1.0 && is_kept,
        polytope.planes.iter().all(|plane| height(plane, &x) <= 0.0),
    ]
}

/// A cube around everything.
fn around() -> Cube {
    Cube { centre: [0.0; 3], half: 1e5 }
}

/// Segments of some length in a cube of some size.
fn sticks(random: &mut Random, count: usize, size: f64, length: f64) -> Vec<[DVec3; 2]> {
    (0..count)
        .map(|_| {
            let at = place(random, size);
            [at, at + place(random, length)]
        })
        .collect()
}

#[test]
fn unions_keep_their_bounds_and_agree_with_the_lattice() {
    let mut random = Random(7);
    let (mut left, mut compared, mut uncertain) = (0, 0, 0);
    for round in 0..75 {
        let (size, count) = (30.0, 4 + round % 24);
        let segments: Vec<[DVec3; 2]> = match round % 5 {
            0 => (0..count).map(|_| [place(&mut random, size); 2]).collect(),
            1 => (0..count).map(|_| [place(&mut random, size), place(&mut random, size)]).collect(),
            2 => {
                // A path on a coarse lattice: right angles, what is straight on, what meets itself.
                let mut at = DVec3::splat(15.0);
                (0..count)
                    .map(|_| {
                        let from = at;
                        at[(random.next() % 3) as usize] += if random.next().is_multiple_of(2) { 4.0 } else { -4.0 };
                        [from, at]
                    })
                    .collect()
            }
            3 => {
                // A curve that goes on nearly straight.
                let (mut at, mut angle) = (DVec3::splat(15.0), 0.0_f64);
                (0..count)
                    .map(|k| {
                        let from = at;
                        angle += 0.6 * number(&mut random) - 0.1;
                        at += 2.0 * DVec3::new(angle.cos(), angle.sin(), 0.05 * k as f64);
                        [from, at]
                    })
                    .collect()
            }
            // Wires across each other, in pairs that touch.
            _ => (0..count)
                .map(|k| {
                    let (along, across) = (k % 2, 1 - k % 2);
                    let mut ends = [DVec3::ZERO; 2];
                    for (end, ends) in ends.iter_mut().enumerate() {
                        ends[along] = size * end as f64;
                        ends[across] = 6.0 * (k / 2) as f64;
                        ends[2] = 2.0 * along as f64;
                    }
                    ends
                })
                .collect(),
        };
        let shape = if round % 5 == 0 { points(&segments.iter().map(|[a, _]| *a).collect::<Vec<_>>()) } else { wires(&segments) };
        let (radius, tolerance) = ([1.0, 1.9, 2.3][round % 3], [0.1, 0.03][round / 5 % 2]);
        let radius = if round % 5 == 2 { 1.3 } else { radius };
        let Some(dilation) = arranged_unless_left(&shape, radius, tolerance) else {
            left += 1;
            continue;
        };
        assert!(dilation.inner_mm <= tolerance && dilation.outer_mm <= tolerance && dilation.crossings == 0, "{round}");
        keeps_its_bounds(&dilation, &segments, radius, size, &mut random);
        let other = on_coarse_lattice(&shape, radius, tolerance);
        uncertain += usize::from(!dilation.topology_exact);
        if dilation.topology_exact && other.topology_exact {
            compared += 1;
            assert_eq!(topology(&dilation), topology(&other), "{round}");
        }
    }
    assert!(compared > 60 && uncertain < 6 && left < 6, "{compared} compared, {uncertain} uncertain, {left} left to the lattice");
}

/// Handles of a net of wires: edges less vertices, and one.
/// Each twig grows from the end of an earlier one, straight on or not, or from its middle; many nearly touch, in twos, threes and fours.
#[test]
fn trees_are_arranged_without_a_doubt() {
    let mut random = Random(19);
    let mut compared = 0;
    for round in 0..6 {
        let mut segments: Vec<[DVec3; 2]> = vec![[DVec3::splat(8.0), DVec3::new(8.0, 8.0, 11.0)]];
        while segments.len() < 90 {
            let [from, to] = segments[(random.next() % segments.len() as u64) as usize];
            let way = match random.next() % 3 {
                0 => (to - from).normalize() * 2.0,
                _ => 3.0 * (place(&mut random, 2.0) - DVec3::ONE),
            };
            let at = if random.next().is_multiple_of(3) { from.midpoint(to) } else { to };
            segments.push([at, at + way]);
        }
        let shape = wires(&segments);
        let (radius, tolerance) = ([0.35, 0.5][round % 2], [0.05, 0.02][round / 2 % 2]);
        let dilation = arranged(&shape, radius, tolerance);
        assert!(dilation.topology_exact && dilation.crossings == 0, "{round}: {} uncertain", dilation.uncertain);
        keeps_its_bounds(&dilation, &segments, radius, 16.0, &mut random);
        let other = on_lattice(&shape, radius, tolerance);
        if other.topology_exact {
            compared += 1;
            assert_eq!(topology(&dilation), topology(&other), "{round}");
        }
    }
    assert!(compared > 4, "{compared}");
}

#[test]
fn nets_have_as_many_handles_as_cycles() {
    let (sides, mut segments) = (4, Vec::new());
    let at = |[i, j, k]: [i32; 3]| 10.0 * DVec3::new(f64::from(i), f64::from(j), f64::from(k));
    for node in 0..sides * sides * sides {
        let index = [node % sides, node / sides % sides, node / sides / sides];
        for axis in 0..3 {
            let mut next = index;
            next[axis] += 1;
            if next[axis] < sides {
                segments.push([at(index), at(next)]);
            }
        }
    }
    let handles = segments.len() as i64 - i64::from(sides.pow(3)) + 1;
    for tolerance in [0.2, 0.05] {
        let dilation = arranged(&wires(&segments), 2.0, tolerance);
        assert!(dilation.topology_exact);
        assert_eq!(topology(&dilation), (1, 0, 2 - 2 * handles));
    }
}

/// Where balls begin to touch, to close a ring, and to close a void, is told as closely as values differ.
#[test]
fn critical_radii_are_told() {
    let corner = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let pair = [corner(-1.0, 0.2, 0.1), corner(1.0, 0.2, 0.1)];
    let half = 0.75_f64.sqrt();
    // Circumradius 1, and edges of 1.73.
    let ring = [corner(1.0, 0.0, 0.0), corner(-0.5, half, 0.0), corner(-0.5, -half, 0.0)];
    let third = 3.0_f64.sqrt().recip();
    let void = [(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)].map(|(x, y, z)| third * corner(x, y, z));
    for (sites, before, after) in [(&pair[..], (2, 0, 4), (1, 0, 2)), (&ring[..], (1, 0, 0), (1, 0, 2)), (&void[..], (1, 1, 4), (1, 0, 2))]
    {
        let scaled: Vec<DVec3> = sites.iter().map(|site| 10.0 * *site + DVec3::new(0.3, 0.7, 0.9)).collect();
        let shape = points(&scaled);
        for off in [0.5, 0.1, 0.01, 1e-3, 1e-5] {
            for (radius, expected) in [(10.0 - off, before), (10.0 + off, after)] {
                let dilation = arranged(&shape, radius, 1.0);
                assert!(dilation.topology_exact, "{sites:?} {radius}");
                // A void no deeper than rounding is not carried.
                if off > 1e-4 || expected == after {
                    assert_eq!(topology(&dilation), expected, "{sites:?} {radius}");
                }
            }
        }
    }
}

/// Two segments that go on nearly straight, and then end: where both may be cut at the joint, the other ends need caps.
#[test]
fn bends_are_arranged_at_all_tolerances() {
    for tolerance in [0.1, 0.02, 0.01, 0.0075] {
        for degrees in 1..=25 {
            let turn = f64::from(degrees).to_radians();
            let corners = [DVec3::ZERO, DVec3::new(5.0, 0.3, 0.1), DVec3::new(5.0 + 4.0 * turn.cos(), 0.3 + 4.0 * turn.sin(), 0.1)];
            let dilation = arranged(&wires(&[[corners[0], corners[1]], [corners[1], corners[2]]]), 1.0, tolerance);
            assert!(dilation.topology_exact && topology(&dilation) == (1, 0, 2), "{tolerance} {degrees}");
        }
    }
}

/// A ring in a plane whose corners turn by little is prisms that share whole rings of corners: two triangles for each of their sides, before any is removed. With right angles there are wedges. Rings that are linked, beside each other, or in each other have the topology that they should.
#[test]
fn tubes_have_the_facets_of_their_prisms() {
    let ring = |count: usize, radius: f64, height: f64| -> Vec<[DVec3; 2]> {
        let corner = |k: usize| {
            let (sine, cosine) = (std::f64::consts::TAU * k as f64 / count as f64).sin_cos();
            DVec3::new(radius * cosine, radius * sine, height)
        };
        (0..count).map(|k| [corner(k), corner(k + 1 - if k + 1 == count { count } else { 0 })]).collect()
    };
    // Out of the planes across the axes, where sheets serve better.
    let turn = DMat3::from_rotation_x(0.4);
    let made = |segments: &[[DVec3; 2]]| {
        let turned: Vec<[DVec3; 2]> = segments.iter().map(|ends| ends.map(|end| turn * end)).collect();
        with_arrangement(&wires(&turned), 1.0, 0.1, |arrangement| {
            let arranged = arrangement.run(&Budget::default()).unwrap().unwrap();
            assert_eq!(arranged.uncertain, 0);
            (arranged.surface.triangles.len(), arrangement.triangles)
        })
    };
    let (triangles, told) = made(&ring(40, 12.0, 0.0));
    assert_eq!((triangles, told), (2 * 6 * 40, 2.0 * 6.0 * 40.0));
    // Of six corners of a square's rings two are on the axis of a wedge, and two beyond it: each of its three steps has two triangles and a facet of four corners.
    let (triangles, _) = made(&ring(4, 12.0, 0.0));
    assert_eq!(triangles, 2 * 6 * 4 + 4 * 3 * (2 + 2));
    for (segments, expected) in [
        (ring(40, 12.0, 0.0), (1, 0, 0)),
        (ring(4, 12.0, 0.0), (1, 0, 0)),
        ([ring(30, 12.0, 0.0), ring(25, 9.0, 5.0)].concat(), (2, 0, 0)),
        (
            [ring(30, 12.0, 0.0), ring(30, 12.0, 0.0).iter().map(|ends| ends.map(|x| DVec3::new(x.x + 9.0, x.z, x.y))).collect()].concat(),
            (2, 0, 0),
        ),
        ([ring(30, 12.0, 0.0), ring(30, 12.0, 1.5)].concat(), (1, 0, 0)),
    ] {
        let dilation = arranged(&wires(&segments), 1.0, 0.1);
        assert!(dilation.topology_exact && dilation.crossings == 0);
        assert_eq!(topology(&dilation), expected);
    }
}

/// How many triangles there will be at first is told from a sample, among sites by themselves and all over each other.
#[test]
fn triangles_are_told_beforehand() {
    let mut random = Random(19);
    for size in [60.0, 14.0] {
        let segments = sticks(&mut random, 200, size, 3.0);
        with_arrangement(&wires(&segments), 1.0, 0.1, |arrangement| {
            let made = arrangement.run(&Budget::default()).unwrap().unwrap().surface.triangles.len() as f64;
            // Finer polytopes, where some nearly touch, are not foreseen.
            assert!((0.5..1.4).contains(&(arrangement.triangles / made)), "{size}: {} for {made}", arrangement.triangles);
        });
    }
}

/// Balls of which each all but touches six others, or barely meets them, need no lattice; where they touch, pairs are left in doubt.
#[test]
fn balls_that_nearly_touch_are_arranged() {
    let at = |place: usize| DVec3::new((place % 4) as f64, (place / 4 % 4) as f64, (place / 16) as f64) * 2.0;
    let shape = points(&(0..64).map(at).collect::<Vec<_>>());
    for (radius, expected) in [(0.999, (64, 0, 128)), (1.002, (1, 0, 2 * (64 - 144)))] {
        let dilation = arranged(&shape, radius, 0.1);
        assert!(dilation.topology_exact && topology(&dilation) == expected, "{radius}: {:?}", topology(&dilation));
    }
    assert_eq!(arranged(&shape, 1.0, 0.1).uncertain, 144);
}

#[test]
fn the_result_does_not_depend_on_threads_and_can_be_stopped() {
    let mut random = Random(3);
    assert_steady(&wires(&sticks(&mut random, 300, 100.0, 20.0)), 2.0, 0.1);
}

#[test]
fn many_sites_near_each_other_are_left_to_the_lattice() {
    let mut random = Random(5);
    let vertices: Vec<DVec3> = (0..400).map(|_| place(&mut random, 4.0)).collect();
    let dilation = dilate(&points(&vertices), Radius::new(2.0).unwrap(), Tolerance::new(0.2).unwrap(), &Budget::default()).unwrap();
    assert!(dilation.pitch_mm.is_some());
}

/// Open surfaces of triangles that are large beside the radius: within their bounds, with the topology of the lattice's, and far fewer triangles.
#[test]
fn panels_keep_their_bounds_and_agree_with_the_lattice() {
    let mut random = Random(23);
    let (mut compared, mut left) = (0, 0);
    for round in 0..24_u32 {
        let (mut vertices, mut faces) = (Vec::new(), Vec::new());
        match round % 3 {
            // Triangles by themselves, which may cross.
            0 => {
                for k in 0..4 + round / 3 {
                    vertices.extend((0..3).map(|_| place(&mut random, 30.0)));
                    faces.push(vec![3 * k, 3 * k + 1, 3 * k + 2]);
                }
            }
            // A sheet in folds, flat in places.
            1 => {
                let side = 3 + round / 6;
                for j in 0..=side {
                    for i in 0..=side {
                        let height = if round % 2 == 0 { 4.0 * number(&mut random) } else { 5.0 * f64::from(i % 2) };
                        vertices.push(DVec3::new(6.0 * f64::from(i), 6.0 * f64::from(j), height));
                    }
                }
                let at = |i: u32, j: u32| j * (side + 1) + i;
                for j in 0..side {
                    for i in 0..side {
                        faces.push(vec![at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                        faces.push(vec![at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
                    }
                }
            }
            // A tube with open ends: a handle.
            _ => {
                let (sides, rows) = (5 + round / 6, 3);
                for j in 0..=rows {
                    for i in 0..sides {
                        let angle = std::f64::consts::TAU * f64::from(i) / f64::from(sides);
                        vertices.push(DVec3::new(12.0 * angle.cos(), 12.0 * angle.sin(), 7.0 * f64::from(j)));
                    }
                }
                let at = |i: u32, j: u32| j * sides + i % sides;
                for j in 0..rows {
                    for i in 0..sides {
                        faces.push(vec![at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                        faces.push(vec![at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
                    }
                }
            }
        }
        let (radius, tolerance) = ([1.0, 0.6][round as usize % 2], [0.1, 0.03][round as usize / 2 % 2]);
        let shape = lowered(&vertices, faces.clone());
        let Some(dilation) = arranged_unless_left(&shape, radius, tolerance) else {
            left += 1;
            continue;
        };
        assert!(dilation.inner_mm <= tolerance && dilation.outer_mm <= tolerance && dilation.crossings == 0, "{round}");
        let inside = Inside::new(dilation.solid.mesh());
        let corners = |face: &Vec<u32>| [0, 1, 2].map(|k| vertices[face[k] as usize]);
        let distance = distance_of_triangles(&vertices, &faces);
        for _ in 0..300 {
            let face = &faces[(random.next() % faces.len() as u64) as usize];
            let [a, b, c] = corners(face);
            let on = a.lerp(b, number(&mut random)).lerp(c, number(&mut random));
            let away = place(&mut random, 2.0) - DVec3::ONE;
            let x = on + away.normalize_or_zero() * radius * (0.8 + 0.4 * number(&mut random));
            assert_bounds(round, &inside, &dilation, radius, x, distance(x));
        }
        let other = on_lattice(&shape, radius, tolerance);
        if dilation.topology_exact && other.topology_exact {
            compared += 1;
            assert_eq!(topology(&dilation), topology(&other), "{round}");
        }
        let triangles = [&dilation, &other].map(|made| made.solid.mesh().triangles.len());
        assert!(triangles[0] < triangles[1], "{round}: {triangles:?}");
    }
    assert!(compared > 18 && left < 4, "{compared} compared, {left} left to the lattice");
}

/// The faces of tetrahedra, which what is thickened fills: each is one body, and bounds and topology are those of faces.
#[test]
fn tetrahedra_are_one_body_each() {
    let mut random = Random(71);
    for round in 0..8_u32 {
        let (count, mut vertices, mut faces) = (10 + 6 * round, Vec::new(), Vec::new());
        for k in 0..count {
            let at = place(&mut random, 8.0);
            vertices.extend([at; 4].map(|at| at + place(&mut random, 2.2)));
            faces.extend([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].map(|face| face.map(|corner| 4 * k + corner).to_vec()));
        }
        let (radius, tolerance) = (0.6, [0.06, 0.02][round as usize % 2]);
        let shape = lowered(&vertices, faces.clone());
        let bodies = with_arrangement(&shape, radius, tolerance, |arrangement| arrangement.sites.list.len());
        assert_eq!(bodies, count as usize, "{round}");
        let dilation = arranged(&shape, radius, tolerance);
        assert!(dilation.inner_mm <= tolerance && dilation.outer_mm <= tolerance && dilation.crossings == 0, "{round}");
        let (inside, distance) = (Inside::new(dilation.solid.mesh()), distance_of_triangles(&vertices, &faces));
        for _ in 0..300 {
            let x = place(&mut random, 11.5) - DVec3::splat(0.7);
            assert_bounds(round, &inside, &dilation, radius, x, distance(x));
        }
        let other = on_lattice(&shape, radius, tolerance);
        assert!(dilation.topology_exact && other.topology_exact, "{round}");
        assert_eq!(topology(&dilation), topology(&other), "{round}");
        let triangles = [&dilation, &other].map(|made| made.solid.mesh().triangles.len());
        assert!(triangles[0] < triangles[1], "{round}: {triangles:?}");
    }
}

/// The six faces of a block between two corners, outwards, with its corners from a number on.
pub(super) fn block(first: u32, low: DVec3, high: DVec3) -> (Vec<DVec3>, Vec<Vec<u32>>) {
    let corner = |k: u32| low + (high - low) * DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2));
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    ((0..8).map(corner).collect(), sides.map(|side| side.map(|k| first + k).to_vec()).to_vec())
}

/// An upright prism on a regular polygon, whose faces are fans around its first corner: needles, where there are many.
fn prism(sides: u32, radius: f64, height: f64) -> (Vec<DVec3>, Vec<Vec<u32>>) {
    let at = |k: u32, z: f64| {
        let (sine, cosine) = (std::f64::consts::TAU * f64::from(k) / f64::from(sides)).sin_cos();
        DVec3::new(radius * cosine, radius * sine, z)
    };
    let vertices = (0..sides).map(|k| at(k, 0.0)).chain((0..sides).map(|k| at(k, height))).collect();
    let mut faces = Vec::new();
    for k in 0..sides {
        let next = (k + 1) % sides;
        faces.extend([vec![k, next, sides + next], vec![k, sides + next, sides + k]]);
        if (1..sides - 1).contains(&k) {
            faces.extend([vec![0, k + 1, k], vec![sides, sides + k, sides + k + 1]]);
        }
    }
    (vertices, faces)
}

/// Steps, prisms, blocks with a void, and plates as thick as two radii or nearly: within their bounds, filled, with the topology of the lattice's, and far fewer triangles.
#[test]
fn solids_keep_their_bounds_and_agree_with_the_lattice() {
    let mut random = Random(29);
    let (mut compared, mut left) = (0, 0);
    for round in 0..32_usize {
        let radius = [1.0, 0.7][round / 4 % 2];
        let tolerance = radius * [0.1, 0.05][round / 8 % 2];
        let (mut vertices, mut faces) = match round % 4 {
            // Columns beside each other.
            0 => {
                let heights: [[u32; 2]; 2] = std::array::from_fn(|_| std::array::from_fn(|_| (random.next() % 3) as u32));
                let of = |i: u32, j: u32| if i < 2 && j < 2 { 1 + heights[i as usize][j as usize] } else { 0 };
                let number = |i: u32, j: u32, k: u32| (k * 3 + j) * 3 + i;
                let vertices = (0..36).map(|n| 4.0 * DVec3::new(f64::from(n % 3), f64::from(n / 3 % 3), f64::from(n / 9))).collect();
                let mut faces = Vec::new();
                for (i, j, k) in (0..4).flat_map(|column| (0..3).map(move |k| (column % 2, column / 2, k))) {
                    if k >= of(i, j) {
                        continue;
                    }
                    let corner = |code: u32| number(i + (code & 1), j + (code >> 1 & 1), k + (code >> 2));
                    let open = [
                        k == 0,
                        k + 1 == of(i, j),
                        j == 0 || k >= of(i, j - 1),
                        k >= of(i, j + 1),
                        i == 0 || k >= of(i - 1, j),
                        k >= of(i + 1, j),
                    ];
                    let (_, sides) = block(0, DVec3::ZERO, DVec3::ONE);
                    faces.extend(
                        sides
                            .iter()
                            .zip(open)
                            .filter(|(_, open)| *open)
                            .map(|(side, _)| side.iter().map(|&code| corner(code)).collect::<Vec<u32>>()),
                    );
                }
                (vertices, faces)
            }
            1 => prism(3 + (random.next() % 60) as u32, 5.0 + 4.0 * number(&mut random), 4.0),
            2 => {
                let (mut vertices, mut faces) = block(0, DVec3::ZERO, DVec3::splat(9.0));
                let half = radius * (0.8 + number(&mut random));
                let (inner, sides) = block(8, DVec3::splat(4.5 - half), DVec3::splat(4.5 + half));
                vertices.extend(inner);
                faces.extend(sides.into_iter().map(|side| side.into_iter().rev().collect::<Vec<u32>>()));
                (vertices, faces)
            }
            _ => {
                let thickness = 2.0 * radius + [0.0, 1e-9, -1e-3, 0.03 * radius][round / 4 % 4];
                let (size, count) = ([30.0, 6.0][round / 16], [4, 24][round / 8 % 2]);
                if round / 4 % 2 == 0 {
                    block(0, DVec3::ZERO, DVec3::new(size, 0.6 * size, thickness))
                } else {
                    prism(count, 0.5 * size, thickness)
                }
            }
        };
        // Half of them in no plane of their own.
        if round / 4 % 2 == 1 {
            let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, 1.1);
            vertices.iter_mut().for_each(|vertex| *vertex = turn * *vertex);
        }
        // In another order, too.
        if round % 2 == 1 {
            faces.reverse();
        }
        let Some(shape) = lowered_as(Interior::Solid, &vertices, faces) else {
            assert_eq!(round % 4, 0, "only columns may touch along an edge");
            continue;
        };
        let Some(dilation) = arranged_unless_left(&shape, radius, tolerance) else {
            left += 1;
            continue;
        };
        assert!(dilation.inner_mm <= tolerance && dilation.outer_mm <= tolerance && dilation.crossings == 0, "{round}");
        assert!(dilation.topology_exact, "{round}: {} uncertain", dilation.uncertain);
        let inside = Inside::new(dilation.solid.mesh());
        let bounds = vertices.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], v| [low.min(*v), high.max(*v)]);
        let surfaces = shape.surfaces();
        let [solid] = surfaces.as_slice() else { panic!("{round}: {} solids", surfaces.len()) };
        let solid = Inside::new(solid);
        for _ in 0..400 {
            let x = bounds[0] - 1.3 * radius + place(&mut random, 1.0) * (bounds[1] - bounds[0] + 2.6 * radius);
            assert_bounds(round, &inside, &dilation, radius, x, solid.distance(x));
        }
        if round % 4 == 3 {
            // A lattice takes long for what is as thick as two radii, and does not tell.
            assert_eq!(topology(&dilation), (1, 0, 2), "{round}");
            continue;
        }
        let other = on_lattice(&shape, radius, tolerance);
        if other.topology_exact {
            compared += 1;
            assert_eq!(topology(&dilation), topology(&other), "{round}");
        }
        let triangles = [&dilation, &other].map(|made| made.solid.mesh().triangles.len());
        assert!(triangles[0] < triangles[1], "{round}: {triangles:?}");
    }
    assert!(compared > 16 && left == 0, "{compared} compared, {left} left to the lattice");
}

/// Discs and sectors with so many corners that sides hardly turn, as fans of needles: few polygons, within their bounds.
#[test]
fn fine_rims_are_arranged() {
    let mut random = Random(37);
    for (count, radius, tolerance) in [(90_u32, 1.0, 0.1), (400, 1.0, 0.02), (1_500, 0.5, 0.05), (400, 6.0, 0.3)] {
        for share in [1.0, 0.4] {
            let rim = (0..=count).map(|k| {
                let (sine, cosine) = (std::f64::consts::TAU * share * f64::from(k) / f64::from(count)).sin_cos();
                20.0 * DVec3::new(cosine, 0.6 * sine, 0.8 * sine)
            });
            let vertices: Vec<DVec3> = [DVec3::ZERO].into_iter().chain(rim).collect();
            let faces: Vec<Vec<u32>> = (1..=count).map(|k| vec![0, k, if share == 1.0 && k == count { 1 } else { k + 1 }]).collect();
            let shape = lowered(&vertices, faces.clone());
            let dilation = arranged(&shape, radius, tolerance);
            assert!(dilation.topology_exact && dilation.crossings == 0 && topology(&dilation) == (1, 0, 2), "{count} {share}");
            let (inside, distance) = (Inside::new(dilation.solid.mesh()), distance_of_triangles(&vertices, &faces));
            for _ in 0..400 {
                let on = vertices[(random.next() % u64::from(count)) as usize + 1] * number(&mut random).powf(0.3);
                let away = place(&mut random, 2.0) - DVec3::ONE;
                let x = on + away.normalize_or_zero() * radius * (0.8 + 0.4 * number(&mut random));
                assert_bounds(format_args!("{count} {share}"), &inside, &dilation, radius, x, distance(x));
            }
        }
    }
}

/// Blocks that cross in one mesh, which winds around a part of it twice.
#[test]
fn solids_that_cross_are_left_to_the_lattice() {
    let (mut vertices, mut faces) = block(0, DVec3::ZERO, DVec3::splat(10.0));
    let (others, sides) = block(8, DVec3::splat(5.0), DVec3::splat(15.0));
    vertices.extend(others);
    faces.extend(sides);
    let shape = lowered_as(Interior::Solid, &vertices, faces).unwrap();
    assert!(arranged_unless_left(&shape, 0.5, 0.05).is_none());
}

/// Triangles as narrow as rounding, and narrower: within their bounds.
#[test]
fn needles_are_arranged() {
    let mut random = Random(31);
    for round in 0..60_u32 {
        let width = [1e-2, 1e-3, 1e-5, 1e-8, 1e-13, 0.0][round as usize % 6];
        let mut vertices = Vec::new();
        for _ in 0..4 {
            let (from, way, off) =
                (place(&mut random, 20.0), place(&mut random, 16.0) - DVec3::splat(8.0), place(&mut random, 2.0) - DVec3::ONE);
            // Sharp at one end, or at both.
            let share = if round / 6 % 2 == 0 { 1.0 } else { number(&mut random) };
            vertices.extend([from, from + way, from + share * way + width * off]);
        }
        let faces = (0..4).map(|k| vec![3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let Some(shape) = lowered_as(Interior::Surface, &vertices, faces) else { continue };
        let dilation = arranged(&shape, 1.0, 0.05);
        assert!(dilation.topology_exact && dilation.crossings == 0, "{round}");
        // No narrower triangle is farther from its longest side.
        let sides: Vec<[DVec3; 2]> =
            vertices.chunks(3).flat_map(|corners| [[corners[0], corners[1]], [corners[1], corners[2]], [corners[2], corners[0]]]).collect();
        if width < 1e-5 {
            keeps_its_bounds(&dilation, &sides, 1.0, 20.0, &mut random);
        }
    }
}

/// Segments all over each other: what is said to be hidden is within others, and what is said not to meet does not.
#[test]
fn hidden_places_are_hidden() {
    let mut random = Random(41);
    let (mut hidden, mut shown, mut apart, mut asked) = (0, 0, 0, 0);
    for round in 0..6 {
        let size = 1.0 + 0.5 * f64::from(round);
        let segments = sticks(&mut random, 24, size, 1.0);
        with_arrangement(&wires(&segments), 1.0, 0.1, |arrangement| {
            let mut engine = Engine::new(arrangement, 0, &[]);
            assert!(engine.begin(&Budget::default()).unwrap());
            let bodies = engine.bodies();
            let all: Vec<u32> = (0..segments.len() as u32).collect();
            for _ in 0..400 {
                let mut set: Vec<u32> = (0..2 + random.next() % 3).map(|_| (random.next() % all.len() as u64) as u32).collect();
                set.sort_unstable();
                set.dedup();
                let common = bodies.common_of_dilations(&set);
                // Everywhere, or in a part of space.
                let half = if random.next().is_multiple_of(2) { 50.0 } else { 0.5 };
                let cube = Cube { centre: (place(&mut random, size + 1.0)).to_array(), half };
                let is_there = |x: &DVec3| (0..3).all(|axis| (x[axis] - cube.centre[axis]).abs() <= half);
                let places: Vec<DVec3> = (0..600).map(|_| place(&mut random, size + 3.0) - DVec3::ONE).collect();
                let in_common =
                    |kind: usize| places.iter().filter(|x| set.iter().all(|&body| is_in(&engine, body, **x)[kind])).collect::<Vec<_>>();
                let [of_dilations, of_polytopes] = [in_common(0), in_common(1)];
                if common == Common::None {
                    assert!(of_dilations.is_empty(), "{round}: {set:?}");
                    apart += 1;
                }
                if bodies.hidden(&set, common, &cube, &all, &mut asked) == Hidden::All {
                    hidden += 1;
                    for x in of_dilations.into_iter().chain(of_polytopes).filter(|x| is_there(x)) {
                        assert!(all.iter().any(|&body| is_in(&engine, body, *x) == [true; 2]), "{round}: {set:?} {x}");
                        shown += 1;
                    }
                }
            }
        });
    }
    assert!(hidden > 300 && shown > 500 && apart > 500, "{hidden} hidden, {shown} places, {apart} apart");
    assert!(asked > hidden, "{asked}");
}

/// Segments, balls and triangles all over each other: where a place is in no body all the time, those that it is in, of all dilations or of all polytopes, meet, or some of them are in doubt.
#[test]
fn what_is_not_in_doubt_meets() {
    let mut random = Random(59);
    let (mut met, mut doubtful, mut exposed, mut all, mut changed) = ([0; 3], 0, 0, [0; 3], [0; 4]);
    for round in 0..12_u32 {
        let size = 2.0 + f64::from(round % 4);
        let shape = match round % 3 {
            0 => wires(&sticks(&mut random, 24, size, 1.0)),
            1 => wires(&sticks(&mut random, 40, size, 1e-9)),
            _ => {
                let vertices: Vec<DVec3> = (0..36).map(|_| place(&mut random, size)).collect();
                lowered(&vertices, (0..12).map(|k| vec![3 * k, 3 * k + 1, 3 * k + 2]).collect())
            }
        };
        with_arrangement(&shape, 1.0, [0.1, 0.03][round as usize / 6], |arrangement| {
            let mut engine = Engine::new(arrangement, 0, &[]);
            let budget = Budget::default();
            assert!(engine.begin(&budget).unwrap());
            let count = arrangement.sites.list.len() as u32;
            let mut sets = Sets::new(&engine.bodies(), &budget).unwrap().expect("there are few");
            let mut changes = vec![Change::Other; count as usize];
            // As the polytopes are first, and twice after they were changed.
            for (step, (all, met)) in all.iter_mut().zip(&mut met).enumerate() {
                let bodies = engine.bodies();
                assert!(sets.look(&bodies, &changes, usize::MAX, &budget).unwrap());
                let doubts: Vec<Vec<u32>> = sets.doubts().into_iter().map(|doubt| doubt.sites).collect();
                *all += doubts.len();
                for _ in 0..20_000 {
                    // About as far from some figure as the band is.
                    let corners = arrangement.sites.list[random.next() as usize % count as usize].corners();
                    let from = DVec3::from_array(corners[random.next() as usize % corners.len()]);
                    let x = from + (0.88 + 0.2 * random.share()) * (place(&mut random, 2.0) - DVec3::ONE).normalize();
                    let own: Vec<[bool; 2]> = (0..count).map(|body| is_in(&engine, body, x)).collect();
                    if own.contains(&[true; 2]) {
                        continue;
                    }
                    exposed += 1;
                    for of_kind in [0, 1].map(|kind| own.iter().map(|own| own[kind]).collect::<Vec<bool>>()) {
                        let set: Vec<u32> = (0..count).filter(|&body| of_kind[body as usize]).collect();
                        if set.len() < 2 {
                            continue;
                        }
                        let some: Vec<u32> = (0..MOST_BODIES).map(|_| set[(random.next() % set.len() as u64) as usize]).collect();
                        let set: Vec<u32> = (0..count).filter(|body| some.contains(body)).collect();
                        if doubts.iter().any(|doubt| doubt.iter().all(|site| set.contains(site))) {
                            doubtful += 1;
                        } else {
                            let place = bodies.common(&[Kind::Dilation, Kind::Polytope], &set, bodies.within(&set), 0.0);
                            assert!(matches!(place, Place::At(_)), "{round}, {step}: {set:?} at {x}, of {count}");
                            *met += usize::from(set.len() > 1);
                        }
                    }
                }
                // What was not looked at again is as settled as if it was.
                let mut anew = Sets::new(&bodies, &budget).unwrap().expect("there are few");
                assert!(anew.look(&bodies, &vec![Change::Other; count as usize], usize::MAX, &budget).unwrap());
                for Doubt { sites, .. } in anew.doubts() {
                    assert!(doubts.iter().any(|own| own.iter().all(|site| sites.contains(site))), "{round}, {step}: {sites:?}");
                }
                changes = engine.refine(&sets.doubts(), &budget).unwrap();
                for change in &changes {
                    changed[*change as usize] += 1;
                }
            }
        });
    }
    let [_, cut, around, other] = changed;
    assert!(cut > 3 && around > 10, "{cut} cut, {around} around, {other} otherwise");
    assert!(all[0] > 3 && all[2] < all[0], "{all:?} in doubt");
    assert!(met.iter().all(|&met| met > 300) && exposed > 15_000, "{met:?} met, {doubtful} in doubt, {exposed} exposed");
}

/// What is told of a body and a cube from another place: bodies that do not reach it, sets that have no common place in it, or anywhere, and bodies that hold all of it, against places in it.
#[test]
fn what_is_told_of_cubes_holds_in_them() {
    let mut random = Random(67);
    let (mut dropped, mut parted, mut covered, mut apart) = (0, 0, 0, 0);
    for round in 0..12 {
        let size = 3.0;
        let shape = if round % 2 == 0 {
            wires(&sticks(&mut random, 16, size, 1.0))
        } else {
            let vertices: Vec<DVec3> = (0..30).map(|_| place(&mut random, size)).collect();
            lowered(&vertices, (0..10).map(|k| vec![3 * k, 3 * k + 1, 3 * k + 2]).collect())
        };
        with_arrangement(&shape, 1.0, 0.1, |arrangement| {
            let mut engine = Engine::new(arrangement, 0, &[]);
            assert!(engine.begin(&Budget::default()).unwrap());
            let bodies = engine.bodies();
            let all: Vec<u32> = (0..arrangement.sites.list.len() as u32).collect();
            for trial in 0..300 {
                let mut cube = Cube { centre: place(&mut random, size).to_array(), half: 0.02 + 0.6 * random.share() };
                if trial % 3 == 0 {
                    // On a figure, up to rounding, and as wide as some: directions from there are no more than noise.
                    let corners = arrangement.sites.list[random.next() as usize % all.len()].corners();
                    let [a, b] = [corners[0], corners[1]].map(DVec3::from_array);
                    cube = Cube { centre: a.lerp(b, random.share()).to_array(), half: 0.1 + 3.0 * random.share() };
                }
                let from =
                    (DVec3::from_array(cube.centre) + place(&mut random, 4.0 * cube.half) - DVec3::splat(2.0 * cube.half)).to_array();
                let inside =
                    |random: &mut Random| (DVec3::from_array(cube.centre) + cube.half * (place(random, 2.0) - DVec3::ONE)).to_array();
                let places: Vec<[f64; 3]> = cube.corners().chain((0..60).map(|_| inside(&mut random))).collect();
                let near: Vec<Near> = all.iter().map(|&body| bodies.near(body, &cube.centre)).collect();
                for &body in &all {
                    if !bodies.may_reach(body, &cube, &from, &bodies.near(body, &from)) {
                        dropped += 1;
                        assert!(places.iter().all(|x| bodies.above(Kind::Outer, body, x).0 > 0.0), "{round}: {body} reaches {cube:?}");
                    }
                }
                for stage in [&ANY, &PRESENT] {
                    let mut search = Search::new(&bodies, stage);
                    search.see(&cube, &all, &near);
                    for _ in 0..20 {
                        let mut set: Vec<usize> = (0..2 + random.next() % 3).map(|_| (random.next() % all.len() as u64) as usize).collect();
                        set.sort_unstable();
                        set.dedup();
                        if set.len() > 1 && search.are_parted(&cube, &set) {
                            parted += 1;
                            for &kind in stage.outside {
                                let meets = |x: &[f64; 3]| set.iter().all(|&place| bodies.above(kind, all[place], x).0 <= 0.0);
                                assert!(!places.iter().any(meets), "{round}: {set:?} meet in {cube:?}");
                            }
                        }
                    }
                    let is_in = |body: u32, x: &[f64; 3]| stage.inside.iter().all(|&kind| bodies.above(kind, body, x).0 < 0.0);
                    for _ in 0..4 {
                        let set: Vec<u32> = (0..2).map(|_| all[(random.next() % all.len() as u64) as usize]).collect();
                        match bodies.hub(stage.inside, &set, cube.centre) {
                            Hub::At(x) => assert!(set.iter().all(|&body| is_in(body, &x)), "{round}: {set:?} at {x:?}"),
                            Hub::Apart(pair) => {
                                apart += 1;
                                let place = bodies.common(&stage.inside[..1], &pair, bodies.within(&pair), 0.0);
                                assert!(!matches!(place, Place::At(_)) && pair.iter().all(|body| set.contains(body)), "{round}: {pair:?}");
                            }
                            Hub::Unknown => {}
                        }
                    }
                    if is_covered(&bodies, stage.inside, &cube, &all, &near, &mut Vec::new()) {
                        covered += 1;
                        let holds = |&body: &u32| places.iter().all(|x| is_in(body, x));
                        assert!(all.iter().any(holds), "{round}: nothing holds {cube:?}");
                    }
                }
            }
        });
    }
    assert!(dropped > 5_000 && parted > 5_000 && covered > 200, "{dropped} dropped, {parted} parted, {covered} covered");
    assert!(apart > 1_000, "{apart} apart");
}

/// Two rods across each other, seen from cubes with their centres on one of them up to rounding, where the way from it is noise: what is told of them there does not part them.
#[test]
fn ways_of_rounding_part_nothing() {
    let mut random = Random(71);
    let mut noisy = 0;
    for round in 0..60 {
        let mut way = || (place(&mut random, 2.0) - DVec3::ONE).normalize();
        let (along, across, at) = (way(), way(), 10.0 * way());
        let rods = wires(&[[at - 12.0 * along, at + 7.0 * along], [at - 5.0 * across, at + 4.0 * across]]);
        with_arrangement(&rods, 1.0, 0.1, |arrangement| {
            let mut engine = Engine::new(arrangement, 0, &[]);
            assert!(engine.begin(&Budget::default()).unwrap());
            let bodies = engine.bodies();
            for _ in 0..400 {
                // Both are around the place where they cross, which is in the cube.
                let far = 1.2 + 2.0 * random.share();
                let cube = Cube { centre: (at - far * along).to_array(), half: far };
                let near: Vec<Near> = [0, 1].map(|body| bodies.near(body, &cube.centre)).to_vec();
                noisy += usize::from(near.iter().any(|near| near.way != [0.0; 3] && near.way.iter().all(|x| x.abs() < 1e-12)));
                for stage in [&ANY, &PRESENT] {
                    let mut search = Search::new(&bodies, stage);
                    search.see(&cube, &[0, 1], &near);
                    assert!(!search.are_parted(&cube, &[0, 1]), "{round}: {far}");
                }
            }
        });
    }
    assert!(noisy > 10_000, "{noisy} ways of rounding");
}

/// Plates side by side with a chamfered corner, so small that rounding turns its side anyhow, far from the origin: they do not meet, and nothing between them is hidden.
#[test]
fn short_sides_turn_no_boxes() {
    let mut random = Random(47);
    for tiny in [1e-3, 1e-7, 1e-9, 1e-11] {
        for trial in 0..30 {
            let turn = glam::DQuat::from_scaled_axis(place(&mut random, 2.0));
            let flat = [[0.0, 0.0], [40.0, 0.0], [40.0, 20.0], [tiny, 20.0], [0.0, 20.0 - tiny]];
            let corner = |k: usize, z: f64| {
                let [x, y] = flat[((if trial / 5 % 2 == 1 { 4 - k } else { k }) + trial) % 5];
                turn * DVec3::new(x + 1000.0, y, z)
            };
            let vertices: Vec<DVec3> =
                [0.0, 2.002].into_iter().flat_map(|z| (0..5).map(move |k| (k, z))).map(|(k, z)| corner(k, z)).collect();
            let faces = [0, 5].into_iter().flat_map(|first| (1..4).map(move |k| vec![first, first + k, first + k + 1])).collect();
            let shape = lowered(&vertices, faces);
            with_arrangement(&shape, 1.0, 0.1, |arrangement| {
                let mut engine = Engine::new(arrangement, 0, &[]);
                assert!(engine.begin(&Budget::default()).unwrap());
                let bodies = engine.bodies();
                for body in 0..arrangement.sites.list.len() as u32 {
                    let axes = bodies.axes(body).map(DVec3::from_array);
                    let skew = |p: usize, q: usize| (axes[p].dot(axes[q]) - f64::from(u8::from(p == q))).abs();
                    assert!((0..9).all(|place| skew(place / 3, place % 3) < 1e-14), "{tiny} {trial}: {axes:?}");
                }
                if arrangement.sites.list.len() == 2 {
                    assert_ne!(bodies.hidden(&[0, 1], Common::Unknown, &around(), &[0, 1], &mut 0), Hidden::All, "{tiny} {trial}");
                }
            });
            let dilation = arranged(&shape, 1.0, 0.1);
            assert!(!dilation.topology_exact || topology(&dilation) == (2, 0, 4), "{tiny} {trial}");
        }
    }
}

/// A plate with a slot through it whose walls' dilations hardly meet, with sharp ends or round ones: what they have in common is long and thin, and dozens have it around an end. It is filled, without a lattice and without a doubt.
#[test]
fn slots_that_hardly_close_are_arranged() {
    // Half as long and half as wide as told, with its corners where it ends, against the clock, and a plate of a size around it.
    let plate = |slot: &[[f64; 2]], [wide, high]: [f64; 2]| {
        let (count, corners) = (slot.len() as u32, [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]);
        let both = |x: f64, y: f64| [0.0, high].map(|z| DVec3::new(x, y, z));
        let around = corners.iter().map(|&[x, y]| both(wide * x, wide * y)).chain(slot.iter().map(|&[x, y]| both(x, y)));
        let vertices: Vec<DVec3> = around.flatten().collect();
        let corner = |place: u32| 4 * (place % count) / count;
        let (low, own) = (|corner: u32| 2 * corner, |place: u32| 8 + 2 * (place % count));
        let mut faces = Vec::new();
        for place in 0..count {
            let ([from, to], [a, b]) = ([place, place + 1].map(own), [place, place + 1].map(|place| low(corner(place))));
            faces.extend([vec![from, to, a], vec![to + 1, from + 1, a + 1], vec![from, from + 1, to + 1], vec![from, to + 1, to]]);
            if a != b {
                faces.extend([vec![b, a, to], vec![a + 1, b + 1, to + 1], vec![a, b, b + 1], vec![a, b + 1, a + 1]]);
            }
        }
        (vertices, faces)
    };
    let round = |half: f64, wide: f64| -> Vec<[f64; 2]> {
        let end = |out: f64| {
            (0..16).map(move |k| (out, std::f64::consts::PI * f64::from(k) / 15.0)).map(move |(out, turn)| {
                let (sine, cosine) = turn.sin_cos();
                [out * wide * cosine, out * (half + wide * sine)]
            })
        };
        end(1.0).chain(end(-1.0)).collect()
    };
    for (slot, size, is_sharp) in
        [(vec![[0.975, 20.0], [-0.975, 20.0], [-0.975, -20.0], [0.975, -20.0]], [50.0, 10.0], true), (round(8.0, 0.99), [14.0, 6.0], false)]
    {
        let (vertices, faces) = plate(&slot, size);
        let shape = lowered_as(Interior::Solid, &vertices, faces).unwrap();
        let dilation = dilate(&shape, Radius::new(1.0).unwrap(), Tolerance::new(0.1).unwrap(), &Budget::default()).unwrap();
        assert!(dilation.topology_exact && dilation.crossings == 0 && dilation.pitch_mm.is_none(), "{is_sharp}");
        assert_eq!(topology(&dilation), (1, 0, 2), "{is_sharp}");
        // Steiner's formula of the box, less dents at the mouths of the slot, which are no deeper than the radius.
        let volume = crate::measure::mass::volume(dilation.solid.mesh());
        let of = |r: f64| {
            let (a, h) = (2.0 * size[0], size[1]);
            a * a * h
                + 2.0 * (a * a + 2.0 * a * h) * r
                + std::f64::consts::PI * (2.0 * a + h) * r * r
                + 4.0 / 3.0 * std::f64::consts::PI * r.powi(3)
        };
        let dents = 2.0
            * slot.iter().fold([0.0; 2], |most, at| [0, 1].map(|k| at[k].max(most[k]))).map(|half: f64| 2.0 * half).iter().product::<f64>();
        assert!(of(0.9) - dents < volume && volume < of(1.1), "{is_sharp}: {volume}");
    }
}

/// Plates as thick as two radii, or a little less: what both faces' dilations have in common is within the plate, or near its rim.
#[test]
fn places_hidden_in_solids_are_hidden() {
    let mut random = Random(43);
    let (mut hidden, mut shown) = (0, 0);
    for round in 0..16_u32 {
        let thickness = [2.0, 1.99, 1.9, 1.5][round as usize % 4];
        let (vertices, faces) = prism(3 + round, 2.0 + f64::from(round % 5), thickness);
        let turn = glam::DQuat::from_scaled_axis(f64::from(round / 4) * DVec3::new(0.3, 0.2, 0.1));
        let vertices: Vec<DVec3> = vertices.into_iter().map(|vertex| turn * vertex).collect();
        let shape = lowered_as(Interior::Solid, &vertices, faces).unwrap();
        with_arrangement(&shape, 1.0, 0.05, |arrangement| {
            let solids: Vec<Inside<'_>> = arrangement.solids.iter().map(Inside::new).collect();
            let mut engine = Engine::new(arrangement, 0, &solids);
            assert!(engine.begin(&Budget::default()).unwrap());
            let (bodies, count) = (engine.bodies(), arrangement.sites.list.len() as u32);
            let all: Vec<u32> = (0..count).collect();
            for (first, second) in (0..count).flat_map(|first| (0..first).map(move |second| (second, first))) {
                if bodies.hidden(&[first, second], Common::Unknown, &around(), &all, &mut 0) != Hidden::All {
                    continue;
                }
                hidden += 1;
                for _ in 0..1_000 {
                    // Around the middle, where faces' dilations meet, as far as beyond the rim.
                    let x =
                        turn * (place(&mut random, 1.0) * DVec3::new(16.0, 16.0, 1.0) + DVec3::new(-8.0, -8.0, 0.5 * (thickness - 1.0)));
                    let is_common = (0..2).any(|kind| is_in(&engine, first, x)[kind] && is_in(&engine, second, x)[kind]);
                    if is_common {
                        let is_hidden = solids[0].winding(x) > 0 || (0..count).any(|body| is_in(&engine, body, x) == [true; 2]);
                        assert!(is_hidden, "{round}: {first} {second} {x}");
                        shown += 1;
                    }
                }
            }
        });
    }
    assert!(hidden > 100 && shown > 400, "{hidden} hidden, {shown} places");
}
