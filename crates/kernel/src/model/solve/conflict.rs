//! Smallest reasons for a contradiction.

use super::SolveError;
use super::linear::Support;
use super::propagate::Knowledge;
use super::system::System;
use crate::budget::CancelToken;

/// The error that names the constraints of a smallest reason.
pub(super) fn contradiction(system: &System, start: &Support, cancel: &CancelToken) -> Result<SolveError, SolveError> {
    let set = irreducible(system, start, cancel)?;
    Ok(SolveError::Contradiction { constraints: set.into_iter().map(|index| system.constraints[index].named.clone()).collect() })
}

/// An irreducible contradictory subset of constraints that are contradictory together: the deletion filter of
/// Chinneck and Dravnieks ("Locating minimal infeasible constraint sets in linear programs", ORSA J. Computing 3(2),
/// 1991). What is contradictory without a constraint replaces the set, so members that do not matter leave in
/// numbers.
fn irreducible(system: &System, start: &Support, cancel: &CancelToken) -> Result<Vec<usize>, SolveError> {
    let mut set = start.members();
    let mut position = 0;
    while position < set.len() {
        let mut without = set.clone();
        let tried = without.remove(position);
        match Knowledge::of(system, &without, cancel)? {
            // The rest holds together without it, so it is needed.
            Ok(_) => position += 1,
            Err(support) => {
                set = support.members();
                // Members before `tried` are needed by every contradictory subset, so they are in this one too.
                position = set.iter().filter(|&&index| index < tried).count();
            }
        }
    }
    Ok(set)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::solve::read::read;
    use crate::model::{Adjacency, Bcifs, BcifsState, BoundarySpec, CellKind, Entry, Incidence, Matrix, TransitionSpec};
    use std::collections::BTreeMap;

    fn next(bits: &mut u64) -> u64 {
        *bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        *bits >> 33
    }

    /// A curve of four points with vertices of two, all operators unknown.
    fn curve() -> Bcifs {
        let unknown = |n: usize| Matrix { rows: vec![vec![Entry::Unknown; n]; n] };
        let transition = |to: &str, operator| TransitionSpec { to: to.into(), operator };
        let end = |first: usize| {
            let number = |row: usize, column: usize| Entry::Number(f64::from(u8::from(row == first + column)));
            let incidence = Matrix { rows: (0..4).map(|row| (0..2).map(|column| number(row, column)).collect()).collect() };
            BoundarySpec { state: "vertex".into(), incidence }
        };
        let edge = BcifsState {
            name: "edge".into(),
            cell: CellKind::Edge,
            dimension: 4,
            transitions: vec![transition("edge", unknown(4)), transition("edge", unknown(4))],
            boundaries: vec![end(0), end(2)],
        };
        let vertex = BcifsState {
            name: "vertex".into(),
            cell: CellKind::Vertex,
            dimension: 2,
            transitions: vec![transition("vertex", unknown(2))],
            boundaries: Vec::new(),
        };
        Bcifs {
            states: vec![edge, vertex],
            incidences: (0..2).map(|k| Incidence { state: "edge".into(), boundary: k, children: vec![(k, k)] }).collect(),
            adjacencies: vec![Adjacency { state: "edge".into(), between: [(0, 1), (1, 0)], reversed: false, permutation: None }],
            ..Bcifs::default()
        }
    }

    /// Some entries of a random solution, one of them wrong by 1/8.
    fn spoilt(seed: u64) -> Bcifs {
        let (blank, mut bits) = (curve(), seed);
        let space = blank.solve(&BTreeMap::new(), &CancelToken::new()).expect("has solutions");
        let values = space.parameters.iter().map(|parameter| (parameter.name.clone(), (next(&mut bits) % 64) as f64 / 64.0)).collect();
        let mut model = blank.solve(&values, &CancelToken::new()).expect("the parameters are free").model;
        let mut given = Vec::new();
        for entry in model.states.iter_mut().flat_map(|state| &mut state.transitions).flat_map(|t| t.operator.rows.iter_mut().flatten()) {
            let keep = *entry != Entry::Number(0.0) && next(&mut bits).is_multiple_of(4);
            if !keep {
                *entry = Entry::Unknown;
            } else if let Entry::Number(value) = entry {
                given.push(value);
            }
        }
        if !given.is_empty() {
            let index = next(&mut bits) as usize % given.len();
            *given[index] += 0.125;
        }
        model
    }

    #[test]
    fn every_member_of_a_smallest_reason_is_needed() {
        let cancel = CancelToken::new();
        let (mut contradictory, mut sizes) = (0, Vec::new());
        for seed in 0..400 {
            let system = read(&spoilt(seed), &BTreeMap::new()).expect("well formed");
            let all: Vec<usize> = (0..system.constraints.len()).collect();
            let Err(support) = Knowledge::of(&system, &all, &cancel).expect("within limits") else { continue };
            let set = irreducible(&system, &support, &cancel).expect("within limits");
            assert!(Knowledge::of(&system, &set, &cancel).expect("within limits").is_err());
            for member in &set {
                let without: Vec<usize> = set.iter().copied().filter(|index| index != member).collect();
                assert!(Knowledge::of(&system, &without, &cancel).expect("within limits").is_ok(), "seed {seed}: {member} of {set:?}");
            }
            contradictory += 1;
            sizes.push(set.len());
        }
        assert!(contradictory > 50 && sizes.iter().filter(|&&size| size > 2).count() > 5, "{contradictory} {sizes:?}");
    }
}
