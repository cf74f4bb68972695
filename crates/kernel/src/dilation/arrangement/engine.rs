//! One trial of an arrangement: polytopes that are changed until the topology of their union is that of the dilation, and its boundary.
//!
//! A set of sites is in doubt where it is not shown that the polytopes have a common point exactly where the dilations have one. Where these have one, polytopes that are around the dilations have it, too. Where they have none, there are half-spaces, each around one of
//! the dilations, without a common point: polytopes that are cut by these have none either, however coarse they are, and still are around the dilations if they were. So polytopes only become finer where rounding does not let the planes be told apart.

use super::bodies::{Bodies, Common};
use super::figure::{Figure, Outline};
use super::form::{Form, Kind};
use super::nerve::{Change, Doubt, Sets};
use super::pieces::{self, Lists};
use super::polytopes::{self, Cut, Plane, Polytope, Polytopes, Shell};
use super::tubes::{Loose, Tubes};
use super::{Arranged, Arrangement, Copies};
use super::{facets, hull};
use crate::budget::{Budget, Stopped};
use crate::dilation::convex::Convex;
use crate::dilation::setting::Setting;
use crate::dilation::surface::BlockSurface;
use crate::solid::Inside;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::sync::OnceLock;

/// Doubts that polytopes may leave, as a share of the sites, and in any case. Nearly all of them end in the next rounds; with more, the lattice costs less.
const MOST_DOUBTS: f64 = 20.0;
const FEW_DOUBTS: f64 = 1_000.0;
/// Rounds in which polytopes are changed, at most: two to six are enough nearly always.
const MOST_ROUNDS: u32 = 32;
/// Planes that part a site's polytope from others, on average over a set.
const MOST_PLANES: usize = 64;
/// How much narrower the band of finer polytopes is, level by level.
const FINER: f64 = 3.0;
/// Levels at most.
const LEVELS: u32 = 5;
/// What is tried where rounding leaves a boundary open.
pub(super) const TRIALS: u64 = 3;

/// What a site's polytope is like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct State {
    level: u32,
    /// Whether it is around the dilation by r.
    is_around: bool,
}

impl State {
    /// Below 256.
    fn number(self) -> u64 {
        u64::from(2 * self.level) + u64::from(self.is_around)
    }
}

impl Setting {
    /// The band of a site's polytope.
    pub(super) fn shell(&self, figure: &Figure, state: State) -> Shell {
        let [inner, radius, outer] = [self.least, self.reach, self.outer].map(|distance| figure.in_space(distance));
        let share = FINER.powi(-(state.level as i32));
        let inner = if state.is_around { radius } else { radius - share * (radius - inner) };
        Shell { inner: inner + self.slack, outer: radius + share * (outer - radius) - self.slack }
    }

    /// The form of polytopes for a state; none where none is fine enough.
    fn form(&self, sites: &[Figure], kind: Kind, state: State) -> Option<Form> {
        let reaches = sites.iter().map(|site| self.shell(site, state).reach());
        Form::within(reaches.fold(f64::INFINITY, f64::min), kind)
    }
}

/// The forms of an arrangement by their states, and where there is none: to look for one takes as long as hundreds of polytopes, so it is done once.
#[derive(Default)]
pub(super) struct Forms([[[OnceLock<Option<Form>>; 4]; 2]; LEVELS as usize]);

impl Forms {
    /// The form for a state below [`LEVELS`].
    pub(super) fn of(&self, setting: &Setting, sites: &[Figure], kind: Kind, state: State) -> Option<&Form> {
        let place = &self.0[state.level as usize][usize::from(state.is_around)][kind as usize];
        place.get_or_init(|| setting.form(sites, kind, state)).as_ref()
    }
}

/// What a trial came to.
pub(super) enum Run {
    Done(Box<Arranged>),
    /// Where bends are in doubt: without them bodies can be changed.
    Bent(Loose),
    /// The boundary is not closed.
    Open,
    /// The topology is in doubt at too many places.
    Doubtful,
}

pub(super) struct Engine<'a> {
    setting: &'a Setting,
    pub(super) sites: &'a [Figure],
    beyond: &'a [Box<[Option<f64>]>],
    near: &'a Lists,
    forms: &'a Forms,
    tubes: &'a Tubes,
    copies: &'a Copies,
    solids: &'a [Inside<'a>],
    pub(super) polytopes: Polytopes,
    states: Vec<State>,
    /// The sets of sites whose dilations are parted by planes, and the planes that every site's is below.
    parted: BTreeSet<Vec<u32>>,
    planes: Vec<Vec<Plane>>,
    trial: u64,
}

impl<'a> Engine<'a> {
    pub(super) fn new(arrangement: &'a Arrangement, trial: u64, solids: &'a [Inside<'a>]) -> Self {
        let Arrangement { setting, sites, beyond, near, forms, tubes, copies, .. } = arrangement;
        let sites = &sites.list;
        Self {
            setting,
            sites,
            beyond,
            near,
            forms,
            tubes,
            copies,
            solids,
            polytopes: Polytopes::default(),
            states: vec![State::default(); sites.len()],
            parted: BTreeSet::new(),
            planes: vec![Vec::new(); sites.len()],
            trial,
        }
    }

    /// What comes of the polytopes that there are, or of the first ones. The boundary is made of the cells, instead of the bodies with their numbers.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn run(&mut self, cells: Vec<(u32, Polytope)>, budget: &Budget) -> Result<Run, Stopped> {
        if self.polytopes.all.is_empty() && !self.begin(budget)? {
            return Ok(Run::Open);
        }
        let Some(mut sets) = Sets::new(&self.bodies(), budget)? else { return Ok(Run::Doubtful) };
        let mut changes = vec![Change::Other; self.sites.len()];
        let most = (MOST_DOUBTS * self.sites.len() as f64).max(FEW_DOUBTS) as usize;
        for round in 0.. {
            if changes.iter().all(|&change| change == Change::Nothing) {
                break;
            }
            if round == MOST_ROUNDS || !sets.look(&self.bodies(), &changes, most, budget)? {
                return Ok(Run::Doubtful);
            }
            let doubts = sets.doubts();
            let loose = self.tubes.ends(doubts.iter().flat_map(|doubt| doubt.sites.iter().copied()));
            if !loose.is_empty() {
                return Ok(Run::Bent(loose));
            }
            changes = self.refine(&doubts, budget)?;
        }
        // Where solids are in doubt, it may be about what is inside of them, which a lattice does not look at.
        if !self.solids.is_empty() && !sets.doubts().is_empty() {
            return Ok(Run::Doubtful);
        }
        cells.into_iter().for_each(|(index, cell)| self.polytopes.all[index as usize] = cell);
        let pieces = pieces::find(&self.polytopes, self.near, budget)?;
        let Some(boundary) = facets::boundary(&self.polytopes, pieces, budget)? else { return Ok(Run::Open) };
        let surface = BlockSurface { vertices: boundary.points, triangles: boundary.triangles, ..BlockSurface::default() };
        // A set is as often there as its part.
        let times = |doubt: &Doubt| self.copies.times(&self.sites[doubt.sites[0] as usize]);
        Ok(Run::Done(Box::new(Arranged { surface, uncertain: sets.doubts().iter().map(times).sum(), is_done: false })))
    }

    pub(super) fn bodies(&self) -> Bodies<'_> {
        Bodies { setting: self.setting, figures: self.sites, polytopes: &self.polytopes, solids: self.solids }
    }

    /// Makes the first polytopes; whether there are such.
    pub(super) fn begin(&mut self, budget: &Budget) -> Result<bool, Stopped> {
        let first = |index: usize| {
            budget.cancel.check()?;
            Ok(self.polytope(index, State::default()))
        };
        let all: Option<Vec<Polytope>> = (0..self.tubes.figures).into_par_iter().map(first).collect::<Result<_, Stopped>>()?;
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

    /// The same without these planes.
    fn whole(&self, index: usize, state: State) -> Option<Polytope> {
        let (figure, beyond) = (&self.sites[index], &self.beyond[index]);
        let shell = self.setting.shell(figure, state);
        let seed = (self.trial << 8 | state.number()) << 32 | index as u64;
        // Planes may meet in a point by chance, not again and again.
        let mut seeds = (0..TRIALS).map(|trial| seed ^ trial << 48);
        match &figure.outline {
            Outline::Polygon(_) => return seeds.find_map(|seed| Polytope::around(figure, beyond, shell, seed)),
            Outline::Polyhedron(polyhedron) => return seeds.find_map(|seed| Polytope::enclosing(polyhedron, shell, seed)),
            Outline::Point(_) | Outline::Segment(_) => {}
        }
        let most = self.setting.shell(figure, State::default()).outer;
        let cut = Cut { beyond: [beyond[0], beyond[1]], most };
        // Where a cut far out leaves a form no room, a finer one may have some.
        let of_level = |kind: Kind, level: u32| self.forms.of(self.setting, self.sites, kind, State { level, ..state });
        if let Some(rod) = self.tubes.rod(index as u32) {
            return Polytope::new(figure, of_level(rod.kind, state.level)?, shell, cut, Some(rod), seed);
        }
        let kind = polytopes::kind(figure);
        (state.level..LEVELS).find_map(|level| Polytope::new(figure, of_level(kind, level)?, shell, cut, None, seed))
    }

    /// Changes polytopes of sites in doubt, and returns how. Where dilations have no common point, planes between them part the polytopes, too; where they have one, polytopes are around the dilations; and where that was done,
    /// or it is not known, they become finer as far as there are forms.
    pub(super) fn refine(&mut self, doubts: &[Doubt], budget: &Budget) -> Result<Vec<Change>, Stopped> {
        let mut is_cut = vec![false; self.sites.len()];
        let mut next = self.states.clone();
        for Doubt { sites, wanted } in doubts {
            budget.cancel.check()?;
            let is_new = match wanted {
                Common::None if self.parted.insert(sites.clone()) => {
                    let known: Vec<Plane> = sites.iter().flat_map(|&site| &self.planes[site as usize]).copied().collect();
                    let has_room = known.len() < MOST_PLANES * sites.len();
                    let seed = self.trial << 32 | self.parted.len() as u64;
                    let planes = if has_room { self.bodies().parting(sites, &known, seed) } else { Vec::new() };
                    for (site, plane) in planes {
                        self.planes[site as usize].push(plane);
                        is_cut[site as usize] = true;
                    }
                    // Several sets often have no common point for the same reason.
                    sites.iter().any(|&site| is_cut[site as usize])
                }
                Common::Some => {
                    let short = self.bodies().short(sites);
                    short.iter().for_each(|&site| next[site as usize].is_around = true);
                    short.iter().any(|&site| !self.states[site as usize].is_around)
                }
                _ => false,
            };
            if !is_new {
                sites.iter().for_each(|&site| next[site as usize].level = self.states[site as usize].level + 1);
            }
        }
        let made = |index: usize| {
            budget.cancel.check()?;
            let (before, state) = (self.states[index], next[index]);
            let made = |state: State| self.polytope(index, state).map(|polytope| (state, polytope));
            // Where both cannot be had, one of them, or what is finer instead; planes may cut what is as it was.
            let finer = State { level: before.level + 1, ..before };
            let all = [state, State { level: before.level, ..state }, State { is_around: before.is_around, ..state }, finer, before];
            if state == before && !is_cut[index] {
                return Ok(None);
            }
            let mut wanted = all.into_iter().filter(|&state| state.level < LEVELS && (state != before || is_cut[index]));
            Ok(wanted.find_map(made))
        };
        let made: Vec<Option<(State, Polytope)>> = (0..next.len()).into_par_iter().map(made).collect::<Result<_, Stopped>>()?;
        let mut changes = vec![Change::Nothing; made.len()];
        for (index, made) in made.into_iter().enumerate() {
            if let Some((state, polytope)) = made {
                changes[index] = match state {
                    state if state == self.states[index] => Change::Cut,
                    State { is_around: true, .. } => Change::Around,
                    State { is_around: false, .. } => Change::Other,
                };
                self.states[index] = state;
                self.polytopes.all[index] = polytope;
            }
        }
        Ok(changes)
    }
}
