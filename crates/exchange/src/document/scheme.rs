//! Reads curve schemes: curves, their products and their sums.

use glam::DVec3;
use lacuna_kernel::model::{ControlNet, Curve, CurveScheme, Parametrization, Sum, TensorProduct};

use super::bcifs::curve_states;
use super::grammar::{CURVES, Member, NURBS_SURFACE, NURBS_VOLUME, Object, SCHEMES, SUM, TENSOR};
use super::node::{Place, Value, quoted};
use super::transform::{affine_map, control_point, point};
use super::trim::trim;
use super::walk::{Members, Walker, length, suggestion};
use crate::diagnostic::code;

/// Bias and tension of a beta-spline when they are absent: the uniform B-spline.
const NO_BIAS: f64 = 1.0;
const NO_TENSION: f64 = 0.0;
/// Tension of the four-point scheme when it is absent: it reproduces cubics.
const CUBIC: f64 = 0.0625;
/// Parameters of corner cutting when they are absent: Chaikin's.
const CHAIKIN: f64 = 0.25;

const PARAMETRIZATIONS: [(&str, Parametrization); 3] =
    [("uniform", Parametrization::Uniform), ("centripetal", Parametrization::Centripetal), ("chordal", Parametrization::Chordal)];

/// A curve of the given family.
pub(super) fn curve(walker: &mut Walker<'_>, place: Place<'_>, family: &str, added: &[Member]) -> Option<Curve> {
    let (_, _, grammar) = CURVES.iter().find(|(name, _, _)| *name == family)?;
    let members = walker.object_of(place, grammar, added)?;
    let scheme = scheme_of(walker, family, &members);
    let control_points = if family == "interpolation" {
        let points = members.get("points").and_then(|place| walker.each_of(place, 3, "an array of points [x, y, z]", point));
        points.map(ControlNet::line)
    } else if members.get("weights").is_some() || matches!(family, "bezier_curve" | "nurbs_curve") {
        net(walker, &members, 1)
    } else {
        let points = members.get("control_points").and_then(|place| walker.each_of(place, 1, "an array of points [x, y, z]", point));
        points.map(ControlNet::line)
    };
    Some(Curve { scheme: scheme?, control_points: control_points? })
}

/// The members of a scheme of the given family.
fn scheme_of(walker: &mut Walker<'_>, family: &str, members: &Members<'_>) -> Option<CurveScheme> {
    let number = |walker: &mut Walker<'_>, name: &str, absent: f64| members.get(name).map_or(Some(absent), |place| walker.number(place));
    let closed = |walker: &mut Walker<'_>| members.get("closed").map_or(Some(false), |place| walker.flag(place));
    Some(match family {
        "nurbs_curve" => {
            let degree = members.get("degree").and_then(|place| degree(walker, place));
            let knots = members.get("knots").and_then(|place| knots(walker, place));
            CurveScheme::Nurbs { degree: degree?, knots: knots? }
        }
        "catmull_rom" => {
            let parametrization = match members.get("parametrization") {
                Some(place) => walker.word(place, "a parametrization", &PARAMETRIZATIONS),
                None => Some(Parametrization::Uniform),
            };
            let closed = closed(walker);
            CurveScheme::CatmullRom { parametrization: parametrization?, closed: closed? }
        }
        "beta_spline" => {
            let (beta1, beta2) = (number(walker, "beta1", NO_BIAS), number(walker, "beta2", NO_TENSION));
            let closed = closed(walker);
            CurveScheme::BetaSpline { beta1: beta1?, beta2: beta2?, closed: closed? }
        }
        "corner_cutting" => {
            let (a, b) = (number(walker, "a", CHAIKIN), number(walker, "b", CHAIKIN));
            let closed = closed(walker);
            CurveScheme::CornerCutting { a: a?, b: b?, closed: closed? }
        }
        "four_point" => {
            let (tension, closed) = (number(walker, "w", CUBIC), closed(walker));
            CurveScheme::FourPoint { tension: tension?, closed: closed? }
        }
        "interpolation" => return interpolation(walker, members),
        "bcifs" => return curve_states(walker, members),
        "ifs" => CurveScheme::Ifs {
            maps: members.get("maps").and_then(|place| walker.each_of(place, 2, "an array of affine maps", affine_map))?,
        },
        _ => CurveScheme::Bezier,
    })
}

fn interpolation(walker: &mut Walker<'_>, members: &Members<'_>) -> Option<CurveScheme> {
    match (members.get("vertical_scaling"), members.get("maps")) {
        (Some(place), None) => {
            let vertical_scaling = walker.each_of(place, 1, "an array of factors", |walker, factor| walker.number(factor))?;
            Some(CurveScheme::Interpolation { vertical_scaling })
        }
        (None, Some(place)) => Some(CurveScheme::AffineInterpolation { maps: walker.each_of(place, 1, "an array of maps", affine_map)? }),
        (Some(_), Some(place)) => {
            walker.fault(&place, code::CONFLICTING_MEMBERS, || "\"vertical_scaling\" states the maps already; keep one".into());
            None
        }
        (None, None) => {
            walker.fault(&members.place, code::MISSING_MEMBER, || "an interpolation needs \"vertical_scaling\" or \"maps\"".into());
            None
        }
    }
}

pub(super) fn degree(walker: &mut Walker<'_>, place: Place<'_>) -> Option<usize> {
    walker.integer(place, "a degree").and_then(|degree| usize::try_from(degree).ok())
}

pub(super) fn knots(walker: &mut Walker<'_>, place: Place<'_>) -> Option<Vec<f64>> {
    walker.each_of(place, 4, "an array of knots", |walker, knot| walker.number(knot))
}

/// A `bezier_surface`, `nurbs_surface` or `nurbs_volume`.
pub(super) fn surface(walker: &mut Walker<'_>, place: Place<'_>, grammar: &Object, added: &[Member]) -> Option<TensorProduct> {
    let members = walker.object_of(place, grammar, added)?;
    let directions = if grammar.title == NURBS_VOLUME.title { 3 } else { 2 };
    let schemes = if [NURBS_SURFACE.title, NURBS_VOLUME.title].contains(&grammar.title) {
        let degrees = members.get("degree").and_then(|place| match place.node.value {
            Value::Array(_) | Value::Numbers(_) => of_each_direction(walker, place, directions, "degrees", degree),
            _ => degree(walker, place).map(|degree| vec![degree; directions]),
        });
        let knots = members.get("knots").and_then(|place| of_each_direction(walker, place, directions, "knot vectors", knots));
        let pairs = degrees.zip(knots);
        pairs.map(|(degrees, knots)| degrees.into_iter().zip(knots).map(|(degree, knots)| CurveScheme::Nurbs { degree, knots }).collect())
    } else {
        Some(vec![CurveScheme::Bezier; directions])
    };
    let control_points = net(walker, &members, directions);
    let trim = match members.get("trim") {
        Some(place) => trim(walker, place).map(Some),
        None => Some(None),
    };
    Some(TensorProduct { schemes: schemes?, control_points: control_points?, separate: false, trim: trim? })
}

/// As many values as directions.
fn of_each_direction<T>(
    walker: &mut Walker<'_>,
    place: Place<'_>,
    directions: usize,
    meaning: &str,
    read: impl FnMut(&mut Walker<'_>, Place<'_>) -> Option<T>,
) -> Option<Vec<T>> {
    let expected = format!("{directions} {meaning}, one for each direction");
    let values = walker.each(place, &expected, read);
    match length(place.node) {
        Some(found) if found != directions => walker.wrong_length(&place, found, &expected),
        _ => values,
    }
}

/// A `tensor`.
pub(super) fn tensor(walker: &mut Walker<'_>, place: Place<'_>, added: &[Member]) -> Option<TensorProduct> {
    let members = walker.object_of(place, &TENSOR, added)?;
    let factors: Vec<Option<CurveScheme>> =
        ["u", "v", "w"].into_iter().filter_map(|name| members.get(name)).map(|place| factor(walker, place)).collect();
    let control_points = net(walker, &members, if members.get("w").is_some() { 3 } else { 2 });
    let schemes = factors.into_iter().collect::<Option<Vec<_>>>()?;
    Some(TensorProduct { schemes, control_points: control_points?, separate: true, trim: None })
}

/// A curve scheme without control points.
fn factor(walker: &mut Walker<'_>, place: Place<'_>) -> Option<CurveScheme> {
    let family = family(walker, place, SCHEMES.iter().map(|(name, _, _)| *name))?;
    let (_, _, grammar) = SCHEMES.iter().find(|(name, _, _)| *name == family)?;
    let members = walker.object(place, grammar)?;
    scheme_of(walker, family, &members)
}

/// The family of a curve, one of those given.
pub(super) fn family<'p>(walker: &mut Walker<'_>, place: Place<'p>, names: impl Iterator<Item = &'static str>) -> Option<&'p str> {
    let Value::Object(entries) = &place.node.value else {
        return walker.wrong_type(&place, "an object (a curve with its family)");
    };
    let names: Vec<&str> = names.collect();
    let Some((name, node)) = entries.iter().find(|(name, _)| name == "family") else {
        walker.fault(&place, code::MISSING_MEMBER, || format!("a curve needs the member \"family\": one of {}", names.join(", ")));
        return None;
    };
    let place = Place { node, path: place.path.member(name) };
    let found = node.text();
    if let Some(family) = found.filter(|family| names.contains(family)) {
        return Some(family);
    }
    let text = walker.text(place, "the name of a family")?;
    walker.fault(&place, code::UNKNOWN_VALUE, || {
        format!("{} is not a family of curves; {}", quoted(text), suggestion(text, names.iter().copied()))
    });
    None
}

/// A `sum`.
pub(super) fn sum(walker: &mut Walker<'_>, place: Place<'_>, added: &[Member]) -> Option<Sum> {
    let members = walker.object_of(place, &SUM, added)?;
    let [u, v] = ["u", "v"].map(|name| {
        let place = members.get(name)?;
        let family = family(walker, place, CURVES.iter().map(|(name, _, _)| *name))?;
        curve(walker, place, family, &[])
    });
    Some(Sum { u: u?, v: v? })
}

/// The control points and weights of a net. Weights stand in `weights` or in the points, not in both.
fn net(walker: &mut Walker<'_>, members: &Members<'_>, directions: usize) -> Option<ControlNet> {
    let points = members.get("control_points").and_then(|place| {
        nested(walker, place, directions, "an array of points [x, y, z] or [x, y, z, w]", &mut |walker, place| control_point(walker, place))
    });
    let weights = match members.get("weights") {
        None => Some(None),
        Some(place) => {
            let weights = nested(walker, place, directions, "an array of weights", &mut |walker, place| walker.positive(place, "a weight"));
            if let (Some((expected, points)), Some((found, _))) = (&points, &weights) {
                if expected != found {
                    walker.fault(&place, code::WRONG_LENGTH, || {
                        format!("are {} weights for {} control points; expected one for each", by(found), by(expected))
                    });
                    return None;
                }
                if points.iter().any(|(_, weight)| weight.is_some()) {
                    walker.fault(&place, code::CONFLICTING_MEMBERS, || {
                        "the control points carry weights already; keep either [x, y, z, w] or \"weights\"".into()
                    });
                    return None;
                }
            }
            weights.map(|(_, weights)| Some(weights))
        }
    };
    let (size, points) = points?;
    let own = points.iter().any(|(_, weight)| weight.is_some());
    let own = own.then(|| points.iter().map(|(_, weight)| weight.unwrap_or(1.0)).collect());
    let points: Vec<DVec3> = points.into_iter().map(|(point, _)| point).collect();
    Some(ControlNet { size, points, weights: weights?.or(own) })
}

/// A size in every direction, as people write it: 4 x 3.
fn by(size: &[usize]) -> String {
    size.iter().map(ToString::to_string).collect::<Vec<_>>().join(" x ")
}

/// Reads one element of a nested list.
type Read<'r, T> = &'r mut dyn FnMut(&mut Walker<'_>, Place<'_>) -> Option<T>;

/// A list, or a list of lists of one length and so on: its size in every direction, and its elements.
fn nested<T>(walker: &mut Walker<'_>, place: Place<'_>, depth: usize, expected: &str, read: Read<'_, T>) -> Option<(Vec<usize>, Vec<T>)> {
    if depth <= 1 {
        let elements = walker.each_of(place, 1, expected, read)?;
        return Some((vec![elements.len()], elements));
    }
    let mut size: Option<Vec<usize>> = None;
    let rows = walker.each_of(place, 1, "an array of rows", |walker, row| {
        let (found, elements) = nested(walker, row, depth - 1, expected, read)?;
        let wanted = size.get_or_insert_with(|| found.clone());
        if *wanted != found {
            let wanted = wanted.clone();
            walker.fault(&row, code::WRONG_LENGTH, || {
                format!("has {} elements, and the first row has {}; rows must be alike", by(&found), by(&wanted))
            });
            return None;
        }
        Some(elements)
    })?;
    let size = [vec![rows.len()], size.unwrap_or_default()].concat();
    Some((size, rows.into_iter().flatten().collect()))
}
