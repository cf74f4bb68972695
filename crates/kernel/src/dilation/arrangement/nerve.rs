//! Whether a union of polytopes has the topology of the dilation, by their nerves.
//!
//! The union of convex bodies has the homotopy type of their nerve, the simplices of which are the sets of bodies with a common point (Leray, 1945; Borsuk, "On the imbedding of systems of compacta in
//! simplicial complexes", Fund. Math. 35, 1948). Let P_i be the polytope of site S_i and D_i its dilation by r, cut as `joints` says. If sets of polytopes have a common point exactly where these sites'
//! D_i have, both unions have as many components, handles and voids. In space sets of up to four tell (Helly, 1923).
//!
//! How far a point is from the farthest of some sites is a convex function, and so is how high it is above the highest plane of some polytopes. Where dilations are cut, r and the height above the
//! plane is a distance, too: the greatest is at most r in the same places, at least s where a ball by s is deeper below the plane than r - s, and at most the band's outer end in all of those of polytopes.
//! Their minima are enclosed between bounds by the method of ellipsoids (Yudin and Nemirovski, 1976; with deep cuts, Bland, Goldfarb and Todd, "The ellipsoid method: a survey", Oper. Res. 29, 1981). A common point of the dilations by s, which lie in both
//! kinds of bodies, settles most sets, and none of those by the band's outer end others.

use super::Doubt;
use super::pieces::{Lists, ends};
use super::polytopes::Polytope;
use super::polytopes::{Polytopes, height, normal};
use crate::attractor::cell::{Point, between, dot, subtract};
use crate::budget::{Budget, Stopped};
use crate::dilation::plan::Setting;
use rayon::prelude::*;

/// Ellipsoids at most, to decide one question.
const MOST_ELLIPSOIDS: usize = 400;
/// Distances are told this well, as a share of the band's width, before polytopes are asked.
const CLOSE: f64 = 0.1;
/// Steps towards a common point, before.
const STEPS: usize = 12;
/// Bodies of a simplex at most.
const MOST_BODIES: usize = 4;

/// Sites that are looked at before doubts are counted.
const AT_A_TIME: usize = 16;

/// Of every site the later ones whose dilations have a point in common with its own, as far as is told.
#[derive(Debug, Default)]
pub(super) struct Meeting(Vec<Vec<u32>>);

impl Meeting {
    fn after(&self, index: u32) -> &[u32] {
        &self.0[index as usize]
    }

    fn has(&self, first: u32, second: u32) -> bool {
        self.after(first).binary_search(&second).is_ok()
    }
}

/// The sets of sites whose polytopes were not shown to have a common point exactly where the dilations have: those whose first site is `stale`. `None` where there are more than `most`.
/// Which pairs meet is told by the sites alone: it is asked for the first time, when all are stale, and kept.
///
/// # Errors
/// [`Stopped`].
pub(super) fn doubts(
    setting: &Setting,
    polytopes: &Polytopes,
    near: &Lists,
    meeting: &mut Meeting,
    stale: &[bool],
    most: usize,
    budget: &Budget,
) -> Result<Option<Vec<Doubt>>, Stopped> {
    let nerve = Nerve { setting, polytopes };
    let sites: Vec<u32> = (0..polytopes.count()).filter(|&site| stale[site as usize]).collect();
    let mut doubts = Vec::new();
    meeting.0.resize(polytopes.all.len(), Vec::new());
    for some in sites.chunks(AT_A_TIME) {
        let pairs = |&first: &u32| {
            budget.cancel.check()?;
            let later = near.of(first).iter().copied().filter(|&other| other > first).collect();
            let mut search = Search::new(&nerve, first, later);
            Ok((search.pairs(), search.found))
        };
        let found: Vec<(Vec<u32>, Vec<Doubt>)> = some.par_iter().map(pairs).collect::<Result<_, Stopped>>()?;
        for (&first, (after, own)) in some.iter().zip(found) {
            meeting.0[first as usize] = after;
            doubts.extend(own);
        }
        if doubts.len() > most {
            return Ok(None);
        }
    }
    for some in sites.chunks(AT_A_TIME) {
        let sets = |&first: &u32| {
            let mut search = Search::new(&nerve, first, meeting.after(first).to_vec());
            search.triples_and_more(meeting, budget)?;
            Ok(search.found)
        };
        let found: Vec<Vec<Doubt>> = some.par_iter().map(sets).collect::<Result<_, Stopped>>()?;
        doubts.extend(found.into_iter().flatten());
        if doubts.len() > most {
            return Ok(None);
        }
    }
    Ok(Some(doubts))
}

struct Nerve<'a> {
    setting: &'a Setting,
    polytopes: &'a Polytopes,
}

/// What is known of some bodies' common points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Common {
    Some,
    None,
    Unknown,
}

/// The simplices with a first body.
///
/// Most are settled by a place that is in many bodies, a *hub*: any of these have a common point. And most others are not looked at, as sets that hold one without a common point have none.
struct Search<'a> {
    nerve: &'a Nerve<'a>,
    first: u32,
    /// The bodies that may follow, in ascending order, and of each the hubs in it, bit by bit; all hubs are in the first body.
    later: Vec<u32>,
    hubs: Vec<u64>,
    count: u32,
    found: Vec<Doubt>,
}

impl<'a> Search<'a> {
    /// Begins with the hubs that the first site itself suggests: its corners, and the middles between them.
    fn new(nerve: &'a Nerve<'a>, first: u32, later: Vec<u32>) -> Self {
        let mut search = Self { nerve, first, hubs: vec![0; later.len()], count: 0, later, found: Vec::new() };
        let corners = ends(&nerve.polytopes.of(first).site.site);
        for p in 0..corners.len() {
            for q in 0..=p {
                search.add_hub(&between(&corners[p], &corners[q], 0.5));
            }
        }
        search
    }

    /// Adds a hub, if it is in the first body.
    fn add_hub(&mut self, x: &Point) {
        if self.count == u64::BITS || !self.nerve.is_in(self.first, x) {
            return;
        }
        for (&body, hubs) in self.later.iter().zip(&mut self.hubs) {
            *hubs |= u64::from(self.nerve.is_in(body, x)) << self.count;
        }
        self.count += 1;
    }

    /// Whether the first body and some that follow may have a common point.
    fn may_meet(&mut self, others: &[usize]) -> bool {
        if others.iter().fold(u64::MAX, |common, &other| common & self.hubs[other]) != 0 {
            return true;
        }
        let mut simplex = [self.first; MOST_BODIES];
        for (slot, &other) in simplex[1..].iter_mut().zip(others) {
            *slot = self.later[other];
        }
        let simplex = &simplex[..=others.len()];
        let (common, doubt, x) = self.nerve.common(simplex);
        if doubt {
            self.found.push(Doubt { sites: simplex.to_vec(), wanted: common });
        }
        if let Some(x) = x {
            self.add_hub(&x);
        }
        common != Common::None
    }

    /// Looks at all pairs; returns the bodies that meet the first.
    fn pairs(&mut self) -> Vec<u32> {
        let meet: Vec<usize> = (0..self.later.len()).filter(|&other| self.may_meet(&[other])).collect();
        meet.into_iter().map(|other| self.later[other]).collect()
    }

    /// Looks at the larger sets of bodies of which all pairs meet.
    fn triples_and_more(&mut self, meeting: &Meeting, budget: &Budget) -> Result<(), Stopped> {
        let count = self.later.len();
        // Of every second body the third ones.
        let mut thirds: Vec<Vec<usize>> = Vec::with_capacity(count);
        for second in 0..count {
            budget.cancel.check()?;
            let mut own = Vec::new();
            for third in second + 1..count {
                if meeting.has(self.later[second], self.later[third]) && self.may_meet(&[second, third]) {
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
                    if thirds[third].binary_search(&fourth).is_ok() {
                        self.may_meet(&[second, third, fourth]);
                    }
                }
            }
        }
        Ok(())
    }
}

impl Nerve<'_> {
    /// Whether a place is surely in the dilation of a site by the band's inner end.
    fn is_in(&self, index: u32, x: &Point) -> bool {
        let Setting { least, slack, .. } = *self.setting;
        let body = self.polytopes.of(index);
        let is_cut_off = || body.cuts.iter().flatten().any(|plane| height(plane, x) > -slack);
        body.site.distance_squared(x).sqrt() + slack < least && !is_cut_off()
    }

    /// Whether the dilations have a common point, whether it is in doubt that the polytopes have one exactly then, and a place in all dilations by the band's inner end, if one was met.
    fn common(&self, simplex: &[u32]) -> (Common, bool, Option<Point>) {
        let Setting { least, reach, outer, slack, .. } = *self.setting;
        let bodies = || simplex.iter().map(|&index| self.polytopes.of(index));
        let bounds = |distance: f64| {
            let mut common = [[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]];
            for body in bodies() {
                let [low, high] = body.site_box();
                let by = body.site.in_space(distance) + slack;
                for axis in 0..3 {
                    common[0][axis] = common[0][axis].max(low[axis] - by);
                    common[1][axis] = common[1][axis].min(high[axis] + by);
                }
            }
            common
        };
        let within = bounds(outer);
        if (0..3).any(|axis| within[0][axis] > within[1][axis]) {
            return (Common::None, false, None);
        }
        let highest = |x: &Point| {
            let planes = bodies().flat_map(|body| body.cuts.iter().flatten());
            planes.map(|plane| (height(plane, x), plane)).max_by(|a, b| a.0.total_cmp(&b.0))
        };
        // Steps towards the farthest site end where the farthest is nearest; where that is cut off, the way leads to the plane.
        let mut x = between(&within[0], &within[1], 0.5);
        for step in 0..STEPS {
            let far = bodies().map(|body| (body.site.distance_squared(&x), body)).max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((square, body)) = far else { return (Common::Unknown, true, None) };
            if square.sqrt() + slack >= least {
                x = between(&x, &body.site.closest(&x), 1.0 / (step + 2) as f64);
                continue;
            }
            let Some((height, plane)) = highest(&x).filter(|(height, _)| *height > -slack) else { return (Common::Some, false, Some(x)) };
            let normal = normal(plane);
            x = std::array::from_fn(|axis| x[axis] - (height + 4.0 * slack) * normal[axis]);
        }
        let distance = |x: &Point| -> (f64, Point) {
            let far = bodies().map(|body| (body.site.distance_squared(x), body)).max_by(|a, b| a.0.total_cmp(&b.0));
            let (distance, slope) = far.map_or((0.0, [0.0; 3]), |(square, body)| {
                let distance = square.sqrt();
                (distance, subtract(x, &body.site.closest(x)).map(|part| part / distance.max(f64::MIN_POSITIVE)))
            });
            match highest(x).map(|(height, plane)| (reach + height, plane)) {
                Some((beyond, plane)) if beyond > distance => (beyond, normal(plane)),
                _ => (distance, slope),
            }
        };
        let side = |bounds: [f64; 2], of: f64| {
            if bounds[1] < of - slack {
                Common::Some
            } else if bounds[0] > of + slack {
                Common::None
            } else {
                Common::Unknown
            }
        };
        let is_settled = |bounds: [f64; 2]| side(bounds, least) == Common::Some || side(bounds, outer) == Common::None;
        let close = CLOSE * (outer - least);
        let is_known = |bounds: [f64; 2]| side(bounds, reach) != Common::Unknown && bounds[1] - bounds[0] < close;
        let bounds = least_value(within, distance, |bounds| is_settled(bounds) || is_known(bounds));
        let common = side(bounds, reach);
        if is_settled(bounds) {
            return (common, false, None);
        }
        let beyond = |x: &Point| -> (f64, Point) {
            let planes = bodies().flat_map(|body| body.planes.iter());
            let highest = planes.map(|plane| (height(plane, x), plane)).max_by(|a, b| a.0.total_cmp(&b.0));
            highest.map_or((0.0, [0.0; 3]), |(height, plane)| (height, normal(plane)))
        };
        let polytopes = side(least_value(within, beyond, |bounds| side(bounds, 0.0) != Common::Unknown), 0.0);
        (common, common == Common::Unknown || common != polytopes, None)
    }
}

/// Bounds of the least value in a box of a convex function, given with subgradients no longer than 1, that are as close as is `enough`, or as they come. Values found anywhere are upper bounds.
///
/// The ellipsoid {y: (y - x)^T P^-1 (y - x) <= 1} holds all points of the box where the function is less than the best value yet; there it is at least f(x) - sqrt(g^T P g).
fn least_value([low, high]: [Point; 2], function: impl Fn(&Point) -> (f64, Point), enough: impl Fn([f64; 2]) -> bool) -> [f64; 2] {
    let mut x = between(&low, &high, 0.5);
    // The ball around a box is an ellipsoid with the sides' half lengths times the root of 3.
    let mut shape = [[0.0; 3]; 3];
    (0..3).for_each(|axis| shape[axis][axis] = 0.75 * (high[axis] - low[axis]).powi(2) * (1.0 + 1e-9) + f64::MIN_POSITIVE);
    let mut bounds = [f64::NEG_INFINITY, f64::INFINITY];
    for _ in 0..MOST_ELLIPSOIDS {
        let (value, slope) = function(&x);
        let image = shape.map(|row| dot(&row, &slope));
        let reach = dot(&slope, &image).max(0.0).sqrt();
        // What was cut off is no better than the best: the least value is the best one, or in the ellipsoid.
        bounds[1] = bounds[1].min(value);
        bounds[0] = bounds[0].max(value - reach).min(bounds[1]);
        if enough(bounds) || reach <= f64::EPSILON * value.abs() {
            break;
        }
        // Points that are no better than the best are cut off.
        let depth = (value - bounds[1]) / reach;
        if depth >= 1.0 {
            break;
        }
        let step = (1.0 + 3.0 * depth) / 4.0;
        let grown = 9.0 / 8.0 * (1.0 - depth * depth) * (1.0 + 1e-12);
        let flattened = 2.0 * (1.0 + 3.0 * depth) / (4.0 * (1.0 + depth));
        for axis in 0..3 {
            x[axis] -= step * image[axis] / reach;
        }
        shape = std::array::from_fn(|p| std::array::from_fn(|q| grown * (shape[p][q] - flattened * image[p] * image[q] / (reach * reach))));
    }
    bounds
}

impl Polytope {
    /// The box of its site.
    fn site_box(&self) -> [Point; 2] {
        let ends = || ends(&self.site.site).iter();
        [
            std::array::from_fn(|axis| ends().map(|end| end[axis]).fold(f64::INFINITY, f64::min)),
            std::array::from_fn(|axis| ends().map(|end| end[axis]).fold(f64::NEG_INFINITY, f64::max)),
        ]
    }
}
