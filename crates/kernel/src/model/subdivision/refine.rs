//! One step of a scheme on a mesh: the refined mesh, and every refined vertex as an affine combination of the
//! vertices before.
//!
//! Catmull and Clark, "Recursively generated B-spline surfaces on arbitrary topological meshes", Computer-Aided
//! Design 10(6), 1978; Loop, "Smooth subdivision surfaces based on triangles", 1987, with his own weights; Doo and
//! Sabin, "Behaviour of recursive division surfaces near extraordinary points", Computer-Aided Design 10(6), 1978.
//! Sharp edges and vertices as in OpenSubdiv's uniform rules (DeRose, Kass, Truong, "Subdivision surfaces in
//! character animation", SIGGRAPH 1998): sharpness falls by 1 each step, and where a vertex changes its rule in
//! between, its two positions are mixed by the mean fraction that was left.

use super::host::{Host, NONE, Sharpness, Side, decayed};
use super::{Coefficients, Scheme};
use std::f64::consts::TAU;

/// For every refined vertex its weights on the vertices before; empty where a neighbour is missing.
#[derive(Clone, Debug, Default)]
pub(super) struct Masks {
    start: Vec<u32>,
    entries: Vec<(u32, f64)>,
}

impl Masks {
    /// The weights of one refined vertex; each vertex occurs once.
    pub(super) fn of(&self, vertex: u32) -> &[(u32, f64)] {
        &self.entries[self.start[vertex as usize] as usize..self.start[vertex as usize + 1] as usize]
    }

    fn push(&mut self, mut mask: Vec<(u32, f64)>) {
        if self.start.is_empty() {
            self.start.push(0);
        }
        mask.sort_unstable_by_key(|entry| entry.0);
        mask.dedup_by(|right, left| {
            let same = left.0 == right.0;
            if same {
                left.1 += right.1;
            }
            same
        });
        self.entries.extend(mask);
        self.start.push(self.entries.len() as u32);
    }
}

/// A scheme and what replaces its masks.
#[derive(Clone, Debug)]
pub(super) struct Rules {
    pub(super) scheme: Scheme,
    /// Doo-Sabin: by region of faces, from region 1 on.
    pub(super) coefficients: Vec<Coefficients>,
}

impl Rules {
    /// Doo-Sabin: the weight of the vertex i places after the corner, in a face of n sides.
    fn corner_weight(&self, region: u32, n: usize, i: usize) -> f64 {
        let own = (region as usize).checked_sub(1).and_then(|region| self.coefficients.get(region));
        if let Some(weights) = own.and_then(|own| own.weights.iter().find(|weights| weights.len() == n)) {
            return weights[i];
        }
        let sides = n as f64;
        if i == 0 { 0.25 + 1.25 / sides } else { (3.0 + 2.0 * (TAU * i as f64 / sides).cos()) / (4.0 * sides) }
    }
}

/// Refines a mesh once.
///
/// Refined vertices are numbered: those of vertices, edges, faces (Catmull-Clark, Loop), or half-edges (Doo-Sabin).
/// Face h of the refined mesh is the corner at half-edge h; with Loop, the middles of the faces follow; with
/// Doo-Sabin, face f is the image of face f. Linear in the mesh.
pub(super) fn refine(rules: &Rules, host: &Host) -> (Host, Masks) {
    match rules.scheme {
        Scheme::CatmullClark | Scheme::Loop => primal(&rules.scheme, host),
        Scheme::DooSabin => dual(rules, host),
    }
}

/// The number of every edge, by half-edge; wires follow.
fn edge_numbers(host: &Host) -> (Vec<u32>, u32) {
    let mut numbers = vec![NONE; host.origin.len()];
    let mut count = 0;
    for h in 0..host.origin.len() {
        let twin = host.twin[h];
        numbers[h] = if twin != NONE && (twin as usize) < h {
            numbers[twin as usize]
        } else {
            count += 1;
            count - 1
        };
    }
    (numbers, count)
}

fn primal(scheme: &Scheme, host: &Host) -> (Host, Masks) {
    let (numbers, edges) = edge_numbers(host);
    let (vertices, wires) = (host.vertices as u32, host.wires.len() as u32);
    let edge_point = |h: u32| vertices + numbers[h as usize];
    let mut masks = Masks::default();
    for vertex in 0..vertices {
        masks.push(vertex_mask(scheme, host, vertex));
    }
    for h in (0..host.origin.len() as u32).filter(|&h| h < host.twin[h as usize]) {
        masks.push(edge_mask(scheme, host, h));
    }
    for wire in &host.wires {
        masks.push(vec![(wire[0], 0.5), (wire[1], 0.5)]);
    }
    let mut refined = if *scheme == Scheme::Loop {
        triangles(host, &edge_point)
    } else {
        for face in 0..host.faces() as u32 {
            let mut mask = Vec::with_capacity(host.sides(face));
            add_face(host, face, 1.0, &mut mask);
            masks.push(mask);
        }
        quads(host, &edge_point, vertices + edges + wires)
    };
    refined.vertices = masks.start.len().saturating_sub(1);
    refined.wires = host.wires.iter().zip(vertices + edges..).flat_map(|(&[a, b], m)| [[a, m], [m, b]]).collect();
    refined.corner = host.corner.iter().map(|&sharpness| decayed(sharpness)).collect();
    refined.corner.resize(refined.vertices, 0.0);
    (refined.complete(), masks)
}

/// Faces of Catmull-Clark: the corner at h is v, e(h), f, e(previous h).
fn quads(host: &Host, edge_point: &dyn Fn(u32) -> u32, first_face_point: u32) -> Host {
    let mut refined = Host::default();
    for h in 0..host.origin.len() as u32 {
        let (twin, previous) = (host.twin[h as usize], host.previous(h));
        let before = host.twin[previous as usize];
        let face = host.face[h as usize];
        refined.first.push(4 * h);
        refined.region.push(host.region[face as usize]);
        refined.origin.extend([host.origin[h as usize], edge_point(h), first_face_point + face, edge_point(previous)]);
        refined.face.extend([h; 4]);
        let across = if twin == NONE { NONE } else { 4 * host.next(twin) + 3 };
        refined.twin.extend([across, 4 * host.next(h) + 2, 4 * previous + 1, if before == NONE { NONE } else { 4 * before }]);
        let sharpness = [h, previous].map(|edge| decayed(host.sharpness[edge as usize]));
        refined.sharpness.extend([sharpness[0], 0.0, 0.0, sharpness[1]]);
    }
    refined.first.push(refined.origin.len() as u32);
    refined
}

/// Faces of Loop: the corner at h is v, e(h), e(previous h); then the middles e(h0), e(h1), e(h2).
fn triangles(host: &Host, edge_point: &dyn Fn(u32) -> u32) -> Host {
    let mut refined = Host::default();
    let count = host.origin.len() as u32;
    for h in 0..count {
        let (twin, previous) = (host.twin[h as usize], host.previous(h));
        let (before, face) = (host.twin[previous as usize], host.face[h as usize]);
        refined.first.push(3 * h);
        refined.region.push(host.region[face as usize]);
        refined.origin.extend([host.origin[h as usize], edge_point(h), edge_point(previous)]);
        refined.face.extend([h; 3]);
        let across = if twin == NONE { NONE } else { 3 * host.next(twin) + 2 };
        // The middle's side from e(previous h) to e(h) is that of the half-edge before h.
        refined.twin.extend([across, 3 * count + previous, if before == NONE { NONE } else { 3 * before }]);
        let sharpness = [h, previous].map(|edge| decayed(host.sharpness[edge as usize]));
        refined.sharpness.extend([sharpness[0], 0.0, sharpness[1]]);
    }
    for h in 0..count {
        if h % 3 == 0 {
            refined.first.push(3 * count + h);
            refined.region.push(host.region[(h / 3) as usize]);
        }
        refined.origin.push(edge_point(h));
        refined.face.push(count + h / 3);
        refined.twin.push(3 * host.next(h) + 1);
        refined.sharpness.push(0.0);
    }
    refined.first.push(refined.origin.len() as u32);
    refined
}

/// Adds the centroid of a face, times `weight`.
fn add_face(host: &Host, face: u32, weight: f64, mask: &mut Vec<(u32, f64)>) {
    let share = weight / host.sides(face) as f64;
    mask.extend(host.half_edges(face).map(|h| (host.origin[h as usize], share)));
}

fn edge_mask(scheme: &Scheme, host: &Host, h: u32) -> Vec<(u32, f64)> {
    let side = host.side(h);
    let crease = host.sharpness[h as usize].min(1.0);
    let mut mask = vec![(side.from, 0.5 * crease), (side.to, 0.5 * crease)];
    if crease < 1.0 {
        let twin = host.twin[h as usize];
        if twin == NONE {
            return Vec::new();
        }
        let smooth = 1.0 - crease;
        let (end, across) = if *scheme == Scheme::Loop { (0.375, 0.125) } else { (0.25, 0.25) };
        mask.extend([(side.from, smooth * end), (side.to, smooth * end)]);
        for half in [h, twin] {
            if *scheme == Scheme::Loop {
                mask.push((host.origin[host.previous(half) as usize], smooth * across));
            } else {
                add_face(host, host.face[half as usize], smooth * across, &mut mask);
            }
        }
    }
    mask
}

/// Which rule a vertex follows.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Rule {
    /// No or one sharp edge.
    Smooth,
    Crease,
    Corner,
}

fn rule(corner: Sharpness, edges: impl Iterator<Item = Sharpness>) -> Rule {
    match edges.filter(|&sharpness| sharpness > 0.0).count() {
        _ if corner > 0.0 => Rule::Corner,
        0 | 1 => Rule::Smooth,
        2 => Rule::Crease,
        _ => Rule::Corner,
    }
}

fn vertex_mask(scheme: &Scheme, host: &Host, vertex: u32) -> Vec<(u32, f64)> {
    let corner = host.corner[vertex as usize];
    if corner.is_infinite() {
        return vec![(vertex, 1.0)];
    }
    if let Some([a, b]) = host.crease(vertex) {
        return vec![(vertex, 0.75), (a, 0.125), (b, 0.125)];
    }
    let start = host.out[vertex as usize];
    if start == NONE {
        return Vec::new();
    }
    let (mut around, mut behind) = (Vec::new(), Vec::new());
    let closed = host.fan(start, false, &mut around, &mut behind);
    let mut edges: Vec<(u32, Sharpness)> = around.iter().map(|&h| (host.destination(h), host.sharpness[h as usize])).collect();
    if !closed {
        let last = host.previous(around[around.len() - 1]);
        edges.push((host.origin[last as usize], host.sharpness[last as usize]));
    }
    let before = rule(corner, edges.iter().map(|edge| edge.1));
    let after = rule(decayed(corner), edges.iter().map(|edge| decayed(edge.1)));
    let crease = |level: &dyn Fn(Sharpness) -> Sharpness| -> Vec<(u32, f64)> {
        let ends = edges.iter().filter(|edge| level(edge.1) > 0.0).map(|edge| (edge.0, 0.125));
        std::iter::once((vertex, 0.75)).chain(ends).collect()
    };
    let mask = |rule: Rule, level: &dyn Fn(Sharpness) -> Sharpness| match rule {
        Rule::Corner => vec![(vertex, 1.0)],
        Rule::Crease => crease(level),
        // The faces of a vertex on the rim of a stencil are not all known.
        Rule::Smooth if !closed => Vec::new(),
        Rule::Smooth => smooth_vertex(scheme, host, vertex, &around),
    };
    if before == after {
        return mask(before, &|sharpness| sharpness);
    }
    // What fades in this step, and how much of the step it lasts.
    let fading = edges.iter().map(|edge| edge.1).chain(std::iter::once(corner)).filter(|&s| s > 0.0 && decayed(s) == 0.0);
    let (sum, count) = fading.fold((0.0, 0.0), |(sum, count), sharpness| (sum + sharpness, count + 1.0));
    let share: f64 = if count > 0.0 { sum / count } else { 0.0 };
    let (old, new) = (mask(before, &|sharpness| sharpness), mask(after, &decayed));
    if old.is_empty() || (new.is_empty() && share < 1.0) {
        return Vec::new();
    }
    let mixed =
        old.into_iter().map(|(v, weight)| (v, weight * share)).chain(new.into_iter().map(|(v, weight)| (v, weight * (1.0 - share))));
    mixed.filter(|entry| entry.1 != 0.0).collect()
}

/// `around`: the half-edges that leave the vertex, counterclockwise.
fn smooth_vertex(scheme: &Scheme, host: &Host, vertex: u32, around: &[u32]) -> Vec<(u32, f64)> {
    let n = around.len() as f64;
    if *scheme == Scheme::Loop {
        let edge = (0.625 - (0.375 + 0.25 * (TAU / n).cos()).powi(2)) / n;
        let ends = around.iter().map(|&h| (host.destination(h), edge));
        return std::iter::once((vertex, 1.0 - n * edge)).chain(ends).collect();
    }
    let mut mask = vec![(vertex, (n - 2.0) / n)];
    for &h in around {
        mask.push((host.destination(h), 1.0 / (n * n)));
        add_face(host, host.face[h as usize], 1.0 / (n * n), &mut mask);
    }
    mask
}

/// Doo-Sabin: a vertex for every corner of a face; faces of faces, edges and vertices.
fn dual(rules: &Rules, host: &Host) -> (Host, Masks) {
    let mut masks = Masks::default();
    for h in 0..host.origin.len() as u32 {
        let face = host.face[h as usize];
        let n = host.sides(face);
        let mut corner = h;
        let mut mask = Vec::with_capacity(n);
        for i in 0..n {
            mask.push((host.origin[corner as usize], rules.corner_weight(host.region[face as usize], n, i)));
            corner = host.next(corner);
        }
        masks.push(mask);
    }
    let mut faces: Vec<Vec<u32>> = (0..host.faces() as u32).map(|face| host.half_edges(face).collect()).collect();
    let mut region = host.region.clone();
    // A face between faces of one region belongs to it, one between regions to none.
    let region_of = |h: u32| host.region[host.face[h as usize] as usize];
    let common = |half_edges: &[u32]| {
        let first = region_of(half_edges[0]);
        if half_edges.iter().all(|&h| region_of(h) == first) { first } else { 0 }
    };
    for h in (0..host.origin.len() as u32).filter(|&h| h < host.twin[h as usize] && host.twin[h as usize] != NONE) {
        let twin = host.twin[h as usize];
        faces.push(vec![host.next(h), h, host.next(twin), twin]);
        region.push(common(&[h, twin]));
    }
    let (mut ahead, mut behind) = (Vec::new(), Vec::new());
    for &start in host.out.iter().filter(|&&start| start != NONE) {
        if host.fan(start, false, &mut ahead, &mut behind) {
            faces.push(ahead.clone());
            region.push(common(&ahead));
        }
    }
    (Host::new(host.origin.len(), &faces, region).complete(), masks)
}

/// The number of the refined vertex on an edge (Catmull-Clark, Loop).
pub(super) fn edge_point(host: &Host, side: &Side) -> u32 {
    let (numbers, edges) = edge_numbers(host);
    let vertices = host.vertices as u32;
    if side.half_edge != NONE {
        return vertices + numbers[side.half_edge as usize];
    }
    let is_wire = |wire: &[u32; 2]| *wire == [side.from, side.to] || *wire == [side.to, side.from];
    vertices + edges + host.wires.iter().position(is_wire).unwrap_or(0) as u32
}
