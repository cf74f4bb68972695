//! What is known of the common points of some bodies: of their dilations, of their polytopes, and of both together.
//!
//! How far a point is from the farthest of some figures is a convex function, and so is how high it is above the highest plane of some polytopes: see `ellipsoid` for whether they are anywhere low enough.

use super::cubes::Cube;
use super::ellipsoid::{Place, common_point, lowest};
use super::figure::Figure;
use super::polytopes::{self, Plane, Polytopes, height, normal};
use crate::attractor::cell::{Point, dot, subtract, unit};
use crate::dilation::convex::Convex;
use crate::dilation::setting::Setting;
use crate::solid::Inside;

/// Steps towards a common point, and how deep in all bodies it is sought, at first and at last, in units of the radius.
const STEPS: usize = 6;
const DEPTHS: [f64; 2] = [0.03, 0.001];

/// Two bodies one of which a step is made to, and then the other, whose directions have no more than this as their product, may be apart.
const FACING: f64 = -0.3;

/// Dilations of a set are parted where there is no place that is nearer than this to all of them, in units of the slack.
const LEAST_GAP: f64 = 64.0;

/// How far from the dilations planes are that part them, as a share of what is between: at least, and how much more at most.
const PARTING: [f64; 2] = [0.3, 0.4];

/// Ways from a figure that are longer than this, in units of the radius, have a direction: rounding turns it by so little that linear functions along it are right up to a fraction of the slack all over cubes that are no wider than this.
const STEADY: f64 = 0.25;
pub(super) const STEADY_CUBE: f64 = 8.0;

/// The axes of coordinates.
pub(super) const AXES: [Point; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The figures and what stands for them.
pub(super) struct Bodies<'a> {
    pub(super) setting: &'a Setting,
    pub(super) figures: &'a [Figure],
    pub(super) polytopes: &'a Polytopes,
    /// What their surfaces enclose belongs to the union, too.
    pub(super) solids: &'a [Inside<'a>],
}

/// Whether some bodies have a common point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Common {
    Some,
    None,
    Unknown,
}

/// Where some bodies are all around a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Hub {
    At(Point),
    /// Nowhere: the dilations of these two have no common point.
    Apart([u32; 2]),
    Unknown,
}

/// What is taken for a body.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    /// Its dilation by the band's inner end, which is in its polytope whatever that is like.
    Inner,
    /// Its dilation by the radius.
    Dilation,
    /// Its dilation by the band's outer end, which its polytope is in whatever that is like.
    Outer,
    Polytope,
}

/// A body that is near to a place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Near {
    /// The way to the place from the point of the figure that is closest to it.
    pub(super) way: Point,
    /// How long that is.
    distance: f64,
    /// How high the place is above the highest plane that the body's dilations are cut by, and that plane's normal.
    cut: (f64, Point),
}

impl Default for Near {
    fn default() -> Self {
        Self { way: [0.0; 3], distance: 0.0, cut: (f64::NEG_INFINITY, [0.0; 3]) }
    }
}

impl Bodies<'_> {
    /// Where a place is from a body.
    #[inline]
    pub(super) fn near(&self, body: u32, x: &Point) -> Near {
        let way = subtract(x, &self.figures[body as usize].closest(x));
        let mut cut = Near::default().cut;
        for plane in &self.polytopes.of(body).cuts {
            cut = higher(cut, (height(plane, x), normal(plane)));
        }
        Near { way, distance: dot(&way, &way).sqrt(), cut }
    }

    /// How far a place is beyond a body, or less, and where it is within, how far it is from being beyond, or less, as a negative number: a convex function, with a subgradient. Given is where the place is from the body.
    #[inline]
    pub(super) fn above_at(&self, kind: Kind, body: u32, x: &Point, near: &Near) -> (f64, Point) {
        let Some(radius) = self.radius(kind) else {
            return top(x, self.polytopes.of(body).planes.iter()).unwrap_or((f64::INFINITY, [0.0; 3]));
        };
        let Near { way, distance, cut } = *near;
        let beyond = distance - self.figures[body as usize].in_space(radius);
        if cut.0 > beyond {
            return cut;
        }
        (beyond, if distance > 0.0 { way.map(|part| part / distance) } else { way })
    }

    /// How high a place is above the one of some kinds of a body that it is highest above.
    pub(super) fn height(&self, kinds: &[Kind], body: u32, x: &Point) -> f64 {
        let near = self.near(body, x);
        kinds.iter().map(|&kind| self.above_at(kind, body, x, &near).0).fold(f64::NEG_INFINITY, f64::max)
    }

    /// The same of any place.
    #[cfg(test)]
    pub(super) fn above(&self, kind: Kind, body: u32, x: &Point) -> (f64, Point) {
        self.above_at(kind, body, x, &self.near(body, x))
    }

    /// How far a place is from being beyond what is inside of all kinds of a body, as a number below 0: it is no less deep in any, and planes of its polytope need not be asked. What is no less tells nothing.
    #[inline]
    pub(super) fn above_all(&self, body: u32, x: &Point, near: &Near) -> f64 {
        self.above_at(Kind::Inner, body, x, near).0
    }

    /// The radius of a dilation; none of a polytope.
    fn radius(&self, kind: Kind) -> Option<f64> {
        let Setting { least, reach, outer, .. } = *self.setting;
        match kind {
            Kind::Inner => Some(least),
            Kind::Dilation => Some(reach),
            Kind::Outer => Some(outer),
            Kind::Polytope => None,
        }
    }

    /// Whether any kind of a body may have places in a cube.
    pub(super) fn reaches(&self, kinds: &[Kind], body: u32, cube: &Cube, near: &Near) -> bool {
        let reaches = |kind: Kind| {
            let (above, away) = self.above_at(kind, body, &cube.centre, near);
            above <= cube.half_along(&away) + 4.0 * self.setting.slack
        };
        // What no polytope reaches needs no planes.
        kinds.iter().any(|&kind| (!matches!(kind, Kind::Polytope) || reaches(Kind::Outer)) && reaches(kind))
    }

    /// Whether a body may have places in one of the parts of a cube, for all that is known of where the cube's centre, `from`, is from it.
    ///
    /// The distance is convex: everywhere it is no less than it grows from there along its gradient. What is dropped is farther from the centre than the radius: so the gradient is known well enough for cubes up to [`STEADY_CUBE`].
    #[inline]
    pub(super) fn may_reach(&self, body: u32, cube: &Cube, from: &Point, Near { way, distance, .. }: &Near) -> bool {
        if cube.half > STEADY_CUBE * self.setting.reach {
            return true;
        }
        let radius = self.figures[body as usize].in_space(self.setting.outer) + 4.0 * self.setting.slack;
        distance * (distance - radius) + dot(way, &subtract(&cube.centre, from)) <= cube.half_along(way)
    }

    /// How high a cube's centre is above a body, or less, with the slope of a linear function that is below it all over the cube, up to the slack. Near to a figure rounding may turn the way from it, and the body is no lower than its radius anywhere.
    pub(super) fn below(&self, kind: Kind, body: u32, cube: &Cube, near: &Near) -> (f64, Point) {
        let is_steady = near.distance > STEADY * self.setting.reach;
        let near = if is_steady { *near } else { Near { way: [0.0; 3], distance: 0.0, ..*near } };
        self.above_at(kind, body, &cube.centre, &near)
    }

    /// At least how deep a cube's centre is inside of all kinds of a body, and exactly that but in polyhedra, and where it is deep enough for all of the cube; less than 0 where it is beyond one, and less than `least` where it is less deep, by whatever.
    pub(super) fn depth(&self, kinds: &[Kind], body: u32, cube: &Cube, near: &Near, least: f64) -> f64 {
        let sure = -self.above_all(body, &cube.centre, near);
        if sure > cube.half_diagonal() + self.setting.slack {
            return sure;
        }
        let mut depth = f64::INFINITY;
        for &kind in kinds {
            depth = depth.min(-self.above_at(kind, body, &cube.centre, near).0);
            if depth < least {
                break;
            }
        }
        depth
    }

    /// Whether a place is surely inside of all kinds of a body.
    pub(super) fn is_inside(&self, kinds: &[Kind], body: u32, x: &Point) -> bool {
        let (near, most) = (self.near(body, x), -self.setting.slack);
        self.above_all(body, x, &near) < most || kinds.iter().all(|&kind| self.above_at(kind, body, x, &near).0 < most)
    }

    /// Whether a body may be around all of a cube, as far as the linear function tells that is below it and touches it at the cube's centre: it is highest at a corner.
    #[inline]
    pub(super) fn may_hold(&self, kind: Kind, body: u32, cube: &Cube, near: &Near) -> bool {
        let (above, away) = self.above_at(kind, body, &cube.centre, near);
        above + cube.half_along(&away) < 0.0
    }

    /// How far a place is beyond the one of some bodies that it is farthest from, as [`Bodies::above_at`] tells, of the first kind of which that is no less than something; and which one that is.
    fn beyond(&self, kinds: &[Kind], set: &[u32], x: &Point, least: f64) -> Option<(f64, (Point, u32))> {
        kinds.iter().find_map(|&kind| {
            let above = |&body: &u32| {
                let near = self.near(body, x);
                if matches!(kind, Kind::Polytope) && self.above_all(body, x, &near) < least.min(0.0) {
                    return None;
                }
                let (above, away) = self.above_at(kind, body, x, &near);
                Some((above, (away, body)))
            };
            set.iter().filter_map(above).reduce(higher).filter(|&(above, _)| above >= least)
        })
    }

    /// How far a place is beyond the one of some bodies that it is farthest from.
    pub(super) fn farthest(&self, kind: Kind, set: &[u32], x: &Point) -> (f64, Point) {
        let beyond = self.beyond(&[kind], set, x, f64::NEG_INFINITY);
        beyond.map_or((0.0, [0.0; 3]), |(above, (away, _))| (above, away))
    }

    /// A place inside of all kinds of some bodies, if one is met on the way from x, step by step to where the one that it is farthest from is. Dilations are the first kind.
    pub(super) fn hub(&self, kinds: &[Kind], set: &[u32], mut x: Point) -> Hub {
        let Setting { reach, slack, .. } = *self.setting;
        let mut depth = DEPTHS[0] * reach;
        let mut last: Option<(Point, u32)> = None;
        for _ in 0..STEPS {
            let Some((above, (away, body))) = self.beyond(kinds, set, &x, -slack) else { return Hub::At(x) };
            if let Some((before, other)) = last.filter(|(before, _)| dot(before, &away) < FACING)
                && self.are_apart(kinds[0], [other, body], &unit(&subtract(&before, &away)))
            {
                return Hub::Apart([other, body]);
            }
            last = Some((away, body));
            x = std::array::from_fn(|axis| x[axis] - (above + depth) * away[axis]);
            depth = (0.5 * depth).max(DEPTHS[1] * reach);
        }
        Hub::Unknown
    }

    /// Whether planes across a direction show that dilations of two bodies have no common point, that of the first being below and the other's above.
    fn are_apart(&self, kind: Kind, bodies: [u32; 2], direction: &Point) -> bool {
        let radius = self.radius(kind).unwrap_or(f64::INFINITY);
        let [first, second] = bodies.map(|body| &self.figures[body as usize]);
        let gap = -second.highest(&direction.map(|part| -part)) - first.highest(direction);
        gap > first.in_space(radius) + second.in_space(radius) + self.setting.slack
    }

    /// Where in a box all kinds of some bodies have a common point: with some room around it, or with some to spare.
    pub(super) fn common(&self, kinds: &[Kind], set: &[u32], within: [Point; 2], spare: f64) -> Place {
        common_point(within, |x| self.beyond(kinds, set, x, spare).map(|(above, (away, _))| (above - spare, away)))
    }

    /// Whether the dilations of a set have a common point.
    pub(super) fn common_of_dilations(&self, set: &[u32]) -> Common {
        let (within, slack) = (self.within(set), self.setting.slack);
        if self.common(&[Kind::Dilation], set, within, slack) == Place::Nowhere {
            return Common::None;
        }
        let is_some = matches!(self.common(&[Kind::Dilation], set, within, -slack), Place::At(_));
        if is_some { Common::Some } else { Common::Unknown }
    }

    /// For dilations of a set that have no common point: planes that each of some bodies' dilations is below, while nothing is below all of these planes. None where that is so of those that are `known`, or where rounding leaves none.
    ///
    /// Let x be where the farthest body is nearest, and c_i the points closest to it of the figures that are as far. A mean of the unit vectors along x - c_i is 0, so that of how far y is beyond the planes across these is that at x, wherever y is: not all are less.
    pub(super) fn parting(&self, set: &[u32], known: &[Plane], seed: u64) -> Vec<(u32, Plane)> {
        let Setting { reach, slack, .. } = *self.setting;
        let within = self.within(set);
        let part = |planes: &[Plane]| common_point(within, |x| highest(x, planes.iter(), slack)) == Place::Nowhere;
        if part(known) {
            return Vec::new();
        }
        let lowest = lowest(within, |x| self.farthest(Kind::Dilation, set, x));
        let Some((x, gap)) = lowest.filter(|&(_, gap)| gap > LEAST_GAP * slack) else { return Vec::new() };
        let plane = |(place, &body): (usize, &u32)| {
            let figure = &self.figures[body as usize];
            let from = subtract(&x, &figure.closest(&x));
            let (away, radius) = (unit(&from), figure.in_space(reach));
            // Bodies may have their closest points in common.
            let share = PARTING[0] + PARTING[1] * polytopes::share(seed, place as u64);
            let offset = radius + share * gap + figure.highest(&away);
            let is_far = dot(&from, &from).sqrt() > radius + 0.5 * gap;
            is_far.then_some((body, [away[0], away[1], away[2], offset]))
        };
        let planes: Vec<(u32, Plane)> = set.iter().enumerate().filter_map(plane).collect();
        let all: Vec<Plane> = planes.iter().map(|&(_, plane)| plane).chain(self.cuts(set).copied()).collect();
        if part(&all) { planes } else { Vec::new() }
    }

    /// For dilations of a set that have a common point: those whose polytopes do not hold the place that is deepest in all; all where it is in all polytopes.
    pub(super) fn short(&self, set: &[u32]) -> Vec<u32> {
        let deepest = lowest(self.within(set), |x| self.farthest(Kind::Dilation, set, x));
        let is_short = |&&body: &&u32| deepest.is_none_or(|(x, _)| !self.is_inside(&[Kind::Polytope], body, &x));
        let short: Vec<u32> = set.iter().filter(is_short).copied().collect();
        if short.is_empty() { set.to_vec() } else { short }
    }

    /// The planes that dilations of a set are cut by.
    fn cuts(&self, set: &[u32]) -> impl Iterator<Item = &Plane> {
        set.iter().flat_map(|&body| self.polytopes.of(body).cuts.iter())
    }

    /// A box around what the dilations of a set, by the band's outer end, have in common.
    pub(super) fn within(&self, set: &[u32]) -> [Point; 2] {
        let Setting { outer, slack, .. } = *self.setting;
        common_box(&AXES, set.iter().map(|&body| self.around(body, outer + slack)))
    }

    /// A body's corners, and how far from their hull places are that are in its dilation by a radius.
    pub(super) fn around(&self, body: u32, radius: f64) -> (&[Point], f64) {
        let figure = &self.figures[body as usize];
        (figure.corners(), figure.in_space(radius))
    }
}

/// The box along some axes that parts have in common, each the hull of points and what is no farther from it than a length.
pub(super) fn common_box<'p>(axes: &[Point; 3], parts: impl Iterator<Item = (&'p [Point], f64)>) -> [Point; 2] {
    let mut common = [[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]];
    for (points, by) in parts {
        for (axis, direction) in axes.iter().enumerate() {
            let along = points.iter().map(|point| dot(direction, point));
            let [low, high] = along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
            (common[0][axis], common[1][axis]) = (common[0][axis].max(low - by), common[1][axis].min(high + by));
        }
    }
    common
}

/// The one with the larger number; the first of equal ones.
pub(super) fn higher<T>(a: (f64, T), b: (f64, T)) -> (f64, T) {
    if b.0 > a.0 { b } else { a }
}

/// How high a place is above the plane of some that it is highest above, and the plane's normal.
fn top<'p>(x: &Point, planes: impl Iterator<Item = &'p Plane>) -> Option<(f64, Point)> {
    let top = planes.map(|plane| (height(plane, x), plane)).reduce(higher);
    top.map(|(height, plane)| (height, normal(plane)))
}

/// The same, if it is higher than something, and by how much.
pub(super) fn highest<'p>(x: &Point, planes: impl Iterator<Item = &'p Plane>, than: f64) -> Option<(f64, Point)> {
    top(x, planes).filter(|&(height, _)| height > than).map(|(height, normal)| (height - than, normal))
}
