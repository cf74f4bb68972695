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

use super::plan::Setting;
use super::lattice::{Cube, Grading, LEVELS, Number, UNITS, is_mirrored};
use super::outside::{Cut, FACES, HalfSpace, Outside};
use super::tree::{Candidates, NodeId, SiteId, Tree};
use crate::attractor::Attractor;
use crate::attractor::cell::{Point, Site, distance_squared, dot, subtract};
use crate::attractor::sites::{SiteError, SiteRule};
use crate::measure::triangle::{Feature, closest_feature};
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Cubes along a block's side.
pub(super) const SIDE: usize = 16;
/// Cubes along the side of a sub-block, the unit that is skipped as a whole.
const SUB: usize = 4;
const LAYER: usize = SIDE + 1;
const VERTICES: usize = LAYER * LAYER * LAYER;
/// Value of a vertex not evaluated yet.
const UNKNOWN: f64 = f64::NAN;
/// Value of a vertex so near to a site that it covers every tetrahedron there.
const DEEP: f64 = f64::NEG_INFINITY;
/// Value of a vertex that no site covers.
const FAR: f64 = f64::INFINITY;

/// The surface in one block, ready to be joined with its neighbours.
#[derive(Debug, Default)]
pub(super) struct BlockSurface {
    /// Index of the block's first cube.
    pub(super) first_cube: [i64; 3],
    /// Vertices in mm.
    pub(super) vertices: Vec<Point>,
    /// Corners.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Whether a vertex was tried by the simplification with all of its star; empty before.
    pub(super) settled: Vec<bool>,
    /// Names of vertices that other blocks may have too.
    pub(super) shared: Vec<(VertexName, u32)>,
    /// Leaf cells met.
    pub(super) leaves: u64,
    /// Largest errors of leaves met.
    pub(super) site_error: SiteError,
    /// Cubes to subdivide: the distance may have a critical point below r there that the solid leaves out.
    pub(super) critical: Vec<Cube>,
    /// Places where no level tells it.
    pub(super) uncertain: Vec<Cube>,
}

/// What a vertex on an edge or a face of the lattice is called by every tetrahedron there.
pub(super) type VertexName = u128;

/// Names are mixed already.
#[derive(Default)]
pub(super) struct NameHasher(u64);

impl Hasher for NameHasher {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u128(u128::from(byte));
        }
    }
    fn write_u128(&mut self, name: u128) {
        self.0 = mix(self.0 ^ name as u64 ^ mix((name >> 64) as u64));
    }
}

/// A bijection of 64 bits that spreads every bit (the finaliser of SplitMix64).
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

/// The four vertices of a tetrahedron in the order of their numbers.
struct Frame {
    numbers: [Number; 4],
    positions: [Point; 4],
    /// The nearest site of every vertex that is near one.
    nearest: [Option<SiteId>; 4],
    /// Whether a site covers a vertex.
    covered: bool,
    /// The finer level of the two cubes.
    level: u32,
    /// Whether the order turned the tetrahedron inside out.
    mirrored: bool,
}

/// A site that matters in a tetrahedron.
#[derive(Clone, Copy)]
struct Nearby {
    site: SiteId,
    half_space: HalfSpace,
}

/// Working memory of a thread, reused from block to block.
pub(super) struct Workshop<'a> {
    attractor: &'a Attractor,
    tree: Tree<'a>,
    /// Squared distances at the vertices of level 0, corners and centres, and their nearest sites.
    values: [Vec<Value>; 2],
    /// Those of other vertices.
    fine: HashMap<Number, Value>,
    near: Vec<NodeId>,
    /// Starts of every solid's own triangles among the near nodes.
    solid_nodes: Vec<(u32, Vec<NodeId>)>,
    seed: Option<NodeId>,
    outside: Outside,
    found: Vec<SiteId>,
    nearby: Vec<Nearby>,
    polygon: Vec<u16>,
    corners: Vec<u32>,
    closest: Vec<Point>,
    rest: Vec<Point>,
    leaves: Vec<Cube>,
    names: HashMap<VertexName, u32, BuildHasherDefault<NameHasher>>,
}

/// What is known of a vertex.
#[derive(Clone, Copy)]
struct Value {
    square: f64,
    site: SiteId,
}

const NOTHING: Value = Value { square: UNKNOWN, site: SiteId::Listed(0) };

impl<'a> Workshop<'a> {
    pub(super) fn new(rule: &'a SiteRule<'a>, setting: &Setting) -> Self {
        Self {
            attractor: rule.attractor(),
            tree: Tree::new(rule, setting.slack, 4 * setting.cells),
            values: [vec![NOTHING; VERTICES], vec![NOTHING; VERTICES]],
            fine: HashMap::new(),
            near: Vec::new(),
            solid_nodes: Vec::new(),
            seed: None,
            outside: Outside::default(),
            found: Vec::new(),
            nearby: Vec::new(),
            polygon: Vec::new(),
            corners: Vec::new(),
            closest: Vec::new(),
            rest: Vec::new(),
            leaves: Vec::new(),
            names: HashMap::default(),
        }
    }

    /// The surface in the block whose first cube is given; `open` lists the solids whose surface meets it.
    pub(super) fn surface(
        &mut self,
        setting: &Setting,
        grading: &Grading,
        first_cube: [i64; 3],
        candidates: &Candidates,
        open: &[u32],
    ) -> BlockSurface {
        self.values.iter_mut().for_each(|values| values.fill(NOTHING));
        self.fine.clear();
        self.names.clear();
        self.seed = None;
        let starts: Vec<NodeId> = self.tree.reset(candidates).collect();
        let mut surface = BlockSurface { first_cube, ..BlockSurface::default() };
        for k in (0..SIDE).step_by(SUB) {
            for j in (0..SIDE).step_by(SUB) {
                for i in (0..SIDE).step_by(SUB) {
                    self.sub_block(setting, grading, &starts, open, [i, j, k], &mut surface);
                }
            }
        }
        surface.shared.sort_unstable();
        surface.critical.sort_unstable();
        surface.critical.dedup();
        surface.uncertain.sort_unstable();
        surface.uncertain.dedup();
        surface.leaves = self.tree.leaves;
        surface.site_error = self.tree.largest_error;
        surface
    }

    /// Whether the last block needed more cells than allowed: its surface is then incomplete.
    pub(super) fn is_exhausted(&self) -> bool {
        self.tree.exhausted
    }

    /// A sub-block: skipped when its middle is too far from the surface for any of its tetrahedra.
    fn sub_block(
        &mut self,
        setting: &Setting,
        grading: &Grading,
        starts: &[NodeId],
        open: &[u32],
        first: [usize; 3],
        surface: &mut BlockSurface,
    ) {
        // Its vertices span the corners 0 to SUB and centres -1/2 to SUB + 1/2.
        let half = 0.5 * SUB as f64;
        let first: [i64; 3] = std::array::from_fn(|axis| surface.first_cube[axis] + first[axis] as i64);
        let middle: Point = setting.lattice.corner(first).map(|x| x + half * setting.lattice.pitch);
        let half = (half + 0.5) * 3.0_f64.sqrt() * setting.lattice.pitch * 1.000_001;
        let horizon = setting.near + half;
        let hit = self.tree.nearest(&middle, starts, self.seed, horizon, setting.reach - half);
        let Some(hit) = hit else { return };
        if hit.distance_squared.sqrt() + half < setting.reach {
            // One site covers all.
            return;
        }
        self.seed = Some(hit.node);
        let mut near = std::mem::take(&mut self.near);
        self.tree.gather(&middle, starts, horizon, &mut near);
        self.near = near;
        self.gather_solids(starts, open, &middle, half);
        let mut leaves = std::mem::take(&mut self.leaves);
        for k in 0..SUB as i64 {
            for j in 0..SUB as i64 {
                for i in 0..SUB as i64 {
                    leaves.clear();
                    grading.leaves(Cube { level: 0, index: [first[0] + i, first[1] + j, first[2] + k] }, &mut leaves);
                    for &leaf in &leaves {
                        grading.tetrahedra(leaf, &mut |numbers| self.tetrahedron(setting, numbers, leaf.level, surface));
                    }
                }
            }
        }
        self.leaves = leaves;
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
        const HALF: i64 = UNITS / 2;
        let local: [i64; 3] = std::array::from_fn(|axis| i64::from(number[axis]) - UNITS * surface.first_cube[axis]);
        let centre = local[0] % UNITS == HALF;
        let whole = local.iter().all(|x| x % UNITS == if centre { HALF } else { 0 } && *x >= 0);
        if !whole {
            if let Some(&known) = self.fine.get(&number) {
                return known;
            }
            let value = self.measured(setting, number);
            self.fine.insert(number, value);
            return value;
        }
        let cube = local.map(|x| (x / UNITS) as usize);
        let index = (cube[2] * LAYER + cube[1]) * LAYER + cube[0];
        let known = self.values[usize::from(centre)][index];
        if !known.square.is_nan() {
            return known;
        }
        let value = self.measured(setting, number);
        self.values[usize::from(centre)][index] = value;
        value
    }

    fn measured(&mut self, setting: &Setting, number: Number) -> Value {
        let x = setting.lattice.position(number);
        let Some(hit) = self.tree.nearest(&x, &self.near, self.seed, setting.near, setting.deep) else {
            return Value { square: FAR, ..NOTHING };
        };
        self.seed = Some(hit.node);
        let square = if hit.distance_squared < setting.deep * setting.deep { DEEP } else { hit.distance_squared };
        Value { square, site: hit.site }
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

    /// The vertices of a tetrahedron, if sites are near and none covers all of it for sure.
    fn frame(
        &mut self,
        setting: &Setting,
        mut numbers: [Number; 4],
        level: u32,
        surface: &BlockSurface,
    ) -> Option<Frame> {
        numbers.sort_unstable();
        let mut values = [NOTHING; 4];
        let mut near = false;
        for (value, &number) in values.iter_mut().zip(&numbers) {
            *value = self.value(setting, surface, number);
            if value.square == DEEP {
                return None;
            }
            near |= value.square != FAR;
        }
        if !near {
            return None;
        }
        let covered = values.iter().any(|value| setting.integer(value.square) < 0);
        Some(Frame {
            numbers,
            positions: numbers.map(|number| setting.lattice.position(number)),
            nearest: values.map(|value| (value.square != FAR).then_some(value.site)),
            covered,
            level,
            mirrored: is_mirrored(&numbers),
        })
    }

    /// Cuts what all sites cover out of a tetrahedron and emits the surface of the rest; notes the cubes to subdivide if a critical
    /// point of the distance may be left out.
    fn tetrahedron(
        &mut self,
        setting: &Setting,
        numbers: [Number; 4],
        level: u32,
        surface: &mut BlockSurface,
    ) {
        let Some(frame) = self.frame(setting, numbers, level, surface) else { return };
        if self.cut_sites(setting, &frame) == Cut::Empty {
            return;
        }
        if self.may_be_critical(setting, &frame) {
            self.search_critical(setting, &frame, surface);
        }
        if !frame.covered {
            return;
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

    /// Lists the sites near what no site covers of a tetrahedron, which is left in `outside`.
    fn cut_sites(&mut self, setting: &Setting, frame: &Frame) -> Cut {
        self.outside.reset();
        self.nearby.clear();
        for k in 0..4 {
            let Some(site) = frame.nearest[k] else { continue };
            if self.nearby.iter().all(|nearby| nearby.site != site) && self.consider(setting, frame, site) == Cut::Empty {
                return Cut::Empty;
            }
        }
        let (centre, radius) = self.ball(frame);
        let first = self.nearby.len();
        let mut found = std::mem::take(&mut self.found);
        found.clear();
        self.tree.collect(&centre, &self.near, setting.reach + radius, &mut found);
        let mut cut = Cut::Changed;
        for &site in &found {
            if self.nearby[..first].iter().all(|nearby| nearby.site != site) && self.consider(setting, frame, site) == Cut::Empty {
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
        let half_space = HalfSpace { values, name: name_of(&site) };
        self.nearby.push(Nearby { site: id, half_space });
        if values.iter().all(|&value| value > 0) { Cut::Missed } else { self.outside.cut(half_space) }
    }

    /// Whether the distance to the sites may have a critical point below r in the part of the tetrahedron that the solid leaves out.
    ///
    /// A point x is critical when it lies in the convex hull of its closest points. By Morse theory D(r) is, up to homotopy, D(s) with the hulls of the critical points
    /// of values in (s, r] attached (Chazal, Cohen-Steiner and Lieutier, 2009); the solid contains D(s), s the lattice's inner bound, and where no critical point is left out, those hulls. The closest point of
    /// a convex site to a point of the tetrahedron lies in the hull of those of its vertices for points and segments (on a
    /// segment, the parameter is a clamped affine function), and near it for triangles. So if a plane parts the two hulls, there is none.
    fn may_be_critical(&mut self, setting: &Setting, frame: &Frame) -> bool {
        if self.nearby.len() < 2 {
            return false;
        }
        let slope = setting.bands[frame.level as usize] as f64;
        let corners = self.outside.corners();
        let least = |values: &[i64; 4]| -> f64 {
            corners.iter().map(|corner| (0..4).map(|k| corner.weights[k] * values[k] as f64).sum()).fold(f64::INFINITY, f64::min)
        };
        self.closest.clear();
        let mut active = 0;
        for nearby in &self.nearby {
            if least(&nearby.half_space.values) <= slope {
                active += 1;
                let site = self.tree.site(nearby.site);
                if let Site::Point(point) = site {
                    self.closest.push(point);
                } else {
                    self.closest.extend(frame.positions.iter().map(|x| site.closest(x)));
                }
            }
        }
        if active < 2 {
            return false;
        }
        self.rest.clear();
        self.rest.extend(corners.iter().map(|corner| place(&frame.positions, &corner.weights)));
        !are_parted(&self.rest, &self.closest)
    }

    /// Looks closer at what is left of a tetrahedron, and notes the cubes that must be subdivided so that critical points below r
    /// are in the solid.
    fn search_critical(&mut self, setting: &Setting, frame: &Frame, surface: &mut BlockSurface) {
        let low: Point = std::array::from_fn(|axis| self.rest.iter().map(|x| x[axis]).fold(f64::INFINITY, f64::min));
        let high: Point = std::array::from_fn(|axis| self.rest.iter().map(|x| x[axis]).fold(f64::NEG_INFINITY, f64::max));
        let half = (0..3).map(|axis| 0.5 * (high[axis] - low[axis])).fold(0.0, f64::max);
        let smallest = setting.lattice.pitch / f64::from(1 << (frame.level + 5));
        let mut open = vec![(std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis])), half)];
        let mut work = 0;
        let mut closest = std::mem::take(&mut self.closest);
        while let Some((middle, half)) = open.pop() {
            let around = half * 3.0_f64.sqrt();
            work += 1;
            let distance = self.closest_around(&middle, around, &mut closest);
            if distance - around > setting.reach || self.is_covered(frame, &middle, around) {
                continue;
            }
            // Closest points of other points of the cube are within `around` of these.
            if is_farther(&middle, &closest, 2.0 * around) {
                continue;
            }
            if half > smallest && work < MOST_WORK {
                let offset = |octant: u32, axis: usize| if octant >> axis & 1 == 1 { 0.5 * half } else { -0.5 * half };
                open.extend((0..8).map(|octant| (std::array::from_fn(|axis| middle[axis] + offset(octant, axis)), 0.5 * half)));
                continue;
            }
            let within = std::array::from_fn(|axis| (middle[axis] - setting.lattice.origin[axis]) / setting.lattice.pitch);
            if frame.level < LEVELS {
                surface.critical.push(Cube::containing(frame.level, within));
            } else {
                surface.uncertain.push(Cube::containing(0, within));
            }
        }
        self.closest = closest;
    }

    /// The distance of a point from the sites of the tetrahedron, and the closest points of those that may be nearest to a point within
    /// `around` of it.
    fn closest_around(&self, x: &Point, around: f64, closest: &mut Vec<Point>) -> f64 {
        closest.clear();
        closest.extend(self.nearby.iter().map(|nearby| self.tree.site(nearby.site).closest(x)));
        let least = closest.iter().map(|point| distance_squared(x, point)).fold(f64::INFINITY, f64::min).sqrt();
        let most = (least + 2.0 * around).powi(2);
        closest.retain(|point| distance_squared(x, point) <= most);
        least
    }

    /// Whether one site covers the ball of radius `around` a point, as the lattice sees it.
    fn is_covered(&self, frame: &Frame, x: &Point, around: f64) -> bool {
        let (base, columns) = (&frame.positions[0], [1, 2, 3].map(|k| subtract(&frame.positions[k], &frame.positions[0])));
        let dual = [cross(&columns[1], &columns[2]), cross(&columns[2], &columns[0]), cross(&columns[0], &columns[1])];
        let determinant = dot(&columns[0], &dual[0]);
        let offset = subtract(x, base);
        self.nearby.iter().any(|nearby| {
            let values = nearby.half_space.values.map(|value| value as f64);
            let slope: Point = std::array::from_fn(|axis| (0..3).map(|k| (values[k + 1] - values[0]) * dual[k][axis]).sum::<f64>() / determinant);
            values[0] + dot(&slope, &offset) + around * dot(&slope, &slope).sqrt() < 0.0
        })
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
            let polygon = &self.polygon;
            let at = |k: usize| self.corners[usize::from(polygon[k])];
            for k in 1..polygon.len() - 1 {
                // Counter-clockwise seen from the polytope's outside is clockwise seen from the solid's.
                surface.triangles.push(if frame.mirrored { [at(0), at(k), at(k + 1)] } else { [at(0), at(k + 1), at(k)] });
            }
        }
        self.outside = outside;
    }

    /// The number of a corner in the block's list, made when first met.
    fn vertex(&mut self, outside: &Outside, frame: &Frame, index: usize, surface: &mut BlockSurface) -> u32 {
        let corner = &outside.corners()[index];
        let make = |surface: &mut BlockSurface| {
            surface.vertices.push(place(&frame.positions, &corner.weights));
            surface.vertices.len() as u32 - 1
        };
        let faces = corner.facets.iter().filter(|&&facet| facet < FACES).fold(0_u8, |bits, facet| bits | 1 << facet);
        if faces == 0 {
            return make(surface);
        }
        let mut names = corner.facets.iter().filter(|&&facet| facet >= FACES).map(|&facet| outside.name(facet));
        let name = if faces.count_ones() == 2 {
            // An edge: named by its vertices and which of them is covered from here.
            let mut ends = (0..4).filter(|k| faces >> k & 1 == 0);
            let (first, second) = (ends.next().unwrap_or(0), ends.next().unwrap_or(0));
            let values = outside.values(corner.facets.iter().copied().find(|&facet| facet >= FACES).unwrap_or(0));
            let from_first = values[first] < values[second];
            named(frame.numbers[first].iter().chain(&frame.numbers[second]).copied(), u64::from(from_first), 0)
        } else {
            let (p, q) = (names.next().unwrap_or(0), names.next().unwrap_or(0));
            let on = (0..4).filter(|k| faces >> k & 1 == 0).flat_map(|k| frame.numbers[k]);
            named(on, p.min(q), p.max(q))
        };
        if let Some(&known) = self.names.get(&name) {
            return known;
        }
        let number = make(surface);
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

/// The name of a vertex on an edge or face: lattice vertices and what tells it from others there, mixed to 128 bits.
fn named(coordinates: impl Iterator<Item = i32>, first: u64, second: u64) -> VertexName {
    let (mut low, mut high) = (mix(first ^ 1), mix(second ^ 0x9E37_79B9_7F4A_7C15));
    for coordinate in coordinates {
        low = mix(low.rotate_left(7) ^ coordinate as u64);
        high = mix(high.rotate_left(11) ^ low ^ (coordinate as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    }
    u128::from(high) << 64 | u128::from(low)
}

/// Cubes that the search for critical points in a tetrahedron may look at.
const MOST_WORK: usize = 4000;

/// Whether a point is surely farther than `distance` from the convex hull of others.
fn is_farther(x: &Point, others: &[Point], distance: f64) -> bool {
    let Some(first) = others.first() else { return true };
    // The shortest vector found so far from the hull to x.
    let mut shortest = subtract(x, first);
    for _ in 0..STEPS {
        let square = dot(&shortest, &shortest);
        if square <= distance * distance {
            return false;
        }
        let along = |point: &&Point| dot(&shortest, point);
        let Some(farthest) = others.iter().max_by(|a, b| along(a).total_cmp(&along(b))) else { return true };
        let support = subtract(x, farthest);
        let product = dot(&shortest, &support);
        if product > 0.0 && product * product > distance * distance * square {
            return true;
        }
        let step = subtract(&support, &shortest);
        let share = (-dot(&shortest, &step) / dot(&step, &step).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        shortest = std::array::from_fn(|axis| shortest[axis] + share * step[axis]);
    }
    false
}

/// Steps of the search for a plane.
const STEPS: usize = 32;

/// Whether a plane was found that parts two sets of points: Gilbert's search for the shortest difference (1966). When it gives up, there may be one yet.
fn are_parted(points: &[Point], others: &[Point]) -> bool {
    let mean = |points: &[Point]| -> Point {
        std::array::from_fn(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / points.len().max(1) as f64)
    };
    let mut shortest = subtract(&mean(points), &mean(others));
    for _ in 0..STEPS {
        let along = |point: &&Point| dot(&shortest, point);
        let first = points.iter().min_by(|a, b| along(a).total_cmp(&along(b)));
        let second = others.iter().max_by(|a, b| along(a).total_cmp(&along(b)));
        let (Some(first), Some(second)) = (first, second) else { return true };
        let support = subtract(first, second);
        let square = dot(&shortest, &shortest);
        if dot(&shortest, &support) > 1e-9 * square {
            return true;
        }
        let step = subtract(&support, &shortest);
        let share = (-dot(&shortest, &step) / dot(&step, &step).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        shortest = std::array::from_fn(|axis| shortest[axis] + share * step[axis]);
        if dot(&shortest, &shortest) <= 1e-18 * dot(&support, &support) {
            return false;
        }
    }
    false
}

fn cross(a: &Point, b: &Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn place(positions: &[Point; 4], weights: &[f64; 4]) -> Point {
    std::array::from_fn(|axis| (0..4).map(|k| weights[k] * positions[k][axis]).sum())
}

/// What a site is called in every block: its coordinates, mixed. Sites with the same coordinates are one.
fn name_of(site: &Site) -> u64 {
    let add = |code: u64, point: &Point| point.iter().fold(code, |code, x| mix(code.rotate_left(5) ^ x.to_bits()));
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
