//! The HTTP contract as OpenAPI 3.1: addresses from the handlers, documents from the exchange crate.

use lacuna_exchange::format::FORMATS;
use serde_json::{Value, json};
use utoipa::ToSchema;

/// Stands for a job document: its schema is the exchange crate's.
#[derive(ToSchema)]
pub struct Job {}

/// Stands for a batch of job documents: its schema is the exchange crate's.
#[derive(ToSchema)]
pub struct Batch {}

/// Stands for a model document: its schema is the exchange crate's.
#[derive(ToSchema)]
pub struct Model {}

/// Stands for a request to solve a model: its schema is the exchange crate's.
#[derive(ToSchema)]
pub struct SolveRequest {}

/// Stands for a question about addresses: its schema is the exchange crate's.
#[derive(ToSchema)]
pub struct AddressQuestion {}

/// Stands for a job document without its kind: its schema is made of the job's.
#[derive(ToSchema)]
pub struct ShortOrder {}

/// The description as indented JSON, with a line end: what is committed.
#[must_use]
pub fn text() -> String {
    let mut text = serde_json::to_string_pretty(&document()).unwrap_or_default();
    text.push('\n');
    text
}

/// The description.
#[must_use]
pub fn document() -> Value {
    let mut document = serde_json::to_value(crate::http::router::description()).unwrap_or_default();
    document["info"] = json!({
        "title": "lacuna",
        "version": env!("CARGO_PKG_VERSION"),
        "summary": "Fractal, NURBS and subdivision geometry as fabrication-ready solids, with a certificate.",
        "description": "Lengths are mm, angles degrees, times RFC 3339 in UTC. Every error is `application/problem+json` (RFC 9457). Unknown members of a document are refused.",
        "license": { "name": "MIT OR Apache-2.0", "identifier": "MIT OR Apache-2.0" }
    });
    document["tags"] = json!([
        { "name": "models", "description": "Stored models and uploaded mesh files." },
        { "name": "studies", "description": "What can be said without computing the shape." },
        { "name": "jobs", "description": "Computations: submitted, followed, stopped." },
        { "name": "results", "description": "Files, by job and by digest." },
        { "name": "trades", "description": "Materials and processes, each value with its source." },
        { "name": "operation", "description": "Probes, limits, the contract itself." }
    ]);
    document["security"] = json!([{ "key": [] }]);
    document["components"]["securitySchemes"] =
        json!({ "key": { "type": "http", "scheme": "bearer", "description": "A key of the service; not needed where it has none." } });
    for (name, schema) in lacuna_exchange::document::schemas("#/components/schemas/") {
        document["components"]["schemas"][name] = schema;
    }
    // A file comes in its own media type, a certificate as JSON; `application/octet-stream` stands for all of them in `Accept`.
    for address in ["/v1/results/{digest}", "/v1/jobs/{id}/outputs/{name}"] {
        for media_type in FORMATS.iter().map(|facts| facts.media_type).chain(["application/json"]) {
            document["paths"][address]["get"]["responses"]["200"]["content"][media_type] = json!({});
        }
    }
    // What may happen to any operation: the device fails, the database is away, time is over.
    let operations = document["paths"].as_object_mut().into_iter().flatten().filter_map(|(_, methods)| methods.as_object_mut());
    for operation in operations.flatten().map(|(_, operation)| operation).filter(|operation| operation["responses"].is_object()) {
        operation["responses"]["5XX"] = json!({ "description": "The service cannot answer now; `code` and `detail` say why, and whether to ask again.",
            "content": { "application/problem+json": { "schema": { "$ref": "#/components/schemas/Problem" } } } });
    }
    document["components"]["schemas"]["ShortOrder"] = short_order(&document["components"]["schemas"]["Job"]);
    document
}

/// A job document whose kind the address says.
fn short_order(job: &Value) -> Value {
    let mut schema = job.clone();
    if let Some(members) = schema["properties"].as_object_mut() {
        members.remove("kind");
    }
    if let Some(required) = schema["required"].as_array_mut() {
        required.retain(|name| name != "kind");
    }
    schema["description"] = "A job document without `kind`, which the address says.".into();
    schema
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_committed_contract_is_the_served_one() {
        let committed = include_str!("../openapi.json");
        assert!(committed == text(), "api/openapi.json is out of date: run `cargo run -- openapi > api/openapi.json`");
    }

    #[test]
    fn files_are_described_in_every_media_type_that_they_come_in() {
        let document = document();
        for address in ["/v1/results/{digest}", "/v1/jobs/{id}/outputs/{name}"] {
            let content = document["paths"][address]["get"]["responses"]["200"]["content"].as_object();
            let names: Vec<&str> = content.into_iter().flatten().map(|(name, _)| name.as_str()).collect();
            for name in ["application/octet-stream", "application/json", "model/stl", "model/3mf", "image/png", "image/svg+xml"] {
                assert!(names.contains(&name), "{name}: {names:?}");
            }
        }
    }

    #[test]
    fn every_operation_may_fail() {
        let document = document();
        let paths = document["paths"].as_object().into_iter().flatten();
        for (method, operation) in paths.filter_map(|(_, methods)| methods.as_object()).flatten() {
            assert!(operation["responses"]["5XX"].is_object(), "{method} {}", operation["operationId"]);
        }
    }

    #[test]
    fn every_reference_leads_somewhere() {
        fn check(document: &Value, value: &Value) {
            match value {
                Value::Object(members) => {
                    if let Some(Value::String(reference)) = members.get("$ref") {
                        let pointer = reference.trim_start_matches('#');
                        assert!(document.pointer(pointer).is_some(), "{reference}");
                    }
                    members.values().for_each(|member| check(document, member));
                }
                Value::Array(items) => items.iter().for_each(|item| check(document, item)),
                _ => {}
            }
        }
        let document = document();
        check(&document, &document);
        assert_eq!(document["openapi"].as_str().map(|version| &version[..3]), Some("3.1"));
    }
}
