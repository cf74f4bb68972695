//! How two certificates of one shape differ, and whether both can be true of it.
//!
//! What is exact (counts, verdicts) must be equal. Two intervals that contain the exact shape's number have a common point, whatever
//! tolerances they come from: a gap between them proves that the shapes are not the same, and nothing else about widths needs to be chosen.
//! Bounds may be anything up to what was asked. Triangles, pitches and the like are means, and are only told. The same version that does the
//! same work does it to the last bit: then everything must be the same.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use serde::Serialize;
use serde_json::Value;

use super::report::{Row, aligned};

/// Members that have one true value: counts and verdicts.
const EXACT: [&str; 16] = [
    "requested_tolerance_mm",
    "components",
    "shells",
    "cavities",
    "genus",
    "euler",
    "boundary_edges",
    "boundary_loops",
    "nonmanifold_edges",
    "nonmanifold_vertices",
    "flipped_pairs",
    "degenerate_triangles",
    "self_intersections",
    "topology_stable",
    "topology_exact",
    "closed_manifold",
];

/// Members that are proven bounds: each may be up to what was asked.
const BOUNDS: [&str; 3] = ["achieved_bound_mm", "inner_bound_mm", "outer_bound_mm"];

/// Units by the endings of members' names, the longest first where one ends with another.
const UNITS: [(&str, &str); 8] = [
    ("_g_cm3", "g/cm^3"),
    ("_mm5", "mm^5"),
    ("_mm3", "mm^3"),
    ("_mm2", "mm^2"),
    ("_mm", "mm"),
    ("_deg", "degrees"),
    ("_bytes", "bytes"),
    ("_g", "g"),
];

/// What a pair of values says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Not both can be true of one shape.
    Apart,
    /// They differ, and both may be true.
    Within,
    /// They differ in what a shape does not decide.
    Told,
    /// They are the same.
    Same,
}

/// A member of two certificates.
#[derive(Clone, Debug, Serialize)]
pub struct Difference {
    /// Its name, with dots between the levels.
    pub field: String,
    /// Its unit, if it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<&'static str>,
    /// The first's value.
    pub first: Value,
    /// The second's.
    pub second: Value,
    /// How far they are apart: numbers by their difference, intervals by the gap between them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub difference: Option<f64>,
    /// How far they may be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub allowed: Option<f64>,
    /// What that says.
    pub verdict: Verdict,
}

/// Compares two certificates member by member; the gravest difference first.
#[must_use]
pub fn differences(first: &Value, second: &Value) -> Vec<Difference> {
    let word = |value: &Value, name: &str| value.get(name).and_then(Value::as_str).unwrap_or_default().to_owned();
    let known = |name: &str| !word(first, name).is_empty() && word(first, name) == word(second, name);
    let asked = first.get("requested_tolerance_mm").and_then(Value::as_f64).unwrap_or(f64::NAN);
    let rules = Rules { same_work: known("kernel_version") && known("input_digest"), asked };
    let mut found = Vec::new();
    walk("", Some(first), Some(second), &rules, &mut found);
    found.sort_by_key(|difference| difference.verdict);
    found
}

/// Compares as the rows of a case: what is only told is left out.
pub(super) fn rows(blessed: &Value, got: &Value) -> Vec<Row> {
    let judged = differences(blessed, got).into_iter().filter(|difference| difference.verdict != Verdict::Told);
    let row = |difference: Difference| {
        let (field, passed) = (format!("blessed {}", difference.field), difference.verdict != Verdict::Apart);
        let row = Row::verdict(&field, &difference.first.to_string(), &difference.second.to_string(), passed);
        Row { difference: difference.difference, allowed: difference.allowed, ..row }
    };
    judged.map(row).collect()
}

/// Differences as text: a table of those that are some, and the number of those that are none.
#[must_use]
pub fn table(differences: &[Difference]) -> String {
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.6e}"));
    let lines = differences.iter().filter(|difference| difference.verdict != Verdict::Same).map(|d| {
        let verdict = match d.verdict {
            Verdict::Apart => "APART",
            Verdict::Within => "within",
            Verdict::Told | Verdict::Same => "",
        };
        let unit = d.unit.unwrap_or("-").to_owned();
        [verdict.to_owned(), d.field.clone(), unit, shown(&d.first), shown(&d.second), number(d.difference), number(d.allowed)]
    });
    let heading = ["", "field", "unit", "first", "second", "diff", "allowed"].map(str::to_owned);
    let mut text = aligned(std::iter::once(heading).chain(lines), 0);
    let count = |verdict| differences.iter().filter(|difference| difference.verdict == verdict).count();
    let _ = writeln!(
        text,
        "{} members are the same, {} differ, {} of them apart",
        count(Verdict::Same),
        differences.len() - count(Verdict::Same),
        count(Verdict::Apart)
    );
    text
}

/// A value in a cell of a table.
fn shown(value: &Value) -> String {
    const LONGEST: usize = 60;
    match value {
        Value::Null => "absent".to_owned(),
        value => {
            let text = value.to_string();
            if text.chars().count() <= LONGEST { text } else { text.chars().take(LONGEST).chain("...".chars()).collect() }
        }
    }
}

struct Rules {
    /// Whether one version did the same work twice.
    same_work: bool,
    /// The tolerance that was asked for.
    asked: f64,
}

fn walk(path: &str, first: Option<&Value>, second: Option<&Value>, rules: &Rules, found: &mut Vec<Difference>) {
    let below = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
    match (first, second) {
        (Some(Value::Object(a)), Some(Value::Object(b))) => {
            let names: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            for name in names {
                walk(&below(name), a.get(name), b.get(name), rules, found);
            }
        }
        (Some(Value::Array(a)), Some(Value::Array(b))) if a.len() == b.len() && interval(first).or(interval(second)).is_none() => {
            for (index, (a, b)) in a.iter().zip(b).enumerate() {
                walk(&below(&index.to_string()), Some(a), Some(b), rules, found);
            }
        }
        _ => found.push(judged(path, first, second, rules)),
    }
}

fn judged(path: &str, first: Option<&Value>, second: Option<&Value>, rules: &Rules) -> Difference {
    // Indices of lists have no names.
    let name = path.rsplit('.').find(|part| part.parse::<usize>().is_err()).unwrap_or(path);
    let number = |value: Option<&Value>| value.and_then(Value::as_f64);
    let intervals = interval(first).zip(interval(second));
    let difference = match (intervals, number(first).zip(number(second))) {
        (Some(([low, high], [other_low, other_high])), _) => Some((other_low - high).max(low - other_high).max(0.0)),
        (None, Some((a, b))) => Some((a - b).abs()),
        (None, None) => None,
    };
    let same = first == second;
    let must_be_there = EXACT.contains(&name) || BOUNDS.contains(&name) || interval(first.or(second)).is_some();
    let (allowed, verdict) = if same {
        (None, Verdict::Same)
    } else if rules.same_work && name != "warnings" && !path.starts_with("output_digests") {
        (difference.map(|_| 0.0), Verdict::Apart)
    } else if first.is_none() || second.is_none() {
        (None, if must_be_there { Verdict::Apart } else { Verdict::Told })
    } else if EXACT.contains(&name) {
        (difference.map(|_| 0.0), Verdict::Apart)
    } else if intervals.is_some() {
        (Some(0.0), if difference == Some(0.0) { Verdict::Within } else { Verdict::Apart })
    } else if BOUNDS.contains(&name) {
        (Some(rules.asked), if number(second).is_some_and(|bound| bound <= rules.asked) { Verdict::Within } else { Verdict::Apart })
    } else if interval(first).is_some() {
        // No interval any more: a number that is not finite, or two in the wrong order.
        (None, Verdict::Apart)
    } else {
        (None, Verdict::Told)
    };
    let value = |value: Option<&Value>| value.cloned().unwrap_or(Value::Null);
    let unit = UNITS.iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, unit)| *unit);
    Difference { field: path.to_owned(), unit, first: value(first), second: value(second), difference, allowed, verdict }
}

/// A finite, ordered `[lo, hi]`.
pub(super) fn interval(value: Option<&Value>) -> Option<[f64; 2]> {
    match value?.as_array()?.as_slice() {
        [low, high] => Some([low.as_f64()?, high.as_f64()?]).filter(|[low, high]| low.is_finite() && high.is_finite() && low <= high),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use serde_json::json;

    fn certificate(version: &str) -> Value {
        json!({ "requested_tolerance_mm": 0.1, "achieved_bound_mm": 0.08, "genus": 3, "triangles": 100, "mesh_volume_mm3": 10.0,
            "volume_mm3": [9.0, 11.0], "bbox_mm": [[[0.0, 0.1], [0.0, 0.0], [0.0, 0.0]], [[1.0, 1.1], [1.0, 1.0], [1.0, 1.0]]],
            "kernel_version": version, "input_digest": "sha256:00", "output_digests": {}, "warnings": [] })
    }

    fn verdict(changes: &[(&str, Value)], version: &str, field: &str) -> Verdict {
        let mut second = certificate(version);
        for (pointer, value) in changes {
            *second.pointer_mut(pointer).unwrap() = value.clone();
        }
        differences(&certificate("1"), &second).into_iter().find(|difference| difference.field == field).unwrap().verdict
    }

    #[test]
    fn equal_certificates_are_the_same() {
        assert!(differences(&certificate("1"), &certificate("1")).iter().all(|difference| difference.verdict == Verdict::Same));
    }

    #[test]
    fn another_version_may_differ_where_both_can_be_true() {
        for (pointer, value, field, expected) in [
            ("/genus", json!(2), "genus", Verdict::Apart),
            ("/triangles", json!(90), "triangles", Verdict::Told),
            ("/mesh_volume_mm3", json!(10.5), "mesh_volume_mm3", Verdict::Told),
            ("/volume_mm3", json!([10.5, 12.0]), "volume_mm3", Verdict::Within),
            ("/volume_mm3", json!([11.5, 12.0]), "volume_mm3", Verdict::Apart),
            ("/volume_mm3", json!([12.0, 10.5]), "volume_mm3", Verdict::Apart),
            ("/volume_mm3", json!(null), "volume_mm3", Verdict::Apart),
            ("/bbox_mm/1/0", json!([1.05, 1.2]), "bbox_mm.1.0", Verdict::Within),
            ("/bbox_mm/1/0", json!([1.15, 1.2]), "bbox_mm.1.0", Verdict::Apart),
            ("/achieved_bound_mm", json!(0.1), "achieved_bound_mm", Verdict::Within),
            ("/achieved_bound_mm", json!(0.2), "achieved_bound_mm", Verdict::Apart),
        ] {
            assert_eq!(verdict(&[(pointer, value.clone())], "2", field), expected, "{pointer} {value}");
        }
    }

    #[test]
    fn the_same_version_does_the_same_work_to_the_last_bit() {
        assert_eq!(verdict(&[("/triangles", json!(101))], "1", "triangles"), Verdict::Apart);
        assert_eq!(verdict(&[("/triangles", json!(101)), ("/input_digest", json!("sha256:11"))], "1", "triangles"), Verdict::Told);
    }

    #[test]
    fn members_have_units() {
        let unit = |name: &str| differences(&json!({ name: 1 }), &json!({ name: 2 }))[0].unit;
        assert_eq!(
            (unit("volume_mm3"), unit("mass_g"), unit("density_g_cm3"), unit("genus")),
            (Some("mm^3"), Some("g"), Some("g/cm^3"), None)
        );
    }
}
