//! Cases with unknown entries: solves them and compares the solutions.

use std::collections::BTreeMap;

use serde_json::Value;

use super::manifest::{ExpectedEntry, Manifest, Refused};
use super::report::Row;
use super::{Performer, Solution, compare, compare_refusal, told};
use crate::documents;
use crate::problem::Problem;

/// Largest violation of a constraint in a filled model: rounding alone.
const RESIDUAL: f64 = 1e-9;

/// How far an entry may be from its exact value: rounding alone.
const ENTRY: f64 = 1e-12;

/// Solves the case's model for the chosen values and compares.
pub(super) fn rows(document: &[u8], manifest: &Manifest, performer: &dyn Performer) -> Vec<Row> {
    let solved = documents::read_model(document).and_then(|model| performer.solution(&model, &manifest.values));
    match (&manifest.refused, solved) {
        (Some(refused), Ok(_)) => vec![Row::failure("refused", &refused.code, "a solution")],
        (Some(refused), Err(problem)) => refusal_rows(refused, problem),
        (None, Err(problem)) => vec![Row::failure("result", "a solution", &told(&problem))],
        (None, Ok(solved)) => solution_rows(manifest, &solved, performer),
    }
}

fn refusal_rows(refused: &Refused, problem: Problem) -> Vec<Row> {
    let found: Vec<&str> = problem.errors.iter().map(|finding| finding.pointer.as_str()).collect();
    let places = refused.pointers.as_ref().map(|pointers| {
        let same = found == pointers.iter().map(String::as_str).collect::<Vec<_>>();
        Row::verdict("refused.pointers", &pointers.join(", "), &found.join(", "), same)
    });
    places.into_iter().chain([compare_refusal(refused, Err(problem))]).collect()
}

fn solution_rows(manifest: &Manifest, solved: &Solution, performer: &dyn Performer) -> Vec<Row> {
    let space = &solved.space;
    let mut rows = compare::stated(manifest, space);
    for (pointer, expected) in &manifest.entry {
        let found = space["entries"].as_array().and_then(|entries| entries.iter().find(|entry| entry["pointer"] == pointer.as_str()));
        rows.extend(entry_rows(pointer, expected, found));
    }
    let (degrees, parameters) = (space["degrees_of_freedom"].as_u64(), space["parameters"].as_array().map(|list| list.len() as u64));
    let told_degrees = format!("{degrees:?} with {parameters:?} parameters");
    rows.push(Row::verdict("degrees_of_freedom", "the number of parameters", &told_degrees, degrees.is_some() && degrees == parameters));
    rows.push(Row::measured("residual", "0", &space["residual"].to_string(), space["residual"].as_f64(), RESIDUAL));
    rows.push(filled_row(&solved.model, performer));
    rows
}

fn entry_rows(pointer: &str, expected: &ExpectedEntry, found: Option<&Value>) -> Vec<Row> {
    let Some(found) = found else { return vec![Row::failure(pointer, "an entry that was unknown or a parameter", "absent")] };
    let difference = found["value"].as_f64().map(|value| (value - expected.value).abs());
    let mut rows = vec![Row::measured(pointer, &expected.value.to_string(), &found["value"].to_string(), difference, ENTRY)];
    let fraction = |number: &Value| number["exact"].as_str().unwrap_or("absent").to_owned();
    if let Some(constant) = &expected.constant {
        let got = fraction(&found["constant"]);
        rows.push(Row::verdict(&format!("{pointer} constant"), constant, &got, *constant == got));
    }
    if let Some(coefficients) = &expected.coefficients {
        let got =
            found["coefficients"].as_object().map(|list| list.iter().map(|(name, number)| (name.clone(), fraction(number))).collect());
        let same = got.as_ref() == Some(coefficients);
        rows.push(Row::verdict(&format!("{pointer} coefficients"), &format!("{coefficients:?}"), &format!("{got:?}"), same));
    }
    rows
}

/// The filled model is a document again, and its constraints hold without anything left to solve.
fn filled_row(text: &str, performer: &dyn Performer) -> Row {
    let (field, expected) = ("model", "a document whose constraints hold");
    let again = documents::read_model(text.as_bytes()).and_then(|model| performer.solution(&model, &BTreeMap::new()));
    match again {
        Ok(solved) => Row::measured(field, expected, "residual", solved.space["residual"].as_f64(), RESIDUAL),
        Err(problem) => Row::failure(field, expected, &told(&problem)),
    }
}
