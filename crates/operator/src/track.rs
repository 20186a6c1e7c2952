//! A hand that was recorded: where it was in each tick, how fast, and how it pressed.

use crate::Vec3;

/// A hand in one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackPoint {
    /// Displacement from home, m.
    pub position_m: [f64; 3],
    /// Velocity, m/s.
    pub velocity_m_s: [f64; 3],
    /// Force of the hand on the handle, as its sensor measured it, N.
    pub hand_force_n: [f64; 3],
}

/// A hand tick by tick. After the last tick it rests there.
#[derive(Clone, Debug)]
pub struct Track {
    points: Vec<TrackPoint>,
    tick_s: f64,
}

/// There is nothing to play, or not in time.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TrackError {
    /// No tick.
    #[error("a track needs at least one tick")]
    Empty,
    /// A number that is none.
    #[error("tick {index} of a track has a number that is not finite")]
    NotFinite {
        /// Which tick, from 0.
        index: usize,
    },
    /// Not a time.
    #[error("a tick lasts {got} s, need a finite time above zero")]
    Tick {
        /// As given.
        got: f64,
    },
}

impl Track {
    /// A hand in ticks of `tick_s`.
    ///
    /// # Errors
    /// There is no tick, or a number is not finite.
    pub fn new(points: Vec<TrackPoint>, tick_s: f64) -> Result<Self, TrackError> {
        if points.is_empty() {
            return Err(TrackError::Empty);
        }
        if !(tick_s.is_finite() && 0.0 < tick_s) {
            return Err(TrackError::Tick { got: tick_s });
        }
        let is_finite = |point: &TrackPoint| {
            let vectors = [point.position_m, point.velocity_m_s, point.hand_force_n];
            vectors.iter().flatten().all(|number| number.is_finite())
        };
        match points.iter().position(|point| !is_finite(point)) {
            Some(index) => Err(TrackError::NotFinite { index }),
            None => Ok(Self { points, tick_s }),
        }
    }

    /// Position, velocity and force at a time.
    pub(crate) fn at(&self, t_s: f64) -> (Vec3, Vec3, Vec3) {
        let tick = (t_s / self.tick_s).round().max(0.0) as usize;
        let point = self.points[tick.min(self.points.len() - 1)];
        let rests = self.points.len() <= tick;
        let velocity = if rests { [0.0; 3] } else { point.velocity_m_s };
        (
            point.position_m.into(),
            velocity.into(),
            point.hand_force_n.into(),
        )
    }

    /// How long it moves, s.
    #[must_use]
    pub fn lasts_s(&self) -> f64 {
        self.points.len() as f64 * self.tick_s
    }
}
