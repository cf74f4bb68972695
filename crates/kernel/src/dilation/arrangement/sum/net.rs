//! Triangles with what is around their vertices: arcs, which are triangles with a common vertex that lie beside each other in a plane.

use super::corner::{Arc, PARALLEL};
use crate::attractor::cell::{Point, cross, dot, subtract, unit};
use crate::dilation::surface::NameMap;
use crate::groups::Groups;

/// Triangles at a vertex at most.
const MOST_AROUND: usize = 64;
/// A direction from which planes are seen that no model is likely to have.
const VIEW: Point = [0.533_1, 0.341_7, 0.773_9];

/// Triangles by their vertices.
pub(super) struct Net {
    pub(super) places: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    /// The unit normals of triangles.
    normals: Vec<Point>,
    /// Where the triangles of every vertex begin in the list after it.
    first: Vec<u32>,
    around: Vec<u32>,
}

/// What is around a vertex.
#[derive(Debug, Default)]
pub(super) struct Fan {
    pub(super) arcs: Vec<Arc>,
    /// A triangle of every arc.
    pub(super) triangles: Vec<u32>,
    /// The vertices to which sides of arcs lead, and unit vectors along these.
    pub(super) ends: Vec<u32>,
    pub(super) ways: Vec<Point>,
}

/// A triangle seen from one of its corners: the other two, the ways to them, and its normal, about which it goes from the first to the second.
struct Sector {
    triangle: u32,
    ends: [u32; 2],
    ways: [Point; 2],
    normal: Point,
}

impl Net {
    /// The net of some triangles; none where one has no area.
    pub(super) fn new(faces: &[[Point; 3]]) -> Option<Self> {
        let mut numbers: NameMap<[u64; 3], u32> = NameMap::default();
        numbers.reserve(faces.len());
        let mut places = Vec::new();
        let mut number = |at: &Point| {
            *numbers.entry(at.map(f64::to_bits)).or_insert_with(|| {
                places.push(*at);
                places.len() as u32 - 1
            })
        };
        let triangles: Vec<[u32; 3]> = faces.iter().map(|face| face.each_ref().map(&mut number)).collect();
        let mut normals = Vec::with_capacity(faces.len());
        for [a, b, c] in faces {
            let normal = unit(&cross(&subtract(b, a), &subtract(c, a)));
            (dot(&normal, &normal) > 0.5).then(|| normals.push(normal))?;
        }
        let mut first = vec![0; places.len() + 1];
        triangles.iter().flatten().for_each(|&corner| first[corner as usize + 1] += 1);
        for place in 0..places.len() {
            first[place + 1] += first[place];
        }
        let mut around = vec![0; 3 * triangles.len()];
        let mut next = first.clone();
        for (triangle, corners) in (0..).zip(&triangles) {
            for &corner in corners {
                around[next[corner as usize] as usize] = triangle;
                next[corner as usize] += 1;
            }
        }
        Some(Self { places, triangles, normals, first, around })
    }

    pub(super) fn vertices(&self) -> u32 {
        self.places.len() as u32
    }

    pub(super) fn normal(&self, triangle: u32) -> &Point {
        &self.normals[triangle as usize]
    }

    pub(super) fn normals(&self) -> &[Point] {
        &self.normals
    }

    fn sector(&self, vertex: u32, triangle: u32) -> Sector {
        let corners = self.triangles[triangle as usize];
        let k = corners.iter().position(|&corner| corner == vertex).unwrap_or_default();
        let (mut ends, mut normal) = ([corners[(k + 1) % 3], corners[(k + 2) % 3]], self.normals[triangle as usize]);
        // All that is in a plane has one normal.
        if dot(&normal, &VIEW) < 0.0 {
            ends.swap(0, 1);
            normal = normal.map(|part| -part);
        }
        let from = &self.places[vertex as usize];
        let ways = ends.map(|end| unit(&subtract(&self.places[end as usize], from)));
        Sector { triangle, ends, ways, normal }
    }

    /// What is around a vertex, with triangles that are joined in arcs as groups; none where that is too much.
    pub(super) fn fan(&self, vertex: u32, fan: &mut Fan, groups: &mut Groups) -> Option<()> {
        let list = &self.around[self.first[vertex as usize] as usize..self.first[vertex as usize + 1] as usize];
        (list.len() <= MOST_AROUND).then_some(())?;
        let sectors: Vec<Sector> = list.iter().map(|&triangle| self.sector(vertex, triangle)).collect();
        fan.arcs.clear();
        fan.triangles.clear();
        fan.ends.clear();
        fan.ways.clear();
        // The sector that goes on after each, and whether one goes on before it.
        let mut after: Vec<Option<usize>> = vec![None; sectors.len()];
        let mut has_before = vec![false; sectors.len()];
        for (k, sector) in sectors.iter().enumerate() {
            let mut beside = sectors.iter().enumerate().filter(|(other, theirs)| *other != k && theirs.ends.contains(&sector.ends[1]));
            if let (Some((other, theirs)), None) = (beside.next(), beside.next())
                && theirs.ends[0] == sector.ends[1]
                && dot(&sector.normal, &theirs.normal) > 1.0 - PARALLEL
            {
                after[k] = Some(other);
                has_before[other] = true;
                groups.join(sector.triangle as usize, theirs.triangle as usize);
            }
        }
        let mut is_used = vec![false; sectors.len()];
        // Those that begin an arc come first: what is left goes all around.
        let starts = (0..sectors.len()).filter(|&k| !has_before[k]).chain((0..sectors.len()).filter(|&k| has_before[k]));
        for start in starts {
            if is_used[start] {
                continue;
            }
            let (mut angle, mut at) = (0.0, start);
            let end = loop {
                is_used[at] = true;
                let [from, to] = &sectors[at].ways;
                angle += dot(&sectors[at].normal, &cross(from, to)).atan2(dot(from, to));
                match after[at] {
                    Some(next) if next == start => break None,
                    Some(next) => at = next,
                    None => break Some(at),
                }
            };
            let Sector { triangle, ends: [first, _], ways: [from, _], normal } = sectors[start];
            let ways = end.map(|end| [(first, from), (sectors[end].ends[1], sectors[end].ways[1])].map(|(end, way)| fan.way(end, way)));
            // The same for all triangulations of what goes all around.
            let from = if ways.is_some() { from } else { unit(&cross(&normal, &[VIEW[1], VIEW[2], VIEW[0]])) };
            fan.arcs.push(Arc { normal, from, angle, ways });
            fan.triangles.push(triangle);
        }
        // What lies in one plane is one face, at all vertices.
        for k in 1..fan.arcs.len() {
            if let Some(same) = (0..k).find(|&same| dot(&fan.arcs[same].normal, &fan.arcs[k].normal) > 1.0 - PARALLEL) {
                groups.join(fan.triangles[same] as usize, fan.triangles[k] as usize);
            }
        }
        Some(())
    }
}

impl Fan {
    /// The number of the way to a vertex.
    fn way(&mut self, end: u32, way: Point) -> usize {
        self.ends.iter().position(|own| *own == end).unwrap_or_else(|| {
            self.ends.push(end);
            self.ways.push(way);
            self.ends.len() - 1
        })
    }

    /// Puts its ways, and its arcs, in an order that is the same for all fans that differ in where they are, and gives them a name.
    pub(super) fn name(&mut self) -> Vec<i32> {
        // Halfway between numbers that models are likely to have.
        let rounded = |x: f64| (x * NAMED + 0.37).floor() as i32;
        let of = |way: &Point| way.map(rounded);
        let mut order: Vec<usize> = (0..self.ways.len()).collect();
        order.sort_by_key(|&way| of(&self.ways[way]));
        let mut place = vec![0; order.len()];
        order.iter().enumerate().for_each(|(to, &from)| place[from] = to);
        (self.ends, self.ways) = order.iter().map(|&way| (self.ends[way], self.ways[way])).unzip();
        for arc in &mut self.arcs {
            arc.ways = arc.ways.map(|ways| ways.map(|way| place[way]));
        }
        let key = |arc: &Arc| (arc.normal.map(rounded), of(&arc.from), rounded(arc.angle), arc.ways);
        let mut all: Vec<(Arc, u32)> = self.arcs.iter().copied().zip(self.triangles.iter().copied()).collect();
        all.sort_by_key(|(arc, _)| key(arc));
        (self.arcs, self.triangles) = all.into_iter().unzip();
        let ways = self.ways.iter().flat_map(of);
        let arcs = self.arcs.iter().flat_map(|arc| {
            let (normal, from, angle, ways) = key(arc);
            let ways = ways.map_or([-1; 2], |ways| ways.map(|way| way as i32));
            normal.into_iter().chain(from).chain([angle]).chain(ways)
        });
        ways.chain([i32::MAX]).chain(arcs).collect()
    }

    /// Whether all of it is flat: nothing but what is above and below it is to be seen.
    pub(super) fn is_flat(&self) -> bool {
        matches!(&self.arcs[..], [Arc { ways: None, .. }])
    }
}

/// Steps of a unit that names tell apart.
const NAMED: f64 = 1e6;
