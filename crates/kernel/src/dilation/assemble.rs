//! From the surfaces of blocks to one: the octree is walked once more, and every node simplifies what its children leave.

use super::DilationError;
use super::block::SIDE;
use super::octree::{Node, Pass};
use super::pool::Pool;
use super::simplify::{Core, OF_LATTICE, Simplifier};
use super::stitch;
use super::surface::{BlockSurface, Blocks};
use super::tree::{Candidates, Tree};
use rayon::prelude::*;

/// Share of the pitch that keeps a node's core from its neighbours' surfaces: far above rounding, which moves these.
const MARGIN: f64 = 0.01;

/// What the tasks of one walk share.
pub(super) struct Assembly<'a, 'b> {
    pub(super) pass: &'b Pass<'a>,
    pub(super) blocks: &'b Blocks,
    pub(super) simplifiers: Pool<Simplifier<Tree<'a>>>,
}

impl Assembly<'_, '_> {
    /// The joined surface of a node.
    pub(super) fn node(&self, node: Node, candidates: &Candidates, open: &[u32]) -> Result<Option<BlockSurface>, DilationError> {
        self.pass.budget.cancel.check()?;
        if !self.is_used(node) {
            return Ok(None);
        }
        let Some((kept, open)) = self.pass.reduce(node, candidates, open)? else { return Ok(None) };
        let mut surface = if node.blocks == 1 {
            let Some(block) = self.blocks.get(&node.first_block) else { return Ok(None) };
            let mut surface = block.lock().map(|mut surface| std::mem::take(&mut *surface)).unwrap_or_default();
            surface.vertices.iter_mut().flatten().for_each(|x| *x = f64::from(*x as f32));
            surface
        } else {
            let parts: Vec<Result<Option<BlockSurface>, DilationError>> =
                node.children().into_par_iter().with_max_len(1).map(|child| self.node(child, &kept, &open)).collect();
            let mut surfaces = Vec::new();
            for part in parts {
                surfaces.extend(part?);
            }
            stitch::join(surfaces, self.pass.budget)?
        };
        if surface.triangles.is_empty() {
            return Ok(None);
        }
        let core = self.pass.core(node);
        let Pass { rule, setting, budget, .. } = *self.pass;
        let simplified = |simplifier: &mut Simplifier<Tree<'_>>| simplifier.run(setting, &OF_LATTICE, &core, &kept, &mut surface, budget);
        self.simplifiers.with(|| Simplifier::of(rule, setting), simplified)?;
        // No other node has vertices in the core.
        let vertices = &surface.vertices;
        surface.shared.retain(|&(_, number)| !core.contains(&vertices[number as usize]));
        Ok(Some(surface))
    }

    fn is_used(&self, node: Node) -> bool {
        let end = |axis: usize| node.first_block[axis] + node.blocks;
        let inside = |block: &[i64; 3]| (0..3).all(|axis| node.first_block[axis] <= block[axis] && block[axis] < end(axis));
        // The first axis orders the map.
        self.blocks.range([node.first_block[0], i64::MIN, i64::MIN]..[end(0), i64::MIN, i64::MIN]).any(|(block, _)| inside(block))
    }
}

impl Pass<'_> {
    /// The box that only tetrahedra of the node meet: those of its lower neighbours reach half a pitch into it.
    pub(super) fn core(&self, node: Node) -> Core {
        let lattice = &self.setting.lattice;
        let corner = |blocks: i64| lattice.corner(node.first_block.map(|block| (block + blocks) * SIDE as i64));
        Core { low: corner(0).map(|x| x + (0.5 + MARGIN) * lattice.pitch), high: corner(node.blocks).map(|x| x - MARGIN * lattice.pitch) }
    }
}
