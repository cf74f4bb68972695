//! Bounds of the joint spectral radius against radii known in closed form or from the literature.

use crate::automata::{Columns, Numbers, automaton, catmull_clark, corner_cutting, cubic, extended, fifty_states, iterated, nurbs, tensor};
use lacuna_kernel::automaton::{Automaton, Contraction, convergence::contraction};

/// Asserts that the bounds hold the radius and are within `share` of it.
fn holds(automaton: &Automaton, radius: f64, share: f64, what: &str) -> Contraction {
    let found = contraction(automaton);
    assert!(found.lower <= radius * (1.0 + 1e-9) && found.upper >= radius * (1.0 - 1e-12), "{what}: {radius} in {found:?}");
    assert!(found.lower >= radius * (1.0 - 1e-7), "{what}: {} is below {radius}", found.lower);
    assert!(found.upper <= radius + share * (1.0 - radius).abs(), "{what}: {} is above {radius}", found.upper);
    found
}

/// Within a component of Gregory's region, differences of neighbours are multiplied by L0 = [[c, b], [0, a]] and
/// L1 = [[b, 0], [a, c]] with c = 1 - a - b > max(a, b): non-negative, with column sums c and a + b, so the radius is
/// at most max(c, 1 - c) < 1, and at least c.
#[test]
fn gregorys_region_is_accepted_up_to_its_boundary() {
    // Points of the open triangle (0,0), (1/2,0), (1/3,1/3), (0,1/2): its two halves, by barycentric weights.
    let near = [1e-3, 1e-6, 1e-8];
    let mut points = Vec::new();
    for i in 1..60 {
        for j in 1..60 {
            points.push((f64::from(i) / 120.0, f64::from(j) / 120.0));
        }
    }
    for &e in &near {
        for k in 0..=40 {
            let t = f64::from(k) / 40.0;
            // Along the sides b = 0, 1 - 2 a - b = 0, and their mirror images; with t at the corners too.
            let side = (e + t * (0.5 - 3.0 * e), e);
            let b = e + t * (1.0 / 3.0 - 2.0 * e);
            let slope = ((1.0 - b - e) / 2.0, b);
            points.extend([side, (side.1, side.0), slope, (slope.1, slope.0)]);
        }
    }
    let mut tested = 0;
    for (a, b) in points {
        if a > 0.0 && b > 0.0 && 1.0 - 2.0 * a - b > 0.0 && 1.0 - a - 2.0 * b > 0.0 {
            let found = contraction(&iterated(corner_cutting(a, b)));
            let c = 1.0 - a - b;
            assert!(found.upper < 1.0 && found.lower < 1.0 - 1e-9, "a {a}, b {b}: {found:?}");
            assert!(found.lower >= c * (1.0 - 1e-9) && found.lower <= c.max(1.0 - c) * (1.0 + 1e-9), "a {a}, b {b}: {}", found.lower);
            tested += 1;
        }
    }
    assert!(tested > 1500, "{tested}");
}

/// Towards a = b = 0 the radius c = 1 - a - b tends to 1, and is still proven below it.
#[test]
fn a_radius_of_one_less_a_thousand_millionth_is_decided() {
    for gap in [1e-3, 1e-5, 1e-7, 4e-9] {
        let found = contraction(&iterated(corner_cutting(0.5 * gap, 0.5 * gap)));
        assert!(found.upper < 1.0 && found.lower < 1.0 - 1e-9, "{gap}: {found:?}");
    }
}

#[test]
fn corner_cutting_that_diverges_is_refused_with_its_word() {
    let found = contraction(&iterated(corner_cutting(0.9, -0.85)));
    // rho(L0 L0 L0 L1) = 2.227 (ALGORITHMS.md 2.1): per step its fourth root.
    assert!(found.lower >= 2.2268_f64.powf(0.25), "{found:?}");
    let word = &found.cycle.1;
    assert_eq!((word.len(), word.iter().sum::<usize>()), (4, 1), "{word:?}");
}

#[test]
fn radii_from_the_literature() {
    // Golden mean: {[1 1; 0 1], [1 0; 1 1]} has the radius (1 + sqrt 5)/2, attained by the product of the two (Blondel,
    // Theys and Vladimirov, "An elementary counterexample to the finiteness conjecture", SIAM J. Matrix Anal. 24, 2003).
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    for scale in [0.3, 0.5, 0.6, 0.615, 0.62, 0.8] {
        let pair = vec![extended(&[&[scale, scale], &[0.0, scale]]), extended(&[&[scale, 0.0], &[scale, scale]])];
        holds(&iterated(pair), scale * golden, 0.3, &format!("golden mean times {scale}"));
    }
    // Gripenberg's example (Linear Algebra Appl. 234, 1996): 0.6596789 < radius < 0.6596924.
    let pair = vec![extended(&[&[0.6, 0.0], &[0.2, 0.6]]), extended(&[&[0.6, -0.6], &[0.0, -0.2]])];
    let found = contraction(&iterated(pair));
    assert!(found.lower > 0.6596788 && found.lower < 0.6596925 && found.upper > 0.6596789 && found.upper < 0.68, "{found:?}");
    // Daubechies' wavelet with four coefficients: radius (1 + sqrt 3)/4, Hoelder exponent 0.5500 (Daubechies and Lagarias,
    // "Two-scale difference equations II", SIAM J. Math. Anal. 23, 1992).
    let root = 3f64.sqrt();
    let c = [0.25 * (1.0 + root), 0.25 * (3.0 + root), 0.25 * (3.0 - root), 0.25 * (1.0 - root)];
    let first: Columns = vec![vec![c[0], c[2], 0.0], vec![0.0, c[1], c[3]], vec![0.0, c[0], c[2]]];
    let second: Columns = vec![vec![c[1], c[3], 0.0], vec![c[0], c[2], 0.0], vec![0.0, c[1], c[3]]];
    holds(&iterated(vec![first, second]), 0.25 * (1.0 + root), 0.03, "Daubechies' wavelet");
    // Two nilpotent matrices whose product is not: neither has an eigenvalue, the radius is s.
    for s in [0.5, 0.999_999, 1.01] {
        let pair = vec![extended(&[&[0.0, s], &[0.0, 0.0]]), extended(&[&[0.0, 0.0], &[s, 0.0]])];
        holds(&iterated(pair), s, 0.03, "nilpotent pair");
    }
}

/// Paths of a tensor product are pairs of paths, its operators act as A x B, and the restriction has the radii of
/// both factors (each beside the other's eigenvalue 1) and their product.
#[test]
fn a_tensor_product_has_the_larger_radius() {
    // Pieces of a segment: the radius is the larger ratio.
    let cantor = vec![vec![vec![1.0, 0.0], vec![0.3, 0.7]], vec![vec![0.3, 0.7], vec![0.0, 1.0]]];
    let line = vec![vec![vec![1.0, 0.0], vec![0.2, 0.8]], vec![vec![0.2, 0.8], vec![0.0, 1.0]]];
    holds(&iterated(line.clone()), 0.8, 0.03, "line");
    holds(&iterated(cubic()), 0.5, 0.1, "cubic B-spline");
    holds(&iterated(tensor(&cubic(), &cubic())), 0.5, 0.6, "bicubic B-spline");
    holds(&iterated(tensor(&corner_cutting(0.25, 0.25), &corner_cutting(0.25, 0.25))), 0.5, 0.5, "biquadratic B-spline");
    holds(&iterated(tensor(&line, &cubic())), 0.8, 0.5, "fractal times spline");
    holds(&iterated(tensor(&cantor, &cantor)), 0.7, 0.5, "fractal times fractal");
    holds(&iterated(tensor(&cantor, &tensor(&cubic(), &line))), 0.8, 0.9, "volume");
}

/// The subdominant eigenvalue at a vertex of valence n, in closed form (Ball and Storry, "Conditions for tangent plane
/// continuity over recursively generated B-spline surfaces", ACM Trans. Graphics 7, 1988).
#[test]
fn irregular_catmull_clark_faces_contract_by_the_known_eigenvalue() {
    for n in 3..=12 {
        let c = (2.0 * std::f64::consts::PI / n as f64).cos();
        let half = (std::f64::consts::PI / n as f64).cos();
        let eigenvalue = (5.0 + c + half * (18.0 + 2.0 * c).sqrt()) / 16.0;
        let found = holds(&catmull_clark(n), eigenvalue.max(0.5), 0.98, &format!("valence {n}"));
        assert!(found.cycle.0.index() == 0 || n <= 4, "the irregular child is the slowest");
    }
}

#[test]
fn faces_on_uneven_knots_converge() {
    for intervals in [[1.0; 5], [0.0, 0.0, 1.0, 0.0, 0.0], [1.0, 2.0, 1.0, 3.0, 0.5], [1e-3, 1.0, 1.0, 1e3, 1.0]] {
        let faces = nurbs(intervals);
        let found = contraction(&faces);
        assert!(found.upper < 1.0 && found.lower >= 0.5 * (1.0 - 1e-9), "{} states: {} {}", faces.states().len(), found.lower, found.upper);
    }
    assert_eq!(nurbs([1.0, 2.0, 1.0, 3.0, 0.5]).states().len(), 64, "8 states an axis, as MATH.md 4 counts");
}

#[test]
fn random_automata_of_fifty_states_converge() {
    for seed in 1..6 {
        let found = contraction(&fifty_states(seed));
        assert!(found.upper < 1.0, "{} {}", found.lower, found.upper);
    }
}

/// Columns of random operators overlap in the long run (they are scrambling almost surely), so that all converge.
#[test]
fn random_operators_without_negative_entries_are_accepted() {
    let mut numbers = Numbers(7);
    for round in 0..40 {
        let n = 3 + round % 20;
        let operators = (0..2 + round % 4).map(|_| numbers.stochastic(n, n, 6)).collect();
        let found = contraction(&iterated(operators));
        assert!(found.lower < 1.0 && found.upper < 1.0, "{round}: {} {}", found.lower, found.upper);
    }
}

/// No random product grows faster than the upper bound says, nor is any cycle's rate above it; and what is neither
/// accepted nor refused lies across 1.
#[test]
fn random_products_stay_below_the_bound() {
    let mut numbers = Numbers(11);
    let mut undecided = 0;
    for round in 0..60 {
        let n = 3 + round % 15;
        let operators: Vec<Columns> = (0..2 + round % 3).map(|_| numbers.signed(n, 0.35 + 0.01 * f64::from(round as u32))).collect();
        let found = contraction(&iterated(operators.clone()));
        undecided += usize::from(found.lower < 1.0 && found.upper >= 1.0);
        assert!(found.lower <= found.upper);
        let mut y: Vec<f64> = (0..n).map(|_| numbers.next() - 0.5).collect();
        let mean = y.iter().sum::<f64>() / n as f64;
        y.iter_mut().for_each(|x| *x -= mean);
        let (mut log, steps) = (0.0, 400);
        for _ in 0..steps {
            let columns = &operators[numbers.below(operators.len())];
            let mut image = vec![0.0; n];
            for (column, weight) in columns.iter().zip(&y) {
                image.iter_mut().zip(column).for_each(|(sum, x)| *sum += x * weight);
            }
            let size: f64 = image.iter().map(|x| x.abs()).sum();
            let before: f64 = y.iter().map(|x| x.abs()).sum();
            log += (size / before).ln();
            // Rounding leaves a sum, which would be kept while the rest shrinks.
            let mean = image.iter().sum::<f64>() / n as f64;
            y = image.iter().map(|x| (x - mean) / size).collect();
        }
        // |product| <= constant upper^k, with a constant of at most a few thousand.
        assert!(log / f64::from(steps) <= found.upper.ln() + 10.0 / f64::from(steps), "{round}: {log} {found:?}");
    }
    assert!(undecided <= 8, "{undecided} of 60");
}

/// Operators between states of different dimensions, states that nothing returns to, and states of dimension 1.
#[test]
fn rectangular_operators_and_transient_states() {
    // 0 (dimension 3) -> 1 (dimension 2) -> 0 : radius is the square root of the product's; 2 -> 0 with a large norm.
    let down: Columns = vec![vec![1.0, 0.0, 0.0], vec![0.0, 0.0, 1.0]];
    let up: Columns = vec![vec![1.0, 0.0], vec![0.5, 0.5], vec![0.4, 0.6]];
    let large: Columns = vec![vec![50.0, -49.0], vec![-20.0, 21.0], vec![1.0, 0.0]];
    let states = vec![(3, vec![(1, down)]), (2, vec![(0, up)]), (2, vec![(0, large)]), (1, vec![(3, vec![vec![1.0]])])];
    // Around: e_1 - e_0 -> e_2 - e_0 -> 0.6 (e_1 - e_0).
    holds(&automaton(states), 0.6f64.sqrt(), 0.03, "a cycle of two dimensions");
}

/// A million transitions: bounded time and memory, and an honest answer.
#[test]
fn a_million_transitions_end() {
    let mut numbers = Numbers(3);
    let mut operators = |count: usize, scale: f64| -> Vec<(usize, Columns)> {
        (0..count).map(|_| (numbers.below(1000), numbers.signed(3, scale))).collect()
    };
    let contracting = automaton((0..1000).map(|_| (3, operators(100, 0.2))).collect());
    let found = contraction(&contracting);
    assert!(found.lower <= found.upper && found.upper < 1.0, "{} {}", found.lower, found.upper);
    let hard = automaton((0..1000).map(|_| (3, operators(1000, 0.9))).collect());
    let found = contraction(&hard);
    assert!(found.lower > 0.5 && found.lower <= found.upper && found.upper.is_finite(), "{} {}", found.lower, found.upper);
}
