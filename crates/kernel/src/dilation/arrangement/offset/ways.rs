//! Ways along which the distance from a surface grows.

use super::coarse::lifted;
use super::seams::Seam;
use super::skin::{OUTER, Skin, upright};
use crate::attractor::cell::{Point, between, cross, distance_squared, dot, subtract, unit};
use crate::budget::{Budget, Stopped};
use crate::dilation::arrangement::between::{Body, lowest, middle};
use crate::dilation::arrangement::faces::{Face, Faces};
use crate::dilation::arrangement::polytopes::frame;
use crate::dilation::convex::Convex;
use crate::dilation::setting::Setting;
use crate::dilation::surface::BlockSurface;
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
/// Parts smaller than this are halved no more where a direction is sought.
const FINE: f64 = 0.02;
/// Steps towards a direction.
const STEPS: usize = 24;
/// What is left for rounding, as a share of the distance.
const NOISE: f64 = 1e-9;
/// Parts that are looked at one after the other.
const IN_A_ROW: usize = 64;
/// Groups of faces likewise.
const FEW: usize = 8;

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

/// What is no farther from a middle than it is wide.
struct Part {
    middle: Point,
    wide: f64,
}

impl Part {
    /// The hull of some points.
    fn of(points: &[Point]) -> Self {
        let middle: Point = std::array::from_fn(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / points.len() as f64);
        let wide = points.iter().map(|point| distance_squared(point, &middle)).fold(0.0, f64::max).sqrt();
        Self { middle, wide: wide * (1.0 + NOISE) }
    }
}

/// The ways to a place from what is closest to it of the faces that are near, and how long these are; and the least of that.
struct Near {
    faces: Vec<(Point, f64)>,
    distance: f64,
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

    /// Whether ways lead out of all places between both distances by as much as tells the topology of the shape that the surface stands for, too; none where they do not lead out.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn steadiness(&self, setting: &Setting, budget: &Budget) -> Result<Option<bool>, Stopped> {
        let (off, reach) = (setting.off + setting.slack, setting.reach);
        let may_be_steady = setting.off > 0.0 && self.inner <= reach - off && reach + 2.0 * off <= self.outer;
        if may_be_steady && self.lead_out(off, budget)? {
            return Ok(Some(true));
        }
        Ok(self.lead_out(0.0, budget)?.then_some(false))
    }

    /// Whether all faces that are as near to some place between both distances from the surface are left behind along a direction there, and lower by so much more.
    ///
    /// # Errors
    /// [`Stopped`].
    fn lead_out(&self, more: f64, budget: &Budget) -> Result<bool, Stopped> {
        let ways = Self { more, ..*self };
        let Self { skin, faces, .. } = &ways;
        let (groups, cones) = (faces.groups(), cones());
        let at = |vertex: u32| skin.places[vertex as usize];
        let rays = |vertex: u32| -> Vec<Point> {
            let own = [vertex];
            let copies = skin.seams.copies(vertex).unwrap_or(&own);
            let others = copies.iter().flat_map(|&copy| {
                skin.around.at(copy).iter().flat_map(|&triangle| skin.triangles[triangle as usize]).filter(move |&other| other != copy)
            });
            others.map(|other| unit(&subtract(&at(other), &at(vertex)))).collect()
        };
        let seams = skin.seams.all.iter().flat_map(|seam| seam.ends[0]);
        let mut borders: Vec<u32> = skin.borders.iter().flat_map(|(ends, _)| *ends).chain(seams).map(|end| skin.seams.first(end)).collect();
        borders.sort_unstable();
        borders.dedup();
        let left = |group: &&[u32]| -> Result<Vec<u32>, Stopped> {
            budget.cancel.check()?;
            let is_whole = ways.lead_from(group);
            Ok(group.iter().copied().filter(|&face| !is_whole && !ways.lead_from(&[face])).collect())
        };
        let left = groups.par_iter().with_min_len(FEW).map(left).collect::<Result<Vec<Vec<u32>>, Stopped>>()?.concat();
        let mut is_left = vec![false; skin.triangles.len()];
        left.iter().for_each(|&face| is_left[face as usize] = true);
        Ok(all(&left, budget, |&face| ways.lead_from_parts(face, &is_left, &rays, &cones))?
            && all(&skin.borders, budget, |(ends, triangle)| ways.lead_beyond(&ends.map(at), &skin.normals[*triangle as usize]))?
            && all(&skin.seams.all, budget, |seam| ways.lead_over(seam))?
            && all(&borders, budget, |&vertex| ways.lead_around(vertex, &rays(vertex), &cones))?)
    }

    /// Whether it is so on the sides of some faces, for the directions away from the inside of these and around corners within.
    fn lead_from(&self, group: &[u32]) -> bool {
        let Skin { triangles, normals, around, .. } = self.skin;
        let first = normals[group[0] as usize];
        let aligned = |normal: &Point| if dot(normal, &first) < 0.0 { normal.map(|part| -part) } else { *normal };
        let up = mean(group.iter().map(|&face| aligned(&normals[face as usize])));
        let corners = group.iter().flat_map(|&face| triangles[face as usize]);
        let normals = corners.clone().flat_map(|corner| around.at(corner)).map(|&face| &normals[face as usize]);
        let cosine = normals.map(|normal| dot(normal, &up).abs()).fold(1.0, f64::min) - NOISE;
        // Where faces lean more, directions between the normals of two may be in neither cone.
        if cosine < FRAC_1_SQRT_2 {
            return false;
        }
        let places: Vec<Point> = corners.map(|corner| self.skin.places[corner as usize]).collect();
        self.skin.sides.iter().all(|side| self.lead_along(&places, &Cone::new(up.map(|part| side * part), cosine)))
    }

    /// Whether it is so of the places that what is between some of a surface is closest to, in the directions of a cone: of all together, or of the parts of a side or a triangle.
    fn lead_along(&self, places: &[Point], cone: &Cone) -> bool {
        self.lead_at_once(places, cone)
            || match self.halves(places, SHORT) {
                Some(halves) => halves.iter().all(|half| self.lead_along(half, cone)),
                None => false,
            }
    }

    /// The same, or in directions that are sought, see [`Ways::lead_apart`].
    fn lead_somewhere(&self, places: &[Point], cone: &Cone) -> bool {
        self.lead_along(places, cone) || self.lead_apart(places, &cone.around(), [self.inner, self.outer])
    }

    /// Whether it is so of what is between two distances from some places, in directions between some that are unit vectors, and has its closest place among these: for what is around a middle, by no more than h, of all faces that may be closest to some of it, each along a way that leads from its closest places by more than h.
    fn lead_apart(&self, places: &[Point], ways: &[Point], [from, to]: [f64; 2]) -> bool {
        if let [a, b, c, d] = ways {
            return [[*a, *b, *c], [*a, *c, *d]].iter().all(|half| self.lead_apart(places, half, [from, to]));
        }
        let axis = mean(ways.iter().copied());
        // What is between directions is that much shorter at most.
        let cosine = ways.iter().map(|way| dot(way, &axis)).fold(1.0, f64::min);
        if cosine < FRAC_1_SQRT_2 {
            let halves = halves(ways, true);
            return halves.iter().all(|half| self.lead_apart(places, half, [from, to]));
        }
        let all = places.iter().flat_map(|place| ways.iter().flat_map(move |way| [from, to / cosine].map(|by| lifted(place, way, by))));
        let part = Part::of(&all.collect::<Vec<Point>>());
        if part.wide > self.outer {
            // What is wide beside the distances has no direction of its own, but most of a large face has that of all.
            if self.lead_at_once(places, &Cone::new(axis, cosine - NOISE)) {
                return true;
            }
        } else {
            let near = self.near(&part, part.wide + to + 2.0 * self.more);
            if near.distance + part.wide < from || self.is_left(&part, &near, to, &[]) {
                return true;
            }
        }
        let [long, turned] = [longest(places).1, to * longest(ways).1];
        let most = long.max(turned).max(to - from);
        if most < FINE * self.outer {
            return false;
        }
        if most == to - from {
            let middle = 0.5 * (from + to);
            return [[from, middle], [middle, to]].into_iter().all(|between| self.lead_apart(places, ways, between));
        }
        if most == long {
            return halves(places, false).iter().all(|half| self.lead_apart(half, ways, [from, to]));
        }
        halves(ways, true).iter().all(|half| self.lead_apart(places, half, [from, to]))
    }

    /// Likewise of the inside of a face, and of its inner sides and corners, on the sides of it, each in the directions that belong to it: of those that no face has which is not left, and no earlier one.
    fn lead_from_parts(&self, face: u32, is_left: &[bool], rays: &impl Fn(u32) -> Vec<Point>, cones: &[Cone]) -> bool {
        let Skin { triangles, places, normals, mesh, around, .. } = self.skin;
        let (corners, normal) = (triangles[face as usize], normals[face as usize]);
        let at = corners.map(|corner| places[corner as usize]);
        let along = |other: u32, side: f64| {
            let own = normals[other as usize];
            own.map(|part| part * side.copysign(side * dot(&own, &normal)))
        };
        let is_known = |other: u32| other < face || !is_left[other as usize];
        let between = [self.inner, self.outer];
        let is_side_left = |k: usize, side: f64| {
            let twin = mesh.twin(3 * face + k as u32);
            let other = twin / 3;
            if twin == NONE {
                return false;
            }
            other as usize >= triangles.len()
                || is_known(other)
                || self.lead_apart(&[at[k], at[(k + 1) % 3]], &[along(face, side), along(other, side)], between)
        };
        let is_corner_left = |k: usize, side: f64| {
            let all = around.at(corners[k]);
            if self.skin.is_border(corners[k]) || all.iter().any(|&other| other != face && is_known(other)) {
                return true;
            }
            let all: Vec<Point> = all.iter().map(|&other| along(other, side)).collect();
            let axis = mean(all.iter().copied());
            let cosine = all.iter().map(|way| dot(way, &axis)).fold(1.0, f64::min) - NOISE;
            match cosine > FRAC_1_SQRT_2 {
                true => self.lead_apart(&[at[k]], &Cone::new(axis, cosine).around(), between),
                false => self.lead_around(corners[k], &rays(corners[k]), cones),
            }
        };
        self.skin.sides.iter().all(|&side| {
            self.lead_apart(&at, &[along(face, side)], between)
                && (0..3).all(|k| is_side_left(k, side))
                && (0..3).all(|k| is_corner_left(k, side))
        })
    }

    /// The faces within a distance of the middle of a part.
    fn near(&self, part: &Part, within: f64) -> Near {
        let (mut faces, mut least) = (Vec::new(), f64::INFINITY);
        self.faces.around(std::slice::from_ref(&part.middle), within, |face| {
            let way = subtract(&part.middle, &self.faces.all[face as usize].closest(&part.middle));
            let distance = dot(&way, &way).sqrt();
            if distance <= within {
                faces.push((way, distance));
                least = least.min(distance);
            }
            true
        });
        Near { faces, distance: least }
    }

    /// Whether there is a direction along which all that may be closest to some place of a part, and no farther than a distance, is left behind, and which leads through some facets.
    ///
    /// A face is convex: the way to a place from what of it is closest changes by no more than the place does (Moreau, "Proximite et dualite dans un espace hilbertien", Bull. SMF 93, 1965). So along w it leads on everywhere in the part if it does so at the middle by more than the part
    /// is wide. Places of it that are farther than that by up to 2 e are off by sqrt((d + 2 e)^2 - d^2) at most.
    fn is_left(&self, part: &Part, near: &Near, most: f64, through: &[Point]) -> bool {
        let within = (near.distance + 2.0 * (part.wide + self.more)) * (1.0 + NOISE);
        let least = part.wide + self.more + 2.0 * (self.more * (most + self.more)).sqrt() + NOISE * self.outer;
        let through = through.iter().map(|normal| normal.map(|part| part * self.outer));
        let all: Vec<Point> = near.faces.iter().filter(|face| face.1 <= within).map(|face| face.0).chain(through).collect();
        // The shortest of the means of these ways leads on along all of them as far as any direction does: by steps to the one along which it leads on least.
        let mut mean = all.iter().fold([0.0; 3], |sum: Point, own| std::array::from_fn(|k| sum[k] + own[k] / all.len() as f64));
        for _ in 0..STEPS {
            let length = dot(&mean, &mean).sqrt();
            let worst = all.iter().map(|way| (dot(way, &mean), way)).min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((along, way)) = worst.filter(|_| length > least) else { return false };
            if along > least * length {
                return true;
            }
            let way = subtract(way, &mean);
            let share = (-dot(&mean, &way) / dot(&way, &way)).clamp(0.0, 1.0);
            mean = std::array::from_fn(|k| mean[k] + share * way[k]);
        }
        false
    }

    /// The halves of a side, or of a triangle across its longest side; none where that is short, as a share of the distance, and of others.
    fn halves(&self, places: &[Point], short: f64) -> Option<[Vec<Point>; 2]> {
        (places.len() <= 3 && longest(places).1 > short * self.outer).then(|| halves(places, false))
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

    /// Likewise of a vertex from which the surface goes on along some rays, in all directions, or all that lead out of a solid.
    fn lead_around(&self, vertex: u32, rays: &[Point], cones: &[Cone]) -> bool {
        let Skin { places, sides, .. } = self.skin;
        let outward = if *sides == OUTER { Some(self.skin.outward(vertex)) } else { None };
        // No place out along such a direction has this one closest: going along a ray leads closer.
        let is_beside = |cone: &Cone| rays.iter().any(|ray| dot(ray, &cone.axis) > cone.sine + NOISE);
        let is_inside = |cone: &Cone| outward.is_some_and(|outward| dot(&outward, &cone.axis) < -cone.sine - NOISE);
        cones.iter().all(|cone| is_beside(cone) || is_inside(cone) || self.lead_somewhere(&[places[vertex as usize]], cone))
    }

    /// Likewise of the inside of a side of the border, given the normal of its triangle: in all directions across the side that do not lead over the triangle.
    fn lead_beyond(&self, ends: &[Point; 2], normal: &Point) -> bool {
        let out = unit(&cross(&subtract(&ends[1], &ends[0]), normal));
        let (sine, cosine) = (0.5 * PI / AROUND_SIDE as f64).sin_cos();
        (0..AROUND_SIDE).all(|step| {
            let (own, along) = (PI * (step as f64 + 0.5) / AROUND_SIDE as f64).sin_cos();
            let axis = std::array::from_fn(|k| along * normal[k] + own * out[k]);
            self.lead_somewhere(ends, &Cone { axis, cosine, sine })
        })
    }

    /// Likewise of the inside of a seam: in all directions across it that lead over neither of its triangles.
    fn lead_over(&self, seam: &Seam) -> bool {
        let ends = seam.ends[0].map(|end| self.skin.places[end as usize]);
        let is_concave = dot(&self.skin.normals[seam.triangles[0] as usize], &seam.inwards[1]) > 0.0;
        if is_concave && self.skin.sides == OUTER {
            return true;
        }
        // Normals of both triangles on the side with room between them.
        let [from, to] = [0, 1].map(|k| {
            let normal = self.skin.normals[seam.triangles[k] as usize];
            if dot(&normal, &seam.inwards[1 - k]) > 0.0 { normal.map(|part| -part) } else { normal }
        });
        let angle = dot(&from, &to).clamp(-1.0, 1.0).acos();
        let beside = unit(&std::array::from_fn(|k| to[k] - dot(&from, &to) * from[k]));
        let steps = (AROUND_SIDE as f64 * angle / PI).ceil().max(1.0);
        let (sine, cosine) = (0.5 * angle / steps + NOISE).sin_cos();
        (0..steps as usize).all(|step| {
            let (over, along) = (angle * (step as f64 + 0.5) / steps).sin_cos();
            let axis = std::array::from_fn(|k| along * from[k] + over * beside[k]);
            self.lead_somewhere(&ends, &Cone { axis, cosine, sine })
        })
    }

    /// The triangles of a surface at which no such directions are found that leave it, too: those of corners, as given or means of those of their triangles, normals of triangles, or means of two of these at their common side. Slivers are among these.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn not_left(&self, surface: &BlockSurface, ways: &[Option<Point>], budget: &Budget) -> Result<Vec<u32>, Stopped> {
        let mesh = HalfEdges::new(surface.vertices.clone(), &surface.triangles);
        let around = Incidence::new(surface.vertices.len(), &surface.triangles);
        let at = |corner: u32| surface.vertices[corner as usize];
        let numbers: Vec<u32> = (0..surface.triangles.len() as u32).collect();
        let corners = |triangle: u32| surface.triangles[triangle as usize];
        // Nothing leads through a sliver.
        let normals: Vec<Point> = numbers.iter().map(|&triangle| upright(&corners(triangle).map(at)).unwrap_or_default()).collect();
        let leads = |way: &Point, triangle: u32| dot(way, &normals[triangle as usize]) > NOISE;
        let leading = |vertex: u32| {
            let all = around.at(vertex);
            let mean = (!all.is_empty()).then(|| mean(all.iter().map(|&other| normals[other as usize])));
            ways[vertex as usize].into_iter().chain(mean).find(|way| all.iter().all(|&other| leads(way, other)))
        };
        let ways: Vec<Option<Point>> = (0..surface.vertices.len() as u32).into_par_iter().map(leading).collect();
        let is_left = |triangle: u32| {
            let (own, places, up) = (corners(triangle), corners(triangle).map(at), &normals[triangle as usize]);
            if *up == [0.0; 3] {
                return false;
            }
            // Corners whose ways serve all of the triangle.
            let serves = own.map(|corner| ways[corner as usize].as_ref().is_some_and(|way| self.leaves_all(&places, way)));
            let is_side_left = |k: usize| {
                let twin = mesh.twin(3 * triangle + k as u32);
                let ends = [k, (k + 1) % 3];
                twin != NONE
                    && (ends.iter().any(|&end| serves[end]) || {
                        let mean = unit(&std::array::from_fn(|axis| up[axis] + normals[(twin / 3) as usize][axis]));
                        let through = [*up, normals[(twin / 3) as usize]];
                        let along = (leads(&mean, triangle) && leads(&mean, twin / 3)).then_some(&mean);
                        self.leaves_between(&ends.map(|end| places[end]), along, &through)
                    })
            };
            let facets = |k: usize| -> Vec<Point> { around.at(own[k]).iter().map(|&other| normals[other as usize]).collect() };
            let is_corner_left = |k: usize| serves[k] || self.leaves_between(&[places[k]], ways[own[k] as usize].as_ref(), &facets(k));
            (serves.contains(&true) || self.leaves_between(&places, Some(up), &[*up]))
                && (0..3).all(is_side_left)
                && (0..3).all(is_corner_left)
        };
        let look = |row: &[u32]| {
            budget.cancel.check()?;
            Ok(row.iter().copied().filter(|&triangle| !is_left(triangle)).collect())
        };
        let all: Vec<Vec<u32>> = numbers.par_chunks(IN_A_ROW).map(look).collect::<Result<_, Stopped>>()?;
        Ok(all.concat())
    }

    /// Whether all faces that are as near to some place of a corner, a side or a triangle are left behind along a direction, or those closest to it along another one that leads through some facets, which may be told of parts.
    fn leaves_between(&self, places: &[Point], along: Option<&Point>, through: &[Point]) -> bool {
        if along.is_some_and(|along| self.leaves(places, along, lowest(places, along))) {
            return true;
        }
        match self.halves(places, SHORT) {
            Some(halves) => halves.iter().all(|half| self.leaves_between(half, along, through)),
            None => self.leaves_apart(places, through),
        }
    }

    /// The same along directions that are sought.
    fn leaves_apart(&self, places: &[Point], through: &[Point]) -> bool {
        let part = Part::of(places);
        let is_small = part.wide <= self.outer;
        (is_small && self.is_left(&part, &self.near(&part, self.outer + 2.0 * part.wide), self.outer, through))
            || self.halves(places, FINE).is_some_and(|halves| halves.iter().all(|half| self.leaves_apart(half, through)))
    }
}

impl Cone {
    fn new(axis: Point, cosine: f64) -> Self {
        Self { axis, cosine, sine: (1.0 - cosine * cosine).max(0.0).sqrt() }
    }

    /// Directions that all of it is between, if it is no wider than a right angle.
    fn around(&self) -> [Point; 4] {
        let Self { axis, cosine, sine } = self;
        let [first, second, _] = frame(axis);
        let tangent = sine / cosine;
        [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]
            .map(|[p, q]| unit(&std::array::from_fn(|k| axis[k] + tangent * (p * first[k] + q * second[k]))))
    }
}

/// The direction between some.
fn mean(ways: impl Iterator<Item = Point>) -> Point {
    unit(&ways.fold([0.0; 3], |sum: Point, way| std::array::from_fn(|k| sum[k] + way[k])))
}

/// Which side of a polygon is longest, and how long it is.
fn longest(places: &[Point]) -> (usize, f64) {
    let count = places.len();
    let long = |k: usize| distance_squared(&places[k], &places[(k + 1) % count]);
    let k = (0..count).max_by(|&p, &q| long(p).total_cmp(&long(q))).unwrap_or_default();
    (k, long(k).sqrt())
}

/// The halves of a side, or of a triangle, across its longest side: of places, or of directions.
fn halves(places: &[Point], are_ways: bool) -> [Vec<Point>; 2] {
    let (k, next) = (longest(places).0, (longest(places).0 + 1) % places.len());
    let half = between(&places[k], &places[next], 0.5);
    let half = if are_ways { unit(&half) } else { half };
    [k, next].map(|replaced| {
        let mut part = places.to_vec();
        part[replaced] = half;
        part
    })
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
            cones.push(Cone::new(axis, cosine));
        }
    }
    cones
}
