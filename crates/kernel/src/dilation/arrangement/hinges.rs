//! Where polygons meet along their sides, their dilations are cut: what balls around a common side add lies in that of one of them.
//!
//! Let n_k be the unit vectors in the plane of a polygon S_i out of its sides, and let all figures have an order. The dilations of S_i by t up to T may be cut by the half-space H_k: (x - p) . n_k <= c_k, with p on side k, if
//!
//! * every point of the side is in a figure that comes earlier and has the same radius, and
//! * c_k >= T max(0, n_m . n_k) for all other sides m.
//!
//! Then D_t(S) is the union of what is left of the D_t(S_i). For let x be in it, q a point of S that is nearest to x, as the radii have it, and S_j the first of the figures with that radius that q is in: x is in D_t(S_j), and q its closest point. Were x beyond a plane that this is cut by, that of side k,
//! then q would be on this side: x - q is in the cone of the normals at q, so elsewhere it is, along n_k, a part of |x - q| <= T that is no more than the largest n_m . n_k (at a corner, n_k is not between the normals of both its sides), and q is no higher along n_k than the side.
//! But what is on the side is in an earlier figure, and S_j is the first. Where q is in no polygon, `joints` tells the same of segments. Sides are common up to a share of the slack that all bounds leave for rounding.
//!
//! So of all polygons around a side one is round there, and where they go on in a plane, what is round is within the next. The bounds of the union, and those of its topology, hold for bodies that are cut as for whole ones.

use super::figure::{Figure, Polygon};
use super::joints;
use super::polytopes::Shell;
use crate::attractor::cell::{Point, closest_on_segment, distance_squared, dot, subtract, unit};
use crate::budget::{Budget, Stopped};
use crate::solid::box_tree::{Box32, BoxTree};
use rayon::prelude::*;

/// How far out a cut is at most, in units of the outer radius: beyond that it saves little.
const FARTHEST: f64 = 0.7;
/// Sides near one that are looked at to cover it: with others it might be cut, too.
const MOST_SIDES: usize = 256;

/// A side of a polygon.
struct Side {
    figure: u32,
    place: u32,
    ends: [Point; 2],
}

/// How far beyond its sides every polygon may be cut, in their order; none where it is not, and nothing of other figures. Sides are common within `flatness`.
///
/// # Errors
/// [`Stopped`].
pub(super) fn cuts(
    figures: &[Figure],
    flatness: f64,
    shell: impl Fn(&Figure) -> Shell + Sync,
    budget: &Budget,
) -> Result<Vec<Box<[Option<f64>]>>, Stopped> {
    let mut sides = Vec::new();
    for (figure, polygon) in (0..).zip(figures).filter_map(|(index, figure)| figure.polygon().map(|polygon| (index, polygon))) {
        sides.extend((0..).zip(polygon.sides()).map(|(place, ends)| Side { figure, place, ends }));
    }
    // Long sides cover short ones: polygons with long ones come first.
    let mut longest = vec![0.0_f64; figures.len()];
    for side in &sides {
        let length = &mut longest[side.figure as usize];
        *length = length.max(distance_squared(&side.ends[0], &side.ends[1]));
    }
    let is_earlier = |one: u32, other: u32| {
        let [own, theirs] = [one, other].map(|figure| longest[figure as usize]);
        own > theirs || (own == theirs && one < other)
    };
    let mut tree = BoxTree::default();
    let boxes: Vec<Box32> = sides.iter().map(|side| Box32::of(&side.ends)).collect();
    tree.build(boxes.len(), |index| Some(boxes[index as usize]), true);
    let cut = |(index, side): (usize, &Side)| -> Result<Option<f64>, Stopped> {
        budget.cancel.check()?;
        let figure = &figures[side.figure as usize];
        let Some(polygon) = figure.polygon().filter(|polygon| !polygon.is_needle()) else { return Ok(None) };
        let shell = shell(figure);
        let least = shell.outer * polygon.widest(side.place as usize);
        if least > FARTHEST * shell.outer {
            return Ok(None);
        }
        let (mut covered, mut looked) = (Vec::new(), 0);
        tree.query(&boxes[index], 0, |leaf| {
            for (&item, theirs) in tree.items(leaf).iter().zip(tree.boxes(leaf)) {
                let other = &sides[item as usize];
                if !boxes[index].meets(theirs) {
                    continue;
                }
                looked += 1;
                if is_earlier(other.figure, side.figure) && figures[other.figure as usize].deficit.to_bits() == figure.deficit.to_bits() {
                    covered.extend(common(&side.ends, &other.ends, flatness));
                }
            }
            looked < MOST_SIDES
        });
        let seed = u64::from(side.figure) << 8 | u64::from(side.place);
        Ok(is_whole(&mut covered).then(|| least + joints::shift(shell, seed)))
    };
    let cut: Vec<Option<f64>> = sides.par_iter().enumerate().map(|(index, side)| cut((index, side))).collect::<Result<_, Stopped>>()?;
    let mut cut = cut.into_iter();
    Ok(figures.iter().map(|figure| cut.by_ref().take(figure.polygon().map_or(0, |polygon| polygon.corners.len())).collect()).collect())
}

impl Polygon {
    /// max(0, n_m . n_k) over all other sides m.
    fn widest(&self, place: usize) -> f64 {
        let along: Vec<Point> = self.sides().map(|[from, to]| unit(&subtract(&to, &from))).collect();
        // Normals are turned as the sides are.
        let others = along.iter().enumerate().filter(|&(side, _)| side != place);
        others.map(|(_, other)| dot(other, &along[place])).fold(0.0, f64::max)
    }
}

/// What a segment has in common with another within `flatness`, as shares of its length: the ends of both that are on the other.
fn common(side: &[Point; 2], other: &[Point; 2], flatness: f64) -> Option<[f64; 2]> {
    let along = subtract(&side[1], &side[0]);
    let square = dot(&along, &along);
    let is_on = |x: &Point, [a, b]: &[Point; 2]| distance_squared(x, &closest_on_segment(x, a, b)) <= flatness * flatness;
    let own = side.iter().filter(|end| is_on(end, other));
    let places = own.chain(other.iter().filter(|end| is_on(end, side))).map(|x| dot(&subtract(x, &side[0]), &along) / square);
    let [low, high] = places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| [at.min(low), at.max(high)]);
    (low < high).then_some([low, high])
}

/// Whether intervals cover all from 0 to 1, up to rounding.
fn is_whole(covered: &mut [[f64; 2]]) -> bool {
    covered.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let mut reached = 0.0;
    for [from, to] in covered {
        if *from > reached + ROUNDING {
            return false;
        }
        reached = f64::max(reached, *to);
    }
    reached >= 1.0 - ROUNDING
}

/// See [`is_whole`]: far below what bounds leave for rounding.
const ROUNDING: f64 = 1e-15;

#[cfg(test)]
mod tests {
    use super::super::joints::planes;
    use super::super::polytopes::{Plane, height};
    use super::*;
    use crate::attractor::cell::Site;
    use crate::dilation::convex::Convex;
    use crate::dilation::tree::Weighted;
    use crate::split_mix::Random;

    /// Balls around polygons that have sides in common, whole or in part, are covered by what is left of each one's own.
    #[test]
    fn what_is_cut_off_is_in_others() {
        let mut random = Random(29);
        let mut unit = move || random.share();
        let (mut cut, mut wide, mut beyond) = (0, 0, 0);
        for round in 0..150 {
            // A folded strip of triangles, some of them obtuse, a fan around its end, and sides that are halves of another.
            let folds = [0.0, 0.4, 1.5][round % 3];
            let mut at = |k: usize| -> Point { [0.6 * k as f64, 1.3 * (k % 2) as f64 + 0.3 * unit(), folds * unit()] };
            let spine: Vec<Point> = (0..7).map(&mut at).collect();
            let mut triangles: Vec<[Point; 3]> = spine.windows(3).map(|three| [three[0], three[1], three[2]]).collect();
            for _ in 0..2 {
                triangles.push([spine[5], spine[6], [4.5 + unit(), 2.0 * unit() - 0.5, 2.0 * unit() - 1.0]]);
            }
            let [a, b] = [spine[0], spine[1]];
            let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])];
            let out = [-1.0 - unit(), unit(), unit() - 0.5];
            triangles.extend([[a, middle, out], [middle, b, out]]);
            let deficit = |k: usize| if round % 5 == 4 { 0.1 * (k % 2) as f64 } else { 0.0 };
            let weighted =
                triangles.iter().enumerate().map(|(k, corners)| Weighted { site: Site::Triangle(*corners), deficit: deficit(k) });
            let figures: Vec<Figure> = weighted.map(Figure::from).collect();
            let shell = |figure: &Figure| Shell { inner: figure.in_space(0.9), outer: figure.in_space(1.1) };
            let cuts = cuts(&figures, 1e-12, shell, &Budget::default()).unwrap();
            let planes: Vec<_> = figures.iter().zip(&cuts).map(|(figure, cuts)| planes(figure, cuts)).collect();
            cut += planes.iter().map(|planes| planes.len()).sum::<usize>();
            wide += cuts.iter().flatten().flatten().filter(|&&cut| cut > 0.05).count();
            for _ in 0..400 {
                let x: Point = [7.0 * unit() - 2.5, 4.0 * unit() - 1.5, 4.0 * unit() - 2.0];
                let nearest = figures.iter().map(|figure| figure.distance_squared(&x)).fold(f64::INFINITY, f64::min);
                let is_near = |figure: &Figure| figure.distance_squared(&x) <= nearest * (1.0 + 1e-12);
                let is_kept = |planes: &[Plane]| planes.iter().all(|plane| height(plane, &x) <= 0.0);
                beyond += usize::from(figures.iter().zip(&planes).any(|(figure, planes)| is_near(figure) && !is_kept(planes)));
                let mut holds = figures.iter().zip(&planes).filter(|(figure, planes)| is_near(figure) && is_kept(planes));
                assert!(nearest > 1.1 * 1.1 || holds.next().is_some(), "{round}: {x:?}");
            }
        }
        assert!(cut > 500 && wide > 50 && beyond > 500, "{cut} cut, {wide} of them wide, {beyond} places beyond");
    }
}
