//! Fewer triangles within the promise: edges are collapsed into one of their ends while the surface keeps its certificate.
//!
//! Let s < reach be such that D_s(S) is in the solid M and M is in D_reach(S), for the convex sites S_i, with the boundary of M an embedded surface
//! in s <= d <= reach. Removing a vertex v by moving it to a neighbour w replaces its star by triangles (w, a, b); between old and new lie the
//! tetrahedra (v, w, a, b) that it sweeps. When the new surface is embedded too, M and the new M' differ only within these. So M' is in D_reach(S) when
//! the sites cover the tetrahedra. Let the new triangles keep s from all sites: then no boundary, old or new, meets the
//! open D_s(S_i), which is connected, so it lies in M' unless all of it lies in M but not in M', that is in the tetrahedra. It contains a ball of
//! radius s, and each tetrahedron lies between two planes as far apart as one of its heights: planks
//! that cover a ball have widths that sum up to its diameter at least (Bang, "A solution of the plank problem", 1951), so a sum of heights below 2 s
//! is enough.
//!
//! Nodes of the octree do this from the blocks up. A node may remove vertices whose star lies in the box where all of the surface is its own, and there
//! no other node's triangles are; the hull of the star holds all that moves. Positions are single-precision numbers from the start, so
//! that what is checked is what is written.

use super::block::BlockSurface;
use super::certificate::{Nearby, Places};
use super::half_edges::{HalfEdges, NONE, Star, next};
use super::plan::Setting;
use super::tree::{Candidates, Tree};
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract};
use crate::attractor::sites::SiteRule;
use crate::budget::{Budget, Stopped};
use crate::solid::box_tree::{Box32, BoxTree};
use crate::solid::contact;
use crate::solid::topology::has_no_area;
use crate::solid::{Crossings, TriMesh};
use glam::DVec3;
use std::collections::BTreeSet;

/// Where a node's surface is its own.
#[derive(Clone, Copy, Debug)]
pub(super) struct Core {
    pub(super) low: Point,
    pub(super) high: Point,
}

impl Core {
    #[inline]
    pub(super) fn contains(&self, x: &Point) -> bool {
        (0..3).all(|axis| self.low[axis] < x[axis] && x[axis] < self.high[axis])
    }
}

/// How far vertices are moved that leave a triangle without area, or triangles that cross, in units of rounding: [`MOST_STEPS`] of single precision along each axis.
pub(super) const NUDGE: f64 = 2.0 * MOST_STEPS as f64;
const MOST_STEPS: u32 = 4;
/// Triangles around a vertex that may be removed, at most.
const MOST_AROUND: usize = 24;
/// Triangles around a vertex afterwards.
const MOST_AFTER: usize = 40;
/// How far the new position may be from the planes of the old triangles, in units of the band, pass by pass.
const PASSES: [f64; 6] = [1e-6, 0.01, 0.05, 0.12, 0.3, 2.0];
/// Before this pass vertices are lifted.
const LIFT_BEFORE: usize = 4;
/// The share of an edge's length that is added: where all is flat, short edges go first.
const LENGTH_SHARE: f64 = 1e-3;
/// Cosine of the angle by which a normal may turn.
const LEAST_COSINE: f64 = 0.1;
/// Heights of new triangles in units of rounding, and lengths of edges that are as good as none.
const LEAST_HEIGHT: f64 = 8.0;
const TINY: f64 = 4.0;
/// How far vertices of slivers may move off their planes, in units of rounding, where nothing else is simplified.
const SLIVER_MOVE: f64 = 64.0;
/// Vertices are lifted by this share of the band at least, and no normal turns by more than this cosine.
const LEAST_LIFT: f64 = 0.05;
const LEAST_TURN: f64 = 0.7;
/// Sites are looked for as far as triangles need whose smallest balls have this radius in units of the pitch.
const FIRST_LOOK: f64 = 0.6;
/// Pairs of crossing triangles that are looked at.
const MOST_PARTED: usize = 10_000;
/// Sweeps that turn edges, at most.
const FLIP_ROUNDS: usize = 8;

/// A triangle that is compared with others.
struct Facet {
    corners: [u32; 3],
    points: [Point; 3],
    bounds: Box32,
    /// Along the normal, and what a volume may err per length.
    normal: Point,
    error: f64,
}

impl Facet {
    fn new(corners: [u32; 3], points: [Point; 3]) -> Self {
        let (p, q) = (subtract(&points[1], &points[0]), subtract(&points[2], &points[0]));
        // Products of two lengths, at most 8 roundings each, and three sums.
        let error = 64.0 * f64::EPSILON * (dot(&p, &p) + dot(&q, &q));
        Self { corners, points, bounds: Box32::of(&points), normal: cross(&p, &q), error }
    }

    /// Whether a plane surely parts the triangle from what another has besides common corners: its own, or one through an edge and the normal.
    #[inline]
    fn parts(&self, corners: &[u32; 3], points: &[Point; 3]) -> bool {
        let (mut above, mut below) = (true, true);
        for (corner, point) in corners.iter().zip(points) {
            if !self.corners.contains(corner) {
                let offset = subtract(point, &self.points[0]);
                let side = dot(&self.normal, &offset);
                let error = self.error * (offset[0].abs() + offset[1].abs() + offset[2].abs());
                above &= side > error;
                below &= side < -error;
            }
        }
        above || below || (0..3).any(|k| self.is_beyond(k, corners, points))
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

/// Working memory of a thread.
pub(super) struct Simplifier<'a> {
    tree: Tree<'a>,
    places: Places,
    nearby: Nearby,
    boxes: BoxTree,
    /// Triangles when the boxes were made.
    boxed: usize,
    star: Star,
    other: Star,
    choices: Vec<(f64, usize)>,
    normals: Vec<Point>,
    lengths: Vec<f64>,
    /// The least cost beyond the pass that was met when a vertex was ranked last.
    due: Vec<f64>,
    /// Triangles lower than what rounding moves, as they were met last.
    slivers: Vec<u32>,
    close: Vec<(u32, Box32)>,
    stamps: Vec<u32>,
    stamp: u32,
    /// Triangles of a star, old or new.
    own: Vec<Facet>,
    /// Only what cannot be a solid is removed.
    clean_only: bool,
}

impl<'a> Simplifier<'a> {
    pub(super) fn new(rule: &'a SiteRule<'a>, setting: &Setting) -> Self {
        Self {
            tree: Tree::new(rule, setting.slack, 4 * setting.cells),
            places: Places::default(),
            nearby: Nearby::default(),
            boxes: BoxTree::default(),
            boxed: 0,
            star: Star::default(),
            other: Star::default(),
            choices: Vec::new(),
            normals: Vec::new(),
            lengths: Vec::new(),
            due: Vec::new(),
            slivers: Vec::new(),
            close: Vec::new(),
            stamps: Vec::new(),
            stamp: 0,
            own: Vec::new(),
            clean_only: setting.clean_only,
        }
    }

    /// Simplifies a node's surface. Vertices that are `settled` are tried again only when something around them changes; all that could be
    /// tried become so.
    pub(super) fn run(&mut self, setting: &Setting, core: &Core, candidates: &Candidates, surface: &mut BlockSurface) {
        let starts = self.tree.reset(candidates);
        let edge = 2.0 * setting.lattice.pitch;
        let size = (0..3).map(|axis| core.high[axis] - core.low[axis]).fold(0.0, f64::max);
        let top = (size / edge).log2().ceil().max(0.0) as u32 + 1;
        self.places.reset(core.low, edge, top, starts);
        let mut mesh = HalfEdges::new(std::mem::take(&mut surface.vertices), &surface.triangles);
        let first_square = setting.least * setting.least + (FIRST_LOOK * setting.lattice.pitch).powi(2);
        self.nearby.reset(mesh.points.len(), setting.outer + setting.rounding, first_square);
        self.stamps.clear();
        self.stamps.resize(mesh.points.len(), 0);
        self.stamp = 0;
        let inside: Vec<bool> = mesh.points.iter().map(|point| core.contains(point)).collect();
        surface.settled.resize(mesh.points.len(), false);
        self.clean(setting, &mut mesh, &inside, &surface.settled);
        if self.clean_only {
            self.remove_slivers(setting, &mut mesh, &inside);
            self.write(&mut mesh, &inside, surface);
            return;
        }
        self.index(&mesh);
        // A settled vertex waits until something changes; `fresh` says that something did since its last trial.
        let mut fresh: Vec<bool> = surface.settled.iter().map(|settled| !settled).collect();
        self.due.clear();
        self.due.resize(mesh.points.len(), 0.0);
        let mut lower = 0.0;
        for (number, &pass) in PASSES.iter().enumerate() {
            if number == LIFT_BEFORE {
                self.lift_all(setting, core, &mut mesh, &inside, &mut fresh, &mut surface.settled);
            }
            let upper = pass * (setting.outer - setting.least);
            for vertex in 0..mesh.points.len() as u32 {
                if !inside[vertex as usize] || surface.settled[vertex as usize] || !mesh.is_used(vertex) {
                    continue;
                }
                let is_fresh = std::mem::take(&mut fresh[vertex as usize]);
                if !is_fresh && self.due[vertex as usize] > upper {
                    continue;
                }
                let from = if is_fresh { 0.0 } else { lower };
                if self.remove(setting, &mut mesh, &inside, vertex, from, upper) {
                    for &neighbour in &self.star.ring {
                        fresh[neighbour as usize] = true;
                        surface.settled[neighbour as usize] = false;
                    }
                    if mesh.alive < self.boxed / 2 {
                        self.index(&mesh);
                    }
                }
            }
            lower = upper;
        }
        self.write(&mut mesh, &inside, surface);
    }

    /// Removes vertices of the slivers that could not be turned: rounding to single precision may fold them over their neighbours, and these are the
    /// only crossings that a lattice's surface was seen to have.
    fn remove_slivers(&mut self, setting: &Setting, mesh: &mut HalfEdges, inside: &[bool]) {
        let slivers = std::mem::take(&mut self.slivers);
        if !slivers.is_empty() {
            self.due.clear();
            self.due.resize(mesh.points.len(), 0.0);
            self.index(mesh);
            let upper = (PASSES[0] * (setting.outer - setting.least)).max(SLIVER_MOVE * setting.rounding);
            for corner in slivers.iter().filter_map(|&triangle| mesh.triangle(triangle)).flatten().collect::<Vec<u32>>() {
                if inside[corner as usize] && mesh.is_used(corner) {
                    self.remove(setting, mesh, inside, corner, 0.0, upper);
                }
            }
        }
        self.slivers = slivers;
    }

    /// Moves vertices outwards to the end of the band where the distance is smooth: chords between them have the whole band then.
    fn lift_all(
        &mut self,
        setting: &Setting,
        core: &Core,
        mesh: &mut HalfEdges,
        inside: &[bool],
        fresh: &mut [bool],
        settled: &mut [bool],
    ) {
        for vertex in 0..mesh.points.len() as u32 {
            if inside[vertex as usize]
                && !settled[vertex as usize]
                && mesh.is_used(vertex)
                && self.lift(setting, core, mesh, inside, vertex)
            {
                for &changed in self.star.ring.iter().chain([&vertex]) {
                    fresh[changed as usize] = true;
                    settled[changed as usize] = false;
                }
            }
        }
    }

    fn lift(&mut self, setting: &Setting, core: &Core, mesh: &mut HalfEdges, inside: &[bool], vertex: u32) -> bool {
        if !mesh.star(vertex, MOST_AROUND, &mut self.star) || self.star.ring.iter().any(|&other| !inside[other as usize]) {
            return false;
        }
        let count = self.star.ring.len();
        let from = mesh.points[vertex as usize];
        let Some(foot) = self.nearby.foot(&mut self.tree, &mut self.places, vertex, &from) else { return false };
        let length = distance_squared(&from, &foot).sqrt();
        let to: Point = std::array::from_fn(|axis| f64::from((foot[axis] + (from[axis] - foot[axis]) * (setting.outer / length)) as f32));
        let moved = distance_squared(&from, &to).sqrt();
        // No height of a swept tetrahedron is more than the way.
        let worth = moved > LEAST_LIFT * (setting.outer - setting.least) && count as f64 * moved < 1.9 * setting.least;
        if self.tree.exhausted || !worth || !core.contains(&to) {
            return false;
        }
        let (ring, points) = (&self.star.ring, &mesh.points);
        let normal = |apex: &Point, k: usize| {
            let (a, b) = (&points[ring[k] as usize], &points[ring[(k + 1) % count] as usize]);
            cross(&subtract(a, apex), &subtract(b, apex))
        };
        let keeps_shape = (0..count).all(|k| {
            let (old, new) = (normal(&from, k), normal(&to, k));
            dot(&old, &new) > LEAST_TURN * (dot(&old, &old) * dot(&new, &new)).sqrt()
        });
        if !keeps_shape {
            return false;
        }
        let trial = self.nearby.trial();
        self.nearby.try_another();
        let corners = self.star.ring.iter().chain([&vertex]).map(|&corner| (corner, mesh.points[corner as usize]));
        self.nearby.begin(&mut self.tree, &mut self.places, corners);
        self.nearby.mark(&mut self.tree, &mut self.places, trial, to);
        let certified = (0..count).all(|k| {
            let next = (k + 1) % count;
            let corners = [trial, self.star.ring[k], self.star.ring[next]];
            let triangle = [to, mesh.points[corners[1] as usize], mesh.points[corners[2] as usize]];
            let least = setting.least - setting.rounding;
            self.nearby.cover(&self.tree, [count, k, next, count + 1])
                && self.nearby.is_clear(&mut self.tree, &mut self.places, corners, &triangle, least)
        });
        if !certified || self.tree.exhausted || self.meetings(mesh, vertex, None, Some(to), 0) > 0 {
            return false;
        }
        mesh.points[vertex as usize] = to;
        self.nearby.accept(vertex);
        self.place(mesh);
        true
    }

    /// Removes what has no area from a whole surface, and crossings: what one node leaves may become removable by what others do.
    pub(super) fn finish(&mut self, setting: &Setting, surface: &mut BlockSurface, budget: &Budget) -> Result<u64, Stopped> {
        let mut mesh = HalfEdges::new(std::mem::take(&mut surface.vertices), &surface.triangles);
        let (inside, settled) = (vec![true; mesh.points.len()], vec![false; mesh.points.len()]);
        self.stamps.clear();
        self.stamps.resize(mesh.points.len(), 0);
        self.stamp = 0;
        self.clean(setting, &mut mesh, &inside, &settled);
        let mut moved = BTreeSet::new();
        self.nudge(&mut mesh, &mut moved);
        let crossings = crossings(&mesh, budget)?;
        let mut left = crossings.count;
        if left > 0 {
            self.part(&mut mesh, &crossings.first, &mut moved);
            left = self::crossings(&mesh, budget)?.count;
        }
        self.write(&mut mesh, &inside, surface);
        Ok(left)
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

    /// Parts triangles that cross by moving corners by a few steps of single precision, each at most once: slivers that rounding folds over their neighbours.
    fn part(&mut self, mesh: &mut HalfEdges, pairs: &[[u32; 2]], moved: &mut BTreeSet<u32>) {
        self.index(mesh);
        for corner in pairs.iter().flatten().filter_map(|&triangle| mesh.triangle(triangle)).flatten().collect::<BTreeSet<u32>>() {
            if moved.contains(&corner) || !mesh.star(corner, usize::MAX, &mut self.star) {
                continue;
            }
            let mut least = self.meetings(mesh, corner, None, None, usize::MAX);
            let from = mesh.points[corner as usize];
            let mut best = from;
            for (steps, code) in (0..MOST_STEPS.ilog2() + 1).flat_map(|power| (1..27).map(move |code| (1 << power, code))) {
                if least == 0 {
                    break;
                }
                let to = stepped(&from, code, steps);
                let met = self.meetings(mesh, corner, None, Some(to), least - 1);
                if met < least {
                    (least, best) = (met, to);
                }
            }
            if best != from {
                moved.insert(corner);
                mesh.points[corner as usize] = best;
                self.place(mesh);
            }
        }
    }

    /// Gives the triangles of the star the boxes of where they are now.
    fn place(&mut self, mesh: &HalfEdges) {
        for &half in &self.star.halves {
            if let Some(corners) = mesh.triangle(half / 3) {
                self.boxes.set(half / 3, &Box32::of(&corners.map(|corner| mesh.points[corner as usize])));
            }
        }
    }

    /// Joins vertices at the same place, and turns edges of triangles without area, while that changes anything.
    fn clean(&mut self, setting: &Setting, mesh: &mut HalfEdges, inside: &[bool], settled: &[bool]) {
        for _ in 0..FLIP_ROUNDS {
            let merged = self.merge(mesh, inside, settled);
            if !self.flip(mesh, inside, setting.rounding) && !merged {
                break;
            }
        }
    }

    /// Makes vertices at the same place one where that keeps the manifold: the surface as a set does not change. Whether there were such.
    fn merge(&mut self, mesh: &mut HalfEdges, inside: &[bool], settled: &[bool]) -> bool {
        let mut merged = false;
        for vertex in 0..mesh.points.len() as u32 {
            if !inside[vertex as usize] || settled[vertex as usize] || !mesh.star(vertex, MOST_AROUND, &mut self.star) {
                continue;
            }
            for m in 0..self.star.ring.len() {
                let target = self.star.ring[m];
                if mesh.points[target as usize] == mesh.points[vertex as usize] && inside[target as usize] && self.keeps_manifold(mesh, m) {
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
            if contact::is_flat(&[at(d), at(c), at(a)]) || contact::is_flat(&[at(c), at(d), at(b)]) {
                continue;
            }
            if mesh.star(c, usize::MAX, &mut self.other) && !self.other.ring.contains(&d) {
                mesh.flip(half);
                turned = true;
            }
        }
        turned
    }

    /// Gives the mesh back to the surface, without what is gone.
    fn write(&mut self, mesh: &mut HalfEdges, inside: &[bool], surface: &mut BlockSurface) {
        let mut numbers = vec![NONE; mesh.points.len()];
        surface.settled.clear();
        for vertex in 0..mesh.points.len() as u32 {
            if mesh.is_used(vertex) {
                numbers[vertex as usize] = surface.vertices.len() as u32;
                surface.vertices.push(mesh.points[vertex as usize]);
                let closed = inside[vertex as usize] && mesh.star(vertex, usize::MAX, &mut self.star);
                surface.settled.push(closed && self.star.ring.iter().all(|&other| inside[other as usize]));
            }
        }
        surface.triangles.clear();
        surface.triangles.extend((0..mesh.triangles()).filter_map(|t| mesh.triangle(t)).map(|t| t.map(|corner| numbers[corner as usize])));
        for (_, number) in &mut surface.shared {
            *number = numbers[*number as usize];
        }
        surface.shared.retain(|&(_, number)| number != NONE);
        surface.site_error = surface.site_error.max(self.tree.largest_error);
    }

    fn index(&mut self, mesh: &HalfEdges) {
        self.boxed = mesh.alive;
        let box_of = |triangle| mesh.triangle(triangle).map(|corners| Box32::of(&corners.map(|corner| mesh.points[corner as usize])));
        self.boxes.build(mesh.triangles() as usize, box_of, false);
    }

    /// Tries to remove a vertex, moving it off its planes by more than `lower` and at most `upper`. Its star is left in `self.star`.
    fn remove(&mut self, setting: &Setting, mesh: &mut HalfEdges, inside: &[bool], vertex: u32, lower: f64, upper: f64) -> bool {
        if !mesh.star(vertex, MOST_AROUND, &mut self.star) || self.star.ring.iter().any(|&other| !inside[other as usize]) {
            return false;
        }
        self.rank(setting, mesh, vertex, lower, upper);
        let mut known = false;
        for choice in 0..self.choices.len() {
            let m = self.choices[choice].1;
            if !self.keeps_manifold(mesh, m) || !self.keeps_shape(setting, mesh, vertex, m) {
                continue;
            }
            if !known {
                let corners = self.star.ring.iter().chain([&vertex]).map(|&corner| (corner, mesh.points[corner as usize]));
                self.nearby.begin(&mut self.tree, &mut self.places, corners);
                known = true;
            }
            if self.is_certified(setting, mesh, m) && !self.tree.exhausted && self.is_free(setting, mesh, vertex, m) {
                mesh.collapse(vertex, &self.star, m);
                self.place(mesh);
                return true;
            }
        }
        false
    }

    /// Lists the neighbours that the vertex may move to, the cheapest first.
    fn rank(&mut self, setting: &Setting, mesh: &HalfEdges, vertex: u32, lower: f64, upper: f64) {
        let Self { star, normals, lengths, choices, due, .. } = self;
        let mut later = f64::INFINITY;
        let count = star.ring.len();
        let origin = &mesh.points[vertex as usize];
        let at = |k: usize| subtract(&mesh.points[star.ring[k % count] as usize], origin);
        normals.clear();
        lengths.clear();
        for k in 0..count {
            let normal = cross(&at(k), &at(k + 1));
            lengths.push(dot(&normal, &normal).sqrt());
            normals.push(normal);
        }
        choices.clear();
        for m in 0..count {
            let towards = at(m);
            let length = dot(&towards, &towards).sqrt();
            let (mut largest, mut sum) = (0.0_f64, 0.0_f64);
            for k in kept(m, count) {
                // Below this area a triangle has no plane to speak of.
                if lengths[k] > setting.rounding * setting.rounding {
                    let height = dot(&normals[k], &towards).abs() / lengths[k];
                    largest = largest.max(height);
                    sum += height;
                } else {
                    sum += length;
                }
            }
            let cost = largest + LENGTH_SHARE * length;
            // The planks of the module's comment; a share is left for rounding.
            let planks = sum < 1.9 * setting.least;
            let tiny = length <= TINY * setting.rounding;
            if planks && (tiny || (cost > lower && cost <= upper)) {
                choices.push((if tiny { length * 1e-6 } else { cost }, m));
            } else if planks && cost > upper {
                later = later.min(cost);
            }
        }
        due[vertex as usize] = later;
        choices.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }

    /// The link condition (Dey, Edelsbrunner, Guha and Nekhayev, "Topology preserving edge contraction", 1999): the ends have no common neighbours
    /// but the two across the edge.
    fn keeps_manifold(&mut self, mesh: &HalfEdges, m: usize) -> bool {
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

    /// Whether new triangles have area and look where the old ones did.
    fn keeps_shape(&self, setting: &Setting, mesh: &HalfEdges, vertex: u32, m: usize) -> bool {
        let count = self.star.ring.len();
        let target = &mesh.points[self.star.ring[m] as usize];
        let least = LEAST_HEIGHT * setting.rounding;
        kept(m, count).all(|k| {
            let (a, b) = (&mesh.points[self.star.ring[k] as usize], &mesh.points[self.star.ring[(k + 1) % count] as usize]);
            let normal = cross(&subtract(a, target), &subtract(b, target));
            let square = dot(&normal, &normal);
            let longest = distance_squared(a, b).max(distance_squared(a, target)).max(distance_squared(b, target));
            // Twice the area over the longest edge is the least height.
            if square < least * least * longest {
                // A needle may replace a worse one.
                let origin = &mesh.points[vertex as usize];
                let old = distance_squared(a, b).max(distance_squared(a, origin)).max(distance_squared(b, origin));
                return square > 0.0 && square * old >= self.lengths[k].powi(2) * longest;
            }
            let was = self.lengths[k];
            was <= least * longest.sqrt() || dot(&normal, &self.normals[k]) > LEAST_COSINE * square.sqrt() * was
        })
    }

    /// Whether the sites cover what is swept, and the new triangles keep from them.
    fn is_certified(&mut self, setting: &Setting, mesh: &HalfEdges, m: usize) -> bool {
        let Self { tree, places, nearby, star, .. } = self;
        let count = star.ring.len();
        kept(m, count).all(|k| nearby.cover(tree, [m, k, (k + 1) % count, count]))
            && kept(m, count).all(|k| {
                let corners = [star.ring[m], star.ring[k], star.ring[(k + 1) % count]];
                let triangle = corners.map(|corner| mesh.points[corner as usize]);
                nearby.is_clear(tree, places, corners, &triangle, setting.least - setting.rounding)
            })
    }

    /// Whether the new triangles meet no others. Where old ones did, it is enough that there are fewer such pairs, or no more when
    /// nothing moves to speak of.
    fn is_free(&mut self, setting: &Setting, mesh: &HalfEdges, vertex: u32, m: usize) -> bool {
        let found = self.meetings(mesh, vertex, Some(m), None, 0);
        if found == 0 {
            return true;
        }
        let target = self.star.ring[m];
        let moved = distance_squared(&mesh.points[vertex as usize], &mesh.points[target as usize]).sqrt();
        let before = self.meetings(mesh, vertex, None, None, usize::MAX);
        if before == 0 {
            return false;
        }
        let after = self.meetings(mesh, vertex, Some(m), None, usize::MAX);
        after < before || (after == before && moved <= TINY * setting.rounding)
    }

    /// Counts pairs of a triangle of the star, old or after moving to ring m or elsewhere, and another that meet; gives up above `most`.
    fn meetings(&mut self, mesh: &HalfEdges, vertex: u32, m: Option<usize>, to: Option<Point>, most: usize) -> usize {
        let Self { star, boxes, close, own, .. } = self;
        let count = star.ring.len();
        let apex = m.map_or(vertex, |m| star.ring[m]);
        let point = |corner: u32| mesh.points[corner as usize];
        own.clear();
        let mut whole = Box32::EMPTY;
        for k in 0..count {
            if m.is_none_or(|m| k != m && (k + 1) % count != m) {
                let corners = [apex, star.ring[k], star.ring[(k + 1) % count]];
                let mut points = corners.map(point);
                points[0] = to.unwrap_or(points[0]);
                let facet = Facet::new(corners, points);
                whole = whole.union(&facet.bounds);
                own.push(facet);
            }
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
        close.clear();
        boxes.query(&whole, 0, |leaf| {
            let met = boxes.items(leaf).iter().zip(boxes.boxes(leaf)).filter(|(_, own)| own.meets(&whole));
            close.extend(met.map(|(&triangle, own)| (triangle, *own)));
            true
        });
        for &(triangle, own_box) in close.iter() {
            if !own.iter().any(|facet| own_box.meets(&facet.bounds)) {
                continue;
            }
            let Some(corners) = mesh.triangle(triangle) else { continue };
            if corners.contains(&vertex) {
                continue;
            }
            let points = corners.map(point);
            for facet in own.iter() {
                if own_box.meets(&facet.bounds)
                    && !facet.parts(&corners, &points)
                    && contact::meet([&corners, &facet.corners], [&points, &facet.points])
                {
                    found += 1;
                    if found > most {
                        return found;
                    }
                }
            }
        }
        found
    }
}

/// Crossings of what is left of a mesh, in its own numbers of triangles.
fn crossings(mesh: &HalfEdges, budget: &Budget) -> Result<Crossings, Stopped> {
    let kept: Vec<u32> = (0..mesh.triangles()).filter(|&triangle| mesh.triangle(triangle).is_some()).collect();
    let triangles = kept.iter().filter_map(|&triangle| mesh.triangle(triangle)).collect();
    let mesh = TriMesh { vertices: mesh.points.iter().copied().map(DVec3::from_array).collect(), triangles };
    let mut crossings = Crossings::among(&mesh, MOST_PARTED, budget)?;
    crossings.first.iter_mut().flatten().for_each(|triangle| *triangle = kept[*triangle as usize]);
    Ok(crossings)
}

/// A point moved by some steps of single precision along the axes that a code of three digits names.
fn stepped(from: &Point, code: usize, steps: u32) -> Point {
    std::array::from_fn(|axis| {
        let step = [|x: f32| x, f32::next_up, f32::next_down][code / [1, 3, 9][axis] % 3];
        f64::from((0..steps).fold(from[axis] as f32, |x, _| step(x)))
    })
}

/// Whether a triangle's least height is below `least`.
fn is_sliver(points: &[Point; 3], least: f64) -> bool {
    let normal = cross(&subtract(&points[1], &points[0]), &subtract(&points[2], &points[0]));
    let longest = (0..3).map(|k| distance_squared(&points[k], &points[(k + 1) % 3])).fold(0.0, f64::max);
    dot(&normal, &normal) <= least * least * longest
}

/// The triangles of a star of `count` that are kept when its vertex moves to ring m.
fn kept(m: usize, count: usize) -> impl Iterator<Item = usize> {
    (0..count).filter(move |&k| k != m && (k + 1) % count != m)
}
