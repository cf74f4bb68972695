//! Thickening of points, segments, polygons, polyhedra and solids by the union of a polytope around each: where few are near to each other, the boundary is found facet by facet, without a lattice.
//!
//! With s < r < outer the ends of the band, figure S_i (see `figure`) has a polytope P_i between its dilations: D_s(S_i) in P_i in D_outer(S_i). So the union M of all has D_s(S) in M in D_outer(S). That is so, too,
//! where all of them are cut across the end of a segment, or the side of a polygon, that meets others, see `joints` and `hinges`. Of solids the surfaces are sites, and what lies inside is left out at the end, see `solids`. The boundary of M consists of parts of facets, see `pieces` and `facets`. Its topology is that of D(r) where
//! `nerve` shows it; where that is in doubt, polytopes are changed until it does, see `engine`.
//!
//! Points and segments in one plane need no such polytopes where many are near to each other, see `planar`, nor do triangles with one height over each place of one, see `height_field`, surfaces that turn little from face to face, see `offset`, and polygons that are near to each other only where they hang together, see `sum`.

mod between;
mod bodies;
mod cells;
mod copies;
mod covering;
mod cubes;
mod dense;
mod ellipsoid;
mod engine;
mod faces;
mod facets;
mod figure;
mod form;
pub(super) mod height_field;
mod hidden;
mod hinges;
mod hull;
mod index;
mod joints;
mod nerve;
mod noise;
mod offset;
mod pieces;
mod planar;
mod plane;
mod polyhedron;
mod polytopes;
mod solids;
mod steady;
mod structure;
mod sum;
#[cfg(test)]
pub(super) mod testing;
#[cfg(test)]
mod tests;
mod triangulate;
mod tubes;

use super::flow::Flow;
use super::plan;
use super::setting::Setting;
use super::surface::BlockSurface;
use super::tree::{Candidates, Weighted};
use crate::attractor::cell::{Cell, ControlPoint, Point};
use crate::attractor::sites::{SiteError, SiteRule};
use crate::budget::{Budget, Stopped};
use crate::dilation::convex::Convex;
use crate::solid::{Inside, TriMesh};
pub(super) use copies::Copies;
pub(super) use cubes::Cube;
pub(super) use dense::is_thin;
use engine::{Engine, Forms, Run, State, TRIALS};
pub(super) use faces::{Face, Faces, without_lines};
use figure::Outline;
pub(super) use figure::{Figure, Span};
use form::Kind;
pub(super) use index::Index;
use noise::Cleared;
use pieces::{Body, Lists};
use polytopes::{MOST_POLYTOPES, Polytopes};
use std::sync::Arc;
use steady::Steady;
use tubes::{Loose, Tubes};

/// The mean square of the number of neighbours at most: lines are cut by all of them.
const MOST_NEAR: usize = 40_000;
/// Neighbours of all sites at most, for each cube of the lattice that their dilations would meet if they were alone, along polygons and around points and segments; and in any case. Where there are more, most of the polytopes' facets are hidden, and the
/// lattice, which does not tell sites apart, costs less: a sixth where there are sixteen times as many, three to seven times as much where there are a tenth. Around wires in a plane it costs less by a third already where there are a third as many; but they have a
/// third fewer triangles without it.
const NEAR_ALONG_FACES: f64 = 16.0;
const NEAR_AROUND_WIRES: f64 = 9.0;
const FEW_NEAR: f64 = 10_000.0;
/// How far corners may be off the plane of a union, and off a side that goes straight on, as a share of the slack that all bounds leave: in all rounds together polygons are off by a little more than half of it.
const FLATNESS: f64 = 1.0 / 128.0;
/// How far places may be off planes and lines that is taken for noise, in units of half the band; how many times more slack is left then, as planes are met up to some roundings only; and what must be left of the figures at most for it to be worth while.
const NOISE: f64 = 1.0 / 256.0;
const CLEARED: f64 = 1e3;
const WORTH: f64 = 0.9;
/// What rounding alone moves parts that are alike, as a share of the slack, and what rounding to single precision may be of half the band where they are looked for.
const ROUNDED: f64 = 1.0 / 32.0;
const CARRIED: f64 = 1.0 / 16.0;

/// Rounds in which bends are given up that leave no room for others; then all are.
const ROUNDS_OF_BENDS: usize = 6;

/// Sites of a lattice of which it is asked whether the topology is that of what they stand for, at most.
const MOST_STEADY: usize = 20_000;
/// The same where there is no lattice.
const MOST_ASKED: usize = 300_000;
/// Places at most where the topology of what sites stand for may be in doubt, so that finer ones are made there.
const MOST_DOUBTS: usize = 64;
/// Polytopes that tell how many triangles there will be.
const SAMPLE: u64 = 64;
/// Bytes held at most for each triangle that is made: the edges of the union and their names, its boundary, and the simplification's working memory.
const BYTES_PER_TRIANGLE: f64 = 600.0;

/// The sites of an attractor, few of them near to each other.
pub(super) struct Arrangement {
    /// With bounds that are as much narrower as sites were moved.
    setting: Setting,
    sites: Sites,
    /// How far beyond its ends each of them is cut.
    beyond: Vec<Box<[Option<f64>]>>,
    near: Lists,
    forms: Forms,
    tubes: Tubes,
    /// The ends of segments that are found to be in no bend.
    loose: Loose,
    /// Where parts were that are like others.
    copies: Arc<Copies>,
    /// The surface, where it needs no polytopes.
    flat: Option<BlockSurface>,
    /// Whether its topology is shown to be that of what the sites stand for: kept, as it takes long to show.
    is_steady: bool,
    /// Places where that is in doubt, as far as these are known, once that was asked for.
    doubts: Option<Vec<Point>>,
    /// How many points there were of which these are left, where points stand for cells.
    thinned: usize,
    /// Those that a first trial begins with.
    polytopes: Polytopes,
    /// The surfaces of solids, whose triangles are among the sites, and about which share of what is around the sites is inside of these.
    solids: Vec<TriMesh>,
    inside: f64,
    /// About how many triangles will be made, and how many there will be with those that are put elsewhere.
    made: f64,
    pub(super) triangles: f64,
}

/// What comes of figures that need no polytopes.
pub(super) enum Flat {
    Made(Box<BlockSurface>),
    /// The same, and it is shown to have the topology of what the sites stand for, too.
    Steady(Box<BlockSurface>),
    /// There would be far more triangles than may be: about how many.
    Beyond(f64),
}

/// How polytopes were begun.
enum Begun {
    Done,
    /// A lattice serves better.
    Left,
    /// There are bends that must not be, at these ends.
    Bent(Loose),
}

/// The boundary of a union of polytopes.
pub(super) struct Arranged {
    pub(super) surface: BlockSurface,
    /// Sets of sites of which it is not proven that their polytopes have a common point exactly where their dilations have.
    pub(super) uncertain: u64,
    /// Whether it needs no simplification, has coordinates that can be written, and crosses nothing.
    pub(super) is_done: bool,
}

impl Arrangement {
    /// The sites of an attractor; `None` where there are so many, or so near to each other, that a lattice serves better.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn new(setting: &Setting, rule: &SiteRule<'_>, candidates: &Candidates, budget: &Budget) -> Result<Option<Self>, Stopped> {
        if setting.clean_only {
            return Ok(None);
        }
        if setting.dense {
            return Self::of_dense(setting, rule, candidates, budget);
        }
        let memory = budget.limits.memory_bytes as f64;
        let few = ((memory / (BYTES_PER_TRIANGLE * LEAST_TRIANGLES)) as usize).min(MOST_POLYTOPES);
        let most = (memory / BYTES_PER_SITE) as usize;
        let sites = || Sites::of(rule, candidates, most_of(most, budget), budget);
        let Some((mut kinds, is_of_solid)) = sites()? else { return Ok(None) };
        let surfaces = rule.attractor().surfaces();
        let is_steady = |figures: &[Figure], off: f64| are_steady(figures, setting, off, &surfaces, budget);
        let mut copies = Copies::default();
        if kinds.list.len() <= few && setting.rounding < CARRIED * setting.half_band() {
            copies = Copies::leave_out(&mut kinds.list, &is_of_solid, &surfaces, setting, NOISE * setting.half_band(), budget)?;
            if copies.moved > ROUNDED * setting.slack && !is_steady(&copies.figures, copies.moved)? {
                let Some((all, _)) = sites()? else { return Ok(None) };
                (kinds, copies) = (all, Copies::default());
            }
        }
        let put = if copies.is_empty() { 0.0 } else { copies.moved + setting.rounding };
        kinds.is_exact = setting.off + kinds.off() == 0.0;
        let mut setting = setting.narrower(put, setting.slack);
        setting.off += kinds.off();
        let flat = match planar::surface(&kinds.list, &setting, |x| copies.rounded(x), budget)? {
            None => match height_field::surface(&kinds.list, &setting, &|x| copies.rounded(x), budget)? {
                None if setting.has_sheets => offset::surface(&kinds.list, &surfaces, &setting, |x| copies.rounded(x), budget)?,
                None => None,
                made => made,
            },
            made => made,
        };
        if let Some(flat) = flat {
            let mut arrangement = Self::empty(kinds, setting, surfaces, Arc::new(copies));
            arrangement.take(flat);
            return Ok(Some(arrangement));
        }
        if kinds.list.len() > few {
            return Ok(None);
        }
        let slack = CLEARED * setting.slack;
        let cleared = noise::cleared(&kinds.list, NOISE * setting.half_band(), [FLATNESS * setting.slack, FLATNESS * slack], budget)?;
        let Sites { error, leaves, is_exact, .. } = kinds;
        let triangles = figure::triangles(&kinds.list);
        let (plain, left) = kinds.joined(&setting, budget)?;
        let copies = Arc::new(copies);
        if let Some(Cleared { figures, moved }) = cleared {
            let narrower = setting.narrower(moved, slack);
            let triangles = figure::triangles(&figures);
            let (clear, left) = Sites { list: figures, error, leaves, is_exact }.joined(&narrower, budget)?;
            if (clear.list.len() as f64) < WORTH * plain.list.len() as f64
                && let Some(arrangement) = Self::of(clear, left, triangles, narrower, surfaces.clone(), copies.clone(), budget)?
                && is_steady(arrangement.figures(), moved + slack)?
            {
                return Ok(Some(arrangement));
            }
        }
        Self::of(plain, left, triangles, setting, surfaces, copies, budget)
    }

    /// Sheets along the sites, as those of a surface; none where they are no such surface.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn of_sheets(
        setting: &Setting,
        rule: &SiteRule<'_>,
        candidates: &Candidates,
        budget: &Budget,
    ) -> Result<Option<Self>, Stopped> {
        // As many as [`Arrangement::new`] asks for sheets.
        let most = (budget.limits.memory_bytes as f64 / BYTES_PER_SITE) as usize;
        let Some((mut sites, _)) = Sites::of(rule, candidates, most_of(most, budget), budget)? else { return Ok(None) };
        sites.is_exact = setting.off + sites.off() == 0.0;
        let copies = Copies::default();
        let surfaces = rule.attractor().surfaces();
        let Some(flat) = offset::surface(&sites.list, &surfaces, setting, |x| copies.rounded(x), budget)? else { return Ok(None) };
        let mut arrangement = Self::empty(sites, setting.clone(), surfaces, Arc::new(copies));
        arrangement.take(flat);
        Ok(Some(arrangement))
    }

    /// The arrangement of joined sites, with the share of faces that no polyhedron has, the triangles that they were joined of, if they were, and the surfaces of solids; `None` likewise.
    fn of(
        sites: Sites,
        left: f64,
        triangles: Option<Vec<[Point; 3]>>,
        setting: Setting,
        solids: Vec<TriMesh>,
        copies: Arc<Copies>,
        budget: &Budget,
    ) -> Result<Option<Self>, Stopped> {
        let mut arrangement = Self::empty(sites, setting, solids, copies);
        if let Some(triangles) = triangles {
            let Self { sites, setting, copies, .. } = &arrangement;
            if let Some(surface) = sum::surface(&triangles, &sites.list, setting, |x| copies.rounded(x), budget)? {
                arrangement.take(surface);
                return Ok(Some(arrangement));
            }
        }
        // About half of what is around the faces of solids is inside of these, but where one body stands for all of them.
        let faces: usize = arrangement.solids.iter().map(|solid| solid.triangles.len()).sum();
        let inside = 0.5 * left * faces as f64 / arrangement.sites.leaves as f64;
        arrangement.inside = inside;
        Ok(arrangement.begin(budget)?.then_some(arrangement))
    }

    /// Takes a surface that needs no polytopes.
    fn take(&mut self, flat: Flat) {
        self.tubes = Tubes::none(self.sites.list.len());
        self.is_steady = matches!(flat, Flat::Steady(_));
        match flat {
            Flat::Beyond(triangles) => (self.made, self.triangles) = (triangles, triangles),
            Flat::Made(flat) | Flat::Steady(flat) => {
                self.made = flat.triangles.len() as f64;
                self.triangles = self.copies.triangles(&flat) as f64;
                let (leaves, site_error) = (self.sites.leaves, self.sites.error);
                self.flat = Some(BlockSurface { leaves, site_error, ..*flat });
            }
        }
    }

    /// One without polytopes.
    fn empty(sites: Sites, setting: Setting, solids: Vec<TriMesh>, copies: Arc<Copies>) -> Self {
        Self {
            setting,
            sites,
            beyond: Vec::new(),
            near: Lists::default(),
            forms: Forms::default(),
            tubes: Tubes::default(),
            loose: Loose::new(),
            copies,
            flat: None,
            is_steady: false,
            doubts: None,
            thinned: 0,
            polytopes: Polytopes::default(),
            solids,
            inside: 0.0,
            made: 0.0,
            triangles: 0.0,
        }
    }

    /// Makes the first polytopes, with no bends at ends that are loose; false where a lattice serves better.
    fn begin(&mut self, budget: &Budget) -> Result<bool, Stopped> {
        for _ in 0..ROUNDS_OF_BENDS {
            match self.begin_with(true, budget)? {
                Begun::Done => return Ok(true),
                Begun::Left if self.tubes.bends.is_empty() => return Ok(false),
                Begun::Left => break,
                Begun::Bent(more) => self.loose.extend(more),
            }
        }
        Ok(matches!(self.begin_with(false, budget)?, Begun::Done))
    }

    /// The same, with no bends at all unless they are wanted.
    fn begin_with(&mut self, bends: bool, budget: &Budget) -> Result<Begun, Stopped> {
        self.polytopes = Polytopes::default();
        let Self { setting, sites, forms, tubes, loose, .. } = self;
        // Without the bends of a round before.
        if !tubes.bends.is_empty() {
            sites.list.truncate(tubes.figures);
        }
        let flatness = FLATNESS * setting.slack;
        let shell = |figure: &Figure| setting.shell(figure, State::default());
        let mut beyond = hinges::cuts(&sites.list, flatness, shell, budget)?;
        let has_rods = sites.list.iter().any(|figure| polytopes::kind(figure) == Kind::Rod);
        let form = if has_rods { forms.of(setting, &sites.list, Kind::Rod, State::default()) } else { None };
        if has_rods && form.is_none() {
            return Ok(Begun::Left);
        }
        let scales = form.map_or([1.0; 2], |form| [form.covering.reach, form.covering.girth]);
        for (beyond, cut) in
            beyond.iter_mut().zip(joints::cuts(&sites.list, flatness, scales, shell, budget)?).filter(|(beyond, _)| beyond.is_empty())
        {
            *beyond = Box::new(cut);
        }
        *tubes = Tubes::none(sites.list.len());
        let Some(mut near) = few_near(setting, &sites.list, tubes, &beyond, budget)? else { return Ok(Begun::Left) };
        if bends && has_rods {
            let of_kind = |kind: Kind| forms.of(setting, &sites.list, kind, State::default());
            for _ in 0..ROUNDS_OF_BENDS {
                let mut cut = beyond.clone();
                let made = Tubes::of(&sites.list, &mut cut, loose, of_kind, setting.slack, shell);
                let crowded = made.crowded(&sites.list, &near, setting.outer);
                budget.cancel.check()?;
                if crowded.is_empty() {
                    (*tubes, beyond) = (made, cut);
                    break;
                }
                loose.extend(crowded);
            }
        }
        if !tubes.bends.is_empty() {
            if sites.list.len() + tubes.wedges.len() > MOST_POLYTOPES {
                return Ok(Begun::Left);
            }
            sites.list.extend(tubes.points(&sites.list));
            beyond.resize_with(sites.list.len(), || Box::new([None; 2]));
            near = match few_near(setting, &sites.list, tubes, &beyond, budget)? {
                Some(near) => near,
                None => return Ok(Begun::Left),
            };
        }
        self.near = near.of_cells(tubes);
        self.beyond = beyond;
        let mut engine = Engine::new(self, 0, &[]);
        let Engine { polytopes, .. } = if engine.begin(budget)? { engine } else { return Ok(Begun::Left) };
        self.polytopes = polytopes;
        let Self { setting, sites, forms, tubes, polytopes, .. } = self;
        if !tubes.bends.is_empty() {
            budget.cancel.check()?;
            let of_kind = |kind: Kind| forms.of(setting, &sites.list, kind, State::default());
            let shell = |figure: &Figure| setting.shell(figure, State::default());
            let built = tubes.build(&sites.list, &mut polytopes.all, of_kind, setting.slack, shell);
            budget.cancel.check()?;
            let bent = match built {
                Ok(()) => tubes.crossed(&self.near),
                Err(figures) => tubes.ends(figures),
            };
            if !bent.is_empty() {
                return Ok(Begun::Bent(bent));
            }
        }
        [self.made, self.triangles] = self.expected_triangles().map(|triangles| (1.0 - self.inside) * triangles);
        Ok(if self.memory_bytes() < budget.limits.memory_bytes as f64 { Begun::Done } else { Begun::Left })
    }

    /// Leaf cells of the attractor.
    pub(super) fn leaves(&self) -> u64 {
        self.sites.leaves
    }

    /// Bytes held at most: for what is made, for what is put elsewhere, too, and for what is known of the sites where there are no polytopes.
    pub(super) fn memory_bytes(&self) -> f64 {
        let of_sites =
            if self.flat.is_some() { self.sites.list.len() as f64 * BYTES_PER_SITE + self.thinned as f64 * BYTES_PER_POINT } else { 0.0 };
        (self.made * BYTES_PER_TRIANGLE).max(self.triangles * plan::BYTES_PER_TRIANGLE).max(of_sites)
    }

    /// About how many triangles will be made, and how many there will be, from a sample of the polytopes: of those that are there more often, more.
    fn expected_triangles(&mut self) -> [f64; 2] {
        let times: Vec<u64> = self.sites.list.iter().map(|figure| self.copies.times(figure)).collect();
        let total: u64 = times.iter().sum();
        let step = total.div_ceil(SAMPLE).max(1);
        // Each stands for as many polytopes, those that are put elsewhere counted, as there are to the next; the last may stand for more than there are.
        let (mut sample, mut weights): (Vec<u32>, Vec<f64>) = (Vec::new(), Vec::new());
        let (mut counted, mut end) = (0, 0);
        for (index, &own) in (0..).zip(&times) {
            end += own;
            if counted < end {
                let weight = (end - counted).next_multiple_of(step);
                sample.push(index);
                weights.push(weight as f64);
                counted += weight;
            }
        }
        self.polytopes.exchange(&mut self.tubes.cells);
        let triangles = pieces::count(&self.polytopes, &self.near, &sample);
        self.polytopes.exchange(&mut self.tubes.cells);
        let mut expected = [0.0_f64; 2];
        for ((&index, weight), triangles) in sample.iter().zip(weights).zip(triangles) {
            expected[0] += weight * triangles / times[index as usize] as f64;
            expected[1] += weight * triangles;
        }
        expected.map(|triangles| (triangles * total as f64 / counted as f64).max(0.0))
    }

    /// The boundary of the union of polytopes; `None` where none could be found.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn run(&mut self, budget: &Budget) -> Result<Option<Arranged>, Stopped> {
        let solids = std::mem::take(&mut self.solids);
        let inside: Vec<Inside<'_>> = solids.iter().map(Inside::new).collect();
        if let Some(mut surface) = self.flat.take() {
            let is_done = solids::leave_out(&inside, &mut surface);
            return Ok(is_done.then_some(Arranged { surface, uncertain: 0, is_done }));
        }
        let (mut trial, mut was_bent) = (0, false);
        while trial < TRIALS {
            let (first, cells) = (std::mem::take(&mut self.polytopes), std::mem::take(&mut self.tubes.cells));
            let mut engine = Engine::new(self, trial, &inside);
            engine.polytopes = first;
            let run = engine.run(cells, budget)?;
            drop(engine);
            match run {
                Run::Done(mut arranged) => {
                    if !solids::leave_out(&inside, &mut arranged.surface) {
                        break;
                    }
                    arranged.surface.leaves = self.sites.leaves;
                    arranged.surface.site_error = self.sites.error;
                    return Ok(Some(*arranged));
                }
                Run::Bent(more) if !was_bent => {
                    was_bent = true;
                    self.loose.extend(more);
                    if !self.begin(budget)? {
                        break;
                    }
                }
                Run::Bent(_) | Run::Open | Run::Doubtful if !self.tubes.bends.is_empty() => {
                    if !matches!(self.begin_with(false, budget)?, Begun::Done) {
                        break;
                    }
                }
                Run::Open => trial += 1,
                Run::Bent(_) | Run::Doubtful => break,
            }
        }
        Ok(None)
    }

    /// Whether the dilation of what its sites stand for, which is asked for where it is known, has the topology of theirs. False where that is not shown.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn is_of_another(&mut self, rule: &SiteRule<'_>, flow: Option<&Flow<'_>>, budget: &Budget) -> Result<bool, Stopped> {
        if self.sites.is_exact || self.is_steady {
            return Ok(true);
        }
        let Setting { least, reach, outer, off, slack, .. } = self.setting;
        if self.sites.list.len() > MOST_ASKED {
            return Ok(false);
        }
        // Closed surfaces that have nothing inside farther from them than `least` were filled: nothing nearer may be in question.
        let is_within = off + slack <= reach - least;
        // Parts that are like others are apart by twice the outer distance: what is in question around one of them must not reach another.
        let is_apart = self.copies.is_empty() || 2.0 * (off + slack) <= outer - reach;
        self.is_steady = is_within && is_apart && are_steady(self.figures(), &self.setting, off, &rule.attractor().surfaces(), budget)?;
        if let Some(flow) = flow.filter(|_| !self.is_steady && self.doubts.is_none() && self.copies.is_empty()) {
            // Joined figures are flat up to the slack of these.
            let flow = Flow { slack: flow.slack + slack, ..*flow };
            let doubts = flow.doubts(self.figures(), MOST_DOUBTS, budget)?;
            self.is_steady = doubts.as_ref().is_some_and(Vec::is_empty);
            self.doubts = Some(doubts.unwrap_or_default());
        }
        Ok(self.is_steady)
    }

    /// Where the topology of what its sites stand for is in doubt; none where it could not be asked, or is in doubt at too many places.
    pub(super) fn take_doubts(&mut self) -> Option<Vec<Point>> {
        self.doubts.take().filter(|doubts| !doubts.is_empty())
    }

    /// Where its sites are, if all are points.
    pub(super) fn points(&self) -> Option<Vec<Point>> {
        self.sites.list.iter().map(Figure::point).collect()
    }

    /// Its figures without those of bends.
    fn figures(&self) -> &[Figure] {
        if self.tubes.figures > 0 { &self.sites.list[..self.tubes.figures] } else { &self.sites.list }
    }

    /// Its figures, for searches, its setting, and where parts were that are like others.
    pub(super) fn into_index(mut self) -> (Index, Setting, Arc<Copies>) {
        if self.tubes.figures > 0 {
            self.sites.list.truncate(self.tubes.figures);
        }
        (Index::new(self.sites.list, self.setting.slack), self.setting, self.copies)
    }
}

/// Sites that may be looked at, of so many: each has a leaf cell of its own.
fn most_of(sites: usize, budget: &Budget) -> usize {
    sites.min(usize::try_from(budget.limits.cells).unwrap_or(usize::MAX))
}

/// Whether the dilation of what some sites stand for, which is asked for where it is known, has the topology of theirs, if they are no more than can be asked. False where that is not shown.
///
/// # Errors
/// [`Stopped`].
pub(super) fn is_of_sites(
    setting: &Setting,
    rule: &SiteRule<'_>,
    candidates: &Candidates,
    flow: Option<&Flow<'_>>,
    budget: &Budget,
) -> Result<bool, Stopped> {
    let Some((sites, _)) = Sites::of(rule, candidates, MOST_STEADY, budget)? else { return Ok(false) };
    if are_steady(&sites.list, setting, setting.off + sites.off(), &rule.attractor().surfaces(), budget)? {
        return Ok(true);
    }
    let doubts = flow.map(|flow| flow.doubts(&sites.list, MOST_DOUBTS, budget)).transpose()?.flatten();
    Ok(doubts.is_some_and(|doubts| doubts.is_empty()))
}

/// The same of figures that are off by so much, given the surfaces of solids.
fn are_steady(figures: &[Figure], setting: &Setting, off: f64, solids: &[TriMesh], budget: &Budget) -> Result<bool, Stopped> {
    let solids: Vec<Inside<'_>> = solids.iter().map(Inside::new).collect();
    Steady { figures, radius: setting.reach, moved: off + setting.slack, solids: &solids }.is_shown(budget)
}

/// The figures that are near to each other, given how far beyond their ends they are cut; none where a lattice serves better, as too many are.
fn few_near(
    setting: &Setting,
    sites: &[Figure],
    tubes: &Tubes,
    beyond: &[Box<[Option<f64>]>],
    budget: &Budget,
) -> Result<Option<Lists>, Stopped> {
    let body = |(index, figure)| Body {
        figure,
        reach: figure.in_space(setting.outer) + setting.slack,
        cuts: tubes.cuts(index, figure, &beyond[index as usize]),
    };
    let bodies: Vec<Body<'_>> = (0..).zip(sites).map(body).collect();
    let Some(near) = pieces::near(&bodies, MOST_NEAR, budget)? else { return Ok(None) };
    let may_be_near = |figure: &Figure| {
        let per_cube = match figure.outline {
            Outline::Polygon(_) | Outline::Polyhedron(_) => NEAR_ALONG_FACES,
            Outline::Point(_) | Outline::Segment(_) => NEAR_AROUND_WIRES,
        };
        per_cube * figure.area(setting.reach) / setting.lattice.pitch.powi(2)
    };
    let most = FEW_NEAR + sites.iter().map(may_be_near).sum::<f64>();
    Ok((near.total() as f64 <= most).then_some(near))
}

/// Bytes held at most for each site where no polytopes are made; each way has limits of its own, too.
const BYTES_PER_SITE: f64 = 1_600.0;

/// The same for each point of which fewer are left.
const BYTES_PER_POINT: f64 = 250.0;

/// Triangles of a polytope that little is near to, about: with more sites than memory has room for that many, polytopes are not even begun.
const LEAST_TRIANGLES: f64 = 24.0;

/// All sites of an attractor.
#[derive(Default)]
struct Sites {
    list: Vec<Figure>,
    /// The largest errors of leaves.
    error: SiteError,
    leaves: u64,
    /// Whether they are the shape itself.
    is_exact: bool,
}

impl Sites {
    /// How far places of what they stand for are from these, and these from it, at most: infinite where squares alone tell.
    fn off(&self) -> f64 {
        if self.error.inner_square > 0.0 { f64::INFINITY } else { self.error.inner.max(self.error.outer) }
    }

    /// The same, joined to polyhedra, polygons and segments as far as they are convex, with the share of faces that no polyhedron has.
    fn joined(self, setting: &Setting, budget: &Budget) -> Result<(Self, f64), Stopped> {
        let (flatness, faces) = (FLATNESS * setting.slack, self.list.len() as f64);
        let shells = self.list.iter().map(|figure| setting.shell(figure, State::default()));
        let band = shells.map(|shell| shell.outer - shell.inner).fold(f64::INFINITY, f64::min);
        let list = polyhedron::closed(self.list, |figure| figure.in_space(setting.least), flatness, budget)?;
        let left = list.iter().filter(|figure| !matches!(figure.outline, Outline::Polyhedron(_))).count() as f64 / faces;
        Ok((Self { list: figure::joined(list, flatness, hull::CORNER_SHARE * band, budget)?, ..self }, left))
    }

    /// The sites below some candidates, if there are at least one and at most `most`; and of each, whether it belongs to the surface of a solid.
    fn of(rule: &SiteRule<'_>, candidates: &Candidates, most: usize, budget: &Budget) -> Result<Option<(Self, Vec<bool>)>, Stopped> {
        let attractor = rule.attractor();
        let (mut found, mut is_of_solid) = (Self::default(), Vec::new());
        let mut open: Vec<(Cell, Vec<ControlPoint>)> = Vec::new();
        for candidate in &candidates.cells {
            open.push((candidate.cell, candidates.points_of(attractor, candidate).to_vec()));
            while let Some((cell, points)) = open.pop() {
                if let Some(error) = rule.leaf(&cell, &points) {
                    let deficit = rule.deficit(cell.root);
                    rule.emit(&cell, &points, &mut |site| found.list.push(Weighted { site, deficit }.into()));
                    is_of_solid.resize(found.list.len(), attractor.roots()[cell.root as usize].solid.is_some());
                    found.error = found.error.max(error);
                    found.leaves += 1;
                    if found.list.len() > most {
                        return Ok(None);
                    }
                    continue;
                }
                budget.cancel.check()?;
                open.extend(attractor.children(&cell, &points).rev());
            }
        }
        Ok((!found.list.is_empty()).then_some((found, is_of_solid)))
    }
}
