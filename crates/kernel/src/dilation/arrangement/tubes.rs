//! Segments that are one tube: where two of one radius end, and nothing else does, their polytopes have a ring of corners in common, and what is between them is a wedge that turns one ring to the other, or nothing.
//!
//! Polytopes of neighbours cross in rings of corners that belong to neither, three to a joint for each that there should be. So the boundary is made of *cells* there, see `cells`: convex polytopes that share whole facets, and nothing else. The topology is told of other polytopes that have the same union, but common interior points.
//!
//! Let a segment end at P with the unit vector a along it, another begin there with b, u be the unit vector about which a turns to b, m the unit vector along a + b, and let x be measured from P. Let A and B be prisms around both with strips that the turn takes to each other, no nearer to the segments than the band's inner end, and no
//! corner farther from them than the outer one. The cells of both are A up to the plane x . m = 0, and B from there on: a *mitre*. Where the tube turns by more, corners of it on the outer side would be too far out: there the cells are A in x . a <= 0 and x . m <= 0, B in x . b >= 0 and x . m >= 0, and, in x . a >= 0 and x . b <= 0, a wedge. What is
//! closest to one segment, but beyond the plane x . m = 0, is no farther from P along the other one than r sin(turn), or r tan(turn / 2) from a right angle on: segments are longer than bends at both ends and their bodies take of them, so that this is closest to the other one.
//!
//! **Mitres.** The first body is A n {x . m <= c}, below the strips of B that look out of the turn; the second likewise. A strip of A, n . x <= h, is taken to one of B, n' . x = n . x + 2 sin(turn / 2) (n . v) (x . m) <= h, with v = a x u out of the turn. So where x . m <= 0, what is in A is below those strips of B with n . v > 0, and where x . m >= 0, below the others: the bodies' union is that of
//! the cells. They stand for the dilations of the segments cut by {x . m <= c} and {x . m >= -c}: if the closest point to x on both segments is P, both dilations hold it, and otherwise x is on the side of the segment that is closest.
//!
//! **Wedges.** The bodies are A n {x . a <= 0}, B n {x . b >= 0}, and what is below the strips of A and B, the facets of the wedge and in {x . a >= -c} n {x . b <= c}. They stand for the dilations of the segments and of P, cut by those planes: where the closest point is P, x is on neither segment's side. Rings have a corner on the line along u, and as strips beside
//! it are equally far from the segment, and no strip is much farther than others, all sections of A across u hold places of that line, and reach to either side of it at least 0.67 times as far as to the other, which is the cosine of the largest turn: so what is turned about the line stays in A, and what is beyond x . m = 0 in the first body is in B.

use super::covering::Covering;
use super::figure::{Figure, Outline};
use super::form::{Form, Kind};
use super::joints::{self, End};
use super::pieces::{self, Lists};
use super::polytopes::{ALL_SHIFT, MOST_FACETS, OWN_SHIFT, Plane, Polytope, Shell, beyond_place, frame, kind, ordered, share};
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract, unit};
use crate::dilation::convex::Convex;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

/// Angles by which tubes turn, in radians: where it is less, the axis is up to rounding, and more would take long segments.
const TURNS: [f64; 2] = [1e-6, 2.3];
/// Lengths of segments at least, and how much longer they are than what their bends take, in units of the outer radius: bodies reach up to 0.29 of it back beyond a bend, and at a mitre 0.14 more where it takes 0.27.
const LEAST_LENGTH: f64 = 0.4;
const LEAST_BETWEEN: f64 = 0.2;
/// The share of the band that a mitre may take, and that the slab of a bend's body does.
const MITRE: f64 = 0.05;
const SLAB: f64 = 0.04;
/// Seeds of tubes and of bends, which no polytope of a level has.
const SEEDS: [u64; 2] = [255, 253];

/// Bodies of other tubes that the segments of a bend may be near to.
const MOST_OTHERS: usize = 8;
/// Bends for every segment at least: fewer are not worth that doubts may cost them all.
const LEAST_BENDS: f64 = 0.125;

/// What is no farther than this along segments, in units of the radius, is near since they turn.
const SUCCESSIVE: f64 = 4.0;

/// Ends of segments, by figure and place in their order, that are in no bend.
pub(super) type Loose = BTreeSet<(u32, usize)>;

/// Where something lies along segments that follow each other.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    course: usize,
    from: f64,
    to: f64,
    /// How long all of them are, if they are a ring.
    around: f64,
    /// What is no farther on follows.
    most: f64,
}

/// Where a tube turns.
#[derive(Debug)]
pub(super) struct Bend {
    pub(super) at: Point,
    /// The segment that ends there, and the one that goes on.
    pub(super) rods: [u32; 2],
    /// The unit vectors along them.
    pub(super) ways: [Point; 2],
    /// The unit vector about which the first turns to the second, and by how much.
    axis: Point,
    pub(super) turn: f64,
    /// The number of the wedge among bodies, and into how many parts it is divided; none, and 0, of a mitre.
    pub(super) wedge: Option<u32>,
    pub(super) steps: usize,
    /// How far bodies reach beyond the cells.
    pub(super) beyond: f64,
}

/// What a segment in a tube is like.
#[derive(Debug)]
pub(super) struct Rod {
    /// What form its polytope has.
    pub(super) kind: Kind,
    /// Whether the tube goes from the second of its ends, in their order, to the first.
    pub(super) is_reversed: bool,
    /// The last vector is along it, from the first end to the second.
    pub(super) frame: [Point; 3],
    /// How far corners of its rings are from it, about, by how much others may differ, and how far its strips are.
    pub(super) reach: f64,
    pub(super) own: f64,
    pub(super) strips: Box<[f64]>,
    /// At which ends it is cut.
    pub(super) is_cut: [bool; 2],
    /// The bends where the tube comes and where it goes on.
    pub(super) bends: [Option<usize>; 2],
    /// The tube, by its first segment, and the segment's place in it.
    pub(super) tube: u32,
    pub(super) place: usize,
}

/// The tubes of an arrangement.
#[derive(Debug, Default)]
pub(super) struct Tubes {
    /// How many figures there are beside those of wedges, which come after them.
    pub(super) figures: usize,
    pub(super) bends: Vec<Bend>,
    /// The bends of wedges.
    pub(super) wedges: Vec<usize>,
    /// Of every figure.
    pub(super) rods: Vec<Option<Rod>>,
    /// What the boundary is made of, instead of the bodies with these numbers.
    pub(super) cells: Vec<(u32, Polytope)>,
    /// Of every segment that others follow.
    stretches: Vec<Option<Stretch>>,
}

/// Segments one after the other.
struct Course<'a> {
    sites: &'a [Figure],
    /// Their numbers, and at which end each is entered.
    chain: Vec<(u32, usize)>,
    /// The unit vectors along them, and the angles between these.
    ways: Vec<Point>,
    turns: Vec<f64>,
    is_ring: bool,
    shell: Shell,
    /// How far angles are off that are as they should be.
    noise: f64,
}

/// Some of them that can be a tube.
struct Part {
    range: Range<usize>,
    /// Whether the last goes on to the first.
    is_ring: bool,
    /// The direction across the first segment where strips begin.
    first: Point,
    /// Whether axes of wedges are along that direction, and across it.
    axes: [bool; 2],
}

impl Course<'_> {
    /// The segment after one.
    fn next(&self, place: usize) -> usize {
        if place + 1 < self.chain.len() { place + 1 } else { 0 }
    }

    /// Parts that can be tubes. The axes of all wedges go through corners: turned about another line, what lies beyond would not be convex.
    fn parts(&self) -> Vec<Part> {
        let count = self.chain.len();
        if self.is_ring
            && let Some(ring) = self.part(0..count, true).filter(|part| part.is_ring)
        {
            return vec![ring];
        }
        // Ends of one tube would meet where a ring is cut once.
        let half = if self.is_ring { count / 2 } else { count };
        let (mut parts, mut start) = (Vec::new(), 0);
        while let Some(part) = self.part(start..if start < half { half } else { count }, false) {
            start = part.range.end;
            parts.push(part);
        }
        parts.retain(|part| part.range.len() > 1);
        parts
    }

    /// The longest part at the beginning of some segments; none where there is none. It may be a ring, if it goes around and strips come to where they began.
    fn part(&self, Range { start, end }: Range<usize>, may_be_ring: bool) -> Option<Part> {
        if start == end {
            return None;
        }
        let first = frame(&self.ways[start]);
        let (mut turning, mut begin, mut axes) = (first, None, [false; 2]);
        let (mut place, mut is_ring) = (start, false);
        while place + 1 < end || (may_be_ring && !is_ring) {
            let (next, turn) = (self.next(place), self.turns[place]);
            let axis = unit(&cross(&self.ways[place], &self.ways[next]));
            if !self.shell.is_mitre(turn) {
                let angle = dot(&axis, &turning[1]).atan2(dot(&axis, &turning[0]));
                let off = (angle - *begin.get_or_insert(angle)) / FRAC_PI_2;
                if (off - off.round()).abs() * FRAC_PI_2 > self.noise {
                    break;
                }
                axes[(off.round() as i64).rem_euclid(2) as usize] = true;
            }
            turning = carried(&turning, &axis, turn, &self.ways[next]);
            if next == 0 {
                is_ring = dot(&turning[0], &first[1]).abs() <= self.noise && dot(&turning[0], &first[0]) > 0.0;
                break;
            }
            place = next;
        }
        let (sine, cosine) = begin.unwrap_or_default().sin_cos();
        let first = std::array::from_fn(|k| cosine * first[0][k] + sine * first[1][k]);
        Some(Part { range: start..place + 1, is_ring, first, axes })
    }
}

/// A vector that is turned about a unit vector.
fn turned(x: &Point, axis: &Point, angle: f64) -> Point {
    let (sine, cosine) = angle.sin_cos();
    let (across, along) = (cross(axis, x), (1.0 - cosine) * dot(axis, x));
    std::array::from_fn(|k| cosine * x[k] + sine * across[k] + along * axis[k])
}

/// A frame along a direction, turned to another one.
fn carried(frame: &[Point; 3], axis: &Point, angle: f64, to: &Point) -> [Point; 3] {
    let x = turned(&frame[0], axis, angle);
    let off = dot(&x, to);
    let x = unit(&std::array::from_fn(|k| x[k] - off * to[k]));
    [x, cross(to, &x), *to]
}

/// Two segments that end at a place, each with which of its ends that is, and the angle by which they turn.
#[derive(Clone, Copy)]
struct Link {
    rods: [(u32, usize); 2],
    turn: f64,
}

impl Link {
    /// How much of both segments the bend takes, in units of the radius.
    fn need(&self) -> f64 {
        if self.turn < FRAC_PI_2 { self.turn.sin() } else { (0.5 * self.turn).tan() }
    }
}

impl Shell {
    /// Whether what is farther out at a bend by an angle, where tubes end in its bisecting plane, hardly matters.
    fn is_mitre(self, turn: f64) -> bool {
        self.outer * (1.0 - (0.5 * turn).cos()) <= MITRE * (self.outer - self.inner)
    }
}

impl Bend {
    /// The planes that the wedge's body is cut by.
    pub(super) fn cuts(&self) -> [Plane; 2] {
        let [a, b] = self.ways;
        [a.map(|part| -part), b].map(|normal| beyond_place(normal, &self.at, self.beyond))
    }

    /// The plane that the body of one of the segments is cut by at a mitre.
    pub(super) fn mitre(&self, which: usize) -> Plane {
        let middle = self.middle();
        beyond_place(if which == 0 { middle } else { middle.map(|part| -part) }, &self.at, self.beyond)
    }

    /// The unit vector halfway between both ways.
    pub(super) fn middle(&self) -> Point {
        unit(&std::array::from_fn(|k| self.ways[0][k] + self.ways[1][k]))
    }

    /// The unit vector across one of the segments that leads out of the turn.
    pub(super) fn out(&self, which: usize) -> Point {
        cross(&self.ways[which], &self.axis)
    }

    /// A vector that is turned about the axis by a part of the turn.
    pub(super) fn turned(&self, x: &Point, share: f64) -> Point {
        turned(x, &self.axis, share * self.turn)
    }
}

impl Rod {
    /// Which of its ends is where the tube comes (0), or goes on (1).
    pub(super) fn end(&self, side: usize) -> usize {
        if self.is_reversed { 1 - side } else { side }
    }

    /// The number of one of its corners there, given its place in the tube's ring.
    pub(super) fn corner(&self, side: usize, corner: usize) -> usize {
        let count = self.strips.len();
        let own = if self.is_reversed { (count - corner) % count } else { corner };
        own + self.end(side) * count
    }
}

impl Tubes {
    /// None, of some figures.
    pub(super) fn none(figures: usize) -> Self {
        let mut tubes = Self { figures, ..Self::default() };
        tubes.rods.resize_with(figures, || None);
        tubes.stretches = vec![None; figures];
        tubes
    }

    /// The tubes of some figures, whose segments are cut at bends from now on.
    pub(super) fn of<'f>(
        sites: &[Figure],
        beyond: &mut [Box<[Option<f64>]>],
        loose: &Loose,
        form: impl Fn(Kind) -> Option<&'f Form>,
        slack: f64,
        shell: impl Fn(&Figure) -> Shell,
    ) -> Self {
        let mut tubes = Self::none(sites.len());
        let mut links = links(sites, &shell);
        for (number, (chain, is_ring)) in chains(&links).into_iter().enumerate() {
            tubes.measure(sites, &chain, is_ring, number, shell(&sites[chain[0].0 as usize]).outer);
        }
        for &(rod, end) in loose {
            let link = links[rod as usize][end];
            link.iter().flat_map(|link| link.rods).for_each(|(rod, end)| links[rod as usize][end] = None);
        }
        for (chain, is_ring) in chains(&links) {
            let turns = chain.iter().filter_map(|&(rod, entered)| Some(links[rod as usize][1 - entered]?.turn));
            let shell = shell(&sites[chain[0].0 as usize]);
            let course = Course {
                sites,
                ways: chain.iter().map(|&(rod, entered)| way(&sites[rod as usize], entered)).collect(),
                turns: turns.collect(),
                shell,
                is_ring,
                noise: slack / shell.outer,
                chain,
            };
            for part in course.parts() {
                let kind = match part.axes {
                    [_, true] => Kind::Square,
                    [true, false] => Kind::Flat,
                    [false, false] => Kind::Rod,
                };
                form(kind).into_iter().for_each(|form| tubes.add(&course, beyond, &part, kind, &form.covering));
            }
        }
        tubes
    }

    /// Notes where the segments of a course are.
    fn measure(&mut self, sites: &[Figure], chain: &[(u32, usize)], is_ring: bool, course: usize, outer: f64) {
        let mut to = 0.0;
        for &(rod, _) in chain {
            let [p, q] = ordered(&sites[rod as usize]);
            let from = to;
            to += distance_squared(&p, &q).sqrt();
            self.stretches[rod as usize] = Some(Stretch { course, from, to, around: f64::INFINITY, most: SUCCESSIVE * outer });
        }
        for &(rod, _) in chain.iter().filter(|_| is_ring) {
            self.stretches[rod as usize].iter_mut().for_each(|stretch| stretch.around = to);
        }
    }

    /// Adds a tube along some segments, if there is room for one.
    fn add(&mut self, course: &Course<'_>, beyond: &mut [Box<[Option<f64>]>], part: &Part, kind: Kind, covering: &Covering) {
        let Part { range, is_ring, first, axes } = part;
        let Course { sites, chain, ways, turns, shell, .. } = course;
        let Shell { inner, outer } = *shell;
        let last = range.len() - 1;
        let bends = if *is_ring { range.len() } else { last };
        let (chain, ways, turns) = (&chain[range.clone()], &ways[range.clone()], &turns[range.start..range.start + bends]);
        let shift = |kind: u64, rod: u32, index: u64| share(kind << 32 | u64::from(rod), index);
        let beside = (2.0 * outer * SLAB * (outer - inner)).sqrt();
        let (mut low, mut high) = (inner * covering.girth, (outer * outer - beside * beside).max(0.0).sqrt());
        for cosine in turns.iter().filter(|&&turn| shell.is_mitre(turn)).map(|turn| (0.5 * turn).cos()) {
            high = high.min(outer * cosine).min((outer * outer - (beside / cosine).powi(2)).max(0.0).sqrt());
        }
        let ends = [(chain[0].0, chain[0].1), (chain[last].0, 1 - chain[last].1)];
        for (rod, end) in ends.into_iter().filter(|_| !is_ring) {
            match beyond[rod as usize][end] {
                Some(beyond) => high = high.min((outer * outer - beyond * beyond).max(0.0).sqrt()),
                None => low = low.max(inner * covering.reach),
            }
        }
        let room = high - low;
        if room <= 0.0 {
            return;
        }
        let reach = low + (OWN_SHIFT + (1.0 - 2.0 * OWN_SHIFT) * (1.0 - ALL_SHIFT * shift(SEEDS[0], chain[0].0, 0))) * room;
        // A facet of the wedge is nearer than the strip that it goes on from by the cosine of half the angle that it turns by at most; this is the largest half.
        let step = (inner * covering.girth / reach).min(1.0).acos();
        let steps = |turn: f64| if shell.is_mitre(turn) { 0 } else { (0.5 * turn / step * (1.0 + 1e-9)).ceil() as usize };
        if turns.iter().any(|&turn| steps(turn) * covering.belt / 2 + 2 > MOST_FACETS) {
            return;
        }
        let own = covering.own_shift(room, *shell);
        let mut strips: Vec<f64> =
            (1..).take(covering.belt).map(|strip| reach / covering.girth + own * shift(SEEDS[0], chain[0].0, strip)).collect();
        // Beside corners on an axis they are as far out as each other, twice around as the last one is beside the first.
        let is_on_axis = |corner: usize| (4 * corner).is_multiple_of(covering.belt) && axes[4 * corner / covering.belt % 2];
        for corner in (0..covering.belt).rev().cycle().take(2 * covering.belt).filter(|&corner| is_on_axis(corner)) {
            strips[(corner + covering.belt - 1) % covering.belt] = strips[corner];
        }
        let mut frame = [*first, cross(&ways[0], first), ways[0]];
        let first_bend = self.bends.len();
        for (place, &(rod, entered)) in chain.iter().enumerate() {
            let bend = |place: usize| (place < bends).then_some(first_bend + place);
            let (is_reversed, [x, y, z]) = (entered == 1, frame);
            let negated = |x: Point| x.map(|part| -part);
            self.rods[rod as usize] = Some(Rod {
                kind,
                is_reversed,
                frame: if is_reversed { [x, negated(y), negated(z)] } else { frame },
                reach,
                own,
                strips: if is_reversed { strips.iter().rev().copied().collect() } else { strips.clone().into() },
                is_cut: [false; 2],
                bends: [bend(if place > 0 { place - 1 } else { last }), bend(place)],
                tube: chain[0].0,
                place: 2 * place,
            });
            if place < bends {
                let next = if place < last { place + 1 } else { 0 };
                let rods = [rod, chain[next].0];
                beyond[rod as usize][1 - entered] = Some(0.0);
                beyond[rods[1] as usize][chain[next].1] = Some(0.0);
                let ways = [ways[place], ways[next]];
                let bend = Bend {
                    at: ordered(&sites[rod as usize])[1 - entered],
                    rods,
                    ways,
                    axis: unit(&cross(&ways[0], &ways[1])),
                    turn: turns[place],
                    wedge: (!shell.is_mitre(turns[place])).then_some((self.figures + self.wedges.len()) as u32),
                    steps: steps(turns[place]),
                    beyond: beside * (0.75 + 0.25 * shift(SEEDS[1] + entered as u64, rod, 0)),
                };
                self.wedges.extend(bend.wedge.map(|_| self.bends.len()));
                frame = carried(&frame, &bend.axis, bend.turn, &ways[1]);
                self.bends.push(bend);
            }
        }
        for rod in chain.iter().map(|&(rod, _)| rod as usize) {
            if let Some(own) = &mut self.rods[rod] {
                own.is_cut = [0, 1].map(|end| beyond[rod][end].is_some());
            }
        }
    }

    /// The figures of wedges.
    pub(super) fn points(&self, sites: &[Figure]) -> Vec<Figure> {
        let bends = self.wedges.iter().map(|&bend| &self.bends[bend]);
        bends.map(|bend| Figure { outline: Outline::Point(bend.at), deficit: sites[bend.rods[0] as usize].deficit }).collect()
    }

    /// The planes that a body is cut by, given how far beyond its ends it is.
    pub(super) fn cuts(&self, index: u32, figure: &Figure, beyond: &[Option<f64>]) -> Box<[Plane]> {
        if let Some(bend) = self.wedge(index) {
            return self.bends[bend].cuts().into();
        }
        let mut beyond: Box<[Option<f64>]> = beyond.into();
        let mut mitres = Vec::new();
        for (side, rod) in self.rod(index).into_iter().flat_map(|rod| [(0, rod), (1, rod)]) {
            if let Some(bend) = rod.bends[side].map(|bend| &self.bends[bend]).filter(|bend| bend.wedge.is_none()) {
                beyond[rod.end(side)] = None;
                mitres.push(bend.mitre(1 - side));
            }
        }
        joints::planes(figure, &beyond).iter().copied().chain(mitres).collect()
    }

    /// The bend of a wedge.
    fn wedge(&self, figure: u32) -> Option<usize> {
        self.wedges.get((figure as usize).checked_sub(self.figures)?).copied()
    }

    /// The segment with a number, if it is in a tube.
    pub(super) fn rod(&self, figure: u32) -> Option<&Rod> {
        self.rods.get(figure as usize)?.as_ref()
    }

    /// The tube of a figure, and its place there: wedges are between segments.
    fn place(&self, figure: u32) -> Option<(u32, usize)> {
        let place = |rod: &Rod| (rod.tube, rod.place);
        match self.wedge(figure) {
            Some(bend) => self.rod(self.bends[bend].rods[0]).map(place).map(|(tube, place)| (tube, place + 1)),
            None => self.rod(figure).map(place),
        }
    }

    /// The ends of the bends that some figures are at.
    pub(super) fn ends(&self, figures: impl IntoIterator<Item = u32>) -> Loose {
        figures.into_iter().flat_map(|figure| self.bends_at(figure)).flat_map(|bend| self.ends_of(bend)).collect()
    }

    fn ends_of(&self, bend: usize) -> impl Iterator<Item = (u32, usize)> {
        (0..2).filter_map(move |which| {
            let rod = self.bends[bend].rods[which];
            Some((rod, self.rod(rod)?.end(1 - which)))
        })
    }

    /// The bends that a figure is at.
    fn bends_at(&self, figure: u32) -> impl Iterator<Item = usize> {
        let of_rod = self.rod(figure).into_iter().flat_map(|rod| rod.bends.into_iter().flatten());
        self.wedge(figure).into_iter().chain(of_rod)
    }

    /// Whether two cells have a facet in common.
    pub(super) fn are_joined(&self, one: u32, other: u32) -> bool {
        self.bends_at(one).map(|bend| &self.bends[bend]).any(|bend| bend.wedge == Some(other) || bend.rods.contains(&other))
    }

    /// The ends of bends that others are near to than what is before and after them: rings are hidden there in part, and bodies that cannot be changed, as the cells go with them, leave doubts.
    pub(super) fn crowded(&self, sites: &[Figure], near: &Lists, outer: f64) -> Loose {
        let others = |figure: u32| near.of(figure).iter().filter(move |&&other| !self.are_successive(figure, other));
        let is_crowded = |bend: &Bend| {
            let is_beside = |other: &u32| distance_squared(&sites[*other as usize].closest(&bend.at), &bend.at) <= (2.0 * outer).powi(2);
            bend.rods.iter().any(|&rod| others(rod).count() > MOST_OTHERS || others(rod).any(is_beside))
        };
        let crowded: Vec<bool> = self.bends.par_iter().map(is_crowded).collect();
        let left = crowded.iter().filter(|&&is_crowded| !is_crowded).count();
        if (left as f64) < LEAST_BENDS * self.rods.iter().flatten().count() as f64 {
            // Also those that would be instead.
            let all = (0..).zip(&self.stretches).filter(|(_, stretch)| stretch.is_some());
            return all.flat_map(|(rod, _)| [(rod, 0), (rod, 1)]).collect();
        }
        let all = (0..).zip(crowded).filter(|&(_, is_crowded)| is_crowded);
        all.flat_map(|(number, _)| self.ends_of(number)).collect()
    }

    /// Whether two figures follow each other, with little between them.
    fn are_successive(&self, one: u32, other: u32) -> bool {
        let stretch = |figure: u32| match self.wedge(figure) {
            Some(bend) => self.stretches[self.bends[bend].rods[0] as usize],
            None => self.stretches[figure as usize],
        };
        let (Some(own), Some(theirs)) = (stretch(one), stretch(other)) else { return false };
        let gap = (theirs.from - own.to).max(own.from - theirs.to);
        // The other way around.
        let back = own.around - (own.to.max(theirs.to) - own.from.min(theirs.from));
        own.course == theirs.course && gap.min(back) <= own.most
    }

    /// The ends of bends without which no two cells of a tube would meet but where they are joined: where a tube comes back to itself, it is two, which differ (a ring after another round).
    pub(super) fn crossed(&self, near: &Lists) -> Loose {
        let mut cells = vec![None; self.figures + self.wedges.len()];
        self.cells.iter().for_each(|(index, cell)| cells[*index as usize] = Some(cell));
        let crossings = |(index, cell): &(u32, Polytope)| {
            let own = self.place(*index);
            let before = |&other: &u32| self.place(other).zip(own).filter(|(theirs, own)| theirs.0 == own.0 && theirs.1 < own.1);
            let meets = |other: &u32| cells[*other as usize].is_some_and(|theirs| !pieces::are_parted(cell, theirs));
            let found = near.of(*index).iter().filter(|other| before(other).is_some() && meets(other)).filter_map(before);
            found.map(|(theirs, own)| (own, theirs.1, *index)).collect::<Vec<_>>()
        };
        let mut crossings: Vec<((u32, usize), usize, u32)> = self.cells.par_iter().flat_map_iter(crossings).collect();
        crossings.sort_unstable();
        let (mut found, mut last) = (Loose::new(), (u32::MAX, 0));
        for ((tube, place), before, index) in crossings {
            if last.0 == tube && last.1 > before {
                continue;
            }
            // The bend at the cell, or before it.
            let bend = self.wedge(index).or_else(|| self.rod(index)?.bends[0]);
            last = (tube, place - usize::from(self.wedge(index).is_none()));
            found.extend(bend.into_iter().flat_map(|bend| self.ends_of(bend)));
        }
        found
    }
}

/// The unit vector along a segment from one of its ends.
fn way(figure: &Figure, from: usize) -> Point {
    let ends = ordered(figure);
    unit(&subtract(&ends[1 - from], &ends[from]))
}

/// For both ends of every figure, the place where only one other segment ends, of the same radius, and both are long enough for what bends take.
fn links(sites: &[Figure], shell: impl Fn(&Figure) -> Shell) -> Vec<[Option<Link>; 2]> {
    let ends = joints::ends(sites);
    let mut links = vec![[None; 2]; sites.len()];
    for joint in ends.chunk_by(|a, b| a.at == b.at) {
        let [first @ End { site: one, end: Some(own), .. }, second @ End { site: other, end: Some(theirs), .. }] = joint else { continue };
        let (one, other) = (*one, *other);
        let rods = [(one, *own), (other, *theirs)];
        let [out, back] = [first, second].map(|end| joints::outward(sites, end));
        let across = cross(&out, &back);
        let turn = dot(&across, &across).sqrt().atan2(-dot(&out, &back));
        let is_one = sites[one as usize].deficit == sites[other as usize].deficit && one != other;
        if is_one && (TURNS[0]..TURNS[1]).contains(&turn) {
            rods.iter().for_each(|&(rod, end)| links[rod as usize][end] = Some(Link { rods, turn }));
        }
    }
    for (site, figure) in sites.iter().enumerate().filter(|(_, figure)| kind(figure) == Kind::Rod) {
        let [from, to] = ordered(figure);
        let length = distance_squared(&from, &to).sqrt() / shell(figure).outer;
        while let Some(link) = links[site].iter().flatten().max_by(|a, b| a.need().total_cmp(&b.need())).copied() {
            let needs: f64 = links[site].iter().flatten().map(Link::need).sum();
            if length >= LEAST_LENGTH.max(needs + LEAST_BETWEEN) {
                break;
            }
            link.rods.iter().for_each(|&(rod, end)| links[rod as usize][end] = None);
        }
    }
    links
}

/// Segments that are linked, one after the other, each with the end at which it is entered; and whether the last goes on to the first.
fn chains(links: &[[Option<Link>; 2]]) -> Vec<(Vec<(u32, usize)>, bool)> {
    let mut chains = Vec::new();
    let mut is_taken = vec![false; links.len()];
    // From ends that are free first: what is left are rings.
    for rings in [false, true] {
        for first in 0..links.len() {
            let is_linked = links[first].map(|link| link.is_some());
            if is_taken[first] || is_linked == [false; 2] || (!rings && is_linked == [true; 2]) {
                continue;
            }
            let chain = chain(links, first as u32, usize::from(!rings && is_linked[0]));
            chain.0.iter().for_each(|&(rod, _)| is_taken[rod as usize] = true);
            chains.push(chain);
        }
    }
    chains
}

/// The segments from one on, each with the end at which it is entered, and whether the last goes on to the first.
fn chain(links: &[[Option<Link>; 2]], first: u32, entered: usize) -> (Vec<(u32, usize)>, bool) {
    let mut chain = vec![(first, entered)];
    let mut at = (first, 1 - entered);
    while let Some(Link { rods, .. }) = links[at.0 as usize][at.1] {
        let next = if rods[0] == at { rods[1] } else { rods[0] };
        if next.0 == first {
            return (chain, true);
        }
        chain.push(next);
        at = (next.0, 1 - next.1);
    }
    (chain, false)
}
