//! Volumes by their faces: solids of triangles that stand for products of three Bezier curves or splines.
//!
//! Let V be the image of cells Q, cubes that are glued along faces, under F, and S the image of those faces of cubes that are glued to no other. Let all cubes be seen with the same orientation from
//! where they are glued, so that what is glued cancels in the boundary of Q: then around any point that is not in S, F winds S as often as F takes a place there, each counted with
//! the sign of the Jacobian (degree of a map). So
//! * around what S winds, something of V is there: such points are in V;
//! * where the Jacobian has one sign, S winds around all of V but S itself, as often as V is there.
//!
//! Faces that are lines or points have no part in S: V is closed, and so what is on them is no farther away than what is beside them.
//!
//! Let triangles T, a closed surface in one piece that does not meet itself and bounds the solid W, stand for S within d as `drawn` has it, cell by cell: on the straight way from one to the other everything stays within d of both. (Of more pieces it would have to be known which way S turns at each.) Then S winds as T does around points farther
//! than d from T. So V is within d of W, but for pieces on which the sign is not known, which are looked at by themselves; and W is in V but for what is within d of T. What is within r of W and not in V is within r of T, or within d of it:
//! with d at most r, D_r(W) is in D_(r + d)(V), and D_r(V) in D_(r + d)(W).

mod boundary;
mod jacobian;
#[cfg(test)]
mod tests;

use super::cell::Ball;
use super::{Attractor, OwnRadius, RefineError, Root, SolidSurface, StateId, roots_of};
use crate::automaton::{Automaton, State, SubdivisionOperator};
use crate::budget::Budget;
use crate::measure::mass::volume;
use crate::solid::{Crossings, Inside, Solid, SolidError, TriMesh};
use crate::tolerance::Tolerance;
use boundary::Group;
use glam::DVec3;
use jacobian::{Net, Volume};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// What rounding adds to a distance, as a share of it.
const ROUNDING: f64 = 1e-9;

impl Attractor {
    /// The attractor with solids of triangles for volumes that hang together, of which it is proven that dilations of these by no less than what is told differ by no more than that; none where there is no such volume.
    ///
    /// Cost: that of drawing their faces, and the square of eight times as many control points as each has.
    ///
    /// # Errors
    /// [`RefineError`], of drawing the faces.
    pub(crate) fn filled(&self, tolerance: Tolerance, budget: &Budget) -> Result<Option<(Self, f64)>, RefineError> {
        let groups = self.groups_of_volumes();
        if groups.is_empty() || !self.trimmed.is_empty() {
            return Ok(None);
        }
        let curves = self.bezier_curves();
        let (mut solids, mut farthest) = (Vec::new(), 0.0_f64);
        for group in groups {
            if let Some((mesh, deviation_mm)) = self.filled_group(&group, &curves, tolerance, budget)? {
                farthest = farthest.max(deviation_mm);
                solids.push((group, mesh));
            }
        }
        if solids.is_empty() {
            return Ok(None);
        }
        Ok(self.with_solids(&solids).map(|filled| (filled, farthest)))
    }

    /// Whether there are volumes that may be filled.
    pub(crate) fn has_volumes(&self) -> bool {
        self.brep().is_some_and(|(topology, _)| self.roots.iter().any(|root| topology.state(root.state).dimension == 3))
    }

    /// The solid that stands for a group of volumes, and by how much dilations of both may differ; none where that is not proven.
    fn filled_group(
        &self,
        group: &Group,
        (curves, miss): &(Vec<Option<SubdivisionOperator>>, f64),
        tolerance: Tolerance,
        budget: &Budget,
    ) -> Result<Option<(TriMesh, f64)>, RefineError> {
        let volume_of = |&root: &usize| {
            let root = &self.roots[root];
            let own: Vec<&SubdivisionOperator> =
                self.automaton.factors(root.state).iter().map(|factor| curves[factor.index()].as_ref()).collect::<Option<_>>()?;
            let size: [usize; 3] = own.iter().map(|points| points.columns()).collect::<Vec<_>>().try_into().ok()?;
            let columns = SubdivisionOperator::product(own.into_iter().cloned().collect());
            let mut points = vec![[0.0; 4]; columns.columns()];
            super::cell::child_points(&root.points, &columns, &mut points);
            Volume::new(Net::new(size, points), 3.0 * miss)
        };
        let Some(volumes) = group.roots.par_iter().map(volume_of).collect::<Option<Vec<Volume>>>() else { return Ok(None) };
        let Some(faces) = self.boundary_of(group) else { return Ok(None) };
        let (mut mesh, deviation_mm) = faces.drawn(tolerance, budget)?;
        if volume(&mesh) < 0.0 {
            mesh.reverse();
        }
        let mesh = match Solid::new(mesh, budget) {
            Ok(solid) if solid.topology().shells > 1 => return Ok(None),
            Ok(solid) => solid.into_mesh(),
            Err(SolidError::Stopped(stopped)) => return Err(stopped.into()),
            Err(_) => return Ok(None),
        };
        if Crossings::of(&mesh, budget)?.count > 0 {
            return Ok(None);
        }
        let inside = Inside::new(&mesh);
        // What is within the solid, or so near to it, is no farther from it, however it is turned; what is outside and farther away would have to be in it with a sign that is known.
        let (is_beside, within) = (AtomicBool::new(false), deviation_mm.max(tolerance.mm()));
        let look = |Ball { centre, radius }: &Ball| {
            let (centre, radius) = (DVec3::from_array(*centre), radius * (1.0 + ROUNDING));
            let gap = inside.distance(centre);
            if gap == 0.0 && inside.surface_distance(centre) > radius {
                return Some(true);
            }
            if gap + radius <= within {
                is_beside.store(true, Ordering::Relaxed);
                return Some(true);
            }
            (gap - radius > within).then_some(false)
        };
        let sign = volumes[0].sign();
        let looked_at = volumes.into_par_iter().map(|volume| volume.keeps_sign(sign, look, budget));
        // The first that is found to fail ends it.
        let keep_sign = looked_at.find_any(|own| !matches!(own, Ok(true))).unwrap_or(Ok(true))?;
        let deviation_mm = if is_beside.into_inner() { within } else { deviation_mm };
        Ok(keep_sign.then_some((mesh, deviation_mm)))
    }

    /// The attractor whose roots in some groups are solids instead.
    fn with_solids(&self, meshes: &[(Group, TriMesh)]) -> Option<Self> {
        let mut is_kept = vec![true; self.roots.len()];
        meshes.iter().flat_map(|(group, _)| &group.roots).for_each(|&root| is_kept[root] = false);
        let kept: Vec<usize> = (0..self.roots.len()).filter(|&root| is_kept[root]).collect();
        let mut radii: Vec<Option<OwnRadius>> = kept.iter().map(|&root| self.own_radius(root).cloned()).collect();
        let mut roots: Vec<Root> = kept.iter().map(|&root| self.roots[root].clone()).collect();
        let (automaton, state) = if roots.is_empty() {
            (Automaton::new(vec![State::simplex(3)]).ok()?, StateId::new(0))
        } else {
            self.automaton.with_simplex(3)
        };
        let mut solids = self.solids.clone();
        for solid in &mut solids {
            solid.first_root = kept.partition_point(|&root| root < solid.first_root);
        }
        for (group, mesh) in meshes {
            let (first_root, number) = (roots.len(), solids.len() as u32);
            roots.extend(roots_of(&mesh.vertices, &mesh.triangles, state).map(|root| Root { solid: Some(number), ..root }));
            let own = group.roots.first().and_then(|&root| self.own_radius(root));
            radii.resize(roots.len(), own.cloned());
            solids.push(SolidSurface { first_root, triangles: mesh.triangles.clone(), normals: Vec::new() }.with_normals(&roots));
        }
        Self::new(automaton, roots, solids, self.warnings.clone()).ok().map(|filled| filled.with_radii(radii))
    }
}
