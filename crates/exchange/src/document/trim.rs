//! Reads trim loops: curves in the parameter plane of a surface. Parameters have no unit.

use glam::DVec2;
use lacuna_kernel::model::{CurveScheme, Trim, TrimCurve};

use super::grammar::{TRIM, TRIM_CURVES};
use super::node::{Place, number_text};
use super::scheme::{degree, family, knots};
use super::walk::{Members, Walker, length};
use crate::diagnostic::code;

/// The `trim` of a surface.
pub(super) fn trim(walker: &mut Walker<'_>, place: Place<'_>) -> Option<Trim> {
    let members = walker.object(place, &TRIM)?;
    let outer = match members.get("outer") {
        Some(place) => trim_loop(walker, place).map(Some),
        None => Some(None),
    };
    let inner = match members.get("inner") {
        Some(place) => walker.each(place, "an array of loops, each an array of curves", trim_loop),
        None => Some(Vec::new()),
    };
    Some(Trim { outer: outer?, inner: inner? })
}

fn trim_loop(walker: &mut Walker<'_>, place: Place<'_>) -> Option<Vec<TrimCurve>> {
    walker.each_of(place, 1, "an array of curves, each starting where the one before it ends", curve)
}

fn curve(walker: &mut Walker<'_>, place: Place<'_>) -> Option<TrimCurve> {
    let family = family(walker, place, TRIM_CURVES.iter().map(|(name, _, _)| *name))?;
    let (_, _, grammar) = TRIM_CURVES.iter().find(|(name, _, _)| *name == family)?;
    let members = walker.object(place, grammar)?;
    if family == "polyline" {
        let points = members.get("points").and_then(|place| {
            walker.each_of(place, 2, "an array of parameters [u, v]", |walker, place| walker.numbers::<2>(place, "[u, v]").map(DVec2::from))
        });
        return Some(TrimCurve::Polyline(points?));
    }
    let scheme = if family == "nurbs_curve" {
        let degree = members.get("degree").and_then(|place| degree(walker, place));
        let knots = members.get("knots").and_then(|place| knots(walker, place));
        degree.zip(knots).map(|(degree, knots)| CurveScheme::Nurbs { degree, knots })
    } else {
        Some(CurveScheme::Bezier)
    };
    let (control_points, weights) = control_points(walker, &members)?;
    Some(TrimCurve::Spline { scheme: scheme?, control_points, weights })
}

/// Points and weights; weights stand in `weights` or in the points, not in both.
fn control_points(walker: &mut Walker<'_>, members: &Members<'_>) -> Option<(Vec<DVec2>, Option<Vec<f64>>)> {
    let points = members.get("control_points").and_then(|place| walker.each_of(place, 2, "an array of [u, v] or [u, v, w]", control_point));
    let weights = match members.get("weights") {
        Some(place) => {
            let weights = walker.each_of(place, 1, "an array of weights", |walker, weight| walker.positive(weight, "a weight"));
            if let (Some(points), Some(found)) = (&points, length(place.node)) {
                if found != points.len() {
                    let expected = points.len();
                    walker.fault(&place, code::WRONG_LENGTH, || {
                        format!("has {found} weights for {expected} control points; expected one for each")
                    });
                    return None;
                }
                if points.iter().any(|(_, weight)| weight.is_some()) {
                    walker.fault(&place, code::CONFLICTING_MEMBERS, || {
                        "the control points carry weights already; keep either [u, v, w] or \"weights\"".into()
                    });
                    return None;
                }
            }
            weights.map(Some)
        }
        None => Some(None),
    };
    let points = points?;
    let own = points.iter().any(|(_, weight)| weight.is_some());
    let own = own.then(|| points.iter().map(|(_, weight)| weight.unwrap_or(1.0)).collect());
    Some((points.into_iter().map(|(point, _)| point).collect(), weights?.or(own)))
}

fn control_point(walker: &mut Walker<'_>, place: Place<'_>) -> Option<(DVec2, Option<f64>)> {
    if length(place.node) != Some(3) {
        return walker.numbers::<2>(place, "[u, v] or [u, v, w]").map(|point| (DVec2::from(point), None));
    }
    let [u, v, w] = walker.numbers::<3>(place, "[u, v] or [u, v, w]")?;
    if w > 0.0 {
        return Some((DVec2::new(u, v), Some(w)));
    }
    walker.report.add(&place.path.index(2), place.node.offset, code::NOT_POSITIVE, || {
        format!("is {}; expected a weight above zero", number_text(w))
    });
    None
}
