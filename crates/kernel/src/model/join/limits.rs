//! Limit points of curves and quadrilaterals at dyadic parameters, as points of their barycentric spaces.

use crate::automaton::topology::{Topology, same};
use crate::automaton::{Automaton, StateId, SubdivisionOperator};

/// A point of a barycentric space.
pub(super) type Weights = Vec<f64>;

/// What is known of the states.
#[derive(Clone, Copy)]
pub(super) struct Limits<'a> {
    pub(super) automaton: &'a Automaton,
    pub(super) topology: &'a Topology,
}

impl Limits<'_> {
    /// The children of a curve in order, each with whether it runs backwards.
    pub(super) fn children(&self, id: StateId) -> Option<&[(usize, bool)]> {
        self.topology.state(id).chain.as_deref()
    }

    /// The child of a curve and its operator.
    pub(super) fn child(&self, id: StateId, child: usize) -> (StateId, &SubdivisionOperator) {
        let transition = &self.automaton.state(id).transitions[child];
        (transition.to, &transition.operator)
    }

    /// Points of a curve after so many subdivisions, from its first end to its last.
    pub(super) fn curve(&self, id: StateId, depth: u32) -> Option<Vec<Weights>> {
        let own = self.topology.state(id);
        let chain = own.chain.as_ref()?;
        if depth == 0 || chain.is_empty() {
            let ends = self.topology.ends(id)?;
            return Some(ends.map(|end| own.closure.cells[end].point.clone()).to_vec());
        }
        let mut points: Vec<Weights> = Vec::new();
        for &(child, backwards) in chain {
            let (to, operator) = self.child(id, child);
            let mut inner = self.curve(to, depth - 1)?;
            if backwards {
                inner.reverse();
            }
            let known = usize::from(!points.is_empty());
            points.extend(inner.iter().skip(known).map(|point| operator.apply(point)));
        }
        Some(points)
    }

    /// The corners of a quadrilateral, in order around it.
    pub(super) fn corners(&self, id: StateId) -> Option<[Weights; 4]> {
        let own = self.topology.state(id);
        let outline = own.outline.as_ref()?;
        let corner = |&(edge, backwards): &(usize, bool)| -> Option<Weights> {
            let cell = &own.closure.cells[edge];
            let ends = self.topology.ends(cell.state)?;
            Some(own.closure.cells[cell.cells[ends[usize::from(backwards)]].0].point.clone())
        };
        outline.iter().map(corner).collect::<Option<Vec<_>>>()?.try_into().ok()
    }

    /// Points of a quadrilateral after so many subdivisions: `grid[i][j]`, i from corner `order[0]` to `order[1]`, j from
    /// `order[0]` to `order[3]`. `None` if it is not made of four such quadrilaterals.
    pub(super) fn face(&self, id: StateId, order: [usize; 4], depth: u32) -> Option<Vec<Vec<Weights>>> {
        let corners = self.corners(id)?;
        let own = order.map(|corner| corners[corner].clone());
        if depth == 0 {
            let [a, b, c, d] = own;
            return Some(vec![vec![a, d], vec![b, c]]);
        }
        let children = &self.automaton.state(id).transitions;
        if children.len() != 4 {
            return None;
        }
        let mut placed: Vec<(&crate::automaton::Transition, [Weights; 4])> = Vec::with_capacity(4);
        for child in children {
            placed.push((child, self.corners(child.to)?.map(|corner| child.operator.apply(&corner))));
        }
        // The child at every corner, and which of its corners that is.
        let at = own.each_ref().map(|corner| {
            let find =
                |(child, (_, corners)): (usize, &(_, [Weights; 4]))| Some((child, corners.iter().position(|own| same(own, corner))?));
            placed.iter().enumerate().find_map(find)
        });
        let half = 1 << (depth - 1);
        let mut grid = vec![vec![Weights::new(); 2 * half + 1]; 2 * half + 1];
        for quadrant in 0..4 {
            let (child, corner) = at[quadrant]?;
            let (next, _) = at[(quadrant + 1) % 4]?;
            let (transition, corners) = &placed[child];
            let shares = |step: usize| placed[next].1.iter().any(|other| same(other, &corners[(corner + step) % 4]));
            let step = [1, 3].into_iter().find(|&step| shares(step))?;
            let mut inner = [0; 4];
            for turn in 0..4 {
                inner[(quadrant + turn) % 4] = (corner + step * turn) % 4;
            }
            let points = self.face(transition.to, inner, depth - 1)?;
            let (first_i, first_j) = (half * usize::from(quadrant == 1 || quadrant == 2), half * usize::from(quadrant >= 2));
            for (i, row) in points.iter().enumerate() {
                for (j, point) in row.iter().enumerate() {
                    grid[first_i + i][first_j + j] = transition.operator.apply(point);
                }
            }
        }
        Some(grid)
    }
}
