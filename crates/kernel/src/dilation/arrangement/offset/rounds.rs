//! Rounds in which sheets are made along a surface: each mends the faults of the one before, by finer triangles, other normals, or room for lids.

use super::coarse::Coarse;
use super::crossed::Pieces;
use super::outcome::{Flaws, Outcome};
use super::seams::{Hidden, Valleys};
use super::sheets::{Name, Shape, Sheets};
use super::skin::{OUTER, Skin};
use super::ways::Ways;
use super::{Around, TURNED, holds};
use crate::budget::{Budget, Stopped};
use crate::dilation::arrangement::sum::is_embedded;
use crate::dilation::arrangement::{BYTES_PER_TRIANGLE, Flat};
use crate::dilation::setting::Setting;
use crate::solid::half_edges::NONE;
use std::collections::HashSet;

/// Shares of half the band: how far off sheets places may be that they go by, and that together with what they are nearer where the surface turns at corners.
const OFF: f64 = 0.75;
const BOTH: f64 = 0.95;
/// How far out strips around borders are, their sides across these, and their triangles around corners, beyond the radius in units of half the band.
const RIM: f64 = 0.4;
const SIDE: f64 = -0.3;
const FACET: f64 = -0.7;
/// Rounds in which faults are mended, and by what share of the first more strips have rows and columns in each.
const ROUNDS: u32 = 10;
const FINER: f64 = 0.25;
/// Rounds in which strips that are too near are left to finer ones.
const ROUNDS_OF_STRIPS: u32 = 4;
/// Rounds in which normals are evened where what is left of sheets looks back, the first before folds are closed where noise turns them, others where lids do not help.
const EVENINGS: usize = 2;
/// Of so many triangles more are folded where noise turns normals.
const NOISY: usize = 64;
/// How many times what is left of folds is made anew with finer triangles, where it is less than one of `NOISY`.
const TANGLES: usize = 4;
/// By what share of half the band vertices are shaken, so that triangles do not touch each other, and how often.
pub(super) const SHAKEN: f64 = 0.01;
const SHAKES: u64 = 3;

/// What came of a surface with its seams.
pub(super) enum Told {
    /// It was made, or would have too many triangles.
    Made(Flat),
    /// Not with other seams either.
    Nothing,
    /// Other seams may serve.
    OtherSeams,
}

/// What all rounds have: how sheets may lead out of the surface, where those of parts meet, what is hidden there, and strips as they are at first.
struct Rounds<'a> {
    around: &'a Around<'a>,
    ways: Ways<'a>,
    valleys: Valleys,
    hidden: Hidden,
    shape: Shape,
    setting: &'a Setting,
    budget: &'a Budget,
}

/// What was tried so far, and is known by it.
struct Tries {
    /// Rounds with finer triangles, with other normals, and with finer ones around tangles alone.
    rounds: u32,
    evenings: usize,
    tangles: usize,
    /// How far off sheets each vertex may be: at first, and now.
    first: Vec<f64>,
    most: Vec<f64>,
    /// With other normals, if these are needed: what is shown of the surface does not know them.
    evened: Option<Skin>,
    /// Whether coarse triangles go by where the sheets of parts meet, as those along the normals are too far off over what is hidden.
    by_valleys: bool,
    /// Whether there is to be room for lids, and whether there was for what is cut in the last round.
    has_lids: bool,
    may_move: bool,
    /// Triangles that had no fault, and whether these were whole.
    good: HashSet<(Name, bool)>,
    /// How many coarse triangles there were in the round before, and before a tangle was made anew.
    made: Option<usize>,
    made_of_tangle: Option<usize>,
    /// Whether ways lead out of all places by as much as tells the topology of what the surface stands for, too: none as long as it was not asked.
    steadiness: Option<bool>,
}

/// The surface around faces with their seams, with coordinates that are rounded; or what else may serve.
///
/// # Errors
/// [`Stopped`].
pub(super) fn along(
    around: &Around<'_>,
    setting: &Setting,
    round: &(impl Fn(f64) -> f64 + Sync),
    budget: &Budget,
) -> Result<Told, Stopped> {
    budget.cancel.check()?;
    let Around { skin, faces, inner, outer, .. } = *around;
    let (radius, half) = (around.radius(), around.half());
    let Some(valleys) = skin.seams.valleys(skin, radius) else { return Ok(Told::OtherSeams) };
    let hidden = skin.hidden(&valleys, faces, radius, half);
    let at = |share: f64| radius + share * half;
    let [row, column] = [[SIDE, RIM], [FACET, SIDE]].map(|[near, far]| 2.0 * (at(near) / at(far)).acos());
    let shape = Shape { radius, rim: at(RIM), row, column, fold: 2.0 * (at(-TURNED) / radius).acos() };
    let rounds = Rounds { around, ways: Ways::new(skin, faces, [inner, outer]), valleys, hidden, shape, setting, budget };
    let mut tries = Tries::new(skin, half);
    // Where nothing is hidden there always are coarse triangles, else these may fail sooner.
    if rounds.hidden.all.is_empty() && !rounds.lead_out(&mut tries.steadiness)? {
        return Ok(Told::OtherSeams);
    }
    while tries.rounds < ROUNDS {
        if let Some(told) = rounds.run(&mut tries, round)? {
            return Ok(told);
        }
    }
    Ok(Told::OtherSeams)
}

impl Tries {
    fn new(skin: &Skin, half: f64) -> Self {
        let first = may_be_off(skin, half);
        Self {
            rounds: 0,
            evenings: 0,
            tangles: 0,
            most: first.clone(),
            first,
            evened: None,
            by_valleys: false,
            has_lids: false,
            may_move: false,
            good: HashSet::new(),
            made: None,
            made_of_tangle: None,
            steadiness: None,
        }
    }

    /// What is told where sheets do not come out: that nothing else will, but for those that go by valleys, as with other seams there may be fewer triangles, or no need of these.
    fn given_up(&self, told: Option<Flat>) -> Told {
        if self.by_valleys { Told::OtherSeams } else { told.map_or(Told::Nothing, Told::Made) }
    }

    /// Evens the normals at some vertices, as often as it may be; whether any is another one now.
    fn even(&mut self, skin: &Skin, vertices: &[u32], [radius, half]: [f64; 2]) -> bool {
        if vertices.is_empty() || self.evenings == EVENINGS {
            return false;
        }
        self.evenings += 1;
        let evened = self.evened.get_or_insert_with(|| skin.clone());
        let is_changed = evened.even(vertices, radius, TURNED * half);
        if is_changed {
            self.most.iter_mut().zip(may_be_off(evened, half)).for_each(|(most, other)| *most = most.min(other));
            self.made = None;
        }
        is_changed
    }
}

impl Rounds<'_> {
    /// Whether ways lead out of all places between both distances, asked once.
    fn lead_out(&self, known: &mut Option<bool>) -> Result<bool, Stopped> {
        if known.is_none() {
            *known = self.ways.steadiness(self.setting, self.budget)?;
        }
        Ok(known.is_some())
    }

    /// One round; none where another one follows.
    fn run(&self, tries: &mut Tries, round: &(impl Fn(f64) -> f64 + Sync)) -> Result<Option<Told>, Stopped> {
        let Self { around, valleys, hidden, shape, budget, .. } = self;
        let skin = tries.evened.as_ref().unwrap_or(around.skin);
        let mut coarse = Coarse::new(skin, tries.by_valleys.then_some(valleys), hidden, around.radius(), shape.column.cos());
        if !coarse.run(&tries.first, &tries.most, budget)? {
            let is_new = !std::mem::replace(&mut tries.by_valleys, true);
            return Ok(if is_new { None } else { Some(Told::OtherSeams) });
        }
        if !self.lead_out(&mut tries.steadiness)? {
            return Ok(Some(Told::OtherSeams));
        }
        let (names, left) = coarse.triangles();
        let share = 1.0 + FINER * f64::from(tries.rounds);
        let shape = Shape { row: shape.row / share, column: shape.column / share, ..*shape };
        let expected = shape.triangles(skin, &left);
        if expected > 2.0 * budget.limits.triangles as f64 {
            return Ok(Some(tries.given_up(Some(Flat::Beyond(expected)))));
        }
        if BYTES_PER_TRIANGLE * expected > budget.limits.memory_bytes as f64 {
            return Ok(Some(Told::OtherSeams));
        }
        let Some((sheets, pieces)) = self.cut(skin, &left, &shape, round)? else { return Ok(Some(Told::OtherSeams)) };
        // What is cut is not exactly where it is said to be.
        let may_move = pieces.is_cut || tries.has_lids;
        if std::mem::replace(&mut tries.may_move, may_move) != may_move {
            tries.good.clear();
        }
        let outer = if may_move { around.outer - around.moved } else { around.outer };
        let faults = around.faults(&sheets, &pieces, &tries.good, outer, budget)?;
        // What is too near is left to lids where a round does not make as many more triangles as there are of that.
        let is_finer = tries.made.is_none_or(|before| left.len() >= before + faults.len());
        let is_strip = |fault: &(u32, bool)| sheets.owners[fault.0 as usize] == NONE;
        let has_finer_strips = tries.rounds < ROUNDS_OF_STRIPS && faults.iter().any(is_strip);
        let may_go_on = tries.rounds + 1 < ROUNDS && (is_finer || has_finer_strips);
        // What is too near in spite of these is at corners, where lids were of no use.
        if tries.by_valleys && !may_go_on && !faults.is_empty() {
            return Ok(Some(Told::OtherSeams));
        }
        tries.made = Some(left.len());
        tries.good = pieces.good(&sheets, &faults);
        if faults.is_empty() || (!may_go_on && faults.iter().all(|fault| fault.1)) {
            return self.close(tries, Outcome::new(&sheets, pieces, &faults), &left, round);
        }
        for (fault, _) in faults {
            let owner = sheets.owners[fault as usize];
            if owner == NONE {
                let corners = sheets.triangles[fault as usize];
                corners.iter().for_each(|&corner| tries.most[sheets.feet[corner as usize] as usize] *= 0.5);
            } else {
                coarse.halve(names[owner as usize], &mut tries.most);
            }
        }
        tries.rounds += 1;
        Ok(None)
    }

    /// The sheets along coarse triangles, and what is left of them where they cross; none where there are none, or they touch each other.
    fn cut(
        &self,
        skin: &Skin,
        left: &[[u32; 3]],
        shape: &Shape,
        round: &(impl Fn(f64) -> f64 + Sync),
    ) -> Result<Option<(Sheets, Pieces)>, Stopped> {
        let Self { around, valleys, budget, .. } = self;
        let Some(mut sheets) = Sheets::new(skin, valleys, left, shape, round) else { return Ok(None) };
        let (mut unshaken, mut shakes) = (None, 0);
        let mut pieces = loop {
            if let Some(pieces) = Pieces::of(&sheets, around.skin, round, budget)? {
                break pieces;
            }
            if shakes == SHAKES {
                return Ok(None);
            }
            sheets.vertices.clone_from(unshaken.get_or_insert_with(|| sheets.vertices.clone()));
            sheets.shake(shakes, SHAKEN * around.half(), round);
            shakes += 1;
        };
        pieces.fill(|part| around.is_filled(part, budget))?;
        Ok(Some((sheets, pieces)))
    }

    /// Closes the folds of what is left of sheets along coarse triangles, and shows that it is as it has to be; none where another round is to be tried.
    fn close(
        &self,
        tries: &mut Tries,
        mut outcome: Outcome,
        left: &[[u32; 3]],
        round: &(impl Fn(f64) -> f64 + Sync),
    ) -> Result<Option<Told>, Stopped> {
        let Self { around, ways, setting, budget, .. } = self;
        let flaws = outcome.flaws(around, ways, setting, budget)?;
        let bent = around.feet(outcome.feet(&flaws.not_left));
        let even = |tries: &mut Tries| tries.even(around.skin, &bent, [around.radius(), around.half()]);
        // Noise folds sheets all over, bends do in some places. Sheets with other normals have fewer triangles than those with lids.
        let is_first = tries.evenings == 0;
        if is_first && NOISY * flaws.count() > outcome.surface.triangles.len() && even(tries) {
            return Ok(None);
        }
        let Some(flaws) = outcome.close(flaws, around, ways, tries.may_move.then_some(round), setting, budget)? else {
            tries.has_lids = true;
            // Those that go by valleys are given up where a round makes no more triangles.
            if tries.by_valleys {
                tries.made = None;
            }
            return Ok(None);
        };
        if flaws.is_none() {
            return self.shown(tries, outcome, left).map(Some);
        }
        let is_changed = (!is_first && even(tries)) || self.untangle(tries, &outcome, &flaws, left.len()) || even(tries);
        Ok(if is_changed { None } else { Some(tries.given_up(None)) })
    }

    /// Has what little is left of folds made anew with finer triangles around it, which may be another tangle; whether that is to be tried.
    fn untangle(&self, tries: &mut Tries, outcome: &Outcome, flaws: &Flaws, made: usize) -> bool {
        let Self { around, .. } = self;
        let is_little = flaws.off.is_empty() && NOISY * flaws.count() <= outcome.surface.triangles.len();
        if !is_little || tries.tangles == TANGLES || tries.made_of_tangle.replace(made) == Some(made) {
            return false;
        }
        let near = outcome.places(flaws).into_iter().filter_map(|x| around.closest(&x));
        let feet = near.flat_map(|(face, _)| around.skin.triangles[face as usize]).collect();
        around.feet(feet).into_iter().for_each(|foot| tries.most[foot as usize] *= 0.5);
        tries.made = None;
        tries.tangles += 1;
        true
    }

    /// What is told of a surface without flaws.
    fn shown(&self, tries: &Tries, outcome: Outcome, left: &[[u32; 3]]) -> Result<Told, Stopped> {
        let Self { around, budget, .. } = self;
        if outcome.off > around.moved {
            return Ok(tries.given_up(None));
        }
        if around.skin.sides == OUTER && !around.wind_inside(left, budget)? {
            return Ok(Told::OtherSeams);
        }
        let mut surface = outcome.surface;
        if !(is_embedded(&mut surface, budget)? && holds(&surface, around.skin)) {
            return Ok(Told::OtherSeams);
        }
        let surface = Box::new(surface);
        Ok(Told::Made(if tries.steadiness == Some(true) { Flat::Steady(surface) } else { Flat::Made(surface) }))
    }
}

/// How far off sheets each vertex of a surface may be, as what these are nearer at corners is part of the band.
fn may_be_off(skin: &Skin, half: f64) -> Vec<f64> {
    skin.lost.iter().map(|lost| (BOTH * half - lost).min(OFF * half)).collect()
}
