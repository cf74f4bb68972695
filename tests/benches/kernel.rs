//! Speed of the kernel: dilation of the Sierpinski tetrahedron and of prisms, evaluation of millions of leaves, also beside the same
//! loop by hand, and proofs of convergence.
//!
//! `cargo bench --package lacuna-tests --bench kernel`

#![allow(clippy::unwrap_used, missing_docs)]

#[path = "../../crates/kernel/tests/automata/mod.rs"]
mod automata;
mod shapes;
mod unrolled;

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::{DMat3, DVec3};
use lacuna_fabrication::{Input, Job, JobKind, Outcome, Params, run};
use lacuna_kernel::attractor::count_cells;
use lacuna_kernel::automaton::convergence::contraction;
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_kernel::model::{AffineMap, Ifs, Interior, Model, PolygonMesh, Shape};
use lacuna_kernel::tolerance::Tolerance;

/// Homotheties of a ratio towards points.
fn towards(ratio: f64, points: &[DVec3]) -> Shape {
    let linear = DMat3::from_diagonal(DVec3::splat(ratio));
    let maps = points.iter().map(|p| AffineMap { linear, translation: *p * (1.0 - ratio) }).collect();
    Shape::Ifs(Ifs { maps, primitive: None, graph: None })
}

fn tetrahedron() -> Shape {
    let depth = 50.0 * 3f64.sqrt();
    let apex = DVec3::new(50.0, depth / 3.0, 100.0 * (2.0 / 3.0f64).sqrt());
    towards(0.5, &[DVec3::ZERO, DVec3::X * 100.0, DVec3::new(50.0, depth, 0.0), apex])
}

fn job(shape: Shape, kind: JobKind, tolerance_mm: f64, radius_mm: Option<f64>) -> Job {
    Job {
        kind,
        inputs: vec![Input { name: "shape".into(), model: Model { name: None, shape }, radius_mm: None }],
        params: Params { radius_mm, ..Params::new(tolerance_mm) },
        outputs: Vec::new(),
        limits: Limits { memory_bytes: 16 << 30, ..Limits::default() },
    }
}

fn done(job: &Job) -> Outcome {
    run(job, &Budget { limits: job.limits, ..Budget::default() }).unwrap()
}

fn dilation(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("solidify the Sierpinski tetrahedron of 100 mm");
    group.sample_size(10).measurement_time(Duration::from_secs(20));
    for (radius, tolerance) in [(8.0, 1.0), (2.0, 0.33)] {
        let job = job(tetrahedron(), JobKind::Solidify, tolerance, Some(radius));
        group.throughput(Throughput::Elements(done(&job).certificate.triangles));
        group.bench_with_input(BenchmarkId::from_parameter(radius), &job, |bencher, job| bencher.iter(|| black_box(done(job))));
    }
    group.finish();
}

/// An upright prism on a regular polygon with circumradius 20 mm, 20 mm high: few corners or many, faces as fans of needles.
fn prism(sides: u32) -> Shape {
    let rim = (0..sides).map(|k| (std::f64::consts::TAU * f64::from(k) / f64::from(sides)).sin_cos());
    let ring: Vec<DVec3> = rim.map(|(sine, cosine)| 20.0 * DVec3::new(cosine, sine, 0.0)).collect();
    let vertices = ring.iter().copied().chain(ring.iter().map(|corner| *corner + 20.0 * DVec3::Z)).collect();
    let mut faces = Vec::new();
    for (k, next) in (0..sides).map(|k| (k, (k + 1) % sides)) {
        faces.extend([vec![k, next, sides + next], vec![k, sides + next, sides + k]]);
        if (1..sides - 1).contains(&k) {
            faces.extend([vec![0, k + 1, k], vec![sides, sides + k, sides + k + 1]]);
        }
    }
    Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Solid })
}

fn solids(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("solidify a prism of 40 mm by 1 mm within 0.1 mm");
    group.sample_size(10).measurement_time(Duration::from_secs(10));
    for sides in [4, 64, 1_000] {
        let job = job(prism(sides), JobKind::Solidify, 0.1, Some(1.0));
        group.bench_with_input(BenchmarkId::from_parameter(sides), &job, |bencher, job| bencher.iter(|| black_box(done(job))));
    }
    group.finish();
}

fn evaluation(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("evaluate ten maps to ten million leaves");
    group.sample_size(10).measurement_time(Duration::from_secs(20));
    // Ratio 0.09: at a bound of 1e-4 mm an address has about six letters.
    let points: Vec<DVec3> = (0..10).map(|k| DVec3::new(f64::from(k), f64::from(k * k % 7), f64::from(k * 3 % 5)) * 10.0).collect();
    let job = job(towards(0.09, &points), JobKind::Evaluate, 5e-5, None);
    group.throughput(Throughput::Elements(done(&job).certificate.leaf_cells));
    group.bench_function("points", |bencher| bencher.iter(|| black_box(done(&job))));
    group.finish();
}

/// On one thread: both sides of the comparison are the work of one core.
fn leaves(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("leaf cells of one state, by its dimension");
    group.sample_size(10).measurement_time(Duration::from_secs(10));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for pair in shapes::pairs() {
        let tolerance = Tolerance::new(pair.tolerance).unwrap();
        let count = || one.install(|| count_cells(&pair.attractor, tolerance, &Budget::default()).unwrap());
        assert_eq!(count(), (pair.by_hand)(pair.tolerance), "{}: the same leaves", pair.name);
        group.throughput(Throughput::Elements(count()));
        group.bench_function(format!("{}, kernel", pair.name), |bencher| bencher.iter(|| black_box(count())));
        group.bench_function(format!("{}, by hand", pair.name), |bencher| bencher.iter(|| black_box((pair.by_hand)(pair.tolerance))));
    }
    group.finish();
}

fn convergence(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("bounds of the joint spectral radius");
    group.sample_size(10);
    let mut numbers = automata::Numbers(5);
    let mut signed = |maps: usize, scale: f64| automata::iterated((0..maps).map(|_| numbers.signed(16, scale)).collect());
    let line = [vec![vec![1.0, 0.0], vec![0.2, 0.8]], vec![vec![0.2, 0.8], vec![0.0, 1.0]]];
    let automata = [
        ("bicubic face", automata::iterated(automata::tensor(&automata::cubic(), &automata::cubic()))),
        ("fractal times spline", automata::iterated(automata::tensor(&line, &automata::cubic()))),
        ("Catmull-Clark face, valence 5", automata::catmull_clark(5)),
        ("Catmull-Clark face, valence 12", automata::catmull_clark(12)),
        ("bicubic NURBS, 64 states", automata::nurbs([1.0, 2.0, 1.0, 3.0, 0.5])),
        ("random, 50 states", automata::fifty_states(1)),
        ("random signed, 4 maps", signed(4, 0.7)),
        ("random signed, 8 maps", signed(8, 0.7)),
        ("corner cutting that diverges", automata::iterated(automata::corner_cutting(0.9, -0.85))),
    ];
    for (name, automaton) in &automata {
        group.bench_function(*name, |bencher| bencher.iter(|| black_box(contraction(automaton))));
    }
    group.finish();
}

criterion_group!(benches, dilation, solids, evaluation, leaves, convergence);
criterion_main!(benches);
