//! States of edges that draw the same curves.
//!
//! State s draws the curves of state t if there is an operator N with T^s_j N_j = N T^t_j for every child j, where N_j does
//! the same for the children: then the cell of s with control points P and that of t with P N have equal attractors, point
//! by point, since both are limits of the same products. N is found from limit points at dyadic parameters, which
//! determine it, and proven by these equations for all pairs of descendants. Every reference to s, of embedding or operator
//! X, is then replaced by one to t of X N. That keeps all constraints: if X T^s_j = Y for an edge and its child, then
//! X N T^t_j = X T^s_j N_j = Y N_j.

use super::limits::{Limits, Weights};
use crate::attractor::Gluing;
use crate::automaton::matrix::Dense;
use crate::automaton::topology::Topology;
use crate::automaton::{Automaton, StateId, SubdivisionOperator};
use crate::model::CellKind;
use crate::model::lower::Draft;
use std::collections::{BTreeMap, BTreeSet};

/// Entries may differ by this much: rounding of sums of a few products.
const ROUNDING: f64 = 1e-10;
/// Pairs of states looked at for one join.
const MOST_PAIRS: usize = 1 << 14;

/// What stands for a state: another, its control points in the state's space, and whether it runs the other way.
#[derive(Clone, Debug)]
struct Alias {
    to: StateId,
    change: SubdivisionOperator,
    reversed: bool,
    /// Which of its children stands for each of the state's; empty for vertices.
    children: Vec<usize>,
}

/// States and what replaces them.
pub(super) struct Kinds<'a> {
    limits: Limits<'a>,
    aliases: BTreeMap<StateId, Alias>,
    /// States of boundaries of which gluings name orders of control points, and these orders.
    ordered: BTreeMap<StateId, BTreeSet<Vec<usize>>>,
    /// States that models declare by the order of their control points.
    declared: BTreeSet<StateId>,
    /// Boundaries of roots that become one, and whether one is seen from its other end.
    glued: Vec<([(usize, usize); 2], bool)>,
}

impl<'a> Kinds<'a> {
    pub(super) fn new(automaton: &'a Automaton, topology: &'a Topology, draft: &Draft) -> Self {
        let (mut ordered, mut fixed) = (BTreeMap::<StateId, BTreeSet<Vec<usize>>>::new(), BTreeSet::new());
        for gluing in &draft.gluings {
            if let (Some(order), Some(state)) = (&gluing.permutation, boundary_state(draft, gluing.between[0])) {
                ordered.entry(state).or_default().insert(order.clone());
            }
        }
        for (state, declared) in automaton.states().iter().zip(&draft.declared) {
            for shared in declared.adjacencies.iter().filter(|shared| shared.permutation.is_some()) {
                let (child, boundary) = shared.between[0];
                let target = state.transitions.get(child).map(|transition| automaton.state(transition.to));
                fixed.extend(target.and_then(|target| target.boundaries.get(boundary)).map(|boundary| boundary.state));
            }
        }
        let limits = Limits { automaton, topology };
        Self { limits, aliases: BTreeMap::new(), ordered, declared: fixed, glued: Vec::new() }
    }

    pub(super) fn limits(&self) -> Limits<'a> {
        self.limits
    }

    /// The state that stands for another in the end, its control points in the other's space, and whether it runs the other
    /// way.
    fn resolve(&self, id: StateId) -> Alias {
        let state = self.limits.automaton.state(id);
        let change = SubdivisionOperator::identity(state.dimension);
        let mut end = Alias { to: id, change, reversed: false, children: (0..state.transitions.len()).collect() };
        while let Some(next) = self.aliases.get(&end.to) {
            let children = end.children.iter().filter_map(|&child| next.children.get(child).copied()).collect();
            end = Alias { to: next.to, change: end.change.times(&next.change), reversed: end.reversed != next.reversed, children };
        }
        end
    }

    /// Makes two boundaries of roots one; `turned`: seen from the other end. The error says why they cannot be.
    pub(super) fn glue(&mut self, between: [(usize, usize); 2], turned: bool, draft: &mut Draft) -> Result<(), String> {
        let states = between.map(|place| boundary_state(draft, place));
        let [Some(first), Some(second)] = states else { return Err("there is no such boundary".into()) };
        let [left, right] = [first, second].map(|id| self.resolve(id));
        if left.to != right.to {
            self.unite(left.to, right.to, turned ^ left.reversed ^ right.reversed)?;
        }
        let permutation = self.order([first, second], turned)?;
        let [left, right] = [(first, between[0]), (second, between[1])].map(|(id, (root, boundary))| {
            let root = &draft.roots[root];
            let incidence = &draft.states[root.state.index()].boundaries[boundary].incidence;
            placed(&root.points, &incidence.times(&self.resolve(id).change))
        });
        let other = |j: usize| right[permutation.as_ref().map_or(j, |order| order[j])];
        let apart = left.iter().enumerate().map(|(j, point)| point.distance(other(j))).fold(0.0, f64::max);
        draft.seam_mm = draft.seam_mm.max(apart);
        self.glued.push((between, turned));
        Ok(())
    }

    /// The order in which control points of the second boundary are those of the first, both in the state that stands for
    /// theirs; `None`: the same.
    fn order(&self, states: [StateId; 2], turned: bool) -> Result<Option<Vec<usize>>, String> {
        let [left, right] = states.map(|id| self.resolve(id));
        if turned == (left.reversed != right.reversed) {
            return Ok(None);
        }
        let order = self.change(left.to, left.to, true).as_ref().and_then(permutation);
        order.map(Some).ok_or_else(|| {
            let name = &self.limits.automaton.state(left.to).name;
            format!("they run in opposite directions, and state '{name}' reads otherwise backwards; reverse the control points of one part")
        })
    }

    /// Replaces one of two states, and its descendants, by the other.
    fn unite(&mut self, left: StateId, right: StateId, turned: bool) -> Result<(), String> {
        let state = |id: StateId| self.limits.automaton.state(id);
        // The one with fewer control points stays; then the one whose points are referred to by their order.
        let rank = |id: StateId| (state(id).dimension, !self.declared.contains(&id), !self.ordered.contains_key(&id), id);
        let (from, to) = if rank(left) > rank(right) { (left, right) } else { (right, left) };
        let before = self.aliases.clone();
        self.replace_all(from, to, turned).map_err(|pair| {
            self.aliases = before;
            let names = pair.map(|id| self.limits.automaton.state(id).name.clone());
            format!(
                "states '{}' and '{}' draw different kinds of curves (degrees, or knots that are no common parameters); use borders of \
                 one kind, or join them by a strip",
                names[0], names[1]
            )
        })
    }

    /// Enters aliases for a pair of states and all pairs of their descendants, and proves each; the pair that fails.
    fn replace_all(&mut self, from: StateId, to: StateId, turned: bool) -> Result<(), [StateId; 2]> {
        let mut waiting = vec![(from, to, turned)];
        let mut proven = Vec::new();
        while let Some((from, to, turned)) = waiting.pop() {
            let (left, right) = (self.resolve(from), self.resolve(to));
            let turned = turned ^ left.reversed ^ right.reversed;
            let (from, to) = (left.to, right.to);
            let failed = || [from, to];
            if from == to {
                // The same state, forwards or as its own mirror image.
                let mirror = turned.then(|| self.change(from, from, true));
                if mirror.is_some_and(|change| change.as_ref().and_then(permutation).is_none()) {
                    return Err(failed());
                }
                continue;
            }
            let state = |id: StateId| self.limits.automaton.state(id);
            let (from, to) = if state(from).dimension < state(to).dimension { (to, from) } else { (from, to) };
            let change = self.change(from, to, turned).ok_or_else(failed)?;
            if self.declared.contains(&from) {
                return Err(failed());
            }
            for order in self.ordered.get(&from).cloned().unwrap_or_default() {
                let order = reordered(&change, &order).ok_or_else(failed)?;
                self.ordered.entry(to).or_default().insert(order);
            }
            let children = [from, to].map(|id| self.limits.children(id).map(<[_]>::to_vec));
            let [Some(own), Some(mut other)] = children else { return Err(failed()) };
            if own.len() != other.len() {
                return Err(failed());
            }
            if turned {
                other.reverse();
            }
            let mut images = vec![0; own.len()];
            own.iter().zip(&other).for_each(|(&(child, _), &(image, _))| images[child] = image);
            self.aliases.insert(from, Alias { to, change, reversed: turned, children: images });
            proven.push((from, to, turned));
            if proven.len() > MOST_PAIRS {
                return Err(failed());
            }
            for (&(child, back), &(image, image_back)) in own.iter().zip(&other) {
                waiting.push((self.limits.child(from, child).0, self.limits.child(to, image).0, back ^ image_back ^ turned));
            }
        }
        proven.into_iter().try_for_each(|(from, to, turned)| self.prove(from, to, turned).then_some(()).ok_or([from, to]))
    }

    /// T^s_j N_j = N T^t_j, where both sides end in the state that stands for the children.
    fn prove(&self, from: StateId, to: StateId, turned: bool) -> bool {
        let Some(Alias { change, .. }) = self.aliases.get(&from) else { return false };
        let (Some(own), Some(other)) = (self.limits.children(from), self.limits.children(to)) else { return false };
        let count = own.len();
        own.iter().enumerate().all(|(k, &(child, _))| {
            let (image, _) = other[if turned { count - 1 - k } else { k }];
            let ((left, left_operator), (right, right_operator)) = (self.limits.child(from, child), self.limits.child(to, image));
            let (left, right) = (self.resolve(left), self.resolve(right));
            let (a, b) = (left_operator.times(&left.change), change.times(&right_operator.times(&right.change)));
            let straight = a.entries().iter().zip(b.entries()).all(|(x, y)| (x - y).abs() <= ROUNDING);
            let mirrored = || {
                let order = self.change(right.to, right.to, true).as_ref().and_then(permutation);
                order.is_some_and(|order| {
                    (0..order.len()).all(|j| a.column(j).iter().zip(b.column(order[j])).all(|(x, y)| (x - y).abs() <= ROUNDING))
                })
            };
            left.to == right.to && (straight || mirrored())
        })
    }

    /// N with (limit points of `from`) = N (limit points of `to`), the latter from the other end if `turned`.
    fn change(&self, from: StateId, to: StateId, turned: bool) -> Option<SubdivisionOperator> {
        let children = self.limits.children(to)?.len();
        let dimension = self.limits.automaton.state(to).dimension;
        // One point more than there are control points, so that what is found is tested too.
        let depth = (0..6).find(|&depth| children.saturating_pow(depth) > dimension)?;
        let own = self.limits.curve(from, depth)?;
        let mut other = self.limits.curve(to, depth)?;
        if turned {
            other.reverse();
        }
        fitted(&own, &other)
    }

    /// Rewrites the draft: boundaries are glued, and states that were replaced are referred to no more.
    pub(super) fn replace(mut self, draft: &mut Draft) -> Result<(), String> {
        self.reorder(draft);
        for &(between, turned) in &self.glued {
            let [Some(first), Some(second)] = between.map(|place| boundary_state(draft, place)) else { continue };
            draft.gluings.push(Gluing { between, permutation: self.order([first, second], turned)? });
        }
        if self.aliases.is_empty() {
            return Ok(());
        }
        // Ends of edges of different families are vertices of different states: all become single points.
        let point = draft.point_state();
        for (index, state) in self.limits.automaton.states().iter().enumerate() {
            if state.kind == Some(CellKind::Vertex) && index != point.index() {
                let limit = self.limits.topology.state(StateId::new(index)).limit.clone();
                let change = SubdivisionOperator::exact(limit.len(), limit);
                self.aliases.insert(StateId::new(index), Alias { to: point, change, reversed: false, children: Vec::new() });
            }
        }
        self.redeclare(draft);
        for index in 0..self.limits.automaton.states().len() {
            let state = &mut draft.states[index];
            let references = state.transitions.iter_mut().map(|t| (&mut t.to, &mut t.operator));
            for (to, operator) in references.chain(state.boundaries.iter_mut().map(|b| (&mut b.state, &mut b.incidence))) {
                if self.aliases.contains_key(to) {
                    let alias = self.resolve(*to);
                    (*operator, *to) = (operator.times(&alias.change), alias.to);
                }
            }
        }
        Ok(())
    }

    /// Declarations name children and ends of edges by their position, which may be another in what stands for the edge.
    fn redeclare(&self, draft: &mut Draft) {
        for (declared, state) in draft.declared.iter_mut().zip(self.limits.automaton.states()) {
            let end = |place: &mut (usize, usize)| {
                if place.1 < 2 && state.transitions.get(place.0).is_some_and(|child| self.resolve(child.to).reversed) {
                    place.1 = 1 - place.1;
                }
            };
            for (boundary, children) in &mut declared.incidences {
                children.iter_mut().for_each(end);
                let Some(boundary) = state.boundaries.get(*boundary) else { continue };
                let images = self.resolve(boundary.state).children;
                if images.len() == children.len() {
                    let before = children.clone();
                    images.into_iter().zip(before).for_each(|(image, place)| children[image] = place);
                }
            }
            declared.adjacencies.iter_mut().flat_map(|shared| &mut shared.between).for_each(end);
        }
    }

    /// Gluings that name an order of control points of a replaced state.
    fn reorder(&self, draft: &mut Draft) {
        for index in 0..draft.gluings.len() {
            let Some(state) = boundary_state(draft, draft.gluings[index].between[0]) else { continue };
            let alias = self.resolve(state);
            if let Some(order) = draft.gluings[index].permutation.as_mut().filter(|_| alias.to != state)
                && let Some(own) = reordered(&alias.change, order)
            {
                *order = own;
            }
        }
    }
}

fn boundary_state(draft: &Draft, (root, boundary): (usize, usize)) -> Option<StateId> {
    let state = &draft.states[draft.roots.get(root)?.state.index()];
    state.boundaries.get(boundary).map(|boundary| boundary.state)
}

/// Places of the columns of an operator, in mm.
pub(super) fn placed(points: &[[f64; 4]], operator: &SubdivisionOperator) -> Vec<glam::DVec3> {
    (0..operator.columns()).map(|j| place(points, operator.column(j))).collect()
}

/// The place of a point of a barycentric space, in mm.
pub(super) fn place(points: &[[f64; 4]], weights: &[f64]) -> glam::DVec3 {
    let sum = points.iter().zip(weights).map(|(point, &weight)| weight * glam::DVec4::from_array(*point)).sum::<glam::DVec4>();
    sum.truncate() / sum.w
}

/// The operator N with `own` = N `other`, column by column, if there is one.
pub(super) fn fitted(own: &[Weights], other: &[Weights]) -> Option<SubdivisionOperator> {
    let (rows, columns) = (own.first()?.len(), other.first()?.len());
    let dense = |points: &[Weights], rows: usize| Dense { rows, columns: points.len(), entries: points.concat() };
    let (left, right) = (dense(own, rows), dense(other, columns));
    let transposed = right.transpose();
    let inverse = right.times(&transposed).cholesky()?.inverse_upper();
    let inverse = inverse.times(&inverse.transpose());
    let product = left.times(&transposed).times(&inverse);
    // Entries of the schemes' changes are fractions of small denominators: rounding is taken back.
    let entries = product.entries.into_iter().map(|entry| {
        let fraction = (entry * 5040.0).round() / 5040.0;
        if (entry - fraction).abs() <= ROUNDING { fraction } else { entry }
    });
    let operator = SubdivisionOperator::exact(rows, entries.collect());
    let holds = |(own, other): (&Weights, &Weights)| operator.apply(other).iter().zip(own).all(|(x, y)| (x - y).abs() <= ROUNDING);
    own.iter().zip(other).all(holds).then_some(operator)
}

/// What an order of a state's control points is for those N that stand for them: if the first cell's points are the second's
/// in that order, P = Q R, then P N = Q R N, and R N has the columns of N in another order.
fn reordered(change: &SubdivisionOperator, order: &[usize]) -> Option<Vec<usize>> {
    let moved = |j: usize| {
        let mut column = vec![0.0; change.rows()];
        change.column(j).iter().zip(order).for_each(|(&entry, &row)| column[row] = entry);
        (0..change.columns()).find(|&k| change.column(k).iter().zip(&column).all(|(a, b)| (a - b).abs() <= ROUNDING))
    };
    if order.len() != change.rows() {
        return None;
    }
    (0..change.columns()).map(moved).collect()
}

/// The order of a permutation matrix: column j has its one in row `order[j]`.
fn permutation(operator: &SubdivisionOperator) -> Option<Vec<usize>> {
    let one = |j: usize| {
        let column = operator.column(j);
        let row = column.iter().position(|&x| x == 1.0)?;
        column.iter().enumerate().all(|(k, &x)| k == row || x == 0.0).then_some(row)
    };
    if operator.rows() != operator.columns() {
        return None;
    }
    let order: Vec<usize> = (0..operator.columns()).map(one).collect::<Option<_>>()?;
    let distinct: BTreeSet<usize> = order.iter().copied().collect();
    (distinct.len() == order.len()).then_some(order)
}
