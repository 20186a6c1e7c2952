//! What happens to a handle, for people and for whoever watches over it.

use std::fmt;

use teleclay_device::DeviceProfile;
use teleclay_operator::Singularity;
use teleclay_proto::{NodeName, Scheme, SessionId};

use crate::status::Status;

/// Something worth telling.
#[derive(Clone, Debug)]
pub enum Event {
    /// No server answers; asking goes on.
    Waiting {
        /// The session asked for.
        session: SessionId,
        /// Sessions of the realm that some server runs.
        others: Vec<SessionId>,
    },
    /// The session is stopped; asking goes on.
    Stopped {
        /// By whom and why, in the server's words.
        reason: String,
    },
    /// A lease is held.
    Joined {
        /// The server.
        node: NodeName,
        /// The session.
        session: SessionId,
        /// The tool.
        tool: u32,
        /// The lease.
        lease: u32,
        /// The law that couples the two sides.
        scheme: Scheme,
        /// Time since the link was lost, s, when a lease was held before.
        after_s: Option<f64>,
    },
    /// The 1 kHz thread runs.
    Ticking {
        /// The device that it drives.
        device: String,
        /// Length of a tick, s.
        tick_s: f64,
        /// What it may do to the hand, whatever a server says.
        profile: DeviceProfile,
        /// What the scheduler granted.
        scheduler: String,
    },
    /// Frames of the tool side come, and the hand feels them.
    Live {
        /// The lease.
        lease: u32,
        /// How long there had been none, s, when there were some before under this lease.
        after_s: Option<f64>,
    },
    /// Likewise, after a while on the copy: the force never went.
    Together {
        /// How long there had been none, s.
        after_s: f64,
    },
    /// No frame for longer than the allowed silence.
    Silent {
        /// The allowed silence, s.
        silence_s: f64,
    },
    /// Likewise, but the copy of the clay goes on.
    OnCopy {
        /// The allowed silence, s.
        silence_s: f64,
    },
    /// The silence lasts: the copy is no longer cut, and its force fades.
    OnStaleCopy,
    /// The server's process has gone.
    ServerGone,
    /// The server has taken the tool back.
    TakenBack {
        /// Why, in its words.
        reason: String,
    },
    /// A snapshot of the server's clay has come: the hand feels a copy of it from now on.
    Copied {
        /// Which block.
        epoch: u32,
        /// From the question to the finished copy, s.
        took_s: f64,
    },
    /// The server did not tell what it was asked for; it is asked again.
    NotRefreshed {
        /// The reason, in words.
        reason: String,
    },
    /// The session is paused.
    Paused,
    /// The tool side is in fault.
    SessionFault,
    /// The operator has finished another round and asks for fresh clay.
    RoundFinished {
        /// Rounds so far.
        rounds: u64,
    },
    /// The clay is fresh.
    FreshClay {
        /// Which block.
        epoch: u32,
    },
    /// The clay stays as it is.
    NoFreshClay {
        /// The reason, in words.
        reason: String,
    },
    /// Ticks are no longer written down.
    RecordingEnded {
        /// The reason, in words.
        reason: String,
    },
    /// A robot comes to its fence: it slows down and resists.
    AtFence {
        /// The singularity behind it.
        nearest: Singularity,
        /// How far from it, 1 down to 0.
        clearance: f64,
    },
    /// The robot is clear of it again.
    ClearOfFence,
    /// How it goes, once a second.
    Status(Box<Status>),
}

/// How much an event matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    /// Somebody may want to do something about it.
    Warning,
    /// Good to know.
    Notice,
    /// For the curious.
    Detail,
}

impl Event {
    /// How much it matters.
    pub fn weight(&self) -> Weight {
        match self {
            Self::Waiting { .. }
            | Self::Stopped { .. }
            | Self::Silent { .. }
            | Self::OnCopy { .. }
            | Self::OnStaleCopy
            | Self::ServerGone
            | Self::TakenBack { .. }
            | Self::NotRefreshed { .. }
            | Self::SessionFault
            | Self::NoFreshClay { .. }
            | Self::AtFence { .. }
            | Self::RecordingEnded { .. } => Weight::Warning,
            Self::Joined { .. }
            | Self::Ticking { .. }
            | Self::Copied { .. }
            | Self::Together { .. }
            | Self::Paused
            | Self::FreshClay { .. }
            | Self::ClearOfFence => Weight::Notice,
            Self::Live { after_s, .. } if after_s.is_some() => Weight::Notice,
            Self::Live { .. } | Self::RoundFinished { .. } | Self::Status(_) => Weight::Detail,
        }
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Waiting { session, others } if others.is_empty() => {
                write!(
                    f,
                    "no server answers for session `{session}` yet; asking until one does"
                )
            }
            Self::Waiting { session, others } => {
                let others: Vec<&str> = others.iter().map(SessionId::as_str).collect();
                write!(
                    f,
                    "no server answers for session `{session}` yet; the sessions that run are: {}; asking until one does",
                    others.join(", ")
                )
            }
            Self::Stopped { reason } => {
                write!(f, "{reason}; asking until that is cleared")
            }
            Self::Joined {
                node,
                session,
                tool,
                lease,
                scheme,
                after_s,
            } => {
                let again = if after_s.is_some() { " again" } else { "" };
                write!(
                    f,
                    "joined session `{session}` on {node}{again}: tool {tool}, lease {lease}, scheme {scheme}"
                )?;
                after_s.map_or(Ok(()), |after_s| {
                    write!(f, ", {after_s:.1} s after the link was lost")
                })
            }
            Self::Ticking {
                device,
                tick_s,
                profile,
                scheduler,
            } => {
                write!(
                    f,
                    "device {device}, a tick every {} ms, scheduler: {scheduler}; the hand meets at most {} N, {} N/s, {} m/s, {} W",
                    tick_s * 1e3,
                    profile.force_n,
                    profile.slew_n_per_s,
                    profile.speed_m_s,
                    profile.power_w
                )
            }
            Self::Live {
                lease,
                after_s: None,
            } => write!(f, "frames come under lease {lease}"),
            Self::Live {
                after_s: Some(after_s),
                ..
            } => write!(f, "frames come again, after {after_s:.2} s: force returns"),
            Self::Together { after_s } => {
                write!(
                    f,
                    "frames come again, after {after_s:.2} s: what was cut meanwhile is told"
                )
            }
            Self::Silent { silence_s } => {
                write!(
                    f,
                    "no frame from the server for {silence_s} s: force released, joining again"
                )
            }
            Self::OnCopy { silence_s } => write!(
                f,
                "no frame from the server for {silence_s} s: going on with the copy of the clay"
            ),
            Self::OnStaleCopy => f.write_str(
                "still no frame: the copy of the clay is no longer cut, and its force fades",
            ),
            Self::ServerGone => f.write_str("the server has gone: force released, joining again"),
            Self::TakenBack { reason } => {
                write!(
                    f,
                    "the server has taken the tool back: {reason}; force released"
                )
            }
            Self::Copied { epoch, took_s } => write!(
                f,
                "a copy of block {epoch} is here, after {took_s:.2} s: it is felt and cut at once"
            ),
            Self::NotRefreshed { reason } => {
                write!(
                    f,
                    "the server does not tell what is needed, asking again: {reason}"
                )
            }
            Self::Paused => f.write_str("the session is paused: force released until it goes on"),
            Self::SessionFault => f.write_str(
                "the tool is in fault: force released until it is joined anew or its clay is reset",
            ),
            Self::RoundFinished { rounds } => {
                write!(f, "round {rounds} is finished: asking for fresh clay")
            }
            Self::FreshClay { epoch } => write!(f, "fresh clay, block {epoch}"),
            Self::NoFreshClay { reason } => write!(f, "no fresh clay: {reason}"),
            Self::RecordingEnded { reason } => {
                write!(f, "ticks are no longer recorded: {reason}")
            }
            Self::AtFence { nearest, clearance } => write!(
                f,
                "the robot comes near a singularity ({nearest}; clearance {clearance:.2} of 1): it slows down and resists"
            ),
            Self::ClearOfFence => f.write_str("the robot is clear of the singularity"),
            Self::Status(status) => write!(f, "{status}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_say_what_happened_and_what_follows() {
        let silent = Event::Silent { silence_s: 0.1 };
        assert_eq!(
            silent.to_string(),
            "no frame from the server for 0.1 s: force released, joining again"
        );
        assert_eq!(silent.weight(), Weight::Warning);
        let session = SessionId::new("demo").unwrap();
        let waiting = |others| {
            Event::Waiting {
                session: session.clone(),
                others,
            }
            .to_string()
        };
        assert!(waiting(vec![]).contains("no server answers for session `demo`"));
        assert!(waiting(vec![SessionId::new("both").unwrap()]).contains("that run are: both;"));
    }
}
