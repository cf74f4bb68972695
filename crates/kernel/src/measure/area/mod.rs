//! The area of smooth surfaces, in bounds that are proven.
//!
//! Cells that are Bezier patches have an area between bounds (`patch`) whose difference falls with their size; cells around extraordinary vertices of subdivision surfaces consist of such patches,
//! and have no more area than a multiple of the square of their size (`rest`). Cells with the widest bounds are divided until what is left open is a small share of the whole, or as many have
//! been looked at as may be; the sums hold the area in any case.
//!
//! The area is that of the parameters' square, seen in space: where a surface covers itself, places count as often.

mod bernstein;
mod patch;
mod rest;

use super::Interval;
use super::double::Double;
use crate::attractor::cell::{ControlPoint, child_points, cross, dot, subtract};
use crate::attractor::{Attractor, BezierPatch, Root};
use crate::automaton::{LeafPrimitive, StateId, SubdivisionOperator};
use crate::budget::{Budget, Stopped};
use bernstein::Binomials;
use patch::Net;
use rayon::prelude::*;
use std::collections::BinaryHeap;

/// Degrees at most.
const MOST_DEGREE: usize = 12;
/// What may be left open, as a share of the area.
const RELATIVE: f64 = 1e-5;
/// Cells that are held at most, roots apart, and multiplications that are made for them.
const MOST_CELLS: usize = 1 << 16;
const MOST_WORK: u64 = 2_000_000_000;
/// Roots that are measured, and cells that are divided, in one go.
const CHUNK: usize = 1 << 10;

/// A part of the surface.
enum Cell {
    /// A Bezier patch.
    Patch(Net),
    /// A cell that consists of patches, its control points seen from one of them, and how far these may be off.
    Other { state: StateId, points: Vec<ControlPoint>, off: f64 },
    /// A triangle.
    Triangle([ControlPoint; 3]),
}

/// A part, and the bounds of its area.
struct Measured {
    area: Interval,
    number: u64,
    /// The root that it is, or the part itself.
    cell: Result<Cell, usize>,
}

impl Measured {
    fn gap(&self) -> f64 {
        self.area.width()
    }
}

impl PartialEq for Measured {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Measured {}

impl PartialOrd for Measured {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Measured {
    /// The widest first, and of those as wide the eldest.
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.gap().total_cmp(&other.gap()).then(other.number.cmp(&self.number))
    }
}

/// What all cells share.
struct Setting<'a> {
    attractor: &'a Attractor,
    patches: Vec<Option<BezierPatch>>,
    shares: Vec<Option<f64>>,
    binomials: Binomials,
}

/// The area of a surface whose cells are Bezier patches in the end, in mm^2: one side of it, places counting as often as they are covered. `None` for other shapes, and for meshes, whose
/// area sums know better.
///
/// Cost: for every cell of degree d about 100 d^3 operations, for a rational one 10 times as much, and at most 2^16 cells and all roots.
///
/// # Errors
/// [`Stopped`] when the budget's token was fired.
pub fn surface_area(attractor: &Attractor, budget: &Budget) -> Result<Option<Interval>, Stopped> {
    let Some(setting) = Setting::new(attractor) else { return Ok(None) };
    budget.cancel.check()?;
    let mut number = 0;
    let (mut heap, mut triangles) = (BinaryHeap::with_capacity(attractor.roots().len()), Vec::new());
    let roots: Vec<usize> = (0..attractor.roots().len()).collect();
    for chunk in roots.chunks(CHUNK) {
        let area = |&root: &usize| budget.cancel.check().map(|()| setting.area(&setting.root(root)));
        let areas: Vec<Interval> = chunk.par_iter().map(area).collect::<Result<_, Stopped>>()?;
        for (&root, area) in chunk.iter().zip(areas) {
            if is_triangle(attractor, attractor.roots()[root].state) {
                triangles.push(area);
                continue;
            }
            heap.push(Measured { area, number, cell: Err(root) });
            number += 1;
        }
    }
    refine(&setting, &mut heap, number, budget)?;
    let (mut low, mut high) = (Double::default(), Double::default());
    for area in triangles.into_iter().chain(heap.into_vec().into_iter().map(|part| part.area)) {
        (low, high) = (low + Double::from(area.low), high + Double::from(area.high));
    }
    // Sums of numbers of one sign in twice the precision are off by less than the rounding of the result.
    let [low, high] = [low.nearest() * (1.0 - 4.0 * f64::EPSILON), high.nearest() * (1.0 + 4.0 * f64::EPSILON)];
    Ok((low.is_finite() && high.is_finite()).then_some(Interval { low, high }))
}

/// Divides the parts with the widest bounds.
fn refine(setting: &Setting<'_>, heap: &mut BinaryHeap<Measured>, mut number: u64, budget: &Budget) -> Result<(), Stopped> {
    let most = setting.most_cells(budget) + heap.len();
    let mut work = 0;
    loop {
        let (low, gap) = heap.iter().fold((0.0, 0.0), |(low, gap), part| (low + part.area.low, gap + part.gap()));
        let mut open: f64 = gap - RELATIVE * low;
        let mut chosen = Vec::new();
        // Not so many that narrow ones are among them.
        while chosen.len() < (heap.len() / 8).clamp(1, CHUNK) && open > 0.0 && heap.len() + 4 * chosen.len() < most {
            let Some(part) = heap.pop() else { break };
            open -= part.gap();
            chosen.push(part);
        }
        if chosen.is_empty() || work > MOST_WORK {
            heap.extend(chosen);
            return Ok(());
        }
        let divide = |part: &Measured| -> Result<Vec<(Cell, Interval)>, Stopped> {
            budget.cancel.check()?;
            let children = match &part.cell {
                Ok(cell) => setting.children(cell),
                Err(root) => setting.children(&setting.root(*root)),
            };
            Ok(children.into_iter().map(|cell| (setting.area(&cell), cell)).map(|(area, cell)| (cell, area)).collect())
        };
        let divided: Vec<Vec<(Cell, Interval)>> = chosen.par_iter().map(divide).collect::<Result<_, _>>()?;
        for (cell, area) in divided.into_iter().flatten() {
            work += if let Cell::Patch(net) = &cell { net.cost() } else { 1000 };
            heap.push(Measured { area, number, cell: Ok(cell) });
            number += 1;
        }
    }
}

impl<'a> Setting<'a> {
    /// `None` for shapes that are no surfaces of patches alone.
    fn new(attractor: &'a Attractor) -> Option<Self> {
        let roots = attractor.roots();
        let whole = |(index, root): (usize, &Root)| attractor.trim_of(index).is_none() && root.solid.is_none();
        if !roots.iter().enumerate().all(whole) {
            return None;
        }
        let mut patches = attractor.bezier_patches();
        patches.iter_mut().for_each(|patch| {
            patch.take_if(|patch| patch.degrees.iter().any(|degree| !(1..=MOST_DEGREE).contains(degree)));
        });
        let is_patch = |root: &Root| patches[root.state.index()].is_some();
        let is_triangle = |root: &Root| is_triangle(attractor, root.state);
        if roots.iter().all(is_triangle) || roots.iter().any(|root| root.rational && !is_patch(root)) {
            return None;
        }
        let shares = rest::shares(attractor, &patches)?;
        let degree = patches.iter().flatten().flat_map(|patch| patch.degrees).max()?;
        Some(Self { attractor, patches, shares, binomials: Binomials::new(Net::most_degree(degree)) })
    }

    /// Parts that may be held at once.
    fn most_cells(&self, budget: &Budget) -> usize {
        let points = self.attractor.automaton().states().iter().map(|state| state.dimension as u64);
        let points = points.chain(self.patches.iter().flatten().map(|patch| patch.points.columns() as u64)).max().unwrap_or(1);
        let allowed = (budget.limits.memory_bytes / 4 / (points * size_of::<ControlPoint>() as u64)).min(budget.limits.cells);
        usize::try_from(allowed).unwrap_or(MOST_CELLS).min(MOST_CELLS)
    }

    /// A root, seen from its first control point.
    fn root(&self, index: usize) -> Cell {
        let Root { state, points, rational, .. } = &self.attractor.roots()[index];
        if is_triangle(self.attractor, *state) {
            return Cell::Triangle([points[0], points[1], points[2]]);
        }
        let [x, y, z, w] = points[0];
        let base = if *rational { [x / w, y / w, z / w] } else { [x, y, z] };
        let local = |point: &ControlPoint| {
            let share = if *rational { point[3] } else { 1.0 };
            let [x, y, z] = std::array::from_fn(|axis| (-base[axis]).mul_add(share, point[axis]));
            [x, y, z, share]
        };
        let points: Vec<ControlPoint> = points.iter().map(local).collect();
        let off = f64::EPSILON * reach(&points);
        self.cell(*state, points, *rational, off)
    }

    /// A cell with these control points, each of which may be off.
    fn cell(&self, state: StateId, points: Vec<ControlPoint>, rational: bool, off: f64) -> Cell {
        let Some(patch) = &self.patches[state.index()] else { return Cell::Other { state, points, off } };
        let mut net = vec![[0.0; 4]; patch.points.columns()];
        child_points(&points, &patch.points, &mut net);
        let (place, own) = (reach(&points), column_sum(&patch.points));
        let weight = points.iter().fold(0.0_f64, |most, point| most.max(point[3].abs()));
        // Operators are rounded, what they are multiplied by is summed, and they may miss what they are taken for.
        let exact = is_identity(&patch.points);
        let share = if exact { 0.0 } else { rounding(points.len()) * own } + 4.0 * points.len() as f64 * patch.miss;
        let off = [off * own + share * place, if rational { share * weight } else { 0.0 }];
        Cell::Patch(Net { degrees: patch.degrees, points: net, rational, off })
    }

    fn children(&self, cell: &Cell) -> Vec<Cell> {
        let (state, points, off) = match cell {
            Cell::Patch(net) => return net.quarters().into_iter().map(Cell::Patch).collect(),
            Cell::Triangle(_) => return Vec::new(),
            Cell::Other { state, points, off } => (state, points, *off),
        };
        let transitions = &self.attractor.automaton().state(*state).transitions;
        let place = reach(points);
        let child = |(to, operator): (StateId, &SubdivisionOperator)| {
            let mut child = vec![[0.0; 4]; operator.columns()];
            child_points(points, operator, &mut child);
            let sum = column_sum(operator);
            let [x, y, z, _] = child[0];
            child.iter_mut().for_each(|point| *point = [point[0] - x, point[1] - y, point[2] - z, 1.0]);
            let off = off * sum + 2.0 * rounding(points.len()) * sum * place;
            self.cell(to, child, false, off)
        };
        transitions.iter().map(|transition| child((transition.to, &transition.operator))).collect()
    }

    fn area(&self, cell: &Cell) -> Interval {
        match cell {
            Cell::Patch(net) => net.area(&self.binomials),
            Cell::Other { state, points, off } => {
                let places = || points.iter().map(|&[x, y, z, _]| [x, y, z]);
                let distances = places().enumerate().flat_map(|(k, a)| {
                    places().skip(k + 1).map(move |b| {
                        let difference = subtract(&a, &b);
                        dot(&difference, &difference)
                    })
                });
                let widest = distances.fold(0.0, f64::max).sqrt() * (1.0 + 8.0 * f64::EPSILON) + 2.0 * off;
                let share = self.shares[state.index()].unwrap_or(f64::INFINITY);
                Interval { low: 0.0, high: share * widest * widest * (1.0 + 8.0 * f64::EPSILON) }
            }
            Cell::Triangle(corners) => {
                let [a, b, c] = corners.map(|[x, y, z, _]| [x, y, z]);
                let (u, v) = (subtract(&b, &a), subtract(&c, &a));
                let normal = cross(&u, &v);
                let area = 0.5 * dot(&normal, &normal).sqrt();
                let off = 16.0 * f64::EPSILON * (dot(&u, &u) * dot(&v, &v)).sqrt();
                Interval { low: (area - off).max(0.0), high: area + off }
            }
        }
    }
}

/// Whether cells of a state are triangles.
fn is_triangle(attractor: &Attractor, state: StateId) -> bool {
    let state = attractor.automaton().state(state);
    state.leaf == LeafPrimitive::Simplex && state.dimension == 3
}

/// What a sum of n products may be off, as a share of the sum of their sizes, the factors being rounded.
fn rounding(n: usize) -> f64 {
    (n + 4) as f64 * f64::EPSILON
}

/// The length of the longest position vector.
fn reach(points: &[ControlPoint]) -> f64 {
    points.iter().map(|[x, y, z, _]| x * x + y * y + z * z).fold(0.0, f64::max).sqrt()
}

/// The largest sum of sizes in a column.
fn column_sum(operator: &SubdivisionOperator) -> f64 {
    let sum = |k: usize| operator.column(k).iter().map(|x| x.abs()).sum::<f64>();
    (0..operator.columns()).map(sum).fold(1.0, f64::max)
}

/// Whether control points are what they are multiplied to.
fn is_identity(operator: &SubdivisionOperator) -> bool {
    let unit = |k: usize| operator.column(k).iter().enumerate().all(|(row, &x)| x == f64::from(u8::from(row == k)));
    operator.rows() == operator.columns() && (0..operator.columns()).all(unit)
}
