//! A session on virtual time, and frames of handles that hold its tools.
#![allow(dead_code, reason = "each test uses a part")]

use std::time::Duration;

use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::SessionId;
use teleclay_proto::frame::{Engagement, HandleFrame, Header, ToolFrame};
use teleclay_proto::http::{
    ClayReset, ClayShape, ClaySpec, NewSession, SessionPatch, ToolDescription,
};
use teleclay_session::{
    Command, Event, EventKind, Operator, Outcome, Recovery, Refusal, Rules, Session, SessionSetup,
    Settings,
};

pub(crate) const TICK: Duration = Duration::from_millis(1);

/// A block of 16 × 16 × 8 voxels of 2 mm, a ball of 6.4 mm, this many tools.
pub(crate) fn new_session(tools: u8) -> NewSession {
    NewSession {
        clay: ClaySpec {
            shape: ClayShape::Block {
                size_m: [0.032, 0.032, 0.016],
            },
            voxel_size_m: 2e-3,
            layers: Vec::new(),
        },
        tool: ToolDescription::Ball { radius_m: 0.0064 },
        tools,
        ..NewSession::new(SessionId::new("bench").unwrap())
    }
}

pub(crate) fn setup(new: NewSession) -> SessionSetup {
    let settings = Settings::new(new).unwrap();
    SessionSetup {
        lines: settings.lines(),
        clay: settings.fresh_block().unwrap(),
        settings,
        rules: Rules::default(),
        first_lease: 1,
        ownership_epoch: 1,
    }
}

/// A session and the time.
pub(crate) struct Bench {
    pub(crate) session: Session,
    pub(crate) now: Timestamp,
    pub(crate) events: Vec<Event>,
    pub(crate) sent: Vec<(usize, ToolFrame)>,
}

impl Bench {
    pub(crate) fn new(new: NewSession) -> Self {
        Self {
            session: Session::new(setup(new)),
            now: Timestamp::ZERO.after(TICK),
            events: Vec::new(),
            sent: Vec::new(),
        }
    }

    pub(crate) fn command(&mut self, command: &Command) -> Result<Outcome, Refusal> {
        self.session.carry_out(self.now, command)
    }

    /// Lease and slot of a tool for this operator.
    pub(crate) fn join(&mut self, name: &str) -> Result<Hand, Refusal> {
        let outcome = self.command(&join(name))?;
        let granted = outcome.granted.unwrap();
        Ok(Hand {
            slot: granted.slot,
            header: Header {
                lease: granted.lease,
                ownership_epoch: self.session.ownership_epoch(),
                revision: outcome.revision as u32,
                clay_epoch: outcome.clay_epoch,
                scheme: self.session.settings().spec.scheme,
                ..Header::default()
            },
        })
    }

    /// One tick, with what it gives.
    pub(crate) fn tick(&mut self) {
        self.session.tick(self.now);
        self.sent.clear();
        while let Some((slot, frame)) = self.session.poll_transmit() {
            self.sent.push((slot, *frame));
        }
        while let Some(event) = self.session.poll_event() {
            self.events.push(event);
        }
        while self.session.poll_retired().is_some() {}
        self.now = self.now.after(TICK);
    }

    /// Ticks in which each of these hands sends `frame` made by `make`.
    pub(crate) fn run(
        &mut self,
        ticks: u32,
        hands: &mut [&mut Hand],
        mut make: impl FnMut(u32) -> HandleFrame,
    ) {
        for tick in 0..ticks {
            for hand in &mut *hands {
                let frame = hand.frame(self.now, make(tick));
                self.session.handle_frame(self.now, hand.slot, &frame);
            }
            self.tick();
        }
    }

    /// The events since the last look, in words.
    pub(crate) fn take_events(&mut self) -> Vec<Event> {
        while let Some(event) = self.session.poll_event() {
            self.events.push(event);
        }
        std::mem::take(&mut self.events)
    }
}

pub(crate) fn join(name: &str) -> Command {
    Command::Join {
        operator: Operator {
            name: name.to_owned(),
            device: "none".to_owned(),
        },
    }
}

/// Who holds a tool.
#[derive(Clone, Debug)]
pub(crate) struct Hand {
    pub(crate) slot: usize,
    pub(crate) header: Header,
}

impl Hand {
    pub(crate) fn lease(&self) -> u32 {
        self.header.lease
    }

    /// `frame` as this holder sends it next.
    pub(crate) fn frame(&mut self, now: Timestamp, frame: HandleFrame) -> HandleFrame {
        self.header.sequence = self.header.sequence.wrapping_add(1);
        self.header.sent_ns = now.as_nanos();
        HandleFrame {
            header: self.header,
            ..frame
        }
    }
}

/// A hand that drives, with its handle here.
pub(crate) fn engaged_at(position_m: [f64; 3]) -> HandleFrame {
    HandleFrame {
        engagement: Engagement::Engaged,
        position_m,
        ..HandleFrame::default()
    }
}

pub(crate) fn patch(patch: SessionPatch) -> Command {
    Command::Patch { patch }
}

pub(crate) fn reset(lease: Option<u32>) -> Command {
    Command::Reset {
        reset: ClayReset::default(),
        lease,
    }
}

pub(crate) fn kinds(bench: &mut Bench) -> Vec<EventKind> {
    let events = bench.take_events();
    events.into_iter().map(|event| event.kind).collect()
}

/// A stroke a few millimetres deep, there and back.
pub(crate) fn stroke(tick: u32) -> HandleFrame {
    let phase = f64::from(tick) * 0.01;
    engaged_at([0.008 * phase.sin(), 0.0, -0.004])
}

pub(crate) fn cutting(scheme: Scheme) -> NewSession {
    NewSession {
        scheme,
        axes: teleclay_proto::Axes::Three,
        ..new_session(1)
    }
}

pub(crate) fn stop(by: &str, reason: &str) -> Command {
    Command::Stop {
        by: by.to_owned(),
        reason: reason.to_owned(),
    }
}

pub(crate) fn clear(by: &str) -> Command {
    Command::ClearStop { by: by.to_owned() }
}

pub(crate) fn request(tool: u32, operator: &str) -> Command {
    Command::Request {
        tool,
        operator: operator.to_owned(),
    }
}

pub(crate) fn grant(tool: u32, operator: &str, lease: Option<u32>) -> Command {
    Command::Grant {
        tool,
        operator: operator.to_owned(),
        lease,
    }
}

pub(crate) fn stopped(by: &str, reason: &str) -> Refusal {
    Refusal::Stopped {
        by: by.into(),
        reason: reason.into(),
    }
}

pub(crate) fn recovered(bench: &Bench) -> Session {
    let recovery = Recovery {
        state: bench.session.snapshot(),
        clay: bench.session.clay().clone(),
        next_lease: bench.session.next_lease(),
        decided: Vec::new(),
        rules: Rules::default(),
    };
    Session::recover(bench.now, recovery).unwrap()
}
