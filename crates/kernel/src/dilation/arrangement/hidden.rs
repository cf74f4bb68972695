//! Whether some bodies' common points are all within others, or in solids: told by halving boxes.

use super::bodies::{AXES, Bodies, Common, Kind, common_box, higher};
use super::cubes::Cube;
use super::ellipsoid::is_empty;
use super::figure::Polygon;
use crate::attractor::cell::{Point, between, cross, dot, subtract, unit};
use crate::dilation::setting::Setting;
use glam::DVec3;

/// What bodies are taken for.
const KINDS: [Kind; 2] = [Kind::Dilation, Kind::Polytope];
/// Boxes at most, and halvings of one, that are looked at for places that are not hidden; of halvings more beside solids, whose faces may be much longer than the radius.
const MOST_BOXES: usize = 4_000;
const HALVINGS: usize = 12;
const HALVINGS_IN_SOLIDS: usize = 40;
/// Bodies that are looked at in a box while a set is asked for, about.
const BODIES_PER_SET: usize = 8;
/// Of directions, as a share: their ends are places of the model less others, as far as the radius or more, or unit vectors.
const ROUNDING: f64 = 1e-9;
/// Boxes no wider than this, in units of the radius, are not halved for the face of a solid across them.
const NARROW: f64 = 0.25;

impl Bodies<'_> {
    /// Whether the places in a cube that the dilations of a set have in common, unless they have none, and those that its polytopes have, are all in the interior of others, of their dilation and their polytope, or of solids. What reaches the cube is
    /// `around`. Adds to `asked` how many sets could have been asked for meanwhile.
    pub(super) fn is_hidden(&self, set: &[u32], common_points: Common, cube: &Cube, around: &[u32], asked: &mut usize) -> bool {
        let Setting { reach, slack, .. } = *self.setting;
        let corners: Vec<Point> = cube.corners().collect();
        let mut boxes = Boxes { set, cube, axes: self.axes(set[0]), kind: Kind::Dilation, left: MOST_BOXES, looked: 0 };
        let halvings = if self.solids.is_empty() { HALVINGS } else { HALVINGS_IN_SOLIDS };
        let is_hidden = KINDS.into_iter().all(|kind| {
            boxes.kind = kind;
            let of_polytope = |body: u32| (&*self.polytopes.of(body).corners, slack);
            let part = |&body: &u32| if matches!(kind, Kind::Polytope) { of_polytope(body) } else { self.around(body, reach + slack) };
            let common = common_box(&boxes.axes, set.iter().map(part).chain([(&*corners, slack)]));
            (matches!(kind, Kind::Dilation) && common_points == Common::None) || self.are_hidden(&mut boxes, common, around, halvings)
        });
        *asked += boxes.looked / BODIES_PER_SET;
        is_hidden
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

    /// Whether the places in a box that bodies of a set have in common are all hidden, by one of those around or by a solid.
    fn are_hidden(&self, boxes: &mut Boxes<'_>, [low, high]: [Point; 2], around: &[u32], halvings: usize) -> bool {
        if is_empty(&[low, high]) {
            return true;
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
            return true;
        }
        let mut highest = f64::NEG_INFINITY;
        for &body in boxes.set {
            let near = self.near(body, &centre);
            let mut above = self.above_all(body, &centre, &near);
            if above >= 0.0 {
                // Where no polytope is, planes need not be asked.
                for kind in [Kind::Outer, boxes.kind] {
                    let away;
                    (above, away) = self.above_at(kind, body, &centre, &near);
                    if above > half_along(&away) {
                        return true;
                    }
                }
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
                return true;
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
                return true;
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
