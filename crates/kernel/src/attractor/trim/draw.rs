//! Draws trimmed surfaces: leaf cells beside the loops are filled up to them, cells outside are left out.
//!
//! The loops' polygons are handed down the tree of cells, cut at the lines where cells are parted, so that every crossing
//! is computed once and lies exactly on its line. A leaf is filled with all corners that any leaf has on its sides:
//! neighbours agree on them without being compared.

use super::TrimmedSurface;
use super::arc::Parameter;
use super::fill::{Filler, Segment};
use super::rays::Rays;
use crate::attractor::cell::{Cell, ControlPoint, child_points};
use crate::attractor::complex::{CellComplex, NONE, fill};
use crate::attractor::{Attractor, RefineError};
use crate::budget::Budget;
use crate::tessellation::Tessellation;
use crate::tolerance::Tolerance;
use glam::DVec3;
use std::collections::HashMap;

/// Share of the tolerance that leaf cells may use; what remains is the loops'.
const LEAF_SHARE: f64 = 0.75;

/// A leaf that is at least partly inside.
struct Leaf {
    spans: [usize; 2],
    bounds: [Parameter; 2],
    node: u32,
    /// The loops' segments in it; none when it is wholly inside.
    segments: Vec<Segment>,
}

/// A line of constant u or v along one span of the other direction: (direction, span and value, the other span).
type Line = (usize, usize, u64, usize);

/// A vertex: its span and value in u and in v; or a pole.
type Place = [(usize, u64); 2];

/// A cell on the way down.
struct Visit<'p> {
    cell: Cell,
    points: &'p [ControlPoint],
    spans: [usize; 2],
    bounds: [Parameter; 2],
    node: u32,
    depth: u32,
}

struct Drawer<'a> {
    attractor: &'a Attractor,
    surface: &'a TrimmedSurface,
    budget: &'a Budget,
    tolerance_mm: f64,
    /// Of leaf cells.
    share_mm: f64,
    rays: Rays,
    leaves: Vec<Leaf>,
    lines: HashMap<Line, Vec<f64>>,
    nodes: Vec<(u32, u32)>,
    deviation: f64,
    segments: usize,
    visited: u64,
}

/// Draws the attractor's trimmed surfaces.
///
/// # Errors
/// [`RefineError`] when a limit is hit or somebody stops it.
pub(crate) fn refine(attractor: &Attractor, tolerance: Tolerance, budget: &Budget) -> Result<Tessellation, RefineError> {
    let mut whole = Tessellation::default();
    for surface in attractor.trimmed() {
        let drawn = one(attractor, surface, tolerance.mm(), whole.leaf_cells, budget)?;
        whole.append(drawn);
    }
    Ok(whole)
}

fn one(attractor: &Attractor, surface: &TrimmedSurface, tolerance: f64, before: u64, budget: &Budget) -> Result<Tessellation, RefineError> {
    let scale = surface.derivatives();
    let moved = surface.moved_mm() + attractor.seam_mm;
    let left = (tolerance - moved).max(0.0);
    let allowed = budget.limits.cells.saturating_sub(before);
    let too_many = || RefineError::Cells { allowed: budget.limits.cells, tolerance_mm: tolerance };
    if left == 0.0 {
        return Err(too_many());
    }
    let sagitta = (1.0 - LEAF_SHARE) * left / (2.0 * 2.0_f64.sqrt());
    let most = usize::try_from(allowed).unwrap_or(usize::MAX).min(u32::MAX as usize);
    let polygons = surface.region.polygons(scale, sagitta, most).ok_or_else(too_many)?;
    let mut segments = Vec::new();
    for polygon in &polygons {
        segments.extend((0..polygon.len()).map(|k| [polygon[k], polygon[(k + 1) % polygon.len()]]));
    }
    let rays = Rays::new(segments.iter().map(|&ends| (ends, 0)).collect());
    let mut drawer = Drawer {
        attractor,
        surface,
        budget,
        tolerance_mm: tolerance,
        share_mm: LEAF_SHARE * left,
        rays,
        leaves: Vec::new(),
        lines: HashMap::new(),
        nodes: Vec::new(),
        deviation: 0.0,
        segments: 0,
        visited: before,
    };
    let counts = [0, 1].map(|k| surface.intervals[k].len());
    drawer.spans([[0, counts[0]], [0, counts[1]]], segments)?;
    drawer.lines.values_mut().for_each(|values| {
        values.sort_by(f64::total_cmp);
        values.dedup();
    });
    let mut tessellation = drawer.draw(scale)?;
    tessellation.deviation_mm += sagitta * 2.0 * 2.0_f64.sqrt() + moved;
    Ok(tessellation)
}

/// Cuts segments at a line of constant u (k = 0) or v: those below, and those above. A segment on it is both.
fn cut(segments: &[Segment], k: usize, at: f64) -> [Vec<Segment>; 2] {
    let mut parts = [Vec::new(), Vec::new()];
    for segment in segments {
        let [a, b] = *segment;
        // What only touches the line is on one side of it.
        if a[k] <= at && b[k] <= at {
            parts[0].push(*segment);
        }
        if a[k] >= at && b[k] >= at {
            parts[1].push(*segment);
        }
        if (a[k] < at && b[k] > at) || (a[k] > at && b[k] < at) {
            let other = 1 - k;
            let along = (at - a[k]) / (b[k] - a[k]);
            let crossing = (a[other] + along * (b[other] - a[other])).clamp(a[other].min(b[other]), a[other].max(b[other]));
            let mut middle = [at; 2];
            middle[other] = crossing;
            let below = usize::from(a[k] > at);
            parts[below].push([a, middle]);
            parts[1 - below].push([middle, b]);
        }
    }
    parts
}

impl Drawer<'_> {
    /// Hands segments down to pairs of spans. A range without segments is inside or outside as a whole.
    fn spans(&mut self, ranges: [[usize; 2]; 2], segments: Vec<Segment>) -> Result<(), RefineError> {
        let lengths = ranges.map(|[first, end]| end - first);
        let k = usize::from(lengths[1] > lengths[0]);
        if lengths[k] == 1 {
            let spans = ranges.map(|[first, _]| first);
            let Some(root) = self.surface.cell(spans).root else { return Ok(()) };
            self.nodes.push((NONE, root as u32));
            let node = self.nodes.len() as u32 - 1;
            let (cell, points) = (self.attractor.root_cell(root), &self.attractor.roots()[root].points);
            return self.cell(&Visit { cell, points, spans, bounds: self.surface.span_box(spans), node, depth: 0 }, segments);
        }
        let middle = (ranges[k][0] + ranges[k][1]) / 2;
        let parts = cut(&segments, k, self.surface.intervals[k][middle][0]);
        for (part, side) in parts.into_iter().zip([[ranges[k][0], middle], [middle, ranges[k][1]]]) {
            let mut own = ranges;
            own[k] = side;
            self.spans(own, part)?;
        }
        Ok(())
    }

    /// Refines a cell that the loops' segments may cross.
    fn cell(&mut self, visit: &Visit<'_>, mut segments: Vec<Segment>) -> Result<(), RefineError> {
        // Segments on the border part nothing; all is inside or all is outside.
        let [low, high] = visit.bounds;
        let on_border = |[a, b]: &Segment| (0..2).any(|k| a[k] == b[k] && (a[k] == low[k] || a[k] == high[k]));
        if segments.iter().all(on_border) {
            segments.clear();
            if !self.rays.inside([0, 1].map(|k| 0.5 * (low[k] + high[k]))) {
                return Ok(());
            }
        }
        self.inside(visit, segments)
    }

    /// Refines a cell that is not outside.
    fn inside(&mut self, visit: &Visit<'_>, segments: Vec<Segment>) -> Result<(), RefineError> {
        let Visit { ref cell, points, spans, bounds, node, depth } = *visit;
        let error = self.attractor.leaf_error(cell, points);
        if error <= self.share_mm {
            return self.leaf(Leaf { spans, bounds, node, segments }, error);
        }
        let middle = [0, 1].map(|k| 0.5 * (bounds[0][k] + bounds[1][k]));
        // Parameters that double precision cannot part end a descent too.
        if depth >= self.budget.limits.depth || (0..2).any(|k| middle[k] <= bounds[0][k] || middle[k] >= bounds[1][k]) {
            return Err(RefineError::Depth { allowed: depth, tolerance_mm: self.tolerance_mm, reached_mm: error });
        }
        let whole = segments.is_empty();
        let mut parts: Vec<Vec<Segment>> = cut(&segments, 0, middle[0]).iter().flat_map(|half| cut(half, 1, middle[1])).collect();
        drop(segments);
        for (index, transition) in self.attractor.automaton().state(cell.state).transitions.iter().enumerate() {
            let mut child = vec![[0.0; 4]; transition.operator.columns()];
            child_points(points, &transition.operator, &mut child);
            self.nodes.push((node, index as u32));
            let own = Visit {
                cell: self.attractor.child_cell(cell, index, &child),
                points: &child,
                spans,
                bounds: TrimmedSurface::child_box(&bounds, index),
                node: self.nodes.len() as u32 - 1,
                depth: depth + 1,
            };
            if whole {
                self.inside(&own, Vec::new())?;
            } else {
                self.cell(&own, std::mem::take(&mut parts[index]))?;
            }
        }
        Ok(())
    }

    /// Keeps a leaf, and notes what lies on its sides.
    fn leaf(&mut self, leaf: Leaf, error: f64) -> Result<(), RefineError> {
        self.visited += 1;
        self.segments += leaf.segments.len();
        self.deviation = self.deviation.max(error);
        if self.visited.is_multiple_of(1024) {
            self.budget.cancel.check()?;
            self.budget.report("refine", 0.0, self.visited);
        }
        let (allowed, tolerance_mm) = (self.budget.limits.cells, self.tolerance_mm);
        if self.visited > allowed {
            return Err(RefineError::Cells { allowed, tolerance_mm });
        }
        // Leaves with their corners on lines, and what is drawn of them.
        let bytes = 700 * self.leaves.len() as u64 + 400 * self.segments as u64;
        let allowed_bytes = self.budget.limits.memory_bytes;
        if bytes > allowed_bytes {
            return Err(RefineError::Memory { allowed_bytes, tolerance_mm, leaf_cells: self.visited });
        }
        let [low, high] = leaf.bounds;
        for end in [low, high] {
            for k in 0..2 {
                self.note(leaf.spans, k, end[k], low[1 - k]);
                self.note(leaf.spans, k, end[k], high[1 - k]);
            }
        }
        for point in leaf.segments.iter().flatten() {
            for k in (0..2).filter(|&k| point[k] == low[k] || point[k] == high[k]) {
                self.note(leaf.spans, k, point[k], point[1 - k]);
            }
        }
        self.leaves.push(leaf);
        Ok(())
    }

    /// The span that a value belongs to: the end of a span is the start of the next.
    fn canonical(&self, k: usize, span: usize, value: f64) -> (usize, u64) {
        let intervals = &self.surface.intervals[k];
        if value != intervals[span][1] {
            return (span, value.to_bits());
        }
        match intervals.get(span + 1) {
            Some(_) => (span + 1, value.to_bits()),
            None if self.surface.closed[k] => (0, intervals[0][0].to_bits()),
            None => (span, value.to_bits()),
        }
    }

    fn line(&self, spans: [usize; 2], k: usize, value: f64) -> Line {
        let (span, bits) = self.canonical(k, spans[k], value);
        (k, span, bits, spans[1 - k])
    }

    fn note(&mut self, spans: [usize; 2], k: usize, value: f64, other: f64) {
        let line = self.line(spans, k, value);
        self.lines.entry(line).or_default().push(other);
    }

    /// The parameters on the sides of a leaf, counterclockwise from its low corner.
    fn outline(&self, leaf: &Leaf, out: &mut Vec<Parameter>) {
        out.clear();
        let [low, high] = leaf.bounds;
        let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
        for (side, corner) in corners.into_iter().enumerate() {
            out.push(corner);
            // Sides 0 and 2 have constant v.
            let (k, backwards) = (1 - side % 2, side >= 2);
            let Some(values) = self.lines.get(&self.line(leaf.spans, k, corner[k])) else { continue };
            let other = 1 - k;
            let first = values.partition_point(|&value| value <= low[other]);
            let end = values.partition_point(|&value| value < high[other]).max(first);
            let place = |&value: &f64| {
                let mut point = corner;
                point[other] = value;
                point
            };
            if backwards {
                out.extend(values[first..end].iter().rev().map(place));
            } else {
                out.extend(values[first..end].iter().map(place));
            }
        }
    }

    /// What tells vertices apart: parameters, but all of a collapsed side are one.
    fn place(&self, spans: [usize; 2], parameter: Parameter) -> Place {
        let collapsed = self.surface.cell(spans).collapsed;
        let mut place = [0, 1].map(|k| self.canonical(k, spans[k], parameter[k]));
        for (k, end) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            if collapsed[2 * k + end] && parameter[k] == self.surface.intervals[k][spans[k]][end] {
                place[1 - k] = (usize::MAX, self.pole(spans, k, end) as u64);
            }
        }
        place
    }

    /// The first of the successive spans whose sides are collapsed with this one.
    fn pole(&self, spans: [usize; 2], k: usize, end: usize) -> usize {
        let count = self.surface.intervals[1 - k].len();
        let collapsed = |other: usize| {
            let mut spans = spans;
            spans[1 - k] = other;
            self.surface.cell(spans).collapsed[2 * k + end]
        };
        let mut first = spans[1 - k];
        for _ in 0..count {
            let before = match first.checked_sub(1) {
                Some(before) => before,
                None if self.surface.closed[1 - k] => count - 1,
                None => break,
            };
            if !collapsed(before) {
                return first;
            }
            if before > first {
                // All around, or up to here from the end: either way, the run is the same from everywhere.
                let all = (0..count).all(collapsed);
                if all {
                    return 0;
                }
            }
            first = before;
        }
        first
    }

    /// Triangles of all leaves.
    fn draw(self, scale: [f64; 2]) -> Result<Tessellation, RefineError> {
        let mut drawn = Drawn { drawer: &self, ids: HashMap::new(), mesh: Tessellation::default(), origins: Vec::new(), nodes: Vec::new() };
        let mut filler = Filler::new(scale);
        let (mut outline, mut loop_ids) = (Vec::new(), Vec::new());
        for (index, leaf) in self.leaves.iter().enumerate() {
            if index % 256 == 0 {
                self.budget.cancel.check()?;
            }
            self.outline(leaf, &mut outline);
            if leaf.segments.is_empty() {
                loop_ids.clear();
                loop_ids.extend(outline.iter().map(|&parameter| drawn.vertex(leaf, parameter)));
                loop_ids.dedup();
                if loop_ids.len() > 1 && loop_ids.first() == loop_ids.last() {
                    loop_ids.pop();
                }
                let middle = [0, 1].map(|k| 0.5 * (leaf.bounds[0][k] + leaf.bounds[1][k]));
                let Tessellation { vertices, triangles, .. } = &mut drawn.mesh;
                if fill(&loop_ids, vertices.len() as u32, vertices, triangles) {
                    vertices.push(DVec3::from_array(self.surface.point(leaf.spans, middle)));
                }
            } else {
                for corners in filler.fill(&outline, &leaf.segments, &self.rays) {
                    let ids = corners.map(|parameter| drawn.vertex(leaf, parameter));
                    if ids[0] != ids[1] && ids[1] != ids[2] && ids[2] != ids[0] {
                        drawn.mesh.triangles.push(ids);
                    }
                }
            }
            drawn.nodes.resize(drawn.mesh.triangles.len(), leaf.node);
            drawn.origins.resize(drawn.mesh.vertices.len(), leaf.node);
        }
        let Drawn { mut mesh, origins, nodes, .. } = drawn;
        mesh.leaf_cells = self.leaves.len() as u64;
        mesh.deviation_mm = self.deviation;
        mesh.complex = Some(CellComplex::of_triangles(self.attractor, self.nodes, &origins, &mesh.triangles, nodes));
        Ok(mesh)
    }
}

/// The mesh in the making.
struct Drawn<'a> {
    drawer: &'a Drawer<'a>,
    ids: HashMap<Place, u32>,
    mesh: Tessellation,
    /// The nodes of the leaves that vertices and triangles were met in.
    origins: Vec<u32>,
    nodes: Vec<u32>,
}

impl Drawn<'_> {
    fn vertex(&mut self, leaf: &Leaf, parameter: Parameter) -> u32 {
        let vertices = &mut self.mesh.vertices;
        *self.ids.entry(self.drawer.place(leaf.spans, parameter)).or_insert_with(|| {
            vertices.push(DVec3::from_array(self.drawer.surface.point(leaf.spans, parameter)));
            vertices.len() as u32 - 1
        })
    }
}
