//! The box of an attractor, to any precision: its support function along the axes.

use super::support::{Extent, Search};
use crate::attractor::Attractor;
use crate::attractor::cell::{Cell, ControlPoint, Point};
use crate::attractor::trim::Rim;
use crate::budget::{Budget, Stopped};
use crate::measure::Interval;
use glam::DVec3;

/// The box of a shape: lower and upper ends per axis, each an interval that contains the exact one, in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisBox {
    /// Lower corner.
    pub low: [Interval; 3],
    /// Upper corner.
    pub high: [Interval; 3],
}

impl AxisBox {
    /// The box grown by `length` on all sides: the exact box of the dilation by a ball of that radius.
    #[must_use]
    pub fn grown(&self, length: f64) -> Self {
        let moved = |interval: Interval, by: f64| Interval::new(interval.low + by, interval.high + by);
        Self { low: self.low.map(|x| moved(x, -length)), high: self.high.map(|x| moved(x, length)) }
    }

    /// The box whose intervals are wider by `length` at both ends.
    #[must_use]
    pub(crate) fn widened(&self, length: f64) -> Self {
        let wider = |interval: Interval| Interval::new(interval.low - length, interval.high + length);
        Self { low: self.low.map(wider), high: self.high.map(wider) }
    }

    /// Largest absolute coordinate.
    #[must_use]
    pub fn extent(&self) -> f64 {
        (0..3).map(|axis| self.low[axis].low.abs().max(self.high[axis].high.abs())).fold(0.0, f64::max)
    }

    /// Largest movement of a point of the box when its coordinates are rounded to single precision: half a
    /// unit in the last place, times sqrt(3).
    #[must_use]
    pub fn single_precision(&self) -> f64 {
        self.extent() * f64::from(f32::EPSILON) * 0.5 * 3.0_f64.sqrt()
    }

    /// Length of the outer box's diagonal.
    #[must_use]
    pub fn diagonal(&self) -> f64 {
        (0..3).map(|axis| (self.high[axis].high - self.low[axis].low).powi(2)).sum::<f64>().sqrt()
    }
}

/// The box of the attractor; each of its six numbers is an interval, 1e-11 of the shape's size wide unless
/// the shape's extremes are too many to separate.
///
/// # Errors
/// [`Stopped`] when the budget's token was fired.
pub fn bounding_box(attractor: &Attractor, budget: &Budget) -> Result<AxisBox, Stopped> {
    box_of_roots(attractor, false, budget)
}

/// The box of the union of all roots' cells, each dilated by the ball of its own constant radius.
///
/// # Errors
/// [`Stopped`] when the budget's token was fired.
pub(crate) fn dilated_box(attractor: &Attractor, budget: &Budget) -> Result<AxisBox, Stopped> {
    box_of_roots(attractor, true, budget)
}

fn box_of_roots(attractor: &Attractor, dilated: bool, budget: &Budget) -> Result<AxisBox, Stopped> {
    let (extent, rim) = (Extent::of(attractor), Rim::of(attractor));
    let (mut low, mut high) = ([Interval { low: 0.0, high: 0.0 }; 3], [Interval { low: 0.0, high: 0.0 }; 3]);
    for axis in 0..3 {
        for (end, sign) in [(&mut low[axis], -1.0), (&mut high[axis], 1.0)] {
            let direction = std::array::from_fn(|other| if other == axis { sign } else { 0.0 });
            let support = Search::new(attractor, &extent, &rim, &direction).with_roots(dilated, budget)?.run(budget)?;
            *end = Interval::new(sign * support.low, sign * support.high);
        }
    }
    Ok(AxisBox { low, high })
}

/// [least, largest] of x . direction over the attractor, each an interval that contains it, in mm for a direction of length 1.
///
/// # Errors
/// [`Stopped`] when the budget's token was fired.
pub fn extent_along(attractor: &Attractor, direction: DVec3, budget: &Budget) -> Result<[Interval; 2], Stopped> {
    let (extent, rim) = (Extent::of(attractor), Rim::of(attractor));
    let support = |direction: DVec3| Search::new(attractor, &extent, &rim, &direction.to_array()).with_roots(false, budget)?.run(budget);
    let (least, largest) = (support(-direction)?, support(direction)?);
    Ok([Interval::new(-least.high, -least.low), largest])
}

/// sup of x . direction over a cell that is not cut along loops.
pub(super) fn support_of_cell(
    attractor: &Attractor,
    cell: Cell,
    points: &[ControlPoint],
    direction: &Point,
    budget: &Budget,
) -> Result<Interval, Stopped> {
    Search::new(attractor, &Extent::of_cell(&cell), &Rim::default(), direction).with_cell(&cell, points).run(budget)
}
