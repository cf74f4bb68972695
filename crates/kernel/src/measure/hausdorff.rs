//! The Hausdorff distance of two shapes, both ways, by pieces of the one and the cells of the other near them.
//!
//! Directed: h(A, B) = sup over x in A of d(x, B). Let a piece of A lie within r of a point c, and have a point within e of
//! it. As d(., B) grows no faster than x moves, the piece's supremum lies in [d(c, B) - e, d(c, B) + r]. The piece of the
//! largest upper end is split until that is within the tolerance of the largest lower end. Pieces are cells, and parts
//! of simplices, which have no cells but are known exactly.
//!
//! d(c, B) is enclosed by the nodes of B's tree that may hold the points of B closest to the piece: those no farther from c
//! than d(c, B) + 2 r, as a point x of the piece has its closest point within d(x, B) <= d(c, B) + r of it. A piece hands
//! its nodes to its parts, so that no search begins at the roots.
//!
//! A solid is what it encloses. Of a point within B the distance is 0, and of a piece around it at most r - d(c, surface of B). The inside of A is searched in cubes:
//! those whose centre is outside of A, and farther than r from its surface, hold nothing of it. What a cube that meets the surface holds is within 2 r of points
//! of the surface, which are pieces themselves; so small cubes there are not searched, and 2 r is added in the end.

use super::Interval;
use super::contact::{Body, ContactError, Nature, NodeId, Tree, corners, tree};
use crate::attractor::Attractor;
use crate::attractor::cell::{Ball, Point, Site, distance_squared};
use crate::budget::Budget;
use crate::order::ordered_by;
use crate::solid::{Inside, TriMesh};
use crate::tolerance::Tolerance;
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// How far the points of a shape are from another, at most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directed {
    /// The supremum of the distances lies in this interval, in mm.
    pub distance_mm: Interval,
    /// A ball that holds a point of the shape which is at least as far as the lower end.
    pub place: Ball,
}

/// The Hausdorff distance of two shapes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hausdorff {
    /// How far points of the first are from the second.
    pub from_first: Directed,
    /// How far points of the second are from the first.
    pub from_second: Directed,
    /// Whether both intervals are as narrow as the tolerance; else a limit ended the search, and the intervals hold.
    pub complete: bool,
}

impl Hausdorff {
    /// The larger of both: the Hausdorff distance, in mm.
    #[must_use]
    pub fn distance_mm(&self) -> Interval {
        let (first, second) = (self.from_first.distance_mm, self.from_second.distance_mm);
        Interval { low: first.low.max(second.low), high: first.high.max(second.high) }
    }
}

/// Nodes to look at, at most, and the memory that cells and pieces may take, in each direction.
const MOST_NODES: u64 = 20_000_000;
const MOST_BYTES: u64 = 512 << 20;

/// What a closed surface encloses.
struct Filled<'a> {
    mesh: &'a TriMesh,
    inside: Inside<'a>,
}

/// Whether some solid holds a point: on a surface either is right.
fn holds(solids: &[Filled<'_>], point: &Point) -> bool {
    solids.iter().any(|solid| solid.inside.winding(DVec3::from_array(*point)) > 0)
}

/// The Hausdorff distance of two shapes, both ways, as intervals no wider than the tolerance unless a limit is hit.
///
/// Cost: proportional to the pieces that may be the farthest, and the cells of the other shape near them. Shapes that
/// are alike everywhere are the slowest: every cell as small as the tolerance is looked at.
///
/// # Errors
/// [`ContactError`] for a trimmed surface, or when stopped. Limits are no errors.
pub fn hausdorff(a: &Attractor, b: &Attractor, tolerance: Tolerance, budget: &Budget) -> Result<Hausdorff, ContactError> {
    let surfaces = [a, b].map(Attractor::surfaces);
    let solids = surfaces.each_ref().map(|own| own.iter().map(|mesh| Filled { mesh, inside: Inside::new(mesh) }).collect::<Vec<_>>());
    let (from_first, first_complete) = directed([tree(a, budget)?, tree(b, budget)?], [&solids[0], &solids[1]], tolerance, budget)?;
    let (from_second, second_complete) = directed([tree(b, budget)?, tree(a, budget)?], [&solids[1], &solids[0]], tolerance, budget)?;
    Ok(Hausdorff { from_first, from_second, complete: first_complete && second_complete })
}

/// A part of the first shape.
#[derive(Clone, Copy)]
enum Part {
    Node(NodeId),
    /// A part of a simplex.
    Site(Site),
    /// What a cube, by its centre and half its edge, holds of the inside.
    Cube(Point, f64),
}

/// A piece in the queue.
struct Piece {
    /// The supremum over it, at most.
    high: f64,
    /// Order of discovery.
    number: u64,
    part: Part,
    /// Nodes of the second shape that may hold the closest points.
    near: Vec<NodeId>,
    /// Of a cube, nodes of the first shape that may hold those of its surface.
    own: Vec<NodeId>,
}

ordered_by!(Piece, |this, other| this.high.total_cmp(&other.high).then(other.number.cmp(&this.number)));

struct Search<'a> {
    first: Tree<'a>,
    second: Tree<'a>,
    /// Solids of the first and of the second.
    solids: [&'a [Filled<'a>]; 2],
    budget: &'a Budget,
    slack: f64,
    /// How narrow distances from the second shape need not be: a small share of the tolerance.
    accuracy_mm: f64,
    queue: BinaryHeap<Piece>,
    /// Memory of the pieces in the queue.
    bytes: u64,
    looked: u64,
    number: u64,
    /// The largest lower end, and where.
    low: f64,
    place: Ball,
    /// Points of the inside that were not searched are within this of the surface.
    skin: f64,
}

fn directed<'a>(
    [first, second]: [Tree<'a>; 2],
    solids: [&'a [Filled<'a>]; 2],
    tolerance: Tolerance,
    budget: &'a Budget,
) -> Result<(Directed, bool), ContactError> {
    let mut search = Search {
        slack: first.slack + second.slack,
        place: first.node(0).body.ball,
        first,
        second,
        solids,
        budget,
        accuracy_mm: tolerance.mm() / 16.0,
        queue: BinaryHeap::new(),
        bytes: 0,
        looked: 0,
        number: 0,
        low: 0.0,
        skin: 0.0,
    };
    search.look(Part::Node(0), &[0], &[], f64::INFINITY);
    for solid in solids[0] {
        let Some(low) = solid.mesh.vertices.iter().copied().reduce(DVec3::min) else { continue };
        let high = solid.mesh.vertices.iter().copied().fold(low, DVec3::max);
        let (centre, half) = (0.5 * (low + high), 0.5 * (high - low).max_element() * (1.0 + 1e-9));
        search.look(Part::Cube(centre.to_array(), half), &[0], &[0], f64::INFINITY);
    }
    // A piece that cannot be split ends the search: all others are no farther.
    let mut high = 0.0;
    let mut complete = true;
    while let Some(piece) = search.queue.pop() {
        high = piece.high;
        if high + search.skin - search.low <= tolerance.mm() {
            break;
        }
        budget.cancel.check()?;
        if search.is_exhausted() {
            complete = false;
            break;
        }
        search.bytes -= memory(&piece);
        if !search.split(&piece) {
            complete = false;
            break;
        }
        high = 0.0;
    }
    let distance_mm = Interval { low: search.low, high: high.max(search.low) + search.skin };
    Ok((Directed { distance_mm, place: search.place }, complete))
}

fn memory(piece: &Piece) -> u64 {
    (std::mem::size_of::<Piece>() + std::mem::size_of_val(piece.near.as_slice()) + std::mem::size_of_val(piece.own.as_slice())) as u64
}

impl<'a> Search<'a> {
    /// Whether a limit was hit.
    fn is_exhausted(&self) -> bool {
        let limits = &self.budget.limits;
        let bytes = self.first.bytes + self.second.bytes + self.bytes;
        self.looked > limits.cells.min(MOST_NODES) || bytes > limits.memory_bytes.min(MOST_BYTES)
    }

    /// Puts the parts of a piece into the queue: whether it has any. One as small as what is rounded has none.
    fn split(&mut self, piece: &Piece) -> bool {
        if self.around(piece.part).1 <= self.slack {
            return false;
        }
        let parts: Vec<Part> = match piece.part {
            Part::Node(id) if self.first.is_splittable(id) => self.first.children(id).map(Part::Node).collect(),
            Part::Node(id) if self.first.subdivides(id) => Vec::new(),
            Part::Node(id) => self.first.node(id).body.sites.iter().flat_map(halves).map(Part::Site).collect(),
            Part::Site(site) => halves(&site).into_iter().map(Part::Site).collect(),
            Part::Cube(centre, half) => eighths(&centre, half).map(|centre| Part::Cube(centre, 0.5 * half)).into(),
        };
        parts.iter().for_each(|&part| self.look(part, &piece.near, &piece.own, piece.high));
        !parts.is_empty()
    }

    /// Encloses the supremum over a part, at most `most`, and puts it into the queue if it may be the largest.
    fn look(&mut self, part: Part, near: &[NodeId], own: &[NodeId], most: f64) {
        let (centre, radius, astray) = self.around(part);
        let (mut least, mut farthest, near) = self.distance(Which::Second, &centre, radius, near);
        if holds(self.solids[1], &centre) {
            // The piece reaches beyond the surface by what is left of its radius there.
            (least, farthest) = (0.0, -least);
        }
        let high = (farthest + radius + self.slack).min(most);
        if high <= self.low {
            return;
        }
        let (mut is_of_first, mut own_near) = (true, Vec::new());
        if let Part::Cube(..) = part {
            let (nearest, surface, near) = self.distance(Which::First, &centre, radius, own);
            is_of_first = holds(self.solids[0], &centre);
            if nearest > radius + self.slack && !is_of_first {
                return;
            }
            if surface <= radius && radius <= 2.0 * self.accuracy_mm {
                self.skin = self.skin.max(2.0 * radius + self.slack);
                return;
            }
            own_near = near;
        }
        let low = least - astray - self.slack;
        if is_of_first && low > self.low {
            (self.low, self.place) = (low, Ball { centre, radius: astray + self.slack });
        }
        if high > self.low {
            self.number += 1;
            let piece = Piece { high, number: self.number, part, near, own: own_near };
            self.bytes += memory(&piece);
            self.queue.push(piece);
        }
    }

    /// A point c, how far points of the part are from it at most, and how far the nearest is at most.
    fn around(&self, part: Part) -> (Point, f64, f64) {
        let farthest = |c: &Point, site: &Site| corners(site).iter().map(|x| distance_squared(c, x)).fold(0.0, f64::max).sqrt();
        match part {
            Part::Site(site) => {
                let c = middle(&site);
                (c, farthest(&c, &site), 0.0)
            }
            Part::Cube(centre, half) => (centre, half * 3.0_f64.sqrt() * (1.0 + 1e-12), 0.0),
            Part::Node(id) => {
                let body = &self.first.node(id).body;
                let c = middle(&body.sites[0]);
                (c, body.sites.iter().map(|site| farthest(&c, site)).fold(0.0, f64::max) + body.error, body.error)
            }
        }
    }

    /// [least, most] of the distance of c from one of the shapes, a solid being its surface here, and the nodes that may be closest to points within
    /// `radius` of c, all of `near` being known to be enough. The interval is narrow against the radius, or the
    /// tolerance, unless a limit is hit.
    fn distance(&mut self, which: Which, c: &Point, radius: f64, near: &[NodeId]) -> (f64, f64, Vec<NodeId>) {
        let mut queue = BinaryHeap::new();
        let mut high = f64::INFINITY;
        for &id in near {
            self.enter(which, c, id, &mut queue, &mut high);
        }
        let wanted = self.accuracy_mm.max(0.25 * radius);
        let mut done = Vec::new();
        let mut least = f64::INFINITY;
        while let Some(Reverse(Near { low, id })) = queue.pop() {
            // Whatever ends the search, what was not opened bounds the distance.
            if high - low <= wanted || self.is_exhausted() || self.budget.cancel.reason().is_some() {
                least = least.min(low);
                done.push((low, id));
                break;
            }
            let children = self.tree(which).children(id);
            if children.is_empty() {
                // As narrow as can be: others may still be nearer than this one surely is.
                least = least.min(low);
                done.push((low, id));
                continue;
            }
            children.for_each(|child| self.enter(which, c, child, &mut queue, &mut high));
        }
        done.extend(queue.into_iter().map(|Reverse(Near { low, id })| (low, id)));
        done.retain(|&(low, _)| low <= high + 2.0 * (radius + self.slack));
        // In the order of their discovery, whatever that of the heap.
        done.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        (least.min(high), high, done.into_iter().map(|(_, id)| id).collect())
    }

    fn enter(&mut self, which: Which, c: &Point, id: NodeId, queue: &mut BinaryHeap<Reverse<Near>>, high: &mut f64) {
        self.looked += 1;
        let slack = self.slack;
        let tree = self.tree(which);
        let gap = Body::of_site(Site::Point(*c), Nature::Loose).gap(&tree.node(id).body, slack);
        *high = high.min(gap.high);
        let slab = gap.direction.map_or(0.0, |n| -tree.reach(id, &n.map(|x| -x)) - n.iter().zip(c).map(|(n, c)| n * c).sum::<f64>());
        queue.push(Reverse(Near { low: gap.low.max(slab - slack), id }));
    }

    fn tree(&mut self, which: Which) -> &mut Tree<'a> {
        match which {
            Which::First => &mut self.first,
            Which::Second => &mut self.second,
        }
    }
}

/// Which of two shapes.
#[derive(Clone, Copy)]
enum Which {
    First,
    Second,
}

/// A node, by its distance.
struct Near {
    low: f64,
    id: NodeId,
}

ordered_by!(Near, |this, other| this.low.total_cmp(&other.low).then(this.id.cmp(&other.id)));

/// The mean of the corners.
fn middle(site: &Site) -> Point {
    let corners = corners(site);
    std::array::from_fn(|axis| corners.iter().map(|x| x[axis] / corners.len() as f64).sum())
}

/// The centres of a cube's eighths.
fn eighths(centre: &Point, half: f64) -> [Point; 8] {
    std::array::from_fn(|code| std::array::from_fn(|axis| centre[axis] + if code >> axis & 1 == 1 { 0.5 * half } else { -0.5 * half }))
}

/// Parts of half the size: two of a segment, four of a triangle, none of a point.
fn halves(site: &Site) -> Vec<Site> {
    let half = |a: &Point, b: &Point| -> Point { std::array::from_fn(|axis| 0.5 * a[axis] + 0.5 * b[axis]) };
    match site {
        Site::Point(_) => Vec::new(),
        Site::Segment([a, b]) => vec![Site::Segment([*a, half(a, b)]), Site::Segment([half(a, b), *b])],
        Site::Triangle([a, b, c]) => {
            let (ab, bc, ca) = (half(a, b), half(b, c), half(c, a));
            [[*a, ab, ca], [ab, *b, bc], [ca, bc, *c], [ab, bc, ca]].map(Site::Triangle).into()
        }
    }
}
