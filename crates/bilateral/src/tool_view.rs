//! What the tool side knows of its tool and of the handle, for whoever watches.

use teleclay_link::Vec3;
use teleclay_proto::frame::{CopyState, Corrections, HandleFrame};

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
    /// Felt force less what the hand would feel of this clay's answer to the same motion, N: what a copy hid. Zero in schemes without one.
    pub hidden_force_n: [f64; 3],
    /// What the handle's copy of the clay is good for, as last received.
    pub copy: CopyState,
    /// Sweeps refused since joining.
    pub sweeps_refused: u32,
    /// What corrections of the copy have done to the hand, as last received.
    pub corrections: Corrections,
}

/// Keeps a [`ToolView`] up to date.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    view: ToolView,
    /// When the newest frame was sent, on the handle's clock, ns; 0 before the first.
    handle_sent_ns: u64,
}

impl Seen {
    /// A tool at rest at `home`, m in the clay's frame, of which no handle has been heard.
    pub(crate) fn at_rest(home: Vec3) -> Self {
        Self {
            view: ToolView {
                position_m: home.into(),
                ..ToolView::default()
            },
            handle_sent_ns: 0,
        }
    }

    pub(crate) fn view(&self) -> &ToolView {
        &self.view
    }

    /// The handle's displacement from home as last received, m.
    pub(crate) fn handle_position(&self) -> Vec3 {
        Vec3::from(self.view.handle_position_m)
    }

    /// The handle's velocity as last received, m/s.
    pub(crate) fn handle_velocity(&self) -> Vec3 {
        Vec3::from(self.view.handle_velocity_m_s)
    }

    /// The newest frame of the handle. It stands for `longest_s` of silence before it at most.
    pub(crate) fn on_frame(&mut self, frame: &HandleFrame, longest_s: f64) {
        let felt = Vec3::from(frame.felt_force_n);
        let velocity = Vec3::from(frame.velocity_m_s);
        let view = &mut self.view;
        // Frames that were lost or left out stand for the time until the next that came: half of it went by as the one before says, half as this one.
        let power_w = -felt.dot(&velocity);
        let before_w = -Vec3::from(view.felt_force_n).dot(&Vec3::from(view.handle_velocity_m_s));
        let passed_ns = frame.header.sent_ns.saturating_sub(self.handle_sent_ns);
        let passed_s = (passed_ns as f64 * 1e-9).min(longest_s);
        if 0 < self.handle_sent_ns {
            view.energy_handle_j += 0.5 * (power_w + before_w) * passed_s;
        }
        self.handle_sent_ns = frame.header.sent_ns;
        view.handle_position_m = frame.position_m;
        view.handle_velocity_m_s = frame.velocity_m_s;
        view.hand_force_n = frame.hand_force_n;
        view.felt_force_n = frame.felt_force_n;
        view.copy = frame.copy;
        view.corrections = frame.corrections;
    }

    /// One tick of the tool: where it came to in the clay's frame, how fast, and what the clay answered.
    pub(crate) fn on_step(&mut self, place: Vec3, velocity: Vec3, clay_force: Vec3, tick_s: f64) {
        self.view.position_m = place.into();
        self.view.velocity_m_s = velocity.into();
        self.view.force_n = clay_force.into();
        self.view.energy_tool_j -= clay_force.dot(&velocity) * tick_s;
    }

    /// To the motion that the handle's sweeps tell of, this clay's answer would have been felt as `felt`, N.
    pub(crate) fn answers(&mut self, felt: Vec3) {
        self.view.hidden_force_n = (Vec3::from(self.view.felt_force_n) - felt).into();
    }

    /// No copy stands between the hand and this clay.
    pub(crate) fn hides_nothing(&mut self) {
        self.view.hidden_force_n = [0.0; 3];
    }

    /// So many sweeps were refused since joining.
    pub(crate) fn refused(&mut self, sweeps: u32) {
        self.view.sweeps_refused = sweeps;
    }
}
