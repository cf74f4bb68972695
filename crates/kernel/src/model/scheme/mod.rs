//! Curves that a list of control points makes: schemes, and their products.

mod factor;
mod fractal;
mod knots;
mod net;
mod own;
mod polynomial;
mod subdivision;
mod trim;

pub use net::ControlNet;
pub use trim::{Trim, TrimCurve};

use super::lower::Draft;
use super::{AffineMap, BcifsState};
use factor::{Factor, Grid, Placed, product};
use glam::DVec3;
use knots::Form;

/// How parameters are given to the points of a Catmull-Rom spline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Parametrization {
    /// Equal intervals.
    #[default]
    Uniform,
    /// Intervals as the square roots of the distances: no cusps and no loops within a span (Yuksel, Schaefer and Keyser,
    /// "Parameterization and applications of Catmull-Rom curves", Computer-Aided Design 43, 2011).
    Centripetal,
    /// Intervals as the distances.
    Chordal,
}

/// How a list of control points becomes a curve. Every scheme is linear in the points and keeps affine combinations.
#[derive(Clone, Debug, PartialEq)]
pub enum CurveScheme {
    /// A Bezier curve; n points make degree n - 1.
    Bezier,
    /// A spline of any degree on any knots.
    Nurbs {
        /// The degree d, from 1 to 9.
        degree: usize,
        /// n + d + 1 knots that do not decrease; multiplicities up to d + 1.
        knots: Vec<f64>,
    },
    /// Corner cutting: see [`super::CornerCutting`].
    CornerCutting {
        /// First parameter.
        a: f64,
        /// Second parameter.
        b: f64,
        /// Whether the polygon is closed.
        closed: bool,
    },
    /// A Catmull-Rom spline: four points make the span between the second and the third, which it interpolates.
    CatmullRom {
        /// Parameters of the points.
        parametrization: Parametrization,
        /// Whether the polygon is closed.
        closed: bool,
    },
    /// A uniformly shaped beta-spline (Barsky, "Computer graphics and geometric modeling using beta-splines", 1988).
    BetaSpline {
        /// Bias, positive; 1 is none.
        beta1: f64,
        /// Tension; 0 is none.
        beta2: f64,
        /// Whether the polygon is closed.
        closed: bool,
    },
    /// The four-point scheme (Dyn, Gregory and Levin, "A 4-point interpolatory subdivision scheme for curve design",
    /// Computer Aided Geometric Design 4, 1987): six points make the span between the third and the fourth.
    FourPoint {
        /// w; 1/16 reproduces cubics, 0 gives the polygon.
        tension: f64,
        /// Whether the polygon is closed.
        closed: bool,
    },
    /// A fractal interpolation function (Barnsley, "Fractal functions and interpolation", Constructive Approximation 2,
    /// 1986): over interval i stands the whole curve, scaled by d_i plus what is linear along it. On its own, the points'
    /// x increase and are the abscissae; in a product the points are at equal distances.
    Interpolation {
        /// d_i, one per interval, in absolute value below 1.
        vertical_scaling: Vec<f64>,
    },
    /// The edge of a user's automaton. For products only.
    Bcifs {
        /// The states; all that the first one reaches by transitions are edges between two vertices.
        states: Vec<BcifsState>,
        /// The name of the state of the curve.
        start: String,
    },
    /// The curve of affine maps, in the affine frame that four control points are. For products only.
    Ifs {
        /// Maps whose images follow each other along the curve.
        maps: Vec<AffineMap>,
    },
    /// The curve through the points whose part over interval i is its image under map i. Not for products.
    AffineInterpolation {
        /// One map per interval: it takes the first and the last point to the interval's.
        maps: Vec<AffineMap>,
    },
}

/// A curve: a scheme and its control points.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// How.
    pub scheme: CurveScheme,
    /// Of what.
    pub control_points: ControlNet,
}

/// A surface or a volume: the product of two or three schemes on a net of control points.
#[derive(Clone, Debug, PartialEq)]
pub struct TensorProduct {
    /// The schemes, one per direction of the net.
    pub schemes: Vec<CurveScheme>,
    /// The control points.
    pub control_points: ControlNet,
    /// Whether the model writes every scheme as a shape of its own (the family `tensor`), or all as one (NURBS and
    /// Bezier): where faults point to.
    pub separate: bool,
    /// What is kept of a Bezier or spline surface; all when absent.
    pub trim: Option<Trim>,
}

/// The surface u(s) + v(t): all translations of one curve along another. Its quadrilateral cells are parallelograms.
#[derive(Clone, Debug, PartialEq)]
pub struct Sum {
    /// u.
    pub u: Curve,
    /// v.
    pub v: Curve,
}

/// More control points of one cell than this are refused: three factors of degree 9 have 1000.
const MOST_CELL_POINTS: usize = 1024;
/// More root cells than this are refused.
const MOST_CELLS: usize = 1 << 20;
/// Combinations of pieces beyond which splines are written with Bezier points: one piece instead of one per stencil.
const MOST_STATES: usize = 512;

/// Where the scheme of a direction stands in the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Site {
    /// Its members are the shape's own.
    Own,
    /// Its members are lists with one entry per direction.
    Direction(usize),
    /// It is this member.
    Member(&'static str),
}

/// What is wrong with a scheme.
struct Faults<'a> {
    draft: &'a mut Draft,
    site: Site,
    /// Where the points stand.
    points: &'static str,
    count: usize,
}

impl Faults<'_> {
    /// A fault of a member of the scheme.
    fn add(&mut self, pointer: &str, code: &'static str, message: String) {
        self.count += 1;
        let pointer = match self.site {
            Site::Own => pointer.to_owned(),
            Site::Direction(direction) => match pointer.strip_prefix("/knots") {
                Some(rest) => format!("/knots/{direction}{rest}"),
                None => pointer.to_owned(),
            },
            Site::Member(name) => format!("/{name}{pointer}"),
        };
        self.draft.error(&pointer, code, message);
    }

    /// A fault of the control points.
    fn add_points(&mut self, code: &'static str, message: String) {
        self.count += 1;
        let pointer = self.points;
        self.draft.error(pointer, code, message);
    }

    /// Refuses values that are not finite or of no sensible size.
    fn moderate(&mut self, name: &str, value: f64) -> bool {
        let legal = value.is_finite() && value.abs() <= 1e6;
        if !legal {
            self.add(&format!("/{name}"), "model.not-finite", format!("{name} is {value}, and must be a finite number of moderate size"));
        }
        legal
    }

    /// Refuses lists of fewer points than `least`.
    fn enough(&mut self, count: usize, least: usize, code: &'static str) -> bool {
        if count < least {
            self.add_points(code, format!("{count} control points: {least} or more are needed"));
        }
        count >= least
    }
}

impl CurveScheme {
    /// The scheme for `count` control points; `None` after a fault.
    fn factor(&self, count: usize, form: Form, faults: &mut Faults<'_>) -> Option<Factor> {
        match self {
            Self::Bezier => polynomial::bezier(count, faults),
            Self::Nurbs { degree, knots } => knots::factor(*degree, knots, count, form, faults),
            Self::CornerCutting { a, b, closed } => subdivision::corner_cutting([*a, *b], *closed, count, faults),
            Self::CatmullRom { parametrization: Parametrization::Uniform, closed } => {
                polynomial::catmull_rom(&vec![1.0; count], *closed, count, faults)
            }
            Self::CatmullRom { .. } => {
                let message = "the parameters depend on the control points, of which a product has many rows; use uniform ones";
                faults.add("/parametrization", "tensor.scheme", message.into());
                None
            }
            Self::BetaSpline { beta1, beta2, closed } => polynomial::beta_spline([*beta1, *beta2], *closed, count, faults),
            Self::FourPoint { tension, closed } => subdivision::four_point(*tension, *closed, count, faults),
            Self::Interpolation { vertical_scaling } => fractal::interpolation(vertical_scaling, count, None, faults),
            Self::Bcifs { states, start } => own::bcifs(states, start, count, faults),
            Self::Ifs { maps } => own::ifs(maps, count, faults),
            Self::AffineInterpolation { .. } => {
                faults.add("/maps", "tensor.scheme", "affine maps belong to points in space; use vertical scaling in a product".into());
                None
            }
        }
    }
}

impl Curve {
    pub(super) fn lower(&self, draft: &mut Draft) {
        if let Some((factor, grid)) = self.cells(draft) {
            product(draft, &[factor], &grid);
        }
    }

    /// The scheme, and the control points that it applies to.
    fn cells(&self, draft: &mut Draft) -> Option<(Factor, Grid)> {
        let place = match self.scheme {
            CurveScheme::Interpolation { .. } | CurveScheme::AffineInterpolation { .. } => "/points",
            _ => "/control_points",
        };
        let grid = self.control_points.grid(draft, 1, place)?;
        let points = &self.control_points.points;
        let mut faults = Faults { draft, site: Site::Own, points: place, count: 0 };
        let factor = match &self.scheme {
            CurveScheme::CatmullRom { parametrization, closed } => {
                let intervals = polynomial::intervals(points, *parametrization, &mut faults)?;
                polynomial::catmull_rom(&intervals, *closed, points.len(), &mut faults)?
            }
            CurveScheme::Interpolation { vertical_scaling } => return fractal::graph(points, vertical_scaling, grid, &mut faults),
            CurveScheme::AffineInterpolation { maps } => return fractal::affine(points, maps, &mut faults),
            scheme => scheme.factor(points.len(), Form::Intervals, &mut faults)?,
        };
        Some((factor, grid))
    }
}

impl TensorProduct {
    pub(super) fn lower(&self, draft: &mut Draft) {
        let Some(grid) = self.control_points.grid(draft, self.schemes.len(), "/control_points") else { return };
        if !(2..=3).contains(&self.schemes.len()) {
            return draft.error("", "tensor.directions", format!("{} directions: two or three are possible", self.schemes.len()));
        }
        for form in [Form::Intervals, Form::Bezier] {
            let factor = |(direction, scheme): (usize, &CurveScheme)| {
                let site = if self.separate { Site::Member(["u", "v", "w"][direction]) } else { Site::Direction(direction) };
                scheme.factor(grid.size[direction], form, &mut Faults { draft, site, points: "/control_points", count: 0 })
            };
            let factors: Vec<Option<Factor>> = self.schemes.iter().enumerate().map(factor).collect();
            let Some(factors) = factors.into_iter().collect::<Option<Vec<Factor>>>() else { return };
            let states: usize = factors.iter().map(|factor| factor.pieces.len()).product();
            if form == Form::Bezier || states <= MOST_STATES {
                let placed = lower_product(draft, &factors, &grid);
                if let (Some(trim), Some(placed)) = (&self.trim, placed) {
                    trim.lower(draft, &self.schemes, &grid, &placed);
                }
                return;
            }
        }
    }
}

impl Sum {
    pub(super) fn lower(&self, draft: &mut Draft) {
        let place = draft.place.clone();
        let cells = [("u", &self.u), ("v", &self.v)].map(|(name, curve)| {
            draft.place = format!("{place}/{name}");
            curve.cells(draft)
        });
        draft.place = place;
        let [Some((u_factor, u)), Some((v_factor, v))] = cells else { return };
        // With weights w_i and w_j, the sum of the curves has the weights w_i w_j and the points U_i + V_j.
        let mut points = Vec::with_capacity(u.points.len() * v.points.len());
        for a in &u.points {
            points.extend(
                v.points.iter().map(|b| [a[0] * b[3] + b[0] * a[3], a[1] * b[3] + b[1] * a[3], a[2] * b[3] + b[2] * a[3], a[3] * b[3]]),
            );
        }
        let grid = Grid { size: vec![u.points.len(), v.points.len()], points, rational: u.rational || v.rational };
        lower_product(draft, &[u_factor, v_factor], &grid);
    }
}

/// Refuses what is too large, and adds the rest to the draft.
fn lower_product(draft: &mut Draft, factors: &[Factor], grid: &Grid) -> Option<Placed> {
    let points: usize = factors.iter().map(Factor::dimension).product();
    if points > MOST_CELL_POINTS {
        let message = format!("each cell has {points} control points, and {MOST_CELL_POINTS} are possible; lower the degrees");
        draft.error("", "tensor.dimension", message);
        return None;
    }
    let cells =
        factors.iter().try_fold(1_usize, |total, factor| total.checked_mul(factor.spans.len())).filter(|&cells| cells <= MOST_CELLS);
    if cells.is_none() {
        draft.error("", "tensor.cells", format!("more than {MOST_CELLS} cells; split the model"));
        return None;
    }
    Some(product(draft, factors, grid))
}

/// Indices of the control points of successive spans of `width` points each.
fn windows(count: usize, width: usize, closed: bool) -> impl Iterator<Item = Vec<usize>> {
    let spans = if closed { count } else { (count + 1).saturating_sub(width) };
    (0..spans).map(move |first| (first..first + width).map(|point| point % count).collect())
}

/// Distances of successive points.
fn lengths(points: &[DVec3]) -> Vec<f64> {
    (0..points.len()).map(|k| points[k].distance(points[(k + 1) % points.len()])).collect()
}
