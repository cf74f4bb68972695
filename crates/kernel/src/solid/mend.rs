//! What rounding to single precision does to a closed surface, mended: vertices that fall together, triangles that lose their area, slivers that are folded
//! over their neighbours.
//!
//! Joining vertices at one place and turning the edges of triangles without area leave the surface as a set what it is. What is left is moved by a few steps of
//! single precision, see [`NUDGE`].

use super::around::{Around, close_up};
use super::box_tree::{Box32, BoxTree};
use super::contact;
use super::half_edges::{HalfEdges, NONE, Star, kept, next};
use super::normals::{Normals, normal_box};
use super::topology::has_no_area;
use super::{Crossings, TriMesh};
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract};
use crate::budget::{Budget, Stopped};
use glam::DVec3;
use std::collections::{BTreeSet, HashSet};

/// How far vertices are moved that leave a triangle without area, or triangles that cross, in units of rounding: [`MOST_STEPS`] of single precision along each axis.
pub(crate) const NUDGE: f64 = 2.0 * MOST_STEPS as f64;
const MOST_STEPS: u32 = 4;
/// How far corners are moved to make them one, which may have been moved by a step before.
const GATHERED: f64 = NUDGE - 2.0;
/// Triangles around a vertex that is joined with another, at most.
pub(crate) const MOST_AROUND: usize = 24;
/// Triangles around a vertex afterwards.
const MOST_AFTER: usize = 40;
/// Triangles of less height than this are slivers, in units of rounding.
pub(crate) const LEAST_HEIGHT: f64 = 8.0;
/// Pairs of crossing triangles that are looked at.
const MOST_PARTED: usize = 10_000;
/// Sweeps that turn edges, at most.
const FLIP_ROUNDS: usize = 8;
/// Sweeps that part crossing triangles, at most: the first leaves next to nothing.
const PART_ROUNDS: usize = 4;

/// A mended surface.
pub(crate) struct Mended {
    pub(crate) points: Vec<Point>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Pairs of triangles that still meet elsewhere than in corners and edges they share.
    pub(crate) crossings: u64,
}

/// Mends a surface whose coordinates are single-precision numbers; `rounding` is what a position may have lost.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn mend(points: Vec<Point>, triangles: Vec<[u32; 3]>, rounding: f64, budget: &Budget) -> Result<Mended, Stopped> {
    let mut mender = Mender::default();
    let mut surface = Surface { points, triangles, moved: HashSet::new() };
    surface.clean(&mut mender, rounding);
    let found = surface.crossings(budget)?;
    let mut crossings = found.count;
    if crossings > 0 {
        let mut other = surface.clone();
        crossings = surface.part(&mut mender, found.clone(), rounding, budget)?;
        if crossings > 0 && other.gather(&mut mender, &found, rounding) {
            let found = other.crossings(budget)?;
            let left = other.part(&mut mender, found, rounding, budget)?;
            if left < crossings {
                (surface, crossings) = (other, left);
            }
        }
    }
    let Surface { mut points, mut triangles, .. } = surface;
    drop_unused(&mut points, &mut triangles);
    Ok(Mended { points, triangles, crossings })
}

/// A surface, and its vertices that were moved.
#[derive(Clone)]
struct Surface {
    points: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    moved: HashSet<u32>,
}

impl Surface {
    /// Makes vertices at one place one, and gives triangles area.
    fn clean(&mut self, mender: &mut Mender, rounding: f64) {
        let corners_of = |triangle: &[u32; 3]| triangle.map(|corner| self.points[corner as usize]);
        let slivers = self.triangles.iter().filter(|triangle| is_sliver(&corners_of(triangle), LEAST_HEIGHT * rounding));
        let corners: HashSet<u32> = slivers.flatten().copied().collect();
        if corners.is_empty() {
            return;
        }
        let mut around = self.around(mender, &corners, rounding);
        let Around { mesh, is_whole, .. } = &mut around;
        mender.clean(mesh, is_whole, &vec![false; mesh.points.len()], rounding);
        let mut nudged = BTreeSet::new();
        mender.nudge(mesh, &mut nudged);
        self.write(around, &nudged);
    }

    /// Its crossings.
    fn crossings(&mut self, budget: &Budget) -> Result<Crossings, Stopped> {
        // The mesh is lent.
        let vertices = std::mem::take(&mut self.points).into_iter().map(DVec3::from_array).collect();
        let mesh = TriMesh { vertices, triangles: std::mem::take(&mut self.triangles) };
        let found = Crossings::among(&mesh, MOST_PARTED, budget);
        self.points = mesh.vertices.into_iter().map(|vertex| vertex.to_array()).collect();
        self.triangles = mesh.triangles;
        found
    }

    /// Parts triangles that cross, see [`Mender::part`]; how many pairs still do.
    fn part(&mut self, mender: &mut Mender, mut found: Crossings, rounding: f64, budget: &Budget) -> Result<u64, Stopped> {
        for _ in 0..PART_ROUNDS {
            if found.count == 0 {
                break;
            }
            let corners = found.corners(&self.triangles);
            let mut around = self.around(mender, &corners, rounding);
            let Around { mesh, numbers, .. } = &mut around;
            let those = |wanted: &HashSet<u32>| {
                (0..).zip(numbers.iter()).filter(|(_, number)| wanted.contains(number)).map(|(vertex, _)| vertex).collect()
            };
            let (tried, mut own) = (those(&corners), those(&self.moved));
            let changed = mender.part(mesh, &tried, rounding, &mut own);
            self.write(around, &own);
            if !changed {
                break;
            }
            found = self.crossings(budget)?;
        }
        Ok(found.count)
    }

    /// Makes corners of triangles that cross one with what is near, see [`Mender::gather`]; whether there is such.
    fn gather(&mut self, mender: &mut Mender, found: &Crossings, rounding: f64) -> bool {
        let corners = found.corners(&self.triangles);
        let mut around = self.around(mender, &corners, rounding);
        let Around { mesh, numbers, is_whole, .. } = &mut around;
        let gathered = mender.gather(mesh, is_whole, |vertex| corners.contains(&numbers[vertex as usize]), rounding);
        mender.clean(mesh, is_whole, &vec![false; mesh.points.len()], rounding);
        let is_changed = !gathered.is_empty();
        self.write(around, &gathered);
        is_changed
    }

    /// The part around some corners, with which the mender begins.
    fn around(&self, mender: &mut Mender, corners: &HashSet<u32>, rounding: f64) -> Around {
        let around = Around::of(&self.points, &self.triangles, corners, NUDGE * rounding);
        mender.start(&around.mesh);
        around
    }

    /// Puts a part back, of which some vertices were moved.
    fn write(&mut self, around: Around, moved: &BTreeSet<u32>) {
        self.moved.extend(moved.iter().map(|&vertex| around.numbers[vertex as usize]));
        let numbers = around.write(&mut self.points, &mut self.triangles);
        renumber(&mut self.moved, &numbers);
    }
}

/// Gives vertices their new numbers, without those that are gone.
fn renumber(vertices: &mut HashSet<u32>, numbers: &[u32]) {
    *vertices = vertices.iter().map(|&vertex| numbers[vertex as usize]).filter(|&vertex| vertex != NONE).collect();
}

/// Removes vertices that no triangle has.
fn drop_unused(points: &mut Vec<Point>, triangles: &mut [[u32; 3]]) {
    let mut numbers = vec![NONE; points.len()];
    triangles.iter().flatten().for_each(|&corner| numbers[corner as usize] = 0);
    if numbers.contains(&NONE) {
        close_up(points, triangles, &mut numbers);
    }
}

/// A triangle that is compared with others.
pub(super) struct Facet {
    corners: [u32; 3],
    points: [Point; 3],
    bounds: Box32,
    /// Along the normal, and what a volume may err per length.
    normal: Point,
    error: f64,
}

impl Facet {
    pub(super) fn new(corners: [u32; 3], points: [Point; 3]) -> Self {
        let (p, q) = (subtract(&points[1], &points[0]), subtract(&points[2], &points[0]));
        // Products of two lengths, at most 8 roundings each, and three sums.
        let error = 64.0 * f64::EPSILON * (dot(&p, &p) + dot(&q, &q));
        Self { corners, points, bounds: Box32::of(&points), normal: cross(&p, &q), error }
    }

    /// Whether a plane surely parts the triangle from what another has besides common corners: its own, or one through an edge and the normal.
    /// Both have a corner that is not common.
    #[inline]
    pub(super) fn parts(&self, corners: &[u32; 3], points: &[Point; 3]) -> bool {
        self.has_on_one_side(corners.iter().copied().zip(points.iter().copied())) || (0..3).any(|k| self.is_beyond(k, corners, points))
    }

    /// Whether points are surely all above the triangle's plane, or all below, but for its own corners.
    fn has_on_one_side(&self, points: impl Iterator<Item = (u32, Point)>) -> bool {
        let (mut above, mut below) = (true, true);
        for (_, point) in points.filter(|(corner, _)| !self.corners.contains(corner)) {
            let offset = subtract(&point, &self.points[0]);
            let side = dot(&self.normal, &offset);
            let error = self.error * (offset[0].abs() + offset[1].abs() + offset[2].abs());
            above &= side > error;
            below &= side < -error;
        }
        above || below
    }

    /// Whether another triangle lies beyond edge k, but for common corners on that edge. The vector m = edge x normal is exact to 16 roundings of
    /// |edge| |normal|, products with it to 32 with |offset|; with exact m the triangle itself has no positive value, and 0 only on the edge.
    fn is_beyond(&self, k: usize, corners: &[u32; 3], points: &[Point; 3]) -> bool {
        if corners.contains(&self.corners[(k + 2) % 3]) {
            return false;
        }
        let (start, end) = (self.corners[k], self.corners[(k + 1) % 3]);
        let edge = subtract(&self.points[(k + 1) % 3], &self.points[k]);
        let outwards = cross(&edge, &self.normal);
        let error = self.error * (edge[0].abs() + edge[1].abs() + edge[2].abs());
        corners.iter().zip(points).filter(|&(&corner, _)| corner != start && corner != end).all(|(_, point)| {
            let offset = subtract(point, &self.points[k]);
            dot(&outwards, &offset) > error * (offset[0].abs() + offset[1].abs() + offset[2].abs())
        })
    }
}

/// What is done with a corner of crossing triangles.
enum Step {
    To(Point),
    /// Joined with this one of the ring.
    Into(usize),
}

/// Working memory of a thread.
#[derive(Default)]
pub(crate) struct Mender {
    /// The star of the vertex that was looked at last.
    pub(crate) star: Star,
    other: Star,
    boxes: BoxTree,
    normals: Normals,
    /// Triangles when the boxes were made.
    boxed: usize,
    /// Triangles lower than what rounding moves, as they were met last.
    pub(crate) slivers: Vec<u32>,
    stamps: Vec<u32>,
    stamp: u32,
    /// Triangles of a star, old or new, their corners, and the boxes of their normals.
    own: Vec<Facet>,
    places: Vec<(u32, Point)>,
    turned: Vec<Box32>,
}

impl Mender {
    /// Begins with a mesh.
    pub(crate) fn start(&mut self, mesh: &HalfEdges) {
        self.stamps.clear();
        self.stamps.resize(mesh.points.len(), 0);
        self.stamp = 0;
    }

    /// Joins vertices at the same place, and turns edges of triangles without area, while that changes anything; only triangles whose corners are all `inside` become others.
    pub(crate) fn clean(&mut self, mesh: &mut HalfEdges, inside: &[bool], settled: &[bool], rounding: f64) {
        for _ in 0..FLIP_ROUNDS {
            let merged = self.merge(mesh, inside, settled);
            if !self.flip(mesh, inside, rounding) && !merged {
                break;
            }
        }
    }

    /// Makes vertices at the same place one where that keeps the manifold: the surface as a set does not change. Whether there were such.
    fn merge(&mut self, mesh: &mut HalfEdges, inside: &[bool], settled: &[bool]) -> bool {
        let mut merged = false;
        for vertex in 0..mesh.points.len() as u32 {
            if !inside[vertex as usize]
                || settled[vertex as usize]
                || !mesh.star(vertex, MOST_AROUND, &mut self.star)
                || self.star.ring.iter().any(|&other| !inside[other as usize])
            {
                continue;
            }
            for m in 0..self.star.ring.len() {
                let target = self.star.ring[m];
                if mesh.points[target as usize] == mesh.points[vertex as usize] && self.keeps_manifold(mesh, m) {
                    mesh.collapse(vertex, &self.star, m);
                    merged = true;
                    break;
                }
            }
        }
        merged
    }

    /// Turns the longest edge of triangles without area, when that leaves none: the surface as a set does not change. Whether one was turned.
    fn flip(&mut self, mesh: &mut HalfEdges, inside: &[bool], rounding: f64) -> bool {
        let mut turned = false;
        self.slivers.clear();
        for triangle in 0..mesh.triangles() {
            let Some(corners) = mesh.triangle(triangle) else { continue };
            let points = corners.map(|corner| mesh.points[corner as usize]);
            if !corners.iter().all(|&corner| inside[corner as usize]) || !is_sliver(&points, LEAST_HEIGHT * rounding) {
                continue;
            }
            self.slivers.push(triangle);
            if !contact::is_flat(&points) {
                continue;
            }
            let length = |&k: &usize| distance_squared(&points[k], &points[(k + 1) % 3]);
            let Some(k) = (0..3).max_by(|p, q| length(p).total_cmp(&length(q))) else { continue };
            let half = 3 * triangle + k as u32;
            let twin = mesh.twin(half);
            if twin == NONE {
                continue;
            }
            let (a, b, c, d) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3], mesh.end(next(twin)));
            let at = |corner: u32| mesh.points[corner as usize];
            if !inside[d as usize] || contact::is_flat(&[at(d), at(c), at(a)]) || contact::is_flat(&[at(c), at(d), at(b)]) {
                continue;
            }
            if mesh.star(c, usize::MAX, &mut self.other) && !self.other.ring.contains(&d) {
                mesh.flip(half);
                turned = true;
            }
        }
        turned
    }

    /// Gives what is left of triangles without area some, by moving corners by single steps of single precision, each at most once.
    fn nudge(&mut self, mesh: &mut HalfEdges, moved: &mut BTreeSet<u32>) {
        let is_flat = |mesh: &HalfEdges, triangle: u32| {
            mesh.triangle(triangle).is_some_and(|t| has_no_area(t.map(|corner| DVec3::from_array(mesh.points[corner as usize]))))
        };
        for triangle in 0..mesh.triangles() {
            if !is_flat(mesh, triangle) {
                continue;
            }
            'corners: for corner in mesh.triangle(triangle).into_iter().flatten() {
                if moved.contains(&corner) || !mesh.star(corner, usize::MAX, &mut self.star) {
                    continue;
                }
                let from = mesh.points[corner as usize];
                for code in 1..27 {
                    mesh.points[corner as usize] = stepped(&from, code, 1);
                    if !self.star.halves.iter().any(|&half| is_flat(mesh, half / 3)) {
                        moved.insert(corner);
                        break 'corners;
                    }
                }
                mesh.points[corner as usize] = from;
            }
        }
    }

    /// Parts triangles that cross by moving their corners by a few steps of single precision, each at most once: slivers that rounding folds over their neighbours.
    /// A corner that no step frees is joined with a neighbour as near as that. Whether anything was changed.
    fn part(&mut self, mesh: &mut HalfEdges, corners: &BTreeSet<u32>, rounding: f64, moved: &mut BTreeSet<u32>) -> bool {
        self.index(mesh);
        let mut changed = false;
        for &corner in corners {
            if moved.contains(&corner) || !mesh.is_used(corner) || !mesh.star(corner, usize::MAX, &mut self.star) {
                continue;
            }
            let before = self.meetings(mesh, corner, None, None, usize::MAX);
            if before == 0 {
                continue;
            }
            let from = mesh.points[corner as usize];
            let (mut least, mut best) = (before, None);
            for (steps, code) in (0..MOST_STEPS.ilog2() + 1).flat_map(|power| (1..27).map(move |code| (1 << power, code))) {
                if least == 0 {
                    break;
                }
                let to = stepped(&from, code, steps);
                let met = self.meetings(mesh, corner, None, Some(to), least - 1);
                if met < least {
                    (least, best) = (met, Some(Step::To(to)));
                }
            }
            for m in 0..self.star.ring.len() {
                let near = distance_squared(&from, &mesh.points[self.star.ring[m] as usize]) <= (NUDGE * rounding).powi(2);
                if least > 0 && near && self.keeps_manifold(mesh, m) {
                    let met = self.meetings(mesh, corner, Some(m), None, least - 1);
                    if met < least {
                        (least, best) = (met, Some(Step::Into(m)));
                    }
                }
            }
            match best {
                Some(Step::To(to)) => mesh.points[corner as usize] = to,
                Some(Step::Into(m)) => mesh.collapse(corner, &self.star, m),
                None => continue,
            }
            moved.insert(corner);
            self.place(mesh);
            changed = true;
        }
        changed
    }

    /// Brings corners to the place of one that they are within [`GATHERED`] roundings of: where a surface passes so near to a vertex of the lattice, all that is around it is no more than that. Those that are no more to be moved: each was moved once at most, besides by [`Mender::nudge`].
    fn gather(&mut self, mesh: &mut HalfEdges, inside: &[bool], is_wanted: impl Fn(u32) -> bool, rounding: f64) -> BTreeSet<u32> {
        let mut done = BTreeSet::new();
        for first in 0..mesh.points.len() as u32 {
            if !is_wanted(first) || done.contains(&first) {
                continue;
            }
            let place = mesh.points[first as usize];
            let (mut open, mut near) = (vec![first], BTreeSet::from([first]));
            while let Some(vertex) = open.pop() {
                if !mesh.star(vertex, MOST_AROUND, &mut self.star) {
                    continue;
                }
                for &other in &self.star.ring {
                    let is_near = distance_squared(&place, &mesh.points[other as usize]) <= (GATHERED * rounding).powi(2);
                    if is_near && inside[other as usize] && !done.contains(&other) && near.insert(other) {
                        open.push(other);
                    }
                }
            }
            if near.len() > 1 {
                near.iter().for_each(|&vertex| mesh.points[vertex as usize] = place);
                done.append(&mut near);
            }
        }
        done
    }

    /// Lists the boxes of all triangles for [`Mender::meetings`].
    pub(crate) fn index(&mut self, mesh: &HalfEdges) {
        self.boxed = mesh.alive;
        let at = |triangle| mesh.triangle(triangle).map(|corners| corners.map(|corner| mesh.points[corner as usize]));
        self.boxes.build(mesh.triangles() as usize, |triangle| at(triangle).map(|points| Box32::of(&points)), false);
        self.normals.build(&self.boxes, |triangle| at(triangle).map(|points| normal_box(&points)));
    }

    /// Lists the boxes anew when half of the triangles are gone.
    pub(crate) fn keep_index(&mut self, mesh: &HalfEdges) {
        if mesh.alive < self.boxed / 2 {
            self.index(mesh);
        }
    }

    /// Gives the triangles of the star the boxes of where they are now.
    pub(crate) fn place(&mut self, mesh: &HalfEdges) {
        for &half in &self.star.halves {
            if let Some(corners) = mesh.triangle(half / 3) {
                let points = corners.map(|corner| mesh.points[corner as usize]);
                self.boxes.set(half / 3, &Box32::of(&points));
                self.normals.add(&self.boxes, half / 3, &normal_box(&points));
            }
        }
    }

    /// The link condition (Dey, Edelsbrunner, Guha and Nekhayev, "Topology preserving edge contraction", 1999): the ends have no common neighbours
    /// but the two across the edge.
    pub(crate) fn keeps_manifold(&mut self, mesh: &HalfEdges, m: usize) -> bool {
        let target = self.star.ring[m];
        if !mesh.star(target, MOST_AFTER, &mut self.other) {
            return false;
        }
        let (own, others) = (self.star.ring.len(), self.other.ring.len());
        if own + others > MOST_AFTER || (own == 3 && others == 3) {
            return false;
        }
        self.stamp += 1;
        for &neighbour in &self.star.ring {
            self.stamps[neighbour as usize] = self.stamp;
        }
        self.other.ring.iter().filter(|&&neighbour| self.stamps[neighbour as usize] == self.stamp).count() == 2
    }

    /// Whether the star's vertex may move to ring m, or elsewhere, without that anything comes to meet: surely, see `normals`. Where this cannot tell, [`Mender::meetings`] can.
    pub(crate) fn stays_graph(&mut self, mesh: &HalfEdges, vertex: u32, m: Option<usize>, to: Option<Point>) -> bool {
        let Self { star, turned, .. } = self;
        let (ring, count) = (&star.ring, star.ring.len());
        let point = |corner: u32| mesh.points[corner as usize];
        let apex = to.unwrap_or_else(|| point(m.map_or(vertex, |m| ring[m])));
        turned.clear();
        turned.extend(kept(m, count).map(|k| normal_box(&[apex, point(ring[k]), point(ring[(k + 1) % count])])));
        let to = to.map(|to| (NONE, to));
        let hull = ring.iter().chain([&vertex]).map(|&corner| (corner, point(corner))).chain(to);
        let other = |triangle| mesh.triangle(triangle).filter(|corners| !corners.contains(&vertex)).map(|corners| corners.map(point));
        let is_beside = |triangle, points: &[Point; 3]| {
            mesh.triangle(triangle).is_some_and(|corners| Facet::new(corners, *points).has_on_one_side(hull.clone()))
        };
        self.normals.face_one_way(&self.boxes, hull.clone().map(|(_, point)| point), turned, other, is_beside)
    }

    /// Counts pairs of a triangle of the star, old or after moving to ring m or elsewhere, and another that meet; gives up above `most`.
    pub(crate) fn meetings(&mut self, mesh: &HalfEdges, vertex: u32, m: Option<usize>, to: Option<Point>, most: usize) -> usize {
        debug_assert!(m.is_none() || to.is_none(), "a vertex moves to one place");
        let Self { star, boxes, own, places, .. } = self;
        let count = star.ring.len();
        let apex = m.map_or(vertex, |m| star.ring[m]);
        let point = |corner: u32| mesh.points[corner as usize];
        places.clear();
        places.extend(star.ring.iter().map(|&corner| (corner, point(corner))));
        if m.is_none() {
            places.push((vertex, to.unwrap_or_else(|| point(vertex))));
        }
        own.clear();
        let mut whole = Box32::EMPTY;
        for k in kept(m, count) {
            let corners = [apex, star.ring[k], star.ring[(k + 1) % count]];
            let mut points = corners.map(point);
            points[0] = to.unwrap_or(points[0]);
            let facet = Facet::new(corners, points);
            whole = whole.union(&facet.bounds);
            own.push(facet);
        }
        let mut found = 0;
        for (index, facet) in own.iter().enumerate() {
            found += usize::from(contact::is_flat(&facet.points));
            for other in &own[..index] {
                let parted = facet.parts(&other.corners, &other.points);
                found += usize::from(!parted && contact::meet([&facet.corners, &other.corners], [&facet.points, &other.points]));
            }
        }
        if found > most {
            return found;
        }
        boxes.query(&whole, 0, |leaf| {
            for (&triangle, bounds) in boxes.items(leaf).iter().zip(boxes.boxes(leaf)) {
                let mut near = own.iter().filter(|facet| facet.bounds.meets(bounds)).peekable();
                if near.peek().is_none() {
                    continue;
                }
                let Some(corners) = mesh.triangle(triangle) else { continue };
                if corners.contains(&vertex) {
                    continue;
                }
                let points = corners.map(point);
                // What lies to one side of its plane meets it in common corners and edges only.
                if Facet::new(corners, points).has_on_one_side(places.iter().copied()) {
                    continue;
                }
                let met =
                    |facet: &&Facet| !facet.parts(&corners, &points) && contact::meet([&corners, &facet.corners], [&points, &facet.points]);
                for _ in near.filter(met) {
                    found += 1;
                    if found > most {
                        return false;
                    }
                }
            }
            true
        });
        found
    }
}

/// A point moved by some steps of single precision along the axes that a code of three digits names.
fn stepped(from: &Point, code: usize, steps: u32) -> Point {
    std::array::from_fn(|axis| {
        let step = [|x: f32| x, f32::next_up, f32::next_down][code / [1, 3, 9][axis] % 3];
        f64::from((0..steps).fold(from[axis] as f32, |x, _| step(x)))
    })
}

/// Whether a triangle's least height is below `least`.
pub(crate) fn is_sliver(points: &[Point; 3], least: f64) -> bool {
    let normal = cross(&subtract(&points[1], &points[0]), &subtract(&points[2], &points[0]));
    let longest = (0..3).map(|k| distance_squared(&points[k], &points[(k + 1) % 3])).fold(0.0, f64::max);
    dot(&normal, &normal) <= least * least * longest
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// How many pairs of triangles cross.
    fn crossings(points: &[Point], triangles: &[[u32; 3]]) -> u64 {
        let mesh = TriMesh { vertices: points.iter().copied().map(DVec3::from_array).collect(), triangles: triangles.to_vec() };
        Crossings::of(&mesh, &Budget::default()).unwrap().count
    }

    /// A torus of squares halved, its corners in single precision.
    fn torus(around: u32, along: u32) -> (Vec<Point>, Vec<[u32; 3]>) {
        let at = |i: u32, j: u32| {
            let (u, v) = (TAU * f64::from(i) / f64::from(around), TAU * f64::from(j) / f64::from(along));
            let ring = 30.0 + 10.0 * v.cos();
            [ring * u.cos() + 61.7, ring * u.sin() + 83.1, 10.0 * v.sin() + 47.9].map(|x| f64::from(x as f32))
        };
        let number = |i: u32, j: u32| (i % around) * along + j % along;
        let squares = (0..around).flat_map(|i| (0..along).map(move |j| (i, j)));
        let triangles = squares.clone().flat_map(|(i, j)| {
            let [a, b, c, d] = [number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)];
            [[a, b, c], [a, c, d]]
        });
        (squares.clone().map(|(i, j)| at(i, j)).collect(), triangles.collect())
    }

    /// Corners that fall within a few steps of a neighbour, in any order, fold their triangles over others: all are parted, and nothing moves farther than is told.
    #[test]
    fn folds_of_a_few_steps_are_parted() {
        let (around, along) = (24, 12);
        let budget = Budget::default();
        let mut folded = 0;
        for seed in 0..200_u32 {
            let (mut points, triangles) = torus(around, along);
            let mut random = u64::from(seed);
            let mut below = |most: u64| {
                random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (random >> 33) % most
            };
            for k in 0..4 {
                let (i, j) = (6 * k + below(3) as u32, below(u64::from(along)) as u32);
                let place = |i: u32, j: u32| ((i % around) * along + j % along) as usize;
                let to = points[place(i, j)];
                for vertex in [place(i + 1, j), place(i, j + 1), place(i + 1, j + 1)] {
                    points[vertex] = stepped(&to, below(27) as usize, 1 + below(2) as u32);
                }
            }
            let extent = points.iter().flatten().fold(0.0_f64, |largest, x| largest.max(x.abs()));
            let rounding = super::super::rounding(extent);
            let before = crossings(&points, &triangles);
            folded += usize::from(before > 0);
            let mended = mend(points.clone(), triangles.clone(), rounding, &budget).unwrap();
            assert_eq!(mended.crossings, 0, "seed {seed}, {before} before");
            for point in &mended.points {
                let nearest = points.iter().map(|old| distance_squared(old, point)).fold(f64::INFINITY, f64::min).sqrt();
                assert!(nearest <= NUDGE * rounding, "seed {seed}: {nearest}");
            }
        }
        assert!(folded > 150, "{folded} of the meshes had folds");
    }

    /// Vertices with so many triangles around them that are no more than rounding that moving corner by corner does not part them: they are made one, and no vertex is farther from where it was than is told.
    #[test]
    fn what_is_no_more_than_rounding_is_made_one() {
        let (around, along) = (24, 12);
        let budget = Budget::default();
        let (mut stuck, mut left) = (0, 0);
        for seed in 0..100_u32 {
            let (mut points, mut triangles) = torus(around, along);
            let whole = triangles.len();
            let mut random = u64::from(seed);
            let mut below = |most: u64| {
                random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (random >> 33) % most
            };
            for k in 0..3 {
                let middle = (8 * k + below(5) as u32) * along + below(u64::from(along)) as u32;
                let place = points[middle as usize];
                let mesh = HalfEdges::new(points.clone(), &triangles);
                let mut star = Star::default();
                assert!(mesh.star(middle, usize::MAX, &mut star));
                let (count, first) = (star.ring.len() as u32, points.len() as u32);
                triangles.retain(|triangle| !triangle.contains(&middle));
                // Two more rings, hardly around the vertex.
                points.extend((0..2 * count).map(|_| stepped(&place, below(27) as usize, 1 + below(2) as u32)));
                for k in 0..count {
                    let next = (k + 1) % count;
                    let [from, to] = [k, next].map(|k| star.ring[k as usize]);
                    let [[a, b], [c, d]] = [first, first + count].map(|ring| [ring + k, ring + next]);
                    triangles.extend([[a, from, to], [a, to, b], [c, a, b], [c, b, d], [middle, c, d]]);
                }
            }
            let rounding = super::super::rounding(points.iter().flatten().fold(0.0_f64, |largest, x| largest.max(x.abs())));
            let mut alone = Surface { points: points.clone(), triangles: triangles.clone(), moved: HashSet::new() };
            alone.clean(&mut Mender::default(), rounding);
            let found = alone.crossings(&budget).unwrap();
            let without = alone.part(&mut Mender::default(), found, rounding, &budget).unwrap();
            let mended = mend(points.clone(), triangles.clone(), rounding, &budget).unwrap();
            stuck += usize::from(without > 0);
            left += usize::from(mended.crossings > 0);
            assert!(mended.crossings <= without && mended.triangles.len() >= whole, "seed {seed}");
            for point in &mended.points {
                let nearest = points.iter().map(|old| distance_squared(old, point)).fold(f64::INFINITY, f64::min).sqrt();
                assert!(nearest <= NUDGE * rounding, "seed {seed}: {nearest}");
            }
        }
        assert!(stuck > 4 && left == 0, "{stuck} stuck, {left} left");
    }

    /// Of moves that are said to keep an embedded surface a graph none makes triangles meet, and most that make none meet are seen to: on thin and on rough tori.
    #[test]
    fn what_stays_a_graph_meets_nothing() {
        let (mut kept, mut met, mut free) = (0, 0, 0);
        for seed in 0..60_u32 {
            let (around, along) = (12 + seed % 17, 5 + seed % 9);
            let (mut points, triangles) = torus(around, along);
            let mut random = u64::from(seed);
            let mut share = || {
                random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (random >> 40) as f64 / f64::from(1 << 24) - 0.5
            };
            let rough = f64::from(seed % 5);
            points.iter_mut().for_each(|point| *point = point.map(|x| f64::from((x + rough * share()) as f32)));
            if crossings(&points, &triangles) > 0 {
                continue;
            }
            let mesh = HalfEdges::new(points, &triangles);
            let mut mender = Mender::default();
            mender.start(&mesh);
            mender.index(&mesh);
            for vertex in 0..mesh.points.len() as u32 {
                assert!(mesh.star(vertex, MOST_AROUND, &mut mender.star));
                let to = mesh.points[vertex as usize].map(|x| f64::from((x + 24.0 * share()) as f32));
                let moves = (0..mender.star.ring.len()).map(|m| (Some(m), None)).chain([(None, Some(to))]);
                for (m, to) in moves {
                    if m.is_some_and(|m| !mender.keeps_manifold(&mesh, m)) {
                        continue;
                    }
                    let stays = mender.stays_graph(&mesh, vertex, m, to);
                    let meets = mender.meetings(&mesh, vertex, m, to, usize::MAX) > 0;
                    assert!(!(stays && meets), "seed {seed}, vertex {vertex} to {m:?} or {to:?}");
                    (kept, met, free) = (kept + usize::from(stays), met + usize::from(meets), free + usize::from(!meets));
                }
            }
        }
        assert!(met > 1_000 && 2 * kept > free, "{kept} of {free} are seen, {met} meet");
    }

    /// From the dilation of a Hilbert curve: two corners at one place cannot become one while a third, one step away, is joined to both.
    #[test]
    fn corners_at_one_place_are_parted_by_joining_what_is_between() {
        let points = [
            [82.304_603_576_660_16, 73.996_109_008_789_06, 98.451_995_849_609_38],
            [82.401_863_098_144_53, 72.867_607_116_699_22, 98.354_736_328_125],
            [81.546_058_654_785_16, 72.867_607_116_699_22, 98.354_736_328_125],
            [82.401_855_468_75, 72.867_607_116_699_22, 98.354_736_328_125],
            [82.401_863_098_144_53, 72.867_607_116_699_22, 98.354_736_328_125],
            [82.271_751_403_808_6, 72.613_159_179_687_5, 98.484_848_022_460_94],
            [82.526_199_340_820_31, 72.867_607_116_699_22, 98.354_736_328_125],
            // Closes it from far away.
            [82.25, 73.25, 103.0],
        ];
        let around = [[0, 1, 2], [0, 3, 1], [0, 4, 3], [1, 3, 4], [5, 1, 6], [2, 1, 5], [4, 0, 6], [1, 4, 6]];
        let closing = [[6, 0, 7], [5, 6, 7], [2, 5, 7], [0, 2, 7]];
        let triangles: Vec<[u32; 3]> = around.into_iter().chain(closing).collect();
        let mended = mend(points.to_vec(), triangles, super::super::rounding(103.0), &Budget::default()).unwrap();
        assert_eq!(mended.crossings, 0);
        assert!(mended.points.len() < points.len(), "a corner is joined");
    }
}
