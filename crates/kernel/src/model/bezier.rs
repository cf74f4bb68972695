//! Bezier curves.

use super::CellKind;
use super::lower::Draft;
use crate::attractor::Root;
use crate::automaton::{LeafPrimitive, State, StateId, Transition};
use crate::de_casteljau::operators;
use glam::DVec3;

/// A polynomial or rational Bezier curve of degree n - 1, n control points.
#[derive(Clone, Debug, PartialEq)]
pub struct BezierCurve {
    /// The control points in mm.
    pub control_points: Vec<DVec3>,
    /// Positive weights, one per control point; polynomial when absent.
    pub weights: Option<Vec<f64>>,
}

/// Control points allowed: beyond it the binomials of the midpoint operators lose digits.
const MOST_POINTS: usize = 64;

impl BezierCurve {
    pub(super) fn lower(&self, draft: &mut Draft) {
        let count = self.control_points.len();
        if count == 0 || count > MOST_POINTS {
            return draft.error("/control_points", "bezier.degree", format!("{count} control points: 1 to {MOST_POINTS} are possible"));
        }
        for (index, point) in self.control_points.iter().enumerate().filter(|(_, point)| !point.is_finite()) {
            draft.error(
                &format!("/control_points/{index}"),
                "model.not-finite",
                format!("control point {index} is {point}, and must be finite"),
            );
        }
        let weights = self.weights.clone().unwrap_or_else(|| vec![1.0; count]);
        if weights.len() != count {
            draft.error("/weights", "bezier.weights", format!("{} weights for {count} control points", weights.len()));
        }
        for (index, weight) in weights.iter().enumerate().filter(|(_, weight)| !super::WEIGHTS.contains(weight)) {
            let (least, most) = (super::WEIGHTS.start(), super::WEIGHTS.end());
            let message = format!("weight {index} is {weight:e}, and must be positive, from {least:e} to {most:e}");
            draft.error(&format!("/weights/{index}"), "bezier.weights", message);
        }
        let rational = weights.iter().any(|&weight| weight != weights[0]);
        let points = self
            .control_points
            .iter()
            .zip(&weights)
            .map(|(point, &weight)| {
                let w = if rational { weight } else { 1.0 };
                [w * point.x, w * point.y, w * point.z, w]
            })
            .collect();
        // Curves of one degree share their state.
        let name = format!("bezier curve of degree {}", count - 1);
        let known = draft.states.iter().position(|state| state.name == name && state.dimension == count);
        let state = known.map_or_else(|| bezier_state(draft, name, count), StateId::new);
        draft.roots.push(Root { state, points, rational, solid: None });
    }
}

/// The state of a Bezier curve with n control points: de Casteljau's two halves. One point is a point, two
/// are a segment.
fn bezier_state(draft: &mut Draft, name: String, n: usize) -> StateId {
    let unit = |at: usize| (0..n).map(|k| if k == at { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
    let boundaries = if n == 1 { Vec::new() } else { vec![draft.end_point(unit(0)), draft.end_point(unit(n - 1))] };
    let own = StateId::new(draft.states.len());
    let subdivide = || operators(n).into_iter().enumerate().map(|(label, operator)| Transition { to: own, operator, label }).collect();
    draft.state(State {
        name,
        kind: Some(if n == 1 { CellKind::Vertex } else { CellKind::Edge }),
        dimension: n,
        transitions: if n <= 2 { Vec::new() } else { subdivide() },
        boundaries,
        leaf: if n <= 2 { LeafPrimitive::Simplex } else { LeafPrimitive::Centre },
        frame: false,
    })
}
