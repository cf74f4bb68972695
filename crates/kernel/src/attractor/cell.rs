//! Cells: instances of states. Their control points, their bounding ball, and what stands for them
//! when they are small enough.

use super::{Attractor, LinearPrecision, StateBound};
use crate::automaton::{Ends, LeafPrimitive, State, StateId, SubdivisionOperator};
use crate::measure::triangle::closest_on_triangle;

/// A point or vector of space in mm.
pub type Point = [f64; 3];
/// A homogeneous control point (w x, w y, w z, w).
pub type ControlPoint = [f64; 4];

/// A ball that contains a cell and everything drawn for its descendants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its centre in mm.
    pub centre: Point,
    /// Its radius in mm.
    pub radius: f64,
}

impl Ball {
    pub(super) fn is_finite(&self) -> bool {
        self.radius.is_finite() && self.centre.iter().all(|x| x.is_finite())
    }
}

/// What stands for a leaf cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Site {
    /// A point.
    Point(Point),
    /// A segment.
    Segment([Point; 2]),
    /// A triangle.
    Triangle([Point; 3]),
}

impl Site {
    /// The point of the site closest to x.
    #[inline]
    #[must_use]
    pub fn closest(&self, x: &Point) -> Point {
        match self {
            Self::Point(point) => *point,
            Self::Segment([a, b]) => closest_on_segment(x, a, b),
            Self::Triangle([a, b, c]) => closest_on_triangle(x, a, b, c),
        }
    }

    /// The squared distance of x from the site.
    #[inline]
    #[must_use]
    pub fn distance_squared(&self, x: &Point) -> f64 {
        distance_squared(x, &self.closest(x))
    }
}

/// A bounded cell. `stretch` is, for frames, a bound of the norm of the root's frame times the product
/// of the ratios on the way: with the state's radius it bounds the cell again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Its kind.
    pub state: StateId,
    /// The root that it descends from.
    pub root: u32,
    /// Where it is.
    pub ball: Ball,
    /// See above.
    pub stretch: f64,
}

#[inline]
fn project(point: &ControlPoint, rational: bool) -> Point {
    if rational {
        let inverse = 1.0 / point[3];
        [point[0] * inverse, point[1] * inverse, point[2] * inverse]
    } else {
        [point[0], point[1], point[2]]
    }
}

#[inline]
pub(crate) fn subtract(a: &Point, b: &Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The point at a share of the way from a to b.
#[inline]
pub(crate) fn between(a: &Point, b: &Point, share: f64) -> Point {
    std::array::from_fn(|axis| a[axis] + share * (b[axis] - a[axis]))
}

#[inline]
pub(crate) fn dot(a: &Point, b: &Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
pub(crate) fn cross(a: &Point, b: &Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The vector at length 1; 0 stays 0.
#[inline]
pub(crate) fn unit(vector: &Point) -> Point {
    let length = dot(vector, vector).sqrt().max(f64::MIN_POSITIVE);
    vector.map(|part| part / length)
}

#[inline]
pub(crate) fn distance_squared(a: &Point, b: &Point) -> f64 {
    let difference = subtract(a, b);
    dot(&difference, &difference)
}

/// The point of segment ab closest to x.
#[inline]
pub(crate) fn closest_on_segment(x: &Point, a: &Point, b: &Point) -> Point {
    let direction = subtract(b, a);
    let length = dot(&direction, &direction);
    let along = if length > 0.0 { (dot(&subtract(x, a), &direction) / length).clamp(0.0, 1.0) } else { 0.0 };
    [a[0] + along * direction[0], a[1] + along * direction[1], a[2] + along * direction[2]]
}

#[inline]
fn combine<const N: usize, const M: usize>(parent: &[ControlPoint], entries: &[f64], child: &mut [ControlPoint]) {
    let parent: &[ControlPoint; N] = parent.try_into().expect("the parent has the operator's rows");
    for (column, point) in child.iter_mut().take(M).enumerate() {
        let weights: &[f64; N] = entries[column * N..column * N + N].try_into().expect("one weight per row");
        let mut sum = [0.0; 4];
        for (source, &weight) in parent.iter().zip(weights) {
            for (total, &coordinate) in sum.iter_mut().zip(source) {
                *total += weight * coordinate;
            }
        }
        *point = sum;
    }
}

/// Control points of a pair of factors that are combined without another buffer.
const PAIR: usize = 128;
/// The same where a smaller buffer is enough.
const FEW: usize = 24;
/// Points at most that measure the error of a cell, as a buffer holds them.
pub(super) const MOST_MEASURED: usize = PAIR;

/// The points that measure the deviation of a cell from an affine map.
#[inline]
fn measured<'p>(precision: &LinearPrecision, points: &'p [ControlPoint], buffer: &'p mut [ControlPoint; PAIR]) -> &'p [ControlPoint] {
    match &precision.hull {
        None => points,
        Some(hull) => {
            let buffer = &mut buffer[..hull.columns()];
            child_points(points, hull, buffer);
            buffer
        }
    }
}

/// P (U x V), direction after direction.
fn combine_pair(parent: &[ControlPoint], u: &SubdivisionOperator, v: &SubdivisionOperator, child: &mut [ControlPoint]) {
    let size = |operator: &SubdivisionOperator| (operator.rows(), operator.columns());
    match (size(u), size(v)) {
        ((3, 3), (3, 3)) => combine_square::<3, 9>(parent, u.entries(), v.entries(), child),
        ((4, 4), (4, 4)) => combine_square::<4, 16>(parent, u.entries(), v.entries(), child),
        // What holds more than is needed takes longer to clear than to fill.
        ((_, columns), (rows, _)) if columns * rows <= FEW => combine_through::<FEW>(parent, u, v, child),
        ((_, columns), (rows, _)) if columns * rows <= PAIR => combine_through::<PAIR>(parent, u, v, child),
        _ => combine_factors(parent, &[u.clone(), v.clone()], child),
    }
}

/// As [`combine_pair`] by way of at most `N` points.
#[inline]
fn combine_through<const N: usize>(parent: &[ControlPoint], u: &SubdivisionOperator, v: &SubdivisionOperator, child: &mut [ControlPoint]) {
    let count = u.columns() * v.rows();
    let mut half = [[0.0; 4]; N];
    combine_direction(parent, u, v.rows(), &mut half[..count]);
    combine_direction(&half[..count], v, 1, child);
}

/// As [`combine_pair`] for n x n operators, with the size known: `M` is n^2.
#[inline]
fn combine_square<const N: usize, const M: usize>(parent: &[ControlPoint], u: &[f64], v: &[f64], child: &mut [ControlPoint]) {
    let parent: &[ControlPoint; M] = parent.try_into().expect("the parent has the operator's rows");
    let mut half = [[0.0; 4]; M];
    for i in 0..N {
        for k in 0..N {
            let weight = u[i * N + k];
            for j in 0..N {
                for axis in 0..4 {
                    half[i * N + j][axis] += weight * parent[k * N + j][axis];
                }
            }
        }
    }
    for i in 0..N {
        for j in 0..N {
            let mut sum = [0.0; 4];
            for k in 0..N {
                for axis in 0..4 {
                    sum[axis] += v[j * N + k] * half[i * N + k][axis];
                }
            }
            child[i * N + j] = sum;
        }
    }
}

/// As [`combine_pair`] for any number of factors.
fn combine_factors(parent: &[ControlPoint], factors: &[SubdivisionOperator], child: &mut [ControlPoint]) {
    let mut current = parent.to_vec();
    let mut inner = parent.len();
    for factor in factors {
        inner /= factor.rows();
        let mut image = vec![[0.0; 4]; current.len() / factor.rows() * factor.columns()];
        combine_direction(&current, factor, inner, &mut image);
        current = image;
    }
    child[..current.len()].copy_from_slice(&current);
}

/// One direction of a grid, `inner` points to a step of its index.
#[inline]
fn combine_direction(parent: &[ControlPoint], operator: &SubdivisionOperator, inner: usize, child: &mut [ControlPoint]) {
    let (rows, columns) = (operator.rows(), operator.columns());
    let entries = operator.entries();
    for (source, target) in parent.chunks_exact(rows * inner).zip(child.chunks_exact_mut(columns * inner)) {
        for (weights, target) in entries.chunks_exact(rows).zip(target.chunks_exact_mut(inner)) {
            for (position, point) in target.iter_mut().enumerate() {
                let mut sum = [0.0; 4];
                for (row, &weight) in weights.iter().enumerate() {
                    let from = &source[row * inner + position];
                    for (total, &coordinate) in sum.iter_mut().zip(from) {
                        *total += weight * coordinate;
                    }
                }
                *point = sum;
            }
        }
    }
}

/// The child's control points P T. Unrolled for the common sizes.
#[inline]
pub(crate) fn child_points(parent: &[ControlPoint], operator: &SubdivisionOperator, child: &mut [ControlPoint]) {
    match operator.factors() {
        [] => {}
        [u, v] => return combine_pair(parent, u, v, child),
        factors => return combine_factors(parent, factors, child),
    }
    let entries = operator.entries();
    match (operator.rows(), operator.columns()) {
        (2, 2) => combine::<2, 2>(parent, entries, child),
        (3, 3) => combine::<3, 3>(parent, entries, child),
        (4, 4) => combine::<4, 4>(parent, entries, child),
        (9, 9) => combine::<9, 9>(parent, entries, child),
        (16, 16) => combine::<16, 16>(parent, entries, child),
        (rows, columns) => {
            for (column, point) in child.iter_mut().take(columns).enumerate() {
                let mut sum = [0.0; 4];
                for (source, &weight) in parent.iter().zip(&entries[column * rows..(column + 1) * rows]) {
                    for (total, &coordinate) in sum.iter_mut().zip(source) {
                        *total += weight * coordinate;
                    }
                }
                *point = sum;
            }
        }
    }
}

/// A bound of the spectral norm of the 3 x 3 matrix with these columns: the square root of the largest
/// absolute row sum of A A^T (exact for similarities) or of its Frobenius norm, whichever is less.
#[inline]
pub(super) fn matrix_norm(columns: &[Point; 3]) -> f64 {
    let entry = |i: usize, j: usize| columns[0][i] * columns[0][j] + columns[1][i] * columns[1][j] + columns[2][i] * columns[2][j];
    let (xx, yy, zz) = (entry(0, 0), entry(1, 1), entry(2, 2));
    let (xy, xz, yz) = (entry(0, 1), entry(0, 2), entry(1, 2));
    let rows = (xx + xy.abs() + xz.abs()).max(yy + xy.abs() + yz.abs()).max(zz + xz.abs() + yz.abs());
    let frobenius = (xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz)).sqrt();
    rows.min(frobenius).sqrt()
}

#[inline]
pub(super) fn frame_columns(points: &[ControlPoint]) -> [Point; 3] {
    let column = |j: usize| [points[j][0] - points[0][0], points[j][1] - points[0][1], points[j][2] - points[0][2]];
    [column(1), column(2), column(3)]
}

#[inline]
pub(super) fn times(columns: &[Point; 3], x: &Point) -> Point {
    let row = |i: usize| columns[0][i] * x[0] + columns[1][i] * x[1] + columns[2][i] * x[2];
    [row(0), row(1), row(2)]
}

impl Attractor {
    /// The bounded cell of root `index`.
    #[must_use]
    pub fn root_cell(&self, index: usize) -> Cell {
        let root = &self.roots()[index];
        let stretch = match self.bound(root.state) {
            StateBound::Frame { reach, radius, .. } => {
                let columns = frame_columns(&root.points);
                let unit = |j: usize| times(&columns, &reach[j]).map(|x| if *radius > 0.0 { x / radius } else { 0.0 });
                matrix_norm(&[unit(0), unit(1), unit(2)])
            }
            StateBound::Hull { .. } => 0.0,
        };
        let ball = self.ball(root.state, &root.points, root.rational, stretch);
        Cell { state: root.state, root: u32::try_from(index).expect("fewer than 2^32 roots"), ball, stretch }
    }

    /// The cells of a cell's transitions, in their order, with their control points.
    pub(crate) fn children(&self, cell: &Cell, points: &[ControlPoint]) -> impl DoubleEndedIterator<Item = (Cell, Vec<ControlPoint>)> {
        self.state_of(cell).transitions.iter().enumerate().map(|(index, transition)| {
            let mut child = vec![[0.0; 4]; transition.operator.columns()];
            child_points(points, &transition.operator, &mut child);
            (self.child_cell(cell, index, &child), child)
        })
    }

    /// The child of `cell` through transition `index`, whose control points are `points`.
    #[inline]
    pub(crate) fn child_cell(&self, cell: &Cell, index: usize, points: &[ControlPoint]) -> Cell {
        let state = self.automaton().state(cell.state).transitions[index].to;
        let stretch = match self.bound(cell.state) {
            StateBound::Frame { ratios, .. } => cell.stretch * ratios[index],
            StateBound::Hull { .. } => 0.0,
        };
        let ball = self.ball(state, points, self.roots()[cell.root as usize].rational, stretch);
        Cell { state, root: cell.root, ball, stretch }
    }

    /// As [`Attractor::child_cell`], for a walk that only asks for the leaf's error and sites: where neither looks at
    /// the ball, it is left without bounds.
    #[inline]
    pub(super) fn refined_cell(&self, cell: &Cell, index: usize, points: &[ControlPoint]) -> Cell {
        let state = self.automaton().state(cell.state).transitions[index].to;
        if let (StateBound::Hull { .. }, LeafPrimitive::Chord(_) | LeafPrimitive::Simplex) =
            (self.bound(state), &self.automaton().state(state).leaf)
        {
            let ball = Ball { centre: [0.0; 3], radius: f64::INFINITY };
            return Cell { state, root: cell.root, ball, stretch: 0.0 };
        }
        self.child_cell(cell, index, points)
    }

    /// The bounding ball of a cell; see `StateBound` for the proof.
    #[inline]
    pub(super) fn ball(&self, state: StateId, points: &[ControlPoint], rational: bool, stretch: f64) -> Ball {
        match self.bound(state) {
            StateBound::Frame { centre, reach, radius, similar, .. } => {
                let columns = frame_columns(points);
                let offset = times(&columns, centre);
                let centre = [points[0][0] + offset[0], points[0][1] + offset[1], points[0][2] + offset[2]];
                let product = stretch * radius;
                if *similar {
                    return Ball { centre, radius: product };
                }
                let image = [times(&columns, &reach[0]), times(&columns, &reach[1]), times(&columns, &reach[2])];
                Ball { centre, radius: product.min(matrix_norm(&image)) }
            }
            StateBound::Hull { centre: weights, margin } => {
                let mut sum = [0.0; 4];
                for (point, &weight) in points.iter().zip(weights) {
                    for (total, &coordinate) in sum.iter_mut().zip(point) {
                        *total += weight * coordinate;
                    }
                }
                let centre = project(&sum, rational);
                let farthest = points.iter().map(|point| distance_squared(&project(point, rational), &centre)).fold(0.0, f64::max).sqrt();
                // A signed centre may lie outside the hull, but the hull is within `farthest` of it anyway.
                let radius = if *margin > 0.0 { farthest + margin * diameter_bound(points) } else { farthest };
                Ball { centre, radius }
            }
        }
    }

    /// The error of replacing the cell by what stands for it, in mm: a bound of their Hausdorff distance.
    #[inline]
    pub(crate) fn leaf_error(&self, cell: &Cell, points: &[ControlPoint]) -> f64 {
        let rational = self.roots()[cell.root as usize].rational;
        match &self.automaton().state(cell.state).leaf {
            LeafPrimitive::Centre => self.needle(cell, points).map_or(cell.ball.radius, |needle| needle.error.min(cell.ball.radius)),
            LeafPrimitive::Simplex => 0.0,
            LeafPrimitive::Chord(ends) => {
                // The curve lies within `off` of the chord because its hull does, the distance to a segment being
                // convex; the projection of a connected set that contains both ends covers the chord, so every point
                // of the chord has a point of the curve as near.
                let (start, end) = (self.barycentric(points, &ends.start, rational), self.barycentric(points, &ends.end, rational));
                let off = |point: &ControlPoint| {
                    let x = project(point, rational);
                    distance_squared(&x, &closest_on_segment(&x, &start, &end))
                };
                let chord = points.iter().map(off).fold(0.0, f64::max).sqrt();
                let margin = self.bound(cell.state).margin();
                let first_order = if margin > 0.0 { chord + margin * diameter_bound(points) } else { chord };
                let Some(precision) = self.precision(cell.state) else { return first_order };
                let mut buffer = [[0.0; 4]; PAIR];
                let measured = measured(precision, points, &mut buffer);
                first_order.min(if rational {
                    rational_chord_error(precision, points, measured, ends)
                } else {
                    self.chord_error(cell.state, precision, (points, measured), (&start, &end))
                })
            }
            // Points of the cell, and segments between them, are in the ball too.
            LeafPrimitive::Star(_) => 2.0 * cell.ball.radius,
            // Corners belong to the surface and every point of the polygon and of the cell is within the ball:
            // no two points of them are farther apart than its diameter.
            LeafPrimitive::Polygon(_) => {
                let first_order = 2.0 * cell.ball.radius;
                let Some(precision) = self.precision(cell.state) else { return first_order };
                let mut buffer = [[0.0; 4]; PAIR];
                let measured = measured(precision, points, &mut buffer);
                first_order.min(if rational {
                    rational_polygon_error(precision, measured)
                } else {
                    self.polygon_error(cell.state, precision, points, measured)
                })
            }
            LeafPrimitive::Drawn(drawing) => matrix_norm(&frame_columns(points)) * drawing.defect,
        }
    }

    /// eta for the affine map that takes a curve's parameters to its chord; see `precision`.
    #[inline]
    fn chord_error(
        &self,
        state: StateId,
        precision: &LinearPrecision,
        (points, measured): (&[ControlPoint], &[ControlPoint]),
        (start, end): (&Point, &Point),
    ) -> f64 {
        let chord = subtract(end, start);
        let off = |(point, parameter): (&ControlPoint, &[f64; 2])| {
            let linear: Point = std::array::from_fn(|i| start[i] + parameter[0] * chord[i]);
            distance_squared(&[point[0], point[1], point[2]], &linear)
        };
        let mut eta = (1.0 + 2.0 * precision.margin) * measured.iter().zip(&precision.measured).map(off).fold(0.0, f64::max).sqrt();
        if precision.margin > 0.0
            && let Some(deviation) = self.deviation(state)
        {
            eta = eta.min(deviation.of_curve(precision, points, start, &chord));
        }
        eta + precision.residual * dot(&chord, &chord).sqrt()
    }

    /// 2 eta for the affine map that fits a face's control points best; see `precision`.
    #[inline]
    fn polygon_error(&self, state: StateId, precision: &LinearPrecision, points: &[ControlPoint], measured: &[ControlPoint]) -> f64 {
        let mut map = [[0.0; 3]; 3];
        for (point, fit) in measured.iter().zip(&precision.fit) {
            for (column, weight) in map.iter_mut().zip(fit) {
                (0..3).for_each(|i| column[i] += weight * point[i]);
            }
        }
        let off = |(point, parameter): (&ControlPoint, &[f64; 2])| {
            let linear: Point = std::array::from_fn(|i| map[0][i] + parameter[0] * map[1][i] + parameter[1] * map[2][i]);
            distance_squared(&[point[0], point[1], point[2]], &linear)
        };
        let largest = measured.iter().zip(&precision.measured).map(off).fold(0.0, f64::max).sqrt();
        let slope = (dot(&map[1], &map[1]) + dot(&map[2], &map[2])).sqrt();
        let mut eta = (1.0 + 2.0 * precision.margin) * largest;
        if precision.margin > 0.0
            && let Some(deviation) = self.deviation(state)
        {
            eta = eta.min(deviation.of_face(precision, points, [&map[1], &map[2]]));
        }
        2.0 * eta + precision.residual * slope
    }

    /// The child of a face as [`Attractor::child_cell`] gives it, and its error. Where the bound of second order is within
    /// the tolerance, the ball is not worked out, and left without bounds.
    #[inline]
    pub(super) fn child_with_error(&self, cell: &Cell, index: usize, points: &[ControlPoint], tolerance_mm: f64) -> (Cell, f64) {
        let state = self.automaton().state(cell.state).transitions[index].to;
        let smooth = match (self.precision(state), &self.automaton().state(state).leaf) {
            (Some(precision), LeafPrimitive::Polygon(_)) if !self.roots()[cell.root as usize].rational => {
                let mut buffer = [[0.0; 4]; PAIR];
                self.polygon_error(state, precision, points, measured(precision, points, &mut buffer))
            }
            _ => f64::INFINITY,
        };
        if smooth <= tolerance_mm {
            let ball = Ball { centre: [0.0; 3], radius: f64::INFINITY };
            return (Cell { state, root: cell.root, ball, stretch: 0.0 }, smooth);
        }
        let child = self.child_cell(cell, index, points);
        let error = if smooth.is_finite() { smooth.min(2.0 * child.ball.radius) } else { self.leaf_error(&child, points) };
        (child, error)
    }

    /// The centre of a cell's ball.
    pub(super) fn centre(&self, cell: &Cell, points: &[ControlPoint]) -> Point {
        self.ball(cell.state, points, self.roots()[cell.root as usize].rational, cell.stretch).centre
    }

    /// Emits what stands for a leaf cell.
    #[inline]
    pub(crate) fn emit(&self, cell: &Cell, points: &[ControlPoint], sink: &mut impl FnMut(Site)) {
        let rational = self.roots()[cell.root as usize].rational;
        let corner = |j: usize| project(&points[j], rational);
        match &self.automaton().state(cell.state).leaf {
            LeafPrimitive::Centre => match self.needle(cell, points) {
                Some(needle) if needle.error < cell.ball.radius => sink(Site::Segment(needle.ends)),
                _ => sink(Site::Point(cell.ball.centre)),
            },
            LeafPrimitive::Simplex => match points.len() {
                1 => sink(Site::Point(corner(0))),
                2 => sink(Site::Segment([corner(0), corner(1)])),
                _ => sink(Site::Triangle([corner(0), corner(1), corner(2)])),
            },
            LeafPrimitive::Chord(ends) => {
                sink(Site::Segment([self.barycentric(points, &ends.start, rational), self.barycentric(points, &ends.end, rational)]));
            }
            LeafPrimitive::Star(ends) => {
                let first = self.barycentric(points, &ends[0], rational);
                for end in &ends[1..] {
                    sink(Site::Segment([first, self.barycentric(points, end, rational)]));
                }
                if ends.len() == 1 {
                    sink(Site::Point(first));
                }
            }
            LeafPrimitive::Polygon(corners) => {
                let first = self.barycentric(points, &corners[0], rational);
                for pair in corners[1..].windows(2) {
                    sink(Site::Triangle([
                        first,
                        self.barycentric(points, &pair[0], rational),
                        self.barycentric(points, &pair[1], rational),
                    ]));
                }
            }
            LeafPrimitive::Drawn(drawing) => {
                let columns = frame_columns(points);
                let place = |index: u32| {
                    let offset = times(&columns, &drawing.vertices[index as usize]);
                    [points[0][0] + offset[0], points[0][1] + offset[1], points[0][2] + offset[2]]
                };
                drawing.points.iter().for_each(|&a| sink(Site::Point(place(a))));
                drawing.segments.iter().for_each(|&[a, b]| sink(Site::Segment([place(a), place(b)])));
                drawing.triangles.iter().for_each(|&[a, b, c]| sink(Site::Triangle([place(a), place(b), place(c)])));
            }
        }
    }

    pub(super) fn barycentric(&self, points: &[ControlPoint], weights: &[f64], rational: bool) -> Point {
        let mut sum = [0.0; 4];
        for (point, &weight) in points.iter().zip(weights) {
            for (total, &coordinate) in sum.iter_mut().zip(point) {
                *total += weight * coordinate;
            }
        }
        project(&sum, rational)
    }

    /// The cell's kind.
    #[inline]
    pub(crate) fn state_of(&self, cell: &Cell) -> &State {
        self.automaton().state(cell.state)
    }
}

/// As [`Attractor::chord_error`] for weights; see [`homogeneous_error`].
fn rational_chord_error(precision: &LinearPrecision, points: &[ControlPoint], measured: &[ControlPoint], ends: &Ends) -> f64 {
    let place = |weights: &[f64]| -> ControlPoint { std::array::from_fn(|i| points.iter().zip(weights).map(|(p, w)| w * p[i]).sum()) };
    let (start, end) = (place(&ends.start), place(&ends.end));
    let linear: [ControlPoint; 3] = [start, std::array::from_fn(|i| end[i] - start[i]), [0.0; 4]];
    homogeneous_error(precision, measured, &linear)
}

/// As [`Attractor::polygon_error`] for weights; see [`homogeneous_error`].
fn rational_polygon_error(precision: &LinearPrecision, points: &[ControlPoint]) -> f64 {
    let mut linear = [[0.0; 4]; 3];
    for (point, fit) in points.iter().zip(&precision.fit) {
        for (column, weight) in linear.iter_mut().zip(fit) {
            (0..4).for_each(|i| column[i] += weight * point[i]);
        }
    }
    2.0 * homogeneous_error(precision, points, &linear)
}

/// eta for rational cells, whose operators are non-negative: let L map parameters to homogeneous points, with positive
/// weights over the domain D. For x in the attractor, Q x = L(G x) + r with r in the hull of the r_k. Let c be the
/// projection of L(G x), (n, d) the parts of r as seen from a point o, and W the weight of Q x, at least the least w_k.
/// Then the projection of Q x is c + (n - (c - o) d) / W, so eta = (max |n_k| + max |c - o| max |d_k|) / min w_k; the
/// largest |c - o| is at a corner of D. Projection with positive weights takes hulls to hulls, so that the rest of the
/// argument in `precision` holds as it stands.
fn homogeneous_error(precision: &LinearPrecision, points: &[ControlPoint], linear: &[ControlPoint; 3]) -> f64 {
    let at = |p: &[f64; 2]| -> ControlPoint { std::array::from_fn(|i| linear[0][i] + p[0] * linear[1][i] + p[1] * linear[2][i]) };
    let corners = precision.domain.iter().map(at);
    if corners.clone().any(|corner| corner[3] <= 0.0) {
        return f64::INFINITY;
    }
    let origin = project(&linear[0], true);
    let reach = corners.map(|corner| distance_squared(&project(&corner, true), &origin)).fold(0.0, f64::max).sqrt();
    let size = |v: &ControlPoint| {
        let seen: Point = std::array::from_fn(|i| v[i] - origin[i] * v[3]);
        (dot(&seen, &seen).sqrt(), v[3].abs())
    };
    let (mut off, mut skew, mut least) = (0.0_f64, 0.0_f64, f64::INFINITY);
    for (point, parameter) in points.iter().zip(&precision.measured) {
        let linear = at(parameter);
        let (n, d) = size(&std::array::from_fn(|i| point[i] - linear[i]));
        (off, skew, least) = (off.max(n), skew.max(d), least.min(point[3]));
    }
    // Descendants whose operators have negative entries may leave the hull.
    if precision.margin > 0.0 || least <= 0.0 {
        return f64::INFINITY;
    }
    // Parameters may miss the domain by the residual.
    for column in &linear[1..] {
        let (n, d) = size(column);
        (off, skew) = (off + precision.residual * n, skew + precision.residual * d);
    }
    (off + reach * skew) / least
}

/// The diagonal of the box of polynomial control points: at least their diameter.
fn diameter_bound(points: &[ControlPoint]) -> f64 {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in points {
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    distance_squared(&low, &high).sqrt()
}
