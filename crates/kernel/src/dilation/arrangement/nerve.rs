//! The sets of up to four bodies by which a union of polytopes is shown to have the topology of the dilation.
//!
//! Let P_i be the polytope of figure S_i and D_i its dilation by r, cut as `joints` and `hinges` say: all are convex. Let the D_i shrink to the E_i = D_i n P_i, all at the same time, each to (1 - t) D_i + t E_i, and these grow to the P_i in the
//! same way. The union keeps its form unless, at some time, a point of its boundary has outward normals, of the bodies that have it on theirs, with 0 in their hull: everywhere else these have a common direction against which the boundary moves on
//! (the union is where the least of the bodies' signed distances is at most 0, and 0 is a regular value of that: Clarke, "Optimization and Nonsmooth Analysis", 1983; Gershkovich and Rubinstein, "Morse theory for min-type functions", Asian J. Math. 1, 1997).
//! Four such normals are enough (Caratheodory), no body has all of them, and the interiors of those that have them have no common point. So a set of two to four bodies does nothing of that kind if
//!
//! * (both meet) the E_i have a common interior point, which all bodies have all the time,
//! * (neither meets) neither the D_i have a common point, nor the P_i: every body is within one of these, or
//! * (hidden) all common points of the D_i, and all of the P_i, are in the interior of some E_j, or of a solid, and so in that of the union, all the time.
//!
//! Polytopes that are below planes which part dilations, or are around the dilations, settle what is in doubt (see `engine`).
//!
//! If that is shown of all sets, both unions, with the solids, have as many components, handles and voids. Sets that hold one which does not meet, or which is hidden, are so, too.

use super::bodies::{Bodies, Common, Verdict};
use crate::attractor::cell::{Point, between};
use crate::budget::{Budget, Stopped};
use rayon::prelude::*;

/// Corners at most that a site suggests as hubs, with the middles between them: half of the room, others are met later.
const OWN_CORNERS: usize = 7;
/// Bodies of a set at most.
const MOST_BODIES: usize = 4;
/// Sites that are looked at before doubts are counted.
const AT_A_TIME: usize = 16;

/// A set of sites whose polytopes were not shown to have a common point exactly where the dilations have, and whether these have.
#[derive(Clone, Debug)]
pub(super) struct Doubt {
    /// In ascending order.
    pub(super) sites: Vec<u32>,
    pub(super) wanted: Common,
}

/// What is known of the sets of sites, while polytopes change.
#[derive(Debug, Default)]
pub(super) struct Sets {
    /// Of every site the later ones whose dilations have a point in common with its own that is not hidden, as far as is told.
    meeting: Vec<Vec<u32>>,
    doubts: Doubts,
}

/// Those that are open, and those that do not matter as they are hidden: this needs to be shown again when others change.
#[derive(Debug, Default)]
struct Doubts {
    open: Vec<Doubt>,
    hidden: Vec<Doubt>,
}

impl Sets {
    /// Those that are in doubt.
    pub(super) fn doubts(&self) -> &[Doubt] {
        &self.doubts.open
    }

    fn meet(&self, first: u32, second: u32) -> bool {
        self.meeting[first as usize].binary_search(&second).is_ok()
    }

    /// Looks at the sets that have one of the sites that are `changed`, at first all of them. False where more sets are in doubt than `most`.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn look(&mut self, bodies: &Bodies<'_>, changed: &[bool], most: usize, budget: &Budget) -> Result<bool, Stopped> {
        let stale = bodies.near.around(changed);
        self.forget(bodies, changed, &stale, budget)?;
        let sites: Vec<u32> = (0..bodies.polytopes.count()).filter(|&site| stale[site as usize]).collect();
        self.meeting.resize(stale.len(), Vec::new());
        for some in sites.chunks(AT_A_TIME) {
            let pairs = |&first: &u32| {
                budget.cancel.check()?;
                let later = bodies.near.of(first).iter().copied().filter(|&other| other > first).collect();
                let mut search = Search::new(bodies, first, later, changed);
                Ok((search.pairs(self), search.found))
            };
            let found: Vec<(Vec<u32>, Doubts)> = some.par_iter().map(pairs).collect::<Result<_, Stopped>>()?;
            for (&first, (after, found)) in some.iter().zip(found) {
                self.meeting[first as usize] = after;
                self.doubts.extend(found);
            }
            if self.doubts.open.len() > most {
                return Ok(false);
            }
        }
        for some in sites.chunks(AT_A_TIME) {
            let larger = |&first: &u32| {
                let mut search = Search::new(bodies, first, self.meeting[first as usize].clone(), changed);
                search.triples_and_more(self, budget)?;
                Ok(search.found)
            };
            let found: Vec<Doubts> = some.par_iter().map(larger).collect::<Result<_, Stopped>>()?;
            found.into_iter().for_each(|found| self.doubts.extend(found));
            if self.doubts.open.len() > most {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Forgets the doubts about sets that have one of the sites that are `changed`, and shows again that others are hidden where one near to them, and so to their first site, did.
    fn forget(&mut self, bodies: &Bodies<'_>, changed: &[bool], stale: &[bool], budget: &Budget) -> Result<(), Stopped> {
        let Doubts { open, hidden } = &mut self.doubts;
        let is_new = |doubt: &Doubt| doubt.sites.iter().any(|&site| changed[site as usize]);
        open.retain(|doubt| !is_new(doubt));
        hidden.retain(|doubt| !is_new(doubt));
        let is_hidden = |doubt: &Doubt| {
            budget.cancel.check()?;
            Ok(!stale[doubt.sites[0] as usize] || bodies.is_hidden(&doubt.sites, doubt.wanted))
        };
        let mut is_hidden = hidden.par_iter().map(is_hidden).collect::<Result<Vec<bool>, Stopped>>()?.into_iter();
        open.extend(hidden.extract_if(.., |_| !is_hidden.next().unwrap_or_default()));
        Ok(())
    }
}

impl Doubts {
    fn extend(&mut self, other: Self) {
        self.open.extend(other.open);
        self.hidden.extend(other.hidden);
    }
}

/// The sets with a first body.
///
/// Most are settled by a place that is in many bodies, a *hub*: any of these have a common point. And most others are not looked at, as sets that hold one without a common point have none.
struct Search<'a> {
    bodies: &'a Bodies<'a>,
    first: u32,
    /// The bodies that may follow, in ascending order, and of each the hubs in it, bit by bit; all hubs are in the first body.
    later: Vec<u32>,
    hubs: Vec<u64>,
    count: u32,
    changed: &'a [bool],
    found: Doubts,
}

impl<'a> Search<'a> {
    /// Begins with the hubs that the first site itself suggests: its corners, and the middles between them.
    fn new(bodies: &'a Bodies<'a>, first: u32, later: Vec<u32>, changed: &'a [bool]) -> Self {
        let mut search = Self { bodies, first, hubs: vec![0; later.len()], count: 0, later, changed, found: Doubts::default() };
        let corners = bodies.figures[first as usize].corners();
        // Of many some, from all around.
        let some: Vec<Point> = corners.iter().step_by(corners.len().div_ceil(OWN_CORNERS)).copied().collect();
        for (place, one) in some.iter().enumerate() {
            some[..=place].iter().for_each(|other| search.add_hub(&between(one, other, 0.5)));
        }
        search
    }

    /// Adds a hub, if it is in the first body.
    fn add_hub(&mut self, x: &Point) {
        if self.count == u64::BITS || !self.bodies.is_in(self.first, x) {
            return;
        }
        for (&body, hubs) in self.later.iter().zip(&mut self.hubs) {
            *hubs |= u64::from(self.bodies.is_in(body, x)) << self.count;
        }
        self.count += 1;
    }

    /// Whether the first body and some that follow may have a common point that is not hidden.
    fn may_meet(&mut self, others: &[usize]) -> bool {
        if others.iter().fold(u64::MAX, |common, &other| common & self.hubs[other]) != 0 {
            return true;
        }
        let mut set = [self.first; MOST_BODIES];
        for (slot, &other) in set[1..].iter_mut().zip(others) {
            *slot = self.later[other];
        }
        let set = &set[..=others.len()];
        let Verdict { common, is_doubtful, hub } = self.bodies.verdict(set);
        if let Some(hub) = hub {
            self.add_hub(&hub);
        }
        if !is_doubtful {
            return common != Common::None;
        }
        let doubt = Doubt { sites: set.to_vec(), wanted: common };
        if self.bodies.is_hidden(set, common) {
            self.found.hidden.push(doubt);
            return false;
        }
        self.found.open.push(doubt);
        common != Common::None
    }

    /// Looks at all pairs; returns the bodies that meet the first.
    fn pairs(&mut self, sets: &Sets) -> Vec<u32> {
        let mut meet = Vec::new();
        for place in 0..self.later.len() {
            let other = self.later[place];
            let is_met = if self.is_changed(&[place]) { self.may_meet(&[place]) } else { sets.meet(self.first, other) };
            if is_met {
                meet.push(other);
            }
        }
        meet
    }

    fn is_changed(&self, others: &[usize]) -> bool {
        self.changed[self.first as usize] || others.iter().any(|&other| self.changed[self.later[other] as usize])
    }

    /// Looks at the larger sets of bodies of which all pairs meet.
    fn triples_and_more(&mut self, sets: &Sets, budget: &Budget) -> Result<(), Stopped> {
        let count = self.later.len();
        // Of every second body the third ones.
        let mut thirds: Vec<Vec<usize>> = Vec::with_capacity(count);
        for second in 0..count {
            budget.cancel.check()?;
            let mut own = Vec::new();
            for third in second + 1..count {
                // What is the same as before was looked at then.
                if sets.meet(self.later[second], self.later[third])
                    && (!self.is_changed(&[second, third]) || self.may_meet(&[second, third]))
                {
                    own.push(third);
                }
            }
            thirds.push(own);
        }
        for second in 0..count {
            budget.cancel.check()?;
            for (place, &third) in thirds[second].iter().enumerate() {
                let fourths = &thirds[second][place + 1..];
                let own = self.hubs[second] & self.hubs[third];
                if own != 0 && fourths.iter().fold(own, |own, &fourth| own & self.hubs[fourth]) != 0 {
                    // One hub is in all of them.
                    continue;
                }
                for &fourth in fourths {
                    if self.is_changed(&[second, third, fourth]) && thirds[third].binary_search(&fourth).is_ok() {
                        self.may_meet(&[second, third, fourth]);
                    }
                }
            }
        }
        Ok(())
    }
}
