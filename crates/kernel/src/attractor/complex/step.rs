//! One subdivision of a face: all children's control points at once.

use crate::attractor::cell::ControlPoint;
use crate::automaton::Automaton;

/// Neighbouring children share most of their control points: of 4 x 16 of a bicubic patch 25 are different. Each is
/// computed once, from the entries that are not zero.
#[derive(Debug, Default)]
struct Step {
    /// The different columns of all operators, one after the other: their rows and weights.
    entries: Vec<(u32, f64)>,
    /// Where the entries of a column end.
    ends: Vec<u32>,
    /// For every child its columns.
    children: Vec<Vec<u32>>,
}

/// The step of every state.
pub(super) struct Steps(Vec<Step>);

impl Steps {
    /// Cost: columns are compared in pairs, once for each state.
    pub(super) fn new(automaton: &Automaton) -> Self {
        let step = |state: &crate::automaton::State| {
            let mut step = Step::default();
            let mut known: Vec<&[f64]> = Vec::new();
            for transition in &state.transitions {
                let columns = (0..transition.operator.columns()).map(|column| transition.operator.column(column));
                let place = |column| {
                    let index = known.iter().position(|other| *other == column).unwrap_or_else(|| {
                        known.push(column);
                        let weights = column.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
                        step.entries.extend(weights.map(|(row, &weight)| (row as u32, weight)));
                        step.ends.push(step.entries.len() as u32);
                        known.len() - 1
                    });
                    index as u32
                };
                step.children.push(columns.map(place).collect());
            }
            step
        };
        Self(automaton.states().iter().map(step).collect())
    }

    /// The different control points of a cell's children.
    pub(super) fn take(&self, state: usize, points: &[ControlPoint], out: &mut Vec<ControlPoint>) {
        let step = &self.0[state];
        out.clear();
        let mut first = 0;
        for &end in &step.ends {
            let mut sum = [0.0; 4];
            for &(row, weight) in &step.entries[first..end as usize] {
                for (total, &coordinate) in sum.iter_mut().zip(&points[row as usize]) {
                    *total += weight * coordinate;
                }
            }
            out.push(sum);
            first = end as usize;
        }
    }

    /// Those of one child.
    pub(super) fn child(&self, state: usize, child: usize, all: &[ControlPoint], out: &mut Vec<ControlPoint>) {
        out.clear();
        out.extend(self.0[state].children[child].iter().map(|&column| all[column as usize]));
    }
}
