//! Walls along closed surfaces, and closing: what lies between a surface and the dilation of that surface.
//!
//! Let M be a solid and T a mesh of the dilation of its surface by w, or of M itself, or of what is outside of M, in a box: on the side that is asked for these are the same. With {d <= w - inner} in T in {d <= w + outer} there, d the distance from the surface of M, shells of T
//! are nowhere nearer to M's surface than w - inner, so each lies inside of M or outside as a whole. Those inside bound what is left of M when everything
//! near its surface is taken away: M less the wall, an erosion of M. No boolean is needed, and nothing can cross.

use super::convex::SiteSearch;
use super::tree::{Candidates, Tree};
use super::{Dilation, DilationError, dilate, dilate_unsimplified, dilate_without_sheets, sheets_around};
use crate::attractor::Attractor;
use crate::attractor::sites::SiteRule;
use crate::budget::Budget;
use crate::groups::Groups;
use crate::measure::Interval;
use crate::measure::bounds::bounding_box;
use crate::model::{Interior, Model, PolygonMesh, Shape};
use crate::solid::inside::Inside;
use crate::solid::{Crossings, Solid, TriMesh, misplaced_shell};
use crate::tolerance::{Radius, Tolerance};
use glam::DVec3;
use std::collections::BinaryHeap;

/// On which side of a closed surface its wall is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// Inside: the solid is hollow, and its surface stays.
    Inward,
    /// Outside: what the surface bounds is the hollow.
    Outward,
}

/// A wall along the surface of a solid M. Lengths in mm.
#[derive(Clone, Debug)]
pub struct Wall {
    /// The wall; its coordinates are single-precision numbers.
    pub solid: Solid,
    /// Every point of that side within w - inner of M's surface is in the wall.
    pub inner_mm: f64,
    /// Every point of the wall is within w + outer of M's surface.
    pub outer_mm: f64,
    /// Leaf cells met.
    pub leaf_cells: u64,
    /// Pairs of triangles of the other surface that meet elsewhere than where they are joined; M's own are not looked at here.
    pub crossings: u64,
}

/// Makes the wall of thickness w along a solid's surface: the points of the solid (or of its outside) within w of it, both bounds at most `tolerance`.
///
/// The solid's own surface is kept as it is: its coordinates should be single-precision numbers, see [`Solid::rounded`]. Cost: as a dilation of the surface.
///
/// # Errors
/// [`DilationError::NoHollow`] for an inward wall that leaves nothing inside, with the thickness that would; else as [`dilate`].
pub fn wall(
    solid: &Solid,
    side: Side,
    thickness: Radius,
    tolerance: Tolerance,
    simplify: bool,
    budget: &Budget,
) -> Result<Wall, DilationError> {
    let inside = Inside::new(solid.mesh());
    let around = beside(solid.mesh(), side, thickness, tolerance, simplify, budget)?;
    let other = shells(around.solid.mesh(), |vertex| (inside.winding(vertex) > 0) == (side == Side::Inward));
    if other.triangles.is_empty() {
        return Err(no_hollow(&surface_of(solid.mesh()), &inside, thickness, budget));
    }
    let mut mesh = solid.mesh().clone();
    if side == Side::Outward {
        mesh.reverse();
    }
    mesh.append(&other);
    Ok(Wall {
        solid: Solid::new(mesh, budget)?,
        inner_mm: around.inner_mm,
        outer_mm: around.outer_mm,
        leaf_cells: around.leaf_cells,
        crossings: around.crossings,
    })
}

/// Dilates an attractor by r and closes the result with the ball of radius h: gaps narrower than 2 h are filled, and creases rounded. E_s is erosion: the points that
/// are farther than s from the outside.
///
/// The result R has C(D(r - inner)) in R in C(D(r + outer)) with C(X) = E_h(D_h(X)), both bounds at most `tolerance`: the first mesh M has
/// D(r + h - i) in M in D(r + h + o), the one around its surface takes {d <= h - i'} at least and {d <= h + o'} at most. So R holds
/// E_{h + o'}(D(r + h - i)), and as E_s(D_s(X)) holds X, that holds E_h(D(r + h - i - o')): inner = i + o'. R lies in E_{h - i'}(D(r + h + o)), a closing of
/// D(r + o + i') with a ball smaller than h, and closings grow with their ball: outer = o + i'.
///
/// # Errors
/// As [`dilate`].
pub fn close(
    attractor: &Attractor,
    radius: Radius,
    ball: Radius,
    tolerance: Tolerance,
    simplify: bool,
    budget: &Budget,
) -> Result<Dilation, DilationError> {
    let make = if simplify { dilate } else { dilate_unsimplified };
    let half = |mm: f64| Tolerance::new(mm).unwrap_or(tolerance);
    let grown = Radius::new(radius.mm() + ball.mm()).unwrap_or(radius);
    // The solid that is left is as thin as r, and its error must stay below that.
    let aimed = tolerance.mm().min(0.5 * attractor.radii(radius.mm())[0]);
    let swollen = make(&attractor.with_grown_radii(ball.mm()), grown, half(0.5 * aimed), &budget.aside())?;
    let rest = half(aimed - swollen.inner_mm.max(swollen.outer_mm));
    let around = beside(swollen.solid.mesh(), Side::Inward, ball, rest, simplify, budget)?;
    let inside = Inside::new(swollen.solid.mesh());
    let mut left = shells(around.solid.mesh(), |vertex| inside.winding(vertex) > 0);
    left.reverse();
    let solid = Solid::new(left, budget)?;
    let (inner_mm, outer_mm) = (swollen.inner_mm + around.outer_mm, swollen.outer_mm + around.inner_mm);
    budget.prove(inner_mm.max(outer_mm));
    Ok(Dilation {
        solid,
        inner_mm,
        outer_mm,
        least_radius_mm: swollen.least_radius_mm - ball.mm(),
        pitch_mm: swollen.pitch_mm.into_iter().chain(around.pitch_mm).reduce(f64::min),
        leaf_cells: swollen.leaf_cells + around.leaf_cells,
        crossings: around.crossings,
        // A closing stays within the convex hull.
        bounds: swollen.bounds.grown(-ball.mm()),
        uncertain: swollen.uncertain + around.uncertain,
        // The second is proven for the first one's mesh, which has not all of the exact dilation's topology after eroding.
        topology_exact: false,
    })
}

/// A dilation whose surfaces on one side of a closed mesh are those of the dilation of that: of what is on the other side, if a sheet serves that, or of the mesh itself.
fn beside(
    mesh: &TriMesh,
    side: Side,
    thickness: Radius,
    tolerance: Tolerance,
    simplify: bool,
    budget: &Budget,
) -> Result<Dilation, DilationError> {
    let budget = &budget.aside();
    if !simplify {
        return dilate_unsimplified(&surface_of(mesh), thickness, tolerance, budget);
    }
    // Where shells are not those of a solid, both sides of each are made.
    if Crossings::of(mesh, budget)?.count > 0 || misplaced_shell(mesh).is_some() {
        return dilate(&surface_of(mesh), thickness, tolerance, budget);
    }
    let other = match side {
        Side::Inward => mesh.complement(thickness.mm() + tolerance.mm()),
        Side::Outward => mesh.clone(),
    };
    let other = Attractor::of_triangles(&other, true).map(|other| sheets_around(&other, thickness, tolerance, budget)).transpose()?;
    other.flatten().map_or_else(|| dilate_without_sheets(&surface_of(mesh), thickness, tolerance, budget), Ok)
}

/// A mesh as a shape of triangles that bound nothing.
fn surface_of(mesh: &TriMesh) -> Attractor {
    let faces = mesh.triangles.iter().map(|corners| corners.to_vec()).collect();
    let shape = Shape::Mesh(PolygonMesh { vertices: mesh.vertices.clone(), faces, interior: Interior::Surface });
    Model { name: None, shape }.lower().expect("a solid's triangles are legal faces").attractor
}

/// The connected surfaces of a mesh of which a vertex is wanted.
fn shells(mesh: &TriMesh, wanted: impl Fn(DVec3) -> bool) -> TriMesh {
    let groups = Groups::of_triangles(mesh.vertices.len(), &mesh.triangles).all();
    let mut chosen = vec![None; mesh.vertices.len()];
    let mut numbers = vec![u32::MAX; mesh.vertices.len()];
    let mut result = TriMesh::default();
    for corners in &mesh.triangles {
        let group = groups[corners[0] as usize] as usize;
        if !*chosen[group].get_or_insert_with(|| wanted(mesh.vertices[group])) {
            continue;
        }
        let triangle = corners.map(|corner| {
            let number = &mut numbers[corner as usize];
            if *number == u32::MAX {
                *number = result.vertices.len() as u32;
                result.vertices.push(mesh.vertices[corner as usize]);
            }
            *number
        });
        result.triangles.push(triangle);
    }
    result
}

/// How exactly the largest ball inside a solid is found for a message, relative to its radius.
const EXACT_ENOUGH: f64 = 0.02;
/// Cubes looked at for it.
const MOST_CUBES: usize = 20_000;

/// The error of a wall that leaves no hollow, or what stopped the search for the thickness that would.
fn no_hollow(surface: &Attractor, inside: &Inside<'_>, thickness: Radius, budget: &Budget) -> DilationError {
    match largest_ball(surface, inside, budget) {
        Ok(ball) => DilationError::NoHollow { thickness_mm: thickness.mm(), largest_mm: [ball.low, ball.high] },
        Err(error) => error,
    }
}

/// The radius of the largest ball inside a closed surface: branch and bound over cubes, as the distance from the surface grows by no more than the way.
fn largest_ball(surface: &Attractor, inside: &Inside<'_>, budget: &Budget) -> Result<Interval, DilationError> {
    let bounds = bounding_box(surface, budget)?;
    let middle: [f64; 3] = std::array::from_fn(|axis| 0.5 * (bounds.low[axis].low + bounds.high[axis].high));
    let half = (0..3).map(|axis| bounds.high[axis].high - middle[axis]).fold(0.0, f64::max);
    let rule = SiteRule::new(surface, half.max(f64::MIN_POSITIVE), half.max(f64::MIN_POSITIVE), 1.0);
    let mut candidates = Candidates::default();
    for (index, root) in surface.roots().iter().enumerate() {
        candidates.push(surface.root_cell(index), &root.points, true);
    }
    let mut tree = Tree::new(&rule, 1e-13 * bounds.extent(), usize::MAX);
    let starts = tree.reset(&candidates);
    let mut depth = |x: [f64; 3]| {
        let distance = tree.nearest(&x, &starts, None, f64::INFINITY, 0.0).map_or(0.0, |hit| hit.distance_squared.sqrt());
        if inside.winding(DVec3::from_array(x)) > 0 { distance } else { -distance }
    };
    let mut best = Interval { low: 0.0, high: 3.0_f64.sqrt() * half };
    let mut cubes = vec![(middle, half)];
    // Positive numbers are in the order of their bits.
    let mut waiting = BinaryHeap::from([(best.high.to_bits(), 0)]);
    while let Some((bound, index)) = waiting.pop() {
        best.high = f64::from_bits(bound).max(best.low);
        if best.high - best.low <= EXACT_ENOUGH * best.high || cubes.len() > MOST_CUBES {
            return Ok(best);
        }
        budget.cancel.check()?;
        let (middle, half) = cubes[index];
        for corner in 0..8 {
            let half = 0.5 * half;
            let x = std::array::from_fn(|axis| middle[axis] + if corner >> axis & 1 == 1 { half } else { -half });
            let depth = depth(x);
            best.low = best.low.max(depth);
            let bound = (depth + 3.0_f64.sqrt() * half) * (1.0 + 1e-12);
            if bound > best.low {
                waiting.push((bound.to_bits(), cubes.len()));
                cubes.push((x, half));
            }
        }
    }
    best.high = best.low;
    Ok(best)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::mass::volume;
    use std::f64::consts::PI;

    /// A ball around the origin, by longitude and latitude.
    fn ball(around: u32, radius: f64) -> TriMesh {
        let half = around / 2;
        let at = |i: u32, j: u32| {
            let ((s, c), (t, d)) =
                ((2.0 * PI * f64::from(i) / f64::from(around)).sin_cos(), (PI * f64::from(j) / f64::from(half)).sin_cos());
            radius * DVec3::new(t * c, t * s, -d)
        };
        let mut mesh = TriMesh { vertices: vec![at(0, 0), at(0, half)], triangles: Vec::new() };
        mesh.vertices.extend((1..half).flat_map(|j| (0..around).map(move |i| at(i, j))));
        let number = |i: u32, j: u32| {
            if j == 0 {
                0
            } else if j == half {
                1
            } else {
                2 + (j - 1) * around + i % around
            }
        };
        for (i, j) in (0..around).flat_map(|i| (0..half).map(move |j| (i, j))) {
            let [a, b, c, d] = [number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)];
            mesh.triangles.extend([[a, b, c], [a, c, d]].into_iter().filter(|[a, b, c]| a != b && b != c && c != a));
        }
        mesh
    }

    /// Walls of a ball, and of a hollow one, which has a hollow on both sides: their volumes are those of balls, but for the bounds and what is between the mesh and the ball.
    #[test]
    fn walls_of_balls() {
        let (budget, e) = (Budget::default(), 0.05);
        let mut hollow = ball(96, 12.0);
        let mut inner = ball(96, 6.0);
        inner.reverse();
        hollow.append(&inner);
        let content = |radius: f64| 4.0 / 3.0 * PI * radius.powi(3);
        let shells = |radii: &[[f64; 2]]| radii.iter().map(|own| content(own[1]) - content(own[0])).sum::<f64>();
        let cases = [
            (ball(96, 12.0), Side::Inward, shells(&[[11.0, 12.0]]), 2),
            (ball(96, 12.0), Side::Outward, shells(&[[12.0, 13.0]]), 2),
            (hollow.clone(), Side::Inward, shells(&[[11.0, 12.0], [6.0, 7.0]]), 4),
            (hollow, Side::Outward, shells(&[[12.0, 13.0], [5.0, 6.0]]), 4),
        ];
        for (case, (mesh, side, expected, count)) in cases.into_iter().enumerate() {
            let solid = Solid::rounded(&mesh, &budget).unwrap().solid;
            let other = match side {
                Side::Inward => solid.mesh().complement(1.0),
                Side::Outward => solid.mesh().clone(),
            };
            let other = Attractor::of_triangles(&other, true).unwrap();
            let (thickness, tolerance) = (Radius::new(1.0).unwrap(), Tolerance::new(e).unwrap());
            assert!(sheets_around(&other, thickness, tolerance, &budget).unwrap().is_some(), "{case}");
            let wall = wall(&solid, side, thickness, tolerance, true, &budget).unwrap();
            assert!(wall.inner_mm <= e && wall.outer_mm <= e && wall.crossings == 0);
            let (own, shells) = (volume(wall.solid.mesh()), wall.solid.topology().shells);
            assert!((own / expected - 1.0).abs() < 0.05 && shells == count, "{case}: {own} {expected} {shells}");
        }
    }
}
