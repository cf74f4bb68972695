//! Points, segments and other figures K whose dilation has the topology of an attractor's, A, which is shown by directions along which both are left.
//!
//! Let f be the distance from A, g that from K, and Q the places x with min(f, g) <= r <= max(f, g). Let each of them have a direction w with w . (x - c) > 0 for all places c of A and of K that are closest to x. Closest places depend on x upper semicontinuously: so that holds around all these x, for a smooth field of directions.
//! Along it f and g rise, faster than some rate as Q is compact, and against it they fall: what is in one of both dilations goes, within Q, to where it is in both, and what was in both stays. Each is retracted to their intersection, and their complements to that of their union: both have the same components, handles and voids.
//!
//! That is asked cube by cube. Let y be a cube's middle and h half its diagonal, and let A be the union of cells, some in balls around c_i of radii p_i; with t_i = |y - c_i| and u_i = (y - c_i) / t_i. For all x of the cube |x - c_i| is no less than t_i + u_i . (x - y), and no more than that and h^2 / 2 (t_i - h).
//! So cell i has no place that is closest to any x of it if, for some k, t_i - t_k exceeds p_i + p_k + h^2 / 2 (t_k - h) and what (u_k - u_i) . (x - y) may be; and likewise for K, whose balls have no radius. For the others one w must have w . (y - c_i) larger than p_i and what w . (y - x) may be.
//! Of a convex figure of K, c_i is the place that is closest to y: its distance is convex, so both bounds hold for it, too; and the way from the closest place turns by no more than x moves, |x - c(x) - (y - c(y))| <= |x - y|, so that w . (y - c_i) must be larger than h.
//! That of a segment or a polygon moves along its line or plane, by no more than x does: larger than what w . (y - x) may be and h |w_i|, with the part w_i of w along there, is enough, too. So is what serves a ball around the figure.
//!
//! Other cells, smooth ones, are looked at as figures that stand for them, no place of either farther than p_i from one of the other: p_i is far less than a ball's radius is then. Let d be how far x is from a figure, q its closest place, and c the cell's, closest to x of all A: so |x - c| <= d + p_i, and c is within p_i of a place c' of one
//! of its figures, no farther than d + 2 p_i from x. As the figure is convex |c' - q|^2 <= (d + 2 p_i)^2 - d^2 = 4 p_i (d + p_i). So w . (y - c_i) must be larger by p_i + 2 sqrt(p_i (d + p_i)), with d no more than t_i + h; or w serves the ball around the cell.
//!
//! Where there is none its cells are replaced by smaller ones, and the cube is halved: cells that are deep inside, or farther than others, never are.
//!
//! K may be any figures. It serves if it has places of A that are closest to some around which A is about as far as the radius, and covers what is deeper.
//!
//! Where all of A and K is within w of a plane, straight up leads away from all of it at places that are higher than it. The others are within w of a place of the plane, and so are as far from all places but for w: only squares in the plane are looked at.

use super::arrangement::{Cube, Figure, Span};
use super::convex::Convex;
use super::surface::NameHasher;
use super::tree::{Candidates, Weighted};
use crate::attractor::Attractor;
use crate::attractor::cell::{Ball, Cell, ControlPoint, Point, distance_squared, dot, subtract};
use crate::automaton::LeafPrimitive;
use crate::budget::{Budget, Stopped};
use rayon::prelude::*;
use std::collections::HashSet;
use std::hash::BuildHasherDefault;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Halves of the sides of cubes that are looked at one by one, in units of the radius; of the diagonals of those in which directions are looked for; of those that are halved no more where one doubt is enough, and where all are wanted.
const LARGE: f64 = 2.0;
const WIDEST: f64 = 1.0;
const NARROWEST: [f64; 2] = [1.0 / 256.0, 1.0 / 32_768.0];
/// How near figures are to what they stand for where directions are looked for, in units of half the diagonal squared over the radius; in cubes as narrow as this only where there is none else.
const NEARER: f64 = 1.0 / 16.0;
const NARROW: f64 = 1.0 / 16.0;
/// Places are not asked for that are no farther than this, in units of the radius, from one in doubt.
const AROUND: f64 = 0.25;
/// Radii of cells at most, in units of half a cube's diagonal.
const REFINED: f64 = 1.6;
/// How far what is drawn for a cell is off it at most, as a share of its ball's radius, to be looked at instead.
const DRAWN: f64 = 0.25;
/// Looks at cells at most to find points, and at both to compare them: shapes with more of a surface take longer than all else.
const MOST_TO_FIND: usize = 30_000_000;
const MOST_LOOKS: usize = 150_000_000;
/// The same to compare them with figures that nearly are the attractor: in any case, and for each figure.
const FEW_LOOKS: usize = 30_000_000;
const LOOKS: usize = 5_000;
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
    /// K, and of each of its figures a ball around it, and what its closest place moves along, if it does.
    others: &'a [Figure],
    hulls: Vec<(Ball, Option<Span>)>,
    /// Looks that are left, and places in doubt that there may be still.
    left: AtomicUsize,
    doubts_left: AtomicUsize,
    narrowest: f64,
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
    /// What stands for each one, where that is far nearer to it than its ball is small: where it begins and ends in `figures`, and how far places of either are off the other.
    drawn: Vec<Option<(Range<u32>, f64)>>,
    figures: Vec<(Figure, Span)>,
}

/// A cell, or a figure of K, seen from the middle of a cube.
#[derive(Clone, Copy, Debug)]
struct View {
    index: u32,
    distance: f64,
    /// Of the ball, or how far the figure is off, and what distances are.
    radius: f64,
    away: Point,
    /// Around the cell, or around a figure of K.
    ball: Ball,
    /// How far a figure is off what it stands for, and along what its closest place moves; none of a ball, or of a point.
    flat: Option<(f64, Span)>,
}

/// Cells, with their balls, and figures of K that may matter in a cube, by their numbers.
#[derive(Clone, Debug, Default)]
struct Lists {
    cells: Vec<(u32, Ball)>,
    others: Vec<u32>,
}

/// Where those of one cube are in lists.
#[derive(Clone, Debug)]
struct Ranges {
    cells: Range<usize>,
    others: Range<usize>,
}

/// Working memory: the lists of a cube are behind those of the ones around it.
#[derive(Debug, Default)]
struct Work {
    nodes: Nodes,
    lists: Lists,
    /// What may be closest to places of a cube.
    cells: Vec<View>,
    others: Vec<View>,
    open: Vec<(u32, Ball)>,
    small: Vec<(u32, Ball)>,
    /// Places that have no direction.
    doubts: Vec<Point>,
}

impl Nodes {
    fn push(&mut self, attractor: &Attractor, cell: Cell, points: &[ControlPoint]) -> u32 {
        self.starts.push(self.points.len());
        self.points.extend_from_slice(points);
        self.cells.push(cell);
        self.children.push(None);
        let drawn = self.draw(attractor, &cell, points);
        self.drawn.push(drawn);
        self.cells.len() as u32 - 1
    }

    /// Adds the figures that stand for a cell, where they serve better than its ball.
    fn draw(&mut self, attractor: &Attractor, cell: &Cell, points: &[ControlPoint]) -> Option<(Range<u32>, f64)> {
        // Of rough cells the ball serves as well.
        let is_smooth =
            matches!(attractor.state_of(cell).leaf, LeafPrimitive::Simplex | LeafPrimitive::Chord(_) | LeafPrimitive::Polygon(_));
        let off = if is_smooth { attractor.leaf_error(cell, points) } else { f64::INFINITY };
        let is_near = off.is_finite() && off <= DRAWN * cell.ball.radius;
        if !is_near {
            return None;
        }
        let first = self.figures.len() as u32;
        attractor.emit(cell, points, &mut |site| {
            let figure = Figure::from(Weighted { site, deficit: 0.0 });
            let span = figure.span();
            self.figures.push((figure, span));
        });
        let last = self.figures.len() as u32;
        (first < last).then_some((first..last, off))
    }

    /// Looks at a cell: at its ball, or at its figures.
    #[inline]
    fn show(&self, &(index, ball): &(u32, Ball), look: &mut Look<'_>) {
        let Some((figures, off)) = &self.drawn[index as usize] else { return look.see(index, &ball.centre, ball.radius, || (ball, None)) };
        for (figure, span) in &self.figures[figures.start as usize..figures.end as usize] {
            look.see(index, &figure.closest(&look.cube.centre), *off, || (ball, Some((*off, *span))));
        }
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
            self.push(attractor, *cell, points);
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

impl View {
    /// Where it is closest.
    fn place(&self, from: &Point) -> Point {
        std::array::from_fn(|axis| from[axis] - self.distance * self.away[axis])
    }
}

impl Work {
    /// Puts what is seen behind all lists.
    fn list(&mut self) -> Ranges {
        let Self { lists, cells, others, .. } = self;
        let first = [lists.cells.len(), lists.others.len()];
        for view in cells.iter() {
            // Figures of one cell are one after the other.
            if lists.cells[first[0]..].last().is_none_or(|&(last, _)| last != view.index) {
                lists.cells.push((view.index, view.ball));
            }
        }
        lists.others.extend(others.iter().map(|view| view.index));
        Ranges { cells: first[0]..lists.cells.len(), others: first[1]..lists.others.len() }
    }

    /// Drops all lists from some on.
    fn drop_from(&mut self, ranges: &Ranges) {
        self.lists.cells.truncate(ranges.cells.start);
        self.lists.others.truncate(ranges.others.start);
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

    /// Whether the dilation of figures without deficits has the same topology. False where that is not shown, or takes too long.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn is_that_of(&self, figures: &[Figure], budget: &Budget) -> Result<bool, Stopped> {
        Ok(self.doubts(figures, 0, budget)?.is_some_and(|doubts| doubts.is_empty()))
    }

    /// Places around which it is not shown that the dilation of figures without deficits has the same topology: of those that are near to each other one. None where these are more than `most`, or nothing was shown.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn doubts(&self, figures: &[Figure], most: usize, budget: &Budget) -> Result<Option<Vec<Point>>, Stopped> {
        let is_in_place = |point: &Point| self.plane.is_none_or(|(axis, at)| (point[axis] - at).abs() <= self.slack);
        let serves = |figure: &Figure| figure.deficit() == 0.0 && figure.corners().iter().all(is_in_place);
        if figures.is_empty() || !figures.iter().all(serves) {
            return Ok(None);
        }
        let looks = if most > 0 { MOST_LOOKS.min(FEW_LOOKS + LOOKS * figures.len()) } else { MOST_LOOKS };
        let search = Search {
            doubts_left: AtomicUsize::new(most),
            narrowest: NARROWEST[usize::from(most > 0)],
            ..self.search(figures, looks, budget)
        };
        let doubts = search.everywhere(|work, cube, ranges| {
            let is_done = search.holds(work, cube, ranges)?;
            Ok(is_done.then(|| std::mem::take(&mut work.doubts)))
        })?;
        // What uses up all looks at last has none left for others.
        let doubts: Option<Vec<Vec<Point>>> = doubts.into_iter().collect::<Option<_>>().filter(|_| search.has_looks());
        Ok(doubts.map(|doubts| doubts.concat()))
    }

    fn search<'a>(&'a self, others: &'a [Figure], looks: usize, budget: &'a Budget) -> Search<'a> {
        Search {
            flow: self,
            others,
            hulls: others.iter().map(|figure| (figure.ball(), (figure.corners().len() > 1).then(|| figure.span()))).collect(),
            left: AtomicUsize::new(looks),
            doubts_left: AtomicUsize::new(0),
            narrowest: NARROWEST[0],
            room: (budget.limits.memory_bytes / BYTES_PER_CELL) as usize,
            budget,
        }
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
}

/// A look for what may hold the closest place of any place of a cube.
struct Look<'a> {
    flow: &'a Flow<'a>,
    cube: &'a Cube,
    half: f64,
    /// The least of the longest ways from the middle to one of all, and which one it is.
    high: f64,
    nearest: Option<View>,
    views: &'a mut Vec<View>,
}

impl<'a> Look<'a> {
    fn new(flow: &'a Flow<'a>, cube: &'a Cube, views: &'a mut Vec<View>) -> Self {
        views.clear();
        Self { flow, cube, half: flow.half(cube), high: f64::INFINITY, nearest: None, views }
    }

    /// Whether nothing in a ball is closest to any place of the cube.
    #[inline]
    fn is_beyond(&self, ball: &Ball) -> bool {
        let reach = self.high + 2.0 * self.half + ball.radius + self.flow.slack;
        distance_squared(&self.cube.centre, &ball.centre) > reach * reach
    }

    /// Looks at a ball, or at the closest place of a figure, given the rest of what is seen.
    #[inline]
    fn see(&mut self, index: u32, place: &Point, radius: f64, rest: impl FnOnce() -> (Ball, Option<(f64, Span)>)) {
        let (way, radius) = (subtract(&self.cube.centre, place), radius + self.flow.slack);
        let square = dot(&way, &way);
        if square > (self.high + 2.0 * self.half + radius).powi(2) {
            return;
        }
        let distance = square.sqrt();
        let away = way.map(|part| if distance > 0.0 { part / distance } else { 0.0 });
        let (ball, flat) = rest();
        let view = View { index, distance, radius, away, ball, flat };
        if distance + radius < self.high {
            (self.nearest, self.high) = (Some(view), distance + radius);
        }
        self.views.push(view);
    }

    /// Drops what is nowhere closest; returns bounds of the distance from what is in all.
    fn bounds(self) -> [f64; 2] {
        let Self { flow, cube, half, high, nearest, views } = self;
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
                || (way <= 2.0 * half && way - bulge <= flow.half_along(cube, &subtract(&view.away, &nearest.away)))
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
            let cell = first.nodes.push(attractor, candidate.cell, candidates.points_of(attractor, candidate));
            first.lists.cells.push((cell, candidate.cell.ball));
        }
        first.lists.others.extend(0..self.others.len() as u32);
        let mut cubes = Vec::new();
        let mut open = vec![(self.around(&first.nodes), std::mem::take(&mut first.lists))];
        while let Some((cube, lists)) = open.pop() {
            self.budget.cancel.check()?;
            if !self.spend(lists.cells.len() + lists.others.len()) {
                return Ok(Vec::new());
            }
            let ranges = Ranges { cells: 0..lists.cells.len(), others: 0..lists.others.len() };
            first.lists = lists;
            let of_others = self.see_others(&mut first, &cube, &ranges);
            let [low, high] = self.see_cells(&mut first, &cube, &ranges);
            if low.min(of_others[0]) > self.flow.radius {
                continue;
            }
            let is_parted = cube.half > LARGE * self.flow.radius && high >= self.flow.radius;
            if is_parted {
                self.refine(&mut first, &cube, [0.5 * REFINED * self.flow.half(&cube); 2]);
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
                let copied = own.nodes.push(attractor, nodes.cells[cell as usize], nodes.points_of(attractor, cell));
                own.lists.cells.push((copied, ball));
            }
            own.lists.others = lists.others;
            let ranges = Ranges { cells: 0..own.lists.cells.len(), others: 0..own.lists.others.len() };
            work(&mut own, &cube, &ranges)
        };
        cubes.into_par_iter().map(of_cube).collect()
    }

    /// A cube around all places in question.
    fn around(&self, nodes: &Nodes) -> Cube {
        let [mut low, mut high] = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        let of_ball = |Ball { centre, radius }: Ball| [centre.map(|x| x - radius), centre.map(|x| x + radius)];
        let of_cells = nodes.cells.iter().map(|cell| of_ball(cell.ball));
        for [from, to] in of_cells.chain(self.others.iter().map(Figure::bounds)) {
            low = std::array::from_fn(|axis| low[axis].min(from[axis]));
            high = std::array::from_fn(|axis| high[axis].max(to[axis]));
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
        let Work { nodes, lists, cells, .. } = work;
        let mut look = Look::new(self.flow, cube, cells);
        lists.cells[ranges.cells.clone()].iter().for_each(|cell| nodes.show(cell, &mut look));
        look.bounds()
    }

    /// The same for K.
    fn see_others(&self, work: &mut Work, cube: &Cube, ranges: &Ranges) -> [f64; 2] {
        let mut look = Look::new(self.flow, cube, &mut work.others);
        for &index in &work.lists.others[ranges.others.clone()] {
            let (ball, span) = self.hulls[index as usize];
            if look.is_beyond(&ball) {
                continue;
            }
            let place = self.others[index as usize].closest(&cube.centre);
            look.see(index, &place, 0.0, || (ball, span.map(|span| (0.0, span))));
        }
        look.bounds()
    }

    /// Sees smaller cells in the place of those with balls, or with figures that are off, by more than told; none where there are no such.
    fn refine(&self, work: &mut Work, cube: &Cube, [of_ball, of_figure]: [f64; 2]) -> Option<[f64; 2]> {
        let Flow { attractor, slack, .. } = *self.flow;
        let half = self.flow.half(cube);
        let Work { nodes, cells, open, small, .. } = work;
        let is_small = |nodes: &Nodes, index: u32| match &nodes.drawn[index as usize] {
            Some((_, off)) => *off <= of_figure,
            None => nodes.ball(index).radius <= of_ball,
        };
        if nodes.cells.len() > self.room {
            self.give_up();
            return None;
        }
        if cells.iter().all(|view| is_small(nodes, view.index)) {
            return None;
        }
        let mut high = cells.iter().map(|view| view.distance + view.radius).fold(f64::INFINITY, f64::min);
        small.clear();
        open.extend(cells.iter().map(|view| (view.index, view.ball)));
        open.dedup_by_key(|&mut (index, _)| index);
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
            let children = if is_small(nodes, cell) { 0..0 } else { nodes.children(attractor, cell) };
            if children.is_empty() {
                small.push((cell, ball));
            }
            open.extend(children.map(|child| (child, nodes.ball(child))));
        }
        self.spend(looks % CHUNK);
        let mut look = Look::new(self.flow, cube, cells);
        small.iter().for_each(|cell| nodes.show(cell, &mut look));
        Some(look.bounds())
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
                found.covering.push(nearest.place(&cube.centre));
            }
            return Ok(true);
        }
        if half <= wide {
            let index = nearest.index;
            found.closest.push(work.nodes.foot(attractor, index, &cube.centre, NEARLY * wide));
            return Ok(true);
        }
        self.refine(work, cube, [0.5 * REFINED * half; 2]);
        let ranges = work.list();
        for part in self.flow.parts(*cube) {
            if !self.find(work, &part, &ranges, wide, found)? {
                return Ok(false);
            }
        }
        work.drop_from(&ranges);
        Ok(true)
    }

    /// Notes the places of a cube that are in question and have no direction. False where there are too many, or that takes too long.
    fn holds(&self, work: &mut Work, cube: &Cube, ranges: &Ranges) -> Result<bool, Stopped> {
        self.budget.cancel.check()?;
        if !self.spend(ranges.cells.len() + ranges.others.len()) {
            return Ok(false);
        }
        let Flow { radius, .. } = *self.flow;
        let half = self.flow.half(cube);
        let is_known = |doubt: &Point| distance_squared(doubt, &cube.centre).sqrt() + half < AROUND * radius;
        if work.doubts.iter().any(is_known) {
            return Ok(true);
        }
        let is_settled = |[a, b]: [[f64; 2]; 2]| a[0].min(b[0]) > radius || a[1].max(b[1]) < radius;
        let of_others = self.see_others(work, cube, ranges);
        let of_cells = self.see_cells(work, cube, ranges);
        let is_narrow = half <= WIDEST * radius;
        if is_settled([of_cells, of_others]) || is_narrow && self.have_direction(work, cube) {
            return Ok(true);
        }
        // As small as parts ask for: they have these in common.
        let small = 0.5 * REFINED * half;
        let nearer = [small, small.min(NEARER * half * half / radius)];
        let steps = [[small; 2], nearer];
        let first_step = usize::from(is_narrow && half > NARROW * radius);
        for &small in &steps[first_step..=usize::from(is_narrow)] {
            if let Some(of_cells) = self.refine(work, cube, small)
                && (is_settled([of_cells, of_others]) || is_narrow && self.have_direction(work, cube))
            {
                return Ok(true);
            }
        }
        if half <= self.narrowest * radius {
            let may_be = self.doubts_left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1)).is_ok();
            if !may_be {
                self.give_up();
            }
            work.doubts.push(cube.centre);
            return Ok(may_be);
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

    /// Whether a direction leads away from what is seen, wherever in a cube: given how far its places are from its middle at most, in all and along the direction.
    #[inline]
    fn is_left(&self, cube: &Cube, view: &View, direction: &Point, [half, along]: [f64; 2]) -> bool {
        let ahead = dot(direction, &view.away) * view.distance;
        let Some((off, span)) = &view.flat else { return ahead > view.radius + along };
        let slack = self.flow.slack;
        let aside = 2.0 * ((off + slack) * (view.distance + half + off + slack)).sqrt();
        // Joined figures are flat but for that.
        let moved = || along + half * span.along(direction) + 2.0 * slack;
        let from_ball = || dot(direction, &subtract(&cube.centre, &view.ball.centre)) > view.ball.radius + slack + along;
        let left = ahead - view.radius - aside;
        left > half || left > moved() || from_ball()
    }

    /// Whether one direction leads away from all that is seen, wherever in a cube.
    ///
    /// No direction is within a smaller angle of all ways from what is seen than that with a cosine of |p|, for any mean p of these: Gilbert's steps to the p of least length tell both that a direction serves, and that there is none.
    fn have_direction(&self, work: &Work, cube: &Cube) -> bool {
        let views = || work.cells.iter().chain(&work.others);
        let count = (work.cells.len() + work.others.len()) as f64;
        let sum = views().fold([0.0; 3], |sum: Point, view| std::array::from_fn(|axis| sum[axis] + view.away[axis]));
        let mut mean = sum.map(|part| part / count);
        // A direction has parts with a sum of at least 1; what a ball around a figure that is off would show with less is left.
        let wanted = views().map(|view| (view.radius + cube.half) / view.distance).fold(f64::INFINITY, f64::min);
        for _ in 0..STEPS {
            let length = dot(&mean, &mean).sqrt();
            if length <= wanted {
                return false;
            }
            let direction = mean.map(|part| part / length);
            let reach = [self.flow.half(cube), self.flow.half_along(cube, &direction)];
            let (mut serves, mut least) = (true, (f64::INFINITY, [0.0; 3]));
            for view in views() {
                let cosine = dot(&direction, &view.away);
                serves &= self.is_left(cube, view, &direction, reach);
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
mod tests;
