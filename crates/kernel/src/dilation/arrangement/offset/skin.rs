//! The surface that is dilated: triangles with common corners, of which little turns from one to the next.

use crate::attractor::cell::{Point, cross, dot, subtract, unit};
use crate::dilation::arrangement::faces::numbered;
use crate::solid::half_edges::{HalfEdges, NONE};
use crate::solid::topology::Incidence;

/// Sides that a way to a place crosses at most.
const MOST_STEPS: usize = 64;
/// Triangles at a corner at most.
const MOST_AROUND: usize = 1_000;
/// Twice the area of a triangle over the square of its longest side at least.
const SLIVER: f64 = 1e-6;
/// The cosine of the angle between triangles at a common side at most.
const FOLDED: f64 = -0.5;

/// A surface of triangles with its normals.
pub(super) struct Skin {
    pub(super) places: Vec<Point>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// The same, joined where neighbours have a side in opposite directions, and behind them one for each side of the border, with a corner that all of these have and no other: so that nearly all that is around a vertex is closed.
    pub(super) mesh: HalfEdges,
    /// Unit normals of the triangles, and of the corners: up on one side, which may be another for another corner.
    pub(super) normals: Vec<Point>,
    pub(super) ups: Vec<Point>,
    /// The least cosine of the angles between a corner's normal and those of its triangles.
    pub(super) cosines: Vec<f64>,
    pub(super) around: Incidence,
    /// The sides that one triangle alone has, as it has them, and which it is.
    pub(super) borders: Vec<([u32; 2], u32)>,
    /// Unit vectors that lead away from the surface at ends of these, and 0 elsewhere; and the cosine of the angle by which the border turns there.
    pub(super) outs: Vec<Point>,
    pub(super) turns: Vec<f64>,
}

impl Skin {
    /// The surface of some triangles; none where the normal of one turns from that of a corner by more than `turn` tells, its cosine, where a side has more than two of them, where there are slivers, or more triangles at a corner than is usual, or where most inner sides are flat, by no more than `flatness`:
    /// then there are few faces. Cost: some tenths of a microsecond for each.
    pub(super) fn new(faces: &[[Point; 3]], turn: f64, flatness: f64) -> Option<Self> {
        let (places, triangles) = numbered(faces);
        let mut normals = Vec::with_capacity(faces.len());
        let mut ups = vec![[0.0; 3]; places.len()];
        for (face, corners) in faces.iter().zip(&triangles) {
            let normal = upright(face)?;
            normals.push(normal);
            for (k, &corner) in corners.iter().enumerate() {
                let [a, b] = [1, 2].map(|step| subtract(&face[(k + step) % 3], &face[k]));
                let angle = dot(&cross(&a, &b), &normal).atan2(dot(&a, &b));
                let up = &mut ups[corner as usize];
                let share = if dot(up, &normal) < 0.0 { -angle } else { angle };
                *up = std::array::from_fn(|axis| up[axis] + share * normal[axis]);
            }
        }
        ups.iter_mut().for_each(|up| *up = unit(up));
        let mut cosines = vec![1.0_f64; places.len()];
        for (normal, corners) in normals.iter().zip(&triangles) {
            for &corner in corners {
                let least = &mut cosines[corner as usize];
                *least = least.min(dot(normal, &ups[corner as usize]).abs());
            }
        }
        if cosines.iter().any(|&cosine| cosine < turn) {
            return None;
        }
        let (mut borders, mut flat, mut inner) = (Vec::new(), 0, 0);
        let (mut outs, mut turns) = (vec![[0.0; 3]; places.len()], vec![1.0; places.len()]);
        for edge in edges(&triangles).chunk_by(|a, b| a.ends == b.ends) {
            match edge {
                [own] => {
                    let [a, b] = own.of(&triangles);
                    let out = own.inward(&places, &triangles, &normals).map(|part| -part);
                    for end in [a, b] {
                        let sum = &mut outs[end as usize];
                        turns[end as usize] = if *sum == [0.0; 3] { -1.0 } else { dot(sum, &out) };
                        *sum = std::array::from_fn(|axis| sum[axis] + out[axis]);
                    }
                    borders.push(([a, b], own.triangle));
                }
                [own, other] => {
                    inner += 1;
                    let [inward, other_inward] = [own, other].map(|edge| edge.inward(&places, &triangles, &normals));
                    // Folded back, normals are alike, too.
                    if dot(&inward, &other_inward) > FOLDED {
                        return None;
                    }
                    let corner = &places[triangles[other.triangle as usize][(other.side as usize + 2) % 3] as usize];
                    let beside = subtract(corner, &places[own.ends[0] as usize]);
                    flat += usize::from(dot(&normals[own.triangle as usize], &beside).abs() <= flatness);
                }
                _ => return None,
            }
        }
        let around = Incidence::new(places.len(), &triangles);
        if around.most() > MOST_AROUND || 2 * flat >= inner {
            return None;
        }
        outs.iter_mut().for_each(|out| *out = unit(out));
        let beyond = places.len() as u32;
        let more: Vec<[u32; 3]> = borders.iter().map(|&([a, b], _)| [b, a, beyond]).collect();
        let mesh = HalfEdges::new([places.as_slice(), &[[0.0; 3]]].concat(), &[triangles.as_slice(), &more].concat());
        Some(Self { places, triangles, mesh, normals, ups, cosines, around, borders, outs, turns })
    }

    /// The corner that none of its triangles has.
    pub(super) fn beyond(&self) -> u32 {
        self.places.len() as u32
    }

    /// Whether a vertex is on the border.
    pub(super) fn is_border(&self, vertex: u32) -> bool {
        self.outs[vertex as usize] != [0.0; 3]
    }

    /// A face that is about closest to a place, from another on: the way leads across sides that the place is beyond.
    pub(super) fn near(&self, from: u32, x: &Point) -> u32 {
        let mut face = from;
        for _ in 0..MOST_STEPS {
            let corners = self.triangles[face as usize].map(|corner| &self.places[corner as usize]);
            let beyond = |k: usize| {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                let out = cross(&subtract(b, a), &self.normals[face as usize]);
                dot(&out, &subtract(x, a)) / dot(&out, &out).sqrt()
            };
            let all: [f64; 3] = std::array::from_fn(beyond);
            let k = (1..3).fold(0, |best, k| if all[k] > all[best] { k } else { best });
            let twin = self.mesh.twin(3 * face + k as u32);
            if all[k] <= 0.0 || twin == NONE || (twin / 3) as usize >= self.triangles.len() {
                break;
            }
            face = twin / 3;
        }
        face
    }

    /// Where the corners of its triangles are.
    pub(super) fn faces(&self) -> impl Iterator<Item = [Point; 3]> {
        self.triangles.iter().map(|corners| corners.map(|corner| self.places[corner as usize]))
    }
}

/// The unit normal of a triangle; none of a sliver, of which rounding would tell.
pub(super) fn upright([a, b, c]: &[Point; 3]) -> Option<Point> {
    let [p, q, r] = [subtract(b, a), subtract(c, b), subtract(a, c)];
    let normal = cross(&p, &q);
    let longest = dot(&p, &p).max(dot(&q, &q)).max(dot(&r, &r));
    let length = dot(&normal, &normal).sqrt();
    (length > SLIVER * longest && length >= f64::MIN_POSITIVE.sqrt()).then(|| normal.map(|part| part / length))
}

/// A side of a triangle.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Edge {
    /// The lesser end first.
    pub(super) ends: [u32; 2],
    pub(super) triangle: u32,
    pub(super) side: u32,
}

impl Edge {
    /// Its ends as the triangle has them.
    pub(super) fn of(&self, triangles: &[[u32; 3]]) -> [u32; 2] {
        let corners = &triangles[self.triangle as usize];
        [0, 1].map(|step| corners[(self.side as usize + step) % 3])
    }

    /// The unit vector across the side that leads over its triangle.
    fn inward(&self, places: &[Point], triangles: &[[u32; 3]], normals: &[Point]) -> Point {
        let [a, b] = self.of(triangles).map(|end| &places[end as usize]);
        unit(&cross(&normals[self.triangle as usize], &subtract(b, a)))
    }
}

/// The sides of triangles, those with the same ends together.
pub(super) fn edges(triangles: &[[u32; 3]]) -> Vec<Edge> {
    let sides = triangles.iter().zip(0..).flat_map(|(corners, triangle)| {
        [0, 1, 2].map(|side| {
            let [a, b] = [corners[side], corners[(side + 1) % 3]];
            Edge { ends: [a.min(b), a.max(b)], triangle, side: side as u32 }
        })
    });
    let mut all: Vec<Edge> = sides.collect();
    all.sort_unstable();
    all
}
