//! The edges of a union of polytopes.
//!
//! They are pieces of the polytopes' edges, and of the lines where a facet of one meets one of another, less what other polytopes cover. A polytope covers an interval of a line: so all comes down
//! to intervals. Their ends are corners of polytopes, places where an edge pierces a facet, and places where facets of three polytopes meet: each is named by what meets there, whichever
//! line it is found on, and ends with one name are one vertex. So the union's boundary is closed if every comparison of heights has one outcome only, which is checked by what comes out: see `facets`.

use super::figure::Figure;
use super::polytopes::{Mask, Plane, Polytope, Polytopes, facet_number, height, normal, owner};
use super::structure::Edge;
use super::tubes::Tubes;
use crate::attractor::cell::{Point, between, cross, dot, subtract};
use crate::budget::{Budget, Stopped};
use crate::dilation::convex::Convex;
use crate::solid::box_tree::{Box32, BoxTree};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What a vertex of the union is called.
pub(super) type Name = u128;

/// A corner of a polytope.
fn corner(corner: u32) -> Name {
    1 << 96 | Name::from(corner)
}

/// Where an edge pierces a facet.
fn pierced(edge: u32, facet: u32) -> Name {
    2 << 96 | Name::from(edge) << 32 | Name::from(facet)
}

/// Where three facets meet.
fn meeting(mut facets: [u32; 3]) -> Name {
    facets.sort_unstable();
    facets.iter().fold(3, |name, &facet| name << 32 | Name::from(facet))
}

/// A piece of an edge of the union: its two facets, of which the first is to the left, and its ends with where they are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) facets: [u32; 2],
    pub(super) ends: [Name; 2],
    pub(super) places: [Point; 2],
}

/// Lists of polytopes, one for each.
#[derive(Debug, Default)]
pub(super) struct Lists(Vec<Vec<u32>>);

impl Lists {
    #[inline]
    pub(super) fn of(&self, index: u32) -> &[u32] {
        &self.0[index as usize]
    }

    /// How long all are together.
    pub(super) fn total(&self) -> usize {
        self.0.iter().map(Vec::len).sum()
    }

    /// Those of cells: they do not meet the ones that they are joined to.
    pub(super) fn of_cells(self, tubes: &Tubes) -> Self {
        if tubes.bends.is_empty() {
            return self;
        }
        let of = |(index, list): (u32, Vec<u32>)| list.into_iter().filter(|&other| !tubes.are_joined(index, other)).collect();
        let lists = (0..).zip(self.0).map(of).collect();
        Self(lists)
    }
}

/// A figure, how far its dilation reaches, and the planes that this is cut by.
pub(super) struct Body<'a> {
    pub(super) figure: &'a Figure,
    pub(super) reach: f64,
    pub(super) cuts: Box<[Plane]>,
}

/// Of every figure, those whose dilations may meet its own. `None` where that is too much for an arrangement: the squares of the numbers of neighbours are more than `most` on average. Where there are few sites, more are allowed.
///
/// # Errors
/// [`Stopped`].
pub(super) fn near(bodies: &[Body<'_>], most: usize, budget: &Budget) -> Result<Option<Lists>, Stopped> {
    let boxes: Vec<Box32> = bodies.iter().map(|body| body.figure.box_within(body.reach)).collect();
    let mut tree = BoxTree::default();
    tree.build(boxes.len(), |index| Some(boxes[index as usize]), true);
    let squares = most.saturating_mul(bodies.len() + FEW);
    let total = AtomicUsize::new(0);
    let of = |index: u32| {
        budget.cancel.check()?;
        let (own, mut found) = (&boxes[index as usize], Vec::new());
        if total.load(Ordering::Relaxed) > squares {
            return Ok(found);
        }
        let body = &bodies[index as usize];
        tree.query(own, 0, |leaf| {
            for (&item, other) in tree.items(leaf).iter().zip(tree.boxes(leaf)) {
                let theirs = &bodies[item as usize];
                if item != index && own.meets(other) && !body.is_apart(theirs) {
                    found.push(item);
                }
            }
            found.len() * found.len() <= squares
        });
        total.fetch_add(found.len() * found.len(), Ordering::Relaxed);
        found.sort_unstable();
        Ok(found)
    };
    let lists = Lists((0..boxes.len() as u32).into_par_iter().map(of).collect::<Result<_, Stopped>>()?);
    Ok((total.into_inner() <= squares).then_some(lists))
}

impl Body<'_> {
    /// Whether it surely does not meet another: one is beyond a plane that the other is cut by, or the figures are too far from each other.
    fn is_apart(&self, other: &Self) -> bool {
        let is_cut_off = |by: &Self, body: &Self| {
            by.cuts.iter().any(|plane| body.figure.corners().iter().all(|corner| height(plane, corner) > body.reach))
        };
        is_cut_off(self, other) || is_cut_off(other, self) || are_apart(self.figure, other.figure, self.reach + other.reach)
    }
}

/// Whether a plane shows that figures are farther from each other than a distance. Alternating projections converge to a closest pair, and the plane across it parts them best.
pub(super) fn are_apart(one: &Figure, other: &Figure, distance: f64) -> bool {
    let mut x = one.corners()[0];
    for _ in 0..MOST_PROJECTIONS {
        let y = other.closest(&x);
        x = one.closest(&y);
        let across = subtract(&x, &y);
        // The lowest place of one along the way from the other, which is highest along it.
        let gap = -one.highest(&across.map(|part| -part)) - other.highest(&across);
        let length = dot(&across, &across).sqrt();
        if gap > distance * length {
            return true;
        }
        if length <= distance {
            return false;
        }
    }
    false
}

/// See [`are_apart`].
const MOST_PROJECTIONS: usize = 8;

/// So many sites more are counted for the averages: where there are few, it does not matter.
const FEW: usize = 40;

/// The pieces that every polytope has with later ones.
///
/// # Errors
/// [`Stopped`].
pub(super) fn find(polytopes: &Polytopes, near: &Lists, budget: &Budget) -> Result<Vec<Vec<Piece>>, Stopped> {
    let indices = || (0..polytopes.count()).into_par_iter();
    let beside = indices().map_init(Beyond::default, |beyond, index| {
        budget.cancel.check()?;
        Ok(beside(polytopes, near.of(index), index, beyond))
    });
    let (mut met, hidden): (Vec<Vec<u32>>, Vec<Mask>) = beside.collect::<Result<Vec<_>, Stopped>>()?.into_iter().unzip();
    // No facet of either parts them.
    let is_beside = |index: u32, other: u32| met[other as usize].binary_search(&index).is_ok();
    met = indices().map(|index| met[index as usize].iter().copied().filter(|&other| is_beside(index, other)).collect()).collect();
    let seen: Vec<Seen> = indices().map(|index| Seen::of(polytopes.of(index), &hidden[index as usize])).collect();
    let arrangement = Arrangement { polytopes, met: &met, hidden: &hidden, seen: &seen };
    let pieces = indices().map_init(Scratch::default, |scratch, index| {
        budget.cancel.check()?;
        arrangement.of(index, scratch);
        Ok(std::mem::take(&mut scratch.out))
    });
    pieces.collect()
}

/// Those of some polytopes of which no facet parts a polytope from them, and its facets that lie within one of these.
fn beside(polytopes: &Polytopes, near: &[u32], index: u32, beyond: &mut Beyond) -> (Vec<u32>, Mask) {
    let (structure, polytope) = (polytopes.structure(index), polytopes.of(index));
    let (mut beside, mut hidden) = (Vec::new(), Mask::default());
    polytope.seams.iter().flat_map(|seams| &seams.inside).for_each(|&facet| hidden.add(usize::from(facet)));
    for &other in near {
        if !beyond.fill(&polytope.corners, polytopes.of(other)) {
            continue;
        }
        beside.push(other);
        let mut seen = Mask::default();
        for edge in structure.edges.iter().filter(|edge| edge.corners.iter().any(|&corner| !beyond.is_inside(usize::from(corner)))) {
            edge.facets.iter().for_each(|&facet| seen.add(usize::from(facet)));
        }
        (0..structure.facets).filter(|&facet| !seen.has(facet)).for_each(|facet| hidden.add(facet));
    }
    (beside, hidden)
}

/// How many triangles of the union each of some polytopes, in ascending order, adds, about: a facet with k edges has k - 2, and each edge is on two.
pub(super) fn count(polytopes: &Polytopes, near: &Lists, of: &[u32]) -> Vec<f64> {
    let total = polytopes.all.len();
    let (mut met, mut hidden, mut seen) = (vec![Vec::new(); total], vec![Mask::default(); total], Vec::new());
    seen.resize_with(total, Seen::default);
    let mut beyond = Beyond::default();
    // What others hide of the neighbours they cover as well, and to tell it takes long.
    for &index in of {
        let (mut own, mask) = beside(polytopes, near.of(index), index, &mut beyond);
        own.retain(|&other| beyond.fill(&polytopes.of(other).corners, polytopes.of(index)));
        hidden[index as usize] = mask;
        met[index as usize] = own;
    }
    let neighbours = of.iter().flat_map(|&index| &met[index as usize]);
    for &index in of.iter().chain(neighbours).collect::<BTreeSet<_>>() {
        seen[index as usize] = Seen::of(polytopes.of(index), &hidden[index as usize]);
    }
    let arrangement = Arrangement { polytopes, met: &met, hidden: &hidden, seen: &seen };
    let mut scratch = Scratch::default();
    let mut triangles = Vec::with_capacity(of.len());
    for &index in of {
        let before = scratch.out.len();
        arrangement.of(index, &mut scratch);
        triangles.push(2.0 * (scratch.out.len() - before) as f64);
    }
    let mut facets: Vec<u32> = scratch.out.iter().flat_map(|piece| piece.facets).collect();
    facets.sort_unstable();
    facets.dedup();
    for place in facets.into_iter().filter_map(|facet| of.binary_search(&owner(facet).0).ok()) {
        triangles[place] -= 2.0;
    }
    triangles
}

/// Whether a facet of one of two polytopes parts the other from it.
pub(super) fn are_parted(one: &Polytope, other: &Polytope) -> bool {
    let mut beyond = Beyond::default();
    !beyond.fill(&one.corners, other) || !beyond.fill(&other.corners, one)
}

/// The facets of a polytope that the corners of another are beyond.
#[derive(Default)]
struct Beyond {
    /// The corners, coordinate by coordinate.
    places: [Vec<f64>; 3],
    /// Of every 64 facets, one after the other, a mask for each corner.
    masks: Vec<u64>,
}

impl Beyond {
    /// Looks at some corners; false where all are beyond one facet.
    fn fill(&mut self, corners: &[Point], of: &Polytope) -> bool {
        let number = corners.len();
        for (axis, places) in self.places.iter_mut().enumerate() {
            places.clear();
            places.extend(corners.iter().map(|corner| corner[axis]));
        }
        let [x, y, z] = self.places.each_ref().map(|places| &places[..number]);
        self.masks.clear();
        self.masks.resize(number * of.planes.len().div_ceil(64), 0);
        for (word, planes) in of.planes.chunks(64).enumerate() {
            let masks = &mut self.masks[word * number..][..number];
            for (bit, plane) in planes.iter().enumerate() {
                let mut all = u64::MAX;
                for corner in 0..number {
                    let height = height(plane, &[x[corner], y[corner], z[corner]]);
                    let is_beyond = if height > 0.0 { u64::MAX } else { 0 };
                    masks[corner] |= is_beyond & 1 << bit;
                    all &= is_beyond;
                }
                if all != 0 {
                    return false;
                }
            }
        }
        true
    }

    fn words(&self, corner: usize) -> impl Iterator<Item = u64> {
        self.masks.iter().skip(corner).step_by(self.places[0].len()).copied()
    }

    /// Whether a corner is beyond no facet.
    #[inline]
    fn is_inside(&self, corner: usize) -> bool {
        self.words(corner).all(|word| word == 0)
    }

    /// Whether two corners are beyond the same facet.
    #[inline]
    fn are_apart(&self, [p, q]: [usize; 2]) -> bool {
        self.words(p).zip(self.words(q)).any(|(p, q)| p & q != 0)
    }

    /// The facets that one of two corners is beyond, in their order.
    fn of_either(&self, [p, q]: [usize; 2]) -> impl Iterator<Item = usize> {
        let words = self.words(p).zip(self.words(q)).map(|(p, q)| p | q);
        words.enumerate().flat_map(|(word, mut rest)| {
            std::iter::from_fn(move || {
                let bit = rest.trailing_zeros() as usize;
                (rest != 0).then(|| {
                    rest &= rest - 1;
                    64 * word + bit
                })
            })
        })
    }
}

/// An end of what a polytope covers of a line: where that is, and the facet that is pierced there, unless it is the line's own end.
#[derive(Clone, Copy, Debug)]
struct Cut {
    at: f64,
    facet: Option<u32>,
}

/// All of a line.
const WHOLE: [Cut; 2] = [Cut { at: 0.0, facet: None }, Cut { at: 1.0, facet: None }];

/// Takes away what is beyond a facet, given how high above it a line begins and ends: not both are beyond. Whether something is left.
#[inline]
fn cut(cuts: &mut [Cut; 2], [from, to]: [f64; 2], facet: u32) -> bool {
    let at = from / (from - to);
    let cut = Cut { at, facet: Some(facet) };
    if from > 0.0 {
        if at > cuts[0].at {
            cuts[0] = cut;
        }
    } else if at < cuts[1].at {
        cuts[1] = cut;
    }
    cuts[0].at < cuts[1].at
}

/// What a polytope covers of the way from p to q, given the facets that one of them is beyond; no facet parts both.
fn covered(polytopes: &Polytopes, index: u32, [p, q]: [&Point; 2], facets: impl Iterator<Item = usize>) -> Option<[Cut; 2]> {
    let planes = &polytopes.of(index).planes;
    let mut cuts = WHOLE;
    for facet in facets {
        if !cut(&mut cuts, [p, q].map(|x| height(&planes[facet], x)), facet_number(index, facet)) {
            return None;
        }
    }
    Some(cuts)
}

/// The same where nothing is known of its facets, but one that may part both from it: others are likely to be parted by the same one.
fn covered_of_line(polytopes: &Polytopes, index: u32, [p, q]: [&Point; 2], parting: &mut u16) -> Option<[Cut; 2]> {
    let planes = &polytopes.of(index).planes;
    let heights = |facet: usize| [p, q].map(|x| height(&planes[facet], x));
    let are_beyond = |heights: [f64; 2]| heights[0] > 0.0 && heights[1] > 0.0;
    if are_beyond(heights(usize::from(*parting))) {
        return None;
    }
    let mut cuts = WHOLE;
    for facet in 0..planes.len() {
        let heights = heights(facet);
        if are_beyond(heights) {
            *parting = facet as u16;
            return None;
        }
        if (heights[0] > 0.0 || heights[1] > 0.0) && !cut(&mut cuts, heights, facet_number(index, facet)) {
            return None;
        }
    }
    Some(cuts)
}

/// What is left of a line from 0 to 1 when intervals are taken away: ends with their names.
///
/// Cells that share a facet cover what is on both sides of it; where three of them meet rounding may leave a crack, which is none of the union's.
fn uncovered(
    polytopes: &Polytopes,
    cuts: &mut [[Cut; 2]],
    ends: [Name; 2],
    name: impl Fn(u32) -> Name,
    mut visit: impl FnMut([(f64, Name); 2]),
) {
    cuts.sort_unstable_by(|a, b| a[0].at.total_cmp(&b[0].at));
    let mut from = Cut { at: 0.0, facet: None };
    let named = |cut: &Cut, end: Name| (cut.at, cut.facet.map_or(end, &name));
    for [start, end] in cuts.iter() {
        let is_crack = || matches!((from.facet, start.facet), (Some(p), Some(q)) if polytopes.are_inside([p, q]));
        if start.facet.is_some() && start.at > from.at && !is_crack() {
            visit([named(&from, ends[0]), named(start, ends[1])]);
        }
        if end.facet.is_none() {
            return;
        }
        if end.at > from.at {
            from = *end;
        }
    }
    visit([named(&from, ends[0]), (1.0, ends[1])]);
}

/// A place where an edge of one of two polytopes pierces a facet of the other: on facets of the first and of the second.
#[derive(Clone, Copy)]
struct Pierced {
    facets: [u32; 2],
    name: Name,
    at: Point,
}

/// Working memory.
#[derive(Default)]
struct Scratch {
    beyond: Beyond,
    /// Of every edge of a polytope, what others cover, and whether one covers all of it.
    cuts: Vec<Vec<[Cut; 2]>>,
    is_gone: Vec<bool>,
    found: Vec<Pierced>,
    line: Vec<[Cut; 2]>,
    /// The polytopes that a polytope meets, those first that covered a whole line last.
    recent: Vec<Third>,
    out: Vec<Piece>,
}

/// A polytope that may cover lines of two others.
#[derive(Clone, Copy)]
struct Third {
    index: u32,
    /// A facet that parted it from a line.
    parting: u16,
}

/// What may be seen of a polytope: the edges of facets that no other hides.
#[derive(Default)]
struct Seen {
    /// Their numbers, and the places of their ends among the corners.
    edges: Vec<(u16, [u16; 2])>,
    corners: Vec<Point>,
}

impl Seen {
    fn of(polytope: &Polytope, hidden: &Mask) -> Self {
        let structure = &polytope.structure;
        let is_seen = |edge: &Edge| edge.facets.iter().any(|&facet| !hidden.has(usize::from(facet)));
        let edges = || structure.edges.iter().enumerate().filter(|(_, edge)| is_seen(edge));
        let mut corners: Vec<u16> = edges().flat_map(|(_, edge)| edge.corners).collect();
        corners.sort_unstable();
        corners.dedup();
        let place = |corner: u16| corners.binary_search(&corner).unwrap_or_default() as u16;
        let edges = edges().map(|(number, edge)| (number as u16, edge.corners.map(place))).collect();
        Self { edges, corners: corners.iter().map(|&corner| polytope.corners[usize::from(corner)]).collect() }
    }
}

/// What is needed to find pieces.
struct Arrangement<'a> {
    polytopes: &'a Polytopes,
    met: &'a [Vec<u32>],
    hidden: &'a [Mask],
    seen: &'a [Seen],
}

impl Arrangement<'_> {
    /// Whether a facet, numbered within its polytope, may be seen.
    #[inline]
    fn is_seen(&self, index: u32, facet: u16) -> bool {
        !self.hidden[index as usize].has(usize::from(facet))
    }

    /// Pieces of a polytope's edges, and of the lines where it meets later ones.
    fn of(&self, index: u32, scratch: &mut Scratch) {
        let seen = &self.seen[index as usize];
        if seen.edges.is_empty() {
            return;
        }
        let number = self.polytopes.structure(index).edges.len();
        scratch.is_gone.clear();
        scratch.is_gone.resize(number, false);
        scratch.cuts.resize_with(number.max(scratch.cuts.len()), Vec::new);
        scratch.cuts.iter_mut().for_each(Vec::clear);
        scratch.recent.clear();
        scratch.recent.extend(self.met[index as usize].iter().map(|&index| Third { index, parting: 0 }));
        for &other in &self.met[index as usize] {
            scratch.found.clear();
            self.pierce(index, other, true, other > index, scratch);
            if other > index {
                self.pierce(other, index, false, true, scratch);
                self.lines(other, scratch);
            }
        }
        self.edges(index, scratch);
    }

    /// Finds where the edges of one polytope pierce the facets of another; its own cuts are kept, and places where lines of both end.
    fn pierce(&self, index: u32, other: u32, is_first: bool, with_lines: bool, scratch: &mut Scratch) {
        let (structure, seen) = (self.polytopes.structure(index), &self.seen[index as usize]);
        if !scratch.beyond.fill(&seen.corners, self.polytopes.of(other)) {
            return;
        }
        for &(number, ends) in &seen.edges {
            let (number, ends) = (usize::from(number), ends.map(usize::from));
            if scratch.beyond.are_apart(ends) {
                continue;
            }
            let (edge, [p, q]) = (&structure.edges[number], ends.map(|end| &seen.corners[end]));
            let Some(cuts) = covered(self.polytopes, other, [p, q], scratch.beyond.of_either(ends)) else { continue };
            if is_first {
                scratch.is_gone[number] |= cuts.iter().all(|cut| cut.facet.is_none());
                scratch.cuts[number].push(cuts);
            }
            if !with_lines {
                continue;
            }
            for (at, theirs) in cuts.iter().filter_map(|cut| cut.facet.map(|facet| (cut.at, facet))) {
                if self.hidden[other as usize].has(owner(theirs).1) {
                    continue;
                }
                let name = pierced(self.polytopes.seam(index, number).name, theirs);
                let at = between(p, q, at);
                for &facet in edge.facets.iter().filter(|&&facet| self.is_seen(index, facet)) {
                    let own = facet_number(index, usize::from(facet));
                    scratch.found.push(Pierced { facets: if is_first { [own, theirs] } else { [theirs, own] }, name, at });
                }
            }
        }
    }

    /// What other polytopes leave of a polytope's own edges.
    fn edges(&self, index: u32, scratch: &mut Scratch) {
        let (structure, corners) = (self.polytopes.structure(index), &self.polytopes.of(index).corners);
        let Scratch { cuts, is_gone, out, .. } = scratch;
        let numbers = self.seen[index as usize].edges.iter().map(|&(number, _)| usize::from(number));
        for number in numbers.filter(|&number| !is_gone[number]) {
            let edge = &structure.edges[number];
            let [p, q] = edge.corners.map(usize::from);
            let seam = self.polytopes.seam(index, number);
            let Some(facets) = seam.facets else { continue };
            let name = |facet| pierced(seam.name, facet);
            let ends = edge.corners.map(|at| corner(self.polytopes.corner_name(index, usize::from(at))));
            uncovered(self.polytopes, &mut cuts[number], ends, name, |ends| {
                out.push(piece(facets, ends, |at| between(&corners[p], &corners[q], at)));
            });
        }
    }

    /// What other polytopes leave of the lines where two meet.
    fn lines(&self, other: u32, scratch: &mut Scratch) {
        let Scratch { found, line, recent, out, .. } = scratch;
        let joined = self.polytopes.joined(other);
        found.sort_unstable_by_key(|pierced| (pierced.facets, pierced.name));
        // Two facets meet in one line, with two ends; where rounding says otherwise, the boundary is not closed.
        for pair in found.chunk_by(|a, b| a.facets == b.facets).filter(|pair| pair.len() == 2) {
            let facets = pair[0].facets;
            let [own, theirs] = facets.map(|facet| normal(self.polytopes.plane(facet)));
            let along = cross(&theirs, &own);
            let is_forward = dot(&along, &subtract(&pair[1].at, &pair[0].at)) > 0.0;
            let (p, q) = if is_forward { (&pair[0], &pair[1]) } else { (&pair[1], &pair[0]) };
            line.clear();
            let mut is_gone = false;
            for place in 0..recent.len() {
                let Third { index: third, ref mut parting } = recent[place];
                if third == other || joined.contains(&third) || !self.polytopes.of(third).may_meet(&p.at, &q.at) {
                    continue;
                }
                let Some(cuts) = covered_of_line(self.polytopes, third, [&p.at, &q.at], parting) else { continue };
                if cuts.iter().all(|cut| cut.facet.is_none()) {
                    is_gone = true;
                    recent[..=place].rotate_right(1);
                    break;
                }
                line.push(cuts);
            }
            if !is_gone {
                let name = |facet| meeting([facets[0], facets[1], facet]);
                uncovered(self.polytopes, line, [p.name, q.name], name, |ends| {
                    out.push(piece(facets, ends, |at| between(&p.at, &q.at, at)));
                });
            }
        }
    }
}

/// The piece of an edge or a line with two facets, between two places of it.
fn piece(facets: [u32; 2], ends: [(f64, Name); 2], place: impl Fn(f64) -> Point) -> Piece {
    Piece { facets, ends: ends.map(|(_, name)| name), places: ends.map(|(at, _)| place(at)) }
}
