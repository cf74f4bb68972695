//! Boxes that overlap.

use super::arc::Parameter;

/// Boxes in a tree, each node of which is halved at the median along its longer side.
#[derive(Clone, Debug)]
pub(super) struct Boxes {
    boxes: Vec<[Parameter; 2]>,
    order: Vec<u32>,
    nodes: Vec<Node>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: [Parameter; 2],
    /// Of `order`.
    first: u32,
    count: u32,
    /// The children; 0 for leaves.
    children: [u32; 2],
}

/// Boxes of a leaf.
const LEAF: usize = 4;

fn overlap(a: &[Parameter; 2], b: &[Parameter; 2], gap: f64) -> bool {
    (0..2).all(|k| a[0][k] - b[1][k] <= gap && b[0][k] - a[1][k] <= gap)
}

impl Boxes {
    /// Cost: n log n.
    pub(super) fn new(boxes: Vec<[Parameter; 2]>) -> Self {
        let order = (0..boxes.len() as u32).collect();
        let mut tree = Self { boxes, order, nodes: Vec::new() };
        if !tree.boxes.is_empty() {
            tree.node(0, tree.boxes.len());
        }
        tree
    }

    fn node(&mut self, first: usize, count: usize) -> u32 {
        let mut bounds = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for &index in &self.order[first..first + count] {
            let [low, high] = self.boxes[index as usize];
            for k in 0..2 {
                (bounds[0][k], bounds[1][k]) = (bounds[0][k].min(low[k]), bounds[1][k].max(high[k]));
            }
        }
        let id = self.nodes.len();
        self.nodes.push(Node { bounds, first: first as u32, count: count as u32, children: [0; 2] });
        if count > LEAF {
            let axis = usize::from(bounds[1][1] - bounds[0][1] > bounds[1][0] - bounds[0][0]);
            let boxes = &self.boxes;
            let middle = |index: &u32| boxes[*index as usize][0][axis] + boxes[*index as usize][1][axis];
            self.order[first..first + count].select_nth_unstable_by(count / 2, |a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
            let children = [self.node(first, count / 2), self.node(first + count / 2, count - count / 2)];
            self.nodes[id].children = children;
        }
        id as u32
    }

    /// Calls `meet` for every box that meets another.
    pub(super) fn near(&self, bounds: &[Parameter; 2], meet: &mut dyn FnMut(usize)) {
        let mut stack = if self.nodes.is_empty() { Vec::new() } else { vec![0_u32] };
        while let Some(node) = stack.pop() {
            let node = &self.nodes[node as usize];
            if !overlap(&node.bounds, bounds, 0.0) {
                continue;
            }
            if node.children == [0, 0] {
                let own = &self.order[node.first as usize..(node.first + node.count) as usize];
                own.iter().map(|&index| index as usize).filter(|&index| overlap(&self.boxes[index], bounds, 0.0)).for_each(&mut *meet);
            } else {
                stack.extend(node.children);
            }
        }
    }

    /// Calls `meet` for every two boxes that are not farther apart than `gap`, until it returns false.
    pub(super) fn pairs(&self, gap: f64, meet: &mut dyn FnMut(usize, usize) -> bool) {
        let mut stack = if self.nodes.is_empty() { Vec::new() } else { vec![[0_u32, 0]] };
        while let Some([a, b]) = stack.pop() {
            let [own, other] = [a, b].map(|node| &self.nodes[node as usize]);
            if !overlap(&own.bounds, &other.bounds, gap) {
                continue;
            }
            match (own.children, other.children) {
                ([0, 0], [0, 0]) => {
                    for i in own.first..own.first + own.count {
                        for j in if a == b { i + 1 } else { other.first }..other.first + other.count {
                            let [i, j] = [i, j].map(|position| self.order[position as usize] as usize);
                            if overlap(&self.boxes[i], &self.boxes[j], gap) && !meet(i, j) {
                                return;
                            }
                        }
                    }
                }
                ([left, right], _) if a == b => stack.extend([[left, left], [left, right], [right, right]]),
                ([0, 0], [left, right]) => stack.extend([[a, left], [a, right]]),
                ([left, right], [0, 0]) => stack.extend([[left, b], [right, b]]),
                ([left, right], _) if own.count >= other.count => stack.extend([[left, b], [right, b]]),
                (_, [left, right]) => stack.extend([[a, left], [a, right]]),
            }
        }
    }
}
