//! Whether the solid's surface follows the distance: the other half of the proof of its topology, see `critical`.
//!
//! At every point y of the surface there must be a direction that leaves the solid through all facets at y and along which the distance grows: w . n > 0 for their normals n, pointing
//! outwards, and w . (y - c) > 0 for all closest points c of y. It exists when the origin is not in the hull of these vectors. A facet's interior has one normal, an
//! edge two, a vertex those of its star. One direction for a whole star is sought first, then one for the vertex, and for its edges and triangles, halved where that is necessary.
//!
//! Over a simplex with circumradius R the interpolant L_i of d_i^2 has d_i^2 <= L_i <= d_i^2 + R^2: a site is nowhere nearest there if another's squared distances are less by R^2 at all corners.

use super::critical::add_closest;
use super::lattice::{Cube, Grading, LEVELS};
use super::parting::{avoids_origin, parting};
use super::plan::Setting;
use super::surface::{BlockSurface, VertexName};
use super::tree::Weighted;
use crate::attractor::cell::{Point, Site, distance_squared, dot, subtract};
use crate::measure::triangle::closest_feature;

/// Simplices that the search around a vertex may look at.
const MOST_WORK: usize = 400;
/// How far hulls are to be from the origin, in units of the radius: far above the rounding of normals, which are kept in single precision.
const LEAST: f64 = 1e-6;

/// A vertex of the surface with the triangles around it.
#[derive(Debug, Default)]
pub(super) struct Star {
    pub(super) centre: Point,
    /// The centre, and the triangles' other corners, each once.
    corners: Vec<Point>,
    /// The triangles' other corners, as indices of `corners`, and their normals, as long as the radius.
    triangles: Vec<([usize; 2], Point)>,
    /// The sites that may be nearest to points of the star, and others.
    pub(super) sites: Vec<Weighted>,
    scratch: Scratch,
}

/// What is asked of one simplex.
#[derive(Debug, Default)]
struct Scratch {
    /// Squared distances of the corners from the sites.
    squares: Vec<f64>,
    /// Normals, and y - c where it is affine.
    vectors: Vec<Point>,
    /// Closest points of sites for which it is not.
    closest: Vec<Point>,
    /// Where each site's begin.
    groups: Vec<usize>,
    own: Vec<Point>,
}

impl Star {
    /// A vertex without triangles.
    pub(super) fn reset(&mut self, centre: Point) {
        self.centre = centre;
        self.corners.clear();
        self.corners.push(centre);
        self.triangles.clear();
        self.sites.clear();
    }

    /// Adds a triangle with the centre as a corner.
    pub(super) fn add(&mut self, setting: &Setting, triangle: [Point; 3], normal: [f32; 3]) {
        let normal = normal.map(|part| setting.reach * f64::from(part));
        let mut others = [0; 2];
        let centre = self.centre;
        for (slot, corner) in others.iter_mut().zip(triangle.into_iter().filter(|corner| *corner != centre)) {
            *slot = self.corners.iter().position(|known| *known == corner).unwrap_or_else(|| {
                self.corners.push(corner);
                self.corners.len() - 1
            });
        }
        self.triangles.push((others, normal));
    }

    /// How far its corners are from the centre.
    pub(super) fn radius(&self) -> f64 {
        self.corners.iter().map(|corner| distance_squared(corner, &self.centre)).fold(0.0, f64::max).sqrt()
    }

    /// A direction along which the distance grows at the centre, from what is known there alone, whatever triangles are given: the same in all blocks.
    pub(super) fn outwards(&mut self, setting: &Setting) -> Point {
        let most = setting.outer * setting.outer;
        let vectors = &mut self.scratch.vectors;
        vectors.clear();
        let mut nearest = (f64::INFINITY, [0.0; 3]);
        for site in &self.sites {
            let square = site.distance_squared(&self.centre);
            let away = subtract(&self.centre, &site.closest(&self.centre));
            if square <= most {
                vectors.push(away);
            }
            if square < nearest.0 {
                nearest = (square, away);
            }
        }
        let lowest = |direction: &Point| {
            let lowest = vectors.iter().min_by(|a, b| dot(a, direction).total_cmp(&dot(b, direction)));
            lowest.copied().unwrap_or(nearest.1)
        };
        parting(nearest.1, 0.0, lowest, |direction, lowest| dot(direction, lowest) > 0.9 * dot(direction, direction)).unwrap_or(nearest.1)
    }

    /// Whether a direction serves all points of the star.
    pub(super) fn follows(&mut self, setting: &Setting, direction: &Point) -> bool {
        let least = LEAST * setting.reach * dot(direction, direction).sqrt();
        if self.triangles.iter().any(|(_, normal)| dot(normal, direction) <= least) {
            return false;
        }
        let Self { corners, sites, scratch, .. } = self;
        for index in 0..sites.len() {
            scratch.own.clear();
            let is_affine = closest_to(&sites[index].site, corners, &mut scratch.own);
            let along = |point: &Point| dot(point, direction);
            let lowest = if is_affine {
                corners.iter().zip(&scratch.own).map(|(corner, closest)| along(&subtract(corner, closest))).fold(f64::INFINITY, f64::min)
            } else {
                let lowest = corners.iter().map(along).fold(f64::INFINITY, f64::min);
                lowest - scratch.own.iter().map(along).fold(f64::NEG_INFINITY, f64::max)
            };
            if lowest <= least && scratch.may_be_nearest(sites, index, corners) {
                return false;
            }
        }
        true
    }

    /// Whether there are directions for all points of the star, one or several.
    pub(super) fn grows(&mut self, setting: &Setting) -> bool {
        let Self { corners, triangles, sites, scratch, centre } = self;
        let normals: Vec<Point> = triangles.iter().map(|(_, normal)| *normal).collect();
        let least = LEAST * setting.reach;
        // A point is nearer to the centre than the farthest corner: the square of that bounds R^2 of all triangles.
        if scratch.avoid_origin(sites, corners, &normals, least) {
            return true;
        }
        if !scratch.avoid_origin(sites, &[*centre], &normals, least) {
            return false;
        }
        let mut work = MOST_WORK;
        (1..corners.len()).all(|end| {
            let own: Vec<Point> = triangles.iter().filter(|(others, _)| others.contains(&end)).map(|(_, normal)| *normal).collect();
            scratch.settle(sites, &[*centre, corners[end]], &own, least, &mut work)
        }) && triangles
            .iter()
            .all(|(others, normal)| scratch.settle(sites, &[*centre, corners[others[0]], corners[others[1]]], &[*normal], least, &mut work))
    }
}

/// The triangles around vertices.
#[derive(Debug, Default)]
pub(super) struct Incident {
    /// Where the triangles of every vertex begin, and where the last ones end.
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

impl Incident {
    /// Lists the triangles of the vertices that are wanted.
    pub(super) fn list(&mut self, triangles: &[[u32; 3]], wanted: &[bool]) {
        // Two places ahead: after the counts are summed and the triangles put in their places, each start is where it belongs.
        self.starts.clear();
        self.starts.resize(wanted.len() + 2, 0);
        let all = || triangles.iter().zip(0_u32..).flat_map(|(corners, triangle)| corners.map(|corner| (corner as usize, triangle)));
        all().filter(|&(corner, _)| wanted[corner]).for_each(|(corner, _)| self.starts[corner + 2] += 1);
        let mut total = 0;
        for start in &mut self.starts {
            total += *start;
            *start = total;
        }
        self.triangles.clear();
        self.triangles.resize(total as usize, 0);
        for (corner, triangle) in all().filter(|&(corner, _)| wanted[corner]) {
            let place = &mut self.starts[corner + 1];
            self.triangles[*place as usize] = triangle;
            *place += 1;
        }
    }

    /// Those of a vertex.
    pub(super) fn of(&self, vertex: u32) -> &[u32] {
        &self.triangles[self.starts[vertex as usize] as usize..self.starts[vertex as usize + 1] as usize]
    }
}

/// Working memory of a block's stars.
#[derive(Debug, Default)]
pub(super) struct Stars {
    pub(super) star: Star,
    pub(super) incident: Incident,
    /// Whether a vertex may have triangles in other blocks.
    pub(super) shared: Vec<bool>,
    wanted: Vec<bool>,
    /// The vertices to be looked at, by their place in the block.
    pub(super) listed: Vec<(u32, u32)>,
}

impl Stars {
    /// Lists the vertices of triangles from `first` on, ordered by their place.
    pub(super) fn list(&mut self, surface: &mut BlockSurface, first: usize, place: impl Fn(&Point) -> u32) {
        let count = surface.vertices.len();
        self.wanted.clear();
        self.wanted.resize(count, false);
        surface.triangles[first..].iter().flatten().for_each(|&corner| self.wanted[corner as usize] = true);
        self.shared.clear();
        self.shared.resize(count, false);
        surface.shared.iter().for_each(|&(_, number)| self.shared[number as usize] = true);
        self.incident.list(&surface.triangles, &self.wanted);
        self.listed.clear();
        let wanted = (0_u32..).zip(&self.wanted).filter(|&(_, &wanted)| wanted);
        self.listed.extend(wanted.map(|(vertex, _)| (place(&surface.vertices[vertex as usize]), vertex)));
        self.listed.sort_unstable();
        // What is known of others stays.
        let Self { wanted, .. } = self;
        let shared = &surface.shared;
        let is_listed = |name: VertexName| {
            let at = shared.partition_point(|&(other, _)| other < name);
            shared.get(at).is_none_or(|&(other, vertex)| other != name || wanted[vertex as usize])
        };
        surface.seams.retain(|seam| !is_listed(seam.name));
    }
}

/// Notes the leaf that holds a place as one to be subdivided, or the place as uncertain where no leaf is smaller.
pub(super) fn note(setting: &Setting, grading: &Grading, place: &Point, critical: &mut Vec<Cube>, uncertain: &mut Vec<Cube>) {
    let within = std::array::from_fn(|axis| (place[axis] - setting.lattice.origin[axis]) / setting.lattice.pitch);
    match (0..LEVELS).map(|level| Cube::containing(level, within)).find(|&cube| !grading.is_subdivided(cube)) {
        Some(leaf) => critical.push(leaf),
        None => uncertain.push(Cube::containing(0, within)),
    }
}

impl Scratch {
    /// Whether there are directions for all points of a simplex, which is halved until there is one for each part.
    fn settle(&mut self, sites: &[Weighted], corners: &[Point], normals: &[Point], least: f64, work: &mut usize) -> bool {
        if *work == 0 {
            return false;
        }
        *work -= 1;
        if self.avoid_origin(sites, corners, normals, least) {
            return true;
        }
        let sides = (0..corners.len()).flat_map(|p| (0..p).map(move |q| (p, q)));
        let length = |&(p, q): &(usize, usize)| distance_squared(&corners[p], &corners[q]);
        let Some((p, q)) = sides.max_by(|a, b| length(a).total_cmp(&length(b))) else { return false };
        let middle: Point = std::array::from_fn(|axis| 0.5 * (corners[p][axis] + corners[q][axis]));
        [p, q].into_iter().all(|replaced| {
            let mut half = [[0.0; 3]; 3];
            half[..corners.len()].copy_from_slice(corners);
            half[replaced] = middle;
            self.settle(sites, &half[..corners.len()], normals, least, work)
        })
    }

    /// Whether one direction serves all points in the hull of some corners: those of a simplex, or of a star, which is in the ball around the first that holds all.
    fn avoid_origin(&mut self, sites: &[Weighted], corners: &[Point], normals: &[Point], least: f64) -> bool {
        self.vectors.clear();
        self.vectors.extend_from_slice(normals);
        self.closest.clear();
        self.groups.clear();
        let mut start = None;
        for index in 0..sites.len() {
            if !self.may_be_nearest(sites, index, corners) {
                continue;
            }
            self.own.clear();
            if closest_to(&sites[index].site, corners, &mut self.own) {
                self.vectors.extend(corners.iter().zip(&self.own).map(|(corner, closest)| subtract(corner, closest)));
            } else {
                self.groups.push(self.closest.len());
                self.closest.extend_from_slice(&self.own);
            }
            start = start.or(Some(subtract(&corners[0], &self.own[0])));
        }
        let Some(start) = start else { return true };
        let lowest = |direction: &Point, _: &Point| {
            let along = |point: &Point| dot(point, direction);
            let best = |points: &[Point]| points.iter().copied().min_by(|a, b| along(a).total_cmp(&along(b)));
            let ends = self.groups.iter().skip(1).copied().chain([self.closest.len()]);
            let loose = self.groups.iter().zip(ends).filter_map(|(&first, end)| {
                let own = &self.closest[first..end];
                let farthest = own.iter().max_by(|a, b| along(a).total_cmp(&along(b)))?;
                Some(subtract(&best(corners)?, farthest))
            });
            loose.min_by(|a, b| along(a).total_cmp(&along(b))).unwrap_or(start)
        };
        avoids_origin(start, lowest, &self.vectors, least)
    }

    /// Whether a site may be the nearest to a point in the hull of corners: no other is nearer by R^2 at all of them.
    fn may_be_nearest(&mut self, sites: &[Weighted], index: usize, corners: &[Point]) -> bool {
        // The smallest ball around a triangle, or a segment, has at most a third of the longest side's square; one around all corners of a star is centred at the first.
        let square = match corners.len() {
            1 => 0.0,
            2 | 3 => (0..corners.len()).map(|k| distance_squared(&corners[k], &corners[(k + 1) % corners.len()])).fold(0.0, f64::max) / 3.0,
            _ => corners.iter().map(|corner| distance_squared(corner, &corners[0])).fold(0.0, f64::max),
        };
        self.squares.clear();
        self.squares.extend(corners.iter().map(|corner| sites[index].distance_squared(corner) * (1.0 - 1e-12) - square));
        let is_nearer = |other: &Weighted| corners.iter().zip(&self.squares).all(|(corner, square)| other.distance_squared(corner) < *square);
        !sites.iter().any(is_nearer)
    }
}

/// The closest points of a site to some corners, where y - c(y) is affine in their hull; else points whose hull holds all closest points.
fn closest_to(site: &Site, corners: &[Point], closest: &mut Vec<Point>) -> bool {
    match site {
        Site::Point(point) => {
            closest.resize(corners.len(), *point);
            true
        }
        Site::Segment(ends) => {
            closest.extend(corners.iter().map(|corner| site.closest(corner)));
            let along = subtract(&ends[1], &ends[0]);
            let length = dot(&along, &along);
            let mut same = None;
            corners.iter().all(|corner| {
                let share = dot(&subtract(corner, &ends[0]), &along);
                let part = (share > 0.0, share < length);
                *same.get_or_insert(part) == part
            })
        }
        Site::Triangle([a, b, c]) => {
            let mut same = None;
            let is_affine = corners.iter().all(|corner| {
                let (point, feature) = closest_feature(corner, a, b, c);
                closest.push(point);
                *same.get_or_insert(feature) == feature
            });
            if !is_affine {
                closest.clear();
                add_closest(site, corners, closest);
            }
            is_affine
        }
    }
}
