//! Reads requests to solve a model: the model, and the values that are chosen for its free parameters.

use std::collections::BTreeMap;

use super::bcifs::parameters;
use super::grammar::SOLVE;
use super::job::{InputDocument, one_of, source};
use super::model::version;
use super::node::Place;
use super::walk::Walker;

/// A request to solve a model, as its document states it.
#[derive(Clone, Debug, PartialEq)]
pub struct SolveDocument {
    /// The model, or where it is stored.
    pub input: InputDocument,
    /// Values by the name of the parameter.
    pub values: BTreeMap<String, f64>,
}

/// A request to solve a model.
pub(super) fn solve(walker: &mut Walker<'_>, place: Place<'_>) -> Option<SolveDocument> {
    let members = walker.object(place, &SOLVE)?;
    if let Some(place) = members.get("lacuna") {
        version(walker, place);
    }
    let source = one_of(walker, &members, &["model", "model_ref"], "a solve request").and_then(|()| source(walker, &members));
    let values = members.get("values").map_or(Some(Vec::new()), |place| parameters(walker, place));
    Some(SolveDocument { input: source?, values: values?.into_iter().collect() })
}
