//! Space and automaton refined together: cubes of space that the surface cannot meet are dropped with all
//! their cells, cells are expanded only as far as the cube's size asks.

use super::DilationError;
use super::block::{SIDE, Workshop, signed_side};
use super::lattice::{Cube, Grading, around};
use super::pool::Pool;
use super::setting::Setting;
use super::surface::{BlockSurface, Blocks, NameHasher};
use super::tree::{Candidate, Candidates, with_deficit};
use crate::attractor::Attractor;
use crate::attractor::cell::{Point, child_points, distance_squared};
use crate::attractor::sites::SiteRule;
use crate::budget::Budget;
use rayon::prelude::*;
use std::collections::{BTreeSet, HashSet};
use std::hash::BuildHasherDefault;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Where the lattice has changed.
#[derive(Debug, Default)]
pub(super) struct Changed {
    /// The cubes that were subdivided.
    subdivided: HashSet<Cube, BuildHasherDefault<NameHasher>>,
    /// The cubes of level 0 that hold them, or touch these.
    cubes: HashSet<[i64; 3], BuildHasherDefault<NameHasher>>,
    /// The blocks that hold those, by their place in units of blocks.
    blocks: BTreeSet<[i64; 3]>,
}

impl Changed {
    pub(super) fn new(subdivided: &[Cube]) -> Self {
        let cubes: HashSet<_, _> = subdivided.iter().flat_map(|cube| around(cube.base())).collect();
        let blocks = cubes.iter().map(|cube: &[i64; 3]| cube.map(|x| x.div_euclid(SIDE as i64))).collect();
        Self { subdivided: subdivided.iter().copied().collect(), cubes, blocks }
    }

    /// Whether a cube's tetrahedra are not what they were: it is subdivided now, or half of a cube that is, or touches one or the halves of one. What
    /// [`Grading::tetrahedra`] asks of a leaf's neighbours is whether they and the cubes above them are subdivided.
    pub(super) fn is_new(&self, cube: Cube) -> bool {
        let is_subdivided = |cube: Cube| self.subdivided.contains(&cube);
        let touches = |index: [i64; 3]| {
            let near = Cube { index, ..cube };
            is_subdivided(near) || near.parent().is_some_and(is_subdivided)
        };
        around(cube.index).any(touches)
    }
}

/// What a pass asks of the blocks.
#[derive(Clone, Copy)]
pub(super) enum Task<'a> {
    /// The surface, and the search for critical points, in all tetrahedra.
    Whole,
    /// The same in those that are new where the lattice has changed. The other ones' surface is taken from what was made before.
    Changed(&'a Changed, &'a Blocks),
}

impl Task<'_> {
    /// The blocks that it is about, unless it is about all.
    fn blocks(&self) -> Option<&BTreeSet<[i64; 3]>> {
        match self {
            Self::Whole => None,
            Self::Changed(changed, _) => Some(&changed.blocks),
        }
    }

    /// Whether the tetrahedra of a cube of level 0 are to be looked at.
    pub(super) fn is_about(&self, cube: &[i64; 3]) -> bool {
        match self {
            Self::Whole => true,
            Self::Changed(changed, _) => changed.cubes.contains(cube),
        }
    }

    /// Whether the tetrahedra of a leaf are.
    pub(super) fn is_new(&self, leaf: Cube) -> bool {
        match self {
            Self::Whole => true,
            Self::Changed(changed, _) => changed.is_new(leaf),
        }
    }

    /// What is there already of a block's surface.
    fn begun(&self, block: [i64; 3]) -> BlockSurface {
        let mut surface = match self {
            Self::Whole => BlockSurface::default(),
            Self::Changed(changed, blocks) => {
                let before = blocks.get(&block).and_then(|before| before.lock().ok()).map(|mut before| std::mem::take(&mut *before));
                let mut before = before.unwrap_or_default();
                before.drop_changed(changed);
                before
            }
        };
        surface.first_cube = block.map(|x| x * SIDE as i64);
        surface
    }
}

/// What all tasks of one pass share.
pub(super) struct Pass<'a> {
    pub(super) attractor: &'a Attractor,
    pub(super) rule: &'a SiteRule<'a>,
    pub(super) setting: &'a Setting,
    pub(super) grading: &'a Grading,
    pub(super) task: Task<'a>,
    pub(super) budget: &'a Budget,
    pub(super) triangles: AtomicU64,
    /// Leaf cells met in its blocks.
    leaves: AtomicU64,
    /// Whether a limit was hit: what is left need not be done.
    pub(super) failed: AtomicBool,
    /// Cubes of the lattice that are done, of those of the whole space.
    pub(super) done: AtomicU64,
    pub(super) space: f64,
    /// Working memories that no thread uses now.
    pub(super) workshops: Pool<Workshop<'a>>,
}

/// A cube of space: `blocks` blocks along its side, a power of two.
#[derive(Clone, Copy)]
pub(super) struct Node {
    pub(super) first_block: [i64; 3],
    pub(super) blocks: i64,
}

impl Node {
    /// Its eight halves.
    pub(super) fn children(self) -> Vec<Self> {
        let half = self.blocks / 2;
        let child = |octant: i64| Self {
            first_block: std::array::from_fn(|axis| self.first_block[axis] + half * (octant >> axis & 1)),
            blocks: half,
        };
        (0..8).map(child).collect()
    }
}

/// Cells larger than this share of a cube's half diagonal are expanded.
const CELL_SHARE: f64 = 0.4;

impl<'a> Pass<'a> {
    /// One over so many blocks of space.
    pub(super) fn new(
        rule: &'a SiteRule<'a>,
        setting: &'a Setting,
        grading: &'a Grading,
        task: Task<'a>,
        budget: &'a Budget,
        space: f64,
    ) -> Self {
        Self {
            attractor: rule.attractor(),
            rule,
            setting,
            grading,
            task,
            budget,
            triangles: AtomicU64::new(0),
            leaves: AtomicU64::new(0),
            failed: AtomicBool::new(false),
            done: AtomicU64::new(0),
            space,
            workshops: Pool::default(),
        }
    }

    /// The surface in the cube of `blocks` blocks a side that begins at block `first`.
    pub(super) fn run(&self, first: [i64; 3], blocks: i64, candidates: &Candidates) -> Result<Vec<BlockSurface>, DilationError> {
        let solids: Vec<u32> = (0..self.attractor.solids().len() as u32).collect();
        self.node(Node { first_block: first, blocks }, candidates, &solids)
    }

    fn node(&self, node: Node, candidates: &Candidates, open: &[u32]) -> Result<Vec<BlockSurface>, DilationError> {
        self.budget.cancel.check()?;
        // Where one part has failed there is no result, and its error is the answer.
        if !self.is_wanted(node) || self.failed.load(Ordering::Relaxed) {
            return Ok(Vec::new());
        }
        let reduced = self.reduce(node, candidates, open).inspect_err(|_| self.failed.store(true, Ordering::Relaxed))?;
        let Some((kept, open)) = reduced else {
            self.finish(node);
            return Ok(Vec::new());
        };
        if node.blocks == 1 {
            let surface = self.block(node, &kept, &open).inspect_err(|_| self.failed.store(true, Ordering::Relaxed))?;
            self.finish(node);
            return Ok(surface.into_iter().collect());
        }
        let parts: Vec<Result<Vec<BlockSurface>, DilationError>> =
            node.children().into_par_iter().with_max_len(1).map(|child| self.node(child, &kept, &open)).collect();
        let mut surfaces = Vec::new();
        for part in parts {
            surfaces.extend(part?);
        }
        Ok(surfaces)
    }

    fn is_wanted(&self, node: Node) -> bool {
        let inside =
            |block: &[i64; 3]| (0..3).all(|axis| (node.first_block[axis]..node.first_block[axis] + node.blocks).contains(&block[axis]));
        // The first axis orders the set.
        let first = [node.first_block[0], i64::MIN, i64::MIN];
        let end = [node.first_block[0] + node.blocks, i64::MIN, i64::MIN];
        self.task.blocks().is_none_or(|blocks| blocks.range(first..end).any(inside))
    }

    fn finish(&self, node: Node) {
        let blocks = node.blocks.unsigned_abs().pow(3);
        let before = self.done.fetch_add(blocks, Ordering::Relaxed);
        let fraction = |done: u64| done as f64 / self.space;
        if (fraction(before) * 200.0).floor() < (fraction(before + blocks) * 200.0).floor() {
            self.budget.report("dilate", fraction(before + blocks).min(1.0), self.triangles.load(Ordering::Relaxed));
        }
    }

    /// Middle and half diagonal of all lattice vertices that the cube's tetrahedra use.
    fn extent(&self, node: Node) -> (Point, f64) {
        let lattice = &self.setting.lattice;
        let cubes = node.blocks as f64 * SIDE as f64;
        let corner = lattice.corner(node.first_block.map(|block| block * SIDE as i64));
        let half = 0.5 * cubes * lattice.pitch;
        (corner.map(|x| x + half), (half + 0.5 * lattice.pitch) * 3.0_f64.sqrt() * 1.000_001)
    }

    /// The cells that may cover something of the cube, and the solids whose
    /// surface meets the cube, of those that are still `open`; `None` when the result's surface cannot meet
    /// the cube.
    pub(super) fn reduce(
        &self,
        node: Node,
        candidates: &Candidates,
        open: &[u32],
    ) -> Result<Option<(Candidates, Vec<u32>)>, DilationError> {
        let (middle, half) = self.extent(node);
        let size = CELL_SHARE * half;
        let mut brackets = Vec::with_capacity(candidates.cells.len());
        let mut expanded = Candidates::default();
        let mut upper = f64::INFINITY;
        // Sites farther than this cover nothing of the cube, but may tell the inside of a solid.
        let horizon = self.setting.sight + half;
        for candidate in &candidates.cells {
            self.expand(&middle, size, candidate, candidates, horizon, &mut upper, &mut brackets, &mut expanded)?;
        }
        // One site covers all of the cube.
        if upper + half < self.setting.reach {
            return Ok(None);
        }
        let Some(reaches) = self.solids(&middle, half, &brackets, &expanded, open) else { return Ok(None) };
        let slack = self.setting.slack;
        let threshold = horizon + slack;
        let mut kept = Candidates::default();
        let mut lowest = f64::INFINITY;
        for ((lower, _), candidate) in brackets.iter().zip(&expanded.cells) {
            let solid = self.attractor.roots()[candidate.cell.root as usize].solid;
            let own = solid.map_or(f64::NEG_INFINITY, |solid| reaches[solid as usize]);
            let weighted = with_deficit(*lower, self.rule.deficit(candidate.cell.root));
            if weighted <= threshold || *lower <= own {
                lowest = lowest.min(weighted);
                kept.push(candidate.cell, expanded.points_of(self.attractor, candidate), candidate.leaf);
            }
        }
        let still_open = open.iter().copied().filter(|&solid| reaches[solid as usize] > f64::NEG_INFINITY).collect();
        Ok((lowest <= self.setting.reach + self.setting.gap + half + slack).then_some((kept, still_open)))
    }

    /// Expands a candidate until its cells are as small as the cube asks, and brackets their distances in space.
    #[allow(clippy::too_many_arguments)]
    fn expand(
        &self,
        middle: &Point,
        size: f64,
        candidate: &Candidate,
        from: &Candidates,
        horizon: f64,
        upper: &mut f64,
        brackets: &mut Vec<(f64, f64)>,
        to: &mut Candidates,
    ) -> Result<(), DilationError> {
        self.budget.cancel.check()?;
        if to.cells.len() >= self.setting.cells {
            return Err(DilationError::Cells { allowed: self.setting.cells });
        }
        let points = from.points_of(self.attractor, candidate);
        let deficit = self.rule.deficit(candidate.cell.root);
        let ball = candidate.cell.ball;
        let distance = distance_squared(middle, &ball.centre).sqrt();
        if candidate.leaf {
            let nearest = self.rule.nearest(middle, &candidate.cell, points).sqrt();
            *upper = upper.min(with_deficit(nearest, deficit) + self.setting.slack);
            brackets.push((nearest - self.setting.slack, nearest));
            to.push(candidate.cell, points, true);
            return Ok(());
        }
        let in_solid = self.attractor.roots()[candidate.cell.root as usize].solid.is_some();
        if ball.radius <= size || (distance - ball.radius > horizon && !in_solid) {
            *upper = upper.min(with_deficit(distance + ball.radius, deficit) + self.setting.slack);
            brackets.push((distance - ball.radius - self.setting.slack, distance + ball.radius));
            to.push(candidate.cell, points, false);
            return Ok(());
        }
        let state = self.attractor.state_of(&candidate.cell);
        for (index, transition) in state.transitions.iter().enumerate() {
            let mut child = Candidates::default();
            let mut child_control = vec![[0.0; 4]; transition.operator.columns()];
            child_points(points, &transition.operator, &mut child_control);
            let cell = self.attractor.child_cell(&candidate.cell, index, &child_control);
            let leaf = self.rule.leaf(&cell, &child_control).is_some();
            child.push(cell, &child_control, leaf);
            let only = child.cells[0];
            self.expand(middle, size, &only, &child, horizon, upper, brackets, to)?;
        }
        Ok(())
    }

    /// Per solid, the distance up to which its triangles must be kept: where its surface meets the cube, all
    /// that may be nearest to a vertex; elsewhere none, once it is known that the cube lies outside. `None`
    /// when the cube lies inside a solid.
    fn solids(&self, middle: &Point, half: f64, brackets: &[(f64, f64)], candidates: &Candidates, open: &[u32]) -> Option<Vec<f64>> {
        let count = self.attractor.solids().len();
        let mut nearest: Vec<Option<(f64, u32)>> = vec![None; count];
        for ((_, distance), candidate) in brackets.iter().zip(&candidates.cells) {
            let root = candidate.cell.root;
            if let Some(solid) = self.attractor.roots()[root as usize].solid {
                let best = &mut nearest[solid as usize];
                if best.is_none_or(|(known, _)| *distance < known) {
                    *best = Some((*distance, root));
                }
            }
        }
        let mut keep = vec![f64::NEG_INFINITY; count];
        // A solid that is no longer open has the cube outside, and not all of its triangles are here.
        for &solid in open {
            let Some((distance, root)) = nearest[solid as usize] else { continue };
            if distance > half {
                if signed_side(self.attractor, solid, root, middle) < 0.0 {
                    return None;
                }
            } else {
                keep[solid as usize] = distance + 2.0 * half + self.setting.slack;
            }
        }
        Some(keep)
    }

    pub(super) fn block(&self, node: Node, candidates: &Candidates, open: &[u32]) -> Result<Option<BlockSurface>, DilationError> {
        let workshop = || Workshop::new(self.rule, self.setting, &self.budget.cancel);
        self.workshops.with(workshop, |workshop| self.surface(workshop, node, candidates, open))
    }

    fn surface(
        &self,
        workshop: &mut Workshop<'a>,
        node: Node,
        candidates: &Candidates,
        open: &[u32],
    ) -> Result<Option<BlockSurface>, DilationError> {
        let mut surface = self.task.begun(node.first_block);
        let kept = surface.triangles.len();
        workshop.complete(self.setting, self.grading, self.task, &mut surface, candidates, open);
        self.budget.cancel.check()?;
        if workshop.is_exhausted() {
            return Err(DilationError::Cells { allowed: self.setting.cells });
        }
        if surface.triangles.is_empty() && surface.critical.is_empty() && surface.uncertain.is_empty() {
            return Ok(None);
        }
        let made = (surface.triangles.len() - kept) as u64;
        let total = self.triangles.fetch_add(made, Ordering::Relaxed) + made;
        let allowed = self.budget.limits.triangles;
        if total > allowed {
            return Err(DilationError::Triangles { tolerance_mm: self.setting.tolerance, allowed });
        }
        let leaves = self.leaves.fetch_add(surface.leaves, Ordering::Relaxed) + surface.leaves;
        let allowed = self.budget.limits.cells;
        if leaves > allowed {
            return Err(DilationError::LeafCells { tolerance_mm: self.setting.tolerance, allowed });
        }
        Ok(Some(surface))
    }
}
