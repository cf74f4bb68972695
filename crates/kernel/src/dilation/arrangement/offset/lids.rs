//! Lids over places where sheets are too near, look back, or touch.
//!
//! Near the ends of creases sheets fold back over themselves a little, and no cut takes that away. A lid is a closed surface whose top is half way out to the outer distance, and whose sides lead down into what is inside anyway: together with it the solid bounds none of what it covers.

use super::Around;
use super::rounds::SHAKEN;
use super::sheets::shaken;
use crate::attractor::cell::{Point, between, distance_squared, dot, subtract, unit};
use crate::budget::{Budget, Stopped};
use crate::dilation::arrangement::between::Memory;
use crate::dilation::arrangement::faces::Question;
use crate::dilation::arrangement::polytopes::frame;
use crate::dilation::surface::BlockSurface;
use crate::solid::TriMesh;
use crate::solid::half_edges::NONE;
use crate::split_mix::{Random, mix};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Corners of a lid's top.
const CORNERS: u32 = 8;
/// How far out its top is, how far in its sides end, and how far in it all hangs together and ends: beyond the radius in units of half the band.
const TOP: f64 = 0.5;
const SIDES: f64 = -1.5;
const MIDDLE: f64 = -1.5;
const BOTTOM: f64 = -3.5;
/// By how much its top is wider than what it covers, and its sides than its top, in the same units.
const MARGIN: f64 = 1.0;
const SLOPE: f64 = 2.5;
/// The share of half the band by which a top may be nearer in its middle, or farther, and how far from each other what it covers is, as a share of how wide it may be then.
const SAG: f64 = 0.4;
const REACH: f64 = 0.4;
/// Places that lids are put over, about, at most: larger parts of triangles are as good as not covered.
const MOST_PLACES: usize = 1 << 18;
/// Steps to a distance.
const STEPS: usize = 4;

/// Its corners, and its triangles.
type Lid = (Vec<Point>, Vec<[u32; 3]>);

impl Around<'_> {
    /// A surface with lids over some of its triangles, but where what a lid bounds is not shown to be as near as the outer distance. With another seed they are shaken in other ways.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn with_lids(
        &self,
        surface: &BlockSurface,
        triangles: &[u32],
        seed: u64,
        round: &(impl Fn(f64) -> f64 + Sync),
        budget: &Budget,
    ) -> Result<TriMesh, Stopped> {
        // A chord of length c is c^2 / 8 r off a circle.
        let reach = REACH * (8.0 * self.radius() * SAG * self.half()).sqrt();
        let mut places = Vec::new();
        for &triangle in triangles {
            budget.cancel.check()?;
            parts(surface.corners(triangle), 0.5 * reach, &mut places);
        }
        let lid = |places: &Vec<Point>| {
            budget.cancel.check()?;
            Ok(self.lid(places, seed, round))
        };
        let lids: Vec<Option<Lid>> = gathered(places, reach).par_iter().map(lid).collect::<Result<_, Stopped>>()?;
        let mut mesh =
            TriMesh { vertices: surface.vertices.iter().copied().map(DVec3::from_array).collect(), triangles: surface.triangles.clone() };
        for (points, triangles) in lids.into_iter().flatten() {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(points.into_iter().map(DVec3::from_array));
            mesh.triangles.extend(triangles.into_iter().map(|corners| corners.map(|corner| corner + first)));
        }
        Ok(mesh)
    }

    /// A lid over some places; none where what it bounds is not shown to be near enough: what is between its triangles and a place inside is.
    fn lid(&self, places: &[Point], seed: u64, round: &impl Fn(f64) -> f64) -> Option<Lid> {
        let half = self.half();
        let mean = std::array::from_fn(|axis| places.iter().map(|place| place[axis]).sum::<f64>() / places.len() as f64);
        let top = self.at(&mean, TOP)?;
        let up = unit(&self.closest(&top)?.1);
        let [u, v, _] = frame(&up);
        let aside = |place: &Point| {
            let way = subtract(place, &top);
            dot(&way, &u).hypot(dot(&way, &v))
        };
        let wide = places.iter().map(aside).fold(0.0, f64::max) + MARGIN * half;
        let below = |by: f64| -> Point { std::array::from_fn(|axis| top[axis] + by * half * up[axis]) };
        let beside = |from: Point, by: f64, corner: u32| -> Point {
            let (sine, cosine) = (TAU * f64::from(corner) / f64::from(CORNERS)).sin_cos();
            std::array::from_fn(|axis| from[axis] + by * (cosine * u[axis] + sine * v[axis]))
        };
        let mut corners = vec![top];
        for corner in 0..CORNERS {
            corners.push(self.at(&beside(top, wide, corner), TOP)?);
        }
        for corner in 0..CORNERS {
            corners.push(self.at(&beside(below(SIDES - TOP), wide + SLOPE * half, corner), SIDES)?);
        }
        corners.push(below(BOTTOM - TOP));
        let mut random = Random(corners.iter().flatten().fold(seed, |seed, x| mix(seed ^ x.to_bits())));
        corners.iter_mut().for_each(|corner| *corner = shaken(corner, SHAKEN * half, &mut random).map(round));
        let triangles: Vec<[u32; 3]> = (0..CORNERS)
            .flat_map(|corner| {
                let next = (corner + 1) % CORNERS;
                let ([a, b], [c, d]) = ([1 + corner, 1 + next], [1 + CORNERS + corner, 1 + CORNERS + next]);
                [[0, a, b], [a, c, b], [c, d, b], [c, 1 + 2 * CORNERS, d]]
            })
            .collect();
        let inside = below(MIDDLE - TOP);
        let mut memory = Memory::default();
        let mut is_near = |corners: [Point; 3]| {
            let question = Question {
                triangle: corners,
                feet: Some([inside; 3]),
                owners: [NONE; 3],
                inner: f64::NEG_INFINITY,
                outer: self.outer - self.moved,
            };
            let offer = |x: &Point| self.closest(&between(x, &inside, 0.5)).map(|own| own.0);
            self.faces.fault_with(offer, &question, &mut memory).is_none()
        };
        let is_near = triangles.iter().all(|triangle| is_near(triangle.map(|corner| corners[corner as usize])));
        is_near.then_some((corners, triangles))
    }

    /// The place as far out as told that is about closest to another one.
    fn at(&self, x: &Point, out: f64) -> Option<Point> {
        let distance = self.radius() + out * self.half();
        let mut x = *x;
        for _ in 0..STEPS {
            let (_, way) = self.closest(&x)?;
            let share = distance / dot(&way, &way).sqrt() - 1.0;
            x = std::array::from_fn(|axis| x[axis] + share * way[axis]);
        }
        Some(x)
    }
}

/// Adds the corners of the parts of a triangle whose sides are no longer than told, as long as there are not too many.
fn parts(triangle: [Point; 3], most: f64, places: &mut Vec<Point>) {
    let mut open = vec![triangle];
    while let Some(own) = open.pop() {
        let long = |k: usize| distance_squared(&own[k], &own[(k + 1) % 3]);
        let k = (1..3).fold(0, |best, k| if long(k) > long(best) { k } else { best });
        if long(k) <= most * most || places.len() > MOST_PLACES {
            places.extend(own);
            continue;
        }
        let (mut one, mut other) = (own, own);
        one[k] = between(&own[k], &own[(k + 1) % 3], 0.5);
        other[(k + 1) % 3] = one[k];
        open.extend([one, other]);
    }
}

/// Places by the first one that they are within a distance of.
fn gathered(places: Vec<Point>, reach: f64) -> Vec<Vec<Point>> {
    let cell = |place: &Point| place.map(|x| (x / reach).floor() as i64);
    let mut cells: BTreeMap<[i64; 3], Vec<Point>> = BTreeMap::new();
    for place in places {
        cells.entry(cell(&place)).or_default().push(place);
    }
    let names: Vec<[i64; 3]> = cells.keys().copied().collect();
    let mut all = Vec::new();
    for name in names {
        while let Some(first) = cells.get(&name).and_then(|own| own.first().copied()) {
            let mut near = vec![first];
            cells.entry(name).and_modify(|own| {
                own.swap_remove(0);
            });
            for step in 0..27 {
                let beside = std::array::from_fn(|axis| name[axis] + [-1, 0, 1][step / [1, 3, 9][axis] % 3]);
                if let Some(own) = cells.get_mut(&beside) {
                    near.extend(own.extract_if(.., |place| distance_squared(place, &first) <= reach * reach));
                }
            }
            all.push(near);
        }
    }
    all
}
