//! Where convex functions are low: the method of ellipsoids (Yudin and Nemirovski, 1976; with deep cuts, Bland, Goldfarb and Todd, "The ellipsoid method: a survey", Oper. Res. 29, 1981).

use crate::attractor::cell::{Point, between, dot};

/// Ellipsoids at most, to decide one question, and where little depends on it.
const MOST_ELLIPSOIDS: usize = 400;
const FEW_ELLIPSOIDS: usize = 40;
/// What rounding makes of an ellipsoid in one step: of its square lengths, as a share of the largest, and of where its centre is. They grow by that in every step, so that they hold what they should.
const NOISE: f64 = 1e-14;
const SHIFT: f64 = 1e-15;
/// Ellipsoids are cut no more in directions where their square lengths are this many times what rounding makes of them.
const THIN: f64 = 8.0;

/// Whether nothing is in a box.
pub(super) fn is_empty([low, high]: &[Point; 2]) -> bool {
    (0..3).any(|axis| low[axis] > high[axis])
}

/// About where in a box a convex function is lowest, and its value there; `above` gives it with a subgradient. Ellipsoids hold the places where it is lower than at any before, and begin anew in smaller boxes, which rounding does less to; none where the box is empty.
pub(super) fn lowest([low, high]: [Point; 2], above: impl Fn(&Point) -> (f64, Point)) -> Option<(Point, f64)> {
    if is_empty(&[low, high]) {
        return None;
    }
    let mut best = (between(&low, &high, 0.5), f64::INFINITY);
    for share in ZOOM {
        let half: Point = std::array::from_fn(|axis| 0.5 * share * (high[axis] - low[axis]));
        let around = [-1.0, 1.0].map(|side| std::array::from_fn(|axis| best.0[axis] + side * half[axis]));
        go_down(&mut best, around, MOST_ELLIPSOIDS, &above);
    }
    Some(best)
}

/// The same, but for where few ellipsoids lead: low enough to try what is there.
pub(super) fn low(within: [Point; 2], above: impl Fn(&Point) -> (f64, Point)) -> Option<(Point, f64)> {
    if is_empty(&within) {
        return None;
    }
    let mut best = (between(&within[0], &within[1], 0.5), f64::INFINITY);
    go_down(&mut best, within, FEW_ELLIPSOIDS, &above);
    Some(best)
}

/// Looks for a place of a box where a function is lower than at the best one so far.
fn go_down(best: &mut (Point, f64), [low, high]: [Point; 2], most: usize, above: &impl Fn(&Point) -> (f64, Point)) {
    let mut ellipsoid = Ellipsoid::around(&low, &high);
    for _ in 0..most {
        let (value, slope) = above(&ellipsoid.centre);
        if value < best.1 {
            *best = (ellipsoid.centre, value);
        }
        if !matches!(ellipsoid.cut(value - best.1, &slope, false), Left::Some) {
            break;
        }
    }
}

/// Sides of the boxes where the lowest place is sought, as shares of the first.
const ZOOM: [f64; 3] = [1.0, 1e-3, 1e-6];

/// Where something is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Place {
    At(Point),
    Nowhere,
    Unknown,
}

/// Where in a box convex functions are all at most 0. `above` gives, for a place where one is not, its value and a subgradient there that is no longer than 1.
///
/// The ellipsoid {y: (y - x)^T P^-1 (y - x) <= 1} holds all places of the box where they are; there the function is at least f(x) - sqrt(g^T P g).
pub(super) fn common_point([low, high]: [Point; 2], above: impl Fn(&Point) -> Option<(f64, Point)>) -> Place {
    if is_empty(&[low, high]) {
        return Place::Nowhere;
    }
    let mut ellipsoid = Ellipsoid::around(&low, &high);
    for _ in 0..MOST_ELLIPSOIDS {
        let Some((value, slope)) = above(&ellipsoid.centre) else { return Place::At(ellipsoid.centre) };
        match ellipsoid.cut(value, &slope, true) {
            Left::Some => {}
            Left::None => return Place::Nowhere,
            Left::Little => break,
        }
    }
    Place::Unknown
}

/// {y: (y - x)^T P^-1 (y - x) <= 1}.
struct Ellipsoid {
    /// x.
    centre: Point,
    /// P.
    shape: [Point; 3],
}

/// What is left of an ellipsoid.
enum Left {
    Some,
    /// Not enough to go on with.
    Little,
    None,
}

impl Ellipsoid {
    /// The ball around a box is an ellipsoid with the sides' half lengths times the root of 3.
    fn around(low: &Point, high: &Point) -> Self {
        let mut shape = [[0.0; 3]; 3];
        (0..3).for_each(|axis| shape[axis][axis] = 0.75 * (high[axis] - low[axis]).powi(2) * (1.0 + 1e-9) + f64::MIN_POSITIVE);
        Self { centre: between(low, high, 0.5), shape }
    }

    /// Cuts off the places where a function is not lower by `value` than at the centre, with the subgradient `slope` there, which is no longer than 1. Where `is_safe`, what is left holds all other places in spite of rounding; else it
    /// is a little smaller, and cut on for longer.
    fn cut(&mut self, value: f64, slope: &Point, is_safe: bool) -> Left {
        let Self { centre: x, shape } = self;
        let image = shape.map(|row| dot(&row, slope));
        let square = dot(slope, &image);
        let trace = (0..3).map(|axis| shape[axis][axis]).sum::<f64>();
        // (s + t)^2 <= s^2 + 2 s t + t^2 for all lengths s.
        let shift = if is_safe { SHIFT } else { 0.0 } * x.iter().map(|part| part.abs()).sum::<f64>();
        let noise = NOISE * trace + (2.0 * trace.sqrt() + shift) * shift;
        if value > (square.max(0.0) + noise).sqrt() * (1.0 + 1e-9) {
            return Left::None;
        }
        let reach = square.sqrt();
        let depth = value / reach;
        // It is as thin as what rounding made of it; or something is no number.
        let is_thick = square > THIN * noise && depth < 1.0;
        if !is_thick {
            return Left::Little;
        }
        let step = (1.0 + 3.0 * depth) / 4.0;
        let grown = 9.0 / 8.0 * (1.0 - depth * depth) * (1.0 + 1e-12);
        let flattened = 2.0 * (1.0 + 3.0 * depth) / (4.0 * (1.0 + depth));
        for axis in 0..3 {
            x[axis] -= step * image[axis] / reach;
        }
        // The same number both ways: what is not symmetric would stay, while all else shrinks.
        let across = |p: usize, q: usize| flattened * (image[p] * image[q]) / (reach * reach);
        *shape = std::array::from_fn(|p| std::array::from_fn(|q| grown * (shape[p][q] - across(p, q))));
        if is_safe {
            (0..3).for_each(|axis| shape[axis][axis] += noise);
        }
        Left::Some
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::cell::{closest_on_segment, cross, subtract, unit};
    use crate::dilation::arrangement::bodies::highest;
    use crate::dilation::arrangement::polytopes::Plane;
    use crate::split_mix::Random;

    /// Two slabs across each other whose common part is thin: places in it may not be found, but are never said not to be.
    #[test]
    fn what_is_thin_is_not_nothing() {
        let mut random = Random(17);
        let mut unit = move || (random.next() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
        let mut vector = move || -> Point {
            let way: Point = std::array::from_fn(|_| unit());
            let length = dot(&way, &way).sqrt();
            way.map(|part| part / length)
        };
        let mut found = 0;
        for size in [3.0, 100.0] {
            for thickness in [1e-3, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9] {
                for _ in 0..100 {
                    let (first, second, at) = (vector(), vector(), vector().map(|x| 0.4 * size * x));
                    let planes: Vec<Plane> = [first, first.map(|x| -x), second, second.map(|x| -x)]
                        .into_iter()
                        .map(|[a, b, c]| [a, b, c, dot(&[a, b, c], &at) + 0.5 * thickness])
                        .collect();
                    let common = common_point([[-size; 3], [size; 3]], |x| highest(x, planes.iter(), 0.0));
                    assert_ne!(common, Place::Nowhere, "{size} {thickness}");
                    found += usize::from(matches!(common, Place::At(_)));
                }
            }
        }
        assert!(found > 300, "{found}");
    }

    /// Balls that touch, with next to nothing to spare: nowhere near the place is it said not to be, though boxes end there.
    #[test]
    fn a_touch_is_not_nothing() {
        let mut random = Random(29);
        for round in 0..3_000 {
            let spare = [1e-9, 1e-11, 1e-12][round % 3];
            let at: Point = std::array::from_fn(|_| (10.0 * random.share()).round());
            let (low, high) = if round % 2 == 0 {
                (at.map(|x| x - 0.6 * random.share()), at.map(|x| x + 0.6 * random.share()))
            } else {
                (
                    at.map(|x| x - 0.6 * random.share()),
                    std::array::from_fn(|axis| at[axis] + [0.6 * random.share(), 0.0][usize::from(axis == 1)]),
                )
            };
            let above = |x: &Point| {
                let of = |side: f64| {
                    let way = [x[0] - at[0], x[1] - at[1] - side, x[2] - at[2]];
                    let length = dot(&way, &way).sqrt();
                    (length - 1.0 - spare, way.map(|part| part / length))
                };
                let (first, second) = (of(1.0), of(-1.0));
                Some(if first.0 > second.0 { first } else { second }).filter(|own| own.0 > 0.0)
            };
            assert_ne!(common_point([low, high], above), Place::Nowhere, "{round}: {low:?} {high:?}");
        }
    }

    /// Long tubes across each other that touch, overlap or miss each other by next to nothing: many steps, of which none may lose the place, or make one up.
    #[test]
    fn long_tubes_that_touch_are_not_parted() {
        let mut random = Random(31);
        let spare = 2e-11;
        for round in 0..600 {
            let gap = [0.0, -1e-9, -1e-7, 1e-9, 1e-7][round % 5];
            let mut way = || -> Point { unit(&std::array::from_fn(|_| 2.0 * random.share() - 1.0)) };
            let (first, second) = (way(), way());
            let across = unit(&cross(&first, &second));
            let length = [100.0, 1e4][round / 5 % 2];
            let end = |way: &Point, off: f64, along: f64| -> Point { std::array::from_fn(|axis| along * way[axis] + off * across[axis]) };
            let tubes = [(first, 0.0), (second, 2.0 + gap)].map(|(way, off)| [end(&way, off, -0.4 * length), end(&way, off, 0.6 * length)]);
            let above = |x: &Point, spare: f64| {
                let of = |[a, b]: &[Point; 2]| {
                    let way = subtract(x, &closest_on_segment(x, a, b));
                    let distance = dot(&way, &way).sqrt();
                    (distance - 1.0 - spare, way.map(|part| part / distance))
                };
                let (one, other) = (of(&tubes[0]), of(&tubes[1]));
                Some(if one.0 > other.0 { one } else { other }).filter(|own| own.0 > 0.0)
            };
            let within = [[-length; 3], [length; 3]];
            let [loose, tight] = [spare, -spare].map(|spare| common_point(within, |x| above(x, spare)));
            assert!(gap > 0.0 || loose != Place::Nowhere, "{round}: {gap}");
            assert!(gap < 0.0 || !matches!(tight, Place::At(_)), "{round}: {gap} {tight:?}");
        }
    }

    /// Where a convex function is lowest, and how low: distances from a point, and the farthest of some.
    #[test]
    fn the_lowest_place_is_found() {
        let mut random = Random(23);
        for _ in 0..200 {
            let mut vector = || -> Point { std::array::from_fn(|_| 2.0 * random.share() - 1.0) };
            let (a, b) = (vector(), vector());
            let of = |x: &Point, from: &Point| {
                let way = subtract(x, from);
                let length = dot(&way, &way).sqrt();
                (length, if length > 0.0 { way.map(|part| part / length) } else { way })
            };
            let farthest = |x: &Point| if of(x, &a).0 > of(x, &b).0 { of(x, &a) } else { of(x, &b) };
            let (x, value) = lowest([[-1.5; 3], [1.5; 3]], farthest).expect("the box is not empty");
            let half = 0.5 * of(&a, &b).0;
            assert!((value - half).abs() < 1e-9 && of(&x, &between(&a, &b, 0.5)).0 < 1e-6, "{value} {half}");
        }
        assert!(lowest([[1.0; 3], [0.0; 3]], |_| (0.0, [0.0; 3])).is_none());
    }
}
