//! Pitch, thresholds and bounds of a dilation.

use super::arrangement::height_field::between_rays;
use super::arrangement::{self, Arranged, Arrangement, Copies, Figure, Flat};
use super::assemble::Assembly;
use super::block;
use super::drawn::unless_stopped;
use super::dust;
use super::flow::Flow;
use super::lattice::{Cube, ENCLOSING, Grading};
use super::octree::{Changed, Node, Pass, Task};
use super::patches;
use super::peaks::{self, Stand};
use super::pool::Pool;
use super::seam;
use super::setting::{Setting, extent, least};
use super::simplify::Core;
use super::smooth::MOST_NOISE;
use super::surface::{BlockSurface, Blocks};
use super::told;
use super::tree::Candidates;
use super::{Dilation, DilationError, Prediction};
use crate::attractor::cell::{Cell, ControlPoint, Point};
use crate::attractor::sites::{SiteError, SiteRule};
use crate::attractor::{Attractor, Graph};
use crate::automaton::LeafPrimitive;
use crate::budget::{Budget, Limits, Stopped};
use crate::measure::bounds::{AxisBox, bounding_box};
use crate::solid::mend;
use crate::solid::{Solid, SolidError, TriMesh, carried, rounding};
use crate::tolerance::Tolerance;
use glam::DVec3;
use std::borrow::Cow;
use std::collections::{BTreeSet, HashSet};
use std::sync::Mutex;

/// A pitch above this share of the least r would not see the shape.
const COARSEST: f64 = 1.0;
/// Above this share of r a tetrahedron has so many sites that surfaces cost more than the coarser lattice saves: half as much again at r/5. Simplification has the whole
/// band all the same, and ends with fewer triangles the finer the lattice is: 6 to 20 % at r/10, a half at r/5, where wires take longer for it.
const QUICKEST: f64 = 0.65;
/// Radius of the closing ball in units of the pitch. Without closing, Koch curves and Sierpinski tetrahedra come out with
/// false tunnels at most pitches, with 0.5 at few, with 0.55 and necks of 0.36 at none of sixteen tried. This is measured, not proven.
const CLOSING: f64 = 0.55;
/// The edge of the finest cubes among dense sites, in units of outer - r: below 1 / 0.612, so that their tetrahedra without filled vertices are close.
const CLOSE: f64 = 1.6;
/// Cubes may be so many levels larger where one site serves their tetrahedra.
const COARSER: u32 = 1;
/// How far the surface passes from filled vertices, in units of the ball's radius.
const FILLED_CUT: f64 = 0.25;
/// See [`Setting`], in the same units.
const NECK: f64 = 0.36;
/// A pitch finer than this many roundings of single precision cannot be carried.
const LEAST_ROUNDINGS: f64 = 64.0;
/// Cubes that are refined to settle the topology, besides an eighth of the triangles: where more would be, it stays open.
const MOST_REFINED: usize = 2_000;
/// Leaf cells of a shape of which some times as many are looked at to tell its topology.
const FEW_LEAVES: u64 = 2_000;
/// Cells at most of products that are split along one factor at a time.
const MOST_SPLIT: u64 = 100_000;
/// One in so many bytes may hold them.
const SPLIT_SHARE: u64 = 8;
const BYTES_PER_CONTROL_POINT: u64 = 32;
/// Rounds in which sites become nearer to what they stand for around places where the topology is in doubt, by which share, and cells at most for each of the first.
const CLOSER_ROUNDS: u32 = 3;
const CLOSER: f64 = 0.0625;
const CLOSER_CELLS: u64 = 10;
/// Bytes of a cell with its control points, nodes and sites.
const BYTES_PER_CELL: u64 = 400;
/// Bytes held at most for each triangle: block surfaces, the joined mesh and its verification.
pub(super) const BYTES_PER_TRIANGLE: f64 = 120.0;

/// How much longer the radius s of a ball in space is when the one in four dimensions, r of which is a section with radius s, is longer by e.
fn in_space_between(radius: f64, e: f64, section: f64) -> f64 {
    if section < radius { (section * section + e.max(0.0) * (2.0 * radius + e)).sqrt() - section } else { e }
}

/// The pitch among dense sites: as many times the edge of the finest cubes as levels allow, and no more than what one site would be marched with.
fn coarsened(edge: f64, most: f64) -> f64 {
    let doubled = (0..COARSER).fold(edge, |edge, _| if 2.0 * edge <= most { 2.0 * edge } else { edge });
    doubled.min(most)
}

/// Refuses maps that contract so slowly that leaves would have longer addresses than allowed: the largest root
/// shrinks by the automaton's rate (its proven lower bound) at every step.
fn check_depth(attractor: &Attractor, aimed: f64, tolerance: Tolerance, budget: &Budget) -> Result<(), DilationError> {
    let rate = attractor.contraction().lower;
    let size = (0..attractor.roots().len())
        .filter(|&index| !attractor.automaton().state(attractor.roots()[index].state).transitions.is_empty())
        .map(|index| attractor.root_cell(index).ball.radius)
        .fold(0.0, f64::max);
    let needed_mm = 0.1 * aimed;
    let allowed = budget.limits.depth;
    let reached_mm = size * rate.powf(f64::from(allowed));
    if reached_mm > needed_mm {
        return Err(DilationError::Depth { allowed, tolerance_mm: tolerance.mm(), needed_mm, reached_mm });
    }
    Ok(())
}

/// The cube of space to refine, from block 0 on: blocks along its side, a power of two, and the roots as its candidates.
pub(super) struct Space {
    blocks: i64,
    candidates: Candidates,
    /// The roots of what is meant, where that is another shape.
    meant: Candidates,
}

#[cfg(test)]
impl Space {
    pub(super) fn candidates(&self) -> &Candidates {
        &self.candidates
    }
}

/// The radii of the balls: one, or several that one serves, see [`SiteRule::deficit`]. A length e at the largest, r, is one at the smallest, s, of the same difference of squares:
/// (s - e')^2 - s^2 = (r - e)^2 - r^2. At those between it is less than e'.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Balls {
    pub(super) least: f64,
    pub(super) most: f64,
}

impl Balls {
    /// What a bound from within at the largest is at the smallest.
    fn inner(self, e: f64) -> f64 {
        if self.least == self.most {
            return e;
        }
        let square = self.least * self.least - e * (2.0 * self.most - e);
        (self.least - square.max(0.0).sqrt()) * (1.0 + 1e-12)
    }

    /// What a bound from without at the largest is at the smallest.
    fn outer(self, e: f64) -> f64 {
        if self.least == self.most {
            return e;
        }
        ((self.least * self.least + e * (2.0 * self.most + e)).sqrt() - self.least) * (1.0 + 1e-12)
    }

    /// What both bounds may be at the largest, so that they are at most e at the smallest.
    fn share(self, e: f64) -> f64 {
        if self.least == self.most {
            return e;
        }
        let within = e * (2.0 * self.least - e);
        // r - sqrt(r^2 - d) = d / (r + sqrt(r^2 - d)), without cancellation.
        within / (self.most + (self.most * self.most - within).sqrt()) * (1.0 - 1e-9)
    }
}

/// Pitch and bounds of a dilation before it begins.
#[derive(Clone)]
pub(super) struct Plan<'a> {
    balls: Balls,
    /// The largest of them.
    radius: f64,
    /// The tolerance that is aimed at: smaller than asked when the radius is.
    aimed: f64,
    /// What it is at the largest radius.
    tolerance: f64,
    pitch: f64,
    /// How near to a site the surface may be.
    least: f64,
    /// Lengths beyond the lattice's own bounds: rounding to single precision, the unit of values and double precision.
    extra: f64,
    bounds: AxisBox,
    rule: SiteRule<'a>,
    meant: Meant<'a>,
    clean_only: bool,
    has_sheets: bool,
}

/// What a plan's attractor stands for: itself, or another one that it is nearly.
#[derive(Clone, Copy, Debug)]
pub(super) struct Meant<'a> {
    /// No place of either is farther from the other one than this. Infinite where no length tells.
    pub(super) off: f64,
    /// Bounds are that much wider.
    pub(super) deviation_mm: f64,
    /// The box of its exact dilation.
    pub(super) bounds: AxisBox,
    /// The other one, where its cells tell where it is.
    pub(super) shape: Option<&'a Attractor>,
}

impl<'a> Plan<'a> {
    pub(super) fn new(
        attractor: &'a Attractor,
        balls: Balls,
        tolerance: Tolerance,
        simplify: bool,
        coarseness: f64,
        budget: &Budget,
    ) -> Result<Self, DilationError> {
        let bounds = bounding_box(attractor, budget)?;
        let radius = balls.most;
        // A tolerance of the radius' order would allow an empty result.
        let of_least = tolerance.mm().min(0.5 * balls.least);
        let aimed = balls.share(of_least);
        let rounding = rounding(extent(&bounds, 3.0 * radius));
        check_depth(attractor, aimed, tolerance, budget)?;
        // The unit of values is below 8 r^2 / MOST, and noise of 32 units moves a surface at sqrt(theta - R^2) > r / 2 by less than r / 2^16.
        let extra = carried(extent(&bounds, 3.0 * radius)) + radius * (0.5_f64).powi(16) + 1e-12 * extent(&bounds, radius);
        let rule = SiteRule::new(attractor, radius, (aimed - extra).max(0.0), coarseness);
        // The inner bound rounds down: see `Setting::least`.
        let pitch = Self::pitch_for(&rule, radius, aimed - extra - 4e-12 * radius);
        let least = least(radius, pitch);
        let pitch = pitch.min(COARSEST * balls.least).min(QUICKEST * radius);
        let close = in_space_between(radius, aimed - extra - rule.outer_reserve(), rule.largest_dense());
        let pitch = if rule.is_dense() { coarsened(CLOSE * close, pitch) } else { pitch };
        if aimed <= 2.0 * extra || pitch < LEAST_ROUNDINGS * rounding {
            let share = (LEAST_ROUNDINGS * rounding).powi(2) * ENCLOSING.powi(2) / (1.5 * radius * rule.lattice_share());
            let reachable_mm = 1.01 * balls.inner((2.0 * extra).max(share + extra)).max(balls.outer((2.0 * extra).max(share + extra)));
            return Err(DilationError::Precision { tolerance_mm: tolerance.mm(), extent_mm: extent(&bounds, radius), reachable_mm });
        }
        let meant = Meant { off: 0.0, deviation_mm: 0.0, bounds: bounds.grown(radius), shape: None };
        Ok(Self {
            balls,
            radius,
            aimed: of_least,
            tolerance: aimed,
            pitch,
            least,
            extra,
            bounds,
            rule,
            meant,
            clean_only: !simplify,
            has_sheets: true,
        })
    }

    /// The attractor with as many roots as there are leaf cells, where it is made of products that have fewer when they are split along one factor at a time.
    pub(super) fn split(&self, budget: &Budget) -> Result<Option<Attractor>, Stopped> {
        if self.rule.is_dense() || self.rule.is_exact() {
            return Ok(None);
        }
        let attractor = self.rule.attractor();
        let controls = attractor.roots().iter().map(|root| root.points.len()).max().unwrap_or(0) as u64;
        let room = budget.limits.memory_bytes / (SPLIT_SHARE * (BYTES_PER_CELL + BYTES_PER_CONTROL_POINT * controls));
        let most = room.min(budget.limits.cells).min(MOST_SPLIT) as usize;
        let is_leaf = |cell: &Cell, points: &[ControlPoint]| self.rule.leaf(cell, points).is_some();
        let Some(split) = attractor.split_along_factors(most, is_leaf, budget)? else { return Ok(None) };
        let is_fewer = self.rule.leaves(split.roots().len(), &budget.cancel)?.is_none();
        Ok(is_fewer.then_some(split))
    }

    /// Whether it may lie in a plane.
    pub(super) fn is_thin(&self, budget: &Budget) -> bool {
        arrangement::is_thin(&self.setting(self.pitch, budget))
    }

    /// How many leaf cells there are, if no more than `most`.
    pub(super) fn leaves(&self, most: usize, budget: &Budget) -> Result<Option<usize>, Stopped> {
        self.rule.leaves(most, &budget.cancel)
    }

    /// The same for an attractor that stands for another one, within what is left of the tolerance.
    pub(super) fn standing_for(self, meant: Meant<'a>) -> Self {
        Self { meant, ..self }
    }

    /// The same with sites that are nearer to what they stand for around some places: all that may be closest to these.
    fn closer(&self, places: &[Point], share: f64) -> Self {
        Self { rule: self.rule.closer(places, self.radius + 2.0 * self.rule.outer_reserve(), share), ..self.clone() }
    }

    /// The same where sheets along the sites do not serve.
    pub(super) fn without_sheets(self) -> Self {
        Self { has_sheets: false, ..self }
    }

    /// a = R / 0.559 with R^2 the lattice's share of r^2 - (r - e)^2.
    fn pitch_for(rule: &SiteRule<'_>, radius: f64, tolerance: f64) -> f64 {
        (tolerance.max(0.0) * (2.0 * radius - tolerance) * rule.lattice_share()).sqrt() / ENCLOSING
    }

    #[cfg(test)]
    pub(super) fn rule(&self) -> &SiteRule<'a> {
        &self.rule
    }

    #[cfg(test)]
    pub(super) fn pitch(&self) -> f64 {
        self.pitch
    }

    pub(super) fn setting(&self, pitch: f64, budget: &Budget) -> Setting {
        // The roots are there anyway; what grows beyond them may take a fair share of the memory.
        let roots = self.rule.attractor().roots().len();
        let cells = (budget.limits.memory_bytes / (8 * BYTES_PER_CELL)).clamp(50_000, 4_000_000) as usize + 2 * roots;
        // The lattice's own error is the inner end of the band; the outer one is the tolerance's, less what sums of such lengths lose to rounding.
        let outer = self.radius + (self.tolerance - self.extra - self.rule.outer_reserve()) * (1.0 - 1e-12);
        let setting = Setting::new(self.radius, outer.max(self.radius), self.aimed, pitch, cells, &self.bounds);
        let least = setting.least.min(self.least);
        let thinnest = self.balls.least - self.balls.inner(self.radius - least);
        let taken = self.balls.outer(self.extra) + self.balls.outer(self.rule.outer_reserve());
        let close_in_space = setting.close.max(self.aimed - taken);
        let setting = Setting { least, thinnest, close_in_space, off: self.meant.off, has_sheets: self.has_sheets, ..setting };
        if !self.rule.is_dense() {
            return Setting { clean_only: self.clean_only, ..setting };
        }
        let edge = pitch.min(CLOSE * in_space_between(self.radius, setting.close, self.rule.largest_dense()));
        let gap = CLOSING * edge;
        Setting {
            dense: true,
            clean_only: self.clean_only,
            gap,
            horizon: setting.horizon + gap,
            neck: NECK * edge,
            filled_value: -setting.integer((setting.reach + FILLED_CUT * gap).powi(2)) - MOST_NOISE,
            ..setting
        }
    }

    /// Predicts from a sample of polytopes, or from what is told by what may be made `instead` of a lattice, or from a sample of its blocks; what lies in a plane takes less to make.
    pub(super) fn predict(
        &self,
        instead: impl FnOnce() -> Result<Option<Prediction>, DilationError>,
        budget: &Budget,
    ) -> Result<Prediction, DilationError> {
        if let Some(prediction) = self.predict_arranged(budget)? {
            return Ok(prediction);
        }
        match instead()? {
            Some(prediction) => Ok(prediction),
            None => self.predict_on_lattice(budget),
        }
    }

    /// The same from a sample of the lattice's blocks.
    pub(super) fn predict_on_lattice(&self, budget: &Budget) -> Result<Prediction, DilationError> {
        let unlimited = Budget {
            limits: crate::budget::Limits { cells: u64::MAX, triangles: u64::MAX, memory_bytes: u64::MAX, ..budget.limits },
            progress: None,
            ..budget.clone()
        };
        let setting = self.setting(self.pitch, &unlimited);
        let (space, grading) = (self.space(&setting), Grading::default());
        let pass = self.pass(&setting, &grading, Task::Whole, &unlimited, space.blocks);
        let expected = pass.expected(space.blocks, &space.candidates, !self.clean_only)?;
        let memory_bytes = expected.made.max(expected.triangles) * BYTES_PER_TRIANGLE;
        Ok(Prediction {
            counted_triangles: expected.made,
            triangles: expected.triangles,
            memory_bytes,
            leaf_cells: expected.leaves,
            simplifying_bytes: expected.simplifying,
            looked_at_bytes: expected.looked_at,
            searched: expected.searched,
            found: expected.found,
            least_thickness_mm: self.least_thickness(),
            pitch_mm: Some(self.pitch),
        })
    }

    /// The same for what needs no lattice, see [`Plan::run_arranged`].
    pub(super) fn predict_arranged(&self, budget: &Budget) -> Result<Option<Prediction>, DilationError> {
        let setting = self.setting(self.pitch, budget);
        let arrangement = Arrangement::new(&setting, &self.rule, &self.space(&setting).candidates, budget)?;
        Ok(arrangement.map(|arrangement| self.predicted(&arrangement)))
    }

    /// The same for [`Plan::run_if_told`], as far as it is known before.
    pub(super) fn predict_if_told(&self, budget: &Budget) -> Result<Option<Prediction>, DilationError> {
        let setting = self.setting(self.pitch, budget);
        let arrangement = self.arranged_if_told(&setting, &self.space(&setting), budget)?;
        Ok(arrangement.map(|arrangement| self.predicted(&arrangement)))
    }

    /// The same for sheets along a surface, see [`Plan::run_in_sheets`].
    pub(super) fn predict_in_sheets(&self, budget: &Budget) -> Result<Option<Prediction>, DilationError> {
        let setting = self.setting(self.pitch, budget);
        let arrangement = Arrangement::of_sheets(&setting, &self.rule, &self.space(&setting).candidates, budget)?;
        Ok(arrangement.map(|arrangement| self.predicted(&arrangement)))
    }

    /// What an arrangement tells of what will be made of it.
    fn predicted(&self, arrangement: &Arrangement) -> Prediction {
        self.without_lattice(arrangement.triangles, arrangement.memory_bytes(), arrangement.leaves() as f64)
    }

    /// What is made without a lattice: so many triangles of as many leaf cells.
    fn without_lattice(&self, triangles: f64, memory_bytes: f64, leaf_cells: f64) -> Prediction {
        Prediction {
            counted_triangles: triangles,
            triangles,
            memory_bytes,
            leaf_cells,
            simplifying_bytes: 0.0,
            looked_at_bytes: 0.0,
            searched: 0.0,
            found: 0.0,
            least_thickness_mm: self.least_thickness(),
            pitch_mm: None,
        }
    }

    /// 2 (r - e): bounds are of at most this length.
    fn least_thickness(&self) -> f64 {
        2.0 * (self.balls.least - self.aimed - self.meant.deviation_mm).max(0.0)
    }

    /// The dilation. Where sites that stand for a few leaf cells leave the topology in doubt, it is what `finer` ones make of it, given the number of those cells, if they tell it. Before all is left to a lattice, it is asked whether something may be made `instead`.
    pub(super) fn run(
        &self,
        finer: impl FnOnce(u64) -> Result<Option<Dilation>, DilationError>,
        instead: impl FnOnce() -> Result<Option<Dilation>, DilationError>,
        budget: &Budget,
    ) -> Result<Dilation, DilationError> {
        let setting = self.setting(self.pitch, budget);
        let space = self.space(&setting);
        let arrangement = Arrangement::new(&setting, &self.rule, &space.candidates, budget)?;
        let leaves = arrangement.as_ref().map_or(u64::MAX, Arrangement::leaves);
        let made = self.of_arrangement(arrangement, &setting, &space, budget)?;
        if let Some(OfSites { doubts: Some(doubts), .. }) = &made
            && let Some(closer) = self.run_closer(doubts, leaves, &setting, &space, budget)?
        {
            return Ok(closer);
        }
        let made = made.map(|made| made.dilation);
        let stands_for_another = !setting.dense && self.meant.off.is_finite() && (self.meant.off > 0.0 || !self.rule.is_exact());
        if leaves <= FEW_LEAVES
            && stands_for_another
            && !made.as_ref().is_some_and(|made| made.topology_exact)
            && let Some(finer) = finer(leaves)?
        {
            return Ok(finer);
        }
        let made = if made.is_some() { made } else { instead()? };
        made.map_or_else(|| self.on_lattice(&setting, &space, budget), Ok)
    }

    /// The same by so many cells, with sites that become nearer to what they stand for where the topology is in doubt; none where that does not tell it.
    fn run_closer(
        &self,
        doubts: &[Point],
        cells: u64,
        setting: &Setting,
        space: &Space,
        budget: &Budget,
    ) -> Result<Option<Dilation>, DilationError> {
        let limits = Limits { cells: budget.limits.cells.min(CLOSER_CELLS * cells), ..budget.limits };
        let aside = Budget { limits, ..budget.aside() };
        let (mut closer, mut share, mut doubts) = (self.clone(), 1.0, Cow::Borrowed(doubts));
        for _ in 0..CLOSER_ROUNDS {
            share *= CLOSER;
            closer = closer.closer(&doubts, share);
            let Some(mut arrangement) = Arrangement::new(setting, &closer.rule, &space.candidates, &aside)? else { break };
            // Asked first: all else takes longer.
            if arrangement.is_of_another(&closer.rule, closer.flow(setting, space).as_ref(), &aside)? {
                let made = unless_stopped(closer.of_arrangement(Some(arrangement), setting, space, &aside))?;
                return Ok(made.map(|made| made.dilation).filter(|made| made.topology_exact));
            }
            let Some(left) = arrangement.take_doubts() else { break };
            doubts = Cow::Owned(left);
        }
        Ok(None)
    }

    /// The same on a lattice.
    pub(super) fn run_on_lattice(&self, budget: &Budget) -> Result<Dilation, DilationError> {
        let setting = self.setting(self.pitch, budget);
        self.on_lattice(&setting, &self.space(&setting), budget)
    }

    /// The dilation without a lattice, where its topology is told.
    pub(super) fn run_if_told(&self, budget: &Budget) -> Result<Option<Dilation>, DilationError> {
        let setting = self.setting(self.pitch, budget);
        let space = self.space(&setting);
        let arrangement = self.arranged_if_told(&setting, &space, budget)?;
        let made = self.of_arrangement(arrangement, &setting, &space, budget)?;
        Ok(made.map(|made| made.dilation).filter(|made| made.topology_exact))
    }

    /// What needs no lattice, where its sites tell the topology of what they stand for: asked first, as all else takes longer.
    fn arranged_if_told(&self, setting: &Setting, space: &Space, budget: &Budget) -> Result<Option<Arrangement>, DilationError> {
        let Some(mut arrangement) = Arrangement::new(setting, &self.rule, &space.candidates, budget)? else { return Ok(None) };
        let is_told = arrangement.is_of_another(&self.rule, self.flow(setting, space).as_ref(), budget)?;
        Ok(is_told.then_some(arrangement))
    }

    /// The dilation by the union of polytopes around points, segments, polygons and polyhedra, or by what needs none, where that serves better than a lattice and comes out.
    pub(super) fn run_arranged(&self, budget: &Budget) -> Result<Option<Dilation>, DilationError> {
        let setting = self.setting(self.pitch, budget);
        let space = self.space(&setting);
        let arrangement = Arrangement::new(&setting, &self.rule, &space.candidates, budget)?;
        Ok(self.of_arrangement(arrangement, &setting, &space, budget)?.map(|made| made.dilation))
    }

    /// The dilation of a surface that turns little by a sheet on each side, or of a solid by one outside; none where that does not come out.
    pub(super) fn run_in_sheets(&self, budget: &Budget) -> Result<Option<Dilation>, DilationError> {
        let setting = self.setting(self.pitch, budget);
        let space = self.space(&setting);
        let arrangement = Arrangement::of_sheets(&setting, &self.rule, &space.candidates, budget)?;
        Ok(self.of_arrangement(arrangement, &setting, &space, budget)?.map(|made| made.dilation))
    }

    /// The dilation of a graph over a convex part of a plane, by rays that stand for it; none where that does not come out.
    ///
    /// It is exactly a ball: see `height_field` in `arrangement`.
    pub(super) fn run_over(&self, graph: &Graph, budget: &Budget) -> Result<Option<Dilation>, DilationError> {
        let too_many = || DilationError::Triangles { tolerance_mm: self.aimed, allowed: budget.limits.triangles };
        let Some(Over { setting, made, .. }) = self.over(graph, budget)? else { return Ok(None) };
        let (Flat::Made(surface) | Flat::Steady(surface)) = made else { return Err(too_many()) };
        let triangles = surface.triangles.len() as u64;
        if triangles > budget.limits.triangles {
            return Err(too_many());
        }
        self.prove(&setting, surface.site_error, triangles, budget);
        self.certify(&setting, Mended { surface: *surface, uncertain: 0, crossings: 0 }, true, None, budget).map(Some)
    }

    /// The same as a prediction: all of it is made for that.
    pub(super) fn predict_over(&self, graph: &Graph, budget: &Budget) -> Result<Option<Prediction>, DilationError> {
        let made = self.over(graph, budget)?;
        Ok(made.map(|Over { made, columns, bytes, .. }| {
            let triangles = match made {
                Flat::Made(surface) | Flat::Steady(surface) => surface.triangles.len() as f64,
                Flat::Beyond(triangles) => triangles,
            };
            self.without_lattice(triangles, bytes.max(BYTES_PER_TRIANGLE * triangles), columns as f64)
        }))
    }

    /// The surface around a graph, if rays serve it.
    fn over(&self, graph: &Graph, budget: &Budget) -> Result<Option<Over>, DilationError> {
        // Less what sums of such lengths lose to rounding.
        let within = self.tolerance - self.extra - graph.off - 1e-12 * self.radius;
        let Some(stand) = peaks::stand(graph, self.radius, within, budget)? else { return Ok(None) };
        let Stand { rays, least, outer, inward, outward, columns, bytes } = stand;
        let setting = Setting { least, outer, dense: false, ..self.setting(self.pitch, budget) };
        let Some(mut made) = between_rays(rays, &setting, budget)? else { return Ok(None) };
        if let Flat::Made(surface) | Flat::Steady(surface) = &mut made {
            surface.site_error = SiteError { inner: inward + graph.off, outer: outward + graph.off, ..SiteError::default() };
            surface.leaves = columns;
        }
        Ok(Some(Over { setting, made, columns, bytes }))
    }

    /// The dilation on a lattice. Where the distance may have critical points with values that it does not tell from r, it is refined until it does.
    pub(super) fn on_lattice(&self, setting: &Setting, space: &Space, budget: &Budget) -> Result<Dilation, DilationError> {
        let mut grading = Grading::default();
        let made = self.surfaces(setting, space, &grading, Task::Whole, budget)?;
        let allowed = MOST_REFINED + made.iter().map(|surface| surface.triangles.len()).sum::<usize>() / 8;
        let (mut refined, mut uncertain) = (0, BTreeSet::new());
        let mut blocks = Blocks::default();
        let mut critical = add(setting, &grading, &mut blocks, made, &mut uncertain, budget)?;
        while !critical.is_empty() {
            let (mut finer, mut new) = (grading.clone(), Vec::new());
            critical.iter().for_each(|&cube| finer.subdivide(cube, &mut new));
            // A place on a face may be taken for one across, which may be subdivided already.
            uncertain.extend(critical.iter().filter(|&&cube| grading.is_subdivided(cube)));
            refined += new.len();
            if new.is_empty() || (refined > allowed && !setting.dense) {
                break;
            }
            grading = finer;
            let task = Task::Changed(&Changed::new(&new), &blocks);
            let made = self.surfaces(setting, space, &grading, task, budget)?;
            critical = add(setting, &grading, &mut blocks, made, &mut uncertain, budget)?;
            self.check(&mut blocks, budget)?;
        }
        let uncertain = uncertain.len() + critical.len();
        let (mut site_error, mut triangles) = (SiteError::default(), 0);
        for surface in blocks.values_mut().filter_map(|surface| surface.get_mut().ok()) {
            site_error = site_error.max(surface.site_error);
            triangles += surface.triangles.len() as u64;
        }
        self.prove(setting, site_error, triangles, budget);
        let surface = self.assemble(setting, space, &grading, blocks, budget)?;
        let mended = self.mended(setting, space, surface, uncertain as u64, budget)?;
        let is_shape = self.meant.off == 0.0 && site_error.is_zero();
        let may_be_exact = !setting.dense && mended.uncertain == 0 && mended.crossings == 0;
        let flow = self.flow(setting, space);
        let is_of_sites = || arrangement::is_of_sites(setting, &self.rule, &space.candidates, flow.as_ref(), budget);
        let is_exact = may_be_exact && (is_shape || is_of_sites()?);
        let is_clear = mended.uncertain == 0 && mended.crossings == 0;
        let mut made = self.certify(setting, mended, is_exact, Some(setting.lattice.pitch), budget)?;
        if is_clear
            && !is_exact
            && let Some(flow) = flow
        {
            // Of points whose dilation is clear it is exact: they are not asked in turn.
            let told = told::is_told(&flow, made.solid.topology(), budget)?;
            made.topology_exact = told == Some(true);
            made.uncertain += u64::from(told == Some(false));
        }
        Ok(made)
    }

    /// Holds all blocks against the limits.
    fn check(&self, blocks: &mut Blocks, budget: &Budget) -> Result<(), DilationError> {
        let (mut triangles, mut leaves) = (0, 0);
        for surface in blocks.values_mut().filter_map(|surface| surface.get_mut().ok()) {
            triangles += surface.triangles.len() as u64;
            leaves += surface.leaves;
        }
        if triangles > budget.limits.triangles {
            return Err(DilationError::Triangles { tolerance_mm: self.aimed, allowed: budget.limits.triangles });
        }
        if leaves > budget.limits.cells {
            return Err(DilationError::LeafCells { tolerance_mm: self.aimed, allowed: budget.limits.cells });
        }
        Ok(())
    }

    /// The dilation by an arrangement, if there is one and it comes out.
    fn of_arrangement(
        &self,
        arrangement: Option<Arrangement>,
        setting: &Setting,
        space: &Space,
        budget: &Budget,
    ) -> Result<Option<OfSites>, DilationError> {
        let Some(mut arrangement) = arrangement else { return Ok(None) };
        let allowed = budget.limits.triangles;
        let too_many = || DilationError::Triangles { tolerance_mm: self.aimed, allowed };
        if arrangement.leaves() > budget.limits.cells {
            return Err(DilationError::LeafCells { tolerance_mm: self.aimed, allowed: budget.limits.cells });
        }
        // What is expected is known to a factor of 2.
        if arrangement.triangles > 2.0 * allowed as f64 {
            return Err(too_many());
        }
        let Some(Arranged { mut surface, uncertain, is_done }) = arrangement.run(budget)? else { return Ok(None) };
        if surface.triangles.len() as u64 > allowed {
            return Err(too_many());
        }
        let flow = self.flow(setting, space);
        let is_exact = uncertain == 0
            && if setting.dense {
                flow.zip(arrangement.points())
                    .map(|(flow, points)| flow.is_that_of(&Figure::of_points(&in_plane(points, setting)), budget))
                    .transpose()?
                    .unwrap_or_default()
            } else {
                arrangement.is_of_another(&self.rule, flow.as_ref(), budget)?
            };
        let doubts = arrangement.take_doubts();
        let (index, narrower, copies) = arrangement.into_index();
        self.prove(setting, surface.site_error, surface.triangles.len() as u64, budget);
        if is_done {
            if copies.triangles(&surface) > allowed {
                return Err(too_many());
            }
            copies.put(&mut surface);
            return self
                .certify(setting, Mended { surface, uncertain, crossings: 0 }, is_exact, None, budget)
                .map(|dilation| Some(OfSites { dilation, doubts }));
        }
        copies.round(&mut surface);
        let bounds = self.bounds.grown(2.0 * self.radius);
        let core = Core { low: bounds.low.map(|x| x.low), high: bounds.high.map(|x| x.high) };
        patches::simplify(&narrower, &index, core, &mut surface, budget)?;
        drop(index);
        if copies.triangles(&surface) > allowed {
            return Err(too_many());
        }
        let mended = self.put(setting, space, surface, &copies, uncertain, budget)?;
        self.certify(setting, mended, is_exact, None, budget).map(|dilation| Some(OfSites { dilation, doubts }))
    }

    /// The dilation of what is meant, for what tells its topology; none where it has several radii, or what solids enclose, or its cells do not tell where it is.
    fn flow<'b>(&'b self, setting: &Setting, space: &'b Space) -> Option<Flow<'b>> {
        let own = self.rule.attractor();
        let is_another = self.meant.off > 0.0;
        let (attractor, candidates) = if is_another { (self.meant.shape?, &space.meant) } else { (own, &space.candidates) };
        let is_plain = own.solids().is_empty() && (0..own.roots().len() as u32).all(|root| self.rule.deficit(root) == 0.0);
        let (plane, width) =
            if arrangement::is_thin(setting) && !is_another { (Some((setting.thin, setting.middle)), setting.width) } else { (None, 0.0) };
        let Setting { reach, slack, .. } = *setting;
        is_plain.then_some(Flow { attractor, candidates, radius: reach, slack: slack + width, plane })
    }

    /// A surface that was mended, with parts that are like others where they are.
    fn put(
        &self,
        setting: &Setting,
        space: &Space,
        surface: BlockSurface,
        copies: &Copies,
        uncertain: u64,
        budget: &Budget,
    ) -> Result<Mended, DilationError> {
        let mut whole = if copies.is_empty() { BlockSurface::default() } else { surface.alone() };
        let mut mended = self.mended(setting, space, surface, uncertain, budget)?;
        if copies.is_empty() {
            return Ok(mended);
        }
        if mended.uncertain == uncertain && mended.crossings == 0 && copies.are_whole(&mended.surface) {
            copies.put(&mut mended.surface);
            return Ok(mended);
        }
        // What is in doubt is so for each of them, and what was moved by steps of single precision is not congruent elsewhere.
        copies.put(&mut whole);
        self.mended(setting, space, whole, uncertain, budget)
    }

    /// A surface without what is no more than rounding, with what rounding broke mended.
    fn mended(
        &self,
        setting: &Setting,
        space: &Space,
        mut surface: BlockSurface,
        uncertain: u64,
        budget: &Budget,
    ) -> Result<Mended, DilationError> {
        let is_proven = !setting.dense && uncertain == 0;
        let uncertain = uncertain + dust::remove(setting, &self.rule, &space.candidates, is_proven, &mut surface) as u64;
        let (vertices, triangles) = (std::mem::take(&mut surface.vertices), std::mem::take(&mut surface.triangles));
        let made = mend::mend(vertices, triangles, setting.rounding, budget)?;
        surface = BlockSurface { vertices: made.points, triangles: made.triangles, ..surface };
        Ok(Mended { surface, uncertain, crossings: made.crossings })
    }

    fn surfaces(
        &self,
        setting: &Setting,
        space: &Space,
        grading: &Grading,
        task: Task<'_>,
        budget: &Budget,
    ) -> Result<Vec<BlockSurface>, DilationError> {
        self.pass(setting, grading, task, budget, space.blocks).run([0; 3], space.blocks, &space.candidates)
    }

    fn pass<'b>(&'b self, setting: &'b Setting, grading: &'b Grading, task: Task<'b>, budget: &'b Budget, blocks: i64) -> Pass<'b> {
        Pass::new(&self.rule, setting, grading, task, budget, (blocks as f64).powi(3))
    }

    /// One surface from those of all blocks, with as few triangles as the promise allows.
    fn assemble(
        &self,
        setting: &Setting,
        space: &Space,
        grading: &Grading,
        mut blocks: Blocks,
        budget: &Budget,
    ) -> Result<BlockSurface, DilationError> {
        let pass = self.pass(setting, grading, Task::Whole, budget, space.blocks);
        let (mut site_error, mut leaves) = (SiteError::default(), 0);
        for surface in blocks.values_mut().filter_map(|surface| surface.get_mut().ok()) {
            site_error = site_error.max(surface.site_error);
            leaves += surface.leaves;
            // They are of no use any more.
            surface.drop_lattice();
        }
        let solids: Vec<u32> = (0..self.rule.attractor().solids().len() as u32).collect();
        let assembly = Assembly { pass: &pass, blocks: &blocks, simplifiers: Pool::default() };
        let root = assembly.node(Node { first_block: [0; 3], blocks: space.blocks }, &space.candidates, &solids)?.unwrap_or_default();
        Ok(BlockSurface { leaves, site_error: root.site_error.max(site_error), ..root })
    }

    /// The space of a lattice.
    pub(super) fn space(&self, setting: &Setting) -> Space {
        let attractor = self.rule.attractor();
        let size = (0..3)
            .map(|axis| self.bounds.high[axis].high + setting.reach + 1.5 * setting.lattice.pitch - setting.lattice.origin[axis])
            .fold(0.0, f64::max);
        let blocks = (size / (setting.lattice.pitch * block::SIDE as f64)).ceil().max(1.0) as u64;
        let mut candidates = Candidates::default();
        let mut met: HashSet<Vec<u64>> = HashSet::new();
        for (index, root) in attractor.roots().iter().enumerate() {
            let cell = attractor.root_cell(index);
            let leaf = self.rule.leaf(&cell, &root.points).is_some();
            // Points, segments and triangles that are stated again add nothing; triangles of a solid tell its sides.
            let is_stated = leaf && root.solid.is_none() && attractor.state_of(&cell).leaf == LeafPrimitive::Simplex;
            let deficit = self.rule.deficit(index as u32);
            if is_stated && !met.insert(root.points.iter().flatten().chain([&deficit]).map(|x| x.to_bits()).collect()) {
                continue;
            }
            candidates.push(cell, &root.points, leaf);
        }
        let meant = self.meant.shape.map(Candidates::of_roots).unwrap_or_default();
        Space { blocks: blocks.next_power_of_two() as i64, candidates, meant }
    }

    /// The bounds of a surface between the ends of the band, as those of a lattice and of what is simplified are: inner and outer, in mm.
    fn proven(&self, setting: &Setting, site: SiteError) -> [f64; 2] {
        // x is in the solid if d(x, S) <= least, and d(x, S)^2 <= (d(x, A) + inner)^2 + inner_square, or at most `square` where d(x, A) <= r - e.
        let squares = setting.least.powi(2);
        let inside = (squares - site.inner_square).max(0.0).sqrt() - site.inner - self.extra;
        let outside = setting.outer + site.outer + self.extra;
        let (mut inner, outer) = (self.radius - inside, outside - self.radius);
        if site.square <= squares {
            inner = inner.min(self.tolerance);
        }
        // What is close to a site in space reaches as far as is aimed at.
        let bounds = [self.balls.inner(inner), self.balls.outer(outer).max(if setting.dense { self.aimed } else { 0.0 })];
        // Dilations of sets within d of each other, D(r) and D'(r), have D(r - d) in D'(r) in D(r + d).
        bounds.map(|bound| bound + self.meant.deviation_mm)
    }

    /// Tells what is proven of a surface before it is simplified, which keeps it between the same ends of the band.
    fn prove(&self, setting: &Setting, site: SiteError, triangles: u64, budget: &Budget) {
        let [inner_mm, outer_mm] = self.proven(setting, site);
        budget.prove(inner_mm.max(outer_mm));
        budget.report("stitch", 0.0, triangles);
    }

    /// The dilation of which a surface bounds the solid, with what is proven of it: `is_exact` tells whether what sites stand for has the topology of theirs.
    fn certify(
        &self,
        setting: &Setting,
        mended: Mended,
        is_exact: bool,
        pitch_mm: Option<f64>,
        budget: &Budget,
    ) -> Result<Dilation, DilationError> {
        let Mended { surface, uncertain, crossings } = mended;
        let [inner_mm, outer_mm] = self.proven(setting, surface.site_error);
        let leaf_cells = surface.leaves;
        let mesh = TriMesh { vertices: surface.vertices.into_iter().map(DVec3::from_array).collect(), triangles: surface.triangles };
        // Signs from pseudo-normals are right for embedded surfaces only; elsewhere they tear the result.
        let has_solids = !self.rule.attractor().solids().is_empty();
        let solid = Solid::new(mesh, budget).map_err(|error| match error {
            SolidError::NotManifold(_) if has_solids => DilationError::Inside,
            other => other.into(),
        })?;
        budget.prove(inner_mm.max(outer_mm));
        budget.report("dilate", 1.0, solid.mesh().triangles.len() as u64);
        Ok(Dilation {
            solid,
            crossings,
            inner_mm,
            outer_mm,
            least_radius_mm: self.balls.least,
            pitch_mm,
            leaf_cells,
            bounds: self.meant.bounds,
            uncertain,
            topology_exact: is_exact && uncertain == 0 && crossings == 0,
        })
    }
}

/// Points that lie in the plane that a shape does but for how far that is up, moved straight into it: their dilation moves with them.
fn in_plane(mut points: Vec<Point>, setting: &Setting) -> Vec<Point> {
    points.iter_mut().for_each(|point| point[setting.thin] = setting.middle);
    points
}

/// What comes of an arrangement.
struct OfSites {
    dilation: Dilation,
    /// Places where its topology is in doubt, if there are few, and only as its sites stand for what is meant.
    doubts: Option<Vec<Point>>,
}

/// What comes of rays: the surface, columns that were looked at, and bytes that were held at most.
struct Over {
    setting: Setting,
    made: Flat,
    columns: u64,
    bytes: f64,
}

/// A surface that was mended.
struct Mended {
    surface: BlockSurface,
    /// Places where the topology is not certain, shells included that went and may have been the dilation's, see `dust`.
    uncertain: u64,
    /// Pairs of triangles that meet elsewhere than they should.
    crossings: u64,
}

/// Adds surfaces to those of blocks, in the place of what was there; returns the cubes to subdivide, and adds those where no level tells it to `uncertain`.
fn add(
    setting: &Setting,
    grading: &Grading,
    blocks: &mut Blocks,
    mut made: Vec<BlockSurface>,
    uncertain: &mut BTreeSet<Cube>,
    budget: &Budget,
) -> Result<BTreeSet<Cube>, DilationError> {
    uncertain.extend(made.iter_mut().flat_map(|surface| std::mem::take(&mut surface.uncertain)));
    let mut critical: BTreeSet<Cube> = made.iter_mut().flat_map(|surface| std::mem::take(&mut surface.critical)).collect();
    let place = |surface: &BlockSurface| surface.first_cube.map(|x| x / block::SIDE as i64);
    let places: BTreeSet<[i64; 3]> = made.iter().map(place).collect();
    blocks.extend(made.into_iter().map(|surface| (place(&surface), Mutex::new(surface))));
    if !setting.dense {
        let [own, open] = seam::noted(setting, grading, blocks, &places, budget)?;
        critical.extend(own);
        uncertain.extend(open);
    }
    Ok(critical)
}

#[cfg(test)]
mod tests;
