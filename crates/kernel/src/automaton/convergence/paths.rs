//! Best-first search of paths within the automaton's cycles.
//!
//! A finite set of paths such that every long enough path begins with one of them (the leaves of a tree) proves
//! the radius at most u when each has norm at most u^length: any path is cut into leaves and a rest (Gripenberg,
//! "Computing the joint spectral radius", Linear Algebra Appl. 234, 1996). The leaf with the largest
//! norm^(1/length) is extended first, so that u decreases as fast as it can, and stopping at any time leaves a
//! proven u. Closed paths met on the way give the lower bound.

use super::super::matrix::Dense;
use crate::order::ordered_by;
use std::borrow::Cow;
use std::collections::{BTreeSet, BinaryHeap};

/// The norm that a search works in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Norm {
    /// Matrices are steps in adapted coordinates, and their norms spectral.
    Spectral,
    /// Matrices are operators, and their norms half the largest 1-norm distance of two columns.
    ColumnDifference,
}

impl Norm {
    /// The norm of a computed matrix that is sought.
    pub(super) fn of(self, matrix: &Dense) -> f64 {
        match self {
            Self::Spectral => matrix.norm_bound(),
            Self::ColumnDifference => matrix.column_difference(),
        }
    }

    /// A submultiplicative norm that errors are carried in: an error e in it changes the norm by e at most.
    fn size(self, matrix: &Dense, norm: f64) -> f64 {
        match self {
            Self::Spectral => norm,
            Self::ColumnDifference => matrix.column_sum(),
        }
    }

    /// Bounds what rounding a product costs: n u |A| |B| with the norms of the absolute values, twice.
    fn rounding(self, left: &Dense, right: &Dense) -> f64 {
        match self {
            Self::Spectral => super::ellipsoid::rounding(left, right),
            Self::ColumnDifference => left.columns as f64 * f64::EPSILON * left.column_sum() * right.column_sum(),
        }
    }
}

/// A transition within a component.
pub(super) struct Step {
    pub(super) to: usize,
    pub(super) transition: usize,
    /// As computed.
    pub(super) matrix: Dense,
    /// Bounds the distance from the exact matrix.
    pub(super) error: f64,
    /// Bounds the exact matrix's norm.
    pub(super) norm: f64,
}

/// The best closed path so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Lower {
    pub(super) rate: f64,
    /// First state and indices of transitions.
    pub(super) cycle: Option<(usize, Vec<usize>)>,
    /// Cycles whose radius is known, by their least rotation.
    seen: BTreeSet<Vec<(usize, usize)>>,
}

/// What a search proved.
pub(super) struct Upper {
    pub(super) rate: f64,
    /// Length of the longest path examined.
    pub(super) depth: usize,
    /// Largest norm met by length, from length 1.
    pub(super) largest: Vec<f64>,
}

/// Longest path examined. Paths are extended while their rate is above 0.02 (see [`GAP`]), so that products stay above
/// 1e-272, far from underflow.
const MAXIMUM_DEPTH: usize = 160;
/// The search stops when the upper bound exceeds the lower by this share of what is left to 1: bounds far
/// from 1 decide, whatever their digits.
const GAP: f64 = 0.02;
/// Numbers held by the paths that wait: 64 MB.
const MAXIMUM_NUMBERS: usize = 8_000_000;
/// Transitions that paths are made of: with more, single steps decide.
const MAXIMUM_STEPS: usize = 50_000;
/// Radii of cycles closer than this are not told apart.
const SAME_RATE: f64 = 1e-9;

/// One more transition of a path. Paths share what they begin with.
#[derive(Clone, Copy)]
struct Letter {
    /// The letter before, unless this is the first.
    before: Option<u32>,
    state: u32,
    transition: u32,
}

struct Path<'a> {
    start: usize,
    end: usize,
    /// Its last letter, and how many it has.
    last: u32,
    length: usize,
    product: Cow<'a, Dense>,
    error: f64,
    /// min over prefixes of norm^(1/length).
    rate: f64,
    /// Order of creation, so that equal rates have an order.
    serial: usize,
}

ordered_by!(Path<'_>, |this, other| this.rate.total_cmp(&other.rate).then(other.serial.cmp(&this.serial)));

struct Search<'a> {
    steps: &'a [Vec<Step>],
    norm: Norm,
    lower: &'a mut Lower,
    work: f64,
    allowed: f64,
    numbers: usize,
    letters: Vec<Letter>,
    heap: BinaryHeap<Path<'a>>,
    serial: usize,
    largest: Vec<f64>,
}

/// Searches until the bounds meet, or `allowed` multiplications are done, or memory is used up.
pub(super) fn search(steps: &[Vec<Step>], norm: Norm, lower: &mut Lower, allowed: f64) -> Upper {
    let mut search = Search {
        steps,
        norm,
        lower,
        work: 0.0,
        allowed,
        numbers: 0,
        letters: Vec::new(),
        heap: BinaryHeap::new(),
        serial: 0,
        largest: Vec::new(),
    };
    let many = steps.iter().map(Vec::len).sum::<usize>() > MAXIMUM_STEPS;
    for (state, outgoing) in steps.iter().enumerate() {
        for step in outgoing.iter().filter(|step| !many || step.to == state) {
            let path = Path {
                start: state,
                end: step.to,
                last: search.spell(None, state, step),
                length: 1,
                product: Cow::Borrowed(&step.matrix),
                error: step.error,
                rate: step.norm,
                serial: 0,
            };
            search.visit(path, step.norm);
        }
    }
    if many {
        let largest = steps.iter().flatten().map(|step| step.norm).fold(0.0, f64::max);
        return Upper { rate: largest, depth: 1, largest: vec![largest] };
    }
    let rate = search.run();
    Upper { rate, depth: search.largest.len(), largest: search.largest }
}

impl<'a> Search<'a> {
    /// Extends the worst path until it is good enough, and returns its rate.
    fn run(&mut self) -> f64 {
        while let Some(path) = self.heap.pop() {
            let enough = self.lower.rate + GAP * (1.0 - self.lower.rate).abs();
            let cost: f64 = self.steps[path.end].iter().map(|step| self.cost(&path.product, &step.matrix)).sum();
            let done = path.rate <= enough || path.length >= MAXIMUM_DEPTH || !path.rate.is_finite();
            if done || self.work + cost > self.allowed || self.numbers > MAXIMUM_NUMBERS {
                return path.rate;
            }
            if let Cow::Owned(product) = &path.product {
                self.numbers -= product.entries.len();
            }
            for step in &self.steps[path.end] {
                self.extend(&path, step);
            }
        }
        // No cycle: every path ends.
        0.0
    }

    fn cost(&self, product: &Dense, step: &Dense) -> f64 {
        let (n, inner, m) = (product.rows as f64, product.columns as f64, step.columns as f64);
        let norm = match self.norm {
            Norm::Spectral => 4.5 * n.min(m).powi(2) * n.max(m),
            Norm::ColumnDifference => 0.5 * n * m * m,
        };
        n * inner * m + norm + 150.0
    }

    fn extend(&mut self, path: &Path<'a>, step: &Step) {
        self.work += self.cost(&path.product, &step.matrix);
        let product = path.product.times(&step.matrix);
        let step_size = self.norm.size(&step.matrix, step.norm) + step.error;
        let path_size = self.norm.size(&path.product, self.norm_of_size(path));
        let rounding = self.norm.rounding(&path.product, &step.matrix);
        let error = (path.error * step_size + path_size * step.error + rounding) * (1.0 + 1e-12);
        let norm = (self.norm.of(&product) + error) * (1.0 + f64::EPSILON);
        let (last, length) = (self.spell(Some(path.last), path.end, step), path.length + 1);
        // Powers are rounded by a few units in the last place.
        let rate = path.rate.min(norm.powf(1.0 / length as f64) * (1.0 + 8.0 * f64::EPSILON));
        self.numbers += product.entries.len();
        let extended = Path { start: path.start, end: step.to, last, length, product: Cow::Owned(product), error, rate, serial: 0 };
        self.visit(extended, norm);
    }

    /// The letter of a step that follows another.
    fn spell(&mut self, before: Option<u32>, state: usize, step: &Step) -> u32 {
        self.letters.push(Letter { before, state: state as u32, transition: step.transition as u32 });
        self.letters.len() as u32 - 1
    }

    /// States and transitions of a path.
    fn word(&self, path: &Path<'_>) -> Vec<(usize, usize)> {
        let letter = |at: u32| self.letters[at as usize];
        let backwards = std::iter::successors(Some(letter(path.last)), |last| last.before.map(letter));
        let mut word: Vec<_> = backwards.map(|letter| (letter.state as usize, letter.transition as usize)).collect();
        word.reverse();
        word
    }

    /// A bound of the norm of the computed product, for the errors of what follows.
    fn norm_of_size(&self, path: &Path<'_>) -> f64 {
        match self.norm {
            Norm::Spectral => path.product.frobenius() * (1.0 + 1e-12),
            Norm::ColumnDifference => 0.0,
        }
    }

    fn visit(&mut self, mut path: Path<'a>, norm: f64) {
        let length = path.length;
        if self.largest.len() < length {
            self.largest.resize(length, 0.0);
        }
        self.largest[length - 1] = self.largest[length - 1].max(norm);
        if path.start == path.end && self.norm == Norm::Spectral {
            self.close(&path, norm);
        }
        self.serial += 1;
        path.serial = self.serial;
        self.heap.push(path);
    }

    /// Raises the lower bound by the spectral radius of a closed path.
    fn close(&mut self, path: &Path<'_>, norm: f64) {
        let length = path.length;
        let floor = self.lower.rate * (1.0 + SAME_RATE);
        if norm.powf(1.0 / length as f64) <= floor || self.work > self.allowed || self.lower.seen.len() > 10_000 {
            return;
        }
        let word = self.word(path);
        if !self.lower.seen.insert(least_rotation(&word)) {
            return;
        }
        let n = path.product.rows as f64;
        self.work += 14.0 * n * n * n;
        if let Some(radius) = path.product.spectral_radius_above(floor.powi(length as i32)) {
            self.work += 26.0 * n * n * n;
            let rate = radius.powf(1.0 / length as f64);
            if rate > floor {
                self.lower.rate = rate;
                self.lower.cycle = Some((path.start, word.iter().map(|&(_, transition)| transition).collect()));
            }
        }
    }
}

/// The least rotation of a word's primitive root: the same for all ways to walk a cycle.
fn least_rotation(word: &[(usize, usize)]) -> Vec<(usize, usize)> {
    let n = word.len();
    let period = (1..=n).find(|&p| n.is_multiple_of(p) && (p..n).all(|i| word[i] == word[i - p])).unwrap_or(n);
    let rotation = |shift: usize| (0..period).map(move |i| word[(shift + i) % period]);
    let best = (0..period).min_by(|&a, &b| rotation(a).cmp(rotation(b))).unwrap_or(0);
    rotation(best).collect()
}

/// Strongly connected components: the component of every state, numbered so that transitions lead to the same or
/// a smaller number (Tarjan, "Depth-first search and linear graph algorithms", 1972), without recursion.
pub(super) fn components(successors: &[Vec<usize>]) -> Vec<usize> {
    const NONE: usize = usize::MAX;
    let n = successors.len();
    let (mut order, mut low, mut component) = (vec![NONE; n], vec![0; n], vec![NONE; n]);
    let (mut open, mut calls) = (Vec::new(), Vec::new());
    let (mut visited, mut found) = (0, 0);
    for root in 0..n {
        if order[root] != NONE {
            continue;
        }
        calls.push((root, 0));
        while let Some((state, next)) = calls.pop() {
            if next == 0 {
                (order[state], low[state]) = (visited, visited);
                visited += 1;
                open.push(state);
            }
            if let Some(&child) = successors[state].get(next) {
                calls.push((state, next + 1));
                if order[child] == NONE {
                    calls.push((child, 0));
                } else if component[child] == NONE {
                    low[state] = low[state].min(order[child]);
                }
                continue;
            }
            if low[state] == order[state] {
                while let Some(member) = open.pop() {
                    component[member] = found;
                    if member == state {
                        break;
                    }
                }
                found += 1;
            }
            if let Some(&(parent, _)) = calls.last() {
                low[parent] = low[parent].min(low[state]);
            }
        }
    }
    component
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_of_two_cycles_and_a_bridge() {
        // 0 -> 1 -> 2 -> 0, 2 -> 3, 3 <-> 4, 5 -> 0.
        let component = components(&[vec![1], vec![2], vec![0, 3], vec![4], vec![3], vec![0]]);
        assert_eq!(component, [1, 1, 1, 0, 0, 2]);
    }

    #[test]
    fn rotations_and_powers_are_one_cycle() {
        let word = |letters: &[usize]| letters.iter().map(|&letter| (0, letter)).collect::<Vec<_>>();
        assert_eq!(least_rotation(&word(&[1, 0, 0])), word(&[0, 0, 1]));
        assert_eq!(least_rotation(&word(&[1, 0, 1, 0])), word(&[0, 1]));
    }
}
