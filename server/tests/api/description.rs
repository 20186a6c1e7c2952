//! The OpenAPI document against what is really served.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;
use teleclay_server::api::description;

use crate::rig::shared;
use crate::wire::Ask;

/// Calls that clients rely on.
const CALLS: [(&str, &str); 19] = [
    ("get", "/api/v1/openapi.json"),
    ("get", "/api/v1/sessions"),
    ("post", "/api/v1/sessions"),
    ("get", "/api/v1/sessions/{id}"),
    ("patch", "/api/v1/sessions/{id}"),
    ("delete", "/api/v1/sessions/{id}"),
    ("post", "/api/v1/sessions/{id}/clay/reset"),
    ("get", "/api/v1/sessions/{id}/clay.stl"),
    ("get", "/api/v1/sessions/{id}/stream"),
    ("post", "/api/v1/kinematics/inverse"),
    ("post", "/api/v1/kinematics/forward"),
    ("post", "/api/v1/kinematics/jacobian"),
    ("post", "/api/v1/kinematics/workspace"),
    ("post", "/api/v1/analysis/loop"),
    ("post", "/api/v1/analysis/tuning"),
    ("post", "/api/v1/experiments/cutting"),
    ("get", "/healthz"),
    ("get", "/readyz"),
    ("get", "/metrics"),
];

fn document() -> Value {
    shared().site().get("/api/v1/openapi.json").json()
}

fn operations(document: &Value) -> BTreeMap<(String, String), Value> {
    let mut operations = BTreeMap::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            operations.insert((method.clone(), path.clone()), operation.clone());
        }
    }
    operations
}

/// Everything in the document, with where it stands.
fn walk<'a>(value: &'a Value, at: &str, visit: &mut dyn FnMut(&str, &'a Value)) {
    visit(at, value);
    match value {
        Value::Object(fields) => {
            for (key, value) in fields {
                let key = key.replace('~', "~0").replace('/', "~1");
                walk(value, &format!("{at}/{key}"), visit);
            }
        }
        Value::Array(items) => {
            for (index, item) in items.iter().enumerate() {
                walk(item, &format!("{at}/{index}"), visit);
            }
        }
        _ => {}
    }
}

#[test]
fn it_is_openapi_3_1_and_speaks_of_no_other_host() {
    let document = document();
    assert!(document["openapi"].as_str().unwrap().starts_with("3.1"));
    assert_eq!(document["info"]["version"], "9.8.7");
    for server in document["servers"].as_array().unwrap() {
        assert!(server["url"].as_str().unwrap().starts_with('/'), "{server}");
    }
    walk(&document, "", &mut |at, value| {
        let text = value.as_str().unwrap_or_default();
        assert!(!text.contains("://"), "{at}: {text}");
    });
}

#[test]
fn every_call_is_described_and_every_description_is_served() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let document = document();
    let described: BTreeSet<_> = operations(&document).into_keys().collect();
    let want: BTreeSet<_> = CALLS
        .iter()
        .map(|(m, p)| ((*m).to_owned(), (*p).to_owned()))
        .collect();
    assert!(described.is_superset(&want), "{described:?}");
    for (method, path) in described {
        let path = path.replace("{id}", &session);
        let ask = Ask::new(&method.to_uppercase(), &path).json("{");
        let answer = site.send(&ask);
        let is_missing =
            answer.status == 405 || (answer.status == 404 && answer.word() == "no-such-path");
        assert!(!is_missing, "{method} {path}: {answer:?}");
    }
}

#[test]
fn references_lead_somewhere_and_every_schema_is_used() {
    let document = document();
    let mut referred = BTreeSet::new();
    walk(&document, "", &mut |at, value| {
        if at.ends_with("/$ref") {
            let target = value.as_str().unwrap().strip_prefix('#').unwrap();
            assert!(document.pointer(target).is_some(), "{at}: {target}");
            referred.insert(target.to_owned());
        }
    });
    for name in document["components"]["schemas"]
        .as_object()
        .unwrap()
        .keys()
    {
        let is_message = matches!(&**name, "ServerText" | "ClientText");
        let pointer = format!("/components/schemas/{name}");
        assert!(
            is_message || referred.contains(&pointer),
            "{name} is not used"
        );
    }
}

#[test]
fn every_call_says_what_it_answers_when_it_cannot() {
    let document = document();
    let mut names = BTreeSet::new();
    let mut words = BTreeSet::new();
    for ((method, path), operation) in operations(&document) {
        let context = format!("{method} {path}");
        let name = operation["operationId"].as_str().unwrap().to_owned();
        assert!(names.insert(name), "{context} has another's operationId");
        assert!(operation["summary"].is_string(), "{context}");
        let responses = operation["responses"].as_object().unwrap();
        assert!(
            responses.keys().any(|status| status < &"400".to_owned()),
            "{context}"
        );
        for (status, response) in responses {
            if status.as_str() < "400" {
                continue;
            }
            let content = response["content"].as_object().unwrap();
            let problem = &content["application/problem+json"];
            assert_eq!(
                problem["schema"]["$ref"], "#/components/schemas/Problem",
                "{context}"
            );
            for (word, example) in problem["examples"].as_object().unwrap() {
                assert_eq!(
                    example["value"]["status"].to_string(),
                    *status,
                    "{context}: {word}"
                );
                words.insert(word.clone());
            }
        }
        for status in ["400", "403", "421", "500", "503"] {
            assert!(responses.contains_key(status), "{context} lacks {status}");
        }
        let is_open = operation["security"] == serde_json::json!([{}]);
        assert_eq!(is_open, !responses.contains_key("401"), "{context}");
        // A stop is carried out whatever its body is.
        if operation.get("requestBody").is_some() && operation["operationId"] != "stop" {
            for status in ["408", "413", "415", "422"] {
                assert!(responses.contains_key(status), "{context} lacks {status}");
            }
            let may_be_left_out = ["clear_stop", "grant", "deny"]
                .iter()
                .any(|name| operation["operationId"] == *name);
            let is_required = operation["requestBody"]["required"] == true;
            assert_eq!(is_required, !may_be_left_out, "{context}");
        }
        if path.contains("{id}") {
            assert!(responses.contains_key("404"), "{context}");
        }
    }
    // Every kind of problem belongs to some call, but for those that a call cannot have; and has a page.
    let site = shared().site();
    let description = document["info"]["description"].as_str().unwrap();
    for word in &words {
        assert!(
            description.contains(&format!("`/problems/{word}`")),
            "{word}"
        );
        assert_eq!(site.get(&format!("/problems/{word}")).status, 200, "{word}");
    }
    let listed = description.matches("](/problems/").count();
    // Some are of no call at all, some of the messages on a stream.
    let of_no_call = ["no-such-path", "method", "no-lease", "other-block"];
    assert!(of_no_call.iter().all(|word| !words.contains(*word)));
    assert_eq!(listed, words.len() + of_no_call.len());
}

/// Limits that are checked are also told: whoever generates a client from the document gets them.
#[test]
fn schemas_carry_limits_and_close_their_objects() {
    let document = document();
    let schemas = &document["components"]["schemas"];
    assert_eq!(
        schemas["Impairment"]["properties"]["delay_s"]["maximum"],
        2.0
    );
    assert_eq!(schemas["NewSession"]["required"], serde_json::json!(["id"]));
    for name in [
        "NewSession",
        "SessionPatch",
        "ClayReset",
        "Network",
        "Impairment",
        "MaterialChoice",
        "RobotGeometry",
        "InverseRequest",
        "ForwardRequest",
        "JacobianRequest",
        "WorkspaceRequest",
        "TransferFunction",
        "LoopRequest",
        "TuningRequest",
        "CuttingRequest",
    ] {
        assert_eq!(schemas[name]["additionalProperties"], false, "{name}");
        for (field, schema) in schemas[name]["properties"].as_object().unwrap() {
            let says = schema.to_string().contains("\"description\":");
            assert!(says, "{name}.{field} does not say what it is");
        }
    }
}

/// The dashboard takes its types from a copy, so that it can be built before the server is.
#[test]
fn the_dashboard_has_the_description_of_this_server() {
    let copy = concat!(env!("CARGO_MANIFEST_DIR"), "/../client-web/openapi.json");
    let copied: Value = serde_json::from_str(&std::fs::read_to_string(copy).unwrap()).unwrap();
    let now = serde_json::to_value(description(env!("CARGO_PKG_VERSION"))).unwrap();
    assert_eq!(
        copied, now,
        "client-web/openapi.json is another: cargo run --release --bin teleclay-server -- openapi > client-web/openapi.json"
    );
}
