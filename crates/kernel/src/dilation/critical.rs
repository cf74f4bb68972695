//! Critical points of the distance that the solid has on the wrong side.
//!
//! A point x is critical when it lies in the convex hull of its closest points. By Morse theory the dilations change their topology only at the values of critical points,
//! and D(r) is, up to homotopy, D(s) with the hulls of those of values in (s, r] attached (Chazal, Cohen-Steiner and Lieutier, "A sampling theory for compact sets in Euclidean
//! space", 2009). The solid lies between D(s) and D(outer): every critical point of a value in (s, r] must be inside, and every one of a value in (r, outer] outside.
//!
//! That alone is not enough. In a tetrahedron the solid is where H = min L_i, affine functions, is below theta, and H has critical points of its own, where the origin is in the hull of the slopes of
//! those that are lowest: a void or a handle may be there that the distance does not know. So a place x where d^2 and H are on different sides of theta must have a direction w along which
//! both grow: w . (x - c) > 0 for all closest points c, and w . grad L_i > 0 for all that may be lowest. Then so do (1 - t) d^2 + t H for all t, and along a field of such directions
//! none of their level sets can change its topology: the solid has that of D(r). Directions are found tetrahedron by tetrahedron. On the faces between two of them one direction has to do for both:
//! the slopes of L_i for a point differ by sqrt(2) / 2 of an edge there ([`MARGIN`]). That much is not asked for: it costs half as much again, and that no two neighbours disagree is not shown.

use super::block::{Frame, Nearby};
use super::certificate::highest;
use super::lattice::{Cube, LEVELS};
use super::outside::Corner;
use super::parting::parting;
use super::plan::Setting;
use super::smooth::{self, MOST_NOISE};
use super::surface::BlockSurface;
use super::tree::Tree;
use crate::attractor::cell::{Point, Site, cross, distance_squared, dot, subtract};
use crate::measure::triangle::{Feature, closest_feature};

/// Boxes that the search in a tetrahedron may look at.
const MOST_WORK: usize = 4000;
/// Boxes are halved down to so many binary places below a cube's edge: where no critical point is they are settled long before, and a finer lattice costs far more than a smaller box.
const SMALLEST: u32 = 12;
/// By how much functions must grow in boxes that reach a face of the tetrahedron, in units of a cube's edge: half the gradients of squared distances of points differ by sqrt(2) / 4 there. Without a margin
/// one false void and some false handles were left of thousands of places in random trees and loose segments, with a tenth none.
const MARGIN: f64 = 0.1;
/// Boxes are halved along axes across which distances hardly vary, too, when they are so many times as long.
const LEAST_SLOPE: f64 = 0.15;

/// An affine function.
#[derive(Clone, Copy, Default)]
struct Affine {
    at_base: f64,
    slope: Point,
}

impl Affine {
    /// The function with these values at the vertices of a tetrahedron, about the first of them.
    fn new(positions: &[Point; 4], values: [f64; 4]) -> Self {
        let columns = [1, 2, 3].map(|k| subtract(&positions[k], &positions[0]));
        let dual = [cross(&columns[1], &columns[2]), cross(&columns[2], &columns[0]), cross(&columns[0], &columns[1])];
        let determinant = dot(&columns[0], &dual[0]);
        let slope: Point =
            std::array::from_fn(|axis| (0..3).map(|k| (values[k + 1] - values[0]) * dual[k][axis]).sum::<f64>() / determinant);
        Self { at_base: values[0], slope }
    }

    /// Its least and its largest value in a box.
    fn over(&self, offset: &Point, half: &Point) -> [f64; 2] {
        let (middle, range) = (self.at_base + dot(&self.slope, offset), range(&self.slope, half));
        [middle - range, middle + range]
    }
}

/// By how much a linear function with a slope varies in a box with these half sides, to either side.
fn range(slope: &Point, half: &Point) -> f64 {
    (0..3).map(|axis| slope[axis].abs() * half[axis]).sum()
}

/// A site seen from the middle of a box.
#[derive(Clone, Copy)]
struct View {
    site: u32,
    distance: f64,
    /// The gradient of the distance.
    slope: Point,
    /// From the closest point.
    away: Point,
    is_point: bool,
    /// Whether it may be the nearest somewhere in the box.
    is_near: bool,
}

/// Working memory of the search.
#[derive(Default)]
pub(super) struct Critical {
    /// Points whose hull holds the closest points of active sites.
    closest: Vec<Point>,
    /// Half the gradients of functions that may be lowest, in mm.
    slopes: Vec<Point>,
    /// How long half the gradients must be along a direction at faces, in mm.
    margin: f64,
    /// The unit of functions, in mm^2.
    unit: f64,
    /// Functions of sites, then of V's, at the corners of what is left.
    heights: Vec<f64>,
    /// The sites of a box.
    views: Vec<View>,
    /// What sites that are active cover, what V's cover that may be lowest, and the tetrahedron itself.
    sites: Vec<Affine>,
    functions: Vec<Affine>,
    weights: Vec<Affine>,
    open: Vec<Open>,
    /// Sites that may be nearest in the boxes that are open, as indices of those near the tetrahedron: one list behind the other.
    active: Vec<u32>,
    /// Those of them that may have the lowest function.
    lowest: Vec<u32>,
}

/// A box to be looked at.
#[derive(Clone, Copy)]
struct Open {
    middle: Point,
    /// Half its sides.
    half: Point,
    /// Its sites are those of `active` up to here, from `first` on.
    end: usize,
    first: usize,
}

impl Critical {
    /// Looks for critical points on the wrong side in what the sites leave of a tetrahedron, of which the corners and their places, `rest`, are given, and notes the cubes that must be
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
        rest: &[Point],
        surface: &mut BlockSurface,
    ) {
        self.margin = MARGIN * setting.lattice.pitch / f64::from(1 << frame.level);
        self.unit = setting.unit();
        self.choose(setting, frame, smooth, nearby, corners);
        if self.active.is_empty() || self.grow_along_one(tree, frame, nearby, rest) {
            return;
        }
        self.refine(setting, tree, frame, nearby, rest, surface);
    }

    /// Lists the functions that may be lowest in what is left, and the sites that may be nearest, where d^2 and H are on different sides of theta.
    ///
    /// With R the tetrahedron's circumradius, L_i <= d_i^2 - theta + R^2. Where d <= r the nearest site has L_i <= R^2, and so have those with the lowest function. Where a V is below 0 and d is
    /// between r and outer, the lowest functions are, too, and the nearest site has L_i <= outer^2 - theta + R^2, unless that V is no lower than a site's function: then d is at most r there.
    /// Functions are affine: one that is above another at all corners is nowhere lowest.
    fn choose(&mut self, setting: &Setting, frame: &Frame, smooth: u16, nearby: &[Nearby], corners: &[Corner]) {
        let count = corners.len();
        let heights = &mut self.heights;
        let add = |heights: &mut Vec<f64>, values: &[i64; 4]| {
            heights.extend(corners.iter().map(|corner| (0..4).map(|k| corner.weights[k] * values[k] as f64).sum::<f64>()));
        };
        // Sums of four products lose far less than a unit.
        let noise = (MOST_NOISE + 2) as f64;
        let [band, inner] = [&setting.bands, &setting.inner_bands].map(|bands| bands[frame.level as usize] as f64 + noise);
        heights.clear();
        self.active.clear();
        for (index, nearby) in nearby.iter().enumerate() {
            let start = heights.len();
            add(heights, &nearby.half_space.values);
            if heights[start..].iter().any(|&height| height <= band) {
                self.active.push(index as u32);
            } else {
                heights.truncate(start);
            }
        }
        let sites = heights.len();
        self.functions.clear();
        let affine = |values: [i64; 4]| Affine::new(&frame.positions, values.map(|value| value as f64));
        let mut band = inner;
        for simplex in smooth::largest(smooth, frame.covered) {
            let values = frame.values_of(simplex);
            let start = heights.len();
            add(heights, &values);
            let (others, own) = heights.split_at(start);
            let above =
                |by: f64| others[..sites].chunks_exact(count).any(|other| other.iter().zip(own).all(|(other, own)| own + by > *other));
            if !above(noise) && own.iter().any(|&height| height < 0.0) {
                band = setting.bands[frame.level as usize] as f64 + noise;
            }
            if !above(-1.0) {
                self.functions.push(affine(values));
            }
            heights.truncate(start);
        }
        let (mut kept, mut at) = (0, 0);
        self.lowest.clear();
        self.sites.resize(nearby.len(), Affine::default());
        let sites = &heights[..sites];
        let active = &mut self.active;
        for own in sites.chunks_exact(count) {
            let index = active[at];
            at += 1;
            if own.iter().all(|&height| height > band) {
                continue;
            }
            active[kept] = index;
            kept += 1;
            self.sites[index as usize] = affine(nearby[index as usize].half_space.values);
            let is_below = |other: &[f64]| other.iter().zip(own).all(|(other, own)| other + 1.0 < *own);
            if own.iter().any(|&height| height <= inner) && !sites.chunks_exact(count).any(is_below) {
                self.lowest.push(index);
            }
        }
        active.truncate(kept);
    }

    /// Whether the distance and all functions that may be lowest grow along one direction in all that is left.
    fn grow_along_one(&mut self, tree: &Tree<'_>, frame: &Frame, nearby: &[Nearby], rest: &[Point]) -> bool {
        self.closest.clear();
        for &index in &self.active {
            add_closest(&tree.site(nearby[index as usize].site).site, &frame.positions, &mut self.closest);
        }
        let lowest = self.lowest.iter().map(|&index| &self.sites[index as usize]).chain(&self.functions);
        set_slopes(&mut self.slopes, lowest, self.unit);
        let Some((point, other)) = rest.first().zip(self.closest.first()) else { return true };
        // The differences of all places and closest points hold half the distance's gradients.
        let lowest = |direction: &Point, backwards: &Point| {
            subtract(farthest(rest, backwards).unwrap_or(point), farthest(&self.closest, direction).unwrap_or(other))
        };
        avoids_origin(subtract(point, other), lowest, &self.slopes, self.margin)
    }

    /// Branch and bound over boxes, until one is found that is not settled.
    #[allow(clippy::too_many_arguments)]
    fn refine(&mut self, setting: &Setting, tree: &Tree<'_>, frame: &Frame, nearby: &[Nearby], rest: &[Point], surface: &mut BlockSurface) {
        let low: Point = std::array::from_fn(|axis| rest.iter().map(|x| x[axis]).fold(f64::INFINITY, f64::min));
        let high: Point = std::array::from_fn(|axis| rest.iter().map(|x| x[axis]).fold(f64::NEG_INFINITY, f64::max));
        let smallest = setting.lattice.pitch / f64::from(1 << (frame.level + SMALLEST));
        self.weights.clear();
        self.weights.extend((0..4).map(|m| Affine::new(&frame.positions, std::array::from_fn(|k| f64::from(u8::from(k == m))))));
        let mut open = std::mem::take(&mut self.open);
        open.clear();
        open.push(Open {
            middle: std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis])),
            half: std::array::from_fn(|axis| 0.5 * (high[axis] - low[axis])),
            first: 0,
            end: self.active.len(),
        });
        let mut work = 0;
        while let Some(Open { middle, half, first, end }) = open.pop() {
            work += 1;
            self.active.truncate(end);
            if self.is_settled(setting, tree, frame, nearby, &middle, &half, first) {
                continue;
            }
            let axis = self.widest(&half);
            if half[axis] > smallest && work < MOST_WORK {
                let (first, end) = (end, self.active.len());
                for side in [-0.5, 0.5] {
                    let (mut middle, mut half) = (middle, half);
                    middle[axis] += side * half[axis];
                    half[axis] *= 0.5;
                    open.push(Open { middle, half, first, end });
                }
                continue;
            }
            let within = std::array::from_fn(|axis| (middle[axis] - setting.lattice.origin[axis]) / setting.lattice.pitch);
            if frame.level < LEVELS {
                surface.critical.push(Cube::containing(frame.level, within));
            } else {
                surface.uncertain.push(Cube::containing(0, within));
            }
            // The tetrahedron will not be there again, or no level tells it.
            break;
        }
        self.open = open;
    }

    /// The axis along which a box is to be halved: where distances vary most.
    fn widest(&self, half: &Point) -> usize {
        let slope = |axis: usize| self.views.iter().map(|view| view.slope[axis].abs()).fold(LEAST_SLOPE, f64::max);
        let widths = [0, 1, 2].map(|axis| half[axis] * slope(axis));
        (0..3).max_by(|&a, &b| widths[a].total_cmp(&widths[b])).unwrap_or(0)
    }

    /// Whether a box holds no critical point on the wrong side, as far as the tetrahedron reaches. The sites that may be nearest in the box are those
    /// of `active` from `first` on; where it is not settled, those of them that indeed may be are appended.
    ///
    /// Distances are convex: d(y) is at least d(x) + slope . (y - x), and at most what it is at the worst corner. A site is nearest at a point only if its lower end there is no more than
    /// another's upper end.
    #[allow(clippy::too_many_arguments)]
    fn is_settled(
        &mut self,
        setting: &Setting,
        tree: &Tree<'_>,
        frame: &Frame,
        nearby: &[Nearby],
        x: &Point,
        half: &Point,
        first: usize,
    ) -> bool {
        let offset = subtract(x, &frame.positions[0]);
        let below = |function: &Affine| function.over(&offset, half)[1] < 0.0;
        let above = |function: &Affine| function.over(&offset, half)[0] > 0.0;
        // What one site covers is inside, and its critical points have values below r.
        if self.weights.iter().any(below) || self.active[first..].iter().any(|&site| below(&self.sites[site as usize])) {
            return true;
        }
        let lowest = self.active[first..].iter().map(|&site| &self.sites[site as usize]).chain(&self.functions);
        let lowest = lowest.map(|function| function.over(&offset, half)[1]).fold(f64::INFINITY, f64::min);
        let may_be_lowest = |function: &Affine| function.over(&offset, half)[0] <= lowest;
        let (active, views) = (&self.active, &mut self.views);
        views.clear();
        views.extend(active[first..].iter().map(|&index| {
            let site = tree.site(nearby[index as usize].site);
            let away = subtract(x, &site.closest(x));
            let distance = (dot(&away, &away) + site.deficit).sqrt();
            let slope = away.map(|part| part / distance.max(f64::MIN_POSITIVE));
            View { site: index, distance, slope, away, is_point: matches!(site.site, Site::Point(_)), is_near: false }
        }));
        let Some(nearest) = views.iter().min_by(|a, b| a.distance.total_cmp(&b.distance)).copied() else { return true };
        let site = tree.site(nearby[nearest.site as usize].site);
        let corner = |code: usize| std::array::from_fn(|axis| x[axis] + if code >> axis & 1 == 1 { half[axis] } else { -half[axis] });
        let high = (0..8).map(|code| site.distance_squared(&corner(code))).fold(0.0, f64::max).sqrt();
        views.iter_mut().for_each(|view| view.is_near = view.distance - range(&view.slope, half) <= high);
        let own = |view: &View| &self.sites[view.site as usize];
        views.retain(|view| view.is_near || may_be_lowest(own(view)));
        let near = || views.iter().filter(|view| view.is_near);
        let low = near().map(|view| view.distance - range(&view.slope, half)).fold(f64::INFINITY, f64::min);
        // A site that is nowhere nearest has L >= d^2 - theta > 0 where the others have d > r.
        if low > setting.outer
            || (high <= setting.reach && self.functions.iter().any(below))
            || (low > setting.reach && self.functions.iter().all(above) && near().all(|view| above(own(view))))
        {
            return true;
        }
        let low_functions = views.iter().map(own).chain(&self.functions).filter(|function| may_be_lowest(function));
        set_slopes(&mut self.slopes, low_functions, self.unit);
        let reaches_face = self.weights.iter().any(|weight| weight.over(&offset, half)[0] <= 0.0);
        let margin = if reaches_face { self.margin } else { 0.0 };
        // x less its closest point in a convex set moves no farther than x does; less a point it moves as x does.
        let around = dot(half, half).sqrt();
        let lowest = |direction: &Point, _: &Point| {
            let share = around / dot(direction, direction).sqrt();
            let in_box: Point = std::array::from_fn(|axis| half[axis].copysign(direction[axis]));
            let moved = |view: &View| subtract(&view.away, &if view.is_point { in_box } else { direction.map(|part| share * part) });
            let lowest = near().map(moved).min_by(|a, b| dot(direction, a).total_cmp(&dot(direction, b)));
            lowest.unwrap_or(nearest.away)
        };
        if avoids_origin(nearest.away, lowest, &self.slopes, margin)
            || (!reaches_face && is_beyond(views, &self.slopes, tree, nearby, x, half))
        {
            return true;
        }
        self.active.extend(self.views.iter().map(|view| view.site));
        false
    }
}

/// Whether all of a box lies beyond all sites that are near along one direction, along which the lowest functions grow: no point of it is then in a hull of points of these sites.
fn is_beyond(views: &[View], slopes: &[Point], tree: &Tree<'_>, nearby: &[Nearby], x: &Point, half: &Point) -> bool {
    let near = || views.iter().filter(|view| view.is_near);
    let direction = near().fold([0.0; 3], |sum: Point, view| std::array::from_fn(|axis| sum[axis] + view.slope[axis]));
    if slopes.iter().any(|slope| dot(slope, &direction) <= 0.0) {
        return false;
    }
    let least = dot(&direction, x) - range(&direction, half);
    let slack = 1e-12 * (dot(&direction, &direction) * dot(x, x)).sqrt();
    near().all(|view| highest(&tree.site(nearby[view.site as usize].site).site, &direction) + slack < least)
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

/// Half the gradients of functions.
fn set_slopes<'a>(slopes: &mut Vec<Point>, functions: impl Iterator<Item = &'a Affine>, unit: f64) {
    slopes.clear();
    slopes.extend(functions.map(|function| function.slope.map(|part| 0.5 * unit * part)));
}

/// Whether the hull of a convex set and some vectors is surely farther than `distance` from the origin. `lowest` finds the set's lowest point along a direction, which it has
/// backwards, too; `start` is in the hull.
fn avoids_origin(start: Point, lowest: impl Fn(&Point, &Point) -> Point, vectors: &[Point], distance: f64) -> bool {
    let lowest = |direction: &Point| {
        let backwards = direction.map(|part| -part);
        let point = lowest(direction, &backwards);
        let vector = farthest(vectors, &backwards).filter(|vector| dot(vector, direction) < dot(&point, direction));
        vector.copied().unwrap_or(point)
    };
    parting(start, distance, lowest, |direction, lowest| is_above(direction, lowest, distance)).is_some()
}

/// Whether a point is surely higher than `distance` along a direction.
fn is_above(direction: &Point, point: &Point, distance: f64) -> bool {
    let square = dot(direction, direction);
    dot(direction, point) > (distance * square.sqrt()).max(1e-9 * square)
}

/// The point that is farthest along a direction.
fn farthest<'a>(points: &'a [Point], direction: &Point) -> Option<&'a Point> {
    points.iter().max_by(|a, b| dot(direction, a).total_cmp(&dot(direction, b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split_mix;

    /// The distance of the origin from the hull of points: from the nearest of their triangles, unless it is in one of their tetrahedra.
    fn distance_from_hull(points: &[Point]) -> f64 {
        let count = points.len();
        let mut least = f64::INFINITY;
        for i in 0..count {
            for j in i..count {
                for k in j..count {
                    let (a, b, c) = (points[i], points[j], points[k]);
                    let nearest = closest_feature(&[0.0; 3], &a, &b, &c).0;
                    least = least.min(dot(&nearest, &nearest).sqrt());
                    for d in &points[k..] {
                        let volume =
                            |p: &Point, q: &Point, r: &Point, s: &Point| dot(&subtract(q, p), &cross(&subtract(r, p), &subtract(s, p)));
                        let all = volume(&a, &b, &c, d);
                        let zero = [0.0; 3];
                        let parts =
                            [volume(&zero, &b, &c, d), volume(&a, &zero, &c, d), volume(&a, &b, &zero, d), volume(&a, &b, &c, &zero)];
                        if all.abs() > 1e-12 && parts.iter().all(|part| part * all > 0.0) {
                            return 0.0;
                        }
                    }
                }
            }
        }
        least
    }

    #[test]
    fn hulls_are_apart_where_all_their_simplices_are() {
        let mut seed = 11_u64;
        let mut next = || {
            seed = seed.wrapping_add(split_mix::STEP);
            (split_mix::number(seed) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let (mut apart, mut missed) = (0, 0);
        for round in 0..20_000_u32 {
            let count = 1 + round as usize % 7;
            // About the origin or beside it, as a cloud, nearly in a plane, or nearly on a line.
            let (flat, thin) = ([1.0, 1e-3][round as usize / 7 % 2], [1.0, 1e-2][round as usize / 14 % 2]);
            let offset = 1.2 * next();
            let points: Vec<Point> = (0..count).map(|_| [next() + offset, thin * next() + 0.3 * offset, flat * next()]).collect();
            let (true_distance, distance) = (distance_from_hull(&points), 0.4 * next().abs());
            // One of them as the set.
            let found = avoids_origin(points[0], |_, _| points[0], &points[1..], distance);
            assert!(!found || true_distance > distance * (1.0 - 1e-9), "{points:?}: {true_distance} {distance}");
            if true_distance > 1.001 * distance + 1e-6 {
                apart += 1;
                missed += usize::from(!found);
            }
        }
        assert!(apart > 5_000 && missed * 1_000 < apart, "{missed} of {apart}");
    }
}
