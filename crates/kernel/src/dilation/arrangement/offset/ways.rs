//! Ways along which the distance from a surface grows.

use super::sheets::Sheets;
use super::skin::Skin;
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract, unit};
use crate::budget::{Budget, Stopped};
use crate::dilation::arrangement::between::{Body, lowest, middle};
use crate::dilation::arrangement::faces::Faces;
use crate::dilation::convex::Convex;
use crate::solid::topology::Incidence;
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_4, PI};

/// Directions along each side of each face of a cube: all directions are near to one of these.
const ALONG_SIDE: usize = 4;
/// Directions around a side of the border, from one side of the surface to the other.
const AROUND_SIDE: usize = 8;
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
}

/// A direction, and the cosine and sine of the angle by which others differ from it that it stands for.
struct Cone {
    axis: Point,
    cosine: f64,
    sine: f64,
}

impl<'a> Ways<'a> {
    pub(super) fn new(skin: &'a Skin, faces: &'a Faces, [inner, outer]: [f64; 2]) -> Self {
        Self { skin, faces, inner, outer }
    }

    /// Whether all faces that are as near to some place of the hull of some points as the outer distance are left behind along a direction: lower than a height.
    fn leaves(&self, points: &[Point], along: &Point, height: f64) -> bool {
        let count = points.len() as f64;
        let centre: Point = std::array::from_fn(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / count);
        let wide = points.iter().map(|point| distance_squared(point, &centre)).fold(0.0, f64::max).sqrt();
        let least = (self.outer + wide) * (1.0 + NOISE);
        let limit = height - NOISE * self.outer;
        self.faces.within(points, self.outer, |item| {
            let face = &self.faces.all[item as usize];
            face.highest(along) < limit || face.distance_squared(&centre) > least * least
        })
    }

    /// Whether all faces that are as near to some place of a triangle are left behind along a direction.
    fn leaves_all(&self, triangle: &[Point; 3], along: &Point) -> bool {
        let (centre, limit) = (middle(triangle), lowest(triangle, along) - NOISE * self.outer);
        self.faces.within(triangle, self.outer, |item| {
            let face = &self.faces.all[item as usize];
            face.highest(along) < limit || face.is_apart(triangle, &centre, self.outer) || face.too_near(triangle, self.outer).is_none()
        })
    }

    /// Whether that is so of all places that are between both distances from the surface, each along some direction.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn lead_out(&self, budget: &Budget) -> Result<bool, Stopped> {
        let Self { skin, faces, .. } = self;
        let (groups, cones) = (faces.groups(), cones());
        let at = |vertex: u32| skin.places[vertex as usize];
        let rays = |vertex: u32| -> Vec<Point> {
            let others = skin.around.at(vertex).iter().flat_map(|&triangle| skin.triangles[triangle as usize]);
            others.filter(|&other| other != vertex).map(|other| unit(&subtract(&at(other), &at(vertex)))).collect()
        };
        let borders: Vec<u32> = (0..skin.beyond()).filter(|&vertex| skin.is_border(vertex)).collect();
        Ok(all(&groups, budget, |group| self.lead_from(group) || group.iter().all(|&face| self.lead_from(&[face])))?
            && all(&skin.borders, budget, |(ends, triangle)| self.lead_beyond(&ends.map(at), &skin.normals[*triangle as usize]))?
            && all(&borders, budget, |&vertex| self.lead_around(&at(vertex), &rays(vertex), &cones))?)
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
        let cosine = normals.map(|normal| dot(normal, &up).abs()).fold(1.0, f64::min);
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let places: Vec<Point> = corners.map(|corner| self.skin.places[corner as usize]).collect();
        let cone = Cone { axis: up, cosine, sine };
        [cone.axis, up.map(|part| -part)].into_iter().all(|axis| self.lead_along(&places, &Cone { axis, ..cone }))
    }

    /// Whether it is so of the places that some of a surface is closest to, in the directions of a cone.
    fn lead_along(&self, places: &[Point], cone: &Cone) -> bool {
        let Cone { axis, cosine, sine } = cone;
        let height = places.iter().map(|place| dot(place, axis)).fold(f64::INFINITY, f64::min) + cosine * self.inner;
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

    /// Whether there are such directions that leave the sheets everywhere, too.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn leave(&self, sheets: &Sheets, budget: &Budget) -> Result<bool, Stopped> {
        let normal = |[a, b, c]: [Point; 3]| unit(&cross(&subtract(&b, &a), &subtract(&c, &a)));
        let corners = |triangle: u32| sheets.triangles[triangle as usize].map(|corner| sheets.vertices[corner as usize]);
        let around = Incidence::new(sheets.vertices.len(), &sheets.triangles);
        let numbers: Vec<u32> = (0..sheets.triangles.len() as u32).collect();
        let normals: Vec<Point> = numbers.iter().map(|&triangle| normal(corners(triangle))).collect();
        all(&numbers, budget, |&triangle| {
            let places = corners(triangle);
            sheets.triangles[triangle as usize].iter().all(|&corner| {
                let way = &sheets.ways[corner as usize];
                let leads = |&other: &u32| dot(way, &normals[other as usize]) > NOISE;
                around.at(corner).iter().all(leads) && self.leaves_all(&places, way)
            })
        })
    }
}

/// Whether something is so of all, side by side.
fn all<T: Sync>(list: &[T], budget: &Budget, is_so: impl Fn(&T) -> bool + Sync) -> Result<bool, Stopped> {
    let row = |row: &[T]| {
        budget.cancel.check()?;
        Ok(row.iter().all(&is_so))
    };
    let found = list.par_chunks(IN_A_ROW).map(row).find_any(|row| !matches!(row, Ok(true)));
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
