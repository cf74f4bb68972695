//! JSON Schemas (draft 2020-12) of the documents, generated from the grammar's tables.
//!
//! A schema tells what the reader's first pass tells: members, types, lengths, words. What needs two
//! places at once (indices in range, names that are known, members that exclude each other by kind of
//! job) only the reader tells.

use serde_json::{Map, Value, json};

use super::grammar::{
    ADDRESS_QUESTION, ADJACENCY, BATCH, BATCH_ENTRY, BORDER, BOUNDARY, COEFFICIENTS, CONTROL_MESH, CORNER, CREASE, CURVES, EMBEDDED_MODEL,
    FAMILIES, GLUE, INCIDENCE, JOB, JOB_INPUT, JOB_LIMITS, JOB_PARAMS, JOIN, LINEAR_MAP, MESH_DATA, MODEL, Member, Object, PART,
    PART_MEMBERS, PRIMITIVE, RADIUS_BY_LEVEL, RELATION, ROOT_CELL, SCHEMES, SIDE, SOLVE, STATE, TRANSITION, TRIM, TRIM_CURVES, TURNED_MAP,
    WITH, control_point_schema, matrix_schema, reference, trim_point_schema,
};

/// The schemas of the documents by name, for the components of an OpenAPI 3.1 description: references
/// between them start with `prefix`, for example `#/components/schemas/`. The entry points are `Model`
/// and `Job`.
#[must_use]
pub fn schemas(prefix: &str) -> Vec<(String, Value)> {
    let mut schemas = named_schemas();
    for (_, schema) in &mut schemas {
        point_references(schema, prefix);
    }
    schemas
}

/// The schema of model documents on its own.
#[must_use]
pub fn model_schema() -> Value {
    standalone("Model")
}

/// The schema of job documents on its own.
#[must_use]
pub fn job_schema() -> Value {
    standalone("Job")
}

fn standalone(entry: &str) -> Value {
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$ref": format!("#/$defs/{entry}"),
        "$defs": schemas("#/$defs/").into_iter().collect::<Map<_, _>>(),
    })
}

fn named_schemas() -> Vec<(String, Value)> {
    const PLAIN: [(&str, &Object); 22] = [
        ("Model", &MODEL),
        ("EmbeddedModel", &EMBEDDED_MODEL),
        ("MeshData", &MESH_DATA),
        ("State", &STATE),
        ("Transition", &TRANSITION),
        ("Boundary", &BOUNDARY),
        ("Incidence", &INCIDENCE),
        ("Adjacency", &ADJACENCY),
        ("Relation", &RELATION),
        ("Side", &SIDE),
        ("RootCell", &ROOT_CELL),
        ("Glue", &GLUE),
        ("ControlMesh", &CONTROL_MESH),
        ("Crease", &CREASE),
        ("Corner", &CORNER),
        ("Coefficients", &COEFFICIENTS),
        ("Join", &JOIN),
        ("Trim", &TRIM),
        ("JobParams", &JOB_PARAMS),
        ("JobLimits", &JOB_LIMITS),
        ("Batch", &BATCH),
        ("BatchEntry", &BATCH_ENTRY),
    ];
    let mut schemas: Vec<(String, Value)> = PLAIN.iter().map(|(name, grammar)| ((*name).into(), object(grammar, &[]))).collect();
    schemas.extend(FAMILIES.iter().map(|(_, name, grammar)| ((*name).into(), object(grammar, &[]))));
    schemas.push(("Shape".into(), any_of("A shape of one of the families.", FAMILIES.iter().map(|(_, name, _)| reference(name)))));
    schemas.extend(SCHEMES.iter().map(|(_, name, grammar)| ((*name).into(), object(grammar, &[]))));
    let schemes = any_of("A curve shape without control points.", SCHEMES.iter().map(|(_, name, _)| reference(name)));
    schemas.push(("CurveScheme".into(), schemes));
    schemas.push(("CurveShape".into(), any_of("A curve.", CURVES.iter().map(|(_, name, _)| reference(name)))));
    schemas.extend(TRIM_CURVES.iter().map(|(_, name, grammar)| ((*name).into(), object(grammar, &[]))));
    schemas.push(("TrimCurve".into(), any_of("A curve in the parameter plane.", TRIM_CURVES.iter().map(|(_, name, _)| reference(name)))));
    schemas.push(("TrimPoint".into(), trim_point_schema()));
    let placed = FAMILIES.iter().map(|(_, _, grammar)| object(grammar, PART_MEMBERS));
    let parts = std::iter::once(object(&PART, &[])).chain(placed);
    schemas.push((
        "Part".into(),
        any_of("A shape with an optional name and place: beside the shape's own members, or with the shape as a member.", parts),
    ));
    schemas.push(("RadiusByLevel".into(), object(&RADIUS_BY_LEVEL, &[])));
    let maps = [object(&LINEAR_MAP, &[]), object(&TURNED_MAP, &[])];
    schemas.push(("AffineMap".into(), any_of("An affine map of space.", maps.into_iter())));
    schemas.push(("ControlPoint".into(), control_point_schema()));
    schemas.push(("Matrix".into(), matrix_schema()));
    schemas.push(("Primitive".into(), primitive()));
    schemas.push(("Border".into(), exactly_one(object(&BORDER, &[]), &["side", "vertices", "boundaries"])));
    schemas.push(("With".into(), exactly_one(object(&WITH, &[]), &super::with::words())));
    schemas.push(("JobInput".into(), exactly_one(object(&JOB_INPUT, &[]), &["model", "model_ref"])));
    schemas.push(("SolveRequest".into(), exactly_one(object(&SOLVE, &[]), &["model", "model_ref"])));
    schemas.push(("AddressQuestion".into(), address_question()));
    schemas.push(("Job".into(), job()));
    schemas.sort_by(|(one, _), (other, _)| one.cmp(other));
    schemas
}

/// An object with the members of a table and those that a context adds, and no others.
fn object(grammar: &Object, added: &[Member]) -> Value {
    let members = || grammar.members.iter().chain(added);
    let properties: Map<String, Value> = members()
        .map(|member| {
            let mut schema = (member.schema)();
            if let Value::Object(keywords) = &mut schema {
                // why: generators of clients differ on siblings of a reference, so it gets a wrapper
                if let Some(target) = keywords.remove("$ref") {
                    keywords.insert("allOf".into(), json!([{ "$ref": target }]));
                }
                keywords.insert("description".into(), member.about.into());
            }
            (member.name.to_owned(), schema)
        })
        .collect();
    let required: Vec<&str> = members().filter(|member| member.required).map(|member| member.name).collect();
    let mut schema = json!({ "type": "object", "description": grammar.about, "properties": properties, "additionalProperties": false });
    if !required.is_empty() {
        schema["required"] = json!(required);
    }
    schema
}

fn any_of(about: &str, choices: impl Iterator<Item = Value>) -> Value {
    json!({ "description": about, "anyOf": choices.collect::<Vec<_>>() })
}

fn exactly_one(mut schema: Value, names: &[&str]) -> Value {
    schema["oneOf"] = names.iter().map(|name| json!({ "required": [name] })).collect();
    schema
}

fn primitive() -> Value {
    let mut schema = exactly_one(object(&PRIMITIVE, &[]), &["points", "polyline", "mesh", "solid"]);
    schema["dependentRequired"] = json!({ "closed": ["polyline"] });
    schema
}

fn address_question() -> Value {
    let mut schema = object(&ADDRESS_QUESTION, &[]);
    schema["allOf"] = json!([
        exactly_one(json!({}), &["model", "model_ref"]),
        exactly_one(json!({}), &["at", "near"]),
        { "if": { "required": ["at"] }, "then": { "not": { "anyOf": [
            { "required": ["within_mm"] }, { "required": ["tolerance_mm"] }, { "required": ["most"] }
        ] } } },
    ]);
    schema
}

fn job() -> Value {
    let mut schema = exactly_one(object(&JOB, &[]), &["model", "model_ref", "inputs"]);
    let kind =
        |word: &str, then: Value| json!({ "if": { "properties": { "kind": { "const": word } }, "required": ["kind"] }, "then": then });
    schema["allOf"] = json!([
        { "if": { "properties": { "params": { "required": ["level"] } } }, "else": { "properties": { "params": { "required": ["tolerance_mm"] } } } },
        kind(
            "solidify",
            json!({ "properties": { "params": {
                "anyOf": [{ "required": ["radius_mm"] }, { "required": ["wall_mm"] }, { "required": ["level"] }],
                "not": { "required": ["normals"] },
                "dependentSchemas": { "level": { "not": { "anyOf": [
                    { "required": ["radius_mm"] }, { "required": ["closing_mm"] }, { "required": ["wall_mm"] }, { "required": ["simplify"] },
                    { "required": ["stability"] }, { "required": ["preview"] }
                ] } } },
            } } })
        ),
        {
            "if": { "properties": { "params": { "properties": { "preview": { "const": true } }, "required": ["preview"] } } },
            "then": { "properties": { "outputs": { "items": { "const": "glb" } } } },
        },
        kind(
            "evaluate",
            json!({ "properties": { "params": { "not": { "anyOf": [
                { "required": ["radius_mm"] }, { "required": ["simplify"] }, { "required": ["stability"] }, { "required": ["repair"] }
            ] } } } })
        ),
        kind(
            "measure",
            json!({ "properties": {
                "outputs": { "maxItems": 0 },
                "params": { "not": { "anyOf": [
                    { "required": ["normals"] }, { "required": ["simplify"] }, { "required": ["stability"] }, { "required": ["preview"] }
                ] } },
            } }),
        ),
    ]);
    schema
}

fn point_references(schema: &mut Value, prefix: &str) {
    match schema {
        Value::Object(keywords) => {
            for (keyword, value) in keywords.iter_mut() {
                match value {
                    Value::String(name) if keyword == "$ref" => *name = format!("{prefix}{name}"),
                    _ => point_references(value, prefix),
                }
            }
        }
        Value::Array(values) => values.iter_mut().for_each(|value| point_references(value, prefix)),
        _ => {}
    }
}
