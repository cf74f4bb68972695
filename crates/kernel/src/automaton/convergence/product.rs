//! Convergence of products from that of their factors.
//!
//! A cell of a product state is one cell per factor, and all factors subdivide at every step, in every combination. Let
//! A and B be products of operators along one path of either factor, and T = A x B the Kronecker product. Columns sum to
//! 1, so (1 x I) T = B (1 x I) and (I x 1) T = A (I x 1): a zero-sum x of the product has the zero-sum *marginals*
//! u = (I x 1) x and v = (1 x I) x, and these are mapped by A and B. Choose a point c of every state of a factor. Then
//! x = u x c_B + c_A x v + w, and w, whose marginals vanish, lies in V_A x V_B. From A u x B c' etc. one reads off
//!
//! u -> A u,  v -> B v,  w -> (A x B) w + A u x (B c'_B - c_B) + (A c'_A - c_A) x B v,
//!
//! c' being the points of the states where the paths end. So T restricted to V is block triangular with the blocks A|V,
//! B|V and A|V x B|V, and the path-constrained joint spectral radius of the product is the largest of rho_A, rho_B and at
//! most rho_A rho_B: where the factors converge, max(rho_A, rho_B). The marginals give the lower bound.
//!
//! The norm. With the factors' norms |C_A u| and |C_B v|, whose Kronecker product is a cross norm, and some delta > 0,
//! |x|^2 = |C_A u|^2 + |C_B v|^2 + delta^2 |(C_A x C_B) w|^2. Let a, b be the norms of A, B and p = |A c'_A - c_A|,
//! q = |B c'_B - c_B|. Then |T x| is at most the norm of the matrix with the rows (a, 0, 0), (0, b, 0) and
//! (delta a q, delta b p, a b) applied to (|u|, |v|, delta |w|), hence
//!
//! |T| <= max(a, b, a b) + delta |(a q, b p)|.                                                        (1)
//!
//! For single steps, (1) is the norm of a step. Along a path of length k let a, b <= t r^k with one r < 1; p is at most
//! p_1 (1 + t r + t r^2 + ..) <= t p_1 / (1 - r), p_1 being the largest of single steps. Then
//! |T| <= (t_A t_B + delta sqrt(2) max(t_A q_1 t_B, t_B p_1 t_A) / (1 - r)) r^k, as t_A, t_B >= 1.    (2)
//!
//! More factors are products of products; nothing above asks that C is a matrix.

use super::ellipsoid::AdaptedNorm;
use super::{Automaton, Contraction, LEAST_RATE, StateId};

/// The share by which delta may lengthen a step.
const EXCESS: f64 = 0.01;
/// Covers the rounding of what is computed from the factors' norms.
const SLACK: f64 = 1.0 + 1e-9;

/// The norm on the zero-sum space of a state.
#[derive(Clone, Debug)]
pub(super) enum StateNorm {
    Ellipsoid(AdaptedNorm),
    Product(Box<ProductNorm>),
}

/// See the module's comment.
#[derive(Clone, Debug)]
pub(super) struct ProductNorm {
    left: StateNorm,
    right: StateNorm,
    /// c of either.
    centres: [Vec<f64>; 2],
    delta: f64,
}

impl StateNorm {
    /// The factor's own, where the state is none.
    pub(super) fn ellipsoid(&self) -> Option<&AdaptedNorm> {
        match self {
            Self::Ellipsoid(norm) => Some(norm),
            Self::Product(_) => None,
        }
    }

    /// |x| of a zero-sum vector.
    pub(super) fn length(&self, x: &[f64]) -> f64 {
        match self {
            Self::Ellipsoid(norm) => norm.length(&x[1..]),
            Self::Product(_) => self.coordinates(x).iter().map(|y| y * y).sum::<f64>().sqrt(),
        }
    }

    /// C x: coordinates in which the norm is the Euclidean one.
    fn coordinates(&self, x: &[f64]) -> Vec<f64> {
        match self {
            Self::Ellipsoid(norm) => {
                let factor = &norm.factor;
                (0..factor.rows).map(|row| (row..factor.columns).map(|k| factor.at(row, k) * x[k + 1]).sum()).collect()
            }
            Self::Product(product) => product.coordinates(x),
        }
    }

    /// C^-1 y, a zero-sum vector.
    fn vector(&self, y: &[f64]) -> Vec<f64> {
        match self {
            Self::Ellipsoid(norm) => {
                let inverse = &norm.inverse;
                let mut x = vec![0.0; inverse.rows + 1];
                for row in 0..inverse.rows {
                    x[row + 1] = (row..inverse.columns).map(|k| inverse.at(row, k) * y[k]).sum();
                }
                x[0] = -x[1..].iter().sum::<f64>();
                x
            }
            Self::Product(product) => product.vector(y),
        }
    }

    /// Number of control points.
    fn points(&self) -> usize {
        match self {
            Self::Ellipsoid(norm) => norm.factor.rows + 1,
            Self::Product(product) => product.left.points() * product.right.points(),
        }
    }

    pub(super) fn unit_ball(&self) -> Vec<Vec<f64>> {
        let count = self.points() - 1;
        let column = |j: usize| {
            let mut unit = vec![0.0; count];
            unit[j] = 1.0;
            self.vector(&unit)[1..].to_vec()
        };
        (0..count).map(column).collect()
    }

    /// A bound of |x|_1 / |x|: from x = u x c_B + c_A x v + w, as |w|_1 is at most the product of the factors' ratios
    /// times |(C_A x C_B) w|.
    pub(super) fn sum_ratio(&self) -> f64 {
        match self {
            Self::Ellipsoid(norm) => norm.sum_ratio(),
            Self::Product(product) => {
                let sum = |k: usize| product.centres[k].iter().map(|x| x.abs()).sum::<f64>();
                let (a, b) = (product.left.sum_ratio(), product.right.sum_ratio());
                let parts = [a * sum(1), b * sum(0), a * b / product.delta];
                parts.iter().map(|part| part * part).sum::<f64>().sqrt() * SLACK
            }
        }
    }
}

impl ProductNorm {
    fn coordinates(&self, x: &[f64]) -> Vec<f64> {
        let n = self.right.points();
        let rows: Vec<&[f64]> = x.chunks_exact(n).collect();
        let u: Vec<f64> = rows.iter().map(|row| row.iter().sum()).collect();
        let v: Vec<f64> = (0..n).map(|j| rows.iter().map(|row| row[j]).sum()).collect();
        let [a, b] = &self.centres;
        // Right coordinates of the rows of w, then left ones of what comes out.
        let half: Vec<Vec<f64>> = rows
            .iter()
            .zip(&u)
            .zip(a)
            .map(|((row, u), a)| {
                let rest: Vec<f64> = (0..n).map(|j| row[j] - u * b[j] - a * v[j]).collect();
                self.right.coordinates(&rest)
            })
            .collect();
        let mut y = self.left.coordinates(&u);
        y.extend(self.right.coordinates(&v));
        for j in 0..n - 1 {
            let column: Vec<f64> = half.iter().map(|row| row[j]).collect();
            y.extend(self.left.coordinates(&column).into_iter().map(|entry| self.delta * entry));
        }
        y
    }

    fn vector(&self, y: &[f64]) -> Vec<f64> {
        let (m, n) = (self.left.points(), self.right.points());
        let (first, rest) = y.split_at(m - 1);
        let (second, third) = rest.split_at(n - 1);
        let (u, v) = (self.left.vector(first), self.right.vector(second));
        let columns: Vec<Vec<f64>> = third.chunks_exact(m - 1).map(|column| self.left.vector(column)).collect();
        let [a, b] = &self.centres;
        let mut x = Vec::with_capacity(m * n);
        for i in 0..m {
            let row: Vec<f64> = columns.iter().map(|column| column[i] / self.delta).collect();
            let row = self.right.vector(&row);
            x.extend((0..n).map(|j| row[j] + u[i] * b[j] + a[i] * v[j]));
        }
        x
    }
}

/// What is known of a product of some factors while it is made of one after the other.
struct Part {
    norm: StateNorm,
    centre: Vec<f64>,
    transient: f64,
    /// The largest |T c' - c| of any state's step.
    farthest: f64,
    /// For every transition: the norm of the step, and |T c' - c|.
    steps: Vec<[f64; 2]>,
}

/// What the search of the states that are no products says of all states; `own` are these, in order.
pub(super) fn extended(automaton: &Automaton, own: &[StateId], found: Contraction) -> Contraction {
    let count = automaton.states().len();
    let mut place = vec![usize::MAX; count];
    own.iter().enumerate().for_each(|(position, id)| place[id.index()] = position);
    let rate = found.upper.max(LEAST_RATE);
    let centres: Vec<Vec<f64>> = own.iter().map(|&id| middle(automaton.state(id).dimension)).collect();
    let steps_of = |id: StateId| -> Vec<[f64; 2]> {
        let position = place[id.index()];
        let step = |(index, transition): (usize, &super::super::Transition)| {
            let image = transition.operator.apply(&centres[place[transition.to.index()]]);
            let off: Vec<f64> = image.iter().zip(&centres[position]).map(|(x, c)| x - c).collect();
            [found.step_norms[position][index], found.norms[position].length(&off) * SLACK]
        };
        automaton.state(id).transitions.iter().enumerate().map(step).collect()
    };
    let is_factor = |id: &&StateId| (0..count).any(|index| automaton.factors(StateId::new(index)).contains(id));
    let farthest = own.iter().filter(is_factor).flat_map(|&id| steps_of(id)).map(|[_, off]| off).fold(0.0, f64::max);
    let part = |id: StateId| {
        let position = place[id.index()];
        let (norm, centre) = (found.norms[position].clone(), centres[position].clone());
        Part { norm, centre, transient: found.transient, farthest, steps: steps_of(id) }
    };
    // One delta for all: steps lead from state to state.
    let delta = if farthest > 0.0 { EXCESS / farthest } else { 1.0 };
    let joint = Joint { rate, delta };
    let mut norms = vec![None; count];
    let mut step_norms = vec![Vec::new(); count];
    let mut transient = found.transient;
    for index in 0..count {
        let factors = automaton.factors(StateId::new(index));
        let known = factors.iter().map(|&id| part(id)).reduce(|left, right| joint.product(left, right));
        if let Some(product) = known {
            step_norms[index] = product.steps.iter().map(|step| step[0]).collect();
            transient = transient.max(product.transient);
            norms[index] = Some(product.norm);
        }
    }
    let Contraction { lower, upper, cycle, depth, norms: known, step_norms: steps, .. } = found;
    for ((id, norm), steps) in own.iter().zip(known).zip(steps) {
        norms[id.index()] = Some(norm);
        step_norms[id.index()] = steps;
    }
    let cycle = (own.get(cycle.0.index()).copied().unwrap_or(cycle.0), cycle.1);
    let norms = norms.into_iter().map(|norm| norm.expect("every state is a product or none")).collect();
    Contraction { lower, upper, cycle, depth, transient, norms, step_norms }
}

fn middle(dimension: usize) -> Vec<f64> {
    vec![1.0 / dimension as f64; dimension]
}

/// What all products have in common.
struct Joint {
    rate: f64,
    delta: f64,
}

impl Joint {
    fn product(&self, left: Part, right: Part) -> Part {
        let delta = self.delta;
        // T c' - c of a product has the marginals of its factors', and w is their product.
        let off = |p: f64, q: f64| p.hypot(q).hypot(delta * p * q) * SLACK;
        let mut steps = Vec::with_capacity(left.steps.len() * right.steps.len());
        for &[a, p] in &left.steps {
            for &[b, q] in &right.steps {
                // (1)
                let norm = a.max(b).max(a * b) + delta * (a * q).hypot(b * p);
                steps.push([norm * SLACK, off(p, q)]);
            }
        }
        let (a, b) = (left.transient, right.transient);
        let farthest = left.farthest.max(right.farthest);
        // (2)
        let transient = if self.rate < 1.0 {
            a * b * (1.0 + delta * std::f64::consts::SQRT_2 * farthest / (1.0 - self.rate)) * SLACK
        } else {
            f64::INFINITY
        };
        let mut centre = Vec::with_capacity(left.centre.len() * right.centre.len());
        left.centre.iter().for_each(|x| centre.extend(right.centre.iter().map(|y| x * y)));
        let norm =
            StateNorm::Product(Box::new(ProductNorm { left: left.norm, right: right.norm, centres: [left.centre, right.centre], delta }));
        Part { norm, centre, transient, farthest: off(left.farthest, right.farthest), steps }
    }
}
