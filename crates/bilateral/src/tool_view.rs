//! What the tool side knows of its tool and of the handle, for whoever watches.

use teleclay_link::Vec3;
use teleclay_proto::frame::{CopyState, Corrections, HandleFrame, SweepRefusal};

/// What a watcher may want to know of a tool; all at the last step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolView {
    /// Tool in the clay frame, m.
    pub position_m: [f64; 3],
    /// Its velocity, m/s.
    pub velocity_m_s: [f64; 3],
    /// Force of the clay on it, N.
    pub force_n: [f64; 3],
    /// Handle as last received: displacement from home, m.
    pub handle_position_m: [f64; 3],
    /// Handle's velocity as last received, m/s.
    pub handle_velocity_m_s: [f64; 3],
    /// Hand's force as last received, N.
    pub hand_force_n: [f64; 3],
    /// Force felt by the hand as last received, N.
    pub felt_force_n: [f64; 3],
    /// Energy that the hand put into the channel, from the frames received, J.
    pub energy_handle_j: f64,
    /// Energy that the tool put into the clay, J.
    pub energy_tool_j: f64,
    /// Felt force less what the hand would feel of this clay's answer to the same motion, N: what a copy hid. Zero in
    /// schemes without one.
    pub hidden_force_n: [f64; 3],
    /// What the handle's copy of the clay is good for, as last received.
    pub copy: CopyState,
    /// Sweeps refused since joining.
    pub sweeps_refused: u32,
    /// Why the newest of these was.
    pub refusal: SweepRefusal,
    /// What corrections of the copy have done to the hand, as last received.
    pub corrections: Corrections,
}

/// The handle as its newest frame tells it, and the energies at both ports.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FarHandle {
    position_m: [f64; 3],
    velocity_m_s: [f64; 3],
    hand_force_n: [f64; 3],
    felt_force_n: [f64; 3],
    copy: CopyState,
    corrections: Corrections,
    hidden_force: Vec3,
    energy_handle_j: f64,
    energy_tool_j: f64,
    /// When the newest frame was sent, on the handle's clock, ns; 0 before the first.
    sent_ns: u64,
}

/// The tool's own part of a [`ToolView`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct NearTool {
    /// In the clay's frame, m.
    pub(crate) position: Vec3,
    pub(crate) velocity: Vec3,
    pub(crate) clay_force: Vec3,
    pub(crate) sweeps_refused: u32,
    pub(crate) refusal: SweepRefusal,
}

impl FarHandle {
    /// What a watcher sees of this handle and its tool.
    pub(crate) fn view(&self, tool: &NearTool) -> ToolView {
        ToolView {
            position_m: tool.position.into(),
            velocity_m_s: tool.velocity.into(),
            force_n: tool.clay_force.into(),
            handle_position_m: self.position_m,
            handle_velocity_m_s: self.velocity_m_s,
            hand_force_n: self.hand_force_n,
            felt_force_n: self.felt_force_n,
            energy_handle_j: self.energy_handle_j,
            energy_tool_j: self.energy_tool_j,
            hidden_force_n: self.hidden_force.into(),
            copy: self.copy,
            corrections: self.corrections,
            sweeps_refused: tool.sweeps_refused,
            refusal: tool.refusal,
        }
    }

    /// Displacement from home, m.
    pub(crate) fn position(&self) -> Vec3 {
        Vec3::from(self.position_m)
    }

    /// Velocity, m/s.
    pub(crate) fn velocity(&self) -> Vec3 {
        Vec3::from(self.velocity_m_s)
    }

    /// When the newest frame was sent, on the handle's clock, ns.
    pub(crate) fn sent_ns(&self) -> u64 {
        self.sent_ns
    }

    /// The newest frame of the handle. It stands for `longest_s` of silence before it at most.
    pub(crate) fn on_frame(&mut self, frame: &HandleFrame, longest_s: f64) {
        let felt = Vec3::from(frame.felt_force_n);
        let velocity = Vec3::from(frame.velocity_m_s);
        // Frames that were lost or left out stand for the time until the next that came: half of it went by as the one
        // before says, half as this one.
        let power_w = -felt.dot(&velocity);
        let before_w = -Vec3::from(self.felt_force_n).dot(&self.velocity());
        let passed_ns = frame.header.sent_ns.saturating_sub(self.sent_ns);
        let passed_s = (passed_ns as f64 * 1e-9).min(longest_s);
        if 0 < self.sent_ns {
            self.energy_handle_j += 0.5 * (power_w + before_w) * passed_s;
        }
        self.sent_ns = frame.header.sent_ns;
        self.position_m = frame.position_m;
        self.velocity_m_s = frame.velocity_m_s;
        self.hand_force_n = frame.hand_force_n;
        self.felt_force_n = frame.felt_force_n;
        self.copy = frame.copy;
        self.corrections = frame.corrections;
    }

    /// One tick of the tool: how fast it went, and what the clay answered.
    pub(crate) fn on_step(&mut self, velocity: Vec3, clay_force: Vec3, tick_s: f64) {
        self.energy_tool_j -= clay_force.dot(&velocity) * tick_s;
    }

    /// To the motion that the handle's sweeps tell of, this clay's answer would have been felt as `felt`, N.
    pub(crate) fn answers(&mut self, felt: Vec3) {
        self.hidden_force = Vec3::from(self.felt_force_n) - felt;
    }

    /// No copy stands between the hand and this clay.
    pub(crate) fn hides_nothing(&mut self) {
        self.hidden_force = Vec3::zeros();
    }
}
