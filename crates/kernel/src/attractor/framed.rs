//! Affine frames instead of control points: the same attractor by states of which few points stand for cells, as [`super::cover`] tells.
//!
//! A cell with n <= 4 control points p_0 .. p_(n-1) has its attractor in what is affine in these. With 4 - n more points, p_0 + e_j for vectors e_j across the others, they are a frame (o, o + e_1, ...) of space, in which the attractor has none of the e_j:
//! so where a child has them does not matter. They shrink by as much as the cell does, so that what is a similarity stays one.

use super::sites::used;
use super::{Attractor, Root};
use crate::automaton::{Automaton, LeafPrimitive, State, StateId, SubdivisionOperator, Transition};
use glam::{DMat3, DVec3};

/// Points of a frame.
const FRAME: usize = 4;

impl Attractor {
    /// Whether it has frames, as cells have no more control points than these, nor weights, and are not finite, and roots are no more than themselves: no solids, not trimmed, without radii of their own.
    pub(crate) fn has_frames(&self) -> bool {
        let has_few_points = |&index: &usize| {
            let state = &self.automaton.states()[index];
            !state.frame && (2..=FRAME).contains(&state.dimension) && !state.transitions.is_empty()
        };
        let are_plain = self.solids.is_empty() && self.trimmed.is_empty() && !self.has_own_radii();
        are_plain && self.roots.iter().all(|root| !root.rational) && used(self).iter().all(has_few_points)
    }

    /// The same attractor by frames, if it has some.
    pub(crate) fn framed(&self) -> Option<Self> {
        if !self.has_frames() {
            return None;
        }
        let (states, used) = (self.automaton.states(), used(self));
        let place = |state: StateId| used.binary_search(&state.index()).ok().map(StateId::new);
        let framed = |&index: &usize| {
            let state = &states[index];
            let follow = |transition: &Transition| {
                Some(Transition { to: place(transition.to)?, operator: of_frames(&transition.operator), ..transition.clone() })
            };
            let transitions = state.transitions.iter().map(follow).collect::<Option<_>>()?;
            let (name, kind, leaf) = (state.name.clone(), state.kind, LeafPrimitive::Centre);
            Some(State { name, kind, dimension: FRAME, transitions, boundaries: Vec::new(), leaf, frame: true })
        };
        let automaton = Automaton::new(used.iter().map(framed).collect::<Option<_>>()?).ok()?;
        let root = |root: &Root| Some(Root { state: place(root.state)?, points: frame_of(&root.points), rational: false, solid: None });
        let roots = self.roots.iter().map(root).collect::<Option<_>>()?;
        Self::new(automaton, roots, Vec::new(), Vec::new()).ok()
    }
}

/// The operator on frames. Columns are points of the child's frame by those of the parent's.
fn of_frames(operator: &SubdivisionOperator) -> SubdivisionOperator {
    let (rows, columns) = (operator.rows(), operator.columns());
    let linear = DMat3::from_cols_array_2d(&std::array::from_fn(|column| {
        std::array::from_fn(|row| {
            let entry = |column: usize| if row + 1 < rows { operator.entry(row + 1, column) } else { 0.0 };
            match column + 1 < columns {
                true => entry(column + 1) - entry(0),
                // What is across has a length of its own.
                false => f64::from(u8::from(row == column)),
            }
        })
    }));
    // Of a cell and a child with as many control points this is how much less it has of what they span; others have lengths that differ anyway.
    let ratio = linear.determinant().abs().powf(1.0 / (columns.max(2) - 1) as f64).min(MOST_RATIO);
    let mut entries = Vec::with_capacity(FRAME * FRAME);
    for column in 0..FRAME {
        let inner = if column < columns { column } else { 0 };
        let mut own: [f64; FRAME] = std::array::from_fn(|row| if row < rows { operator.entry(row, inner) } else { 0.0 });
        if column >= columns {
            own[0] -= ratio;
            own[column] += ratio;
        }
        entries.extend(own);
    }
    SubdivisionOperator::exact(FRAME, entries)
}

/// What is across shrinks at least by this.
const MOST_RATIO: f64 = 0.9;

/// Control points, and others across what they span, about as far from the first as they are.
fn frame_of(points: &[[f64; 4]]) -> Vec<[f64; 4]> {
    let at = |point: &[f64; 4]| DVec3::new(point[0], point[1], point[2]);
    let origin = at(&points[0]);
    let mut ways: Vec<DVec3> = points[1..].iter().map(|point| at(point) - origin).collect();
    let size = ways.iter().map(|way| way.length()).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    while ways.len() + 1 < FRAME {
        let along = ways.iter().copied().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared())).unwrap_or(DVec3::X);
        let normal = if ways.len() == 2 { ways[0].cross(ways[1]).normalize_or_zero() } else { DVec3::ZERO };
        let across = if normal == DVec3::ZERO { along.normalize_or(DVec3::X).any_orthonormal_vector() } else { normal };
        ways.push(size * across);
    }
    std::iter::once(origin).chain(ways.into_iter().map(|way| origin + way)).map(|point| point.extend(1.0).to_array()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::cell::distance_squared;
    use crate::budget::Budget;
    use crate::measure::bounds::bounding_box;
    use crate::split_mix::Random;

    /// Operators by rows, and control points.
    type Example = (Vec<Vec<f64>>, Vec<[f64; 4]>);

    /// Operators of a dragon, of a Takagi curve, of Cantor's set and of a curve in space.
    fn models() -> Vec<Example> {
        let dragon = vec![vec![1.0, 0.0, 1.0, 0.0, 0.5, -0.5, 0.0, 0.5, 0.5], vec![0.0, 0.0, 1.0, 1.0, 0.5, 0.5, 0.0, 0.5, -0.5]];
        let takagi = vec![vec![1.0, 0.0, 0.5, 0.0, 0.5, 0.0, 0.0, 0.5, 0.5], vec![0.0, 0.0, -0.5, 0.5, 1.0, 0.5, 0.5, 0.0, 1.0]];
        let cantor = vec![vec![1.0, 2.0 / 3.0, 0.0, 1.0 / 3.0], vec![1.0 / 3.0, 0.0, 2.0 / 3.0, 1.0]];
        let space = vec![
            vec![1.0, 0.5, 0.5, 0.4, 0.0, 0.5, 0.0, 0.2, 0.0, 0.0, 0.5, 0.2, 0.0, 0.0, 0.0, 0.2],
            vec![0.2, 0.5, 0.0, 0.0, 0.2, 0.5, 0.5, 0.0, 0.2, 0.0, 0.5, 0.5, 0.4, 0.0, 0.0, 0.5],
        ];
        let at = |x: f64, y: f64, z: f64| [x, y, z, 1.0];
        vec![
            (dragon.clone(), vec![at(0.0, 0.0, 2.0), at(10.0, 0.0, 2.0), at(0.0, 10.0, 2.0)]),
            // Control points on a line, and all in one place.
            (dragon.clone(), vec![at(0.0, 0.0, 2.0), at(10.0, 0.0, 2.0), at(5.0, 0.0, 2.0)]),
            (dragon, vec![at(1.0, 2.0, 3.0); 3]),
            (takagi, vec![at(0.0, 1.0, 0.0), at(10.0, 1.0, 0.0), at(0.0, 8.0, 7.0)]),
            (cantor, vec![at(0.0, 1.0, 5.0), at(10.0, 1.0, -3.0)]),
            (space, vec![at(0.0, 0.0, 0.0), at(10.0, 0.0, 0.0), at(0.0, 10.0, 1.0), at(1.0, 1.0, 10.0)]),
        ]
    }

    fn lowered((operators, points): Example) -> Attractor {
        let count = points.len();
        let columns = |rows: &Vec<f64>| (0..count * count).map(|k| rows[k % count * count + k / count]).collect();
        let transition = |(label, rows): (usize, &Vec<f64>)| Transition {
            to: StateId::new(0),
            operator: SubdivisionOperator::exact(count, columns(rows)),
            label,
        };
        let state = State {
            name: "cell".into(),
            kind: None,
            dimension: count,
            transitions: operators.iter().enumerate().map(transition).collect(),
            boundaries: Vec::new(),
            leaf: LeafPrimitive::Centre,
            frame: false,
        };
        let root = Root { state: StateId::new(0), points, rational: false, solid: None };
        Attractor::new(Automaton::new(vec![state]).unwrap(), vec![root], Vec::new(), Vec::new()).unwrap()
    }

    /// Along random addresses frames begin with the control points, and both attractors have one box.
    #[test]
    fn frames_have_the_attractor_of_control_points() {
        let mut random = Random(5);
        for (number, model) in models().into_iter().enumerate() {
            let own = lowered(model);
            let framed = own.framed().unwrap();
            for _ in 0..50 {
                let mut points = [&own, &framed].map(|attractor| (attractor.root_cell(0), attractor.roots()[0].points.clone()));
                for _ in 0..random.next() % 9 {
                    let choice = (random.next() % own.automaton().state(StateId::new(0)).transitions.len() as u64) as usize;
                    points = [(&own, &points[0]), (&framed, &points[1])]
                        .map(|(attractor, (cell, points))| attractor.children(cell, points).nth(choice).unwrap());
                }
                let [(_, own), (_, frame)] = points;
                let at = |point: &[f64; 4]| [point[0], point[1], point[2]];
                assert!(own.iter().zip(&frame).all(|(a, b)| distance_squared(&at(a), &at(b)) < 1e-20), "{number}");
            }
            let [a, b] = [&own, &framed].map(|attractor| bounding_box(attractor, &Budget::default()).unwrap());
            for axis in 0..3 {
                assert!(
                    (a.low[axis].low - b.low[axis].low).abs() < 1e-6 && (a.high[axis].high - b.high[axis].high).abs() < 1e-6,
                    "{number}"
                );
            }
        }
    }

    #[test]
    fn what_frames_do_not_tell_has_none() {
        let (operators, points) = models().remove(0);
        let weighted = |attractor: Attractor| Attractor { roots: vec![Root { rational: true, ..attractor.roots[0].clone() }], ..attractor };
        assert!(weighted(lowered((operators.clone(), points.clone()))).framed().is_none());
        assert!(lowered((operators, points)).framed().unwrap().framed().is_none());
    }
}
