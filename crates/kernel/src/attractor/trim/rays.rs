//! Which edges a ray crosses, and so which side of closed polygons a point is on.

use super::arc::Parameter;

/// Whether the ray from a point towards larger u crosses a segment, which has its lower end and not its upper one.
pub(super) fn crosses_segment([a, b]: [Parameter; 2], point: Parameter) -> bool {
    if (a[1] <= point[1]) == (b[1] <= point[1]) {
        return false;
    }
    let along = (point[1] - a[1]) / (b[1] - a[1]);
    a[0] + along * (b[0] - a[0]) > point[0]
}

/// Directed edges with a number each, by the intervals of v that they cover: a segment tree.
#[derive(Clone, Debug)]
pub(super) struct Rays {
    edges: Vec<([Parameter; 2], usize)>,
    /// All ends of edges, increasing.
    levels: Vec<f64>,
    /// Edges that cover a node's intervals wholly but not its parent's; node 1 is the root, the children of k are 2 k and
    /// 2 k + 1, leaves are intervals of successive levels.
    nodes: Vec<Vec<u32>>,
}

impl Rays {
    /// Cost: n log n.
    pub(super) fn new(edges: Vec<([Parameter; 2], usize)>) -> Self {
        let mut levels: Vec<f64> = edges.iter().flat_map(|(ends, _)| ends.map(|end| end[1])).collect();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        let leaves = levels.len().max(1);
        let mut nodes = vec![Vec::new(); 2 * leaves];
        let find = |v: f64| levels.partition_point(|&level| level < v);
        for (index, (ends, _)) in edges.iter().enumerate() {
            // Intervals [low, high): an edge counts its lower end and not its upper one.
            let (mut low, mut high) = (find(ends[0][1].min(ends[1][1])) + leaves, find(ends[0][1].max(ends[1][1])) + leaves);
            while low < high {
                if low & 1 == 1 {
                    nodes[low].push(index as u32);
                    low += 1;
                }
                if high & 1 == 1 {
                    high -= 1;
                    nodes[high].push(index as u32);
                }
                (low, high) = (low / 2, high / 2);
            }
        }
        Self { edges, levels, nodes }
    }

    /// Numbers of the edges that the ray from a point towards larger u crosses.
    pub(super) fn crossed(&self, point: Parameter) -> impl Iterator<Item = usize> {
        let leaves = self.levels.len().max(1);
        let interval = self.levels.partition_point(|&level| level <= point[1]);
        let mut node = if interval == 0 { 0 } else { interval - 1 + leaves };
        let mut path = Vec::new();
        while node >= 1 {
            path.push(node);
            node /= 2;
        }
        let right = move |index: &u32| {
            let (ends, number) = self.edges[*index as usize];
            crosses_segment(ends, point).then_some(number)
        };
        path.into_iter().flat_map(|node| self.nodes[node].iter()).filter_map(right)
    }

    /// Whether a point that is on no edge is inside: an odd number of crossings.
    pub(super) fn inside(&self, point: Parameter) -> bool {
        self.crossed(point).count() % 2 == 1
    }
}
