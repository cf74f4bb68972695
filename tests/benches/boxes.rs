//! The box of every model among the fixtures: how long the search takes, and how wide its widest interval is.
//!
//! `cargo run --release --package lacuna-tests --example boxes [part of the cases' names]`
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use lacuna_exchange::document::{DocumentLimits, read_model};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::measure::bounding_box;
use lacuna_tests::support::cases;
use std::time::{Duration, Instant};

/// Searches of each box: the shortest time counts, as what else the machine does only adds to it.
const SEARCHES: usize = 5;

fn main() {
    println!("| case | ms | widest interval, mm | of the largest coordinate |\n|---|---|---|---|");
    let part = std::env::args().nth(1).unwrap_or_default();
    for case in cases::all().into_iter().filter(|case| case.name.contains(&part)) {
        let Ok(text) = std::fs::read(case.model()) else { continue };
        let Ok(model) = read_model(&text, &DocumentLimits::default()) else { continue };
        if model.lower().is_err() {
            continue;
        }
        let mut shortest = Duration::MAX;
        let mut width = 0.0;
        let mut extent = 0.0;
        for _ in 0..SEARCHES {
            // Anew: an attractor keeps what it worked out for the first box.
            let lowered = model.lower().unwrap();
            let start = Instant::now();
            let found = bounding_box(&lowered.attractor, &Budget::default()).unwrap();
            shortest = shortest.min(start.elapsed());
            width = found.low.iter().chain(&found.high).map(|end| end.high - end.low).fold(0.0, f64::max);
            extent = found.extent();
        }
        println!(
            "| {} | {:.3} | {width:.1e} | {:.1e} |",
            case.name,
            shortest.as_secs_f64() * 1e3,
            width / f64::max(extent, f64::MIN_POSITIVE)
        );
    }
}
