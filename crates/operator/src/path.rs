//! A path of straight legs, each at its own speed, that the hand wants to follow. A function of path time only.

use crate::Vec3;

/// A corner of a path and the speed towards it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// Where, handle displacement, m.
    pub position_m: [f64; 3],
    /// Speed of the leg that ends here, m/s.
    pub speed_m_s: f64,
}

/// Why waypoints make no path.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PathError {
    /// Fewer than one corner.
    #[error("a path needs at least one waypoint")]
    Empty,
    /// A coordinate is not finite.
    #[error("waypoint {index} has a coordinate that is not finite")]
    Position {
        /// Which waypoint, from 0.
        index: usize,
    },
    /// A speed is not a positive finite number.
    #[error("waypoint {index} has speed {got} m/s, need a finite one above zero")]
    Speed {
        /// Which waypoint, from 0.
        index: usize,
        /// As given.
        got: f64,
    },
}

#[derive(Clone, Copy, Debug)]
struct Leg {
    starts_s: f64,
    lasts_s: f64,
    from: Vec3,
    to: Vec3,
}

/// Straight legs from the origin through all waypoints; after the last one it rests there.
#[derive(Clone, Debug)]
pub struct Path {
    legs: Vec<Leg>,
    lasts_s: f64,
}

/// Where the path wants the hand to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Setpoint {
    pub(crate) position: Vec3,
    pub(crate) velocity: Vec3,
}

impl Path {
    /// A path that starts at the origin.
    ///
    /// # Errors
    /// No waypoint, a coordinate that is not finite, a speed that is not positive.
    pub fn new(waypoints: &[Waypoint]) -> Result<Self, PathError> {
        if waypoints.is_empty() {
            return Err(PathError::Empty);
        }
        let mut legs = Vec::with_capacity(waypoints.len());
        let (mut from, mut starts_s) = (Vec3::zeros(), 0.0);
        for (index, waypoint) in waypoints.iter().enumerate() {
            let to = Vec3::from(waypoint.position_m);
            if !to.iter().all(|x| x.is_finite()) {
                return Err(PathError::Position { index });
            }
            let got = waypoint.speed_m_s;
            if !(got.is_finite() && 0.0 < got) {
                return Err(PathError::Speed { index, got });
            }
            let lasts_s = (to - from).norm() / got;
            legs.push(Leg {
                starts_s,
                lasts_s,
                from,
                to,
            });
            starts_s += lasts_s;
            from = to;
        }
        Ok(Self {
            legs,
            lasts_s: starts_s,
        })
    }

    /// Time from the origin to the last waypoint, s.
    pub fn lasts_s(&self) -> f64 {
        self.lasts_s
    }

    /// Where to be at path time `t_s`.
    pub(crate) fn at(&self, t_s: f64) -> Setpoint {
        let index = self
            .legs
            .partition_point(|leg| leg.starts_s + leg.lasts_s <= t_s);
        let Some(leg) = self.legs.get(index) else {
            let end = self.legs.last().map_or_else(Vec3::zeros, |leg| leg.to);
            return Setpoint {
                position: end,
                velocity: Vec3::zeros(),
            };
        };
        let share = ((t_s - leg.starts_s) / leg.lasts_s).max(0.0);
        Setpoint {
            position: leg.from + (leg.to - leg.from) * share,
            velocity: (leg.to - leg.from) / leg.lasts_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(x: f64, y: f64, speed_m_s: f64) -> Waypoint {
        Waypoint {
            position_m: [x, y, 0.0],
            speed_m_s,
        }
    }

    #[test]
    fn legs_take_length_over_speed_and_the_end_is_kept() {
        let path = Path::new(&[corner(0.1, 0.0, 0.05), corner(0.1, 0.04, 0.02)]).unwrap();
        assert!((path.lasts_s() - 4.0).abs() < 1e-12);
        assert!((path.at(1.0).position - Vec3::new(0.05, 0.0, 0.0)).norm() < 1e-12);
        assert!((path.at(3.0).position - Vec3::new(0.1, 0.02, 0.0)).norm() < 1e-12);
        assert!((path.at(3.0).velocity - Vec3::new(0.0, 0.02, 0.0)).norm() < 1e-12);
        assert_eq!(path.at(99.0).velocity, Vec3::zeros());
        assert!((path.at(99.0).position - Vec3::new(0.1, 0.04, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn a_corner_visited_twice_costs_no_time_and_no_nan() {
        let path = Path::new(&[
            corner(0.1, 0.0, 0.1),
            corner(0.1, 0.0, 0.1),
            corner(0.2, 0.0, 0.1),
        ])
        .unwrap();
        let setpoint = path.at(1.0);
        assert!(
            setpoint
                .position
                .iter()
                .chain(setpoint.velocity.iter())
                .all(|x| x.is_finite())
        );
        assert!((path.lasts_s() - 2.0).abs() < 1e-12);
    }

    #[test]
    fn bad_waypoints_say_which() {
        assert_eq!(Path::new(&[]).unwrap_err(), PathError::Empty);
        assert_eq!(
            Path::new(&[corner(f64::NAN, 0.0, 1.0)]).unwrap_err(),
            PathError::Position { index: 0 }
        );
        let still = Path::new(&[corner(0.0, 0.0, 1.0), corner(1.0, 0.0, 0.0)]).unwrap_err();
        assert_eq!(still, PathError::Speed { index: 1, got: 0.0 });
    }
}
