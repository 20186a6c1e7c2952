//! Counts and distributions, made from the tick's records on another thread.

use std::fmt;
use std::time::Duration;

use hdrhistogram::Histogram;
use serde::Serialize;
use teleclay_bilateral::LinkState;
use teleclay_link::arrivals::ArrivalCounts;
use teleclay_operator::RobotState;
use teleclay_proto::Scheme;

use crate::engine::{Mode, Record};
use crate::line::Line;

/// Longest time that a histogram tells apart, ns: one minute. Longer ones count as this.
const LONGEST_NS: u64 = 60_000_000_000;
/// Three digits: to a thousandth of each value.
const DIGITS: u8 = 3;

/// How a distribution of times looks, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Quantiles {
    /// Half are shorter.
    pub p50: f64,
    /// One in a hundred is longer.
    pub p99: f64,
    /// One in a thousand is longer.
    pub p999: f64,
    /// The longest.
    pub max: f64,
}

/// What the handle does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// It has no lease, or has lost the link and asks for another.
    #[default]
    Joining,
    /// It has a lease and no frame yet.
    Waiting,
    /// Frames come and the tool works.
    Live,
    /// No frame for longer than the allowed silence.
    Silent,
    /// Likewise, but the copy of the clay goes on.
    OnCopy,
    /// The silence lasts: the copy is no longer cut, and its force fades.
    OnStaleCopy,
    /// The session is paused.
    Paused,
    /// This side or the tool side is in fault.
    Fault,
    /// It says goodbye.
    Leaving,
}

impl State {
    /// The word that stands for it.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Joining => "joining",
            Self::Waiting => "waiting",
            Self::Live => "live",
            Self::Silent => "silent",
            Self::OnCopy => "on copy",
            Self::OnStaleCopy => "on stale copy",
            Self::Paused => "paused",
            Self::Fault => "fault",
            Self::Leaving => "leaving",
        }
    }
}

/// How it goes: of the last second in a status line, of the whole run in the summary. Counts are always of the whole
/// run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Status {
    /// Time since the program started, s.
    pub time_s: f64,
    /// What the handle does.
    pub state: State,
    /// The lease held last, 0 for none.
    pub lease: u32,
    /// The scheme in force.
    pub scheme: Option<Scheme>,
    /// Ticks since the start.
    pub ticks: u64,
    /// Ticks that started more than a period late, those given up included.
    pub late_ticks: u64,
    /// Time that a tick took, s.
    pub tick_s: Quantiles,
    /// How long after its deadline a tick started, s.
    pub lateness_s: Quantiles,
    /// Round trip to the tool side, without the time it held the stamp, s.
    pub rtt_s: Quantiles,
    /// From a frame's departure to the arrival of the reaction to it, s.
    pub reaction_s: Quantiles,
    /// Frames received, each once.
    pub received: u64,
    /// Frames of the tool side that never came.
    pub lost: u64,
    /// Frames that came twice.
    pub duplicates: u64,
    /// Frames that came after a newer one.
    pub reordered: u64,
    /// Payloads that the server of the lease did not write or that came again, payloads that were no frame, frames
    /// under another lease, frames that found no room.
    pub rejected: u64,
    /// Frames sent.
    pub sent: u64,
    /// Frames that were not sent: too old, no room, or not taken.
    pub unsent: u64,
    /// Force on the hand in the last tick, N.
    pub felt_force_n: [f64; 3],
    /// Greatest force on the hand, N.
    pub felt_force_max_n: f64,
    /// Finished rounds of a cutting operator.
    pub rounds: u64,
    /// Leases held so far.
    pub joins: u64,
    /// What the scheduler granted to the 1 kHz thread.
    pub scheduler: String,
    /// How the robot stands, when the device is one.
    pub robot: Option<RobotStatus>,
}

/// A robot's posture in the last tick, and how near it came to its limits.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RobotStatus {
    /// Joint angles, rad.
    pub joints_rad: [f64; 3],
    /// Torques of the joints, N·m.
    pub torques_n_m: [f64; 3],
    /// How far from the nearest singularity, from 1 down to 0.
    pub clearance: f64,
    /// Least clearance, of the last second in a status line, of the whole run in the summary.
    pub clearance_min: f64,
    /// The nearest singularity, in words.
    pub nearest: String,
    /// It is at its fence and resists.
    pub held: bool,
    /// Ticks in which a joint turned as fast as it may.
    pub slowed_ticks: u64,
    /// Ticks in which the hand was stronger than a joint.
    pub overpowered_ticks: u64,
}

/// Counts everything.
pub(crate) struct Metrics {
    period_ns: u64,
    recent: Times,
    whole: Times,
    ticks: u64,
    late_ticks: u64,
    /// Of the leases before the present one, and of the present one.
    counts: [Counts; 2],
    felt_force_n: [f64; 3],
    felt_force_recent_n: f64,
    felt_force_max_n: f64,
    rounds: u64,
    joins: u64,
    lease: u32,
    scheme: Option<Scheme>,
    state: State,
    scheduler: String,
    robot: Option<RobotTally>,
}

/// The last posture, and what came before it.
#[derive(Clone, Copy)]
struct RobotTally {
    last: RobotState,
    clearance_recent: f64,
    clearance_min: f64,
    slowed_ticks: u64,
    overpowered_ticks: u64,
}

impl RobotTally {
    fn new(first: RobotState) -> Self {
        Self {
            last: first,
            clearance_recent: first.clearance,
            clearance_min: first.clearance,
            slowed_ticks: 0,
            overpowered_ticks: 0,
        }
    }

    fn add(&mut self, state: &RobotState) {
        self.last = *state;
        self.clearance_recent = self.clearance_recent.min(state.clearance);
        self.clearance_min = self.clearance_min.min(state.clearance);
        self.slowed_ticks += u64::from(state.is_slowed);
        self.overpowered_ticks += u64::from(state.is_overpowered);
    }

    fn report(&self, clearance_min: f64) -> RobotStatus {
        RobotStatus {
            joints_rad: self.last.joints_rad,
            torques_n_m: self.last.torques_n_m,
            clearance: self.last.clearance,
            clearance_min,
            nearest: self.last.nearest.to_string(),
            held: self.last.is_held,
            slowed_ticks: self.slowed_ticks,
            overpowered_ticks: self.overpowered_ticks,
        }
    }
}

impl Metrics {
    pub(crate) fn new() -> Self {
        Self {
            period_ns: u64::MAX,
            recent: Times::new(),
            whole: Times::new(),
            ticks: 0,
            late_ticks: 0,
            counts: [Counts::default(); 2],
            felt_force_n: [0.0; 3],
            felt_force_recent_n: 0.0,
            felt_force_max_n: 0.0,
            rounds: 0,
            joins: 0,
            lease: 0,
            scheme: None,
            state: State::Joining,
            scheduler: String::new(),
            robot: None,
        }
    }

    /// Another lease is held.
    pub(crate) fn on_lease(&mut self, lease: u32) {
        self.joins += 1;
        self.lease = lease;
        self.counts = [self.counts[0].plus(&self.counts[1]), Counts::default()];
    }

    /// The 1 kHz thread was started.
    pub(crate) fn on_thread(&mut self, period: Duration, scheduler: &str) {
        self.period_ns = period.as_nanos() as u64;
        scheduler.clone_into(&mut self.scheduler);
    }

    /// The operator finished a round.
    pub(crate) fn on_round(&mut self) -> u64 {
        self.rounds += 1;
        self.rounds
    }

    /// Ticks so far.
    pub(crate) fn ticks(&self) -> u64 {
        self.ticks
    }

    /// One tick.
    pub(crate) fn add(&mut self, record: &Record) {
        self.ticks += 1;
        self.late_ticks += record.given_up + u64::from(self.period_ns < record.lateness_ns);
        for times in [&mut self.recent, &mut self.whole] {
            times.add(record);
        }
        let felt_n = record
            .felt_force_n
            .iter()
            .map(|f| f * f)
            .sum::<f64>()
            .sqrt();
        self.felt_force_n = record.felt_force_n;
        self.felt_force_recent_n = self.felt_force_recent_n.max(felt_n);
        self.felt_force_max_n = self.felt_force_max_n.max(felt_n);
        self.scheme = Some(record.scheme);
        if let Some(state) = &record.robot {
            self.robot
                .get_or_insert_with(|| RobotTally::new(*state))
                .add(state);
        }
        if record.lease == self.lease {
            self.counts[1].arrivals = record.arrivals;
            self.counts[1].lost_on_the_way_out = record.lost_on_the_way_out;
        }
        self.state = match (record.mode, record.link_state) {
            _ if record.fault.is_some() => State::Fault,
            (Mode::Coupled, LinkState::Live) => State::Live,
            (Mode::Coupled, LinkState::NotYet) => State::Waiting,
            (Mode::Coupled, LinkState::Silent | LinkState::Gone) => State::Silent,
            (Mode::Coupled, LinkState::OnCopy) => State::OnCopy,
            (Mode::Coupled, LinkState::OnStaleCopy) => State::OnStaleCopy,
            (Mode::Coupled, LinkState::Paused) => State::Paused,
            (Mode::Coupled, LinkState::Fault) => State::Fault,
            (Mode::Braking | Mode::Resting, _) => State::Joining,
        };
    }

    /// What the line has counted.
    pub(crate) fn observe(&mut self, line: &Line) {
        let rejected = line.rejected();
        self.counts[1].rejected = rejected.unheard()
            + rejected.undecodable()
            + rejected.foreign()
            + rejected.overflowed();
        self.counts[1].sent = line.sent();
        self.counts[1].not_sent = line.unsent();
    }

    /// The last second, or however long it has been since the last call.
    pub(crate) fn status(&mut self, time: Duration, state: Option<State>) -> Status {
        let felt_n = std::mem::take(&mut self.felt_force_recent_n);
        let mut status = self.report(time, &self.recent, felt_n, state);
        status.robot = self
            .robot
            .as_ref()
            .map(|robot| robot.report(robot.clearance_recent));
        if let Some(robot) = &mut self.robot {
            robot.clearance_recent = robot.last.clearance;
        }
        self.recent.clear();
        status
    }

    /// The whole run.
    pub(crate) fn summary(&self, time: Duration, state: Option<State>) -> Status {
        self.report(time, &self.whole, self.felt_force_max_n, state)
    }

    fn report(
        &self,
        time: Duration,
        times: &Times,
        felt_force_max_n: f64,
        state: Option<State>,
    ) -> Status {
        let counts = self.counts[0].plus(&self.counts[1]);
        Status {
            time_s: time.as_secs_f64(),
            state: state.unwrap_or(self.state),
            lease: self.lease,
            scheme: self.scheme,
            ticks: self.ticks,
            late_ticks: self.late_ticks,
            tick_s: quantiles(&times.work),
            lateness_s: quantiles(&times.lateness),
            rtt_s: quantiles(&times.rtt),
            reaction_s: quantiles(&times.reaction),
            received: counts.arrivals.received,
            lost: counts.arrivals.lost,
            duplicates: counts.arrivals.duplicates,
            reordered: counts.arrivals.reordered,
            rejected: counts.rejected,
            sent: counts.sent,
            unsent: counts.not_sent + counts.lost_on_the_way_out,
            felt_force_n: self.felt_force_n,
            felt_force_max_n,
            rounds: self.rounds,
            joins: self.joins,
            scheduler: self.scheduler.clone(),
            robot: self
                .robot
                .as_ref()
                .map(|robot| robot.report(robot.clearance_min)),
        }
    }
}

impl fmt::Display for Status {
    /// One line for people.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.ticks == 0 {
            return write!(f, "{:.1} s: never joined", self.time_s);
        }
        let ms = |s: f64| s * 1e3;
        write!(
            f,
            "{:.1} s: {} ticks ({} late), tick p50 {:.1} us p99 {:.1} us, round trip p50 {:.2} ms p99 {:.2} ms, \
             {} frames lost, force at most {:.2} N, {} rounds",
            self.time_s,
            self.ticks,
            self.late_ticks,
            self.tick_s.p50 * 1e6,
            self.tick_s.p99 * 1e6,
            ms(self.rtt_s.p50),
            ms(self.rtt_s.p99),
            self.lost,
            self.felt_force_max_n,
            self.rounds,
        )?;
        if 1 < self.joins {
            write!(f, ", joined {} times", self.joins)?;
        }
        self.robot.as_ref().map_or(Ok(()), |robot| {
            write!(
                f,
                ", clearance from singularities at least {:.2}",
                robot.clearance_min
            )
        })
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    arrivals: ArrivalCounts,
    rejected: u64,
    sent: u64,
    not_sent: u64,
    lost_on_the_way_out: u64,
}

impl Counts {
    fn plus(&self, other: &Self) -> Self {
        Self {
            arrivals: self.arrivals.and(other.arrivals),
            rejected: self.rejected + other.rejected,
            sent: self.sent + other.sent,
            not_sent: self.not_sent + other.not_sent,
            lost_on_the_way_out: self.lost_on_the_way_out + other.lost_on_the_way_out,
        }
    }
}

struct Times {
    work: Histogram<u64>,
    lateness: Histogram<u64>,
    rtt: Histogram<u64>,
    reaction: Histogram<u64>,
}

impl Times {
    fn new() -> Self {
        let empty =
            || Histogram::new_with_bounds(1, LONGEST_NS, DIGITS).expect("the bounds are in order");
        Self {
            work: empty(),
            lateness: empty(),
            rtt: empty(),
            reaction: empty(),
        }
    }

    fn add(&mut self, record: &Record) {
        self.work.saturating_record(record.work_ns);
        self.lateness.saturating_record(record.lateness_ns);
        if let Some(rtt_ns) = record.heard.rtt_ns {
            self.rtt.saturating_record(rtt_ns);
        }
        if let Some(reaction_ns) = record.heard.reaction_ns {
            self.reaction.saturating_record(reaction_ns);
        }
    }

    fn clear(&mut self) {
        for histogram in [
            &mut self.work,
            &mut self.lateness,
            &mut self.rtt,
            &mut self.reaction,
        ] {
            histogram.reset();
        }
    }
}

fn quantiles(histogram: &Histogram<u64>) -> Quantiles {
    let at = |quantile: f64| histogram.value_at_quantile(quantile) as f64 * 1e-9;
    Quantiles {
        p50: at(0.5),
        p99: at(0.99),
        p999: at(0.999),
        max: histogram.max() as f64 * 1e-9,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attachment::Heard;
    use crate::engine::sample_record;

    fn record(lease: u32, lateness_ns: u64, received: u64) -> Record {
        Record {
            lateness_ns,
            lease,
            heard: Heard {
                rtt_ns: Some(300_000),
                reaction_ns: Some(800_000),
            },
            felt_force_n: [3.0, -4.0, 0.0],
            arrivals: ArrivalCounts {
                received,
                lost: 1,
                ..ArrivalCounts::default()
            },
            ..sample_record()
        }
    }

    fn running() -> Metrics {
        let mut metrics = Metrics::new();
        metrics.on_thread(Duration::from_millis(1), "normal, as asked");
        metrics.on_lease(1);
        metrics
    }

    #[test]
    fn a_tick_is_late_when_it_starts_more_than_a_period_after_its_deadline() {
        let mut metrics = running();
        for lateness_ns in [0, 1_000_000, 1_000_001] {
            metrics.add(&record(1, lateness_ns, 1));
        }
        metrics.add(&Record {
            given_up: 60,
            ..record(1, 60_000_000, 2)
        });
        let summary = metrics.summary(Duration::from_secs(1), None);
        assert_eq!((summary.ticks, summary.late_ticks), (4, 62));
    }

    #[test]
    fn counts_go_on_over_leases_and_a_seat_that_is_being_left_adds_nothing() {
        let mut metrics = running();
        metrics.add(&record(1, 0, 100));
        metrics.on_lease(2);
        metrics.add(&record(1, 0, 100));
        metrics.add(&record(2, 0, 7));
        let summary = metrics.summary(Duration::from_secs(1), None);
        assert_eq!((summary.received, summary.lost, summary.joins), (107, 2, 2));
    }

    #[test]
    fn a_status_is_of_the_last_second_and_the_summary_of_all() {
        let mut metrics = running();
        metrics.add(&record(1, 0, 1));
        assert!((metrics.status(Duration::from_secs(1), None).rtt_s.p50 - 3e-4).abs() < 1e-6);
        metrics.add(&Record {
            heard: Heard::default(),
            felt_force_n: [0.0; 3],
            ..record(1, 0, 1)
        });
        let second = metrics.status(Duration::from_secs(2), None);
        assert!(second.rtt_s.max <= 0.0 && second.felt_force_max_n <= 0.0);
        let summary = metrics.summary(Duration::from_secs(2), None);
        assert!((summary.reaction_s.p99 - 8e-4).abs() < 2e-6);
        assert!((summary.felt_force_max_n - 5.0).abs() < 1e-12);
        assert!(
            summary.to_string().starts_with("2.0 s: 2 ticks (0 late)"),
            "{summary}"
        );
    }
}
