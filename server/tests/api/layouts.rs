//! The layouts that come with teleclay, for Foxglove and PlotJuggler: whatever they name is there.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;
use teleclay_foxglove::server::Channel;

use crate::rig::{Rig, small};
use crate::visitor::Client;

/// What the layouts show: the session that a server starts with.
const SESSION: &str = "demo";

fn file(path: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../integrations");
    std::fs::read_to_string(root.join(path)).unwrap()
}

/// What a server tells there is.
fn offered() -> Client {
    let rig = Rig::start();
    let site = rig.site();
    assert_eq!(site.post("/api/v1/sessions", &small(SESSION)).status, 201);
    let mut client = Client::open(&site);
    client.until_session(SESSION);
    client
}

/// The fields of the message and of each message in it, by type.
fn types(channel: &Channel) -> BTreeMap<String, Vec<(String, String)>> {
    let mut name = channel.schema_name.replace("/msg/", "/");
    let mut types: BTreeMap<String, Vec<(String, String)>> = BTreeMap::new();
    for line in channel.schema.lines() {
        let line = line.split('#').next().unwrap().trim();
        if let Some(next) = line.strip_prefix("MSG: ") {
            name = next.to_owned();
        } else if let Some((kind, field)) = line.split_once(char::is_whitespace)
            && !line.contains('=')
        {
            let fields = types.entry(name.clone()).or_default();
            fields.push((kind.to_owned(), field.trim().to_owned()));
        }
    }
    types
}

/// The type at the end of a path into a message, or where it ends.
fn resolve(channel: &Channel, path: &[&str]) -> Result<String, String> {
    let types = types(channel);
    let mut kind = channel.schema_name.replace("/msg/", "/");
    for field in path {
        let package = kind.split('/').next().unwrap().to_owned();
        let fields = types
            .get(&kind)
            .ok_or_else(|| format!("{kind} has no fields"))?;
        let found = fields.iter().find(|(_, name)| name == field);
        let (next, _) = found.ok_or_else(|| format!("{kind} has no {field}"))?;
        let is_local = types.contains_key(&format!("{package}/{next}"));
        kind = if is_local {
            format!("{package}/{next}")
        } else {
            next.clone()
        };
    }
    Ok(kind)
}

/// Every string of a JSON value, with the name of its field.
fn strings<'a>(value: &'a Value, name: &'a str, found: &mut Vec<(&'a str, &'a str)>) {
    match value {
        Value::String(text) => found.push((name, text)),
        Value::Array(values) => values.iter().for_each(|value| strings(value, name, found)),
        Value::Object(fields) => {
            for (key, value) in fields {
                if key.starts_with('/') {
                    found.push(("topicPath", key));
                }
                strings(value, key, found);
            }
        }
        _ => {}
    }
}

#[test]
fn foxglove_finds_every_topic_field_and_service_that_its_layout_names() {
    let client = offered();
    let channel = |topic: &str| {
        client
            .channels
            .values()
            .find(|channel| channel.topic == topic)
    };
    let layout: Value = serde_json::from_str(&file("foxglove/layout.json")).unwrap();
    let mut named = Vec::new();
    strings(&layout["configById"], "", &mut named);
    let mut plotted = 0;
    for (name, text) in named {
        match name {
            "value" => {
                let (topic, path) = text.split_once('.').unwrap();
                let channel = channel(topic).unwrap_or_else(|| panic!("{topic} is not offered"));
                let path: Vec<&str> = path.split('.').collect();
                assert_eq!(resolve(channel, &path).as_deref(), Ok("float64"), "{text}");
                plotted += 1;
            }
            "topicPath" | "topicToRender" => assert!(channel(text).is_some(), "{text}"),
            "serviceName" => assert!(client.has_service(text), "{text}"),
            _ => {}
        }
    }
    assert!(9 < plotted);
    // Every panel that is configured is shown, and the other way round.
    let mut shown = Vec::new();
    strings(&layout["layout"], "", &mut shown);
    let mut shown: Vec<&str> = shown
        .into_iter()
        .filter(|(name, _)| *name != "direction")
        .map(|(_, id)| id)
        .collect();
    let configured: Vec<&str> = layout["configById"]
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect();
    shown.sort_unstable();
    assert_eq!(shown, configured);
}

#[test]
fn plotjuggler_finds_every_curve_that_its_layout_names() {
    let client = offered();
    let layout = file("plotjuggler/layout.xml");
    let curves: Vec<&str> = layout
        .split("<curve name=\"")
        .skip(1)
        .map(|rest| rest.split('"').next().unwrap())
        .collect();
    assert!(20 < curves.len());
    for curve in curves {
        let channel = client
            .channels
            .values()
            .find(|channel| curve.starts_with(&format!("{}/", channel.topic)))
            .unwrap_or_else(|| panic!("{curve} is of no topic"));
        let path: Vec<&str> = curve[channel.topic.len() + 1..].split('/').collect();
        assert_eq!(resolve(channel, &path).as_deref(), Ok("float64"), "{curve}");
    }
}
