//! Statistics of the thread and of its sessions, over the last few seconds.

use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use teleclay_proto::http::{Quantiles, TickQuantiles};
use teleclay_shell::realtime::Timing;

use crate::engine::{SessionRecord, TICK};

/// Quantiles are of the last one to two windows.
const WINDOW: Duration = Duration::from_secs(5);
/// Rates are of the last one to two of these.
const RATE_WINDOW: Duration = Duration::from_secs(1);
/// Greatest value that the histograms tell apart, ns: a minute.
const GREATEST_NS: u64 = 60_000_000_000;

/// A histogram over the last one to two windows.
pub(crate) struct Rolling {
    current: Histogram<u32>,
    before: Histogram<u32>,
    since: Instant,
}

impl Rolling {
    pub(crate) fn new() -> Self {
        let empty = || {
            let mut histogram =
                Histogram::new_with_bounds(100, GREATEST_NS, 3).expect("constant bounds are valid");
            histogram.auto(false);
            histogram
        };
        Self {
            current: empty(),
            before: empty(),
            since: Instant::now(),
        }
    }

    pub(crate) fn record(&mut self, nanos: u64) {
        self.current.saturating_record(nanos.max(100));
    }

    pub(crate) fn turn(&mut self, now: Instant) {
        if WINDOW <= now.duration_since(self.since) {
            std::mem::swap(&mut self.current, &mut self.before);
            self.current.reset();
            self.since = now;
        }
    }

    /// How many values there are.
    pub(crate) fn count(&self) -> u64 {
        self.current.len() + self.before.len()
    }

    /// How many values are above one, in parts of all; none where there is no value.
    pub(crate) fn share_above(&self, nanos: u64) -> f64 {
        let count = self.count();
        if count == 0 {
            return 0.0;
        }
        let [current, before] = [&self.current, &self.before];
        let above = [current, before].map(|all| all.count_between(nanos + 1, GREATEST_NS));
        above.iter().sum::<u64>() as f64 / count as f64
    }

    fn merged(&self) -> Histogram<u32> {
        let mut all = self.current.clone();
        all.add(&self.before).expect("both have the same bounds");
        all
    }

    pub(crate) fn quantiles(&self) -> Quantiles {
        let all = self.merged();
        Quantiles {
            p50: seconds(all.value_at_quantile(0.5)),
            p99: seconds(all.value_at_quantile(0.99)),
        }
    }

    pub(crate) fn p99_s(&self) -> f64 {
        seconds(self.merged().value_at_quantile(0.99))
    }

    pub(crate) fn tick_quantiles(&self) -> TickQuantiles {
        let all = self.merged();
        TickQuantiles {
            p50: seconds(all.value_at_quantile(0.5)),
            p99: seconds(all.value_at_quantile(0.99)),
            p999: seconds(all.value_at_quantile(0.999)),
            max: seconds(all.max()),
        }
    }
}

fn seconds(nanos: u64) -> f64 {
    nanos as f64 * 1e-9
}

/// Statistics of a thread, the same for all its sessions.
pub(crate) struct LoopStats {
    pub(crate) work: Rolling,
    pub(crate) lateness: Rolling,
    /// Ticks that started more than a whole period after their deadline, since the server started.
    pub(crate) late_ticks: u64,
    /// Deadlines given up.
    pub(crate) given_up: u64,
    pub(crate) rate_hz: f64,
    pub(crate) last_tick: Option<Instant>,
}

/// A rate, from a counter read now and then.
#[derive(Debug)]
pub(crate) struct Rate {
    count: u64,
    since: Instant,
    pub(crate) per_s: f64,
}

impl Rate {
    pub(crate) fn new(now: Instant) -> Self {
        Self {
            count: 0,
            since: now,
            per_s: 0.0,
        }
    }

    pub(crate) fn turn(&mut self, now: Instant, count: u64) {
        let span = now.duration_since(self.since);
        if RATE_WINDOW <= span {
            self.per_s = count.saturating_sub(self.count) as f64 / span.as_secs_f64();
            self.count = count;
            self.since = now;
        }
    }
}

/// Statistics of one session.
pub(crate) struct SessionStats {
    pub(crate) record: SessionRecord,
    pub(crate) rtt: Rolling,
    pub(crate) age: Rolling,
    pub(crate) up: Rate,
    pub(crate) down: Rate,
    /// What its ticks take of their processor.
    pub(crate) work: Rolling,
    /// When a tick was measured last: one that rests has none.
    measured_at: Option<Instant>,
    /// Since when somebody holds a tool of it.
    held_since: Option<Instant>,
    /// What a held tool took when the last one was let go of, s.
    tool_s: Option<f64>,
}

/// Measured ticks from which a cost is told: two seconds of them.
const ENOUGH: u64 = 400;

impl SessionStats {
    pub(crate) fn new() -> Self {
        let now = Instant::now();
        Self {
            record: SessionRecord::default(),
            rtt: Rolling::new(),
            age: Rolling::new(),
            up: Rate::new(now),
            down: Rate::new(now),
            work: Rolling::new(),
            measured_at: None,
            held_since: None,
            tool_s: None,
        }
    }

    /// What the session takes of a tick while `held` of its tools are held, s: what it was measured to take in the last
    /// seconds, and until that is known no less than `expected_tool_s` for each tool; nothing, while it rests.
    pub(crate) fn cost_s(&self, now: Instant, held: usize, expected_tool_s: f64) -> f64 {
        let measured_at = self.measured_at;
        let is_made = measured_at.is_some_and(|at| now.duration_since(at) < RATE_WINDOW);
        if held == 0 && !is_made {
            return 0.0;
        }
        let measured_s = self.work.p99_s();
        let is_known = ENOUGH <= self.work.count();
        if held == 0 || is_known {
            return measured_s;
        }
        measured_s.max(held as f64 * expected_tool_s)
    }

    /// What a held tool of it takes of a tick, as last measured, s.
    pub(crate) fn tool_s(&self) -> Option<f64> {
        self.steady_tool_s().or(self.tool_s)
    }

    /// The same as long as one is held, once all that is remembered was measured since then.
    fn steady_tool_s(&self) -> Option<f64> {
        let steady_since = self.held_since?.checked_add(WINDOW * 2)?;
        let is_steady = steady_since <= self.work.since && ENOUGH <= self.work.count();
        let held = self.held_tools();
        (is_steady && 0 < held).then(|| self.work.p99_s() / held as f64)
    }

    fn held_tools(&self) -> usize {
        self.record.tools.iter().flatten().count()
    }

    pub(crate) fn packets_per_s(&self) -> (f64, f64) {
        (self.up.per_s, self.down.per_s)
    }

    /// Takes in what the session tells of one tick.
    pub(crate) fn add(&mut self, record: SessionRecord, now: Instant) {
        self.rtt.turn(now);
        self.age.turn(now);
        self.work.turn(now);
        if let Some(work_ns) = record.work_ns {
            self.work.record(work_ns);
            self.measured_at = Some(now);
        }
        let tools = record.tools.iter().flatten();
        for tool in tools.filter(|tool| tool.is_connected) {
            if let Some(rtt_s) = tool.rtt_s {
                self.rtt.record((rtt_s * 1e9) as u64);
            }
            self.age.record((tool.silence_s * 1e9) as u64);
        }
        self.up.turn(now, record.arrivals.received);
        self.down.turn(now, record.frames_sent);
        let is_held = record.tools.iter().any(Option::is_some);
        if is_held {
            self.held_since.get_or_insert(now);
        } else if self.held_since.is_some() {
            self.tool_s = self.tool_s();
            self.held_since = None;
        }
        self.record = record;
    }
}

impl LoopStats {
    /// Forgets what is too old.
    pub(crate) fn turn(&mut self, now: Instant) {
        self.work.turn(now);
        self.lateness.turn(now);
    }

    /// Ticks of the last seconds that started more than a whole period late, in parts of all.
    pub(crate) fn late_share(&self) -> f64 {
        self.lateness.share_above(TICK.as_nanos() as u64)
    }

    /// Takes in one tick.
    pub(crate) fn add(&mut self, timing: &Timing, now: Instant) {
        self.work.record(timing.work_ns);
        self.lateness.record(timing.lateness_ns);
        self.late_ticks += u64::from((TICK.as_nanos() as u64) < timing.lateness_ns);
        self.given_up += timing.given_up;
        self.last_tick = Some(now);
    }
}

impl Default for LoopStats {
    fn default() -> Self {
        Self {
            work: Rolling::new(),
            lateness: Rolling::new(),
            late_ticks: 0,
            given_up: 0,
            rate_hz: 0.0,
            last_tick: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timing(lateness: Duration) -> Timing {
        Timing {
            lateness_ns: lateness.as_nanos() as u64,
            work_ns: 5_000,
            given_up: 0,
            rested: 0,
        }
    }

    #[test]
    fn a_tick_is_late_when_it_starts_more_than_a_whole_tick_after_its_time() {
        let mut stats = LoopStats::default();
        for (lateness, late_ticks) in [
            (TICK / 2 + Duration::from_nanos(1), 0),
            (TICK, 0),
            (TICK + Duration::from_nanos(1), 1),
        ] {
            stats.add(&timing(lateness), Instant::now());
            assert_eq!(stats.late_ticks, late_ticks, "{lateness:?}");
        }
    }

    #[test]
    fn a_rate_is_counted_and_not_what_was_aimed_at() {
        let began = Instant::now();
        let mut rate = Rate::new(began);
        rate.turn(began + Duration::from_secs(2), 1_500);
        assert!((rate.per_s - 750.0).abs() < 1e-9, "{}", rate.per_s);
    }

    #[test]
    fn quantiles_forget_what_is_more_than_ten_seconds_old_and_nothing_within_five() {
        let began = Instant::now();
        let after = |seconds| began + Duration::from_secs(seconds);
        let mut rolling = Rolling::new();
        rolling.since = began;
        rolling.record(40_000_000);
        for (seconds, is_remembered) in [(4, true), (5, true), (9, true), (10, false)] {
            rolling.turn(after(seconds));
            rolling.record(5_000);
            let greatest_s = rolling.tick_quantiles().max;
            assert_eq!(
                0.03 < greatest_s,
                is_remembered,
                "after {seconds} s: {greatest_s}"
            );
        }
    }
}
