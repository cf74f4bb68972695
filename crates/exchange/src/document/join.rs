//! Reads joins of a group's parts.

use lacuna_kernel::model::{Border, BorderPath, Join};

use super::grammar::{BORDER, JOIN};
use super::node::Place;
use super::walk::{Members, Walker, length};
use crate::diagnostic::code;

/// Sides of a product of two curves, as (direction, whether its last end).
pub(super) const SIDES: [(&str, (usize, bool)); 4] =
    [("u_min", (0, false)), ("u_max", (0, true)), ("v_min", (1, false)), ("v_max", (1, true))];

/// A join of two borders of a group with so many parts.
pub(super) fn join(walker: &mut Walker<'_>, place: Place<'_>, parts: usize) -> Option<Join> {
    const PAIR: &str = "two borders";
    let members = walker.object(place, &JOIN)?;
    let between = members.get("between").and_then(|place| {
        let borders = walker.each(place, PAIR, |walker, place| border(walker, place, parts));
        match length(place.node) {
            Some(found) if found != 2 => walker.wrong_length(&place, found, PAIR),
            _ => borders?.try_into().ok(),
        }
    });
    let strip = members.get("strip").map_or(Some(false), |place| walker.flag(place));
    Some(Join { between: between?, strip: strip? })
}

fn border(walker: &mut Walker<'_>, place: Place<'_>, parts: usize) -> Option<Border> {
    let members = walker.object(place, &BORDER)?;
    let part = members.get("part").and_then(|place| walker.index(place, parts, "part"));
    let path = path(walker, &members);
    Some(Border { part: part?, path: path? })
}

fn path(walker: &mut Walker<'_>, members: &Members<'_>) -> Option<BorderPath> {
    let given: Vec<(&str, Place<'_>)> =
        ["side", "vertices", "boundaries"].into_iter().filter_map(|name| Some((name, members.get(name)?))).collect();
    match given.as_slice() {
        [("side", place)] => walker.word(*place, "a side", &SIDES).map(|(direction, last)| BorderPath::Side { direction, last }),
        [("vertices", place)] => {
            let vertex = |walker: &mut Walker<'_>, place: Place<'_>| {
                walker.index(place, u32::MAX as usize, "vertex").and_then(|vertex| u32::try_from(vertex).ok())
            };
            walker.each_of(*place, 1, "an array of vertices", vertex).map(BorderPath::Vertices)
        }
        [(_, place)] => {
            const PAIR: &str = "a pair [root cell, boundary of its state]";
            let pair = |walker: &mut Walker<'_>, place: Place<'_>| {
                let (cell, boundary) = walker.index_pair(place, PAIR)?;
                // Numbers that no cell has are refused with those that this model has not.
                Some((usize::try_from(cell).unwrap_or(usize::MAX), usize::try_from(boundary).unwrap_or(usize::MAX)))
            };
            walker.each_of(*place, 1, "an array of pairs [root cell, boundary of its state]", pair).map(BorderPath::Boundaries)
        }
        [] => {
            walker.fault(&members.place, code::MISSING_MEMBER, || {
                "a border needs the member \"side\" (of a product of two curves), \"vertices\" (of a subdivision surface) or \"boundaries\" (of a BC-IFS)"
                    .to_owned()
            });
            None
        }
        [(first, _), (second, place), ..] => {
            walker.fault(place, code::CONFLICTING_MEMBERS, || {
                format!("\"{first}\" and \"{second}\" exclude each other; leave one of them out")
            });
            None
        }
    }
}
