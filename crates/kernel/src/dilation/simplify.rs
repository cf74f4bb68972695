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

use super::certificate::{Nearby, Places};
use super::convex::SiteSearch;
use super::setting::Setting;
use super::slivers;
use super::surface::BlockSurface;
use super::tree::{Tree, in_space};
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract};
use crate::attractor::sites::SiteRule;
use crate::budget::{Budget, Stopped};
use crate::solid::around::Around;
use crate::solid::half_edges::{HalfEdges, NONE, kept};
use crate::solid::mend::{LEAST_HEIGHT, MOST_AROUND, Mender};

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

/// How a surface is simplified.
pub(super) struct Course {
    /// How far the new position may be from the planes of the old triangles, in units of the band, pass by pass.
    passes: &'static [f64],
    /// Before this pass vertices are lifted.
    lift_before: Option<usize>,
}

/// The course for a lattice's surface, whose vertices are all over the band, and for one whose vertices are as far out as may be.
pub(super) const OF_LATTICE: Course = Course { passes: &[1e-6, 0.01, 0.05, 0.12, 0.3, 2.0], lift_before: Some(4) };
pub(super) const OF_POLYTOPES: Course = Course { passes: &[0.15, 0.4, 1.0, 2.0], lift_before: None };
/// The share of an edge's length that is added: where all is flat, short edges go first.
const LENGTH_SHARE: f64 = 1e-3;
/// Cosine of the angle by which a normal may turn.
const LEAST_COSINE: f64 = 0.1;
/// Lengths of edges that are as good as none, in units of rounding.
const TINY: f64 = 4.0;
/// How far vertices of slivers may move off their planes, in units of rounding, where nothing else is simplified.
const SLIVER_MOVE: f64 = 64.0;
/// Vertices are lifted by this share of the band at least, and no normal turns by more than this cosine.
const LEAST_LIFT: f64 = 0.05;
const LEAST_TURN: f64 = 0.7;
/// Sites are looked for as far as triangles need whose smallest balls have this radius in units of the pitch.
const FIRST_LOOK: f64 = 0.6;

/// Sites within a ball of this radius, in units of the band, are looked at together: where points lie closer to each other, a vertex has a view of few of them, which tell coverage farther around, too.
const TOGETHER: f64 = 1.2;

/// Working memory of a thread.
pub(super) struct Simplifier<S> {
    search: S,
    places: Places,
    nearby: Nearby,
    mender: Mender,
    choices: Vec<(f64, usize)>,
    normals: Vec<Point>,
    lengths: Vec<f64>,
    /// The least cost beyond the pass that was met when a vertex was ranked last.
    due: Vec<f64>,
    /// Only what cannot be a solid is removed.
    clean_only: bool,
}

impl<'a> Simplifier<Tree<'a>> {
    /// One over an attractor's sites.
    pub(super) fn of(rule: &'a SiteRule<'a>, setting: &Setting) -> Self {
        Self::new(Tree::of(rule, setting), setting)
    }
}

impl<S: SiteSearch> Simplifier<S> {
    pub(super) fn new(search: S, setting: &Setting) -> Self {
        Self {
            search,
            places: Places::default(),
            nearby: Nearby::default(),
            mender: Mender::default(),
            choices: Vec::new(),
            normals: Vec::new(),
            lengths: Vec::new(),
            due: Vec::new(),
            clean_only: setting.clean_only,
        }
    }

    /// Bytes of what it has beside the surface since it was last run: what grows with the sites near a vertex.
    pub(super) fn bytes(&self) -> usize {
        self.search.bytes() + self.nearby.bytes()
    }

    /// Simplifies a node's surface. Vertices that are `settled` are tried again only when something around them changes; all that could be
    /// tried become so.
    ///
    /// # Errors
    /// [`Stopped`]; the surface is lost then.
    pub(super) fn run(
        &mut self,
        setting: &Setting,
        course: &Course,
        core: &Core,
        candidates: &S::Candidates,
        surface: &mut BlockSurface,
        budget: &Budget,
    ) -> Result<(), Stopped> {
        surface.settled.resize(surface.vertices.len(), false);
        if self.clean_only {
            self.remove_slivers(setting, core, candidates, surface);
            return Ok(());
        }
        let mut mesh = HalfEdges::new(std::mem::take(&mut surface.vertices), &surface.triangles);
        self.start(setting, core, candidates, &mesh);
        let inside: Vec<bool> = mesh.points.iter().map(|point| core.contains(point)).collect();
        self.mender.clean(&mut mesh, &inside, &surface.settled, setting.rounding);
        self.mender.index(&mesh);
        // A settled vertex waits until something changes; `fresh` says that something did since its last trial.
        let mut fresh: Vec<bool> = surface.settled.iter().map(|settled| !settled).collect();
        self.due.clear();
        self.due.resize(mesh.points.len(), 0.0);
        let mut lower = 0.0;
        let Course { passes, lift_before } = course;
        for (number, &pass) in passes.iter().enumerate() {
            if *lift_before == Some(number) {
                self.lift_all(setting, core, &mut mesh, &inside, &mut fresh, &mut surface.settled);
            }
            let upper = pass * (setting.outer - setting.least);
            for vertex in 0..mesh.points.len() as u32 {
                if !inside[vertex as usize] || surface.settled[vertex as usize] || !mesh.is_used(vertex) {
                    continue;
                }
                if vertex % 256 == 0 {
                    budget.cancel.check()?;
                }
                let is_fresh = std::mem::take(&mut fresh[vertex as usize]);
                if !is_fresh && self.due[vertex as usize] > upper {
                    continue;
                }
                let from = if is_fresh { 0.0 } else { lower };
                if self.remove(setting, &mut mesh, &inside, vertex, from, upper) {
                    for &neighbour in &self.mender.star.ring {
                        fresh[neighbour as usize] = true;
                        surface.settled[neighbour as usize] = false;
                    }
                    self.mender.keep_index(&mesh);
                }
            }
            lower = upper;
        }
        self.write(&mut mesh, &inside, surface);
        Ok(())
    }

    /// Begins with a mesh in a node.
    fn start(&mut self, setting: &Setting, core: &Core, candidates: &S::Candidates, mesh: &HalfEdges) {
        let starts = self.search.reset(candidates);
        let edge = 2.0 * setting.lattice.pitch;
        let size = (0..3).map(|axis| core.high[axis] - core.low[axis]).fold(0.0, f64::max);
        let top = (size / edge).log2().ceil().max(0.0) as u32 + 1;
        self.places.reset(core.low, edge, top, starts);
        let first_square = setting.least * setting.least + (FIRST_LOOK * setting.lattice.pitch).powi(2);
        let reach = setting.outer + setting.rounding - self.search.deviation();
        self.nearby.reset(mesh.points.len(), reach, first_square, TOGETHER * (setting.outer - setting.least));
        self.mender.start(mesh);
    }

    /// Turns edges of slivers, or removes their vertices: rounding to single precision may fold them over their neighbours, and these are the
    /// only crossings that a lattice's surface was seen to have.
    fn remove_slivers(&mut self, setting: &Setting, core: &Core, candidates: &S::Candidates, surface: &mut BlockSurface) {
        if let Some(mut around) = slivers::around(surface, core, setting.rounding, 2.0 * setting.lattice.pitch) {
            let Around { mesh, numbers, is_whole, .. } = &mut around;
            let inside: Vec<bool> = mesh.points.iter().zip(is_whole).map(|(point, whole)| *whole && core.contains(point)).collect();
            let settled: Vec<bool> = numbers.iter().map(|&number| surface.settled[number as usize]).collect();
            self.start(setting, core, candidates, mesh);
            self.mender.clean(mesh, &inside, &settled, setting.rounding);
            let left = std::mem::take(&mut self.mender.slivers);
            if !left.is_empty() {
                self.due.clear();
                self.due.resize(mesh.points.len(), 0.0);
                self.mender.index(mesh);
                let upper = (OF_LATTICE.passes[0] * (setting.outer - setting.least)).max(SLIVER_MOVE * setting.rounding);
                for corner in left.iter().filter_map(|&triangle| mesh.triangle(triangle)).flatten().collect::<Vec<u32>>() {
                    if inside[corner as usize] && mesh.is_used(corner) {
                        self.remove(setting, mesh, &inside, corner, 0.0, upper);
                    }
                }
            }
            self.mender.slivers = left;
            slivers::write(around, surface);
            surface.site_error = surface.site_error.max(self.search.largest_error());
        }
        slivers::settle(surface, core);
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
                for &changed in self.mender.star.ring.iter().chain([&vertex]) {
                    fresh[changed as usize] = true;
                    settled[changed as usize] = false;
                }
            }
        }
    }

    fn lift(&mut self, setting: &Setting, core: &Core, mesh: &mut HalfEdges, inside: &[bool], vertex: u32) -> bool {
        if !mesh.star(vertex, MOST_AROUND, &mut self.mender.star) || self.mender.star.ring.iter().any(|&other| !inside[other as usize]) {
            return false;
        }
        let count = self.mender.star.ring.len();
        let from = mesh.points[vertex as usize];
        let Some((foot, deficit)) = self.nearby.foot(&mut self.search, &mut self.places, vertex, &from) else { return false };
        let share = in_space(setting.outer, deficit) / distance_squared(&from, &foot).sqrt();
        let to: Point = std::array::from_fn(|axis| f64::from((foot[axis] + (from[axis] - foot[axis]) * share) as f32));
        let moved = distance_squared(&from, &to).sqrt();
        // No height of a swept tetrahedron is more than the way.
        let worth = moved > LEAST_LIFT * (setting.outer - setting.least) && count as f64 * moved < 1.9 * setting.thinnest;
        if self.search.is_exhausted() || !worth || !core.contains(&to) {
            return false;
        }
        let (ring, points) = (&self.mender.star.ring, &mesh.points);
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
        let corners = self.mender.star.ring.iter().chain([&vertex]).map(|&corner| (corner, mesh.points[corner as usize]));
        self.nearby.begin(&mut self.search, &mut self.places, corners);
        self.nearby.mark(&mut self.search, &mut self.places, trial, to);
        let certified = (0..count).all(|k| {
            let next = (k + 1) % count;
            let corners = [trial, self.mender.star.ring[k], self.mender.star.ring[next]];
            let triangle = [to, mesh.points[corners[1] as usize], mesh.points[corners[2] as usize]];
            let least = setting.least - setting.rounding + self.search.deviation();
            self.nearby.cover(&self.search, [count, k, next, count + 1])
                && self.nearby.is_clear(&mut self.search, &mut self.places, corners, &triangle, least)
        });
        if !certified || self.search.is_exhausted() {
            return false;
        }
        if !self.mender.stays_graph(mesh, vertex, None, Some(to)) && self.mender.meetings(mesh, vertex, None, Some(to), 0) > 0 {
            return false;
        }
        mesh.points[vertex as usize] = to;
        self.nearby.accept(vertex);
        self.mender.place(mesh);
        true
    }

    /// Gives the mesh back to the surface, without what is gone.
    fn write(&mut self, mesh: &mut HalfEdges, inside: &[bool], surface: &mut BlockSurface) {
        surface.settled.clear();
        for vertex in (0..mesh.points.len() as u32).filter(|&vertex| mesh.is_used(vertex)) {
            let closed = inside[vertex as usize] && mesh.star(vertex, usize::MAX, &mut self.mender.star);
            surface.settled.push(closed && self.mender.star.ring.iter().all(|&other| inside[other as usize]));
        }
        let numbers;
        (surface.vertices, surface.triangles, numbers) = mesh.compact();
        for (_, number) in &mut surface.shared {
            *number = numbers[*number as usize];
        }
        surface.shared.retain(|&(_, number)| number != NONE);
        surface.site_error = surface.site_error.max(self.search.largest_error());
    }

    /// Tries to remove a vertex, moving it off its planes by more than `lower` and at most `upper`. Its star is left in `self.mender.star`.
    fn remove(&mut self, setting: &Setting, mesh: &mut HalfEdges, inside: &[bool], vertex: u32, lower: f64, upper: f64) -> bool {
        if !mesh.star(vertex, MOST_AROUND, &mut self.mender.star) || self.mender.star.ring.iter().any(|&other| !inside[other as usize]) {
            return false;
        }
        self.rank(setting, mesh, vertex, lower, upper);
        let mut known = false;
        for choice in 0..self.choices.len() {
            let m = self.choices[choice].1;
            if !self.mender.keeps_manifold(mesh, m) || !self.keeps_shape(setting, mesh, vertex, m) {
                continue;
            }
            if !known {
                let corners = self.mender.star.ring.iter().chain([&vertex]).map(|&corner| (corner, mesh.points[corner as usize]));
                self.nearby.begin(&mut self.search, &mut self.places, corners);
                known = true;
            }
            if self.is_certified(setting, mesh, m) && !self.search.is_exhausted() && self.is_free(setting, mesh, vertex, m) {
                mesh.collapse(vertex, &self.mender.star, m);
                self.mender.place(mesh);
                return true;
            }
        }
        false
    }

    /// Lists the neighbours that the vertex may move to, the cheapest first.
    fn rank(&mut self, setting: &Setting, mesh: &HalfEdges, vertex: u32, lower: f64, upper: f64) {
        let Self { mender: Mender { star, .. }, normals, lengths, choices, due, .. } = self;
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
            for k in kept(Some(m), count) {
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
            let planks = sum < 1.9 * setting.thinnest;
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

    /// Whether new triangles have area and look where the old ones did.
    fn keeps_shape(&self, setting: &Setting, mesh: &HalfEdges, vertex: u32, m: usize) -> bool {
        let count = self.mender.star.ring.len();
        let target = &mesh.points[self.mender.star.ring[m] as usize];
        let least = LEAST_HEIGHT * setting.rounding;
        kept(Some(m), count).all(|k| {
            let (a, b) = (&mesh.points[self.mender.star.ring[k] as usize], &mesh.points[self.mender.star.ring[(k + 1) % count] as usize]);
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
        let Self { search, places, nearby, mender: Mender { star, .. }, .. } = self;
        let count = star.ring.len();
        let least = setting.least - setting.rounding + search.deviation();
        kept(Some(m), count).all(|k| nearby.cover(search, [m, k, (k + 1) % count, count]))
            && kept(Some(m), count).all(|k| {
                let corners = [star.ring[m], star.ring[k], star.ring[(k + 1) % count]];
                let triangle = corners.map(|corner| mesh.points[corner as usize]);
                nearby.is_clear(search, places, corners, &triangle, least)
            })
    }

    /// Whether the new triangles meet no others. Where old ones did, by no more than rounding, it is enough that no more do, when nothing moves to speak of: a crossing must not grow out of what
    /// [`crate::solid::mend`] can part.
    fn is_free(&mut self, setting: &Setting, mesh: &HalfEdges, vertex: u32, m: usize) -> bool {
        if self.mender.stays_graph(mesh, vertex, Some(m), None) || self.mender.meetings(mesh, vertex, Some(m), None, 0) == 0 {
            return true;
        }
        let target = self.mender.star.ring[m];
        let moved = distance_squared(&mesh.points[vertex as usize], &mesh.points[target as usize]).sqrt();
        if moved > TINY * setting.rounding {
            return false;
        }
        let before = self.mender.meetings(mesh, vertex, None, None, usize::MAX);
        before > 0 && self.mender.meetings(mesh, vertex, Some(m), None, before) <= before
    }
}
