//! Questions about addresses, answered: where one leads, and which lead near a point.

use std::time::Duration;

use lacuna_exchange::document::Sought;
use lacuna_kernel::attractor::cell::Ball;
use lacuna_kernel::attractor::{Address, AddressError, Attractor, NearQuery, Neighbourhood, addresses_near, point_at};
use lacuna_kernel::automaton::StateId;
use lacuna_kernel::budget::{Budget, CancelToken};
use lacuna_kernel::model::Model;
use lacuna_kernel::tolerance::{LENGTHS_MM, Tolerance};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::jobs::watchdog::Watchdog;
use crate::problem::{Finding, Problem};
use crate::production::{self, guarded};

/// The answer to a question about addresses: the member of what was asked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct AddressAnswer {
    /// Where the address leads.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub at: Option<LocatedPoint>,
    /// What is near the point.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub near: Option<NearbyCells>,
}

/// The point at an address.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LocatedPoint {
    /// The address of the point: the one that was asked; that of a cell is continued by the first transition of every
    /// state.
    pub address: String,
    /// The point.
    pub point_mm: [f64; 3],
    /// The exact point is no farther from it than this: proven.
    pub bound_mm: f64,
    /// The cell at the end of what comes before the period.
    pub cell: CellPlace,
}

/// A cell and a ball that contains it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CellPlace {
    /// Its address.
    pub address: String,
    /// The name of its state.
    pub state: String,
    /// The ball's centre.
    pub centre_mm: [f64; 3],
    /// The ball's radius.
    pub radius_mm: f64,
}

/// The shape near a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct NearbyCells {
    /// The point that was asked.
    pub point_mm: [f64; 3],
    /// The distance that was asked, if one was.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub within_mm: Option<f64>,
    /// The radius to which cells were refined.
    pub tolerance_mm: f64,
    /// The closest point of the shape, up to the tolerance.
    pub nearest: NearestPoint,
    /// The cells, closest first.
    pub cells: Vec<NearbyCell>,
    /// Whether all cells as near as asked are listed.
    pub complete: bool,
}

/// A point of the shape with its distance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct NearestPoint {
    /// Its address.
    pub address: String,
    /// The point.
    pub point_mm: [f64; 3],
    /// The exact point is no farther from it than this.
    pub bound_mm: f64,
    /// The distance of the shape from the point that was asked lies in this interval: proven.
    pub distance_mm: [f64; 2],
}

/// A cell near the point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct NearbyCell {
    /// Its address, state and ball.
    #[serde(flatten)]
    pub cell: CellPlace,
    /// Its distance from the point lies in this interval.
    pub distance_mm: [f64; 2],
}

/// Answers a question within a time.
///
/// # Errors
/// When the model cannot be evaluated, the address does not fit it, or a limit is hit.
pub fn answer(model: &Model, sought: &Sought, time: Duration) -> Result<AddressAnswer, Problem> {
    let mut budget = Budget { cancel: CancelToken::new(), ..Budget::default() };
    budget.limits.seconds = time.as_secs_f64();
    let _watchdog = Watchdog::start(&budget.cancel, budget.limits.seconds).map_err(|error| Problem::io("no thread", &error))?;
    let lowered = guarded(|| model.lower())?.map_err(|findings| Problem::from(lacuna_fabrication::JobError::model(findings)))?;
    let attractor = &lowered.attractor;
    let found = guarded(|| match sought {
        Sought::At(address) => located(attractor, address, &budget),
        Sought::Near { point_mm, within_mm, tolerance_mm, most } => {
            let resolution = Tolerance::new(tolerance_mm.unwrap_or_else(|| thousandth(attractor)))?;
            let query = NearQuery { point: *point_mm, within_mm: *within_mm, resolution, most: *most };
            addresses_near(attractor, &query, &budget).map(|found| nearby(attractor, &query, &found))
        }
    })?;
    found.map_err(|error| production::why_stopped(&budget).unwrap_or_else(|| problem(&error)))
}

/// The points at some addresses of one model, all within the time.
///
/// # Errors
/// As [`answer`], for the first that fails.
pub fn points(model: &Model, addresses: &[Address], time: Duration) -> Result<Vec<[f64; 3]>, Problem> {
    let mut budget = Budget { cancel: CancelToken::new(), ..Budget::default() };
    budget.limits.seconds = time.as_secs_f64();
    let _watchdog = Watchdog::start(&budget.cancel, budget.limits.seconds).map_err(|error| Problem::io("no thread", &error))?;
    let lowered = guarded(|| model.lower())?.map_err(|findings| Problem::from(lacuna_fabrication::JobError::model(findings)))?;
    let locate = |address: &Address| point_at(&lowered.attractor, address, &budget).map(|found| found.point);
    let found = guarded(|| addresses.iter().map(locate).collect::<Result<Vec<_>, _>>())?;
    found.map_err(|error| production::why_stopped(&budget).unwrap_or_else(|| problem(&error)))
}

/// A thousandth of the radius of a ball around the root cells, but a possible length.
fn thousandth(attractor: &Attractor) -> f64 {
    let balls: Vec<Ball> = (0..attractor.roots().len()).map(|index| attractor.root_cell(index).ball).collect();
    let extent = |axis: usize| {
        let low = balls.iter().map(|ball| ball.centre[axis] - ball.radius).fold(f64::INFINITY, f64::min);
        let high = balls.iter().map(|ball| ball.centre[axis] + ball.radius).fold(f64::NEG_INFINITY, f64::max);
        high - low
    };
    let radius = (0..3).map(|axis| 0.5 * extent(axis)).fold(0.0, f64::max);
    (1e-3 * radius).clamp(*LENGTHS_MM.start(), *LENGTHS_MM.end())
}

fn place(attractor: &Attractor, address: &Address, state: StateId, ball: &Ball) -> CellPlace {
    let state = attractor.automaton().state(state).name.clone();
    CellPlace { address: address.to_string(), state, centre_mm: ball.centre, radius_mm: ball.radius }
}

fn located(attractor: &Attractor, address: &Address, budget: &Budget) -> Result<AddressAnswer, AddressError> {
    let found = point_at(attractor, address, budget)?;
    let finite = Address { period: Vec::new(), ..address.clone() };
    let cell = place(attractor, &finite, found.state, &found.cell);
    let at = LocatedPoint { address: found.address.to_string(), point_mm: found.point, bound_mm: found.bound_mm, cell };
    Ok(AddressAnswer { at: Some(at), near: None })
}

fn nearby(attractor: &Attractor, query: &NearQuery, found: &Neighbourhood) -> AddressAnswer {
    let nearest = NearestPoint {
        address: found.nearest.address.to_string(),
        point_mm: found.nearest.point,
        bound_mm: found.nearest.bound_mm,
        distance_mm: found.nearest.distance_mm,
    };
    let cell = |cell: &lacuna_kernel::attractor::Nearby| NearbyCell {
        cell: place(attractor, &cell.address, cell.state, &cell.cell),
        distance_mm: cell.distance_mm,
    };
    let near = NearbyCells {
        point_mm: query.point,
        within_mm: query.within_mm,
        tolerance_mm: query.resolution.mm(),
        nearest,
        cells: found.cells.iter().map(cell).collect(),
        complete: found.complete,
    };
    AddressAnswer { at: None, near: Some(near) }
}

fn problem(error: &AddressError) -> Problem {
    let pointer = match error {
        AddressError::Query { name: "within_mm", .. } => "/within_mm",
        AddressError::Query { .. } => "/near",
        AddressError::Trimmed => "/model/shape",
        AddressError::Resolution(_) | AddressError::Cells { .. } | AddressError::Depth { .. } => "/tolerance_mm",
        AddressError::Stopped(_) => "",
        _ => "/at",
    };
    let finding =
        Finding { pointer: pointer.to_owned(), code: error.code().to_owned(), message: error.to_string(), line: None, column: None };
    let told = Problem::new(error.kind().into(), error.to_string()).code(error.code()).errors(vec![finding]);
    match error.limit() {
        Some(facts) => told.limit(&facts),
        None => told,
    }
}
