//! Segments that are one tube: where two of one radius end, and nothing else does, their polytopes have a ring of corners in common, and what is between them is a wedge that turns one ring to the other, or nothing.
//!
//! Polytopes of neighbours cross in rings of corners that belong to neither, three to a joint for each that there should be. So the boundary is made of *cells* there, see `cells`: convex polytopes that share whole facets, and nothing else. Their union is that of other polytopes, which do have common interior points, and which
//! the topology is told of. Let a segment end at P with the unit vector a along it, another begin there with b, and u be the unit vector about which a turns to b by less than half a turn. Let A and B be prisms around both with strips that the same turn takes to each other, none
//! nearer to its segment than the band's inner end s, and no corner farther from it than the outer one. Then there are three convex bodies,
//!
//! * A n {(x - P) . a <= 0}, which stands for the dilations of the first segment, cut by that plane,
//! * B n {(x - P) . b >= 0}, likewise,
//! * W n A n B n {(x - P) . a >= -c} n {(x - P) . b <= c}, which stands for the balls around P, cut by these, with W all that is below the planes of the wedge's facets, which are no nearer to P than s.
//!
//! The dilations by t <= r of both segments are the union of the three bodies' (but for what is at their other ends): of the segments' closest points to x the nearest is P, and then x is on neither one's side and in the last, or it is one of a segment's where that is not cut. This takes no more of the other segment than
//! r sin(turn), or r tan(turn / 2) from a right angle on, since where x is nearest to one segment, but beyond the bisecting plane, its closest point on the other's line is no farther from P: so segments must be as long, with both of their ends taken together, and mitres do not meet then, either.
//!
//! The cells are A up to the first plane where the tube is turned away from, and up to the bisecting plane where it turns to, B likewise, and the wedge between both planes; with no wedge, the bisecting plane ends both. Their union is the bodies': of {(x - P) . a <= 0} what is beyond the bisecting plane is in the other's cell, by the reflection that takes each
//! prism to the other; and the wedge lies in both prisms, as a turn about a line that both are convex about takes places towards it.

use super::covering::Covering;
use super::figure::{Figure, Outline, order};
use super::form::{Form, Kind};
use super::pieces::{self, Lists};
use super::polytopes::{ALL_SHIFT, OWN_SHIFT, Plane, Polytope, Shell, frame, kind, ordered, share};
use crate::attractor::cell::{Point, cross, distance_squared, dot, subtract, unit};
use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

/// Angles by which tubes turn, in radians: where it is less, the axis is up to rounding, and more would take long segments.
const TURNS: [f64; 2] = [1e-6, 2.3];
/// Lengths of segments at least, and how much longer they are than what their bends take, in units of the outer radius.
const LEAST_LENGTH: f64 = 0.3;
const LEAST_BETWEEN: f64 = 0.1;
/// The share of the band that a mitre may take, and that the slab of a bend's body does.
const MITRE: f64 = 0.05;
const SLAB: f64 = 0.04;
/// How far the axis of a wedge may be from a corner, in units of the angle between corners.
const OFF_CORNER: f64 = 1e-9;
/// Steps of a wedge at most.
const MOST_STEPS: usize = 64;

/// Bodies of other tubes that the segments of a bend may be near to.
const MOST_OTHERS: usize = 8;
/// Bends for every segment at least: fewer are not worth that doubts may cost them all.
const LEAST_BENDS: f64 = 0.125;

/// Ends of segments, by figure and place in their order, that are in no bend.
pub(super) type Loose = BTreeSet<(u32, usize)>;

/// Where a tube turns.
#[derive(Debug)]
pub(super) struct Bend {
    pub(super) at: Point,
    /// The segment that ends there, and the one that goes on.
    pub(super) rods: [u32; 2],
    /// The unit vectors along them.
    pub(super) ways: [Point; 2],
    /// The unit vector about which the first turns to the second, and by how much.
    pub(super) axis: Point,
    pub(super) turn: f64,
    /// Into how many parts the wedge is divided; 0 where there is none.
    pub(super) steps: usize,
    /// How far its body reaches into the segments' sides.
    beyond: f64,
}

/// What a segment in a tube is like.
#[derive(Debug)]
pub(super) struct Rod {
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
    /// The tube, and the segment's place in it.
    pub(super) tube: usize,
    pub(super) place: usize,
}

/// The tubes of an arrangement.
#[derive(Debug, Default)]
pub(super) struct Tubes {
    /// How many figures there are beside the bends', which come after them.
    pub(super) figures: usize,
    pub(super) bends: Vec<Bend>,
    /// Of every figure.
    pub(super) rods: Vec<Option<Rod>>,
    /// What the boundary is made of, instead of the bodies with these numbers.
    pub(super) cells: Vec<(u32, Polytope)>,
    /// How many there are.
    tubes: usize,
}

/// Segments one after the other.
struct Course<'a> {
    sites: &'a [Figure],
    /// Their numbers, and at which end each is entered.
    chain: Vec<(u32, usize)>,
    /// The unit vectors along them, and the angles between these.
    ways: Vec<Point>,
    turns: Vec<f64>,
    covering: &'a Covering,
    shell: Shell,
}

/// Some of them that can be a tube.
struct Part {
    range: Range<usize>,
    /// The direction across the first segment where strips begin.
    first: Point,
    /// The corners of rings on the axis of some wedge.
    corners: Vec<bool>,
}

impl Course<'_> {
    /// Parts that can be tubes. The axes of all wedges go through corners: turned about another line, what lies beyond would not be convex.
    fn parts(&self) -> Vec<Part> {
        let (mut parts, mut start, belt) = (Vec::new(), 0, self.covering.belt);
        while start < self.chain.len() {
            let first = frame(&self.ways[start]);
            let (mut turning, mut place, mut begin, mut corners) = (first, start, None, vec![false; belt]);
            while place + 1 < self.chain.len() {
                let (ways, turn) = ([self.ways[place], self.ways[place + 1]], self.turns[place]);
                let axis = unit(&cross(&ways[0], &ways[1]));
                if !self.shell.is_mitre(turn) {
                    let angle = dot(&axis, &turning[1]).atan2(dot(&axis, &turning[0]));
                    let off = (angle - *begin.get_or_insert(angle)) / TAU * belt as f64;
                    let corner = off.round();
                    if (off - corner).abs() > OFF_CORNER {
                        break;
                    }
                    let corner = (corner as i64).rem_euclid(belt as i64) as usize;
                    corners[corner] = true;
                    corners[(corner + belt / 2) % belt] = true;
                }
                turning = carried(&turning, &axis, turn, &ways[1]);
                place += 1;
            }
            let (sine, cosine) = begin.unwrap_or_default().sin_cos();
            if place > start {
                let first = std::array::from_fn(|k| cosine * first[0][k] + sine * first[1][k]);
                parts.push(Part { range: start..place + 1, first, corners });
            }
            start = place + 1;
        }
        parts
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

/// A place where two segments end: for each its number, which of its ends that is, and the unit vector out of it there.
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
    /// The planes that its body is cut by.
    pub(super) fn cuts(&self) -> [Plane; 2] {
        let [[a, b, c], [d, e, f]] = self.ways;
        let along = self.ways.map(|way| dot(&way, &self.at));
        [[-a, -b, -c, self.beyond - along[0]], [d, e, f, along[1] + self.beyond]]
    }

    /// A vector that is turned about its axis by a part of its turn.
    pub(super) fn turned(&self, x: &Point, share: f64) -> Point {
        turned(x, &self.axis, share * self.turn)
    }

    /// The frame of the second segment's strips, given the first one's.
    fn carried(&self, frame: &[Point; 3]) -> [Point; 3] {
        carried(frame, &self.axis, self.turn, &self.ways[1])
    }

    /// Where its figure lies.
    pub(super) fn figure(&self, sites: &[Figure]) -> Figure {
        Figure { outline: Outline::Point(self.at), deficit: sites[self.rods[0] as usize].deficit }
    }
}

impl Rod {
    /// Which of its ends is where the tube comes (0), or goes on (1).
    pub(super) fn end(&self, side: usize) -> usize {
        if self.is_reversed { 1 - side } else { side }
    }

    /// The number of a corner of its ring for one of the tube's, or the other way round.
    pub(super) fn corner(&self, corner: usize) -> usize {
        let count = self.strips.len();
        if self.is_reversed { (count - corner) % count } else { corner }
    }
}

impl Tubes {
    /// None, of some figures.
    pub(super) fn none(figures: usize) -> Self {
        let mut tubes = Self { figures, ..Self::default() };
        tubes.rods.resize_with(figures, || None);
        tubes
    }

    /// The tubes of some figures, whose segments are cut at bends from now on.
    pub(super) fn of(
        sites: &[Figure],
        beyond: &mut [Box<[Option<f64>]>],
        loose: &Loose,
        form: &Form,
        shell: impl Fn(&Figure) -> Shell,
    ) -> Self {
        let mut links = links(sites, loose, &shell);
        let mut tubes = Self::none(sites.len());
        let mut is_taken = vec![false; sites.len()];
        // From ends that are free first: what is left are rings, which are cut somewhere.
        for rings in [false, true] {
            for first in 0..sites.len() {
                let is_linked = [0, 1].map(|end| links[first][end].is_some());
                if is_taken[first] || is_linked == [false; 2] || (!rings && is_linked == [true; 2]) {
                    continue;
                }
                if let (true, Some(Link { rods, .. })) = (rings, links[first][0]) {
                    rods.iter().for_each(|&(rod, end)| links[rod as usize][end] = None);
                }
                let chain = chain(&links, first as u32, usize::from(links[first][0].is_some()));
                chain.iter().for_each(|&(rod, _)| is_taken[rod as usize] = true);
                let turns = chain.iter().filter_map(|&(rod, entered)| Some(links[rod as usize][1 - entered]?.turn));
                let course = Course {
                    sites,
                    ways: chain.iter().map(|&(rod, entered)| way(&sites[rod as usize], entered)).collect(),
                    turns: turns.collect(),
                    chain,
                    covering: &form.covering,
                    shell: shell(&sites[first]),
                };
                course.parts().iter().for_each(|part| tubes.add(&course, beyond, part));
            }
        }
        tubes
    }

    /// Adds a tube along some segments, if there is room for one.
    fn add(&mut self, course: &Course<'_>, beyond: &mut [Box<[Option<f64>]>], Part { range, first, corners }: &Part) {
        let Course { sites, chain, ways, turns, covering, shell, .. } = course;
        let Shell { inner, outer } = *shell;
        let (chain, ways, turns) = (&chain[range.clone()], &ways[range.clone()], &turns[range.start..range.end - 1]);
        // Seeds that no polytope has.
        let shift = |kind: u64, rod: u32, index: u64| share(kind << 32 | u64::from(rod), index);
        let beside = (2.0 * outer * SLAB * (outer - inner)).sqrt();
        let (mut low, mut high) = (inner * covering.girth, (outer * outer - beside * beside).max(0.0).sqrt());
        for turn in turns.iter().filter(|&&turn| shell.is_mitre(turn)) {
            high = high.min(outer * (0.5 * turn).cos());
        }
        let last = chain.len() - 1;
        for (rod, end) in [(chain[0].0, chain[0].1), (chain[last].0, 1 - chain[last].1)] {
            match beyond[rod as usize][end] {
                Some(beyond) => high = high.min((outer * outer - beyond * beyond).max(0.0).sqrt()),
                None => low = low.max(inner * covering.reach),
            }
        }
        let room = high - low;
        if room <= 0.0 {
            return;
        }
        let reach = low + (OWN_SHIFT + (1.0 - 2.0 * OWN_SHIFT) * (1.0 - ALL_SHIFT * shift(255, chain[0].0, 0))) * room;
        // A facet of the wedge is nearer than the strip that it goes on from by this cosine at most.
        let step = (inner * covering.girth / reach).min(1.0).acos();
        let steps = |turn: f64| if shell.is_mitre(turn) { 0 } else { (0.5 * turn / step * (1.0 + 1e-9)).ceil() as usize };
        if turns.iter().any(|&turn| steps(turn) > MOST_STEPS) {
            return;
        }
        let own = covering.own_shift(room, *shell);
        let mut strips: Vec<f64> =
            (1..).take(covering.belt).map(|strip| reach / covering.girth + own * shift(255, chain[0].0, strip)).collect();
        // Beside corners on an axis they are as far out as each other, twice around as the last one is beside the first.
        for corner in (0..covering.belt).rev().cycle().take(2 * covering.belt).filter(|&corner| corners[corner]) {
            strips[(corner + covering.belt - 1) % covering.belt] = strips[corner];
        }
        let mut frame = [*first, cross(&ways[0], first), ways[0]];
        let tube = self.tubes;
        self.tubes += 1;
        for (place, &(rod, entered)) in chain.iter().enumerate() {
            let next = self.bends.len();
            let (is_reversed, [x, y, z]) = (entered == 1, frame);
            let negated = |x: Point| x.map(|part| -part);
            self.rods[rod as usize] = Some(Rod {
                is_reversed,
                frame: if is_reversed { [x, negated(y), negated(z)] } else { frame },
                reach,
                own,
                strips: if is_reversed { strips.iter().rev().copied().collect() } else { strips.clone().into() },
                is_cut: [false; 2],
                bends: [(place > 0).then(|| next - 1), (place < last).then_some(next)],
                tube,
                place: 2 * place,
            });
            if place < last {
                let rods = [rod, chain[place + 1].0];
                beyond[rod as usize][1 - entered] = Some(0.0);
                beyond[rods[1] as usize][chain[place + 1].1] = Some(0.0);
                let ways = [ways[place], ways[place + 1]];
                let bend = Bend {
                    at: ordered(&sites[rod as usize])[1 - entered],
                    rods,
                    ways,
                    axis: unit(&cross(&ways[0], &ways[1])),
                    turn: turns[place],
                    steps: steps(turns[place]),
                    beyond: beside * (0.75 + 0.25 * shift(253 + entered as u64, rod, 0)),
                };
                frame = bend.carried(&frame);
                self.bends.push(bend);
            }
        }
        for rod in chain.iter().map(|&(rod, _)| rod as usize) {
            if let Some(own) = &mut self.rods[rod] {
                own.is_cut = [0, 1].map(|end| beyond[rod][end].is_some());
            }
        }
    }

    /// The number of a bend's figure.
    pub(super) fn figure(&self, bend: usize) -> u32 {
        (self.figures + bend) as u32
    }

    /// The bend of a figure.
    pub(super) fn bend_of(&self, figure: u32) -> Option<usize> {
        (figure as usize).checked_sub(self.figures)
    }

    /// The segment with a number, if it is in a tube.
    pub(super) fn rod(&self, figure: u32) -> Option<&Rod> {
        self.rods.get(figure as usize)?.as_ref()
    }

    /// The tube of a figure, and its place there: bends are between segments.
    pub(super) fn place(&self, figure: u32) -> Option<(usize, usize)> {
        let place = |rod: &Rod| (rod.tube, rod.place);
        match self.bend_of(figure) {
            Some(bend) => self.rod(self.bends[bend].rods[0]).map(place).map(|(tube, place)| (tube, place + 1)),
            None => self.rod(figure).map(place),
        }
    }

    /// The ends that a bend brings together.
    pub(super) fn ends(&self, bend: usize) -> impl Iterator<Item = (u32, usize)> {
        (0..2).filter_map(move |side| {
            let rod = self.bends[bend].rods[side];
            Some((rod, self.rod(rod)?.end(1 - side)))
        })
    }

    /// The bends that a figure is at.
    pub(super) fn bends_at(&self, figure: u32) -> impl Iterator<Item = usize> {
        let of_rod = self.rod(figure).into_iter().flat_map(|rod| rod.bends.into_iter().flatten());
        self.bend_of(figure).into_iter().chain(of_rod)
    }

    /// The cells that stand for a body: of a bend with no wedge those of its segments.
    pub(super) fn cells_of(&self, body: u32) -> impl Iterator<Item = u32> {
        let mitred = self.bend_of(body).map(|bend| &self.bends[bend]).filter(|bend| bend.steps == 0);
        let all = mitred.map_or([Some(body), None], |bend| bend.rods.map(Some));
        all.into_iter().flatten()
    }

    /// Whether two cells have a facet in common.
    pub(super) fn are_joined(&self, one: u32, other: u32) -> bool {
        self.bends_at(one).any(|bend| self.figure(bend) == other || self.bends[bend].rods.contains(&other))
    }

    /// Bends that bodies of other tubes are near to: rings are hidden there in part, and bodies that cannot be changed, as the cells go with them, leave doubts.
    pub(super) fn crowded(&self, near: &Lists) -> Vec<usize> {
        let tube = |figure: u32| self.place(figure).map(|(tube, _)| tube);
        let others = |figure: u32| near.of(figure).iter().filter(|&&other| tube(other) != tube(figure)).count();
        let is_crowded =
            |&bend: &usize| others(self.figure(bend)) > 0 || self.bends[bend].rods.iter().any(|&rod| others(rod) > MOST_OTHERS);
        let crowded: Vec<usize> = (0..self.bends.len()).filter(is_crowded).collect();
        let rods = self.rods.iter().flatten().count();
        if ((self.bends.len() - crowded.len()) as f64) < LEAST_BENDS * rods as f64 { (0..self.bends.len()).collect() } else { crowded }
    }

    /// Bends without which no two cells of a tube would meet but where they are joined: where a tube comes back to itself, it is two, which differ.
    pub(super) fn crossed(&self, near: &Lists) -> Vec<usize> {
        let mut crossings = Vec::new();
        let mut cells = vec![None; self.figures + self.bends.len()];
        self.cells.iter().for_each(|(index, cell)| cells[*index as usize] = Some(cell));
        for (index, cell) in &self.cells {
            let Some((tube, place)) = self.place(*index) else { continue };
            for &other in near.of(*index) {
                let Some((_, before)) = self.place(other).filter(|&(theirs, before)| theirs == tube && before < place) else { continue };
                if cells[other as usize].is_some_and(|theirs| !pieces::are_parted(cell, theirs)) {
                    crossings.push((tube, place, before, *index));
                }
            }
        }
        crossings.sort_unstable();
        let (mut found, mut last) = (Vec::new(), (usize::MAX, 0));
        for (tube, place, before, index) in crossings {
            // The bend at the cell, or before it.
            let bend = self.bend_of(index).or_else(|| self.rod(index)?.bends[0]);
            let cut = place - usize::from(self.bend_of(index).is_none());
            if last.0 != tube || last.1 <= before {
                found.extend(bend);
                last = (tube, cut);
            }
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
fn links(sites: &[Figure], loose: &Loose, shell: impl Fn(&Figure) -> Shell) -> Vec<[Option<Link>; 2]> {
    let mut ends: Vec<(Point, u32, Option<usize>)> = Vec::new();
    for (site, figure) in (0..).zip(sites) {
        match figure.outline {
            Outline::Segment(_) if kind(figure) == Kind::Rod => {
                ends.extend(ordered(figure).into_iter().enumerate().map(|(end, at)| (at, site, Some(end))));
            }
            Outline::Point(_) | Outline::Segment(_) => ends.push((figure.corners()[0], site, None)),
            Outline::Polygon(_) | Outline::Polyhedron(_) => {}
        }
    }
    ends.sort_unstable_by(|a, b| order(&a.0, &b.0).then(a.1.cmp(&b.1)));
    let mut links = vec![[None; 2]; sites.len()];
    for joint in ends.chunk_by(|a, b| a.0 == b.0) {
        let &[(_, one, Some(own)), (_, other, Some(theirs))] = joint else { continue };
        let rods = [(one, own), (other, theirs)];
        let [out, back] = rods.map(|(rod, end)| way(&sites[rod as usize], 1 - end));
        let across = cross(&out, &back);
        let turn = dot(&across, &across).sqrt().atan2(-dot(&out, &back));
        let is_one = sites[one as usize].deficit == sites[other as usize].deficit && one != other;
        if is_one && (TURNS[0]..TURNS[1]).contains(&turn) && !rods.iter().any(|end| loose.contains(end)) {
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

/// The segments from one on, each with the end at which it is entered.
fn chain(links: &[[Option<Link>; 2]], first: u32, entered: usize) -> Vec<(u32, usize)> {
    let mut chain = vec![(first, entered)];
    let mut at = (first, 1 - entered);
    while let Some(Link { rods, .. }) = links[at.0 as usize][at.1] {
        let (next, end) = if rods[0] == at { rods[1] } else { rods[0] };
        chain.push((next, end));
        at = (next, 1 - end);
    }
    chain
}
