//! Reads polygon meshes.

use glam::DVec3;
use lacuna_kernel::model::{Interior, PolygonMesh};

use super::grammar::{MESH, Member};
use super::node::{Place, quoted};
use super::transform::points;
use super::walk::{Members, Walker, length};
use crate::diagnostic::code;

/// A `mesh` shape.
pub(super) fn mesh(walker: &mut Walker<'_>, place: Place<'_>, added: &[Member]) -> Option<PolygonMesh> {
    const WORDS: [(&str, Interior); 3] = [("auto", Interior::Auto), ("solid", Interior::Solid), ("surface", Interior::Surface)];
    let members = walker.object_of(place, &MESH, added)?;
    let interior = members.get("interior").map_or(Some(Interior::Auto), |place| walker.word(place, "an interior", &WORDS));
    if let Some(place) = members.get("file") {
        let (vertices, faces) = file(walker, &members, place)?;
        return Some(PolygonMesh { vertices, faces, interior: interior? });
    }
    for (name, what) in [("vertices", "the corner points"), ("faces", "the corner indices of each face")] {
        if !members.has(name) {
            walker.fault(&members.place, code::MISSING_MEMBER, || format!("a mesh needs the member \"{name}\": {what}; or a \"file\""));
        }
    }
    let (vertices, count) = vertices(walker, &members);
    let faces = faces(walker, &members, count);
    Some(PolygonMesh { vertices: vertices?, faces: faces?, interior: interior? })
}

/// The vertices and faces of the file that a document names.
fn file(walker: &mut Walker<'_>, members: &Members<'_>, place: Place<'_>) -> Option<(Vec<DVec3>, Vec<Vec<u32>>)> {
    let mut legal = true;
    for name in ["vertices", "faces"] {
        if let Some(other) = members.get(name) {
            walker
                .fault(&other, code::CONFLICTING_MEMBERS, || format!("\"{name}\" and \"file\" exclude each other; leave one of them out"));
            legal = false;
        }
    }
    let name = walker.name(place, "the name of a file")?;
    let inside = |part: &str| !matches!(part, "" | "." | "..");
    if name.contains(['\\', ':']) || !name.split('/').all(inside) {
        walker.fault(&place, code::FILE_OUTSIDE, || {
            format!("{} is not a path inside the document's folder; use names with / between, none of them empty or ..", quoted(&name))
        });
        return None;
    }
    let Some(files) = walker.files else {
        walker.fault(&place, code::FILE_NOT_AVAILABLE, || {
            "names a file, and this document comes without a folder; give vertices and faces instead".to_owned()
        });
        return None;
    };
    let found = match files(&name) {
        Ok(found) => found,
        Err(reason) => {
            walker.fault(&place, code::FILE_NOT_READ, || format!("{} cannot be used: {reason}", quoted(&name)));
            return None;
        }
    };
    let faces = found.faces();
    let scaled = |vertex: DVec3| if found.facts.unit.is_some() { vertex } else { vertex.map(|length| walker.unit.to_mm(length)) };
    let vertices: Vec<DVec3> = found.mesh.vertices.iter().map(|&vertex| scaled(vertex)).collect();
    if vertices.iter().any(|vertex| !vertex.is_finite()) {
        walker.fault(&place, code::NOT_FINITE, || format!("{} has lengths without a finite value in mm", quoted(&name)));
        return None;
    }
    legal.then_some((vertices, faces))
}

/// The vertices, and how many the document has even if one of them is wrong.
pub(super) fn vertices(walker: &mut Walker<'_>, members: &Members<'_>) -> (Option<Vec<DVec3>>, Option<usize>) {
    match members.get("vertices") {
        Some(place) => (points(walker, place, 1), length(place.node)),
        None => (None, None),
    }
}

/// The faces, with indices below the number of vertices when that is known.
pub(super) fn faces(walker: &mut Walker<'_>, members: &Members<'_>, vertices: Option<usize>) -> Option<Vec<Vec<u32>>> {
    let ceiling = vertices.unwrap_or(usize::MAX).min(u32::MAX as usize);
    walker.each_of(members.get("faces")?, 1, "an array of faces", |walker, face| {
        walker.each_of(face, 1, "a face: an array of indices of vertices", |walker, corner| {
            walker.index(corner, ceiling, "vertex").and_then(|index| u32::try_from(index).ok())
        })
    })
}
