//! Compares a certificate with a case. What is absent, `"not_checked"` or not finite never passes.

use serde_json::Value;

use super::difference;
use super::manifest::{BoundingBox, CaseKind, ExpectedPoint, Manifest, Scalar};
use super::report::Row;

/// All comparisons of a case, those that every case implies included.
pub(super) fn rows(manifest: &Manifest, got: &Value) -> Vec<Row> {
    let mut rows = stated(manifest, got);
    // A job states its own, which the certificate repeats.
    let requested = || got.get("requested_tolerance_mm").and_then(Value::as_f64);
    let tolerance = manifest.tolerance_mm.or_else(requested).unwrap_or(f64::NAN);
    if let Some(bounding_box) = &manifest.bounding_box {
        rows.extend(box_rows(bounding_box, tolerance, got));
    }
    rows.extend(implied(manifest.kind, tolerance, got));
    rows
}

/// The comparisons of `[exact]` and `[scalar.*]`.
pub(super) fn stated(manifest: &Manifest, got: &Value) -> Vec<Row> {
    let exact = manifest.exact.iter().flat_map(|exact| &exact.members);
    let exact = exact.map(|(name, expected)| exact_row(name, expected, member(got, name)));
    exact.chain(manifest.scalar.iter().map(|(name, scalar)| scalar_row(name, scalar, member(got, name)))).collect()
}

/// A member by its name, or one of a member by both with a dot between.
fn member<'v>(got: &'v Value, name: &str) -> Option<&'v Value> {
    name.split('.').try_fold(got, |value, part| value.get(part))
}

fn exact_row(name: &str, expected: &toml::Value, got: Option<&Value>) -> Row {
    let same = match (expected, got) {
        (toml::Value::Integer(expected), Some(Value::Number(got))) => got.as_i64() == Some(*expected),
        (toml::Value::Float(expected), Some(Value::Number(got))) => got.as_f64() == Some(*expected),
        (toml::Value::String(expected), Some(Value::String(got))) => got == expected && got != "not_checked",
        (toml::Value::Boolean(expected), Some(Value::Bool(got))) => got == expected,
        _ => false,
    };
    Row::verdict(name, &expected.to_string(), &shown(got), same)
}

fn scalar_row(name: &str, scalar: &Scalar, got: Option<&Value>) -> Row {
    let range = difference::interval(got);
    let number = got.and_then(Value::as_f64).filter(|number| number.is_finite());
    match (scalar.value, scalar.lower.zip(scalar.upper)) {
        (Some(value), _) => {
            let allowed = scalar.absolute + scalar.relative * value.abs();
            let difference = match (number, range) {
                (Some(number), _) => Some((number - value).abs()),
                // How far the value lies outside of the interval.
                (None, Some([low, high])) => Some((low - value).max(value - high).max(0.0)),
                (None, None) => None,
            };
            Row::measured(name, &value.to_string(), &shown(got), difference, allowed)
        }
        (None, Some((lower, upper))) => {
            let ends = number.map(|number| [number, number]).or(range);
            let difference = ends.map(|[low, high]| (lower - low).max(high - upper).max(0.0));
            Row::measured(name, &format!("[{lower}, {upper}]"), &shown(got), difference, 0.0)
        }
        (None, None) => Row::failure(name, "value, or lower and upper", &shown(got)),
    }
}

/// The comparison of a point at an address: its distance from the expected one.
pub(super) fn point_row(name: &str, expected: &ExpectedPoint, got: &[f64; 3]) -> Row {
    let length = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let off = length(std::array::from_fn(|axis| got[axis] - expected.value[axis]));
    Row::measured(name, &format!("{:?}", expected.value), &format!("{got:?}"), Some(off), expected.relative * length(expected.value))
}

fn box_rows(expected: &BoundingBox, tolerance: f64, got: &Value) -> Vec<Row> {
    let corners = [("lower", &expected.lower), ("upper", &expected.upper)];
    let mut rows = Vec::with_capacity(6);
    for (corner, (word, exact)) in corners.into_iter().enumerate() {
        for (axis, &exact) in exact.iter().enumerate() {
            let name = format!("bbox_mm.{word}.{}", ["x", "y", "z"][axis]);
            let found = got.pointer(&format!("/bbox_mm/{corner}/{axis}"));
            let ends = difference::interval(found);
            let outside = ends.map(|[low, high]| (low - exact).max(exact - high).max(0.0));
            let width = ends.map(|[low, high]| (exact - low).abs().max((high - exact).abs()));
            let contains = Row::measured(&name, &exact.to_string(), &shown(found), outside, expected.absolute);
            let allowed = tolerance + expected.absolute;
            // Of the two demands on an interval the one that fails is told.
            rows.push(if contains.passed { Row::measured(&name, &exact.to_string(), &shown(found), width, allowed) } else { contains });
        }
    }
    rows
}

fn implied(kind: CaseKind, tolerance: f64, got: &Value) -> Vec<Row> {
    let number = |name: &str| got.get(name).and_then(Value::as_f64).filter(|number| number.is_finite());
    let mut rows = vec![
        Row::verdict(
            "requested_tolerance_mm",
            &tolerance.to_string(),
            &shown(got.get("requested_tolerance_mm")),
            number("requested_tolerance_mm") == Some(tolerance),
        ),
        at_most("achieved_bound_mm", tolerance, got),
    ];
    for name in ["volume_mm3", "area_mm2"] {
        if let Some(found) = got.get(name) {
            rows.push(Row::verdict(name, "an ordered, finite interval", &shown(Some(found)), difference::interval(Some(found)).is_some()));
        }
    }
    if kind == CaseKind::Solidify {
        rows.extend(implied_of_solids(tolerance, got));
    }
    rows
}

fn implied_of_solids(tolerance: f64, got: &Value) -> Vec<Row> {
    let count = |name: &str| got.get(name).and_then(Value::as_i64);
    let mut rows: Vec<Row> = ["boundary_edges", "nonmanifold_edges", "nonmanifold_vertices", "flipped_pairs", "degenerate_triangles"]
        .into_iter()
        .map(|name| Row::verdict(name, "0", &shown(got.get(name)), count(name) == Some(0)))
        .collect();
    let mut law = |name: &str, left: Option<i64>, right: Option<i64>| {
        let told = format!("{} = {}", left.map_or("?".into(), |n| n.to_string()), right.map_or("?".into(), |n| n.to_string()));
        rows.push(Row::verdict(name, "equality", &told, left.is_some() && left == right));
    };
    let (vertices, edges, triangles) = (count("vertices"), count("edges"), count("triangles"));
    let (shells, genus, euler) = (count("shells"), count("genus"), count("euler"));
    let characteristic = vertices.zip(edges).zip(triangles).map(|((v, e), t)| v - e + t);
    law("vertices - edges + triangles = euler", characteristic, euler);
    law("euler = 2 (shells - genus)", euler, shells.zip(genus).map(|(s, g)| 2 * (s - g)));
    law("2 edges = 3 triangles", edges.map(|e| 2 * e), triangles.map(|t| 3 * t));
    law("shells = components + cavities", shells, count("components").zip(count("cavities")).map(|(a, b)| a + b));
    rows.push(at_most("inner_bound_mm", tolerance, got));
    rows.push(at_most("outer_bound_mm", tolerance, got));
    rows.push(Row::verdict("triangles", "at least 1", &shown(got.get("triangles")), triangles.is_some_and(|count| count >= 1)));
    let volume = got.get("volume_mm3");
    let positive = difference::interval(volume).is_some_and(|[low, _]| low > 0.0);
    rows.push(Row::verdict("volume_mm3", "an interval of positive numbers", &shown(volume), positive));
    let enclosed = got.get("mesh_volume_mm3");
    rows.push(Row::verdict("mesh_volume_mm3", "a number", &shown(enclosed), enclosed.and_then(Value::as_f64).is_some_and(f64::is_finite)));
    rows
}

fn at_most(name: &str, most: f64, got: &Value) -> Row {
    let found = got.get(name);
    let number = found.and_then(Value::as_f64);
    Row::verdict(name, &format!("in [0, {most}]"), &shown(found), number.is_some_and(|number| (0.0..=most).contains(&number)))
}

fn shown(value: Option<&Value>) -> String {
    value.map_or_else(|| "absent".to_owned(), ToString::to_string)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use serde_json::json;

    fn manifest(rest: &str) -> Manifest {
        Manifest::read(&format!("about = \"x\"\nkind = \"measure\"\ntolerance_mm = 0.1\n{rest}"), false).unwrap()
    }

    fn failed(rest: &str, got: Value) -> Vec<String> {
        let mut all = json!({ "requested_tolerance_mm": 0.1, "achieved_bound_mm": 0.05 });
        all.as_object_mut().unwrap().extend(got.as_object().unwrap().clone());
        rows(&manifest(rest), &all).into_iter().filter(|row| !row.passed).map(|row| row.field).collect()
    }

    #[test]
    fn exact_members_are_equal_or_fail() {
        let case = "[exact]\ngenus = 3\nself_intersections = \"none\"\ntopology_stable = true\nsource = \"s\"";
        assert!(failed(case, json!({ "genus": 3, "self_intersections": "none", "topology_stable": true })).is_empty());
        assert_eq!(failed(case, json!({ "genus": 2, "self_intersections": "not_checked" })).len(), 3);
    }

    #[test]
    fn values_lie_near_or_inside() {
        let case = "[scalar.volume_mm3]\nvalue = 10\nabsolute = 0.5\nsource = \"s\"\nreason = \"r\"";
        assert!(failed(case, json!({ "volume_mm3": [10.4, 11.0] })).is_empty());
        let mesh = case.replace("volume", "mesh_volume");
        assert!(failed(&mesh, json!({ "mesh_volume_mm3": 10.5 })).is_empty());
        assert!(!failed(&mesh, json!({ "mesh_volume_mm3": 10.6 })).is_empty());
        for bad in [json!([10.6, 11.0]), json!([11.0, 9.0]), json!(null), json!("not_checked")] {
            assert!(!failed(case, json!({ "volume_mm3": bad })).is_empty(), "{bad}");
        }
        let case = "[scalar.area_mm2]\nlower = 1\nupper = 2\nsource = \"s\"\nreason = \"r\"";
        assert!(failed(case, json!({ "area_mm2": [1.0, 2.0] })).is_empty());
        assert!(!failed(case, json!({ "area_mm2": [0.9, 2.0] })).is_empty());
    }

    #[test]
    fn boxes_contain_and_are_tight() {
        let case = "[box]\nlower = [0, 0, 0]\nupper = [1, 1, 1]\nsource = \"s\"\nreason = \"r\"";
        let bounds = |low: f64| json!({ "bbox_mm": [[[low, 0.01], [0, 0], [0, 0]], [[1, 1], [1, 1], [1, 1]]] });
        assert!(failed(case, bounds(-0.1)).is_empty());
        assert_eq!(failed(case, bounds(-0.2)), ["bbox_mm.lower.x"]);
        assert_eq!(failed(case, bounds(0.001)), ["bbox_mm.lower.x"]);
    }

    #[test]
    fn the_bound_is_below_the_request() {
        assert_eq!(failed("[exact]\nsource = \"s\"", json!({ "achieved_bound_mm": 0.2 })), ["achieved_bound_mm"]);
    }
}
