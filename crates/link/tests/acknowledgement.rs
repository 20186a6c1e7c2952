//! How long a cut waits for its acknowledgement, whatever the line and the programs at its ends do: a thousand lines, a
//! minute of cutting on each.

#![allow(clippy::print_stdout, reason = "a test says what it measured")]

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use teleclay_link::conditioner::{Conditioner, Impairment, Overtaken};
use teleclay_link::replica::{Novelty, SweepInbox, SweepLog, WINDOW};
use teleclay_link::round_trip::{RoundTrip, of_exchange};
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::{Gaps, Sweeps};

const TICK: Duration = Duration::from_millis(1);
const LINES: u64 = 1000;
const MINUTE: u64 = 60_000;
/// Frames that a program takes in between two of its ticks at most; what comes on top of them is lost.
const RING: usize = 512;
/// Frames that wait to be sent; of more the oldest are lost.
const OUTBOX: usize = 64;
/// Ticks that a program makes up for at most after it was starved.
const MOST_BEHIND: u64 = 50;
/// Sweeps that are merged in a tick at most.
const MERGES: usize = 64;
/// Packets that are remembered until they arrive; no line here is as long.
const KEPT: usize = 8192;

/// What a packet carries, beside sweeps or what became of them.
#[derive(Clone, Copy, Default)]
struct Stamps {
    sent_ns: u64,
    echo_ns: u64,
    echo_hold_ns: u32,
}

#[derive(Clone, Copy, Default)]
struct Up {
    stamps: Stamps,
    sweeps: Sweeps,
}

#[derive(Clone, Copy, Default)]
struct Down {
    stamps: Stamps,
    acknowledged: u32,
    gaps: Gaps,
}

/// One direction: a line and what is on it. The line carries numbers, so that nothing large is sorted.
struct Way<M> {
    line: Conditioner<usize>,
    kept: Vec<M>,
    sent: usize,
    outbox: VecDeque<M>,
    ring: VecDeque<(Timestamp, M)>,
}

impl<M: Copy + Default> Way<M> {
    fn new(impairment: Impairment, seed: u64) -> Self {
        Self {
            line: Conditioner::new(impairment, seed, KEPT),
            kept: vec![M::default(); KEPT],
            sent: 0,
            outbox: VecDeque::new(),
            ring: VecDeque::new(),
        }
    }

    /// The sender's program puts a message into its outbox.
    fn put(&mut self, message: M) {
        if self.outbox.len() == OUTBOX {
            self.outbox.pop_front();
        }
        self.outbox.push_back(message);
    }

    /// The line takes what waits to be sent, and fills the ring of the receiver's program, if it listens yet.
    fn carry(&mut self, now: Timestamp, listens: bool) {
        while let Some(message) = self.outbox.pop_front() {
            self.kept[self.sent % KEPT] = message;
            self.line.push(now, self.sent);
            self.sent += 1;
        }
        while let Some((came, number)) = self.line.poll_with_arrival(now) {
            if listens && self.ring.len() < RING {
                self.ring.push_back((came, self.kept[number % KEPT]));
            }
        }
    }
}

/// A program's thread: a tick a millisecond, and now and then none for a while.
struct Thread {
    random: Pcg64Mcg,
    /// Ticks until it is starved, and then until it runs again.
    until: u64,
    is_starved: bool,
    owed: u64,
}

impl Thread {
    fn new(seed: u64) -> Self {
        Self {
            random: Pcg64Mcg::seed_from_u64(seed),
            until: 0,
            is_starved: false,
            owed: 0,
        }
    }

    /// Ticks that run in this millisecond.
    fn ticks(&mut self) -> u64 {
        self.owed += 1;
        if self.until == 0 {
            self.is_starved = !self.is_starved;
            // One starvation in ten is a long one.
            let most = match (self.is_starved, self.random.next_u64() % 10) {
                (false, _) => 1500,
                (true, 0) => LONGEST_STARVATION,
                (true, _) => 40,
            };
            self.until = 1 + self.random.next_u64() % most;
        }
        self.until -= 1;
        if self.is_starved && 0 < self.until {
            return 0;
        }
        std::mem::take(&mut self.owed).min(MOST_BEHIND)
    }
}

/// A thread gets no processor for this many milliseconds at most.
const LONGEST_STARVATION: u64 = 250;

/// A run's line, how old the oldest cut ever was, and was all but a thousandth of the time, ms, and the share of the
/// packets that passed.
#[derive(Clone, Debug)]
struct Run {
    round_trip_ms: f64,
    jitter_ratio: f64,
    oldest_ms: u64,
    p999_ms: usize,
    passed: f64,
}

/// A tool cuts for a minute, a sweep a tick.
fn cut(round_trips_ms: [f64; 2], seed: u64) -> Run {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut share = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let [least_ms, greatest_ms] = round_trips_ms;
    let round_trip_ms = least_ms + (greatest_ms - least_ms) * share();
    let jitter_ratio = 0.5 * share();
    let up_ms = round_trip_ms * (0.2 + 0.6 * share());
    let line = |delay_ms: f64| Impairment {
        delay: TICK.mul_f64(delay_ms),
        jitter: TICK.mul_f64(delay_ms * jitter_ratio),
        loss: 0.1,
        duplicate: 0.02,
        overtaken: Overtaken::Dropped,
        ..Impairment::default()
    };
    let mut up = Way::<Up>::new(line(up_ms), 2 * seed);
    let mut down = Way::<Down>::new(line(round_trip_ms - up_ms), 2 * seed + 1);
    // The handle sends before anybody at the other end listens, and hears nothing itself at first.
    let (server_from, handle_from) = ((300.0 * share()) as u64, (300.0 * share()) as u64);

    let mut log = SweepLog::default();
    let mut handle = RoundTrip::default();
    let mut handle_thread = Thread::new(seed ^ 0x1111);
    let (mut inbox, mut pending) = (SweepInbox::default(), VecDeque::new());
    let mut merged = vec![false; MINUTE as usize + 2];
    let mut server = RoundTrip::default();
    let mut server_thread = Thread::new(seed ^ 0x2222);
    let mut made = Vec::with_capacity(MINUTE as usize);
    let mut oldest_ms = 0;
    let mut ages = vec![0_u32; MINUTE as usize + 1];

    for ms in 1..=MINUTE {
        let now = Timestamp::ZERO.after(TICK * ms as u32);
        for _ in 0..handle_thread.ticks() {
            for (came, message) in down.ring.drain(..) {
                let stamps = message.stamps;
                handle.on_frame(came, stamps.sent_ns, stamps.echo_ns, stamps.echo_hold_ns);
                log.on_acknowledged(message.acknowledged, &message.gaps);
                log.on_durable(message.acknowledged);
                if let Some(took) = of_exchange(came, stamps.echo_ns, stamps.echo_hold_ns) {
                    log.on_round_trip(came, took);
                }
            }
            let at = ms as i32;
            if log.push([at, 0, 0], [at + 1, 0, 0]).is_ok() {
                made.push(ms);
            }
            let (echo_ns, echo_hold_ns) = handle.echo(now);
            let mut message = Up {
                stamps: Stamps {
                    sent_ns: now.as_nanos(),
                    echo_ns,
                    echo_hold_ns,
                },
                ..Up::default()
            };
            log.fill(now, &mut message.sweeps);
            log.on_sent(now, &message.sweeps);
            up.put(message);
        }
        up.carry(now, server_from <= ms);
        for _ in 0..server_thread.ticks() {
            for (came, message) in up.ring.drain(..) {
                let stamps = message.stamps;
                server.on_frame(came, stamps.sent_ns, stamps.echo_ns, stamps.echo_hold_ns);
                inbox.skip_to(message.sweeps.oldest_unacknowledged);
                for record in &message.sweeps {
                    if pending.len() < WINDOW && inbox.on_sweep(record.sequence) == Novelty::New {
                        pending.push_back(record.sequence);
                    }
                }
            }
            for sequence in pending.drain(..pending.len().min(MERGES)) {
                assert!(!std::mem::replace(&mut merged[sequence as usize], true));
            }
            let (echo_ns, echo_hold_ns) = server.echo(now);
            let mut message = Down {
                stamps: Stamps {
                    sent_ns: now.as_nanos(),
                    echo_ns,
                    echo_hold_ns,
                },
                acknowledged: inbox.complete(),
                ..Down::default()
            };
            inbox.fill(&mut message.gaps);
            down.put(message);
        }
        down.carry(now, handle_from <= ms);
        let since = made.get(log.acknowledged() as usize);
        let age_ms = since.map_or(0, |since| ms - since);
        ages[age_ms as usize] += 1;
        oldest_ms = oldest_ms.max(age_ms);
    }
    // What is acknowledged was noted, and what was noted is merged.
    let acknowledged = log.acknowledged() as usize;
    let waiting: Vec<u32> = pending.into();
    assert!((1..=acknowledged).all(|n| merged[n] || waiting.contains(&(n as u32))));
    let mut left = MINUTE as u32 / 1000;
    let p999_ms = ages.iter().rposition(|&count| {
        let is_above = left < count;
        left = left.saturating_sub(count);
        is_above
    });
    Run {
        round_trip_ms,
        jitter_ratio,
        oldest_ms,
        p999_ms: p999_ms.unwrap_or(0),
        passed: up.line.fates().delivered as f64 / up.line.fates().pushed as f64,
    }
}

/// What is promised: four round trips and a tenth of a second, and the time for which the programs at the two ends do
/// not run.
fn bound_ms(run: &Run) -> f64 {
    4.0 * run.round_trip_ms + 100.0 + 2.0 * LONGEST_STARVATION as f64
}

/// Cuts over a quarter of the lines, those with a round trip in this range, and prints the worst.
fn assert_no_cut_waits_for_long(round_trips_ms: [f64; 2], first_seed: u64) {
    let next = AtomicU64::new(first_seed);
    let work = || {
        let mut runs = Vec::new();
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if first_seed + LINES / 4 <= seed {
                return runs;
            }
            runs.push(cut(round_trips_ms, seed));
        }
    };
    let mut runs = std::thread::scope(|scope| {
        let workers = [scope.spawn(work), scope.spawn(work)];
        workers
            .map(|worker| worker.join().expect("it ends"))
            .concat()
    });
    let share = |run: &Run| run.oldest_ms as f64 / bound_ms(run);
    runs.sort_by(|a, b| share(b).total_cmp(&share(a)));
    for run in runs.iter().take(3) {
        println!(
            "{} ms of {:.0} ({} ms in 99.9 % of the time): round trip {:.0} ms, jitter {:.2}, {:.3} of the packets passed",
            run.oldest_ms,
            bound_ms(run),
            run.p999_ms,
            run.round_trip_ms,
            run.jitter_ratio,
            run.passed
        );
    }
    assert_eq!(runs.len() as u64, LINES / 4);
    for run in &runs {
        assert!((run.oldest_ms as f64) < bound_ms(run), "{run:?}");
    }
}

#[test]
fn no_cut_waits_for_more_than_four_round_trips_of_20_to_45_ms() {
    assert_no_cut_waits_for_long([20.0, 45.0], 0);
}

#[test]
fn no_cut_waits_for_more_than_four_round_trips_of_45_to_100_ms() {
    assert_no_cut_waits_for_long([45.0, 100.0], 1000);
}

#[test]
fn no_cut_waits_for_more_than_four_round_trips_of_100_to_225_ms() {
    assert_no_cut_waits_for_long([100.0, 225.0], 2000);
}

#[test]
fn no_cut_waits_for_more_than_four_round_trips_of_225_to_500_ms() {
    assert_no_cut_waits_for_long([225.0, 500.0], 3000);
}
