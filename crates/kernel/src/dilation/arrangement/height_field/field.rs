//! How high the dilation of a graph is over a place.

use super::Place;
use super::parts::{Part, Top};
use crate::dilation::squares::Squares;

/// How wide squares are that parts are sorted into, in units of the largest distance, and how many there are at most for each triangle, or tip.
const PITCH: f64 = 0.2;
pub(super) const MOST: f64 = 4.0;
/// In how many squares a part may be at most, as a mean, and all together in any case.
const MOST_OF_PART: usize = 256;
const FEW: usize = 1 << 20;
/// The least difference of slopes on both sides of a crease.
const CREASE: f64 = 0.25;
/// Slopes are no steeper than this in units of its height.
const STEEPEST: f64 = 1e-6;

/// What is above a graph, between two distances from it. Nothing here is proven, nor need it be: what is made of it is held against the graph.
pub(super) struct Field {
    parts: Vec<Part>,
    /// The box of all places that something is over.
    pub(super) bounds: [Place; 2],
    squares: Squares,
    /// The parts that may be below each square, from the highest down.
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Field {
    /// What is above parts of so many triangles, or tips, between two distances; none where some are so large beside most that there is no room for their lists.
    pub(super) fn new(parts: Vec<Part>, count: usize, distances: [f64; 2]) -> Option<Self> {
        let mut bounds = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for Part { bounds: [low, high], .. } in &parts {
            bounds = [[0, 1].map(|axis| bounds[0][axis].min(low[axis])), [0, 1].map(|axis| bounds[1][axis].max(high[axis]))];
        }
        let squares = Squares::new(bounds, PITCH * distances[1], MOST * count as f64);
        let mut order: Vec<u32> = (0..parts.len() as u32).collect();
        order.sort_unstable_by(|&a, &b| parts[b as usize].highest.total_cmp(&parts[a as usize].highest).then(a.cmp(&b)));
        let (starts, items) =
            squares.lists((MOST_OF_PART * parts.len()).max(FEW), order.iter().map(|&part| (part, parts[part as usize].bounds)))?;
        Some(Self { parts, bounds, squares, starts, items })
    }

    /// The parts that may be below a place.
    #[inline]
    fn below(&self, at: Place) -> impl Iterator<Item = &Part> {
        let square = self.squares.of(at);
        let items = &self.items[self.starts[square] as usize..self.starts[square + 1] as usize];
        items.iter().map(|&part| &self.parts[part as usize])
    }

    /// The highest place over another that is as far from the graph as a distance; none where none is.
    #[inline]
    pub(super) fn top(&self, at: Place, distance: f64) -> Option<Top> {
        let mut best: Option<Top> = None;
        for part in self.below(at) {
            if best.is_some_and(|best| best.height >= part.highest + distance) {
                break;
            }
            if let Some(top) = part.top(at, distance)
                && best.is_none_or(|best| top.height > best.height)
            {
                best = Some(top);
            }
        }
        best
    }

    /// About where the crease next to a place is, if there is one as near as `within`, given what is over the place: where it is as high as what is below it there, on which something else is closest.
    pub(super) fn crease(&self, at: Place, own: &Top, distance: f64, within: f64) -> Option<Place> {
        let slope = |top: &Top| [0, 1].map(|axis| -top.out[axis] / top.out[2].max(STEEPEST));
        let here = slope(own);
        let (mut least, mut found) = (within, None);
        for other in self.below(at).filter_map(|part| part.top(at, distance)) {
            let there = slope(&other);
            let turn = [0, 1].map(|axis| there[axis] - here[axis]);
            let (square, lower) = (turn[0] * turn[0] + turn[1] * turn[1], own.height - other.height);
            if square > CREASE * CREASE && lower > 0.0 && lower < least * square.sqrt() {
                least = lower / square.sqrt();
                found = Some([0, 1].map(|axis| at[axis] + lower / square * turn[axis]));
            }
        }
        found
    }
}
