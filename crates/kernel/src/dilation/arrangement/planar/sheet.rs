//! The upper half of a surface around bodies in a plane: a sheet over it, of triangles between rings at several heights.
//!
//! Rings, and lines along creases between them, are the constraints of a Delaunay triangulation of the plane (Chew, "Constrained Delaunay triangulations", 1989). What is within the lowest rings, the rim, is the sheet's base. Above it the sheet has a height everywhere but at the rim: so it
//! crosses nothing, nor does it meet its mirror image, which closes it. Every triangle is held against all bodies; where it is too near to one, or too far from all, places are added.

use super::super::between::{Body as _, Memory, lowest, middle, too_far};
use super::super::plane::{self, Edge, corners, handle, inside, join, key};
use super::rings::Ring;
use super::valleys::Lines;
use super::wires::{Wires, cross as cross_in_plane, dot, minus, plus};
use super::{Limits, Place};
use crate::attractor::cell::{Point, cross, distance_squared, subtract, unit};
use crate::budget::{Budget, Stopped};
use crate::dilation::convex::Convex as _;
use crate::dilation::surface::NameMap;
use crate::groups::Groups;
use crate::solid::box_tree::Box32;
use rayon::prelude::*;
use spade::handles::{FixedDirectedEdgeHandle, FixedVertexHandle};
use spade::{HasPosition, Point2, Triangulation};

/// Rounds in which places are added.
const ROUNDS: usize = 24;
/// How far out in the band a place is added where the surface is too near, and where it is too far.
const OUT: [f64; 2] = [0.85, 0.4];
/// What is lower than this, in units of the band's inner end, is at the rim.
const LOW: f64 = 0.05;
/// An edge of the rim is bent no nearer to its ends than by this share, and by which parts of the way where others leave no room.
const LEAST_SHARE: f64 = 0.1;
const PARTS: [f64; 3] = [1.0, 0.6, 0.3];
/// How close to an edge a place is that it stands in the way of, in units of its length.
const CLOSE: f64 = 0.05;
/// Triangles that are looked at in a row.
const IN_A_ROW: usize = 64;

/// A vertex of the sheet: over a place of the plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    pub(super) at: Place,
    /// 0 at the rim alone.
    pub(super) height: f64,
}

impl HasPosition for Vertex {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        Point2::new(self.at[0], self.at[1])
    }
}

/// A sheet with as many components and holes as its base.
pub(super) struct Sheet {
    pub(super) vertices: Vec<Vertex>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) components: u64,
    pub(super) holes: u64,
}

/// A place where a triangle may not be as it is.
#[derive(Clone, Copy, Debug)]
enum Fault {
    Near(Point),
    Far(Point),
    /// It is as low as the rim, and not of it.
    Low(Point),
}

/// The sheet over rings and lines between them, between the ends of the band from all bodies; none where rings cross, or places do not make it so.
///
/// # Errors
/// [`Stopped`].
pub(super) fn sheet(
    wires: &Wires,
    rings: &[Ring],
    lines: &Lines,
    limits: &Limits<impl Fn(f64) -> f64 + Sync>,
    budget: &Budget,
) -> Result<Option<Sheet>, Stopped> {
    let Some(mut plane) = Plane::new(rings, lines) else { return Ok(None) };
    let mut known: NameMap<u128, ()> = NameMap::default();
    for _ in 0..ROUNDS {
        let Some(triangles) = plane.base() else { return Ok(None) };
        let new: Vec<[u32; 3]> = triangles.iter().copied().filter(|triangle| !known.contains_key(&key(triangle))).collect();
        let check = |some: &[[u32; 3]]| -> Result<Vec<Option<Fault>>, Stopped> {
            budget.cancel.check()?;
            let of = |triangle: &[u32; 3]| {
                plane.low(triangle).or_else(|| fault(wires, &triangle.map(|vertex| plane.point(vertex)), [limits.inner, limits.outer]))
            };
            Ok(some.iter().map(of).collect())
        };
        let faults: Vec<Option<Fault>> = new.par_chunks(IN_A_ROW).map(check).collect::<Result<Vec<_>, Stopped>>()?.concat();
        if faults.iter().all(Option::is_none) {
            return Ok(plane.finish(wires, triangles));
        }
        for (number, (triangle, fault)) in new.iter().zip(faults).enumerate() {
            if number.is_multiple_of(IN_A_ROW) {
                budget.cancel.check()?;
            }
            let is_mended = match fault {
                None => known.insert(key(triangle), ()).is_none(),
                Some(fault) => plane.mend(wires, triangle, fault, limits).is_some(),
            };
            if !is_mended {
                return Ok(None);
            }
        }
    }
    Ok(None)
}

/// The ends of a triangle's sides.
fn sides(triangle: &[u32; 3]) -> [[FixedVertexHandle; 2]; 3] {
    [0, 1, 2].map(|k| [triangle[k], triangle[(k + 1) % 3]].map(handle))
}

/// Whether an edge is one of the rim.
fn is_rim(edge: &Edge<'_, Vertex>) -> bool {
    edge.is_constraint_edge() && edge.from().data().height == 0.0 && edge.to().data().height == 0.0
}

/// The triangulated plane, and the places where it has vertices.
struct Plane {
    mesh: plane::Mesh<Vertex>,
    numbers: NameMap<[u64; 2], FixedVertexHandle>,
}

impl Plane {
    fn new(rings: &[Ring], lines: &Lines) -> Option<Self> {
        let mut plane = Self { mesh: plane::Mesh::new(), numbers: NameMap::default() };
        let mut own: Vec<FixedVertexHandle> = Vec::new();
        for ring in rings {
            own.clear();
            for corner in &ring.corners {
                own.push(if ring.level == 0 {
                    plane.add(Vertex { at: corner.at, height: 0.0 })
                } else {
                    plane.raise(Vertex { at: corner.at, height: ring.height })
                }?);
            }
            for (k, &from) in own.iter().enumerate() {
                // What is above the rim is led along rings, and need not follow them.
                let is_joined = join(&mut plane.mesh, from, own[(k + 1) % own.len()]);
                if !is_joined && ring.level == 0 {
                    return None;
                }
            }
        }
        for &joint in &lines.joints {
            plane.raise(joint)?;
        }
        for line in &lines.all {
            if let [Some(&from), Some(&to)] = line.map(|at| plane.numbers.get(&at.map(f64::to_bits))) {
                join(&mut plane.mesh, from, to);
            }
        }
        Some(plane)
    }

    /// Adds a vertex; none where there is one.
    fn add(&mut self, vertex: Vertex) -> Option<FixedVertexHandle> {
        let count = self.mesh.num_vertices();
        let handle = self.mesh.insert(vertex).ok()?;
        self.numbers.insert(vertex.at.map(f64::to_bits), handle);
        (handle.index() == count).then_some(handle)
    }

    /// Adds a vertex that is above the rim, likewise.
    fn raise(&mut self, vertex: Vertex) -> Option<FixedVertexHandle> {
        if vertex.height > 0.0 { self.add(vertex) } else { None }
    }

    fn vertex(&self, number: u32) -> Vertex {
        *self.mesh.vertex(handle(number)).data()
    }

    fn point(&self, number: u32) -> Point {
        let Vertex { at, height } = self.vertex(number);
        [at[0], at[1], height]
    }

    /// The triangles within an odd number of rims; none where a rim is not closed.
    fn base(&self) -> Option<Vec<[u32; 3]>> {
        inside(&self.mesh, is_rim)
    }

    /// The middle of an edge between vertices of the rim that is none of its edges.
    fn low(&self, triangle: &[u32; 3]) -> Option<Fault> {
        let [from, to] = (0..3).find_map(|k| {
            let ends = [triangle[k], triangle[(k + 1) % 3]];
            let is_low = ends.iter().all(|&end| self.vertex(end).height == 0.0);
            let [from, to] = ends.map(handle);
            let is_inner = is_low && self.mesh.get_edge_from_neighbors(from, to).is_some_and(|edge| !is_rim(&edge));
            is_inner.then(|| ends.map(|end| self.vertex(end)))
        })?;
        Some(Fault::Low([0.5 * (from.at[0] + to.at[0]), 0.5 * (from.at[1] + to.at[1]), 0.0]))
    }

    /// Adds a place where a triangle has a fault, or moves an edge of the rim out or in there; none where that is not possible.
    fn mend(&mut self, wires: &Wires, triangle: &[u32; 3], fault: Fault, limits: &Limits<impl Fn(f64) -> f64>) -> Option<()> {
        let (x, out) = match fault {
            Fault::Near(x) => (x, OUT[0]),
            Fault::Far(x) | Fault::Low(x) => (x, OUT[1]),
        };
        let at = [x[0], x[1]];
        let (distance, _) = wires.away(at)?;
        if !matches!(fault, Fault::Low(_))
            && (x[2] < LOW * limits.inner || distance > limits.outer)
            && let Some(edge) =
                sides(triangle).into_iter().filter_map(|[from, to]| self.mesh.get_edge_from_neighbors(from, to)).find(is_rim)
        {
            let edge = edge.fix();
            return self.bend(wires, edge, at, limits.inner + out * (limits.outer - limits.inner), limits);
        }
        let loose = self.loosen(triangle, at);
        let crease = if matches!(fault, Fault::Far(_)) { wires.crease(at, limits.outer) } else { None };
        let [x, y, _] = middle(&triangle.map(|vertex| self.point(vertex)));
        let halfway = [0.5 * (at[0] + x), 0.5 * (at[1] + y)];
        for at in crease.into_iter().chain([at, halfway, [x, y]]).map(|at| at.map(&limits.round)) {
            let (distance, _) = wires.away(at)?;
            if let Some(height) = limits.over(distance, out)
                && !self.numbers.contains_key(&at.map(f64::to_bits))
            {
                let new = self.raise(Vertex { at, height })?;
                loose.into_iter().flatten().for_each(|end| {
                    join(&mut self.mesh, end, new);
                });
                return Some(());
            }
        }
        // A neighbour's fault may have been there.
        Some(())
    }

    /// Takes out edges of a triangle that a place is close to, unless they are of the rim: their ends.
    fn loosen(&mut self, triangle: &[u32; 3], at: Place) -> Vec<[FixedVertexHandle; 2]> {
        let mut loose = Vec::new();
        for ends in sides(triangle) {
            let Some(edge) = self.mesh.get_edge_from_neighbors(ends[0], ends[1]).filter(|edge| edge.is_constraint_edge() && !is_rim(edge))
            else {
                continue;
            };
            let [from, to] = [edge.from().data().at, edge.to().data().at];
            let (way, edge) = (minus(to, from), edge.as_undirected().fix());
            if cross_in_plane(way, minus(at, from)).abs() < CLOSE * dot(way, way) {
                self.mesh.remove_constraint_edge(edge);
                loose.push(ends);
            }
        }
        loose
    }

    /// Leads an edge of the rim over a place beside it that is as far from the bodies as wanted; none where that is not possible.
    fn bend(
        &mut self,
        wires: &Wires,
        edge: FixedDirectedEdgeHandle,
        at: Place,
        wanted: f64,
        limits: &Limits<impl Fn(f64) -> f64>,
    ) -> Option<()> {
        let edge = self.mesh.directed_edge(edge);
        let (ends, edge) = ([edge.from(), edge.to()], edge.as_undirected().fix());
        let [from, to] = ends.map(|end| end.data().at);
        let ends = ends.map(|end| end.fix());
        let way = minus(to, from);
        let share = (dot(minus(at, from), way) / dot(way, way)).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
        let at = plus(from, share, way);
        let (distance, away) = wires.away(at)?;
        self.mesh.remove_constraint_edge(edge);
        let point = |at: Place| Point2::new(at[0], at[1]);
        for part in PARTS {
            let new = plus(at, part * (wanted - distance), away).map(&limits.round);
            let is_free = |end: Place| !self.mesh.intersects_constraint(point(end), point(new));
            if is_free(from) && is_free(to) {
                let new = self.add(Vertex { at: new, height: 0.0 })?;
                return (join(&mut self.mesh, ends[0], new) && join(&mut self.mesh, new, ends[1])).then_some(());
            }
        }
        None
    }

    /// The sheet, if nothing but the rim is as low as the plane, and all bodies are below it.
    fn finish(&self, wires: &Wires, triangles: Vec<[u32; 3]>) -> Option<Sheet> {
        let vertices: Vec<Vertex> = self.mesh.vertices().map(|vertex| *vertex.data()).collect();
        let is_low = |vertex: u32| vertices[vertex as usize].height == 0.0;
        // Of every vertex, whether it is there, and the edges between it and others that are low.
        let (mut is_used, mut low_edges) = (vec![false; vertices.len()], vec![0_u32; vertices.len()]);
        for triangle in &triangles {
            triangle.iter().for_each(|&vertex| is_used[vertex as usize] = true);
            for ends in (0..3).map(|k| [triangle[k], triangle[(k + 1) % 3]]).filter(|ends| ends.iter().all(|&end| is_low(end))) {
                ends.into_iter().for_each(|end| low_edges[end as usize] += 1);
            }
        }
        // A rim's edge has one triangle, and a vertex of it two such edges; others between them would have two.
        let is_rim = |vertex: usize| is_used[vertex] && is_low(vertex as u32);
        if (0..vertices.len()).any(|vertex| is_rim(vertex) && low_edges[vertex] != 2)
            || triangles.iter().any(|triangle| triangle.iter().all(|&vertex| is_low(vertex)))
        {
            return None;
        }
        let rim = (0..vertices.len()).filter(|&vertex| is_rim(vertex)).count();
        let mut groups = Groups::of_triangles(vertices.len(), &triangles);
        let components = (0..vertices.len()).filter(|&vertex| is_used[vertex] && groups.of(vertex) as usize == vertex).count() as u64;
        let edges = (3 * triangles.len() + rim) / 2;
        let euler = is_used.iter().filter(|used| **used).count() as i64 - edges as i64 + triangles.len() as i64;
        self.is_above(wires, &triangles).then_some(())?;
        Some(Sheet { vertices, triangles, components, holes: (components as i64 - euler).try_into().ok()? })
    }

    /// Whether all bodies are in the base. No edge of the rim is near to one: so that is so if one vertex of those that hang together is.
    fn is_above(&self, wires: &Wires, triangles: &[[u32; 3]]) -> bool {
        let inside: NameMap<u128, ()> = triangles.iter().map(|triangle| (key(triangle), ())).collect();
        let mut groups = Groups::new(wires.places.len());
        wires.bodies.iter().for_each(|body| {
            groups.join(body.ends[0] as usize, body.ends[1] as usize);
        });
        let is_within = |place: &Place| {
            use spade::PositionInTriangulation::{OnEdge, OnFace, OnVertex};
            let faces: Vec<[u32; 3]> = match self.mesh.locate(Point2::new(place[0], place[1])) {
                OnFace(face) => vec![self.mesh.face(face).vertices().map(|vertex| vertex.fix().index() as u32)],
                OnEdge(edge) => {
                    let edge = self.mesh.directed_edge(edge);
                    let faces = [edge.face(), edge.rev().face()].into_iter().filter_map(|face| face.as_inner());
                    faces.map(corners).collect()
                }
                OnVertex(vertex) => {
                    let edges = self.mesh.vertex(vertex).out_edges();
                    edges.filter_map(|edge| edge.face().as_inner()).map(corners).collect()
                }
                _ => Vec::new(),
            };
            !faces.is_empty() && faces.iter().all(|face| inside.contains_key(&key(face)))
        };
        (0..wires.places.len()).all(|vertex| groups.of(vertex) as usize != vertex || is_within(&wires.places[vertex]))
    }
}

/// Where a triangle is nearer to a body than the first, or farther from all of them than the second of two ends.
fn fault(wires: &Wires, triangle: &[Point; 3], [inner, outer]: [f64; 2]) -> Option<Fault> {
    let flat = triangle.map(|corner| [corner[0], corner[1], 0.0]);
    let within = Box32::of(&flat);
    let longest = (0..3).map(|k| distance_squared(&triangle[k], &triangle[(k + 1) % 3])).fold(0.0, f64::max);
    // Nothing is nearer to what is so high.
    let is_high = triangle.iter().all(|corner| corner[2] >= inner);
    let edge = |k: usize| subtract(&triangle[k], &triangle[0]);
    let normal = unit(&cross(&edge(1), &edge(2)));
    let height = lowest(triangle, &normal);
    let (mut is_covered, mut found) = (false, None);
    wires.tree.query(&within, 0, |leaf| {
        for (&item, theirs) in wires.tree.items(leaf).iter().zip(wires.tree.boxes(leaf)) {
            if !within.meets(theirs) {
                continue;
            }
            let body = &wires.bodies[item as usize];
            let squares = triangle.map(|corner| body.distance_squared(&corner));
            is_covered |= squares.iter().all(|&square| square <= outer * outer);
            // The square of the distance, less that from any point, is concave: on the triangle it is no less than the least at a corner less the square of the radius of a ball around it.
            let least = squares.iter().copied().fold(f64::INFINITY, f64::min);
            if found.is_none() && !is_high && least - longest / 3.0 < inner * inner && height - body.highest(&normal) < inner {
                found = body.too_near(triangle, inner).map(|[place, _]| Fault::Near(place));
            }
        }
        found.is_none() && !(is_covered && is_high)
    });
    if found.is_some() || is_covered {
        return found;
    }
    let offer = |x: &Point| wires.closest([x[0], x[1]]).map(|(item, _)| item);
    let square = |item: u32, x: &Point| wires.bodies[item as usize].distance_squared(x);
    too_far(&wires.bodies, square, [], offer, triangle, outer, &mut Memory::default()).map(Fault::Far)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split_mix::Random;

    fn crossed() -> Wires {
        let segments = [[[0.0, 0.0], [10.0, 0.0]], [[3.0, -4.0], [4.0, 5.0]], [[8.0, 1.0], [9.0, 1.5]]];
        Wires::new(&segments, 4.0, 1e-12, &Budget::default()).unwrap().unwrap()
    }

    /// Random triangles against the distances of many of their places: those that are accepted have none out of bounds, those that are not have one, but for what is about at a bound.
    #[test]
    fn triangles_are_held_against_their_bounds() {
        let (wires, mut random) = (crossed(), Random(3));
        let mut counts = [0; 3];
        for _ in 0..4_000 {
            let middle = [12.0 * random.share() - 1.0, 12.0 * random.share() - 6.0, 1.6 * random.share()];
            let wide = 2.0 * random.share().powi(2);
            let triangle: [Point; 3] = std::array::from_fn(|_| {
                let [x, y, z] = middle.map(|x| x + wide * (random.share() - 0.5));
                [x, y, z.max(0.0)]
            });
            let distance =
                |[x, y, z]: Point| wires.bodies.iter().map(|body| (body.square([x, y]) + z * z).sqrt()).fold(f64::INFINITY, f64::min);
            let mut found = [f64::INFINITY, 0.0_f64];
            for i in 0..=20 {
                for j in 0..=20 - i {
                    let shares = [f64::from(i), f64::from(j), f64::from(20 - i - j)].map(|share| share / 20.0);
                    let at = std::array::from_fn(|axis| (0..3).map(|k| shares[k] * triangle[k][axis]).sum());
                    found = [found[0].min(distance(at)), found[1].max(distance(at))];
                }
            }
            let (inner, outer, close) = (0.8, 1.3, 0.05 * wide);
            match fault(&wires, &triangle, [inner, outer]) {
                None => {
                    assert!(found[0] >= inner && found[1] <= outer, "{triangle:?}: {found:?}");
                    counts[0] += 1;
                }
                Some(Fault::Near(x)) => {
                    assert!(found[0] <= inner + close && distance(x) < inner + 1e-9, "{triangle:?}: {found:?}");
                    counts[1] += 1;
                }
                Some(Fault::Far(_) | Fault::Low(_)) => {
                    assert!(found[1] >= outer - close, "{triangle:?}: {found:?}");
                    counts[2] += 1;
                }
            }
        }
        assert!(counts.iter().all(|&count| count > 100), "{counts:?}");
    }

    fn ring(level: usize, corners: &[Place]) -> Ring {
        let corners = corners.iter().map(|&at| super::super::rings::Corner { at, crease: None }).collect();
        Ring { level, height: [0.0, 1.0][level.min(1)], corners }
    }

    fn square(x: f64, half: f64) -> [Place; 4] {
        [[x - half, -half], [x + half, -half], [x + half, half], [x - half, half]]
    }

    /// What rings enclose, if it may be a sheet over one segment.
    fn finished(rings: &[Ring]) -> Option<[u64; 2]> {
        let wires = Wires::new(&[[[-0.1, 0.0], [0.1, 0.0]]], 1.0, 1e-12, &Budget::default()).unwrap()?;
        let plane = Plane::new(rings, &Lines::default())?;
        let triangles = plane.base()?;
        plane.finish(&wires, triangles).map(|sheet| [sheet.components, sheet.holes])
    }

    #[test]
    fn only_closed_rims_around_all_bodies_are_sheets() {
        let above = ring(1, &square(0.0, 1.0));
        assert_eq!(finished(&[ring(0, &square(0.0, 2.0)), above]), Some([1, 0]));
        let above = || ring(1, &square(0.0, 1.0));
        // A hole with what is above it around; and another piece beside.
        let hole = ring(0, &[[1.6, -0.1], [1.6, 0.1], [1.8, 0.0]]);
        assert_eq!(finished(&[ring(0, &square(0.0, 2.0)), above()]), Some([1, 0]));
        let pieces = [ring(0, &square(0.0, 2.0)), ring(0, &square(9.0, 2.0)), above(), ring(1, &square(9.0, 1.0))];
        assert_eq!(finished(&pieces), Some([2, 0]));
        // A triangle, or an edge inside, that is as low as the rim.
        assert_eq!(finished(&[ring(0, &square(0.0, 2.0))]), None);
        assert_eq!(finished(&[ring(0, &square(0.0, 2.0)), hole, ring(1, &square(0.0, 1.0))]), None);
        // Rims that cross, or have a corner in common, and a corner of one on an edge of the other.
        assert_eq!(finished(&[ring(0, &square(0.0, 2.0)), ring(0, &square(3.0, 2.0)), above()]), None);
        let corner = ring(0, &[[2.0, 2.0], [3.0, 2.0], [3.0, 3.0]]);
        assert_eq!(finished(&[ring(0, &square(0.0, 2.0)), corner, above()]), None);
        let touching = ring(0, &[[2.0, 0.0], [4.0, -1.0], [4.0, 1.0]]);
        assert_eq!(finished(&[ring(0, &square(0.0, 2.0)), touching, above(), ring(1, &[[3.5, -0.1], [3.7, 0.0], [3.5, 0.1]])]), None);
        // The body is outside, or in a hole.
        assert_eq!(finished(&[ring(0, &square(9.0, 2.0)), ring(1, &square(9.0, 1.0))]), None);
        let hole: Vec<Place> = square(0.0, 0.5).into_iter().rev().collect();
        assert_eq!(finished(&[ring(0, &square(0.0, 2.0)), ring(0, &hole), above()]), None);
        // What is above, and is not.
        let sunk = Ring { height: 0.0, ..ring(1, &square(0.0, 1.0)) };
        assert_eq!(finished(&[ring(0, &square(0.0, 2.0)), sunk]), None);
    }
}
