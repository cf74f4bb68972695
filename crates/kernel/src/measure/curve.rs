//! What is known of dimensions where cells are proven to be curves, or products of curves.
//!
//! *From below*: a connected set that is no point has dimension 1 at least.
//!
//! *From above*: let the length of a cell be l = sum of w_i |P_(i+1) - P_i| over its control points P in their order, with weights w_i > 0 of its state; its diameter is at
//! most a multiple of it. A child's side is a sum of c_i (P_(i+1) - P_i), and so the lengths of all children are at most L l together when for every side i the sum of |c_i| w'
//! over all children's sides, w' being theirs, is at most L w_i. Then the cells at level n have lengths below a multiple of L^n together, and each is shorter than a multiple
//! of rate^n. They are a chain of curves, and chains that are no longer than d lie in a ball whose radius is a multiple of d: so a multiple of L^n / d + 1 balls is enough, with
//! n such that rate^n is a multiple of d. Hence the upper box dimension of the curve is at most 1 + ln L / -ln rate, where L >= 1; cutting corners never makes polygons longer.
//! The least L is the spectral radius of the sums as a matrix, approached by Collatz's and Wielandt's quotients, which bound it from above for all weights.
//!
//! A product of curves is a Lipschitz image of the product of the factors in their barycentric spaces, of dimension at most the sum of theirs.

use crate::automaton::{Automaton, LeafPrimitive, StateId};

/// Entries of the matrix at most.
const MOST_ENTRIES: usize = 200_000;
/// Steps towards the best weights.
const STEPS: usize = 200;

/// Whether a state is proven to be connected: a curve, one that branches, or a product of such.
pub(super) fn is_connected(automaton: &Automaton, id: StateId) -> bool {
    let factors = automaton.factors(id);
    let is_curve = matches!(automaton.state(id).leaf, LeafPrimitive::Chord(_) | LeafPrimitive::Star(_));
    is_curve || !factors.is_empty() && factors.iter().all(|&factor| is_connected(automaton, factor))
}

/// A bound of ln L of the module's comment, not negative, for states that lead to no others; `None` where they are not all curves, or too many.
pub(super) fn lengthening(automaton: &Automaton, reached: &[StateId]) -> Option<f64> {
    let is_curve = |id: &StateId| automaton.state(*id).dimension > 1 && matches!(automaton.state(*id).leaf, LeafPrimitive::Chord(_));
    if !reached.iter().all(is_curve) {
        return None;
    }
    let sides = Sides::new(automaton, reached)?;
    let mut weights = vec![1.0_f64; sides.rows.len()];
    let mut least = f64::INFINITY;
    for _ in 0..STEPS {
        let (next, quotient) = sides.step(&weights);
        least = least.min(quotient);
        let largest = next.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        // A little of the old keeps every weight positive.
        weights = next.iter().zip(&weights).map(|(next, old)| (next / largest + old * 1e-3).max(1e-300)).collect();
    }
    Some(least.max(1.0).ln())
}

/// The sides of the control polygons of all states.
struct Sides {
    /// For every side of a parent, the sides of its children, the sizes of their shares c, and what rounding takes from those at most.
    rows: Vec<Vec<(usize, f64, f64)>>,
}

impl Sides {
    fn new(automaton: &Automaton, reached: &[StateId]) -> Option<Self> {
        let mut first = vec![0; automaton.states().len()];
        let mut count = 0;
        for id in reached {
            first[id.index()] = count;
            count += automaton.state(*id).dimension - 1;
        }
        let mut rows = vec![Vec::new(); count];
        let mut entries = 0;
        for &id in reached {
            let state = automaton.state(id);
            for transition in &state.transitions {
                let operator = &transition.operator;
                entries += (operator.columns() - 1) * (state.dimension - 1);
                if entries > MOST_ENTRIES {
                    return None;
                }
                for column in 1..operator.columns() {
                    let child = first[transition.to.index()] + column - 1;
                    let (mut share, mut size) = (0.0_f64, 0.0_f64);
                    for (side, (from, to)) in
                        operator.column(column - 1).iter().zip(operator.column(column)).take(state.dimension - 1).enumerate()
                    {
                        share += from - to;
                        size += from.abs() + to.abs();
                        // One difference and a sum for every entry.
                        rows[first[id.index()] + side].push((child, share.abs(), state.dimension as f64 * f64::EPSILON * size));
                    }
                }
            }
        }
        Some(Self { rows })
    }

    /// The matrix times the weights, and a bound of the largest quotient of what comes out and what went in.
    fn step(&self, weights: &[f64]) -> (Vec<f64>, f64) {
        let mut largest = 0.0_f64;
        let next = self.rows.iter().zip(weights).map(|(row, own)| {
            let (sum, lost) = row
                .iter()
                .fold((0.0, 0.0), |(sum, lost), &(child, share, error)| (sum + share * weights[child], lost + error * weights[child]));
            // As many products and sums as there are terms, and the quotient.
            let rounding = (2 * row.len() + 4) as f64 * f64::EPSILON;
            largest = largest.max((sum + lost) / own * (1.0 + rounding));
            sum
        });
        (next.collect(), largest)
    }
}
