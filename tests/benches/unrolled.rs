//! Evaluation by hand: recursion over arrays of constant size, for the same cells, bounds and primitives as the
//! kernel computes from an automaton. What the kernel's speed is compared with.

use lacuna_kernel::attractor::cell::{Point, Site};
use std::hint::black_box;

/// Operators, as constants: child, column, row.
pub trait Scheme<const N: usize, const K: usize> {
    /// The operators' columns.
    const OPERATORS: [[[f64; N]; N]; K];
}

/// Quadratic B-spline curve.
pub struct Quadratic;

impl Scheme<3, 2> for Quadratic {
    const OPERATORS: [[[f64; 3]; 3]; 2] =
        [[[0.75, 0.25, 0.0], [0.25, 0.75, 0.0], [0.0, 0.75, 0.25]], [[0.25, 0.75, 0.0], [0.0, 0.75, 0.25], [0.0, 0.25, 0.75]]];
}

const CUBIC: [[[f64; 4]; 4]; 2] = [
    [[0.5, 0.5, 0.0, 0.0], [0.125, 0.75, 0.125, 0.0], [0.0, 0.5, 0.5, 0.0], [0.0, 0.125, 0.75, 0.125]],
    [[0.125, 0.75, 0.125, 0.0], [0.0, 0.5, 0.5, 0.0], [0.0, 0.125, 0.75, 0.125], [0.0, 0.0, 0.5, 0.5]],
];

const fn squares<const N: usize, const M: usize>(curve: &[[[f64; N]; N]; 2]) -> [[[f64; M]; M]; 4] {
    let mut operators = [[[0.0; M]; M]; 4];
    let mut place = 0;
    while place < 4 * M * M {
        let (child, column, row) = (place / (M * M), place / M % M, place % M);
        operators[child][column][row] = curve[child / 2][column / N][row / N] * curve[child % 2][column % N][row % N];
        place += 1;
    }
    operators
}

/// Biquadratic B-spline face.
pub struct Biquadratic;

impl Scheme<9, 4> for Biquadratic {
    const OPERATORS: [[[f64; 9]; 9]; 4] = squares(&Quadratic::OPERATORS);
}

/// Bicubic B-spline face.
pub struct Bicubic;

impl Scheme<16, 4> for Bicubic {
    const OPERATORS: [[[f64; 16]; 16]; 4] = squares(&CUBIC);
}

/// The corners of a face: limit points at the ends of both parameters.
pub fn corners<const N: usize, const M: usize>(ends: [[f64; N]; 2]) -> [[f64; M]; 4] {
    [(0, 0), (0, 1), (1, 1), (1, 0)].map(|(u, v)| std::array::from_fn(|i| ends[u][i / N] * ends[v][i % N]))
}

fn combine<const N: usize>(points: &[Point; N], weights: &[f64; N]) -> Point {
    let mut sum = [0.0; 3];
    for (point, weight) in points.iter().zip(weights) {
        for (total, x) in sum.iter_mut().zip(point) {
            *total += weight * x;
        }
    }
    sum
}

fn distance_squared(a: &Point, b: &Point) -> f64 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
}

/// Draws chords of a quadratic curve to a tolerance, and counts them.
pub fn curve(points: &[Point; 3], tolerance: f64, leaves: &mut u64) {
    let start = combine(points, &[0.5, 0.5, 0.0]);
    let end = combine(points, &[0.0, 0.5, 0.5]);
    let off = |x: &Point| {
        let along = [end[0] - start[0], end[1] - start[1], end[2] - start[2]];
        let length = distance_squared(&start, &end);
        let product = (x[0] - start[0]) * along[0] + (x[1] - start[1]) * along[1] + (x[2] - start[2]) * along[2];
        let t = if length > 0.0 { (product / length).clamp(0.0, 1.0) } else { 0.0 };
        distance_squared(x, &[start[0] + t * along[0], start[1] + t * along[1], start[2] + t * along[2]])
    };
    let error = points.iter().map(off).fold(0.0, f64::max).sqrt();
    if error <= tolerance {
        *leaves += 1;
        black_box(Site::Segment([start, end]));
        return;
    }
    for operator in &Quadratic::OPERATORS {
        curve(&[combine(points, &operator[0]), combine(points, &operator[1]), combine(points, &operator[2])], tolerance, leaves);
    }
}

/// Draws a face as two triangles between its corners where the ball of its control points is small, and counts.
pub fn face<S: Scheme<N, 4>, const N: usize>(points: &[Point; N], corners: &[[f64; N]; 4], tolerance: f64, leaves: &mut u64) {
    let centre = combine(points, &[1.0 / N as f64; N]);
    let radius = points.iter().map(|point| distance_squared(point, &centre)).fold(0.0, f64::max).sqrt();
    if 2.0 * radius <= tolerance {
        *leaves += 1;
        let [a, b, c, d] = corners.each_ref().map(|weights| combine(points, weights));
        black_box(Site::Triangle([a, b, c]));
        black_box(Site::Triangle([a, c, d]));
        return;
    }
    for operator in &S::OPERATORS {
        let mut child = [[0.0; 3]; N];
        for (point, weights) in child.iter_mut().zip(operator) {
            *point = combine(points, weights);
        }
        face::<S, N>(&child, corners, tolerance, leaves);
    }
}

/// Maps p -> s p + t of a ratio s, applied to the frame of a cell.
pub fn homotheties<const K: usize>(frame: &[Point; 4], scale: f64, maps: &[[[f64; 4]; 4]; K], cell: &Homothetic, leaves: &mut u64) {
    let radius = scale * cell.radius;
    if radius <= cell.tolerance {
        *leaves += 1;
        let mut centre = frame[0];
        for (column, weight) in cell.centre.iter().enumerate() {
            for axis in 0..3 {
                centre[axis] += weight * (frame[column + 1][axis] - frame[0][axis]);
            }
        }
        black_box(Site::Point(centre));
        return;
    }
    for operator in maps {
        let child = operator.each_ref().map(|weights| combine(frame, weights));
        homotheties(&child, scale * cell.ratio, maps, cell, leaves);
    }
}

/// What is common to all cells of an iterated function system of homotheties of one ratio.
pub struct Homothetic {
    /// Centre of the attractor's ball.
    pub centre: Point,
    /// Its radius.
    pub radius: f64,
    /// Ratio of all maps.
    pub ratio: f64,
    /// The largest ball that is drawn as a point.
    pub tolerance: f64,
}
