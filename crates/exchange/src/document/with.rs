//! What a shape may be held against, as a word and numbers.

use lacuna_fabrication::job::With;
use lacuna_kernel::measure::contact::Primitive;

use super::grammar::WITH;
use super::job::one_of;
use super::node::Place;
use super::walk::Walker;
use crate::diagnostic::code;

/// The words that take numbers, with how many.
pub const PRIMITIVES: [(&str, usize); 7] = [("point", 3), ("segment", 6), ("ray", 6), ("line", 6), ("plane", 4), ("box", 6), ("ball", 4)];

/// The word of the shape itself.
pub const ITSELF: &str = "self";

/// All words.
#[must_use]
pub fn words() -> Vec<&'static str> {
    PRIMITIVES.iter().map(|(word, _)| *word).chain([ITSELF]).collect()
}

/// The primitive of a word and its numbers, in mm; `None` for another word or another count.
#[must_use]
pub fn primitive(word: &str, numbers: &[f64]) -> Option<Primitive> {
    let two = || <[f64; 6]>::try_from(numbers).ok().map(|[a, b, c, d, e, f]| ([a, b, c], [d, e, f]));
    let four = || <[f64; 4]>::try_from(numbers).ok().map(|[a, b, c, d]| ([a, b, c], d));
    match word {
        "point" => <[f64; 3]>::try_from(numbers).ok().map(Primitive::Point),
        "segment" => two().map(|(from, to)| Primitive::Segment([from, to])),
        "ray" => two().map(|(origin, direction)| Primitive::Ray { origin, direction }),
        "line" => two().map(|(origin, direction)| Primitive::Line { origin, direction }),
        "plane" => four().map(|(normal, offset_mm)| Primitive::Plane { normal, offset_mm }),
        "box" => two().map(|(low, high)| Primitive::AxisBox { low, high }),
        "ball" => four().map(|(centre, radius_mm)| Primitive::Ball { centre, radius_mm }),
        _ => None,
    }
}

/// The word of a primitive, and its numbers.
pub(super) fn numbers(primitive: &Primitive) -> (&'static str, Vec<f64>) {
    match primitive {
        Primitive::Point(at) => ("point", at.to_vec()),
        Primitive::Segment([from, to]) => ("segment", [*from, *to].concat()),
        Primitive::Ray { origin, direction } => ("ray", [*origin, *direction].concat()),
        Primitive::Line { origin, direction } => ("line", [*origin, *direction].concat()),
        Primitive::Plane { normal, offset_mm } => ("plane", [normal.as_slice(), &[*offset_mm]].concat()),
        Primitive::AxisBox { low, high } => ("box", [*low, *high].concat()),
        Primitive::Ball { centre, radius_mm } => ("ball", [centre.as_slice(), &[*radius_mm]].concat()),
    }
}

/// Reads what a shape is held against.
pub(super) fn with(walker: &mut Walker<'_>, place: Place<'_>) -> Option<With> {
    let members = walker.object(place, &WITH)?;
    one_of(walker, &members, &words(), "what a shape is held against")?;
    if let Some(place) = members.get(ITSELF) {
        if walker.flag(place)? {
            return Some(With::Itself);
        }
        walker.fault(&place, code::CONFLICTING_MEMBERS, || "is false; write true, or leave \"with\" out".into());
        return None;
    }
    let (word, count) = PRIMITIVES.into_iter().find(|(word, _)| members.has(word))?;
    let place = members.get(word)?;
    let numbers = walker.each(place, "an array of numbers in mm", |walker, place| walker.number(place))?;
    let found = primitive(word, &numbers);
    if found.is_none() {
        let given = numbers.len();
        walker.fault(&place, code::WRONG_LENGTH, || format!("has {given} numbers; a {word} takes {count}"));
    }
    found.map(With::Primitive)
}
