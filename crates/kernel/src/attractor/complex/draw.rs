//! From the cell complex to triangles and segments.

use super::address::{Origin, Part};
use super::merge::Merged;
use super::tally::{Loops, Pieces, Tally};
use super::{CellComplex, NONE, Side, normals};
use crate::attractor::cell::Point;
use crate::attractor::{Attractor, TangentPlanes};
use crate::tessellation::Tessellation;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Arc;

/// For every part and vertex its place in the tessellation, or [`NONE`].
type Places = Vec<Vec<u32>>;

/// What a shard draws. Places of middles of faces count from the first of the shard's.
struct Drawn {
    /// At the corners of the triangles, if asked for.
    normals: Vec<[Point; 3]>,
    triangles: Vec<[u32; 3]>,
    nodes: Vec<u32>,
    middles: Vec<(Point, u32)>,
}

impl Merged<'_> {
    /// The tessellation of all that was refined.
    pub(super) fn draw(mut self, attractor: &Attractor, tangents: Option<&TangentPlanes>) -> Tessellation {
        let wires: Vec<Vec<Side>> = (0..self.shards.len()).map(|shard| self.wires(shard)).collect();
        let (loops, pieces): (Vec<Loops>, Vec<Pieces>) = (0..self.shards.len())
            .into_par_iter()
            .map(|shard| {
                let loops = Loops::of(&self, shard, tangents.is_some());
                let pieces = Pieces::of(&self, shard, &loops, &wires[shard]);
                (loops, pieces)
            })
            .unzip();
        let turns = (0..pieces.len()).map(|shard| pieces[shard].faces.clone()).collect::<Vec<_>>();
        let Tally { mut complex, turned, used } = Tally::new(&self, &loops, pieces);
        let mut tessellation = Tessellation {
            leaf_cells: self.shards.iter().map(|shard| shard.leaves).sum(),
            deviation_mm: self.shards.iter().map(|shard| shard.deviation).fold(0.0, f64::max),
            ..Tessellation::default()
        };
        let places = self.place(&used, &mut tessellation, &mut complex);
        let draw = |shard: usize| {
            let flip = |face: usize| {
                let (piece, own): (u32, bool) = turns[shard][face];
                own != turned[shard][piece as usize]
            };
            let bends = tangents.map_or_else(Vec::new, |tangents| self.bends(attractor, tangents, shard, &loops[shard]));
            self.fill(shard, &loops[shard], &flip, &places, &tessellation.vertices, &bends)
        };
        let drawn: Vec<Drawn> = (0..self.shards.len()).into_par_iter().map(draw).collect();
        tessellation.triangles.reserve_exact(drawn.iter().map(|drawn| drawn.triangles.len()).sum());
        complex.triangle_nodes.reserve_exact(tessellation.triangles.capacity());
        let mut normals = Vec::new();
        for Drawn { normals: own, triangles, nodes, middles } in drawn {
            normals.extend(own);
            let (first, corners) = (tessellation.vertices.len() as u32, complex.vertices as u32);
            // Middles were numbered from the number of all other vertices on.
            let place = |vertex: u32| if vertex < corners { vertex } else { vertex - corners + first };
            tessellation.triangles.extend(triangles.into_iter().map(|triangle| triangle.map(place)));
            complex.triangle_nodes.extend(nodes);
            for (point, node) in middles {
                tessellation.vertices.push(DVec3::from_array(point));
                complex.vertex_origins.push(Origin::Middle { node });
            }
        }
        tessellation.normals = tangents.map(|_| Box::new(normals::collect(&tessellation, &normals)));
        for &side in wires.iter().flatten() {
            let ends: Vec<u32> = self.vertices_of(side.edge() as u32).map(|vertex| at(&places, self.vertices.find(vertex))).collect();
            if let [vertex] = *ends {
                tessellation.points.push(vertex);
            }
            // A segment, or one to every end but the first of a wire that branches.
            tessellation.segments.extend(ends.iter().skip(1).map(|&end| [ends[0], end]));
            complex.segment_edges.resize(tessellation.segments.len(), side.edge() as u32);
        }
        complex.topology = Arc::clone(self.topology);
        complex.root_states = attractor.roots().iter().map(|root| root.state).collect();
        (complex.node_numbers, complex.edge_numbers) = (self.nodes.clone(), self.edges.clone());
        complex.parts =
            std::mem::take(&mut self.stores).into_iter().map(|store| Part { nodes: store.nodes, edges: store.edge_origins }).collect();
        tessellation.complex = Some(complex);
        tessellation
    }

    /// The leaf edges of a shard's wires.
    fn wires(&self, shard: usize) -> Vec<Side> {
        let mut wires = Vec::new();
        for &wire in &self.shards[shard].wires {
            self.leaf_edges_in(shard + 1, Side::new(wire, false), &mut |side, _| wires.push(side));
        }
        wires
    }

    /// Puts down the used vertices, part by part.
    fn place(&self, used: &[Vec<bool>], tessellation: &mut Tessellation, complex: &mut CellComplex) -> Places {
        let count = complex.vertices as usize;
        (tessellation.vertices, complex.vertex_origins) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let mut places = Vec::with_capacity(used.len());
        for (store, used) in self.stores.iter().zip(used) {
            let place = |(index, &used): (usize, &bool)| {
                if !used {
                    return NONE;
                }
                tessellation.vertices.push(DVec3::from_array(store.vertices[index]));
                complex.vertex_origins.push(store.vertex_origins[index]);
                tessellation.vertices.len() as u32 - 1
            };
            places.push(used.iter().enumerate().map(place).collect());
        }
        places
    }

    fn fill(
        &self,
        shard: usize,
        loops: &Loops,
        flip: &dyn Fn(usize) -> bool,
        places: &Places,
        vertices: &[DVec3],
        bends: &[Point],
    ) -> Drawn {
        let faces = &self.shards[shard].faces;
        let count = 2 * faces.len();
        let mut drawn =
            Drawn { normals: Vec::new(), triangles: Vec::with_capacity(count), nodes: Vec::with_capacity(count), middles: Vec::new() };
        let mut outline = Vec::new();
        for (index, face) in faces.iter().enumerate() {
            outline.clear();
            outline.extend(loops.corners_of(index).iter().map(|&corner| at(places, self.vertices.find(corner))));
            if flip(index) {
                outline.reverse();
            }
            let node = self.node(shard + 1, face.node);
            let centre = (vertices.len() + drawn.middles.len()) as u32;
            let before = drawn.triangles.len();
            if fill(&outline, centre, vertices, &mut drawn.triangles) {
                drawn.middles.push((face.middle, node));
            }
            drawn.nodes.resize(drawn.triangles.len(), node);
            if !bends.is_empty() {
                // The normals of this face follow those of the faces before, and one middle each.
                let range = loops.range(index);
                let own = &bends[range.start + index..=range.end + index];
                let turned = flip(index);
                let normal = |vertex: u32| {
                    let place = outline.iter().position(|&other| other == vertex);
                    let place = place.map_or(outline.len(), |place| if turned { outline.len() - 1 - place } else { place });
                    own[place].map(|x| if turned { -x } else { x })
                };
                drawn.normals.extend(drawn.triangles[before..].iter().map(|triangle| triangle.map(normal)));
            }
        }
        drawn
    }
}

fn at(places: &Places, (part, index): (usize, usize)) -> u32 {
    places[part][index]
}

/// Fills the outline of a face: three vertices are a triangle, four two triangles on the shorter diagonal, more a
/// fan around the middle, which is then the vertex `centre`. Whether it is used.
pub(in crate::attractor) fn fill(outline: &[u32], centre: u32, vertices: &[DVec3], triangles: &mut Vec<[u32; 3]>) -> bool {
    match *outline {
        [a, b, c] => triangles.push([a, b, c]),
        [a, b, c, d] => {
            let square = |p: u32, q: u32| vertices[p as usize].distance_squared(vertices[q as usize]);
            // Lengths that differ by rounding alone do not decide.
            if square(a, c) <= square(b, d) * (1.0 + 1e-9) {
                triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
        _ if outline.len() > 4 => {
            for (position, &vertex) in outline.iter().enumerate() {
                triangles.push([vertex, outline[(position + 1) % outline.len()], centre]);
            }
            return true;
        }
        _ => {}
    }
    false
}
