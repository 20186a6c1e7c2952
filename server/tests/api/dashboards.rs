//! What lies in `ops/` for Prometheus and Grafana: each figure that it names is told, under labels that it has, and
//! Prometheus understands each expression.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::metrics::{PROMTOOL, families};
use crate::rig::{Rig, eventually, small};
use crate::stream::Stream;

/// What the names of our figures begin with.
const PREFIX: &str = "teleclay_";

fn ops(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../ops");
    std::fs::read_to_string(folder.join(name)).unwrap()
}

/// Every expression of the dashboard, with what Grafana puts into it.
fn of_the_dashboard() -> Vec<String> {
    fn collect(value: &Value, found: &mut Vec<String>) {
        match value {
            Value::Array(values) => values.iter().for_each(|value| collect(value, found)),
            Value::Object(fields) => {
                for (name, value) in fields {
                    match value {
                        Value::String(text) if name == "expr" => found.push(text.clone()),
                        _ => collect(value, found),
                    }
                }
            }
            _ => {}
        }
    }
    let dashboard: Value = serde_json::from_str(&ops("grafana.json")).unwrap();
    let mut found = Vec::new();
    collect(&dashboard, &mut found);
    let filled = found.iter().map(|expression| {
        let filled = expression
            .replace("$session", ".*")
            .replace("$__rate_interval", "1m");
        assert!(
            !filled.contains('$'),
            "{expression} has a variable that is not known here"
        );
        filled
    });
    filled.collect()
}

fn of_the_alerts() -> Vec<String> {
    let alerts = ops("alerts.yaml");
    let expressions = alerts
        .lines()
        .filter_map(|line| line.trim().strip_prefix("expr: "));
    expressions.map(str::to_owned).collect()
}

/// A figure that an expression names, and its matchers: label, operator, value.
#[derive(Debug)]
struct Selector<'a> {
    name: &'a str,
    matchers: Vec<(&'a str, &'a str, &'a str)>,
}

fn selectors(expression: &str) -> Vec<Selector<'_>> {
    let starts = expression.match_indices(PREFIX).map(|(at, _)| at);
    let selectors = starts.map(|at| {
        let rest = &expression[at..];
        let end = rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
        let (name, rest) = rest.split_at(end.unwrap_or(rest.len()));
        let labels = rest
            .strip_prefix('{')
            .map(|rest| rest.split_once('}').unwrap().0);
        let matchers = labels
            .into_iter()
            .flat_map(|labels| labels.split(','))
            .map(|matcher| {
                let at = matcher.find(['=', '!']).unwrap();
                let (label, rest) = matcher.split_at(at);
                let (operator, value) = rest.split_once('"').unwrap();
                (label.trim(), operator.trim(), value.trim_end_matches('"'))
            });
        Selector {
            name,
            matchers: matchers.collect(),
        }
    });
    selectors.collect()
}

#[test]
fn every_figure_that_dashboard_and_alerts_name_is_told_under_those_labels() {
    let rig = Rig::start();
    let site = rig.site();
    assert_eq!(site.post("/api/v1/sessions", &small("one")).status, 201);
    // Some are told only once there is something to tell.
    let _watching = Stream::open(&site, "one");
    Stream::open(&site, "one").leave();
    let shown = || site.get("/metrics").text().to_owned();
    eventually("a stream to have ended", || {
        shown().contains("teleclay_streams_ended_total{")
    });
    let shown = shown();
    let families = families(&shown);
    let expressions = [of_the_dashboard(), of_the_alerts()].concat();
    assert!(30 < expressions.len(), "{}", expressions.len());
    let mut named = BTreeSet::new();
    for expression in &expressions {
        for Selector { name, matchers } in selectors(expression) {
            let family = families
                .get(name)
                .unwrap_or_else(|| panic!("{expression}: nobody tells {name}"));
            for (label, operator, value) in matchers {
                let mut values = family
                    .series
                    .iter()
                    .filter_map(|(labels, _)| labels.get(label));
                assert!(
                    values.next().is_some(),
                    "{expression}: {name} has no label {label}"
                );
                // What a status or a route may be is not known from here.
                let is_closed = operator == "=" && matches!(label, "state" | "part");
                let mut values = family
                    .series
                    .iter()
                    .filter_map(|(labels, _)| labels.get(label));
                assert!(
                    !is_closed || values.any(|told| told == value),
                    "{expression}: no {label} is {value}"
                );
            }
            named.insert(name.to_owned());
        }
    }
    // The other way round: what is told is shown, but for what only says which server it is.
    let unseen: Vec<&String> = families
        .keys()
        .filter(|name| !named.contains(*name))
        .collect();
    let known = [
        "teleclay_build_info",
        "teleclay_clay_epoch_total",
        "teleclay_loop_running",
        "teleclay_loop_ticks_total",
        "teleclay_uptime_seconds",
        "teleclay_zenoh_up",
    ];
    assert_eq!(unseen, known);
}

#[test]
fn prometheus_understands_every_expression() {
    let program = std::env::var(PROMTOOL).unwrap_or_else(|_| "promtool".to_owned());
    let mut rules = "groups:\n  - name: dashboard\n    rules:\n".to_owned();
    for (number, expression) in of_the_dashboard().iter().enumerate() {
        let expression = serde_json::to_string(expression).unwrap();
        let _ = writeln!(
            rules,
            "      - record: shown:number_{number}\n        expr: {expression}"
        );
    }
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    for (name, text) in [
        ("dashboard.yaml", rules),
        ("alerts.yaml", ops("alerts.yaml")),
    ] {
        let path = folder.join(format!("{}-{name}", std::process::id()));
        std::fs::write(&path, text).unwrap();
        let said = match Command::new(&program)
            .args(["check", "rules"])
            .arg(&path)
            .output()
        {
            Ok(said) => said,
            Err(error) => {
                assert!(std::env::var(PROMTOOL).is_err(), "{program}: {error}");
                println!("{program} is not installed: {error}");
                return;
            }
        };
        let words = String::from_utf8_lossy(&[said.stdout, said.stderr].concat()).into_owned();
        assert!(
            said.status.success() && words.contains("SUCCESS"),
            "{words}"
        );
    }
}
