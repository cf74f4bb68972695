//! The least thickness of the walls of a solid, and of the gaps between them: along the normals of its faces.
//!
//! The wall at a point of a face is the way along the inward normal to the first face that has no corner in common with it, the gap the same outwards. (Faces with
//! a common corner are left out, because a wall ends in nothing at every edge that is sharper than a right angle; that is a property of the edge.) The
//! least wall over all points of all faces is found exactly: over a face a, another face b has a height that is linear along a, so its least value over the
//! common part of a and the shadow of b on a's plane is at a corner of that polygon. Where triangles do not cross, the first face that a normal meets is the
//! nearest, so no order along the normal is needed.

use super::Interval;
use crate::budget::{Budget, Stopped};
use crate::solid::TriMesh;
use crate::solid::box_tree::{Box32, BoxTree};
use glam::DVec3;
use rayon::prelude::*;

/// Which side of the faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Through the material.
    Wall,
    /// Through the air.
    Gap,
}

/// The least thickness of a mesh on one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thickness {
    /// In mm; as wide as rounding.
    pub least: Interval,
    /// A point of a face, and the one across: the way between them is that long, and reached there or approached.
    pub between: [DVec3; 2],
    /// The two faces.
    pub faces: [u32; 2],
}

/// Triangles handled together.
const CHUNK: usize = 256;
/// Shares of the diagonal within which is looked first; twice as far each time nothing is found.
const FIRST: f64 = 1.0 / 256.0;
/// Shadows of less area than this share of the squared lengths have none: faces along the normal.
const FLAT: f64 = 1e-12;

/// A face with a frame: the direction that is measured along, and the planes through its edges along it.
struct Face {
    origin: DVec3,
    direction: DVec3,
    /// Inward normals of the planes through the edges, and a point of each.
    sides: [(DVec3, DVec3); 3],
}

impl Face {
    fn new(points: [DVec3; 3], side: Side) -> Option<Self> {
        let [a, b, c] = points;
        let normal = (b - a).cross(c - a).try_normalize()?;
        let direction = if side == Side::Wall { -normal } else { normal };
        let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| (normal.cross(to - from), from));
        Some(Self { origin: a, direction, sides })
    }

    /// The least height of another triangle over the face, and where it is, if its shadow has an area in common with it.
    fn height(&self, other: [DVec3; 3], polygons: &mut [Vec<DVec3>; 2]) -> Option<(f64, DVec3)> {
        let [polygon, clipped] = polygons;
        polygon.clear();
        polygon.extend(other);
        for (inward, through) in &self.sides {
            clipped.clear();
            for (k, &from) in polygon.iter().enumerate() {
                let to = polygon[(k + 1) % polygon.len()];
                let (at, next) = ((from - through).dot(*inward), (to - through).dot(*inward));
                if at >= 0.0 {
                    clipped.push(from);
                }
                if (at > 0.0 && next < 0.0) || (at < 0.0 && next > 0.0) {
                    clipped.push(from + (to - from) * (at / (at - next)));
                }
            }
            std::mem::swap(polygon, clipped);
            if polygon.len() < 3 {
                return None;
            }
        }
        let first = polygon[0];
        let fan = |k: usize| (polygon[k] - first).cross(polygon[k + 1] - first);
        let area: f64 = (1..polygon.len() - 1).map(|k| fan(k).dot(self.direction)).sum();
        let size = polygon.iter().map(|point| point.distance_squared(first)).fold(0.0, f64::max);
        if area.abs() <= FLAT * size {
            return None;
        }
        let height = |point: &DVec3| (*point - self.origin).dot(self.direction);
        let heights = || polygon.iter().map(|point| (height(point), *point));
        // Where triangles do not cross, a face is over the other or below it as a whole.
        if heights().map(|(height, _)| height).sum::<f64>() <= 0.0 {
            return None;
        }
        heights().min_by(|a, b| a.0.total_cmp(&b.0)).map(|(height, point)| (height.max(0.0), point))
    }
}

/// The least thickness on one side of a closed mesh that does not cross itself; `None` where no face has another one over it, as for the gaps of a ball. Cost:
/// n log n for thicknesses of the order of the triangles, more where walls are thick and triangles small. The result does not depend on the number of threads.
///
/// # Errors
/// [`Stopped`].
pub fn thickness(mesh: &TriMesh, side: Side, budget: &Budget) -> Result<Option<Thickness>, Stopped> {
    let corners = |triangle: u32| mesh.triangles[triangle as usize].map(|corner| mesh.vertices[corner as usize]);
    let mut tree = BoxTree::default();
    tree.build(mesh.triangles.len(), |triangle| Some(Box32::of(&corners(triangle).map(|p| p.to_array()))), true);
    let low = mesh.vertices.iter().copied().reduce(DVec3::min).unwrap_or_default();
    let high = mesh.vertices.iter().copied().reduce(DVec3::max).unwrap_or_default();
    let diagonal = low.distance(high);
    let mut reach = FIRST * diagonal;
    loop {
        let found = least_within(mesh, &tree, side, reach, budget)?;
        // What is farther than the reach was not all seen.
        if let Some((height, faces, point)) = found.filter(|found| found.0 <= reach) {
            let slack = 64.0 * f64::EPSILON * (low.abs().max(high.abs()).max_element() + diagonal);
            let least = Interval { low: (height - slack).max(0.0), high: height + slack };
            let face = Face::new(corners(faces[0]), side);
            let foot = face.map_or(point, |face| point - face.direction * height);
            return Ok(Some(Thickness { least, between: [foot, point], faces }));
        }
        if reach > diagonal {
            return Ok(None);
        }
        reach *= 2.0;
    }
}

type Found = (f64, [u32; 2], DVec3);

/// The least height among pairs of faces whose boxes are within a reach, the first of equal ones.
fn least_within(mesh: &TriMesh, tree: &BoxTree, side: Side, reach: f64, budget: &Budget) -> Result<Option<Found>, Stopped> {
    let corners = |triangle: u32| mesh.triangles[triangle as usize].map(|corner| mesh.vertices[corner as usize]);
    let count = mesh.triangles.len();
    let chunks: Vec<Option<Found>> = (0..count.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let mut best: Option<Found> = None;
            let mut polygons = [Vec::with_capacity(9), Vec::with_capacity(9)];
            for a in (chunk * CHUNK) as u32..((chunk + 1) * CHUNK).min(count) as u32 {
                if budget.cancel.reason().is_some() {
                    return None;
                }
                let points = corners(a);
                let Some(face) = Face::new(points, side) else { continue };
                let own = mesh.triangles[a as usize];
                let far = face.direction * best.map_or(reach, |best| best.0.min(reach));
                let swept =
                    Box32::of(&[points[0], points[1], points[2], points[0] + far, points[1] + far, points[2] + far].map(|p| p.to_array()));
                tree.query(&swept, 0, |leaf| {
                    for (&b, b_box) in tree.items(leaf).iter().zip(tree.boxes(leaf)) {
                        if !b_box.meets(&swept) || mesh.triangles[b as usize].iter().any(|corner| own.contains(corner)) {
                            continue;
                        }
                        if let Some((height, point)) = face.height(corners(b), &mut polygons)
                            && best.is_none_or(|best| (height, [a, b]) < (best.0, best.1))
                        {
                            best = Some((height, [a, b], point));
                        }
                    }
                    true
                });
            }
            best
        })
        .collect();
    budget.cancel.check()?;
    Ok(chunks.into_iter().flatten().reduce(|a, b| if b.0 < a.0 { b } else { a }))
}
