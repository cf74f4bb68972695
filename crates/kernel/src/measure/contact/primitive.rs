//! Points, lines, planes, boxes and balls, as bodies that shapes are searched against.

use super::ContactError;
use super::body::{Body, Nature, ball_of_box};
use crate::attractor::cell::{Ball, Point, Site, cross, dot, subtract};

/// What a shape is held against. Lengths in mm; directions and normals need not have length 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Primitive {
    /// A point: does it belong to the shape?
    Point(Point),
    /// All points between two ends.
    Segment([Point; 2]),
    /// All points from an origin along a direction.
    Ray {
        /// Where it begins.
        origin: Point,
        /// Where it goes.
        direction: Point,
    },
    /// All points from an origin along a direction and against it.
    Line {
        /// A point of it.
        origin: Point,
        /// Its direction.
        direction: Point,
    },
    /// All x with n.x = h |n|.
    Plane {
        /// n.
        normal: Point,
        /// h: its distance from the origin of space along n, in mm.
        offset_mm: f64,
    },
    /// A box along the axes, with all points within.
    AxisBox {
        /// Lower corner.
        low: Point,
        /// Upper corner.
        high: Point,
    },
    /// A ball, with all points within.
    Ball {
        /// Its centre.
        centre: Point,
        /// Its radius; not negative.
        radius_mm: f64,
    },
}

/// Coordinates beyond it overflow when they are squared.
const LARGEST_MM: f64 = 1e150;

impl Primitive {
    /// The primitive as seen by a shape within `around`. The closest points of lines and planes to a point of the shape
    /// are its projections, which lie in the projection of the ball: no farther from that of its centre than its radius.
    /// Hence no distance changes when a line or ray is cut to a segment, a plane to a triangle, around that.
    ///
    /// Rounding is relative to the coordinates that were given, the second part of the result: what is cut off a line is
    /// as far from it, relative to the distance of its origin, as its direction is rounded.
    ///
    /// # Errors
    /// [`ContactError::Query`] for a number that is not usable.
    pub(super) fn body(&self, around: &Ball) -> Result<(Body, f64), ContactError> {
        let largest = |x: &Point| x.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let body = self.seen(around)?;
        let size = match self {
            Self::Ray { origin, .. } | Self::Line { origin, .. } => largest(origin),
            Self::Plane { offset_mm, .. } => offset_mm.abs(),
            _ => 0.0,
        };
        let size = size.max(largest(&body.low)).max(largest(&body.high));
        Ok((body, size))
    }

    fn seen(&self, around: &Ball) -> Result<Body, ContactError> {
        match self {
            Self::Point(x) => Ok(Body::of_site(Site::Point(point("a coordinate of the point", x)?), Nature::Exact)),
            Self::Segment([from, to]) => {
                let ends = [point("a coordinate of the segment", from)?, point("a coordinate of the segment", to)?];
                Ok(Body::of_site(Site::Segment(ends), Nature::Exact))
            }
            Self::Ray { origin, direction } => Ok(along(&point("a coordinate of the origin", origin)?, &unit(direction)?, 0.0, around)),
            Self::Line { origin, direction } => {
                Ok(along(&point("a coordinate of the origin", origin)?, &unit(direction)?, f64::NEG_INFINITY, around))
            }
            Self::Plane { normal, offset_mm } => {
                let offset = number("offset_mm", *offset_mm, -LARGEST_MM, "a finite number of mm, below 1e150")?;
                Ok(plane(&unit(normal)?, offset, around))
            }
            Self::AxisBox { low, high } => {
                let (low, high) = (point("a coordinate of the box", low)?, point("a coordinate of the box", high)?);
                match (0..3).find(|&axis| low[axis] > high[axis]) {
                    Some(axis) => {
                        Err(ContactError::Query { name: "the box's lower end", value: low[axis], expected: "at most the upper end" })
                    }
                    None => Ok(filled(low, high)),
                }
            }
            Self::Ball { centre, radius_mm } => {
                let radius = number("radius_mm", *radius_mm, 0.0, "a length of 0 mm or more, below 1e150")?;
                let body = Body::of_site(Site::Point(point("a coordinate of the centre", centre)?), Nature::Loose);
                let (low, high) = (body.low.map(|x| x - radius), body.high.map(|x| x + radius));
                Ok(Body { grown: radius, ball: Ball { centre: *centre, radius }, low, high, ..body })
            }
        }
    }
}

fn number(name: &'static str, value: f64, least: f64, expected: &'static str) -> Result<f64, ContactError> {
    if (least..=LARGEST_MM).contains(&value) { Ok(value) } else { Err(ContactError::Query { name, value, expected }) }
}

fn point(name: &'static str, x: &Point) -> Result<Point, ContactError> {
    x.iter().try_for_each(|&value| number(name, value, -LARGEST_MM, "a finite number of mm, below 1e150").map(|_| ()))?;
    Ok(*x)
}

/// The direction with length 1, whatever its length.
fn unit(direction: &Point) -> Result<Point, ContactError> {
    let refused = |value| ContactError::Query { name: "a direction", value, expected: "three finite numbers, not all 0" };
    if let Some(&value) = direction.iter().find(|value| !value.is_finite()) {
        return Err(refused(value));
    }
    let largest = direction.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    if largest == 0.0 {
        return Err(refused(0.0));
    }
    let scaled = direction.map(|x| x / largest);
    let length = dot(&scaled, &scaled).sqrt();
    Ok(scaled.map(|x| x / length))
}

/// Half of the length that is kept, as a share of the ball's radius: more than 1, for rounding.
const KEPT: f64 = 1.01;

/// The part of a line or ray that the ball sees, `from` being where it begins.
fn along(origin: &Point, unit: &Point, from: f64, around: &Ball) -> Body {
    let middle = dot(unit, &subtract(&around.centre, origin));
    let at = |t: f64| -> Point { std::array::from_fn(|axis| origin[axis] + t * unit[axis]) };
    let reach = KEPT * around.radius + 1e-12 * middle.abs();
    let ends = [at((middle - reach).max(from)), at((middle + reach).max(from))];
    Body::of_site(Site::Segment(ends), Nature::Loose)
}

/// A regular triangle of the plane, whose inscribed circle holds the projection of the ball.
fn plane(normal: &Point, offset: f64, around: &Ball) -> Body {
    let height = offset - dot(normal, &around.centre);
    let foot: Point = std::array::from_fn(|axis| around.centre[axis] + height * normal[axis]);
    let smallest = (0..3).min_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs())).unwrap_or(0);
    let first = cross(normal, &std::array::from_fn(|axis| f64::from(u8::from(axis == smallest))));
    let length = dot(&first, &first).sqrt();
    let first = first.map(|x| x / length);
    let second = cross(normal, &first);
    let reach = 2.0 * (KEPT * around.radius + 1e-12 * height.abs());
    let corner =
        |cosine: f64, sine: f64| -> Point { std::array::from_fn(|axis| foot[axis] + reach * (cosine * first[axis] + sine * second[axis])) };
    let sine = 0.75_f64.sqrt();
    let site = Site::Triangle([corner(1.0, 0.0), corner(-0.5, sine), corner(-0.5, -sine)]);
    Body::of_site(site, Nature::Plane(*normal))
}

/// The surface of a box, as twelve triangles.
fn filled(low: Point, high: Point) -> Body {
    let corner = |k: usize| -> Point { std::array::from_fn(|axis| if k >> axis & 1 == 0 { low[axis] } else { high[axis] }) };
    let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let halves = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    let sites = halves.map(|triangle| Site::Triangle(triangle.map(corner))).collect();
    Body { sites, error: 0.0, grown: 0.0, ball: ball_of_box(&low, &high), low, high, nature: Nature::Filled }
}
