//! Convex hulls of closest points: whether one stays clear of a ball, and its smallest enclosing ball.

use super::super::parting::parting;
use super::cells::Near;
use crate::attractor::cell::{Point, distance_squared, dot, subtract};

/// Points that are exchanged in the search for a ball.
const EXCHANGES: usize = 40;

/// A unit vector n with n.(y - a) > 0 for all y within h of x and all a within `wander` of the closest points: then no y is in the hull of
/// its closest points. When it is not found there may be a vector yet.
pub(super) fn separation(x: &Point, near: &[Near], h: f64) -> Option<Point> {
    let first = subtract(x, &near.first()?.closest);
    let ahead = |direction: &Point, near: &Near| dot(direction, &subtract(x, &near.closest));
    let lowest = |direction: &Point| {
        let lowest = near.iter().min_by(|a, b| ahead(direction, a).total_cmp(&ahead(direction, b)));
        lowest.map_or(first, |near| subtract(x, &near.closest))
    };
    let parts = |direction: &Point, _: &Point| {
        let length = dot(direction, direction).sqrt();
        let margin = near.iter().map(|near| ahead(direction, near) - near.wander * length).fold(f64::INFINITY, f64::min);
        margin > h * length * (1.0 + 1e-9)
    };
    let shortest = parting(first, h, lowest, parts)?;
    let length = dot(&shortest, &shortest).sqrt();
    Some(shortest.map(|x| x / length))
}

/// Points whose simplices are all looked at, at most.
const MOST_POINTS: usize = 9;
/// Squared sines below this do not determine a circumcentre.
const LEAST_PIVOT: f64 = 1e-4;
/// Errors of points, and relative errors of sides, are multiplied by no more than this on the way to circumcentres: the norm of the inverse of Gram's matrix of
/// three unit vectors is at most 9 over its smallest pivot, and the sums have few terms.
const GROWTH: f64 = 100.0 / LEAST_PIVOT;

/// A simplex of closest points that may hold its circumcentre.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Simplex {
    pub(super) figures: Vec<u32>,
    /// Whether it surely does, and all other points are farther: then the centre is a critical point, and not a degenerate one, of an index one less than
    /// the number of points.
    pub(super) certain: bool,
}

/// The simplices of points that may have a critical point within h of x; `None` where that cannot be told, as where one figure stands for many points.
///
/// A critical point is in the hull of its closest points, so, by Caratheodory's theorem, inside of a simplex of some of them. As it is equally far from
/// those, it is the circumcentre. For points in general position these are the critical simplices of the alpha complex.
pub(super) fn critical_simplices(x: &Point, near: &[Near], h: f64) -> Option<Vec<Simplex>> {
    if near.len() > MOST_POINTS || near.iter().any(|near| !near.single) {
        return None;
    }
    let error = near.iter().map(|near| near.error).fold(0.0, f64::max);
    let mut simplices = Vec::new();
    for subset in 1_u32..1 << near.len() {
        if !(2..=4).contains(&subset.count_ones()) {
            continue;
        }
        let corners: Vec<&Near> = near.iter().enumerate().filter(|(k, _)| subset >> k & 1 == 1).map(|(_, near)| near).collect();
        let points: Vec<Point> = corners.iter().map(|near| near.closest).collect();
        if is_obtuse(&points, error) {
            continue;
        }
        let (centre, weights) = circumcentre_with_weights(&points)?;
        let radius = distance_squared(&centre, &points[0]).sqrt();
        let shortest = (0..points.len()).flat_map(|a| (0..a).map(move |b| (a, b))).map(|(a, b)| distance_squared(&points[a], &points[b]));
        let shortest = shortest.fold(f64::INFINITY, f64::min).sqrt();
        // How far errors move the centre, and its weights.
        let moved = GROWTH * error * (1.0 + radius / shortest);
        let shifted = moved / shortest;
        if moved.is_nan() || moved > 1e-3 * h {
            return None;
        }
        if distance_squared(&centre, x).sqrt() > h * 1.001 || weights.iter().any(|&weight| weight < -shifted) {
            continue;
        }
        let others = near.iter().enumerate().filter(|(k, _)| subset >> k & 1 == 0).map(|(_, near)| near);
        let least = others.map(|near| distance_squared(&near.closest, &centre).sqrt()).fold(f64::INFINITY, f64::min);
        let margin = 2.0 * (moved + error);
        if least < radius - margin {
            continue;
        }
        let certain = least > radius + margin && weights.iter().all(|&weight| weight > shifted);
        simplices.push(Simplex { figures: corners.iter().map(|near| near.figure).collect(), certain });
    }
    Some(simplices)
}

/// Whether a triangle has an angle that is surely larger than a right one: its circumcentre is outside then.
fn is_obtuse(points: &[Point], error: f64) -> bool {
    points.len() == 3
        && (0..3).any(|k| {
            let (a, b) = (subtract(&points[(k + 1) % 3], &points[k]), subtract(&points[(k + 2) % 3], &points[k]));
            let lengths = dot(&a, &a).sqrt() + dot(&b, &b).sqrt() + 2.0 * error;
            dot(&a, &b) < -(4.0 * error + 1e-12 * lengths) * lengths
        })
}

/// The circumcentre and its barycentric weights, from the corner where the sides' directions tell most; `None` where none tells enough.
fn circumcentre_with_weights(points: &[Point]) -> Option<(Point, Vec<f64>)> {
    let from = |base: usize| {
        let others: Vec<usize> = (0..points.len()).filter(|&k| k != base).collect();
        let sides: Vec<Point> = others.iter().map(|&k| subtract(&points[k], &points[base])).collect();
        let lengths: Vec<f64> = sides.iter().map(|side| dot(side, side).sqrt()).collect();
        if lengths.contains(&0.0) {
            return None;
        }
        let units: Vec<Point> = sides.iter().zip(&lengths).map(|(side, length)| side.map(|x| x / length)).collect();
        let rows = units.iter().zip(&lengths).map(|(u, length)| units.iter().map(|v| dot(u, v)).chain([0.5 * length]).collect()).collect();
        let (solution, pivot) = solved(rows)?;
        let mut weights = vec![0.0; points.len()];
        others.iter().enumerate().for_each(|(k, &other)| weights[other] = solution[k] / lengths[k]);
        weights[base] = 1.0 - weights.iter().sum::<f64>();
        let offset = |axis: usize| units.iter().zip(&solution).map(|(unit, along)| along * unit[axis]).sum::<f64>();
        Some((pivot, (std::array::from_fn(|axis| points[base][axis] + offset(axis)), weights)))
    };
    let best = (0..points.len()).filter_map(from).max_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 >= LEAST_PIVOT).then_some(best.1)
}

/// The solution of a linear system, rows with the right side last, and its smallest pivot.
fn solved(mut rows: Vec<Vec<f64>>) -> Option<(Vec<f64>, f64)> {
    let size = rows.len();
    let mut least = f64::INFINITY;
    for column in 0..size {
        let pivot = (column..size).max_by(|&a, &b| rows[a][column].abs().total_cmp(&rows[b][column].abs()))?;
        rows.swap(column, pivot);
        least = least.min(rows[column][column].abs());
        if least == 0.0 {
            return None;
        }
        let chosen = rows[column].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(other, _)| *other != column) {
            let factor = row[column] / chosen[column];
            row.iter_mut().zip(&chosen).for_each(|(entry, above)| *entry -= factor * above);
        }
    }
    Some(((0..size).map(|k| rows[k][size] / rows[k][k]).collect(), least))
}

/// The centre of the smallest ball around the closest points, up to rounding.
pub(super) fn enclosing_centre(near: &[Near]) -> Point {
    let points: Vec<Point> = near.iter().map(|near| near.closest).collect();
    let Some(first) = points.first() else { return [0.0; 3] };
    let (mut basis, mut centre, mut square) = (vec![*first], *first, 0.0);
    for _ in 0..EXCHANGES {
        let Some(far) = points.iter().max_by(|a, b| distance_squared(a, &centre).total_cmp(&distance_squared(b, &centre))) else { break };
        if distance_squared(far, &centre) <= square * (1.0 + 1e-12) {
            break;
        }
        basis.push(*far);
        let Some((next, around, from)) = smallest(&basis) else { break };
        if around <= square {
            break;
        }
        (basis, square, centre) = (next, around, from);
    }
    centre
}

/// The smallest ball around up to five points, the last on its surface: its basis, squared radius and centre.
fn smallest(points: &[Point]) -> Option<(Vec<Point>, f64, Point)> {
    let last = points.len() - 1;
    let mut best: Option<(Vec<Point>, f64, Point)> = None;
    for subset in 0..1_u32 << last {
        if subset.count_ones() > 3 {
            continue;
        }
        let mut basis: Vec<Point> = (0..last).filter(|k| subset >> k & 1 == 1).map(|k| points[k]).collect();
        basis.push(points[last]);
        let Some(centre) = circumcentre(&basis) else { continue };
        let square = distance_squared(&centre, &points[last]);
        let holds = points.iter().all(|point| distance_squared(point, &centre) <= square * (1.0 + 1e-10));
        if holds && best.as_ref().is_none_or(|best| square < best.1) {
            best = Some((basis, square, centre));
        }
    }
    best
}

/// The point of the affine hull of one to four points that is as far from all of them.
fn circumcentre(points: &[Point]) -> Option<Point> {
    let base = points[0];
    let sides: Vec<Point> = points[1..].iter().map(|point| subtract(point, &base)).collect();
    let rows = sides.iter().map(|side| sides.iter().map(|other| dot(side, other)).chain([0.5 * dot(side, side)]).collect()).collect();
    let (weights, pivot) = solved(rows)?;
    if pivot <= 1e-13 * sides.iter().map(|side| dot(side, side)).fold(0.0, f64::max) {
        return None;
    }
    Some(std::array::from_fn(|axis| base[axis] + sides.iter().zip(&weights).map(|(side, weight)| weight * side[axis]).sum::<f64>()))
}

/// How far closest points reach from x along three directions that are chosen greedily, the farthest first.
pub(super) fn reaches(x: &Point, near: &[Near]) -> [f64; 3] {
    let mut offsets: Vec<Point> = near.iter().map(|near| subtract(&near.closest, x)).collect();
    std::array::from_fn(|_| {
        let Some(longest) = offsets.iter().copied().max_by(|a, b| dot(a, a).total_cmp(&dot(b, b))) else { return 0.0 };
        let square = dot(&longest, &longest);
        if square > 0.0 {
            for offset in &mut offsets {
                let along = dot(offset, &longest) / square;
                *offset = std::array::from_fn(|axis| offset[axis] - along * longest[axis]);
            }
        }
        square.sqrt()
    })
}
