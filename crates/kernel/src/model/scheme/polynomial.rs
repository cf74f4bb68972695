//! Schemes whose spans are cubics or Bezier curves: written with Bezier points, so that cells stay in their hulls.

use super::factor::{Factor, Piece, Span};
use super::{Faults, Parametrization, lengths, windows};
use crate::de_casteljau::operators;
use glam::DVec3;

/// Control points of one Bezier curve in a product.
const MOST_POINTS: usize = 64;

/// The piece of a Bezier curve of `count` points.
pub(super) fn piece(count: usize) -> Piece {
    let unit = |at: usize| (0..count).map(|k| f64::from(k == at)).collect();
    Piece {
        name: format!("bezier curve of degree {}", count - 1),
        dimension: count,
        children: operators(count).into_iter().map(|operator| (0, operator)).collect(),
        ends: [unit(0), unit(count - 1)],
        parameters: (0..count).map(|k| k as f64 / (count - 1) as f64).collect(),
        hull: None,
    }
}

/// One Bezier curve.
pub(super) fn bezier(count: usize, faults: &mut Faults<'_>) -> Option<Factor> {
    if !(2..=MOST_POINTS).contains(&count) {
        faults.add_points("bezier.degree", format!("{count} control points in one direction: 2 to {MOST_POINTS} are possible"));
        return None;
    }
    let controls = (0..count).map(|point| vec![(point, 1.0)]).collect();
    Some(Factor { pieces: vec![piece(count)], spans: vec![Span { piece: 0, controls }], joints: Vec::new() })
}

/// Cubic spans of four successive points each, whose Bezier points have the given coefficients in them.
fn cubics(count: usize, closed: bool, coefficients: impl Fn(usize) -> [[f64; 4]; 4]) -> Factor {
    let span = |(index, points): (usize, Vec<usize>)| {
        let weights = |row: [f64; 4]| points.iter().copied().zip(row).filter(|pair| pair.1 != 0.0).collect();
        Span { piece: 0, controls: coefficients(index).map(weights).to_vec() }
    };
    Factor::chain(vec![piece(4)], windows(count, 4, closed).enumerate().map(span).collect(), closed)
}

/// Parameter intervals after every point, the last one's to the first point.
pub(super) fn intervals(points: &[DVec3], parametrization: Parametrization, faults: &mut Faults<'_>) -> Option<Vec<f64>> {
    let exponent = match parametrization {
        Parametrization::Uniform => return Some(vec![1.0; points.len()]),
        Parametrization::Centripetal => 0.5,
        Parametrization::Chordal => 1.0,
    };
    let intervals: Vec<f64> = lengths(points).into_iter().map(|length| length.powf(exponent)).collect();
    let repeated = (0..points.len().saturating_sub(1)).find(|&k| intervals[k] == 0.0);
    if let Some(k) = repeated {
        let message = format!("control points {k} and {} coincide: their parameters would be equal; drop one or use uniform ones", k + 1);
        faults.add(&format!("/control_points/{}", k + 1), "catmull-rom.repeated-point", message);
        return None;
    }
    Some(intervals)
}

/// The Catmull-Rom spline: the span from P_1 to P_2 is the Hermite cubic whose derivatives there are those of the
/// parabolas through three successive points.
pub(super) fn catmull_rom(intervals: &[f64], closed: bool, count: usize, faults: &mut Faults<'_>) -> Option<Factor> {
    if !faults.enough(count, if closed { 3 } else { 4 }, "catmull-rom.points") {
        return None;
    }
    if closed && intervals[count - 1] == 0.0 {
        let message = "the last control point repeats the first: a closed polygon closes by itself; drop it";
        faults.add(&format!("/control_points/{}", count - 1), "catmull-rom.repeated-point", message.into());
        return None;
    }
    Some(cubics(count, closed, |first| {
        let [a, b, c] = [0, 1, 2].map(|k| intervals[(first + k) % count]);
        // A third of the derivative, scaled to the span's own interval b.
        let start = [-b * b / (3.0 * a * (a + b)), (b - a) / (3.0 * a) + 1.0, a / (3.0 * (a + b)), 0.0];
        let end = [0.0, c / (3.0 * (b + c)), (b - c) / (3.0 * c) + 1.0, -b * b / (3.0 * c * (b + c))];
        [[0.0, 1.0, 0.0, 0.0], start, end, [0.0, 0.0, 1.0, 0.0]]
    }))
}

/// Barsky's uniformly shaped beta-spline. The basis is his; its four cubics are written in Bernstein form.
pub(super) fn beta_spline([bias, tension]: [f64; 2], closed: bool, count: usize, faults: &mut Faults<'_>) -> Option<Factor> {
    if !(faults.moderate("beta1", bias)
        & faults.moderate("beta2", tension)
        & faults.enough(count, if closed { 3 } else { 4 }, "beta-spline.points"))
    {
        return None;
    }
    if bias <= 0.0 {
        faults.add("/beta1", "beta-spline.shape", format!("beta1 is {bias}, and must be positive"));
        return None;
    }
    let (square, cube) = (bias * bias, bias * bias * bias);
    let sum = tension + 2.0 * cube + 4.0 * square + 4.0 * bias + 2.0;
    if sum <= 1e-6 * (sum - tension) {
        let message = format!("beta2 is {tension}: with beta1 = {bias} it must be above {}", tension - sum);
        faults.add("/beta2", "beta-spline.shape", message);
        return None;
    }
    // Rows: Bezier points; columns: the four control points.
    let rows = [
        [2.0 * cube, 4.0 * square + 4.0 * bias + tension, 2.0, 0.0],
        [0.0, 2.0 * cube + 4.0 * square + 2.0 * bias + tension, 2.0 * bias + 2.0, 0.0],
        [0.0, 2.0 * cube + 2.0 * square, 2.0 * square + 4.0 * bias + tension + 2.0, 0.0],
        [0.0, 2.0 * cube, 4.0 * square + 4.0 * bias + tension, 2.0],
    ];
    Some(cubics(count, closed, |_| rows.map(|row| row.map(|entry| entry / sum))))
}
