//! The smallest box around a set of points, whatever way it is turned: between proven bounds.
//!
//! Branch and bound over rotations. A rotation is its vector (axis times angle); rotations by vectors v and w differ by an angle of |v - w| at most (Hartley and
//! Kahl, "Global optimization through rotation space search", 2009), so those of a cube of vectors with half diagonal a turn every axis of the middle one by a at
//! most. Boxes are the same under the 24 rotations of a cube, and every rotation is one of these and one by less than 62.8 degrees (Mackenzie, "Second paper on
//! statistics associated with the random disorientation of cubes", 1958), so one cube of vectors holds them all.
//!
//! Lower bound: let p and q be the points farthest along an axis u and against it, d = p - q. Along any direction v within an angle a of u the set is at least as
//! wide as d . v >= |d| cos(angle(d, u) + a). The product of three such widths bounds all boxes of the cube from below, and the box of its middle from above.
//!
//! Extents are looked up in lists of the points that may be the farthest, one for each cell of directions (see `extremes`). What a list leaves out cannot spoil a bound: a box of
//! all points holds those of the lists, so the lower bound is that of all, and the upper end is the box of all points.

mod extremes;

use crate::budget::{Budget, Stopped};
use crate::measure::Interval;
use crate::order::ordered_by;
use extremes::Extremes;
use glam::{DMat3, DVec3};
use std::collections::BinaryHeap;

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
/// Relative error of a width: a few products and sums of coordinates seen from the middle of the set.
const ROUNDING: f64 = 1e-14;

/// A cube of rotation vectors.
struct Cube {
    bound: f64,
    index: usize,
    middle: DVec3,
    half: f64,
}

// The least bound first, then the earliest.
ordered_by!(Cube, |this, other| other.bound.total_cmp(&this.bound).then(other.index.cmp(&this.index)));

/// The rotation by a vector's length about its direction.
fn rotation(vector: DVec3) -> DMat3 {
    let angle = vector.length();
    if angle > 0.0 { DMat3::from_axis_angle(vector / angle, angle) } else { DMat3::IDENTITY }
}

/// The points, seen from the middle of their box.
struct Points<'p> {
    points: &'p [DVec3],
    middle: DVec3,
    /// Largest distance of a point from the middle.
    radius: f64,
    /// What is added to every width.
    grown: f64,
    slack: f64,
}

/// Extent along a direction.
struct Width {
    low: f64,
    high: f64,
    ends: [u32; 2],
}

impl Points<'_> {
    fn at(&self, index: u32) -> DVec3 {
        self.points[index as usize] - self.middle
    }

    /// Where all points begin and end along a direction.
    fn extent(&self, direction: DVec3) -> [f64; 2] {
        let heights = (0..self.points.len() as u32).map(|index| self.at(index).dot(direction));
        heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    }

    fn upper(&self, width: f64) -> f64 {
        width + self.grown + 2.0 * self.slack + 2.0 * ROUNDING * self.radius
    }

    /// The box of all points with these axes, above a lower bound of all boxes.
    fn around(&self, axes: &DMat3, lower: f64) -> OrientedBox {
        let axes = [axes.x_axis, axes.y_axis, axes.z_axis];
        let extents = axes.map(|axis| self.extent(axis));
        let sizes = extents.map(|[low, high]| self.upper(high - low));
        let centre = axes.iter().zip(extents).fold(self.middle, |sum, (axis, [low, high])| sum + *axis * (0.5 * (low + high)));
        let high = sizes.iter().product::<f64>() * (1.0 + 16.0 * f64::EPSILON);
        let volume = Interval { low: (lower * (1.0 - 16.0 * f64::EPSILON)).min(high), high };
        OrientedBox { axes, centre, sizes, volume, complete: false }
    }
}

/// The points with their lists.
struct Search<'p> {
    points: Points<'p>,
    extremes: Extremes,
}

impl Search<'_> {
    /// The width of the points in the lists. Cost: that of two lists.
    fn width(&self, direction: DVec3) -> Width {
        let farthest = |along: DVec3| {
            let heights = self.extremes.list(along).iter().map(|&index| (self.points.at(index).dot(along), index));
            heights.fold((f64::NEG_INFINITY, 0), |a, b| if b.0 > a.0 { b } else { a })
        };
        let (front, back) = (farthest(direction), farthest(-direction));
        Width { low: -back.0, high: front.0, ends: [back.1, front.1] }
    }

    /// The volume of the box of a rotation, rounded up, and the points that it touches.
    fn volume(&self, axes: &DMat3) -> (f64, [u32; 6]) {
        let widths: [Width; 3] = std::array::from_fn(|k| self.width(axes.col(k)));
        let volume = widths.iter().map(|width| self.points.upper(width.high - width.low)).product();
        (volume, std::array::from_fn(|k| widths[k / 2].ends[k % 2]))
    }

    /// A lower bound of the volume of all boxes whose axes are within an angle of these, of which that one touches `ends`.
    fn bound(&self, axes: &DMat3, ends: &[u32; 6], angle: f64) -> f64 {
        let Points { grown, slack, radius, .. } = self.points;
        let least = |k: usize| {
            let across = self.points.at(ends[2 * k + 1]) - self.points.at(ends[2 * k]);
            let length = across.length();
            let tilt = if length > 0.0 { across.dot(axes.col(k)).clamp(-length, length) / length } else { 0.0 }.acos();
            let width = length * (tilt + angle).min(std::f64::consts::PI).cos();
            (width + grown - 2.0 * slack - 2.0 * ROUNDING * radius).max(0.0)
        };
        (0..3).map(least).product()
    }

    /// A lower bound of the volume of all boxes, and the rotation of a small one. They differ by `relative` at most, unless a limit ends the search.
    fn smallest(&self, relative: f64, budget: &Budget) -> Result<(f64, DVec3), Stopped> {
        let mut best = (self.volume(&DMat3::IDENTITY).0, DVec3::ZERO);
        let mut cubes = BinaryHeap::new();
        cubes.push(Cube { bound: 0.0, index: 0, middle: DVec3::ZERO, half: REACH });
        let mut made = 1;
        let mut proven = None;
        while let Some(cube) = cubes.pop() {
            if cube.bound >= best.0 * (1.0 - relative) {
                proven = Some(cube.bound);
                break;
            }
            // Where the set is flatter than it is known, no bound is ever above zero.
            let is_flat = cube.bound == 0.0 && made >= MOST_CUBES_OF_FLAT_SETS;
            if is_flat || made >= MOST_CUBES {
                cubes.push(cube);
                break;
            }
            budget.cancel.check()?;
            for octant in 0..8 {
                let half = 0.5 * cube.half;
                let sign = |bit: u32| if octant >> bit & 1 == 1 { half } else { -half };
                let vector = cube.middle + DVec3::new(sign(0), sign(1), sign(2));
                let angle = half * 3.0_f64.sqrt();
                if vector.length() - angle > REACH {
                    continue;
                }
                let axes = rotation(vector);
                let (volume, ends) = self.volume(&axes);
                if volume < best.0 {
                    best = (volume, vector);
                }
                // The box of the whole cube bounds its parts as well.
                let bound = self.bound(&axes, &ends, angle).max(cube.bound);
                if bound < best.0 {
                    cubes.push(Cube { bound, index: made, middle: vector, half });
                }
                made += 1;
            }
        }
        // What is left is bounded by the cube with the least bound; without any, nothing is smaller than the best.
        let lower = proven.or_else(|| cubes.peek().map(|cube| cube.bound)).unwrap_or(best.0).min(best.0);
        Ok((lower, self.polished(best, budget)?))
    }

    /// A local minimum nearby: steps along coordinates of the rotation vector, halved when none helps.
    fn polished(&self, mut best: (f64, DVec3), budget: &Budget) -> Result<DVec3, Stopped> {
        let mut step = 0.02;
        while step > 1e-11 {
            budget.cancel.check()?;
            let mut improved = false;
            for sign in [1.0, -1.0] {
                for axis in DVec3::AXES {
                    let vector = best.1 + sign * step * axis;
                    let (volume, _) = self.volume(&rotation(vector));
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
        Ok(best.1)
    }
}

/// The smallest box of the points, every one of them a ball: `grown` is what that adds to every width, twice the radius. The exact set is within `slack` of the
/// points, and they of it. The bounds of the volume differ by `relative` of it at most, unless the search ends before; for points in one plane nothing is
/// relative to the volume, and it ends by the number of cubes, as it does for a ball at 1e-3, and for sets a hundred times as long as they are wide. `None` without
/// points. Cost: about n for each size of the lists' cells, and some thousand to some hundred thousand cubes of rotations, each of six lists. The result does not
/// depend on the number of threads.
///
/// # Errors
/// [`Stopped`].
pub fn oriented_box(points: &[DVec3], grown: f64, slack: f64, relative: f64, budget: &Budget) -> Result<Option<OrientedBox>, Stopped> {
    let Some(low) = points.iter().copied().reduce(DVec3::min) else { return Ok(None) };
    let high = points.iter().copied().fold(low, DVec3::max);
    let middle = 0.5 * (low + high);
    let radius = points.iter().map(|point| point.distance(middle)).fold(0.0, f64::max);
    let points = Points { points, middle, radius, grown, slack };
    let search = Search { extremes: Extremes::of(&points, budget)?, points };
    let (lower, vector) = search.smallest(relative, budget)?;
    let mut found = search.points.around(&rotation(vector), lower);
    found.complete = found.volume.low >= found.volume.high * (1.0 - 1.01 * relative);
    Ok(Some(found))
}
