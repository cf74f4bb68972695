//! Surfaces of affine maps as graphs.
//!
//! Let all maps be (p, z) -> (A p + b, c . p + d z + e), p in a plane, and the images of a convex polygon Q under p -> A p + b be tiles: their sides cancel but for those around Q, so that they fill it and overlap nowhere. Let heights of corners agree where tiles meet, and the curves above
//! the sides that two tiles share. The map of functions f over Q that takes f to the function whose graph is the union of the images of that of f then keeps those that are continuous and have, above the sides of Q, the heights that the maps give these; and it contracts, as |d| < 1. So there is one
//! continuous f whose graph is the attractor (Massopust, "Fractal functions and their applications", Chaos, Solitons and Fractals 8, 1997).
//!
//! *Sides.* Let h_k be the heights above side k of Q, in its parameter t: above a part of the side that a tile has, h_k is c . p + d h_l + e for a side l of Q. So 1, t, the h_k(t) and the h_k(1 - t) are carried into combinations of each other by each part of [0, 1]. A combination vanishes if it does at the ends, and all into
//! which it is carried do: at the ends of all parts it is 0 then, and these are dense. There are at most as many independent ones as there are functions.

use super::outline::{are_same, double_area, is_wide, outline, pairs, sides};
use super::{Base, Graph, Kind, MISS, MOST_CORNERS, Part, Place};
use crate::attractor::enclosure::Enclosure;
use crate::attractor::{Attractor, Root, extremes};
use crate::automaton::{StateId, Transition};
use glam::{DMat2, DMat3, DVec2, DVec3};

/// Maps at most: each side of a tile is held against all.
const MOST_MAPS: usize = 1_024;
/// Corners at most of what is to become the polygon.
const MOST_ON_HULL: usize = 64;
/// Steps towards the polygon, and towards heights of its corners.
const STEPS: usize = 1_000;
const STEPS_UP: usize = 20_000;
/// How often bounds of heights are made closer.
const ROUNDS: usize = 200;
/// What is no farther is the same, in units of the polygon.
const SAME: f64 = 1e-14;
/// The polygon is no sliver: twice its area, over the square of its longest side.
const SLIVER: f64 = 1e-6;
/// What areas of tiles may miss of the polygon's.
const AREA: f64 = 1e-6;
/// Maps contract by more than this, in the plane and above it: what places and heights miss adds up.
const LEAST_CONTRACTION: f64 = 0.99;

/// A map: of the plane, and of heights above it.
struct Map {
    linear: DMat2,
    shift: DVec2,
    /// c, d and e.
    slopes: DVec2,
    scaling: f64,
    lift: f64,
}

impl Map {
    fn place(&self, at: DVec2) -> DVec2 {
        self.linear * at + self.shift
    }

    /// By how much lengths in the plane, seen so that a matrix of squares is that of a circle, and differences of heights are multiplied at most.
    fn norm(&self, squares: DMat2) -> f64 {
        // The larger eigenvalue.
        let square = squares.inverse() * self.linear * squares * self.linear.transpose();
        let middle = 0.5 * (square.x_axis.x + square.y_axis.y);
        let root = (middle * middle - square.determinant()).max(0.0).sqrt();
        (middle + root).sqrt().max(self.scaling.abs())
    }

    /// What is added to d z.
    fn height(&self, at: DVec2) -> f64 {
        self.slopes.dot(at) + self.lift
    }
}

/// A part of a side of the polygon, from a share of it on: the tile that it is a side of, which of the tile's, and whether that leads the other way.
struct Piece {
    from: f64,
    tile: usize,
    side: usize,
    is_back: bool,
}

/// What an attractor of affine maps is the graph of; none where it is none, or not known to be one.
pub(super) fn graph(attractor: &Attractor, extent: f64) -> Option<Graph> {
    let [root] = attractor.roots() else { return None };
    let state = attractor.automaton().state(root.state);
    let is_own = state.transitions.iter().all(|transition| transition.to == root.state);
    if !state.frame || root.rational || !is_own || !(2..=MOST_MAPS).contains(&state.transitions.len()) {
        return None;
    }
    [2, 1, 0].into_iter().find_map(|up| along(attractor, root, [(up + 1) % 3, (up + 2) % 3, up], extent))
}

/// The same, with given axes.
fn along(attractor: &Attractor, root: &Root, axes: [usize; 3], extent: f64) -> Option<Graph> {
    let point = |k: usize| DVec3::from_array(axes.map(|axis| root.points[k][axis]));
    let origin = point(0);
    let frame = DMat3::from_cols(point(1) - origin, point(2) - origin, point(3) - origin);
    let maps = maps(attractor, root.state, frame, extent)?;
    let polygon = polygon(&maps)?;
    // As it is, or stretched to be about as long as wide.
    let norm = |squares: DMat2| maps.iter().map(|map| map.norm(squares)).fold(0.0, f64::max);
    let contraction = norm(DMat2::IDENTITY).min(norm(squares(&polygon).1));
    if contraction > LEAST_CONTRACTION {
        return None;
    }
    let as_place = |at: DVec2| (at + origin.truncate()).to_array();
    let tile = |map: &Map| polygon.iter().map(|&corner| as_place(map.place(corner))).collect();
    let tiles: Vec<Vec<Place>> = maps.iter().map(tile).collect();
    tiles.iter().all(|tile| is_wide(tile, extent)).then_some(())?;
    let list: Vec<_> = tiles.iter().flat_map(|tile| sides(tile, extent)).collect();
    let (pairs, open) = pairs(&list);
    let area = tiles.iter().map(|tile| double_area(tile).abs()).sum();
    let (corners, missed) = outline(&list, open.clone(), area, extent)?;
    let mut tiling = Tiling { maps: &maps, polygon: &polygon, tiles: &tiles, scale: extent, heights: Vec::new() };
    let own: Vec<Place> = polygon.iter().map(|&corner| as_place(corner)).collect();
    let is_polygon = corners.len() == own.len() && own.iter().all(|&a| corners.iter().any(|&b| are_same(a, b, extent)));
    if !is_polygon || !tiling.find_heights(&own)? || !tiling.is_continuous(&own, &pairs, &open)? {
        return None;
    }
    let inverse = frame.inverse();
    let barycentric = |at: DVec3| {
        let [x, y, z] = (inverse * at).to_array();
        vec![1.0 - (x + y + z), x, y, z]
    };
    // Over each corner, and so over all of the polygon, between two planes.
    let slope = tiling.slope();
    let [low, high] = tiling.beside(slope);
    let up = inverse * (0.5 * (high - low) * DVec3::Z);
    let segment = |corner: &DVec2| {
        let middle = barycentric(corner.extend(slope.dot(*corner) + 0.5 * (low + high)));
        [middle, vec![-(up.x + up.y + up.z), up.x, up.y, up.z]]
    };
    let enclosure = Enclosure::of_segments(&polygon.iter().map(segment).collect::<Vec<_>>());
    let part = |transition: &Transition| {
        let operator = transition.operator.clone();
        let seen = operator.times(&enclosure.columns);
        Part { along: [Some(operator.clone()), Some(operator.clone())], kind: 0, seen, miss: 0.0, operator }
    };
    let parts = vec![attractor.automaton().state(root.state).transitions.iter().map(part).collect()];
    let at_corners = polygon.iter().map(|&corner| barycentric(corner.extend(0.0))).map(|corner| [corner.clone(), corner]).collect();
    let along_axis = |axis: usize| root.points.iter().map(|point| point[axes[axis]]).collect::<Vec<f64>>();
    let base =
        Base { kind: 0, heights: along_axis(2), shares: [along_axis(0), along_axis(1)], corner: [0.0; 2], sides: [[1.0, 0.0], [0.0, 1.0]] };
    // What misses by little in one step does by as much in each, on what is smaller.
    let off = missed / (1.0 - contraction);
    let kinds = vec![Kind { enclosure, corners: at_corners, parts }];
    Some(Graph { kinds, axes, corners, roots: vec![base], has_smooth_curves: false, off })
}

/// The maps in a plane and above it, seen from the frame's origin; none where one changes what is in the plane by the height.
fn maps(attractor: &Attractor, state: StateId, frame: DMat3, extent: f64) -> Option<Vec<Map>> {
    let volume = frame.determinant().abs();
    let is_flat = volume <= SLIVER * frame.col(0).length() * frame.col(1).length() * frame.col(2).length();
    if is_flat || !volume.is_finite() {
        return None;
    }
    let inverse = frame.inverse();
    let map = |transition: &Transition| {
        let entry = |row: usize, column: usize| transition.operator.entry(row + 1, column);
        let shift = DVec3::from_array([0, 1, 2].map(|row| entry(row, 0)));
        let column = |k: usize| DVec3::from_array([0, 1, 2].map(|row| entry(row, k + 1))) - shift;
        let linear = frame * DMat3::from_cols(column(0), column(1), column(2)) * inverse;
        let shift = frame * shift;
        let leans = linear.z_axis.truncate().abs().max_element();
        let plane = DMat2::from_cols(linear.x_axis.truncate(), linear.y_axis.truncate());
        let slopes = DVec2::new(linear.x_axis.z, linear.y_axis.z);
        let own = Map { linear: plane, shift: shift.truncate(), slopes, scaling: linear.z_axis.z, lift: shift.z };
        (leans <= MISS && own.scaling.abs() <= LEAST_CONTRACTION && shift.length() <= 4.0 * extent).then_some(own)
    };
    let maps: Vec<Map> = attractor.automaton().state(state).transitions.iter().map(map).collect::<Option<_>>()?;
    let area = maps.iter().map(|map| map.linear.determinant().abs()).sum::<f64>();
    ((area - 1.0).abs() <= AREA).then_some(maps)
}

/// The hull of the maps' attractor in the plane, counter-clockwise, if it has few corners: beginning with that of images of fixed points, the hull of all images of the one before, which holds that.
fn polygon(maps: &[Map]) -> Option<Vec<DVec2>> {
    let fixed: Vec<DVec2> = maps.iter().map(|map| (DMat2::IDENTITY - map.linear).inverse() * map.shift).collect();
    // Two maps have two of these, on a line.
    let images = maps.iter().flat_map(|map| fixed.iter().map(|&place| map.place(place)));
    let mut corners = hull(images.collect())?;
    for _ in 0..STEPS {
        let next = hull(maps.iter().flat_map(|map| corners.iter().map(|&corner| map.place(corner))).collect())?;
        if next.len() > MOST_ON_HULL {
            return None;
        }
        let size = next.iter().map(|corner| (*corner - next[0]).length()).fold(0.0, f64::max);
        let are_same = next.len() == corners.len() && next.iter().zip(&corners).all(|(a, b)| (*a - *b).length() <= SAME * size);
        corners = next;
        if are_same {
            let double = double_area(&corners.iter().map(DVec2::to_array).collect::<Vec<Place>>());
            return (corners.len() <= MOST_CORNERS && double > SLIVER * size * size).then_some(corners);
        }
    }
    None
}

/// The corners of the hull of some places, counter-clockwise: those that are nearly straight are left out. None of less than three.
fn hull(mut places: Vec<DVec2>) -> Option<Vec<DVec2>> {
    if places.iter().any(|place| !place.is_finite()) {
        return None;
    }
    // Sides along it are rare: places that are as far along are not in the order that they have on the hull.
    let along = DVec2::new(1.0, std::f64::consts::SQRT_2 - 1.0 / 3.0);
    places.sort_by(|a, b| a.dot(along).total_cmp(&b.dot(along)));
    let size = places.iter().map(|place| (*place - places[0]).length()).fold(0.0, f64::max);
    let near = 1e2 * SAME * size;
    let chain = |places: &mut dyn Iterator<Item = &DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for &place in places {
            while let [.., a, b] = chain[..] {
                let (way, on) = (place - a, b - a);
                // How far b is to the right of the way from a.
                let beside = way.y * on.x - way.x * on.y;
                if beside > near * way.length() {
                    break;
                }
                chain.pop();
            }
            if chain.last().is_none_or(|last| (place - *last).length() > near) {
                chain.push(place);
            }
        }
        chain
    };
    let (lower, upper) = (chain(&mut places.iter()), chain(&mut places.iter().rev()));
    let corners: Vec<DVec2> = [&lower[..lower.len().saturating_sub(1)], &upper[..upper.len().saturating_sub(1)]].concat();
    (corners.len() > 2).then_some(corners)
}

/// The middle of some places, and the matrix of the squares and products of what leads from there to each.
fn squares(places: &[DVec2]) -> (DVec2, DMat2) {
    let middle = places.iter().sum::<DVec2>() / places.len() as f64;
    let ways = places.iter().map(|place| *place - middle);
    (middle, ways.map(|way| DMat2::from_cols(way * way.x, way * way.y)).fold(DMat2::ZERO, |sum, own| sum + own))
}

/// The images of a polygon, which fill it.
struct Tiling<'a> {
    maps: &'a [Map],
    polygon: &'a [DVec2],
    tiles: &'a [Vec<Place>],
    scale: f64,
    /// Of the polygon's corners.
    heights: Vec<f64>,
}

impl Tiling<'_> {
    fn side(&self, side: usize) -> [DVec2; 2] {
        [self.polygon[side], self.polygon[(side + 1) % self.polygon.len()]]
    }

    /// The tile and the side of it that have a number.
    fn tile(&self, number: usize) -> (usize, usize) {
        (number / self.polygon.len(), number % self.polygon.len())
    }

    /// The height of a corner of a tile.
    fn image(&self, heights: &[f64], tile: usize, corner: usize) -> f64 {
        let map = &self.maps[tile];
        map.height(self.polygon[corner]) + map.scaling * heights[corner]
    }

    /// Finds the heights of the polygon's corners; false where those of tiles do not agree wherever they meet, none where they are not found.
    fn find_heights(&mut self, polygon: &[Place]) -> Option<bool> {
        let is_at = |a: Place, b: Place| are_same(a, b, self.scale);
        // Of each corner of the polygon a tile with a corner there, and which.
        let all = || self.tiles.iter().enumerate().flat_map(|(tile, corners)| (0..corners.len()).map(move |k| (tile, k, corners[k])));
        let owners: Vec<(usize, usize)> =
            polygon.iter().map(|&at| all().find(|own| is_at(own.2, at)).map(|own| (own.0, own.1))).collect::<Option<_>>()?;
        let mut heights = vec![0.0; polygon.len()];
        for step in 0.. {
            let next: Vec<f64> = owners.iter().map(|&(tile, corner)| self.image(&heights, tile, corner)).collect();
            let is_same = next.iter().zip(&heights).all(|(a, b)| (a - b).abs() <= SAME * self.scale);
            heights = next;
            if is_same {
                break;
            }
            (step < STEPS_UP).then_some(())?;
        }
        let mut known: Vec<(Place, f64)> = Vec::new();
        for (tile, corner, at) in all() {
            let height = self.image(&heights, tile, corner);
            match known.iter().find(|own| is_at(own.0, at)) {
                Some(own) if (own.1 - height).abs() > MISS * self.scale => return Some(false),
                Some(_) => {}
                None => known.push((at, height)),
            }
        }
        self.heights = heights;
        Some(true)
    }

    /// Whether heights agree along the sides that tiles share, given the polygon, which sides are the other way round of which, and which are alone; none where that is not told.
    fn is_continuous(&self, polygon: &[Place], pairs: &[[usize; 2]], open: &[usize]) -> Option<bool> {
        let sides = Sides { tiling: self, pieces: self.pieces(polygon, open)? };
        for [one, other] in pairs.iter().map(|pair| pair.map(|number| self.tile(number))) {
            // Both from where the first begins.
            let starts = [one, other].map(|(tile, side)| self.tiles[tile][side]);
            let mut difference = sides.above(one, false);
            let other = sides.above(other, !are_same(starts[0], starts[1], self.scale));
            difference.iter_mut().zip(other).for_each(|(own, other)| *own -= other);
            if !sides.vanishes(difference)? {
                return Some(false);
            }
        }
        Some(true)
    }

    /// The slope of a plane that is near to the heights of the polygon's corners.
    fn slope(&self) -> DVec2 {
        let (middle, squares) = squares(self.polygon);
        let height = self.heights.iter().sum::<f64>() / self.heights.len() as f64;
        let sum: DVec2 = self.polygon.iter().zip(&self.heights).map(|(corner, own)| (*corner - middle) * (own - height)).sum();
        squares.inverse() * sum
    }

    /// Between which heights above a plane through the origin the graph is: above each tile, these are affine and d times what they are above the polygon.
    fn beside(&self, slope: DVec2) -> [f64; 2] {
        let affine = |map: &Map| {
            let above = |&corner: &DVec2| map.height(corner) + map.scaling * slope.dot(corner) - slope.dot(map.place(corner));
            (extremes(self.polygon.iter().map(above)), map.scaling)
        };
        let affine: Vec<([f64; 2], f64)> = self.maps.iter().map(affine).collect();
        let largest = affine.iter().flat_map(|(own, _)| own).fold(0.0_f64, |most, own| most.max(own.abs()));
        let scaling = affine.iter().fold(0.0_f64, |most, own| most.max(own.1.abs()));
        let mut range = [-1.0, 1.0].map(|sign| sign * largest / (1.0 - scaling));
        for _ in 0..ROUNDS {
            let image = |([low, high], scaling): &([f64; 2], f64)| {
                let ends = extremes(range.iter().map(|height| scaling * height));
                [low + ends[0], high + ends[1]]
            };
            range = extremes(affine.iter().flat_map(image));
        }
        let more = MISS * self.scale / (1.0 - scaling);
        [range[0] - more, range[1] + more]
    }

    /// The parts of each side of the polygon, in their order.
    fn pieces(&self, polygon: &[Place], open: &[usize]) -> Option<Vec<Vec<Piece>>> {
        let count = polygon.len();
        let mut pieces: Vec<Vec<Piece>> = (0..count).map(|_| Vec::new()).collect();
        for (tile, side) in open.iter().map(|&number| self.tile(number)) {
            let ends = [side, (side + 1) % count].map(|corner| DVec2::from_array(self.tiles[tile][corner]));
            let on = |k: usize| {
                let [a, b] = [k, (k + 1) % count].map(|corner| DVec2::from_array(polygon[corner]));
                let way = b - a;
                let shares = ends.map(|end| (end - a).dot(way) / way.length_squared());
                let is_on = |end: DVec2| way.perp_dot(end - a).abs() <= 1e3 * MISS * self.scale * way.length();
                (ends.into_iter().all(is_on) && shares.iter().all(|share| (-1e-6..=1.0 + 1e-6).contains(share))).then_some((k, shares))
            };
            let (k, [from, to]) = (0..count).find_map(on)?;
            pieces[k].push(Piece { from: from.min(to), tile, side, is_back: to < from });
        }
        for own in &mut pieces {
            own.sort_by(|a, b| a.from.total_cmp(&b.from));
            (!own.is_empty()).then_some(())?;
        }
        Some(pieces)
    }
}

/// The heights above the sides of a polygon. Combinations are given by what they have of 1, of t, of each h_k(t), and of each h_k(1 - t); lengths are in units of the scale.
struct Sides<'a> {
    tiling: &'a Tiling<'a>,
    pieces: Vec<Vec<Piece>>,
}

impl Sides<'_> {
    fn count(&self) -> usize {
        self.tiling.heights.len()
    }

    /// The heights above a side of a tile, from its start or its end.
    fn above(&self, (tile, side): (usize, usize), is_back: bool) -> Vec<f64> {
        let (map, scale) = (&self.tiling.maps[tile], self.tiling.scale);
        let [start, end] = self.tiling.side(side).map(|at| map.height(at) / scale);
        let mut all = vec![0.0; 2 + 2 * self.count()];
        (all[0], all[1]) = if is_back { (end, start - end) } else { (start, end - start) };
        all[2 + side + if is_back { self.count() } else { 0 }] = map.scaling;
        all
    }

    /// The value of a combination at an end.
    fn at(&self, own: &[f64], is_end: bool) -> f64 {
        let count = self.count();
        let height = |corner: usize| self.tiling.heights[corner % count] / self.tiling.scale;
        let of_sides = (0..count).map(|k| {
            let [from, to] = if is_end { [k + 1, k] } else { [k, k + 1] };
            own[2 + k] * height(from) + own[2 + count + k] * height(to)
        });
        own[0] + f64::from(u8::from(is_end)) * own[1] + of_sides.sum::<f64>()
    }

    /// Whether a combination vanishes; none where the sides in it do not have parts at the same places, seen from either end.
    fn vanishes(&self, own: Vec<f64>) -> Option<bool> {
        // In echelon form: with the place of the largest entry, which is 1 there.
        let mut known: Vec<(usize, Vec<f64>)> = Vec::new();
        let mut open = vec![own];
        while let Some(mut own) = open.pop() {
            for (pivot, other) in &known {
                let share = own[*pivot];
                own.iter_mut().zip(other).for_each(|(entry, other)| *entry -= share * other);
            }
            let pivot = (0..own.len()).max_by(|&a, &b| own[a].abs().total_cmp(&own[b].abs()))?;
            let largest = own[pivot];
            if largest.abs() <= MISS {
                continue;
            }
            // All that is known was asked at this size, so that multiples of it may be.
            own.iter_mut().for_each(|entry| *entry /= largest);
            if [false, true].iter().any(|&is_end| self.at(&own, is_end).abs() > MISS) {
                return Some(false);
            }
            // Where nothing but 1 and t is in it, its ends have told.
            if own[2..].iter().any(|entry| entry.abs() > MISS) {
                open.extend(self.carried(&own)?);
            }
            known.push((pivot, own));
        }
        Some(true)
    }

    /// What a combination is in each part.
    fn carried(&self, own: &[f64]) -> Option<Vec<Vec<f64>>> {
        let count = self.count();
        let used: Vec<(usize, bool)> = (0..2 * count).filter(|&k| own[2 + k] != 0.0).map(|k| (k % count, k >= count)).collect();
        // Where the parts of a side begin, seen from its start or its end; and where the last one ends.
        let breaks = |&(side, is_back): &(usize, bool)| {
            let from = self.pieces[side].iter().map(|piece| piece.from).chain([1.0]);
            let mut all: Vec<f64> = from.map(|from| if is_back { 1.0 - from } else { from }).collect();
            if is_back {
                all.reverse();
            }
            all
        };
        let first = breaks(used.first()?);
        let length = |side: usize| {
            let [a, b] = self.tiling.side(side);
            (b - a).length()
        };
        let near = 64.0 * MISS * self.tiling.scale / (0..count).map(length).fold(f64::INFINITY, f64::min);
        let are_same = |other: &Vec<f64>| other.len() == first.len() && other.iter().zip(&first).all(|(a, b)| (a - b).abs() <= near);
        if !used.iter().map(breaks).all(|other| are_same(&other)) {
            return None;
        }
        let part = |number: usize| {
            let [from, to] = [first[number], first[number + 1]];
            let mut part = vec![0.0; own.len()];
            (part[0], part[1]) = (own[0] + from * own[1], (to - from) * own[1]);
            for &(side, is_back) in &used {
                let all = &self.pieces[side];
                let piece = if is_back { &all[all.len() - 1 - number] } else { &all[number] };
                let share = own[2 + side + if is_back { count } else { 0 }];
                let above = self.above((piece.tile, piece.side), piece.is_back != is_back);
                part.iter_mut().zip(above).for_each(|(entry, above)| *entry += share * above);
            }
            part
        };
        Some((0..first.len() - 1).map(part).collect())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::model::{AffineMap, Ifs, Model, Shape};
    use crate::split_mix::Random;

    pub(in crate::attractor::graph) fn lowered(maps: Vec<AffineMap>) -> Attractor {
        Model { name: None, shape: Shape::Ifs(Ifs { maps, primitive: None, graph: None }) }.lower().unwrap().attractor
    }

    /// The map of space that scales heights and takes each of three places, with heights, to another one.
    fn map_of(from: [DVec3; 3], to: [DVec3; 3], scaling: f64) -> AffineMap {
        let frame = |[a, b, c]: [DVec3; 3], up: f64| DMat3::from_cols(b - a, c - a, up * DVec3::Z);
        let linear = frame(to, scaling) * frame(from, 1.0).inverse();
        AffineMap { linear, translation: to[0] - linear * from[0] }
    }

    /// Over a square of some size, Takagi's function of x plus that of y.
    pub(in crate::attractor::graph) fn takagi(size: f64) -> Vec<AffineMap> {
        let map = |k: usize| {
            let [x, y] = [(k / 2) as f64, (k % 2) as f64];
            let linear = DMat3::from_diagonal(DVec3::splat(0.5)) + DMat3::from_cols(DVec3::Z, DVec3::ZERO, DVec3::ZERO) * (0.5 - x);
            let linear = linear + DMat3::from_cols(DVec3::ZERO, DVec3::Z, DVec3::ZERO) * (0.5 - y);
            AffineMap { linear, translation: 0.5 * size * DVec3::new(x, y, x + y) }
        };
        (0..4).map(map).collect()
    }

    /// Over a triangle, through given heights above the middles of its sides: each vertex of its four tiles belongs to one corner, so that all are carried there.
    pub(in crate::attractor::graph) fn triangle(scaling: f64) -> Vec<AffineMap> {
        let corners = [DVec3::new(-4.0, 1.0, 0.5), DVec3::new(9.0, 0.0, 2.0), DVec3::new(3.0, 8.0, -1.0)];
        let middle = |a: usize, b: usize, up: f64| 0.5 * (corners[a] + corners[b]) + up * DVec3::Z;
        let middles = [middle(1, 2, 3.0), middle(2, 0, -2.0), middle(0, 1, 2.5)];
        let mut maps = vec![map_of(corners, middles, scaling)];
        for k in 0..3 {
            let mut to = middles;
            to[k] = corners[k];
            maps.push(map_of(corners, to, scaling));
        }
        maps
    }

    /// Over a sheared rectangle of three tiles by two, every other one of which is mirrored.
    fn rows(scaling: f64) -> Vec<AffineMap> {
        let (along, across) = ([0.0, 3.0, 1.0, 2.0], [0.0, 2.0, -1.0]);
        let at = |i: usize, j: usize| {
            let [x, y] = [4.0 * i as f64, 3.0 * j as f64];
            DVec3::new(x + 0.4 * y, y, along[i] + across[j])
        };
        let whole = [at(0, 0), at(3, 0), at(0, 2)];
        let tile = |(i, j): (usize, usize)| {
            let [a, b] = if i % 2 == 0 { [i, i + 1] } else { [i + 1, i] };
            let [c, d] = if j % 2 == 0 { [j, j + 1] } else { [j + 1, j] };
            map_of(whole, [at(a, c), at(b, c), at(a, d)], scaling)
        };
        (0..3).flat_map(|i| (0..2).map(move |j| (i, j))).map(tile).collect()
    }

    #[test]
    fn surfaces_over_tiles_are_graphs() {
        let corners = |maps: Vec<AffineMap>| lowered(maps).graph().map(|graph| (graph.axes[2], graph.corners.len()));
        assert_eq!(corners(takagi(20.0)), Some((2, 4)));
        for scaling in [0.0, 0.3, -0.6, 0.8] {
            assert_eq!(corners(triangle(scaling)), Some((2, 3)), "{scaling}");
            assert_eq!(corners(rows(scaling)), Some((2, 4)), "{scaling}");
        }
    }

    /// Sides that lead straight up, on which places are only nearly below each other; and a right triangle of two halves.
    #[test]
    fn polygons_are_found_whichever_way_they_lie() {
        let tiled = |corners: [DVec3; 3]| {
            let middle = |a: usize, b: usize| 0.5 * (corners[a] + corners[b]) + 0.1 * DVec3::Z;
            let middles = [middle(1, 2), middle(2, 0), middle(0, 1)];
            let mut maps = vec![map_of(corners, middles, 0.4)];
            for k in 0..3 {
                let mut to = middles;
                to[k] = corners[k];
                maps.push(map_of(corners, to, 0.4));
            }
            lowered(maps).graph().map(|graph| graph.corners.len())
        };
        let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        assert_eq!(tiled([corner(0.0, 0.0), corner(8.0, 4.0), corner(0.0, 10.0)]), Some(3));
        assert_eq!(tiled([corner(0.0, 0.0), corner(0.1, 0.0), corner(0.0, 0.3)]), Some(3));
        let [a, b, c] = [corner(0.0, 0.0), corner(4.0, 0.0), corner(0.0, 4.0)];
        let top = 0.5 * (b + c) + DVec3::Z;
        let halves = [[top, a, b], [top, a, c]].map(|to| map_of([a, b, c], to, 0.3));
        assert_eq!(lowered(halves.to_vec()).graph().map(|graph| graph.corners.len()), Some(3));
    }

    /// With other axes up, and moved.
    #[test]
    fn surfaces_may_be_turned() {
        for turn in 0..3 {
            let turned = |map: AffineMap| {
                let axes = |k: usize| DVec3::AXES[(k + turn) % 3];
                let turn = DMat3::from_cols(axes(0), axes(1), axes(2));
                let (linear, shift) = (turn * map.linear * turn.transpose(), DVec3::new(3.0, -20.0, 7.0));
                AffineMap { linear, translation: turn * map.translation + shift - linear * shift }
            };
            let graph = lowered(triangle(0.5).into_iter().map(turned).collect()).graph().unwrap();
            assert_eq!((graph.axes[2], graph.corners.len()), ((2 + turn) % 3, 3));
        }
    }

    /// The height above a place: that of the place which some tile that has it is made of, and so on; which tile it is where there are several, chance tells.
    fn height(maps: &[Map], polygon: &[DVec2], mut at: DVec2, random: &mut Random) -> f64 {
        // How far inside the polygon a place is.
        let depth = |at: DVec2| {
            let sides = (0..polygon.len()).map(|k| {
                let (a, way) = (polygon[k], polygon[(k + 1) % polygon.len()] - polygon[k]);
                way.perp_dot(at - a) / way.length_squared()
            });
            sides.fold(f64::INFINITY, f64::min)
        };
        let (mut height, mut share) = (0.0, 1.0);
        for _ in 0..60 {
            let first = (random.share() * maps.len() as f64) as usize;
            let own = |k: usize| &maps[(first + k) % maps.len()];
            let from = |map: &Map| map.linear.inverse() * (at - map.shift);
            let depth = |map: &Map| depth(from(map)).min(-1e-12);
            // Of all that are as deep, the last one.
            let map = (0..maps.len()).map(own).max_by(|a, b| depth(a).total_cmp(&depth(b))).unwrap();
            at = from(map);
            height += share * map.height(at);
            share *= map.scaling;
        }
        height
    }

    /// Heights above places that two tiles share do not depend on which of them tells.
    #[test]
    fn heights_agree_where_tiles_meet() {
        let mut random = Random(5);
        for of_space in [takagi(20.0), triangle(0.7), rows(-0.5)] {
            let attractor = lowered(of_space);
            assert!(attractor.graph().is_some());
            let root = &attractor.roots()[0];
            let point = |k: usize| DVec3::from_array([0, 1, 2].map(|axis| root.points[k][axis]));
            let frame = DMat3::from_cols(point(1) - point(0), point(2) - point(0), point(3) - point(0));
            let maps = maps(&attractor, root.state, frame, 10.0).unwrap();
            let polygon = polygon(&maps).unwrap();
            let mut spread = 0.0_f64;
            for _ in 0..500 {
                let map = &maps[(random.share() * maps.len() as f64) as usize];
                let side = (random.share() * polygon.len() as f64) as usize;
                let at = polygon[side].lerp(polygon[(side + 1) % polygon.len()], random.share());
                let all: Vec<f64> = (0..6).map(|_| height(&maps, &polygon, map.place(at), &mut random)).collect();
                assert!(all.iter().all(|height| (height - all[0]).abs() < 1e-4), "{at}: {all:?}");
                spread = spread.max(all[0].abs());
            }
            assert!(spread > 1.0, "{spread}");
        }
    }

    #[test]
    fn what_is_torn_or_no_tiling_is_left() {
        let changed = |change: &dyn Fn(&mut Vec<AffineMap>)| {
            let mut maps = takagi(20.0);
            change(&mut maps);
            lowered(maps).graph().is_none()
        };
        assert!(!changed(&|_| {}));
        // Corners apart, by little; and sides between corners that agree.
        assert!(changed(&|maps| maps[1].translation.z += 1e-6));
        assert!(changed(&|maps| maps[1].linear.z_axis.z = 0.499_999));
        // Slopes that agree at two sides' ends alone.
        assert!(changed(&|maps| maps[0].linear.x_axis.z += 1e-6));
        // A gap, an overlap, one tile twice, and one that is not there.
        assert!(changed(&|maps| maps[2].linear.x_axis.x = 0.49));
        assert!(changed(&|maps| maps[2].linear.x_axis.x = 0.51));
        assert!(changed(&|maps| maps[3] = maps[2]));
        assert!(changed(&|maps| maps.truncate(3)));
        // Places that depend on heights.
        assert!(changed(&|maps| maps[0].linear.z_axis.x = 1e-6));
        // Four tiles of half the size, but for one that is made of four smaller ones: sides that have others beside them in parts.
        let mut parted = triangle(0.4);
        let last = parted.pop().unwrap();
        let small = triangle(0.4)
            .into_iter()
            .map(|map| AffineMap { linear: last.linear * map.linear, translation: last.linear * map.translation + last.translation });
        parted.extend(small);
        assert!(lowered(parted).graph().is_none());
        // Tiles that are too thin to be seen, above all others: the sides of both are each other's.
        let corners = [DVec3::new(-4.0, 1.0, 0.5), DVec3::new(9.0, 0.0, 2.0), DVec3::new(3.0, 8.0, -1.0)];
        for width in [1e-9, 1e-8, 2e-8, 1e-7] {
            let mut hidden = triangle(0.5);
            let [middle, beside] = [DVec3::new(1.5, 3.0, 12.0), DVec3::new(1.5, 3.0 + width, 12.0)];
            hidden.extend([0.0, 3.0].map(|x| map_of(corners, [DVec3::new(x, 3.0, 12.0), middle, beside], 0.0)));
            assert!(lowered(hidden).graph().is_none(), "{width}");
        }
        // Torn along a side, where the combination that tells it is met at a tiny scale first.
        for away in [0.0, 1e4, 1e5] {
            let at = |x: f64, y: f64, z: f64| DVec3::new(x + away, y, z);
            let corners = [at(-4.0, 1.0, 0.0), at(9.0, 0.0, 0.0), at(3.0, 8.0, 0.0)];
            let middle = |a: usize, b: usize, up: f64| 0.5 * (corners[a] + corners[b]) + up * DVec3::Z;
            let middles = [middle(1, 2, 0.5), middle(2, 0, 0.0), middle(0, 1, 0.0)];
            for small in [1e-6, 1e-5] {
                let maps = [
                    map_of(corners, [middles[1], middles[2], corners[0]], 0.9),
                    map_of(corners, [middles[0], corners[1], middles[2]], small),
                    map_of(corners, [corners[2], middles[1], middles[0]], 0.0),
                    map_of(corners, [middles[2], middles[0], middles[1]], 0.0),
                ];
                assert!(lowered(maps.to_vec()).graph().is_none(), "{away} {small}");
            }
        }
        // Corners agree, and sides do not: tiles that are turned the other way.
        let mut flipped = rows(0.5);
        flipped[0] = rows(-0.5)[0];
        assert!(lowered(flipped).graph().is_none());
    }
}
