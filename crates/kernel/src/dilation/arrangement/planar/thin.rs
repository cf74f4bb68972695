//! Points that stand for cells, in one plane up to rounding: many are corners of several cells, and many more are between or among others.
//!
//! *Between*: let b be no farther than c from the hull of points k, none of which is farther than d - c from b. With weights w of a place of the hull, sum w |x - k|^2 <= (|x - b| + c)^2 + d^2 for all places x, so one k is no farther from x than that. So S without all such b, as long as their k stay, is K with d(x, K)^2 <= (d(x, S) + c)^2 + d^2.
//!
//! *Among*: let k be no farther from b than s. What is t from b along a unit vector u is no farther from k than max(|k - b|, s) for all t <= s, if u . (k - b) >= |k - b|^2 / 2 s, as the distance is convex in t. So where these k leave out no direction u, the disc of radius s around b is in the union
//! of the same around them, and so are all wider ones, for which there is more room. Without b all unions of discs from that radius on are the same, and they stay so when a k goes, for which the same holds of others that are still there.
//! A place over which S is closer than s has K closer than s, and elsewhere both are as far. So a place x of space, z above the plane, has d(x, K)^2 <= max(d(x, S)^2, z^2 + s^2).
//!
//! With d(x, S)^2 <= (d(x, A) + i)^2 + R^2, as `SiteError` has it, and z <= d(x, A): where that, with d^2 more, and d(x, A)^2 + s^2 are both no more at a distance of r - e than sites may be off, so is what comes of all.

use super::super::figure::{Figure, Outline};
use super::Place;
use super::wires::{cross, dot, length, minus};
use crate::attractor::cell::Point;
use crate::budget::{Budget, Stopped};
use crate::dilation::surface::NameMap;
use std::f64::consts::TAU;

/// How much narrower arcs are taken than they are, in radians: far above what rounding makes of them.
const ROUNDED: f64 = 1e-9;
/// Shares of s, one after the other: of few it takes less to find who is among whom, and what changes no union from one radius on changes none from a larger one on.
const AMONG: [f64; 3] = [1.0 / 16.0, 0.25, 1.0];
/// Arcs that are looked at to tell who is among whom, at most.
const MOST_ARCS: usize = 30_000_000;
/// Points between which it is asked whether to stop.
const STEPS: usize = 256;

/// How points are thinned, see above: lengths.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Thinning {
    /// The coordinate that all have in common, and but for what it is so.
    pub(in super::super) axis: usize,
    pub(in super::super) flat: f64,
    /// c: those that are this close are one, and others this close to a hull are in it.
    pub(in super::super) close: f64,
    /// d.
    pub(in super::super) between: f64,
    /// s.
    pub(in super::super) among: f64,
}

/// Fewer points.
pub(in super::super) struct Thinned {
    pub(in super::super) figures: Vec<Figure>,
    /// How far places are moved.
    pub(in super::super) moved: f64,
}

impl Thinning {
    /// What is left of points. None where there are others than points, they have no coordinate in common, or very many are near to each other.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(in super::super) fn of(self, figures: &[Figure], budget: &Budget) -> Result<Option<Thinned>, Stopped> {
        let Some(points) = figures.iter().map(Figure::point).collect::<Option<Vec<Point>>>() else { return Ok(None) };
        let axis = self.axis;
        let [low, high] = points.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| [low.min(at[axis]), high.max(at[axis])]);
        if points.is_empty() || high - low > self.flat {
            return Ok(None);
        }
        let axes = [(axis + 1) % 3, (axis + 2) % 3];
        let apart = apart(points.iter().map(|point| axes.map(|axis| point[axis])), self.close);
        let outer = without_those_between(apart, self.between, self.close, budget)?;
        let Some(outer) = without_those_among(outer, self.among, budget)? else { return Ok(None) };
        let figure = |place: Place| {
            let mut at = [0.5 * (low + high); 3];
            (at[axes[0]], at[axes[1]]) = (place[0], place[1]);
            Figure { outline: Outline::Point(at), deficit: 0.0 }
        };
        Ok(Some(Thinned { figures: outer.into_iter().map(figure).collect(), moved: 2.0 * self.close + (high - low) }))
    }
}

/// Places by the squares of a grid, as wide as what is near.
struct Grid {
    near: f64,
    squares: NameMap<[i64; 2], Vec<u32>>,
}

impl Grid {
    fn new(near: f64) -> Self {
        Self { near, squares: NameMap::default() }
    }

    fn of(places: &[Place], near: f64) -> Self {
        let mut grid = Self::new(near);
        places.iter().enumerate().for_each(|(index, &place)| grid.add(index, place));
        grid
    }

    fn square(&self, place: Place) -> [i64; 2] {
        place.map(|x| (x / self.near).floor() as i64)
    }

    fn add(&mut self, index: usize, place: Place) {
        self.squares.entry(self.square(place)).or_default().push(index as u32);
    }

    fn remove(&mut self, index: usize, place: Place) {
        if let Some(own) = self.squares.get_mut(&self.square(place)) {
            own.retain(|&other| other as usize != index);
        }
    }

    /// All others that are near to a place, and the ways there.
    fn around<'a>(&'a self, index: usize, places: &'a [Place]) -> impl Iterator<Item = (usize, Place)> + 'a {
        let own = places[index];
        let [x, y] = self.square(own);
        let squares = (0..9).filter_map(move |square| self.squares.get(&[x + square % 3 - 1, y + square / 3 - 1]));
        let ways = squares.flatten().map(move |&other| (other as usize, minus(places[other as usize], own)));
        ways.filter(move |&(other, way)| other != index && dot(way, way) <= self.near * self.near)
    }
}

/// The first of all places that are within a distance of each other.
fn apart(places: impl Iterator<Item = Place>, close: f64) -> Vec<Place> {
    let (mut grid, mut kept) = (Grid::new(close), Vec::new());
    for place in places {
        kept.push(place);
        let index = kept.len() - 1;
        if grid.around(index, &kept).next().is_some() {
            kept.pop();
        } else {
            grid.add(index, place);
        }
    }
    kept
}

/// Those that are still there.
fn left(places: Vec<Place>, is_left: &[bool]) -> Vec<Place> {
    places.into_iter().zip(is_left).filter(|&(_, &is_left)| is_left).map(|(place, _)| place).collect()
}

/// Places without those that are between others, within `close` of their hull.
fn without_those_between(places: Vec<Place>, distance: f64, close: f64, budget: &Budget) -> Result<Vec<Place>, Stopped> {
    let near = distance - close;
    if near <= close {
        return Ok(places);
    }
    // Of those that stay it is asked first.
    let (mut all, mut staying) = (Grid::of(&places, near), Grid::new(near));
    let (mut stays, mut is_left) = (vec![false; places.len()], vec![true; places.len()]);
    let mut ways: Vec<(usize, Place)> = Vec::new();
    for index in 0..places.len() {
        if index.is_multiple_of(STEPS) {
            budget.cancel.check()?;
        }
        if stays[index] {
            continue;
        }
        let mut hull = None;
        for grid in [&staying, &all] {
            ways.clear();
            ways.extend(grid.around(index, &places));
            hull = around_origin(&ways, close);
            if hull.is_some() {
                break;
            }
        }
        is_left[index] = hull.is_none();
        if hull.is_some() {
            all.remove(index, places[index]);
        }
        for stay in hull.into_iter().flatten().chain(hull.is_none().then_some(index)) {
            if !std::mem::replace(&mut stays[stay], true) {
                staying.add(stay, places[stay]);
            }
        }
    }
    Ok(left(places, &is_left))
}

/// Some of the ends of ways, two of which may be one, within a distance of whose hull is where the ways begin.
fn around_origin(ways: &[(usize, Place)], distance: f64) -> Option<[usize; 3]> {
    let &(first, along) = ways.iter().max_by(|a, b| dot(a.1, a.1).total_cmp(&dot(b.1, b.1)))?;
    // Ahead of the way back on either side, by the tangent of the angle from straight across.
    let mut sides: [Option<(f64, usize, Place)>; 2] = [None; 2];
    let mut back: Option<(f64, usize)> = None;
    for &(index, way) in ways {
        let (up, side) = (dot(along, way), cross(along, way));
        if up <= 0.0 && side.abs() <= distance * length(minus(way, along)) {
            let far = dot(way, way);
            if back.is_none_or(|(least, _)| far > least) {
                back = Some((far, index));
            }
        }
        let slope = -up / side.abs();
        let own = &mut sides[usize::from(side < 0.0)];
        if side != 0.0 && own.is_none_or(|(least, ..)| slope > least) {
            *own = Some((slope, index, way));
        }
    }
    if let Some((_, back)) = back {
        return Some([first, back, back]);
    }
    let [Some((_, one, left)), Some((_, other, right))] = sides else { return None };
    (cross(left, right) >= 0.0).then_some([first, one, other])
}

/// Places without those that are among others from a radius on, in steps; none where very many are near to each other.
fn without_those_among(mut places: Vec<Place>, radius: f64, budget: &Budget) -> Result<Option<Vec<Place>>, Stopped> {
    for share in AMONG {
        let Some(left) = without_those_among_at(places, share * radius, budget)? else { return Ok(None) };
        places = left;
    }
    Ok(Some(places))
}

/// The same in one step.
fn without_those_among_at(places: Vec<Place>, radius: f64, budget: &Budget) -> Result<Option<Vec<Place>>, Stopped> {
    let mut grid = Grid::of(&places, radius);
    let mut is_left = vec![true; places.len()];
    let (mut arcs, mut looked) = (Vec::<[f64; 2]>::new(), 0);
    for (index, &place) in places.iter().enumerate() {
        if index.is_multiple_of(STEPS) {
            budget.cancel.check()?;
        }
        let arc = |(_, way): (usize, Place)| {
            let half = (0.5 * length(way) / radius).acos() - ROUNDED;
            let begin = (way[1].atan2(way[0]) - half).rem_euclid(TAU);
            [begin, begin + 2.0 * half]
        };
        arcs.clear();
        arcs.extend(grid.around(index, &places).map(arc));
        looked += arcs.len();
        if looked > MOST_ARCS {
            return Ok(None);
        }
        is_left[index] = !are_all_around(&mut arcs);
        if !is_left[index] {
            grid.remove(index, place);
        }
    }
    Ok(Some(left(places, &is_left)))
}

/// Whether arcs from one angle to another leave out none.
fn are_all_around(arcs: &mut [[f64; 2]]) -> bool {
    arcs.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let Some(&[first, _]) = arcs.first() else { return false };
    // Those that go around the end of the first turn are there at its beginning, too.
    let mut reached = arcs.iter().map(|arc| arc[1] - TAU).fold(arcs[0][1], f64::max);
    for turn in [0.0, TAU] {
        for [begin, end] in arcs.iter().map(|arc| arc.map(|angle| angle + turn)) {
            if reached >= first + TAU {
                return true;
            }
            if begin > reached {
                return false;
            }
            reached = reached.max(end);
        }
    }
    reached >= first + TAU
}

#[cfg(test)]
mod tests {
    use super::super::super::figure::Figure;
    use super::*;
    use crate::attractor::cell::distance_squared;
    use crate::split_mix::Random;

    /// Points of several kinds, some 10 mm wide.
    fn points(kind: usize, random: &mut Random) -> Vec<Place> {
        let share = |random: &mut Random| 10.0 * random.share();
        match kind {
            0 => (0..1_500).map(|_| [share(random), share(random)]).collect(),
            // A lattice, with places that are there twice.
            1 => (0..1_600).map(|k| [0.25 * f64::from(k % 40), 0.25 * f64::from(k / 40)]).chain([[1.0, 1.0], [1.0, 1.0 + 1e-13]]).collect(),
            // A straight line, and another.
            2 => (0..800)
                .map(|_| (random.share(), random.share() < 0.5))
                .map(|(t, a)| if a { [10.0 * t, 3.0] } else { [2.0 + t, 9.0 * t] })
                .collect(),
            // A circle.
            3 => (0..900).map(|_| (TAU * random.share()).sin_cos()).map(|(y, x)| [5.0 + 4.0 * x, 5.0 + 4.0 * y]).collect(),
            // Heaps of different density.
            _ => (0..1_500)
                .map(|k| {
                    let heap = f64::from(k % 7);
                    let wide = 0.03 * (1.0 + heap) * heap;
                    [heap * 1.3 + wide * random.share(), (heap * 3.7) % 9.0 + wide * random.share()]
                })
                .collect(),
        }
    }

    /// What is left is among what was there, and no place is farther from it than is told.
    #[test]
    fn distances_grow_by_no_more_than_told() {
        let mut random = Random(7);
        for round in 0..30 {
            let places = points(round % 5, &mut random);
            let height = [0.0, -3.7][round % 2];
            let figures: Vec<Figure> =
                places.iter().map(|&[x, y]| Figure { outline: Outline::Point([height, x, y]), deficit: 0.0 }).collect();
            let thinning = Thinning {
                axis: 0,
                flat: 1e-9,
                close: [1e-9, 0.01][round / 2 % 2],
                between: [0.0, 0.3, 0.8][round / 4 % 3],
                among: [0.2, 0.7][round / 3 % 2],
            };
            let Thinned { figures: left, moved } = thinning.of(&figures, &Budget::default()).unwrap().unwrap();
            let all = |figures: &[Figure]| -> Vec<Point> { figures.iter().flat_map(Figure::corners).copied().collect() };
            let (before, after) = (all(&figures), all(&left));
            assert!(!after.is_empty() && after.iter().all(|at| before.contains(at)), "{round}");
            let square = |points: &[Point], x: &Point| points.iter().map(|at| distance_squared(at, x)).fold(f64::INFINITY, f64::min);
            let mut used = false;
            for _ in 0..1_500 {
                let x = [height + 2.0 * random.share(), 12.0 * random.share() - 1.0, 12.0 * random.share() - 1.0];
                let (own, now) = (square(&before, &x), square(&after, &x));
                let between = (own.sqrt() + moved).powi(2) + thinning.between.powi(2);
                let most = between.max((x[0] - height).powi(2) + thinning.among.powi(2));
                assert!(now <= most * (1.0 + 1e-12), "{round}: {now} where there was {own}, {most} at most");
                used |= now > own;
            }
            // Where there is something between or among others, and farther ones are left.
            assert!(used || after.len() > before.len() / 2, "{round}");
        }
    }

    /// Of a lattice hardly more than its rim and places as far apart as is told; of a line few; of a circle, whose points are extreme, all but those that are close.
    #[test]
    fn as_many_are_left_as_it_takes() {
        let mut random = Random(11);
        let left = |kind: usize, between: f64, among: f64, random: &mut Random| {
            let places = points(kind, random);
            let between = without_those_between(apart(places.into_iter(), 1e-9), between, 1e-6, &Budget::default()).unwrap();
            without_those_among(between, among, &Budget::default()).unwrap().unwrap().len()
        };
        assert!(left(1, 0.0, 0.6, &mut random) < 700);
        assert!(left(1, 2.0, 2.0, &mut random) < 120);
        assert!(left(2, 1.0, 1e-3, &mut random) < 120);
        assert_eq!(left(3, 1e-3, 1e-3, &mut random), 900);
    }

    #[test]
    fn others_than_points_in_a_plane_are_left_alone() {
        let thinning = Thinning { axis: 2, flat: 1e-9, close: 1e-9, between: 0.1, among: 0.1 };
        let figure = |outline: Outline, deficit: f64| Figure { outline, deficit };
        let at = |x: f64, z: f64| Outline::Point([x, 2.0 * x * x, z]);
        let of = |figures: &[Figure]| thinning.of(figures, &Budget::default()).unwrap().map(|thinned| thinned.figures.len());
        assert_eq!(of(&[figure(at(0.0, 1.0), 0.0), figure(at(1.0, 1.0), 0.0), figure(at(2.0, 1.0), 0.0)]), Some(3));
        assert_eq!(of(&[figure(at(0.0, 1.0), 0.0), figure(at(1.0, 1.0), 0.0), figure(at(2.0, 1.1), 0.0)]), None);
        assert_eq!(of(&[figure(at(0.0, 1.0), 0.0), figure(at(1.0, 1.0), 0.1)]), None);
        assert_eq!(of(&[figure(Outline::Segment([[0.0; 3], [1.0, 0.0, 0.0]]), 0.0)]), None);
    }
}
