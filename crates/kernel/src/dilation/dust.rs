//! Pieces and holes of the surface that are certainly not the dilation's.
//!
//! Where two creases come close the lattice may cut off a piece of the solid, or close a void, of which the dilation knows nothing. Let s be the solid's inner bound: D(s) is in the
//! solid. A piece of the solid that holds a point of D(s) holds a whole ball of radius s, and its box is no narrower than 2 s. So a narrower piece lies outside D(s), and
//! without it the solid still contains D(s). A void that lies in D(r) is not one of the dilation's: it is filled.
//!
//! Where the topology is proven (see `critical`) there are no such pieces and voids, and simplification makes none. It may leave of a shallow void only what lies in D(r):
//! that stays, as the dilation's. It may also turn one inside out that is hardly wider than the band, which shows as a piece too narrow to be one, and is turned back. What such a shell bounds holds no point of D(s):
//! on the way to its closest point the distance becomes less, and on the shell it is at least s, so that point would be in the shell, too, which then were wider than 2 s.
//!
//! A shell no longer than rounding may move what it bounds, see [`NUDGE`], has no volume to speak of, nor a sign of it: it goes, and the bound for rounding covers that. As a void
//! of D(r) it would have held a critical point of the distance, which has two sites at one distance at least; where there is one site alone, there was none.

use super::convex::SiteSearch;
use super::setting::Setting;
use super::surface::BlockSurface;
use super::tree::{Candidates, Tree};
use crate::attractor::cell::{Point, cross, distance_squared, dot};
use crate::attractor::sites::SiteRule;
use crate::groups::Groups;
use crate::solid::mend::NUDGE;

/// A shell of the surface.
#[derive(Clone, Copy)]
struct Shell {
    low: Point,
    high: Point,
    /// Six times the volume inside, negative for a void.
    volume: f64,
}

const EMPTY: Shell = Shell { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3], volume: 0.0 };

/// What is done with a shell.
#[derive(Clone, Copy, PartialEq)]
enum Fate {
    Stays,
    /// It is turned inside out.
    Turns,
    Goes,
    /// It may have been a void of the dilation, smaller than rounding.
    GoesInDoubt,
}

/// Removes such shells; how many of them may have been the dilation's. `is_proven` says that all shells were before simplification.
pub(super) fn remove(
    setting: &Setting,
    rule: &SiteRule<'_>,
    candidates: &Candidates,
    is_proven: bool,
    surface: &mut BlockSurface,
) -> usize {
    let (numbers, mut shells) = shells(surface);
    for (triangle, &number) in surface.triangles.iter().zip(&numbers) {
        let shell = &mut shells[number as usize];
        let corners = triangle.map(|corner| surface.vertices[corner as usize]);
        for corner in &corners {
            shell.low = std::array::from_fn(|axis| shell.low[axis].min(corner[axis]));
            shell.high = std::array::from_fn(|axis| shell.high[axis].max(corner[axis]));
        }
    }
    // Volumes about a point of the shell: far from the origin small ones would drown.
    for (triangle, &number) in surface.triangles.iter().zip(&numbers) {
        let shell = &mut shells[number as usize];
        let [a, b, c] = triangle.map(|corner| std::array::from_fn(|axis| surface.vertices[corner as usize][axis] - shell.low[axis]));
        shell.volume += dot(&a, &cross(&b, &c));
    }
    let mut tree = None;
    let fates: Vec<Fate> = shells.iter().map(|shell| fate(setting, rule, candidates, is_proven, shell, &mut tree)).collect();
    if fates.iter().any(|&fate| fate != Fate::Stays) {
        for (triangle, _) in surface.triangles.iter_mut().zip(&numbers).filter(|&(_, &number)| fates[number as usize] == Fate::Turns) {
            triangle.swap(1, 2);
        }
        let mut kept = numbers.iter().map(|&number| matches!(fates[number as usize], Fate::Stays | Fate::Turns));
        surface.triangles.retain(|_| kept.next().unwrap_or(true));
        surface.drop_unused();
    }
    fates.iter().filter(|&&fate| fate == Fate::GoesInDoubt).count()
}

fn fate<'a>(
    setting: &Setting,
    rule: &'a SiteRule<'a>,
    candidates: &Candidates,
    is_proven: bool,
    shell: &Shell,
    tree: &mut Option<(Tree<'a>, Vec<u32>)>,
) -> Fate {
    let width = (0..3).map(|axis| shell.high[axis] - shell.low[axis]).fold(f64::INFINITY, f64::min);
    let longest = (0..3).map(|axis| shell.high[axis] - shell.low[axis]).fold(0.0, f64::max);
    let is_tiny = longest <= NUDGE * setting.rounding;
    if width >= 2.0 * (setting.thinnest - 2.0 * setting.rounding) {
        return Fate::Stays;
    }
    if is_proven && !is_tiny {
        return if shell.volume > 0.0 { Fate::Turns } else { Fate::Stays };
    }
    if shell.volume > 0.0 {
        return Fate::Goes;
    }
    let (tree, starts) = tree.get_or_insert_with(|| {
        let mut tree = Tree::of(rule, setting);
        let starts = tree.reset(candidates);
        (tree, starts)
    });
    let middle: Point = std::array::from_fn(|axis| 0.5 * (shell.low[axis] + shell.high[axis]));
    let around = distance_squared(&middle, &shell.high).sqrt() + 2.0 * setting.rounding;
    let hit = tree.nearest(&middle, starts, None, setting.outer + around, 0.0);
    if tree.exhausted {
        return Fate::Stays;
    }
    let distance = hit.map_or(f64::INFINITY, |hit| hit.distance_squared.sqrt());
    if distance + around <= setting.reach {
        return Fate::Goes;
    }
    if !is_tiny {
        return Fate::Stays;
    }
    let mut near = Vec::new();
    tree.collect(&middle, starts, distance + 2.0 * around + setting.slack, &mut near);
    if near.len() == 1 { Fate::Goes } else { Fate::GoesInDoubt }
}

/// The number of every triangle's shell, and room for the shells.
fn shells(surface: &BlockSurface) -> (Vec<u32>, Vec<Shell>) {
    let mut groups = Groups::of_triangles(surface.vertices.len(), &surface.triangles);
    let mut names = vec![u32::MAX; surface.vertices.len()];
    let mut count = 0;
    let mut numbers = Vec::with_capacity(surface.triangles.len());
    for triangle in &surface.triangles {
        let name = &mut names[groups.of(triangle[0] as usize) as usize];
        if *name == u32::MAX {
            *name = count;
            count += 1;
        }
        numbers.push(*name);
    }
    (numbers, vec![EMPTY; count as usize])
}
