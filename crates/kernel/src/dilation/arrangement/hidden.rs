//! Whether some bodies' common points are all within others, or in solids: told by halving boxes.

use super::bodies::{AXES, Bodies, Common, Kind, common_box, higher};
use super::cubes::{Cube, overlap};
use super::ellipsoid::{is_empty, low};
use super::figure::Polygon;
use crate::attractor::cell::{Point, between, cross, dot, subtract, unit};
use crate::dilation::setting::Setting;
use glam::DVec3;

/// What bodies are taken for.
const KINDS: [Kind; 2] = [Kind::Dilation, Kind::Polytope];
/// Boxes at most, and halvings of one, that are looked at for places that are not hidden; of halvings more beside solids, whose faces may be much longer than the radius.
const MOST_BOXES: usize = 4_000;
/// Boxes after which one such place is looked for.
const FEW_BOXES: usize = 64;
const HALVINGS: usize = 12;
const HALVINGS_IN_SOLIDS: usize = 40;
/// Bodies that are looked at in a box while a set is asked for, about.
const BODIES_PER_SET: usize = 8;
/// Of directions, as a share: their ends are places of the model less others, as far as the radius or more, or unit vectors.
const ROUNDING: f64 = 1e-9;
/// Boxes that are so many times as long as they are wide are halved where a body changes most, and as if it changed by this share of their sides at least.
const LONG: f64 = 4.0;
const LEAST_CHANGE: f64 = 1e-3;
/// Boxes no wider than this, in units of the radius, are not halved for the face of a solid across them, nor are they long.
const NARROW: f64 = 0.25;

/// Whether places that bodies have in common are hidden.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Hidden {
    All,
    /// One is surely not.
    NotAll,
    /// That was not told by so many boxes.
    Unknown,
}

impl Bodies<'_> {
    /// Whether the places in a cube that the dilations of a set have in common, unless they have none, and those that its polytopes have, are all in the interior of others, of their dilation and their polytope, or of solids. What reaches the cube is
    /// `around`. Adds to `asked` how many sets could have been asked for meanwhile.
    pub(super) fn hidden(&self, set: &[u32], common_points: Common, cube: &Cube, around: &[u32], asked: &mut usize) -> Hidden {
        let Setting { reach, slack, .. } = *self.setting;
        let corners: Vec<Point> = cube.corners().collect();
        let mut boxes = Boxes { set, cube, axes: self.axes(set[0]), kind: Kind::Dilation, left: 0, looked: 0 };
        let halvings = if self.solids.is_empty() { HALVINGS } else { HALVINGS_IN_SOLIDS };
        let mut hidden = |kind: Kind, most: usize| {
            if matches!(kind, Kind::Dilation) && common_points == Common::None {
                return Hidden::All;
            }
            (boxes.kind, boxes.left) = (kind, most);
            let of_polytope = |body: u32| (&*self.polytopes.of(body).corners, slack);
            let part = |&body: &u32| if matches!(kind, Kind::Polytope) { of_polytope(body) } else { self.around(body, reach + slack) };
            let common = common_box(&boxes.axes, set.iter().map(part).chain([(&*corners, slack)]));
            self.hidden_in(&mut boxes, common, around, halvings)
        };
        let hidden = all(KINDS.into_iter().map(|kind| match hidden(kind, FEW_BOXES) {
            Hidden::Unknown if self.is_one_exposed(kind, set, cube, around) => Hidden::NotAll,
            Hidden::Unknown => hidden(kind, MOST_BOXES),
            told => told,
        }));
        *asked += boxes.looked / BODIES_PER_SET;
        hidden
    }

    /// Whether a place in a cube is found that bodies of a set have in common and that is not hidden: where they only just have one, others hardly reach it, while boxes get too small before their centres are there.
    fn is_one_exposed(&self, kind: Kind, set: &[u32], cube: &Cube, around: &[u32]) -> bool {
        let within = overlap(cube.ends(), self.within(set));
        let deep = low(within, |x| self.farthest(kind, set, x)).filter(|&(_, above)| above <= 0.0);
        deep.is_some_and(|(x, _)| {
            let is_in_cube = (0..3).all(|axis| within[0][axis] <= x[axis] && x[axis] <= within[1][axis]);
            is_in_cube
                && !around.iter().any(|&body| self.is_inside(&KINDS, body, &x))
                && !self.solids.iter().any(|solid| solid.winding(DVec3::from_array(x)) > 0)
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

    /// Whether the places in a box that bodies of a set have in common are hidden, by one of those around or by a solid.
    fn hidden_in(&self, boxes: &mut Boxes<'_>, [low, high]: [Point; 2], around: &[u32], halvings: usize) -> Hidden {
        if is_empty(&[low, high]) {
            return Hidden::All;
        }
        boxes.left = boxes.left.saturating_sub(1);
        boxes.looked += around.len();
        let (size, slack) = (subtract(&high, &low), self.setting.slack);
        let centre = boxes.place(&between(&low, &high, 0.5));
        // All of the box is no farther from its centre, as a whole and along a direction, which rounding turns by some millionths of millionths.
        let half = 0.5 * dot(&size, &size).sqrt() * (1.0 + ROUNDING) + 2.0 * slack;
        let half_along =
            |direction: &Point| 0.5 * dot(&boxes.axes.map(|axis| dot(&axis, direction).abs()), &size) + ROUNDING * half + 2.0 * slack;
        let is_beyond = |axis: usize| (centre[axis] - boxes.cube.centre[axis]).abs() > boxes.cube.half + half_along(&AXES[axis]);
        if (0..3).any(is_beyond) {
            return Hidden::All;
        }
        let (mut highest, mut beyond) = (f64::NEG_INFINITY, None);
        for &body in boxes.set {
            let near = self.near(body, &centre);
            let mut above = self.above_all(body, &centre, &near);
            if above >= 0.0 {
                // Where no polytope is, planes need not be asked.
                for kind in [Kind::Outer, boxes.kind] {
                    let away;
                    (above, away) = self.above_at(kind, body, &centre, &near);
                    if above > half_along(&away) {
                        return Hidden::All;
                    }
                }
            }
            if above > highest {
                highest = above;
                beyond = Some(body).filter(|_| above > 0.0);
            }
        }
        let (mut across, mut is_centre_hidden) = (DVec3::ZERO, false);
        for solid in self.solids {
            let own = solid.across(&boxes.axes.map(DVec3::from_array), DVec3::from_array(low), DVec3::from_array(high));
            let is_centre_inside = || solid.winding(DVec3::from_array(centre)) > 0;
            if own.is_none() && is_centre_inside() {
                return Hidden::All;
            }
            across += own.unwrap_or_default();
            is_centre_hidden |= highest <= 0.0 && own.is_some() && is_centre_inside();
        }
        let corner = |number: usize| boxes.place(&std::array::from_fn(|axis| if number >> axis & 1 == 1 { high[axis] } else { low[axis] }));
        let (mut left, mut deepest) = (Vec::new(), f64::INFINITY);
        for &body in around {
            let near = self.near(body, &centre);
            // What is convex and holds the corners holds all, and at one of them it is as high as a linear function below it, or higher.
            let holds = |(above, away): (f64, Point)| {
                above < -half
                    || (above < -slack
                        && above + half_along(&away) < 0.0
                        && (0..8).all(|number| self.is_inside(&KINDS, body, &corner(number))))
            };
            if holds(self.above_at(Kind::Inner, body, &centre, &near)) {
                return Hidden::All;
            }
            let mut top = (f64::NEG_INFINITY, [0.0; 3]);
            let reaches = KINDS.into_iter().all(|kind| {
                let own = self.above_at(kind, body, &centre, &near);
                top = higher(top, own);
                own.0 < half_along(&own.1)
            });
            if !reaches {
                continue;
            }
            if holds(top) {
                return Hidden::All;
            }
            let above = top.0;
            left.push(body);
            if above < deepest {
                // Looked at first in the halves: it is likely to hide them.
                deepest = above;
                let last = left.len() - 1;
                left.swap(0, last);
            }
            is_centre_hidden |= above < -slack;
        }
        if highest <= 0.0 && !is_centre_hidden {
            // Beyond the cube others may hide it.
            let is_in_cube = (0..3).all(|axis| (centre[axis] - boxes.cube.centre[axis]).abs() <= boxes.cube.half);
            return if is_in_cube { Hidden::NotAll } else { Hidden::Unknown };
        }
        let has_none = left.is_empty() && self.solids.is_empty();
        if halvings == 0 || boxes.left == 0 || has_none {
            return Hidden::Unknown;
        }
        // Across solids' faces first, as long as that parts what is on both sides: along them, most of a box is inside, or near one face.
        let weight = |axis: usize| if size[axis] > NARROW * self.setting.reach { across[axis] } else { 0.0 };
        let is_beside = (0..3).any(|axis| weight(axis) > 0.0);
        // What is common to faces that hardly meet is as long as these, and each is around one side of it: so of long boxes across the body that is likely to tell, which is the one that the centre is beyond, or else the one that it is deepest in.
        let change = |axis: usize| {
            let by = |share: f64| -> Point { std::array::from_fn(|k| centre[k] + share * size[axis] * boxes.axes[axis][k]) };
            let heights = [-0.5, 0.0, 0.5].map(by);
            match (beyond, left.first()) {
                (Some(body), _) => {
                    let [low, middle, high] = heights.map(|x| self.height(&[boxes.kind], body, &x));
                    middle - low.min(high)
                }
                (None, Some(&body)) => {
                    let [low, middle, high] = heights.map(|x| self.height(&KINDS, body, &x));
                    low.max(high) - middle
                }
                (None, None) => size[axis],
            }
        };
        let longest = size[0].max(size[1]).max(size[2]);
        let is_long = longest > NARROW * self.setting.reach && longest > LONG * size[0].min(size[1]).min(size[2]);
        let length = |axis: usize| match () {
            () if is_beside => weight(axis) * size[axis],
            () if is_long => change(axis).max(LEAST_CHANGE * size[axis]),
            () => size[axis],
        };
        let lengths = [0, 1, 2].map(length);
        let axis = (0..3).max_by(|&a, &b| lengths[a].total_cmp(&lengths[b])).unwrap_or_default();
        let (mut below, mut above) = (high, low);
        let middle = 0.5 * (low[axis] + high[axis]);
        (below[axis], above[axis]) = (middle, middle);
        all([[low, below], [above, high]].into_iter().map(|part| self.hidden_in(boxes, part, &left, halvings - 1)))
    }
}

/// That of all, as far as the first that is not [`Hidden::All`] tells.
fn all(mut parts: impl Iterator<Item = Hidden>) -> Hidden {
    parts.find(|&part| part != Hidden::All).unwrap_or(Hidden::All)
}

/// Boxes along some axes, which are looked at for common points of a set.
struct Boxes<'s> {
    set: &'s [u32],
    /// What is beyond it does not matter.
    cube: &'s Cube,
    axes: [Point; 3],
    kind: Kind,
    /// How many more may be looked at.
    left: usize,
    /// Bodies that were looked at, box by box.
    looked: usize,
}

impl Boxes<'_> {
    /// The place with some coordinates.
    fn place(&self, along: &Point) -> Point {
        std::array::from_fn(|k| (0..3).map(|axis| along[axis] * self.axes[axis][k]).sum())
    }
}
