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
use super::lattice::{LatticeVertex, Tetrahedron};
use super::outside::{Cut, FACES, HalfSpace, MOST, Outside};
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
    /// Names of vertices that other blocks may have too.
    pub(super) shared: Vec<(VertexName, u32)>,
    /// Leaf cells met.
    pub(super) leaves: u64,
    /// Largest errors of leaves met.
    pub(super) site_error: SiteError,
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
    numbers: [u64; 4],
    positions: [Point; 4],
    /// The nearest site of every vertex that one covers.
    nearest: [Option<SiteId>; 4],
    /// Whether the order turned the tetrahedron inside out.
    mirrored: bool,
}

/// Working memory of a thread, reused from block to block.
pub(super) struct Workshop<'a> {
    attractor: &'a Attractor,
    tree: Tree<'a>,
    tetrahedra: Vec<Tetrahedron>,
    /// Squared distances at corner and centre vertices.
    values: [Vec<f64>; 2],
    sites: [Vec<SiteId>; 2],
    near: Vec<NodeId>,
    /// Starts of every solid's own triangles among the near nodes.
    solid_nodes: Vec<(u32, Vec<NodeId>)>,
    seed: Option<NodeId>,
    outside: Outside,
    found: Vec<SiteId>,
    polygon: Vec<u16>,
    corners: Vec<u32>,
    names: HashMap<VertexName, u32, BuildHasherDefault<NameHasher>>,
}

impl<'a> Workshop<'a> {
    pub(super) fn new(rule: &'a SiteRule<'a>, setting: &Setting) -> Self {
        Self {
            attractor: rule.attractor(),
            tree: Tree::new(rule, setting.slack, 4 * setting.cells),
            tetrahedra: super::lattice::tetrahedra(),
            values: [vec![UNKNOWN; VERTICES], vec![UNKNOWN; VERTICES]],
            sites: [vec![SiteId::Listed(0); VERTICES], vec![SiteId::Listed(0); VERTICES]],
            near: Vec::new(),
            solid_nodes: Vec::new(),
            seed: None,
            outside: Outside::default(),
            found: Vec::new(),
            polygon: Vec::new(),
            corners: Vec::new(),
            names: HashMap::default(),
        }
    }

    /// The surface in the block whose first cube is given; `open` lists the solids whose surface meets it.
    pub(super) fn surface(&mut self, setting: &Setting, first_cube: [i64; 3], candidates: &Candidates, open: &[u32]) -> BlockSurface {
        self.values.iter_mut().for_each(|values| values.fill(UNKNOWN));
        self.names.clear();
        self.seed = None;
        let starts: Vec<NodeId> = self.tree.reset(candidates).collect();
        let mut surface = BlockSurface { first_cube, ..BlockSurface::default() };
        for k in (0..SIDE).step_by(SUB) {
            for j in (0..SIDE).step_by(SUB) {
                for i in (0..SIDE).step_by(SUB) {
                    self.sub_block(setting, &starts, open, [i, j, k], &mut surface);
                }
            }
        }
        surface.shared.sort_unstable();
        surface.leaves = self.tree.leaves;
        surface.site_error = self.tree.largest_error;
        surface
    }

    /// Whether the last block needed more cells than allowed: its surface is then incomplete.
    pub(super) fn is_exhausted(&self) -> bool {
        self.tree.exhausted
    }

    /// A sub-block: skipped when its middle is too far from the surface for any of its tetrahedra.
    fn sub_block(&mut self, setting: &Setting, starts: &[NodeId], open: &[u32], first: [usize; 3], surface: &mut BlockSurface) {
        // Its vertices span the corners 0 to SUB and centres 1/2 to SUB + 1/2.
        let half = 0.5 * (SUB as f64 + 0.5);
        let corner = setting.lattice.corner(std::array::from_fn(|axis| surface.first_cube[axis] + first[axis] as i64));
        let middle: Point = corner.map(|x| x + half * setting.lattice.pitch);
        let half = half * 3.0_f64.sqrt() * setting.lattice.pitch * 1.000_001;
        let horizon = setting.reach + half;
        let hit = self.tree.nearest(&middle, starts, self.seed, horizon, setting.reach - half);
        let Some(hit) = hit else { return };
        if hit.distance_squared.sqrt() + half < setting.reach {
            // One site covers every vertex.
            return;
        }
        self.seed = Some(hit.node);
        let mut near = std::mem::take(&mut self.near);
        self.tree.gather(&middle, starts, horizon, &mut near);
        self.near = near;
        self.gather_solids(starts, open, &middle, half);
        for k in first[2]..first[2] + SUB {
            for j in first[1]..first[1] + SUB {
                for i in first[0]..first[0] + SUB {
                    for number in 0..self.tetrahedra.len() {
                        self.tetrahedron(setting, number, [i, j, k], surface);
                    }
                }
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

    /// Position of a cube in the working arrays.
    #[inline]
    fn index(cube: [usize; 3]) -> usize {
        (cube[2] * LAYER + cube[1]) * LAYER + cube[0]
    }

    fn position(setting: &Setting, surface: &BlockSurface, centre: bool, cube: [usize; 3]) -> Point {
        let index = std::array::from_fn(|axis| surface.first_cube[axis] + cube[axis] as i64);
        if centre { setting.lattice.centre(index) } else { setting.lattice.corner(index) }
    }

    /// The value of a vertex: d^2 where a site covers it, else FAR; DEEP where that is sure to cover all around.
    fn value(&mut self, setting: &Setting, surface: &BlockSurface, centre: bool, cube: [usize; 3]) -> f64 {
        let (kind, index) = (usize::from(centre), Self::index(cube));
        let known = self.values[kind][index];
        if !known.is_nan() {
            return known;
        }
        let x = Self::position(setting, surface, centre, cube);
        let value = match self.tree.nearest(&x, &self.near, self.seed, setting.reach, setting.deep) {
            None => FAR,
            Some(hit) => {
                self.seed = Some(hit.node);
                self.sites[kind][index] = hit.site;
                if hit.distance_squared.sqrt() < setting.deep {
                    DEEP
                } else if setting.integer(hit.distance_squared) < 0 {
                    hit.distance_squared
                } else {
                    FAR
                }
            }
        };
        self.values[kind][index] = value;
        value
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

    /// The vertices of a tetrahedron, if some are covered and none is deep.
    fn frame(&mut self, setting: &Setting, number: usize, cube: [usize; 3], surface: &BlockSurface) -> Option<Frame> {
        let tetrahedron = self.tetrahedra[number];
        let mut covered = false;
        for vertex in &tetrahedron.vertices {
            let value = self.value(setting, surface, vertex.centre, shifted(cube, vertex.offset));
            if value == DEEP {
                return None;
            }
            covered |= value != FAR;
        }
        if !covered {
            return None;
        }
        let number_of = |vertex: &LatticeVertex| -> u64 {
            let at = shifted(cube, vertex.offset);
            (0..3).fold(0, |code, axis| {
                let fine = 2 * (surface.first_cube[axis] + at[axis] as i64) as u64 + u64::from(vertex.centre);
                code << 21 | fine
            })
        };
        let mut order = [0, 1, 2, 3];
        let numbers = tetrahedron.vertices.map(|vertex| number_of(&vertex));
        order.sort_unstable_by_key(|&k| numbers[k]);
        let inversions = (0..4).flat_map(|k| (0..k).map(move |l| (k, l))).filter(|&(k, l)| order[l] > order[k]).count();
        let vertices = order.map(|k| tetrahedron.vertices[k]);
        Some(Frame {
            numbers: order.map(|k| numbers[k]),
            positions: vertices.map(|vertex| Self::position(setting, surface, vertex.centre, shifted(cube, vertex.offset))),
            nearest: vertices.map(|vertex| {
                let (kind, index) = (usize::from(vertex.centre), Self::index(shifted(cube, vertex.offset)));
                (self.values[kind][index] != FAR).then(|| self.sites[kind][index])
            }),
            mirrored: inversions % 2 == 1,
        })
    }

    /// Cuts what all sites cover out of a tetrahedron and emits the surface of the rest.
    fn tetrahedron(&mut self, setting: &Setting, number: usize, cube: [usize; 3], surface: &mut BlockSurface) {
        let Some(frame) = self.frame(setting, number, cube, surface) else { return };
        self.outside.reset();
        let mut tried: [Option<SiteId>; 4] = [None; 4];
        for k in 0..4 {
            let Some(site) = frame.nearest[k] else { continue };
            if !tried.contains(&Some(site)) {
                tried[k] = Some(site);
                if self.cut(setting, &frame, site) == Cut::Empty {
                    return;
                }
            }
        }
        let (centre, radius) = self.ball(&frame);
        let mut found = std::mem::take(&mut self.found);
        found.clear();
        self.tree.collect(&centre, &self.near, setting.reach + radius, &mut found);
        let mut empty = false;
        for &site in &found {
            if !tried.contains(&Some(site)) && self.cut(setting, &frame, site) == Cut::Empty {
                empty = true;
                break;
            }
        }
        self.found = found;
        if empty {
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

    fn cut(&mut self, setting: &Setting, frame: &Frame, site: SiteId) -> Cut {
        let site = self.tree.site(site);
        let values = frame.positions.map(|x| setting.integer(site.distance_squared(&x)));
        // A site that is farther than reach + pitch from a vertex covers nothing of the tetrahedron.
        if values.iter().any(|&value| value > MOST) || values.iter().all(|&value| value > 0) {
            return Cut::Missed;
        }
        self.outside.cut(HalfSpace { values, name: name_of(&site) })
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
        let on = (0..4).filter(|k| faces >> k & 1 == 0).map(|k| frame.numbers[k]);
        let name = if faces.count_ones() == 2 {
            // An edge: named by its vertices and which of them is covered from here.
            let mut ends = (0..4).filter(|k| faces >> k & 1 == 0);
            let (first, second) = (ends.next().unwrap_or(0), ends.next().unwrap_or(0));
            let values = outside.values(corner.facets.iter().copied().find(|&facet| facet >= FACES).unwrap_or(0));
            let from_first = values[first] < values[second];
            (u128::from(frame.numbers[first]) << 63 | u128::from(frame.numbers[second])) << 1 | u128::from(from_first)
        } else {
            let (p, q) = (names.next().unwrap_or(0), names.next().unwrap_or(0));
            let mut low = mix(p.min(q));
            let mut high = mix(p.max(q) ^ 0x9E37_79B9_7F4A_7C15);
            for number in on {
                low = mix(low ^ number);
                high = mix(high.rotate_left(17) ^ number.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ p.wrapping_add(q));
            }
            u128::from(high) << 64 | u128::from(low) | 1 << 127
        };
        if let Some(&known) = self.names.get(&name) {
            return known;
        }
        let number = make(surface);
        self.names.insert(name, number);
        if self.is_shared(frame, faces, surface) {
            surface.shared.push((name, number));
        }
        number
    }

    /// Whether tetrahedra of other blocks may have the edge or face.
    fn is_shared(&self, frame: &Frame, faces: u8, surface: &BlockSurface) -> bool {
        let mask = (1_u64 << 21) - 1;
        (0..3).any(|axis| {
            let first = 2 * surface.first_cube[axis] as u64;
            let mut on = (0..4).filter(|k| faces >> k & 1 == 0).map(|k| (frame.numbers[k] >> (21 * (2 - axis)) & mask) - first);
            let (mut low, mut high) = (true, true);
            on.all(|fine| {
                low &= fine <= 1;
                high &= fine >= 2 * SIDE as u64;
                low || high
            })
        })
    }
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

fn shifted(cube: [usize; 3], offset: [u8; 3]) -> [usize; 3] {
    std::array::from_fn(|axis| cube[axis] + offset[axis] as usize)
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
