//! Affine maps of space, in either of their two forms, and points.

use glam::{DMat3, DVec3, DVec4};
use lacuna_kernel::model::AffineMap;

use super::grammar::{LINEAR_IF_ANY, LINEAR_MAP, TURNED_MAP, TURNS};
use super::node::{Place, Value};
use super::walk::{Walker, length};
use crate::diagnostic::code;

/// An affine map: `linear` and `translation`, or scale, rotation and translation.
pub(super) fn affine_map(walker: &mut Walker<'_>, place: Place<'_>) -> Option<AffineMap> {
    let is_linear = matches!(&place.node.value, Value::Object(entries) if entries.iter().any(|(name, _)| name == "linear"));
    let members =
        if is_linear { walker.object_of(place, &LINEAR_MAP, TURNS)? } else { walker.object_of(place, &TURNED_MAP, LINEAR_IF_ANY)? };
    let translation = match members.get("translation") {
        Some(place) => point(walker, place),
        None => Some(DVec3::ZERO),
    };
    let linear = match members.get("linear") {
        Some(matrix) => {
            for turn in TURNS {
                if let Some(conflict) = members.get(turn.name) {
                    walker.fault(&conflict, code::CONFLICTING_MEMBERS, || {
                        format!("\"{}\" and \"linear\" both state the linear part; keep one", turn.name)
                    });
                }
            }
            rows(walker, matrix)
        }
        None => {
            let axis = members.get("axis").map_or(Some(DVec3::Z), |place| axis(walker, place));
            let angle = members.get("angle_deg").map_or(Some(0.0), |place| walker.number(place));
            let scale = members.get("scale").map_or(Some(DVec3::ONE), |place| scale(walker, place));
            let linear = rotation(axis?, angle?) * DMat3::from_diagonal(scale?);
            if !linear.is_finite() {
                walker.fault(&place, code::NOT_FINITE, || "the scale is too large for double precision; use a smaller one".into());
            }
            Some(linear)
        }
    };
    Some(AffineMap { linear: linear?, translation: translation? })
}

fn rows(walker: &mut Walker<'_>, place: Place<'_>) -> Option<DMat3> {
    const EXPECTED: &str = "three rows of three numbers";
    let rows = walker.each(place, EXPECTED, |walker, row| walker.numbers::<3>(row, "a row of three numbers"));
    match (length(place.node), rows.as_deref()) {
        (Some(found), _) if found != 3 => walker.wrong_length(&place, found, EXPECTED),
        (_, Some(&[x, y, z])) => Some(DMat3::from_cols_array_2d(&[x, y, z]).transpose()),
        _ => None,
    }
}

fn scale(walker: &mut Walker<'_>, place: Place<'_>) -> Option<DVec3> {
    match place.node.value {
        Value::Array(_) | Value::Numbers(_) => walker.numbers::<3>(place, "one factor, or three").map(DVec3::from_array),
        _ => walker.number(place).map(DVec3::splat),
    }
}

/// A direction of length one. Divided by its largest component first, so that neither huge nor
/// subnormal axes overflow or vanish.
fn axis(walker: &mut Walker<'_>, place: Place<'_>) -> Option<DVec3> {
    let axis = DVec3::from_array(walker.numbers::<3>(place, "an axis of three numbers")?);
    let largest = axis.abs().max_element();
    if largest == 0.0 {
        walker.fault(&place, code::ZERO_AXIS, || "the axis has length zero; expected a direction, for example [0, 0, 1]".into());
        return None;
    }
    let axis = axis / largest;
    Some(axis / axis.length())
}

/// R(axis, angle) after Rodrigues, exact for multiples of a quarter turn about a coordinate axis.
pub(super) fn rotation(axis: DVec3, angle_deg: f64) -> DMat3 {
    let (sine, cosine) = sine_cosine(angle_deg);
    let DVec3 { x, y, z } = axis;
    let rest = 1.0 - cosine;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    DMat3::from_cols_array(&[
        // why: 1 - (1 - c)(y^2 + z^2) is c + (1 - c) x^2, and exactly 1 when the axis is x
        1.0 - rest * (yy + zz),
        rest * x * y + sine * z,
        rest * x * z - sine * y,
        rest * x * y - sine * z,
        1.0 - rest * (xx + zz),
        rest * y * z + sine * x,
        rest * x * z + sine * y,
        rest * y * z - sine * x,
        1.0 - rest * (xx + yy),
    ])
}

/// Sine and cosine of an angle in degrees, within 2^-52, the same bits on every machine: the reduction to
/// an eighth of a turn is exact, and the series uses additions and multiplications alone. (The sine of
/// a platform's mathematical library differs between platforms, and a model's digest must not.)
fn sine_cosine(angle_deg: f64) -> (f64, f64) {
    let turn = angle_deg % 360.0;
    let quarter = (turn / 90.0).round();
    let rest = turn - 90.0 * quarter;
    let (sine, cosine) = if rest.abs() == 30.0 {
        (0.5_f64.copysign(rest), 0.75_f64.sqrt())
    } else if rest.abs() == 45.0 {
        (std::f64::consts::FRAC_1_SQRT_2.copysign(rest), std::f64::consts::FRAC_1_SQRT_2)
    } else {
        let radians = rest * (std::f64::consts::PI / 180.0);
        (radians * alternating_series(radians * radians, 2.0), alternating_series(radians * radians, 1.0))
    };
    // why: -4 to 4 quarters
    #[allow(clippy::cast_possible_truncation)]
    match (quarter as i64).rem_euclid(4) {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    }
}

/// 1 - s/(f(f+1)) + s^2/(f(f+1)(f+2)(f+3)) - ..., ten terms: the cosine's series for f = 1, and the
/// sine's divided by its argument for f = 2. For s <= (pi/4)^2 the rest is below 1e-20.
fn alternating_series(square: f64, first: f64) -> f64 {
    (0..10).rev().fold(1.0, |sum, term| {
        let factor = first + 2.0 * f64::from(term);
        1.0 - square / (factor * (factor + 1.0)) * sum
    })
}

/// A point [x, y, z] of lengths, in mm.
pub(super) fn point(walker: &mut Walker<'_>, place: Place<'_>) -> Option<DVec3> {
    let [x, y, z] = walker.numbers::<3>(place, "[x, y, z]")?;
    in_mm(walker, &place, [x, y, z])
}

/// Points [x, y, z], `least` or more.
pub(super) fn points(walker: &mut Walker<'_>, place: Place<'_>, least: usize) -> Option<Vec<DVec3>> {
    walker.each_of(place, least, "an array of points [x, y, z]", point)
}

/// A control point [x, y, z] or [x, y, z, w], with the weight if it is given.
pub(super) fn control_point(walker: &mut Walker<'_>, place: Place<'_>) -> Option<(DVec3, Option<f64>)> {
    const EXPECTED: &str = "[x, y, z] or [x, y, z, w]";
    match length(place.node) {
        Some(4) => {
            let [x, y, z, w] = walker.numbers::<4>(place, EXPECTED)?;
            let point = in_mm(walker, &place, [x, y, z]);
            if w > 0.0 {
                return Some((point?, Some(w)));
            }
            walker.report.add(&place.path.index(3), place.node.offset, code::NOT_POSITIVE, || {
                format!("is {}; expected a weight above zero", super::node::number_text(w))
            });
            None
        }
        _ => {
            let [x, y, z] = walker.numbers::<3>(place, EXPECTED)?;
            Some((in_mm(walker, &place, [x, y, z])?, None))
        }
    }
}

/// As [`control_point`], with weight 1 when none is given.
pub(super) fn weighted_point(walker: &mut Walker<'_>, place: Place<'_>) -> Option<DVec4> {
    control_point(walker, place).map(|(point, weight)| point.extend(weight.unwrap_or(1.0)))
}

fn in_mm(walker: &mut Walker<'_>, place: &Place<'_>, coordinates: [f64; 3]) -> Option<DVec3> {
    let [x, y, z] = coordinates;
    Some(DVec3::new(walker.millimetres(place, x)?, walker.millimetres(place, y)?, walker.millimetres(place, z)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_agree_with_the_library() {
        for step in -2000..2000 {
            let angle = f64::from(step) * 0.37;
            let (sine, cosine) = sine_cosine(angle);
            assert!((sine - angle.to_radians().sin()).abs() < 4e-15, "{angle}");
            assert!((cosine - angle.to_radians().cos()).abs() < 4e-15, "{angle}");
            assert!((sine * sine + cosine * cosine - 1.0).abs() < 4e-16, "{angle}");
        }
    }

    #[test]
    fn known_angles_are_exact() {
        assert_eq!(sine_cosine(90.0), (1.0, 0.0));
        assert_eq!(sine_cosine(-180.0), (0.0, -1.0));
        assert_eq!(sine_cosine(-270.0), (1.0, 0.0));
        assert_eq!(sine_cosine(60.0).1, 0.5);
        assert_eq!(sine_cosine(150.0).0, 0.5);
        assert_eq!(sine_cosine(3600.0 + 30.0).0, 0.5);
        assert_eq!(sine_cosine(45.0).0, sine_cosine(45.0).1);
    }

    #[test]
    fn a_quarter_turn_about_z_takes_x_to_y() {
        let turned = rotation(DVec3::Z, 90.0);
        assert_eq!(turned * DVec3::X, DVec3::Y);
        assert_eq!(turned * DVec3::Z, DVec3::Z);
        let third = rotation(DVec3::ONE / 3.0_f64.sqrt(), 120.0);
        assert!((third * DVec3::X - DVec3::Y).length() < 1e-15);
    }
}
