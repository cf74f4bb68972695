//! Triangles for searches, and whether another is between two distances from all of them.

use super::between::{Body, Memory, lowest, middle, radius, too_far};
use super::figure;
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract, unit};
use crate::dilation::convex::Convex;
use crate::dilation::surface::NameMap;
use crate::measure::triangle::closest_on_triangle;
use crate::solid::TriMesh;
use crate::solid::box_tree::{Box32, BoxTree};
use crate::solid::half_edges::NONE;
use std::collections::BTreeSet;

/// How often the way between two triangles is sought from one to the other before corners and sides are.
const STEPS: usize = 2;
/// What rounding may take of a glance.
const NEARLY: f64 = 1e-9;

/// A place where a triangle may not be as it is.
#[derive(Clone, Copy, Debug)]
pub(super) enum Fault {
    /// The place, and what of the faces is close to it.
    Near(Point, Point),
    Far(Point),
}

/// A triangle to look at, the faces that are closest to its corners, where they are known, and the distances that it has to be between.
pub(super) struct Question {
    pub(super) triangle: [Point; 3],
    /// Places that its corners are out from: if there are such, what is between a place of the triangle and the one with the same shares in these has to be no farther than the greater distance, too.
    pub(super) feet: Option<[Point; 3]>,
    pub(super) owners: [u32; 3],
    pub(super) inner: f64,
    pub(super) outer: f64,
}

/// Triangles for searches.
pub(in crate::dilation) struct Faces {
    pub(in crate::dilation) all: Vec<Face>,
    tree: BoxTree,
}

/// A triangle with its normal, and the ball around its middle that holds it.
pub(in crate::dilation) struct Face {
    pub(in crate::dilation) corners: [Point; 3],
    pub(in crate::dilation) normal: Point,
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

    /// Whether it may be nearer to a place than a distance, given squared, at a glance.
    #[inline]
    pub(in crate::dilation) fn may_be_nearer(&self, x: &Point, square: f64) -> bool {
        let way = subtract(&self.centre, x);
        let along = dot(&way, &self.normal);
        let (aside, reach) = (dot(&way, &way) - along * along, self.radius * (1.0 + NEARLY));
        // Beside the disc around it, which holds it, and off its plane.
        let beyond = (aside.max(0.0).sqrt() - reach).max(0.0);
        along * along * (1.0 - NEARLY) + beyond * beyond <= square
    }

    /// Whether a plane shows that it is as far from a triangle: its own, or one across the way between both middles, or between closest places, which are found by going back and forth.
    pub(super) fn is_apart(&self, triangle: &[Point; 3], centre: &Point, least: f64) -> bool {
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
    /// Triangles by their corners.
    pub(super) fn new(triangles: impl Iterator<Item = [Point; 3]>) -> Self {
        let all: Vec<Face> = triangles.map(Face::new).collect();
        let mut tree = BoxTree::default();
        tree.build(all.len(), |item| Some(Box32::of(&all[item as usize].corners)), false);
        Self { all, tree }
    }

    /// The triangles of a mesh.
    pub(in crate::dilation) fn of_mesh(mesh: &TriMesh) -> Self {
        Self::new((0..mesh.triangles.len() as u32).map(|triangle| mesh.points_of(triangle)))
    }

    /// Faces that are close to each other, a few at a time.
    pub(super) fn groups(&self) -> Vec<&[u32]> {
        (0..self.tree.leaves()).map(|leaf| self.tree.items(leaf)).filter(|items| !items.is_empty()).collect()
    }

    /// Whether something is so of all faces whose boxes are within a distance of that of some points, and are not all lower than a height along a direction.
    pub(super) fn hold(&self, points: &[Point], distance: f64, along: &Point, height: f64, is_so: impl Fn(&Face) -> bool) -> bool {
        let within = figure::box_around(points, distance);
        let is_wanted = |own: &Box32| within.meets(own) && own.highest(along) >= height;
        let mut hold = true;
        self.tree.query_wanted(is_wanted, |leaf| {
            let own = self.tree.items(leaf).iter().zip(self.tree.boxes(leaf));
            hold = own.filter(|(_, theirs)| is_wanted(theirs)).all(|(&item, _)| is_so(&self.all[item as usize]));
            hold
        });
        hold
    }

    /// Calls `visit` with the faces whose boxes are within a distance of that of some points, until it answers false.
    pub(in crate::dilation) fn around(&self, points: &[Point], distance: f64, mut visit: impl FnMut(u32) -> bool) {
        let within = figure::box_around(points, distance);
        self.tree.query(&within, 0, |leaf| {
            let mut own = self.tree.items(leaf).iter().zip(self.tree.boxes(leaf));
            own.all(|(&item, theirs)| !within.meets(theirs) || visit(item))
        });
    }

    /// Whether one of them is no farther from a place than a distance.
    pub(in crate::dilation) fn have_within(&self, x: &Point, distance: f64) -> bool {
        let (mut is_within, most) = (false, distance * distance);
        self.around(std::slice::from_ref(x), distance, |item| {
            let face = &self.all[item as usize];
            is_within = face.may_be_nearer(x, most) && face.distance_squared(x) <= most;
            !is_within
        });
        is_within
    }

    /// Where a triangle is nearer or farther than it has to be, given what may be closest to a place. Cost: about a tenth of a microsecond for each face near to it.
    pub(super) fn fault_with(&self, offer: impl Fn(&Point) -> Option<u32>, question: &Question, memory: &mut Memory) -> Option<Fault> {
        let Question { triangle, feet, owners, inner, outer } = question;
        let normal = unit(&cross(&subtract(&triangle[1], &triangle[0]), &subtract(&triangle[2], &triangle[0])));
        let highest = lowest(triangle, &normal) - inner;
        let centre = middle(triangle);
        let wide = inner + radius(triangle, &centre);
        let mut found = None;
        // Nothing is nearer than less than nothing.
        let least = inner.max(0.0);
        self.around(triangle, least, |item| {
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
        // Faces that are closest to the corners, and those that are offered for what these leave, mostly show that nothing is too far; where they do not, all are asked.
        let owners = (0..3).map(|k| owners[k]).enumerate().filter(|&(k, owner)| owner != NONE && !owners[..k].contains(&owner));
        let foot = match feet.as_ref().map(|feet| Foot::new(triangle, feet)) {
            Some(None) => return Some(Fault::Far(triangle[0])),
            foot => foot.flatten(),
        };
        // The distance from a face is convex: where it is near to both ends, it is so to all that is between.
        let square = |item: u32, x: &Point| {
            let face = &self.all[item as usize];
            let own = face.distance_squared(x);
            foot.as_ref().map_or(own, |foot| own.max(face.distance_squared(&foot.of(x))))
        };
        too_far(&self.all, square, owners.map(|(_, owner)| owner), offer, triangle, *outer, memory)?;
        let mut near = Vec::new();
        self.around(triangle, *outer, |item| {
            near.push(item);
            true
        });
        too_far(&self.all, square, near, |_| None, triangle, *outer, memory).map(Fault::Far)
    }
}

/// The map from a triangle to another, corner by corner.
struct Foot {
    shares: Shares,
    first: Point,
    /// Where two sides lead.
    ways: [Point; 2],
}

/// Coordinates in a triangle: the shares of its second and third corner.
pub(super) struct Shares {
    origin: Point,
    /// Vectors that tell how much of two sides a way has.
    dual: [Point; 2],
}

impl Shares {
    /// None for a triangle without area.
    pub(super) fn new([a, b, c]: &[Point; 3]) -> Option<Self> {
        let [p, q] = [subtract(b, a), subtract(c, a)];
        let [pp, pq, qq] = [dot(&p, &p), dot(&p, &q), dot(&q, &q)];
        let double = pp * qq - pq * pq;
        let dual = |own: &Point, other: &Point, square: f64| std::array::from_fn(|axis| (square * own[axis] - pq * other[axis]) / double);
        (double > 0.0).then(|| Self { origin: *a, dual: [dual(&p, &q, qq), dual(&q, &p, pp)] })
    }

    pub(super) fn of(&self, x: &Point) -> [f64; 2] {
        let way = subtract(x, &self.origin);
        self.dual.each_ref().map(|dual| dot(&way, dual))
    }
}

impl Foot {
    /// None for a triangle without area.
    fn new(triangle: &[Point; 3], feet: &[Point; 3]) -> Option<Self> {
        let ways = [1, 2].map(|k| subtract(&feet[k], &feet[0]));
        Some(Self { shares: Shares::new(triangle)?, first: feet[0], ways })
    }

    fn of(&self, x: &Point) -> Point {
        let [a, b] = self.shares.of(x);
        std::array::from_fn(|axis| self.first[axis] + a * self.ways[0][axis] + b * self.ways[1][axis])
    }
}

/// Triangles without those whose corners are at two places or one, which add nothing to the sides and corners of the others; none where one does.
pub(in crate::dilation) fn without_lines<T: Copy + Ord>(mut triangles: Vec<[T; 3]>) -> Option<Vec<[T; 3]>> {
    let is_line = |[a, b, c]: &[T; 3]| a == b || b == c || c == a;
    let ends = |corners: &[T; 3]| {
        (0..3).map(|k| [corners[k], corners[(k + 1) % 3]]).map(|[a, b]| if a < b { [a, b] } else { [b, a] }).collect::<Vec<_>>()
    };
    let lines: BTreeSet<[T; 2]> = triangles.iter().filter(|corners| is_line(corners)).flat_map(ends).collect();
    if lines.is_empty() {
        return Some(triangles);
    }
    triangles.retain(|corners| !is_line(corners));
    let sides: BTreeSet<[T; 2]> =
        triangles.iter().flat_map(ends).flat_map(|[a, b]| [[a, b], [a, a], [b, b]]).filter(|side| lines.contains(side)).collect();
    (sides.len() == lines.len()).then_some(triangles)
}

/// The corners of triangles, each once, and these as numbers of them.
pub(super) fn numbered(faces: &[[Point; 3]]) -> (Vec<Point>, Vec<[u32; 3]>) {
    let mut numbers: NameMap<[u64; 3], u32> = NameMap::default();
    numbers.reserve(faces.len());
    let mut places = Vec::new();
    let mut number = |at: &Point| {
        *numbers.entry(at.map(f64::to_bits)).or_insert_with(|| {
            places.push(*at);
            places.len() as u32 - 1
        })
    };
    let triangles = faces.iter().map(|face| face.each_ref().map(&mut number)).collect();
    (places, triangles)
}
