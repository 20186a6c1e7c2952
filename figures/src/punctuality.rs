//! How late the 1 kHz thread starts while it steps a loop, beside a thread that only sleeps until the same kind of
//! deadline.

use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Duration;

use teleclay_shell::ticker::{Next, Scheduling, Ticker, TickerConfig};

use crate::compute::Working;
use crate::row::{Row, quantile};

const TICKS: usize = 8_000;

pub(crate) fn rows() -> anyhow::Result<Vec<Row>> {
    // Both at once, so that both meet the same disturbances.
    let mut working = Working::new()?;
    let (busy, busy_ticks) = ticker("figures-loop", Duration::ZERO, move || working.tick())?;
    let (bare, bare_ticks) = ticker("figures-bare", Duration::ZERO, || ())?;
    let (mut busy_times, mut bare_times) = (collect(&busy_ticks), collect(&bare_ticks));
    drop((busy, bare));

    let mut working = Working::new()?;
    let (spinning, spinning_ticks) =
        ticker("figures-spin", Duration::from_micros(200), move || {
            working.tick()
        })?;
    let mut spinning_times = collect(&spinning_ticks);
    drop(spinning);

    let (bare_p50, bare_p999) = (
        quantile(&mut bare_times, 0.5),
        quantile(&mut bare_times, 0.999),
    );
    Ok(vec![
        Row::new(
            "thread_lateness_p50_s",
            "s",
            1.1 * bare_p50,
            quantile(&mut busy_times, 0.5),
        )
        .beside(bare_p50),
        Row::new(
            "thread_lateness_p999_s",
            "s",
            1.1 * bare_p999,
            quantile(&mut busy_times, 0.999),
        )
        .beside(bare_p999),
        Row::new(
            "thread_lateness_spinning_p99_s",
            "s",
            50e-6,
            quantile(&mut spinning_times, 0.99),
        ),
    ])
}

/// A 1 kHz thread that does `work` each tick and tells how late each one started, ns.
fn ticker(
    name: &'static str,
    spin: Duration,
    mut work: impl FnMut() + Send + 'static,
) -> anyhow::Result<(Ticker, Receiver<u64>)> {
    let (lateness, told) = sync_channel(TICKS);
    let config = TickerConfig {
        name,
        period: Duration::from_millis(1),
        scheduling: Scheduling::Fifo,
        spin,
    };
    let ticker = Ticker::spawn(config, move |tick| {
        work();
        // It fails once enough are collected.
        if lateness.try_send(tick.lateness.as_nanos() as u64).is_ok() {
            Next::Continue
        } else {
            Next::Stop
        }
    })?;
    Ok((ticker, told))
}

fn collect(told: &Receiver<u64>) -> Vec<u64> {
    told.iter().take(TICKS).collect()
}
