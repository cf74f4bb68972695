//! That Bezier volumes are nowhere turned inside out, by the Bernstein coefficients of their Jacobians.
//!
//! Let P = (w x, w y, w z, w) be a volume over the unit cube. With F = (x, y, z) the Jacobian determinant of F is, up to one sign, det (P, P_u, P_v, P_w) / w^4: rows that are
//! multiples of P change nothing, so that (F, 1) and its derivatives may stand for P and its own. The numerator is a polynomial, and lies between its least and its largest Bernstein
//! coefficient. Where these are of both signs, the volume is halved across its longest direction, and de Casteljau's algorithm gives the coefficients of both halves.
//! Where rounding leaves the sign open, as at the axis of a cylinder, it is for others to say whether such a piece matters.

use super::super::cell::{Ball, Point, distance_squared};
use crate::budget::{Budget, Stopped};
use crate::de_casteljau::halves;

/// Points of a polynomial in three directions, the last index fastest.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Net<T> {
    /// Points in every direction.
    size: [usize; 3],
    points: Vec<T>,
}

/// Factors by which coefficients may be off, beside what points are: the determinant has 24 terms, of which each has four factors of at most 2 n.
const TERMS: f64 = 1_000.0;
/// What sums of products lose to rounding, and points of one to the scale of all.
const ROUNDING: f64 = 1e-12;
/// Degrees above this are not looked at: binomials of the determinant's would lose digits.
const MOST_DEGREE: usize = 12;
/// Coefficients that pieces of one volume have together at most: a second.
const MOST_COEFFICIENTS: usize = 20_000_000;

impl<T: Copy> Net<T> {
    pub(super) fn new(size: [usize; 3], points: Vec<T>) -> Self {
        Self { size, points }
    }

    /// By how much the index of a point changes from one to the next along a direction.
    fn stride(&self, along: usize) -> usize {
        self.size[along + 1..].iter().product()
    }

    /// The first points of all lines along a direction.
    fn starts(&self, along: usize) -> impl Iterator<Item = usize> + use<T> {
        let (stride, length) = (self.stride(along), self.size[along]);
        (0..self.points.len()).filter(move |index| index / stride % length == 0)
    }

    /// Both halves along a direction.
    fn halved(&self, along: usize, middle: impl Fn(T, T) -> T) -> [Self; 2] {
        let stride = self.stride(along);
        let mut both = [self.clone(), self.clone()];
        let mut line = Vec::with_capacity(self.size[along]);
        for start in self.starts(along) {
            line.clear();
            line.extend((0..self.size[along]).map(|k| self.points[start + k * stride]));
            for (half, own) in both.iter_mut().zip(halves(&line, &middle)) {
                own.into_iter().enumerate().for_each(|(k, point)| half.points[start + k * stride] = point);
            }
        }
        both
    }
}

impl Net<[f64; 4]> {
    /// The longest way along control points in a direction, in space.
    fn length(&self, along: usize) -> f64 {
        let stride = self.stride(along);
        let of_line = |start: usize| {
            let place = |k: usize| projected(&self.points[start + k * stride]);
            (1..self.size[along]).map(|k| distance_squared(&place(k - 1), &place(k)).sqrt()).sum::<f64>()
        };
        self.starts(along).map(of_line).fold(0.0, f64::max)
    }

    /// A ball around it: weights are above 0.
    fn ball(&self) -> Ball {
        let places: Vec<Point> = self.points.iter().map(projected).collect();
        let [mut low, mut high] = [places[0]; 2];
        for place in &places {
            low = std::array::from_fn(|k| low[k].min(place[k]));
            high = std::array::from_fn(|k| high[k].max(place[k]));
        }
        let centre: Point = std::array::from_fn(|k| 0.5 * (low[k] + high[k]));
        let radius = places.iter().map(|place| distance_squared(place, &centre)).fold(0.0, f64::max).sqrt();
        Ball { centre, radius: radius * (1.0 + ROUNDING) }
    }
}

fn projected(point: &[f64; 4]) -> Point {
    std::array::from_fn(|k| point[k] / point[3])
}

/// A Bezier volume with the Bernstein coefficients of its Jacobian, up to a positive factor.
#[derive(Clone, Debug)]
pub(super) struct Volume {
    points: Net<[f64; 4]>,
    jacobian: Net<f64>,
    /// Coefficients may be off by this.
    off: f64,
}

impl Volume {
    /// None where degrees are too high, weights are not above 0, or all of it is one point. `miss` is what the points' weights in sums are off by.
    ///
    /// Cost: the square of eight times as many points.
    pub(super) fn new(points: Net<[f64; 4]>, miss: f64) -> Option<Self> {
        let is_weighted = |point: &[f64; 4]| point[3] > 0.0 && point.iter().all(|x| x.is_finite());
        if !points.size.iter().all(|size| (2..=MOST_DEGREE + 1).contains(size)) || !points.points.iter().all(is_weighted) {
            return None;
        }
        let Ball { centre, radius } = points.ball();
        let heaviest = points.points.iter().map(|point| point[3]).fold(0.0, f64::max);
        // Entries of at most 1: places as seen from the middle, and weights as shares of the largest.
        let seen = |point: &[f64; 4]| {
            let weight = point[3] / heaviest;
            let place: Point = std::array::from_fn(|k| (point[k] / heaviest - weight * centre[k]) / radius);
            [place[0], place[1], place[2], weight]
        };
        let seen = Net::new(points.size, points.points.iter().map(seen).collect());
        let farthest = centre.iter().fold(0.0_f64, |most, x| most.max(x.abs())) + radius;
        let degrees: f64 = points.size.iter().map(|&size| size as f64).product();
        let off = TERMS * degrees * (miss * points.points.len() as f64 + ROUNDING) * (farthest / radius);
        Some(Self { jacobian: jacobian(&seen), points, off }).filter(|volume| volume.off.is_finite())
    }

    /// Whether pieces on which the Jacobian is not proven to have the sign are all of no matter: it is asked of balls around them whether they are, or never will be, or their halves may.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn keeps_sign(self, sign: f64, matters_not: impl Fn(&Ball) -> Option<bool>, budget: &Budget) -> Result<bool, Stopped> {
        let mut left = MOST_COEFFICIENTS / self.jacobian.points.len();
        let mut pieces = vec![self];
        while let Some(piece) = pieces.pop() {
            budget.cancel.check()?;
            if piece.jacobian.points.iter().all(|&coefficient| sign * coefficient > piece.off) {
                continue;
            }
            match matters_not(&piece.points.ball()) {
                Some(true) => {}
                None if left > 0 => {
                    left -= 1;
                    pieces.extend(piece.halves());
                }
                _ => return Ok(false),
            }
        }
        Ok(true)
    }

    fn halves(&self) -> [Self; 2] {
        let lengths = [0, 1, 2].map(|along| self.points.length(along));
        let along = (1..3).fold(0, |longest, along| if lengths[along] > lengths[longest] { along } else { longest });
        let points = self.points.halved(along, |a, b| std::array::from_fn(|k| 0.5 * (a[k] + b[k])));
        let [first, second] = self.jacobian.halved(along, |a, b| 0.5 * (a + b));
        let [start, end] = points;
        [Self { points: start, jacobian: first, off: self.off }, Self { points: end, jacobian: second, off: self.off }]
    }

    /// 1 or -1 as most of it is turned.
    pub(super) fn sign(&self) -> f64 {
        self.jacobian.points.iter().sum::<f64>().signum()
    }
}

/// A polynomial in three directions: its Bernstein coefficients times the binomials, so that products are convolutions.
#[derive(Clone)]
struct Polynomial {
    size: [usize; 3],
    terms: Vec<f64>,
}

impl Polynomial {
    fn scaled(size: [usize; 3], coefficients: impl Iterator<Item = f64>) -> Self {
        let terms = coefficients.zip(binomials(size)).map(|(coefficient, binomial)| coefficient * binomial).collect();
        Self { size, terms }
    }

    /// Adds a multiple of the product of two others.
    fn add(&mut self, factor: f64, a: &Self, b: &Self) {
        let row = self.size[2];
        for (i, &x) in a.terms.iter().enumerate().filter(|(_, x)| **x != 0.0) {
            let place = |size: &[usize; 3], index: usize| [index / (size[1] * size[2]), index / size[2] % size[1], index % size[2]];
            let [i0, i1, i2] = place(&a.size, i);
            for (j, others) in b.terms.chunks(b.size[2]).enumerate() {
                let first = ((i0 + j / b.size[1]) * self.size[1] + i1 + j % b.size[1]) * row + i2;
                for (sum, y) in self.terms[first..].iter_mut().zip(others) {
                    *sum += factor * x * y;
                }
            }
        }
    }

    /// Products of two: their degrees add up.
    fn none(a: [usize; 3], b: [usize; 3]) -> Self {
        let size: [usize; 3] = std::array::from_fn(|k| a[k] + b[k] - 1);
        Self { size, terms: vec![0.0; size.iter().product()] }
    }
}

/// The products of binomials by which coefficients are multiplied, in order.
fn binomials(size: [usize; 3]) -> impl Iterator<Item = f64> {
    let [a, b, c] = size.map(|size| {
        let next = |last: &mut (f64, usize)| {
            let (value, k) = *last;
            *last = (value * (size - 1 - k) as f64 / (k + 1) as f64, k + 1);
            value
        };
        let mut state = (1.0, 0);
        (0..size).map(|_| next(&mut state)).collect::<Vec<f64>>()
    });
    a.into_iter().flat_map(move |x| {
        let c = c.clone();
        b.clone().into_iter().flat_map(move |y| c.clone().into_iter().map(move |z| x * y * z))
    })
}

/// Pairs of columns, and the sign of each with the pair of the others.
const PAIRS: [([usize; 2], [usize; 2], f64); 6] = [
    ([0, 1], [2, 3], 1.0),
    ([0, 2], [1, 3], -1.0),
    ([0, 3], [1, 2], 1.0),
    ([1, 2], [0, 3], 1.0),
    ([1, 3], [0, 2], -1.0),
    ([2, 3], [0, 1], 1.0),
];

/// -det (P, P_u, P_v, P_w), which is the Jacobian determinant where all weights are 1, by pairs of rows (Laplace).
fn jacobian(net: &Net<[f64; 4]>) -> Net<f64> {
    let whole: [Polynomial; 4] = std::array::from_fn(|k| Polynomial::scaled(net.size, net.points.iter().map(|point| point[k])));
    let [u, v, w] = [0, 1, 2].map(|along| derivatives(net, along));
    let minor = |a: &[Polynomial; 4], b: &[Polynomial; 4], [i, j]: [usize; 2]| {
        let mut minor = Polynomial::none(a[0].size, b[0].size);
        minor.add(1.0, &a[i], &b[j]);
        minor.add(-1.0, &a[j], &b[i]);
        minor
    };
    let minors = PAIRS.map(|(own, others, sign)| (minor(&whole, &u, own), minor(&v, &w, others), sign));
    let mut sum = Polynomial::none(minors[0].0.size, minors[0].1.size);
    minors.iter().for_each(|(a, b, sign)| sum.add(-sign, a, b));
    let size = sum.size;
    Net { size, points: sum.terms.into_iter().zip(binomials(size)).map(|(term, binomial)| term / binomial).collect() }
}

/// The derivatives of all four coordinates in a direction.
fn derivatives(net: &Net<[f64; 4]>, along: usize) -> [Polynomial; 4] {
    let (stride, length) = (net.stride(along), net.size[along]);
    let mut size = net.size;
    size[along] = (length - 1).max(1);
    let starts: Vec<usize> = (0..net.points.len()).filter(|index| index / stride % length < length - 1).collect();
    std::array::from_fn(|k| {
        let difference = |&start: &usize| (length - 1) as f64 * (net.points[start + stride][k] - net.points[start][k]);
        Polynomial::scaled(size, starts.iter().map(difference))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split_mix::Random;

    /// A net by chance near the unit cube's, with these degrees and weights.
    fn net(degrees: [usize; 3], shaken: f64, weight: impl Fn(&mut Random) -> f64, random: &mut Random) -> Net<[f64; 4]> {
        let size = degrees.map(|degree| degree + 1);
        let point = |index: usize| {
            let place = [index / (size[1] * size[2]), index / size[2] % size[1], index % size[2]];
            let weight = weight(random);
            let at = |k: usize, random: &mut Random| weight * (place[k] as f64 / degrees[k] as f64 + shaken * (random.share() - 0.5));
            [at(0, random), at(1, random), at(2, random), weight]
        };
        Net::new(size, (0..size.iter().product()).map(point).collect())
    }

    fn bernstein(n: usize, k: usize, t: f64) -> f64 {
        let binomial = (0..k).fold(1.0, |value, i| value * (n - i) as f64 / (i + 1) as f64);
        binomial * t.powi(k as i32) * (1.0 - t).powi((n - k) as i32)
    }

    fn value(size: [usize; 3], at: [f64; 3], coefficient: impl Fn(usize) -> f64) -> f64 {
        let of = |index: usize| {
            let place = [index / (size[1] * size[2]), index / size[2] % size[1], index % size[2]];
            (0..3).map(|k| bernstein(size[k] - 1, place[k], at[k])).product::<f64>()
        };
        (0..size.iter().product()).map(|index| coefficient(index) * of(index)).sum()
    }

    /// The determinant agrees with that of differences of places, for weights of 1 and others.
    #[test]
    fn the_jacobian_is_that_of_the_map() {
        let mut random = Random(4);
        for case in 0..12 {
            let degrees = [[1, 1, 1], [3, 2, 1], [2, 2, 3]][case % 3];
            let weight = |random: &mut Random| if case < 6 { 1.0 } else { 0.5 + random.share() };
            let net = net(degrees, 1.0, weight, &mut random);
            let (found, size) = (jacobian(&net), net.size);
            for _ in 0..10 {
                let at: [f64; 3] = std::array::from_fn(|_| 0.1 + 0.8 * random.share());
                let w = value(size, at, |index| net.points[index][3]);
                let place = |at: [f64; 3]| {
                    let p: [f64; 4] = std::array::from_fn(|k| value(size, at, |index| net.points[index][k]));
                    glam::DVec3::from_array(projected(&p))
                };
                let [u, v, w3] = [0, 1, 2].map(|k| {
                    let step = |by: f64| place(std::array::from_fn(|j| at[j] + if j == k { by } else { 0.0 }));
                    (step(1e-5) - step(-1e-5)) / 2e-5
                });
                let (expected, own) = (u.dot(v.cross(w3)) * w.powi(4), value(found.size, at, |index| found.points[index]));
                assert!((expected - own).abs() < 1e-6 * (1.0 + expected.abs()), "{case}: {expected} {own}");
            }
        }
    }

    #[test]
    fn only_volumes_that_are_not_folded_are_turned() {
        let mut random = Random(5);
        let told = |net: Net<[f64; 4]>, sign: f64| {
            let volume = Volume::new(net, 0.0).unwrap();
            assert!(volume.sign() == 1.0);
            volume.keeps_sign(sign, |ball| (ball.radius < 1e-2).then_some(true), &Budget::default()).unwrap()
        };
        let mut turned = 0;
        for case in 0..20 {
            let good = net([2, 1, 2], 0.3, |random| 0.8 + 0.4 * random.share(), &mut random);
            turned += u32::from(told(good, 1.0));
            // One corner pushed through the opposite side of the cube: the Jacobian is below 0 beside it.
            let mut folded = net([1, 1, 1], 0.1, |_| 1.0, &mut random);
            folded.points[7][case % 3] = -1.0;
            let volume = Volume::new(folded, 0.0).unwrap();
            assert!(!volume.keeps_sign(1.0, |ball| (ball.radius < 1e-4).then_some(false), &Budget::default()).unwrap());
        }
        assert!(turned >= 18, "{turned}");
    }

    /// At the axis the Jacobian is 0: pieces there are left to others, and few.
    #[test]
    fn an_axis_is_left_to_others() {
        let root = 0.5_f64.sqrt();
        let arc = [[1.0, 0.0, 1.0], [root, root, root], [0.0, 1.0, 1.0]];
        let point = |index: usize| {
            let ([x, y, w], radius, height) = (arc[index / 4], (index / 2 % 2) as f64, (index % 2) as f64);
            [radius * x, radius * y, 10.0 * height * w, w]
        };
        let volume = Volume::new(Net::new([3, 2, 2], (0..12).map(point).collect()), 1e-15).unwrap();
        let asked = std::cell::Cell::new(0);
        let is_at_axis = |ball: &Ball| {
            let [x, y, _] = ball.centre;
            let matters_not = ball.radius < 0.05 && x.hypot(y) < 0.1;
            asked.set(asked.get() + 1);
            matters_not.then_some(true)
        };
        let sign = volume.sign();
        assert!(volume.keeps_sign(sign, is_at_axis, &Budget::default()).unwrap());
        assert!(asked.get() < 5_000, "{}", asked.get());
    }
}
