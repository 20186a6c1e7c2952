//! One operator of a rig: a device, a handle side, and what is under way to it.

use std::time::Duration;

use teleclay_bilateral::{HandleSide, HandleStep, LinkState, ToolSide};
use teleclay_clay::Clay;
use teleclay_device::DeviceSample;
use teleclay_link::Vec3;
use teleclay_link::energy::Observer;
use teleclay_link::scheme::ClayCopy;
use teleclay_link::scheme::replica::Snapshot;
use teleclay_link::time::Timestamp;
use teleclay_operator::{Axes, Intent, SimulatedHandle};
use teleclay_proto::frame::{HandleFrame, ToolFrame};
use teleclay_proto::join::LoopParameters;

use super::halt::{Halted, noticed_since};
use super::{INBOX, RigError, Traffic, axes_of};

/// A snapshot under way to a handle.
pub(super) struct UnderWay {
    pub(super) number: u32,
    /// When the server takes it, and when it is there.
    pub(super) taken: Timestamp,
    pub(super) due: Timestamp,
    pub(super) snapshot: Option<Snapshot>,
}

/// What the clock of a handle's program shows, against virtual time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    pub(super) ahead: Duration,
    pub(super) ppm: f64,
}

impl Clock {
    fn at(self, now: Timestamp) -> Timestamp {
        let fast_ns = now.as_nanos() as f64 * self.ppm * 1e-6;
        let ahead_ns = self.ahead.as_nanos() as i64 + fast_ns as i64;
        Timestamp::from_nanos(now.as_nanos().saturating_add_signed(ahead_ns))
    }
}

/// One operator, attached to a tool slot of the session.
pub(super) struct Hand {
    pub(super) device: SimulatedHandle,
    pub(super) handle: HandleSide,
    /// What has come, and when the program will have noticed.
    pub(super) inbox: Vec<(Timestamp, ToolFrame)>,
    pub(super) last: HandleStep,
    pub(super) observer: Observer,
    pub(super) sent: Traffic,
    pub(super) received_from: Traffic,
    pub(super) snapshot: Option<UnderWay>,
    /// Where somebody holds the handle fast, if somebody does.
    pub(super) held: Option<DeviceSample>,
    pub(super) halt: Option<Halted>,
    pub(super) clock: Clock,
}

impl Hand {
    pub(super) fn new(
        parameters: &LoopParameters,
        intent: Intent,
        mut handle: HandleSide,
        clay: &Clay,
    ) -> Result<Self, RigError> {
        let axes = axes_of(parameters);
        if handle.clay_copy().is_some() {
            // The clay comes with the lease.
            handle.handle_snapshot(Snapshot {
                clay: Box::new(clay.clone()),
                epoch: 1,
            });
        }
        Ok(Self {
            device: SimulatedHandle::new(axes, parameters.tick_s, intent)?,
            handle,
            inbox: Vec::with_capacity(INBOX),
            last: HandleStep {
                command_m: [0.0; 3],
                felt_force_n: [0.0; 3],
                link_state: LinkState::NotYet,
            },
            observer: Observer::new(parameters.position_ratio * parameters.force_ratio),
            sent: Traffic::default(),
            received_from: Traffic::default(),
            snapshot: None,
            held: None,
            halt: None,
            clock: Clock::default(),
        })
    }

    /// One tick; what its sensors read before. No step while the program is halted: the device goes on at the last
    /// command.
    pub(super) fn step(&mut self, now: Timestamp) -> DeviceSample {
        let before = self.held.unwrap_or_else(|| self.device.sample());
        if self.halt.is_none_or(|halt| halt.until <= now) {
            let since = noticed_since(&mut self.halt);
            for (came, frame) in self.inbox.drain(..) {
                let came = self.clock.at(came.max(since));
                self.handle.handle_frame(came, &frame);
            }
            self.last = self.handle.step(self.clock.at(now), &before);
            drop(self.handle.poll_retired());
            self.handle.restock();
        }
        if self.held.is_none() {
            self.device.command(self.last.command_m);
        }
        before
    }

    /// What the last step sends, if it made a frame.
    pub(super) fn frame_to_send(&self) -> Option<&HandleFrame> {
        self.handle.frame_to_send().filter(|_| self.halt.is_none())
    }

    /// Takes the true work of the tick at both ends into the energy balance. The force on the hand is zero on an axis
    /// that reflects none; the clay's is not, so it is left out there. Where the hand works on a copy, that is the clay
    /// it works on.
    pub(super) fn observe(
        &mut self,
        before: &DeviceSample,
        tool: &ToolSide,
        axes: Axes,
        tick_s: f64,
    ) {
        let after = self.held.unwrap_or_else(|| self.device.sample());
        let way = Vec3::from(after.position_m) - Vec3::from(before.position_m);
        self.observer
            .on_hand(Vec3::from(self.last.felt_force_n), way);
        let copy = self.handle.clay_copy().and_then(ClayCopy::copy);
        let (force, mut tool_way) = match copy {
            Some(copy) => (copy.answer(), copy.way()),
            None => {
                let view = tool.view();
                let tool_way = Vec3::from(view.velocity_m_s) * tick_s;
                (Vec3::from(view.force_n), tool_way)
            }
        };
        if axes == Axes::Two {
            tool_way.z = 0.0;
        }
        self.observer.on_clay(force, tool_way);
    }
}
