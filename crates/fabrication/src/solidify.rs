//! Printable solids: the shape dilated by a ball, closed, and hollowed, as far as the job asks.

use lacuna_kernel::budget::Budget;
use lacuna_kernel::dilation::{close, dilate, dilate_unsimplified, stability, wall};
use lacuna_kernel::error::Kind;
use lacuna_kernel::solid::Solid;
use lacuna_kernel::tolerance::{Radius, Tolerance};

use crate::operand::{Source, solid_of};
use crate::run::{JobError, Outcome, lower, radius};
use crate::{Certificate, Geometry, Job, certificate};

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
    let make = if job.params.simplify { dilate } else { dilate_unsimplified };
    let dilation = make(attractor, radius, tolerance, budget)?;
    let mut certificate = certificate::of_dilation(attractor, &dilation, tolerance);
    if job.params.stability && attractor.has_own_radii() {
        let message =
            "stability tells at which radii the topology changes, and parts of the model have radii of their own; leave either out";
        return Err(JobError::new(Kind::Invalid, "stability.several-radii", message.into()));
    }
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
