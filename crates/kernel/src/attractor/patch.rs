//! Which states are Bezier patches: polynomial surfaces over the unit square, and where their Bezier points lie.
//!
//! Let states s have points H_s, the columns of a matrix, (p + 1)(q + 1) of them on a grid, and let every such state have four children, one for every quadrant of
//! the square, for which T_e H_w P_e = H_s K_e: K_e are de Casteljau's operators at 1/2 of the quadrant, and P_e turns the child's grid as one of the eight symmetries of the square. The
//! surfaces H_s b, b being the vector of Bernstein polynomials, then satisfy the equations of the attractors, A_s = union of T_e A_w, piece by piece. These have one solution where
//! operators contract. So the cell with control points Q is the Bezier surface of the points Q H_s, through whatever address it is seen.
//!
//! Products of curves have products of the curves' points. Of a face that is none, as those of Catmull-Clark's and Doo-Sabin's surfaces, the parameters of control points
//! (`precision`) tell which spline it may be, and the equations above decide. They are held to [`MISS`]: operators are rounded to double precision, and taken to be those of the spline.

use super::Attractor;
use crate::automaton::{StateId, SubdivisionOperator};
use crate::de_casteljau::operators;

/// Entries by which equations may miss.
const MISS: f64 = 1e-13;
/// Parameters are those of a spline's points within this.
const PARAMETER: f64 = 1e-6;

/// The Bezier points of a state.
#[derive(Clone, Debug)]
pub(crate) struct BezierPatch {
    /// Degrees in both directions of the grid.
    pub(crate) degrees: [usize; 2],
    /// H; the grid's second index is fastest.
    pub(crate) points: SubdivisionOperator,
    /// Entries by which the equations of this or another state miss, at most.
    pub(crate) miss: f64,
}

/// Where control points of a direction lie in units of the span, and the Bezier points as combinations of them.
struct Spline<'a> {
    parameters: &'a [f64],
    points: &'a [&'a [f64]],
}

const SIXTH: f64 = 1.0 / 6.0;
const THIRD: f64 = 1.0 / 3.0;

/// Spans of uniform splines of degree 3 and 2: inside, and at ends: those of degree 3 end as a crease does, at which second derivatives vanish, those of degree 2 with a knot of multiplicity 3.
const SPLINES: [Spline<'static>; 8] = [
    Spline {
        parameters: &[-1.0, 0.0, 1.0, 2.0],
        points: &[
            &[SIXTH, 4.0 * SIXTH, SIXTH, 0.0],
            &[0.0, 2.0 * THIRD, THIRD, 0.0],
            &[0.0, THIRD, 2.0 * THIRD, 0.0],
            &[0.0, SIXTH, 4.0 * SIXTH, SIXTH],
        ],
    },
    Spline {
        parameters: &[0.0, 1.0, 2.0],
        points: &[&[1.0, 0.0, 0.0], &[2.0 * THIRD, THIRD, 0.0], &[THIRD, 2.0 * THIRD, 0.0], &[SIXTH, 4.0 * SIXTH, SIXTH]],
    },
    Spline {
        parameters: &[-1.0, 0.0, 1.0],
        points: &[&[SIXTH, 4.0 * SIXTH, SIXTH], &[0.0, 2.0 * THIRD, THIRD], &[0.0, THIRD, 2.0 * THIRD], &[0.0, 0.0, 1.0]],
    },
    Spline { parameters: &[0.0, 1.0], points: &[&[1.0, 0.0], &[0.0, 1.0]] },
    Spline { parameters: &[-0.5, 0.5, 1.5], points: &[&[0.5, 0.5, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.5, 0.5]] },
    Spline { parameters: &[0.0, 0.5, 1.5], points: &[&[1.0, 0.0, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.5, 0.5]] },
    Spline { parameters: &[-0.5, 0.5, 1.0], points: &[&[0.5, 0.5, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0]] },
    Spline { parameters: &[0.0, 0.5, 1.0], points: &[&[1.0, 0.0, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0]] },
];

impl Attractor {
    /// The Bezier points of every curve that is proven to have some, with all that it leads to, and by how much equations miss.
    pub(crate) fn bezier_curves(&self) -> (Vec<Option<SubdivisionOperator>>, f64) {
        let ids = || (0..self.automaton().states().len()).map(StateId::new);
        let curves: Vec<Option<SubdivisionOperator>> = ids().map(|id| self.curve_points(id)).collect();
        let halved: Vec<Option<f64>> = ids().map(|id| self.halved(id, &curves)).collect();
        let holds = self.automaton().hereditary(halved.iter().map(Option::is_some).collect());
        let miss = halved.iter().flatten().fold(0.0_f64, |a, &b| a.max(b));
        (curves.into_iter().zip(holds).map(|(curve, holds)| curve.filter(|_| holds)).collect(), miss)
    }

    /// The Bezier points of every state that is proven to have some, with all that it leads to.
    ///
    /// Cost: for every face state some products of its operators.
    pub(crate) fn bezier_patches(&self) -> Vec<Option<BezierPatch>> {
        let ids = || (0..self.automaton().states().len()).map(StateId::new);
        let (curves, missed) = self.bezier_curves();
        let curve = |id: StateId| curves[id.index()].as_ref();
        let patch = |id: StateId| match self.automaton().factors(id) {
            [] => self.spline_patch(id),
            &[u, v] => {
                let (u, v) = (curve(u)?, curve(v)?);
                let degrees = [u.columns() - 1, v.columns() - 1];
                Some(BezierPatch { degrees, points: SubdivisionOperator::product(vec![u.clone(), v.clone()]), miss: 0.0 })
            }
            _ => None,
        };
        let patches: Vec<Option<BezierPatch>> = ids().map(patch).collect();
        let product = |id: StateId| !self.automaton().factors(id).is_empty() && patches[id.index()].is_some();
        let quartered: Vec<Option<f64>> = ids().map(|id| if product(id) { Some(0.0) } else { self.quartered(id, &patches) }).collect();
        let holds = self.automaton().hereditary(quartered.iter().map(Option::is_some).collect());
        // In a product the equations of two factors miss.
        let miss = quartered.iter().flatten().fold(2.0 * missed, |a, &b| a.max(b));
        let kept = |(patch, holds): (Option<BezierPatch>, bool)| patch.filter(|_| holds).map(|patch| BezierPatch { miss, ..patch });
        patches.into_iter().zip(holds).map(kept).collect()
    }

    /// What may be the Bezier points of a curve: those that the model claims, or the control points.
    fn curve_points(&self, id: StateId) -> Option<SubdivisionOperator> {
        let state = self.automaton().state(id);
        if state.transitions.len() != 2 || state.dimension < 2 || state.frame || !self.automaton().factors(id).is_empty() {
            return None;
        }
        let claimed = self.automaton().claimed_smooth().get(&id).and_then(|claim| claim.hull.as_ref());
        if let Some(hull) = claimed {
            return Some(hull.points.clone());
        }
        let parameters = self.precision(id).filter(|precision| precision.domain.len() == 2).map(|precision| &precision.parameters);
        let spline = parameters.and_then(|parameters| {
            let (spline, places) = spline_of(parameters.iter().map(|parameter| parameter[0]))?;
            (places.len() == spline.parameters.len()).then_some((spline, places))
        });
        let Some((spline, places)) = spline else { return Some(SubdivisionOperator::identity(state.dimension)) };
        let entries = spline.points.iter().flat_map(|point| places.iter().map(|&place| point[place])).collect();
        Some(SubdivisionOperator::exact(state.dimension, entries))
    }

    /// By how much the points of a curve's children are off those of its halves, if that is rounding.
    fn halved(&self, id: StateId, curves: &[Option<SubdivisionOperator>]) -> Option<f64> {
        let own = curves[id.index()].as_ref()?;
        let mut most = 0.0_f64;
        for (transition, half) in self.automaton().state(id).transitions.iter().zip(operators(own.columns())) {
            let child = curves[transition.to.index()].as_ref()?;
            most = most.max(off(&transition.operator.times(child), &own.times(&half), |k| k));
        }
        (most <= MISS).then_some(most)
    }

    /// What may be the Bezier points of a face, by the parameters of its control points.
    fn spline_patch(&self, id: StateId) -> Option<BezierPatch> {
        let parameters = &self.precision(id).filter(|precision| precision.domain.len() == 4)?.parameters;
        let axis = |axis: usize| spline_of(parameters.iter().map(move |parameter| parameter[axis]));
        let [(u, rows), (v, columns)] = [axis(0)?, axis(1)?];
        if parameters.len() != u.parameters.len() * v.parameters.len() {
            return None;
        }
        let places: Vec<(usize, usize)> = rows.into_iter().zip(columns).collect();
        let mut entries = Vec::with_capacity(u.points.len() * v.points.len() * places.len());
        for a in u.points {
            for b in v.points {
                entries.extend(places.iter().map(|&(i, j)| a[i] * b[j]));
            }
        }
        let degrees = [u.points.len() - 1, v.points.len() - 1];
        Some(BezierPatch { degrees, points: SubdivisionOperator::exact(places.len(), entries), miss: 0.0 })
    }

    /// By how much the points of a face's children are off those of its four quadrants, however they are turned, if that is rounding.
    fn quartered(&self, id: StateId, patches: &[Option<BezierPatch>]) -> Option<f64> {
        let own = patches[id.index()].as_ref()?;
        let [u, v] = own.degrees.map(|degree| operators(degree + 1));
        let quadrants: Vec<SubdivisionOperator> =
            u.iter().flat_map(|a| v.iter().map(|b| own.points.times(&SubdivisionOperator::product(vec![a.clone(), b.clone()])))).collect();
        let (mut met, mut most) = ([false; 4], 0.0_f64);
        for transition in &self.automaton().state(id).transitions {
            let child = patches[transition.to.index()].as_ref()?;
            let points = transition.operator.times(&child.points);
            let turned = |place: usize, symmetry: usize| {
                let degrees = if symmetry & 4 == 0 { child.degrees } else { [child.degrees[1], child.degrees[0]] };
                let fits = degrees == own.degrees;
                if fits { off(&points, &quadrants[place], |k| seen(own.degrees, symmetry, k)) } else { f64::INFINITY }
            };
            let free = (0..4).filter(|&place| !met[place]).flat_map(|place| (0..8).map(move |symmetry| (place, symmetry)));
            let (least, place) = free.map(|(place, symmetry)| (turned(place, symmetry), place)).min_by(|a, b| a.0.total_cmp(&b.0))?;
            met[place] = true;
            most = most.max(least);
        }
        (met == [true; 4] && most <= MISS).then_some(most)
    }
}

/// The spline whose points have these parameters, each once or several times, and which of its points each is.
fn spline_of(parameters: impl Iterator<Item = f64> + Clone) -> Option<(&'static Spline<'static>, Vec<usize>)> {
    let place = |spline: &Spline, value: f64| spline.parameters.iter().position(|known| (known - value).abs() <= PARAMETER);
    SPLINES.iter().find_map(|spline| {
        let places: Vec<usize> = parameters.clone().map(|value| place(spline, value)).collect::<Option<_>>()?;
        (0..spline.parameters.len()).all(|k| places.contains(&k)).then_some((spline, places))
    })
}

/// The largest difference of an entry of the right, column k, from the left's, column `place(k)`.
fn off(left: &SubdivisionOperator, right: &SubdivisionOperator, place: impl Fn(usize) -> usize) -> f64 {
    if left.rows() != right.rows() || left.columns() != right.columns() {
        return f64::INFINITY;
    }
    let column = |k: usize| left.column(place(k)).iter().zip(right.column(k)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    (0..right.columns()).map(column).fold(0.0, f64::max)
}

/// Which point of a child's grid is point k of a grid of these degrees, seen through one of the eight symmetries: the bits turn the first direction, the second, and exchange them.
fn seen([p, q]: [usize; 2], symmetry: usize, k: usize) -> usize {
    let (mut i, mut j) = (k / (q + 1), k % (q + 1));
    if symmetry & 1 != 0 {
        i = p - i;
    }
    if symmetry & 2 != 0 {
        j = q - j;
    }
    if symmetry & 4 == 0 { i * (q + 1) + j } else { j * (p + 1) + i }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{BoundaryRule, Model, Scheme, Shape, Subdivision};
    use glam::DVec3;

    /// A grid of 3 x 3 faces.
    fn grid(scheme: Scheme) -> Subdivision {
        let corner = |k: u32| vec![k / 3 * 4 + k % 3, k / 3 * 4 + k % 3 + 1, k / 3 * 4 + k % 3 + 5, k / 3 * 4 + k % 3 + 4];
        Subdivision {
            scheme,
            vertices: (0..16).map(|k| DVec3::new(f64::from(k % 4), f64::from(k / 4), f64::from(k * k % 5))).collect(),
            faces: (0..9).map(corner).collect(),
            creases: Vec::new(),
            corners: Vec::new(),
            boundary: BoundaryRule::SharpCorners,
            coefficients: Vec::new(),
        }
    }

    /// Degrees of the patches among the states of that many control points, as many as there are.
    fn found(surface: Subdivision) -> Vec<(usize, [usize; 2])> {
        let attractor = Model { name: None, shape: Shape::Subdivision(surface) }.lower().unwrap().attractor;
        let states = attractor.automaton().states().iter();
        let patches = attractor.bezier_patches();
        assert!(patches.iter().flatten().all(|patch| patch.miss < 1e-15));
        let mut list: Vec<_> = states.zip(patches).filter_map(|(state, patch)| Some((state.dimension, patch?.degrees))).collect();
        list.sort_unstable();
        list
    }

    #[test]
    fn regular_cells_of_subdivision_surfaces_have_bezier_points() {
        assert_eq!(found(grid(Scheme::CatmullClark)), [(9, [3, 3]), (12, [3, 3]), (16, [3, 3])]);
        let doo_sabin = found(grid(Scheme::DooSabin));
        assert!(doo_sabin.contains(&(9, [2, 2])), "{doo_sabin:?}");
        assert_eq!(found(Subdivision { boundary: BoundaryRule::Smooth, ..grid(Scheme::CatmullClark) }), [(12, [3, 3]), (16, [3, 3])]);
    }

    #[test]
    fn symmetries_are_permutations() {
        for symmetry in 0..8 {
            let mut places: Vec<usize> = (0..6).map(|k| seen([1, 2], symmetry, k)).collect();
            places.sort_unstable();
            assert_eq!(places, [0, 1, 2, 3, 4, 5]);
        }
        // Turned in both directions, the first point is the last; exchanged, the second index of a grid of degrees (2, 1) is the first.
        assert_eq!([seen([1, 2], 3, 0), seen([1, 2], 4, 1)], [5, 2]);
    }
}
