//! 10^8 leaves handed over in pieces: what memory and time that takes.
//!
//! `cargo run --release --package lacuna-tests --example streaming`
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use glam::{DMat3, DVec3};
use lacuna_kernel::attractor::{RefineError, stream};
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_kernel::model::{AffineMap, Ifs, Model, Shape};
use lacuna_kernel::tolerance::Tolerance;

fn main() {
    // Ten homotheties of ratio 0.09: at a bound of 5e-6 mm addresses have about eight letters.
    let points = (0..10).map(|k| DVec3::new(f64::from(k), f64::from(k * k % 7), f64::from(k * 3 % 5)) * 10.0);
    let maps = points.map(|p| AffineMap { linear: DMat3::from_diagonal(DVec3::splat(0.09)), translation: p * 0.91 }).collect();
    let shape = Shape::Ifs(Ifs { maps, primitive: None, graph: None });
    let attractor = Model { name: None, shape }.lower().unwrap().attractor;
    let budget = Budget { limits: Limits { cells: 1 << 40, ..Limits::default() }, ..Budget::default() };
    let (mut count, mut sum) = (0_u64, DVec3::ZERO);
    let streamed = stream(&attractor, Tolerance::new(3e-7).unwrap(), &budget, &mut |piece| -> Result<(), RefineError> {
        count += piece.points.len() as u64;
        sum += piece.vertices.iter().sum::<DVec3>();
        Ok(())
    });
    println!("{:?}, {count} points about {}", streamed.unwrap(), sum / count as f64);
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    println!("{}", status.lines().find(|line| line.starts_with("VmHWM")).unwrap());
}
