//! The link conditioner: one direction of a bad network, reproducible from a seed.
//!
//! A message pushed at `now` comes out of [`Conditioner::poll`] at its release time, possibly twice, late, early or
//! never. Random numbers come from PCG-64 and only `+ - * / sqrt` shape them, so one seed gives the same fate to the
//! same sequence of pushes on every target. Each message draws the same count of numbers whatever happens to it;
//! changing the loss does not reshuffle the delays.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::time::Duration;

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::time::Timestamp;

/// How the delay of single messages scatters around the mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum JitterDistribution {
    /// Normal (sum of twelve uniforms, so within six sigma), cut off at zero delay.
    #[default]
    Normal,
    /// Pareto with exponent 4, shifted and scaled to the same mean and standard deviation: mostly a little early, at
    /// times very late.
    HeavyTailed,
}

/// Gilbert–Elliott bursts: a two-state chain that moves once a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bursts {
    /// Probability, per message, of entering a burst.
    pub enter: f64,
    /// Probability, per message, of leaving it.
    pub leave: f64,
    /// Share of messages lost inside a burst.
    pub loss: f64,
}

/// A line that is cut for `length` at the end of every `every`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outages {
    /// Period; the first cut starts at `every` minus `length`.
    pub every: Duration,
    /// Length of each cut.
    pub length: Duration,
}

/// A line that stands still for a while and loses nothing by it: what queued up comes afterwards, in its order, as over
/// a stream that repeats what was lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stall {
    /// When it begins.
    pub from: Timestamp,
    /// How long it lasts.
    pub length: Duration,
    /// How many times as fast as it was sent the queue is delivered: above 1, infinite for all of it at once.
    pub drain: f64,
}

/// What becomes of a message that comes to the line's end after a newer one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Overtaken {
    /// It is handed out, late.
    #[default]
    Delivered,
    /// It is dropped, as transports do that deliver in order and repeat nothing; so is every copy after the first.
    Dropped,
}

/// What one direction of a network does. `Impairment::default()` is a perfect line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Impairment {
    /// Mean one-way delay.
    pub delay: Duration,
    /// Standard deviation of the one-way delay.
    pub jitter: Duration,
    /// Shape of that scatter.
    pub distribution: JitterDistribution,
    /// Share of messages lost, independently, 0 to 1.
    pub loss: f64,
    /// Share of messages that arrive twice, each copy with a delay of its own, 0 to 1.
    pub duplicate: f64,
    /// Share of messages that overtake: they skip the delay altogether, 0 to 1.
    pub reorder: f64,
    /// Loss in bursts, on top of `loss`.
    pub bursts: Option<Bursts>,
    /// Periodic cuts of the line, on top of everything.
    pub outages: Option<Outages>,
    /// A stall of the line, on top of everything.
    pub stall: Option<Stall>,
    /// What becomes of messages that were overtaken.
    pub overtaken: Overtaken,
}

/// What became of the messages so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fates {
    /// Messages pushed.
    pub pushed: u64,
    /// Messages handed out, copies included.
    pub delivered: u64,
    /// Messages lost by loss, burst or outage.
    pub lost: u64,
    /// Extra copies made.
    pub duplicated: u64,
    /// Messages refused because `capacity` were in flight.
    pub overflowed: u64,
    /// Messages and copies dropped because a newer one had been handed out.
    pub overtaken: u64,
}

struct InFlight<T> {
    release: Timestamp,
    order: u64,
    /// Which push it is of, from 1.
    number: u64,
    message: T,
}

impl<T> PartialEq for InFlight<T> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl<T> Eq for InFlight<T> {}
impl<T> PartialOrd for InFlight<T> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl<T> Ord for InFlight<T> {
    /// Reversed, because the heap hands out its greatest.
    fn cmp(&self, other: &Self) -> Ordering {
        (other.release, other.order).cmp(&(self.release, self.order))
    }
}

/// One direction of a line. After creation neither `push` nor `poll` allocates.
pub struct Conditioner<T> {
    impairment: Impairment,
    random: Pcg64Mcg,
    in_burst: bool,
    in_flight: BinaryHeap<InFlight<T>>,
    capacity: usize,
    launched: u64,
    /// Number of the newest message handed out.
    newest_out: u64,
    fates: Fates,
}

impl<T: Clone> Conditioner<T> {
    /// A line with room for `capacity` messages in flight; one more is lost and counted.
    pub fn new(impairment: Impairment, seed: u64, capacity: usize) -> Self {
        Self {
            impairment,
            random: Pcg64Mcg::seed_from_u64(seed),
            in_burst: false,
            in_flight: BinaryHeap::with_capacity(capacity),
            capacity,
            launched: 0,
            newest_out: 0,
            fates: Fates::default(),
        }
    }

    /// Changes what the line does from now on. What is in flight keeps the fate it has.
    pub fn impair(&mut self, impairment: Impairment) {
        self.impairment = impairment;
    }

    /// Starts the random numbers anew.
    pub fn reseed(&mut self, seed: u64) {
        self.random = Pcg64Mcg::seed_from_u64(seed);
        self.in_burst = false;
    }

    /// What the line does at present.
    pub fn impairment(&self) -> &Impairment {
        &self.impairment
    }

    /// Counts since creation.
    pub fn fates(&self) -> Fates {
        self.fates
    }

    /// Messages in flight.
    pub fn in_flight(&self) -> usize {
        self.in_flight.len()
    }

    /// Loses everything in flight, as when the line's owner goes away.
    pub fn clear(&mut self) {
        self.fates.lost += self.in_flight.len() as u64;
        self.in_flight.clear();
    }

    /// A message enters the line.
    pub fn push(&mut self, now: Timestamp, message: T) {
        self.fates.pushed += 1;
        let first_delay = self.draw_delay();
        let second_delay = self.draw_delay();
        let lost_alone = self.uniform() < self.impairment.loss;
        let lost_in_burst = self.draw_burst();
        let doubled = self.uniform() < self.impairment.duplicate;
        let overtakes = self.uniform() < self.impairment.reorder;

        if lost_alone || lost_in_burst || self.is_cut(now) {
            self.fates.lost += 1;
            return;
        }
        if doubled {
            self.fates.duplicated += 1;
            self.launch(now.after(second_delay), message.clone());
        }
        let delay = if overtakes {
            Duration::ZERO
        } else {
            first_delay
        };
        self.launch(now.after(delay), message);
    }

    /// The next message due by `now`, earliest first; call until `None`.
    pub fn poll(&mut self, now: Timestamp) -> Option<T> {
        self.poll_with_arrival(now).map(|(_, message)| message)
    }

    /// As [`poll`](Self::poll), with the instant at which the message fell due: whoever polls once a tick can tell the
    /// line's delay from its own.
    pub fn poll_with_arrival(&mut self, now: Timestamp) -> Option<(Timestamp, T)> {
        while self.in_flight.peek()?.release <= now {
            let due = self.in_flight.pop()?;
            let is_overtaken = due.number <= self.newest_out;
            if is_overtaken && self.impairment.overtaken == Overtaken::Dropped {
                self.fates.overtaken += 1;
                continue;
            }
            self.newest_out = self.newest_out.max(due.number);
            self.fates.delivered += 1;
            return Some((due.release, due.message));
        }
        None
    }

    /// When the next message falls due.
    pub fn poll_timeout(&self) -> Option<Timestamp> {
        self.in_flight.peek().map(|next| next.release)
    }

    fn launch(&mut self, due: Timestamp, message: T) {
        if self.capacity <= self.in_flight.len() {
            self.fates.overflowed += 1;
            return;
        }
        self.launched += 1;
        self.in_flight.push(InFlight {
            release: self.held_back(due),
            order: self.launched,
            number: self.fates.pushed,
            message,
        });
    }

    fn is_cut(&self, now: Timestamp) -> bool {
        let Some(outages) = self.impairment.outages else {
            return false;
        };
        let every = outages.every.as_nanos() as u64;
        let length = outages.length.as_nanos() as u64;
        0 < every && every.saturating_sub(length) <= now.as_nanos() % every
    }

    /// When a message is handed out that would be at `due` if the line never stood still.
    fn held_back(&self, due: Timestamp) -> Timestamp {
        let Some(stall) = self.impairment.stall.filter(|stall| stall.from <= due) else {
            return due;
        };
        let behind_ns = due.since(stall.from).as_nanos() as f64 / stall.drain;
        let delivered = stall
            .from
            .after(stall.length + Duration::from_nanos(behind_ns as u64));
        due.max(delivered)
    }

    fn draw_burst(&mut self) -> bool {
        let (change, fate) = (self.uniform(), self.uniform());
        let Some(bursts) = self.impairment.bursts else {
            self.in_burst = false;
            return false;
        };
        self.in_burst = if self.in_burst {
            bursts.leave <= change
        } else {
            change < bursts.enter
        };
        self.in_burst && fate < bursts.loss
    }

    fn draw_delay(&mut self) -> Duration {
        // Both shapes are drawn each time, so that a change of shape does not shift the stream.
        let normal = (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0;
        let u = self.uniform();
        let scatter = match self.impairment.distribution {
            JitterDistribution::Normal => normal,
            JitterDistribution::HeavyTailed => {
                // Pareto, exponent 4, on [1, inf): mean 4/3, variance 2/9.
                let pareto = 1.0 / (1.0 - u).max(f64::MIN_POSITIVE).sqrt().sqrt();
                (pareto - 4.0 / 3.0) / (2.0_f64 / 9.0).sqrt()
            }
        };
        let mean = self.impairment.delay.as_nanos() as f64;
        let sigma = self.impairment.jitter.as_nanos() as f64;
        Duration::from_nanos((mean + sigma * scatter).max(0.0) as u64)
    }

    /// Uniform on [0, 1), 53 bits.
    fn uniform(&mut self) -> f64 {
        (self.random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK: Duration = Duration::from_millis(1);

    fn at(tick: u64) -> Timestamp {
        Timestamp::ZERO.after(TICK * tick as u32)
    }

    /// Pushes `count` numbered messages a tick apart and returns (number, arrival tick) in order of arrival.
    fn run(impairment: Impairment, seed: u64, count: u64) -> (Vec<(u64, u64)>, Fates) {
        let mut line = Conditioner::new(impairment, seed, 8192);
        let mut arrived = Vec::new();
        for tick in 0..count + 5000 {
            if tick < count {
                line.push(at(tick), tick);
            }
            while let Some(number) = line.poll(at(tick)) {
                arrived.push((number, tick));
            }
        }
        assert_eq!(line.in_flight(), 0);
        (arrived, line.fates())
    }

    #[test]
    fn a_perfect_line_hands_everything_over_at_once_and_in_order() {
        let (arrived, _) = run(Impairment::default(), 1, 1000);
        assert_eq!(arrived, (0..1000).map(|n| (n, n)).collect::<Vec<_>>());
    }

    #[test]
    fn one_seed_is_one_fate_and_another_seed_another() {
        let bad = Impairment {
            delay: TICK * 20,
            jitter: TICK * 5,
            loss: 0.1,
            duplicate: 0.05,
            ..Default::default()
        };
        assert_eq!(run(bad, 7, 3000).0, run(bad, 7, 3000).0);
        assert_ne!(run(bad, 7, 3000).0, run(bad, 8, 3000).0);
    }

    #[test]
    fn mean_and_scatter_of_the_delay_are_what_was_asked_for() {
        for distribution in [JitterDistribution::Normal, JitterDistribution::HeavyTailed] {
            let line = Impairment {
                delay: TICK * 500,
                jitter: TICK * 50,
                distribution,
                ..Default::default()
            };
            let (arrived, _) = run(line, 3, 60_000);
            let delays: Vec<f64> = arrived.iter().map(|&(n, tick)| (tick - n) as f64).collect();
            let mean = delays.iter().sum::<f64>() / delays.len() as f64;
            let sigma = (delays.iter().map(|d| (d - mean).powi(2)).sum::<f64>()
                / delays.len() as f64)
                .sqrt();
            // Arrival is seen at the next whole tick: half a tick late on average.
            assert!(
                (mean - 500.5).abs() < 1.0,
                "{distribution:?}: mean {mean} ms"
            );
            assert!(
                (sigma - 50.0).abs() < 2.5,
                "{distribution:?}: sigma {sigma} ms"
            );
        }
    }

    #[test]
    fn losses_and_copies_come_at_the_rate_asked_for() {
        let line = Impairment {
            loss: 0.3,
            duplicate: 0.2,
            ..Default::default()
        };
        let (_, fates) = run(line, 5, 50_000);
        assert!(
            (fates.lost as f64 / 50_000.0 - 0.3).abs() < 0.01,
            "{fates:?}"
        );
        assert!(
            (fates.duplicated as f64 / 35_000.0 - 0.2).abs() < 0.01,
            "{fates:?}"
        );
        assert_eq!(fates.delivered, 50_000 - fates.lost + fates.duplicated);
    }

    #[test]
    fn bursts_lose_in_runs_of_the_length_the_chain_says() {
        let bursts = Bursts {
            enter: 0.01,
            leave: 0.1,
            loss: 1.0,
        };
        let line = Impairment {
            bursts: Some(bursts),
            ..Default::default()
        };
        let (arrived, fates) = run(line, 11, 200_000);
        let runs = arrived
            .windows(2)
            .filter(|pair| pair[0].0 + 1 < pair[1].0)
            .count();
        let mean_run = fates.lost as f64 / runs as f64;
        // Geometric: a run lasts 1/leave on average; share lost is enter / (enter + leave).
        assert!((mean_run - 10.0).abs() < 1.0, "mean run {mean_run}");
        assert!(
            (fates.lost as f64 / 200_000.0 - 1.0 / 11.0).abs() < 0.01,
            "{fates:?}"
        );
    }

    #[test]
    fn an_outage_loses_exactly_what_was_sent_into_it() {
        let outages = Outages {
            every: TICK * 1000,
            length: TICK * 200,
        };
        let line = Impairment {
            outages: Some(outages),
            ..Default::default()
        };
        let (arrived, _) = run(line, 1, 2000);
        let expected: Vec<u64> = (0..2000).filter(|n| n % 1000 < 800).collect();
        assert_eq!(
            arrived.iter().map(|&(n, _)| n).collect::<Vec<_>>(),
            expected
        );
    }

    #[test]
    fn a_stall_loses_nothing_and_delivers_its_queue_in_order_at_the_speed_asked_for() {
        for drain in [1.25, 20.0, f64::INFINITY] {
            let stall = Stall {
                from: at(800),
                length: TICK * 200,
                drain,
            };
            let line = Impairment {
                delay: TICK * 5,
                stall: Some(stall),
                ..Default::default()
            };
            let (arrived, _) = run(line, 1, 3000);
            assert!(arrived.iter().map(|&(n, _)| n).eq(0..3000), "{drain}");
            for (number, tick) in arrived {
                let due = number + 5;
                // The first in the queue comes when the stall ends, the others behind it, until one would not have
                // queued at all.
                let in_turn = |queued_for: u64| 1000 + (queued_for as f64 / drain).ceil() as u64;
                let expected = due.checked_sub(800).map_or(0, in_turn).max(due);
                assert_eq!(tick, expected, "number {number} at drain {drain}");
            }
        }
    }

    /// Of a jittering line only what is newer than all before passes, once.
    #[test]
    fn a_line_that_drops_what_was_overtaken_hands_out_rising_numbers_and_counts_the_rest() {
        let late = Impairment {
            delay: TICK * 100,
            jitter: TICK * 20,
            duplicate: 0.2,
            loss: 0.1,
            ..Default::default()
        };
        let (all, whole) = run(late, 9, 20_000);
        let (passed, fates) = run(
            Impairment {
                overtaken: Overtaken::Dropped,
                ..late
            },
            9,
            20_000,
        );
        let mut newest = None;
        let rising: Vec<(u64, u64)> = all
            .into_iter()
            .filter(|&(number, _)| {
                let is_newer = newest.is_none_or(|newest| newest < number);
                newest = newest.max(Some(number));
                is_newer
            })
            .collect();
        assert_eq!(passed, rising);
        assert_eq!(fates.delivered + fates.overtaken, whole.delivered);
        let share = passed.len() as f64 / 20_000.0;
        assert!((0.05..0.2).contains(&share), "{share} passed");
    }

    #[test]
    fn changing_the_loss_does_not_reshuffle_the_delays() {
        let jittery = Impairment {
            delay: TICK * 50,
            jitter: TICK * 10,
            ..Default::default()
        };
        let (whole, _) = run(jittery, 9, 2000);
        let (thinned, _) = run(
            Impairment {
                loss: 0.5,
                ..jittery
            },
            9,
            2000,
        );
        assert!(thinned.len() < 1200);
        assert!(thinned.iter().all(|survivor| whole.contains(survivor)));
    }

    #[test]
    fn a_full_line_loses_the_newest_and_counts_it() {
        let mut line = Conditioner::new(
            Impairment {
                delay: TICK * 10,
                ..Default::default()
            },
            1,
            4,
        );
        for n in 0..6 {
            line.push(at(0), n);
        }
        assert_eq!(line.fates().overflowed, 2);
        assert_eq!(
            std::iter::from_fn(|| line.poll(at(10))).collect::<Vec<_>>(),
            [0, 1, 2, 3]
        );
    }
}
