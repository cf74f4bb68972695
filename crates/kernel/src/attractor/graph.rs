//! Products of curves, seen as the graph of a continuous function over a convex part of a plane.
//!
//! Let x = Q (a x b), and t(a) and s(b) be functionals that grow along two curves: then each curve has one point for every value of its own, which depends continuously on it. Where two coordinates of x are affine in t and s, and independent, the third one, the height, is a continuous
//! function over a parallelogram; several of these whose sides match are one over all of them.
//!
//! A functional grows along a curve if it is one of those with linear precision (see `precision`), and the curve's parts lie one behind the other; or if its values at the control points do not fall from one to the next, and operators keep that: in column k + 1 of each, the entries from any row on have no
//! smaller sum than in column k. The same is asked of the ends of a curve, and that its parts lead from one to the other in their order: then its value is no less at the end of any part than where that starts, and these are dense.
//!
//! A *column* is the part of the graph over a smaller parallelogram: that of a word in the transitions of each curve. Columns are split along whichever side is longer, so that they stay about as wide as they are long, whatever the curves' own transitions.

use super::cell::{Point, closest_on_segment, distance_squared};
use super::enclosure::{Enclosure, of_product};
use super::sites::reachable;
use super::{Attractor, Root};
use crate::automaton::{Ends, LeafPrimitive, StateId, SubdivisionOperator, Transition};
use crate::order::ordered_by;
use std::collections::{BinaryHeap, HashMap};
use std::f64::consts::TAU;

/// A place in the plane.
type Place = [f64; 2];

/// Coordinates, and parameters, may miss what they should be by this much, relative to all.
const MISS: f64 = 1e-10;
/// How far the polygon may be off, relative to all.
const MOST_OFF: f64 = 1e-6;
/// How often a column is split at most until it is narrow.
const DEEPEST: usize = 400;
/// Roots at most: each of their sides is held against all.
const MOST_ROOTS: usize = 2_048;
/// Pairs of curves at most.
const MOST_KINDS: usize = 1_024;

/// A pair of curves of which columns are made.
struct Kind {
    enclosure: Enclosure,
    ends: [Ends; 2],
    /// The parts along each curve.
    parts: [Vec<Part>; 2],
}

/// What a transition of one of two curves leads to.
struct Part {
    /// Of the pair, and of the curve alone.
    operator: SubdivisionOperator,
    own: SubdivisionOperator,
    kind: usize,
    /// The columns of its enclosure as points of the pair: what tells its heights; and by how much these may be off, in the sum of coordinates.
    seen: SubdivisionOperator,
    miss: f64,
}

/// The part of a graph over a parallelogram.
#[derive(Clone, Debug)]
pub(crate) struct Column {
    kind: usize,
    /// Heights of the control points, and shares of the root's sides at those of each curve.
    heights: Vec<f64>,
    shares: [Vec<f64>; 2],
    root: usize,
    /// A corner of the parallelogram, and the sides from it.
    corner: Place,
    sides: [Place; 2],
    /// No place of it is higher, or lower.
    pub(crate) high: f64,
    pub(crate) low: f64,
}

impl Column {
    /// The middle of the parallelogram.
    pub(crate) fn middle(&self) -> Place {
        [0, 1].map(|axis| self.corner[axis] + 0.5 * (self.sides[0][axis] + self.sides[1][axis]))
    }

    /// The same, known to be nowhere higher than a height.
    pub(crate) fn below(self, high: f64) -> Self {
        Self { high: self.high.min(high), ..self }
    }

    /// Whether a place is in it.
    pub(crate) fn has(&self, at: Place) -> bool {
        self.beyond(at) <= 0.5
    }

    /// How far a place is from the middle, along the side that it is farther along, in units of that.
    fn beyond(&self, at: Place) -> f64 {
        let ([p, q], own) = (self.sides, [at[0] - self.corner[0], at[1] - self.corner[1]]);
        let area = p[0] * q[1] - p[1] * q[0];
        let shares = [(own[0] * q[1] - own[1] * q[0]) / area, (p[0] * own[1] - p[1] * own[0]) / area];
        shares.iter().map(|share| (share - 0.5).abs()).fold(0.0, f64::max)
    }

    /// How far the corners are from the middle, at most.
    pub(crate) fn reach(&self) -> f64 {
        let [p, q] = self.sides;
        0.5 * (p[0] + q[0]).hypot(p[1] + q[1]).max((p[0] - q[0]).hypot(p[1] - q[1]))
    }
}

/// A graph over a convex part of a plane.
pub(crate) struct Graph {
    kinds: Vec<Kind>,
    /// The axes of the plane, and the one across it: a right-handed frame.
    pub(crate) axes: [usize; 3],
    /// The corners of the part, counter-clockwise.
    pub(crate) corners: Vec<Place>,
    roots: Vec<Sheet>,
    /// How far places may be from where they are taken to be.
    pub(crate) off: f64,
}

/// A root as a graph over a parallelogram.
struct Sheet {
    curves: [StateId; 2],
    kind: usize,
    heights: Vec<f64>,
    shares: [Vec<f64>; 2],
    corner: Place,
    sides: [Place; 2],
    is_smooth: bool,
}

impl Attractor {
    /// What it is the graph of; none where it is none, or not made of products of two curves.
    pub(crate) fn graph(&self) -> Option<Graph> {
        if self.roots.len() > MOST_ROOTS || !self.solids.is_empty() || self.has_own_radii() || !self.trimmed.is_empty() {
            return None;
        }
        let mut kinds = Kinds { attractor: self, numbers: HashMap::new(), all: Vec::new() };
        for root in &self.roots {
            let &[first, second] = self.automaton.factors(root.state) else { return None };
            kinds.number([first, second])?;
        }
        let extent =
            self.roots.iter().flat_map(|root| &root.points).flat_map(|point| &point[..3]).fold(0.0_f64, |most, x| most.max(x.abs()));
        let kinds_of = &kinds;
        let found = [2, 1, 0].into_iter().find_map(|up| {
            let axes = [(up + 1) % 3, (up + 2) % 3, up];
            let mut off = 0.0_f64;
            let sheet = |root: &Root| {
                let (sheet, own) = sheet(self, kinds_of, root, axes, extent)?;
                off = off.max(own);
                Some(sheet)
            };
            let roots: Vec<Sheet> = self.roots.iter().map(sheet).collect::<Option<_>>()?;
            let (corners, missed) = outline(self, &roots, extent)?;
            Some((axes, roots, corners, off + missed))
        });
        let (axes, roots, corners, off) = found?;
        let kinds = kinds.finish()?;
        Some(Graph { kinds, axes, corners, roots, off })
    }

    fn curve_ends(&self, curve: StateId) -> Option<&Ends> {
        match &self.automaton.state(curve).leaf {
            LeafPrimitive::Chord(ends) => Some(ends),
            _ => None,
        }
    }

    /// Where the parts of a curve start and end, in their order; none where they are no curves.
    fn ends_of_parts(&self, curve: StateId) -> Option<Vec<[Vec<f64>; 2]>> {
        let part = |transition: &Transition| {
            let own = self.curve_ends(transition.to)?;
            Some([&own.start, &own.end].map(|end| transition.operator.apply(end)))
        };
        self.automaton.state(curve).transitions.iter().map(part).collect()
    }

    /// Whether a functional grows along a curve, given its values at the control points.
    fn grows_along(&self, curve: StateId, values: &[f64]) -> bool {
        if self.bound(curve).margin() > 0.0 {
            let Some(precision) = self.precision(curve) else { return false };
            let is_parameter = precision.parameters.iter().zip(values).all(|(own, value)| (own[0] - value).abs() <= MISS);
            return is_parameter && reachable(&self.automaton, curve).into_iter().all(|state| self.is_in_a_row(StateId::new(state)));
        }
        let state = |state: usize| self.automaton.state(StateId::new(state));
        let keeps = |operator: &SubdivisionOperator| (1..operator.columns()).all(|k| is_ahead(operator.column(k), operator.column(k - 1)));
        let is_kept = |index: usize| {
            let Some(ends) = self.curve_ends(StateId::new(index)) else { return false };
            is_ahead(&ends.end, &ends.start)
                && self.ends_of_parts(StateId::new(index)).is_some_and(|parts| is_chain(ends, &parts))
                && state(index).transitions.iter().all(|transition| keeps(&transition.operator))
        };
        values.windows(2).all(|pair| pair[0] < pair[1]) && reachable(&self.automaton, curve).into_iter().all(is_kept)
    }

    /// Whether the parts of a curve lie one behind the other along its parameter, whichever way each goes, and meet there.
    fn is_in_a_row(&self, curve: StateId) -> bool {
        let (Some(precision), Some(ends)) = (self.precision(curve), self.curve_ends(curve)) else { return false };
        let parameter = |point: &[f64]| precision.parameter(point)[0];
        let Some(mut parts) = self.ends_of_parts(curve) else { return false };
        for part in &mut parts {
            if parameter(&part[1]) < parameter(&part[0]) {
                part.swap(0, 1);
            }
        }
        parts.sort_by(|a, b| parameter(&a[0]).total_cmp(&parameter(&b[0])));
        let are_long = parts.iter().all(|[start, end]| parameter(end) - parameter(start) > MISS);
        are_long && (parameter(&ends.end) - 1.0).abs() <= MISS && is_chain(ends, &parts)
    }
}

/// Whether parts lead from one end of a curve to the other, each from where the one before it ends.
fn is_chain(ends: &Ends, parts: &[[Vec<f64>; 2]]) -> bool {
    let is_same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= MISS);
    let last = parts.iter().try_fold(&ends.start, |at, [start, end]| is_same(at, start).then_some(end));
    !parts.is_empty() && last.is_some_and(|last| is_same(last, &ends.end))
}

/// Whether the entries of a column from any row on have no smaller sum than those of another.
fn is_ahead(column: &[f64], other: &[f64]) -> bool {
    let mut ahead = 0.0;
    column.iter().zip(other).rev().all(|(own, theirs)| {
        ahead += own - theirs;
        ahead >= -MISS
    })
}

/// Pairs of curves in the making.
struct Kinds<'a> {
    attractor: &'a Attractor,
    numbers: HashMap<[StateId; 2], usize>,
    all: Vec<[StateId; 2]>,
}

impl Kinds<'_> {
    /// The number of a pair, and of all that its parts are; none where these are too many, or curves have other leaves.
    fn number(&mut self, pair: [StateId; 2]) -> Option<usize> {
        let mut open = vec![pair];
        while let Some(pair) = open.pop() {
            if self.numbers.contains_key(&pair) {
                continue;
            }
            self.numbers.insert(pair, self.all.len());
            self.all.push(pair);
            (self.all.len() <= MOST_KINDS).then_some(())?;
            for along in 0..2 {
                self.attractor.curve_ends(pair[along])?;
                for transition in &self.attractor.automaton.state(pair[along]).transitions {
                    let mut part = pair;
                    part[along] = transition.to;
                    open.push(part);
                }
            }
        }
        self.numbers.get(&pair).copied()
    }

    fn finish(self) -> Option<Vec<Kind>> {
        let Self { attractor, numbers, all } = self;
        let enclosures: Vec<Enclosure> = all.iter().map(|pair| of_product(attractor, pair)).collect::<Option<_>>()?;
        let kind = |pair: &[StateId; 2]| {
            let identity = |curve: StateId| SubdivisionOperator::identity(attractor.automaton.state(curve).dimension);
            let parts = |along: usize| -> Vec<Part> {
                let part = |transition: &Transition| {
                    let mut to = *pair;
                    to[along] = transition.to;
                    let (mut factors, own) = ([identity(pair[0]), identity(pair[1])], transition.operator.clone());
                    factors[along] = own.clone();
                    let operator = SubdivisionOperator::product(factors.to_vec());
                    let Enclosure { columns, miss, .. } = &enclosures[numbers[&to]];
                    let norm = |k: usize| operator.column(k).iter().map(|entry| entry.abs()).sum::<f64>();
                    let miss = miss * (0..operator.columns()).map(norm).fold(1.0, f64::max);
                    let seen = operator.times(columns);
                    Part { operator, own, kind: numbers[&to], seen, miss }
                };
                attractor.automaton.state(pair[along]).transitions.iter().map(part).collect()
            };
            let ends = [attractor.curve_ends(pair[0])?.clone(), attractor.curve_ends(pair[1])?.clone()];
            Some(Kind { enclosure: enclosures[numbers[pair]].clone(), ends, parts: [parts(0), parts(1)] })
        };
        all.iter().map(kind).collect()
    }
}

/// A root as a graph, and how far places may be from where they are taken to be; none where it is none along these axes.
fn sheet(attractor: &Attractor, kinds: &Kinds<'_>, root: &Root, axes: [usize; 3], extent: f64) -> Option<(Sheet, f64)> {
    if root.rational {
        return None;
    }
    let automaton = attractor.automaton();
    let &[first, second] = automaton.factors(root.state) else { return None };
    let curves = [first, second];
    let [m, n] = curves.map(|curve| automaton.state(curve).dimension);
    let ends = [attractor.curve_ends(first)?, attractor.curve_ends(second)?];
    let point = |i: usize, j: usize| &root.points[i * n + j];
    let place = |a: &[f64], b: &[f64]| {
        let value = |axis: usize| -> f64 {
            a.iter().enumerate().flat_map(|(i, x)| b.iter().enumerate().map(move |(j, y)| x * y * point(i, j)[axis])).sum()
        };
        [value(axes[0]), value(axes[1])]
    };
    let corner = place(&ends[0].start, &ends[1].start);
    let way = |to: Place| [to[0] - corner[0], to[1] - corner[1]];
    let sides = [way(place(&ends[0].end, &ends[1].start)), way(place(&ends[0].start, &ends[1].end))];
    let unit = |k: usize, dimension: usize| (0..dimension).map(|j| f64::from(u8::from(j == k))).collect::<Vec<f64>>();
    let share = |along: usize, at: Place| {
        let (own, side) = (way(at), sides[along]);
        (own[0] * side[0] + own[1] * side[1]) / (side[0] * side[0] + side[1] * side[1])
    };
    let shares: [Vec<f64>; 2] = [
        (0..m).map(|i| share(0, place(&unit(i, m), &ends[1].start))).collect(),
        (0..n).map(|j| share(1, place(&ends[0].start, &unit(j, n)))).collect(),
    ];
    let mut off = 0.0_f64;
    for i in 0..m {
        for j in 0..n {
            let [t, s] = [shares[0][i], shares[1][j]];
            let miss = [0, 1].map(|axis| point(i, j)[axes[axis]] - (corner[axis] + t * sides[0][axis] + s * sides[1][axis]));
            off = off.max(miss[0].hypot(miss[1]));
        }
    }
    // |x|_1 of a product's points.
    off *= curves.map(|curve| 1.0 + 2.0 * attractor.bound(curve).margin()).iter().product::<f64>();
    let lengths = sides.map(|side| side[0].hypot(side[1]));
    let residual = |curve: StateId| attractor.precision(curve).map_or(0.0, |precision| precision.residual);
    off += (0..2).map(|k| (residual(curves[k]) + MISS) * lengths[k]).sum::<f64>();
    let area = (sides[0][0] * sides[1][1] - sides[0][1] * sides[1][0]).abs();
    if off > 8.0 * MISS * extent
        || area <= 1e-6 * lengths[0] * lengths[1]
        || lengths.iter().any(|&length| length <= 2e-8 * extent)
        || !(0..2).all(|k| attractor.grows_along(curves[k], &shares[k]))
    {
        return None;
    }
    let heights = root.points.iter().map(|point| point[axes[2]]).collect();
    let is_smooth = curves.iter().any(|&curve| attractor.bound(curve).margin() == 0.0);
    Some((Sheet { curves, kind: *kinds.numbers.get(&curves)?, heights, shares, corner, sides, is_smooth }, 2.0 * off))
}

/// A side of a parallelogram: the places of its ends in units, and the curve above it: where it starts, its state, and the shares of the side and the heights at its control points.
struct Side {
    ends: [[i64; 2]; 2],
    places: [Place; 2],
    start: [i64; 2],
    state: StateId,
    values: [Vec<f64>; 2],
}

/// Whether places are the same, in units that these may be rounded to either side of.
fn are_near(a: [i64; 2], b: [i64; 2]) -> bool {
    (0..2).all(|axis| (a[axis] - b[axis]).abs() <= 1)
}

/// The corners of the convex polygon that parallelograms fill, counter-clockwise, and how far it may be off; none where they fill none, or the curves above sides that two have in common differ.
fn outline(attractor: &Attractor, roots: &[Sheet], extent: f64) -> Option<(Vec<Place>, f64)> {
    let unit = 16.0 * MISS * extent;
    let (mut open, mut area): (Vec<Side>, f64) = (Vec::new(), 0.0);
    for sheet in roots {
        let Sheet { corner, sides: [p, q], .. } = sheet;
        let double = p[0] * q[1] - p[1] * q[0];
        area += double.abs();
        let at = |s: f64, t: f64| [0, 1].map(|axis| corner[axis] + s * p[axis] + t * q[axis]);
        let corners = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
        for k in 0..4 {
            let mut places = [corners[k], corners[(k + 1) % 4]];
            if double < 0.0 {
                places.swap(0, 1);
            }
            let (state, values) = above(attractor, sheet, k)?;
            let in_units = |place: Place| place.map(|x| (x / unit).round() as i64);
            let start = in_units(corners[[0, 1, 3, 0][k]]);
            let side = Side { ends: places.map(in_units), places, start, state, values };
            // What another has the other way round.
            let is_same = |other: &Side| are_near(other.ends[0], side.ends[1]) && are_near(other.ends[1], side.ends[0]);
            match open.iter().position(is_same) {
                None => open.push(side),
                Some(found) => {
                    let other = open.swap_remove(found);
                    let are_same = |k: usize, miss: f64| other.values[k].iter().zip(&side.values[k]).all(|(a, b)| (a - b).abs() <= miss);
                    let is_along = other.state == side.state && are_near(other.start, side.start);
                    (is_along && are_same(0, MISS) && are_same(1, MISS * extent)).then_some(())?;
                }
            }
        }
    }
    // One behind the other around.
    let mut ring: Vec<Place> = Vec::new();
    let mut next = 0;
    while !open.is_empty() {
        let side = open.swap_remove(next);
        ring.push(side.places[0]);
        match open.iter().position(|other| are_near(other.ends[0], side.ends[1])) {
            Some(found) => next = found,
            None => open.is_empty().then_some(())?,
        }
    }
    let count = ring.len();
    let double = |ring: &[Place]| -> f64 {
        (0..ring.len()).map(|k| (ring[k], ring[(k + 1) % ring.len()])).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum()
    };
    let own = 0.5 * double(&ring);
    ((own - area).abs() <= 1e-6 * area).then_some(())?;
    let (mut corners, mut turned) = (Vec::new(), 0.0);
    for k in 0..count {
        let [a, b, c] = [k + count - 1, k, k + 1].map(|k| ring[k % count]);
        let (before, after) = ([b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]);
        let turn = before[0] * after[1] - before[1] * after[0];
        let straight = 4.0 * unit * before[0].hypot(before[1]).max(after[0].hypot(after[1]));
        if turn < -straight {
            return None;
        }
        turned += turn.max(0.0).atan2(before[0] * after[0] + before[1] * after[1]);
        if turn > straight {
            corners.push(b);
        }
    }
    // Corners that are left out are off the sides of what is left, and so are sides that turn right by no more than rounding.
    let off = ring.iter().map(|place| from_sides(*place, &corners)).fold(0.0, f64::max) + 8.0 * unit;
    (corners.len() > 2 && turned < 1.5 * TAU && off <= MOST_OFF * extent).then_some((corners, off))
}

/// How far a place is from the sides of a polygon.
fn from_sides([x, y]: Place, corners: &[Place]) -> f64 {
    let side = |k: usize| {
        let [a, b] = [corners[k], corners[(k + 1) % corners.len()]].map(|[x, y]| [x, y, 0.0]);
        distance_squared(&[x, y, 0.0], &closest_on_segment(&[x, y, 0.0], &a, &b))
    };
    (0..corners.len()).map(side).fold(f64::INFINITY, f64::min).sqrt()
}

/// The value of a functional at a point.
fn dot_of(values: &[f64], point: &[f64]) -> f64 {
    values.iter().zip(point).map(|(value, x)| value * x).sum()
}

/// The curve above a side of a parallelogram: its state, and the shares of the side and the heights at its control points.
fn above(attractor: &Attractor, sheet: &Sheet, side: usize) -> Option<(StateId, [Vec<f64>; 2])> {
    let [first, second] = sheet.curves;
    let [m, n] = sheet.curves.map(|curve| attractor.automaton.state(curve).dimension);
    let [along, across] = if side.is_multiple_of(2) { [first, second] } else { [second, first] };
    let ends = attractor.curve_ends(across)?;
    let end = if side == 0 || side == 3 { &ends.start } else { &ends.end };
    let heights = if side.is_multiple_of(2) {
        (0..m).map(|i| (0..n).map(|j| end[j] * sheet.heights[i * n + j]).sum()).collect()
    } else {
        (0..n).map(|j| (0..m).map(|i| end[i] * sheet.heights[i * n + j]).sum()).collect()
    };
    Some((along, [sheet.shares[side % 2].clone(), heights]))
}

impl Graph {
    /// Whether all roots are smooth along one of their curves.
    pub(crate) fn has_smooth_curves(&self) -> bool {
        self.roots.iter().all(|sheet| sheet.is_smooth)
    }

    /// Numbers that a column has, at most.
    pub(crate) fn numbers(&self) -> usize {
        self.roots.iter().map(|sheet| sheet.heights.len() + sheet.shares[0].len() + sheet.shares[1].len()).max().unwrap_or(0)
    }

    /// The columns over the roots' parallelograms, upside down if `sign` is -1.
    pub(crate) fn columns(&self, sign: f64) -> Vec<Column> {
        let column = |(root, sheet): (usize, &Sheet)| {
            let heights = sheet.heights.iter().map(|height| sign * height).collect();
            self.column(root, sheet.kind, heights, sheet.shares.clone())
        };
        self.roots.iter().enumerate().map(column).collect()
    }

    fn column(&self, root: usize, kind: usize, heights: Vec<f64>, shares: [Vec<f64>; 2]) -> Column {
        let Sheet { corner, sides, .. } = &self.roots[root];
        let Kind { ends, enclosure, .. } = &self.kinds[kind];
        let own = [0, 1].map(|k| [dot_of(&shares[k], &ends[k].start), dot_of(&shares[k], &ends[k].end)]);
        let corner = [0, 1].map(|axis| corner[axis] + own[0][0] * sides[0][axis] + own[1][0] * sides[1][axis]);
        let sides = [0, 1].map(|k| sides[k].map(|x| (own[k][1] - own[k][0]) * x));
        let [low, high] = range(enclosure, &enclosure.columns, enclosure.miss, &heights);
        Column { kind, heights, shares, root, corner, sides, high, low }
    }

    /// Along which curve a column is split: its longer side, and the parts there.
    fn split(&self, column: &Column) -> (usize, &[Part]) {
        let parts = &self.kinds[column.kind].parts;
        let [p, q] = column.sides.map(|side| side[0] * side[0] + side[1] * side[1]);
        let along = usize::from(q > p);
        (along, &parts[along])
    }

    /// A part of a column.
    fn part(&self, column: &Column, number: usize) -> Column {
        let (along, parts) = self.split(column);
        let Part { operator, own, kind, .. } = &parts[number];
        let mut shares = column.shares.clone();
        shares[along] = own.pull_back(&shares[along]);
        let mut part = self.column(column.root, *kind, operator.pull_back(&column.heights), shares);
        (part.low, part.high) = (part.low.max(column.low), part.high.min(column.high));
        part
    }

    /// The parts of a column, across its longer side.
    pub(crate) fn parts(&self, column: &Column) -> impl Iterator<Item = Column> {
        (0..self.split(column).1.len()).map(move |number| self.part(column, number))
    }

    /// A narrow column over a place, given those over the roots: no corner is farther than a width from its middle, nor is the place, and it is no higher than that. None where columns do not become as small.
    pub(crate) fn narrow_at(&self, roots: &[Column], at: Place, width: f64) -> Option<Column> {
        let closest = |columns: Vec<Column>| columns.into_iter().min_by(|a, b| a.beyond(at).total_cmp(&b.beyond(at)));
        let mut column = closest(roots.to_vec())?;
        for _ in 0..DEEPEST {
            if column.reach() <= width && column.high - column.low <= width {
                let middle = column.middle();
                return ((middle[0] - at[0]).hypot(middle[1] - at[1]) <= width).then_some(column);
            }
            column = closest(self.parts(&column).collect())?;
        }
        None
    }

    /// A place as high as any of a column, but for a slack, and a height that no place of it exceeds, which is that of the first one. If to tell it would take too many splits, it is the highest place that was found, which is no higher than the graph, and the bound is higher.
    pub(crate) fn peak(&self, column: &Column, slack: f64, splits: usize) -> (Point, f64) {
        let mut wider: Vec<Column> = Vec::new();
        let mut heap: BinaryHeap<Glimpse> = BinaryHeap::new();
        let mut best = (column.low, None);
        for parent in 0..splits {
            let next = if parent == 0 {
                column.clone()
            } else {
                // What is not split stays among those that the bound is told by.
                let is_told = heap.peek().is_none_or(|top| top.high - best.0 <= slack);
                let Some(Glimpse { parent, number, .. }) = (if is_told { None } else { heap.pop() }) else { break };
                self.part(&wider[parent], number)
            };
            for (number, part) in self.split(&next).1.iter().enumerate() {
                let [low, high] = range(&self.kinds[part.kind].enclosure, &part.seen, part.miss, &next.heights);
                if low > best.0 {
                    best = (low, Some((parent, number)));
                }
                heap.push(Glimpse { high: high.min(next.high), parent, number });
            }
            wider.push(next);
        }
        let high = heap.peek().map_or(column.high, |top| top.high.max(best.0));
        let [x, y] = match best.1 {
            Some((parent, number)) => self.part(&wider[parent], number).middle(),
            None => column.middle(),
        };
        ([x, y, if high - best.0 <= slack { high } else { best.0 }], high)
    }
}

/// Bounds of the heights of what an enclosure holds, given its columns as points of what has such heights, and by how much these may be off, in the sum of coordinates.
fn range(enclosure: &Enclosure, columns: &SubdivisionOperator, miss: f64, heights: &[f64]) -> [f64; 2] {
    let [low, high] = enclosure.range(columns.pull_back(heights).into_iter());
    let beyond = miss * heights.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    [low - beyond, high + beyond]
}

/// A part of a column that was not looked at yet.
struct Glimpse {
    high: f64,
    /// The column, and the number of the part.
    parent: usize,
    number: usize,
}

ordered_by!(Glimpse, |this, other| this.high.total_cmp(&other.high));

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::model::{ControlNet, CurveScheme, Model, Shape, TensorProduct};
    use crate::split_mix::Random;
    use glam::DVec3;

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

    /// Rough along one axis, with two roots beside each other; along both, sheared; and with other axes in the plane, one of them turned.
    pub(crate) fn graphs() -> Vec<Attractor> {
        vec![
            product([rough(&[0.45, -0.5, 0.4, 0.5]), cubic()], [5, 5], |place| place),
            product([rough(&[0.5, -0.4]), rough(&[0.45, 0.5])], [3, 3], |place| DVec3::new(place.x + 0.3 * place.y, place.y, place.z)),
            product([CurveScheme::Bezier, rough(&[0.6, -0.5])], [4, 3], |place| DVec3::new(place.z, place.x, -place.y)),
        ]
    }

    /// Places of a graph in its own frame, at the ends of paths by chance.
    pub(crate) fn places(attractor: &Attractor, graph: &Graph, count: usize) -> Vec<Point> {
        let mut random = Random(17);
        let mut choose = |all: usize| (random.share() * all as f64) as usize;
        let place = |_| {
            let root = &attractor.roots()[choose(attractor.roots().len())];
            let mut rows = graph.axes.map(|axis| root.points.iter().map(|point| point[axis]).collect::<Vec<f64>>());
            let mut state = root.state;
            for _ in 0..50 {
                let transitions = &attractor.automaton().state(state).transitions;
                let step = &transitions[choose(transitions.len())];
                (state, rows) = (step.to, rows.map(|row| step.operator.pull_back(&row)));
            }
            // The cell is a point.
            rows.map(|row| row[0])
        };
        (0..count).map(place).collect()
    }

    /// Columns over a place are nested, have it between their bounds, and become as small as asked.
    #[test]
    fn columns_hold_their_places() {
        for (number, attractor) in graphs().iter().enumerate() {
            let graph = attractor.graph().unwrap();
            let places = places(attractor, &graph, 400);
            for at in &places {
                let mut column = graph.columns(1.0).into_iter().find(|column| column.has([at[0], at[1]])).unwrap();
                while column.reach() > 0.03 {
                    let away = column.middle();
                    assert!((away[0] - at[0]).hypot(away[1] - at[1]) <= column.reach() + 1e-6, "{number}");
                    assert!(column.low <= at[2] + 1e-6 && column.high >= at[2] - 1e-6, "{number}: {column:?} {at:?}");
                    column = graph.parts(&column).min_by(|a, b| a.beyond([at[0], at[1]]).total_cmp(&b.beyond([at[0], at[1]]))).unwrap();
                }
                let narrow = graph.narrow_at(&graph.columns(1.0), [at[0], at[1]], 0.05).unwrap();
                assert!(narrow.reach() <= 0.05 && narrow.high - narrow.low <= 0.05);
                assert!((narrow.low - 0.05..=narrow.high + 0.05).contains(&at[2]), "{number}");
            }
            let lowest = places.iter().map(|place| place[2]).fold(f64::INFINITY, f64::min);
            let upside_down = graph.columns(-1.0).iter().map(|column| column.high).fold(f64::NEG_INFINITY, f64::max);
            assert!(upside_down >= -lowest - 1e-9 && upside_down < -lowest + 10.0, "{number}: {upside_down} {lowest}");
        }
    }

    /// Peaks are places of the graph, and nothing that is known of a column is higher.
    #[test]
    fn peaks_are_the_highest_places() {
        for (number, attractor) in graphs().iter().enumerate() {
            let graph = attractor.graph().unwrap();
            let places = places(attractor, &graph, 40_000);
            let mut open = graph.columns(1.0);
            let mut highest = 0;
            for _ in 0..60 {
                let column = open.remove(0);
                let (peak, high) = graph.peak(&column, 0.05, 400);
                let own: Vec<&Point> = places.iter().filter(|place| column.has([place[0], place[1]])).collect();
                let most = own.iter().map(|place| place[2]).fold(f64::NEG_INFINITY, f64::max);
                assert!(high >= most - 1e-6 && column.has([peak[0], peak[1]]), "{number}: {high} {most}");
                let there = graph.narrow_at(&graph.columns(1.0), [peak[0], peak[1]], 0.01).unwrap();
                assert!(peak[2] <= there.high + 0.051 && peak[2] <= high, "{number}: {peak:?} {there:?}");
                if peak[2] == high {
                    highest += 1;
                    assert!(high <= most + 0.6, "{number}: {high} {most}");
                }
                open.extend(graph.parts(&column));
            }
            assert!(highest > 30, "{number}: {highest}");
        }
    }

    /// With any number of splits, and any slack, the bound holds: what is told to be highest is no lower than what more splits find.
    #[test]
    fn bounds_of_peaks_hold_however_early_a_search_ends() {
        for (number, attractor) in graphs().iter().enumerate() {
            let graph = attractor.graph().unwrap();
            let mut open = graph.columns(-1.0);
            for _ in 0..40 {
                let column = open.remove(0);
                let (found, _) = graph.peak(&column, 1e-6, 4_000);
                for (splits, slack) in [(1, 0.5), (2, 0.5), (3, 1.0), (8, 0.3), (40, 0.1), (400, 0.03)] {
                    let (peak, high) = graph.peak(&column, slack, splits);
                    assert!(high >= found[2] - 1e-6 && high >= peak[2], "{number}: {splits} {slack}: {high} {found:?}");
                }
                open.extend(graph.parts(&column));
            }
        }
    }

    #[test]
    fn what_is_no_graph_is_left() {
        let bent = |place: DVec3| DVec3::new(place.x + 0.1 * place.z, place.y + 0.2 * place.z, place.z);
        let folded = |place: DVec3| DVec3::new(place.x, (place.y - 3.0).abs(), place.z);
        let flat = |place: DVec3| DVec3::new(place.x, place.x, place.z);
        let none = [
            product([rough(&[0.5, -0.5]), cubic()], [3, 5], bent),
            product([rough(&[0.5, -0.5]), cubic()], [3, 5], folded),
            product([rough(&[0.5, -0.5]), cubic()], [3, 5], flat),
            product([rough(&[0.5, -0.5]), rough(&[0.5, -0.4])], [3, 3], |place| DVec3::new(place.x * place.x, place.y, place.z)),
        ];
        for (number, attractor) in none.iter().enumerate() {
            assert!(attractor.graph().is_none(), "{number}");
        }
        // Turned about the axis it is one still.
        let turned = |place: DVec3| DVec3::new(place.x + 0.1 * place.y, place.y - 0.1 * place.x, place.z);
        let graph = product([rough(&[0.5, -0.5]), cubic()], [3, 5], turned).graph().unwrap();
        assert_eq!((graph.axes, graph.corners.len(), graph.roots.len()), ([0, 1, 2], 4, 2));
    }
}
