//! What the person wants: the muscle force `u_h` as a function of time and of what the handle does.

use std::f64::consts::TAU;

use crate::path::{Path, PathError, Setpoint, Waypoint};
use crate::track::Track;
use crate::{Axes, Vec3};

/// Stiffness of the hand's own position control, N/m. Human wrists and arms in a firm grip show 200 to 800 N/m.
const HAND_STIFFNESS_N_PER_M: f64 = 300.0;
/// Damping beside it, N s/m.
const HAND_DAMPING_N_S_PER_M: f64 = 30.0;
/// Nobody pushes harder than this, N, nor does a step: a push builds up over [`RISE_S`].
const HAND_FORCE_LIMIT_N: f64 = 15.0;
/// Time a voluntary push takes to build up, s.
const RISE_S: f64 = 0.05;

/// Half the room in which the cutting strokes stay, handle displacement from home, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Along the strokes.
    pub x_m: f64,
    /// Across them.
    pub y_m: f64,
    /// How far below home the deepest level lies.
    pub depth_m: f64,
}

/// What the person wants to do.
#[derive(Clone, Debug)]
pub enum Intent {
    /// A hand that rests: no force of its own, only the arm's weight on the handle.
    Idle,
    /// A steady push from the muscles, N.
    ConstantForce {
        /// The push, N.
        force_n: [f64; 3],
    },
    /// A steady force *at the sensor*, N, whatever the arm does: the paper's experiment.
    SensorForce {
        /// The force at the sensor, N.
        force_n: [f64; 3],
    },
    /// A swinging push.
    Sinusoid {
        /// Amplitude, N.
        amplitude_n: [f64; 3],
        /// Frequency, Hz.
        frequency_hz: f64,
    },
    /// Follow a path once and stay at its end.
    Trajectory(Path),
    /// Strokes over the block, level by level, then again from the top on a fresh block.
    Cutting(Path),
    /// Do what a hand did once: go where it went, and press as it pressed. Where the handle answers otherwise now, the
    /// hand pulls it back to its way, as in a [trajectory](Intent::Trajectory).
    Played(Track),
}

/// Why an intent cannot be had.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum IntentError {
    /// A number is not finite.
    #[error("{field} is {got}, need a finite number")]
    NotFinite {
        /// Which quantity.
        field: &'static str,
        /// As given.
        got: f64,
    },
    /// The cutting room is empty.
    #[error("cutting needs a reach above zero, got {x_m} x {y_m} x {depth_m} m")]
    NoRoom {
        /// Along the strokes, m.
        x_m: f64,
        /// Across them, m.
        y_m: f64,
        /// Down, m.
        depth_m: f64,
    },
    /// The path is wrong.
    #[error(transparent)]
    Path(#[from] PathError),
}

/// Strokes of the cutting intent go at this speed, m/s: a calm hand with a wire tool.
const CUTTING_SPEED_M_S: f64 = 0.04;
/// Moves through air.
const AIR_SPEED_M_S: f64 = 0.08;
/// Lanes are this far apart, m: three quarters of the default ball.
const LANE_PITCH_M: f64 = 0.009;
/// Each level lies this much lower, m.
const LEVEL_PITCH_M: f64 = 0.004;
/// Height above home between levels, m.
const AIR_HEIGHT_M: f64 = 0.012;

impl Intent {
    /// A steady push.
    ///
    /// # Errors
    /// A component is not finite.
    pub fn constant_force(force_n: [f64; 3]) -> Result<Self, IntentError> {
        require_finite("force_n", &force_n)?;
        Ok(Self::ConstantForce { force_n })
    }

    /// A steady force at the sensor.
    ///
    /// # Errors
    /// A component is not finite.
    pub fn sensor_force(force_n: [f64; 3]) -> Result<Self, IntentError> {
        require_finite("force_n", &force_n)?;
        Ok(Self::SensorForce { force_n })
    }

    /// A swinging push.
    ///
    /// # Errors
    /// A number is not finite.
    pub fn sinusoid(amplitude_n: [f64; 3], frequency_hz: f64) -> Result<Self, IntentError> {
        require_finite("amplitude_n", &amplitude_n)?;
        require_finite("frequency_hz", &[frequency_hz])?;
        Ok(Self::Sinusoid {
            amplitude_n,
            frequency_hz,
        })
    }

    /// Follow a path once.
    ///
    /// # Errors
    /// The waypoints make no path.
    pub fn trajectory(waypoints: &[Waypoint]) -> Result<Self, IntentError> {
        Ok(Self::Trajectory(Path::new(waypoints)?))
    }

    /// Serpentine strokes along x within `reach`, level by level.
    ///
    /// # Errors
    /// The reach is empty or not finite.
    pub fn cutting(reach: Reach) -> Result<Self, IntentError> {
        let Reach { x_m, y_m, depth_m } = reach;
        let is_room = [x_m, y_m, depth_m]
            .iter()
            .all(|half| half.is_finite() && 0.0 < *half);
        if !is_room {
            return Err(IntentError::NoRoom { x_m, y_m, depth_m });
        }
        let lanes = (2.0 * y_m / LANE_PITCH_M).floor() as i32;
        let levels = (depth_m / LEVEL_PITCH_M).floor().max(1.0) as i32;
        let mut waypoints = Vec::new();
        for level in 1..=levels {
            let z = -f64::from(level) * LEVEL_PITCH_M;
            // Each level is a little smaller: terraces, so that the picture shows depth.
            let shrink = 1.0 - 0.6 * f64::from(level - 1) / f64::from(levels);
            let mut side = -1.0;
            for lane in 0..=lanes {
                let y = if lanes == 0 {
                    0.0
                } else {
                    (2.0 * f64::from(lane) / f64::from(lanes) - 1.0) * y_m * shrink
                };
                let start = [side * x_m * shrink, y, z];
                if lane == 0 {
                    waypoints.push(Waypoint {
                        position_m: [start[0], y, AIR_HEIGHT_M],
                        speed_m_s: AIR_SPEED_M_S,
                    });
                }
                waypoints.push(Waypoint {
                    position_m: start,
                    speed_m_s: CUTTING_SPEED_M_S,
                });
                waypoints.push(Waypoint {
                    position_m: [-start[0], y, z],
                    speed_m_s: CUTTING_SPEED_M_S,
                });
                side = -side;
            }
            let last = waypoints
                .last()
                .map_or([0.0; 3], |waypoint| waypoint.position_m);
            waypoints.push(Waypoint {
                position_m: [last[0], last[1], AIR_HEIGHT_M],
                speed_m_s: AIR_SPEED_M_S,
            });
        }
        waypoints.push(Waypoint {
            position_m: [0.0, 0.0, AIR_HEIGHT_M],
            speed_m_s: AIR_SPEED_M_S,
        });
        Ok(Self::Cutting(Path::new(&waypoints)?))
    }

    /// Length of one round of a cutting intent, s; `None` for intents without rounds.
    pub fn round_s(&self) -> Option<f64> {
        match self {
            Self::Cutting(path) => Some(path.lasts_s()),
            _ => None,
        }
    }

    /// Where the lift should be at `t_s`, m.
    pub(crate) fn lift_m(&self, t_s: f64) -> f64 {
        self.setpoint(t_s)
            .map_or(0.0, |setpoint| setpoint.position.z)
    }

    /// Force at the sensor where the intent fixes it.
    pub(crate) fn sensor_force_n(&self, t_s: f64) -> Option<Vec3> {
        match self {
            Self::SensorForce { force_n } => Some(Vec3::from(*force_n) * rise(t_s)),
            _ => None,
        }
    }

    /// Muscle force `u_h`, N, at `t_s` for a handle at `position` moving at `velocity`. `arm` is stiffness and damping
    /// of the arm itself, which a person who moves on purpose has learnt to overcome.
    pub(crate) fn muscle_force(
        &self,
        t_s: f64,
        position: Vec3,
        velocity: Vec3,
        arm: (f64, f64),
        axes: Axes,
    ) -> Vec3 {
        let mut force = match self {
            Self::Idle | Self::SensorForce { .. } => Vec3::zeros(),
            Self::ConstantForce { force_n } => Vec3::from(*force_n) * rise(t_s),
            Self::Sinusoid {
                amplitude_n,
                frequency_hz,
            } => Vec3::from(*amplitude_n) * ((TAU * frequency_hz * t_s).sin() * rise(t_s)),
            Self::Trajectory(_) | Self::Cutting(_) => {
                let setpoint = self
                    .setpoint(t_s)
                    .unwrap_or(Setpoint { position, velocity });
                let servo = (setpoint.position - position) * HAND_STIFFNESS_N_PER_M
                    + (setpoint.velocity - velocity) * HAND_DAMPING_N_S_PER_M;
                let learnt = setpoint.position * arm.0 + setpoint.velocity * arm.1;
                capped(servo + learnt, HAND_FORCE_LIMIT_N) * rise(t_s)
            }
            Self::Played(track) => {
                let (wanted, speed, pressed) = track.at(t_s);
                let servo = (wanted - position) * HAND_STIFFNESS_N_PER_M
                    + (speed - velocity) * HAND_DAMPING_N_S_PER_M;
                // The sensor measures what the muscles do beyond moving the arm.
                let learnt = wanted * arm.0 + speed * arm.1 + pressed;
                capped(servo + learnt, HAND_FORCE_LIMIT_N) * rise(t_s)
            }
        };
        if axes == Axes::Two {
            force.z = 0.0;
        }
        force
    }

    fn setpoint(&self, t_s: f64) -> Option<Setpoint> {
        match self {
            Self::Trajectory(path) => Some(path.at(t_s)),
            Self::Cutting(path) => Some(path.at(t_s % path.lasts_s())),
            Self::Played(track) => {
                let (position, velocity, _) = track.at(t_s);
                Some(Setpoint { position, velocity })
            }
            _ => None,
        }
    }
}

fn rise(t_s: f64) -> f64 {
    (t_s / RISE_S).clamp(0.0, 1.0)
}

fn capped(v: Vec3, limit: f64) -> Vec3 {
    let length = v.norm();
    if length <= limit {
        v
    } else {
        v * (limit / length)
    }
}

fn require_finite(field: &'static str, values: &[f64]) -> Result<(), IntentError> {
    let spoilt = values.iter().find(|value| !value.is_finite());
    spoilt.map_or(Ok(()), |&got| Err(IntentError::NotFinite { field, got }))
}

#[cfg(test)]
#[allow(
    clippy::float_cmp,
    reason = "zero and one are meant exactly: a ramp ends, a gain is full"
)]
mod tests {
    use super::*;

    const REACH: Reach = Reach {
        x_m: 0.045,
        y_m: 0.018,
        depth_m: 0.024,
    };

    #[test]
    fn cutting_strokes_stay_within_the_reach() {
        let intent = Intent::cutting(REACH).unwrap();
        let round = intent.round_s().unwrap();
        let mut deepest = 0.0_f64;
        for ms in 0..(round * 1e3) as u32 {
            let setpoint = intent.setpoint(f64::from(ms) * 1e-3).unwrap().position;
            assert!(setpoint.x.abs() <= REACH.x_m + 1e-12 && setpoint.y.abs() <= REACH.y_m + 1e-12);
            deepest = deepest.min(setpoint.z);
        }
        assert!((deepest + REACH.depth_m).abs() < 1e-9, "{deepest}");
    }

    #[test]
    fn a_push_builds_up_and_never_steps() {
        let intent = Intent::constant_force([3.0, 0.0, 0.0]).unwrap();
        let at = |t| {
            intent
                .muscle_force(t, Vec3::zeros(), Vec3::zeros(), (6.0, 2.0), Axes::Two)
                .x
        };
        assert_eq!(at(0.0), 0.0);
        assert_eq!(at(1.0), 3.0);
        assert!(
            (0..100).all(|k| (at(f64::from(k + 1) * 1e-3) - at(f64::from(k) * 1e-3)).abs() < 0.07)
        );
    }

    #[test]
    fn numbers_that_are_none_are_refused_by_name() {
        let refused = Intent::constant_force([0.0, f64::INFINITY, 0.0]).unwrap_err();
        assert_eq!(
            refused,
            IntentError::NotFinite {
                field: "force_n",
                got: f64::INFINITY
            }
        );
        assert!(
            Intent::cutting(Reach {
                x_m: f64::NAN,
                ..REACH
            })
            .is_err()
        );
    }
}
