//! Places: pairs of cells gathered where their boxes touch.

use super::body::{least, most};
use super::tree::{NodeId, Tree};
use super::{CellPair, Place};
use crate::attractor::cell::Point;
use crate::budget::{Budget, Stopped};
use crate::groups::Groups;
use crate::measure::Interval;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// A pair that was found.
#[derive(Clone, Copy)]
pub(super) struct Found {
    pub(super) nodes: [NodeId; 2],
    pub(super) distance_mm: Interval,
}

/// Pairs that are of one place, as far as is known.
struct Gathered {
    low: Point,
    high: Point,
    /// The pair of the least upper end, and among these of the least lower.
    pair: Found,
    pairs: usize,
    distance_mm: Interval,
}

impl Gathered {
    fn join(&mut self, other: &Self) {
        (self.low, self.high) = (least(&self.low, &other.low), most(&self.high, &other.high));
        let (mine, its) = (self.pair.distance_mm, other.pair.distance_mm);
        if its.high.total_cmp(&mine.high).then(its.low.total_cmp(&mine.low)).is_lt() {
            self.pair = other.pair;
        }
        self.pairs += other.pairs;
        let (mine, its) = (self.distance_mm, other.distance_mm);
        self.distance_mm = Interval { low: mine.low.min(its.low), high: mine.high.min(its.high) };
    }

    /// Whether the boxes are within a length of each other along every axis.
    fn is_near(&self, other: &Self, length: f64) -> bool {
        (0..3).all(|axis| self.low[axis] <= other.high[axis] + length && other.low[axis] <= self.high[axis] + length)
    }
}

/// The pairs as places: those whose boxes are within the resolution of each other along every axis are of one place, and
/// those of one first cell that is no larger than the resolution.
///
/// The box of a pair is that of its first cell, cut by that of its second grown by the resolution: a point of the first
/// cell that is within the resolution of the second lies in both. A pair without such points is no place.
///
/// Cost: the pairs by their logarithm, and those that overlap along the axis on which boxes are spread most.
///
/// # Errors
/// [`Stopped`] when the budget's token was fired.
pub(super) fn places(
    trees: [&Tree<'_>; 2],
    found: &[Found],
    resolution_mm: f64,
    slack: f64,
    budget: &Budget,
    described: impl Fn(&Found) -> CellPair,
) -> Result<Vec<Place>, Stopped> {
    let mut sorted = found.to_vec();
    sorted.sort_unstable_by_key(|pair| pair.nodes);
    let mut boxed: Vec<Gathered> = Vec::new();
    for pair in sorted {
        let [mine, its] = [&trees[0].node(pair.nodes[0]).body, &trees[1].node(pair.nodes[1]).body];
        let near = resolution_mm + 2.0 * slack;
        let low = most(&mine.low.map(|x| x - slack), &its.low.map(|x| x - near));
        let high = least(&mine.high.map(|x| x + slack), &its.high.map(|x| x + near));
        if (0..3).any(|axis| low[axis] > high[axis]) {
            continue;
        }
        let one = Gathered { low, high, pair, pairs: 1, distance_mm: pair.distance_mm };
        match boxed.last_mut() {
            Some(last) if last.pair.nodes[0] == pair.nodes[0] && mine.ball.radius <= resolution_mm => last.join(&one),
            _ => boxed.push(one),
        }
    }
    let spread = |axis: usize| {
        let ends = boxed.iter().map(|one| one.low[axis]);
        ends.clone().fold(f64::NEG_INFINITY, f64::max) - ends.fold(f64::INFINITY, f64::min)
    };
    let axis = (0..3).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(0);
    boxed.sort_by(|a, b| a.low[axis].total_cmp(&b.low[axis]));
    let mut groups = Groups::new(boxed.len());
    let mut open: Vec<usize> = Vec::new();
    for (index, one) in boxed.iter().enumerate() {
        budget.cancel.check()?;
        open.retain(|&other| boxed[other].high[axis] + resolution_mm >= one.low[axis]);
        for &other in open.iter().filter(|&&other| one.is_near(&boxed[other], resolution_mm)) {
            groups.join(index, other);
        }
        open.push(index);
    }
    // A group is called by its first member, so the places come in order.
    let mut gathered: BTreeMap<u32, Gathered> = BTreeMap::new();
    for (group, one) in groups.all().into_iter().zip(boxed) {
        match gathered.entry(group) {
            Entry::Occupied(mut place) => place.get_mut().join(&one),
            Entry::Vacant(place) => {
                place.insert(one);
            }
        }
    }
    let place = |place: Gathered| Place {
        low: place.low,
        high: place.high,
        pair: described(&place.pair),
        pairs: place.pairs,
        distance_mm: place.distance_mm,
    };
    Ok(gathered.into_values().map(place).collect())
}
