//! A few rays that stand for a rough graph.
//!
//! Let H be all that is not above a graph, and D_s(H) the places no farther from it than s. What is above the graph's dilation depends on H alone, and H is a union of rays that lead down from the graph's places. *Peaks* are some of
//! these: for s' < s, D_s'(H) is in the union of the D_s of the rays below peaks. A column over a polygon whose corners are no farther than c from its middle, and which is nowhere higher than h, is within c of the ray below the place of height h over the middle: it is *hidden* if all within s' + c of that one is within s of rays below peaks.
//!
//! Columns are taken from the widest to the narrowest. One that is not hidden has a highest place, which is a peak unless the rays below others have all within s - m of its own; its parts are looked at next. Where 2 c <= s - s' - m none need be: what is within s' + c of the ray over its middle is within s - m of that over its highest place.
//! The same is done upside down: rays lead up from pits.
//!
//! *The border.* The sheets around these rays end beside the part of the plane, and a strip joins them. There, rays lead down and up from both ends of a narrow column every few steps along the border: a place no farther than a distance from the part of the plane is about as far from one of these. So there is something between the sheets up to nearly s from the part.

use super::arrangement::height_field::Rays;
use super::half_ball::Cover;
use crate::attractor::cell::Point;
use crate::attractor::{Column, Graph};
use crate::budget::{Budget, Stopped};
use rayon::prelude::*;

/// Shares of what the result may be off: m, c of columns that are not split, and by how much peaks may be higher than the graph. With more for the first two there are fewer columns and peaks, and more triangles.
const APART: f64 = 0.5;
const NARROW: f64 = 0.27;
const SLACK: f64 = 0.05;
/// The same for the border: how wide and high columns are there, how far places between two of them are off, and how much nearer than s the sheets end. The strip goes down from there: along steep graphs it would be too near before it is beyond s, did they end much nearer.
const EDGE: f64 = 0.001;
const BETWEEN: f64 = 0.002;
const BORDER: f64 = 0.005;
/// Places along the border at most.
const MOST_ENDS: f64 = 200_000.0;
/// In how many rounds the columns of a level are looked at, so that peaks of one hide columns of the next.
const ROUNDS: usize = 8;
/// Columns that are split at most to find the highest place of one: more take longer than they save, unless it is very narrow.
const SPLITS: [usize; 2] = [12, 200];
/// How narrow columns are, in units of how narrow they need be, whose highest places are sought longer, and of which these should be known.
const NARROWEST: [f64; 2] = [0.1, 1e-4];
/// Bytes of a column that waits, for each of its numbers, too, and of a ray with what is made of it.
const BYTES_PER_COLUMN: f64 = 500.0;
const BYTES_PER_NUMBER: f64 = 16.0;
const BYTES_PER_RAY: f64 = 4_000.0;

/// Rays that stand for a graph.
pub(super) struct Stand {
    pub(super) rays: Rays,
    /// Both sheets may be no nearer to rays than this, s, and no farther than that.
    pub(super) least: f64,
    pub(super) outer: f64,
    /// What is no farther than `least` less `inward` from the graph is within `least` of rays, and these are no farther from it than `outward`.
    pub(super) inward: f64,
    pub(super) outward: f64,
    /// Columns that were looked at.
    pub(super) columns: u64,
    /// Bytes that were held at most.
    pub(super) bytes: f64,
}

/// The rays that stand for a graph whose dilation by a radius may be off by a length; none where there would be more columns than may be, or their places are not told.
///
/// Cost: some microseconds for each column that may be seen, of which there are several for each square of the length.
///
/// # Errors
/// [`Stopped`].
pub(super) fn stand(graph: &Graph, radius: f64, within: f64, budget: &Budget) -> Result<Option<Stand>, Stopped> {
    if within <= 0.0 {
        return Ok(None);
    }
    let held = radius - within;
    let (apart, inward, outward) = (APART * within, (APART + 2.0 * NARROW) * within, SLACK * within);
    let (least, outer) = (held + inward, radius + within - outward);
    let Some(Border { ends, border, rim }) = at_border(graph, within, [least, outer], budget)? else { return Ok(None) };
    let bytes_per_column = BYTES_PER_COLUMN + BYTES_PER_NUMBER * graph.numbers() as f64;
    let most = (budget.limits.memory_bytes as f64 / bytes_per_column).min(budget.limits.cells as f64) as usize;
    let (mut peaks, mut columns, mut bytes) = ([Vec::new(), Vec::new()], 0, 0.0_f64);
    for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
        let mut search =
            Search { graph, cover: Cover::new(&graph.corners, least), held, apart, slack: outward, most, looked: 0, waiting: 0 };
        if !search.run(sign, budget)? {
            return Ok(None);
        }
        columns += search.looked as u64;
        bytes = bytes.max(bytes_per_column * search.waiting as f64);
        peaks[side] = search.cover.ends();
        peaks[side].extend(ends.iter().map(|&[x, y, low, high]| [x, y, if side == 0 { low } else { -high }]));
    }
    let rays = BYTES_PER_RAY * peaks.iter().map(Vec::len).sum::<usize>() as f64;
    if rays > budget.limits.memory_bytes as f64 {
        return Ok(None);
    }
    let bytes = bytes.max(rays);
    let rays = Rays { axes: graph.axes, corners: graph.corners.clone(), peaks, border, rim };
    Ok(Some(Stand { rays, least, outer, inward, outward, columns, bytes }))
}

/// What is known of a graph's border.
struct Border {
    /// Places along it with two heights that the graph is between.
    ends: Vec<[f64; 4]>,
    /// How far from the part of the plane sheets around rays from these may end, and may be joined.
    border: f64,
    rim: f64,
}

/// The border of a graph, given the distances that sheets are between; none where its places are not told.
fn at_border(graph: &Graph, within: f64, [least, outer]: [f64; 2], budget: &Budget) -> Result<Option<Border>, Stopped> {
    let edge = EDGE * within;
    let step = (8.0 * least * BETWEEN * within).sqrt();
    let (mut places, roots) = (Vec::new(), graph.columns(1.0));
    for (k, a) in graph.corners.iter().enumerate() {
        let b = graph.corners[(k + 1) % graph.corners.len()];
        let steps = ((b[0] - a[0]).hypot(b[1] - a[1]) / step).ceil();
        if places.len() as f64 + steps > MOST_ENDS {
            return Ok(None);
        }
        let shares = (0..steps as u64).map(|number| number as f64 / steps);
        places.extend(shares.map(|share| [0, 1].map(|axis| a[axis] + share * (b[axis] - a[axis]))));
    }
    let end = |&at: &[f64; 2]| {
        budget.cancel.check()?;
        Ok(graph.narrow_at(&roots, at, edge).map(|column| {
            let [x, y] = column.middle();
            [x, y, column.low, column.high]
        }))
    };
    let ends: Vec<Option<[f64; 4]>> = places.par_iter().map(end).collect::<Result<_, Stopped>>()?;
    let Some(ends) = ends.into_iter().collect::<Option<Vec<_>>>() else { return Ok(None) };
    // From a place that is so far from the part of the plane to what is closest there, from that to the next of these along the border, and to the middle of its column.
    let away = |distance: f64| distance.hypot(0.5 * step) + edge;
    let border = least - BORDER * within;
    let rim = ((outer - edge).powi(2) - 0.25 * step * step).max(0.0).sqrt();
    // The sheets are at least as far apart as both half-balls, less how high the column is.
    let opening = 2.0 * (least * least - away(border).powi(2)).max(0.0).sqrt() - edge;
    Ok((opening > 0.0 && rim > least).then_some(Border { ends, border, rim }))
}

/// A search for peaks.
struct Search<'a> {
    graph: &'a Graph,
    cover: Cover,
    /// s'.
    held: f64,
    /// m.
    apart: f64,
    /// By how much a peak may be higher than the graph.
    slack: f64,
    /// Columns that may be looked at, or wait.
    most: usize,
    looked: usize,
    waiting: usize,
}

/// A column, and its highest place if that is known.
type Open = (Column, Option<Point>);

/// What comes of a column.
enum Seen {
    Hidden,
    /// Its place that may be a peak, and its parts.
    Left(Option<Point>, Vec<Open>),
    /// Its highest place is not told.
    Unknown,
}

impl Search<'_> {
    /// Finds the peaks, upside down if `sign` is -1; false where columns are more than may be, or highest places are not told.
    fn run(&mut self, sign: f64, budget: &Budget) -> Result<bool, Stopped> {
        let mut open: Vec<Open> = self.graph.columns(sign).into_iter().map(|column| (column, None)).collect();
        while !open.is_empty() {
            self.looked += open.len();
            self.waiting = self.waiting.max(open.len());
            if self.looked > self.most {
                return Ok(false);
            }
            let mut rounds: Vec<Vec<Open>> = vec![Vec::new(); ROUNDS];
            for (number, column) in open.drain(..).enumerate() {
                rounds[number % ROUNDS].push(column);
            }
            // What comes of as many at once is no more than may wait.
            let at_once = (self.most / self.graph.most_parts().max(1)).max(1);
            for part in rounds.iter().flat_map(|round| round.chunks(at_once)) {
                if open.len() > self.most {
                    return Ok(false);
                }
                let look = |column: &Open| budget.cancel.check().map(|()| self.look(column));
                let seen: Vec<Seen> = part.par_iter().map(look).collect::<Result<_, Stopped>>()?;
                for seen in seen {
                    budget.cancel.check()?;
                    match seen {
                        Seen::Hidden => {}
                        Seen::Unknown => return Ok(false),
                        Seen::Left(peak, parts) => {
                            // Others of the same round may hide it.
                            if let Some(peak) = peak.filter(|peak| !self.hides(peak)) {
                                self.cover.add(peak);
                            }
                            open.extend(parts);
                        }
                    }
                }
            }
        }
        Ok(true)
    }

    /// Whether there are peaks enough around a place.
    fn hides(&self, peak: &Point) -> bool {
        // s - m is this much more than s'.
        self.cover.hides(peak, self.held + 2.0 * self.narrow())
    }

    /// c of columns that are not split.
    fn narrow(&self) -> f64 {
        self.apart * (NARROW / APART)
    }

    fn look(&self, (column, known): &Open) -> Seen {
        let ([x, y], reach) = (column.middle(), column.reach());
        let is_hidden = |high: f64| self.cover.hides(&[x, y, high], self.held + reach);
        if is_hidden(column.high) {
            return Seen::Hidden;
        }
        let narrow = self.narrow();
        let splits = SPLITS[usize::from(reach <= NARROWEST[0] * narrow)];
        let (peak, high) = known.map_or_else(|| self.graph.peak(column, self.slack, splits), |peak| (peak, peak[2]));
        if high < column.high && is_hidden(high) {
            return Seen::Hidden;
        }
        let is_highest = peak[2] >= high;
        if !is_highest && reach <= NARROWEST[1] * narrow {
            return Seen::Unknown;
        }
        let mut parts = Vec::new();
        if !is_highest || reach > narrow {
            parts.extend(self.graph.parts(column).map(|part| {
                let part = part.below(high);
                let is_known = is_highest && part.has([peak[0], peak[1]]);
                (part, is_known.then_some(peak))
            }));
        }
        Seen::Left(Some(peak).filter(|peak| !self.hides(peak)), parts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::graph::tests::{away, graphs, places};
    use crate::budget::{Limits, StopReason};
    use crate::dilation::plan::{Balls, Plan};
    use crate::split_mix::Random;
    use crate::tolerance::Tolerance;
    use glam::DVec3;

    const RADIUS: f64 = 1.0;
    const WITHIN: f64 = 0.2;

    /// The distance from rays that lead down.
    fn from_rays(x: &Point, peaks: &[Point]) -> f64 {
        let square = |peak: &Point| (x[0] - peak[0]).powi(2) + (x[1] - peak[1]).powi(2) + (x[2] - peak[2]).max(0.0).powi(2);
        peaks.iter().map(square).fold(f64::INFINITY, f64::min).sqrt()
    }

    /// All that is as near to the graph as it should be is near to rays that lead down, and to those that lead up; and these start at places of the graph.
    #[test]
    fn rays_stand_for_graphs() {
        for (number, attractor) in graphs().iter().enumerate() {
            let graph = attractor.graph().unwrap();
            let stand = stand(&graph, RADIUS, WITHIN, &Budget::default()).unwrap().unwrap();
            let roots = graph.columns(1.0);
            let Stand { rays, least, outer, inward, outward, .. } = &stand;
            assert!((least - inward - (RADIUS - WITHIN)).abs() < 1e-12 && (outer + outward - (RADIUS + WITHIN)).abs() < 1e-12);
            let all = places(attractor, &graph, 3_000);
            let mut random = Random(number as u64);
            let mut farthest = [0.0_f64; 2];
            for _ in 0..3_000 {
                let place = &all[(random.share() * all.len() as f64) as usize];
                let way = DVec3::new(random.share() - 0.5, random.share() - 0.5, random.share() - 0.5).normalize();
                let x = (DVec3::from_array(*place) + (least - inward) * way).to_array();
                farthest[0] = farthest[0].max(from_rays(&x, &rays.peaks[0]));
                farthest[1] = farthest[1].max(from_rays(&[x[0], x[1], -x[2]], &rays.peaks[1]));
            }
            assert!(farthest.iter().all(|&far| far <= least + 1e-6 && far > least - inward), "{number}: {farthest:?} {least}");
            for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
                for peak in &rays.peaks[side] {
                    let there = graph.narrow_at(&roots, [peak[0], peak[1]], 0.01).unwrap();
                    let height = if side == 0 { there.high } else { -there.low };
                    assert!(peak[2] <= height + outward + 0.01, "{number} {sign}: {peak:?} {there:?}");
                }
            }
            // Around the border.
            for (k, a) in graph.corners.iter().enumerate() {
                let b = graph.corners[(k + 1) % graph.corners.len()];
                let (way, share) = ([b[0] - a[0], b[1] - a[1]], random.share());
                let length = way[0].hypot(way[1]);
                let out = |distance: f64| [0, 1].map(|axis| a[axis] + share * way[axis] + distance / length * [way[1], -way[0]][axis]);
                let open = |[x, y]: [f64; 2]| {
                    let top = |peaks: &[Point]| {
                        let heights = peaks.iter().filter_map(|peak| {
                            let square = least * least - (x - peak[0]).powi(2) - (y - peak[1]).powi(2);
                            (square >= 0.0).then(|| peak[2] + square.sqrt())
                        });
                        heights.fold(f64::NEG_INFINITY, f64::max)
                    };
                    top(&rays.peaks[0]) + top(&rays.peaks[1])
                };
                assert!(open(out(rays.border)) > 0.0 && rays.border > least - 0.1 * WITHIN, "{number} {k}");
                let [x, y] = out(rays.rim);
                assert!(rays.peaks.iter().all(|peaks| from_rays(&[x, y, -1e3], peaks) <= *outer + 1e-9), "{number} {k}");
            }
        }
    }

    #[test]
    fn searches_keep_limits_and_can_be_stopped() {
        let graph = graphs()[1].graph().unwrap();
        let columns = stand(&graph, RADIUS, WITHIN, &Budget::default()).unwrap().unwrap().columns;
        let with = |limits: Limits| stand(&graph, RADIUS, WITHIN, &Budget { limits, ..Budget::default() }).unwrap();
        assert!(with(Limits { cells: columns, ..Limits::default() }).is_some());
        assert!(with(Limits { cells: columns / 4, ..Limits::default() }).is_none());
        assert!(with(Limits { memory_bytes: 100_000, ..Limits::default() }).is_none());
        assert!(stand(&graph, RADIUS, 0.0, &Budget::default()).unwrap().is_none());
        let budget = Budget::default();
        budget.cancel.fire(StopReason::Cancelled);
        assert!(stand(&graph, RADIUS, WITHIN, &budget).is_err());
    }

    /// The solid's surface is a sphere as far from the graph as it should be everywhere, whatever the number of threads.
    #[test]
    fn graphs_are_thickened_by_rays() {
        for (number, attractor) in graphs().iter().enumerate() {
            let graph = attractor.graph().unwrap();
            let plan =
                Plan::new(attractor, Balls { least: RADIUS, most: RADIUS }, Tolerance::new(WITHIN).unwrap(), true, 1.0, &Budget::default())
                    .unwrap();
            let made = plan.run_over(&graph, &Budget::default()).unwrap().unwrap();
            assert!(made.topology_exact && made.pitch_mm.is_none() && made.inner_mm <= WITHIN && made.outer_mm <= WITHIN, "{number}");
            let topology = made.solid.topology();
            assert_eq!((topology.components, topology.euler), (1, 2), "{number}");
            let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
            let again = alone.install(|| plan.run_over(&graph, &Budget::default())).unwrap().unwrap();
            assert!(again.solid.mesh().vertices == made.solid.mesh().vertices, "{number}");
            let mesh = made.solid.mesh();
            for triangle in mesh.triangles.iter().step_by(mesh.triangles.len() / 200) {
                let middle = triangle.iter().map(|&corner| mesh.vertices[corner as usize] / 3.0).sum::<DVec3>();
                let [least, most] = away(&graph, &graph.axes.map(|axis| middle[axis]), 0.02);
                assert!(most >= RADIUS - made.inner_mm && least <= RADIUS + made.outer_mm, "{number}: {least} {most} {middle}");
            }
            let predicted = plan.predict_over(&graph, &Budget::default()).unwrap().unwrap();
            assert_eq!(predicted.triangles as usize, mesh.triangles.len());
        }
    }
}
