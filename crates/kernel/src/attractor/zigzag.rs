//! Graphs of few triangles near surfaces that are rough along one parameter and smooth along the other.
//!
//! Let x = Q (a x b) be a product of a rough curve with parameter t and a smooth one that is a graph: of two of its coordinates, one is affine in t, the
//! other, s, depends on b alone, and the third is its height. Cells that are as low as a tolerance are far narrower, if the heights are rough. But what a shape's dilation is depends on
//! how far places are from it; and a line that leads up to the highest place above an interval [t, t + p], and down to the lowest one, is within p of all that is above it, however high that is.
//!
//! Let w be an interval that a word in the rough curve's transitions belongs to, C_j(a) the heights along the line s = s_j, and l_j and h_j their bounds over w, each within a slack g of a height that is there.
//! The zigzag along s_j is at its own heights at both ends of w, at h_j a third of the way between them, and at l_j two thirds; lines that follow each other are joined by two triangles between two steps of
//! each. Let s be c of the way from s_j to s_k, k = j + 1, and e the most that heights over w and between these lines, along s for the same a, are off what is linear in s between them; h = (1 - c) h_j + c h_k, and l likewise.
//!
//! * A place of the surface over w and s is no more than e above h, and e below l. The graph over w and s leads from h to l between t + p / 3 and t + 2 p / 3: there is one of its places within 2 p / 3 and e.
//! * A place of the graph over w and s is between l and h: it is on a triangle whose corners are at l_j, h_j, or between them, and at l_k, h_k, or between. Let C_j be highest at a, and c at most 1 / 2. At a the surface is above
//!   (1 - c) C_j(a) + c C_k(a) - e, which is no less than h - g - e less c (max D - D(a)), D = C_k - C_j: it has a place above h - g - e - o / 2, where o is by how much D varies over w. The same is true of l, and of C_k for larger c. As it is connected over w, the surface has a place over s as high as that of the graph, but for g + e + o / 2, and within p of it.
//!
//! So both are as near to each other as the hypotenuse of p and g + e + o / 2, both of which are of second order where s is smooth: narrow cells are long.

use super::cell::Point;
use super::deviation::{Steps, steps};
use super::enclosure::{attained, hull};
use super::{Attractor, Root};
use crate::automaton::{Ends, LeafPrimitive, StateId, SubdivisionOperator};
use crate::budget::{Budget, Stopped};
use crate::solid::TriMesh;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::HashMap;

/// The share of the deviation that bounds of heights may be off by.
const SLACK_SHARE: f64 = 0.15;
/// Lengths of words in the rough curve that are tried: the shortest that are narrow enough, and the next.
const TRIED: usize = 2;
/// Letters of words in the rough curve, and in the smooth one, at most.
const LONGEST_ROUGH: usize = 48;
const LONGEST: usize = 12;
/// Triangles between two lines over a column.
const PER_CELL: usize = 6;
/// Coordinates, and parameters, may miss what they should be by this much, relative to all.
const MISS: f64 = 1e-10;
/// Places are multiples of this share of the extent, so that those that are the same have the same bits.
const UNIT: f64 = 1.0 / (1_u64 << 42) as f64;

/// A root as a graph.
struct Sheet {
    rough: StateId,
    smooth: StateId,
    /// Of every control point of the smooth curve, those of the rough one: their heights.
    heights: Vec<Vec<f64>>,
    /// s at the smooth curve's control points.
    along: Vec<f64>,
    /// Where it begins along t and s, and by how much it goes on.
    origin: [f64; 2],
    way: [f64; 2],
}

/// A word's part of a curve.
struct Part {
    operator: SubdivisionOperator,
    state: StateId,
    /// The points at its ends, and their parameters, the smaller one first: shares of t, or of s.
    ends: [Vec<f64>; 2],
    parameters: [f64; 2],
}

/// All roots, the axes along t, s and up, and how far places are from where they are taken to be.
struct Sheets<'a> {
    attractor: &'a Attractor,
    all: Vec<Sheet>,
    axes: [usize; 3],
    off: f64,
    extent: f64,
}

/// A graph within a length of one that is rough along one of two axes and smooth along the other, before it is drawn.
pub(crate) struct Zigzag<'a> {
    sheets: Sheets<'a>,
    grids: Vec<Grid>,
    /// By how much bounds of heights may be off.
    slack: f64,
}

impl Attractor {
    /// A graph within a length of this one; none where this is none that is rough along one of two axes and smooth along the other, or more triangles than `most` are needed.
    ///
    /// Cost: less than a microsecond for each triangle, of which there are a few for each step of the length along t, times what a smooth curve takes.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(crate) fn zigzag(&self, within: f64, most: usize, budget: &Budget) -> Result<Option<Zigzag<'_>>, Stopped> {
        let Some(sheets) = Sheets::of(self) else { return Ok(None) };
        let slack = SLACK_SHARE * within;
        let mut grids = Vec::with_capacity(sheets.all.len());
        let mut left = most;
        for sheet in &sheets.all {
            let Some(grid) = sheets.grid(sheet, within - sheets.off, slack, left, budget)? else { return Ok(None) };
            left -= grid.triangles();
            grids.push(grid);
        }
        Ok(Some(Zigzag { sheets, grids, slack }))
    }

    fn ends(&self, curve: StateId) -> Option<&Ends> {
        match &self.automaton.state(curve).leaf {
            LeafPrimitive::Chord(ends) => Some(ends),
            _ => None,
        }
    }
}

impl Zigzag<'_> {
    /// How many triangles it has.
    pub(crate) fn triangles(&self) -> usize {
        self.grids.iter().map(Grid::triangles).sum()
    }

    /// The triangles, and how near they are to the attractor; none where heights cannot be told, or roots do not fit each other.
    ///
    /// Cost: some ten microseconds for each triangle.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(crate) fn drawn(&self, budget: &Budget) -> Result<Option<(TriMesh, f64)>, Stopped> {
        let Self { sheets, grids, slack } = self;
        let mut net = Net { unit: UNIT * sheets.extent, slack: *slack, numbers: HashMap::new(), mesh: TriMesh::default() };
        for (sheet, grid) in sheets.all.iter().zip(grids) {
            let Some(heights) = sheets.heights(sheet, grid, *slack, budget)? else { return Ok(None) };
            if net.add(sheet, grid, &heights, sheets.axes).is_none() {
                return Ok(None);
            }
        }
        let deviation = grids.iter().map(|grid| grid.deviation).fold(0.0, f64::max) + sheets.off;
        Ok(Some((net.mesh, deviation)))
    }
}

impl<'a> Sheets<'a> {
    fn of(attractor: &'a Attractor) -> Option<Self> {
        if !attractor.solids.is_empty() || attractor.has_own_radii() || !attractor.trimmed.is_empty() {
            return None;
        }
        let places = || attractor.roots.iter().flat_map(|root| &root.points);
        let extent = places().flat_map(|point| &point[..3]).fold(0.0_f64, |most, x| most.max(x.abs()));
        [[0, 1, 2], [1, 0, 2], [0, 2, 1], [2, 0, 1], [1, 2, 0], [2, 1, 0]].into_iter().find_map(|axes| {
            let mut off = UNIT * extent;
            let mut of_root = |root: &Root| {
                let (sheet, own) = sheet(attractor, root, axes, extent)?;
                off = off.max(own + UNIT * extent);
                Some(sheet)
            };
            let all = attractor.roots.iter().map(&mut of_root).collect::<Option<_>>()?;
            Some(Self { attractor, all, axes, off, extent })
        })
    }

    /// The words of both curves that are near enough with the fewest triangles; none where these would be too many, or the smooth curve is not.
    fn grid(&self, sheet: &Sheet, within: f64, slack: f64, most: usize, budget: &Budget) -> Result<Option<Grid>, Stopped> {
        let parameter = |point: &[f64]| self.attractor.precision(sheet.rough).map(|precision| precision.parameter(point)[0]);
        let (mut best, mut tried): (Option<Grid>, usize) = (None, 0);
        for length in 0..=LONGEST_ROUGH {
            budget.cancel.check()?;
            let most = best.as_ref().map_or(most, |grid| grid.triangles() - 1);
            let Some(columns) = parts(self.attractor, sheet.rough, parameter, length, most / PER_CELL) else { break };
            if columns.iter().map(|column| sheet.width(column)).fold(0.0, f64::max) < within {
                best = self.with_columns(sheet, columns, [within, slack], most, budget)?.or(best);
                tried += 1;
            }
            if tried == TRIED {
                break;
            }
        }
        Ok(best)
    }

    /// The same for words in the rough curve.
    fn with_columns(
        &self,
        sheet: &Sheet,
        columns: Vec<Part>,
        [within, slack]: [f64; 2],
        most: usize,
        budget: &Budget,
    ) -> Result<Option<Grid>, Stopped> {
        for length in 0..=LONGEST {
            let strips = parts(self.attractor, sheet.smooth, |point| Some(sheet.share(point)), length, most / PER_CELL);
            let Some(strips) = strips.filter(|strips| PER_CELL * columns.len() * strips.len() <= most) else { return Ok(None) };
            let off = |strip: &Part| -> Result<Option<f64>, Stopped> {
                budget.cancel.check()?;
                let Some(strip) = Strip::of(self.attractor, sheet, strip) else { return Ok(None) };
                let near = |column: &Part| sheet.width(column).hypot(strip.off(self.attractor, column) + slack);
                Ok(Some(columns.iter().map(near).fold(0.0, f64::max)))
            };
            let offs: Vec<Option<f64>> = strips.par_iter().map(off).collect::<Result<_, Stopped>>()?;
            let Some(offs) = offs.into_iter().collect::<Option<Vec<f64>>>() else { return Ok(None) };
            let deviation = offs.into_iter().fold(0.0, f64::max);
            if deviation <= within {
                return Ok(Some(Grid { columns, strips, deviation }));
            }
        }
        Ok(None)
    }

    /// Of every line of a grid, its own heights, the highest and the lowest ones: three for each column, and one at the end; none where they cannot be told.
    fn heights(&self, sheet: &Sheet, grid: &Grid, slack: f64, budget: &Budget) -> Result<Option<Vec<Vec<f64>>>, Stopped> {
        let at = |values: &[f64], point: &[f64]| values.iter().zip(point).map(|(value, x)| value * x).sum::<f64>();
        let line = |point: &Vec<f64>| -> Result<Option<Vec<f64>>, Stopped> {
            let values = sheet.line(point);
            let mut heights = Vec::with_capacity(3 * grid.columns.len() + 1);
            for column in &grid.columns {
                budget.cancel.check()?;
                let own = column.operator.pull_back(&values);
                let Some([low, high]) = attained(self.attractor, column.state, &own, slack) else { return Ok(None) };
                let start = at(&values, &column.ends[0]);
                // Rounding puts ends beyond bounds.
                heights.extend([start, high.max(start), low.min(start)]);
            }
            heights.extend(grid.columns.last().map(|column| at(&values, &column.ends[1])));
            Ok(Some(heights))
        };
        let all: Vec<Option<Vec<f64>>> = grid.lines().par_iter().map(line).collect::<Result<_, Stopped>>()?;
        Ok(all.into_iter().collect())
    }
}

/// A root as a graph, and how far places may be from where they are taken to be; none where it is none with these axes along t, s and up.
fn sheet(attractor: &Attractor, root: &Root, axes: [usize; 3], extent: f64) -> Option<(Sheet, f64)> {
    let automaton = attractor.automaton();
    let &[first, second] = automaton.factors(root.state) else { return None };
    let margin = |curve: StateId| attractor.bound(curve).margin();
    let (rough, smooth) = match [first, second].map(|curve| margin(curve) > 0.0) {
        [true, false] => (first, second),
        [false, true] => (second, first),
        _ => return None,
    };
    if root.rational {
        return None;
    }
    let [m, n] = [rough, smooth].map(|curve| automaton.state(curve).dimension);
    let point = |i: usize, j: usize| &root.points[if rough == first { i * n + j } else { j * m + i }];
    let precision = attractor.precision(rough)?;
    let ends = [attractor.ends(rough)?, attractor.ends(smooth)?];
    let place = |axis: usize, a: &[f64], b: &[f64]| -> f64 {
        a.iter().enumerate().flat_map(|(i, x)| b.iter().enumerate().map(move |(j, y)| x * y * point(i, j)[axis])).sum()
    };
    let origin = [0, 1].map(|k| place(axes[k], &ends[0].start, &ends[1].start));
    let way = [place(axes[0], &ends[0].end, &ends[1].start) - origin[0], place(axes[1], &ends[0].start, &ends[1].end) - origin[1]];
    let along: Vec<f64> = (0..n).map(|j| point(0, j)[axes[1]]).collect();
    let mut off = 0.0_f64;
    for i in 0..m {
        for (j, s) in along.iter().enumerate() {
            let t = origin[0] + precision.parameters[i][0] * way[0];
            off = off.max((point(i, j)[axes[0]] - t).abs()).max((point(i, j)[axes[1]] - s).abs());
        }
    }
    off *= 1.0 + 2.0 * margin(rough);
    // What is rounded of parameters where parts meet, and of the hull of what is between lines, counts too.
    off += precision.residual * way[0].abs() + MISS * (way[0].abs() + way[1].abs());
    let heights = (0..n).map(|j| (0..m).map(|i| point(i, j)[axes[2]]).collect()).collect();
    (off <= 8.0 * MISS * extent && way.iter().all(|way| way.abs() > MISS * extent))
        .then_some((Sheet { rough, smooth, heights, along, origin, way }, 2.0 * off))
}

/// The parts of a curve that words of a length belong to, in the order of their parameters; none where they are too many, or not one behind the other.
fn parts(
    attractor: &Attractor,
    curve: StateId,
    parameter: impl Fn(&[f64]) -> Option<f64>,
    length: usize,
    most: usize,
) -> Option<Vec<Part>> {
    let steps: Steps = steps(attractor, curve, length, most)?;
    let part = |(operator, state): (SubdivisionOperator, StateId)| {
        let own = attractor.ends(state)?;
        let mut ends = [&own.start, &own.end].map(|end| operator.apply(end));
        let mut parameters = [parameter(&ends[0])?, parameter(&ends[1])?];
        if parameters[1] < parameters[0] {
            ends.swap(0, 1);
            parameters.swap(0, 1);
        }
        Some(Part { operator, state, ends, parameters })
    };
    let mut parts: Vec<Part> = steps.into_iter().map(part).collect::<Option<_>>()?;
    parts.sort_by(|a, b| a.parameters[0].total_cmp(&b.parameters[0]));
    let mut at = 0.0;
    for part in &mut parts {
        if (part.parameters[0] - at).abs() > MISS || part.parameters[1] <= at {
            return None;
        }
        part.parameters[0] = at;
        at = part.parameters[1];
    }
    if (at - 1.0).abs() > MISS {
        return None;
    }
    parts.last_mut()?.parameters[1] = 1.0;
    Some(parts)
}

impl Sheet {
    /// How wide a part of the rough curve is.
    fn width(&self, part: &Part) -> f64 {
        (part.parameters[1] - part.parameters[0]) * self.way[0].abs()
    }

    /// Where a point of the smooth curve is, as a share of the way along s.
    fn share(&self, point: &[f64]) -> f64 {
        (self.along.iter().zip(point).map(|(s, x)| s * x).sum::<f64>() - self.origin[1]) / self.way[1]
    }

    /// The heights of the rough curve's control points along the line where the smooth one has a point.
    fn line(&self, point: &[f64]) -> Vec<f64> {
        let value = |i: usize| self.heights.iter().zip(point).map(|(own, x)| own[i] * x).sum();
        (0..self.heights[0].len()).map(value).collect()
    }
}

/// What is between two lines.
struct Strip {
    /// D, and the differences of points in whose hull the smooth curve lies from what is linear between the lines: values at the rough curve's control points.
    difference: Vec<f64>,
    bent: Vec<Vec<f64>>,
    /// By how much these may be off, as shares and hulls are rounded.
    missed: f64,
}

impl Strip {
    fn of(attractor: &Attractor, sheet: &Sheet, part: &Part) -> Option<Self> {
        if attractor.bound(part.state).margin() > 0.0 {
            return None;
        }
        let [from, to] = part.ends.each_ref().map(|end| sheet.line(end));
        let difference: Vec<f64> = to.iter().zip(&from).map(|(to, from)| to - from).collect();
        let (points, miss) = hull(attractor, part.state);
        let points = part.operator.times(&points);
        let [start, end] = part.parameters;
        let shares: Vec<f64> = (0..points.columns()).map(|k| (sheet.share(points.column(k)) - start) / (end - start)).collect();
        // What is between the lines seen from above is between them on the curve.
        let slack = MISS / (end - start);
        if !shares.iter().all(|share| (-slack..=1.0 + slack).contains(share)) {
            return None;
        }
        let bent = (0..points.columns()).zip(&shares).map(|(k, share)| {
            let own = sheet.line(points.column(k));
            own.iter().zip(from.iter().zip(&difference)).map(|(own, (from, way))| own - from - share * way).collect()
        });
        let largest = |values: &[f64]| values.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let all = sheet.heights.iter().map(|own| largest(own)).fold(0.0, f64::max);
        let missed = (slack + miss) * largest(&difference) + miss * all;
        Some(Self { bent: bent.collect(), difference, missed })
    }

    /// e + o / 2 over a column.
    fn off(&self, attractor: &Attractor, column: &Part) -> f64 {
        let (bound, enclosure) = (attractor.bound(column.state), attractor.enclosure(column.state));
        let range = |values: &[f64]| {
            let values = column.operator.pull_back(values);
            match enclosure {
                Some(enclosure) => enclosure.range(enclosure.columns.pull_back(&values).into_iter()),
                None => bound.range(&values),
            }
        };
        let [low, high] = range(&self.difference);
        let bent = self.bent.iter().map(|values| range(values).map(f64::abs)).map(|[low, high]| low.max(high)).fold(0.0, f64::max);
        0.5 * (high - low) + bent + (1.0 + 2.0 * bound.margin()) * self.missed
    }
}

/// Words of both curves.
struct Grid {
    columns: Vec<Part>,
    strips: Vec<Part>,
    /// How near the graph is to the sheet.
    deviation: f64,
}

impl Grid {
    fn triangles(&self) -> usize {
        PER_CELL * self.columns.len() * self.strips.len()
    }

    /// The points of the smooth curve that lines belong to.
    fn lines(&self) -> Vec<Vec<f64>> {
        let starts = self.strips.iter().map(|strip| &strip.ends[0]);
        starts.chain(self.strips.last().map(|strip| &strip.ends[1])).cloned().collect()
    }
}

/// A graph in the making.
struct Net {
    unit: f64,
    slack: f64,
    /// Vertices by their places, in units.
    numbers: HashMap<[i64; 2], u32>,
    mesh: TriMesh,
}

impl Net {
    /// Adds the graph of a root; none where it has other heights than one beside it.
    fn add(&mut self, sheet: &Sheet, grid: &Grid, heights: &[Vec<f64>], axes: [usize; 3]) -> Option<()> {
        let mut at = Vec::with_capacity(3 * grid.columns.len() + 1);
        for Part { parameters: [from, to], .. } in &grid.columns {
            at.extend([0.0, 1.0, 2.0].map(|third| from + third / 3.0 * (to - from)));
        }
        at.push(1.0);
        let lines = grid.strips.iter().map(|strip| strip.parameters[0]).chain([1.0]);
        let mut numbers: Vec<Vec<u32>> = Vec::with_capacity(heights.len());
        for (s, own) in lines.zip(heights) {
            numbers.push(at.iter().zip(own).map(|(t, height)| self.number([*t, s], *height, sheet, axes)).collect::<Option<_>>()?);
        }
        for lines in numbers.windows(2) {
            for (a, b) in lines[0].windows(2).zip(lines[1].windows(2)) {
                self.mesh.triangles.extend([[a[0], a[1], b[1]], [a[0], b[1], b[0]]]);
            }
        }
        Some(())
    }

    /// The vertex at some parameters.
    fn number(&mut self, parameters: [f64; 2], height: f64, sheet: &Sheet, axes: [usize; 3]) -> Option<u32> {
        let steps = [0, 1].map(|k| ((sheet.origin[k] + parameters[k] * sheet.way[k]) / self.unit).round());
        let vertices = &mut self.mesh.vertices;
        let number = *self.numbers.entry(steps.map(|step| step as i64)).or_insert_with(|| {
            let mut place: Point = [0.0; 3];
            (place[axes[0]], place[axes[1]], place[axes[2]]) = (steps[0] * self.unit, steps[1] * self.unit, height);
            vertices.push(DVec3::from_array(place));
            vertices.len() as u32 - 1
        });
        // Bounds of what two roots have in common are as near to it as they should be, each.
        ((vertices[number as usize][axes[2]] - height).abs() <= self.slack).then_some(number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::cell::{closest_on_segment, distance_squared};
    use crate::attractor::refine;
    use crate::automaton::Transition;
    use crate::budget::StopReason;
    use crate::dilation::dilate;
    use crate::measure::triangle::closest_on_triangle;
    use crate::model::{ControlNet, CurveScheme, Model, Shape, TensorProduct};
    use crate::split_mix::Random;
    use crate::tolerance::{Radius, Tolerance};

    fn rough(scaling: &[f64]) -> CurveScheme {
        CurveScheme::Interpolation { vertical_scaling: scaling.to_vec() }
    }

    /// A product over a grid of control points with heights by chance, moved to a place by the map.
    fn product(schemes: [CurveScheme; 2], size: [usize; 2], place: impl Fn(DVec3) -> DVec3) -> Attractor {
        let mut random = Random(3);
        let points =
            (0..size[0] * size[1]).map(|k| place(DVec3::new(3.0 * (k / size[1]) as f64, 2.0 * (k % size[1]) as f64, 6.0 * random.share())));
        let control_points = ControlNet { size: size.to_vec(), points: points.collect(), weights: None };
        let shape = Shape::TensorProduct(TensorProduct { schemes: schemes.to_vec(), control_points, separate: true, trim: None });
        Model { name: None, shape }.lower().unwrap().attractor
    }

    fn cubic() -> CurveScheme {
        CurveScheme::Nurbs { degree: 3, knots: vec![0.0, 0.0, 0.0, 0.0, 0.4, 1.0, 1.0, 1.0, 1.0] }
    }

    fn graphs() -> Vec<Attractor> {
        vec![
            product([rough(&[0.45, -0.5, 0.4, 0.5]), cubic()], [5, 5], |place| place),
            product([CurveScheme::Bezier, rough(&[0.6, -0.5])], [4, 3], |place| DVec3::new(place.z, place.x, -place.y)),
        ]
    }

    /// Places of the surface at a share of the way along s, one behind the other along t: between two of them it leads from one to the other, within a step of t.
    fn section(sheets: &Sheets<'_>, sheet: &Sheet, share: f64, length: usize) -> Vec<Point> {
        let attractor = sheets.attractor;
        let (mut state, mut word) = (sheet.smooth, SubdivisionOperator::identity(sheet.along.len()));
        for _ in 0..40 {
            let next = |step: &Transition| {
                let (word, ends) = (word.times(&step.operator), attractor.ends(step.to)?);
                let [from, to] = [&ends.start, &ends.end].map(|end| sheet.share(&word.apply(end)));
                (share >= from.min(to) && share <= from.max(to)).then_some((step.to, word))
            };
            let Some(found) = attractor.automaton().state(state).transitions.iter().find_map(next) else { break };
            (state, word) = found;
        }
        let values = sheet.line(&word.apply(&attractor.ends(state).unwrap().start));
        let parameter = |point: &[f64]| attractor.precision(sheet.rough).map(|precision| precision.parameter(point)[0]);
        let columns = parts(attractor, sheet.rough, parameter, length, 1 << 20).unwrap();
        let place = |column: &Part| {
            let mut place = [0.0; 3];
            place[sheets.axes[0]] = sheet.origin[0] + column.parameters[0] * sheet.way[0];
            place[sheets.axes[1]] = sheet.origin[1] + share * sheet.way[1];
            place[sheets.axes[2]] = values.iter().zip(&column.ends[0]).map(|(value, x)| value * x).sum();
            place
        };
        columns.iter().map(place).collect()
    }

    fn to_line(x: &Point, line: &[Point]) -> f64 {
        let square = |ends: &[Point]| distance_squared(x, &closest_on_segment(x, &ends[0], &ends[1]));
        line.windows(2).map(square).fold(f64::INFINITY, f64::min).sqrt()
    }

    fn corners(mesh: &TriMesh) -> Vec<[Point; 3]> {
        mesh.triangles.iter().map(|triangle| triangle.map(|corner| mesh.vertices[corner as usize].to_array())).collect()
    }

    /// Places of the surface are as near to the graph as it says, and places of the graph to those of the surface, which are as near to each other as is added.
    #[test]
    fn graphs_are_as_near_as_they_say() {
        for (number, attractor) in graphs().iter().enumerate() {
            for within in [0.6, 0.3] {
                let zigzag = attractor.zigzag(within, 1 << 20, &Budget::default()).unwrap().unwrap();
                let (mesh, deviation) = zigzag.drawn(&Budget::default()).unwrap().unwrap();
                assert_eq!(mesh.triangles.len(), zigzag.triangles());
                assert!(deviation <= within && deviation > 0.2 * within, "{number}: {deviation}");
                let sheets = &zigzag.sheets;
                let triangles = corners(&mesh);
                let near = |x: &Point, distance: f64| {
                    let may_be = |[a, b, c]: &[Point; 3]| {
                        (0..3).all(|k| a[k].min(b[k]).min(c[k]) <= x[k] + distance && a[k].max(b[k]).max(c[k]) >= x[k] - distance)
                    };
                    let closest = |[a, b, c]: &[Point; 3]| distance_squared(x, &closest_on_triangle(x, a, b, c));
                    triangles.iter().filter(|own| may_be(own)).map(closest).fold(f64::INFINITY, f64::min).sqrt()
                };
                let (length, along) = (if number == 0 { 7 } else { 12 }, sheets.axes[1]);
                let mut random = Random(number as u64);
                let mut farthest = [0.0_f64; 2];
                for _ in 0..12 {
                    let sheet = &sheets.all[(random.share() * sheets.all.len() as f64) as usize];
                    let line = section(sheets, sheet, random.share(), length);
                    for _ in 0..25 {
                        let x = &line[(random.share() * line.len() as f64) as usize];
                        farthest[0] = farthest[0].max(near(x, deviation));
                    }
                    // Sides of triangles that the section meets.
                    for [a, b, _] in triangles.iter().step_by(29) {
                        let share = (line[0][along] - a[along]) / (b[along] - a[along]);
                        if (0.0..=1.0).contains(&share) {
                            let x: Point = std::array::from_fn(|k| a[k] + share * (b[k] - a[k]));
                            farthest[1] = farthest[1].max(to_line(&x, &line));
                        }
                    }
                }
                let step = sheets.all[0].way[0].abs() / 4000.0;
                let are_near = farthest[0] <= deviation && farthest[1] <= deviation + step;
                assert!(are_near && farthest.iter().all(|&far| far > 0.1 * deviation), "{number}: {farthest:?} {deviation}");
            }
        }
    }

    /// Cells of such heights would be as narrow as they are low.
    #[test]
    fn graphs_have_few_triangles() {
        let attractor = &graphs()[0];
        let triangles = |within: f64| attractor.zigzag(within, 1 << 24, &Budget::default()).unwrap().unwrap().triangles();
        let cells = refine(attractor, Tolerance::new(0.1).unwrap(), &Budget::default()).unwrap().leaf_cells as usize;
        assert!(4 * triangles(0.1) < 2 * cells, "{} {cells}", triangles(0.1));
    }

    #[test]
    fn what_is_no_such_graph_is_left() {
        let turned = |place: DVec3| DVec3::new(place.x + 0.1 * place.y, place.y - 0.1 * place.x, place.z);
        let bent = |place: DVec3| DVec3::new(place.x + 0.1 * place.z, place.y + 0.2 * place.z, place.z);
        let none = [
            product([rough(&[0.5, -0.5]), cubic()], [3, 5], turned),
            product([rough(&[0.5, -0.5]), cubic()], [3, 5], bent),
            product([cubic(), cubic()], [5, 5], |place| place),
            product([rough(&[0.5, -0.5]), rough(&[0.5, -0.4])], [3, 3], |place| place),
        ];
        for (number, attractor) in none.iter().enumerate() {
            assert!(attractor.zigzag(0.5, 1 << 24, &Budget::default()).unwrap().is_none(), "{number}");
        }
        let graph = &graphs()[0];
        let triangles = graph.zigzag(0.5, 1 << 24, &Budget::default()).unwrap().unwrap().triangles();
        assert!(graph.zigzag(0.5, triangles, &Budget::default()).unwrap().is_some());
        assert!(graph.zigzag(0.5, triangles / 2, &Budget::default()).unwrap().is_none());
        let budget = Budget::default();
        budget.cancel.fire(StopReason::Cancelled);
        assert!(graph.zigzag(0.5, 1 << 24, &budget).is_err());
    }

    /// Both sheets are made of the graph, and all of the solid is as far from the surface as it should be.
    #[test]
    fn rough_graphs_are_thickened_by_sheets() {
        let attractor = &graphs()[0];
        let (r, e) = (1.0, 0.2);
        let (radius, tolerance) = (Radius::new(r).unwrap(), Tolerance::new(e).unwrap());
        let made = dilate(attractor, radius, tolerance, &Budget::default()).unwrap();
        assert!(made.pitch_mm.is_none() && made.inner_mm <= e && made.outer_mm <= e);
        let zigzag = attractor.zigzag(0.5 * e, 1 << 24, &Budget::default()).unwrap().unwrap();
        assert_eq!(made.leaf_cells as usize, zigzag.triangles());
        let sheets = &zigzag.sheets;
        let of_sheet = |sheet| (0..=40).map(move |k| section(sheets, sheet, f64::from(k) / 40.0, 6));
        let lines: Vec<Vec<Point>> = sheets.all.iter().flat_map(of_sheet).collect();
        let mesh = made.solid.mesh();
        for triangle in mesh.triangles.iter().step_by(mesh.triangles.len() / 300) {
            let x = triangle.iter().map(|&corner| mesh.vertices[corner as usize] / 3.0).sum::<DVec3>().to_array();
            let nearest = lines.iter().map(|line| to_line(&x, line)).fold(f64::INFINITY, f64::min);
            // Places of the surface are no farther from one of these than half a step along s, and what it is steep.
            assert!(nearest >= r - made.inner_mm - 0.01 && nearest <= r + made.outer_mm + 0.2, "{nearest}");
        }
    }
}
