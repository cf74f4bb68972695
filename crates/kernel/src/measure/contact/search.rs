//! The search of pairs of cells, by the lower bounds of their distances.
//!
//! Pairs within the resolution are all refined, depth first, as each may be a place. Only when none of them remains, the
//! others are, by their lower bounds: the first that is not refined tells the lower end of the distance, as all others
//! are no nearer. The least upper bound of all pairs is the upper end, as every cell holds a point. A pair that is
//! farther than both the resolution and some pair's upper bound is dropped: it is no place and not the closest.
//!
//! Besides the bounds of [`super::body`], the slab along the line between the closest sites is used: the least n.y over one
//! cell less the largest n.x over the other. It knows that cells are flat or thin where balls do not.
//!
//! A shape against itself is one tree, and begins with the pair of the whole with itself. The pair of a node with itself
//! stands for the pairs of different pieces below it, and is refined into those of its children; see `pieces` for which pairs
//! of pieces are left out. Pairs of cells above the pieces may hold such that are, so they are no upper bounds where a shape
//! declares boundaries.

use super::body::Gap;
use super::pieces::{Pieces, Relation};
use super::place::{Found, places};
use super::tree::{NodeId, Tree};
use super::{CellPair, Contact, ContactError, ContactQuery};
use crate::attractor::cell::{Ball, Point};
use crate::budget::Budget;
use crate::measure::Interval;
use crate::order::ordered_by;
use std::cmp::Reverse;
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

ordered_by!(Pair, |this, other| this.low.total_cmp(&other.low).then(this.size.total_cmp(&other.size)).then(this.nodes.cmp(&other.nodes)));

/// Pairs to look at, at most, and the memory that cells and pairs may take: a search is asked inside of a request.
const MOST_PAIRS: u64 = 4_000_000;
const MOST_BYTES: u64 = 512 << 20;

/// Pairs beyond the resolution to look at, at most, where pieces may be joined: most of those that are nearer than the nearest
/// are, and are found to be one by one.
const MOST_FAR: u64 = 20_000;

/// Pairs that are looked at between two reports.
const PAIRS_PER_REPORT: u64 = 1 << 14;

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
    /// The tree of the first cells and that of the second, or one of both.
    trees: Vec<Tree<'a>>,
    /// What a shape is cut into that is held against itself.
    pieces: Option<Pieces>,
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
    let mut search = Search::new(vec![first, second], query)?;
    // Before the groups of roots: so there is an upper bound, whatever ends the search.
    search.look(search.nearest.nodes, 0.0);
    search.near.clear();
    search.queue.clear();
    search.contact(query, budget)
}

/// The places and the distance of different pieces of one tree that nothing joins nearby.
pub(super) fn search_self(mut tree: Tree<'_>, query: &ContactQuery, budget: &Budget) -> Result<Contact, ContactError> {
    let pieces = Pieces::new(&mut tree, query.resolution.mm(), most_pairs(budget), most_bytes(budget), budget)?;
    let mut search = Search::new(vec![tree], query)?;
    // Some pieces that nothing joins, so that there is an upper bound.
    let (first, others) = pieces.some_against_all();
    search.pieces = Some(pieces);
    for other in others {
        budget.cancel.check()?;
        search.look([first, other], 0.0);
    }
    search.near.clear();
    search.queue.clear();
    search.looked = 0;
    search.contact(query, budget)
}

fn most_pairs(budget: &Budget) -> u64 {
    budget.limits.cells.min(MOST_PAIRS)
}

fn most_bytes(budget: &Budget) -> u64 {
    budget.limits.memory_bytes.min(MOST_BYTES)
}

impl<'a> Search<'a> {
    fn new(trees: Vec<Tree<'a>>, query: &ContactQuery) -> Result<Self, ContactError> {
        if query.most == 0 {
            return Err(ContactError::Query { name: "most", value: 0.0, expected: "one pair of cells or more" });
        }
        let mut search = Self {
            slack: 0.0,
            trees,
            pieces: None,
            resolution_mm: query.resolution.mm(),
            near: Vec::new(),
            queue: BinaryHeap::new(),
            looked: 0,
            nearest: Found { nodes: [0; 2], distance_mm: Interval { low: 0.0, high: f64::INFINITY } },
        };
        search.slack = search.tree(0).slack + search.tree(1).slack;
        search.nearest.nodes = [0, 1].map(|side| search.tree(side).some_cell(0));
        Ok(search)
    }

    /// The tree of the first or of the second cells.
    fn tree(&self, side: usize) -> &Tree<'a> {
        &self.trees[side.min(self.trees.len() - 1)]
    }

    fn contact(mut self, query: &ContactQuery, budget: &Budget) -> Result<Contact, ContactError> {
        self.look([0, 0], 0.0);
        let mut found = Vec::new();
        let (low, complete) = self.run(query, budget, &mut found)?;
        let complete = complete && self.pieces.as_ref().is_none_or(Pieces::complete);
        let high = self.nearest.distance_mm.high;
        if high == f64::INFINITY {
            let resolution_mm = self.resolution_mm;
            return Err(if complete && self.queue.is_empty() {
                ContactError::Whole { resolution_mm }
            } else {
                ContactError::Unsettled { resolution_mm }
            });
        }
        let distance_mm = Interval { low: low.min(high), high };
        budget.prove(distance_mm.width());
        budget.report("intersect", 1.0, self.looked);
        let trees = [self.tree(0), self.tree(1)];
        let mut places = places(trees, &found, self.resolution_mm, self.slack, budget, |pair| self.described(pair))?;
        if let (true, [only]) = (complete, places.as_mut_slice()) {
            // The closest points are nowhere else, even if what proves their distance is a larger pair.
            only.distance_mm.high = only.distance_mm.high.min(distance_mm.high);
        }
        Ok(Contact { distance_mm, nearest: self.described(&self.nearest), places, pairs_looked_at: self.looked, complete })
    }

    /// Finds the pairs that remain. The lower end of the distance, and whether all were found.
    fn run(&mut self, query: &ContactQuery, budget: &Budget, found: &mut Vec<Found>) -> Result<(f64, bool), ContactError> {
        let (most_pairs, most_bytes) = (most_pairs(budget), most_bytes(budget));
        let (mut lower, mut complete, mut far, mut told) = (None, true, None, 0);
        while let Some(pair) = self.near.pop().or_else(|| self.queue.pop().map(|entry| entry.0)) {
            if lower.is_some() && pair.low > self.resolution_mm {
                break;
            }
            let pairs = ((self.near.len() + self.queue.len()) * std::mem::size_of::<Pair>()) as u64;
            let bytes = self.trees.iter().map(|tree| tree.bytes).sum::<u64>() + pairs;
            if self.looked > most_pairs || bytes > most_bytes {
                return Ok((self.least(lower, &pair), false));
            }
            if pair.low > self.resolution_mm && self.pieces.as_ref().is_some_and(Pieces::may_be_joined) {
                let since = *far.get_or_insert(self.looked);
                if self.looked > since + MOST_FAR {
                    let low = pair.low;
                    self.queue.push(Reverse(pair));
                    return Ok((low, complete));
                }
            }
            budget.cancel.check()?;
            self.tell(lower, &pair, &mut told, budget);
            if self.pieces.is_some() && pair.nodes[0] == pair.nodes[1] {
                let children = self.trees[0].children(pair.nodes[0]);
                for first in children.clone().rev() {
                    (first..children.end).rev().for_each(|second| self.look([first, second], 0.0));
                }
                continue;
            }
            let step = self.step(&pair);
            if let Step::Split(side) = step {
                let tree = side.min(self.trees.len() - 1);
                for child in self.trees[tree].children(pair.nodes[side]).rev() {
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
        // A pair that holds the closest points is never dropped, so one was kept, if there are any.
        Ok((lower.unwrap_or(0.0), complete))
    }

    /// Tells how far the search is, now and then: pairs that were looked at, and how narrow the distance is already.
    fn tell(&self, lower: Option<f64>, pair: &Pair, told: &mut u64, budget: &Budget) {
        if self.looked < *told {
            return;
        }
        *told = self.looked + PAIRS_PER_REPORT;
        budget.prove(self.nearest.distance_mm.high - self.least(lower, pair).min(self.nearest.distance_mm.high));
        budget.report("intersect", 0.0, self.looked);
    }

    /// The lower end of the distance when the search ends at a pair: the others in the queue are no nearer than one of
    /// those within the resolution, or than it.
    fn least(&self, lower: Option<f64>, pair: &Pair) -> f64 {
        self.near.iter().map(|pair| pair.low).fold(lower.unwrap_or(f64::INFINITY).min(pair.low), f64::min)
    }

    /// Where the two may be a place, both cells are refined until their radii are as small as the resolution; elsewhere
    /// it is enough that their sites are as near to them, of cells of which no pieces may be joined.
    fn step(&self, pair: &Pair) -> Step {
        if pair.within && !self.nodes(pair).iter().any(|&(tree, id)| tree.node(id).is_group()) {
            return Step::Keep;
        }
        let far = pair.low > self.resolution_mm && self.pieces.as_ref().is_none_or(|pieces| pieces.are_all_apart(pair.nodes));
        let size = |side: usize| {
            let (tree, id) = self.nodes(pair)[side];
            let body = &tree.node(id).body;
            let size = if far { body.error.min(body.ball.radius) } else { body.ball.radius };
            (tree.node(id).is_group() || (tree.subdivides(id) && size > self.resolution_mm)).then_some(body.ball.radius)
        };
        let splittable = |side: usize| size(side).filter(|_| self.tree(side).is_splittable(pair.nodes[side]));
        match (splittable(0), splittable(1)) {
            (Some(first), Some(second)) => Step::Split(usize::from(second > first)),
            (Some(_), None) => Step::Split(0),
            (None, Some(_)) => Step::Split(1),
            (None, None) if size(0).or(size(1)).is_some() => Step::Stuck,
            (None, None) => Step::Keep,
        }
    }

    fn nodes(&self, pair: &Pair) -> [(&Tree<'a>, NodeId); 2] {
        [0, 1].map(|side| (self.tree(side), pair.nodes[side]))
    }

    /// Bounds a pair's distance, no lower than `least`, and puts it into the queue if it matters.
    fn look(&mut self, nodes: [NodeId; 2], least: f64) {
        self.looked += 1;
        if self.pieces.is_some() && nodes[0] == nodes[1] {
            self.look_into(nodes[0]);
            return;
        }
        let [a, b] = [self.tree(0).node(nodes[0]), self.tree(1).node(nodes[1])];
        let Gap { mut low, mut high, direction, within } = a.body.gap(&b.body, self.slack);
        let size = a.body.ball.radius.max(b.body.ball.radius);
        let mut bounds = !a.is_group() && !b.is_group();
        if let Some(pieces) = &mut self.pieces {
            if low.max(least) > self.resolution_mm.max(self.nearest.distance_mm.high) {
                return;
            }
            bounds &= pieces.are_all_apart(nodes);
            match pieces.relation(&self.trees[0], nodes, low, high) {
                Relation::Joined => return,
                Relation::Crossing => (low, high) = (0.0, 0.0),
                Relation::Apart => {}
            }
        }
        if bounds && high < self.nearest.distance_mm.high {
            self.nearest = Found { nodes, distance_mm: Interval { low: low.max(least).min(high), high } };
        }
        let farthest = self.resolution_mm.max(self.nearest.distance_mm.high);
        if let Some(direction) = direction.filter(|_| high > 0.0 && low <= farthest) {
            let slab = -self.tree(1).reach(nodes[1], &direction.map(|x| -x)) - self.tree(0).reach(nodes[0], &direction);
            low = low.max(slab - self.slack);
        }
        low = low.max(least).min(high);
        if low <= farthest {
            let pair = Pair { low, high, size, nodes, within };
            if low <= self.resolution_mm { self.near.push(pair) } else { self.queue.push(Reverse(pair)) }
        }
    }

    /// Puts the pair of a node with itself into the queue, if it is more than one piece.
    fn look_into(&mut self, node: NodeId) {
        if self.pieces.as_ref().is_some_and(|pieces| pieces.is_above(node)) {
            let size = self.trees[0].node(node).body.ball.radius;
            self.near.push(Pair { low: 0.0, high: f64::INFINITY, size, nodes: [node; 2], within: false });
        }
    }

    fn described(&self, pair: &Found) -> CellPair {
        let ball = |side: usize| {
            let ball = self.tree(side).node(pair.nodes[side]).body.ball;
            Ball { radius: ball.radius + self.slack, ..ball }
        };
        let (points, off_mm) = self.witnesses(pair);
        CellPair {
            first: self.tree(0).address(pair.nodes[0]).unwrap_or_default(),
            second: self.tree(1).address(pair.nodes[1]),
            first_cell: ball(0),
            second_cell: ball(1),
            points,
            off_mm,
            distance_mm: pair.distance_mm,
        }
    }

    /// A point of each of two cells, and how far each may be off.
    fn witnesses(&self, pair: &Found) -> ([Point; 2], [f64; 2]) {
        let bodies = [0, 1].map(|side| &self.tree(side).node(pair.nodes[side]).body);
        let (x, y) = bodies[0].closest(bodies[1]);
        let located = [0, 1].map(|side| if bodies[side].is_its_sites() { None } else { self.tree(side).some_point(pair.nodes[side]) });
        // Where no point is found of a cell whose sites are only near to it, one of them is told with how near.
        let off = |side: usize| located[side].map_or(bodies[side].error + self.slack, |(_, off)| off);
        let points = match located.map(|found| found.map(|(point, _)| point)) {
            [Some(first), Some(second)] => [first, second],
            [Some(first), None] => [first, bodies[1].nearest(&first)],
            [None, Some(second)] => [bodies[0].nearest(&second), second],
            [None, None] if bodies[0].is_its_sites() => [x, bodies[1].nearest(&x)],
            [None, None] => [x, y],
        };
        (points, [off(0), off(1)])
    }
}
