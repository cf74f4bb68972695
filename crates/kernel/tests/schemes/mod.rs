//! What tests of curve schemes share: a random generator, shapes, walks down an automaton, de Boor's algorithm.
#![allow(dead_code)] // each test file uses a part

use glam::DVec3;
use lacuna_kernel::attractor::{Attractor, refine};
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_kernel::model::{ControlNet, Curve, CurveScheme, Finding, Lowered, Model, Shape, TensorProduct};
use lacuna_kernel::tessellation::Tessellation;
use lacuna_kernel::tolerance::Tolerance;

/// SplitMix64.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, count: usize) -> usize {
        (self.next() % count as u64) as usize
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn points(&mut self, count: usize) -> Vec<DVec3> {
        (0..count).map(|_| DVec3::new(self.between(-9.0, 9.0), self.between(-9.0, 9.0), self.between(-9.0, 9.0))).collect()
    }

    /// A legal knot vector: generic, uniform, clamped, with inner multiplicities up to degree + 1, or with tiny intervals.
    pub fn knots(&mut self, degree: usize, count: usize, kind: usize) -> Vec<f64> {
        let total = count + degree + 1;
        let mut knots = vec![self.between(-3.0, 3.0)];
        while knots.len() < total {
            let last = knots[knots.len() - 1];
            let step = match kind % 6 {
                0 => self.between(0.1, 2.0),
                1 => 0.1,
                2 => self.below(3) as f64,
                3 => 1.0 + self.below(2) as f64,
                4 => 10.0_f64.powf(self.between(-4.0, 2.0)),
                _ => self.below(2) as f64 * self.between(0.5, 1.5),
            };
            let run = knots.iter().rev().take_while(|&&knot| knot == last).count();
            // Only the first and the last degree + 1 knots may all be equal where the curve shall stay in one piece.
            let most = if kind.is_multiple_of(4) { degree + 1 } else { degree };
            knots.push(if step == 0.0 && run >= most { last + 1.0 } else { last + step });
        }
        if kind % 6 == 3 {
            let (start, end) = (knots[degree], knots[count]);
            knots[..degree].fill(start);
            knots[count..].fill(end);
        }
        if knots[degree] == knots[count] {
            (count..total).for_each(|k| knots[k] += 1.0);
        }
        knots
    }
}

pub fn curve(scheme: CurveScheme, points: Vec<DVec3>, weights: Option<Vec<f64>>) -> Shape {
    Shape::Curve(Curve { scheme, control_points: ControlNet { weights, ..ControlNet::line(points) } })
}

pub fn product(schemes: Vec<CurveScheme>, control_points: ControlNet) -> Shape {
    Shape::TensorProduct(TensorProduct { schemes, control_points, separate: false, trim: None })
}

pub fn lower(shape: Shape) -> Lowered {
    Model { name: None, shape }.lower().unwrap_or_else(|findings| panic!("{findings:?}"))
}

/// The findings of a shape that is refused.
pub fn refused(shape: Shape) -> Vec<Finding> {
    Model { name: None, shape }.lower().expect_err("refused")
}

pub fn size(points: &[DVec3]) -> f64 {
    points.iter().map(|point| point.length()).fold(0.0, f64::max)
}

/// The spans of positive length in the domain of a spline.
pub fn spans(degree: usize, knots: &[f64]) -> Vec<[f64; 2]> {
    knots[degree..knots.len() - degree].windows(2).filter(|pair| pair[0] < pair[1]).map(|pair| [pair[0], pair[1]]).collect()
}

pub fn homogeneous(p: DVec3, w: f64) -> [f64; 4] {
    [w * p.x, w * p.y, w * p.z, w]
}

pub fn project(point: [f64; 4]) -> DVec3 {
    DVec3::new(point[0], point[1], point[2]) / point[3]
}

/// De Boor's algorithm: the point at parameter t, with the span chosen so that t may be the end of the domain.
pub fn blossom_point(degree: usize, knots: &[f64], points: &[[f64; 4]], t: f64) -> [f64; 4] {
    let last = (degree..points.len()).rev().find(|&k| knots[k] < knots[k + 1] && knots[k] <= t).expect("t is in the domain");
    let mut row: Vec<[f64; 4]> = points[last - degree..=last].to_vec();
    for level in 1..=degree {
        for j in (level..=degree).rev() {
            let (low, high) = (knots[last - degree + j], knots[last + 1 + j - level]);
            let share = (t - low) / (high - low);
            row[j] = std::array::from_fn(|k| (1.0 - share) * row[j - 1][k] + share * row[j][k]);
        }
    }
    row[degree]
}

pub fn de_boor(degree: usize, knots: &[f64], points: &[DVec3], weights: Option<&[f64]>, t: f64) -> DVec3 {
    let points: Vec<[f64; 4]> =
        points.iter().enumerate().map(|(k, &p)| homogeneous(p, weights.map_or(1.0, |weights| weights[k]))).collect();
    project(blossom_point(degree, knots, &points, t))
}

/// Walks down a random address of `depth` steps from a root whose directions run over the given ranges (every state has
/// two children per direction, the last direction's fastest), and returns the cell's first and last corner: parameters
/// and position. A corner's position follows boundaries down to a point.
pub fn walk(attractor: &Attractor, root: usize, ranges: &[[f64; 2]], random: &mut Random, depth: usize) -> [(Vec<f64>, DVec3); 2] {
    let automaton = attractor.automaton();
    let mut state = attractor.roots()[root].state;
    let mut points = attractor.roots()[root].points.clone();
    let mut ranges = ranges.to_vec();
    for _ in 0..depth {
        let children = 1 << ranges.len();
        assert_eq!(automaton.state(state).transitions.len(), children);
        let child = random.below(children);
        let transition = &automaton.state(state).transitions[child];
        points = apply(&points, transition.operator.entries());
        state = transition.to;
        for direction in 0..ranges.len() {
            let [low, high] = ranges[direction];
            let middle = 0.5 * (low + high);
            let second = child >> (ranges.len() - 1 - direction) & 1 == 1;
            ranges[direction] = if second { [middle, high] } else { [low, middle] };
        }
    }
    [0, 1].map(|end| {
        let (mut state, mut points) = (state, points.clone());
        while let Some(boundary) = automaton.state(state).boundaries.get(end) {
            points = apply(&points, boundary.incidence.entries());
            state = boundary.state;
        }
        (ranges.iter().map(|range| range[end]).collect(), project(points[0]))
    })
}

fn apply(points: &[[f64; 4]], entries: &[f64]) -> Vec<[f64; 4]> {
    let column = |column: &[f64]| -> [f64; 4] { std::array::from_fn(|k| points.iter().zip(column).map(|(point, w)| w * point[k]).sum()) };
    entries.chunks_exact(points.len()).map(column).collect()
}

pub fn evaluated(attractor: &Attractor, tolerance: f64) -> Tessellation {
    let limits = Limits { cells: 300_000, ..Limits::default() };
    let budget = Budget { limits, ..Budget::default() };
    refine(attractor, Tolerance::new(tolerance).expect("positive"), &budget).expect("refines")
}
