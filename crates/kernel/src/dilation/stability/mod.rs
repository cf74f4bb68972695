//! Stability of a dilation's topology: at which radii near r it changes, with proofs.
//!
//! D(s), the points within s of a compact set A, changes its topology only at critical values of the distance to A: if there is none in
//! (s, t], D(t) deforms onto D(s) (Grove, "Critical point theory for distance functions", 1993; Chazal, Cohen-Steiner and Lieutier, "A sampling
//! theory for compact sets in Euclidean space", Discrete Comput. Geom. 41, 2009). [`search`] bounds all critical values in a window by
//! intervals, of A itself and not of a mesh of it; [`cluster`] proves that the topology does change there; [`pieces`] bounds the radius from
//! which on D(s) is one piece.

mod cells;
mod cluster;
mod hull;
mod pieces;
mod search;
mod spanning;

use super::drawn::Drawn;
use super::{COARSE, DilationError};
use crate::attractor::Attractor;
use crate::budget::{Budget, Stopped};
use crate::measure::bounds::bounding_box;
use crate::tolerance::{Radius, Tolerance};
use cells::Cells;
pub use cluster::Change;
use cluster::Cluster;
use search::{Aim, Effort, Found};

/// Whether D(r - e) and D(r + e) have the same topology, r the radius and e the tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Proven: no radius between is critical, so all D(s) between are isotopic.
    Stable,
    /// Proven: the Euler numbers, or the numbers of pieces, differ.
    Unstable,
    /// There may be critical radii between, and nothing more is proven.
    Unresolved,
}

/// Radii where the topology may change.
#[derive(Clone, Debug, PartialEq)]
pub struct CriticalRadius {
    /// The interval of these radii in mm. Where several places have such intervals that overlap, all of them.
    pub radius_mm: [f64; 2],
    /// What happens.
    pub change: Change,
    /// Places in space where it does.
    pub places: u64,
    /// Whether it is proven that the topology changes at each place; else it may.
    pub proven: bool,
    /// The sum of the changes of the Euler number over the places, where it is proven.
    pub euler: Option<i64>,
}

/// What is proven of a dilation's topology near its radius. Lengths in mm.
#[derive(Clone, Debug, PartialEq)]
pub struct Stability {
    /// Of the radii within the tolerance.
    pub verdict: Verdict,
    /// Critical radii between these are all listed.
    pub examined_mm: [f64; 2],
    /// They, in ascending order.
    pub critical: Vec<CriticalRadius>,
    /// The smallest radius s from which on D(s) is one piece lies in this interval.
    pub one_piece_mm: [f64; 2],
}

impl Stability {
    /// The last radii below r - e, and the first above r + e, where the topology may change: nothing does between them and those.
    #[must_use]
    pub fn neighbours(&self, radius: Radius, tolerance: Tolerance) -> [Option<&CriticalRadius>; 2] {
        let [low, high] = core(radius, tolerance);
        let below = self.critical.iter().filter(|critical| critical.radius_mm[1] < low);
        let above = self.critical.iter().filter(|critical| critical.radius_mm[0] > high);
        [below.max_by(|a, b| a.radius_mm[1].total_cmp(&b.radius_mm[1])), above.min_by(|a, b| a.radius_mm[0].total_cmp(&b.radius_mm[0]))]
    }
}

/// Values are to be known to this share of the tolerance.
const RESOLUTION: f64 = 0.25;
/// Cubes of a level, and nodes in their lists.
const EFFORT: Effort = Effort { cubes: 400_000, entries: 40_000_000 };
/// Levels that are added where nothing is proven.
const CLOSER: u32 = 4;
/// Bytes of a cell with its figures and control points.
const BYTES_PER_CELL: u64 = 500;
/// Rounding of coordinates and distances, as a share of the largest coordinate.
const SLACK: f64 = 1e-12;

fn core(radius: Radius, tolerance: Tolerance) -> [f64; 2] {
    // As in the dilation, a tolerance of the radius' order is taken for half of it.
    let e = tolerance.mm().min(0.5 * radius.mm());
    [radius.mm() - e, radius.mm() + e]
}

/// Examines the topology of D(s) for the radii s within the window, in mm, which is widened to hold r - e and r + e.
///
/// Where there is too much to look at, the window is narrowed, never below r - e to r + e; what is left then is unresolved. The work is
/// bounded, and the result does not depend on the number of threads.
///
/// # Errors
/// [`DilationError`]: stopped, or trimmed surfaces that cannot be drawn.
pub fn stability(
    attractor: &Attractor,
    radius: Radius,
    tolerance: Tolerance,
    window_mm: [f64; 2],
    budget: &Budget,
) -> Result<Stability, DilationError> {
    let drawn = Drawn::resolved(attractor, radius, tolerance, COARSE, budget)?;
    let (attractor, deviation) = drawn.as_ref().map_or((attractor, 0.0), |Drawn { attractor, meant, .. }| (attractor, meant.deviation_mm));
    let bounds = bounding_box(attractor, budget)?;
    let core = core(radius, tolerance);
    let resolution = RESOLUTION * (core[1] - core[0]) * 0.5;
    // Not below a length that is far above rounding.
    let lowest = (0.5 * core[0]).min(1e-3 * radius.mm()).max(1e3 * SLACK * bounds.extent());
    let whole = [window_mm[0].max(lowest).min(core[0]), window_mm[1].min(bounds.diagonal() + core[1]).max(core[1])];
    let slack = SLACK * (bounds.extent() + whole[1]);
    let most = (budget.limits.memory_bytes / (4 * BYTES_PER_CELL)).clamp(10_000, 4_000_000) as usize + attractor.roots().len();
    let mut cells = Cells::new(attractor, deviation, slack, most);
    // Critical points lie in the hull of A. No plane that a model is likely to have should part the cubes.
    let edge = (0..3).map(|axis| bounds.high[axis].high - bounds.low[axis].low).fold(0.0, f64::max).max(resolution) * 1.317;
    let low = std::array::from_fn(|axis| 0.5 * (bounds.low[axis].low + bounds.high[axis].high) - edge * [0.5137, 0.4929, 0.5041][axis]);
    let found = search::search(&mut cells, low, edge, &Aim { whole, core, resolution }, &EFFORT, budget)?;
    let examined_mm = found.window;
    let clusters = settled(&mut cells, found, budget)?;
    let one_piece_mm = pieces::one_piece(attractor, deviation, slack, resolution, most, budget)?;
    let verdict = verdict(&clusters, core, one_piece_mm);
    Ok(Stability { verdict, examined_mm, critical: grouped(clusters), one_piece_mm })
}

/// The clusters of a search. Those that are not proven to change the topology are looked at more closely.
fn settled(cells: &mut Cells<'_>, mut found: Found, budget: &Budget) -> Result<Vec<Cluster>, Stopped> {
    let mut settled = Vec::new();
    for round in 0.. {
        let (proven, mut open): (Vec<_>, Vec<_>) = cluster::clusters(cells, &found, budget)?.into_iter().partition(is_proven);
        settled.extend(proven);
        found.cubes = open.iter_mut().flat_map(|cluster| std::mem::take(&mut cluster.cubes)).collect();
        let next = if open.is_empty() || round == CLOSER { None } else { search::refined(cells, &found, &EFFORT, budget)? };
        match next {
            Some(next) => found = next,
            None => {
                settled.extend(open);
                break;
            }
        }
    }
    Ok(settled)
}

fn is_proven(cluster: &Cluster) -> bool {
    cluster.euler.is_some_and(|euler| euler != 0)
}

fn verdict(clusters: &[Cluster], core: [f64; 2], one_piece_mm: [f64; 2]) -> Verdict {
    let met: Vec<&Cluster> = clusters.iter().filter(|cluster| cluster.high >= core[0] && cluster.low <= core[1]).collect();
    if met.is_empty() {
        return Verdict::Stable;
    }
    let is_within = |low: f64, high: f64| core[0] < low && high <= core[1];
    let change: Option<i64> = met.iter().map(|cluster| cluster.euler.filter(|_| is_within(cluster.low, cluster.high))).sum();
    if change.is_some_and(|change| change != 0) || is_within(one_piece_mm[0], one_piece_mm[1]) {
        return Verdict::Unstable;
    }
    Verdict::Unresolved
}

/// One entry for clusters of a kind whose intervals overlap.
fn grouped(mut clusters: Vec<Cluster>) -> Vec<CriticalRadius> {
    clusters.sort_by(|a, b| a.low.total_cmp(&b.low).then(a.high.total_cmp(&b.high)).then(a.change.cmp(&b.change)));
    let mut groups: Vec<CriticalRadius> = Vec::new();
    for cluster in clusters {
        let proven = is_proven(&cluster);
        let fits =
            |group: &&mut CriticalRadius| group.change == cluster.change && group.proven == proven && cluster.low <= group.radius_mm[1];
        if let Some(group) = groups.iter_mut().find(fits) {
            group.radius_mm[1] = group.radius_mm[1].max(cluster.high);
            group.places += 1;
            group.euler = group.euler.zip(cluster.euler).map(|(a, b)| a + b);
        } else {
            let radius_mm = [cluster.low, cluster.high];
            groups.push(CriticalRadius { radius_mm, change: cluster.change, places: 1, proven, euler: cluster.euler });
        }
    }
    groups
}
