//! Previews: something of a result for the eye, soon.
//!
//! A solid is dilated as coarsely as its ball allows, and its lattice is left as it is. Where that is still too much, as where a thin ball covers a large fractal, the shape is shown without its
//! ball. What is shown is chosen by counts, not by a clock: so a preview is the same on every machine and for any number of threads. All that a certificate says of a result it says of a
//! preview, at the preview's own tolerance.

use lacuna_kernel::attractor::{Attractor, RefineError, count_cells};
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_kernel::dilation::{DilationError, dilate_unsimplified};
use lacuna_kernel::measure::bounding_box;
use lacuna_kernel::tolerance::Tolerance;

use crate::run::{JobError, Outcome, evaluate, lower, radius};
use crate::{Certificate, Geometry, Job, certificate};

/// Triangles of a preview's lattice, at most: on two cores of the machine of `fixtures/ESTIMATES.md` so many take 1 to 1.5 s, written and read back.
const TRIANGLES: u64 = 250_000;

/// Leaf cells of a shape that is shown without a ball, at most, but that its coarsest cells are always shown: they take less than half a second.
const CELLS: u64 = 100_000;

/// That a result is a preview.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct PreviewStatement {
    /// The tolerance of the job: that of its result without `preview`.
    pub final_tolerance_mm: f64,
    /// The tolerance of the preview, never less; the bounds of the certificate are held against this one.
    pub tolerance_mm: f64,
    /// Whether the shape itself is shown, and not its dilation by the ball of the job, because that would take too long: then all of the certificate is of the shape itself.
    pub without_ball: bool,
}

impl Certificate {
    fn state_preview(&mut self, preview: PreviewStatement) {
        let PreviewStatement { final_tolerance_mm, tolerance_mm, without_ball } = preview;
        let shown = if without_ball { "the shape without its ball" } else { "the result" };
        let words = format!(
            "a preview: {shown} within {tolerance_mm} mm, where the job asks for {final_tolerance_mm} mm; leave \"preview\" out for what it asks for"
        );
        self.warnings.insert(0, words);
        self.preview = Some(preview);
    }
}

/// Does a job of kind `evaluate`, or of kind `solidify` with a ball and nothing besides, as a preview.
pub(crate) fn preview(job: &Job, tolerance: Tolerance, budget: &Budget) -> Result<Outcome, JobError> {
    let attractor = &lower(job, budget)?.attractor;
    let radius = radius(job)?;
    if let Some(radius) = radius {
        // No dilation is coarser than half of its ball.
        let coarse = Tolerance::new(tolerance.mm().max(0.5 * radius.mm()))?;
        let limits = Limits { triangles: budget.limits.triangles.min(TRIANGLES), ..budget.limits };
        match dilate_unsimplified(attractor, radius, coarse, &Budget { limits, ..budget.aside() }) {
            Ok(dilation) => {
                let mut certificate = certificate::of_dilation(attractor, &dilation, coarse);
                certificate.state_preview(statement(tolerance, coarse, false));
                return Ok(Outcome { geometry: Geometry::Solid(dilation.solid), certificate });
            }
            // A limit of the job's own refuses it, as it would any other: limits decide whether there is a result, not which.
            Err(DilationError::Triangles { allowed: TRIANGLES, .. }) => {}
            Err(error) => return Err(error.into()),
        }
    }
    let coarse = shown(attractor, tolerance, budget)?;
    let mut outcome = evaluate(attractor, coarse, job.params.normals, budget)?;
    outcome.certificate.state_preview(statement(tolerance, coarse, radius.is_some()));
    Ok(outcome)
}

fn statement(tolerance: Tolerance, coarse: Tolerance, without_ball: bool) -> PreviewStatement {
    PreviewStatement { final_tolerance_mm: tolerance.mm(), tolerance_mm: coarse.mm(), without_ball }
}

/// The finest of the tolerances t, 2 t, 4 t, ... at which a shape has few enough cells; the coarse ones, which cost least, are tried first.
fn shown(attractor: &Attractor, tolerance: Tolerance, budget: &Budget) -> Result<Tolerance, JobError> {
    // The size of a shape may be of any order; so may a tolerance, and beyond it nothing changes.
    let doublings = (bounding_box(attractor, budget)?.extent() / tolerance.mm()).log2().ceil().clamp(0.0, 1000.0);
    let limits = Limits { cells: CELLS, ..Limits::default() };
    let counted = Budget { limits, progress: None, ..budget.clone() };
    let mut coarse = tolerance.mm() * doublings.exp2();
    while coarse > tolerance.mm() {
        match count_cells(attractor, Tolerance::new(0.5 * coarse)?, &counted) {
            Ok(_) => coarse *= 0.5,
            Err(stopped @ RefineError::Stopped(_)) => return Err(stopped.into()),
            Err(_) => break,
        }
    }
    Ok(Tolerance::new(coarse.max(tolerance.mm()))?)
}
