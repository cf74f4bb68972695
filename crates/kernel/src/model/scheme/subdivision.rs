//! Subdivision schemes of curves.

use super::factor::{Factor, Piece, Span};
use super::{Faults, windows};
use crate::automaton::SubdivisionOperator;

/// Spans of successive points, of one kind of piece.
fn successive(piece: Piece, closed: bool, count: usize) -> Factor {
    let span = |points: Vec<usize>| Span { piece: 0, controls: points.into_iter().map(|point| vec![(point, 1.0)]).collect() };
    let spans = windows(count, piece.dimension, closed).map(span).collect();
    Factor::chain(vec![piece], spans, closed)
}

/// Corner cutting: see [`crate::model::CornerCutting`].
pub(super) fn corner_cutting([a, b]: [f64; 2], closed: bool, count: usize, faults: &mut Faults<'_>) -> Option<Factor> {
    if !(faults.moderate("a", a) & faults.moderate("b", b) & faults.enough(count, 3, "corner-cutting.points")) {
        return None;
    }
    let sum = a + b;
    if sum == 0.0 {
        faults.add("/a", "corner-cutting.ends", "a + b is 0: the spans have no ends, and make no product; change a or b".into());
        return None;
    }
    let operators = [vec![1.0 - a, a, 0.0, b, 1.0 - b, 0.0, 0.0, 1.0 - a, a], vec![b, 1.0 - b, 0.0, 0.0, 1.0 - a, a, 0.0, b, 1.0 - b]];
    let piece = Piece {
        name: format!("corner cutting {a} {b}"),
        dimension: 3,
        children: operators.into_iter().map(|columns| (0, SubdivisionOperator::exact(3, columns))).collect(),
        ends: [vec![b / sum, a / sum, 0.0], vec![0.0, b / sum, a / sum]],
        parameters: if a == b && a == 0.25 { vec![-0.5, 0.5, 1.5] } else { Vec::new() },
        hull: None,
    };
    Some(successive(piece, closed, count))
}

/// The four-point scheme: old points stay, between P_1 and P_2 comes (1/2 + w)(P_1 + P_2) - w (P_0 + P_3).
pub(super) fn four_point(tension: f64, closed: bool, count: usize, faults: &mut Faults<'_>) -> Option<Factor> {
    if !(faults.moderate("w", tension) & faults.enough(count, if closed { 3 } else { 6 }, "four-point.points")) {
        return None;
    }
    // The refined point q of six: even ones are old.
    let refined = |q: usize| {
        let mut column = vec![0.0; 6];
        if q.is_multiple_of(2) {
            column[q / 2] = 1.0;
        } else {
            let first = q / 2 - 1;
            [-tension, 0.5 + tension, 0.5 + tension, -tension].into_iter().enumerate().for_each(|(k, entry)| column[first + k] = entry);
        }
        column
    };
    let half = |first: usize| SubdivisionOperator::exact(6, (first..first + 6).flat_map(refined).collect());
    let unit = |at: usize| (0..6).map(|k| f64::from(k == at)).collect();
    let piece = Piece {
        name: format!("four-point scheme of tension {tension}"),
        dimension: 6,
        children: vec![(0, half(2)), (0, half(3))],
        ends: [unit(2), unit(3)],
        parameters: (0..6).map(|k| f64::from(k) - 2.0).collect(),
        hull: None,
    };
    Some(successive(piece, closed, count))
}
