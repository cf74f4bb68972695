//! Reads iterated function systems.

use lacuna_kernel::model::{Ifs, Primitive};

use super::grammar::{IFS, MESH_DATA, Member, PRIMITIVE};
use super::mesh::{faces, vertices};
use super::node::{Place, Value};
use super::transform::{affine_map, points};
use super::walk::{Walker, length};
use crate::diagnostic::code;

/// An `ifs` shape.
pub(super) fn ifs(walker: &mut Walker<'_>, place: Place<'_>, added: &[Member]) -> Option<Ifs> {
    let members = walker.object_of(place, &IFS, added)?;
    let maps_place = members.get("maps");
    if let Some(place) = &maps_place {
        walker.count_transitions(place, length(place.node).unwrap_or(0));
    }
    let maps = maps_place.and_then(|place| walker.each_of(place, 1, "an array of affine maps", affine_map));
    let primitive = match members.get("primitive") {
        Some(place) => primitive(walker, place).map(Some),
        None => Some(None),
    };
    let graph = match members.get("graph") {
        Some(place) => graph(walker, place, maps_place.and_then(|maps| length(maps.node))).map(Some),
        None => Some(None),
    };
    Some(Ifs { maps: maps?, primitive: primitive?, graph: graph? })
}

fn primitive(walker: &mut Walker<'_>, place: Place<'_>) -> Option<Primitive> {
    const KINDS: [&str; 4] = ["points", "polyline", "mesh", "solid"];
    let members = walker.object(place, &PRIMITIVE)?;
    let mut stated = KINDS.into_iter().filter(|kind| members.has(kind));
    let Some(kind) = stated.next() else {
        walker.fault(&place, code::MISSING_MEMBER, || {
            "a primitive needs one of the members \"points\", \"polyline\", \"mesh\" and \"solid\"".into()
        });
        return None;
    };
    let others: Vec<_> = stated.chain((kind != "polyline" && members.has("closed")).then_some("closed")).collect();
    for other in &others {
        if let Some(conflict) = members.get(other) {
            walker.fault(&conflict, code::CONFLICTING_MEMBERS, || format!("\"{other}\" does not go with \"{kind}\"; keep one of them"));
        }
    }
    let content = members.get(kind)?;
    match kind {
        "points" => points(walker, content, 1).map(Primitive::Points),
        "polyline" => {
            let closed = members.get("closed").map_or(Some(false), |place| walker.flag(place));
            Some(Primitive::Polyline { points: points(walker, content, 1)?, closed: closed? })
        }
        _ => {
            let data = walker.object(content, &MESH_DATA)?;
            let (vertices, count) = vertices(walker, &data);
            let faces = faces(walker, &data, count);
            let (vertices, faces) = (vertices?, faces?);
            Some(if kind == "mesh" { Primitive::Mesh { vertices, faces } } else { Primitive::Solid { vertices, faces } })
        }
    }
}

/// Lists of the maps that may follow each map; `maps` is their number, when it is known.
fn graph(walker: &mut Walker<'_>, place: Place<'_>, maps: Option<usize>) -> Option<Vec<Vec<usize>>> {
    const EXPECTED: &str = "one row per map: indices of the maps that may follow, or a boolean for every map";
    if let (Some(rows), Some(maps)) = (length(place.node), maps)
        && rows != maps
    {
        walker.fault(&place, code::WRONG_LENGTH, || format!("has {rows} rows for {maps} maps; expected {EXPECTED}"));
    }
    let is_matrix = match &place.node.value {
        Value::Array(rows) => rows.iter().any(|row| match &row.value {
            Value::Array(entries) => entries.iter().any(|entry| matches!(entry.value, Value::Flag(_))),
            _ => false,
        }),
        _ => false,
    };
    let graph =
        walker.each(place, EXPECTED, |walker, row| if is_matrix { flags_row(walker, row, maps) } else { index_row(walker, row, maps) })?;
    walker.count_transitions(&place, graph.iter().map(Vec::len).sum());
    Some(graph)
}

fn flags_row(walker: &mut Walker<'_>, row: Place<'_>, maps: Option<usize>) -> Option<Vec<usize>> {
    let flags = walker.each(row, "a row of booleans, one per map", Walker::flag)?;
    match maps {
        Some(maps) if flags.len() != maps => walker.wrong_length(&row, flags.len(), "a boolean for every map"),
        _ => Some(flags.iter().enumerate().filter(|(_, allowed)| **allowed).map(|(index, _)| index).collect()),
    }
}

fn index_row(walker: &mut Walker<'_>, row: Place<'_>, maps: Option<usize>) -> Option<Vec<usize>> {
    let indices =
        walker.each(row, "a row of indices of maps", |walker, element| walker.index(element, maps.unwrap_or(usize::MAX), "map"))?;
    let mut seen = std::collections::HashSet::with_capacity(indices.len());
    for (position, index) in indices.iter().enumerate() {
        if !seen.insert(index) {
            walker.report.add(&row.path.index(position), row.node.offset, code::REPEATED_ELEMENT, || {
                format!("map {index} is listed twice in one row; list it once (repeat the map itself if it is meant twice)")
            });
        }
    }
    Some(indices)
}
