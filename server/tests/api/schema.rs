//! Whether a value is as a schema of the OpenAPI document describes it.

use serde_json::Value;

/// What in `value` is not as `schema` has it, one sentence each, with where it stands.
pub(crate) fn differences(document: &Value, schema: &Value, value: &Value) -> Vec<String> {
    let mut found = Vec::new();
    compare(document, schema, value, "", &mut found);
    found
}

/// Words that say nothing about a value.
const NOTES: [&str; 5] = ["default", "description", "example", "format", "title"];

fn compare(document: &Value, schema: &Value, value: &Value, at: &str, found: &mut Vec<String>) {
    for (word, wanted) in schema.as_object().unwrap() {
        let agrees = match word.as_str() {
            "$ref" => {
                let target = wanted.as_str().unwrap().strip_prefix('#').unwrap();
                compare(
                    document,
                    document.pointer(target).unwrap(),
                    value,
                    at,
                    found,
                );
                true
            }
            "type" => is_of_type(wanted, value),
            "enum" => list(wanted).contains(value),
            "minimum" => number(value).is_none_or(|n| number(wanted).unwrap() <= n),
            "maximum" => number(value).is_none_or(|n| n <= number(wanted).unwrap()),
            "exclusiveMinimum" => number(value).is_none_or(|n| number(wanted).unwrap() < n),
            "exclusiveMaximum" => number(value).is_none_or(|n| n < number(wanted).unwrap()),
            "minItems" => !value.is_array() || wanted.as_u64().unwrap() <= list(value).len() as u64,
            "maxItems" => !value.is_array() || list(value).len() as u64 <= wanted.as_u64().unwrap(),
            "required" => {
                !value.is_object()
                    || list(wanted)
                        .iter()
                        .all(|name| value.get(name.as_str().unwrap()).is_some())
            }
            "properties" => {
                for (name, schema) in wanted.as_object().unwrap() {
                    if let Some(value) = value.get(name) {
                        compare(document, schema, value, &format!("{at}/{name}"), found);
                    }
                }
                true
            }
            "additionalProperties" => {
                assert_eq!(
                    wanted,
                    &Value::Bool(false),
                    "{at}: a map is not looked into here"
                );
                let known = schema["properties"].as_object().unwrap();
                value
                    .as_object()
                    .is_none_or(|fields| fields.keys().all(|name| known.contains_key(name)))
            }
            "prefixItems" => {
                for (index, (schema, value)) in list(wanted).iter().zip(list(value)).enumerate() {
                    compare(document, schema, value, &format!("{at}/{index}"), found);
                }
                true
            }
            "items" => {
                let fixed = schema
                    .get("prefixItems")
                    .map_or(0, |items| list(items).len());
                if wanted == &Value::Bool(false) {
                    list(value).len() <= fixed
                } else {
                    for (index, value) in list(value).iter().enumerate().skip(fixed) {
                        compare(document, wanted, value, &format!("{at}/{index}"), found);
                    }
                    true
                }
            }
            "oneOf" | "anyOf" => {
                let fitting = list(wanted)
                    .iter()
                    .filter(|schema| differences(document, schema, value).is_empty())
                    .count();
                if word == "oneOf" {
                    fitting == 1
                } else {
                    0 < fitting
                }
            }
            "allOf" => {
                for schema in list(wanted) {
                    compare(document, schema, value, at, found);
                }
                true
            }
            note => {
                assert!(
                    NOTES.contains(&note),
                    "{at}: `{note}` is not looked into here"
                );
                true
            }
        };
        if !agrees {
            let mut shown = value.to_string();
            shown.truncate(80);
            found.push(format!("{at}: {shown} against {word} {wanted}"));
        }
    }
}

fn is_of_type(wanted: &Value, value: &Value) -> bool {
    let is = |name: &Value| match name.as_str().unwrap() {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        "number" => value.is_number(),
        "integer" => value.is_i64() || value.is_u64(),
        other => panic!("there is no type {other}"),
    };
    match wanted {
        Value::Array(several) => several.iter().any(is),
        one => is(one),
    }
}

fn number(value: &Value) -> Option<f64> {
    value.as_f64()
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

/// What agrees is passed over, and each kind of disagreement is found where it stands.
#[test]
fn what_is_not_as_described_is_found() {
    let document = serde_json::json!({ "part": {
        "type": "object", "required": ["a", "b"], "additionalProperties": false,
        "properties": {
            "a": { "type": "array", "items": { "type": ["number", "null"], "minimum": 0 } },
            "b": { "oneOf": [{ "type": "null" }, { "enum": ["x", "y"] }] },
        },
    } });
    let schema = serde_json::json!({ "$ref": "#/part" });
    let places = |value: Value| -> Vec<String> {
        let found = differences(&document, &schema, &value);
        found
            .iter()
            .map(|sentence| sentence.split(':').next().unwrap().to_owned())
            .collect()
    };
    assert!(places(serde_json::json!({ "a": [1, null, 0.5], "b": "x" })).is_empty());
    assert!(places(serde_json::json!({ "a": [], "b": null })).is_empty());
    assert_eq!(
        places(serde_json::json!({ "a": [1, -1, "1"], "b": "z" })),
        ["/a/1", "/a/2", "/b"]
    );
    assert_eq!(places(serde_json::json!({ "a": [] })), [""]);
    assert_eq!(
        places(serde_json::json!({ "a": [], "b": null, "c": 1 })),
        [""]
    );
    assert_eq!(places(serde_json::json!({ "a": null, "b": null })), ["/a"]);
}
