//! The area of one Bezier patch, between bounds whose difference is of third order in the patch's size, relative to it.
//!
//! *Polynomial.* N = S_u x S_v is a polynomial of bidegree (2p - 1, 2q - 1) with coefficients n_k, all basis functions have the same integral, and |N| is convex. So the area, the integral of
//! |N|, lies between the length of the mean of n_k and the mean of their lengths. Let d be the direction of the mean, a = N . d and b = N - a d. Where all n_k . d are positive, and
//! their range is [a_0, a_1],
//!
//!   a + b^2 / (2 a) - b^4 / (8 a^3) <= sqrt(a^2 + b^2) <= a + b^2 / (2 a),
//!
//! whose integrals lie between those of a plus that of b^2 / (2 a_1), less the share max b^2 / (4 a_0^2) of the latter, and of a plus that of b^2 / (2 a_0). The integrals of a and b^2 are known.
//!
//! *Rational*, with points P / w. S_u = (w P_u - w_u P) / w^2, so S_u x S_v = M / w^3 with M = w P_u x P_v - (w_v P_u - w_u P_v) x P, of bidegree (3p - 1, 3q - 1). With w = c (1 + x),
//! M / w^3 = Q / (c^3 g), Q = M (1 - 3 x + 6 x^2), g = (1 + x)^3 (1 - 3 x + 6 x^2) = 1 + 10 x^3 + 15 x^4 + 6 x^5. The factor 1 - 3 x + 6 x^2 is positive, and g' = 30 x^2 (1 + x)^2 is not
//! negative: the area is the integral of |Q| over c^3, over a number between the values of g at the ends of the range of x. Where x has a wide range, M over a number between the cubes of the ends of that of w.
//!
//! *Rounding.* Points are off by lengths that every halving adds to ([`Net::off`]). All that is computed of them is a sum of products, and is off by as many roundings as there are terms, of the largest
//! product of the sizes of its factors ([`super::bernstein`]); and what errors of the points are multiplied by are such products with one size replaced by the error.

use super::bernstein::{Bernstein, Binomials};
use crate::attractor::cell::{ControlPoint, Point, cross, dot};
use crate::de_casteljau::halves;
use crate::measure::Interval;

/// Weights differ by more than this from their middle, as a share of it: then bounds of first order do.
const WIDE: f64 = 0.25;

/// Bezier points on a grid, seen from a point nearby.
#[derive(Clone)]
pub(super) struct Net {
    pub(super) degrees: [usize; 2],
    /// (w x, w y, w z, w), the second index fastest.
    pub(super) points: Vec<ControlPoint>,
    pub(super) rational: bool,
    /// How far (w x, w y, w z), and w, may be off.
    pub(super) off: [f64; 2],
}

fn length(x: &Point) -> f64 {
    dot(x, x).sqrt()
}

fn longest(vectors: &[Point]) -> f64 {
    vectors.iter().map(|x| dot(x, x)).fold(0.0, f64::max).sqrt()
}

fn largest(numbers: &[[f64; 1]]) -> f64 {
    numbers.iter().fold(0.0, |largest, x| largest.max(x[0].abs()))
}

fn middle(a: ControlPoint, b: ControlPoint) -> ControlPoint {
    std::array::from_fn(|axis| 0.5 * (a[axis] + b[axis]))
}

/// Derivatives in both directions, as coefficients: degree times the differences of neighbours.
fn derivatives<const N: usize>([p, q]: [usize; 2], values: &[[f64; N]]) -> [Vec<[f64; N]>; 2] {
    let difference =
        |degree: usize, from: usize, to: usize| std::array::from_fn(|axis| degree as f64 * (values[to][axis] - values[from][axis]));
    let along = (0..p * (q + 1)).map(|k| difference(p, k, k + q + 1)).collect();
    let across = (0..=p).flat_map(|i| (0..q).map(move |j| i * (q + 1) + j)).map(|k| difference(q, k, k + 1)).collect();
    [along, across]
}

/// Coefficients of a vector field, and how far each may be off.
struct Normals {
    field: Bernstein<3>,
    off: f64,
}

impl Net {
    /// The four quarters.
    pub(super) fn quarters(&self) -> [Self; 4] {
        let [p, q] = self.degrees;
        let reach = |range: std::ops::Range<usize>| {
            let size = |point: &ControlPoint| point[range.clone()].iter().map(|x| x * x).sum::<f64>();
            self.points.iter().map(size).fold(0.0, f64::max).sqrt()
        };
        // Every level of de Casteljau's algorithm rounds once.
        let rounding = (p + q) as f64 * f64::EPSILON;
        let off = [self.off[0] + rounding * reach(0..3), self.off[1] + rounding * reach(3..4)];
        let mut rows = [Vec::with_capacity(self.points.len()), Vec::with_capacity(self.points.len())];
        for row in self.points.chunks_exact(q + 1) {
            rows.iter_mut().zip(halves(row, middle)).for_each(|(rows, half)| rows.extend(half));
        }
        let [left, right] = rows.map(|rows| {
            let mut parts = [rows.clone(), rows.clone()];
            for column in 0..=q {
                let points: Vec<ControlPoint> = (0..=p).map(|row| rows[row * (q + 1) + column]).collect();
                for (part, half) in parts.iter_mut().zip(halves(&points, middle)) {
                    half.into_iter().enumerate().for_each(|(row, point)| part[row * (q + 1) + column] = point);
                }
            }
            parts.map(|points| Self { points, off, ..*self })
        });
        let ([a, b], [c, d]) = (left, right);
        [a, b, c, d]
    }

    /// Multiplications that a look at its area takes, about.
    pub(super) fn cost(&self) -> u64 {
        let [p, q] = self.degrees.map(|degree| degree as u64);
        let field = |k: u64| 3 * (k * p * k * q) * (k * p + k * q);
        if self.rational { 30 * p * q * (p + 1) * (q + 1) + 24 * 3 * p * q * (p * q + 4) + field(5) } else { 6 * p * p * q * q + field(2) }
    }

    /// Largest degree of a polynomial that [`Self::area`] forms.
    pub(super) fn most_degree(degree: usize) -> usize {
        2 * (5 * degree)
    }

    /// Its area.
    pub(super) fn area(&self, binomials: &Binomials) -> Interval {
        if self.rational { self.rational_area(binomials) } else { self.polynomial_area(binomials) }
    }

    fn positions(&self) -> Vec<Point> {
        self.points.iter().map(|&[x, y, z, _]| [x, y, z]).collect()
    }

    fn polynomial_area(&self, binomials: &Binomials) -> Interval {
        let [p, q] = self.degrees;
        let [along, across] = derivatives(self.degrees, &self.positions());
        let (u, v) = (longest(&along), longest(&across));
        let [off_u, off_v] = [p, q].map(|degree| 2.0 * degree as f64 * self.off[0]);
        let [along, across] =
            [([p - 1, q], along), ([p, q - 1], across)].map(|(degrees, list)| Bernstein::new(degrees, list.into_iter(), binomials));
        let rounding = (32 * (p + 1) * (q + 1) + 64) as f64 * f64::EPSILON;
        let off = u * off_v + v * off_u + off_u * off_v + rounding * (u + off_u) * (v + off_v);
        Normals { field: along.times(&across, cross), off }.integral(binomials)
    }

    fn rational_area(&self, binomials: &Binomials) -> Interval {
        let [p, q] = self.degrees;
        let weights: Vec<f64> = self.points.iter().map(|point| point[3]).collect();
        let (least, most) = weights.iter().fold((f64::INFINITY, 0.0_f64), |(least, most), &w| (least.min(w), most.max(w)));
        // What errors of weights do to their cubes, and some roundings.
        let share = 8.0 * self.off[1] / least + 64.0 * f64::EPSILON;
        if share.is_nan() || share > 0.1 {
            return Interval { low: 0.0, high: f64::INFINITY };
        }
        let normals = self.rational_normals(binomials);
        let centre = 0.5 * (least + most);
        let [low, high] = [least, most].map(|w| (w - centre) / centre);
        let (inner, divisors) = if high.max(-low) > WIDE {
            (normals.integral(binomials), [most.powi(3), least.powi(3)])
        } else {
            let cube = |x: f64| centre.powi(3) * (1.0 + x * x * x * (10.0 + x * (15.0 + 6.0 * x)));
            let offsets = || weights.iter().map(|w| [(w - centre) / centre]);
            let offset = Bernstein::new([p, q], offsets(), binomials);
            let line = Bernstein::new([p, q], offsets().map(|[x]| [1.0 - 3.0 * x]), binomials);
            let one = Bernstein::new([p, q], offsets().map(|_| [1.0]), binomials);
            let product = |a: &[f64; 1], b: &[f64; 1]| [a[0] * b[0]];
            let factor = line.times(&one, product).plus(6.0, &offset.times(&offset, product));
            let field = normals.field.times(&factor, |n, [x]| n.map(|n| n * x));
            let wide = high.max(-low);
            let size = 1.0 + 3.0 * wide + 6.0 * wide * wide;
            let rounding = (32 * (p + 1) * (q + 1) + 64) as f64 * f64::EPSILON;
            let longest = longest(&normals.field.coefficients(binomials)) + normals.off;
            let off = (normals.off + rounding * longest) * size;
            (Normals { field, off }.integral(binomials), [cube(high), cube(low)])
        };
        Interval { low: inner.low / divisors[0] * (1.0 - share), high: inner.high / divisors[1] * (1.0 + 2.0 * share) }
    }

    /// M.
    fn rational_normals(&self, binomials: &Binomials) -> Normals {
        let [p, q] = self.degrees;
        let (places, weights) = (self.positions(), self.points.iter().map(|point| [point[3]]).collect::<Vec<_>>());
        let ([along, across], [weight_along, weight_across]) = (derivatives([p, q], &places), derivatives([p, q], &weights));
        // Sizes of P, w, P_u, P_v, w_u, w_v, and what they may be off.
        let sizes =
            [longest(&places), largest(&weights), longest(&along), longest(&across), largest(&weight_along), largest(&weight_across)];
        let [off, off_weight] = self.off;
        let [twice_p, twice_q] = [p, q].map(|degree| 2.0 * degree as f64);
        let offs = [off, off_weight, twice_p * off, twice_q * off, twice_p * off_weight, twice_q * off_weight];
        let size = |[place, weight, along, across, weight_along, weight_across]: [f64; 6]| {
            weight * along * across + (weight_across * along + weight_along * across) * place
        };
        let most: [f64; 6] = std::array::from_fn(|k| sizes[k] + offs[k]);
        // What one size gains while the others are as large as they can be.
        let gain = |k: usize| {
            let mut less = most;
            less[k] = 0.0;
            let mut only = most;
            only[k] = offs[k];
            size(only) - size(less)
        };
        let rounding = (128 * (p + 1) * (q + 1) + 256) as f64 * f64::EPSILON;
        let off = (0..6).map(gain).sum::<f64>() + rounding * size(most);
        let vectors = |degrees, list: Vec<Point>| Bernstein::new(degrees, list.into_iter(), binomials);
        let numbers = |degrees, list: Vec<[f64; 1]>| Bernstein::new(degrees, list.into_iter(), binomials);
        let (along, across) = (vectors([p - 1, q], along), vectors([p, q - 1], across));
        let (weight_along, weight_across) = (numbers([p - 1, q], weight_along), numbers([p, q - 1], weight_across));
        let (places, weights) = (vectors([p, q], places), numbers([p, q], weights));
        let scaled = |vector: &Point, [share]: &[f64; 1]| vector.map(|x| x * share);
        let turned = along.times(&weight_across, scaled).plus(-1.0, &weight_along.times(&across, |share, vector| scaled(vector, share)));
        let field = along.times(&across, cross).times(&weights, scaled).plus(-1.0, &turned.times(&places, cross));
        Normals { field, off }
    }
}

impl Normals {
    /// The integral of its length over the square.
    fn integral(&self, binomials: &Binomials) -> Interval {
        let coefficients = self.field.coefficients(binomials);
        let count = coefficients.len() as f64;
        let most = longest(&coefficients);
        let sum = coefficients.iter().fold([0.0; 3], |sum: Point, n| std::array::from_fn(|axis| sum[axis] + n[axis]));
        let lengths = coefficients.iter().map(length).sum::<f64>() / count;
        let mean = sum.map(|x| x / count);
        // Sums of as many terms, and their roots.
        let summing = (count + 16.0) * f64::EPSILON * most;
        let off = self.off + summing;
        let mut found = Interval { low: (length(&mean) - off).max(0.0), high: lengths + off };
        if found.low <= 0.0 {
            return found;
        }
        let size = length(&mean);
        let direction = mean.map(|x| x / size);
        let along: Vec<f64> = coefficients.iter().map(|n| dot(n, &direction)).collect();
        let beside = coefficients.iter().zip(&along).map(|(n, a)| std::array::from_fn(|axis| n[axis] - a * direction[axis]));
        let beside: Vec<Point> = beside.collect();
        // The direction is of length 1 but for rounding.
        let each = self.off + 16.0 * f64::EPSILON * most;
        let (least, largest) = along.iter().fold((f64::INFINITY, 0.0_f64), |(least, largest), &a| (least.min(a), largest.max(a)));
        let (least, largest) = (least - each, largest + each);
        if least <= 0.0 {
            return found;
        }
        let widest = longest(&beside);
        let square = Bernstein::new(self.field.degrees, beside.into_iter(), binomials).mean_square(binomials);
        let rounding = (4.0 * count + 64.0) * f64::EPSILON * widest * widest;
        let [low, high] = [(square - rounding).max(0.0).sqrt() - each, (square + rounding).max(0.0).sqrt() + each];
        let level = along.iter().sum::<f64>() / count;
        let steep = (widest + each) / least;
        let less = (1.0 - 0.25 * steep * steep).max(0.0);
        let low = low.max(0.0);
        found.low = found.low.max(level - off - each + low * low / (2.0 * largest) * less);
        found.high = found.high.min(level + off + each + high * high / (2.0 * least));
        let rounded = 16.0 * f64::EPSILON;
        Interval { low: (found.low * (1.0 - rounded)).max(0.0), high: found.high * (1.0 + rounded) }
    }
}
