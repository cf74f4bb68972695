//! Reads questions about addresses: where an address leads, or which addresses lead near a point.

use lacuna_kernel::attractor::Address;

use super::grammar::ADDRESS_QUESTION;
use super::job::{InputDocument, one_of, source};
use super::model::version;
use super::node::Place;
use super::walk::{Members, Walker};
use crate::diagnostic::code;

/// A question about the addresses of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct AddressQuestion {
    /// The model.
    pub input: InputDocument,
    /// What is asked.
    pub sought: Sought,
}

/// What is asked of the address function.
#[derive(Clone, Debug, PartialEq)]
pub enum Sought {
    /// Where an address leads.
    At(Address),
    /// Which addresses lead near a point.
    Near {
        /// The point, in mm.
        point_mm: [f64; 3],
        /// How far from it, in mm; as far as the closest point of the shape when absent.
        within_mm: Option<f64>,
        /// Radius of the cells, in mm; a thousandth of the shape's when absent.
        tolerance_mm: Option<f64>,
        /// Cells to list at most.
        most: usize,
    },
}

/// Cells that are listed when a question does not say.
pub const CELLS_LISTED: usize = 100;
/// Cells that are listed at most.
pub const MOST_CELLS_LISTED: usize = 10_000;

/// A question.
pub(super) fn question(walker: &mut Walker<'_>, place: Place<'_>) -> Option<AddressQuestion> {
    let members = walker.object(place, &ADDRESS_QUESTION)?;
    if let Some(place) = members.get("lacuna") {
        version(walker, place);
    }
    let input = one_of(walker, &members, &["model", "model_ref"], "a question").and_then(|()| source(walker, &members));
    let sought = one_of(walker, &members, &["at", "near"], "a question").and_then(|()| sought(walker, &members));
    Some(AddressQuestion { input: input?, sought: sought? })
}

fn sought(walker: &mut Walker<'_>, members: &Members<'_>) -> Option<Sought> {
    if let Some(place) = members.get("at") {
        let mut alone = true;
        for name in ["within_mm", "tolerance_mm", "most"] {
            if let Some(place) = members.get(name) {
                alone = false;
                walker.fault(&place, code::CONFLICTING_MEMBERS, || format!("\"{name}\" belongs to \"near\"; remove it"));
            }
        }
        let text = walker.text(place, "an address")?;
        return match text.parse() {
            Ok(address) => alone.then_some(Sought::At(address)),
            Err(error) => {
                walker.fault(&place, code::BAD_ADDRESS, || error.to_string());
                None
            }
        };
    }
    let point = members.get("near").and_then(|place| walker.numbers::<3>(place, "a point: three numbers, in mm"));
    let within = members.get("within_mm").map(|place| distance(walker, place));
    let tolerance = members.get("tolerance_mm").map(|place| walker.positive(place, "a tolerance in mm"));
    let most = members.get("most").map_or(Some(CELLS_LISTED), |place| count(walker, place));
    // why: the outer option says whether the member is there, the inner whether it is legal
    let within_mm = within.map_or(Some(None), |value| value.map(Some))?;
    let tolerance_mm = tolerance.map_or(Some(None), |value| value.map(Some))?;
    Some(Sought::Near { point_mm: point?, within_mm, tolerance_mm, most: most? })
}

fn distance(walker: &mut Walker<'_>, place: Place<'_>) -> Option<f64> {
    let value = walker.number(place)?;
    if value < 0.0 {
        walker.fault(&place, code::NOT_POSITIVE, || format!("is {value}; expected a distance in mm, zero or above"));
        return None;
    }
    Some(value)
}

fn count(walker: &mut Walker<'_>, place: Place<'_>) -> Option<usize> {
    let count = walker.integer(place, "a number of cells")?;
    match usize::try_from(count) {
        Ok(count) if (1..=MOST_CELLS_LISTED).contains(&count) => Some(count),
        _ => {
            walker.fault(&place, code::INDEX_OUT_OF_RANGE, || format!("is {count}; expected 1 to {MOST_CELLS_LISTED} cells"));
            None
        }
    }
}
