//! Printable solids: the shape dilated by a ball, closed, and hollowed, as far as the job asks.

use lacuna_kernel::budget::Budget;
use lacuna_kernel::dilation::{Wall, close, dilate, dilate_unsimplified, stability, wall};
use lacuna_kernel::error::Kind;
use lacuna_kernel::measure::mass::volume;
use lacuna_kernel::solid::Solid;
use lacuna_kernel::tolerance::{Radius, Tolerance};

use crate::certificate::{Checked, Interval, SelfIntersections, of_one_solid};
use crate::operand::{Source, solid_of};
use crate::run::{JobError, Outcome, lower, radius};
use crate::{Certificate, Geometry, Job, WallOrder, WallSide, certificate};

/// How gaps were filled.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct ClosingStatement {
    /// Gaps narrower than this are filled.
    pub width_mm: f64,
    /// Half of that. C(X) is X and all points that no ball of this radius outside of X can reach. The result holds C(D(r - inner)) and lies in
    /// C(D(r + outer)).
    pub ball_radius_mm: f64,
}

/// A wall along the surface of a solid M that is written as a part of it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct WallStatement {
    /// On which side of M's surface.
    pub side: WallSide,
    /// The thickness that was asked.
    pub thickness_mm: f64,
    /// Points of that side as near to M's surface as the first belong to the wall, points farther than the second do not.
    #[cfg_attr(feature = "wire", schema(schema_with = crate::certificate::wire::interval_schema))]
    pub reached_mm: Interval,
    /// Volume that M's mesh encloses.
    pub solid_volume_mm3: f64,
    /// Volume of the hollow in the mesh as written: what an inward wall saves.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub hollow_volume_mm3: Option<f64>,
}

impl Certificate {
    /// Says that gaps up to a width were filled. The volume and the area of the exact shape are not known then; its box is that of the dilation, as a closing
    /// stays within the convex hull.
    pub(crate) fn state_closing(&mut self, width_mm: f64) {
        self.closing = Some(ClosingStatement { width_mm, ball_radius_mm: 0.5 * width_mm });
        (self.volume_mm3, self.area_mm2) = (None, None);
    }

    /// Says that a wall was made along the surface of `solid`, of which this certificate told so far.
    pub(crate) fn state_wall(&mut self, order: WallOrder, solid: &Solid, wall: &Wall, tolerance: Tolerance) {
        let WallOrder { thickness_mm, side } = order;
        let (solid_volume, wall_volume) = (volume(solid.mesh()), volume(wall.solid.mesh()));
        let crossings = match self.self_intersections {
            Checked::Found(SelfIntersections::Count(count)) => count,
            _ => 0,
        };
        // What was counted on the solid is counted anew.
        let counts = ["sealed voids", "separate pieces", "triangles cross"];
        let own =
            std::mem::take(&mut self.warnings).into_iter().filter(|warning| !counts.iter().any(|word| warning.contains(word))).collect();
        let counted = of_one_solid(&wall.solid, crossings + wall.crossings, own, tolerance);
        let grown = if side == WallSide::Outward { thickness_mm } else { 0.0 };
        let moved = |end: usize| self.bbox_mm[end].map(|x| if end == 0 { x.map(|x| x - grown) } else { x.map(|x| x + grown) });
        let reached_mm = [(thickness_mm - wall.inner_mm).max(0.0), thickness_mm + wall.outer_mm];
        *self = Self {
            achieved_bound_mm: self.achieved_bound_mm.max(wall.inner_mm).max(wall.outer_mm),
            inner_bound_mm: self.inner_bound_mm,
            outer_bound_mm: self.outer_bound_mm,
            thickness_min_mm: Some(reached_mm[0]),
            leaf_cells: self.leaf_cells + wall.leaf_cells,
            bbox_mm: [moved(0), moved(1)],
            lattice_pitch_mm: self.lattice_pitch_mm,
            closing: self.closing,
            wall: Some(WallStatement {
                side,
                thickness_mm,
                reached_mm,
                solid_volume_mm3: solid_volume,
                hollow_volume_mm3: (side == WallSide::Inward).then_some(solid_volume - wall_volume),
            }),
            ..counted
        };
    }
}

/// Does a job of kind `solidify`.
pub(crate) fn solidify(job: &Job, tolerance: Tolerance, budget: &Budget) -> Result<Outcome, JobError> {
    let (solid, mut certificate) = match radius(job)? {
        Some(radius) => dilated(job, radius, tolerance, budget)?,
        None => bounded(job, tolerance, budget)?,
    };
    let Some(order) = job.params.wall else { return Ok(Outcome { geometry: Geometry::Solid(solid), certificate }) };
    let thickness = Radius::new(order.thickness_mm)?;
    // The wall's other surface is measured from the one that is written, so that both may use the whole tolerance.
    let wall = wall(&solid, order.side.into(), thickness, tolerance, job.params.simplify, budget)?;
    certificate.state_wall(order, &solid, &wall, tolerance);
    Ok(Outcome { geometry: Geometry::Solid(wall.solid), certificate })
}

/// The shape dilated by a ball, and closed if that is asked for.
fn dilated(job: &Job, radius: Radius, tolerance: Tolerance, budget: &Budget) -> Result<(Solid, Certificate), JobError> {
    let attractor = &lower(job, budget)?.attractor;
    if let Some(width) = job.params.closing_mm {
        let closed = close(attractor, radius, Radius::new(0.5 * width)?, tolerance, job.params.simplify, budget)?;
        let mut certificate = certificate::of_dilation(attractor, &closed, tolerance);
        certificate.state_closing(width);
        return Ok((closed.solid, certificate));
    }
    if job.params.stability && attractor.has_own_radii() {
        let message =
            "stability tells at which radii the topology changes, and parts of the model have radii of their own; leave either out";
        return Err(JobError::new(Kind::Invalid, "stability.several-radii", message.into()));
    }
    let make = if job.params.simplify { dilate } else { dilate_unsimplified };
    let dilation = make(attractor, radius, tolerance, budget)?;
    let mut certificate = certificate::of_dilation(attractor, &dilation, tolerance);
    if job.params.stability {
        // Critical radii from half to twice the radius, and whether there are any within the bound that was reached.
        let reached = Tolerance::new(certificate.achieved_bound_mm)?;
        let found = stability(attractor, radius, reached, [0.5 * radius.mm(), 2.0 * radius.mm()], budget)?;
        certificate.state_stability(&found, radius, reached);
    }
    Ok((dilation.solid, certificate))
}

/// What the shape's own closed surface bounds: for walls, which need no ball.
fn bounded(job: &Job, tolerance: Tolerance, budget: &Budget) -> Result<(Solid, Certificate), JobError> {
    if job.params.wall.is_none() {
        let message = "solidify needs radius_mm, the radius of the ball in mm, or wall_mm, the thickness of a wall along a closed surface";
        return Err(JobError::new(Kind::Invalid, "bad-parameter", message.into()));
    }
    let (rounded, operand) = solid_of(&Source::only(job, budget)?, tolerance, budget)?;
    let certificate = certificate::of_operand(&rounded, &operand, tolerance);
    Ok((rounded.solid, certificate))
}
