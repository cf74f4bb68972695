//! Points K whose dilation has the topology of an attractor's, A, which is shown by directions along which both are left.
//!
//! Let f be the distance from A, g that from K, and Q the places x with min(f, g) <= r <= max(f, g). Let each of them have a direction w with w . (x - c) > 0 for all places c of A and of K that are closest to x. Closest places depend on x upper semicontinuously: so that holds around all these x, for a smooth field of directions.
//! Along it f and g rise, faster than some rate as Q is compact, and against it they fall: what is in one of both dilations goes, within Q, to where it is in both, and what was in both stays. Each is retracted to their intersection, and their complements to that of their union: both have the same components, handles and voids.
//!
//! That is asked cube by cube. Let y be a cube's middle and h half its diagonal, and let A be the union of cells in balls around c_i of radii p_i; with t_i = |y - c_i| and u_i = (y - c_i) / t_i. For all x of the cube |x - c_i| is no less than t_i + u_i . (x - y), and no more than that and h^2 / 2 (t_i - h).
//! So cell i has no place that is closest to any x of it if, for some k, t_i - t_k exceeds p_i + p_k + h^2 / 2 (t_k - h) and what (u_k - u_i) . (x - y) may be; and likewise for K, whose balls have no radius. For the others one w must have w . (y - c_i) larger than p_i and what w . (y - x) may be.
//! Where there is none its cells are replaced by smaller ones, and the cube is halved: cells that are deep inside, or farther than others, never are.
//!
//! K may be any points. It serves if it has places of A that are closest to some around which A is about as far as the radius, and covers what is deeper.
//!
//! Where all of A and K is within w of a plane, straight up leads away from all of it at places that are higher than it. The others are within w of a place of the plane, and so are as far from all places but for w: only squares in the plane are looked at.

use super::arrangement::Cube;
use super::surface::NameHasher;
use super::tree::Candidates;
use crate::attractor::Attractor;
use crate::attractor::cell::{Ball, Cell, ControlPoint, Point, distance_squared, dot, subtract};
use crate::budget::{Budget, Stopped};
use rayon::prelude::*;
use std::collections::HashSet;
use std::hash::BuildHasherDefault;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Halves of the sides of cubes that are looked at one by one, in units of the radius; and of the diagonals of those in which directions are looked for, and of those that are halved no more.
const LARGE: f64 = 2.0;
const WIDEST: f64 = 0.6;
const NARROWEST: f64 = 1.0 / 256.0;
/// Radii of cells at most, in units of half a cube's diagonal.
const REFINED: f64 = 1.6;
/// Looks at cells at most to find points, and at both to compare them: shapes with more of a surface take longer than all else.
const MOST_TO_FIND: usize = 30_000_000;
const MOST_LOOKS: usize = 150_000_000;
/// Bytes of the memory that there may be for each cell that one large cube holds: many cubes are looked at at once.
const BYTES_PER_CELL: u64 = 4_000;
/// Looks between which it is asked whether to go on.
const CHUNK: usize = 256;
/// Steps to a direction.
const STEPS: u32 = 16;
/// The share of the way to another direction that a step takes at least.
const LEAST_SHARE: f64 = 1e-3;
/// Of points of the attractor in one cube of a grid the first alone is taken: its side, and how far they are from being closest, in units of half the diagonal of the cubes in which there is a place that they are closest to.
const CLOSE: f64 = 0.9;
const NEARLY: f64 = 0.1;

/// The dilation of an attractor.
pub(super) struct Flow<'a> {
    pub(super) attractor: &'a Attractor,
    pub(super) candidates: &'a Candidates,
    /// r.
    pub(super) radius: f64,
    /// How far distances are off at most: what rounding adds, and how far places are off a plane.
    pub(super) slack: f64,
    /// The axis across the plane that all lies in, and where that is on it.
    pub(super) plane: Option<(usize, f64)>,
}

/// What is looked at for one question.
struct Search<'a> {
    flow: &'a Flow<'a>,
    /// K.
    points: &'a [Point],
    /// Looks that are left.
    left: AtomicUsize,
    /// Cells that one large cube may hold.
    room: usize,
    budget: &'a Budget,
}

/// Cells that were met, each once.
#[derive(Debug, Default)]
struct Nodes {
    cells: Vec<Cell>,
    points: Vec<ControlPoint>,
    /// Where each one's control points begin.
    starts: Vec<usize>,
    /// Which cells one is the union of, once that was asked for.
    children: Vec<Option<Range<u32>>>,
}

/// A cell, or a point, seen from the middle of a cube.
#[derive(Clone, Copy, Debug)]
struct View {
    index: u32,
    distance: f64,
    /// Of the ball, and what distances are off.
    radius: f64,
    away: Point,
    ball: Ball,
}

/// Cells and points that may matter in a cube, with their numbers.
#[derive(Clone, Debug, Default)]
struct Lists {
    cells: Vec<(u32, Ball)>,
    points: Vec<(u32, Ball)>,
}

/// Where those of one cube are in lists.
#[derive(Clone, Debug)]
struct Ranges {
    cells: Range<usize>,
    points: Range<usize>,
}

/// Working memory: the lists of a cube are behind those of the ones around it.
#[derive(Debug, Default)]
struct Work {
    nodes: Nodes,
    lists: Lists,
    /// What may be closest to places of a cube.
    cells: Vec<View>,
    points: Vec<View>,
    open: Vec<(u32, Ball)>,
    small: Vec<(u32, Ball)>,
}

impl Nodes {
    fn push(&mut self, cell: Cell, points: &[ControlPoint]) -> u32 {
        self.starts.push(self.points.len());
        self.points.extend_from_slice(points);
        self.cells.push(cell);
        self.children.push(None);
        self.cells.len() as u32 - 1
    }

    fn ball(&self, index: u32) -> Ball {
        self.cells[index as usize].ball
    }

    fn points_of(&self, attractor: &Attractor, index: u32) -> &[ControlPoint] {
        let first = self.starts[index as usize];
        &self.points[first..first + attractor.state_of(&self.cells[index as usize]).dimension]
    }

    /// What a cell is the union of; nothing where it cannot be split.
    fn children(&mut self, attractor: &Attractor, index: u32) -> Range<u32> {
        if let Some(known) = &self.children[index as usize] {
            return known.clone();
        }
        let first = self.cells.len() as u32;
        let made: Vec<_> = attractor.children(&self.cells[index as usize], self.points_of(attractor, index)).collect();
        made.iter().for_each(|(cell, points)| {
            self.push(*cell, points);
        });
        let children = first..self.cells.len() as u32;
        self.children[index as usize] = Some(children.clone());
        children
    }

    /// The middle of a cell below one, no larger than told, that is nearly as close to a place as any.
    fn foot(&mut self, attractor: &Attractor, mut index: u32, place: &Point, small: f64) -> Point {
        loop {
            let ball = self.ball(index);
            let children = if ball.radius > small { self.children(attractor, index) } else { 0..0 };
            let far = |child: &u32| {
                let ball = self.ball(*child);
                distance_squared(&ball.centre, place).sqrt() + ball.radius
            };
            match children.min_by(|a, b| far(a).total_cmp(&far(b))) {
                Some(child) => index = child,
                None => return ball.centre,
            }
        }
    }
}

impl Work {
    /// Puts what is seen behind all lists.
    fn list(&mut self) -> Ranges {
        let Self { lists, cells, points, .. } = self;
        let first = [lists.cells.len(), lists.points.len()];
        lists.cells.extend(cells.iter().map(|view| (view.index, view.ball)));
        lists.points.extend(points.iter().map(|view| (view.index, view.ball)));
        Ranges { cells: first[0]..lists.cells.len(), points: first[1]..lists.points.len() }
    }

    /// Drops all lists from some on.
    fn drop_from(&mut self, ranges: &Ranges) {
        self.lists.cells.truncate(ranges.cells.start);
        self.lists.points.truncate(ranges.points.start);
    }
}

impl Flow<'_> {
    /// Points with as much of the attractor as tells its dilation: those that are closest to a place in each of the cubes, with half a diagonal of no more than `wide`, that have some about as far as the radius, and others that cover what is deeper. None where there are more than `most`.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn points(&self, wide: f64, most: usize, budget: &Budget) -> Result<Option<Vec<Point>>, Stopped> {
        let search = self.search(&[], MOST_TO_FIND, budget);
        let found = search.everywhere(|work, cube, ranges| {
            let mut found = Found::default();
            Ok(search.find(work, cube, ranges, wide, &mut found)?.then_some(found))
        })?;
        let Some(found) = found.into_iter().collect::<Option<Vec<Found>>>().filter(|_| search.has_looks()) else { return Ok(None) };
        let (mut met, side) = (HashSet::<[i64; 3], BuildHasherDefault<NameHasher>>::default(), CLOSE * wide);
        let mut points: Vec<Point> = found.iter().flat_map(|found| &found.covering).copied().collect();
        points.extend(found.iter().flat_map(|found| &found.closest).filter(|at| met.insert(at.map(|x| (x / side).floor() as i64))));
        if let Some((axis, at)) = self.plane {
            points.iter_mut().for_each(|point| point[axis] = at);
        }
        Ok((!points.is_empty() && points.len() <= most).then_some(points))
    }

    /// Whether the dilation of points has the same topology. False where that is not shown, or takes too long.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn is_that_of(&self, points: &[Point], budget: &Budget) -> Result<bool, Stopped> {
        let is_in_place = |point: &Point| self.plane.is_none_or(|(axis, at)| (point[axis] - at).abs() <= self.slack);
        if points.is_empty() || !points.iter().all(is_in_place) {
            return Ok(false);
        }
        let search = self.search(points, MOST_LOOKS, budget);
        let holds = search.everywhere(|work, cube, ranges| search.holds(work, cube, ranges))?;
        // What uses up all looks at last has none left for others.
        Ok(holds.into_iter().all(|holds| holds) && search.has_looks())
    }

    fn search<'a>(&'a self, points: &'a [Point], looks: usize, budget: &'a Budget) -> Search<'a> {
        Search { flow: self, points, left: AtomicUsize::new(looks), room: (budget.limits.memory_bytes / BYTES_PER_CELL) as usize, budget }
    }

    /// The parts of a cube in which there may be places in question: of a square in the plane four.
    fn parts(&self, cube: Cube) -> impl Iterator<Item = Cube> {
        let plane = self.plane;
        (0..8).filter(move |number| plane.is_none_or(|(axis, _)| number >> axis & 1 == 0)).map(move |number| {
            let mut part = cube.part(number);
            if let Some((axis, at)) = plane {
                part.centre[axis] = at;
            }
            part
        })
    }

    /// Half the diagonal of a cube, or of a square in the plane; and how far its places are from its middle along a direction at most.
    fn half(&self, cube: &Cube) -> f64 {
        if self.plane.is_some() { 2.0_f64.sqrt() * cube.half } else { cube.half_diagonal() }
    }

    fn half_along(&self, cube: &Cube, direction: &Point) -> f64 {
        let across = self.plane.map_or(0.0, |(axis, _)| cube.half * direction[axis].abs());
        cube.half_along(direction) - across
    }

    /// Looks for those balls that may hold the closest place of any place of a cube; returns bounds of the distance from what is in all of them.
    fn look<'b>(&self, cube: &Cube, balls: impl Iterator<Item = &'b (u32, Ball)>, views: &mut Vec<View>) -> [f64; 2] {
        views.clear();
        let half = self.half(cube);
        let (mut nearest, mut high): (Option<View>, f64) = (None, f64::INFINITY);
        for &(index, ball) in balls {
            let (way, radius) = (subtract(&cube.centre, &ball.centre), ball.radius + self.slack);
            let square = dot(&way, &way);
            if square > (high + 2.0 * half + radius).powi(2) {
                continue;
            }
            let distance = square.sqrt();
            let view = View { index, distance, radius, away: way.map(|part| if distance > 0.0 { part / distance } else { 0.0 }), ball };
            if distance + radius < high {
                (nearest, high) = (Some(view), distance + radius);
            }
            views.push(view);
        }
        // Of what has no bounds nothing is known.
        if !views.iter().map(|view| view.distance + view.radius).sum::<f64>().is_finite() {
            return [f64::NEG_INFINITY, f64::INFINITY];
        }
        let Some(nearest) = nearest else { return [f64::INFINITY; 2] };
        // The nearest of all is among these.
        let low = views.iter().map(|view| view.distance - view.radius).fold(f64::INFINITY, f64::min);
        let bulge = if nearest.distance > half { 0.5 * half * half / (nearest.distance - half) } else { f64::INFINITY };
        views.retain(|view| {
            let way = view.distance - view.radius - high;
            way <= bulge.min(2.0 * half)
                || (way <= 2.0 * half && way - bulge <= self.half_along(cube, &subtract(&view.away, &nearest.away)))
        });
        [low - half, high + half]
    }
}

/// Points that tell a dilation.
#[derive(Debug, Default)]
struct Found {
    closest: Vec<Point>,
    covering: Vec<Point>,
}

impl Search<'_> {
    /// What comes of all large cubes in which there are places in question. Where that takes too long, no looks are left.
    fn everywhere<T: Send>(&self, work: impl Fn(&mut Work, &Cube, &Ranges) -> Result<T, Stopped> + Sync) -> Result<Vec<T>, Stopped> {
        let Flow { attractor, candidates, .. } = self.flow;
        let mut first = Work::default();
        for candidate in &candidates.cells {
            let cell = first.nodes.push(candidate.cell, candidates.points_of(attractor, candidate));
            first.lists.cells.push((cell, candidate.cell.ball));
        }
        first.lists.points.extend((0..).zip(self.points.iter().map(|&centre| Ball { centre, radius: 0.0 })));
        let mut cubes = Vec::new();
        let mut open = vec![(self.around(&first.nodes), std::mem::take(&mut first.lists))];
        while let Some((cube, lists)) = open.pop() {
            self.budget.cancel.check()?;
            if !self.spend(lists.cells.len() + lists.points.len()) {
                return Ok(Vec::new());
            }
            let ranges = Ranges { cells: 0..lists.cells.len(), points: 0..lists.points.len() };
            first.lists = lists;
            let of_points = self.see_points(&mut first, &cube, &ranges);
            let [low, high] = self.see_cells(&mut first, &cube, &ranges);
            if low.min(of_points[0]) > self.flow.radius {
                continue;
            }
            let is_parted = cube.half > LARGE * self.flow.radius && high >= self.flow.radius;
            if is_parted {
                self.refine(&mut first, &cube, 0.5 * REFINED * self.flow.half(&cube));
            }
            first.lists = Lists::default();
            first.list();
            let lists = std::mem::take(&mut first.lists);
            if is_parted {
                open.extend(self.flow.parts(cube).map(|part| (part, lists.clone())));
            } else {
                cubes.push((cube, lists));
            }
        }
        let nodes = first.nodes;
        let of_cube = |(cube, lists): (Cube, Lists)| {
            let mut own = Work::default();
            for (cell, ball) in lists.cells {
                let copied = own.nodes.push(nodes.cells[cell as usize], nodes.points_of(attractor, cell));
                own.lists.cells.push((copied, ball));
            }
            own.lists.points = lists.points;
            let ranges = Ranges { cells: 0..own.lists.cells.len(), points: 0..own.lists.points.len() };
            work(&mut own, &cube, &ranges)
        };
        cubes.into_par_iter().map(of_cube).collect()
    }

    /// A cube around all places in question.
    fn around(&self, nodes: &Nodes) -> Cube {
        let [mut low, mut high] = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        let of_points = self.points.iter().map(|&centre| Ball { centre, radius: 0.0 });
        for ball in nodes.cells.iter().map(|cell| cell.ball).chain(of_points) {
            low = std::array::from_fn(|axis| low[axis].min(ball.centre[axis] - ball.radius));
            high = std::array::from_fn(|axis| high[axis].max(ball.centre[axis] + ball.radius));
        }
        let side = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
        let mut centre: Point = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
        if let Some((axis, at)) = self.flow.plane {
            centre[axis] = at;
        }
        Cube { centre, half: 0.5 * side + self.flow.radius + self.flow.slack }
    }

    /// Takes looks from those that are left; false where there are not as many.
    fn spend(&self, looks: usize) -> bool {
        let is_enough = self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(looks)).is_ok();
        if !is_enough {
            self.give_up();
        }
        is_enough
    }

    fn has_looks(&self) -> bool {
        self.left.load(Ordering::Relaxed) > 0
    }

    /// Ends all searches for the same question.
    fn give_up(&self) {
        self.left.store(0, Ordering::Relaxed);
    }

    /// Sees the cells that may be closest to places of a cube; returns bounds of the distance from the attractor there.
    fn see_cells(&self, work: &mut Work, cube: &Cube, ranges: &Ranges) -> [f64; 2] {
        self.flow.look(cube, work.lists.cells[ranges.cells.clone()].iter(), &mut work.cells)
    }

    /// The same for points.
    fn see_points(&self, work: &mut Work, cube: &Cube, ranges: &Ranges) -> [f64; 2] {
        self.flow.look(cube, work.lists.points[ranges.points.clone()].iter(), &mut work.points)
    }

    /// Sees cells with no larger radius than told in the place of larger ones; none where there are no such.
    fn refine(&self, work: &mut Work, cube: &Cube, most: f64) -> Option<[f64; 2]> {
        let Flow { attractor, slack, .. } = *self.flow;
        let half = self.flow.half(cube);
        let Work { nodes, cells, open, small, .. } = work;
        if cells.iter().all(|view| view.radius - slack <= most) {
            return None;
        }
        let mut high = cells.iter().map(|view| view.distance + view.radius).fold(f64::INFINITY, f64::min);
        small.clear();
        open.extend(cells.iter().map(|view| (view.index, view.ball)));
        let mut looks = 0;
        while let Some((cell, ball)) = open.pop() {
            looks += 1;
            let may_go_on = || nodes.cells.len() <= self.room && self.budget.cancel.reason().is_none() && self.spend(CHUNK);
            if looks % CHUNK == 0 && !may_go_on() {
                self.give_up();
                open.clear();
                return None;
            }
            let (square, radius) = (distance_squared(&cube.centre, &ball.centre), ball.radius + slack);
            if square > (high + 2.0 * half + radius).powi(2) {
                continue;
            }
            high = high.min(square.sqrt() + radius);
            let children = if ball.radius > most { nodes.children(attractor, cell) } else { 0..0 };
            if children.is_empty() {
                small.push((cell, ball));
            }
            open.extend(children.map(|child| (child, nodes.ball(child))));
        }
        self.spend(looks % CHUNK);
        Some(self.flow.look(cube, small.iter(), cells))
    }

    /// Finds points for a cube; false where that takes too long.
    fn find(&self, work: &mut Work, cube: &Cube, ranges: &Ranges, wide: f64, found: &mut Found) -> Result<bool, Stopped> {
        self.budget.cancel.check()?;
        if !self.spend(ranges.cells.len()) {
            return Ok(false);
        }
        let Flow { attractor, radius, slack, .. } = *self.flow;
        let half = self.flow.half(cube);
        let [low, high] = self.see_cells(work, cube, ranges);
        let nearest = work.cells.iter().min_by(|a, b| (a.distance + a.radius).total_cmp(&(b.distance + b.radius)));
        let Some(nearest) = nearest.filter(|_| low <= radius) else { return Ok(true) };
        if high < radius {
            let covers = |at: &Point| distance_squared(at, &cube.centre).sqrt() + half + slack < radius;
            if !found.covering.iter().any(covers) {
                found.covering.push(work.nodes.ball(nearest.index).centre);
            }
            return Ok(true);
        }
        if half <= wide {
            let index = nearest.index;
            found.closest.push(work.nodes.foot(attractor, index, &cube.centre, NEARLY * wide));
            return Ok(true);
        }
        self.refine(work, cube, 0.5 * REFINED * half);
        let ranges = work.list();
        for part in self.flow.parts(*cube) {
            if !self.find(work, &part, &ranges, wide, found)? {
                return Ok(false);
            }
        }
        work.drop_from(&ranges);
        Ok(true)
    }

    /// Whether all places of a cube that are in question have a direction. False where that is not shown.
    fn holds(&self, work: &mut Work, cube: &Cube, ranges: &Ranges) -> Result<bool, Stopped> {
        self.budget.cancel.check()?;
        if !self.spend(ranges.cells.len() + ranges.points.len()) {
            return Ok(false);
        }
        let Flow { radius, .. } = *self.flow;
        let half = self.flow.half(cube);
        let is_settled = |[a, b]: [[f64; 2]; 2]| a[0].min(b[0]) > radius || a[1].max(b[1]) < radius;
        let of_points = self.see_points(work, cube, ranges);
        let of_cells = self.see_cells(work, cube, ranges);
        let is_narrow = half <= WIDEST * radius;
        if is_settled([of_cells, of_points]) || is_narrow && self.have_direction(work, cube) {
            return Ok(true);
        }
        // As small as parts ask for: they have these in common.
        if let Some(of_cells) = self.refine(work, cube, 0.5 * REFINED * half)
            && (is_settled([of_cells, of_points]) || is_narrow && self.have_direction(work, cube))
        {
            return Ok(true);
        }
        if half <= NARROWEST * radius {
            self.give_up();
            return Ok(false);
        }
        let ranges = work.list();
        for part in self.flow.parts(*cube) {
            if !self.holds(work, &part, &ranges)? {
                return Ok(false);
            }
        }
        work.drop_from(&ranges);
        Ok(true)
    }

    /// Whether one direction leads away from all that is seen, wherever in a cube.
    ///
    /// No direction is within a smaller angle of all ways from what is seen than that with a cosine of |p|, for any mean p of these: Gilbert's steps to the p of least length tell both that a direction serves, and that there is none.
    fn have_direction(&self, work: &Work, cube: &Cube) -> bool {
        let views = || work.cells.iter().chain(&work.points);
        let count = (work.cells.len() + work.points.len()) as f64;
        let sum = views().fold([0.0; 3], |sum: Point, view| std::array::from_fn(|axis| sum[axis] + view.away[axis]));
        let mut mean = sum.map(|part| part / count);
        // A direction has parts with a sum of at least 1.
        let wanted = views().map(|view| (view.radius + cube.half) / view.distance).fold(f64::INFINITY, f64::min);
        for _ in 0..STEPS {
            let length = dot(&mean, &mean).sqrt();
            if length <= wanted {
                return false;
            }
            let direction = mean.map(|part| part / length);
            let along = self.flow.half_along(cube, &direction);
            let (mut serves, mut least) = (true, (f64::INFINITY, [0.0; 3]));
            for view in views() {
                let cosine = dot(&direction, &view.away);
                serves &= cosine * view.distance > view.radius + along;
                if cosine < least.0 {
                    least = (cosine, view.away);
                }
            }
            if serves {
                return true;
            }
            let way = subtract(&least.1, &mean);
            let (ahead, square) = (-dot(&mean, &way), dot(&way, &way));
            if ahead <= LEAST_SHARE * square {
                return false;
            }
            let share = (ahead / square).min(1.0);
            mean = std::array::from_fn(|axis| mean[axis] + share * way[axis]);
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::super::arrangement::testing::{centres, copies_in_space, critical_values, of_roots, on_lattice, points, topology};
    use super::super::dilate_unsimplified;
    use super::*;
    use crate::split_mix::Random;
    use crate::tolerance::{Radius, Tolerance};
    use glam::DVec3;

    fn is_shown(attractor: &Attractor, radius: f64, others: &[DVec3]) -> bool {
        let candidates = of_roots(attractor);
        let flow = Flow { attractor, candidates: &candidates, radius, slack: 1e-12, plane: None };
        flow.is_that_of(&others.iter().map(DVec3::to_array).collect::<Vec<Point>>(), &Budget::default()).unwrap()
    }

    fn vector(random: &mut Random) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| 2.0 * random.share() - 1.0))
    }

    /// Two points, the corners of a triangle and of a tetrahedron, regular ones: parts join, a handle and a void close, where the radius is half a side, or that of the circle or sphere around them.
    #[test]
    fn nothing_is_shown_where_topologies_differ() {
        let triangle = [DVec3::X, DVec3::new(-0.5, 0.75_f64.sqrt(), 0.0), DVec3::new(-0.5, -(0.75_f64.sqrt()), 0.0)];
        let tetrahedron = [DVec3::ONE, DVec3::new(1.0, -1.0, -1.0), DVec3::new(-1.0, 1.0, -1.0), DVec3::new(-1.0, -1.0, 1.0)];
        let sets = [vec![-DVec3::X, DVec3::X], triangle.to_vec(), tetrahedron.map(DVec3::normalize).to_vec()];
        let at = |set: &[DVec3], share: f64| set.iter().map(|x| DVec3::new(3.0, -2.0, 5.0) + share * *x).collect::<Vec<DVec3>>();
        for set in &sets {
            for moved in [1e-6, 1e-3, 0.05] {
                let (wider, narrower) = (at(set, 1.0 + moved), at(set, 1.0 - moved));
                assert!(!is_shown(&points(&wider), 1.0, &narrower) && !is_shown(&points(&narrower), 1.0, &wider), "{set:?}, {moved}");
                let [far, farther] = [0.1, 0.12].map(|share| at(set, 1.0 + share));
                let [near, nearer] = [0.1, 0.12].map(|share| at(set, 1.0 - share));
                assert!(is_shown(&points(&far), 1.0, &farther) && is_shown(&points(&nearer), 1.0, &near), "{set:?}");
            }
        }
        // What only one of both has.
        assert!(!is_shown(&points(&sets[0]), 0.5, &sets[0][..1]) && !is_shown(&points(&sets[0][..1]), 0.5, &sets[0]));
    }

    /// Points in a plane, of which one critical value, known from closed forms, is above the radius, and the same points closer to each other, so that it is below: in no plane.
    #[test]
    fn nothing_is_shown_in_a_plane_across_a_critical_value() {
        let mut random = Random(29);
        let (mut across, mut shown, mut clear) = (0, 0, 0);
        for round in 0..1_500 {
            let axis = round % 3;
            let mut set: Vec<(Point, f64)> = (0..2 + round % 7).map(|_| ((1.8 * vector(&mut random)).to_array(), 0.0)).collect();
            set.iter_mut().for_each(|(at, _)| at[axis] = 0.0);
            let values: Vec<f64> = critical_values(&set).into_iter().map(|(value, _)| value).collect();
            let Some(&value) = values.get((random.next() % 6) as usize).filter(|&&value| value > 0.3) else { continue };
            let moved = [1e-6, 1e-3, 1e-2][round / 3 % 3];
            let at = |share: f64| -> Vec<DVec3> {
                let place = |(at, _): &(Point, f64)| {
                    let mut at = at.map(|x| x * share);
                    at[axis] = 0.7;
                    DVec3::from_array(at)
                };
                set.iter().map(place).collect()
            };
            let told = |one: f64, other: f64| {
                let attractor = points(&at(one));
                let candidates = of_roots(&attractor);
                let flow = Flow { attractor: &attractor, candidates: &candidates, radius: 1.0, slack: 1e-12, plane: Some((axis, 0.7)) };
                flow.is_that_of(&at(other).iter().map(DVec3::to_array).collect::<Vec<Point>>(), &Budget::default()).unwrap()
            };
            across += 1;
            assert!(!told((1.0 + moved) / value, (1.0 - moved) / value), "{round}: {values:?}, {moved}");
            // All values of the one are as far on the same side of the radius as those of the other, and none is near.
            let share = 1.05 / value;
            if values.iter().all(|value| (share * value - 1.0).abs() > 0.04) {
                clear += 1;
                shown += usize::from(told(share, share * (1.0 + moved)));
            }
        }
        assert!(across > 500 && clear > 200 && 20 * shown > 19 * clear, "{across} across one, {shown} of {clear} shown");
    }

    /// Of random points and others beside them: never where their dilations have other topologies.
    #[test]
    fn random_points_have_the_topology_that_is_shown() {
        let mut random = Random(11);
        let (mut shown, mut compared, mut differ) = (0, 0, 0);
        for round in 0..240 {
            let set: Vec<DVec3> = (0..4 + round % 9).map(|_| 1.6 * vector(&mut random)).collect();
            let moved = [0.003, 0.03, 0.1][round % 3];
            let others: Vec<DVec3> = set.iter().map(|x| *x + moved * vector(&mut random)).collect();
            let made = |points: &Attractor| {
                dilate_unsimplified(points, Radius::new(1.0).unwrap(), Tolerance::new(0.25).unwrap(), &Budget::default()).unwrap()
            };
            let told = is_shown(&points(&set), 1.0, &others);
            shown += usize::from(told);
            let [one, other] = [&set, &others].map(|set| made(&points(set)));
            if one.topology_exact && other.topology_exact {
                let is_same = topology(&one) == topology(&other);
                assert!(!told || is_same, "{round}");
                (compared, differ) = (compared + 1, differ + usize::from(!is_same));
            }
        }
        assert!(shown >= 120 && compared >= 200 && differ >= 5, "{shown} shown, {compared} compared, {differ} differ");
    }

    /// The points that are found for random systems of maps tell as much as the centres of all small balls around their cells.
    #[test]
    fn random_systems_have_the_topology_of_small_balls() {
        let mut random = Random(5);
        let (mut shown, mut compared) = (0, 0);
        for round in 0..16 {
            let shape = copies_in_space(&mut random, 3 + round % 2);
            let radius = [6.0, 9.0, 14.0][round % 3];
            let candidates = of_roots(&shape);
            let flow = Flow { attractor: &shape, candidates: &candidates, radius, slack: 1e-10, plane: None };
            let told = [0.5, 0.2].into_iter().find_map(|wide| {
                let found = flow.points(wide * radius, 20_000, &Budget::default()).unwrap()?;
                flow.is_that_of(&found, &Budget::default()).unwrap().then_some(found)
            });
            let Some(found) = told else { continue };
            shown += 1;
            let small = 0.02 * radius;
            let Some(balls) = centres(&shape, small, 30_000) else { continue };
            let found: Vec<DVec3> = found.iter().map(|&at| DVec3::from_array(at)).collect();
            // The attractor's dilation is between those of all centres by less and by more.
            let made = |set: &[DVec3], radius: f64| on_lattice(&points(set), radius, 0.25 * radius);
            let all = [made(&found, radius), made(&balls, radius - small), made(&balls, radius + small)];
            let [own, less, more] = [0, 1, 2].map(|k| topology(&all[k]));
            if all.iter().all(|made| made.topology_exact) && less == more {
                assert_eq!(own, less, "{round}");
                compared += 1;
            }
        }
        assert!(shown >= 5 && compared >= 4, "{shown} shown, {compared} compared");
    }
}
