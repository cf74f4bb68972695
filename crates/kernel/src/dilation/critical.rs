//! Critical points of the distance that the solid has on the wrong side.
//!
//! A point x is critical when it lies in the convex hull of its closest points. By Morse theory the dilations change their topology only at the values of critical points,
//! and D(r) is, up to homotopy, D(s) with the hulls of those of values in (s, r] attached (Chazal, Cohen-Steiner and Lieutier, "A sampling theory for compact sets in Euclidean
//! space", 2009). The solid lies between D(s) and D(outer): every critical point of a value in (s, r] must be inside, and every one of a value in (r, outer] outside.
//!
//! That alone is not enough. In a tetrahedron the solid is where H = min L_i, affine functions, is below theta, and its surface may have a void or a handle that the distance does not know.
//! Let D = D(r), S the solid, and Q the closure of where they differ. Both have one topology if
//!
//! * (A) no point of Q is critical, so that it has a direction w with w . (x - c) > 0 for all its closest points c, and
//! * (B) points of Q on the surface of S have one with w . n > 0, too, for the outward normals n of all facets there.
//!
//! For such a direction of a point serves those around it, as closest points and facets only become fewer nearby: a partition of unity joins them to a smooth field on Q. Backwards
//! along it the distance decreases at a rate that is bounded from below, and the surface is only crossed inwards. So what is in D only flows, without leaving D, until it enters S, and what is in S only, without leaving S, until it
//! enters D; where it enters depends continuously on where it starts, as the field is nowhere tangent. Both S and D are deformation retracts of their union, and have its components, handles and voids.
//!
//! (A) is shown here, tetrahedron by tetrahedron, (B) in `star`, vertex by vertex of the mesh, for all of the surface.

use super::affine::{Affine, range};
use super::block::Nearby;
use super::convex::{Convex, SiteSearch};
use super::frame::Frame;
use super::lattice::{Cube, LEVELS};
use super::outside::Corner;
use super::parting::{avoids_origin, farthest};
use super::setting::Setting;
use super::smooth::{self, MOST_NOISE};
use super::surface::BlockSurface;
use super::tree::{Tree, highest};
use crate::attractor::cell::{Point, Site, cross, distance_squared, dot, subtract};
use crate::budget::CancelToken;
use crate::measure::triangle::closest_feature;

/// Boxes that the search in a tetrahedron may look at.
const MOST_WORK: usize = 4000;
/// Boxes are halved down to so many binary places below a cube's edge: where no critical point is they are settled long before, and a finer lattice costs far more than a smaller box.
const SMALLEST: u32 = 12;
/// Boxes are halved along axes across which distances hardly vary, too, when they are so many times as long.
const LEAST_SLOPE: f64 = 0.15;

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
}

/// Working memory of the search.
pub(super) struct Critical<'a> {
    cancel: &'a CancelToken,
    /// Points whose hull holds the closest points of active sites.
    closest: Vec<Point>,
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

impl<'a> Critical<'a> {
    pub(super) fn new(cancel: &'a CancelToken) -> Self {
        Self {
            cancel,
            closest: Vec::new(),
            heights: Vec::new(),
            views: Vec::new(),
            sites: Vec::new(),
            functions: Vec::new(),
            weights: Vec::new(),
            open: Vec::new(),
            active: Vec::new(),
        }
    }

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
        self.choose(setting, frame, smooth, nearby, corners);
        if self.active.is_empty() || self.grows_along_one(tree, frame, nearby, rest) {
            return;
        }
        self.refine(setting, tree, frame, nearby, rest, surface);
    }

    /// Lists the V's that may be lowest in what is left, and the sites that may be nearest, where d^2 and H are on different sides of theta.
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
            if self.cancel.reason().is_some() {
                break;
            }
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
        }
        active.truncate(kept);
    }

    /// Whether the distance grows along one direction in all that is left.
    fn grows_along_one(&mut self, tree: &Tree<'_>, frame: &Frame, nearby: &[Nearby], rest: &[Point]) -> bool {
        self.closest.clear();
        for &index in &self.active {
            add_closest(&tree.site(nearby[index as usize].site).site, &frame.positions, &mut self.closest);
        }
        let Some((point, other)) = rest.first().zip(self.closest.first()) else { return true };
        // The differences of all places and closest points hold half the distance's gradients.
        let lowest = |direction: &Point, backwards: &Point| {
            subtract(farthest(rest, backwards).unwrap_or(point), farthest(&self.closest, direction).unwrap_or(other))
        };
        avoids_origin(subtract(point, other), lowest, &[], 0.0)
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
            if self.cancel.reason().is_some() {
                break;
            }
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
            let within = setting.lattice.within(&middle);
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
        let (active, views) = (&self.active, &mut self.views);
        views.clear();
        views.extend(active[first..].iter().map(|&index| {
            let site = tree.site(nearby[index as usize].site);
            let away = subtract(x, &site.closest(x));
            let distance = (dot(&away, &away) + site.deficit).sqrt();
            let slope = away.map(|part| part / distance.max(f64::MIN_POSITIVE));
            View { site: index, distance, slope, away, is_point: matches!(site.site, Site::Point(_)) }
        }));
        let Some(nearest) = views.iter().min_by(|a, b| a.distance.total_cmp(&b.distance)).copied() else { return true };
        let site = tree.site(nearby[nearest.site as usize].site);
        let corner = |code: usize| std::array::from_fn(|axis| x[axis] + if code >> axis & 1 == 1 { half[axis] } else { -half[axis] });
        let high = (0..8).map(|code| site.distance_squared(&corner(code))).fold(0.0, f64::max).sqrt();
        views.retain(|view| view.distance - range(&view.slope, half) <= high);
        let own = |view: &View| &self.sites[view.site as usize];
        let low = views.iter().map(|view| view.distance - range(&view.slope, half)).fold(f64::INFINITY, f64::min);
        // A site that is nowhere nearest has L >= d^2 - theta > 0 where the others have d > r.
        if low > setting.outer
            || (high <= setting.reach && self.functions.iter().any(below))
            || (low > setting.reach && self.functions.iter().all(above) && views.iter().all(|view| above(own(view))))
        {
            return true;
        }
        // x less its closest point in a convex set moves no farther than x does; less a point it moves as x does.
        let around = dot(half, half).sqrt();
        let lowest = |direction: &Point, _: &Point| {
            let share = around / dot(direction, direction).sqrt();
            let in_box: Point = std::array::from_fn(|axis| half[axis].copysign(direction[axis]));
            let moved = |view: &View| subtract(&view.away, &if view.is_point { in_box } else { direction.map(|part| share * part) });
            let lowest = views.iter().map(moved).min_by(|a, b| dot(direction, a).total_cmp(&dot(direction, b)));
            lowest.unwrap_or(nearest.away)
        };
        if avoids_origin(nearest.away, lowest, &[], 0.0) || is_beyond(views, tree, nearby, x, half) {
            return true;
        }
        self.active.extend(self.views.iter().map(|view| view.site));
        false
    }
}

/// Whether all of a box lies beyond all sites that are near along one direction: no point of it is then in a hull of points of these sites.
fn is_beyond(views: &[View], tree: &Tree<'_>, nearby: &[Nearby], x: &Point, half: &Point) -> bool {
    let direction = views.iter().fold([0.0; 3], |sum: Point, view| std::array::from_fn(|axis| sum[axis] + view.slope[axis]));
    let least = dot(&direction, x) - range(&direction, half);
    let slack = 1e-12 * (dot(&direction, &direction) * dot(x, x)).sqrt();
    views.iter().all(|view| highest(&tree.site(nearby[view.site as usize].site).site, &direction) + slack < least)
}

/// Adds points whose hull holds the closest points of a site to all points of the hull of some positions.
///
/// For a segment these are the closest points to the vertices: the parameter is a clamped affine function. For a triangle the closest point is affine where one feature, the
/// face, a side or a corner, has it, and the regions of the features are convex. Where vertices are in several, the regions' borders cut the hull: the planes through the sides
/// across the face cut its edges in points that are added, and the other borders have their closest points at the triangle's corners.
pub(super) fn add_closest(site: &Site, positions: &[Point], closest: &mut Vec<Point>) {
    let corners = match site {
        Site::Point(point) => return closest.push(*point),
        Site::Segment(_) => return closest.extend(positions.iter().map(|x| site.closest(x))),
        Site::Triangle(corners) => corners,
    };
    let (from, mut first) = (closest.len(), None);
    let mut is_one = true;
    for x in positions {
        let (point, feature) = closest_feature(x, &corners[0], &corners[1], &corners[2]);
        closest.push(point);
        is_one &= *first.get_or_insert(feature) == feature;
    }
    if is_one {
        return;
    }
    let count = positions.len();
    let longest = (0..count).flat_map(|p| (0..p).map(move |q| distance_squared(&positions[p], &positions[q]))).fold(0.0, f64::max);
    // Closest points are no farther from each other than the points themselves.
    let near = closest[from];
    closest.extend(corners.iter().filter(|corner| distance_squared(corner, &near) <= longest * (1.0 + 1e-9)));
    let normal = cross(&subtract(&corners[1], &corners[0]), &subtract(&corners[2], &corners[0]));
    for k in 0..3 {
        let across = cross(&normal, &subtract(&corners[(k + 1) % 3], &corners[k]));
        let side = |p: usize| dot(&across, &subtract(&positions[p], &corners[k]));
        for p in 0..count {
            for q in 0..p {
                let (from, to) = (side(p), side(q));
                if (from < 0.0) != (to < 0.0) {
                    let t = from / (from - to);
                    let x: Point = std::array::from_fn(|axis| positions[p][axis] + t * (positions[q][axis] - positions[p][axis]));
                    closest.push(site.closest(&x));
                }
            }
        }
    }
}
