//! A binary tree of boxes over triangles in the order of a space-filling curve.

use crate::attractor::cell::Point;
use glam::Vec3A;
use rayon::prelude::*;

/// A box in single precision, rounded outwards. Its corners are vectors that the processor compares at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Box32 {
    pub(crate) low: Vec3A,
    pub(crate) high: Vec3A,
}

impl Box32 {
    pub(crate) const EMPTY: Self = Self { low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY };

    /// The box of some points.
    #[inline]
    pub(crate) fn of(points: &[Point]) -> Self {
        points.iter().fold(Self::EMPTY, |all, point| {
            let near = point.map(|x| x as f32);
            let own = Vec3A::from_array(near);
            if near.map(f64::from) == *point {
                // Most are: meshes have coordinates in single precision.
                return Self { low: all.low.min(own), high: all.high.max(own) };
            }
            let low = std::array::from_fn(|axis| if f64::from(near[axis]) > point[axis] { near[axis].next_down() } else { near[axis] });
            let high = std::array::from_fn(|axis| if f64::from(near[axis]) < point[axis] { near[axis].next_up() } else { near[axis] });
            Self { low: all.low.min(Vec3A::from_array(low)), high: all.high.max(Vec3A::from_array(high)) }
        })
    }

    #[inline]
    pub(crate) fn union(&self, other: &Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// The largest value along a direction, up to rounding.
    #[inline]
    pub(crate) fn highest(&self, along: &Point) -> f64 {
        (0..3).map(|axis| (along[axis] * f64::from(self.low[axis])).max(along[axis] * f64::from(self.high[axis]))).sum()
    }

    #[inline]
    pub(crate) fn meets(&self, other: &Self) -> bool {
        (self.low.cmple(other.high) & other.low.cmple(self.high)).all()
    }
}

/// Triangles of a leaf at most.
const LEAF: usize = 4;

/// The tree: node 1 is the root, 2 i and 2 i + 1 are the children of i, nodes from `leaves` on hold triangles.
#[derive(Debug, Default)]
pub(crate) struct BoxTree {
    nodes: Vec<Box32>,
    /// A power of two.
    leaves: usize,
    /// Items along the curve.
    order: Vec<u32>,
    /// Where an item is in `order`; `u32::MAX` for those left out.
    places: Vec<u32>,
    /// The items' boxes along the curve.
    boxes: Vec<Box32>,
    keys: Vec<u64>,
}

impl BoxTree {
    /// Makes the tree over those of `items` that have a box.
    pub(crate) fn build(&mut self, items: usize, box_of: impl Fn(u32) -> Option<Box32> + Sync, parallel: bool) {
        let Self { nodes, leaves, order, places, boxes, keys } = self;
        let count = items as u32;
        // Side by side, of many items, boxes are asked for again and again: to keep them takes more memory than all the rest.
        let kept: Vec<Option<Box32>> = if parallel { Vec::new() } else { (0..count).map(&box_of).collect() };
        let box_of = |item: u32| kept.get(item as usize).copied().unwrap_or_else(|| box_of(item));
        let all = if parallel {
            (0..count).into_par_iter().filter_map(box_of).reduce(|| Box32::EMPTY, |all, own| all.union(&own))
        } else {
            (0..count).filter_map(box_of).fold(Box32::EMPTY, |all, own| all.union(&own))
        };
        let scale: [f32; 3] = std::array::from_fn(|axis| 1023.0 / (all.high[axis] - all.low[axis]).max(f32::MIN_POSITIVE));
        let key = |item: u32| {
            let own = box_of(item)?;
            let code = (0..3).fold(0_u64, |code, axis| {
                let middle = 0.5 * (own.low[axis] + own.high[axis]);
                code | spread(((middle - all.low[axis]) * scale[axis]) as u64) << axis
            });
            Some(code << 32 | u64::from(item))
        };
        keys.clear();
        if parallel {
            keys.par_extend((0..count).into_par_iter().filter_map(key));
            keys.par_sort_unstable();
        } else {
            keys.extend((0..count).filter_map(key));
            keys.sort_unstable();
        }
        order.clear();
        order.extend(keys.iter().map(|key| *key as u32));
        places.clear();
        places.resize(items, u32::MAX);
        for (place, &item) in order.iter().enumerate() {
            places[item as usize] = place as u32;
        }
        *leaves = order.len().div_ceil(LEAF).max(1).next_power_of_two();
        nodes.clear();
        nodes.resize(2 * *leaves, Box32::EMPTY);
        boxes.clear();
        boxes.reserve(order.len());
        if parallel {
            boxes.par_extend(order.par_iter().map(|&item| box_of(item).unwrap_or(Box32::EMPTY)));
        } else {
            boxes.extend(order.iter().map(|&item| box_of(item).unwrap_or(Box32::EMPTY)));
        }
        for (place, own) in boxes.iter().enumerate() {
            let leaf = *leaves + place / LEAF;
            nodes[leaf] = nodes[leaf].union(own);
        }
        for node in (1..*leaves).rev() {
            nodes[node] = nodes[2 * node].union(&nodes[2 * node + 1]);
        }
    }

    /// The box of all.
    pub(crate) fn whole(&self) -> &Box32 {
        &self.nodes[1]
    }

    /// The number of leaves.
    pub(crate) fn leaves(&self) -> usize {
        self.leaves
    }

    /// The items of a leaf.
    #[inline]
    pub(crate) fn items(&self, leaf: usize) -> &[u32] {
        &self.order[self.range(leaf)]
    }

    /// Their boxes.
    #[inline]
    pub(crate) fn boxes(&self, leaf: usize) -> &[Box32] {
        &self.boxes[self.range(leaf)]
    }

    #[inline]
    fn range(&self, leaf: usize) -> std::ops::Range<usize> {
        let start = |leaf: usize| (leaf * LEAF).min(self.order.len());
        start(leaf)..start(leaf + 1)
    }

    /// The leaf that holds an item of the tree.
    pub(crate) fn leaf_with(&self, item: u32) -> usize {
        self.places[item as usize] as usize / LEAF
    }

    /// The box of a leaf.
    pub(crate) fn leaf_box(&self, leaf: usize) -> &Box32 {
        &self.nodes[self.leaves + leaf]
    }

    /// Gives an item another box.
    #[inline]
    pub(crate) fn set(&mut self, item: u32, to: &Box32) {
        let place = self.places[item as usize] as usize;
        self.boxes[place] = *to;
        let mut node = self.leaves + place / LEAF;
        while node > 0 {
            let grown = self.nodes[node].union(to);
            if grown == self.nodes[node] {
                return;
            }
            self.nodes[node] = grown;
            node /= 2;
        }
    }

    /// Calls `visit` with the leaves from `first` on whose boxes meet `wanted`, until it answers false.
    #[inline]
    pub(crate) fn query(&self, wanted: &Box32, first: usize, visit: impl FnMut(usize) -> bool) {
        self.query_unless(wanted, first, |_| false, visit);
    }

    /// As [`BoxTree::query`], without what lies below nodes of which `is_known` says that it need not be looked at.
    #[inline]
    pub(super) fn query_unless(&self, wanted: &Box32, first: usize, is_known: impl Fn(usize) -> bool, visit: impl FnMut(usize) -> bool) {
        let is_wanted = |node: usize| {
            // The last leaf below.
            let ends_before = || ((node + 1) << (self.leaves.ilog2() - node.ilog2())) <= first + self.leaves;
            self.nodes[node].meets(wanted) && !is_known(node) && (node >= self.leaves || !ends_before())
        };
        self.walk(is_wanted, visit);
    }

    /// Calls `visit` with the leaves whose boxes are wanted, as those of all that is above them are, until it answers false.
    #[inline]
    pub(crate) fn query_wanted(&self, is_wanted: impl Fn(&Box32) -> bool, visit: impl FnMut(usize) -> bool) {
        self.walk(|node| is_wanted(&self.nodes[node]), visit);
    }

    /// Calls `visit` with the leaves that are wanted, as all nodes above them are, until it answers false.
    #[inline]
    fn walk(&self, is_wanted: impl Fn(usize) -> bool, mut visit: impl FnMut(usize) -> bool) {
        // Depth-first: at most one node waits at every level.
        let mut stack = [0_u32; 33];
        let mut height = 1;
        stack[0] = 1;
        while height > 0 {
            height -= 1;
            let node = stack[height] as usize;
            if !is_wanted(node) {
                continue;
            }
            if node < self.leaves {
                stack[height] = 2 * node as u32 + 1;
                stack[height + 1] = 2 * node as u32;
                height += 2;
            } else if !visit(node - self.leaves) {
                return;
            }
        }
    }

    /// Calls `visit` with the leaves that lie on a way, of every node's children the nearer one first. `entry` says how far along the way a box is at least,
    /// `None` for one beside it; that of a box is at most those of all boxes within it. What is farther than a bound is left out, and `visit` answers with the
    /// bound from then on.
    pub(crate) fn nearest(&self, mut bound: f64, entry: impl Fn(&Box32) -> Option<f64>, mut visit: impl FnMut(usize) -> f64) {
        let Some(at) = entry(&self.nodes[1]) else { return };
        // Depth-first: at most one node waits at every level.
        let mut stack = [(0.0, 0); 33];
        let mut height = 1;
        stack[0] = (at, 1);
        while height > 0 {
            height -= 1;
            let (at, node) = stack[height];
            if at > bound {
                continue;
            }
            if node >= self.leaves {
                bound = visit(node - self.leaves);
                continue;
            }
            let mut children = [2 * node + 1, 2 * node].map(|child| (entry(&self.nodes[child]), child));
            // What is put on top is looked at first; of equal ones that is the first child.
            if let [(Some(second), _), (Some(first), _)] = children
                && second < first
            {
                children.swap(0, 1);
            }
            for (at, child) in children {
                if let Some(at) = at {
                    stack[height] = (at, child);
                    height += 1;
                }
            }
        }
    }
}

/// The lower ten bits, two zeros between each.
fn spread(mut x: u64) -> u64 {
    x &= 0x3FF;
    x = (x | x << 16) & 0x0300_00FF;
    x = (x | x << 8) & 0x0300_F00F;
    x = (x | x << 4) & 0x030C_30C3;
    (x | x << 2) & 0x0924_9249
}
