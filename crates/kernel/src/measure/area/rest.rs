//! What cells that are no Bezier patches, but consist of such in the end, have of area at most: those around extraordinary vertices of subdivision surfaces.
//!
//! Let |P| be the largest |P y| over differences y of barycentric points whose adapted norm is 1 (`automaton::convergence`), P being the control points. For a child, |P T_e| <= |P| |T_e|.
//! Lengths of differences of control points are at most |P| times the norms of e_i - e_j, and |P| is at most half the largest of them times the largest |y|_1 / |y|. The area of a Bezier patch with points P H is
//! at most p q times the square of the largest difference of these points, derivatives being averages of p and q times such differences. So numbers C with
//!
//!   C_s >= p q max |H_i - H_j|^2 for patches, C_s >= sum over e: s -> w of |T_e|^2 C_w for others
//!
//! bound areas by C_s |P|^2, as far as a cell consists of patches at any depth. Where the system has a solution and every state leads to a patch, the squares of the diameters of all other cells
//! of a depth add up to less and less: what is left has no area. A solution is found from below, of a system that asks a little more, and tested.

use crate::attractor::{Attractor, BezierPatch};
use crate::automaton::StateId;
use crate::model::CellKind;

/// Rounds after which nothing changes where cells have a fifth less area than their parent, and the factor by which more is asked.
const ROUNDS: usize = 200;
const ENLARGED: f64 = 1.000_001;
/// Norms are rounded.
const ROUNDING: f64 = 1e-9;

/// For every state that roots reach and that is no patch, C times the square of half the largest |y|_1 / |y|: so often the square of the largest difference of two control points bounds the area of a cell. `None`
/// where a state is reached that is no face of patches.
pub(super) fn shares(attractor: &Attractor, patches: &[Option<BezierPatch>]) -> Option<Vec<Option<f64>>> {
    let automaton = attractor.automaton();
    let contraction = attractor.contraction();
    let mut constants: Vec<Option<f64>> = vec![None; patches.len()];
    let mut others = Vec::new();
    let unknown = |id: &StateId| patches[id.index()].is_none() && !super::is_triangle(attractor, *id);
    let mut waiting: Vec<StateId> = attractor.roots().iter().map(|root| root.state).filter(unknown).collect();
    waiting.sort_unstable();
    waiting.dedup();
    while let Some(id) = waiting.pop() {
        if constants[id.index()].is_some() {
            continue;
        }
        let state = automaton.state(id);
        constants[id.index()] = Some(0.0);
        if let Some(patch) = &patches[id.index()] {
            let columns = || (0..patch.points.columns()).map(|k| patch.points.column(k));
            let distances = columns().flat_map(|a| columns().map(move |b| contraction.distance(id, a, b)));
            let widest = distances.fold(0.0, f64::max);
            let [p, q] = patch.degrees;
            constants[id.index()] = Some((p * q) as f64 * widest * widest * (1.0 + ROUNDING));
            continue;
        }
        if state.kind != Some(CellKind::Face) || state.frame || !automaton.factors(id).is_empty() || state.transitions.is_empty() {
            return None;
        }
        others.push(id);
        waiting.extend(state.transitions.iter().map(|transition| transition.to));
    }
    let through = |constants: &[Option<f64>], id: StateId| {
        let steps = automaton.state(id).transitions.iter().zip(&contraction.step_norms[id.index()]);
        steps.map(|(step, norm)| norm * norm * constants[step.to.index()].unwrap_or(f64::INFINITY)).sum::<f64>() * (1.0 + ROUNDING)
    };
    for _ in 0..ROUNDS {
        others.iter().for_each(|&id| constants[id.index()] = Some(ENLARGED * through(&constants, id)));
    }
    let holds = |&id: &StateId| constants[id.index()].is_some_and(|own| own > 0.0 && own.is_finite() && through(&constants, id) <= own);
    if !others.iter().all(holds) {
        return None;
    }
    let share = |&id: &StateId| {
        let half = 0.5 * contraction.sum_norm_ratio(id);
        constants[id.index()].map(|constant| constant * half * half * (1.0 + ROUNDING))
    };
    let mut shares = vec![None; patches.len()];
    others.iter().for_each(|id| shares[id.index()] = share(id));
    Some(shares)
}
