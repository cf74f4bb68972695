//! Simplices and boxes that hold curves and surfaces of one state, found without a claim.
//!
//! Let all children of a state be cells of the state itself, and A_e its operators. *Simplex*: in place of the first and the
//! last control point take the fixed points of the first and the last operator, which are the ends of a curve: H = (start,
//! e_2 .. e_n-1, end). Points in general position are a basis, so K_e = H^-1 A_e H exists, and where it has no negative
//! entries the curve lies in the simplex (see `hull`), which touches it at its ends: of corner cutting it is the triangle of
//! two tangents. *Box*: operators with negative entries leave such simplices, but where the magnitudes of their entries
//! contract in the coordinates x_2 .. x_n, there is a least box that holds its images. H are its corners, and K_e the shares
//! of corners that make the images of corners, linear in each coordinate. Flat boxes have few: those of plane maps in a
//! frame of space have four. Boxes with more corners than there are control points cost more than they save.
//!
//! Surfaces: operators that are all Kronecker products A_e x B_e, found by their partial sums as columns sum to 1, have the
//! products of the points of A and B.
//!
//! *Bicubic patches* of subdivision schemes number their control points around the cell, and turn their children, so that no operator is a product as it
//! stands. Where the parameters of linear precision are those of a grid of uniform cubic splines, the Bezier points H of these are tried: K_e = H^-1 A_e H,
//! and a child's corner is a Bezier point of the surface again.

use crate::automaton::{Automaton, Hull, StateId, SubdivisionOperator};

/// Control points at most of a state that is examined.
const MOST_POINTS: usize = 36;
/// Coordinates at most in which a box is sought.
const MOST_COORDINATES: usize = 4;
/// Entries that differ by this are the same.
const SAME: f64 = 1e-15;
/// Sides of a box that are shorter have no length.
const FLAT: f64 = 1e-12;
/// Steps towards a fixed point: those of maps that halve are there after 60.
const STEPS: usize = 500;
const LAST_STEPS: usize = 50;

/// What holds a state's attractor.
#[derive(Clone, Debug)]
pub(super) struct Polytope {
    /// H and K; to be verified.
    pub(super) hull: Hull,
    /// Points of the attractor, as shares of the points H.
    pub(super) attained: Vec<Vec<f64>>,
}

/// The polytope of a state, or the product of two.
///
/// Cost: n^2 for every operator and every way to write n as a product, and n^3 for those found.
pub(super) fn polytope(automaton: &Automaton, id: StateId, parameters: Option<&[[f64; 2]]>) -> Option<Polytope> {
    let state = automaton.state(id);
    let own = state.transitions.iter().all(|transition| transition.to == id) && state.transitions.len() > 1;
    if !own || state.frame || state.dimension > MOST_POINTS || !automaton.factors(id).is_empty() {
        return None;
    }
    let operators: Vec<&SubdivisionOperator> = state.transitions.iter().map(|transition| &transition.operator).collect();
    if let Some(found) = parameters.and_then(|parameters| bicubic(&operators, parameters)) {
        return Some(found);
    }
    around(&operators).or_else(|| {
        (2..state.dimension).filter(|rows| state.dimension.is_multiple_of(*rows)).find_map(|rows| {
            let parted: Option<Vec<[SubdivisionOperator; 2]>> = operators.iter().map(|operator| parted(operator, rows)).collect();
            let parted = parted?;
            let [left, right] = [0, 1].map(|k| around(&parted.iter().map(|pair| &pair[k]).collect::<Vec<_>>()));
            Some(product(left?, right?))
        })
    })
}

fn product(left: Polytope, right: Polytope) -> Polytope {
    let both = |left: SubdivisionOperator, right: SubdivisionOperator| SubdivisionOperator::product(vec![left, right]);
    let pairs = left.hull.children.into_iter().zip(right.hull.children);
    let pair = |first: &Vec<f64>, second: &Vec<f64>| first.iter().flat_map(|x| second.iter().map(move |y| x * y)).collect();
    Polytope {
        hull: Hull { points: both(left.hull.points, right.hull.points), children: pairs.map(|(left, right)| both(left, right)).collect() },
        attained: left.attained.iter().flat_map(|first| right.attained.iter().map(move |second| pair(first, second))).collect(),
    }
}

/// The two factors of an operator, if it is the Kronecker product of one with that many rows and another.
fn parted(operator: &SubdivisionOperator, rows: usize) -> Option<[SubdivisionOperator; 2]> {
    let inner = operator.rows() / rows;
    let left = (0..rows).flat_map(|j| (0..rows).map(move |i| (0..inner).map(|k| operator.entry(i * inner + k, j * inner)).sum()));
    let right = (0..inner).flat_map(|j| (0..inner).map(move |i| (0..rows).map(|k| operator.entry(k * inner + i, j)).sum()));
    let factors = [SubdivisionOperator::exact(rows, left.collect()), SubdivisionOperator::exact(inner, right.collect())];
    let product = SubdivisionOperator::product(factors.to_vec());
    let same = product.entries().iter().zip(operator.entries()).all(|(x, y)| (x - y).abs() <= SAME);
    same.then_some(factors)
}

/// Bezier points of a uniform cubic span, as combinations of its four control points, and the other way round: column by column, in sixths and in ones.
const BEZIER: [[f64; 4]; 4] = [[1.0, 4.0, 1.0, 0.0], [0.0, 4.0, 2.0, 0.0], [0.0, 2.0, 4.0, 0.0], [0.0, 1.0, 4.0, 1.0]];
const SPLINE: [[f64; 4]; 4] = [[6.0, -7.0, 2.0, 0.0], [0.0, 2.0, -1.0, 0.0], [0.0, -1.0, 2.0, 0.0], [0.0, 2.0, -7.0, 6.0]];

/// The Bezier points of a patch whose control points have the parameters -1, 0, 1, 2 in both directions.
fn bicubic(operators: &[&SubdivisionOperator], parameters: &[[f64; 2]]) -> Option<Polytope> {
    let place = |parameter: &[f64; 2]| {
        let [u, v] = parameter.map(|x| (x + 1.0).round());
        let near = parameter.iter().zip([u, v]).all(|(x, near)| (x + 1.0 - near).abs() < 1e-9);
        (near && (0.0..4.0).contains(&u) && (0.0..4.0).contains(&v)).then_some((u as usize, v as usize))
    };
    let places: Vec<(usize, usize)> = parameters.iter().map(place).collect::<Option<_>>()?;
    let mut numbers = [16; 16];
    places.iter().enumerate().for_each(|(k, (u, v))| numbers[4 * u + v] = k);
    if places.len() != 16 || numbers.contains(&16) {
        return None;
    }
    let sixths = BEZIER.map(|column| column.map(|x| x / 6.0));
    let bezier = (0..16).flat_map(|j| places.iter().map(move |(u, v)| sixths[j / 4][*u] * sixths[j % 4][*v]));
    let spline = places.iter().flat_map(|(u, v)| (0..16).map(|i| SPLINE[*u][i / 4] * SPLINE[*v][i % 4]));
    let points = SubdivisionOperator::exact(16, bezier.collect());
    let inverse = SubdivisionOperator::exact(16, spline.collect());
    let child = |operator: &&SubdivisionOperator| {
        let shares = inverse.times(&operator.times(&points));
        // What vanishes, and what are binomials in 64ths, comes out as rounding.
        let entries: Vec<f64> = shares.entries().iter().map(|share| (share * 64.0).round() / 64.0).collect();
        SubdivisionOperator::exact(16, entries)
    };
    let children: Vec<SubdivisionOperator> = operators.iter().map(child).collect();
    // Each corner of the patch is the image of one of a child, and so on: a point of the attractor.
    let unit = |at: usize| (0..16).map(|k| f64::from(u8::from(k == at))).collect::<Vec<f64>>();
    let corners = [0, 3, 12, 15].map(unit);
    let is_image = |corner: &Vec<f64>| children.iter().any(|child| [0, 3, 12, 15].iter().any(|&k| child.column(k) == corner.as_slice()));
    let attained = if corners.iter().all(is_image) { corners.to_vec() } else { Vec::new() };
    Some(Polytope { hull: Hull { points, children }, attained })
}

/// The simplex or the box of square operators.
fn around(operators: &[&SubdivisionOperator]) -> Option<Polytope> {
    let (points, children) =
        if operators.iter().all(|operator| operator.is_nonnegative()) { simplex(operators)? } else { bounding_box(operators)? };
    // The ends' shares are what K leaves in place.
    let attained = [children.first()?, children.last()?].map(fixed_point).into_iter().flatten().collect();
    Some(Polytope { hull: Hull { points, children }, attained })
}

/// H and K of a simplex; none where it is that of the control points.
fn simplex(operators: &[&SubdivisionOperator]) -> Option<(SubdivisionOperator, Vec<SubdivisionOperator>)> {
    let n = operators[0].rows();
    let [start, end] = [fixed_point(operators[0])?, fixed_point(operators[operators.len() - 1])?];
    let last = n - 1;
    let determinant = start[0] * end[last] - end[0] * start[last];
    if n < 2 || determinant.abs() <= SAME.sqrt() || determinant >= 1.0 - SAME {
        return None;
    }
    let column = |j: usize| match j {
        0 => start.clone(),
        _ if j == last => end.clone(),
        _ => (0..n).map(|i| f64::from(i == j)).collect(),
    };
    let points: Vec<Vec<f64>> = (0..n).map(column).collect();
    // y with H y = x: the first and the last row give the shares of the ends.
    let seen = |x: &[f64]| -> Option<Vec<f64>> {
        let first = (x[0] * end[last] - end[0] * x[last]) / determinant;
        let other = (start[0] * x[last] - x[0] * start[last]) / determinant;
        let share = |i: usize| match i {
            0 => first,
            _ if i == last => other,
            _ => x[i] - first * start[i] - other * end[i],
        };
        // Shares that vanish come out as rounding.
        (0..n).map(share).map(|y| (y >= -SAME).then_some(y.max(0.0))).collect()
    };
    seen_by(&points, operators, &seen)
}

/// H and K of a box.
fn bounding_box(operators: &[&SubdivisionOperator]) -> Option<(SubdivisionOperator, Vec<SubdivisionOperator>)> {
    let n = operators[0].rows();
    if n > MOST_COORDINATES + 1 {
        return None;
    }
    let point = |y: &[f64]| -> Vec<f64> { std::iter::once(1.0 - y.iter().sum::<f64>()).chain(y.iter().copied()).collect() };
    let start = fixed_point(operators[0])?[1..].to_vec();
    let (mut low, mut high) = (start.clone(), start);
    let mut still = false;
    for _ in 0..STEPS {
        let (before_low, before_high) = (low.clone(), high.clone());
        for corner in corners(&before_low, &before_high) {
            for operator in operators {
                for (k, &y) in operator.apply(&point(&corner))[1..].iter().enumerate() {
                    (low[k], high[k]) = (low[k].min(y), high[k].max(y));
                }
            }
        }
        // It only grows.
        let sides = (0..n - 1).filter(|&k| high[k] - low[k] > FLAT).count();
        if 1 << sides > n {
            return None;
        }
        let change = (0..n - 1).map(|k| (before_low[k] - low[k]).max(high[k] - before_high[k])).fold(0.0, f64::max);
        still = change <= SAME;
        if still || !change.is_finite() {
            break;
        }
    }
    if !still {
        return None;
    }
    for (low, high) in low.iter_mut().zip(&mut high).filter(|(low, high)| **high - **low <= FLAT) {
        *low = 0.5 * (*low + *high);
        *high = *low;
    }
    let points: Vec<Vec<f64>> = corners(&low, &high).iter().map(|corner| point(corner)).collect();
    let seen = |x: &[f64]| -> Option<Vec<f64>> {
        let sides = x[1..].iter().enumerate().filter(|&(k, _)| high[k] > low[k]);
        Some(sides.fold(vec![1.0], |shares, (k, y)| {
            let share = ((y - low[k]) / (high[k] - low[k])).clamp(0.0, 1.0);
            shares.iter().flat_map(|own| [own * (1.0 - share), own * share]).collect()
        }))
    };
    seen_by(&points, operators, &seen)
}

/// The corners of a box, the first coordinate slowest; flat sides have one.
fn corners(low: &[f64], high: &[f64]) -> Vec<Vec<f64>> {
    low.iter().zip(high).fold(vec![Vec::new()], |corners, (&low, &high)| {
        let ends = if high > low { vec![low, high] } else { vec![low] };
        corners.iter().flat_map(|corner: &Vec<f64>| ends.iter().map(move |&end| [corner.as_slice(), &[end]].concat())).collect()
    })
}

/// The points as an operator, and the shares of them that make their images.
fn seen_by(
    points: &[Vec<f64>],
    operators: &[&SubdivisionOperator],
    seen: &dyn Fn(&[f64]) -> Option<Vec<f64>>,
) -> Option<(SubdivisionOperator, Vec<SubdivisionOperator>)> {
    let child = |operator: &&SubdivisionOperator| {
        let columns: Option<Vec<Vec<f64>>> = points.iter().map(|point| seen(&operator.apply(point))).collect();
        Some(SubdivisionOperator::exact(points.len(), columns?.concat()))
    };
    let children: Option<Vec<SubdivisionOperator>> = operators.iter().map(child).collect();
    Some((SubdivisionOperator::exact(points[0].len(), points.concat()), children?))
}

/// The point that an operator leaves where it is.
fn fixed_point(operator: &SubdivisionOperator) -> Option<Vec<f64>> {
    let n = operator.rows();
    let mut point = vec![1.0 / n as f64; n];
    let mut next = |_| {
        let mut image = operator.apply(&point);
        // Nothing else holds back what rounding adds to the sum.
        let sum: f64 = image.iter().sum();
        image.iter_mut().for_each(|x| *x /= sum);
        let change = point.iter().zip(&image).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        point = image;
        change
    };
    (0..STEPS).map(&mut next).find(|&change| change <= SAME)?;
    // What is left shrinks on, down to rounding.
    (0..LAST_STEPS).for_each(|step| _ = next(step));
    Some(point)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::automaton::{LeafPrimitive, State, Transition};

    /// Corner cutting with these parameters.
    fn cutting(a: f64, b: f64) -> [SubdivisionOperator; 2] {
        let first = vec![1.0 - a, a, 0.0, b, 1.0 - b, 0.0, 0.0, 1.0 - a, a];
        let second = vec![b, 1.0 - b, 0.0, 0.0, 1.0 - a, a, 0.0, b, 1.0 - b];
        [SubdivisionOperator::exact(3, first), SubdivisionOperator::exact(3, second)]
    }

    fn found(operators: Vec<SubdivisionOperator>) -> Option<Hull> {
        let dimension = operators[0].rows();
        let transition = |(label, operator)| Transition { to: StateId::new(0), operator, label };
        let transitions = operators.into_iter().enumerate().map(transition).collect();
        let state = State {
            name: String::new(),
            kind: None,
            dimension,
            transitions,
            boundaries: Vec::new(),
            leaf: LeafPrimitive::Centre,
            frame: false,
        };
        polytope(&Automaton::new(vec![state]).unwrap(), StateId::new(0), None).map(|found| found.hull)
    }

    /// Entries of T H - H K.
    fn off(operator: &SubdivisionOperator, hull: &Hull, index: usize) -> f64 {
        let (left, right) = (operator.times(&hull.points), hull.points.times(&hull.children[index]));
        left.entries().iter().zip(right.entries()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn corner_cutting_lies_in_the_triangle_of_its_tangents() {
        for (a, b) in [(0.25, 0.25), (0.3, 0.3), (0.2, 0.4)] {
            let operators = cutting(a, b);
            let hull = found(operators.to_vec()).unwrap();
            // The ends are on the legs.
            let [start, end] = [hull.points.column(0), hull.points.column(2)];
            assert!((start[0] - b / (a + b)).abs() < 1e-14 && start[2] < 1e-14, "{start:?}");
            assert!((end[2] - a / (a + b)).abs() < 1e-14 && end[0] < 1e-14, "{end:?}");
            for (index, operator) in operators.iter().enumerate() {
                assert!(hull.children[index].is_nonnegative() && off(operator, &hull, index) < 1e-14);
            }
        }
    }

    #[test]
    fn signed_curves_lie_in_a_box() {
        // Koch's curve in an affine frame: a box of length 1, flat in the third direction. Its images by the turned maps rise above the
        // curve's height sqrt(3) / 6, by a sixth of its own height h: h = sqrt(3) / 6 + h / 6.
        let map = |angle: f64, x: f64, y: f64| {
            let (sine, cosine) = (angle.to_radians().sin() / 3.0, angle.to_radians().cos() / 3.0);
            let corner = |[a, b, c]: [f64; 3]| {
                let image = [x + cosine * a - sine * b, y + sine * a + cosine * b, c / 3.0];
                [1.0 - image.iter().sum::<f64>(), image[0], image[1], image[2]]
            };
            let columns = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(corner);
            SubdivisionOperator::exact(4, columns.concat())
        };
        let height = 3.0_f64.sqrt() / 6.0;
        let operators = [map(0.0, 0.0, 0.0), map(60.0, 1.0 / 3.0, 0.0), map(-60.0, 0.5, height), map(0.0, 2.0 / 3.0, 0.0)];
        let hull = found(operators.to_vec()).unwrap();
        assert_eq!(hull.points.columns(), 4);
        for k in 0..4 {
            let corner = hull.points.column(k);
            assert!(
                (corner[1] - f64::from(k > 1)).abs() < 1e-14 && (corner[2] - 1.2 * height * f64::from(k % 2 == 1)).abs() < 1e-14,
                "{corner:?}"
            );
        }
        for (index, operator) in operators.iter().enumerate() {
            assert!(hull.children[index].is_nonnegative() && off(operator, &hull, index) < 1e-14);
        }
        // A box in the plane has four corners, and three control points are fewer.
        assert!(found(cutting(0.3, -0.1).to_vec()).is_none());
    }

    #[test]
    fn turned_bicubic_patches_lie_in_their_bezier_points() {
        // The cells of a cube that Catmull and Clark's scheme subdivides, away from its corners.
        let vertices = (0..8).map(|k| glam::DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)));
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]];
        let shape = crate::model::Shape::Subdivision(crate::model::Subdivision {
            scheme: crate::model::Scheme::CatmullClark,
            vertices: vertices.collect(),
            faces: faces.iter().map(|face| face.to_vec()).collect(),
            creases: Vec::new(),
            corners: Vec::new(),
            boundary: crate::model::BoundaryRule::default(),
            coefficients: Vec::new(),
        });
        let attractor = crate::model::Model { name: None, shape }.lower().unwrap().attractor;
        let ids = (0..attractor.automaton().states().len()).map(StateId::new);
        let regular: Vec<StateId> = ids.filter(|&id| attractor.hull(id).is_some_and(|hull| hull.attained.len() == 4)).collect();
        assert_eq!(regular.len(), 1);
        let hull = attractor.hull(regular[0]).unwrap();
        assert!(!hull.is_signed && hull.miss < 1e-11, "{:e}", hull.miss);
        let points = hull.points.as_ref().unwrap();
        let state = attractor.automaton().state(regular[0]);
        for (transition, inner) in state.transitions.iter().zip(&hull.children) {
            let (left, right) = (transition.operator.times(points), points.times(inner));
            assert!(left.entries().iter().zip(right.entries()).all(|(x, y)| (x - y).abs() < 1e-14));
        }
    }

    #[test]
    fn products_are_recognized_and_others_are_not() {
        let (u, v) = (cutting(0.25, 0.25), cutting(0.3, 0.2));
        let mut operators = Vec::new();
        for left in &u {
            for right in &v {
                let product = SubdivisionOperator::product(vec![left.clone(), right.clone()]);
                // As a model has it: no longer known to be a product.
                operators.push(SubdivisionOperator::exact(9, product.entries().to_vec()));
            }
        }
        let hull = found(operators.clone()).unwrap();
        for (index, operator) in operators.iter().enumerate() {
            assert!(hull.children[index].is_nonnegative() && off(operator, &hull, index) < 1e-14);
        }
        let mut entries = operators[1].entries().to_vec();
        entries[0] += 1e-3;
        entries[1] -= 1e-3;
        operators[1] = SubdivisionOperator::exact(9, entries);
        assert!(found(operators).is_none());
    }
}
