//! Whether a triangle is between two distances from a graph.

use super::super::between::{Body, Memory, lowest, middle, radius, too_far};
use super::field::Field;
use super::ground::Ground;
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract, unit};
use crate::dilation::arrangement::figure;
use crate::dilation::convex::Convex;
use crate::groups::Groups;
use crate::measure::triangle::closest_on_triangle;
use crate::solid::box_tree::{Box32, BoxTree};
use crate::solid::half_edges::{NONE, previous};

/// How often the way between two triangles is sought from one to the other before corners and sides are.
const STEPS: usize = 2;
/// Triangles that tell how many parts are near to each other, and how many near to one are asked for.
const SAMPLE: usize = 256;
const MOST_NEAR: usize = 4_096;

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

/// The triangles of a graph, or of the same upside down, for searches.
pub(super) struct Faces {
    pub(super) all: Vec<Face>,
    tree: BoxTree,
}

/// A triangle of the graph with its normal up, and the ball around its middle that holds it.
pub(super) struct Face {
    pub(super) corners: [Point; 3],
    pub(super) normal: Point,
    centre: Point,
    radius: f64,
}

impl Convex for Face {
    fn deficit(&self) -> f64 {
        0.0
    }

    #[inline]
    fn closest(&self, x: &Point) -> Point {
        let [a, b, c] = &self.corners;
        closest_on_triangle(x, a, b, c)
    }

    #[inline]
    fn highest(&self, direction: &Point) -> f64 {
        figure::highest(&self.corners, direction)
    }
}

impl Body for Face {
    fn corners(&self) -> impl AsRef<[Point]> {
        self.corners
    }

    #[inline]
    fn may_reach(&self, x: &Point, distance: f64) -> bool {
        distance_squared(&self.centre, x) <= (distance + self.radius).powi(2)
    }
}

impl Face {
    fn new(corners: [Point; 3]) -> Self {
        let [a, b, c] = &corners;
        let (normal, centre) = (unit(&cross(&subtract(b, a), &subtract(c, a))), middle(&corners));
        Self { normal, radius: radius(&corners, &centre), corners, centre }
    }

    /// Whether a plane shows that it is as far from a triangle: its own, or one across the way between both middles, or between closest places, which are found by going back and forth.
    fn is_apart(&self, triangle: &[Point; 3], centre: &Point, least: f64) -> bool {
        if lowest(triangle, &self.normal) - dot(&self.normal, &self.corners[0]) >= least
            || self.is_parted(triangle, &unit(&subtract(centre, &self.centre)), least)
        {
            return true;
        }
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
}

impl Faces {
    /// The triangles of a graph; upside down if `sign` is -1.
    pub(super) fn new(ground: &Ground, sign: f64) -> Self {
        let all: Vec<Face> = ground.triangles().map(|corners| Face::new(corners.map(|[x, y, z]| [x, y, sign * z]))).collect();
        let mut tree = BoxTree::default();
        tree.build(all.len(), |item| Some(Box32::of(&all[item as usize].corners)), false);
        Self { all, tree }
    }

    /// How far above the plane of a half-edge's face the corner beyond its other half is.
    #[inline]
    pub(super) fn above(&self, half: u32, twin: u32) -> f64 {
        let [Face { corners, normal, .. }, other] = [half, twin].map(|half| &self.all[(half / 3) as usize]);
        dot(normal, &subtract(&other.corners[(previous(twin) % 3) as usize], &corners[(half % 3) as usize]))
    }

    /// The largest height of all.
    pub(super) fn highest(&self) -> f64 {
        self.all.iter().flat_map(|face| face.corners).map(|corner| corner[2]).fold(f64::NEG_INFINITY, f64::max)
    }

    /// How many parts, of triangles in one plane each, are near to a triangle in the mean, from a sample; given how far off a plane corners may be, and how far what is near is.
    pub(super) fn crowding(&self, ground: &Ground, flatness: f64, distance: f64) -> f64 {
        let (count, mesh) = (self.all.len(), &ground.mesh);
        let mut groups = Groups::new(count);
        let pairs = (0..3 * mesh.triangles()).map(|half| (half, mesh.twin(half)));
        for (half, twin) in pairs.filter(|&(half, twin)| twin != NONE && twin > half) {
            if self.above(half, twin).abs() <= flatness {
                groups.join((half / 3) as usize, (twin / 3) as usize);
            }
        }
        let (step, mut near, mut total) = (count.div_ceil(SAMPLE), Vec::new(), 0);
        for face in (0..count).step_by(step) {
            near.clear();
            self.around(&self.all[face].corners, distance, |other| {
                near.push(groups.of(other as usize));
                near.len() < MOST_NEAR
            });
            near.sort_unstable();
            near.dedup();
            total += near.len();
        }
        total as f64 / count.div_ceil(step) as f64
    }

    /// Calls `visit` with the faces whose boxes are within a distance of a triangle's, until it answers false.
    pub(super) fn around(&self, triangle: &[Point; 3], distance: f64, mut visit: impl FnMut(u32) -> bool) {
        let grown = |by: f64| triangle.map(|corner| corner.map(|x| x + by));
        let within = Box32::of(&grown(-distance)).union(&Box32::of(&grown(distance)));
        self.tree.query(&within, 0, |leaf| {
            let mut own = self.tree.items(leaf).iter().zip(self.tree.boxes(leaf));
            own.all(|(&item, theirs)| !within.meets(theirs) || visit(item))
        });
    }

    /// Where a triangle is nearer or farther than it has to be. Cost: about a tenth of a microsecond for each face near to it.
    pub(super) fn fault(&self, field: &Field, question: &Question, memory: &mut Memory) -> Option<Fault> {
        let Question { triangle, owners, inner, outer } = question;
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
        // Faces that are closest to the corners, and those below what these leave, mostly show that nothing is too far; where they do not, all are asked.
        let owners = (0..3).map(|k| owners[k]).enumerate().filter(|&(k, owner)| owner != NONE && !owners[..k].contains(&owner));
        let below = |at: &Point| field.top([at[0], at[1]], 0.5 * (inner + outer)).map(|top| top.owner);
        too_far(&self.all, owners.map(|(_, owner)| owner), below, triangle, *outer, memory)?;
        let mut near = Vec::new();
        self.around(triangle, *outer, |item| {
            near.push(item);
            true
        });
        too_far(&self.all, near, |_| None, triangle, *outer, memory).map(Fault::Far)
    }
}
