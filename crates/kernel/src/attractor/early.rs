//! Leaves known before their control points: cells of affine frames under similarities.
//!
//! Such a cell's ball has the radius of its parent's times the transition's ratio, and its centre is a fixed
//! combination T c of the parent's control points, so that neither the child's frame nor its norm is needed. Most
//! cells of a walk are leaves.

use super::cell::{Cell, ControlPoint, Point};
use super::{Attractor, StateBound};
use crate::automaton::LeafPrimitive;

struct EarlyLeaf {
    /// Error of the child over the parent's stretch.
    factor: f64,
    /// T c: the centre in the parent's barycentric space.
    centre: [f64; 4],
}

/// For every state and transition, how its child's leaf is known, if it is.
pub(super) struct EarlyLeaves(Vec<Vec<Option<EarlyLeaf>>>);

impl EarlyLeaves {
    pub(super) fn new(attractor: &Attractor) -> Self {
        let states = attractor.automaton().states();
        let leaf = |state: usize, index: usize| -> Option<EarlyLeaf> {
            let transition = &states[state].transitions[index];
            let StateBound::Frame { ratios, .. } = &attractor.bounds[state] else { return None };
            let StateBound::Frame { centre, radius, similar: true, .. } = attractor.bound(transition.to) else { return None };
            // Only where leaves are the centres of balls is the ball's radius their error.
            if states[transition.to.index()].leaf != LeafPrimitive::Centre {
                return None;
            }
            let barycentric = [1.0 - centre.iter().sum::<f64>(), centre[0], centre[1], centre[2]];
            let image = transition.operator.apply(&barycentric);
            Some(EarlyLeaf { factor: ratios[index] * radius, centre: image.try_into().ok()? })
        };
        let of_state = |state: usize| -> Vec<Option<EarlyLeaf>> {
            let transitions = 0..states[state].transitions.len();
            if states[state].frame { transitions.map(|index| leaf(state, index)).collect() } else { Vec::new() }
        };
        Self((0..states.len()).map(of_state).collect())
    }

    /// The error and the point of the leaf that child `index` of a cell is, if it is known to be one.
    #[inline]
    pub(super) fn leaf(&self, cell: &Cell, index: usize, points: &[ControlPoint], tolerance_mm: f64) -> Option<(f64, Point)> {
        let leaf = self.0[cell.state.index()].get(index)?.as_ref()?;
        let error = cell.stretch * leaf.factor;
        if error > tolerance_mm {
            return None;
        }
        let points: &[ControlPoint; 4] = points.try_into().ok()?;
        let coordinate = |axis: usize| points.iter().zip(&leaf.centre).map(|(point, weight)| weight * point[axis]).sum();
        Some((error, [coordinate(0), coordinate(1), coordinate(2)]))
    }
}
