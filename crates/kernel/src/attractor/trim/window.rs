//! Where a cell lies in the parameter plane, and whether it is trimmed away: exact culling for searches that do not draw.

use super::TrimmedSurface;
use super::arc::{Arc, Parameter};
use crate::attractor::Attractor;

/// A cell of a trimmed surface.
#[derive(Clone, Debug)]
pub(crate) struct Window {
    bounds: [Parameter; 2],
    /// Arcs of the loops whose boxes meet its inside, at most about twice as large as it.
    arcs: Vec<Arc>,
    /// Whether it is inside, when there are none.
    inside: bool,
}

impl Window {
    /// Whether no point of the cell is kept.
    pub(crate) fn is_outside(&self) -> bool {
        self.arcs.is_empty() && !self.inside
    }

    /// Whether all points of the cell are kept.
    pub(crate) fn is_inside(&self) -> bool {
        self.arcs.is_empty() && self.inside
    }

    fn new(surface: &TrimmedSurface, bounds: [Parameter; 2], candidates: impl Iterator<Item = Arc>) -> Self {
        // The border is left to neighbours: what is kept is the closure of its inside, so that they hold what is kept of it.
        let meets = |arc: &Arc| {
            let [low, high] = arc.bounds();
            (0..2).all(|k| low[k] < bounds[1][k] && bounds[0][k] < high[k])
        };
        let large = |arc: &Arc| {
            let [low, high] = arc.bounds();
            (0..2).any(|k| high[k] - low[k] > 2.0 * (bounds[1][k] - bounds[0][k]))
        };
        let (mut arcs, mut stack) = (Vec::new(), Vec::new());
        for arc in candidates.filter(meets) {
            stack.push(arc);
            while let Some(arc) = stack.pop() {
                // The arcs are bounded: halving ends where parameters differ by rounding.
                if large(&arc) && stack.len() < 128 {
                    stack.extend(arc.halves().into_iter().filter(meets));
                } else {
                    arcs.push(arc);
                }
            }
        }
        let middle = [0, 1].map(|k| 0.5 * (bounds[0][k] + bounds[1][k]));
        let inside = arcs.is_empty() && surface.region.holds(middle);
        Self { bounds, arcs, inside }
    }
}

impl Attractor {
    /// The window of a root; `None` if its surface is not trimmed.
    pub(crate) fn root_window(&self, root: usize) -> Option<Window> {
        let surface = &self.trimmed()[self.trim_of(root)?];
        let bounds = surface.span_box(surface.spans_of(root)?);
        Some(Window::new(surface, bounds, surface.region.arcs_near(bounds)))
    }

    /// Bezier points in u and in v of that root's surface; and of u and v, whether a cell's sides lie on other spans' border.
    pub(crate) fn window_sides(&self, root: usize, window: &Window) -> Option<([usize; 2], [[bool; 2]; 2])> {
        let surface = &self.trimmed()[self.trim_of(root)?];
        let spans = surface.spans_of(root)?;
        let (inner, rectangle) = (surface.inner_sides(spans), surface.span_box(spans));
        let on_border = |k: usize, end: usize| inner[k][end] && window.bounds[end][k] == rectangle[end][k];
        Some((surface.orders, [0, 1].map(|k| [0, 1].map(|end| on_border(k, end)))))
    }

    /// The window of child `index` of a cell below that root.
    pub(crate) fn child_window(&self, root: usize, window: &Window, index: usize) -> Option<Window> {
        let surface = &self.trimmed()[self.trim_of(root)?];
        let bounds = TrimmedSurface::child_box(&window.bounds, index);
        if window.arcs.is_empty() {
            return Some(Window { bounds, ..window.clone() });
        }
        Some(Window::new(surface, bounds, window.arcs.iter().cloned()))
    }
}
