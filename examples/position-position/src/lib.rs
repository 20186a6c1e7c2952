//! An example of a scheme of one's own: position to position, with damping at both ends. Source: [NOBB08] in
//! docs/papers.md; with delays that vary, [NBO11].
//!
//! ```text
//! felt(t)   = K (x_t(t - D2) - x_h(t)) - B v_h(t)                       at the handle
//! m x_t''   = K (x_h(t - D1) - x_t(t)) - B v_t(t) + f_t(t) / |A_h2|     at the tool, x_t = y_t / A_h1
//! ```
//!
//! Two masses, a spring between them, and a damper at each. The line is in the spring: what each end pulls at is where
//! the other one was. That gives energy, and the dampers take it. Where both move at `w` and against each other with
//! the same amplitude `a`, the channel takes in, on the mean,
//!
//! ```text
//! P = a² w (B w - K sin(w D))            D1 = D2 = D
//! ```
//!
//! which is above zero at every `w` where `K D < B`: [NOBB08]'s condition `4 B² > (D1 + D2)² K²`. Delays that vary
//! count with the longest, and a lost frame is a longer one. Sampling adds two ticks.
//!
//! At a steady speed `v` through clay that resists with `b v` at the handle's port, the tool is behind the handle by
//! `v (D1 + (B + b) / K)`, the hand feels `v (K (D1 + D2) + 2 B + b)`, and `v² (K (D1 + D2) + 2 B)` of power stays in
//! the channel. What it cannot do: let the hand feel the clay as it is. The stiffer the spring, the shorter the line
//! that it is passive on; the longer the line, the more the hand drags.

use teleclay_latency::law::OwnScheme;
use teleclay_link::Vec3;
use teleclay_link::deadband::Signal;
use teleclay_link::motion_limiter::Recovery;
use teleclay_link::scheme::{
    Controllers, Coupling, HandleController, HandlePort, SchemeContext, ToolController, ToolPort,
};
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::{HandleFrame, ToolFrame};

/// The gains that the example's table has: passive on lines of up to 0.1 s each way, with half of the damping that the
/// tool has in itself.
pub static SCHEME: PositionPosition = PositionPosition {
    stiffness_n_per_m: 100.0,
    damping_n_s_per_m: 10.0,
};

/// Gains that make no passive channel on any line.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{gain} is {got}, wanted a finite number above zero")]
pub struct GainError {
    /// Which of the gains.
    pub gain: &'static str,
    /// As given.
    pub got: f64,
}

/// The scheme with its gains, which are the same at both ends. Invariant: finite and above zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionPosition {
    stiffness_n_per_m: f64,
    damping_n_s_per_m: f64,
}

impl PositionPosition {
    /// With `K`, N/m, and `B`, N s/m, at the handle's port.
    ///
    /// # Errors
    /// A gain that is not finite or not above zero.
    pub fn new(stiffness_n_per_m: f64, damping_n_s_per_m: f64) -> Result<Self, GainError> {
        for (gain, got) in [
            ("stiffness_n_per_m", stiffness_n_per_m),
            ("damping_n_s_per_m", damping_n_s_per_m),
        ] {
            if !(got.is_finite() && 0.0 < got) {
                return Err(GainError { gain, got });
            }
        }
        Ok(Self {
            stiffness_n_per_m,
            damping_n_s_per_m,
        })
    }

    /// `K`, N/m.
    pub fn stiffness_n_per_m(&self) -> f64 {
        self.stiffness_n_per_m
    }

    /// `B`, N s/m.
    pub fn damping_n_s_per_m(&self) -> f64 {
        self.damping_n_s_per_m
    }

    /// The longest `D1 + D2` on which the channel is passive whatever is at its ends, s. Two ticks of it are the
    /// sampling's.
    pub fn longest_round_trip_s(&self) -> f64 {
        2.0 * self.damping_n_s_per_m / self.stiffness_n_per_m
    }
}

impl Controllers for PositionPosition {
    fn handle(&self, _context: &SchemeContext) -> Box<dyn HandleController> {
        Box::new(Handle {
            gains: *self,
            tool_position: None,
        })
    }

    fn tool(&self, context: &SchemeContext) -> Box<dyn ToolController> {
        Box::new(Tool {
            gains: *self,
            coupling: context.coupling.clone(),
            handle_position: Vec3::zeros(),
            position: Vec3::zeros(),
            reference: Vec3::zeros(),
        })
    }
}

impl OwnScheme for PositionPosition {
    fn word(&self) -> &'static str {
        "position_position"
    }
}

/// The handle's end of the spring.
struct Handle {
    gains: PositionPosition,
    /// As last received, m at the handle's port; nothing before the first frame.
    tool_position: Option<Vec3>,
}

impl HandleController for Handle {
    fn on_frame(&mut self, _now: Timestamp, frame: &ToolFrame) {
        self.tool_position = Some(Vec3::from(frame.wave));
    }

    /// Another tool stands elsewhere.
    fn on_another_peer(&mut self) {
        self.tool_position = None;
    }

    fn reaction(&mut self, _now: Timestamp, port: &HandlePort) -> Vec3 {
        let Some(tool_position) = self.tool_position else {
            return Vec3::zeros();
        };
        (tool_position - port.position) * self.gains.stiffness_n_per_m
            - port.velocity * self.gains.damping_n_s_per_m
    }

    /// Where the handle is stands in every frame.
    fn fill(&mut self, _frame: &mut HandleFrame) {}

    /// The tool pulls at where it was told that the handle is: a handle that seems to stand and then to jump would be
    /// followed in jerks.
    fn signal(&self, _frame: &HandleFrame) -> Option<Signal> {
        None
    }
}

/// The tool's mass, and its end of the spring.
struct Tool {
    gains: PositionPosition,
    coupling: Coupling,
    /// As last received, m.
    handle_position: Vec3,
    /// Of the tool, m at the handle's port.
    position: Vec3,
    /// A sum of steps, m at the tool's port.
    reference: Vec3,
}

impl ToolController for Tool {
    fn on_frame(&mut self, _now: Timestamp, frame: &HandleFrame) {
        self.handle_position = Vec3::from(frame.position_m);
    }

    /// One step of the mass from where it truly is and how fast it truly goes, with its own spring and damper at the
    /// end of the step, so that no gain makes the step itself swing.
    fn reference(&mut self, _now: Timestamp, port: &ToolPort, remote_gain: f64) -> Vec3 {
        let Coupling {
            tick_s,
            position_ratio,
            ..
        } = self.coupling;
        let stiffness = self.gains.stiffness_n_per_m * remote_gain;
        let stretch = self.handle_position - port.position / position_ratio;
        let inertia = self.coupling.felt_mass_kg() / tick_s;
        let push = port.velocity * (inertia / position_ratio)
            + stretch * stiffness
            + self.coupling.felt(port.clay_force);
        let velocity = push / (inertia + self.gains.damping_n_s_per_m + stiffness * tick_s);
        self.reference += velocity * (position_ratio * tick_s);
        self.reference
    }

    fn moved(&mut self, port: &ToolPort) {
        self.position = port.position / self.coupling.position_ratio;
    }

    fn reindex(&mut self, handle_position: Vec3) {
        self.handle_position = handle_position;
        self.position = handle_position;
        self.reference = handle_position * self.coupling.position_ratio;
    }

    /// After a hold the spring pulls the tool back, no faster than the damper lets it.
    fn recovery(&self) -> Recovery {
        Recovery::Incremental
    }

    /// The frame's own place of the tool is in the clay's frame; the handle's end of the spring needs it in its own.
    fn fill(&mut self, frame: &mut ToolFrame) {
        frame.wave = self.position.into();
    }

    fn signal(&self, _frame: &ToolFrame) -> Option<Signal> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_that_hold_nothing_together_are_refused() {
        for (stiffness, damping, gain) in [
            (0.0, 1.0, "stiffness_n_per_m"),
            (-1.0, 1.0, "stiffness_n_per_m"),
            (1.0, f64::NAN, "damping_n_s_per_m"),
            (f64::INFINITY, 1.0, "stiffness_n_per_m"),
        ] {
            let refused = PositionPosition::new(stiffness, damping).unwrap_err();
            assert_eq!(refused.gain, gain);
        }
        let scheme = PositionPosition::new(50.0, 5.0).unwrap();
        assert!((scheme.longest_round_trip_s() - 0.2).abs() < 1e-12);
    }
}
