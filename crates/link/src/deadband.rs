//! Perceptual coding: a frame is left out while nothing has changed that a hand could feel.
//!
//! Weber's law: a change is felt when it exceeds a share of what is there already. So a frame goes out when its signal
//! has left the band of [`DeadbandSettings::fraction`] around the one last sent, and at the latest after a heartbeat,
//! so that silence still means silence. Known since [HHCSB08] in docs/papers.md.
//!
//! The receiver holds what it got last. What it holds differs from what was left out by less than the band, so the
//! force is off by less than a hand can tell. Energy is another matter: many small errors add up. No scheme here counts
//! energy by what it holds; cumulative energies travel with the frames, and what a frame does not vouch for is not
//! spent.
//!
//! Which signal counts is the scheme's to say ([`HandleController::signal`](crate::scheme::HandleController::signal)):
//! what the other end really works with. Where that end cannot bridge a gap, every frame goes out.

use std::time::Duration;

use crate::Vec3;
use crate::time::Timestamp;

/// What a hand cannot feel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeadbandSettings {
    /// Share of a force or velocity below which its change is not felt, 0 to 1.
    pub fraction: f64,
    /// Change of force that is not felt however small the force, N.
    pub force_floor_n: f64,
    /// Change of velocity that is not felt however slow the motion, m/s.
    pub velocity_floor_m_s: f64,
    /// A frame goes out at least this often.
    pub heartbeat: Duration,
}

impl Default for DeadbandSettings {
    /// 7 % is the just noticeable difference of force; the floors are a tenth of the lightest touch and a hundredth of
    /// a calm hand's speed; the heartbeat lets five frames in a row be lost before a silence of 0.1 s is noticed.
    fn default() -> Self {
        Self {
            fraction: 0.07,
            force_floor_n: 0.02,
            velocity_floor_m_s: 1e-3,
            heartbeat: Duration::from_millis(20),
        }
    }
}

/// Settings of no deadband.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum DeadbandError {
    /// A number is out of range.
    #[error("{field} is {got}, wanted {wanted}")]
    OutOfRange {
        /// Which setting.
        field: &'static str,
        /// As given.
        got: f64,
        /// What is accepted.
        wanted: &'static str,
    },
    /// Frames would come too seldom to tell a silence.
    #[error(
        "heartbeat is {heartbeat:?}, wanted at most {most:?}, a quarter of the allowed silence"
    )]
    Heartbeat {
        /// As given.
        heartbeat: Duration,
        /// The longest.
        most: Duration,
    },
}

/// What a change is a change of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A force, N.
    Force,
    /// A velocity, m/s.
    Velocity,
}

/// What the other end works with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signal {
    /// Of what.
    pub quantity: Quantity,
    /// The value, in the quantity's unit.
    pub value: Vec3,
    /// The magnitude against which a change of it is felt, in the same unit.
    pub against: f64,
}

impl Signal {
    /// A force that is felt as itself, N.
    pub fn force(force_n: Vec3) -> Self {
        Self {
            quantity: Quantity::Force,
            value: force_n,
            against: force_n.norm(),
        }
    }

    /// A velocity that is felt as itself, m/s.
    pub fn velocity(velocity_m_s: Vec3) -> Self {
        Self {
            quantity: Quantity::Velocity,
            value: velocity_m_s,
            against: velocity_m_s.norm(),
        }
    }
}

/// Decides, frame by frame, what goes out.
#[derive(Clone, Copy, Debug)]
pub struct Deadband {
    settings: DeadbandSettings,
    sent: Option<(Timestamp, Option<Signal>)>,
}

impl Deadband {
    /// Nothing sent yet. `silence` is what the other side takes for a dead line.
    ///
    /// # Errors
    /// A setting is out of range.
    pub fn new(settings: DeadbandSettings, silence: Duration) -> Result<Self, DeadbandError> {
        let out_of_range = |field, got, wanted| DeadbandError::OutOfRange { field, got, wanted };
        if !(0.0..=1.0).contains(&settings.fraction) {
            return Err(out_of_range("fraction", settings.fraction, "0 to 1"));
        }
        let floors = [
            ("force_floor_n", settings.force_floor_n),
            ("velocity_floor_m_s", settings.velocity_floor_m_s),
        ];
        for (field, got) in floors {
            if !(got.is_finite() && 0.0 <= got) {
                return Err(out_of_range(field, got, "finite and not below 0"));
            }
        }
        let most = silence / 4;
        if most < settings.heartbeat {
            return Err(DeadbandError::Heartbeat {
                heartbeat: settings.heartbeat,
                most,
            });
        }
        Ok(Self {
            settings,
            sent: None,
        })
    }

    /// Whether the frame of `now` goes out, given its signal; `None` says that every one does. A frame said to go out
    /// counts as sent.
    pub fn should_send(&mut self, now: Timestamp, signal: Option<Signal>) -> bool {
        let stays = self.sent.is_some_and(|(at, sent)| {
            now.since(at) < self.settings.heartbeat
                && sent
                    .zip(signal)
                    .is_some_and(|(sent, signal)| self.feels_the_same(&sent, &signal))
        });
        if !stays {
            self.sent = Some((now, signal));
        }
        !stays
    }

    /// The longest that frames are left out.
    pub fn heartbeat(&self) -> Duration {
        self.settings.heartbeat
    }

    /// Forgets what was sent: the next frame goes out whatever it says.
    pub fn insist(&mut self) {
        self.sent = None;
    }

    fn feels_the_same(&self, sent: &Signal, signal: &Signal) -> bool {
        let floor = match signal.quantity {
            Quantity::Force => self.settings.force_floor_n,
            Quantity::Velocity => self.settings.velocity_floor_m_s,
        };
        // Against the weaker of the two, so that the error is within the share of what is felt and of what should be.
        let band = self.settings.fraction * sent.against.min(signal.against);
        sent.quantity == signal.quantity && (signal.value - sent.value).norm() <= band.max(floor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SILENCE: Duration = Duration::from_millis(100);

    fn at(ms: u64) -> Timestamp {
        Timestamp::from_nanos(ms * 1_000_000)
    }

    fn deadband() -> Deadband {
        Deadband::new(DeadbandSettings::default(), SILENCE).unwrap()
    }

    proptest! {
        /// Whatever the force does, what the receiver holds is within the band of what is, and no pause is longer than
        /// the heartbeat.
        #[test]
        fn the_held_force_is_never_off_by_more_than_the_band(
            steps in prop::collection::vec((-0.5..0.5, -0.5..0.5, -0.5..0.5), 1..400)
        ) {
            let mut deadband = deadband();
            let (mut force, mut held, mut sent_at) = (Vec3::zeros(), Vec3::zeros(), 0);
            for (ms, (x, y, z)) in (0_u64..).zip(steps) {
                force += Vec3::new(x, y, z);
                if deadband.should_send(at(ms), Some(Signal::force(force))) {
                    held = force;
                    sent_at = ms;
                }
                let band = 0.07 * force.norm().min(held.norm());
                prop_assert!((force - held).norm() <= band.max(0.02));
                prop_assert!(ms - sent_at < 20);
            }
        }
    }

    #[test]
    fn a_steady_force_goes_out_with_the_heartbeat_alone() {
        let mut deadband = deadband();
        let force = Signal::force(Vec3::new(2.0, 0.0, 0.0));
        let sent = (0..10_000)
            .filter(|&ms| deadband.should_send(at(ms), Some(force)))
            .count();
        assert_eq!(sent, 500);
    }

    #[test]
    fn without_a_signal_and_when_insisted_on_every_frame_goes_out() {
        let mut deadband = deadband();
        assert!((0..100).all(|ms| deadband.should_send(at(ms), None)));
        let still = Some(Signal::velocity(Vec3::zeros()));
        assert!(deadband.should_send(at(100), still));
        assert!(!deadband.should_send(at(101), still));
        deadband.insist();
        assert!(deadband.should_send(at(102), still));
    }

    #[test]
    fn settings_that_would_blind_the_watchdog_are_refused() {
        let sound = DeadbandSettings::default();
        for (broken, field) in [
            (
                DeadbandSettings {
                    fraction: f64::NAN,
                    ..sound
                },
                "fraction",
            ),
            (
                DeadbandSettings {
                    fraction: 1.1,
                    ..sound
                },
                "fraction",
            ),
            (
                DeadbandSettings {
                    force_floor_n: -1.0,
                    ..sound
                },
                "force_floor_n",
            ),
            (
                DeadbandSettings {
                    velocity_floor_m_s: f64::INFINITY,
                    ..sound
                },
                "velocity_floor_m_s",
            ),
        ] {
            let refused = Deadband::new(broken, SILENCE).unwrap_err();
            assert!(
                matches!(refused, DeadbandError::OutOfRange { field: got, .. } if got == field)
            );
        }
        let slow = DeadbandSettings {
            heartbeat: Duration::from_millis(26),
            ..sound
        };
        let refused = Deadband::new(slow, SILENCE).unwrap_err();
        assert!(matches!(refused, DeadbandError::Heartbeat { most, .. } if most == SILENCE / 4));
    }
}
