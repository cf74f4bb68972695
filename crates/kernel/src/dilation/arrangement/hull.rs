//! The polytopes of convex polygons and polyhedra.

use super::figure::{Figure, Polygon, highest};
use super::joints;
use super::polyhedron::Polyhedron;
use super::polytopes::{MOST_FACETS, OWN_SHIFT, Plane, Polytope, SHIFT, Shell, frame, height, meeting, normal, share};
use super::structure::Structure;
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract};
use std::f64::consts::PI;
use std::sync::Arc;

/// The least sine of a polygon's angles, else it is a needle: facets across its sides would meet too far away.
const LEAST_SINE: f64 = 1e-3;
/// Sides are left out where the lines of others meet as near to the polygon as this, in units of the band: what is left of that is cut off at the corners.
pub(super) const CORNER_SHARE: f64 = 0.25;
/// The least cosine of the angle between sides that are kept beside some that are not.
const LEAST_COSINE: f64 = 0.7;
/// Corners nearer to a plane than this, in units of the radius, are not told apart from it.
pub(super) const NOISE: f64 = 1e-9;
/// Faces of a polyhedron have one facet where the cosine of the angle between them is more than this.
const SAME_FACE: f64 = 0.999_999;
/// How far facets along a polyhedron's faces are lifted, in units of the band: where none are, there are up to a fifth more triangles, where they are as much as those along polygons, up to two fifths.
const FACE_LIFT: f64 = 0.1;
/// The facets along the polygon come first.
const FACES: usize = 2;

/// A polytope that is cut facet by facet, all places less the figure's first corner.
struct Hull {
    planes: Vec<Plane>,
    corners: Vec<(Point, [u16; 3])>,
    /// The squares of how far corners are from the figure, as far as that was asked: those of the last ones are missing.
    squares: Vec<f64>,
}

/// How far out facets are, which makes no four planes meet in a point but by chance: see `polytopes`.
struct Shifts<F> {
    room: f64,
    /// How far out all of them are, as a whole,
    all: f64,
    /// and each by itself.
    own: F,
}

fn shifts(shell: Shell, seed: u64) -> Shifts<impl Fn(usize) -> f64> {
    let room = SHIFT * (shell.outer - shell.inner);
    let all = shell.inner + (1.0 - OWN_SHIFT) * room * share(seed, 0);
    Shifts { room, all, own: move |facet| OWN_SHIFT * room * share(seed, 1 + facet as u64) }
}

impl Polytope {
    /// The polytope of a polygon in its shell; none where facets are too many or too small.
    ///
    /// Its facets touch the polygon's dilation by the inner radius, shifted outwards, all of them as a whole and a little against each other: two along the polygon, farther out, strips along its sides, as many as keep within the outer one, and at the
    /// corners one towards the farthest vertex, until none is beyond. Around needles, which are cut nowhere, it begins with a cuboid instead. So it lies between both dilations, where it is not cut as far beyond its sides as is said.
    pub(super) fn around(figure: &Figure, beyond: &[Option<f64>], shell: Shell, seed: u64) -> Option<Self> {
        let polygon = figure.polygon()?;
        let origin = polygon.corners[0];
        let polygon = polygon.from(&origin);
        let Shifts { room, all, own } = shifts(shell, seed);
        // Faces have nothing beyond them that would make up for what they lack: they are in the band's middle, where panels are as thick as they should be.
        let lift = |facet: usize| if facet < FACES { 0.5 * (shell.outer - shell.inner - room) } else { 0.0 };
        let offset = |facet: usize| all + lift(facet) + own(facet);
        // Sides that hardly turn would meet elsewhere, were they shifted against each other.
        let is_needle = polygon.is_needle();
        let within = CORNER_SHARE * (shell.outer - shell.inner);
        let sides = if is_needle { Vec::new() } else { polygon.main_sides(within, |side| beyond[side].is_some()) };
        let outside = |facet: usize| facet.checked_sub(FACES).map_or_else(|| offset(facet), |place| beyond[sides[place]].unwrap_or(all));
        let mut hull = if is_needle { Hull::cuboid(&polygon, offset)? } else { Hull::prism(&polygon, &sides, outside)? };
        let noise = NOISE * shell.outer;
        // A polygon around a circle: half of it between both faces.
        let strips = (PI / (2.0 * ((shell.inner + room) / shell.outer).clamp(0.0, 1.0).acos())).ceil() as usize;
        let up = normal(&hull.planes[0]);
        for (place, &side) in sides.iter().enumerate().filter(|&(_, &side)| beyond[side].is_none()) {
            let (out, corner) = (normal(&hull.planes[FACES + place]), &polygon.corners[side]);
            for k in 1..strips {
                let (sine, cosine) = (PI * k as f64 / strips as f64).sin_cos();
                let direction: Point = std::array::from_fn(|axis| cosine * up[axis] + sine * out[axis]);
                hull.cut(&direction, dot(&direction, corner) + offset(hull.planes.len()), noise)?;
            }
        }
        hull.cut_corners(|x| polygon.closest(x), shell.outer, offset, noise)?;
        hull.finish(&origin, joints::planes(figure, beyond), noise)
    }

    /// The polytope of a polyhedron in its shell, likewise: it begins with a cuboid, and has facets along the faces, a little farther out than they must be.
    pub(super) fn enclosing(polyhedron: &Polyhedron, shell: Shell, seed: u64) -> Option<Self> {
        let origin = polyhedron.corners[0];
        let polyhedron = polyhedron.from(&origin);
        let Shifts { all, own, .. } = shifts(shell, seed);
        let offset = |facet: usize| all + own(facet);
        let noise = NOISE * shell.outer;
        let mut normals: Vec<Point> = Vec::new();
        for up in polyhedron.normals() {
            if normals.iter().all(|other| dot(other, &up) < SAME_FACE) {
                normals.push(up);
            }
        }
        let [x, y, up] = frame(normals.first()?);
        let lift = FACE_LIFT * (shell.outer - shell.inner);
        let is_opposite = |other: &Point| dot(other, &up) < -SAME_FACE;
        let lifts = [lift, if normals.iter().any(is_opposite) { lift } else { 0.0 }];
        let of_cuboid = |facet: usize| offset(facet) + lifts.get(facet).unwrap_or(&0.0);
        let mut hull = Hull::upright(&polyhedron.corners, &up, &[x, y, x.map(|part| -part), y.map(|part| -part)], of_cuboid)?;
        for up in normals[1..].iter().filter(|other| !is_opposite(other)) {
            hull.cut(up, highest(&polyhedron.corners, up) + offset(hull.planes.len()) + lift, noise)?;
        }
        hull.cut_corners(|x| polyhedron.closest(x), shell.outer, offset, noise)?;
        hull.finish(&origin, Box::default(), noise)
    }
}

impl Polygon {
    /// Whether a side nearly goes back along the one before it, or sides have no length.
    pub(super) fn is_needle(&self) -> bool {
        let sides: Vec<Point> = self.sides().map(|[from, to]| subtract(&to, &from)).collect();
        let length = |vector: &Point| dot(vector, vector).sqrt();
        let goes_on = |one: &Point, other: &Point| {
            let lengths = length(one) * length(other);
            length(&cross(one, other)) > LEAST_SINE * lengths || dot(one, other) > 0.0
        };
        !(0..sides.len()).all(|k| goes_on(&sides[k], &sides[(k + 1) % sides.len()]))
    }

    /// Sides, in their order, whose lines bound what is no farther from the polygon than `within`, or nearly: those that are needed, and of many that turn by little some.
    pub(super) fn main_sides(&self, within: f64, is_needed: impl Fn(usize) -> bool) -> Vec<usize> {
        let count = self.corners.len();
        let out = &self.outward;
        // Where the line of one meets that of a later one.
        let is_near = |one: usize, later: usize| {
            let along = cross(&self.up, &out[one]);
            let (sine, cosine) = (dot(&along, &out[later]), dot(&out[one], &out[later]));
            let from = self.corners[(one + 1) % count];
            let share = dot(&subtract(&self.corners[later], &from), &out[later]) / sine;
            let meeting: Point = std::array::from_fn(|axis| from[axis] + share * along[axis]);
            cosine > LEAST_COSINE && sine > 0.0 && distance_squared(&meeting, &self.closest(&meeting)) < within * within
        };
        let first = (0..count).find(|&side| is_needed(side)).unwrap_or_default();
        let (mut kept, mut place) = (vec![first], 1);
        while place < count {
            let at = |place: usize| (first + place) % count;
            let last = kept[kept.len() - 1];
            // As far as sides between may be left out; the first one ends the last.
            while place < count && !is_needed(at(place)) && is_near(last, at(place + 1)) {
                place += 1;
            }
            if place < count {
                kept.push(at(place));
            }
            place += 1;
        }
        kept.sort_unstable();
        kept
    }
}

impl Hull {
    /// Both faces, and a facet across the polygon at some of its sides.
    fn prism(polygon: &Polygon, sides: &[usize], offset: impl Fn(usize) -> f64) -> Option<Self> {
        let out: Vec<Point> = sides.iter().map(|&side| polygon.outward[side]).collect();
        Self::upright(&polygon.corners, &polygon.up, &out, offset)
    }

    /// A cuboid around a polygon, along its longest way from corner to corner.
    fn cuboid(polygon: &Polygon, offset: impl Fn(usize) -> f64) -> Option<Self> {
        let ways = polygon.corners.iter().enumerate().flat_map(|(k, p)| polygon.corners[..k].iter().map(move |q| subtract(p, q)));
        let along = ways.max_by(|a, b| dot(a, a).total_cmp(&dot(b, b)))?;
        let [x, y, along] = frame(&along);
        // What is left of the polygon's normal across it; where it has none, any direction does.
        let [right, up] = [&x, &y].map(|axis| dot(axis, &polygon.up));
        let length = right.hypot(up);
        let up = if length > 0.0 { std::array::from_fn(|axis| (right * x[axis] + up * y[axis]) / length) } else { y };
        let across = cross(&up, &along);
        Self::upright(&polygon.corners, &up, &[along, across, along.map(|x| -x), across.map(|x| -x)], offset)
    }

    /// Two faces, across a direction, and facets beside them, across others, all around some corners, in their order.
    fn upright(corners: &[Point], up: &Point, out: &[Point], offset: impl Fn(usize) -> f64) -> Option<Self> {
        let (count, mut planes) = (out.len(), Vec::<Plane>::new());
        for direction in [*up, up.map(|part| -part)].iter().chain(out) {
            let out = highest(corners, direction) + offset(planes.len());
            planes.push([direction[0], direction[1], direction[2], out]);
        }
        let mut hull = Self { planes, corners: Vec::new(), squares: Vec::new() };
        for face in 0..FACES {
            for side in 0..count {
                let facets = [face, FACES + side, FACES + (side + 1) % count].map(|facet| facet as u16);
                hull.corners.push((hull.at(facets)?, facets));
            }
        }
        Some(hull)
    }

    fn at(&self, facets: [u16; 3]) -> Option<Point> {
        let planes = facets.map(|facet| &self.planes[usize::from(facet)]);
        let normals = planes.map(normal);
        meeting([&normals[0], &normals[1], &normals[2]], planes.map(|plane| plane[3]))
    }

    /// Cuts off what is farther than `outer` from a figure, by planes across the ways to the corners that are farthest from it, until nothing is.
    fn cut_corners(&mut self, closest: impl Fn(&Point) -> Point, outer: f64, offset: impl Fn(usize) -> f64, noise: f64) -> Option<()> {
        loop {
            let known = self.squares.len();
            self.squares.extend(self.corners[known..].iter().map(|(corner, _)| distance_squared(corner, &closest(corner))));
            let (place, &square) = self.squares.iter().enumerate().max_by(|p, q| p.1.total_cmp(q.1))?;
            if square < outer * outer {
                return Some(());
            }
            let corner = self.corners[place].0;
            let touched = closest(&corner);
            let direction = subtract(&corner, &touched).map(|part| part / square.sqrt());
            self.cut(&direction, dot(&direction, &touched) + offset(self.planes.len()), noise)?;
        }
    }

    /// Cuts off what is beyond a plane. Corners of a simple polytope are neighbours if they have two facets in common.
    fn cut(&mut self, direction: &Point, distance: f64, noise: f64) -> Option<()> {
        let (facet, plane) = (self.planes.len(), [direction[0], direction[1], direction[2], distance]);
        if facet >= MOST_FACETS {
            return None;
        }
        let heights: Vec<f64> = self.corners.iter().map(|(corner, _)| height(&plane, corner)).collect();
        if heights.iter().any(|height| height.abs() < noise) {
            return None;
        }
        self.planes.push(plane);
        let mut made = Vec::new();
        for (_, beyond) in self.corners.iter().zip(&heights).filter(|&(_, &height)| height > 0.0).map(|(corner, _)| corner) {
            for (_, kept) in self.corners.iter().zip(&heights).filter(|&(_, &height)| height < 0.0).map(|(corner, _)| corner) {
                let mut common = beyond.iter().copied().filter(|own| kept.contains(own));
                if let (Some(first), Some(second)) = (common.next(), common.next()) {
                    let facets = [first, second, facet as u16];
                    made.push((self.at(facets)?, facets));
                }
            }
        }
        let mut height = heights.iter();
        self.squares.retain(|_| height.next().is_some_and(|height| *height < 0.0));
        let mut height = heights.iter();
        self.corners.retain(|_| height.next().is_some_and(|height| *height < 0.0));
        self.corners.extend(made);
        Some(())
    }

    /// Leaves out the facets that are gone.
    fn finish(self, origin: &Point, cuts: Box<[Plane]>, noise: f64) -> Option<Polytope> {
        let is_used = |facet: &usize| self.corners.iter().any(|(_, facets)| facets.contains(&(*facet as u16)));
        let used: Vec<usize> = (0..self.planes.len()).filter(is_used).collect();
        let renamed = |facet: u16| used.binary_search(&usize::from(facet)).map_or(u16::MAX, |place| place as u16);
        let planes: Vec<Plane> = used.iter().map(|&facet| self.planes[facet]).collect();
        let corners: Vec<[u16; 3]> = self.corners.iter().map(|(_, facets)| facets.map(renamed)).collect();
        let places: Vec<Point> = self.corners.iter().map(|&(at, _)| at).collect();
        let structure = Structure::simple(&planes, &corners, &places)?;
        // Nor so near to one that it may be beyond.
        if !structure.is_convex(&planes, &places, noise) {
            return None;
        }
        let moved = |at: &Point| std::array::from_fn(|axis| at[axis] + origin[axis]);
        let shifted = |plane: &Plane| [plane[0], plane[1], plane[2], plane[3] + dot(&normal(plane), origin)];
        let (planes, corners) = (planes.iter().map(shifted).collect(), places.iter().map(moved).collect());
        Some(Polytope::with(Arc::new(structure), planes, cuts, corners))
    }
}
