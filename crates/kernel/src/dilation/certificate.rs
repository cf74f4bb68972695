//! The certificate of a changed surface: which sites are near, how far it stays from them, and that they cover what it swept.

use super::block::NameHasher;
use super::tree::{NodeId, SiteId, Tree};
use crate::attractor::cell::{Point, Site, distance_squared, dot, subtract};
use crate::measure::triangle::closest_on_triangle;
use std::collections::HashMap;
use std::hash::BuildHasherDefault;

/// A lower bound of the distance of a triangle from a site is raised by so many steps of alternating projection.
const STEPS: usize = 6;
/// Sites that tell coverage.
const MOST_COVERING: usize = 64;
/// Tetrahedra that a swept one is cut into at most.
const MOST_PIECES: usize = 16;
/// Halvings that find where two sites are equally far.
const HALVINGS: usize = 16;

/// Whether a triangle is farther than `least` from a convex site, for sure. For closest candidates p of the site and q of the
/// triangle, the plane across q - p parts them: distance >= min over corners t of (t - p') . u, u the unit vector and p' the site's
/// extreme point along u. Alternating projections converge to the closest pair.
pub(super) fn is_clear(triangle: &[Point; 3], site: &Site, least: f64) -> bool {
    let mut q: Point = std::array::from_fn(|axis| (triangle[0][axis] + triangle[1][axis] + triangle[2][axis]) / 3.0);
    for _ in 0..STEPS {
        let p = site.closest(&q);
        let offset = subtract(&q, &p);
        let length = dot(&offset, &offset).sqrt();
        if length <= least {
            return false;
        }
        let lowest = triangle.iter().map(|corner| dot(corner, &offset)).fold(f64::INFINITY, f64::min);
        let highest = match site {
            Site::Point(a) => dot(a, &offset),
            Site::Segment(ends) => ends.iter().map(|end| dot(end, &offset)).fold(f64::NEG_INFINITY, f64::max),
            Site::Triangle(corners) => corners.iter().map(|corner| dot(corner, &offset)).fold(f64::NEG_INFINITY, f64::max),
        };
        if lowest - highest > least * length {
            return true;
        }
        q = closest_on_triangle(&p, &triangle[0], &triangle[1], &triangle[2]);
    }
    false
}

/// Sites near places, from lists of nodes that are refined from coarse to fine places.
#[derive(Debug, Default)]
pub(super) struct Places {
    lists: HashMap<u128, Vec<NodeId>, BuildHasherDefault<NameHasher>>,
    origin: Point,
    /// Edge of the places of level 0.
    edge: f64,
    top: u32,
    starts: Vec<NodeId>,
}

impl Places {
    /// Forgets all; places of level `top` are so large that the starts serve for all of them.
    pub(super) fn reset(&mut self, origin: Point, edge: f64, top: u32, starts: Vec<NodeId>) {
        self.lists.clear();
        (self.origin, self.edge, self.top) = (origin, edge, top);
        self.starts = starts;
    }

    /// All sites within `reach` + `radius` of x, and perhaps some more.
    pub(super) fn collect(&mut self, tree: &mut Tree<'_>, x: &Point, radius: f64, reach: f64, found: &mut Vec<SiteId>) {
        found.clear();
        let mut level = 0;
        while level < self.top && radius > self.edge * f64::from(1_u32 << level) {
            level += 1;
        }
        self.refine(tree, level, x, reach);
        let list = self.lists.get(&self.key(level, x)).unwrap_or(&self.starts);
        tree.collect(x, list, reach + radius, found);
    }

    fn place(&self, level: u32, x: &Point) -> [i32; 3] {
        let edge = self.edge * f64::from(1_u32 << level);
        std::array::from_fn(|axis| ((x[axis] - self.origin[axis]) / edge).floor() as i32)
    }

    fn key(&self, level: u32, x: &Point) -> u128 {
        self.place(level, x).iter().fold(u128::from(level), |key, &index| key << 32 | u128::from(index as u32))
    }

    fn refine(&mut self, tree: &mut Tree<'_>, level: u32, x: &Point, reach: f64) {
        let key = self.key(level, x);
        if level >= self.top || self.lists.contains_key(&key) {
            return;
        }
        self.refine(tree, level + 1, x, reach);
        let (edge, place) = (self.edge * f64::from(1_u32 << level), self.place(level, x));
        let middle: Point = std::array::from_fn(|axis| self.origin[axis] + edge * (f64::from(place[axis]) + 0.5));
        let mut list = Vec::new();
        // Half a diagonal, and the radius that the level serves.
        let horizon = reach + edge * (0.5 * 3.0_f64.sqrt() * 1.000_001 + 1.0);
        let from = self.lists.get(&self.key(level + 1, x)).unwrap_or(&self.starts);
        tree.gather(&middle, from, horizon, &mut list);
        self.lists.insert(key, list);
    }
}

/// A place with the sites that reach it, one bit for each.
#[derive(Clone, Copy, Debug)]
struct Marked {
    at: Point,
    mask: u64,
}

/// The sites around a star, and which of its vertices each of them covers.
#[derive(Debug, Default)]
pub(super) struct Nearby {
    sites: Vec<Site>,
    ids: Vec<SiteId>,
    /// Squared distances of the star's vertices, site by site.
    squares: Vec<f64>,
    /// Vertices with the sites within reach.
    marked: Vec<Marked>,
    pieces: Vec<[Marked; 4]>,
    square: f64,
}

impl Nearby {
    /// Finds the sites near `points`, the last of which is the middle.
    pub(super) fn find(&mut self, tree: &mut Tree<'_>, places: &mut Places, points: &[Point], reach: f64) {
        let Some(middle) = points.last() else { return };
        let radius = points.iter().map(|point| distance_squared(point, middle)).fold(0.0, f64::max).sqrt();
        places.collect(tree, middle, radius, reach, &mut self.ids);
        self.square = reach * reach;
        self.sites.clear();
        self.squares.clear();
        self.marked.clear();
        self.marked.extend(points.iter().map(|&at| Marked { at, mask: 0 }));
        let horizon = (reach + radius).powi(2);
        for &id in &self.ids {
            let site = tree.site(id);
            let from_middle = site.distance_squared(middle);
            if from_middle > horizon {
                continue;
            }
            let number = self.sites.len();
            self.sites.push(site);
            for marked in &mut self.marked {
                let square = site.distance_squared(&marked.at);
                self.squares.push(square);
                if number < MOST_COVERING && square <= self.square {
                    marked.mask |= 1 << number;
                }
            }
        }
    }

    /// The point of the sites that is closest to the last point, if all sites within reach have the same: there the distance is smooth.
    pub(super) fn foot(&self) -> Option<Point> {
        let middle = self.marked.last()?;
        let mut foot: Option<Point> = None;
        for site in &self.sites {
            let closest = site.closest(&middle.at);
            if distance_squared(&closest, &middle.at) <= self.square {
                if foot.is_some_and(|known| distance_squared(&known, &closest) > 1e-12 * self.square) {
                    return None;
                }
                foot = Some(closest);
            }
        }
        foot
    }

    /// Moves one of the points.
    pub(super) fn place(&mut self, index: usize, at: Point) {
        let count = self.marked.len();
        let mut mask = 0;
        for (number, site) in self.sites.iter().enumerate() {
            let square = site.distance_squared(&at);
            self.squares[number * count + index] = square;
            if number < MOST_COVERING && square <= self.square {
                mask |= 1 << number;
            }
        }
        self.marked[index] = Marked { at, mask };
    }

    /// Whether sites cover the tetrahedron of four of the points. One convex site that reaches all four corners does; else it is cut where two sites
    /// are equally far, until one does.
    pub(super) fn cover(&mut self, corners: [usize; 4]) -> bool {
        let whole = corners.map(|corner| self.marked[corner]);
        if whole[0].mask & whole[1].mask & whole[2].mask & whole[3].mask != 0 {
            return true;
        }
        if whole.iter().any(|corner| corner.mask == 0) {
            return false;
        }
        self.pieces.clear();
        self.pieces.push(whole);
        let mut made = 1;
        while let Some(piece) = self.pieces.pop() {
            if piece[0].mask & piece[1].mask & piece[2].mask & piece[3].mask != 0 {
                continue;
            }
            if made >= MOST_PIECES {
                return false;
            }
            let Some((p, q, middle)) = self.split(&piece) else { return false };
            let (mut first, mut second) = (piece, piece);
            (first[p], second[q]) = (middle, middle);
            self.pieces.extend([first, second]);
            made += 1;
        }
        true
    }

    /// Where to cut a piece: two corners and a covered point between them.
    fn split(&self, piece: &[Marked; 4]) -> Option<(usize, usize, Marked)> {
        let pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
        // The longest edge of those whose ends no site covers together, if there are such.
        let rank = |&(p, q): &(usize, usize)| (piece[p].mask & piece[q].mask == 0, distance_squared(&piece[p].at, &piece[q].at));
        let (p, q) = pairs.into_iter().max_by(|a, b| {
            let (a, b) = (rank(a), rank(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        })?;
        let (a, b) = (&piece[p], &piece[q]);
        let mut share = 0.5;
        if a.mask & b.mask == 0 {
            let (first, second) = (self.nearest(a)?, self.nearest(b)?);
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..HALVINGS {
                share = 0.5 * (low + high);
                let at = between(&a.at, &b.at, share);
                if first.distance_squared(&at) <= second.distance_squared(&at) {
                    low = share;
                } else {
                    high = share;
                }
            }
        }
        let at = between(&a.at, &b.at, share);
        let mut mask = 0;
        for (number, site) in self.sites.iter().take(MOST_COVERING).enumerate() {
            if site.distance_squared(&at) <= self.square {
                mask |= 1 << number;
            }
        }
        (mask != 0).then_some((p, q, Marked { at, mask }))
    }

    /// The nearest site of those that cover a point.
    fn nearest(&self, marked: &Marked) -> Option<&Site> {
        let covering = self.sites.iter().take(MOST_COVERING).enumerate().filter(|(number, _)| marked.mask >> number & 1 == 1);
        covering.map(|(_, site)| site).min_by(|a, b| a.distance_squared(&marked.at).total_cmp(&b.distance_squared(&marked.at)))
    }

    /// Whether the triangle of three of the points is at least `least` from all sites.
    ///
    /// First from its corners: d^2 - |x|^2 is concave, so d^2 is at least the least value at a corner less R^2, R the circumradius of the
    /// smallest ball around the triangle, and R^2 is at most a third of its longest edge squared.
    pub(super) fn is_clear(&self, corners: [usize; 3], least: f64) -> bool {
        let triangle = corners.map(|corner| self.marked[corner].at);
        let longest = (0..3).map(|k| distance_squared(&triangle[k], &triangle[(k + 1) % 3])).fold(0.0, f64::max);
        let enough = least * least * 1.000_000_001 + longest / 3.0;
        let count = self.marked.len();
        self.sites.iter().enumerate().all(|(number, site)| {
            let squares = &self.squares[number * count..(number + 1) * count];
            corners.iter().all(|&corner| squares[corner] >= enough) || is_clear(&triangle, site, least)
        })
    }
}

fn between(a: &Point, b: &Point, share: f64) -> Point {
    std::array::from_fn(|axis| a[axis] + share * (b[axis] - a[axis]))
}
