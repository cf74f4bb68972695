//! From the cell complex to triangles and segments.

use super::address::Origin;
use super::{Builder, CellComplex, NONE, Side};
use crate::attractor::cell::Point;
use crate::tessellation::Tessellation;
use glam::DVec3;
use std::sync::Arc;

impl Builder<'_> {
    /// The leaf edges of an edge that is no single point: in order from its start to its end when it is a curve.
    fn leaf_edges(&self, side: Side, out: &mut Vec<Side>) {
        let own = &self.edges[side.edge()];
        if own.collapsed {
            return;
        }
        if own.pieces == NONE {
            out.push(side);
            return;
        }
        let topology = self.topology.state(own.state);
        let mut child = |(child, turned): (usize, bool)| {
            self.leaf_edges(Side::new(self.pieces[own.pieces as usize + child], turned != side.backwards()), out);
        };
        match &topology.chain {
            Some(chain) if side.backwards() => chain.iter().rev().for_each(|&link| child(link)),
            Some(chain) => chain.iter().for_each(|&link| child(link)),
            None => (0..topology.split.children.len()).for_each(|index| child((index, false))),
        }
    }

    /// The vertices of an edge, by its state's closure.
    fn vertices_of(&self, edge: usize) -> &[u32] {
        let own = &self.edges[edge];
        let first = own.vertices as usize;
        &self.edge_vertices[first..first + self.topology.state(own.state).closure.cells.len()]
    }

    /// What is drawn of a leaf edge: a segment, or one to every end but the first of a wire that branches.
    fn arms(&self, edge: usize) -> impl Iterator<Item = [u32; 2]> {
        let (first, rest) = self.vertices_of(edge).split_first().map_or((NONE, &[][..]), |(first, rest)| (*first, rest));
        rest.iter().map(move |&end| [first, end])
    }

    /// Start and end of a leaf edge.
    fn ends(&self, side: Side) -> [u32; 2] {
        let vertices = self.vertices_of(side.edge());
        let [start, end] = self.topology.ends(self.edges[side.edge()].state).map_or([0, 0], |[a, b]| [vertices[a], vertices[b]]);
        if side.backwards() { [end, start] } else { [start, end] }
    }

    /// The tessellation of all that was refined.
    pub(in crate::attractor) fn draw(mut self) -> Tessellation {
        let loops = self.loops();
        let mut tally = Tally::new(self.vertices.len(), self.edges.len());
        let flips = orientations(&loops, self.edges.len());
        for &side in &loops.sides {
            tally.count(side.edge(), [self.ends(side)].into_iter(), true);
        }
        let mut wires = Vec::new();
        for index in 0..self.wires.len() {
            self.leaf_edges(Side::new(self.wires[index], false), &mut wires);
        }
        for &side in &wires {
            tally.count(side.edge(), self.arms(side.edge()), false);
            self.vertices_of(side.edge()).iter().for_each(|&vertex| tally.used[vertex as usize] = true);
        }
        let mut complex = tally.complex(self.faces.len());
        let mut tessellation = Tessellation { leaf_cells: self.leaves, deviation_mm: self.deviation, ..Tessellation::default() };
        let mut place = vec![NONE; self.vertices.len()];
        for (vertex, index) in place.iter_mut().enumerate().filter(|(vertex, _)| tally.used[*vertex]) {
            *index = tessellation.vertices.len() as u32;
            tessellation.vertices.push(DVec3::from_array(self.vertices[vertex]));
            complex.vertex_origins.push(self.vertex_origins[vertex]);
        }
        let mut outline = Vec::new();
        for (index, face) in self.faces.iter().enumerate() {
            outline.clear();
            outline.extend(loops.of(index).iter().map(|&side| place[self.ends(side)[0] as usize]));
            if flips[index] {
                outline.reverse();
            }
            fill(&outline, &face.middle, &mut tessellation);
            if tessellation.vertices.len() > complex.vertex_origins.len() {
                complex.vertex_origins.push(Origin::Middle { node: face.node });
            }
            complex.triangle_nodes.resize(tessellation.triangles.len(), face.node);
        }
        for &side in &wires {
            tessellation.segments.extend(self.arms(side.edge()).map(|ends| ends.map(|vertex| place[vertex as usize])));
            complex.segment_edges.resize(tessellation.segments.len(), side.edge() as u32);
            if let [vertex] = self.vertices_of(side.edge()) {
                tessellation.points.push(place[*vertex as usize]);
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
    fn loops(&self) -> Loops {
        let mut loops = Loops { starts: Vec::with_capacity(self.faces.len() + 1), sides: Vec::with_capacity(self.outlines.len()) };
        loops.starts.push(0);
        for (index, face) in self.faces.iter().enumerate() {
            let end = self.faces.get(index + 1).map_or(self.outlines.len(), |next| next.outline as usize);
            for &side in &self.outlines[face.outline as usize..end] {
                self.leaf_edges(side, &mut loops.sides);
            }
            loops.starts.push(loops.sides.len());
        }
        loops
    }
}

/// The leaf edges around every face, one face after the other.
struct Loops {
    starts: Vec<usize>,
    sides: Vec<Side>,
}

impl Loops {
    fn of(&self, face: usize) -> &[Side] {
        &self.sides[self.starts[face]..self.starts[face + 1]]
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
fn orientations(loops: &Loops, edges: usize) -> Vec<bool> {
    let faces = loops.starts.len() - 1;
    // The two faces of every edge, with their directions; edges with more are no hinge.
    let mut sides: Vec<[(u32, bool); 2]> = vec![[(NONE, false); 2]; edges];
    let mut count = vec![0_u8; edges];
    for face in 0..faces {
        for side in loops.of(face) {
            let used = &mut count[side.edge()];
            if *used < 2 {
                sides[side.edge()][*used as usize] = (face as u32, side.backwards());
            }
            *used = used.saturating_add(1);
        }
    }
    let mut flips: Vec<Option<bool>> = vec![None; faces];
    let mut stack = Vec::new();
    for seed in 0..faces {
        if flips[seed].is_some() {
            continue;
        }
        flips[seed] = Some(false);
        stack.push(seed);
        while let Some(face) = stack.pop() {
            let own = flips[face] == Some(true);
            for side in loops.of(face).iter().filter(|side| count[side.edge()] == 2) {
                let [first, second] = sides[side.edge()];
                let (other, direction) = if first.0 as usize == face { second } else { first };
                if flips[other as usize].is_none() {
                    flips[other as usize] = Some(own != (direction == side.backwards()));
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

    fn count(&mut self, edge: usize, arms: impl Iterator<Item = [u32; 2]>, of_face: bool) {
        if of_face {
            self.faces[edge] = self.faces[edge].saturating_add(1);
        }
        if std::mem::replace(&mut self.edge_used[edge], true) {
            return;
        }
        for ends in arms {
            ends.iter().for_each(|&end| self.used[end as usize] = true);
            self.ends.push((edge as u32, ends));
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
