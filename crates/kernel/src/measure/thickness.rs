//! How thick the walls of a solid are, and the gaps between them: along the normals of its faces, the least of all and face by face.
//!
//! The wall at a point of a face is the way along the inward normal to the first face that has no corner in common with it, the gap the same outwards. (Faces with
//! a common corner are left out, because a wall ends in nothing at every edge that is sharper than a right angle; that is a property of the edge.) The
//! least wall over all points of all faces is found exactly: over a face a, another face b has a height that is linear along a, so its least value over the
//! common part of a and the shadow of b on a's plane is at a corner of that polygon. Where triangles do not cross, the first face that a normal meets is the
//! nearest, so the least height over a face is its thickness, and parts of the tree are left out that are beside the prism over the face or higher than what was found.

use super::Interval;
use super::double::normal;
use crate::budget::{Budget, Stopped};
use crate::solid::TriMesh;
use crate::solid::box_tree::{Box32, BoxTree};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

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

/// The thickness of a mesh on one side, all over it. Infinite where no face lies across.
#[derive(Clone, Debug, PartialEq)]
pub struct ThicknessMap {
    /// The least of it, as [`thickness()`] tells it; `None` where no face has another one over it.
    pub least: Option<Thickness>,
    /// The least thickness over each triangle, in mm.
    pub faces: Vec<f64>,
    /// At each vertex the least of the triangles around it, in mm: the least of all vertices is that of the mesh.
    pub vertices: Vec<f64>,
}

/// Leaves of the tree whose triangles are looked at one after the other.
const CHUNK: usize = 64;
/// Shadows of less area than this share of the squared lengths have none, and so have faces whose normals are this near to a right angle with the direction: those along it.
const FLAT: f64 = 1e-12;

/// A face with a frame: the direction that is measured along, and the planes through its edges along it.
struct Face {
    origin: DVec3,
    direction: DVec3,
    /// Inward normals of the planes through the edges, and a point of each.
    sides: [(DVec3, DVec3); 3],
}

impl Face {
    /// None for a face without area.
    fn new([a, b, c]: [DVec3; 3], normal: DVec3, side: Side) -> Option<Self> {
        if normal == DVec3::ZERO {
            return None;
        }
        let direction = if side == Side::Wall { -normal } else { normal };
        let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| (normal.cross(to - from), from));
        Some(Self { origin: a, direction, sides })
    }

    /// The least height that a point of a box may have; `None` for a box that is behind the face, or beside the prism over it.
    fn entry(&self, around: &Box32) -> Option<f64> {
        let [low, high] = [around.low, around.high].map(|end| end.as_dvec3());
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        // Where the box begins and ends along a direction.
        let span = |direction: DVec3, from: DVec3| {
            let (at, reach) = ((middle - from).dot(direction), half.dot(direction.abs()));
            [at - reach, at + reach]
        };
        let [from, to] = span(self.direction, self.origin);
        // Comparisons with NaN, which the box of nothing gives, are false.
        let over = to >= 0.0 && self.sides.iter().all(|&(inward, through)| span(inward, through)[1] >= 0.0);
        over.then(|| from.max(0.0))
    }

    /// The least height of another triangle over the face, and where it is, if its shadow has an area in common with it.
    fn height(&self, other: [DVec3; 3], normal: DVec3, polygons: &mut [Vec<DVec3>; 2]) -> Option<(f64, DVec3)> {
        // What is left of it after clipping may be too small to tell.
        if normal.dot(self.direction).abs() <= FLAT {
            return None;
        }
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

/// The height of a face over another one, which face it is, and a point of it.
type Over = (f64, u32, DVec3);

fn corners(mesh: &TriMesh, triangle: u32) -> [DVec3; 3] {
    mesh.triangles[triangle as usize].map(|corner| mesh.vertices[corner as usize])
}

/// A mesh with a tree over its triangles.
struct Faces<'m> {
    mesh: &'m TriMesh,
    /// Unit normals; zero for triangles without area.
    normals: Vec<DVec3>,
    tree: BoxTree,
}

impl<'m> Faces<'m> {
    fn of(mesh: &'m TriMesh) -> Self {
        let mut tree = BoxTree::default();
        tree.build(mesh.triangles.len(), |triangle| Some(Box32::of(&corners(mesh, triangle).map(|p| p.to_array()))), true);
        let normals =
            (0..mesh.triangles.len() as u32).into_par_iter().map(|face| normal(corners(mesh, face)).normalize_or_zero()).collect();
        Self { mesh, normals, tree }
    }

    fn face(&self, number: u32, side: Side) -> Option<Face> {
        Face::new(corners(self.mesh, number), self.normals[number as usize], side)
    }

    /// The nearest face over another one, at most as high as a bound; of equally high ones the first. One that is over a neighbour, and those beside it, are looked at
    /// before the tree is searched, for what they tell is often the answer, and leaves little to search.
    fn over(&self, below: u32, side: Side, bound: f64, guess: Option<u32>, polygons: &mut [Vec<DVec3>; 2]) -> Option<Over> {
        let face = self.face(below, side)?;
        let own = self.mesh.triangles[below as usize];
        let mut best: Option<Over> = None;
        let entry = |around: &Box32| face.entry(around);
        let mut look = |leaf: usize| {
            for (&other, around) in self.tree.items(leaf).iter().zip(self.tree.boxes(leaf)) {
                if entry(around).is_none() || self.mesh.triangles[other as usize].iter().any(|corner| own.contains(corner)) {
                    continue;
                }
                if let Some((height, point)) = face.height(corners(self.mesh, other), self.normals[other as usize], polygons)
                    && height <= bound
                    && best.is_none_or(|best| (height, other) < (best.0, best.1))
                {
                    best = Some((height, other, point));
                }
            }
            best.map_or(bound, |best| best.0)
        };
        let bound = guess.map_or(bound, |other| look(self.tree.leaf_with(other)));
        self.tree.nearest(bound, entry, look);
        best
    }
}

/// What lies over the faces of a mesh.
struct Search<'m> {
    faces: Faces<'m>,
    side: Side,
    budget: &'m Budget,
}

impl Search<'_> {
    /// What lies over each face, by leaves of the tree, in which neighbours follow each other. What is higher than a bound need not be found: it is asked with the
    /// least that was found in the chunk so far.
    fn all(&self, bound: impl Fn(f64) -> f64 + Sync) -> Result<Vec<(u32, Over)>, Stopped> {
        let leaves = self.faces.tree.leaves();
        let of_chunk = |chunk: usize| {
            let mut polygons = Default::default();
            let (mut found, mut guess, mut least) = (Vec::new(), None, f64::INFINITY);
            for leaf in chunk * CHUNK..leaves.min((chunk + 1) * CHUNK) {
                if self.budget.cancel.reason().is_some() {
                    break;
                }
                for &face in self.faces.tree.items(leaf) {
                    if let Some(over) = self.faces.over(face, self.side, bound(least), guess, &mut polygons) {
                        (guess, least) = (Some(over.1), least.min(over.0));
                        found.push((face, over));
                    }
                }
            }
            found
        };
        let chunks: Vec<_> = (0..leaves.div_ceil(CHUNK)).into_par_iter().map(of_chunk).collect();
        self.budget.cancel.check()?;
        Ok(chunks.concat())
    }

    /// The least, and of equal ones that of the first face.
    fn least(&self, found: &[(u32, Over)]) -> Option<Thickness> {
        let mesh = self.faces.mesh;
        let &(face, (height, other, point)) = found.iter().min_by(|a, b| a.1.0.total_cmp(&b.1.0).then(a.0.cmp(&b.0)))?;
        let low = mesh.vertices.iter().copied().reduce(DVec3::min).unwrap_or_default();
        let high = mesh.vertices.iter().copied().reduce(DVec3::max).unwrap_or_default();
        let slack = 64.0 * f64::EPSILON * (low.abs().max(high.abs()).max_element() + low.distance(high));
        let least = Interval { low: (height - slack).max(0.0), high: height + slack };
        let foot = self.faces.face(face, self.side).map_or(point, |face| point - face.direction * height);
        Some(Thickness { least, between: [foot, point], faces: [face, other] })
    }
}

/// The least thickness on one side of a closed mesh that does not cross itself; `None` where no face has another one over it, as for the gaps of a ball. Cost:
/// n log n for triangles of like size; a face over which many small ones lie costs as many as are not higher than the lowest by more than their boxes. The
/// result does not depend on the number of threads.
///
/// # Errors
/// [`Stopped`].
pub fn thickness(mesh: &TriMesh, side: Side, budget: &Budget) -> Result<Option<Thickness>, Stopped> {
    let search = Search { faces: Faces::of(mesh), side, budget };
    // Heights are not negative: their bits are in their order. What others have found first only saves work: a face is left out only if it is higher than the
    // least of all, whenever that is found.
    let least = AtomicU64::new(f64::INFINITY.to_bits());
    let found = search.all(|own| f64::from_bits(least.fetch_min(own.to_bits(), Ordering::Relaxed)).min(own))?;
    Ok(search.least(&found))
}

/// The thickness on one side over every face of a closed mesh that does not cross itself, and the least of it. It costs as much for each face as [`thickness()`] does
/// for the first. The result does not depend on the number of threads.
///
/// # Errors
/// [`Stopped`].
pub fn thickness_map(mesh: &TriMesh, side: Side, budget: &Budget) -> Result<ThicknessMap, Stopped> {
    let search = Search { faces: Faces::of(mesh), side, budget };
    let found = search.all(|_| f64::INFINITY)?;
    let mut faces = vec![f64::INFINITY; mesh.triangles.len()];
    for (face, (height, ..)) in &found {
        faces[*face as usize] = *height;
    }
    let mut vertices = vec![f64::INFINITY; mesh.vertices.len()];
    for (corners, thickness) in mesh.triangles.iter().zip(&faces) {
        for &corner in corners {
            let least = &mut vertices[corner as usize];
            *least = least.min(*thickness);
        }
    }
    Ok(ThicknessMap { least: search.least(&found), faces, vertices })
}
