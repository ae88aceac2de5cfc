//! What generated clients need of the contract. Each rule is one that a generator has broken on.

use std::collections::BTreeSet;

use serde_json::{Map, Value};

use super::router::contract;

/// One method of one path.
struct Operation {
    id: String,
    body: Value,
}

fn document() -> Value {
    serde_json::to_value(contract()).expect("plain data")
}

fn object(value: &Value) -> Map<String, Value> {
    value.as_object().cloned().unwrap_or_default()
}

fn operations(document: &Value) -> Vec<Operation> {
    let mut operations = Vec::new();
    for (path, methods) in object(&document["paths"]) {
        for (method, body) in object(&methods) {
            let id = body["operationId"].as_str().unwrap_or_else(|| panic!("{method} {path} has no id")).to_owned();
            operations.push(Operation { id, body });
        }
    }
    operations
}

/// The media types of a body, with what is in it; references to named schemas are followed.
fn content(document: &Value, holder: &Value) -> Vec<(String, Value)> {
    object(&holder["content"]).into_iter().map(|(name, media)| (name, followed(document, &media["schema"]))).collect()
}

fn followed(document: &Value, schema: &Value) -> Value {
    match schema["$ref"].as_str().and_then(|name| name.strip_prefix('#')) {
        Some(pointer) => document.pointer(pointer).cloned().expect("a schema that is there"),
        None => schema.clone(),
    }
}

fn may_be_null(schema: &Value) -> bool {
    let is_null = |kind: &Value| kind == "null" || kind["type"] == "null";
    [&schema["type"], &schema["oneOf"], &schema["anyOf"]]
        .iter()
        .any(|choices| is_null(choices) || choices.as_array().is_some_and(|choices| choices.iter().any(is_null)))
}

/// Every schema inside of a value, with its place.
fn walk(place: &str, value: &Value, visit: &mut dyn FnMut(&str, &Value)) {
    visit(place, value);
    match value {
        Value::Object(fields) => fields.iter().for_each(|(name, value)| walk(&format!("{place}/{name}"), value, visit)),
        Value::Array(items) => items.iter().for_each(|value| walk(place, value, visit)),
        _ => {}
    }
}

#[test]
fn operations_have_ids_of_their_own_and_say_what_they_do() {
    let operations = operations(&document());
    let ids: BTreeSet<&str> = operations.iter().map(|operation| operation.id.as_str()).collect();
    assert_eq!(ids.len(), operations.len(), "{ids:?}");
    for Operation { id, body } in &operations {
        assert!(body["summary"].as_str().is_some_and(|text| text.len() > 10), "{id}");
        assert!(object(&body["responses"]).values().all(|answer| answer["description"] != ""), "{id}");
    }
}

#[test]
fn an_operation_takes_one_media_type_and_answers_with_one() {
    // a client that is generated can choose neither: one has lost the form, the other asks for a name it never imported
    let document = document();
    for Operation { id, body } in operations(&document) {
        assert!(content(&document, &body["requestBody"]).len() <= 1, "{id}");
        let answers: BTreeSet<String> = object(&body["responses"])
            .iter()
            .filter(|(status, _)| status.starts_with('2'))
            .flat_map(|(_, answer)| content(&document, answer))
            .map(|(media_type, _)| media_type)
            .collect();
        assert!(answers.len() <= 1, "{id}: {answers:?}");
    }
}

#[test]
fn a_file_is_bytes() {
    let document = document();
    let mut files = 0;
    for Operation { id, body } in operations(&document) {
        let bodies =
            object(&body["responses"]).into_iter().map(|(_, answer)| answer).chain([body["requestBody"].clone()]);
        for (media_type, schema) in bodies.flat_map(|body| content(&document, &body)) {
            if media_type == "application/octet-stream" {
                assert_eq!((&schema["type"], &schema["format"]), (&"string".into(), &"binary".into()), "{id}");
                files += 1;
            }
        }
    }
    assert!(files >= 3);
}

#[test]
fn what_has_no_null_is_not_said_to_have_one() {
    let document = document();
    let mut forms = 0;
    for Operation { id, body } in operations(&document) {
        for parameter in body["parameters"].as_array().into_iter().flatten() {
            assert!(!may_be_null(&followed(&document, &parameter["schema"])), "{id}: {parameter}");
        }
        for (_, form) in
            content(&document, &body["requestBody"]).iter().filter(|(kind, _)| kind.starts_with("multipart/"))
        {
            forms += 1;
            for (part, schema) in object(&form["properties"]) {
                assert!(!may_be_null(&schema), "{id}: {part}");
            }
            assert_eq!(form["additionalProperties"], false, "{id}: a part that is not known is refused");
        }
    }
    assert_eq!(forms, 5);
}

#[test]
fn only_what_has_to_be_sent_is_required() {
    let document = document();
    let required = |form: &str| document["components"]["schemas"][form]["required"].clone();
    assert_eq!(required("ScanSetForm"), Value::Null);
    assert_eq!(required("NewJobForm"), serde_json::json!(["scans"]));
    assert_eq!(required("ProbeForm"), serde_json::json!(["probe"]));
    assert_eq!(required("NewModelForm"), serde_json::json!(["model"]));
    assert_eq!(required("NewStandardForm"), serde_json::json!(["model", "name", "landmarks"]));
    // `Accept` may name a format instead
    let mut formats = 0;
    for Operation { id, body } in operations(&document) {
        for format in body["parameters"].as_array().into_iter().flatten().filter(|p| p["name"] == "format") {
            assert_eq!(format["required"], false, "{id}");
            formats += 1;
        }
    }
    assert!(formats >= 4);
    // types made of a field with a default say that it is always there, in requests too
    walk("", &document["components"]["schemas"], &mut |place, schema| {
        let is_schema = schema["type"].is_string() || schema["type"].is_array();
        assert!(!is_schema || schema.get("default").is_none(), "{place} has a default");
    });
}

#[test]
fn no_schema_is_empty_but_that_of_any_value() {
    let document = document();
    let mut empty = Vec::new();
    walk("", &document, &mut |place, schema| {
        // one of the choices of what a request needs is nothing
        if schema.as_object().is_some_and(Map::is_empty) && !place.ends_with("/security") {
            empty.push(place.to_owned());
        }
    });
    // the choices of an option are of whatever type the option has; events are no JSON
    let events = "/paths//v1/jobs/{id}/events/get/responses/200/content/text/event-stream";
    assert_eq!(empty, ["/components/schemas/OptionInfo/properties/choices/items", events]);
    let named = object(&document["components"]["schemas"]);
    assert!(named.keys().all(|name| !name.ends_with("Map")), "{:?}", named.keys());
}

#[test]
fn ids_are_uuids_and_names_of_scans_have_a_pattern() {
    let document = document();
    let mut ids = 0;
    walk("", &document, &mut |place, value| {
        for (name, schema) in object(&value["properties"]) {
            if (name == "id" || name.ends_with("_id")) && !place.ends_with("/Problem") {
                assert_eq!(schema["format"], "uuid", "{place}: {name}");
                ids += 1;
            }
        }
    });
    assert!(ids > 10);
    let mut names = 0;
    for Operation { id, body } in operations(&document) {
        for parameter in body["parameters"].as_array().into_iter().flatten().filter(|p| p["in"] == "path") {
            let schema = followed(&document, &parameter["schema"]);
            match (parameter["name"].as_str().expect("a name"), id.contains("Scan")) {
                ("id", _) => assert_eq!(schema["format"], "uuid", "{id}"),
                ("name", true) => {
                    assert!(schema["pattern"].as_str().is_some_and(|pattern| pattern.contains("[pP][lL][yY]")), "{id}");
                    names += 1;
                }
                _ => {}
            }
        }
    }
    assert_eq!(names, 4);
}

#[test]
fn what_may_be_refused_for_its_state_takes_conditions() {
    let mut conditional = 0;
    for Operation { id, body } in operations(&document()) {
        let named = |name: &str| {
            let mut parameters = body["parameters"].as_array().into_iter().flatten();
            parameters.any(|p| p["name"] == name && p["in"] == "header" && p["required"] == false)
        };
        let is_conditional = !body["responses"]["412"].is_null();
        assert_eq!([named("If-Match"), named("If-None-Match")], [is_conditional; 2], "{id}");
        conditional += usize::from(is_conditional);
    }
    assert!(conditional >= 15);
}
