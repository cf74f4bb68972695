//! How far shapes are apart, where they meet, and how far one is from being the other.

use lacuna_kernel::attractor::Attractor;
use lacuna_kernel::budget::Budget;
use lacuna_kernel::measure::contact::{CellPair, Contact, ContactError, ContactQuery, Place, Verdict, intersect, intersect_primitive};
use lacuna_kernel::measure::hausdorff::{Directed, Hausdorff, hausdorff};
use lacuna_kernel::measure::{AxisBox, bounding_box};
use lacuna_kernel::tolerance::Tolerance;

use crate::certificate::{
    self, CellPairStatement, ContactStatement, ContactVerdict, DirectedStatement, HausdorffStatement, PlaceStatement,
};
use crate::run::{JobError, Outcome, lower_all, wrong_inputs};
use crate::{Geometry, Job};

/// Pairs of cells that a job lists at most: each place has a line in the certificate.
const MOST_PAIRS: usize = 100_000;
/// Places that the certificate describes.
const MOST_PLACES: usize = 1_000;

impl From<ContactError> for JobError {
    fn from(error: ContactError) -> Self {
        Self::new(error.kind(), error.code(), error.to_string())
    }
}

/// The shapes of a job's inputs, and their boxes.
fn shapes(job: &Job, budget: &Budget) -> Result<Vec<(Attractor, AxisBox)>, JobError> {
    let boxed = |attractor: Attractor| bounding_box(&attractor, budget).map(|bounds| (attractor, bounds)).map_err(JobError::from);
    lower_all(job, budget)?.into_iter().map(|lowered| boxed(lowered.attractor)).collect()
}

/// Does a job of kind `intersect` without an operation: where two shapes, or a shape and a primitive, come together.
pub(crate) fn contact(job: &Job, tolerance: Tolerance, budget: &Budget) -> Result<Outcome, JobError> {
    let shapes = shapes(job, budget)?;
    let query = ContactQuery { resolution: tolerance, most: MOST_PAIRS };
    budget.report("intersect", 0.0, 0);
    let found = match (shapes.as_slice(), &job.params.with) {
        ([(first, _), (second, _)], None) => intersect(first, second, &query, budget)?,
        ([(shape, _)], Some(primitive)) => intersect_primitive(shape, primitive, &query, budget)?,
        (_, None) => return Err(wrong_inputs(job, "two are held against each other; more need an operation")),
        (_, Some(_)) => return Err(wrong_inputs(job, "one is held against what \"with\" says")),
    };
    budget.report("intersect", 1.0, found.places.len() as u64);
    let mut certificate = certificate::of_shapes(&shapes, found.distance_mm.width(), tolerance);
    if !found.complete {
        certificate
            .warnings
            .push("the search ended at a limit: there may be more places, and the distance is not as narrow as the tolerance".into());
    }
    if found.places.len() > MOST_PLACES {
        certificate.warnings.push(format!("{} of {} places are described", MOST_PLACES, found.places.len()));
    }
    certificate.contact = Some(statement(&found));
    Ok(Outcome { geometry: Geometry::None, certificate })
}

/// Does a job of kind `measure` with two inputs: how far one shape is from being the other.
pub(crate) fn compare(job: &Job, tolerance: Tolerance, budget: &Budget) -> Result<Outcome, JobError> {
    let shapes = shapes(job, budget)?;
    let [(first, _), (second, _)] = shapes.as_slice() else {
        return Err(wrong_inputs(job, "measure takes one, or two to compare"));
    };
    let found = hausdorff(first, second, tolerance, budget)?;
    let mut certificate = certificate::of_shapes(&shapes, found.distance_mm().width(), tolerance);
    if !found.complete {
        certificate.warnings.push("the search ended at a limit: the distance is not as narrow as the tolerance".into());
    }
    let Hausdorff { from_first, from_second, .. } = &found;
    let directed =
        |found: &Directed| DirectedStatement { distance_mm: [found.distance_mm.low, found.distance_mm.high], near_mm: found.place.centre };
    let distance = found.distance_mm();
    certificate.hausdorff = Some(HausdorffStatement {
        distance_mm: [distance.low, distance.high],
        from_first: directed(from_first),
        from_second: directed(from_second),
        complete: found.complete,
    });
    Ok(Outcome { geometry: Geometry::None, certificate })
}

fn statement(found: &Contact) -> ContactStatement {
    let verdict = |verdict: Verdict| match verdict {
        Verdict::Disjoint => ContactVerdict::Disjoint,
        Verdict::Near => ContactVerdict::Near,
        Verdict::Touching => ContactVerdict::Touching,
    };
    let pair = |pair: &CellPair| CellPairStatement {
        first: pair.first.to_string(),
        second: pair.second.as_ref().map(ToString::to_string),
        first_mm: pair.first_cell.centre,
        second_mm: pair.second_cell.centre,
        distance_mm: [pair.distance_mm.low, pair.distance_mm.high],
    };
    let place = |place: &Place| PlaceStatement {
        bbox_mm: [place.low, place.high],
        verdict: verdict(place.verdict()),
        distance_mm: [place.distance_mm.low, place.distance_mm.high],
        pairs: place.pairs as u64,
        nearest: pair(&place.pair),
    };
    ContactStatement {
        verdict: verdict(found.verdict()),
        distance_mm: [found.distance_mm.low, found.distance_mm.high],
        nearest: pair(&found.nearest),
        places: found.places.iter().take(MOST_PLACES).map(place).collect(),
        complete: found.complete,
    }
}
