//! The trimmed part of a parameter domain: closed loops of arcs, proven simple and apart from each other.
//!
//! Arcs are halved until the directions of each are less than half a turn apart, neighbours do not turn back on each
//! other, and the hulls of all other pairs are apart. Then no loop meets itself or another one: an arc advances along
//! the middle of its directions, and neighbours a, b that meet in p lie in p - C_a and p + C_b, which have only p in
//! common. Sub-arcs and chords lie in the arcs' hulls and cones, so the same holds for every finer set of arcs and for
//! the polygons of their chords: all of these have the topology of the loops themselves. Arcs as small as
//! [`RESOLUTION`] that are still undecided are refused.

use super::arc::{Arc, Parameter, cross};
use super::pairs::Boxes;
use super::rays::{Rays, crosses_segment};

/// Gaps between successive curves, and overshoot of the domain, as shares of the domain's width: closed silently up to
/// here, refused beyond.
pub(crate) const GAP: f64 = 1e-6;
/// Control points so near to the domain's border, as a share of its width, are meant to lie on it.
const SNAP: f64 = 1e-9;
/// Arcs so small, as a share of the domain's width, are not told apart.
const RESOLUTION: f64 = 1e-9;
/// Rounding of coordinates, as a share of the domain's width.
const ROUNDING: f64 = 1e-14;
/// Arcs that a proof may need, for every arc given, and in all.
const ARCS_PER_ARC: usize = 64;
const LEAST_ARCS: usize = 1 << 16;
/// Rounds of halving.
const ROUNDS: usize = 64;

/// Where a trim curve stands: its loop, outer first, and its number in it; `None` for the domain's own border.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CurvePlace {
    pub(crate) inner: Option<usize>,
    pub(crate) curve: usize,
}

/// Why loops bound no region.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum RegionFault {
    /// A curve does not start where the one before it ends.
    Open { place: CurvePlace, end: Parameter, start: Parameter },
    /// A loop is a single point.
    Empty { place: CurvePlace },
    /// A curve leaves the domain.
    Outside { place: CurvePlace, at: Parameter },
    /// Two curves meet where they should not.
    Meet { places: [CurvePlace; 2], at: Parameter },
    /// A curve turns back on itself.
    Cusp { place: CurvePlace, at: Parameter },
    /// Too many arcs would be needed to tell the loops apart.
    Entangled { arcs: usize },
    /// An inner loop is not inside the outer one.
    NotInside { inner: usize },
    /// An inner loop is inside another inner loop.
    Nested { inner: usize, other: usize },
}

#[derive(Clone, Debug, PartialEq)]
struct Piece {
    arc: Arc,
    place: CurvePlace,
}

/// Loops with the region on their left: the outer one counterclockwise, inner ones clockwise.
#[derive(Clone, Debug)]
pub(crate) struct Region {
    loops: Vec<Vec<Arc>>,
    domain: [Parameter; 2],
    /// The boxes of all arcs, loop by loop, and their chords.
    boxes: Boxes,
    rays: Rays,
    /// How far points were moved to close gaps or to stay in the domain, at most, in u and in v.
    pub(crate) moved: [f64; 2],
}

/// Moves a coordinate onto an end of the interval if it is as near.
fn snapped(x: f64, low: f64, high: f64, near: f64) -> f64 {
    if (x - low).abs() <= near {
        low
    } else if (x - high).abs() <= near {
        high
    } else {
        x
    }
}

/// Loops in the making.
struct Builder {
    domain: [Parameter; 2],
    width: [f64; 2],
    pieces: Vec<Piece>,
    /// Where each loop begins, and the end of the last.
    starts: Vec<usize>,
    moved: [f64; 2],
}

impl Region {
    /// The region between the first loop, or the domain's border where there is none, and the other loops; each curve is
    /// a chain of arcs. `domain` is [low, high].
    pub(crate) fn new(domain: [Parameter; 2], outer: Option<Vec<Vec<Arc>>>, inner: Vec<Vec<Vec<Arc>>>) -> Result<Self, RegionFault> {
        let width = [domain[1][0] - domain[0][0], domain[1][1] - domain[0][1]];
        let mut builder = Builder { domain, width, pieces: Vec::new(), starts: vec![0], moved: [0.0; 2] };
        builder.add(None, outer.unwrap_or_else(|| border(domain)))?;
        for (index, curves) in inner.into_iter().enumerate() {
            builder.add(Some(index), curves)?;
        }
        builder.separate()?;
        let Builder { pieces, starts, moved, .. } = builder;
        let mut loops: Vec<Vec<Arc>> =
            starts.windows(2).map(|pair| pieces[pair[0]..pair[1]].iter().map(|piece| piece.arc.clone()).collect()).collect();
        for (index, arcs) in loops.iter_mut().enumerate() {
            if (area(arcs) > 0.0) != (index == 0) {
                arcs.reverse();
                arcs.iter_mut().for_each(Arc::reverse);
            }
        }
        let chords = loops.iter().enumerate().flat_map(|(index, arcs)| arcs.iter().map(move |arc| ([arc.start(), arc.end()], index)));
        let rays = Rays::new(chords.collect());
        nesting(&loops, &rays)?;
        let boxes = Boxes::new(loops.iter().flatten().map(Arc::bounds).collect());
        Ok(Self { loops, domain, boxes, rays, moved })
    }

    /// Arcs whose boxes meet a rectangle.
    pub(super) fn arcs_near(&self, bounds: [Parameter; 2]) -> impl Iterator<Item = Arc> {
        let mut found = Vec::new();
        self.boxes.near(&bounds, &mut |index| found.push(index));
        found.sort_unstable();
        let mut ends = Vec::with_capacity(self.loops.len());
        self.loops.iter().for_each(|arcs| ends.push(ends.last().copied().unwrap_or(0) + arcs.len()));
        found.into_iter().map(move |index| {
            let own = ends.partition_point(|&end| end <= index);
            let first = own.checked_sub(1).map_or(0, |before| ends[before]);
            self.loops[own][index - first].clone()
        })
    }

    /// Whether a point that is on no loop is inside. Rays cross an arc as often as its chord, up to an even number, unless
    /// the point is in the hull of the arc: there the arc is halved.
    pub(super) fn holds(&self, point: Parameter) -> bool {
        let mut inside = self.rays.inside(point);
        for arc in self.arcs_near([point, point]) {
            inside ^= crosses_chord(&arc, point) ^ crosses(&arc, point, 64);
        }
        inside
    }

    /// The polygons of the loops, (u, v) measured in units of `scale`, whose arcs are within `sagitta` of their chords;
    /// `None` when they have more than `most` corners. Cost: linear in their number.
    pub(super) fn polygons(&self, scale: [f64; 2], sagitta: f64, most: usize) -> Option<Vec<Vec<Parameter>>> {
        let mut left = most;
        let mut stack = Vec::new();
        let mut polygons = Vec::with_capacity(self.loops.len());
        for arcs in &self.loops {
            let mut corners: Vec<Parameter> = Vec::with_capacity(arcs.len());
            for arc in arcs {
                stack.push(arc.clone());
                while let Some(arc) = stack.pop() {
                    if arc.sagitta(scale) <= sagitta {
                        left = left.checked_sub(1)?;
                        let corner = self.inside(arc.start());
                        if corners.last() != Some(&corner) {
                            corners.push(corner);
                        }
                        continue;
                    }
                    let [first, second] = arc.halves();
                    stack.extend([second, first]);
                    if stack.len() > 4096 {
                        return None;
                    }
                }
            }
            if corners.len() > 1 && corners.first() == corners.last() {
                corners.pop();
            }
            polygons.push(corners);
        }
        Some(polygons)
    }

    /// The point of the domain that is meant: onto the border where rounding misses it, and never beyond.
    fn inside(&self, point: Parameter) -> Parameter {
        let [low, high] = self.domain;
        std::array::from_fn(|k| {
            let near = 1e-12 * (high[k] - low[k]);
            let x = snapped(point[k].clamp(low[k], high[k]), low[k], high[k], near);
            // Neither negative zero nor numbers whose squares vanish.
            if x.abs() < 1e-60 * (high[k] - low[k]) { 0.0 } else { x }
        })
    }
}

/// The border of a domain, counterclockwise.
fn border([low, high]: [Parameter; 2]) -> Vec<Vec<Arc>> {
    let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
    (0..4).map(|k| vec![Arc::segment(corners[k], corners[(k + 1) % 4])]).collect()
}

/// Twice the area inside the polygon of chords.
fn area(arcs: &[Arc]) -> f64 {
    let origin = arcs.first().map_or([0.0; 2], Arc::start);
    let seen = |p: Parameter| [p[0] - origin[0], p[1] - origin[1]];
    arcs.iter().map(|arc| cross(seen(arc.start()), seen(arc.end()))).sum()
}

/// Whether the ray from a point towards larger u crosses a chord.
fn crosses_chord(arc: &Arc, point: Parameter) -> bool {
    crosses_segment([arc.start(), arc.end()], point)
}

/// Whether that ray crosses an arc an odd number of times.
fn crosses(arc: &Arc, point: Parameter, depth: u32) -> bool {
    let [low, high] = arc.bounds();
    if depth == 0 || arc.is_straight() || (0..2).any(|k| point[k] < low[k] || point[k] > high[k]) {
        return crosses_chord(arc, point);
    }
    let [first, second] = arc.halves();
    crosses(&first, point, depth - 1) ^ crosses(&second, point, depth - 1)
}

/// Every inner loop is inside the outer one and no other. A point of a loop is outside the hulls of all arcs of other
/// loops, so that the polygons of chords go around it as often as the loops.
fn nesting(loops: &[Vec<Arc>], rays: &Rays) -> Result<(), RegionFault> {
    for (index, arcs) in loops.iter().enumerate().skip(1) {
        let Some(arc) = arcs.first() else { continue };
        let mut crossed: Vec<usize> = rays.crossed(arc.start()).filter(|&other| other != index).collect();
        crossed.sort_unstable();
        let mut around = crossed.chunk_by(|a, b| a == b).filter(|run| run.len() % 2 == 1).map(|run| run[0]);
        if around.next() != Some(0) {
            return Err(RegionFault::NotInside { inner: index - 1 });
        }
        if let Some(other) = around.next() {
            return Err(RegionFault::Nested { inner: index - 1, other: other - 1 });
        }
    }
    Ok(())
}

impl Builder {
    /// Adds a loop, its gaps closed and its points near the border on it.
    fn add(&mut self, inner: Option<usize>, curves: Vec<Vec<Arc>>) -> Result<(), RegionFault> {
        let first = self.pieces.len();
        let place = |curve| CurvePlace { inner, curve };
        let [low, high] = self.domain;
        let width = self.width;
        for (curve, arcs) in curves.into_iter().enumerate() {
            for mut arc in arcs {
                let moved = &mut self.moved;
                arc.map(|p| {
                    std::array::from_fn(|k| {
                        let x = snapped(p[k], low[k], high[k], SNAP * width[k]);
                        moved[k] = moved[k].max((x - p[k]).abs());
                        x
                    })
                });
                let end = arc.end();
                if arc.control_points().all(|point| point == end) {
                    continue;
                }
                self.pieces.push(Piece { arc, place: place(curve) });
            }
        }
        if self.pieces.len() == first {
            return Err(RegionFault::Empty { place: place(0) });
        }
        let count = self.pieces.len() - first;
        for index in 0..count {
            let end = self.pieces[first + (index + count - 1) % count].arc.end();
            let Piece { arc, place } = &mut self.pieces[first + index];
            let start = arc.start();
            for k in 0..2 {
                let gap = (end[k] - start[k]).abs();
                if gap > GAP * width[k] || gap.is_nan() {
                    return Err(RegionFault::Open { place: *place, end, start });
                }
                self.moved[k] = self.moved[k].max(gap);
            }
            arc.start_at(end);
        }
        self.pieces.retain(|piece| piece.place.inner != inner || piece.arc.control_points().any(|point| point != piece.arc.end()));
        if self.pieces.len() == first {
            return Err(RegionFault::Empty { place: place(0) });
        }
        self.starts.push(self.pieces.len());
        Ok(())
    }

    fn size(&self, piece: usize) -> f64 {
        let [low, high] = self.pieces[piece].arc.bounds();
        ((high[0] - low[0]) / self.width[0]).max((high[1] - low[1]) / self.width[1])
    }

    fn at(&self, piece: usize) -> Parameter {
        self.pieces[piece].arc.start()
    }

    /// Halves arcs until the loops are proven simple.
    fn separate(&mut self) -> Result<(), RegionFault> {
        let most = (ARCS_PER_ARC * self.pieces.len()).max(LEAST_ARCS);
        for _ in 0..ROUNDS {
            let mut halve = vec![false; self.pieces.len()];
            self.own(&mut halve)?;
            self.neighbours(&mut halve)?;
            self.others(&mut halve)?;
            if !halve.contains(&true) {
                return Ok(());
            }
            let mut pieces = Vec::with_capacity(2 * self.pieces.len());
            let mut starts = vec![0];
            for pair in self.starts.windows(2) {
                for (piece, halve) in self.pieces[pair[0]..pair[1]].iter().zip(&halve[pair[0]..pair[1]]) {
                    let Piece { arc, place } = piece;
                    if *halve {
                        pieces.extend(arc.halves().map(|arc| Piece { arc, place: *place }));
                    } else {
                        pieces.push(piece.clone());
                    }
                }
                starts.push(pieces.len());
            }
            (self.pieces, self.starts) = (pieces, starts);
            if self.pieces.len() > most {
                break;
            }
        }
        Err(RegionFault::Entangled { arcs: self.pieces.len() })
    }

    /// Each arc alone: in the domain, and of one direction.
    fn own(&mut self, halve: &mut [bool]) -> Result<(), RegionFault> {
        let [low, high] = self.domain;
        let width = self.width;
        let beyond = |p: Parameter| (0..2).map(|k| (low[k] - p[k]).max(p[k] - high[k]) / width[k]).fold(0.0, f64::max);
        for (index, halve) in halve.iter_mut().enumerate() {
            let arc = &self.pieces[index].arc;
            let over = arc.control_points().map(beyond).fold(0.0, f64::max);
            let ends = beyond(arc.start()).max(beyond(arc.end()));
            if ends > GAP {
                let at = if beyond(arc.start()) > GAP { arc.start() } else { arc.end() };
                return Err(RegionFault::Outside { place: self.pieces[index].place, at });
            }
            if over > SNAP && (over > GAP || ends <= SNAP) {
                if self.size(index) <= RESOLUTION {
                    return Err(RegionFault::Outside { place: self.pieces[index].place, at: self.at(index) });
                }
                *halve = true;
            } else {
                (0..2).for_each(|k| self.moved[k] = self.moved[k].max(over * width[k]));
            }
            if self.pieces[index].arc.directions().is_none() {
                if self.size(index) <= RESOLUTION {
                    return Err(RegionFault::Cusp { place: self.pieces[index].place, at: self.at(index) });
                }
                *halve = true;
            }
        }
        Ok(())
    }

    /// Each arc and the next.
    fn neighbours(&self, halve: &mut [bool]) -> Result<(), RegionFault> {
        for pair in self.starts.windows(2) {
            let (first, count) = (pair[0], pair[1] - pair[0]);
            for index in 0..count {
                let (own, next) = (first + index, first + (index + 1) % count);
                if count < 3 {
                    halve[own] = true;
                    continue;
                }
                let (Some(a), Some(b)) = (self.pieces[own].arc.directions(), self.pieces[next].arc.directions()) else { continue };
                if a.turns_back(&b) {
                    let straight = self.pieces[own].arc.is_straight() && self.pieces[next].arc.is_straight();
                    if straight || self.size(own).max(self.size(next)) <= RESOLUTION {
                        return Err(RegionFault::Cusp { place: self.pieces[next].place, at: self.at(next) });
                    }
                    (halve[own], halve[next]) = (true, true);
                }
            }
        }
        Ok(())
    }

    /// All other pairs.
    fn others(&self, halve: &mut [bool]) -> Result<(), RegionFault> {
        let gap = ROUNDING * self.domain.iter().flatten().fold(self.width[0].max(self.width[1]), |most, x| most.max(x.abs()));
        let mut after = vec![0; self.pieces.len()];
        for pair in self.starts.windows(2) {
            (pair[0]..pair[1]).for_each(|index| after[index] = if index + 1 == pair[1] { pair[0] } else { index + 1 });
        }
        let tree = Boxes::new(self.pieces.iter().map(|piece| piece.arc.bounds()).collect());
        let mut fault = None;
        tree.pairs(gap, &mut |a, b| {
            if fault.is_some() || after[a] == b || after[b] == a || self.pieces[a].arc.is_apart(&self.pieces[b].arc, gap) {
                return fault.is_none();
            }
            let straight = self.pieces[a].arc.is_straight() && self.pieces[b].arc.is_straight();
            let sizes = [self.size(a), self.size(b)];
            if straight || sizes[0].max(sizes[1]) <= RESOLUTION {
                fault = Some(RegionFault::Meet { places: [self.pieces[a].place, self.pieces[b].place], at: self.at(a) });
                return false;
            }
            // The larger one, or both when alike; a segment is one already.
            halve[a] |= sizes[0] >= 0.5 * sizes[1];
            halve[b] |= sizes[1] >= 0.5 * sizes[0];
            true
        });
        fault.map_or(Ok(()), Err)
    }
}
