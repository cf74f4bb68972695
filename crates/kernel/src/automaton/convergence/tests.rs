//! Radii that are known, and regions that must be decided.

use super::*;
use crate::automaton::{LeafPrimitive, State, SubdivisionOperator, Transition};

fn corner_cutting(a: f64, b: f64) -> Automaton {
    let operators = [vec![1.0 - a, a, 0.0, b, 1.0 - b, 0.0, 0.0, 1.0 - a, a], vec![b, 1.0 - b, 0.0, 0.0, 1.0 - a, a, 0.0, b, 1.0 - b]];
    let transitions = operators
        .into_iter()
        .enumerate()
        .map(|(label, columns)| {
            let (operator, _) = SubdivisionOperator::from_columns(3, columns).expect("sums to 1");
            Transition { to: StateId::new(0), operator, label }
        })
        .collect();
    let state = State {
        name: "curve".into(),
        kind: None,
        dimension: 3,
        transitions,
        boundaries: Vec::new(),
        leaf: LeafPrimitive::Centre,
        frame: false,
    };
    Automaton::new(vec![state]).expect("well formed")
}

#[test]
fn chaikin_contracts_by_a_half() {
    let result = contraction(&corner_cutting(0.25, 0.25));
    assert!((result.lower - 0.5).abs() < 1e-9, "{}", result.lower);
    assert!(result.upper < 0.52 && result.upper >= 0.5, "{}", result.upper);
}

/// ALGORITHMS: all eigenvalues are inside the unit disc, yet rho(L0 L0 L0 L1) = 2.227.
#[test]
fn the_counterexample_is_found_with_its_word() {
    let result = contraction(&corner_cutting(0.9, -0.85));
    assert!(result.lower > 1.22, "{}", result.lower);
    let word = &result.cycle.1;
    assert_eq!(word.len() % 4, 0);
    assert_eq!(word.iter().sum::<usize>(), word.len() / 4, "one 1 among four letters: {word:?}");
}

#[test]
fn every_point_of_gregorys_region_is_accepted() {
    for i in 1..20 {
        for j in 1..20 {
            let (a, b) = (f64::from(i) * 0.05, f64::from(j) * 0.05);
            if 1.0 - 2.0 * a - b > 1e-9 && 1.0 - a - 2.0 * b > 1e-9 {
                let result = contraction(&corner_cutting(a, b));
                assert!(result.upper < 1.0, "a {a}, b {b}: {}", result.upper);
            }
        }
    }
}
