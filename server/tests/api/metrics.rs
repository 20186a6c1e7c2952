//! The figures for Prometheus, as its own tools want them.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write as _;
use std::process::{Command, Stdio};

use crate::rig::shared;

/// Where `promtool` is, when it is not on the path.
pub(crate) const PROMTOOL: &str = "TELECLAY_PROMTOOL";

/// One family of figures.
#[derive(Debug, Default)]
pub(crate) struct Family {
    kind: String,
    help: String,
    /// Labels and value of each series.
    pub(crate) series: Vec<(BTreeMap<String, String>, f64)>,
}

/// Reads the text format, version 0.0.4, strictly.
pub(crate) fn families(text: &str) -> BTreeMap<String, Family> {
    let mut families: BTreeMap<String, Family> = BTreeMap::new();
    let mut seen = BTreeSet::new();
    for line in text.lines().filter(|line| !line.is_empty()) {
        if let Some(rest) = line.strip_prefix("# HELP ") {
            let (name, help) = rest.split_once(' ').unwrap();
            let family = families.entry(name.to_owned()).or_default();
            assert!(family.help.is_empty(), "{name} is described twice");
            family.help = help.to_owned();
        } else if let Some(rest) = line.strip_prefix("# TYPE ") {
            let (name, kind) = rest.split_once(' ').unwrap();
            let family = families.entry(name.to_owned()).or_default();
            assert!(
                family.kind.is_empty() && family.series.is_empty(),
                "{name} has its type late or twice"
            );
            family.kind = kind.to_owned();
        } else {
            let (series, value) = line.rsplit_once(' ').unwrap();
            assert!(seen.insert(series.to_owned()), "{series} comes twice");
            let (name, labels) = series.split_once('{').unwrap_or((series, "}"));
            let labels = labels.strip_suffix('}').unwrap();
            let labels = labels
                .split(',')
                .filter(|label| !label.is_empty())
                .map(|label| {
                    let (name, value) = label.split_once('=').unwrap();
                    let value = value
                        .strip_prefix('"')
                        .and_then(|value| value.strip_suffix('"'))
                        .unwrap();
                    (name.to_owned(), value.to_owned())
                });
            let family = families
                .get_mut(name)
                .unwrap_or_else(|| panic!("{name} has no type"));
            family
                .series
                .push((labels.collect(), value.parse().unwrap()));
        }
    }
    families
}

#[test]
fn figures_are_of_the_kind_that_their_names_and_labels_say() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    site.get("/nothing");
    let shown = site.get("/metrics");
    let media_type = shown.header("content-type").unwrap();
    assert!(media_type.starts_with("text/plain; version=0.0.4"));
    let families = families(shown.text());
    for (name, family) in &families {
        assert!(
            !family.help.is_empty() && !family.series.is_empty(),
            "{name}"
        );
        assert_eq!(
            name.ends_with("_total"),
            family.kind == "counter",
            "{name} is a {}",
            family.kind
        );
        let is_summary = family.kind == "summary";
        for (labels, value) in &family.series {
            assert_eq!(
                labels.contains_key("quantile"),
                is_summary,
                "{name} is a {}",
                family.kind
            );
            assert!(value.is_finite(), "{name}");
        }
    }
    let of_session = |name: &str| {
        let series = families
            .get(name)
            .unwrap_or_else(|| panic!("{name} is missing"))
            .series
            .iter();
        let own = series.filter(|(labels, _)| labels.get("session") == Some(&session));
        own.cloned().collect::<Vec<_>>()
    };
    for (name, count) in [
        ("teleclay_loop_rate_hertz", 1),
        ("teleclay_loop_ticks_total", 1),
        ("teleclay_loop_late_ticks_total", 1),
        ("teleclay_frames_lost_total", 1),
        ("teleclay_clay_volume_cubic_metres", 3),
        ("teleclay_ready", 0),
        ("teleclay_uptime_seconds", 0),
    ] {
        assert_eq!(of_session(name).len(), count, "{name}");
    }
    for (name, quantiles) in [
        ("teleclay_tick_seconds", &["0.5", "0.99", "0.999", "1"][..]),
        ("teleclay_rtt_seconds", &["0.5", "0.99"]),
        ("teleclay_frame_age_seconds", &["0.5", "0.99"]),
    ] {
        let own = of_session(name);
        let found: Vec<_> = own.iter().map(|(labels, _)| &*labels["quantile"]).collect();
        assert_eq!(found, quantiles, "{name}");
        assert!(own.is_sorted_by_key(|(_, value)| *value), "{name}: {own:?}");
    }
    let unknown = families["teleclay_http_requests_total"]
        .series
        .iter()
        .find(|(labels, _)| {
            (&*labels["method"], &*labels["route"], &*labels["status"]) == ("GET", "other", "404")
        });
    assert!(
        unknown.is_some_and(|(_, count)| 1.0 <= *count),
        "{}",
        shown.text()
    );
    site.delete(&format!("/api/v1/sessions/{session}"));
    let after = site.get("/metrics");
    let remnant = format!("\"{session}\"");
    assert!(
        !after.text().contains(&remnant),
        "an ended session leaves no series behind"
    );
}

/// `promtool` is Prometheus' own; where it is not installed, the test above stands alone, and this says so.
#[test]
fn promtool_has_nothing_to_say() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let shown = site.get("/metrics");
    site.delete(&format!("/api/v1/sessions/{session}"));
    let program = std::env::var(PROMTOOL).unwrap_or_else(|_| "promtool".to_owned());
    let mut promtool = match Command::new(&program)
        .args(["check", "metrics"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
    {
        Ok(promtool) => promtool,
        Err(error) => {
            assert!(std::env::var(PROMTOOL).is_err(), "{program}: {error}");
            println!("{program} is not installed: {error}");
            return;
        }
    };
    promtool
        .stdin
        .take()
        .unwrap()
        .write_all(&shown.body)
        .unwrap();
    let said = promtool.wait_with_output().unwrap();
    let words = [said.stdout, said.stderr].concat();
    let words = String::from_utf8_lossy(&words);
    assert!(said.status.success() && words.is_empty(), "{words}");
}
