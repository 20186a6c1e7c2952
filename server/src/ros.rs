//! What a session tells, in ROS 2's words: samples, events, settings, and how all of it is doing.

use teleclay_proto::http::{Session, SessionState, StorageState};
use teleclay_proto::watch::{Level, TelemetrySample};
use teleclay_ros::names::{self, ToolTopics, Topic};
use teleclay_ros::own::{
    Corrections, Energy, Event as EventMessage, Link, Settings as SettingsMessage,
};
use teleclay_ros::standard::{
    DiagnosticArray, DiagnosticStatus, Header, KeyValue, Pose, PoseStamped, Quaternion, TfMessage,
    Time, Transform, TransformStamped, Twist, TwistStamped, Wrench, WrenchStamped,
};
use teleclay_ros::to_cdr;
use teleclay_session::Settings;

use crate::session::Event;

/// Ticks a second below which the loop is said to be slow: one in a hundred is missing.
const SLOW_HZ: f64 = 990.0;

/// What is told of a tool, sample by sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    HandlePose,
    ToolPose,
    HandleTwist,
    ToolTwist,
    HandWrench,
    FeltWrench,
    ToolWrench,
    Link,
    Energy,
    Corrections,
}

impl Quantity {
    pub(crate) const ALL: [Self; 10] = [
        Self::HandlePose,
        Self::ToolPose,
        Self::HandleTwist,
        Self::ToolTwist,
        Self::HandWrench,
        Self::FeltWrench,
        Self::ToolWrench,
        Self::Link,
        Self::Energy,
        Self::Corrections,
    ];

    /// Its topic among a tool's.
    pub(crate) const fn topic(self, of: &ToolTopics) -> &Topic {
        match self {
            Self::HandlePose => &of.handle_pose,
            Self::ToolPose => &of.tool_pose,
            Self::HandleTwist => &of.handle_twist,
            Self::ToolTwist => &of.tool_twist,
            Self::HandWrench => &of.hand_wrench,
            Self::FeltWrench => &of.felt_wrench,
            Self::ToolWrench => &of.tool_wrench,
            Self::Link => &of.link,
            Self::Energy => &of.energy,
            Self::Corrections => &of.corrections,
        }
    }
}

/// The frames of a tool.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Frames {
    clay: String,
    tool: String,
    handle: String,
}

impl Frames {
    pub(crate) fn of(session: &str, tool: u32) -> Self {
        Self {
            clay: names::clay_frame(session),
            tool: names::tool_frame(session, tool),
            handle: names::handle_frame(session, tool),
        }
    }
}

/// A sample of a tool, and what is to be known beside it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Told<'a> {
    pub(crate) frames: &'a Frames,
    /// When, ns since 1970.
    pub(crate) time_ns: u64,
    pub(crate) sample: &'a TelemetrySample,
    /// Who holds the tool; empty while it is free.
    pub(crate) operator: &'a str,
    pub(crate) is_connected: bool,
}

impl<'a> Told<'a> {
    /// Writes one of its quantities as a message.
    pub(crate) fn write(&self, quantity: Quantity, out: &mut Vec<u8>) {
        let Self { frames, sample, .. } = self;
        match quantity {
            Quantity::HandlePose => self.pose(&frames.handle, sample.handle_position_m, out),
            Quantity::ToolPose => self.pose(&frames.clay, sample.tool_position_m, out),
            Quantity::HandleTwist => self.twist(&frames.handle, sample.handle_velocity_m_s, out),
            Quantity::ToolTwist => self.twist(&frames.clay, sample.tool_velocity_m_s, out),
            Quantity::HandWrench => self.wrench(&frames.handle, sample.hand_force_n, out),
            Quantity::FeltWrench => self.wrench(&frames.handle, sample.felt_force_n, out),
            Quantity::ToolWrench => self.wrench(&frames.tool, sample.tool_force_n, out),
            Quantity::Link => {
                let link = Link {
                    stamp: self.stamp(),
                    rtt_s: sample.rtt_s.into(),
                    age_s: sample.age_s.into(),
                    connected: self.is_connected,
                    operator_name: self.operator,
                };
                to_cdr(&link, out);
            }
            Quantity::Energy => {
                let energy = Energy {
                    stamp: self.stamp(),
                    handle_j: sample.energy_handle_j.into(),
                    tool_j: sample.energy_tool_j.into(),
                };
                to_cdr(&energy, out);
            }
            Quantity::Corrections => {
                let corrections = Corrections {
                    stamp: self.stamp(),
                    step_n: sample.correction_step_n.into(),
                    held_n: sample.correction_held_n.into(),
                };
                to_cdr(&corrections, out);
            }
        }
    }

    /// Where its frames lie in the clay's; the handle's own lies where the tool is at home.
    pub(crate) fn transforms(&self, home_m: [f64; 3]) -> [TransformStamped<'a>; 2] {
        let frames = self.frames;
        let at = |child_frame_id, translation: [f64; 3]| TransformStamped {
            header: self.header(&frames.clay),
            child_frame_id,
            transform: Transform {
                translation: translation.into(),
                rotation: Quaternion::default(),
            },
        };
        let tool_m = self.sample.tool_position_m.map(f64::from);
        [at(&frames.tool, tool_m), at(&frames.handle, home_m)]
    }

    fn stamp(&self) -> Time {
        Time::from_ns(self.time_ns)
    }

    fn header<'b>(&self, frame_id: &'b str) -> Header<'b> {
        Header {
            stamp: self.stamp(),
            frame_id,
        }
    }

    fn pose(&self, frame: &str, position_m: [f32; 3], out: &mut Vec<u8>) {
        let pose = PoseStamped {
            header: self.header(frame),
            pose: Pose {
                position: position_m.map(f64::from).into(),
                orientation: Quaternion::default(),
            },
        };
        to_cdr(&pose, out);
    }

    fn twist(&self, frame: &str, velocity_m_s: [f32; 3], out: &mut Vec<u8>) {
        let twist = TwistStamped {
            header: self.header(frame),
            twist: Twist {
                linear: velocity_m_s.map(f64::from).into(),
                angular: [0.0; 3].into(),
            },
        };
        to_cdr(&twist, out);
    }

    fn wrench(&self, frame: &str, force_n: [f32; 3], out: &mut Vec<u8>) {
        let wrench = WrenchStamped {
            header: self.header(frame),
            wrench: Wrench {
                force: force_n.map(f64::from).into(),
                torque: [0.0; 3].into(),
            },
        };
        to_cdr(&wrench, out);
    }
}

/// Frames in frames.
pub(crate) fn tf(transforms: Vec<TransformStamped<'_>>) -> Vec<u8> {
    let mut out = Vec::new();
    to_cdr(&TfMessage { transforms }, &mut out);
    out
}

/// Something that happened.
pub(crate) fn event(event: &Event, time_ns: u64) -> Vec<u8> {
    let mut out = Vec::new();
    let message = EventMessage {
        stamp: Time::from_ns(time_ns),
        level: match event.level {
            Level::Info => EventMessage::INFO,
            Level::Warning => EventMessage::WARNING,
            Level::Error => EventMessage::ERROR,
        },
        text: &event.text,
    };
    to_cdr(&message, &mut out);
    out
}

/// What a session is set to.
pub(crate) fn settings(settings: &Settings, time_ns: u64) -> Vec<u8> {
    let mut out = Vec::new();
    let json = serde_json::to_string(settings).expect("every map in it has strings as keys");
    let message = SettingsMessage {
        stamp: Time::from_ns(time_ns),
        revision: settings.revision,
        json: &json,
    };
    to_cdr(&message, &mut out);
    out
}

/// How one part is doing, with its figures.
struct Report {
    level: u8,
    name: String,
    message: String,
    values: Vec<(&'static str, String)>,
}

/// How the server and these sessions are doing.
pub(crate) fn diagnostics(node: &str, sessions: &[Session], time_ns: u64) -> Vec<u8> {
    // The loop is all sessions'; each tells the same of it.
    let reports: Vec<Report> = sessions
        .first()
        .map(report_on_loop)
        .into_iter()
        .chain(sessions.iter().map(report_on_session))
        .collect();
    let status = reports.iter().map(|report| DiagnosticStatus {
        level: report.level,
        name: &report.name,
        message: &report.message,
        hardware_id: node,
        values: report
            .values
            .iter()
            .map(|(key, value)| KeyValue { key, value })
            .collect(),
    });
    let message = DiagnosticArray {
        header: Header {
            stamp: Time::from_ns(time_ns),
            frame_id: "",
        },
        status: status.collect(),
    };
    let mut out = Vec::new();
    to_cdr(&message, &mut out);
    out
}

fn report_on_loop(session: &Session) -> Report {
    let told = &session.control_loop;
    let (level, message) = if told.rate_hz < SLOW_HZ {
        let message = format!("{:.0} ticks a second, wanted 1000", told.rate_hz);
        (DiagnosticStatus::WARN, message)
    } else {
        (DiagnosticStatus::OK, "1 kHz".to_owned())
    };
    Report {
        level,
        name: "teleclay: loop".to_owned(),
        message,
        values: vec![
            ("rate_hz", told.rate_hz.to_string()),
            ("late_ticks", told.late_ticks.to_string()),
            ("tick_p99_s", told.tick_s.p99.to_string()),
            ("scheduler", told.scheduler.clone()),
        ],
    }
}

fn report_on_session(session: &Session) -> Report {
    let state = match session.state {
        SessionState::Idle => "idle",
        SessionState::Running => "running",
        SessionState::Paused => "paused",
        SessionState::Fault => "fault",
        SessionState::Stopped => "stopped",
    };
    let fault = || session.fault.clone().unwrap_or_else(|| state.to_owned());
    let lost = || {
        let reason = session.storage.reason.as_deref();
        format!("nothing is kept any more: {}", reason.unwrap_or("unknown"))
    };
    let (level, message) = match (session.state, session.storage.state) {
        (_, StorageState::Failed) => (DiagnosticStatus::ERROR, lost()),
        (SessionState::Fault, _) => (DiagnosticStatus::ERROR, fault()),
        (SessionState::Stopped, _) => (DiagnosticStatus::WARN, state.to_owned()),
        _ => (DiagnosticStatus::OK, state.to_owned()),
    };
    let told = &session.control_loop;
    let held = session.tools.iter().filter(|tool| tool.connected).count();
    Report {
        level,
        name: format!("teleclay: session {}", session.id),
        message,
        values: vec![
            ("scheme", session.scheme.word().to_owned()),
            ("revision", session.revision.to_string()),
            ("operators", held.to_string()),
            ("rtt_p50_s", told.rtt_s.p50.to_string()),
            ("frames_lost", told.lost.to_string()),
            (
                "removed_volume_m3",
                session.clay.removed_volume_m3.to_string(),
            ),
            ("clay_hash", session.clay.hash.to_string()),
        ],
    }
}
