//! Fills a leaf up to the loops' segments in it: a constrained Delaunay triangulation.

use super::arc::Parameter;
use super::rays::Rays;
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};
use std::collections::{BTreeMap, BTreeSet};

/// A directed segment of a loop; the region is on its left.
pub(super) type Segment = [Parameter; 2];

type Corners = [usize; 3];

/// Fills leaves one after the other.
pub(super) struct Filler {
    /// Powers of two that make lengths in the plane about those in space: products with them are exact.
    scale: [f64; 2],
}

impl Filler {
    pub(super) fn new(scale: [f64; 2]) -> Self {
        Self { scale: scale.map(|x| if x > 0.0 && x.is_finite() { x.log2().round().clamp(-200.0, 200.0).exp2() } else { 1.0 }) }
    }

    /// Triangles of the part of a leaf that is inside, counterclockwise. `outline` are the points on its sides in order;
    /// ends of segments on sides are among them.
    pub(super) fn fill(&mut self, outline: &[Parameter], segments: &[Segment], rays: &Rays) -> Vec<[Parameter; 3]> {
        let mut plane = Plane::default();
        let scaled = |p: Parameter| Point2::new(p[0] * self.scale[0], p[1] * self.scale[1]);
        for &parameter in outline.iter().chain(segments.iter().flatten()) {
            plane.add(parameter, scaled(parameter));
        }
        let edges = plane.constrain(segments);
        let triangles: Vec<Corners> = plane.mesh.inner_faces().map(|face| face.vertices().map(|vertex| vertex.fix().index())).collect();
        let asked = |corners: &Corners| {
            let middle = |k: usize| corners.iter().map(|&corner| plane.parameters[corner][k]).sum::<f64>() / 3.0;
            rays.inside([middle(0), middle(1)])
        };
        let inside = match edges {
            Some(edges) => sides(&triangles, &edges, asked),
            None => triangles.iter().map(asked).collect(),
        };
        let kept = triangles.iter().zip(inside).filter(|(_, inside)| *inside);
        kept.map(|(corners, _)| corners.map(|corner| plane.parameters[corner])).collect()
    }
}

/// A triangulation, and the parameters of its vertices.
#[derive(Default)]
struct Plane {
    mesh: ConstrainedDelaunayTriangulation<Point2<f64>>,
    parameters: Vec<Parameter>,
    known: BTreeMap<[u64; 2], FixedVertexHandle>,
}

impl Plane {
    fn add(&mut self, parameter: Parameter, point: Point2<f64>) {
        let key = parameter.map(f64::to_bits);
        if self.known.contains_key(&key) {
            return;
        }
        // Refused are only coordinates that are not finite or that vanish when squared, which parameters are kept from.
        if let Ok(handle) = self.mesh.insert(point) {
            if handle.index() == self.parameters.len() {
                self.parameters.push(parameter);
            }
            self.known.insert(key, handle);
        }
    }

    /// Makes edges of the segments, directed as they are; those that rounding made the same cancel. `None` when rounding
    /// made some cross.
    fn constrain(&mut self, segments: &[Segment]) -> Option<BTreeSet<[usize; 2]>> {
        let mut edges = BTreeSet::new();
        let mut crossed = false;
        for segment in segments {
            let [Some(&from), Some(&to)] = [segment[0], segment[1]].map(|end| self.known.get(&end.map(f64::to_bits))) else { continue };
            if from == to {
                continue;
            }
            // A segment on a side is parted by the corners on it.
            let parts = self.mesh.try_add_constraint(from, to);
            crossed |= parts.is_empty();
            for part in parts {
                let [a, b] = self.mesh.directed_edge(part).vertices().map(|vertex| vertex.fix().index());
                if !edges.remove(&[b, a]) {
                    edges.insert([a, b]);
                }
            }
        }
        (!crossed).then_some(edges)
    }
}

/// Which triangles are inside: those on the left of an edge, and all that are reached from them without crossing one.
fn sides(triangles: &[Corners], edges: &BTreeSet<[usize; 2]>, asked: impl Fn(&Corners) -> bool) -> Vec<bool> {
    let arms = |corners: &Corners| [[corners[0], corners[1]], [corners[1], corners[2]], [corners[2], corners[0]]];
    let owners: BTreeMap<[usize; 2], usize> =
        triangles.iter().enumerate().flat_map(|(index, corners)| arms(corners).map(|arm| (arm, index))).collect();
    let mut side: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut stack = Vec::new();
    for (&[a, b], &triangle) in &owners {
        let inside = if edges.contains(&[a, b]) {
            true
        } else if edges.contains(&[b, a]) {
            false
        } else {
            continue;
        };
        if side[triangle].is_none() {
            side[triangle] = Some(inside);
            stack.push(triangle);
        }
    }
    let mut next = 0;
    loop {
        while let Some(triangle) = stack.pop() {
            for [a, b] in arms(&triangles[triangle]) {
                if edges.contains(&[a, b]) || edges.contains(&[b, a]) {
                    continue;
                }
                if let Some(&other) = owners.get(&[b, a])
                    && side[other].is_none()
                {
                    side[other] = side[triangle];
                    stack.push(other);
                }
            }
        }
        // Reached by nothing.
        let Some(rest) = (next..triangles.len()).find(|&index| side[index].is_none()) else { break };
        next = rest;
        side[rest] = Some(asked(&triangles[rest]));
        stack.push(rest);
    }
    side.into_iter().map(|side| side == Some(true)).collect()
}
