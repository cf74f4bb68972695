//! Simplification of a closed surface that no lattice divides: space is halved until few triangles are in each part, the parts are simplified side by side, and then what lies between them, part by part again.
//!
//! A part has all triangles whose boxes meet its own. It changes triangles only that are inside with all corners: no other part has these. Vertices stay where they are, so the course must not lift them: other parts know them by
//! their numbers.

use super::arrangement::Index;
use super::pool::Pool;
use super::setting::Setting;
use super::simplify::{Core, OF_POLYTOPES, Simplifier};
use super::surface::BlockSurface;
use super::tree::NodeId;
use crate::budget::{Budget, Stopped};
use crate::solid::half_edges::NONE;

/// Triangles of a part that is not halved, about.
const MOST_TRIANGLES: usize = 8_192;
/// Halvings between parts that are simplified: an eighth of each.
const STEP: usize = 3;
/// Halvings at most.
const MOST_HALVINGS: usize = 7 * STEP;
/// Both halves of a part have so many half times its triangles at most, as what is across is in both.
const MOST_SHARED: usize = 3;

/// Simplifies a closed surface within the band; `core` holds all of it.
///
/// # Errors
/// [`Stopped`]; the surface is lost then.
pub(super) fn simplify(setting: &Setting, index: &Index, core: Core, surface: &mut BlockSurface, budget: &Budget) -> Result<(), Stopped> {
    let all = Part { core, triangles: (0..surface.triangles.len() as u32).collect(), halvings: 0 };
    let patches = Patches { setting, index, surface, memories: Pool::default(), budget };
    let Patch { inside, across, .. } = patches.of(all, &index.all())?;
    let across = across.into_iter().map(|triangle| surface.triangles[triangle as usize]);
    surface.triangles = inside.into_iter().chain(across).collect();
    surface.drop_unused();
    Ok(())
}

/// A part of space, and the triangles that may meet it.
struct Part {
    core: Core,
    triangles: Vec<u32>,
    halvings: usize,
}

/// What became of the triangles of a part. Vertices are numbered as they are in all of the surface.
#[derive(Default)]
struct Patch {
    /// Those inside, some of which are others now.
    inside: Vec<[u32; 3]>,
    /// The numbers of the others, in ascending order: they are as they were.
    across: Vec<u32>,
    /// Vertices that were tried with all of their stars, see [`BlockSurface::settled`].
    settled: Vec<u32>,
}

struct Patches<'a> {
    setting: &'a Setting,
    index: &'a Index,
    surface: &'a BlockSurface,
    memories: Pool<Memory<'a>>,
    budget: &'a Budget,
}

/// Working memory of a thread.
struct Memory<'a> {
    simplifier: Simplifier<&'a Index>,
    /// Of every vertex of all of the surface, its number in the part that is worked on.
    numbers: Vec<u32>,
}

impl<'a> Patches<'a> {
    fn of(&self, part: Part, figures: &[NodeId]) -> Result<Patch, Stopped> {
        self.budget.cancel.check()?;
        // Figures that are farther from all places inside cover none of them.
        let near = self.index.near(figures, &part.core, self.setting.near);
        let (core, halvings) = (part.core, part.halvings);
        let patch = match self.halves(part) {
            Ok([below, above]) => {
                let (below, above) = rayon::join(|| self.of(below, &near), || self.of(above, &near));
                let patch = self.joined(below?, above?, &core);
                if !halvings.is_multiple_of(STEP) {
                    return Ok(patch);
                }
                patch
            }
            Err(part) => {
                let (inside, across): (Vec<u32>, Vec<u32>) =
                    part.triangles.iter().partition(|&&triangle| self.surface.is_within(triangle, &core));
                Patch {
                    inside: inside.into_iter().map(|triangle| self.surface.triangles[triangle as usize]).collect(),
                    across,
                    settled: Vec::new(),
                }
            }
        };
        self.simplified(&core, &near, patch)
    }

    /// The halves of a part, across the axis along which its triangles are spread most, as many in one as in the other; the part itself where it has few, or most are in both.
    fn halves(&self, part: Part) -> Result<[Part; 2], Part> {
        let Part { core, triangles, halvings } = &part;
        if *halvings == MOST_HALVINGS || triangles.len() <= MOST_TRIANGLES {
            return Err(part);
        }
        let extreme = |triangle: u32, axis: usize, choose: fn(f64, f64) -> f64| {
            let [a, b, c] = self.surface.corners(triangle).map(|corner| corner[axis]);
            choose(choose(a, b), c)
        };
        let begins = |axis: usize| triangles.iter().map(move |&triangle| extreme(triangle, axis, f64::min).max(core.low[axis]));
        let spread =
            |axis: usize| begins(axis).fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], begin| [least.min(begin), most.max(begin)]);
        let mut axes = [2, 1, 0].map(|axis| (axis, spread(axis)));
        axes.sort_by(|(_, a), (_, b)| (b[1] - b[0]).total_cmp(&(a[1] - a[0])));
        let middle = |&(axis, _): &(usize, [f64; 2])| {
            let mut begins: Vec<f64> = begins(axis).collect();
            let (_, &mut plane, _) = begins.select_nth_unstable_by(triangles.len() / 2, f64::total_cmp);
            (core.low[axis] < plane && plane < core.high[axis]).then_some((axis, plane))
        };
        let Some((axis, plane)) = axes.iter().find_map(middle) else { return Err(part) };
        let (mut below, mut above) = (*core, *core);
        (below.high[axis], above.low[axis]) = (plane, plane);
        let lower: Vec<u32> = triangles.iter().copied().filter(|&triangle| extreme(triangle, axis, f64::min) <= plane).collect();
        let upper: Vec<u32> = triangles.iter().copied().filter(|&triangle| extreme(triangle, axis, f64::max) >= plane).collect();
        if lower.len() + upper.len() > MOST_SHARED * triangles.len() / 2 {
            return Err(part);
        }
        let half = |core, triangles| Part { core, triangles, halvings: halvings + 1 };
        Ok([half(below, lower), half(above, upper)])
    }

    /// Both halves as one patch.
    fn joined(&self, below: Patch, above: Patch, core: &Core) -> Patch {
        let Patch { mut inside, across: mut rest, mut settled } = below;
        inside.extend(above.inside);
        settled.extend(above.settled);
        rest.extend(above.across);
        rest.sort_unstable();
        rest.dedup();
        // What is across the plane between them was in both.
        let (between, across): (Vec<u32>, Vec<u32>) = rest.into_iter().partition(|&triangle| self.surface.is_within(triangle, core));
        inside.extend(between.into_iter().map(|triangle| self.surface.triangles[triangle as usize]));
        Patch { inside, across, settled }
    }

    fn simplified(&self, core: &Core, figures: &[NodeId], patch: Patch) -> Result<Patch, Stopped> {
        let Self { setting, index, surface, .. } = *self;
        let new = || Memory { simplifier: Simplifier::new(index, setting), numbers: vec![NONE; surface.vertices.len()] };
        self.memories.with(new, |memory| self.simplified_with(memory, core, figures, patch))
    }

    fn simplified_with(&self, memory: &mut Memory<'a>, core: &Core, figures: &[NodeId], patch: Patch) -> Result<Patch, Stopped> {
        let Patch { inside, across, settled } = patch;
        let Memory { simplifier, numbers } = memory;
        let mut triangles: Vec<[u32; 3]> =
            inside.into_iter().chain(across.iter().map(|&triangle| self.surface.triangles[triangle as usize])).collect();
        let mut names: Vec<u32> = Vec::new();
        for &corner in triangles.iter().flatten() {
            if std::mem::replace(&mut numbers[corner as usize], 0) == NONE {
                names.push(corner);
            }
        }
        names.sort_unstable();
        (0..).zip(&names).for_each(|(number, &name)| numbers[name as usize] = number);
        triangles.iter_mut().flatten().for_each(|corner| *corner = numbers[*corner as usize]);
        let mut own = BlockSurface {
            vertices: names.iter().map(|&vertex| self.surface.vertices[vertex as usize]).collect(),
            triangles,
            shared: names.iter().zip(0..).map(|(&vertex, number)| (vertex.into(), number)).collect(),
            settled: vec![false; names.len()],
            ..BlockSurface::default()
        };
        settled.iter().for_each(|&vertex| own.settled[numbers[vertex as usize] as usize] = true);
        names.iter().for_each(|&name| numbers[name as usize] = NONE);
        simplifier.run(self.setting, &OF_POLYTOPES, core, figures, &mut own, self.budget)?;
        own.shared.iter().for_each(|&(name, number)| names[number as usize] = name as u32);
        let inside = (0..own.triangles.len() as u32).filter(|&triangle| own.is_within(triangle, core));
        Ok(Patch {
            inside: inside.map(|triangle| own.triangles[triangle as usize].map(|corner| names[corner as usize])).collect(),
            across,
            settled: names.iter().zip(&own.settled).filter(|(_, settled)| **settled).map(|(&name, _)| name).collect(),
        })
    }
}

impl BlockSurface {
    fn is_within(&self, triangle: u32, core: &Core) -> bool {
        self.corners(triangle).iter().all(|corner| core.contains(corner))
    }
}
