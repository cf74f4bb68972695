//! Smallest reasons for a contradiction.

use super::linear::Support;
use super::propagate::Knowledge;
use super::system::System;
use super::{ConflictingConstraint, SolveError};
use crate::budget::CancelToken;

/// An irreducible contradictory subset of constraints that are contradictory together: the deletion filter of
/// Chinneck and Dravnieks ("Locating minimal infeasible constraint sets in linear programs", ORSA J. Computing 3(2),
/// 1991). What is contradictory without a constraint replaces the set, so members that do not matter leave in
/// numbers.
pub(super) fn irreducible(system: &System, start: &Support, cancel: &CancelToken) -> Result<SolveError, SolveError> {
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
    let named = |&index: &usize| system.constraints[index].named.clone();
    Ok(SolveError::Contradiction { constraints: set.iter().map(named).collect::<Vec<ConflictingConstraint>>() })
}
