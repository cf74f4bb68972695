//! From the cell complex to triangles and segments.

use super::address::Origin;
use super::{Builder, CellComplex, NONE};
use crate::attractor::cell::Point;
use crate::tessellation::Tessellation;
use glam::DVec3;
use std::sync::Arc;

impl Builder<'_> {
    /// The leaf edges of an edge, each with whether it runs backwards: in order from its start to its end when it is
    /// a curve.
    fn leaf_edges(&self, edge: u32, backwards: bool, out: &mut Vec<(u32, bool)>) {
        let own = &self.edges[edge as usize];
        if own.collapsed {
            return;
        }
        if own.pieces == NONE {
            out.push((edge, backwards));
            return;
        }
        let topology = self.topology.state(own.state);
        let mut child = |(child, turned): (usize, bool)| {
            self.leaf_edges(self.pieces[own.pieces as usize + child], turned != backwards, out);
        };
        match &topology.chain {
            Some(chain) if backwards => chain.iter().rev().for_each(|&link| child(link)),
            Some(chain) => chain.iter().for_each(|&link| child(link)),
            None => (0..topology.split.children.len()).for_each(|index| child((index, false))),
        }
    }

    /// What is drawn of a leaf edge: a segment, or one to every end but the first of a wire that branches.
    fn arms(&self, edge: u32) -> impl Iterator<Item = [u32; 2]> {
        let own = &self.edges[edge as usize];
        let (first, rest) = own.vertices.split_first().map_or((NONE, &[][..]), |(first, rest)| (*first, rest));
        rest.iter().map(move |&end| [first, end])
    }

    /// Start and end of a leaf edge.
    fn ends(&self, (edge, backwards): (u32, bool)) -> [u32; 2] {
        let own = &self.edges[edge as usize];
        let [start, end] = self.topology.ends(own.state).map_or([0, 0], |[a, b]| [own.vertices[a], own.vertices[b]]);
        if backwards { [end, start] } else { [start, end] }
    }

    /// The tessellation of all that was refined.
    pub(in crate::attractor) fn draw(mut self) -> Tessellation {
        let loops = self.loops();
        let mut tally = Tally::new(self.vertices.len(), self.edges.len());
        let flips = orientations(&loops, self.edges.len());
        for edges in &loops {
            edges.iter().for_each(|&edge| tally.count(edge.0, [self.ends(edge)].into_iter(), true));
        }
        let mut wires = Vec::new();
        for index in 0..self.wires.len() {
            self.leaf_edges(self.wires[index], false, &mut wires);
        }
        for &(edge, _) in &wires {
            tally.count(edge, self.arms(edge), false);
            self.edges[edge as usize].vertices.iter().for_each(|&vertex| tally.used[vertex as usize] = true);
        }
        let mut complex = tally.complex(loops.len());
        let mut tessellation = Tessellation { leaf_cells: self.leaves, deviation_mm: self.deviation, ..Tessellation::default() };
        let mut place = vec![NONE; self.vertices.len()];
        for (vertex, index) in place.iter_mut().enumerate().filter(|(vertex, _)| tally.used[*vertex]) {
            *index = tessellation.vertices.len() as u32;
            tessellation.vertices.push(DVec3::from_array(self.vertices[vertex]));
            complex.vertex_origins.push(self.vertex_origins[vertex]);
        }
        let mut outline = Vec::new();
        for (index, edges) in loops.iter().enumerate() {
            outline.clear();
            outline.extend(edges.iter().map(|&edge| place[self.ends(edge)[0] as usize]));
            if flips[index] {
                outline.reverse();
            }
            let face = &self.faces[index];
            fill(&outline, &face.middle, &mut tessellation);
            if tessellation.vertices.len() > complex.vertex_origins.len() {
                complex.vertex_origins.push(Origin::Middle { node: face.node });
            }
            complex.triangle_nodes.resize(tessellation.triangles.len(), face.node);
        }
        for &(edge, _) in &wires {
            tessellation.segments.extend(self.arms(edge).map(|ends| ends.map(|vertex| place[vertex as usize])));
            complex.segment_edges.resize(tessellation.segments.len(), edge);
            if let [vertex] = self.edges[edge as usize].vertices[..] {
                tessellation.points.push(place[vertex as usize]);
            }
        }
        complex.topology = Arc::clone(self.topology);
        complex.root_states = self.attractor.roots().iter().map(|root| root.state).collect();
        complex.nodes = std::mem::take(&mut self.nodes);
        complex.edge_origins = std::mem::take(&mut self.edge_origins);
        tessellation.complex = Some(complex);
        tessellation
    }

    /// The leaf edges around every face.
    fn loops(&self) -> Vec<Vec<(u32, bool)>> {
        let around = |face: &super::Face| {
            let mut edges = Vec::with_capacity(face.outline.len());
            face.outline.iter().for_each(|&(edge, backwards)| self.leaf_edges(edge, backwards, &mut edges));
            edges
        };
        self.faces.iter().map(around).collect()
    }
}

/// Fills the outline of a face: three vertices are a triangle, four two triangles on the shorter diagonal, more a
/// fan around the middle.
fn fill(outline: &[u32], middle: &Point, tessellation: &mut Tessellation) {
    match *outline {
        [a, b, c] => tessellation.triangles.push([a, b, c]),
        [a, b, c, d] => {
            let square = |p: u32, q: u32| tessellation.vertices[p as usize].distance_squared(tessellation.vertices[q as usize]);
            // Lengths that differ by rounding alone do not decide.
            if square(a, c) <= square(b, d) * (1.0 + 1e-9) {
                tessellation.triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                tessellation.triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
        _ if outline.len() > 4 => {
            let centre = tessellation.vertices.len() as u32;
            tessellation.vertices.push(DVec3::from_array(*middle));
            for (position, &vertex) in outline.iter().enumerate() {
                tessellation.triangles.push([vertex, outline[(position + 1) % outline.len()], centre]);
            }
        }
        _ => {}
    }
}

/// Which faces to turn round so that neighbours run along their common edge in opposite directions, as far as the
/// surface is orientable. The first face of every piece stays.
fn orientations(loops: &[Vec<(u32, bool)>], edges: usize) -> Vec<bool> {
    // The two faces of every edge, with their directions; edges with more are no hinge.
    let mut sides: Vec<[(u32, bool); 2]> = vec![[(NONE, false); 2]; edges];
    let mut count = vec![0_u8; edges];
    for (face, around) in loops.iter().enumerate() {
        for &(edge, backwards) in around {
            let used = &mut count[edge as usize];
            if *used < 2 {
                sides[edge as usize][*used as usize] = (face as u32, backwards);
            }
            *used = used.saturating_add(1);
        }
    }
    let mut flips: Vec<Option<bool>> = vec![None; loops.len()];
    let mut stack = Vec::new();
    for seed in 0..loops.len() {
        if flips[seed].is_some() {
            continue;
        }
        flips[seed] = Some(false);
        stack.push(seed);
        while let Some(face) = stack.pop() {
            let own = flips[face] == Some(true);
            for &(edge, backwards) in &loops[face] {
                if count[edge as usize] != 2 {
                    continue;
                }
                let [first, second] = sides[edge as usize];
                let (other, direction) = if first.0 as usize == face { second } else { first };
                if flips[other as usize].is_none() {
                    flips[other as usize] = Some(own != (direction == backwards));
                    stack.push(other as usize);
                }
            }
        }
    }
    flips.into_iter().map(|flip| flip == Some(true)).collect()
}

/// Counts of a complex.
struct Tally {
    used: Vec<bool>,
    /// Faces of every leaf edge; wires count none.
    faces: Vec<u8>,
    edge_used: Vec<bool>,
    ends: Vec<(u32, [u32; 2])>,
}

impl Tally {
    fn new(vertices: usize, edges: usize) -> Self {
        Self { used: vec![false; vertices], faces: vec![0; edges], edge_used: vec![false; edges], ends: Vec::new() }
    }

    fn count(&mut self, edge: u32, arms: impl Iterator<Item = [u32; 2]>, of_face: bool) {
        if of_face {
            self.faces[edge as usize] = self.faces[edge as usize].saturating_add(1);
        }
        if std::mem::replace(&mut self.edge_used[edge as usize], true) {
            return;
        }
        for ends in arms {
            ends.iter().for_each(|&end| self.used[end as usize] = true);
            self.ends.push((edge, ends));
        }
    }

    fn complex(&self, faces: usize) -> CellComplex {
        let vertices = self.used.iter().filter(|&&used| used).count();
        let boundary: Vec<[u32; 2]> = self.ends.iter().filter(|(edge, _)| self.faces[*edge as usize] == 1).map(|&(_, ends)| ends).collect();
        let all: Vec<[u32; 2]> = self.ends.iter().map(|&(_, ends)| ends).collect();
        CellComplex {
            faces: faces as u64,
            edges: all.len() as u64,
            vertices: vertices as u64,
            components: pieces(self.used.len(), &all),
            boundary_edges: boundary.len() as u64,
            boundary_loops: pieces(self.used.len(), &boundary),
            euler: vertices as i64 - all.len() as i64 + faces as i64,
            ..CellComplex::default()
        }
    }
}

/// Connected pieces of a graph, vertices without edges left out.
fn pieces(vertices: usize, edges: &[[u32; 2]]) -> u64 {
    let mut up: Vec<u32> = (0..vertices as u32).collect();
    let find = |up: &mut Vec<u32>, mut vertex: u32| {
        while up[vertex as usize] != vertex {
            up[vertex as usize] = up[up[vertex as usize] as usize];
            vertex = up[vertex as usize];
        }
        vertex
    };
    let mut touched = vec![false; vertices];
    for &[a, b] in edges {
        let (p, q) = (find(&mut up, a), find(&mut up, b));
        up[p.max(q) as usize] = p.min(q);
        touched[a as usize] = true;
        touched[b as usize] = true;
    }
    (0..vertices as u32).filter(|&vertex| touched[vertex as usize] && find(&mut up, vertex) == vertex).count() as u64
}
