//! The committed description of the service is what the service says of itself, and keeps its promises on paper.

use std::collections::BTreeSet;
use std::fs;

use lacuna_tests::support::binary::succeed;
use lacuna_tests::support::root;
use serde_json::Value;

/// Names that documents may rely on: they keep their meaning.
const CERTIFICATE: [&str; 29] = [
    "requested_tolerance_mm",
    "achieved_bound_mm",
    "inner_bound_mm",
    "outer_bound_mm",
    "thickness_min_mm",
    "leaf_cells",
    "vertices",
    "edges",
    "triangles",
    "components",
    "shells",
    "cavities",
    "genus",
    "euler",
    "boundary_edges",
    "nonmanifold_edges",
    "nonmanifold_vertices",
    "flipped_pairs",
    "degenerate_triangles",
    "self_intersections",
    "topology_stable",
    "topology_exact",
    "bbox_mm",
    "volume_mm3",
    "area_mm2",
    "kernel_version",
    "input_digest",
    "output_digests",
    "warnings",
];

fn committed() -> String {
    fs::read_to_string(root().join("api/openapi.json")).unwrap()
}

fn description() -> Value {
    serde_json::from_str(&committed()).unwrap()
}

/// (method and path, operation) of every operation.
fn operations(description: &Value) -> Vec<(String, Value)> {
    let paths = description["paths"].as_object().unwrap();
    let of = |(path, item): (&String, &Value)| {
        let methods = item.as_object().unwrap().clone();
        let path = path.clone();
        methods.into_iter().filter(|(_, operation)| operation.get("responses").is_some()).map(move |(m, o)| (format!("{m} {path}"), o))
    };
    paths.iter().flat_map(of).collect()
}

#[test]
fn the_committed_description_is_the_generated_one() {
    let generated = String::from_utf8(succeed(["openapi"])).unwrap();
    assert!(
        generated.trim_end() == committed().trim_end(),
        "api/openapi.json is not what `lacuna openapi` prints: run `cargo openapi > api/openapi.json`"
    );
}

#[test]
fn it_is_openapi_3_1() {
    assert!(description()["openapi"].as_str().unwrap().starts_with("3.1."));
    assert!(!operations(&description()).is_empty());
}

#[test]
fn every_reference_leads_somewhere() {
    fn references(value: &Value, into: &mut BTreeSet<String>) {
        match value {
            Value::Object(members) => {
                into.extend(members.get("$ref").and_then(Value::as_str).map(str::to_owned));
                members.values().for_each(|member| references(member, into));
            }
            Value::Array(items) => items.iter().for_each(|item| references(item, into)),
            _ => {}
        }
    }
    let (description, mut found) = (description(), BTreeSet::new());
    references(&description, &mut found);
    assert!(found.len() > 5, "only {} references", found.len());
    for reference in found {
        let pointer = reference.strip_prefix('#').unwrap_or_else(|| panic!("{reference} leads out of the document"));
        assert!(description.pointer(pointer).is_some(), "{reference} leads nowhere");
    }
}

#[test]
fn every_operation_says_how_it_refuses() {
    for (name, operation) in operations(&description()) {
        if !name.contains("/v1/") || name.contains("openapi.json") {
            continue;
        }
        let responses = operation["responses"].as_object().unwrap();
        let refusals: Vec<_> = responses.iter().filter(|(status, _)| status.starts_with('4') || *status == "default").collect();
        assert!(!refusals.is_empty(), "{name} has no 4xx");
        for (status, response) in refusals {
            assert!(response["content"].get("application/problem+json").is_some(), "{name} {status} is no problem document");
        }
        assert!(operation["summary"].is_string() || operation["description"].is_string(), "{name} has no words");
    }
}

#[test]
fn the_doors_that_were_promised_are_there() {
    let names: BTreeSet<String> = operations(&description()).into_iter().map(|(name, _)| name).collect();
    for name in [
        "post /v1/jobs",
        "get /v1/jobs",
        "get /v1/jobs/{id}",
        "delete /v1/jobs/{id}",
        "post /v1/jobs/{id}/cancel",
        "get /v1/jobs/{id}/events",
        "get /v1/jobs/{id}/outputs/{name}",
        "get /v1/results/{digest}",
        "post /v1/models",
        "get /v1/models/{id}",
        "post /v1/validate",
        "post /v1/plan",
        "post /v1/solve",
        "get /v1/capabilities",
        "get /v1/openapi.json",
    ] {
        assert!(names.contains(name), "{name} is missing from {names:?}");
    }
}

#[test]
fn the_certificate_has_the_names_that_documents_rely_on() {
    let description = description();
    let members = description.pointer("/components/schemas/Certificate/properties").and_then(Value::as_object).unwrap();
    for name in CERTIFICATE {
        assert!(members.contains_key(name), "the certificate has no {name}");
    }
}

#[test]
fn documents_refuse_members_that_they_do_not_know() {
    let description = description();
    for name in ["Certificate", "Job", "JobLimits", "JobParams", "Model"] {
        let schema = &description["components"]["schemas"][name];
        let closed = |value: &Value| value["additionalProperties"] == false || value["unevaluatedProperties"] == false;
        assert!(closed(schema), "{name} takes anything");
    }
}
