//! Whether triangles keep a distance from figures.

use super::super::between::lowest;
use super::super::figure::{Figure, Outline};
use crate::attractor::cell::{Point, distance_squared, subtract, unit};
use crate::budget::{Budget, Stopped};
use crate::dilation::convex::Convex;
use crate::dilation::surface::BlockSurface;
use crate::measure::triangle::closest_on_triangle;
use crate::solid::box_tree::{Box32, BoxTree};
use rayon::prelude::*;

/// How often the way between both is sought from one to the other.
const STEPS: usize = 16;
const IN_A_ROW: usize = 64;

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
    Ok(all.collect::<Result<Vec<bool>, Stopped>>()?.into_iter().all(|is_clear| is_clear))
}

/// Whether a plane parts a triangle from a figure by a distance: one along the triangle, one along the figure, or one across the way between close places of both.
fn is_apart(triangle: &[Point; 3], normal: &Point, figure: &Figure, least: f64) -> bool {
    let parts = |direction: &Point| lowest(triangle, direction) - figure.highest(direction) >= least;
    if parts(normal) {
        return true;
    }
    if let Outline::Polygon(polygon) = &figure.outline
        && (parts(&polygon.up) || parts(&polygon.up.map(|part| -part)))
    {
        return true;
    }
    let [a, b, c] = triangle;
    let mut q = super::super::between::middle(triangle);
    for _ in 0..STEPS {
        let p = figure.closest(&q);
        if parts(&unit(&subtract(&q, &p))) {
            return true;
        }
        let next = closest_on_triangle(&p, a, b, c);
        if distance_squared(&next, &q) == 0.0 {
            break;
        }
        q = next;
    }
    false
}
