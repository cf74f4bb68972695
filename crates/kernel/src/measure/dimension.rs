//! The fractal dimension of a shape: exactly for graph-directed similarities, else between bounds.
//!
//! The cells of a state are images of one of them. Where the control points of a child, and of the cell of its state that was met first, have proportional Gram
//! matrices of edges, the map between them is a similarity, and its ratio c is the root of their quotient. Let M(s) have the entries sum of c^s over the transitions
//! from one state to another. The attractor can be covered by cells of diameter d and less in a number below a multiple of d^-s when rho(M(s)) <= 1, so
//! the s with rho(M(s)) = 1, the largest over the strongly connected components, bounds the upper box dimension from above; where the open set condition holds
//! it is the Hausdorff dimension, and all dimensions between are equal to it (Moran, 1946; Hutchinson, 1981; Mauldin and Williams, "Hausdorff dimension in graph
//! directed constructions", 1988).
//!
//! The open sets tried are the interiors of the cells' convex hulls. Children lie in the hull of their parent, so all that is asked is that hulls of siblings
//! have no inner point in common: a direction along which one ends where the next begins, which are suprema of linear functions over the shape.
//!
//! In all other cases: cells at level n have diameters below a multiple of rate^n, with the bound of the joint spectral radius as the rate, and their number
//! grows like the spectral radius of the automaton's graph; so the upper box dimension is at most the quotient of the logarithms. Of curves, and products of them,
//! more is known: see `curve`.
//!
//! Models are made of numbers with 16 digits: what is proven holds for the shapes that they mean, where similar is similar, flat is flat and what touches touches up to 11 of them.
//!
//! No dimension is above that of the smallest affine space that holds the shape. For every state s let b_s be a point of its attractor K_s, in barycentric
//! coordinates, and D_s a space of directions, such that T b_t - b_s and T D_t lie in D_s for all transitions T from s to states t. Then T maps b_t + D_t into
//! b_s + D_s. Start with the sets {b_s} and replace each by the union of its T times those of the t: all stay within the b_s + D_s, which are closed, and they
//! converge to the K_s. So K_s lies in b_s + D_s, however the smallest such D_s are found: by adding what lacks until nothing does.

use super::bounds::support_of_cell;
use super::{Interval, curve};
use crate::attractor::Attractor;
use crate::attractor::cell::{Cell, ControlPoint, Point, child_points, cross, dot, subtract};
use crate::automaton::{LeafPrimitive, StateId};
use crate::budget::{Budget, Stopped};
use robust::{Coord, orient2d};
use std::collections::{BTreeSet, HashMap, VecDeque};

/// How much of a dimension is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DimensionKnowledge {
    /// Hausdorff and box dimension are this number: the shape consists of simplices.
    Elementary,
    /// Hausdorff and box dimension are this number: the shape consists of similar copies, and their convex hulls have no inner points in common,
    /// up to [`SEPARATION`] of their size.
    Similarities,
    /// Bounds: the shape consists of similar copies that may overlap, or whose hulls do.
    OverlappingSimilarities,
    /// Bounds: cells are not similar to each other.
    Contraction,
}

/// The dimension of a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dimension {
    /// Hausdorff dimension and upper box dimension lie between.
    pub bounds: Interval,
    /// Why.
    pub knowledge: DimensionKnowledge,
}

impl Dimension {
    /// What is known besides where the shape winds around a volume: it parts space, and no set of a dimension below 2 does (W. Hurewicz, H. Wallman, "Dimension
    /// Theory", 1941, theorems IV 4 and VII 3).
    #[must_use]
    pub fn parting_space(self) -> Self {
        let Interval { low, high } = self.bounds;
        Self { bounds: Interval { low: low.max(2.0), high: high.max(2.0) }, ..self }
    }

    /// That of every body.
    pub const SOLID: Self = Self { bounds: Interval { low: 3.0, high: 3.0 }, knowledge: DimensionKnowledge::Elementary };
}

/// Hulls that overlap by less than this share of their size count as apart.
pub const SEPARATION: f64 = 1e-9;
/// How far Gram matrices may be from proportional, relative to their size: what the digits of the model's numbers lose on their way.
const SIMILAR: f64 = 1e-13;
/// What a root found from ratios in double precision may be off.
const ROUNDING: f64 = 1e-13;
/// Ratios may be off by so much of themselves, and by what their Gram matrices are from proportional.
const RATIO: f64 = 1e-15;
/// Of a Gram matrix with a determinant below this share of its trace's power nothing is concluded.
const SINGULAR: f64 = 1e-9;
/// States with similarities of their own, at most: their matrices are dense.
const MOST_STATES: usize = 300;
/// Transitions of a state whose hulls are compared in pairs, at most.
const MOST_SIBLINGS: usize = 64;
/// Steps of power iteration, and towards points of attractors.
const STEPS: usize = 2_000;
/// Directions that are less than this, relative to barycentric coordinates, are rounding, and so is what is thinner than this share of its size.
const FLAT: f64 = 1e-12;
/// Gaps that are less than this share of the size are rounding: points are known to 1e-12 of it, and the share is taken in a norm in which sizes differ a little.
const GAP: f64 = 1e-11;

/// The dimension of an attractor: the largest of its root cells'. Roots of the same state and similar control points count once.
///
/// Cost: linear in roots and transitions; for a state, two suprema over cells for each pair of at most 64 transitions.
///
/// # Errors
/// [`Stopped`].
pub fn dimension(attractor: &Attractor, budget: &Budget) -> Result<Dimension, Stopped> {
    let mut result = elementary(0.0);
    let mut known: Vec<(StateId, Vec<f64>, Dimension)> = Vec::new();
    let mut facts: HashMap<StateId, StateFacts> = HashMap::new();
    for (index, root) in attractor.roots().iter().enumerate() {
        budget.cancel.check()?;
        let points = projected(&root.points, root.rational);
        let state = attractor.automaton().state(root.state);
        if root.solid.is_some() {
            return Ok(Dimension::SOLID);
        }
        if state.transitions.is_empty() && matches!(state.leaf, LeafPrimitive::Simplex) {
            result = larger(result, elementary(f64::from(simplex_rank(&points))));
            continue;
        }
        let edges = gram(&points);
        if let Some(&(.., found)) = known.iter().find(|(state, other, _)| *state == root.state && ratio(other, &edges).is_some()) {
            result = larger(result, found);
            continue;
        }
        let facts = facts.entry(root.state).or_insert_with(|| StateFacts::of(attractor, root.state));
        let found = of_root(attractor, index, facts, budget)?;
        if known.len() < MOST_STATES {
            known.push((root.state, edges, found));
        }
        result = larger(result, found);
    }
    Ok(result)
}

fn elementary(value: f64) -> Dimension {
    Dimension { bounds: Interval { low: value, high: value }, knowledge: DimensionKnowledge::Elementary }
}

/// The dimension of a union; what is known of it is known of the part that decides.
fn larger(a: Dimension, b: Dimension) -> Dimension {
    let bounds = Interval { low: a.bounds.low.max(b.bounds.low), high: a.bounds.high.max(b.bounds.high) };
    let decides = if b.bounds.high > a.bounds.high { b } else { a };
    Dimension { bounds, knowledge: decides.knowledge }
}

/// What bounds dimensions and does not depend on control points.
struct StateFacts {
    /// What coverings by cells, and the lengths of curves, bound the dimension by.
    covering: f64,
    /// A basis of the directions in which the attractor of the state extends, in barycentric coordinates; `None` when that is not known.
    directions: Option<Vec<Vec<f64>>>,
}

impl StateFacts {
    fn of(attractor: &Attractor, start: StateId) -> Self {
        Self { covering: covering(attractor, start), directions: directions(attractor, start) }
    }

    /// The dimension of an affine space that holds the part of the attractor in a cell with these control points.
    fn spread(&self, points: &[ControlPoint], rational: bool) -> u8 {
        let points = projected(points, rational);
        let Some(directions) = self.directions.as_ref().filter(|_| !rational) else { return rank(&points) };
        // The entries of a direction sum to 0: seen from the first point, fewer digits cancel.
        let along = |direction: &Vec<f64>| {
            let terms = || direction.iter().zip(&points).map(|(share, point)| subtract(point, &points[0]).map(|x| share * x));
            terms().fold([0.0; 3], |sum, term| std::array::from_fn(|axis| sum[axis] + term[axis]))
        };
        let ends: Vec<Point> = std::iter::once([0.0; 3]).chain(directions.iter().map(along)).collect();
        rank(&ends).min(rank(&points))
    }
}

fn of_root(attractor: &Attractor, index: usize, facts: &StateFacts, budget: &Budget) -> Result<Dimension, Stopped> {
    let root = &attractor.roots()[index];
    let general = by_contraction(attractor, index, facts, budget)?;
    if root.rational || attractor.root_window(index).is_some() {
        return Ok(general);
    }
    let Some(system) = System::new(attractor, index) else { return Ok(general) };
    let mut exponent = 0.0_f64;
    let mut highest = 0.0_f64;
    for component in system.components() {
        let [least, most] = [1.0 - system.ratios_off, 1.0 + system.ratios_off].map(|share| system.exponent(&component, share));
        let (Some(least), Some(most)) = (least, most) else { return Ok(general) };
        (exponent, highest) = (exponent.max(least.low), highest.max(most.high));
    }
    let similarity = Interval { low: (exponent - ROUNDING).max(0.0), high: highest + ROUNDING };
    if system.is_separated(attractor, budget)? {
        return Ok(Dimension { bounds: similarity, knowledge: DimensionKnowledge::Similarities });
    }
    let bounds = Interval { low: general.bounds.low.min(similarity.high), high: similarity.high.min(general.bounds.high) };
    Ok(Dimension { bounds, knowledge: DimensionKnowledge::OverlappingSimilarities })
}

/// Bounds for every shape: of the cells' number and size, of the affine space that holds it, and 1 where a part is connected and not a point.
fn by_contraction(attractor: &Attractor, index: usize, facts: &StateFacts, budget: &Budget) -> Result<Dimension, Stopped> {
    let root = &attractor.roots()[index];
    let spread = f64::from(facts.spread(&root.points, root.rational));
    let high = facts.covering.min(spread);
    let mut low = 0.0;
    if let Some((cell, points)) = connected_part(attractor, index).filter(|_| high > 0.0) {
        for axis in 0..3 {
            let mut ends = [0.0; 2];
            for (end, sign) in ends.iter_mut().zip([-1.0, 1.0]) {
                let direction = std::array::from_fn(|other| if other == axis { sign } else { 0.0 });
                *end = support_of_cell(attractor, cell, &points, &direction, budget)?.low;
            }
            if ends[0] + ends[1] > 0.0 {
                low = 1.0;
            }
        }
    }
    Ok(Dimension { bounds: Interval { low, high: high.max(low) }, knowledge: DimensionKnowledge::Contraction })
}

/// The first cell below a root, the root included, whose state is proven to be connected; none of a root that is cut along loops.
fn connected_part(attractor: &Attractor, index: usize) -> Option<(Cell, Vec<ControlPoint>)> {
    if attractor.root_window(index).is_some() {
        return None;
    }
    let is_connected =
        |state: StateId| curve::is_connected(attractor.automaton(), state) || attractor.widest_gap(state).is_some_and(|gap| gap <= GAP);
    let mut seen = vec![false; attractor.automaton().states().len()];
    let mut open = VecDeque::from([(attractor.root_cell(index), attractor.roots()[index].points.clone())]);
    seen[open[0].0.state.index()] = true;
    while let Some((cell, points)) = open.pop_front() {
        if is_connected(cell.state) {
            return Some((cell, points));
        }
        for (step, transition) in attractor.state_of(&cell).transitions.iter().enumerate() {
            if !std::mem::replace(&mut seen[transition.to.index()], true) {
                let mut child = vec![[0.0; 4]; transition.operator.columns()];
                child_points(&points, &transition.operator, &mut child);
                open.push_back((attractor.child_cell(&cell, step, &child), child));
            }
        }
    }
    None
}

/// A bound of the upper box dimension of a state's attractor in its barycentric space, and so of its images.
fn covering(attractor: &Attractor, start: StateId) -> f64 {
    let (automaton, rate) = (attractor.automaton(), attractor.contraction().upper);
    // Quotients of logarithms, rounded up.
    let quotient = |of: f64| if of > 0.0 && rate > 0.0 { of / -rate.ln() * (1.0 + 1e-12) } else { 0.0 };
    let by_number = quotient(growth(attractor, start).ln());
    let factors = automaton.factors(start);
    if !factors.is_empty() {
        return by_number.min(factors.iter().map(|&factor| covering(attractor, factor)).sum());
    }
    let by_length = curve::lengthening(automaton, &reached(attractor, start)).map_or(f64::INFINITY, |growth| 1.0 + quotient(growth));
    by_number.min(by_length)
}

/// The spectral radius of the graph of the states that are reached, or a larger number: the number of cells at level n is below a multiple of its powers.
fn growth(attractor: &Attractor, start: StateId) -> f64 {
    let states = attractor.automaton().states();
    let reached = reached(attractor, start);
    let mut number = vec![usize::MAX; states.len()];
    for (place, state) in reached.iter().enumerate() {
        number[state.index()] = place;
    }
    let edges: Vec<Vec<usize>> = reached
        .iter()
        .map(|&state| attractor.automaton().state(state).transitions.iter().map(|t| number[t.to.index()]).collect())
        .collect();
    // Collatz and Wielandt: with a positive vector v, the largest quotient (A v)_i / v_i is at least the radius.
    let mut v = vec![1.0_f64; reached.len()];
    let mut best = f64::INFINITY;
    for _ in 0..200 {
        let next: Vec<f64> = edges.iter().map(|own| own.iter().map(|&to| v[to]).sum::<f64>()).collect();
        best = next.iter().zip(&v).map(|(next, v)| next / v).fold(0.0, f64::max).min(best);
        let largest = next.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        // A little of the old keeps every entry positive.
        v = next.iter().zip(&v).map(|(next, v)| (next / largest + v * 1e-3).max(1e-300)).collect();
    }
    best
}

/// A basis of D_s of the module's comment for the first state, orthonormal but for rounding; `None` for leaves that are no simplices, where the points b do not
/// converge, and for more than [`MOST_STATES`] states.
fn directions(attractor: &Attractor, start: StateId) -> Option<Vec<Vec<f64>>> {
    let reached = reached(attractor, start);
    if reached.len() > MOST_STATES {
        return None;
    }
    let state = |place: usize| attractor.automaton().state(reached[place]);
    let place = |id: StateId| reached.iter().position(|other| *other == id);
    let targets: Vec<Vec<usize>> = (0..reached.len())
        .map(|own| state(own).transitions.iter().map(|transition| place(transition.to)).collect())
        .collect::<Option<_>>()?;
    let mut bases: Vec<Vec<Vec<f64>>> = vec![Vec::new(); reached.len()];
    let mut points: Vec<Vec<f64>> = Vec::with_capacity(reached.len());
    for (own, basis) in bases.iter_mut().enumerate() {
        let n = state(own).dimension;
        points.push(vec![1.0 / n as f64; n]);
        if targets[own].is_empty() {
            if !matches!(state(own).leaf, LeafPrimitive::Simplex) {
                return None;
            }
            for corner in 1..n {
                let edge = (0..n).map(|k| f64::from(u8::from(k == corner)) - f64::from(u8::from(k == 0)));
                add_direction(basis, edge.collect(), 1.0);
            }
        }
    }
    // b of a state is the image of that of its first child's.
    let mut is_settled = false;
    for _ in 0..STEPS {
        let mut change = 0.0_f64;
        for own in (0..reached.len()).filter(|&own| !targets[own].is_empty()) {
            let next = state(own).transitions[0].operator.apply(&points[targets[own][0]]);
            let size = next.iter().map(|x| x.abs()).sum::<f64>();
            let moved = next.iter().zip(&points[own]).map(|(a, b)| (a - b).abs()).sum::<f64>();
            change = change.max(moved / size);
            points[own] = next;
        }
        is_settled = change <= 1e-2 * FLAT;
        if is_settled {
            break;
        }
    }
    if !is_settled {
        return None;
    }
    // Ends, as every round but the last adds a direction.
    loop {
        let mut grew = false;
        for own in 0..reached.len() {
            for (transition, &to) in state(own).transitions.iter().zip(&targets[own]) {
                let image = transition.operator.apply(&points[to]);
                let size = image.iter().map(|x| x.abs()).sum::<f64>();
                let step = image.iter().zip(&points[own]).map(|(a, b)| a - b).collect();
                grew |= add_direction(&mut bases[own], step, size);
                for known in 0..bases[to].len() {
                    let turned = transition.operator.apply(&bases[to][known]);
                    grew |= add_direction(&mut bases[own], turned, 1.0);
                }
            }
        }
        if !grew {
            return bases.into_iter().next();
        }
    }
}

/// Adds what a basis lacks of a direction, unless that is rounding beside numbers of that size. Whether it did.
fn add_direction(basis: &mut Vec<Vec<f64>>, mut direction: Vec<f64>, size: f64) -> bool {
    let length = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    // The second time takes away what rounding left.
    for _ in 0..2 {
        for known in basis.iter() {
            let share: f64 = known.iter().zip(&direction).map(|(a, b)| a * b).sum();
            direction.iter_mut().zip(known).for_each(|(x, known)| *x -= share * known);
        }
    }
    let left = length(&direction);
    // Directions sum to 0: there are fewer than coordinates.
    let lacks = left > FLAT * size.max(1.0) && basis.len() + 1 < direction.len();
    if lacks {
        direction.iter_mut().for_each(|x| *x /= left);
        basis.push(direction);
    }
    lacks
}

fn reached(attractor: &Attractor, start: StateId) -> Vec<StateId> {
    let mut seen = vec![false; attractor.automaton().states().len()];
    let mut open = vec![start];
    let mut found = Vec::new();
    seen[start.index()] = true;
    while let Some(state) = open.pop() {
        found.push(state);
        for transition in &attractor.automaton().state(state).transitions {
            if !std::mem::replace(&mut seen[transition.to.index()], true) {
                open.push(transition.to);
            }
        }
    }
    found
}

fn projected(points: &[ControlPoint], rational: bool) -> Vec<Point> {
    points.iter().map(|p| if rational { [p[0] / p[3], p[1] / p[3], p[2] / p[3]] } else { [p[0], p[1], p[2]] }).collect()
}

/// Scalar products of the edges from the first point, the upper triangle row by row.
fn gram(points: &[Point]) -> Vec<f64> {
    let edges: Vec<Point> = points[1..].iter().map(|point| subtract(point, &points[0])).collect();
    (0..edges.len()).flat_map(|i| (i..edges.len()).map(move |j| (i, j))).map(|(i, j)| dot(&edges[i], &edges[j])).collect()
}

/// c, when the second Gram matrix is c^2 times the first, and what c may be off relative to itself; 0 for a point.
///
/// For matrices G and H = c^2 G + E of n rows, x^T H x is between (c^2 - n e / l) and (c^2 + n e / l) times x^T G x, with e the largest entry of E and l the least eigenvalue of G: that is at
/// least det G / (tr G / (n - 1))^(n - 1), as the other ones have at most that product.
fn ratio(first: &[f64], second: &[f64]) -> Option<(f64, f64)> {
    let size = |gram: &[f64]| gram.iter().map(|x| x.abs()).fold(0.0, f64::max);
    let (from, to) = (size(first), size(second));
    if to == 0.0 {
        return Some((0.0, 0.0));
    }
    // Least squares: the sum over all entries has the least rounding.
    let square = first.iter().zip(second).map(|(a, b)| a * b).sum::<f64>() / first.iter().map(|a| a * a).sum::<f64>();
    let off = first.iter().zip(second).map(|(a, b)| (b - square * a).abs()).fold(0.0, f64::max);
    if !(from > 0.0 && square > 0.0 && off <= SIMILAR * to) {
        return None;
    }
    let least = match *first {
        [a] => a,
        [a, b, d] => (a * d - b * b) / (a + d),
        [a, b, c, d, e, f] => {
            let determinant = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d);
            determinant / (0.5 * (a + d + f)).powi(2)
        }
        _ => 0.0,
    };
    // Control points that are more than the corners of a simplex follow each other up to rounding only.
    let share = if least > SINGULAR * from { 3.0 * off / (least * square) } else { SIMILAR };
    Some((square.sqrt(), RATIO + share))
}

fn longest_edge(points: &[ControlPoint]) -> f64 {
    gram(&projected(points, false)).into_iter().fold(0.0, f64::max).sqrt()
}

/// The dimension of a simplex, exactly: of its affine hull.
fn simplex_rank(points: &[Point]) -> u8 {
    let in_plane = |axis: usize, p: &Point| Coord { x: p[axis], y: p[(axis + 1) % 3] };
    match points {
        [] | [_] => 0,
        [a, b] => u8::from(a != b),
        [a, b, c] => match (0..3).any(|axis| orient2d(in_plane(axis, a), in_plane(axis, b), in_plane(axis, c)) != 0.0) {
            true => 2,
            false => u8::from(a != b || a != c),
        },
        // The leaves of automata are points, segments and triangles.
        _ => rank(points),
    }
}

/// The dimension of the points' affine hull, up to rounding.
fn rank(points: &[Point]) -> u8 {
    let Some(first) = points.first() else { return 0 };
    let edges: Vec<Point> = points[1..].iter().map(|point| subtract(point, first)).collect();
    let square = |x: &Point| dot(x, x);
    let Some(longest) = edges.iter().max_by(|a, b| square(a).total_cmp(&square(b))).filter(|edge| square(edge) > 0.0) else { return 0 };
    let scale = square(longest);
    let normals: Vec<Point> = edges.iter().map(|edge| cross(longest, edge)).collect();
    let Some(normal) = normals.iter().max_by(|a, b| square(a).total_cmp(&square(b))).filter(|n| square(n) > FLAT * FLAT * scale * scale)
    else {
        return 1;
    };
    2 + u8::from(edges.iter().any(|edge| dot(edge, normal).powi(2) > FLAT * FLAT * square(normal) * scale))
}

/// A graph-directed system of similarities: a cell of every state, and the ratios between.
struct System {
    /// What ratios may be off, relative to themselves.
    ratios_off: f64,
    /// By the number of the state here: its first cell, and its control points.
    cells: Vec<(Cell, Vec<ControlPoint>)>,
    /// By state: number of the child's state, and ratio.
    ratios: Vec<Vec<(usize, f64)>>,
}

impl System {
    /// `None` when some child is not similar to the first cell of its state, or there are too many states.
    fn new(attractor: &Attractor, root: usize) -> Option<Self> {
        let mut numbers = vec![usize::MAX; attractor.automaton().states().len()];
        let start = attractor.root_cell(root);
        numbers[start.state.index()] = 0;
        let points = &attractor.roots()[root].points;
        let mut system = Self { ratios_off: 0.0, cells: vec![(start, points.clone())], ratios: Vec::new() };
        // Far from the origin digits would be lost: these cells are where the root begins in it.
        let first = points[0];
        let near = |point: &ControlPoint| [point[0] - first[0], point[1] - first[1], point[2] - first[2], point[3]];
        let mut frames: Vec<Vec<ControlPoint>> = vec![points.iter().map(near).collect()];
        let mut grams = vec![gram(&projected(&frames[0], false))];
        while system.ratios.len() < system.cells.len() {
            let (cell, points) = system.cells[system.ratios.len()].clone();
            let frame = frames[system.ratios.len()].clone();
            let state = attractor.state_of(&cell);
            if state.transitions.is_empty() && !matches!(state.leaf, LeafPrimitive::Simplex) {
                return None;
            }
            let mut own = Vec::with_capacity(state.transitions.len());
            for (index, transition) in state.transitions.iter().enumerate() {
                let mut small = vec![[0.0; 4]; transition.operator.columns()];
                child_points(&frame, &transition.operator, &mut small);
                let edges = gram(&projected(&small, false));
                let number = numbers[transition.to.index()];
                if number != usize::MAX {
                    let (found, off) = ratio(&grams[number], &edges)?;
                    system.ratios_off = system.ratios_off.max(off);
                    own.push((number, found));
                    continue;
                }
                let mut child = small.clone();
                child_points(&points, &transition.operator, &mut child);
                let number = system.cells.len();
                if number == MOST_STATES || edges.iter().all(|&x| x == 0.0) {
                    return None;
                }
                numbers[transition.to.index()] = number;
                own.push((number, 1.0));
                system.cells.push((attractor.child_cell(&cell, index, &child), child));
                frames.push(small);
                grams.push(edges);
            }
            system.ratios.push(own);
        }
        Some(system)
    }

    /// States that reach each other, where something returns.
    fn components(&self) -> Vec<Vec<usize>> {
        let count = self.ratios.len();
        let mut reaches = vec![vec![false; count]; count];
        for (start, reaches) in reaches.iter_mut().enumerate() {
            let mut open = vec![start];
            while let Some(state) = open.pop() {
                for &(to, ratio) in &self.ratios[state] {
                    if ratio > 0.0 && !std::mem::replace(&mut reaches[to], true) {
                        open.push(to);
                    }
                }
            }
        }
        let with = |state: usize| (0..count).filter(|&other| reaches[state][other] && reaches[other][state]).collect::<Vec<_>>();
        (0..count)
            .filter(|&state| reaches[state][state])
            .map(with)
            .filter(|own| !own.is_empty())
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect()
    }

    /// s with rho(M(s)) = 1 on a component for a share of the ratios, between two numbers where the radius is proven to be above and below 1.
    fn exponent(&self, component: &[usize], share: f64) -> Option<Interval> {
        // A ratio of 1 or more on a cycle cannot be: the automaton contracts. Single ratios may be.
        let (mut low, mut high) = (0.0, 1.0);
        if self.compare(component, share, low) == Some(std::cmp::Ordering::Equal) {
            return Some(Interval { low: 0.0, high: 0.0 });
        }
        while self.compare(component, share, high) == Some(std::cmp::Ordering::Greater) {
            (low, high) = (high, 2.0 * high);
            if high > 1e3 {
                return None;
            }
        }
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            match self.compare(component, share, middle) {
                Some(std::cmp::Ordering::Greater) => low = middle,
                Some(std::cmp::Ordering::Less) => high = middle,
                // At the root up to rounding.
                Some(std::cmp::Ordering::Equal) | None => return Some(Interval { low: middle - ROUNDING, high: middle + ROUNDING }),
            }
        }
        Some(Interval { low, high })
    }

    /// How rho(M(s)) compares with 1 on a component for a share of the ratios: by the least and the largest quotient of (M + 1) v and v for a positive v (Collatz and Wielandt).
    /// `None` when that is not settled after [`STEPS`].
    fn compare(&self, component: &[usize], share: f64, s: f64) -> Option<std::cmp::Ordering> {
        let place = |state: usize| component.binary_search(&state).ok();
        let rows: Vec<Vec<(usize, f64)>> = component
            .iter()
            .map(|&state| {
                self.ratios[state]
                    .iter()
                    .filter_map(|&(to, c)| Some((place(to)?, if c > 0.0 { (share * c).powf(s) } else { return None })))
                    .collect()
            })
            .collect();
        let mut v = vec![1.0_f64; component.len()];
        for _ in 0..STEPS {
            let next: Vec<f64> =
                rows.iter().zip(&v).map(|(row, own)| own + row.iter().map(|&(to, weight)| weight * v[to]).sum::<f64>()).collect();
            let quotients = || next.iter().zip(&v).map(|(next, v)| next / v);
            let (least, largest) = (quotients().fold(f64::INFINITY, f64::min), quotients().fold(0.0, f64::max));
            let error = 4.0 * f64::EPSILON * (1.0 + rows.iter().map(Vec::len).max().unwrap_or(0) as f64);
            if least > 2.0 + error {
                return Some(std::cmp::Ordering::Greater);
            }
            if largest < 2.0 - error {
                return Some(std::cmp::Ordering::Less);
            }
            if largest - least <= error {
                return Some(std::cmp::Ordering::Equal);
            }
            let scale = next.iter().copied().fold(0.0, f64::max);
            v = next.iter().map(|x| x / scale).collect();
        }
        None
    }

    /// Whether the hulls of all siblings are apart but for their borders.
    fn is_separated(&self, attractor: &Attractor, budget: &Budget) -> Result<bool, Stopped> {
        for ((cell, points), ratios) in self.cells.iter().zip(&self.ratios) {
            if ratios.len() > MOST_SIBLINGS {
                return Ok(false);
            }
            let mut children: Vec<(Cell, Vec<ControlPoint>)> = Vec::with_capacity(ratios.len());
            for (index, transition) in attractor.state_of(cell).transitions.iter().enumerate() {
                let mut child = vec![[0.0; 4]; transition.operator.columns()];
                child_points(points, &transition.operator, &mut child);
                children.push((attractor.child_cell(cell, index, &child), child));
            }
            for (index, own) in children.iter().enumerate() {
                for other in &children[..index] {
                    if !are_apart(attractor, own, other, budget)? {
                        return Ok(false);
                    }
                }
            }
        }
        Ok(true)
    }
}

/// Whether a direction is found along which the hull of one cell ends where that of the other begins.
fn are_apart(
    attractor: &Attractor,
    own: &(Cell, Vec<ControlPoint>),
    other: &(Cell, Vec<ControlPoint>),
    budget: &Budget,
) -> Result<bool, Stopped> {
    let between = subtract(&other.0.ball.centre, &own.0.ball.centre);
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for direction in std::iter::once(between).chain(axes) {
        budget.cancel.check()?;
        let length = dot(&direction, &direction).sqrt();
        if length == 0.0 {
            continue;
        }
        let (forth, back) = (direction.map(|x| x / length), direction.map(|x| -x / length));
        let end =
            |(cell, points): &(Cell, Vec<ControlPoint>), direction: &Point| support_of_cell(attractor, *cell, points, direction, budget);
        let first = [-end(own, &back)?.high, end(own, &forth)?.high];
        let second = [-end(other, &back)?.high, end(other, &forth)?.high];
        let size = (first[1] - first[0]).max(second[1] - second[0]);
        let overlap = (first[1] - second[0]).min(second[1] - first[0]);
        // What is flat across the direction, or a point, is apart by name only.
        if size > 1e3 * SEPARATION * longest_edge(&own.1).max(longest_edge(&other.1)) && overlap <= SEPARATION * size {
            return Ok(true);
        }
    }
    Ok(false)
}
