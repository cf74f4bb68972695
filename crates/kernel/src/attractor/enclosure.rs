//! Coordinate boxes that hold the attractors of curves whose operators have negative entries, and products of them.
//!
//! The margin of `bound` is a share of all by which a functional's values at the control points differ, also of what is linear along the curve, and the
//! margins of a product's factors multiply. Coordinates tell more. Let t be a curve's parameter, a row of values at its control points, a and b the
//! points nearest to its ends, and y_k the barycentric coordinates of all others. With t and y_k the coordinates of a and b are known too, as those of a
//! point sum to 1 and give t. Let t and each y_k lie in an interval over the attractor. Then x = G z for every point x of it, where z_0 = 1 and
//! |z_k| <= 1: column 0 of G is the point in the middle of all intervals, and column k what half of interval k adds to it. So c . x is within
//! sum_k>0 |v_k| of v_0, v = c^T G. Nothing is asked of the row t; where the curve is nearly linear in it, the box is flat.
//!
//! *Products*, of boxes and of hulls: points are G z x H p, p in a simplex, so that c . x is a mean of what it is at the points of H; at each of these,
//! |z_k| <= 1 and the same for products of several z.
//!
//! *Intervals.* The largest value of a row over the attractor is bounded best cell first, by the margins, until those of the best cell say it to a
//! hundredth: whenever this ends, no cell may be higher. Of curves that contract slowly it ends before, and the interval is wide.

use super::cell::Point;
use super::{Attractor, StateBound};
use crate::automaton::{LeafPrimitive, StateId, SubdivisionOperator};
use crate::order::ordered_by;
use std::collections::BinaryHeap;

/// Control points at most of a curve that is examined.
const MOST_POINTS: usize = 16;
/// Points of a product's hulls at most, and as many as most have.
const MOST_GROUPS: usize = 64;
const FEW_GROUPS: usize = 8;
/// Intervals are as wide as they need be and this share more, of the row's largest entry.
const ACCURACY: f64 = 0.01;
/// Cells that are split at most, for each end of an interval.
const SPLITS: usize = 500;
/// Covers what is rounded of intervals and of G, relative to entries: a few hundred roundings.
const ROUNDING: f64 = 1e-13;

/// What holds the attractor of a state.
#[derive(Clone, Debug)]
pub(crate) struct Enclosure {
    /// G, or the product of some G and H: functionals are seen by their values at its columns.
    pub(crate) columns: SubdivisionOperator,
    /// The point of the hulls that each column belongs to, and whether it is the middle there.
    places: Vec<(u32, bool)>,
    groups: usize,
    /// Points of the attractor are within this of what the columns say, in the sum of coordinates.
    pub(crate) miss: f64,
}

impl Enclosure {
    /// The product of boxes and hulls; none where there are too many points of the latter.
    fn of(parts: Vec<Part>) -> Option<Self> {
        let (mut factors, mut places, mut groups, mut sizes) = (Vec::new(), vec![(0, true)], 1, [1.0; 2]);
        for Part { columns, is_box, size, miss } in parts {
            let count = columns.columns();
            let pair = |&(group, is_middle): &(u32, bool), k: usize| {
                if is_box { (group, is_middle && k == 0) } else { (group * count as u32 + k as u32, is_middle) }
            };
            places = places.iter().flat_map(|first| (0..count).map(move |k| pair(first, k))).collect();
            groups *= if is_box { 1 } else { count };
            if groups > MOST_GROUPS {
                return None;
            }
            sizes = [sizes[0] * size, sizes[1] * (size + miss)];
            factors.push(columns);
        }
        let columns = if factors.len() == 1 { factors.pop()? } else { SubdivisionOperator::product(factors) };
        Some(Self { columns, places, groups, miss: sizes[1] - sizes[0] })
    }

    /// The hull of segments, each given by its middle and what leads from there to an end.
    pub(super) fn of_segments(segments: &[[Vec<f64>; 2]]) -> Self {
        let rows = segments.first().map_or(0, |[middle, _]| middle.len());
        let columns = SubdivisionOperator::exact(rows, segments.as_flattened().concat());
        let places = (0..segments.len() as u32).flat_map(|group| [(group, true), (group, false)]).collect();
        Self { columns, places, groups: segments.len(), miss: 0.0 }
    }

    /// A box of the vectors that an affine map takes the attractor to, given by those that it takes the columns to.
    pub(super) fn box_of(&self, seen: &[Point]) -> [Point; 2] {
        if self.groups <= FEW_GROUPS { self.box_of_groups::<FEW_GROUPS>(seen) } else { self.box_of_groups::<MOST_GROUPS>(seen) }
    }

    /// The same, with as many groups as `N` at most.
    #[inline]
    fn box_of_groups<const N: usize>(&self, seen: &[Point]) -> [Point; 2] {
        let (mut middles, mut reaches) = ([[0.0; 3]; N], [[0.0; 3]; N]);
        for (&(group, is_middle), value) in self.places.iter().zip(seen) {
            if is_middle {
                middles[group as usize] = *value;
            } else {
                reaches[group as usize].iter_mut().zip(value).for_each(|(reach, x)| *reach += x.abs());
            }
        }
        let [mut low, mut high] = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for (middle, reach) in middles.iter().zip(&reaches).take(self.groups) {
            low = std::array::from_fn(|k| low[k].min(middle[k] - reach[k]));
            high = std::array::from_fn(|k| high[k].max(middle[k] + reach[k]));
        }
        [low, high]
    }

    /// Bounds of c . x over the attractor, c being given by its values at the columns.
    pub(crate) fn range(&self, seen: impl Iterator<Item = f64>) -> [f64; 2] {
        if self.groups == 1 {
            // The middle comes first.
            let (mut middle, mut reach) = (0.0, 0.0);
            for (k, value) in seen.enumerate() {
                if k == 0 { middle = value } else { reach += f64::abs(value) }
            }
            return [middle - reach, middle + reach];
        }
        if self.groups <= FEW_GROUPS { self.range_of_groups::<FEW_GROUPS>(seen) } else { self.range_of_groups::<MOST_GROUPS>(seen) }
    }

    /// The same, with as many groups as `N` at most.
    #[inline]
    fn range_of_groups<const N: usize>(&self, seen: impl Iterator<Item = f64>) -> [f64; 2] {
        let (mut middles, mut reaches) = ([0.0; N], [0.0; N]);
        for (&(group, is_middle), value) in self.places.iter().zip(seen) {
            if is_middle {
                middles[group as usize] = value;
            } else {
                reaches[group as usize] += f64::abs(value);
            }
        }
        let ends = middles.iter().zip(&reaches).take(self.groups);
        ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], (middle, reach)| [low.min(middle - reach), high.max(middle + reach)])
    }
}

/// The box of a curve, or the product of those of its factors and of the hulls of others; none for states that are frames or in the hull of their control
/// points, and for those of which no parameters are known.
pub(super) fn enclosure(attractor: &Attractor, id: StateId) -> Option<Enclosure> {
    if attractor.bound(id).margin() == 0.0 {
        return None;
    }
    match attractor.automaton().factors(id) {
        [] => Enclosure::of(vec![Part { columns: coordinate_box(attractor, id)?, is_box: true, size: 1.0, miss: 0.0 }]),
        factors => of_product(attractor, factors),
    }
}

/// The product of the boxes of curves and the hulls of others, whether or not it is a state.
pub(super) fn of_product(attractor: &Attractor, factors: &[StateId]) -> Option<Enclosure> {
    let part = |&factor: &StateId| {
        let margin = attractor.bound(factor).margin();
        let is_box = margin > 0.0;
        // Kept: all products that a curve is a factor of see it by the same box.
        let (columns, miss) = if is_box { (attractor.enclosure(factor)?.columns.clone(), 0.0) } else { hull(attractor, factor) };
        Some(Part { columns, is_box, size: 1.0 + 2.0 * margin, miss })
    };
    Enclosure::of(factors.iter().map(part).collect::<Option<_>>()?)
}

/// What holds the attractor of a factor.
struct Part {
    columns: SubdivisionOperator,
    is_box: bool,
    /// |x|_1 of its points, and how far these may be outside, in the sum of coordinates.
    size: f64,
    miss: f64,
}

/// Points in whose hull the attractor of a factor lies, and by how much it may be outside, in the sum of coordinates.
pub(super) fn hull(attractor: &Attractor, id: StateId) -> (SubdivisionOperator, f64) {
    let own = attractor.hull(id).and_then(|own| Some((own.points.clone()?, own.miss)));
    own.unwrap_or_else(|| (SubdivisionOperator::identity(attractor.automaton().state(id).dimension), 0.0))
}

/// G of a curve.
fn coordinate_box(attractor: &Attractor, id: StateId) -> Option<SubdivisionOperator> {
    let state = attractor.automaton().state(id);
    let n = state.dimension;
    let LeafPrimitive::Chord(ends) = &state.leaf else { return None };
    if !(3..=MOST_POINTS).contains(&n) {
        return None;
    }
    let parameter: Vec<f64> = attractor.precision(id)?.parameters.iter().map(|own| own[0]).collect();
    let nearest = |end: &[f64], but: usize| (0..n).filter(|&k| k != but).max_by(|&j, &k| end[j].total_cmp(&end[k]));
    let a = nearest(&ends.start, n)?;
    let b = nearest(&ends.end, a)?;
    let between = parameter[b] - parameter[a];
    if between == 0.0 || !between.is_finite() {
        return None;
    }
    // t, then the y_k.
    let others: Vec<usize> = (0..n).filter(|&k| k != a && k != b).collect();
    let unit = |k: &usize| (0..n).map(|j| f64::from(u8::from(j == *k))).collect::<Vec<f64>>();
    let rows = std::iter::once(parameter.clone()).chain(others.iter().map(unit));
    let intervals: Vec<[f64; 2]> = rows.map(|row| interval(attractor, id, &row)).collect::<Option<_>>()?;
    let middle = |k: usize| 0.5 * (intervals[k][0] + intervals[k][1]);
    let mut columns = vec![vec![0.0; n]; n];
    // x_a + x_b = 1 - sum of y_k, and t_a x_a + t_b x_b = t - sum of t_k y_k.
    let (mut sum, mut rest) = (1.0, middle(0));
    for (index, &k) in others.iter().enumerate() {
        let (y, half) = (middle(index + 1), half_width(&intervals[index + 1], 1.0));
        columns[0][k] = y;
        sum -= y;
        rest -= parameter[k] * y;
        let share = (parameter[k] - parameter[a]) / between;
        (columns[index + 2][k], columns[index + 2][a], columns[index + 2][b]) = (half, half * (share - 1.0), -half * share);
    }
    columns[0][b] = (rest - parameter[a] * sum) / between;
    columns[0][a] = sum - columns[0][b];
    let half = half_width(&intervals[0], between) / between;
    (columns[1][a], columns[1][b]) = (-half, half);
    Some(SubdivisionOperator::exact(n, columns.concat()))
}

fn half_width(interval: &[f64; 2], scale: f64) -> f64 {
    0.5 * (interval[1] - interval[0]) + ROUNDING * (interval[0].abs() + interval[1].abs() + scale.abs())
}

/// Bounds of a row's values over the attractor of a state.
fn interval(attractor: &Attractor, id: StateId, row: &[f64]) -> Option<[f64; 2]> {
    let opposite: Vec<f64> = row.iter().map(|value| -value).collect();
    let wanted = ACCURACY * row.iter().map(|x| x.abs()).fold(0.0, f64::max);
    Some([-highest(attractor, id, &opposite, wanted)?, highest(attractor, id, row, wanted)?])
}

struct Cell {
    low: f64,
    high: f64,
    state: StateId,
    values: Vec<f64>,
}

ordered_by!(Cell, |this, other| this.high.total_cmp(&other.high));

/// Bounds a row's largest value from above.
fn highest(attractor: &Attractor, id: StateId, row: &[f64], wanted: f64) -> Option<f64> {
    let cell = |state: StateId, values: Vec<f64>, most: f64| {
        let bound @ StateBound::Hull { .. } = attractor.bound(state) else { return None };
        let [low, high] = bound.range(&values);
        Some(Cell { low, high: most.min(high), state, values })
    };
    let mut heap = BinaryHeap::from([cell(id, row.to_vec(), f64::INFINITY)?]);
    for _ in 0..SPLITS {
        let best = heap.pop()?;
        let transitions = &attractor.automaton().state(best.state).transitions;
        if best.high - best.low <= wanted || transitions.is_empty() {
            return Some(best.high);
        }
        for transition in transitions {
            heap.push(cell(transition.to, transition.operator.pull_back(&best.values), best.high)?);
        }
    }
    heap.pop().map(|best| best.high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{ControlNet, CurveScheme, Model, Shape, TensorProduct};
    use crate::split_mix::Random;
    use glam::DVec3;

    /// A product of two schemes on five by four points.
    fn product(schemes: [CurveScheme; 2]) -> Attractor {
        let points = (0..20).map(|k| DVec3::new(f64::from(k / 4), f64::from(k % 4), f64::from(k * 7 % 5)));
        let control_points = ControlNet { size: vec![5, 4], points: points.collect(), weights: None };
        let shape = Shape::TensorProduct(TensorProduct { schemes: schemes.to_vec(), control_points, separate: true, trim: None });
        Model { name: None, shape }.lower().unwrap().attractor
    }

    #[test]
    fn points_of_the_attractor_are_within() {
        let fractal = |scaling: &[f64]| CurveScheme::Interpolation { vertical_scaling: scaling.to_vec() };
        let spline = CurveScheme::Nurbs { degree: 3, knots: vec![0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0] };
        let mut random = Random(11);
        for schemes in [[fractal(&[0.5, -0.7, 0.3, 0.6]), fractal(&[-0.6, 0.5, 0.6])], [fractal(&[0.5, -0.7, 0.3, 0.6]), spline]] {
            let attractor = product(schemes);
            let root = attractor.roots()[0].state;
            let enclosure = attractor.enclosure(root).unwrap();
            let n = attractor.automaton().state(root).dimension;
            let mut fullest = 0.0_f64;
            for _ in 0..40 {
                let functional: Vec<f64> = (0..n).map(|_| random.next() as f64 / u64::MAX as f64 - 0.5).collect();
                let seen = enclosure.columns.pull_back(&functional);
                let [low, high] = enclosure.range(seen.iter().copied());
                let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
                for _ in 0..500 {
                    let (mut state, mut values) = (root, functional.clone());
                    for _ in 0..25 {
                        let transitions = &attractor.automaton().state(state).transitions;
                        let step = &transitions[(random.next() % transitions.len() as u64) as usize];
                        (state, values) = (step.to, step.operator.pull_back(&values));
                    }
                    // What is left of the path: cells of 0.7^25 of the size.
                    let value = values[0];
                    (least, most) = (least.min(value), most.max(value));
                }
                assert!(low - 0.05 <= least && most <= high + 0.05, "[{least}, {most}] is not in [{low}, {high}]");
                fullest = fullest.max((most - least) / (high - low));
            }
            // A box that says nothing would pass too.
            assert!(fullest > 0.1, "{fullest}");
        }
    }

    #[test]
    fn the_search_is_as_good_as_all_cells() {
        // Row t of a curve through equidistant points: the interval [0, 1], to a hundredth.
        let line = CurveScheme::Nurbs { degree: 1, knots: vec![0.0, 0.0, 1.0, 2.0, 3.0, 3.0] };
        let attractor = product([CurveScheme::Interpolation { vertical_scaling: vec![0.5, -0.7, 0.3, 0.6] }, line]);
        let curve = attractor.automaton().factors(attractor.roots()[0].state)[0];
        let [low, high] = interval(&attractor, curve, &[0.0, 0.25, 0.5, 0.75, 1.0]).unwrap();
        assert!((-ACCURACY..=0.0).contains(&low) && (1.0..=1.0 + ACCURACY).contains(&high), "[{low}, {high}]");
    }
}
