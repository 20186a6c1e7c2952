//! `teleclay-server`: see `--help`.

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::process::ExitCode;
use std::time::Duration;

use teleclay_server::api;
use teleclay_server::settings::{Arguments, Aside, Settings};

fn main() -> ExitCode {
    // Before any thread exists.
    teleclay_shell::network::prepare_runtime();
    let arguments = Arguments::of_this_process();
    if let Some(aside) = &arguments.aside {
        let done = match aside {
            Aside::Offline(offline) => offline.run(&api::description(env!("CARGO_PKG_VERSION"))),
            Aside::Invite(command) => command.run(&mut std::io::stdout().lock()),
            Aside::Invites(command) => command.run(&mut std::io::stdout().lock()),
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
            Err(error) => failed(&error),
        };
    }
    let filter = tracing_subscriber::EnvFilter::try_from_env("TELECLAY_LOG").unwrap_or_else(|_| {
        tracing_subscriber::EnvFilter::new(
            "info,zenoh=error,zenoh_link_commons::quic=warn,zenoh_link_tls=warn",
        )
    });
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .init();
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

/// For containers, which have no curl: one request by hand.
fn check_health(address: SocketAddr) -> anyhow::Result<()> {
    const PATIENCE: Duration = Duration::from_secs(3);
    let host = if address.ip().is_unspecified() {
        SocketAddr::from(([127, 0, 0, 1], address.port()))
    } else {
        address
    };
    let mut stream = TcpStream::connect_timeout(&host, PATIENCE)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.write_all(
        format!("GET /healthz HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").as_bytes(),
    )?;
    let mut answer = String::new();
    stream.take(4096).read_to_string(&mut answer)?;
    let status = answer.lines().next().unwrap_or_default();
    anyhow::ensure!(status.contains(" 200 "), "{host} answered `{status}`");
    Ok(())
}
