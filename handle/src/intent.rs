//! What the simulated operator is to do, as asked for on the command line.

use teleclay_operator::{IntentError, Reach, Waypoint};

/// An intent without what only the session can tell: the room for cutting.
#[derive(Clone, Debug, PartialEq)]
pub enum Intent {
    /// A hand that rests.
    Idle,
    /// A steady push from the muscles, N.
    ConstantForce {
        /// The push, N.
        force_n: [f64; 3],
    },
    /// A steady force at the sensor, N.
    SensorForce {
        /// The force, N.
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
    Trajectory {
        /// The path, handle displacement from home.
        waypoints: Vec<Waypoint>,
    },
    /// Strokes over the block, level by level, again and again.
    Cutting,
}

impl Intent {
    /// The operator's intent, with cutting strokes that stay within `room`.
    ///
    /// # Errors
    /// A number is not finite, the room is empty, or the waypoints make no path.
    pub fn within(&self, room: Reach) -> Result<teleclay_operator::Intent, IntentError> {
        match self {
            Self::Idle => Ok(teleclay_operator::Intent::Idle),
            Self::ConstantForce { force_n } => teleclay_operator::Intent::constant_force(*force_n),
            Self::SensorForce { force_n } => teleclay_operator::Intent::sensor_force(*force_n),
            Self::Sinusoid {
                amplitude_n,
                frequency_hz,
            } => teleclay_operator::Intent::sinusoid(*amplitude_n, *frequency_hz),
            Self::Trajectory { waypoints } => teleclay_operator::Intent::trajectory(waypoints),
            Self::Cutting => teleclay_operator::Intent::cutting(room),
        }
    }
}

/// Why a text is no list of waypoints.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WaypointsError {
    /// No waypoint in it.
    #[error("no waypoint, want X,Y,Z@SPEED in m and m/s, several parted by `;` or a new line")]
    Empty,
    /// One of them is not understood.
    #[error(
        "waypoint {number} is `{got}`, want X,Y,Z@SPEED in m and m/s, such as 0.02,-0.01,0@0.05"
    )]
    Waypoint {
        /// Which one, from 1.
        number: usize,
        /// As given.
        got: String,
    },
    /// A speed of zero or less never arrives.
    #[error("waypoint {number} has speed {got_m_s} m/s, want a finite one above zero")]
    Speed {
        /// Which one, from 1.
        number: usize,
        /// As given.
        got_m_s: f64,
    },
}

/// Reads waypoints: `X,Y,Z@SPEED`, m and m/s, parted by `;` or new lines; `#` starts a comment.
///
/// # Errors
/// The text is not such a list.
pub fn parse_waypoints(text: &str) -> Result<Vec<Waypoint>, WaypointsError> {
    let without_comment = |line: &str| line.split('#').next().unwrap_or_default().to_owned();
    let text: Vec<String> = text.lines().map(without_comment).collect();
    let parts = text
        .iter()
        .flat_map(|line| line.split(';'))
        .map(str::trim)
        .filter(|part| !part.is_empty());
    let waypoints = parts
        .enumerate()
        .map(|(index, part)| waypoint(index + 1, part))
        .collect::<Result<Vec<_>, _>>()?;
    if waypoints.is_empty() {
        Err(WaypointsError::Empty)
    } else {
        Ok(waypoints)
    }
}

/// Reads three finite numbers parted by commas.
pub(crate) fn parse_triple(text: &str) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| {
            part.trim()
                .parse::<f64>()
                .ok()
                .filter(|number| number.is_finite())
        })
        .collect::<Option<_>>()
        .ok_or_else(|| "want three numbers X,Y,Z".to_owned())?;
    numbers
        .try_into()
        .map_err(|numbers: Vec<f64>| format!("{} number(s), want three: X,Y,Z", numbers.len()))
}

fn waypoint(number: usize, text: &str) -> Result<Waypoint, WaypointsError> {
    let parsed = text.split_once('@').and_then(|(position, speed)| {
        let position_m = parse_triple(position).ok()?;
        Some(Waypoint {
            position_m,
            speed_m_s: speed.trim().parse().ok()?,
        })
    });
    let waypoint = parsed.ok_or_else(|| WaypointsError::Waypoint {
        number,
        got: text.to_owned(),
    })?;
    let got_m_s = waypoint.speed_m_s;
    if got_m_s.is_finite() && 0.0 < got_m_s {
        Ok(waypoint)
    } else {
        Err(WaypointsError::Speed { number, got_m_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waypoints_are_read_from_one_line_or_many() {
        let one = parse_waypoints("0.02,-0.01,0@0.05; 0,0,0@0.1").unwrap();
        let many =
            parse_waypoints("# out\n 0.02, -0.01, 0 @ 0.05  # slowly\n\n0,0,0@0.1\n").unwrap();
        assert_eq!(one, many);
        assert_eq!(
            one[0],
            Waypoint {
                position_m: [0.02, -0.01, 0.0],
                speed_m_s: 0.05
            }
        );
    }

    #[test]
    fn a_bad_waypoint_is_named_by_its_number() {
        let error = |text| parse_waypoints(text).unwrap_err().to_string();
        assert!(error("0,0,0@1; 0,0@1").starts_with("waypoint 2 is `0,0@1`"));
        assert!(error("0,0,inf@1").starts_with("waypoint 1 is"));
        assert!(error("0,0,0@0").contains("has speed 0 m/s"));
        assert!(error(" ; # nothing\n").starts_with("no waypoint"));
    }

    #[test]
    fn triples_have_three_finite_numbers() {
        assert_eq!(parse_triple("1, -2,3e-1"), Ok([1.0, -2.0, 0.3]));
        assert_eq!(
            parse_triple("1,2").unwrap_err(),
            "2 number(s), want three: X,Y,Z"
        );
        assert!(parse_triple("1,2,NaN").is_err() && parse_triple("1,2,x").is_err());
    }
}
