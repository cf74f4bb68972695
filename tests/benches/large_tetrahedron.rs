//! The Sierpinski tetrahedron of 100 mm, dilated by 0.4 mm: time and memory of one large job.
//!
//! `cargo bench-large [tolerance in mm, 0.05 when absent]`. Too large for a bench that repeats itself. The Euler
//! number is known: 1365 open voids of six generations, each with three handles, make 2 - 2 * 4095 = -8188;
//! the windows of the smallest close at 0.451 mm, so the tolerance must be below 0.051 mm.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::fs;
use std::time::Instant;

use glam::{DMat3, DVec3};
use lacuna_fabrication::{Input, Job, JobKind, Params, run};
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_kernel::model::{AffineMap, Ifs, Model, Shape};

const EULER: i64 = -8188;

fn main() {
    let tolerance_mm = std::env::args().nth(1).map_or(0.05, |text| text.parse().unwrap());
    let depth = 50.0 * 3f64.sqrt();
    let points =
        [DVec3::ZERO, DVec3::X * 100.0, DVec3::new(50.0, depth, 0.0), DVec3::new(50.0, depth / 3.0, 100.0 * (2.0 / 3.0f64).sqrt())];
    let linear = DMat3::from_diagonal(DVec3::splat(0.5));
    let maps = points.map(|p| AffineMap { linear, translation: p * 0.5 }).to_vec();
    let limits = Limits { triangles: 100_000_000, memory_bytes: 16 << 30, ..Limits::default() };
    let job = Job {
        kind: JobKind::Solidify,
        inputs: vec![Input {
            name: "shape".into(),
            model: Model { name: None, shape: Shape::Ifs(Ifs { maps, primitive: None, graph: None }) },
            radius_mm: None,
        }],
        params: Params { radius_mm: Some(0.4), ..Params::new(tolerance_mm) },
        outputs: Vec::new(),
        limits,
    };
    let start = Instant::now();
    let certificate = run(&job, &Budget { limits, ..Budget::default() }).unwrap().certificate;
    let seconds = start.elapsed().as_secs_f64();
    println!("triangles  {}", certificate.triangles);
    println!("leaf cells {}", certificate.leaf_cells);
    println!("bound      {:.4} mm of {tolerance_mm} mm", certificate.achieved_bound_mm);
    println!("euler      {:?}, exact {EULER}", certificate.euler);
    println!("wall time  {seconds:.2} s");
    println!("CPU time   {:.2} s", cpu_seconds());
    println!("peak       {}", peak_memory());
    assert_eq!(certificate.euler, Some(EULER), "the topology is wrong");
}

/// User and system time of the process; fields 14 and 15 of its `stat`, in hundredths of a second on Linux.
fn cpu_seconds() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The name, field 2, may hold spaces; after its parenthesis comes field 3.
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    let ticks = |field: usize| fields.get(field - 3).and_then(|text| text.parse::<f64>().ok()).unwrap_or(f64::NAN);
    (ticks(14) + ticks(15)) / 100.0
}

fn peak_memory() -> String {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.map_or_else(|| "unknown".to_owned(), |text| text.trim().to_owned())
}
