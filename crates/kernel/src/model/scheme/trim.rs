//! Trim loops: curves in the parameter plane that cut a spline surface.

use super::factor::{Factor, Placed};
use super::knots::Form;
use super::{CurveScheme, Faults, Grid, Site};
use crate::attractor::trim::{Arc, CurvePlace, GAP, Region, RegionFault, SpanCell, TrimmedSurface};
use crate::automaton::LeafPrimitive;
use crate::model::WEIGHTS;
use crate::model::join::Borders;
use crate::model::lower::Draft;
use crate::model::mesh::simplex;
use glam::DVec2;

/// What is kept of a surface: the closed region of its parameter plane between an outer loop and inner loops.
///
/// Loops may run either way round. They are closed chains of curves, simple, apart from each other and within the
/// domain; inner loops are inside the outer one and not inside each other. The outer loop may run along the border of
/// the domain; on a closed surface it does so along both sides of the seam, which is no rim then.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Trim {
    /// The curves of the outer loop, in order; the border of the domain when absent.
    pub outer: Option<Vec<TrimCurve>>,
    /// The curves of every inner loop: holes.
    pub inner: Vec<Vec<TrimCurve>>,
}

/// A curve of points (u, v).
#[derive(Clone, Debug, PartialEq)]
pub enum TrimCurve {
    /// Segments between successive points.
    Polyline(Vec<DVec2>),
    /// A Bezier curve or a spline.
    Spline {
        /// [`CurveScheme::Bezier`] or [`CurveScheme::Nurbs`].
        scheme: CurveScheme,
        /// The control points.
        control_points: Vec<DVec2>,
        /// Positive weights; all 1 when absent.
        weights: Option<Vec<f64>>,
    },
}

/// Trim curves of a surface at most.
const MOST_CURVES: usize = 1 << 20;

/// The parameter intervals of a scheme's spans; `None` for schemes without a parametrization that trimming knows.
fn intervals(scheme: &CurveScheme, count: usize) -> Option<Vec<[f64; 2]>> {
    match scheme {
        CurveScheme::Bezier => Some(vec![[0.0, 1.0]]),
        CurveScheme::Nurbs { degree, knots } => {
            Some((*degree..count).map(|last| [knots[last], knots[last + 1]]).filter(|[low, high]| low < high).collect())
        }
        _ => None,
    }
}

impl TrimCurve {
    /// The curve as arcs; nothing after a fault, the place of which is the draft's.
    fn arcs(&self, draft: &mut Draft) -> Option<Vec<Arc>> {
        let (member, code) = ("/control_points", "trim.points");
        match self {
            Self::Polyline(points) => {
                check_points(points, "/points", draft)?;
                if points.len() < 2 {
                    draft.error("/points", code, format!("{} points: a polyline needs 2 or more", points.len()));
                    return None;
                }
                Some(points.windows(2).map(|pair| Arc::new(pair.iter().map(|p| [p.x, p.y, 1.0]).collect())).collect())
            }
            Self::Spline { scheme, control_points, weights } => {
                check_points(control_points, member, draft)?;
                if weights.as_ref().is_some_and(|weights| weights.len() != control_points.len()) {
                    let found = weights.as_ref().map_or(0, Vec::len);
                    draft.error("/weights", "net.weights", format!("{found} weights for {} control points", control_points.len()));
                    return None;
                }
                let weight = |k: usize| weights.as_ref().map_or(1.0, |weights| weights[k]);
                if let Some(index) = (0..control_points.len()).find(|&k| !WEIGHTS.contains(&weight(k))) {
                    let (least, most) = (WEIGHTS.start(), WEIGHTS.end());
                    let message = format!("the weight is {:e}, and must be positive, from {least:e} to {most:e}", weight(index));
                    draft.error(&format!("/weights/{index}"), "net.weights", message);
                    return None;
                }
                if !matches!(scheme, CurveScheme::Bezier | CurveScheme::Nurbs { .. }) {
                    draft.error("", "trim.curve", "a trim curve is a Bezier curve, a spline or a polyline".into());
                    return None;
                }
                let homogeneous: Vec<[f64; 3]> =
                    control_points.iter().enumerate().map(|(k, p)| [weight(k) * p.x, weight(k) * p.y, weight(k)]).collect();
                let mut faults = Faults { draft, site: Site::Own, points: member, count: 0 };
                let factor = scheme.factor(homogeneous.len(), Form::Bezier, &mut faults)?;
                let point = |terms: &Vec<(usize, f64)>| {
                    terms.iter().fold([0.0; 3], |sum, &(k, share)| std::array::from_fn(|i| sum[i] + share * homogeneous[k][i]))
                };
                Some(factor.spans.iter().map(|span| Arc::new(span.controls.iter().map(point).collect())).collect())
            }
        }
    }
}

fn check_points(points: &[DVec2], member: &str, draft: &mut Draft) -> Option<()> {
    let legal = |point: &DVec2| point.is_finite() && point.abs().max_element() < 1e50;
    let Some((index, point)) = points.iter().enumerate().find(|(_, point)| !legal(point)) else { return Some(()) };
    draft.error(&format!("{member}/{index}"), "model.not-finite", format!("the parameter is {point}, and must be finite and below 1e50"));
    None
}

impl Trim {
    /// The trimmed surface that a product of these factors is; adds faults to the draft.
    pub(super) fn lower(&self, draft: &mut Draft, schemes: &[CurveScheme], grid: &Grid, placed: &Placed) {
        let place = draft.place.clone();
        draft.place = format!("{place}/trim");
        if let Some(surface) = self.surface(draft, schemes, grid, placed) {
            // What is drawn of it may stand for it.
            if !draft.states.iter().any(|state| state.leaf == LeafPrimitive::Simplex && state.dimension == 3) {
                simplex(draft, 3);
            }
            draft.trimmed.push(surface);
            // Loops may have cut away any of its borders: it takes no part in joins.
            draft.borders = Borders::None;
        }
        draft.place = place;
    }

    fn surface(&self, draft: &mut Draft, schemes: &[CurveScheme], grid: &Grid, placed: &Placed) -> Option<TrimmedSurface> {
        let spans = match schemes {
            [u, v] => intervals(u, grid.size[0]).zip(intervals(v, grid.size[1])),
            _ => None,
        };
        let Some((u, v)) = spans else {
            draft.error("", "trim.surface", "only Bezier and spline surfaces can be trimmed".into());
            return None;
        };
        for (direction, spans) in [&u, &v].into_iter().enumerate() {
            if let Some(parted) = (1..spans.len()).find(|&next| !placed.joined[direction][next - 1]) {
                let message = format!(
                    "the surface is parted at the knot {} of direction {direction}, whose multiplicity is degree + 1; trim its parts one by one",
                    spans[parted][0]
                );
                draft.error("", "trim.parted", message);
                return None;
            }
        }
        let ends = |spans: &[[f64; 2]]| [spans[0][0], spans[spans.len() - 1][1]];
        let (across, along) = (ends(&u), ends(&v));
        let region = self.region(draft, [[across[0], along[0]], [across[1], along[1]]])?;
        let mut bezier = Vec::new();
        for (direction, scheme) in schemes.iter().enumerate() {
            let mut faults = Faults { draft, site: Site::Direction(direction), points: "/control_points", count: 0 };
            bezier.push(scheme.factor(grid.size[direction], Form::Bezier, &mut faults)?);
        }
        let closed = [0, 1].map(|direction| placed.joined[direction].last() == Some(&true));
        let cells = cells(&bezier, grid, placed);
        Some(TrimmedSurface { intervals: [u, v], closed, cells, orders: [0, 1].map(|k| bezier[k].dimension()), region })
    }

    fn region(&self, draft: &mut Draft, domain: [[f64; 2]; 2]) -> Option<Region> {
        let count = self.outer.iter().chain(&self.inner).map(Vec::len).sum::<usize>();
        if count > MOST_CURVES {
            draft.error("", "trim.curves", format!("{count} trim curves, and {MOST_CURVES} are possible"));
            return None;
        }
        let place = draft.place.clone();
        let mut read = |name: String, curves: &Vec<TrimCurve>| -> Option<Vec<Vec<Arc>>> {
            let mut list = Some(Vec::with_capacity(curves.len()));
            for (index, curve) in curves.iter().enumerate() {
                draft.place = format!("{place}{name}/{index}");
                match (curve.arcs(draft), &mut list) {
                    (Some(arcs), Some(known)) => known.push(arcs),
                    _ => list = None,
                }
            }
            list
        };
        let outer = self.outer.as_ref().map(|curves| read("/outer".into(), curves));
        let inner: Vec<_> = self.inner.iter().enumerate().map(|(index, curves)| read(format!("/inner/{index}"), curves)).collect();
        draft.place = place;
        let outer = match outer {
            Some(None) => return None,
            Some(list) => list,
            None => None,
        };
        match Region::new(domain, outer, inner.into_iter().collect::<Option<Vec<_>>>()?) {
            Ok(region) => Some(region),
            Err(fault) => {
                let (pointer, code, message) = self.told(&fault);
                draft.error(&pointer, code, message);
                None
            }
        }
    }

    /// The pointer of a curve, and what it is called.
    fn named(&self, place: CurvePlace) -> (String, String) {
        match (place.inner, &self.outer) {
            (Some(inner), _) => (format!("/inner/{inner}/{}", place.curve), format!("curve {} of inner loop {inner}", place.curve)),
            (None, Some(_)) => (format!("/outer/{}", place.curve), format!("curve {} of the outer loop", place.curve)),
            (None, None) => (String::new(), "the border of the domain".into()),
        }
    }

    fn told(&self, fault: &RegionFault) -> (String, &'static str, String) {
        match fault {
            RegionFault::Open { place, end, start } => {
                let (pointer, name) = self.named(*place);
                let message = format!(
                    "{name} starts at {start:?}, and the curve before it ends at {end:?}: gaps up to {GAP:e} of the domain are closed; \
                     loops must be closed chains"
                );
                (pointer, "trim.open", message)
            }
            RegionFault::Empty { place } => {
                let pointer = place.inner.map_or("/outer".into(), |inner| format!("/inner/{inner}"));
                (pointer, "trim.empty", "the loop has no curve, or is a single point".into())
            }
            RegionFault::Outside { place, at } => {
                let (pointer, name) = self.named(*place);
                let message = format!("{name} leaves the surface's domain near {at:?}; cut it at the border and go along that");
                (pointer, "trim.outside", message)
            }
            RegionFault::Meet { places, at } => {
                // The later one is said to be wrong.
                let mut places = *places;
                places.sort_by_key(|place| (place.inner.map_or(0, |inner| inner + 1), place.curve));
                let ((_, first), (pointer, second)) = (self.named(places[0]), self.named(places[1]));
                let message = format!("{first} meets {second} near {at:?}; loops must be simple and apart: write loops that touch as one");
                (pointer, "trim.crossing", message)
            }
            RegionFault::Cusp { place, at } => {
                let (pointer, name) = self.named(*place);
                (pointer, "trim.cusp", format!("{name} turns back on what comes before it near {at:?}, which leaves no angle between them"))
            }
            RegionFault::Entangled { arcs } => {
                let message = format!("the trim curves come so close that {arcs} pieces do not suffice to tell them apart");
                (String::new(), "trim.crossing", message)
            }
            RegionFault::NotInside { inner } => {
                (format!("/inner/{inner}"), "trim.nesting", format!("inner loop {inner} is not inside the outer loop"))
            }
            RegionFault::Nested { inner, other } => {
                (format!("/inner/{inner}"), "trim.nesting", format!("inner loop {inner} is inside inner loop {other}, which is a hole"))
            }
        }
    }
}

/// The Bezier points of every pair of spans.
fn cells(factors: &[Factor], grid: &Grid, placed: &Placed) -> Vec<SpanCell> {
    let columns = grid.size[1];
    let pairs = factors[0].spans.iter().flat_map(|u| factors[1].spans.iter().map(move |v| (u, v)));
    let cell = |(index, (u, v)): (usize, (&super::factor::Span, &super::factor::Span))| {
        let mut points = Vec::with_capacity(u.controls.len() * v.controls.len());
        for row in &u.controls {
            for column in &v.controls {
                let mut sum = [0.0; 4];
                for (&(i, a), &(j, b)) in row.iter().flat_map(|first| column.iter().map(move |second| (first, second))) {
                    let point = &grid.points[i * columns + j];
                    (0..4).for_each(|k| sum[k] += a * b * point[k]);
                }
                points.push(sum);
            }
        }
        SpanCell { root: placed.roots[index], points, collapsed: placed.collapsed[index] }
    };
    pairs.enumerate().map(cell).collect()
}
