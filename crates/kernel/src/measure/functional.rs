//! Functionals on the barycentric spaces of states, and their bounds on the attractors.

use crate::attractor::cell::{ControlPoint, Point, dot};
use crate::attractor::{AttainedPoint, StateBound, extremes};
use crate::automaton::{PullBack, SubdivisionOperator};
use crate::de_casteljau::halves;

/// x -> (values . x) / (weights . x) on a barycentric space; without weights, values . x.
#[derive(Clone)]
pub(super) struct Functional {
    pub(super) values: Vec<f64>,
    pub(super) weights: Option<Vec<f64>>,
}

impl Functional {
    /// x . direction + offset, as seen from a cell with these control points.
    pub(super) fn of(points: &[ControlPoint], rational: bool, direction: &Point, offset: f64) -> Self {
        let value = |point: &ControlPoint| {
            let weight = if rational { point[3] } else { 1.0 };
            dot(direction, &[point[0], point[1], point[2]]) + offset * weight
        };
        Self { values: points.iter().map(value).collect(), weights: rational.then(|| points.iter().map(|point| point[3]).collect()) }
    }

    /// As seen from the child with this operator.
    pub(super) fn pulled_back(&self, operator: &SubdivisionOperator) -> Self {
        Self { values: operator.pull_back(&self.values), weights: self.weights.as_ref().map(|weights| operator.pull_back(weights)) }
    }

    /// To be seen from several children.
    pub(super) fn for_children(&self) -> ForChildren<'_> {
        ForChildren { values: PullBack::new(&self.values), weights: self.weights.as_deref().map(PullBack::new) }
    }

    pub(super) fn at(&self, point: &[f64]) -> f64 {
        let sum = |factors: &[f64]| factors.iter().zip(point).map(|(factor, x)| factor * x).sum::<f64>();
        self.weights.as_ref().map_or(sum(&self.values), |weights| sum(&self.values) / sum(weights))
    }

    /// Its value at a point that is given by its coordinates other than 0.
    pub(super) fn at_shares(&self, shares: &[(usize, f64)]) -> f64 {
        let sum = |factors: &[f64]| shares.iter().map(|&(index, share)| share * factors[index]).sum::<f64>();
        self.weights.as_ref().map_or(sum(&self.values), |weights| sum(&self.values) / sum(weights))
    }

    /// What it is at least at a point of the attractor that is so near: let y be that point and v the value at x. Then that at y is
    /// v + (values - v weights) . (y - x) / (weights . y), and y - x sums to 0.
    pub(super) fn near(&self, near: &AttainedPoint) -> f64 {
        let value = self.at(&near.point);
        let ([least, most], weight) = match &self.weights {
            None => (extremes(self.values.iter().copied()), 1.0),
            Some(weights) => {
                let differences = self.values.iter().zip(weights).map(|(own, weight)| own - value * weight);
                (extremes(differences), extremes(weights.iter().copied())[0])
            }
        };
        value - 0.5 * near.off * (most - least) / weight
    }

    /// Whether this one's supremum h on a state's attractor is at most max(reached, that of `other` + slack): the slack, if it is within what is allowed.
    pub(super) fn slack_under(
        &self,
        other: &Self,
        bound: &StateBound,
        reached: f64,
        ceiling: f64,
        allowed: f64,
        difference: &mut Vec<f64>,
    ) -> Option<f64> {
        difference.clear();
        match (&self.weights, &other.weights) {
            (None, None) => {
                difference.extend(other.values.iter().zip(&self.values).map(|(other, own)| other - own));
                let lower = bound.range(difference)[0];
                (lower >= -allowed).then_some((-lower).max(0.0))
            }
            // With t = max(reached, h(other) + e) for e = `allowed`, suppose h > t, which is between `reached` and `ceiling`: somewhere
            // (values - t weights) . x > 0. If this is at most a positive multiple of the other's (values - (t - e) weights) . x, then h(other) > t - e,
            // which it is not. Both are linear in t, so that the ends of t tell; barycentric coordinates are not negative here, so that each tells.
            (Some(own_weights), Some(other_weights)) if reached.is_finite() => {
                let scale = own_weights.iter().sum::<f64>() / other_weights.iter().sum::<f64>();
                let holds = |t: f64| {
                    let mut all = self.values.iter().zip(own_weights).zip(other.values.iter().zip(other_weights));
                    all.all(|((value, weight), (other, other_weight))| value - t * weight <= scale * (other - (t - allowed) * other_weight))
                };
                (holds(reached) && holds(ceiling)).then_some(allowed)
            }
            _ => None,
        }
    }

    /// Whether it rises everywhere towards a side of a Bezier patch, by `least` from each point to the next: towards the low
    /// and the high end of u, and of v; its values are counted where they are in `levels`. With f = N / w the derivative of
    /// f has the sign of that of N - t w at points where f = t, which is linear in t, and its Bezier points are differences
    /// of neighbouring ones.
    pub(super) fn rises(&self, orders: [usize; 2], levels: [f64; 2], least: f64) -> [[bool; 2]; 2] {
        let columns = orders[1];
        let least = least * self.weights.as_ref().map_or(1.0, |weights| extremes(weights.iter().copied())[1]);
        let mut rises = [[true; 2]; 2];
        for (k, stride) in [columns, 1].into_iter().enumerate() {
            for index in (0..self.values.len())
                .filter(|index| if k == 0 { index + columns < self.values.len() } else { index % columns + 1 < columns })
            {
                for level in levels {
                    let level_at = |index: usize| self.weights.as_ref().map_or(0.0, |weights| level * weights[index]);
                    let step = self.values[index + stride] - self.values[index] - (level_at(index + stride) - level_at(index));
                    rises[k][0] &= -step > least;
                    rises[k][1] &= step > least;
                }
            }
            // A single point does not rise.
            rises[k] = rises[k].map(|rises| rises && orders[k] > 1);
        }
        rises
    }

    /// The halves of a Bezier curve, by de Casteljau's algorithm.
    pub(super) fn halves(&self) -> [Self; 2] {
        let halves = |points: &[f64]| halves(points, |a, b| 0.5 * (a + b));
        let [first, second] = halves(&self.values);
        let [first_weights, second_weights] = self.weights.as_ref().map_or([None, None], |weights| halves(weights).map(Some));
        [Self { values: first, weights: first_weights }, Self { values: second, weights: second_weights }]
    }

    /// Bounds of its values on a state's attractor.
    pub(super) fn range(&self, bound: &StateBound) -> [f64; 2] {
        match &self.weights {
            None => bound.range(&self.values),
            // Operators without negative entries, and positive weights: a mean of the control points' quotients.
            Some(weights) => extremes(self.values.iter().zip(weights).map(|(value, weight)| value / weight)),
        }
    }
}

/// A functional on the way to a cell's children.
pub(super) struct ForChildren<'a> {
    values: PullBack<'a>,
    weights: Option<PullBack<'a>>,
}

impl<'a> ForChildren<'a> {
    /// As seen from the child with this operator.
    pub(super) fn pulled_back(&mut self, operator: &'a SubdivisionOperator) -> Functional {
        Functional { values: self.values.by(operator), weights: self.weights.as_mut().map(|weights| weights.by(operator)) }
    }
}
