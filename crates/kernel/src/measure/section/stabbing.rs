//! Which of many intervals contain a number: an interval tree (Edelsbrunner, "Dynamic data structures for orthogonal intersection
//! queries", 1980) over whole numbers, whose nodes are the numbers themselves.

use rayon::prelude::*;
use std::cmp::Reverse;

/// An interval of whole numbers, both ends included, and whose it is. Invariant: 1 <= low <= high.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    pub(super) low: u32,
    pub(super) high: u32,
    pub(super) item: u32,
}

impl Span {
    /// The node that holds the interval: its only number with the most trailing zeros.
    fn node(&self) -> u32 {
        self.high & (u32::MAX << ((self.low - 1) ^ self.high).ilog2())
    }
}

/// Intervals at the nodes of a search tree: m has the numbers below it that differ from it only in bits from its lowest one down.
pub(super) struct Stabbing {
    /// Where each node's intervals start in the lists.
    starts: Vec<u32>,
    /// (low, item), ascending within each node.
    lows: Vec<(u32, u32)>,
    /// (high, item), descending within each node.
    highs: Vec<(u32, u32)>,
}

impl Stabbing {
    /// Intervals among 1..=most. Cost: n log n, 16 bytes an interval.
    pub(super) fn new(mut spans: Vec<Span>, most: u32) -> Self {
        let mut starts = vec![0; most as usize + 2];
        spans.iter().for_each(|span| starts[span.node() as usize + 1] += 1);
        for node in 1..starts.len() {
            starts[node] += starts[node - 1];
        }
        spans.par_sort_unstable_by_key(|span| (span.node(), span.low, span.item));
        let lows = spans.iter().map(|span| (span.low, span.item)).collect();
        spans.par_sort_unstable_by_key(|span| (span.node(), Reverse(span.high), span.item));
        let highs = spans.iter().map(|span| (span.high, span.item)).collect();
        Self { starts, lows, highs }
    }

    /// Visits the items whose intervals contain a number from 1 to the most, in an order that depends on them alone. Cost: log most and
    /// the visits.
    pub(super) fn each(&self, number: u32, mut visit: impl FnMut(u32)) {
        let levels = number.trailing_zeros()..u32::BITS;
        let path = levels.map(|level| u64::from(number >> level | 1) << level);
        for node in path.take_while(|&node| node < 2 * self.starts.len() as u64) {
            // The last nodes above a number may be beyond the most, and hold nothing.
            let Some(&[start, end]) = self.starts.get(node as usize..node as usize + 2).and_then(|pair| pair.first_chunk()) else {
                continue;
            };
            let range = start as usize..end as usize;
            // All intervals here contain the node: one end decides.
            if u64::from(number) <= node {
                self.lows[range].iter().take_while(|entry| entry.0 <= number).for_each(|entry| visit(entry.1));
            } else {
                self.highs[range].iter().take_while(|entry| entry.0 >= number).for_each(|entry| visit(entry.1));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_intervals_of_small_ranges_are_found() {
        for most in 1..=21 {
            let pairs: Vec<(u32, u32)> = (1..=most).flat_map(|low| (low..=most).map(move |high| (low, high))).collect();
            let spans = pairs.iter().enumerate().map(|(item, &(low, high))| Span { low, high, item: item as u32 }).collect();
            let stabbing = Stabbing::new(spans, most);
            for number in 1..=most {
                let mut found = Vec::new();
                stabbing.each(number, |item| found.push(item));
                found.sort_unstable();
                let contains = |&item: &u32| (pairs[item as usize].0..=pairs[item as usize].1).contains(&number);
                assert_eq!(found, (0..pairs.len() as u32).filter(contains).collect::<Vec<_>>(), "{number} of {most}");
            }
        }
    }
}
