//! One block of the lattice: which sites matter in each tetrahedron, what they leave of it, and the piece of surface.
//!
//! Let K be a tetrahedron of circumradius R, S_i convex sites, theta > 0, and L_i the affine function with the values of d(., S_i)^2 at K's
//! vertices. The solid's part of K is where some L_i < theta. For a convex site d^2 is convex, and d^2 - |x|^2, a minimum of affine
//! functions, is concave; so
//!
//! d(x, S_i)^2 <= L_i(x) <= d(x, S_i)^2 + (interpolant of |x|^2 minus |x|^2) <= d(x, S_i)^2 + R^2:
//!
//! the solid lies within D(sqrt(theta)) and contains D(sqrt(theta - R^2)). No crease is cut off: the bound is of second order
//! in the pitch everywhere, whatever sites compete. What is outside is a convex polytope in every tetrahedron, see [`Outside`]; a face's polygon
//! depends on the face's values alone, so that neighbours fit, and the surface is a manifold: around a point inside a
//! face or on an edge of the lattice, the polytopes of the tetrahedra there join along whole polygons or intervals that end at the point.

use super::affine::Affine;
use super::convex::{Convex, SiteSearch};
use super::critical::Critical;
use super::frame::{DEEP, FAR, Frame, NOTHING, UNKNOWN, Value};
use super::lattice::{Cube, Grading, Number, Plain, UNITS, is_mirrored};
use super::octree::Task;
use super::outside::{Corner, Cut, FACES, HalfSpace, Outside};
use super::setting::Setting;
use super::smooth::{self, MOST_NOISE, WHOLE};
use super::star::{Star, Stars, note};
use super::surface::{BlockSurface, NameHasher, NameMap, Seam, UNNAMED, VertexName};
use super::tree::{Candidates, Hit, NodeId, SiteId, Tree, Weighted, in_space, with_deficit};
use crate::attractor::Attractor;
use crate::attractor::cell::{Point, Site, distance_squared, dot, subtract};
use crate::attractor::sites::SiteRule;
use crate::budget::CancelToken;
use crate::measure::triangle::{Feature, closest_feature};
use crate::split_mix::mix;
use std::collections::HashSet;
use std::hash::BuildHasherDefault;

/// Cubes along a block's side.
pub(super) const SIDE: usize = 16;
/// Cubes along the side of a sub-block, the unit that is skipped as a whole.
const SUB: usize = 4;
const LAYER: usize = SIDE + 1;
const VERTICES: usize = LAYER * LAYER * LAYER;
/// On which side of the surface a vertex is; both where a gap was closed there.
const OPEN: u8 = 1;
const COVERED: u8 = 2;

/// A site that matters in a tetrahedron.
#[derive(Clone, Copy)]
pub(super) struct Nearby {
    pub(super) site: SiteId,
    pub(super) half_space: HalfSpace,
}

/// Working memory of a thread, reused from block to block.
pub(super) struct Workshop<'a> {
    attractor: &'a Attractor,
    cancel: &'a CancelToken,
    tree: Tree<'a>,
    /// Squared distances at the vertices of level 0, corners and centres, and their nearest sites.
    values: [Vec<Value>; 2],
    /// Those of other vertices.
    fine: NameMap<Number, Value>,
    near: Vec<NodeId>,
    /// Starts of every solid's own triangles among the near nodes.
    solid_nodes: Vec<(u32, Vec<NodeId>)>,
    seed: Option<NodeId>,
    outside: Outside,
    found: Vec<SiteId>,
    nearby: Vec<Nearby>,
    polygon: Vec<u16>,
    corners: Vec<u32>,
    numbers: Vec<u32>,
    critical: Critical<'a>,
    /// Cubes to subdivide that the search in the block's tetrahedra has noted.
    to_subdivide: HashSet<Cube, BuildHasherDefault<NameHasher>>,
    stars: Stars,
    /// The cubes of the sub-block that are looked at, by their offset from its first.
    cubes: Vec<[i64; 3]>,
    leaves: Vec<Cube>,
    names: NameMap<VertexName, u32>,
}

impl<'a> Workshop<'a> {
    pub(super) fn new(rule: &'a SiteRule<'a>, setting: &Setting, cancel: &'a CancelToken) -> Self {
        Self {
            attractor: rule.attractor(),
            cancel,
            tree: Tree::of(rule, setting),
            values: [vec![NOTHING; VERTICES], vec![NOTHING; VERTICES]],
            fine: NameMap::default(),
            near: Vec::new(),
            solid_nodes: Vec::new(),
            seed: None,
            outside: Outside::default(),
            found: Vec::new(),
            nearby: Vec::new(),
            polygon: Vec::new(),
            corners: Vec::new(),
            numbers: Vec::new(),
            critical: Critical::new(cancel),
            to_subdivide: HashSet::default(),
            stars: Stars::default(),
            cubes: Vec::new(),
            leaves: Vec::new(),
            names: NameMap::default(),
        }
    }

    /// Completes the surface in a block, of which all is there but the tetrahedra that the task is about; `open` lists the solids whose surface meets it.
    ///
    /// Where the token is fired meanwhile the surface is incomplete: a block may hold so many sites that it takes minutes.
    pub(super) fn complete(
        &mut self,
        setting: &Setting,
        grading: &Grading,
        task: Task<'_>,
        surface: &mut BlockSurface,
        candidates: &Candidates,
        open: &[u32],
    ) {
        self.values.iter_mut().for_each(|values| values.fill(NOTHING));
        self.fine.clear();
        self.to_subdivide.clear();
        self.names.clear();
        self.names.extend(surface.names.iter().zip(0..).filter(|&(&name, _)| name != UNNAMED).map(|(&name, number)| (name, number)));
        self.seed = None;
        let starts = self.tree.reset(candidates);
        let kept = surface.triangles.len();
        let first_cube = surface.first_cube;
        for k in (0..SIDE).step_by(SUB) {
            for j in (0..SIDE).step_by(SUB) {
                for i in (0..SIDE).step_by(SUB) {
                    let first = std::array::from_fn(|axis| first_cube[axis] + [i, j, k][axis] as i64);
                    self.cubes.clear();
                    self.cubes.extend(cubes(SUB).filter(|&local| task.is_about(&moved(first, local))));
                    if !self.cubes.is_empty() {
                        self.sub_block(setting, grading, task, &starts, open, first, surface);
                    }
                }
            }
        }
        surface.shared.sort_unstable();
        if !setting.dense {
            self.follow(setting, grading, &starts, kept, surface);
        }
        surface.shrink();
        surface.critical.sort_unstable();
        surface.critical.dedup();
        surface.uncertain.sort_unstable();
        surface.uncertain.dedup();
        surface.leaves = surface.leaves.max(self.tree.leaves);
        surface.looked += self.tree.looked;
        surface.found += self.tree.found;
        surface.site_error = surface.site_error.max(self.tree.largest_error);
    }

    /// Whether the last block needed more cells than allowed: its surface is then incomplete.
    pub(super) fn is_exhausted(&self) -> bool {
        self.tree.exhausted
    }

    /// The chosen cubes of a sub-block: skipped when its middle is too far from the surface for any of its tetrahedra.
    #[allow(clippy::too_many_arguments)]
    fn sub_block(
        &mut self,
        setting: &Setting,
        grading: &Grading,
        task: Task<'_>,
        starts: &[NodeId],
        open: &[u32],
        first: [i64; 3],
        surface: &mut BlockSurface,
    ) {
        let (middle, half) = ball_around(setting, first);
        // Farther away no vertex is covered, and no critical point has a value below r.
        let hit = self.tree.nearest(&middle, starts, self.seed, setting.reach + setting.gap + half, setting.reach - half);
        let Some(hit) = hit else { return };
        if hit.distance_squared.sqrt() + half < setting.reach {
            // One site covers all.
            return;
        }
        self.seed = Some(hit.node);
        let mut near = std::mem::take(&mut self.near);
        self.tree.gather(&middle, starts, setting.sight + half, &mut near);
        self.near = near;
        self.gather_solids(starts, open, &middle, half);
        let (chosen, mut leaves) = (std::mem::take(&mut self.cubes), std::mem::take(&mut self.leaves));
        let plain = if setting.dense { grading.plain(first, SUB) } else { Plain::default() };
        for &local in &chosen {
            let cube = Cube { level: 0, index: moved(first, local) };
            leaves.clear();
            grading.leaves(cube, &mut leaves);
            for &leaf in leaves.iter().filter(|&&leaf| task.is_new(leaf)) {
                let made = surface.triangles.len();
                if plain.contains(local) {
                    self.plain_cube(setting, leaf, surface);
                } else {
                    grading.tetrahedra(leaf, &mut |numbers| self.tetrahedron(setting, numbers, leaf.level, surface));
                }
                if surface.triangles.len() > made {
                    surface.pieces.push((leaf, made as u32));
                }
            }
        }
        (self.cubes, self.leaves) = (chosen, leaves);
    }

    /// The tetrahedra of a cube among others of its size where points stand for cells, in the order of [`Grading::tetrahedra`]: most have all vertices
    /// on one side, and are not looked at.
    fn plain_cube(&mut self, setting: &Setting, cube: Cube, surface: &mut BlockSurface) {
        let theta = setting.reach * setting.reach;
        let mut side = |number: Number| {
            let value = self.value(setting, surface, number);
            match value.least < 0 {
                false => OPEN,
                true if value.square > theta => OPEN | COVERED,
                true => COVERED,
            }
        };
        let is_mixed = |sides: u8| sides == OPEN | COVERED;
        let mut corners = [([0; 3], 0); 8];
        for (code, corner) in corners.iter_mut().enumerate().skip(1) {
            let number = cube.corner(std::array::from_fn(|axis| (code >> axis & 1) as i64));
            *corner = (number, side(number));
        }
        let mut centres = [([0; 3], 0); 4];
        for (axis, centre) in centres.iter_mut().enumerate() {
            let number = cube.moved(std::array::from_fn(|other| i64::from(axis == other))).centre();
            *centre = (number, side(number));
        }
        let own = centres[3];
        for (axis, other) in centres.into_iter().enumerate().take(3) {
            let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
            let face = [0, u, u | v, v].map(|offset| corners[(1 << axis) | offset]);
            let between = own.1 | other.1;
            if !is_mixed(face.iter().fold(between, |sides, corner| sides | corner.1)) {
                continue;
            }
            for step in 0..4 {
                let (p, q) = (face[step], face[(step + 1) % 4]);
                if is_mixed(between | p.1 | q.1) {
                    self.tetrahedron(setting, [own.0, other.0, p.0, q.0], 0, surface);
                }
            }
        }
    }

    /// Looks at the stars of vertices with triangles from `first` on, and notes the cubes to subdivide where they do not follow the distance: see `star`.
    fn follow(&mut self, setting: &Setting, grading: &Grading, starts: &[NodeId], first: usize, surface: &mut BlockSurface) {
        let origin = setting.lattice.corner(surface.first_cube);
        self.stars.list(surface, first, |vertex| {
            let place: [usize; 3] = std::array::from_fn(|axis| {
                let cubes = (vertex[axis] - origin[axis]) / (SUB as f64 * setting.lattice.pitch);
                (cubes.max(0.0) as usize).min(SIDE / SUB - 1)
            });
            ((place[2] * SIDE / SUB + place[1]) * SIDE / SUB + place[0]) as u32
        });
        let mut at = u32::MAX;
        for index in 0..self.stars.listed.len() {
            if self.cancel.reason().is_some() {
                return;
            }
            let (sub_block, vertex) = self.stars.listed[index];
            if sub_block != at {
                at = sub_block;
                let side = SIDE / SUB;
                let place = [at as usize % side, at as usize / side % side, at as usize / side / side];
                let corner = std::array::from_fn(|axis| surface.first_cube[axis] + (SUB * place[axis]) as i64);
                let (middle, half) = ball_around(setting, corner);
                let mut near = std::mem::take(&mut self.near);
                self.tree.gather(&middle, starts, setting.sight + half, &mut near);
                self.near = near;
            }
            // Nor will the triangles in such a cube: see `tetrahedron`.
            let is_noted = |leaf: Cube| self.to_subdivide.contains(&leaf);
            let place = &surface.vertices[vertex as usize];
            if !self.to_subdivide.is_empty() && grading.leaf_at(setting.lattice.within(place)).is_some_and(is_noted) {
                continue;
            }
            let star = &mut self.stars.star;
            star.reset(setting, surface.vertices[vertex as usize]);
            for &triangle in self.stars.incident.of(vertex) {
                let corners = surface.triangles[triangle as usize].map(|corner| surface.vertices[corner as usize]);
                star.add(setting, corners, surface.normals[triangle as usize]);
            }
            let centre = star.centre;
            let is_shared = self.stars.shared[vertex as usize];
            if is_shared {
                see(&mut self.tree, &self.near, setting.outer, star, &mut self.found);
            }
            let direction = if is_shared { star.outwards(setting, false) } else { star.normal() };
            if follows(setting, &mut self.tree, &self.near, star, &direction, &mut self.found) {
                continue;
            }
            if is_shared {
                // Triangles of other blocks reach no farther than a tetrahedron.
                let reach = setting.outer + setting.lattice.pitch;
                let (tree, numbers, sites) = (&mut self.tree, &mut self.stars.numbers, &mut surface.seam_sites);
                self.found.clear();
                tree.collect(&centre, &self.near, reach, &mut self.found);
                let number = |&id: &SiteId| {
                    *numbers.entry(id).or_insert_with(|| {
                        sites.push(tree.site(id));
                        sites.len() as u32 - 1
                    })
                };
                surface.seams.push(Seam { name: surface.names[vertex as usize], sites: self.found.iter().map(number).collect() });
                continue;
            }
            star.forget_sites();
            see(&mut self.tree, &self.near, setting.outer, star, &mut self.found);
            let direction = star.outwards(setting, true);
            if follows(setting, &mut self.tree, &self.near, star, &direction, &mut self.found) {
                continue;
            }
            star.forget_sites();
            see(&mut self.tree, &self.near, setting.outer + star.radius(), star, &mut self.found);
            if !star.grows(setting) {
                note(setting, grading, &centre, &mut surface.critical, &mut surface.uncertain);
            }
        }
    }

    /// For every solid whose surface is among the candidates: its nodes near the sub-block.
    fn gather_solids(&mut self, starts: &[NodeId], open: &[u32], middle: &Point, half: f64) {
        self.solid_nodes.clear();
        for &solid in open {
            let own = |id: &NodeId| self.attractor.roots()[self.tree.root_of(*id) as usize].solid == Some(solid);
            let nodes: Vec<NodeId> = starts.iter().copied().filter(own).collect();
            if nodes.is_empty() {
                continue;
            }
            if let Some(hit) = self.tree.nearest(middle, &nodes, None, f64::INFINITY, 0.0) {
                let mut near = Vec::new();
                self.tree.gather(middle, &nodes, hit.distance_squared.sqrt() + 2.0 * half, &mut near);
                self.solid_nodes.push((solid, near));
            }
        }
    }

    /// What is known of a vertex: its squared distance if a site is so near that it may matter around it, else FAR; DEEP where
    /// a site is sure to cover all around.
    fn value(&mut self, setting: &Setting, surface: &BlockSurface, number: Number) -> Value {
        let known = *self.slot(surface, number);
        if !known.square.is_nan() {
            return known;
        }
        let value = self.measured(setting, number);
        *self.slot(surface, number) = value;
        value
    }

    /// Where the value of a vertex is kept.
    fn slot(&mut self, surface: &BlockSurface, number: Number) -> &mut Value {
        const HALF: i64 = UNITS / 2;
        let local: [i64; 3] = std::array::from_fn(|axis| i64::from(number[axis]) - UNITS * surface.first_cube[axis]);
        let centre = local[0] % UNITS == HALF;
        if local.iter().any(|x| x % UNITS != if centre { HALF } else { 0 } || *x < 0) {
            return self.fine.entry(number).or_insert(NOTHING);
        }
        let cube = local.map(|x| (x / UNITS) as usize);
        &mut self.values[usize::from(centre)][(cube[2] * LAYER + cube[1]) * LAYER + cube[0]]
    }

    /// The witnesses of the vertices of a tetrahedron: see [`smooth::served`].
    fn witnesses(&mut self, setting: &Setting, surface: &BlockSurface, frame: &mut Frame) {
        for k in 0..4 {
            let value = frame.values[k];
            let offset = subtract(&frame.positions[k], &value.closest);
            let share = WITNESS * setting.reach / value.square.sqrt();
            let y: Point = std::array::from_fn(|axis| value.closest[axis] + share * offset[axis]);
            let square = if value.witness.is_nan() {
                let most = WITNESS * setting.reach;
                let hit = self.tree.nearest(&y, &self.near, Some(value.node), most, 0.0);
                let square = hit.map_or(most * most, |hit| hit.distance_squared);
                self.slot(surface, frame.numbers[k]).witness = square;
                square
            } else {
                value.witness
            };
            frame.witnesses[k] = (y, square);
        }
    }

    fn measured(&mut self, setting: &Setting, number: Number) -> Value {
        let x = setting.lattice.position(number);
        let noise = (number.iter().fold(7, |code: u64, &x| mix(code.rotate_left(9) ^ x as u64)) % MOST_NOISE as u64) as i64;
        let far = setting.far + noise;
        let Some(hit) = self.tree.nearest(&x, &self.near, self.seed, setting.horizon, setting.deep) else {
            return Value { square: FAR, least: far, far, ..NOTHING };
        };
        self.seed = Some(hit.node);
        let square = if hit.distance_squared < setting.deep * setting.deep { DEEP } else { hit.distance_squared };
        let mut least = setting.integer(hit.distance_squared) - 1 - noise;
        if setting.dense && least > 0 && self.in_gap(setting, &x, &hit) {
            least = setting.filled_value - noise;
        }
        Value {
            square,
            site: hit.site,
            closest: hit.closest,
            node: hit.node,
            least: if least == 0 { -1 } else { least },
            far,
            witness: UNKNOWN,
        }
    }

    /// Whether a point lies in a solid: the sign of its offset from the nearest point of the surface along
    /// that point's pseudo-normal.
    fn inside_solid(&mut self, x: &Point) -> bool {
        let solids = std::mem::take(&mut self.solid_nodes);
        let inside = solids.iter().any(|(solid, nodes)| {
            let Some(hit) = self.tree.nearest(x, nodes, None, f64::INFINITY, 0.0) else { return false };
            signed_side(self.attractor, *solid, self.tree.root_of(hit.node), x) < 0.0
        });
        self.solid_nodes = solids;
        inside
    }

    /// The vertices of a tetrahedron, if it may have a piece of the surface or a critical point of the distance.
    fn frame(&mut self, setting: &Setting, mut numbers: [Number; 4], level: u32, surface: &BlockSurface) -> Option<Frame> {
        numbers.sort_unstable();
        let mut values = [NOTHING; 4];
        let (mut nearest, mut farthest, mut covered) = (FAR, 0.0_f64, 0);
        for (k, &number) in numbers.iter().enumerate() {
            let value = self.value(setting, surface, number);
            // Around a deep vertex all is covered, around a far one no vertex is, and the distance is too large for critical points that matter.
            if value.square == DEEP || value.square == FAR {
                return None;
            }
            nearest = nearest.min(value.square);
            farthest = farthest.max(value.square);
            covered |= u8::from(value.least < 0) << k;
            values[k] = value;
        }
        // Only a critical point below r matters where no vertex is covered: there f - theta is below R^2 somewhere, and below a^2 everywhere.
        if covered == 0 && (nearest > setting.near * setting.near || farthest > setting.horizon * setting.horizon) {
            return None;
        }
        Some(Frame {
            positions: numbers.map(|number| setting.lattice.position(number)),
            mirrored: is_mirrored(&numbers),
            numbers,
            values,
            witnesses: [([0.0; 3], 0.0); 4],
            covered,
            level,
        })
    }

    /// Emits the surface in a tetrahedron; notes the cubes to subdivide if a critical point of the distance may be on the wrong side.
    fn tetrahedron(&mut self, setting: &Setting, numbers: [Number; 4], level: u32, surface: &mut BlockSurface) {
        if self.cancel.reason().is_some() {
            return;
        }
        let Some(mut frame) = self.frame(setting, numbers, level, surface) else { return };
        if setting.dense {
            return self.dense_tetrahedron(setting, &frame, surface);
        }
        let theta = setting.reach * setting.reach;
        let squares = smooth::squares(&self.tree, &frame);
        if frame.covered == WHOLE && squares.iter().any(|squares| squares.iter().all(|&square| square < theta)) {
            return;
        }
        if frame.covered != 0 {
            self.witnesses(setting, surface, &mut frame);
        }
        let mut served = smooth::served(setting, &frame, &squares, smooth::VERTICES);
        if frame.covered != 0 && smooth::smooth(served) >> WHOLE & 1 == 0 {
            served = self.served(setting, &frame, served);
        }
        let smooth = smooth::smooth(served);
        let whole = smooth >> WHOLE & 1 == 1;
        if whole && frame.covered != 0 {
            // What one site leaves has no critical point: see `is_steep`.
            self.march(setting, &frame, surface);
            return;
        }
        if self.cut_sites(setting, &frame) == Cut::Empty {
            // The solid's other parts lie in what sites cover.
            return;
        }
        // A tetrahedron of a cube that is to be subdivided will not be there again; or that cube is counted as uncertain.
        if self.to_subdivide.is_empty() || !frame.cubes().any(|cube| self.to_subdivide.contains(&cube)) {
            let rest: Vec<Point> = self.outside.corners().iter().map(|corner| place(&frame.positions, &corner.weights)).collect();
            let known = surface.critical.len();
            self.critical.search(setting, &self.tree, &frame, smooth, &self.nearby, self.outside.corners(), &rest, surface);
            self.to_subdivide.extend(&surface.critical[known..]);
        }
        if frame.covered == 0 {
            return;
        }
        for simplex in smooth::largest(smooth, frame.covered) {
            let name = mix(u64::from(simplex)) | VIRTUAL;
            if self.outside.cut(HalfSpace { values: frame.values_of(simplex), name, simplex }) == Cut::Empty {
                return;
            }
        }
        // What is left is far from all surfaces, so it is on one side of them.
        if !self.solid_nodes.is_empty() {
            let (centre, _) = self.ball(&frame);
            if self.inside_solid(&centre) {
                return;
            }
        }
        self.emit(&frame, surface);
    }

    /// Whether a vertex lies outside D(r) but in its closing by a ball of radius `gap`: no such ball outside D(r) was found that contains it.
    ///
    /// Where two walls of a crease come closer than a lattice edge, edges from wall to wall close the gap with no
    /// vertex in it, and a vertex left open deeper in the gap would be the inside of a false tunnel. Closing
    /// fills such gaps as a whole and leaves an outside as smooth as the lattice can follow.
    ///
    /// The ball's centre is sought by walking away from the nearest site, as far as the vertex allows. In a crease the walk leads out of the
    /// gap and is held by the vertex; where it comes to rest before, it is in a neck between two parts of the
    /// outside, which stays open if it is wide enough for the lattice.
    fn in_gap(&mut self, setting: &Setting, x: &Point, hit: &Hit) -> bool {
        // In space, for the nearest site's own radius.
        let deficit = self.tree.site(hit.site).deficit;
        let reach = in_space(setting.reach, deficit);
        let free = reach + setting.gap;
        if hit.distance_squared - deficit > free * free {
            return false;
        }
        let (mut y, mut nearest) = (*x, hit.closest);
        let (mut clearance, mut held) = (0.0, false);
        for _ in 0..WALK {
            let away = subtract(&y, &nearest);
            let scale = free / dot(&away, &away).sqrt();
            let target: Point = std::array::from_fn(|axis| nearest[axis] + scale * away[axis]);
            let offset = subtract(&target, x);
            let length = dot(&offset, &offset).sqrt();
            let share = if length > setting.gap { setting.gap / length } else { 1.0 };
            y = std::array::from_fn(|axis| x[axis] + share * offset[axis]);
            let Some(hit) = self.tree.nearest(&y, &self.near, Some(hit.node), with_deficit(free * (1.0 - 1e-3), deficit), 0.0) else {
                return false;
            };
            nearest = hit.closest;
            clearance = in_space(hit.distance_squared.sqrt(), deficit) - reach;
            held = share < 1.0;
        }
        held || clearance < setting.neck
    }

    /// The tetrahedron among sites that are too many to be told apart: marched as a whole, and its cubes to be subdivided unless what this fills is near a site.
    fn dense_tetrahedron(&mut self, setting: &Setting, frame: &Frame, surface: &mut BlockSurface) {
        if frame.covered == 0 {
            return;
        }
        if !frame.is_close(setting, &self.tree) && !self.is_served(setting, frame) {
            surface.critical.extend(frame.cubes());
        }
        self.march(setting, frame, surface);
    }

    /// Whether a site serves the whole tetrahedron: the nearest to a vertex, or to the middle of what is filled.
    fn is_served(&mut self, setting: &Setting, frame: &Frame) -> bool {
        let serves = |squares: &[[f64; 4]]| smooth::served(setting, frame, squares, smooth::PARTS) >> WHOLE & 1 == 1;
        if serves(&smooth::squares(&self.tree, frame)) {
            return true;
        }
        let weights = frame.values.map(|value| if value.least < 0 { 1.0 } else { 0.5 });
        let total: f64 = weights.iter().sum();
        let middle = place(&frame.positions, &weights.map(|weight| weight / total));
        let hit = self.tree.nearest(&middle, &self.near, Some(frame.values[0].node), setting.outer, 0.0);
        hit.is_some_and(|hit| {
            let site = self.tree.site(hit.site);
            serves(&[frame.positions.map(|x| site.distance_squared(&x))])
        })
    }

    /// Emits the surface of marching tetrahedra.
    fn march(&mut self, setting: &Setting, frame: &Frame, surface: &mut BlockSurface) {
        if frame.covered == WHOLE {
            return;
        }
        if !self.solid_nodes.is_empty() {
            let outside = (0..4).find(|k| frame.covered >> k & 1 == 0).unwrap_or(0);
            if self.inside_solid(&frame.positions[outside]) {
                return;
            }
        }
        // p, q, r, s even: p, or p and q, or p, q and r covered.
        let even = |p: usize| [[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]][p];
        let mut at = |p: usize, q: usize| self.edge(frame, (p, frame.values[p].least), (q, frame.values[q].least), surface);
        let polygon: ([u32; 4], usize) = match frame.covered.count_ones() {
            1 => {
                let [p, q, r, s] = even(frame.covered.trailing_zeros() as usize);
                ([at(p, q), at(p, r), at(p, s), 0], 3)
            }
            3 => {
                let [p, q, r, s] = even((!frame.covered & WHOLE).trailing_zeros() as usize);
                ([at(q, p), at(s, p), at(r, p), 0], 3)
            }
            _ => {
                let [p, q, r, s] = match frame.covered {
                    0b0011 => [0, 1, 2, 3],
                    0b0101 => [0, 2, 3, 1],
                    0b1001 => [0, 3, 1, 2],
                    0b0110 => [1, 2, 0, 3],
                    0b1010 => [1, 3, 2, 0],
                    _ => [2, 3, 0, 1],
                };
                ([at(p, r), at(p, s), at(q, s), at(q, r)], 4)
            }
        };
        let (mut polygon, count) = polygon;
        if frame.mirrored {
            polygon[..count].reverse();
        }
        surface.triangles.push([polygon[0], polygon[1], polygon[2]]);
        if count == 4 {
            surface.triangles.push([polygon[0], polygon[2], polygon[3]]);
        }
        if !setting.dense {
            surface.normals.resize(surface.triangles.len(), outwards(frame, frame.values.map(|value| value.least)));
        }
    }

    /// The vertex where an affine function with given values at a covered vertex p and another is zero.
    fn edge(&mut self, frame: &Frame, (p, from): (usize, i64), (q, to): (usize, i64), surface: &mut BlockSurface) -> u32 {
        let (first, second) = (p.min(q), p.max(q));
        let name = named(frame.numbers[first].iter().chain(&frame.numbers[second]).copied(), u64::from(p < q), 0);
        if let Some(&known) = self.names.get(&name) {
            return known;
        }
        let t = from as f64 / (from - to) as f64;
        let mut weights = [0.0; 4];
        (weights[p], weights[q]) = (1.0 - t, t);
        surface.vertices.push(place(&frame.positions, &weights));
        surface.names.push(name);
        let number = surface.vertices.len() as u32 - 1;
        self.names.insert(name, number);
        let faces = WHOLE & !(1 << p | 1 << q);
        if Self::is_shared(frame, faces, surface) {
            surface.shared.push((name, number));
        }
        number
    }

    /// The simplices that any site serves.
    fn served(&mut self, setting: &Setting, frame: &Frame, mut served: u16) -> u16 {
        let centre: Point = std::array::from_fn(|axis| frame.positions.iter().map(|x| 0.25 * x[axis]).sum());
        let radius = frame.positions.iter().map(|x| distance_squared(x, &centre)).fold(0.0, f64::max).sqrt();
        let mut found = std::mem::take(&mut self.found);
        found.clear();
        self.tree.collect(&centre, &self.near, setting.outer + radius, &mut found);
        for &id in &found {
            if smooth::smooth(served) >> WHOLE & 1 == 1 || self.cancel.reason().is_some() {
                break;
            }
            let site = self.tree.site(id);
            let squares = frame.positions.map(|x| site.distance_squared(&x));
            served = smooth::served(setting, frame, &[squares], served);
        }
        self.found = found;
        served
    }

    /// Lists the sites near what no site covers of a tetrahedron, which is left in `outside`.
    fn cut_sites(&mut self, setting: &Setting, frame: &Frame) -> Cut {
        self.outside.reset();
        self.nearby.clear();
        for k in 0..4 {
            let Value { square, site, .. } = frame.values[k];
            if square.is_finite()
                && self.nearby.iter().all(|nearby| nearby.site != site)
                && self.consider(setting, frame, site) == Cut::Empty
            {
                return Cut::Empty;
            }
        }
        let (centre, radius) = self.ball(frame);
        let first = self.nearby.len();
        let mut found = std::mem::take(&mut self.found);
        found.clear();
        self.tree.collect(&centre, &self.near, setting.outer + radius, &mut found);
        let mut cut = Cut::Changed;
        for &site in &found {
            let is_new = self.nearby[..first].iter().all(|nearby| nearby.site != site);
            if self.cancel.reason().is_some() || is_new && self.consider(setting, frame, site) == Cut::Empty {
                cut = Cut::Empty;
                break;
            }
        }
        self.found = found;
        cut
    }

    fn consider(&mut self, setting: &Setting, frame: &Frame, id: SiteId) -> Cut {
        let site = self.tree.site(id);
        let values = std::array::from_fn(|k| setting.integer(site.distance_squared(&frame.positions[k])));
        // A site that is farther than near + pitch from a vertex does not matter in the tetrahedron.
        if values.iter().any(|&value| value > setting.most) {
            return Cut::Missed;
        }
        let half_space = HalfSpace { values, name: name_of(&site) & !VIRTUAL, simplex: 0 };
        self.nearby.push(Nearby { site: id, half_space });
        if values.iter().all(|&value| value > 0) { Cut::Missed } else { self.outside.cut(half_space) }
    }

    /// A ball around what is left.
    fn ball(&self, frame: &Frame) -> (Point, f64) {
        let corners = self.outside.corners();
        let mut centre = [0.0; 3];
        for corner in corners {
            let at = place(&frame.positions, &corner.weights);
            centre = std::array::from_fn(|axis| centre[axis] + at[axis] / corners.len() as f64);
        }
        let square = corners.iter().map(|corner| distance_squared(&place(&frame.positions, &corner.weights), &centre)).fold(0.0, f64::max);
        (centre, square.sqrt())
    }

    /// Emits the polygons of the sites' facets.
    fn emit(&mut self, frame: &Frame, surface: &mut BlockSurface) {
        let outside = std::mem::take(&mut self.outside);
        self.corners.clear();
        self.corners.resize(outside.corners().len(), u32::MAX);
        for facet in FACES..outside.facets() {
            outside.polygon(facet, &mut self.polygon);
            if self.polygon.is_empty() {
                continue;
            }
            for index in 0..self.polygon.len() {
                let corner = usize::from(self.polygon[index]);
                if self.corners[corner] == u32::MAX {
                    self.corners[corner] = self.vertex(&outside, frame, corner, surface);
                }
            }
            self.numbers.clear();
            self.numbers.extend(self.polygon.iter().map(|&corner| self.corners[usize::from(corner)]));
            self.numbers.dedup();
            let normal = outwards(frame, outside.values(facet));
            let at = |k: usize| self.numbers[k];
            for k in 1..self.numbers.len().saturating_sub(1) {
                // Counter-clockwise seen from the polytope's outside is clockwise seen from the solid's.
                let triangle = if frame.mirrored { [at(0), at(k), at(k + 1)] } else { [at(0), at(k + 1), at(k)] };
                if triangle[0] != triangle[1] && triangle[0] != triangle[2] {
                    surface.triangles.push(triangle);
                    surface.normals.push(normal);
                }
            }
        }
        self.outside = outside;
    }

    /// The number of a corner in the block's list, made when first met.
    fn vertex(&mut self, outside: &Outside, frame: &Frame, index: usize, surface: &mut BlockSurface) -> u32 {
        let corner = &outside.corners()[index];
        let make = |name: VertexName, surface: &mut BlockSurface| {
            surface.vertices.push(place(&frame.positions, &corner.weights));
            surface.names.push(name);
            surface.vertices.len() as u32 - 1
        };
        let faces = corner.facets.iter().filter(|&&facet| facet < FACES).fold(0_u8, |bits, facet| bits | 1 << facet);
        if faces == 0 {
            return make(UNNAMED, surface);
        }
        let on = |k: &usize| faces >> k & 1 == 0;
        if let Some((from, to)) = coincidence(outside, corner, faces) {
            return self.edge(frame, from, to, surface);
        }
        let mut names = corner.facets.iter().filter(|&&facet| facet >= FACES).map(|&facet| match outside.simplex(facet) {
            0 => outside.name(facet),
            simplex => {
                let common = (0..4).filter(|k| on(k) && simplex >> k & 1 == 1).flat_map(|k| frame.numbers[k]);
                common.fold(VIRTUAL, |code, x| mix(code.rotate_left(9) ^ x as u64)) | VIRTUAL
            }
        });
        let name = if faces.count_ones() == 2 {
            // An edge: named by its vertices and which of them is covered from here.
            let mut ends = (0..4).filter(on);
            let (first, second) = (ends.next().unwrap_or(0), ends.next().unwrap_or(0));
            let values = outside.values(corner.facets.iter().copied().find(|&facet| facet >= FACES).unwrap_or(0));
            let from_first = values[first] < values[second];
            named(frame.numbers[first].iter().chain(&frame.numbers[second]).copied(), u64::from(from_first), 0)
        } else {
            let (p, q) = (names.next().unwrap_or(0), names.next().unwrap_or(0));
            named((0..4).filter(on).flat_map(|k| frame.numbers[k]), p.min(q), p.max(q))
        };
        if let Some(&known) = self.names.get(&name) {
            return known;
        }
        let number = make(name, surface);
        self.names.insert(name, number);
        if Self::is_shared(frame, faces, surface) {
            surface.shared.push((name, number));
        }
        number
    }

    /// Whether tetrahedra of other blocks may have the edge or face.
    fn is_shared(frame: &Frame, faces: u8, surface: &BlockSurface) -> bool {
        (0..3).any(|axis| {
            let first = UNITS * surface.first_cube[axis];
            let mut on = (0..4).filter(|k| faces >> k & 1 == 0).map(|k| i64::from(frame.numbers[k][axis]) - first);
            let (mut low, mut high) = (true, true);
            on.all(|fine| {
                low &= fine <= UNITS / 2;
                high &= fine >= UNITS * SIDE as i64;
                low || high
            })
        })
    }
}

/// Where two functions V on a face belong to simplices that differ by one vertex there, they are the same on the edge opposite to it, and cut it in one point: the
/// edge's covered end and the other one, with their values.
fn coincidence(outside: &Outside, corner: &Corner, faces: u8) -> Option<((usize, i64), (usize, i64))> {
    let own = |facet: u16| if facet >= FACES { outside.simplex(facet) & !faces } else { 0 };
    let mut simplices = corner.facets.iter().map(|&facet| own(facet)).filter(|&simplex| simplex != 0);
    let (first, second) = (simplices.next()?, simplices.next()?);
    if faces.count_ones() != 1 || (first ^ second).count_ones() != 1 {
        return None;
    }
    let facet = corner.facets.iter().copied().find(|&facet| own(facet) != 0)?;
    let values = outside.values(facet);
    let mut ends = (0..4).filter(|k| (faces | first ^ second) >> k & 1 == 0);
    let [p, q] = [ends.next()?, ends.next()?].map(|k| (k, values[k]));
    Some(if p.1 < q.1 { (p, q) } else { (q, p) })
}

/// A ball around all vertices of the sub-block that begins with a cube: corners 0 to SUB, and centres -1/2 to SUB + 1/2.
fn ball_around(setting: &Setting, first: [i64; 3]) -> (Point, f64) {
    let half = 0.5 * SUB as f64;
    let middle = setting.lattice.corner(first).map(|x| x + half * setting.lattice.pitch);
    (middle, (half + 0.5) * 3.0_f64.sqrt() * setting.lattice.pitch * 1.000_001)
}

/// Whether one direction does for a star: it leaves all triangles, and the distance grows along it.
fn follows(setting: &Setting, tree: &mut Tree<'_>, near: &[NodeId], star: &mut Star, direction: &Point, found: &mut Vec<SiteId>) -> bool {
    if !star.leaves(setting, direction) {
        return false;
    }
    // Most sites lie below all of the star, and most nodes.
    star.forget_sites();
    let (reach, lowest) = (setting.outer + star.radius(), star.lowest(setting, direction));
    found.clear();
    tree.collect_above(&star.centre, near, reach, direction, lowest, found);
    found.iter().for_each(|&id| star.see(tree.site(id)));
    star.follows(setting, direction)
}

/// Shows a star the sites that are within `reach` of its centre.
fn see(tree: &mut Tree<'_>, near: &[NodeId], reach: f64, star: &mut Star, found: &mut Vec<SiteId>) {
    found.clear();
    tree.collect(&star.centre, near, reach, found);
    found.iter().for_each(|&id| star.see(tree.site(id)));
}

/// The unit vector along which an affine function with these values grows.
fn outwards(frame: &Frame, values: [i64; 4]) -> [f32; 3] {
    let slope = Affine::new(&frame.positions, values.map(|value| value as f64)).slope;
    let length = dot(&slope, &slope).sqrt();
    slope.map(|part| (part / length) as f32)
}

/// The places of a cube of cubes.
fn cubes(side: usize) -> impl Iterator<Item = [i64; 3]> {
    (0..side.pow(3)).map(move |code| [code % side, code / side % side, code / side / side].map(|x| x as i64))
}

fn moved(at: [i64; 3], by: [i64; 3]) -> [i64; 3] {
    std::array::from_fn(|axis| at[axis] + by[axis])
}

/// Steps of a walk away from nearest sites.
const WALK: usize = 12;
/// How far the witnesses of vertices are from the closest points, in units of r.
pub(super) const WITNESS: f64 = 1.5;
/// The bit that tells names of V from those of sites.
const VIRTUAL: u64 = 1 << 63;

/// The name of a vertex on an edge or face: lattice vertices and what tells it from others there, mixed to 128 bits.
fn named(coordinates: impl Iterator<Item = i32>, first: u64, second: u64) -> VertexName {
    let (mut low, mut high) = (mix(first ^ 1), mix(second ^ 0x9E37_79B9_7F4A_7C15));
    for coordinate in coordinates {
        low = mix(low.rotate_left(7) ^ coordinate as u64);
        high = mix(high.rotate_left(11) ^ low ^ (coordinate as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    }
    u128::from(high) << 64 | u128::from(low)
}

pub(super) fn place(positions: &[Point; 4], weights: &[f64; 4]) -> Point {
    std::array::from_fn(|axis| (0..4).map(|k| weights[k] * positions[k][axis]).sum())
}

/// What a site is called in every block: its coordinates and its deficit, mixed. Sites where these are the same are one.
fn name_of(Weighted { site, deficit }: &Weighted) -> u64 {
    let own = deficit.to_bits();
    let add = |code: u64, point: &Point| point.iter().fold(code ^ own, |code, x| mix(code.rotate_left(5) ^ x.to_bits()));
    match site {
        Site::Point(a) => add(1, a),
        Site::Segment(ends) => ends.iter().fold(2, add),
        Site::Triangle(corners) => corners.iter().fold(3, add),
    }
}

/// The offset of x from the nearest point of a solid's triangle, along the pseudo-normal: negative inside.
pub(super) fn signed_side(attractor: &Attractor, solid: u32, root: u32, x: &Point) -> f64 {
    let surface = &attractor.solids()[solid as usize];
    let corners = &attractor.roots()[root as usize].points;
    let corner = |k: usize| [corners[k][0], corners[k][1], corners[k][2]];
    let (closest, feature) = closest_feature(x, &corner(0), &corner(1), &corner(2));
    let normals = &surface.normals[root as usize - surface.first_root];
    let normal = match feature {
        Feature::Face => normals[0],
        Feature::Side(k) => normals[1 + k as usize],
        Feature::Corner(k) => normals[4 + k as usize],
    };
    dot(&subtract(x, &closest), &normal.to_array())
}
