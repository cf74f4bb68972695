//! Reads polygon meshes.

use glam::DVec3;
use lacuna_kernel::model::{Interior, PolygonMesh};

use super::grammar::{MESH, Member};
use super::node::Place;
use super::transform::points;
use super::walk::{Members, Walker, length};

/// A `mesh` shape.
pub(super) fn mesh(walker: &mut Walker<'_>, place: Place<'_>, added: &[Member]) -> Option<PolygonMesh> {
    const WORDS: [(&str, Interior); 3] = [("auto", Interior::Auto), ("solid", Interior::Solid), ("surface", Interior::Surface)];
    let members = walker.object_of(place, &MESH, added)?;
    let (vertices, count) = vertices(walker, &members);
    let faces = faces(walker, &members, count);
    let interior = members.get("interior").map_or(Some(Interior::Auto), |place| walker.word(place, "an interior", &WORDS));
    Some(PolygonMesh { vertices: vertices?, faces: faces?, interior: interior? })
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
