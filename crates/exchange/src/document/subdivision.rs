//! Reads subdivision surfaces.

use lacuna_kernel::model::{BoundaryRule, Coefficients, Corner, Crease, Scheme, Subdivision};

use super::grammar::{COEFFICIENTS, CONTROL_MESH, CORNER, CREASE, Member, SUBDIVISION};
use super::mesh::{faces, vertices};
use super::node::Place;
use super::walk::{Walker, length, reads_as_number};

/// A `subdivision` shape.
pub(super) fn subdivision(walker: &mut Walker<'_>, place: Place<'_>, added: &[Member]) -> Option<Subdivision> {
    const SCHEMES: [(&str, Scheme); 3] = [("catmull_clark", Scheme::CatmullClark), ("doo_sabin", Scheme::DooSabin), ("loop", Scheme::Loop)];
    const BOUNDARIES: [(&str, BoundaryRule); 2] = [("smooth", BoundaryRule::Smooth), ("sharp_corners", BoundaryRule::SharpCorners)];
    let members = walker.object_of(place, &SUBDIVISION, added)?;
    let scheme = members.get("scheme").and_then(|place| walker.word(place, "a scheme", &SCHEMES));
    let mesh = members.get("mesh").and_then(|place| walker.object(place, &CONTROL_MESH));
    let (mut points, mut polygons) = (None, None);
    // Indices are checked against what the document has; without a mesh any will do.
    let (mut vertex_count, mut face_count) = (u32::MAX as usize, u32::MAX as usize);
    if let Some(mesh) = mesh {
        let (read, count) = vertices(walker, &mesh);
        vertex_count = count.unwrap_or(vertex_count);
        face_count = mesh.get("faces").and_then(|place| length(place.node)).unwrap_or(face_count);
        (points, polygons) = (read, faces(walker, &mesh, count));
    }
    let creases = match members.get("creases") {
        Some(place) => walker.each_of(place, 0, "an array of creases", |walker, place| crease(walker, place, vertex_count)),
        None => Some(Vec::new()),
    };
    let corners = match members.get("corners") {
        Some(place) => walker.each_of(place, 0, "an array of corners", |walker, place| corner(walker, place, vertex_count)),
        None => Some(Vec::new()),
    };
    let boundary = members.get("boundary").map_or(Some(BoundaryRule::Smooth), |place| walker.word(place, "a boundary rule", &BOUNDARIES));
    let coefficients = match members.get("coefficients") {
        Some(place) => walker.each_of(place, 0, "an array of coefficients", |walker, place| region(walker, place, face_count)),
        None => Some(Vec::new()),
    };
    Some(Subdivision {
        scheme: scheme?,
        vertices: points?,
        faces: polygons?,
        creases: creases?,
        corners: corners?,
        boundary: boundary?,
        coefficients: coefficients?,
    })
}

fn index(walker: &mut Walker<'_>, place: Place<'_>, count: usize, meaning: &str) -> Option<u32> {
    walker.index(place, count.min(u32::MAX as usize), meaning).and_then(|index| u32::try_from(index).ok())
}

fn crease(walker: &mut Walker<'_>, place: Place<'_>, vertices: usize) -> Option<Crease> {
    let members = walker.object(place, &CREASE)?;
    let edge = members.get("edge").and_then(|place| {
        const PAIR: &str = "the two vertices of an edge";
        let ends = walker.each(place, PAIR, |walker, end| index(walker, end, vertices, "vertex"));
        match length(place.node) {
            Some(found) if found != 2 => walker.wrong_length(&place, found, PAIR),
            _ => ends?.try_into().ok(),
        }
    });
    let sharpness = members.get("sharpness").and_then(|place| sharpness(walker, place));
    Some(Crease { edge: edge?, sharpness: sharpness? })
}

fn corner(walker: &mut Walker<'_>, place: Place<'_>, vertices: usize) -> Option<Corner> {
    let members = walker.object(place, &CORNER)?;
    let vertex = members.get("vertex").and_then(|place| index(walker, place, vertices, "vertex"));
    let sharpness = members.get("sharpness").and_then(|place| sharpness(walker, place));
    Some(Corner { vertex: vertex?, sharpness: sharpness? })
}

/// A number, whose sign the kernel judges, or "infinite".
fn sharpness(walker: &mut Walker<'_>, place: Place<'_>) -> Option<f64> {
    match place.node.text() {
        Some(text) if !reads_as_number(Some(text)) => {
            walker.word(place, "a sharpness, which is a number from 0 on or a word", &[("infinite", f64::INFINITY)])
        }
        _ => walker.number(place),
    }
}

fn region(walker: &mut Walker<'_>, place: Place<'_>, count: usize) -> Option<Coefficients> {
    let members = walker.object(place, &COEFFICIENTS)?;
    let faces = match members.get("faces") {
        Some(place) => walker.each_of(place, 0, "an array of faces", |walker, face| index(walker, face, count, "face")).map(Some),
        None => Some(None),
    };
    let weights = members.get("weights").and_then(|place| {
        walker.each_of(place, 1, "an array of lists of weights", |walker, list| {
            walker.each_of(list, 3, "an array of weights", |walker, weight| walker.number(weight))
        })
    });
    Some(Coefficients { faces: faces?, weights: weights? })
}
