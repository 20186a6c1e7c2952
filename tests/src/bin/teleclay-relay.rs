//! A bad network between two programs: see `teleclay-relay --help`.

use std::net::SocketAddr;

use clap::Parser;
use teleclay_tests::relay::{Config, Line, run};

/// Relays UDP datagrams as a bad network would, seeded, each direction apart.
///
/// Standard input takes `up …` and `down …` (as --up and --down), `cut`, `mend`, and `report`; each is answered with a
/// line.
#[derive(Debug, Parser)]
struct Arguments {
    /// Where datagrams come in
    #[arg(long)]
    listen: SocketAddr,
    /// Where they go
    #[arg(long)]
    to: SocketAddr,
    /// Of its chance
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Towards the server, such as "delay_ms=20 jitter_ms=5 loss=0.05 duplicate=0.1 reorder=0.1"
    #[arg(long, default_value = "")]
    up: Line,
    /// Towards the handle
    #[arg(long, default_value = "")]
    down: Line,
}

fn main() -> anyhow::Result<()> {
    let Arguments {
        listen,
        to,
        seed,
        up,
        down,
    } = Arguments::parse();
    run(&Config {
        listen,
        to,
        seed,
        up,
        down,
    })
}
