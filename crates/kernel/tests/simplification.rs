//! Simplification within the promise, on random wires and surfaces: bounds sampled against brute force, topology, crossings, threads.

use glam::DVec3;
use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::attractor::cell::Site;
use lacuna_kernel::budget::Budget;
use lacuna_kernel::dilation::{Dilation, dilate, dilate_unsimplified};
use lacuna_kernel::model::{Interior, Model, PolygonMesh, Shape};
use lacuna_kernel::solid::{Crossings, TriMesh};
use lacuna_kernel::tolerance::{Radius, Tolerance};

/// A linear congruential generator (Knuth's MMIX constants).
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn point(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit())
    }
}

fn lowered(vertices: Vec<DVec3>, faces: Vec<Vec<u32>>) -> Attractor {
    let model = Model { name: None, shape: Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Surface }) };
    model.lower().expect("a valid model").attractor
}

/// Some segments and triangles in the unit cube, with their sites.
fn random_shape(random: &mut Random) -> (Attractor, Vec<Site>) {
    let (mut vertices, mut faces, mut sites) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..2 + (4.0 * random.unit()) as usize {
        let size = if random.unit() < 0.5 { 2 } else { 3 };
        let first = vertices.len() as u32;
        let corners: Vec<DVec3> = (0..size).map(|_| random.point()).collect();
        faces.push((first..first + size as u32).collect::<Vec<u32>>());
        let at = |k: usize| corners[k].to_array();
        sites.push(if size == 2 { Site::Segment([at(0), at(1)]) } else { Site::Triangle([at(0), at(1), at(2)]) });
        vertices.extend(corners);
    }
    (lowered(vertices, faces), sites)
}

fn distance(sites: &[Site], x: DVec3) -> f64 {
    sites.iter().map(|site| site.distance_squared(&x.to_array())).fold(f64::INFINITY, f64::min).sqrt()
}

/// How often the mesh turns around x: its solid angle over 4 pi (van Oosterom and Strackee, 1983).
fn winding(mesh: &TriMesh, x: DVec3) -> f64 {
    let angle = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|corner| mesh.vertices[corner as usize] - x);
        let (p, q, r) = (a.length(), b.length(), c.length());
        2.0 * a.dot(b.cross(c)).atan2(p * q * r + a.dot(b) * r + b.dot(c) * p + c.dot(a) * q)
    };
    mesh.triangles.iter().map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

fn check(random: &mut Random, dilation: &Dilation, sites: &[Site], radius: f64, tolerance: f64) {
    assert!(dilation.inner_mm <= tolerance && dilation.outer_mm <= tolerance);
    let mesh = dilation.solid.mesh();
    for corners in &mesh.triangles {
        let [a, b, c] = corners.map(|corner| mesh.vertices[corner as usize]);
        for weights in [DVec3::X, DVec3::ONE, DVec3::new(1.0, 1.0, 0.0), random.point(), random.point()] {
            let x = (a * weights.x + b * weights.y + c * weights.z) / (weights.x + weights.y + weights.z);
            let d = distance(sites, x);
            let (low, high) = (radius - dilation.inner_mm - 1e-9, radius + dilation.outer_mm + 1e-9);
            assert!(low <= d && d <= high, "{d} is not in {low} to {high}");
        }
    }
    // Points within r - inner are inside, those beyond r + outer outside.
    for _ in 0..30 {
        let x = random.point() * (1.0 + 4.0 * radius) - 2.0 * radius;
        let (d, turns) = (distance(sites, x), winding(mesh, x));
        if d < radius - dilation.inner_mm {
            assert!((turns - 1.0).abs() < 1e-6, "{turns} at {d}");
        } else if d > radius + dilation.outer_mm {
            assert!(turns.abs() < 1e-6, "{turns} at {d}");
        }
    }
}

#[test]
fn random_shapes_keep_bounds_topology_and_embedding() {
    let mut random = Random(7);
    let budget = Budget::default();
    for trial in 0..24 {
        let (attractor, sites) = random_shape(&mut random);
        let radius = 0.05 + 0.15 * random.unit();
        let tolerance = radius * [0.3, 0.1, 0.04][trial % 3];
        let (r, e) = (Radius::new(radius).expect("positive"), Tolerance::new(tolerance).expect("positive"));
        let dense = dilate_unsimplified(&attractor, r, e, &budget).expect("a solid");
        let sparse = dilate(&attractor, r, e, &budget).expect("a solid");
        let (before, after) = (dense.solid.topology(), sparse.solid.topology());
        assert_eq!((before.euler, before.shells, before.cavities), (after.euler, after.shells, after.cavities), "trial {trial}");
        assert!(after.triangles * 4 < before.triangles, "trial {trial}: {} of {}", after.triangles, before.triangles);
        assert_eq!(Crossings::of(sparse.solid.mesh(), &budget).expect("not stopped").count, 0, "trial {trial}");
        check(&mut random, &sparse, &sites, radius, tolerance);
    }
}

#[test]
fn threads_do_not_matter() {
    let mut random = Random(11);
    let (attractor, _) = random_shape(&mut random);
    let (r, e) = (Radius::new(0.05).expect("positive"), Tolerance::new(0.002).expect("positive"));
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| dilate(&attractor, r, e, &Budget::default()).expect("a solid").solid)
    };
    assert_eq!(run(1), run(2));
}

#[test]
fn flat_and_mildly_curved_surfaces_have_a_tenth_of_the_triangles() {
    let wave = |n: u32| {
        let at = |i: u32, j: u32| {
            let (x, y) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            DVec3::new(x, y, 0.1 * (3.0 * x).sin() * (2.0 * y).cos())
        };
        let vertices = (0..=n).flat_map(|j| (0..=n).map(move |i| at(i, j))).collect();
        let corner = |i: u32, j: u32| j * (n + 1) + i;
        let square = |i: u32, j: u32| {
            [vec![corner(i, j), corner(i + 1, j), corner(i + 1, j + 1)], vec![corner(i, j), corner(i + 1, j + 1), corner(i, j + 1)]]
        };
        lowered(vertices, (0..n).flat_map(|j| (0..n).flat_map(move |i| square(i, j))).collect())
    };
    let plate = lowered(vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y], vec![vec![0, 1, 2], vec![0, 2, 3]]);
    let wire = lowered(vec![DVec3::ZERO, DVec3::new(1.0, 0.3, 0.2)], vec![vec![0, 1]]);
    for (name, attractor, radius) in [("wire", wire, 0.05), ("plate", plate, 0.05), ("wave", wave(12), 0.05)] {
        let (r, e) = (Radius::new(radius).expect("positive"), Tolerance::new(0.03 * radius).expect("positive"));
        let dense = dilate_unsimplified(&attractor, r, e, &Budget::default()).expect("a solid");
        let sparse = dilate(&attractor, r, e, &Budget::default()).expect("a solid");
        let (before, after) = (dense.solid.mesh().triangles.len(), sparse.solid.mesh().triangles.len());
        eprintln!("{name}: {after} of {before}");
        assert!(after * 10 <= before, "{name}: {after} of {before}");
        assert_eq!(sparse.crossings, 0, "{name}");
    }
}
