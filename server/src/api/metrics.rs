//! `/metrics`, in Prometheus' text format.
//!
//! Every scrape writes what is true now into a recorder of its own. So a session that has ended leaves no series
//! behind, and nothing is kept between scrapes that could grow.

use std::fmt::Write as _;

use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;
use metrics::{Label, Unit, counter, describe_counter, describe_gauge, gauge, with_local_recorder};
use metrics_exporter_prometheus::PrometheusBuilder;
use teleclay_proto::http::{
    LoopState, Quantiles, Session, SessionState, StorageState, TickQuantiles,
};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::openapi::refusals;
use super::{Api, MAX_WATCHERS};
use crate::directory::ThreadReport;

/// The media type that Prometheus asks for.
const MEDIA_TYPE: &str = "text/plain; version=0.0.4; charset=utf-8";

/// The call of this module.
pub(crate) fn routes() -> OpenApiRouter<Api> {
    OpenApiRouter::new().routes(routes!(metrics))
}

refusals!(MetricsRefusals:);

/// Figures for Prometheus
#[utoipa::path(
    get, path = "/metrics", tag = "probes",
    responses(
        (status = 200, description = "Prometheus' text format, version 0.0.4", body = String, content_type = "text/plain"),
        MetricsRefusals,
    ),
)]
async fn metrics(State(api): State<Api>) -> impl IntoResponse {
    ([(header::CONTENT_TYPE, MEDIA_TYPE)], render(&api))
}

fn render(api: &Api) -> String {
    let recorder = PrometheusBuilder::new().build_recorder();
    let (sessions, threads) = (api.directory().sessions(), api.directory().threads());
    with_local_recorder(&recorder, || {
        describe();
        write_server(api);
        write_threads(&threads);
        sessions.iter().for_each(write_session);
    });
    let mut text = recorder.handle().render();
    write_lateness(&threads, &mut text);
    write_summaries(&sessions, &mut text);
    text
}

/// Quantiles that are known already. The recorder would take them of samples of its own; so these are written by hand.
/// They are of the last few seconds, of which nobody could add up a sum or a count over time: there is none.
fn write_summaries(sessions: &[Session], text: &mut String) {
    for (name, meaning, quantiles) in SUMMARIES {
        if sessions.is_empty() {
            continue;
        }
        // Writing to a String cannot fail.
        let _ = write!(text, "# HELP {name} {meaning}\n# TYPE {name} summary\n");
        for session in sessions {
            // A name has no character that a label would have to escape.
            let id = &session.id;
            for (quantile, value) in quantiles(&session.control_loop) {
                let _ = writeln!(
                    text,
                    "{name}{{session=\"{id}\",quantile=\"{quantile}\"}} {value}"
                );
            }
        }
        text.push('\n');
    }
}

fn write_lateness(threads: &[ThreadReport], text: &mut String) {
    const NAME: &str = "teleclay_lateness_seconds";
    const MEANING: &str = "How long after its time a tick of a thread started, over the last 5 to 10 seconds; quantile 1 is the greatest";
    // Writing to a String cannot fail.
    let _ = write!(text, "# HELP {NAME} {MEANING}\n# TYPE {NAME} summary\n");
    for (thread, report) in threads.iter().enumerate() {
        for (quantile, value) in tick_quantiles(&report.lateness) {
            let _ = writeln!(
                text,
                "{NAME}{{thread=\"{thread}\",quantile=\"{quantile}\"}} {value}"
            );
        }
    }
    text.push('\n');
}

/// There are as many labels as threads, eight at most.
fn write_threads(threads: &[ThreadReport]) {
    for (thread, report) in threads.iter().enumerate() {
        let labels = || [("thread", thread.to_string())];
        gauge!("teleclay_thread_load_ratio", &labels()).set(report.load);
        gauge!("teleclay_thread_sessions", &labels()).set(report.sessions as f64);
        gauge!("teleclay_thread_rate_hertz", &labels()).set(report.rate_hz);
        counter!("teleclay_thread_late_ticks_total", &labels()).absolute(report.late_ticks);
    }
}

fn tick_quantiles(of: &TickQuantiles) -> Vec<(&'static str, f64)> {
    vec![
        ("0.5", of.p50),
        ("0.99", of.p99),
        ("0.999", of.p999),
        ("1", of.max),
    ]
}

type Summary = (
    &'static str,
    &'static str,
    fn(&LoopState) -> Vec<(&'static str, f64)>,
);

/// Name, meaning and quantiles of each summary.
const SUMMARIES: [Summary; 4] = [
    (
        "teleclay_tick_seconds",
        "What a tick of all sessions on the session's thread takes to compute, over the last 5 to 10 seconds; quantile 1 is the greatest",
        |state| tick_quantiles(&state.tick_s),
    ),
    (
        "teleclay_session_tick_seconds",
        "What a tick of the session alone takes of its processor, over the last 5 to 10 seconds; quantile 1 is the greatest",
        |state| tick_quantiles(&state.own_tick_s),
    ),
    (
        "teleclay_rtt_seconds",
        "Round trip, over the last 5 to 10 seconds",
        |state| median_and_tail(state.rtt_s),
    ),
    (
        "teleclay_frame_age_seconds",
        "Age of the newest frame whenever a tick used it, over the last 5 to 10 seconds",
        |state| median_and_tail(state.age_s),
    ),
];

fn median_and_tail(quantiles: Quantiles) -> Vec<(&'static str, f64)> {
    vec![("0.5", quantiles.p50), ("0.99", quantiles.p99)]
}

fn write_server(api: &Api) {
    let config = api.config();
    let labels = [
        ("version", config.version.clone()),
        ("node", config.node.to_string()),
    ];
    gauge!("teleclay_build_info", &labels).set(1.0);
    gauge!("teleclay_uptime_seconds").set(config.started.elapsed().as_secs_f64());
    let readiness = api.directory().readiness();
    gauge!("teleclay_ready").set(one_if(readiness.ready));
    gauge!("teleclay_loop_running").set(one_if(readiness.loop_running));
    gauge!("teleclay_zenoh_up").set(one_if(readiness.zenoh_up));

    let refusals = api.directory().tick_time_refusals();
    counter!("teleclay_tick_time_refusals_total").absolute(refusals);

    let counts = api.metrics();
    for (answered, count) in counts.answered() {
        let labels = [
            ("method", answered.method.to_owned()),
            ("route", answered.route.to_string()),
            ("status", answered.status.to_string()),
        ];
        counter!("teleclay_http_requests_total", &labels).absolute(count);
    }
    for (session, count) in counts.watchers() {
        gauge!("teleclay_watchers", "session" => session.to_string()).set(count as f64);
    }
    gauge!("teleclay_foxglove_clients").set(counts.visitors() as f64);
    gauge!("teleclay_watchers_limit").set(MAX_WATCHERS as f64);
    for (reason, count) in counts.ended() {
        counter!("teleclay_streams_ended_total", "reason" => reason).absolute(count);
    }
    counter!("teleclay_stream_sent_bytes_total").absolute(counts.sent_bytes());
    counter!("teleclay_stream_dropped_samples_total").absolute(counts.dropped());
    counter!("teleclay_stream_forgotten_frames_total").absolute(counts.forgotten());

    if let Some(ros2) = &config.ros2 {
        gauge!("teleclay_ros2_router_up").set(one_if(ros2.router_is_up()));
        gauge!("teleclay_ros2_mismatched_ends").set(ros2.strangers() as f64);
        counter!("teleclay_ros2_messages_total").absolute(ros2.messages());
        counter!("teleclay_ros2_missed_samples_total").absolute(ros2.missed());
    }
}

fn write_session(session: &Session) {
    let name = Label::new("session", session.id.to_string());
    let labels = || vec![name.clone()];
    let with = |key: &'static str, value: &'static str| vec![name.clone(), Label::new(key, value)];

    for (word, state) in [
        ("idle", SessionState::Idle),
        ("running", SessionState::Running),
        ("paused", SessionState::Paused),
        ("fault", SessionState::Fault),
        ("stopped", SessionState::Stopped),
    ] {
        gauge!("teleclay_session_state", with("state", word)).set(one_if(session.state == state));
    }
    gauge!(
        "teleclay_session_scheme",
        with("scheme", session.scheme.word())
    )
    .set(1.0);
    let connected = session.tools.iter().filter(|tool| tool.connected).count();
    gauge!("teleclay_operators", labels()).set(connected as f64);
    gauge!("teleclay_coordination_metres", labels()).set(session.coordination_m);

    let clay = &session.clay;
    for (part, volume_m3) in [
        ("initial", clay.initial_volume_m3),
        ("remaining", clay.remaining_volume_m3),
        ("removed", clay.removed_volume_m3),
    ] {
        gauge!("teleclay_clay_volume_cubic_metres", with("part", part)).set(volume_m3);
    }
    counter!("teleclay_clay_epoch_total", labels()).absolute(clay.epoch.into());

    let control_loop = &session.control_loop;
    gauge!("teleclay_loop_rate_hertz", labels()).set(control_loop.rate_hz);
    gauge!("teleclay_session_thread", labels()).set(f64::from(control_loop.thread));
    gauge!("teleclay_session_budget_ratio", labels()).set(control_loop.budget_share);
    counter!("teleclay_loop_ticks_total", labels()).absolute(control_loop.ticks);
    counter!("teleclay_loop_late_ticks_total", labels()).absolute(control_loop.late_ticks);
    counter!("teleclay_frames_lost_total", labels()).absolute(control_loop.lost);
    counter!("teleclay_frames_duplicate_total", labels()).absolute(control_loop.duplicates);
    counter!("teleclay_frames_reordered_total", labels()).absolute(control_loop.reordered);
    counter!("teleclay_messages_unheard_total", labels()).absolute(control_loop.unheard);
    for (direction, per_s) in [
        ("up", control_loop.packets_up_per_s),
        ("down", control_loop.packets_down_per_s),
    ] {
        gauge!("teleclay_packets_per_second", with("direction", direction)).set(per_s);
    }
    gauge!("teleclay_link_energy_joules", labels()).set(control_loop.energy_j);

    let storage = &session.storage;
    for (word, state) in [
        ("durable", StorageState::Durable),
        ("behind", StorageState::Behind),
        ("failed", StorageState::Failed),
        ("ephemeral", StorageState::Ephemeral),
    ] {
        gauge!("teleclay_storage_state", with("state", word)).set(one_if(storage.state == state));
    }
    gauge!("teleclay_storage_bytes", labels()).set(storage.bytes as f64);
    counter!("teleclay_revision_total", labels()).absolute(session.revision);
    counter!("teleclay_durable_revision_total", labels()).absolute(storage.durable_revision);
}

fn describe() {
    for (name, unit, text) in GAUGES {
        describe_gauge!(*name, *unit, *text);
    }
    for (name, text) in COUNTERS {
        describe_counter!(*name, Unit::Count, *text);
    }
}

/// Name, unit and meaning of each gauge.
const GAUGES: &[(&str, Unit, &str)] = &[
    (
        "teleclay_build_info",
        Unit::Count,
        "1; the labels say what runs",
    ),
    (
        "teleclay_foxglove_clients",
        Unit::Count,
        "Clients of Foxglove's protocol that are connected",
    ),
    (
        "teleclay_uptime_seconds",
        Unit::Seconds,
        "Since the process started",
    ),
    (
        "teleclay_ready",
        Unit::Count,
        "1 when the loop runs and Zenoh is up",
    ),
    (
        "teleclay_loop_running",
        Unit::Count,
        "1 when the 1 kHz loop ticks",
    ),
    (
        "teleclay_zenoh_up",
        Unit::Count,
        "1 when the Zenoh session is open",
    ),
    (
        "teleclay_ros2_router_up",
        Unit::Count,
        "1 when the Zenoh router of ROS 2 is connected; only there with --ros2",
    ),
    (
        "teleclay_ros2_mismatched_ends",
        Unit::Count,
        "Ends of ROS 2 that have a topic or service of this server with another type or hash, so that neither hears the other",
    ),
    ("teleclay_watchers", Unit::Count, "Streams that are open"),
    (
        "teleclay_watchers_limit",
        Unit::Count,
        "Streams that may be open at once, of all sessions",
    ),
    (
        "teleclay_session_state",
        Unit::Count,
        "1 for the state that the session is in",
    ),
    (
        "teleclay_session_scheme",
        Unit::Count,
        "1 for the scheme that couples handle and tool",
    ),
    (
        "teleclay_operators",
        Unit::Count,
        "Operators whose frames come in",
    ),
    (
        "teleclay_coordination_metres",
        Unit::Count,
        "Greatest distance between a tool and where its handle would have it, at the instant of the handle's newest frame",
    ),
    (
        "teleclay_clay_volume_cubic_metres",
        Unit::Count,
        "Volume of the clay; initial = remaining + removed",
    ),
    (
        "teleclay_loop_rate_hertz",
        Unit::Count,
        "Ticks per second of the session's thread, counted over the last second or two",
    ),
    (
        "teleclay_session_thread",
        Unit::Count,
        "The tick thread that the session lives on, from 0",
    ),
    (
        "teleclay_session_budget_ratio",
        Unit::Count,
        "99th percentile of what the session's ticks take, in parts of what all sessions on a thread may take",
    ),
    (
        "teleclay_thread_load_ratio",
        Unit::Count,
        "What the sessions of a tick thread take together, in parts of what they may take; above 1 nobody else gets a tool there",
    ),
    (
        "teleclay_thread_sessions",
        Unit::Count,
        "Sessions that live on a tick thread",
    ),
    (
        "teleclay_thread_rate_hertz",
        Unit::Count,
        "Ticks per second of a tick thread, counted over the last second or two, those that it slept through included",
    ),
    (
        "teleclay_packets_per_second",
        Unit::Count,
        "Frames from handles (up) and to handles (down)",
    ),
    (
        "teleclay_link_energy_joules",
        Unit::Count,
        "Energy that entered the link less what left it; below zero it has made energy",
    ),
    (
        "teleclay_storage_state",
        Unit::Count,
        "1 for what has become of the session's history on disk",
    ),
    (
        "teleclay_storage_bytes",
        Unit::Count,
        "What the session's history takes on disk",
    ),
];

/// Name and meaning of each counter.
const COUNTERS: &[(&str, &str)] = &[
    ("teleclay_ros2_messages_total", "Messages told to ROS 2"),
    (
        "teleclay_ros2_missed_samples_total",
        "Samples that came faster than ROS 2 was told of them",
    ),
    ("teleclay_http_requests_total", "Requests answered"),
    (
        "teleclay_streams_ended_total",
        "Streams that have ended, by reason",
    ),
    (
        "teleclay_stream_sent_bytes_total",
        "Bytes of messages written to streams",
    ),
    (
        "teleclay_stream_dropped_samples_total",
        "Telemetry samples that watchers were too slow for",
    ),
    (
        "teleclay_stream_forgotten_frames_total",
        "Tool frames for hands on streams that were not read in time",
    ),
    ("teleclay_clay_epoch_total", "Fresh blocks of clay"),
    ("teleclay_loop_ticks_total", "Ticks since the session began"),
    (
        "teleclay_loop_late_ticks_total",
        "Ticks of the session that started more than a whole tick late",
    ),
    (
        "teleclay_thread_late_ticks_total",
        "Ticks of a tick thread that started more than a whole tick late",
    ),
    (
        "teleclay_tick_time_refusals_total",
        "Sessions and joins that were refused since there is no time for them",
    ),
    (
        "teleclay_frames_lost_total",
        "Frames from handles that had not come 128 frames later",
    ),
    (
        "teleclay_frames_duplicate_total",
        "Frames from handles that came more than once",
    ),
    (
        "teleclay_frames_reordered_total",
        "Frames from handles that came after a later one",
    ),
    (
        "teleclay_messages_unheard_total",
        "Messages for tools that no holder of one wrote, or that had come before",
    ),
    ("teleclay_revision_total", "Changes of the session"),
    (
        "teleclay_durable_revision_total",
        "Changes of the session that are on disk; 0 where nothing is kept",
    ),
];

fn one_if(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}
