//! What the door costs beside calling Manifold directly: a measurement that prints its figures.
//!
//! Compared is one union of two tori, each a closed mesh in memory, in the same process and on the same threads: `ManifoldRust::combine`, which takes meshes of double
//! precision and gives one, against import into Manifold, `union`, and export, in double precision as well, without merging or cleaning before or after. Both convert the meshes to Manifold's and
//! back, so that costs neither of them more. Operands said to be proven are not checked; others are, meanwhile, on other threads. What follows in a job is no part of it: the check
//! of the result as a solid, its certificate, files. Of 15 runs each the least counts, by the clock and by what all threads computed; the result is only held to have as many triangles.
//!
//! `cargo test --release -p lacuna-boolean --test overhead -- --ignored --nocapture`

#![allow(clippy::print_stdout, clippy::unwrap_used)]

use std::time::{Duration, Instant};

use glam::DVec3;
use lacuna_boolean::{BooleanEngine, ManifoldRust, Operand, Operation};
use lacuna_kernel::budget::CancelToken;
use lacuna_kernel::solid::TriMesh;
use manifold_rust::manifold::Manifold;
use manifold_rust::types::MeshGLP;

/// A wavy torus of `steps` times `steps` quadrilaterals around an axis of z through a point.
fn torus(steps: u32, at: DVec3) -> TriMesh {
    let angle = |k: u32| std::f64::consts::TAU * f64::from(k) / f64::from(steps);
    let point = |i: u32, j: u32| {
        let (s, c) = angle(j).sin_cos();
        let ring = 30.0 + (10.0 + (7.0 * angle(i)).sin()) * c;
        at + DVec3::new(ring * angle(i).cos(), ring * angle(i).sin(), 10.0 * s)
    };
    let number = |i: u32, j: u32| (i % steps) * steps + j % steps;
    let cells = || (0..steps).flat_map(move |i| (0..steps).map(move |j| (i, j)));
    let halves = |(i, j)| [[number(i, j), number(i + 1, j), number(i + 1, j + 1)], [number(i, j), number(i + 1, j + 1), number(i, j + 1)]];
    TriMesh { vertices: cells().map(|(i, j)| point(i, j)).collect(), triangles: cells().flat_map(halves).collect() }
}

/// The same union without the door: import, union, export.
fn directly(one: &TriMesh, other: &TriMesh) -> usize {
    let import = |mesh: &TriMesh| {
        Manifold::from_mesh_glp(&MeshGLP::<f64, u32> {
            num_prop: 3,
            vert_properties: mesh.vertices.iter().flat_map(|p| p.to_array()).collect(),
            tri_verts: mesh.triangles.as_flattened().to_vec(),
            ..MeshGLP::default()
        })
    };
    import(one).union(&import(other)).get_mesh_glp::<f64, u32>(-1).tri_verts.len() / 3
}

/// What all threads of this process have computed, whatever else the machine does.
fn computed() -> Duration {
    let tasks = std::fs::read_dir("/proc/self/task").unwrap();
    let spent =
        |task: std::fs::DirEntry| std::fs::read_to_string(task.path().join("schedstat")).ok()?.split(' ').next()?.parse::<u64>().ok();
    Duration::from_nanos(tasks.filter_map(|task| spent(task.ok()?)).sum())
}

/// The least of some runs, by the clock and by the processors: what others do at the same time only adds.
fn least(mut work: impl FnMut() -> usize) -> ([Duration; 2], usize) {
    let (mut best, mut triangles) = ([Duration::MAX; 2], 0);
    for _ in 0..15 {
        let (start, before) = (Instant::now(), computed());
        triangles = work();
        best = [best[0].min(start.elapsed()), best[1].min(computed() - before)];
    }
    (best, triangles)
}

#[test]
#[ignore = "a measurement"]
fn the_door_beside_manifold() {
    for steps in [10, 30, 100, 300] {
        let (one, other) = (torus(steps, DVec3::ZERO), torus(steps, DVec3::new(13.0, 7.0, 3.0)));
        let (direct, expected) = least(|| directly(&one, &other));
        println!(
            "{} + {} triangles to {expected}: directly {:?}, computing {:?}",
            one.triangles.len(),
            other.triangles.len(),
            direct[0],
            direct[1]
        );
        for (is_proven, what) in [(true, "proven operands"), (false, "operands that are checked")] {
            let operands = [&one, &other].map(|mesh| Operand { mesh, is_proven });
            let through = || ManifoldRust.combine(Operation::Union, &operands, &CancelToken::new()).unwrap().triangles.len();
            let (door, triangles) = least(through);
            assert_eq!(triangles, expected);
            let [clock, processors] = [0, 1].map(|k| 100.0 * (door[k].as_secs_f64() / direct[k].as_secs_f64() - 1.0));
            println!("    {what}: {:?}, {clock:+.1} %, computing {:?}, {processors:+.1} %", door[0], door[1]);
        }
    }
}
