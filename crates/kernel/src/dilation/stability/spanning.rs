//! Minimum spanning trees of convex sites, by Boruvka's rounds over a tree of boxes.

use crate::attractor::cell::{Point, Site, closest_on_segment, cross, distance_squared, dot, subtract};
use crate::budget::{Budget, Stopped};
use crate::groups::Groups;
use rayon::prelude::*;

/// A site with an error and the label of those it is joined to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    site: Site,
    pub(super) error: f64,
    label: u32,
    low: Point,
    high: Point,
}

/// Two items and their distance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    pub(super) items: [usize; 2],
    pub(super) length: f64,
}

#[derive(Clone, Copy, Debug)]
struct Branch {
    low: Point,
    high: Point,
    /// Positions in the order.
    range: (u32, u32),
    /// The second child; the first comes next. 0 for leaves.
    second: u32,
    /// The group that all items below belong to.
    group: Option<u32>,
}

/// Items, the tree of boxes, and which items are in one group.
#[derive(Clone, Debug)]
pub(super) struct Spanning {
    items: Vec<Item>,
    order: Vec<u32>,
    branches: Vec<Branch>,
}

/// Items of a leaf.
const LEAF: usize = 6;

impl Item {
    pub(super) fn new(site: Site, error: f64, label: u32) -> Self {
        let corners: &[Point] = match &site {
            Site::Point(a) => std::slice::from_ref(a),
            Site::Segment(ends) => ends,
            Site::Triangle(corners) => corners,
        };
        let low = std::array::from_fn(|axis| corners.iter().map(|x| x[axis]).fold(f64::INFINITY, f64::min));
        let high = std::array::from_fn(|axis| corners.iter().map(|x| x[axis]).fold(f64::NEG_INFINITY, f64::max));
        Self { site, error, label, low, high }
    }
}

impl Spanning {
    pub(super) fn new(items: Vec<Item>) -> Self {
        let mut spanning = Self { order: (0..items.len() as u32).collect(), branches: Vec::new(), items };
        let count = spanning.items.len();
        spanning.build(0, count);
        spanning
    }

    pub(super) fn item(&self, item: usize) -> &Item {
        &self.items[item]
    }

    pub(super) fn label(&self, item: usize) -> u32 {
        self.items[item].label
    }

    fn build(&mut self, first: usize, end: usize) {
        let fold = |start: f64, pick: fn(&Item) -> &Point, better: fn(f64, f64) -> f64| -> Point {
            std::array::from_fn(|axis| {
                self.order[first..end].iter().map(|&item| pick(&self.items[item as usize])[axis]).fold(start, better)
            })
        };
        let (low, high) = (fold(f64::INFINITY, |item| &item.low, f64::min), fold(f64::NEG_INFINITY, |item| &item.high, f64::max));
        let number = self.branches.len();
        self.branches.push(Branch { low, high, range: (first as u32, end as u32), second: 0, group: None });
        if end - first <= LEAF {
            return;
        }
        let axis = (0..3).max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b]))).unwrap_or(0);
        let items = &self.items;
        let middle = |item: u32| items[item as usize].low[axis] + items[item as usize].high[axis];
        let half = (end - first) / 2;
        self.order[first..end].select_nth_unstable_by(half, |&a, &b| middle(a).total_cmp(&middle(b)).then(a.cmp(&b)));
        self.build(first, first + half);
        self.branches[number].second = self.branches.len() as u32;
        self.build(first + half, end);
    }

    fn mark(&mut self, groups: &[u32]) {
        for number in (0..self.branches.len()).rev() {
            let Branch { range, second, .. } = self.branches[number];
            self.branches[number].group = if second == 0 {
                let mut below = self.order[range.0 as usize..range.1 as usize].iter().map(|&item| groups[item as usize]);
                below.next().filter(|&first| below.all(|group| group == first))
            } else {
                self.branches[number + 1].group.filter(|&group| self.branches[second as usize].group == Some(group))
            };
        }
    }

    /// The nearest item of another group, if one is nearer than `reach`.
    fn nearest(&self, item: usize, groups: &[u32], reach: f64) -> Option<Edge> {
        let own = &self.items[item];
        let mut best: Option<Edge> = None;
        let mut limit = reach;
        let gap = |branch: &Branch| -> f64 {
            let beyond = |axis: usize| (branch.low[axis] - own.high[axis]).max(own.low[axis] - branch.high[axis]).max(0.0);
            (0..3).map(|axis| beyond(axis).powi(2)).sum::<f64>().sqrt()
        };
        let mut stack = vec![(0.0, 0_u32)];
        while let Some((least, number)) = stack.pop() {
            let branch = &self.branches[number as usize];
            if least >= limit || branch.group == Some(groups[item]) {
                continue;
            }
            if branch.second != 0 {
                let children = [number + 1, branch.second].map(|child| (gap(&self.branches[child as usize]), child));
                let (near, far) = if children[0].0 <= children[1].0 { (0, 1) } else { (1, 0) };
                stack.extend([children[far], children[near]]);
                continue;
            }
            for &other in &self.order[branch.range.0 as usize..branch.range.1 as usize] {
                let other = other as usize;
                if groups[other] != groups[item] {
                    let (a, b) = (item.min(other), item.max(other));
                    let length = site_distance(&self.items[a].site, &self.items[b].site);
                    if length < limit {
                        limit = length;
                        best = Some(Edge { items: [item, other], length });
                    }
                }
            }
        }
        best
    }

    /// Groups of the items: those of their labels.
    fn groups(&self) -> Groups {
        let mut groups = Groups::new(self.items.len());
        let mut firsts = std::collections::HashMap::new();
        for (item, Item { label, .. }) in self.items.iter().enumerate() {
            let first = *firsts.entry(*label).or_insert(item);
            groups.join(first, item);
        }
        groups
    }

    /// The edges of a minimum spanning tree of the labels.
    ///
    /// In a round every group takes a shortest edge to another. Such an edge is in a minimum spanning tree; of those that
    /// make a circle, which have the same length, one is left out.
    pub(super) fn edges(&mut self, budget: &Budget) -> Result<Vec<Edge>, Stopped> {
        let mut groups = self.groups();
        let mut nearest: Vec<Option<Edge>> = vec![None; self.items.len()];
        let mut edges = Vec::new();
        loop {
            let of = groups.all();
            self.mark(&of);
            if self.branches[0].group.is_some() {
                return Ok(edges);
            }
            let this = &*self;
            nearest = (0..self.items.len())
                .into_par_iter()
                .map(|item| {
                    // An item that was the nearest of all others is so as long as it belongs to another group.
                    if let Some(known) = nearest[item].filter(|known| of[known.items[1]] != of[item]) {
                        return Ok(Some(known));
                    }
                    budget.cancel.check()?;
                    Ok(this.nearest(item, &of, f64::INFINITY))
                })
                .collect::<Result<_, Stopped>>()?;
            let mut best: Vec<Option<Edge>> = vec![None; self.items.len()];
            for edge in nearest.iter().flatten() {
                let entry = &mut best[of[edge.items[0]] as usize];
                if entry.is_none_or(|known| edge.length < known.length) {
                    *entry = Some(*edge);
                }
            }
            edges.extend(best.into_iter().flatten().filter(|edge| groups.join(edge.items[0], edge.items[1])));
        }
    }

    /// For every item the number of the first that it is joined to.
    pub(super) fn joined<'e>(&self, edges: impl Iterator<Item = &'e Edge>) -> Vec<usize> {
        let mut groups = self.groups();
        for edge in edges {
            groups.join(edge.items[0], edge.items[1]);
        }
        groups.all().into_iter().map(|group| group as usize).collect()
    }

    /// Gives what the edges join one label. For every item whether all others with another label are farther than `reach`, errors of both taken off.
    pub(super) fn join(&mut self, edges: &[Edge], reach: f64, budget: &Budget) -> Result<Vec<bool>, Stopped> {
        let of: Vec<u32> = self.joined(edges.iter()).into_iter().map(|group| group as u32).collect();
        self.items.iter_mut().zip(&of).for_each(|(item, &label)| item.label = label);
        self.mark(&of);
        let error = self.items.iter().map(|item| item.error).fold(0.0, f64::max);
        let this = &*self;
        (0..self.items.len())
            .into_par_iter()
            .map(|item| {
                budget.cancel.check()?;
                Ok(this.nearest(item, &of, (reach + 2.0 * error) * (1.0 + 1e-9)).is_none())
            })
            .collect()
    }
}

/// The distance of two convex sites.
fn site_distance(a: &Site, b: &Site) -> f64 {
    match (a, b) {
        (Site::Point(x), other) | (other, Site::Point(x)) => other.distance_squared(x).sqrt(),
        (Site::Segment(p), Site::Segment(q)) => segments(p, q),
        (Site::Segment(ends), Site::Triangle(corners)) | (Site::Triangle(corners), Site::Segment(ends)) => to_triangle(ends, corners),
        (Site::Triangle(p), Site::Triangle(q)) => {
            let sides = |corners: &[Point; 3]| [0, 1, 2].map(|k| [corners[k], corners[(k + 1) % 3]]);
            let one = sides(p).iter().map(|side| to_triangle(side, q)).fold(f64::INFINITY, f64::min);
            sides(q).iter().map(|side| to_triangle(side, p)).fold(one, f64::min)
        }
    }
}

/// The distance of a segment from a triangle: 0 if it passes through, else that of an end from the triangle or of it from a side.
fn to_triangle(ends: &[Point; 2], corners: &[Point; 3]) -> f64 {
    let triangle = Site::Triangle(*corners);
    let from_ends = ends.iter().map(|end| triangle.distance_squared(end).sqrt()).fold(f64::INFINITY, f64::min);
    let least = (0..3).map(|k| segments(ends, &[corners[k], corners[(k + 1) % 3]])).fold(from_ends, f64::min);
    if least == 0.0 {
        return 0.0;
    }
    let (u, v) = (subtract(&corners[1], &corners[0]), subtract(&corners[2], &corners[0]));
    let normal = cross(&u, &v);
    let heights = ends.map(|end| dot(&subtract(&end, &corners[0]), &normal));
    if heights[0] * heights[1] >= 0.0 {
        return least;
    }
    let share = heights[0] / (heights[0] - heights[1]);
    let through: Point = std::array::from_fn(|axis| ends[0][axis] + share * (ends[1][axis] - ends[0][axis]));
    // Up to rounding the point is in the plane, and in the triangle if that is where it is closest.
    triangle.distance_squared(&through).sqrt().min(least)
}

/// The distance of two segments: the closest points of their lines, put back to the segments in turn.
fn segments(p: &[Point; 2], q: &[Point; 2]) -> f64 {
    let (d, e, offset) = (subtract(&p[1], &p[0]), subtract(&q[1], &q[0]), subtract(&p[0], &q[0]));
    let (a, b, c) = (dot(&d, &d), dot(&d, &e), dot(&e, &e));
    let determinant = a * c - b * b;
    let from_ends = [
        distance_squared(&p[0], &closest_on_segment(&p[0], &q[0], &q[1])),
        distance_squared(&p[1], &closest_on_segment(&p[1], &q[0], &q[1])),
        distance_squared(&q[0], &closest_on_segment(&q[0], &p[0], &p[1])),
        distance_squared(&q[1], &closest_on_segment(&q[1], &p[0], &p[1])),
    ];
    let mut least = from_ends.into_iter().fold(f64::INFINITY, f64::min);
    if determinant > 0.0 {
        let along = ((b * dot(&e, &offset) - c * dot(&d, &offset)) / determinant).clamp(0.0, 1.0);
        let x: Point = std::array::from_fn(|axis| p[0][axis] + along * d[axis]);
        least = least.min(distance_squared(&x, &closest_on_segment(&x, &q[0], &q[1])));
    }
    least.sqrt()
}
