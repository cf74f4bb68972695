//! What every engine must do, on solids whose combinations are known exactly. An engine's file adds one line to
//! [`engines`].

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use lacuna_kernel::budget::{CancelToken, StopReason};
use lacuna_kernel::error::Kind;
use lacuna_kernel::solid::TriMesh;

use crate::{BooleanEngine, BooleanError, Fault, ManifoldRust, Operand, Operation};

fn engines() -> Vec<Box<dyn BooleanEngine>> {
    vec![Box::new(ManifoldRust)]
}

fn combine(engine: &dyn BooleanEngine, operation: Operation, operands: &[&TriMesh]) -> TriMesh {
    let operands: Vec<Operand<'_>> = operands.iter().copied().map(Operand::from).collect();
    let result = engine.combine(operation, &operands, &CancelToken::new()).unwrap();
    assert_closed(&result);
    result
}

/// Box with corners `low` and `low + size`.
fn cuboid(low: [f64; 3], size: [f64; 3]) -> TriMesh {
    let corner = |k: usize| DVec3::from(low) + DVec3::from(size) * DVec3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64);
    let faces = [[0u32, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    TriMesh { vertices: (0..8).map(corner).collect(), triangles: faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect() }
}

fn cube(low: f64, size: f64) -> TriMesh {
    cuboid([low; 3], [size; 3])
}

/// Prism over a regular polygon of radius 1, along z, of height 4 about the origin.
fn cylinder(sides: u32, turn: DQuat) -> TriMesh {
    let ring = |z: f64| (0..sides).map(move |k| (TAU * f64::from(k) / f64::from(sides), z));
    let mut vertices: Vec<DVec3> = ring(-2.0).chain(ring(2.0)).map(|(angle, z)| turn * DVec3::new(angle.cos(), angle.sin(), z)).collect();
    vertices.extend([turn * DVec3::NEG_Z * 2.0, turn * DVec3::Z * 2.0]);
    let mut triangles = Vec::new();
    for k in 0..sides {
        let next = (k + 1) % sides;
        triangles.extend([[k, next, sides + next], [k, sides + next, sides + k], [2 * sides, next, k]]);
        triangles.push([2 * sides + 1, sides + k, sides + next]);
    }
    TriMesh { vertices, triangles }
}

/// Unit ball by meridians and parallels.
fn ball(centre: DVec3, steps: u32) -> TriMesh {
    let (columns, rows) = (2 * steps, steps);
    let mut vertices = vec![centre + DVec3::Z, centre - DVec3::Z];
    for row in 1..rows {
        let (down, out) = (PI * f64::from(row) / f64::from(rows)).sin_cos();
        for column in 0..columns {
            let (s, c) = (TAU * f64::from(column) / f64::from(columns)).sin_cos();
            vertices.push(centre + DVec3::new(down * c, down * s, out));
        }
    }
    let at = |row: u32, column: u32| 2 + (row - 1) * columns + column % columns;
    let mut triangles = Vec::new();
    for column in 0..columns {
        triangles.extend([[0, at(1, column), at(1, column + 1)], [1, at(rows - 1, column + 1), at(rows - 1, column)]]);
        for row in 1..rows - 1 {
            let (a, b, c, d) = (at(row, column), at(row + 1, column), at(row + 1, column + 1), at(row, column + 1));
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    TriMesh { vertices, triangles }
}

fn volume(mesh: &TriMesh) -> f64 {
    let corner = |index: u32| mesh.vertices[index as usize];
    mesh.triangles.iter().map(|&[a, b, c]| corner(a).dot(corner(b).cross(corner(c))) / 6.0).sum()
}

fn assert_closed(mesh: &TriMesh) {
    let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
    for &[a, b, c] in &mesh.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *edges.entry((from, to)).or_default() += 1;
        }
    }
    for (&(from, to), &count) in &edges {
        assert_eq!((count, edges.get(&(to, from))), (1, Some(&1)), "edge {from} {to}");
    }
}

/// (signed volume) of each connected surface, ascending.
fn shell_volumes(mesh: &TriMesh) -> Vec<f64> {
    let mut parent: Vec<usize> = (0..mesh.vertices.len()).collect();
    fn root(parent: &mut [usize], mut k: usize) -> usize {
        while parent[k] != k {
            parent[k] = parent[parent[k]];
            k = parent[k];
        }
        k
    }
    for &[a, b, c] in &mesh.triangles {
        for (from, to) in [(a, b), (b, c)] {
            let (from, to) = (root(&mut parent, from as usize), root(&mut parent, to as usize));
            parent[from] = to;
        }
    }
    let mut volumes: HashMap<usize, f64> = HashMap::new();
    for &[a, b, c] in &mesh.triangles {
        let [p, q, r] = [a, b, c].map(|k| mesh.vertices[k as usize]);
        *volumes.entry(root(&mut parent, a as usize)).or_default() += p.dot(q.cross(r)) / 6.0;
    }
    let mut volumes: Vec<f64> = volumes.into_values().collect();
    volumes.sort_by(f64::total_cmp);
    volumes
}

fn euler(mesh: &TriMesh) -> i64 {
    let count = mesh.triangles.len() as i64;
    mesh.vertices.len() as i64 - 3 * count / 2 + count
}

#[track_caller]
fn assert_near(got: f64, exact: f64, allowed: f64) {
    assert!((got - exact).abs() <= allowed, "{got} is not within {allowed} of {exact}");
}

/// Rounding of coordinates near 1.
const ROUNDING: f64 = 1e-12;

#[test]
fn cubes_that_overlap_in_a_corner() {
    for engine in engines() {
        let (a, b) = (cube(0.0, 1.0), cube(0.5, 1.0));
        assert_near(volume(&combine(&*engine, Operation::Intersection, &[&a, &b])), 0.125, ROUNDING);
        assert_near(volume(&combine(&*engine, Operation::Union, &[&a, &b])), 1.875, ROUNDING);
        assert_near(volume(&combine(&*engine, Operation::Difference, &[&a, &b])), 0.875, ROUNDING);
    }
}

#[test]
fn equal_cubes() {
    for engine in engines() {
        let (a, b) = (cube(0.0, 1.0), cube(0.0, 1.0));
        assert_near(volume(&combine(&*engine, Operation::Intersection, &[&a, &b])), 1.0, ROUNDING);
        assert_near(volume(&combine(&*engine, Operation::Union, &[&a, &b])), 1.0, ROUNDING);
        assert!(combine(&*engine, Operation::Difference, &[&a, &b]).triangles.is_empty());
    }
}

#[test]
fn cubes_that_share_a_face_an_edge_or_a_corner() {
    for engine in engines() {
        let a = cube(0.0, 1.0);
        for low in [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 1.0]] {
            let b = cuboid(low, [1.0; 3]);
            assert!(combine(&*engine, Operation::Intersection, &[&a, &b]).triangles.is_empty());
            assert_near(volume(&combine(&*engine, Operation::Union, &[&a, &b])), 2.0, ROUNDING);
            assert_near(volume(&combine(&*engine, Operation::Difference, &[&a, &b])), 1.0, ROUNDING);
        }
    }
}

#[test]
fn a_cube_with_a_cubic_void() {
    for engine in engines() {
        let hollow = combine(&*engine, Operation::Difference, &[&cube(0.0, 1.0), &cube(0.25, 0.5)]);
        let shells = shell_volumes(&hollow);
        assert_eq!((shells.len(), euler(&hollow)), (2, 4));
        assert_near(shells[0], -0.125, ROUNDING);
        assert_near(shells[1], 1.0, ROUNDING);
        // A hollow solid is an operand too.
        assert_near(volume(&combine(&*engine, Operation::Union, &[&hollow, &cube(0.25, 0.5)])), 1.0, ROUNDING);
    }
}

#[test]
fn cylinders_at_right_angles() {
    let sides = 256;
    let quarter = PI / 2.0;
    let (z, x, y) = (DQuat::IDENTITY, DQuat::from_rotation_y(quarter), DQuat::from_rotation_x(quarter));
    // Inscribed polygons leave the circle by their sagitta; the surface of two cylinders' meeting is 16, that of three
    // is 24 (2 - sqrt 2).
    let sagitta = 1.0 - (PI / f64::from(sides)).cos();
    for engine in engines() {
        let [a, b, c] = [z, x, y].map(|turn| cylinder(sides, turn));
        let two = volume(&combine(&*engine, Operation::Intersection, &[&a, &b]));
        assert!(two < 16.0 / 3.0, "the polygons are inscribed");
        assert_near(two, 16.0 / 3.0, 16.0 * sagitta);
        let three = volume(&combine(&*engine, Operation::Intersection, &[&a, &b, &c]));
        assert_near(three, 4.6862915010, 24.0 * (2.0 - 2f64.sqrt()) * sagitta);
    }
}

#[test]
fn balls_one_radius_apart() {
    let steps = 64;
    for engine in engines() {
        let (a, b) = (ball(DVec3::ZERO, steps), ball(DVec3::X, steps));
        // Inscribed as well: along meridians and parallels the faces leave the ball by at most twice the sagitta. Two
        // caps of height 1/2 have a surface of 2 pi.
        let sagitta = 2.0 * (1.0 - (PI / f64::from(2 * steps)).cos());
        assert_near(volume(&combine(&*engine, Operation::Intersection, &[&a, &b])), 5.0 * PI / 12.0, TAU * sagitta);
    }
}

#[test]
fn inclusion_and_exclusion() {
    for engine in engines() {
        for turn in 0..6 {
            let moved = |mesh: TriMesh, angle: f64| TriMesh {
                vertices: mesh.vertices.iter().map(|p| DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), angle) * *p).collect(),
                triangles: mesh.triangles,
            };
            let (a, b) = (cuboid([-1.0; 3], [2.0; 3]), moved(cuboid([-1.3, -0.9, -1.1], [2.5, 1.9, 2.1]), f64::from(turn) * 0.7));
            let of = |operation| volume(&combine(&*engine, operation, &[&a, &b]));
            let (union, common, left) = (of(Operation::Union), of(Operation::Intersection), of(Operation::Difference));
            assert_near(union + common, volume(&a) + volume(&b), 1e-11);
            assert_near(left + common, volume(&a), 1e-11);
        }
    }
}

#[test]
fn many_operands_at_once() {
    for engine in engines() {
        let cubes: Vec<TriMesh> = (0..64).map(|k| cuboid([f64::from(k % 4), f64::from(k / 4 % 4), f64::from(k / 16)], [1.0; 3])).collect();
        let all: Vec<&TriMesh> = cubes.iter().collect();
        let block = combine(&*engine, Operation::Union, &all);
        assert_near(volume(&block), 64.0, 64.0 * ROUNDING);
        assert_eq!((shell_volumes(&block).len(), euler(&block)), (1, 2));
        let shaved = engine.difference(&cuboid([0.0; 3], [4.0; 3]), &all[1..], &CancelToken::new()).unwrap();
        assert_near(volume(&shaved), 1.0, 64.0 * ROUNDING);
    }
}

#[test]
fn nothing_is_a_solid_too() {
    for engine in engines() {
        let (some, none) = (cube(0.0, 1.0), TriMesh::default());
        assert_near(volume(&combine(&*engine, Operation::Union, &[&some, &none])), 1.0, ROUNDING);
        assert_near(volume(&combine(&*engine, Operation::Difference, &[&some, &none])), 1.0, ROUNDING);
        assert!(combine(&*engine, Operation::Intersection, &[&some, &none]).triangles.is_empty());
        assert!(combine(&*engine, Operation::Union, &[]).triangles.is_empty());
        let refused = engine.intersection(&[], &CancelToken::new()).unwrap_err();
        assert_eq!((refused.kind(), refused.code()), (Kind::Invalid, "boolean.no-operand"));
    }
}

#[test]
fn operands_that_are_no_solids_are_named() {
    let sound = cube(0.0, 1.0);
    let spoilt = |spoil: &dyn Fn(&mut TriMesh)| {
        let mut mesh = cube(0.0, 1.0);
        spoil(&mut mesh);
        mesh
    };
    let mut crossing = cube(0.0, 1.0);
    crossing.vertices.extend(cube(0.5, 1.0).vertices);
    crossing.triangles.extend(cube(0.5, 1.0).triangles.iter().map(|t| t.map(|k| k + 8)));
    let cases: [(TriMesh, &str); 6] = [
        (spoilt(&|m| m.triangles.truncate(11)), "boolean.not-closed"),
        (spoilt(&|m| m.triangles[0].swap(0, 1)), "boolean.not-closed"),
        (spoilt(&|m| m.triangles.iter_mut().for_each(|t| t.swap(0, 1))), "boolean.inside-out"),
        (spoilt(&|m| m.vertices[3].y = f64::NAN), "boolean.not-finite"),
        (spoilt(&|m| m.triangles[5][1] = 8), "boolean.index"),
        (crossing, "boolean.self-intersecting"),
    ];
    for engine in engines() {
        for (bad, code) in &cases {
            let refused = engine.union(&[&sound, bad], &CancelToken::new()).unwrap_err();
            assert_eq!((refused.kind(), refused.code()), (Kind::Invalid, *code));
            assert!(matches!(refused, BooleanError::NotASolid { operand: 1, .. }), "{refused}");
        }
        let refused = engine.union(&[&cases[0].0], &CancelToken::new()).unwrap_err();
        assert!(matches!(refused, BooleanError::NotASolid { operand: 0, fault: Fault::NotClosed { .. } }), "{refused}");
    }
}

/// Operands that are checked while others are combined already.
#[test]
fn large_operands_that_are_no_solids() {
    let sound = ball(DVec3::ZERO, 64);
    let mut crossing = sound.clone();
    crossing.append(&ball(DVec3::X, 64));
    let mut open = sound.clone();
    open.triangles.pop();
    for engine in engines() {
        for (bad, code) in [(&crossing, "boolean.self-intersecting"), (&open, "boolean.not-closed")] {
            let refused = engine.union(&[&sound, bad], &CancelToken::new()).unwrap_err();
            assert_eq!((refused.kind(), refused.code()), (Kind::Invalid, code));
        }
        // Two balls that touch in a point, as one operand: it meets itself, and overlaps nowhere.
        let mut touching = sound.clone();
        touching.append(&ball(DVec3::Z * 2.0, 64));
        let both = combine(&*engine, Operation::Union, &[&touching, &ball(DVec3::X * 5.0, 64)]);
        assert_near(volume(&both), 3.0 * volume(&sound), 1e-9);
        // What is proven gives the same, to the last bit.
        let proven = |mesh| Operand { mesh, is_proven: true };
        let (one, other) = (&sound, &ball(DVec3::X, 64));
        let made = engine.combine(Operation::Union, &[proven(one), proven(other)], &CancelToken::new()).unwrap();
        assert_eq!(made, combine(&*engine, Operation::Union, &[one, other]));
    }
}

#[test]
fn a_fired_token_stops() {
    for engine in engines() {
        for (reason, kind) in [(StopReason::Cancelled, Kind::Cancelled), (StopReason::Deadline, Kind::Limit)] {
            let cancel = CancelToken::new();
            cancel.fire(reason);
            assert_eq!(engine.union(&[&cube(0.0, 1.0)], &cancel).unwrap_err().kind(), kind);
        }
        // While it works: balls large enough to take longer than the pause.
        let cancel = CancelToken::new();
        let balls: Vec<TriMesh> = (0..12).map(|k| ball(DVec3::X * 0.1 * f64::from(k), 128)).collect();
        let all: Vec<&TriMesh> = balls.iter().collect();
        let stopped = std::thread::scope(|scope| {
            let work = scope.spawn(|| engine.union(&all, &cancel));
            std::thread::sleep(std::time::Duration::from_millis(20));
            cancel.fire(StopReason::Cancelled);
            work.join().unwrap()
        });
        assert_eq!(stopped.unwrap_err().kind(), Kind::Cancelled);
    }
}

#[test]
fn the_same_operands_give_the_same_bytes() {
    for engine in engines() {
        let balls: Vec<TriMesh> = (0..5).map(|k| ball(DVec3::X * 0.7 * f64::from(k), 24)).collect();
        let all: Vec<&TriMesh> = balls.iter().collect();
        let first = combine(&*engine, Operation::Union, &all);
        assert!(!first.triangles.is_empty());
        assert_eq!(first, combine(&*engine, Operation::Union, &all));
    }
}
