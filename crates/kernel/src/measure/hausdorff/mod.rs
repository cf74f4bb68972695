//! The Hausdorff distance of two shapes, both ways, by pieces of the one and the cells of the other near them.
//!
//! Directed: h(A, B) = sup over x in A of d(x, B). Let a piece of A lie within r of a point c, and have a point within e of
//! it. As d(., B) grows no faster than x moves, the piece's supremum lies in [d(c, B) - e, d(c, B) + r]. The piece of the
//! largest upper end is split until that is within the tolerance of the largest lower end. Pieces are cells, and parts
//! of simplices, which have no cells but are known exactly.
//!
//! d(c, B) is enclosed by the nodes of B's tree that may hold the points of B closest to the piece: those no farther from c
//! than d(c, B) + 2 r, as a point x of the piece has its closest point within d(x, B) <= d(c, B) + r of it; and no farther than r + s, if
//! d(., B) is known to be at most s on the piece. A piece hands its nodes to its parts, so that no search begins at the roots.
//!
//! That alone would split two shapes that share surface into pieces as small as the tolerance all over it. The least, over the sites near a piece, of what its
//! farthest corner has bounds it as well, and better where one site is the nearest all along it (see `flat`). So pieces are small only near edges of the other's
//! triangulation, and not even there where both lie along each other, as pieces are cut along the edges. Corners are looked at for the lower end, too: where one
//! site is nearest, no other point is farther.
//!
//! Simplices that both have are at the distance 0, and so is the inside of a solid that both have: neither is searched (see `same`).
//!
//! A solid is what it encloses. Of a point within B the distance is 0, and of a piece around it at most r - d(c, surface of B). The inside of A is searched in cubes:
//! those whose centre is outside of A, and farther than r from its surface, hold nothing of it. What a cube that meets the surface holds is within 2 r of points
//! of the surface, which are pieces themselves; so small cubes there are not searched, and 2 r is added in the end. Cubes are sought only for points of the inside
//! where d(., B) is a local maximum, since its largest value is at one of them or on the surface; most cubes near B cannot hold one (see `inside`).

mod flat;
mod inside;
mod same;

use super::Interval;
use super::contact::{Body, ContactError, Nature, NodeId, Tree, corners, tree};
use crate::attractor::Attractor;
use crate::attractor::cell::{Ball, Point, Site, distance_squared};
use crate::budget::Budget;
use crate::order::ordered_by;
use crate::solid::{Inside, TriMesh};
use crate::tolerance::Tolerance;
use flat::{Below, Overlay, farthest, halves, over};
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::Mutex;

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

/// Nodes to look at in each direction, at most; both are searched at the same time.
pub const MOST_NODES: u64 = 20_000_000;
/// So many more for each root or group of roots of both shapes.
const MORE_PER_NODE: u64 = 500;
/// The memory that cells and pieces may take in each direction, in bytes.
pub const MOST_BYTES: u64 = 256 << 20;

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
/// Cost: proportional to the pieces that may be the farthest, and the cells of the other shape near them. Triangles that the other
/// shape has as well cost nothing; those along triangles of the other are laid over them once. Fractals and curved
/// surfaces that are alike everywhere are the slowest: every cell as small as the tolerance is looked at.
///
/// # Errors
/// [`ContactError`] for a trimmed surface, or when stopped. Limits are no errors.
pub fn hausdorff(a: &Attractor, b: &Attractor, tolerance: Tolerance, budget: &Budget) -> Result<Hausdorff, ContactError> {
    let surfaces = [a, b].map(Attractor::surfaces);
    let solids = surfaces.each_ref().map(|own| own.iter().map(|mesh| Filled { mesh, inside: Inside::new(mesh) }).collect::<Vec<_>>());
    let [same_of_first, same_of_second] = same::shared_solids([&solids[0], &solids[1]]);
    let known = Known::default();
    let (forwards, backwards) = rayon::join(
        || directed([tree(a, budget)?, tree(b, budget)?], [&solids[0], &solids[1]], &same_of_first, tolerance, (&known, 0), budget),
        || directed([tree(b, budget)?, tree(a, budget)?], [&solids[1], &solids[0]], &same_of_second, tolerance, (&known, 1), budget),
    );
    let ((from_first, first_complete), (from_second, second_complete)) = (forwards?, backwards?);
    let found = Hausdorff { from_first, from_second, complete: first_complete && second_complete };
    budget.prove(found.distance_mm().width());
    budget.report("compare", 1.0, known.looked());
    Ok(found)
}

/// What is known already of both directions, which are searched at the same time: nodes that were looked at, and the interval.
#[derive(Default)]
struct Known(Mutex<[Option<(u64, Interval)>; 2]>);

/// Nodes that are looked at between two reports.
const NODES_PER_REPORT: u64 = 1 << 16;

impl Known {
    /// Takes note of one direction, and tells of both. Whoever listens hears one direction after the other, each with all that was known before.
    fn tell(&self, direction: usize, looked: u64, distance_mm: Interval, budget: &Budget) {
        let Ok(mut both) = self.0.lock() else { return };
        both[direction] = Some((looked, distance_mm));
        if let [Some((_, first)), Some((_, second))] = *both {
            budget.prove(first.high.max(second.high) - first.low.max(second.low));
        }
        budget.report("compare", 0.0, looked_at(&both));
    }

    fn looked(&self) -> u64 {
        self.0.lock().map_or(0, |both| looked_at(&both))
    }
}

fn looked_at(both: &[Option<(u64, Interval)>; 2]) -> u64 {
    both.iter().flatten().map(|(looked, _)| looked).sum()
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
    /// Of the nodes of the first that were there at the start, whether all of it belongs to the second.
    shared: Vec<bool>,
    /// Solids of the first and of the second.
    solids: [&'a [Filled<'a>]; 2],
    budget: &'a Budget,
    /// Nodes that may be looked at.
    most: u64,
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
    /// Upper ends up to this much above the lower end are good enough.
    enough_mm: f64,
    /// The largest upper end of pieces that are good enough, and in no queue.
    settled: f64,
}

/// Sites that are tried for a piece, at most.
const MOST_SINGLE: usize = 16;

/// Triangles that a piece is laid over, at most.
const MOST_BELOW: usize = 96;

fn directed<'a>(
    [mut first, second]: [Tree<'a>; 2],
    solids: [&'a [Filled<'a>]; 2],
    same_solids: &[bool],
    tolerance: Tolerance,
    (known, direction): (&Known, usize),
    budget: &'a Budget,
) -> Result<(Directed, bool), ContactError> {
    let mut search = Search {
        shared: same::shared(&mut first, &second),
        most: MOST_NODES + MORE_PER_NODE * (first.count() + second.count()) as u64,
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
        // What is left of the tolerance is for the skin.
        enough_mm: 0.5 * tolerance.mm(),
        settled: 0.0,
    };
    search.look(Part::Node(0), &[0], &[], f64::INFINITY);
    for (solid, _) in solids[0].iter().zip(same_solids).filter(|(_, same)| !**same) {
        let Some(low) = solid.mesh.vertices.iter().copied().reduce(DVec3::min) else { continue };
        let high = solid.mesh.vertices.iter().copied().fold(low, DVec3::max);
        let (centre, half) = (0.5 * (low + high), 0.5 * (high - low).max_element() * (1.0 + 1e-9));
        search.look(Part::Cube(centre.to_array(), half), &[0], &[0], f64::INFINITY);
    }
    // A piece that cannot be split ends the search: all others are no farther.
    let mut high = 0.0;
    let (mut complete, mut told) = (true, 0);
    while let Some(piece) = search.queue.pop() {
        high = piece.high;
        if high + search.skin - search.low <= tolerance.mm() {
            break;
        }
        budget.cancel.check()?;
        if search.looked >= told {
            told = search.looked + NODES_PER_REPORT;
            known.tell(direction, search.looked, search.reached(high), budget);
        }
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
    let distance_mm = search.reached(high);
    known.tell(direction, search.looked, distance_mm, budget);
    Ok((Directed { distance_mm, place: search.place }, complete))
}

fn memory(piece: &Piece) -> u64 {
    (std::mem::size_of::<Piece>() + std::mem::size_of_val(piece.near.as_slice()) + std::mem::size_of_val(piece.own.as_slice())) as u64
}

impl<'a> Search<'a> {
    /// The interval that holds the supremum if all pieces in the queue have it at most at `high`.
    fn reached(&self, high: f64) -> Interval {
        Interval { low: self.low, high: high.max(self.low).max(self.settled) + self.skin }
    }

    /// Whether a limit was hit.
    fn is_exhausted(&self) -> bool {
        let limits = &self.budget.limits;
        let bytes = self.first.bytes + self.second.bytes + self.bytes;
        self.looked > limits.cells.min(self.most) || bytes > (limits.memory_bytes / 2).min(MOST_BYTES)
    }

    /// Puts the parts of a piece into the queue that may be too far: whether it can be parted. One as small as what is rounded cannot.
    fn split(&mut self, piece: &Piece) -> bool {
        if self.around(piece.part).1 <= self.slack {
            return false;
        }
        let parts: Vec<Part> = match piece.part {
            Part::Node(id) if self.first.is_splittable(id) => self.first.children(id).map(Part::Node).collect(),
            Part::Node(id) if self.first.subdivides(id) => return false,
            Part::Node(_) | Part::Site(_) => {
                let (sites, _) = self.sites(piece.part);
                if sites.iter().all(|site| matches!(site, Site::Point(_))) {
                    return false;
                }
                sites.iter().flat_map(|site| self.smaller(site, piece.high, &piece.near)).map(Part::Site).collect()
            }
            Part::Cube(centre, half) => eighths(&centre, half).map(|centre| Part::Cube(centre, 0.5 * half)).into(),
        };
        parts.iter().for_each(|&part| self.look(part, &piece.near, &piece.own, piece.high));
        true
    }

    /// Encloses the supremum over a part, at most `most`, and puts it into the queue if it may be the largest.
    fn look(&mut self, part: Part, near: &[NodeId], own: &[NodeId], most: f64) {
        if matches!(part, Part::Node(id) if self.shared.get(id as usize) == Some(&true)) {
            return;
        }
        let (centre, radius, astray) = self.around(part);
        let (mut least, mut farthest, mut near) = self.distance(Which::Second, &centre, radius, near);
        let reach = farthest + 2.0 * (radius + self.slack);
        if holds(self.solids[1], &centre) {
            // The piece reaches beyond the surface by what is left of its radius there.
            (least, farthest) = (0.0, -least);
        }
        let mut high = (farthest + radius + self.slack).min(most);
        if high <= self.low {
            return;
        }
        let (mut is_of_first, mut own_near) = (true, Vec::new());
        if let Part::Cube(..) = part {
            if self.has_no_maximum(&centre, reach, near.iter().map(|near| near.id).collect()) {
                return;
            }
            let (nearest, surface, near) = self.distance(Which::First, &centre, radius, own);
            is_of_first = holds(self.solids[0], &centre);
            if nearest > radius + self.slack && !is_of_first {
                return;
            }
            if surface <= radius && radius <= 2.0 * self.accuracy_mm {
                self.skin = self.skin.max(2.0 * radius + self.slack);
                return;
            }
            own_near = near.into_iter().map(|near| near.id).collect();
        }
        if is_of_first {
            self.offer(least - astray - self.slack, &centre, astray);
        }
        if radius > self.slack && high > self.low + self.enough_mm {
            high = high.min(self.by_corners(part, radius, &near));
        }
        if !matches!(part, Part::Cube(..)) {
            // Of a solid, this keeps all of its surface that a way between two points of the piece may meet.
            near.retain(|near| near.low <= radius + high + 2.0 * self.slack);
        }
        if high <= self.low + self.enough_mm {
            self.settled = self.settled.max(high);
        } else {
            self.number += 1;
            let near = near.into_iter().map(|near| near.id).collect();
            let piece = Piece { high, number: self.number, part, near, own: own_near };
            self.bytes += memory(&piece);
            self.queue.push(piece);
        }
    }

    /// Takes a lower end that is larger than the largest, reached within `astray` of a point.
    fn offer(&mut self, low: f64, at: &Point, astray: f64) {
        if low > self.low {
            (self.low, self.place) = (low, Ball { centre: *at, radius: astray + self.slack });
        }
    }

    /// What stands for a part, and how far that is from it at most; nothing for a cube.
    fn sites(&self, part: Part) -> (Vec<Site>, f64) {
        match part {
            Part::Site(site) => (vec![site], 0.0),
            Part::Node(id) => (self.first.node(id).body.sites.clone(), self.first.node(id).body.error),
            Part::Cube(..) => (Vec::new(), 0.0),
        }
    }

    /// Bounds the supremum over a part from above by what its farthest corners are from single sites, and looks at the
    /// farthest one for the lower end.
    fn by_corners(&mut self, part: Part, radius: f64, near: &[Near]) -> f64 {
        let near: Vec<NodeId> = near.iter().map(|near| near.id).collect();
        let (sites, astray) = self.sites(part);
        if sites.iter().all(|site| matches!(site, Site::Point(_))) {
            return f64::INFINITY;
        }
        let mut worst: Option<(f64, Point)> = None;
        for site in &sites {
            let Some(single) = self.single(site, &near) else { return f64::INFINITY };
            if worst.is_none_or(|(high, _)| single.high > high) {
                worst = Some((single.high, single.corner));
            }
        }
        let Some((high, corner)) = worst else { return f64::INFINITY };
        if high + astray > self.low && !holds(self.solids[1], &corner) {
            let (least, ..) = self.distance(Which::Second, &corner, radius, &near);
            self.offer(least - astray - self.slack, &corner, astray);
        }
        high + astray + self.slack
    }

    /// The single site of the second shape, of those nearest to the middle of a site, from which its farthest corner is the least far.
    fn single(&mut self, site: &Site, near: &[NodeId]) -> Option<Single> {
        let middle = middle(site);
        let mut queue = BinaryHeap::new();
        for &id in near.iter().take(MOST_SINGLE) {
            queue.push(Reverse(Near { low: self.apart(Which::Second, &middle, id).low, id }));
        }
        let mut best: Option<Single> = None;
        let mut tried = 0;
        while let Some(Reverse(Near { low, id })) = queue.pop() {
            // The middle is as far from what is left as is told, and some corner is as far as the middle.
            if tried >= MOST_SINGLE || best.as_ref().is_some_and(|best| low >= best.high) {
                break;
            }
            if self.second.node(id).is_group() {
                for id in self.second.children(id) {
                    queue.push(Reverse(Near { low: self.apart(Which::Second, &middle, id).low, id }));
                }
                continue;
            }
            tried += 1;
            let body = &self.second.node(id).body;
            for along in &body.sites {
                let (far, corner) = farthest(site, along);
                if best.as_ref().is_none_or(|best| far + body.error < best.high) {
                    best = Some(Single { high: far + body.error, corner });
                }
            }
        }
        best
    }

    /// Parts of a site that may be farther than is good enough: of a triangle laid over those of the second shape, or halves.
    fn smaller(&mut self, site: &Site, high: f64, near: &[NodeId]) -> Vec<Site> {
        let good = self.low + self.enough_mm - self.slack;
        let thin = self.accuracy_mm.max(4.0 * self.slack);
        let Site::Triangle(triangle) = site else { return halves(site) };
        match self.below(site, high, near).and_then(|others| over(triangle, &others, thin, good)) {
            // Still whole: it is not over its nearest alone.
            Some(Overlay { rest, .. }) if rest == [*site] => halves(site),
            Some(Overlay { settled, rest }) => {
                self.settled = self.settled.max(settled + self.slack);
                rest
            }
            None => halves(site),
        }
    }

    /// The triangles of the second shape near a site no point of which is farther than `high`, the nearest to its middle first; nothing if they are many.
    fn below(&mut self, site: &Site, high: f64, near: &[NodeId]) -> Option<Vec<Below>> {
        let (middle, radius, _) = self.around(Part::Site(*site));
        let reach = high + radius + 2.0 * self.slack;
        let mut waiting = near.to_vec();
        let mut found = Vec::new();
        while let Some(id) = waiting.pop() {
            let low = self.apart(Which::Second, &middle, id).low;
            if low > reach {
                continue;
            }
            if self.second.node(id).is_group() {
                waiting.extend(self.second.children(id));
                continue;
            }
            let body = &self.second.node(id).body;
            for site in &body.sites {
                if let Site::Triangle(corners) = site {
                    found.push((low, id, Below { corners: *corners, error: body.error }));
                }
            }
            if found.len() > MOST_BELOW {
                return None;
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Some(found.into_iter().map(|(.., below)| below).collect())
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
    fn distance(&mut self, which: Which, c: &Point, radius: f64, near: &[NodeId]) -> (f64, f64, Vec<Near>) {
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
                done.push(Near { low, id });
                break;
            }
            let children = self.tree(which).children(id);
            if children.is_empty() {
                // As narrow as can be: others may still be nearer than this one surely is.
                least = least.min(low);
                done.push(Near { low, id });
                continue;
            }
            children.for_each(|child| self.enter(which, c, child, &mut queue, &mut high));
        }
        done.extend(queue.into_iter().map(|Reverse(near)| near));
        done.retain(|near| near.low <= high + 2.0 * (radius + self.slack));
        // In the order of their discovery, whatever that of the heap.
        done.sort();
        (least.min(high), high, done)
    }

    fn enter(&mut self, which: Which, c: &Point, id: NodeId, queue: &mut BinaryHeap<Reverse<Near>>, high: &mut f64) {
        let apart = self.apart(which, c, id);
        *high = high.min(apart.high);
        queue.push(Reverse(Near { low: apart.low, id }));
    }

    /// The distance of a point from a node lies in this interval.
    fn apart(&mut self, which: Which, c: &Point, id: NodeId) -> Interval {
        self.looked += 1;
        let slack = self.slack;
        let tree = self.tree(which);
        let gap = Body::of_site(Site::Point(*c), Nature::Loose).gap(&tree.node(id).body, slack);
        let slab = gap.direction.map_or(0.0, |n| -tree.reach(id, &n.map(|x| -x)) - n.iter().zip(c).map(|(n, c)| n * c).sum::<f64>());
        Interval { low: gap.low.max(slab - slack), high: gap.high }
    }

    fn tree(&mut self, which: Which) -> &mut Tree<'a> {
        match which {
            Which::First => &mut self.first,
            Which::Second => &mut self.second,
        }
    }
}

/// A site of the second shape, against one of the first.
struct Single {
    /// How far the farthest corner is from it, and from the second shape at most.
    high: f64,
    corner: Point,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Progress;
    use std::sync::{Arc, mpsc};

    #[test]
    fn one_direction_is_heard_before_the_other() {
        let heard: Arc<Mutex<Vec<Progress>>> = Arc::default();
        let (begun, other) = mpsc::channel();
        let listener = Arc::clone(&heard);
        // Who hears of the first direction is slow, and the second is done meanwhile.
        let sink = move |progress: &Progress| {
            if progress.bound_mm.is_none() {
                begun.send(()).unwrap();
                (0..100_000).for_each(|_| std::thread::yield_now());
            }
            listener.lock().unwrap().push(progress.clone());
        };
        let budget = Budget { progress: Some(Arc::new(sink)), ..Budget::default() };
        let known = Known::default();
        let interval = Interval { low: 1.0, high: 3.0 };
        std::thread::scope(|scope| {
            scope.spawn(|| known.tell(0, 4, interval, &budget));
            other.recv().unwrap();
            known.tell(1, 5, interval, &budget);
        });
        let heard: Vec<_> = heard.lock().unwrap().iter().map(|told| (told.count, told.bound_mm)).collect();
        assert_eq!(heard, [(4, None), (9, Some(2.0))]);
    }
}
