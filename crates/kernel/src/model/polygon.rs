//! Polygons cut into triangles, in one place for all who need them so.
//!
//! A polygon that is star-shaped from its first corner is cut into a fan about it. Any other is cut in its best plane, whose normal is its vector area
//! (Newell's), by a constrained Delaunay triangulation with exact predicates (Chew, "Constrained Delaunay triangulations", 1989). No vertex is added and
//! every edge of the polygon stays an edge, so that meshes that close stay closed. A polygon that meets itself in its plane has no inside and is refused.

use glam::{DVec2, DVec3};
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};
use std::collections::BTreeMap;

/// What turns back, or is no area at all, by less than this part of the whole is rounding.
const ROUNDING: f64 = 1e-12;

/// What products of coordinates lose, as a part of them: a polygon that is no wider is a line.
const LINE: f64 = 8.0 * f64::EPSILON;

/// A polygon that is no fan may have so many corners. Its triangulation takes some 200 bytes for each, and files of hostile people have faces that fill them.
pub const MOST_CORNERS: usize = 1 << 17;

/// Why a polygon has no inside that triangles could fill.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PolygonFault {
    /// Two of its edges cross.
    #[error("it crosses itself in its plane: its edge {} - {} runs through another one; split it into faces that do not", .edge[0], .edge[1])]
    Crossing {
        /// The vertices of the edge that was found second.
        edge: [u32; 2],
    },
    /// A corner lies on another one or on an edge.
    #[error("it touches itself in its plane at vertex {vertex}; split it into faces that do not")]
    Touching {
        /// The vertex of a corner or edge that touches.
        vertex: u32,
    },
    /// It winds or folds so that its parts cancel.
    #[error("it encloses as much on one side as on the other, and lies in no plane; split it into flatter faces")]
    NoPlane,
    /// More corners than are cut.
    #[error("it has {corners} corners and is not star-shaped from its first; {MOST_CORNERS} are allowed then; split it")]
    TooLong {
        /// How many it has.
        corners: usize,
    },
}

impl PolygonFault {
    /// Stable code.
    #[must_use]
    pub fn code(self) -> &'static str {
        match self {
            Self::Crossing { .. } | Self::Touching { .. } | Self::NoPlane => "mesh.crossing-face",
            Self::TooLong { .. } => "mesh.long-face",
        }
    }
}

/// A polygon of four corners or more, as a run of triangles that fill it. The first triangle begins with its first corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PolygonRun {
    /// The first triangle.
    pub first: u32,
    /// How many there are: two less than the polygon has corners.
    pub count: u32,
}

impl PolygonRun {
    /// Its triangles, of those of the mesh.
    #[must_use]
    pub fn triangles(self, all: &[[u32; 3]]) -> &[[u32; 3]] {
        &all[self.first as usize..self.first as usize + self.count as usize]
    }

    /// Puts its corners in the place of what `corners` holds, in their order. Cost: linear for fans, else sorting.
    pub fn corners(self, all: &[[u32; 3]], corners: &mut Vec<u32>) {
        corners.clear();
        let triangles = self.triangles(all);
        if is_fan(triangles) {
            corners.extend_from_slice(&triangles[0]);
            corners.extend(triangles[1..].iter().map(|triangle| triangle[2]));
            return;
        }
        // Edges inside run both ways; the others are the polygon's, and none begins where another does.
        let mut edges: Vec<[u32; 2]> = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
        edges.sort_unstable();
        let sides: BTreeMap<u32, u32> =
            edges.iter().filter(|&&[a, b]| edges.binary_search(&[b, a]).is_err()).map(|&[a, b]| (a, b)).collect();
        let mut corner = triangles[0][0];
        for _ in 0..triangles.len() + 2 {
            corners.push(corner);
            corner = sides[&corner];
        }
    }
}

/// Whether triangles are a fan about the first corner of the first, as [`fan`] makes them.
pub(crate) fn is_fan(triangles: &[[u32; 3]]) -> bool {
    triangles.windows(2).all(|pair| pair[0][0] == pair[1][0] && pair[0][2] == pair[1][1])
}

/// A polygon as triangles about its first corner, whatever its shape; none of less than three corners.
pub fn fan(corners: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    (1..corners.len().saturating_sub(1)).map(|k| [corners[0], corners[k], corners[k + 1]])
}

/// Adds the triangles of a polygon, two less than it has corners, to others; the first begins with its first corner. Corners are indices of `vertices`.
/// Cost: linear for fans, else that of a triangulation.
///
/// # Errors
/// Why it has none; nothing is added then.
pub fn cut(vertices: &[DVec3], corners: &[u32], triangles: &mut Vec<[u32; 3]>) -> Result<(), PolygonFault> {
    if corners.len() < 4 || is_star_shaped(vertices, corners) {
        triangles.extend(fan(corners));
        return Ok(());
    }
    if corners.len() > MOST_CORNERS {
        return Err(PolygonFault::TooLong { corners: corners.len() });
    }
    if let Some(vertex) = repeated(corners) {
        return Err(PolygonFault::Touching { vertex });
    }
    let arms = Arms::of(vertices, corners);
    let points: Vec<DVec3> = corners.iter().map(|&corner| arms.arm(vertices[corner as usize])).collect();
    if is_line(&points, arms.reach(vertices, corners)) {
        triangles.extend(fan(corners));
        return Ok(());
    }
    let mut found = fill(&points).map_err(|meeting| match meeting {
        Meeting::Crossing(k) => PolygonFault::Crossing { edge: [corners[k], corners[(k + 1) % corners.len()]] },
        Meeting::Touching(k) => PolygonFault::Touching { vertex: corners[k] },
        Meeting::NoPlane => PolygonFault::NoPlane,
    })?;
    // An order that tells nothing of how they were found, and begins with the first corner.
    for triangle in &mut found {
        let least = (0..3).min_by_key(|&k| triangle[k]).unwrap_or(0);
        triangle.rotate_left(least);
    }
    found.sort_unstable();
    triangles.extend(found.iter().map(|triangle| triangle.map(|k| corners[k])));
    Ok(())
}

/// A fan is the polygon when no triangle of it turns against the whole, no edge passes its first corner, and it does not go round that more than once.
fn is_star_shaped(vertices: &[DVec3], corners: &[u32]) -> bool {
    let arms = Arms::of(vertices, corners);
    let arm = |k: usize| arms.arm(vertices[corners[k] as usize]);
    let is_here = |k: usize| arm(k) == DVec3::ZERO;
    // Corners at the place of the first may only be the next ones and those before: elsewhere the polygon comes back to it.
    let (mut from, mut to) = (1, corners.len() - 1);
    while from < to && is_here(from) {
        from += 1;
    }
    while to > from && is_here(to) {
        to -= 1;
    }
    let turn = |k: usize| arm(k).cross(arm(k + 1));
    let whole: DVec3 = (from..to).map(turn).sum();
    let area = whole.length_squared();
    let rounding = ROUNDING * area;
    let is_turned = (from..to).any(|k| {
        let along = turn(k).dot(whole);
        // Turns that cancel to the last digit are no fan, though what is left of them has no direction to turn against.
        let cancels = turn(k).length_squared() * ROUNDING * ROUNDING > area;
        let passes = along <= rounding && (is_here(k) || arm(k).dot(arm(k + 1)) < 0.0);
        along < -rounding || cancels || passes
    });
    if is_turned {
        return false;
    }
    let start = arm(from);
    let mut past_half = false;
    for k in from..=to {
        let side = start.cross(arm(k)).dot(whole);
        if past_half && side > rounding {
            return false;
        }
        past_half |= side < -rounding;
    }
    true
}

/// A vertex that occurs twice.
pub(super) fn repeated(corners: &[u32]) -> Option<u32> {
    let mut sorted = corners.to_vec();
    sorted.sort_unstable();
    sorted.windows(2).find(|pair| pair[0] == pair[1]).map(|pair| pair[0])
}

/// A polygon seen from its first corner, made smaller than 1 by a power of two, so that no product overflows or vanishes.
struct Arms {
    first: DVec3,
    scale: f64,
}

impl Arms {
    fn of(vertices: &[DVec3], corners: &[u32]) -> Self {
        let first = vertices[corners[0] as usize];
        let extent = corners.iter().map(|&corner| Self::half(vertices[corner as usize], first).abs().max_element()).fold(0.0, f64::max);
        let scale = if extent > 0.0 { 0.5 * (-extent.log2().floor().clamp(-1000.0, 1000.0)).exp2() } else { 1.0 };
        Self { first, scale }
    }

    /// Halves, because the difference of two numbers may be none.
    fn half(vertex: DVec3, first: DVec3) -> DVec3 {
        0.5 * vertex - 0.5 * first
    }

    fn arm(&self, vertex: DVec3) -> DVec3 {
        Self::half(vertex, self.first) * self.scale
    }

    /// How far the polygon reaches from the origin in the measure of the arms.
    fn reach(&self, vertices: &[DVec3], corners: &[u32]) -> f64 {
        corners.iter().map(|&corner| (vertices[corner as usize] * (0.5 * self.scale)).length()).fold(0.0, f64::max)
    }
}

/// Whether a polygon is so narrow that rounding alone tells its sides apart: any triangles are its then.
fn is_line(points: &[DVec3], reach: f64) -> bool {
    let far = points.iter().copied().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared())).unwrap_or_default();
    let most = LINE * far.length() * reach.max(far.length());
    points.iter().all(|point| far.cross(*point).length() <= most)
}

/// How a polygon meets itself, by the number of an edge or corner.
enum Meeting {
    Crossing(usize),
    Touching(usize),
    NoPlane,
}

/// The triangles of a polygon by numbers of corners.
fn fill(points: &[DVec3]) -> Result<Vec<[usize; 3]>, Meeting> {
    let turns = || points.windows(2).map(|pair| pair[0].cross(pair[1]));
    let (whole, most) = turns().fold((DVec3::ZERO, 0.0_f64), |(whole, most), turn| (whole + turn, most.max(turn.length())));
    if whole.length() <= ROUNDING * most {
        return Err(Meeting::NoPlane);
    }
    let (across, up) = whole.normalize().any_orthonormal_pair();
    let plane: Vec<DVec2> = points.iter().map(|point| DVec2::new(point.dot(across), point.dot(up))).collect();
    // Corners at the place of the one before are cut off as triangles without area.
    let mut triangles = Vec::with_capacity(points.len() - 2);
    let mut ring: Vec<usize> = Vec::with_capacity(points.len());
    for k in 0..points.len() {
        match ring.last() {
            Some(&last) if points[last] == points[k] => triangles.push([last, k, (k + 1) % points.len()]),
            _ => ring.push(k),
        }
    }
    if let [first, .., before, last] = ring[..]
        && points[last] == points[first]
    {
        ring.pop();
        triangles.push([before, last, first]);
    }
    triangulate(&plane, &ring, &mut triangles)?;
    Ok(triangles)
}

/// Adds the triangles inside a ring of points of the plane that runs counterclockwise.
fn triangulate(plane: &[DVec2], ring: &[usize], triangles: &mut Vec<[usize; 3]>) -> Result<(), Meeting> {
    let mut mesh = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    // Below this, squares vanish; the extent is about 1.
    let coordinate = |value: f64| if value.abs() < 1e-40 { 0.0 } else { value };
    let mut handles: Vec<FixedVertexHandle> = Vec::with_capacity(ring.len());
    for &k in ring {
        let handle = mesh.insert(Point2::new(coordinate(plane[k].x), coordinate(plane[k].y))).map_err(|_| Meeting::NoPlane)?;
        if handle.index() != handles.len() {
            return Err(Meeting::Touching(k));
        }
        handles.push(handle);
    }
    let mut stack = Vec::new();
    for (index, &from) in handles.iter().enumerate() {
        let to = handles[(index + 1) % handles.len()];
        match mesh.try_add_constraint(from, to).as_slice() {
            [] => return Err(Meeting::Crossing(ring[index])),
            [_] => {}
            // It is parted by the corners on it.
            [part, ..] => return Err(Meeting::Touching(ring[mesh.directed_edge(*part).to().fix().index()])),
        }
    }
    // Inside is what is on the left of an edge, and all that is reached from there without crossing one.
    for (index, &from) in handles.iter().enumerate() {
        let to = handles[(index + 1) % handles.len()];
        stack.extend(mesh.get_edge_from_neighbors(from, to).and_then(|edge| edge.face().as_inner()).map(|face| face.fix()));
    }
    let mut seen = vec![false; mesh.num_all_faces()];
    let wanted = triangles.len() + ring.len() - 2;
    while let Some(face) = stack.pop() {
        if std::mem::replace(&mut seen[face.index()], true) {
            continue;
        }
        let face = mesh.face(face);
        triangles.push(face.vertices().map(|vertex| ring[vertex.fix().index()]));
        let open = face.adjacent_edges().into_iter().filter(|edge| !edge.is_constraint_edge());
        stack.extend(open.filter_map(|edge| edge.rev().face().as_inner()).map(|face| face.fix()));
    }
    // A ring that rounding turned around has its inside on the other side.
    if triangles.len() == wanted { Ok(()) } else { Err(Meeting::NoPlane) }
}
