//! The area of smooth surfaces.

use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::budget::{Budget, Stopped};
use lacuna_kernel::measure::surface_area;

use crate::Certificate;

/// Where more than this share of the upper end is open, as in strips along rough curves, whose patches shrink slowly, nothing is told.
const MOST_OPEN: f64 = 0.5;

impl Certificate {
    /// Adds the area of a surface that consists of Bezier patches, where none is known yet. Nothing of other shapes.
    pub(crate) fn state_surface_area(&mut self, attractor: &Attractor, budget: &Budget) -> Result<(), Stopped> {
        if self.area_mm2.is_some() {
            return Ok(());
        }
        let area = surface_area(attractor, budget)?.filter(|area| area.width() <= MOST_OPEN * area.high);
        self.area_mm2 = area.map(|area| [area.low, area.high]);
        Ok(())
    }
}
