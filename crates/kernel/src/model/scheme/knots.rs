//! Splines on any knots, as automata of inter-knot vectors (Morlet, Gentil, Lanquetin, Neveu and Baril, "Representation
//! of NURBS surfaces by controlled iterated functions system automata", Computers & Graphics: X 2, 2019).
//!
//! A span of degree d with the knots x_0 .. x_{2d-1}, that is on [x_{d-1}, x_d], has the control points
//! f(x_j, .., x_{j+d-1}), j = 0..d, of its blossom f. Inserting the middle of every interval doubles the intervals;
//! the halves of the span are spans with the 2d - 1 intervals around them. Only ratios matter, so the middle one is
//! kept at 1 and the doubled ones are not halved: few vectors are met, 4(d - 1) from a generic one.

use super::Faults;
use super::factor::{Factor, Piece, Span};
use crate::automaton::{Hull, SubdivisionOperator};
use std::collections::BTreeMap;

/// Degrees that are possible.
pub(super) const DEGREES: std::ops::RangeInclusive<usize> = 1..=9;

/// Intervals longer than so many times the span's own: there the vectors of a span's two ends come so close in its
/// barycentric space that cells could not be told apart, and the span is written with its own Bezier points.
const LONGEST: f64 = 16.0;

/// Relative uncertainty of an interval that is taken for rounding of the knots.
const ROUNDING: f64 = 2e-13;

/// How the spans are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// With the control points as they are: a state per inter-knot vector.
    Intervals,
    /// With Bezier points, halved by de Casteljau's algorithm: one state.
    Bezier,
}

/// The factor of a spline with `count` control points; `None` after a fault.
pub(super) fn factor(degree: usize, knots: &[f64], count: usize, form: Form, faults: &mut Faults<'_>) -> Option<Factor> {
    if !check(degree, knots, count, faults) {
        return None;
    }
    let mut pieces = Pieces { degree, list: Vec::new(), known: BTreeMap::new() };
    let (mut spans, mut joints, mut end) = (Vec::new(), Vec::new(), None);
    for last in (degree..count).filter(|&last| knots[last] < knots[last + 1]) {
        let local = &knots[last + 1 - degree..=last + degree];
        let first = last - degree;
        let ratios = ratios(local, degree);
        let span = match ratios {
            Some(ratios) if form == Form::Intervals => {
                Span { piece: pieces.intern(ratios), controls: (first..=last).map(|point| vec![(point, 1.0)]).collect() }
            }
            _ => {
                let mut own = vec![0.0; 2 * degree - 1];
                own[degree - 1] = 1.0;
                let piece = if form == Form::Bezier { 0 } else { pieces.intern(own) };
                let weights = |column: Vec<f64>| column.into_iter().enumerate().map(|(k, x)| (first + k, x)).filter(|pair| pair.1 != 0.0);
                let controls = bezier_points(local, degree).into_iter().map(|column| weights(column).collect()).collect();
                Span { piece, controls }
            }
        };
        // A knot of multiplicity degree + 1 parts the curve: the spans before and after have no control point in common.
        if end.is_some_and(|before| before >= first) {
            joints.push([spans.len() - 1, spans.len()]);
        }
        end = Some(last);
        spans.push(span);
    }
    let pieces = if form == Form::Bezier { vec![super::polynomial::piece(degree + 1)] } else { pieces.complete() };
    Some(Factor { pieces, spans, joints })
}

fn check(degree: usize, knots: &[f64], count: usize, faults: &mut Faults<'_>) -> bool {
    let before = faults.count;
    if !DEGREES.contains(&degree) {
        let (least, most) = (DEGREES.start(), DEGREES.end());
        faults.add("/degree", "nurbs.degree", format!("the degree is {degree}: {least} to {most} are possible"));
        return false;
    }
    if count < degree + 1 {
        let message = format!("{count} control points: degree {degree} needs {} or more", degree + 1);
        faults.add_points("nurbs.points", message);
        return false;
    }
    if knots.len() != count + degree + 1 {
        let message = format!(
            "{} knots: {count} control points of degree {degree} need {} (control points + degree + 1)",
            knots.len(),
            count + degree + 1
        );
        faults.add("/knots", "nurbs.knot-count", message);
        return false;
    }
    for (index, knot) in knots.iter().enumerate().filter(|(_, knot)| !knot.is_finite()) {
        faults.add(&format!("/knots/{index}"), "model.not-finite", format!("knot {index} is {knot}, and must be finite"));
    }
    for (index, pair) in knots.windows(2).enumerate().filter(|(_, pair)| pair[0] > pair[1]) {
        let message = format!("knot {} is {}, below knot {index}, which is {}: knots must not decrease", index + 1, pair[1], pair[0]);
        faults.add(&format!("/knots/{}", index + 1), "nurbs.knots-decrease", message);
    }
    if faults.count > before {
        return false;
    }
    if !(knots[knots.len() - 1] - knots[0]).is_finite() {
        faults.add("/knots", "nurbs.knot-range", "the range of the knots overflows: scale them".into());
        return false;
    }
    let mut first = 0;
    for index in 1..=knots.len() {
        if knots.get(index) != Some(&knots[first]) {
            let multiplicity = index - first;
            if multiplicity > degree + 1 {
                let message =
                    format!("knot {} has multiplicity {multiplicity}: at most degree + 1 = {} is possible", knots[first], degree + 1);
                faults.add(&format!("/knots/{}", first + degree + 1), "nurbs.multiplicity", message);
            }
            first = index;
        }
    }
    if knots[degree] == knots[count] {
        let message = format!("the domain, from knot {degree} to knot {count}, is the single value {}", knots[degree]);
        faults.add("/knots", "nurbs.empty-domain", message);
    }
    faults.count == before
}

/// The intervals as multiples of the middle one, rounding of the knots removed: each the simplest fraction within it,
/// so that spans of equal stencils have equal ratios. `None` when one is too long.
fn ratios(local: &[f64], degree: usize) -> Option<Vec<f64>> {
    let middle = local[degree] - local[degree - 1];
    let rounding = 4.0 * f64::EPSILON * local.iter().fold(0.0_f64, |a, x| a.max(x.abs())) / middle;
    let ratio = |pair: &[f64]| {
        let ratio = (pair[1] - pair[0]) / middle;
        (ratio <= LONGEST).then(|| if ratio == 0.0 { 0.0 } else { simplest(ratio, (rounding / ratio).clamp(1e-15, ROUNDING)) })
    };
    local.windows(2).map(ratio).collect()
}

/// The fraction of smallest denominator within the relative distance `width` of a positive number, by its continued
/// fraction; the number itself when none below 2^53 is.
fn simplest(value: f64, width: f64) -> f64 {
    let ([mut p0, mut q0], [mut p1, mut q1]) = ([0.0, 1.0], [1.0, 0.0]);
    let mut rest = value;
    for _ in 0..40 {
        let whole = rest.floor();
        ([p0, q0], [p1, q1]) = ([p1, q1], [whole * p1 + p0, whole * q1 + q0]);
        if p1.max(q1) > 9e15 {
            return value;
        }
        if (p1 / q1 - value).abs() <= width * value {
            return p1 / q1;
        }
        rest = 1.0 / (rest - whole);
    }
    value
}

/// An entry of an operator: a fraction, where one is within rounding, as it is for simple ratios of intervals.
fn rounded(entry: f64) -> f64 {
    if entry > 0.0 { simplest(entry, 4.0 * f64::EPSILON) } else { 0.0 }
}

/// A run of knots and the control points of their blossom: point j belongs to knots j .. j + degree - 1, as a point of
/// the barycentric space of the span that it started from; `None` where that depends on more than the span.
struct Run {
    degree: usize,
    knots: Vec<f64>,
    points: Vec<Option<Vec<f64>>>,
}

impl Run {
    fn new(knots: &[f64], degree: usize) -> Self {
        let unit = |at: usize| (0..=degree).map(|k| f64::from(k == at)).collect();
        Self { degree, knots: knots.to_vec(), points: (0..=degree).map(|at| Some(unit(at))).collect() }
    }

    /// Inserts a knot before position `at`, by Boehm's convex combinations: no cancellation, no negative entry.
    fn insert(&mut self, at: usize, value: f64) {
        let degree = self.degree;
        let old = &self.points;
        let points = (0..=self.knots.len() + 1 - degree)
            .map(|j| {
                if at >= j + degree {
                    return old[j].clone();
                }
                if at < j {
                    return old[j - 1].clone();
                }
                let (left, right) = (old.get(j.checked_sub(1)?)?.as_ref()?, old.get(j)?.as_ref()?);
                let (low, high) = (self.knots[j - 1], self.knots[j + degree - 1]);
                // Equal knots: both are the same point.
                let share = if high > low { (value - low) / (high - low) } else { 0.0 };
                Some(left.iter().zip(right).map(|(a, b)| (1.0 - share) * a + share * b).collect())
            })
            .collect();
        self.points = points;
        self.knots.insert(at, value);
    }

    fn take(&self, at: usize) -> Vec<f64> {
        self.points[at].clone().expect("windows within half the degree of the span depend on its own points")
    }
}

/// The two halves: operators, for the intervals with the span's own as the middle one.
fn halves(knots: &[f64], degree: usize) -> [SubdivisionOperator; 2] {
    let mut run = Run::new(knots, degree);
    for interval in (0..2 * degree - 1).rev() {
        run.insert(interval + 1, 0.5 * (knots[interval] + knots[interval + 1]));
    }
    let entries = |first: usize| (0..=degree).flat_map(|j| run.take(first + j)).map(rounded).collect();
    [degree - 1, degree].map(|first| SubdivisionOperator::exact(degree + 1, entries(first)))
}

/// The values at the two ends of the span.
fn ends(knots: &[f64], degree: usize) -> [Vec<f64>; 2] {
    let (start, end) = (knots[degree - 1], knots[degree]);
    let mut run = Run::new(knots, degree);
    let multiplicity = knots[..degree].iter().filter(|&&knot| knot == start).count();
    (multiplicity..degree).for_each(|_| run.insert(degree, start));
    let first = run.take(degree - multiplicity);
    let mut run = Run::new(knots, degree);
    let multiplicity = knots[degree..].iter().filter(|&&knot| knot == end).count();
    (multiplicity..degree).for_each(|_| run.insert(degree, end));
    [first, run.take(degree)].map(|point| point.into_iter().map(rounded).collect())
}

/// The Bezier points of a span, in terms of its control points.
fn bezier_points(knots: &[f64], degree: usize) -> Vec<Vec<f64>> {
    let mut run = Run::new(knots, degree);
    let (start, end) = (knots[degree - 1], knots[degree]);
    let right = knots[degree..].iter().filter(|&&knot| knot == end).count();
    let left = knots[..degree].iter().filter(|&&knot| knot == start).count();
    (right..degree).for_each(|_| run.insert(degree, end));
    (left..degree).for_each(|_| run.insert(degree, start));
    (0..=degree).map(|j| run.take(degree - left + j)).collect()
}

/// Vectors met so far.
struct Pieces {
    degree: usize,
    list: Vec<Vec<f64>>,
    known: BTreeMap<Vec<u64>, usize>,
}

impl Pieces {
    fn intern(&mut self, ratios: Vec<f64>) -> usize {
        let key: Vec<u64> = ratios.iter().map(|ratio| ratio.to_bits()).collect();
        *self.known.entry(key).or_insert_with(|| {
            self.list.push(ratios);
            self.list.len() - 1
        })
    }

    /// All that follow from these: an interval keeps its ratio to the middle one for ever, so the vectors are runs of
    /// the first ones' entries, and finitely many.
    fn complete(mut self) -> Vec<Piece> {
        let degree = self.degree;
        let mut pieces = Vec::new();
        while pieces.len() < self.list.len() {
            let ratios = self.list[pieces.len()].clone();
            let mut knots = vec![0.0; 2 * degree];
            // The span itself is [0, 1].
            (degree..2 * degree).for_each(|k| knots[k] = knots[k - 1] + ratios[k - 1]);
            (0..degree - 1).rev().for_each(|k| knots[k] = knots[k + 1] - ratios[k]);
            let doubled = |first: usize| (first..first + 2 * degree - 1).map(|k| ratios[k / 2]).collect();
            let children = [degree - 1, degree].map(|first| self.intern(doubled(first)));
            pieces.push(Piece {
                name: format!("spline of degree {degree} on {}", ratios.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")),
                dimension: degree + 1,
                children: children.into_iter().zip(halves(&knots, degree)).collect(),
                ends: ends(&knots, degree),
                // Greville's abscissae.
                parameters: knots.windows(degree).map(|window| window.iter().sum::<f64>() / degree as f64).collect(),
                // A span lies in the hull of its Bezier points, which are halved by de Casteljau's algorithm.
                hull: Some(Hull {
                    points: SubdivisionOperator::exact(degree + 1, bezier_points(&knots, degree).concat()),
                    children: crate::de_casteljau::operators(degree + 1).to_vec(),
                }),
            });
        }
        pieces
    }
}
