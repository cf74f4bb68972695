//! Normals at the corners of drawn triangles.

use super::merge::Merged;
use super::tally::Loops;
use crate::attractor::cell::{Cell, ControlPoint, Point, distance_squared, dot, subtract};
use crate::attractor::{Attractor, TangentPlanes};
use crate::automaton::LeafPrimitive;
use crate::tessellation::{Normals, Tessellation};
use glam::DVec3;

/// Levels below a face at which a vertex on its outline is sought.
const MOST_LEVELS: usize = 64;

impl Merged<'_> {
    /// The normals around every face of a shard, as its loops run, then that of its middle.
    pub(super) fn bends(&self, attractor: &Attractor, tangents: &TangentPlanes, shard: usize, loops: &Loops) -> Vec<Point> {
        let grown = &self.shards[shard];
        let mut bends = Vec::with_capacity(loops.sides.len() + grown.faces.len());
        for (index, face) in grown.faces.iter().enumerate() {
            let end = grown.faces.get(index + 1).map_or(grown.normals.len(), |next| next.normals as usize);
            let own = &grown.normals[face.normals as usize..end];
            for place in loops.range(index) {
                bends.push(match own.get(loops.own[place] as usize) {
                    Some(&normal) => normal,
                    // A neighbour is finer here: the vertex is a corner of a cell below this face.
                    None => self.below(attractor, tangents, self.node(shard + 1, face.node), &self.position(loops.corners[place])),
                });
            }
            bends.push(own.last().copied().unwrap_or_default());
        }
        bends
    }

    fn position(&self, vertex: u32) -> Point {
        let (part, index) = self.vertices.find(vertex);
        self.stores[part].vertices[index]
    }

    /// The normal of a face at a point of its outline.
    fn below(&self, attractor: &Attractor, tangents: &TangentPlanes, node: u32, at: &Point) -> Point {
        let (mut steps, mut current) = (Vec::new(), self.origin_of_node(node));
        while current.0 != super::NONE {
            steps.push(current.1 as usize);
            current = self.origin_of_node(current.0);
        }
        let mut cell = attractor.root_cell(current.1 as usize);
        let mut points = attractor.roots()[current.1 as usize].points.clone();
        for child in steps.into_iter().rev() {
            (cell, points) = descend(attractor, &cell, child, &points);
        }
        let allowed = 1e-9 * cell.ball.radius;
        let mut cells = vec![(cell, points)];
        for _ in 0..MOST_LEVELS {
            let mut next = Vec::new();
            for (cell, points) in &cells {
                for child in 0..attractor.automaton().state(cell.state).transitions.len() {
                    let (cell, points) = descend(attractor, cell, child, points);
                    if let Some(normal) = corner_at(attractor, tangents, &cell, &points, at, allowed) {
                        return normal;
                    }
                    if distance_squared(&cell.ball.centre, at).sqrt() <= cell.ball.radius + allowed {
                        next.push((cell, points));
                    }
                }
            }
            // The point is on an edge: few cells of a level come near it.
            next.sort_by(|a, b| distance_squared(&a.0.ball.centre, at).total_cmp(&distance_squared(&b.0.ball.centre, at)));
            next.truncate(16);
            cells = next;
        }
        [0.0; 3]
    }

    fn origin_of_node(&self, node: u32) -> (u32, u32) {
        let (part, index) = self.nodes.find(node);
        self.stores[part].nodes[index]
    }
}

fn descend(attractor: &Attractor, cell: &Cell, child: usize, points: &[ControlPoint]) -> (Cell, Vec<ControlPoint>) {
    let operator = &attractor.automaton().state(cell.state).transitions[child].operator;
    let mut below = vec![[0.0; 4]; operator.columns()];
    crate::attractor::cell::child_points(points, operator, &mut below);
    (attractor.child_cell(cell, child, &below), below)
}

/// The normal of a cell at the corner that is at a point.
fn corner_at(
    attractor: &Attractor,
    tangents: &TangentPlanes,
    cell: &Cell,
    points: &[ControlPoint],
    at: &Point,
    allowed: f64,
) -> Option<Point> {
    let rational = attractor.roots()[cell.root as usize].rational;
    let LeafPrimitive::Polygon(polygon) = &attractor.automaton().state(cell.state).leaf else { return None };
    let corners: Vec<Point> = polygon.iter().map(|corner| attractor.barycentric(points, corner, rational)).collect();
    let corner = corners.iter().position(|corner| distance_squared(corner, at).sqrt() <= allowed)?;
    let mut normals = Vec::new();
    tangents.normals(cell.state, points, rational, &corners, &mut normals);
    normals.get(corner).copied()
}

/// Normals that differ by less are one.
const SAME: f64 = 1e-7;

/// Collects normals, each vertex's equal ones once. `corners` says of every triangle what its corners' normals are, as
/// the triangle runs.
pub(super) fn collect(tessellation: &Tessellation, corners: &[[Point; 3]]) -> Normals {
    let mut normals = Normals { triangles: Vec::with_capacity(corners.len()), ..Normals::default() };
    let (mut first, mut next) = (vec![super::NONE; tessellation.vertices.len()], Vec::new());
    for (triangle, own) in tessellation.triangles.iter().zip(corners) {
        let mut place = |k: usize| {
            let (vertex, mut normal) = (triangle[k] as usize, own[k]);
            if dot(&normal, &normal) == 0.0 {
                normals.degenerate += 1;
                let at = triangle.map(|vertex| tessellation.vertices[vertex as usize]);
                normal = (at[1] - at[0]).cross(at[2] - at[0]).normalize_or(DVec3::Z).to_array();
            }
            let mut known = first[vertex];
            while known != super::NONE {
                let off = subtract(&normals.vectors[known as usize].to_array(), &normal);
                if dot(&off, &off) <= SAME * SAME {
                    return known;
                }
                known = next[known as usize];
            }
            let index = normals.vectors.len() as u32;
            normals.vectors.push(DVec3::from_array(normal));
            next.push(std::mem::replace(&mut first[vertex], index));
            index
        };
        let indices = [place(0), place(1), place(2)];
        normals.triangles.push(indices);
    }
    normals
}
