//! Radii that parts of a group have of their own.

use super::lower::Draft;
use super::{Interior, PartRadius, Shape};
use crate::attractor::{OwnRadius, Root};
use crate::tolerance::LENGTHS_MM;
use glam::DVec3;

/// How many roots, solids and trimmed surfaces there were before a part.
#[derive(Clone, Copy)]
pub(super) struct Before {
    pub(super) roots: usize,
    pub(super) solids: usize,
    pub(super) trimmed: usize,
}

impl PartRadius {
    /// Gives the roots of a part, all that were added since, their radius; those that have one already keep it. Findings are about the part.
    pub(super) fn lower(&self, shape: &Shape, before: Before, draft: &mut Draft) {
        if !self.check(draft) {
            return;
        }
        if draft.trimmed.len() > before.trimmed {
            let message = "a trimmed surface has the radius that the job asks for; leave the part's out";
            return draft.error("", "radius.trimmed", message.into());
        }
        if draft.solids.len() > before.solids && !matches!(self, Self::Constant(_)) {
            return draft.error("", "radius.solid", "a solid has one radius; give the part a \"radius_mm\"".into());
        }
        let count = draft.roots.len() - before.roots;
        let own = match self {
            Self::Constant(radius) => vec![OwnRadius::Constant(*radius); count],
            &Self::ByLevel { first, ratio, least } => vec![OwnRadius::ByLevel { first, ratio, least, grown: 0.0 }; count],
            Self::AtPoints(radii) => {
                let Some(own) = at_points(shape, radii, before.roots, draft) else { return };
                own
            }
        };
        draft.radii.resize(draft.roots.len(), None);
        for (place, own) in draft.radii[before.roots..].iter_mut().zip(own) {
            place.get_or_insert(own);
        }
    }

    fn check(&self, draft: &mut Draft) -> bool {
        let findings = draft.findings.len();
        let (least, most) = (LENGTHS_MM.start(), LENGTHS_MM.end());
        let mut length = |pointer: &str, value: f64| {
            if !LENGTHS_MM.contains(&value) {
                draft.error(pointer, "radius.not-positive", format!("the radius is {value}, and must be from {least:e} to {most:e} mm"));
            }
        };
        match self {
            Self::Constant(radius) => length("/radius_mm", *radius),
            Self::AtPoints(radii) => radii.iter().enumerate().for_each(|(index, radius)| length(&format!("/radii_mm/{index}"), *radius)),
            Self::ByLevel { first, ratio, least } => {
                length("/radius_by_level/first_mm", *first);
                length("/radius_by_level/least_mm", *least);
                if !(*ratio > 0.0 && *ratio < 1.0) {
                    let message = format!("the ratio is {ratio}, and must be between 0 and 1: radii shrink from level to level");
                    draft.error("/radius_by_level/ratio", "radius.ratio", message);
                }
            }
        }
        draft.findings.len() == findings
    }
}

/// The radii at the control points of roots. The shape is lowered once more with (r, 0, 0) as its points: whatever makes roots of control points makes radii of radii.
fn at_points(shape: &Shape, radii: &[f64], first_root: usize, draft: &mut Draft) -> Option<Vec<OwnRadius>> {
    let mut shadow = shape.clone();
    let Some(points) = control_points(&mut shadow) else {
        let message =
            "only shapes with control points or vertices have radii there: curves, surfaces, meshes; give the part a \"radius_mm\"";
        draft.error("/radii_mm", "radius.no-points", message.into());
        return None;
    };
    if points.len() != radii.len() {
        let message = format!("{} radii are given, and the shape has {} control points", radii.len(), points.len());
        draft.error("/radii_mm", "radius.count", message);
        return None;
    }
    for (point, &radius) in points.into_iter().zip(radii) {
        *point = DVec3::new(radius, 0.0, 0.0);
    }
    let mut other = Draft::default();
    other.shape(&shadow);
    let roots = &draft.roots[first_root..];
    let alike = other.roots.len() == roots.len()
        && other.roots.iter().zip(roots).all(|(own, root)| {
            own.points.len() == root.points.len() && own.points.iter().zip(&root.points).all(|(own, point)| own[3] == point[3])
        });
    if !alike {
        draft.error(
            "/radii_mm",
            "radius.no-points",
            "the shape's cells do not follow its control points alone; give the part a \"radius_mm\"".into(),
        );
        return None;
    }
    let least = radii.iter().copied().fold(f64::INFINITY, f64::min);
    let of_root = |root: &Root| OwnRadius::AtPoints(root.points.iter().map(|point| point[0] / point[3]).collect(), least);
    Some(other.roots.iter().map(of_root).collect())
}

/// The control points or vertices of a shape, in the order of its document.
fn control_points(shape: &mut Shape) -> Option<Vec<&mut DVec3>> {
    Some(match shape {
        Shape::BezierCurve(curve) => curve.control_points.iter_mut().collect(),
        Shape::CornerCutting(curve) => curve.control_points.iter_mut().collect(),
        Shape::Curve(curve) => curve.control_points.points.iter_mut().collect(),
        Shape::TensorProduct(product) => product.control_points.points.iter_mut().collect(),
        Shape::Subdivision(surface) => surface.vertices.iter_mut().collect(),
        Shape::Mesh(mesh) => {
            mesh.interior = Interior::Surface;
            mesh.vertices.iter_mut().collect()
        }
        Shape::Ifs(_) | Shape::Bcifs(_) | Shape::Sum(_) | Shape::Terrain(_) | Shape::Group(_) => return None,
    })
}
