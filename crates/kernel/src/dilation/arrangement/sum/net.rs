//! Triangles with what is around their vertices: arcs, which are triangles with a common vertex that lie beside each other in a plane.

use super::ball::{Ball, SAME, is_same};
use super::corner::{Arc, Patch};
use crate::attractor::cell::{Point, cross, dot, subtract, unit};
use crate::budget::{Budget, Stopped};
use crate::dilation::arrangement::faces::numbered;
use crate::dilation::surface::NameMap;
use crate::groups::Groups;
use crate::solid::topology::Incidence;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Triangles at a vertex at most.
const MOST_AROUND: usize = 64;
/// Kinds of vertices at most, and so many vertices are alike at least, but for a few: others are no cheaper than polytopes.
const MOST_KINDS: usize = 320;
const LEAST_ALIKE: usize = 4;
const FEW_KINDS: usize = 48;
/// Distances between that of the inner ball and that of faces that facets along edges are tried at.
const STEPS: u32 = 4;
/// Vertices that are looked at before a stop is noticed.
const IN_A_ROW: u32 = 1_024;
/// A direction from which planes are seen that no model is likely to have.
const VIEW: Point = [0.533_1, 0.341_7, 0.773_9];

/// Triangles by their vertices.
pub(super) struct Net {
    pub(super) places: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    /// The unit normals of triangles.
    normals: Vec<Point>,
    around: Incidence,
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
        let (places, triangles) = numbered(faces);
        let mut normals = Vec::with_capacity(faces.len());
        for [a, b, c] in faces {
            let normal = unit(&cross(&subtract(b, a), &subtract(c, a)));
            (dot(&normal, &normal) > 0.5).then(|| normals.push(normal))?;
        }
        let around = Incidence::new(places.len(), &triangles);
        Some(Self { places, triangles, normals, around })
    }

    /// The unit normal of a triangle.
    pub(super) fn normal(&self, triangle: u32) -> &Point {
        &self.normals[triangle as usize]
    }

    /// What a triangle is to one of its corners.
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

    /// What is around a vertex, whose triangles are joined to faces where they lie in one plane; none where that is too much.
    fn fan(&self, vertex: u32, fan: &mut Fan, faces: &mut Groups) -> Option<()> {
        let list = self.around.at(vertex);
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
                && is_same(&sector.normal, &theirs.normal)
            {
                after[k] = Some(other);
                has_before[other] = true;
                faces.join(sector.triangle as usize, theirs.triangle as usize);
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
            if let Some(same) = (0..k).find(|&same| is_same(&fan.arcs[same].normal, &fan.arcs[k].normal)) {
                faces.join(fan.triangles[same] as usize, fan.triangles[k] as usize);
            }
        }
        Some(())
    }
}

/// A vertex that is not flat.
#[derive(Debug)]
pub(super) struct Vertex {
    pub(super) kind: u32,
    /// See [`Fan`].
    pub(super) ends: Vec<u32>,
    pub(super) triangles: Vec<u32>,
}

/// The vertices of a net by what is around them.
pub(super) struct Kinds {
    /// What differs in where it is alone is of one kind.
    pub(super) fans: Vec<Fan>,
    /// None where all is flat.
    pub(super) vertices: Vec<Option<Vertex>>,
    /// The face of every triangle: those that hang together in a plane, or have a vertex in common there.
    pub(super) faces: Vec<u32>,
}

impl Kinds {
    /// Those of a net; none where few vertices are alike, or there is too much around one.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn of(net: &Net, budget: &Budget) -> Result<Option<Self>, Stopped> {
        let count = net.places.len();
        let most = MOST_KINDS.min(FEW_KINDS + count / LEAST_ALIKE);
        let (mut fans, mut vertices, mut faces) = (Vec::<Fan>::new(), Vec::with_capacity(count), Groups::new(net.triangles.len()));
        let mut known: NameMap<[u64; 2], Vec<u32>> = NameMap::default();
        let mut fan = Fan::default();
        for vertex in 0..count as u32 {
            if vertex % IN_A_ROW == 0 {
                budget.cancel.check()?;
            }
            if net.fan(vertex, &mut fan, &mut faces).is_none() {
                return Ok(None);
            }
            if fan.is_flat() {
                vertices.push(None);
                continue;
            }
            fan.sort();
            let alike = known.entry([fan.ways.len() as u64, fan.arcs.len() as u64]).or_default();
            let new = fans.len() as u32;
            let kind = alike.iter().copied().find(|&kind| fans[kind as usize].is_like(&fan)).unwrap_or(new);
            vertices.push(Some(Vertex { kind, ends: fan.ends.clone(), triangles: fan.triangles.clone() }));
            if kind == new {
                if fans.len() == most {
                    return Ok(None);
                }
                alike.push(kind);
                fans.push(std::mem::take(&mut fan));
            }
        }
        Ok(Some(Self { fans, vertices, faces: faces.all() }))
    }

    /// A ball between the first and the last distance whose facets go on smoothly along faces, at the middle one, and along edges: with the fewest corners of some that the facets along edges touch different distances for. These turn from others by a share of what they may at least.
    pub(super) fn ball(&self, [inner, middle, outer]: [f64; 3], share: f64) -> Option<Ball> {
        let up: Vec<Point> =
            self.fans.iter().flat_map(|fan| &fan.arcs).flat_map(|arc| [arc.normal, arc.normal.map(|part| -part)]).collect();
        let steps = if middle > inner { STEPS } else { 1 };
        let balls = (0..steps).filter_map(|step| {
            let low = inner + f64::from(step) / f64::from(STEPS) * (middle - inner);
            let widest = Ball::widest(low, outer)?;
            let between: Vec<Point> = self.fans.iter().flat_map(|fan| fan.between(widest)).collect();
            Ball::between([&up, &between], share * widest, [low, middle, outer])
        });
        balls.min_by_key(Ball::corners)
    }

    /// How many points there are in all.
    pub(super) fn points(&self, patches: &[Patch]) -> f64 {
        self.vertices.iter().flatten().map(|vertex| patches[vertex.kind as usize].points.len() as f64).sum()
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

    /// Puts its ways, and its arcs, in an order that is the same for all fans that differ in where they are alone.
    fn sort(&mut self) {
        let mut order: Vec<usize> = (0..self.ways.len()).collect();
        order.sort_by(|&a, &b| dot(&self.ways[a], &VIEW).total_cmp(&dot(&self.ways[b], &VIEW)));
        let mut place = vec![0; order.len()];
        order.iter().enumerate().for_each(|(to, &from)| place[from] = to);
        (self.ends, self.ways) = order.iter().map(|&way| (self.ends[way], self.ways[way])).unzip();
        for arc in &mut self.arcs {
            arc.ways = arc.ways.map(|ways| ways.map(|way| place[way]));
        }
        let mut all: Vec<(Arc, u32)> = self.arcs.iter().copied().zip(self.triangles.iter().copied()).collect();
        let along = |arc: &Arc| dot(&arc.normal, &VIEW);
        all.sort_by(|(a, _), (b, _)| a.ways.cmp(&b.ways).then(along(a).total_cmp(&along(b))));
        (self.arcs, self.triangles) = all.into_iter().unzip();
    }

    /// Whether two fans, sorted, differ in where they are alone.
    fn is_like(&self, other: &Self) -> bool {
        let are_alike = |(a, b): (&Arc, &Arc)| {
            a.ways == b.ways && is_same(&a.normal, &b.normal) && is_same(&a.from, &b.from) && (a.angle - b.angle).abs() < SAME
        };
        (self.ways.len(), self.arcs.len()) == (other.ways.len(), other.arcs.len())
            && self.ways.iter().zip(&other.ways).all(|(a, b)| is_same(a, b))
            && self.arcs.iter().zip(&other.arcs).all(are_alike)
    }

    /// Normals of facets that go on smoothly along its ways: where two arcs have more than half of all around a way between them, so many between theirs that none turns from the next by more than an angle.
    fn between(&self, widest: f64) -> Vec<Point> {
        let mut normals = Vec::new();
        for (number, way) in self.ways.iter().enumerate() {
            // The ways into arcs, across their side.
            let mut inward: Vec<Point> = Vec::new();
            for arc in &self.arcs {
                let [first, last] = arc.ways.map_or([false; 2], |ways| ways.map(|way| way == number));
                let left = cross(&arc.normal, way);
                inward.extend(first.then_some(left));
                inward.extend(last.then_some(left.map(|part| -part)));
            }
            let Some(origin) = inward.first().copied() else { continue };
            let ahead = cross(way, &origin);
            let mut angles: Vec<f64> = inward.iter().map(|way| dot(way, &ahead).atan2(dot(way, &origin)).rem_euclid(TAU)).collect();
            angles.sort_by(f64::total_cmp);
            for (k, &from) in angles.iter().enumerate() {
                let to = angles.get(k + 1).copied().unwrap_or(angles[0] + TAU);
                let turn = to - from - PI;
                if turn > SAME {
                    let steps = (turn / widest).ceil();
                    normals.extend((1..steps as u32).map(|step| {
                        let (sine, cosine) = (from + FRAC_PI_2 + turn * f64::from(step) / steps).sin_cos();
                        unit(&std::array::from_fn(|axis| cosine * origin[axis] + sine * ahead[axis]))
                    }));
                }
            }
        }
        normals
    }

    /// Whether all of it is flat: nothing but what is above and below it is to be seen.
    fn is_flat(&self) -> bool {
        matches!(&self.arcs[..], [Arc { ways: None, .. }])
    }
}
