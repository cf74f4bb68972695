//! Evaluation: cells refined, depth first and in address order, until what stands for each is within
//! the tolerance.

use super::cell::{Cell, ControlPoint, Point, Site, child_points, distance_squared};
use super::{Attractor, complex};
use crate::budget::{Budget, Stopped};
use crate::error::{Kind, LimitFacts};
use crate::tessellation::Tessellation;
use crate::tolerance::Tolerance;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Why an evaluation has no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RefineError {
    /// Somebody stopped it.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// More leaf cells than allowed.
    #[error("the tolerance of {tolerance_mm} mm needs more than {allowed} leaf cells")]
    Cells {
        /// The limit.
        allowed: u64,
        /// What was asked.
        tolerance_mm: f64,
        /// A tolerance that would pass, as far as the cells refined so far tell.
        reachable_mm: f64,
    },
    /// An address longer than allowed.
    #[error("the tolerance of {tolerance_mm} mm needs addresses longer than {allowed}; cells of that depth reach {reached_mm} mm")]
    Depth {
        /// The limit.
        allowed: u32,
        /// What was asked.
        tolerance_mm: f64,
        /// Error of the cell at the limit.
        reached_mm: f64,
    },
}

impl RefineError {
    /// How to react.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Stopped(stopped) => stopped.kind(),
            Self::Cells { .. } | Self::Depth { .. } => Kind::Limit,
        }
    }

    /// Stable code.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Stopped(stopped) => stopped.code(),
            Self::Cells { .. } => "limit-cells",
            Self::Depth { .. } => "limit-depth",
        }
    }

    /// The limit that was hit.
    #[must_use]
    pub fn limit(&self) -> Option<LimitFacts> {
        match self {
            Self::Stopped(_) => None,
            Self::Cells { allowed, reachable_mm, .. } => Some(LimitFacts {
                limit: "cells",
                asked: *allowed as f64 + 1.0,
                allowed: *allowed as f64,
                remedy: Some(("tolerance_mm", *reachable_mm)),
            }),
            Self::Depth { allowed, reached_mm, .. } => Some(LimitFacts {
                limit: "depth",
                asked: f64::from(*allowed) + 1.0,
                allowed: f64::from(*allowed),
                remedy: Some(("tolerance_mm", *reached_mm)),
            }),
        }
    }
}

/// Leaves of one task before the next look at the budget.
const LEAVES_PER_CHECK: u64 = 4096;
/// Tasks that evaluation is split into.
const TASKS: usize = 256;

struct Walker<'a> {
    attractor: &'a Attractor,
    budget: &'a Budget,
    tolerance_mm: f64,
    total: &'a AtomicU64,
    /// Control points of the children on the current path, one buffer per depth.
    buffers: Vec<Vec<ControlPoint>>,
    leaves: u64,
    deviation: f64,
}

impl<'a> Walker<'a> {
    /// A walker that begins at cells of the given depth.
    fn new(attractor: &'a Attractor, budget: &'a Budget, tolerance_mm: f64, total: &'a AtomicU64, depth: u32) -> Self {
        Self { attractor, budget, tolerance_mm, total, buffers: vec![Vec::new(); depth as usize], leaves: 0, deviation: 0.0 }
    }

    fn descend(&mut self, cell: &Cell, points: &[ControlPoint], depth: u32, sink: &mut impl FnMut(Site)) -> Result<(), RefineError> {
        let error = self.attractor.leaf_error(cell, points);
        if error <= self.tolerance_mm {
            self.leaves += 1;
            self.deviation = self.deviation.max(error);
            if self.leaves.is_multiple_of(LEAVES_PER_CHECK) {
                self.check(error)?;
            }
            self.attractor.emit(cell, points, sink);
            return Ok(());
        }
        if depth >= self.budget.limits.depth {
            return Err(RefineError::Depth { allowed: self.budget.limits.depth, tolerance_mm: self.tolerance_mm, reached_mm: error });
        }
        if self.buffers.len() <= depth as usize {
            self.buffers.push(Vec::new());
        }
        let state = self.attractor.state_of(cell);
        for (index, transition) in state.transitions.iter().enumerate() {
            let mut child = std::mem::take(&mut self.buffers[depth as usize]);
            child.resize(transition.operator.columns(), [0.0; 4]);
            child_points(points, &transition.operator, &mut child);
            let child_cell = self.attractor.child_cell(cell, index, &child);
            let result = self.descend(&child_cell, &child, depth + 1, sink);
            self.buffers[depth as usize] = child;
            result?;
        }
        Ok(())
    }

    fn check(&self, error: f64) -> Result<(), RefineError> {
        self.budget.cancel.check()?;
        let so_far = self.total.fetch_add(LEAVES_PER_CHECK, Ordering::Relaxed) + LEAVES_PER_CHECK;
        let allowed = self.budget.limits.cells;
        if so_far > allowed {
            return Err(RefineError::Cells {
                allowed,
                tolerance_mm: self.tolerance_mm,
                reachable_mm: (2.0 * error).max(2.0 * self.tolerance_mm),
            });
        }
        if so_far.is_multiple_of(64 * LEAVES_PER_CHECK) {
            self.budget.report("refine", 0.0, so_far);
        }
        Ok(())
    }
}

/// Splits the roots into about [`TASKS`] cells, in address order.
fn tasks(attractor: &Attractor, indices: &[usize], tolerance_mm: f64) -> Vec<(Cell, Vec<ControlPoint>, u32)> {
    let roots = attractor.roots();
    let mut level: Vec<_> = indices.iter().map(|&index| (attractor.root_cell(index), roots[index].points.clone(), 0)).collect();
    for _ in 0..24 {
        if level.len() >= TASKS {
            break;
        }
        let mut next = Vec::with_capacity(level.len() * 2);
        let mut split = false;
        for (cell, points, depth) in level {
            if attractor.leaf_error(&cell, &points) <= tolerance_mm {
                next.push((cell, points, depth));
                continue;
            }
            split = true;
            for (index, transition) in attractor.state_of(&cell).transitions.iter().enumerate() {
                let mut child = vec![[0.0; 4]; transition.operator.columns()];
                child_points(&points, &transition.operator, &mut child);
                next.push((attractor.child_cell(&cell, index, &child), child, depth + 1));
            }
        }
        level = next;
        if !split {
            break;
        }
    }
    level
}

/// Refines every cell until what stands for it is within the tolerance, and draws it.
///
/// Cells with a B-rep become one conforming complex; what is left is drawn cell by cell, in parallel.
/// Cost: proportional to the number of leaf cells. The result does not depend on the number of threads.
///
/// # Errors
/// [`RefineError`] when a limit is hit or somebody stops it.
pub fn refine(attractor: &Attractor, tolerance: Tolerance, budget: &Budget) -> Result<Tessellation, RefineError> {
    let (with_brep, without): (Vec<usize>, Vec<usize>) = (0..attractor.roots().len()).partition(|&root| attractor.has_brep(root));
    let mut whole = Part { tessellation: complex::refine(attractor, &with_brep, tolerance, budget)?, ..Part::default() };
    let total = AtomicU64::new(whole.tessellation.leaf_cells);
    let tolerance_mm = tolerance.mm();
    let parts: Vec<Result<Part, RefineError>> = tasks(attractor, &without, tolerance_mm)
        .par_iter()
        .with_max_len(1)
        .map(|(cell, points, depth)| {
            let mut walker = Walker::new(attractor, budget, tolerance.mm(), &total, *depth);
            let mut part = Part::default();
            walker.descend(cell, points, *depth, &mut |site| part.push(site))?;
            part.tessellation.leaf_cells = walker.leaves;
            part.tessellation.deviation_mm = walker.deviation;
            Ok(part)
        })
        .collect();
    for part in parts {
        whole.append(part?);
    }
    let cells = whole.tessellation.leaf_cells;
    if cells > budget.limits.cells {
        return Err(RefineError::Cells { allowed: budget.limits.cells, tolerance_mm, reachable_mm: 2.0 * tolerance_mm });
    }
    budget.report("refine", 1.0, cells);
    // Products of depth 60 lose less than 1e-12 relative; the bound declares ten times that.
    whole.tessellation.deviation_mm += 1e-11 * largest_coordinate(&whole.tessellation.vertices);
    Ok(whole.tessellation)
}

fn largest_coordinate(vertices: &[glam::DVec3]) -> f64 {
    vertices.par_iter().map(|vertex| vertex.abs().max_element()).reduce(|| 0.0, f64::max)
}

/// Visits all leaf cells at the tolerance without storing them, and counts them: for benchmarks and plans.
///
/// # Errors
/// As [`refine`].
pub fn count_cells(attractor: &Attractor, tolerance: Tolerance, budget: &Budget) -> Result<u64, RefineError> {
    let total = AtomicU64::new(0);
    let all: Vec<usize> = (0..attractor.roots().len()).collect();
    tasks(attractor, &all, tolerance.mm())
        .par_iter()
        .with_max_len(1)
        .map(|(cell, points, depth)| {
            let mut walker = Walker::new(attractor, budget, tolerance.mm(), &total, *depth);
            let mut sum = 0.0;
            walker.descend(cell, points, *depth, &mut |site| {
                if let Site::Point(point) = site {
                    sum += point[0];
                }
            })?;
            std::hint::black_box(sum);
            Ok(walker.leaves)
        })
        .try_reduce(|| 0, |a, b| Ok(a + b))
}

/// A piece of a tessellation in the making.
#[derive(Default)]
struct Part {
    tessellation: Tessellation,
    /// Where the last segment ended, when the last thing drawn was a segment.
    open_end: Option<u32>,
    /// Where the first segment starts, when the first thing drawn was a segment.
    open_start: Option<u32>,
}

impl Part {
    fn vertex(&mut self, point: &Point) -> u32 {
        let index = u32::try_from(self.tessellation.vertices.len()).expect("the cell limit is below 2^32");
        self.tessellation.vertices.push(glam::DVec3::from_array(*point));
        index
    }

    /// Successive segments of a curve share the vertex between them: the end of a chord and the start of
    /// the next are the same point of the automaton, computed twice.
    fn same(&self, index: u32, point: &Point) -> bool {
        let vertex = self.tessellation.vertices[index as usize].to_array();
        let scale = point.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        distance_squared(&vertex, point) <= (1e-12 * scale).powi(2)
    }

    fn push(&mut self, site: Site) {
        match site {
            Site::Point(point) => {
                let index = self.vertex(&point);
                self.tessellation.points.push(index);
                self.open_end = None;
            }
            Site::Segment([start, end]) => {
                let first = match self.open_end {
                    Some(index) if self.same(index, &start) => index,
                    _ => self.vertex(&start),
                };
                if self.tessellation.segments.is_empty() && first == 0 {
                    self.open_start = Some(first);
                }
                let last = self.vertex(&end);
                self.tessellation.segments.push([first, last]);
                self.open_end = Some(last);
            }
            Site::Triangle(corners) => {
                let indices = corners.map(|corner| self.vertex(&corner));
                self.tessellation.triangles.push(indices);
                self.open_end = None;
            }
        }
    }

    fn append(&mut self, other: Part) {
        let shared = match (self.open_end, other.open_start) {
            (Some(end), Some(0)) if self.same(end, &other.tessellation.vertices[0].to_array()) => Some(end),
            _ => None,
        };
        let offset = self.tessellation.vertices.len() as u32;
        let skipped = u32::from(shared.is_some());
        let place = |index: u32| match shared {
            Some(end) if index == 0 => end,
            _ => index + offset - skipped,
        };
        if self.tessellation.vertices.is_empty() {
            self.open_start = other.open_start;
        }
        self.tessellation.vertices.extend(other.tessellation.vertices.into_iter().skip(skipped as usize));
        self.tessellation.points.extend(other.tessellation.points.into_iter().map(place));
        self.tessellation.segments.extend(other.tessellation.segments.into_iter().map(|ends| ends.map(place)));
        self.tessellation.triangles.extend(other.tessellation.triangles.into_iter().map(|corners| corners.map(place)));
        self.tessellation.leaf_cells += other.tessellation.leaf_cells;
        self.tessellation.deviation_mm = self.tessellation.deviation_mm.max(other.tessellation.deviation_mm);
        self.open_end = other.open_end.map(place);
    }
}
