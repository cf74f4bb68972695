//! Cells near a block of space, expanded only where a query needs them: nearest-site search by branch and
//! bound. Bounds are those of the cells first, and of the sites below them as far as these are known, which are much narrower where points stand for cells.
//!
//! The distance to the sites is a function of the point alone, to the last bit: sites are computed along
//! their address from the root, whatever block asks, pruning keeps every cell whose lower bound is within
//! `slack` of the best distance, and among equal distances the lexicographically first closest point wins.
//! So blocks agree on shared lattice vertices, and results do not depend on the number of threads.

use super::convex::{Ball, Convex, SiteSearch};
use super::setting::Setting;
use crate::attractor::Attractor;
use crate::attractor::cell::{Cell, ControlPoint, Point, Site, child_points, distance_squared, dot};
use crate::attractor::sites::{SiteError, SiteRule};
use crate::solid::half_edges::NONE;

/// A cell with its control points, as a candidate for holding the nearest site.
#[derive(Clone, Debug, Default)]
pub(super) struct Candidates {
    pub(super) cells: Vec<Candidate>,
    pub(super) points: Vec<ControlPoint>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub(super) cell: Cell,
    /// Where its control points start.
    pub(super) first: u32,
    /// Whether it is small enough to be replaced by its sites.
    pub(super) leaf: bool,
}

impl Candidates {
    /// The roots of an attractor, as far as they are not asked whether they are leaves.
    pub(super) fn of_roots(attractor: &Attractor) -> Self {
        let mut candidates = Self::default();
        for (index, root) in attractor.roots().iter().enumerate() {
            candidates.push(attractor.root_cell(index), &root.points, false);
        }
        candidates
    }

    pub(super) fn push(&mut self, cell: Cell, points: &[ControlPoint], leaf: bool) {
        let first = self.points.len() as u32;
        self.points.extend_from_slice(points);
        self.cells.push(Candidate { cell, first, leaf });
    }

    pub(super) fn points_of(&self, attractor: &Attractor, candidate: &Candidate) -> &[ControlPoint] {
        let dimension = attractor.state_of(&candidate.cell).dimension;
        &self.points[candidate.first as usize..candidate.first as usize + dimension]
    }
}

/// Index of a node.
pub(super) type NodeId = u32;

#[derive(Clone, Copy, Debug)]
enum Content {
    /// Not expanded yet; control points start here.
    Closed(u32),
    /// Children `first .. first + count`.
    Open(u32, u32),
    /// Point sites `first .. first + count`.
    Points(u32, u32),
    /// Other sites `first .. first + count`.
    Sites(u32, u32),
}

#[derive(Clone, Copy, Debug)]
struct Node {
    centre: Point,
    /// Bounds everything below, rounding included.
    radius: f64,
    content: Content,
}

/// A site of the tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum SiteId {
    /// An entry of the list of points.
    Point(u32),
    /// An entry of the list of other sites.
    Listed(u32),
}

/// A site with its deficit: see [`SiteRule::deficit`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Weighted {
    pub(super) site: Site,
    pub(super) deficit: f64,
}

impl Convex for Weighted {
    #[inline]
    fn deficit(&self) -> f64 {
        self.deficit
    }

    #[inline]
    fn closest(&self, x: &Point) -> Point {
        self.site.closest(x)
    }

    #[inline]
    fn highest(&self, direction: &Point) -> f64 {
        highest(&self.site, direction)
    }
}

/// The largest value of a site's points along a direction.
#[inline]
pub(super) fn highest(site: &Site, direction: &Point) -> f64 {
    match site {
        Site::Point(a) => dot(a, direction),
        Site::Segment(ends) => ends.iter().map(|end| dot(end, direction)).fold(f64::NEG_INFINITY, f64::max),
        Site::Triangle(corners) => corners.iter().map(|corner| dot(corner, direction)).fold(f64::NEG_INFINITY, f64::max),
    }
}

/// The distance in space where that with a deficit is `distance`.
#[inline]
pub(super) fn in_space(distance: f64, deficit: f64) -> f64 {
    if deficit > 0.0 { (distance * distance - deficit).max(0.0).sqrt() } else { distance }
}

/// The distance with a deficit where that in space is `distance`.
#[inline]
pub(super) fn with_deficit(distance: f64, deficit: f64) -> f64 {
    if deficit > 0.0 { (distance.max(0.0).powi(2) + deficit).sqrt() } else { distance }
}

/// The nearest site of a query.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    pub(super) distance_squared: f64,
    pub(super) closest: Point,
    pub(super) site: SiteId,
    pub(super) node: NodeId,
}

pub(super) struct Tree<'a> {
    rule: &'a SiteRule<'a>,
    slack: f64,
    most_nodes: usize,
    /// Whether a node was left closed because there were too many: answers are then worthless.
    pub(super) exhausted: bool,
    nodes: Vec<Node>,
    /// The node above each, or NONE.
    above: Vec<NodeId>,
    /// The least deficit below every node, and the deficits of sites; empty where there are none.
    deficits: Vec<f64>,
    site_deficits: [Vec<f64>; 2],
    cells: Vec<Cell>,
    points: Vec<ControlPoint>,
    sites: Vec<Site>,
    point_sites: Vec<Point>,
    stack: Vec<NodeId>,
    scratch: [Vec<ControlPoint>; 2],
    /// Leaf cells met.
    pub(super) leaves: u64,
    /// Nodes and sites whose distance from a point was asked: the work of all searches.
    pub(super) looked: u64,
    /// Sites that were found near a point, for each point anew.
    pub(super) found: u64,
    /// Largest errors of leaves that were met.
    pub(super) largest_error: SiteError,
}

impl<'a> Tree<'a> {
    /// One with the slack and the limit of a setting.
    pub(super) fn of(rule: &'a SiteRule<'a>, setting: &Setting) -> Self {
        Self::new(rule, setting.slack, 4 * setting.cells)
    }

    pub(super) fn new(rule: &'a SiteRule<'a>, slack: f64, most_nodes: usize) -> Self {
        Self {
            rule,
            slack,
            most_nodes,
            exhausted: false,
            nodes: Vec::new(),
            above: Vec::new(),
            deficits: Vec::new(),
            site_deficits: [Vec::new(), Vec::new()],
            cells: Vec::new(),
            points: Vec::new(),
            sites: Vec::new(),
            point_sites: Vec::new(),
            stack: Vec::new(),
            scratch: [Vec::new(), Vec::new()],
            leaves: 0,
            looked: 0,
            found: 0,
            largest_error: SiteError::default(),
        }
    }

    /// A ball around those of nodes that follow one another.
    #[inline]
    fn around(&self, first: NodeId, count: u32) -> (Point, f64) {
        let nodes = &self.nodes[first as usize..(first + count) as usize];
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for node in nodes {
            low = std::array::from_fn(|axis| low[axis].min(node.centre[axis] - node.radius));
            high = std::array::from_fn(|axis| high[axis].max(node.centre[axis] + node.radius));
        }
        let centre: Point = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
        let radius = nodes.iter().map(|node| distance_squared(&node.centre, &centre).sqrt() + node.radius).fold(0.0, f64::max);
        (centre, radius * (1.0 + 1e-12))
    }

    /// Makes balls smaller from a node on that was expanded, upwards as long as that is worth it: what is below is known better then.
    fn tighten(&mut self, mut id: NodeId) {
        while id != NONE {
            let Node { radius, content, .. } = self.nodes[id as usize];
            let Content::Open(first, count @ 1..) = content else { return };
            let tight = self.around(first, count);
            if tight.1 > TIGHTER * radius {
                return;
            }
            let node = &mut self.nodes[id as usize];
            (node.centre, node.radius) = tight;
            id = self.above[id as usize];
        }
    }

    /// Adds a node above nodes that follow one another.
    fn group(&mut self, children: &[NodeId]) -> NodeId {
        let (first, count) = (children[0], children.len() as u32);
        let (centre, radius) = self.around(first, count);
        let id = self.nodes.len() as NodeId;
        self.nodes.push(Node { centre, radius, content: Content::Open(first, count) });
        self.above.push(NONE);
        self.above[first as usize..(first + count) as usize].fill(id);
        if self.rule.is_graded() {
            self.deficits.push(children.iter().map(|&id| self.deficits[id as usize]).fold(f64::INFINITY, f64::min));
        }
        self.cells.push(self.cells[first as usize]);
        id
    }

    fn add(&mut self, cell: Cell, points: &[ControlPoint], above: NodeId) {
        let content = if let Some(error) = self.rule.leaf(&cell, points) {
            self.leaves += 1;
            self.largest_error = self.largest_error.max(error);
            let (first, first_point) = (self.sites.len(), self.point_sites.len());
            let (sites, point_sites) = (&mut self.sites, &mut self.point_sites);
            self.rule.emit(&cell, points, &mut |site| match site {
                Site::Point(point) => point_sites.push(point),
                other => sites.push(other),
            });
            // Drawings of both kinds are rare: their points join the list of sites.
            if self.sites.len() > first {
                self.sites.extend(self.point_sites.drain(first_point..).map(Site::Point));
                Content::Sites(first as u32, (self.sites.len() - first) as u32)
            } else {
                Content::Points(first_point as u32, (self.point_sites.len() - first_point) as u32)
            }
        } else {
            let first = self.points.len() as u32;
            self.points.extend_from_slice(points);
            Content::Closed(first)
        };
        // Of one point nothing is elsewhere.
        let (centre, radius) = match content {
            Content::Points(first, 1) => (self.point_sites[first as usize], 0.0),
            _ => (cell.ball.centre, cell.ball.radius),
        };
        self.nodes.push(Node { centre, radius: radius + self.slack, content });
        self.above.push(above);
        if self.rule.is_graded() {
            let deficit = self.rule.deficit(cell.root);
            self.deficits.push(deficit);
            self.site_deficits[0].resize(self.point_sites.len(), deficit);
            self.site_deficits[1].resize(self.sites.len(), deficit);
        }
        self.cells.push(cell);
    }

    /// The children of a node, made when first asked for.
    fn expand(&mut self, id: NodeId, first_point: u32) -> (u32, u32) {
        let cell = self.cells[id as usize];
        let state = self.rule.attractor().state_of(&cell);
        let first = self.nodes.len() as u32;
        if self.nodes.len() >= self.most_nodes {
            self.exhausted = true;
            return (first, 0);
        }
        // Taken out of the tree while `add` grows its lists.
        let [mut parent, mut child] = std::mem::take(&mut self.scratch);
        parent.clear();
        parent.extend_from_slice(&self.points[first_point as usize..first_point as usize + state.dimension]);
        for (index, transition) in state.transitions.iter().enumerate() {
            child.resize(transition.operator.columns(), [0.0; 4]);
            child_points(&parent, &transition.operator, &mut child);
            self.add(self.rule.attractor().child_cell(&cell, index, &child), &child, id);
        }
        self.scratch = [parent, child];
        let count = self.nodes.len() as u32 - first;
        self.nodes[id as usize].content = Content::Open(first, count);
        self.tighten(id);
        (first, count)
    }

    /// The least deficit below a node.
    #[inline]
    fn deficit(&self, id: NodeId) -> f64 {
        if self.deficits.is_empty() { 0.0 } else { self.deficits[id as usize] }
    }

    /// How far from a node's ball x may be, if a site of it is within `distance`.
    #[inline]
    fn threshold(&self, id: NodeId, distance: f64) -> f64 {
        in_space(distance, self.deficit(id)) + self.nodes[id as usize].radius + self.slack
    }

    /// The root cell that a node descends from.
    pub(super) fn root_of(&self, id: NodeId) -> u32 {
        self.cells[id as usize].root
    }

    /// The nearest site among those below `starts`, if one is nearer than `reach`. The search ends as soon as
    /// a site nearer than `enough` is met: that hit need not be the nearest. `seed`, a node that was the
    /// answer nearby, makes the search quicker and never changes a nearest site.
    pub(super) fn nearest(&mut self, x: &Point, starts: &[NodeId], seed: Option<NodeId>, reach: f64, enough: f64) -> Option<Hit> {
        let mut best = Best { distance: reach, hit: None, limit: reach * reach, enough: enough.max(0.0).powi(2) };
        if let Some(seed) = seed {
            self.visit_sites(x, seed, &mut best);
        }
        let mut stack = std::mem::take(&mut self.stack);
        for &start in starts {
            if best.limit < best.enough {
                break;
            }
            self.descend(x, start, &mut best, &mut stack);
        }
        self.stack = stack;
        best.hit
    }

    #[inline]
    fn descend(&mut self, x: &Point, start: NodeId, best: &mut Best, stack: &mut Vec<NodeId>) {
        stack.clear();
        stack.push(start);
        while let Some(id) = stack.pop() {
            let node = &self.nodes[id as usize];
            let square = distance_squared(x, &node.centre);
            let threshold = self.threshold(id, best.distance);
            if square > threshold * threshold {
                continue;
            }
            match node.content {
                Content::Points(_, count) | Content::Sites(_, count) => {
                    self.looked += u64::from(count);
                    self.visit_sites(x, id, best);
                    if best.limit < best.enough {
                        return;
                    }
                }
                Content::Open(first, count) => {
                    self.looked += u64::from(count);
                    self.push_near(x, first, count, best, stack);
                }
                Content::Closed(points) => {
                    let (first, count) = self.expand(id, points);
                    self.looked += u64::from(count);
                    self.push_near(x, first, count, best, stack);
                }
            }
        }
    }

    /// Puts the children that may hold the nearest site on the stack, the nearest last.
    #[inline]
    fn push_near(&self, x: &Point, first: u32, count: u32, best: &mut Best, stack: &mut Vec<NodeId>) {
        let base = stack.len();
        let mut nearest = f64::INFINITY;
        for id in first..first + count {
            let node = &self.nodes[id as usize];
            let square = distance_squared(x, &node.centre);
            let threshold = self.threshold(id, best.distance);
            if square <= threshold * threshold {
                stack.push(id);
                // One pass keeps the nearest on top; full sorting costs more than it saves.
                if square < nearest {
                    nearest = square;
                } else {
                    let top = stack.len() - 1;
                    if top > base {
                        stack.swap(top, top - 1);
                    }
                }
            }
        }
    }

    #[inline]
    fn visit_sites(&self, x: &Point, id: NodeId, best: &mut Best) {
        let deficit = self.deficit(id);
        match self.nodes[id as usize].content {
            Content::Points(first, count) => {
                for index in first..first + count {
                    let point = &self.point_sites[index as usize];
                    best.offer(self, distance_squared(x, point) + deficit, point, SiteId::Point(index), id);
                }
            }
            Content::Sites(first, count) => {
                for index in first..first + count {
                    let closest = self.sites[index as usize].closest(x);
                    best.offer(self, distance_squared(x, &closest) + deficit, &closest, SiteId::Listed(index), id);
                }
            }
            Content::Open(..) | Content::Closed(_) => {}
        }
    }

    /// The nodes below one, which is expanded unless it was: the first, and how many there are; none where it holds sites.
    #[inline]
    fn children(&mut self, id: NodeId) -> Option<(NodeId, u32)> {
        match self.nodes[id as usize].content {
            Content::Open(first, count) => Some((first, count)),
            Content::Closed(points) => Some(self.expand(id, points)),
            Content::Points(..) | Content::Sites(..) => None,
        }
    }

    /// A site below a node; none where there were too many nodes.
    fn first_below(&mut self, mut id: NodeId) -> Option<SiteId> {
        while let Some((first, count)) = self.children(id) {
            id = (count > 0).then_some(first)?;
        }
        match self.nodes[id as usize].content {
            Content::Points(first, count) => (count > 0).then_some(SiteId::Point(first)),
            Content::Sites(first, count) => (count > 0).then_some(SiteId::Listed(first)),
            Content::Open(..) | Content::Closed(_) => None,
        }
    }

    /// All sites below `starts` that are within `reach` of x.
    pub(super) fn collect(&mut self, x: &Point, starts: &[NodeId], reach: f64, found: &mut Vec<SiteId>) {
        self.visit_near(x, starts, reach, 0.0, |id, _, _, _| found.push(id));
    }

    /// All sites below `starts` that are within `reach` of x and reach higher than `lowest` along a unit vector.
    pub(super) fn collect_above(
        &mut self,
        x: &Point,
        starts: &[NodeId],
        reach: f64,
        direction: &Point,
        lowest: f64,
        found: &mut Vec<SiteId>,
    ) {
        let mut stack = std::mem::take(&mut self.stack);
        stack.clear();
        stack.extend_from_slice(starts);
        let limit = (reach + self.slack).powi(2);
        let lowest = lowest - self.slack;
        while let Some(id) = stack.pop() {
            let node = &self.nodes[id as usize];
            let threshold = self.threshold(id, reach);
            if dot(&node.centre, direction) + node.radius < lowest || distance_squared(x, &node.centre) > threshold * threshold {
                continue;
            }
            let deficit = self.deficit(id);
            match node.content {
                Content::Points(first, count) => found.extend((first..first + count).map(SiteId::Point).filter(|&id| {
                    let (SiteId::Point(index) | SiteId::Listed(index)) = id;
                    let point = &self.point_sites[index as usize];
                    dot(point, direction) >= lowest && distance_squared(x, point) + deficit <= limit
                })),
                Content::Sites(first, count) => found.extend((first..first + count).map(SiteId::Listed).filter(|&id| {
                    let (SiteId::Point(index) | SiteId::Listed(index)) = id;
                    let site = &self.sites[index as usize];
                    highest(site, direction) >= lowest && site.distance_squared(x) + deficit <= limit
                })),
                Content::Open(first, count) => stack.extend(first..first + count),
                Content::Closed(points) => {
                    let (first, count) = self.expand(id, points);
                    stack.extend(first..first + count);
                }
            }
        }
        self.stack = stack;
    }
}

impl<'a> SiteSearch for Tree<'a> {
    type Site<'b>
        = Weighted
    where
        Self: 'b;
    type Candidates = Candidates;

    /// Those of its lists.
    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
            + size_of_val(&*self.above)
            + size_of_val(&*self.cells)
            + size_of_val(&*self.points)
            + size_of_val(&*self.sites)
            + size_of_val(&*self.point_sites)
    }

    /// Empties the tree and adds the candidates under groups of neighbours; returns the ids of the groups that have none above them. A group has
    /// candidates of one solid, or of none.
    fn reset(&mut self, candidates: &Candidates) -> Vec<NodeId> {
        self.nodes.clear();
        self.above.clear();
        self.deficits.clear();
        self.site_deficits.iter_mut().for_each(Vec::clear);
        self.cells.clear();
        self.points.clear();
        self.sites.clear();
        self.leaves = 0;
        self.looked = 0;
        self.found = 0;
        self.exhausted = false;
        self.largest_error = SiteError::default();
        self.point_sites.clear();
        let attractor = self.rule.attractor();
        let solid_of = |cell: &Cell| attractor.roots()[cell.root as usize].solid;
        let order = spatial_order(candidates, |cell| solid_of(cell).map_or(0, |solid| solid + 1));
        for &index in &order {
            let candidate = &candidates.cells[index as usize];
            self.add(candidate.cell, candidates.points_of(attractor, candidate), NONE);
        }
        let mut level: Vec<NodeId> = (0..self.nodes.len() as NodeId).collect();
        while level.len() > GROUP {
            let same = |a: &NodeId, b: &NodeId| solid_of(&self.cells[*a as usize]) == solid_of(&self.cells[*b as usize]);
            let groups: Vec<&[NodeId]> = level.chunk_by(same).flat_map(|own| own.chunks(GROUP)).collect();
            let above: Vec<NodeId> = groups.into_iter().map(|children| self.group(children)).collect();
            if above.len() == level.len() {
                break;
            }
            level = above;
        }
        level
    }

    /// A site by its id.
    fn site(&self, id: SiteId) -> Weighted {
        let (site, kind, index) = match id {
            SiteId::Point(index) => (Site::Point(self.point_sites[index as usize]), 0, index),
            SiteId::Listed(index) => (self.sites[index as usize], 1, index),
        };
        Weighted { site, deficit: self.site_deficits[kind].get(index as usize).copied().unwrap_or(0.0) }
    }

    #[inline]
    fn visit_near(
        &mut self,
        x: &Point,
        starts: &[NodeId],
        reach: f64,
        size: f64,
        mut visit: impl FnMut(SiteId, &Point, f64, Option<NodeId>),
    ) {
        let mut stack = std::mem::take(&mut self.stack);
        stack.clear();
        stack.extend_from_slice(starts);
        let limit = (reach + self.slack).powi(2);
        while let Some(id) = stack.pop() {
            let node = &self.nodes[id as usize];
            let threshold = self.threshold(id, reach);
            if distance_squared(x, &node.centre) > threshold * threshold {
                continue;
            }
            if node.radius < size && !matches!(node.content, Content::Points(_, 1) | Content::Sites(_, 1)) {
                self.looked += 1;
                if let Some(first) = self.first_below(id) {
                    self.found += 1;
                    let site = self.site(first);
                    let closest = site.closest(x);
                    visit(first, &closest, distance_squared(x, &closest) + site.deficit, Some(id));
                }
                continue;
            }
            let deficit = self.deficit(id);
            match node.content {
                Content::Points(first, count) => {
                    self.looked += u64::from(count);
                    for index in first..first + count {
                        let point = &self.point_sites[index as usize];
                        let square = distance_squared(x, point) + deficit;
                        if square <= limit {
                            self.found += 1;
                            visit(SiteId::Point(index), point, square, None);
                        }
                    }
                }
                Content::Sites(first, count) => {
                    self.looked += u64::from(count);
                    for index in first..first + count {
                        let closest = self.sites[index as usize].closest(x);
                        let square = distance_squared(x, &closest) + deficit;
                        if square <= limit {
                            self.found += 1;
                            visit(SiteId::Listed(index), &closest, square, None);
                        }
                    }
                }
                Content::Open(first, count) => {
                    self.looked += u64::from(count);
                    stack.extend(first..first + count);
                }
                Content::Closed(points) => {
                    let (first, count) = self.expand(id, points);
                    self.looked += u64::from(count);
                    stack.extend(first..first + count);
                }
            }
        }
        self.stack = stack;
    }

    #[inline]
    fn ball(&self, node: NodeId) -> Ball {
        let Node { centre, radius, .. } = self.nodes[node as usize];
        Ball { centre, radius, deficit: self.deficit(node) }
    }

    fn add_below(&mut self, node: NodeId, nodes: &mut Vec<NodeId>, sites: &mut Vec<SiteId>) {
        if let Some((first, count)) = self.children(node) {
            nodes.extend(first..first + count);
        }
        match self.nodes[node as usize].content {
            Content::Points(first, count) => sites.extend((first..first + count).map(SiteId::Point)),
            Content::Sites(first, count) => sites.extend((first..first + count).map(SiteId::Listed)),
            Content::Open(..) | Content::Closed(_) => {}
        }
    }

    /// Nodes that may hold a site within `reach` of x: as small as possible without becoming many.
    fn gather(&mut self, x: &Point, starts: &[NodeId], reach: f64, found: &mut Vec<NodeId>) {
        let may = |tree: &Self, id: NodeId| {
            let threshold = tree.threshold(id, reach);
            distance_squared(x, &tree.nodes[id as usize].centre) <= threshold * threshold
        };
        found.clear();
        found.extend(starts.iter().copied().filter(|&id| may(self, id)));
        let mut next = std::mem::take(&mut self.stack);
        while found.len() < ENOUGH_NODES {
            next.clear();
            let mut opened = false;
            for &id in found.iter() {
                let Some((first, count)) = self.children(id) else {
                    next.push(id);
                    continue;
                };
                opened = true;
                next.extend((first..first + count).filter(|&child| may(self, child)));
            }
            if !opened || next.len() > MOST_NODES {
                break;
            }
            std::mem::swap(found, &mut next);
        }
        self.stack = next;
    }

    fn deviation(&self) -> f64 {
        0.0
    }

    fn largest_error(&self) -> SiteError {
        self.largest_error
    }

    fn is_exhausted(&self) -> bool {
        self.exhausted
    }
}

/// Balls are made smaller where they become no larger than this share of what they were.
const TIGHTER: f64 = 0.95;

/// A list of starts is refined while it is shorter than this,
const ENOUGH_NODES: usize = 24;
/// and not if it would become longer than this: queries look at every start.
const MOST_NODES: usize = 96;

/// Children of a group.
const GROUP: usize = 8;

/// The candidates along a space-filling curve, by `class` first, so that those which follow one another are close.
fn spatial_order(candidates: &Candidates, class: impl Fn(&Cell) -> u32) -> Vec<u32> {
    let centres = candidates.cells.iter().map(|candidate| candidate.cell.ball.centre);
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for centre in centres.clone() {
        low = std::array::from_fn(|axis| low[axis].min(centre[axis]));
        high = std::array::from_fn(|axis| high[axis].max(centre[axis]));
    }
    let size = (0..3).map(|axis| high[axis] - low[axis]).fold(f64::MIN_POSITIVE, f64::max);
    let spread = |x: u64| (0..BITS).fold(0, |code, bit| code | (x >> bit & 1) << (3 * bit));
    let code = |centre: Point| {
        (0..3).fold(0, |code, axis| code | spread(((centre[axis] - low[axis]) / size * f64::from((1 << BITS) - 1)) as u64) << axis)
    };
    let mut order: Vec<(u32, u64, u32)> = candidates
        .cells
        .iter()
        .zip(centres)
        .enumerate()
        .map(|(index, (candidate, centre))| (class(&candidate.cell), code(centre), index as u32))
        .collect();
    order.sort_unstable();
    order.into_iter().map(|(.., index)| index).collect()
}

/// Bits of a coordinate on the curve.
const BITS: u32 = 10;

struct Best {
    /// Distance of the hit, or the reach.
    distance: f64,
    /// Its square, so that most offers are refused without a root.
    limit: f64,
    /// Square of the distance below which nobody asks further.
    enough: f64,
    hit: Option<Hit>,
}

impl Best {
    #[inline]
    fn offer(&mut self, tree: &Tree<'_>, square: f64, closest: &Point, site: SiteId, node: NodeId) {
        if square > self.limit {
            return;
        }
        if self.hit.is_some_and(|hit| square == hit.distance_squared && !is_first(tree, (closest, site), &hit)) {
            return;
        }
        self.limit = square;
        self.distance = square.sqrt();
        self.hit = Some(Hit { distance_squared: square, closest: *closest, site, node });
    }
}

/// Whether the site of an equal distance goes before: by its closest point, then by its own coordinates.
fn is_first(tree: &Tree<'_>, (closest, site): (&Point, SiteId), hit: &Hit) -> bool {
    let before = |a: &Point, b: &Point| a.iter().zip(b).map(|(p, q)| p.total_cmp(q)).find(|order| order.is_ne());
    let corners = |id: SiteId| match tree.site(id).site {
        Site::Point(a) => [a; 3],
        Site::Segment([a, b]) => [a, b, b],
        Site::Triangle(corners) => corners,
    };
    before(closest, &hit.closest)
        .or_else(|| corners(site).iter().zip(&corners(hit.site)).find_map(|(a, b)| before(a, b)))
        .is_some_and(|order| order.is_lt())
}
