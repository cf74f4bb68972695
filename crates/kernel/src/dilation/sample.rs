//! How many triangles a lattice will have, from a sample of its blocks.
//!
//! The octree is descended level by level. Of the nodes of a level that the surface may meet as many are followed as can be in a moment, chosen
//! at random, one of each run of neighbours; each stands for as many as there were for one of those. So every block has the same chance to be
//! reached, whatever its place, and the sum over the blocks that are, times the inverse of that chance, has the number sought as its mean
//! (D. E. Knuth, "Estimating the efficiency of backtrack programs", Math. Comp. 29, 1975; P. C. Chen, "Heuristic sampling", SIAM J. Comput. 21, 1992).
//! A lattice with no more blocks than a sample has is counted, not estimated.

use super::DilationError;
use super::lattice::Grading;
use super::octree::{Changed, Node, Pass, Task};
use super::setting::Setting;
use super::simplify::{OF_LATTICE, Simplifier};
use super::surface::Blocks;
use super::tree::Candidates;
use crate::split_mix::Random;
use rayon::prelude::*;
use std::sync::{Arc, Mutex};

/// Nodes of a level that are followed: enough for an error of some ten per cent.
const FOLLOWED: usize = 48;
/// Fewer, where they hold more cells than this between them, as cells that overlap do at fine tolerances: what a level costs in time and memory is bounded by that.
const MOST_HELD: usize = 300_000;
const FEWEST: usize = 4;
/// Of the blocks at the end so many are made at a time, and so often at least, until they have so many triangles and leaf cells.
const AT_A_TIME: usize = 4;
const AT_LEAST: usize = 3;
const ENOUGH: u64 = 40_000;
/// What a list that grows to twice what it holds takes for each byte in it, in the mean.
const GROWN: f64 = 1.5;

/// What is expected of a lattice's surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Expected {
    /// Triangles as they are made at first.
    pub(super) made: f64,
    /// Triangles after the refinement that the topology asks for, without those that are no more than rounding.
    pub(super) triangles: f64,
    /// Leaf cells that the blocks meet, each once in every block.
    pub(super) leaves: f64,
    /// Most bytes that the simplification of a block holds besides.
    pub(super) simplifying: f64,
    /// Those of all blocks together: what it looks at.
    pub(super) looked_at: f64,
    /// Nodes and sites that the searches of all blocks look at.
    pub(super) searched: f64,
    /// Sites that they find near points, for each point anew.
    pub(super) found: f64,
}

/// What was made of a block.
#[derive(Clone, Copy, Default)]
struct Made {
    made: u64,
    triangles: u64,
    leaves: u64,
    searched: u64,
    found: u64,
    simplifying: usize,
    /// Triangles of a block whose simplification was tried.
    tried: u64,
}

/// What an octree's nodes share with the halves of it: the cells that may matter in them, and the solids whose surface may meet them.
type Inherited = Arc<(Candidates, Vec<u32>)>;

impl Pass<'_> {
    /// What is expected in the cube of `blocks` blocks a side that begins at block 0; `simplify` tells whether the simplification is of interest.
    ///
    /// Deterministic, for any number of threads. Cost: that of eight times [`FOLLOWED`] nodes for each level, fewer where they hold many cells, and of the blocks that are made.
    ///
    /// # Errors
    /// As [`Pass::run`].
    pub(super) fn expected(&self, blocks: i64, candidates: &Candidates, simplify: bool) -> Result<Expected, DilationError> {
        let solids: Vec<u32> = (0..self.attractor.solids().len() as u32).collect();
        let mut level = vec![(Node { first_block: [0; 3], blocks }, Inherited::new((candidates.clone(), solids)))];
        let (mut stands_for, mut chance) = (1.0, Random(1));
        loop {
            let reduced: Vec<Result<Option<(Node, Inherited)>, DilationError>> = level
                .into_par_iter()
                .with_max_len(1)
                .map(|(node, inherited)| {
                    self.budget.cancel.check()?;
                    Ok(self.reduce(node, &inherited.0, &inherited.1)?.map(|kept| (node, Inherited::new(kept))))
                })
                .collect();
            let mut met = Vec::with_capacity(reduced.len());
            for node in reduced {
                met.extend(node?);
            }
            let most = (MOST_HELD * met.len() / held(&met).max(1)).clamp(FEWEST, FOLLOWED);
            let followed = followed(met, most, &mut stands_for, &mut chance);
            if followed.first().is_none_or(|(node, _)| node.blocks == 1) {
                return self.expected_of(followed, stands_for, &mut chance, simplify);
            }
            level = followed.iter().flat_map(|(node, kept)| node.children().into_iter().map(|child| (child, Arc::clone(kept)))).collect();
        }
    }
}

impl Pass<'_> {
    /// What is expected of blocks that stand for so many each, from as many of them as are enough.
    fn expected_of(
        &self,
        mut blocks: Vec<(Node, Inherited)>,
        stands_for: f64,
        chance: &mut Random,
        simplify: bool,
    ) -> Result<Expected, DilationError> {
        // In no order, so that the first are like all.
        for last in (1..blocks.len()).rev() {
            blocks.swap(last, (chance.share() * (last + 1) as f64) as usize);
        }
        let mut cleaning = self.setting.clone();
        cleaning.clean_only = true;
        let (mut sum, mut done, mut looked_at) = (Made::default(), 0, 0);
        let held = held(&blocks) / blocks.len().max(1);
        let at_a_time = (MOST_HELD / 4 / held.max(1)).clamp(1, AT_A_TIME);
        for (round, some) in blocks.chunks(at_a_time).enumerate() {
            // What simplification holds differs little from block to block; to find it takes as long as all the rest. Blocks may be empty.
            let simplify = simplify && sum.tried == 0;
            let made: Vec<Result<Made, DilationError>> =
                some.par_iter().with_max_len(1).map(|(node, inherited)| self.made(*node, inherited, &cleaning, simplify)).collect();
            for made in made {
                let made = made?;
                looked_at += made.simplifying;
                sum = Made {
                    made: sum.made + made.made,
                    triangles: sum.triangles + made.triangles,
                    leaves: sum.leaves + made.leaves,
                    searched: sum.searched + made.searched,
                    found: sum.found + made.found,
                    simplifying: sum.simplifying.max(made.simplifying),
                    tried: sum.tried + made.tried,
                };
            }
            done += some.len();
            let is_enough = round + 1 >= AT_LEAST && sum.triangles.max(sum.made) + sum.leaves > ENOUGH;
            if is_enough || sum.leaves > MOST_HELD as u64 {
                break;
            }
        }
        let each = stands_for * blocks.len() as f64 / done.max(1) as f64;
        let triangles = sum.triangles as f64 * each;
        Ok(Expected {
            made: sum.made as f64 * each,
            triangles,
            leaves: sum.leaves as f64 * each,
            searched: sum.searched as f64 * each,
            found: sum.found as f64 * each,
            simplifying: sum.simplifying as f64 * GROWN,
            // As many to a triangle everywhere as where it was tried.
            looked_at: looked_at as f64 * triangles / sum.tried.max(1) as f64,
        })
    }

    /// A block as it is made at first, and as it is when it has been refined by itself and cleaned.
    fn made(&self, node: Node, inherited: &Inherited, cleaning: &Setting, simplify: bool) -> Result<Made, DilationError> {
        self.budget.cancel.check()?;
        let (candidates, open) = (&inherited.0, &inherited.1);
        let Some(mut surface) = self.block(node, candidates, open)? else { return Ok(Made::default()) };
        let (made, leaves) = (surface.triangles.len() as u64, surface.leaves);
        let mut grading = Grading::default();
        loop {
            let mut new = Vec::new();
            std::mem::take(&mut surface.critical).into_iter().for_each(|cube| grading.subdivide(cube, &mut new));
            if new.is_empty() {
                break;
            }
            let blocks = Blocks::from([(node.first_block, Mutex::new(surface))]);
            let task = Task::Changed(&Changed::new(&new), &blocks);
            surface = self.graded(&grading, task).block(node, candidates, open)?.unwrap_or_default();
        }
        let (searched, found) = (surface.looked, surface.found);
        surface.vertices.iter_mut().flatten().for_each(|x| *x = f64::from(*x as f32));
        let core = self.core(node);
        Simplifier::of(self.rule, cleaning).run(cleaning, &OF_LATTICE, &core, candidates, &mut surface, self.budget)?;
        let triangles = surface.triangles.len() as u64;
        let (mut simplifying, mut tried) = (0, 0);
        if simplify {
            surface.settled.clear();
            let mut simplifier = Simplifier::of(self.rule, self.setting);
            simplifier.run(self.setting, &OF_LATTICE, &core, candidates, &mut surface, self.budget)?;
            (simplifying, tried) = (simplifier.bytes(), triangles);
        }
        Ok(Made { made, triangles, leaves, searched, found, simplifying, tried })
    }

    /// Another task of the same pass over a lattice that is graded otherwise.
    fn graded<'b>(&'b self, grading: &'b Grading, task: Task<'b>) -> Pass<'b> {
        Pass::new(self.rule, self.setting, grading, task, self.budget, self.space)
    }
}

/// Cells that nodes have between them.
fn held(nodes: &[(Node, Inherited)]) -> usize {
    nodes.iter().map(|(_, inherited)| inherited.0.cells.len()).sum()
}

/// Of nodes in their order in space the `most` that are followed: one of each of so many runs of equal length. `stands_for` becomes what each stands for.
fn followed<T: Clone>(nodes: Vec<T>, most: usize, stands_for: &mut f64, chance: &mut Random) -> Vec<T> {
    if nodes.len() <= most {
        return nodes;
    }
    let run = nodes.len() as f64 / most as f64;
    *stands_for *= run;
    // Where runs do not end between two nodes, two of them may choose the same one.
    let chosen = (0..most).map(|number| ((number as f64 + chance.share()) * run) as usize);
    chosen.map(|index| nodes[index.min(nodes.len() - 1)].clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_has_the_mean_of_what_it_is_of() {
        // Values that differ by three orders of magnitude and come in waves; the mean of many samples of them is their sum.
        let values: Vec<f64> = (0..1000).map(|k| 1.0 + f64::from(k % 37).powi(2) + f64::from(k) * 0.5).collect();
        let sum: f64 = values.iter().sum();
        let mut chance = Random(7);
        let samples = 2000;
        let mut total = 0.0;
        for _ in 0..samples {
            let mut stands_for = 1.0;
            let chosen = followed(values.clone(), FOLLOWED, &mut stands_for, &mut chance);
            assert_eq!(chosen.len(), FOLLOWED);
            total += chosen.iter().sum::<f64>() * stands_for;
        }
        // The standard error of this mean is below 0.3 per cent.
        assert!((total / f64::from(samples) / sum - 1.0).abs() < 0.015, "{}", total / f64::from(samples) / sum);
        let mut stands_for = 1.0;
        assert_eq!(followed(vec![1, 2, 3], FOLLOWED, &mut stands_for, &mut chance), [1, 2, 3]);
        assert_eq!(stands_for, 1.0);
    }
}
