#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]
#[path = "../tests/automata/mod.rs"]
mod automata;
use automata::*;
use lacuna_kernel::automaton::convergence::contraction;
fn main() {
    let mut n = Numbers(5);
    let mut list: Vec<(String, lacuna_kernel::automaton::Automaton)> = vec![
        ("bicubic".into(), iterated(tensor(&cubic(), &cubic()))),
        (
            "fractal x spline".into(),
            iterated(tensor(&[vec![vec![1.0, 0.0], vec![0.2, 0.8]], vec![vec![0.2, 0.8], vec![0.0, 1.0]]], &cubic())),
        ),
        ("50 states".into(), fifty_states(1)),
        ("nurbs 64".into(), nurbs([1.0, 2.0, 1.0, 3.0, 0.5])),
        ("nurbs uneven".into(), nurbs([1e-3, 1.0, 1.0, 1e3, 1.0])),
        ("nonneg 32".into(), iterated((0..4).map(|_| n.stochastic(32, 32, 6)).collect())),
        ("gregory edge".into(), iterated(corner_cutting(0.499998, 1e-6))),
        ("cut div".into(), iterated(corner_cutting(0.9, -0.85))),
    ];
    for v in [3, 5, 8, 12] {
        list.push((format!("catmull-clark {v}"), catmull_clark(v)));
    }
    for s in [0.5, 0.7, 0.8, 0.9, 1.0] {
        list.push((format!("signed 16 x4, {s}"), iterated((0..4).map(|_| n.signed(16, s)).collect())));
    }
    for s in [0.5, 0.7, 0.8, 0.9] {
        list.push((format!("signed 16 x8, {s}"), iterated((0..8).map(|_| n.signed(16, s)).collect())));
    }
    for s in [0.61, 0.615, 0.617, 0.618] {
        list.push((format!("golden {s}"), iterated(vec![extended(&[&[s, s], &[0.0, s]]), extended(&[&[s, 0.0], &[s, s]])])));
    }
    for (name, a) in &list {
        let mut best = f64::INFINITY;
        let mut f = None;
        for _ in 0..3 {
            let t = std::time::Instant::now();
            let r = contraction(a);
            best = best.min(t.elapsed().as_secs_f64());
            f = Some(r);
        }
        let f = f.unwrap();
        println!(
            "{name:24} {:8.2} ms  [{:.6}, {:.6}] depth {} word {:?}",
            best * 1e3,
            f.lower,
            f.upper,
            f.depth,
            &f.cycle.1[..f.cycle.1.len().min(8)]
        );
    }
}
