//! Curves of corner cutting with two parameters.

use super::CellKind;
use super::lower::Draft;
use crate::attractor::{Gluing, Root};
use crate::automaton::{LeafPrimitive, State, StateId, SubdivisionOperator, Transition};
use glam::DVec3;

/// The limit of the corner-cutting scheme (a, b) on a control polygon; a = b = 1/4 is Chaikin's,
/// the uniform quadratic B-spline.
#[derive(Clone, Debug, PartialEq)]
pub struct CornerCutting {
    /// The control polygon in mm, three points or more.
    pub control_points: Vec<DVec3>,
    /// First parameter.
    pub a: f64,
    /// Second parameter.
    pub b: f64,
    /// Whether the polygon is closed.
    pub closed: bool,
}

impl CornerCutting {
    /// One state of three control points, one root for every three successive points of the polygon. The
    /// children of a cell are T_0 and T_1 (Chaikin's operators for a = b = 1/4); the curve of a cell runs
    /// from (b P_0 + a P_1)/(a + b) to (b P_1 + a P_2)/(a + b), the fixed points of T_0 and T_1.
    pub(super) fn lower(&self, draft: &mut Draft) {
        let (a, b) = (self.a, self.b);
        let count = self.control_points.len();
        if count < 3 {
            draft.error("/control_points", "corner-cutting.points", format!("{count} control points: three or more are needed"));
        }
        for (index, point) in self.control_points.iter().enumerate().filter(|(_, point)| !point.is_finite()) {
            draft.error(
                &format!("/control_points/{index}"),
                "model.not-finite",
                format!("control point {index} is {point}, and must be finite"),
            );
        }
        for (name, value) in [("a", a), ("b", b)] {
            if !value.is_finite() || value.abs() > 1e6 {
                draft.error(
                    &format!("/{name}"),
                    "model.not-finite",
                    format!("{name} is {value}, and must be a finite number of moderate size"),
                );
            }
        }
        if !(a.is_finite() && b.is_finite()) || a.abs().max(b.abs()) > 1e6 || count < 3 {
            return;
        }
        let sum = a + b;
        let boundaries = if sum == 0.0 {
            Vec::new()
        } else {
            vec![draft.end_point(vec![b / sum, a / sum, 0.0]), draft.end_point(vec![0.0, b / sum, a / sum])]
        };
        let own = StateId::new(draft.states.len());
        let columns = [vec![1.0 - a, a, 0.0, b, 1.0 - b, 0.0, 0.0, 1.0 - a, a], vec![b, 1.0 - b, 0.0, 0.0, 1.0 - a, a, 0.0, b, 1.0 - b]];
        let transitions = columns
            .into_iter()
            .enumerate()
            .map(|(label, columns)| Transition { to: own, operator: SubdivisionOperator::exact(3, columns), label })
            .collect();
        draft.state(State {
            name: "corner cutting".into(),
            kind: Some(CellKind::Edge),
            dimension: 3,
            transitions,
            boundaries,
            leaf: LeafPrimitive::Centre,
            frame: false,
        });
        let first_root = draft.roots.len();
        let spans = if self.closed { count } else { count - 2 };
        for span in 0..if sum == 0.0 { 0 } else { spans - usize::from(!self.closed) } {
            let next = (span + 1) % spans;
            draft.gluings.push(Gluing { between: [(first_root + span, 1), (first_root + next, 0)], permutation: None });
        }
        for first in 0..spans {
            let point = |k: usize| {
                let p = self.control_points[(first + k) % count];
                [p.x, p.y, p.z, 1.0]
            };
            draft.roots.push(Root { state: own, points: vec![point(0), point(1), point(2)], rational: false, solid: None });
        }
    }
}
