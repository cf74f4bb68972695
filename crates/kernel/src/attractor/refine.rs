//! Evaluation: what stands for the cells of a walk, as a tessellation, whole or in pieces.

use super::cell::{Point, Site, distance_squared};
use super::walk::{Collector, Extent, walk};
use super::{Attractor, TangentPlanes, complex, trim};
use crate::budget::{Budget, Stopped};
use crate::error::{Kind, LimitFacts};
use crate::tessellation::Tessellation;
use crate::tolerance::Tolerance;

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
    },
    /// More memory than allowed.
    #[error("the tolerance of {tolerance_mm} mm needs more than {allowed_bytes} bytes for its {leaf_cells} cells and more")]
    Memory {
        /// The limit.
        allowed_bytes: u64,
        /// What was asked.
        tolerance_mm: f64,
        /// Leaf cells that filled it.
        leaf_cells: u64,
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
            Self::Cells { .. } | Self::Memory { .. } | Self::Depth { .. } => Kind::Limit,
        }
    }

    /// Stable code.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Stopped(stopped) => stopped.code(),
            Self::Cells { .. } => "limit-cells",
            Self::Memory { .. } => "limit-memory",
            Self::Depth { .. } => "limit-depth",
        }
    }

    /// The limit that was hit; what would pass, where the work tells.
    #[must_use]
    pub fn limit(&self) -> Option<LimitFacts> {
        match self {
            Self::Stopped(_) => None,
            Self::Cells { allowed, .. } => {
                Some(LimitFacts { limit: "cells", asked: *allowed as f64 + 1.0, allowed: *allowed as f64, remedy: None })
            }
            Self::Memory { allowed_bytes, .. } => {
                let allowed = *allowed_bytes as f64;
                Some(LimitFacts { limit: "memory_bytes", asked: allowed + 1.0, allowed, remedy: None })
            }
            Self::Depth { allowed, reached_mm, .. } => Some(LimitFacts {
                limit: "depth",
                asked: f64::from(*allowed) + 1.0,
                allowed: f64::from(*allowed),
                remedy: Some(("tolerance_mm", *reached_mm)),
            }),
        }
    }
}

/// Refines every cell until what stands for it is within the tolerance, and draws it.
///
/// Cells with a B-rep become one conforming complex; what is left is drawn cell by cell, in parallel.
/// Cost: proportional to the number of leaf cells. The result does not depend on the number of threads.
///
/// # Errors
/// [`RefineError`] when a limit is hit or somebody stops it.
pub fn refine(attractor: &Attractor, tolerance: Tolerance, budget: &Budget) -> Result<Tessellation, RefineError> {
    refine_whole(attractor, None, tolerance, budget)
}

/// As [`refine`], with the normals of the limit surface at the drawn vertices ([`Tessellation::normals`]).
///
/// # Errors
/// As [`refine`].
pub fn refine_with_normals(
    attractor: &Attractor,
    tangents: &TangentPlanes,
    tolerance: Tolerance,
    budget: &Budget,
) -> Result<Tessellation, RefineError> {
    refine_whole(attractor, Some(tangents), tolerance, budget)
}

fn refine_whole(
    attractor: &Attractor,
    tangents: Option<&TangentPlanes>,
    tolerance: Tolerance,
    budget: &Budget,
) -> Result<Tessellation, RefineError> {
    let (with_brep, without): (Vec<usize>, Vec<usize>) = untrimmed(attractor).into_iter().partition(|&root| attractor.has_brep(root));
    let mut whole = Part { tessellation: complex::refine(attractor, &with_brep, tangents, tolerance, budget)?, ..Part::default() };
    whole.tessellation.append(trim::refine(attractor, tolerance, budget)?);
    let before = Extent { leaf_cells: whole.tessellation.leaf_cells, deviation_mm: whole.tessellation.deviation_mm };
    let extent = walk(attractor, &without, before, tolerance, budget, &mut |part: Part| -> Result<(), RefineError> {
        whole.append(part);
        whole.check_memory(tolerance, budget)
    })?;
    // Triangles of trimmed surfaces and those drawn cell by cell have none.
    let triangles = whole.tessellation.triangles.len();
    whole.tessellation.normals = whole.tessellation.normals.take().filter(|normals| normals.triangles.len() == triangles);
    whole.tessellation.leaf_cells = extent.leaf_cells;
    whole.tessellation.deviation_mm = extent.deviation_mm + rounding_mm(largest_coordinate(&whole.tessellation.vertices));
    budget.prove(whole.tessellation.deviation_mm);
    budget.report("refine", 1.0, extent.leaf_cells);
    Ok(whole.tessellation)
}

/// What a streamed evaluation was, as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Streamed {
    /// Leaf cells evaluated.
    pub leaf_cells: u64,
    /// Hausdorff bound reached, in mm.
    pub deviation_mm: f64,
}

/// Refines as [`refine`] does, and hands the result over in pieces, in address order, without holding more than a
/// few of them: memory stays flat, whatever the number of leaves.
///
/// A piece's indices refer to its own vertices: segments that meet at the border of two pieces have each their own
/// vertex there. Its `leaf_cells` and `deviation_mm` (rounding not included) are its own. All pieces together hold
/// what [`refine`] gives, in its order, for any number of threads; only cells with a B-rep are drawn one by one here,
/// not as a complex. Trimmed surfaces come first, as one piece.
///
/// # Errors
/// [`RefineError`] when a limit is hit or somebody stops it, or what `sink` returns.
pub fn stream<E: From<RefineError>>(
    attractor: &Attractor,
    tolerance: Tolerance,
    budget: &Budget,
    sink: &mut dyn FnMut(Tessellation) -> Result<(), E>,
) -> Result<Streamed, E> {
    let trimmed = trim::refine(attractor, tolerance, budget)?;
    let mut largest = largest_coordinate(&trimmed.vertices);
    let before = Extent { leaf_cells: trimmed.leaf_cells, deviation_mm: trimmed.deviation_mm };
    if !trimmed.vertices.is_empty() {
        sink(trimmed)?;
    }
    let extent = walk(attractor, &untrimmed(attractor), before, tolerance, budget, &mut |part: Part| {
        largest = largest.max(largest_coordinate(&part.tessellation.vertices));
        sink(part.tessellation)
    })?;
    let deviation_mm = extent.deviation_mm + rounding_mm(largest);
    budget.prove(deviation_mm);
    budget.report("refine", 1.0, extent.leaf_cells);
    Ok(Streamed { leaf_cells: extent.leaf_cells, deviation_mm })
}

/// Products of depth 60 lose less than 1e-12 relative; the bound declares ten times that.
pub(super) fn rounding_mm(largest_coordinate: f64) -> f64 {
    1e-11 * largest_coordinate
}

pub(super) fn largest_coordinate(vertices: &[glam::DVec3]) -> f64 {
    vertices.iter().map(|vertex| vertex.abs().max_element()).fold(0.0, f64::max)
}

/// Visits all leaf cells at the tolerance without storing them (but those of trimmed surfaces), and counts them: for
/// benchmarks and plans.
///
/// # Errors
/// As [`refine`].
pub fn count_cells(attractor: &Attractor, tolerance: Tolerance, budget: &Budget) -> Result<u64, RefineError> {
    let trimmed = trim::refine(attractor, tolerance, budget)?;
    let before = Extent { leaf_cells: trimmed.leaf_cells, deviation_mm: trimmed.deviation_mm };
    let mut drop = |_: Unseen| -> Result<(), RefineError> { Ok(()) };
    walk(attractor, &untrimmed(attractor), before, tolerance, budget, &mut drop).map(|extent| extent.leaf_cells)
}

/// Roots that are drawn whole.
fn untrimmed(attractor: &Attractor) -> Vec<usize> {
    (0..attractor.roots().len()).filter(|&root| attractor.trim_of(root).is_none()).collect()
}

/// Sites that are computed and dropped.
#[derive(Default)]
struct Unseen;

impl Collector for Unseen {
    #[inline]
    fn push(&mut self, site: Site) {
        std::hint::black_box(site);
    }
}

impl Collector for Part {
    #[inline]
    fn push(&mut self, site: Site) {
        self.draw(site);
    }

    fn finish(&mut self, extent: Extent) {
        self.tessellation.leaf_cells = extent.leaf_cells;
        self.tessellation.deviation_mm = extent.deviation_mm;
    }
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

    fn draw(&mut self, site: Site) {
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

    /// Vectors grow to twice what they hold.
    fn check_memory(&self, tolerance: Tolerance, budget: &Budget) -> Result<(), RefineError> {
        let Tessellation { vertices, points, segments, triangles, .. } = &self.tessellation;
        let bytes = 2 * (24 * vertices.len() + 4 * points.len() + 8 * segments.len() + 12 * triangles.len()) as u64;
        let allowed_bytes = budget.limits.memory_bytes;
        if bytes <= allowed_bytes {
            return Ok(());
        }
        let leaf_cells = (points.len() + segments.len() + triangles.len()) as u64;
        Err(RefineError::Memory { allowed_bytes, tolerance_mm: tolerance.mm(), leaf_cells })
    }

    fn append(&mut self, other: Part) {
        if other.tessellation.vertices.is_empty() {
            return;
        }
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
        self.open_end = other.open_end.map(place);
    }
}
