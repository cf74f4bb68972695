//! The addresses near a point, and the distance of a shape: cells by the lower bounds of their distances.

use super::Attractor;
use super::address::{Address, AddressError, point_at, rounding};
use super::cell::{Ball, Cell, ControlPoint, Point, child_points, distance_squared};
use crate::automaton::{LeafPrimitive, StateId};
use crate::budget::Budget;
use crate::order::ordered_by;
use crate::tolerance::Tolerance;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// What is sought near a point.
#[derive(Clone, Debug, PartialEq)]
pub struct NearQuery {
    /// The point, in mm.
    pub point: Point,
    /// Cells as far as this from it are listed; those that may hold the closest point when absent.
    pub within_mm: Option<f64>,
    /// Cells are refined until their balls have this radius.
    pub resolution: Tolerance,
    /// Cells to list at most.
    pub most: usize,
}

/// A cell near the point.
#[derive(Clone, Debug, PartialEq)]
pub struct Nearby {
    /// Its address.
    pub address: Address,
    /// Its kind.
    pub state: StateId,
    /// The distance of the point from the cell lies in this interval, in mm.
    pub distance_mm: [f64; 2],
    /// A ball that contains the cell.
    pub cell: Ball,
}

/// A point of the shape close to the one that was asked.
#[derive(Clone, Debug, PartialEq)]
pub struct Nearest {
    /// Its address; that of its cell when the cell is a simplex.
    pub address: Address,
    /// Where it is, in mm.
    pub point: Point,
    /// The exact point is no farther from there than this, in mm.
    pub bound_mm: f64,
    /// The distance of the point that was asked from the shape lies in this interval, in mm.
    pub distance_mm: [f64; 2],
}

/// The answer to a [`NearQuery`].
#[derive(Clone, Debug, PartialEq)]
pub struct Neighbourhood {
    /// A point of the shape that is closest up to the resolution.
    pub nearest: Nearest,
    /// The cells, by the lower ends of their distances; cells at the same one in the order of their discovery.
    pub cells: Vec<Nearby>,
    /// Whether all cells that may be near are listed; else there were more than asked for.
    pub complete: bool,
}

/// A cell in the queue.
struct Candidate {
    lower: f64,
    upper: f64,
    /// Order of discovery, and index of its word.
    number: usize,
    depth: u32,
    cell: Cell,
    points: Vec<ControlPoint>,
}

ordered_by!(Candidate, |this, other| this.lower.total_cmp(&other.lower).then(this.number.cmp(&other.number)));

/// Cells to look at, at most, and the memory that they may take: a search is asked inside of a request.
const MOST_CELLS: u64 = 2_000_000;
const MOST_BYTES: u64 = 512 << 20;

struct Search<'a> {
    attractor: &'a Attractor,
    query: &'a NearQuery,
    budget: &'a Budget,
    queue: BinaryHeap<Reverse<Candidate>>,
    /// The cell before, and the letter from it, of every cell looked at.
    words: Vec<(usize, usize)>,
    bytes: u64,
    slack: f64,
    /// The shape is no farther than this.
    upper: f64,
    leaves: Vec<Candidate>,
}

/// The cells near a point, best first, and the closest point of the shape up to the resolution.
///
/// The lower end of the shape's distance is that of the first small cell to leave the queue, as all others are no
/// nearer; the upper end is the least upper end of all cells seen, as every cell holds a point of the shape.
///
/// Cost: proportional to the cells that are looked at, those whose balls are as near as the answer's.
///
/// # Errors
/// [`AddressError`] for a query with numbers that are not usable, or when a limit is hit.
pub fn addresses_near(attractor: &Attractor, query: &NearQuery, budget: &Budget) -> Result<Neighbourhood, AddressError> {
    if let Some(&value) = query.point.iter().find(|value| !(-1e150..=1e150).contains(*value)) {
        return Err(AddressError::Query { name: "a coordinate of the point", value, expected: "a finite number of mm, below 1e150" });
    }
    if let Some(value) = query.within_mm.filter(|value| !(0.0..=1e150).contains(value)) {
        return Err(AddressError::Query { name: "within_mm", value, expected: "a length of 0 mm or more" });
    }
    if query.most == 0 {
        return Err(AddressError::Query { name: "most", value: 0.0, expected: "one cell or more" });
    }
    if !attractor.trimmed().is_empty() {
        return Err(AddressError::Trimmed);
    }
    let mut search = Search::new(attractor, query, budget);
    let (lower, complete) = search.run()?;
    let leaves = std::mem::take(&mut search.leaves);
    let nearest = search.nearest(&leaves, lower)?;
    let farthest = query.within_mm.unwrap_or(search.upper);
    let cells = leaves.iter().filter(|leaf| leaf.lower <= farthest).map(|leaf| search.described(leaf)).collect();
    Ok(Neighbourhood { nearest, cells, complete })
}

impl<'a> Search<'a> {
    fn new(attractor: &'a Attractor, query: &'a NearQuery, budget: &'a Budget) -> Self {
        let size = query.point.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let slack = (0..attractor.roots().len()).map(|root| rounding(&attractor.root_cell(root).ball)).fold(1e-12 * size, f64::max);
        Self {
            attractor,
            query,
            budget,
            queue: BinaryHeap::new(),
            words: Vec::new(),
            bytes: 0,
            slack,
            upper: f64::INFINITY,
            leaves: Vec::new(),
        }
    }

    /// Finds the leaves. The lower end of the shape's distance, and whether all leaves were found.
    fn run(&mut self) -> Result<(f64, bool), AddressError> {
        for (index, root) in self.attractor.roots().iter().enumerate() {
            self.look(self.attractor.root_cell(index), root.points.clone(), 0, (usize::MAX, index));
        }
        let mut lower = None;
        while let Some(Reverse(candidate)) = self.queue.pop() {
            let farthest = self.query.within_mm.unwrap_or(self.upper);
            if lower.is_some() && candidate.lower > farthest {
                break;
            }
            if self.is_leaf(&candidate) {
                let first = *lower.get_or_insert(candidate.lower);
                if self.leaves.len() == self.query.most {
                    return Ok((first, false));
                }
                // The first leaf is kept wherever it is: it tells how far the shape is.
                self.leaves.push(candidate);
                continue;
            }
            self.expand(candidate)?;
        }
        Ok((lower.unwrap_or(0.0), true))
    }

    fn is_leaf(&self, candidate: &Candidate) -> bool {
        candidate.cell.ball.radius <= self.query.resolution.mm() || self.simplex(&candidate.cell)
    }

    fn simplex(&self, cell: &Cell) -> bool {
        self.attractor.state_of(cell).leaf == LeafPrimitive::Simplex
    }

    fn expand(&mut self, parent: Candidate) -> Result<(), AddressError> {
        let (resolution_mm, allowed) = (self.query.resolution.mm(), self.budget.limits.depth);
        if parent.depth >= allowed {
            return Err(AddressError::Depth { allowed, resolution_mm, reached_mm: parent.cell.ball.radius });
        }
        let most = self.budget.limits.cells.min(MOST_CELLS);
        if self.words.len() as u64 > most || self.bytes > self.budget.limits.memory_bytes.min(MOST_BYTES) {
            return Err(self.too_many(&parent));
        }
        self.budget.cancel.check()?;
        let attractor = self.attractor;
        for (index, transition) in attractor.state_of(&parent.cell).transitions.iter().enumerate() {
            let mut points = vec![[0.0; 4]; transition.operator.columns()];
            child_points(&parent.points, &transition.operator, &mut points);
            let cell = attractor.child_cell(&parent.cell, index, &points);
            self.look(cell, points, parent.depth + 1, (parent.number, transition.label));
        }
        Ok(())
    }

    /// With a resolution of the largest cell that still waits near enough, only cells that were opened already would
    /// be opened again: such a search passes.
    fn too_many(&self, parent: &Candidate) -> AddressError {
        let farthest = self.query.within_mm.unwrap_or(self.upper);
        let waiting = self.queue.iter().filter(|entry| entry.0.lower <= farthest.max(parent.lower)).map(|entry| entry.0.cell.ball.radius);
        let reachable_mm = waiting.fold(parent.cell.ball.radius, f64::max);
        AddressError::Cells { allowed: self.words.len() as u64, resolution_mm: self.query.resolution.mm(), reachable_mm }
    }

    /// Bounds a cell's distance and puts it into the queue.
    fn look(&mut self, cell: Cell, points: Vec<ControlPoint>, depth: u32, word: (usize, usize)) {
        let number = self.words.len();
        self.words.push(word);
        self.bytes += (std::mem::size_of::<Candidate>() + std::mem::size_of_val(points.as_slice())) as u64;
        let (lower, upper) = if self.simplex(&cell) {
            let distance = distance_squared(&self.closest(&cell, &points), &self.query.point).sqrt();
            ((distance - self.slack).max(0.0), distance + self.slack)
        } else {
            let distance = distance_squared(&cell.ball.centre, &self.query.point).sqrt();
            let reach = cell.ball.radius + self.slack;
            ((distance - reach).max(0.0), distance + reach)
        };
        self.upper = self.upper.min(upper);
        self.queue.push(Reverse(Candidate { lower, upper, number, depth, cell, points }));
    }

    /// The closest point of a simplex.
    fn closest(&self, cell: &Cell, points: &[ControlPoint]) -> Point {
        let mut closest = cell.ball.centre;
        self.attractor.emit(cell, points, &mut |site| closest = site.closest(&self.query.point));
        closest
    }

    fn address(&self, leaf: &Candidate) -> Address {
        let mut prefix = Vec::new();
        let mut current = leaf.number;
        loop {
            let (before, letter) = self.words[current];
            if before == usize::MAX {
                prefix.reverse();
                return Address { root: letter, prefix, period: Vec::new() };
            }
            prefix.push(letter);
            current = before;
        }
    }

    fn described(&self, leaf: &Candidate) -> Nearby {
        let cell = Ball { radius: leaf.cell.ball.radius + self.slack, ..leaf.cell.ball };
        Nearby { address: self.address(leaf), state: leaf.cell.state, distance_mm: [leaf.lower, leaf.upper], cell }
    }

    /// The point of the leaf that is surely close: of a simplex its closest, of others the anchor.
    fn nearest(&mut self, leaves: &[Candidate], lower: f64) -> Result<Nearest, AddressError> {
        let best = leaves.iter().min_by(|a, b| a.upper.total_cmp(&b.upper)).expect("the first leaf is always kept");
        let address = self.address(best);
        let (address, point, bound_mm) = if self.simplex(&best.cell) {
            (address, self.closest(&best.cell, &best.points), self.slack)
        } else {
            let location = point_at(self.attractor, &address, self.budget)?;
            (location.address, location.point, location.bound_mm)
        };
        let reached = distance_squared(&point, &self.query.point).sqrt() + bound_mm + self.slack;
        self.upper = self.upper.min(reached);
        Ok(Nearest { address, point, bound_mm, distance_mm: [lower.min(self.upper), self.upper] })
    }
}
