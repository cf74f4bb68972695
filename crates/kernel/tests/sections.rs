//! A thousand sections of a large solid: how long they take, and that they make up its volume.
//!
//! `cargo test --release -p lacuna-kernel --test kernel sections:: -- --ignored --nocapture`

use std::f64::consts::TAU;
use std::time::Instant;

use glam::DVec3;
use lacuna_kernel::budget::Budget;
use lacuna_kernel::measure::mass::volume;
use lacuna_kernel::measure::section::{PlaneFrame, SectionError, sections};
use lacuna_kernel::solid::{Solid, TriMesh};

/// A torus of 2 n m triangles around z, 140 mm across, with waves on it.
fn torus(n: u32, m: u32) -> TriMesh {
    let mut mesh = TriMesh::default();
    for (i, j) in (0..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
        let (around, turn) = (TAU * f64::from(i) / f64::from(n), TAU * f64::from(j) / f64::from(m));
        let radius = 20.0 + (31.0 * around).sin() * (17.0 * turn).cos();
        let out = 50.0 + radius * turn.cos();
        mesh.vertices.push(DVec3::new(out * around.cos(), out * around.sin(), radius * turn.sin()));
        let corner = |i: u32, j: u32| i % n * m + j % m;
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

#[test]
#[ignore = "a measurement"]
fn a_thousand_sections_of_a_million_triangles() {
    let budget = Budget::default();
    let solid = Solid::new(torus(1000, 500), &budget).expect("a solid");
    for normal in [DVec3::Z, DVec3::X, DVec3::new(1.0, 2.0, 3.0)] {
        let frame = PlaneFrame::new(normal).expect("a direction");
        let [low, high] = frame.bounds(&solid.mesh().vertices).expect("points").map(|corner| corner.z);
        let step = (high - low) / 1000.0;
        let offsets: Vec<f64> = (0..1000).map(|index| low + (f64::from(index) + 0.5) * step).collect();
        let (mut points, mut loops, mut sum) = (0, 0, 0.0);
        let start = Instant::now();
        sections::<SectionError>(&solid, &frame, &offsets, &budget, &mut |section| {
            assert!(section.unmatched.is_empty());
            points += section.loops().map(<[_]>::len).sum::<usize>();
            loops += section.loops().count();
            sum += step * section.area_mm2();
            Ok(())
        })
        .expect("sections");
        let wall = start.elapsed();
        let off = sum / volume(solid.mesh()) - 1.0;
        println!("across {normal}: {points} points, {loops} loops, volume off by {off:.1e}; {:.3} s", wall.as_secs_f64());
        assert!(off.abs() < 1e-4);
    }
}
