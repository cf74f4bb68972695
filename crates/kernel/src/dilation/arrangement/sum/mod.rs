//! Polygons with little near to each other but what has a vertex in common, such as the walls of a box: what is around them is found vertex by vertex.

mod ball;
mod clear;
mod corner;
mod net;

use super::bodies::Bodies;
use super::figure::Figure;
use super::nerve::Sets;
use super::plane::{self, Mesh};
use super::polytopes::{Polytope, Polytopes};
use super::triangulate::{Planar, triangulate};
use crate::attractor::cell::{Point, dot, subtract};
use crate::budget::{Budget, Stopped};
use crate::dilation::plan::Setting;
use crate::dilation::surface::{BlockSurface, NameMap};
use crate::groups::Groups;
use ball::Ball;
use corner::{Chain, PARALLEL, Patch};
use net::{Fan, Net};
use rayon::prelude::*;
use spade::{HasPosition, Point2, Triangulation};
use std::collections::HashMap;

/// Different vertices at most.
const MOST_KINDS: usize = 1_024;
/// How much narrower the band is than what may be, in units of rounding.
const ROUNDINGS: f64 = 3.0;

/// A vertex of the net: what is around it, and the order of its ways.
struct Vertex {
    kind: u32,
    ends: Vec<u32>,
    triangles: Vec<u32>,
}

/// The boundary around triangles, with coordinates that are rounded; none where it is not made of what is around vertices.
pub(super) fn surface(
    faces: &[[Point; 3]],
    figures: &[Figure],
    setting: &Setting,
    round: impl Fn(f64) -> f64 + Sync,
    budget: &Budget,
) -> Result<Option<BlockSurface>, Stopped> {
    let t0 = std::time::Instant::now();
    let Some(net) = Net::new(faces) else { return Ok(None) };
    let Some(frame) = frame(net.normals()) else { return Ok(None) };
    let spare = ROUNDINGS * setting.rounding + setting.slack;
    let Some(ball) = Ball::between(&frame, setting.least + spare, setting.outer - spare) else { return Ok(None) };
    eprintln!("ball {} facets {:?}", ball.facets.len(), t0.elapsed());
    let mut groups = Groups::new(faces.len());
    let mut kinds: HashMap<Vec<i32>, u32> = HashMap::new();
    let mut fans: Vec<Fan> = Vec::new();
    let mut vertices: Vec<Option<Vertex>> = Vec::with_capacity(net.places.len());
    let mut fan = Fan::default();
    for vertex in 0..net.vertices() {
        if net.fan(vertex, &mut fan, &mut groups).is_none() {
            return Ok(None);
        }
        if fan.is_flat() {
            vertices.push(None);
            continue;
        }
        let name = fan.name();
        let count = kinds.len() as u32;
        let kind = *kinds.entry(name).or_insert(count);
        vertices.push(Some(Vertex { kind, ends: fan.ends.clone(), triangles: fan.triangles.clone() }));
        if kind == count {
            if fans.len() == MOST_KINDS {
                return Ok(None);
            }
            fans.push(std::mem::take(&mut fan));
        }
    }
    eprintln!("{} kinds, {} vertices {:?}", fans.len(), vertices.iter().flatten().count(), t0.elapsed());
    let patches: Option<Vec<Patch>> = fans.par_iter().map(|fan| Patch::new(&fan.arcs, &fan.ways, &ball)).collect();
    let Some(patches) = patches else {
        eprintln!("no patch");
        for fan in &fans { if Patch::new(&fan.arcs, &fan.ways, &ball).is_none() { eprintln!("{fan:?}"); break; } }
        return Ok(None) };
    eprintln!("patches {:?}: {} chains {} points", t0.elapsed(), patches.iter().map(|p| p.chains.len()).sum::<usize>(), patches.iter().map(|p| p.points.len()).sum::<usize>());
    let Some(mut surface) = assembled(&net, &vertices, &fans, &patches, &mut groups, &round) else { eprintln!("not assembled"); return Ok(None) };
    eprintln!("assembled {:?}: {} triangles", t0.elapsed(), surface.0.triangles.len());
    let is_clear = clear::are_clear(&surface.0, &surface.1, figures, setting.least + setting.slack, budget)?;
    eprintln!("clear {is_clear} {:?}", t0.elapsed());
    if !is_clear {
        return Ok(None);
    }
    let mut narrow = setting.clone();
    narrow.outer = ball.outer() + setting.slack;
    let all = figures.iter().map(|_| Polytope::with(Default::default(), Box::default(), Box::default(), Box::default())).collect();
    let polytopes = Polytopes { all };
    let bodies = Bodies { setting: &narrow, figures, polytopes: &polytopes, solids: &[] };
    let sets = Sets::new(&bodies, budget)?;
    let is_settled = sets.is_some_and(|sets| sets.are_settled());
    eprintln!("nerve {is_settled} {:?}", t0.elapsed());
    if !is_settled {
        return Ok(None);
    }
    surface.0.drop_unused();
    Ok(Some(surface.0))
}

/// The axes that all normals are along.
fn frame(normals: &[Point]) -> Option<[Point; 3]> {
    let z = normals.first()?;
    let is_across = |a: &Point, b: &Point| dot(a, b).abs() < PARALLEL.sqrt();
    let x = normals.iter().find(|normal| is_across(normal, z)).copied().unwrap_or_else(|| super::polytopes::frame(z)[0]);
    let y = crate::attractor::cell::cross(z, &x);
    let all = [x, y, *z];
    normals.iter().all(|normal| all.iter().any(|axis| dot(axis, normal).abs() > 1.0 - PARALLEL)).then_some(all)
}

struct Loop {
    normal: Point,
    /// The face that it belongs to, and on which side of it.
    face: Option<(u32, bool)>,
    vertices: Vec<u32>,
}

fn assembled(
    net: &Net,
    vertices: &[Option<Vertex>],
    fans: &[Fan],
    patches: &[Patch],
    groups: &mut Groups,
    round: &impl Fn(f64) -> f64,
) -> Option<(BlockSurface, Vec<Point>)> {
    let mut first = Vec::with_capacity(vertices.len());
    let mut first_chain = Vec::with_capacity(vertices.len());
    let mut chains = 0;
    let mut surface = BlockSurface::default();
    for (vertex, at) in vertices.iter().zip(&net.places) {
        first.push(surface.vertices.len() as u32);
        first_chain.push(chains);
        if let Some(Vertex { kind, .. }) = vertex {
            let patch = &patches[*kind as usize];
            surface.vertices.extend(patch.points.iter().map(|point| -> Point { std::array::from_fn(|axis| round(at[axis] + point[axis]) + 0.0) }));
            chains += patch.chains.len();
        }
    }
    let mut is_used = vec![false; chains];
    let mut loops: Vec<Loop> = Vec::new();
    for (start, vertex) in (0..).zip(vertices) {
        let Some(Vertex { kind, .. }) = vertex else { continue };
        for number in 0..patches[*kind as usize].chains.len() {
            if is_used[first_chain[start as usize] + number] {
                continue;
            }
            let normal = patches[*kind as usize].chains[number].normal;
            let mut own = Loop { normal, face: None, vertices: Vec::new() };
            let (mut vertex, mut number) = (start, number);
            // The way on which the next point has to be farther.
            let mut ahead: Option<Point> = None;
            loop {
                if std::mem::replace(&mut is_used[first_chain[vertex as usize] + number], true) {
                    return None;
                }
                let Vertex { kind, ends, triangles } = vertices[vertex as usize].as_ref()?;
                let (fan, chain) = (&fans[*kind as usize], &patches[*kind as usize].chains[number]);
                if let Some(arc) = chain.arc {
                    let triangle = triangles[arc];
                    let face = (groups.of(triangle as usize), dot(&normal, net.normal(groups.of(triangle as usize))) > 0.0);
                    own.face = Some(face);
                }
                for &point in &chain.points {
                    let point = first[vertex as usize] + point;
                    if let (Some(ahead), Some(&last)) = (ahead.take(), own.vertices.last()) {
                        let [p, q] = [last, point].map(|vertex| &surface.vertices[vertex as usize]);
                        (dot(&subtract(q, p), &ahead) > 0.0).then_some(())?;
                    }
                    own.vertices.push(point);
                }
                let Some((way, across)) = chain.exit else { break };
                ahead = Some(fan.ways[way]);
                let next = ends[way];
                let Vertex { kind, ends, .. } = vertices[next as usize].as_ref()?;
                let back = ends.iter().position(|&end| end == vertex)?;
                let is_next = |chain: &Chain| {
                    is_same(&chain.normal, &normal)
                        && chain.entry.as_ref().is_some_and(|(way, other)| *way == back && is_same(other, &across))
                };
                number = patches[*kind as usize].chains.iter().position(is_next)?;
                vertex = next;
                if is_used[first_chain[vertex as usize] + number] {
                    // Back where it began.
                    let (Some(ahead), Some(&last), Some(&point)) = (ahead, own.vertices.last(), own.vertices.first()) else { return None };
                    let [p, q] = [last, point].map(|vertex| &surface.vertices[vertex as usize]);
                    (dot(&subtract(q, p), &ahead) > 0.0).then_some(())?;
                    break;
                }
            }
            (own.vertices.len() >= 3).then(|| loops.push(own))?;
        }
    }
    eprintln!("{} loops, {} in faces", loops.len(), loops.iter().filter(|own| own.face.is_some()).count());
    let mut normals = Vec::new();
    let mut planar = Planar::default();
    loops.sort_by_key(|own| own.face.map_or((u32::MAX, false), |face| face));
    let count = loops.len();
    let mut at = 0;
    while at < count {
        let mut end = at + 1;
        while end < count && loops[at].face.is_some() && loops[end].face == loops[at].face {
            end += 1;
        }
        let normal = loops[at].normal;
        let axis = (0..3).max_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs()))?;
        let axes = if normal[axis] > 0.0 { [(axis + 1) % 3, (axis + 2) % 3] } else { [(axis + 2) % 3, (axis + 1) % 3] };
        let flat = |vertex: u32| axes.map(|axis| surface.vertices[vertex as usize][axis]);
        let before = surface.triangles.len();
        if end - at == 1 && loops[at].vertices.len() <= 32 {
            planar.loops.clear();
            planar.loops.push(std::mem::take(&mut loops[at].vertices));
            triangulate(&mut planar, flat, &mut surface.triangles).then_some(())?;
        } else {
            let own = &loops[at..end];
            let triangles = filled(own, flat)?;
            surface.triangles.extend(triangles);
        }
        normals.extend(std::iter::repeat_n(normal, surface.triangles.len() - before));
        at = end;
    }
    Some((surface, normals))
}

fn is_same(a: &Point, b: &Point) -> bool {
    (0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-6)
}

struct Node(u32, [f64; 2]);

impl HasPosition for Node {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        Point2::new(self.1[0], self.1[1])
    }
}

fn filled(loops: &[Loop], flat: impl Fn(u32) -> [f64; 2]) -> Option<Vec<[u32; 3]>> {
    let nodes: Vec<Node> = loops.iter().flat_map(|own| &own.vertices).map(|&vertex| Node(vertex, flat(vertex))).collect();
    let count = nodes.len();
    let mut sides: Vec<[usize; 2]> = Vec::with_capacity(count);
    for own in loops {
        let (base, number) = (sides.len(), own.vertices.len());
        sides.extend((0..number).map(|k| [base + k, base + (k + 1) % number]));
    }
    let key = |a: usize, b: usize| (a.min(b) as u64) << 32 | a.max(b) as u64;
    let borders: NameMap<u64, ()> = sides.iter().map(|&[a, b]| (key(a, b), ())).collect();
    let mut has_conflict = false;
    let mesh: Mesh<Node> = Mesh::try_bulk_load_cdt(nodes, sides, |_| has_conflict = true).ok()?;
    (!has_conflict && mesh.num_vertices() == count).then_some(())?;
    let is_border = |edge: &plane::Edge<'_, Node>| {
        borders.contains_key(&key(edge.from().fix().index(), edge.to().fix().index()))
    };
    let triangles = plane::inside(&mesh, is_border)?;
    let name = |number: u32| mesh.vertex(plane::handle(number)).data().0;
    Some(triangles.into_iter().map(|triangle| triangle.map(name)).collect())
}
