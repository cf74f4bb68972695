//! The cells of a shape as a tree that grows where it is asked to, each a [`Body`].

use super::body::{Body, Nature, ball_of_box, least, most};
use crate::attractor::cell::{Cell, ControlPoint, Point, Site, child_points, dot};
use crate::attractor::{Address, Attractor, StateBound, point_at, rounding};
use crate::automaton::LeafPrimitive;
use crate::budget::{Budget, Stopped};
use std::collections::VecDeque;
use std::ops::Range;

/// Index of a node.
pub(crate) type NodeId = u32;

enum Content {
    /// Two nodes that stand for all roots below them.
    Group,
    /// A cell and its control points.
    Cell(Cell, Vec<ControlPoint>),
    /// No cell of a shape: all of it is its body.
    Primitive,
}

/// A node.
pub(crate) struct Node {
    /// Where it is.
    pub(crate) body: Body,
    content: Content,
    /// The node before, unless it is a root or a group.
    before: Option<NodeId>,
    /// The letter from there, or the index of the root.
    letter: usize,
    depth: u32,
    children: Option<Range<NodeId>>,
}

impl Node {
    /// Whether it stands for several roots.
    pub(crate) fn is_group(&self) -> bool {
        matches!(self.content, Content::Group)
    }
}

/// See the module's comment. The first node is the whole shape.
pub(crate) struct Tree<'a> {
    attractor: Option<&'a Attractor>,
    nodes: Vec<Node>,
    /// Memory of the nodes.
    pub(crate) bytes: u64,
    /// What rounding may add to distances of its nodes: products of depth 60 lose less than 1e-12 of the largest
    /// coordinate; the least length is above what underflows when squared.
    pub(crate) slack: f64,
    /// Letters that an address may have.
    most_letters: u32,
}

impl<'a> Tree<'a> {
    /// The roots of a shape, in groups of two halves along the longest side of their centres' box.
    ///
    /// # Errors
    /// [`Stopped`] when the budget's token was fired.
    pub(crate) fn new(attractor: &'a Attractor, budget: &Budget) -> Result<Self, Stopped> {
        let most_letters = budget.limits.depth;
        let mut tree = Self { attractor: Some(attractor), nodes: Vec::new(), bytes: 0, slack: 1e-130, most_letters };
        let mut roots: Vec<Option<Node>> = attractor
            .roots()
            .iter()
            .enumerate()
            .map(|(index, root)| {
                budget.cancel.check()?;
                let cell = attractor.root_cell(index);
                tree.slack = tree.slack.max(rounding(&cell.ball));
                let body = cell_body(attractor, &cell, &root.points, 0);
                let content = Content::Cell(cell, root.points.clone());
                Ok(Some(Node { body, content, before: None, letter: index, depth: 0, children: None }))
            })
            .collect::<Result<_, Stopped>>()?;
        let mut order: Vec<usize> = (0..roots.len()).collect();
        // Places of nodes are handed out before the nodes are made: a group needs those of its halves.
        let mut waiting: VecDeque<Range<usize>> = std::iter::once(0..order.len()).collect();
        let mut next: NodeId = 1;
        while let Some(range) = waiting.pop_front() {
            budget.cancel.check()?;
            let members = &mut order[range.clone()];
            let node = if let [only] = *members {
                roots[only].take()
            } else {
                let body = group_body(members.iter().filter_map(|&root| roots[root].as_ref()).map(|node| &node.body));
                let centre = |root: usize| roots[root].as_ref().map_or([0.0; 3], |node| node.body.ball.centre);
                let spread = |axis: usize| {
                    let (low, high) = members
                        .iter()
                        .map(|&root| centre(root)[axis])
                        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
                    high - low
                };
                let axis = (0..3).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(0);
                let half = members.len() / 2;
                members.select_nth_unstable_by(half, |&a, &b| centre(a)[axis].total_cmp(&centre(b)[axis]).then(a.cmp(&b)));
                waiting.push_back(range.start..range.start + half);
                waiting.push_back(range.start + half..range.end);
                next += 2;
                Some(Node { body, content: Content::Group, before: None, letter: 0, depth: 0, children: Some(next - 2..next) })
            };
            node.into_iter().for_each(|node| tree.push(node));
        }
        Ok(tree)
    }

    /// A tree of one node, whose largest coordinate is `size`.
    pub(crate) fn of_primitive(body: Body, size: f64) -> Self {
        let mut tree = Self { attractor: None, nodes: Vec::new(), bytes: 0, slack: (2e-12 * size).max(1e-130), most_letters: 0 };
        tree.push(Node { body, content: Content::Primitive, before: None, letter: 0, depth: 0, children: None });
        tree
    }

    fn push(&mut self, node: Node) {
        let points = if let Content::Cell(_, points) = &node.content { points.as_slice() } else { &[] };
        self.bytes +=
            (std::mem::size_of::<Node>() + std::mem::size_of_val(points) + std::mem::size_of_val(node.body.sites.as_slice())) as u64;
        self.nodes.push(node);
    }

    /// Nodes that were made so far.
    pub(crate) fn count(&self) -> usize {
        self.nodes.len()
    }

    /// A node that was handed out.
    pub(crate) fn node(&self, id: NodeId) -> &Node {
        &self.nodes[id as usize]
    }

    /// The shape; none of a primitive.
    pub(super) fn attractor(&self) -> Option<&'a Attractor> {
        self.attractor
    }

    /// The cell of a node; none of a group or a primitive.
    pub(super) fn cell(&self, id: NodeId) -> Option<&Cell> {
        if let Content::Cell(cell, _) = &self.node(id).content { Some(cell) } else { None }
    }

    /// Whether it has children: groups and cells that are no simplices, unless their address is as long as allowed.
    pub(crate) fn is_splittable(&self, id: NodeId) -> bool {
        self.node(id).is_group() || (self.node(id).depth < self.most_letters && self.subdivides(id))
    }

    /// Whether it is a cell that has children, however long its address.
    pub(crate) fn subdivides(&self, id: NodeId) -> bool {
        match (&self.node(id).content, self.attractor) {
            (Content::Cell(cell, _), Some(attractor)) => attractor.state_of(cell).leaf != LeafPrimitive::Simplex,
            _ => false,
        }
    }

    /// The children of a node, made when first asked for; none of one that is not splittable.
    pub(crate) fn children(&mut self, id: NodeId) -> Range<NodeId> {
        if let Some(children) = &self.node(id).children {
            return children.clone();
        }
        let first = self.nodes.len() as NodeId;
        let node = &self.nodes[id as usize];
        if let (true, Content::Cell(cell, points), Some(attractor)) = (self.is_splittable(id), &node.content, self.attractor) {
            let depth = node.depth + 1;
            let transitions = attractor.state_of(cell).transitions.iter().enumerate();
            let children: Vec<Node> = transitions
                .map(|(index, transition)| {
                    let mut moved = vec![[0.0; 4]; transition.operator.columns()];
                    child_points(points, &transition.operator, &mut moved);
                    let child = attractor.child_cell(cell, index, &moved);
                    let body = cell_body(attractor, &child, &moved, depth);
                    Node { body, content: Content::Cell(child, moved), before: Some(id), letter: transition.label, depth, children: None }
                })
                .collect();
            children.into_iter().for_each(|child| self.push(child));
        }
        let children = first..self.nodes.len() as NodeId;
        self.nodes[id as usize].children = Some(children.clone());
        children
    }

    /// The triangle that a node is exactly, outward from the solid of whose surface it is a part.
    pub(crate) fn solid_triangle(&self, id: NodeId) -> Option<[Point; 3]> {
        let solid = self.attractor?.roots()[self.cell(id)?.root as usize].solid;
        match (solid, self.node(id).body.sites.as_slice()) {
            (Some(_), [Site::Triangle(corners)]) => Some(*corners),
            _ => None,
        }
    }

    /// A bound of n.x over the node, |n| = 1.
    pub(crate) fn reach(&self, id: NodeId, direction: &Point) -> f64 {
        let node = self.node(id);
        match (&node.content, self.attractor) {
            (Content::Cell(cell, points), Some(attractor)) => cell_reach(attractor, cell, points, direction),
            (Content::Group, _) => {
                (0..3).map(|axis| (direction[axis] * node.body.low[axis]).max(direction[axis] * node.body.high[axis])).sum()
            }
            _ => node.body.reach(direction),
        }
    }

    /// A node that is no group, below this one.
    pub(crate) fn some_cell(&self, mut id: NodeId) -> NodeId {
        while let (true, Some(children)) = (self.node(id).is_group(), &self.node(id).children) {
            id = children.start;
        }
        id
    }

    /// A point of the shape in a cell, and how far it may be off; none where rounding leaves none, and of what is no cell.
    pub(super) fn some_point(&self, id: NodeId) -> Option<(Point, f64)> {
        // The work follows the length of the address, which is bounded.
        let found = point_at(self.attractor?, &self.address(id)?, &Budget::default()).ok()?;
        Some((found.point, found.bound_mm))
    }

    /// The address of a cell; none of what is no cell.
    pub(crate) fn address(&self, id: NodeId) -> Option<Address> {
        let mut prefix = Vec::new();
        let mut node = self.node(id);
        while let Some(before) = node.before {
            prefix.push(node.letter);
            node = self.node(before);
        }
        prefix.reverse();
        matches!(node.content, Content::Cell(..)).then(|| Address { root: node.letter, prefix, period: Vec::new() })
    }
}

fn group_body<'b>(bodies: impl Iterator<Item = &'b Body>) -> Body {
    let empty = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let (low, high) = bodies.fold(empty, |(low, high), body| (least(&low, &body.low), most(&high, &body.high)));
    let ball = ball_of_box(&low, &high);
    // Every point of the box is as near to its centre, and some are points of the shape.
    Body { sites: vec![Site::Point(ball.centre)], error: ball.radius, grown: 0.0, ball, low, high, nature: Nature::Loose }
}

/// Sites of a polygon: those of quadrilaterals are kept, beyond them the ball is cheaper.
const MOST_SITES: usize = 2;

/// What is known of a cell: a simplex is itself; chords and polygons stand for cells as near as their error says;
/// otherwise its ball does.
fn cell_body(attractor: &Attractor, cell: &Cell, points: &[ControlPoint], depth: u32) -> Body {
    let mut body = Body {
        sites: Vec::new(),
        error: cell.ball.radius,
        grown: 0.0,
        ball: cell.ball,
        low: [0.0; 3],
        high: [0.0; 3],
        nature: Nature::Loose,
    };
    for axis in 0..3 {
        let unit: Point = std::array::from_fn(|i| f64::from(u8::from(i == axis)));
        body.high[axis] = cell_reach(attractor, cell, points, &unit);
        body.low[axis] = -cell_reach(attractor, cell, points, &unit.map(|x| -x));
    }
    let leaf = &attractor.state_of(cell).leaf;
    if let LeafPrimitive::Simplex | LeafPrimitive::Chord(_) | LeafPrimitive::Polygon(_) = leaf {
        let error = attractor.leaf_error(cell, points);
        if error < body.error || *leaf == LeafPrimitive::Simplex {
            attractor.emit(cell, points, &mut |site| body.sites.push(site));
            if body.sites.len() <= MOST_SITES {
                body.error = error;
                body.nature = match leaf {
                    LeafPrimitive::Simplex if depth == 0 && !attractor.roots()[cell.root as usize].rational => Nature::Exact,
                    LeafPrimitive::Polygon(_) => Nature::Loose,
                    _ => Nature::Connected,
                };
                return body;
            }
            body.sites.clear();
        }
    }
    body.sites.push(Site::Point(cell.ball.centre));
    body
}

/// The largest n.x over a cell, at most: its ball, or the corners of its box in the frame, or its control points. With
/// Q the control points and x = (1 + m) p - m q, p and q convex weights (see `attractor::bound`), n.Qx is at most the
/// largest n.Q_j plus m times what it exceeds the least by.
fn cell_reach(attractor: &Attractor, cell: &Cell, points: &[ControlPoint], direction: &Point) -> f64 {
    let reach = match attractor.bound(cell.state) {
        StateBound::Frame { low, high, .. } => {
            let height = |point: &ControlPoint| dot(direction, &[point[0], point[1], point[2]]);
            let base = height(&points[0]);
            let edges = points[1..].iter().map(|point| {
                let edge: Point = std::array::from_fn(|axis| point[axis] - points[0][axis]);
                dot(direction, &edge)
            });
            base + edges.zip(low.iter().zip(high)).map(|(edge, (low, high))| (edge * low).max(edge * high)).sum::<f64>()
        }
        StateBound::Hull { margin, .. } => {
            let rational = attractor.roots()[cell.root as usize].rational;
            let height = |point: &ControlPoint| dot(direction, &[point[0], point[1], point[2]]) / if rational { point[3] } else { 1.0 };
            let (least, most) =
                points.iter().map(height).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
            most + margin * (most - least)
        }
    };
    reach.min(dot(direction, &cell.ball.centre) + cell.ball.radius)
}
