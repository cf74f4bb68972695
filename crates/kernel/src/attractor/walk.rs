//! The walk: cells refined, depth first and in address order, until what stands for each is within the tolerance.
//!
//! Parallel and flat in memory: the walk is a queue of pieces in address order, each either done or a place to go on
//! from. The first places go on at the same time, each for a number of leaves; what a place leaves unvisited takes
//! its place in the queue, at most one place for every level of the tree. Finished pieces leave the queue at its
//! front. Nothing depends on the number of threads.

use super::cell::{Cell, ControlPoint, Site, child_points};
use super::early::EarlyLeaves;
use super::{Attractor, RefineError};
use crate::budget::Budget;
use crate::tolerance::Tolerance;
use rayon::prelude::*;
use std::collections::VecDeque;
use std::ops::Range;

/// Who is given the sites of a piece.
pub(super) trait Collector: Default + Send {
    /// A site, in address order.
    fn push(&mut self, site: Site);
    /// The end of the piece.
    fn finish(&mut self, _extent: Extent) {}
}

/// How many leaves, and how good.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Extent {
    pub(super) leaf_cells: u64,
    pub(super) deviation_mm: f64,
}

/// Leaves of a piece.
const LEAVES_PER_PIECE: u64 = 8192;
/// Places that go on at the same time.
const PLACES: usize = 64;
/// Leaves that may wait, finished, behind a place that is not: beyond it only what is in front of them goes on.
const LEAVES_WAITING: u64 = 1 << 20;

/// Where a walk goes on.
enum Place {
    /// At roots, by their place in the list, nothing of which was looked at yet.
    Roots(Range<usize>),
    /// At child `from` of a cell that is not good enough.
    Children { cell: Cell, points: Vec<ControlPoint>, depth: u32, from: usize },
}

/// A piece, the places it left, and how far it got.
type Walked<C> = (C, Vec<Place>, Extent);

enum Piece<C> {
    Open(Place),
    /// An open place that is being walked.
    Taken,
    Done(C, u64),
}

/// Walks these roots, after cells of the extent `before`; `sink` is given the pieces in address order.
///
/// # Errors
/// [`RefineError`] when a limit is hit or somebody stops it, or what `sink` returns.
pub(super) fn walk<C: Collector, E: From<RefineError>>(
    attractor: &Attractor,
    roots: &[usize],
    before: Extent,
    tolerance: Tolerance,
    budget: &Budget,
    sink: &mut dyn FnMut(C) -> Result<(), E>,
) -> Result<Extent, E> {
    let early = EarlyLeaves::new(attractor);
    let mut whole = before;
    let count = roots.len();
    let together = (count / (4 * PLACES)).clamp(1, LEAVES_PER_PIECE as usize);
    let ranges = (0..count).step_by(together).map(|first| first..(first + together).min(count));
    let mut queue: VecDeque<Piece<C>> = ranges.map(|range| Piece::Open(Place::Roots(range))).collect();
    let mut waiting = 0;
    loop {
        while matches!(queue.front(), Some(Piece::Done(..))) {
            if let Some(Piece::Done(piece, leaves)) = queue.pop_front() {
                waiting -= leaves;
                sink(piece)?;
            }
        }
        if queue.is_empty() {
            break;
        }
        let walked: Vec<Result<Walked<C>, RefineError>> = chosen(&mut queue, waiting)
            .into_par_iter()
            .with_max_len(1)
            .map(|place| Walker::new(attractor, &early, budget, tolerance.mm()).walk(roots, place))
            .collect();
        let mut results = walked.into_iter();
        let mut next = VecDeque::with_capacity(queue.len());
        for piece in queue {
            match piece {
                Piece::Taken => {
                    let Some(result) = results.next() else { continue };
                    let (piece, rest, extent) = result?;
                    whole.leaf_cells += extent.leaf_cells;
                    whole.deviation_mm = whole.deviation_mm.max(extent.deviation_mm);
                    waiting += extent.leaf_cells;
                    next.push_back(Piece::Done(piece, extent.leaf_cells));
                    next.extend(rest.into_iter().map(Piece::Open));
                }
                other => next.push_back(other),
            }
        }
        queue = next;
        check(whole, tolerance.mm(), budget)?;
    }
    budget.report("refine", 1.0, whole.leaf_cells);
    Ok(whole)
}

/// Takes the first open places out of the queue.
fn chosen<C>(queue: &mut VecDeque<Piece<C>>, waiting: u64) -> Vec<Place> {
    let mut places = Vec::with_capacity(PLACES);
    for piece in queue.iter_mut() {
        if places.len() == PLACES || (matches!(piece, Piece::Done(..)) && waiting > LEAVES_WAITING) {
            break;
        }
        if matches!(piece, Piece::Open(_))
            && let Piece::Open(place) = std::mem::replace(piece, Piece::Taken)
        {
            places.push(place);
        }
    }
    places
}

fn check(whole: Extent, tolerance_mm: f64, budget: &Budget) -> Result<(), RefineError> {
    let allowed = budget.limits.cells;
    if whole.leaf_cells > allowed {
        return Err(RefineError::Cells { allowed, tolerance_mm });
    }
    budget.report("refine", 0.0, whole.leaf_cells);
    Ok(())
}

/// Looks at the budget's stop flag after so many inner cells.
const CELLS_PER_CHECK: u64 = 4096;

struct Walker<'a> {
    attractor: &'a Attractor,
    early: &'a EarlyLeaves,
    budget: &'a Budget,
    tolerance_mm: f64,
    /// Control points of the cells on the current path, one after the other.
    stack: Vec<ControlPoint>,
    extent: Extent,
    inner: u64,
    rest: Vec<Place>,
}

impl<'a> Walker<'a> {
    fn new(attractor: &'a Attractor, early: &'a EarlyLeaves, budget: &'a Budget, tolerance_mm: f64) -> Self {
        Self { attractor, early, budget, tolerance_mm, stack: Vec::new(), extent: Extent::default(), inner: 0, rest: Vec::new() }
    }

    fn walk<C: Collector>(mut self, roots: &[usize], place: Place) -> Result<Walked<C>, RefineError> {
        self.budget.cancel.check()?;
        let mut collector = C::default();
        match place {
            Place::Roots(range) => self.roots(roots, range, &mut collector)?,
            Place::Children { cell, points, depth, from } => {
                self.stack = points;
                self.descend(&cell, 0, depth, from, &mut collector)?;
            }
        }
        collector.finish(self.extent);
        Ok((collector, self.rest, self.extent))
    }

    fn roots(&mut self, roots: &[usize], range: Range<usize>, collector: &mut impl Collector) -> Result<(), RefineError> {
        for index in range.clone() {
            if self.extent.leaf_cells >= LEAVES_PER_PIECE {
                self.rest.push(Place::Roots(index..range.end));
                return Ok(());
            }
            let cell = self.attractor.root_cell(roots[index]);
            let points = &self.attractor.roots()[roots[index]].points;
            self.stack.clear();
            self.stack.extend_from_slice(points);
            if !self.leaf(&cell, 0, collector) {
                self.descend(&cell, 0, 0, 0, collector)?;
            }
        }
        Ok(())
    }

    /// Draws a cell whose control points begin at `base` of the stack, if that is good enough.
    #[inline]
    fn leaf(&mut self, cell: &Cell, base: usize, collector: &mut impl Collector) -> bool {
        let points = &self.stack[base..base + self.attractor.state_of(cell).dimension];
        let error = self.attractor.leaf_error(cell, points);
        if error > self.tolerance_mm {
            return false;
        }
        self.extent.leaf_cells += 1;
        self.extent.deviation_mm = self.extent.deviation_mm.max(error);
        self.attractor.emit(cell, points, &mut |site| collector.push(site));
        true
    }

    /// Walks the children of a cell that is not good enough, from child `from` on.
    fn descend(&mut self, cell: &Cell, base: usize, depth: u32, from: usize, collector: &mut impl Collector) -> Result<(), RefineError> {
        let attractor = self.attractor;
        let state = attractor.state_of(cell);
        let top = base + state.dimension;
        self.enter(cell, base, depth)?;
        for (index, transition) in state.transitions.iter().enumerate().skip(from) {
            if self.extent.leaf_cells >= LEAVES_PER_PIECE {
                let points = self.stack[base..top].to_vec();
                self.rest.push(Place::Children { cell: *cell, points, depth, from: index });
                return Ok(());
            }
            if let Some((error, point)) = self.early.leaf(cell, index, &self.stack[base..top], self.tolerance_mm) {
                self.extent.leaf_cells += 1;
                self.extent.deviation_mm = self.extent.deviation_mm.max(error);
                collector.push(Site::Point(point));
                continue;
            }
            let columns = transition.operator.columns();
            if self.stack.len() < top + columns {
                self.stack.resize(top + columns, [0.0; 4]);
            }
            let (parents, children) = self.stack.split_at_mut(top);
            let child = &mut children[..columns];
            child_points(&parents[base..], &transition.operator, child);
            let child_cell = attractor.refined_cell(cell, index, child);
            if !self.leaf(&child_cell, top, collector) {
                self.descend(&child_cell, top, depth + 1, 0, collector)?;
            }
        }
        Ok(())
    }

    /// Looks at the limits before a cell is split.
    #[inline]
    fn enter(&mut self, cell: &Cell, base: usize, depth: u32) -> Result<(), RefineError> {
        self.inner += 1;
        if self.inner.is_multiple_of(CELLS_PER_CHECK) {
            self.budget.cancel.check()?;
        }
        if depth < self.budget.limits.depth {
            return Ok(());
        }
        let points = &self.stack[base..base + self.attractor.state_of(cell).dimension];
        let reached_mm = self.attractor.leaf_error(cell, points);
        Err(RefineError::Depth { allowed: self.budget.limits.depth, tolerance_mm: self.tolerance_mm, reached_mm })
    }
}
