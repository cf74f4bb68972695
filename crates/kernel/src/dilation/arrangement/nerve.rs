//! The sets of up to four bodies by which a union of polytopes is shown to have the topology of the dilation.
//!
//! Let P_i be the polytope of figure S_i and D_i its dilation by r, cut as `joints` and `hinges` say: all are convex. Let the D_i shrink to the E_i = D_i n P_i, all at the same time, each to (1 - t) D_i + t E_i, and these grow to the P_i in the
//! same way. The union keeps its form unless, at some time, a point of its boundary has outward normals, of the bodies that have it on theirs, with 0 in their hull: everywhere else these have a common direction against which the boundary moves on
//! (the union is where the least of the bodies' signed distances is at most 0, and 0 is a regular value of that: Clarke, "Optimization and Nonsmooth Analysis", 1983; Gershkovich and Rubinstein, "Morse theory for min-type functions", Asian J. Math. 1, 1997).
//! Four such normals are enough (Caratheodory), no body has all of them, and the interiors of those that have them have no common point. The point is in no interior of an E_j, or of a solid, as that is in the union's all the time. So in a part of
//! space a set of two to four bodies does nothing of that kind if
//!
//! * (both meet) the E_i have a common interior point, wherever that is, which all bodies have all the time,
//! * (neither meets) there neither the D_i have a common point, nor the P_i: every body is within one of these, or
//! * (hidden) there all common points of the D_i, and all of the P_i, are in the interior of some E_j, or of a solid.
//!
//! Sets that hold one which does not meet there, or which is hidden, do nothing either. Space is parted into cubes, each with the bodies that reach it (see `cubes`). At first polytopes are taken for anything between their dilations by the ends of the band:
//! what is settled so, which is most, stays settled. The cubes that are left are looked at, with the polytopes as they are, and again where these are changed in a way that may open what was settled, see [`Change`]. Polytopes that are below planes which part dilations, or are around the dilations, settle what is in doubt (see `engine`).
//!
//! If nothing of that kind is anywhere, both unions, with the solids, have as many components, handles and voids.

use super::bodies::{Bodies, Common};
use super::cubes::{self, ANY, Found, Listed, PRESENT, Search, Set};
use crate::budget::{Budget, Stopped};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Cubes one after the other, and parts of space, or cubes, that are looked at before what was found is counted.
const IN_A_ROW: usize = 64;
const AT_A_TIME: usize = 512;
/// Cubes that are up to the polytopes at most, as a mean over the sites, and in any case: they take as much memory as a site's triangles.
const MOST_CUBES: usize = 100;
const FEW_CUBES: usize = 100_000;
/// Sets that are asked for at most each time, likewise, or what takes as long: on all that was measured it is thirty to four hundred of a site.
const MOST_ASKED: usize = 1_000;
const FEW_ASKED: usize = 100_000;

/// A set of sites whose polytopes were not shown to have a common point exactly where the dilations have, and whether these have.
#[derive(Clone, Debug)]
pub(super) struct Doubt {
    /// In ascending order.
    pub(super) sites: Vec<u32>,
    pub(super) wanted: Common,
}

/// The sets in doubt in a cube, or as many as it takes to go on, and whether their dilations have a common point.
type Doubts = Vec<(Set, Common)>;

/// How a polytope P_i was changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Change {
    Nothing,
    /// It lies below planes that the dilation D_i is below, too: it is within what it was, and E_i = D_i n P_i is the same. So nothing that was settled is open again.
    Cut,
    /// It is around the dilation: E_i is all of that. Of what was settled, only sets that have the body in them may be open again: where they did not meet, or were hidden.
    Around,
    /// Otherwise.
    Other,
}

/// What is known of the sets of sites, while polytopes change.
#[derive(Debug)]
pub(super) struct Sets {
    /// The cubes that are up to the polytopes.
    cubes: Vec<Listed>,
    /// Of each of them.
    doubts: Vec<Doubts>,
}

impl Sets {
    /// All that is up to the polytopes of some bodies; none where that is too much.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn new(bodies: &Bodies<'_>, budget: &Budget) -> Result<Option<Self>, Stopped> {
        let most = MOST_CUBES * bodies.figures.len() + FEW_CUBES;
        let (mut cubes, mut left) = (Vec::new(), most_asked(bodies));
        let Some(parts) = cubes::parts(bodies, most, budget)? else { return Ok(None) };
        for parts in parts.chunks(AT_A_TIME) {
            let look = |part: &Listed| Search::new(bodies, &ANY).run(part, budget);
            for Found { open, asked, is_cut_short, .. } in parts.par_iter().map(look).collect::<Result<Vec<_>, Stopped>>()? {
                cubes.extend(open);
                if is_cut_short || cubes.len() > most || asked > left {
                    return Ok(None);
                }
                left -= asked;
            }
        }
        Ok(Some(Self { doubts: vec![Vec::new(); cubes.len()], cubes }))
    }

    /// Whether nothing is up to the polytopes.
    pub(super) fn are_settled(&self) -> bool {
        self.cubes.is_empty()
    }

    /// Those that are in doubt.
    pub(super) fn doubts(&self) -> Vec<Doubt> {
        let all: BTreeMap<Set, Common> = self.doubts.iter().flatten().copied().collect();
        all.into_iter().map(|(set, wanted)| Doubt { sites: cubes::sites(set).collect(), wanted }).collect()
    }

    /// Looks at the cubes where changes of the sites' polytopes may tell: at first, when they are all other ones, all of them. False where there was too much to look at, or more sets are in doubt than `most`. Of a cube with very many so
    /// many are told as it takes to go on: it is looked at again when polytopes of its bodies change.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn look(&mut self, bodies: &Bodies<'_>, changes: &[Change], most: usize, budget: &Budget) -> Result<bool, Stopped> {
        let mut left = most_asked(bodies);
        let around: Vec<bool> = changes.iter().map(|&change| change == Change::Around).collect();
        for (cubes, doubts) in self.cubes.chunks(AT_A_TIME).zip(self.doubts.chunks_mut(AT_A_TIME)) {
            let look = |(cubes, doubts): (&[Listed], &mut [Doubts])| {
                let (mut search, mut all) = (Search::new(bodies, &PRESENT), 0);
                for (listed, doubts) in cubes.iter().zip(doubts) {
                    let has = |change: Change| listed.1.iter().any(|&body| changes[body as usize] == change);
                    let is_open = has(Change::Other) || (!doubts.is_empty() && (has(Change::Cut) || has(Change::Around)));
                    if is_open || has(Change::Around) {
                        search.due = (!is_open).then_some(&around);
                        let Found { doubts: found, asked, is_cut_short, .. } = search.run(listed, budget)?;
                        *doubts = found;
                        all += asked;
                        if is_cut_short {
                            return Ok(usize::MAX);
                        }
                    }
                }
                Ok(all)
            };
            let rows = cubes.par_chunks(IN_A_ROW).zip(doubts.par_chunks_mut(IN_A_ROW));
            for asked in rows.map(look).collect::<Result<Vec<usize>, Stopped>>()? {
                if asked > left {
                    return Ok(false);
                }
                left -= asked;
            }
        }
        Ok(self.doubts().len() <= most)
    }
}

/// Sets of some bodies that are asked for at most each time.
fn most_asked(bodies: &Bodies<'_>) -> usize {
    MOST_ASKED * bodies.figures.len() + FEW_ASKED
}
