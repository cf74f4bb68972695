//! What polytopes stand around: points, segments, which collinear ones are joined to, convex polygons, which coplanar triangles are joined to where they can be, and convex polyhedra (see `polyhedron`).
//!
//! The dilation of a union is the union of the dilations, and that of a convex polygon is convex as that of a triangle: so a polygon stands for its triangles, and a segment for its parts, and no bound, nor what is known of the
//! topology, changes. What changes is that there are fewer bodies, and fewer of them near to each other.

use super::polyhedron::Polyhedron;
use crate::attractor::cell::{Ball, Point, Site, between, closest_on_segment, cross, distance_squared, dot, subtract, unit};
use crate::budget::{Budget, Stopped};
use crate::dilation::convex::Convex;
use crate::dilation::tree::Weighted;
use crate::measure::triangle::closest_on_triangle;
use crate::solid::box_tree::Box32;
use std::cmp::Ordering;
use std::f64::consts::TAU;

/// Sides of a polygon at most by which a polytope begins, which has room for their facets, and corners at most, many of which may turn by little.
const MOST_SIDES: usize = 12;
const MOST_CORNERS: usize = 256;
/// The least sine by which a side of what is joined turns from the one before it, unless it goes straight on.
const LEAST_TURN: f64 = 1e-6;
/// The share of a side's length from which on another is about as long: noise makes them differ.
const AS_LONG: f64 = 0.999;
/// Rounds of joining, each of which may double a polygon.
const ROUNDS: usize = 24;
/// Polygons with a common side, or segments with a common end, that are looked at: of any number of them most lie in planes of their own, or on lines.
const MOST_AT_A_SIDE: usize = 8;

/// Twice the area over the square of the longest side from which on a polygon's normal is told, to less than 1e-10; and by how much the parts of unit vectors across it, and their squares, are off then at most.
const LEAST_WIDTH: f64 = 1e-5;
const NOISE: f64 = 1e-9;

/// A site, or several that are one convex set.
#[derive(Clone, Debug)]
pub(in crate::dilation) struct Figure {
    pub(super) outline: Outline,
    /// See [`Weighted`].
    pub(super) deficit: f64,
}

#[derive(Clone, Debug)]
pub(super) enum Outline {
    Point(Point),
    Segment([Point; 2]),
    Polygon(Polygon),
    Polyhedron(Polyhedron),
}

/// The line, or the plane, that differences of a figure's places are along.
#[derive(Clone, Copy, Debug)]
pub(in crate::dilation) enum Span {
    /// Along a unit vector.
    Line(Point),
    /// Across a unit vector.
    Plane(Point),
    /// Along any, or not known.
    Space,
}

impl Span {
    /// The length of the part of a unit vector along it, at most.
    #[inline]
    pub(in crate::dilation) fn along(&self, direction: &Point) -> f64 {
        match self {
            Self::Line(way) => dot(way, direction).abs() + NOISE,
            Self::Plane(up) => (1.0 - dot(up, direction).powi(2) + NOISE).max(0.0).sqrt(),
            Self::Space => 1.0,
        }
    }
}

/// A convex polygon.
#[derive(Clone, Debug)]
pub(super) struct Polygon {
    /// Counter-clockwise about `up`.
    pub(super) corners: Box<[Point]>,
    /// Its unit normal; 0 where there is none.
    pub(super) up: Point,
    /// The unit vectors in its plane out of its sides, of which the first begins at the first corner.
    pub(super) outward: Box<[Point]>,
}

impl From<Weighted> for Figure {
    fn from(Weighted { site, deficit }: Weighted) -> Self {
        // Zeros have two signs: places that are the same have the same bits.
        let place = |at: Point| at.map(|x| x + 0.0);
        let outline = match site {
            Site::Point(at) => Outline::Point(place(at)),
            Site::Segment(ends) => Outline::Segment(ends.map(place)),
            Site::Triangle(corners) => Outline::Polygon(Polygon::new(Box::new(corners.map(place)))),
        };
        Self { outline, deficit }
    }
}

impl Figure {
    /// Where it is, if it is a point that no radius of its own belongs to.
    pub(super) fn point(&self) -> Option<Point> {
        match self.outline {
            Outline::Point(at) if self.deficit == 0.0 => Some(at),
            _ => None,
        }
    }

    /// Points, without deficits.
    pub(in crate::dilation) fn of_points(points: &[Point]) -> Vec<Self> {
        points.iter().map(|&at| Self { outline: Outline::Point(at), deficit: 0.0 }).collect()
    }

    /// The convex hull of these is the figure.
    pub(in crate::dilation) fn corners(&self) -> &[Point] {
        match &self.outline {
            Outline::Point(at) => std::slice::from_ref(at),
            Outline::Segment(ends) => ends,
            Outline::Polygon(polygon) => &polygon.corners,
            Outline::Polyhedron(polyhedron) => &polyhedron.corners,
        }
    }

    /// What its places differ along.
    pub(in crate::dilation) fn span(&self) -> Span {
        match &self.outline {
            Outline::Point(_) => Span::Line([0.0; 3]),
            Outline::Segment([a, b]) => Span::Line(unit(&subtract(b, a))),
            Outline::Polygon(polygon) if polygon.is_wide() => Span::Plane(polygon.up),
            Outline::Polygon(_) | Outline::Polyhedron(_) => Span::Space,
        }
    }

    /// A ball around it.
    pub(in crate::dilation) fn ball(&self) -> Ball {
        let corners = self.corners();
        let centre: Point = std::array::from_fn(|axis| corners.iter().map(|corner| corner[axis]).sum::<f64>() / corners.len() as f64);
        Ball { centre, radius: corners.iter().map(|corner| distance_squared(corner, &centre)).fold(0.0, f64::max).sqrt() }
    }

    pub(super) fn polygon(&self) -> Option<&Polygon> {
        if let Outline::Polygon(polygon) = &self.outline { Some(polygon) } else { None }
    }

    /// The union with another, which has a side in common with it, or an end: then both ends of the side are there.
    fn joined(&self, other: &Self, [p, q]: [&Point; 2], flatness: f64, within: f64) -> Option<Outline> {
        match (&self.outline, &other.outline) {
            (Outline::Segment(own), Outline::Segment(theirs)) => straight(own, theirs, p, flatness).map(Outline::Segment),
            (Outline::Polygon(own), Outline::Polygon(theirs)) => own.joined(theirs, [p, q], flatness, within).map(Outline::Polygon),
            _ => None,
        }
    }

    /// About the area of its dilation by a radius: that of a polyhedron, or of both sides of a polygon, around a segment, or of a ball.
    pub(super) fn area(&self, radius: f64) -> f64 {
        match &self.outline {
            Outline::Point(_) => 2.0 * TAU * radius * radius,
            Outline::Segment([a, b]) => TAU * radius * distance_squared(a, b).sqrt(),
            Outline::Polygon(polygon) => polygon.double(),
            Outline::Polyhedron(polyhedron) => polyhedron.area(),
        }
    }

    /// Its box.
    pub(in crate::dilation) fn bounds(&self) -> [Point; 2] {
        box_of(self.corners())
    }

    /// A box around all that is no farther from it than a distance.
    pub(super) fn box_within(&self, distance: f64) -> Box32 {
        box_around(self.corners(), distance)
    }
}

/// The corners of figures that are triangles, with no deficit; none where others are among them.
pub(super) fn triangles(figures: &[Figure]) -> Option<Vec<[Point; 3]>> {
    figures.iter().map(|figure| if figure.deficit == 0.0 { figure.corners().try_into().ok() } else { None }).collect()
}

impl Convex for Figure {
    #[inline]
    fn deficit(&self) -> f64 {
        self.deficit
    }

    #[inline]
    fn closest(&self, x: &Point) -> Point {
        match &self.outline {
            Outline::Point(at) => *at,
            Outline::Segment([a, b]) => closest_on_segment(x, a, b),
            Outline::Polygon(polygon) => polygon.closest(x),
            Outline::Polyhedron(polyhedron) => polyhedron.closest(x),
        }
    }

    #[inline]
    fn highest(&self, direction: &Point) -> f64 {
        highest(self.corners(), direction)
    }
}

impl Polygon {
    /// The polygon with some corners, in their order.
    pub(super) fn new(corners: Box<[Point]>) -> Self {
        let from = |corner: &Point| subtract(corner, &corners[0]);
        // By the side itself, which loses nothing where it is short.
        let fan = corners.windows(2).map(|pair| cross(&from(&pair[0]), &subtract(&pair[1], &pair[0])));
        let across = fan.fold([0.0; 3], |sum: Point, part| std::array::from_fn(|axis| sum[axis] + part[axis]));
        let length = dot(&across, &across).sqrt();
        let up = if length > 0.0 { across.map(|part| part / length) } else { [0.0; 3] };
        let out = |side: usize| unit(&cross(&subtract(&corners[(side + 1) % corners.len()], &corners[side]), &up));
        let outward = (0..corners.len()).map(out).collect();
        Self { corners, up, outward }
    }

    /// The same with all places less `origin`.
    pub(super) fn from(&self, origin: &Point) -> Self {
        Self { corners: self.corners.iter().map(|corner| subtract(corner, origin)).collect(), up: self.up, outward: self.outward.clone() }
    }

    /// The ends of its sides, in their order.
    pub(super) fn sides(&self) -> impl Iterator<Item = [Point; 2]> {
        let ends = self.corners.iter().skip(1).chain(self.corners.first());
        self.corners.iter().zip(ends).map(|(from, to)| [*from, *to])
    }

    #[inline]
    pub(super) fn closest(&self, x: &Point) -> Point {
        if let [a, b, c] = &*self.corners {
            return closest_on_triangle(x, a, b, c);
        }
        let mut best: Option<(f64, Point)> = None;
        for (side, (from, out)) in self.corners.iter().zip(&self.outward).enumerate() {
            // Beyond sides, the closest point is on one of these; and where it is between the ends of one, no other is as close.
            let way = subtract(x, from);
            if dot(out, &way) > 0.0 {
                let to = &self.corners[if side + 1 < self.corners.len() { side + 1 } else { 0 }];
                let along = subtract(to, from);
                // In the plane: short sides may rise out of it as steeply as rounding makes them.
                let rise = dot(&along, &self.up);
                let along: Point = std::array::from_fn(|axis| along[axis] - rise * self.up[axis]);
                let (part, whole) = (dot(&way, &along), dot(&along, &along));
                if 0.0 < part && part < whole {
                    return between(from, to, part / whole);
                }
                let end = if part > 0.0 { to } else { from };
                let square = distance_squared(x, end);
                if best.is_none_or(|(least, _)| square < least) {
                    best = Some((square, *end));
                }
            }
        }
        best.map_or_else(
            || {
                let height = self.height(x);
                std::array::from_fn(|axis| x[axis] - height * self.up[axis])
            },
            |(_, on)| on,
        )
    }

    /// How high x is above its plane.
    fn height(&self, x: &Point) -> f64 {
        dot(&self.up, &subtract(x, &self.corners[0]))
    }

    /// Whether it is so wide that its normal is not what rounding makes of it.
    fn is_wide(&self) -> bool {
        let longest = self.sides().map(|[from, to]| distance_squared(&from, &to)).fold(0.0, f64::max);
        self.double() > LEAST_WIDTH * longest
    }

    /// Twice its area.
    pub(super) fn double(&self) -> f64 {
        let origin = &self.corners[0];
        let fan = self.corners.windows(2).map(|pair| dot(&self.up, &cross(&subtract(&pair[0], origin), &subtract(&pair[1], origin))));
        fan.sum()
    }

    /// The corners in their order about a normal, from the second end of a side, given by its first end, to the first.
    fn starting_after(&self, up: &Point, side: [&Point; 2]) -> Option<Vec<Point>> {
        let mut corners = self.corners.to_vec();
        if dot(&self.up, up) < 0.0 {
            corners.reverse();
        }
        let first = corners.iter().position(|corner| corner == side[1])?;
        corners.rotate_left(first);
        (corners.last() == Some(side[0])).then_some(corners)
    }

    /// The union with a polygon across a side, if it is convex, flat to within `flatness`, and has few sides but for what is `within` so far of these.
    fn joined(&self, other: &Self, [p, q]: [&Point; 2], flatness: f64, within: f64) -> Option<Self> {
        // The larger one's normal is the more exact.
        let up = if self.double() >= other.double() { self.up } else { other.up };
        if up == [0.0; 3] {
            return None;
        }
        // Both have the side, in opposite directions if they lie on opposite sides of it.
        let (own, theirs) = match (self.starting_after(&up, [p, q]), other.starting_after(&up, [q, p])) {
            (Some(own), Some(theirs)) => (own, theirs),
            _ => (self.starting_after(&up, [q, p])?, other.starting_after(&up, [p, q])?),
        };
        let kept = |before: &Point, corner: &Point, after: &Point| turn(&up, before, corner, after, flatness);
        let (last, end) = (own.len() - 1, theirs.len() - 1);
        let keeps_first = kept(&theirs[end - 1], &own[0], &own[1])?;
        let keeps_last = kept(&own[last - 1], &own[last], &theirs[1])?;
        let mut corners = own[usize::from(!keeps_first)..last].to_vec();
        corners.extend(keeps_last.then_some(own[last]));
        corners.extend(&theirs[1..end]);
        if !(3..=MOST_CORNERS).contains(&corners.len()) {
            return None;
        }
        let union = Self::new(corners.into());
        let is_flat = |corner: &Point| union.height(corner).abs() <= flatness;
        let is_legal = self.corners.iter().chain(&other.corners).all(is_flat)
            && (union.corners.len() <= MOST_SIDES || union.main_sides(within, |_| false).len() <= MOST_SIDES);
        is_legal.then_some(union)
    }
}

/// The segment that two make which go straight on at a common end.
fn straight(own: &[Point; 2], theirs: &[Point; 2], end: &Point, flatness: f64) -> Option<[Point; 2]> {
    let [before, after] = [own, theirs].map(|ends| ends[usize::from(ends[0] == *end)]);
    let (from, to, along) = (subtract(end, &before), subtract(&after, end), subtract(&after, &before));
    let twice = cross(&from, &to);
    let is_straight = dot(&twice, &twice) <= flatness * flatness * dot(&along, &along) && dot(&from, &to) > 0.0;
    is_straight.then_some([before, after])
}

/// Whether a corner is one where the outline turns left, rather than one where it goes straight on; none where it turns right, or hardly.
fn turn(up: &Point, before: &Point, corner: &Point, after: &Point, flatness: f64) -> Option<bool> {
    let (from, to, along) = (subtract(corner, before), subtract(after, corner), subtract(after, before));
    let twice = dot(up, &cross(&from, &to));
    if twice.abs() <= flatness * dot(&along, &along).sqrt() && dot(&from, &to) > 0.0 {
        return Some(false);
    }
    (twice > LEAST_TURN * (dot(&from, &from) * dot(&to, &to)).sqrt()).then_some(true)
}

/// A side of a polygon, or an end of a segment as one of no length.
pub(super) struct Side {
    length: f64,
    /// In ascending order, whichever way the polygon goes.
    pub(super) ends: [Point; 2],
    pub(super) figure: u32,
}

impl Side {
    /// Those of some figures, the longest first, and those between the same ends one after the other. Sides that are about as long are in the order of their places, by which polygons grow side by side.
    pub(super) fn of_all(figures: &[Figure]) -> Vec<Self> {
        let mut sides = Vec::new();
        for (index, figure) in (0..).zip(figures) {
            let mut add = |[from, to]: [Point; 2]| {
                let ends = if order(&from, &to).is_lt() { [from, to] } else { [to, from] };
                sides.push(Self { length: distance_squared(&from, &to).sqrt(), ends, figure: index });
            };
            match &figure.outline {
                Outline::Point(_) | Outline::Polyhedron(_) => {}
                Outline::Segment(ends) => ends.iter().for_each(|end| add([*end; 2])),
                Outline::Polygon(polygon) => polygon.sides().for_each(add),
            }
        }
        let place = |a: &Self, b: &Self| order(&a.ends[0], &b.ends[0]).then_with(|| order(&a.ends[1], &b.ends[1]));
        sides.sort_unstable_by(|a, b| b.length.total_cmp(&a.length));
        let mut longest = f64::INFINITY;
        for side in &mut sides {
            if side.length < AS_LONG * longest {
                longest = side.length;
            }
            side.length = longest;
        }
        sides.sort_unstable_by(|a, b| b.length.total_cmp(&a.length).then_with(|| place(a, b)).then(a.figure.cmp(&b.figure)));
        sides
    }
}

/// The box of some places: its lowest and its highest corner.
pub(super) fn box_of<'p>(places: impl IntoIterator<Item = &'p Point>) -> [Point; 2] {
    places.into_iter().fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[low, high], at| {
        [std::array::from_fn(|axis| low[axis].min(at[axis])), std::array::from_fn(|axis| high[axis].max(at[axis]))]
    })
}

/// A box around all that is no farther from that of some places than a distance.
pub(super) fn box_around(places: &[Point], distance: f64) -> Box32 {
    let [low, high] = box_of(places);
    Box32::of(&[low.map(|x| x - distance), high.map(|x| x + distance)])
}

/// The largest value of some places along a direction.
pub(super) fn highest(places: &[Point], direction: &Point) -> f64 {
    places.iter().map(|at| dot(at, direction)).fold(f64::NEG_INFINITY, f64::max)
}

/// The order of places: along the first axis, then the others.
pub(super) fn order(a: &Point, b: &Point) -> Ordering {
    (0..3).map(|axis| a[axis].total_cmp(&b[axis])).fold(Ordering::Equal, Ordering::then)
}

/// Figures with polygons of one radius joined across their common sides, the longest first, as far as unions are convex and flat to within `flatness`. Sides that turn by little, and
/// leave no more than `within` beyond others, are no hindrance. Segments that go straight on at a common end are joined, too.
///
/// # Errors
/// [`Stopped`].
pub(super) fn joined(mut figures: Vec<Figure>, flatness: f64, within: f64, budget: &Budget) -> Result<Vec<Figure>, Stopped> {
    for _ in 0..ROUNDS {
        budget.cancel.check()?;
        let sides = Side::of_all(&figures);
        let mut is_taken = vec![false; figures.len()];
        let mut gone = vec![false; figures.len()];
        for around in sides.chunk_by(|a, b| a.ends == b.ends).filter(|around| around.len() <= MOST_AT_A_SIDE) {
            for (place, one) in around.iter().enumerate() {
                for other in &around[place + 1..] {
                    let [own, theirs] = [one, other].map(|side| side.figure as usize);
                    if own == theirs
                        || is_taken[own]
                        || is_taken[theirs]
                        || figures[own].deficit.to_bits() != figures[theirs].deficit.to_bits()
                    {
                        continue;
                    }
                    let side = [&one.ends[0], &one.ends[1]];
                    let Some(union) = figures[own].joined(&figures[theirs], side, flatness, within) else { continue };
                    figures[own].outline = union;
                    gone[theirs] = true;
                    (is_taken[own], is_taken[theirs]) = (true, true);
                }
            }
        }
        if !gone.contains(&true) {
            break;
        }
        leave_out(&mut figures, gone);
    }
    Ok(figures)
}

/// Leaves out the figures that are gone.
pub(super) fn leave_out(figures: &mut Vec<Figure>, gone: Vec<bool>) {
    let mut gone = gone.into_iter();
    figures.retain(|_| !gone.next().unwrap_or_default());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split_mix::Random;

    fn joined_of(triangles: &[[Point; 3]]) -> Vec<Figure> {
        let figures = triangles.iter().map(|corners| Weighted { site: Site::Triangle(*corners), deficit: 0.0 }.into()).collect();
        joined(figures, 1e-12, 1e-3, &Budget::default()).unwrap()
    }

    /// What is joined is the same set: places are as far from it as from the triangles.
    #[test]
    fn joined_polygons_are_as_far_as_their_triangles() {
        let mut random = Random(3);
        for round in 0..40 {
            let (side, mut triangles) = (2 + round % 5, Vec::new());
            // A grid in a plane of its own, with holes, and some triangles turned over or in another plane.
            let tilt = if round % 2 == 0 { 0.0 } else { 0.4 };
            let (sine, cosine) = (tilt * 1.3_f64).sin_cos();
            let at =
                |i: usize, j: usize| -> Point { [cosine * i as f64, sine * j as f64 + 0.7 * sine * i as f64, tilt * i as f64 + j as f64] };
            for j in 0..side {
                for i in 0..side {
                    if random.next().is_multiple_of(5) {
                        continue;
                    }
                    let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                    let lifted = if random.next().is_multiple_of(7) { [b[0], b[1], b[2] + 0.3] } else { b };
                    triangles.push([a, lifted, c]);
                    triangles.push(if random.next().is_multiple_of(2) { [a, c, d] } else { [d, c, a] });
                }
            }
            if triangles.is_empty() {
                continue;
            }
            let figures = joined_of(&triangles);
            assert!(side < 3 || 3 * figures.len() < 2 * triangles.len(), "{round}: {} of {}", figures.len(), triangles.len());
            for _ in 0..200 {
                let x: Point = std::array::from_fn(|_| (side as f64 + 2.0) * random.share() - 1.0);
                let of_triangles = triangles.iter().map(|[a, b, c]| distance_squared(&x, &closest_on_triangle(&x, a, b, c)));
                let least = of_triangles.fold(f64::INFINITY, f64::min).sqrt();
                let joined = figures.iter().map(|figure| figure.distance_squared(&x)).fold(f64::INFINITY, f64::min).sqrt();
                assert!((least - joined).abs() < 1e-9, "{round}: {x:?} {least} {joined}");
            }
        }
    }

    /// Sides so short that rounding tilts them, in polygons whose corners are off their plane by as much: the closest place is no farther than those of all sides.
    #[test]
    fn short_sides_hide_no_closer_place() {
        let mut random = Random(11);
        let mut beside = 0;
        for round in 0..4_000 {
            let size = [1e-13, 1e-12, 1e-10, 1e-8][round % 4];
            let flatness = 7.8e-14;
            let mut off = || flatness * (2.0 * random.share() - 1.0);
            let flat = [[0.0, 0.0], [size, 0.2 * size], [size, 5.0], [-10.0, 5.0], [-10.0, 0.0]];
            let polygon = Polygon::new(flat.map(|[x, y]| [x, y, off()]).into());
            // In the slab between the ends of the short side, above the polygon or beyond its side.
            let [from, to] = [polygon.corners[0], polygon.corners[1]];
            let along = unit(&subtract(&to, &from));
            let way: Point = std::array::from_fn(|_| 4.0 * random.share() - 2.0);
            let (part, share) = (dot(&way, &along), random.share() * size);
            let x = std::array::from_fn(|axis| from[axis] + way[axis] + (share - part) * along[axis]);
            let found = distance_squared(&x, &polygon.closest(&x)).sqrt();
            let of_sides = polygon.sides().map(|[from, to]| distance_squared(&x, &closest_on_segment(&x, &from, &to)));
            let least = of_sides.fold(f64::INFINITY, f64::min).sqrt();
            beside += usize::from(found < least - 1e-9);
            assert!(found <= least + 1e-12, "{round}: {x:?}, {found} and {least}");
        }
        assert!(beside > 100, "{beside} above the polygon");
    }

    #[test]
    fn a_plate_with_a_hole_is_a_few_rectangles_and_radii_stay_apart() {
        let at = |i: usize, j: usize| -> Point { [i as f64, j as f64, 0.0] };
        let cells = (0..36).map(|cell| (cell % 6, cell / 6)).filter(|&(i, j)| !((2..4).contains(&i) && (2..4).contains(&j)));
        let triangles: Vec<[Point; 3]> =
            cells.flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]).collect();
        assert_eq!(triangles.len(), 64);
        assert!(joined_of(&triangles).len() <= 12, "{}", joined_of(&triangles).len());
        let two =
            [0.0, 0.5].into_iter().zip(&triangles).map(|(deficit, corners)| Weighted { site: Site::Triangle(*corners), deficit }.into());
        assert_eq!(joined(two.collect(), 1e-12, 1e-3, &Budget::default()).unwrap().len(), 2);
    }

    /// Also where rounding moves all corners off the plane, and makes equal sides differ.
    #[test]
    fn a_grid_in_any_plane_is_one_rectangle() {
        for count in [4, 20] {
            for tilt in [0.0, 0.37] {
                let (sine, cosine) = f64::sin_cos(tilt);
                let at = |i: usize, j: usize| -> Point {
                    let [x, y] = [i, j].map(|index| 100.0 * index as f64 / count as f64);
                    let [x, z] = [x * cosine, x * sine];
                    [x, y * cosine - z * sine, y * sine + z * cosine]
                };
                let cells = (0..count * count).map(|cell| (cell % count, cell / count));
                let halves = |(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]];
                let triangles: Vec<[Point; 3]> = cells.flat_map(halves).collect();
                assert_eq!(joined_of(&triangles).len(), 1, "{count} {tilt}");
            }
        }
    }

    /// Also where others end, or cross; not where a segment turns, or goes back.
    #[test]
    fn segments_that_go_straight_on_are_one() {
        let at = |x: f64, y: f64| -> Point { [0.1 + 0.3 * x - 0.2 * y, 0.7 - 0.1 * x + 0.5 * y, 0.2 * x] };
        let segment = |from: Point, to: Point| Figure::from(Weighted { site: Site::Segment([from, to]), deficit: 0.0 });
        let count = |figures: Vec<Figure>| joined(figures, 1e-12, 1e-3, &Budget::default()).unwrap().len();
        let line = || (0..20).map(|k| segment(at(f64::from(k), 0.0), at(f64::from(k + 1), 0.0)));
        assert_eq!(count(line().collect()), 1);
        let across = (0..20).map(|k| segment(at(10.0, f64::from(k) - 10.0), at(10.0, f64::from(k) - 9.0)));
        assert_eq!(count(line().chain(across).collect()), 2);
        let ends = [[3.0, 1.0], [5.0, 2.0]].map(|[x, y]| segment(at(x, y), at(x, 0.0)));
        assert_eq!(count(line().chain(ends).collect()), 3);
        let other = Figure { deficit: 0.1, ..segment(at(20.0, 0.0), at(21.0, 0.0)) };
        assert_eq!(count(line().chain([other]).collect()), 2);
        assert_eq!(count(vec![segment(at(0.0, 0.0), at(1.0, 0.0)), segment(at(1.0, 0.0), at(2.0, 1e-6))]), 2);
        assert_eq!(count(vec![segment(at(0.0, 0.0), at(1.0, 0.0)), segment(at(1.0, 0.0), at(0.5, 0.0))]), 2);
    }
}
