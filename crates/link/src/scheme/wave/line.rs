//! The line between the two ports: what goes out, what comes in, and that it can never give more than it took.
//!
//! Every frame carries the wave, the wave's time integral and the energy of all waves so far, `T Σ u² / 2`. So a frame
//! also tells what the frames before it held, whether they were lost, late, or never sent (a deadband). From that:
//!
//! - *Energy.* What came in is credited once, when a frame vouches for it. A wave is played only as far as the credit
//!   reaches. A tick for which no frame is there plays what was played last if energy is left, and zero otherwise. To
//!   hold the last wave without asking for its energy is not passive: each loss would be a gift.
//! - *Drift.* Positions are integrals of waves, so they part when waves are lost. The integral that was played is
//!   pulled towards the one that was sent, with [`PULL_PER_S`] and no faster than [`PULL_SPEED_M_S`]. Shortening a wave
//!   is free; lengthening one has to be paid for by energy that came and was not played, beyond what it takes to hold
//!   the present wave over a gap ([`HELD_S`]). So the pull is passive as well.
//! - *Debts.* Where an account did not cover the wave that should have gone out, the sender owes the difference and
//!   pulls in the same way. While it owes, or its cushion is not full, the port resists motion a little more than it
//!   should ([`Outgoing::need`]): who moves pays.

use teleclay_proto::frame::Header;

use super::Medium;
use crate::Vec3;
use crate::energy::{Counter, Tank};
use crate::playout::Playout;
use crate::time::Timestamp;

/// Drift shrinks to a third in 50 ms.
pub(super) const PULL_PER_S: f64 = 20.0;
/// Drift is made up for no faster than this, m/s of a free tool: after an outage the tool comes back slowly.
pub(super) const PULL_SPEED_M_S: f64 = 0.05;
/// A wave is held over gaps of this length, s: a heartbeat of a deadband, and half as much again.
const HELD_S: f64 = 0.03;
/// Credit of an axis at most, J: a wave of 1 √W (6 N at b = 20) over 40 ms.
const MOST_CREDIT_J: f64 = 0.02;
/// Cushion of a port at most, J: what the half tick between a force and its work comes to at 0.2 m/s and b = 20,
/// `b v² T / 4`.
const CUSHION_J: f64 = 2e-4;
/// An owed displacement of this length makes a port resist in full, m.
const FULL_NEED_M: f64 = 1e-3;

/// What a frame says of the waves of its sender.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sample {
    /// Wave of this tick, √W.
    pub(super) wave: Vec3,
    /// Sum of all waves so far times the tick, √W s.
    pub(super) integral: Vec3,
    /// Energy of all waves so far, J.
    pub(super) energy_j: Vec3,
}

impl Sample {
    pub(super) fn new(wave: [f64; 3], integral: [f64; 3], energy_j: [f64; 3]) -> Self {
        Self {
            wave: wave.into(),
            integral: integral.into(),
            energy_j: energy_j.into(),
        }
    }
}

/// The waves that come.
pub(super) struct Incoming {
    tick_s: f64,
    filter_share: f64,
    most_pull: f64,
    playout: Playout<Sample>,
    axes: [Axis; 3],
    /// Ticks since a frame was played.
    gap: u32,
}

/// One axis of the waves that come.
#[derive(Clone, Copy)]
struct Axis {
    counter: Counter,
    newest_j: Option<f64>,
    credit: Tank,
    /// Played while nothing newer is there.
    held: f64,
    /// Integral that should have been played by now: that of the last frame, carried on by the held wave.
    target: f64,
    played: f64,
    filtered: f64,
}

impl Axis {
    /// Nothing has come yet.
    fn new() -> Self {
        Self {
            counter: Counter::NEW,
            newest_j: None,
            credit: Tank::empty(MOST_CREDIT_J),
            held: 0.0,
            target: 0.0,
            played: 0.0,
            filtered: 0.0,
        }
    }
}

impl Incoming {
    pub(super) fn new(medium: Medium) -> Self {
        Self {
            tick_s: medium.tick_s,
            filter_share: 1.0 - (-medium.filter_rad_s() * medium.tick_s).exp(),
            most_pull: 0.5 * medium.root * PULL_SPEED_M_S,
            playout: Playout::new(medium.tick_s),
            axes: [Axis::new(); 3],
            gap: 0,
        }
    }

    /// As new, with the memory that it has.
    pub(super) fn restart(&mut self) {
        self.playout.restart();
        self.axes = [Axis::new(); 3];
        self.gap = 0;
    }

    pub(super) fn on_sample(&mut self, now: Timestamp, header: &Header, sample: Sample) {
        self.playout
            .on_frame(now, header.sequence, header.sent_ns, sample);
    }

    /// Energy that the port beside it had left over, J.
    pub(super) fn receive_energy(&mut self, energy_j: Vec3) {
        for (axis, &energy_j) in self.axes.iter_mut().zip(energy_j.iter()) {
            axis.credit.settle(energy_j);
        }
    }

    /// The wave that acts in this tick. Call once a tick.
    pub(super) fn play(&mut self, now: Timestamp) -> Vec3 {
        self.gap = self.gap.saturating_add(1);
        for axis in &mut self.axes {
            axis.target += axis.held * self.tick_s;
        }
        while let Some(sample) = self.playout.take(now) {
            self.gap = 0;
            for (number, axis) in self.axes.iter_mut().enumerate() {
                axis.on_sample(
                    sample.wave[number],
                    sample.integral[number],
                    sample.energy_j[number],
                );
            }
        }
        let held_ticks = HELD_S / self.tick_s;
        if held_ticks < f64::from(self.gap) {
            for axis in &mut self.axes {
                axis.held = 0.0;
            }
        }
        let (tick_s, most_pull, share) = (self.tick_s, self.most_pull, self.filter_share);
        Vec3::from_fn(|number, _| {
            let axis = &mut self.axes[number];
            let wave = axis.play(tick_s, most_pull, held_ticks);
            axis.filtered += share * (wave - axis.filtered);
            axis.filtered
        })
    }
}

impl Axis {
    fn on_sample(&mut self, wave: f64, integral: f64, energy_j: f64) {
        self.credit.settle(self.counter.increment_j(energy_j));
        let newest_j = self.newest_j.replace(energy_j);
        if newest_j.is_none_or(|newest_j| energy_j < newest_j) {
            // The peer has started, perhaps anew: nothing is owed for what was before.
            self.played = integral;
        }
        self.target = integral;
        self.held = wave;
    }

    fn play(&mut self, tick_s: f64, most_pull: f64, held_ticks: f64) -> f64 {
        let energy_of = |wave: f64| 0.5 * tick_s * wave * wave;
        let behind = self.target - self.held * tick_s - self.played;
        let pulled = self.held + (PULL_PER_S * behind).clamp(-most_pull, most_pull);
        // To lengthen a wave costs what the credit has beyond the reserve for gaps.
        let spare_j = (self.credit.level_j() - held_ticks * energy_of(self.held)).max(0.0);
        let longest = (self.held * self.held + 2.0 * spare_j / tick_s).sqrt();
        let covered = (2.0 * self.credit.at_hand_j() / tick_s).sqrt();
        let most = longest.min(covered);
        let wave = pulled.clamp(-most, most);
        self.credit.settle(-energy_of(wave));
        self.played += wave * tick_s;
        wave
    }
}

/// The waves that go.
#[derive(Clone, Copy)]
pub(super) struct Outgoing {
    tick_s: f64,
    most_pull: f64,
    full_need: f64,
    cushion: [Tank; 3],
    /// Integral of what should have gone out and did not, √W s.
    owed: Vec3,
    sample: Sample,
}

impl Outgoing {
    pub(super) fn new(medium: Medium) -> Self {
        Self {
            tick_s: medium.tick_s,
            most_pull: 0.5 * medium.root * PULL_SPEED_M_S,
            full_need: FULL_NEED_M * medium.root,
            cushion: [Tank::empty(CUSHION_J); 3],
            owed: Vec3::zeros(),
            sample: Sample::default(),
        }
    }

    /// Sends the wave `nominal`, or as much of it as `earned_j` and the cushion cover. Returns the energy that is left
    /// over, J.
    pub(super) fn send(&mut self, nominal: Vec3, earned_j: Vec3) -> Vec3 {
        Vec3::from_fn(|axis, _| {
            let cushion = &mut self.cushion[axis];
            let at_hand_j = (cushion.level_j() + earned_j[axis]).max(0.0);
            let pull = (PULL_PER_S * self.owed[axis]).clamp(-self.most_pull, self.most_pull);
            let most = (2.0 * at_hand_j / self.tick_s).sqrt();
            let wave = (nominal[axis] + pull).clamp(-most, most);
            let spent_j = 0.5 * self.tick_s * wave * wave;
            self.owed[axis] += (nominal[axis] - wave) * self.tick_s;
            self.sample.wave[axis] = wave;
            self.sample.integral[axis] += wave * self.tick_s;
            self.sample.energy_j[axis] += spent_j;
            cushion.settle(earned_j[axis] - spent_j)
        })
    }

    /// What goes into the frame.
    pub(super) fn sample(&self) -> &Sample {
        &self.sample
    }

    /// How much an axis needs energy of its own, 0 to 1: it owes displacement, or its cushion is not full.
    pub(super) fn need(&self, axis: usize) -> f64 {
        let owed = self.owed[axis].abs() / self.full_need;
        let missing = 1.0 - self.cushion[axis].level_j() / CUSHION_J;
        owed.max(missing).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::time::Duration;

    const TICK: Duration = Duration::from_millis(1);
    const TICK_S: f64 = 1e-3;

    fn medium() -> Medium {
        Medium {
            tick_s: TICK_S,
            impedance: 20.0,
            root: 40.0_f64.sqrt(),
        }
    }

    fn energy_j(wave: f64) -> f64 {
        0.5 * TICK_S * wave * wave
    }

    /// A sender of given waves along x, a line that loses what it is told to, and what is played at its end, tick by
    /// tick.
    fn played(waves: &[f64], is_lost: impl Fn(usize) -> bool) -> (Incoming, Vec<f64>) {
        let mut incoming = Incoming::new(medium());
        let (mut integral, mut energy) = (0.0, 0.0);
        let mut now = Timestamp::ZERO;
        let played = waves.iter().enumerate().map(|(tick, &wave)| {
            now = now.after(TICK);
            integral += wave * TICK_S;
            energy += energy_j(wave);
            if !is_lost(tick) {
                let header = Header {
                    sequence: tick as u32,
                    sent_ns: now.as_nanos(),
                    ..Header::default()
                };
                let along = |x: f64| [x, 0.0, 0.0];
                let sample = Sample::new(along(wave), along(integral), along(energy));
                incoming.on_sample(now, &header, sample);
            }
            incoming.play(now)[0]
        });
        let played = played.collect();
        (incoming, played)
    }

    proptest! {
        /// What a sender vouches for is the energy of the waves that it sent, and never more than it had earned.
        #[test]
        fn a_sender_vouches_for_what_it_sent_and_had(
            ticks in prop::collection::vec((-3.0..3.0, -1e-4..3e-3), 1..300)
        ) {
            let mut outgoing = Outgoing::new(medium());
            let (mut sent_j, mut earned_j, mut left_over_j) = (0.0, 0.0, 0.0);
            for (nominal, earned) in ticks {
                let along = |x: f64| Vec3::new(x, 0.0, 0.0);
                left_over_j += outgoing.send(along(nominal), along(earned))[0];
                earned_j += earned;
                let sample = outgoing.sample();
                sent_j += energy_j(sample.wave[0]);
                prop_assert!((sample.energy_j[0] - sent_j).abs() < 1e-12);
                // A tick that cost more than there was leaves a hole, which is filled before anything is sent.
                prop_assert!(sent_j + left_over_j <= earned_j + CUSHION_J + 300.0 * 1e-4);
            }
        }

        /// What is played never has more energy than the frames that came have vouched for.
        #[test]
        fn no_more_is_played_than_came(
            ticks in prop::collection::vec((-3.0..3.0, prop::bool::weighted(0.4)), 1..400)
        ) {
            let waves: Vec<f64> = ticks.iter().map(|(wave, _)| *wave).collect();
            let (_, played) = played(&waves, |tick| ticks[tick].1);
            // The first frame is where counting starts; what it holds itself is not credited.
            let first = ticks.iter().position(|(_, lost)| !lost).unwrap_or(ticks.len());
            let mut vouched_j = 0.0;
            let mut played_j = 0.0;
            let mut pending_j = 0.0;
            for (tick, (wave, lost)) in ticks.iter().enumerate() {
                if first < tick {
                    pending_j += energy_j(*wave);
                    if !lost {
                        vouched_j += std::mem::take(&mut pending_j);
                    }
                }
                played_j += energy_j(played[tick]);
                prop_assert!(played_j <= vouched_j + 1e-12, "tick {tick}: {played_j} of {vouched_j} J");
            }
        }
    }

    /// A run of lost waves is a displacement that is missing, and is made up for from the energy that the next frame
    /// vouches for.
    #[test]
    fn what_was_lost_is_made_up_for() {
        let mut waves = vec![0.0; 50];
        waves.extend([0.6; 20]);
        waves.extend([0.0; 600]);
        let (_, played) = played(&waves, |tick| (50..70).contains(&tick));
        let missing = waves.iter().sum::<f64>() - played.iter().sum::<f64>();
        assert!(missing.abs() < 0.05 * 20.0 * 0.6, "{missing} of 12");
    }

    /// Silence is zero, not the last wave for as long as the credit lasts.
    #[test]
    fn the_last_wave_is_not_held_into_silence() {
        // Waves that come and go leave credit: of the strong ones before, most were lost.
        let mut waves = vec![0.0; 10];
        waves.extend([2.0; 12]);
        waves.extend([0.2; 300]);
        waves.extend([0.2; 200]);
        let (incoming, played) = played(&waves, |tick| (11..22).contains(&tick) || 322 <= tick);
        assert!(
            1e-4 < incoming.axes[0].credit.level_j(),
            "no credit to hold it by"
        );
        let held_ticks = (HELD_S / TICK_S) as usize;
        assert!(0.15 < played[320]);
        // The filter needs its own 25 ms a few times over.
        assert!(
            played[322 + held_ticks + 150].abs() < 0.01,
            "{:?}",
            &played[322..]
        );
    }

    /// Energy that nobody played is not saved up for ever: it could feed a swing for a long time.
    #[test]
    fn credit_is_bounded() {
        let waves: Vec<f64> = (0..2000)
            .map(|tick| if tick % 2 == 0 { 3.0 } else { 0.0 })
            .collect();
        // Only the zeros arrive, and vouch for what was between them.
        let (incoming, _) = played(&waves, |tick| tick % 2 == 0);
        assert!(incoming.axes[0].credit.level_j() <= MOST_CREDIT_J);
        assert!(0.5 * MOST_CREDIT_J < incoming.axes[0].credit.level_j());
    }
}
