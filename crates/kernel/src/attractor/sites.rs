//! What stands for cells in a dilation: for every state the kind of site that allows the largest cells.

use super::cell::{Cell, ControlPoint, Point, Site, distance_squared, dot, frame_columns, subtract, times};
use super::{Attractor, OwnRadius};
use crate::automaton::{Automaton, LeafPrimitive, StateId};
use crate::budget::{CancelToken, Stopped};

/// Errors of replacing a cell of A by its sites S, in mm: d(x, A) <= d(x, S) + outer, and
/// d(x, S)^2 <= (d(x, A) + inner)^2 + inner_square.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SiteError {
    /// See above, mm^2: the squared radius of a cover.
    pub(crate) inner_square: f64,
    /// See above: how far the cell may be from the sites or their hull.
    pub(crate) inner: f64,
    /// See above: how far sites may be from the cell.
    pub(crate) outer: f64,
    /// d(x, S)^2 where d(x, A) = r - e, at most: (r - e + inner)^2 + inner_square, which the largest of either alone may exceed.
    pub(crate) square: f64,
}

impl SiteError {
    /// Whether the sites are what they stand for.
    pub(crate) fn is_zero(self) -> bool {
        self.inner_square == 0.0 && self.inner == 0.0 && self.outer == 0.0
    }

    /// The larger of each.
    pub(crate) fn max(self, other: Self) -> Self {
        Self {
            inner_square: self.inner_square.max(other.inner_square),
            inner: self.inner.max(other.inner),
            outer: self.outer.max(other.outer),
            square: self.square.max(other.square),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Choice {
    /// The centre of the ball.
    Centre,
    /// What the model draws, or the centre of the ball where that is closer.
    Drawn,
    /// The points of the state's cover.
    Cover,
}

/// How large cells may be, and what stands for them.
#[derive(Clone, Debug)]
pub(crate) struct SiteRule<'a> {
    attractor: &'a Attractor,
    radius: f64,
    tolerance: f64,
    /// The share that sites use of what they may be off.
    coarseness: f64,
    /// [`SITE_SHARE`], or [`DENSE_SHARE`].
    share: f64,
    choices: Vec<Choice>,
    /// States that roots reach.
    used: Vec<usize>,
    /// Of every root, how much less the square of its own radius is than that of `radius`; empty where all have this one.
    deficits: Vec<f64>,
    /// Where sites are to be nearer to what they stand for.
    closer: Vec<Closer>,
}

/// A ball to which cells only come if their sites are off by a share of what they may be elsewhere.
#[derive(Clone, Copy, Debug)]
struct Closer {
    centre: Point,
    radius: f64,
    share: f64,
}

/// The share of r^2 - (r - e)^2 that sites may use, e the tolerance; the lattice has the rest. More lets cells be larger and
/// needs a finer lattice.
const SITE_SHARE: f64 = 0.3;
/// The same where points stand for cells: there the lattice is finer anyway, and the number of cells decides. It is nearly as much as they may be off outwards.
const DENSE_SHARE: f64 = 0.45;
/// The share of e by which sites may be off the attractor: the lattice's own error is inner only.
const OUTER_SHARE: f64 = 0.5;
/// The share of both that segments along smooth curves use: there are 1.7 times as many, as their errors are squares of their lengths, and what is left saves a tenth to two thirds of the triangles. Curves that have more than twice as many are rough.
const ALONG_CURVES: f64 = 0.35;
const MORE_ALONG_CURVES: f64 = 2.0;
/// Of more segments it is not asked.
const MANY: usize = 10_000;

impl<'a> SiteRule<'a> {
    /// The rule for a dilation by `radius`, the largest of the roots' own, to `tolerance`, both in mm. Sites use a share of what they may be off, `coarseness`: 1 for as few as possible.
    pub(crate) fn new(attractor: &'a Attractor, radius: f64, tolerance: f64, coarseness: f64) -> Self {
        let deficit = |root: usize| match attractor.own_radius(root) {
            Some(OwnRadius::Constant(own)) => (radius * radius - own * own).max(0.0),
            _ => 0.0,
        };
        let deficits = if attractor.has_own_radii() { (0..attractor.roots().len()).map(deficit).collect() } else { Vec::new() };
        let mut rule = Self {
            attractor,
            radius,
            tolerance,
            coarseness,
            share: SITE_SHARE,
            choices: Vec::new(),
            used: used(attractor),
            deficits,
            closer: Vec::new(),
        };
        choose(&mut rule);
        if rule.is_dense() {
            rule.share = DENSE_SHARE;
        }
        let never = CancelToken::new();
        if rule.is_along_curves()
            && let Ok(Some(leaves)) = rule.leaves(MANY, &never)
        {
            let finer = rule.finer(ALONG_CURVES);
            if let Ok(Some(_)) = finer.leaves((MORE_ALONG_CURVES * leaves as f64) as usize, &never) {
                return finer;
            }
        }
        rule
    }

    /// The same with sites that use only a share of what they may be off.
    pub(crate) fn finer(&self, share: f64) -> Self {
        Self { coarseness: share * self.coarseness, ..self.clone() }
    }

    /// The same with sites that use only a share of what they may be off where they come within a distance of some places.
    pub(crate) fn closer(&self, places: &[Point], radius: f64, share: f64) -> Self {
        let mut closer = self.clone();
        closer.closer.extend(places.iter().map(|&centre| Closer { centre, radius, share }));
        closer
    }

    /// Whether the sites of a cell with such an error are as near to it as they are to be where it is.
    fn is_close(&self, cell: &Cell, error: &SiteError) -> bool {
        let is_near = |place: &&Closer| distance_squared(&cell.ball.centre, &place.centre).sqrt() <= place.radius + cell.ball.radius;
        let share = self.closer.iter().filter(is_near).map(|place| place.share).fold(1.0, f64::min);
        share == 1.0 || (error.inner.max(error.outer) <= share * self.most_outer() && error.inner_square <= share * self.room())
    }

    /// Whether segments, or points, stand for curves.
    fn is_along_curves(&self) -> bool {
        let states = self.attractor.automaton().states();
        let is_of_curve = |&state: &usize| matches!(states[state].leaf, LeafPrimitive::Simplex | LeafPrimitive::Chord(_));
        !self.is_exact() && !self.is_dense() && self.used.iter().all(is_of_curve)
    }

    /// How many leaves there are, if no more than `most`.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(crate) fn leaves(&self, most: usize, cancel: &CancelToken) -> Result<Option<usize>, Stopped> {
        let attractor = self.attractor;
        let mut leaves = 0;
        let mut open: Vec<(Cell, Vec<ControlPoint>)> =
            attractor.roots().iter().enumerate().map(|(index, root)| (attractor.root_cell(index), root.points.clone())).collect();
        while let Some((cell, points)) = open.pop() {
            cancel.check()?;
            let transitions = &attractor.state_of(&cell).transitions;
            if transitions.is_empty() || self.leaf(&cell, &points).is_some() {
                leaves += 1;
            } else {
                open.extend(attractor.children(&cell, &points));
            }
            if leaves + open.len() > most {
                return Ok(None);
            }
        }
        Ok(Some(leaves))
    }

    /// The share of r^2 - (r - e)^2 that is the lattice's: all of it where sites are cells themselves, without error.
    pub(crate) fn lattice_share(&self) -> f64 {
        if self.is_exact() { 1.0 } else { 1.0 - self.coarseness * self.share }
    }

    /// Whether roots have different radii.
    pub(crate) fn is_graded(&self) -> bool {
        !self.deficits.is_empty()
    }

    /// What is added to the square of the distance from a root's cells, so that one radius serves all: a ball of radius s in space is the section of one of radius r in four
    /// dimensions whose centre is sqrt(r^2 - s^2) off, and squared distances from there are larger by r^2 - s^2. They are convex functions that differ from |x|^2 by concave
    /// ones, and the distances grow by no more than the way, as those of points in space do.
    #[inline]
    pub(crate) fn deficit(&self, root: u32) -> f64 {
        self.deficits.get(root as usize).copied().unwrap_or(0.0)
    }

    /// Whether sites are the attractor itself.
    pub(crate) fn is_exact(&self) -> bool {
        self.used.iter().all(|&index| self.is_simplex(index))
    }

    /// Whether some sites are points that stand for cells: there are many of them then, close to each other.
    pub(crate) fn is_dense(&self) -> bool {
        self.used.iter().any(|&index| self.is_dense_state(index))
    }

    fn is_dense_state(&self, index: usize) -> bool {
        let sparse = match self.attractor.automaton().states()[index].leaf {
            LeafPrimitive::Simplex | LeafPrimitive::Chord(_) | LeafPrimitive::Drawn(_) => true,
            LeafPrimitive::Polygon(_) => self.attractor.precision(StateId::new(index)).is_some(),
            LeafPrimitive::Centre | LeafPrimitive::Star(_) => false,
        };
        self.choices[index] != Choice::Drawn || !sparse
    }

    /// How far sites may be from the attractor.
    pub(crate) fn outer_reserve(&self) -> f64 {
        let exact = |&index: &usize| self.choices[index] == Choice::Cover || self.is_simplex(index);
        if self.used.iter().all(exact) { 0.0 } else { self.most_outer() }
    }

    fn most_outer(&self) -> f64 {
        self.coarseness * OUTER_SHARE * self.tolerance
    }

    fn is_simplex(&self, state: usize) -> bool {
        self.attractor.automaton().states()[state].leaf == LeafPrimitive::Simplex
    }

    /// The errors of a cell if it is small enough to be replaced.
    #[inline]
    pub(crate) fn leaf(&self, cell: &Cell, points: &[ControlPoint]) -> Option<SiteError> {
        let error = match self.choices[cell.state.index()] {
            Choice::Centre => both(cell.ball.radius),
            Choice::Drawn => both(self.attractor.leaf_error(cell, points).min(cell.ball.radius)),
            Choice::Cover => {
                let cover = self.attractor.cover(cell.state)?;
                let columns = frame_columns(points);
                let from_centre = |point: &Point| times(&columns, &subtract(point, &cover.centre));
                let square = cover.points.iter().map(from_centre).map(|x| dot(&x, &x)).fold(0.0, f64::max);
                SiteError { inner_square: square, inner: cover.halo.image(&columns).radius(), ..SiteError::default() }
            }
        };
        let least = self.radius - self.tolerance;
        let allowed = least * least + self.room();
        let deficit = self.deficit(cell.root);
        if deficit == 0.0 {
            let square = (least + error.inner).powi(2) + error.inner_square;
            let is_small = square <= allowed && error.outer <= self.most_outer() && self.is_close(cell, &error);
            return is_small.then_some(SiteError { square, ..error });
        }
        // The same in space, for the root's own radius: x within `outer` of the sites and o farther from the cell has
        // (d + o)^2 + deficit <= outer^2 + 2 d o + o^2, d^2 = outer^2 - deficit, which is (outer + o')^2 at most.
        let in_space = |distance: f64| (distance * distance - deficit).max(0.0).sqrt();
        let square = (in_space(least) + error.inner).powi(2) + error.inner_square + deficit;
        let farthest = in_space(self.radius + self.tolerance);
        let outer = (2.0 * farthest * error.outer + error.outer * error.outer) / (2.0 * self.radius);
        (square <= allowed && outer <= self.most_outer() && self.is_close(cell, &error)).then_some(SiteError { square, outer, ..error })
    }

    /// (r - e)^2 and what sites may use.
    pub(crate) fn least_square(&self) -> f64 {
        (self.radius - self.tolerance).powi(2) + self.room()
    }

    /// What sites may use of r^2 - (r - e)^2.
    pub(crate) fn room(&self) -> f64 {
        let least = self.radius - self.tolerance;
        self.coarseness * self.share * (self.radius * self.radius - least * least)
    }

    /// The largest of the roots' own radii, as far as points stand for their cells.
    pub(crate) fn largest_dense(&self) -> f64 {
        let dense = |root: &usize| self.attractor.roots()[*root].state.index();
        let own = |root: usize| (self.radius * self.radius - self.deficit(root as u32)).max(0.0).sqrt();
        (0..self.attractor.roots().len()).filter(|root| self.is_dense_state(dense(root))).map(own).fold(0.0, f64::max)
    }

    /// Emits the sites of a leaf.
    #[inline]
    pub(crate) fn emit(&self, cell: &Cell, points: &[ControlPoint], sink: &mut impl FnMut(Site)) {
        match self.choices[cell.state.index()] {
            Choice::Drawn if self.attractor.leaf_error(cell, points) <= cell.ball.radius => self.attractor.emit(cell, points, sink),
            Choice::Centre | Choice::Drawn => sink(Site::Point(cell.ball.centre)),
            Choice::Cover => {
                let Some(cover) = self.attractor.cover(cell.state) else { return };
                let columns = frame_columns(points);
                for point in &cover.points {
                    let offset = times(&columns, point);
                    sink(Site::Point([points[0][0] + offset[0], points[0][1] + offset[1], points[0][2] + offset[2]]));
                }
            }
        }
    }

    /// The attractor.
    pub(crate) fn attractor(&self) -> &'a Attractor {
        self.attractor
    }

    /// Distance of x from the sites of a leaf, squared, in space.
    pub(crate) fn nearest(&self, x: &Point, cell: &Cell, points: &[ControlPoint]) -> f64 {
        let mut nearest = f64::INFINITY;
        self.emit(cell, points, &mut |site| nearest = nearest.min(site.distance_squared(x)));
        nearest
    }
}

fn both(error: f64) -> SiteError {
    SiteError { inner: error, outer: error, ..SiteError::default() }
}

/// Chooses for every state that a root of affine maps reaches the kind of site with the least expected work; all states
/// of such a root have the same kind. Other states are drawn.
fn choose(rule: &mut SiteRule<'_>) {
    let attractor = rule.attractor;
    let states = attractor.automaton().states();
    rule.choices = vec![Choice::Drawn; states.len()];
    let mut decided = vec![false; states.len()];
    for (index, root) in attractor.roots().iter().enumerate() {
        if !states[root.state.index()].frame || decided[root.state.index()] {
            continue;
        }
        let below = reachable(attractor.automaton(), root.state);
        let mut best = (f64::INFINITY, Choice::Centre);
        for choice in [Choice::Cover, Choice::Drawn, Choice::Centre] {
            let possible = |&state: &usize| match choice {
                Choice::Cover => attractor.cover(StateId::new(state)).is_some(),
                Choice::Drawn => matches!(states[state].leaf, LeafPrimitive::Drawn(_)) || attractor.has_needles(StateId::new(state)),
                Choice::Centre => true,
            };
            if !below.iter().all(possible) {
                continue;
            }
            below.iter().for_each(|&state| rule.choices[state] = choice);
            // Sites that are exact leave the lattice a larger share.
            let work = expected_sites(rule, index) * if choice == Choice::Cover { 1.0 } else { INEXACT };
            if work < best.0 {
                best = (work, choice);
            }
        }
        below.iter().for_each(|&state| (rule.choices[state], decided[state]) = (best.1, true));
    }
}

/// Work of other sites relative to points of the attractor: these leave the lattice its whole outer error, and cost less
/// to find and to compare. Measured on Takagi surfaces.
const INEXACT: f64 = 6.0;
/// Paths that estimate the number of leaves.
const PATHS: u32 = 64;
/// Longest of them.
const LONGEST_PATH: u32 = 200;

/// Larger children are followed more often: as if the dimension were this.
const LIKELY_DIMENSION: f64 = 1.5;

/// The number of sites below a root, estimated from leaves of a few paths spread over the addresses, each of which stands
/// for as many leaves as its probability has in one (Knuth, "Estimating the efficiency of backtrack
/// programs", Math. Comp. 29, 1975). Nothing but time depends on it.
fn expected_sites(rule: &SiteRule<'_>, root: usize) -> f64 {
    let attractor = rule.attractor;
    let mut total = 0.0;
    for path in 0..PATHS {
        let (mut cell, mut points) = (attractor.root_cell(root), attractor.roots()[root].points.clone());
        let mut address = ((f64::from(path) + 0.5) * 0.618_033_988_749_894_9).fract();
        let mut weight = 1.0;
        let mut depth = 0;
        while rule.leaf(&cell, &points).is_none() {
            let transitions = &attractor.state_of(&cell).transitions;
            if transitions.is_empty() || depth == LONGEST_PATH {
                return f64::INFINITY;
            }
            let children: Vec<(Cell, Vec<ControlPoint>)> = attractor.children(&cell, &points).collect();
            let shares: Vec<f64> =
                children.iter().map(|(child, _)| child.ball.radius.max(0.01 * cell.ball.radius).powf(LIKELY_DIMENSION)).collect();
            let total: f64 = shares.iter().sum();
            let mut rest = address * total;
            let mut chosen = 0;
            while chosen + 1 < shares.len() && rest >= shares[chosen] {
                rest -= shares[chosen];
                chosen += 1;
            }
            let share = if total > 0.0 { shares[chosen] / total } else { 1.0 / shares.len() as f64 };
            (address, weight, depth) = ((rest / shares[chosen]).clamp(0.0, 0.999_999_999), weight / share, depth + 1);
            (cell, points) = children.into_iter().nth(chosen).expect("one of the children was chosen");
        }
        let mut sites = 0.0;
        // Points are cheaper than segments, and those than triangles.
        rule.emit(&cell, &points, &mut |site| {
            sites += match site {
                Site::Point(_) => 1.0,
                Site::Segment(_) => 2.0,
                Site::Triangle(_) => 4.0,
            };
        });
        total += weight * sites;
    }
    total / f64::from(PATHS)
}

/// The states that roots reach, in order.
pub(super) fn used(attractor: &Attractor) -> Vec<usize> {
    let sorted = |mut states: Vec<usize>| {
        states.sort_unstable();
        states.dedup();
        states
    };
    let starts = sorted(attractor.roots().iter().map(|root| root.state.index()).collect());
    sorted(starts.into_iter().flat_map(|state| reachable(attractor.automaton(), StateId::new(state))).collect())
}

/// All states that paths from a state meet.
pub(super) fn reachable(automaton: &Automaton, from: StateId) -> Vec<usize> {
    let mut seen = vec![from];
    let mut next = 0;
    while next < seen.len() {
        for transition in &automaton.state(seen[next]).transitions {
            if !seen.contains(&transition.to) {
                seen.push(transition.to);
            }
        }
        next += 1;
    }
    seen.into_iter().map(StateId::index).collect()
}
