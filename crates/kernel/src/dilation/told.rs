//! The topology of dilations of which sites do not tell it, as of points that stand for cells of fractals: it is told by points K, whose dilation is shown to have the attractor's topology, see `flow`.
//!
//! K need not be within the tolerance, and so are far fewer. Of points the topology of the dilation is proven as that of all others, see `critical` and `star`: a solid has the attractor's if it has as many components, handles and voids.

use super::arrangement::Figure;
use super::flow::Flow;
use super::{DilationError, dilate_unsimplified, unless_stopped};
use crate::attractor::Attractor;
use crate::attractor::cell::Point;
use crate::budget::{Budget, Limits};
use crate::solid::Topology;
use crate::tolerance::{Radius, Tolerance};

/// How wide cubes are in which there is a place that a point is closest to, in units of the radius, as it is tried; and points at most.
const WIDE: [f64; 2] = [0.5, 0.2];
const MOST_POINTS: usize = 20_000;
/// The tolerance of the dilation of points, in units of the radius.
const COARSE: f64 = 0.25;

/// Whether the dilation of an attractor has a topology; none where it is not known.
///
/// # Errors
/// A stop.
pub(super) fn is_told(flow: &Flow<'_>, topology: &Topology, budget: &Budget) -> Result<Option<bool>, DilationError> {
    for wide in WIDE {
        let Some(points) = flow.points(wide * flow.radius, MOST_POINTS, budget)? else { return Ok(None) };
        if flow.is_that_of(&Figure::of_points(&points), budget)?
            && let Some(own) = of_points(&points, flow.radius, budget)?
        {
            return Ok(Some(own == counts(topology)));
        }
    }
    Ok(None)
}

/// Components, handles and voids of the dilation of points; none where they are in doubt.
fn of_points(points: &[Point], radius: f64, budget: &Budget) -> Result<Option<[i64; 3]>, DilationError> {
    let Some(attractor) = Attractor::of_points(points) else { return Ok(None) };
    let (Ok(ball), Ok(tolerance)) = (Radius::new(radius), Tolerance::new(COARSE * radius)) else { return Ok(None) };
    // The solid that it is asked of is held, too.
    let limits = Limits { memory_bytes: budget.limits.memory_bytes / 2, ..budget.limits };
    let made = unless_stopped(dilate_unsimplified(&attractor, ball, tolerance, &Budget { limits, ..budget.aside() }).map(Some))?;
    Ok(made.filter(|made| made.topology_exact).map(|made| counts(made.solid.topology())))
}

fn counts(topology: &Topology) -> [i64; 3] {
    [topology.components as i64, topology.genus, topology.cavities as i64]
}
