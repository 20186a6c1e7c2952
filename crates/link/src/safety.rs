//! Safety, whatever the scheme: one place where input is checked, one where silence is noticed, one that every force
//! passes.
//!
//! - [`check`] is the only way in for numbers that come from outside the process: a value that is not finite, or
//!   greater than what it measures ever is, names its field and ends in a fault.
//! - [`Watchdog`] turns silence, and a line that delivers what had queued up, into a gain that ramps to 0, and a return
//!   into one that ramps to 1.
//! - [`ForceLimiter`] bounds the force and its slope; what leaves it is finite.

use std::fmt;
use std::time::Duration;

use crate::Vec3;
use crate::time::Timestamp;

/// A value from outside that is no measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field} is {flaw}")]
pub struct Implausible {
    /// Name of the quantity, with its unit.
    pub field: &'static str,
    /// What is wrong with it.
    pub flaw: Flaw,
}

/// Why a value is no measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    /// It is a NaN or an infinity.
    NotFinite,
    /// Nothing here is ever so large: see [`Measure::most`].
    TooLarge,
}

impl fmt::Display for Flaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "not finite",
            Self::TooLarge => "beyond what is plausible",
        })
    }
}

/// When what is implausible becomes a fault: one bad frame costs one frame, a peer that sends nothing else for a while
/// is broken.
#[derive(Clone, Copy, Debug, Default)]
pub struct Persistence {
    since: Option<Timestamp>,
}

impl Persistence {
    /// A plausible frame came.
    pub fn on_plausible(&mut self) {
        self.since = None;
    }

    /// An implausible one came; whether nothing else has for `span`.
    #[must_use]
    pub fn on_implausible(&mut self, now: Timestamp, span: Duration) -> bool {
        let since = *self.since.get_or_insert(now);
        span <= now.since(since)
    }
}

/// What a number from outside measures. Of each there is so much at most: far more than any loop here comes to, and so
/// little that nothing reckoned with it overflows or loses what it is added to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Metres; the clay's own frame ends at 128.
    Position,
    /// Metres a second.
    Velocity,
    /// A force in newtons.
    Force,
    /// A wave, √W: what force and velocity at their bounds come to at any impedance.
    Wave,
    /// What adds up while a session lives: energy in J, time integrals of waves in √W s, changes of force in N.
    Sum,
}

impl Measure {
    /// Greatest magnitude that is plausible.
    pub const fn most(self) -> f64 {
        match self {
            Self::Position => 100.0,
            Self::Velocity => 1e3,
            Self::Force => 1e6,
            Self::Wave => 1e9,
            Self::Sum => 1e12,
        }
    }

    fn flaw_of(self, value: f64) -> Option<Flaw> {
        if !value.is_finite() {
            Some(Flaw::NotFinite)
        } else if self.most() < value.abs() {
            Some(Flaw::TooLarge)
        } else {
            None
        }
    }
}

/// Checks the named vectors in turn.
///
/// # Errors
/// The first field that holds a NaN, an infinity, or more than is plausible of what it measures.
pub fn check(fields: &[(&'static str, Measure, &[f64])]) -> Result<(), Implausible> {
    for &(field, measure, values) in fields {
        if let Some(flaw) = values.iter().find_map(|&value| measure.flaw_of(value)) {
            return Err(Implausible { field, flaw });
        }
    }
    Ok(())
}

/// How a watchdog judges silence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WatchdogTimes {
    /// Silence longer than this starts the ramp down.
    pub silence: Duration,
    /// The ramp's length, either way.
    pub ramp: Duration,
}

/// Gain on everything remote: 1 while frames come, 0 after `silence` plus `ramp` without one. It never steps.
#[derive(Clone, Copy, Debug)]
pub struct Watchdog {
    times: WatchdogTimes,
    last_frame: Option<Timestamp>,
    /// What has come since then was no news.
    is_stalled: bool,
    gain: f64,
}

impl Watchdog {
    /// Starts at gain 0: the first frames ramp up.
    pub fn new(times: WatchdogTimes) -> Self {
        Self {
            times,
            last_frame: None,
            is_stalled: false,
            gain: 0.0,
        }
    }

    /// The first frame came, and what is remote starts from zero by itself: no ramp is needed.
    pub fn start_awake(&mut self, now: Timestamp) {
        self.last_frame = Some(now);
        self.gain = 1.0;
    }

    /// A valid frame came that is [fresh](crate::freshness).
    pub fn on_frame(&mut self, now: Timestamp) {
        self.last_frame = Some(now);
        self.is_stalled = false;
    }

    /// A frame came that is stale: silence from now on, until a fresh one comes, however long ago the last one was.
    pub fn on_stale_frame(&mut self) {
        self.is_stalled = true;
    }

    /// Whether what came last had waited in a queue.
    pub fn is_stalled(&self) -> bool {
        self.is_stalled
    }

    /// Advances by one tick of `tick_s` seconds and returns the gain, 0 to 1.
    pub fn step(&mut self, now: Timestamp, tick_s: f64) -> f64 {
        let change = tick_s / self.times.ramp.as_secs_f64();
        self.gain = if self.is_silent(now) {
            self.gain - change
        } else {
            self.gain + change
        }
        .clamp(0.0, 1.0);
        self.gain
    }

    /// The gain of the last step.
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// Whether no fresh frame came for longer than the allowed silence, or only stale ones have come since.
    pub fn is_silent(&self, now: Timestamp) -> bool {
        let is_over = |last| self.times.silence < now.since(last);
        self.is_stalled || self.last_frame.is_none_or(is_over)
    }

    /// Time since the last fresh frame.
    pub fn age(&self, now: Timestamp) -> Option<Duration> {
        self.last_frame.map(|last| now.since(last))
    }
}

/// Bounds of the force that reaches a hand or a tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceLimits {
    /// Greatest magnitude, N.
    pub force_n: f64,
    /// Greatest change of the vector, N/s.
    pub slew_n_per_s: f64,
}

/// The one limiter that a force passes on its way out.
#[derive(Clone, Copy, Debug)]
pub struct ForceLimiter {
    limits: ForceLimits,
    last: Vec3,
}

impl ForceLimiter {
    /// Starts at zero force.
    pub fn new(limits: ForceLimits) -> Self {
        Self {
            limits,
            last: Vec3::zeros(),
        }
    }

    /// The force to apply for one tick of `tick_s` when `wanted` is asked for: bounded, slew-limited, finite. A force
    /// that is not finite counts as zero force.
    pub fn step(&mut self, wanted: Vec3, tick_s: f64) -> Vec3 {
        let wanted = if wanted.iter().all(|f| f.is_finite()) {
            wanted
        } else {
            Vec3::zeros()
        };
        let bounded = capped(wanted, self.limits.force_n);
        self.last += capped(bounded - self.last, self.limits.slew_n_per_s * tick_s);
        self.last
    }

    /// The force applied last.
    pub fn last(&self) -> Vec3 {
        self.last
    }
}

/// `v`, shortened to length `limit` where it is longer.
pub fn capped(v: Vec3, limit: f64) -> Vec3 {
    let length = v.norm();
    if length <= limit {
        v
    } else {
        v * (limit / length)
    }
}

#[cfg(test)]
#[allow(
    clippy::float_cmp,
    reason = "zero and one are meant exactly: a ramp ends, a gain is full"
)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TICK_S: f64 = 1e-3;
    const TIMES: WatchdogTimes = WatchdogTimes {
        silence: Duration::from_millis(100),
        ramp: Duration::from_millis(50),
    };

    fn at(ms: u64) -> Timestamp {
        Timestamp::from_nanos(ms * 1_000_000)
    }

    #[test]
    fn silence_ramps_to_exactly_zero_within_silence_plus_ramp() {
        let mut dog = Watchdog::new(TIMES);
        for ms in 0..1000 {
            dog.on_frame(at(ms));
            dog.step(at(ms), TICK_S);
        }
        assert_eq!(dog.gain(), 1.0);
        for ms in 1000..1099 {
            assert_eq!(dog.step(at(ms), TICK_S), 1.0, "at {ms}");
        }
        let mut before = 1.0;
        for ms in 1099..1151 {
            let gain = dog.step(at(ms), TICK_S);
            assert!(before - gain <= 0.02 + 1e-12, "stepped at {ms}");
            before = gain;
        }
        assert_eq!(before, 0.0);
    }

    #[test]
    fn a_return_ramps_up_and_never_steps() {
        let mut dog = Watchdog::new(TIMES);
        let mut before = 0.0;
        for ms in 0..60 {
            dog.on_frame(at(ms));
            let gain = dog.step(at(ms), TICK_S);
            assert!(gain - before <= 0.02 + 1e-12);
            before = gain;
        }
        assert_eq!(before, 1.0);
    }

    proptest! {
        /// Whatever is asked for, what comes out keeps both bounds.
        #[test]
        fn no_force_passes_the_limits(wanted in prop::collection::vec(
            (prop::num::f64::ANY, prop::num::f64::ANY, -1e3..1e3), 1..200)
        ) {
            let limits = ForceLimits { force_n: 20.0, slew_n_per_s: 2000.0 };
            let mut limiter = ForceLimiter::new(limits);
            let mut before = Vec3::zeros();
            for (x, y, z) in wanted {
                let force = limiter.step(Vec3::new(x, y, z), TICK_S);
                prop_assert!(force.iter().all(|f| f.is_finite()));
                prop_assert!(force.norm() <= 20.0 * (1.0 + 1e-12));
                prop_assert!((force - before).norm() <= 2.0 * (1.0 + 1e-12));
                before = force;
            }
        }
    }

    #[test]
    fn a_steady_force_within_bounds_is_reached_and_kept() {
        let mut limiter = ForceLimiter::new(ForceLimits {
            force_n: 20.0,
            slew_n_per_s: 2000.0,
        });
        for _ in 0..10 {
            limiter.step(Vec3::new(3.0, -4.0, 12.0), TICK_S);
        }
        assert_eq!(limiter.last(), Vec3::new(3.0, -4.0, 12.0));
    }

    #[test]
    fn the_check_names_the_field() {
        let good = ("position_m", Measure::Position, &[0.0, 1.0][..]);
        assert_eq!(check(&[good]), Ok(()));
        assert_eq!(
            check(&[good, ("force_n", Measure::Force, &[f64::NAN])]),
            Err(Implausible {
                field: "force_n",
                flaw: Flaw::NotFinite
            })
        );
        assert_eq!(
            check(&[("force_n", Measure::Force, &[f64::INFINITY]), good]),
            Err(Implausible {
                field: "force_n",
                flaw: Flaw::NotFinite
            })
        );
    }

    /// The bounds are those that proto/SPEC.md states; each is the last value that passes.
    #[test]
    fn what_is_beyond_its_bound_is_no_measurement() {
        let bounds = [
            (Measure::Position, 1e2),
            (Measure::Velocity, 1e3),
            (Measure::Force, 1e6),
            (Measure::Wave, 1e9),
            (Measure::Sum, 1e12),
        ];
        for (measure, most) in bounds {
            for sign in [1.0, -1.0] {
                let judge = |value: f64| check(&[("value", measure, &[0.0, sign * value])]);
                assert_eq!(judge(most), Ok(()), "{measure:?}");
                for beyond in [most.next_up(), 1e155, f64::MAX] {
                    let refused = Implausible {
                        field: "value",
                        flaw: Flaw::TooLarge,
                    };
                    assert_eq!(judge(beyond), Err(refused));
                }
            }
        }
    }
}
