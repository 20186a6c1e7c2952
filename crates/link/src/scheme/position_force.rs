//! Position forward, force back: the tool goes where the handle is, the hand feels what the tool feels.
//!
//! ```text
//! y_t(t) = A_h1 y_h(t - D1)                felt(t) = f_t(t - D2) / |A_h2|
//! ```
//!
//! The classical baseline. It assumes that the tool follows any position at once, and a line without delay: then the
//! hand feels the clay exactly. With a round trip `d` the loop is `1 + P (T_h + rho T_t exp(-s d)) = 0`, which dies at
//! a delay that `teleclay_control` gives exactly. In samples the hold of the handle's command and the velocity as a
//! difference each add half a tick to `d`, and the clay's answer to the motion of a tick is felt in the next: one tick
//! more. So what the line itself may take is the margin less two ticks, for clay that answers position instead of
//! velocity less one and a half.
//!
//! Frames come one a tick, but for the phase of two clocks: where a tick has none and the next has two, a play head
//! keeps the tool going at the speed told ([`PlayHead`]).
//!
//! With perceptual coding the handle sends a frame only when its velocity has changed by more than a hand can tell, and
//! the tool's controller bridges what is left out by dead reckoning.
//!
//! It creates energy as soon as there is delay, and has nothing to notice that with. It shows why the other schemes
//! exist.

use std::time::Duration;

use teleclay_proto::frame::{HandleFrame, ToolFrame};

use super::play_head::PlayHead;
use super::{Coupling, HandleController, HandlePort, ToolController, ToolPort};
use crate::Vec3;
use crate::deadband::Signal;
use crate::motion_limiter::Recovery;
use crate::time::Timestamp;

/// The handle's controller: what it feels is the clay's force as last received.
#[derive(Clone, Debug)]
pub struct PositionForceHandle {
    coupling: Coupling,
    clay_force: Vec3,
}

impl PositionForceHandle {
    /// At rest: no force received yet.
    pub fn new(coupling: Coupling) -> Self {
        Self {
            coupling,
            clay_force: Vec3::zeros(),
        }
    }
}

impl HandleController for PositionForceHandle {
    fn on_frame(&mut self, _now: Timestamp, frame: &ToolFrame) {
        self.clay_force = Vec3::from(frame.force_n);
    }

    fn reaction(&mut self, _now: Timestamp, _port: &HandlePort) -> Vec3 {
        self.coupling.felt(self.clay_force)
    }

    fn fill(&mut self, _frame: &mut HandleFrame) {}

    /// The tool goes on at the speed it was told last, see [`DeadReckoning`].
    fn signal(&self, frame: &HandleFrame) -> Option<Signal> {
        Some(Signal::velocity(Vec3::from(frame.velocity_m_s)))
    }
}

/// The tool's controller: the reference is the image of the handle as last received.
#[derive(Clone, Copy, Debug)]
pub struct PositionForceTool {
    position_ratio: f64,
    tick_s: f64,
    handle_position: Vec3,
    handle_velocity: Vec3,
    head: PlayHead,
    reckoning: Option<DeadReckoning>,
    /// Whether the handle is told to leave frames out.
    expects_gaps: bool,
    /// The longest that it was ever told to, s; nothing where it never was.
    gap_s: Option<f64>,
    /// Number of the newest frame and when it was sent, ns; nothing before the first.
    newest: Option<(u32, u64)>,
    /// For how long nothing has been left out, s.
    unbroken_s: f64,
}

impl PositionForceTool {
    /// At rest with the handle at home.
    pub fn new(coupling: &Coupling) -> Self {
        Self {
            position_ratio: coupling.position_ratio,
            tick_s: coupling.tick_s,
            handle_position: Vec3::zeros(),
            handle_velocity: Vec3::zeros(),
            head: PlayHead::default(),
            reckoning: None,
            expects_gaps: false,
            gap_s: None,
            newest: None,
            unbroken_s: 0.0,
        }
    }

    /// Frames are numbered as they are sent: between two of them more ticks than numbers have passed where some were
    /// left out, and as many where some were lost. A thread that woke late is no gap.
    fn look_for_a_gap(&mut self, frame: &HandleFrame) -> bool {
        let (sequence, sent_ns) = (frame.header.sequence, frame.header.sent_ns);
        let Some((before, before_ns)) = self.newest.replace((sequence, sent_ns)) else {
            return false;
        };
        let passed_s = sent_ns.saturating_sub(before_ns) as f64 * 1e-9;
        let numbered_s = f64::from(sequence.wrapping_sub(before)) * self.tick_s;
        let is_gap = numbered_s + 1.5 * self.tick_s < passed_s;
        self.unbroken_s = if is_gap {
            0.0
        } else {
            self.unbroken_s + passed_s
        };
        is_gap
    }
}

impl ToolController for PositionForceTool {
    /// What the handle does decides about dead reckoning, not what it was told: it hears of that a delay later.
    fn on_frame(&mut self, _now: Timestamp, frame: &HandleFrame) {
        let is_gap = self.look_for_a_gap(frame);
        if is_gap && self.reckoning.is_none() {
            self.reckoning = self
                .gap_s
                .map(|gap_s| DeadReckoning::from(self.handle_position, gap_s));
        }
        self.handle_position = Vec3::from(frame.position_m);
        self.handle_velocity = Vec3::from(frame.velocity_m_s);
        self.head.on_frame(frame.header.sequence);
        if let Some(reckoning) = &mut self.reckoning {
            reckoning.told = self.handle_position;
            reckoning.velocity = Vec3::from(frame.velocity_m_s);
            reckoning.age_s = 0.0;
            if !self.expects_gaps && ENOUGH_GAPS * reckoning.gap_s < self.unbroken_s {
                self.reckoning = None;
            }
        }
    }

    fn expect_gaps(&mut self, longest: Option<Duration>, velocity: Vec3) {
        self.expects_gaps = longest.is_some();
        let Some(longest) = longest else { return };
        let gap_s = longest.as_secs_f64().max(self.tick_s);
        self.gap_s = Some(gap_s);
        match &mut self.reckoning {
            Some(reckoning) => reckoning.gap_s = gap_s,
            None => {
                self.reckoning = Some(DeadReckoning {
                    velocity,
                    ..DeadReckoning::from(self.handle_position, gap_s)
                });
            }
        }
    }

    fn reference(&mut self, _now: Timestamp, _port: &ToolPort, _remote_gain: f64) -> Vec3 {
        let lead = self.head.step();
        let handle_position = match &mut self.reckoning {
            Some(reckoning) => {
                self.head.restart();
                reckoning.step(self.tick_s)
            }
            None => match lead {
                Some(ticks) => self.handle_position + self.handle_velocity * (ticks * self.tick_s),
                None => self.handle_position,
            },
        };
        handle_position * self.position_ratio
    }

    fn on_news_again(&mut self) {
        self.head.restart();
    }

    fn reindex(&mut self, handle_position: Vec3) {
        self.handle_position = handle_position;
        self.head.restart();
        if let Some(reckoning) = &mut self.reckoning {
            *reckoning = DeadReckoning::from(handle_position, reckoning.gap_s);
        }
    }

    fn recovery(&self) -> Recovery {
        Recovery::Absolute
    }

    fn fill(&mut self, _frame: &mut ToolFrame) {}

    fn signal(&self, frame: &ToolFrame) -> Option<Signal> {
        Some(Signal::force(Vec3::from(frame.force_n)))
    }
}

/// Dead reckoning is given up when nothing has been left out for this many of the longest gaps: what was to be made up
/// for has been by then.
const ENOUGH_GAPS: f64 = 6.0;

/// Dead reckoning of the handle while its frames are left out: it goes on at the velocity told last, which is within
/// the band of the true one. Where the next frame says otherwise, the difference is made up over one gap: a jump of
/// position would be a blow of force, for the clay answers velocity.
#[derive(Clone, Copy, Debug)]
struct DeadReckoning {
    /// The longest that frames are left out, s.
    gap_s: f64,
    told: Vec3,
    velocity: Vec3,
    /// Of what was told, s.
    age_s: f64,
    at: Vec3,
}

impl DeadReckoning {
    /// From rest.
    fn from(position: Vec3, gap_s: f64) -> Self {
        Self {
            gap_s,
            told: position,
            velocity: Vec3::zeros(),
            age_s: 0.0,
            at: position,
        }
    }

    /// Where the handle is taken to be in this tick.
    fn step(&mut self, tick_s: f64) -> Vec3 {
        // A frame that was sent and lost is one more gap, and further than that nothing is known.
        let goes_on = self.age_s < 2.0 * self.gap_s;
        if goes_on {
            self.at += self.velocity * tick_s;
        }
        let foreseen = self.told + self.velocity * self.age_s;
        self.at += (foreseen - self.at) * (tick_s / self.gap_s);
        if goes_on {
            self.age_s += tick_s;
        }
        self.at
    }
}
