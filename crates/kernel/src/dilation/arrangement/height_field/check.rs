//! Whether a triangle is between two distances from a graph.

use super::field::Field;
use super::ground::Ground;
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract, unit};
use crate::measure::contact::closest_on_segments;
use crate::measure::triangle::closest_on_triangle;
use crate::solid::box_tree::{Box32, BoxTree};

/// How often a triangle is halved at most where only faces below its parts are asked, and how often these are where all are; and how many parts are looked at.
const QUICK: u32 = 4;
const DEPTH: u32 = 24;
const MOST_PARTS: u32 = 1 << 16;
/// Of what is wider than the outer distance by this factor, nothing covers all.
const WIDE: f64 = 4.0;
/// How often the way between two triangles is sought from one to the other before corners and sides are.
const STEPS: usize = 2;
/// What rounding adds to a radius at most, as a share of it.
const ROUNDED: f64 = 1e-12;

/// A place where a triangle may not be as it is.
#[derive(Clone, Copy, Debug)]
pub(super) enum Fault {
    /// The place, and what of the graph is close to it.
    Near(Point, Point),
    Far(Point),
}

/// A triangle to look at, the triangles of the graph that are closest to its corners, where they are known, and the distances that it has to be between.
pub(super) struct Question {
    pub(super) triangle: [Point; 3],
    pub(super) owners: [u32; 3],
    pub(super) inner: f64,
    pub(super) outer: f64,
}

/// The triangles of a graph, for searches.
pub(super) struct Faces {
    all: Vec<Face>,
    pub(super) tree: BoxTree,
}

/// A triangle of the graph, and the ball around its middle that holds it.
struct Face {
    corners: [Point; 3],
    centre: Point,
    radius: f64,
}

impl Face {
    fn highest(&self, direction: &Point) -> f64 {
        self.corners.iter().map(|corner| dot(direction, corner)).fold(f64::NEG_INFINITY, f64::max)
    }

    fn closest(&self, x: &Point) -> Point {
        let [a, b, c] = &self.corners;
        closest_on_triangle(x, a, b, c)
    }

    fn square(&self, x: &Point) -> f64 {
        distance_squared(x, &self.closest(x))
    }

    /// Whether all of a triangle is near to it, as its corners are: the distance from a convex body is convex.
    fn covers(&self, triangle: &[Point; 3], most: f64) -> bool {
        triangle.iter().all(|corner| self.square(corner) <= most * most)
    }

    /// Whether a plane across a direction parts it from a triangle by a distance.
    fn is_parted(&self, triangle: &[Point; 3], direction: &Point, least: f64) -> bool {
        lowest(triangle, direction) - self.highest(direction) >= least
    }

    /// Whether a plane across the way from it to a triangle shows that both are as far apart. The way is found by going back and forth, from the middle.
    fn is_apart(&self, triangle: &[Point; 3], centre: &Point, least: f64) -> bool {
        let [a, b, c] = triangle;
        let mut q = *centre;
        for _ in 0..STEPS {
            let p = self.closest(&q);
            if self.is_parted(triangle, &unit(&subtract(&q, &p)), least) {
                return true;
            }
            q = closest_on_triangle(&p, a, b, c);
        }
        false
    }

    /// Where a triangle is nearer to it than a distance, and what is close to that place, unless a plane parts them by as much: the one across the way between their closest places, which are at a corner of either or on two sides.
    fn too_near(&self, triangle: &[Point; 3], least: f64) -> Option<[Point; 2]> {
        let [a, b, c] = triangle;
        let corners = triangle.iter().map(|corner| [*corner, self.closest(corner)]);
        let own = self.corners.iter().map(|corner| [closest_on_triangle(corner, a, b, c), *corner]);
        let side = |corners: &[Point; 3], k: usize| [corners[k], corners[(k + 1) % 3]];
        let sides = (0..9).map(|k| {
            let (q, p) = closest_on_segments(&side(triangle, k / 3), &side(&self.corners, k % 3));
            [q, p]
        });
        let all = corners.chain(own).chain(sides);
        let [q, p] = all.min_by(|[a, b], [c, d]| distance_squared(a, b).total_cmp(&distance_squared(c, d)))?;
        (!self.is_parted(triangle, &unit(&subtract(&q, &p)), least)).then_some([q, p])
    }
}

pub(super) fn middle(triangle: &[Point; 3]) -> Point {
    std::array::from_fn(|axis| (triangle[0][axis] + triangle[1][axis] + triangle[2][axis]) / 3.0)
}

fn lowest(triangle: &[Point; 3], direction: &Point) -> f64 {
    triangle.iter().map(|corner| dot(direction, corner)).fold(f64::INFINITY, f64::min)
}

/// How far the corners of a triangle are from a place at most.
fn radius(triangle: &[Point; 3], centre: &Point) -> f64 {
    triangle.iter().map(|corner| distance_squared(corner, centre)).fold(0.0, f64::max).sqrt() * (1.0 + ROUNDED)
}

/// Both halves of a triangle, parted in the middle of its longest side.
fn halves(triangle: &[Point; 3]) -> [[Point; 3]; 2] {
    let long = |k: usize| distance_squared(&triangle[k], &triangle[(k + 1) % 3]);
    let k = (1..3).fold(0, |best, k| if long(k) > long(best) { k } else { best });
    let (a, b, c) = (triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3]);
    let half: Point = std::array::from_fn(|axis| 0.5 * (a[axis] + b[axis]));
    [[a, half, c], [half, b, c]]
}

impl Faces {
    pub(super) fn new(ground: &Ground) -> Self {
        let face = |triangle: usize| {
            let corners = ground.points(triangle);
            let centre = middle(&corners);
            Face { corners, centre, radius: radius(&corners, &centre) }
        };
        let all: Vec<Face> = (0..ground.triangles.len()).map(face).collect();
        let mut tree = BoxTree::default();
        tree.build(all.len(), |item| Some(Box32::of(&all[item as usize].corners)), false);
        Self { all, tree }
    }

    /// Calls `visit` with the faces whose boxes are within a distance of a triangle's, until it answers false.
    pub(super) fn around(&self, triangle: &[Point; 3], distance: f64, mut visit: impl FnMut(u32) -> bool) {
        let grown = |by: f64| triangle.map(|corner| corner.map(|x| x + by));
        let within = Box32::of(&[grown(-distance), grown(distance)].concat());
        self.tree.query(&within, 0, |leaf| {
            let mut own = self.tree.items(leaf).iter().zip(self.tree.boxes(leaf));
            own.all(|(&item, theirs)| !within.meets(theirs) || visit(item))
        });
    }

    /// Where a triangle is nearer or farther than it has to be, with a list to be used. Cost: about ten microseconds.
    pub(super) fn fault(&self, field: &Field, question: &Question, near: &mut Vec<u32>) -> Option<Fault> {
        let Question { triangle, inner, .. } = question;
        let normal = unit(&cross(&subtract(&triangle[1], &triangle[0]), &subtract(&triangle[2], &triangle[0])));
        let highest = lowest(triangle, &normal) - inner;
        let centre = middle(triangle);
        let wide = inner + radius(triangle, &centre);
        let mut found = None;
        self.around(triangle, *inner, |item| {
            let face = &self.all[item as usize];
            let is_far = dot(&normal, &face.centre) + face.radius <= highest
                || distance_squared(&face.centre, &centre) >= (wide + face.radius).powi(2)
                || face.highest(&normal) <= highest
                || face.is_apart(triangle, &centre, *inner);
            if !is_far {
                found = face.too_near(triangle, *inner);
            }
            found.is_none()
        });
        if let Some([place, close]) = found {
            return Some(Fault::Near(place, close));
        }
        self.far(field, question, triangle, near, QUICK).map(Fault::Far)
    }

    /// A place of a part of a triangle that is too far from all faces. Faces below the middles of parts, and those that are closest to the corners, mostly show that all of these are near to them; for the rest all are asked.
    fn far(&self, field: &Field, question: &Question, part: &[Point; 3], near: &mut Vec<u32>, depth: u32) -> Option<Point> {
        let &Question { inner, outer, owners, .. } = question;
        let centre = middle(part);
        let below = field.top([centre[0], centre[1]], 0.5 * (inner + outer)).map_or(u32::MAX, |top| top.owner);
        let face = |owner: u32| self.all.get(owner as usize);
        if face(below).is_some_and(|face| face.square(&centre).sqrt() + radius(part, &centre) <= outer)
            || [below, owners[0], owners[1], owners[2]].into_iter().filter_map(face).any(|face| face.covers(part, outer))
        {
            return None;
        }
        if depth > 0 {
            return halves(part).iter().find_map(|half| self.far(field, question, half, near, depth - 1));
        }
        if field.top([centre[0], centre[1]], outer).is_none_or(|top| centre[2] > top.height) {
            return Some(centre);
        }
        near.clear();
        self.around(part, outer, |item| {
            near.push(item);
            true
        });
        Cover { faces: &self.all, most: outer, left: MOST_PARTS, near }.far(0, part, DEPTH)
    }
}

/// Whether faces are near to all of a triangle.
struct Cover<'a> {
    faces: &'a [Face],
    most: f64,
    /// Parts that may be looked at.
    left: u32,
    /// The faces near to it, and then those near to its parts.
    near: &'a mut Vec<u32>,
}

impl Cover<'_> {
    /// A place of a triangle that may be farther from all of the last faces, given the first of these. The distance grows by no more than the way; and where one face is near to all corners, it is near to all.
    fn far(&mut self, first: usize, triangle: &[Point; 3], depth: u32) -> Option<Point> {
        let (most, end) = (self.most, self.near.len());
        let centre = middle(triangle);
        let wide = radius(triangle, &centre);
        let reach = most + wide;
        let mut least = f64::INFINITY;
        for place in first..end {
            let item = self.near[place];
            let face = &self.faces[item as usize];
            if distance_squared(&face.centre, &centre) <= (reach + face.radius).powi(2) {
                let square = face.square(&centre);
                if square <= reach * reach {
                    least = least.min(square.sqrt());
                    self.near.push(item);
                }
            }
        }
        self.left = self.left.saturating_sub(1);
        let covers = |&item: &u32| self.faces[item as usize].covers(triangle, most);
        let found = if least > most || depth == 0 || self.left == 0 {
            Some(centre)
        } else if least + wide <= most || (wide < WIDE * most && self.near[end..].iter().any(covers)) {
            None
        } else {
            halves(triangle).iter().find_map(|half| self.far(end, half, depth - 1))
        };
        self.near.truncate(end);
        found
    }
}
