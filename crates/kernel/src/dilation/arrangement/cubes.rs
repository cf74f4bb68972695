//! Cubes of space, as small as it takes, in which it is told what bodies do: see `nerve`.
//!
//! That is up to the bodies that reach a cube. Of most cubes one body holds it all, or a place, a *hub*, is inside of all bodies: both settle a cube as a whole, with all sets of bodies there.
//! Rounding may leave a crack between cubes; it is narrower than the slack that is asked to spare wherever something is told of a cube, so that places in it are told of, too.

use super::bodies::{AXES, Bodies, Common, Hub, Kind, Near, STEADY_CUBE};
use super::ellipsoid::Place;
use super::figure::{Figure, box_of};
use super::hidden::Hidden;
use crate::attractor::cell::{Point, between, dot, subtract};
use crate::budget::{Budget, Stopped};
use crate::dilation::surface::NameMap;
use crate::solid::Inside;
use glam::DVec3;
use rayon::prelude::*;

/// Bodies of a set at most.
pub(super) const MOST_BODIES: usize = 4;
/// So many bodies are few: all sets of them are looked at, however wide the cube is.
const FEW: usize = 8;
/// In the smallest cubes, of more bodies no set is asked for if their dilations have a common place.
const SOME: usize = 16;
/// Of more bodies one hub for all is not sought but in the smallest cubes. In cubes as wide as this, in units of the radius, that many are few: they are long, and stay beside each other.
const MANY: usize = 64;
const WIDE: f64 = 32.0;
/// Of one part: cubes that are looked at before those that are left are halved no more, and sets that are asked for at most.
const CUBES_OF_A_PART: usize = 50_000;
const ASKED_OF_A_PART: usize = 200_000;
/// Sets in doubt of one part that are enough to change polytopes by, which may settle many more: where dozens of bodies hardly have a common point, or hardly none, there are tens of thousands.
const DOUBTS_OF_A_PART: usize = 64;
/// Means of bodies that are tried to show that they are apart.
const MEANS: u32 = 6;
/// Rounded up.
const ROOT_OF_3: f64 = 1.732_050_808;
/// Space is parted until no more than [`MANY`] bodies reach a part, or it is no wider than this in units of the radius.
const PART: f64 = 4.0;

/// A cube along the axes of coordinates.
#[derive(Clone, Copy, Debug)]
pub(in crate::dilation) struct Cube {
    pub(in crate::dilation) centre: Point,
    /// Half of its side.
    pub(in crate::dilation) half: f64,
}

impl Cube {
    /// Around all dilations of figures by a distance.
    fn around(bodies: &Bodies<'_>, distance: f64) -> Self {
        let [low, high] = box_of(bodies.figures.iter().flat_map(Figure::corners));
        let side = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
        Self { centre: between(&low, &high, 0.5), half: 0.5 * side + distance }
    }

    /// One of eight.
    pub(in crate::dilation) fn part(&self, number: usize) -> Self {
        let half = 0.5 * self.half;
        Self { centre: self.at(number, half), half }
    }

    /// One of eight places that are as far from its centre along all axes.
    fn at(&self, number: usize, half: f64) -> Point {
        std::array::from_fn(|axis| self.centre[axis] + if number >> axis & 1 == 1 { half } else { -half })
    }

    /// Its lowest and its highest corner.
    pub(super) fn ends(&self) -> [Point; 2] {
        [self.at(0, self.half), self.at(7, self.half)]
    }

    /// Its eight corners.
    pub(super) fn corners(&self) -> impl Iterator<Item = Point> {
        (0..8).map(|number| self.at(number, self.half))
    }

    /// How far its corners are from its centre.
    pub(in crate::dilation) fn half_diagonal(&self) -> f64 {
        ROOT_OF_3 * self.half
    }

    /// How far its places are from its centre along a direction at most: the half times the sum of the direction's parts.
    pub(in crate::dilation) fn half_along(&self, direction: &Point) -> f64 {
        self.half * direction.iter().map(|part| part.abs()).sum::<f64>()
    }
}

/// A set of two to [`MOST_BODIES`] sites, by their numbers, as a number: that of a set with more sites is larger.
pub(super) type Set = u128;

/// The name of a set in ascending order.
pub(super) fn name(sites: &[u32]) -> Set {
    sites.iter().fold(0, |name, &site| name << 32 | (Set::from(site) + 1))
}

/// The sites of a set.
pub(super) fn sites(set: Set) -> impl Iterator<Item = u32> {
    (0..MOST_BODIES).rev().map(move |place| (set >> (32 * place)) as u32).filter(|&site| site > 0).map(|site| site - 1)
}

/// A cube, and the bodies that reach it, in ascending order.
pub(super) type Listed = (Cube, Box<[u32]>);

/// What bodies are taken for.
#[derive(Debug)]
pub(super) struct Stage {
    /// What is inside of all of these is inside of a body all the time.
    pub(super) inside: &'static [Kind],
    /// At any time a body is within one of these.
    pub(super) outside: &'static [Kind],
    /// Cubes that are halved no more, however many bodies reach them, in units of the radius.
    small: f64,
    /// Whether what is not settled is in doubt.
    is_last: bool,
}

/// Whatever their polytopes are like.
pub(super) const ANY: Stage = Stage { inside: &[Kind::Inner], outside: &[Kind::Outer], small: 0.2, is_last: false };
/// Dilations that become the polytopes as they are.
pub(super) const PRESENT: Stage =
    Stage { inside: &[Kind::Dilation, Kind::Polytope], outside: &[Kind::Dilation, Kind::Polytope], small: 0.05, is_last: true };

/// Parts of space with all places that more than one body reaches; none where these are more than `most`.
///
/// # Errors
/// [`Stopped`].
pub(super) fn parts(bodies: &Bodies<'_>, most: usize, budget: &Budget) -> Result<Option<Vec<Listed>>, Stopped> {
    let setting = bodies.setting;
    let mut halved = vec![(Cube::around(bodies, setting.outer + setting.slack), (0..bodies.polytopes.count()).collect())];
    let mut parts = Vec::new();
    while !halved.is_empty() {
        let halve = |(cube, list): &Listed| {
            let reaches = |part: &Cube, body: u32| bodies.reaches(ANY.outside, body, part, &bodies.near(body, &part.centre));
            let part = |number: usize| {
                let part = cube.part(number);
                (part, list.iter().copied().filter(|&body| reaches(&part, body)).collect())
            };
            (0..8).map(part).collect::<Vec<Listed>>()
        };
        budget.cancel.check()?;
        let next: Vec<Vec<Listed>> = halved.par_iter().map(halve).collect();
        let all = next.into_iter().flatten().filter(|(_, list)| list.len() > 1);
        let small: Vec<Listed>;
        (small, halved) = all.partition(|(cube, list)| list.len() <= MANY || cube.half <= PART * setting.reach);
        parts.extend(small);
        if parts.len() + halved.len() > most {
            return Ok(None);
        }
    }
    Ok(Some(parts))
}

/// What is known of a set, wherever it is.
#[derive(Clone, Copy, Debug)]
enum Known {
    /// All are around a place.
    Meet(Point),
    /// No such place was found; whether the dilations have a common point, and the part of space in which the set was left in doubt last, if it was.
    Doubtful { common: Common, left_in: Option<u32> },
}

/// A search in a part of space.
pub(super) struct Search<'a> {
    bodies: &'a Bodies<'a>,
    stage: &'static Stage,
    /// If given, only sets with one of these bodies may do something: all others are settled.
    pub(super) due: Option<&'a [bool]>,
    known: NameMap<Set, Known>,
    /// Those that reach the cubes from the part to the one that is looked at, cube after cube, and where its centre is from them.
    listed: Vec<u32>,
    near: Vec<Near>,
    /// Of the bodies of a cube how deep its centre is in them, and linear functions below each of what they are within.
    depths: Vec<f64>,
    above: Vec<(f64, Point)>,
    /// Of every body of a cube the hubs in it, bit by bit, and how many hubs there are.
    hubs: Vec<u64>,
    count: u32,
    /// Two bodies whose dilations have no common point: they have no hub, nor have any with both in smaller cubes.
    apart: Option<[u32; 2]>,
    /// The number of the part, and the cubes that were looked at in it.
    part: u32,
    cubes: usize,
    found: Found,
}

/// What a search found in a part of space.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// The cubes that are not settled whatever the polytopes are like.
    pub(super) open: Vec<Listed>,
    /// The sets in doubt, as the polytopes are, and whether their dilations have a common point.
    pub(super) doubts: Vec<(Set, Common)>,
    /// Sets that were asked for, or as many as could have been while it was asked whether they are hidden.
    pub(super) asked: usize,
    /// Whether more may be in doubt than is told.
    has_more: bool,
    /// Whether there was too much to look at, and this is not all.
    pub(super) is_cut_short: bool,
}

impl Found {
    /// Whether nothing more is looked at.
    fn is_over(&self) -> bool {
        self.has_more || self.is_cut_short
    }
}

/// What came of a set in a cube.
enum Of {
    Meet,
    /// They do nothing there, and no set that holds them does.
    Apart,
    /// As of [`Known::Doubtful`].
    Doubtful {
        common: Common,
        left_in: Option<u32>,
    },
}

impl<'a> Search<'a> {
    pub(super) fn new(bodies: &'a Bodies<'a>, stage: &'static Stage) -> Self {
        let (known, listed, near, hubs) = (NameMap::default(), Vec::new(), Vec::new(), Vec::new());
        let (depths, above) = (Vec::new(), Vec::new());
        Self {
            bodies,
            stage,
            due: None,
            known,
            listed,
            near,
            depths,
            above,
            hubs,
            count: 0,
            apart: None,
            part: 0,
            cubes: 0,
            found: Found::default(),
        }
    }

    /// Looks at a part of space.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn run(&mut self, (cube, list): &Listed, budget: &Budget) -> Result<Found, Stopped> {
        self.part += 1;
        self.cubes = 0;
        self.listed.clear();
        self.listed.extend_from_slice(list);
        // Of the list as a whole no place is asked for.
        self.near.clear();
        self.near.resize(list.len(), Near::default());
        self.look(cube, 0, &cube.centre, budget)?;
        let mut found = std::mem::take(&mut self.found);
        found.doubts.sort_unstable_by_key(|&(set, _)| set);
        found.doubts.dedup_by_key(|&mut (set, _)| set);
        Ok(found)
    }

    /// Looks at a cube within one that the bodies reach whose list begins at a place, and whose centre is `around`.
    fn look(&mut self, cube: &Cube, from: usize, around: &Point, budget: &Budget) -> Result<(), Stopped> {
        budget.cancel.check()?;
        let (bodies, to) = (self.bodies, self.listed.len());
        self.cubes += 1;
        for place in from..to {
            let body = self.listed[place];
            if !bodies.may_reach(body, cube, around, &self.near[place]) {
                continue;
            }
            let near = bodies.near(body, &cube.centre);
            if bodies.reaches(self.stage.outside, body, cube, &near) {
                self.listed.push(body);
                self.near.push(near);
            }
        }
        let known = self.apart;
        if !self.is_settled(cube, to) {
            let apart = self.apart;
            for number in 0..8 {
                self.apart = apart;
                self.look(&cube.part(number), to, &cube.centre, budget)?;
            }
        }
        self.apart = known;
        self.listed.truncate(to);
        self.near.truncate(to);
        Ok(())
    }

    /// Whether nothing more is to be told of a cube: nothing happens there, or what does was found.
    fn is_settled(&mut self, cube: &Cube, from: usize) -> bool {
        let (bodies, inside, reach) = (self.bodies, self.stage.inside, self.bodies.setting.reach);
        let (list, near) = (&self.listed[from..], &self.near[from..]);
        if list.len() < 2 || self.found.is_over() || !self.is_due(list.iter().copied()) {
            return true;
        }
        let is_wide = list.len() <= MANY && cube.half > WIDE * reach;
        // What is left in doubt of long bodies is parted sooner than cubes along them would tell.
        let is_small = cube.half <= reach * self.stage.small || is_wide || self.cubes > CUBES_OF_A_PART;
        if cube.half <= reach {
            if is_covered(bodies, inside, cube, list, near, &mut self.depths) {
                return true;
            }
            let (are_apart, mut is_unknown) = (self.apart.is_some_and(|apart| apart.iter().all(|body| list.contains(body))), false);
            if (list.len() <= MANY || is_small) && !are_apart {
                let sum = near.iter().fold([0.0; 3], |sum: Point, near| std::array::from_fn(|axis| sum[axis] + near.way[axis]));
                let middle = subtract(&cube.centre, &sum.map(|part| part / list.len() as f64));
                match bodies.hub(inside, list, middle) {
                    Hub::At(_) => return true,
                    Hub::Apart(apart) => self.apart = Some(apart),
                    Hub::Unknown => is_unknown = true,
                }
            }
            if is_in_a_solid(bodies, cube) {
                return true;
            }
            if is_unknown && is_small && self.stage.is_last && list.len() > SOME {
                let place = |kinds: &[Kind]| bodies.common(kinds, list, bodies.within(list), -bodies.setting.slack);
                if matches!(place(inside), Place::At(_)) {
                    return true;
                }
                if let Place::At(x) = place(&inside[..1]) {
                    self.leave_short(from, &x);
                    return true;
                }
            }
        }
        let is_few = list.len() <= FEW || is_wide;
        if !is_few && !is_small {
            return false;
        }
        measure(bodies, self.stage.outside, cube, list, near, &mut self.above);
        let list: Box<[u32]> = list.into();
        if self.are_settled(cube, &list, is_small) {
            return true;
        }
        if !self.stage.is_last {
            self.found.open.push((*cube, list));
            return true;
        }
        false
    }

    /// Leaves the bodies of a cube's list in doubt, which begins at a place, whose polytopes do not hold a place that all of their dilations hold: once they are around these, it is a hub. Of dozens of bodies there are far too many sets to ask for.
    fn leave_short(&mut self, from: usize, x: &Point) {
        let list = &self.listed[from..];
        let is_short = |&body: &u32| !self.bodies.is_inside(&[Kind::Polytope], body, x);
        let (mut short, mut others): (Vec<u32>, Vec<u32>) = list.iter().copied().partition(is_short);
        if short.len() == 1 {
            short.extend(others.pop());
            short.sort_unstable();
        }
        let mut left = &short[..];
        while !left.is_empty() {
            // None is left alone.
            let count = if left.len() == MOST_BODIES + 1 { MOST_BODIES - 1 } else { MOST_BODIES.min(left.len()) };
            let (set, others) = left.split_at(count);
            self.found.doubts.push((name(set), Common::Some));
            left = others;
        }
    }

    /// Whether all sets of some bodies do nothing in a cube; where that is told no better in smaller ones, those that do are in doubt.
    fn are_settled(&mut self, cube: &Cube, list: &[u32], is_small: bool) -> bool {
        let number = list.len();
        self.count = 0;
        self.hubs.clear();
        self.hubs.resize(number, 0);
        let mut meet = vec![false; number * number];
        for second in 0..number {
            for first in 0..second {
                if self.found.is_over() {
                    return true;
                }
                let Some(own) = self.may_meet(cube, list, &[first, second], is_small) else { return false };
                meet[first * number + second] = own;
            }
            if self.is_one_in_all() {
                return true;
            }
        }
        for third in 0..number {
            for second in (0..third).filter(|&second| meet[second * number + third]) {
                for first in (0..second).filter(|&first| meet[first * number + second] && meet[first * number + third]) {
                    if self.found.is_over() {
                        return true;
                    }
                    match self.may_meet(cube, list, &[first, second, third], is_small) {
                        None => return false,
                        Some(false) => continue,
                        Some(true) => {}
                    }
                    let own = self.hubs[first] & self.hubs[second] & self.hubs[third];
                    if self.hubs[third + 1..].iter().fold(own, |own, hubs| own & hubs) != 0 {
                        continue;
                    }
                    let is_near = |&fourth: &usize| [first, second, third].iter().all(|&place| meet[place * number + fourth]);
                    for fourth in (third + 1..number).filter(is_near) {
                        let set = [first, second, third, fourth];
                        // Nothing is up to what four do that are not due: no larger set is asked for.
                        if !self.is_due(set.into_iter().map(|place| list[place])) {
                            continue;
                        }
                        if self.may_meet(cube, list, &set, is_small).is_none() {
                            return false;
                        }
                    }
                }
            }
        }
        true
    }

    /// Whether some of the bodies of a cube, by their places in its list, may have a common place there that is not hidden; none where smaller cubes may tell that they do nothing.
    fn may_meet(&mut self, cube: &Cube, list: &[u32], places: &[usize], is_small: bool) -> Option<bool> {
        if !self.is_due(places.iter().map(|&place| list[place])) {
            return Some(!self.are_parted(cube, places));
        }
        let (common, left_in) = match self.of(cube, list, places) {
            Of::Meet => return Some(true),
            Of::Apart => return Some(false),
            Of::Doubtful { .. } if !self.stage.is_last => return None,
            Of::Doubtful { common, left_in } => (common, left_in),
        };
        let set: Vec<u32> = places.iter().map(|&place| list[place]).collect();
        // What is left in doubt anywhere is told anew when its polytopes are other ones, which they have to be: along faces that hardly meet smaller cubes would be many.
        if left_in.is_none() {
            // There may be others that hide them, or they may do nothing but elsewhere. Solids hide what is flat, and where cubes would be many.
            let may_be_settled = !is_small && list.len() > places.len();
            if may_be_settled && self.bodies.solids.is_empty() {
                return None;
            }
            let hidden = self.bodies.hidden(&set, common, cube, list, &mut self.found.asked);
            self.found.is_cut_short |= self.found.asked > ASKED_OF_A_PART;
            match hidden {
                Hidden::All => return Some(false),
                Hidden::Unknown if may_be_settled => return None,
                Hidden::Unknown | Hidden::NotAll => {}
            }
        }
        if left_in != Some(self.part) {
            let name = name(&set);
            self.known.insert(name, Known::Doubtful { common, left_in: Some(self.part) });
            self.found.doubts.push((name, common));
            self.found.has_more |= self.found.doubts.len() >= DOUBTS_OF_A_PART;
        }
        Some(common != Common::None)
    }

    /// What some of the bodies of a cube do there.
    fn of(&mut self, cube: &Cube, list: &[u32], places: &[usize]) -> Of {
        if places.iter().fold(u64::MAX, |common, &place| common & self.hubs[place]) != 0 || self.found.is_over() {
            return Of::Meet;
        }
        if self.are_parted(cube, places) {
            return Of::Apart;
        }
        let (bodies, stage) = (self.bodies, self.stage);
        let mut set = [0; MOST_BODIES];
        set.iter_mut().zip(places).for_each(|(slot, &place)| *slot = list[place]);
        let set = &set[..places.len()];
        self.found.asked += 1;
        self.found.is_cut_short = self.found.asked > ASKED_OF_A_PART;
        let (name, slack) = (name(set), bodies.setting.slack);
        let mut known = self.known.get(&name).copied();
        if !matches!(known, Some(Known::Meet(_))) {
            let within = overlap(cube.ends(), bodies.within(set));
            if stage.outside.iter().all(|&kind| bodies.common(&[kind], set, within, slack) == Place::Nowhere) {
                return Of::Apart;
            }
        }
        match *known.get_or_insert_with(|| *self.known.entry(name).or_insert_with(|| stage.known(bodies, set, &cube.centre))) {
            Known::Meet(x) => {
                self.add_hub(list, &x);
                Of::Meet
            }
            Known::Doubtful { common, left_in } => Of::Doubtful { common, left_in },
        }
    }

    /// Whether one of some bodies may make a difference to what is settled.
    fn is_due(&self, mut some: impl Iterator<Item = u32>) -> bool {
        self.due.is_none_or(|due| some.any(|body| due[body as usize]))
    }

    /// Whether some of the bodies of a cube surely have no common place there, whatever is taken for them.
    pub(super) fn are_parted(&self, cube: &Cube, places: &[usize]) -> bool {
        let is_steady = cube.half <= STEADY_CUBE * self.bodies.setting.reach;
        is_steady && (0..self.stage.outside.len()).all(|kind| self.is_mean_above(cube, places, kind))
    }

    /// Looks at some bodies from a cube's centre, for [`Search::are_parted`].
    #[cfg(test)]
    pub(super) fn see(&mut self, cube: &Cube, list: &[u32], near: &[Near]) {
        measure(self.bodies, self.stage.outside, cube, list, near, &mut self.above);
    }

    /// The linear function below one of what a body of the cube's list is within.
    fn above_of(&self, place: usize, kind: usize) -> &(f64, Point) {
        &self.above[place * self.stage.outside.len() + kind]
    }

    /// Whether some of the bodies surely have no common place in the cube: where a mean of linear functions below them is above 0 all over it, so is the highest of them, everywhere. Weights that show it are
    /// sought by steps to the function that is highest where the mean is lowest (Frank and Wolfe, "An algorithm for quadratic programming", 1956).
    fn is_mean_above(&self, cube: &Cube, places: &[usize], kind: usize) -> bool {
        let mut weights = [0.0; MOST_BODIES];
        weights[..places.len()].fill(1.0 / places.len() as f64);
        for step in 0..MEANS {
            let (mut mean, mut slope) = (0.0, [0.0; 3]);
            for (&place, weight) in places.iter().zip(&weights) {
                let (above, away) = self.above_of(place, kind);
                mean += weight * above;
                slope = std::array::from_fn(|axis| slope[axis] + weight * away[axis]);
            }
            if mean - cube.half_along(&slope) > 4.0 * self.bodies.setting.slack {
                return true;
            }
            let lowest: Point = slope.map(|part| if part > 0.0 { -cube.half } else { cube.half });
            let heights = places.iter().map(|&place| self.above_of(place, kind)).map(|(above, away)| above + dot(away, &lowest));
            let highest = heights.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((highest, _)) = highest.filter(|&(_, height)| height > 0.0) else { return false };
            let share = 1.0 / f64::from(step + 2);
            weights.iter_mut().for_each(|weight| *weight *= 1.0 - share);
            weights[highest] += share;
        }
        false
    }

    /// Whether one hub is in all bodies of the list.
    fn is_one_in_all(&self) -> bool {
        self.hubs.iter().fold(u64::MAX, |common, hubs| common & hubs) != 0
    }

    /// Adds a hub, if there is room for one.
    fn add_hub(&mut self, list: &[u32], x: &Point) {
        if self.count < u64::BITS {
            for (&body, hubs) in list.iter().zip(&mut self.hubs) {
                *hubs |= u64::from(self.bodies.is_inside(self.stage.inside, body, x)) << self.count;
            }
            self.count += 1;
        }
    }
}

impl Stage {
    /// What is known of a set, of which all are near to a place, wherever it is.
    fn known(&self, bodies: &Bodies<'_>, set: &[u32], near: &Point) -> Known {
        let doubtful = |common: Common| Known::Doubtful { common, left_in: None };
        match bodies.hub(self.inside, set, *near) {
            Hub::At(x) => return Known::Meet(x),
            // Of the last stage the first kind is the dilation by the radius.
            Hub::Apart(_) => return doubtful(if self.is_last { Common::None } else { Common::Unknown }),
            Hub::Unknown => {}
        }
        match bodies.common(self.inside, set, bodies.within(set), -bodies.setting.slack) {
            Place::At(x) => Known::Meet(x),
            _ => doubtful(if self.is_last { bodies.common_of_dilations(set) } else { Common::Unknown }),
        }
    }
}

/// Linear functions below each of some kinds of bodies, by their values at a cube's centre and their slopes, body by body.
fn measure(bodies: &Bodies<'_>, kinds: &[Kind], cube: &Cube, list: &[u32], near: &[Near], above: &mut Vec<(f64, Point)>) {
    above.clear();
    for (&body, near) in list.iter().zip(near) {
        above.extend(kinds.iter().map(|&kind| bodies.below(kind, body, cube, near)));
    }
}

/// Whether all of a cube is inside of all kinds of one of some bodies.
pub(super) fn is_covered(bodies: &Bodies<'_>, kinds: &[Kind], cube: &Cube, list: &[u32], near: &[Near], depths: &mut Vec<f64>) -> bool {
    depths.clear();
    for (&body, near) in list.iter().zip(near) {
        // What holds the cube holds the ball in it, and what holds the ball around it holds the cube. In a polyhedron the centre may be deeper than is told: then smaller cubes tell.
        let depth = bodies.depth(kinds, body, cube, near, cube.half);
        if depth > cube.half_diagonal() + bodies.setting.slack {
            return true;
        }
        depths.push(depth);
    }
    let mut may_hold = list.iter().zip(near).zip(depths).filter(|(_, depth)| **depth >= cube.half).map(|(body, _)| body);
    // What is convex and holds the corners holds all.
    may_hold.any(|(&body, near)| {
        bodies.may_hold(kinds[0], body, cube, near) && cube.corners().all(|corner| bodies.is_inside(kinds, body, &corner))
    })
}

/// Whether all of a cube is inside of a solid.
fn is_in_a_solid(bodies: &Bodies<'_>, cube: &Cube) -> bool {
    let [low, high] = cube.ends().map(DVec3::from_array);
    let is_around = |solid: &Inside<'_>| {
        solid.across(&AXES.map(DVec3::from_array), low, high).is_none() && solid.winding(DVec3::from_array(cube.centre)) > 0
    };
    bodies.solids.iter().any(is_around)
}

/// What two boxes have in common.
pub(super) fn overlap([low, high]: [Point; 2], [from, to]: [Point; 2]) -> [Point; 2] {
    [std::array::from_fn(|axis| low[axis].max(from[axis])), std::array::from_fn(|axis| high[axis].min(to[axis]))]
}
