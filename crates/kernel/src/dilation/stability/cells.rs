//! Cells of an attractor as convex figures with errors, expanded where a search asks for it, and which of them compete for being
//! nearest.
//!
//! Of a cell C with the figures K: C lies within `error` of their union, and every K within `error` of the attractor A. For the exact
//! cells of points, wires and meshes the error is rounding; for others it shrinks with the cell. So, with f the distance from a figure,
//! f - error is a lower bound of the distance from C's part of A, and f + error an upper one of the distance d from A.

use crate::attractor::Attractor;
use crate::attractor::cell::{Cell, ControlPoint, Point, Site, child_points, distance_squared};
use crate::automaton::LeafPrimitive;

/// A convex set that stands for a part of a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Figure {
    pub(super) site: Site,
    pub(super) error: f64,
    /// Whether it stands for one point of A, wherever that is within the error.
    single: bool,
}

impl Figure {
    fn is_point(&self) -> bool {
        matches!(self.site, Site::Point(_))
    }
}

#[derive(Clone, Copy, Debug)]
enum Children {
    /// The figures are as exact as they get.
    Exact,
    Closed,
    Open(u32, u32),
}

#[derive(Clone, Copy, Debug)]
struct Node {
    cell: Cell,
    first_point: u32,
    first_figure: u32,
    figures: u32,
    children: Children,
}

/// A figure that may be nearest somewhere in a ball.
#[derive(Clone, Copy, Debug)]
pub(super) struct Near {
    pub(super) figure: u32,
    pub(super) node: u32,
    /// Its point closest to the middle, and how far that is.
    pub(super) closest: Point,
    pub(super) distance: f64,
    pub(super) error: f64,
    /// Points of A closest to points of the ball that belong to this figure are within `wander` of `closest`.
    pub(super) wander: f64,
    is_point: bool,
    /// See [`Figure`].
    pub(super) single: bool,
}

pub(super) struct Cells<'a> {
    attractor: &'a Attractor,
    /// Rounding of coordinates, and what figures of exact cells are off anyway.
    least_error: f64,
    /// Whether figures of exact cells are off by rounding alone.
    is_exact: bool,
    nodes: Vec<Node>,
    figures: Vec<Figure>,
    points: Vec<ControlPoint>,
    most: usize,
}

/// What is drawn for a cell replaces its ball if it is closer by this factor.
const CLOSER: f64 = 0.25;
/// Figures that others are compared with.
const LEADERS: usize = 12;

impl<'a> Cells<'a> {
    /// The roots, off by `deviation` besides rounding; at most so many nodes.
    pub(super) fn new(attractor: &'a Attractor, deviation: f64, slack: f64, most: usize) -> Self {
        let mut cells = Self {
            attractor,
            least_error: deviation + slack,
            is_exact: deviation == 0.0,
            nodes: Vec::new(),
            figures: Vec::new(),
            points: Vec::new(),
            most,
        };
        for (index, root) in attractor.roots().iter().enumerate() {
            cells.add(attractor.root_cell(index), &root.points);
        }
        cells
    }

    pub(super) fn attractor(&self) -> &'a Attractor {
        self.attractor
    }

    fn add(&mut self, cell: Cell, points: &[ControlPoint]) {
        let state = self.attractor.state_of(&cell);
        let (first_figure, first_point) = (self.figures.len(), self.points.len() as u32);
        let exact = state.leaf == LeafPrimitive::Simplex;
        let error = self.attractor.leaf_error(&cell, points);
        let figures = &mut self.figures;
        if exact || error < CLOSER * cell.ball.radius {
            let error = error + self.least_error;
            let single = exact && self.is_exact && points.len() == 1;
            self.attractor.emit(&cell, points, &mut |site| figures.push(Figure { site, error, single }));
        } else {
            figures.push(Figure { site: Site::Point(cell.ball.centre), error: cell.ball.radius + self.least_error, single: false });
        }
        let children = if exact || state.transitions.is_empty() { Children::Exact } else { Children::Closed };
        if let Children::Closed = children {
            self.points.extend_from_slice(points);
        }
        let count = (self.figures.len() - first_figure) as u32;
        self.nodes.push(Node { cell, first_point, first_figure: first_figure as u32, figures: count, children });
    }

    /// Makes the children of a node; `false` when there is no room, or there are none.
    pub(super) fn expand(&mut self, node: u32) -> bool {
        let Node { cell, first_point, children, .. } = self.nodes[node as usize];
        match children {
            Children::Open(..) => return true,
            Children::Exact => return false,
            Children::Closed if self.nodes.len() >= self.most => return false,
            Children::Closed => {}
        }
        let first = self.nodes.len() as u32;
        let state = self.attractor.state_of(&cell);
        let parent = self.points[first_point as usize..first_point as usize + state.dimension].to_vec();
        let mut child = Vec::new();
        for (index, transition) in state.transitions.iter().enumerate() {
            child.clear();
            child.resize(transition.operator.columns(), [0.0; 4]);
            child_points(&parent, &transition.operator, &mut child);
            self.add(self.attractor.child_cell(&cell, index, &child), &child);
        }
        self.nodes[node as usize].children = Children::Open(first, self.nodes.len() as u32 - first);
        true
    }

    pub(super) fn is_closed(&self, node: u32) -> bool {
        matches!(self.nodes[node as usize].children, Children::Closed)
    }

    /// Replaces nodes that are open by their children.
    pub(super) fn replaced(&self, list: &[u32]) -> Vec<u32> {
        let mut replaced = Vec::with_capacity(list.len());
        for &node in list {
            match self.nodes[node as usize].children {
                Children::Open(first, count) => replaced.extend(first..first + count),
                Children::Exact | Children::Closed => replaced.push(node),
            }
        }
        replaced
    }

    pub(super) fn figure(&self, figure: u32) -> &Figure {
        &self.figures[figure as usize]
    }

    /// Numbers of a node's figures.
    pub(super) fn figures_of(&self, node: u32) -> std::ops::Range<u32> {
        let Node { first_figure, figures, .. } = self.nodes[node as usize];
        first_figure..first_figure + figures
    }

    /// The largest error of a node's figures.
    pub(super) fn error_of(&self, node: u32) -> f64 {
        self.figures_of(node).map(|figure| self.figure(figure).error).fold(0.0, f64::max)
    }

    pub(super) fn root_of(&self, node: u32) -> u32 {
        self.nodes[node as usize].cell.root
    }

    /// The distance of a point from a node's figures.
    pub(super) fn distance(&self, node: u32, x: &Point) -> f64 {
        self.figures_of(node).map(|figure| self.figure(figure).site.distance_squared(x)).fold(f64::INFINITY, f64::min).sqrt()
    }

    /// Nodes of a list, or below them, that may hold closest points of the ball of radius h around x: as far as they are expanded.
    pub(super) fn gather(&self, list: &[u32], x: &Point, h: f64) -> Vec<u32> {
        let (mut nodes, mut found) = (list.to_vec(), Vec::new());
        loop {
            self.compete(&nodes, x, h, &mut found);
            let mut kept: Vec<u32> = found.iter().map(|near| near.node).collect();
            kept.sort_unstable();
            kept.dedup();
            nodes = self.replaced(&kept);
            if nodes == kept {
                return nodes;
            }
        }
    }

    /// The figures of nodes that may hold the point of A closest to some point of the ball of radius h around x, nearest first.
    ///
    /// Figure i is left out if for some j it is farther than j in all of the ball. Let y = x + v be a point of it, p_i and p_j the closest
    /// points for x. As f_i^2 is convex, f_i(y)^2 >= f_i^2 + 2 v.(x - p_i), and f_j(y)^2 <= |y - p_j|^2 = f_j^2 + 2 v.(x - p_j) + v^2, so that
    /// f_i(y)^2 - f_j(y)^2 >= f_i^2 - f_j^2 - 2 h |p_i - p_j| - h^2, without the last term if i is a point. If i holds the closest point of y,
    /// f_i(y) <= f_j(y) + e with e the sum of their errors, and the difference is at most 2 e f_j(y) + e^2, f_j(y) <= f_j + h.
    pub(super) fn compete(&self, list: &[u32], x: &Point, h: f64, found: &mut Vec<Near>) {
        found.clear();
        let mut upper = f64::INFINITY;
        for &node in list {
            for figure in self.figures_of(node) {
                let Figure { site, error, single } = *self.figure(figure);
                let closest = site.closest(x);
                let distance = distance_squared(x, &closest).sqrt();
                upper = upper.min(distance + error);
                if distance - error <= upper + 2.0 * h {
                    let is_point = self.figure(figure).is_point();
                    let wander = if is_point { error } else { error + h + 2.0 * (error * (distance + h + error)).sqrt() };
                    found.push(Near { figure, node, closest, distance, error, wander, is_point, single });
                }
            }
        }
        found.retain(|near| near.distance - near.error <= upper + 2.0 * h);
        found.sort_unstable_by(|a, b| (a.distance + a.error).total_cmp(&(b.distance + b.error)).then(a.figure.cmp(&b.figure)));
        let mut leaders: Vec<Near> = Vec::with_capacity(LEADERS);
        found.retain(|near| {
            let apart = |leader: &Near| distance_squared(&near.closest, &leader.closest).sqrt();
            let is_beaten = |leader: &Near| {
                let error = near.error + leader.error;
                let bend = if near.is_point { 0.0 } else { h * h };
                let allowed = 2.0 * h * apart(leader) + bend + 2.0 * error * (leader.distance + h) + error * error;
                near.distance * near.distance - leader.distance * leader.distance > allowed * (1.0 + 1e-12)
            };
            if leaders.iter().any(is_beaten) {
                return false;
            }
            if leaders.len() < LEADERS && leaders.iter().all(|leader| apart(leader) > h) {
                leaders.push(*near);
            }
            true
        });
    }
}
