//! How far shapes are apart, where they meet, and how far one is from being the other.

use glam::DVec3;
use lacuna_kernel::attractor::{Attractor, refine};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::measure::contact::{
    CellPair, Contact, ContactError, ContactQuery, Place, Primitive, Verdict, intersect, intersect_primitive, intersect_self,
};
use lacuna_kernel::measure::hausdorff::{Directed, Hausdorff, MOST_BYTES, MOST_NODES, hausdorff};
use lacuna_kernel::measure::{AxisBox, bounding_box};
use lacuna_kernel::solid::Inside;
use lacuna_kernel::tolerance::{LENGTHS_MM, Tolerance};

use crate::certificate::{
    self, CellPairStatement, ContactStatement, ContactVerdict, DirectedStatement, HausdorffStatement, Holder, InsideStatement,
    PlaceStatement,
};
use crate::job::With;
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

/// Does a job of kind `intersect` without an operation: where two shapes, or a shape and a primitive or itself, come together.
pub(crate) fn contact(job: &Job, tolerance: Tolerance, budget: &Budget) -> Result<Outcome, JobError> {
    let shapes = shapes(job, budget)?;
    let query = ContactQuery { resolution: tolerance, most: MOST_PAIRS };
    budget.report("intersect", 0.0, 0);
    let found = match (shapes.as_slice(), &job.params.with) {
        ([(first, _), (second, _)], None) => intersect(first, second, &query, budget)?,
        ([(shape, _)], Some(With::Primitive(primitive))) => intersect_primitive(shape, primitive, &query, budget)?,
        ([(shape, _)], Some(With::Itself)) => intersect_self(shape, &query, budget)?,
        (_, None) => return Err(wrong_inputs(job, "two are held against each other; more need an operation")),
        (_, Some(_)) => return Err(wrong_inputs(job, "one is held against what \"with\" says")),
    };
    budget.report("intersect", 1.0, found.places.len() as u64);
    let mut certificate = certificate::of_shapes(&shapes, found.distance_mm.width(), tolerance);
    if !found.complete {
        certificate
            .warnings
            .push(format!("the search ended at a limit, of {MOST_PAIRS} pairs of cells near each other or of the job's cells: there may be more places, and the distance is not as narrow as the tolerance; a larger tolerance would do"));
    }
    if found.places.len() > MOST_PLACES {
        certificate.warnings.push(format!("{} of {} places are described", MOST_PLACES, found.places.len()));
    }
    let mut stated = statement(&found);
    if found.distance_mm.low > 0.0 {
        let held = match (shapes.as_slice(), &job.params.with) {
            ([(first, _), (second, _)], _) => match held(second, &samples(first, &found, budget)?, budget)? {
                None => held(first, &samples(second, &found, budget)?, budget)?.map(|point| (Holder::First, point)),
                Some(point) => Some((Holder::Second, point)),
            },
            ([(shape, _)], Some(With::Primitive(primitive))) => {
                held(shape, &point_of(primitive), budget)?.map(|point| (Holder::First, point))
            }
            _ => None,
        };
        if let Some((holder, point)) = held {
            let surface_distance_mm = stated.distance_mm;
            stated.inside = Some(InsideStatement { holder, point_mm: point.to_array(), surface_distance_mm });
            (stated.verdict, stated.distance_mm) = (ContactVerdict::Touching, [0.0; 2]);
        }
    }
    certificate.contact = Some(stated);
    Ok(Outcome { geometry: Geometry::None, certificate })
}

/// Points of a shape, at least one on every piece of it that a surface as far as was found leaves together.
///
/// Let d be that distance. A point of the shape is within d / 3 of the sample, and that point of the sample is on the same element as a vertex; the way between
/// stays within d / 3 of the shape, so it does not meet the surface, and the vertex is inside if and only if the point is.
fn samples(shape: &Attractor, found: &Contact, budget: &Budget) -> Result<Vec<DVec3>, JobError> {
    let fine = (found.distance_mm.low / 3.0).clamp(*LENGTHS_MM.start(), *LENGTHS_MM.end());
    Ok(refine(shape, Tolerance::new(fine)?, &budget.aside())?.vertices)
}

/// A point of what a shape is held against, where it is bounded: it is connected, and what is not bounded is not within a solid.
fn point_of(primitive: &Primitive) -> Vec<DVec3> {
    match *primitive {
        Primitive::Point(x) | Primitive::Segment([x, _]) | Primitive::AxisBox { low: x, .. } | Primitive::Ball { centre: x, .. } => {
            vec![x.into()]
        }
        Primitive::Ray { .. } | Primitive::Line { .. } | Primitive::Plane { .. } => Vec::new(),
    }
}

/// Points looked at together.
const CHUNK: usize = 1 << 12;

/// The first of the points that lies inside a solid of the shape; none of them is on its surfaces.
fn held(shape: &Attractor, points: &[DVec3], budget: &Budget) -> Result<Option<DVec3>, JobError> {
    for surface in shape.surfaces() {
        let inside = Inside::new(&surface);
        for chunk in points.chunks(CHUNK) {
            budget.cancel.check()?;
            if let Some(&point) = chunk.iter().find(|point| inside.winding(**point) > 0) {
                return Ok(Some(point));
            }
        }
    }
    Ok(None)
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
        certificate.warnings.push(format!("the search ended at a limit, of the job's cells or memory, or its own of {MOST_NODES} nodes and {} MiB in each direction, or at what numbers can tell apart: the distance is not as narrow as the tolerance; a larger tolerance would do", MOST_BYTES >> 20));
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
        first_mm: pair.points[0],
        second_mm: pair.points[1],
        off_mm: Some(pair.off_mm),
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
        inside: None,
        nearest: pair(&found.nearest),
        places: found.places.iter().take(MOST_PLACES).map(place).collect(),
        pairs_looked_at: found.pairs_looked_at,
        complete: found.complete,
    }
}
