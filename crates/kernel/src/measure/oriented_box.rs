//! The smallest box around a set of points, whatever way it is turned: between proven bounds.
//!
//! Branch and bound over rotations. A rotation is its vector (axis times angle); rotations by vectors v and w differ by an angle of |v - w| at most (Hartley and
//! Kahl, "Global optimization through rotation space search", 2009), so those of a cube of vectors with half diagonal a turn every axis of the middle one by a at
//! most. Boxes are the same under the 24 rotations of a cube, and every rotation is one of these and one by less than 62.8 degrees (Mackenzie, "Second paper on
//! statistics associated with the random disorientation of cubes", 1958), so one cube of vectors holds them all.
//!
//! Lower bound: let p and q be the points farthest along an axis u and against it, d = p - q. Along any direction v within an angle a of u the set is at least as
//! wide as d . v >= |d| cos(angle(d, u) + a). The product of three such widths bounds all boxes of the cube from below, and the box of its middle from above.

use crate::budget::{Budget, Stopped};
use crate::measure::Interval;
use crate::order::ordered_by;
use glam::{DMat3, DVec3};
use std::collections::BinaryHeap;
use std::rc::Rc;

/// A box turned in space, and bounds of the volume of the smallest one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedBox {
    /// Unit vectors along its edges.
    pub axes: [DVec3; 3],
    /// Its middle, in mm.
    pub centre: DVec3,
    /// Lengths of its edges, in mm.
    pub sizes: [f64; 3],
    /// The volume of the smallest box lies between; the upper end is the volume of this one.
    pub volume: Interval,
    /// Whether the bounds are as close as was asked.
    pub complete: bool,
}

/// Largest coordinate of a rotation vector of less than 62.8 degrees, a little more.
const REACH: f64 = 1.0965;
/// Cubes that are looked at, at most.
const MOST_CUBES: usize = 400_000;
/// Cubes after which a bound of zero is taken for good: rotations of a cube then differ by less than 0.1.
const MOST_CUBES_OF_FLAT_SETS: usize = 16_384;
/// Point products that are made at most, beyond the first cubes.
const MOST_PRODUCTS: f64 = 4e9;
/// Relative error of a width: a few products and sums of coordinates seen from the middle of the set.
const ROUNDING: f64 = 1e-14;

/// A cube of rotation vectors.
struct Cube {
    bound: f64,
    index: usize,
    middle: DVec3,
    half: f64,
    /// Points that may be extreme along an axis of one of its rotations.
    points: Rc<Vec<u32>>,
}

// The least bound first, then the earliest.
ordered_by!(Cube, |this, other| other.bound.total_cmp(&this.bound).then(other.index.cmp(&this.index)));

/// The rotation by a vector's length about its direction.
fn rotation(vector: DVec3) -> DMat3 {
    let angle = vector.length();
    if angle > 0.0 { DMat3::from_axis_angle(vector / angle, angle) } else { DMat3::IDENTITY }
}

/// The points, seen from the middle of their box.
struct Search<'p> {
    points: &'p [DVec3],
    middle: DVec3,
    /// Largest distance of a point from the middle.
    radius: f64,
    /// What is added to every width.
    grown: f64,
    slack: f64,
    products: f64,
}

/// Extent along a direction.
struct Width {
    low: f64,
    high: f64,
    ends: [u32; 2],
}

impl Search<'_> {
    fn at(&self, index: u32) -> DVec3 {
        self.points[index as usize] - self.middle
    }

    fn width(&mut self, candidates: &[u32], direction: DVec3) -> Width {
        self.products += candidates.len() as f64;
        let first = candidates[0];
        let start = self.at(first).dot(direction);
        let mut width = Width { low: start, high: start, ends: [first; 2] };
        for &index in candidates {
            let x = self.at(index).dot(direction);
            if x < width.low {
                (width.low, width.ends[0]) = (x, index);
            } else if x > width.high {
                (width.high, width.ends[1]) = (x, index);
            }
        }
        width
    }

    /// The volume of the box of a rotation, rounded up.
    fn volume(&mut self, candidates: &[u32], axes: &DMat3) -> f64 {
        let mut volume = 1.0;
        for k in 0..3 {
            let width = self.width(candidates, axes.col(k));
            volume *= self.upper(width.high - width.low);
        }
        volume
    }

    fn upper(&self, width: f64) -> f64 {
        width + self.grown + 2.0 * self.slack + 2.0 * ROUNDING * self.radius
    }

    /// A lower bound of the volume of all boxes whose axes are within an angle of these, and the points that may be extreme along them.
    fn bound(&mut self, candidates: &[u32], axes: &DMat3, angle: f64) -> (f64, Vec<u32>) {
        let mut kept = vec![false; candidates.len()];
        let turn = 2.0 * (0.5 * angle).sin();
        let mut volume = 1.0;
        for k in 0..3 {
            let direction = axes.col(k);
            let width = self.width(candidates, direction);
            let [q, p] = width.ends.map(|end| self.at(end));
            let across = p - q;
            let length = across.length();
            let tilt = if length > 0.0 { across.dot(direction).clamp(-length, length) / length } else { 0.0 }.acos();
            let least = length * (tilt + angle).min(std::f64::consts::PI).cos();
            volume *= (least + self.grown - 2.0 * self.slack - 2.0 * ROUNDING * self.radius).max(0.0);
            // A point x is beyond p along a direction v only if (x - p) . v > 0, and |v - u| <= 2 sin(a / 2).
            self.products += candidates.len() as f64;
            for (kept, &index) in kept.iter_mut().zip(candidates) {
                let x = self.at(index);
                let reaches =
                    |end: DVec3, sign: f64| sign * (x - end).dot(direction) >= -turn * (x - end).length() - 4.0 * ROUNDING * self.radius;
                *kept |= reaches(p, 1.0) || reaches(q, -1.0);
            }
        }
        let left = candidates.iter().zip(kept).filter(|(_, kept)| *kept).map(|(index, _)| *index).collect();
        (volume, left)
    }
}

/// The smallest box of the points, every one of them a ball: `grown` is what that adds to every width, twice the radius. The exact set is within `slack` of the
/// points, and they of it. The bounds of the volume differ by `relative` of it at most, unless the search ends before; for points in one plane nothing is
/// relative to the volume, and it ends by the number of cubes. `None` without points. Cost: for `relative` = 1e-3 some thousand times the points.
///
/// # Errors
/// [`Stopped`].
pub fn oriented_box(points: &[DVec3], grown: f64, slack: f64, relative: f64, budget: &Budget) -> Result<Option<OrientedBox>, Stopped> {
    let Some(low) = points.iter().copied().reduce(DVec3::min) else { return Ok(None) };
    let high = points.iter().copied().fold(low, DVec3::max);
    let middle = 0.5 * (low + high);
    let radius = points.iter().map(|point| point.distance(middle)).fold(0.0, f64::max);
    let mut search = Search { points, middle, radius, grown, slack, products: 0.0 };
    let all: Rc<Vec<u32>> = Rc::new((0..points.len() as u32).collect());
    let mut best = (search.volume(&all, &DMat3::IDENTITY), DVec3::ZERO);
    let mut cubes = BinaryHeap::new();
    cubes.push(Cube { bound: 0.0, index: 0, middle: DVec3::ZERO, half: REACH, points: Rc::clone(&all) });
    let mut made = 1;
    let mut proven = None;
    while let Some(cube) = cubes.pop() {
        if cube.bound >= best.0 * (1.0 - relative) {
            proven = Some(cube.bound);
            break;
        }
        // Where the set is flatter than it is known, no bound is ever above zero.
        let is_flat = cube.bound == 0.0 && made >= MOST_CUBES_OF_FLAT_SETS;
        if is_flat || made >= MOST_CUBES || (search.products > MOST_PRODUCTS && made > 4096) {
            cubes.push(cube);
            break;
        }
        for octant in 0..8 {
            budget.cancel.check()?;
            let half = 0.5 * cube.half;
            let sign = |bit: u32| if octant >> bit & 1 == 1 { half } else { -half };
            let vector = cube.middle + DVec3::new(sign(0), sign(1), sign(2));
            let angle = half * 3.0_f64.sqrt();
            if vector.length() - angle > REACH {
                continue;
            }
            let axes = rotation(vector);
            let volume = search.volume(&cube.points, &axes);
            if volume < best.0 {
                best = (volume, vector);
            }
            let (bound, left) = search.bound(&cube.points, &axes, angle);
            // The box of the whole cube bounds its parts as well.
            let bound = bound.max(cube.bound);
            if bound < best.0 {
                cubes.push(Cube { bound, index: made, middle: vector, half, points: Rc::new(left) });
            }
            made += 1;
        }
    }
    // What is left is bounded by the cube with the least bound; without any, nothing is smaller than the best.
    let lower = proven.or_else(|| cubes.peek().map(|cube| cube.bound)).unwrap_or(best.0);
    best = polished(&mut search, &all, best, budget)?;
    let axes = rotation(best.1);
    let mut found = OrientedBox {
        axes: [axes.x_axis, axes.y_axis, axes.z_axis],
        centre: middle,
        sizes: [0.0; 3],
        volume: Interval { low: (lower * (1.0 - 16.0 * f64::EPSILON)).min(best.0), high: best.0 * (1.0 + 16.0 * f64::EPSILON) },
        complete: false,
    };
    for k in 0..3 {
        let width = search.width(&all, found.axes[k]);
        found.sizes[k] = search.upper(width.high - width.low);
        found.centre += found.axes[k] * (0.5 * (width.low + width.high));
    }
    found.complete = found.volume.low >= found.volume.high * (1.0 - 1.01 * relative);
    Ok(Some(found))
}

/// A local minimum nearby: steps along coordinates of the rotation vector, halved when none helps.
fn polished(search: &mut Search<'_>, all: &[u32], mut best: (f64, DVec3), budget: &Budget) -> Result<(f64, DVec3), Stopped> {
    let mut step = 0.02;
    while step > 1e-11 {
        budget.cancel.check()?;
        let mut improved = false;
        for sign in [1.0, -1.0] {
            for axis in DVec3::AXES {
                let vector = best.1 + sign * step * axis;
                let volume = search.volume(all, &rotation(vector));
                if volume < best.0 {
                    best = (volume, vector);
                    improved = true;
                }
            }
        }
        if !improved {
            step *= 0.5;
        }
    }
    Ok(best)
}
