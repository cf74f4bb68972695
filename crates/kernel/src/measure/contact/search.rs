//! The search of pairs of cells, by the lower bounds of their distances.
//!
//! Pairs within the resolution are all refined, depth first, as each may be a place. Only when none of them remains, the
//! others are, by their lower bounds: the first that is not refined tells the lower end of the distance, as all others
//! are no nearer. The least upper bound of all pairs is the upper end, as every cell holds a point. A pair that is
//! farther than both the resolution and some pair's upper bound is dropped: it is no place and not the closest.
//!
//! Besides the bounds of [`super::body`], the slab along the line between the closest sites is used: the least n.y over one
//! cell less the largest n.x over the other. It knows that cells are flat or thin where balls do not.

use super::body::Gap;
use super::place::{Found, places};
use super::tree::{NodeId, Tree};
use super::{CellPair, Contact, ContactError, ContactQuery};
use crate::attractor::cell::Ball;
use crate::budget::Budget;
use crate::measure::Interval;
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

/// A pair in the queue.
struct Pair {
    low: f64,
    high: f64,
    /// The larger radius.
    size: f64,
    nodes: [NodeId; 2],
    within: bool,
}

impl PartialEq for Pair {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Pair {}
impl PartialOrd for Pair {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Pair {
    fn cmp(&self, other: &Self) -> Ordering {
        self.low.total_cmp(&other.low).then(self.size.total_cmp(&other.size)).then(self.nodes.cmp(&other.nodes))
    }
}

/// Pairs to look at, at most, and the memory that cells and pairs may take: a search is asked inside of a request.
const MOST_PAIRS: u64 = 4_000_000;
const MOST_BYTES: u64 = 512 << 20;

/// What to do with a pair.
enum Step {
    /// It is as small as it has to be.
    Keep,
    /// It cannot be refined as an address is as long as allowed.
    Stuck,
    /// Refine the first, or the second.
    Split(usize),
}

struct Search<'a> {
    trees: [Tree<'a>; 2],
    resolution_mm: f64,
    slack: f64,
    /// Pairs within the resolution, the next one last.
    near: Vec<Pair>,
    /// The others.
    queue: BinaryHeap<Reverse<Pair>>,
    looked: u64,
    /// The least upper bound of a pair's distance, and the pair.
    nearest: Found,
}

/// The places and the distance of two trees.
pub(super) fn search(first: Tree<'_>, second: Tree<'_>, query: &ContactQuery, budget: &Budget) -> Result<Contact, ContactError> {
    if query.most == 0 {
        return Err(ContactError::Query { name: "most", value: 0.0, expected: "one pair of cells or more" });
    }
    let nodes = [first.some_cell(0), second.some_cell(0)];
    let mut search = Search {
        slack: first.slack + second.slack,
        trees: [first, second],
        resolution_mm: query.resolution.mm(),
        near: Vec::new(),
        queue: BinaryHeap::new(),
        looked: 0,
        nearest: Found { nodes, distance_mm: Interval { low: 0.0, high: f64::INFINITY } },
    };
    // Before the groups of roots: so there is an upper bound, whatever ends the search.
    search.look(nodes, 0.0);
    search.near.clear();
    search.queue.clear();
    search.look([0, 0], 0.0);
    let mut found = Vec::new();
    let (low, complete) = search.run(query, budget, &mut found)?;
    let distance_mm = Interval { low: low.min(search.nearest.distance_mm.high), high: search.nearest.distance_mm.high };
    let mut places = places(&search.trees, &found, search.resolution_mm, search.slack, budget, |pair| search.described(pair))?;
    if let (true, [only]) = (complete, places.as_mut_slice()) {
        // The closest points are nowhere else, even if what proves their distance is a larger pair.
        only.distance_mm.high = only.distance_mm.high.min(distance_mm.high);
    }
    Ok(Contact { distance_mm, nearest: search.described(&search.nearest), places, complete })
}

impl Search<'_> {
    /// Finds the pairs that remain. The lower end of the distance, and whether all were found.
    fn run(&mut self, query: &ContactQuery, budget: &Budget, found: &mut Vec<Found>) -> Result<(f64, bool), ContactError> {
        let most_pairs = budget.limits.cells.min(MOST_PAIRS);
        let most_bytes = budget.limits.memory_bytes.min(MOST_BYTES);
        let (mut lower, mut complete) = (None, true);
        while let Some(pair) = self.near.pop().or_else(|| self.queue.pop().map(|entry| entry.0)) {
            if lower.is_some() && pair.low > self.resolution_mm {
                break;
            }
            let bytes =
                self.trees[0].bytes + self.trees[1].bytes + ((self.near.len() + self.queue.len()) * std::mem::size_of::<Pair>()) as u64;
            if self.looked > most_pairs || bytes > most_bytes {
                return Ok((self.least(lower, &pair), false));
            }
            budget.cancel.check()?;
            let step = self.step(&pair);
            if let Step::Split(side) = step {
                for child in self.trees[side].children(pair.nodes[side]).rev() {
                    let mut nodes = pair.nodes;
                    nodes[side] = child;
                    self.look(nodes, pair.low);
                }
                continue;
            }
            complete &= matches!(step, Step::Keep);
            if pair.low <= self.resolution_mm {
                if found.len() == query.most {
                    return Ok((self.least(lower, &pair), false));
                }
                found.push(Found { nodes: pair.nodes, distance_mm: Interval { low: pair.low, high: pair.high } });
            }
            lower = Some(lower.map_or(pair.low, |low: f64| low.min(pair.low)));
        }
        // A pair that holds the closest points is never dropped, so one was kept.
        Ok((lower.unwrap_or(0.0), complete && lower.is_some()))
    }

    /// The lower end of the distance when the search ends at a pair: the others in the queue are no nearer than one of
    /// those within the resolution, or than it.
    fn least(&self, lower: Option<f64>, pair: &Pair) -> f64 {
        self.near.iter().map(|pair| pair.low).fold(lower.unwrap_or(f64::INFINITY).min(pair.low), f64::min)
    }

    /// Where the two may be a place, both cells are refined until their radii are as small as the resolution; elsewhere
    /// it is enough that their sites are as near to them.
    fn step(&self, pair: &Pair) -> Step {
        if pair.within && !self.nodes(pair).iter().any(|&(tree, id)| tree.node(id).is_group()) {
            return Step::Keep;
        }
        let far = pair.low > self.resolution_mm;
        let size = |side: usize| {
            let (tree, id) = self.nodes(pair)[side];
            let body = &tree.node(id).body;
            let size = if far { body.error.min(body.ball.radius) } else { body.ball.radius };
            (tree.node(id).is_group() || (tree.subdivides(id) && size > self.resolution_mm)).then_some(body.ball.radius)
        };
        let splittable = |side: usize| size(side).filter(|_| self.trees[side].is_splittable(pair.nodes[side]));
        match (splittable(0), splittable(1)) {
            (Some(first), Some(second)) => Step::Split(usize::from(second > first)),
            (Some(_), None) => Step::Split(0),
            (None, Some(_)) => Step::Split(1),
            (None, None) if size(0).or(size(1)).is_some() => Step::Stuck,
            (None, None) => Step::Keep,
        }
    }

    fn nodes(&self, pair: &Pair) -> [(&Tree<'_>, NodeId); 2] {
        [(&self.trees[0], pair.nodes[0]), (&self.trees[1], pair.nodes[1])]
    }

    /// Bounds a pair's distance, no lower than `least`, and puts it into the queue if it matters.
    fn look(&mut self, nodes: [NodeId; 2], least: f64) {
        self.looked += 1;
        let [a, b] = [self.trees[0].node(nodes[0]), self.trees[1].node(nodes[1])];
        let Gap { mut low, high, direction, within } = a.body.gap(&b.body, self.slack);
        if !a.is_group() && !b.is_group() && high < self.nearest.distance_mm.high {
            self.nearest = Found { nodes, distance_mm: Interval { low: low.max(least).min(high), high } };
        }
        let farthest = self.resolution_mm.max(self.nearest.distance_mm.high);
        if let Some(direction) = direction.filter(|_| high > 0.0 && low <= farthest) {
            let slab = -self.trees[1].reach(nodes[1], &direction.map(|x| -x)) - self.trees[0].reach(nodes[0], &direction);
            low = low.max(slab - self.slack);
        }
        low = low.max(least).min(high);
        if low <= farthest {
            let size = a.body.ball.radius.max(b.body.ball.radius);
            let pair = Pair { low, high, size, nodes, within };
            if low <= self.resolution_mm { self.near.push(pair) } else { self.queue.push(Reverse(pair)) }
        }
    }

    fn described(&self, pair: &Found) -> CellPair {
        let ball = |side: usize| {
            let ball = self.trees[side].node(pair.nodes[side]).body.ball;
            Ball { radius: ball.radius + self.slack, ..ball }
        };
        CellPair {
            first: self.trees[0].address(pair.nodes[0]).unwrap_or_default(),
            second: self.trees[1].address(pair.nodes[1]),
            first_cell: ball(0),
            second_cell: ball(1),
            distance_mm: pair.distance_mm,
        }
    }
}
