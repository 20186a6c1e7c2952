//! `teleclay-figures`: measures what this machine reaches, beside the bare floor of the same run.
//!
//! Every row has a stable name, a unit, a target, what was measured, and, where there is one, the floor: what the
//! machine gives to a program that does nothing else. Times are quantiles of many repetitions; compare rows of one run,
//! not runs of two days.

mod channel;
mod compute;
mod cost;
mod network;
mod punctuality;
mod robot;
mod row;
mod steal;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;

use crate::row::Row;

/// Measures what this machine reaches.
#[derive(Parser)]
#[command(name = "teleclay-figures", version)]
struct Arguments {
    /// Write the rows as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Leave out the rows that need the server, the handle and Zenoh
    #[arg(long)]
    compute_only: bool,
    /// Answer Zenoh messages on this endpoint until the parent ends (used by the program itself)
    #[arg(long, hide = true)]
    echo_zenoh: Option<String>,
    /// Answer Zenoh messages of several lines on this endpoint until the parent ends (used by the program itself)
    #[arg(long, hide = true)]
    echo_lines: Option<String>,
    /// Call on this line of those, instead of answering (used by the program itself)
    #[arg(long, hide = true, requires = "echo_lines")]
    call_line: Option<usize>,
    /// Leave out everything but what live sessions cost their server
    #[arg(long, conflicts_with = "compute_only")]
    cost_only: bool,
    /// Answer UDP packets on this address until the parent ends (used by the program itself)
    #[arg(long, hide = true)]
    echo_udp: Option<std::net::SocketAddr>,
}

fn main() -> ExitCode {
    // Before any thread exists.
    teleclay_shell::network::prepare_runtime();
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            row::complain(&format!("teleclay-figures: {error:#}"));
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> anyhow::Result<()> {
    if let Some(endpoint) = &arguments.echo_zenoh {
        return network::echo_zenoh(endpoint);
    }
    if let Some(endpoint) = &arguments.echo_lines {
        return match arguments.call_line {
            Some(line) => cost::call_line(endpoint, line),
            None => cost::echo_lines(endpoint),
        };
    }
    if let Some(address) = arguments.echo_udp {
        return network::echo_udp(address);
    }
    let before = steal::read();
    let mut rows = Vec::new();
    let mut add = |title: &str, measured: Vec<Row>| {
        row::heading(title);
        for row in &measured {
            row::print(row);
        }
        rows.extend(measured);
    };
    if !arguments.cost_only {
        add("clay", compute::clay()?);
        add("loop", compute::tool_side()?);
        add("channel", channel::rows());
        add("robot", robot::rows()?);
        add("virtual time", compute::virtual_time()?);
        add("1 kHz thread", punctuality::rows()?);
    }
    if !(arguments.compute_only || arguments.cost_only) {
        add("network", network::rows()?);
    }
    if !arguments.compute_only {
        add("live sessions", cost::rows()?);
    }
    let stolen = steal::share_since(before);
    add(
        "machine",
        vec![Row::new("machine_steal_share", "1", 0.01, stolen)],
    );
    if let Some(file) = &arguments.json {
        std::fs::write(file, serde_json::to_vec_pretty(&rows)?)?;
    }
    row::close(&rows, stolen);
    Ok(())
}
