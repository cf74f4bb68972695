//! Cells of products that are split along one factor at a time.
//!
//! A cell of a product state with factors p and q, and with control points P, is P (A_p x A_q): all factors subdivide at every step, in every combination. As A_p is the union of T A_p' over the transitions of p, it is the union of P (T x I) (A_p' x A_q), too, which are cells of the states with factors p' and q, if there are such. So
//! what is rough along one factor and smooth along another is covered by cells that are short along the first and long along the other: for a halving Takagi curve and an arch 2^n n^2 of them, and not 4^n.

use super::cell::{Cell, ControlPoint, child_points};
use super::{Attractor, Root};
use crate::automaton::{StateId, SubdivisionOperator, Transition};
use crate::budget::{Budget, Stopped};
use std::collections::HashMap;

/// Cells at most of which it is asked along which factor to split.
const SAMPLE: usize = 32;

/// A cell with its control points.
type Bounded = (Cell, Vec<ControlPoint>);

impl Attractor {
    /// The same attractor with smaller roots in the place of those that are products: they are split along one factor at a time, all along the same, until all are small enough. None where there is no product, some cannot be split so, there would be more than `most`, or roots have radii of their own or are trimmed.
    ///
    /// Cost: some microseconds for each of the cells, which are held with their control points.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(crate) fn split_along_factors(
        &self,
        most: usize,
        is_small: impl Fn(&Cell, &[ControlPoint]) -> bool,
        budget: &Budget,
    ) -> Result<Option<Self>, Stopped> {
        let mut splitter = Splitter::new(self);
        let is_product = |root: &Root| splitter.is_product(root.state);
        if self.has_own_radii() || !self.trimmed.is_empty() || !self.roots.iter().any(is_product) {
            return Ok(None);
        }
        let (products, others): (Vec<usize>, Vec<usize>) = (0..self.roots.len()).partition(|&root| is_product(&self.roots[root]));
        let mut cells: Vec<Bounded> = products.iter().map(|&root| (self.root_cell(root), self.roots[root].points.clone())).collect();
        while !cells.iter().all(|(cell, points)| is_small(cell, points)) {
            let Some(along) = splitter.best(&cells) else { return Ok(None) };
            let mut finer = Vec::with_capacity(2 * cells.len());
            for (cell, points) in &cells {
                budget.cancel.check()?;
                if splitter.split(cell, points, along, &mut finer).is_none() || finer.len() > most {
                    return Ok(None);
                }
            }
            cells = finer;
        }
        let mut roots: Vec<Root> = others.iter().map(|&root| self.roots[root].clone()).collect();
        roots.extend(cells.into_iter().map(|(cell, points)| {
            let Root { rational, solid, .. } = self.roots[cell.root as usize];
            Root { state: cell.state, points, rational, solid }
        }));
        let mut solids = self.solids.clone();
        for solid in &mut solids {
            solid.first_root -= products.partition_point(|&root| root < solid.first_root);
        }
        Ok(Some(Self { trims: vec![None; roots.len()], roots, solids, brep: None, ..self.clone() }))
    }
}

/// Splits cells of products.
struct Splitter<'a> {
    attractor: &'a Attractor,
    /// The states that are products, by their factors.
    states: HashMap<&'a [StateId], StateId>,
    /// Of every state and factor, what its transitions along that alone are; none where they lead to no state.
    steps: HashMap<(StateId, usize), Option<Vec<Step>>>,
}

/// A transition along one factor.
#[derive(Clone, Debug)]
struct Step {
    to: StateId,
    operator: SubdivisionOperator,
}

impl<'a> Splitter<'a> {
    fn new(attractor: &'a Attractor) -> Self {
        let automaton = &attractor.automaton;
        let all = (0..automaton.states().len()).map(StateId::new);
        // What is bounded by the hull of its control points needs nothing else of what it is a part of.
        let products = all.filter(|&id| automaton.factors(id).len() > 1 && !automaton.state(id).frame);
        Self { attractor, states: products.map(|id| (automaton.factors(id), id)).collect(), steps: HashMap::new() }
    }

    fn is_product(&self, state: StateId) -> bool {
        self.states.get(self.attractor.automaton.factors(state)) == Some(&state)
    }

    /// The factor along which cells have the least errors when they are split, as far as a sample of them tells; none where none can be split.
    fn best(&mut self, cells: &[Bounded]) -> Option<usize> {
        let step = cells.len().div_ceil(SAMPLE).max(1);
        let count = cells.iter().map(|(cell, _)| self.attractor.automaton.factors(cell.state).len()).min()?;
        let mut best: Option<(f64, usize)> = None;
        for along in 0..count {
            let mut finer = Vec::new();
            let mut sample = cells.iter().step_by(step);
            if !sample.all(|(cell, points)| self.split(cell, points, along, &mut finer).is_some()) {
                continue;
            }
            let most = finer.iter().map(|own| self.error(own)).fold(0.0, f64::max);
            if best.is_none_or(|(least, _)| most < least) {
                best = Some((most, along));
            }
        }
        best.map(|(_, along)| along)
    }

    fn error(&self, (cell, points): &Bounded) -> f64 {
        self.attractor.leaf_error(cell, points).min(cell.ball.radius)
    }

    /// Adds the parts of a cell along a factor; none where they have no state.
    fn split(&mut self, cell: &Cell, points: &[ControlPoint], along: usize, parts: &mut Vec<Bounded>) -> Option<()> {
        let Self { attractor, states, steps } = self;
        let steps = steps.entry((cell.state, along)).or_insert_with(|| steps_along(attractor, states, cell.state, along)).as_ref()?;
        let Root { rational, .. } = attractor.roots[cell.root as usize];
        parts.extend(steps.iter().map(|Step { to, operator }| {
            let mut own = vec![[0.0; 4]; operator.columns()];
            child_points(points, operator, &mut own);
            let ball = attractor.ball(*to, &own, rational, 0.0);
            (Cell { state: *to, ball, ..*cell }, own)
        }));
        Some(())
    }
}

/// The transitions of a product state along a factor alone; none where that does not subdivide, or leads to no product.
fn steps_along(attractor: &Attractor, states: &HashMap<&[StateId], StateId>, state: StateId, along: usize) -> Option<Vec<Step>> {
    let automaton = &attractor.automaton;
    let factors = automaton.factors(state);
    let transitions = &automaton.state(factors[along]).transitions;
    let step = |transition: &Transition| {
        let mut to = factors.to_vec();
        to[along] = transition.to;
        let identity = |id: &StateId| SubdivisionOperator::identity(automaton.state(*id).dimension);
        let mut operators: Vec<SubdivisionOperator> = factors.iter().map(identity).collect();
        operators[along] = transition.operator.clone();
        let to = *states.get(to.as_slice())?;
        Some(Step { to, operator: SubdivisionOperator::product(operators) })
    };
    (!transitions.is_empty()).then(|| transitions.iter().map(step).collect())?
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::cell::{Ball, distance_squared};
    use crate::attractor::sites::SiteRule;
    use crate::budget::StopReason;
    use crate::dilation::dilate;
    use crate::model::{ControlNet, Curve, CurveScheme, Model, Shape, Sum, TensorProduct};
    use crate::tolerance::{Radius, Tolerance};
    use glam::DVec3;

    fn lowered(shape: Shape) -> Attractor {
        Model { name: None, shape }.lower().unwrap().attractor
    }

    fn curve(scheme: CurveScheme, points: &[[f64; 3]]) -> Curve {
        let points: Vec<DVec3> = points.iter().copied().map(DVec3::from_array).collect();
        Curve { scheme, control_points: ControlNet { size: vec![points.len()], points, weights: None } }
    }

    /// All translations of Takagi's curve along an arch.
    fn takagi_and_arch() -> Attractor {
        let takagi = CurveScheme::Interpolation { vertical_scaling: vec![0.5, 0.5] };
        lowered(Shape::Sum(Sum {
            u: curve(takagi, &[[0.0; 3], [15.0, 0.0, 15.0], [30.0, 0.0, 0.0]]),
            v: curve(CurveScheme::Bezier, &[[0.0; 3], [0.0, 15.0, 30.0], [0.0, 30.0, 0.0]]),
        }))
    }

    /// A product of two or three schemes, with control points that are off a lattice.
    fn product(schemes: &[CurveScheme], size: &[usize]) -> Attractor {
        let count: usize = size.iter().product();
        let place = |k: usize| {
            let [x, y] = [k % size[0], k / size[0]].map(|x| x as f64);
            DVec3::new(5.0 * x + (1.7 * y).sin(), 4.0 * y, (2.3 * x + y).cos())
        };
        let control_points = ControlNet { size: size.to_vec(), points: (0..count).map(place).collect(), weights: None };
        lowered(Shape::TensorProduct(TensorProduct { schemes: schemes.to_vec(), control_points, separate: true, trim: None }))
    }

    fn all() -> Vec<Attractor> {
        let spline = CurveScheme::Nurbs { degree: 2, knots: vec![0.0, 0.0, 0.0, 0.4, 1.0, 1.0, 1.0] };
        let takagi = || CurveScheme::Interpolation { vertical_scaling: vec![0.4, -0.3] };
        vec![
            takagi_and_arch(),
            product(&[takagi(), CurveScheme::Bezier], &[3, 3]),
            product(&[CurveScheme::Bezier, CurveScheme::Bezier], &[2, 3]),
            product(&[CurveScheme::Bezier, spline.clone()], &[4, 4]),
            product(&[CurveScheme::Bezier, spline, takagi()], &[2, 4, 3]),
        ]
    }

    /// Split along all factors, one after the other, cells have the children that they have at once.
    #[test]
    fn what_is_split_along_all_factors_is_split() {
        for (number, attractor) in all().iter().enumerate() {
            let mut splitter = Splitter::new(attractor);
            for (index, root) in attractor.roots().iter().enumerate() {
                let mut cells = vec![(attractor.root_cell(index), root.points.clone())];
                for along in 0..attractor.automaton().factors(root.state).len() {
                    let mut finer = Vec::new();
                    for (cell, points) in &cells {
                        splitter.split(cell, points, along, &mut finer).unwrap();
                    }
                    cells = finer;
                }
                let children: Vec<Bounded> = attractor.children(&attractor.root_cell(index), &root.points).collect();
                assert_eq!(cells.len(), children.len());
                for ((cell, points), (child, expected)) in cells.iter().zip(&children) {
                    assert_eq!((cell.state, cell.root), (child.state, child.root), "{number}");
                    let off = points.iter().flatten().zip(expected.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    assert!(off < 1e-12 && (cell.ball.radius - child.ball.radius).abs() < 1e-12, "{number}: {off}");
                }
            }
        }
    }

    /// Cells that are split along one factor hold all of the shape that they were split of, and are as small as they should be.
    #[test]
    fn what_is_split_is_the_same_shape() {
        for (number, attractor) in all().iter().enumerate() {
            let error = |shape: &Attractor, cell: &Cell, points: &[ControlPoint]| shape.leaf_error(cell, points).min(cell.ball.radius);
            let is_small = |cell: &Cell, points: &[ControlPoint]| error(attractor, cell, points) <= 0.2;
            let Some(split) = attractor.split_along_factors(50_000, is_small, &Budget::default()).unwrap() else {
                assert_eq!(number, 4, "only a volume has so many");
                continue;
            };
            let is_small = |root: usize| error(&split, &split.root_cell(root), &split.roots()[root].points) <= 0.2;
            let small = (0..split.roots().len()).all(is_small);
            assert!(small && split.roots().len() > attractor.roots().len());
            let centres = |shape: &Attractor, depth: usize| {
                let mut cells: Vec<Bounded> =
                    shape.roots().iter().enumerate().map(|(root, own)| (shape.root_cell(root), own.points.clone())).collect();
                for _ in 0..depth {
                    cells = cells.iter().flat_map(|(cell, points)| shape.children(cell, points).collect::<Vec<_>>()).collect();
                }
                cells.into_iter().map(|(cell, _)| cell.ball).collect::<Vec<_>>()
            };
            // Each of either has one of the other so near that they may have a place in common.
            let [whole, parts] = [centres(attractor, 3), centres(&split, 0)];
            for [own, others] in [[&whole, &parts], [&parts, &whole]] {
                for ball in own {
                    let meets = |other: &Ball| distance_squared(&ball.centre, &other.centre).sqrt() <= ball.radius + other.radius + 1e-12;
                    assert!(others.iter().any(meets), "{number}");
                }
            }
        }
    }

    #[test]
    fn what_is_rough_along_one_factor_alone_takes_few_cells() {
        let attractor = takagi_and_arch();
        let is_small = |cell: &Cell, points: &[ControlPoint]| attractor.leaf_error(cell, points) <= 0.2;
        let budget = Budget::default();
        let split = |most: usize| attractor.split_along_factors(most, is_small, &budget).unwrap();
        let cells = split(1 << 20).unwrap().roots().len();
        // Takagi's curve needs 2^7 parts, whose heights are halved each time and a little more, and the arch 2^5.
        assert!(cells <= 1 << 12, "{cells}");
        assert!(split(cells).is_some() && split(cells - 1).is_none());
        let made = dilate(&attractor, Radius::new(3.0).unwrap(), Tolerance::new(0.6).unwrap(), &budget).unwrap();
        assert!(made.topology_exact && made.pitch_mm.is_none() && made.leaf_cells <= 1 << 12, "{}", made.leaf_cells);
        // With as many parts along the arch as along the curve there would be far more.
        assert!(SiteRule::new(&attractor, 3.0, 0.6, 1.0).leaves(3 * cells, &budget.cancel).unwrap().is_none());
    }

    #[test]
    fn splitting_is_stopped() {
        let budget = Budget::default();
        budget.cancel.fire(StopReason::Cancelled);
        assert!(takagi_and_arch().split_along_factors(1 << 20, |_, _| false, &budget).is_err());
    }

    #[test]
    fn what_is_no_product_is_not_split() {
        let arch = curve(CurveScheme::Bezier, &[[0.0; 3], [0.0, 15.0, 30.0], [0.0, 30.0, 0.0]]);
        assert!(lowered(Shape::Curve(arch)).split_along_factors(1 << 20, |_, _| false, &Budget::default()).unwrap().is_none());
    }
}
