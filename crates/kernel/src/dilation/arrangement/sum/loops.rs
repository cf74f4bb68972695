//! From what is around vertices to the surface: chains are joined to loops, and what these bound in a plane is cut into triangles.

use super::super::plane::{self, Edge, Mesh};
use super::super::triangulate::{Planar, triangulate};
use super::ball::is_same;
use super::corner::{Chain, Patch};
use super::net::{Kinds, Net, Vertex};
use crate::attractor::cell::{Point, dot, subtract};
use crate::budget::{Budget, Stopped};
use crate::dilation::surface::{BlockSurface, NameMap};
use crate::groups::Groups;
use spade::{HasPosition, Point2, Triangulation};

/// A place in the plane.
type Place = [f64; 2];

/// Corners of a loop at most that is cut into triangles corner by corner.
const FEW_CORNERS: usize = 32;
/// Loops that are made, or cut, before a stop is noticed.
const IN_A_ROW: usize = 256;

/// A chain of a vertex.
type At = (u32, usize);

/// A loop with what it bounds to its left.
struct Loop {
    normal: Point,
    /// The group of chains in its plane: what they bound together is one facet.
    plane: u32,
    vertices: Vec<u32>,
}

/// All chains, and the points on them.
struct Chains<'a> {
    kinds: &'a Kinds,
    patches: &'a [Patch],
    /// Where points and chains of every vertex begin.
    first: Vec<[u32; 2]>,
    points: Vec<Point>,
    is_used: Vec<bool>,
    planes: Groups,
}

/// The surface, with the normals of the facets that its triangles are of; none where chains do not close.
///
/// # Errors
/// [`Stopped`].
pub(super) fn surface(
    net: &Net,
    kinds: &Kinds,
    patches: &[Patch],
    round: impl Fn(f64) -> f64,
    budget: &Budget,
) -> Result<Option<(BlockSurface, Vec<Point>)>, Stopped> {
    let mut chains = Chains::new(net, kinds, patches, round);
    let Some(mut loops) = chains.loops(budget)? else { return Ok(None) };
    loops.iter_mut().for_each(|own| own.plane = chains.planes.of(own.plane as usize));
    loops.sort_by_key(|own| own.plane);
    let mut surface = BlockSurface { vertices: chains.points, ..BlockSurface::default() };
    let (mut normals, mut planar) = (Vec::new(), Planar::default());
    for (number, facet) in loops.chunk_by_mut(|a, b| a.plane == b.plane).enumerate() {
        if number % IN_A_ROW == 0 {
            budget.cancel.check()?;
        }
        let normal = facet[0].normal;
        if !cut(facet, &surface.vertices, &mut planar, &mut surface.triangles) {
            return Ok(None);
        }
        normals.resize(surface.triangles.len(), normal);
    }
    Ok(Some((surface, normals)))
}

/// Adds triangles that fill the loops of a facet, seen along the axis that it is most across of; whether there are such.
fn cut(loops: &mut [Loop], points: &[Point], planar: &mut Planar, triangles: &mut Vec<[u32; 3]>) -> bool {
    let normal = loops[0].normal;
    let axis = (0..3).fold(0, |most, axis| if normal[axis].abs() > normal[most].abs() { axis } else { most });
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    let axes = if normal[axis] > 0.0 { [u, v] } else { [v, u] };
    let flat = |vertex: u32| axes.map(|axis| points[vertex as usize][axis]);
    if let [own] = loops
        && own.vertices.len() <= FEW_CORNERS
    {
        planar.loops.clear();
        planar.loops.push(std::mem::take(&mut own.vertices));
        return triangulate(planar, flat, triangles);
    }
    filled(loops, flat).is_some_and(|filled| {
        triangles.extend(filled);
        true
    })
}

impl<'a> Chains<'a> {
    fn new(net: &Net, kinds: &'a Kinds, patches: &'a [Patch], round: impl Fn(f64) -> f64) -> Self {
        let Kinds { vertices, faces, .. } = kinds;
        let (mut first, mut points, mut count) = (Vec::with_capacity(vertices.len()), Vec::new(), 0);
        for (vertex, at) in vertices.iter().zip(&net.places) {
            first.push([points.len() as u32, count]);
            if let Some(Vertex { kind, .. }) = vertex {
                let patch = &patches[*kind as usize];
                // Zeros have two signs: places that are the same have the same bits.
                let place = |from: &Point| -> Point { std::array::from_fn(|axis| round(at[axis] + from[axis]) + 0.0) };
                points.extend(patch.points.iter().map(place));
                count += patch.chains.len() as u32;
            }
        }
        // In one plane are chains of a vertex that have a normal in common, and those that are on one side of a face.
        let mut planes = Groups::new(count as usize);
        let mut sides: NameMap<u64, u32> = NameMap::default();
        for (vertex, [_, first]) in vertices.iter().zip(&first) {
            let Some(Vertex { kind, triangles, .. }) = vertex else { continue };
            let chains = &patches[*kind as usize].chains;
            for (own, (number, chain)) in (*first..).zip(chains.iter().enumerate()) {
                if let Some(same) = chains[..number].iter().position(|other| is_same(&other.normal, &chain.normal)) {
                    planes.join(*first as usize + same, own as usize);
                }
                if let Some(arc) = chain.arc {
                    let face = faces[triangles[arc] as usize];
                    let is_above = dot(&chain.normal, net.normal(face)) > 0.0;
                    planes.join(*sides.entry(u64::from(face) << 1 | u64::from(is_above)).or_insert(own) as usize, own as usize);
                }
            }
        }
        Self { kinds, patches, first, points, is_used: vec![false; count as usize], planes }
    }

    fn vertex(&self, vertex: u32) -> Option<&'a Vertex> {
        self.kinds.vertices[vertex as usize].as_ref()
    }

    fn chain(&self, (vertex, number): At) -> Option<&'a Chain> {
        self.patches[self.vertex(vertex)?.kind as usize].chains.get(number)
    }

    /// The number of a chain among all.
    fn number(&self, (vertex, number): At) -> usize {
        self.first[vertex as usize][1] as usize + number
    }

    /// The chain that goes on at the other end of an edge, and the way along this.
    fn after(&self, (vertex, number): At) -> Option<(At, Point)> {
        let (own, Vertex { kind, ends, .. }) = (self.chain((vertex, number))?, self.vertex(vertex)?);
        let (way, across) = own.exit?;
        let next = ends[way];
        let back = self.vertex(next)?.ends.iter().position(|&end| end == vertex)?;
        let goes_on = |chain: &Chain| {
            let is_along = |(way, other): (usize, Point)| way == back && is_same(&other, &across);
            is_same(&chain.normal, &own.normal) && chain.entry.is_some_and(is_along)
        };
        let number = self.patches[self.vertex(next)?.kind as usize].chains.iter().position(goes_on)?;
        Some(((next, number), self.kinds.fans[*kind as usize].ways[way]))
    }

    /// Joins all chains to loops; none where one does not go on, or goes back along an edge.
    ///
    /// # Errors
    /// [`Stopped`].
    fn loops(&mut self, budget: &Budget) -> Result<Option<Vec<Loop>>, Stopped> {
        let mut loops = Vec::new();
        for vertex in 0..self.first.len() as u32 {
            if (vertex as usize).is_multiple_of(IN_A_ROW) {
                budget.cancel.check()?;
            }
            for number in 0.. {
                let Some(chain) = self.chain((vertex, number)) else { break };
                if !self.is_used[self.number((vertex, number))] {
                    let Some(vertices) = self.from((vertex, number)) else { return Ok(None) };
                    loops.push(Loop { normal: chain.normal, plane: self.number((vertex, number)) as u32, vertices });
                }
            }
        }
        Ok(Some(loops))
    }

    /// The loop that begins with a chain.
    fn from(&mut self, start: At) -> Option<Vec<u32>> {
        let mut at = start;
        let mut vertices: Vec<u32> = Vec::new();
        // The way along which the next point has to come.
        let mut along: Option<Point> = None;
        let comes_along =
            |points: &[Point], along: &Point, from: u32, to: u32| dot(&subtract(&points[to as usize], &points[from as usize]), along) > 0.0;
        loop {
            let number = self.number(at);
            if std::mem::replace(&mut self.is_used[number], true) {
                return None;
            }
            self.planes.join(self.number(start), number);
            let chain = self.chain(at)?;
            for point in chain.points.iter().map(|point| self.first[at.0 as usize][0] + point) {
                if let (Some(along), Some(&last)) = (along.take(), vertices.last()) {
                    comes_along(&self.points, &along, last, point).then_some(())?;
                }
                vertices.push(point);
            }
            if chain.exit.is_none() {
                break;
            }
            let (next, way) = self.after(at)?;
            along = Some(way);
            at = next;
            if at == start {
                let (&first, &last) = (vertices.first()?, vertices.last()?);
                comes_along(&self.points, &way, last, first).then_some(())?;
                break;
            }
        }
        (vertices.len() >= 3).then_some(vertices)
    }
}

/// A vertex of a facet, by its number, and where it is in the plane.
struct Node(u32, Place);

impl HasPosition for Node {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        Point2::new(self.1[0], self.1[1])
    }
}

/// Triangles that fill loops; none where these cross, or have something to the wrong side.
fn filled(loops: &[Loop], flat: impl Fn(u32) -> Place) -> Option<Vec<[u32; 3]>> {
    let nodes: Vec<Node> = loops.iter().flat_map(|own| &own.vertices).map(|&vertex| Node(vertex, flat(vertex))).collect();
    let count = nodes.len();
    let mut sides: Vec<[usize; 2]> = Vec::with_capacity(count);
    for own in loops {
        let (base, number) = (sides.len(), own.vertices.len());
        sides.extend((0..number).map(|k| [base + k, base + (k + 1) % number]));
    }
    let after: Vec<usize> = sides.iter().map(|side| side[1]).collect();
    let mut crosses = false;
    let mesh: Mesh<Node> = Mesh::try_bulk_load_cdt(nodes, sides, |_| crosses = true).ok()?;
    (!crosses && mesh.num_vertices() == count).then_some(())?;
    let is_side = |[a, b]: [usize; 2]| after[a] == b;
    let is_border = |edge: &Edge<'_, Node>| {
        let ends = [edge.from(), edge.to()].map(|vertex| vertex.fix().index());
        is_side(ends) || is_side([ends[1], ends[0]])
    };
    let triangles = plane::inside(&mesh, is_border)?;
    // All sides are there, from their first end to their second, and none from the second to the first.
    let edges = || triangles.iter().flat_map(|triangle| (0..3).map(|k| [triangle[k] as usize, triangle[(k + 1) % 3] as usize]));
    let is_left = edges().filter(|&edge| is_side(edge)).count() == count && !edges().any(|[a, b]| is_side([b, a]));
    let name = |number: u32| mesh.vertex(plane::handle(number)).data().0;
    is_left.then(|| triangles.iter().map(|triangle| triangle.map(name)).collect())
}
