//! What is known of the common points of some bodies: of their dilations, of their polytopes, and of both together.
//!
//! How far a point is from the farthest of some figures is a convex function, and so is how high it is above the highest plane of some polytopes: whether they are anywhere low enough is told by the method of ellipsoids
//! (Yudin and Nemirovski, 1976; with deep cuts, Bland, Goldfarb and Todd, "The ellipsoid method: a survey", Oper. Res. 29, 1981). Whether some bodies' common points are all within others is told by halving boxes.

use super::figure::{Figure, Polygon};
use super::pieces::Lists;
use super::polytopes::{self, Plane, Polytopes, height, normal};
use crate::attractor::cell::{Point, between, cross, dot, subtract, unit};
use crate::dilation::convex::Convex;
use crate::dilation::plan::Setting;
use crate::solid::Inside;
use glam::DVec3;

/// Ellipsoids at most, to decide one question.
const MOST_ELLIPSOIDS: usize = 400;
/// Steps towards a common point, before.
const STEPS: usize = 12;
/// Rounding of the squares of ellipsoids, as a share of the largest: some hundred steps lose as many units of double precision.
const NOISE: f64 = 1e-13;
/// Boxes at most, and halvings of one, that are looked at for places that are not hidden; of halvings more beside solids, whose faces may be much longer than the radius.
const MOST_BOXES: usize = 4_000;
const HALVINGS: usize = 12;
const HALVINGS_IN_SOLIDS: usize = 40;
/// Of directions, as a share: their ends are places of the model less others, as far as the radius or more, or unit vectors.
const ROUNDING: f64 = 1e-9;
/// Boxes no wider than this, in units of the radius, are not halved for the face of a solid across them.
const NARROW: f64 = 0.25;

/// Dilations of a set are parted where there is no place that is nearer than this to all of them, in units of the slack.
const LEAST_GAP: f64 = 64.0;

/// How far from the dilations planes are that part them, as a share of what is between: at least, and how much more at most.
const PARTING: [f64; 2] = [0.3, 0.4];

/// The axes of coordinates.
const AXES: [Point; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The figures and what stands for them.
pub(super) struct Bodies<'a> {
    pub(super) setting: &'a Setting,
    pub(super) figures: &'a [Figure],
    pub(super) polytopes: &'a Polytopes,
    pub(super) near: &'a Lists,
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

/// What is known of a set.
pub(super) struct Verdict {
    /// Of the dilations.
    pub(super) common: Common,
    /// Whether it was not shown that the polytopes have a common point exactly when the dilations have one, and that both then have one together.
    pub(super) is_doubtful: bool,
    /// A place in all dilations by the band's inner end, if one was met: it is in all polytopes, too.
    pub(super) hub: Option<Point>,
}

/// What a body is asked for.
#[derive(Clone, Copy)]
enum Kind {
    Dilation,
    Polytope,
}

impl Bodies<'_> {
    /// Whether a place is surely in the dilation of a body by the band's inner end.
    pub(super) fn is_in(&self, body: u32, x: &Point) -> bool {
        let Setting { least, slack, .. } = *self.setting;
        let is_cut_off = || self.polytopes.of(body).cuts.iter().any(|plane| height(plane, x) > -slack);
        self.figures[body as usize].distance_squared(x).sqrt() + slack < least && !is_cut_off()
    }

    /// What is known of a set.
    pub(super) fn verdict(&self, set: &[u32]) -> Verdict {
        let settled = |common: Common| Verdict { common, is_doubtful: false, hub: None };
        let Setting { reach, outer, slack, .. } = *self.setting;
        let within = self.within(set);
        if is_empty(&within) {
            return settled(Common::None);
        }
        let planes = |x: &Point, than: f64| highest(x, set.iter().flat_map(|&body| self.polytopes.of(body).planes.iter()), than);
        let far = match self.hub(set, between(&within[0], &within[1], 0.5)) {
            Ok(hub) => return Verdict { hub: Some(hub), ..settled(Common::Some) },
            Err(far) => far,
        };
        if far > outer && common_point(within, |x| self.beyond(set, x, outer + slack)) == Common::None {
            return settled(Common::None);
        }
        if common_point(within, |x| self.beyond(set, x, reach - slack).or_else(|| planes(x, -slack))) == Common::Some {
            return settled(Common::Some);
        }
        if common_point(within, |x| self.beyond(set, x, reach + slack)) == Common::None {
            let is_doubtful = common_point(within, |x| planes(x, slack)) != Common::None;
            return Verdict { is_doubtful, ..settled(Common::None) };
        }
        let is_common = common_point(within, |x| self.beyond(set, x, reach - slack)) == Common::Some;
        Verdict { common: if is_common { Common::Some } else { Common::Unknown }, is_doubtful: true, hub: None }
    }

    /// For dilations of a set that have no common point: planes that each of some bodies' dilations is below, while nothing is below all of these planes. None where that is so of those that are `known`, or where rounding leaves none.
    ///
    /// Let x be where the farthest body is nearest, and c_i the points closest to it of the figures that are as far. A mean of the unit vectors along x - c_i is 0, so that of how far y is beyond the planes across these is that at x, wherever y is: not all are less.
    pub(super) fn parting(&self, set: &[u32], known: &[Plane], seed: u64) -> Vec<(u32, Plane)> {
        let Setting { reach, slack, .. } = *self.setting;
        let within = self.within(set);
        let part = |planes: &[Plane]| common_point(within, |x| highest(x, planes.iter(), slack)) == Common::None;
        if part(known) {
            return Vec::new();
        }
        let beyond = |x: &Point| set.iter().map(|&body| self.above(Kind::Dilation, body, x)).reduce(higher);
        let lowest = lowest(within, |x| beyond(x).unwrap_or((0.0, [0.0; 3])));
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

    /// The farthest figure of a set, and how far it is, the deficit included.
    fn farthest(&self, set: &[u32], x: &Point) -> Option<(f64, &Figure)> {
        let far = set.iter().map(|&body| &self.figures[body as usize]).map(|figure| (figure.distance_squared(x), figure));
        far.reduce(higher).map(|(square, figure)| (square.sqrt(), figure))
    }

    /// The highest plane that dilations of a set are cut by, if it is higher than something.
    fn cut_off(&self, set: &[u32], x: &Point, than: f64) -> Option<(f64, Point)> {
        highest(x, self.cuts(set), than)
    }

    /// The planes that dilations of a set are cut by.
    fn cuts(&self, set: &[u32]) -> impl Iterator<Item = &Plane> {
        set.iter().flat_map(|&body| self.polytopes.of(body).cuts.iter())
    }

    /// A place in the dilations of a set by the band's inner end, or how far the farthest site is from where none was met. Steps towards the farthest site end where the farthest is nearest; where that is cut off, the way
    /// leads to the plane.
    fn hub(&self, set: &[u32], mut x: Point) -> Result<Point, f64> {
        let Setting { least, slack, .. } = *self.setting;
        let mut far = f64::INFINITY;
        for step in 0..STEPS {
            let Some((distance, figure)) = self.farthest(set, &x) else { break };
            far = distance;
            if distance + slack >= least {
                x = between(&x, &figure.closest(&x), 1.0 / (step + 2) as f64);
                continue;
            }
            let Some((above, normal)) = self.cut_off(set, &x, -slack) else { return Ok(x) };
            x = std::array::from_fn(|axis| x[axis] - (above + 3.0 * slack) * normal[axis]);
        }
        Err(far)
    }

    /// How far a place is beyond the dilations of a set by a distance, with a subgradient; none where it is in all of them.
    fn beyond(&self, set: &[u32], x: &Point, by: f64) -> Option<(f64, Point)> {
        let (distance, figure) = self.farthest(set, x)?;
        if distance > by {
            return Some((distance - by, subtract(x, &figure.closest(x)).map(|part| part / distance)));
        }
        self.cut_off(set, x, by - self.setting.reach)
    }

    /// A box around what the dilations of a set have in common.
    fn within(&self, set: &[u32]) -> [Point; 2] {
        let Setting { outer, slack, .. } = *self.setting;
        common_box(&AXES, set.iter().map(|&body| self.around(body, outer + slack)))
    }

    /// A body's corners, and how far from their hull places are that are in its dilation by a radius.
    fn around(&self, body: u32, radius: f64) -> (&[Point], f64) {
        let figure = &self.figures[body as usize];
        (figure.corners(), figure.in_space(radius))
    }

    /// Whether the places that the dilations of a set have in common, unless they have none, and those that its polytopes have, are all in the interior of others, of their dilation and their polytope, or of solids.
    pub(super) fn is_hidden(&self, set: &[u32], common_points: Common) -> bool {
        let around: Vec<u32> = self.near.of(set[0]).iter().copied().chain([set[0]]).collect();
        let Setting { reach, slack, .. } = *self.setting;
        let mut boxes = Boxes { set, axes: self.axes(set[0]), kind: Kind::Dilation, left: MOST_BOXES };
        let halvings = if self.solids.is_empty() { HALVINGS } else { HALVINGS_IN_SOLIDS };
        [Kind::Dilation, Kind::Polytope].into_iter().all(|kind| {
            boxes.kind = kind;
            let part = |&body: &u32| match kind {
                Kind::Dilation => self.around(body, reach + slack),
                Kind::Polytope => (&*self.polytopes.of(body).corners, slack),
            };
            let common = common_box(&boxes.axes, set.iter().map(part));
            (matches!(kind, Kind::Dilation) && common_points == Common::None) || self.are_hidden(&mut boxes, common, &around, halvings)
        })
    }

    /// Orthonormal axes along which what a body has in common with others is likely to be narrow: those of a polygon's plane and its longest side.
    pub(super) fn axes(&self, body: u32) -> [Point; 3] {
        let of_polygon = |polygon: &Polygon| {
            let sides = polygon.sides().map(|[from, to]| subtract(&to, &from));
            let longest = sides.max_by(|a, b| dot(a, a).total_cmp(&dot(b, b))).unwrap_or_default();
            // Corners are in the plane up to rounding, of which short sides would make an angle.
            let rise = dot(&longest, &polygon.up);
            let along = unit(&std::array::from_fn(|axis| longest[axis] - rise * polygon.up[axis]));
            [along, cross(&polygon.up, &along), polygon.up]
        };
        let axes = self.figures[body as usize].polygon().filter(|polygon| !polygon.is_needle()).map(of_polygon);
        axes.unwrap_or(AXES)
    }

    /// How far a place is beyond a body, or less, and where it is within, how far it is from being beyond, or less, as a negative number: a convex function, with a subgradient.
    fn above(&self, kind: Kind, body: u32, x: &Point) -> (f64, Point) {
        let (figure, polytope) = (&self.figures[body as usize], self.polytopes.of(body));
        let (planes, beyond) = match kind {
            Kind::Dilation => {
                let from = subtract(x, &figure.closest(x));
                let distance = dot(&from, &from).sqrt();
                let away = if distance > 0.0 { from.map(|part| part / distance) } else { from };
                (&polytope.cuts, (distance - figure.in_space(self.setting.reach), away))
            }
            Kind::Polytope => (&polytope.planes, (f64::NEG_INFINITY, [0.0; 3])),
        };
        top(x, planes.iter()).filter(|&(height, _)| height > beyond.0).unwrap_or(beyond)
    }

    /// Whether the places in a box that bodies of a set have in common are all hidden, by one of those around or by a solid.
    fn are_hidden(&self, boxes: &mut Boxes<'_>, [low, high]: [Point; 2], around: &[u32], halvings: usize) -> bool {
        if is_empty(&[low, high]) {
            return true;
        }
        boxes.left = boxes.left.saturating_sub(1);
        let (size, slack) = (subtract(&high, &low), self.setting.slack);
        let centre = boxes.place(&between(&low, &high, 0.5));
        // All of the box is no farther from its centre, as a whole and along a direction, which rounding turns by some millionths of millionths.
        let half = 0.5 * dot(&size, &size).sqrt() * (1.0 + ROUNDING) + 2.0 * slack;
        let half_along =
            |direction: &Point| 0.5 * dot(&boxes.axes.map(|axis| dot(&axis, direction).abs()), &size) + ROUNDING * half + 2.0 * slack;
        let mut highest = f64::NEG_INFINITY;
        for &body in boxes.set {
            let (above, away) = self.above(boxes.kind, body, &centre);
            if above > half_along(&away) {
                return true;
            }
            highest = highest.max(above);
        }
        let (mut across, mut is_centre_hidden) = (DVec3::ZERO, false);
        for solid in self.solids {
            let own = solid.across(&boxes.axes.map(DVec3::from_array), DVec3::from_array(low), DVec3::from_array(high));
            let is_centre_inside = || solid.winding(DVec3::from_array(centre)) > 0;
            if own.is_none() && is_centre_inside() {
                return true;
            }
            across += own.unwrap_or_default();
            is_centre_hidden |= highest <= 0.0 && own.is_some() && is_centre_inside();
        }
        let corner = |number: usize| boxes.place(&std::array::from_fn(|axis| if number >> axis & 1 == 1 { high[axis] } else { low[axis] }));
        let holds = |body: u32, x: &Point| [Kind::Dilation, Kind::Polytope].iter().all(|&kind| self.above(kind, body, x).0 < -slack);
        let mut left = Vec::new();
        for &body in around {
            let [own, of_polytope] = [Kind::Dilation, Kind::Polytope].map(|kind| self.above(kind, body, &centre));
            if own.0 >= half_along(&own.1) || of_polytope.0 >= half_along(&of_polytope.1) {
                continue;
            }
            let above = own.0.max(of_polytope.0);
            // What is convex and holds the corners holds all.
            if above < -half || (above < -slack && (0..8).all(|number| holds(body, &corner(number)))) {
                return true;
            }
            left.push(body);
            is_centre_hidden |= above < -slack;
        }
        let has_none = left.is_empty() && self.solids.is_empty();
        if halvings == 0 || boxes.left == 0 || has_none || (highest <= 0.0 && !is_centre_hidden) {
            return false;
        }
        // Across solids' faces first, as long as that parts what is on both sides: along them, most of a box is inside, or near one face.
        let weight = |axis: usize| if size[axis] > NARROW * self.setting.reach { across[axis] } else { 0.0 };
        let is_beside = (0..3).any(|axis| weight(axis) > 0.0);
        let length = |axis: usize| if is_beside { weight(axis) * size[axis] } else { size[axis] };
        let axis = (0..3).max_by(|&a, &b| length(a).total_cmp(&length(b))).unwrap_or_default();
        let (mut below, mut above) = (high, low);
        let middle = 0.5 * (low[axis] + high[axis]);
        (below[axis], above[axis]) = (middle, middle);
        [[low, below], [above, high]].into_iter().all(|part| self.are_hidden(boxes, part, &left, halvings - 1))
    }
}

/// Boxes along some axes, which are looked at for common points of a set.
struct Boxes<'s> {
    set: &'s [u32],
    axes: [Point; 3],
    kind: Kind,
    /// How many more may be looked at.
    left: usize,
}

impl Boxes<'_> {
    /// The place with some coordinates.
    fn place(&self, along: &Point) -> Point {
        std::array::from_fn(|k| (0..3).map(|axis| along[axis] * self.axes[axis][k]).sum())
    }
}

/// The box along some axes that parts have in common, each the hull of points and what is no farther from it than a length.
fn common_box<'p>(axes: &[Point; 3], parts: impl Iterator<Item = (&'p [Point], f64)>) -> [Point; 2] {
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

/// Whether nothing is in a box.
fn is_empty([low, high]: &[Point; 2]) -> bool {
    (0..3).any(|axis| low[axis] > high[axis])
}

/// The one with the larger number; the first of equal ones.
fn higher<T>(a: (f64, T), b: (f64, T)) -> (f64, T) {
    if b.0 > a.0 { b } else { a }
}

/// How high a place is above the plane of some that it is highest above, and the plane's normal.
fn top<'p>(x: &Point, planes: impl Iterator<Item = &'p Plane>) -> Option<(f64, Point)> {
    let top = planes.map(|plane| (height(plane, x), plane)).reduce(higher);
    top.map(|(height, plane)| (height, normal(plane)))
}

/// The same, if it is higher than something, and by how much.
fn highest<'p>(x: &Point, planes: impl Iterator<Item = &'p Plane>, than: f64) -> Option<(f64, Point)> {
    top(x, planes).filter(|&(height, _)| height > than).map(|(height, normal)| (height - than, normal))
}

/// About where in a box a convex function is lowest, and its value there; `above` gives it with a subgradient. Ellipsoids hold the places where it is lower than at any before, and begin anew in smaller boxes, which rounding does less to; none where the box is empty.
fn lowest([low, high]: [Point; 2], above: impl Fn(&Point) -> (f64, Point)) -> Option<(Point, f64)> {
    if is_empty(&[low, high]) {
        return None;
    }
    let mut best = (between(&low, &high, 0.5), f64::INFINITY);
    for share in ZOOM {
        let half: Point = std::array::from_fn(|axis| 0.5 * share * (high[axis] - low[axis]));
        let [from, to] = [-1.0, 1.0].map(|side| std::array::from_fn(|axis| best.0[axis] + side * half[axis]));
        let mut ellipsoid = Ellipsoid::around(&from, &to);
        for _ in 0..MOST_ELLIPSOIDS {
            let (value, slope) = above(&ellipsoid.centre);
            if value < best.1 {
                best = (ellipsoid.centre, value);
            }
            if !matches!(ellipsoid.cut(value - best.1, &slope), Left::Some) {
                break;
            }
        }
    }
    Some(best)
}

/// Sides of the boxes where the lowest place is sought, as shares of the first.
const ZOOM: [f64; 3] = [1.0, 1e-3, 1e-6];

/// Whether convex functions are all at most 0 somewhere in a box. `above` gives, for a place where one is not, its value and a subgradient there that is no longer than 1.
///
/// The ellipsoid {y: (y - x)^T P^-1 (y - x) <= 1} holds all places of the box where they are; there the function is at least f(x) - sqrt(g^T P g).
fn common_point([low, high]: [Point; 2], above: impl Fn(&Point) -> Option<(f64, Point)>) -> Common {
    let mut ellipsoid = Ellipsoid::around(&low, &high);
    for _ in 0..MOST_ELLIPSOIDS {
        let Some((value, slope)) = above(&ellipsoid.centre) else { return Common::Some };
        match ellipsoid.cut(value, &slope) {
            Left::Some => {}
            Left::None => return Common::None,
            Left::Little => break,
        }
    }
    Common::Unknown
}

/// {y: (y - x)^T P^-1 (y - x) <= 1}.
struct Ellipsoid {
    /// x.
    centre: Point,
    /// P.
    shape: [Point; 3],
}

/// What is left of an ellipsoid.
enum Left {
    Some,
    /// Not enough to go on with.
    Little,
    None,
}

impl Ellipsoid {
    /// The ball around a box is an ellipsoid with the sides' half lengths times the root of 3.
    fn around(low: &Point, high: &Point) -> Self {
        let mut shape = [[0.0; 3]; 3];
        (0..3).for_each(|axis| shape[axis][axis] = 0.75 * (high[axis] - low[axis]).powi(2) * (1.0 + 1e-9) + f64::MIN_POSITIVE);
        Self { centre: between(low, high, 0.5), shape }
    }

    /// Cuts off the places where a function is not lower by `value` than at the centre, with the subgradient `slope` there, which is no longer than 1.
    fn cut(&mut self, value: f64, slope: &Point) -> Left {
        let Self { centre: x, shape } = self;
        let image = shape.map(|row| dot(&row, slope));
        let square = dot(slope, &image);
        // What rounding makes of an ellipsoid that is thin in some direction: there it proves nothing.
        let noise = NOISE * (0..3).map(|axis| shape[axis][axis]).sum::<f64>();
        if value > (square.max(0.0) + noise).sqrt() * (1.0 + 1e-9) {
            return Left::None;
        }
        if square <= noise {
            return Left::Little;
        }
        let reach = square.sqrt();
        let depth = value / reach;
        if depth >= 1.0 {
            return Left::Little;
        }
        let step = (1.0 + 3.0 * depth) / 4.0;
        let grown = 9.0 / 8.0 * (1.0 - depth * depth) * (1.0 + 1e-12);
        let flattened = 2.0 * (1.0 + 3.0 * depth) / (4.0 * (1.0 + depth));
        for axis in 0..3 {
            x[axis] -= step * image[axis] / reach;
        }
        *shape =
            std::array::from_fn(|p| std::array::from_fn(|q| grown * (shape[p][q] - flattened * image[p] * image[q] / (reach * reach))));
        Left::Some
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split_mix::Random;

    /// Two slabs across each other whose common part is thin: places in it may not be found, but are never said not to be.
    #[test]
    fn what_is_thin_is_not_nothing() {
        let mut random = Random(17);
        let mut unit = move || (random.next() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
        let mut vector = move || -> Point {
            let way: Point = std::array::from_fn(|_| unit());
            let length = dot(&way, &way).sqrt();
            way.map(|part| part / length)
        };
        let mut found = 0;
        for size in [3.0, 100.0] {
            for thickness in [1e-3, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9] {
                for _ in 0..100 {
                    let (first, second, at) = (vector(), vector(), vector().map(|x| 0.4 * size * x));
                    let planes: Vec<Plane> = [first, first.map(|x| -x), second, second.map(|x| -x)]
                        .into_iter()
                        .map(|[a, b, c]| [a, b, c, dot(&[a, b, c], &at) + 0.5 * thickness])
                        .collect();
                    let common = common_point([[-size; 3], [size; 3]], |x| highest(x, planes.iter(), 0.0));
                    assert_ne!(common, Common::None, "{size} {thickness}");
                    found += usize::from(common == Common::Some);
                }
            }
        }
        assert!(found > 300, "{found}");
    }

    /// Where a convex function is lowest, and how low: distances from a point, and the farthest of some.
    #[test]
    fn the_lowest_place_is_found() {
        let mut random = Random(23);
        for _ in 0..200 {
            let mut vector = || -> Point { std::array::from_fn(|_| 2.0 * random.share() - 1.0) };
            let (a, b) = (vector(), vector());
            let of = |x: &Point, from: &Point| {
                let way = subtract(x, from);
                let length = dot(&way, &way).sqrt();
                (length, if length > 0.0 { way.map(|part| part / length) } else { way })
            };
            let farthest = |x: &Point| if of(x, &a).0 > of(x, &b).0 { of(x, &a) } else { of(x, &b) };
            let (x, value) = lowest([[-1.5; 3], [1.5; 3]], farthest).expect("the box is not empty");
            let half = 0.5 * of(&a, &b).0;
            assert!((value - half).abs() < 1e-9 && of(&x, &between(&a, &b, 0.5)).0 < 1e-6, "{value} {half}");
        }
        assert!(lowest([[1.0; 3], [0.0; 3]], |_| (0.0, [0.0; 3])).is_none());
    }
}
