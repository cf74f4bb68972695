//! Splines of any degree on any knots against a direct evaluator that lives here (de Boor's algorithm), and against
//! closed forms.

use crate::schemes::*;
use glam::DVec3;
use lacuna_kernel::model::{ControlNet, CurveScheme};

/// Distinct states of curves that a spline on these knots reaches, without points.
fn curve_states(degree: usize, knots: Vec<f64>) -> usize {
    let count = knots.len() - degree - 1;
    let points = (0..count).map(|k| DVec3::new(k as f64, (k * k) as f64, 0.0)).collect();
    let attractor = lower(curve(CurveScheme::Nurbs { degree, knots }, points, None)).attractor;
    attractor.automaton().states().iter().filter(|state| state.dimension == degree + 1).count()
}

/// Morlet et al. 2019: 4(d - 1) states for one span of a generic vector, one for a uniform one.
#[test]
fn generic_knots_make_four_states_per_degree_above_one() {
    for degree in 2..=4 {
        let mut random = Random(degree as u64);
        let mut knots = vec![0.0];
        (0..2 * degree + 1).for_each(|k| knots.push(knots[k] + random.between(0.5, 2.0)));
        assert_eq!(curve_states(degree, knots), 4 * (degree - 1), "degree {degree}");
        let uniform = |scale: f64| (0..3 * degree + 4).map(|k| 7.0 + scale * k as f64).collect::<Vec<f64>>();
        assert_eq!(curve_states(degree, uniform(1.0)), 1);
        // Rounding of knots does not multiply states.
        assert_eq!(curve_states(degree, uniform(0.1)), 1);
        assert_eq!(curve_states(degree, uniform(1.0 / 3.0)), 1);
    }
}

#[test]
fn points_of_curves_are_de_boors() {
    let mut random = Random(7);
    for degree in 1..=9 {
        for round in 0..12 {
            let count = degree + 1 + random.below(8);
            let knots = random.knots(degree, count, round);
            let points = random.points(count);
            let weights: Option<Vec<f64>> = round.is_multiple_of(2).then(|| (0..count).map(|_| random.between(0.2, 3.0)).collect());
            let size = size(&points);
            let direct = |t: f64| de_boor(degree, &knots, &points, weights.as_deref(), t);
            let shape = curve(CurveScheme::Nurbs { degree, knots: knots.clone() }, points.clone(), weights.clone());
            let attractor = lower(shape).attractor;
            let spans = spans(degree, &knots);
            assert_eq!(attractor.roots().len(), spans.len());
            for (root, span) in spans.iter().enumerate() {
                for _ in 0..8 {
                    let [left, right] = walk(&attractor, root, &[*span], &mut random, 12).map(|(place, point)| (place[0], point));
                    for (t, point) in [left, right] {
                        let off = point.distance(direct(t));
                        // The parameter itself is known to a unit in the last place, which a short span magnifies.
                        let parameter = 4.0 * f64::EPSILON * t.abs().max(1.0) * degree as f64 / (span[1] - span[0]);
                        assert!(off <= (1e-12 + parameter) * size, "degree {degree}, knots {knots:?}, t {t}: off by {off:e}");
                    }
                }
            }
        }
    }
}

#[test]
fn points_of_surfaces_are_de_boors_along_both_directions() {
    let mut random = Random(11);
    for (round, degrees) in [[3, 3], [2, 3], [1, 2], [1, 1], [5, 2], [9, 1]].into_iter().enumerate() {
        let counts = degrees.map(|degree| degree + 1 + random.below(4));
        let knots = [0, 1].map(|k| random.knots(degrees[k], counts[k], round));
        let points = random.points(counts[0] * counts[1]);
        let weights: Vec<f64> = (0..points.len()).map(|_| random.between(0.3, 2.0)).collect();
        let net = ControlNet { size: counts.to_vec(), points: points.clone(), weights: Some(weights.clone()) };
        let schemes = [0, 1].map(|k| CurveScheme::Nurbs { degree: degrees[k], knots: knots[k].clone() });
        let attractor = lower(product(schemes.to_vec(), net)).attractor;
        let [u_spans, v_spans] = [0, 1].map(|k| spans(degrees[k], &knots[k]));
        for root in 0..attractor.roots().len() {
            let ranges = [u_spans[root / v_spans.len()], v_spans[root % v_spans.len()]];
            for (place, point) in walk(&attractor, root, &ranges, &mut random, 8) {
                // Along v for every row, then along u: homogeneous points are evaluated, then projected.
                let rows: Vec<[f64; 4]> = (0..counts[0])
                    .map(|i| {
                        let row = (0..counts[1]).map(|j| homogeneous(points[i * counts[1] + j], weights[i * counts[1] + j]));
                        blossom_point(degrees[1], &knots[1], &row.collect::<Vec<_>>(), place[1])
                    })
                    .collect();
                let exact = project(blossom_point(degrees[0], &knots[0], &rows, place[0]));
                assert!(point.distance(exact) <= 1e-12 * size(&points), "degrees {degrees:?}: {point} {exact}");
            }
        }
    }
}
