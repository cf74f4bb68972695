//! Shapes of the benches, as attractors, and the same by hand.

use super::automata::{Columns, corner_cutting, cubic, tensor};
use super::unrolled::{Bicubic, Biquadratic, Homothetic, corners, curve, face, homotheties};
use lacuna_kernel::attractor::cell::Point;
use lacuna_kernel::attractor::{Attractor, Root};
use lacuna_kernel::automaton::{Automaton, Ends, LeafPrimitive, State, StateId, SubdivisionOperator, Transition};

/// One state with these operators and this primitive, on these points.
pub fn single(operators: Vec<Columns>, leaf: LeafPrimitive, points: &[Point], frame: bool) -> Attractor {
    let dimension = points.len();
    let transition = |(label, columns): (usize, Columns)| {
        let (operator, _) = SubdivisionOperator::from_columns(dimension, columns.concat()).unwrap();
        Transition { to: StateId::new(0), operator, label }
    };
    let transitions = operators.into_iter().enumerate().map(transition).collect();
    let state = State { name: "cell".into(), kind: None, dimension, transitions, boundaries: Vec::new(), leaf, frame };
    let points = points.iter().map(|p| [p[0], p[1], p[2], 1.0]).collect();
    let root = Root { state: StateId::new(0), points, rational: false, solid: None };
    Attractor::new(Automaton::new(vec![state]).unwrap(), vec![root], Vec::new(), Vec::new()).unwrap()
}

/// Control points of a square grid of `n` x `n` over 100 mm, wavy.
pub fn net<const N: usize>(n: usize) -> [Point; N] {
    std::array::from_fn(|i| {
        let (x, y) = ((i / n) as f64, (i % n) as f64);
        [100.0 * x / (n - 1) as f64, 100.0 * y / (n - 1) as f64, 20.0 * (1.3 * x + 0.7 * y * y).sin()]
    })
}

/// A shape and the loop by hand that counts its leaves to a tolerance in mm.
pub struct Pair {
    /// What it is.
    pub name: &'static str,
    /// For the kernel.
    pub attractor: Attractor,
    /// To what tolerance.
    pub tolerance: f64,
    /// By hand.
    pub by_hand: Box<dyn Fn(f64) -> u64>,
}

const FRAME: [Point; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Four homotheties of ratio 1/2 towards the corners of a tetrahedron of 100 mm, on an affine frame.
fn tetrahedron() -> Pair {
    let depth = 50.0 * 3f64.sqrt();
    let height = 100.0 * (2.0 / 3.0f64).sqrt();
    let targets = [[0.0; 3], [100.0, 0.0, 0.0], [50.0, depth, 0.0], [50.0, depth / 3.0, height]];
    let maps: [[[f64; 4]; 4]; 4] = targets.map(|target| {
        let image = |corner: Point| {
            let x: Point = std::array::from_fn(|axis| 0.5 * (corner[axis] + target[axis]));
            [1.0 - x[0] - x[1] - x[2], x[0], x[1], x[2]]
        };
        FRAME.map(image)
    });
    let operators = maps.iter().map(|map| map.iter().map(|column| column.to_vec()).collect()).collect();
    let attractor = single(operators, LeafPrimitive::Centre, &FRAME, true);
    let ball = attractor.root_cell(0).ball;
    let by_hand = move |tolerance: f64| {
        let mut leaves = 0;
        let cell = Homothetic { centre: ball.centre, radius: ball.radius, ratio: 0.5, tolerance };
        homotheties(&FRAME, 1.0, &maps, &cell, &mut leaves);
        leaves
    };
    Pair { name: "4 (similarities)", attractor, tolerance: 0.02, by_hand: Box::new(by_hand) }
}

fn quadratic() -> Pair {
    let points = [[0.0; 3], [50.0, 80.0, 10.0], [100.0, 0.0, 0.0]];
    let ends = Ends { start: vec![0.5, 0.5, 0.0], end: vec![0.0, 0.5, 0.5] };
    let attractor = single(corner_cutting(0.25, 0.25), LeafPrimitive::Chord(ends), &points, false);
    let by_hand = move |tolerance: f64| {
        let mut leaves = 0;
        curve(&points, tolerance, &mut leaves);
        leaves
    };
    Pair { name: "3 (quadratic curve)", attractor, tolerance: 2e-5, by_hand: Box::new(by_hand) }
}

fn biquadratic() -> Pair {
    let points = net::<9>(3);
    let weights: [[f64; 9]; 4] = corners([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5]]);
    let curve = corner_cutting(0.25, 0.25);
    let leaf = LeafPrimitive::Polygon(weights.iter().map(|corner| corner.to_vec()).collect());
    let by_hand = move |tolerance: f64| {
        let mut leaves = 0;
        face::<Biquadratic, 9>(&points, &weights, tolerance, &mut leaves);
        leaves
    };
    Pair {
        name: "9 (biquadratic face)",
        attractor: single(tensor(&curve, &curve), leaf, &points, false),
        tolerance: 0.15,
        by_hand: Box::new(by_hand),
    }
}

fn bicubic() -> Pair {
    let points = net::<16>(4);
    let weights: [[f64; 16]; 4] = corners([[1.0, 4.0, 1.0, 0.0].map(|x| x / 6.0), [0.0, 1.0, 4.0, 1.0].map(|x| x / 6.0)]);
    let leaf = LeafPrimitive::Polygon(weights.iter().map(|corner| corner.to_vec()).collect());
    let by_hand = move |tolerance: f64| {
        let mut leaves = 0;
        face::<Bicubic, 16>(&points, &weights, tolerance, &mut leaves);
        leaves
    };
    Pair {
        name: "16 (bicubic face)",
        attractor: single(tensor(&cubic(), &cubic()), leaf, &points, false),
        tolerance: 0.3,
        by_hand: Box::new(by_hand),
    }
}

/// All shapes.
pub fn pairs() -> Vec<Pair> {
    vec![tetrahedron(), quadratic(), biquadratic(), bicubic()]
}
