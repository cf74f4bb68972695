//! What single documents mean, and what hostile ones cost.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::{DMat3, DVec3, DVec4};
use lacuna_fabrication::job::JobKind;
use lacuna_kernel::budget::Limits;
use lacuna_kernel::model::{Entry, Interior, Model, Relation, Shape, Side};

use crate::diagnostic::{Diagnostic, code};
use crate::document::{
    DocumentLimits, MOST_JOBS, ModelSource, job_schema, model_schema, read_batch, read_job, read_model, schemas, write_job, write_model,
};

fn model(text: &str) -> Model {
    read_model(text.as_bytes(), &DocumentLimits::default()).unwrap_or_else(|faults| panic!("{faults:#?}"))
}

fn faults(text: &str) -> Vec<Diagnostic> {
    read_model(text.as_bytes(), &DocumentLimits::default()).unwrap_err()
}

fn shape(text: &str) -> Shape {
    model(&format!(r#"{{"lacuna": 1, "shape": {text}}}"#)).shape
}

#[test]
fn lengths_are_converted_and_nothing_else() {
    let text = r#"{"lacuna": 1, "units": "cm", "shape": {"family": "group", "parts": [
        {"shape": {"family": "ifs", "maps": [{"scale": 0.5, "translation": [1, 2, 3]}]}},
        {"shape": {"family": "bezier_curve", "control_points": [[1, 0, 0, 2], [0, 1, 0]]}}]}}"#;
    let Shape::Group(group) = model(text).shape else { panic!("a group") };
    let Shape::Ifs(ifs) = &group.parts[0].shape else { panic!("an ifs") };
    assert_eq!(ifs.maps[0].translation, DVec3::new(10.0, 20.0, 30.0));
    assert_eq!(ifs.maps[0].linear, DMat3::from_diagonal(DVec3::splat(0.5)));
    let Shape::BezierCurve(curve) = &group.parts[1].shape else { panic!("a curve") };
    assert_eq!(curve.control_points[0], DVec3::new(10.0, 0.0, 0.0));
    assert_eq!(curve.weights, Some(vec![2.0, 1.0]));
}

#[test]
fn maps_are_scaled_then_turned_then_moved() {
    let Shape::Ifs(ifs) = shape(
        r#"{"family": "ifs", "maps": [
            {"scale": [0.5, 0.25, 0.125], "axis": [0, 0, 7], "angle_deg": 90, "translation": [1, 0, 0]},
            {"angle_deg": 45, "scale": 0.5},
            {"linear": [[1, 2, 3], [4, 5, 6], [7, 8, 9]]},
            {}]}"#,
    ) else {
        panic!("an ifs")
    };
    assert_eq!(ifs.maps[0].linear * DVec3::X, DVec3::new(0.0, 0.5, 0.0));
    assert_eq!(ifs.maps[0].linear * DVec3::Y, DVec3::new(-0.25, 0.0, 0.0));
    assert_eq!(ifs.maps[0].linear * DVec3::Z, DVec3::new(0.0, 0.0, 0.125));
    assert_eq!(ifs.maps[1].linear * DVec3::X, DVec3::new(0.5 * FRAC_1_SQRT_2, 0.5 * FRAC_1_SQRT_2, 0.0));
    assert_eq!(ifs.maps[2].linear.row(1), DVec3::new(4.0, 5.0, 6.0));
    assert_eq!(ifs.maps[3].linear, DMat3::IDENTITY);
}

#[test]
fn huge_and_tiny_axes_are_directions() {
    for axis in ["[1e308, 1e308, 0]", "[5e-324, 5e-324, 0]"] {
        let Shape::Ifs(ifs) = shape(&format!(r#"{{"family": "ifs", "maps": [{{"axis": {axis}, "angle_deg": 180}}]}}"#)) else {
            panic!("an ifs")
        };
        assert!((ifs.maps[0].linear * DVec3::X - DVec3::Y).length() < 1e-15);
    }
}

#[test]
fn graphs_are_lists_or_boolean_matrices() {
    let read = |graph: &str| match shape(&format!(r#"{{"family": "ifs", "maps": [{{"scale": 0.5}}, {{"scale": 0.5}}], "graph": {graph}}}"#))
    {
        Shape::Ifs(ifs) => ifs.graph.unwrap(),
        _ => panic!("an ifs"),
    };
    assert_eq!(read("[[0, 1], [0]]"), vec![vec![0, 1], vec![0]]);
    assert_eq!(read("[[true, true], [true, false]]"), vec![vec![0, 1], vec![0]]);
    assert_eq!(read("[[1], []]"), vec![vec![1], vec![]]);
}

#[test]
fn parts_are_flat_or_wrapped() {
    let mesh = r#""family": "mesh", "vertices": [[0, 0, 0]], "faces": [[0]], "interior": "surface""#;
    let flat = shape(&format!(r#"{{"family": "group", "parts": [{{{mesh}, "name": "a", "transform": {{"translation": [1, 0, 0]}}}}]}}"#));
    let wrapped = shape(&format!(
        r#"{{"family": "group", "parts": [{{"name": "a", "shape": {{{mesh}}}, "transform": {{"translation": [1, 0, 0]}}}}]}}"#
    ));
    assert_eq!(flat, wrapped);
    let Shape::Group(group) = flat else { panic!("a group") };
    assert!(matches!(&group.parts[0].shape, Shape::Mesh(mesh) if mesh.interior == Interior::Surface));
}

#[test]
fn entries_are_numbers_unknowns_and_parameters_in_order() {
    let Shape::Bcifs(bcifs) = shape(
        r#"{"family": "bcifs", "parameters": {"z": 1, "a": 0.25},
            "states": [{"name": "é", "cell": "edge", "dimension": 2, "transitions": [{"to": "\u00e9", "operator": [[1, "a"], [0, null]]}]}],
            "cells": [{"state": "é", "control_points": [[0, 0, 0], [1, 0, 0, 2]]}, {"state": "é", "control_points": [[0, 0, 0], [1, 0, 0]]}],
            "glue": []}"#,
    ) else {
        panic!("a bcifs")
    };
    assert_eq!(bcifs.parameters, [("z".to_owned(), 1.0), ("a".to_owned(), 0.25)]);
    let rows = &bcifs.states[0].transitions[0].operator.rows;
    assert_eq!(rows[0], [Entry::Number(1.0), Entry::Parameter("a".into())]);
    assert_eq!(rows[1], [Entry::Number(0.0), Entry::Unknown]);
    assert_eq!(bcifs.cells[0].control_points[1].unwrap().w, 2.0);
}

/// Two arcs that meet in a loop: an end with two control points, so that orders matter.
fn arcs(rest: &str) -> String {
    format!(
        r#"{{"lacuna": 1, "units": "cm", "shape": {{"family": "bcifs",
            "states": [
                {{"name": "arc", "cell": "edge", "dimension": 3, "boundaries": [
                    {{"state": "end", "incidence": [[1, 0], [0, 1], [0, 0]]}}, {{"state": "end", "incidence": [[0, 0], [1, 0], [0, 1]]}}],
                  "transitions": [{{"to": "arc", "operator": [[null, 0, 0], [0, 1, 0], [0, 0, 1]]}},
                                  {{"to": "end", "operator": [[1, 0], [0, 1], [0, 0]]}}]}},
                {{"name": "end", "cell": "vertex", "dimension": 2, "transitions": [{{"to": "end", "operator": [[1, 0], [0, 1]]}}]}}],
            "cells": [{{"state": "arc", "control_points": [[0, 0, 0], null, [1, 0, 0, 2]]}}] {rest}}}}}"#
    )
}

#[test]
fn permutations_relations_and_points_to_be_placed() {
    let text = arcs(
        r#", "adjacencies": [{"state": "arc", "between": [[0, 1], [0, 0]], "permutation": [1, 0]}],
            "glue": [{"between": [[0, 0], [0, 1]], "reversed": false, "permutation": [1, 0]}, [[0, 0], [0, 1]]],
            "relations": [{"state": "arc", "equal": [{"path": [0, 0, 1], "boundary": []}, {"boundary": [1]}]}, {"state": "end", "equal": [{}, {"path": [0]}]}]"#,
    );
    let Shape::Bcifs(bcifs) = model(&text).shape else { panic!("a bcifs") };
    assert_eq!(bcifs.adjacencies[0].permutation, Some(vec![1, 0]));
    assert_eq!(bcifs.glue[0].permutation, Some(vec![1, 0]));
    assert_eq!(bcifs.glue[1].permutation, None);
    let side = |path: &[usize], boundary: &[usize]| Side { path: path.to_vec(), boundary: boundary.to_vec() };
    assert_eq!(bcifs.relations[0], Relation { state: "arc".into(), equal: [side(&[0, 0, 1], &[]), side(&[], &[1])] });
    assert_eq!(bcifs.relations[1], Relation { state: "end".into(), equal: [side(&[], &[]), side(&[0], &[])] });
    let points = &bcifs.cells[0].control_points;
    assert_eq!(points[..2], [Some(DVec4::new(0.0, 0.0, 0.0, 1.0)), None]);
    assert_eq!(points[2], Some(DVec4::new(10.0, 0.0, 0.0, 2.0)));
}

#[test]
fn constraints_that_point_nowhere_say_so() {
    let told = |rest: &str| -> Vec<(String, &str)> {
        faults(&arcs(rest)).into_iter().map(|fault| (fault.pointer.replacen("/shape", "", 1), fault.code)).collect()
    };
    let adjacency = |rest: &str| told(&format!(r#", "adjacencies": [{{"state": "arc", "between": [[0, 1], [0, 0]], {rest}}}]"#));
    let place = |rest: &str| format!("/adjacencies/0/permutation{rest}");
    assert_eq!(adjacency(r#""permutation": [0, 0]"#), [(place("/1"), code::REPEATED_ELEMENT)]);
    assert_eq!(adjacency(r#""permutation": [0, 2]"#), [(place("/1"), code::INDEX_OUT_OF_RANGE)]);
    assert_eq!(adjacency(r#""permutation": [0, -1]"#), [(place("/1"), code::NOT_AN_INDEX)]);
    assert_eq!(adjacency(r#""permutation": [0, 1, 2]"#), [(place(""), code::WRONG_LENGTH)]);
    assert_eq!(adjacency(r#""permutation": []"#), [(place(""), code::WRONG_LENGTH)]);
    assert_eq!(adjacency(r#""permutation": null"#), [(place(""), code::WRONG_TYPE)]);
    assert_eq!(adjacency(r#""permutation": [1, 0], "reversed": true"#), [(place(""), code::CONFLICTING_MEMBERS)]);
    let relation = |sides: &str| told(&format!(r#", "relations": [{{"state": "arc", "equal": {sides}}}]"#));
    let place = |rest: &str| format!("/relations/0/equal{rest}");
    // child 1 of an arc is an end, which has one child and no boundary
    assert_eq!(relation(r#"[{"path": [0, 1, 1]}, {"path": [2]}]"#).len(), 2);
    assert_eq!(relation(r#"[{"path": [0, 1, 1]}, {}]"#), [(place("/0/path/2"), code::INDEX_OUT_OF_RANGE)]);
    assert_eq!(relation(r#"[{"path": [1], "boundary": [0]}, {}]"#), [(place("/0/boundary/0"), code::INDEX_OUT_OF_RANGE)]);
    assert_eq!(relation(r#"[{"path": null}, {}]"#), [(place("/0/path"), code::WRONG_TYPE)]);
    assert_eq!(relation("[{}]"), [(place(""), code::WRONG_LENGTH)]);
    assert_eq!(relation("null"), [(place(""), code::WRONG_TYPE)]);
    let long = format!(r#"[{{"path": [{}0]}}, {{}}]"#, "0,".repeat(100_000));
    assert_eq!(relation(&long), [(place("/0/path"), code::WRONG_LENGTH)]);
}

#[test]
fn extreme_finite_numbers_are_legal() {
    let text = r#"{"family": "mesh", "vertices": [[1e308, -1.7976931348623157e308, 5e-324]], "faces": [[0]]}"#;
    let Shape::Mesh(mesh) = shape(text) else { panic!("a mesh") };
    assert_eq!(mesh.vertices[0], DVec3::new(1e308, -f64::MAX, 5e-324));
}

#[test]
fn messages_name_the_value_and_the_way_out() {
    let found = faults("{\n  \"lacuna\": 1,\n  \"shape\": {\"family\": \"ifs\", \"mapps\": [{\"scale\": \"0.5\"}]}\n}");
    assert_eq!(found.len(), 2);
    assert_eq!(found[0].message, "an ifs needs the member \"maps\": The maps T_i.");
    assert_eq!(found[1].message, "\"mapps\" is not a member of an ifs; did you mean \"maps\"?");
    assert_eq!((found[1].line, found[1].column), (Some(3), Some(39)));
}

#[test]
fn a_document_above_the_size_limit_is_not_read() {
    let body = vec![b'['; 100 << 20];
    let found = read_model(&body, &DocumentLimits::default()).unwrap_err();
    assert_eq!((found.len(), found[0].code), (1, code::TOO_LARGE));
}

#[test]
fn a_nesting_limit_cannot_be_raised_past_the_stack() {
    let limits = DocumentLimits { nesting: usize::MAX, bytes: usize::MAX, ..DocumentLimits::default() };
    let body = "[".repeat(1 << 20);
    let found = read_model(body.as_bytes(), &limits).unwrap_err();
    assert_eq!(found[0].code, code::TOO_DEEP);
}

#[test]
fn floods_of_faults_are_refused_in_bounded_space() {
    let members: Vec<String> = (0..200_000).map(|index| format!(r#""m{index}": 0"#)).collect();
    let repeated = vec![r#""a": 0"#; 200_000].join(",");
    let long = format!(r#"{{"{}": [{}]}}"#, "x".repeat(1 << 20), "1e999,".repeat(1000) + "1");
    let states: Vec<String> = (0..50_000).map(|index| format!(r#"{{"name": "s{index}", "transitions": [{{"to": "none"}}]}}"#)).collect();
    let hostile = [
        format!("{{{}}}", members.join(",")),
        format!("{{{repeated}}}"),
        long,
        format!(r#"{{"lacuna": 1, "shape": {{"family": "bcifs", "states": [{}]}}}}"#, states.join(",")),
        format!(r#"{{"lacuna": 1, "shape": {{"family": "mesh", "vertices": [{}]}}}}"#, vec!["{}"; 1_000_000].join(",")),
    ];
    for text in hostile {
        let found = faults(&text);
        assert!(!found.is_empty() && found.len() <= 101);
        let size: usize = found.iter().map(|fault| fault.pointer.len() + fault.message.len()).sum();
        assert!(size < 200_000, "{size} bytes of diagnostics");
    }
}

#[test]
fn counts_are_limited() {
    let limits = DocumentLimits { states: 1, transitions: 2, values: 200, ..DocumentLimits::default() };
    let codes = |text: &str| -> Vec<&str> {
        let found = read_model(format!(r#"{{"lacuna": 1, "shape": {text}}}"#).as_bytes(), &limits).unwrap_err();
        found.iter().map(|fault| fault.code).collect()
    };
    assert_eq!(codes(r#"{"family": "ifs", "maps": [{}, {}, {}]}"#), [code::TOO_MANY_TRANSITIONS]);
    assert_eq!(codes(r#"{"family": "ifs", "maps": [{}], "graph": [[0]], "x": 0}"#), [code::UNKNOWN_MEMBER]);
    assert_eq!(codes(r#"{"family": "ifs", "maps": [{}, {}], "graph": [[0], [1]]}"#), [code::TOO_MANY_TRANSITIONS]);
    let state = |name: &str| format!(r#"{{"name": "{name}", "cell": "vertex", "dimension": 1, "transitions": []}}"#);
    let cells = r#"[{"state": "a", "control_points": [[0, 0, 0]]}]"#;
    assert_eq!(
        codes(&format!(r#"{{"family": "bcifs", "states": [{}, {}], "cells": {cells}}}"#, state("a"), state("b"))),
        [code::TOO_MANY_STATES]
    );
    assert_eq!(codes(&format!("[{}]", vec!["{}"; 300].join(","))), [code::TOO_MANY_VALUES]);
}

const JOB: &str = r#"{"lacuna": 1, "kind": "solidify", "model_ref": "m-1", "params": {"tolerance_mm": 0.05, "radius_mm": 0.4},
    "outputs": ["3mf", "stl"], "limits": {"seconds": 2.5, "triangles": 1000}}"#;

#[test]
fn jobs_are_resolved() {
    let document = read_job(JOB.as_bytes(), &DocumentLimits::default()).unwrap();
    assert_eq!(document.kind, JobKind::Solidify);
    assert_eq!(document.references().collect::<Vec<_>>(), ["m-1"]);
    assert_eq!(document.inputs[0].source, ModelSource::Stored("m-1".into()));
    let most = Limits { triangles: 999, ..Limits::default() };
    let found = document.clone().resolve(&Limits::default(), &most, |_| None).unwrap_err();
    let told: Vec<_> = found.iter().map(|fault| (fault.pointer.as_str(), fault.code)).collect();
    assert_eq!(told, [("/model_ref", code::UNKNOWN_MODEL), ("/limits/triangles", code::LIMIT_TOO_HIGH)]);
    let stored = model(r#"{"lacuna": 1, "name": "leaf", "shape": {"family": "ifs", "maps": [{"scale": 0.5}]}}"#);
    let job = document.resolve(&Limits::default(), &Limits::default(), |_| Some(stored.clone())).unwrap();
    assert_eq!((job.inputs[0].name.as_str(), job.limits.seconds, job.limits.cells), ("leaf", 2.5, 100_000_000));
    let canonical = write_job(&job);
    let again = read_job(canonical.as_bytes(), &DocumentLimits::default()).unwrap();
    assert_eq!(again.resolve(&Limits::default(), &Limits::default(), |_| None).unwrap(), job);
}

#[test]
fn numbers_without_a_place_in_documents_are_refused_on_reading() {
    let mut unfinished = model(r#"{"lacuna": 1, "shape": {"family": "mesh", "vertices": [[0, 0, 0]], "faces": [[0]]}}"#);
    let Shape::Mesh(mesh) = &mut unfinished.shape else { panic!("a mesh") };
    mesh.vertices[0].x = f64::NAN;
    assert_eq!(faults(&write_model(&unfinished))[0].code, code::NUMBER_AS_STRING);
}

#[test]
fn schemas_refer_to_each_other_and_are_closed() {
    let names: Vec<String> = schemas("").into_iter().map(|(name, _)| name).collect();
    for (name, schema) in schemas("") {
        let text = schema.to_string();
        for reference in text.split("\"$ref\":\"").skip(1) {
            let target = reference.split('"').next().unwrap();
            assert!(names.iter().any(|name| name == target), "{name} refers to {target}");
        }
        if schema.get("properties").is_some() {
            assert_eq!(schema["additionalProperties"], false, "{name}");
        }
    }
    assert!(model_schema()["$defs"]["IfsShape"]["properties"]["maps"]["description"].is_string());
    assert!(job_schema().to_string().contains("\"#/$defs/JobParams\""));
}

#[test]
fn a_batch_is_read_with_places_in_its_own_document() {
    let job = r#"{"lacuna": 1, "kind": "measure", "model_ref": "mdl_1", "params": {"tolerance_mm": 1}, "limits": {"seconds": 9}}"#;
    let text = format!(r#"{{"lacuna": 1, "jobs": [{{"job": {job}}}, {{"name": "b", "job": {job}}}]}}"#);
    let entries = read_batch(text.as_bytes(), &DocumentLimits::default()).unwrap();
    assert_eq!(entries.iter().map(|entry| entry.name.as_deref()).collect::<Vec<_>>(), [None, Some("b")]);
    let most = Limits { seconds: 1.0, ..Limits::default() };
    let last = entries.into_iter().next_back().unwrap().job;
    let faults = last.resolve(&most, &most, |_| None).unwrap_err();
    let places: Vec<&str> = faults.iter().map(|fault| fault.pointer.as_str()).collect();
    assert_eq!(places, ["/jobs/1/job/model_ref", "/jobs/1/job/limits/seconds"]);
    let many = format!(r#"{{"lacuna": 1, "jobs": [{}]}}"#, vec!["0"; MOST_JOBS + 1].join(","));
    let faults = read_batch(many.as_bytes(), &DocumentLimits::default()).unwrap_err();
    assert_eq!(faults.iter().map(|fault| (fault.pointer.as_str(), fault.code)).collect::<Vec<_>>(), [("/jobs", code::WRONG_LENGTH)]);
}
