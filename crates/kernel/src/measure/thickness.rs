//! How thick the walls of a solid are, and the gaps between them: along the normals of its faces, the least of all and face by face.
//!
//! The wall at a point of a face is the way along the inward normal to where it leaves the solid, the gap the same outwards, where the two faces look at each other: their normals are opposite
//! within 45 degrees, and they have no corner in common. (Elsewhere there is an edge between them, not a wall: beside every edge sharper than a right angle the way ends in nothing.) The
//! least wall over all points of all faces is found exactly: over a face a, another face b has a height that is linear along a, so its least value over the
//! common part of a and the shadow of b on a's plane is at a corner of that polygon. Where triangles do not cross, the first face that a normal meets is the
//! nearest; so a face counts where no nearer one is, and what nearer ones that do not look at a hide of it is taken off its polygon. Parts of the tree are left out that are beside the prism over
//! the face or higher than what was found.
//!
//! A mesh that stands for a shape within some distance has needles whose normals tell nothing of the shape, and folds: faces lower than a few times that distance are not asked, though they may
//! be met, and those that are as near to each other are not across each other.

use super::Interval;
use super::double::normal;
use crate::budget::{Budget, Stopped};
use crate::solid::TriMesh;
use crate::solid::box_tree::{Box32, BoxTree};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};
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

/// Cosine of the angle within which normals of faces that look at each other are opposite.
const LOOKS: f64 = FRAC_1_SQRT_2;
/// Faces lower than this have no direction, in units of what the mesh may be off.
const LEAST_HEIGHT: f64 = 2.0;
/// Faces nearer to each other than this are folds of one surface, in units of what the mesh may be off: both lie in a band of twice that, across which a way at 45 degrees is so long.
pub const FOLD: f64 = 2.0 * SQRT_2;
/// How much farther is looked when what is near is hidden.
const FARTHER: f64 = 2.0;
/// Leaves of the tree whose triangles are looked at one after the other.
const CHUNK: usize = 64;
/// Shadows of less area than this share of the squared lengths have none, and so have faces whose normals are this near to a right angle with the direction: those along it.
const FLAT: f64 = 1e-12;

/// A plane by its normal and a point.
type Plane = (DVec3, DVec3);

/// A face with a frame: the direction that is measured along, and the planes through its edges along it.
struct Face {
    origin: DVec3,
    direction: DVec3,
    /// Inward normals of the planes through the edges, and a point of each.
    sides: [Plane; 3],
}

impl Face {
    /// None for a face without area.
    fn new(corners: [DVec3; 3], normal: DVec3, side: Side) -> Option<Self> {
        if normal == DVec3::ZERO {
            return None;
        }
        let direction = if side == Side::Wall { -normal } else { normal };
        Some(Self { origin: corners[0], direction, sides: sides(corners, normal) })
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

    /// The shadow of another triangle over the face, on that triangle, if it has an area; it is in the first of two polygons then.
    fn shadow(&self, other: [DVec3; 3], normal: DVec3, polygons: &mut [Vec<DVec3>; 2]) -> bool {
        // What is left of it after clipping may be too small to tell.
        if normal.dot(self.direction).abs() <= FLAT {
            return false;
        }
        let [polygon, clipped] = polygons;
        polygon.clear();
        polygon.extend(other);
        for side in &self.sides {
            clip(polygon, *side, clipped);
            std::mem::swap(polygon, clipped);
        }
        self.has_area(polygon)
    }

    /// Whether a polygon has an area, seen along the direction.
    fn has_area(&self, polygon: &[DVec3]) -> bool {
        let Some((&first, others)) = polygon.split_first() else { return false };
        let area: f64 = others.windows(2).map(|pair| (pair[0] - first).cross(pair[1] - first).dot(self.direction)).sum();
        let size = polygon.iter().map(|point| point.distance_squared(first)).fold(0.0, f64::max);
        area.abs() > FLAT * size
    }

    fn height_of(&self, point: DVec3) -> f64 {
        (point - self.origin).dot(self.direction)
    }

    /// The least height of a polygon's points, and where it is, if it is over the face.
    fn height(&self, polygon: &[DVec3]) -> Option<(f64, DVec3)> {
        // Where triangles do not cross, a face is over the other or below it as a whole.
        if polygon.iter().map(|point| self.height_of(*point)).sum::<f64>() <= 0.0 {
            return None;
        }
        let lowest = polygon.iter().map(|point| (self.height_of(*point), *point)).min_by(|a, b| a.0.total_cmp(&b.0));
        lowest.map(|(height, point)| (height.max(0.0), point))
    }

    /// Takes off convex polygons, of one plane, what is hidden by another triangle that is nearer.
    fn hide(&self, pieces: &mut Vec<Vec<DVec3>>, other: [DVec3; 3], normal: DVec3) {
        let across = if normal.dot(self.direction) < 0.0 { -self.direction } else { self.direction };
        let sides = sides(other, across);
        for mut piece in std::mem::take(pieces) {
            let mut within = piece.clone();
            let mut clipped = Vec::new();
            for side in &sides {
                clip(&within, *side, &mut clipped);
                std::mem::swap(&mut within, &mut clipped);
            }
            // The way from a point of the piece to the other's plane, along the direction.
            let way = |point: &DVec3| (other[0] - *point).dot(normal) / self.direction.dot(normal);
            if !self.has_area(&within) || within.iter().map(way).sum::<f64>() >= 0.0 {
                pieces.push(piece);
                continue;
            }
            for (inward, through) in sides {
                let mut outside = Vec::new();
                clip(&piece, (-inward, through), &mut outside);
                if self.has_area(&outside) {
                    pieces.push(outside);
                }
                clip(&piece, (inward, through), &mut clipped);
                std::mem::swap(&mut piece, &mut clipped);
            }
        }
    }
}

/// The planes through the edges of a triangle along a direction, which has the triangle counter-clockwise around it.
fn sides([a, b, c]: [DVec3; 3], direction: DVec3) -> [Plane; 3] {
    [(a, b), (b, c), (c, a)].map(|(from, to)| (direction.cross(to - from), from))
}

/// What a plane leaves of a convex polygon on its inner side.
fn clip(polygon: &[DVec3], (inward, through): Plane, clipped: &mut Vec<DVec3>) {
    clipped.clear();
    for (k, &from) in polygon.iter().enumerate() {
        let to = polygon[(k + 1) % polygon.len()];
        let (at, next) = ((from - through).dot(inward), (to - through).dot(inward));
        if at >= 0.0 {
            clipped.push(from);
        }
        if (at > 0.0 && next < 0.0) || (at < 0.0 && next > 0.0) {
            clipped.push(from + (to - from) * (at / (at - next)));
        }
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
    side: Side,
    /// Faces lower than this tell nothing,
    least_height: f64,
    /// and those nearer than this are not across each other.
    fold: f64,
}

/// What a face is to another one that it is over.
#[derive(Clone, Copy)]
enum Sight {
    /// They look at each other.
    Meets,
    /// It ends the way without that.
    Hides,
}

impl<'m> Faces<'m> {
    fn of(mesh: &'m TriMesh, side: Side, error_mm: f64) -> Self {
        let mut tree = BoxTree::default();
        tree.build(mesh.triangles.len(), |triangle| Some(Box32::of(&corners(mesh, triangle).map(|p| p.to_array()))), true);
        let normals =
            (0..mesh.triangles.len() as u32).into_par_iter().map(|face| normal(corners(mesh, face)).normalize_or_zero()).collect();
        Self { mesh, normals, tree, side, least_height: LEAST_HEIGHT * error_mm, fold: FOLD * error_mm }
    }

    /// The frame of a face; none where it tells no direction.
    fn face(&self, number: u32) -> Option<Face> {
        let corners = corners(self.mesh, number);
        let [a, b, c] = corners;
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let is_high = (b - a).cross(c - a).length() >= self.least_height * longest;
        is_high.then(|| Face::new(corners, self.normals[number as usize], self.side)).flatten()
    }

    /// What a face is to one below it, with its least height over that and where it is; none where it ends no way from there. Its shadow is the first polygon then.
    fn sight(&self, below: u32, face: &Face, other: u32, polygons: &mut [Vec<DVec3>; 2]) -> Option<(Sight, f64, DVec3)> {
        let normal = self.normals[other as usize];
        let along = normal.dot(face.direction);
        let leaving = if self.side == Side::Wall { along } else { -along };
        if other == below || leaving <= FLAT || !face.shadow(corners(self.mesh, other), normal, polygons) {
            return None;
        }
        let (height, point) = face.height(&polygons[0])?;
        let [own, theirs] = [below, other].map(|face| self.mesh.triangles[face as usize]);
        if leaving >= LOOKS && !theirs.iter().any(|corner| own.contains(corner)) {
            return (height >= self.fold).then_some((Sight::Meets, height, point));
        }
        polygons[0].iter().any(|point| face.height_of(*point) >= self.fold).then_some((Sight::Hides, height, point))
    }

    /// The nearest face that looks at another one, at most as high as a bound; of equally high ones the first. One that is over a neighbour, and those beside it, are looked at
    /// before the tree is searched, for what they tell is often the answer, and leaves little to search.
    fn over(&self, below: u32, bound: f64, guess: Option<u32>, polygons: &mut [Vec<DVec3>; 2]) -> Option<Over> {
        let face = self.face(below)?;
        let mut best: Option<Over> = None;
        let mut hidden_from = f64::INFINITY;
        let entry = |around: &Box32| face.entry(around);
        let mut look = |leaf: usize| {
            for (&other, around) in self.tree.items(leaf).iter().zip(self.tree.boxes(leaf)) {
                if entry(around).is_none() {
                    continue;
                }
                match self.sight(below, &face, other, polygons) {
                    Some((Sight::Hides, height, _)) => hidden_from = hidden_from.min(height),
                    Some((Sight::Meets, height, point))
                        if height <= bound && best.is_none_or(|best| (height, other) < (best.0, best.1)) =>
                    {
                        best = Some((height, other, point));
                    }
                    _ => {}
                }
            }
            best.map_or(bound, |best| best.0)
        };
        let near = guess.map_or(bound, |other| look(self.tree.leaf_with(other)));
        self.tree.nearest(near, entry, &mut look);
        // All that is below the best was looked at.
        match best {
            Some((height, ..)) if hidden_from < height => self.seen(below, &face, height, bound, polygons),
            best => best,
        }
    }

    /// The same where something is hidden: what lies over the face up to some height is listed, and the nearest part that is not hidden is looked for.
    fn seen(&self, below: u32, face: &Face, first: f64, bound: f64, polygons: &mut [Vec<DVec3>; 2]) -> Option<Over> {
        let mut limit = first;
        loop {
            let (mut met, mut hiding) = (Vec::new(), Vec::new());
            self.tree.nearest(
                limit,
                |around| face.entry(around),
                |leaf| {
                    for &other in self.tree.items(leaf) {
                        match self.sight(below, face, other, polygons) {
                            Some((Sight::Meets, height, _)) if height <= limit => met.push((height, other, polygons[0].clone())),
                            Some((Sight::Hides, height, _)) if height <= limit => hiding.push(other),
                            _ => {}
                        }
                    }
                    limit
                },
            );
            met.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            hiding.sort_unstable();
            let mut best: Option<Over> = None;
            for (lowest, other, polygon) in met {
                if best.is_some_and(|best| best.0 < lowest) {
                    break;
                }
                let mut pieces = vec![polygon];
                for &hides in &hiding {
                    face.hide(&mut pieces, corners(self.mesh, hides), self.normals[hides as usize]);
                }
                for (height, point) in pieces.iter().filter_map(|piece| face.height(piece)) {
                    if height <= bound && best.is_none_or(|best| (height, other) < (best.0, best.1)) {
                        best = Some((height, other, point));
                    }
                }
            }
            // What hides lower parts than the limit is known, so what is seen below it is.
            if best.is_some_and(|best| best.0 <= limit) || limit >= bound {
                return best.filter(|best| best.0 <= bound);
            }
            limit = if limit * FARTHER > self.size() { bound } else { limit * FARTHER };
        }
    }

    /// The size of all.
    fn size(&self) -> f64 {
        let all = self.tree.whole();
        (0..3).map(|axis| f64::from(all.high[axis]) - f64::from(all.low[axis])).sum()
    }
}

/// What lies over the faces of a mesh.
struct Search<'m> {
    faces: Faces<'m>,
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
                    if let Some(over) = self.faces.over(face, bound(least), guess, &mut polygons) {
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
        let foot = self.faces.face(face).map_or(point, |face| point - face.direction * height);
        Some(Thickness { least, between: [foot, point], faces: [face, other] })
    }
}

/// The least thickness on one side of a closed mesh that does not cross itself and stands for a shape within `error_mm`; `None` where no face has another one over it, as for the gaps of a ball,
/// or all faces are too low to tell a direction. Cost: n log n for triangles of like size; a face over which many small ones lie costs as many as are not higher than the lowest by more than their
/// boxes. The result does not depend on the number of threads.
///
/// # Errors
/// [`Stopped`].
pub fn thickness(mesh: &TriMesh, side: Side, error_mm: f64, budget: &Budget) -> Result<Option<Thickness>, Stopped> {
    let search = Search { faces: Faces::of(mesh, side, error_mm), budget };
    // Heights are not negative: their bits are in their order. What others have found first only saves work: a face is left out only if it is higher than the
    // least of all, whenever that is found.
    let least = AtomicU64::new(f64::INFINITY.to_bits());
    let found = search.all(|own| f64::from_bits(least.fetch_min(own.to_bits(), Ordering::Relaxed)).min(own))?;
    Ok(search.least(&found))
}

/// The thickness on one side over every face of a closed mesh that does not cross itself and stands for a shape within `error_mm`, and the least of it. It costs as much for each face as
/// [`thickness()`] does for the first. Faces too low to tell a direction have what their corners have from others, from one to the next. The result does not depend on the number of threads.
///
/// # Errors
/// [`Stopped`].
pub fn thickness_map(mesh: &TriMesh, side: Side, error_mm: f64, budget: &Budget) -> Result<ThicknessMap, Stopped> {
    let search = Search { faces: Faces::of(mesh, side, error_mm), budget };
    let found = search.all(|_| f64::INFINITY)?;
    let mut faces = vec![f64::INFINITY; mesh.triangles.len()];
    for (face, (height, ..)) in &found {
        faces[*face as usize] = *height;
    }
    let mut vertices = vec![f64::INFINITY; mesh.vertices.len()];
    for (corners, thickness) in mesh.triangles.iter().zip(&faces) {
        for &corner in corners {
            vertices[corner as usize] = vertices[corner as usize].min(*thickness);
        }
    }
    let mut without: Vec<usize> = (0..faces.len()).filter(|&face| search.faces.face(face as u32).is_none()).collect();
    // From corner to corner, where many of them lie together.
    loop {
        let known = |face: usize| mesh.triangles[face].iter().map(|&corner| vertices[corner as usize]).fold(f64::INFINITY, f64::min);
        let told: Vec<(usize, f64)> = without.iter().map(|&face| (face, known(face))).filter(|(_, least)| least.is_finite()).collect();
        if told.is_empty() {
            break;
        }
        let is_known: Vec<bool> = vertices.iter().map(|thickness| thickness.is_finite()).collect();
        for (face, thickness) in told {
            faces[face] = thickness;
            for &corner in mesh.triangles[face].iter().filter(|corner| !is_known[**corner as usize]) {
                vertices[corner as usize] = vertices[corner as usize].min(thickness);
            }
        }
        without.retain(|&face| faces[face].is_infinite());
    }
    Ok(ThicknessMap { least: search.least(&found), faces, vertices })
}
