//! Distances of bodies: sets that are known by convex sites and by how far these are from the set.
//!
//! Let A be within e of the union of its sites, and B within f of its own, both in Hausdorff distance; let d be the
//! distance of the sites. Points of the sites at the distance d have points of A and B within e and f, and points of A
//! and B have points of the sites as near: the distance of A and B lies in [d - e - f, d + e + f].
//!
//! The distance of two convex sites S, T is enclosed, not computed. Any x in S and y in T bound it from above. For any
//! unit vector n, the least n.t over the corners of T less the largest n.s over those of S bounds it from below, because
//! the slab between the two values parts S from T; with n along y - x both bounds agree when x and y are the closest
//! points. So a mistake in the choice of x and y, as rounding makes it for flat triangles, widens the interval and does
//! not spoil it. What rounding does to the values themselves is less than the slack of both bodies: they are sums of
//! fewer than ten products of coordinates' differences with numbers of at most 1.

use crate::attractor::cell::{Ball, Point, Site, between, cross, distance_squared, dot, subtract};
use crate::solid::contact::{is_flat, meet};
use robust::{Coord3D, orient3d};

/// What more is known of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Nature {
    /// Nothing.
    Loose,
    /// It is connected, and the corners of its sites belong to it.
    Connected,
    /// It is its only site, whose coordinates are exactly those that were given.
    Exact,
    /// Its site, a triangle, stands for the plane through it, with this unit normal, as far as the other body reaches.
    Plane(Point),
    /// Its sites are the surface of its box, which it fills.
    Filled,
}

/// See the module's comment.
#[derive(Clone, Debug)]
pub(crate) struct Body {
    /// At least one.
    pub(crate) sites: Vec<Site>,
    /// Hausdorff distance of the sites' union from the body before it is grown, at most.
    pub(crate) error: f64,
    /// The body is grown by a ball of this radius.
    pub(crate) grown: f64,
    /// A ball that contains it.
    pub(crate) ball: Ball,
    /// Lower corner of a box that contains it.
    pub(crate) low: Point,
    /// Upper corner.
    pub(crate) high: Point,
    /// What more is known.
    pub(crate) nature: Nature,
}

/// How far two bodies are from each other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gap {
    /// The distance is at least this.
    pub(crate) low: f64,
    /// And at most this: 0 only when contact is proven.
    pub(crate) high: f64,
    /// A direction from the first to the second, of length 1, unless they meet.
    pub(crate) direction: Option<Point>,
    /// Every point of the first belongs to the second.
    pub(crate) within: bool,
}

/// Lengths below it may have lost digits to underflow.
const LEAST_LENGTH: f64 = 1e-140;

impl Body {
    /// A body that is a site, up to `slack`.
    pub(crate) fn of_site(site: Site, nature: Nature) -> Self {
        let (low, high) =
            corners(&site).iter().fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(low, high), x| (least(&low, x), most(&high, x)));
        Self { sites: vec![site], error: 0.0, grown: 0.0, ball: ball_of_box(&low, &high), low, high, nature }
    }

    /// The largest n.x over the sites, grown; holds for bodies without error.
    pub(crate) fn reach(&self, direction: &Point) -> f64 {
        self.sites.iter().flat_map(corners).map(|x| dot(direction, x)).fold(f64::NEG_INFINITY, f64::max) + self.grown
    }

    /// The distance from another body. `slack` covers the rounding of both.
    pub(crate) fn gap(&self, other: &Self, slack: f64) -> Gap {
        let (mut low, mut high, mut direction) = (f64::INFINITY, f64::INFINITY, None);
        for mine in &self.sites {
            for its in &other.sites {
                let (least, most, along) = site_gap(mine, its);
                low = low.min(least);
                if most < high {
                    (high, direction) = (most, along);
                }
            }
        }
        let (errors, grown) = (self.error + other.error, self.grown + other.grown);
        (low, high) = (low - errors - grown, high + errors - grown);
        low = low.max(box_distance(self, other));
        let within = other.contains(self, slack);
        if other.nature == Nature::Filled {
            // The surface may be far from what it encloses.
            let depth = self.sites.iter().flat_map(corners).map(|x| other.depth(x)).fold(f64::NEG_INFINITY, f64::max);
            if depth >= -slack {
                (low, high) = (0.0, high.min(self.error - depth));
            }
        }
        let meets = within || high + slack <= 0.0 || self.surely_meets(other, slack);
        Gap { low: (low - slack).max(0.0), high: if meets { 0.0 } else { high + slack }, direction, within }
    }

    /// The middle of the closest points of the sites of both, up to rounding.
    pub(super) fn middle(&self, other: &Self) -> Point {
        let (x, y) = self.closest(other);
        between(&x, &y, 0.5)
    }

    /// The closest points of the sites of both, up to rounding.
    pub(super) fn closest(&self, other: &Self) -> (Point, Point) {
        let pairs = self.sites.iter().flat_map(|mine| other.sites.iter().map(move |its| closest_pair(mine, its)));
        let closest = pairs.min_by(|a, b| distance_squared(&a.0, &a.1).total_cmp(&distance_squared(&b.0, &b.1)));
        closest.unwrap_or((self.ball.centre, other.ball.centre))
    }

    /// Whether it is its sites, grown and filled as it may be: all points of these are its own.
    pub(super) fn is_its_sites(&self) -> bool {
        self.error == 0.0
    }

    /// The point of its sites that is nearest to x, grown and filled as it may be; up to rounding.
    pub(super) fn nearest(&self, x: &Point) -> Point {
        if self.nature == Nature::Filled {
            return std::array::from_fn(|axis| x[axis].clamp(self.low[axis], self.high[axis]));
        }
        let sites = self.sites.iter().map(|site| site.closest(x));
        let closest = sites.min_by(|a, b| distance_squared(a, x).total_cmp(&distance_squared(b, x))).unwrap_or(self.ball.centre);
        let length = distance_squared(&closest, x).sqrt();
        if length > self.grown { between(&closest, x, self.grown / length) } else { *x }
    }

    /// The corners of the triangle that it is exactly; `None` for anything else, and for a triangle without area.
    pub(super) fn exact_triangle(&self) -> Option<&[Point; 3]> {
        match (self.nature, self.sites.as_slice()) {
            (Nature::Exact, [Site::Triangle(corners)]) if !is_flat(corners) => Some(corners),
            _ => None,
        }
    }

    /// The distance of a point in the box from its nearest side; negative outside.
    fn depth(&self, x: &Point) -> f64 {
        (0..3).map(|axis| (x[axis] - self.low[axis]).min(self.high[axis] - x[axis])).fold(f64::INFINITY, f64::min)
    }

    /// Whether every point of the other body surely belongs to this one: a grown point, or a filled box.
    fn contains(&self, other: &Self, slack: f64) -> bool {
        match (&self.nature, self.sites.as_slice()) {
            (Nature::Filled, _) => {
                (0..3).all(|axis| self.low[axis] <= other.low[axis] - slack && other.high[axis] + slack <= self.high[axis])
            }
            (_, [Site::Point(centre)]) if self.error == 0.0 => {
                distance_squared(centre, &other.ball.centre).sqrt() + other.ball.radius + slack <= self.grown
            }
            _ => false,
        }
    }

    /// Proof of a common point by exact signs, or as a connected set with points on both sides of a plane meets it.
    fn surely_meets(&self, other: &Self, slack: f64) -> bool {
        match (self.nature, other.nature) {
            (Nature::Exact, Nature::Exact) => sites_meet(&self.sites[0], &other.sites[0]),
            (Nature::Exact | Nature::Connected, Nature::Plane(normal)) => {
                let foot = corners(&other.sites[0])[0];
                let height = |x: &Point| dot(&normal, &subtract(x, &foot));
                let heights = || self.sites.iter().flat_map(corners).map(height);
                heights().any(|height| height > slack) && heights().any(|height| height < -slack)
            }
            _ => false,
        }
    }
}

/// The ball around a box.
pub(crate) fn ball_of_box(low: &Point, high: &Point) -> Ball {
    let centre = std::array::from_fn(|axis| 0.5 * low[axis] + 0.5 * high[axis]);
    Ball { centre, radius: 0.5 * distance_squared(low, high).sqrt() }
}

/// The least of each coordinate.
pub(crate) fn least(a: &Point, b: &Point) -> Point {
    std::array::from_fn(|axis| a[axis].min(b[axis]))
}

/// The largest of each coordinate.
pub(crate) fn most(a: &Point, b: &Point) -> Point {
    std::array::from_fn(|axis| a[axis].max(b[axis]))
}

/// The corners of a site.
pub(crate) fn corners(site: &Site) -> &[Point] {
    match site {
        Site::Point(x) => std::slice::from_ref(x),
        Site::Segment(ends) => ends,
        Site::Triangle(corners) => corners,
    }
}

/// The distance of the boxes, which the bodies keep at least.
fn box_distance(a: &Body, b: &Body) -> f64 {
    let apart: Point = std::array::from_fn(|axis| (b.low[axis] - a.high[axis]).max(a.low[axis] - b.high[axis]).max(0.0));
    dot(&apart, &apart).sqrt()
}

/// [least, most] of the distance of two sites, and a direction from the first to the second.
#[inline]
fn site_gap(a: &Site, b: &Site) -> (f64, f64, Option<Point>) {
    let (x, y) = if let (Site::Point(x), Site::Point(y)) = (a, b) { (*x, *y) } else { closest_pair(a, b) };
    let difference = subtract(&y, &x);
    let length = dot(&difference, &difference).sqrt();
    if length < LEAST_LENGTH {
        return (0.0, length, None);
    }
    let direction = difference.map(|coordinate| coordinate / length);
    if let (Site::Point(_), Site::Point(_)) = (a, b) {
        return (length, length, Some(direction));
    }
    // Offsets from x, so that no digit is lost to the place where the sites lie.
    let offset = |corner: &Point| dot(&direction, &subtract(corner, &x));
    let mine = corners(a).iter().map(offset).fold(f64::NEG_INFINITY, f64::max);
    let its = corners(b).iter().map(offset).fold(f64::INFINITY, f64::min);
    ((its - mine).max(0.0), length, Some(direction))
}

fn sides(site: &Site) -> impl Iterator<Item = [Point; 2]> {
    let corners = corners(site);
    let count = if corners.len() == 3 { 3 } else { corners.len() - 1 };
    (0..count).map(|k| [corners[k], corners[(k + 1) % corners.len()]])
}

/// Points of two sites that are closest up to rounding: the closest pair holds a corner, or lies on two sides, or is
/// where a side passes through a triangle.
fn closest_pair(a: &Site, b: &Site) -> (Point, Point) {
    let first = corners(a)[0];
    let mut best = (first, b.closest(&first));
    if let Site::Point(_) = a {
        return best;
    }
    let mut square = distance_squared(&best.0, &best.1);
    let mut offer = |x: Point, y: Point| {
        let found = distance_squared(&x, &y);
        if found < square {
            (square, best) = (found, (x, y));
        }
    };
    corners(a)[1..].iter().for_each(|x| offer(*x, b.closest(x)));
    corners(b).iter().for_each(|y| offer(a.closest(y), *y));
    for mine in sides(a) {
        for its in sides(b) {
            let (x, y) = closest_on_segments(&mine, &its);
            offer(x, y);
        }
    }
    if let Site::Triangle(corners) = b {
        sides(a).filter_map(|side| through(&side, corners)).for_each(|x| offer(x, b.closest(&x)));
    }
    if let Site::Triangle(corners) = a {
        sides(b).filter_map(|side| through(&side, corners)).for_each(|y| offer(a.closest(&y), y));
    }
    best
}

/// The point at which a segment passes through the plane of a triangle.
fn through([from, to]: &[Point; 2], [a, b, c]: &[Point; 3]) -> Option<Point> {
    let normal = cross(&subtract(b, a), &subtract(c, a));
    let (start, end) = (dot(&normal, &subtract(from, a)), dot(&normal, &subtract(to, a)));
    let share = start / (start - end);
    (share.is_finite() && (0.0..=1.0).contains(&share)).then(|| between(from, to, share))
}

/// Closest points of two segments (Ericson, "Real-Time Collision Detection", 2005, 5.1.9): the closest points of their
/// lines, moved into the first, then into the second, and the first's closest to that. Of segments without length, and
/// of parallel ones, ends are candidates anyway.
pub(crate) fn closest_on_segments(a: &[Point; 2], b: &[Point; 2]) -> (Point, Point) {
    let (u, v, r) = (subtract(&a[1], &a[0]), subtract(&b[1], &b[0]), subtract(&a[0], &b[0]));
    let (uu, vv, uv) = (dot(&u, &u), dot(&v, &v), dot(&u, &v));
    let (ur, vr) = (dot(&u, &r), dot(&v, &r));
    let determinant = uu * vv - uv * uv;
    let clamped = |numerator: f64, denominator: f64| {
        let share = numerator / denominator;
        if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }
    };
    let t = clamped(uv * clamped(uv * vr - vv * ur, determinant) + vr, vv);
    let y = between(&b[0], &b[1], t);
    (between(&a[0], &a[1], clamped(dot(&u, &subtract(&y, &a[0])), uu)), y)
}

/// Whether two sites surely have a common point: exactly for two triangles with area; of others, a common corner, or a
/// segment that passes from one side of a triangle to the other within it.
fn sites_meet(a: &Site, b: &Site) -> bool {
    match (a, b) {
        (Site::Triangle(p), Site::Triangle(q)) if !is_flat(p) && !is_flat(q) => meet([&[0, 1, 2], &[3, 4, 5]], [p, q]),
        (Site::Segment(side), Site::Triangle(corners)) | (Site::Triangle(corners), Site::Segment(side)) if crosses(side, corners) => true,
        _ => corners(a).iter().any(|x| corners(b).contains(x)),
    }
}

/// Whether the ends are strictly on different sides of the triangle's plane, and the triangle's sides not on different
/// sides of the segment's line, by exact signs.
fn crosses([from, to]: &[Point; 2], [a, b, c]: &[Point; 3]) -> bool {
    let place = |p: &Point| Coord3D { x: p[0], y: p[1], z: p[2] };
    let sign = |p: &Point, q: &Point, r: &Point, s: &Point| orient3d(place(p), place(q), place(r), place(s));
    let (start, end) = (sign(a, b, c, from), sign(a, b, c, to));
    let turns = [sign(from, to, a, b), sign(from, to, b, c), sign(from, to, c, a)];
    let parted = (start > 0.0 && end < 0.0) || (start < 0.0 && end > 0.0);
    parted && (turns.iter().all(|turn| *turn >= 0.0) || turns.iter().all(|turn| *turn <= 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Enclosures of random sites against pairs of sampled points.
    #[test]
    fn enclosures_hold_and_are_narrow() {
        let mut seed = 5_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as f64 / f64::from(1_u32 << 31) * 4.0 - 2.0
        };
        for round in 0..400 {
            let flat = round % 5 == 0;
            let mut point = |shift: f64| -> Point { [random() + shift, random(), if flat { 0.0 } else { random() }] };
            let mut site = |kind: usize, shift: f64| match kind {
                0 => Site::Point(point(shift)),
                1 => Site::Segment([point(shift), point(shift)]),
                _ => Site::Triangle([point(shift), point(shift), point(shift)]),
            };
            let (a, b) = (site(round % 3, 0.0), site(round / 3 % 3, if round % 2 == 0 { 0.0 } else { 5.0 }));
            let (low, high, _) = site_gap(&a, &b);
            let sample = |site: &Site| -> Vec<Point> {
                let corner = |k: usize| corners(site)[k.min(corners(site).len() - 1)];
                let pairs = (0..=16).flat_map(|i| (0..=16 - i).map(move |j| (f64::from(i) / 16.0, f64::from(j) / 16.0)));
                let (p, q, r) = (corner(0), corner(1), corner(2));
                pairs.map(|(u, v)| std::array::from_fn(|k| p[k] + u * (q[k] - p[k]) + v * (r[k] - p[k]))).collect()
            };
            let (mine, its) = (sample(&a), sample(&b));
            let sampled = mine.iter().flat_map(|x| its.iter().map(move |y| distance_squared(x, y))).fold(f64::INFINITY, f64::min).sqrt();
            assert!(low <= sampled + 1e-12 && high <= sampled + 1e-12, "{round}: {low} {high} {sampled}");
            assert!(high - low <= 1e-9 && low >= sampled - 0.7, "{round}: {a:?} {b:?} {low} {high} {sampled}");
        }
    }

    #[test]
    fn contacts_of_exact_sites() {
        let triangle = Site::Triangle([[0.0; 3], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]]);
        let meets = |a: Site, b: Site| Body::of_site(a, Nature::Exact).gap(&Body::of_site(b, Nature::Exact), 1e-12).high == 0.0;
        assert!(meets(triangle, Site::Segment([[1.0, 1.0, -1.0], [1.0, 1.0, 3.0]])));
        assert!(meets(Site::Segment([[2.0, 2.0, -1.0], [2.0, 2.0, 3.0]]), triangle), "on the side");
        assert!(!meets(triangle, Site::Segment([[2.0, 2.0 + 1e-15, -1.0], [2.0, 2.0 + 1e-15, 3.0]])), "just beside it");
        assert!(meets(triangle, Site::Triangle([[0.0, 4.0, 0.0], [0.0, 9.0, 1.0], [1.0, 9.0, 2.0]])), "at a corner");
        assert!(meets(Site::Point([4.0, 0.0, 0.0]), triangle));
        assert!(!meets(Site::Point([1.0, 1.0, 1e-14]), triangle));
    }
}
