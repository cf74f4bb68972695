//! Ways along which the distance from a surface grows.

use super::sheets::Sheets;
use super::skin::{Skin, upright};
use crate::attractor::cell::{Point, between, cross, distance_squared, dot, subtract, unit};
use crate::budget::{Budget, Stopped};
use crate::dilation::arrangement::between::{Body, lowest, middle};
use crate::dilation::arrangement::faces::{Face, Faces};
use crate::dilation::convex::Convex;
use crate::solid::half_edges::{HalfEdges, NONE};
use crate::solid::topology::Incidence;
use rayon::prelude::*;
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4, PI};

/// Directions along each side of each face of a cube: all directions are near to one of these.
const ALONG_SIDE: usize = 6;
/// Directions around a side of the border, from one side of the surface to the other.
const AROUND_SIDE: usize = 8;
/// Sides longer than this, as a share of the distance, are halved where nothing is shown of all of one.
const SHORT: f64 = 0.2;
/// What is left for rounding, as a share of the distance.
const NOISE: f64 = 1e-9;
/// Parts that are looked at one after the other.
const IN_A_ROW: usize = 64;

/// A surface, and the distances from it between which the ways are asked for.
pub(super) struct Ways<'a> {
    skin: &'a Skin,
    faces: &'a Faces,
    inner: f64,
    outer: f64,
    /// How much farther faces are left behind than rounding asks.
    more: f64,
}

/// A direction, and the cosine and sine of the angle by which others differ from it that it stands for.
struct Cone {
    axis: Point,
    cosine: f64,
    sine: f64,
}

impl<'a> Ways<'a> {
    pub(super) fn new(skin: &'a Skin, faces: &'a Faces, [inner, outer]: [f64; 2]) -> Self {
        Self { skin, faces, inner, outer, more: 0.0 }
    }

    /// Whether all faces that are as near to some place of the hull of some points as the outer distance are left behind along a direction: lower than a height.
    fn leaves(&self, points: &[Point], along: &Point, height: f64) -> bool {
        let count = points.len() as f64;
        let centre: Point = std::array::from_fn(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / count);
        let wide = points.iter().map(|point| distance_squared(point, &centre)).fold(0.0, f64::max).sqrt();
        let least = (self.outer + wide) * (1.0 + NOISE);
        let limit = height - NOISE * self.outer - self.more;
        self.faces.hold(points, self.outer, along, limit, |face| {
            face.highest(along) < limit || face.distance_squared(&centre) > least * least || is_below(face, along, limit, &centre, least)
        })
    }

    /// Whether all faces that are as near to some place of a triangle are left behind along a direction.
    fn leaves_all(&self, triangle: &[Point; 3], along: &Point) -> bool {
        let (centre, limit, most) = (middle(triangle), lowest(triangle, along) - NOISE * self.outer, self.outer * (1.0 + NOISE));
        self.faces.hold(triangle, most, along, limit, |face| {
            face.highest(along) < limit || face.is_apart(triangle, &centre, most) || face.too_near(triangle, most).is_none()
        })
    }

    /// Whether that is so of all places that are between both distances from the surface, each along some direction, and lower by so much more.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn lead_out(&self, more: f64, budget: &Budget) -> Result<bool, Stopped> {
        let ways = Self { more, ..*self };
        let Self { skin, faces, .. } = &ways;
        let (groups, cones) = (faces.groups(), cones());
        let at = |vertex: u32| skin.places[vertex as usize];
        let rays = |vertex: u32| -> Vec<Point> {
            let others = skin.around.at(vertex).iter().flat_map(|&triangle| skin.triangles[triangle as usize]);
            others.filter(|&other| other != vertex).map(|other| unit(&subtract(&at(other), &at(vertex)))).collect()
        };
        let mut borders: Vec<u32> = skin.borders.iter().flat_map(|(ends, _)| *ends).collect();
        borders.sort_unstable();
        borders.dedup();
        Ok(all(&groups, budget, |group| ways.lead_from(group) || group.iter().all(|&face| ways.lead_from(&[face])))?
            && all(&skin.borders, budget, |(ends, triangle)| ways.lead_beyond(&ends.map(at), &skin.normals[*triangle as usize]))?
            && all(&borders, budget, |&vertex| ways.lead_around(&at(vertex), &rays(vertex), &cones))?)
    }

    /// Whether it is so on both sides of some faces, for the directions away from the inside of these and around corners within.
    fn lead_from(&self, group: &[u32]) -> bool {
        let Skin { triangles, normals, around, .. } = self.skin;
        let first = normals[group[0] as usize];
        let aligned = |normal: &Point| if dot(normal, &first) < 0.0 { normal.map(|part| -part) } else { *normal };
        let sum = group.iter().map(|&face| aligned(&normals[face as usize]));
        let up = unit(&sum.fold([0.0; 3], |sum: Point, normal| std::array::from_fn(|axis| sum[axis] + normal[axis])));
        let corners = group.iter().flat_map(|&face| triangles[face as usize]);
        let normals = corners.clone().flat_map(|corner| around.at(corner)).map(|&face| &normals[face as usize]);
        let cosine = normals.map(|normal| dot(normal, &up).abs()).fold(1.0, f64::min) - NOISE;
        // Where faces lean more, directions between the normals of two may be in neither cone.
        if cosine < FRAC_1_SQRT_2 {
            return false;
        }
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let places: Vec<Point> = corners.map(|corner| self.skin.places[corner as usize]).collect();
        let cone = Cone { axis: up, cosine, sine };
        [cone.axis, up.map(|part| -part)].into_iter().all(|axis| self.lead_along(&places, &Cone { axis, ..cone }))
    }

    /// Whether it is so of the places that what is between some of a surface is closest to, in the directions of a cone: of all together, or of the parts of a side or a triangle.
    fn lead_along(&self, places: &[Point], cone: &Cone) -> bool {
        self.lead_at_once(places, cone) || self.halves(places).is_some_and(|halves| halves.iter().all(|half| self.lead_along(half, cone)))
    }

    /// The halves of a side, or of a triangle across its longest side; none where that is short, and of others.
    fn halves(&self, places: &[Point]) -> Option<[Vec<Point>; 2]> {
        let count = places.len();
        let long = |k: usize| distance_squared(&places[k], &places[(k + 1) % count]);
        let k = (0..count).max_by(|&p, &q| long(p).total_cmp(&long(q)))?;
        (count <= 3 && long(k) > (SHORT * self.outer).powi(2)).then(|| {
            let half = between(&places[k], &places[(k + 1) % count], 0.5);
            [k, (k + 1) % count].map(|replaced| {
                let mut part = places.to_vec();
                part[replaced] = half;
                part
            })
        })
    }

    fn lead_at_once(&self, places: &[Point], cone: &Cone) -> bool {
        let Cone { axis, cosine, sine } = cone;
        let height = lowest(places, axis) + cosine * self.inner;
        // The places are within this hull but for what the cone is wide.
        let beside = sine * self.outer;
        let [low, high] = [cosine * self.inner, self.outer];
        let mut points = Vec::with_capacity(2 * places.len());
        for place in places {
            points.extend([low, high].map(|by| -> Point { std::array::from_fn(|k| place[k] + by * axis[k]) }));
        }
        Ways { outer: self.outer + beside, ..*self }.leaves(&points, axis, height)
    }

    /// Likewise of a place from which the surface goes on along some rays, in all directions.
    fn lead_around(&self, place: &Point, rays: &[Point], cones: &[Cone]) -> bool {
        // No place out along such a direction has this one closest: going along a ray leads closer.
        let is_beside = |cone: &Cone| rays.iter().any(|ray| dot(ray, &cone.axis) > cone.sine + NOISE);
        cones.iter().all(|cone| is_beside(cone) || self.lead_along(&[*place], cone))
    }

    /// Likewise of the inside of a side of the border, given the normal of its triangle: in all directions across the side that do not lead over the triangle.
    fn lead_beyond(&self, ends: &[Point; 2], normal: &Point) -> bool {
        let out = unit(&cross(&subtract(&ends[1], &ends[0]), normal));
        let (sine, cosine) = (0.5 * PI / AROUND_SIDE as f64).sin_cos();
        (0..AROUND_SIDE).all(|step| {
            let (own, along) = (PI * (step as f64 + 0.5) / AROUND_SIDE as f64).sin_cos();
            let axis = std::array::from_fn(|k| along * normal[k] + own * out[k]);
            self.lead_along(ends, &Cone { axis, cosine, sine })
        })
    }

    /// Whether there are such directions that leave the sheets everywhere, too: those of corners, normals of triangles, or means of two of these at their common side.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn leave(&self, sheets: &Sheets, budget: &Budget) -> Result<bool, Stopped> {
        let mesh = HalfEdges::new(sheets.vertices.clone(), &sheets.triangles);
        let around = Incidence::new(sheets.vertices.len(), &sheets.triangles);
        let at = |corner: u32| sheets.vertices[corner as usize];
        let way = |corner: u32| &sheets.ways[corner as usize];
        let numbers: Vec<u32> = (0..sheets.triangles.len() as u32).collect();
        let corners = |triangle: u32| sheets.triangles[triangle as usize];
        let Some(normals) = numbers.iter().map(|&triangle| upright(&corners(triangle).map(at))).collect::<Option<Vec<Point>>>() else {
            return Ok(false);
        };
        let leads = |way: &Point, triangle: u32| dot(way, &normals[triangle as usize]) > NOISE;
        let leads_all = |vertex: u32| around.at(vertex).iter().all(|&other| leads(way(vertex), other));
        if !(0..sheets.vertices.len() as u32).all(leads_all) {
            return Ok(false);
        }
        all(&numbers, budget, |&triangle| {
            let (own, places, up) = (corners(triangle), corners(triangle).map(at), &normals[triangle as usize]);
            // Corners whose ways serve all of the triangle.
            let serves = own.map(|corner| self.leaves_all(&places, way(corner)));
            let is_side_left = |k: usize| {
                let twin = mesh.twin(3 * triangle + k as u32);
                let ends = [k, (k + 1) % 3];
                twin != NONE
                    && (ends.iter().any(|&end| serves[end]) || {
                        let mean = unit(&std::array::from_fn(|axis| up[axis] + normals[(twin / 3) as usize][axis]));
                        leads(&mean, triangle) && leads(&mean, twin / 3) && self.leaves_between(&ends.map(|end| places[end]), &mean)
                    })
            };
            let is_corner_left = |k: usize| serves[k] || self.leaves_between(&[places[k]], way(own[k]));
            (serves.contains(&true) || self.leaves_between(&places, up)) && (0..3).all(is_side_left) && (0..3).all(is_corner_left)
        })
    }

    /// Whether all faces that are as near to some place of a corner, a side or a triangle are left behind along a direction, which may be told of parts.
    fn leaves_between(&self, places: &[Point], along: &Point) -> bool {
        self.leaves(places, along, lowest(places, along))
            || self.halves(places).is_some_and(|halves| halves.iter().all(|half| self.leaves_between(half, along)))
    }
}

/// Whether what a face has in a ball is lower than a height along a direction: it is in a disc of its plane.
fn is_below(face: &Face, along: &Point, height: f64, centre: &Point, radius: f64) -> bool {
    let above = dot(&face.normal, &subtract(centre, &face.corners[0]));
    let square = radius * radius - above * above;
    let lean = dot(along, &face.normal);
    square < 0.0 || dot(along, centre) - above * lean + (square * (1.0 - lean * lean).max(0.0)).sqrt() < height
}

/// Whether something is so of all, side by side.
fn all<T: Sync>(list: &[T], budget: &Budget, is_so: impl Fn(&T) -> bool + Sync) -> Result<bool, Stopped> {
    let own = |one: &T| {
        budget.cancel.check()?;
        Ok(is_so(one))
    };
    let found = list.par_iter().with_min_len(IN_A_ROW).map(own).find_any(|own| !matches!(own, Ok(true)));
    found.unwrap_or(Ok(true))
}

/// Cones that hold all directions: those of the parts of a cube's faces, seen from its middle.
fn cones() -> Vec<Cone> {
    let tangent = |step: f64| (FRAC_PI_4 * (2.0 * step / ALONG_SIDE as f64 - 1.0)).tan();
    let mut cones = Vec::with_capacity(6 * ALONG_SIDE * ALONG_SIDE);
    for (axis, side) in (0..3).flat_map(|axis| [1.0, -1.0].map(|side| (axis, side))) {
        let at = |i: f64, j: f64| {
            let mut place = [0.0; 3];
            (place[axis], place[(axis + 1) % 3], place[(axis + 2) % 3]) = (side, tangent(i), tangent(j));
            unit(&place)
        };
        for (i, j) in (0..ALONG_SIDE).flat_map(|i| (0..ALONG_SIDE).map(move |j| (i as f64, j as f64))) {
            let axis = at(i + 0.5, j + 0.5);
            let corners = [at(i, j), at(i + 1.0, j), at(i, j + 1.0), at(i + 1.0, j + 1.0)];
            // The part is the hull of its corners in directions, of which one is farthest.
            let cosine = corners.iter().map(|corner| dot(corner, &axis)).fold(1.0, f64::min) - NOISE;
            cones.push(Cone { axis, cosine, sine: (1.0 - cosine * cosine).sqrt() });
        }
    }
    cones
}
