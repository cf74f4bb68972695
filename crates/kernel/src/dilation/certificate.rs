//! The certificate of a changed surface: which sites are near, how far it stays from them, and that they cover what it swept.

use super::convex::{Convex, SiteSearch};
use super::surface::NameHasher;
use super::tree::{NodeId, SiteId, in_space};
use crate::attractor::cell::{Point, between, distance_squared, dot, subtract, unit};
use crate::measure::triangle::closest_on_triangle;
use std::collections::HashMap;
use std::hash::BuildHasherDefault;

/// A lower bound of the distance of a triangle from a site is raised by so many steps of alternating projection.
const STEPS: usize = 6;
/// Sites that tell coverage.
const MOST_COVERING: usize = 64;
/// Tetrahedra that a swept one is cut into at most.
const MOST_PIECES: usize = 16;
/// Sites that are tried to cut a tetrahedron at a corner: for the three others, and for the rest.
const MOST_FIRST: usize = 1;
const MOST_SECOND: usize = 2;
/// Views that are kept at most: where sites are dense a vertex has hundreds, which are found again when they are asked for again.
const MOST_VIEWS: usize = 1 << 20;
/// Halvings that look for a place that two sites cover.
const HALVINGS: usize = 16;

/// A direction that shows that a triangle is farther than `least` from a convex site. For closest candidates p of the site and q of the
/// triangle, the plane across q - p parts them: distance >= min over corners t of (t - p') . u, u the unit vector and p' the site's
/// extreme point along u. Alternating projections converge to the closest pair.
fn parting(triangle: &[Point; 3], site: &impl Convex, least: f64) -> Option<Direction> {
    let least = site.in_space(least);
    let mut q: Point = std::array::from_fn(|axis| (triangle[0][axis] + triangle[1][axis] + triangle[2][axis]) / 3.0);
    for _ in 0..STEPS {
        let p = site.closest(&q);
        let offset = subtract(&q, &p);
        let length = dot(&offset, &offset).sqrt();
        if length <= least {
            return None;
        }
        let direction = Direction::new(offset.map(|part| part / length), triangle);
        if direction.is_beyond(site, least) {
            return Some(direction);
        }
        q = closest_on_triangle(&p, &triangle[0], &triangle[1], &triangle[2]);
    }
    None
}

/// A unit vector with the least value of a triangle along it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Direction {
    unit: Point,
    lowest: f64,
}

impl Direction {
    #[inline]
    fn new(unit: Point, triangle: &[Point; 3]) -> Self {
        Self { unit, lowest: triangle.iter().map(|corner| dot(corner, &unit)).fold(f64::INFINITY, f64::min) }
    }

    /// Whether it shows that the triangle is farther from a site than `least`, the deficit included.
    #[inline]
    fn parts(&self, site: &impl Convex, least: f64) -> bool {
        self.is_beyond(site, site.in_space(least))
    }

    #[inline]
    fn is_beyond(&self, site: &impl Convex, least: f64) -> bool {
        self.lowest - site.highest(&self.unit) > least
    }
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

    /// Visits all sites within `reach` + `radius` of x, those within less than `size` together: see [`SiteSearch::visit_near`].
    #[inline]
    fn visit(
        &mut self,
        search: &mut impl SiteSearch,
        x: &Point,
        [radius, reach, size]: [f64; 3],
        visit: impl FnMut(SiteId, &Point, f64, Option<NodeId>),
    ) {
        let mut level = 0;
        while level < self.top && radius > self.edge * f64::from(1_u32 << level) {
            level += 1;
        }
        self.refine(search, level, x, reach);
        let list = self.lists.get(&self.key(level, x)).unwrap_or(&self.starts);
        search.visit_near(x, list, reach + radius, size, visit);
    }

    fn place(&self, level: u32, x: &Point) -> [i32; 3] {
        let edge = self.edge * f64::from(1_u32 << level);
        std::array::from_fn(|axis| ((x[axis] - self.origin[axis]) / edge).floor() as i32)
    }

    fn key(&self, level: u32, x: &Point) -> u128 {
        self.place(level, x).iter().fold(u128::from(level), |key, &index| key << 32 | u128::from(index as u32))
    }

    fn refine(&mut self, search: &mut impl SiteSearch, level: u32, x: &Point, reach: f64) {
        let key = self.key(level, x);
        if level >= self.top || self.lists.contains_key(&key) {
            return;
        }
        self.refine(search, level + 1, x, reach);
        let (edge, place) = (self.edge * f64::from(1_u32 << level), self.place(level, x));
        let middle: Point = std::array::from_fn(|axis| self.origin[axis] + edge * (f64::from(place[axis]) + 0.5));
        let mut list = Vec::new();
        // Half a diagonal, and the radius that the level serves.
        let horizon = reach + edge * (0.5 * 3.0_f64.sqrt() * 1.000_001 + 1.0);
        let from = self.lists.get(&self.key(level + 1, x)).unwrap_or(&self.starts);
        search.gather(&middle, from, horizon, &mut list);
        self.lists.insert(key, list);
    }
}

/// A place with the sites that reach it, one bit for each.
#[derive(Clone, Copy, Debug)]
struct Marked {
    at: Point,
    mask: u64,
    /// An upper bound of the distance from all sites.
    distance: f64,
}

/// A site seen from a vertex, or a group of sites within a small ball.
#[derive(Clone, Copy, Debug)]
struct View {
    site: SiteId,
    /// The node whose sites it stands for, if it is not the site alone.
    group: Option<NodeId>,
    /// Squared distance, and the least that any of the sites may have.
    square: f64,
    least: f64,
    /// The unit vector from the closest point of the site, or the ball, to the vertex, and the largest value along it on that: what has larger values is
    /// as far from it as they differ, at least.
    normal: Point,
    highest: f64,
    deficit: f64,
}

impl View {
    /// Whether the plane across the view shows that a triangle is farther from the site than `least`.
    #[inline]
    fn parts(&self, triangle: &[Point; 3], least: f64) -> bool {
        let least = in_space(least, self.deficit);
        triangle.iter().all(|point| dot(&self.normal, point) - self.highest > least)
    }
}

/// The views from a vertex, the nearest [`MOST_COVERING`] first and in order.
#[derive(Clone, Copy, Debug, Default)]
struct Range {
    first: u32,
    count: u32,
    /// All sites within this squared distance are there; 0 before they were looked for.
    square: f64,
    /// The least squared distance that any may have.
    least: f64,
}

/// The sites around vertices, looked for once, and what is known of those around a star.
#[derive(Debug, Default)]
pub(super) struct Nearby {
    ranges: Vec<Range>,
    views: Vec<View>,
    /// Squares of how near sites cover, and how far they are looked for at once.
    square: f64,
    first_square: f64,
    reach: f64,
    /// Sites within a ball of less than this radius are looked at together.
    size: f64,
    /// Sites with a bit, and what bit a site has in the star of that number.
    sites: Vec<SiteId>,
    bits: Vec<(u32, u32)>,
    star: u32,
    /// Corners of the star with the sites within reach.
    marked: Vec<Marked>,
    pieces: Vec<[Marked; 4]>,
    /// Which triangle a site, or what is below a node, was told last to be clear of, by the number of it, and how many were asked for.
    cleared: Vec<u32>,
    cleared_groups: Vec<u32>,
    asked: u32,
    /// Nodes and sites of groups that a triangle is close to.
    open: (Vec<NodeId>, Vec<SiteId>),
    /// Directions that showed it.
    directions: Vec<Direction>,
}

impl Nearby {
    /// Bytes of its views: one for each vertex and each site near it.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.views)
    }

    /// Forgets all; sites cover within `reach`, are looked for up to the root of `first_square` at first, and together within a ball smaller than `size`.
    pub(super) fn reset(&mut self, vertices: usize, reach: f64, first_square: f64, size: f64) {
        self.ranges.clear();
        // One more for a place that is tried.
        self.ranges.resize(vertices + 1, Range::default());
        self.views.clear();
        (self.reach, self.square, self.first_square) = (reach, reach * reach, first_square.max(reach * reach));
        self.size = size;
        self.bits.clear();
        self.star = 0;
        self.cleared.clear();
        self.cleared_groups.clear();
        self.asked = 0;
    }

    /// The number of the place that is tried.
    pub(super) fn trial(&self) -> u32 {
        self.ranges.len() as u32 - 1
    }

    /// Begins with another place to try, and forgets what was seen from the last one.
    pub(super) fn try_another(&mut self) {
        let trial = self.trial() as usize;
        let range = std::mem::take(&mut self.ranges[trial]);
        // Else others were looked for since.
        if range.count > 0 && (range.first + range.count) as usize == self.views.len() {
            self.views.truncate(range.first as usize);
        }
    }

    /// Gives a vertex the views of the place that is tried.
    pub(super) fn accept(&mut self, vertex: u32) {
        let trial = self.trial() as usize;
        self.ranges[vertex as usize] = std::mem::take(&mut self.ranges[trial]);
    }

    /// Sees to it that all sites within a squared distance of a vertex at x are known.
    #[inline]
    fn see(&mut self, search: &mut impl SiteSearch, places: &mut Places, vertex: u32, x: &Point, square: f64) {
        if self.ranges[vertex as usize].square < square {
            self.look(search, places, vertex, x, square);
        }
    }

    fn look(&mut self, search: &mut impl SiteSearch, places: &mut Places, vertex: u32, x: &Point, square: f64) {
        // Twice as far beyond the first, so that a vertex is asked for seldom.
        let square = if square <= self.first_square { self.first_square } else { self.first_square + 2.0 * (square - self.first_square) };
        let first = self.views.len();
        let views = &mut self.views;
        places.visit(search, x, [square.sqrt() - self.reach, self.reach, self.size], |site, closest, square, group| {
            views.push(View { site, group, square, least: square, normal: *closest, highest: f64::INFINITY, deficit: 0.0 });
        });
        let mut least = f64::INFINITY;
        for view in &mut views[first..] {
            match view.group.map(|node| search.ball(node)) {
                None => {
                    let site = search.site(view.site);
                    let length = site.in_space(view.square.sqrt());
                    view.normal = if length > 0.0 { subtract(x, &view.normal).map(|part| part / length) } else { [0.0; 3] };
                    (view.highest, view.deficit) = (site.highest(&view.normal), site.deficit());
                }
                Some(ball) => {
                    let way = subtract(x, &ball.centre);
                    view.normal = unit(&way);
                    (view.highest, view.deficit) = (ball.highest(&view.normal), ball.deficit);
                    view.least = (dot(&way, &way).sqrt() - ball.radius).max(0.0).powi(2) + ball.deficit;
                }
            }
            least = least.min(view.least);
        }
        let views = &mut views[first..];
        let nearer = |a: &View, b: &View| a.square.total_cmp(&b.square).then_with(|| a.site.cmp(&b.site));
        // Only the nearest may tell coverage.
        if views.len() > MOST_COVERING {
            views.select_nth_unstable_by(MOST_COVERING, nearer);
        }
        let sorted = views.len().min(MOST_COVERING);
        views[..sorted].sort_unstable_by(nearer);
        let count = views.len() as u32;
        // What begins nowhere ends nowhere, even after other views are gone.
        self.ranges[vertex as usize] = Range { first: if count > 0 { first as u32 } else { 0 }, count, square, least };
    }

    #[inline]
    fn views(&self, vertex: u32) -> &[View] {
        let range = self.ranges[vertex as usize];
        &self.views[range.first as usize..(range.first + range.count) as usize]
    }

    /// Forgets all views where they are too many; not within a star.
    fn forget_many(&mut self) {
        if self.views.len() > MOST_VIEWS {
            self.views.clear();
            self.ranges.fill(Range::default());
        }
    }

    /// Begins with a star: its corners, the middle first, are `corners` afterwards.
    pub(super) fn begin(&mut self, search: &mut impl SiteSearch, places: &mut Places, corners: impl Iterator<Item = (u32, Point)>) {
        self.forget_many();
        self.star += 1;
        self.sites.clear();
        self.marked.clear();
        for (vertex, at) in corners {
            self.mark(search, places, vertex, at);
        }
    }

    /// Adds a corner to the star.
    pub(super) fn mark(&mut self, search: &mut impl SiteSearch, places: &mut Places, vertex: u32, at: Point) {
        self.see(search, places, vertex, &at, self.square);
        let range = self.ranges[vertex as usize];
        let mut mask = 0;
        for view in self.views[range.first as usize..(range.first + range.count) as usize].iter().take(MOST_COVERING) {
            if view.square > self.square {
                break;
            }
            let (star, bit) = entry(&mut self.bits, number(view.site));
            if *star != self.star {
                if self.sites.len() == MOST_COVERING {
                    continue;
                }
                (*star, *bit) = (self.star, self.sites.len() as u32);
                self.sites.push(view.site);
            }
            mask |= 1 << *bit;
        }
        let distance = self.views(vertex).first().map_or(f64::INFINITY, |view| view.square.sqrt());
        self.marked.push(Marked { at, mask, distance });
    }

    /// The point of the sites that is closest to a vertex at x, if all sites within reach have the same, and the nearest site's deficit: there the distance is smooth.
    pub(super) fn foot(&mut self, search: &mut impl SiteSearch, places: &mut Places, vertex: u32, x: &Point) -> Option<(Point, f64)> {
        self.forget_many();
        self.see(search, places, vertex, x, self.square);
        let mut foot: Option<(Point, f64)> = None;
        for view in self.views(vertex).iter().filter(|view| view.least <= self.square) {
            if view.group.is_some() {
                return None;
            }
            let length = in_space(view.square.sqrt(), view.deficit);
            let closest = std::array::from_fn(|axis| x[axis] - length * view.normal[axis]);
            if foot.is_some_and(|(known, _)| distance_squared(&known, &closest) > 1e-12 * self.square) {
                return None;
            }
            // The views of a vertex are in the order of their distances.
            let deficit = foot.map_or(view.deficit, |(_, deficit)| deficit);
            foot = Some((closest, deficit));
        }
        foot
    }

    /// Whether sites cover the tetrahedron of four of the points. One convex site that reaches all four corners does; else it is cut where two sites
    /// are equally far, until one does.
    pub(super) fn cover(&mut self, search: &impl SiteSearch, corners: [usize; 4]) -> bool {
        let whole = corners.map(|corner| self.marked[corner]);
        if whole[0].mask & whole[1].mask & whole[2].mask & whole[3].mask != 0 || self.is_near(&whole) {
            return true;
        }
        if whole.iter().any(|corner| corner.mask == 0) {
            return false;
        }
        self.pieces.clear();
        self.pieces.push(whole);
        let mut made = 1;
        while let Some(piece) = self.pieces.pop() {
            if piece[0].mask & piece[1].mask & piece[2].mask & piece[3].mask != 0 || self.is_near(&piece) {
                continue;
            }
            if made >= MOST_PIECES {
                return false;
            }
            if self.is_cut(search, &piece) {
                continue;
            }
            let Some((p, q, middle)) = self.split(search, &piece) else { return false };
            let (mut first, mut second) = (piece, piece);
            (first[p], second[q]) = (middle, middle);
            self.pieces.extend([first, second]);
            made += 1;
        }
        true
    }

    /// Whether a corner is so near to the sites and to the other corners that all points between are within reach: the distance grows by no more than the way.
    fn is_near(&self, piece: &[Marked; 4]) -> bool {
        piece.iter().any(|corner| {
            let left = self.reach - corner.distance;
            left > 0.0 && piece.iter().all(|other| distance_squared(&corner.at, &other.at) < left * left)
        })
    }

    /// Where to cut a piece: two corners and a covered point between them.
    fn split(&self, search: &impl SiteSearch, piece: &[Marked; 4]) -> Option<(usize, usize, Marked)> {
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
            let (first, second) = (self.nearest(search, a)?, self.nearest(search, b)?);
            // The first covers a beginning of the edge, the second an end: a place in both is looked for.
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..HALVINGS {
                share = 0.5 * (low + high);
                let at = between(&a.at, &b.at, share);
                match (first.distance_squared(&at) <= self.square, second.distance_squared(&at) <= self.square) {
                    (true, false) => low = share,
                    (false, true) => high = share,
                    _ => break,
                }
            }
        }
        let at = between(&a.at, &b.at, share);
        // What covers both ends covers what is between.
        let mut mask = a.mask & b.mask;
        let some = piece.iter().fold(0, |some, corner| some | corner.mask) & !mask;
        for bit in bits(some) {
            if search.site(self.sites[bit]).distance_squared(&at) <= self.square {
                mask |= 1 << bit;
            }
        }
        let distance = (a.distance + distance_squared(&at, &a.at).sqrt()).min(b.distance + distance_squared(&at, &b.at).sqrt());
        (mask != 0).then_some((p, q, Marked { at, mask, distance }))
    }

    /// Whether a site covers three of the corners, and another what the first leaves at the fourth. The square of the distance is convex: with D at the
    /// fourth corner and at most F at the others, of every line from there the first covers all from the share (D - square) / (D - F) on.
    fn is_cut(&self, search: &impl SiteSearch, piece: &[Marked; 4]) -> bool {
        (0..4).any(|k| {
            let others = [(k + 1) % 4, (k + 2) % 4, (k + 3) % 4].map(|other| &piece[other]);
            bits(others[0].mask & others[1].mask & others[2].mask).take(MOST_FIRST).any(|first| {
                let site = search.site(self.sites[first]);
                let from = site.distance_squared(&piece[k].at);
                let far = others.iter().map(|other| site.distance_squared(&other.at)).fold(0.0, f64::max);
                let share = ((from - self.square) / (from - far)) * (1.0 + 1e-9);
                if !(0.0..=1.0).contains(&share) {
                    return false;
                }
                bits(piece[k].mask).take(MOST_SECOND).any(|second| {
                    let site = search.site(self.sites[second]);
                    others.iter().all(|other| {
                        other.mask >> second & 1 == 1 || site.distance_squared(&between(&piece[k].at, &other.at, share)) <= self.square
                    })
                })
            })
        })
    }

    /// The nearest site of those that cover a point.
    fn nearest<'b, S: SiteSearch>(&self, search: &'b S, marked: &Marked) -> Option<S::Site<'b>> {
        let with_square = |site: S::Site<'b>| (site.distance_squared(&marked.at), site);
        bits(marked.mask).map(|bit| with_square(search.site(self.sites[bit]))).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, site)| site)
    }

    /// Whether a triangle of vertices is at least `least` from all sites.
    ///
    /// d^2 - |x|^2 is concave, so d^2 is at least the least value at a corner less R^2, R the radius of the
    /// smallest ball around the triangle, and R^2 is at most a third of its longest edge squared. For sites that are nearer, a plane tells: first those
    /// of the corners.
    pub(super) fn is_clear(
        &mut self,
        search: &mut impl SiteSearch,
        places: &mut Places,
        corners: [u32; 3],
        triangle: &[Point; 3],
        least: f64,
    ) -> bool {
        let longest = (0..3).map(|k| distance_squared(&triangle[k], &triangle[(k + 1) % 3])).fold(0.0, f64::max);
        let enough = least * least * 1.000_000_001 + longest / 3.0;
        for (&corner, point) in corners.iter().zip(triangle) {
            self.see(search, places, corner, point, enough);
        }
        if corners.iter().all(|&corner| self.ranges[corner as usize].least >= enough) {
            return true;
        }
        let Self { ranges, views, cleared, cleared_groups, asked, open, directions, .. } = self;
        let views = |corner: u32| {
            let range = ranges[corner as usize];
            &views[range.first as usize..(range.first + range.count) as usize]
        };
        *asked += 1;
        directions.clear();
        for corner in corners {
            for view in views(corner) {
                if view.least >= enough || view.parts(triangle, least) {
                    continue;
                }
                let last = match view.group {
                    None => entry(cleared, number(view.site)),
                    Some(node) => entry(cleared_groups, node as usize),
                };
                if *last == *asked {
                    continue;
                }
                if directions.is_empty() {
                    // Sites with a common closest point are parted by one plane.
                    let nearest = corners.iter().filter_map(|&corner| views(corner).first());
                    let sum = nearest.fold([0.0; 3], |sum: Point, view| std::array::from_fn(|axis| sum[axis] + view.normal[axis]));
                    directions.push(Direction::new(unit(&sum), triangle));
                }
                let is_clear = match view.group {
                    None => is_parted(triangle, &search.site(view.site), least, directions),
                    Some(node) => is_group_parted(search, node, triangle, least, directions, open),
                };
                if !is_clear {
                    return false;
                }
                *last = *asked;
            }
        }
        true
    }
}

/// Whether a known direction, or one that is found and kept, shows that a triangle is farther than `least` from a convex set.
#[inline]
fn is_parted(triangle: &[Point; 3], site: &impl Convex, least: f64, directions: &mut Vec<Direction>) -> bool {
    directions.iter().any(|direction| direction.parts(site, least)) || {
        let found = parting(triangle, site, least);
        directions.extend(found);
        found.is_some()
    }
}

/// Likewise for all sites below a node: by the balls around them, and where these do not tell, by what is in them.
fn is_group_parted(
    search: &mut impl SiteSearch,
    node: NodeId,
    triangle: &[Point; 3],
    least: f64,
    directions: &mut Vec<Direction>,
    (nodes, sites): &mut (Vec<NodeId>, Vec<SiteId>),
) -> bool {
    nodes.clear();
    nodes.push(node);
    while let Some(node) = nodes.pop() {
        if is_parted(triangle, &search.ball(node), least, directions) {
            continue;
        }
        sites.clear();
        search.add_below(node, nodes, sites);
        if !sites.iter().all(|&site| is_parted(triangle, &search.site(site), least, directions)) {
            return false;
        }
    }
    true
}

/// The number of a site in tables.
#[inline]
fn number(site: SiteId) -> usize {
    match site {
        SiteId::Point(index) => 2 * index as usize,
        SiteId::Listed(index) => 2 * index as usize + 1,
    }
}

/// What a table has of a number; it grows as far as it takes.
#[inline]
fn entry<T: Clone + Default>(table: &mut Vec<T>, number: usize) -> &mut T {
    if number >= table.len() {
        table.resize(number + 1, T::default());
    }
    &mut table[number]
}

/// The bits of a mask, the lowest first.
fn bits(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        (bit < 64).then_some(bit)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::Attractor;
    use crate::attractor::cell::Site;
    use crate::budget::Budget;
    use crate::dilation::plan::{Balls, Plan};
    use crate::dilation::tree::{Candidates, Tree};
    use crate::model::{AffineMap, Ifs, Model, Shape};
    use crate::split_mix::Random;
    use crate::tolerance::{Radius, Tolerance};
    use glam::{DMat3, DVec3};
    use std::collections::BTreeSet;

    /// A surface of points: Takagi's function of both coordinates, 10 mm wide.
    fn takagi() -> Attractor {
        let map = |x: f64, y: f64| AffineMap {
            linear: DMat3::from_cols_array(&[0.5, 0.0, 0.5 - x, 0.0, 0.5, 0.5 - y, 0.0, 0.0, 0.5]),
            translation: DVec3::new(5.0 * x, 5.0 * y, 5.0 * (x + y)),
        };
        let maps = vec![map(0.0, 0.0), map(0.0, 1.0), map(1.0, 0.0), map(1.0, 1.0)];
        Model { name: None, shape: Shape::Ifs(Ifs { maps, primitive: None, graph: None }) }.lower().unwrap().attractor
    }

    const RADIUS: f64 = 1.0;
    const TOLERANCE: f64 = 0.2;

    /// What is told of a tree over the surface, and the cells that it begins with.
    fn with_candidates(told: impl FnOnce(&mut Tree<'_>, &Candidates)) {
        let (attractor, budget) = (takagi(), Budget::default());
        let balls = Balls { least: Radius::new(RADIUS).unwrap().mm(), most: RADIUS };
        let plan = Plan::new(&attractor, balls, Tolerance::new(TOLERANCE).unwrap(), true, 1.0, &budget).unwrap();
        let setting = plan.setting(plan.pitch(), &budget);
        let space = plan.space(&setting);
        told(&mut Tree::of(plan.rule(), &setting), space.candidates());
    }

    /// Expands a tree as a whole: its starts, and all of its sites.
    fn expanded(tree: &mut Tree<'_>, candidates: &Candidates) -> (Vec<NodeId>, Vec<SiteId>) {
        let (starts, mut all) = (tree.reset(candidates), Vec::new());
        tree.collect(&[5.0; 3], &starts, 100.0, &mut all);
        assert!(all.len() > 10_000, "{}", all.len());
        (starts, all)
    }

    /// What is told of such a tree.
    fn with_tree(told: impl FnOnce(&mut Tree<'_>, Vec<NodeId>, &[SiteId])) {
        with_candidates(|tree, candidates| {
            let (starts, all) = expanded(tree, candidates);
            told(tree, starts, &all);
        });
    }

    fn corners(tree: &Tree<'_>, site: SiteId) -> Vec<Point> {
        match tree.site(site).site {
            Site::Point(at) => vec![at],
            Site::Segment(ends) => ends.to_vec(),
            Site::Triangle(corners) => corners.to_vec(),
        }
    }

    fn place(random: &mut Random) -> Point {
        [12.0, 12.0, 14.0].map(|wide| wide * random.share() - 1.0)
    }

    /// Searches expand trees, and make balls in them smaller: what was asked before may not show.
    #[test]
    fn the_nearest_site_is_the_same_whatever_was_asked_before() {
        let mut random = Random(3);
        let places: Vec<Point> = (0..400).map(|_| place(&mut random)).collect();
        with_candidates(|tree, candidates| {
            let mut answers = |order: Vec<usize>, has_seed: bool| {
                let (starts, mut seed, mut found) = (tree.reset(candidates), None, vec![([0; 3], 0); places.len()]);
                for place in order {
                    let hit = tree.nearest(&places[place], &starts, seed, f64::INFINITY, 0.0).unwrap();
                    seed = has_seed.then_some(hit.node);
                    found[place] = (hit.closest.map(f64::to_bits), hit.distance_squared.to_bits());
                }
                found
            };
            let found = answers((0..places.len()).collect(), true);
            assert_eq!(answers((0..places.len()).rev().collect(), false), found);
            let (_, all) = expanded(tree, candidates);
            for (x, (_, square)) in places.iter().zip(found) {
                let least = all.iter().map(|&site| tree.site(site).distance_squared(x)).fold(f64::INFINITY, f64::min);
                assert_eq!(f64::from_bits(square), least);
            }
        });
    }

    #[test]
    fn what_is_looked_at_together_is_all_that_is_near() {
        with_tree(|tree, starts, all| {
            let mut random = Random(5);
            let mut groups = 0;
            for round in 0..80 {
                let (x, reach, size) = (place(&mut random), 4.0 * random.share(), [0.0, 1.1, 1.5, 2.5][round % 4]);
                let mut found = Vec::new();
                tree.visit_near(&x, &starts, reach, size, |site, closest, square, group| found.push((site, *closest, square, group)));
                let mut seen = BTreeSet::new();
                for (site, closest, square, group) in found {
                    assert!((distance_squared(&x, &closest) - square).abs() < 1e-12 && tree.site(site).closest(&x) == closest);
                    let Some(node) = group else {
                        seen.insert(site);
                        continue;
                    };
                    // All that is below a node is in its ball, and the site that stands for it is below.
                    let (mut nodes, mut sites) = (vec![node], Vec::new());
                    while let Some(node) = nodes.pop() {
                        tree.add_below(node, &mut nodes, &mut sites);
                    }
                    let ball = tree.ball(node);
                    let is_within = |corner: &Point| distance_squared(corner, &ball.centre) <= ball.radius * ball.radius;
                    assert!(ball.radius < size && sites.contains(&site));
                    assert!(sites.iter().all(|&site| corners(tree, site).iter().all(is_within)), "{round}");
                    seen.extend(sites);
                    groups += 1;
                }
                let mut near = all.iter().filter(|&&site| tree.site(site).distance_squared(&x) < reach * reach);
                assert!(near.all(|site| seen.contains(site)), "{round}");
            }
            assert!(groups > 100, "{groups}");
        });
    }

    /// Random triangles about as far from the surface as the radius: those that are told to be clear of all sites are, and nearly all that are clear are told, whatever is looked at together.
    #[test]
    fn triangles_that_are_clear_are_so_of_all_sites() {
        with_tree(|tree, starts, all| {
            let least = RADIUS - TOLERANCE;
            let places: Vec<Point> = all.iter().flat_map(|&site| corners(tree, site)).collect();
            // Of those that are clear by a twentieth, how many are told to be.
            let shares = [0.0, 1.1, 1.5].map(|size| {
                let (mut random, mut told, mut clear) = (Random(7), 0, 0);
                let (mut nearby, mut around) = (Nearby::default(), Places::default());
                around.reset([-3.0; 3], 1.0, 5, starts.clone());
                for round in 0..400 {
                    let (x, wide) = (place(&mut random), 1.2 * random.share());
                    let foot = places.iter().min_by(|a, b| distance_squared(a, &x).total_cmp(&distance_squared(b, &x))).unwrap();
                    let out = unit(&subtract(&x, foot)).map(|x| x * (least + 0.25 * random.share()));
                    let triangle: [Point; 3] =
                        std::array::from_fn(|_| std::array::from_fn(|axis| foot[axis] + out[axis] + wide * (random.share() - 0.5)));
                    nearby.reset(3, RADIUS + TOLERANCE, least * least, size);
                    let is_clear = nearby.is_clear(tree, &mut around, [0, 1, 2], &triangle, least);
                    let of = |site: &Point| distance_squared(site, &closest_on_triangle(site, &triangle[0], &triangle[1], &triangle[2]));
                    let distance = places.iter().map(of).fold(f64::INFINITY, f64::min).sqrt();
                    assert!(!is_clear || distance >= least, "{size} {round}: {distance}");
                    if distance > 1.05 * least {
                        (told, clear) = (told + u32::from(is_clear), clear + 1);
                    }
                }
                assert!(clear > 60 && clear < 340, "{clear}");
                f64::from(told) / f64::from(clear)
            });
            assert!(shares.iter().all(|&share| share > 0.95), "{shares:?}");
        });
    }
}
