//! The device's place at every tick, from samples that come when they come.
//!
//! A sample has the time at which it was taken. What is no place, is older than what is there, or has waited for too
//! long, is not taken. Two ways lead from samples to a place:
//!
//! - [`Playback::Held`]: the newest sample counts until the next one comes. For a device that is sampled about as often
//!   as the loop steps. No time is lost.
//! - [`Playback::Interpolated`]: the samples are played one longest interval late, on straight lines between them.
//!   There always is a next sample then, and nothing is ever extrapolated; where it fails to come, the last one holds.
//!   A step of the hand every 16 ms becomes a slope. It costs one interval of the slowest rate: 16.7 ms at 60 Hz.
//!
//! The place never moves faster than the device may. Whoever seems to has been lifted and put elsewhere, and a leap
//! moves the grip, not the handle: from a leap on, places are counted from where it ended.
//!
//! The velocity is the place's difference, through a filter `v += a (difference - v)` with `a = T / (tau + T)`: gain 1
//! at rest, nowhere more.

use crate::stiffness::DeviceTiming;
use crate::vector::{Vector, capped, is_within, minus, norm, plus, times};

/// No device here is as far from its home as this, m.
const FARTHEST_M: f64 = 100.0;
/// Samples that wait to be played: two intervals, eight to an interval. Of more, the newest replaces the one before.
const ROOM: usize = 16;
const TO_AN_INTERVAL: f64 = 8.0;

/// How samples become places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Playback {
    /// The newest sample, until the next.
    Held,
    /// Lines between the samples, one longest interval late.
    Interpolated,
}

impl Playback {
    /// Time that it costs, s.
    pub fn latency_s(self, timing: &DeviceTiming) -> f64 {
        match self {
            Self::Held => 0.0,
            Self::Interpolated => timing.interval_s(),
        }
    }
}

/// What became of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken {
    /// It counts.
    Used,
    /// It counts from here on: the device was elsewhere before, and no hand moves so fast.
    Leapt,
    /// One at least as new is there.
    Old,
    /// It had waited for longer than a place is held.
    Stale,
    /// A part is no number, or farther away than any device goes.
    Implausible,
}

/// A place as it is played.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Played {
    /// Displacement from where counting began, in the device's coordinates, m.
    pub position_m: [f64; 3],
    /// Its rate, through the filter, m/s.
    pub velocity_m_s: [f64; 3],
}

/// What a reading is made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReadingSetup {
    pub(crate) timing: DeviceTiming,
    pub(crate) playback: Playback,
    pub(crate) tick_s: f64,
    /// Greatest speed of the device.
    pub(crate) speed_m_s: f64,
    /// Time constant of the velocity's filter.
    pub(crate) filter_s: f64,
    /// Age up to which a sample counts.
    pub(crate) hold_s: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sample {
    at_ns: u64,
    place: Vector,
}

/// The device's place at every tick.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    setup: ReadingSetup,
    /// Oldest first.
    samples: [Sample; ROOM],
    len: usize,
    /// What is added to the device's own places, so that no leap shows.
    shift: Vector,
    /// How far the device may have come by now.
    allowance_m: f64,
    place: Option<Vector>,
    velocity: Vector,
    /// From the sample before to the newest, m/s.
    held_rate: Vector,
}

impl Reading {
    pub(crate) fn new(setup: ReadingSetup) -> Self {
        Self {
            setup,
            samples: [Sample::default(); ROOM],
            len: 0,
            shift: [0.0; 3],
            allowance_m: 0.0,
            place: None,
            velocity: [0.0; 3],
            held_rate: [0.0; 3],
        }
    }

    /// The device was at `position_m` at `at_ns`, which is told at `now_ns`. A stamp ahead of now counts as now.
    pub fn take(&mut self, now_ns: u64, at_ns: u64, position_m: [f64; 3]) -> Taken {
        if !is_within(position_m, FARTHEST_M) {
            return Taken::Implausible;
        }
        let at_ns = at_ns.min(now_ns);
        if self.setup.hold_s < seconds(now_ns - at_ns) {
            return Taken::Stale;
        }
        if self.is_lost(now_ns) {
            self.restart();
        }
        let Some(last) = self.newest() else {
            self.samples[0] = Sample {
                at_ns,
                place: plus(position_m, self.shift),
            };
            self.len = 1;
            self.allowance_m = self.setup.speed_m_s * self.setup.timing.interval_s();
            return Taken::Used;
        };
        if at_ns <= last.at_ns {
            return Taken::Old;
        }
        let since_s = seconds(at_ns - last.at_ns);
        let most_m = self.setup.speed_m_s * since_s.max(self.setup.timing.interval_s());
        self.allowance_m = (self.allowance_m + self.setup.speed_m_s * since_s).min(most_m);
        let way = minus(plus(position_m, self.shift), last.place);
        let way_m = norm(way);
        if self.allowance_m < way_m {
            self.shift = minus(last.place, position_m);
            self.held_rate = [0.0; 3];
            self.push(Sample {
                at_ns,
                place: last.place,
            });
            return Taken::Leapt;
        }
        self.allowance_m -= way_m;
        self.held_rate = times(way, 1.0 / since_s);
        self.push(Sample {
            at_ns,
            place: plus(last.place, way),
        });
        Taken::Used
    }

    /// The place at `now_ns`, one tick after the last one; `None` when the newest sample is too old to count.
    pub fn step(&mut self, now_ns: u64) -> Option<Played> {
        let newest = self.newest()?;
        if self.is_lost(now_ns) {
            self.velocity = [0.0; 3];
            return None;
        }
        let tick_s = self.setup.tick_s;
        let before = self.place.unwrap_or(self.samples[0].place);
        let (place, rate) = match self.setup.playback {
            Playback::Held => (newest.place, self.held_rate),
            Playback::Interpolated => {
                let way = minus(self.played(now_ns), before);
                let way = capped(way, self.setup.speed_m_s * tick_s);
                (plus(before, way), times(way, 1.0 / tick_s))
            }
        };
        let share = tick_s / (self.setup.filter_s + tick_s);
        self.velocity = plus(self.velocity, times(minus(rate, self.velocity), share));
        self.place = Some(place);
        Some(Played {
            position_m: place,
            velocity_m_s: self.velocity,
        })
    }

    fn newest(&self) -> Option<Sample> {
        self.len.checked_sub(1).map(|last| self.samples[last])
    }

    fn is_lost(&self, now_ns: u64) -> bool {
        self.newest()
            .is_some_and(|last| self.setup.hold_s < seconds(now_ns.saturating_sub(last.at_ns)))
    }

    /// What comes after a loss has no past.
    fn restart(&mut self) {
        self.len = 0;
        self.place = None;
        self.velocity = [0.0; 3];
        self.held_rate = [0.0; 3];
    }

    fn push(&mut self, sample: Sample) {
        let crowded_s = self.setup.timing.interval_s() / TO_AN_INTERVAL;
        let is_crowded =
            1 < self.len && seconds(sample.at_ns - self.samples[self.len - 2].at_ns) < crowded_s;
        if is_crowded {
            self.samples[self.len - 1] = sample;
            return;
        }
        if self.len == ROOM {
            self.samples.copy_within(1.., 0);
            self.len -= 1;
        }
        self.samples[self.len] = sample;
        self.len += 1;
    }

    /// On the lines between the samples, one interval ago.
    fn played(&self, now_ns: u64) -> Vector {
        let late_ns = (self.setup.timing.interval_s() * 1e9) as u64;
        let at_ns = now_ns.saturating_sub(late_ns);
        let samples = &self.samples[..self.len];
        let Some(next) = samples.iter().position(|sample| at_ns < sample.at_ns) else {
            return samples[self.len - 1].place;
        };
        if next == 0 {
            return samples[0].place;
        }
        let (from, to) = (samples[next - 1], samples[next]);
        let share = seconds(at_ns - from.at_ns) / seconds(to.at_ns - from.at_ns);
        plus(from.place, times(minus(to.place, from.place), share))
    }
}

fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}
