//! Critical points of the distance that the solid has on the wrong side.
//!
//! A point x is critical when it lies in the convex hull of its closest points. By Morse theory the dilations change their topology only at the values of critical points,
//! and D(r) is, up to homotopy, D(s) with the hulls of those of values in (s, r] attached (Chazal, Cohen-Steiner and Lieutier, "A sampling theory for compact sets in Euclidean
//! space", 2009). The solid lies between D(s) and D(outer). It has the topology of D(r) where every critical point of a value in (s, r] is inside and
//! every one of a value in (r, outer] is outside. Both kinds lie in what the sites leave of a tetrahedron.

use super::block::{BlockSurface, Frame, Nearby, place};
use super::lattice::{Cube, LEVELS};
use super::outside::Corner;
use super::plan::Setting;
use super::smooth;
use super::tree::Tree;
use crate::attractor::cell::{Point, Site, cross, distance_squared, dot, subtract};
use crate::measure::triangle::{Feature, closest_feature};

/// Boxes that the search in a tetrahedron may look at.
const MOST_WORK: usize = 4000;
/// Steps of the searches for a plane.
const STEPS: usize = 32;

/// An affine function.
#[derive(Clone, Copy)]
struct Affine {
    at_base: f64,
    slope: Point,
    /// Its length.
    steepness: f64,
}

impl Affine {
    /// The function with these values at the vertices of a tetrahedron, about the first of them.
    fn new(positions: &[Point; 4], values: [f64; 4]) -> Self {
        let columns = [1, 2, 3].map(|k| subtract(&positions[k], &positions[0]));
        let dual = [cross(&columns[1], &columns[2]), cross(&columns[2], &columns[0]), cross(&columns[0], &columns[1])];
        let determinant = dot(&columns[0], &dual[0]);
        let slope: Point =
            std::array::from_fn(|axis| (0..3).map(|k| (values[k + 1] - values[0]) * dual[k][axis]).sum::<f64>() / determinant);
        Self { at_base: values[0], slope, steepness: dot(&slope, &slope).sqrt() }
    }

    fn at(&self, offset: &Point) -> f64 {
        self.at_base + dot(&self.slope, offset)
    }
}

/// Working memory of the search.
#[derive(Default)]
pub(super) struct Critical {
    /// Points whose hull holds the closest points of active sites.
    closest: Vec<Point>,
    /// Closest points of all sites, with their squared distances.
    weighted: Vec<(f64, Point)>,
    /// Corners of what the sites leave.
    rest: Vec<Point>,
    /// What sites cover, what V's cover, and the tetrahedron itself.
    sites: Vec<Affine>,
    functions: Vec<Affine>,
    weights: Vec<Affine>,
    open: Vec<(Point, f64)>,
}

impl Critical {
    /// Looks for critical points on the wrong side in what the sites leave of a tetrahedron, of which the corners are given, and notes the cubes that must be
    /// subdivided to bring them to the right one.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn search(
        &mut self,
        setting: &Setting,
        tree: &Tree<'_>,
        frame: &Frame,
        smooth: u16,
        nearby: &[Nearby],
        corners: &[Corner],
        surface: &mut BlockSurface,
    ) {
        if self.may_be(setting, tree, frame, nearby, corners) {
            self.prepare(frame, smooth, nearby);
            self.refine(setting, tree, frame, nearby, surface);
        }
    }

    /// Whether no plane parts what is left from the closest points of the sites that are active there.
    fn may_be(&mut self, setting: &Setting, tree: &Tree<'_>, frame: &Frame, nearby: &[Nearby], corners: &[Corner]) -> bool {
        if nearby.len() < 2 {
            return false;
        }
        let band = setting.bands[frame.level as usize] as f64;
        let least = |values: &[i64; 4]| -> f64 {
            corners.iter().map(|corner| (0..4).map(|k| corner.weights[k] * values[k] as f64).sum()).fold(f64::INFINITY, f64::min)
        };
        self.closest.clear();
        let mut active = 0;
        for nearby in nearby {
            if least(&nearby.half_space.values) <= band {
                active += 1;
                add_closest(&tree.site(nearby.site).site, &frame.positions, &mut self.closest);
            }
        }
        if active < 2 {
            return false;
        }
        self.rest.clear();
        self.rest.extend(corners.iter().map(|corner| place(&frame.positions, &corner.weights)));
        !are_parted(&self.rest, &self.closest)
    }

    fn prepare(&mut self, frame: &Frame, smooth: u16, nearby: &[Nearby]) {
        let affine = |values: [i64; 4]| Affine::new(&frame.positions, values.map(|value| value as f64));
        self.sites.clear();
        self.sites.extend(nearby.iter().map(|nearby| affine(nearby.half_space.values)));
        self.functions.clear();
        self.functions.extend(smooth::largest(smooth, frame.covered).map(|simplex| affine(frame.values_of(simplex))));
        self.weights.clear();
        self.weights.extend((0..4).map(|m| Affine::new(&frame.positions, std::array::from_fn(|k| f64::from(u8::from(k == m))))));
    }

    /// Branch and bound over boxes.
    fn refine(&mut self, setting: &Setting, tree: &Tree<'_>, frame: &Frame, nearby: &[Nearby], surface: &mut BlockSurface) {
        let low: Point = std::array::from_fn(|axis| self.rest.iter().map(|x| x[axis]).fold(f64::INFINITY, f64::min));
        let high: Point = std::array::from_fn(|axis| self.rest.iter().map(|x| x[axis]).fold(f64::NEG_INFINITY, f64::max));
        let half = (0..3).map(|axis| 0.5 * (high[axis] - low[axis])).fold(0.0, f64::max);
        let smallest = setting.lattice.pitch / f64::from(1 << (frame.level + 5));
        let mut open = std::mem::take(&mut self.open);
        open.clear();
        open.push((std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis])), half));
        let mut work = 0;
        while let Some((middle, half)) = open.pop() {
            let around = half * 3.0_f64.sqrt();
            work += 1;
            if self.is_settled(setting, tree, frame, nearby, &middle, around) {
                continue;
            }
            if half > smallest && work < MOST_WORK {
                let offset = |octant: u32, axis: usize| if octant >> axis & 1 == 1 { 0.5 * half } else { -0.5 * half };
                open.extend((0..8).map(|octant| (std::array::from_fn(|axis| middle[axis] + offset(octant, axis)), 0.5 * half)));
                continue;
            }
            let within = std::array::from_fn(|axis| (middle[axis] - setting.lattice.origin[axis]) / setting.lattice.pitch);
            if frame.level < LEVELS {
                surface.critical.push(Cube::containing(frame.level, within));
            } else {
                surface.uncertain.push(Cube::containing(0, within));
            }
        }
        self.open = open;
    }

    /// Whether the ball of radius `around` a point holds no critical point on the wrong side, as far as the tetrahedron reaches.
    fn is_settled(&mut self, setting: &Setting, tree: &Tree<'_>, frame: &Frame, nearby: &[Nearby], x: &Point, around: f64) -> bool {
        let offset = subtract(x, &frame.positions[0]);
        let below = |function: &Affine| function.at(&offset) + around * function.steepness < 0.0;
        let above = |function: &Affine| function.at(&offset) - around * function.steepness > 0.0;
        // What one site covers is inside, and its critical points have values below r.
        if self.weights.iter().any(below) || self.sites.iter().any(below) {
            return true;
        }
        self.weighted.clear();
        self.weighted.extend(nearby.iter().map(|nearby| {
            let site = tree.site(nearby.site);
            let closest = site.closest(x);
            (distance_squared(x, &closest) + site.deficit, closest)
        }));
        let distance = self.weighted.iter().map(|(square, _)| *square).fold(f64::INFINITY, f64::min).sqrt();
        if distance - around > setting.outer
            || (distance + around <= setting.reach && self.functions.iter().any(below))
            || (distance - around > setting.reach && self.functions.iter().all(above) && self.sites.iter().all(above))
        {
            return true;
        }
        // Closest points of other points of the ball are within `around` of these.
        let most = (distance + 2.0 * around).powi(2);
        self.closest.clear();
        self.closest.extend(self.weighted.iter().filter(|(square, _)| *square <= most).map(|(_, closest)| *closest));
        is_farther(x, &self.closest, 2.0 * around)
    }
}

/// Adds points whose hull holds the closest points of a site to all points of a tetrahedron.
///
/// For a segment these are the closest points to the vertices: the parameter is a clamped affine function. For a triangle the closest point is affine where one feature, the
/// face, a side or a corner, has it, and the regions of the features are convex. Where vertices are in several, the regions' borders cut the tetrahedron: the planes through the sides
/// across the face cut its edges in points that are added, and the other borders have their closest points at the triangle's corners.
fn add_closest(site: &Site, positions: &[Point; 4], closest: &mut Vec<Point>) {
    let corners = match site {
        Site::Point(point) => return closest.push(*point),
        Site::Segment(_) => return closest.extend(positions.iter().map(|x| site.closest(x))),
        Site::Triangle(corners) => corners,
    };
    let features: [(Point, Feature); 4] = std::array::from_fn(|k| closest_feature(&positions[k], &corners[0], &corners[1], &corners[2]));
    closest.extend(features.iter().map(|(point, _)| *point));
    if features.iter().all(|(_, feature)| *feature == features[0].1) {
        return;
    }
    let longest = (0..4).flat_map(|p| (0..p).map(move |q| distance_squared(&positions[p], &positions[q]))).fold(0.0, f64::max);
    // Closest points are no farther from each other than the points themselves.
    closest.extend(corners.iter().filter(|corner| distance_squared(corner, &features[0].0) <= longest * (1.0 + 1e-9)));
    let normal = cross(&subtract(&corners[1], &corners[0]), &subtract(&corners[2], &corners[0]));
    for k in 0..3 {
        let across = cross(&normal, &subtract(&corners[(k + 1) % 3], &corners[k]));
        let sides = positions.map(|x| dot(&across, &subtract(&x, &corners[k])));
        for p in 0..4 {
            for q in 0..p {
                if (sides[p] < 0.0) != (sides[q] < 0.0) {
                    let t = sides[p] / (sides[p] - sides[q]);
                    let x: Point = std::array::from_fn(|axis| positions[p][axis] + t * (positions[q][axis] - positions[p][axis]));
                    closest.push(site.closest(&x));
                }
            }
        }
    }
}

/// Whether a point is surely farther than `distance` from the convex hull of others.
fn is_farther(x: &Point, others: &[Point], distance: f64) -> bool {
    let Some(first) = others.first() else { return true };
    // The shortest vector found so far from the hull to x.
    let mut shortest = subtract(x, first);
    for _ in 0..STEPS {
        let square = dot(&shortest, &shortest);
        if square <= distance * distance {
            return false;
        }
        let along = |point: &&Point| dot(&shortest, point);
        let Some(farthest) = others.iter().max_by(|a, b| along(a).total_cmp(&along(b))) else { return true };
        let support = subtract(x, farthest);
        let product = dot(&shortest, &support);
        if product > 0.0 && product * product > distance * distance * square {
            return true;
        }
        let step = subtract(&support, &shortest);
        let share = (-dot(&shortest, &step) / dot(&step, &step).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        shortest = std::array::from_fn(|axis| shortest[axis] + share * step[axis]);
    }
    false
}

/// Whether a plane was found that parts two sets of points: Gilbert's search for the shortest difference (1966). When it gives up, there may be one yet.
fn are_parted(points: &[Point], others: &[Point]) -> bool {
    let mean = |points: &[Point]| -> Point {
        std::array::from_fn(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / points.len().max(1) as f64)
    };
    let mut shortest = subtract(&mean(points), &mean(others));
    for _ in 0..STEPS {
        let along = |point: &&Point| dot(&shortest, point);
        let first = points.iter().min_by(|a, b| along(a).total_cmp(&along(b)));
        let second = others.iter().max_by(|a, b| along(a).total_cmp(&along(b)));
        let (Some(first), Some(second)) = (first, second) else { return true };
        let support = subtract(first, second);
        let square = dot(&shortest, &shortest);
        if dot(&shortest, &support) > 1e-9 * square {
            return true;
        }
        let step = subtract(&support, &shortest);
        let share = (-dot(&shortest, &step) / dot(&step, &step).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        shortest = std::array::from_fn(|axis| shortest[axis] + share * step[axis]);
        if dot(&shortest, &shortest) <= 1e-18 * dot(&support, &support) {
            return false;
        }
    }
    false
}
