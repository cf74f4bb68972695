//! Reads models: version, name, unit, and a shape of one of the families.

use lacuna_kernel::model::{Group, Model, Part, PartRadius, Shape};

use super::bcifs::bcifs;
use super::curve::{bezier_curve, corner_cutting};
use super::grammar::{
    BEZIER_SURFACE, EMBEDDED_MODEL, FAMILIES, GROUP, MODEL, Member, NURBS_SURFACE, NURBS_VOLUME, PART, PART_MEMBERS, RADIUS_BY_LEVEL,
};
use super::ifs::ifs;
use super::join::join;
use super::mesh::mesh;
use super::node::{Place, Value, number_text, quoted};
use super::scheme;
use super::subdivision::subdivision;
use super::terrain::terrain;
use super::transform::affine_map;
use super::units::{UNITS, Unit};
use super::walk::{Walker, length, suggestion};
use crate::diagnostic::code;

/// The version of the grammar that is read.
const VERSION: f64 = 1.0;

/// A model document. The version may be absent where the model stands in a job that has it.
pub(super) fn model(walker: &mut Walker<'_>, place: Place<'_>, in_job: bool) -> Option<Model> {
    let members = walker.object(place, if in_job { &EMBEDDED_MODEL } else { &MODEL })?;
    if let Some(place) = members.get("lacuna") {
        version(walker, place);
    }
    let name = match members.get("name") {
        Some(place) => walker.name(place, "the name of a model").map(Some),
        None => Some(None),
    };
    let unit = members.get("units").and_then(|place| walker.word(place, "a unit of length", &UNITS));
    walker.unit = unit.unwrap_or(Unit::Millimetre);
    (walker.states, walker.transitions) = (0, 0);
    let shape = members.get("shape").and_then(|place| shape(walker, place, &[]));
    Some(Model { name: name?, shape: shape? })
}

/// Reports a version that is not the one read here.
pub(super) fn version(walker: &mut Walker<'_>, place: Place<'_>) {
    if let Some(version) = walker.number(place)
        && version != VERSION
    {
        walker.fault(&place, code::UNSUPPORTED_VERSION, || {
            format!("is {}; this program reads version {VERSION} of the grammar", number_text(version))
        });
    }
}

/// A shape; `added` are members that the context allows besides those of the family.
fn shape(walker: &mut Walker<'_>, place: Place<'_>, added: &[Member]) -> Option<Shape> {
    let Value::Object(entries) = &place.node.value else {
        return walker.wrong_type(&place, "an object (a shape with its family)");
    };
    let available = || FAMILIES.iter().map(|(family, _, _)| *family);
    let Some((name, node)) = entries.iter().find(|(name, _)| name == "family") else {
        walker.fault(&place, code::MISSING_MEMBER, || {
            format!("a shape needs the member \"family\": one of {}", available().collect::<Vec<_>>().join(", "))
        });
        return None;
    };
    let family_place = Place { node, path: place.path.member(name) };
    let family = walker.text(family_place, "the name of a family")?;
    match family {
        "ifs" => ifs(walker, place, added).map(Shape::Ifs),
        "bcifs" => bcifs(walker, place, added).map(Shape::Bcifs),
        "bezier_curve" => bezier_curve(walker, place, added).map(Shape::BezierCurve),
        "corner_cutting" => corner_cutting(walker, place, added).map(Shape::CornerCutting),
        "subdivision" => subdivision(walker, place, added).map(Shape::Subdivision),
        "bezier_surface" => scheme::surface(walker, place, &BEZIER_SURFACE, added).map(Shape::TensorProduct),
        "nurbs_surface" => scheme::surface(walker, place, &NURBS_SURFACE, added).map(Shape::TensorProduct),
        "nurbs_volume" => scheme::surface(walker, place, &NURBS_VOLUME, added).map(Shape::TensorProduct),
        "tensor" => scheme::tensor(walker, place, added).map(Shape::TensorProduct),
        "sum" => scheme::sum(walker, place, added).map(Shape::Sum),
        "nurbs_curve" | "catmull_rom" | "beta_spline" | "four_point" | "interpolation" => {
            scheme::curve(walker, place, family, added).map(Shape::Curve)
        }
        "mesh" => mesh(walker, place, added).map(Shape::Mesh),
        "terrain" => terrain(walker, place, added).map(Shape::Terrain),
        "group" => group(walker, place, added).map(Shape::Group),
        unknown => {
            walker.fault(&family_place, code::UNKNOWN_VALUE, || {
                format!("{} is not a family; {}", quoted(unknown), suggestion(unknown, available()))
            });
            None
        }
    }
}

fn group(walker: &mut Walker<'_>, place: Place<'_>, added: &[Member]) -> Option<Group> {
    let members = walker.object_of(place, &GROUP, added)?;
    let parts = members.get("parts").and_then(|place| walker.each_of(place, 1, "an array of parts", part));
    let count = members.get("parts").and_then(|place| length(place.node)).unwrap_or(usize::MAX);
    let joins = match members.get("joins") {
        Some(place) => walker.each_of(place, 0, "an array of joins", |walker, place| join(walker, place, count)),
        None => Some(Vec::new()),
    };
    Some(Group { parts: parts?, joins: joins? })
}

/// A part: a shape that has a name and a place besides its own members, or that is a member itself.
fn part(walker: &mut Walker<'_>, place: Place<'_>) -> Option<Part> {
    let Value::Object(entries) = &place.node.value else {
        return walker.wrong_type(&place, "an object (a part)");
    };
    let wrapped = entries.iter().any(|(name, _)| name == "shape");
    let shape = if wrapped {
        let members = walker.object(place, &PART)?;
        members.get("shape").and_then(|place| shape(walker, place, &[]))
    } else {
        shape(walker, place, PART_MEMBERS)
    };
    let find = |name: &str| {
        let (key, node) = entries.iter().find(|(key, _)| key == name)?;
        Some(Place { node, path: place.path.member(key) })
    };
    let name = match find("name") {
        Some(place) => walker.name(place, "the name of a part").map(Some),
        None => Some(None),
    };
    let transform = match find("transform") {
        Some(place) => affine_map(walker, place).map(Some),
        None => Some(None),
    };
    let constant = find("radius_mm").map(|place| Some(PartRadius::Constant(walker.positive(place, "a radius in mm")?)));
    let at_points = find("radii_mm").map(|place| {
        let radii = walker.each_of(place, 1, "an array of radii in mm", |walker, place| walker.positive(place, "a radius in mm"));
        Some(PartRadius::AtPoints(radii?))
    });
    let by_level = find("radius_by_level").map(|place| radius_by_level(walker, place));
    let mut stated = [constant, at_points, by_level].into_iter().flatten();
    let radius = stated.next();
    if stated.next().is_some() {
        walker.fault(&place, code::CONFLICTING_MEMBERS, || {
            "\"radius_mm\", \"radii_mm\" and \"radius_by_level\" exclude each other; keep one".into()
        });
        return None;
    }
    let radius = match radius {
        Some(radius) => Some(radius?),
        None => None,
    };
    Some(Part { name: name?, transform: transform?, shape: shape?, radius })
}

fn radius_by_level(walker: &mut Walker<'_>, place: Place<'_>) -> Option<PartRadius> {
    let members = walker.object(place, &RADIUS_BY_LEVEL)?;
    let first = members.get("first_mm").and_then(|place| walker.positive(place, "a radius in mm"));
    let ratio = members.get("ratio").and_then(|place| walker.positive(place, "a ratio below 1"));
    let least = members.get("least_mm").and_then(|place| walker.positive(place, "a radius in mm"));
    Some(PartRadius::ByLevel { first: first?, ratio: ratio?, least: least? })
}
