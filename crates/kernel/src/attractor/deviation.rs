//! How far rough curves, and products with them, are from affine images of their parameters, word by word.
//!
//! In the notation of `precision`, let L be affine and r(x) = Q x - L(G x), a linear function of the barycentric point x. Where operators have negative entries, a bound by
//! the margin, (1 + 2 m) max |r_k|, says of the attractor that it is farther off than its control points, several times as far as it is. But
//! x = T y with T one of the words of some length in the transitions, or for products in those of rough factors, and y in the attractor of what that leads to, which an
//! `enclosure` holds: so r(x) is in the smallest box around those of r(T y) over all words. The longer the words,
//! the closer that box is to the attractor's own, as what enclosures say too much is a share of the words' sizes.
//!
//! With the box's centre added to L, which is an affine map, too, |r| is at most half the box's diagonal: what is all above its corners, as Takagi's surface is, is so half as far off.

use super::cell::{ControlPoint, Point, child_points, distance_squared};
use super::enclosure::{Enclosure, of_product};
use super::precision::evaluate;
use super::{Attractor, LinearPrecision};
use crate::automaton::{StateId, SubdivisionOperator};

/// Columns of all words at most, and of one: what is asked of a cell takes a microsecond or two.
const MOST_COLUMNS: usize = 384;
const MOST_OF_WORD: usize = 64;
/// Letters of a word at most.
const LONGEST: usize = 4;

/// What is known of a state's words.
#[derive(Clone, Debug)]
pub(super) struct Deviation {
    words: Vec<Word>,
    /// Points of the attractor are within this of what the words say, in the sum of coordinates.
    miss: f64,
}

#[derive(Clone, Debug)]
struct Word {
    enclosure: Enclosure,
    /// The columns of the enclosure of what the word leads to as points of the state itself, and G of these.
    columns: SubdivisionOperator,
    parameters: Vec<[f64; 2]>,
}

/// Words of one length in the transitions of a curve: their operators, and where they lead to.
type Steps = Vec<(SubdivisionOperator, StateId)>;

/// The longest words that are few enough of a rough curve, or a product with such, that has precision; none of others, or where nothing encloses them.
pub(super) fn deviation(attractor: &Attractor, id: StateId) -> Option<Deviation> {
    let precision = attractor.precision(id)?;
    if attractor.bound(id).margin() == 0.0 {
        return None;
    }
    let own = [id];
    let curves = if attractor.automaton().factors(id).is_empty() { &own } else { attractor.automaton().factors(id) };
    let of_length = |length: usize| {
        let length = |curve: StateId| if attractor.bound(curve).margin() > 0.0 { length } else { 0 };
        let steps: Option<Vec<Steps>> = curves.iter().map(|&curve| steps(attractor, curve, length(curve), MOST_COLUMNS)).collect();
        words(attractor, &steps?, precision)
    };
    (0..=LONGEST).map_while(of_length).last()
}

/// All words of a length in a curve; none where there are more than `most`.
fn steps(attractor: &Attractor, curve: StateId, length: usize, most: usize) -> Option<Steps> {
    let state = |id: StateId| attractor.automaton().state(id);
    let mut steps = vec![(SubdivisionOperator::identity(state(curve).dimension), curve)];
    for _ in 0..length {
        if steps.iter().map(|(_, id)| state(*id).transitions.len()).sum::<usize>() > most {
            return None;
        }
        let longer = |(operator, id): &(SubdivisionOperator, StateId)| {
            state(*id).transitions.iter().map(|step| (operator.times(&step.operator), step.to)).collect::<Steps>()
        };
        steps = steps.iter().flat_map(longer).collect();
    }
    Some(steps)
}

/// The words that one of each curve makes; none where they are too many, or nothing encloses one.
fn words(attractor: &Attractor, steps: &[Steps], precision: &LinearPrecision) -> Option<Deviation> {
    let (mut words, mut count, mut miss) = (Vec::new(), 0, 0.0_f64);
    let total: usize = steps.iter().map(Vec::len).product();
    for number in 0..total.min(MOST_COLUMNS + 1) {
        let mut rest = number;
        let (operators, ends): (Vec<_>, Vec<_>) = steps
            .iter()
            .map(|own| {
                let (operator, end) = &own[rest % own.len()];
                rest /= own.len();
                (operator.clone(), *end)
            })
            .unzip();
        let enclosure = of_product(attractor, &ends)?;
        let own = enclosure.columns.columns();
        count += own;
        if own > MOST_OF_WORD || count > MOST_COLUMNS {
            return None;
        }
        let word = SubdivisionOperator::product(operators);
        let columns = word.times(&enclosure.columns);
        let norm = |k: usize| word.column(k).iter().map(|entry| entry.abs()).sum::<f64>();
        miss = miss.max(enclosure.miss * (0..word.columns()).map(norm).fold(1.0, f64::max));
        let parameters = (0..own).map(|k| evaluate(&precision.parameters, columns.column(k))).collect();
        words.push(Word { enclosure, columns, parameters });
    }
    Some(Deviation { words, miss })
}

impl Deviation {
    /// A box of Q x - L(G x) over a cell, L being the linear map with these derivatives.
    ///
    /// Cost: some ten nanoseconds for each column of the words.
    pub(super) fn bounds(&self, precision: &LinearPrecision, points: &[ControlPoint], derivatives: [&Point; 2]) -> [Point; 2] {
        let off =
            |point: &ControlPoint, [s, t]: [f64; 2]| std::array::from_fn(|k| point[k] - s * derivatives[0][k] - t * derivatives[1][k]);
        let mut buffer = [[0.0; 4]; MOST_OF_WORD];
        let mut seen = [[0.0; 3]; MOST_OF_WORD];
        let [mut low, mut high] = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        let mut widen = |own: [Point; 2]| {
            low = std::array::from_fn(|k| low[k].min(own[0][k]));
            high = std::array::from_fn(|k| high[k].max(own[1][k]));
        };
        for Word { enclosure, columns, parameters } in &self.words {
            let count = columns.columns();
            child_points(points, columns, &mut buffer[..count]);
            for ((seen, point), &parameter) in seen.iter_mut().zip(&buffer).zip(parameters) {
                *seen = off(point, parameter);
            }
            widen(enclosure.box_of(&seen[..count]));
        }
        if self.miss > 0.0 {
            // Of coordinates that sum to 0, what is seen changes by their sum times half of what control points differ by.
            let (mut least, mut most) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
            for (point, &parameter) in points.iter().zip(&precision.parameters) {
                let own: Point = off(point, parameter);
                least = std::array::from_fn(|k| least[k].min(own[k]));
                most = std::array::from_fn(|k| most[k].max(own[k]));
            }
            let missed: Point = std::array::from_fn(|k| self.miss * (most[k] - least[k]));
            low = std::array::from_fn(|k| low[k] - missed[k]);
            high = std::array::from_fn(|k| high[k] + missed[k]);
        }
        [low, high]
    }

    /// How far the points of a face are at most from an affine image of their parameters, with these derivatives.
    pub(super) fn of_face(&self, precision: &LinearPrecision, points: &[ControlPoint], derivatives: [&Point; 2]) -> f64 {
        let [low, high] = self.bounds(precision, points, derivatives);
        0.5 * distance_squared(&low, &high).sqrt()
    }

    /// How far the points of a curve are at most from those of its chord with the same parameters.
    pub(super) fn of_curve(&self, precision: &LinearPrecision, points: &[ControlPoint], start: &Point, chord: &Point) -> f64 {
        let [low, high] = self.bounds(precision, points, [chord, &[0.0; 3]]);
        let farthest = (0..3).map(|k| (low[k] - start[k]).abs().max((high[k] - start[k]).abs()).powi(2)).sum::<f64>();
        farthest.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::refine;
    use crate::budget::Budget;
    use crate::model::{ControlNet, Curve, CurveScheme, Model, Shape, TensorProduct};
    use crate::split_mix::Random;
    use crate::tolerance::Tolerance;
    use glam::DVec3;

    fn rough(scaling: &[f64]) -> CurveScheme {
        CurveScheme::Interpolation { vertical_scaling: scaling.to_vec() }
    }

    fn four_point(tension: f64) -> CurveScheme {
        CurveScheme::FourPoint { tension, closed: false }
    }

    fn cubic() -> CurveScheme {
        CurveScheme::Nurbs { degree: 3, knots: vec![0.0, 0.0, 0.0, 0.0, 0.6, 1.0, 1.0, 1.0, 1.0] }
    }

    /// Control points over a grid, at heights by chance.
    fn net(size: &[usize], random: &mut Random) -> ControlNet {
        let count: usize = size.iter().product();
        let last = if size.len() == 1 { 1 } else { size[1] };
        let place = |k: usize| DVec3::new((k / last) as f64, (k % last) as f64, 4.0 * random.share() - 2.0);
        ControlNet { size: size.to_vec(), points: (0..count).map(place).collect(), weights: None }
    }

    fn product(schemes: [CurveScheme; 2], size: [usize; 2], random: &mut Random) -> Attractor {
        let control_points = net(&size, random);
        let shape = Shape::TensorProduct(TensorProduct { schemes: schemes.to_vec(), control_points, separate: true, trim: None });
        Model { name: None, shape }.lower().unwrap().attractor
    }

    fn curve(scheme: CurveScheme, count: usize, random: &mut Random) -> Attractor {
        Model { name: None, shape: Shape::Curve(Curve { scheme, control_points: net(&[count], random) }) }.lower().unwrap().attractor
    }

    fn all(random: &mut Random) -> Vec<Attractor> {
        vec![
            curve(rough(&[0.5, -0.7, 0.3, 0.6]), 5, random),
            curve(four_point(0.0625), 8, random),
            curve(four_point(0.15), 8, random),
            product([rough(&[0.45, -0.5, 0.4, 0.5]), cubic()], [5, 5], random),
            product([cubic(), rough(&[0.45, -0.5, 0.4, 0.5])], [5, 5], random),
            product([rough(&[0.5, -0.4, 0.5]), rough(&[0.4, 0.5, -0.45])], [4, 4], random),
            product([four_point(0.0625), rough(&[0.5, 0.5])], [8, 3], random),
        ]
    }

    /// A point of the attractor of a state, nearly: what is left of the path is a cell of less than 0.7^40 of its size.
    fn attained(attractor: &Attractor, state: StateId, random: &mut Random) -> Vec<f64> {
        let mut path = vec![];
        let mut at = state;
        for _ in 0..40 {
            let transitions = &attractor.automaton().state(at).transitions;
            let step = &transitions[(random.next() % transitions.len() as u64) as usize];
            path.push(&step.operator);
            at = step.to;
        }
        let n = attractor.automaton().state(at).dimension;
        path.iter().rev().fold(vec![1.0 / n as f64; n], |point, operator| operator.apply(&point))
    }

    /// What is seen of points of the attractor is in the box, for any derivatives, and the box is not much larger than they are apart.
    #[test]
    fn boxes_hold_the_attractor_and_little_more() {
        let mut random = Random(5);
        for (number, attractor) in all(&mut random).iter().enumerate() {
            let root = &attractor.roots()[0];
            let (deviation, precision) = (attractor.deviation(root.state).unwrap(), attractor.precision(root.state).unwrap());
            let points: Vec<Vec<f64>> = (0..5_000).map(|_| attained(attractor, root.state, &mut random)).collect();
            for _ in 0..4 {
                let [u, v]: [Point; 2] = std::array::from_fn(|_| std::array::from_fn(|_| 4.0 * random.share() - 2.0));
                let [low, high] = deviation.bounds(precision, &root.points, [&u, &v]);
                let (mut least, mut most) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
                for point in &points {
                    let [s, t] = precision.parameter(point);
                    for k in 0..3 {
                        let place: f64 = root.points.iter().zip(point).map(|(own, x)| own[k] * x).sum();
                        let own = place - s * u[k] - t * v[k];
                        (least[k], most[k]) = (least[k].min(own), most[k].max(own));
                    }
                }
                for k in 0..3 {
                    assert!(low[k] - 1e-6 <= least[k] && most[k] <= high[k] + 1e-6, "{number}: {:?} {:?}", [least, most], [low, high]);
                    let ratio = (high[k] - low[k]) / (most[k] - least[k]);
                    assert!(ratio < 2.5, "{number}: {ratio}");
                }
            }
        }
    }

    /// Where nothing is rough, control points or what is known of hulls tell enough.
    #[test]
    fn what_is_not_rough_has_none() {
        let mut random = Random(6);
        let smooth = product([cubic(), cubic()], [5, 5], &mut random);
        assert!(smooth.deviation(smooth.roots()[0].state).is_none());
    }

    /// By the margins these take 67, 188 and 28,377.
    #[test]
    fn rough_shapes_take_few_cells() {
        let mut random = Random(7);
        let all = all(&mut random);
        let cells = |number: usize| refine(&all[number], Tolerance::new(0.05).unwrap(), &Budget::default()).unwrap().leaf_cells;
        let counts = [1, 2, 6].map(cells);
        assert!(counts.into_iter().zip([15, 30, 7_000]).all(|(count, most)| count <= most), "{counts:?}");
    }
}
