//! Patches that are bicubic or biquadratic polynomials, whatever they are written in: their control points as patches of
//! uniform B-splines.

use super::kinds::fitted;
use super::limits::{Limits, Weights};
use crate::automaton::topology::same;
use crate::model::lower::Draft;

/// The control points of a uniform tensor product B-spline patch, seen from one of its sides.
pub(super) struct Net {
    /// 2 or 3.
    pub(super) degree: usize,
    /// Homogeneous points, `points[i][k]` with i inwards from the side and k along it; i = 0 lies beyond the side.
    pub(super) points: Vec<Vec<[f64; 4]>>,
}

/// Subdivisions of the patch whose corners are compared: 25 points determine a bicubic, and test it.
const DEPTH: u32 = 2;

/// The values of the uniform B-splines of degree 2 or 3 over [0, 1].
fn basis(degree: usize, t: f64) -> Weights {
    let s = 1.0 - t;
    if degree == 2 {
        return vec![s * s / 2.0, (1.0 + 2.0 * t * s) / 2.0, t * t / 2.0];
    }
    [s * s * s, 3.0 * t * t * t - 6.0 * t * t + 4.0, 3.0 * s * s * s - 6.0 * s * s + 4.0, t * t * t].map(|x| x / 6.0).to_vec()
}

/// The patch beside a border, if it is biquadratic or bicubic for all control points; `backwards`: along the border against
/// its own direction.
pub(super) fn beside(limits: Limits<'_>, draft: &Draft, (root, boundary): (usize, usize), backwards: bool) -> Option<Net> {
    let root = &draft.roots[root];
    let edge = draft.states[root.state.index()].boundaries.get(boundary)?;
    let mut ends = limits.curve(edge.state, 0)?;
    if backwards {
        ends.reverse();
    }
    let corners = limits.corners(root.state)?;
    let corner = |end: &Weights| {
        let place = edge.incidence.apply(end);
        corners.iter().position(|corner| same(corner, &place))
    };
    let (x, y) = (corner(&ends[0])?, corner(&ends[1])?);
    let inwards = if y == (x + 1) % 4 { (x + 3) % 4 } else { (x + 1) % 4 };
    let grid: Vec<Weights> = limits.face(root.state, [x, inwards, (x + 2) % 4, y], DEPTH)?.concat();
    let side = 1 << DEPTH;
    for degree in [2, 3] {
        let value = |i: usize| basis(degree, i as f64 / side as f64);
        let product = |index: usize| -> Weights {
            let (u, v) = (value(index / (side + 1)), value(index % (side + 1)));
            u.iter().flat_map(|a| v.iter().map(move |b| a * b)).collect()
        };
        let values: Vec<Weights> = (0..grid.len()).map(product).collect();
        if let Some(change) = fitted(&grid, &values) {
            let point = |j: usize| -> [f64; 4] {
                let terms = root.points.iter().zip(change.column(j));
                terms.fold([0.0; 4], |sum, (point, weight)| std::array::from_fn(|axis| sum[axis] + weight * point[axis]))
            };
            let points = (0..=degree).map(|i| (0..=degree).map(|k| point(i * (degree + 1) + k)).collect()).collect();
            return Some(Net { degree, points });
        }
    }
    None
}
