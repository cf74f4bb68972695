//! Whether triangles keep a distance from figures.

use super::super::between::Body;
use super::super::figure::Figure;
use crate::attractor::cell::Point;
use crate::budget::{Budget, Stopped};
use crate::dilation::surface::BlockSurface;
use crate::solid::box_tree::{Box32, BoxTree};
use rayon::prelude::*;

/// Triangles one after the other.
const IN_A_ROW: usize = 64;

/// Whether all triangles of a surface, with the normals of their facets, are as far from all figures. Cost: a microsecond or so for each.
///
/// # Errors
/// [`Stopped`].
pub(super) fn are_clear(
    surface: &BlockSurface,
    normals: &[Point],
    figures: &[Figure],
    least: f64,
    budget: &Budget,
) -> Result<bool, Stopped> {
    let boxes: Vec<Box32> = figures.iter().map(|figure| figure.box_within(least)).collect();
    let mut tree = BoxTree::default();
    tree.build(boxes.len(), |index| Some(boxes[index as usize]), true);
    let is_clear = |triangle: &[u32; 3], normal: &Point| {
        let corners = triangle.map(|corner| surface.vertices[corner as usize]);
        let own = Box32::of(&corners);
        let mut is_clear = true;
        tree.query(&own, 0, |leaf| {
            for (&item, other) in tree.items(leaf).iter().zip(tree.boxes(leaf)) {
                if own.meets(other) && !is_apart(&corners, normal, &figures[item as usize], least) {
                    is_clear = false;
                }
            }
            is_clear
        });
        is_clear
    };
    let rows = surface.triangles.par_chunks(IN_A_ROW).zip(normals.par_chunks(IN_A_ROW));
    let all = rows.map(|(triangles, normals)| {
        budget.cancel.check()?;
        Ok(triangles.iter().zip(normals).all(|(triangle, normal)| is_clear(triangle, normal)))
    });
    // The first that is not ends the search.
    let found = all.find_any(|row| !matches!(row, Ok(true)));
    found.map_or(Ok(true), |row| row)
}

/// Whether a plane parts a triangle from a figure by a distance: one along the triangle, one along the figure, or one across the shortest way between both.
fn is_apart(triangle: &[Point; 3], normal: &Point, figure: &Figure, least: f64) -> bool {
    let along = figure.polygon().map(|polygon| polygon.up);
    let both = along.iter().flat_map(|up| [*up, up.map(|part| -part)]);
    [*normal].into_iter().chain(both).any(|direction| figure.is_parted(triangle, &direction, least))
        || figure.too_near(triangle, least).is_none()
}

impl Body for Figure {
    fn corners(&self) -> impl AsRef<[Point]> {
        Figure::corners(self)
    }
}
