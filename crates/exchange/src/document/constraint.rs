//! Reads what a `bcifs` demands of its operators: incidences, adjacencies, relations, and glued root cells. Indices
//! are checked as far as the document tells what they point to.

use lacuna_kernel::model::{Adjacency, Glue, Incidence, Relation, Side};

use super::bcifs::{Names, Outline, state_name};
use super::grammar::{ADJACENCY, GLUE, INCIDENCE, RELATION, SIDE};
use super::node::Place;
use super::walk::{Members, Walker, length};
use crate::diagnostic::code;

const CHILD_BOUNDARY: &str = "a pair [child, boundary of that child]";

/// A pair (i, m): child i of the state, and boundary m of that child's state.
fn child_boundary(walker: &mut Walker<'_>, place: Place<'_>, state: Option<&Outline<'_>>, names: &Names<'_>) -> Option<(usize, usize)> {
    let children = state.and_then(|state| state.children.as_deref());
    pair_of(walker, place, CHILD_BOUNDARY, children, "child", names)
}

/// A pair (i, m): element i of a list of cells with states, and boundary m of that state.
fn pair_of(
    walker: &mut Walker<'_>,
    place: Place<'_>,
    expected: &str,
    cells: Option<&[Option<&str>]>,
    meaning: &str,
    names: &Names<'_>,
) -> Option<(usize, usize)> {
    let (cell, boundary) = walker.index_pair(place, expected)?;
    let offset = place.node.offset;
    let count = cells.map_or(usize::MAX, <[_]>::len);
    let cell = walker.in_range(&place.path.index(0), offset, cell, count, meaning)?;
    let state = cells.and_then(|cells| *cells.get(cell)?);
    let boundaries = names.outline(state).and_then(|outline| outline.boundaries.as_deref());
    let boundary = walker.in_range(&place.path.index(1), offset, boundary, boundaries.map_or(usize::MAX, <[_]>::len), "boundary")?;
    Some((cell, boundary))
}

/// Two pairs.
fn between(
    walker: &mut Walker<'_>,
    place: Place<'_>,
    read: impl FnMut(&mut Walker<'_>, Place<'_>) -> Option<(usize, usize)>,
) -> Option<[(usize, usize); 2]> {
    const EXPECTED: &str = "two pairs [[i, m], [j, n]]";
    let pairs = walker.each(place, EXPECTED, read);
    match length(place.node) {
        Some(found) if found != 2 => walker.wrong_length(&place, found, EXPECTED),
        _ => pairs?.try_into().ok(),
    }
}

/// Steps of a path in a relation: each is a factor of a product.
const LONGEST_PATH: usize = 64;

/// How a boundary's subdivision lies in the subdivision.
pub(super) fn incidence(walker: &mut Walker<'_>, place: Place<'_>, names: &Names<'_>) -> Option<Incidence> {
    let members = walker.object(place, &INCIDENCE)?;
    let state = members.get("state").and_then(|place| state_name(walker, place, names));
    let outline = names.outline(state.as_deref());
    let boundaries = outline.and_then(|outline| outline.boundaries.as_ref()).map_or(usize::MAX, Vec::len);
    let boundary = members.get("boundary").and_then(|place| walker.index(place, boundaries, "boundary"));
    let children = members.get("children").and_then(|place| {
        walker.each(place, "an array of pairs [child, boundary]", |walker, place| child_boundary(walker, place, outline, names))
    });
    Some(Incidence { state: state?, boundary: boundary?, children: children? })
}

/// A boundary that two children share.
pub(super) fn adjacency(walker: &mut Walker<'_>, place: Place<'_>, names: &Names<'_>) -> Option<Adjacency> {
    let members = walker.object(place, &ADJACENCY)?;
    let state = members.get("state").and_then(|place| state_name(walker, place, names));
    let outline = names.outline(state.as_deref());
    let pairs =
        members.get("between").and_then(|place| between(walker, place, |walker, place| child_boundary(walker, place, outline, names)));
    let shared = pairs.and_then(|[(child, boundary), _]| boundary_of(names, *outline?.children.as_ref()?.get(child)?, boundary));
    let (reversed, permutation) = orientation(walker, &members, names.outline(shared).and_then(|outline| outline.dimension))?;
    Some(Adjacency { state: state?, between: pairs?, reversed, permutation })
}

/// Glued boundaries: an object, or a bare pair of pairs.
pub(super) fn glue(walker: &mut Walker<'_>, place: Place<'_>, roots: Option<&[Option<&str>]>, names: &Names<'_>) -> Option<Glue> {
    let pair = |walker: &mut Walker<'_>, place: Place<'_>| {
        pair_of(walker, place, "a pair [root cell, boundary of its state]", roots, "root cell", names)
    };
    if length(place.node).is_some() {
        return Some(Glue { between: between(walker, place, pair)?, reversed: false, permutation: None });
    }
    let members = walker.object(place, &GLUE)?;
    let pairs = members.get("between").and_then(|place| between(walker, place, pair));
    let shared = pairs.and_then(|[(cell, boundary), _]| boundary_of(names, *roots?.get(cell)?, boundary));
    let (reversed, permutation) = orientation(walker, &members, names.outline(shared).and_then(|outline| outline.dimension))?;
    Some(Glue { between: pairs?, reversed, permutation })
}

/// The state of a boundary of a state.
fn boundary_of<'n>(names: &'n Names<'_>, state: Option<&str>, boundary: usize) -> Option<&'n str> {
    *names.outline(state)?.boundaries.as_ref()?.get(boundary)?
}

/// How the second of two boundaries is seen: from its other end, or with its control points in another order. `points` is
/// how many they have.
fn orientation(walker: &mut Walker<'_>, members: &Members<'_>, points: Option<usize>) -> Option<(bool, Option<Vec<usize>>)> {
    let reversed = members.get("reversed").map_or(Some(false), |place| walker.flag(place));
    let Some(place) = members.get("permutation") else {
        return Some((reversed?, None));
    };
    if reversed == Some(true) {
        walker.fault(&place, code::CONFLICTING_MEMBERS, || {
            "\"permutation\" and \"reversed\" exclude each other; reversed means the last control point first".into()
        });
        return None;
    }
    let permutation = permutation(walker, place, points);
    Some((reversed?, Some(permutation?)))
}

/// Each index below the length once.
fn permutation(walker: &mut Walker<'_>, place: Place<'_>, points: Option<usize>) -> Option<Vec<usize>> {
    const EXPECTED: &str = "a permutation: an array with each of the indices 0 to n - 1 once, n the boundary's control points";
    let found = length(place.node);
    if let (Some(found), Some(points)) = (found, points)
        && found != points
    {
        return walker.wrong_length(&place, found, &format!("{points}: the boundary has {points} control points"));
    }
    let mut seen = vec![false; found.unwrap_or(0)];
    walker.each_of(place, 1, EXPECTED, |walker, place| {
        let index = walker.index(place, seen.len(), "control point")?;
        if std::mem::replace(&mut seen[index], true) {
            walker.fault(&place, code::REPEATED_ELEMENT, || format!("is {index} again; a permutation has every index once"));
            return None;
        }
        Some(index)
    })
}

/// Two products of operators and embeddings that are equal.
pub(super) fn relation(walker: &mut Walker<'_>, place: Place<'_>, names: &Names<'_>) -> Option<Relation> {
    const EXPECTED: &str = "two sides";
    let members = walker.object(place, &RELATION)?;
    let state = members.get("state").and_then(|place| state_name(walker, place, names));
    let equal = members.get("equal").and_then(|place| {
        let sides = walker.each(place, EXPECTED, |walker, place| side(walker, place, state.as_deref(), names));
        match length(place.node) {
            Some(found) if found != 2 => walker.wrong_length(&place, found, EXPECTED),
            _ => sides?.try_into().ok(),
        }
    });
    Some(Relation { state: state?, equal: equal? })
}

/// The states that a state's children or boundaries have.
type Links = for<'o> fn(&'o Outline<'o>) -> Option<&'o [Option<&'o str>]>;

/// Children of children, then boundaries of boundaries.
fn side(walker: &mut Walker<'_>, place: Place<'_>, state: Option<&str>, names: &Names<'_>) -> Option<Side> {
    let members = walker.object(place, &SIDE)?;
    let mut current = state;
    let mut steps = |walker: &mut Walker<'_>, name: &str, meaning: &str, links: Links| {
        let Some(place) = members.get(name) else { return Some(Vec::new()) };
        if let Some(found) = length(place.node).filter(|&found| found > LONGEST_PATH) {
            return walker.wrong_length(&place, found, &format!("a path of {LONGEST_PATH} steps at most"));
        }
        walker.each(place, "a path: an array of indices", |walker, place| {
            let known = names.outline(current).and_then(links);
            let index = walker.index(place, known.map_or(usize::MAX, <[_]>::len), meaning);
            current = known.and_then(|known| *known.get(index?)?);
            index
        })
    };
    let path = steps(walker, "path", "child", |outline| outline.children.as_deref());
    let boundary = steps(walker, "boundary", "boundary", |outline| outline.boundaries.as_deref());
    Some(Side { path: path?, boundary: boundary? })
}
