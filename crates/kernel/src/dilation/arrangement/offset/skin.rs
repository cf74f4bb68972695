//! The surface that is dilated: triangles with common corners, of which little turns from one to the next, but at seams.

use super::coarse::lifted;
use super::seams::Seams;
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract, unit};
use crate::dilation::arrangement::faces::numbered;
use crate::groups::Groups;
use crate::measure::triangle::closest_on_triangle;
use crate::solid::half_edges::{HalfEdges, NONE};
use crate::solid::topology::Incidence;
use rayon::prelude::*;

/// Sides that a way to a place crosses at most.
const MOST_STEPS: usize = 64;
/// Triangles at a corner at most.
const MOST_AROUND: usize = 1_000;
/// Twice the area of a triangle over the square of its longest side at least.
const SLIVER: f64 = 1e-6;
/// The cosine of the angle by which triangles turn at a common side that is no seam at least, and of the angle between them at most.
const SMOOTH: f64 = 0.5;
const ACUTE: f64 = 0.9;
/// Sides that are shorter than this, as a share of the longest ones at both ends, may have one normal: noise and marching cubes turn the triangles there, and sheets would fold.
const SHORT: f64 = 0.2;
/// The cosine of the angle by which noise turns normals at most, but for one in so many.
const NOISE: f64 = 0.9;
const MANY: usize = 16;

/// The share of inner sides that may be flat, and around solids.
const FLAT: f64 = 0.5;
const SOLID_FLAT: f64 = 0.94;
/// Of so many inner sides one is a seam at most.
const MOST_SHARP: usize = 4;

/// The sides of a surface on which sheets are: where normals lead, and the other one. Around a solid there is a sheet outside alone.
pub(super) type Sides = &'static [f64];
pub(super) const BOTH_SIDES: Sides = &[1.0, -1.0];
pub(super) const OUTER: Sides = &[1.0];

/// A surface of triangles with its normals.
#[derive(Clone)]
pub(super) struct Skin {
    pub(super) sides: Sides,
    pub(super) places: Vec<Point>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// The same, joined where neighbours have a side in opposite directions, and behind them one for each side of the border, with a corner that all of these have and no other: so that nearly all that is around a vertex is closed.
    pub(super) mesh: HalfEdges,
    /// Unit normals of the triangles, and of the corners: up on one side, which may be another for another corner.
    pub(super) normals: Vec<Point>,
    pub(super) ups: Vec<Point>,
    /// What those of corners were at first, but one for all that short sides join.
    shared: Vec<Point>,
    /// By how much less than the radius the triangles at a corner, no others, are away from the places that are as far out along its normal, on its sides, at most.
    pub(super) lost: Vec<f64>,
    pub(super) around: Incidence,
    /// The sides that one triangle alone has, as it has them, and which it is; seams are none of these.
    pub(super) borders: Vec<([u32; 2], u32)>,
    /// Unit vectors that lead away from the surface at ends of these, and 0 elsewhere; and the cosine of the angle by which the border turns there.
    pub(super) outs: Vec<Point>,
    pub(super) turns: Vec<f64>,
    /// Where it was taken apart: each part has its own vertices there.
    pub(super) seams: Seams,
}

impl Skin {
    /// The surface of some triangles, outward ones if it has one side, with seams where it turns by so many times the angle by which a normal may be off that of a corner, so that as much of a radius is lost as may be; none where more is lost at a corner, where a side has more than two of them, where there are slivers, or more triangles at a corner than is usual, where parts meet at seams in other ways than along whole ones that are all hollow on a side, or all not, or where more inner sides are flat, by no more than `flatness`, or seams than may be:
    /// then there are few faces. Cost: some tenths of a microsecond for each.
    pub(super) fn new(faces: &[[Point; 3]], sides: Sides, radius: f64, most_lost: f64, seams: f64, flatness: f64) -> Option<Self> {
        let least = (seams * (1.0 - most_lost / radius).acos()).cos().max(SMOOTH);
        let (mut places, mut triangles) = numbered(faces);
        let normals: Vec<Point> = faces.iter().map(upright).collect::<Option<_>>()?;
        let (mut borders, mut smooth, mut sharp, mut inwards, mut flat) = (Vec::new(), Vec::new(), Vec::new(), Vec::new(), 0);
        for edge in edges(&triangles).chunk_by(|a, b| a.ends == b.ends) {
            match *edge {
                [own] => borders.push(own),
                [own, other] => {
                    let both = [own, other].map(|edge| edge.inward(&places, &triangles, &normals));
                    let cosine = dot(&both[0], &both[1]);
                    if cosine > ACUTE {
                        return None;
                    }
                    if -cosine < least {
                        sharp.push([own, other]);
                        inwards.push(both);
                        continue;
                    }
                    smooth.push([own, other]);
                    let corner = &places[triangles[other.triangle as usize][(other.side as usize + 2) % 3] as usize];
                    let beside = subtract(corner, &places[own.ends[0] as usize]);
                    flat += usize::from(dot(&normals[own.triangle as usize], &beside).abs() <= flatness);
                }
                _ => return None,
            }
        }
        let inner = smooth.len() + sharp.len();
        // Most sides of cylinders are flat, too.
        let most_flat = if sides == OUTER { SOLID_FLAT } else { FLAT };
        if flat as f64 >= most_flat * inner as f64 || MOST_SHARP * sharp.len() >= inner {
            return None;
        }
        let mut seams = Seams::part(&mut places, &mut triangles, &sharp, &inwards, &smooth);
        let mut ups = vec![[0.0; 3]; places.len()];
        for ((face, normal), corners) in faces.iter().zip(&normals).zip(&triangles) {
            for (k, &corner) in corners.iter().enumerate() {
                let [a, b] = [1, 2].map(|step| subtract(&face[(k + step) % 3], &face[k]));
                let angle = dot(&cross(&a, &b), normal).atan2(dot(&a, &b));
                let up = &mut ups[corner as usize];
                let share = if dot(up, normal) < 0.0 { -angle } else { angle };
                *up = std::array::from_fn(|axis| up[axis] + share * normal[axis]);
            }
        }
        ups.iter_mut().for_each(|up| *up = unit(up));
        let around = Incidence::new(places.len(), &triangles);
        if around.most() > MOST_AROUND {
            return None;
        }
        let near = |vertex: usize| around.at(vertex as u32).iter().map(|&triangle| &faces[triangle as usize]);
        // From the planes of triangles no more is lost; mostly these tell enough.
        let lost_with = |vertex: usize, up: &Point| {
            let cosines = around.at(vertex as u32).iter().map(|&triangle| dot(&normals[triangle as usize], up).abs());
            let of_planes = radius * (1.0 - cosines.fold(1.0, f64::min));
            if of_planes <= most_lost { of_planes } else { lost(&places[vertex], up, sides, radius, near(vertex)) }
        };
        let shared = shared(&places, &triangles, &ups);
        let choose = |vertex: usize| {
            let own = lost_with(vertex, &ups[vertex]);
            if shared[vertex] == ups[vertex] {
                return (ups[vertex], own);
            }
            let with = lost_with(vertex, &shared[vertex]);
            if with <= own { (shared[vertex], with) } else { (ups[vertex], own) }
        };
        let (ups, lost): (Vec<Point>, Vec<f64>) = (0..places.len()).into_par_iter().map(choose).unzip();
        if lost.iter().any(|&lost| lost > most_lost) || !seams.find_rings(&normals, &ups, sides) {
            return None;
        }
        let (mut outs, mut turns) = (vec![[0.0; 3]; places.len()], vec![1.0; places.len()]);
        // Where seams end at the border, that one tells.
        let mut is_at_border = vec![false; places.len()];
        borders.iter().flat_map(|edge| edge.of(&triangles)).for_each(|end| is_at_border[end as usize] = true);
        let all = borders.iter().map(|edge| (edge, true)).chain(sharp.iter().flatten().map(|edge| (edge, false)));
        for (edge, is_border) in all {
            let out = edge.inward(&places, &triangles, &normals).map(|part| -part);
            for end in edge.of(&triangles).into_iter().filter(|&end| is_border || !is_at_border[end as usize]) {
                let sum = &mut outs[end as usize];
                turns[end as usize] = if *sum == [0.0; 3] { -1.0 } else { dot(sum, &out) };
                *sum = std::array::from_fn(|axis| sum[axis] + out[axis]);
            }
        }
        // Where seams end, or more than two parts meet, nothing goes.
        for (vertex, _) in seams.rings.iter().filter(|ring| ring.is_border || ring.corners.len() != 2).flat_map(|ring| &ring.corners) {
            turns[*vertex as usize] = -1.0;
        }
        let borders: Vec<([u32; 2], u32)> = borders.iter().map(|edge| (edge.of(&triangles), edge.triangle)).collect();
        outs.iter_mut().for_each(|out| *out = unit(out));
        let beyond = places.len() as u32;
        let ends = borders.iter().map(|(ends, _)| ends).chain(seams.all.iter().flat_map(|seam| &seam.ends));
        let more: Vec<[u32; 3]> = ends.map(|&[a, b]| [b, a, beyond]).collect();
        let mesh = HalfEdges::new([places.as_slice(), &[[0.0; 3]]].concat(), &[triangles.as_slice(), &more].concat());
        Some(Self { sides, places, triangles, mesh, normals, ups, shared, lost, around, borders, outs, turns, seams })
    }

    /// Makes the normals of some corners those that short sides share, or, where they are these already, the means of those around them, where they turn little with that and no more than told is lost of a radius; whether any is another one now. So they take turns: means of means alone left pebble of the peers' comparison folded at r/40.
    ///
    /// Noise turns normals by little: where many would turn by much, sheets fold for other reasons, and nothing is changed.
    pub(super) fn even(&mut self, corners: &[u32], radius: f64, most_lost: f64) -> bool {
        let evened = |&corner: &u32| {
            let beside = self.around.at(corner).iter().map(|&triangle| self.triangles[triangle as usize]);
            let own = &self.ups[corner as usize];
            let sum = beside.clone().flatten().fold([0.0; 3], |sum: Point, other| add(&sum, &self.ups[other as usize], own));
            let faces: Vec<[Point; 3]> = beside.map(|corners| corners.map(|other| self.places[other as usize])).collect();
            [self.shared[corner as usize], unit(&sum)].into_iter().filter(|up| up != own).find_map(|up| {
                let lost = lost(&self.places[corner as usize], &up, self.sides, radius, faces.iter());
                (lost <= most_lost).then_some((corner, up, lost))
            })
        };
        let mut all: Vec<(u32, Point, f64)> = corners.par_iter().filter_map(evened).collect();
        let turns_little = |&(corner, up, _): &(u32, Point, f64)| dot(&up, &self.ups[corner as usize]) >= NOISE;
        let many = all.len() - all.len().div_ceil(MANY);
        all.retain(turns_little);
        if all.len() < many {
            return false;
        }
        for &(corner, up, lost) in &all {
            (self.ups[corner as usize], self.lost[corner as usize]) = (up, lost);
        }
        !all.is_empty()
    }

    /// The pseudo-normal of a vertex of a solid: what has it closest is outside where it is above (Baerentzen and Aanaes, "Signed distance computation using the angle weighted pseudonormal", IEEE TVCG 11(3), 2005).
    pub(super) fn outward(&self, vertex: u32) -> Point {
        let Skin { triangles, places, normals, around, seams, .. } = self;
        let own = [vertex];
        let mut sum = [0.0; 3];
        for &copy in seams.copies(vertex).unwrap_or(&own) {
            for &triangle in around.at(copy) {
                let (corners, normal) = (triangles[triangle as usize], &normals[triangle as usize]);
                let k = corners.iter().position(|&corner| corner == copy).unwrap_or_default();
                let [a, b] = [1, 2].map(|step| subtract(&places[corners[(k + step) % 3] as usize], &places[copy as usize]));
                sum = lifted(&sum, normal, dot(&cross(&a, &b), normal).atan2(dot(&a, &b)));
            }
        }
        unit(&sum)
    }

    /// The corner that none of its triangles has.
    pub(super) fn beyond(&self) -> u32 {
        self.places.len() as u32
    }

    /// Whether a vertex is on the border, or on a seam.
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

    /// The place of a face that is closest to another place.
    pub(super) fn closest(&self, face: u32, x: &Point) -> Point {
        let [a, b, c] = self.triangles[face as usize].map(|corner| &self.places[corner as usize]);
        closest_on_triangle(x, a, b, c)
    }

    /// Where the corners of its triangles are.
    pub(super) fn faces(&self) -> impl Iterator<Item = [Point; 3]> {
        self.triangles.iter().map(|corners| corners.map(|corner| self.places[corner as usize]))
    }
}

/// By how much less than a radius triangles are away from the places that are as far out from another one along a normal, on these sides.
fn lost<'a>(at: &Point, up: &Point, sides: Sides, radius: f64, near: impl Iterator<Item = &'a [Point; 3]> + Clone) -> f64 {
    let of = |side: f64| {
        let out = lifted(at, up, side);
        let squares = near.clone().map(|[a, b, c]| distance_squared(&out, &closest_on_triangle(&out, a, b, c)));
        radius - squares.fold(f64::INFINITY, f64::min).sqrt()
    };
    sides.iter().map(|side| of(side * radius)).fold(f64::NEG_INFINITY, f64::max)
}

/// Adds a normal to a sum, turned to the side of another one.
fn add(sum: &Point, up: &Point, own: &Point) -> Point {
    lifted(sum, up, if dot(up, own) < 0.0 { -1.0 } else { 1.0 })
}

/// The normals of corners, where those that short sides join have one.
fn shared(places: &[Point], triangles: &[[u32; 3]], ups: &[Point]) -> Vec<Point> {
    let sides = || triangles.iter().flat_map(|corners| (0..3).map(|k| [corners[k], corners[(k + 1) % 3]].map(|end| end as usize)));
    let square = |[a, b]: [usize; 2]| distance_squared(&places[a], &places[b]);
    let mut longest = vec![0.0_f64; places.len()];
    for ends in sides() {
        ends.into_iter().for_each(|end| longest[end] = longest[end].max(square(ends)));
    }
    let mut groups = Groups::new(places.len());
    for [a, b] in sides().filter(|&[a, b]| square([a, b]) <= SHORT * SHORT * longest[a].min(longest[b])) {
        groups.join(a, b);
    }
    let groups = groups.all();
    let (mut sums, mut is_one) = (ups.to_vec(), vec![true; places.len()]);
    for (vertex, group) in groups.iter().map(|&group| group as usize).enumerate().filter(|(vertex, group)| vertex != group) {
        sums[group] = add(&sums[group], &ups[vertex], &ups[group]);
        is_one[group] = false;
    }
    let shared = |(vertex, &group): (usize, &u32)| {
        let sum = &sums[group as usize];
        if is_one[group as usize] { ups[vertex] } else { unit(&add(&[0.0; 3], sum, &ups[vertex])) }
    };
    groups.iter().enumerate().map(shared).collect()
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
