//! Reads curves: Bezier and corner cutting.

use lacuna_kernel::model::{BezierCurve, CornerCutting};

use super::grammar::{BEZIER_CURVE, CORNER_CUTTING, Member};
use super::node::Place;
use super::transform::{control_point, points};
use super::walk::{Walker, length};
use crate::diagnostic::code;

/// A `bezier_curve` shape. Weights stand in `weights` or in the points, not in both.
pub(super) fn bezier_curve(walker: &mut Walker<'_>, place: Place<'_>, added: &[Member]) -> Option<BezierCurve> {
    let members = walker.object_of(place, &BEZIER_CURVE, added)?;
    let points_place = members.get("control_points");
    let points = points_place.and_then(|place| walker.each_of(place, 1, "an array of points [x, y, z] or [x, y, z, w]", control_point));
    let weights = match members.get("weights") {
        Some(place) => {
            let weights = walker.each_of(place, 1, "an array of weights", |walker, weight| walker.positive(weight, "a weight"));
            if let (Some(found), Some(expected)) = (length(place.node), points_place.and_then(|points| length(points.node)))
                && found != expected
            {
                walker.fault(&place, code::WRONG_LENGTH, || {
                    format!("has {found} weights for {expected} control points; expected one for each")
                });
            }
            if points.as_ref().is_some_and(|points| points.iter().any(|(_, weight)| weight.is_some())) {
                walker.fault(&place, code::CONFLICTING_MEMBERS, || {
                    "the control points carry weights already; keep either [x, y, z, w] or \"weights\"".into()
                });
            }
            weights.map(Some)
        }
        None => Some(None),
    };
    let points = points?;
    let own_weights =
        points.iter().any(|(_, weight)| weight.is_some()).then(|| points.iter().map(|(_, weight)| weight.unwrap_or(1.0)).collect());
    Some(BezierCurve { control_points: points.into_iter().map(|(point, _)| point).collect(), weights: weights?.or(own_weights) })
}

/// Parameter of Chaikin's scheme, for both parameters when they are absent.
const CHAIKIN: f64 = 0.25;

/// A `corner_cutting` shape.
pub(super) fn corner_cutting(walker: &mut Walker<'_>, place: Place<'_>, added: &[Member]) -> Option<CornerCutting> {
    let members = walker.object_of(place, &CORNER_CUTTING, added)?;
    let control_points = members.get("control_points").and_then(|place| points(walker, place, 3));
    let a = members.get("a").map_or(Some(CHAIKIN), |place| walker.number(place));
    let b = members.get("b").map_or(Some(CHAIKIN), |place| walker.number(place));
    let closed = members.get("closed").map_or(Some(false), |place| walker.flag(place));
    Some(CornerCutting { control_points: control_points?, a: a?, b: b?, closed: closed? })
}
