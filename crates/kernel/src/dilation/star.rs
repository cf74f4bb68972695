//! Whether the solid's surface follows the distance: the other half of the proof of its topology, see `critical`.
//!
//! At every point y of the surface there must be a direction that leaves the solid through all facets at y and along which the distance grows: w . n > 0 for their normals n, pointing
//! outwards, and w . (y - c) > 0 for all closest points c of y. It exists when the origin is not in the hull of these vectors. A facet's interior has one normal, an
//! edge two, a vertex those of its star. One direction for a whole star is sought first, then one for the vertex, and for its edges and triangles, halved where that is necessary.
//!
//! Over a simplex with circumradius R the interpolant L_i of d_i^2 has d_i^2 <= L_i <= d_i^2 + R^2: a site is nowhere nearest there if another's squared distances are less by R^2 at all corners,
//! or if its own exceed by R^2 what the surface's may be anywhere: all of it is within `outer` of some site.

use super::convex::Convex;
use super::critical::add_closest;
use super::lattice::{Cube, Grading};
use super::parting::{avoids_origin, farthest, parting};
use super::setting::Setting;
use super::surface::BlockSurface;
use super::tree::{SiteId, Weighted};
use crate::attractor::cell::{Point, Site, distance_squared, dot, subtract, unit};
use crate::measure::triangle::closest_feature;
use std::cmp::Ordering;
use std::collections::BTreeMap;

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
    /// A bound of the triangles' R^2.
    bulge: f64,
    /// The sites that may be nearest to points of the star, and others.
    pub(super) sites: Vec<Weighted>,
    scratch: Scratch,
}

/// What is asked of one simplex, or of a star.
#[derive(Debug, Default)]
struct Scratch {
    /// Of every site: the closest points to the corners, their squared distances, and whether y - c(y) is affine.
    points: Vec<Point>,
    squares: Vec<f64>,
    affine: Vec<bool>,
    /// Normals, and y - c where it is affine.
    vectors: Vec<Point>,
    /// Closest points of sites for which it is not.
    closest: Vec<Point>,
    /// Where each site's begin.
    groups: Vec<usize>,
    /// A bound of the surface's squared distance from the sites.
    most: f64,
}

impl Star {
    /// A vertex without triangles.
    pub(super) fn reset(&mut self, setting: &Setting, centre: Point) {
        self.centre = centre;
        // Far above what rounding moves a vertex, and far below what the tolerance is.
        self.scratch.most = ((1.0 + LEAST) * setting.outer).powi(2);
        self.corners.clear();
        self.corners.push(centre);
        self.triangles.clear();
        self.bulge = 0.0;
        self.sites.clear();
    }

    /// Adds a site.
    pub(super) fn see(&mut self, site: Weighted) {
        self.sites.push(site);
    }

    pub(super) fn forget_sites(&mut self) {
        self.sites.clear();
    }

    /// The mean of the normals, a unit vector where they have one.
    pub(super) fn normal(&self) -> Point {
        unit(&self.triangles.iter().fold([0.0; 3], |sum, (_, normal)| std::array::from_fn(|axis| sum[axis] + normal[axis])))
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
        self.bulge = self.bulge.max(bulge(&[centre, self.corners[others[0]], self.corners[others[1]]]));
        self.triangles.push((others, normal));
    }

    /// How far its corners are from the centre.
    pub(super) fn radius(&self) -> f64 {
        self.corners.iter().map(|corner| distance_squared(corner, &self.centre)).fold(0.0, f64::max).sqrt()
    }

    /// A unit vector along which the distance grows at the centre, as far as the sites seen tell. Without the triangles' normals it does not depend on what triangles are given, and is the same in all blocks.
    pub(super) fn outwards(&mut self, setting: &Setting, with_normals: bool) -> Point {
        let most = setting.outer * setting.outer;
        let vectors = &mut self.scratch.vectors;
        vectors.clear();
        let near = self.sites.iter().filter(|site| site.distance_squared(&self.centre) <= most);
        vectors.extend(near.map(|site| subtract(&self.centre, &site.closest(&self.centre))));
        if with_normals {
            vectors.extend(self.triangles.iter().map(|(_, normal)| *normal));
        } else {
            // Blocks find sites in orders of their own, and many are equally far.
            let order = |a: &Point, b: &Point| {
                (0..3).map(|axis| a[axis].total_cmp(&b[axis])).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
            };
            vectors.sort_unstable_by(order);
        }
        let Some(nearest) = vectors.iter().min_by(|a, b| dot(a, a).total_cmp(&dot(b, b))).copied() else { return [0.0; 3] };
        let lowest = |direction: &Point| {
            let lowest = vectors.iter().min_by(|a, b| dot(a, direction).total_cmp(&dot(b, direction)));
            lowest.copied().unwrap_or(nearest)
        };
        let found = parting(nearest, 0.0, lowest, |direction, lowest| dot(direction, lowest) > 0.9 * dot(direction, direction));
        unit(&found.unwrap_or(nearest))
    }

    /// Whether a unit vector leaves all triangles.
    pub(super) fn leaves(&self, setting: &Setting, direction: &Point) -> bool {
        self.triangles.iter().all(|(_, normal)| dot(normal, direction) > LEAST * setting.reach)
    }

    /// Points lower than this along a unit vector are surely left behind by it at all points of the star.
    pub(super) fn lowest(&self, setting: &Setting, direction: &Point) -> f64 {
        self.corners.iter().map(|corner| dot(corner, direction)).fold(f64::INFINITY, f64::min) - LEAST * setting.reach
    }

    /// Whether the distance grows along a unit vector at all points of the star, as far as the sites seen may be nearest.
    pub(super) fn follows(&mut self, setting: &Setting, direction: &Point) -> bool {
        let least = LEAST * setting.reach;
        let Self { corners, sites, scratch, bulge, .. } = self;
        scratch.measure(sites, corners);
        let count = corners.len();
        let along = |point: &Point| dot(point, direction);
        let lowest_corner = corners.iter().map(along).fold(f64::INFINITY, f64::min);
        // Most sites are too far or left behind: what that costs is little beside a search for another that is nearer.
        (0..sites.len()).all(|index| {
            if scratch.is_far(index, count, *bulge) {
                return true;
            }
            let own = &scratch.points[index * count..][..count];
            let lowest = if scratch.affine[index] {
                corners.iter().zip(own).map(|(corner, closest)| along(&subtract(corner, closest))).fold(f64::INFINITY, f64::min)
            } else {
                scratch.closest.clear();
                add_closest(&sites[index].site, corners, &mut scratch.closest);
                lowest_corner - scratch.closest.iter().map(along).fold(f64::NEG_INFINITY, f64::max)
            };
            lowest > least || !scratch.may_be_nearest(index, count, *bulge)
        })
    }

    /// Whether there are directions for all points of the star, one or several.
    pub(super) fn grows(&mut self, setting: &Setting) -> bool {
        let Self { corners, triangles, sites, scratch, centre, bulge, .. } = self;
        scratch.narrow(sites, corners, *bulge);
        let normals: Vec<Point> = triangles.iter().map(|(_, normal)| *normal).collect();
        let least = LEAST * setting.reach;
        if scratch.avoid_origin(sites, corners, &normals, least) {
            return true;
        }
        let mut work = MOST_WORK;
        scratch.settle(sites, &[*centre], &normals, least, &mut work)
            && (1..corners.len()).all(|end| {
                let own: Vec<Point> = triangles.iter().filter(|(others, _)| others.contains(&end)).map(|(_, normal)| *normal).collect();
                scratch.settle(sites, &[*centre, corners[end]], &own, least, &mut work)
            })
            && triangles
                .iter()
                .all(|([p, q], normal)| scratch.settle(sites, &[*centre, corners[*p], corners[*q]], &[*normal], least, &mut work))
    }
}

/// A bound of R^2 for a simplex of up to three corners: the smallest ball around a triangle has at most a third of the longest side's square.
fn bulge(corners: &[Point]) -> f64 {
    let sides = (0..corners.len()).map(|k| distance_squared(&corners[k], &corners[(k + 1) % corners.len()]));
    sides.fold(0.0, f64::max) / 3.0
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
    /// Where sites are among those of the seams.
    pub(super) numbers: BTreeMap<SiteId, u32>,
    /// The vertices to be looked at, by their place in the block.
    pub(super) listed: Vec<(u32, u32)>,
}

impl Stars {
    /// Lists the vertices of triangles from `first` on, ordered by their place.
    pub(super) fn list(&mut self, surface: &mut BlockSurface, first: usize, place: impl Fn(&Point) -> u32) {
        let count = surface.vertices.len();
        self.numbers.clear();
        self.wanted.clear();
        self.wanted.resize(count, false);
        surface.triangles[first..].iter().flatten().for_each(|&corner| self.wanted[corner as usize] = true);
        surface.list_shared(&mut self.shared);
        self.incident.list(&surface.triangles, &self.wanted);
        self.listed.clear();
        let wanted = (0_u32..).zip(&self.wanted).filter(|&(_, &wanted)| wanted);
        self.listed.extend(wanted.map(|(vertex, _)| (place(&surface.vertices[vertex as usize]), vertex)));
        self.listed.sort_unstable();
        // What is known of others stays.
        let mut seams = std::mem::take(&mut surface.seams);
        seams.retain(|seam| surface.number_of(seam.name).is_some_and(|vertex| !self.wanted[vertex as usize]));
        surface.seams = seams;
    }
}

/// Notes the leaf that holds a place as one to be subdivided, or the place as uncertain where no leaf is smaller.
pub(super) fn note(setting: &Setting, grading: &Grading, place: &Point, critical: &mut Vec<Cube>, uncertain: &mut Vec<Cube>) {
    let within = setting.lattice.within(place);
    match grading.leaf_at(within) {
        Some(leaf) => critical.push(leaf),
        None => uncertain.push(Cube::containing(0, within)),
    }
}

impl Scratch {
    /// Whether there are directions for all points of a simplex, which is halved until there is one for each part.
    fn settle(&mut self, sites: &[Weighted], corners: &[Point], normals: &[Point], least: f64, work: &mut usize) -> bool {
        let Some(left) = work.checked_sub(1) else { return false };
        *work = left;
        let mut near = sites.to_vec();
        self.narrow(&mut near, corners, bulge(corners));
        if self.avoid_origin(&near, corners, normals, least) {
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
            self.settle(&near, &half[..corners.len()], normals, least, work)
        })
    }

    /// Whether one direction serves all points in the hull of some corners, where all sites were measured.
    fn avoid_origin(&mut self, sites: &[Weighted], corners: &[Point], normals: &[Point], least: f64) -> bool {
        self.vectors.clear();
        self.vectors.extend_from_slice(normals);
        self.closest.clear();
        self.groups.clear();
        let count = corners.len();
        for (index, site) in sites.iter().enumerate() {
            if self.affine[index] {
                let own = &self.points[index * count..][..count];
                self.vectors.extend(corners.iter().zip(own).map(|(corner, closest)| subtract(corner, closest)));
            } else {
                self.groups.push(self.closest.len());
                add_closest(&site.site, corners, &mut self.closest);
            }
        }
        let start =
            corners.first().zip(self.points.first()).filter(|_| !sites.is_empty()).map(|(corner, closest)| subtract(corner, closest));
        let Some(start) = start else { return true };
        let lowest = |direction: &Point, backwards: &Point| {
            let ends = self.groups.iter().skip(1).copied().chain([self.closest.len()]);
            let farthest_ones = self.groups.iter().zip(ends).filter_map(|(&first, end)| farthest(&self.closest[first..end], direction));
            // One lowest corner does for all groups.
            let farthest_one = farthest_ones.max_by(|a, b| dot(a, direction).total_cmp(&dot(b, direction)));
            farthest_one.zip(farthest(corners, backwards)).map_or(start, |(closest, corner)| subtract(corner, closest))
        };
        avoids_origin(start, lowest, &self.vectors, least)
    }

    /// Finds the closest points of all sites.
    fn measure(&mut self, sites: &[Weighted], corners: &[Point]) {
        self.points.clear();
        self.squares.clear();
        self.affine.clear();
        for site in sites {
            let first = self.points.len();
            self.affine.push(closest_to(&site.site, corners, &mut self.points));
            let own = corners.iter().zip(&self.points[first..]);
            self.squares.extend(own.map(|(corner, closest)| distance_squared(corner, closest) + site.deficit));
        }
    }

    /// Keeps the sites that may be nearest to a point of simplices with these corners, R^2 of which is at most `bulge`, and measures them.
    fn narrow(&mut self, sites: &mut Vec<Weighted>, corners: &[Point], bulge: f64) {
        self.measure(sites, corners);
        let near: Vec<bool> = (0..sites.len()).map(|index| self.may_be_nearest(index, corners.len(), bulge)).collect();
        let mut keeps = near.iter().copied();
        sites.retain(|_| keeps.next() == Some(true));
        let count = corners.len();
        for (kept, index) in (0..near.len()).filter(|&index| near[index]).enumerate() {
            self.points.copy_within(index * count..(index + 1) * count, kept * count);
            self.affine[kept] = self.affine[index];
        }
    }

    /// Whether a site that was measured is farther from all points of simplices with these corners, R^2 of which is at most `bulge`, than the surface is from the nearest.
    fn is_far(&self, index: usize, count: usize, bulge: f64) -> bool {
        self.squares[index * count..][..count].iter().all(|square| *square > self.most + bulge)
    }

    /// Whether a site that was measured may be the nearest to a point of the surface in simplices with these corners, R^2 of which is at most `bulge`: it is not too far, and no other is nearer
    /// by that at all of them.
    fn may_be_nearest(&self, index: usize, count: usize, bulge: f64) -> bool {
        if self.is_far(index, count, bulge) {
            return false;
        }
        let own = &self.squares[index * count..][..count];
        let is_nearer = |other: &[f64]| other.iter().zip(own).all(|(other, own)| *other < *own * (1.0 - 1e-12) - bulge);
        !self.squares.chunks_exact(count).any(is_nearer)
    }
}

/// Adds the closest points of a site to some corners, and tells whether y - c(y) is affine in their hull.
fn closest_to(site: &Site, corners: &[Point], closest: &mut Vec<Point>) -> bool {
    match site {
        Site::Point(point) => {
            closest.extend(corners.iter().map(|_| *point));
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
            let (mut same, mut is_affine) = (None, true);
            closest.extend(corners.iter().map(|corner| {
                let (point, feature) = closest_feature(corner, a, b, c);
                is_affine &= *same.get_or_insert(feature) == feature;
                point
            }));
            is_affine
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::cell::cross;
    use crate::dilation::parting::tests::distance_from_hull;
    use crate::measure::Interval;
    use crate::measure::bounds::AxisBox;
    use crate::split_mix::Random;

    fn number(random: &mut Random) -> f64 {
        (random.next() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn point(random: &mut Random, scale: f64) -> Point {
        std::array::from_fn(|_| scale * number(random))
    }

    fn site(random: &mut Random, scale: f64) -> Site {
        let at = point(random, scale);
        let beside = |random: &mut Random| {
            let offset = point(random, 0.7);
            std::array::from_fn(|axis| at[axis] + offset[axis])
        };
        match random.next() % 3 {
            0 => Site::Point(at),
            1 => Site::Segment([at, beside(random)]),
            _ => Site::Triangle([at, beside(random), beside(random)]),
        }
    }

    /// A point in the hull of some corners, often on its border.
    fn mean(random: &mut Random, corners: &[Point]) -> Point {
        let shares: Vec<f64> = corners.iter().map(|_| number(random).max(0.0)).collect();
        let total: f64 = shares.iter().sum();
        if total == 0.0 {
            return corners[0];
        }
        std::array::from_fn(|axis| corners.iter().zip(&shares).map(|(corner, share)| corner[axis] * share / total).sum())
    }

    fn weighted(random: &mut Random, scale: f64) -> Weighted {
        Weighted { site: site(random, scale), deficit: 0.2 * number(random).max(0.0) }
    }

    #[test]
    fn closest_points_are_affine_or_in_the_hull_that_is_given() {
        let mut random = Random(3);
        let mut affine = 0;
        for _ in 0..4_000 {
            let corners: Vec<Point> = (0..1 + random.next() % 7).map(|_| point(&mut random, 0.5)).collect();
            let site = site(&mut random, 1.0);
            let mut closest = Vec::new();
            let is_affine = closest_to(&site, &corners, &mut closest);
            if !is_affine {
                closest.clear();
                add_closest(&site, &corners, &mut closest);
            }
            affine += usize::from(is_affine);
            for _ in 0..8 {
                let y = mean(&mut random, &corners);
                let direction = point(&mut random, 1.0);
                let c = site.closest(&y);
                let along = |points: &[Point]| points.iter().map(|point| dot(point, &direction)).fold(f64::INFINITY, f64::min);
                let lowest = if is_affine {
                    let away: Vec<Point> = corners.iter().zip(&closest).map(|(corner, closest)| subtract(corner, closest)).collect();
                    assert!(along(&[subtract(&y, &c)]) >= along(&away) - 1e-12);
                    continue;
                } else {
                    along(&closest)
                };
                assert!(dot(&c, &direction) >= lowest - 1e-12, "{site:?} {corners:?} {y:?}");
            }
        }
        assert!(affine > 800 && affine < 3_900, "{affine}");
    }

    #[test]
    fn the_nearest_site_is_never_left_out() {
        let mut random = Random(5);
        let (mut out, mut all) = (0, 0);
        for _ in 0..3_000 {
            let corners: Vec<Point> = (0..1 + random.next() % 3).map(|_| point(&mut random, 0.4)).collect();
            let sites: Vec<Weighted> = (0..6).map(|_| weighted(&mut random, 1.5)).collect();
            let mut near = sites.clone();
            let most = if random.next().is_multiple_of(2) { f64::INFINITY } else { 0.5 + number(&mut random).abs() };
            let mut scratch = Scratch { most, ..Scratch::default() };
            scratch.narrow(&mut near, &corners, bulge(&corners));
            (out, all) = (out + sites.len() - near.len(), all + sites.len());
            for _ in 0..8 {
                let y = mean(&mut random, &corners);
                let least = |sites: &[Weighted]| sites.iter().map(|site| site.distance_squared(&y)).fold(f64::INFINITY, f64::min);
                assert!(least(&sites) > most || least(&near) <= least(&sites));
            }
        }
        assert!(3 * out > all, "{out} of {all}");
    }

    /// Fans around the origin, with sites below them that compete, against the hull of normals and gradients at places on them.
    #[test]
    fn where_stars_are_said_to_grow_the_origin_is_in_no_hull() {
        let mut random = Random(9);
        let exactly = |x: f64| [Interval { low: x, high: x }; 3];
        let bounds = AxisBox { low: exactly(-2.0), high: exactly(2.0) };
        let setting = Setting::new(1.0, 1.1, 0.1, 0.6, 1_000, &bounds);
        let (mut grown, mut refused, mut by_one) = (0, 0, 0);
        for _ in 0..3_000 {
            let count = 3 + (random.next() % 4) as usize;
            let steep = 1.2 * number(&mut random).abs();
            let ring: Vec<Point> = (0..count)
                .map(|k| {
                    let (sine, cosine) = (std::f64::consts::TAU * k as f64 / count as f64).sin_cos();
                    let long = 0.35 + 0.15 * number(&mut random);
                    [long * cosine, long * sine, steep * number(&mut random)]
                })
                .collect();
            let mut star = Star::default();
            star.reset(&setting, [0.0; 3]);
            let triangles: Vec<([Point; 3], Point)> = (0..count)
                .map(|k| {
                    let triangle = [[0.0; 3], ring[k], ring[(k + 1) % count]];
                    let normal = cross(&triangle[1], &triangle[2]);
                    let length = dot(&normal, &normal).sqrt();
                    (triangle, normal.map(|part| part / length))
                })
                .collect();
            for (triangle, normal) in &triangles {
                star.add(&setting, *triangle, normal.map(|part| part as f32));
            }
            let mut sites = Vec::new();
            for _ in 0..1 + random.next() % 4 {
                let mut below = point(&mut random, 0.9);
                below[2] = -0.4 + 0.6 * number(&mut random);
                let end = point(&mut random, 0.5);
                let site = if random.next().is_multiple_of(2) {
                    Site::Point(below)
                } else {
                    Site::Segment([below, std::array::from_fn(|axis| below[axis] + end[axis])])
                };
                sites.push(Weighted { site, deficit: 0.0 });
            }
            sites.iter().for_each(|site| star.see(*site));
            let direction = match random.next() % 3 {
                0 => star.normal(),
                code => star.outwards(&setting, code == 1),
            };
            let by_direction = star.leaves(&setting, &direction) && star.follows(&setting, &direction);
            if !by_direction && !star.grows(&setting) {
                refused += 1;
                continue;
            }
            by_one += usize::from(by_direction);
            grown += 1;
            let gradients = |y: &Point| -> Vec<Point> {
                let least = sites.iter().map(|site| site.distance_squared(y)).fold(f64::INFINITY, f64::min);
                if least > 1.1 * 1.1 {
                    // No point of a surface.
                    return Vec::new();
                }
                sites.iter().filter(|site| site.distance_squared(y) <= least + 1e-12).map(|site| subtract(y, &site.closest(y))).collect()
            };
            for (k, (triangle, normal)) in triangles.iter().enumerate() {
                let at = |shares: [f64; 2]| -> Point {
                    std::array::from_fn(|axis| shares[0] * triangle[1][axis] + shares[1] * triangle[2][axis])
                };
                for _ in 0..4 {
                    let share = number(&mut random).abs();
                    let inside = at([share, (1.0 - share) * number(&mut random).abs()]);
                    let hull = [gradients(&inside), vec![*normal]].concat();
                    assert!(distance_from_hull(&hull) > 0.0, "{triangle:?} {inside:?}");
                    let on_edge = at([share, 0.0]);
                    let hull = [gradients(&on_edge), vec![*normal, triangles[(k + count - 1) % count].1]].concat();
                    assert!(distance_from_hull(&hull) > 0.0, "{triangle:?} {on_edge:?}");
                }
            }
            let hull = [gradients(&[0.0; 3]), triangles.iter().map(|(_, normal)| *normal).collect()].concat();
            assert!(distance_from_hull(&hull) > 0.0, "{ring:?}");
        }
        assert!(grown > 600 && refused > 100 && by_one < grown, "{grown} {refused} {by_one}");
    }
}
