//! Meshes that are no solids, repaired: closed forms, and random damage of closed meshes, which must be undone.

use std::f64::consts::TAU;

use glam::DVec3;
use lacuna_kernel::budget::{Budget, CancelToken, StopReason};
use lacuna_kernel::measure::mass::volume;
use lacuna_kernel::solid::{Crossings, Repair, RepairError, Repaired, Solid, Topology, TriMesh, Unfilled, repair};

/// A box with outward faces.
fn cuboid(low: [f64; 3], high: [f64; 3]) -> TriMesh {
    let corner = |code: usize| DVec3::from_array(std::array::from_fn(|axis| if code >> axis & 1 == 1 { high[axis] } else { low[axis] }));
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriMesh { vertices: (0..8).map(corner).collect(), triangles }
}

fn cube(low: f64, high: f64) -> TriMesh {
    cuboid([low; 3], [high; 3])
}

/// A torus about the z axis.
fn torus(across: usize, around: usize) -> TriMesh {
    let place = |index: usize| {
        let (u, v) = (TAU * (index / across) as f64 / around as f64, TAU * (index % across) as f64 / across as f64);
        DVec3::new((5.0 + 2.0 * v.cos()) * u.cos(), (5.0 + 2.0 * v.cos()) * u.sin(), 2.0 * v.sin())
    };
    let name = |i: usize, j: usize| (i % around * across + j % across) as u32;
    let square = |i: usize, j: usize| {
        let [a, b, c, d] = [name(i, j), name(i + 1, j), name(i + 1, j + 1), name(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    let triangles = (0..around).flat_map(|i| (0..across).flat_map(move |j| square(i, j))).collect();
    TriMesh { vertices: (0..around * across).map(place).collect(), triangles }
}

fn both(first: &TriMesh, second: &TriMesh) -> TriMesh {
    let mut mesh = first.clone();
    mesh.append(second);
    mesh
}

fn reversed(mesh: &TriMesh) -> TriMesh {
    let mut mesh = mesh.clone();
    mesh.reverse();
    mesh
}

/// Every triangle with corners of its own.
fn soup(mesh: &TriMesh) -> TriMesh {
    let vertices: Vec<DVec3> = mesh.triangles.iter().flatten().map(|&corner| mesh.vertices[corner as usize]).collect();
    let triangles = (0..mesh.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    TriMesh { vertices, triangles }
}

/// Vertices at the same place made one.
fn joined(mesh: &TriMesh) -> TriMesh {
    let lowest = |corner: u32| mesh.vertices.iter().position(|place| *place == mesh.vertices[corner as usize]).unwrap() as u32;
    TriMesh { vertices: mesh.vertices.clone(), triangles: mesh.triangles.iter().map(|corners| corners.map(lowest)).collect() }
}

#[track_caller]
fn repaired(mesh: &TriMesh) -> (Solid, Repair) {
    let Repaired { solid, repair } = repair(mesh, &Budget::default()).unwrap();
    (solid.unwrap(), repair)
}

fn refused(mesh: &TriMesh) -> RepairError {
    repair(mesh, &Budget::default()).unwrap_err()
}

/// Pieces, voids and handles.
fn shape(solid: &Solid) -> [i64; 3] {
    let Topology { components, cavities, genus, .. } = *solid.topology();
    [components as i64, cavities as i64, genus]
}

#[test]
fn what_is_fine_is_left_alone() {
    let nested = both(&cube(0.0, 4.0), &reversed(&cube(1.0, 2.0)));
    // Two boxes along an edge, each with corners of its own, are a solid.
    let touching = both(&cube(0.0, 1.0), &cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 1.0]));
    for mesh in [cube(0.0, 2.0), torus(7, 12), nested, touching] {
        assert_eq!(repair(&mesh, &Budget::default()), Ok(Repaired { solid: None, repair: Repair::default() }));
    }
}

#[test]
fn turned_triangles() {
    let mut mesh = cube(0.0, 2.0);
    [1, 4, 5, 10].into_iter().for_each(|index: usize| mesh.triangles[index].swap(0, 1));
    let (solid, found) = repaired(&mesh);
    assert_eq!((found, volume(solid.mesh())), (Repair { turned_triangles: 4, ..Repair::default() }, 8.0));
    let (solid, found) = repaired(&reversed(&cube(0.0, 2.0)));
    assert_eq!((found.turned_triangles, volume(solid.mesh())), (12, 8.0));
}

#[test]
fn a_soup_with_copies() {
    let mut mesh = soup(&cube(-1.0, 1.0));
    // One corner has the other zero, which is the same place.
    mesh.vertices.iter_mut().flat_map(AsMut::<[f64; 3]>::as_mut).filter(|x| **x == 0.0).for_each(|x| *x = -0.0);
    mesh.triangles.extend([[3, 4, 5], [8, 7, 6], [8, 7, 6]]);
    let (solid, found) = repaired(&mesh);
    assert_eq!(found, Repair { joined_vertices: 28, copied_triangles: 3, ..Repair::default() });
    assert_eq!((volume(solid.mesh()), shape(&solid)), (8.0, [1, 0, 0]));
    let zeros = |x: f64| TriMesh {
        vertices: [[x, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(DVec3::from).to_vec(),
        triangles: Vec::new(),
    };
    let mut mesh = both(&zeros(0.0), &zeros(-0.0));
    mesh.triangles = vec![[0, 2, 1], [4, 1, 3], [1, 2, 3], [0, 7, 6]];
    assert_eq!(repaired(&mesh).1, Repair { joined_vertices: 3, ..Repair::default() });
}

#[test]
fn every_face_twice_and_walls_between_pieces() {
    // Both sides of every face, as some programs write them.
    let (solid, found) = repaired(&joined(&both(&cube(0.0, 2.0), &reversed(&cube(0.0, 2.0)))));
    assert_eq!((found, volume(solid.mesh())), (Repair { copied_triangles: 12, ..Repair::default() }, 8.0));
    // Four boxes around a line: twelve faces of each, of which eight walls of two triangles are common to two.
    let at = |x: f64, y: f64| cuboid([x, y, 0.0], [x + 1.0, y + 1.0, 1.0]);
    let four = both(&both(&at(0.0, 0.0), &at(1.0, 0.0)), &both(&at(0.0, 1.0), &at(1.0, 1.0)));
    for mesh in [four.clone(), soup(&four)] {
        let result = repair(&mesh, &Budget::default());
        // The diagonals of common faces coincide or cross as the faces are cut, so that walls are common or touch.
        let solid = result.unwrap().solid.unwrap();
        assert_eq!((volume(solid.mesh()), shape(&solid)), (4.0, [1, 0, 0]));
    }
}

#[test]
fn boxes_that_share_an_edge_or_a_corner() {
    let edge = joined(&both(&cube(0.0, 1.0), &cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 1.0])));
    let (solid, found) = repaired(&edge);
    assert_eq!(found, Repair { parted_edges: 1, doubled_vertices: 2, ..Repair::default() });
    assert_eq!((volume(solid.mesh()), shape(&solid)), (2.0, [2, 0, 0]));
    let corner = joined(&both(&cube(0.0, 1.0), &cube(1.0, 2.0)));
    let (solid, found) = repaired(&corner);
    assert_eq!(found, Repair { doubled_vertices: 1, ..Repair::default() });
    assert_eq!((volume(solid.mesh()), shape(&solid)), (2.0, [2, 0, 0]));
    // The direction of its triangles says nothing of a wedge: here they are turned at random.
    let mut turned = edge;
    (0..24).filter(|index| 0x5A_31C7_u32 >> index & 1 == 1).for_each(|index: usize| turned.triangles[index].swap(0, 2));
    assert_eq!(volume(repaired(&turned).0.mesh()), 2.0);
}

#[test]
fn shells_within_shells() {
    // Outward or inward as they come: the second is a void, the third a solid in it, and the fourth lies beside.
    let shells = [cube(0.0, 8.0), cube(1.0, 7.0), cube(2.0, 6.0), cube(10.0, 11.0)];
    for code in 0..16 {
        let parts = shells.iter().enumerate().map(|(k, shell)| if code >> k & 1 == 1 { reversed(shell) } else { shell.clone() });
        let mesh = parts.reduce(|all, shell| both(&all, &shell)).unwrap();
        let found = repair(&mesh, &Budget::default()).unwrap();
        let turned = 12 * (code ^ 0b0010_u32).count_ones();
        // An outward shell becomes a void; in a mesh that is inside out as a whole it was one.
        let shells_made_voids = u64::from(code & 0b0010 == 0 && turned < 48);
        assert_eq!(found.repair, Repair { turned_triangles: u64::from(turned), shells_made_voids, ..Repair::default() });
        let solid = found.solid.unwrap_or_else(|| Solid::new(mesh, &Budget::default()).unwrap());
        assert_eq!((volume(solid.mesh()), shape(&solid)), (512.0 - 216.0 + 64.0 + 1.0, [3, 1, 0]));
    }
}

#[test]
fn triangles_without_area() {
    // A square face is cut at the middle of an edge on one side only, and a triangle without area fills the crack.
    let mut mesh = cube(0.0, 2.0);
    let middle = mesh.vertices.len() as u32;
    mesh.vertices.push(DVec3::new(0.0, 0.0, 1.0));
    let cut = mesh.triangles.iter().position(|corners| corners.contains(&0) && corners.contains(&4)).unwrap();
    let whole = mesh.triangles[cut];
    let halves = [0, 4].map(|end| whole.map(|corner| if corner == end { middle } else { corner }));
    mesh.triangles[cut] = halves[0];
    mesh.triangles.extend([halves[1], [4, 0, middle], [3, 3, 5]]);
    let (solid, found) = repaired(&mesh);
    assert_eq!(found, Repair { flat_triangles: 2, ..Repair::default() });
    assert_eq!((volume(solid.mesh()), solid.topology().triangles, shape(&solid)), (8.0, 14, [1, 0, 0]));
}

#[test]
fn what_is_not_repaired_is_told() {
    // Two holes that share a corner are no two loops.
    let mut open = cube(0.0, 2.0);
    open.triangles.retain(|corners| ![[0, 4, 6], [0, 1, 5]].contains(corners));
    let Err(RepairError::Open { boundary, odd, .. }) = repair(&open, &Budget::default()) else { panic!("it is open") };
    assert_eq!((boundary, odd), (6, 0));
    // A wall of one sheet within.
    let mut walled = cube(0.0, 2.0);
    walled.triangles.extend([[0, 3, 7], [0, 7, 4]]);
    assert!(matches!(refused(&walled), RepairError::Open { boundary: 0, odd: 4, .. }));
    // Two boxes that cross stay as they are and are told; with a triangle turned nobody knows what is inside.
    let mut crossing = both(&cube(0.0, 2.0), &cube(1.0, 3.0));
    let found = repair(&crossing, &Budget::default()).unwrap();
    assert!(found.solid.is_none() && found.repair.crossings > 0 && !found.repair.is_change());
    crossing.triangles[0].swap(0, 1);
    assert!(matches!(refused(&crossing), RepairError::Crossing { count, .. } if count == found.repair.crossings));
    // Six triangles of the projective plane, which has one side; it cannot but cross itself.
    let vertices =
        [[0.0, 0.0, 3.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [-4.0, 0.0, 1.0], [0.0, -4.0, 0.0], [1.0, 1.0, -3.0]].map(DVec3::from).to_vec();
    let triangles = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 5, 1], [1, 2, 4], [2, 3, 5], [3, 4, 1], [4, 5, 2], [5, 1, 3]].to_vec();
    assert!(matches!(refused(&TriMesh { vertices, triangles }), RepairError::OneSided { .. }));
    let sheet = TriMesh { vertices: cube(0.0, 1.0).vertices, triangles: vec![[0, 1, 3], [3, 1, 0]] };
    assert_eq!(refused(&sheet), RepairError::Empty);
    assert_eq!(refused(&TriMesh::default()), RepairError::Empty);
    let missing = TriMesh { vertices: Vec::new(), triangles: vec![[0, 1, 2]] };
    assert!(matches!(refused(&missing), RepairError::NoSolid(_)));
    let cancel = CancelToken::new();
    cancel.fire(StopReason::Cancelled);
    assert!(matches!(repair(&soup(&torus(30, 40)), &Budget { cancel, ..Budget::default() }), Err(RepairError::Stopped(_))));
}

/// The generator splitmix64.
struct Random(u64);

impl Random {
    fn below(&mut self, count: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % count as u64) as usize
    }
}

/// Damages a mesh: cuts triangles at the middle of an edge and fills the crack with triangles without area, adds copies and points, turns triangles, shuffles
/// them, and gives every one corners of its own or some of them.
fn damaged(mesh: &TriMesh, cuts: bool, random: &mut Random) -> TriMesh {
    let mut mesh = mesh.clone();
    for _ in 0..if cuts { random.below(4) } else { 0 } {
        let index = random.below(mesh.triangles.len());
        let corners = mesh.triangles[index];
        let (a, b) = (corners[random.below(3)], corners[random.below(3)]);
        let [p, q] = [a, b].map(|corner| mesh.vertices[corner as usize]);
        if a != b {
            let middle = mesh.vertices.len() as u32;
            mesh.vertices.push(0.5 * (p + q));
            mesh.triangles[index] = corners.map(|corner| if corner == a { middle } else { corner });
            mesh.triangles.push(corners.map(|corner| if corner == b { middle } else { corner }));
            mesh.triangles.push([a, middle, b]);
        }
    }
    for _ in 0..random.below(6) {
        let copied = mesh.triangles[random.below(mesh.triangles.len())];
        mesh.triangles.push(copied);
        mesh.triangles.push([copied[0], copied[2], copied[0]]);
    }
    for corners in &mut mesh.triangles {
        corners.rotate_left(random.below(3));
        if random.below(3) == 0 {
            corners.swap(0, 1);
        }
    }
    for index in (1..mesh.triangles.len()).rev() {
        mesh.triangles.swap(index, random.below(index + 1));
    }
    match random.below(3) {
        0 => soup(&mesh),
        1 => {
            let own = soup(&mesh);
            let first = mesh.vertices.len() as u32;
            let either = |(shared, alone): (&[u32; 3], &[u32; 3])| {
                std::array::from_fn(|k| if random.below(2) == 0 { shared[k] } else { first + alone[k] })
            };
            let triangles = mesh.triangles.iter().zip(&own.triangles).map(either).collect();
            TriMesh { vertices: [mesh.vertices, own.vertices].concat(), triangles }
        }
        _ => mesh,
    }
}

#[test]
fn random_damage_is_undone() {
    let edge = both(&cube(0.0, 1.0), &cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 1.0]));
    let nested =
        [cube(-4.0, 4.0), reversed(&cube(-3.0, 3.0)), cube(-2.0, 2.0)].into_iter().reduce(|all, shell| both(&all, &shell)).unwrap();
    // The torus has no middles on its edges that doubles could name: it is not cut.
    for (mesh, cuts) in [(cube(0.0, 2.0), true), (torus(9, 16), false), (edge, true), (nested, true)] {
        let original = Solid::new(mesh.clone(), &Budget::default()).unwrap();
        let exact = volume(&mesh);
        for seed in 0..100 {
            let damaged = damaged(&mesh, cuts, &mut Random(seed));
            let result = repair(&damaged, &Budget::default()).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
            let solid = result.solid.unwrap_or_else(|| Solid::new(damaged, &Budget::default()).unwrap());
            assert!((volume(solid.mesh()) - exact).abs() <= 1e-12 * exact, "seed {seed}: {} instead of {exact}", volume(solid.mesh()));
            assert_eq!((shape(&solid), result.repair.crossings), (shape(&original), 0), "seed {seed}");
            if !cuts {
                assert_eq!(solid.topology(), original.topology(), "seed {seed}");
            }
            // What came out is fine.
            let again = repair(solid.mesh(), &Budget::default()).unwrap();
            assert_eq!(again, Repaired { solid: None, repair: Repair::default() }, "seed {seed}");
        }
    }
}

#[test]
fn small_holes_are_closed() {
    // A side of a cube, a fifth of the rest; and a triangle.
    for left in [10, 11] {
        let mut open = cube(0.0, 2.0);
        open.triangles.truncate(left);
        let (solid, done) = repaired(&open);
        let edges = 14 - left as u64;
        let wanted = Repair { filled_holes: 1, filling_triangles: edges - 2, longest_hole_edges: edges, ..Repair::default() };
        assert_eq!((done, shape(&solid)), (wanted, [1, 0, 0]));
        assert!((volume(solid.mesh()) - 8.0).abs() < 1e-12);
    }
    // A square tube: its ends have half the area of its sides, which is more than small.
    let mut tube = cube(0.0, 2.0);
    tube.triangles.truncate(8);
    assert!(matches!(refused(&tube), RepairError::Hole { reason: Unfilled::Large { .. }, .. }), "{:?}", refused(&tube));
    // A sheet has a border, and nothing behind it.
    let sheet = TriMesh { vertices: cube(0.0, 2.0).vertices, triangles: vec![[0, 1, 3], [0, 3, 2]] };
    assert!(matches!(refused(&sheet), RepairError::Hole { edges: 4, reason: Unfilled::Crossing, .. }), "{:?}", refused(&sheet));
    // A ring of a torus left out: two loops that no triangles between their own corners may join wrongly; as discs they make a ball of it.
    let mut ring = torus(12, 30);
    ring.triangles.drain(..24);
    let (solid, done) = repaired(&ring);
    assert_eq!((done.filled_holes, done.filling_triangles, done.longest_hole_edges, shape(&solid)), (2, 20, 12, [1, 0, 0]));
    // As many edges as there may be, and one more.
    for (across, is_filled) in [(64, true), (65, false)] {
        let mut ring = torus(across, 100);
        ring.triangles.drain(..2 * across);
        match repair(&ring, &Budget::default()) {
            Ok(found) => assert!(is_filled && found.repair.longest_hole_edges == 64),
            Err(error) => assert!(!is_filled && matches!(error, RepairError::Hole { edges: 65, reason: Unfilled::Long { most: 64 }, .. })),
        }
    }
    // A bar through the hole of a side is in the way of whatever closes it.
    let mut pierced = cube(0.0, 2.0);
    pierced.triangles.truncate(10);
    let pierced = both(&pierced, &cuboid([0.5, 0.5, 1.0], [0.75, 1.5, 3.0]));
    let both_ways = both(&pierced, &cuboid([1.25, 0.5, 1.0], [1.5, 1.5, 3.0]));
    assert!(matches!(refused(&both_ways), RepairError::Hole { edges: 4, reason: Unfilled::Crossing, .. }));
}

/// Patches taken from closed surfaces at random: either the result is a solid without crossings whose triangles are those that were there and those that are told,
/// or the hole is told by one of its corners.
#[test]
fn removed_patches_are_closed_or_told() {
    let mut seed = 12_u64;
    let mut random = |below: usize| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize % below
    };
    let mut closed = 0;
    for round in 0..200 {
        let mut mesh = torus(8 + round % 9, 12 + round % 7);
        // Bumps, so that holes are not plane.
        for vertex in &mut mesh.vertices {
            *vertex *= 1.0 + 0.01 * random(10) as f64;
        }
        for _ in 0..1 + random(3) {
            let start = mesh.triangles[random(mesh.triangles.len())];
            let mut patch: Vec<u32> = start.to_vec();
            for _ in 0..random(4) {
                let near = mesh
                    .triangles
                    .iter()
                    .find(|corners| corners.iter().any(|c| patch.contains(c)) && corners.iter().any(|c| !patch.contains(c)));
                patch.extend(near.into_iter().flatten());
            }
            mesh.triangles.retain(|corners| !corners.iter().all(|corner| patch.contains(corner)));
        }
        let crossings = Crossings::of(&mesh, &Budget::default()).unwrap().count;
        match repair(&mesh, &Budget::default()) {
            Ok(found) => {
                let solid = found.solid.unwrap();
                assert!(found.repair.filled_holes > 0 && found.repair.longest_hole_edges >= 3);
                assert_eq!(solid.mesh().triangles.len(), mesh.triangles.len() + found.repair.filling_triangles as usize);
                assert_eq!(Crossings::of(solid.mesh(), &Budget::default()).unwrap().count, crossings);
                let sorted = |mesh: &TriMesh, corners: &[u32; 3]| {
                    let mut places = corners.map(|corner| mesh.vertices[corner as usize].to_array().map(f64::to_bits));
                    places.sort_unstable();
                    places
                };
                let there: Vec<_> = solid.mesh().triangles.iter().map(|corners| sorted(solid.mesh(), corners)).collect();
                assert!(mesh.triangles.iter().all(|corners| there.contains(&sorted(&mesh, corners))));
                closed += 1;
            }
            Err(RepairError::Hole { at, .. }) => assert!(mesh.vertices.contains(&at)),
            Err(RepairError::Open { .. }) => {
                // Some corner is passed twice.
                let halves: Vec<[u32; 2]> = mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
                let border = || halves.iter().filter(|[from, to]| !halves.contains(&[*to, *from]));
                assert!(border().any(|[from, _]| border().filter(|[other, _]| other == from).count() > 1), "{round}");
            }
            Err(other) => panic!("{round}: {other}"),
        }
    }
    assert!(closed >= 80, "{closed}");
}
