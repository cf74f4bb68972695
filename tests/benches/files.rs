//! Speed of the writers: STL and 3MF of two million triangles.
//!
//! `cargo bench --package lacuna-tests --bench files`

#![allow(clippy::unwrap_used, missing_docs)]

use std::f64::consts::TAU;
use std::hint::black_box;
use std::io::Cursor;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use lacuna_exchange::format::{Format, Metadata, write};
use lacuna_kernel::solid::TriMesh;

/// A torus of `steps` times `steps` quadrilaterals, in single-precision coordinates as results have them.
fn torus(steps: u32) -> TriMesh {
    let angle = |k: u32| TAU * f64::from(k) / f64::from(steps);
    let point = |i: u32, j: u32| {
        let (s, c) = angle(j).sin_cos();
        let ring = 30.0 + 10.0 * c;
        DVec3::new(ring * angle(i).cos(), ring * angle(i).sin(), 10.0 * s).as_vec3().as_dvec3()
    };
    let at = |i: u32, j: u32| (i % steps) * steps + j % steps;
    let cells = || (0..steps).flat_map(move |i| (0..steps).map(move |j| (i, j)));
    TriMesh {
        vertices: cells().map(|(i, j)| point(i, j)).collect(),
        triangles: cells()
            .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
            .collect(),
    }
}

fn files(criterion: &mut Criterion) {
    let mesh = torus(1000);
    let mut group = criterion.benchmark_group("write two million triangles");
    group.sample_size(10).throughput(Throughput::Elements(mesh.triangles.len() as u64));
    for (name, format) in [("stl", Format::Stl), ("3mf", Format::ThreeMf)] {
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let mut sink = Cursor::new(Vec::with_capacity(128 << 20));
                write(format, &mesh, &Metadata::default(), &mut sink).unwrap();
                black_box(sink.into_inner().len())
            });
        });
    }
    group.finish();
}

criterion_group!(benches, files);
criterion_main!(benches);
