//! `teleclay-server`: see `--help`.

use std::io::Write as _;
use std::process::ExitCode;

use teleclay_front::check_health;
use teleclay_server::api;
use teleclay_server::settings::{Arguments, Aside, Settings};
use teleclay_shell::log::{self, LogFormat};

fn main() -> ExitCode {
    // Before any thread exists.
    teleclay_shell::network::prepare_runtime();
    let arguments = Arguments::of_this_process();
    if let Some(aside) = &arguments.aside {
        let done = match aside {
            Aside::Offline(offline) => offline.run(&api::description(env!("CARGO_PKG_VERSION"))),
            Aside::Invite(command) => command.run(&mut std::io::stdout().lock()),
            Aside::Invites(command) => command.run(&mut std::io::stdout().lock()),
            Aside::History(command) => command.run(&mut std::io::stdout().lock()),
        };
        return match done {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => failed(&error),
        };
    }
    let settings = match Settings::read(&arguments) {
        Ok(settings) => settings,
        Err(error) => return failed(&error),
    };
    if arguments.health_check {
        return match check_health(settings.listen) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => failed(&error.into()),
        };
    }
    let filter = tracing_subscriber::EnvFilter::try_from_env("TELECLAY_LOG").unwrap_or_else(|_| {
        tracing_subscriber::EnvFilter::new(
            "info,zenoh=error,zenoh_link_commons::quic=warn,zenoh_link_tls=warn",
        )
    });
    match settings.log_format {
        LogFormat::Text => tracing_subscriber::fmt()
            .with_env_filter(filter)
            .with_writer(std::io::stderr)
            .init(),
        LogFormat::Json => log::write_json(filter),
    }
    let runtime = match tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
    {
        Ok(runtime) => runtime,
        Err(error) => return failed(&error.into()),
    };
    match runtime.block_on(teleclay_server::run(settings)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => failed(&error),
    }
}

fn failed(error: &anyhow::Error) -> ExitCode {
    // Nothing can be done about a standard error that is closed.
    let _ = writeln!(std::io::stderr(), "teleclay-server: {error:#}");
    ExitCode::FAILURE
}
