//! Thickening of points, segments, polygons and solids by the union of a polytope around each: where few are near to each other, the boundary is found facet by facet, without a lattice.
//!
//! With s < r < outer the ends of the band, figure S_i (see `figure`) has a polytope P_i between its dilations: D_s(S_i) in P_i in D_outer(S_i). So the union M of all has D_s(S) in M in D_outer(S). That is so, too,
//! where all of them are cut across the end of a segment, or the side of a polygon, that meets others, see `joints` and `hinges`. Of solids the surfaces are sites, and what lies inside is left out at the end, see `solids`. The boundary of M consists of parts of facets, see `pieces` and `facets`. Its topology is that of D(r) where
//! `nerve` shows it; where that is in doubt, polytopes are changed until it does.

mod bodies;
mod covering;
mod facets;
mod figure;
mod form;
mod hinges;
mod hull;
mod index;
mod joints;
mod nerve;
mod pieces;
mod polytopes;
mod solids;
mod structure;
#[cfg(test)]
mod tests;
mod triangulate;

use crate::dilation::convex::Convex;
use super::plan::Setting;
use super::surface::BlockSurface;
use super::tree::{Candidates, Weighted};
use crate::attractor::cell::{Cell, ControlPoint, child_points};
use crate::attractor::sites::{SiteError, SiteRule};
use crate::budget::{Budget, Stopped};
use crate::solid::{Inside, TriMesh};
use bodies::{Bodies, Common};
use figure::{Figure, Polygon};
use form::{Form, Kind};
pub(super) use index::Index;
use nerve::{Doubt, Sets};
use pieces::{Body, Lists};
use polytopes::{Cut, MOST_POLYTOPES, Plane, Polytope, Polytopes, Shell};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::sync::OnceLock;

/// The mean square of the number of neighbours, and the mean number of sets of up to four figures that are near to each other, at most: lines are cut by all neighbours, and `nerve` looks at such
/// sets as far as all their parts meet. Where figures have more of them, most of their polytopes' facets are hidden, and the lattice, which does not tell sites apart, costs less.
const MOST_NEAR: [usize; 2] = [5_000, 250];
/// So many sets, and so many doubts that the first polytopes leave about larger ones, take as long as the lattice at one of its cubes along a polygon: with large faces there may be more of both.
const SETS_PER_CUBE: f64 = 100.0;
const DOUBTS_PER_CUBE: f64 = 0.5;
/// Of tubes so many sets at most: many of them are hidden where that many are near to each other.
const MOST_OF_TUBES: f64 = 1_000.0;
/// Doubts that polytopes may leave, of pairs and of larger sets, as shares of the sites, and in any case. Pairs nearly touch, and finer polytopes tell that they do, or do not. With more doubts of larger sets these are no matter of a few places, and finer polytopes
/// everywhere cost more than a lattice.
const MOST_DOUBTS: [f64; 2] = [4.0, 2.0];
const FEW_DOUBTS: f64 = 16.0;
/// How much narrower the band of finer polytopes is, level by level.
const FINER: f64 = 3.0;
/// How far corners may be off the plane of a union, and off a side that goes straight on, as a share of the slack that all bounds leave: in all rounds together polygons are off by a little more than half of it.
const FLATNESS: f64 = 1.0 / 128.0;
/// Levels at most.
const LEVELS: u32 = 5;
/// What is tried where rounding leaves a boundary open.
const TRIALS: u64 = 3;

/// Polytopes that tell how many triangles there will be.
const SAMPLE: usize = 64;
/// Bytes held at most for each triangle that is made: the edges of the union and their names, its boundary, and the simplification's working memory.
pub(super) const BYTES_PER_TRIANGLE: f64 = 600.0;

/// The sites of an attractor, few of them near to each other.
pub(super) struct Arrangement<'a> {
    setting: &'a Setting,
    sites: Sites,
    /// How far beyond its ends each of them is cut.
    beyond: Vec<Box<[Option<f64>]>>,
    near: Lists,
    forms: Forms,
    /// The surfaces of solids, whose triangles are among the sites.
    solids: Vec<TriMesh>,
    /// Cubes of the lattice that the faces of polygons would meet, about.
    cubes: f64,
    /// About how many triangles will be made.
    pub(super) triangles: f64,
}

/// The boundary of a union of polytopes.
pub(super) struct Arranged {
    pub(super) surface: BlockSurface,
    /// Sets of sites of which it is not proven that their polytopes have a common point exactly where their dilations have.
    pub(super) uncertain: u64,
}

impl<'a> Arrangement<'a> {
    /// The sites of an attractor; `None` where there are so many, or so near to each other, that a lattice serves better.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn new(
        setting: &'a Setting,
        rule: &SiteRule<'_>,
        candidates: &Candidates,
        budget: &Budget,
    ) -> Result<Option<Self>, Stopped> {
        if setting.dense || setting.clean_only {
            return Ok(None);
        }
        let most = (budget.limits.memory_bytes as f64 / (BYTES_PER_TRIANGLE * LEAST_TRIANGLES)) as usize;
        let Some(mut sites) = Sites::of(rule, candidates, most.min(MOST_POLYTOPES), budget)? else { return Ok(None) };
        let shell = |figure: &Figure| setting.shell(figure, State::default());
        let band = sites.list.iter().map(shell).map(|shell| shell.outer - shell.inner).fold(f64::INFINITY, f64::min);
        sites.list = figure::joined(sites.list, FLATNESS * setting.slack, hull::CORNER_SHARE * band, budget)?;
        let forms = Forms::default();
        let mut beyond = hinges::cuts(&sites.list, FLATNESS * setting.slack, shell, budget)?;
        let scales = if sites.list.iter().any(|figure| figure.polygon().is_none() && polytopes::kind(figure) == Kind::Rod) {
            let Some(form) = forms.of(setting, &sites.list, Kind::Rod, State::default()) else { return Ok(None) };
            [form.covering.reach, form.covering.girth]
        } else {
            [1.0; 2]
        };
        for (beyond, cut) in beyond.iter_mut().zip(joints::cuts(&sites.list, FLATNESS * setting.slack, scales, shell)).filter(|(beyond, _)| beyond.is_empty()) {
            *beyond = Box::new(cut);
        }
        let reach = |figure: &Figure| figure.in_space(setting.outer) + setting.slack;
        let bodies = sites.list.iter().zip(&beyond);
        let bodies: Vec<Body<'_>> =
            bodies.map(|(figure, beyond)| Body { figure, reach: reach(figure), cuts: joints::planes(figure, beyond) }).collect();
        // Both sides of all polygons.
        let areas = sites.list.iter().filter_map(Figure::polygon).map(Polygon::double);
        let cubes = areas.sum::<f64>() / setting.lattice.pitch.powi(2);
        // The sides of tubes.
        let lengths = sites.list.iter().filter(|figure| figure.polygon().is_none()).map(Figure::length);
        let around = TAU * setting.reach * lengths.sum::<f64>() / setting.lattice.pitch.powi(2);
        let per_body = |cubes: f64| SETS_PER_CUBE * cubes / sites.list.len() as f64;
        let sets = (per_body(cubes) + per_body(around).min(MOST_OF_TUBES)) as usize;
        let Some(near) = pieces::near(&bodies, [MOST_NEAR[0], MOST_NEAR[1].max(sets)], budget)? else { return Ok(None) };
        drop(bodies);
        let solids = rule.attractor().surfaces();
        // About half of what is around the faces of solids is inside of these.
        let inside = 0.5 * solids.iter().map(|solid| solid.triangles.len()).sum::<usize>() as f64 / sites.leaves as f64;
        let mut arrangement = Self { setting, sites, beyond, near, forms, solids, cubes, triangles: 0.0 };
        arrangement.triangles = (1.0 - inside) * arrangement.expected_triangles(budget)?;
        let fits = arrangement.triangles * BYTES_PER_TRIANGLE < budget.limits.memory_bytes as f64;
        Ok(fits.then_some(arrangement))
    }

    /// Leaf cells of the attractor.
    pub(super) fn leaves(&self) -> u64 {
        self.sites.leaves
    }

    /// About how many triangles will be made, from a sample of the polytopes; infinitely many where there is no polytope.
    ///
    /// # Errors
    /// [`Stopped`].
    fn expected_triangles(&self, budget: &Budget) -> Result<f64, Stopped> {
        let mut engine = self.engine(0, &[]);
        if !engine.begin(budget)? {
            return Ok(f64::INFINITY);
        }
        let count = self.sites.list.len();
        let step = count.div_ceil(SAMPLE).max(1);
        let sample: Vec<u32> = (0..count as u32).step_by(step).collect();
        let triangles = pieces::count(&engine.polytopes, &self.near, &sample);
        Ok(triangles as f64 * count as f64 / sample.len() as f64)
    }

    /// The boundary of the union of polytopes; `None` where none could be found.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn run(&self, budget: &Budget) -> Result<Option<Arranged>, Stopped> {
        let solids: Vec<Inside<'_>> = self.solids.iter().map(Inside::new).collect();
        for trial in 0..TRIALS {
            match self.engine(trial, &solids).run(budget)? {
                Run::Done(mut arranged) => {
                    if !solids::leave_out(&solids, &mut arranged.surface) {
                        break;
                    }
                    arranged.surface.leaves = self.sites.leaves;
                    arranged.surface.site_error = self.sites.error;
                    return Ok(Some(*arranged));
                }
                Run::Open => {}
                Run::Doubtful => break,
            }
        }
        Ok(None)
    }

    /// Its figures, for searches.
    pub(super) fn into_index(self) -> Index {
        Index::new(self.sites.list, self.setting.slack)
    }

    fn engine<'b>(&'b self, trial: u64, solids: &'b [Inside<'b>]) -> Engine<'b> {
        let sites = &self.sites.list;
        let states = vec![State::default(); sites.len()];
        let Self { setting, beyond, near, forms, cubes, .. } = self;
        Engine { setting, sites, beyond, near, forms, solids, cubes: *cubes, polytopes: Polytopes::default(), states, parted: BTreeSet::new(), planes: vec![Vec::new(); sites.len()], trial }
    }
}

/// Triangles of a polytope that little is near to, about: with more sites than memory has room for that many, polytopes are not even begun.
const LEAST_TRIANGLES: f64 = 24.0;

/// All sites of an attractor.
#[derive(Default)]
struct Sites {
    list: Vec<Figure>,
    /// The largest errors of leaves.
    error: SiteError,
    leaves: u64,
}

impl Sites {
    /// The sites below some candidates, if there are at least one and at most `most`.
    fn of(rule: &SiteRule<'_>, candidates: &Candidates, most: usize, budget: &Budget) -> Result<Option<Self>, Stopped> {
        let attractor = rule.attractor();
        let mut found = Self::default();
        let mut open: Vec<(Cell, Vec<ControlPoint>)> = Vec::new();
        for candidate in &candidates.cells {
            open.push((candidate.cell, candidates.points_of(attractor, candidate).to_vec()));
            while let Some((cell, points)) = open.pop() {
                if let Some(error) = rule.leaf(&cell, &points) {
                    let deficit = rule.deficit(cell.root);
                    rule.emit(&cell, &points, &mut |site| found.list.push(Weighted { site, deficit }.into()));
                    found.error = found.error.max(error);
                    found.leaves += 1;
                    if found.list.len() > most {
                        return Ok(None);
                    }
                    continue;
                }
                budget.cancel.check()?;
                for (index, transition) in attractor.state_of(&cell).transitions.iter().enumerate().rev() {
                    let mut child = vec![[0.0; 4]; transition.operator.columns()];
                    child_points(&points, &transition.operator, &mut child);
                    open.push((attractor.child_cell(&cell, index, &child), child));
                }
            }
        }
        Ok((!found.list.is_empty()).then_some(found))
    }
}

/// Which side of the dilation by r a polytope keeps to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Side {
    #[default]
    Both,
    Within,
    Around,
}

/// What a site's polytope is like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct State {
    level: u32,
    side: Side,
}

impl State {
    /// Below 256.
    fn number(self) -> u64 {
        u64::from(2 * self.level) + u64::from(self.side != Side::Both)
    }
}

impl Setting {
    /// The band of a site's polytope.
    fn shell(&self, figure: &Figure, state: State) -> Shell {
        let [inner, radius, outer] = [self.least, self.reach, self.outer].map(|distance| figure.in_space(distance));
        let share = FINER.powi(-(state.level as i32));
        let inner = if state.side == Side::Around { radius } else { radius - share * (radius - inner) };
        let outer = if state.side == Side::Within { radius } else { radius + share * (outer - radius) };
        Shell { inner: inner + self.slack, outer: outer - self.slack }
    }

    /// The form of polytopes for a state, which keep to one side, whichever, or to both; none where none is fine enough.
    fn form(&self, sites: &[Figure], kind: Kind, state: State) -> Option<Form> {
        let sides: &[Side] = if state.side == Side::Both { &[Side::Both] } else { &[Side::Within, Side::Around] };
        let shells = sites.iter().flat_map(|site| sides.iter().map(|&side| self.shell(site, State { side, ..state })));
        Form::within(shells.map(Shell::reach).fold(f64::INFINITY, f64::min), kind)
    }
}

/// The forms of an arrangement by their states, and where there is none: to look for one takes as long as hundreds of polytopes, so it is done once.
#[derive(Default)]
struct Forms([[[OnceLock<Option<Form>>; 2]; 2]; LEVELS as usize]);

impl Forms {
    /// The form for a state below [`LEVELS`].
    fn of(&self, setting: &Setting, sites: &[Figure], kind: Kind, state: State) -> Option<&Form> {
        let place = &self.0[state.level as usize][usize::from(state.side != Side::Both)][kind as usize];
        place.get_or_init(|| setting.form(sites, kind, state)).as_ref()
    }
}

/// What a trial came to.
enum Run {
    Done(Box<Arranged>),
    /// The boundary is not closed.
    Open,
    /// The topology is in doubt at too many places.
    Doubtful,
}

struct Engine<'a> {
    setting: &'a Setting,
    sites: &'a [Figure],
    beyond: &'a [Box<[Option<f64>]>],
    near: &'a Lists,
    forms: &'a Forms,
    solids: &'a [Inside<'a>],
    cubes: f64,
    polytopes: Polytopes,
    states: Vec<State>,
    /// The sets of sites whose dilations are parted by planes, and the planes that every site's is below.
    parted: BTreeSet<Vec<u32>>,
    planes: Vec<Vec<Plane>>,
    trial: u64,
}

impl Engine<'_> {
    fn run(&mut self, budget: &Budget) -> Result<Run, Stopped> {
        if !self.begin(budget)? {
            return Ok(Run::Open);
        }
        let (mut changed, mut sets) = (vec![true; self.sites.len()], Sets::default());
        let most = MOST_DOUBTS.map(|share| (share * self.sites.len() as f64).max(FEW_DOUBTS) as usize);
        // The first polytopes are as coarse as they may be.
        let mut allowed = [most[0], most[1].max((DOUBTS_PER_CUBE * self.cubes) as usize)];
        while changed.contains(&true) {
            if !sets.look(&self.bodies(), &changed, allowed, budget)? {
                return Ok(Run::Doubtful);
            }
            allowed = most;
            changed = self.refine(sets.doubts());
        }
        // Where solids are in doubt, it may be about what is inside of them, which a lattice does not look at.
        if !self.solids.is_empty() && !sets.doubts().is_empty() {
            return Ok(Run::Doubtful);
        }
        let pieces = pieces::find(&self.polytopes, self.near, budget)?;
        let Some(boundary) = facets::boundary(&self.polytopes, &pieces, budget)? else { return Ok(Run::Open) };
        let surface = BlockSurface { vertices: boundary.points, triangles: boundary.triangles, ..BlockSurface::default() };
        Ok(Run::Done(Box::new(Arranged { surface, uncertain: sets.doubts().len() as u64 })))
    }

    fn bodies(&self) -> Bodies<'_> {
        Bodies { setting: self.setting, figures: self.sites, polytopes: &self.polytopes, near: self.near, solids: self.solids }
    }

    /// Makes the first polytopes; whether there are such.
    fn begin(&mut self, budget: &Budget) -> Result<bool, Stopped> {
        let first = |index: usize| {
            budget.cancel.check()?;
            Ok(self.polytope(index, State::default()))
        };
        let all: Option<Vec<Polytope>> = (0..self.sites.len()).into_par_iter().map(first).collect::<Result<_, Stopped>>()?;
        let is_made = all.is_some();
        self.polytopes.all = all.unwrap_or_default();
        Ok(is_made)
    }

    /// A site's polytope in a state, below the planes that part it from others; none where no form is fine enough, or no shift fits.
    fn polytope(&self, index: usize, state: State) -> Option<Polytope> {
        let noise = hull::NOISE * self.setting.outer;
        let whole = self.whole(index, state)?;
        Some(self.planes[index].iter().fold(whole, |polytope, plane| polytope.below(plane, noise).unwrap_or(polytope)))
    }

    fn whole(&self, index: usize, state: State) -> Option<Polytope> {
        let (figure, beyond) = (&self.sites[index], &self.beyond[index]);
        let shell = self.setting.shell(figure, state);
        let seed = (self.trial << 8 | state.number()) << 32 | index as u64;
        if figure.polygon().is_some() {
            // Planes may meet in a point by chance, not again and again.
            return (0..TRIALS).find_map(|trial| Polytope::around(figure, beyond, shell, seed ^ trial << 48));
        }
        let most = self.setting.shell(figure, State::default()).outer;
        let cut = Cut { beyond: [beyond[0], beyond[1]], most };
        // Where a cut far out leaves a form no room, a finer one may have some.
        let of_level = |level: u32| self.forms.of(self.setting, self.sites, polytopes::kind(figure), State { level, ..state });
        (state.level..LEVELS).find_map(|level| Polytope::new(figure, of_level(level)?, shell, cut, seed))
    }

    /// Changes polytopes of sites in doubt, and returns which ones are others now. Where dilations have no common point, planes between them part the polytopes, too; where they have one, polytopes are around the dilations; and where that was done,
    /// or it is not known, they become finer as far as there are forms.
    fn refine(&mut self, doubts: &[Doubt]) -> Vec<bool> {
        let mut changed = vec![false; self.sites.len()];
        let mut next = self.states.clone();
        for Doubt { sites, wanted } in doubts {
            let is_new = match wanted {
                Common::None if self.parted.insert(sites.clone()) => {
                    let known: Vec<Plane> = sites.iter().flat_map(|&site| &self.planes[site as usize]).copied().collect();
                    let planes = self.bodies().parting(sites, &known, self.parted.len() as u64);
                    for &(site, plane) in planes.iter().flatten() {
                        self.planes[site as usize].push(plane);
                        changed[site as usize] = true;
                    }
                    planes.is_some()
                }
                Common::Some => {
                    let mut is_new = false;
                    for &site in sites {
                        is_new |= self.states[site as usize].side == Side::Both;
                        next[site as usize].side = Side::Around;
                    }
                    is_new
                }
                _ => false,
            };
            if !is_new {
                sites.iter().for_each(|&site| next[site as usize].level = self.states[site as usize].level + 1);
            }
        }
        for (index, next) in next.into_iter().enumerate() {
            let is_other = next != self.states[index];
            if !(is_other || changed[index]) {
                continue;
            }
            let made = |state: State| self.polytope(index, state).map(|polytope| (state, polytope));
            let other = if is_other && next.level < LEVELS { made(next) } else { None };
            let made = if changed[index] { other.or_else(|| made(self.states[index])) } else { other };
            changed[index] = made.is_some();
            if let Some((state, polytope)) = made {
                self.states[index] = state;
                self.polytopes.all[index] = polytope;
            }
        }
        changed
    }
}
