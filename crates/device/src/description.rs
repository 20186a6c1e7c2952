//! What a device says of itself, for whoever chooses one.

use std::fmt;

/// What a device renders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Feedback {
    /// Vibration whose strength shows the size of a force. A hand that shakes is not pushed: this is called rumble, and
    /// never force.
    Rumble,
    /// A force along some axes, x first.
    Force {
        /// How many axes, 1 to 3.
        axes: usize,
        /// Greatest force that is ever asked of it, N.
        most_n: f64,
    },
}

impl Feedback {
    /// On how many axes it renders a force.
    #[must_use]
    pub const fn force_axes(self) -> usize {
        match self {
            Self::Rumble => 0,
            Self::Force { axes, .. } => axes,
        }
    }
}

/// A device, as it describes itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceDescription {
    /// What it is called.
    pub name: &'static str,
    /// Along how many axes it moves the handle, lift included.
    pub axes: usize,
    /// How far it reaches to either side of home, m; `None` where nothing limits it.
    pub workspace_m: Option<[f64; 3]>,
    /// What it renders.
    pub feedback: Feedback,
    /// Slowest rate at which its place is read and its force renewed, 1/s.
    pub rate_hz: f64,
    /// Whether it has a sensor for the hand's force. Where it has none, the force on the loop's handle is that of the
    /// virtual coupling, never a reading of zero.
    pub measures_force: bool,
}

/// On one line: `moves 3 axes, ±0.1 x ±0.1 x ±0.1 m; force 0 to 5 N on 3 axes; 500 Hz; cannot measure force`.
impl fmt::Display for DeviceDescription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "moves {} axes, ", self.axes)?;
        match self.workspace_m {
            Some([x, y, z]) => write!(f, "±{x} x ±{y} x ±{z} m; ")?,
            None => write!(f, "without limits; ")?,
        }
        match self.feedback {
            Feedback::Rumble => write!(f, "rumble, no force")?,
            Feedback::Force { axes, most_n } => {
                write!(f, "force 0 to {most_n} N on {axes} axes")?;
            }
        }
        let measures = if self.measures_force {
            "measures force"
        } else {
            "cannot measure force"
        };
        write!(f, "; {} Hz; {measures}", self.rate_hz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_device_cannot_do_is_said_and_never_shown_as_zero() {
        let pad = DeviceDescription {
            name: "pad",
            axes: 3,
            workspace_m: Some([0.05; 3]),
            feedback: Feedback::Rumble,
            rate_hz: 125.0,
            measures_force: false,
        };
        let said = pad.to_string();
        assert_eq!(
            said,
            "moves 3 axes, ±0.05 x ±0.05 x ±0.05 m; rumble, no force; 125 Hz; cannot measure force"
        );
        assert_eq!(pad.feedback.force_axes(), 0);
        let stick = DeviceDescription {
            feedback: Feedback::Force {
                axes: 2,
                most_n: 2.0,
            },
            measures_force: true,
            ..pad
        };
        assert!(
            stick
                .to_string()
                .ends_with("force 0 to 2 N on 2 axes; 125 Hz; measures force")
        );
    }
}
