//! Polygons that come close to each other only where they hang together, such as the walls of a box, or of a sponge: what is around them is found vertex by vertex, and once for all vertices that are alike.
//!
//! Let B be a polytope with D_s(0) in B in D_t(0), s < r < t (`ball`). M = S + B (Minkowski sum) is the union of the P_i = S_i + B, for the convex S_i that S consists of, with D_s(S_i) in P_i in D_t(S_i). Around a vertex, the P_i that have it are sums of cones and B: their union is known exactly (`corner`), and is the same wherever
//! the same directions lead away from a vertex (`net`). Its lines go out along edges of S, and come in at their other ends. So there are loops from vertex to vertex, and what they bound in a plane is cut into triangles (`loops`). This is the boundary of M where nothing comes near to it but what hangs together at a vertex.
//!
//! That is not asked for. Of what comes out, all triangles of which are on facets of P_i, and so no farther from S than t, three things are shown:
//!
//! * It is closed, and meets itself nowhere.
//! * No triangle is nearer to S than s (`clear`).
//! * Where up to four S_i are within t of a point x, but none within s, there is a place v nearer than s to all of them (`nerve`: for any polytopes between the dilations, nothing is up to these).
//!
//! Then, for the closest points c of x in these, (x - c) . (x - v) > 0, as (x - c) . (p - c) <= 0 for the p of S_i next to v; and n . (x - v) > 0 for the normal n of a facet of P_i that x is on, as v is inside of P_i. At a point of the surface, no four of all such x - c and n have 0 in their hull, as they come from no more than four S_i; so all of them have not
//! (Caratheodory), and there is a way out through all facets at x along which the distance grows. At other points of the band the same is true of the x - c. So the ways along which it grows, from the boundary of D_s(S) to that of D_t(S), cross the surface once or never, and as all that is around every vertex belongs to the surface, it leaves out none:
//! what it bounds holds D_s(S), is within D_t(S), and has the topology of D(r). See `star` for the same of lattices.
//!
//! Where that does not come out, or vertices are alike too seldom, polytopes, or a lattice, do the work.

mod ball;
mod clear;
mod corner;
mod loops;
mod net;
#[cfg(test)]
mod tests;

use super::bodies::Bodies;
use super::figure::Figure;
use super::nerve::Sets;
use super::polytopes::{Polytope, Polytopes};
use super::{BYTES_PER_TRIANGLE, Flat};
use crate::attractor::cell::{Point, distance_squared};
use crate::budget::{Budget, Stopped};
use crate::dilation::convex::Convex;
use crate::dilation::setting::Setting;
use crate::dilation::surface::BlockSurface;
use crate::solid::box_tree::{Box32, BoxTree};
use crate::solid::{Crossings, SolidError, Topology, TriMesh};
use ball::{Ball, SAME};
use corner::Patch;
use glam::DVec3;
use net::{Fan, Kinds, Net};
use rayon::prelude::*;

/// How much narrower the band is than what may be, in units of rounding, and of what directions that are taken for one make of distances: points that are taken for one are less than half of this apart.
const ROUNDINGS: f64 = 3.0;
const NOISES: f64 = 100.0;
/// Facets of the ball that go on along edges turn from others by at least this share of what they may; where that does not come out, by anything.
const LEAST_TURNS: [f64; 2] = [0.3, 0.0];
/// Figures that are asked how far others are, at most, and what is no distance, in units of what is asked for.
const SAMPLE: usize = 64;
const TOUCHING: f64 = 1e-3;
/// Faces are as far out as they are meant to be where the ball then has so many times the corners at most that it has with faces as near as may be, and no other faces are about two radii away.
const MORE_CORNERS: f64 = 1.25;
/// Triangles for each point, about.
const PER_POINT: f64 = 2.0;

/// The surface around triangles, which are joined to figures, with coordinates that are rounded; none where it is not made of what is around vertices.
///
/// # Errors
/// [`Stopped`].
pub(super) fn surface(
    triangles: &[[Point; 3]],
    figures: &[Figure],
    setting: &Setting,
    round: impl Fn(f64) -> f64 + Sync,
    budget: &Budget,
) -> Result<Option<Flat>, Stopped> {
    let Some(net) = Net::new(triangles) else { return Ok(None) };
    let Some(kinds) = Kinds::of(&net, budget)? else { return Ok(None) };
    let spare = ROUNDINGS * setting.rounding + NOISES * SAME * setting.outer + setting.slack;
    let [inner, outer] = [setting.least + spare, setting.outer - spare];
    for share in LEAST_TURNS {
        let thin = kinds.ball([inner, inner, outer], share);
        let is_good = |ball: &Ball| {
            let most = thin.as_ref().map_or(f64::INFINITY, |thin| MORE_CORNERS * thin.corners() as f64);
            ball.corners() as f64 <= most && !are_close(figures, 2.0 * ball.outer())
        };
        let thick = kinds.ball([inner, setting.reach.max(inner), outer], share).filter(is_good);
        let mut is_made = false;
        for ball in [thick, thin].into_iter().flatten() {
            let patch = |fan: &Fan| {
                budget.cancel.check()?;
                Ok(Patch::new(&fan.arcs, &fan.ways, &ball))
            };
            let patches: Vec<Option<Patch>> = kinds.fans.par_iter().map(patch).collect::<Result<_, Stopped>>()?;
            let Some(patches) = patches.into_iter().collect::<Option<Vec<Patch>>>() else { continue };
            let expected = PER_POINT * kinds.points(&patches);
            if expected > 2.0 * budget.limits.triangles as f64 {
                return Ok(Some(Flat::Beyond(expected)));
            }
            if BYTES_PER_TRIANGLE * (expected + triangles.len() as f64) > budget.limits.memory_bytes as f64 {
                return Ok(None);
            }
            let Some((surface, normals)) = loops::surface(&net, &kinds, &patches, &round, budget)? else { continue };
            if let Some(surface) = shown(surface, &normals, figures, setting, ball.outer(), budget)? {
                return Ok(Some(Flat::Made(Box::new(surface))));
            }
            is_made = true;
        }
        if is_made {
            break;
        }
    }
    Ok(None)
}

/// Whether some of a sample of figures are no farther than a distance from others that they have no corner on, nor these on them, as far as corners tell.
fn are_close(figures: &[Figure], distance: f64) -> bool {
    let boxes: Vec<Box32> = figures.iter().map(|figure| figure.box_within(0.5 * distance)).collect();
    let mut tree = BoxTree::default();
    tree.build(boxes.len(), |index| Some(boxes[index as usize]), true);
    (0..figures.len()).step_by(figures.len().div_ceil(SAMPLE).max(1)).any(|own| {
        let is_close = |other: usize| {
            let of = |one: &Figure, other: &Figure| {
                let square = |corner: &Point| distance_squared(corner, &one.closest(corner));
                other.corners().iter().map(square).fold(f64::INFINITY, f64::min)
            };
            let square = of(&figures[own], &figures[other]).min(of(&figures[other], &figures[own]));
            (TOUCHING * distance).powi(2) < square && square < distance * distance
        };
        let mut is_found = false;
        tree.query(&boxes[own], 0, |leaf| {
            let near = tree.items(leaf).iter().zip(tree.boxes(leaf)).filter(|(_, other)| boxes[own].meets(other));
            is_found |= near.map(|(&item, _)| item as usize).any(|other| other != own && is_close(other));
            !is_found
        });
        is_found
    })
}

/// A surface, with the normals of its triangles' facets, if it is what it is meant to be, around figures and no farther from them than `outer`.
fn shown(
    mut surface: BlockSurface,
    normals: &[Point],
    figures: &[Figure],
    setting: &Setting,
    outer: f64,
    budget: &Budget,
) -> Result<Option<BlockSurface>, Stopped> {
    let is_shown = is_embedded(&mut surface, budget)?
        && clear::are_clear(&surface, normals, figures, setting.least + setting.slack, budget)?
        && is_settled(figures, setting, outer, budget)?;
    surface.drop_unused();
    Ok(is_shown.then_some(surface))
}

/// Whether a surface is closed, and meets itself nowhere.
pub(super) fn is_embedded(surface: &mut BlockSurface, budget: &Budget) -> Result<bool, Stopped> {
    // The triangles are lent.
    let vertices = surface.vertices.iter().copied().map(DVec3::from_array).collect();
    let mesh = TriMesh { vertices, triangles: std::mem::take(&mut surface.triangles) };
    let is_closed = match Topology::of(&mesh, budget) {
        Ok(topology) => topology.is_closed_manifold(),
        Err(SolidError::Stopped(stopped)) => return Err(stopped),
        Err(_) => false,
    };
    let is_embedded = is_closed && Crossings::of(&mesh, budget)?.count == 0;
    surface.triangles = mesh.triangles;
    Ok(is_embedded)
}

/// Whether nothing is up to polytopes around figures, whatever these are like, but that they are no farther out than a distance.
fn is_settled(figures: &[Figure], setting: &Setting, outer: f64, budget: &Budget) -> Result<bool, Stopped> {
    let mut setting = setting.clone();
    setting.outer = setting.reach.max(outer) + setting.slack;
    let nothing = || Polytope::with(Default::default(), Box::default(), Box::default(), Box::default());
    let polytopes = Polytopes { all: figures.iter().map(|_| nothing()).collect() };
    let bodies = Bodies { setting: &setting, figures, polytopes: &polytopes, solids: &[] };
    Ok(Sets::new(&bodies, budget)?.is_some_and(|sets| sets.are_settled()))
}
