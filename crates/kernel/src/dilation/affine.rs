//! Affine functions on a tetrahedron.

use crate::attractor::cell::{Point, cross, dot, subtract};

/// An affine function.
#[derive(Clone, Copy, Default)]
pub(super) struct Affine {
    at_base: f64,
    pub(super) slope: Point,
}

impl Affine {
    /// The function with these values at the vertices of a tetrahedron, about the first of them.
    pub(super) fn new(positions: &[Point; 4], values: [f64; 4]) -> Self {
        let columns = [1, 2, 3].map(|k| subtract(&positions[k], &positions[0]));
        let dual = [cross(&columns[1], &columns[2]), cross(&columns[2], &columns[0]), cross(&columns[0], &columns[1])];
        let determinant = dot(&columns[0], &dual[0]);
        let slope: Point =
            std::array::from_fn(|axis| (0..3).map(|k| (values[k + 1] - values[0]) * dual[k][axis]).sum::<f64>() / determinant);
        Self { at_base: values[0], slope }
    }

    /// Its least and its largest value in a box.
    pub(super) fn over(&self, offset: &Point, half: &Point) -> [f64; 2] {
        let (middle, range) = (self.at_base + dot(&self.slope, offset), range(&self.slope, half));
        [middle - range, middle + range]
    }
}

/// By how much a linear function with a slope varies in a box with these half sides, to either side.
pub(super) fn range(slope: &Point, half: &Point) -> f64 {
    (0..3).map(|axis| slope[axis].abs() * half[axis]).sum()
}
