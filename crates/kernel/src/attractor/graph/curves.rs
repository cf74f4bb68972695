//! Products of curves as graphs.
//!
//! Let x = Q (a x b), and t(a) and s(b) be functionals that grow along two curves: then each curve has one point for every value of its own, which depends continuously on it. Where two coordinates of x are affine in t and s, and independent, the third one, the height, is a continuous
//! function over a parallelogram; several of these whose sides match are one over all of them.
//!
//! A functional grows along a curve if it is one of those with linear precision (see `precision`), and the curve's parts lie one behind the other; or if its values at the control points do not fall from one to the next, and operators keep that: in column k + 1 of each, the entries from any row on have no
//! smaller sum than in column k. The same is asked of the ends of a curve, and that its parts lead from one to the other in their order: then its value is no less at the end of any part than where that starts, and these are dense.

use super::outline::{are_same, double_area, is_wide, outline, pairs, sides};
use super::{Base, Graph, Kind, MISS, Part, Place};
use crate::attractor::enclosure::{Enclosure, of_product};
use crate::attractor::sites::reachable;
use crate::attractor::{Attractor, Root};
use crate::automaton::{Ends, LeafPrimitive, StateId, SubdivisionOperator, Transition};
use std::collections::HashMap;

/// Roots at most: each of their sides is held against all.
const MOST_ROOTS: usize = 2_048;
/// Pairs of curves at most.
const MOST_KINDS: usize = 1_024;

/// A root as a graph over a parallelogram.
struct Sheet {
    curves: [StateId; 2],
    base: Base,
    is_smooth: bool,
}

/// What products of curves are the graph of; none where an attractor is none.
pub(super) fn graph(attractor: &Attractor, extent: f64) -> Option<Graph> {
    let roots = attractor.roots();
    if roots.len() > MOST_ROOTS {
        return None;
    }
    let mut kinds = Kinds { attractor, numbers: HashMap::new(), all: Vec::new() };
    for root in roots {
        let &[first, second] = attractor.automaton.factors(root.state) else { return None };
        kinds.number([first, second])?;
    }
    let kinds_of = &kinds;
    let found = [2, 1, 0].into_iter().find_map(|up| {
        let axes = [(up + 1) % 3, (up + 2) % 3, up];
        let mut off = 0.0_f64;
        let sheet = |root: &Root| {
            let (sheet, own) = sheet(attractor, kinds_of, root, axes, extent)?;
            off = off.max(own);
            Some(sheet)
        };
        let sheets: Vec<Sheet> = roots.iter().map(sheet).collect::<Option<_>>()?;
        let (corners, missed) = around(attractor, &sheets, extent)?;
        Some((axes, sheets, corners, off + missed))
    });
    let (axes, sheets, corners, off) = found?;
    let (has_smooth_curves, kinds) = (sheets.iter().all(|sheet| sheet.is_smooth), kinds.finish()?);
    Some(Graph { kinds, axes, corners, roots: sheets.into_iter().map(|sheet| sheet.base).collect(), has_smooth_curves, off })
}

impl Attractor {
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
                    let mut along_curves = [None, None];
                    along_curves[along] = Some(own);
                    Part { operator, along: along_curves, kind: numbers[&to], seen, miss }
                };
                attractor.automaton.state(pair[along]).transitions.iter().map(part).collect()
            };
            let [first, second] = [attractor.curve_ends(pair[0])?, attractor.curve_ends(pair[1])?];
            let corner = |a: &Vec<f64>, b: &Vec<f64>| [a.clone(), b.clone()];
            let corners = vec![
                corner(&first.start, &second.start),
                corner(&first.end, &second.start),
                corner(&first.end, &second.end),
                corner(&first.start, &second.end),
            ];
            Some(Kind { enclosure: enclosures[numbers[pair]].clone(), corners, parts: vec![parts(0), parts(1)] })
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
    let base = Base { kind: *kinds.numbers.get(&curves)?, heights, shares, corner, sides };
    Some((Sheet { curves, base, is_smooth }, 2.0 * off))
}

/// The curve above a side of a parallelogram.
struct Above {
    state: StateId,
    /// Where it starts.
    start: Place,
    /// The shares of the side, and the heights, at its control points.
    values: [Vec<f64>; 2],
}

/// The corners of the convex polygon that parallelograms fill, counter-clockwise, and how far it may be off; none where they fill none, or the curves above sides that two have in common differ.
fn around(attractor: &Attractor, sheets: &[Sheet], extent: f64) -> Option<(Vec<Place>, f64)> {
    let corners = |Sheet { base: Base { corner, sides: [p, q], .. }, .. }: &Sheet| {
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[s, t]| [0, 1].map(|axis| corner[axis] + s * p[axis] + t * q[axis]))
    };
    let tiles: Vec<[Place; 4]> = sheets.iter().map(corners).collect();
    tiles.iter().all(|corners| is_wide(corners, extent)).then_some(())?;
    let all: Vec<_> = tiles.iter().flat_map(|corners| sides(corners, extent)).collect();
    let (pairs, open) = pairs(&all);
    let curve = |number: usize| above(attractor, &sheets[number / 4], &tiles[number / 4], number % 4);
    for [one, other] in pairs {
        let (one, other) = (curve(one)?, curve(other)?);
        let are_alike = |k: usize, miss: f64| one.values[k].iter().zip(&other.values[k]).all(|(a, b)| (a - b).abs() <= miss);
        let is_along = one.state == other.state && are_same(one.start, other.start, extent);
        (is_along && are_alike(0, MISS) && are_alike(1, MISS * extent)).then_some(())?;
    }
    outline(&all, open, tiles.iter().map(|corners| double_area(corners).abs()).sum(), extent)
}

fn above(attractor: &Attractor, Sheet { curves, base, .. }: &Sheet, corners: &[Place; 4], side: usize) -> Option<Above> {
    let [first, second] = *curves;
    let [m, n] = curves.map(|curve| attractor.automaton.state(curve).dimension);
    let [along, across] = if side.is_multiple_of(2) { [first, second] } else { [second, first] };
    let ends = attractor.curve_ends(across)?;
    let end = if side == 0 || side == 3 { &ends.start } else { &ends.end };
    let heights = if side.is_multiple_of(2) {
        (0..m).map(|i| (0..n).map(|j| end[j] * base.heights[i * n + j]).sum()).collect()
    } else {
        (0..n).map(|j| (0..m).map(|i| end[i] * base.heights[i * n + j]).sum()).collect()
    };
    Some(Above { state: along, start: corners[[0, 1, 3, 0][side]], values: [base.shares[side % 2].clone(), heights] })
}
