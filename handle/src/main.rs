//! `teleclay-handle`: see `teleclay-handle --help`.

use std::io::{self, IsTerminal, Write};
use std::process::ExitCode;
use std::time::Duration;

use serde::Serialize;
use teleclay_handle::arguments::Arguments;
use teleclay_handle::device::list::list;
use teleclay_handle::device::{DeviceChoice, Opening};
use teleclay_handle::door::Door;
use teleclay_handle::event::{Event, Weight};
use teleclay_handle::intent::Intent;
use teleclay_handle::recording::Recording;
use teleclay_handle::run;
use teleclay_handle::run::{Ending, Options, Until};
use teleclay_handle::status::Status;
use teleclay_shell::log::{self, LogFormat};
use teleclay_shell::network;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc::{self, UnboundedReceiver};
use tokio::sync::watch;
use tokio::time::Instant;
use tracing::{debug, error, info, warn};
use tracing_subscriber::EnvFilter;

/// As sysexits has it, so that it differs from every end of a run.
const USAGE: u8 = 64;
/// Like a shell that was interrupted: for whoever cannot wait for the handle to come to rest.
const INTERRUPTED: i32 = 130;

fn main() -> ExitCode {
    network::prepare_runtime();
    let (arguments, intent) = match Arguments::read() {
        Ok(read) => read,
        Err(error) => {
            // A terminal that is gone cannot be told.
            let _ = error.print();
            return if error.use_stderr() {
                ExitCode::from(USAGE)
            } else {
                ExitCode::SUCCESS
            };
        }
    };
    if arguments.device == DeviceChoice::List {
        let listed = list(&arguments.haply());
        // A terminal that is gone cannot be told.
        let _ = io::stdout().write_all(listed.as_bytes());
        return ExitCode::SUCCESS;
    }
    let filter = match EnvFilter::try_new(&arguments.log) {
        Ok(filter) => filter,
        Err(error) => {
            complain(&format!("--log {}: {error}", arguments.log));
            return ExitCode::from(USAGE);
        }
    };
    match arguments.log_format {
        LogFormat::Text => tracing_subscriber::fmt()
            .with_env_filter(filter)
            .with_target(false)
            .with_ansi(io::stderr().is_terminal())
            .with_writer(io::stderr)
            .init(),
        LogFormat::Json => log::write_json(filter),
    }
    // Zenoh has threads of its own; here are one for the run and one for the signals and what it tells.
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build();
    match runtime {
        Ok(runtime) => runtime.block_on(hold(arguments, intent)),
        Err(error) => {
            error!("no runtime: {error}");
            ExitCode::FAILURE
        }
    }
}

async fn hold(arguments: Arguments, intent: Intent) -> ExitCode {
    let (stop, stopped) = watch::channel(false);
    let mut signals = match (
        signal(SignalKind::interrupt()),
        signal(SignalKind::terminate()),
    ) {
        (Ok(interrupt), Ok(terminate)) => [interrupt, terminate],
        (Err(error), _) | (_, Err(error)) => {
            error!("no signals: {error}");
            return ExitCode::FAILURE;
        }
    };
    let stop_on_signal = stop.clone();
    tokio::spawn(async move {
        let [interrupt, terminate] = &mut signals;
        tokio::select! { _ = interrupt.recv() => {}, _ = terminate.recv() => {} }
        stop_on_signal.send_replace(true);
        tokio::select! { _ = interrupt.recv() => {}, _ = terminate.recv() => {} }
        std::process::exit(INTERRUPTED);
    });

    let recording = match arguments.record.as_deref().map(Recording::create) {
        None => None,
        Some(Ok(recording)) => Some(recording),
        Some(Err(error)) => {
            let path = arguments.record.unwrap_or_default();
            error!("--record {}: {error}", path.display());
            return ExitCode::FAILURE;
        }
    };
    let (events, emitted) = mpsc::unbounded_channel();
    // People have typed its name, and need not read it in every line.
    let session = (arguments.log_format == LogFormat::Json).then(|| arguments.session.to_string());
    let told = session.clone();
    let printer = tokio::spawn(print(emitted, arguments.json, stop, told));
    let kind = arguments.device.kind();
    let profile = arguments.profile();
    let opening = Opening {
        kind,
        intent,
        profile,
        haply: arguments.haply(),
    };
    let options = Options {
        operator: arguments.operator_name(),
        door: Door {
            endpoint: arguments.connect,
            fingerprint: arguments.fingerprint,
        },
        invite: arguments.invite.map(|invite| invite.token.id()),
        session: arguments.session,
        realm: arguments.realm,
        token: arguments.token,
        device: kind.word().to_owned(),
        profile,
        waits_out_stops: arguments.resume_after_stop || kind.is_held(),
        open_device: Box::new(move |setup| opening.open(setup)),
        scheduling: arguments.scheduling,
        spin: Duration::from_micros(arguments.spin_us),
        clock_drift: arguments.clock_drift_ppm,
        recording,
    };
    let until = Until {
        stop: stopped,
        deadline: arguments.seconds.map(|seconds| Instant::now() + seconds),
    };
    let Ending { summary, outcome } = run(options, until, events).await;
    // The channel closed with the run, so the printer ends; it cannot panic.
    let _ = printer.await;

    let line = if arguments.json {
        json("summary", &summary)
    } else {
        format!("{summary}\n")
    };
    // The exit code says how it ended even when nobody reads.
    let _ = io::stdout().write_all(line.as_bytes());
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            error!(session, "{failure}");
            ExitCode::from(failure.exit_code())
        }
    }
}

/// Puts events where they belong: status lines to stdout, the rest to the log.
async fn print(
    mut emitted: UnboundedReceiver<Event>,
    as_json: bool,
    stop: watch::Sender<bool>,
    session: Option<String>,
) {
    let session = session.as_deref();
    while let Some(event) = emitted.recv().await {
        match event {
            Event::Status(status) if as_json => {
                if io::stdout()
                    .write_all(json("status", &status).as_bytes())
                    .is_err()
                {
                    // Whoever read the lines has gone, and the handle was held for them.
                    stop.send_replace(true);
                }
            }
            event => match event.weight() {
                Weight::Warning => warn!(session, "{event}"),
                Weight::Notice => info!(session, "{event}"),
                Weight::Detail => debug!(session, "{event}"),
            },
        }
    }
}

#[derive(Serialize)]
struct Line<'a> {
    kind: &'static str,
    #[serde(flatten)]
    status: &'a Status,
}

fn json(kind: &'static str, status: &Status) -> String {
    let line = serde_json::to_string(&Line { kind, status })
        .expect("a status has no maps and no values that JSON lacks");
    line + "\n"
}

fn complain(what: &str) {
    // A terminal that is gone cannot be told.
    let _ = writeln!(io::stderr(), "error: {what}");
}
