//! Fractal interpolation.

use super::Faults;
use super::factor::{Factor, Grid, Piece, Span};
use crate::automaton::SubdivisionOperator;
use crate::model::AffineMap;
use glam::{DMat3, DVec3};

/// Data points of a curve that are its cells' control points; with more of them, cells are affine frames, whose operators
/// do not grow with the data.
const MOST_POINTS: usize = 12;

/// Ends of maps may miss the points by this share of the model's size.
const ENDS: f64 = 1e-9;

fn check(scaling: &[f64], count: usize, faults: &mut Faults<'_>) -> bool {
    if !faults.enough(count, 3, "interpolation.points") {
        return false;
    }
    if scaling.len() != count - 1 {
        let message = format!("{} factors for {} intervals", scaling.len(), count - 1);
        faults.add("/vertical_scaling", "interpolation.scaling", message);
        return false;
    }
    let before = faults.count;
    for (index, factor) in scaling.iter().enumerate().filter(|(_, factor)| factor.is_nan() || factor.abs() >= 1.0) {
        let message = format!("the factor of interval {index} is {factor}: the graph contracts for absolute values below 1");
        faults.add(&format!("/vertical_scaling/{index}"), "interpolation.scaling", message);
    }
    faults.count == before
}

/// The function through points at the given places of [0, 1], or at equal distances.
///
/// With F(0) = P_0 and F(1) = P_n, the part over interval i is d_i F(t) + (1 - t)(P_{i-1} - d_i P_0) + t (P_i - d_i P_n),
/// so child i's control point k is that with F(t_k) = P_k.
pub(super) fn interpolation(scaling: &[f64], count: usize, places: Option<&[f64]>, faults: &mut Faults<'_>) -> Option<Factor> {
    if !check(scaling, count, faults) {
        return None;
    }
    let last = count - 1;
    let place = |k: usize| places.map_or(k as f64 / last as f64, |places| places[k]);
    let child = |interval: usize| {
        let factor = scaling[interval];
        let mut entries = vec![0.0; count * count];
        for (k, column) in entries.chunks_exact_mut(count).enumerate() {
            let t = place(k);
            column[k] += factor;
            column[interval] += 1.0 - t;
            column[0] -= (1.0 - t) * factor;
            column[interval + 1] += t;
            column[last] -= t * factor;
        }
        (0, SubdivisionOperator::exact(count, entries))
    };
    let unit = |at: usize| (0..count).map(|k| f64::from(k == at)).collect();
    let list = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value.to_string()).collect::<Vec<_>>().join(" ");
    let piece = Piece {
        name: format!("interpolation at {} scaled by {}", list(&mut (0..count).map(place)), list(&mut scaling.iter().copied())),
        dimension: count,
        children: (0..last).map(child).collect(),
        ends: [unit(0), unit(last)],
        // The abscissae are linear along the curve.
        parameters: (0..count).map(place).collect(),
        hull: None,
    };
    let controls = (0..count).map(|point| vec![(point, 1.0)]).collect();
    Some(Factor { pieces: vec![piece], spans: vec![Span { piece: 0, controls }], joints: Vec::new() })
}

/// The graph through points of increasing x.
pub(super) fn graph(points: &[DVec3], scaling: &[f64], grid: Grid, faults: &mut Faults<'_>) -> Option<(Factor, Grid)> {
    if let Some(k) = (1..points.len()).find(|&k| points[k].x <= points[k - 1].x) {
        let message = format!("x is {} at point {k}, and {} before: it must increase", points[k].x, points[k - 1].x);
        faults.add_points("interpolation.order", message);
        return None;
    }
    if !check(scaling, points.len(), faults) {
        return None;
    }
    let (first, last) = (points[0], points[points.len() - 1]);
    let width = last.x - first.x;
    if points.len() <= MOST_POINTS {
        let places: Vec<f64> = points.iter().map(|point| (point.x - first.x) / width).collect();
        return Some((interpolation(scaling, points.len(), Some(&places), faults)?, grid));
    }
    let map = |(pair, &factor): (&[DVec3], &f64)| {
        let (start, end) = (pair[0] - factor * first, pair[1] - factor * last);
        let slope = (end - start) / width;
        // The abscissa is linear along the curve, whatever the factor.
        let linear = DMat3::from_cols(DVec3::new(slope.x + factor, slope.y, slope.z), DVec3::Y * factor, DVec3::Z * factor);
        AffineMap { linear, translation: pair[0] - linear * first }
    };
    let maps: Vec<AffineMap> = points.windows(2).zip(scaling).map(map).collect();
    affine(points, &maps, faults)
}

/// The curve whose part over interval i is its image under map i. Its cells' control points are affine frames.
pub(super) fn affine(points: &[DVec3], maps: &[AffineMap], faults: &mut Faults<'_>) -> Option<(Factor, Grid)> {
    if !faults.enough(points.len(), 3, "interpolation.points") {
        return None;
    }
    let (first, last) = (points[0], points[points.len() - 1]);
    if maps.len() != points.len() - 1 {
        faults.add("/maps", "interpolation.maps", format!("{} maps for {} intervals", maps.len(), points.len() - 1));
        return None;
    }
    let size = points.iter().fold(0.0_f64, |size, point| size.max(point.abs().max_element()));
    let before = faults.count;
    for (index, map) in maps.iter().enumerate() {
        let ends = [map.linear * first + map.translation, map.linear * last + map.translation];
        let off = ends[0].distance(points[index]).max(ends[1].distance(points[index + 1]));
        if !map.linear.is_finite() || off.is_nan() || off > ENDS * size {
            let message = format!(
                "map {index} takes the first and the last point to {} and {}, and must take them to points {index} and {}: {} and {}",
                ends[0],
                ends[1],
                index + 1,
                points[index],
                points[index + 1]
            );
            faults.add(&format!("/maps/{index}"), "interpolation.ends", message);
        }
    }
    (faults.count == before).then(|| framed(points, maps))
}

fn framed(points: &[DVec3], maps: &[AffineMap]) -> (Factor, Grid) {
    let (first, last) = (points[0], points[points.len() - 1]);
    let low = points.iter().copied().fold(first, DVec3::min);
    let high = points.iter().copied().fold(first, DVec3::max);
    // The frame spans the points' box, with some depth where that is flat.
    let extent = (high - low).max(DVec3::splat(0.05 * (high - low).max_element().max(f64::MIN_POSITIVE)));
    let barycentric = |point: DVec3| {
        let y = (point - low) / extent;
        [1.0 - y.x - y.y - y.z, y.x, y.y, y.z]
    };
    let corners = [low, low + DVec3::X * extent.x, low + DVec3::Y * extent.y, low + DVec3::Z * extent.z];
    let child = |map: &AffineMap| {
        let columns = corners.iter().flat_map(|&corner| barycentric(map.linear * corner + map.translation)).collect();
        (0, SubdivisionOperator::exact(4, columns))
    };
    let numbers: Vec<String> = [low, extent]
        .iter()
        .flat_map(DVec3::to_array)
        .chain(maps.iter().flat_map(|map| map.linear.to_cols_array().into_iter().chain(map.translation.to_array())))
        .map(|value| value.to_string())
        .collect();
    let piece = Piece {
        name: format!("affine interpolation {}", numbers.join(" ")),
        dimension: 4,
        children: maps.iter().map(child).collect(),
        ends: [barycentric(first).to_vec(), barycentric(last).to_vec()],
        parameters: Vec::new(),
        hull: None,
    };
    let controls = (0..4).map(|point| vec![(point, 1.0)]).collect();
    let factor = Factor { pieces: vec![piece], spans: vec![Span { piece: 0, controls }], joints: Vec::new() };
    let points = corners.iter().map(|corner| [corner.x, corner.y, corner.z, 1.0]).collect();
    (factor, Grid { size: vec![4], points, rational: false })
}
