//! One block of the lattice: signs, the piece of surface, and its certificate.
//!
//! Lattice vertices are inside when d <= r. The surface cuts an edge from an inside vertex v0 to an outside
//! vertex v1 at p, the outermost of: the root of the linear interpolation of d^2, the exit of v0's nearest
//! site's ball, and the exit of v1's nearest site's ball if it continues the former. Then, with R the
//! radius of the tetrahedron's smallest enclosing ball:
//!
//! *Inner.* d^2 - |x|^2 is a minimum of affine functions, hence concave. p is no nearer to v0 than the linear
//! root, so the linear interpolant of d^2 is at least r^2 at every corner of the part of the tetrahedron
//! outside the solid, and d^2 >= r^2 - R^2 there: the solid contains D(sqrt(r^2 - R^2)).
//!
//! *Outer, a priori.* A point x of the part inside the solid is a convex combination of points y_k of the
//! tetrahedron, lattice vertices or points of balls, with sum w_k d(y_k)^2 <= r^2; so sum w_k d(y_k) <= r,
//! sum w_k |x - y_k| <= R, and d(x) <= r + R since d is 1-Lipschitz.
//!
//! *Outer, measured.* The distance to a convex site is convex, so on that part it is largest at a corner:
//! d <= min over sites of the largest corner distance.
//!
//! Roots are clamped to [t, 1 - t] of the edge, so that rounding to single precision keeps triangles apart
//! and not degenerate; the clamping and the rounding are added to both bounds.

use super::Setting;
use super::lattice::{CUTS, EDGE_ENDS, EDGES, Tetrahedron};
use super::tree::{Candidates, Hit, NodeId, SiteId, Tree};
use crate::attractor::Attractor;
use crate::attractor::cell::{Point, distance_squared, dot, subtract};
use crate::attractor::sites::{SiteError, SiteRule};
use crate::measure::triangle::{Feature, closest_feature};

/// Cubes along a block's side.
pub(super) const SIDE: usize = 16;
/// Cubes along the side of a sub-block, the unit that is skipped as a whole.
const SUB: usize = 4;
const LAYER: usize = SIDE + 1;
const VERTICES: usize = LAYER * LAYER * LAYER;
/// Value of a vertex not evaluated yet.
const UNKNOWN: f64 = f64::NAN;
/// Value of a vertex deeper than the band around the surface.
const DEEP: f64 = f64::NEG_INFINITY;
/// Value of a vertex beyond the band.
const FAR: f64 = f64::INFINITY;
const NONE: u32 = u32::MAX;
/// Steps of a walk away from nearest sites.
const WALK: usize = 12;
/// Where the surface passes a filled vertex, as a share of the edge.
const FILLED_CUT: f64 = 0.125;

/// On which side of the surface a lattice vertex is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Label {
    Unknown,
    Outside,
    Inside,
    /// Outside D_r, where no ball outside fits: see [`Workshop::label`].
    Filled,
}

/// The surface in one block, ready to be joined with its neighbours.
#[derive(Debug, Default)]
pub(super) struct BlockSurface {
    /// Index of the block's first cube.
    pub(super) first_cube: [i64; 3],
    /// Vertices on edges that the block owns, rounded to single precision.
    pub(super) vertices: Vec<[f32; 3]>,
    /// Corners: below `vertices.len()` own vertices, else entries of `foreign`.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Vertices on edges of following blocks.
    pub(super) foreign: Vec<ForeignVertex>,
    /// Own vertices that preceding blocks may use, by key: sorted.
    pub(super) shared: Vec<(u32, u32)>,
    /// max of d - r over the solid's part of the block, at most.
    pub(super) outer: f64,
    /// max of r^2 - (linear interpolant of d^2) over cut points: from clamping.
    pub(super) inner_square: f64,
    /// Leaf cells met.
    pub(super) leaves: u64,
    /// Largest errors of leaves met.
    pub(super) site_error: SiteError,
}

/// A vertex on an edge that belongs to a following block.
#[derive(Clone, Copy, Debug)]
pub(super) struct ForeignVertex {
    /// Where that block lies: a bit per axis.
    pub(super) block: u8,
    /// The edge's key there.
    pub(super) key: u32,
    /// Position, the same whoever computes it.
    pub(super) position: [f32; 3],
}

/// Working memory of a thread, reused from block to block.
pub(super) struct Workshop<'a> {
    attractor: &'a Attractor,
    tree: Tree<'a>,
    tetrahedra: Vec<Tetrahedron>,
    /// Squared distances at corner and centre vertices.
    values: [Vec<f64>; 2],
    closest: [Vec<Point>; 2],
    sites: [Vec<SiteId>; 2],
    /// Labels of corner and centre vertices.
    labels: [Vec<Label>; 2],
    edges: Vec<u32>,
    touched: Vec<u32>,
    near: Vec<NodeId>,
    cut_points: Vec<Point>,
    /// Starts of every solid's own triangles among the near nodes.
    solid_nodes: Vec<(u32, Vec<NodeId>)>,
    seed: Option<NodeId>,
}

impl<'a> Workshop<'a> {
    pub(super) fn new(rule: &'a SiteRule<'a>, setting: &Setting) -> Self {
        Self {
            attractor: rule.attractor(),
            tree: Tree::new(rule, setting.slack, 4 * setting.cells),
            tetrahedra: super::lattice::tetrahedra(),
            values: [vec![UNKNOWN; VERTICES], vec![UNKNOWN; VERTICES]],
            closest: [vec![[0.0; 3]; VERTICES], vec![[0.0; 3]; VERTICES]],
            sites: [vec![SiteId::Listed(0); VERTICES], vec![SiteId::Listed(0); VERTICES]],
            labels: [vec![Label::Unknown; VERTICES], vec![Label::Unknown; VERTICES]],
            edges: vec![NONE; VERTICES * EDGES],
            touched: Vec::new(),
            near: Vec::new(),
            cut_points: Vec::new(),
            solid_nodes: Vec::new(),
            seed: None,
        }
    }

    /// The surface in the block whose first cube is given; `open` lists the solids whose surface meets it.
    pub(super) fn surface(&mut self, setting: &Setting, first_cube: [i64; 3], candidates: &Candidates, open: &[u32]) -> BlockSurface {
        self.values.iter_mut().for_each(|values| values.fill(UNKNOWN));
        self.labels.iter_mut().for_each(|labels| labels.fill(Label::Unknown));
        self.touched.drain(..).for_each(|edge| self.edges[edge as usize] = NONE);
        self.cut_points.clear();
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
        let reach = half * 3.0_f64.sqrt() * setting.lattice.pitch * 1.000_001 + setting.gap;
        let solid = !open.is_empty();
        let band = setting.band;
        // Sites farther than this from the middle are nearest to no vertex that matters.
        let horizon = setting.radius + band + reach;
        let enough = setting.radius - half * 3.0_f64.sqrt() * setting.lattice.pitch * 1.000_001;
        let hit =
            self.tree.nearest(&middle, starts, self.seed, if solid { f64::INFINITY } else { horizon }, if solid { 0.0 } else { enough });
        let Some(hit) = hit else { return };
        let distance = hit.distance_squared.sqrt();
        let own = half * 3.0_f64.sqrt() * setting.lattice.pitch * 1.000_001;
        if distance - setting.radius > own + setting.gap || setting.radius - distance > own {
            return;
        }
        self.seed = Some(hit.node);
        let gathered = if solid { distance + 2.0 * reach } else { (distance + 2.0 * reach).min(horizon) };
        let mut near = std::mem::take(&mut self.near);
        self.tree.gather(&middle, starts, gathered, &mut near);
        self.near = near;
        self.gather_solids(starts, open, &middle, reach);
        for k in first[2]..first[2] + SUB {
            for j in first[1]..first[1] + SUB {
                for i in first[0]..first[0] + SUB {
                    self.cube(setting, [i, j, k], surface);
                }
            }
        }
    }

    /// For every solid whose surface is among the candidates: its nodes near the sub-block.
    fn gather_solids(&mut self, starts: &[NodeId], open: &[u32], middle: &Point, reach: f64) {
        self.solid_nodes.clear();
        for &solid in open {
            let own = |id: &NodeId| self.attractor.roots()[self.tree.root_of(*id) as usize].solid == Some(solid);
            let nodes: Vec<NodeId> = starts.iter().copied().filter(own).collect();
            if nodes.is_empty() {
                continue;
            }
            if let Some(hit) = self.tree.nearest(middle, &nodes, None, f64::INFINITY, 0.0) {
                let mut near = Vec::new();
                self.tree.gather(middle, &nodes, hit.distance_squared.sqrt() + 2.0 * reach, &mut near);
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

    /// The value of a vertex: d^2 within the band, else DEEP or FAR.
    fn value(&mut self, setting: &Setting, surface: &BlockSurface, centre: bool, cube: [usize; 3]) -> f64 {
        let (kind, index) = (usize::from(centre), Self::index(cube));
        let known = self.values[kind][index];
        if !known.is_nan() {
            return known;
        }
        let x = Self::position(setting, surface, centre, cube);
        let hit = self.tree.nearest(&x, &self.near, self.seed, setting.radius + setting.band, setting.deep);
        let value = match hit {
            None => {
                if self.inside_solid(&x) {
                    DEEP
                } else {
                    FAR
                }
            }
            Some(Hit { distance_squared, closest, site, node }) => {
                self.seed = Some(node);
                self.closest[kind][index] = closest;
                self.sites[kind][index] = site;
                if distance_squared < setting.deep_square || (distance_squared > setting.square && self.inside_solid(&x)) {
                    DEEP
                } else {
                    distance_squared
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

    /// The side of a vertex: inside D_r closed by a ball of radius `gap`.
    ///
    /// Where two walls of a crease come closer than a lattice edge, edges from wall to wall close the gap with no
    /// vertex in it, and a vertex left open deeper in the gap would be the inside of a false tunnel. Closing
    /// fills such gaps as a whole and leaves an outside as smooth as the lattice can follow. It adds points within
    /// `gap` of D_r; they are certified like everything else.
    fn label(&mut self, setting: &Setting, surface: &BlockSurface, centre: bool, cube: [usize; 3]) -> Label {
        let (kind, index) = (usize::from(centre), Self::index(cube));
        if self.labels[kind][index] != Label::Unknown {
            return self.labels[kind][index];
        }
        let value = self.value(setting, surface, centre, cube);
        let label = if value <= setting.square {
            Label::Inside
        } else if value <= setting.gap_square && self.in_gap(setting, surface, centre, cube) {
            Label::Filled
        } else {
            Label::Outside
        };
        self.labels[kind][index] = label;
        label
    }

    /// Whether no ball of radius `gap` outside D_r was found that contains the vertex. Its centre is sought by
    /// walking away from the nearest site, as far as the vertex allows. In a crease the walk leads out of the
    /// gap and is held by the vertex; where it comes to rest before, it is in a neck between two parts of the
    /// outside, which stays open if it is wide enough for the lattice.
    fn in_gap(&mut self, setting: &Setting, surface: &BlockSurface, centre: bool, cube: [usize; 3]) -> bool {
        let (kind, index) = (usize::from(centre), Self::index(cube));
        let x = Self::position(setting, surface, centre, cube);
        let free = setting.radius + setting.gap;
        let mut nearest = self.closest[kind][index];
        let mut y = x;
        let (mut clearance, mut held) = (0.0, false);
        for _ in 0..WALK {
            let away = subtract(&y, &nearest);
            let scale = free / dot(&away, &away).sqrt();
            let target: Point = std::array::from_fn(|axis| nearest[axis] + scale * away[axis]);
            let offset = subtract(&target, &x);
            let length = dot(&offset, &offset).sqrt();
            let share = if length > setting.gap { setting.gap / length } else { 1.0 };
            y = std::array::from_fn(|axis| x[axis] + share * offset[axis]);
            match self.tree.nearest(&y, &self.near, self.seed, free * (1.0 - 1e-3), 0.0) {
                None => return false,
                Some(hit) => {
                    nearest = hit.closest;
                    clearance = hit.distance_squared.sqrt() - setting.radius;
                }
            }
            held = share < 1.0;
        }
        held || clearance < setting.neck
    }

    /// The twelve tetrahedra of a cube, unless its centre is so far from the surface that none is cut.
    fn cube(&mut self, setting: &Setting, cube: [usize; 3], surface: &mut BlockSurface) {
        if !self.value(setting, surface, true, cube).is_finite() {
            return;
        }
        for number in 0..self.tetrahedra.len() {
            let tetrahedron = self.tetrahedra[number];
            let mut inside = 0;
            for (position, vertex) in tetrahedron.vertices.iter().enumerate() {
                let label = self.label(setting, surface, vertex.centre, shifted(cube, vertex.offset));
                inside |= usize::from(label != Label::Outside) << position;
            }
            match inside {
                0 => {}
                15 => self.certify_full(setting, surface, &tetrahedron, cube),
                _ => self.cut(setting, surface, &tetrahedron, cube, inside),
            }
        }
    }

    /// Emits the triangles of a tetrahedron that the surface cuts, and certifies its part of the solid.
    fn cut(&mut self, setting: &Setting, surface: &mut BlockSurface, tetrahedron: &Tetrahedron, cube: [usize; 3], inside: usize) {
        let cuts = CUTS[inside];
        let mut corners = [0_u32; 4];
        let mut part = [[0.0; 3]; 7];
        let mut count = 0;
        for (corner, &edge) in corners.iter_mut().zip(cuts) {
            *corner = self.edge_vertex(setting, surface, tetrahedron, cube, inside, edge);
            part[count] = self.cut_points[*corner as usize];
            count += 1;
        }
        let quadrilateral = [part[0], part[1], part[2], part[3]];
        if cuts.len() == 3 {
            surface.triangles.push([corners[0], corners[1], corners[2]]);
        } else if distance_squared(&quadrilateral[0], &quadrilateral[2]) <= distance_squared(&quadrilateral[1], &quadrilateral[3]) {
            surface.triangles.push([corners[0], corners[1], corners[2]]);
            surface.triangles.push([corners[0], corners[2], corners[3]]);
        } else {
            surface.triangles.push([corners[1], corners[2], corners[3]]);
            surface.triangles.push([corners[1], corners[3], corners[0]]);
        }
        for (position, vertex) in tetrahedron.vertices.iter().enumerate() {
            if inside >> position & 1 == 1 {
                let at = shifted(cube, vertex.offset);
                part[count] = Self::position(setting, surface, vertex.centre, at);
                count += 1;
            }
        }
        self.certify(setting, surface, tetrahedron, cube, &part[..count]);
    }

    /// A tetrahedron inside the solid may still reach beyond D(r): where creases meet over its middle.
    fn certify_full(&mut self, setting: &Setting, surface: &mut BlockSurface, tetrahedron: &Tetrahedron, cube: [usize; 3]) {
        let mut largest = DEEP;
        for vertex in &tetrahedron.vertices {
            let value = self.values[usize::from(vertex.centre)][Self::index(shifted(cube, vertex.offset))];
            if value == DEEP {
                return;
            }
            largest = largest.max(value);
        }
        let enough = setting.radius + surface.outer - setting.enclosing;
        if enough > 0.0 && largest <= enough * enough {
            return;
        }
        let part = tetrahedron.vertices.map(|vertex| Self::position(setting, surface, vertex.centre, shifted(cube, vertex.offset)));
        self.certify(setting, surface, tetrahedron, cube, &part);
    }

    /// Raises the block's outer bound to that of a convex part of a tetrahedron, given by its corners p_k.
    ///
    /// For sites c_i: d(x) - r <= e_i(x) = sum w_k (|p_k - c_i| - r) for x = sum w_k p_k, by convexity, so
    /// d(x) - r <= sum m_i e_i(x) for all weights m_i that sum to 1, and the largest entry of the combined row
    /// sum m_i (|p_k - c_i| - r) bounds the part. [`game_value`] looks for good weights.
    fn certify(&mut self, setting: &Setting, surface: &mut BlockSurface, tetrahedron: &Tetrahedron, cube: [usize; 3], part: &[Point]) {
        let mut excess = [[0.0_f64; 7]; 4];
        let mut sites = 0;
        let mut best = f64::INFINITY;
        let mut filled = false;
        for vertex in &tetrahedron.vertices {
            let (kind, index) = (usize::from(vertex.centre), Self::index(shifted(cube, vertex.offset)));
            filled |= self.labels[kind][index] == Label::Filled;
            if !self.values[kind][index].is_finite() {
                continue;
            }
            let site = self.tree.site(self.sites[kind][index]);
            let row = &mut excess[sites];
            for (entry, corner) in row.iter_mut().zip(part) {
                *entry = site.distance_squared(corner).sqrt() - setting.radius;
            }
            best = best.min(row[..part.len()].iter().copied().fold(f64::NEG_INFINITY, f64::max));
            if best <= surface.outer {
                return;
            }
            sites += 1;
        }
        best = best.min(game_value(&mut excess[..sites], part.len(), surface.outer));
        if best <= surface.outer {
            return;
        }
        // Without filled vertices the bound a priori holds too.
        surface.outer = surface.outer.max(if filled { best } else { best.min(setting.enclosing) });
    }

    /// The vertex where the surface cuts an edge: made once.
    fn edge_vertex(
        &mut self,
        setting: &Setting,
        surface: &mut BlockSurface,
        tetrahedron: &Tetrahedron,
        cube: [usize; 3],
        inside: usize,
        edge: usize,
    ) -> u32 {
        let lattice_edge = tetrahedron.edges[edge];
        let owner = shifted(cube, lattice_edge.offset);
        let key = Self::index(owner) * EDGES + lattice_edge.number as usize;
        if self.edges[key] != NONE {
            return self.edges[key];
        }
        let (p, q) = EDGE_ENDS[edge];
        let (from, to) = if inside >> p & 1 == 1 { (p, q) } else { (q, p) };
        let end = |position: usize| {
            let vertex = tetrahedron.vertices[position];
            let at = shifted(cube, vertex.offset);
            let (kind, index) = (usize::from(vertex.centre), Self::index(at));
            End {
                at: Self::position(setting, surface, vertex.centre, at),
                square: self.values[kind][index],
                closest: self.closest[kind][index],
            }
        };
        let (start, stop) = (end(from), end(to));
        // A filled vertex is beyond r already: the surface passes close to it.
        let (point, slack) = if start.square > setting.square {
            (std::array::from_fn(|axis| start.at[axis] + FILLED_CUT * (stop.at[axis] - start.at[axis])), 0.0)
        } else {
            crossing(setting, &start, &stop)
        };
        surface.inner_square = surface.inner_square.max(slack);
        let local = self.cut_points.len() as u32;
        self.cut_points.push(point);
        self.edges[key] = local;
        self.touched.push(key as u32);
        local
    }

    /// Renumbers the corners so that own vertices come first, and lists what others need.
    pub(super) fn finish(&mut self, surface: &mut BlockSurface) {
        let mut renumbered = vec![0_u32; self.cut_points.len()];
        let mut foreign = Vec::new();
        for &key in &self.touched {
            let local = self.edges[key as usize] as usize;
            let (cube, number) = (key as usize / EDGES, key as usize % EDGES);
            let at = [cube % LAYER, cube / LAYER % LAYER, cube / (LAYER * LAYER)];
            let block = (0..3).fold(0_u8, |bits, axis| bits | u8::from(at[axis] == SIDE) << axis);
            let own = at.map(|x| x % SIDE);
            let own_key = (Self::index(own) * EDGES + number) as u32;
            if block != 0 {
                foreign.push((local, block, own_key));
                continue;
            }
            renumbered[local] = surface.vertices.len() as u32;
            if at.contains(&0) {
                surface.shared.push((own_key, renumbered[local]));
            }
            surface.vertices.push(self.cut_points[local].map(|x| x as f32));
        }
        for (local, block, key) in foreign {
            renumbered[local] = (surface.vertices.len() + surface.foreign.len()) as u32;
            surface.foreign.push(ForeignVertex { block, key, position: self.cut_points[local].map(|x| x as f32) });
        }
        for triangle in &mut surface.triangles {
            *triangle = triangle.map(|corner| renumbered[corner as usize]);
        }
        surface.shared.sort_unstable();
    }
}

fn shifted(cube: [usize; 3], offset: [u8; 3]) -> [usize; 3] {
    std::array::from_fn(|axis| cube[axis] + offset[axis] as usize)
}

/// A small value of `max_k sum_i m_i rows[i][k]` over weights m: the best pair of rows, then the best
/// combination of that with each other row. Stops at `enough`. Every value that it meets is a bound.
fn game_value(rows: &mut [[f64; 7]], corners: usize, enough: f64) -> f64 {
    let mut best = f64::INFINITY;
    let mut combined = [0.0; 7];
    for first in 0..rows.len() {
        for second in 0..first {
            let (value, row) = best_combination(&rows[first], &rows[second], corners);
            if value < best {
                (best, combined) = (value, row);
                if best <= enough {
                    return best;
                }
            }
        }
    }
    for _ in 0..2 {
        for row in rows.iter() {
            let (value, next) = best_combination(&combined, row, corners);
            if value < best {
                (best, combined) = (value, next);
                if best <= enough {
                    return best;
                }
            }
        }
    }
    best
}

/// min over m in [0, 1] of the largest entry of m a + (1 - m) b, with the combination: at an end, or where two
/// entries, one falling and one rising, meet.
fn best_combination(a: &[f64; 7], b: &[f64; 7], corners: usize) -> (f64, [f64; 7]) {
    let combine = |m: f64| -> [f64; 7] { std::array::from_fn(|k| m * a[k] + (1.0 - m) * b[k]) };
    let largest = |row: &[f64; 7]| row[..corners].iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // By duality the value is the largest, over pairs of corners, of where their two lines meet; its m is
    // the minimiser.
    let (mut value, mut at) = (f64::NEG_INFINITY, 0.0);
    for k in 0..corners {
        let lesser = a[k].min(b[k]);
        if lesser > value {
            (value, at) = (lesser, if a[k] < b[k] { 1.0 } else { 0.0 });
        }
        for l in 0..k {
            let (dk, dl) = (a[k] - b[k], a[l] - b[l]);
            if dk * dl < 0.0 {
                let m = (b[l] - b[k]) / (dk - dl);
                let meet = m * a[k] + (1.0 - m) * b[k];
                if (0.0..=1.0).contains(&m) && meet > value {
                    (value, at) = (meet, m);
                }
            }
        }
    }
    let row = combine(at);
    (largest(&row), row)
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

struct End {
    at: Point,
    square: f64,
    closest: Point,
}

/// Where the surface cuts the edge between an inside and an outside vertex, and by how much the linear
/// interpolant of d^2 is below r^2 there (only clamping does that).
fn crossing(setting: &Setting, from: &End, to: &End) -> (Point, f64) {
    let along = subtract(&to.at, &from.at);
    let length_squared = dot(&along, &along);
    let square = setting.square;
    let linear = (square - from.square) / (to.square - from.square);
    // |v0 + s e - c|^2 = r^2 for the two nearest points c.
    let exits = |closest: &Point| {
        let offset = subtract(&from.at, closest);
        let half = dot(&along, &offset) / length_squared;
        let rest = (dot(&offset, &offset) - square) / length_squared;
        let discriminant = half * half - rest;
        (discriminant >= 0.0).then(|| (-half - discriminant.sqrt(), -half + discriminant.sqrt()))
    };
    let mut at = linear;
    if let Some((_, exit)) = exits(&from.closest) {
        at = at.max(exit);
    }
    if let Some((enter, exit)) = exits(&to.closest)
        && enter <= at
    {
        at = at.max(exit);
    }
    let at = at.clamp(setting.clamp, 1.0 - setting.clamp);
    let interpolated = from.square + at * (to.square - from.square);
    (std::array::from_fn(|axis| from.at[axis] + at * along[axis]), (square - interpolated).max(0.0))
}
