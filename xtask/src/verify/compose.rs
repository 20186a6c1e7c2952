//! Checks docker/compose.yaml without Docker: that it parses, that what it names exists, that it opens nothing by accident.

use std::path::Path;

use anyhow::{Context, Result, bail};
use saphyr_parser::{Event, Parser};
use serde_json::{Map, Value};

/// What is wrong with the file, one sentence each.
pub(super) fn check(path: &Path) -> Result<Vec<String>> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("{} cannot be read", path.display()))?;
    let file = parse(&text).with_context(|| format!("{} is no YAML", path.display()))?;
    let folder = path.parent().unwrap_or(path);
    Ok(mistakes(&file, |name| folder.join(name).exists()))
}

fn mistakes(file: &Value, exists: impl Fn(&str) -> bool) -> Vec<String> {
    let Some(services) = file.get("services").and_then(Value::as_object) else {
        return vec!["compose.yaml has no services".to_owned()];
    };
    let mut wrong = Vec::new();
    for (name, service) in services {
        let mut complain = |what: String| wrong.push(format!("compose.yaml, {name}: {what}"));
        if let Some(build) = service.get("build") {
            let context = build.get("context").and_then(Value::as_str).unwrap_or(".");
            let file = build
                .get("dockerfile")
                .and_then(Value::as_str)
                .unwrap_or("Dockerfile");
            if !exists(&format!("{context}/{file}")) {
                complain(format!("{context}/{file} does not exist"));
            }
        } else if service.get("image").is_none() {
            complain("has neither build nor image".to_owned());
        }
        for port in strings(service.get("ports")) {
            if !port.starts_with("127.0.0.1:") {
                complain(format!("port {port} is published beyond this machine"));
            }
        }
        let mut told = strings(service.get("command"));
        told.extend(
            service
                .get("environment")
                .and_then(Value::as_object)
                .into_iter()
                .flatten()
                .filter_map(|(_, value)| value.as_str().map(str::to_owned)),
        );
        let listens_beyond_loopback = told
            .iter()
            .any(|word| word.contains("0.0.0.0") || word.contains("[::]"));
        let token = service
            .pointer("/environment/TELECLAY_TOKEN")
            .and_then(Value::as_str)
            .unwrap_or_default();
        // `${NAME:?words}` has compose stop with those words when the variable is unset or empty.
        if listens_beyond_loopback && !token.starts_with("${TELECLAY_TOKEN:?") {
            complain("listens beyond loopback and does not insist on TELECLAY_TOKEN".to_owned());
        }
        for (other, how) in service
            .get("depends_on")
            .and_then(Value::as_object)
            .into_iter()
            .flatten()
        {
            if !services.contains_key(other) {
                complain(format!("waits for {other}, which is not there"));
            }
            if how.get("condition").and_then(Value::as_str) != Some("service_healthy") {
                complain(format!("starts before {other} is healthy"));
            }
        }
        for volume in strings(service.get("volumes")) {
            let source = volume.split(':').next().unwrap_or(&volume);
            let is_path = source.starts_with(['.', '/']);
            let is_named = file.pointer(&format!("/volumes/{source}")).is_some();
            if is_path && !exists(source) || !is_path && !is_named {
                complain(format!("volume {source} is not there"));
            }
        }
    }
    wrong
}

fn strings(list: Option<&Value>) -> Vec<String> {
    let words = list.and_then(Value::as_array).into_iter().flatten();
    words.filter_map(Value::as_str).map(str::to_owned).collect()
}

/// Reads one YAML document. Every scalar stays text: nothing here needs a number, and `no` stays `no`.
fn parse(text: &str) -> Result<Value> {
    /// A collection that is not closed yet; a mapping also holds the key that waits for its value.
    enum Open {
        List(Vec<Value>),
        Map(Map<String, Value>, Option<String>),
    }
    let mut open: Vec<Open> = Vec::new();
    let mut whole = None;
    for event in Parser::new_from_str(text) {
        let (event, span) = event?;
        let line = span.start.line();
        let finished = match event {
            Event::Scalar(text, ..) => Value::String(text.into_owned()),
            Event::SequenceStart(..) => {
                open.push(Open::List(Vec::new()));
                continue;
            }
            Event::MappingStart(..) => {
                open.push(Open::Map(Map::new(), None));
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some(Open::List(list)) => Value::Array(list),
                Some(Open::Map(map, _)) => Value::Object(map),
                None => bail!("line {line}: an end without a beginning"),
            },
            Event::Alias(_) => bail!("line {line}: aliases are not read here; write the value out"),
            _ => continue,
        };
        match open.last_mut() {
            None => whole = Some(finished),
            Some(Open::List(list)) => list.push(finished),
            Some(Open::Map(map, key)) => match (key.take(), finished) {
                (None, Value::String(text)) => *key = Some(text),
                (None, _) => bail!("line {line}: a key must be text"),
                (Some(key), value) => {
                    if map.insert(key.clone(), value).is_some() {
                        bail!("line {line}: {key} stands there twice");
                    }
                }
            },
        }
    }
    whole.context("there is nothing in it")
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"
services:
  server:
    build: { context: .., dockerfile: docker/Dockerfile }
    command: ["--listen", "0.0.0.0:8080"]
    environment:
      TELECLAY_TOKEN: ${TELECLAY_TOKEN:?set it}
    ports: ["127.0.0.1:8080:8080"]
    volumes: ["data:/data"]
  handle:
    image: teleclay
    depends_on:
      server: { condition: service_healthy }
volumes:
  data: {}
"#;

    fn complaints(text: &str) -> String {
        mistakes(&parse(text).unwrap(), |name| name == "../docker/Dockerfile").join("\n")
    }

    #[test]
    fn a_sound_file_has_no_mistakes() {
        assert_eq!(complaints(GOOD), "");
    }

    #[test]
    fn each_mistake_is_found() {
        for (right, wrong, word) in [
            ("docker/Dockerfile", "docker/Dokcerfile", "does not exist"),
            ("127.0.0.1:8080:8080", "8080:8080", "beyond this machine"),
            (":?set it", "", "TELECLAY_TOKEN"),
            ("service_healthy", "service_started", "healthy"),
            ("server: { condition", "sever: { condition", "sever"),
            ("image: teleclay", "restart: always", "neither"),
            ("data:/data", "dat:/data", "volume dat"),
            ("services:", "service:", "no services"),
        ] {
            let text = GOOD.replace(right, wrong);
            assert_ne!(text, GOOD);
            assert!(
                complaints(&text).contains(word),
                "{word}: {}",
                complaints(&text)
            );
        }
    }

    #[test]
    fn an_address_in_the_environment_needs_the_token_as_well() {
        let text = GOOD
            .replace(r#"["--listen", "0.0.0.0:8080"]"#, "[]")
            .replace(
                "TELECLAY_TOKEN: ${TELECLAY_TOKEN:?set it}",
                "TELECLAY_LISTEN: '[::]:8080'",
            );
        assert!(complaints(&text).contains("TELECLAY_TOKEN"));
    }

    #[test]
    fn what_is_no_yaml_or_says_a_thing_twice_is_refused() {
        assert!(parse("a: [1, 2").is_err());
        assert!(parse("").is_err());
        let error = parse("a: 1\nb: 2\na: 3\n").unwrap_err().to_string();
        assert!(error.contains("a stands there twice"), "{error}");
    }
}
